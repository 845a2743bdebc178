"""All positions asked for along driver values: one curve for one driver, polygons for several.

A driver that turns on and on is followed only until the motion repeats itself: after one whole turn, or after several. Where all poses
are back and all freedoms are, but for whole turns, the equations are the same again, and so is the curve:
``x(s + n P) = x(s) + n shift`` to rounding. A body that may spin passively is carried on by its turn a period (see ``passive_rest``).
Where that does not hold (a screw that advances), the whole way is followed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.driver_path import DriverPath, Positions, Request
from mechgraph.closure.gaps import along_polygons_with_gaps
from mechgraph.closure.indexing import Index
from mechgraph.closure.legs import Legs
from mechgraph.closure.ranges import end_at_ranges
from mechgraph.numerics.beyond import followed
from mechgraph.numerics.continuation import Follower
from mechgraph.numerics.tracks import Nodes, Paths

TURNS = (1, 4, 16)
"""Turns of the driver over which a motion is followed to see whether it repeats itself, one number after the other."""
WORTH = 2
"""How many times as far positions must lie for that."""
AT_START = 1e-14
"""Part of a driver's value up to which a position is the start itself: so near to it nothing is followed, dead point or not."""
BACK_AGAIN = 1e-11
"""Distance (radians, lengths / L) up to which a motion is back: rounding over a poor condition; shifts are whole turns or nothing."""


@dataclass
class _Way:
    """Positions of a request to one side of its start, ``way (n,)`` from there, and the ``period`` and ``shift (F,)`` of the motion."""

    request: Request
    sense: float
    mine: Index
    way: Array
    period: float = np.inf
    shift: Array | None = None
    ends: bool = False
    """Whether the curve ends before the motion may repeat itself."""

    @property
    def length(self) -> float:
        """How far the curve is to be followed."""
        return float(min(self.way.max(), self.period))


def follow(path: DriverPath, requests: list[Request], total: int) -> Positions:
    """States at all positions asked for; ``total`` positions in all."""
    if path.size[1] != 1:
        return along_polygons_with_gaps(path, requests, total)
    found = _along_curves(path, requests, total)
    end_at_ranges(path, found)
    return found


def _along_curves(path: DriverPath, requests: list[Request], total: int) -> Positions:
    """One driver: from every start one track up and one down."""
    ways = []
    for request in requests:
        along = request.values[0] - request.x[path.rows[0]]
        for sense, there in ((1.0, along >= 0), (-1.0, along < 0)):
            if there.any():
                ways.append(_Way(request, sense, np.flatnonzero(there), sense * along[there]))
    turn = path.system.periods[path.columns[0]]
    if np.isfinite(turn):
        for most in TURNS:
            far = [way for way in ways if way.period == np.inf and not way.ends and way.way.max() > WORTH * most * turn]
            if far:
                _find_periods(path, far, most)
    legs = Legs(path, total)
    turns = np.zeros(total, dtype=np.intp)
    for way in ways:
        begin, places = way.request.x[path.rows[0]], way.request.places[way.mine]
        values, at = way.request.values[:, way.mine], way.way
        if way.period < np.inf:
            turns[places] = np.floor(at / way.period)
            at = np.clip(at - way.period * turns[places], 0.0, way.period)
            values = np.where(turns[places] > 0, begin + way.sense * at, values)
        ahead = way.length > AT_START * max(1.0, abs(begin))
        points = np.array([[begin, begin + way.sense * way.length] if ahead else [begin]])
        legs.add(way.request, points, values, places, at)
    found = legs.followed().positions
    if turns.any():
        found.turns, found.gained = turns, np.zeros((path.system.n_freedoms, total))
        for way in ways:
            if way.shift is not None:
                places = way.request.places[way.mine]
                found.gained[:, places] = way.shift[:, None] * turns[places]
        found.reached += found.gained[path.columns]
    return found


def _find_periods(path: DriverPath, ways: list[_Way], most: int) -> None:
    """Follow the motion over some turns of the driver and note where it repeats itself."""
    path.variant_of = np.array([way.request.variant for way in ways], dtype=np.intp)
    x = np.stack([way.request.x for way in ways], axis=1)
    ends = path.system.periods[path.columns[0]] * np.arange(most + 1.0)
    points = [x[path.rows, v][:, None] + way.sense * ends for v, way in enumerate(ways)]
    follower = Follower(path)
    tracks = followed(follower, x, Paths(points, [np.ones(most + 1, dtype=bool)] * len(ways)))
    crossed = {track for track, _ in tracks.crossings}
    for v, way in enumerate(ways):
        nodes = tracks.nodes.take(tracks.nodes.track == v)
        way.ends = nodes.place[-1] < ends[-1]
        for end in ends[1:]:
            at, start = np.flatnonzero(np.abs(nodes.place - end) < 1e-9), nodes.take(nodes.place == 0.0)
            shift = _shift(path, follower, nodes.take(at[:1]), start, v in crossed) if at.size else None
            if shift is not None:
                way.period, way.shift = float(end), shift
                break


def _shift(path: DriverPath, follower: Follower, node: Nodes, start: Nodes, crossed: bool) -> Array | None:
    """Whole turns ``(F,)`` that the freedoms have gained where the motion is back at its start; None where it is not."""
    system = path.system
    x = follower.newton.close(node.x, node.drive, node.track, node.which).x
    gained = path.difference(x, start.x)[:, 0]
    turning = (system.single_rows >= 0) & np.isfinite(system.periods)
    shift = np.where(turning, system.rounds(np.arange(system.n_freedoms), gained), 0.0)
    here = path.at(start.x, start.drive, start.track)
    free = path.factored(here, start.which).motions()[:, :, 0]
    left = gained - shift
    if free.shape[1]:
        # what is left free is not followed but carried; beside a change point it is not
        left = (
            np.full_like(left, np.inf)
            if crossed or not path.carries
            else left - free @ np.linalg.lstsq(free, left, rcond=None)[0]
        )
    turned = start.x.copy()
    turned[system.single_rows[turning]] += shift[turning][:, None]
    again = path.at(turned, turned[path.rows], start.track)
    # screws and couplings of freedoms that have gained turns may not be back
    back = np.abs(again.poses - here.poses).max() <= BACK_AGAIN and again.closure[0] <= BACK_AGAIN + here.closure[0]
    return shift if back and np.abs(left).max(initial=0.0) <= BACK_AGAIN else None
