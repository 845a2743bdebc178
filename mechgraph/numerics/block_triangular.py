"""Many square systems of one sparse pattern, solved block by block in the order in which their unknowns can be found.

A matching of rows to columns and the strongly connected components of the graph "row needs column" permute the pattern to block triangular
form (the fine decomposition of Dulmage and Mendelsohn, 1958): of the closure equations of a mechanism, its structural groups. Blocks that
wait for none of each other are of one *level*. The diagonal blocks of all systems are inverted together, size by size; a solution goes
through the levels, and through them backwards for the transposed system.
Source: Duff, Erisman and Reid, Direct Methods for Sparse Matrices, 2017, chapter 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.numerics.linear import inverses

Array = NDArray[np.float64]
Index = NDArray[np.intp]
WIDEST, STEPS = 60, 3
"""Largest block, and number of steps a system, up to which blocks are faster.

Measured by ``tests/benchmarks/bench_large.py --groups``: on chains of N groups blocks and whole systems take the same time for 8 systems
of 20 steps, 32 of 100, 60 of 400; a dense inverse of 60 rows takes as long as sparse factors.
"""


@dataclass(frozen=True)
class _Sums:
    """Products of entries with unknowns, ``entries (n,)`` times ``factors (n,)``, summed from ``starts`` on into ``places``."""

    entries: Index
    factors: Index
    places: Index
    starts: Index

    @classmethod
    def of(cls, entries: Index, to: Index, factors: Index) -> _Sums:
        """Sums of entries by where they go ``to``."""
        order = np.argsort(to, kind="stable")
        places, starts = np.unique(to[order], return_index=True)
        return cls(entries[order], factors[order], places, starts.astype(np.intp))

    def subtract(self, y: Array, values: Array, x: Array) -> None:
        """Take the sums of ``values (entries, T)`` times ``x (size, k, T)`` from ``y (size, k, T)``."""
        if self.places.size:
            y[self.places] -= np.add.reduceat(values[self.entries][:, None] * x[self.factors], self.starts, axis=0)


@dataclass(frozen=True)
class _Step:
    """Blocks of one ``size`` at one level: unknowns ``first`` to ``end``, blocks ``at`` among those of that size, what they need before.

    ``needs`` of the rows for the system itself, ``transposed`` of the columns for the transposed one.
    """

    size: int
    first: int
    end: int
    at: slice
    needs: _Sums
    transposed: _Sums


class BlockTriangular:
    """The block triangular form of a square pattern with entries at ``(rows, cols)``, each place once.

    ``blocks`` their number, ``sizes`` how many of which size, ``levels`` how many levels; none where the pattern has no matching
    (``blocks`` is 0).
    """

    def __init__(self, rows: Index, cols: Index, size: int) -> None:
        self.size, self.blocks, self.levels, self.sizes = size, 0, 0, dict[int, int]()
        pattern = scipy.sparse.csr_array((np.ones(len(rows)), (rows, cols)), shape=(size, size))
        row_of = scipy.sparse.csgraph.maximum_bipartite_matching(pattern, perm_type="row").astype(np.intp)
        if size == 0 or (row_of < 0).any():
            return
        needing = np.argsort(row_of)[rows]  # the unknown that a row is matched to
        needs = scipy.sparse.csr_array((np.ones(len(rows)), (needing, cols)), shape=(size, size))
        self.blocks, of = scipy.sparse.csgraph.connected_components(needs, connection="strong")
        block = of.astype(np.intp)
        level = _levels(block[cols], block[needing], self.blocks)
        self.levels = int(level.max()) + 1
        count = np.bincount(block)
        self.sizes = {int(n): int(c) for n, c in enumerate(np.bincount(count)) if c}
        order = np.lexsort((block, count[block], level[block]))
        place = np.argsort(order)
        self._unknowns, self._equations = order, row_of[order]
        self._arrange(place[needing], place[cols], block[order], count, level)

    def _arrange(self, rows: Index, cols: Index, block: Index, count: Index, level: Index) -> None:
        """Diagonal blocks and steps, for entries at places in the new order and the ``block`` of every place."""
        first = np.flatnonzero(np.diff(block, prepend=-1))
        own = first[np.cumsum(np.diff(block, prepend=-1) != 0) - 1]  # first place of the block of a place
        width, depth = count[block], level[block]
        inside = own[rows] == own[cols]
        number = np.zeros(self.size, dtype=np.intp)
        self._diagonal = []
        for n in self.sizes:
            starts = first[width[first] == n]
            number[starts] = np.arange(len(starts))
            e = np.flatnonzero(inside & (width[rows] == n))
            start = own[rows[e]]
            self._diagonal.append((n, len(starts), e, (number[start], rows[e] - start, cols[e] - start)))
        waiting = np.flatnonzero(~inside)
        (by_row, row), (by_col, col) = (_sorted(waiting, to) for to in (rows, cols))
        edges = np.flatnonzero((np.diff(depth, prepend=-1) != 0) | (np.diff(width, prepend=-1) != 0))
        self._steps = []
        for begin, end in pairwise([*edges.tolist(), self.size]):
            mine, theirs = by_row[_between(row, begin, end)], by_col[_between(col, begin, end)]
            n, at = int(width[begin]), int(number[begin])
            before, behind = _Sums.of(mine, rows[mine], cols[mine]), _Sums.of(theirs, cols[theirs], rows[theirs])
            self._steps.append(_Step(n, begin, end, slice(at, at + (end - begin) // n), before, behind))
        every = np.arange(len(rows))
        self._products = {False: _Sums.of(every, rows, cols), True: _Sums.of(every, cols, rows)}

    def pays(self, T: int) -> bool:
        """Whether ``T`` systems are solved in less time by blocks, all together, than one after the other as a whole."""
        return self.blocks > 0 and max(self.sizes) <= WIDEST and len(self._steps) <= STEPS * T

    def factor(self, values: Array) -> BlockFactor:
        """The systems with values ``(T, entries)``, factored."""
        return BlockFactor(self, np.ascontiguousarray(values.T))


class BlockFactor:
    """Systems of one block triangular form with ``values (entries, T)``, factored; solves with one step of refinement."""

    def __init__(self, form: BlockTriangular, values: Array) -> None:
        self._form, self._values = form, values
        T = values.shape[1]
        self._inverse: dict[int, Array] = {}
        smallest = np.full(T, np.inf)
        for n, count, entries, (block, i, j) in form._diagonal:
            A = np.zeros((count, T, n, n))
            A[block, :, i, j] = values[entries]
            inverse = inverses(A.reshape(-1, n, n)).reshape(A.shape)
            size = np.abs(inverse).sum(axis=3).max(axis=(0, 2))
            smallest = np.fmin(smallest, np.where(size > 0, 1.0 / np.where(size > 0, size, 1.0), 0.0))
            self._inverse[n] = np.ascontiguousarray(inverse.transpose(0, 2, 3, 1))
        self.smallest_pivot = np.where(np.isfinite(smallest), np.minimum(smallest, 1.0), 0.0)

    def solve(self, b: Array, transposed: bool = False) -> Array:
        """Solution ``x (size, k, T)`` of ``A x = b``, or ``A^T x = b``; NaN where a system is singular."""
        if not b.size:
            return np.zeros_like(b)
        form = self._form
        given, wanted = (form._unknowns, form._equations) if transposed else (form._equations, form._unknowns)
        right = b[given]
        x = self._swept(right.copy(), transposed)
        form._products[transposed].subtract(right, self._values, x)
        x += self._swept(right, transposed)
        out = np.empty_like(x)
        out[wanted] = x
        return out

    def _swept(self, y: Array, transposed: bool) -> Array:
        """The solution in the new order, in place of the right sides ``y``."""
        for step in reversed(self._form._steps) if transposed else self._form._steps:
            (step.transposed if transposed else step.needs).subtract(y, self._values, y)
            right = y[step.first : step.end].reshape(-1, step.size, *y.shape[1:])
            found = np.einsum(
                "bjit,bjkt->bikt" if transposed else "bijt,bjkt->bikt", self._inverse[step.size][step.at], right
            )
            y[step.first : step.end] = found.reshape(-1, *y.shape[1:])
        return y

    def part(self, at: Index) -> BlockFactor:
        """Some of the systems."""
        out = BlockFactor.__new__(BlockFactor)
        out._form, out._values, out.smallest_pivot = self._form, self._values[:, at], self.smallest_pivot[at]
        out._inverse = {n: inverse[..., at] for n, inverse in self._inverse.items()}
        return out


def _sorted(items: Index, by: Index) -> tuple[Index, Index]:
    """Items in the order of their places ``by``, and these."""
    items = items[np.argsort(by[items], kind="stable")]
    return items, by[items]


def _between(values: Index, begin: int, end: int) -> slice:
    """Where rising values are at least ``begin`` and below ``end``."""
    return slice(*np.searchsorted(values, (begin, end)).tolist())


def _levels(before: Index, after: Index, count: int) -> Index:
    """For every node of a graph without cycles how many come before it at most, along edges from ``before`` to ``after``."""
    off = before != after
    graph = scipy.sparse.csr_array((np.ones(int(off.sum())), (before[off], after[off])), shape=(count, count))
    graph.sum_duplicates()
    waiting = np.bincount(graph.indices, minlength=count)
    level = np.zeros(count, dtype=np.intp)
    front, depth = np.flatnonzero(waiting == 0), 0
    while front.size:
        level[front] = depth
        reached = graph[front].indices
        np.subtract.at(waiting, reached, 1)
        front, depth = np.unique(reached[waiting[reached] == 0]), depth + 1
    return level
