"""Ends of curves and surfaces: where a coordinate leaves the range of its factor, the reach of a motion ends.

A coordinate may leave its range and come back between two nodes: nodes are put where it turns back near an end.
"""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.driver_path import DriverPath, Positions, Status
from mechgraph.closure.indexing import System
from mechgraph.numerics.hermite import Interpolation
from mechgraph.numerics.tolerances import PATH
from mechgraph.numerics.tracks import Nodes

BEYOND_END = 1e-9
"""Lengths over L by which a coordinate may be beyond its range: rounding."""
TURNS_FOUND = 4
"""Nodes put one after the other where a coordinate turns back; the third is there to 1e-5, and the value to its square."""


def beyond(system: System, x: Array) -> Array:
    """By how much the coordinates of states ``(nx, T)`` are beyond their ranges, ``(limited freedoms, T)``; at most zero within."""
    columns, low, high = system.limits
    q = x[system.single_rows[columns]]
    return np.maximum(low[:, None] - q, q - high[:, None])


def end_at_ranges(path: DriverPath, found: Positions) -> None:
    """Take away the positions of every track from where a coordinate leaves its range on; ``found.left`` says which it is."""
    system = path.system
    columns = system.limits[0]
    if not columns.size:
        return
    nodes = _with_turns(path, found)
    outside, over = beyond(system, nodes.x), beyond(system, found.x)
    names = system.m.freedom_names()
    for track in np.unique(found.track).tolist():
        mine, on_it = (
            np.flatnonzero((nodes.track == track) & (nodes.place >= 0.0)),
            np.flatnonzero(found.track == track),
        )
        late = mine[(outside[:, mine] > BEYOND_END).any(axis=0)]
        places = [*nodes.place[late], *found.place[on_it[(over[:, on_it] > BEYOND_END).any(axis=0)]]]
        if not places:
            continue
        end = min(places)
        after = found.place[on_it] >= end
        # a later period begins behind the whole first one
        gone = on_it[after if found.turns is None else after | (found.turns[on_it] > 0)]
        before = mine[nodes.place[mine] < end]
        at_end = (
            nodes.x[:, mine[nodes.place[mine] >= end][:1]] if (nodes.place[mine] >= end).any() else found.x[:, gone[:1]]
        )
        found.left[gone] = names[int(columns[np.argmax(beyond(system, at_end)[:, 0])])]
        found.status[gone], found.near[gone] = Status.OUT_OF_REACH, -1
        found.x[:, gone] = np.nan
        if before.size:
            found.reached[:, gone] = nodes.drive[:, before[-1:]]
        found.here = None


def _with_turns(path: DriverPath, found: Positions) -> Nodes:
    """The nodes of all tracks, and further ones where a limited coordinate turns back near an end of its range between two of them."""
    nodes = found.tracks.nodes
    columns, low, high = path.system.limits
    for _ in range(TURNS_FOUND):
        between = Interpolation(path, nodes)
        a, b = between.left, between.right
        width, q = nodes.place[b] - nodes.place[a], nodes.x[path.system.single_rows[columns]]
        begin, end = ((nodes.Z[columns][:, :, side] * between.slope).sum(axis=1) for side in (a, b))
        slope = (q[:, b] - q[:, a]) / width
        # the rate of the cubic through both ends, ``begin + B s + A s^2``, vanishes once where its signs at the ends differ
        A, B = 3.0 * (begin + end - 2.0 * slope), 2.0 * (3.0 * slope - 2.0 * begin - end)
        root = np.sqrt(np.maximum(B * B - 4.0 * A * begin, 0.0))
        bottom = np.where(begin > 0, root - B, -root - B)
        s = np.clip(2.0 * begin / np.where(bottom == 0, 1.0, bottom), 0.0, 1.0)
        gain = width * s * (begin + s * (B / 2.0 + s * A / 3.0))
        beyond_end = np.where(begin > 0, q[:, a] + gain - high[:, None], low[:, None] - q[:, a] - gain)
        turns = (begin * end < 0) & (beyond_end + np.abs(gain) > 0) & (nodes.place[a] >= 0.0)
        _, step = np.nonzero(turns)
        if not step.size:
            break
        place = nodes.place[a[step]] + s[turns] * width[step]
        track, which = nodes.track[a[step]], nodes.which[a[step]]
        drive = found.follower.paths.drive(track, place)
        closed = found.follower.newton.nodes(between(step, place, drive), drive, track, which, PATH.node)
        nodes = Nodes.join([nodes, Nodes.closed(closed, drive, track, place, sure=True).take(closed.done)])
    return nodes
