"""Surfaces on which a point or the centre of a sphere travels, by two parameters; and the factor of a frame that lies on one.

    x(u, v): position in the frame of the link that bears the surface, with its first and second derivatives.

The normal is ``x_u x x_v``. Arguments may be complex, as in all kernels.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Hashable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array, cross
from mechgraph.model.curves import WHOLE_TURN, Circle, Curve, Line, remade_from
from mechgraph.model.factors import Factor
from mechgraph.model.field_format import DIRECTION, FUNCTION, INTEGER, INTERVAL, POINT, POINT_LIST, POSITIVE, Described
from mechgraph.model.field_format import TABLE as NESTED
from mechgraph.model.numeric import second_direction
from mechgraph.model.row_parts import UNIT_TWISTS, Freedom
from mechgraph.model.travel import COMPLEX_STEP
from mechgraph.quantities import wrong
from mechgraph.units import LENGTH, PURE

NEAREST_GRID = 33
"""Values of each parameter from which the nearest point of a surface is sought."""
SURFACE_LINES = 9
"""Lines each way by which a surface is drawn."""
NO_ENDS = (-np.inf, np.inf)


@dataclass(frozen=True, kw_only=True, repr=False)
class Surface(Described):
    """A surface in the frame of a link; ``Surface.sphere(...)`` and so on make one."""

    kind: ClassVar[str]
    plane: ClassVar[Any]
    sphere: ClassVar[Any]
    cylinder: ClassVar[Any]
    cone: ClassVar[Any]
    torus: ClassVar[Any]
    revolution: ClassVar[Any]
    patch: ClassVar[Any]
    function: ClassVar[Any]

    def __post_init__(self) -> None:
        self.read_numbers()

    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]:
        """What is declared alone: all else is found again."""
        return remade_from(self)

    @abstractmethod
    def at(self, u: Array, v: Array) -> Array:
        """``x, x_u, x_v, x_uu, x_uv, x_vv (6, 3, ...)`` at parameters ``(...)``."""

    @property
    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Least and greatest values of both parameters; infinite where the surface goes on or closes."""
        return NO_ENDS, NO_ENDS

    def grid(self, p: Array) -> tuple[Array, Array]:
        """Parameters among which one is near to a point ``(3,)``."""
        size = 1.0 + 2.0 * float(np.linalg.norm(p))
        axes = [_between(end, size) for end in self.ends]
        u, v = np.meshgrid(*axes)
        return u.ravel(), v.ravel()

    def nearest(self, p: Array) -> tuple[float, float]:
        """Parameters of the point of the surface that is nearest to ``p (3,)``, by Newton's method."""
        u, v = self.grid(p)
        best = int(np.argmin(((self.at(u, v)[0] - p[:, None]) ** 2).sum(axis=0)))
        at = np.array([u[best], v[best]])
        for _ in range(NEAREST_GRID):
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
    """Middles of equal parts between two ends, of which infinite ones count as ``size``: at the ends there may be no normal."""
    low, high = (end if np.isfinite(end) else np.copysign(size, end) for end in ends)
    return low + (high - low) * (np.arange(NEAREST_GRID) + 0.5) / NEAREST_GRID


