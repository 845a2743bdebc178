"""The compiled kernel in the pipeline: positions, rates and forces from its records, where it carries the mechanism and the call.

What it refuses (a step that is not certified, a poor condition, drives that contradict each other) is left to the careful follower of
numpy, with all that it says of such positions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from operator import is_not
from typing import Any, Literal, Protocol

import numpy as np

from mechgraph.kernel import build
from mechgraph.kernel.tables import HEAD_RUBS, MIDDLE, START, Kernel, Layout, Mask, Records, layout, tables, why_not
from mechgraph.kinematics.motion_path import in_blocks
from mechgraph.kinematics.rates import Rates, Velocities, are_alone, expected_error
from mechgraph.kinematics.state import ROUNDINGS, ClosureSolver, Configuration
from mechgraph.kinematics.system import System
from mechgraph.maths.newton import Work
from mechgraph.maths.se3 import Array, Index
from mechgraph.memo import dataclass
from mechgraph.model.belts import pretensions
from mechgraph.model.friction import places_in, rubbing_loads
from mechgraph.model.loads import Load
from mechgraph.outcome import Call, Outcome, Starts, system_at
from mechgraph.result.trajectory import BlockMotion

COMPILED: Literal["compiled"] = "compiled"
"""Name of the engine."""
SystemAt = Callable[[Array, Index], tuple[System, Mask]]
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

    def lead(self, valid: Mask, system_at: SystemAt) -> Array:
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

    def _on_the_way(self, system_at: SystemAt, part: Array, which: Index) -> tuple[Array, Mask]:
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
    return Kernel(library, found.rubbing(int(filled[0][HEAD_RUBS])), *filled), forces


def served_before(line: Started) -> bool:
    """Whether a mechanism of the graph, with the same drives and no passive freedoms, has the tables of the kernel, and it is asked for."""
    return line.options.engine in ("auto", COMPILED) and isinstance(line.system.sized_once.get(_key(line)), Layout)


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
