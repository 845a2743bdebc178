"""Tracks: the polylines of path values along which solutions are followed, and the nodes found on them."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from mechgraph.numerics.newton import Closed
from mechgraph.numerics.tolerances import PATH

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

BENT = 1e-12
"""Distance from which on a point is off the line of the points beside it: more than rounding."""


def places_of(points: Array) -> Array:
    """Lengths ``(M,)`` along a polyline ``(d, M)`` up to each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(points) ** 2).sum(axis=0)))])


class Paths:
    """Polylines of path values: for every track its ``points (d, M)``, the first one where it starts.

    ``stops``: for every track which points no step may pass over.
    """

    def __init__(self, points: list[Array], stops: list[Mask] | None = None) -> None:
        self.points = points
        self.stops = stops or [np.zeros(p.shape[1], dtype=bool) for p in points]
        self.length = [places_of(p) for p in points]
        self.end = np.array([length[-1] for length in self.length])
        self.count = count = np.array([len(length) for length in self.length])
        self._last = np.cumsum(count) - 1
        self._first = self._last - count + 1
        self._second = np.minimum(self._first + 1, self._last)
        # one rising key for all tracks: place on the track plus the lengths of the tracks before it
        self._offset = np.concatenate([[0.0], np.cumsum(self.end + 1.0)[:-1]])
        self._all = np.concatenate(points, axis=1)
        self._places = np.concatenate(self.length)
        self._key = self._places + np.repeat(self._offset, count)
        # of the leg that leads to every point: where it begins (a first point is a leg of its own), and what it adds
        begin = np.arange(len(self._key)) - 1
        begin[self._first] += 1
        self._begin, self._from = self._all[:, begin], self._places[begin]
        self._way, self._added = self._places - self._from, self._all - self._begin
        self._way[self._way == 0] = 1.0
        if len(self._all) == 1:  # a start alone has the direction of growing values
            self._added[:, self._first] = 1.0
        self.bent = bool((count > 2).any())
        """Whether there are points between the ends, at which paths may turn."""

    @property
    def bends(self) -> tuple[Index, Array]:
        """Tracks and places of the points at which a path turns."""
        unit, track = self._added / self._way, np.repeat(np.arange(len(self.count)), self.count)
        inner = np.flatnonzero((track[1:-1] == track[:-2]) & (track[1:-1] == track[2:])) + 1
        change = np.abs(unit[:, inner + 1] - unit[:, inner]).max(axis=0, initial=0.0)
        turns = change * np.minimum(self._way[inner], self._way[inner + 1]) > BENT
        return track[inner[turns]], self._places[inner[turns]]

    def drive(self, tracks: Index, at: Array) -> Array:
        """Path values ``(d, n)`` at places of tracks; behind the end and before the start straight on."""
        point = self._last.take(tracks)
        if self.bent:
            found = self._key.searchsorted(at + self._offset.take(tracks))
            point = np.minimum(np.maximum(found, self._second.take(tracks)), point)
        u = (at - self._from.take(point)) / self._way.take(point)
        values: Array = self._begin.take(point, axis=1) + u * self._added.take(point, axis=1)
        ends = u == 1.0
        if np.count_nonzero(ends):  # the ends themselves are met exactly
            values = np.where(ends, self._all.take(point, axis=1), values)
        return values

    def step(self, tracks: Index, at: Array, h: Array) -> Array:
        """Where a step of at most ``h`` leads: to the furthest point within it up to which the path is nearly straight."""
        out = np.minimum(at + h, self.end.take(tracks))
        if not self.bent:
            return out
        inside = self._key.searchsorted(out + self._offset.take(tracks), side="right") - 1
        for i in (self._places.take(inside) > at).nonzero()[0]:
            out[i] = self._furthest(int(tracks[i]), float(at[i]), float(out[i]))
        return out

    def _furthest(self, track: int, at: float, limit: float) -> float:
        length, points = self.length[track], self.points[track]
        ahead = np.arange(*np.searchsorted(length, (at, limit), side="right"))
        if not ahead.size:  # met by rounding of the common key only
            return limit
        here = self.drive(np.array([track]), np.array([at]))
        chord = np.sqrt(((points[:, ahead] - here) ** 2).sum(axis=0))
        ends = (chord < PATH.straight * (length[ahead] - at)) | np.append(False, self.stops[track][ahead][:-1])
        bent = np.flatnonzero(ends)
        return float(length[ahead[max(int(bent[0]) - 1, 0)] if bent.size else ahead[-1]])


@dataclass(frozen=True)
class Nodes:
    """Points on tracks, in order: state ``x (nx, K)``, sensitivity ``Z (F, d, K)``, path values ``drive (d, K)``, ``track``, ``place``,
    form ``which``, ``condition`` and whether the step that leads here is ``sure`` ``(K,)``.

    Where the form changes a node stands twice, so that every step between two nodes has one form.
    """

    x: Array
    Z: Array
    drive: Array
    track: Index
    place: Array
    which: Index
    condition: Array
    sure: Mask

    def __len__(self) -> int:
        return len(self.place)

    @classmethod
    def closed(cls, found: Closed, drive: Array, track: Index, place: Array, sure: bool) -> Nodes:
        """Nodes from what Newton's method found at path values ``drive (d, n)``."""
        return cls(found.x, found.Z, drive, track, place, found.which, found.condition, np.full(len(place), sure))

    def take(self, at: Index | Mask) -> Nodes:
        """Some of the nodes."""
        return Nodes(*[getattr(self, name)[..., at] for name in self.__dataclass_fields__])

    def ends(self, left: Index, right: Index) -> tuple[Nodes, Index]:
        """The nodes at the ends of steps, each of them once, and the places of both ends ``(2, n)`` among them."""
        used, places = np.unique(np.concatenate([left, right]), return_inverse=True)
        return self.take(used), places.reshape(2, -1)

    def replaced(self, new: Nodes, at: Index) -> Nodes:
        """The nodes with those ``at`` replaced."""
        values = {f.name: getattr(self, f.name).copy() for f in fields(Nodes)}
        for name, column in values.items():
            column[..., at] = getattr(new, name)
        return Nodes(**values)

    def moved_by(self, tracks: int) -> Nodes:
        """The same on tracks that are numbered higher."""
        return replace(self, track=self.track + tracks)

    @staticmethod
    def join(parts: list[Nodes]) -> Nodes:
        """Nodes sorted by track and place (equal ones in the order given)."""
        joined = [np.concatenate([getattr(p, f.name) for p in parts], axis=-1) for f in fields(Nodes)]
        track, place = joined[3], joined[4]
        order = np.lexsort((place, track))
        return Nodes(*(values[..., order] for values in joined))

    @property
    def steps(self) -> tuple[Index, Index]:
        """First and last node of every step: neighbours on a track, apart."""
        left = np.flatnonzero((self.track[1:] == self.track[:-1]) & (self.place[1:] > self.place[:-1]))
        return left, left + 1
