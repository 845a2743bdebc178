"""A look between the ends of a step at what depends on time by itself: a pulse between two evaluations leaves no trace in its error.

Over a step of length ``h`` in which the motion is followed to a tolerance, a force of time is close to the polynomial of degree 15 through
its values at Chebyshev points, all else held as it is where the step ends. Where it differs somewhere by an acceleration ``e``, the
step may miss a change ``h e`` of a rate; it is refused where that is far above the tolerance.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mechgraph.algebra.se3 import Array

POINTS_OF_STEP = 16
"""Chebyshev points of a step."""
FEWEST_LOOKS = 64
"""Fewest places between them at which is looked."""
OF_ALL = 2000
"""Places at which is looked from the beginning of a motion to its end: a pulse longer than this part of it is seen."""
OVERLOOKED = 100.0
"""Change of a rate, against the tolerance of a step, up to which a difference is left to the error estimate of the step."""
SHORTER = 0.25
"""Part of a step that was refused with which the next is tried."""

_AT = np.cos(np.pi * (np.arange(POINTS_OF_STEP) + 0.5) / POINTS_OF_STEP)
_SERIES = np.polynomial.chebyshev.chebvander(_AT, POINTS_OF_STEP - 1) * (2.0 / POINTS_OF_STEP)
_SERIES[:, 0] *= 0.5


def overlooked(by_time: Callable[[Array], Array], begin: float, end: float, apart: float, allowed: Array) -> bool:
    """Whether a step from ``begin`` to ``end`` may have missed something.

    ``by_time(t (T,))``: accelerations ``(k, T)`` that depend on time by themselves; ``apart``: greatest distance of looks; ``allowed
    (k,)``: changes of the rates within the tolerance.
    """
    h = end - begin
    places = np.linspace(-1.0, 1.0, max(FEWEST_LOOKS, int(np.ceil(h / apart))) + 1)
    found = by_time(begin + 0.5 * h * (1.0 + np.concatenate([_AT, places])))
    smooth = (found[:, :POINTS_OF_STEP] @ _SERIES) @ np.polynomial.chebyshev.chebvander(places, POINTS_OF_STEP - 1).T
    missed = h * np.abs(found[:, POINTS_OF_STEP:] - smooth).max(axis=1)
    return bool((missed > OVERLOOKED * allowed).any())
