"""Factors of frames that travel along a curve, on link a or on link b, and on a surface."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Hashable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from mechgraph.errors import DeclarationError, ShapeError
from mechgraph.maths.se3 import Array, cross
from mechgraph.maths.tolerances import COMPLEX_STEP, SHAPES
from mechgraph.memo import dataclass
from mechgraph.pairs.curves import (
    ORDERS,
    Curve,
    CurvePlace,
    Travel,
    outside,
    point_text,
    shape_faults,
    turned,
)
from mechgraph.pairs.factors import UNIT_TWISTS, Factor, Freedom, PoseStack, Stack, entries
from mechgraph.pairs.surfaces import Surface
from mechgraph.quantities import is_numeric, wrong


class Travelling(Factor):
    """A frame on what a link bears, lengths over ``unit``: ``D = F(0)^-1 F(q)``; ``pair`` is its name in messages.

    ``place_of(x)`` evaluates what it travels on; from that follow the pose, the twists and their rates.
    """

    unit: float
    pair: str

    @property
    def kind(self) -> Hashable:
        """Each by itself."""
        return self

    @property
    @abstractmethod
    def start(self) -> Array:
        """The frame at coordinates zero on its link ``(3, 4)``."""

    @property
    @abstractmethod
    def bend(self) -> float:
        """Greatest curvature, over one of ``unit``."""

    @abstractmethod
    def place_of(self, x: Array) -> Any:
        """The place at coordinates ``x``."""

    @abstractmethod
    def pose_at(self, here: Any) -> Array:
        """The pose at a place."""

    @abstractmethod
    def twists_at(self, here: Any) -> Array:
        """The twists at a place."""

    @abstractmethod
    def twist_rates_at(self, here: Any, x: Array, dq: Array) -> Array:
        """The rates of the twists at a place with coordinates ``x``."""

    def here(self, x: Array) -> Any:
        """The place at coordinates ``x``; what its shape cannot answer is named with the pair."""
        with self.named():
            return self.place_of(x)

    @contextmanager
    def named(self) -> Iterator[None]:
        """What a shape cannot answer is named with the pair."""
        try:
            yield
        except ShapeError as error:
            raise error.of(self.pair) from error.__cause__

    def pose(self, x: Array, pitch: Array) -> Array:
        """Value of the motion."""
        return self.pose_at(self.here(x))

    def twists(self, x: Array, pitch: Array) -> Array:
        """Twists ``(w, v + w x (p - x))`` of a frame at x with the rates w and v, p the origin of the frame before the factor."""
        return self.twists_at(self.here(x))

    def twist_rates(self, x: Array, dq: Array, pitch: Array) -> Array:
        """The derivative of ``sum_j S_j q'_j`` along ``q'``."""
        return self.twist_rates_at(self.here(x), x, dq)

    def stack(self, factors: Sequence[Factor], counts: Sequence[int]) -> Stack:
        """Copies evaluated together."""
        return TravellingStack(self)

    def _off(self, p: Array) -> Array:
        """Points ``(3, ...)`` of the link from the origin of the frame at coordinates zero."""
        return (p - self.start[:, 3].reshape(3, *(1,) * (p.ndim - 1))) / self.unit

    def _pose_seen(self, R: Array, p: Array) -> Array:
        """The frame with axes ``R (3, 3, ...)`` at ``p (3, ...)``, seen from that at coordinates zero, ``(3, 4, ...)``."""
        X = np.empty((3, 4, *p.shape[1:]), dtype=p.dtype)
        X[:, :3], X[:, 3] = R, self._off(p)
        return turned(self.start[:, :3].T, X)

    def _screw_seen(self, p: Array, w: Array, v: Array) -> Array:
        """The screw ``(w, v)`` at ``p``, ``(3, ...)`` each, seen from the frame at coordinates zero, ``(w, v + w x (0 - p)) (6, ...)``."""
        screw = np.stack([w, v - cross(w, self._off(p))])
        return np.matmul(self.start[:, :3].T, screw.reshape(2, 3, -1)).reshape(6, *p.shape[1:])


class TravellingStack(PoseStack):
    """Copies of one of them; a place serves poses, twists and rates at the same coordinates."""

    def __init__(self, factor: Travelling) -> None:
        super().__init__(factor)
        self.travelling = factor
        self._last: tuple[Array, Any] | None = None

    def _here(self, x: Array) -> Any:
        last = self._last
        if last is None or last[0].shape != x.shape or np.count_nonzero(last[0] != x):
            last = self._last = x, self.travelling.here(x)
        return last[1]

    def values(self, x: Array) -> Array:
        """Entries of the pose and of its inverse."""
        return entries(self.travelling.pose_at(self._here(x)))

    def twists(self, x: Array, pitch: Array) -> Array:
        """Those of the factor."""
        return self.travelling.twists_at(self._here(x))

    def twist_rates(self, x: Array, dq: Array, pitch: Array) -> Array:
        """Those of the factor."""
        return self.travelling.twist_rates_at(self._here(x), x, dq)


X, Z = 0, 2
"""Axes of the frame that may be the tangent."""


@dataclass(frozen=True)
class AlongCurve(Travelling):
    """A frame that travels along a curve by the arc length ``q``, from where it is the frame before the factor.

        D(q) = F(home)^-1 F(home + q);   on the side of link b, D(q) = F(home + q)^-1 F(home)

    The tangent is the axis ``tangent`` of the frame (x: y is the normal in the plane and z that of the plane; z: x and y are those).
    ``reversed`` travels against the arc length of the curve, ``turned`` has the normal of the plane the other way round; ``unit`` is the
    length that counts as one, ``pair`` the name for messages. Without a curve it is a place for one: it can be counted, not evaluated.
    """

    name: str
    tangent: int
    back: bool = False
    curve: Curve | None = None
    home: float = 0.0
    reversed: bool = False
    turned: bool = False
    unit: float = 1.0
    pair: str = field(default="", compare=False)

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """A slide along the tangent."""
        return (Freedom(self.name, UNIT_TWISTS["Tx" if self.tangent == X else "Tz"]),)

    @property
    def travel(self) -> Travel:
        """The curve by its arc length."""
        assert self.curve is not None
        return self.curve.once(Travel)

    @property
    def ranges(self) -> tuple[tuple[float, float], ...]:
        """The ends of an open curve."""
        low, high = ((end - self.home) / self.unit for end in (self.travel.begin, self.travel.end))
        if self.travel.is_closed:
            return ((-np.inf, np.inf),)
        return ((-high, -low) if self.reversed else (low, high),)

    @property
    def periods(self) -> tuple[float, ...]:
        """The length of a closed curve."""
        return (self.travel.length / self.unit if self.travel.is_closed else np.inf,)

    @property
    def outline(self) -> tuple[Array, ...]:
        """The curve, seen from the frame at coordinate zero: the one before the factor, or on the side of link b the one behind it.

        Endless lines have none; of an endless helix it is one turn to either side.
        """
        if self.curve is None or ((endless := np.isinf(self.travel.begin)) and self.travel.is_plane):
            return ()
        # points by which a curve is drawn
        s = np.linspace(self.travel.s[0], self.travel.s[-1], 181) + (self.home if endless else 0.0)
        x = self.travel.at(s).x
        return (((x.T - self.start[:, 3]) / self.unit) @ self.start[:, :3],)

    @property
    def sideways(self) -> float:
        """1 where y of the frame is the normal y of the curve, -1 where it is opposite."""
        return (-1.0 if self.reversed else 1.0) * (-1.0 if self.turned else 1.0)

    def curvatures(self, x: Array) -> Array:
        """Curvature towards x, y and z of the frame ``(3, ...)`` at coordinates ``(...)``; none towards the tangent."""
        here = self.here(x[None])
        return np.asarray((self._frame(here) * here.dt[:, None]).sum(axis=0))

    @cached_property
    def bend(self) -> float:
        """At the points between which the curve is smooth."""
        with self.named():
            return self.unit * float(np.abs(self.travel.curvature(self.travel.s)).max())

    @cached_property
    def held(self) -> bool:
        """Whether the frame keeps its orientation."""
        return self.curve is not None and self.curve.frame == "held"

    def _frame(self, here: CurvePlace) -> Array:
        """The frame ``(3, 3, ...)`` where the curve is ``here``."""
        if self.held:
            return np.broadcast_to(self.start[:, :3].reshape(3, 3, *(1,) * (here.t.ndim - 1)), (3, *here.t.shape))
        return self._axes(here.t, here.y, here.k)

    def _axes(self, t: Array, y: Array, k: Array) -> Array:
        """The frame ``(3, 3, ...)``, columns its axes."""
        along, up = -1.0 if self.reversed else 1.0, -1.0 if self.turned else 1.0
        columns = (along * t, along * up * y, up * k)
        return np.stack(columns if self.tangent == X else (*columns[1:], columns[0]), axis=1)

    @cached_property
    def start(self) -> Array:
        """The frame at coordinate zero on its link ``(3, 4)``."""
        here = self.travel.at(np.array(self.home))
        return np.column_stack([self._axes(here.t, here.y, here.k), here.x])

    def place_of(self, x: Array) -> CurvePlace:
        """The curve where the coordinate is ``x (1, ...)``, lengths in its own unit."""
        here = self.travel.at(self.home + (-self.unit if self.reversed else self.unit) * x[0])
        return replace(here, w=0.0 * here.w, dw=0.0 * here.dw) if self.held else here

    def pose_at(self, here: CurvePlace) -> Array:
        """The pose where the curve is ``here``."""
        R = self._frame(here)
        if not self.back:
            return self._pose_seen(R, here.x)
        R0, behind = self.start[:, :3], -self._off(here.x)
        return np.concatenate([np.einsum("ji...,jk->ik...", R, R0), (R * behind[:, None]).sum(axis=0)[:, None]], axis=1)

    def twists_at(self, here: CurvePlace) -> Array:
        """``(w, t + w x (p - x))``; on the side of link b minus ``(R^T w, R^T t)``."""
        w, sense = self.unit * here.w, -1.0 if self.reversed != self.back else 1.0
        return sense * self._screw(here, w, here.t)[:, None]

    def twist_rates_at(self, here: CurvePlace, x: Array, dq: Array) -> Array:
        """Their derivatives by the coordinate, times the rate squared."""
        w, dw = self.unit * here.w, self.unit**2 * here.dw
        sense = -1.0 if self.back else 1.0
        return sense * dq[0] ** 2 * self._screw(here, dw, self.unit * here.dt - cross(w, here.t))

    def _screw(self, here: CurvePlace, w: Array, v: Array) -> Array:
        """A screw at the point of the curve, seen from the frame before the factor ``(6, ...)``."""
        if self.back:
            R = self._frame(here)
            return np.concatenate([(R * part[:, None]).sum(axis=0) for part in (w, v)])
        return self._screw_seen(here.x, w, v)

    def scaled(self, L: float) -> Factor:
        """With lengths over ``L``."""
        return self if self.curve is None else replace(self, unit=self.unit * L)


@dataclass(frozen=True, kw_only=True, repr=False)
class Beside(Curve):
    """The curve at a ``distance`` from a plane curve, towards its normal y, by the arc length of that: where a roller's center goes."""

    kind: ClassVar[str] = "beside"
    base: Curve
    distance: float

    @cached_property
    def _named(self) -> Curve | None:
        """The same as a curve with a name, by its own parameter: beside a line is a line, beside a circle a circle."""
        travel: Travel = self.base.once(Travel)
        begin = np.array([travel.begin if np.isfinite(travel.begin) else 0.0])
        return self.base.beside(self.distance, travel.at(begin).y[:, 0])

    def at(self, u: Array) -> Array:
        """``x + d y``, with ``t' = k y`` and ``y' = -k t``; three derivatives."""
        if self._named is not None:
            return self._named.at(u)
        travel: Travel = self.base.once(Travel)
        step: Array = u.real + 1j * COMPLEX_STEP  # type: ignore[assignment]
        ahead = travel.at(step)
        here = travel.at(u) if np.iscomplexobj(u) else ahead.real
        (bend, rate), (_, more) = ([(p.k * turn).sum(axis=0) for turn in (p.w, p.dw)] for p in (here, ahead))
        d, t, y, k, dk, ddk = self.distance, here.t, here.y, bend, rate, more.imag / COMPLEX_STEP
        g = 1.0 - d * k
        second = g * k * y - d * dk * t
        third = (g - 2.0 * d * k) * dk * y - (d * ddk + g * k * k) * t
        return np.stack([here.x + d * y, g * t, second, third])

    def place_at(self, u: Array) -> CurvePlace | None:
        """With the frame of the curve, which turns over shorter or longer ways: ``c / g`` and ``c' / g^3``, ``g = 1 - d c``."""
        if self._named is not None:
            return None
        here: CurvePlace = self.base.once(Travel).at(u)
        g = 1.0 - self.distance * (here.k * here.w).sum(axis=0)
        return replace(here, x=here.x + self.distance * here.y, dt=here.dt / g, w=here.w / g, dw=here.dw / (g * g * g))

    @property
    def ends(self) -> tuple[float, float]:
        """Those of the curve."""
        if self._named is not None:
            return self._named.ends
        travel: Travel = self.base.once(Travel)
        return travel.begin, travel.end

    @property
    def speed(self) -> float | None:
        """That of a curve with a name."""
        return None if self._named is None else self._named.speed

    @property
    def orders(self) -> int:
        """Three derivatives."""
        return ORDERS

    @property
    def is_closed(self) -> bool:
        """As the curve."""
        return self.base.is_closed

    @property
    def normal(self) -> Array:
        """As the curve."""
        return self.base.once(Travel).guide

    @cached_property
    def grid(self) -> Array:
        """As the curve."""
        return self.base.once(Travel).s if self._named is None else self._named.grid


