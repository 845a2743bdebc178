"""Finite mobility: the nullity at regular positions reached by a motion, confirmed by moving on in all its directions.

A position is regular where the nearby closed positions form a manifold whose dimension is the nullity n of the closure Jacobian.
That is confirmed by actual motion: after a random step in the null space the rows that are independent here close all loops, so
that the others depend on them there too and the rank is constant. Where that fails at every step size, the position is a change point
or shaky; random steps reach nearby positions, where the test is repeated. If none of these is regular, each direction v of the null
space N is tried alone, and what is left of it once the loops are closed by the smallest change is compared with it:

    kept = N^T (x' - x) / h,   x' closed;

a direction in which nothing moves on loses its part at any step size and does not count.
So the mobility is never above a nullity on the way. Chords of a curved motion are never ranked against each other: they differ in
direction by its curvature. Source for the notion: Connelly and Whiteley, Second-order rigidity and prestress stability, 1996.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import CLOSED, CLOSURE_GOAL
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import System
from mechgraph.closure.loop_rows import ClosureRows, ReducedRows
from mechgraph.closure.rank import ClosureRank, EngineName, closure_rank
from mechgraph.numerics.newton import closest_zeros

STEPS = (0.05, 0.0125, 0.003)
"""Lengths of trial steps (radians, or lengths / L): the first ones tell a motion that returns, the last ones tolerate curvature."""
FAR_STEPS = 6
"""Further steps of the first length over which the motion is followed."""
KEPT = 0.5
"""Part of a step in one direction that must be left for it to count: about 1 on a motion, 0 where it returns."""
MOVED = 0.05
"""Part of a step that must be left for the position reached to count as another one."""
TRIALS = 6
"""Random steps away from a position that is not regular."""
FROZEN = 12
"""Corrections with the equations of the position left."""
SLOW = 0.2
"""Part of the closure error that such a correction may leave."""
STEPS_SEED = 7


@dataclass(frozen=True)
class _Position:
    """A closed position and the motions there, ``N`` orthonormal in columns of unit size."""

    system: System
    x: Array
    found: ClosureRank
    engine: EngineName

    @classmethod
    def at(cls, system: System, x: Array, engine: EngineName) -> _Position:
        return cls(system, x, closure_rank(Configuration(system, x[:, None]), engine=engine), engine)

    @cached_property
    def N(self) -> Array:
        return np.linalg.qr(self.found.motions / self.found.reduced.scale[:, None])[0]

    def moved(self, v: Array, h: float) -> tuple[Array, float] | None:
        """State after a step of ``N v`` of length ``h`` with the loops closed again, and the factor of the step; None where not."""
        x, factor = self._stepped(v, h)
        closed = _closed(self.system, x, self.found.reduced)
        return None if closed is None else (closed, factor)

    def _stepped(self, v: Array, h: float) -> tuple[Array, float]:
        dq = self.found.reduced.scale * (self.N @ v)
        factor = h / float(np.abs(dq).max())
        return self.system.advance(self.x[:, None], factor * dq[:, None])[:, 0], factor

    def change(self, x: Array) -> Array:
        """Increments ``(F,)`` from here to a state."""
        return self.system.difference(x[:, None], self.x[:, None])[:, 0]

    def kept(self, v: Array, h: float) -> Array | None:
        """What is left of the step ``v`` in the null space, in units of the step."""
        moved = self.moved(v, h)
        if moved is None:
            return None
        return np.asarray(self.N.T @ (self.change(moved[0]) / self.found.reduced.scale) / moved[1])

    def random(self, rng: np.random.Generator) -> Array:
        """A random direction of size one: of a random vector of all freedoms, so that no basis of the motions matters."""
        v = self.N.T @ rng.normal(size=self.N.shape[0])
        return np.asarray(v / np.linalg.norm(v))

    def regular(self, v: Array) -> bool:
        """Whether the rows that are independent here close all loops after a random step.

        Then the rank is constant nearby: the other rows depend on them not only here. Where it is not, they stay open by the square
        of the step (a change point) or a higher power (shaky), far above the closure error.
        """
        rows = self.found.reduced
        already = rows.open_part(Configuration(self.system, self.x[:, None]).residual[:, 0])
        limit = 10 * max(CLOSURE_GOAL, rows.rounding, already)
        for h in STEPS:
            closed = _corrected(self.system, self._stepped(v, h)[0], rows)
            if (
                closed is not None
                and rows.open_part(Configuration(self.system, closed[:, None]).residual[:, 0]) <= limit
            ):
                return True
        return False

    def dimension(self) -> int:
        """Number of directions in which a step is kept."""
        columns = [self.kept(v, STEPS[1]) for v in np.eye(self.N.shape[1])]
        table = np.stack([c if c is not None else np.zeros(self.N.shape[1]) for c in columns])
        return int((np.linalg.svd(table, compute_uv=False) > KEPT).sum())


@dataclass(frozen=True)
class FiniteMotion:
    """Result of following the motions.

    Attributes
    ----------
    mobility : dimension of the set of nearby closed positions.
    rank_nearby : largest rank of the closure Jacobian at nearby closed positions.
    begin : a position and a direction in which it moves on; None where nothing moves.
    """

    mobility: int
    rank_nearby: int
    begin: tuple[_Position, Array] | None = field(default=None, repr=False)

    @cached_property
    def stroke(self) -> float:
        """Length over which a motion was followed with the loops closed (0 where nothing moves)."""
        return _followed(*self.begin) if self.begin and self.mobility else 0.0

    @cached_property
    def null_nearby(self) -> Array | None:
        """Motions ``(F, M)`` at a position reached by a motion; None where nothing moves."""
        moved = self.begin and self.begin[0].moved(self.begin[1], STEPS[0])
        if not self.begin or not moved:
            return None
        return _Position.at(self.begin[0].system, moved[0], self.begin[0].engine).found.motions


def finite_motion(system: System, x: Array, found: ClosureRank, engine: EngineName = "auto") -> FiniteMotion:
    """Follow the motions of a closed state ``x (nx,)`` where ``found`` is the rank of its closure equations.

    Where the closure Jacobian has full row rank the dimension is its nullity (implicit function theorem).
    """
    here = _Position(system, x, found, engine)
    nullity = found.motions.shape[1]
    if not nullity:
        return FiniteMotion(0, found.rank)
    rng = np.random.default_rng(STEPS_SEED)
    v = here.random(rng)
    if found.rank == found.count or here.regular(v):
        return FiniteMotion(nullity, found.rank, (here, v))
    return _near_by(here, rng)


def _near_by(here: _Position, rng: np.random.Generator) -> FiniteMotion:
    """The mobility about a position that is not regular: the largest of those at positions reached from it."""
    mobility, rank, begin = 0, here.found.rank, None
    for _ in range(TRIALS):
        moved = here.moved(here.random(rng), STEPS[0])
        if moved is None:
            continue
        change = here.change(moved[0])
        if not np.abs(change).max() > MOVED * STEPS[0]:
            continue
        there = _Position.at(here.system, moved[0], here.engine)
        rank = max(rank, there.found.rank)
        if not there.N.shape[1]:
            continue
        regular = there.regular(there.random(rng))
        dimension = there.N.shape[1] if regular else there.dimension()
        if dimension > mobility:
            mobility, begin = dimension, (there, there.N.T @ (change / there.found.reduced.scale))
    return FiniteMotion(mobility, rank, begin)


def _followed(begin: _Position, v: Array) -> float:
    """Stroke over which a motion can be continued in the same sense."""
    stroke, at = 0.0, begin
    for _ in range(FAR_STEPS + 1):
        moved = at.moved(v, STEPS[0])
        if moved is None:
            break
        change = at.change(moved[0])
        if not np.abs(change).max() > MOVED * STEPS[0]:
            break
        stroke += float(np.abs(change).max())
        at = _Position.at(at.system, moved[0], at.engine)
        v = at.N.T @ (change / at.found.reduced.scale)
        if not np.linalg.norm(v) > MOVED * STEPS[0]:
            break
    return stroke


def _corrected(system: System, x: Array, rows: ReducedRows) -> Array | None:
    """The loops closed from ``x`` in the kept rows of a nearby position alone; None where that does not converge quickly."""
    before, goal = np.inf, max(CLOSURE_GOAL, rows.rounding)
    for _ in range(FROZEN):
        residual = Configuration(system, x[:, None]).residual[:, 0]
        error = float(np.abs(rows.kept_part(residual[:, None])).max(initial=0.0))
        if error <= goal or (error < 10 * goal and error > SLOW * before):
            return x
        if error > SLOW * before:
            return None
        before = error
        x = system.advance(x[:, None], rows.correction(residual)[:, None])[:, 0]
    return None


def _closed(system: System, x: Array, rows: ReducedRows) -> Array | None:
    """The loops closed from ``x``: with the rows of a nearby position where they converge, otherwise by Newton; None where not."""
    quick = _corrected(system, x, rows)
    if quick is not None and float(Configuration(system, quick[:, None]).closure[0]) <= CLOSED:
        return quick

    def least(here: Configuration) -> Array:
        new = ReducedRows(ClosureRows.at(here), np.zeros(0, dtype=np.intp), rows.dense)
        return new.correction(here.residual[:, 0])[:, None]

    best, _ = closest_zeros(
        lambda x: Configuration(system, x), least, system.advance, x[:, None], tolerance=CLOSURE_GOAL
    )
    return best[:, 0] if float(Configuration(system, best).closure[0]) <= CLOSED else None