@dataclass(frozen=True, kw_only=True, repr=False)
class AboutAxis(Surface):
    """What a plane and surfaces of revolution share: a centre and an axis."""

    center: Annotated[Any, POINT("a point of the axis: centre, apex, or a point of the plane", LENGTH, default="0")] = (
        0.0,
        0.0,
        0.0,
    )
    axis: Annotated[Any, DIRECTION("axis, or normal of the plane", default="z")] = (0.0, 0.0, 1.0)
    second: Annotated[
        Any, DIRECTION("along u of a plane; where u is zero", default="global axis least aligned with `axis`")
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.second is None and np.shape(self.axis) == (3,):
            object.__setattr__(self, "second", second_direction(self.axis))

    @cached_property
    def _basis(self) -> Array:
        z = np.asarray(self.axis) / np.linalg.norm(self.axis)
        x = np.asarray(self.second) - (z @ np.asarray(self.second)) * z
        x /= np.linalg.norm(x)
        return np.stack([x, np.cross(z, x), z])


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


@dataclass(frozen=True, kw_only=True, repr=False)
class Turned(AboutAxis):
    """A curve turned about an axis: u is the angle, v the parameter of the ``meridian``."""

    @property
    @abstractmethod
    def meridian(self) -> Curve:
        """The curve where u is zero."""

    @cached_property
    def _curve(self) -> Curve:
        return self.meridian

    def at(self, u: Array, v: Array) -> Array:
        """``center + a + cos u b + sin u (axis x b)``, a and b the parts of the meridian along and across the axis."""
        p = self._curve.at(v)[:3].copy()
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
        return NO_ENDS, NO_ENDS if self._curve.is_closed else self._curve.ends

    def grid(self, p: Array) -> tuple[Array, Array]:
        """A whole turn, and the meridian; of an endless one no farther from where it begins than the point."""
        center, begin = np.asarray(self.center), self._curve.at(np.zeros(1))[0][:, 0]
        size = float(np.linalg.norm(p - center) + np.linalg.norm(begin - center))
        u, v = np.meshgrid(_between((0.0, WHOLE_TURN), size), _between(self._curve.ends, size))
        return u.ravel(), v.ravel()

    def _circle(self, radius: float, away: float = 0.0, **more: Any) -> Circle:
        e1, e2, _ = self._basis
        return Circle(center=np.asarray(self.center) + away * e1, radius=radius, axis=-e2, second=e1, **more)


@dataclass(frozen=True, kw_only=True, repr=False)
class Sphere(Turned):
    """A sphere, by longitude and latitude; it ends at the poles, where the longitude says nothing."""

    kind = "sphere"
    radius: Annotated[float, POSITIVE("radius", LENGTH)]

    @property
    def meridian(self) -> Curve:
        """Half a circle."""
        return self._circle(self.radius, angles=(-0.25 * WHOLE_TURN, 0.25 * WHOLE_TURN))


@dataclass(frozen=True, kw_only=True, repr=False)
class Cylinder(Turned):
    """A round cylinder, endless."""

    kind = "cylinder"
    radius: Annotated[float, POSITIVE("radius", LENGTH)]

    @property
    def meridian(self) -> Curve:
        """A line along the axis."""
        return Line(point=np.asarray(self.center) + self.radius * self._basis[0], direction=self.axis)


@dataclass(frozen=True, kw_only=True, repr=False)
class Cone(Turned):
    """A cone, from its apex at the centre."""

    kind = "cone"
    half_angle: Annotated[float, POSITIVE("between axis and surface, below 90 degrees", PURE, degrees=True)]

    @property
    def meridian(self) -> Curve:
        """A line from the apex."""
        direction = np.sin(self.half_angle) * self._basis[0] + np.cos(self.half_angle) * self._basis[2]
        return Line(point=self.center, direction=direction)

    @property
    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The apex."""
        return NO_ENDS, (0.0, np.inf)

    def faults(self, where: str) -> list[str]:
        """An angle that makes no cone."""
        found = super().faults(where)
        return found or (
            [] if self.half_angle < WHOLE_TURN / 4 else [wrong(self.half_angle, where + "half_angle", "below pi/2")]
        )


@dataclass(frozen=True, kw_only=True, repr=False)
class Torus(Turned):
    """A torus."""

    kind = "torus"
    radius: Annotated[float, POSITIVE("radius of the circle of centres", LENGTH)]
    tube: Annotated[float, POSITIVE("radius of the tube, below that", LENGTH)]

    @property
    def meridian(self) -> Curve:
        """A circle."""
        return self._circle(self.tube, self.radius)

    def faults(self, where: str) -> list[str]:
        """Radii that make no torus."""
        found = super().faults(where)
        return found or (
            [] if self.tube < self.radius else [wrong(self.tube, where + "tube", f"below {self.radius:g}")]
        )


@dataclass(frozen=True, kw_only=True, repr=False)
class Revolution(Turned):
    """A curve turned about the axis."""

    kind = "revolution"
    profile: Annotated[Curve, NESTED("the curve", table="curve")]

    @property
    def meridian(self) -> Curve:
        """As declared."""
        return self.profile

    def faults(self, where: str) -> list[str]:
        """Those of the curve."""
        if not isinstance(self.profile, Curve):
            return [wrong(self.profile, where + "profile", "a Curve")]
        return super().faults(where) + self.profile.faults(f"{where}profile.")


def _ahead(known: Array, u: Array, v: Array) -> Array:
    """Position and derivatives at complex parameters from ten up to the third at their real parts, by Taylor's series."""
    if not (np.iscomplexobj(u) or np.iscomplexobj(v)):
        return known[:6]
    by_u, by_v = known[[1, 3, 4, 6, 7, 8]], known[[2, 4, 5, 7, 8, 9]]
    return np.asarray(known[:6] + 1j * (u.imag * by_u + v.imag * by_v))


ORDERS_UV = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3))
"""Derivatives by u and v, in their order."""


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
        U, V = (
            [one(np.asarray(at.real, dtype=float).ravel()) for one in basis]
            for basis, at in ((along_u, u), (along_v, v))
        )
        known = np.stack([np.einsum("ti,tj,ijc->ct", U[i], V[j], grid, optimize=True) for i, j in ORDERS_UV])
        return _ahead(known.reshape(10, 3, *u.shape), u, v)

    @property
    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The edges."""
        return (0.0, 1.0), (0.0, 1.0)

    def faults(self, where: str) -> list[str]:
        """A grid that makes no surface."""
        found = super().faults(where)
        n = len(self.points) if not found else 0
        if not found and (self.rows < 4 or n % self.rows or n // self.rows < 4):
            found.append(f"{where}rows = {self.rows}: {n} points make no grid of 4 or more rows and columns")
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
        """What the function returns."""
        given = self.position(*(np.asarray(at.real, dtype=float).ravel() for at in (u, v)))
        known = np.stack([np.broadcast_to(part, (3, u.size)) for part in given])
        return _ahead(known.reshape(10, 3, *u.shape), u, v)

    @property
    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """As declared."""
        return tuple(self.ends_u), tuple(self.ends_v)


SURFACES: dict[str, type[Surface]] = {
    kind.kind: kind for kind in (Plane, Sphere, Cylinder, Cone, Torus, Revolution, Patch, ByFunction)
}
"""Surfaces by the names that they have in files."""
Surface.plane, Surface.sphere, Surface.cylinder, Surface.cone = Plane, Sphere, Cylinder, Cone
Surface.torus, Surface.revolution, Surface.patch, Surface.function = Torus, Revolution, Patch, ByFunction


@dataclass(frozen=True)
class OnSurface(Factor):
    """A frame that lies on a surface: z its normal, x along u; coordinates are lengths along u and v where they are zero.

    D(q) = F(home)^-1 F(home + q / sizes), ``sizes`` being ``|x_u|`` and ``|x_v|`` at home; ``turned`` has the normal the other way round.
    Without a surface it is a place for one: it can be counted, not evaluated.
    """

    surface: Surface | None = None
    home: tuple[float, float] = (0.0, 0.0)
    turned: bool = False
    unit: float = 1.0

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Slides along both parameters."""
        return Freedom("Tu", UNIT_TWISTS["Tx"]), Freedom("Tv", UNIT_TWISTS["Ty"])

    @property
    def kind(self) -> Hashable:
        """Each by itself."""
        return self

    @cached_property
    def sizes(self) -> Array:
        """Lengths per parameter at home."""
        assert self.surface is not None
        return np.linalg.norm(self.surface.at(*np.array(self.home)[:, None])[1:3, :, 0], axis=1)

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """The ends of the surface."""
        assert self.surface is not None
        parts = zip(self.surface.ends, self.home, self.sizes / self.unit, strict=True)
        return tuple(((low - at) * size, (high - at) * size) for (low, high), at, size in parts)

    @property
    def outline(self) -> tuple[Array, ...]:
        """Lines of the surface about the frame at coordinates zero, on both sides of it as far as it goes, at most its size at home."""
        if self.surface is None:
            return ()
        ranges = [(max(low, -size), min(high, size)) for (low, high), size in zip(self.ranges, self.sizes, strict=True)]
        u, v = (np.linspace(*ends, SURFACE_LINES) for ends in ranges)
        x = np.stack(np.meshgrid(u, v))
        p = self._here(x)[0] - self.start[:, 3].reshape(3, 1, 1)
        grid = np.tensordot(p, self.start[:, :3], (0, 0)) / self.unit
        return (*grid, *grid.swapaxes(0, 1))

    def _here(self, x: Array) -> tuple[Array, Array, Array]:
        """Position, axes ``(3, 3, ...)`` and twists about the point ``(6, 2, ...)``, in the frame of the link."""
        assert self.surface is not None
        su, sv = self.sizes
        J = self.surface.at(self.home[0] + self.unit / su * x[0], self.home[1] + self.unit / sv * x[1])
        x_, xu, xv = J[0], J[1] / su, J[2] / sv
        second = self.unit * np.stack([J[3] / su**2, J[4] / (su * sv), J[5] / sv**2])
        lu, N = np.sqrt((xu * xu).sum(axis=0)), cross(xu, xv)
        ln, up = np.sqrt((N * N).sum(axis=0)), -1.0 if self.turned else 1.0
        e1, n = xu / lu, up * N / ln
        axes = (e1, cross(n, e1), n)
        twists = []
        for xa, xua, xva in ((xu, second[0], second[1]), (xv, second[1], second[2])):
            de1 = (xua - e1 * (e1 * xua).sum(axis=0)) / lu
            dN = up * (cross(xua, xv) + cross(xu, xva))
            dn = (dN - n * (n * dN).sum(axis=0)) / ln
            rates = (de1, cross(dn, e1) + cross(n, de1), dn)
            w = 0.5 * sum(cross(e, de) for e, de in zip(axes, rates, strict=True))
            twists.append(np.concatenate([w, xa]))
        return x_, np.stack(axes, axis=1), np.stack(twists, axis=1)

    @cached_property
    def start(self) -> Array:
        """The frame at coordinates zero on its link ``(3, 4)``."""
        x, R, _ = self._here(np.zeros((2, 1)))
        return np.concatenate([R, x[:, None]], axis=1)[..., 0]

    def pose(self, x: Array, pitch: Array) -> Array:
        """Value of the motion."""
        p, R, _ = self._here(x)
        R0, p0 = self.start[:, :3], self.start[:, 3].reshape(3, *(1,) * (p.ndim - 1))
        return np.concatenate(
            [np.tensordot(R0, R, (0, 0)), np.tensordot(R0, (p - p0) / self.unit, (0, 0))[:, None]], axis=1
        )

    def twists(self, x: Array, pitch: Array) -> Array:
        """``(w, x_a + w x (p - x))`` for both parameters, p the origin of the frame before it."""
        p, _, S = self._here(x)
        off = ((p - self.start[:, 3].reshape(3, *(1,) * (p.ndim - 1))) / self.unit)[:, None]
        v = S[3:] - cross(S[:3], np.broadcast_to(off, S[:3].shape))
        return np.concatenate([np.tensordot(self.start[:, :3], part, (0, 0)) for part in (S[:3], v)])

    def twist_rates(self, x: Array, dq: Array, pitch: Array) -> Array:
        """The derivative of ``sum_j S_j q'_j`` along ``q'``, by a complex step: exact."""
        ahead: Array = x.real + 1j * COMPLEX_STEP * dq.real
        return np.asarray((self.twists(ahead, pitch) * dq).sum(axis=1).imag / COMPLEX_STEP)

    def scaled(self, L: float) -> Factor:
        """With lengths over ``L``."""
        return self if self.surface is None else replace(self, unit=self.unit * L)
