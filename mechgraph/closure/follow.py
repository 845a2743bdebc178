"""Positions and rates of a large mechanism: followed from position to position, one sparse factorization at each.

Every position of the path is a node. From node to node a second-order predictor, Newton with the factors of the last node, a new
factorization where it slows down, and half the step where the correction is too large. A position where the signs of the pivots
change against the last one, both about the same bordering, lies behind a dead point.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import state_rows
from mechgraph.closure.bordering import LoopSystem
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.march import (
    ACCEPTED,
    AIM,
    CONVERGED,
    CORRECTION,
    ITERATIONS,
    LONGEST_STEP,
    SHORTEST_STEP,
    Status,
)
from mechgraph.closure.path import GAPS
from mechgraph.closure.rates import Rates, Velocities
from mechgraph.numerics.sparse import SparseFactor

SLOW = 0.1
"""Part of the closure residual that may remain after a Newton step before the factors are renewed."""
PROBES = 6
"""Random self-stresses that stand for all of them at every position."""
SEED = 5


@dataclass(frozen=True)
class SparseNode:
    """A closed position: state ``(nx,)``, driver values, sensitivity ``Z (F, drivers)``, bordering and factors."""

    x: Array
    drive: Array
    Z: Array
    loops: LoopSystem
    factor: SparseFactor


class SparseSolver:
    """The closure equations of a batch of positions, each with its own factors; speaks like ``numerics.linear.ChosenSystem``."""

    def __init__(self, here: Configuration, nodes: list[SparseNode]) -> None:
        self.here, self.nodes = here, nodes

    def solve(self, b: Array) -> Array:
        """``q (F, T)`` with ``J q = b (6 loops, T)`` in the rows chosen, zero in the driven columns."""
        found = [node.loops.solve(node.factor, b[:, t : t + 1]) for t, node in enumerate(self.nodes)]
        return np.concatenate(found, axis=1) if found else np.empty((self.here.system.n_freedoms, 0))

    def solve_transposed(self, b: Array) -> Array:
        """``x (6 loops, k, T)`` with ``J^T x = b (F, k, T)`` in the free columns."""
        out = np.zeros((6 * len(self.here.system.graph.loops), b.shape[1], len(self.nodes)))
        for t, node in enumerate(self.nodes):
            out[:, :, t] = _loop_rows(node.loops.solve_transposed(node.factor, b[:, :, t]))
        return out

    def null_of_transpose(self) -> Array:
        """Random self-stresses ``(6 loops, probes, T)`` that stand for all of them; none where there is no redundancy."""
        count = PROBES if any(node.loops.redundant for node in self.nodes) else 0
        out = np.zeros((6 * len(self.here.system.graph.loops), count, len(self.nodes)))
        for t, node in enumerate(self.nodes if count else []):
            rng = np.random.default_rng(SEED)
            out[:, :, t] = _loop_rows(node.loops.random_stress(node.factor, self.here.S[:, :, t], rng, count))
        return out


def _loop_rows(x: Array) -> Array:
    """Loop wrenches ``(6, loops, k)`` as rows ``(6 loops, k)``."""
    return np.moveaxis(x, 0, 1).reshape(6 * x.shape[1], x.shape[2])


def sparse_rates(
    here: Configuration, solver: SparseSolver, columns: Index, velocity: Array, acceleration: Array
) -> Rates:
    """Rates for driver velocities and accelerations ``(d, T)``: ``J q' = 0`` and ``J q'' = -bias``, the driven part known."""
    dq, gap_v = _completed(here, solver, columns, velocity, np.zeros((1, here.T)))
    moving = Velocities(here, dq)
    turning = (dq * dq).max(axis=0, initial=0.0)
    ddq, gap_a = _completed(here, solver, columns, acceleration, here.loop_sums(moving.bias), turning)
    return Rates(moving, ddq, np.maximum(gap_v, gap_a))


def _completed(
    here: Configuration, solver: SparseSolver, columns: Index, driven: Array, known: Array, size: Array | float = 0.0
) -> tuple[Array, Array]:
    """Rates ``q (F, T)`` with ``J q = -known``, and the part of all rows that they leave open, relative to the terms ``(T,)``."""
    given = np.zeros((here.system.n_freedoms, here.T))
    given[columns] = driven
    if not driven.any() and not known.any():
        return given, np.zeros(here.T)
    q = solver.solve(-here.loop_sums(here.pair_sums(here.S * given)) - known)
    q[columns] = driven
    left = np.abs(here.loop_sums(here.pair_sums(here.S * q)) + known).max(axis=0, initial=0.0)
    scale = np.abs(q).max(axis=0, initial=0.0) + np.abs(known).max(axis=0, initial=0.0) + size
    return q, left / np.where(scale > 0, scale, 1.0)


