"""Coordinates of the user along tracks: rotation vectors are continued from the start, whole turns taken off are added."""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.driver_path import DriverPath, Positions
from mechgraph.closure.indexing import Index


def continued(path: DriverPath, found: Positions) -> Array:
    """User coordinates ``(F, T)`` of all positions, rotation vectors continued along their tracks from the start."""
    s = path.system
    start = s.start_coordinates(s.m.start)
    if all(len(factor) == 1 for g in s.groups for factor in g.row.factors):
        q = s.coordinates_of(found.x)
        return q if found.gained is None else q + found.gained
    out = np.full((s.n_freedoms, found.x.shape[1]), np.nan)
    good = np.flatnonzero(found.moved)
    turns = np.zeros(found.x.shape[1], dtype=np.intp) if found.turns is None else found.turns
    for track, mine in _by_track(found.track[good]):
        nodes, near = found.nodes_of(track), start
        spin = np.zeros((s.n_freedoms, len(nodes)))
        if found.spin is not None:
            spin = found.spin[:, found.tracks.nodes.track == track]
        for turn in range(int(turns[good[mine]].max()) + 1):
            at = good[mine][turns[good[mine]] == turn]
            place = np.concatenate([nodes.place, found.place[at]])
            order = np.argsort(place, kind="stable")
            on_the_way = path.advance(nodes.x, turn * spin, nodes.track) if turn else nodes.x
            q = s.coordinates_of(np.concatenate([on_the_way, found.x[:, at]], axis=1)[:, order], near)
            back = np.empty_like(order)
            back[order] = np.arange(len(order))
            out[:, at], near = q[:, back[len(nodes) :]], q[:, -1]
    return out if found.gained is None else out + found.gained


def _by_track(track: Index) -> list[tuple[int, Index]]:
    """Positions of every track."""
    order = np.argsort(track, kind="stable")
    cuts = np.flatnonzero(np.diff(track[order])) + 1
    return [(int(track[part[0]]), part) for part in np.split(order, cuts) if part.size]
