"""Curves along which a marker travels: what they share, and those with a name.

    x(u), u in (begin, end): position in the frame of the link that bears the curve, with three derivatives by the parameter u.

Arc length, direction and frame are found from these (``arc_length``). Arguments may be complex, as in all kernels.

A curve by its arc length: the parameter there, tangent, curvature, and the frame that travels along it.

With arc length s, tangent t = dx/ds and the third axis k of the frame (y = k x t), the frame turns by

    w = t x t' + r t,     r = 0 (minimizing),   r = (d . t) (t' . y) / |d - (d . t) t| (guided by d),

a prime for d/ds. Source: Bishop, There is more than one way to frame a curve, Amer. Math. Monthly 82, 1975 (minimizing frames).
Parameter and turn of a minimizing frame are integrals, kept as polynomials (Hermite) between points that are close enough.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import scipy

from mechgraph import methods
from mechgraph.errors import DeclarationError
from mechgraph.fields import (
    DIRECTION,
    FLAG,
    INTERVAL,
    NUMBER,
    POINT,
    POSITIVE,
    TEXT,
    Described,
    across,
    axes_of,
    cosine,
    remade,
    second_direction,
)
from mechgraph.maths.se3 import Array, cross
from mechgraph.maths.tolerances import COMPLEX_STEP, SHAPES
from mechgraph.memo import Once, dataclass
from mechgraph.quantities import LENGTH, door, shown


@dataclass(frozen=True)
class Pieces:
    """Polynomials ``(degree + 1, pieces, ...)``, highest power first, between ``breaks``: evaluated for complex arguments too.

    ``orders``: of how many, the value and its derivatives, the coefficients are kept.
    """

    breaks: Array
    coefficients: Array
    orders: int

    @cached_property
    def _terms(self) -> Array:
        """Coefficients of value and derivatives, ``(pieces, orders, components, degree + 1)``, lowest power first."""
        c = self.coefficients[::-1].reshape(len(self.coefficients), len(self.breaks) - 1, -1)
        return np.ascontiguousarray(derivatives(c, self.orders).transpose(2, 0, 3, 1))

    def at(self, u: Array) -> Array:
        """Values and derivatives ``(orders, ..., *u.shape)``; of the first and last piece beyond the ends."""
        flat = u.reshape(-1)
        piece = self.breaks[1:-1].searchsorted(flat.real, side="right")
        terms = self._terms.take(piece, axis=0)
        powers = np.empty((flat.size, terms.shape[3]), dtype=u.dtype)
        powers[:, 0] = 1.0
        powers[:, 1:] = (flat - self.breaks[piece])[:, None]
        np.multiply.accumulate(powers, axis=1, out=powers)
        out = (terms @ powers[:, None, :, None])[..., 0].transpose(1, 2, 0)
        return np.asarray(out.reshape(self.orders, *self.coefficients.shape[2:], *u.shape))

    @classmethod
    def meeting(cls, breaks: Array, values: Sequence[Array], orders: int) -> Pieces:
        """The polynomials that meet values and derivatives ``(n, ...)`` at the breaks."""
        ends = [y[:-1] for y in values], [y[1:] for y in values]
        return cls(np.asarray(breaks), hermite(np.diff(breaks), *ends)[::-1], orders)


def derivatives(c: Array, orders: int) -> Array:
    """Coefficients of polynomials ``c (degree + 1, ...)``, lowest power first, and of their derivatives, ``(orders, degree + 1, ...)``."""
    out = np.zeros((orders, *c.shape))
    for order in range(orders):
        for power in range(order, len(c)):
            out[order, power - order] = math.perm(power, order) * c[power]
    return out


def hermite(length: Array, begin: Sequence[Array], end: Sequence[Array]) -> Array:
    """The polynomials over ``(0, length (n,))`` that meet ``k`` values and derivatives ``(n, ...)`` at both ends, ``(2 k, n, ...)``.

    Coefficients, lowest power first: the lower half is Taylor's series at the beginning, the upper half follows from the end.
    """
    k, h = len(begin), length.reshape(-1, *(1,) * (begin[0].ndim - 1))
    low, there = (np.stack([h**j / math.factorial(j) * y for j, y in enumerate(values)]) for values in (begin, end))
    choose = np.array([[math.comb(m, j) for m in range(2 * k)] for j in range(k)], dtype=float)
    high = np.tensordot(np.linalg.inv(choose[:, k:]), there - np.tensordot(choose[:, :k], low, 1), 1)
    return np.concatenate([low, high]) / np.stack([h**m for m in range(2 * k)])


def parted(breaks: Array, parts: int) -> Array:
    """Every interval in equal parts."""
    fine = breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(parts) / parts
    return np.append(fine.ravel(), breaks[-1])


ORDERS = 4
"""Position and derivatives that a curve gives: to the third."""
INTERVALS = 360
"""Intervals into which a curve is parted before its shape is known."""
FRAMES = ("minimizing", "guided", "held")
ORIGIN = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True, repr=False)
class Curve(Described, Once):
    """Base of the curves in the frame of a link; make one by ``Curve.circle(...)`` and so on.

    ``line``, ``circle``, ``ellipse``, ``helix``, ``involute``, ``cam``, ``arm_cam``, ``barrel``, ``globoid``, ``through`` (points) and
    ``function`` make curves. The moving frame has the tangent as one direction. ``"minimizing"`` rotates as little as possible about it
    (a plane curve keeps its normal); ``"guided"`` keeps the direction ``guide`` in the plane of tangent and third direction;
    ``"held"`` does not rotate (P and C): a body on a circle is then translated, as the coupler of a parallelogram.

    Examples
    --------
    >>> import mechgraph as mg
    >>> slot = mg.Curve.circle(center=(0, 0, 0), radius=0.2, axis=(0, 0, 1))
    >>> bead = mg.Mechanism(
    ...     "bead", pairs=[mg.Pair("K", "P", "frame", "bead", point=(0.2, 0, 0), curve=slot)], drives=["K"]
    ... )
    >>> s = mg.kinematics(bead, {"K": mg.Motion(0.0, velocity=3.0)})
    >>> float(abs(s.link("bead").angular_velocity[2]).round(6))
    15.0
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
    arm_cam: ClassVar[Any]
    barrel: ClassVar[Any]
    globoid: ClassVar[Any]

    whole: ClassVar[tuple[float, float]] = (0.0, math.tau)
    """Where it ends if nothing is said."""
    frame: Annotated[str, TEXT("how the frame turns about the tangent", choices=FRAMES)] = "minimizing"
    guide: Annotated[
        Any, DIRECTION("direction near which a guided frame keeps its third axis", default="that of the curve")
    ] = None

    __reduce__ = remade

    @abstractmethod
    def at(self, u: Array) -> Array:
        """Position and three derivatives by ``u (...)``, ``(4, 3, ...)``."""

    @property
    def ends(self) -> tuple[float, float]:
        """Least and greatest parameter; infinite where the curve does not end."""
        begin, end = getattr(self, "ends_at", None) or getattr(self, "angles", None) or self.whole
        return begin, end

    @property
    def is_closed(self) -> bool:
        """Whether the curve returns into itself, so that a marker may go round."""
        return bool(getattr(self, "closed", False))

    @property
    def length(self) -> float:
        """Arc length [L] from end to end, of one round where the curve is closed; infinite where it does not end."""
        return float(self.once(Travel).length) if np.isfinite(self.ends[0]) else math.inf

    @property
    def speed(self) -> float | None:
        """``|x'|`` where it is the same everywhere."""
        return None

    @property
    def normal(self) -> Array | None:
        """Axis of the curve ``(3,)``, or None: found from its shape then."""
        return None

    @property
    def nodes(self) -> Array:
        """Parameters between which the curve is smooth; a few of an endless one."""
        begin, end = self.ends
        return np.linspace(*((begin, end) if np.isfinite(begin) else (-math.tau, math.tau)), INTERVALS + 1)

    @cached_property
    def grid(self) -> Array:
        """The same, fine enough for its shape: intervals halved, up to eight times, in which the tangent turns by more than 0.5."""
        u = self.nodes
        for _ in range(8):
            _, x1, x2, _ = self.at(u)
            square = (x1 * x1).sum(axis=0)
            turning = np.sqrt(np.maximum(square * (x2 * x2).sum(axis=0) - (x1 * x2).sum(axis=0) ** 2, 0.0))
            wide = np.maximum(turning[:-1], turning[1:]) * np.diff(u) > 0.5 * np.minimum(square[:-1], square[1:])
            if not wide.any():
                break
            u = np.insert(u, np.flatnonzero(wide) + 1, (0.5 * (u[:-1] + u[1:]))[wide])
        return u

    @property
    def orders(self) -> int:
        """How many of position and derivatives are known, that of complex arguments counted."""
        return ORDERS + 1

    def place_at(self, u: Array) -> Any:
        """The place with its frame, where that is known by other means than derivatives; else None."""
        return None

    def depth(self, u: Array) -> Array | None:
        """The third axis of the frame and its derivatives ``(4, 3, ...)``, at right angles to the tangent, where the curve says it."""
        return None

    def beside(self, distance: float, y: Array) -> Curve | None:
        """The curve at a distance towards the normal, which is ``y (3,)`` where it begins, where that is a curve with a name too."""
        return None

    def sound(self, what: str) -> None:
        """Refuse to do something with a curve that has faults (DeclarationError)."""
        if found := self.once(_faults_of):
            raise DeclarationError(f"{what} of a curve", found)

    @door
    def cutter_path(self, radius: float) -> Curve:
        """Return the path of the center of a cutter that makes the profile: its equidistant on the outside.

        Of a cam with a roller the profile lies inside the path of the center by the radius of the roller. A radius of zero gives the
        profile itself. A groove about a cam is cut with the radius of its roller.

        Parameters
        ----------
        radius : float
            Radius of the cutter [length], 0 or more.

        Returns
        -------
        Curve
            By the arc length of this curve (by its own parameter where it is this curve, or one with a name).

        Raises
        ------
        DeclarationError
            For curves that are not plane and closed, and a cutter larger than the radius of curvature where the profile is hollow.

        Examples
        --------
        >>> import mechgraph as mg
        >>> mg.Curve.circle(radius=0.2).cutter_path(0.05).at(0.0)[0].round(6) + 0
        array([0.25, 0.  , 0.  ])
        """
        made: Curve = methods.call("cutter_path", self, radius)
        return made

    @door
    def write(
        self,
        path: Any,
        *,
        error: float | None = None,
        cutter: float | None = None,
        form: Literal["spline", "polyline"] = "spline",
        unit: str | None = None,
    ) -> None:
        """Write the curve as DXF (extra ``dxf``) or CSV: profile, path of the roller's center, path of a cutter, marks.

        DXF has the layers PROFILE, PITCH (where there is a roller), CUTTER and MARKS: the center of a cam and the line to its angle zero.
        CSV has a line per point, with the parameter (of a cam the angle) first. Points are close enough for chords within ``error``.

        Parameters
        ----------
        path : path
            ``"cam.dxf"`` or ``"cam.csv"``.
        error : float, optional
            Largest distance of splines or chords from the curve [length]. Default: a ten thousandth of its greatest extent.
        cutter : float, optional
            Radius of a cutter whose path is added [length].
        form : {"spline", "polyline"}
            Entities of the DXF: splines of degree 3, or polylines.
        unit : {"mm", "cm", "m", "in", "ft"}, optional
            Unit of the numbers, for the header of the DXF.

        Raises
        ------
        DeclarationError, FileError
            For values out of range; the file cannot be written. MissingExtraError where ezdxf is not installed.

        Examples
        --------
        >>> import mechgraph as mg
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> path = Path(mkdtemp()) / "disc.csv"
        >>> mg.Curve.circle(radius=20.0).write(path, error=0.1)
        >>> path.read_text().splitlines()[0]
        'parameter,profile x,profile y,profile z'
        """
        self.sound("write")
        methods.call("write_curve", self, path, error=error, cutter=cutter, form=form, unit=unit)

    @property
    def is_profile(self) -> bool:
        """Whether it says the outline of a body, not a slot: a cam."""
        return False

    @property
    def roller(self) -> float:
        """Radius of the roller whose center the curve is the path of, on the outside of the shape."""
        return 0.0

    def faults(self, where: str) -> list[str]:
        """What is wrong with what is declared, one line each."""
        return self.value_faults(where)


