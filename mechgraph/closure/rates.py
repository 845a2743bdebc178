"""Velocities and accelerations of closed positions: one linear solve each, for all positions together."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index
from mechgraph.closure.passive_motion import PassiveMotion, PassiveMotions
from mechgraph.closure.solver import ClosureSolver, FactoredClosure
from mechgraph.numerics.tolerances import PATH


class Velocities:
    """Rates of all freedoms ``dq (F, T)`` at closed positions, and what follows from them."""

    def __init__(self, here: Configuration, dq: Array) -> None:
        self.here, self.dq = here, dq

    @cached_property
    def V(self) -> Array:
        """Twists of all links ``(6, N, T)``."""
        return self.here.link_twists(self.dq)

    @cached_property
    def bias(self) -> Array:
        """Velocity part of the relative accelerations of all pairs ``(6, P, T)``."""
        return self.here.bias(self.dq, self.V)


class Rates(Velocities):
    """Rates of all freedoms ``dq, ddq (F, T)``, twists ``V`` and accelerations ``A`` of all links ``(6, N, T)``.

    ``contradiction (T,)`` is the largest part of the closure rates that no choice of the free rates can meet, relative to the
    terms of the equation.
    """

    def __init__(self, velocities: Velocities, ddq: Array, contradiction: Array) -> None:
        vars(self).update(vars(velocities))  # with what is known of V and bias
        self.ddq, self.contradiction = ddq, contradiction

    @cached_property
    def A(self) -> Array:
        """Accelerations dV/dt of all links ``(6, N, T)``."""
        return self.here.accelerations_with(self.ddq, self.bias)

    def repeated(self, here: Configuration, count: int) -> Rates:
        """The same ``count`` times, at the states ``here``."""
        velocities = Velocities(here, np.tile(self.dq, count))
        velocities.V, velocities.bias = np.tile(self.V, count), np.tile(self.bias, count)
        out = Rates(velocities, np.tile(self.ddq, count), np.tile(self.contradiction, count))
        out.A = np.tile(self.A, count)
        return out


def rates(
    here: Configuration,
    solver: FactoredClosure,
    columns: Index,
    velocity: Array,
    acceleration: Array,
    passive: tuple[PassiveMotion, ...] = (),
) -> Rates:
    """Rates for driver velocities and accelerations ``(d, T)``.

    ``J q' = 0`` and ``J q'' = -bias``, the driven part known; ``passive`` motions at rest (see ``closure.passive_motion``).
    """
    dq, gap_v = _completed(here, solver, columns, velocity, None)
    moving = Velocities(here, dq)
    rest = PassiveMotions(here, passive, solver.motions()) if passive else None
    if rest is not None:
        moving = Velocities(here, dq + rest.at_rest(moving.V))
    turning = (moving.dq * moving.dq).max(axis=0, initial=0.0)
    ddq, gap_a = _completed(here, solver, columns, acceleration, here.closure_bias(moving.bias), turning)
    moved = Rates(moving, ddq, np.maximum(gap_v, gap_a))
    if rest is not None:
        more = rest.still_at_rest(solver, moved.dq, moved.V, moved.bias, moved.A)
        moved = Rates(moving, ddq + more, moved.contradiction)
    return moved


def distance_to_dead_point(here: Configuration, solver: FactoredClosure, columns: Index) -> Array:
    """How far, in driver coordinates, each position is from a dead point, ``(T,)``.

    Near a dead point at ``s*`` the rates per unit of driver motion grow as ``|s* - s|^-1/2``, so that the distance is half of rate
    over rate of the rate; the smallest over the drivers.
    """
    out = np.full(here.T, np.inf)
    nothing = np.zeros((len(columns), here.T))
    for i in range(len(columns)):
        one = nothing.copy()
        one[i] = 1.0
        moved = rates(here, solver, columns, one, nothing)
        grown = np.abs(moved.ddq).max(axis=0, initial=0.0)
        out = np.minimum(out, 0.5 * np.abs(moved.dq).max(axis=0, initial=0.0) / np.maximum(grown, 1e-300))
    return out


def at_dead_points(
    here: Configuration, factored: FactoredClosure, solver: ClosureSolver
) -> tuple[NDArray[np.bool_], Array]:
    """Which positions are so near to a singular one of the drivers that their rates would be noise, and the ``accuracy (T,)`` of all."""
    condition = factored.condition
    dead, out = np.asarray(condition > PATH.singular), accuracy(here, condition)
    poor = np.flatnonzero((condition > PATH.poor) & ~dead)
    if poor.size:
        few = here.part(poor)
        f = factored.part(poor, few)
        scatter = _scatter(few, f, solver)
        out[poor] = few.rounding * np.maximum(condition[poor], scatter / PATH.rounding)
        near = np.full(poor.size, np.inf)
        doubtful = np.flatnonzero(condition[poor] > PATH.doubtful)
        if doubtful.size:
            fewer = few.part(doubtful)
            near[doubtful] = distance_to_dead_point(fewer, f.part(doubtful, fewer), solver.fixed)
            dead[poor] = ~(near > PATH.dead_point) | ((scatter > PATH.scatter) & (condition[poor] > PATH.doubtful))
    return dead, out


def accuracy(here: Configuration, condition: Array) -> Array:
    """See ``expected_error``, at the states of a configuration."""
    return expected_error(here.rounding, condition)


def expected_error(rounding: Array, condition: Array) -> Array:
    """Estimated relative error ``(T,)`` of rates and forces at states of fair condition, whose residuals have a ``rounding (T,)``.

    Rounding of the residual moves a state by condition times as much, which changes rates, solved with a matrix that is moved, by
    condition times that again, and accelerations, solved from these rates, once more.
    """
    grown = np.maximum(condition / PATH.square, 1.0) * np.maximum(condition / PATH.cube, 1.0)
    return np.asarray(rounding * condition * grown)


def _scatter(here: Configuration, factored: FactoredClosure, solver: ClosureSolver) -> Array:
    """By what part the accelerations for unit driver rates change where the residual changes by rounding, ``(T,)``.

    Near a crossing of branches, at a distance ``d``, by ``rounding / d^3``, where the rates themselves do not grow; near a fold by
    ``rounding / d^1/2``.
    """
    rounding = np.where(np.arange(here.system.n_rows) % 2, PATH.rounding, -PATH.rounding)
    dx = factored.solve(np.repeat(rounding[:, None, None], here.T, axis=2))[:, 0]
    there = Configuration(here.system, here.system.advance(here.x, dx))
    beside = solver.factored(there, factored.which)
    nothing = np.zeros((len(solver.fixed), here.T))
    out = np.zeros(here.T)
    for i in range(len(solver.fixed)):
        one = nothing.copy()
        one[i] = 1.0
        a, b = (rates(x, f, solver.fixed, one, nothing) for x, f in ((here, factored), (there, beside)))
        change, size = (np.abs(values).max(axis=0, initial=0.0) for values in (a.ddq - b.ddq, a.ddq))
        out = np.maximum(out, change / np.maximum(size, 1.0))
    return out


def disagreement(moved: Rates, columns: Index, positions: Array, velocity: Array, acceleration: Array) -> Array:
    """How far motions given to freedoms ``columns (d, T)`` are from those found, relative ``(T,)``; angles up to whole turns."""
    system = moved.here.system
    off = positions - moved.here.x[system.single_rows[columns]]
    off -= system.rounds(columns, off)
    out = np.maximum(np.abs(off).max(axis=0, initial=0.0), moved.contradiction)
    for asked, found in ((velocity, moved.dq), (acceleration, moved.ddq)):
        size = np.abs(found).max(axis=0, initial=0.0) + np.abs(asked).max(axis=0, initial=0.0)
        gap = np.abs(found[columns] - asked).max(axis=0, initial=0.0)
        out = np.maximum(out, gap / np.where(size > 0, size, 1.0))
    return out


def _completed(
    here: Configuration,
    solver: FactoredClosure,
    columns: Index,
    driven: Array,
    known: Array | None,
    size: Array | float = 0.0,
) -> tuple[Array, Array]:
    """Rates ``(F, T)`` with ``J q + known = 0`` for given driven ones, and what is left of that, relative ``(T,)``."""
    given = np.zeros((here.system.n_freedoms, here.T))
    if known is None and not driven.any():
        return given, np.zeros(here.T)
    given[columns] = driven
    rhs = -here.closure_rates(given) if driven.any() else np.zeros_like(here.residual)
    if known is not None:
        rhs -= known
    q = solver.solve(rhs[:, None])[:, 0]
    left = np.abs(here.closure_rates(q) - rhs).max(axis=0, initial=0.0)
    q[columns] = driven
    scale = np.abs(q).max(axis=0, initial=0.0) + size
    if known is not None:
        scale += np.abs(known).max(axis=0, initial=0.0)
    return q, left / np.where(scale > 0, scale, 1.0)
