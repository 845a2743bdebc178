"""Newton's method for batches: with a problem's own linear equations along tracks, and Gauss-Newton of least change for assembly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import scipy

from mechgraph.maths.se3 import Array, Index, Mask
from mechgraph.maths.tolerances import PATH

LONGEST = 0.5
"""Longest step (largest increment) that is taken at once."""
EVERY = slice(None)


def largest(values: Array) -> Array:
    """Largest sizes ``(n,)`` of the columns of values ``(m, n)``."""
    return np.asarray(np.maximum.reduce(np.abs(values), axis=0, initial=0.0))


class Factored(Protocol):
    """The linearized equations at a batch of points, factored."""

    @property
    def condition(self) -> Array:
        """Condition numbers ``(n,)``."""

    def solve(self, b: Array) -> Array:
        """Increments ``(F, k, n)`` for right sides ``(m, k, n)``."""

    def residual_size(self, r: Array) -> Array:
        """Largest entry ``(n,)`` of residuals ``(m, n)``, each in the measure of what it belongs to."""

    def motions(self) -> Array:
        """Increments ``(F, p, n)`` that the equations leave free with the path values at rest."""

    def regular_between(self, ends: Any, a: Index, b: Index) -> Mask:
        """Whether no matrix on the parabola through those at ``ends`` ``a (n,)``, here and at ``b`` is singular or nearly so, ``(n,)``."""


class Point(Protocol):
    """The equations evaluated at a batch of points."""

    x: Array

    @property
    def residual(self) -> Array:
        """Residual of the equations, ``(m, n)``."""

    @property
    def rounding(self) -> Array:
        """Rounding of the residual, ``(n,)``."""

    def closure_rates(self, dq: Array) -> Array:
        """Rates of the residual ``(m, n)`` for rates of the increments ``(F, n)``."""

    def part(self, at: Index) -> Any:
        """Some of the points."""


class Problem(Protocol):
    """Equations along tracks: states ``x (nx, n)``, increments ``dq (F, n)``, path values ``drive (d, n)``, numbers of ``tracks (n,)``."""

    size: tuple[int, int]
    """Numbers of increments F and of path values d."""
    paced: bool
    """Whether the equations may change more slowly than the path values, see ``pace``."""
    bend: float
    """Greatest curvature of curves and surfaces in the equations; 0 where there are none."""

    def at(self, x: Array, drive: Array, tracks: Index) -> Any:
        """The equations at (a copy of) states, the path values put in."""

    def chosen(self, point: Any, which: Index) -> Index:
        """Forms (by number) of the linear equations at the points: ``which``, or others where these are ill-conditioned."""

    def factored(self, point: Any, which: Index) -> Any:
        """The linear equations at points, each in its form."""

    def sensitivity(self, point: Any, factored: Any) -> Array:
        """Rates ``Z (F, d, n)`` of the increments with the path values."""

    def advance(self, x: Array, dq: Array, tracks: Index) -> Array:
        """States after increments."""

    def difference(self, x1: Array, x0: Array) -> Array:
        """Increments from ``x0`` to ``x1``."""

    def tangent(self, dq: Array, rates: Array) -> Array:
        """Rates of increments from the rates at the states to which they lead."""

    def pace(self, x: Array, rates: Array) -> Array:
        """How fast the equations change at rates ``(F, n)``, at most one: 0 where steps may be as long as the certificate allows."""

    def corrigible(self, dq: Array, which: Index) -> Array:
        """Increments without the part that no correction can change (freedoms that are held)."""


@dataclass
class Work:
    """How much was computed.

    Attributes
    ----------
    positions : positions asked for.
    nodes : points at which the path was found in between, ``careful`` of them step by step (near a fold or a crossing).
    evaluations : states at which the equations were evaluated, in ``calls`` batches.
    factorizations : matrices factored.
    groups : structural groups in which they were solved one after the other; 0 where the matrices were factored as a whole.
    """

    positions: int = 0
    nodes: int = 0
    careful: int = 0
    evaluations: int = 0
    calls: int = 0
    factorizations: int = 0
    groups: int = 0

    def __str__(self) -> str:
        shown = [name for name in self.__dataclass_fields__ if name != "groups" or self.groups]
        return ", ".join(f"{getattr(self, name)} {name}" for name in shown)

    @property
    def counts(self) -> tuple[tuple[int, str], ...]:
        """What a summary shows: numbers, and of what."""
        return (
            (self.positions, "position"),
            (self.nodes, "node of the path"),
            (self.evaluations, "evaluation"),
            (self.factorizations, "factorization"),
            *([(self.groups, "group")] if self.groups else []),
        )


@dataclass(frozen=True)
class Closed:
    """Newton's outcome for a batch: states, sum of corrections ``(F, n)``, sensitivities, conditions, forms, which were closed.

    ``point`` is the evaluation at ``x`` where that was the last thing done for all of them.
    """

    x: Array
    total: Array
    Z: Array
    condition: Array
    which: Index
    done: Mask
    point: Any = None

    @cached_property
    def correction(self) -> Array:
        """Largest correction of a freedom ``(n,)``."""
        return largest(self.total)


@dataclass
class Newton:
    """Newton's method for a batch of points of a problem."""

    problem: Problem
    work: Work = field(default_factory=Work)

    def nodes(self, x: Array, drive: Array, tracks: Index, which: Index, goal: float) -> Closed:
        """States corrected until the last step is below ``goal``, with their sensitivities."""
        return _Run(self, x, drive, tracks, which, goal, 0.0).closed()

    def close(self, x: Array, drive: Array, tracks: Index, which: Index) -> Closed:
        """States corrected until the residual is rounding."""
        return _Run(self, x, drive, tracks, which, 0.0, PATH.closed).closed()


