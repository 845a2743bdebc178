"""Bounds of the number of assemblies: products over loops that can be solved one after the other, each with a published bound.

With the drivers at rest every loop in turn must have as many unknown freedoms as its group has dimensions; then the assemblies are at
most the product of those of the loops. A loop counts by the letters of its freedoms that are still unknown, in order round the loop.
A slide is a turn about a line far away, and regular assemblies stay where dimensions change a little: what bounds turns bounds slides.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from mechgraph.graph.linkgraph import components_of_edges
from mechgraph.modes.family import Family, span
from mechgraph.modes.rods import RodFamily

SIX_TURNS = (
    "Lee, Woernle and Hiller, A complete solution for the inverse kinematic problem of the general 6R robot manipulator, "
    "J. Mech. Des. 113, 1991, page 481"
)
FORTY = (
    "Mourrain, The 40 generic positions of a parallel robot, ISSAC 1993; Ronga and Vust, Stewart platforms without computer?, "
    "Real Analytic and Algebraic Geometry, 1995"
)
SIXTEEN = (
    "three joints on circles at given distances from each other: three equations of degree 2 in the half-angle tangents of two of "
    "them each have 16 solutions or fewer (Bezout in a product of lines)"
)
LOOPS: tuple[tuple[int, str, int, str], ...] = (
    (3, "RRR", 2, "two circles in a plane or on a sphere meet in two points"),
    (3, "RRT", 2, "a circle and a line meet in two points"),
    (3, "RTT", 1, "the sides of a triangle follow from their directions"),
    (6, "RRRRRR", 16, SIX_TURNS),
    (6, "RRRRRT", 16, f"{SIX_TURNS}; a slide is a turn about a far line"),
)
"""Dimension of the group, freedoms still unknown (R turns, T slides), the bound, and its source."""


PLATFORMS: tuple[tuple[str, int, tuple[int, ...], int, str], ...] = (
    ("R", 1, (), 2, "a circle and a sphere meet in two points"),
    ("T", 1, (), 2, "a line and a sphere meet in two points"),
    ("S", 3, (), 8, "three quadrics in the quaternion of a rotation meet in 8 points or fewer (Bezout)"),
    ("TTTS", 6, (2, 2, 2), 16, SIXTEEN),
    ("TTTS", 6, (), 40, FORTY),
    ("TTS", 5, (), 40, f"{FORTY}; a point on a plane is on a rod from far away"),
)
"""What lets one body move against another (R turns, T slides, S is a ball), and rods between them: their number, how many have each joint
of the one body in common, whatever their joints on the other (nothing where it does not matter), the bound, and its source."""
TRIADS = (6, "a coupler curve, of degree six and threefold in the circular points, meets a circle in 12 - 6 others")
"""The bound of two bodies in a plane joined by three links, and its source."""
PLANE_MOTIONS = (3, 2)
"""Dimensions of the group of plane motions and of its translations."""


@dataclass(frozen=True)
class Bound:
    """At most so many assemblies, and who says so."""

    count: int
    source: str


def bound(family: Family) -> Bound | None:
    """The bound for a class, where the tables have one."""
    return _of_platform(family) if isinstance(family, RodFamily) else _of_triad(family) or _of_loops(family)


def _of_platform(family: RodFamily) -> Bound | None:
    """The bound of two bodies joined by rods and one pair, those one between which all is driven."""
    s = family.system
    free = set(family.free.tolist())
    columns = [set(range(s.first_column[k], s.first_column[k + 1])) for k in range(len(s.m.pairs))]
    moving = [k for k, own in enumerate(columns) if not free.isdisjoint(own)]
    body = components_of_edges(len(s.m.links), [ends for k, ends in enumerate(s.graph.ends) if k not in moving])
    joined = {tuple(sorted(body[[a, b]].tolist())) for a, b in zip(s.points.a, s.points.b, strict=True)}
    if len(moving) != 1 or not free.issuperset(columns[moving[0]]) or joined != {(0, 1)}:
        return None
    word = "".join(
        "S" if step.holds_rotation else "R" if step.freedoms[0].turns else "T"
        for step in s.m.pairs[moving[0]].type.steps
    )
    shared = [(), *(tuple(sorted(Counter(side.tolist()).values())) for side in np.split(family.joints, 2))]
    for letters, rods, joints, count, source in PLATFORMS:
        if letters in (word, word[::-1]) and rods == family.rods and joints in shared:
            return Bound(count, source)
    return None


def _of_loops(family: Family) -> Bound | None:
    """The product over loops solved one after the other, where the table has one for each of them."""
    s = family.system
    known = np.ones(s.n_freedoms, dtype=bool)
    known[family.free] = False
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
    return Bound(count, "; ".join(sources) or "no loop has to be closed")


def _entry(dimension: int, letters: str) -> Bound | None:
    """The bound of one loop, its freedoms in any order round it."""
    turned = {letters[i:] + letters[:i] for i in range(len(letters))}
    for group, known, count, source in LOOPS:
        if group == dimension and (known in turned or known[::-1] in turned):
            return Bound(count, source)
    return None


def _of_triad(family: Family) -> Bound | None:
    """The bound of two bodies in a plane joined by three links; links between which all is driven are one."""
    s, P = family.system, range(len(family.system.m.pairs))
    free = set(family.free.tolist())
    columns = [range(s.first_column[k], s.first_column[k + 1]) for k in P]
    locked = [k for k in P if free.isdisjoint(columns[k])]
    body = components_of_edges(len(s.m.links), [s.graph.ends[k] for k in locked])
    joints: dict[int, list[int]] = {}
    for k in P:
        one, other = (int(body[link]) for link in s.graph.ends[k])
        if k in locked:
            continue
        if s.is_length[columns[k]].any() or one == other:
            return None
        joints.setdefault(one, []).append(other)
        joints.setdefault(other, []).append(one)
    ends = {number for number, others in joints.items() if len(others) > 2}
    legs = [others for number, others in joints.items() if number not in ends]
    if len(ends) != 2 or len(legs) != 3 or any(set(others) != ends for others in legs):
        return None
    groups = {(h.shape[1], h.shape[1] - span(h[:3]).shape[1]) for h in family.loop_algebras}
    return Bound(*TRIADS) if groups == {PLANE_MOTIONS} else None