def turned(R: Array, v: Array) -> Array:
    """Products ``R v`` of a matrix ``(3, 3)`` and vectors ``(3, ...)``."""
    return (R @ v.reshape(3, -1)).reshape(v.shape)


def _unit(v: Any) -> Array:
    return np.asarray(v, dtype=float) / np.linalg.norm(v)


@dataclass(frozen=True, kw_only=True, repr=False)
class Line(Curve):
    """A straight line."""

    whole = (-np.inf, np.inf)
    kind = "line"
    speed = 1.0
    point: Annotated[Any, POINT("where the arc length is zero", LENGTH, default="0")] = ORIGIN
    direction: Annotated[Any, DIRECTION("along the line", default="z")] = (0.0, 0.0, 1.0)
    ends_at: Annotated[Any, INTERVAL("arc lengths at which it ends", LENGTH, default="endless")] = None

    def at(self, u: Array) -> Array:
        """``point + u direction``."""
        out = np.zeros((ORDERS, 3, *u.shape), dtype=u.dtype)
        d = _unit(self.direction).reshape(3, *(1,) * u.ndim)
        out[0] = np.asarray(self.point).reshape(d.shape) + u * d
        out[1] = d
        return out

    def beside(self, distance: float, y: Array) -> Curve:
        """A parallel line."""
        return self.replace(point=np.asarray(self.point) + distance * y)


