"""Sparse square systems of one pattern: the order that keeps the fill low is found once, values change from position to position.

Source: Davis, Direct Methods for Sparse Linear Systems, 2006, chapters 6 and 7; the factorization is SuperLU's (scipy).
"""

from __future__ import annotations

from functools import cached_property, partial
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

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
        self._pivots = np.zeros(1) if lu is None else np.asarray(lu.lu.U.diagonal())
        self.smallest_pivot = float(np.abs(self._pivots).min(initial=1.0))

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
        size = float(scipy.sparse.linalg.onenormest(inverse))
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


def _to_places(b: Array, order: Index) -> Array:
    out = np.empty_like(b)
    out[order] = b
    return out
