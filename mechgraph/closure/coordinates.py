"""Coordinates of the user along tracks: rotation vectors are continued from the start, whole turns taken off are added."""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.driver_path import DriverPath, Positions
from mechgraph.closure.indexing import Index

CONTINUED_TOGETHER = 10_000
"""Nodes and positions, of some tracks or of some periods of one, that are continued together."""


def continued(path: DriverPath, found: Positions) -> Array:
    """User coordinates ``(F, T)`` of all positions, rotation vectors continued along their tracks from the start."""
    s = path.system
    if all(len(factor) == 1 for g in s.groups for factor in g.row.factors):
        q = s.coordinates_of(found.x)
        return q if found.gained is None else q + s.in_user_units(found.gained)
    out = np.full((s.n_freedoms, found.x.shape[1]), np.nan)
    count = np.bincount(found.tracks.nodes.track, minlength=len(found.tracks.end))
    np.add.at(count, found.track[found.moved], 1)
    for tracks in np.array_split(np.arange(len(count)), max(1, min(len(count), count.sum() // CONTINUED_TOGETHER))):
        if tracks.size:
            _continue(path, found, tracks, out)
    return out if found.gained is None else out + s.in_user_units(found.gained)


def _continue(path: DriverPath, found: Positions, tracks: Index, out: Array) -> None:
    """Put the coordinates of the positions of some neighbouring ``tracks`` in their places, some periods after the other."""
    s, every = path.system, found.tracks.nodes.track
    mine = np.flatnonzero((found.track >= tracks[0]) & (found.track <= tracks[-1]) & found.moved)
    if not mine.size:
        return
    on = slice(*np.searchsorted(every, (tracks[0], tracks[-1] + 1)))
    nodes = found.tracks.nodes.take(np.arange(on.start, on.stop))
    spin = np.zeros((s.n_freedoms, len(nodes))) if found.spin is None else found.spin[:, on]
    turns = np.zeros(mine.size, dtype=np.intp) if found.turns is None else found.turns[mine]
    near = np.repeat(s.start_coordinates(s.m.start)[:, None], len(tracks), axis=1)
    together = max(1, CONTINUED_TOGETHER // len(nodes))
    for first in range(0, int(turns.max()) + 1, together):
        some = np.arange(first, min(first + together, int(turns.max()) + 1))
        number, again = np.repeat(some, len(nodes)), np.tile(np.arange(len(nodes)), len(some))
        on_the_way = path.advance(nodes.x[:, again], spin[:, again] * number.astype(float), nodes.track[again])
        within = np.isin(turns, some)
        at = mine[within]
        track, period, place = (
            np.concatenate(parts)
            for parts in (
                (nodes.track[again], found.track[at]),
                (number, turns[within]),
                (nodes.place[again], found.place[at]),
            )
        )
        order = np.lexsort((place, period, track))
        x = np.concatenate([on_the_way, found.x[:, at]], axis=1)[:, order]
        # one row a track, shorter ones go on at rest
        end = np.searchsorted(track[order], tracks, side="right")
        begin = np.searchsorted(track[order], tracks)
        along = np.minimum(begin[:, None] + np.arange((end - begin).max()), np.maximum(end - 1, 0)[:, None])
        q = s.coordinates_of(x[:, along], near)
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        row = track[len(number) :] - tracks[0]
        out[:, at], near = q[:, row, back[len(number) :] - begin[row]], q[:, :, -1]