@dataclass(frozen=True, kw_only=True, repr=False)
class Centred(Curve):
    """What curves about a center share: ``x = center + f e1 + g e2 + h e3``, e3 the axis and e1 along ``second``."""

    center: Annotated[Any, POINT("center", LENGTH, default="0")] = ORIGIN
    axis: Annotated[Any, DIRECTION("normal of the plane, or axis", default="z")] = (0.0, 0.0, 1.0)
    second: Annotated[Any, across("where the parameter is zero")] = None

    def faults(self, where: str) -> list[str]:
        """What is wrong with what is declared, one line each."""
        return super().faults(where) or parallel_faults(self.axis, self.second, where)

    @property
    def normal(self) -> Array:
        """The axis."""
        return _unit(self.axis)

    @cached_property
    def basis(self) -> Array:
        """Its own axes ``(3, 3)``, one a column."""
        return axes_of(self.axis, self.second)

    def _placed(self, parts: Array) -> Array:
        """Position and derivatives ``(4, 3, ...)`` from those in the own axes."""
        out = np.matmul(self.basis, parts.reshape(len(parts), 3, -1)).reshape(parts.shape)
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
    def is_closed(self) -> bool:
        """Unless it is an arc."""
        return self.angles is None

    def beside(self, distance: float, y: Array) -> Curve | None:
        """A circle about the same center."""
        out = y @ (self.at(np.array(self.ends[0]))[0] - np.asarray(self.center))
        radius = self.radius + distance * float(np.sign(out))
        return self.replace(radius=radius) if radius > 0 else None

    @property
    def speed(self) -> float:
        """The radius."""
        return self.radius


