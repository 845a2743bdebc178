"""Finite mobility: motions followed over small strokes with the loops kept closed, not judged by one rank.

Random unit motions of the null space are taken as first steps and the loops closed again. What returns (instantaneous freedom) is
told from what stays (finite freedom) by the displacement left; at points reached the count is made again, so that branch points and
shaky positions do not mislead.
"""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.motion.assembly import CLOSED, close
from mechgraph.motion.system import System
from mechgraph.numerics.linear import rank_of, singular_values
from mechgraph.structure.freedom import motions_of

STROKE = 0.05
"""Length of a trial step (radians, or lengths / L)."""
KEPT = 0.05
"""Part of a trial step that must be left after closing for it to count as motion."""
SEED = 7


def finite_mobility(system: System, x: Array) -> int:
    """Dimension of the set of closed positions near the state ``x (nx,)``.

    Where the closure Jacobian has full row rank this is its nullity (implicit function theorem); otherwise motions are followed.
    """
    J = system.at(x[:, None]).J[:, :, 0]
    null = motions_of(J)
    if null.shape[1] == 0 or null.shape[1] == J.shape[1] - J.shape[0]:
        return null.shape[1]
    rng = np.random.default_rng(SEED)
    reached = _strokes(system, x, null, rng, 2 * null.shape[1])
    best = 0
    for point, _ in reached[:3]:
        there = motions_of(system.at(point[:, None]).J[:, :, 0])
        moves = [change for _, change in _strokes(system, point, there, rng, there.shape[1] + 1)]
        if moves:
            best = max(best, rank_of(singular_values(np.stack(moves)), KEPT))
    return best


def _strokes(system: System, x: Array, null: Array, rng: np.random.Generator, count: int) -> list[tuple[Array, Array]]:
    """Closed points reached by random steps along ``null`` and the displacements to them, in units of the stroke."""
    out = []
    nothing = np.zeros(0, dtype=np.intp)
    for _ in range(count):
        direction = null @ rng.normal(size=null.shape[1])
        direction *= STROKE / np.abs(direction).max()
        guess = system.advance(x[:, None], direction[:, None])[:, 0]
        point, error = close(system, guess, nothing)
        change = system.difference(point[:, None], x[:, None])[:, 0] / STROKE
        if error <= CLOSED and np.abs(change).max() > KEPT:
            out.append((point, change))
    return out
