"""Velocities and accelerations of closed positions: one linear solve each, for all positions together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.motion import idle
from mechgraph.motion.idle import Idle
from mechgraph.motion.system import Configuration, Index
from mechgraph.numerics.linear import Choice, ChosenSystem

DEAD_POINT = 1e-10
"""Distance to a dead point, in driver coordinates (radians, or lengths / L), below which a position counts as one."""


@dataclass(frozen=True)
class Rates:
    """Rates of all freedoms ``dq, ddq (F, T)``, link twists ``V`` and accelerations ``A (6, N, T)``.

    ``contradiction (T,)`` is the largest part of the closure rates that no choice of the free rates can meet, relative to the
    terms of the equation.
    """

    dq: Array
    ddq: Array
    V: Array
    A: Array
    contradiction: Array


def closure_solver(here: Configuration, choices: list[Choice], which: Index) -> ChosenSystem:
    """The closure Jacobian of a batch, ready to be solved for the free coordinates."""
    return ChosenSystem(here.J, choices, which)


def rates(
    here: Configuration,
    solver: ChosenSystem,
    columns: Index,
    velocity: Array,
    acceleration: Array,
    bodies: tuple[Idle, ...] = (),
) -> Rates:
    """Rates for driver velocities and accelerations ``(d, T)``.

    ``J q' = 0`` and ``J q'' = -bias``, the driven part known; passive freedoms of ``bodies`` at rest (see ``motion.idle``).
    """
    dq, gap_v = _completed(here, solver, columns, velocity, None)
    V = here.link_twists(dq)
    Z = solver.null_of_columns() if bodies else np.zeros((len(dq), 0, here.T))
    if bodies:
        points = idle.rest_points(here, bodies, Z)
        G = idle.passive_twists(here, bodies, points, Z)
        dq += np.einsum("fpt,pt->ft", Z, idle.resting_part(G, idle.body_twists(bodies, points, V)))
        V = here.link_twists(dq)
    relative = here.bias(dq, V)
    bias = here.loop_sums(relative)
    turning = (dq * dq).max(axis=0, initial=0.0)
    ddq, gap_a = _completed(here, solver, columns, acceleration, bias, turning)
    A = here.accelerations_with(ddq, relative)
    if bodies:
        now = idle.body_accelerations(bodies, points, V, A)
        change = np.linalg.solve(np.einsum("ipt,iqt->tpq", G, G), idle.turning_part(bodies, points, V, G).T[..., None])[
            ..., 0
        ].T
        ddq += np.einsum("fpt,pt->ft", Z, idle.resting_part(G, now) - change)
        A = here.accelerations_with(ddq, relative)
    return Rates(dq, ddq, V, A, np.maximum(gap_v, gap_a))


def distance_to_dead_point(here: Configuration, solver: ChosenSystem, columns: Index) -> Array:
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


def _completed(
    here: Configuration,
    solver: ChosenSystem,
    columns: Index,
    driven: Array,
    known: Array | None,
    size: Array | float = 0.0,
) -> tuple[Array, Array]:
    """Rates ``(F, T)`` with ``J q + known = 0`` for given driven ones, and what is left of that, relative ``(T,)``."""
    rhs = np.zeros((here.J.shape[0], here.T)) if known is None else -known
    for column, value in zip(columns, driven, strict=True):
        if value.any():
            rhs -= here.J[:, column] * value
    q = solver.solve(rhs[:, None])[:, 0]
    left = np.abs((here.J * q).sum(axis=1) - rhs).max(axis=0, initial=0.0)
    q[columns] = driven
    scale = np.abs(q).max(axis=0, initial=0.0) + size
    if known is not None:
        scale += np.abs(known).max(axis=0, initial=0.0)
    return q, left / np.where(scale > 0, scale, 1.0)
