"""Tracks through the positions asked for, and the positions read off their nodes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.driver_path import DriverPath, Mask, Positions, Request, Status, in_blocks
from mechgraph.closure.indexing import Index
from mechgraph.numerics.beyond import followed
from mechgraph.numerics.continuation import End, Follower, Tracks
from mechgraph.numerics.crossings import WINDOW, passed
from mechgraph.numerics.hermite import Interpolation
from mechgraph.numerics.refinement import refined
from mechgraph.numerics.tolerances import PATH
from mechgraph.numerics.tracks import Nodes, Paths, places_of


def along_polygons(path: DriverPath, requests: list[Request], total: int) -> Positions:
    """Polygons followed with nodes where interpolation does not do."""
    legs = _polygons(path, requests, total)
    for _ in range(REPEATS):
        found = legs.followed()
        if not found.bad.size or not legs.stop_at(found.bad):
            break
    return found.positions


REPEATS = 12
"""Times that polygons are followed, every time with a node at the positions that did not come out as predicted before."""
SURE = 1e-4
"""Correction of an interpolated position from which on it is asked whether it lies on the branch of its nodes."""


@dataclass
class _Found:
    positions: Positions
    bad: Index


class Legs:
    """Tracks through the positions asked for: where each position lies, and reading positions off the nodes."""

    def __init__(self, path: DriverPath, total: int) -> None:
        self.path, self.total = path, total
        self.variants: list[int] = []
        self.starts: list[Array] = []
        self.points: list[Array] = []
        self.stops: list[Mask] = []
        self.asked = np.zeros(total, dtype=bool)
        self.values = np.empty((path.size[1], total))
        self.track = np.zeros(total, dtype=np.intp)
        self.place = np.zeros(total)

    def add(self, request: Request, points: Array, values: Array, places: Index, at: Array) -> None:
        """A track through ``points (d, M)`` on which the positions ``places`` lie ``at`` path lengths."""
        self.asked[places] = True
        self.track[places], self.place[places] = len(self.points), at
        self.values[:, places] = values
        self.starts.append(request.x)
        self.variants.append(request.variant)
        self.points.append(points)
        self.stops.append(np.zeros(points.shape[1], dtype=bool))

    def stop_at(self, bad: Index) -> bool:
        """Let no step pass over positions where interpolation did not do; whether that changes anything."""
        changed = False
        for i in bad:
            stops, length = self.stops[self.track[i]], self._length[self.track[i]]
            at = int(np.argmin(np.abs(length - self.place[i])))
            changed |= not stops[at]
            stops[at] = True
        return changed

    def followed(self) -> _Found:
        """All tracks followed and all positions read off."""
        self.path.variant_of = np.array(self.variants, dtype=np.intp)
        follower = Follower(self.path)
        paths = Paths(self.points, self.stops)
        self._length = paths.length
        tracks = followed(follower, np.stack(self.starts, axis=1), paths)
        nodes = refined(follower, tracks.nodes, self.total)
        tracks = replace(tracks, nodes=nodes)
        return self._read(follower, tracks)

    def _read(self, follower: Follower, tracks: Tracks) -> _Found:
        reach = self._reach(tracks)
        out = self._unread(follower, tracks)
        self._beside_crossings(out)
        inside = np.flatnonzero(self.asked & (self.place <= reach[self.track]) & (out.near < 0))
        wrong = self._read_off(out, inside)
        out.status[wrong] = Status.NOT_CLOSED
        out.x[:, wrong] = np.nan
        self._say_why_not(out, reach)
        return _Found(out, wrong)

    def _reach(self, tracks: Tracks) -> Array:
        """The place up to which the positions of every track may be read off."""
        last = np.zeros(len(self.points))
        np.maximum.at(last, tracks.nodes.track, tracks.nodes.place)
        reach = np.where([end is not End.REACHED for end in tracks.end], last, np.inf)
        for track, crossing in tracks.crossings:
            # up to the crossing the branch is known, also where it is not passed
            reach[track] = max(reach[track], crossing - PATH.dead_zone)
        return reach

    def _unread(self, follower: Follower, tracks: Tracks) -> Positions:
        """All positions with their places; nothing read off yet."""
        nodes = tracks.nodes
        # the last node before every position
        span = float(max(nodes.place.max(), self.place.max(initial=0.0))) + 1.0
        before = np.searchsorted(nodes.track * span + nodes.place, self.track * span + self.place) - 1
        out = Positions(
            np.full((self.path.system.n_state, self.total), np.nan),
            np.full(self.total, Status.OK, dtype=object),
            np.zeros(self.total, dtype=np.intp),
            nodes.drive[:, np.maximum(before, np.searchsorted(nodes.track, self.track))],
            self.track,
            self.place,
            tracks,
            follower,
            np.full(self.total, -1),
            [],
        )
        out.status[~self.asked] = Status.NOT_CLOSED
        return out

    def _read_off(self, out: Positions, inside: Index) -> Index:
        """The positions ``inside`` closed from interpolation, with more nodes where that does not do; those that did not come out."""
        for _ in range(FINER):
            interpolation = Interpolation(self.path, out.tracks.nodes)
            bad = [
                part[self._closed(out, interpolation, part, inside.size == self.total)] for part in in_blocks(inside)
            ]
            wrong = np.concatenate(bad)
            if not wrong.size or self.path.size[1] > 1:
                break
            more = self._halved(out.follower, interpolation, wrong)
            if not len(more):
                break
            out.tracks = replace(out.tracks, nodes=Nodes.join([out.tracks.nodes, more]))
        return wrong

    def _beside_crossings(self, out: Positions) -> None:
        """Positions beside change points that were passed are taken from the branch itself."""
        tracks = out.tracks
        for track, place in tracks.crossings:
            beside = np.flatnonzero(self.asked & (self.track == track) & (np.abs(self.place - place) < WINDOW))
            crossing = passed(out.follower, tracks.nodes, track, place) if beside.size else None
            if crossing is None:
                continue
            beside = beside[np.abs(self.place[beside] - place) < crossing.window]
            straight = np.abs(self.values[:, beside] - crossing.drives(self.place[beside])).max(axis=0) < 1e-12
            if straight.any():
                out.near[beside[straight]] = len(out.crossings)
                out.crossings.append(crossing)
        out.interpolate()

    def _closed(self, out: Positions, interpolation: Interpolation, at: Index, whole: bool) -> Mask:
        """Positions ``at`` closed from their prediction; which of them are not beyond doubt."""
        nodes, path = interpolation.nodes, self.path
        tracks, drive = self.track[at], self.values[:, at]
        if len(interpolation.left):
            has_step = np.isin(tracks, nodes.track[interpolation.left])
        else:
            has_step = np.zeros(len(at), dtype=bool)
        first = np.searchsorted(nodes.track, tracks)
        x, which = nodes.x[:, first], nodes.which[first]
        left = right = first
        if has_step.any():
            step = interpolation.find(tracks[has_step], self.place[at[has_step]])
            x[:, has_step] = interpolation(step, self.place[at[has_step]], drive[:, has_step])
            left, right = first.copy(), first.copy()
            left[has_step], right[has_step] = interpolation.left[step], interpolation.right[step]
            which[has_step] = nodes.which[left[has_step]]
        found = out.follower.newton.close(x, drive, tracks, which)
        out.x[:, at], out.which[at] = found.x, found.which
        bad = ~found.done | (found.correction > PATH.correction)
        doubt = np.flatnonzero(~bad & (found.correction > SURE))
        if doubt.size:
            here = path.at(found.x[:, doubt], drive[:, doubt], tracks[doubt])
            ends, sides = nodes.ends(left[doubt], right[doubt])
            beside = path.at(ends.x, ends.drive, ends.track)
            bad[doubt] = ~path.factored(here, found.which[doubt]).regular_between(beside, *sides)
        if whole and len(at) == self.total:
            out.here = found.point if not bad.any() else None
        return bad

    def _halved(self, follower: Follower, interpolation: Interpolation, wrong: Index) -> Nodes:
        """Nodes in the middle of the steps in which positions did not come out as predicted."""
        nodes = interpolation.nodes
        step = np.unique(interpolation.find(self.track[wrong], self.place[wrong]))
        a, b = interpolation.left[step], interpolation.right[step]
        place = 0.5 * (nodes.place[a] + nodes.place[b])
        drive = follower.paths.drive(nodes.track[a], place)
        found = follower.newton.nodes(
            interpolation(step, place, drive), drive, nodes.track[a], nodes.which[a], PATH.node
        )
        return Nodes.closed(found, drive, nodes.track[a], place, sure=True).take(found.done)

    def _say_why_not(self, out: Positions, reach: Array) -> None:
        """Statuses of the positions behind the end of their track, and at crossings."""
        for i in np.flatnonzero(self.asked & (self.place > reach[self.track])):
            near = self.place[i] - reach[self.track[i]] < PATH.dead_zone
            crossed = Status.DEAD_POINT if near else Status.BEYOND_DEAD_POINT
            out.status[i] = BEYOND.get(out.tracks.end[self.track[i]], crossed)
        for track, crossing in out.tracks.crossings:
            there = self.asked & (self.track == track) & (np.abs(self.place - crossing) < PATH.dead_zone)
            out.status[there & (out.near < 0)] = Status.DEAD_POINT
            out.status[there & (out.near >= 0)] = Status.CHANGE_POINT
            out.reached[:, there] = out.follower.paths.drive(np.array([track]), np.array([crossing]))
        for number, known in enumerate(out.crossings):
            at = np.flatnonzero((out.near == number) & (out.status == Status.OK))
            if at.size:
                out.status[at[known.at_another(self.place[at])]] = Status.CHANGE_POINT


BEYOND = {End.FOLD: Status.OUT_OF_REACH, End.GIVEN_UP: Status.NOT_FOLLOWED}
"""Outcome behind the end of a track."""
FINER = 4
"""Times that nodes are put where positions did not come out as predicted."""


def _polygons(path: DriverPath, requests: list[Request], total: int) -> Legs:
    """Several drivers: from every start the polygon through its positions in their order."""
    legs = Legs(path, total)
    for request in requests:
        points = request.polygon(path.rows)
        at = places_of(points)[-request.values.shape[1] :]
        legs.add(request, points, request.values, request.places, at)
    return legs
