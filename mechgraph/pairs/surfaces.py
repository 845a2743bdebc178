"""Surfaces on which a point or the center of a sphere travels, by two parameters: those about an axis, through points, by a function.

    x(u, v): position in the frame of the link that bears the surface, with its first and second derivatives.

The normal is ``x_u x x_v``. Arguments may be complex, as in all kernels.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
import scipy

from mechgraph.fields import (
    DIRECTION,
    FUNCTION,
    INTEGER,
    INTERVAL,
    POINT,
    POINT_LIST,
    POSITIVE,
    Described,
    across,
    asked,
    axes_of,
    between,
    remade,
    slope_faults,
)
from mechgraph.fields import TABLE as NESTED
from mechgraph.maths.se3 import Array, cross
from mechgraph.memo import dataclass
from mechgraph.pairs.curves import ORIGIN, Circle, Curve, Line, far_from, parallel_faults
from mechgraph.quantities import LENGTH, PURE, shown, wrong

NO_ENDS = (-np.inf, np.inf)


@dataclass(frozen=True, kw_only=True, repr=False)
class Surface(Described):
    """Base of the surfaces in the frame of a link; make one by ``Surface.sphere(...)`` and so on.

    ``plane``, ``sphere``, ``cylinder``, ``cone``, ``torus``, ``revolution``, ``patch`` (a spline) and ``function`` make surfaces. The
    coordinates ``Tu``, ``Tv`` of a pair Sp on it are lengths along the surface.

    Examples
    --------
    >>> import mechgraph as mg
    >>> dome = mg.Surface.sphere(center=(0, 0, 0), radius=2.0)
    >>> p = mg.Pair("K", "Sp", "frame", "ball", point=(2, 0, 0), surface=dome)
    >>> p.freedom_names
    ('K.Tu', 'K.Tv', 'K.Rx', 'K.Ry', 'K.Rz')
    """

    kind: ClassVar[str]
    plane: ClassVar[Any]
    sphere: ClassVar[Any]
    cylinder: ClassVar[Any]
    cone: ClassVar[Any]
    torus: ClassVar[Any]
    revolution: ClassVar[Any]
    patch: ClassVar[Any]
    function: ClassVar[Any]

    __reduce__ = remade

    @abstractmethod
    def at(self, u: Array, v: Array) -> Array:
        """``x, x_u, x_v, x_uu, x_uv, x_vv (6, 3, ...)`` at parameters ``(...)``."""

    @property
    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Least and greatest values of both parameters; infinite where the surface goes on or closes."""
        return NO_ENDS, NO_ENDS

    def away_from_pole(self, p: Array) -> Surface:
        """The same surface by parameters that say something at a point ``p (3,)`` of it; itself where there is nothing better."""
        return self

    def from_pole(self, u: Array, v: Array) -> Array:
        """Ways ``(2, ...)`` from a pole of the parameters that is none of the surface, over the radius; infinite without one."""
        return np.full((2, *np.shape(u)), np.inf)

    def with_poles_far_from(self, p: Array) -> Surface:
        """The same surface by parameters that have their poles far from points ``(3, n)`` of it; itself where there is no better."""
        return self

    def sense(self, u: Array, v: Array) -> Array | float:
        """-1 where ``x_u`` is opposite to what it is on the near side of a pole, so that axes go on over it; 1 everywhere else."""
        return 1.0

    @property
    def periods(self) -> tuple[float, float]:
        """Ranges of both parameters after which the surface returns into itself; infinite where it does not."""
        return np.inf, np.inf

    def grid(self, p: Array) -> tuple[Array, Array]:
        """Parameters among which one is near to a point ``(3,)``."""
        return _crossed(*(_between(end, 1.0 + 2.0 * float(np.linalg.norm(p))) for end in self.ends))

    def offset(self, distance: float) -> Surface | None:
        """The surface at a distance towards the normal, on which the center of a ball travels; None where it is of no known kind."""
        return None

    def curvatures(self, u: Array, v: Array) -> Array:
        """Both principal curvatures ``(2, ...)``, positive where the surface bends towards its normal; the lesser one first.

        The roots of ``det(II - k I) = 0`` of both fundamental forms.
        """
        _, xu, xv, *second = self.at(u, v)
        n = cross(xu, xv)
        n = n / np.sqrt((n * n).sum(axis=0))
        E, F, G = ((a * b).sum(axis=0) for a, b in ((xu, xu), (xu, xv), (xv, xv)))
        e, f, g = ((part * n).sum(axis=0) for part in second)
        area = E * G - F * F
        mean, gauss = 0.5 * (e * G - 2 * f * F + g * E) / area, (e * g - f * f) / area
        apart = np.sqrt(np.maximum(mean * mean - gauss, 0.0))
        return np.stack([mean - apart, mean + apart])

    @property
    def looked_at(self) -> tuple[Array, Array]:
        """Parameters ``(n,)`` between which the surface is smooth."""
        return _crossed(*(_between(end, 1.0) for end in self.ends))

    @cached_property
    def bend(self) -> float:
        """Greatest curvature there."""
        with np.errstate(divide="ignore", invalid="ignore"):  # where a meridian meets its axis
            found = np.abs(self.curvatures(*self.looked_at))
        return float(found.max(initial=0.0, where=np.isfinite(found)))

    def nearest(self, p: Array) -> tuple[float, float]:
        """Parameters of the point of the surface that is nearest to ``p (3,)``, by Newton's method."""
        u, v = self.grid(p)
        best = int(np.argmin(((self.at(u, v)[0] - p[:, None]) ** 2).sum(axis=0)))
        at = np.array([u[best], v[best]])
        for _ in range(33):
            x, xu, xv, xuu, xuv, xvv = self.at(at[:1], at[1:])[:, :, 0]
            first, off = np.stack([xu, xv]), x - p
            metric = first @ first.T
            bend = np.array([[off @ xuu, off @ xuv], [off @ xuv, off @ xvv]])
            H = metric + bend if np.linalg.eigvalsh(metric + bend)[0] > 0 else metric
            step = np.linalg.lstsq(H, first @ off)[0]
            at = np.clip(at - step, *np.transpose(self.ends))
            if np.abs(step).max() < 1e-15:
                break
        return float(at[0]), float(at[1])

    def faults(self, where: str) -> list[str]:
        """What is wrong with what is declared, one line each."""
        return self.value_faults(where)


