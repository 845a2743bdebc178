"""The factor of a frame that lies on a surface."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from mechgraph.algebra.se3 import Array, cross
from mechgraph.model.factors import Factor
from mechgraph.model.row_parts import UNIT_TWISTS, Freedom
from mechgraph.model.surfaces import Surface
from mechgraph.model.travel import COMPLEX_STEP
from mechgraph.model.travelling import Travelling

SURFACE_LINES = 9
"""Lines each way by which a surface is drawn."""


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
        u, v = (np.linspace(*ends, SURFACE_LINES) for ends in ranges)
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

    def to_pole(self, x: Array) -> Array:
        """Angle ``(...)`` at coordinates ``(2, ...)`` from a pole of the parameters."""
        assert self.surface is not None
        return self.surface.to_pole(*self._parameters(x))

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
