"""Sets of changes that together remove redundancy: searched for the smallest, or put together from cylinders between balls and the rest.

With the power of every change on the self-stresses (``structure.pair_changes``), changes remove as many of them together as the rank of
their powers one below the other.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from time import monotonic

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array, null_space
from mechgraph.closure.indexing import Index
from mechgraph.numerics.tolerances import STRESSES
from mechgraph.structure.pair_changes import CHANGES_SHOWN, LARGEST_FOR_SETS, PLANE, Change
from mechgraph.structure.position import Position

CYLINDER = ("S", "C", "S")
"""Pair types of a cylinder that carries force along its line alone: ball joint, piston in a round bore, ball joint."""

BEAM = 12
"""Partial sets of changes kept while searching."""


def relieving(
    position: Position, changes: list[Change], redundancy: int, until: float
) -> tuple[list[tuple[Change, ...]], list[tuple[Change, ...]]]:
    """Single changes that lower the redundancy, and smallest sets that remove it, without more freedoms than self-stresses removed.

    Ranked by how little they change: freedoms added beyond need, then number of changes, then the order of declaration. Where there are
    too many self-stresses for that the set is one change in every loop. Sets are sought up to the time ``until``.
    """
    every = sorted((c for c in changes if c.relief), key=lambda c: (c.added - c.relief, -c.relief, c.effort, c.item))
    built = [c for c in every if c.effort < PLANE]
    singles: list[tuple[Change, ...]] = [(c,) for c in spread(built or every)]
    if redundancy > LARGEST_FOR_SETS:
        return singles, [_one_in_every_loop(position, built or every)]
    largest: list[tuple[Change, ...]] = []
    for some in (built, every):
        exact = [c for c in some if c.added == c.relief]
        complete, most = _complete_sets(exact, redundancy, until) if exact else ([], [])
        if complete:
            return singles, complete
        largest = largest or most
    return singles, [chosen for chosen in largest if len(chosen) > 1]


def _one_in_every_loop(position: Position, ranked: list[Change]) -> tuple[Change, ...]:
    """For every loop the best change of a pair that no loop before has changed, if possible of one that is in no other loop."""
    best: dict[int, Change] = {}
    for c in ranked:
        best.setdefault(c.item, c)
    loops_of = Counter(k for loop in position.graph.loops for k, _ in loop)
    chosen: dict[int, Change] = {}
    for loop in position.graph.loops:
        mine = [best[k] for k, _ in loop if k in best and k not in chosen]
        if mine:
            c = min(mine, key=lambda c: (c.added - c.relief, -c.relief, loops_of[c.item], c.effort, c.item))
            chosen[c.item] = c
    return tuple(chosen[k] for k in sorted(chosen))


@dataclass(frozen=True)
class _Set:
    """Changes (by number) that together remove ``removed`` self-stresses; for the changes from ``first`` on, all of later pairs, what
    these leave of their ``directions (n, a, s)``, and whether they can still be added: all their directions are left.
    """

    chosen: tuple[int, ...]
    removed: int
    first: int
    directions: Array
    free: NDArray[np.bool_]

    def with_change(self, i: int, items: Index, added: Index) -> _Set:
        """One more change; only what overlaps with its directions is looked at anew."""
        new = np.linalg.svd(self.directions[i - self.first], full_matrices=False)[2][: added[i]]
        later = int(np.searchsorted(items, items[i], side="right"))
        directions, free = self.directions[later - self.first :].copy(), self.free[later - self.first :].copy()
        overlap = directions @ new.T
        met = np.flatnonzero(free & (np.abs(overlap) > STRESSES.relieved).any(axis=(1, 2)))
        directions[met] -= overlap[met] @ new
        free[met] = _independent(directions[met], added[later:][met])
        return _Set((*self.chosen, i), self.removed + int(added[i]), later, directions, free)


def _independent(directions: Array, added: Index) -> NDArray[np.bool_]:
    """Whether directions ``(n, a, s)``, of which the first ``added (n,)`` count, are independent: by their Gram matrices."""
    gram = directions @ np.swapaxes(directions, 1, 2)
    return np.asarray((np.linalg.eigvalsh(gram) > STRESSES.relieved**2).sum(axis=1) == added)


def _complete_sets(
    exact: list[Change], redundancy: int, until: float
) -> tuple[list[tuple[Change, ...]], list[tuple[Change, ...]]]:
    """Sets of changes that together remove all self-stresses, each as many as it adds freedoms; else those that remove most.

    A set grows by changes of later pairs, a beam of sets at a time, those first that remove most.
    """
    exact = sorted(exact, key=lambda c: c.item)
    items, added = (np.array([getattr(c, name) for c in exact], dtype=np.intp) for name in ("item", "added"))
    directions = np.zeros((len(exact), int(added.max()), exact[0].power.shape[1]))
    for mine, c in zip(directions, exact, strict=True):
        mine[: c.added] = np.linalg.svd(c.power, full_matrices=False)[2][: c.added]
    at: list[int] = items.tolist()
    beam = [_Set((), 0, 0, directions, np.ones(len(exact), dtype=bool))]
    complete: list[tuple[int, ...]] = []
    largest: list[tuple[int, ...]] = []
    most = 0
    while beam and monotonic() <= until:
        grown = [
            (mine.removed + int(added[i]), mine, i)
            for mine in beam
            for i in (mine.first + np.flatnonzero(mine.free)).tolist()
        ]
        # changes are numbered by item, so that equal sets of items stay in the order of their types
        order = {id(mine): [at[k] for k in mine.chosen] for mine in beam}
        grown.sort(key=lambda g: (-g[0], order[id(g[1])], at[g[2]]))
        complete += [(*mine.chosen, i) for removed, mine, i in grown if removed == redundancy]
        if grown and grown[0][0] > most:
            most, largest = grown[0][0], []
        largest = [(*mine.chosen, i) for removed, mine, i in grown[:2] if removed == most] + largest
        going = [(mine, i) for removed, mine, i in grown if removed < redundancy][:BEAM]
        beam = [mine.with_change(i, items, added) for mine, i in going]
    return [tuple(exact[i] for i in s) for s in complete], [tuple(exact[i] for i in s) for s in largest]


def mixed(complete: list[tuple[Change, ...]]) -> list[tuple[Change, ...]]:
    """Up to two sets of every size, those that are easily built and whose widest change is smallest first."""
    out: list[tuple[Change, ...]] = []
    for size in sorted({len(chosen) for chosen in complete}):
        mine = [chosen for chosen in complete if len(chosen) == size]
        out += sorted(mine, key=lambda chosen: (max(c.effort for c in chosen), max(c.added for c in chosen)))[:2]
    return out


def spread(singles: list[Change]) -> list[Change]:
    """The best changes, not all at one pair: the best of every pair first."""
    first: list[Change] = []
    rest: list[Change] = []
    seen: set[int] = set()
    for c in singles:
        (rest if c.item in seen else first).append(c)
        seen.add(c.item)
    return (first + rest)[:CHANGES_SHOWN]


def cylinders(position: Position) -> list[tuple[int, int, int]]:
    """Foot, slide and head: a slide both links of which have one more pair."""
    pairs_of: dict[int, list[int]] = {}
    for k, ends in enumerate(position.graph.ends):
        for link in ends:
            pairs_of.setdefault(link, []).append(k)
    out = []
    for k, ends in enumerate(position.graph.ends):
        row = position.type_of(k)
        around = [[other for other in pairs_of[link] if other != k] for link in ends if link != position.graph.frame]
        if row.f == 1 and not row.freedoms[0].turns and [len(others) for others in around] == [1, 1]:
            out.append((around[0][0], k, around[1][0]))
    return out


def between_balls(position: Position, changes: list[Change], redundancy: int) -> list[tuple[Change, ...]]:
    """All cylinders between balls, with changes of other pairs that remove the rest, and alone.

    The halves of a cylinder between balls spin, which is passive.
    """
    found = {(c.item, c.pair.type.symbol): c for c in changes if c.pair is not None}
    sets = [[found.get(key) for key in zip(three, CYLINDER, strict=True)] for three in cylinders(position)]
    chosen = [c for three in sets if all(three) for c in three if c is not None]
    if not chosen:
        return []
    exact = sorted((c for c in changes if c.added == c.relief and c.effort < PLANE), key=lambda c: (c.effort, c.item))
    whole = _completed(chosen, exact) if redundancy <= LARGEST_FOR_SETS else chosen
    return [tuple(chosen)] if len(whole) == len(chosen) else [tuple(whole), tuple(chosen)]


def _completed(chosen: list[Change], exact: list[Change]) -> list[Change]:
    """The changes chosen and others, one after the other, each of which removes as many self-stresses as it adds freedoms."""
    left = null_space(np.concatenate([c.power for c in chosen]), STRESSES.relieved)
    out, taken = list(chosen), {c.item for c in chosen}
    for c in exact:
        power = c.power @ left
        if left.shape[1] and c.item not in taken and np.linalg.matrix_rank(power, tol=STRESSES.relieved) == c.added:
            out.append(c)
            taken.add(c.item)
            left = left @ null_space(power, STRESSES.relieved)
    return out
