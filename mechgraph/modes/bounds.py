"""Bounds of the number of assemblies: products over loops that can be solved one after the other, each with a published bound.

With the drivers at rest every loop in turn must have as many unknown freedoms as its group has dimensions; then the assemblies are at
most the product of those of the loops. A loop counts by the letters of its freedoms that are still unknown, in order round the loop.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.modes.family import Family

LOOPS: tuple[tuple[int, str, int, str], ...] = (
    (3, "RRR", 2, "two circles meet in two points, or two great circles' arcs in two (dyad, Chiang 1988, chapter 3)"),
    (3, "RRT", 2, "a circle and a line meet in two points"),
    (3, "RTT", 1, "directions of a triangle are known"),
    (6, "RRRRRR", 16, "the general 6R chain has 16 postures (Primrose, Mech. Mach. Theory 21, 1986)"),
    (
        6,
        "RRRRRT",
        16,
        "the general 5R-P chain has 16 postures (Pieper and Roth; Duffy and Crane, Mech. Mach. Theory 15, 1980)",
    ),
)
"""Dimension of the group, freedoms still unknown (R turns, T slides), the bound, and its source."""


@dataclass(frozen=True)
class Bound:
    """At most so many assemblies, and who says so."""

    count: int
    source: str


def bound(family: Family) -> Bound | None:
    """The bound for a class, where the table has one for every loop."""
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
