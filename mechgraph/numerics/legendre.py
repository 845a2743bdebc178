"""Gauss and Legendre's points of an interval, and integrals from its begin by Legendre's series through values at them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GAUSS = 8
"""Points of Gauss and Legendre a step between nodes: what is integrated over it is exact to rounding."""
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(GAUSS)
PLACES = np.concatenate([[-1.0], POINTS, [1.0]])
"""The points of a step and its ends."""
TO_SERIES = WEIGHTS[:, None] * np.polynomial.legendre.legvander(POINTS, GAUSS - 1) * (np.arange(GAUSS) + 0.5)
"""Coefficients of Legendre's series from values at the points."""


def integrals(t: Array) -> Array:
    """Half the integrals of Legendre's polynomials from -1 to ``t (n,)``, ``(n, GAUSS)``."""
    P = np.polynomial.legendre.legvander(t, GAUSS)
    out = np.empty((len(t), GAUSS))
    out[:, 0] = 0.5 * (t + 1.0)
    k = np.arange(1, GAUSS)
    out[:, 1:] = 0.5 * (P[:, 2:] - P[:, : GAUSS - 1]) / (2 * k + 1)
    return out