def cutter_path(curve: Curve, radius: float) -> Curve:
    """See ``Curve.cutter_path``."""
    if not (is_numeric(radius, ()) and radius >= 0):
        raise DeclarationError("cutter path", [wrong(radius, "radius", "0 or more")])
    found = curve.faults("") or shape_faults(curve, "curve")
    if found:
        raise DeclarationError("cutter path", found)
    travel: Travel = curve.once(Travel)
    distance = radius - curve.roller
    if distance == 0:
        return curve
    if travel.is_groove:
        where = f"a groove is cut along the path of its roller, with a cutter of radius {curve.roller:.6g}"
        raise DeclarationError("cutter path", [wrong(radius, "radius", where)])
    if not (travel.is_plane and curve.is_closed):
        raise DeclarationError("cutter path", [f"curve: is a {curve.kind} that is not plane and closed; a profile is"])
    side = outside(curve)
    if distance > 0:
        words = f"radius = {radius:.6g}: "
        hollow = side * travel.curvature(travel.s)
        worst = int(np.argmax(hollow))
        if distance * hollow[worst] >= 1 - SHAPES.standstill:
            at = point_text(travel.at(travel.s[worst : worst + 1]).x[:, 0])
            largest = 1 / hollow[worst] + curve.roller
            raise DeclarationError(
                "cutter path",
                [
                    f"{words}the profile is hollow with the radius {largest:.6g} at {at}; take a cutter smaller than that"
                ],
            )
    return Beside(base=curve, distance=side * distance)


