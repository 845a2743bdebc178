"""Large mechanisms: the same kinetostatics through one sparse factorization a position, nothing dense over all links.

What is not unique is found with a few random self-stresses of every position in place of all of them: a component in which none of
them has a part is unique (a random one of the others would have to miss it by chance). Their size is one in the measure of each
loop, so that the verdict does not depend on how many loops there are.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import CLOSED
from mechgraph.closure.bordering import LoopSystem
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.follow import SparseFollower, SparseNode, SparseSolver, sparse_rates
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.march import Status
from mechgraph.closure.rates import DEAD_POINT, Rates
from mechgraph.errors import MechgraphError
from mechgraph.force.analysis import Analysis
from mechgraph.force.found import Motions
from mechgraph.force.least import least_change
from mechgraph.structure.reaction_split import PairFrames, Stress, pair_power, reaction_part, split_stress

SPARSE_ROWS = 300
"""Rows of the closure Jacobian (six a loop) from which on a mechanism is solved sparsely.

Measured by ``tests/benchmarks/bench_large.py --crossover`` on ladders of four-bars: with 100 positions both take the same time at about
300 rows, with one position at 30.
"""
DENSE_ROWS = 12_000
"""Rows of the closure Jacobian above which dense matrices are refused (one would take gigabytes)."""
DOUBTFUL = 1e3
"""Largest rate per unit rate of a driver from which on the distance to a dead point is looked at."""


@dataclass(frozen=True)
class Given:
    """Motion of the drivers: batch shape, times, and positions, velocities, accelerations ``(d, T)`` in internal units."""

    batch: tuple[int, ...]
    t: Any
    position: Array
    velocity: Array
    acceleration: Array


def certified_loops(here: Configuration, columns: Index) -> LoopSystem | None:
    """The bordered closure equations at the start of a large mechanism whose drivers prove to leave nothing free; None for all others.

    Small mechanisms, passive freedoms, freedoms left free, dependent drivers and singular positions are for the dense path.
    """
    if 6 * len(here.system.graph.loops) < SPARSE_ROWS:
        return None
    loops = LoopSystem.at(here, columns)
    if not loops.regular or loops.held:
        return None
    return loops


def refuse_dense(system: System) -> None:
    """Say honestly that a mechanism is too large for dense matrices where the sparse path could not prove it determinate.

    Raises
    ------
    MechgraphError
    """
    rows = 6 * len(system.graph.loops)
    if rows > DENSE_ROWS:
        raise MechgraphError(
            f"mechanism {system.m.name!r}: {rows} closure equations that leave passive freedoms, are singular at the first position, or "
            f"have drivers that depend on each other; such mechanisms are solved with dense matrices, up to {DENSE_ROWS} equations. "
            "mg.check tells which it is; hold passive freedoms by other pairs, or start elsewhere"
        )


def move_sparse(
    start: Configuration, columns: Index, loops: LoopSystem, given: Given
) -> tuple[Motions, SparseSolver, Array]:
    """Positions and rates from a closed start for the motion of the drivers, their factors, and the last driver values ``(d, cases)``."""
    system = start.system
    N = given.batch[-1] if given.batch else 1
    paths = given.position.reshape(len(columns), -1, N)
    status = np.full(paths.shape[1:], Status.OK.value, dtype="U24")
    nodes: list[SparseNode] = []
    last = np.empty((len(columns), paths.shape[1]))
    for case in range(paths.shape[1]):
        found, ends, last[:, case] = SparseFollower(system, columns, loops).follow(start, paths[:, case])
        nodes += [node for node in found if node is not None]
        status[case] = [why.value for why in ends]
    good = np.flatnonzero(status.reshape(-1) == Status.OK.value)
    states = np.stack([node.x for node in nodes], axis=1) if nodes else np.empty((system.n_state, 0))
    here = start if np.array_equal(states, start.x) else system.at(states)
    solver = SparseSolver(here, nodes)
    flags = np.full(good.size, Status.OK.value, dtype="U24")
    flags[_dead(here, solver, columns)] = Status.DEAD_POINT.value
    flags[here.closure > CLOSED] = Status.NOT_CLOSED.value
    sound = flags == Status.OK.value
    status.reshape(-1)[good] = flags
    if not sound.all():
        good, here = good[sound], system.at(states[:, sound])
        solver = SparseSolver(here, [node for node, ok in zip(nodes, sound, strict=True) if ok])
    moved: Rates = sparse_rates(here, solver, columns, given.velocity[:, good], given.acceleration[:, good])
    nothing = np.zeros(0, dtype=np.intp)
    which = np.zeros(good.size, dtype=np.intp)
    motions = Motions(here, moved, given.batch, good, status.reshape(given.batch), given.t, columns, (nothing,), which)
    return motions, solver, last


def _dead(here: Configuration, solver: SparseSolver, columns: Index) -> Array:
    """Positions so near to a dead point that their rates would be noise: rates grow as ``|s* - s|^-1/2`` there."""
    out = np.zeros(here.T, dtype=bool)
    for t, node in enumerate(solver.nodes):
        size = np.abs(node.Z).max(axis=0, initial=0.0)
        if (size <= DOUBTFUL).all():
            continue
        one = here.system.at(here.x[:, t : t + 1])
        for i in range(len(columns)):
            unit = np.zeros((len(columns), 1))
            unit[i] = 1.0
            moved = sparse_rates(one, SparseSolver(one, [node]), columns, unit, 0 * unit)
            grown = max(float(np.abs(moved.ddq).max()), 1e-300)
            out[t] |= not 0.5 * float(np.abs(moved.dq).max()) / grown > DEAD_POINT
    return out


class SparseAnalysis(Analysis):
    """The values of a Solution of a large mechanism: self-stresses by random ones, numbers of one pair at a time."""

    @cached_property
    def _stress(self) -> Stress:
        return split_stress(self._here, self._need_forces().wrenches.stress, self.motions.driven)

    @cached_property
    def _solved(self) -> tuple[Array, Array]:
        """Reactions ``(6, P, T)`` and efforts ``(F, T)``: of minimum norm where that was asked for, else of any norm where redundant."""
        here, forces = self._here, self._need_forces()
        totals = forces.wrenches.totals
        efforts = pair_power(here, totals)
        reactions = reaction_part(here, totals, efforts)
        solver = forces.solver
        if forces.mask_redundant or not isinstance(solver, SparseSolver) or not self._stress.wrenches.shape[2]:
            return reactions, efforts
        change = np.empty((6 * len(self._system.graph.loops), 1, here.T))
        for t, node in enumerate(solver.nodes):
            one = here if here.T == 1 else self._system.at(here.x[:, t : t + 1])
            change[:, 0, t] = least_change(one, node, reactions[:, :, t])
        totals = totals + here.pair_wrenches(change)[:, :, 0]
        efforts = pair_power(here, totals)
        return reaction_part(here, totals, efforts), efforts

    def components(self, pair: int) -> dict[str, Array]:
        """Reaction components by name, of this pair alone."""
        number, i = self._system.place_of(pair)
        row = self._system.groups[number].row
        frames = PairFrames(self._here)
        value = frames.components_of(number, i, self._solved[0][:, pair])
        state = frames.components_of(number, i, self._stress.wrenches[:, pair])
        couples = [c.is_couple for c in row.reactions or ()] or [False] * (6 - row.f)
        unit = np.where(couples, self._L**2, self._L)[:, None]
        masked = self._masked(unit * value, state)
        return {name: self._out(part) for name, part in zip(row.component_names, masked, strict=True)}
