"""The shape of a cam from the law of its follower."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.errors import DeclarationError
from mechgraph.model.curves import ORDERS, WHOLE_TURN, Centred
from mechgraph.model.field_kinds import NUMBER, POSITIVE, SAMPLES, TEXT
from mechgraph.model.pieces import Pieces, derivatives, parted
from mechgraph.quantities import wrong
from mechgraph.units import LENGTH


@dataclass(frozen=True, kw_only=True, repr=False)
class Cam(Centred):
    """The shape of a cam that lifts a follower by given amounts at given angles of the cam, over one whole turn.

    ``roller`` (a knife edge where ``roller_radius`` is zero): the path of the roller's centre on the cam; the follower slides along
    ``second`` and passes the axis at the distance ``offset`` (towards axis x second). ``flat``: the profile, which touches a face at right
    angles to ``second``. The cam turns about its axis in the positive sense. Between the samples the lift is a polynomial of degree 5
    that meets lift and both derivatives.
    """

    kind = "cam"
    angle: Annotated[Any, SAMPLES("angles of the cam, 0 to 2 pi", degrees=True)]
    lift: Annotated[Any, SAMPLES("lifts there", LENGTH)]
    slope: Annotated[Any, SAMPLES("their derivatives by the angle", LENGTH)]
    bend: Annotated[Any, SAMPLES("second derivatives", LENGTH)]
    base_radius: Annotated[float, POSITIVE("radius of the base circle of the profile", LENGTH)]
    roller_radius: Annotated[float, NUMBER("radius of the roller", LENGTH, minimum=0.0)] = 0.0
    offset: Annotated[float, NUMBER("distance of the line of the follower from the axis", LENGTH)] = 0.0
    follower: Annotated[str, TEXT("what it lifts", choices=("roller", "flat"))] = "roller"

    @classmethod
    def of(cls, motion: Any, base_radius: float, **more: Any) -> Cam:
        """The cam of a ``Motion`` whose times are the angles of the cam, ``mg.Motion.law(..., t=angle)``."""
        if getattr(motion, "t", None) is None:
            wanted = "an mg.Motion with times, which are the angles, such as mg.Motion.law(..., t=angle)"
            raise DeclarationError("cam", [wrong(motion, "motion", wanted)])
        rates = {"lift": motion.position, "slope": motion.velocity, "bend": motion.acceleration}
        return cls(angle=motion.t, base_radius=base_radius, **rates, **more)

    @cached_property
    def _beside_follower(self) -> Pieces:
        """``y_k`` with ``x^(k) = R(-u) y_k``, both components of each: polynomials, as ``x' = R(-u) (y' - J y)``."""
        meets = [np.array(self.lift), np.array(self.slope), np.array(self.bend)]
        s = derivatives(Pieces.meeting(np.array(self.angle), meets).coefficients[::-1], ORDERS + 1)
        flat = self.follower == "flat"
        a, b = s[:ORDERS].copy(), -s[1:] if flat else np.zeros_like(s[:ORDERS])
        a[0, 0] += self.base_radius if flat else np.sqrt((self.base_radius + self.roller_radius) ** 2 - self.offset**2)
        if not flat:
            b[0, 0] = self.offset
        found = []
        for _ in range(ORDERS):
            found.append([a[0], b[0]])
            a, b = a[1:] + b[:-1], b[1:] - a[:-1]
        return Pieces(np.array(self.angle), np.moveaxis(np.array(found), (0, 1), (2, 3))[::-1], orders=1)

    def at(self, u: Array) -> Array:
        """Roller: ``R(-u) ((d + lift) e1 + offset e2)``; flat: ``R(-u) ((r + lift) e1 - lift' e2)``."""
        y = self._beside_follower.at(u)[0]
        c, s = np.cos(u), np.sin(u)
        out = np.zeros((ORDERS, 3, *u.shape), dtype=y.dtype)
        out[:, 0], out[:, 1] = c * y[:, 0] + s * y[:, 1], c * y[:, 1] - s * y[:, 0]
        return self._placed(out)

    @property
    def is_closed(self) -> bool:
        """Yes."""
        return True

    @property
    def roller(self) -> float:
        """As declared."""
        return self.roller_radius if self.follower == "roller" else 0.0

    @cached_property
    def breaks(self) -> Array:
        """Parts of the intervals between samples."""
        return parted(np.array(self.angle), -(-360 // (len(self.angle) - 1)))

    def faults(self, where: str) -> list[str]:
        """Samples that make no closed cam."""
        found = super().faults(where)
        if found:
            return found
        names = ("angle", "lift", "slope", "bend")
        angle, *values = (np.atleast_1d(getattr(self, name)) for name in names)
        if any(v.shape != angle.shape or v.ndim != 1 for v in values) or len(angle) < 8:
            return [f"{where}angle, lift, slope, bend: give as many of each, 8 or more"]
        if abs(angle[0]) > 1e-9 or abs(angle[-1] - WHOLE_TURN) > 1e-9 or (np.diff(angle) <= 0).any():
            return [
                f"{where}angle: must increase from 0 to 2 pi, both included; runs from {angle[0]:.6g} to {angle[-1]:.6g}"
            ]
        size = self.base_radius
        for name, v in zip(names[1:], values, strict=True):
            if abs(v[-1] - v[0]) > 1e-6 * size:
                found.append(f"{where}{name}: is {v[0]:.6g} at angle 0 and {v[-1]:.6g} at 2 pi; the cam is not closed")
        if not found:
            found += [
                f"{where}{rate}: is not the derivative of {name} by the angle in radians; {name} changes otherwise between the samples"
                for name, rate, y, dy, most in zip(names[1:], names[2:], values, values[1:], (0.5, 0.8), strict=False)
                if _strays(angle, y / size, dy / size, most)
            ]
        if self.follower == "roller" and abs(self.offset) >= self.base_radius + self.roller_radius:
            found.append(f"{where}offset = {self.offset!r}: must be below base_radius + roller_radius")
        if self.follower == "flat" and self.offset:
            found.append(
                f"{where}offset = {self.offset!r}: does not change the shape for a flat follower; leave it out"
            )
        return found


def _strays(u: Array, y: Array, rate: Array, most: float) -> bool:
    """Whether samples change otherwise than the mean of the rates at both ends of each interval, by more than the part ``most`` in all.

    Between coarse samples, and where a bend jumps, true rates stray too; of another unit, sign, or left zero they stray by 1 and more.
    """
    change, y = np.diff(u) * (rate[1:] + rate[:-1]) / 2, np.diff(y)
    return bool(np.abs(y - change).sum() > most * max(np.abs(y).sum(), np.abs(change).sum()) + 1e-6)
