"""The pipeline of a call: drives, start, positions, rates, forces, for one position, a cycle, cases or variants."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from functools import cached_property
from typing import TypeVar

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.by_kernel import compiled
from mechgraph.call import Options, Starts
from mechgraph.closure.assembly import CLOSED, closed_start, named_columns
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.driver_motion import DriverMotion
from mechgraph.closure.driver_path import FARTHEST, DriverPath, Positions, far_faults, requests
from mechgraph.closure.following import follow
from mechgraph.closure.indexing import Index
from mechgraph.closure.passive_motion import PassiveMotion, PassiveMotions, are_alone
from mechgraph.closure.passive_rest import unspun
from mechgraph.closure.rates import distance_to_dead_point
from mechgraph.closure.reduced_path import follow_reduced
from mechgraph.closure.reduction import Reduction, reduction_of
from mechgraph.closure.solver import ClosureSolver, closure_solver, engine_for, solver_at_start
from mechgraph.errors import DeclarationError, IndeterminateError
from mechgraph.force.passive_hold import hold_names
from mechgraph.numerics.linear import independent_rows
from mechgraph.numerics.tolerances import MOTIONS, PATH
from mechgraph.outcome import Followed, Outcome
from mechgraph.report.report import (
    change_point_error,
    check,
    dead_point_error,
    no_longer_passive_error,
    structure_error,
    undecided_error,
    undriven_error,
)
from mechgraph.result.solution import Solution
from mechgraph.structure.actuation import actuation_fault
from mechgraph.structure.branching import branches
from mechgraph.structure.mobility import Freedoms, free_motion

CLOSING = 1e-13
"""Part of the condition number within which a start is not told from a dead point: some hundred roundings of its closing."""
Made = TypeVar("Made")


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
        self.solver: ClosureSolver
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
        key = "free", self.engine, self.columns.tobytes(), tuple(load.in_freedom for load in self.m.loads)
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
        if (done := compiled(self, batch, starts)) is not None:
            return done
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
        return Followed(self, starts, batch, variant, found, path)

    def _followed(self, path: DriverPath, starts: Starts, batch: tuple[int, ...]) -> Positions:
        """The positions along the path, by the reduced form of the mechanism where it has one."""
        values, total = self.values("position", batch)[self.lead], int(np.prod(batch))
        form = self.reduction
        found = None if form is None else follow_reduced(path, form, starts.x, values, batch, total)
        if found is None:
            found = follow(path, requests(starts.x, values, batch), total)
            if self.passive:
                self._check_still_passive(path, found)
                found = unspun(path, found, self.passive)
                found.interpolate()
        return found

    def _check_still_passive(self, path: DriverPath, found: Positions) -> None:
        """What is passive at the start moves no other link at any regular node of the path, as far as that closes."""
        nodes = found.tracks.nodes
        here = path.at(nodes.x, nodes.drive, nodes.track)
        f = path.factored(here, nodes.which)
        open_ = np.isin(nodes.track, nodes.track[here.closure > CLOSED])
        closed = np.flatnonzero(~open_ & (f.condition <= PATH.singular))
        if not closed.size:
            return
        some = here.part(closed)
        strays = PassiveMotions(some, self.passive, f.part(closed, some).motions()).strays > MOTIONS.nearby
        moves: list[bool] = np.any(strays, axis=1).tolist()
        if any(moves):
            first = closed[int(np.argmax(np.any(strays, axis=0)))]
            names = [name for name, stray in zip(hold_names(self.m, self.passive), moves, strict=True) if stray]
            values = nodes.drive[:, first] * self.unit[self.lead]
            drives = dict(zip(np.array(self.drive.names)[self.lead].tolist(), values.tolist(), strict=True))
            raise no_longer_passive_error(self.drive.m, names, drives)

    @cached_property
    def reduction(self) -> Reduction | None:
        """The reduced form of the mechanism, where paths are followed by it."""
        key = "reduced", self.options.form, self.leading.tobytes()
        return self._with_start(key, lambda: reduction_of(self.start, self.leading, self.passive, self.options.form))

    def _with_start(self, key: tuple[object, ...], make: Callable[[], Made]) -> Made:
        """What follows from the start and the drivers alone is kept with the start."""
        kept = self.start.solvers
        made: Made = kept.get(key, kept)  # itself stands for nothing; another thread may clear it at any time
        if made is kept:
            made = kept[key] = make()
        return made
