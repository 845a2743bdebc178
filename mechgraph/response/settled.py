"""Derivatives by central differences at several lengths, of which two that agree are believed.

One length does not know what bends within it: the slope of ``-tanh(x / 0.001)`` over 0.004 is off by two thirds. The lengths fall by four
until two derivatives agree; where none do, as at a jump or a corner, that is said.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import Array

STENCIL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
"""Steps and weights of the first derivative by central differences of eighth order."""
LENGTHS = 8
"""Most lengths."""
SHRINK = 0.25
"""Every length against the one before."""
SETTLED = 1e-10
"""Difference of two derivatives, of the largest, from which on they agree as well as rounding lets them."""
UNSETTLED = 1e-3
"""The same above which no derivative is known."""
CORNER = 1e-6
"""Difference of the slopes to both sides, or of the values there, of the largest, that is one where it does not fall with the length."""
FALLS = 0.5
"""Part of it that is left at the next length where it falls: a quarter of what is smooth."""


@dataclass(frozen=True)
class Slopes:
    """Values ``(r,)`` at the place, their derivatives ``(r, n)``, and by how much these differ at two lengths.

    ``unsettled``: coordinates by which no derivative is known.
    """

    values: Array
    slopes: Array
    error: Array
    unsettled: tuple[int, ...]


def settled_slopes(values: Callable[[Array], Array], n: int, first: float) -> Slopes | None:
    """Derivatives of ``values(u (n, T)) -> (r, T)`` at 0; NaN where values are unknown. None where they are known at no length."""
    eye, signs = np.eye(n), [(sign * k, sign * weight) for k, weight in STENCIL for sign in (1.0, -1.0)]
    known: list[tuple[Array, Array, Array, Array]] = []
    best: tuple[Array, Array] | None = None
    for i in range(LENGTHS):
        h = first * SHRINK**i
        f = values(np.concatenate([np.zeros((n, 1)), *(k * h * eye for k, _ in signs)], axis=1))
        if not np.isfinite(f).all():
            continue
        parts = f[:, 1:].reshape(len(f), len(signs), n)
        slopes = np.einsum("rkn,k->rn", parts, [weight for _, weight in signs]) / h
        corner = np.abs(parts[:, 0] + parts[:, 1] - 2.0 * f[:, :1]) / h
        known.append((f[:, 0], slopes, corner, np.abs(parts[:, 0] - parts[:, 1])))
        if len(known) < 2:
            continue
        error = np.abs(known[-1][1] - known[-2][1])
        scale = max(float(np.abs(one[1]).max(initial=0.0)) for one in known) or 1.0
        if best is None or error.max() < best[1].max():
            # of the first two the longer one has less rounding, later on the shorter one bends less
            best = (known[0][1] if len(known) == 2 else slopes), error
        if error.max() <= SETTLED * scale:
            break
    if not known:
        return None
    if best is None:
        best = known[0][1], np.full(known[0][1].shape, np.inf)
    largest = max(float(np.abs(one[1]).max(initial=0.0)) for one in known) or 1.0
    off = (best[1] > UNSETTLED * largest).any(axis=0)
    if len(known) > 1:
        (*_, wide, apart), (*_, corner, jump) = known[-2], known[-1]
        off |= ((corner > FALLS * wide) & (corner > CORNER * largest)).any(axis=0)
        off |= ((jump > FALLS * apart) & (jump > CORNER * first * largest)).any(axis=0)
    return Slopes(known[0][0], best[0], best[1], tuple(np.flatnonzero(off).tolist()))
