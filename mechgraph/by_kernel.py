"""The compiled kernel in the pipeline: positions, rates and forces from its records, where it carries the mechanism and the call.

What it refuses (a step that is not certified, a poor condition, drives that contradict each other) is left to the careful follower of
numpy, with all that it says of such positions.
"""

from __future__ import annotations

from functools import partial
from operator import is_not
from typing import Any, Literal, Protocol

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.call import Call, Starts
from mechgraph.closure.configuration import ROUNDINGS, Configuration
from mechgraph.closure.driver_path import Mask, in_blocks
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.passive_motion import are_alone
from mechgraph.closure.rates import Rates, Velocities, expected_error
from mechgraph.closure.solver import ClosureSolver
from mechgraph.errors import DeclarationError
from mechgraph.kernel import build
from mechgraph.kernel.path import Kernel, Records
from mechgraph.kernel.tables import Layout, layout, tables, why_not
from mechgraph.model.contact import Contact
from mechgraph.model.load_base import Load
from mechgraph.numerics.newton import Work
from mechgraph.outcome import Outcome, system_at
from mechgraph.result.kept import BlockMotion

COMPILED: Literal["compiled"] = "compiled"
"""Name of the engine."""
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


class Compiled(Outcome):
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
            self.trajectory.take(records, forces)
        else:
            by_position = all(load.by_position for load in self.loads)
            every = np.flatnonzero(~self.contradicting)
            for places in in_blocks(every) if by_position else [every]:
                self._put(*self._at(places))
        if line.options.progress is not None:
            line.options.progress(count, count)

    def _at(self, places: Index) -> tuple[BlockMotion, Any]:
        """States and rates of a block, and the closure equations there, factored by numpy."""
        x, dq, ddq = (self.records[name][:, places] for name in ("x", "dq", "ddq"))
        here = Configuration(self._system_at(places), np.ascontiguousarray(x))
        f = self.solver.factored(here, self.solver.chosen(here, np.full(here.T, -1)))
        return BlockMotion(places, Rates(Velocities(here, dq), ddq, np.zeros(here.T))), f


def compiled(line: Started, batch: tuple[int, ...], starts: Starts | None = None) -> Compiled | None:
    """All positions of a call, or of all its variants, by the kernel; None where it does not serve: no library, or no certificate.

    Raises
    ------
    DeclarationError
        where the kernel was asked for by name and cannot carry the mechanism or the call; MissingExtraError without a compiler.
    """
    asked = line.options.engine == COMPILED
    if line.options.engine != "auto" and not asked:
        return None
    library = build.built() if asked else at_hand()
    if library is None:
        return None
    if (why := cannot(line)) is not None:
        if asked:
            text = f"engine 'compiled' does not serve: {why}. Use engine='auto'"
            raise DeclarationError(f"solve {line.m.name!r}", [text])
        return None
    if starts is None:
        kernel, forces = _kernel(line, library)
        x, starts = line.x[:, None], Starts(line.x[:, None], line.system.cases, line.m.loads)
    else:
        x = np.tile(starts.x, starts.sharing)
        kernel, forces = _filled(line, library, starts.system_of(np.arange(x.shape[1])), x, starts.loads)
    q, v, a = (np.ascontiguousarray(line.values(kind, batch).T) for kind in ("position", "velocity", "acceleration"))
    begin = x[line.system.single_rows[line.columns]]
    records, whole = kernel.follow(begin, q, v, a, batch, forces)
    return Compiled(line, starts, batch, records, whole, forces) if whole.mean() > SERVES else None


def _kernel(line: Started, library: Any) -> tuple[Kernel, bool]:
    """The tables of a call with the library, and whether they give its forces; those of the last call are kept with the start.

    The start may be shared with mechanisms under other loads.
    """
    key, kept = (line.columns.tobytes(), gives_forces(line), _passive(line)), line.start.solvers
    known = kept.get(COMPILED)
    loads = line.m.loads
    if known is None or known[0] != key or len(known[1]) != len(loads) or any(map(is_not, known[1], loads)):
        kept[COMPILED] = known = key, loads, _filled(line, library, line.system, line.x[:, None], loads)
    found: tuple[Kernel, bool] = known[2]
    return found


def _filled(line: Started, library: Any, system: System, x: Array, loads: tuple[Load, ...]) -> tuple[Kernel, bool]:
    """The tables of all variants at their starts ``x (nx, B)`` with the library, and whether they give the forces."""
    found = _layout(line)
    assert isinstance(found, Layout)
    filled = tables(found, system, x, loads) if gives_forces(line) else None
    forces = filled is not None
    filled = filled or tables(found, system, x, None)
    assert filled is not None
    return Kernel(library, found, *filled), forces


def _layout(line: Started) -> Layout | str:
    """The layout of a mechanism, or what of it cannot be carried; kept with all mechanisms of its graph."""
    sized = line.system.sized_once
    key = COMPILED, line.columns.tobytes(), _passive(line)
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
    """Whether the kernel gives the forces that are asked for; it knows no line along which gears touch each other."""
    return (
        line.options.method == "loop_wrench"
        and line.acting is line.columns
        and not any(isinstance(c, Contact) for c in line.m.couplings)
    )
