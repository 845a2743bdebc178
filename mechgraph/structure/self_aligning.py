"""Self-aligning variants: all choices of wider pairs that take away the whole redundancy and leave the mobility as it is.

Changes together do that when they add as many freedoms as there are self-stresses and their powers on these, one below the other, have
that rank; so the powers of any part of them are independent too, and sets grow change by change. Source: Reshetov, Self-Aligning
Mechanisms, 1982.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import product

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.numerics.tolerances import STRESSES
from mechgraph.structure.pair_changes import LARGEST_FOR_SETS, Change


def rank_key(chosen: tuple[Change, ...]) -> tuple[int, int, int]:
    """Those easiest to build first (by the hardest change, as in the advice), then fewer, then narrower ones."""
    return max(c.effort for c in chosen), len(chosen), max(c.added for c in chosen)


def self_aligning_sets(changes: Iterable[Change], redundancy: int, most: int | None) -> Iterator[tuple[Change, ...]]:
    """The sets of up to ``most`` of the changes (None: of any number) that remove the whole redundancy, the best first.

    Found one after the other, by ``rank_key`` and then by declaration, so that the first ones cost little however many there are.
    """
    if not 0 < redundancy <= LARGEST_FOR_SETS:
        return
    exact = sorted((c for c in changes if c.pair is not None and c.added == c.relief), key=lambda c: c.item)
    bases = {id(c): np.linalg.svd(c.power, full_matrices=False)[2][: c.added] for c in exact}
    sizes = range(1, min(redundancy, redundancy if most is None else most) + 1)
    widths = sorted({c.added for c in exact})
    for effort, size, widest in product(sorted({c.effort for c in exact}), sizes, widths):
        if size + widest - 1 <= redundancy <= size * widest:
            some = [c for c in exact if c.effort <= effort and c.added <= widest]
            for chosen in _sets(some, [bases[id(c)] for c in some], redundancy, size):
                if rank_key(chosen) == (effort, size, widest):
                    yield chosen


def _sets(exact: list[Change], bases: list[Array], redundancy: int, size: int) -> Iterator[tuple[Change, ...]]:
    """Sets of ``size`` changes of different pairs that remove ``redundancy`` self-stresses, in the order of the changes."""
    widest = max((c.added for c in exact), default=0)
    waiting: list[tuple[tuple[int, ...], Array]] = [((), np.zeros((0, bases[0].shape[1] if bases else 0)))]
    while waiting:
        chosen, basis = waiting.pop()
        left, further = redundancy - len(basis), size - len(chosen)
        if further == 0:
            yield tuple(exact[i] for i in chosen)
            continue
        longer = []
        for i in range(chosen[-1] + 1 if chosen else 0, len(exact)):
            added = exact[i].added
            reach = added + widest * (further - 1)
            fits = added == left if further == 1 else added <= left - (further - 1) and reach >= left
            if not fits or (chosen and exact[i].item == exact[chosen[-1]].item):
                continue
            rest = bases[i] - bases[i] @ basis.T @ basis
            _, s, Vt = np.linalg.svd(rest, full_matrices=False)
            if s[-1] > STRESSES.relieved:
                longer.append(((*chosen, i), np.concatenate([basis, Vt])))
        waiting += longer[::-1]
