"""Curves of which a user gives the shape: points to pass, a function, the law of a cam's follower; and the table of all."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np
import scipy

from mechgraph.errors import DeclarationError, ShapeError
from mechgraph.fields import BREAKS, FLAG, FUNCTION, INTERVAL, NUMBER, POINT_LIST, POSITIVE, SAMPLES, TEXT
from mechgraph.maths.se3 import Array
from mechgraph.maths.tolerances import SHAPES
from mechgraph.pairs.curves import (
    INTERVALS,
    ORDERS,
    Centred,
    Circle,
    Curve,
    Ellipse,
    Helix,
    Involute,
    Line,
    Pieces,
    derivatives,
    parted,
)
from mechgraph.quantities import LENGTH, wrong

BESIDE = 0.5 * (3.0 - np.sqrt(5.0))
"""Where in an interval slopes are taken, a part of it that is no ratio of whole numbers, as places where a shape changes are."""


def asked(function: Callable[..., Any], at: Sequence[Array], least: int, most: int) -> Array:
    """Position and derivatives ``(most, 3, n)`` at parameters ``(n,)`` each; zeros for those that may be left out, beyond ``least``.

    Raises
    ------
    ShapeError
        where the function raises (its cause), or returns anything but ``least`` or more finite arrays ``(3, n)``.
    """
    if not at[0].size:  # as where all positions are interpolated beside a change point; what reduces nothing raises
        return np.zeros((most, 3, 0))
    found = _asked(function, at, least, most)
    if isinstance(found, np.ndarray):
        return found
    first = next((i for i in range(at[0].size) if not _fits(function, [u[i : i + 1] for u in at], least, most)), None)
    where = "; each of the values alone does" if first is None else f" at {_named([u[first] for u in at])}"
    text, cause = found
    raise ShapeError(f"position: {text}{where}") from cause


def _asked(
    function: Callable[..., Any], at: Sequence[Array], least: int, most: int
) -> Array | tuple[str, Exception | None]:
    """The arrays, or what is wrong with them and what was raised."""
    shape = (3, at[0].size)
    try:
        given = list(function(*at))[:most]
        parts = [np.asarray(part, dtype=float) for part in given]
    except Exception as error:
        return f"raised {type(error).__name__}: {error}", error
    wrong = next((part.shape for part in parts if part.shape not in (shape, (3, 1))), None)
    if wrong is not None or len(parts) < least:
        got = f"{len(parts)} arrays" if wrong is None else f"an array {wrong}"
        return f"returned {got}, expected {least} arrays (3, n), here {shape}", None
    out = np.zeros((most, *shape))
    for own, part in zip(out, parts, strict=False):
        own[:] = part
    return out if np.isfinite(out).all() else ("returned a number that is not finite", None)


def _fits(function: Callable[..., Any], at: Sequence[Array], least: int, most: int) -> bool:
    return isinstance(_asked(function, at, least, most), np.ndarray)


def _named(values: Sequence[float]) -> str:
    return ", ".join(f"{name} = {value:.6g}" for name, value in zip("uv", values, strict=False))


def inner(ends: tuple[float, float]) -> Array:
    """A few simple parameters in a range, at which a function is asked first."""
    return np.linspace(*ends, 7)[1:-1]


def between(grid: Array) -> Array:
    """Parameters ``(n,)`` in the intervals of a grid ``(n + 1,)`` at which slopes are taken."""
    return np.asarray(grid[:-1] + BESIDE * np.diff(grid))


def slope_faults(
    ask: Callable[..., Array],
    at: Sequence[Array],
    steps: Sequence[tuple[int, int, int]],
    words: Sequence[str],
    where: str,
    room: Array | float = np.inf,
) -> list[str]:
    """Derivatives that are not the slopes of what they belong to.

    ``at``: parameters ``(n,)`` each, as from ``between``; of ``steps`` each is a derivative, what it is derived from, and the parameter by
    which: numbers of what ``ask`` returns ``(orders, 3, n)``, called as in ``words``. Slopes are taken over shorter and shorter steps,
    none longer than the ``room``: that over one of them fits a true derivative, however fast it changes.
    """
    found, known = [], ask(*at)
    for high, low, by in steps:
        extent = float(np.ptp(at[by]))
        most = 1e-3 * np.abs(known[[low, high]]).max() / min(1.0, extent)
        miss = np.full(at[by].shape, np.inf)
        for part in (1e-4, 1e-5, 1e-6):
            h = np.minimum(part * extent, room)
            ahead, back = (ask(*(u + sign * h * (i == by) for i, u in enumerate(at)))[low] for sign in (1.0, -1.0))
            miss = np.minimum(miss, np.abs((ahead - back) / (2 * h) - known[high]).max(axis=0))
            if miss.max() <= most:
                break
        else:
            worst = int(np.argmax(miss))
            at_worst = _named([u[worst] for u in at])
            found.append(
                f"{where}position: {words[high]} differs from the slope of {words[low]} by {miss[worst]:.3g} at {at_worst}"
            )
    return found


@dataclass(frozen=True, kw_only=True, repr=False)
class OfLaw(Centred):
    """What cams by the law of their follower share: samples over one whole turn of the cam, a base circle, a roller.

    Between the samples the law is a polynomial of degree 5 that meets value and both derivatives.
    """

    law: ClassVar[str]
    """Field with the values of the law."""

    angle: Annotated[Any, SAMPLES("angles of the cam, 0 to 2 pi", degrees=True)]
    base_radius: Annotated[float, POSITIVE("radius of the base circle of the profile", LENGTH)]
    roller_radius: Annotated[float, NUMBER("radius of the roller", LENGTH, minimum=0.0)] = 0.0

    @classmethod
    def of(cls, motion: Any, base_radius: float, **more: Any) -> Self:
        """The cam of a ``Motion`` whose times are the angles of the cam, ``mg.Motion.law(..., t=angle)``."""
        if getattr(motion, "t", None) is None:
            wanted = "an mg.Motion with times, which are the angles, such as mg.Motion.law(..., t=angle)"
            raise DeclarationError("cam", [wrong(motion, "motion", wanted)])
        rates = {cls.law: motion.position, "slope": motion.velocity, "bend": motion.acceleration}
        return cls(angle=motion.t, base_radius=base_radius, **rates, **more)

    @cached_property
    def _law(self) -> Pieces:
        meets = [np.array(getattr(self, name)) for name in (self.law, "slope", "bend")]
        return Pieces.meeting(np.array(self.angle), meets, ORDERS)

    @property
    def is_closed(self) -> bool:
        """Yes."""
        return True

    @property
    def is_profile(self) -> bool:
        """Yes."""
        return True

    @property
    def roller(self) -> float:
        """As declared."""
        return self.roller_radius

    @property
    def nodes(self) -> Array:
        """Parts of the intervals between samples."""
        return parted(np.array(self.angle), -(-INTERVALS // (len(self.angle) - 1)))

    def _turned_back(self, u: Array, y: Array) -> Array:
        """``R(-u) y`` of components ``(4, 2, ...)`` in the plane."""
        c, s = np.cos(u), np.sin(u)
        out = np.zeros((ORDERS, 3, *u.shape), dtype=y.dtype)
        out[:, 0], out[:, 1] = c * y[:, 0] + s * y[:, 1], c * y[:, 1] - s * y[:, 0]
        return self._placed(out)

    def sample_faults(self, where: str, size: float) -> list[str]:
        """Samples that make no closed cam; ``size`` is a large value of the law."""
        names = ("angle", self.law, "slope", "bend")
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
        names = (self.law, "slope", "bend")
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


def _by_the_turn(a: Array, b: Array) -> Array:
    """``y_k`` with ``x^(k) = R(-u) y_k``, ``(4, 2, ...)``, from ``y = (a, b)`` and derivatives ``(4, ...)``: ``x' = R(-u) (y' - J y)``."""
    found = []
    for _ in range(ORDERS):
        found.append([a[0], b[0]])
        a, b = a[1:] + b[:-1], b[1:] - a[:-1]
    return np.array(found)


@dataclass(frozen=True, kw_only=True, repr=False)
class Cam(OfLaw):
    """The shape of a cam that lifts a follower by given amounts at given angles of the cam, over one whole turn.

    ``roller`` (a knife edge where ``roller_radius`` is zero): the path of the roller's center on the cam; the follower slides along
    ``second`` and passes the axis at the distance ``offset`` (towards axis x second). ``flat``: the profile, which touches a face at right
    angles to ``second``. The cam turns about its axis in the positive sense. Between the samples the lift is a polynomial of degree 5
    that meets lift and both derivatives. For a roller on an arm that swings take ``arm_cam``.
    """

    kind = "cam"
    law = "lift"
    lift: Annotated[Any, SAMPLES("lifts there", LENGTH)]
    slope: Annotated[Any, SAMPLES("their derivatives by the angle", LENGTH)]
    bend: Annotated[Any, SAMPLES("second derivatives", LENGTH)]
    offset: Annotated[float, NUMBER("distance of the line of the follower from the axis", LENGTH)] = 0.0
    follower: Annotated[str, TEXT("what it lifts", choices=("roller", "flat"))] = "roller"

    @cached_property
    def _beside_follower(self) -> Pieces:
        """Position and derivatives as the follower sees them: polynomials."""
        s = derivatives(self._law.coefficients[::-1], ORDERS + 1)
        flat = self.follower == "flat"
        a, b = s[:ORDERS].copy(), -s[1:] if flat else np.zeros_like(s[:ORDERS])
        a[0, 0] += self.base_radius if flat else np.sqrt((self.base_radius + self.roller_radius) ** 2 - self.offset**2)
        if not flat:
            b[0, 0] = self.offset
        return Pieces(np.array(self.angle), np.moveaxis(_by_the_turn(a, b), (0, 1), (2, 3))[::-1], orders=1)

    def at(self, u: Array) -> Array:
        """Roller: ``R(-u) ((d + lift) e1 + offset e2)``; flat: ``R(-u) ((r + lift) e1 - lift' e2)``."""
        return self._turned_back(u, self._beside_follower.at(u)[0])

    @property
    def roller(self) -> float:
        """As declared; a flat face has none."""
        return self.roller_radius if self.follower == "roller" else 0.0

    def faults(self, where: str) -> list[str]:
        """Samples that make no closed cam."""
        found = super().faults(where)
        if found:
            return found
        found = self.sample_faults(where, self.base_radius)
        if self.follower == "roller" and abs(self.offset) >= self.base_radius + self.roller_radius:
            found.append(f"{where}offset = {self.offset!r}: must be below base_radius + roller_radius")
        if self.follower == "flat" and self.offset:
            found.append(
                f"{where}offset = {self.offset!r}: does not change the shape for a flat follower; leave it out"
            )
        return found


@dataclass(frozen=True, kw_only=True, repr=False)
class ArmCam(OfLaw):
    """The shape of a cam that swings an arm with a roller by given angles at given angles of the cam, over one whole turn.

    It is the path of the roller's center on the cam. The arm turns about a pivot, which stands at the distance ``pivot`` from the axis
    along ``second``; where the swing is zero the center of the roller is ``base_radius + roller_radius`` from the axis, on the side of axis
    x second of the line to the pivot (``mirrored``: on the other). Swings lead away from the cam. The cam turns about its axis in the
    positive sense.
    """

    kind = "arm_cam"
    law = "swing"
    swing: Annotated[Any, SAMPLES("angles of the arm there, away from the cam", degrees=True)]
    slope: Annotated[Any, SAMPLES("their derivatives by the angle of the cam")]
    bend: Annotated[Any, SAMPLES("second derivatives")]
    arm: Annotated[float, POSITIVE("length of the arm, from the pivot to the center of the roller", LENGTH)]
    pivot: Annotated[float, POSITIVE("distance of the pivot from the axis", LENGTH)]
    mirrored: Annotated[
        bool, FLAG("whether the roller is on the other side of the line from the axis to the pivot")
    ] = False

    @property
    def _cosine(self) -> float:
        """Of the angle at the pivot between the arm at no swing and the line to the axis."""
        c, arm = self.pivot, self.arm
        return (c * c + arm * arm - (self.base_radius + self.roller_radius) ** 2) / (2 * c * arm)

    def at(self, u: Array) -> Array:
        """``R(-u) (pivot e1 + arm (-cos p e1 + sin p e2))`` with the angle p at the pivot, ``p = p_0 + swing``."""
        p, d1, d2, d3 = self._law.at(u)
        p = p + np.arccos(self._cosine)
        c, s = np.cos(p), np.sin(p)
        cosine = [c, -s * d1, -c * d1**2 - s * d2, s * d1**3 - 3 * c * d1 * d2 - s * d3]
        sine = [s, c * d1, c * d2 - s * d1**2, c * d3 - 3 * s * d1 * d2 - c * d1**3]
        a, b = -self.arm * np.array(cosine), (-self.arm if self.mirrored else self.arm) * np.array(sine)
        a[0] += self.pivot
        return self._turned_back(u, _by_the_turn(a, b))

    def faults(self, where: str) -> list[str]:
        """Samples that make no closed cam, lengths that make no triangle, swings past the line through axis and pivot."""
        found = super().faults(where)
        if found:
            return found
        far = self.base_radius + self.roller_radius
        if not abs(self._cosine) < 1:
            low, high = abs(self.pivot - far), self.pivot + far
            return [
                f"{where}arm = {self.arm:.6g}: does not reach the base circle; give one between {low:.6g} and {high:.6g}"
            ]
        found = self.sample_faults(where, 1.0)
        p = np.arccos(self._cosine) + np.asarray(self.swing)
        if not found and not (p.min() > 0 and p.max() < np.pi):
            found.append(
                f"{where}swing: runs from {np.min(self.swing):.6g} to {np.max(self.swing):.6g}; the arm would pass the line through axis "
                f"and pivot at {-np.arccos(self._cosine):.6g} or {np.pi - np.arccos(self._cosine):.6g}"
            )
        return found


@dataclass(frozen=True, kw_only=True, repr=False)
class Through(Curve):
    """The curve through points: a spline of degree 5 (3 through fewer than six points) over the lengths of the chords."""

    kind = "points"
    points: Annotated[Any, POINT_LIST("points passed, in order", LENGTH)]
    closed: Annotated[
        bool, FLAG("whether it returns to the first point, with the direction and curvature that it has there")
    ] = False

    @cached_property
    def _spline(self) -> Pieces:
        given = np.array(self.points)
        if self.closed and np.linalg.norm(given[-1] - given[0]) > SHAPES.even * np.ptp(given, axis=0).max():
            given = np.concatenate([given, given[:1]])
        elif self.closed:
            given[-1] = given[0]
        lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(given, axis=0), axis=1))])
        degree = 5 if len(given) > 5 else 3
        ends: Any = "periodic" if self.closed else None
        made: Any = scipy.interpolate.make_interp_spline(lengths, given, degree, bc_type=ends)
        breaks = np.unique(np.clip(made.t, lengths[0], lengths[-1]))
        terms = [made.derivative(k)(breaks[:-1]) / math.factorial(k) for k in range(degree, 0, -1)]
        return Pieces(breaks, np.stack([*terms, made(breaks[:-1])]), ORDERS)

    def at(self, u: Array) -> Array:
        """The spline."""
        return self._spline.at(u)

    @property
    def ends(self) -> tuple[float, float]:
        """Zero, and the length of all chords."""
        return float(self._spline.breaks[0]), float(self._spline.breaks[-1])

    @property
    def is_closed(self) -> bool:
        """As declared."""
        return self.closed

    @property
    def nodes(self) -> Array:
        """Parts of the pieces of the spline."""
        return parted(self._spline.breaks, max(8, 400 // len(self._spline.breaks)))

    def faults(self, where: str) -> list[str]:
        """Points that make no curve."""
        found = super().faults(where)
        if found:
            return found
        gaps = np.linalg.norm(np.diff(np.array(self.points), axis=0), axis=1)
        if len(self.points) < 4:
            return [f"{where}points: {len(self.points)} given; a curve with a continuous curvature takes 4 or more"]
        same = np.flatnonzero(gaps <= 1e-12 * gaps.max())
        return [f"{where}points: points {i} and {i + 1} are the same; leave one out" for i in same.tolist()]


@dataclass(frozen=True, kw_only=True, repr=False)
class Function(Curve):
    """A curve ``x(u)`` by a function: position and first three derivatives (four, to be exact) at ``u (n,)``, ``(3, n)`` each.

    Where it is in pieces, ``breaks`` names the parameters between them, at which a derivative jumps.
    """

    kind = "function"
    position: Annotated[Any, FUNCTION("u -> (x, x', x'', x'''), each (3, n)")]
    ends_at: Annotated[Any, INTERVAL("least and greatest u")]
    closed: Annotated[bool, FLAG("whether it returns to where it begins")] = False
    breaks: Annotated[Any, BREAKS("parameters between its pieces", default="none")] = ()

    @property
    def nodes(self) -> Array:
        """Parts of its pieces."""
        begin, end = self.ends
        pieces = np.array([begin, *np.atleast_1d(self.breaks), end])
        parts = np.ceil(INTERVALS * np.diff(pieces) / (end - begin)).astype(int) + 1
        return np.unique(np.concatenate([*map(np.linspace, pieces[:-1], pieces[1:], parts)]))

    def at(self, u: Array) -> Array:
        """What the function returns; beyond the ends, and for complex ``u``, by Taylor's series."""
        inside = np.clip(u.real, *self.ends)
        known = asked(self.position, [inside.ravel()], ORDERS, ORDERS + 1).reshape(ORDERS + 1, 3, *u.shape)
        beyond = u - inside
        if not np.any(beyond):
            return known[:-1]
        out = known[:-1] + beyond * known[1:]
        for order in range(2, ORDERS + 1):
            out[: ORDERS + 1 - order] += beyond**order / math.factorial(order) * known[order:]
        return np.asarray(out)

    @cached_property
    def orders(self) -> int:
        """As many as it returns."""
        return len(list(self.position(np.array([self.ends[0]]))))

    @property
    def ends(self) -> tuple[float, float]:
        """As declared."""
        begin, end = self.ends_at
        return begin, end

    @property
    def is_closed(self) -> bool:
        """As declared."""
        return self.closed

    def faults(self, where: str) -> list[str]:
        """A function that does not do, or whose derivatives are not those of its positions."""
        found = super().faults(where)
        if found:
            return found
        within = [self.ends[0], *np.atleast_1d(self.breaks), self.ends[1]]
        if not (np.diff(within) > 0).all():
            return [wrong(self.breaks, f"{where}breaks", f"rising numbers between {within[0]:g} and {within[-1]:g}")]
        self.at(inner(self.ends))
        steps = [(order + 1, order, 0) for order in range(ORDERS - 1)]
        words = ("position", "derivative 1", "derivative 2", "derivative 3")
        return slope_faults(self.at, [between(self.grid)], steps, words, where, BESIDE * np.diff(self.grid))


CURVES: dict[str, type[Curve]] = {
    kind.kind: kind for kind in (Line, Circle, Ellipse, Helix, Involute, Through, Function, Cam, ArmCam)
}
"""Curves by the names that they have in files."""
Curve.line, Curve.circle, Curve.ellipse, Curve.helix = Line, Circle, Ellipse, Helix
Curve.involute, Curve.through, Curve.function = Involute, Through, Function
Curve.cam, Curve.arm_cam = Cam, ArmCam
