"""The factor of a marker frame that travels along a curve, on link a or on link b; and the curve beside a curve, on which rollers run."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np

from mechgraph.algebra.se3 import Array, Library, by_components, cross
from mechgraph.model.curves import ORDERS, Curve
from mechgraph.model.factors import Factor
from mechgraph.model.row_parts import UNIT_TWISTS, Freedom
from mechgraph.model.travel import COMPLEX_STEP, Place, Travel
from mechgraph.model.travelling import Travelling

X, Z = 0, 2
"""Axes of the frame that may be the tangent."""


CURVE_POINTS = 181
"""Points by which a curve is drawn."""


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
        s = np.linspace(self.travel.s[0], self.travel.s[-1], CURVE_POINTS) + (self.home if endless else 0.0)
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

    def _frame(self, here: Place) -> Array:
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

    def place_of(self, x: Array) -> Place:
        """The curve where the coordinate is ``x (1, ...)``, lengths in its own unit."""
        here = self.travel.at(self.home + (-self.unit if self.reversed else self.unit) * x[0])
        return replace(here, w=0.0 * here.w, dw=0.0 * here.dw) if self.held else here

    def pose_at(self, here: Place) -> Array:
        """The pose where the curve is ``here``."""
        R = self._frame(here)
        if not self.back:
            return self._pose_seen(R, here.x)
        R0, behind = self.start[:, :3], -self._off(here.x)
        return np.concatenate([np.einsum("ji...,jk->ik...", R, R0), (R * behind[:, None]).sum(axis=0)[:, None]], axis=1)

    def twists_at(self, here: Place) -> Array:
        """``(w, t + w x (p - x))``; on the side of link b minus ``(R^T w, R^T t)``."""
        w, sense = self.unit * here.w, -1.0 if self.reversed != self.back else 1.0
        return sense * self._screw(here, w, here.t)[:, None]

    def twist_rates_at(self, here: Place, x: Array, dq: Array) -> Array:
        """Their derivatives by the coordinate, times the rate squared."""
        w, dw = self.unit * here.w, self.unit**2 * here.dw
        sense = -1.0 if self.back else 1.0
        return sense * dq[0] ** 2 * self._screw(here, dw, self.unit * here.dt - cross(w, here.t))

    def _screw(self, here: Place, w: Array, v: Array) -> Array:
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
    """The curve at a ``distance`` from a plane curve, towards its normal y, by the arc length of that: where a roller's centre goes."""

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
        rates = self._offset(here.t, here.y, np.stack([bend, rate, more.imag / COMPLEX_STEP]))
        return np.concatenate([here.x + self.distance * here.y, rates]).reshape(ORDERS, *here.x.shape)

    def place_at(self, u: Array) -> Place | None:
        """With the frame of the curve, which turns over shorter or longer ways: ``c / g`` and ``c' / g^3``, ``g = 1 - d c``."""
        if self._named is not None:
            return None
        here: Place = self.base.once(Travel).at(u)
        g = 1.0 - self.distance * (here.k * here.w).sum(axis=0)
        return replace(here, x=here.x + self.distance * here.y, dt=here.dt / g, w=here.w / g, dw=here.dw / (g * g * g))

    @cached_property
    def _offset(self) -> by_components:
        return by_components(partial(_beside, self.distance))

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


def _beside(d: float, lib: Library, *parts: Any) -> tuple[Any, ...]:
    """Three derivatives of ``x + d y`` from tangent, normal, and curvature with two derivatives."""
    t, y, (k, dk, ddk) = parts[:3], parts[3:6], parts[6:]
    g = 1.0 - d * k
    second, third = (g * k, d * dk), ((g - 2.0 * d * k) * dk, d * ddk + g * k * k)
    return (
        *(g * a for a in t),
        *(second[0] * b - second[1] * a for a, b in zip(t, y, strict=True)),
        *(third[0] * b - third[1] * a for a, b in zip(t, y, strict=True)),
    )
