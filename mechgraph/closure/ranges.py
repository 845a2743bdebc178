"""Ends of curves and surfaces: where a coordinate leaves the range of its factor, the reach of a motion ends.

A coordinate may leave its range and come back between two nodes: nodes are put where it turns back near an end.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.driver_path import DriverPath, Positions, Status
from mechgraph.closure.indexing import System
from mechgraph.numerics.continuation import End, Follower
from mechgraph.numerics.hermite import Interpolation
from mechgraph.numerics.tolerances import PATH
from mechgraph.numerics.tracks import Nodes

BEYOND_END = 1e-9
"""Lengths over L by which a coordinate may be beyond its range: rounding."""
BISECTIONS = 52
"""Times that a step is halved for the place where a coordinate leaves its range: to rounding."""
NONE = np.zeros(0, dtype=np.intp)
TURNS_FOUND = 4
"""Nodes put one after the other where a coordinate turns back; the third is there to 1e-5, and the value to its square."""


def beyond(system: System, x: Array) -> Array:
    """By how much the coordinates of states ``(nx, T)`` are beyond their ranges, ``(limited freedoms, T)``; at most zero within."""
    columns, low, high = system.limits
    q = x[system.single_rows[columns]]
    return np.maximum(low[:, None] - q, q - high[:, None])


def end_at_ranges(path: DriverPath, found: Positions) -> None:
    """End every track where a coordinate leaves its range, and take away its positions behind; ``found.left`` says which it is."""
    system = path.system
    over = np.flatnonzero((beyond(system, found.x) > BEYOND_END).any(axis=0))
    outside = np.full(len(found.tracks.end), np.inf)
    np.minimum.at(outside, found.track[over], found.place[over])
    ends, node = range_ends(path, found.follower, found.tracks.nodes, outside)
    left = np.flatnonzero(np.isfinite(ends))
    if not left.size:
        return
    first = system.limits[0][np.argmax(beyond(system, node.x), axis=0)]
    names = [system.m.freedom_names()[i] for i in first.tolist()]
    for i, track in enumerate(left.tolist()):
        after = found.place > ends[track]
        # a later period begins behind the whole first one
        gone = (found.track == track) & (after if found.turns is None else after | (found.turns > 0))
        found.status[gone], found.near[gone], found.left[gone] = Status.OUT_OF_REACH, -1, names[i]
        found.x[:, gone] = np.nan
        found.reached[:, gone] = node.drive[:, [i]]
    nodes = found.tracks.nodes
    kept = nodes.take((nodes.place < ends[nodes.track]) | (nodes.place == 0.0))
    how = [End.RANGE if there < np.inf else end for end, there in zip(found.tracks.end, ends, strict=True)]
    found.tracks = replace(found.tracks, nodes=Nodes.join([kept, node.take(node.place > 0.0)]), end=how)
    found.here = None


def range_ends(path: DriverPath, follower: Follower, nodes: Nodes, outside: Array) -> tuple[Array, Nodes]:
    """Where tracks ``(V,)`` leave a range of a coordinate, infinite where they do not, and the nodes there, one each that does.

    ``outside (V,)``: places that are known to lie behind.
    """
    V, system = len(outside), path.system
    if not system.limits[0].size:
        return outside, nodes.take(NONE)
    nodes = _with_turns(path, follower, nodes)
    out, mine = (beyond(system, nodes.x) > BEYOND_END).any(axis=0), nodes.place >= 0.0
    far, near = outside.copy(), np.zeros(V)
    np.minimum.at(far, nodes.track[out & mine], nodes.place[out & mine])
    before = mine & (nodes.place < far[nodes.track])
    np.maximum.at(near, nodes.track[before], nodes.place[before])
    left = np.flatnonzero(np.isfinite(far))
    if not left.size:
        return far, nodes.take(NONE)
    low, high = near[left], far[left]
    between = Interpolation(path, nodes)
    for _ in range(BISECTIONS if (high > low).any() else 0):
        middle = 0.5 * (low + high)
        x = between(between.find(left, middle), middle, follower.paths.drive(left, middle))
        over = (beyond(system, x) > BEYOND_END).any(axis=0)
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    ends = np.full(V, np.inf)
    ends[left] = low
    drive = follower.paths.drive(left, low)
    first = nodes.take(mine)
    first = first.take(np.searchsorted(first.track, left))
    x, on = first.x, low > 0.0
    if on.any():
        x[:, on] = between(between.find(left[on], low[on]), low[on], drive[:, on])
    closed = follower.newton.nodes(x, drive, left, first.which, PATH.node)
    return ends, Nodes.closed(closed, drive, left, low, sure=True)


def _with_turns(path: DriverPath, follower: Follower, nodes: Nodes) -> Nodes:
    """The nodes of all tracks, and further ones where a limited coordinate turns back near an end of its range between two of them."""
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
        drive = follower.paths.drive(track, place)
        closed = follower.newton.nodes(between(step, place, drive), drive, track, which, PATH.node)
        nodes = Nodes.join([nodes, Nodes.closed(closed, drive, track, place, sure=True).take(closed.done)])
    return nodes
