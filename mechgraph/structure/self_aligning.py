"""Self-aligning variants: all choices of wider pairs that take away the whole redundancy and leave the mobility as it is.

Changes together do that when they add as many freedoms as there are self-stresses and their powers on these, one below the other, have
that rank; so the powers of any part of them are independent too, and sets grow change by change. Source: Reshetov, Self-Aligning
Mechanisms, 1982.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.numerics.tolerances import STRESSES
from mechgraph.structure.pair_changes import LARGEST_FOR_SETS, Change


def rank_key(chosen: tuple[Change, ...]) -> tuple[int, int, int, tuple[int, ...]]:
    """Those easiest to build first (by the hardest change, as in the advice), then fewer, then narrower ones, then by declaration."""
    widest = max(c.added for c in chosen)
    return max(c.effort for c in chosen), len(chosen), widest, tuple(c.item for c in chosen)


def self_aligning_sets(changes: Iterable[Change], redundancy: int, most: int) -> Iterator[tuple[Change, ...]]:
    """The sets of up to ``most`` of the changes that remove the whole redundancy, the best first."""
    if not 0 < redundancy <= LARGEST_FOR_SETS:
        return
    exact = sorted((c for c in changes if c.pair is not None and c.added == c.relief), key=lambda c: c.item)
    bases = [np.linalg.svd(c.power, full_matrices=False)[2][: c.added] for c in exact]
    found = [tuple(exact[i] for i in s) for size in range(1, most + 1) for s in _sets(exact, bases, redundancy, size)]
    yield from sorted(found, key=rank_key)


def _sets(exact: list[Change], bases: list[Array], redundancy: int, size: int) -> Iterator[tuple[int, ...]]:
    """Sets of ``size`` changes of different pairs, as numbers, that remove ``redundancy`` self-stresses."""
    widest = max((c.added for c in exact), default=0)
    waiting: list[tuple[tuple[int, ...], Array]] = [((), np.zeros((0, bases[0].shape[1] if bases else 0)))]
    while waiting:
        chosen, basis = waiting.pop()
        left, further = redundancy - len(basis), size - len(chosen)
        if further == 0:
            yield chosen
            continue
        for i in range(chosen[-1] + 1 if chosen else 0, len(exact)):
            added = exact[i].added
            reach = added + widest * (further - 1)
            fits = added == left if further == 1 else added <= left - (further - 1) and reach >= left
            if not fits or (chosen and exact[i].item == exact[chosen[-1]].item):
                continue
            rest = bases[i] - bases[i] @ basis.T @ basis
            _, s, Vt = np.linalg.svd(rest, full_matrices=False)
            if s[-1] > STRESSES.relieved:
                waiting.append(((*chosen, i), np.concatenate([basis, Vt])))
