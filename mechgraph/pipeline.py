"""The pipeline of a call: drives, start, positions, rates, forces, for one position, a cycle, cases or variants."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import CLOSED, closed_start, named_columns
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.coordinates import continued
from mechgraph.closure.driver_motion import DriverMotion
from mechgraph.closure.driver_path import (
    BLOCK,
    FARTHEST,
    DriverPath,
    Positions,
    Status,
    far_faults,
    in_blocks,
    requests,
)
from mechgraph.closure.following import follow
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.passive_motion import PassiveMotion, are_alone
from mechgraph.closure.passive_rest import unspun
from mechgraph.closure.ranges import end_at_ranges
from mechgraph.closure.rates import Rates, Velocities, at_dead_points, disagreement, distance_to_dead_point, rates
from mechgraph.closure.reduced_path import follow_reduced
from mechgraph.closure.reduction import Reduction, reduction_of
from mechgraph.closure.solver import ClosureSolver, FactoredClosure, closure_solver, engine_for, solver_at_start
from mechgraph.errors import DeclarationError, IndeterminateError
from mechgraph.force.block import BlockForces, ForceTask, forces_of_block
from mechgraph.model.load_base import Load
from mechgraph.numerics.linear import independent_rows
from mechgraph.numerics.tolerances import PATH
from mechgraph.report.refused import (
    change_point_error,
    dead_point_error,
    structure_error,
    undecided_error,
    undriven_error,
)
from mechgraph.report.report import check
from mechgraph.result.kept import BlockMotion
from mechgraph.result.solution import Solution
from mechgraph.result.trajectory import Trajectory
from mechgraph.structure.actuation import actuation_fault, stand_still
from mechgraph.structure.branching import branches
from mechgraph.structure.mobility import Freedoms, free_motion

CONTRADICTION = 1e-6
"""Relative part of the closure rates that drivers may leave open before they count as contradicting each other."""
CLOSING = 1e-13
"""Part of the condition number within which a start is not told from a dead point: some hundred roundings of its closing."""
Mask = NDArray[np.bool_]
Made = TypeVar("Made")


@dataclass(frozen=True)
class Options:
    """How to solve: force ``method`` (None: motion alone), what becomes of ``redundant`` reactions, and the ``engine``.

    ``form`` says by which form of the equations paths are followed, ``"full"`` or ``"reduced"``, or ``"auto"``: the faster one.
    ``progress`` is called with the numbers of positions done and of all that were reached, block by block.
    """

    method: str | None = "loop_wrench"
    redundant: str = "nan"
    engine: str = "auto"
    progress: Callable[[int, int], None] | None = field(default=None, compare=False)
    form: str = "auto"


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
    acting : freedoms in which the unknown efforts stand.
    columns, lead : driven freedoms; places of the leading drivers among them (independent ones, which are followed; the others are
        checked to agree).
    solver, engine : the closure equations with the leading drivers given, and what solves them.
    passive : passive motions.
    """

    def __init__(self, drive: DriverMotion, options: Options) -> None:
        self.drive, self.m, self.options = drive, drive.m, options
        self.start = closed_start(self.m, drive.first)
        if drive.free:
            self.m = drive.whole(self.start)
            self.start = closed_start(self.m)
        self.system, self.x = self.start.system, self.start.x[:, 0]
        self.columns, _ = named_columns(self.m, self.system, dict.fromkeys(drive.names, 0.0))
        self.unit = np.where(self.system.is_length[self.columns], self.system.par.L, 1.0)
        self._refuse_far()
        # reactions of least norm are found position by position, where nothing is gained from many of them
        positions = 1 if options.redundant == "minimum_norm" else int(np.prod(drive.batch))
        self.engine = engine_for(self.system.n_rows, positions, options.engine)
        self.solver, proved = solver_at_start(self.engine, self.columns, self.start)
        self.lead = np.arange(len(self.columns))
        self.passive: tuple[PassiveMotion, ...] = ()
        self.hold: Index | None = None
        if not proved:
            self.lead = self.freedoms.leading(self.columns)
            self._check_determinate()
            self.passive, self.hold = self.freedoms.passive, self.freedoms.hold
            self.solver = closure_solver(self.engine, self.leading, self.hold)
            self._check_passive()
        self.acting = self._acting() if options.method else self.columns

    @cached_property
    def freedoms(self) -> Freedoms:
        """What can move at the start, what the drivers leave free, passive freedoms."""
        key = "free", self.engine, self.columns.tobytes(), bool(self.m.loads)
        return self._with_start(key, lambda: free_motion(self.system, self.x, self.columns, self.engine))

    # --- drivers ---------------------------------------------------------------------------------------------------------

    def values(self, kind: str, batch: tuple[int, ...]) -> Array:
        """Driver positions, velocities or accelerations ``(d, T)`` in internal units."""
        return self.drive.values(kind, batch) / self.unit[:, None]

    def _refuse_far(self) -> None:
        """Refuse a path that would be followed for hours."""
        begin = self.x[self.system.single_rows[self.columns]][:, None]
        far = np.abs(self.values("position", self.drive.batch) - begin).max(axis=1)
        names = [f"motion of {name!r}" for name in self.drive.names]
        faults = far_faults(names, far, self.unit, np.full(len(far), FARTHEST))
        if faults:
            raise DeclarationError(f"solve {self.m.name!r}", faults)

    def _check_determinate(self) -> None:
        free = self.freedoms.undriven
        if len(self.columns) and not self.freedoms.mobility:
            raise structure_error(self.drive.m, self.drive.names)
        still = self.freedoms.still(self.columns)
        if free and still.any() and len(self.columns) <= self.freedoms.mobility:
            names = [name for name, rests in zip(self.drive.names, still, strict=True) if rests]
            raise dead_point_error(self.drive.m, names, self._begin, self._standing())
        self._refuse_change_point()
        if free:
            raise undriven_error(self.drive.m, free)

    def _check_passive(self) -> None:
        """Rows as they are solved and rows over their own lengths, by which the rank is decided, leave the same motions free."""
        free = self.solver.factored(self.start, self.solver.chosen(self.start, np.full(1, -1))).motions().shape[1]
        if free != len(self.passive):
            raise undecided_error(self.drive.m, sorted({free, len(self.passive)}))

    def _standing(self) -> Solution | None:
        """The start at rest, where the drivers leave motions free: what equilibrium determines of the forces.

        The free motions are held by freedoms of their own. Where one of these has to bear load, the drivers cannot keep the mechanism at
        rest, and all forces are NaN; otherwise they are what the drivers and it leave unique.
        """
        m, drive, s = self.drive.m, self.drive, self.system
        single = np.flatnonzero(s.single_rows >= 0)
        kept = independent_rows(self.freedoms.left, single.tolist(), self.freedoms.left.shape[1])
        if drive.free or drive.actuated is not None or len(kept) < self.freedoms.left.shape[1]:
            return None
        q = s.coordinates_of(self.start.x, s.start_coordinates(m.start))[:, 0]
        start = dict(zip(m.freedom_names(), q.tolist(), strict=True))
        names = [*drive.names, *(m.freedom_names()[c] for c in kept)]
        at_rest = DriverMotion(m.replace(drives=names, start=start), {name: start[name] for name in names})
        line = Pipeline(at_rest, self.options)
        found = line.run().trajectory
        if found.has_forces and not found.bears_nothing(line.columns[len(drive.names) :]):
            found = Pipeline(at_rest, dataclasses.replace(self.options, method=None)).run().trajectory
            found.has_forces = True
        return Solution(found.shown_as(m, line.columns[: len(drive.names)]))

    def _acting(self) -> Index:
        """The freedoms in which the unknown efforts stand: those that are driven, or as many that are named instead."""
        if self.drive.actuated is None:
            return self.columns
        acting, _ = named_columns(self.m, self.system, dict.fromkeys(self.drive.actuated, 0.0))
        if len(acting) != len(self.lead):
            raise self.actuation_error(self.start, acting)
        return acting

    def actuation_error(self, here: Configuration, acting: Index) -> IndeterminateError:
        """The error for freedoms whose efforts cannot hold the mechanism at a position."""
        Z = self.solver.factored(here, self.solver.chosen(here, np.full(1, -1))).sensitivity()[:, :, 0]
        return IndeterminateError(
            f"mechanism {self.m.name!r}: actuate: {actuation_fault(self.drive.m, Z, acting)}", check(self.drive.m)
        )

    def _refuse_change_point(self) -> None:
        """A path that starts where branches cross has no velocity that it could continue."""
        here, columns = self.start, self.leading
        f = self.solver.factored(here, self.solver.chosen(here, np.full(1, -1)))
        if f.condition[0] <= PATH.singular and not self.freedoms.undriven:
            near = distance_to_dead_point(here, f, columns)[0]
            if f.condition[0] < PATH.doubtful or near > CLOSING * f.condition[0]:
                return
        ways = branches(self.system, self.x, columns, self.freedoms.passive)
        if ways:
            raise change_point_error(self.drive.m, self._begin, ways)

    @property
    def _begin(self) -> dict[str, float]:
        """Values of the drivers at the start, by name."""
        values = self.x[self.system.single_rows[self.columns]] * self.unit
        return dict(zip(self.drive.names, values.tolist(), strict=True))

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
        path.carries = are_alone(self.passive)
        found = self._followed(path, starts, followed)
        end_at_ranges(path, found)
        return Outcome(self, starts, batch, variant, found, path)

    def _followed(self, path: DriverPath, starts: Starts, batch: tuple[int, ...]) -> Positions:
        """The positions along the path, by the reduced form of the mechanism where it has one."""
        values, total = self.values("position", batch)[self.lead], int(np.prod(batch))
        form = self.reduction
        found = None if form is None else follow_reduced(path, form, starts.x, values, batch, total)
        if found is None:
            found = follow(path, requests(starts.x, values, batch), total)
            if self.passive:
                found = unspun(path, found, self.passive)
                found.interpolate()
        return found

    @cached_property
    def reduction(self) -> Reduction | None:
        """The reduced form of the mechanism, where paths are followed by it."""
        key = "reduced", self.options.form, self.leading.tobytes()
        return self._with_start(key, lambda: reduction_of(self.start, self.leading, self.passive, self.options.form))

    def _with_start(self, key: tuple[object, ...], make: Callable[[], Made]) -> Made:
        """What follows from the start and the drivers alone is kept with the start."""
        kept = self.start.solvers
        if key not in kept:
            kept[key] = make()
        made: Made = kept[key]
        return made


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
            line.acting,
            coordinates,
            line.options.redundant == "nan",
            line.passive if line.options.method else (),
            line.drive.shown,
            line.drive.names,
        )
        work = found.work
        work.positions, work.nodes = len(variant), len(found.tracks.nodes)
        self.trajectory.engine, self.trajectory.work = line.engine, work
        self.trajectory.loads = starts.loads
        self.trajectory.method = line.options.method
        self._fill()

    def _fill(self) -> None:
        found = self.found
        good = np.flatnonzero((found.status == Status.OK) & (found.near < 0))
        bad = np.flatnonzero(found.status != Status.OK)
        whole = not all(load.by_position for load in self.starts.loads)
        if self.starts.sharing > 1:
            self._fill_shared(good, whole)
            return
        self.trajectory.mark(bad, [status.value for status in found.status[bad]])
        done, progress = 0, self.line.options.progress
        for places in [good] if whole else in_blocks(good):
            moved = self._moved(places)
            if moved is not None:
                self._put(*moved)
            done += len(places)
            if progress is not None:
                progress(done, len(good))
        for motion, f in self._beside_change_points():
            self._put(motion, f)

    def _fill_shared(self, good: Index, whole: bool) -> None:
        """The motion of the first variant serves all; forces in blocks of whole variants."""
        every, N = np.arange(self.starts.sharing)[:, None], self.batch[-1]
        moved = self._moved(good)
        status = np.where(
            self.found.status == Status.OK, self.trajectory.first(N), [s.value for s in self.found.status]
        )
        self.trajectory.mark(np.arange(len(self.variant)), np.tile(status, len(every)))
        self.contradicting[:] = np.tile(self.contradicting[:N], len(every))
        blocks = 1 if whole else len(every) // max(1, BLOCK // N)
        for motion, f in [*([] if moved is None else [moved]), *self._beside_change_points()]:
            for variants in np.array_split(every, max(1, blocks)):
                places, count = (variants * N + motion.places).ravel(), len(variants)
                here = motion.here.repeated(self._system_at(places), count)
                factors = None if f is None else self.solver.factored(here, np.tile(f.which, count))
                self._put(BlockMotion(places, motion.rates.repeated(here, count)), factors)

    def _moved(self, places: Index) -> tuple[BlockMotion, FactoredClosure] | None:
        """Rates of a block, and the factors with which they were found; None where it has no position that is closed and regular."""
        found = self.found
        here = found.here if found.here is not None and len(places) == found.x.shape[1] else None
        here = here or Configuration(self._system_at(places), found.x[:, places])
        which = self.solver.chosen(here, found.which[places])
        f = self.solver.factored(here, which)
        found.work.factorizations += here.T
        found.work.groups = max(found.work.groups, f.groups)
        open_ = here.closure > CLOSED
        dead = at_dead_points(here, f, self.solver) & ~open_
        if (open_ | dead).any():
            self.trajectory.mark(places[open_], Status.NOT_CLOSED.value)
            self.trajectory.mark(places[dead], Status.DEAD_POINT.value)
            keep = np.flatnonzero(~(open_ | dead))
            places, here = places[keep], Configuration(self._system_at(places[keep]), here.x[:, keep])
            f = f.part(keep, here)
        if not places.size:
            return None
        return self._agreed(self._rates(here, f, places), places), f

    def _agreed(self, moved: Rates, places: Index) -> BlockMotion:
        """Rates at places; where dependent drivers contradict the leading ones is noted."""
        line = self.line
        if len(line.lead) < len(line.columns):
            given = line.values("position", self.batch), self._velocity, self._acceleration
            moved.contradiction = disagreement(moved, line.columns, *(values[:, places] for values in given))
        self.contradicting[places] = moved.contradiction > CONTRADICTION
        return BlockMotion(places, moved)

    def _rates(self, here: Configuration, f: FactoredClosure, places: Index) -> Rates:
        """Rates at states for the motions of the drivers at places."""
        line = self.line
        velocity, acceleration = self._velocity[line.lead][:, places], self._acceleration[line.lead][:, places]
        with np.errstate(over="ignore", invalid="ignore"):
            moved = rates(here, f, line.leading, velocity, acceleration, line.passive)
            largest = np.square(np.max([np.abs(values).max(initial=0.0) for values in (moved.V, moved.dq, moved.ddq)]))
        if not np.isfinite(largest):  # accelerations hold squares of rates
            too_large = "rates are beyond the largest number (1.8e308): give smaller velocities and accelerations"
            raise DeclarationError(f"solve {line.m.name!r}", [too_large])
        return moved

    def _beside_change_points(self) -> Iterator[tuple[BlockMotion, FactoredClosure | None]]:
        """Motion at and beside the change points passed, interpolated between both sides; without factors where these are singular."""
        found, path = self.found, self.path
        for number, crossing in enumerate(found.crossings):
            places, sides = np.flatnonzero(found.near == number), crossing.sides
            n, k = len(places), len(sides)
            many = np.tile(np.arange(k), n)
            beside = path.at(sides.x[:, many], sides.drive[:, many], sides.track[many])
            f = path.factored(beside, sides.which[many])
            moved = self._rates(beside, f, np.repeat(places, k))
            weights = crossing.weights(found.place[places])
            dq, ddq = (np.einsum("fnk,kn->fn", values.reshape(-1, n, k), weights) for values in (moved.dq, moved.ddq))
            open_ = Configuration(self._system_at(places), found.x[:, places]).closure > CLOSED
            self.trajectory.mark(places[open_], Status.NOT_CLOSED.value)
            for regular in (True, False):
                mine = np.flatnonzero(((found.status[places] == Status.OK) == regular) & ~open_)
                if not mine.size:
                    continue
                at = places[mine]
                here = Configuration(self._system_at(at), found.x[:, at])
                motion = Rates(Velocities(here, dq[:, mine]), ddq[:, mine], np.zeros(len(mine)))
                factors = self.solver.factored(here, self.solver.chosen(here, found.which[at])) if regular else None
                yield self._agreed(motion, at), factors

    def _put(self, motion: BlockMotion, f: FactoredClosure | None) -> None:
        self.trajectory.has_forces |= self.line.options.method is not None
        if not self.line.options.method or f is None:
            self.trajectory.put(motion, None)
            return
        if self.line.drive.actuated:
            rest = stand_still(f.sensitivity(), self.line.acting)
            if rest.any():
                self.trajectory.mark(motion.places[rest], Status.ACTUATORS_REST.value)
                self.trajectory.put(motion.part(np.flatnonzero(rest)), None)
                motion = motion.part(np.flatnonzero(~rest))
        if len(motion.places):
            self.trajectory.put(motion, self._forces(motion, f))

    def _forces(self, motion: BlockMotion, f: FactoredClosure) -> BlockForces:
        line = self.line
        if line.acting is not line.columns or len(line.lead) < len(line.columns):  # all their efforts are unknowns
            solver = closure_solver(line.engine, line.acting, line.hold)
            f = solver.factored(motion.here, solver.chosen(motion.here, np.full(motion.here.T, -1)))
        assert line.options.method is not None
        task = ForceTask(
            line.options.method,
            self.starts.loads,
            line.acting,
            line.passive,
            self.batch,
            line.drive.t,
            line.options.redundant,
        )
        coordinates = self.trajectory.coordinates_at(motion.places)
        with np.errstate(over="ignore", invalid="ignore"):
            found = forces_of_block(task, motion.rates, f, coordinates, motion.places)
            finite = np.isfinite(found.balance + found.power) | self.contradicting[motion.places]
        if not finite.all():
            too_large = "forces are beyond the largest number (1.8e308): masses, loads or rates are too large"
            raise DeclarationError(f"solve {line.m.name!r}", [too_large])
        return found


def _system_at(starts: Starts, variant: Index, places: Index) -> System:
    """The system with the numbers of the positions at flat places."""
    return starts.system_of(variant[places])
