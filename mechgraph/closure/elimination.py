"""Rank, null space and self-stresses by orthogonal elimination along the loops, with a rank decision at every column.

A front of rows goes over the blocks (the kept rows of every loop, each further row). The rows of a block enter; columns that no later
block has are eliminated by Householder reflections with a rank decision; what remains of the front has only columns shared with
blocks to come. Work grows as blocks times the square of the front, so chains cost blocks, lattices blocks to the second power. Every
step is orthogonal: self-stresses and motions come back through the same reflections.
Source: George and Heath, Solution of sparse linear least squares problems using Givens rotations, Linear Algebra and its Applications 34,
1980; Heath, Some extensions of an algorithm for sparse linear least squares problems, SIAM J. Sci. Stat. Comput. 3, 1982 (rank decision).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.indexing import Index

Mask = NDArray[np.bool_]

SPARE = 2.0
"""Rows a column that the front may have before it is condensed."""


@dataclass(frozen=True)
class _Reflections:
    """``I - V T V^T`` on ``rows``, followed by ``U^T`` on the first of them."""

    rows: Index
    V: Array
    T: Array
    U: Array

    def back(self, y: Array) -> None:
        """Apply the orthogonal factor (not its transpose) to ``y (rows, k)`` in place."""
        part = y[self.rows]
        k = self.U.shape[0]
        part[:k] = self.U @ part[:k]
        y[self.rows] = part - self.V @ (self.T @ (self.V.T @ part))


@dataclass(frozen=True)
class _Solved:
    """Columns ``at`` in terms of ``others``: ``q[at] = A q[others] + Z z``, ``z`` free."""

    at: Index
    others: Index
    A: Array
    Z: Array


class Elimination:
    """The elimination of ``K (m, n)``, its rows in the blocks ``owners (m,)``; pivots below ``tolerance`` count as zero.

    ``rank``, ``dropped`` largest pivot that counted as zero, ``zero_rows`` the rows that became zero: one self-stress each.
    """

    def __init__(self, K: scipy.sparse.csr_array, owners: Index, tolerance: float) -> None:
        self.tolerance = tolerance
        self.rank, self.dropped = 0, 0.0
        self.shape = K.shape
        self._steps: list[_Reflections] = []
        self._solved: list[_Solved] = []
        self._zero: list[Index] = []
        self._sweep(K, owners)
        self.zero_rows = np.concatenate(self._zero)

    def _sweep(self, K: scipy.sparse.csr_array, owners: Index) -> None:
        K.sum_duplicates()
        blocks = list(pairwise([*np.flatnonzero(np.diff(owners, prepend=-1)).tolist(), K.shape[0]]))
        columns = [np.unique(K.indices[K.indptr[i] : K.indptr[j]]).astype(np.intp) for i, j in blocks]
        order = _block_order(columns, K.shape[1])
        last = np.full(K.shape[1], -1)
        for step, i in enumerate(order):
            last[columns[i]] = step
        front, rows, active = np.zeros((0, 0)), np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
        place = np.full(K.shape[1], -1)  # of the columns in the front
        for step, i in enumerate(order):
            first, end = blocks[i]
            place[active] = np.arange(len(active))
            wide = np.concatenate([active, columns[i][place[columns[i]] < 0]])
            place[wide] = np.arange(len(wide))
            entries = slice(K.indptr[first], K.indptr[end])
            below = np.zeros((end - first, len(wide)))
            number = np.repeat(np.arange(end - first), np.diff(K.indptr[first : end + 1]))
            below[number, place[K.indices[entries]]] = K.data[entries]
            place[wide] = -1
            kept = np.pad(front, ((0, 0), (0, len(wide) - front.shape[1])))
            front, rows, active = np.concatenate([kept, below]), np.concatenate([rows, np.arange(first, end)]), wide
            front, rows, active = self._eliminate(front, rows, active, last[active] == step)
            front, rows = self._condense(front, rows)
        free = np.flatnonzero(last < 0)
        if free.size:
            self._solved.append(_Solved(free, np.zeros(0, dtype=np.intp), np.zeros((free.size, 0)), np.eye(free.size)))
        self._zero.append(rows)

    def _eliminate(self, front: Array, rows: Index, active: Index, done: Mask) -> tuple[Array, Index, Index]:
        """Solve the columns ``done`` (a mask over ``active``) from the front."""
        if not done.any():
            return front, rows, active
        at, others = active[done], active[~done]
        rest = front[:, ~done]
        V, T, R = householder(front[:, done])
        U, s, Vt = np.linalg.svd(R)
        kept = int((s > self.tolerance).sum())
        self.dropped = max(self.dropped, float(s[kept:].max(initial=0.0)))
        rest = rest - V @ (T.T @ (V.T @ rest))
        k = R.shape[0]
        rest[:k] = U.T @ rest[:k]
        self._steps.append(_Reflections(rows, V, T, U))
        A = -(Vt[:kept].T / s[:kept]) @ rest[:kept]
        self._solved.append(_Solved(at, others, A, Vt[kept:].T))
        self.rank += kept
        return rest[kept:], rows[kept:], others

    def _condense(self, front: Array, rows: Index) -> tuple[Array, Index]:
        """Where the front has more rows than columns, reflect it to triangular form; rows left over are self-stresses."""
        if front.shape[0] <= SPARE * front.shape[1] + 6:
            return front, rows
        V, T, R = householder(front)
        self._steps.append(_Reflections(rows, V, T, np.eye(R.shape[0])))
        self._zero.append(rows[R.shape[0] :])
        return R, rows[: R.shape[0]]

    def stresses(self, shares: Array) -> Array:
        """``y (m, k)`` with ``K^T y = 0`` for shares ``(zero rows, k)``; orthonormal shares give orthonormal ``y``."""
        y = np.zeros((self.shape[0], shares.shape[1]))
        y[self.zero_rows] = shares
        for step in reversed(self._steps):
            step.back(y)
        return y

    def motions(self) -> Array:
        """A basis ``(n, n - rank)`` of the ``q`` with ``K q = 0``."""
        out = np.zeros((self.shape[1], self.shape[1] - self.rank))
        free = 0
        for part in reversed(self._solved):
            out[part.at] = part.A @ out[part.others]
            n = part.Z.shape[1]
            out[np.ix_(part.at, np.arange(free, free + n))] += part.Z
            free += n
        return out


def householder(A: Array) -> tuple[Array, Array, Array]:
    """``A = (I - V T V^T) [R; 0]`` with ``T`` upper triangular (compact WY form); the work is LAPACK's."""
    k = min(A.shape)
    h, tau = np.linalg.qr(A, mode="raw")
    qr = h.T
    V = np.tril(qr[:, :k], -1) + np.eye(A.shape[0], k)
    T = np.zeros((k, k))
    G = V.T @ V
    for j in range(k):
        T[:j, j] = -tau[j] * (T[:j, :j] @ G[:j, j])
        T[j, j] = tau[j]
    return V, T, np.triu(qr[:k])


def _block_order(columns: list[Index], width: int) -> list[int]:
    """An order of the blocks that keeps the front short: Cuthill and McKee on blocks that share columns."""
    if not columns:
        return []  # no loop has a freedom: a graph without nodes has no order for scipy
    rows = np.repeat(np.arange(len(columns)), [len(c) for c in columns])
    at = np.concatenate([*columns, np.zeros(0, dtype=np.intp)])
    touch = scipy.sparse.csr_array((np.ones(len(at)), (rows, at)), shape=(len(columns), width))
    order = scipy.sparse.csgraph.reverse_cuthill_mckee((touch @ touch.T).tocsr(), symmetric_mode=True)
    return [int(i) for i in order]