class _Run:
    """States ``x (nx, n)`` on their way to zeros; ``active`` are those that are corrected further, evaluated at ``point``."""

    def __init__(
        self, newton: Newton, x: Array, drive: Array, tracks: Index, which: Index, step_goal: float, goal: float
    ) -> None:
        (F, d), n = newton.problem.size, x.shape[1]
        self.problem, self.work = newton.problem, newton.work
        self.x, self.drive, self.tracks, self.which = x.copy(), drive, tracks, which.copy()
        self.step_goal, self.goal = step_goal, goal
        self.total, self.Z, self.condition = np.zeros((F, n)), np.zeros((F, d, n)), np.full(n, np.inf)
        self.before = self.condition.copy()
        self.done, self.chosen_again = np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        self.active = np.arange(n)

    def closed(self) -> Closed:
        """The outcome, after as many steps as it takes."""
        point = None
        for _ in range(PATH.iterations):
            if self._evaluated():
                point = self.point if self.active.size == len(self.done) else None
                break
            self._correct()
            if not self.active.size:
                break
        return Closed(self.x, self.total, self.Z, self.condition, self.which, self.done, point)

    @property
    def _mine(self) -> Index | slice:
        return EVERY if self.active.size == len(self.done) else self.active

    def _evaluated(self) -> bool:
        """Evaluate the active states; where the residual is at its goal, or at rounding and no longer falls, they are done.

        Whether all of them are.
        """
        mine = self._mine
        self.point = self.problem.at(self.x[:, mine], self.drive[:, mine], self.tracks[mine])
        self.work.evaluations += self.active.size
        self.work.calls += 1
        self.left = largest(self.point.residual)
        if self.goal == 0:
            return False
        near = self.left <= self.goal
        stalled = self.left > 0.5 * self.before[mine]
        if stalled.any():
            near |= stalled & (self.left <= np.maximum(PATH.accepted, self.point.rounding))
        self.x[:, self.active[near]] = self.point.x[:, near]
        self.done[self.active[near]] = True
        if near.all():
            return True
        if near.any():
            keep = np.flatnonzero(~near)
            self.active, self.point, self.left = self.active[keep], self.point.part(keep), self.left[keep]
        return False

    def _correct(self) -> None:
        """Take one step; where it is at its goal the state is done, where it leads too far away it is left."""
        mine = self._mine
        f = self.problem.factored(self.point, self.which[mine])
        self.work.factorizations += self.active.size
        step = f.solve(-self.point.residual[:, None])[:, 0]
        size = largest(step)
        finite = None
        if np.count_nonzero(size <= LONGEST) < len(size):
            finite = np.isfinite(size)
            step = np.where(finite, step, 0.0) * np.minimum(1.0, LONGEST / np.maximum(size, LONGEST))
        self.x[:, mine] = self.problem.advance(self.point.x, step, self.tracks[mine])
        self.total[:, mine] += step
        self.before[mine] = self.left
        small = self._small(f, size)
        going = ~small if finite is None else finite & ~small
        unmet = self._unmet(small, step, size)
        if unmet is not None:
            again = unmet & ~self.chosen_again[mine]
            self._choose_again(np.flatnonzero(again))
            small, going = small & ~unmet, (going & ~unmet) | again
        if count := np.count_nonzero(small):
            at, those = (mine, EVERY) if count == self.active.size else (self.active[small], small)
            self.Z[:, :, at] = self.problem.sensitivity(self.point, f)[:, :, those]
            self.condition[at], self.done[at] = f.condition[those], True
        if count < self.active.size:
            going &= largest(self.total[:, mine]) <= PATH.lost
        self.active = self.active[going]

    def _small(self, f: Any, size: Array) -> Mask:
        """Where a step of that size is at its goal."""
        small: Mask = size <= self.step_goal
        if self.step_goal <= PATH.node and np.count_nonzero(small):
            # the rates of a node err by the last step times the condition: poor ones are closed further, down to rounding
            condition_here = np.maximum(f.condition, 1.0)
            small &= size <= np.maximum(PATH.rates / condition_here, PATH.rounding * condition_here)
        return small

    def _unmet(self, small: Mask, step: Array, size: Array) -> Mask | None:
        """Where a last step leaves the residual of rows that were left out as dependent as large as it is: they are not. None: nowhere."""
        # residual over the step that takes it away from which on it is asked whether it does: rows are of size one, a few freedoms each
        doubt = small & (self.left > np.maximum(30.0 * size, 10.0 * PATH.accepted))
        if not np.count_nonzero(doubt):
            return None
        rest = largest(self.point.residual + self.point.closure_rates(step))
        return np.asarray(doubt & (rest > 0.5 * self.left))

    def _choose_again(self, again: Index) -> None:
        """Another form, tried once."""
        if again.size:
            at = self.active[again]
            self.which[at] = self.problem.chosen(self.point.part(again), np.full(again.size, -1))
            self.chosen_again[at] = True


