"""Linear systems in batches: dense ones with independent rows and columns, sparse ones of one pattern, and those that fall into blocks.

Dense: independent rows and columns are chosen once, the square rest is solved for all positions.
Source for the strategy: Golub and Van Loan, Matrix Computations, section 5.4 (rank-revealing QR with column pivoting).

Sparse square systems of one pattern: the order that keeps the fill low is found once, values change from position to position.

Source: Davis, Direct Methods for Sparse Linear Systems, 2006, chapters 6 and 7; the factorization is SuperLU's (scipy).

Many square systems of one sparse pattern, solved block by block in the order in which their unknowns can be found.

A matching of rows to columns and the strongly connected components of the graph "row needs column" permute the pattern to block triangular
form (the fine decomposition of Dulmage and Mendelsohn, 1958): of the closure equations of a mechanism, its structural groups. Blocks that
wait for none of each other are of one *level*. The diagonal blocks of all systems are inverted together, size by size; a solution goes
through the levels, and through them backwards for the transposed system.
Source: Duff, Erisman and Reid, Direct Methods for Sparse Matrices, 2017, chapter 6.

Least-norm solutions and the range of singular values of a sparse matrix, by its damped normal equations.

    dq = K^T (K K^T + d I)^-1 r

d lets directions with singular values below sqrt(d) alone, as a truncated singular value decomposition would; it also makes the
matrix definite where rows of K depend on each other. Source: Bjorck, Numerical Methods for Least Squares Problems, 1996, chapter 2.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import RANKS
from mechgraph.memo import dataclass

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


def chebyshev(count: int) -> tuple[Array, Array, Array]:
    """Chebyshev points ``(n,)`` from -1 to 1, the ``n`` polynomials there ``(n, n)``, and what makes coefficients ``(n, n)`` of values."""
    points = np.asarray(np.polynomial.chebyshev.chebpts1(count))
    there = np.asarray(np.polynomial.chebyshev.chebvander(points, count - 1), dtype=float)
    return points, there, there.T * np.where(np.arange(count), 2.0, 1.0)[:, None] / count


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


class Pattern:
    """Places ``(rows, cols)`` of the nonzeros of a square matrix; order of columns and pivots of the first factorization are kept."""

    def __init__(self, rows: Index, cols: Index, size: int) -> None:
        self.size = size
        self._rows, self._cols = rows, cols
        self._known = False
        self._arrange(np.arange(size, dtype=np.intp), np.arange(size, dtype=np.intp))

    @property
    def places(self) -> tuple[Index, Index]:
        """Rows and columns of the values."""
        return self._rows, self._cols

    def _arrange(self, row_place: Index, col_place: Index) -> None:
        """Compressed columns with row ``i`` at ``row_place[i]``, column ``j`` at ``col_place[j]``; where each value goes."""
        self._row_place, self._col_place = row_place, col_place
        rows, cols = row_place[self._rows], col_place[self._cols]
        self._values = np.lexsort((rows, cols))
        self._indices = rows[self._values].astype(np.int32)
        self._starts = np.searchsorted(cols[self._values], np.arange(self.size + 1)).astype(np.int32)

    def factor(self, values: Array) -> SparseFactor:
        """The matrix with these values, factored."""
        if not self._known:
            first = self._factored(values, "COLAMD", 1.0)
            if first is None:
                return SparseFactor(self._matrix(values), None, self._row_place, self._col_place)
            self._known = True
            self._arrange(first.lu.perm_r.astype(np.intp), first.lu.perm_c.astype(np.intp))
        # part of the largest candidate that the pivot of the first factorization needs to be taken again
        lu = self._factored(values, "NATURAL", 0.1)
        return SparseFactor(self._matrix(values), lu, self._row_place, self._col_place)

    def _matrix(self, values: Array) -> scipy.sparse.csc_array:
        return scipy.sparse.csc_array((values[self._values], self._indices, self._starts), shape=(self.size,) * 2)

    def _factored(self, values: Array, order: Literal["COLAMD", "NATURAL"], threshold: float) -> Factors | None:
        """Factors of the matrix as it is arranged, None where it is exactly singular."""
        try:
            return Factors(self._matrix(values), permc_spec=order, diag_pivot_thresh=threshold)
        except RuntimeError:
            return None


class Factors:
    """SuperLU of a matrix. It is copied and pickled by the matrix, which is factored again: SuperLU itself cannot be."""

    def __init__(self, A: scipy.sparse.csc_array, **options: Any) -> None:
        self._A, self._options = A, options
        self.lu: Any = scipy.sparse.linalg.splu(A, **options)

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), **self._options), (self._A,)

    def solve(self, b: Array, trans: Literal["N", "T"] = "N") -> Array:
        """Solution of ``A x = b``, or ``A^T x = b``, for ``b (n, k)``."""
        return np.asarray(self.lu.solve(b, trans))


class SparseFactor:
    """One factored matrix; solves with one step of refinement. ``lu`` is None for a matrix that is exactly singular."""

    def __init__(self, A: scipy.sparse.csc_array, lu: Factors | None, row_place: Index, col_place: Index) -> None:
        self._A, self._lu, self._row_place, self._col_place = A, lu, row_place, col_place

    @cached_property
    def smallest_pivot(self) -> float:
        """The smallest pivot, at most 1; 0 where the matrix is exactly singular. Reading it costs as much as a solution."""
        return 0.0 if self._lu is None else float(np.abs(self._lu.lu.U.diagonal()).min(initial=1.0))

    @cached_property
    def distance(self) -> float:
        """Distance to the nearest singular matrix, ``1 / |A^-1|`` in the 1-norm, estimated (Higham and Tisseur 2000); 0 where singular."""
        n = self._A.shape[0]
        if not n:
            return 1.0
        if self._lu is None:
            return 0.0
        inverse = scipy.sparse.linalg.LinearOperator(
            (n, n),
            matvec=lambda b: self.solve(b.reshape(n, 1))[:, 0],
            rmatvec=lambda b: self.solve(b.reshape(n, 1), transposed=True)[:, 0],
            matmat=self.solve,
            rmatmat=lambda b: self.solve(b, transposed=True),
            dtype=np.dtype(float),
        )
        # one column: more of them begin with random numbers of the whole process, so that the same call could end in two ways
        size = float(scipy.sparse.linalg.onenormest(inverse, t=1))
        return 1.0 / size if 0 < size < np.inf else 0.0

    def solve(self, b: Array, transposed: bool = False) -> Array:
        """Solution of ``A x = b`` (or ``A^T x = b``) for ``b (n, k)``; NaN where the matrix is singular."""
        if self._lu is None:
            return np.full_like(b, np.nan)
        if not b.size:
            return np.zeros_like(b)
        if transposed:
            return self._refined(_to_places(b, self._col_place), "T", self._A.T)[self._row_place]
        return self._refined(_to_places(b, self._row_place), "N", self._A)[self._col_place]

    def _refined(self, b: Array, trans: Literal["N", "T"], A: Any) -> Array:
        assert self._lu is not None
        solve = self._lu.solve
        x = solve(b, trans)
        return np.asarray(x + solve(b - A @ x, trans))


class SparseFactors:
    """Factored matrices, one a position, for right sides ``(n, k, T)``."""

    def __init__(self, factors: list[SparseFactor]) -> None:
        self._factors = factors

    @cached_property
    def smallest_pivot(self) -> Array:
        """That of every matrix, ``(T,)``."""
        return np.array([factor.smallest_pivot for factor in self._factors])

    def solve(self, b: Array, transposed: bool = False) -> Array:
        """Solutions ``x (n, k, T)`` of ``A x = b``, or ``A^T x = b``; NaN where a matrix is singular."""
        return np.stack([factor.solve(b[:, :, t], transposed) for t, factor in enumerate(self._factors)], axis=2)

    def part(self, at: Index) -> SparseFactors:
        """Some of the matrices."""
        return SparseFactors([self._factors[i] for i in at.tolist()])


def _to_places(b: Array, order: Index) -> Array:
    out = np.empty_like(b)
    out[order] = b
    return out


def least_solution(A: scipy.sparse.csc_array, b: Array) -> Array:
    """The solution ``(n,)`` of ``A x = b`` with independent rows ``A (m, n)``, of least norm where ``n > m``, refined once.

    LU of ``A`` where it is square, of ``[w A^T; A 0]`` otherwise; a weight ``w`` near the smallest singular value keeps the condition that
    of ``A``, where 1 squares it (Bjorck, Numerical Methods for Least Squares Problems, 1996, sections 2.5 and 7.1).
    """
    m, n = A.shape
    if m != n:
        # weight of the norm in ``least_solution``, beside rows of size one
        A = scipy.sparse.block_array([[1e-4 * scipy.sparse.eye_array(n), A.T], [A, None]], format="csc")
        b = np.concatenate([np.zeros(n), b])
    if not b.size:
        return b
    lu = Factors(A)
    x = lu.solve(b)
    return np.asarray(x + lu.solve(b - A @ x))[:n]


WHOLE = 400
"""Unknowns, rows or columns up to which a singular value decomposition of the whole matrix is a matter of a tenth of a second."""
OPEN = 1e-7
"""Part that an unknown has in the solutions without a right side, above which it is not unique; relative residual of a contradiction."""


def unique_solution(A: scipy.sparse.csc_array, b: Array) -> Array:
    """The solution ``(n,)`` of ``A x = b``, NaN in unknowns that the equations leave open; all NaN where they contradict each other.

    Rows may depend on each other: a singular value decomposition says what is open; LU of a large matrix that is square and regular.
    """
    rows, K = _unit_rows(A)
    columns, K = _unit_rows(K.T.tocsc())
    K, b = K.T.tocsc(), b / rows
    m, n = K.shape
    if (
        m == n > WHOLE and scipy.sparse.csgraph.structural_rank(K) == n
    ):  # SuperLU itself fails on a matrix without that rank
        places = K.tocoo()
        factor = Pattern(places.row.astype(np.intp), places.col.astype(np.intp), n).factor(places.data)
        # distance from a singular matrix, rows and columns of size one, below which an LU is not trusted
        if factor.distance > 1e-9:
            return np.asarray(factor.solve(b[:, None])[:, 0] / columns)
    U, s, Vt = np.linalg.svd(K.toarray())
    rank = rank_of(s)
    x = Vt[:rank].T @ ((U[:, :rank].T @ b) / s[:rank])
    left, size = np.abs(K @ x - b).max(initial=0.0), np.abs(b).max(initial=0.0)
    not_unique = np.sqrt((Vt[rank:] ** 2).sum(axis=0)) > OPEN
    return np.where(not_unique | (left > OPEN * size), np.nan, x / columns)


def _unit_rows(A: scipy.sparse.csc_array) -> tuple[Array, scipy.sparse.csc_array]:
    """Largest entry of every row, and the matrix with its rows divided by it; rows that are rounding stay what they are."""
    size = np.zeros(A.shape[0])
    places = A.tocoo()
    np.maximum.at(size, places.row, np.abs(places.data))
    # size of a row, against the largest, that is rounding of zeros
    size[size <= 1e-13 * size.max(initial=0.0)] = 1.0
    return size, scipy.sparse.csc_array(scipy.sparse.diags_array(1.0 / size) @ A)


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
class _BlockStep:
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
            self._steps.append(_BlockStep(n, begin, end, slice(at, at + (end - begin) // n), before, behind))
        every = np.arange(len(rows))
        self._products = {False: _Sums.of(every, rows, cols), True: _Sums.of(every, cols, rows)}

    def pays(self, T: int) -> bool:
        """Whether ``T`` systems are solved in less time by blocks, all together, than one after the other as a whole."""
        # on chains of N groups both take the same time for 8 systems of 20 steps, 32 of 100, 60 of 400; a dense inverse of 60 rows takes
        # as long as sparse factors (``tests/benchmarks/bench_large.py --groups``)
        return self.blocks > 0 and max(self.sizes) <= 60 and len(self._steps) <= 3 * T

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


class LeastNorm:
    """The normal equations of ``K (m, n)``, factored once."""

    def __init__(self, K: scipy.sparse.csr_array) -> None:
        self.K = K
        m = K.shape[0]
        if m:
            A = (K @ K.T + RANKS.damping * scipy.sparse.eye_array(m)).tocsc()
            symmetric = {"SymmetricMode": True}
            self._factors = Factors(A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric)

    def multipliers(self, r: Array) -> Array:
        """``(K K^T + d I)^-1 r`` for ``r (m, k)``."""
        return self._factors.solve(r) if self.K.shape[0] else r

    def solve(self, r: Array) -> Array:
        """Smallest ``(n, k)`` with ``K dq = r`` as far as that can be had, with one step of refinement."""
        dq = self.K.T @ self.multipliers(r)
        return np.asarray(dq + self.K.T @ self.multipliers(r - self.K @ dq))


def singular_ratio(K: scipy.sparse.csr_array, rank: int, factored: Callable[[], LeastNorm]) -> float:
    """Singular value number ``rank`` (the smallest kept) over the largest."""
    if min(K.shape) <= WHOLE:
        s = singular_values(K.toarray())
        return float(s[rank - 1] / s[0])
    normal = factored()
    start = np.random.default_rng(3).normal(size=K.shape[1])
    largest = _largest(lambda v: K.T @ (K @ v), start)

    def inverse(v: Array) -> Array:
        """``K^T (K K^T)^-2 K``: zero on motions, the inverse square of a singular value elsewhere."""
        return np.asarray(K.T @ normal.multipliers(normal.multipliers(K @ v)))

    return 1.0 / float(np.sqrt(largest * _largest(inverse, inverse(start))))


def _largest(apply: Callable[[Array], Array], start: Array) -> float:
    """Largest eigenvalue of a symmetric operator to a thousandth (its vector to a hundredth), by Lanczos steps from a vector."""
    operator = scipy.sparse.linalg.LinearOperator((len(start),) * 2, matvec=apply, dtype=np.dtype(float))
    return float(scipy.sparse.linalg.eigsh(operator, 1, v0=start, tol=1e-2, return_eigenvectors=False)[0])
