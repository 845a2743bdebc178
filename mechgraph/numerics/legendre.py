"""Gauss and Legendre's points of an interval, and integrals from its begin by Legendre's series through values at them."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

POINTS_FOR = {0.01: 3, 0.1: 4, 0.5: 6, 1.0: 8}
"""Points of a part of a step between nodes: what is integrated over it is exact to rounding, as with eight over the whole of it."""


class Rule:
    """The rule with ``count`` points in a step from -1 to 1."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.points, weights = np.polynomial.legendre.leggauss(count)
        self.places = np.concatenate([[-1.0], self.points, [1.0]])
        """The points of a step and its ends."""
        self.to_series = (
            weights[:, None] * np.polynomial.legendre.legvander(self.points, count - 1) * (np.arange(count) + 0.5)
        )
        """Coefficients of Legendre's series from values at the points."""

    def integrals(self, t: Array) -> Array:
        """Half the integrals of Legendre's polynomials from -1 to ``t (n,)``, ``(n, count)``."""
        P = np.polynomial.legendre.legvander(t, self.count)
        out = np.empty((len(t), self.count))
        out[:, 0] = 0.5 * (t + 1.0)
        k = np.arange(1, self.count)
        out[:, 1:] = 0.5 * (P[:, 2:] - P[:, : self.count - 1]) / (2 * k + 1)
        return out


@cache
def _rule(count: int) -> Rule:
    return Rule(count)


def rule(part: float = 1.0) -> Rule:
    """The rule for parts of steps between nodes."""
    return _rule(next((count for most, count in POINTS_FOR.items() if part <= most), max(POINTS_FOR.values())))
