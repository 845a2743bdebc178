"""Least-norm solutions and the range of singular values of a sparse matrix, by its damped normal equations.

    dq = K^T (K K^T + d I)^-1 r

d lets directions with singular values below sqrt(d) alone, as a truncated singular value decomposition would; it also makes the
matrix definite where rows of K depend on each other. Source: Bjorck, Numerical Methods for Least Squares Problems, 1996, chapter 2.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.numerics.linear import singular_values
from mechgraph.numerics.sparse import Factors
from mechgraph.numerics.tolerances import RANKS

Array = NDArray[np.float64]

WHOLE = 400
"""Rows or columns up to which singular values are those of the whole matrix (a tenth of a second at most)."""
LANCZOS_STEPS = 24
"""Lanczos steps for the smallest singular value of a larger one."""
LANCZOS_SETTLED = 1e-3
"""Relative change at which these steps end."""
POWER_SEED = 3


class LeastNorm:
    """The normal equations of ``K (m, n)``, full or sparse, factored once."""

    def __init__(self, K: Array | scipy.sparse.csr_array) -> None:
        self.K = K
        m = K.shape[0]
        if isinstance(K, np.ndarray):
            factor = scipy.linalg.lu_factor(K @ K.T + RANKS.damping * np.eye(m))
            self._solve: Callable[[Array], Array] = partial(scipy.linalg.lu_solve, factor)
        elif m:
            A = (K @ K.T + RANKS.damping * scipy.sparse.eye_array(m)).tocsc()
            symmetric = {"SymmetricMode": True}
            self._solve = Factors(A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric).solve

    def multipliers(self, r: Array) -> Array:
        """``(K K^T + d I)^-1 r`` for ``r (m, k)``."""
        return np.asarray(self._solve(r)) if self.K.shape[0] else r

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
    start = np.random.default_rng(POWER_SEED).normal(size=K.shape[1])
    largest = _largest(lambda v: K.T @ (K @ v), start)

    def inverse(v: Array) -> Array:
        """``K^T (K K^T)^-2 K``: zero on motions, the inverse square of a singular value elsewhere."""
        return np.asarray(K.T @ normal.multipliers(normal.multipliers(K @ v)))

    return 1.0 / float(np.sqrt(largest * _largest(inverse, inverse(start))))


def _largest(apply: Callable[[Array], Array], v: Array) -> float:
    """Largest eigenvalue of a symmetric operator by Lanczos steps, every vector made orthogonal to all before."""
    basis = [v / np.linalg.norm(v)]
    alpha: list[float] = []
    beta: list[float] = []
    value = 0.0
    for _ in range(LANCZOS_STEPS):
        w = apply(basis[-1])
        alpha.append(float(w @ basis[-1]))
        for u in basis:
            w -= (w @ u) * u
        found = float(scipy.linalg.eigvalsh_tridiagonal(alpha, beta)[-1])
        size = float(np.linalg.norm(w))
        if abs(found - value) <= LANCZOS_SETTLED * found or size <= LANCZOS_SETTLED**2 * found:
            return found
        value = found
        beta.append(size)
        basis.append(w / size)
    return value
