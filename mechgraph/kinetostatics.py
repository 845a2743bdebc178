"""Kinetostatics and kinematics: what a user calls, the pipeline of a call, named errors for what cannot be solved; transmission.

How well the drivers move an output against a load: transmission angle, deviation angle, and their form for any mechanism.

The mechanism at rest and without mass, a unit effort in the freedom of the output: pairs (and gears) k transmit wrenches (F, M) to the
output link, M about the point of the pair (of a contact where its elements touch, of a ball or roller its center), where a unit rate of
the freedom makes the velocity v and the angular velocity w:

    sin mu = cos delta = |sum_k F_k . v_k + M_k . w| / sum_k (|F_k| |v_k| + |M_k| |w|),

what the wrenches do over the most that they could do if they were turned about their points. One force alone gives the angle delta between
it and the velocity of its point, and so the transmission angle mu of a planar four-bar, between coupler and output (H. Alt, Der
Uebertragungswinkel, Werkstattstechnik 26, 1932); of a sphere on a plane delta is the angle between the normal and the velocity of the
output where they touch (M. V. Hernandez, thesis, University of Florida, 1983, section 6.6). Where constraints are redundant the wrenches
are those of least norm.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import cached_property, partial
from math import prod
from typing import Annotated, Any, Literal, TypeVar

import numpy as np

from mechgraph.determinacy.finite_motion import branches, branches_text
from mechgraph.determinacy.mobility import Freedoms, actuation_fault, free_motion
from mechgraph.determinacy.report import (
    change_point_error,
    check,
    dead_point_error,
    hinted,
    no_longer_passive_error,
    structure_error,
    undecided_error,
    undriven_error,
)
from mechgraph.determinacy.snapping import SnappedMechanism, declared_closure, meant
from mechgraph.document import Document, Paragraph, Shown
from mechgraph.errors import (
    AssemblyError,
    DeadPointError,
    DeclarationError,
    FrictionError,
    IndeterminateError,
    MechgraphWarning,
    ReachError,
)
from mechgraph.files import plain
from mechgraph.force.loads import hold_names
from mechgraph.force.reactions import MethodName
from mechgraph.kinematics.assembly import assembled_at, closed_start, last_closed, named_columns
from mechgraph.kinematics.motion_path import FARTHEST, DriverPath, Positions, Status, far_faults, requests
from mechgraph.kinematics.passive_rest import unspun
from mechgraph.kinematics.prescribed import Actuators, DriverMotion
from mechgraph.kinematics.rates import PassiveMotion, PassiveMotions, are_alone, distance_to_dead_point
from mechgraph.kinematics.reach import away_from_poles, follow
from mechgraph.kinematics.solver import MotionEngineName, closure_solver, engine_for, solver_at_start
from mechgraph.kinematics.state import CLOSED, ClosureSolver, Configuration
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import independent_rows
from mechgraph.maths.newton import Nodes
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import MOTIONS, PATH, Tolerances
from mechgraph.memo import dataclass
from mechgraph.model.loads import Effort, Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.parameters import declared
from mechgraph.outcome import FollowedPositions, Options, Outcome, Starts, closed_beside, compiled, served_before
from mechgraph.quantities import door, wrong
from mechgraph.result.contacts import with_other_flanks
from mechgraph.result.notes import WHY_NOT, doubted_angles
from mechgraph.result.solution import Solution
from mechgraph.result.values import OK, PositionLabels, ranges
from mechgraph.result.views import CouplingResult

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

    def __init__(self, drive: DriverMotion, options: Options, trusting: bool = False) -> None:
        """``trusting``: where the kernel is likely to serve, its solution is the proof that the drivers determine the motion."""
        self.drive, self.m, self.options = drive, drive.m, options
        self.passive: tuple[PassiveMotion, ...] = ()
        self.start = closed_start(
            self.m, drive.first, closer=self._closed_beside if trusting and not drive.free else None
        )
        if drive.free:
            self.m = drive.whole(self.start)
            self.start = closed_start(self.m)
        self.system, self.x = self.start.system, self.start.x[:, 0]
        self.columns = self.system.columns_of(drive.names)
        self.unit = np.where(self.system.is_length[self.columns], self.system.par.L, 1.0)
        self._refuse_far()
        # reactions of least norm are found position by position, where nothing is gained from many of them
        positions = 1 if options.redundant == "minimum_norm" else prod(drive.batch)
        self.engine = engine_for(self.system.n_rows, positions, options.engine)
        self.lead = np.arange(len(self.columns))
        self.hold: Index | None = None
        self.acting = self.columns
        self.trusts = trusting and drive.actuated is None and served_before(self)
        self.solver: ClosureSolver = closure_solver(self.engine, self.columns)
        if not self.trusts:
            self._determine()

    def _closed_beside(self, system: System, x: Array) -> Configuration | None:
        """See ``assembly.Closer``."""
        self.system = system
        self.columns = self.acting = system.columns_of(self.drive.names)
        return closed_beside(self, x)

    def _determine(self) -> None:
        """What leads, what is passive, and what solves the closure equations; raises where the drivers do not determine the motion."""
        self.solver, proved = solver_at_start(self.engine, self.columns, self.start)
        if not proved:
            self.lead = self.freedoms.leading(self.columns)
            self._check_determinate()
            self.passive, self.hold = self.freedoms.passive, self.freedoms.hold
            self.solver = closure_solver(self.engine, self.leading, self.hold)
            self._check_passive()
        self.acting = self._acting() if self.options.method else self.columns

    @cached_property
    def freedoms(self) -> Freedoms:
        """What can move at the start, what the drivers leave free, passive freedoms."""
        key = "free", self.engine, self.columns.tobytes(), tuple(load.freedoms for load in self.m.loads)
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
        options = replace(self.options, engine=self.engine)
        line = Pipeline(at_rest, options)
        found = line.run().trajectory
        if found.has_forces and not found.bears_nothing(line.columns[len(drive.names) :]):
            found = Pipeline(at_rest, replace(options, method=None)).run().trajectory
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
            # part of the condition number within which a start is not told from a dead point: some hundred roundings of its
            # closing
            if f.condition[0] < PATH.doubtful or near > 1e-13 * f.condition[0]:
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
        if self.trusts:
            self.trusts = False
            self._determine()
            return self.run(starts, batch)
        start = None if starts else self.start
        starts = starts or Starts(self.x[:, None], self.system.cases, self.m.loads)
        one = starts.x.shape[1] == 1
        T = prod(batch)
        shared = starts.sharing > 1
        variant = np.zeros(T, dtype=np.intp) if one and not shared else np.arange(T) // batch[-1]
        followed = (1, batch[-1]) if shared else batch
        path = DriverPath(self.system, self.solver, starts.system_of, start)
        path.carries = are_alone(self.passive)
        found = self._followed(path, starts, followed)
        return FollowedPositions(self, starts, batch, variant, found, path)

    def _followed(self, path: DriverPath, starts: Starts, batch: tuple[int, ...]) -> Positions:
        """The positions along the path."""
        values = self.values("position", batch)[self.lead]
        found = follow(path, requests(starts.x, values, batch), prod(batch))
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
        # on a track that ends sooner than the shortest trial step nothing moves but what a shaky start lets pass as rounding
        reach = np.zeros(len(found.tracks.end))
        np.maximum.at(reach, nodes.track, nodes.place)
        open_ = np.isin(nodes.track, nodes.track[here.closure > CLOSED])
        closed = np.flatnonzero(~open_ & (f.condition <= PATH.singular) & (reach[nodes.track] > 0.003))
        if not closed.size:
            return
        some = here.part(closed)
        error = 10.0 * f.condition[closed] * (some.closure + np.finfo(float).eps)
        motions = PassiveMotions(some, self.passive, f.part(closed, some).motions())
        strays = motions.strays > np.maximum(MOTIONS.still, error)
        moves: list[bool] = np.any(strays, axis=1).tolist()
        if any(moves):
            first = closed[int(np.argmax(np.any(strays, axis=0)))]
            names = [name for name, stray in zip(hold_names(self.m, self.passive), moves, strict=True) if stray]
            values = nodes.drive[:, first] * self.unit[self.lead]
            drives = dict(zip(np.array(self.drive.names)[self.lead].tolist(), values.tolist(), strict=True))
            raise no_longer_passive_error(self.drive.m, names, drives)

    def _with_start(self, key: tuple[object, ...], make: Callable[[], Made]) -> Made:
        """What follows from the start and the drivers alone is kept with the start."""
        kept = self.start.solvers
        made: Made = kept.get(key, kept)  # itself stands for nothing; another thread may clear it at any time
        if made is kept:
            made = kept[key] = make()
        return made


ReachName = Literal["raise", "flag"]
RedundantName = Literal["nan", "minimum_norm", "elastic"]
ON_REACH: tuple[ReachName, ...] = ("raise", "flag")
REDUNDANT: tuple[RedundantName, ...] = ("nan", "minimum_norm", "elastic")
SOLVED = tuple(
    s.value for s in (Status.OK, Status.CHANGE_POINT, Status.ACTUATORS_REST, Status.FRICTION_OPEN, Status.LIFTS_OFF)
)
"""Outcomes that are no reason to raise."""
RUBBING = (Status.JAMS, Status.NO_FINITE_FORCE)
FLAG = "Pass on_reach='flag' to keep the reachable positions"
WITHOUT_BOUND, BEFORE_END = 1e3, 0.01
"""Slides of so many lengths L that have doubled within so much of the path before its end grow without bound."""


def _words(solution: Solution) -> set[str]:
    """Which outcomes there are."""
    return set(solution.status.reshape(-1).tolist())


def _unreached(line: Pipeline, outcome: Outcome, solution: Solution) -> Exception | None:
    """The named error for the first position that was not solved, with the solution so far."""
    if _words(solution) <= {*SOLVED}:
        return None
    bad = np.flatnonzero(~np.isin(solution.status.reshape(-1), SOLVED))
    first = int(bad[0])
    status = Status(solution.status.reshape(-1)[first])
    wanted = (line.values("position", outcome.batch)[:, first] * line.unit).tolist()
    values = dict(zip(line.drive.names, wanted, strict=True))
    head, (what, why) = f"mechanism {line.m.name!r}: position {first} ({_listed(values.items())})", WHY_NOT[status]
    if status in RUBBING:
        factor, places = outcome.trajectory.friction_factor(first)
        text = f"{head} {what.format(factor=factor)}: {why.format(pairs=', '.join(places))}. {FLAG}"
        return FrictionError(text, values, solution, kind=status.value, factor=factor, places=places)
    if outcome.found is None:
        return None
    dead = status in (Status.DEAD_POINT, Status.BEYOND_DEAD_POINT)
    nodes = outcome.found.nodes_of(int(outcome.found.track[first]))
    last, still = outcome.found.reached[:, first], False
    way = nodes.take((nodes.place >= 0.0) & (nodes.place <= outcome.found.place[first]))
    if len(way) > 1 and not dead:
        end = last_closed(line.system, way, line.leading)
        still = not end.place[0]
        last = end.drive[:, 0] if end.place[0] < way.place[-1] else last
    reached = dict(zip([line.drive.names[i] for i in line.lead], (last * line.unit[line.lead]).tolist(), strict=True))
    meets = dead and len(nodes)
    ways = branches(line.system, nodes.x[:, np.argmax(nodes.place)], line.leading) if meets else ()
    misses = solution.checks.closure.reshape(-1)
    what = what.format(
        at=_listed(reached.items()),
        far=_without_bound(line.system, way),
        meet=f" ({branches_text(ways, line.drive.names[line.lead[0]])})" if ways else "",
        miss=misses[first],
        most=np.max(misses, where=np.isfinite(misses), initial=0.0),
    )
    if still:
        what, why = "is not reachable (status 'out of reach')", "no finite motion keeps the loops closed from "
        why += f"{_listed(reached.items())} (see mechgraph.check)"
    if outcome.found.left[first]:
        what, why = "is not reachable (status 'out of reach')", outcome.found.left[first]
    every = zip(line.drive.names, line.drive.values("position", outcome.batch), strict=True)
    doubts = doubted_angles(line.m, dict(every) if solution.t is None else {})
    text = ". ".join([f"{head} {what}: {why}", *map(str, doubts), FLAG])
    if not dead:
        return ReachError(text, reached, solution)
    error = DeadPointError(text, reached, solution)
    error.branches = ways
    return error


def _without_bound(system: System, way: Nodes) -> str:
    """What is said of slides that grow without bound towards the end of a way; towards a fold they keep to a limit."""
    if not len(way):
        return ""
    slides = np.flatnonzero(system.is_length)
    q = system.coordinates_of(way.x)[slides]
    before = np.abs(q[:, way.place <= way.place[-1] - BEFORE_END]).max(axis=1, initial=0.0)
    far = np.abs(q[:, -1]) > np.maximum(WITHOUT_BOUND, 2.0 * before)
    names = system.freedom_names_of(slides[far])
    said = _listed(zip(names, (q[far, -1] * system.par.L).tolist(), strict=True))
    return f", where {said}, growing without bound" if said else ""


def _listed(values: Iterable[tuple[str, float]]) -> str:
    return ", ".join(f"{name} = {value:.6g}" for name, value in values)


def _check_drivers(line: Pipeline, outcome: Outcome) -> None:
    unsolved = not outcome.moved
    if not outcome.contradicting.any() and not (unsolved and line.freedoms.dependent):
        return
    names, mobility = ", ".join(line.drive.names), line.freedoms.mobility
    why = (
        f"the drivers {names} conflict: no position satisfies all prescribed motions (mobility {mobility}, "
        f"{len(line.columns)} drivers). Remove a driver, or prescribe consistent motions"
        if len(line.columns) > 1
        else f"the driver {names} is locked: no other position satisfies its motion (mobility {mobility}). Drive another freedom"
    )
    raise IndeterminateError(f"mechanism {line.m.name!r}: {why}", check(line.drive.m))


def _check_actuators(line: Pipeline, outcome: Outcome) -> None:
    status = outcome.trajectory.status().reshape(-1)
    rest = np.flatnonzero(status == Status.ACTUATORS_REST.value) if line.drive.actuated else status[:0]
    if rest.size and not (status == Status.OK.value).any():
        raise line.actuation_error(Configuration(line.system, outcome.trajectory.states_at(rest[:1])), line.acting)


def _solve(
    m: Mechanism,
    motions: Mapping[str, Any] | None,
    on_reach: str,
    options: Options,
    actuate: Actuators | None = None,
    tol: float | None = None,
    quiet: bool = False,
) -> Solution:
    try:
        return _solved(meant(m, tol, "solve"), motions, on_reach, options, actuate, quiet)
    except (AssemblyError, DeadPointError, IndeterminateError, ReachError) as error:
        if tol is None and m.tol is None:
            hinted(m, error)
        raise


def _solved(
    m: Mechanism,
    motions: Mapping[str, Any] | None,
    on_reach: str,
    options: Options,
    actuate: Actuators | None,
    quiet: bool,
) -> Solution:
    line, outcome = _outcome(m, motions, options, actuate)
    solution = Solution(outcome.trajectory)
    reached = (*SOLVED, *(status.value for status in RUBBING))
    if outcome.found is None and not _words(solution) <= {*reached}:  # numpy says how far the path led
        line, outcome = _outcome(m, motions, replace(options, engine=line.engine), actuate)
        solution = Solution(outcome.trajectory)
    own, tol = (m.declared, m.changes.tol) if isinstance(m, SnappedMechanism) else (m, None)
    if (other := with_other_flanks(own, outcome.trajectory)) is not None:
        return _solved(meant(other, tol, "solve"), motions, on_reach, options, actuate, quiet)
    for warning in () if quiet else solution.doubts:
        warnings.warn(f"mechanism {m.name!r}: {warning}", MechgraphWarning, stacklevel=5)
    error = _unreached(line, outcome, solution) if on_reach == "raise" else None
    if error is not None:
        raise error
    return solution


def _outcome(
    m: Mechanism, motions: Mapping[str, Any] | None, options: Options, actuate: Actuators | None
) -> tuple[Pipeline, Outcome]:
    """All positions, with the closure errors of the geometry as it is declared."""
    m, line, outcome = _run(m, motions, options, actuate)
    _check_drivers(line, outcome)
    _check_actuators(line, outcome)
    if isinstance(m, SnappedMechanism):
        outcome.trajectory.as_declared(partial(declared_closure, line.system, declared(m.declared)), m.changes.tol)
    return line, outcome


def _run(
    m: Mechanism, motions: Mapping[str, Any] | None, options: Options, actuate: Actuators | None
) -> tuple[Mechanism, Pipeline, Outcome]:
    """All positions; again with other axes of spheres where some of them, or what ends the path, lie beside poles: of that mechanism."""
    # axes of spheres that are tried for a path: each keeps far from what is known of it, which may be a part
    for _ in range(4):
        line = Pipeline(DriverMotion(m, motions, actuate), options, trusting=True)
        outcome = line.run()
        meant_with = m.changes.tol if isinstance(m, SnappedMechanism) else None
        own = m.declared if isinstance(m, SnappedMechanism) else m
        other = None if outcome.found is None else away_from_poles(own, line.system, outcome.found)
        if other is None:
            break
        m = other if meant_with is None else meant(other, meant_with, "solve")
    return m, line, outcome


def solve_quietly(m: Mechanism, motions: Mapping[str, Any], options: Options, actuate: Actuators | None) -> Solution:
    """One of many: positions out of reach flagged, and what ``Solution.warnings`` says not said as Python warnings."""
    return _solve(m, motions, "flag", options, actuate, quiet=True)


@door
def kinematics(
    m: Mechanism,
    motions: Mapping[str, Any] | None = None,
    *,
    on_reach: ReachName = "raise",
    engine: MotionEngineName = "auto",
    tol: float | None = None,
    tolerances: Tolerances | None = None,
) -> Solution:
    """Compute positions, velocities and accelerations of all pairs and links, without forces.

    Parameters
    ----------
    m, motions, on_reach, engine, tol
        As in ``solve``.
    tolerances : Tolerances, optional
        Numbers by which to decide, see ``Tolerances``. Default: those of the mechanism, which are the default ones.

    Returns
    -------
    Solution
        Without forces.

    Raises
    ------
    DeclarationError, AssemblyError, ReachError, DeadPointError, IndeterminateError
        As in ``solve``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> s = mg.kinematics(mg.load("four-bar"), {"A": mg.Motion(0.0, velocity=10.0)})
    >>> s["D"].velocity.round(4)
    array([-3.0435])
    """
    return _solve(m, motions, on_reach, Options(None, "nan", engine), tol=tol)


@door
def solve(
    m: Mechanism,
    motions: Mapping[str, Any] | None = None,
    *,
    actuate: Actuators | None = None,
    method: MethodName = "loop_wrench",
    loads: Iterable[Load] | None = None,
    redundant: RedundantName = "nan",
    on_reach: ReachName = "raise",
    engine: MotionEngineName = "auto",
    tol: float | None = None,
    progress: Callable[[int, int], None] | None = None,
    tolerances: Tolerances | None = None,
) -> Solution:
    """Compute driver efforts and reactions for prescribed driver motion (inverse dynamics; statics at zero rates).

    Closes the loops along the path from ``start`` (``T_b = T_a A D(q) B^-1`` around every loop), solves the rates ``J q' = 0``, and then
    d'Alembert's equations of every link, ``sum w - (I V' + V x* I V) + w_applied = 0``.

    Parameters
    ----------
    m : Mechanism
        The mechanism.
    motions : mapping of str to Motion or array_like, optional
        Driver -> ``Motion``, or positions ``(...)`` [rad, length] at zero rates. Shapes broadcast; the last axis is a path from
        ``start``, other axes are independent cases. Default: the motions stored with the drives. Keys may also name a point
        (``"bucket.tip"``: positions ``(..., 3)``), a link (poses ``(..., 4, 4)``, rates: twist and its rate ``(..., 6)``) or a
        coordinate of these: ``"bucket.tip.Tz"``, ``"bucket.tip.T(1,0,1)"`` along a direction, ``"platform.Rz"`` of the rotations
        about x, the new y and the new z.
    actuate : freedom, pair or drive, or iterable of them, optional
        Freedoms in which actuators act, one per independent prescribed motion. Default: those with prescribed motion. If they are
        stationary while the mechanism moves, forces are NaN (status "actuators at dead point").
    method : {"loop_wrench", "newton_euler", "printed"}
        One unknown wrench per loop; all reaction components and efforts at once; or the system that ``formulate(m)`` prints (slowest).
    loads : iterable of load, optional
        Replace the declared loads.
    redundant : {"nan", "minimum_norm", "elastic"}
        Value of components that are not unique: NaN, or the least ``sum |F|^2 + |M / L|^2``, moments about the pair points. The latter
        assumes equal stiffness of all pairs, rigid links and no preload. ``"elastic"``: as the ``stiffness=`` and ``misfit=`` of the pairs
        split them, ``(N^T C N) x = N^T (misfit - C l0)``; what only rigid components share stays NaN.
    on_reach : {"raise", "flag"}
        Unreachable positions: raise, or return NaN rows and ``Solution.status``.
    engine : {"auto", "dense", "sparse", "compiled"}
        Linear algebra of numpy, or the kernel in C (built at first use). ``"auto"`` takes the kernel if it is installed or built and
        serves, else the faster one for the size. The values are the same.
    tol : float, optional
        Accuracy of directions [rad] and distances (relative to L). mechgraph solves ``m.snapped(tol)``; ``checks.closure`` is that of
        the declared geometry, and positions at which it exceeds ``tol`` are not solved. Default: that of the mechanism, or exact.
    progress : callable, optional
        Called with the numbers of positions done and of all.
    tolerances : Tolerances, optional
        Numbers by which to decide, see ``Tolerances``. Default: those of the mechanism, which are the default ones.

    Returns
    -------
    Solution

    Raises
    ------
    DeclarationError
        Invalid arguments; all of them.
    AssemblyError
        The loops cannot be closed near ``start``.
    ReachError, DeadPointError
        A position is not reachable, or the drivers do not determine the motion there; ``error.solution`` has the positions before.
    IndeterminateError
        A freedom is neither driven nor passive, or prescribed motions conflict.

    Examples
    --------
    >>> import mechgraph as mg
    >>> s = mg.solve(mg.load("four-bar"), {"A": 0.5})
    >>> round(float(s["B"].components["Fx"]), 4)
    -2.7116
    """
    if loads is not None:
        m = m.replace(loads=loads)
    return _solve(m, motions, on_reach, Options(method, redundant, engine, progress), actuate, tol)


@door
def assemble(
    m: Mechanism, values: Mapping[str, float] | None = None, guess: Mapping[str, Any] | None = None
) -> Mechanism:
    """Return the mechanism assembled at the given joint values.

    From ``start`` the named freedoms move to their values in small steps with closed loops, so the branch is kept. From a ``guess``
    the loops are closed directly.

    Parameters
    ----------
    m : Mechanism
        The mechanism.
    values : mapping of str to float, optional
        Freedom -> value [rad, length].
    guess : mapping of str to float, optional
        Pair coordinates from which Newton's method starts.

    Returns
    -------
    Mechanism
        With ``start`` set to the closed coordinates.

    Raises
    ------
    AssemblyError
        The loops cannot be closed.
    ReachError
        A value is not reachable on this branch.

    Examples
    --------
    >>> import mechgraph as mg
    >>> m = mg.assemble(mg.load("four-bar"), {"A": 0.5})
    >>> {name: round(value, 4) for name, value in m.start.items()}
    {'A.Rz': 0.5, 'B.Rz': -0.4996, 'C.Rz': 0.1626, 'D.Rz': -0.163}
    """
    system, x = assembled_at(m, {} if values is None else values, guess)
    wanted = {m.full_name(name): float(m.in_own_units(name, value)) for name, value in (values or {}).items()}
    q = system.coordinates_of(x[:, None], system.start_coordinates(m.start))[:, 0]
    start = dict(zip(m.freedom_names(), q.tolist(), strict=True)) | wanted
    return m.replace(start=start)


@dataclass(frozen=True, eq=False, repr=False)
class Transmission(Shown):
    """How well ``drivers`` move the freedom ``output`` at the positions of a solution. Returned by ``transmission``.

    Attributes
    ----------
    drivers, output : tuple of str, str
        Full names of the freedoms.
    index : (...) array
        1 if all that is transmitted moves the output, 0 if nothing does; NaN if the drivers cannot hold it.

    Examples
    --------
    >>> import mechgraph as mg
    >>> s = mg.solve(mg.load("four-bar"), {"A": [0.0, 1.0]})
    >>> mg.transmission(s, "D").index.round(3)
    array([0.938, 0.997])
    """

    solution: Solution
    drivers: tuple[str, ...]
    output: str
    index: Array

    @property
    def transmission_angle(self) -> Array:
        """``mu = arcsin(index)``, 0 to pi/2: best at pi/2."""
        return np.arcsin(self.index)

    @property
    def deviation_angle(self) -> Array:
        """``delta = pi/2 - mu``: best at 0."""
        return np.arccos(self.index)

    def document(self) -> Document:
        """Ranges of both angles, and where they are reached."""
        rows = [
            ("transmission angle [deg]", np.rad2deg(self.transmission_angle)),
            ("deviation angle [deg]", np.rad2deg(self.deviation_angle)),
        ]
        places = PositionLabels(self.solution._values)
        text = f"From {', '.join(self.drivers)} to {self.output}, links at rest and without mass."
        return Document(f"Transmission of {self.solution.mechanism.name}", (Paragraph(text), ranges(rows, places.name)))

    def to_dict(self) -> dict[str, Any]:
        """The ranges as plain data."""
        known = self.transmission_angle[np.isfinite(self.index)]
        least, greatest = (float(f(known)) if known.size else None for f in (np.min, np.max))
        return dict(plain(TransmissionData(self.drivers, self.output, least, greatest)))


@dataclass(frozen=True)
class TransmissionData:
    """The range of the transmission angle, in radians; none where the drivers never hold the output."""

    drivers: Annotated[tuple[str, ...], "freedoms in which the efforts stand"]
    output: Annotated[str, "the freedom that is loaded"]
    least: float | None
    greatest: float | None


@door
def transmission(s: Solution, output: str, driver: str | None = None) -> Transmission:
    """Compute transmission index and angle of an output over a solution.

    The index is the power that the transmitted wrench does on the output, over the most that it could do; for one force ``sin mu``.

    Parameters
    ----------
    s : Solution
        A solution.
    output : str
        A single freedom, ``"D"`` or ``"C.Tz"``, of the pair of the output link (link b; link a where b is the frame) and the link that
        guides it.
    driver : str, optional
        The input freedom. Default: those that take the efforts of the solution.

    Returns
    -------
    Transmission

    Raises
    ------
    DeclarationError
        ``output`` is not a freedom, or is the driver.

    Examples
    --------
    >>> import mechgraph as mg
    >>> s = mg.solve(mg.load("four-bar"), {"A": [0.0, 1.0]})
    >>> mg.transmission(s, "D").transmission_angle.round(4)
    array([1.2168, 1.4986])
    """
    m = s.mechanism
    named = {"output": output} if driver is None else {"output": output, "driver": driver}
    faults = [f"{what}: {fault}" for what, name in named.items() if (fault := m.freedom_fault(name, single=True))]
    if faults:
        raise DeclarationError(f"transmission of {m.name!r}", faults)
    output, drivers = m.full_name(output), s.actuated if driver is None else (m.full_name(driver),)
    if output in drivers:
        raise DeclarationError(
            f"transmission of {m.name!r}", [wrong(output, "output", "another freedom than a driver")]
        )
    index = transmission_index(_held(s, output, drivers), output, drivers)
    return Transmission(s, drivers, output, np.where((s.status == OK), index, np.nan))


@door
def least_preload(s: Solution, pair: str, stiffness: float = 0.0, freedom: str | None = None) -> float:
    """Compute the least preload of a spring that keeps a contact closed over a solution.

    A spring in the freedom that guides link b presses it with ``F + k d``, d its way from where the spring is longest. With the normal
    force N without it, and n that of a unit effort in the freedom, ``F >= -N / n - k d`` at all positions.

    Parameters
    ----------
    s : Solution
        A solution with forces.
    pair : str
        A contact with one normal force.
    stiffness : float
        Stiffness k of the spring [force / length, or torque]. Default: a constant force.
    freedom : str, optional
        The freedom in which the spring acts. Default: that of the pair with one freedom between link b and the frame.

    Returns
    -------
    float
        Least force (or torque) where the spring is longest, 0 or more.

    Raises
    ------
    DeclarationError
        No such contact or freedom; the spring does not press everywhere, or its stiffness is negative.

    Examples
    --------
    >>> import mechgraph as mg
    >>> at = (0, 0, 1.0)
    >>> block = mg.Pair("G", "P", "frame", "block", point=at, axis=(0, 0, 1))
    >>> table = mg.Pair("T", "P", "frame", "table", point=(0, 0, 0), axis=(0, 0, 1))
    >>> ball = mg.Pair("K", "Sp", "table", "block", point=at, axis=(0, 0, 1))
    >>> m = mg.Mechanism(
    ...     "press", [mg.Link("frame"), mg.Link("table"), mg.Link("block", 2.0, at)], [table, block, ball], ["T"]
    ... )
    >>> s = mg.solve(m, {"T": mg.Motion(0.0, acceleration=-3.0)})
    >>> round(mg.least_preload(s, "K"), 9)
    6.0
    """
    m, c = s.mechanism, s.contact(pair)
    where = f"least preload of {pair!r}"
    if not 0.0 <= stiffness < np.inf:
        raise DeclarationError(where, [wrong(stiffness, "stiffness", "0 or a positive number")])
    row = m.pair(pair)
    if row.type.touching is None or len(row.type.touching.forces) != 1:
        raise DeclarationError(where, [wrong(row.type.symbol, "type", "a contact with one normal force")])
    if freedom is None:
        guides = [p for p in m.pairs if {p.a, p.b} == {row.b, m.frame} and p.type.f == 1]
        if not guides:
            raise DeclarationError(
                where, [f"freedom: no pair with one freedom guides {row.b!r} on the frame; name one"]
            )
        freedom = guides[0].freedom_names[0]
    if fault := m.freedom_fault(freedom, single=True):
        raise DeclarationError(where, [f"freedom: {fault}"])
    freedom = m.full_name(freedom)
    unit = _held(s, freedom, s.actuated).contact(pair).normal_force
    known = np.isfinite(unit) & np.isfinite(c.normal_force)
    sense = np.sign(unit[known])
    if not known.any() or not (sense == sense.flat[0]).all() or not sense.all():
        raise DeclarationError(
            where, [f"freedom = {freedom!r}: a spring there does not press the contact at all positions"]
        )
    k, j = m.freedom(freedom)
    way = -sense.flat[0] * s._values.coordinates(k, 0)[..., j][known]
    needed = -c.normal_force[known] / np.abs(unit[known]) - stiffness * (way - way.min())
    return max(0.0, float(needed.max()))


def _held(s: Solution, output: str, drivers: tuple[str, ...]) -> Solution:
    """The links at rest and without mass at the positions of a solution: the drivers hold a unit effort in the output."""
    m, places = s.mechanism, PositionLabels(s._values)
    known = np.flatnonzero(places.solved)
    if not known.size or not s.prescribed:
        raise DeclarationError(f"transmission of {m.name!r}", ["no position with prescribed motion; solve one first"])
    light = with_unit_effort(m, output)
    # where a position was not solved the motion waits at one that was
    at = known[np.clip(np.searchsorted(known, np.arange(places.solved.size), side="right") - 1, 0, None)]
    motions = {name: of[at].reshape(s.batch) for name, of in zip(places.drivers, places.driver_values, strict=True)}
    actuate = None if set(drivers) == set(s.prescribed) else drivers
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MechgraphWarning)  # a contact transmits either way here
        return solve(light, motions, actuate=actuate, redundant="minimum_norm", on_reach="flag")


def with_unit_effort(m: Mechanism, output: str) -> Mechanism:
    """The mechanism without masses and loads, but for a unit effort in the output."""
    links = [link.replace(mass=0.0, inertia=None) for link in m.links]
    return m.replace(links=links, loads=[Effort(output, 1.0)], response=None)


def transmission_index(s: Solution, output: str, drivers: tuple[str, ...]) -> Array:
    """``sin mu`` at all positions of a mechanism at rest ``with_unit_effort`` in the output, reactions of least norm."""
    m = s.mechanism
    k, j = m.freedom(output)
    guide = m.pairs[k]
    link = guide.b if guide.b != m.frame else guide.a
    V = s._values.screws(k)[..., j]
    w = V[..., :3]
    does, could = np.zeros(s.batch), np.zeros(s.batch)
    for F, M, p in _wrenches(s, link, guide.name):
        v = V[..., 3:] + np.cross(w, p)
        does = does + (F * v).sum(axis=-1) + (M * w).sum(axis=-1)
        could = could + _size(F) * _size(v) + _size(M) * _size(w)
    efforts = [s[m.pairs[i].name].effort[..., n] for i, n in map(m.freedom, drivers)]
    # what wrenches on the output could do for a unit effort, below which nothing is transmitted
    held = np.isfinite(np.sum(efforts, axis=0)) & (could > 1e-12)
    return np.where(held, np.minimum(np.abs(does) / np.where(held, could, 1.0), 1.0), np.nan)


def _wrenches(s: Solution, link: str, guide: str) -> list[tuple[Array, Array, Array]]:
    """Force, moment about a point, and that point, of all that acts on a link beside its guide."""
    m, found = s.mechanism, []
    for pair in m.pairs:
        if link in (pair.a, pair.b) and pair.name != guide:
            # totals act on link b, forces of gears on the second one
            total = s[pair.name].total if link == pair.b else -s[pair.name].total
            p = s.contact(pair.name).center if pair.type.touching else s._values.frame_origin(m.pair_index[pair.name])
            found.append((total[..., 3:], total[..., :3] - np.cross(p, total[..., 3:]), p))
    for coupling in m.couplings:
        if coupling.steps and link in (gears := coupling.gears(m)):
            result = s.coupling(coupling.name)
            assert isinstance(result, CouplingResult)
            force = result.force if link == gears[1] else -result.force
            found.append((force, np.zeros_like(force), result.point))
    return found


def _size(v: Array) -> Array:
    return np.asarray(np.linalg.norm(v, axis=-1))
