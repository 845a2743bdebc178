"""Least-squares Newton iterations for single points, with damping and restarts; knows no mechanism."""

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


def closest_zero(
    evaluate: Callable[[Array], tuple[Array, Array]],
    advance: Callable[[Array, Array], Array],
    x: Array,
    *,
    tolerance: float,
    rank_tolerance: float,
    longest: float = 0.5,
    iterations: int = 60,
    patience: int = 8,
) -> tuple[Array, float]:
    """Gauss-Newton with limited steps from ``x``: the zero of the residual near to it, or the best point found.

    ``evaluate(x)`` gives residual and Jacobian. Steps are limited to ``longest`` (largest component) and halved while the
    residual grows; after ``patience`` steps without gain it ends. Converges linearly to double roots.
    Returns the point and the largest residual component there.
    """
    r, J = evaluate(x)
    size = float(np.abs(r).max(initial=0.0))
    best, best_size = x, size
    stalled = 0
    for _ in range(iterations):
        if size <= tolerance:
            break
        step = least_norm_step(J, r, rank_tolerance)
        biggest = float(np.abs(step).max(initial=0.0))
        if not np.isfinite(biggest) or biggest == 0.0:
            break
        step *= min(1.0, longest / biggest)
        for _ in range(6):
            trial = advance(x, step)
            r_new, J_new = evaluate(trial)
            size_new = float(np.abs(r_new).max(initial=0.0))
            if np.linalg.norm(r_new) < np.linalg.norm(r) or size_new <= tolerance:
                break
            step *= 0.5
        x, r, J, size = trial, r_new, J_new, size_new
        if size < 0.999 * best_size:
            best, best_size, stalled = x, size, 0
        else:
            stalled += 1
        if stalled > patience or (best_size < 1e-9 and stalled > 1):
            break
    return best, best_size
