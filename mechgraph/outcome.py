"""What a call asks for, and what becomes of positions that were found: rates, forces, a trajectory; by numpy, or from the kernel's records.

The kernel serves where it carries the mechanism and the call. What it refuses (a step that is not certified, a poor condition, drives that
contradict each other) is left to the careful follower of numpy, with all that it says of such positions.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import field, replace
from functools import partial
from operator import is_not
from typing import Any, Literal, Protocol

import numpy as np

from mechgraph.determinacy.finite_motion import branches
from mechgraph.determinacy.mobility import stand_still
from mechgraph.errors import DeclarationError
from mechgraph.force.block import forces_of_block
from mechgraph.force.friction import Came
from mechgraph.force.redundant import BlockForces, ForceTask
from mechgraph.kernel import build
from mechgraph.kernel.tables import HEAD_RUBS, MIDDLE, START, Kernel, Layout, Mask, Records, layout, tables, why_not
from mechgraph.kinematics.motion_path import BLOCK, DriverPath, Positions, Status, continued, in_blocks
from mechgraph.kinematics.prescribed import DriverMotion
from mechgraph.kinematics.rates import (
    PassiveMotion,
    Rates,
    Velocities,
    are_alone,
    at_dead_points,
    disagreement,
    expected_error,
    rates,
)
from mechgraph.kinematics.solver import closure_solver
from mechgraph.kinematics.state import CLOSED, ROUNDINGS, ClosureSolver, Configuration, FactoredClosure
from mechgraph.kinematics.system import System
from mechgraph.kinematics.touching import strayed
from mechgraph.maths.newton import Work
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.singular_point import passed
from mechgraph.maths.tracker import Follower
from mechgraph.memo import dataclass
from mechgraph.model.belts import pretensions
from mechgraph.model.friction import places_in, rubbing_loads
from mechgraph.model.loads import Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.result.trajectory import BlockMotion, Trajectory
from mechgraph.result.values import PassedCrossing


@dataclass(frozen=True)
class Options:
    """How to solve: force ``method`` (None: motion alone), what becomes of ``redundant`` reactions, and the ``engine``.

    ``progress`` is called with the numbers of positions done and of all that were reached, block by block.
    """

    method: str | None = "loop_wrench"
    redundant: str = "nan"
    engine: str = "auto"
    progress: Callable[[int, int], None] | None = field(default=None, compare=False)


@dataclass(frozen=True)
class Starts:
    """Where the paths begin: a closed state ``x (nx, V)`` for every variant, and the systems with the numbers of variants.

    ``system_of(variants)`` for variants ``(T,)``; ``loads`` act with the numbers of every variant. ``sharing`` is the number of variants
    that differ in masses and loads alone and move alike, from the only state: their motion is found once. ``kernel``: the variants in the
    tables of the compiled kernel, where it serves.
    """

    x: Array
    system_of: Callable[[Index], System]
    loads: tuple[Load, ...]
    sharing: int = 1
    kernel: Any = None


class Call(Protocol):
    """A call whose drives, start and unknown efforts are known; ``pipeline.Pipeline`` says what each of these is."""

    m: Mechanism
    drive: DriverMotion
    options: Options
    engine: Literal["dense", "sparse"]
    system: System
    columns: Index
    lead: Index
    acting: Index
    hold: Index | None
    passive: tuple[PassiveMotion, ...]

    @property
    def leading(self) -> Index:
        """The freedoms of the leading drivers."""

    def values(self, kind: str, batch: tuple[int, ...]) -> Array:
        """Driver positions, velocities or accelerations ``(d, T)`` in internal units."""


SystemAt = Callable[[Index], System]


class Outcome:
    """Positions found, turned into a trajectory block by block.

    ``found`` are the positions as they were followed; None where another engine than those of numpy gave states and rates.
    """

    found: Positions | None = None

    def __init__(
        self, line: Call, loads: tuple[Load, ...], batch: tuple[int, ...], system_at: SystemAt, q: Array
    ) -> None:
        """Nothing filled in yet; ``q (F, T)`` the user's coordinates, where they are known."""
        self.line, self.loads, self.batch, self._system_at = line, loads, batch, system_at
        self.contradicting = np.zeros(q.shape[1], dtype=bool)
        self.trajectory = Trajectory(
            line.system,
            system_at,
            batch,
            line.drive.t,
            line.acting,
            q,
            line.options.redundant != "minimum_norm",
            line.passive if line.options.method else (),
            line.drive.shown,
            line.drive.names,
        )
        self.trajectory.loads = loads
        self.trajectory.method = line.options.method
        self.trajectory.closing = closure_solver(line.engine, line.acting, line.hold)

    @property
    def moved(self) -> bool:
        """Whether any position has a state and rates."""
        return self.found is None or bool(self.found.moved.any())

    def _put(self, motion: BlockMotion, f: FactoredClosure | None) -> None:
        if fault := strayed(motion.here):
            raise DeclarationError(f"solve {self.line.m.name!r}", [fault])
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
            forces = self._forces(motion, f)
            self.trajectory.put(motion, forces)
            for number in np.unique(forces.outcome[forces.outcome > 0]):
                self.trajectory.mark(motion.places[forces.outcome == number], Came(number).status)

    def _forces(self, motion: BlockMotion, f: FactoredClosure) -> BlockForces:
        line = self.line
        if line.acting is not line.columns or len(line.lead) < len(line.columns):  # all their efforts are unknowns
            solver = closure_solver(line.engine, line.acting, line.hold)
            f = solver.factored(motion.here, solver.chosen(motion.here, np.full(motion.here.T, -1)))
            self.trajectory.estimate(motion.places, expected_error(motion.here.rounding, f.condition))
        assert line.options.method is not None
        task = ForceTask(
            line.options.method,
            self.loads,
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
            finite |= found.outcome > 0
        if not finite.all():
            too_large = "forces are beyond the largest number (1.8e308): masses, loads or rates are too large"
            raise DeclarationError(f"solve {line.m.name!r}", [too_large])
        return found


class FollowedPositions(Outcome):
    """Positions that were followed, their rates and forces found block by block."""

    found: Positions

    def __init__(
        self, line: Call, starts: Starts, batch: tuple[int, ...], variant: Index, found: Positions, path: DriverPath
    ) -> None:
        self.starts, self.found, self.path = starts, found, path
        self.solver: ClosureSolver = path.solver
        self.variant = variant
        q = continued(path, found)
        q = np.tile(q, starts.sharing) if starts.sharing > 1 else q
        super().__init__(line, starts.loads, batch, partial(system_at, starts, variant), q)
        self._velocity, self._acceleration = (line.values(kind, batch) for kind in ("velocity", "acceleration"))
        work = found.work
        work.positions, work.nodes = len(variant), len(found.tracks.nodes)
        self.trajectory.engine, self.trajectory.work = line.engine, work
        self._fill()
        self.trajectory.passed = tuple(self._passed()) if starts.x.shape[1] == 1 else ()

    def _passed(self) -> Iterator[PassedCrossing]:
        """The crossings over which the path led to positions."""
        found, line = self.found, self.line
        names = [line.drive.names[i] for i in line.lead]
        unit = np.where(line.system.is_length[line.leading], line.system.par.L, 1.0)
        for track, place in found.tracks.crossings:
            if not (found.moved & (found.track == track) & (found.place > place) & (place > 0.0)).any():
                continue
            follower = Follower(self.path, leads=False)
            follower.paths = found.follower.paths
            crossing = passed(follower, found.tracks.nodes, track, place)
            if crossing is None:
                drive = follower.paths.drive(np.array([track]), np.array([place]))[:, 0]
                yield PassedCrossing(dict(zip(names, (drive * unit).tolist(), strict=True)), np.nan, ())
                continue
            x = crossing.states(np.array([place]))[:, 0]
            at = dict(zip(names, (crossing.drive * unit).tolist(), strict=True))
            # the branch that was followed first, by its rates for unit rates of the drivers
            own = crossing.sides.Z.sum(axis=1) @ crossing.weights(np.array([place]))[:, 0]
            own *= np.where(line.system.is_length, line.system.par.L, 1.0) / unit[0]
            ways = branches(line.system, x, line.leading, line.passive, crossing.miss)
            off = [np.abs(np.array([*way.values()]) - own).max() for way in ways]
            yield PassedCrossing(at, crossing.miss, tuple(ways[i] for i in np.argsort(off)))

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
            self.found.status == Status.OK,
            self.trajectory.status().reshape(-1)[:N],
            [s.value for s in self.found.status],
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
        dead, errors = at_dead_points(here, f, self.solver)
        self.trajectory.estimate(places, errors)
        dead &= ~open_
        if (open_ | dead).any():
            self.trajectory.mark(places[open_], Status.NOT_CLOSED.value)
            self.trajectory.mark(places[dead], Status.DEAD_POINT.value)
            keep = np.flatnonzero(~(open_ | dead))
            places, here = places[keep], here.part(keep)
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
        # relative part of the closure rates that drivers may leave open before they count as contradicting each other
        self.contradicting[places] = moved.contradiction > 1e-6
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
            if not places.size:  # nearer to another one, or beyond the end of a curve
                continue
            n, k = len(places), len(sides)
            many = np.tile(np.arange(k), n)
            beside = path.at(sides.x[:, many], sides.drive[:, many], sides.track[many])
            f = path.factored(beside, sides.which[many])
            moved = self._rates(beside, f, np.repeat(places, k))
            weights = crossing.weights(found.place[places])
            dq, ddq = (np.einsum("fnk,kn->fn", values.reshape(-1, n, k), weights) for values in (moved.dq, moved.ddq))
            open_ = Configuration(self._system_at(places), found.x[:, places]).closure > CLOSED
            self.trajectory.mark(places[open_], Status.NOT_CLOSED.value)
            errors = at_dead_points(beside, f, self.solver)[1].reshape(n, k)
            rates_error = crossing.error(found.place[places], moved.ddq.reshape(-1, n, k), errors)
            for regular in (True, False):
                mine = np.flatnonzero(((found.status[places] == Status.OK) == regular) & ~open_)
                if not mine.size:
                    continue
                at = places[mine]
                here = Configuration(self._system_at(at), found.x[:, at])
                motion = Rates(Velocities(here, dq[:, mine]), ddq[:, mine], np.zeros(len(mine)))
                factors = self.solver.factored(here, self.solver.chosen(here, found.which[at])) if regular else None
                error = rates_error[mine]
                if factors is not None:
                    moved_by = here.rounding * f.condition.reshape(n, k)[mine].max(axis=1)
                    error = np.maximum(error, factors.condition * moved_by)
                self.trajectory.estimate(at, error)
                yield self._agreed(motion, at), factors


def system_at(starts: Starts, variant: Index, places: Index) -> System:
    """The system with the numbers of the positions at flat places."""
    return starts.system_of(variant[places])


COMPILED: Literal["compiled"] = "compiled"
"""Name of the engine."""
PartOfTheWay = Callable[[Array, Index], tuple[System, Mask]]
"""Gives variants ``(n,)`` each at its part of the way ``(n,)`` from the mechanism itself to its own numbers, and which could be built."""
SHORTEST_PART = 1 / 64
"""Shortest step on that way; where it is not certified, the variant is left to numpy."""
SERVES = 0.8
"""Part of the variants of which the kernel must have solved more; the others are solved one by one."""


class Started(Call, Protocol):
    """A call with its closed start."""

    start: Configuration
    solver: ClosureSolver
    x: Any


def at_hand() -> Any:
    """The library that ``auto`` takes: installed, or built before on request; None where there is none."""
    return build.installed()


class KernelOutcome(Outcome):
    """Positions that the kernel has solved; their forces from the records, or by numpy at its states where it does not give them.

    Those of variants that are not ``whole (V,)`` count as ``contradicting``: numpy is to solve them.
    """

    def __init__(
        self, line: Started, starts: Starts, batch: tuple[int, ...], records: Records, whole: Mask, forces: bool
    ) -> None:
        self.records, self.solver = records, line.solver
        count = len(records.values)
        variant = np.arange(count) // (count // len(whole))
        at = partial(system_at, starts, variant)
        super().__init__(line, starts.loads, batch, at, records["coordinates"])
        steps, evaluations, factorizations = records.work
        work = Work(positions=count, nodes=len(whole) + steps, evaluations=evaluations, factorizations=factorizations)
        self.trajectory.engine, self.trajectory.work = COMPILED, work
        self.contradicting[:] = ~whole[variant]
        condition, reach = records["condition"]
        self.trajectory.estimate(np.arange(count), expected_error(ROUNDINGS * np.finfo(float).eps * reach, condition))
        if forces or line.options.method is None:
            rubbing = self._rubbing() if forces else ()
            self.trajectory.take(records, forces, rubbing)
            for places in in_blocks(self._left_open()) if rubbing else ():
                self._put(*self._at(places))
        else:
            by_position = all(load.by_position for load in self.loads)
            every = np.flatnonzero(~self.contradicting)
            for places in in_blocks(every) if by_position else [every]:
                self._put(*self._at(places))
        if line.options.progress is not None:
            line.options.progress(count, count)

    def _rubbing(self) -> tuple[str, ...]:
        """The pair or coupling of every place that rubs."""
        m, dry = self.line.m, rubbing_loads(self.line.m, self.loads)
        pairs = [m.pair(load.of).type if load.of in m.pair_index else None for load in dry]
        return tuple(
            load.of for load, row in zip(dry, pairs, strict=True) for _ in (places_in(load, row) if row else "t")
        )

    def _left_open(self) -> Index:
        """Positions at which the kernel does not say what friction does, or where there is none in motion."""
        return np.flatnonzero((self.records["unsure"] > 0) & ~self.contradicting)

    def _at(self, places: Index) -> tuple[BlockMotion, Any]:
        """States and rates of a block, and the closure equations there, factored by numpy."""
        x, dq, ddq = (self.records[name][:, places] for name in ("x", "dq", "ddq"))
        here = Configuration(self._system_at(places), np.ascontiguousarray(x))
        f = self.solver.factored(here, self.solver.chosen(here, np.full(here.T, -1)))
        return BlockMotion(places, Rates(Velocities(here, dq), ddq, np.zeros(here.T))), f


def compiled(line: Started, batch: tuple[int, ...], starts: Starts | None = None) -> KernelOutcome | None:
    """All positions of a call, or of all its variants, by the kernel; None where it does not serve: no library, or no certificate.

    Raises
    ------
    DeclarationError
        where the kernel was asked for by name and cannot carry the mechanism or the call; MissingExtraError without a compiler.
    """
    if starts is None:
        library = _library(line)
        if library is None:
            return None
        kernel, forces = _kernel(line, library)
        starts = Starts(line.x[:, None], line.system.cases, line.m.loads)
    elif starts.kernel is None:
        return None
    else:
        kernel, forces = starts.kernel.kernel, starts.kernel.forces
    q, v, a = (np.ascontiguousarray(line.values(kind, batch).T) for kind in ("position", "velocity", "acceleration"))
    begin = kernel.P[:, START + line.system.single_rows[line.columns]].T
    records, whole = kernel.follow(begin, q, v, a, batch, forces)
    return KernelOutcome(line, starts, batch, records, whole, forces) if whole.mean() > SERVES else None


def _library(line: Started) -> Any:
    """The library for a call, None where there is none or it does not serve; raises as ``compiled``."""
    asked = line.options.engine == COMPILED
    if line.options.engine != "auto" and not asked:
        return None
    library = build.built() if asked else at_hand()
    if library is None:
        return None
    if (why := cannot(line)) is None:
        return library
    if asked:
        raise build.not_served(f"solve {line.m.name!r}", why)
    return None


@dataclass(frozen=True)
class InKernel:
    """Variants of a mechanism in the tables of the kernel: ``itself`` and its variants ``kernel``; ``forces``: whether it gives theirs."""

    line: Started
    itself: Kernel
    kernel: Kernel
    forces: bool

    def begin(self, x: Array) -> None:
        """Let the variants begin in closed states ``x (nx, V)``, or all in one ``(nx, 1)``."""
        self.kernel.P[:, START : START + len(x)] = x.T

    def lead(self, valid: Mask, system_at: PartOfTheWay) -> Array:
        """Closed states ``(nx, V)`` of the ``valid`` variants, led there from the mechanism itself; NaN where a step is not certified.

        On all of the way there are mechanisms, whose numbers ``system_at`` gives.
        """
        V = len(valid)
        at, step, P = np.zeros(V), np.ones(V), np.repeat(self.itself.P, V, axis=0)
        x = np.repeat(self.line.x[None], V, axis=0)
        left = np.flatnonzero(valid)
        while left.size:
            ahead = np.minimum(at[left] + step[left], 1.0)
            middle, built = self._on_the_way(system_at, at[left] + MIDDLE * (ahead - at[left]), left)
            there, short = self.kernel.P[left], np.flatnonzero(ahead < 1.0)
            if short.size:
                there[short], ok = self._on_the_way(system_at, ahead[short], left[short])
                built[short] &= ok
            begin, states = replace(self.itself, P=P[left]) if at.any() else self.itself, x[left]
            went = begin.lead(states, middle, there) & built
            some = left[went]
            at[some], x[some], P[some] = ahead[went], states[went], there[went]
            step[left] *= np.where(went, 2.0, 0.5)
            left = left[(at[left] < 1.0) & (step[left] >= SHORTEST_PART)]
        return np.where(at < 1.0, np.nan, x.T)

    def _on_the_way(self, system_at: PartOfTheWay, part: Array, which: Index) -> tuple[Array, Mask]:
        """Tables of variants on the way, under the loads of the mechanism itself, and which could be built."""
        system, built = system_at(part, which)
        x = np.broadcast_to(self.line.x[:, None], (len(self.line.x), len(part)))
        filled = tables(self.itself.layout, system, x, self.line.m.loads if self.forces else None)
        assert filled is not None
        return filled[1], built


def in_kernel(line: Started, systems: System, loads: tuple[Load, ...], count: int) -> InKernel | None:
    """Variants in the tables of the kernel, at the start of the mechanism itself; None where it does not serve, raises as ``compiled``."""
    library = _library(line)
    if library is None:
        return None
    itself, forces = _kernel(line, library)
    x = np.broadcast_to(line.x[:, None], (len(line.x), count))
    kernel, known = _filled(line, library, systems, x, loads)
    return InKernel(line, itself, kernel, known) if known == forces else None


def _kernel(line: Started, library: Any) -> tuple[Kernel, bool]:
    """The tables of a call with the library, and whether they give its forces; those of the last call are kept with the start.

    The start may be shared with mechanisms under other loads.
    """
    key, kept = _tables_key(line), line.start.solvers
    known = kept.get(COMPILED)
    loads = line.m.loads
    if known is None or known[0] != key or len(known[1]) != len(loads) or any(map(is_not, known[1], loads)):
        kept[COMPILED] = known = key, loads, _filled(line, library, line.system, line.x[:, None], loads)
    found: tuple[Kernel, bool] = known[2]
    return found


def _tables_key(line: Started) -> tuple[object, ...]:
    return line.columns.tobytes(), gives_forces(line), _passive(line)


def _filled(line: Started, library: Any, system: System, x: Array, loads: tuple[Load, ...]) -> tuple[Kernel, bool]:
    """The tables of all variants at their starts ``x (nx, B)`` with the library, and whether they give the forces."""
    found = _layout(line)
    assert isinstance(found, Layout)
    filled = tables(found, system, x, loads) if gives_forces(line) else None
    forces = filled is not None
    filled = filled or tables(found, system, x, None)
    assert filled is not None
    return Kernel(library, found.rubbing(int(filled[0][HEAD_RUBS])), *filled), forces


def served_before(line: Started) -> bool:
    """Whether a mechanism of the graph, with the same drives and no passive freedoms, has the tables of the kernel, and it is asked for."""
    return line.options.engine in ("auto", COMPILED) and isinstance(line.system.sized_once.get(_key(line)), Layout)


def closed_beside(line: Started, x: Array) -> Configuration | None:
    """The state near ``x (nx,)`` that the kernel closes, the drives kept, with its tables; None where it served no mechanism of the graph
    before.
    """
    library = at_hand()
    if library is None or not served_before(line):
        return None
    filled = _filled(line, library, line.system, x[:, None], line.m.loads)
    closed = filled[0].closed(len(x))
    if closed is None:
        return None
    filled[0].P[:, START : START + len(x)] = closed
    here = Configuration(line.system, closed[:, None])
    here.solvers[COMPILED] = _tables_key(line), line.m.loads, filled
    return here


def _key(line: Started) -> tuple[object, ...]:
    """What of a mechanism is in the layout, beside its graph."""
    key = COMPILED, line.columns.tobytes(), _passive(line), tuple((c.freedoms, c.steps) for c in line.m.couplings)
    return *key, tuple((belt.belt, *rows) for belt, rows in line.m.once(pretensions))


def _layout(line: Started) -> Layout | str:
    """The layout of a mechanism, or what of it cannot be carried; kept with all mechanisms of its graph, whose couplings may be others."""
    sized, key = line.system.sized_once, _key(line)
    if key not in sized:
        why = why_not(line.system)
        sized[key] = layout(line.system, line.columns, line.passive) if why is None else why
    found: Layout | str = sized[key]
    return found


def _passive(line: Started) -> tuple[object, ...]:
    """What of passive motions stands in the tables: loads in freedoms make some of them free."""
    return tuple((motion.links, motion.turns, motion.rates.tobytes()) for motion in line.passive)


def cannot(line: Started) -> str | None:
    """Why the kernel does not serve a call; None where it does."""
    if not are_alone(line.passive):
        return "a link has several passive motions"
    if len(line.lead) < len(line.columns):
        return "its drives depend on each other"
    found = _layout(line)
    return found if isinstance(found, str) else None


def gives_forces(line: Started) -> bool:
    """Whether the kernel gives the forces that are asked for."""
    return line.options.method == "loop_wrench" and line.options.redundant != "elastic" and line.acting is line.columns
