"""Curves along which a marker travels: what they share, and those with a name.

    x(u), u in (begin, end): position in the frame of the link that bears the curve, with three derivatives by the parameter u.

Arc length, direction and frame are found from these (``arc_length``). Arguments may be complex, as in all kernels.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np

from mechgraph.fields import (
    DIRECTION,
    FLAG,
    INTERVAL,
    NUMBER,
    POINT,
    POSITIVE,
    TEXT,
    Described,
    axes_of,
    filled_second,
    parallel_faults,
)
from mechgraph.maths.se3 import Array
from mechgraph.memo import Once
from mechgraph.quantities import LENGTH


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


@dataclass(frozen=True, kw_only=True, repr=False)
class Curve(Described, Once):
    """Base of the curves in the frame of a link; make one by ``Curve.circle(...)`` and so on.

    ``line``, ``circle``, ``ellipse``, ``helix``, ``involute``, ``cam``, ``arm_cam``, ``through`` (points) and ``function`` make
    curves. The moving frame has the tangent as one direction. ``"minimizing"`` rotates as little as possible about it (a plane curve
    keeps its normal); ``"guided"`` keeps the direction ``guide`` in the plane of tangent and third direction; ``"held"`` does not
    rotate (P and C): a body on a circle is then translated, as the coupler of a parallelogram.

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
        return 0.0, math.tau

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

    def beside(self, distance: float, y: Array) -> Curve | None:
        """The curve at a distance towards the normal, which is ``y (3,)`` where it begins, where that is a curve with a name too."""
        return None

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


def remade_from(shape: Any) -> tuple[Any, tuple[Any, ...]]:
    """How a shape is copied and pickled: from its fields alone."""
    return _remade, (type(shape), {f.name: getattr(shape, f.name) for f in fields(shape)})


def _remade(kind: Callable[..., Any], values: dict[str, Any]) -> Any:
    return kind(**values)


def turned(R: Array, v: Array) -> Array:
    """Products ``R v`` of a matrix ``(3, 3)`` and vectors ``(3, ...)``."""
    return (R @ v.reshape(3, -1)).reshape(v.shape)


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

    def beside(self, distance: float, y: Array) -> Curve:
        """A parallel line."""
        return self.replace(point=np.asarray(self.point) + distance * y)

    @property
    def speed(self) -> float:
        """One."""
        return 1.0


@dataclass(frozen=True, kw_only=True, repr=False)
class Centred(Curve):
    """What curves about a center share: ``x = center + f e1 + g e2 + h e3``, e3 the axis and e1 along ``second``."""

    center: Annotated[Any, POINT("center", LENGTH, default="0")] = (0.0, 0.0, 0.0)
    axis: Annotated[Any, DIRECTION("normal of the plane, or axis", default="z")] = (0.0, 0.0, 1.0)
    second: Annotated[
        Any, DIRECTION("where the parameter is zero", default="global axis least aligned with `axis`")
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.second is None:
            object.__setattr__(self, "second", filled_second(self.axis))

    def faults(self, where: str) -> list[str]:
        """What is wrong with what is declared, one line each."""
        return super().faults(where) or parallel_faults(self.axis, self.second, where)

    @property
    def normal(self) -> Array:
        """The axis."""
        return _unit(self.axis)

    @cached_property
    def _basis(self) -> Array:
        return axes_of(self.axis, self.second)

    def _placed(self, parts: Array) -> Array:
        """Position and derivatives ``(4, 3, ...)`` from those in the own axes."""
        out = np.matmul(self._basis, parts.reshape(len(parts), 3, -1)).reshape(parts.shape)
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
        return self.angles or (0.0, math.tau)

    @property
    def is_closed(self) -> bool:
        """Unless it is an arc."""
        return self.angles is None

    def beside(self, distance: float, y: Array) -> Curve | None:
        """A circle about the same center."""
        radius = self.radius + distance * float(
            np.sign(y @ (self.at(np.array(self.ends[0]))[0] - np.asarray(self.center)))
        )
        return self.replace(radius=radius) if radius > 0 else None

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
