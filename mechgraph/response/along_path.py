"""Stages along a path, for mobility 1: what the equation of motion needs is tabulated once along the path, which is then cheap to follow.

On the path every state is a function of one coordinate ``u``, that of the freedom which moves fastest, and

    (M(u) u'^2 / 2)' = Q(u, u', t) u',    Q = Q_0(u) + P_1(u) + P_2(u) u' + F(u, u', t)

with ``F`` of the loads that are no smooth function of the place, linear in the rates: laws, tables and functions (see ``along_terms``);
and with the rate ``w = sqrt(M / M_0) u'``, in which the mass is that at the start, M_0,

    u' = w / sqrt(M / M_0),    w' = Q / sqrt(M M_0).

No derivative of the mass is needed, which is the accelerations of the mechanism: beside a change point these magnify rounding by the
cube of the distance, rates by the square.

The path is followed by the follower that kinetostatics uses, so that change points are passed on the branch of continuous velocity,
with certificates. In pieces of the path the terms are Chebyshev series.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.driver_path import DriverPath
from mechgraph.closure.indexing import System
from mechgraph.closure.rank import closure_rank
from mechgraph.closure.solver import closure_solver
from mechgraph.response.along_terms import OF_LOADS, AlongTerms
from mechgraph.response.chart import Closed, Stopped
from mechgraph.response.charts import Task
from mechgraph.response.motion_equations import MASSLESS, along_one
from mechgraph.response.way import POINTS, Piece, Way

FAST = 2.0
"""Rate of another freedom against that of the coordinate above which it becomes the coordinate."""
FURTHEST = 4.0 * np.pi
"""Distance beyond what is tabulated to which a trial step may lead; what is further off asks for a shorter one."""
UNEVEN = 0.37
"""Where in its part of a turn loads are compared with those a turn later: not at the quarters, where change points often are."""
PERIODIC = 1e-9
"""Difference of poses (and part of the largest term) after a turn of the coordinate up to which the path has come back."""

AT_DEAD_POINT = (
    "only links without inertia move in this position, as a massless crank at its dead point does, and nothing decides how they go "
    "on. Give them mass or inertia, or start in another position"
)


class Arc:
    """The path around a closed state ``x (nx,)``, by the coordinate of one freedom; extended both ways as far as it is asked for.

    It begins there with the ``rate`` that the coordinate has at rates ``dq (F,)``.
    """

    def __init__(self, task: Task, x: Array, dq: Array) -> None:
        self.task = task
        s = task.system
        motion = closure_rank(Configuration(s, x[:, None]), engine=task.engine).motions[:, 0]
        singles = np.flatnonzero(s.single_rows >= 0)
        self.column = int(singles[np.argmax(np.abs(motion[singles]))])
        self.turn = float(s.periods[self.column]) if np.isfinite(s.periods[self.column]) else 0.0
        """By how much the coordinate grows in a whole turn, or round a closed curve; zero where it goes on."""
        columns = np.array([self.column], dtype=np.intp)
        self.path = DriverPath(s, closure_solver(task.engine, columns), partial(_same, s))
        self.begin, self.rate = float(x[s.single_rows[self.column]]), float(dq[self.column])
        self._first_way = 1 if self.rate >= 0.0 else -1
        self.terms = AlongTerms(s, task.loads)
        self._ways = {sense: Way(self.path, self.terms, x, float(sense)) for sense in (1, -1)}
        self.advance: Array | None = None
        """What a turn adds to the state where it comes back then; None while it does not."""
        self._sense = 1.0

    def piece(self, u: float) -> tuple[Piece, float] | None:
        """The piece in which a place lies, and the whole turns by which the place is further on; None where the table ends before."""
        turns = float(self._turns(np.array([u]))[0])
        u -= self.turn * turns
        way = self._ways[(u > self.begin) - (u < self.begin) or self._first_way]
        at = way.sense * (u - self.begin)
        if not at < way.length + FURTHEST:
            return None
        while (at > way.length or not way.length) and not way.closed:
            self._extend(way)
            if self.advance is not None and not turns:
                return self.piece(u)
        return None if at > way.length or not way.length else (way.piece(at), turns)

    def _turns(self, u: Array) -> Array:
        """Whole turns by which places ``u (T,)`` are further on than where they are tabulated."""
        if self.advance is None:
            return np.zeros(len(u))
        return np.asarray(self._sense * np.floor(self._sense * (u - self.begin) / self.turn))

    def close(self, u: Array) -> Closed:
        """Closed states at places ``u (T,)`` within the table."""
        s = self.task.system
        turns = self._turns(u)
        home = u - self.turn * turns
        x, which = np.empty((s.n_state, len(u))), np.empty(len(u), dtype=np.intp)
        for way in self._ways.values():
            mine = np.where(home == self.begin, self._first_way, np.sign(home - self.begin)) == way.sense
            if mine.any():
                if not way.length:
                    self._extend(way)
                x[:, mine], which[mine] = way.states(way.sense * (home[mine] - self.begin))
        if self.advance is not None:
            x += self.advance[:, None] * turns
        here = Configuration(s, x)
        return Closed(here, self.path.solver.factored(here, which), np.ones(len(u), dtype=bool))

    def _extend(self, way: Way) -> None:
        """Tabulate the path further, up to where another freedom moves much faster, or until it comes back."""
        way.extend(self.turn if way.length < self.turn else np.inf)
        if 0.0 < self.turn <= way.length and self.advance is None:
            self.advance, self._sense = self._after_a_turn(way.sense), way.sense

    def _after_a_turn(self, sense: float) -> Array | None:
        """How the state has advanced after a turn of the coordinate, where all links and loads are back; None where they are not."""
        s = self.task.system
        ends = self.close(self.begin + sense * self.turn * np.array([0.0, 1.0])).here
        if np.abs(ends.poses[..., 1] - ends.poses[..., 0]).max() > PERIODIC:
            return None
        out = np.zeros(s.n_state)
        singles = np.flatnonzero(s.single_rows >= 0)
        rows = s.single_rows[singles]
        turned = sense * (ends.x[rows, 1] - ends.x[rows, 0])
        out[rows] = s.rounds(singles, turned)
        # a smooth load may count turns, as a spring in a freedom does that winds up: then nothing comes back
        around = self.close(self.begin + sense * self.turn * (np.arange(POINTS) + UNEVEN) / POINTS)
        further = Configuration(s, around.here.x + sense * out[:, None])
        loads, factored = self.terms.smooth, self.path.solver.factored(further, around.f.which)
        now, then = along_one(around.here, around.f, loads), along_one(further, factored, loads)
        return out if np.abs(now - then).max() <= PERIODIC * np.abs(now).max() else None


class PathStage:
    """Implements ``integration.Stage`` along an arc, from a place ``u`` with rate ``v`` at a time."""

    jacobian = None

    def __init__(self, arc: Arc, t: float, u: float, v: float) -> None:
        self.arc, self.task, self._first = arc, arc.task, np.array([u, v, 0.0])
        self._piece: Piece | None = None
        self._turns = 0.0
        self._mass, smooth, *_ = (terms := self._terms(u)).tolist()
        if self._piece is not None and self._mass <= MASSLESS * np.abs(self._piece.series[:, 0]).sum():
            raise Stopped(AT_DEAD_POINT)
        stored, rest = self._forces(terms, v, np.array([t]))
        self.energy = 0.5 * self._mass * v * v + abs(smooth + float(stored[0] + rest[0])) or 1.0

    @property
    def engine(self) -> str:
        """See ``Stage``."""
        return self.task.engine

    def begin(self) -> Array:
        """See ``Stage``."""
        return self._first

    def _terms(self, u: float) -> Array:
        """Values of the series at a place."""
        piece, turns = self._piece, self._turns
        w = u - self.arc.turn * turns
        if piece is None or not min(piece.begin, piece.end) <= w <= max(piece.begin, piece.end):
            found = self.arc.piece(u)
            if found is None:
                return np.full(OF_LOADS, np.nan)
            self._piece, self._turns = piece, turns = found
            w = u - self.arc.turn * turns
        z = (2.0 * w - piece.begin - piece.end) / (piece.end - piece.begin)
        # Chebyshev polynomials by their angles: one cosine each
        angle = np.arccos(min(1.0, max(-1.0, z)))
        return np.cos(_ORDERS * angle) @ piece.series

    def _forces(self, terms: Array, v: float, t: Array) -> tuple[Array, Array]:
        """Forces ``(T,)`` of the loads that are not tabulated, stored and not, at the place last asked for."""
        of = self.arc.terms
        if not (of.stored or of.rest):
            return np.zeros(len(t)), np.zeros(len(t))
        values = terms[OF_LOADS:] * of.sizes
        if self._turns and self.arc.advance is not None:
            values += of.after_turns(self.arc.advance, self._turns)
        return of.forces(values, v, t)

    def rates(self, t: float, y: Array) -> Array:
        """See ``Stage``."""
        u, w = float(y[0]), float(y[1])
        terms = self._terms(u)
        mass, stored, p1, p2 = terms[:OF_LOADS].tolist()
        if not mass > 0.0:
            return np.full(3, np.nan)
        size = math.sqrt(mass / self._mass)
        v = w / size
        rest = p1 + v * p2
        if len(terms) > OF_LOADS:
            by_stored, by_rest = self._forces(terms, v, np.array([t]))
            stored, rest = stored + float(by_stored[0]), rest + float(by_rest[0])
        return np.array([v, (stored + rest) / (size * self._mass), v * rest])

    def by_time(self, t: float, y: Array) -> tuple[Callable[[Array], Array], Array] | None:
        """See ``Stage``."""
        if not any(load.of_time for load in (*self.arc.terms.stored, *self.arc.terms.rest)):
            return None
        terms = self._terms(float(y[0]))
        root = math.sqrt(float(terms[0]) * self._mass)
        v = float(y[1]) * self._mass / root

        def accelerations(times: Array) -> Array:
            return np.add(*self._forces(terms, v, times))[None] / root

        return accelerations, y[1:2]

    def accepted(self, t: float, y: Array) -> bool:
        """See ``Stage``."""
        self._terms(float(y[0]))
        return self._piece is not None and self._piece.steepness <= FAST

    def following(self, t: float, y: Array) -> PathStage:
        """See ``Stage``."""
        closed, v = self.states(np.array([t]), y[:, None])
        dq = closed.f.sensitivity()[:, 0, 0] * v[0, 0]
        arc = Arc(self.arc.task, closed.here.x[:, 0], dq)
        stage = PathStage(arc, t, arc.begin, arc.rate)
        # with the energy that there is, which the rate has less well where the mass changes fast
        stage._first[1] = math.copysign(math.sqrt(self._mass / stage._mass) * y[1], arc.rate)
        return stage

    def states(self, t: Array, y: Array) -> tuple[Closed, Array]:
        """See ``Stage``."""
        mass = np.array([self._terms(u)[0] for u in y[0].tolist()])
        return self.arc.close(y[0]), y[1:2] / np.sqrt(mass / self._mass)


def _same(system: System, variants: Any) -> System:
    return system


_ORDERS = np.arange(POINTS, dtype=float)
