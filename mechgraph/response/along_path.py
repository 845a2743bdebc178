"""Stages along a path, for mobility 1: what the equation of motion needs is tabulated once along the path, which is then cheap to follow.

On the path every state is a function of one coordinate ``u``, that of the freedom which moves fastest, and with loads that depend on
positions, and on rates no more than linearly,

    M(u) u'' = Q_0(u) + Q_1(u) u' + Q_2(u) u'^2.

The path is followed by the follower that kinetostatics uses, so that change points are passed on the branch of continuous velocity,
with certificates. Between pieces of the path the quotients ``Q_i / M`` are Chebyshev series.
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.driver_path import DriverPath
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.rank import closure_rank
from mechgraph.closure.solver import closure_solver
from mechgraph.numerics.continuation import Follower
from mechgraph.numerics.crossings import WINDOW, Crossing, passed
from mechgraph.numerics.hermite import Interpolation
from mechgraph.numerics.tracks import Paths
from mechgraph.response.chart import Closed
from mechgraph.response.charts import Task
from mechgraph.response.motion_equations import along_one, kinetic_energy

CHUNK = 0.8
"""Length of path that is followed at a time (radians, or lengths / L)."""
PIECE = 0.32
"""Longest piece of one series (radians, or lengths / L)."""
POINTS = 16
"""Points of a series; even, so that none lies in the middle."""
FAST = 2.0
"""Rate of another freedom against that of the coordinate above which it becomes the coordinate."""
FASTEST = 6.0
"""The same at which the table of a coordinate ends."""
AROUND = 0.32
"""Length of the piece with a change point in its middle: the accelerations of states beside it lose rounding over the cube of the
distance, 4e-11 at the nearest point of the series."""
TAIL = 1e-12
"""Part of the largest coefficient that the last two of a series may have; what a smooth series leaves out behind them is far smaller."""
ROUNDING = 1e-14
"""Rounding of what a series is made of, times the square of the condition."""
SHORTEST = 0.01
"""Shortest piece."""
TURN = 2 * np.pi
UNEVEN = 0.37
"""Where in its part of a turn loads are compared with those a turn later: not at the quarters, where change points often are."""
BACK = 1e-9
"""Difference of poses (and part of the quotients) after a turn of the coordinate up to which the path has come back."""


@dataclass(frozen=True)
class _Piece:
    """The path between two places: Chebyshev series ``(POINTS, 5)`` of ``Q_0/M, Q_1/M, Q_2/M`` and of the power ``P_1, P_2``.

    ``steepness``: the largest rate of another freedom for a unit rate of the coordinate.
    """

    begin: float
    end: float
    series: Array
    steepness: float


class Arc:
    """The path around a closed state ``x (nx,)``, by the coordinate of one freedom; extended both ways as far as it is asked for."""

    def __init__(self, task: Task, x: Array) -> None:
        self.task = task
        s = task.system
        motion = closure_rank(Configuration(s, x[:, None]), engine=task.engine).motions[:, 0]
        self.singles = np.flatnonzero(s.single_rows >= 0)
        self.column = int(self.singles[np.argmax(np.abs(motion[self.singles]))])
        self.row = int(s.single_rows[self.column])
        columns = np.array([self.column], dtype=np.intp)
        self.path = DriverPath(s, closure_solver(task.engine, columns), partial(_same, s))
        self.begin = float(x[self.row])
        self._pieces: dict[float, list[_Piece]] = {1.0: [], -1.0: []}
        self._ends = {1.0: x, -1.0: x}
        self._reach = {1.0: self.begin, -1.0: self.begin}
        self._closed = {1.0: False, -1.0: False}
        self._chunks: dict[float, list[_Chunk]] = {1.0: [], -1.0: []}
        self._advance: Array | None = None
        self._sense = 1.0

    def piece(self, u: float) -> tuple[_Piece, float] | None:
        """The piece in which a place lies, and the whole turns by which the place is further on; None where the table ends before."""
        turns = float(self._turns(np.array([u]))[0])
        u -= TURN * turns
        sense = 1.0 if u >= self.begin else -1.0
        pieces = self._pieces[sense]
        while (not pieces or sense * u > sense * self._reach[sense]) and not self._closed[sense]:
            self._extend(sense)
            if self._advance is not None and not turns:
                return self.piece(u)
        if not pieces or sense * u > sense * self._reach[sense]:
            return None
        starts = [sense * p.begin for p in pieces]
        return pieces[max(0, bisect_right(starts, sense * u) - 1)], turns

    def _turns(self, u: Array) -> Array:
        """Whole turns by which places ``u (T,)`` are further on than where they are tabulated."""
        if self._advance is None:
            return np.zeros(len(u))
        return np.asarray(self._sense * np.floor(self._sense * (u - self.begin) / TURN))

    def close(self, u: Array) -> Closed:
        """Closed states at places ``u (T,)`` within the table."""
        s = self.task.system
        turns = self._turns(u)
        home = u - TURN * turns
        x, which = np.empty((s.n_state, len(u))), np.empty(len(u), dtype=np.intp)
        for sense, mine in ((1.0, home >= self.begin), (-1.0, home < self.begin)):
            chunks = self._chunks[sense]
            if mine.any() and not chunks:
                self._extend(sense)
            of = np.searchsorted([sense * c.end for c in chunks], sense * home)
            for i in np.unique(of[mine]):
                some = mine & (of == i)
                x[:, some], which[some] = chunks[min(int(i), len(chunks) - 1)].states(home[some])
        if self._advance is not None:
            x += self._advance[:, None] * turns
        here = Configuration(s, x)
        return Closed(here, self.path.solver.factored(here, which), np.ones(len(u), dtype=bool))

    def _extend(self, sense: float) -> None:
        """Follow the path a chunk further and tabulate it, up to where another freedom moves much faster, or until it comes back."""
        chunk = _Chunk(self, self._ends[sense], sense)
        if chunk.end == self._reach[sense]:
            self._closed[sense] = True
            return
        self._chunks[sense].append(chunk)
        self._pieces[sense] += chunk.pieces()
        self._ends[sense], self._reach[sense], self._closed[sense] = chunk.last, chunk.end, chunk.closed
        whole = sense * (chunk.end - self.begin) >= TURN and not self.task.system.is_length[self.column]
        if whole and self._advance is None:
            self._advance, self._sense = self._after_a_turn(sense), sense

    def _after_a_turn(self, sense: float) -> Array | None:
        """How the state has advanced after a turn of the coordinate, where all links and loads are back; None where they are not."""
        s = self.task.system
        ends = self.close(self.begin + sense * TURN * np.array([0.0, 1.0])).here
        if np.abs(ends.poses[..., 1] - ends.poses[..., 0]).max() > BACK:
            return None
        out = np.zeros(s.n_state)
        rows = s.single_rows[self.singles]
        turned = sense * (ends.x[rows, 1] - ends.x[rows, 0])
        out[rows] = np.where(s.is_length[self.singles], 0.0, TURN * np.round(turned / TURN))
        # a load may count turns, as a spring in a freedom does that winds up: then nothing comes back
        around = self.close(self.begin + sense * TURN * (np.arange(POINTS) + UNEVEN) / POINTS)
        further = Configuration(s, around.here.x + sense * out[:, None])
        loads, factored = self.task.loads, self.path.solver.factored(further, around.f.which)
        now, then = along_one(around.here, around.f, loads), along_one(further, factored, loads)
        same = all(np.abs(a - b).max() <= BACK * np.abs(a).max(initial=1.0) for a, b in zip(now, then, strict=True))
        return out if same else None


class _Chunk:
    """A chunk of path from a state on, one way."""

    def __init__(self, arc: Arc, x: Array, sense: float) -> None:
        self.arc, self.sense, self.begin = arc, sense, float(x[arc.row])
        arc.path.variant_of = np.zeros(1, dtype=np.intp)
        self.follower = Follower(arc.path)
        points = np.array([[self.begin, self.begin + sense * (CHUNK + 2 * AROUND)]])
        tracks = self.follower.follow(x[:, None], Paths([points]))
        nodes = tracks.nodes
        near = np.array([np.abs(nodes.place - place) < SHORTEST for _, place in tracks.crossings]).any(axis=0)
        steep = (np.abs(nodes.Z[arc.singles]).max(axis=(0, 1)) > FASTEST) & ~near
        place = float(nodes.place[-1]) if not steep.any() else float(nodes.place[max(int(np.argmax(steep)) - 1, 0)])
        place = min(place, CHUNK)
        found = [passed(self.follower, nodes, 0, at) for _, at in tracks.crossings if at < place + AROUND / 2]
        self.crossings: list[Crossing] = [c for c in found if c is not None]
        self.closed = place < CHUNK
        # a chunk does not end beside a change point, so that the next one starts at a regular state
        for c in self.crossings:
            if abs(place - c.place) < AROUND:
                place = c.place + AROUND
        self.length = place
        self.end = self.begin + sense * place
        self.interpolation = Interpolation(arc.path, nodes)
        self.last = self.states(np.array([self.end]))[0][:, 0] if place > 0 else x

    def states(self, u: Array) -> tuple[Array, Index]:
        """Closed states ``(nx, T)`` at places ``(T,)``, and their forms."""
        at = self.sense * (u - self.begin)
        track = np.zeros(len(u), dtype=np.intp)
        step = self.interpolation.find(track, at)
        x = self.interpolation(step, at, u[None])
        found = self.follower.newton.close(
            x, u[None], track, self.interpolation.nodes.which[self.interpolation.left[step]]
        )
        x, which = found.x.copy(), found.which
        for c in self.crossings:
            near = np.abs(at - c.place) < WINDOW
            x[:, near] = c.states(at[near])
        return x, which

    def pieces(self) -> list[_Piece]:
        """Pieces with their series, halved until these have converged."""
        middles = np.array([c.place for c in self.crossings])
        cuts = np.array([0.0, self.length])
        for c in self.crossings:
            cuts = np.append(cuts, [c.place - AROUND / 2, c.place + AROUND / 2])
        cuts = np.unique(np.clip(cuts, 0.0, self.length))
        spans = []
        for a, b in pairwise(cuts.tolist()):
            around = (np.abs(middles - 0.5 * (a + b)) < 1e-9).any()
            n = 1 if around else max(1, int(np.ceil((b - a) / PIECE - 1e-9)))
            edges = np.linspace(a, b, n + 1)
            spans += list(pairwise(edges.tolist()))
        out: list[_Piece] = []
        while spans:
            again = []
            for (a, b), c, steepness, noise in zip(spans, *self._series(spans), strict=True):
                tail, size = np.abs(c[-2:]).max(axis=0), np.abs(c).max(axis=0)
                coarse = (tail > max(TAIL, noise) * np.maximum(size, 1e-3 * size[:3].max())).any()
                if coarse and b - a > SHORTEST and not (np.abs(middles - 0.5 * (a + b)) < 0.25 * (b - a)).any():
                    again += [(a, 0.5 * (a + b)), (0.5 * (a + b), b)]
                else:
                    out.append(_Piece(self.begin + self.sense * a, self.begin + self.sense * b, c, float(steepness)))
            spans = again
        return sorted(out, key=lambda p: self.sense * p.begin)

    def _series(self, spans: list[tuple[float, float]]) -> tuple[Array, Array, Array]:
        """Series ``(spans, POINTS, 5)`` over spans of places, how steep the path is in each, and the noise of the series."""
        nodes = np.cos(np.pi * (np.arange(POINTS) + 0.5) / POINTS)
        u = np.concatenate([self.begin + self.sense * (0.5 * (a + b) + 0.5 * (b - a) * nodes) for a, b in spans])
        x, which = self.states(u)
        here = Configuration(self.arc.task.system, x)
        f = self.arc.path.solver.factored(here, which)
        quotients, powers = along_one(here, f, self.arc.task.loads)
        values = np.concatenate([quotients, powers]).T.reshape(len(spans), POINTS, 5)
        T = np.polynomial.chebyshev.chebvander(nodes, POINTS - 1) * (2.0 / POINTS)
        T[:, 0] *= 0.5
        steepness = np.abs(f.sensitivity()[self.arc.singles, 0]).max(axis=0).reshape(len(spans), POINTS).max(axis=1)
        # rounding over the square of the distance from a singular position, which the condition measures
        noise = ROUNDING * (f.condition**2).reshape(len(spans), POINTS).max(axis=1)
        return np.einsum("pk,spq->skq", T, values), steepness, noise


class PathStage:
    """Implements ``integration.Stage`` along an arc, from a place ``u`` with rate ``v``."""

    def __init__(self, arc: Arc, u: float, v: float) -> None:
        self.arc, self.task, self._first = arc, arc.task, np.array([u, v, 0.0])
        self._piece: _Piece | None = None
        self._turns = 0.0
        here = arc.close(np.array([u])) if arc.piece(u) is not None else None
        self.energy = 1.0
        if here is not None:
            V = here.here.link_twists(here.f.sensitivity()[:, 0])
            mass = 2.0 * float(kinetic_energy(here.here, V)[0])
            force = abs(self._quotients(u)[0]) * mass
            self.energy = 0.5 * mass * v * v + force or 1.0

    def begin(self) -> Array:
        """See ``Stage``."""
        return self._first

    def _quotients(self, u: float) -> Array:
        piece, turns = self._piece, self._turns
        w = u - TURN * turns
        if piece is None or not min(piece.begin, piece.end) <= w <= max(piece.begin, piece.end):
            found = self.arc.piece(u)
            if found is None:
                return np.full(5, np.nan)
            self._piece, self._turns = piece, turns = found
            w = u - TURN * turns
        z = (2.0 * w - piece.begin - piece.end) / (piece.end - piece.begin)
        # Chebyshev polynomials by their angles: one cosine each
        angle = np.arccos(min(1.0, max(-1.0, z)))
        return np.cos(_ORDERS * angle) @ piece.series

    def rates(self, t: float, y: Array) -> Array:
        """See ``Stage``."""
        u, v = float(y[0]), float(y[1])
        q0, q1, q2, p1, p2 = self._quotients(u).tolist()
        return np.array([v, q0 + v * (q1 + v * q2), v * (p1 + v * p2)])

    def accepted(self, t: float, y: Array) -> bool:
        """See ``Stage``."""
        self._quotients(float(y[0]))
        return self._piece is not None and self._piece.steepness <= FAST

    def following(self, t: float, y: Array) -> PathStage:
        """See ``Stage``."""
        closed = self.arc.close(y[:1])
        dq = closed.f.sensitivity()[:, 0, 0] * y[1]
        arc = Arc(self.arc.task, closed.here.x[:, 0])
        return PathStage(arc, arc.begin, float(dq[arc.column]))

    def states(self, t: Array, y: Array) -> tuple[Closed, Array]:
        """See ``Stage``."""
        return self.arc.close(y[0]), y[1:2]


def _same(system: System, variants: Any) -> System:
    return system


_ORDERS = np.arange(POINTS, dtype=float)
