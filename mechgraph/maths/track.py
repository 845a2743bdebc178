"""Tracks: the polylines of path values along which solutions are followed, the nodes found on them, and what lies between nodes.

Hermite interpolation in Newton's form: values and rates at a few nodes, evaluated between them or behind the last.

Source: Stoer and Bulirsch, Introduction to Numerical Analysis, 2002, section 2.1.5 (divided differences over double nodes).
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import cache

import numpy as np

from mechgraph.maths.newton import Closed, Problem
from mechgraph.maths.se3 import Array, Index, Mask
from mechgraph.maths.tolerances import PATH

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
        """First and last node of every step: neighbors on a track, apart."""
        left = np.flatnonzero((self.track[1:] == self.track[:-1]) & (self.place[1:] > self.place[:-1]))
        return left, left + 1


STRAIGHT_ON = 1 - 1e-9
"""Cosine between two steps above which a track goes straight on: rounding, no corner."""
CLOSEST = 1 / 16
"""Distance of two nodes, in parts of a step beside them, below which only the step's own nodes give its polynomial: divided differences
over nodes at a distance d err by the rounding of the nodes times (h / d)^3."""


def divided_differences(places: Array, values: Array, rates: Array) -> tuple[Array, Array]:
    """Coefficients ``(2w, F, n)`` and double nodes ``(2w, n)`` of the polynomials through ``w`` nodes with value and rate.

    ``places (w, n)``, ``values (w, F, n)``, ``rates (w, F, n)``; every one of the ``n`` polynomials has its own nodes.
    """
    z = places.repeat(2, axis=0)
    coefficients = [values[0]]
    between = places[1:] - places[:-1]
    # of first order: the rate at a double node, the slope of the chord between two
    first = np.empty((len(z) - 1, *values.shape[1:]), dtype=values.dtype)
    first[::2] = rates
    if len(between):
        first[1::2] = (values[1:] - values[:-1]) / between[:, None]
    column = first
    coefficients.append(column[0])
    for order in range(2, len(z)):
        column = (column[1:] - column[:-1]) / (z[order:] - z[:-order])[:, None]
        coefficients.append(column[0])
    return np.array(coefficients), z


def newton_form(coefficients: Array, nodes: Array, at: Array) -> Array:
    """``c_0 + (s - z_0) (c_1 + (s - z_1) (c_2 + ...))`` at ``at (n,)``, ``(F, n)``."""
    out = coefficients[-1].copy()
    for order in range(len(coefficients) - 2, -1, -1):
        out *= at - nodes[order]
        out += coefficients[order]
    return out


def cubic(values: Array, rates: Array, rates_there: Array, width: Array, at: Array) -> Array:
    """Cubics ``(F, n)`` at places ``at (n,)`` that are zero at 0 and ``values`` at ``width (n,)``, with rates given at both."""
    s = at / width
    left = 1.0 - s
    part = at * left
    out = values * (s * s * (1.0 + 2.0 * left))
    out += rates * (part * left)
    out -= rates_there * (part * s)
    return np.asarray(out)


def through(problem: Problem, nodes: Nodes, base: Nodes, direction: Array, at: Array) -> Array:
    """States ``(nx, n)`` at places ``at (n,)`` of the polynomial through nodes of one track, path values changing in a ``direction (d,)``.

    ``base``: ``n`` times the node from which increments are measured.
    """
    dq = problem.difference(nodes.x, np.repeat(base.x[:, :1], len(nodes), axis=1))
    rates = problem.tangent(dq, (nodes.Z * direction[:, None]).sum(axis=1))
    form = divided_differences((nodes.place - base.place[0])[:, None], dq.T[:, :, None], rates.T[:, :, None])
    coefficients, places = (np.repeat(values, len(at), axis=-1) for values in form)
    ahead = problem.corrigible(newton_form(coefficients, places, at - base.place), base.which)
    return problem.advance(base.x, ahead, base.track)


class Interpolation:
    """States between nodes of tracks: Hermite interpolation through the nodes beside a step, as far as a track goes straight on.

    What lies off the chord between two nodes is added by the sensitivity to the path values.
    """

    def __init__(self, problem: Problem, nodes: Nodes) -> None:
        self.problem, self.nodes = problem, nodes
        self.left, self.right = nodes.steps
        slope = nodes.drive[:, self.right] - nodes.drive[:, self.left]
        self.slope = slope / (nodes.place[self.right] - nodes.place[self.left])
        self._coefficients, self._z = self._polynomials()

    @property
    def begin(self) -> Index:
        """For every step the one with which its track begins, at the place zero."""
        tracks, begin = self.nodes.track[self.left], np.flatnonzero(self.nodes.place[self.left] == 0.0)
        return np.asarray(begin[np.searchsorted(tracks[begin], tracks)])

    def last(self, tracks: Index, ends: Array) -> Index:
        """The steps that lead to the ``ends`` of tracks."""
        return self.find(tracks, np.nextafter(ends[tracks], -np.inf))

    def find(self, tracks: Index, at: Array) -> Index:
        """Steps in which places of tracks lie."""
        span = float(self.nodes.place.max(initial=0.0)) + 1.0
        key = self.nodes.track[self.left] * span + self.nodes.place[self.left]
        step = np.searchsorted(key, tracks * span + at, side="right") - 1
        first = np.searchsorted(self.nodes.track[self.left], tracks, side="left")
        last = np.searchsorted(self.nodes.track[self.left], tracks, side="right") - 1
        return np.clip(step, first, last)

    def __call__(self, step: Index, at: Array, drive: Array) -> Array:
        """States ``(nx, n)`` in steps at places ``at (n,)`` with path values ``drive (d, n)`` (not put in yet)."""
        nodes, left = self.nodes, self.left[step]
        u = at - nodes.place[left]
        dq = newton_form(self._coefficients[:, :, step], self._z[:, step], u)
        off = drive - (nodes.drive[:, left] + u * self.slope[:, step])
        if np.abs(off).max(initial=0.0) > 0.0:
            right = self.right[step]
            part = u / (nodes.place[right] - nodes.place[left])
            dq += (((1 - part) * nodes.Z[:, :, left] + part * nodes.Z[:, :, right]) * off).sum(axis=1)
        return self.problem.advance(nodes.x[:, left], dq, nodes.track[left])

    def _windows(self) -> list[tuple[Index, Index]]:
        """Steps by the number of nodes through which they are interpolated, with these nodes ``(width, n)``, nearest first."""
        n = len(self.left)
        if not n:
            return []
        length = np.sqrt((self.slope * self.slope).sum(axis=0))
        unit = self.slope / np.where(length > 0, length, 1.0)
        straight = (unit[:, 1:] * unit[:, :-1]).sum(axis=0) > STRAIGHT_ON
        joined = (self.right[:-1] == self.left[1:]) & straight
        run = np.concatenate([[0], np.cumsum(~joined)])
        begin = self.left[np.searchsorted(run, run, side="left")]
        end = self.right[np.searchsorted(run, run, side="right") - 1]
        width = np.minimum(PATH.window, end - begin + 1)
        place, first = self.nodes.place, np.clip(self.left - (width - 2) // 2, begin, end - width + 1)
        for k in range(PATH.window - 1):
            a = np.minimum(first + k, end - 1)
            inside = (k < width - 1) & (a + 1 - self.left != 1)
            near = place[a + 1] - place[a] < CLOSEST * (place[self.right] - place[self.left])
            width = np.where(inside & near, 2, width)
        first = np.where(width == 2, self.left, first)
        out = []
        for w in np.unique(width):
            i = np.flatnonzero(width == w)
            names = first[i] + np.arange(w)[:, None]
            order = np.argsort(np.abs(names - self.left[i] - 0.25), axis=0, kind="stable")
            out.append((i, np.take_along_axis(names, order, axis=0)))
        return out

    def _polynomials(self) -> tuple[Array, Array]:
        """Coefficients ``(2 width, F, steps)`` and double nodes ``(2 width, steps)``, from the left node of every step."""
        nodes, windows = self.nodes, self._windows()
        width = max((len(names) for _, names in windows), default=1)
        c = np.zeros((2 * width, nodes.Z.shape[0], len(self.left)))
        z = np.zeros((2 * width, len(self.left)))
        for i, names in windows:
            left = self.left[i]
            dq = self.problem.difference(nodes.x[:, names], nodes.x[:, None, left])
            rates = (nodes.Z[:, :, names] * self.slope[:, None, i]).sum(axis=1)
            rates = self.problem.tangent(dq, rates)
            places = nodes.place[names] - nodes.place[left]
            parts = divided_differences(places, dq.swapaxes(0, 1), rates.swapaxes(0, 1))
            c[: 2 * len(names), :, i], z[: 2 * len(names), i] = parts
        return c, z


POINTS_FOR = {0.01: 3, 0.1: 4, 0.5: 6, 1.0: 8}
"""Points of a part of a step between nodes: what is integrated over it is exact to rounding, as with eight over the whole of it."""


class Rule:
    """The rule with ``count`` points in a step from -1 to 1."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.points, weights = np.polynomial.legendre.leggauss(count)
        self.places = np.concatenate([[-1.0], self.points, [1.0]])
        """The points of a step and its ends."""
        self.to_series = (
            weights[:, None] * np.polynomial.legendre.legvander(self.points, count - 1) * (np.arange(count) + 0.5)
        )
        """Coefficients of Legendre's series from values at the points."""

    def integrals(self, t: Array) -> Array:
        """Half the integrals of Legendre's polynomials from -1 to ``t (n,)``, ``(n, count)``."""
        P = np.polynomial.legendre.legvander(t, self.count)
        out = np.empty((len(t), self.count))
        out[:, 0] = 0.5 * (t + 1.0)
        k = np.arange(1, self.count)
        out[:, 1:] = 0.5 * (P[:, 2:] - P[:, : self.count - 1]) / (2 * k + 1)
        return out


@cache
def _rule(count: int) -> Rule:
    return Rule(count)


def rule(part: float = 1.0) -> Rule:
    """The rule for parts of steps between nodes."""
    return _rule(next((count for most, count in POINTS_FOR.items() if part <= most), max(POINTS_FOR.values())))
