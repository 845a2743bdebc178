"""Positions along paths of driver values: the closure equations as a problem of path following, what is asked for and what is found.

One driver: the positions asked for lie on one curve, so it is followed once from the start up to the largest and once down to the
smallest value, whatever the order in which they are asked for, and however many cases ask. Several drivers: the path is the polygon
start -> first -> second ...
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.one_state import OneState
from mechgraph.closure.solver import ClosureSolver, FactoredClosure
from mechgraph.numerics.continuation import Follower, Tracks
from mechgraph.numerics.crossings import Crossing
from mechgraph.numerics.newton import Work
from mechgraph.numerics.tracks import Nodes, Paths

Mask = NDArray[np.bool_]

FARTHEST = 1e6
"""Longest way of a driver from its start (radians, or lengths / L)."""
BLOCK = 1024
"""Positions evaluated together, so that what is computed on the way stays in the cache of a core (measured)."""


def far_faults(names: Iterable[str], ways: Array, units: Array, most: Array, advice: str = "") -> list[str]:
    """What is wrong with ways that would be followed for hours."""
    return [
        f"{name}: comes {way * unit:.3g} away from the start; expected at most {limit * unit:.3g}{advice}"
        for name, way, unit, limit in zip(names, ways, units, most, strict=True)
        if way > limit
    ]


class Status(Enum):
    """Outcome at one position; the value is the text that a table shows."""

    OK = "ok"
    DEAD_POINT = "dead point"
    OUT_OF_REACH = "out of reach"
    BEYOND_DEAD_POINT = "beyond a dead point"
    CHANGE_POINT = "change point"
    ACTUATORS_REST = "actuators at dead point"
    NOT_CLOSED = "loops not closed"
    NOT_FOLLOWED = "not followed"
    BEYOND_TOLERANCE = "beyond tolerance"


def in_blocks(places: Index, most: int = BLOCK) -> list[Index]:
    """Places in parts of about equal size, at most so many each; at least one part."""
    return [np.asarray(part) for part in np.array_split(places, max(1, -(-len(places) // most)))]


SystemOf = Callable[[Index], System]


class DriverPath:
    """The closure equations with the coordinates ``columns`` given along a path (implements ``numerics.newton.Problem``).

    ``system_of(variants)`` is the system with the numbers of variants; ``variant_of`` says which variant each track follows. ``start`` is
    a state that is evaluated already, where there is one variant alone.
    """

    def __init__(
        self, system: System, solver: ClosureSolver, system_of: SystemOf, start: Configuration | None = None
    ) -> None:
        self.system, self.solver = system, solver
        self.columns = solver.fixed
        self.rows = system.single_rows[self.columns]
        self.size = (system.n_freedoms, len(self.columns))
        self.paced = bool(system.is_length[self.columns].any())
        self.bend = system.bend
        self.carries = True
        """Whether what is left free can be carried on by periods of the motion."""
        self._system_of, self._start = system_of, start
        self._start_bytes = b"" if start is None else start.x.tobytes()
        self.variant_of: Index = np.zeros(0, dtype=np.intp)

    def at(self, x: Array, drive: Array, tracks: Index) -> Configuration:
        """See ``numerics.newton.Problem``."""
        x = x.copy()
        x[self.rows] = drive
        if x.shape[1] != 1:
            return Configuration(self.system_on(tracks), x)
        if self._start is not None and x.tobytes() == self._start_bytes:
            return self._start
        system = self.system_on(tracks)
        matrices = system.one_state
        return Configuration(system, x, None if matrices is None else OneState(matrices, x))

    def system_on(self, tracks: Index) -> System:
        """The system with the numbers of the variants that tracks follow."""
        return self._system_of(self.variant_of[tracks])

    def chosen(self, point: Configuration, which: Index) -> Index:
        """See ``numerics.newton.Problem``."""
        return self.solver.chosen(point, which)

    def factored(self, point: Configuration, which: Index) -> FactoredClosure:
        """See ``numerics.newton.Problem``."""
        return self.solver.factored(point, which)

    def sensitivity(self, point: Configuration, factored: FactoredClosure) -> Array:
        """See ``numerics.newton.Problem``."""
        return factored.sensitivity()

    def advance(self, x: Array, dq: Array, tracks: Index) -> Array:
        """See ``numerics.newton.Problem``."""
        return self.system.advance(x, dq)

    def difference(self, x1: Array, x0: Array) -> Array:
        """See ``numerics.newton.Problem``."""
        return self.system.difference(x1, x0)

    def tangent(self, dq: Array, rates: Array) -> Array:
        """See ``numerics.newton.Problem``."""
        return self.system.tangent(dq, rates)

    def pace(self, x: Array, rates: Array) -> Array:
        """The largest rate, slides that stand in no closure row left out; 0 where nothing turns, so that bodies are displaced only.

        A slide that is out by more than L counts by its rate over how far it is out: so the equations change.
        """
        s, size = self.system, np.abs(rates)
        turning = size[~s.is_length].max(axis=0, initial=0.0) > 0
        size[s.is_length] /= np.maximum(np.abs(x[s.single_rows[s.is_length]]), 1.0)
        return np.where(turning, np.minimum(size[~s.carrying].max(axis=0, initial=0.0), 1.0), 0.0)

    def corrigible(self, dq: Array, which: Index) -> Array:
        """See ``ClosureSolver.corrigible``."""
        return self.solver.corrigible(dq, which)


@dataclass(frozen=True)
class Request:
    """Positions asked of one closed start ``x (nx,)`` of a ``variant``: driver values ``(d, n)`` in order, and their flat ``places``."""

    x: Array
    variant: int
    values: Array
    places: Index
    via: Array | None = None
    """Driver values ``(d, k)`` to be passed before the first position."""

    def polygon(self, rows: Index) -> Array:
        """The driver values of the start, of what is to be passed and of the positions, one after the other."""
        start = self.x[rows][:, None]
        return np.concatenate([start, self.values] if self.via is None else [start, self.via, self.values], axis=1)


def requests(x: Array, values: Array, batch: tuple[int, ...]) -> list[Request]:
    """What is asked of starts ``x (nx, V)``, NaN where there is none, by driver values ``(d, T)`` of a batch of positions.

    Of one start: with one driver all cases lie on one curve; with several, each case has a polygon of its own.
    """
    T, N = values.shape[1], batch[-1] if batch else 1
    if x.shape[1] == 1:
        whole = T if len(values) == 1 else N
        return [Request(x[:, 0], 0, values[:, i : i + whole], np.arange(i, i + whole)) for i in range(0, T, whole)]
    begun = np.flatnonzero(np.isfinite(x).all(axis=0)).tolist()
    return [Request(x[:, v], v, values[:, v * N : (v + 1) * N], np.arange(v * N, (v + 1) * N)) for v in begun]


@dataclass
class Positions:
    """States ``(nx, T)``, statuses ``(T,)`` and forms ``(T,)`` of all positions; ``reached (d, T)`` the last driver values before what was
    not reached; ``here`` the evaluation where all positions were closed in one block.

    ``place (T,)`` and ``track (T,)`` say where on the followed tracks they lie; ``near (T,)`` is the number of the crossing beside which
    a position lies, or -1. Where the motion repeats itself, ``turns (T,)`` periods are taken off, in which freedoms ``gained (F, T)``;
    ``spin (F, nodes)`` is what turns passive bodies on by a period.
    """

    x: Array
    status: np.ndarray
    which: Index
    reached: Array
    track: Index
    place: Array
    tracks: Tracks
    follower: Follower
    near: Index
    crossings: list[Crossing]
    here: Configuration | None = None
    turns: Index | None = None
    gained: Array | None = None
    spin: Array | None = None
    left: NDArray[Any] = field(default_factory=lambda: np.zeros(0, dtype=object))
    """The freedom that leaves its range before a position, or an empty text."""

    def __post_init__(self) -> None:
        if not self.left.size:
            self.left = np.full(len(self.status), "", dtype=object)

    @property
    def moved(self) -> Mask:
        """Which positions have a state and rates: those that are solved, and change points."""
        return np.asarray((self.status == Status.OK) | (self.status == Status.CHANGE_POINT))

    def interpolate(self) -> None:
        """Take the states beside change points from the branch that passes them."""
        for i, crossing in enumerate(self.crossings):
            at = np.flatnonzero(self.near == i)
            self.x[:, at] = crossing.states(self.place[at])

    def take_up(self, more: Positions, places: Index) -> None:
        """Take some places from positions that were followed afterwards, with the tracks on which they lie."""
        known = len(self.tracks.end)
        for name in ("x", "status", "which", "reached", "place", "left"):
            getattr(self, name)[..., places] = getattr(more, name)[..., places]
        self.track[places] = known + more.track[places]
        self.near[places] = np.where(more.near[places] < 0, -1, len(self.crossings) + more.near[places])
        self.crossings += [replace(c, track=c.track + known, sides=c.sides.moved_by(known)) for c in more.crossings]
        for name in ("evaluations", "calls", "factorizations", "careful"):
            setattr(self.work, name, getattr(self.work, name) + getattr(more.work, name))
        crossings = [(known + track, place) for track, place in more.tracks.crossings]
        self.tracks = Tracks(
            Nodes.join([self.tracks.nodes, more.tracks.nodes.moved_by(known)]),
            self.tracks.end + more.tracks.end,
            self.tracks.crossings + crossings,
            self.work,
        )
        self.follower.paths = Paths(self.follower.paths.points + more.follower.paths.points)
        self.here = None

    def nodes_of(self, track: int) -> Nodes:
        """Nodes of a track."""
        return self.tracks.nodes.take(self.tracks.nodes.track == track)

    @property
    def work(self) -> Work:
        """What was done."""
        return self.tracks.work