def _between(ends: tuple[float, float], size: float) -> Array:
    """Middles of 33 equal parts between two ends, of which infinite ones count as ``size``: at the ends there may be no normal."""
    low, high = (end if np.isfinite(end) else np.copysign(size, end) for end in ends)
    return low + (high - low) * (np.arange(33) + 0.5) / 33


def _crossed(u: Array, v: Array) -> tuple[Array, Array]:
    """All pairs of two rows of parameters."""
    grid = np.meshgrid(u, v)
    return grid[0].ravel(), grid[1].ravel()


@dataclass(frozen=True, kw_only=True, repr=False)
class AboutAxis(Surface):
    """What a plane and surfaces of revolution share: a center and an axis."""

    center: Annotated[Any, POINT("a point of the axis: center, apex, or a point of the plane", LENGTH, default="0")] = (
        ORIGIN
    )
    axis: Annotated[Any, DIRECTION("axis, or normal of the plane", default="z")] = (0.0, 0.0, 1.0)
    second: Annotated[Any, across("along u of a plane; where u is zero")] = None

    def faults(self, where: str) -> list[str]:
        """What is wrong with what is declared, one line each."""
        return super().faults(where) or parallel_faults(self.axis, self.second, where)

    @cached_property
    def _basis(self) -> Array:
        return axes_of(self.axis, self.second).T


@dataclass(frozen=True, kw_only=True, repr=False)
class Plane(AboutAxis):
    """A plane."""

    kind = "plane"

    def at(self, u: Array, v: Array) -> Array:
        """``center + u e1 + v e2``."""
        e1, e2, c = (np.asarray(p).reshape(3, *(1,) * u.ndim) for p in (*self._basis[:2], self.center))
        out = np.zeros((6, 3, *u.shape), dtype=np.result_type(u, v))
        out[0], out[1], out[2] = c + u * e1 + v * e2, e1, e2
        return out

    def offset(self, distance: float) -> Surface:
        """A plane."""
        return self.replace(center=np.asarray(self.center) + distance * self._basis[2])