class SparseFollower:
    """Follows driver values from a closed state; ``columns`` are the driven freedoms, ``loops`` the bordering at the start."""

    def __init__(self, system: System, columns: Index, loops: LoopSystem) -> None:
        self.system, self.columns, self.loops = system, columns, loops
        self.rows = state_rows(system, columns)

    def follow(self, start: Configuration, values: Array) -> tuple[list[SparseNode | None], list[Status], Array]:
        """Nodes from a closed start at driver values ``(d, N)``, None where not reached and why, and where it first ended.

        As in ``closure.path``: behind what cannot be passed the path goes on at the next position on this side of it, and where the
        first position cannot be reached the path is entered at the one nearest to the start and followed both ways.
        """
        first = self._node(start, self.loops, self.loops.first)
        found = self._along(first, values)
        if values.shape[1] == 1 or any(node is not None for node in found[0]):
            return found
        near = int(np.argmin(((values - first.drive[:, None]) ** 2).sum(axis=0)))
        ahead, behind = self._along(first, values[:, near:]), self._along(first, values[:, near::-1])
        if all(node is None for node in ahead[0]):
            return found
        return behind[0][:0:-1] + ahead[0], behind[1][:0:-1] + ahead[1], found[2]

    def _along(self, first: SparseNode, values: Array) -> tuple[list[SparseNode | None], list[Status], Array]:
        nodes: list[SparseNode | None] = []
        why: list[Status] = []
        solved, reached = first, None
        N = values.shape[1]
        for _ in range(GAPS):
            at, before = solved, None
            while len(nodes) < N:
                at, before, end = self._reached(at, before, values[:, len(nodes)])
                if end is not Status.OK:
                    break
                solved = at
                nodes.append(at)
                why.append(end)
            if len(nodes) == N:
                break
            reached = at.drive if reached is None else reached
            beyond = values[:, len(nodes) :] - at.drive[:, None]
            back = np.flatnonzero((beyond * beyond[:, :1]).sum(axis=0) < 0)
            gap = int(back[0]) if back.size else beyond.shape[1]
            nodes += [None] * gap
            why += [Status.BEYOND_DEAD_POINT if end is Status.DEAD_POINT else end] * gap
        left = N - len(nodes)
        nodes, why = nodes + [None] * left, why + [Status.OUT_OF_REACH] * left
        return nodes, why, solved.drive if reached is None else reached

    def _reached(
        self, last: SparseNode, before: SparseNode | None, goal: Array
    ) -> tuple[SparseNode, SparseNode | None, Status]:
        """The node at driver values ``goal``, or the last one on the way there and why it ends; also the node before it."""
        failures: list[Status] = []
        step = LONGEST_STEP
        while True:
            way = goal - last.drive
            length = float(np.linalg.norm(way))
            part = min(1.0, step / length) if length > 0 else 1.0
            following, correction, why = self._step(last, before, last.drive + part * way, part == 1.0)
            if following is None:
                failures.append(why)
                step = 0.5 * part * length
                if step < SHORTEST_STEP:
                    dead = failures.count(Status.DEAD_POINT)
                    return last, before, Status.DEAD_POINT if 2 * dead > len(failures) else Status.OUT_OF_REACH
                continue
            if part == 1.0:
                return following, last, Status.OK
            failures.clear()
            step = min(LONGEST_STEP, part * length * min(2.0, max(0.5, (AIM / max(correction, 1e-9)) ** (1 / 3))))
            step = max(step, 10 * SHORTEST_STEP)
            before, last = last, following

    def _node(self, here: Configuration, loops: LoopSystem, factor: SparseFactor) -> SparseNode:
        S = here.S[:, :, 0]
        known = np.zeros((self.system.n_freedoms, len(self.columns)))
        known[self.columns, np.arange(len(self.columns))] = 1.0
        moved = here.loop_sums(here.pair_sums(S[:, :, None] * known))
        Z = loops.solve(factor, -moved)
        Z[self.columns] = known[self.columns]
        return SparseNode(here.x[:, 0], here.x[self.rows, 0].copy(), Z, loops, factor)

    def _step(
        self, last: SparseNode, before: SparseNode | None, drive: Array, exact: bool
    ) -> tuple[SparseNode | None, float, Status]:
        """A node at driver values ``drive``, the largest correction of the prediction, and why there is none."""
        change = drive - last.drive
        if not change.any() and exact:
            return last, 0.0, Status.OK
        dq = last.Z @ change
        if before is not None:
            was = last.drive - before.drive
            ratio = float(np.linalg.norm(change)) / max(float(np.linalg.norm(was)), 1e-300)
            if ratio < 4 and change @ was > 0:
                dq = dq + 0.5 * ratio * (last.Z - before.Z) @ change
        x = self.system.advance(last.x[:, None], dq[:, None])
        x[self.rows, 0] = drive
        here, correction = self._corrected(x, last)
        if here is None or correction > CORRECTION:
            return None, correction, Status.OUT_OF_REACH
        loops, factor = last.loops, last.loops.factor(here.S[:, :, 0])
        if not factor.same_side(last.factor) or not factor.smallest_pivot > loops.pivot_limit:
            loops = LoopSystem.at(here, self.columns)
            if not loops.regular or loops.held:
                return None, correction, Status.DEAD_POINT
            again = loops.factor(self.system.at(last.x[:, None]).S[:, :, 0])
            if not again.same_side(loops.first):
                return None, correction, Status.DEAD_POINT
            factor = loops.first
        last_step = loops.solve(factor, -here.residual)
        here = self.system.at(self.system.advance(here.x, last_step))
        return self._node(here, loops, factor), correction, Status.OK

    def _corrected(self, x: Array, last: SparseNode) -> tuple[Configuration | None, float]:
        """The state closed by Newton with the factors of the last node, and the largest sum of its corrections."""
        factor, total = last.factor, np.zeros((self.system.n_freedoms, 1))
        here = self.system.at(x)
        left = float(np.abs(here.residual).max(initial=0.0))
        for _ in range(2 * ITERATIONS):
            if left <= CONVERGED:
                break
            step = last.loops.solve(factor, -here.residual)
            if not np.isfinite(step).all():
                return None, np.inf
            total += step
            if np.abs(total).max(initial=0.0) > 4 * CORRECTION:
                return None, float(np.abs(total).max())
            here = self.system.at(self.system.advance(here.x, step))
            was, left = left, float(np.abs(here.residual).max(initial=0.0))
            if left > SLOW * was:
                if left <= ACCEPTED and left > 0.5 * was:
                    break
                factor = last.loops.factor(here.S[:, :, 0])
        return (here if left <= ACCEPTED else None), float(np.abs(total).max(initial=0.0))