@dataclass(frozen=True, kw_only=True, repr=False)
class Ellipse(Centred):
    """An ellipse."""

    kind = "ellipse"
    is_closed = True
    a: Annotated[float, POSITIVE("half axis along `second`", LENGTH)]
    b: Annotated[float, POSITIVE("half axis across it", LENGTH)]

    def at(self, u: Array) -> Array:
        """``a cos u e1 + b sin u e2``."""
        c, s = _turning(u)
        return self._placed(np.stack([self.a * c, self.b * s, 0 * c], axis=1))


@dataclass(frozen=True, kw_only=True, repr=False)
class Helix(Centred):
    """A helix about an axis; endless unless its angles are given."""

    whole = (-np.inf, np.inf)
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
        parts = np.array([f, g, np.zeros_like(f)]) * np.reshape([1.0, hand, 1.0], (3, 1, *(1,) * u.ndim))
        return self._placed(self.radius * parts.swapaxes(0, 1))

    def faults(self, where: str) -> list[str]:
        """Sizes that cannot be."""
        found = super().faults(where)
        if not found and not self.angles[0] > 0:
            found.append(f"{where}angles = {self.angles}: the involute has a cusp at angle 0; begin above it")
        return found


GAUSS_NODES, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(6)
"""Rule of an integral over an interval that is short enough for a polynomial of degree 7."""


@dataclass(frozen=True)
class CurvePlace:
    """A curve at arc lengths ``(...)``: position, tangent and its rates by the arc length ``(3, ...)``, axes y and k, rates of turning."""

    x: Array
    t: Array
    dt: Array
    y: Array
    k: Array
    w: Array
    dw: Array

    @property
    def real(self) -> CurvePlace:
        """Without imaginary parts."""
        return CurvePlace(*(np.asarray(part.real) for part in vars(self).values()))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