@dataclass(frozen=True, kw_only=True, repr=False)
class Turned(AboutAxis):
    """A curve turned about an axis: u is the angle, v the parameter of the ``meridian``."""

    @cached_property
    @abstractmethod
    def meridian(self) -> Curve:
        """The curve where u is zero."""

    def at(self, u: Array, v: Array) -> Array:
        """``center + a + cos u b + sin u (axis x b)``, a and b the parts of the meridian along and across the axis."""
        p = self.meridian.at(v)[:3].copy()
        z = self._basis[2].reshape(3, *(1,) * u.ndim)
        p[0] -= np.asarray(self.center).reshape(z.shape)
        along = (p * z).sum(axis=1, keepdims=True) * z
        across = p - along
        beside = np.stack([cross(np.broadcast_to(z, part.shape), part) for part in across])
        c, s = np.cos(u), np.sin(u)
        turned, rate = c * across + s * beside, c * beside - s * across
        x = along + turned
        x[0] += np.asarray(self.center).reshape(z.shape)
        return np.stack([x[0], rate[0], x[1], -turned[0], rate[1], x[2]])

    @property
    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Those of the meridian."""
        return NO_ENDS, NO_ENDS if self.meridian.is_closed else self.meridian.ends

    @property
    def periods(self) -> tuple[float, float]:
        """A turn, and the range of a closed meridian."""
        begin, end = self.meridian.ends
        return math.tau, end - begin if self.meridian.is_closed else np.inf

    def grid(self, p: Array) -> tuple[Array, Array]:
        """A whole turn, and the meridian; of an endless one no farther from where it begins than the point."""
        center, begin = np.asarray(self.center), self.meridian.at(np.zeros(1))[0][:, 0]
        size = float(np.linalg.norm(p - center) + np.linalg.norm(begin - center))
        return _crossed(_between((0.0, math.tau), size), _between(self.meridian.ends, size))

    @property
    def looked_at(self) -> tuple[Array, Array]:
        """The meridian."""
        v = self.meridian.grid
        return np.zeros(len(v)), v

    def _circle(self, radius: float, away: float = 0.0, **more: Any) -> Circle:
        e1, e2, _ = self._basis
        return Circle(center=np.asarray(self.center) + away * e1, radius=radius, axis=-e2, second=e1, **more)


@dataclass(frozen=True, kw_only=True, repr=False)
class Sphere(Turned):
    """A sphere, by longitude and latitude, which goes on over the poles; beside a pole the axis of the solution is another one."""

    kind = "sphere"
    radius: Annotated[float, POSITIVE("radius", LENGTH)]

    @cached_property
    def meridian(self) -> Curve:
        """Half a circle."""
        return self._circle(self.radius, angles=(-0.25 * math.tau, 0.25 * math.tau))

    @property
    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """It has none."""
        return NO_ENDS, NO_ENDS

    @property
    def periods(self) -> tuple[float, float]:
        """A turn each."""
        return math.tau, math.tau

    def away_from_pole(self, p: Array) -> Surface:
        """Within ``BESIDE_POLE`` of a pole by longitude and latitude about ``second``."""
        off = p - np.asarray(self.center)
        # angle from a pole of a sphere up to which a place of it has its coordinates about another axis
        near = np.linalg.norm(np.cross(self._basis[2], off)) < np.sin(0.25) * np.linalg.norm(off)
        return self.replace(axis=self._basis[0], second=self._basis[1]) if near else self

    def from_pole(self, u: Array, v: Array) -> Array:
        """At right angles to the axis of the poles."""
        return np.cos(v) * np.stack([np.cos(u), np.sin(u)])

    def with_poles_far_from(self, p: Array) -> Sphere:
        """About the axis that keeps far from the points, and from those opposite to them."""
        off = p - np.asarray(self.center)[:, None]
        return self.replace(axis=far_from(off / np.linalg.norm(off, axis=0)), second=None)

    def sense(self, u: Array, v: Array) -> Array:
        """The sign of the cosine of the latitude."""
        return np.where(np.cos(v.real) < 0, -1.0, 1.0)

    def offset(self, distance: float) -> Surface | None:
        """A sphere about the same center."""
        return self.replace(radius=self.radius + distance) if self.radius + distance > 0 else None


@dataclass(frozen=True, kw_only=True, repr=False)
class Cylinder(Turned):
    """A round cylinder, endless."""

    kind = "cylinder"
    radius: Annotated[float, POSITIVE("radius", LENGTH)]

    @cached_property
    def meridian(self) -> Curve:
        """A line along the axis."""
        return Line(point=np.asarray(self.center) + self.radius * self._basis[0], direction=self.axis)

    def offset(self, distance: float) -> Surface | None:
        """A cylinder about the same axis."""
        return self.replace(radius=self.radius + distance) if self.radius + distance > 0 else None


@dataclass(frozen=True, kw_only=True, repr=False)
class Cone(Turned):
    """A cone, from its apex at the center."""

    kind = "cone"
    half_angle: Annotated[
        float, POSITIVE("between axis and surface, below 90 degrees", PURE, degrees=True, below=math.pi / 2)
    ]

    @cached_property
    def meridian(self) -> Curve:
        """A line from the apex."""
        direction = np.sin(self.half_angle) * self._basis[0] + np.cos(self.half_angle) * self._basis[2]
        return Line(point=self.center, direction=direction)

    def offset(self, distance: float) -> Surface:
        """The cone at a distance, whose apex is beside that of this one."""
        return self.replace(center=np.asarray(self.center) - distance / np.sin(self.half_angle) * self._basis[2])

    @property
    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The apex."""
        return NO_ENDS, (0.0, np.inf)

    @property
    def looked_at(self) -> tuple[Array, Array]:
        """Nowhere: it is sharper and sharper towards the apex."""
        return np.zeros(0), np.zeros(0)


