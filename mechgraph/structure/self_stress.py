"""Self-stresses as a sparse basis over reaction components, the same at any size, and the groups of states that share components.

The basis depends on the space of self-stresses and on the order of declaration only: those of every single loop in reduced echelon
form, loop by loop, then those that connect loops (without any part in the former) in reduced echelon form together.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array, null_space
from mechgraph.closure.indexing import Index
from mechgraph.graph.linkgraph import labels_of_bipartite
from mechgraph.numerics.tolerances import STRESSES
from mechgraph.structure.components import Label

COMBINED = 300
"""Number of components of a group up to which combinations across pairs are computed."""


@dataclass(frozen=True, repr=False)
class SelfStress:
    """A reaction state without load: coefficients by ``pair:component``, the largest 1, moments divided by L so that they compare."""

    components: Mapping[str, float]
    efforts: Mapping[str, float]
    group: int = 0

    @property
    def text(self) -> str:
        """The state in one line."""
        parts = [*self.components.items(), *((f"effort {name}", value) for name, value in self.efforts.items())]
        line = " ".join(
            f"{'-' if v < 0 else '+'} {'' if abs(abs(v) - 1) < 5e-4 else f'{abs(v):.3g} '}{name}" for name, v in parts
        )
        return line.removeprefix("+ ")

    def __repr__(self) -> str:
        return f"SelfStress({self.text!r})"


@dataclass(frozen=True)
class Basis:
    """Self-stresses ``states (components, s)``, sorted by ``group (s,)``; states that share a component belong together.

    ``groups`` is their number; ``partly`` are those not all of whose states are here.
    """

    states: scipy.sparse.csc_array
    group: Index
    groups: int
    partly: frozenset[int]

    def state(self, i: int, labels: list[Label]) -> SelfStress:
        """One state by names."""
        at = slice(int(self.states.indptr[i]), int(self.states.indptr[i + 1]))
        parts = [
            (labels[c], float(v))
            for c, v in zip(self.states.indices[at].tolist(), self.states.data[at], strict=True)
            if abs(v) > STRESSES.shown
        ]
        return SelfStress(
            {f"{pair}:{name}": v for (pair, name), v in parts if not name.startswith("effort")},
            {f"{pair}{name[6:].replace(' ', '.')}": v for (pair, name), v in parts if name.startswith("effort")},
            int(self.group[i]),
        )


def basis_of(count: int, parts: list[tuple[Index, Index, Array]], connected: list[Index]) -> Basis:
    """The basis from self-stresses ``(n, c, s)`` in places ``(n, c)``, in the order of their numbers ``(n,)``.

    Each list of places ``connected`` belongs to one group, by states that are not given.
    """
    keys = np.concatenate([np.zeros(0, dtype=np.intp), *(np.repeat(key, v.shape[2]) for key, _, v in parts)])
    column_of = np.empty(len(keys), dtype=np.intp)
    column_of[np.argsort(keys, kind="stable")] = np.arange(len(keys))
    rows, columns, data, at = [np.zeros(0, dtype=np.intp)], [np.zeros(0, dtype=np.intp)], [np.zeros(0)], 0
    for _, places, values in parts:
        n, _, s = values.shape
        made = canonical(values)
        k, i, j = np.nonzero(made)
        rows.append(places[k, i])
        columns.append(column_of[at + k * s + j])
        data.append(made[k, i, j])
        at += n * s
    row, column, value = np.concatenate(rows), np.concatenate(columns), np.concatenate(data)
    states = scipy.sparse.csc_array((value, (row, column)), shape=(count, at))
    shown = np.abs(value) > STRESSES.shown
    ties = np.repeat(np.arange(len(connected)), [len(p) for p in connected])
    touch = scipy.sparse.coo_array(
        (
            np.ones(int(shown.sum()) + len(ties)),
            (np.concatenate([column[shown], at + ties]), np.concatenate([row[shown], *connected])),
        ),
        shape=(at + len(connected), count),
    )
    group = labels_of_bipartite(touch)
    order = np.argsort(group[:at], kind="stable")
    return Basis(states[:, order], group[:at][order], int(group.max(initial=-1)) + 1, frozenset(group[at:].tolist()))


def combinations(basis: Basis, labels: list[Label], known: set[int]) -> tuple[tuple[tuple[int, str], ...], int]:
    """Per group the sums of components that are unique though their terms are not; ``known`` components are left out.

    A component that a combination found before ties to others of its pair is determined by it, so it is among ``known``.
    Also returned: the number of groups that have too many components for it.
    """
    out, unsought = [], 0
    starts = np.searchsorted(basis.group, np.arange(basis.groups + 1))
    for group in range(basis.groups):
        mine = basis.states[:, starts[group] : starts[group + 1]]
        touched = [int(i) for i in np.unique(mine.indices[np.abs(mine.data) > STRESSES.shown]) if int(i) not in known]
        if len(touched) > COMBINED or group in basis.partly:
            unsought += 1
            continue
        rows = mine.tocsr()[touched].toarray()
        for column in canonical(null_space(rows.T, 1e-9)[None])[0].T:
            terms = {
                ":".join(labels[i]): float(v) for i, v in zip(touched, column, strict=True) if abs(v) > STRESSES.shown
            }
            out.append((group, SelfStress(terms, {}).text))
    return tuple(out), unsought


def canonical(columns: Array) -> Array:
    """Sparse bases of column spaces ``(n, c, s)`` that depend on the spaces and the order of their rows only.

    Reduced echelon form taken from the first row on and from the last row on; the sparser is kept. Columns are scaled so that
    their largest entry is one.
    """
    if not columns.size:
        return columns
    forward, backward = _echelon(columns), _echelon(columns[:, ::-1])[:, ::-1]
    terms = [(np.abs(A) > STRESSES.shown).sum(axis=(1, 2)) for A in (forward, backward)]
    best = np.where((terms[0] <= terms[1])[:, None, None], forward, backward)
    best = best / np.maximum(np.abs(best).max(axis=1, keepdims=True), 1e-300)
    first = np.argmax(np.abs(best) > 1 - 1e-9, axis=1)
    best = best * np.sign(np.take_along_axis(best, first[:, None], axis=1))
    return np.where(np.abs(best) < 1e-9, 0.0, best)


def _echelon(columns: Array) -> Array:
    """Column echelon forms with unit pivots in the first rows that can have them (entries against the largest), all at once."""
    A = columns / np.maximum(np.abs(columns).max(axis=(1, 2), keepdims=True), 1e-300)
    n, _, s = A.shape
    each = np.arange(n)
    rows = np.arange(A.shape[1])
    for done in range(s):
        size = np.abs(A[:, :, done:]).max(axis=2)
        i = np.argmax(size >= STRESSES.shown, axis=1)
        A[:, :, done:] = np.where((rows[None] < i[:, None])[:, :, None], 0.0, A[:, :, done:])
        j = done + np.argmax(np.abs(A[each, i, done:]), axis=1)
        pivot = A[each, :, j]
        A[each, :, j] = A[:, :, done]
        height = pivot[each, i]
        pivot = pivot / np.where(np.abs(height) < STRESSES.shown, 1.0, height)[:, None]
        A[:, :, done] = 0.0
        A -= pivot[:, :, None] * A[each, i][:, None, :]
        A[:, :, done] = pivot
    return A
