"""Newton's method for batches: with a problem's own linear equations along tracks, and Gauss-Newton of least change for assembly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from mechgraph.maths.se3 import Array, Index, Mask
from mechgraph.maths.tolerances import PATH

LONGEST = 0.5
"""Longest step (largest increment) that is taken at once."""


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
        return self._closed(x, drive, tracks, which, goal, 0.0)

    def close(self, x: Array, drive: Array, tracks: Index, which: Index) -> Closed:
        """States corrected until the residual is rounding."""
        return self._closed(x, drive, tracks, which, 0.0, PATH.closed)

    def _closed(self, x: Array, drive: Array, tracks: Index, which: Index, step_goal: float, goal: float) -> Closed:
        """States corrected until the last step is below one goal, or the residual below the other, or at rounding and no longer falls.

        States that a step leads too far away are left; those ``at`` are corrected further.
        """
        problem, (F, d), n = self.problem, self.problem.size, x.shape[1]
        x, which, at = x.copy(), which.copy(), np.arange(n)
        total, Z, condition = np.zeros((F, n)), np.zeros((F, d, n)), np.full(n, np.inf)
        before, done, chosen_again = condition.copy(), np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        for _ in range(PATH.iterations):
            point = problem.at(x[:, at], drive[:, at], tracks[at])
            self.work.evaluations += at.size
            self.work.calls += 1
            left = largest(point.residual)
            if goal > 0.0:
                near = (left <= goal) | (
                    (left > 0.5 * before[at]) & (left <= np.maximum(PATH.accepted, point.rounding))
                )
                x[:, at[near]], done[at[near]] = point.x[:, near], True
                if near.all():
                    return Closed(x, total, Z, condition, which, done, point if at.size == n else None)
                if near.any():
                    keep = np.flatnonzero(~near)
                    at, point, left = at[keep], point.part(keep), left[keep]
            f = problem.factored(point, which[at])
            self.work.factorizations += at.size
            step = f.solve(-point.residual[:, None])[:, 0]
            size = largest(step)
            finite = np.isfinite(size)
            step = np.where(finite, step, 0.0) * np.minimum(1.0, LONGEST / np.maximum(size, LONGEST))
            x[:, at] = problem.advance(point.x, step, tracks[at])
            total[:, at] += step
            before[at] = left
            small = size <= step_goal
            if step_goal <= PATH.node and small.any():
                # the rates of a node err by the last step times the condition: poor ones are closed further, down to rounding
                poor = np.maximum(f.condition, 1.0)
                small &= size <= np.maximum(PATH.rates / poor, PATH.rounding * poor)
            # rows that were left out as dependent are not where a last step leaves their residual as large as it is: another form is tried
            # once. A residual 30 times the step is no matter of sizes: rows are of size one, with a few freedoms each
            unmet = small & (left > np.maximum(30.0 * size, 10.0 * PATH.accepted))
            if unmet.any():
                unmet &= largest(point.residual + point.closure_rates(step)) > 0.5 * left
            again = unmet & ~chosen_again[at]
            if again.any():
                which[at[again]] = problem.chosen(
                    point.part(np.flatnonzero(again)), np.full(np.count_nonzero(again), -1)
                )
                chosen_again[at[again]] = True
            small &= ~unmet
            if small.any():
                Z[:, :, at[small]] = problem.sensitivity(point, f)[:, :, small]
                condition[at[small]], done[at[small]] = f.condition[small], True
            at = at[((finite & ~small & ~unmet) | again) & (largest(total[:, at]) <= PATH.lost)]
            if not at.size:
                break
        return Closed(x, total, Z, condition, which, done)


def least_norm_steps(J: Array, r: Array, tolerance: float) -> Array:
    """Smallest ``dq (n, T)`` with least ``|J dq + r|`` for matrices ``(m, n, T)`` and residuals ``(m, T)``; NaN where one is not finite.

    Singular values below ``tolerance`` times the largest are dropped.
    """
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
