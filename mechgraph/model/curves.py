"""Curves along which a marker travels: by name, through points, by a function with its derivatives, or the shape of a cam.

    x(u), u in (begin, end): position in the frame of the link that bears the curve, with three derivatives by the parameter u.

Arc length, direction and frame are found from these (``travel``). Arguments may be complex, as in all kernels.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.errors import DeclarationError
from mechgraph.model.field_format import (
    DIRECTION,
    FLAG,
    FUNCTION,
    INTERVAL,
    NUMBER,
    POINT,
    POINT_LIST,
    POSITIVE,
    SAMPLES,
    TEXT,
    Described,
)
from mechgraph.model.numeric import second_direction
from mechgraph.model.once import Once
from mechgraph.quantities import wrong
from mechgraph.units import LENGTH

ORDERS = 4
"""Position and derivatives that a curve gives: to the third."""
CLOSED_GAP = 1e-9
"""Gap over its extent up to which a curve is closed."""
WHOLE_TURN = 2.0 * np.pi
FRAMES = ("minimizing", "guided")


@dataclass(frozen=True, kw_only=True, repr=False)
class Curve(Described, Once):
    """A curve in the frame of a link; ``Curve.circle(...)`` and so on make one.

    Its frame has the tangent as one direction. ``minimizing`` turns as little as possible about it (a plane curve keeps its normal);
    ``guided`` holds the direction ``guide`` in the plane of tangent and third direction, the axis of the curve where left out.
    """

    kind: ClassVar[str]
    line: ClassVar[Any]
    circle: ClassVar[Any]
    ellipse: ClassVar[Any]
    helix: ClassVar[Any]
    involute: ClassVar[Any]
    through: ClassVar[Any]
    function: ClassVar[Any]
    cam: ClassVar[Any]

    frame: Annotated[str, TEXT("how the frame turns about the tangent", choices=FRAMES)] = "minimizing"
    guide: Annotated[
        Any, DIRECTION("direction near which a guided frame keeps its third axis", default="that of the curve")
    ] = None

    def __post_init__(self) -> None:
        self.read_numbers()

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        """What is declared alone: all else is found again."""
        return remade_from(self)

    @abstractmethod
    def at(self, u: Array) -> Array:
        """Position and three derivatives by ``u (...)``, ``(4, 3, ...)``."""

    @property
    def ends(self) -> tuple[float, float]:
        """Least and greatest parameter; infinite where the curve does not end."""
        return 0.0, WHOLE_TURN

    @property
    def is_closed(self) -> bool:
        """Whether the curve returns into itself, so that a marker may go round."""
        return False

    @property
    def speed(self) -> float | None:
        """``|x'|`` where it is the same everywhere."""
        return None

    @property
    def normal(self) -> Array | None:
        """Axis of the curve ``(3,)``, or None: found from its shape then."""
        return None

    @cached_property
    def breaks(self) -> Array:
        """Parameters between which the curve is smooth, fine enough for its shape; a few of an endless one."""
        begin, end = self.ends
        return np.linspace(*((begin, end) if np.isfinite(begin) else (-WHOLE_TURN, WHOLE_TURN)), 361)

    @property
    def orders(self) -> int:
        """How many of position and derivatives are known, that of complex arguments counted."""
        return ORDERS + 1

    @property
    def roller(self) -> float:
        """Radius of the roller whose centre the curve is the path of, on the outside of the shape."""
        return 0.0

    def faults(self, where: str) -> list[str]:
        """What is wrong with what is declared, one line each."""
        return self.value_faults(where)


def remade_from(shape: Any) -> tuple[Any, tuple[Any, ...]]:
    """How a shape is copied and pickled: from its fields alone."""
    return _remade, (type(shape), {f.name: getattr(shape, f.name) for f in fields(shape)})


def _remade(kind: Callable[..., Any], values: dict[str, Any]) -> Any:
    return kind(**values)


def _unit(v: Any) -> Array:
    return np.asarray(v, dtype=float) / np.linalg.norm(v)


@dataclass(frozen=True, kw_only=True, repr=False)
class Line(Curve):
    """A straight line."""

    kind = "line"
    point: Annotated[Any, POINT("where the arc length is zero", LENGTH, default="0")] = (0.0, 0.0, 0.0)
    direction: Annotated[Any, DIRECTION("along the line", default="z")] = (0.0, 0.0, 1.0)
    ends_at: Annotated[Any, INTERVAL("arc lengths at which it ends", LENGTH, default="endless")] = None

    def at(self, u: Array) -> Array:
        """``point + u direction``."""
        out = np.zeros((ORDERS, 3, *u.shape), dtype=u.dtype)
        d = _unit(self.direction).reshape(3, *(1,) * u.ndim)
        out[0] = np.asarray(self.point).reshape(d.shape) + u * d
        out[1] = d
        return out

    @property
    def ends(self) -> tuple[float, float]:
        """As declared."""
        return self.ends_at or (-np.inf, np.inf)

    @property
    def speed(self) -> float:
        """One."""
        return 1.0