def _faults_of(curve: Curve) -> list[str]:
    return curve.faults("")


class Travel:
    """Arc length and frames of a curve without faults."""

    def __init__(self, curve: Curve) -> None:
        self.curve = curve
        self.speed = curve.speed
        self._origin = curve.ends[0] if np.isfinite(curve.ends[0]) else 0.0
        if self.speed is not None:
            s = self.speed * (curve.grid - self._origin)
        else:
            s, self._parameter = _by_arc_length(curve)
        self.s = s
        self.begin, self.end = (float(s[0]), float(s[-1])) if np.isfinite(curve.ends[0]) else (-np.inf, np.inf)
        self.length = float(s[-1] - s[0])
        self.is_closed = curve.is_closed
        self.guide, self.is_plane = self._guide()
        self.is_groove = curve.depth(curve.grid[:1]) is not None
        self.is_plane = self.is_plane and not self.is_groove
        self.minimizing = curve.frame == "minimizing" and not self.is_groove
        self.closing = 0.0
        self._turn: Pieces | None = None
        if self.minimizing and not self.is_plane:
            self._find_turn()

    def _guide(self) -> tuple[Array, bool]:
        """The direction near which the third axis of the frame stays, and whether the curve lies in a plane at right angles to it."""
        t = self._rates(self._parameter_at(self.s))[1]

        def across(normal: Array) -> bool:
            return bool(np.abs(normal @ t).max() < SHAPES.even)

        self.is_straight = bool(np.abs(t - t[:, :1]).max() < SHAPES.even)
        given = self.curve.guide if self.curve.frame == "guided" else None
        if given is not None:
            d = np.asarray(given, dtype=float) / np.linalg.norm(given)
            return d, across(d)
        if self.is_straight:
            return np.cross(t[:, 0], second_direction(tuple(t[:, 0].tolist()))), True
        axis = self.curve.normal
        if axis is not None and (self.curve.frame == "guided" or across(axis)):
            return axis, across(axis)
        normal = np.linalg.svd(t @ t.T)[0][:, 2]
        if across(normal) or self.curve.frame == "guided":
            return _right_handed(normal, self.curve.at(self.curve.grid)[0]), across(normal)
        return far_from(t), False

    # --- by arc length -----------------------------------------------------------------------------------------------

    def _parameter_at(self, s: Array) -> Array:
        """The parameter at arc lengths; beyond the ends of an open curve at the speed that it has there."""
        if self.speed is not None:
            return np.asarray(self._origin + s / self.speed)
        at = s.real
        inside = at - self._rounds(at) * self.length if self.is_closed else np.clip(at, self.begin, self.end)
        u = self._parameter.at(inside)[0]
        beyond = s - s.real if self.is_closed else s - inside
        return np.asarray(u + beyond * _parameter_rates(self.curve.at(u))[0]) if np.any(beyond) else u

    def _rounds(self, s: Array) -> Array:
        return np.floor((s - self.s[0]) / self.length)

    def _rates(self, u: Array) -> tuple[Array, Array, Array, Array]:
        """Position and its first three derivatives by the arc length, ``(3, ...)`` each."""
        x = self.curve.at(u)
        if self.speed is not None:
            return x[0], x[1] / self.speed, x[2] / self.speed**2, x[3] / self.speed**3
        u1, u2, u3 = _parameter_rates(x)
        square = u1 * u1
        return x[0], x[1] * u1, x[2] * square + x[1] * u2, x[3] * (square * u1) + 3 * x[2] * (u1 * u2) + x[1] * u3

    def guided(self, s: Array) -> tuple[Array, ...]:
        """``x, t, t', t'', y, k, r, r'`` of the frame guided by the direction."""
        x, t, dt, ddt = self._rates(self._parameter_at(s))
        d = self.guide.reshape(3, *(1,) * s.ndim)
        c, dc = _dot(d, t), _dot(d, dt)
        m = np.sqrt(1.0 - c * c)
        k = (d - c * t) / m
        y = cross(k, t)
        bend = _dot(dt, y)
        r = c * bend / m
        dr = (dc * bend + c * (_dot(ddt, y) + r * _dot(dt, k))) / m + c * c * dc * bend / m**3
        return x, t, dt, ddt, y, k, r, dr

    def _in_groove(self, s: Array) -> tuple[Array, ...]:
        """The same of the frame whose third axis the curve says: ``r = -k' . y``."""
        u = self._parameter_at(s)
        (x, t, dt, ddt), known = self._rates(u), self.curve.depth(u)
        assert known is not None
        u1, u2, _ = _parameter_rates(self.curve.at(u))
        k, dk, ddk = known[0], known[1] * u1, known[2] * (u1 * u1) + known[1] * u2
        y = cross(k, t)
        dy = cross(dk, t) + cross(k, dt)
        return x, t, dt, ddt, y, k, -_dot(dk, y), -_dot(ddk, y) - _dot(dk, dy)

    def at(self, s: Array) -> CurvePlace:
        """Position and frame at arc lengths ``(...)``, real or complex."""
        if self.is_plane:
            u = self._parameter_at(s)
            known: CurvePlace | None = self.curve.place_at(u)
            if known is not None:
                return known
            x, t, dt, ddt = self._rates(u)
            k = np.broadcast_to(self.guide.reshape(3, *(1,) * s.ndim), t.shape)
            y = cross(k, t)
            # t' = c y with the curvature c towards y
            return CurvePlace(x, t, dt, y, k, _dot(dt, y) * k, _dot(ddt, y) * k)
        x, t, dt, ddt, y, k, r, dr = self._in_groove(s) if self.is_groove else self.guided(s)
        w, dw = cross(t, dt), cross(t, ddt)
        if not self.minimizing:
            w, dw = w + r * t, dw + dr * t + r * dt
        if self._turn is not None:
            # endless curves repeat what the grid holds, two turns of a helix
            again = self.is_closed or np.isinf(self.begin)
            rounds = self._rounds(s.real) if again else np.zeros(s.shape)
            a = self._turn.at(s.real - rounds * self.length)[0] + rounds * self._gain - (s - s.real) * r
            y, k = np.cos(a) * y + np.sin(a) * k, np.cos(a) * k - np.sin(a) * y
        return CurvePlace(x, t, dt, y, k, w, dw)

    def _find_turn(self) -> None:
        """The angle by which the minimizing frame is turned about the tangent against the guided one: ``a' = -r``."""

        def rate(s: Array) -> Array:
            return -self.guided(s)[6]

        def rates(s: Array) -> tuple[Array, ...]:
            *_, r, dr = self.guided(s)
            return -r, -dr, -self._turn_rate(s, dr)

        def strays(begin: Array, end: Array) -> Array:
            half, whole = _integrals(rate, begin, 0.5 * (begin + end)), _integrals(rate, begin, end)
            made = hermite(end - begin, [0 * whole, *rates(begin)], [whole, *rates(end)])
            return np.asarray(np.abs(_value(made, 0.5 * (end - begin)) - half) > 1e-15 * math.tau)

        s = _refined(self.s, strays)
        a = np.concatenate([[0.0], np.cumsum(_integrals(rate, s[:-1], s[1:]))])
        self._turn = Pieces.meeting(s, [a, *rates(s)], orders=1)
        self._gain = float(a[-1])
        self.closing = self._gain if self.is_closed else 0.0

    def _turn_rate(self, s: Array, dr: Array) -> Array:
        """``r''``, of which the fourth derivative of the curve is part: by a complex step, or a spline where that is not known."""
        if self.curve.orders <= ORDERS:
            spline: Any = scipy.interpolate.make_interp_spline(s, dr, 5)
            return np.asarray(spline(s, 1))
        ahead: Array = s + 1j * COMPLEX_STEP  # type: ignore[assignment]
        return np.asarray(self.guided(ahead)[7].imag / COMPLEX_STEP)

    # --- facts -------------------------------------------------------------------------------------------------------

    def curvature(self, s: Array) -> Array:
        """Curvature ``|t'|``; of a plane curve, or across a groove, ``t' . y``, positive where it bends towards y."""
        here = self.at(s)
        return _dot(here.dt, here.y) if self.is_plane or self.is_groove else np.asarray(np.sqrt(_dot(here.dt, here.dt)))

    def nearest(self, p: Array) -> tuple[float, float]:
        """Arc length of the point of the curve that is nearest to ``p (3,)``, and its distance."""
        s: Any = self._first(p)
        # steps of Newton's method to the nearest point, at most
        for _ in range(40):
            x, t, dt, _ = self._rates(self._parameter_at(np.array([s])))
            off = (x - p[:, None])[:, 0]
            slope = 1.0 + off @ dt[:, 0]
            step = float(off @ t[:, 0]) / (slope if slope > 0.1 else 1.0)
            s = s - step if self.is_closed else min(max(s - step, self.begin), self.end)
            if np.abs(step) < 1e-15 * self.length:
                break
        if self.is_closed:
            s -= float(self._rounds(np.array(s))) * self.length
        x = self._rates(self._parameter_at(np.array([s])))[0][:, 0]
        return float(s), float(np.linalg.norm(x - p))

    def _first(self, p: Array) -> float:
        """A guess of the nearest arc length; of an endless curve by its advance."""
        s = self.s
        if np.isinf(self.begin):
            x = self._rates(self._parameter_at(s))[0]
            chord = x[:, -1] - x[:, 0]
            s = s + (p - x.mean(axis=1)) @ chord / (chord @ chord) * self.length
        x = self._rates(self._parameter_at(s))[0]
        return float(s[np.argmin(np.linalg.norm(x - p[:, None], axis=0))])


