"""Finite mobility: the nullity at regular positions reached by a motion, confirmed by moving on in all its directions.

A position is regular where the closed positions near by form a manifold whose dimension is the nullity n of the closure Jacobian.
That is confirmed by actual motion: a random step v in the null space N is taken, the loops are closed again by the smallest change,
and what is left of the step in the null space is compared with it,

    kept = N^T (x' - x) / h,   x' closed.

On a manifold kept = v up to the square of step times curvature, so the step is made smaller until it agrees; a direction in which
nothing moves on (shaky) loses its part of v at every step size. Then each direction is tried by itself, and those that are kept
count. At a position that is not regular (a change point, or shaky) random steps lead to positions near by, where it is asked again.
So the mobility is never above a nullity on the way. Chords of a curved motion are never ranked against each other: they differ in
direction by its curvature. Source for the notion: Connelly and Whiteley, Second-order rigidity and prestress stability, 1996.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import CLOSED, CLOSURE_GOAL
from mechgraph.closure.configuration import System
from mechgraph.closure.loop_rows import ClosureRows, ReducedRows
from mechgraph.closure.rank import ClosureRank, EngineName, closure_rank

STEPS = (0.05, 0.0125, 0.003)
"""Lengths of trial steps (radians, or lengths / L): the first ones tell a motion that returns, the last ones bear curvature."""
FAR_STEPS = 6
"""Further steps of the first length over which the motion is followed."""
LOST = 0.25
"""Part of a direction of average share that may get lost in a random step; more means that a direction was not kept."""
KEPT = 0.5
"""Part of a step in one direction that must be left for it to count: about 1 on a motion, 0 where it returns."""
MOVED = 0.05
"""Part of a step that must be left for the position reached to count as another one."""
TRIALS = 6
"""Random steps away from a position that is not regular."""
FROZEN = 12
"""Corrections with the equations of the position left; then they are made anew at each."""
CORRECTIONS = 60
SLOW = 0.2
"""Part of the closure error that a correction may leave for these equations to be kept."""
LONGEST = 0.5
SEED = 7


@dataclass(frozen=True)
class FiniteMotion:
    """What following the motions showed.

    Attributes
    ----------
    mobility : dimension of the set of closed positions near by.
    rank_nearby : largest rank of the closure Jacobian at closed positions near by.
    null_nearby : motions ``(F, M)`` at the neighbour of that rank.
    """

    mobility: int
    rank_nearby: int
    null_nearby: Array
    follow: Callable[[], float]

    @cached_property
    def stroke(self) -> float:
        """Length over which a motion was followed with the loops closed (0 where nothing moves)."""
        return self.follow() if self.mobility else 0.0


@dataclass(frozen=True)
class _Position:
    """A closed position and the motions there, ``N`` orthonormal in columns of unit size."""

    system: System
    x: Array
    found: ClosureRank
    engine: EngineName

    @classmethod
    def at(cls, system: System, x: Array, engine: EngineName) -> _Position:
        return cls(system, x, closure_rank(system.at(x[:, None]), engine=engine), engine)

    @cached_property
    def N(self) -> Array:
        return np.linalg.qr(self.found.motions / self.found.reduced.scale[:, None])[0]

    def moved(self, v: Array, h: float) -> tuple[Array, float] | None:
        """State after a step of ``N v`` of length ``h`` with the loops closed again, and the factor of the step; None where not."""
        dq = self.found.reduced.scale * (self.N @ v)
        factor = h / float(np.abs(dq).max())
        x = self.system.advance(self.x[:, None], factor * dq[:, None])[:, 0]
        closed = _closed(self.system, x, self.found.reduced)
        return None if closed is None else (closed, factor)

    def kept(self, v: Array, h: float) -> Array | None:
        """What is left of the step ``v`` in the null space, in units of the step."""
        moved = self.moved(v, h)
        if moved is None:
            return None
        change = self.system.difference(moved[0][:, None], self.x[:, None])[:, 0]
        return np.asarray(self.N.T @ (change / self.found.reduced.scale) / moved[1])

    def random(self, rng: np.random.Generator) -> Array:
        """A random direction of size one: of a random vector of all freedoms, so that no basis of the motions matters."""
        v = self.N.T @ rng.normal(size=self.N.shape[0])
        return np.asarray(v / np.linalg.norm(v))

    def regular(self, v: Array) -> bool:
        """Whether a random step is kept in all its parts."""
        least = LOST / np.sqrt(len(v))
        for h in STEPS:
            kept = self.kept(v, h)
            if kept is not None and np.linalg.norm(kept - v) < least:
                return True
        return False

    def dimension(self) -> int:
        """Number of directions in which a step is kept."""
        columns = [self.kept(v, STEPS[1]) for v in np.eye(self.N.shape[1])]
        table = np.stack([c if c is not None else np.zeros(self.N.shape[1]) for c in columns])
        return int((np.linalg.svd(table, compute_uv=False) > KEPT).sum())


def finite_motion(system: System, x: Array, found: ClosureRank, engine: EngineName = "auto") -> FiniteMotion:
    """Follow the motions of a closed state ``x (nx,)`` where ``found`` is the rank of its closure equations.

    Where the closure Jacobian has full row rank the dimension is its nullity (implicit function theorem).
    """
    here = _Position(system, x, found, engine)
    nullity = found.motions.shape[1]
    if not nullity:
        return FiniteMotion(0, found.rank, found.motions, lambda: 0.0)
    rng = np.random.default_rng(SEED)
    v = here.random(rng)
    if found.rank == found.count or here.regular(v):
        return FiniteMotion(nullity, found.rank, found.motions, lambda: _followed(here, v))
    return _near_by(here, rng)


def _near_by(here: _Position, rng: np.random.Generator) -> FiniteMotion:
    """The mobility about a position that is not regular: the largest of those at positions reached from it."""
    mobility, best, begin = 0, here.found, None
    for _ in range(TRIALS):
        v = here.random(rng)
        moved = here.moved(v, STEPS[0])
        if moved is None:
            continue
        change = here.system.difference(moved[0][:, None], here.x[:, None])[:, 0]
        if not np.abs(change).max() > MOVED * STEPS[0]:
            continue
        there = _Position.at(here.system, moved[0], here.engine)
        if there.found.rank > best.rank or begin is None:
            best = max(there.found, best, key=lambda f: f.rank)
        onward = there.N.T @ (change / there.found.reduced.scale)
        size = float(np.linalg.norm(onward))
        n = there.N.shape[1]
        dimension = (n if there.regular(there.random(rng)) else there.dimension()) if n and size > 0 else 0
        if dimension > mobility:
            mobility, begin = dimension, (there, onward / size)
    follow = (lambda: STEPS[0] + _followed(*begin)) if begin else (lambda: 0.0)
    return FiniteMotion(mobility, best.rank, best.motions, follow)


def _followed(begin: _Position, v: Array) -> float:
    """Stroke over which a motion can be continued in the same sense."""
    stroke, at = 0.0, begin
    for _ in range(FAR_STEPS + 1):
        moved = at.moved(v, STEPS[0])
        if moved is None:
            break
        change = at.system.difference(moved[0][:, None], at.x[:, None])[:, 0]
        if not np.abs(change).max() > MOVED * STEPS[0]:
            break
        stroke += float(np.abs(change).max())
        at = _Position.at(at.system, moved[0], at.engine)
        v = at.N.T @ (change / at.found.reduced.scale)
        if not np.linalg.norm(v) > MOVED * STEPS[0]:
            break
        v = v / np.linalg.norm(v)
    return stroke


def _closed(system: System, x: Array, rows: ReducedRows) -> Array | None:
    """The loops closed from ``x`` by small corrections, at first with the equations ``rows`` near by; None where they do not close."""
    best, least, since, frozen = x, np.inf, 0, True
    for step in range(CORRECTIONS):
        here = system.at(x[:, None])
        residual = here.residual[:, 0]
        error = float(np.abs(residual).max(initial=0.0))
        if error < least:
            slow = error > SLOW * least
            best, least, since = x, error, 0
        else:
            slow, since = True, since + 1
        if error <= CLOSURE_GOAL or since > 8 or (slow and least < 10 * CLOSURE_GOAL):
            break
        if frozen and (slow or step > FROZEN):
            frozen = False
        if not frozen:
            rows = ReducedRows(ClosureRows.at(here), np.zeros(0, dtype=np.intp))
        dq = rows.correction(residual)
        dq = dq * min(1.0, LONGEST / max(float(np.abs(dq).max()), 1e-300))
        x = system.advance(x[:, None], dq[:, None])[:, 0]
    return best if float(system.at(best[:, None]).closure[0]) <= CLOSED else None
