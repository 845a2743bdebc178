"""The factor of a marker frame that travels along a curve, on link a or on link b; and the curve beside a curve, on which rollers run."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from mechgraph.algebra.se3 import Array, cross
from mechgraph.model.curves import ORDERS, Curve
from mechgraph.model.factors import Factor
from mechgraph.model.row_parts import UNIT_TWISTS, Freedom
from mechgraph.model.travel import COMPLEX_STEP, Travel

X, Z = 0, 2
"""Axes of the frame that may be the tangent."""


@dataclass(frozen=True)
class AlongCurve(Factor):
    """A frame that travels along a curve by the arc length ``q``, from where it is the frame before the factor.

        D(q) = F(home)^-1 F(home + q);   on the side of link b, D(q) = F(home + q)^-1 F(home)

    The tangent is the axis ``tangent`` of the frame (x: y is the normal in the plane and z that of the plane; z: x and y are those).
    ``reversed`` travels against the arc length of the curve, ``turned`` has the normal of the plane the other way round; ``unit`` is the
    length that counts as one. Without a curve it is a place for one: it can be counted, not evaluated.
    """

    name: str
    tangent: int
    back: bool = False
    curve: Curve | None = None
    home: float = 0.0
    reversed: bool = False
    turned: bool = False
    unit: float = 1.0

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """A slide along the tangent."""
        return (Freedom(self.name, UNIT_TWISTS["Tx" if self.tangent == X else "Tz"]),)

    @property
    def kind(self) -> Hashable:
        """Each by itself."""
        return self

    @property
    def travel(self) -> Travel:
        """The curve by its arc length."""
        assert self.curve is not None
        return self.curve.once(Travel)

    @property
    def range(self) -> tuple[float, float]:
        """Least and greatest coordinate; infinite where the curve does not end."""
        low, high = ((end - self.home) / self.unit for end in (self.travel.begin, self.travel.end))
        if self.travel.is_closed:
            return -np.inf, np.inf
        return (-high, -low) if self.reversed else (low, high)

    @property
    def sideways(self) -> float:
        """1 where y of the frame is the normal y of the curve, -1 where it is opposite."""
        return (-1.0 if self.reversed else 1.0) * (-1.0 if self.turned else 1.0)

    def curvature(self, x: Array) -> Array:
        """Curvature towards y of the frame at coordinates ``(...)``."""
        here = self.travel.at(self._arc(x[None]))
        return self.sideways * (here.dt * here.y).sum(axis=0)

    def _arc(self, x: Array) -> Array:
        return self.home + (-self.unit if self.reversed else self.unit) * x[0]

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

    def pose(self, x: Array, pitch: Array) -> Array:
        """Value of the motion."""
        here = self.travel.at(self._arc(x))
        R = np.einsum("ji,jk...->ik...", self.start[:, :3], self._axes(here.t, here.y, here.k))
        p = np.einsum("ji,j...->i...", self.start[:, :3], (here.x - self.start[:, 3:, None]) / self.unit)
        if self.back:
            R = R.swapaxes(0, 1)
            p = -np.einsum("ij...,j...->i...", R, p)
        return np.concatenate([R, p[:, None]], axis=1)

    def twists(self, x: Array, pitch: Array) -> Array:
        """``(w, t + w x (p - x))``, p the origin of the frame before it; on the side of link b minus ``(R^T w, R^T t)``."""
        here = self.travel.at(self._arc(x))
        w, v, R = self.unit * here.w, here.t, self.start[:, :3, None, None]
        if self.back:
            w, v, R = -w, -v, self._axes(here.t, here.y, here.k)
        else:
            v = v - cross(w, (here.x - self.start[:, 3:, None]) / self.unit)
        sense = -1.0 if self.reversed else 1.0
        return sense * np.concatenate([np.einsum("ji...,j...->i...", R, part) for part in (w, v)])[:, None]

    def twist_rates(self, x: Array, dq: Array, pitch: Array) -> Array:
        """Their derivatives by the coordinate, times the rate squared."""
        here = self.travel.at(self._arc(x))
        w, dw, dt = self.unit * here.w, self.unit**2 * here.dw, self.unit * here.dt
        dv, R = dt - cross(w, here.t), self.start[:, :3, None, None]
        if self.back:
            dw, dv, R = -dw, -dv, self._axes(here.t, here.y, here.k)
        else:
            dv = dv - cross(dw, (here.x - self.start[:, 3:, None]) / self.unit)
        out = np.concatenate([np.einsum("ji...,j...->i...", R, part) for part in (dw, dv)])
        return np.asarray(out * dq[0] ** 2)

    def scaled(self, L: float) -> Factor:
        """With lengths over ``L``."""
        return self if self.curve is None else replace(self, unit=self.unit * L)


@dataclass(frozen=True, kw_only=True, repr=False)
class Beside(Curve):
    """The curve at a ``distance`` from a plane curve, towards its normal y, by the arc length of that: where a roller's centre goes."""

    kind: ClassVar[str] = "beside"
    base: Curve
    distance: float

    def at(self, u: Array) -> Array:
        """``x + d y``, with ``t' = k y`` and ``y' = -k t``; three derivatives."""
        travel: Travel = self.base.once(Travel)
        x, t, dt, ddt, y, *_ = travel.guided(u)
        k, dk = (dt * y).sum(axis=0), (ddt * y).sum(axis=0)
        step: Array = u.real + 1j * COMPLEX_STEP  # type: ignore[assignment]
        _, _, _, ahead, sideways, *_ = travel.guided(step)
        ddk = (ahead * sideways).sum(axis=0).imag / COMPLEX_STEP
        d, g = self.distance, 1.0 - self.distance * k
        out = np.zeros((ORDERS, *x.shape), dtype=x.dtype)
        out[0], out[1] = x + d * y, g * t
        out[2] = g * k * y - d * dk * t
        out[3] = (g - 2 * d * k) * dk * y - (d * ddk + g * k * k) * t
        return out

    @property
    def ends(self) -> tuple[float, float]:
        """Those of the curve."""
        travel: Travel = self.base.once(Travel)
        return travel.begin, travel.end

    @property
    def orders(self) -> int:
        """Three derivatives."""
        return ORDERS - 1

    @property
    def is_closed(self) -> bool:
        """As the curve."""
        return self.base.is_closed

    @property
    def normal(self) -> Array:
        """As the curve."""
        return self.base.once(Travel).guide

    @cached_property
    def breaks(self) -> Array:
        """As the curve."""
        return self.base.once(Travel).s
