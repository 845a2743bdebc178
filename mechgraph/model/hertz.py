"""Pressure between elements that touch at a point or along a line: Hertz's theory of contact, batched.

Source: K. L. Johnson, Contact Mechanics, 1985, sections 4.2 (lines) and 4.2(c), eqs. 4.24 to 4.28 (ellipses).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.model.field_format import Described
from mechgraph.model.field_kinds import POSITIVE, TWO, TWO_POSITIVE
from mechgraph.quantities import wrong
from mechgraph.units import LENGTH, PRESSURE, PURE

HALVINGS = 60
"""Halvings of the ratio of the axes of an ellipse, on a logarithmic scale."""
SLENDER = 1e-6
"""Least ratio of the axes of an ellipse."""


class Pressed(NamedTuple):
    """A contact under load, ``(...)`` each: greatest ``pressure``, half axes ``along`` and ``across`` (of a line its length and half its
    width), and how far the bodies ``approach`` each other (NaN for a line, where it depends on the bodies as a whole).
    """

    pressure: Array
    along: Array
    across: Array
    approach: Array


@dataclass(frozen=True)
class Hertz(Described):
    """What the pressure in a contact takes: both materials, and what else of the elements decides.

    Parameters
    ----------
    moduli, poisson : Young's modulus and Poisson's ratio of the elements on link a and on link b.
    groove_radius : of the cross section of a groove or slot, larger than that of the ball.
    length : of the line along which a cylinder touches.
    """

    moduli: Annotated[Any, TWO_POSITIVE("Young's moduli of the elements on a and on b", PRESSURE)]
    poisson: Annotated[Any, TWO("Poisson's ratios of the elements on a and on b", PURE, default="0.3, 0.3")] = (
        0.3,
        0.3,
    )
    groove_radius: Annotated[
        float | None, POSITIVE("of the cross section of a groove, larger than the ball's", LENGTH)
    ] = None
    length: Annotated[float | None, POSITIVE("of the line along which a cylinder touches", LENGTH)] = None

    def __post_init__(self) -> None:
        self.read_numbers()

    def value_faults(self, where: str) -> list[str]:
        """See ``Described``."""
        found = super().value_faults(where)
        if not found and not all(-1.0 < nu <= 0.5 for nu in self.poisson):
            found.append(wrong(self.poisson, f"{where}poisson", "two numbers between -1 and 0.5"))
        return found

    @property
    def modulus(self) -> float:
        """``E*``: ``1 / E* = (1 - nu_a^2) / E_a + (1 - nu_b^2) / E_b``."""
        return 1.0 / sum((1.0 - nu**2) / E for E, nu in zip(self.moduli, self.poisson, strict=True))


def pressed(force: Array, curvatures: tuple[Array, Array], modulus: float) -> Pressed:
    """A point contact under the force ``(...)``; ``curvatures`` are the relative ones along and across, both above 0.

        a^3 = 3 F E(m) / (2 pi k^2 E* (A + B)),  b = k a,  p0 = 3 F / (2 pi a b),  delta = p0 b K(m) / E*,  m = 1 - k^2,
        B / A = (K - D) / (k^2 D),  D = (K - E) / m

    with half the curvatures ``A <= B`` and complete elliptic integrals (Johnson 4.26); D is Carlson's ``R_D(0, k^2, 1) / 3``.
    """
    one, two = (0.5 * np.asarray(c, dtype=float) for c in curvatures)
    A, B = np.minimum(one, two), np.maximum(one, two)
    low, high = np.full(A.shape, np.log(SLENDER)), np.zeros(A.shape)
    for _ in range(HALVINGS):  # the ratio falls from infinity at k = 0 to 1 at k = 1
        middle = 0.5 * (low + high)
        k = np.exp(middle)
        K, D = scipy.special.ellipkm1(k * k), scipy.special.elliprd(0.0, k * k, 1.0) / 3
        rounder = B * k * k * D < A * (K - D)
        low, high = np.where(rounder, middle, low), np.where(rounder, high, middle)
    k = np.exp(high)
    m = 1.0 - k * k
    F = np.where(np.asarray(force) >= 0, force, np.nan)
    a = np.cbrt(3 * F * scipy.special.ellipe(m) / (2 * np.pi * k**2 * modulus * (A + B)))
    b = k * a
    with np.errstate(invalid="ignore", divide="ignore"):
        p0 = np.where(F == 0, 0.0, 3 * F / (2 * np.pi * a * b))
    along, across = np.where(one <= two, a, b), np.where(one <= two, b, a)
    return Pressed(p0, along, across, p0 * b * scipy.special.ellipkm1(k * k) / modulus)


def pressed_along_line(force: Array, off: Array, length: float, curvature: Array, modulus: float) -> Pressed:
    """A line contact under the force ``(...)`` that acts ``off`` the middle of its length, as ``p0 = sqrt(w E* curvature / pi)``.

    w is the greatest load per length, taken as linear along the line: ``w = F (1 + 6 off / l) / l`` up to ``off = l / 6``, then ``2 F / (3
    (l / 2 - off))`` on what still touches; NaN where the force is off the line, which tips over. Stress at sharp ends is not in it.
    """
    F, e = np.asarray(force, dtype=float), np.abs(off)
    with np.errstate(invalid="ignore", divide="ignore"):
        w = np.where(e <= length / 6, F * (1 + 6 * e / length) / length, 2 * F / (3 * (length / 2 - e)))
        w = np.where((e < length / 2) & (F >= 0), w, np.nan)
        touching = np.where(e <= length / 6, length, 3 * (length / 2 - e))
        width = np.sqrt(4 * w / (np.pi * modulus * curvature))
    pressure = np.sqrt(w * modulus * curvature / np.pi)
    return Pressed(pressure, touching, width, np.full(F.shape, np.nan))
