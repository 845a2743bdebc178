"""Ends of curves and surfaces: where a coordinate leaves the range of its factor, the reach of a motion ends."""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.driver_path import DriverPath, Positions, Status
from mechgraph.closure.indexing import System

BEYOND_END = 1e-9
"""Lengths over L by which a coordinate may be beyond its range: rounding."""


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
    nodes = found.tracks.nodes
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
        gone = on_it[found.place[on_it] >= end]
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
