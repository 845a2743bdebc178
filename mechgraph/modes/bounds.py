"""Bounds of the number of assemblies: products over loops that can be solved one after the other, each with a published bound.

With the drivers at rest every loop in turn must have as many unknown freedoms as its group has dimensions; then the assemblies are at
most the product of those of the loops. A loop counts by the letters of its freedoms that are still unknown, in order round the loop.
A slide is a turn about a line far away, and regular assemblies stay where dimensions change a little: what bounds turns bounds slides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.modes.family import Family, span
from mechgraph.topology.components import components_of_edges, members

SIX_TURNS = (
    "Lee, Woernle and Hiller, A complete solution for the inverse kinematic problem of the general 6R robot manipulator, "
    "J. Mech. Des. 113, 1991, page 481"
)
LOOPS: tuple[tuple[int, str, int, str], ...] = (
    (3, "RRR", 2, "two circles in a plane or on a sphere meet in two points"),
    (3, "RRT", 2, "a circle and a line meet in two points"),
    (3, "RTT", 1, "the sides of a triangle follow from their directions"),
    (6, "RRRRRR", 16, SIX_TURNS),
    (6, "RRRRRT", 16, f"{SIX_TURNS}; a slide is a turn about a far line"),
)
"""Dimension of the group, freedoms still unknown (R turns, T slides), the bound, and its source."""


LEGS: tuple[tuple[int, int, int, int, str], ...] = (
    (
        6,
        3,
        6,
        40,
        "Ronga and Vust, Stewart platforms without computer?, Real Analytic and Algebraic Geometry, 1995, page 197",
    ),
    (
        3,
        2,
        3,
        6,
        "a coupler curve, of degree six and threefold in the circular points, meets a circle in 12 - 6 others",
    ),
)
"""Dimension of the group of all loops and of its translations, number of legs that keep a distance between two bodies, the bound, and its
source."""


@dataclass(frozen=True)
class Bound:
    """At most so many assemblies, and who says so."""

    count: int
    source: str


def bound(family: Family) -> Bound | None:
    """The bound for a class, where the tables have one."""
    return _of_legs(family) or _of_loops(family)


def _of_loops(family: Family) -> Bound | None:
    """The product over loops solved one after the other, where the table has one for each of them."""
    s = family.system
    known = np.zeros(s.n_freedoms, dtype=bool)
    known[family.columns] = True
    if family.passive.shape[1]:
        return None
    left, count, sources = list(range(s.graph.n_loops)), 1, []
    while left:
        for loop in left:
            columns = s.loop_columns[loop][0]
            unknown = columns[~known[columns]]
            entry = _entry(
                family.loop_algebras[loop].shape[1], "".join("T" if s.is_length[c] else "R" for c in unknown)
            )
            if entry is not None:
                break
        else:
            return None
        count *= entry.count
        if entry.source not in sources:
            sources.append(entry.source)
        known[unknown] = True
        left.remove(loop)
    return Bound(count, "; ".join(sources))


def _entry(dimension: int, letters: str) -> Bound | None:
    """The bound of one loop, its freedoms in any order round it."""
    turned = {letters[i:] + letters[:i] for i in range(len(letters))}
    for group, known, count, source in LOOPS:
        if group == dimension and (known in turned or known[::-1] in turned):
            return Bound(count, source)
    return None


def _of_legs(family: Family) -> Bound | None:
    """The bound of two bodies joined by legs, links that turn about a point of either; links between which all is driven are one."""
    s, P = family.system, range(len(family.system.m.pairs))
    driven = set(family.columns.tolist())
    columns = [range(s.first_column[k], s.first_column[k + 1]) for k in P]
    locked = [k for k in P if driven.issuperset(columns[k])]
    body = np.empty(len(s.m.links), dtype=np.intp)
    for number, links in enumerate(members(components_of_edges(len(body), [s.graph.ends[k] for k in locked]))):
        body[links] = number
    joints: dict[int, list[int]] = {}
    for k in P:
        one, other = (int(body[link]) for link in s.graph.ends[k])
        if k in locked:
            continue
        if (
            s.is_length[columns[k]].any()
            or any(np.any(f.twist[3:]) for f in s.m.pairs[k].type.freedoms)
            or one == other
        ):
            return None
        joints.setdefault(one, []).append(other)
        joints.setdefault(other, []).append(one)
    ends = {number for number, others in joints.items() if len(others) > 2}
    legs = [others for number, others in joints.items() if number not in ends]
    if len(ends) != 2 or any(set(others) != ends for others in legs):
        return None
    groups = {(h.shape[1], h.shape[1] - span(h[:3]).shape[1]) for h in family.loop_algebras}
    found = (Bound(count, source) for k, slides, n, count, source in LEGS if {(k, slides)} == groups and n == len(legs))
    return next(found, None)
