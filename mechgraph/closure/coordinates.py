"""Coordinates of the user along tracks: rotation vectors are continued from the start, whole turns taken off are added."""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.driver_path import DriverPath, Positions
from mechgraph.closure.indexing import Index

CONTINUED_TOGETHER = 10_000
"""Nodes of as many periods as are continued together."""


def continued(path: DriverPath, found: Positions) -> Array:
    """User coordinates ``(F, T)`` of all positions, rotation vectors continued along their tracks from the start."""
    s = path.system
    start = s.start_coordinates(s.m.start)
    if all(len(factor) == 1 for g in s.groups for factor in g.row.factors):
        q = s.coordinates_of(found.x)
        return q if found.gained is None else q + s.in_user_units(found.gained)
    out = np.full((s.n_freedoms, found.x.shape[1]), np.nan)
    good = np.flatnonzero(found.moved)
    turns = np.zeros(found.x.shape[1], dtype=np.intp) if found.turns is None else found.turns
    for track, mine in _by_track(found.track[good]):
        nodes, near = found.nodes_of(track), start
        spin = np.zeros((s.n_freedoms, len(nodes)))
        if found.spin is not None:
            spin = found.spin[:, found.tracks.nodes.track == track]
        mine = good[mine]
        span, together = (
            float(max(nodes.place.max(), found.place[mine].max())) + 1.0,
            max(1, CONTINUED_TOGETHER // len(nodes)),
        )
        for first in range(0, int(turns[mine].max()) + 1, together):
            some = np.arange(first, min(first + together, int(turns[mine].max()) + 1))
            number = np.repeat(some, len(nodes))
            shift = np.tile(spin, len(some)) * number.astype(float)
            on_the_way = path.advance(np.tile(nodes.x, len(some)), shift, np.tile(nodes.track, len(some)))
            at = mine[np.isin(turns[mine], some)]
            # periods apart, each with its own places
            key = np.concatenate([number * span + np.tile(nodes.place, len(some)), turns[at] * span + found.place[at]])
            order = np.argsort(key, kind="stable")
            q = s.coordinates_of(np.concatenate([on_the_way, found.x[:, at]], axis=1)[:, order], near)
            back = np.empty_like(order)
            back[order] = np.arange(len(order))
            out[:, at], near = q[:, back[len(number) :]], q[:, -1]
    return out if found.gained is None else out + s.in_user_units(found.gained)


def _by_track(track: Index) -> list[tuple[int, Index]]:
    """Positions of every track."""
    order = np.argsort(track, kind="stable")
    cuts = np.flatnonzero(np.diff(track[order])) + 1
    return [(int(track[part[0]]), part) for part in np.split(order, cuts) if part.size]
