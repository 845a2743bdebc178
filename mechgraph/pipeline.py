"""The pipeline of a call: drives, start, positions, rates, forces, for one position, a cycle, cases or variants."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure import passive_rest
from mechgraph.closure.assembly import CLOSED, closed_start, named_columns
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.driver_motion import DriverMotion
from mechgraph.closure.driver_path import BLOCK, DriverPath, Positions, Request, Status, follow, in_blocks
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.passive_rest import Idle, unspun
from mechgraph.closure.rates import Rates, distance_to_dead_point, rates
from mechgraph.closure.solver import ClosureSolver, FactoredClosure, closure_solver, engine_for
from mechgraph.errors import DeadPointError, DeclarationError, IndeterminateError
from mechgraph.force.block import BlockForces, ForceTask, forces_of_block
from mechgraph.model.load import Load
from mechgraph.numerics.linear import independent_rows, rank_of, singular_values
from mechgraph.numerics.tolerances import PATH
from mechgraph.report.report import check
from mechgraph.result.trajectory import BlockMotion, Trajectory
from mechgraph.structure.mobility import Freedoms, free_motion

CONTRADICTION = 1e-6
"""Relative part of the closure rates that drivers may leave open before they count as contradicting each other."""
FARTHEST = 1e6
"""Longest way of a driver from its start (radians, or lengths / L)."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Options:
    """How to solve: force ``method`` (None: motion alone), what becomes of ``redundant`` reactions, and the ``engine``."""

    method: str | None = "loop_wrench"
    redundant: str = "nan"
    engine: str = "auto"


@dataclass(frozen=True)
class Starts:
    """Where the paths begin: a closed state ``x (nx, V)`` for every variant, and the systems with the numbers of variants.

    ``system_of(variants)`` for variants ``(T,)``; ``loads`` act with the numbers of every variant. ``sharing`` is the number of variants
    that differ in masses and loads alone and move alike, from the only state: their motion is found once.
    """

    x: Array
    system_of: Callable[[Index], System]
    loads: tuple[Load, ...]
    sharing: int = 1


