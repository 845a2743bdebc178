"""Newton's method for batches: with a problem's own linear equations along tracks, and Gauss-Newton of least change for assembly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.numerics.tolerances import PATH

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


class Factored(Protocol):
    """The linearized equations at a batch of points, factored."""

    @property
    def condition(self) -> Array:
        """Condition numbers ``(n,)``."""

    def solve(self, b: Array) -> Array:
        """Increments ``(F, k, n)`` for right sides ``(m, k, n)``."""

    def motions(self) -> Array:
        """Increments ``(F, p, n)`` that the equations leave free with the path values at rest."""

    def regular_between(self, a: Any, b: Any) -> Mask:
        """Whether no matrix on the parabola through those at ``a``, here and at ``b`` is singular or nearly so, ``(n,)``."""


class Point(Protocol):
    """The equations evaluated at a batch of points."""

    x: Array

    @property
    def residual(self) -> Array:
        """Residual of the equations, ``(m, n)``."""

    @property
    def rounding(self) -> Array:
        """Rounding of the residual, ``(n,)``."""

    def part(self, at: Index) -> Any:
        """Some of the points."""


class Problem(Protocol):
    """Equations along tracks: states ``x (nx, n)``, increments ``dq (F, n)``, path values ``drive (d, n)``, numbers of ``tracks (n,)``."""

    size: tuple[int, int]
    """Numbers of increments F and of path values d."""
    paced: bool
    """Whether the equations may change more slowly than the path values, see ``pace``."""

    def at(self, x: Array, drive: Array, tracks: Index) -> Any:
        """The equations at states, the path values put in."""

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

    def pace(self, rates: Array) -> Array:
        """How fast the equations change at the rates ``(F, n)``, at most one: 0 where steps may be as long as the certificate allows."""

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
    """

    positions: int = 0
    nodes: int = 0
    careful: int = 0
    evaluations: int = 0
    calls: int = 0
    factorizations: int = 0

    def __str__(self) -> str:
        return ", ".join(f"{getattr(self, name)} {name}" for name in self.__dataclass_fields__)

    @property
    def counts(self) -> tuple[tuple[int, str], ...]:
        """What a summary shows: numbers, and of what."""
        return (
            (self.positions, "position"),
            (self.nodes, "node of the path"),
            (self.evaluations, "evaluation"),
            (self.factorizations, "factorization"),
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

    @property
    def correction(self) -> Array:
        """Largest correction of a freedom ``(n,)``."""
        return np.asarray(np.abs(self.total).max(axis=0, initial=0.0))


@dataclass
class Newton:
    """Newton's method for a batch of points of a problem."""

    problem: Problem
    work: Work = field(default_factory=Work)

    def nodes(self, x: Array, drive: Array, tracks: Index, which: Index, goal: float | Array) -> Closed:
        """States corrected until the last step is below ``goal``, with their sensitivities."""
        return self._run(x, drive, tracks, which, goal, 0.0)

    def close(self, x: Array, drive: Array, tracks: Index, which: Index) -> Closed:
        """States corrected until the residual is rounding."""
        return self._run(x, drive, tracks, which, 0.0, PATH.closed)

    def _run(self, x: Array, drive: Array, tracks: Index, which: Index, step_goal: Any, goal: float) -> Closed:
        F, d = self.problem.size
        n = x.shape[1]
        x, which = x.copy(), which.copy()
        total, Z, condition = np.zeros((F, n)), np.zeros((F, d, n)), np.full(n, np.inf)
        done, before = np.zeros(n, dtype=bool), np.full(n, np.inf)
        step_goal = np.broadcast_to(step_goal, n)
        fresh = np.ones(n, dtype=bool)
        active, point = np.arange(n), None
        for _ in range(PATH.iterations):
            mine = slice(None) if active.size == n else active
            point = self.problem.at(x[:, mine].copy(), drive[:, mine], tracks[mine])
            self._count(active.size, 1, 0)
            left = np.abs(point.residual).max(axis=0, initial=0.0)
            if goal > 0:
                near = left <= goal
                stalled = left > 0.5 * before[mine]
                if stalled.any():
                    near |= stalled & (left <= np.maximum(PATH.accepted, point.rounding))
                x[:, active[near]] = point.x[:, near]
                done[active[near]] = True
                if near.all():
                    break
                if near.any():
                    keep = np.flatnonzero(~near)
                    active, point, left = active[keep], point.part(keep), left[keep]
                    mine = active
            f = self.problem.factored(point, which[mine])
            self._count(0, 0, active.size)
            step = f.solve(-point.residual[:, None])[:, 0]
            size = np.abs(step).max(axis=0, initial=0.0)
            finite = np.isfinite(size)
            if not finite.all() or (size > 0.5).any():
                step = np.where(finite, step, 0.0) * np.minimum(1.0, 0.5 / np.maximum(size, 0.5))
            x[:, mine] = self.problem.advance(point.x, step, tracks[mine])
            total[:, mine] += step
            before[mine] = left
            small = finite & (size <= step_goal[mine])
            if small.any() and step_goal[0] <= PATH.node:
                # the rates of a node err by the last step times the condition: poor ones are closed further, down to rounding
                condition_here = np.maximum(f.condition, 1.0)
                small &= size <= np.maximum(PATH.rates / condition_here, PATH.rounding * condition_here)
            # rows that were left out as dependent must be met as well: where they are not, another form is tried once
            unmet = small & (left > np.maximum(1e3 * step_goal[mine], 1e-9))
            if unmet.any():
                retry = np.flatnonzero(unmet & fresh[mine])
                if retry.size:
                    which[active[retry]] = self.problem.chosen(point.part(retry), np.full(retry.size, -1))
                    fresh[active[retry]] = False
                finite &= ~unmet
                finite[retry] = True
                small &= ~unmet
            if small.all():
                Z[:, :, mine], condition[mine], done[mine] = self.problem.sensitivity(point, f), f.condition, True
                active, point = active[:0], None
                break
            if small.any():
                Z[:, :, active[small]] = self.problem.sensitivity(point, f)[:, :, small]
                condition[active[small]] = f.condition[small]
                done[active[small]] = True
            lost = np.abs(total[:, mine]).max(axis=0, initial=0.0) > PATH.lost
            active, point = active[finite & ~small & ~lost], None
            if not active.size:
                break
        whole = point is not None and active.size == n
        return Closed(x, total, Z, condition, which, done, point if whole else None)

    def _count(self, evaluations: int, calls: int, factorizations: int) -> None:
        self.work.evaluations += evaluations
        self.work.calls += calls
        self.work.factorizations += factorizations


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
