"""Cams: curves that follow from the law of a follower, what is known of them, and how large they must be.

A place of the follower, seen from the frame in which the cam turns by u, has the components ``y = (a, b, h)`` along ``second``, axis x
second and the axis.
On the cam it is ``x = R(-u) y``, so that in the frame ``R x' = y' - e3 x y``. Derivatives are kept as Taylor's coefficients.

Source: R. L. Norton, Cam Design and Manufacturing Handbook, 2009, chapters 7 and 13; H. A. Rothbart, Cam Design Handbook, 2004.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from mechgraph.errors import DeclarationError, TellsNames
from mechgraph.fields import FLAG, NUMBER, POSITIVE, SAMPLES, TABLE, TEXT
from mechgraph.maths.se3 import Array, cross
from mechgraph.memo import dataclass
from mechgraph.pairs.cam_laws import CamLaw, LawPieces
from mechgraph.pairs.curves import INTERVALS, ORDERS, Centred, Pieces, parted
from mechgraph.quantities import LENGTH, door, wrong

FACTORIALS = np.array([math.factorial(k) for k in range(ORDERS + 2)], dtype=float)


def _taylor(values: Array) -> Array:
    """Taylor's coefficients of values and derivatives ``(n, ...)``."""
    return values / FACTORIALS[: len(values)].reshape(-1, *(1,) * (values.ndim - 1))


def _times(a: Array, b: Array) -> Array:
    return np.array([sum(a[j] * b[k - j] for j in range(k + 1)) for k in range(ORDERS)])


def _over(a: Array, b: Array) -> Array:
    out: list[Array] = []
    for k in range(ORDERS):
        out.append((a[k] - sum(out[j] * b[k - j] for j in range(k))) / b[0])
    return np.array(out)


def _turning(p: Array) -> tuple[Array, Array]:
    """Cosine and sine."""
    c, s = [np.cos(p[0])], [np.sin(p[0])]
    for k in range(1, ORDERS):
        part = [j * p[j] / k for j in range(1, k + 1)]
        c, s = (
            [*c, -sum(q * s[k - 1 - i] for i, q in enumerate(part))],
            [*s, sum(q * c[k - 1 - i] for i, q in enumerate(part))],
        )
    return np.array(c), np.array(s)


def _rate(a: Array) -> Array:
    """The derivative, one coefficient shorter."""
    return a[1:] * np.arange(1.0, len(a)).reshape(-1, *(1,) * (a.ndim - 1))


def _constant(value: float, like: Array) -> Array:
    out = np.zeros_like(like)
    out[0] = value
    return out


@dataclass(frozen=True)
class CamFacts(TellsNames):
    """Returned by ``curve.facts(angle)``: arrays ``(...)`` over the angles.

    ``pressure_angle``: 0 to pi/2, between the normal and the way of the roller's center (of a flat face: of the place where it touches);
    ``pitch_radius``: radius of curvature of the path of that center, negative where it is hollow; ``profile_radius``: that of the profile
    (of a groove of its narrower wall); ``undercut``: where there is no such profile; ``contact``: where on a flat face they touch, from
    the line of the follower, or along the face from the foot of the pivot; ``face``: the width that it needs over these angles.
    """

    pressure_angle: Array
    pitch_radius: Array
    profile_radius: Array
    undercut: NDArray[np.bool_]
    contact: Array
    face: float


