"""The closure equations ``J q = b`` with some columns fixed, linear, for a batch of positions: one protocol, two engines behind it.

A *form* is what is decided once and serves many positions: which rows are independent and which columns are held (dense), or the
borders that make the matrix square (sparse). Positions name their form by its number.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.dense_solver import DenseSolver
from mechgraph.closure.indexing import Index
from mechgraph.closure.sparse_solver import SparseSolver

EngineName = Literal["auto", "dense", "sparse"]
ENGINES: tuple[EngineName, ...] = ("auto", "dense", "sparse")
MotionEngineName = Literal["auto", "compiled", "dense", "sparse"]
"""Engines of calls that follow a motion; what is at hand where ``compiled`` serves is the numpy engine that ``auto`` takes."""
SPARSE_ROWS = {1.0: 120, 20.0: 84, 50.0: 60, 400.0: 42, np.inf: 36}
"""Closure rows from which on ``auto`` takes the sparse engine, for up to so many positions.

Measured by ``tests/benchmarks/bench_large.py --crossover`` on ladders of four-bars: both engines take the same time at 110 rows (one
position), 80 (16 positions), 62 (36), 36 (200) and 24 (1000), where the sparse one goes group by group. A platform on six legs (30 rows,
one group) takes a quarter more with the sparse one at 1000 positions, so that this many rows stay with the dense one.
"""


class FactoredClosure(Protocol):
    """The closure equations at a batch of positions, factored. ``m`` rows, ``F`` freedoms, ``T`` positions."""

    which: Index
    complete: bool
    """Whether ``self_stresses`` is a basis of all self-stresses; otherwise it holds random ones that represent them."""
    groups: int
    """Number of groups that are solved one after the other; 0 where all equations are factored as a whole."""

    @property
    def condition(self) -> Array:
        """Condition numbers ``(T,)``."""

    def solve(self, b: Array) -> Array:
        """``q (F, k, T)`` with ``J q = b (m, k, T)``, zero in fixed and held columns."""

    def solve_transposed(self, b: Array) -> Array:
        """``x (m, k, T)`` with ``J^T x = b (F, k, T)`` in the columns neither fixed nor held."""

    def residual_size(self, r: Array) -> Array:
        """Largest entry ``(T,)`` of residuals ``(m, T)``, displacements over the sizes of their loops."""

    def sensitivity(self) -> Array:
        """Rates ``Z (F, d, T)`` of all freedoms for unit rates of the fixed ones."""

    def motions(self) -> Array:
        """Motions ``(F, p, T)`` with the fixed columns at rest: one a held motion."""

    def self_stresses(self, every: bool = False) -> Array:
        """Multipliers ``(m, s, T)`` with ``J^T x = 0`` in the columns not fixed: a basis if ``complete`` or ``every``, or random."""

    def regular_between(self, ends: Configuration, a: Index, b: Index) -> NDArray[np.bool_]:
        """Whether no matrix on the parabola through those at ``ends`` ``a (T,)``, here and at ``b`` is singular or nearly so, ``(T,)``."""

    def part(self, at: Index, here: Configuration) -> FactoredClosure:
        """Some of the positions, evaluated in ``here``."""

    def least(self, R: Sequence[scipy.sparse.csr_array], r0: Array) -> Array:
        """Multipliers ``x (m, T)`` with ``J^T x = 0`` that make ``|r0 + R x|`` least; ``R[t] (n, m)``, ``r0 (n, T)``.

        Only asked for where ``self_stresses`` are not complete.
        """

    def by_held(self) -> list[tuple[Index, Index]]:
        """Freedoms that are held (beside the fixed ones), and the positions at which they are."""


class ClosureSolver(Protocol):
    """The closure equations of one mechanism with the columns ``fixed``; makes and keeps forms."""

    fixed: Index
    engine: str

    def chosen(self, here: Configuration, which: Index) -> Index:
        """Forms ``(T,)`` for positions: ``which`` where these are good enough, new ones where they are not (or are -1)."""

    def factored(self, here: Configuration, which: Index) -> FactoredClosure:
        """The equations at positions, each in its form."""

    def leaves_nothing_free(self, here: Configuration) -> bool:
        """Whether the factors at a position prove that the fixed columns determine all others; False proves nothing."""

    def begun(self, here: Configuration) -> ClosureSolver:
        """A solver that goes on from here with the forms of this one, which was last asked at the same state."""

    def corrigible(self, dq: Array, which: Index) -> Array:
        """Increments ``(F, T)`` without the motions that are held: no correction can remove what a prediction adds to them."""


def engine_for(rows: int, positions: int, engine: str) -> Literal["dense", "sparse"]:
    """The engine that runs: the one asked for, or the one that is faster for the size."""
    if engine in ENGINES[1:]:
        return "dense" if engine == "dense" else "sparse"
    limit = next(limit for most, limit in SPARSE_ROWS.items() if positions <= most)
    return "sparse" if rows >= limit else "dense"


def solver_at_start(
    engine: Literal["dense", "sparse"], fixed: Index, start: Configuration
) -> tuple[ClosureSolver, bool]:
    """The solver with the columns ``fixed``, and whether it proves at a start that they leave nothing free.

    What was chosen and factored there is kept with the start, for the next call with the same columns.
    """
    key = engine, fixed.tobytes()
    found = start.solvers.get(key)
    if found is None:
        solver = closure_solver(engine, fixed)
        proved = solver.leaves_nothing_free(start)
        start.solvers.clear()  # other threads may ask for what is kept here
        found = start.solvers[key] = solver.begun(start), proved
    solver, proved = found
    return solver.begun(start), proved


def closure_solver(engine: Literal["dense", "sparse"], fixed: Index, keep: Index | None = None) -> ClosureSolver:
    """The solver with the columns ``fixed``; freedoms ``keep`` are preferably held where motions are left free."""
    return DenseSolver(fixed, keep) if engine == "dense" else SparseSolver(fixed, keep)
