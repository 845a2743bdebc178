"""Sparse square systems of one pattern: the order that keeps the fill low is found once, values change from position to position.

Source: Davis, Direct Methods for Sparse Linear Systems, 2006, chapters 6 and 7; the factorization is SuperLU's (scipy).
"""

from __future__ import annotations

from functools import cached_property, partial
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.numerics.linear import rank_of

Array = NDArray[np.float64]
Index = NDArray[np.intp]


KEEP_PIVOT = 0.1
"""Part of the largest candidate that the pivot of the first factorization needs to be taken again."""


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
        lu = self._factored(values, "NATURAL", KEEP_PIVOT)
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


WEIGHT = 1e-4
"""Weight of the norm in ``least_solution``, beside rows of size one."""


def least_solution(A: scipy.sparse.csc_array, b: Array) -> Array:
    """The solution ``(n,)`` of ``A x = b`` with independent rows ``A (m, n)``, of least norm where ``n > m``, refined once.

    LU of ``A`` where it is square, of ``[w A^T; A 0]`` otherwise; a weight ``w`` near the smallest singular value keeps the condition that
    of ``A``, where 1 squares it (Bjorck, Numerical Methods for Least Squares Problems, 1996, sections 2.5 and 7.1).
    """
    m, n = A.shape
    if m != n:
        A = scipy.sparse.block_array([[WEIGHT * scipy.sparse.eye_array(n), A.T], [A, None]], format="csc")
        b = np.concatenate([np.zeros(n), b])
    if not b.size:
        return b
    lu = Factors(A)
    x = lu.solve(b)
    return np.asarray(x + lu.solve(b - A @ x))[:n]


WHOLE = 400
"""Unknowns up to which a singular value decomposition is a matter of a tenth of a second."""
REGULAR = 1e-9
"""Distance from a singular matrix, rows and columns of size one, below which an LU is not trusted."""
ZERO_ROW = 1e-13
"""Size of a row, against the largest, that is rounding of zeros."""
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
        if factor.distance > REGULAR:
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
    size[size <= ZERO_ROW * size.max(initial=0.0)] = 1.0
    return size, scipy.sparse.csc_array(scipy.sparse.diags_array(1.0 / size) @ A)