def least_norm_steps(J: Array, r: Array, tolerance: float) -> Array:
    """Smallest ``dq (n, T)`` with least ``|J dq + r|`` for matrices ``(m, n, T)`` and residuals ``(m, T)``; NaN where one is not finite.

    Singular values below ``tolerance`` times the largest are dropped.
    """
    if J.shape[2] == 1 and J.size:  # one matrix: no inverse is formed
        found = scipy.linalg.lstsq(J[:, :, 0], -r[:, 0], cond=tolerance, lapack_driver="gelsd", check_finite=False)
        return np.asarray(found[0])[:, None]
    finite = np.isfinite(J).all(axis=(0, 1)) & np.isfinite(r).all(axis=0)
    inverse = np.linalg.pinv(np.moveaxis(np.where(finite, J, 0.0), -1, 0), rcond=tolerance)
    return np.where(finite, -np.einsum("tnm,mt->nt", inverse, np.where(finite, r, 0.0)), np.nan)


def closest_zeros(
    evaluate: Callable[[Array], Any],
    least: Callable[[Any], Array],
    advance: Callable[[Array, Array], Array],
    x: Array,
    *,
    tolerance: float,
    longest: float = 0.5,
    iterations: int = 60,
    patience: int = 8,
) -> tuple[Array, Array]:
    """Gauss-Newton with limited steps from points ``x (nx, T)``: the zero of the residual near to each, or the best point found.

    ``evaluate(x)`` gives a point with ``residual (m, T)``, ``least(point)`` the smallest steps ``(n, T)`` that take it to zero. Steps are
    limited to ``longest`` (largest component) and halved while the residual grows; after ``patience`` steps without gain a point is
    left. Converges linearly to double roots. Returns the points and the largest residual component at each, ``(T,)``.
    """
    x = x.copy()
    size = np.abs(evaluate(x).residual).max(axis=0, initial=0.0)
    best, best_size, stalled = x.copy(), size.copy(), np.zeros(len(size), dtype=np.intp)
    at = np.flatnonzero(size > tolerance)
    for _ in range(iterations):
        if not at.size:
            break
        point = evaluate(x[:, at])
        before, step = np.linalg.norm(point.residual, axis=0), least(point)
        biggest = np.abs(step).max(axis=0, initial=0.0)
        moves = np.flatnonzero(np.isfinite(biggest) & (biggest > 0))
        at, before = at[moves], before[moves]
        step = step[:, moves] * np.minimum(1.0, longest / biggest[moves])
        left, begin = np.arange(at.size), x[:, at]
        for _ in range(6):
            if not left.size:
                break
            trial = advance(begin[:, left], step[:, left])
            r = evaluate(trial).residual
            x[:, at[left]], size[at[left]] = trial, np.abs(r).max(axis=0, initial=0.0)
            worse = ~((np.linalg.norm(r, axis=0) < before[left]) | (size[at[left]] <= tolerance))
            left = left[worse]
            step[:, left] *= 0.5
        gained = at[size[at] < 0.999 * best_size[at]]
        stalled[at] += 1
        stalled[gained] = 0
        best[:, gained], best_size[gained] = x[:, gained], size[gained]
        at = at[(size[at] > tolerance) & (stalled[at] <= patience) & ~((best_size[at] < 1e-9) & (stalled[at] > 1))]
    return best, best_size