@dataclass(frozen=True)
class OnSurface(Travelling):
    """A frame that lies on a surface: z its normal, x along u; coordinates are lengths along u and v where they are zero.

    D(q) = F(home)^-1 F(home + q / sizes), ``sizes`` being ``|x_u|`` and ``|x_v|`` at home; ``turned`` has the normal the other way round;
    ``pair`` is the name for messages.
    Without a surface it is a place for one: it can be counted, not evaluated.
    """

    surface: Surface | None = None
    home: tuple[float, float] = (0.0, 0.0)
    turned: bool = False
    unit: float = 1.0
    pair: str = field(default="", compare=False)

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Slides along both parameters."""
        return Freedom("Tu", UNIT_TWISTS["Tx"]), Freedom("Tv", UNIT_TWISTS["Ty"])

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
    def periods(self) -> tuple[float, ...]:
        """Lengths after which the surface returns into itself."""
        assert self.surface is not None
        return tuple((np.array(self.surface.periods) * self.sizes / self.unit).tolist())

    @property
    def outline(self) -> tuple[Array, ...]:
        """Lines of the surface about the frame at coordinates zero, on both sides of it as far as it goes, at most its size at home."""
        if self.surface is None:
            return ()
        ranges = [(max(low, -size), min(high, size)) for (low, high), size in zip(self.ranges, self.sizes, strict=True)]
        # lines each way by which a surface is drawn
        u, v = (np.linspace(*ends, 9) for ends in ranges)
        x = np.stack(np.meshgrid(u, v))
        p = self.here(x)[0] - self.start[:, 3].reshape(3, 1, 1)
        grid = np.tensordot(p, self.start[:, :3], (0, 0)) / self.unit
        return (*grid, *grid.swapaxes(0, 1))

    def curvatures(self, x: Array) -> Array:
        """Principal curvatures ``(2, ...)`` towards z of the frame at coordinates ``(2, ...)``."""
        assert self.surface is not None
        found = self.surface.curvatures(*self._parameters(x))
        return -found[::-1] if self.turned else found

    @cached_property
    def bend(self) -> float:
        """Where the surface is looked at, and at coordinates zero."""
        assert self.surface is not None
        with self.named():
            here = np.abs(self.surface.curvatures(*np.array(self.home)[:, None])).max()
            return self.unit * max(self.surface.bend, float(here))

    def _parameters(self, x: Array) -> Array:
        """Parameters ``(2, ...)`` at coordinates ``(2, ...)``."""
        return np.stack([at + self.unit / size * q for at, size, q in zip(self.home, self.sizes, x, strict=True)])

    def points(self, x: Array) -> Array:
        """Points ``(3, ...)`` at coordinates ``(2, ...)``, in the frame of the link."""
        return self.here(x)[0]

    def from_pole(self, x: Array) -> Array:
        """Ways ``(2, ...)`` from a pole of the parameters at coordinates ``(2, ...)``, over the radius."""
        assert self.surface is not None
        return self.surface.from_pole(*self._parameters(x))

    def coordinates_at(self, p: Array) -> Array:
        """Coordinates ``(2,)`` of the point of the surface that is nearest to ``p (3,)``."""
        assert self.surface is not None
        return (np.array(self.surface.nearest(p)) - self.home) * self.sizes / self.unit

    def place_of(self, x: Array) -> tuple[Array, Array, Array]:
        """Position, axes ``(3, 3, ...)`` and twists about the point ``(6, 2, ...)``, in the frame of the link."""
        assert self.surface is not None
        su, sv = self.sizes
        u, v = self._parameters(x)
        J, sense = self.surface.at(u, v), self.surface.sense(u, v)
        x_, xu, xv = J[0], J[1] / su, J[2] / sv
        second = self.unit * np.stack([J[3] / su**2, J[4] / (su * sv), J[5] / sv**2])
        lu, N = sense * np.sqrt((xu * xu).sum(axis=0)), cross(xu, xv)
        ln, up = sense * np.sqrt((N * N).sum(axis=0)), -1.0 if self.turned else 1.0
        e1, n = xu / lu, up * N / ln
        axes = (e1, cross(n, e1), n)
        twists = []
        for xa, xua, xva in ((xu, second[0], second[1]), (xv, second[1], second[2])):
            # but for parts along e1 and n, in which lengths change: in w they meet themselves, c e1 x e1 and c e2 x e2
            de1, dn = xua / lu, up * (cross(xua, xv) + cross(xu, xva)) / ln
            rates = (de1, cross(dn, e1) + cross(n, de1), dn)
            w = 0.5 * sum(cross(e, de) for e, de in zip(axes, rates, strict=True))
            twists.append(np.concatenate([w, xa]))
        return x_, np.stack(axes, axis=1), np.stack(twists, axis=1)

    @cached_property
    def start(self) -> Array:
        """The frame at coordinates zero on its link ``(3, 4)``."""
        x, R, _ = self.here(np.zeros((2, 1)))
        return np.concatenate([R, x[:, None]], axis=1)[..., 0]

    def pose_at(self, here: tuple[Array, Array, Array]) -> Array:
        """Value of the motion."""
        p, R, _ = here
        return self._pose_seen(R, p)

    def twists_at(self, here: tuple[Array, Array, Array]) -> Array:
        """``(w, x_a + w x (p - x))`` for both parameters."""
        p, _, S = here
        return np.stack([self._screw_seen(p, S[:3, a], S[3:, a]) for a in range(2)], axis=1)

    def twist_rates_at(self, here: tuple[Array, Array, Array], x: Array, dq: Array) -> Array:
        """The derivative of ``sum_j S_j q'_j`` along ``q'``, by a complex step: exact."""
        ahead: Array = x.real + 1j * COMPLEX_STEP * dq.real
        return np.asarray((self.twists_at(self.here(ahead)) * dq).sum(axis=1).imag / COMPLEX_STEP)

    def scaled(self, L: float) -> Factor:
        """With lengths over ``L``."""
        return self if self.surface is None else replace(self, unit=self.unit * L)
