"""Crossings that a track has passed: states at and beside them, on the branch that is followed.

Where branches cross the matrix of the equations is singular, but the branch of continuous rates is smooth. Beside the crossing, rounding
times the condition number, which grows as the inverse of the distance, moves what Newton's method closes off the branch, and once more
the rates solved there. Nearer than ``WINDOW`` states are therefore interpolated between states on the branch on both sides.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mechgraph.numerics.continuation import Follower
from mechgraph.numerics.hermite import through
from mechgraph.numerics.newton import Problem, largest
from mechgraph.numerics.tolerances import PATH
from mechgraph.numerics.tracks import Nodes

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

WINDOW = 5e-3
"""Distance from a crossing below which states and rates are interpolated: accelerations lose rounding over its cube."""
WITHIN = 0.4
"""Part of the span of the sides within which they are: towards the outermost sides polynomials lose digits."""
NEAREST = 1e-3
"""Distance from a crossing below which a node is not used: its sensitivities lose rounding over the square."""
SIDES = np.array([-6, -5, -4, -3, -2, -1, 1, 2, 3, 4, 5, 6]) / 6
"""Places of the states on both sides, in parts of a span."""
SPANS = (0.08, 0.02, 0.005)
"""Spans tried. With the first, polynomials through the sides are exact to rounding where the branch is analytic within a distance of
0.5; the others serve where another singular position is near."""
SCATTER = 3.0
"""Factor within which the answer to a residual times the distance is constant where there is no other singular position near."""
PROBE_SEED = 3
BETWEEN = np.linspace(-1.0, 1.0, 8)
"""Places between the nearest sides at which interpolated states are asked how they close; not the crossing itself."""
CLOSES = 1e-12
"""Residual up to which they do: the roundings of a thousand loops add up in it."""

PROBE = 10 * PATH.dead_zone
"""Distance at which the condition is looked at for another crossing."""


@dataclass(frozen=True)
class Crossing:
    """A crossing at ``place`` of a ``track``, at values ``drive (d,)`` that go on in ``direction (d,)``; ``sides``: nodes beside it."""

    problem: Problem
    track: int
    place: float
    drive: Array
    direction: Array
    sides: Nodes

    @property
    def window(self) -> float:
        """Distance from the crossing up to which positions are interpolated."""
        return min(WINDOW, WITHIN * float(self.sides.place[-1] - self.place))

    def drives(self, places: Array) -> Array:
        """Path values ``(d, n)`` at places beside the crossing."""
        return self.drive[:, None] + self.direction[:, None] * (places - self.place)

    @cached_property
    def _open(self) -> tuple[float, float]:
        nearest = float(np.abs(self.sides.place - self.place).min())
        at = self.place + nearest * BETWEEN
        tracks, which = np.full(len(at), self.track), np.repeat(self.sides.which[:1], len(at))
        point = self.problem.at(self.states(at), self.drives(at), tracks)
        f = self.problem.factored(point, which)
        sizes = (f.residual_size(r) for r in (point.residual, np.ones_like(point.residual) * point.rounding))
        miss, rounding = (float(size.max()) for size in sizes)
        return miss, max(CLOSES, rounding)

    @property
    def miss(self) -> float:
        """By how much the states between the nearest sides do not close: angles, and lengths over the sizes of their loops.

        Dimensions that differ by as much would open the crossing, so that the branches pass each other.
        """
        return self._open[0]

    @property
    def least_miss(self) -> float:
        """What is not told from none."""
        return self._open[1]

    def weights(self, places: Array) -> Array:
        """Lagrange's weights ``(sides, n)`` for values at places between the sides."""
        at = self.sides.place
        gaps = at[:, None] - at + np.eye(len(at))
        distance = places - at[:, None]
        others = ~np.eye(len(at), dtype=bool)
        return np.stack([distance[mine].prod(axis=0) for mine in others]) / gaps.prod(axis=1)[:, None]

    def error(self, places: Array, ddq: Array, errors: Array) -> Array:
        """Relative error ``(n,)`` of accelerations interpolated from those at the sides ``ddq (F, n, sides)`` of ``errors (n, sides)``.

        Theirs, and by how much the result changes where the outermost sides are left out.
        """
        weights, inner = (
            self.weights(places),
            replace(self, sides=self.sides.take(np.arange(1, len(self.sides) - 1))).weights(places),
        )
        inner = np.pad(inner, ((1, 1), (0, 0)))
        off = np.abs(np.einsum("fnk,kn->fn", ddq, weights - inner)).max(axis=0, initial=0.0)
        size = np.abs(ddq).max(axis=(0, 2), initial=1.0)
        return np.asarray((np.abs(weights) * errors.T).sum(axis=0) + off / size)

    def states(self, places: Array) -> Array:
        """States ``(nx, n)`` at places, interpolated between the sides."""
        x = self.sides.x
        base = x[:, [len(self.sides) // 2]]
        dq = self.problem.difference(x, base) @ self.weights(places)
        return self.problem.advance(np.repeat(base, len(places), axis=1), dq, np.full(len(places), self.track))

    def at_another(self, places: Array) -> Mask:
        """Which places ``(n,)`` lie on another crossing, passed together with this one: condition times distance from it is constant."""
        n = len(places)
        ends = [(places + PROBE * np.array([[far], [-far]])).ravel() for far in (1.0, 2.0)]
        tracks = np.full(2 * n, self.track)
        near, far = (self.problem.at(self.states(at), self.drives(at), tracks) for at in ends)
        which = self.problem.chosen(far, np.full(2 * n, -1))
        a, b = (self.problem.factored(point, which).condition for point in (near, far))
        away = np.abs(PROBE - PROBE * b / np.where(a > b, a - b, 1.0))
        return np.asarray(((a > b) & (away < PATH.dead_zone)).reshape(2, n).all(axis=0))


def passed(follower: Follower, nodes: Nodes, track: int, place: float) -> Crossing | None:
    """The crossing at a place of a track, with states beside it; None where none are found on one smooth branch."""
    problem, paths = follower.problem, follower.paths
    here = np.array([track])
    drive = paths.drive(here, np.array([place]))[:, 0]
    direction = (paths.drive(here, np.array([place + PATH.first])) - drive[:, None])[:, 0] / PATH.first
    mine = nodes.take(nodes.track == track)
    before = follower.with_lead(mine.take(mine.place < place), track)
    mine = Nodes.join([before, mine.take(mine.place > place)])
    mine = mine.take(np.abs(mine.place - place) > NEAREST)
    off = mine.drive - drive[:, None] - direction[:, None] * (mine.place - place)
    mine = mine.take(np.abs(off).max(axis=0, initial=0.0) < 1e-12)
    if not (mine.place > place).any() or not (mine.place < place).any():
        return None
    wanted = place + np.concatenate([-_DISTANCES[::-1], _DISTANCES])
    picked = mine.take(np.unique([int(np.argmin(np.abs(mine.place - at))) for at in wanted]))
    picked = picked.take(np.unique(picked.place, return_index=True)[1])
    base = picked.take(np.full(len(SIDES), np.searchsorted(picked.place, place) - 1))
    for span in SPANS:
        at = place + span * SIDES
        drives = drive[:, None] + direction[:, None] * (at - place)
        x = through(problem, picked, base, direction, at)
        found = follower.newton.nodes(x, drives, base.track, base.which, PATH.node)
        nearness = _answer(problem, found.x, drives, base.track, found.which) * np.abs(at - place)
        regular = nearness.max() <= SCATTER * nearness.min()
        if found.done.all() and (found.correction <= 1e-2 * span).all() and regular:
            return Crossing(
                problem, track, place, drive, direction, Nodes.closed(found, drives, base.track, at, sure=True)
            )
    return None


def _answer(problem: Problem, x: Array, drive: Array, tracks: Index, which: Index) -> Array:
    """How much states ``(nx, n)`` answer to a random residual: as the condition one over the distance, but no matter of pivots."""
    point = problem.at(x, drive, tracks)
    b = np.random.default_rng(PROBE_SEED).normal(size=len(point.residual))
    return largest(problem.factored(point, which).solve(np.repeat(b[:, None, None], x.shape[1], axis=2))[:, 0])


_DISTANCES = 4e-3 * 3.0 ** np.arange(4)
"""Distances of the nodes from which the sides are predicted."""
