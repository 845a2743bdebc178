"""Kinetostatics of many variants of one mechanism as one batch ``(variants, positions)``."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.lockstep import Lockstep
from mechgraph.closure.march import Status
from mechgraph.closure.path import Positions
from mechgraph.errors import DeclarationError
from mechgraph.force.analysis import Analysis
from mechgraph.force.blocks import Blocks
from mechgraph.force.found import Motions
from mechgraph.force.kinetostatics import CONTRADICTION, by_blocks, forces_of, solved_blocks
from mechgraph.force.run import Run
from mechgraph.model.load import Load
from mechgraph.model.motion import Motion
from mechgraph.numerics.memory import keep_freed_memory
from mechgraph.result.solution import Solution
from mechgraph.variants.fields import Variants

Mask = NDArray[np.bool_]
NumbersAt = Callable[[float], Variants]
"""Variants on the way from the mechanism itself (0) to the variants asked for (1)."""


class VariantRun(Run):
    """One call of ``solve`` for all variants: those that can be followed in step are, the others are left out (``alone``)."""

    def __init__(self, numbers_at: NumbersAt, motions: Mapping[str, Motion]) -> None:
        self.variants = numbers_at(1.0)
        super().__init__(self.variants.mechanism, motions)
        par = self.system.par
        self._numbers = numbers_at

        def lead(s: float) -> System:
            numbers = numbers_at(s).numbers
            made = numbers.parameters(self.m, par.offset, par.origin, par.L)
            # one array with all variants says how many there are
            return self.system.with_parameters(
                dataclasses.replace(made, mass=np.broadcast_to(made.mass, (len(self.m.links), self.variants.count)))
            )

        self._lead = lead
        self.batch = np.broadcast_shapes((self.variants.count, 1), self.batch)
        self.alone = ~self.variants.valid()

    @property
    def together(self) -> bool:
        """Whether the mechanism is one that can be followed in step: of few loops, its drivers independent."""
        return self.loops is None and not self.freedoms.dependent

    @property
    def loads(self) -> tuple[Load, ...]:
        """The loads that act, each with the numbers of every variant."""
        return self.variants.loads

    def positions(self) -> Positions:
        """All positions of the variants that stay in step."""
        lockstep = Lockstep(self._lead(1.0), self.columns, self.freedoms.hold)
        self._begin = lockstep.begin(self.x, self._lead, self.alone)
        self._begun = ~lockstep.front.lost
        self._systems = lockstep.system
        V, N = self.batch
        found = lockstep.follow(self.values("position").reshape(len(self.columns), V, N))
        self.alone = found.lost
        status = np.full((V, N), Status.OK, dtype=object)
        status[found.lost] = Status.NOT_CLOSED
        tracks = tuple((found.place_between, found.between[:, c], found.place) for c in range(V))
        last = self.values("position").reshape(-1, V, N)[..., -1]
        return Positions(found.x, status, found.choices, found.which, last, (), tracks)

    @property
    def starts(self) -> Array:
        """User coordinates ``(F, V)`` of the closed state where each variant begins, NaN where it is not beyond doubt."""
        q = self._systems.coordinates_of(self._begin[..., None], self.system.start_coordinates(self.m.start))[..., 0]
        return np.where(self._begun, q, np.nan)

    def evaluated(self, x: Array, at: Index) -> Configuration:
        """States evaluated with the numbers of their variants, closed to rounding."""
        return self._systems.with_parameters(self._systems.par.taken(at // self.batch[1])).at(x)

    def case(self, c: int) -> tuple[System, Array]:
        """System and start of one variant."""
        return self._systems.with_parameters(self._systems.par.taken(np.array([c]))), self._begin[:, c]


def solve_together(
    numbers_at: NumbersAt, motions: Mapping[str, Motion], method: str, redundant: str
) -> tuple[Solution | None, Mask, Array | None]:
    """The solution of all variants that can be followed in step (NaN for the others), which are to be solved alone, and from where.

    A variant is to be solved alone where it cannot be built, falls out of step, or has a position that is not regular; from the
    coordinates ``(F, V)`` where it begins, where these are known (not NaN).
    """
    keep_freed_memory()
    run = VariantRun(numbers_at, motions)
    everyone = np.ones(run.variants.count, dtype=bool)
    if not run.together or run.alone.all():
        return None, everyone, None
    solve = _in_blocks if by_blocks(run, (method, redundant)) else _in_one
    try:
        return *solve(run, method, redundant), run.starts
    except DeclarationError:
        return None, everyone, None


def _in_blocks(run: VariantRun, method: str, redundant: str) -> tuple[Solution, Mask]:
    found = run.found()
    status, good = run.outcomes(found)
    alone = run.alone.copy()
    parts, places = [], []
    for part, at in solved_blocks(run, found, status, good, (method, redundant)):
        alone[at[part.motions.rates.contradiction > CONTRADICTION] // run.batch[1]] = True
        parts.append(part)
        places.append(at)
    alone |= (status != Status.OK.value).any(axis=1)
    status[alone] = Status.NOT_CLOSED.value
    return Solution(Blocks(parts, places, run.batch, status, run.t)), alone


def _in_one(run: VariantRun, method: str, redundant: str) -> tuple[Solution, Mask]:
    moved, solver, _ = run.move()
    alone = run.alone | (moved.status != Status.OK.value).any(axis=1)
    against = moved.rates.contradiction > CONTRADICTION
    alone[moved.good[against] // run.batch[1]] = True
    moved = _marked(moved, alone)
    bare = Analysis(moved, None)
    forces = forces_of(run, moved, solver, bare.user_coordinates, method, redundant)
    return Solution(Analysis(moved, forces)), alone


def _marked(moved: Motions, alone: Mask) -> Motions:
    status = moved.status.copy()
    status[alone] = Status.NOT_CLOSED.value
    return dataclasses.replace(moved, status=status)
