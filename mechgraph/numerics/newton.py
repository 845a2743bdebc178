"""Least-squares Newton iterations with damping, for many points at a time; knows no mechanism."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy
from numpy.typing import NDArray

Array = NDArray[np.float64]


def least_norm_step(J: Array, r: Array, tolerance: float) -> Array:
    """Smallest ``dq`` with least ``|J dq + r|``; singular values below ``tolerance`` times the largest are dropped."""
    if not J.size:
        return np.zeros(J.shape[1])
    return np.asarray(scipy.linalg.lstsq(J, -r, cond=tolerance, lapack_driver="gelsd", check_finite=False)[0])


def least_norm_steps(J: Array, r: Array, tolerance: float) -> Array:
    """``least_norm_step`` for matrices ``(m, n, T)`` and residuals ``(m, T)``, ``(n, T)``; NaN where one is not finite."""
    if J.shape[2] == 1:  # of one matrix, which may be large, no inverse is formed
        return least_norm_step(J[:, :, 0], r[:, 0], tolerance)[:, None]
    finite = np.isfinite(J).all(axis=(0, 1)) & np.isfinite(r).all(axis=0)
    inverse = np.linalg.pinv(np.moveaxis(np.where(finite, J, 0.0), -1, 0), rcond=tolerance)
    return np.where(finite, -np.einsum("tnm,mt->nt", inverse, np.where(finite, r, 0.0)), np.nan)


def closest_zeros(
    evaluate: Callable[[Array], tuple[Array, Array]],
    advance: Callable[[Array, Array], Array],
    x: Array,
    *,
    tolerance: float,
    rank_tolerance: float,
    longest: float = 0.5,
    iterations: int = 60,
    patience: int = 8,
) -> tuple[Array, Array]:
    """Gauss-Newton with limited steps from points ``x (nx, T)``: the zero of the residual near to each, or the best point found.

    ``evaluate(x)`` gives residuals ``(m, T)`` and Jacobians ``(m, n, T)``. Steps are limited to ``longest`` (largest component) and
    halved while the residual grows; after ``patience`` steps without gain a point is left. Converges linearly to double roots.
    Returns the points and the largest residual component at each, ``(T,)``.
    """
    x = x.copy()
    r, J = (values.copy() for values in evaluate(x))
    size = np.abs(r).max(axis=0, initial=0.0)
    best, best_size, stalled = x.copy(), size.copy(), np.zeros(len(size), dtype=np.intp)
    at = np.flatnonzero(size > tolerance)
    for _ in range(iterations):
        step = least_norm_steps(J[..., at], r[:, at], rank_tolerance)
        biggest = np.abs(step).max(axis=0, initial=0.0)
        moves = np.isfinite(biggest) & (biggest > 0)
        at, step = at[moves], step[:, moves] * np.minimum(1.0, longest / biggest[moves])
        if not at.size:
            break
        before = np.linalg.norm(r[:, at], axis=0)
        left, begin = np.arange(at.size), x[:, at]
        for _ in range(6):
            trial = advance(begin[:, left], step[:, left])
            mine = at[left]
            x[:, mine] = trial
            r[:, mine], J[..., mine] = evaluate(trial)
            size[mine] = np.abs(r[:, mine]).max(axis=0, initial=0.0)
            left = left[~((np.linalg.norm(r[:, mine], axis=0) < before[left]) | (size[mine] <= tolerance))]
            if not left.size:
                break
            step[:, left] *= 0.5
        gained = at[size[at] < 0.999 * best_size[at]]
        stalled[at] += 1
        stalled[gained] = 0
        best[:, gained], best_size[gained] = x[:, gained], size[gained]
        at = at[(size[at] > tolerance) & (stalled[at] <= patience) & ~((best_size[at] < 1e-9) & (stalled[at] > 1))]
    return best, best_size