def _parameter_rates(x: Array) -> tuple[Array, Array, Array]:
    """Three derivatives of the parameter by the arc length, from position and derivatives ``(4, 3, ...)`` by the parameter."""
    u1 = 1.0 / np.sqrt(_dot(x[1], x[1]))
    square = u1 * u1
    a, b = _dot(x[1], x[2]) * square, (_dot(x[2], x[2]) + _dot(x[1], x[3])) * square
    return u1, -a * square, (4 * a * a - b) * square * u1


def _integrals(f: Callable[[Array], Array], begin: Array, end: Array) -> Array:
    """Integrals over intervals, by Gauss's rule."""
    half = (end - begin) / 2
    return np.asarray((f(begin[:, None] + half[:, None] * (1 + GAUSS_NODES)) @ GAUSS_WEIGHTS) * half)


def _refined(grid: Array, strays: Callable[[Array, Array], Array]) -> Array:
    """The grid with intervals halved, up to eight times, as long as ``strays(begin, end)`` says so of them."""
    begin, end, cuts = grid[:-1], grid[1:], [grid]
    for _ in range(8):
        bad = strays(begin, end)
        begin, end = begin[bad], end[bad]
        cuts.append(middle := 0.5 * (begin + end))
        begin, end = np.concatenate([begin, middle]), np.concatenate([middle, end])
        if not begin.size:
            break
    return np.sort(np.concatenate(cuts))


