"""Factors of frames that travel along a curve, on link a or on link b, and on a surface."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from mechgraph.errors import DeclarationError, ShapeError
from mechgraph.maths.se3 import Array, cross
from mechgraph.maths.tolerances import COMPLEX_STEP, SHAPES
from mechgraph.memo import dataclass
from mechgraph.pairs.curves import ORDERS, Curve, CurvePlace, Travel, outside, point_text, shape_faults, turned
from mechgraph.pairs.factors import UNIT_TWISTS, Factor, Freedom, PoseStack, Stack, entries
from mechgraph.quantities import LENGTH, is_numeric, wrong


class Travelling(Factor):
    """A frame on what a link bears, lengths over ``unit``: ``D = F(0)^-1 F(q)``; ``pair`` is its name in messages.

    ``place_of(x)`` evaluates what it travels on; from that follow the pose, the twists and their rates.
    """

    unit: float
    pair: str

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
    orders = ORDERS

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
        hollow = side * travel.curvature(travel.s)
        worst = int(np.argmax(hollow))
        if distance * hollow[worst] >= 1 - SHAPES.standstill:
            at = point_text(travel.at(travel.s[worst : worst + 1]).x[:, 0])
            why = f"the profile is hollow with the radius {1 / hollow[worst] + curve.roller:.6g} at {at}"
            fault = f"radius = {radius:.6g}: {why}; take a cutter smaller than that"
            raise DeclarationError("cutter path", [fault])
    return Beside(base=curve, distance=side * distance)


def extent(shape: Any, x: Array) -> float:
    """The greatest length among those declared of a curve or surface and the coordinates of its point ``x (3,)``."""
    named = [getattr(shape, name) for name, of in shape.formats.items() if of.slide == LENGTH]
    return max(float(np.abs(values).max()) for values in (x, *(v for v in named if v is not None)))


def rounded(at: float, size: float) -> float:
    """A place to ``SHAPES.place`` of the ``size`` of the numbers behind it; steps are powers of two: sizes near by have the same."""
    step = math.ldexp(1.0, math.frexp(SHAPES.place * size)[1])
    return step * round(at / step)


def across(curve: Curve, place: AlongCurve, z: Sequence[float] | Array | None) -> Curve:
    """The curve; a straight one, which lies in many planes, in that at right angles to ``z`` where the frame has one; if that is left out
    and it lies in the x-y plane, in that, with y towards the axis that is closer to it.
    """
    travel: Travel = curve.once(Travel)
    if place.tangent != X or not travel.is_straight or curve.guide is not None:
        return curve
    here = travel.at(np.zeros(1))
    k, y, t = here.k[:, 0], here.y[:, 0], here.t[:, 0]
    if z is None and not t[2]:
        z = (0.0, 0.0, 1.0 if (t[0] if abs(t[0]) >= abs(t[1]) else -t[1]) > 0 else -1.0)
    if z is None:
        return curve
    # digits to which the direction of a plane is rounded, for the same reason
    along, beside = (round(v / float(np.linalg.norm(z)), 12) for v in (k @ np.asarray(z), y @ np.asarray(z)))
    return curve.replace(frame="guided", guide=along * k + beside * y) if beside or along < 0.0 else curve


def center_path(curve: Curve, roller: float | None, point: Sequence[float] | None) -> Curve:
    """The curve itself, or that of the center of a roller, on the side of the point, or outside."""
    return Beside(base=curve, distance=side_of(curve, point) * roller) if roller else curve


def side_of(curve: Curve, point: Sequence[float] | None) -> float:
    """1 where the point lies towards y of the frame, or that is outside; else -1."""
    travel: Travel = curve.once(Travel)
    if point is None:
        return outside(curve) if curve.is_closed else 1.0
    s, _ = travel.nearest(np.asarray(point))
    here = travel.at(np.array(s))
    return 1.0 if (np.asarray(point) - here.x) @ here.y > 0 else -1.0


def placed_on(place: AlongCurve, curve: Curve, point: Sequence[float] | Array | None) -> AlongCurve:
    """The factor on a curve, at home in the place nearest to the point."""
    travel: Travel = curve.once(Travel)
    ends = np.isfinite(travel.begin)
    home = (travel.begin if ends else 0.0) if point is None else travel.nearest(np.asarray(point))[0]
    size = max(extent(curve, travel.at(np.array(home)).x), travel.length if ends else 0.0)
    # the end of a closed curve is where it begins
    again = travel.is_closed and travel.length - home < SHAPES.place * size
    return replace(place, curve=curve, home=0.0 if again else rounded(home, size))


def missed_by(factor: AlongCurve, point: Sequence[float] | Array | None) -> float:
    """How far the frame at home is from the point."""
    return 0.0 if point is None else float(np.linalg.norm(factor.start[:, 3] - point))