class Pipeline:
    """One call up to the trajectory. What depends on the graph, the drives and the start alone is found first (``__init__``).

    Attributes
    ----------
    system, x : scaled system and closed state at the start.
    columns, lead : driven freedoms; places of the leading drivers among them (independent ones, which are followed; the others are
        checked to agree).
    solver, engine : the closure equations with the leading drivers given, and what solves them.
    bodies : links with passive freedoms.
    """

    def __init__(self, drive: DriverMotion, options: Options) -> None:
        self.drive, self.m, self.options = drive, drive.m, options
        self.start = closed_start(self.m, drive.first)
        self.system, self.x = self.start.system, self.start.x[:, 0]
        self.columns, _ = named_columns(self.m, self.system, dict.fromkeys(drive.names, 0.0))
        self.unit = np.where(self.system.is_length[self.columns], self.system.par.L, 1.0)
        self._refuse_far()
        self.engine = engine_for(self.system.n_rows, int(np.prod(drive.batch)), options.engine)
        self.solver = closure_solver(self.engine, self.columns)
        self.lead = np.arange(len(self.columns))
        self.bodies: tuple[Idle, ...] = ()
        if not self.solver.leaves_nothing_free(self.start):
            self.lead = self._independent()
            self._check_determinate()
            self.bodies = self.freedoms.bodies
            self.solver = closure_solver(self.engine, self.leading, self.freedoms.hold)

    @cached_property
    def freedoms(self) -> Freedoms:
        """What can move at the start, what the drivers leave free, passive freedoms."""
        return free_motion(self.system, self.x, self.columns, self.engine)

    # --- drivers ---------------------------------------------------------------------------------------------------------

    def values(self, kind: str, batch: tuple[int, ...]) -> Array:
        """Driver positions, velocities or accelerations ``(d, T)`` in internal units."""
        return self.drive.values(kind, batch) / self.unit[:, None]

    def _refuse_far(self) -> None:
        """Refuse a path that would be followed for hours."""
        begin = self.x[self.system.single_rows[self.columns]][:, None]
        far = np.abs(self.values("position", self.drive.batch) - begin).max(axis=1)
        faults = [
            f"motion of {name!r}: comes {size * unit:.3g} away from the start; expected at most {FARTHEST * unit:.3g}"
            for name, size, unit in zip(self.drive.names, far, self.unit, strict=True)
            if size > FARTHEST
        ]
        if faults:
            raise DeclarationError(f"solve {self.m.name!r}", faults)

    def _independent(self) -> Index:
        """The leading drivers: as many as can move independently, taken in the order of the drivers."""
        if not self.freedoms.dependent:
            return np.arange(len(self.columns))
        rank = rank_of(singular_values(self.freedoms.null[self.columns]), PATH.independent)
        order = [int(c) for c in self.columns]
        chosen = independent_rows(self.freedoms.null, order, rank)
        return np.array([order.index(c) for c in sorted(chosen, key=order.index)], dtype=np.intp)

    def _check_determinate(self) -> None:
        free = self.freedoms.undriven
        if len(self.columns) and not self.freedoms.mobility:
            raise IndeterminateError(
                f"mechanism {self.m.name!r}: {', '.join(self.drive.names)} cannot drive it: it is a structure (mobility 0) where it was "
                "assembled. Change a pair, see mg.check",
                check(self.m),
            )
        still = np.sqrt((self.freedoms.null[self.columns] ** 2).sum(axis=1)) < PATH.independent
        if free and still.any() and len(self.columns) <= self.freedoms.mobility:
            value = dict(
                zip(self.drive.names, (self.x[self.system.single_rows[self.columns]] * self.unit).tolist(), strict=True)
            )
            names = ", ".join(name for name, rests in zip(self.drive.names, still, strict=True) if rests)
            raise DeadPointError(
                f"mechanism {self.m.name!r}: dead point where it was assembled: {names} stands still there while the mechanism moves, so "
                "that it does not determine the motion; drive another freedom, or start at another position",
                value,
            )
        if free:
            names = ", ".join(dict.fromkeys(name for motion in free for name in motion.names))
            count, more = (
                ("1 freedom is", "one driver")
                if len(free) == 1
                else (f"{len(free)} freedoms are", f"{len(free)} drivers")
            )
            raise IndeterminateError(
                f"mechanism {self.m.name!r}: {count} neither driven nor passive (moving: {names}); add {more}, or change a pair",
                check(self.m),
            )

    @property
    def leading(self) -> Index:
        """The freedoms of the leading drivers."""
        return self.columns[self.lead]

    # --- positions -------------------------------------------------------------------------------------------------------

    def run(self, starts: Starts | None = None, batch: tuple[int, ...] | None = None) -> Outcome:
        """All positions, rates and forces as a trajectory."""
        batch = self.drive.batch if batch is None else batch
        start = None if starts else self.start
        starts = starts or Starts(self.x[:, None], self.system.cases, self.m.loads)
        one = starts.x.shape[1] == 1
        T = int(np.prod(batch))
        shared = starts.sharing > 1
        variant = np.zeros(T, dtype=np.intp) if one and not shared else np.arange(T) // batch[-1]
        followed = (1, batch[-1]) if shared else batch
        path = DriverPath(self.system, self.solver, starts.system_of, start)
        found = follow(path, self._requests(followed, starts), int(np.prod(followed)))
        if self.bodies:
            found = unspun(path, found, self.bodies)
        return Outcome(self, starts, batch, variant, found, path)

    def _requests(self, batch: tuple[int, ...], starts: Starts) -> list[Request]:
        """What is asked of every start. With one driver all cases lie on one curve; with several, each case has a polygon of its own."""
        values = self.values("position", batch)[self.lead]
        T, N = values.shape[1], batch[-1] if batch else 1
        if starts.x.shape[1] == 1:
            if len(self.lead) == 1:
                return [Request(starts.x[:, 0], 0, values, np.arange(T))]
            return [Request(starts.x[:, 0], 0, values[:, i : i + N], np.arange(i, i + N)) for i in range(0, T, N)]
        begun = np.flatnonzero(np.isfinite(starts.x).all(axis=0))
        return [
            Request(starts.x[:, v], v, values[:, v * N : (v + 1) * N], np.arange(v * N, (v + 1) * N))
            for v in begun.tolist()
        ]


