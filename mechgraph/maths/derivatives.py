"""First and second derivative of a function that is known by its values, with an estimate of the error."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from mechgraph.maths.se3 import Array

CHEBYSHEV_POINTS = 32
"""Points of one panel where a callable is differentiated."""

CHEBYSHEV_NOISE = 8.0 * float(np.finfo(np.float64).eps)
"""Relative size below which a Chebyshev coefficient of a callable is taken for rounding."""

DERIVATIVE_TOLERANCE = 1e-6
"""Largest estimated error of s'' of a callable, relative to max |s''| or 4 max |s| / range^2."""


class NotSmooth(ArithmeticError):
    """A function whose derivatives cannot be found near ``t``."""

    def __init__(self, t: float) -> None:
        super().__init__(f"not smooth enough near t = {t:g} to be differentiated twice")
        self.t = t


@dataclass(frozen=True)
class _Panel:
    """A piece of a callable: Chebyshev coefficients on left <= t <= right, and the rounding in its values."""

    left: float
    right: float
    coefficients: Array
    rounding: float

    @property
    def slope(self) -> float:
        """The derivative of the Chebyshev variable, dx/dt = 2 / (right - left)."""
        return 2.0 / (self.right - self.left)

    @property
    def error(self) -> float:
        """Estimated error of the second derivative: rounding times T_n''(1) = n^2 (n^2 - 1) / 3."""
        n = self.coefficients.size - 1
        return self.rounding * self.slope**2 * n**2 * (n**2 - 1) / 3.0

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Return the interpolant and its two derivatives at t."""
        x = (2.0 * t - self.left - self.right) / (self.right - self.left)
        position, velocity, acceleration = (
            chebyshev.chebval(x, chebyshev.chebder(self.coefficients, k) * self.slope**k) for k in range(3)
        )
        return position, velocity, acceleration


def derivatives(
    function: Callable[[Array], Array], t: Array, position: Array, low: float, high: float
) -> tuple[Array, Array]:
    """Return first and second derivative of a function at t, low <= t <= high, where it has the values ``position``.

    Taken from Chebyshev interpolants of degree 31 on panels of the range, halved until the last coefficients are down to rounding;
    coefficients below that are dropped. With n coefficients on a panel of length l the error of the second derivative is about

        8 eps max(|f| + |t f'| / 4) (2 / l)^2 n^4 / 3

    (Trefethen, Approximation Theory and Approximation Practice, 2013). The interpolants must also meet the given positions at t, unseen by
    their nodes, and each other: a jump of the velocity or acceleration from panel to panel is a kink.

    Raises
    ------
    NotSmooth
        at a kink, or where the estimated error exceeds ``DERIVATIVE_TOLERANCE``.
    """
    velocity, acceleration = np.empty(t.shape), np.empty(t.shape)
    panels = _panels(function, low, high)
    for panel in panels:
        here = (t >= panel.left) & (t <= panel.right)
        met, velocity[here], acceleration[here] = panel.at(t[here])
        # how many times its rounding the interpolant of a callable may miss a position
        missed = np.abs(met - position[here]) > 1e3 * panel.rounding
        if missed.any():
            raise NotSmooth(float(t[here][missed][0]))
    size = max(float(np.abs(panel.coefficients).sum()) for panel in panels)
    span = high - low
    fast = DERIVATIVE_TOLERANCE * max(float(np.abs(velocity).max()), 2.0 * size / span)
    steep = DERIVATIVE_TOLERANCE * max(float(np.abs(acceleration).max()), 4.0 * size / span**2)
    for panel in panels:
        if panel.error > steep:
            raise NotSmooth((panel.left + panel.right) / 2.0)
    for panel, following in itertools.pairwise(panels):
        before, after = (side.at(np.array(panel.right)) for side in (panel, following))
        if abs(before[1] - after[1]) > fast or abs(before[2] - after[2]) > steep:
            raise NotSmooth(panel.right)
    return velocity, acceleration


def _panels(function: Callable[[Array], Array], low: float, high: float) -> list[_Panel]:
    """Return panels, in order, whose Chebyshev coefficients go down to rounding.

    The rounding in the values is 8 eps (|f| + |t f'| / 4), the second term from that in t.
    """
    nodes = np.asarray(chebyshev.chebpts1(CHEBYSHEV_POINTS))
    transform = chebyshev.chebvander(nodes, CHEBYSHEV_POINTS - 1).T * (2.0 / CHEBYSHEV_POINTS)
    transform[0] /= 2.0
    done: list[_Panel] = []
    ends = [(low, high)]
    # how often the range of a callable is halved at most before it counts as not smooth
    for _ in range(16 + 1):
        left, right = np.array(ends).T[:, :, None]
        times = (left + right) / 2.0 + (right - left) / 2.0 * nodes
        values = function(times)
        steep = np.abs(times).max(1) * np.abs(np.diff(values) / np.diff(times)).max(1)
        rounding = CHEBYSHEV_NOISE * (np.abs(values).max(1) + steep / 4.0)
        halves: list[tuple[float, float]] = []
        for (a, b), coefficients, floor in zip(ends, values @ transform.T, rounding, strict=True):
            significant = np.flatnonzero(np.abs(coefficients) > floor)
            length = int(significant[-1]) + 1 if significant.size else 1
            if length <= CHEBYSHEV_POINTS - 4:
                done.append(_Panel(a, b, coefficients[:length], float(floor)))
            else:
                halves += [(a, (a + b) / 2.0), ((a + b) / 2.0, b)]
        if not halves:
            return sorted(done, key=lambda panel: panel.left)
        ends = halves
    raise NotSmooth(ends[0][0])
