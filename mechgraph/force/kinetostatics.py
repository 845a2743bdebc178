"""Kinetostatics and kinematics: from driver motion to efforts and all reactions, in one call."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure import passive_rest as idle
from mechgraph.closure.assembly import assembled_at
from mechgraph.closure.follow import SparseSolver
from mechgraph.closure.indexing import Index
from mechgraph.closure.march import Status
from mechgraph.closure.path import Positions, continued, fits_one_block
from mechgraph.errors import DeadPointError, DeclarationError, IndeterminateError, ReachError
from mechgraph.force.analysis import Analysis
from mechgraph.force.applied_loads import Site, nothing
from mechgraph.force.blocks import Blocks
from mechgraph.force.dalembert import METHODS, Problem
from mechgraph.force.found import Forces, Motions
from mechgraph.force.large import SparseAnalysis, move_sparse
from mechgraph.force.run import Run, self_length
from mechgraph.model.load import Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.linear import ChosenSystem
from mechgraph.numerics.memory import keep_freed_memory
from mechgraph.report.report import check
from mechgraph.result.solution import Solution
from mechgraph.structure.mobility import free_motion

CONTRADICTION = 1e-6
"""Relative part of the closure rates that drivers may leave open before they count as contradicting each other."""

ON_REACH = ("raise", "flag")
REDUNDANT = ("nan", "minimum_norm")


def _option(what: str, value: Any, allowed: Iterable[str]) -> list[str]:
    return [] if value in allowed else [f"{what} = {value!r}: expected one of {', '.join(map(repr, allowed))}"]


def _raise_unreached(run: Run, status: Any, last: Array, solution: Solution) -> None:
    """Named errors for positions that were not solved, with the solution so far."""
    flat = status.reshape(-1)
    bad = np.flatnonzero(flat != Status.OK.value)
    if bad.size:
        first = int(bad[0])
        case = first // max(1, self_length(run.batch))
        reached = {name: float(v * u) for name, v, u in zip(run.motions, last[:, case], run.unit, strict=True)}
        asked = {
            name: float(v) for name, v in zip(run.motions, run.values("position")[:, first] * run.unit, strict=True)
        }
        at = ", ".join(f"{name} = {value:.6g}" for name, value in reached.items())
        wanted = ", ".join(f"{name} = {value:.6g}" for name, value in asked.items())
        dead = flat[first] in (Status.DEAD_POINT.value, Status.BEYOND_DEAD_POINT.value)
        if dead:
            raise DeadPointError(
                f"mechanism {run.m.name!r}: dead point at {at} (asked for position {first}: {wanted}). The drivers do not "
                "determine the motion there; drive another freedom, stop before it, or use on_reach='flag'",
                reached,
                solution,
            )
        raise ReachError(
            f"mechanism {run.m.name!r}: position {first} ({wanted}) is out of reach; reached {at}. Use on_reach='flag' for the "
            "positions that can be reached",
            reached,
            solution,
        )


def _stuck(run: Run, motions: Motions) -> bool:
    """Whether positions were not reached because the drivers depend on each other."""
    if run.loops is None:
        return run.freedoms.dependent and not motions.good.size
    reached_all = motions.good.size == motions.status.size
    return not reached_all and free_motion(run.system, run.x, run.columns).dependent


def _check_drivers(run: Run, motions: Motions) -> None:
    worst = float(motions.rates.contradiction.max(initial=0.0))
    if worst > CONTRADICTION or _stuck(run, motions):
        names, mobility = ", ".join(run.motions), free_motion(run.system, run.x, run.columns).mobility
        why = (
            f"the drivers {names} contradict each other: their motions cannot be had together (mobility {mobility}, "
            f"{len(run.motions)} drivers). Take a driver away, or give motions that agree"
        )
        if not mobility:
            why = f"it cannot be driven by {names}: it is a structure (mobility 0) where it was assembled. Change a pair, see mg.check"
        raise IndeterminateError(f"mechanism {run.m.name!r}: {why}", check(run.m))


def kinematics(m: Mechanism, motions: Mapping[str, Any] | None = None, *, on_reach: str = "raise") -> Solution:
    """Positions, velocities and accelerations of all pairs and links, without forces; see ``solve``."""
    return _solve(m, motions, on_reach, None)


def solve(
    m: Mechanism,
    motions: Mapping[str, Any] | None = None,
    *,
    method: str = "loop_wrench",
    loads: Iterable[Load] | None = None,
    redundant: str = "nan",
    on_reach: str = "raise",
) -> Solution:
    """Driver efforts and all reactions for given driver motion (kinetostatics; statics where the rates are zero).

    Parameters
    ----------
    motions : driver -> ``Motion``, or positions at zero rates; shapes broadcast, the last axis is followed as a path from
        ``start``, other axes are independent cases. Left out where the drives carry their motion.
    method : ``"loop_wrench"`` (one unknown wrench a loop) or ``"newton_euler"`` (the printed equations; for up to some hundred links).
    loads : replace the declared ones.
    redundant : ``"nan"`` for components that are not unique, or ``"minimum_norm"`` (least ``sum |F|^2 + |M / L|^2``).
    on_reach : ``"raise"`` or ``"flag"`` (NaN rows, see ``Solution.status``).

    Raises
    ------
    DeclarationError, AssemblyError, ReachError, DeadPointError, IndeterminateError
    """
    faults = _option("method", method, METHODS) + _option("redundant", redundant, REDUNDANT)
    if faults:
        raise DeclarationError(f"solve {m.name!r}", faults)
    if loads is not None:
        m = m.replace(loads=tuple(loads))
    return _solve(m, motions, on_reach, (method, redundant))


def _solve(m: Mechanism, motions: Mapping[str, Any] | None, on_reach: str, forces: tuple[str, str] | None) -> Solution:
    faults = _option("on_reach", on_reach, ON_REACH)
    if faults:
        raise DeclarationError(f"solve {m.name!r}", faults)
    keep_freed_memory()
    run = Run(m, motions)
    if run.loops is None and by_blocks(run, forces):
        return _solve_in_blocks(run, on_reach, forces)
    solver: ChosenSystem | SparseSolver
    if run.loops is not None:
        moved, solver, reached = move_sparse(run.start, run.columns, run.loops, run.given())
        kind: type[Analysis] = SparseAnalysis
    else:
        moved, solver, found = run.move()
        reached, kind = found.reached, Analysis
    _check_drivers(run, moved)
    solved = kind(moved, None)
    if forces is not None:
        solved = kind(moved, forces_of(run, moved, solver, solved.user_coordinates, *forces))
    solution = Solution(solved)
    if on_reach == "raise":
        _raise_unreached(run, moved.status, reached, solution)
    return solution


def by_blocks(run: Run, forces: tuple[str, str] | None) -> bool:
    """Whether positions can be solved block by block: many of them, and nothing that looks at all of them at once."""
    if fits_one_block(int(np.prod(run.batch))) or run.freedoms.bodies:
        return False
    return forces is None or (forces[0] == "loop_wrench" and all(_by_position(load) for load in run.loads))


def _by_position(load: Load) -> bool:
    """Whether a load is a matter of each position by itself: one of values, not of callables that see the whole batch."""
    if not dataclasses.is_dataclass(load):
        return False
    return not any(callable(getattr(load, field.name)) for field in dataclasses.fields(load))


def solved_blocks(
    run: Run, found: Positions, status: Any, good: Index, forces: tuple[str, str] | None
) -> Iterator[tuple[Analysis, Index]]:
    """The positions ``good`` solved block by block, each with its places in the flat batch; ``status`` is kept up to date."""
    coordinates = continued(run.system, found.x.reshape(-1, status.size), run.batch, found.tracks)
    flat = coordinates.reshape(run.system.n_freedoms, status.size)
    for part in run.blocks(found, status, good):
        mine = flat[:, part.places]
        wrenches = None
        if forces is not None:
            wrenches = _forces(run, part.motions, part.solver, mine, part.places, *forces)
        solved = Analysis(part.motions, wrenches, mine)
        solved.settle()
        yield solved, part.places


def _solve_in_blocks(run: Run, on_reach: str, forces: tuple[str, str] | None) -> Solution:
    found = run.found()
    status, good = run.outcomes(found)
    solved, places = [], []
    for part, at in solved_blocks(run, found, status, good, forces):
        _check_drivers(run, part.motions)
        solved.append(part)
        places.append(at)
    solution = Solution(Blocks(solved, places, run.batch, status, run.t))
    if on_reach == "raise":
        _raise_unreached(run, status, found.reached, solution)
    return solution


def forces_of(
    run: Run, moved: Motions, solver: ChosenSystem | SparseSolver, coordinates: Array, method: str, redundant: str
) -> Forces:
    """Loads, and the wrenches of all pairs that balance them, at the positions of a run."""
    flat = coordinates.reshape(run.system.n_freedoms, int(np.prod(run.batch)))[:, moved.good]
    return _forces(run, moved, solver, flat, moved.good, method, redundant)


def _site(run: Run, moved: Motions, coordinates: Array, places: Index) -> Site:
    """All loads, acting."""
    site = Site(moved.here, moved.rates, coordinates, run.batch, places, run.t)
    site.collect(run.loads)
    return site


def _forces(
    run: Run,
    moved: Motions,
    solver: ChosenSystem | SparseSolver,
    coordinates: Array,
    places: Index,
    method: str,
    redundant: str,
) -> Forces:
    """Loads and wrenches at positions of coordinates ``(F, T)`` that stand at the ``places`` of the flat batch."""
    still = nothing((6, len(run.m.links), moved.here.T))
    found = Forces(moved.rates, lambda: _site(run, moved, coordinates, places), redundant == "nan", still, solver)
    efforts = found.site.scaled_efforts()
    loads = found.site.applied()
    loads += found.inertia
    bodies = () if run.loops is not None else run.freedoms.bodies
    if bodies and isinstance(solver, ChosenSystem):
        Z = solver.null_of_columns()
        found.hold, sizes = idle.hold(moved.here, bodies, Z, loads, efforts)
        names = idle.hold_names(moved.here, bodies, Z)
        found.holds = tuple((*name, size) for name, size in zip(names, sizes, strict=True))
        loads += found.hold
    found.wrenches = METHODS[method](Problem(moved.here, loads, efforts, run.columns, moved.held, moved.which, solver))
    return found


def assemble(
    m: Mechanism, values: Mapping[str, float] | None = None, guess: Mapping[str, Any] | None = None
) -> Mechanism:
    """The same mechanism with ``start`` set to closed coordinates at the given values of some freedoms.

    From ``start`` the freedoms named are led to their values in small steps, so that the branch is kept; from a ``guess`` the
    loops are closed directly.

    Raises
    ------
    AssemblyError, ReachError
    """
    system, x = assembled_at(m, {} if values is None else values, guess)
    wanted = {m.full_name(name): float(value) for name, value in (values or {}).items()}
    q = system.coordinates_of(x[:, None], system.start_coordinates(m.start))[:, 0]
    start = dict(zip(m.freedom_names(), q.tolist(), strict=True)) | wanted
    return m.replace(start=start)