def _value(coefficients: Array, x: Array) -> Array:
    """Values ``(n,)`` of polynomials ``(degree + 1, n)``, lowest power first, each at its own ``x (n,)``."""
    return np.asarray(np.polynomial.polynomial.polyval(x, coefficients, tensor=False))


def _by_arc_length(curve: Curve) -> tuple[Array, Pieces]:
    """Arc lengths on a grid, and the parameter by the arc length: intervals in which that is not exact in the middle are halved."""

    def speed(u: Array) -> Array:
        x = curve.at(u)[1]
        return np.asarray(np.sqrt(_dot(x, x)))

    def strays(begin: Array, end: Array) -> Array:
        middle = 0.5 * (begin + end)
        half = _integrals(speed, begin, middle)
        rates = [_parameter_rates(curve.at(u)) for u in (begin, end)]
        made = hermite(half + _integrals(speed, middle, end), [0 * half, *rates[0]], [end - begin, *rates[1]])
        return np.asarray(np.abs(_value(made, half) - (middle - begin)) > most)

    most = 1e-15 * (curve.grid[-1] - curve.grid[0])  # rounding
    u = _refined(curve.grid, strays)
    s = np.concatenate([[0.0], np.cumsum(_integrals(speed, u[:-1], u[1:]))])
    return s, Pieces.meeting(s, [u, *_parameter_rates(curve.at(u))], orders=1)


def _right_handed(normal: Array, x: Array) -> Array:
    """The normal about which points ``(3, n)`` are passed in the positive sense."""
    about = np.cross(x[:, :-1] - x[:, :1], np.diff(x), axis=0).sum(axis=1) @ normal
    if abs(about) < 1e-9 * np.ptp(x, axis=1).max() ** 2:
        about = normal[np.argmax(np.abs(normal))]
    return normal if about > 0 else -normal