class Outcome:
    """Positions found, turned into a trajectory block by block."""

    def __init__(
        self, line: Pipeline, starts: Starts, batch: tuple[int, ...], variant: Index, found: Positions, path: DriverPath
    ) -> None:
        self.line, self.starts, self.batch, self.found, self.path = line, starts, batch, found, path
        self.solver: ClosureSolver = path.solver
        self.variant = variant
        self.contradicting = np.zeros(len(variant), dtype=bool)
        self._system_at = partial(_system_at, starts, variant)
        self._velocity, self._acceleration = (line.values(kind, batch) for kind in ("velocity", "acceleration"))
        coordinates = np.tile(continued(path, found), starts.sharing) if starts.sharing > 1 else continued(path, found)
        self.trajectory = Trajectory(
            line.system,
            self._system_at,
            batch,
            line.drive.t,
            line.columns,
            coordinates,
            line.options.redundant == "nan",
        )
        work = found.work
        work.positions, work.nodes = len(variant), len(found.tracks.nodes)
        self.trajectory.engine, self.trajectory.work = line.engine, work
        self._fill()

    def _fill(self) -> None:
        found = self.found
        good = np.flatnonzero(found.status == Status.OK)
        bad = np.flatnonzero(found.status != Status.OK)
        whole = bool(self.line.bodies) or not all(_by_position(load) for load in self.starts.loads)
        if self.starts.sharing > 1:
            self._fill_shared(good, whole)
            return
        self.trajectory.mark(bad, [status.value for status in found.status[bad]])
        if not good.size:
            self._name_holds()
        for places in [good] if whole else in_blocks(good):
            moved = self._moved(places)
            if moved is not None:
                self._put(*moved)

    def _name_holds(self) -> None:
        """What would be held, by name, where no position was reached."""
        line = self.line
        if not line.bodies or not line.options.method:
            return
        f = line.solver.factored(line.start, line.solver.chosen(line.start, np.full(1, -1)))
        self.trajectory.name_holds(passive_rest.hold_names(line.start, line.bodies, f.motions()))

    def _fill_shared(self, good: Index, whole: bool) -> None:
        """The motion of the first variant serves all; forces in blocks of whole variants."""
        every, N = np.arange(self.starts.sharing)[:, None], self.batch[-1]
        moved = self._moved(good)
        status = np.where(
            self.found.status == Status.OK, self.trajectory.first(N), [s.value for s in self.found.status]
        )
        self.trajectory.mark(np.arange(len(self.variant)), np.tile(status, len(every)))
        if moved is None:
            return
        motion, f = moved
        self.contradicting[:] = np.tile(self.contradicting[:N], len(every))
        blocks = 1 if whole else len(every) // max(1, BLOCK // N)
        for variants in np.array_split(every, max(1, blocks)):
            places, count = (variants * N + motion.places).ravel(), len(variants)
            here = motion.here.repeated(self._system_at(places), count)
            factors = self.solver.factored(here, np.tile(f.which, count))
            self._put(BlockMotion(places, motion.rates.repeated(here, count)), factors)

    def _moved(self, places: Index) -> tuple[BlockMotion, FactoredClosure] | None:
        """Rates of a block, and the factors with which they were found; None where it has no position that is closed and regular."""
        found, line = self.found, self.line
        here = found.here if found.here is not None and len(places) == found.x.shape[1] else None
        here = here or self._system_at(places).at(found.x[:, places])
        which = self.solver.chosen(here, found.which[places])
        f = self.solver.factored(here, which)
        found.work.factorizations += here.T
        open_ = here.closure > CLOSED
        dead = self._dead(here, f) & ~open_
        if (open_ | dead).any():
            self.trajectory.mark(places[open_], Status.NOT_CLOSED.value)
            self.trajectory.mark(places[dead], Status.DEAD_POINT.value)
            keep = np.flatnonzero(~(open_ | dead))
            places, here = places[keep], self._system_at(places[keep]).at(here.x[:, keep])
            f = f.part(keep, here)
        if not places.size:
            return None
        velocity, acceleration = self._velocity[:, places], self._acceleration[:, places]
        moved = rates(here, f, line.leading, velocity[line.lead], acceleration[line.lead], line.bodies)
        if len(line.lead) < len(line.columns):
            moved.contradiction = self._disagreement(here, moved, places)
        self.contradicting[places] = moved.contradiction > CONTRADICTION
        return BlockMotion(places, moved), f

    def _put(self, motion: BlockMotion, f: FactoredClosure) -> None:
        self.trajectory.put(motion, self._forces(motion, f) if self.line.options.method else None)

    def _forces(self, motion: BlockMotion, f: FactoredClosure) -> BlockForces:
        line = self.line
        if len(line.lead) < len(line.columns):  # the efforts of all drivers are unknowns
            solver = closure_solver(line.engine, line.columns, line.freedoms.hold)
            f = solver.factored(motion.here, solver.chosen(motion.here, np.full(motion.here.T, -1)))
        assert line.options.method is not None
        task = ForceTask(
            line.options.method,
            self.starts.loads,
            line.columns,
            line.bodies,
            self.batch,
            line.drive.t,
            line.options.redundant,
        )
        coordinates = self.trajectory.coordinates_at(motion.places)
        return forces_of_block(task, motion.rates, f, coordinates, motion.places)

    def _dead(self, here: Configuration, f: FactoredClosure) -> Mask:
        """Positions so near to a dead point that their rates would be noise."""
        dead = np.asarray(f.condition > PATH.singular)
        doubtful = np.flatnonzero((f.condition > PATH.doubtful) & ~dead)
        if doubtful.size:
            few = here.part(doubtful)
            near = distance_to_dead_point(few, f.part(doubtful, few), self.line.leading)
            dead[doubtful] = ~(near > PATH.dead_point)
        return dead

    def _disagreement(self, here: Configuration, moved: Rates, places: Index) -> Array:
        """How far given positions and rates of dependent drivers are from those that the leading drivers enforce, ``(T,)``."""
        line = self.line
        turns = line.values("position", self.batch)[:, places] - here.x[line.system.single_rows[line.columns]]
        turns -= np.where(line.system.is_length[line.columns], 0.0, 2 * np.pi)[:, None] * np.round(turns / (2 * np.pi))
        out = np.abs(turns).max(axis=0, initial=0.0)
        for given, found in ((self._velocity, moved.dq), (self._acceleration, moved.ddq)):
            asked = given[:, places]
            size = np.abs(found).max(axis=0, initial=0.0) + np.abs(asked).max(axis=0, initial=0.0)
            gap = np.abs(found[line.columns] - asked).max(axis=0, initial=0.0)
            out = np.maximum(out, gap / np.where(size > 0, size, 1.0))
        return np.maximum(out, moved.contradiction)