@dataclass(frozen=True, kw_only=True, repr=False)
class Centred(Curve):
    """What curves about a centre share: ``x = center + f e1 + g e2 + h e3``, e3 the axis and e1 along ``second``."""

    center: Annotated[Any, POINT("centre", LENGTH, default="0")] = (0.0, 0.0, 0.0)
    axis: Annotated[Any, DIRECTION("normal of the plane, or axis", default="z")] = (0.0, 0.0, 1.0)
    second: Annotated[
        Any, DIRECTION("where the parameter is zero", default="global axis least aligned with `axis`")
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.second is None and np.shape(self.axis) == (3,):
            object.__setattr__(self, "second", second_direction(self.axis))

    @property
    def normal(self) -> Array:
        """The axis."""
        return _unit(self.axis)

    @cached_property
    def _basis(self) -> Array:
        z = _unit(self.axis)
        x = _unit(np.asarray(self.second) - (z @ np.asarray(self.second)) * z)
        return np.column_stack([x, np.cross(z, x), z])

    def _placed(self, parts: Array) -> Array:
        """Position and derivatives ``(4, 3, ...)`` from those in the own axes."""
        out = np.asarray(np.einsum("ij,kj...->ki...", self._basis, parts))
        out[0] += np.asarray(self.center).reshape(3, *(1,) * (parts.ndim - 2))
        return out


def _turning(u: Array) -> tuple[Array, Array]:
    """Cosine and sine with three derivatives, ``(4, ...)`` each."""
    c, s = np.cos(u), np.sin(u)
    return np.array([c, -s, -c, s]), np.array([s, c, -s, -c])


@dataclass(frozen=True, kw_only=True, repr=False)
class Circle(Centred):
    """A circle, or an arc of it."""

    kind = "circle"
    radius: Annotated[float, POSITIVE("radius", LENGTH)]
    angles: Annotated[Any, INTERVAL("angles at which an arc ends", degrees=True, default="all round")] = None

    def at(self, u: Array) -> Array:
        """``radius (cos u e1 + sin u e2)``."""
        c, s = _turning(u)
        return self._placed(self.radius * np.stack([c, s, 0 * c], axis=1))

    @property
    def ends(self) -> tuple[float, float]:
        """A turn, or as declared."""
        return self.angles or (0.0, WHOLE_TURN)

    @property
    def is_closed(self) -> bool:
        """Unless it is an arc."""
        return self.angles is None

    @property
    def speed(self) -> float:
        """The radius."""
        return self.radius


@dataclass(frozen=True, kw_only=True, repr=False)
class Ellipse(Centred):
    """An ellipse."""

    kind = "ellipse"
    a: Annotated[float, POSITIVE("half axis along `second`", LENGTH)]
    b: Annotated[float, POSITIVE("half axis across it", LENGTH)]

    def at(self, u: Array) -> Array:
        """``a cos u e1 + b sin u e2``."""
        c, s = _turning(u)
        return self._placed(np.stack([self.a * c, self.b * s, 0 * c], axis=1))

    @property
    def is_closed(self) -> bool:
        """Yes."""
        return True


@dataclass(frozen=True, kw_only=True, repr=False)
class Helix(Centred):
    """A helix about an axis; endless unless its angles are given."""

    kind = "helix"
    radius: Annotated[float, POSITIVE("radius", LENGTH)]
    pitch: Annotated[float, NUMBER("advance per radian, right-hand positive", LENGTH)]
    angles: Annotated[Any, INTERVAL("angles at which it ends", degrees=True, default="endless")] = None

    def at(self, u: Array) -> Array:
        """``radius (cos u e1 + sin u e2) + pitch u e3``."""
        c, s = _turning(u)
        h = np.zeros_like(c)
        h[0], h[1] = self.pitch * u, self.pitch
        return self._placed(np.stack([self.radius * c, self.radius * s, h], axis=1))

    @property
    def ends(self) -> tuple[float, float]:
        """As declared."""
        return self.angles or (-np.inf, np.inf)

    @property
    def speed(self) -> float:
        """``sqrt(radius^2 + pitch^2)``."""
        return float(np.hypot(self.radius, self.pitch))

    def faults(self, where: str) -> list[str]:
        """An endless one that does not advance: it would come back to where it was."""
        found = super().faults(where)
        round_ = not found and self.pitch == 0 and self.angles is None
        return [f"{where}pitch = 0: an endless helix advances; take Curve.circle"] if round_ else found


@dataclass(frozen=True, kw_only=True, repr=False)
class Involute(Centred):
    """The involute of a circle: a tooth flank. It leaves the base circle at ``second``, where it has a cusp, so it begins behind that."""

    kind = "involute"
    radius: Annotated[float, POSITIVE("radius of the base circle", LENGTH)]
    angles: Annotated[Any, INTERVAL("roll angles between which it is used, above 0", degrees=True)]
    mirrored: Annotated[bool, FLAG("whether it winds the other way, clockwise about the axis")] = False

    def at(self, u: Array) -> Array:
        """``radius ((cos u + u sin u) e1 + (sin u - u cos u) e2)``."""
        c, s = np.cos(u), np.sin(u)
        f = [c + u * s, u * c, c - u * s, -2 * s - u * c]
        g = [s - u * c, u * s, s + u * c, 2 * c - u * s]
        hand = -1.0 if self.mirrored else 1.0
        return self._placed(
            self.radius * np.stack([[*f], [hand * part for part in g], [0 * part for part in f]], axis=1)
        )

    @property
    def ends(self) -> tuple[float, float]:
        """As declared."""
        begin, end = self.angles
        return begin, end

    def faults(self, where: str) -> list[str]:
        """Sizes that cannot be."""
        found = super().faults(where)
        if not found and not self.angles[0] > 0:
            found.append(f"{where}angles = {self.angles}: the involute has a cusp at angle 0; begin above it")
        return found


# --- curves in pieces ------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Pieces:
    """Polynomials ``(degree + 1, pieces, ...)``, highest power first, between ``breaks``: evaluated for complex arguments too."""

    breaks: Array
    coefficients: Array

    @cached_property
    def _terms(self) -> Array:
        """Coefficients of value and derivatives, ``(pieces, orders, components, degree + 1)``, lowest power first."""
        c = self.coefficients[::-1].reshape(len(self.coefficients), len(self.breaks) - 1, -1)
        out = np.zeros((ORDERS + 1, *c.shape))
        for order in range(ORDERS + 1):
            for power in range(order, len(c)):
                out[order, power - order] = math.perm(power, order) * c[power]
        return np.ascontiguousarray(out.transpose(2, 0, 3, 1))

    def at(self, u: Array, orders: int) -> Array:
        """Values and derivatives ``(orders, ..., *u.shape)``; of the first and last piece beyond the ends."""
        flat = u.reshape(-1)
        piece = self.breaks[1:-1].searchsorted(flat.real, side="right")
        terms = self._terms[:, :orders].take(piece, axis=0)
        powers = np.empty((flat.size, 1, terms.shape[3], 1), dtype=u.dtype)
        powers[:, 0, 0, 0] = 1.0
        beyond = np.broadcast_to((flat - self.breaks[piece])[:, None], (flat.size, terms.shape[3] - 1))
        np.multiply.accumulate(beyond, axis=1, out=powers[:, 0, 1:, 0])
        out = (terms @ powers)[..., 0].transpose(1, 2, 0)
        return np.asarray(out.reshape(orders, *self.coefficients.shape[2:], *u.shape))

    @classmethod
    def meeting(cls, breaks: Array, values: Sequence[Array]) -> Pieces:
        """The polynomials that meet values and derivatives ``(n, ...)`` at the breaks (Hermite)."""
        made = scipy.interpolate.BPoly.from_derivatives(breaks, np.stack(values, axis=1))
        return cls(np.asarray(breaks), scipy.interpolate.PPoly.from_bernstein_basis(made).c)


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
        if self.closed and np.linalg.norm(given[-1] - given[0]) > CLOSED_GAP * np.ptp(given, axis=0).max():
            given = np.concatenate([given, given[:1]])
        elif self.closed:
            given[-1] = given[0]
        lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(given, axis=0), axis=1))])
        degree = 5 if len(given) > 5 else 3
        ends: Any = "periodic" if self.closed else None
        made: Any = scipy.interpolate.make_interp_spline(lengths, given, degree, bc_type=ends)
        breaks = np.unique(np.clip(made.t, lengths[0], lengths[-1]))
        terms = [made.derivative(k)(breaks[:-1]) / math.factorial(k) for k in range(degree, 0, -1)]
        return Pieces(breaks, np.stack([*terms, made(breaks[:-1])]))

    def at(self, u: Array) -> Array:
        """The spline."""
        return self._spline.at(u, ORDERS)

    @property
    def ends(self) -> tuple[float, float]:
        """Zero, and the length of all chords."""
        return float(self._spline.breaks[0]), float(self._spline.breaks[-1])

    @property
    def is_closed(self) -> bool:
        """As declared."""
        return self.closed

    @cached_property
    def breaks(self) -> Array:
        """Parts of the pieces of the spline."""
        return _parted(self._spline.breaks, max(8, 400 // len(self._spline.breaks)))

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


def _parted(breaks: Array, parts: int) -> Array:
    """Every interval in equal parts."""
    fine = breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(parts) / parts
    return np.append(fine.ravel(), breaks[-1])


@dataclass(frozen=True, kw_only=True, repr=False)
class Function(Curve):
    """A curve ``x(u)`` by a function: position and first three derivatives (four, to be exact) at ``u (n,)``, ``(3, n)`` each."""

    kind = "function"
    position: Annotated[Any, FUNCTION("u -> (x, x', x'', x'''), each (3, n)")]
    ends_at: Annotated[Any, INTERVAL("least and greatest u")]
    closed: Annotated[bool, FLAG("whether it returns to where it begins")] = False

    def at(self, u: Array) -> Array:
        """What the function returns; for complex ``u`` by Taylor's series about its real part."""
        real = np.asarray(u.real, dtype=float).ravel()
        known = np.zeros((ORDERS + 1, 3, real.size))
        for order, part in enumerate(self.position(real)[: ORDERS + 1]):
            known[order] = part
        known = known.reshape(ORDERS + 1, 3, *u.shape)
        return known[:-1] + 1j * u.imag * known[1:] if np.iscomplexobj(u) else known[:-1]

    @cached_property
    def orders(self) -> int:
        """As many as it returns."""
        return len(self.position(np.array([self.ends[0]])))

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
        u = np.linspace(*self.ends, 7)
        try:
            x = self.at(u)
        except (TypeError, ValueError, IndexError) as error:
            return [f"{where}position: does not take u (n,) and return (3, n) arrays: {error}"]
        if len(self.position(u)) < 4 or not np.isfinite(x).all():
            return [f"{where}position: must return finite position and three derivatives, each (3, n)"]
        h = 1e-4 * (u[-1] - u[0])
        for order in range(3):
            slope = (self.at(u[1:-1] + h)[order] - self.at(u[1:-1] - h)[order]) / (2 * h)
            miss, size = np.abs(slope - x[order + 1][:, 1:-1]).max(), np.abs(x[order : order + 2]).max()
            if miss > 1e-3 * size / min(1.0, u[-1] - u[0]):
                found.append(
                    f"{where}position: derivative {order + 1} differs from the slope of what is before it by {miss:.3g}"
                )
        return found


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
    def _lift(self) -> Pieces:
        return Pieces.meeting(np.array(self.angle), [np.array(self.lift), np.array(self.slope), np.array(self.bend)])

    def at(self, u: Array) -> Array:
        """Roller: ``R(-u) ((d + lift) e1 + offset e2)``; flat: ``R(-u) ((r + lift) e1 - lift' e2)``."""
        s = self._lift.at(u, ORDERS + 1)
        flat = self.follower == "flat"
        far = self.base_radius if flat else np.sqrt((self.base_radius + self.roller_radius) ** 2 - self.offset**2)
        a, b = s[:ORDERS].copy(), -s[1:] if flat else np.zeros_like(s[:ORDERS])
        a[0] += far
        if not flat:
            b[0] = self.offset
        c, sine = np.cos(u), np.sin(u)
        out = np.zeros((ORDERS, 3, *u.shape), dtype=s.dtype)
        for k in range(ORDERS):  # seen from the cam: x = R(-u) y, x' = R(-u) (y' - J y)
            out[k, 0], out[k, 1] = c * a[0] + sine * b[0], c * b[0] - sine * a[0]
            a, b = a[1:] + b[:-1], b[1:] - a[:-1]
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
        return _parted(np.array(self.angle), max(2, 360 // len(self.angle)))

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


CURVES: dict[str, type[Curve]] = {
    kind.kind: kind for kind in (Line, Circle, Ellipse, Helix, Involute, Through, Function, Cam)
}
"""Curves by the names that they have in files."""
Curve.line, Curve.circle, Curve.ellipse, Curve.helix = Line, Circle, Ellipse, Helix
Curve.involute, Curve.through, Curve.function, Curve.cam = Involute, Through, Function, Cam
