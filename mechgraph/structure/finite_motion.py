"""Finite mobility: motions followed over small and larger strokes with the loops kept closed, not judged by one rank.

Random unit motions of the null space are taken as first steps and the loops closed again. What returns (instantaneous freedom) is
told from what stays (finite freedom) by the displacement left; at points reached the count is made again, so that branch points and
shaky positions do not mislead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import CLOSED, close
from mechgraph.closure.indexing import System
from mechgraph.numerics.linear import rank_of, singular_values
from mechgraph.structure.mobility import motions_of

STROKE = 0.05
"""Length of a trial step (radians, or lengths / L)."""
FAR_STEPS = 6
"""Further steps of that length over which the motion is followed."""
KEPT = 0.05
"""Part of a trial step that must be left after closing for it to count as motion."""
SEED = 7


@dataclass(frozen=True)
class FiniteMotion:
    """What following the motions showed.

    Attributes
    ----------
    mobility : dimension of the set of closed positions near by.
    rank_nearby : largest rank of the closure Jacobian at closed positions near by.
    stroke : length over which a motion was followed with the loops closed (0 where nothing moves).
    null_nearby : motions ``(F, M)`` at the neighbour of that rank.
    """

    mobility: int
    rank_nearby: int
    stroke: float
    null_nearby: Array


def finite_motion(system: System, x: Array) -> FiniteMotion:
    """Follow the motions of a closed state ``x (nx,)``.

    Where the closure Jacobian has full row rank the dimension is its nullity (implicit function theorem); otherwise motions
    are followed and the displacements that stay are counted.
    """
    J = system.at(x[:, None]).J[:, :, 0]
    null = motions_of(J)
    rank = J.shape[1] - null.shape[1]
    if not null.shape[1]:
        return FiniteMotion(0, rank, 0.0, null)
    rng = np.random.default_rng(SEED)
    regular = rank == J.shape[0]
    reached = _strokes(system, x, null, rng, 1 if regular else 2 * null.shape[1])
    best, rank_nearby, null_nearby = (null.shape[1] if regular else 0), rank, null
    for i, (point, _) in enumerate(reached[:3]):
        there = motions_of(system.at(point[:, None]).J[:, :, 0])
        rank_there = J.shape[1] - there.shape[1]
        if rank_there > rank_nearby or (not i and rank_there == rank):
            rank_nearby, null_nearby = rank_there, there
        if regular:
            continue
        moves = [change for _, change in _strokes(system, point, there, rng, there.shape[1] + 1)]
        if moves:
            best = max(best, rank_of(singular_values(np.stack(moves)), KEPT))
    stroke = _followed(system, *reached[0]) if reached and best else 0.0
    return FiniteMotion(best, rank_nearby, stroke, null_nearby)


def _strokes(system: System, x: Array, null: Array, rng: np.random.Generator, count: int) -> list[tuple[Array, Array]]:
    """Closed points reached by random steps along ``null`` and the displacements to them, in units of the stroke."""
    out = []
    for _ in range(count):
        # of a random vector of all freedoms, so that it does not hang on which basis of the motions was found
        direction = null @ (null.T @ rng.normal(size=null.shape[0]))
        moved = _step(system, x, direction)
        if moved is not None:
            out.append(moved)
    return out


def _step(system: System, x: Array, direction: Array) -> tuple[Array, Array] | None:
    direction = direction * (STROKE / np.abs(direction).max())
    guess = system.advance(x[:, None], direction[:, None])[:, 0]
    point, error = close(system, guess, np.zeros(0, dtype=np.intp))
    change = system.difference(point[:, None], x[:, None])[:, 0] / STROKE
    return (point, change) if error <= CLOSED and np.abs(change).max() > KEPT else None


def _followed(system: System, x: Array, change: Array) -> float:
    """Stroke over which the motion can be continued in the same sense."""
    stroke = STROKE * float(np.abs(change).max())
    for _ in range(FAR_STEPS):
        null = motions_of(system.at(x[:, None]).J[:, :, 0])
        direction = null @ (null.T @ change)
        if not np.abs(direction).max(initial=0.0) > 1e-9:
            break
        moved = _step(system, x, direction)
        if moved is None:
            break
        x, change = moved
        stroke += STROKE * float(np.abs(change).max())
    return stroke
