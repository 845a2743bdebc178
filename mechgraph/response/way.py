"""A path followed one way from a closed state and tabulated: closed states and the terms of its equation of motion, place by place.

Places are distances of the coordinate from the start. Change points are leapt over where that can be proved (see ``numerics.leap``), and
otherwise passed by the careful march, or the table ends.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.driver_path import DriverPath
from mechgraph.closure.indexing import Index
from mechgraph.numerics.continuation import End, Follower
from mechgraph.numerics.crossings import WINDOW, Crossing, passed
from mechgraph.numerics.hermite import Interpolation
from mechgraph.numerics.leap import leapt
from mechgraph.numerics.tolerances import PATH
from mechgraph.numerics.tracks import Nodes, Paths
from mechgraph.response.along_terms import OF_LOADS, AlongTerms

FIRST_PART = 0.8
"""Length of path that is tabulated first (radians, or lengths / L); every further part is twice as long as the one before."""
AGAIN = 0.1
"""First step where the path is taken up again."""
PIECE = 0.64
"""Longest piece of one series (radians, or lengths / L)."""
POINTS = 16
"""Points of a series; even, so that none lies in the middle."""
FASTEST = 6.0
"""Rate of another freedom against that of the coordinate at which the table ends."""
AROUND = 0.64
"""Length of the piece with a change point in its middle: the accelerations of states beside it lose rounding over the cube of the
distance, 5e-12 at the nearest point of the series."""
SERIES_TAIL = 1e-12
"""Part of the largest coefficient that the last two of a series may have; what a smooth series leaves out behind them is far smaller."""
COEFFICIENT_NOISE = 1e-14
"""Rounding of what a series is made of, times the square of the condition."""
SHORTEST_PIECE = 1e-8
"""Shortest piece: where branches all but cross, a path turns from one towards the other within the root of what opens the crossing."""
AT_CROSSING = 0.01
"""Distance from a change point up to which a place counts as it."""
NOT_FALLING = 0.3
"""Part of the coefficients before them that the last ones of a series have where they are noise: those of a smooth series of that size
(``NOISE``, against the largest term) fall by a hundred from four to four."""
NOISE = 1e-9


@dataclass(frozen=True)
class Piece:
    """The path between two values of its coordinate: Chebyshev series ``(POINTS, 4 + m)`` of the terms (see ``along_terms``).

    ``steepness``: the largest rate of another freedom for a unit rate of the coordinate.
    """

    begin: float
    end: float
    series: Array
    steepness: float


class Way:
    """The path from a closed state ``x (nx,)`` on; tabulated up to ``length``, and no further where it is ``closed``."""

    def __init__(self, path: DriverPath, terms: AlongTerms, x: Array, sense: float) -> None:
        self.path, self.terms, self.sense = path, terms, sense
        self.begin = float(x[path.rows[0]])
        path.variant_of = np.zeros(1, dtype=np.intp)
        self.follower = Follower(path)
        self.length, self.closed = 0.0, False
        self.crossings: list[Crossing] = []
        self._next, self._ended = FIRST_PART, False
        self._pieces: list[Piece] = []
        self._starts: list[float] = []
        here = Paths([self._drives(np.zeros(2))])
        self._nodes = self.follower.follow(x[:, None], here).nodes

    def piece(self, at: float) -> Piece:
        """The piece in which a place lies."""
        return self._pieces[max(0, bisect_right(self._starts, at) - 1)]

    def extend(self, most: float) -> None:
        """Tabulate the next part, up to ``most`` at first."""
        place = min(self.length + self._next, most)
        self._next *= 2.0
        self._follow(place + AROUND / 2)
        # a part does not end beside a change point
        while near := [c.place for c in self.crossings if abs(place - c.place) < AROUND / 2 - AT_CROSSING]:
            place = max(near) + AROUND / 2
            self._follow(place + AROUND / 2)
        known = self._known()
        self.closed = place > known
        place = min(place, known)
        self._interpolation = Interpolation(self.path, self._nodes)
        if place > self.length:
            pieces = self._tabulated(self.length, place)
            self._pieces += pieces
            self._starts += [self.sense * (p.begin - self.begin) for p in pieces]
            self.length = place

    # --- following -------------------------------------------------------------------------------------------------------

    def _follow(self, goal: float) -> None:
        """Follow the path to a place, or to where it cannot be followed on."""
        there = goal - PATH.shortest  # by rounding the last node may lie before the goal
        while not self._ended and self._reached < there:
            self._take(self._march(goal, careful=False), [])
            if self._reached >= there or self._known() < self._reached:
                return
            self.follower.paths = Paths([self._drives(np.array([0.0, goal]))])
            found = leapt(self.follower, self._nodes)
            if found is not None:
                self._take(found[1], [found[0]])
                continue
            start = self._reached
            nodes = self._march(goal, careful=True)
            places = [start + at for _, at in self.follower.crossings]
            self._ended = self.follower.ends[0] is not End.REACHED
            self._take(nodes, [])
            self.follower.paths = Paths([self._drives(np.array([0.0, goal]))])
            across = [passed(self.follower, self._nodes, 0, at) for at in places]
            self.crossings += [crossing for crossing in across if crossing is not None]

    def _march(self, goal: float, careful: bool) -> Nodes:
        """Nodes from the last one on."""
        last = self._nodes.take(np.array([-1]))
        start, first = float(last.place[0]), AGAIN if len(self._nodes) > 1 else PATH.first
        paths = Paths([self._drives(np.array([start, goal]))])
        found = self.follower.follow(last.x, paths, first, last.which, careful).nodes
        return replace(found, place=start + found.place)

    def _take(self, nodes: Nodes, crossings: list[Crossing]) -> None:
        """Add nodes, without another one of the form and place of the last, and crossings."""
        last = self._nodes.take(np.array([-1]))
        new = (nodes.place > last.place) | (nodes.which != last.which)
        self._nodes = Nodes.join([self._nodes, nodes.take(new)])
        self.crossings += crossings

    def _drives(self, at: Array) -> Array:
        """Values ``(1, n)`` of the coordinate at places."""
        return np.asarray(self.begin + self.sense * at[None])

    @property
    def _reached(self) -> float:
        return float(self._nodes.place[-1])

    def _known(self) -> float:
        """How far the coordinate serves: to before the first node at which another freedom moves much faster."""
        nodes, singles = self._nodes, self.path.system.single_rows >= 0
        near = np.array([np.abs(nodes.place - c.place) < AT_CROSSING for c in self.crossings]).any(axis=0)
        steep = np.flatnonzero((np.abs(nodes.Z[singles]).max(axis=(0, 1)) > FASTEST) & ~near)
        return float(nodes.place[max(int(steep[0]) - 1, 0)]) if steep.size else self._reached

    # --- tabulating ------------------------------------------------------------------------------------------------------

    def states(self, at: Array) -> tuple[Array, Index]:
        """Closed states ``(nx, T)`` at places ``(T,)``, and their forms."""
        u, track = self._drives(at), np.zeros(len(at), dtype=np.intp)
        step = self._interpolation.find(track, at)
        x = self._interpolation(step, at, u)
        found = self.follower.newton.close(x, u, track, self._nodes.which[self._interpolation.left[step]])
        x = found.x.copy()
        for c in self.crossings:
            near = np.abs(at - c.place) < WINDOW
            x[:, near] = c.states(at[near])
        return x, found.which

    def _tabulated(self, begin: float, end: float) -> list[Piece]:
        """Pieces between two places with their series, halved until these have converged."""
        spans, out = self._spans(begin, end), []
        middles = np.array([c.place for c in self.crossings])
        while spans:
            again = []
            for (a, b), c, steepness, noise in zip(spans, *self._series(spans), strict=True):
                if (
                    (_coarse(c, noise) or b - a > POINTS * self._step(a, b))
                    and b - a > SHORTEST_PIECE
                    and not (np.abs(middles - 0.5 * (a + b)) < 0.25 * (b - a)).any()
                ):
                    again += [(a, 0.5 * (a + b)), (0.5 * (a + b), b)]
                else:
                    begin, end = self._drives(np.array([a, b]))[0].tolist()
                    out.append(Piece(begin, end, c, float(steepness)))
            spans = again
        return sorted(out, key=lambda piece: self.sense * piece.begin)

    def _step(self, begin: float, end: float) -> float:
        """The shortest step of the path between two places: where it turns between two points of a series, its nodes are close."""
        places = self._nodes.place
        steps = np.diff(places[max(0, np.searchsorted(places, begin) - 1) : np.searchsorted(places, end) + 1])
        return float(steps[steps > 0.0].min())

    def _spans(self, begin: float, end: float) -> list[tuple[float, float]]:
        """Places between which pieces are tried first: change points in the middle of theirs."""
        places = sorted(c.place for c in self.crossings if begin < c.place < end)
        cuts = [begin, end]
        for i, place in enumerate(places):
            room = min(place - begin, end - place, *np.abs(np.delete(places, i) - place) / 2, AROUND / 2)
            cuts += [place - room, place + room]
        out = []
        for a, b in pairwise(np.unique(cuts).tolist()):
            whole = any(a < place < b for place in places)
            edges = np.linspace(a, b, 1 + (1 if whole else max(1, int(np.ceil((b - a) / PIECE - 1e-9)))))
            out += list(pairwise(edges.tolist()))
        return out

    def _series(self, spans: list[tuple[float, float]]) -> tuple[Array, Array, Array]:
        """Series ``(spans, POINTS, 4 + m)`` over spans of places, how steep the path is in each, and the noise of the series."""
        nodes = np.cos(np.pi * (np.arange(POINTS) + 0.5) / POINTS)
        at = np.concatenate([0.5 * (a + b) + 0.5 * (b - a) * nodes for a, b in spans])
        x, which = self.states(at)
        here = Configuration(self.path.system, x)
        f = self.path.solver.factored(here, which)
        values = self.terms.tabulated(here, f).T.reshape(len(spans), POINTS, -1)
        T = np.polynomial.chebyshev.chebvander(nodes, POINTS - 1) * (2.0 / POINTS)
        T[:, 0] *= 0.5
        singles = self.path.system.single_rows >= 0
        steepness = np.abs(f.sensitivity()[singles, 0]).max(axis=0).reshape(len(spans), POINTS).max(axis=1)
        # rounding over the square of the distance from a singular position, which the condition measures
        noise = COEFFICIENT_NOISE * (f.condition**2).reshape(len(spans), POINTS).max(axis=1)
        return np.einsum("pk,spq->skq", T, values), steepness, noise


def _coarse(c: Array, noise: float) -> bool:
    """Whether series ``(POINTS, 4 + m)`` leave more out than rounding, which stays however short the piece is."""
    late, last = np.abs(c[-8:-4]).max(axis=0), np.abs(c[-4:]).max(axis=0)
    tail, size = np.abs(c[-2:]).max(axis=0), np.abs(c).max(axis=0)
    # the mass beside itself, forces beside what gives the mass an acceleration of one as well, places beside one (radian, length / L)
    of_forces, others = np.full(OF_LOADS - 1, size[:2].max()), np.maximum(size[OF_LOADS:], 1.0)
    largest = np.concatenate([size[:1], of_forces, others])
    rounding = (last > NOT_FALLING * late) & (last < max(NOISE, noise) * largest)
    small = tail <= SERIES_TAIL * np.maximum(size, 1e-3 * largest)
    return bool(not (small | rounding).all())
