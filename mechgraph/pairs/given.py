"""Curves of which a user gives the shape: points to pass, a function; and the table of all."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Annotated, Any

import numpy as np
import scipy

from mechgraph.fields import BESIDE, BREAKS, FLAG, FUNCTION, INTERVAL, POINT_LIST, asked, between, slope_faults
from mechgraph.maths.se3 import Array
from mechgraph.maths.tolerances import SHAPES
from mechgraph.memo import dataclass
from mechgraph.pairs.cams import ArmCam, Barrel, Cam, Globoid
from mechgraph.pairs.curves import INTERVALS, ORDERS, Circle, Curve, Ellipse, Helix, Involute, Line, Pieces, parted
from mechgraph.quantities import LENGTH, wrong


def inner(ends: tuple[float, float]) -> Array:
    """A few simple parameters in a range, at which a function is asked first."""
    return np.linspace(*ends, 7)[1:-1]


@dataclass(frozen=True, kw_only=True, repr=False)
class Through(Curve):
    """The curve through points: a spline of degree 5 (3 through fewer than six points) over the lengths of the chords."""

    kind = "points"
    points: Annotated[Any, POINT_LIST("points passed, in order", LENGTH)]
    closed: Annotated[
        bool, FLAG("whether it returns to the first point, with the direction and curvature that it has there")
    ] = False

    @cached_property
    def _spline(self) -> Pieces:
        given = np.array(self.points)
        if self.closed and np.linalg.norm(given[-1] - given[0]) > SHAPES.even * np.ptp(given, axis=0).max():
            given = np.concatenate([given, given[:1]])
        elif self.closed:
            given[-1] = given[0]
        lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(given, axis=0), axis=1))])
        degree = 5 if len(given) > 5 else 3
        ends: Any = "periodic" if self.closed else None
        made: Any = scipy.interpolate.make_interp_spline(lengths, given, degree, bc_type=ends)
        breaks = np.unique(np.clip(made.t, lengths[0], lengths[-1]))
        terms = [made.derivative(k)(breaks[:-1]) / math.factorial(k) for k in range(degree, 0, -1)]
        return Pieces(breaks, np.stack([*terms, made(breaks[:-1])]), ORDERS)

    def at(self, u: Array) -> Array:
        """The spline."""
        return self._spline.at(u)

    @property
    def ends(self) -> tuple[float, float]:
        """Zero, and the length of all chords."""
        return float(self._spline.breaks[0]), float(self._spline.breaks[-1])

    @property
    def nodes(self) -> Array:
        """Parts of the pieces of the spline."""
        return parted(self._spline.breaks, max(8, 400 // len(self._spline.breaks)))

    def faults(self, where: str) -> list[str]:
        """Points that make no curve."""
        found = super().faults(where)
        if found:
            return found
        gaps = np.linalg.norm(np.diff(np.array(self.points), axis=0), axis=1)
        if len(self.points) < 4:
            return [f"{where}points: {len(self.points)} given; a curve with a continuous curvature takes 4 or more"]
        same = np.flatnonzero(gaps <= 1e-12 * gaps.max())
        return [f"{where}points: points {i} and {i + 1} are the same; leave one out" for i in same.tolist()]


@dataclass(frozen=True, kw_only=True, repr=False)
class Function(Curve):
    """A curve ``x(u)`` by a function: position and first three derivatives (four, to be exact) at ``u (n,)``, ``(3, n)`` each.

    Where it is in pieces, ``breaks`` names the parameters between them, at which a derivative jumps.
    """

    kind = "function"
    position: Annotated[Any, FUNCTION("u -> (x, x', x'', x'''), each (3, n)")]
    ends_at: Annotated[Any, INTERVAL("least and greatest u")]
    closed: Annotated[bool, FLAG("whether it returns to where it begins")] = False
    breaks: Annotated[Any, BREAKS("parameters between its pieces", default="none")] = ()

    @property
    def nodes(self) -> Array:
        """Parts of its pieces."""
        begin, end = self.ends
        pieces = np.array([begin, *np.atleast_1d(self.breaks), end])
        parts = np.ceil(INTERVALS * np.diff(pieces) / (end - begin)).astype(int) + 1
        return np.unique(np.concatenate([*map(np.linspace, pieces[:-1], pieces[1:], parts)]))

    def at(self, u: Array) -> Array:
        """What the function returns; beyond the ends, and for complex ``u``, by Taylor's series."""
        inside = np.clip(u.real, *self.ends)
        known = asked(self.position, [inside.ravel()], ORDERS, ORDERS + 1).reshape(ORDERS + 1, 3, *u.shape)
        beyond = u - inside
        if not np.any(beyond):
            return known[:-1]
        out = known[:-1] + beyond * known[1:]
        for order in range(2, ORDERS + 1):
            out[: ORDERS + 1 - order] += beyond**order / math.factorial(order) * known[order:]
        return np.asarray(out)

    @cached_property
    def orders(self) -> int:
        """As many as it returns."""
        return len(list(self.position(np.array([self.ends[0]]))))

    def faults(self, where: str) -> list[str]:
        """A function that does not do, or whose derivatives are not those of its positions."""
        found = super().faults(where)
        if found:
            return found
        within = [self.ends[0], *np.atleast_1d(self.breaks), self.ends[1]]
        if not (np.diff(within) > 0).all():
            return [wrong(self.breaks, f"{where}breaks", f"rising numbers between {within[0]:g} and {within[-1]:g}")]
        self.at(inner(self.ends))
        steps = [(order + 1, order, 0) for order in range(ORDERS - 1)]
        words = ("position", "derivative 1", "derivative 2", "derivative 3")
        return slope_faults(self.at, [between(self.grid)], steps, words, where, BESIDE * np.diff(self.grid))


CURVES: dict[str, type[Curve]] = {
    kind.kind: kind
    for kind in (Line, Circle, Ellipse, Helix, Involute, Through, Function, Cam, ArmCam, Barrel, Globoid)
}
"""Curves by the names that they have in files."""
Curve.line, Curve.circle, Curve.ellipse, Curve.helix = Line, Circle, Ellipse, Helix
Curve.involute, Curve.through, Curve.function = Involute, Through, Function
Curve.cam, Curve.arm_cam, Curve.barrel, Curve.globoid = Cam, ArmCam, Barrel, Globoid