def _system_at(starts: Starts, variant: Index, places: Index) -> System:
    """The system with the numbers of the positions at flat places."""
    return starts.system_of(variant[places])


def _by_position(load: Load) -> bool:
    """Whether a load can be evaluated position by position: it holds values, no callables, which see the whole batch."""
    if not dataclasses.is_dataclass(load):
        return False
    return not any(callable(getattr(load, field.name)) for field in dataclasses.fields(load))


def continued(path: DriverPath, found: Positions) -> Array:
    """User coordinates ``(F, T)`` of all positions, rotation vectors continued along their tracks from the start."""
    s = path.system
    start = s.start_coordinates(s.m.start)
    if all(len(factor) == 1 for g in s.groups for factor in g.row.factors):
        return s.coordinates_of(found.x)
    out = np.full((s.n_freedoms, found.x.shape[1]), np.nan)
    good = np.flatnonzero(found.status == Status.OK)
    for track, mine in _by_track(found.track[good]):
        at, nodes = good[mine], found.nodes_of(track)
        place = np.concatenate([nodes.place, found.place[at]])
        order = np.argsort(place, kind="stable")
        states = np.concatenate([nodes.x, found.x[:, at]], axis=1)[:, order]
        q = s.coordinates_of(states, start)
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        out[:, at] = q[:, back[len(nodes) :]]
    return out


def _by_track(track: Index) -> list[tuple[int, Index]]:
    """Positions of every track."""
    order = np.argsort(track, kind="stable")
    cuts = np.flatnonzero(np.diff(track[order])) + 1
    return [(int(track[part[0]]), part) for part in np.split(order, cuts) if part.size]
