"""Sparse square systems of one pattern: the order that keeps the fill low is found once, values change from position to position.

Source: Davis, Direct Methods for Sparse Linear Systems, 2006, chapters 6 and 7; the factorization is SuperLU's (scipy).
"""

from __future__ import annotations

from typing import Any, Literal, cast

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]


class Pattern:
    """Places ``(rows, cols)`` of the nonzeros of a square matrix, with the column order of the first factorization kept."""

    def __init__(self, rows: Index, cols: Index, size: int) -> None:
        self.size = size
        self._rows, self._cols = rows, cols
        self._order: Index | None = None
        self._arrange(np.arange(size, dtype=np.intp))

    def _arrange(self, place: Index) -> None:
        """Compressed columns with column ``j`` at ``place[j]``; where each value goes."""
        cols = place[self._cols]
        self._values = np.lexsort((self._rows, cols))
        self._indices = self._rows[self._values].astype(np.int32)
        self._starts = np.searchsorted(cols[self._values], np.arange(self.size + 1)).astype(np.int32)

    def factor(self, values: Array) -> SparseFactor:
        """The matrix with these values, factored."""
        A = scipy.sparse.csc_array((values[self._values], self._indices, self._starts), shape=(self.size, self.size))
        try:
            lu = scipy.sparse.linalg.splu(A, permc_spec="COLAMD" if self._order is None else "NATURAL")
        except RuntimeError:
            return SparseFactor(A, None, self._order)
        if self._order is None:
            self._order = lu.perm_c.astype(np.intp)
            self._arrange(self._order)
            return SparseFactor(A, lu, None)
        return SparseFactor(A, lu, self._order)


class SparseFactor:
    """One factored matrix; solves with one step of refinement. ``lu`` is None for a matrix that is exactly singular."""

    def __init__(self, A: scipy.sparse.csc_array, lu: scipy.sparse.linalg.SuperLU | None, order: Index | None) -> None:
        self._A, self._lu, self._order = A, lu, order
        self._pivots = np.zeros(1) if lu is None else np.asarray(lu.U.diagonal())
        self.smallest_pivot = float(np.abs(self._pivots).min(initial=1.0))

    @property
    def sign(self) -> float:
        """Sign of the determinant."""
        if self._lu is None:
            return 0.0
        out = float(np.prod(np.sign(self._pivots)))
        perms = [self._lu.perm_r, self._lu.perm_c] + ([] if self._order is None else [self._order])
        for perm in perms:
            out *= _parity(perm)
        return out

    def solve(self, b: Array, transposed: bool = False) -> Array:
        """Solution of ``A x = b`` (or ``A^T x = b``) for ``b (n, k)``; NaN where the matrix is singular."""
        if self._lu is None:
            return np.full_like(b, np.nan)
        if not b.size:
            return np.zeros_like(b)
        if transposed:
            rhs = b if self._order is None else _to_places(b, self._order)
            return self._refined(rhs, "T", self._A.T)
        x = self._refined(b, "N", self._A)
        return x if self._order is None else x[self._order]

    def _refined(self, b: Array, trans: Literal["N", "T"], A: Any) -> Array:
        solve = cast(Any, self._lu).solve
        x = solve(b, trans)
        return np.asarray(x + solve(b - A @ x, trans))


def _to_places(b: Array, order: Index) -> Array:
    out = np.empty_like(b)
    out[order] = b
    return out


def _parity(perm: Index) -> float:
    """Sign of a permutation: ``(-1)^(n - cycles)``."""
    n = len(perm)
    graph = scipy.sparse.coo_array((np.ones(n), (np.arange(n), perm)), shape=(n, n))
    cycles, _ = scipy.sparse.csgraph.connected_components(graph, directed=False)
    return -1.0 if (n - cycles) % 2 else 1.0
