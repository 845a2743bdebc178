"""Surfaces of which a user gives the shape: a grid of points, or a function with its derivatives; and the table of all surfaces."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.model.asked import asked, between, slope_faults
from mechgraph.model.field_kinds import FUNCTION, INTEGER, INTERVAL, POINT_LIST
from mechgraph.model.surfaces import Cone, Cylinder, Plane, Revolution, Sphere, Surface, Torus
from mechgraph.units import LENGTH

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
        U, V = (
            [one(np.asarray(at.real, dtype=float).ravel()) for one in basis]
            for basis, at in ((along_u, u), (along_v, v))
        )
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
        steps = [
            (k, ORDERS_UV.index((i - (i > 0), j - (i == 0))), int(i == 0)) for k, (i, j) in enumerate(ORDERS_UV) if k
        ]
        return slope_faults(
            self._known, at, steps, ["x" + "_"[: i + j] + "u" * i + "v" * j for i, j in ORDERS_UV], where
        )


SURFACES: dict[str, type[Surface]] = {
    kind.kind: kind for kind in (Plane, Sphere, Cylinder, Cone, Torus, Revolution, Patch, ByFunction)
}
"""Surfaces by the names that they have in files."""
Surface.plane, Surface.sphere, Surface.cylinder, Surface.cone = Plane, Sphere, Cylinder, Cone
Surface.torus, Surface.revolution, Surface.patch, Surface.function = Torus, Revolution, Patch, ByFunction
