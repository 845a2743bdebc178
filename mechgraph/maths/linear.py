"""Batches of small linear systems: independent rows and columns chosen once, the square rest solved for all positions.

Source for the strategy: Golub and Van Loan, Matrix Computations, section 5.4 (rank-revealing QR with column pivoting).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.maths.se3 import Array, Index

Place = slice | Index
"""Places along an axis; a slice takes no copy."""

RANK_TOLERANCE = 1e-9
"""Singular values below this part of the largest count as zero (lengths scaled, so that a matrix has no units)."""


def singular_values(A: Array) -> Array:
    """Singular values of one matrix, largest first; empty matrices have none."""
    return np.asarray(np.linalg.svd(A, compute_uv=False)) if A.size else np.zeros(0)


def rank_of(sigma: Array, tolerance: float = RANK_TOLERANCE) -> int:
    """Number of singular values above ``tolerance`` times the largest."""
    return int((sigma > tolerance * sigma[0]).sum()) if sigma.size and sigma[0] > 0 else 0


def independent_rows(rows: Array, candidates: list[int], count: int) -> list[int]:
    """The first candidates (in order) whose rows are independent, up to ``count``; weakly independent ones where needed.

    Depends on the column space of ``rows`` only where its columns are orthonormal.
    """
    chosen: list[int] = []
    basis, taken = np.empty((min(rows.shape), rows.shape[1])), set[int]()
    size = np.sqrt((rows**2).sum(axis=1))
    # part of a row that must be independent of the rows chosen before: wanted, and at least
    for limit in (1e-3, 1e-8):
        for i in candidates:
            if len(chosen) == count:
                return chosen
            # size of a row below which it is not chosen
            if i in taken or not size[i] > 1e-8:
                continue
            rest = rows[i] / size[i]
            for _ in range(2):
                rest = rest - basis[: len(chosen)].T @ (basis[: len(chosen)] @ rest)
            part = np.linalg.norm(rest)
            if part > limit:
                basis[len(chosen)] = rest / part
                chosen.append(i)
                taken.add(i)
    return chosen


def complement(index: Index, count: int) -> Index:
    """The places below ``count`` that are not in ``index``."""
    rest = np.ones(count, dtype=bool)
    rest[index] = False
    return np.flatnonzero(rest)


def compact(index: Index) -> Place:
    """An evenly spaced rising index as a slice, any other as it is."""
    n = len(index)
    if not n:
        return index
    step = int(index[1] - index[0]) if n > 1 else 1
    if step < 1 or (n > 2 and (np.diff(index) != step).any()):
        return index
    return slice(int(index[0]), int(index[-1]) + 1, step)


def add_at(out: Array, index: Index, values: Array) -> None:
    """Add ``values (6, n, T)`` to the places ``index (n,)`` of the second axis of ``out``; places may repeat."""
    np.add.at(np.moveaxis(out, 1, 0), index, np.moveaxis(values, 1, 0))


def scattered_sum(values: Array, index: Index, count: int) -> Array:
    """Sums ``(6, count, T)`` of ``values (6, n, T)`` by their place ``index (n,)``."""
    to = scipy.sparse.csr_array((np.ones(len(index)), (index, np.arange(len(index)))), shape=(count, len(index)))
    flat = np.moveaxis(values, 1, 0).reshape(len(index), values.shape[0] * values.shape[2])
    return np.moveaxis(np.asarray(to @ flat).reshape(count, values.shape[0], values.shape[2]), 0, 1)


def scaled_norm(M: Array) -> Array:
    """A bound of the spectral radius of all matrices with entries of sizes ``M (n, n, T)``, ``(T,)``.

    The maximum norm of ``D^-1 M D`` for the best of a few diagonal ``D``, found by power iteration (Collatz and Wielandt), so that
    it does not depend on the units of rows and columns.
    """
    v = np.ones((M.shape[1], M.shape[2]))
    best = np.full(M.shape[2], np.inf)
    for _ in range(4):
        w = np.einsum("ijt,jt->it", M, v)
        best = np.fmin(best, (w / v).max(axis=0, initial=0.0))
        v = np.maximum(w, 1e-3 * w.max(axis=0, initial=0.0))
        v = np.where(v > 0, v, 1.0)
    return best


def parabola_is_regular(P: Array, Q: Array, margin: float) -> NDArray[np.bool_]:
    """Whether ``1 - s P - s^2 Q`` is regular for all complex ``s`` nearer than ``margin`` to ``-1 <= s <= 1``; ``(n, n, T)`` -> ``(T,)``.

    Its singular points are the inverse eigenvalues of ``[[P, Q], [1, 0]]`` (Tisseur and Meerbergen, The quadratic eigenvalue problem,
    SIAM Review 43, 2001).
    """
    n, T = P.shape[0], P.shape[2]
    companion = np.zeros((T, 2 * n, 2 * n))
    companion[:, :n, :n], companion[:, :n, n:] = np.moveaxis(P, -1, 0), np.moveaxis(Q, -1, 0)
    companion[:, n:, :n] = np.eye(n)
    finite: NDArray[np.bool_] = np.asarray(np.isfinite(companion).all(axis=(1, 2)))
    t = np.linalg.eigvals(np.where(finite[:, None, None], companion, 0.0))
    # |1/t - u| >= margin for all u in [-1, 1]
    s = 1.0 / np.where(t == 0, 1e-300, t)
    distance = np.abs(s - np.clip(s.real, -1.0, 1.0))
    return np.asarray((distance >= margin).all(axis=1) & finite)


@dataclass(frozen=True)
class Choice:
    """Independent rows and columns of a matrix: ``A[rows][:, cols]`` is square and regular.

    ``held`` are the columns (of those allowed) left over, ``fixed`` those that were not allowed.
    """

    rows: Index
    cols: Index
    held: Index
    fixed: Index

    def square(self, A: Array) -> Array:
        """``A[rows][:, cols] (r, r, T)`` of matrices ``(m, n, T)``, without a copy where that can be."""
        rows, cols = self.places
        return A[rows][:, cols]

    @cached_property
    def places(self) -> tuple[Place, Place]:
        """The rows and the columns, as slices where that can be."""
        return compact(self.rows), compact(self.cols)

    def same(self, other: Choice) -> bool:
        """Whether two choices are equal."""
        pairs = ((self.rows, other.rows), (self.cols, other.cols), (self.held, other.held))
        return all(np.array_equal(a, b) for a, b in pairs)


def choose(A: Array, fixed: Index, tolerance: float = RANK_TOLERANCE, keep: Index | None = None) -> Choice:
    """Choose independent columns outside ``fixed`` and independent rows, by QR with column pivoting.

    Columns in ``keep`` are held over if the others have the same rank and are not much worse conditioned.
    """
    free = complement(fixed, A.shape[1])
    if keep is not None and keep.size:
        others = np.setdiff1d(free, keep)
        with_keep, without = singular_values(A[:, free]), singular_values(A[:, others])
        rank = rank_of(with_keep, tolerance)
        # part of the smallest singular value that may be lost by holding the columns in ``keep``
        if rank_of(without, tolerance) == rank and (rank == 0 or without[rank - 1] > 0.1 * with_keep[rank - 1]):
            inner = choose(A, np.union1d(fixed, keep), tolerance)
            held = np.sort(np.concatenate([inner.held, keep]))
            return Choice(inner.rows, inner.cols, held, np.asarray(fixed, dtype=np.intp))
    sub = A[:, free]
    rank = rank_of(singular_values(sub), tolerance)
    if rank == 0:
        nothing = np.zeros(0, dtype=np.intp)
        return Choice(nothing, nothing, free, np.asarray(fixed, dtype=np.intp))
    _, pivots = scipy.linalg.qr(sub, mode="r", pivoting=True)
    cols = np.sort(free[pivots[:rank]])
    _, pivots = scipy.linalg.qr(A[:, cols].T, mode="r", pivoting=True)
    return Choice(
        np.sort(pivots[:rank]),
        cols,
        complement(np.concatenate([fixed, cols]), A.shape[1]),
        np.asarray(fixed, dtype=np.intp),
    )


def inverses(stacked: Array) -> Array:
    """Inverses of matrices ``(N, n, n)``, NaN where one is singular."""
    try:
        return np.asarray(np.linalg.inv(stacked), dtype=float)
    except np.linalg.LinAlgError:
        singular = np.linalg.slogdet(stacked)[0] == 0
        identity = np.eye(stacked.shape[1])
        inverse = np.asarray(np.linalg.inv(np.where(singular[:, None, None], identity, stacked)), dtype=float)
        inverse[singular] = np.nan
        return inverse


class Factorization:
    """A batch of square matrices ``A (n, n, T)``, inverted; solves with one step of refinement."""

    def __init__(self, A: Array) -> None:
        self._A = A
        self._inverse = np.ascontiguousarray(inverses(np.ascontiguousarray(A.transpose(2, 0, 1))).transpose(1, 2, 0))

    @cached_property
    def condition(self) -> Array:
        """Condition numbers ``(T,)``: the product of the infinity norms of matrix and inverse; infinite for singular matrices.

        That of the matrix counts as one at least: rows and columns are of unit size, and a single entry tells how near it is to zero.
        """
        with np.errstate(invalid="ignore", over="ignore"):
            norms = [np.abs(M).sum(axis=1).max(axis=0, initial=0.0) for M in (self._A, self._inverse)]
            # of a singular matrix NaN, which fmin leaves out
            return np.asarray(np.fmin(np.maximum(norms[0], 1.0) * norms[1], np.inf))

    def solve(self, b: Array, transposed: bool = False) -> Array:
        """Solution of ``A x = b`` (or ``A^T x = b``) for ``b (n, k, T)``; NaN for singular matrices."""
        rows = "nit,nkt->ikt" if transposed else "int,nkt->ikt"
        x = np.einsum(rows, self._inverse, b)
        x += np.einsum(rows, self._inverse, b - np.einsum(rows, self._A, x))
        return np.asarray(x)


EVERY = slice(None)


class ChosenSystem:
    """A batch of matrices ``A (m, n, T)`` solved through the independent rows and columns chosen for each position.

    ``which (T,)`` says which of ``choices`` serves a position.
    """

    def __init__(self, A: Array, choices: list[Choice], which: Index) -> None:
        self.A = A
        self.choices = choices
        self.which = which
        self._parts: list[tuple[Choice, Place, Factorization]] = []
        used = sorted(set(which.tolist()))
        for i in used:
            choice, at = choices[i], EVERY if len(used) == 1 else np.flatnonzero(which == i)
            self._parts.append((choice, at, Factorization(choice.square(A)[:, :, at])))

    @cached_property
    def condition(self) -> Array:
        """Condition numbers of the square parts ``(T,)``."""
        if self._parts and self._parts[0][1] is EVERY:
            return self._parts[0][2].condition
        out = np.ones(self.A.shape[2])
        for _, at, factor in self._parts:
            out[at] = factor.condition
        return out

    def solve(self, b: Array) -> Array:
        """``x (n, k, T)`` with ``A x = b`` in the chosen rows; zero in held and fixed columns."""
        out = np.zeros((self.A.shape[1], *b.shape[1:]))
        for choice, at, factor in self._parts:
            rows, cols = choice.places
            _put(out, cols, at, factor.solve(b[rows][:, :, at]))
        return out

    def solve_transposed(self, b: Array) -> Array:
        """``y (m, k, T)`` with ``A^T y = b`` in the chosen columns; zero in the rows that were not chosen."""
        out = np.zeros((self.A.shape[0], *b.shape[1:]))
        for choice, at, factor in self._parts:
            rows, cols = choice.places
            _put(out, rows, at, factor.solve(b[cols][:, :, at], transposed=True))
        return out

    def null_of_transpose(self) -> Array:
        """Basis ``(m, m - r, T)`` of the ``y`` with ``A^T y = 0`` in the chosen columns: one vector a dropped row."""
        m, _, T = self.A.shape
        rank = max((len(c.rows) for c in self.choices), default=0)
        out = np.zeros((m, m - rank, T))
        for choice, at, factor in self._parts if rank < m else ():
            dropped = complement(choice.rows, m)
            left = self.A[dropped[:, None], choice.cols][:, :, at]
            _put(out, choice.rows, at, -factor.solve(left.swapaxes(0, 1), transposed=True))
            _put(out, dropped, at, np.eye(m - rank)[:, :, None])
        return out

    def null_of_columns(self) -> Array:
        """Basis ``(n, held, T)`` of the ``x`` with ``A x = 0`` in the chosen rows: one vector a held column, with a one there."""
        _, n, T = self.A.shape
        count = max((len(c.held) for c in self.choices), default=0)
        out = np.zeros((n, count, T))
        for choice, at, factor in self._parts:
            held = len(choice.held)
            part = -factor.solve(self.A[choice.rows[:, None], choice.held][:, :, at])
            _put(out[:, :held], choice.cols, at, part)
            _put(out[:, :held], choice.held, at, np.eye(held)[:, :, None])
        return out

    def change(self, other: Array) -> Array:
        """``1 - A^-1 A_other`` of the square parts ``(n, n, T)``, of one choice for all positions."""
        choice, _, factor = self._parts[0]
        out = -factor.solve(choice.square(other))
        out[np.arange(len(choice.cols)), np.arange(len(choice.cols))] += 1.0
        return out


def _put(out: Array, rows: Place, at: Place, values: Array) -> None:
    """``out[rows][:, :, at] = values``."""
    if isinstance(at, slice) or isinstance(rows, slice):
        out[rows, :, at] = values
    else:
        out[rows[:, None, None], np.arange(out.shape[1])[:, None], at] = values