@dataclass(frozen=True, kw_only=True, repr=False)
class Torus(Turned):
    """A torus."""

    kind = "torus"
    radius: Annotated[float, POSITIVE("radius of the circle of centers", LENGTH)]
    tube: Annotated[float, POSITIVE("radius of the tube, below that", LENGTH)]

    @cached_property
    def meridian(self) -> Curve:
        """A circle."""
        return self._circle(self.tube, self.radius)

    def offset(self, distance: float) -> Surface | None:
        """A torus with the same circle of centers."""
        return self.replace(tube=self.tube + distance) if 0 < self.tube + distance < self.radius else None

    def faults(self, where: str) -> list[str]:
        """Radii that make no torus."""
        found = super().faults(where)
        if found or self.tube < self.radius:
            return found
        return [wrong(self.tube, where + "tube", f"below {self.radius:g}")]


@dataclass(frozen=True, kw_only=True, repr=False)
class Revolution(Turned):
    """A curve turned about the axis."""

    kind = "revolution"
    profile: Annotated[Curve, NESTED("the curve", table="curve")]

    @cached_property
    def meridian(self) -> Curve:
        """As declared."""
        return self.profile

    def faults(self, where: str) -> list[str]:
        """Those of the curve."""
        if not isinstance(self.profile, Curve):
            return [wrong(self.profile, where + "profile", "a Curve")]
        return super().faults(where) + self.profile.faults(f"{where}profile.")


ORDERS_UV = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3))
"""Derivatives by u and v, in their order."""


def _continued(known: Array, u: Array, v: Array) -> Array:
    """Position and derivatives up to the second a bit (complex, too) beyond where ten up to the third are known, by Taylor's series."""
    if not (np.any(u) or np.any(v)):
        return known[:6]
    out = np.zeros((6, *known.shape[1:]), dtype=np.result_type(known, u, v))
    for own, (i, j) in zip(out, ORDERS_UV, strict=False):
        for part, (a, b) in zip(known, ORDERS_UV, strict=True):
            if a >= i and b >= j:
                own += part * (u ** (a - i) * v ** (b - j) / (math.factorial(a - i) * math.factorial(b - j)))
    return out