def far_from(t: Array) -> Array:
    """The direction that keeps farthest from all directions ``(3, n)`` and their opposites, of 200 on a spiral over the sphere."""
    i = np.arange(200) + 0.5
    z, angle = 1 - i / 200, np.pi * (1 + np.sqrt(5.0)) * i
    tried = np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z])
    return np.asarray(tried[:, np.argmin(np.abs(tried.T @ t).max(axis=1))])


def shape_faults(curve: Curve, where: str) -> list[str]:
    """Places where a curve cannot be followed: cusps, gaps of one that must be closed, a guide along the tangent."""
    x, name = curve.at(curve.grid), where.removesuffix(".")
    v = np.sqrt(_dot(x[1], x[1]))
    turns = _dot(x[1][:, 1:], x[1][:, :-1]) <= 0
    slow = np.flatnonzero((v < SHAPES.standstill * v.max()) | np.append(turns, False))
    if slow.size:
        at = f"{point_text(x[0][:, slow[0]])} (parameter {curve.grid[slow[0]]:.6g})"
        return [f"{name} has a cusp at {at}; end it before that"]
    if curve.roller and (found := roller_faults(curve, curve.roller, "undercut: ", where)):
        return found
    gap, turn = np.linalg.norm(x[0][:, -1] - x[0][:, 0]), np.linalg.norm(x[1][:, -1] / v[-1] - x[1][:, 0] / v[0])
    if curve.is_closed and (gap > SHAPES.met * np.ptp(x[0], axis=1).max() or turn > SHAPES.met):
        return [
            f"{name} is not closed: its ends are {gap:.3g} apart, their tangents differ by {turn:.3g} rad; let it end where it begins, "
            "or declare it open"
        ]
    return _guide_faults(curve, x[1] / v, x[0], where)


def outside(curve: Curve) -> float:
    """1 where the normal y of a closed plane curve points outwards, -1 where it points inwards."""
    travel = curve.once(Travel)
    here = travel.at(travel.s)
    area = cross(here.x[:, :-1] - here.x[:, :1], np.diff(here.x)).sum(axis=1)
    return -1.0 if travel.guide @ area > 0 else 1.0


def roller_faults(curve: Curve, radius: float, what: str, where: str, side: float | None = None) -> list[str]:
    """Where a roller is larger than the radius of curvature of the path of its center (``side`` None: that path is ``curve``, on the
    outside of the shape) or of the curve on which it runs, with its center on the side of the normal y (1) or the other (-1).
    """
    travel = curve.once(Travel)
    towards = -outside(curve) if side is None else side
    k = travel.curvature(travel.s)
    bend = np.abs(k) if travel.is_groove else towards * k  # a groove has two walls
    worst = int(np.argmax(bend))
    if radius * bend[worst] < 1 - SHAPES.standstill:
        return []
    return [
        f"{where}{what}the roller of radius {radius:.6g} is larger than the radius of curvature {1 / bend[worst]:.6g} at "
        f"{point_text(travel.at(travel.s[worst : worst + 1]).x[:, 0])}; make it smaller, or the curve rounder"
    ]


def _guide_faults(curve: Curve, t: Array, x: Array, where: str) -> list[str]:
    if curve.frame != "guided" or curve.guide is None:
        return []
    d = np.asarray(curve.guide) / np.linalg.norm(curve.guide)
    along = np.abs(d @ t)
    worst = int(np.argmax(along))
    if along[worst] < 1 - SHAPES.met:
        return []
    return [
        f"{where}guide = {shown(curve.guide)}: is the direction of the curve at {point_text(x[:, worst])}; give another, or "
        "frame='minimizing'"
    ]


def parallel_faults(axis: Sequence[float], second: Sequence[float], where: str) -> list[str]:
    """A second direction that has no part at right angles to its axis, one line or none."""
    if abs(cosine(axis, second)) <= 1 - SHAPES.parallel:
        return []
    return [f"{where}second = {second!r}: parallel to the axis {axis!r}; give another direction"]


def point_text(x: Array) -> str:
    """A point ``(3,)`` in a message."""
    return "(" + ", ".join(f"{v:.6g}" for v in x) + ")"