@dataclass(frozen=True, kw_only=True, repr=False)
class OfLaw(Centred):
    """What cams by the law of their follower share: the law, or samples of one over a turn of the cam; a roller.

    Between samples the law is a polynomial of degree 5 that meets value and both derivatives.
    """

    is_closed = is_profile = True
    named: ClassVar[str] = "lift"
    """Field with the samples of the law."""

    law: Annotated[CamLaw | None, TABLE("law of the follower", table="cam_law", default="samples")] = None
    angle: Annotated[Any, SAMPLES("angles of the cam, 0 to 2 pi", degrees=True, default="those of the law")] = None
    slope: Annotated[Any, SAMPLES("derivatives by the angle", LENGTH, default="those of the law")] = None
    bend: Annotated[Any, SAMPLES("second derivatives", LENGTH, default="those of the law")] = None
    roller_radius: Annotated[float, NUMBER("radius of the roller", LENGTH, minimum=0.0)] = 0.0

    @classmethod
    def of(cls, motion: Any, base_radius: float | None = None, **more: Any) -> Self:
        """The cam of a ``Motion`` whose times are the angles of the cam, ``mg.Motion.law(..., t=angle)``."""
        if getattr(motion, "t", None) is None:
            wanted = "an mg.Motion with times, which are the angles, such as mg.Motion.law(..., t=angle)"
            raise DeclarationError("cam", [wrong(motion, "motion", wanted)])
        rates = {cls.named: motion.position, "slope": motion.velocity, "bend": motion.acceleration}
        size: dict[str, Any] = {} if base_radius is None else {"base_radius": base_radius}
        return cls(angle=motion.t, **size, **rates, **more)

    @door
    def conjugate(self, base_radius: float) -> Self:
        """Return the second disc of a conjugate cam: it stands on the same axis and touches a second roller or face of the same follower
        on the other side, so that both discs together guide the follower without a spring.

        Its law is the same downwards; the distance of both rollers of a slide, and the angle between both arms, never change.

        Parameters
        ----------
        base_radius : float
            Radius of the base circle of the second disc [length]: where the follower is at its zero. Its profile comes nearer to the axis
            by the lift.

        Returns
        -------
        Curve
            The second disc, with the rest of this one.

        Examples
        --------
        >>> import mechgraph as mg
        >>> law = mg.CamLaw(
        ...     [mg.Segment("cycloidal", 0.01, 3.0), mg.Segment("cycloidal", -0.01, 2 * 3.141592653589793 - 3)]
        ... )
        >>> first = mg.Curve.cam(law=law, base_radius=0.04, roller_radius=0.01)
        >>> second = first.conjugate(0.06)
        >>> bool(abs((((first.at(0.7)[0] - second.at(0.7)[0]) ** 2).sum()) ** 0.5 - 0.12) < 1e-15)
        True
        """
        if self.law is None:
            raise DeclarationError(
                "conjugate", ["the cam is one of samples; make it of a law, mg.CamLaw.read or mg.Curve.cam(law=)"]
            )
        return self.replace(law=-self.law, base_radius=base_radius, **self._other_side())

    def _other_side(self) -> dict[str, Any]:
        """The fields of the second disc of a conjugate cam that differ."""
        raise DeclarationError(
            "conjugate", [f"{self.kind}: a groove holds its roller on both sides already, closed='form'"]
        )

    @cached_property
    def pieces(self) -> LawPieces:
        """The exact pieces of the law."""
        if self.law is not None:
            return self.law.pieces
        meets = [np.array(getattr(self, name)) for name in (self.named, "slope", "bend")]
        made = Pieces.meeting(np.array(self.angle), meets, ORDERS)
        return LawPieces(made.breaks, made.coefficients[::-1].T, np.zeros((len(made.breaks) - 1, 3)))

    @abstractmethod
    def _seen(self, u: Array) -> tuple[Array, Array, Array]:
        """Taylor's coefficients ``(4, ...)`` of the place that follows the curve, along ``second``, axis x second and the axis."""

    @abstractmethod
    def _way(self, u: Array) -> Array:
        """The direction ``(3, ...)`` in which the follower moves there."""

    def _depth(self, u: Array) -> tuple[Array, Array, Array] | None:
        """The direction of the axis of a roller in a groove, out of the cam; None for the axis of the cam."""
        return None

    @property
    def ends(self) -> tuple[float, float]:
        """The turn of the law."""
        return 0.0, math.tau if self.law is None else self.law.turn

    @property
    def roller(self) -> float:
        """As declared."""
        return self.roller_radius if getattr(self, "follower", "roller") == "roller" else 0.0

    @property
    def nodes(self) -> Array:
        """Parts of the pieces of the law."""
        breaks = self.pieces.breaks
        return parted(breaks, -(-INTERVALS // (len(breaks) - 1)))

    def _turned_back(self, u: Array, y: tuple[Array, Array, Array]) -> Array:
        """``R(-u) y`` and its derivatives ``(4, 3, ...)`` in the axes of the link, without the center."""
        a, b, h = y
        angle = np.zeros_like(a)
        angle[0], angle[1] = u, 1.0
        c, s = _turning(angle)
        parts = np.stack([_times(c, a) + _times(s, b), _times(c, b) - _times(s, a), h], axis=1)
        parts *= FACTORIALS[:ORDERS].reshape(-1, *(1,) * (parts.ndim - 1))
        return np.matmul(self.basis, parts.reshape(ORDERS, 3, -1)).reshape(parts.shape)

    def at(self, u: Array) -> Array:
        """``R(-u) y`` with the place y of the follower."""
        out = self._turned_back(u, self._seen(u))
        out[0] += np.asarray(self.center).reshape(3, *(1,) * (out.ndim - 2))
        return out

    def depth(self, u: Array) -> Array | None:
        """See ``Curve``."""
        y = self._depth(u)
        return None if y is None else self._turned_back(u, y)

    @door
    def facts(self, angle: Any) -> CamFacts:
        """Compute pressure angle and radii of curvature at angles of the cam.

        Parameters
        ----------
        angle : (...) array_like
            Angles of the cam [rad].

        Returns
        -------
        CamFacts

        Examples
        --------
        >>> import mechgraph as mg
        >>> law = mg.CamLaw([mg.Segment("cycloidal", 0.02, 2.0), mg.Segment("cycloidal", -0.02, 2.0)], turn=4.0)
        >>> mg.Curve.barrel(law=law, radius=0.05).facts(1.0).pressure_angle.round(6)
        np.float64(0.380506)
        """
        self.sound("facts")
        u = np.asarray(angle, dtype=float)
        u = u - self.ends[1] * np.floor(u / self.ends[1])
        y, k = self._seen(u), self._depth(u)
        (a, a1, a2), (b, b1, b2), (h, h1, h2) = (part[:3] for part in y)
        first = np.stack([a1 + b, b1 - a, h1])
        second = np.stack([2 * a2 + 2 * b1 - a, 2 * b2 - 2 * a1 - b, 2 * h2])
        axis = np.zeros_like(first)
        axis[2] = 1.0
        if k is not None:
            axis = np.stack([part[0] for part in k])
        normal, way = cross(axis, first), self._way(u)
        along = np.abs((normal * way).sum(axis=0))
        tilt = cross(normal, way)
        with np.errstate(divide="ignore", invalid="ignore"):
            speed = np.sqrt((first * first).sum(axis=0))
            pitch = -(speed**3) / (cross(first, second) * axis).sum(axis=0)
        roller = self.roller
        groove = not self.is_profile
        profile = (np.abs(pitch) if groove else pitch) - roller
        cut = (np.abs(pitch) <= roller) if groove else (pitch >= 0) & (pitch <= roller)
        face = self._face_normal(u)
        if face is not None:  # the profile goes back where its radius is below zero
            pitch = profile = np.sign(first[0] * face[1] - first[1] * face[0]) * np.abs(pitch)
            cut = pitch <= 0
        contact = self._on_face(u)
        width = float(np.ptp(contact)) if np.isfinite(contact).all() else math.nan
        return CamFacts(np.arctan2(np.sqrt((tilt * tilt).sum(axis=0)), along), pitch, profile, cut, contact, width)

    def _face_normal(self, u: Array) -> Array | None:
        """The normal ``(3, ...)`` of a flat face, out of the cam; None of a roller."""
        return None

    def _on_face(self, u: Array) -> Array:
        """Where on a flat face they touch."""
        return np.full(u.shape, np.nan)

    def law_faults(self, where: str, size: float) -> list[str]:
        """What is wrong with the law or the samples; ``size`` is a large value of them."""
        names = ("angle", self.named, "slope", "bend")
        given = [name for name in names if getattr(self, name) is not None]
        if self.law is not None:
            if not isinstance(self.law, CamLaw):
                return [f"{where}{wrong(self.law, 'law', 'an mg.CamLaw, such as mg.CamLaw([mg.Segment(...), ...])')}"]
            if given:
                return [f"{where}law: says {', '.join(given)} too; leave these out"]
            turns = self.law.turn / math.tau
            if self.is_profile and abs(turns - 1.0) > 1e-9:
                return [
                    f"{where}law.turn = {self.law.turn:.6g}: the disc of a cam repeats after 2 pi; let the law fill that"
                ]
            return []
        if len(given) < 4:
            return [f"{where}law: is missing; give law=mg.CamLaw(...), or samples {', '.join(names)}"]
        return self.sample_faults(where, size)

    def sample_faults(self, where: str, size: float) -> list[str]:
        """Samples that make no closed cam; ``size`` is a large value of the law."""
        names = ("angle", self.named, "slope", "bend")
        angle, *values = (np.atleast_1d(getattr(self, name)) for name in names)
        if any(v.shape != angle.shape or v.ndim != 1 for v in values) or len(angle) < 8:
            return [f"{where}{', '.join(names)}: give as many of each, 8 or more"]
        if abs(angle[0]) > 1e-9 or abs(angle[-1] - math.tau) > 1e-9 or (np.diff(angle) <= 0).any():
            return [
                f"{where}angle: must increase from 0 to 2 pi, both included; runs from {angle[0]:.6g} to {angle[-1]:.6g}"
            ]
        found = [
            f"{where}{name}: is {v[0]:.6g} at angle 0 and {v[-1]:.6g} at 2 pi; the cam is not closed"
            for name, v in zip(names[1:], values, strict=True)
            if abs(v[-1] - v[0]) > 1e-6 * size
        ]
        return found or [*self._contradictions(where, angle, values)]

    def _contradictions(self, where: str, u: Array, values: list[Array]) -> Iterator[str]:
        """Rates that are not those of the samples before them: slopes that do not lead from lift to lift, bends from slope to slope.

        Over an interval h a law changes by ``h (d_0 + d_1) / 2 + h^2 (b_0 - b_1) / 12`` with slopes d and bends b, the spline of degree 3
        through its slopes; these change by ``h (b_0 + b_1) / 2``. Where bends (their rates) jump by J the error is up to ``h^2 J / 12``
        (``h J / 2``), elsewhere less than with a first or second difference in the place of J. From sample to sample such errors are
        summed, and so is what the samples stray, so that rounding does not add up in it.
        """
        y, d, b = values
        h, change = np.diff(u), np.diff(b)
        second = np.abs(change - np.roll(change, 1))  # about the beginning of every interval; the law is closed
        jump = np.minimum(np.abs(change), np.maximum(second, np.roll(second, -1)))
        names = (self.named, "slope", "bend")
        for (what, rate), given, led, error in (
            (names[:2], y, 0.5 * h * (d[1:] + d[:-1]) - h * h * change / 12, h * h * jump / 12),
            (names[1:], d, 0.5 * h * (b[1:] + b[:-1]), 0.5 * h * jump),
        ):
            told = np.append(0.0, np.cumsum(led))
            stray = given - told
            i, j = sorted((int(np.argmin(stray)), int(np.argmax(stray))))
            # part of its range by which a law may stray from its rates: samples are rounded to few digits
            if np.ptp(stray) - error.sum() > 2e-3 * max(np.ptp(given), np.ptp(told)):
                yield (
                    f"{where}{rate}: is not the derivative of {what} by the angle in radians; from angle {u[i]:.6g} to {u[j]:.6g} {what} "
                    f"changes by {given[j] - given[i]:.6g}, by the {rate}s given it would by {told[j] - told[i]:.6g}"
                )


@dataclass(frozen=True, kw_only=True, repr=False)
class Cam(OfLaw):
    """The shape of a cam that lifts a follower by a law over one turn.

    ``roller`` (a knife edge where ``roller_radius`` is zero): the path of the roller's center on the cam; the follower slides along
    ``second`` and passes the axis at the distance ``offset`` (towards axis x second). ``flat``: the profile, which touches a face at right
    angles to ``second``. The cam turns about its axis in the positive sense; a negative offset makes the pressure angle of the rise
    smaller. Give ``law``, or samples ``angle``, ``lift``, ``slope``, ``bend``. For a follower that swings take ``arm_cam``.
    """

    kind = "cam"
    base_radius: Annotated[float, POSITIVE("radius of the base circle of the profile", LENGTH)]
    lift: Annotated[Any, SAMPLES("lifts at the angles", LENGTH, default="those of the law")] = None
    offset: Annotated[float, NUMBER("distance of the line of the follower from the axis", LENGTH)] = 0.0
    follower: Annotated[str, TEXT("what it lifts", choices=("roller", "flat"))] = "roller"

    def _seen(self, u: Array) -> tuple[Array, Array, Array]:
        """Roller: ``(d + lift, offset)``; flat: ``(r + lift, -lift')``."""
        flat = self.follower == "flat"
        s = _taylor(self.pieces.at(u, ORDERS + 1))
        a = s[:ORDERS].copy()
        a[0] += self.base_radius if flat else math.sqrt((self.base_radius + self.roller_radius) ** 2 - self.offset**2)
        return a, -_rate(s) if flat else _constant(self.offset, a), np.zeros_like(a)

    def _way(self, u: Array) -> Array:
        """Along ``second``."""
        return np.stack([np.ones(u.shape), np.zeros(u.shape), np.zeros(u.shape)])

    def _face_normal(self, u: Array) -> Array | None:
        """Along ``second``."""
        return self._way(u) if self.follower == "flat" else None

    def _on_face(self, u: Array) -> Array:
        """``-lift'`` towards axis x second."""
        return -self.pieces.at(u, 2)[1] if self.follower == "flat" else super()._on_face(u)

    def _other_side(self) -> dict[str, Any]:
        """Opposite to ``second``, so that the same line is passed at the other side."""
        return {"second": tuple(-x for x in self.second), "offset": -self.offset}

    def faults(self, where: str) -> list[str]:
        """Samples that make no closed cam."""
        found = super().faults(where)
        if found:
            return found
        found = self.law_faults(where, self.base_radius)
        if self.follower == "roller" and abs(self.offset) >= self.base_radius + self.roller_radius:
            found.append(f"{where}offset = {self.offset!r}: must be below base_radius + roller_radius")
        if self.follower == "flat" and self.offset:
            found.append(
                f"{where}offset = {self.offset!r}: does not change the shape for a flat follower; leave it out"
            )
        return found


@dataclass(frozen=True, kw_only=True, repr=False)
class OfSwing(OfLaw):
    """What cams share whose follower swings: their law is an angle."""

    named = "swing"
    slope: Annotated[Any, SAMPLES("derivatives by the angle of the cam", default="those of the law")] = None
    bend: Annotated[Any, SAMPLES("second derivatives", default="those of the law")] = None

    def in_units(self, base: tuple[float, float, float], turns: bool = False) -> Self:
        """See ``Described``: the law is one of angles."""
        return super().in_units(base, True)

    def without_quantities(self, units: Any, turns: bool = False) -> Self:
        """See ``Described``: the law is one of angles."""
        return super().without_quantities(units, True)


@dataclass(frozen=True, kw_only=True, repr=False)
class ArmCam(OfSwing):
    """The shape of a cam that swings an arm by a law over one turn.

    The arm turns about a pivot, which stands at the distance ``pivot`` from the axis along ``second``. With a ``roller`` the curve is the
    path of its center on the cam; where the swing is zero it is ``base_radius + roller_radius`` from the axis, on the side of axis x
    second of the line to the pivot (``mirrored``: on the other). A ``flat`` face passes the pivot at the distance ``offset`` away from
    the cam, and touches the base circle where the swing is zero; the curve is the profile then. Swings lead away from the cam. The cam
    turns about its axis in the positive sense. Give ``law``, or samples ``angle``, ``swing``, ``slope``, ``bend``.
    """

    kind = "arm_cam"
    base_radius: Annotated[float, POSITIVE("radius of the base circle of the profile", LENGTH)]
    swing: Annotated[Any, SAMPLES("angles of the arm, away from the cam", degrees=True, default="those of the law")] = (
        None
    )
    arm: Annotated[
        float | None,
        POSITIVE(
            "length of the arm, from the pivot to the center of the roller", LENGTH, default="needed for a roller"
        ),
    ] = None
    pivot: Annotated[float, POSITIVE("distance of the pivot from the axis", LENGTH)]
    mirrored: Annotated[
        bool, FLAG("whether the roller is on the other side of the line from the axis to the pivot")
    ] = False
    offset: Annotated[float, NUMBER("distance of a flat face from the pivot", LENGTH)] = 0.0
    follower: Annotated[str, TEXT("what it swings", choices=("roller", "flat"))] = "roller"

    @property
    def _first(self) -> float:
        """Cosine (of a flat face the sine) of the angle at the pivot between the arm at no swing and the line to the axis."""
        if self.follower == "flat":
            return (self.base_radius - self.offset) / self.pivot
        c, arm = self.pivot, self.arm or 0.0
        return (c * c + arm * arm - (self.base_radius + self.roller_radius) ** 2) / (2 * c * arm)

    @property
    def _home(self) -> float:
        """That angle."""
        return math.asin(self._first) if self.follower == "flat" else math.acos(self._first)

    def _seen(self, u: Array) -> tuple[Array, Array, Array]:
        """With the angle p at the pivot, ``p = p_0 + swing``, along the arm d = (-cos p, sin p), away from the cam n = (sin p, cos p).

        Roller: ``c e1 + arm d``; flat: ``(c sin p + offset) n - c cos p p' / (1 + p') d``, the envelope of the face; mirrored: with -p'.
        """
        p = _taylor(self.pieces.at(u, ORDERS + 1))
        p[0] += self._home
        c, s = _turning(p)
        if self.follower == "flat":
            rate = self._sense * _rate(p)
            support, along = self.pivot * s, -self.pivot * _over(_times(c, rate), rate + _constant(1.0, rate))
            support[0] += self.offset
            a, b = _times(support, s) - _times(along, c), _times(support, c) + _times(along, s)
        else:
            assert self.arm is not None
            a, b = -self.arm * c, self.arm * s
            a[0] += self.pivot
        return a, self._sense * b, np.zeros_like(a)

    def _other_side(self) -> dict[str, Any]:
        """On the other side of the line to the pivot."""
        return {"mirrored": not self.mirrored}

    @property
    def _sense(self) -> float:
        """1 where the arm, swinging away from the cam, turns against it."""
        return -1.0 if self.mirrored else 1.0

    def _way(self, u: Array) -> Array:
        """At right angles to the line from the pivot."""
        a, b, _ = (part[0] for part in self._seen(u))
        size = np.hypot(a - self.pivot, b)
        return np.stack([b / size, (self.pivot - a) / size, 0.0 * a])

    def _face_normal(self, u: Array) -> Array | None:
        """``(sin p, cos p)``."""
        if self.follower != "flat":
            return None
        p = self.pieces.at(u, 1)[0] + self._home
        return np.stack([np.sin(p), self._sense * np.cos(p), 0.0 * p])

    def _on_face(self, u: Array) -> Array:
        """``c cos p / (1 + p')`` (mirrored: with -p') from the foot of the pivot, towards the cam."""
        if self.follower != "flat":
            return super()._on_face(u)
        p, rate = self.pieces.at(u, 2)
        return np.asarray(self.pivot * np.cos(p + self._home) / (1.0 + self._sense * rate))

    def faults(self, where: str) -> list[str]:
        """Samples that make no closed cam, lengths that make no triangle, swings past the line through axis and pivot."""
        found = super().faults(where)
        if found:
            return found
        flat, far = self.follower == "flat", self.base_radius + self.roller_radius
        if (self.arm is None) != flat or (self.offset and not flat):
            return [f"{where}arm, offset: a roller takes arm=, a flat face offset=, and neither the other"]
        if not abs(self._first) < 1:
            if flat:
                return [
                    f"{where}pivot = {self.pivot:.6g}: must be above base_radius - offset for a face to reach the base circle"
                ]
            low, high = abs(self.pivot - far), self.pivot + far
            return [
                f"{where}arm = {self.arm:.6g}: does not reach the base circle; give one between {low:.6g} and {high:.6g}"
            ]
        found = self.law_faults(where, 1.0)
        if found:
            return found
        values = self.pieces.at(self.nodes, 2)
        low, high = float(values[0].min()), float(values[0].max())
        least, most = (-0.5 * np.pi, 0.5 * np.pi) if flat else (0.0, np.pi)
        if not (low + self._home > least and high + self._home < most):
            found.append(
                f"{where}{self.named}: runs from {low:.6g} to {high:.6g}; the arm would pass the line through axis "
                f"and pivot at {least - self._home:.6g} or {most - self._home:.6g}"
            )
        if flat and not (self._sense * values[1]).min() > -1.0:
            found.append(f"{where}law: the arm turns faster than the cam; no flat face does")
        return found


@dataclass(frozen=True, kw_only=True, repr=False)
class Groove(OfLaw):
    """What grooves about the cam share: a roller runs between two walls, with its axis out of the cam."""

    is_profile = False

    def faults(self, where: str) -> list[str]:
        """A law or size that makes no groove."""
        found = super().faults(where) or self.law_faults(where, 1.0)
        if found:
            return found
        if self.frame != "minimizing" or self.guide is not None:
            found.append(f"{where}frame, guide: the axis of the roller says them; leave them out")
        turns = self.ends[1] / math.tau
        if abs(turns - round(turns)) > 1e-9:
            found.append(
                f"{where}law.turn = {self.ends[1]:.6g}: a groove comes back after whole turns; let the law fill a multiple of 2 pi"
            )
        return found


@dataclass(frozen=True, kw_only=True, repr=False)
class Barrel(Groove):
    """The groove of a barrel (cylinder) cam that moves a follower along its axis by a law.

    It is the path of the roller's center at the ``radius`` of the barrel; the roller's axis is radial, towards ``second`` where it stands.
    The cam turns about its axis in the positive sense. Use it with the pair type Rg.
    """

    kind = "barrel"
    radius: Annotated[float, POSITIVE("distance of the roller's center from the axis", LENGTH)]
    lift: Annotated[Any, SAMPLES("lifts along the axis", LENGTH, default="those of the law")] = None

    def _seen(self, u: Array) -> tuple[Array, Array, Array]:
        """``(radius, 0, lift)``."""
        h = _taylor(self.pieces.at(u))
        return _constant(self.radius, h), np.zeros_like(h), h

    def _way(self, u: Array) -> Array:
        """The axis."""
        return np.stack([np.zeros(u.shape), np.zeros(u.shape), np.ones(u.shape)])

    def _depth(self, u: Array) -> tuple[Array, Array, Array]:
        """Radial."""
        zero = np.zeros((ORDERS, *u.shape), dtype=u.dtype)
        return _constant(1.0, zero), zero, zero


@dataclass(frozen=True, kw_only=True, repr=False)
class Globoid(Groove, OfSwing):
    """The groove of a globoid cam that swings an arm, whose axis crosses that of the cam at right angles, by a law.

    The arm turns about axis x second through the point at ``distance`` from the axis along ``second``; at angle 0 of the law it points at
    the axis, a positive one leads along the axis. The roller's axis is that of the arm. Use it with the pair type Rg.
    """

    kind = "globoid"
    distance: Annotated[float, POSITIVE("distance of the axes of cam and arm", LENGTH)]
    arm: Annotated[float, POSITIVE("length of the arm, to the center of the roller", LENGTH)]
    swing: Annotated[Any, SAMPLES("angles of the arm", degrees=True, default="those of the law")] = None

    def _seen(self, u: Array) -> tuple[Array, Array, Array]:
        """``(distance - arm cos q, 0, arm sin q)``."""
        c, s = _turning(_taylor(self.pieces.at(u)))
        a = -self.arm * c
        a[0] += self.distance
        return a, np.zeros_like(a), self.arm * s

    def _way(self, u: Array) -> Array:
        """At right angles to the arm."""
        q = self.pieces.at(u, 1)[0]
        return np.stack([np.sin(q), 0.0 * q, np.cos(q)])

    def _depth(self, u: Array) -> tuple[Array, Array, Array]:
        """Along the arm, towards its axis."""
        c, s = _turning(_taylor(self.pieces.at(u)))
        return c, np.zeros_like(c), -s

    def faults(self, where: str) -> list[str]:
        """Arms that reach the axis of the cam."""
        found = super().faults(where)
        if not found and not (self.distance - self.arm * np.cos(self.pieces.at(self.nodes, 1)[0])).min() > 0:
            found.append(
                f"{where}arm = {self.arm:.6g}: reaches the axis of the cam; expected less than distance / cos(swing)"
            )
        return found


def largest(of: Callable[[Array], Array], breaks: Array) -> float:
    """The largest value of a function that is smooth between ``breaks``, to rounding, by finer and finer grids about the best place."""
    u = parted(breaks, 64)
    u = np.sort(np.concatenate([u, np.nextafter(breaks[1:], -np.inf)]))  # values before a break too
    for _ in range(10):
        values = of(u)
        i = int(np.argmax(values))
        u = np.append(np.linspace(u[max(i - 1, 0)], u[min(i + 1, len(u) - 1)], 33), u[i])
        u.sort()
    return float(of(u).max())


@door
def least_base_radius(
    law: CamLaw,
    follower: str = "roller",
    roller_radius: float = 0.0,
    offset: float = 0.0,
    max_pressure: float = math.pi / 6,
    least_radius: float = 0.0,
) -> float:
    """Compute the least base radius of a cam disc for a follower that slides.

    With the prime circle ``(r + roller_radius)^2 = d^2 + offset^2`` of a roller the pressure angle is ``tan a = |s' + offset| / (d + s)``,
    so that ``d >= |s' + offset| / tan a - s``; above this the radius of curvature decides. Of a flat face ``r >= least_radius - s - s''``.

    Parameters
    ----------
    law : CamLaw
        Law over 2 pi.
    follower : {"roller", "flat"}
        Follower that slides along a line.
    roller_radius : float
        Radius of the roller [length].
    offset : float
        Distance of the line of the follower from the axis, towards axis x second [length].
    max_pressure : float
        Largest pressure angle allowed [rad]. Default: 30 degrees.
    least_radius : float
        Least radius of curvature of the profile where it is convex [length].

    Returns
    -------
    float
        Radius of the base circle of the profile [length].

    Raises
    ------
    DeclarationError
        For values out of range.

    Examples
    --------
    >>> import mechgraph as mg
    >>> up, down = mg.Segment("cycloidal", 0.02, 2.0), mg.Segment("cycloidal", -0.02, 2.0)
    >>> law = mg.CamLaw([up, down, mg.Segment("dwell", over=6.283185307179586 - 4)])
    >>> round(mg.least_base_radius(law, follower="flat"), 6)
    0.013412
    """
    faults = [] if isinstance(law, CamLaw) else [wrong(law, "law", "an mg.CamLaw")]
    if follower not in ("roller", "flat"):
        faults.append(wrong(follower, "follower", "'roller' or 'flat'"))
    if not 0.0 < max_pressure < 0.5 * np.pi:
        faults.append(wrong(max_pressure, "max_pressure", "an angle between 0 and pi/2"))
    faults += [
        wrong(v, n, "0 or more")
        for n, v in (("roller_radius", roller_radius), ("least_radius", least_radius))
        if not v >= 0
    ]
    if faults:
        raise DeclarationError("least base radius", faults)
    breaks = law.pieces.breaks
    if follower == "flat":
        return max(0.0, largest(lambda u: least_radius - law.pieces.at(u)[0] - law.pieces.at(u)[2], breaks))
    slim = math.tan(max_pressure)
    d = largest(lambda u: np.abs(law.pieces.at(u)[1] + offset) / slim - law.pieces.at(u)[0], breaks)
    d = max(d, largest(lambda u: 1e-9 * abs(offset) - law.pieces.at(u)[0], breaks))

    def bends(d: float) -> bool:
        """Whether the profile is sharper than allowed anywhere."""

        def over(u: Array) -> Array:
            s, v, a, _ = law.pieces.at(u)
            x, y = d + s, v + offset
            return (x * x + y * y + y * v - x * a) / np.hypot(x, y) ** 3 * (least_radius + roller_radius)

        return largest(over, breaks) > 1.0

    if least_radius + roller_radius > 0 and bends(d):
        low, high = d, 2.0 * d + least_radius + roller_radius
        while bends(high):
            low, high = high, 2.0 * high
        for _ in range(50):  # halvings: to rounding
            middle = 0.5 * (low + high)
            low, high = (middle, high) if bends(middle) else (low, middle)
        d = high
    return math.hypot(d, offset) - roller_radius