@dataclass(frozen=True, kw_only=True, repr=False)
class Patch(Surface):
    """The surface through a grid of points: a spline of degree 5 (3 where there are few) in both directions, parameters 0 to 1."""

    kind = "patch"
    points: Annotated[Any, POINT_LIST("points, row by row", LENGTH)]
    rows: Annotated[int, INTEGER("number of rows; u counts them")]

    @cached_property
    def _splines(self) -> tuple[Any, list[Any]]:
        grid = np.array(self.points).reshape(self.rows, -1, 3)
        n, m = grid.shape[:2]
        u, v = np.linspace(0, 1, n), np.linspace(0, 1, m)
        bases = [scipy.interpolate.make_interp_spline(at, np.eye(len(at)), 5 if len(at) > 5 else 3) for at in (u, v)]
        return grid, [[basis.derivative(k) if k else basis for k in range(4)] for basis in bases]

    def at(self, u: Array, v: Array) -> Array:
        """The spline."""
        grid, (along_u, along_v) = self._splines
        at_u, at_v = (np.asarray(at.real, dtype=float).ravel() for at in (u, v))
        U, V = [one(at_u) for one in along_u], [one(at_v) for one in along_v]
        known = np.stack([np.einsum("ti,tj,ijc->ct", U[i], V[j], grid, optimize=True) for i, j in ORDERS_UV])
        return _continued(known.reshape(10, 3, *u.shape), u - u.real, v - v.real)

    @property
    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The edges."""
        return (0.0, 1.0), (0.0, 1.0)

    def faults(self, where: str) -> list[str]:
        """A grid that makes no surface."""
        found = super().faults(where)
        n = len(self.points) if not found else 0
        if not found and (self.rows < 4 or n % self.rows or n // self.rows < 4):
            found.append(f"{where}rows = {shown(self.rows)}: {n} points make no grid of 4 or more rows and columns")
        return found


@dataclass(frozen=True, kw_only=True, repr=False)
class ByFunction(Surface):
    """A surface by a function of ``u, v (n,)``: position and its nine derivatives up to the third, ``x, x_u, x_v, x_uu, x_uv, ...``."""

    kind = "function"
    position: Annotated[
        Any, FUNCTION("u, v -> ten arrays (3, n): x, x_u, x_v, x_uu, x_uv, x_vv, x_uuu, x_uuv, x_uvv, x_vvv")
    ]
    ends_u: Annotated[Any, INTERVAL("least and greatest u")]
    ends_v: Annotated[Any, INTERVAL("least and greatest v")]

    def at(self, u: Array, v: Array) -> Array:
        """What the function returns; beyond the ends, and for complex parameters, by Taylor's series."""
        inside = [np.clip(at.real, *ends) for at, ends in zip((u, v), self.ends, strict=True)]
        known = self._known(*(at.ravel() for at in inside)).reshape(10, 3, *u.shape)
        return _continued(known, u - inside[0], v - inside[1])

    def _known(self, u: Array, v: Array) -> Array:
        return asked(self.position, [u, v], len(ORDERS_UV), len(ORDERS_UV))

    @property
    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """As declared."""
        return tuple(self.ends_u), tuple(self.ends_v)

    def faults(self, where: str) -> list[str]:
        """A function that does not do, or whose derivatives are not those of its positions."""
        found = super().faults(where)
        if found:
            return found
        at = [part.ravel() for part in np.meshgrid(*(between(np.linspace(*ends, 6)) for ends in self.ends))]
        before = [(i - 1, j) if i else (i, j - 1) for i, j in ORDERS_UV]
        steps = [(k, ORDERS_UV.index(before[k]), int(not i)) for k, (i, _) in enumerate(ORDERS_UV) if k]
        words = ["x" + "_"[: i + j] + "u" * i + "v" * j for i, j in ORDERS_UV]
        return slope_faults(self._known, at, steps, words, where)


SURFACES: dict[str, type[Surface]] = {
    kind.kind: kind for kind in (Plane, Sphere, Cylinder, Cone, Torus, Revolution, Patch, ByFunction)
}
"""Surfaces by the names that they have in files."""
Surface.plane, Surface.sphere, Surface.cylinder, Surface.cone = Plane, Sphere, Cylinder, Cone
Surface.torus, Surface.revolution, Surface.patch, Surface.function = Torus, Revolution, Patch, ByFunction
