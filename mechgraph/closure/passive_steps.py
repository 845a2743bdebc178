"""Links with several passive motions at rest (a ring on a bar, a washer between planes), integrated step by step along the path.

How far such a link has gone along one of its motions changes what rest is in the others, so that no rate of an angle can be
integrated by itself: the states of the whole mechanism are.
"""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.driver_path import DriverPath, Mask
from mechgraph.closure.indexing import Index
from mechgraph.closure.passive_motion import PassiveMotion, PassiveMotions
from mechgraph.numerics.continuation import Follower
from mechgraph.numerics.hermite import Interpolation
from mechgraph.numerics.legendre import rule
from mechgraph.numerics.newton import Closed
from mechgraph.numerics.tolerances import PATH

MOST_TIMES = 30
"""Most repetitions of a step: each leaves a small part of what was wrong along the passive motions."""
REPEATED = 1e-14
"""Change of the increments of a step that is rounding."""
SETTLED = 1e-10
"""Change of the increments of a step up to which its repetitions have come to an end."""


def rest_is_sure(closed: Closed, step: Index, begin: Index) -> Mask:
    """Steps with which, and up to which from where tracks ``begin``, the way is sure: states ``closed`` in a ``step`` are as foretold."""
    bad = np.zeros(len(begin), dtype=bool)
    bad[step[~closed.done | (closed.correction > PATH.correction)]] = True
    before = np.cumsum(bad)
    behind = np.arange(len(begin)) < begin
    return (before - bad * behind) == (before - bad)[begin]


class PassiveSteps:
    """States at rest in all passive motions: in every step between nodes ``x(t) = x_0 + int q' dt``, closed.

    The rates ``q'`` at rest are those at Gauss and Legendre's points of the step itself, found by repetition.
    Source: Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, 1993, section II.7 (collocation).
    """

    def __init__(
        self, path: DriverPath, interpolation: Interpolation, follower: Follower, passive: tuple[PassiveMotion, ...]
    ) -> None:
        self.path, self.interpolation, self.follower, self.passive = path, interpolation, follower, passive
        nodes, left, right = interpolation.nodes, interpolation.left, interpolation.right
        self._h = nodes.place[right] - nodes.place[left]
        self._series = np.zeros((path.size[0], len(left), rule().count))
        # before a start, where nodes have places below zero, steps lead away from it as well
        self._back = nodes.place[left] < 0.0
        self._begin = nodes.x[:, np.where(self._back, right, left)]
        self._sure = np.ones(len(left), dtype=bool)
        number = np.arange(len(left)) - interpolation.begin
        for k in [*range(int(number.max(initial=-1)) + 1), *range(-1, int(number.min(initial=0)) - 1, -1)]:
            steps = np.flatnonzero(number == k)
            if k not in (0, -1):
                way = 1 if k > 0 else -1
                before = steps - way
                drive = nodes.drive[:, (right if k > 0 else left)[before]]
                closed = self._at(before, np.full(len(steps), float(way)), drive, nodes.which[left[steps]])
                self._begin[:, steps], self._sure[steps] = closed.x, self._sure[before] & closed.done
            self._follow(steps)

    def _at(self, step: Index, t: Array, drive: Array, which: Index) -> Closed:
        """States in steps at ``t`` from -1 to 1, closed."""
        dq = np.einsum("fng,ng->fn", self._series[:, step], rule().integrals(t))
        dq -= np.where(self._back[step], self._series[:, step, 0], 0.0)
        track = self.interpolation.nodes.track[self.interpolation.left[step]]
        return self.follower.newton.close(self.path.advance(self._begin[:, step], dq, track), drive, track, which)

    def _follow(self, steps: Index) -> None:
        """Find the increments of some steps, of different tracks."""
        nodes, left = self.interpolation.nodes, self.interpolation.left[steps]
        many, t = np.repeat(steps, rule().count), np.tile(rule().points, len(steps))
        place = nodes.place[np.repeat(left, rule().count)] + 0.5 * (t + 1.0) * self._h[many]
        track, which = nodes.track[np.repeat(left, rule().count)], nodes.which[np.repeat(left, rule().count)]
        drive = self.follower.paths.drive(track, place)
        for _ in range(MOST_TIMES):
            closed = self._at(many, t, drive, which)
            x, here = closed.x, self.path.at(closed.x, drive, track)
            f = self.path.factored(here, closed.which)
            if f.motions().shape[1] != len(self.passive):
                # beyond what closes, as where a shaky mechanism does not go on
                self._sure[steps] = False
                return
            dq = (f.sensitivity() * self.interpolation.slope[:, many]).sum(axis=1)
            dq += PassiveMotions(here, self.passive, f.motions()).at_rest(here.link_twists(dq))
            rates = self.path.tangent(self.path.difference(x, self._begin[:, many]), dq)
            series = self._h[steps, None] * (rates.reshape(-1, len(steps), rule().count) @ rule().to_series)
            change = np.abs(series - self._series[:, steps]).max(axis=(0, 2), initial=0.0)
            self._series[:, steps] = series
            if change.max() < REPEATED * max(1.0, float(np.abs(series).max(initial=0.0))):
                break
        self._sure[steps] &= (change < SETTLED) & closed.done.reshape(-1, rule().count).all(axis=1)

    def turned(self, x: Array, which: Index, track: Index, place: Array, turns: Index) -> tuple[Array, Mask]:
        """States at rest at places of the tracks, as far as these have steps; their motion is followed all the way, without ``turns``.

        Also where that is beyond doubt.
        """
        nodes, left = self.interpolation.nodes, self.interpolation.left
        moved = np.flatnonzero(np.isin(track, nodes.track[left]))
        step = self.interpolation.find(track[moved], place[moved])
        t = 2.0 * (place[moved] - nodes.place[left[step]]) / self._h[step] - 1.0
        out, sure = x.copy(), np.ones(x.shape[1], dtype=bool)
        closed = self._at(step, t, x[self.path.rows][:, moved], which[moved])
        out[:, moved], sure[moved] = closed.x, self._sure[step] & closed.done
        return out, sure
