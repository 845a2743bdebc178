"""Starts of fits and their way to optima: all together by the method of Levenberg and Marquardt, the best of them to the end.

Starts go down on some of the rows, from which drivers are eliminated one by one: each acts on its own row. The best of them are followed to
the end on all rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import scipy

from mechgraph.errors import counted
from mechgraph.maths.se3 import Array
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.synthesis.fitness import keeps
from mechgraph.synthesis.fits import LEAST_MARGIN, Bounds, Fit, FitPoint


def descended(fit: Fit, here: FitPoint, low: Array, high: Array, steps: int) -> tuple[FitPoint, Array]:
    """The rows of mechanisms on their way to the least sums of squares, some steps on; and these sums ``(T,)``.

    With ``J = [Z Y]`` by the unknowns and the drivers ``Y^T Y`` is diagonal, as a driver acts on its own row: the unknowns are those of
    ``(Z^T Z + m D - Z^T Y (Y^T Y)^-1 Y^T Z) dz``, ``D`` the diagonal of ``Z^T Z``, the damping ``m`` one for each mechanism.
    """
    low, high = low[: len(here.z), None], high[: len(here.z), None]
    T, open_, unit = here.z.shape[1], np.asarray(fit.open.any(axis=1))[:, None], np.eye(len(here.z), dtype=bool)
    left = fit.missed(here)
    size, damping = (left**2).sum(axis=(0, 2)), np.full(T, 1e-2)
    for _ in range(steps):
        rates = fit.rates(here)
        Z, Y = fit.missed_rates(rates)
        rows, y, r = Z.swapaxes(0, 1), Y.sum(axis=3), left.swapaxes(0, 1)
        whole = rows.reshape(T, -1, len(here.z))
        across = (y.swapaxes(0, 1)[:, :, None] @ rows)[:, :, 0]
        own = np.where(open_, (y**2).sum(axis=2) * (1 + damping) + np.finfo(float).tiny, 1.0).T
        pull = (y * left).sum(axis=2).T
        A = whole.swapaxes(1, 2) @ whole
        g = (r.reshape(T, 1, -1) @ whole)[:, 0] - ((pull / own)[:, None] @ across)[:, 0]
        size_of = np.where(unit, A, 0.0) * damping[:, None, None]
        A += size_of + 1e-14 * unit - across.swapaxes(1, 2) @ (across / own[..., None])
        # unknowns at a bound that would leave it stay
        held = (((here.z <= low) & (g.T > 0)) | ((here.z >= high) & (g.T < 0))).T
        A = np.where(held[:, :, None] | held[:, None], unit, A)
        dz = -np.linalg.solve(A, np.where(held, 0.0, g)[..., None])[..., 0].T
        z = np.clip(here.z + dz, low, high)
        moved = np.where(open_, -(pull + (across @ (z - here.z).T[..., None])[..., 0]).T / own.T, 0.0)
        theta = here.theta + np.where(fit.open[:, :, None], moved[:, None], 0.0)
        there, came = fit.stepped(here, rates, z, theta)
        new = fit.missed(there)
        sizes = np.where(came, (new**2).sum(axis=(0, 2)), np.inf)
        better = sizes < size
        damping = np.clip(np.where(better, damping / 5, damping * 6), 1e-12, 1e12)
        size, left = np.where(better, sizes, size), np.where(better[:, None], new, left)
        here = fit.mixed(better, there, here)
    return here, size


class Trials:
    """Trial vectors of an optimizer, each carried from the last one that was kept.

    What is small is followed by ``weight`` times how far margins are below what an optimum has and a quarter more, as logarithms.
    """

    def __init__(self, fit: Fit, begin: FitPoint, weight: float = 0.0) -> None:
        self.fit, self.kept, self.last, self.weight = fit, begin, begin, weight
        self.refused = 1e3 * (1.0 + float(np.abs(self._all(begin)).max(initial=0.0)))

    def _all(self, here: FitPoint) -> Array:
        near = self.weight * np.log(np.maximum(1.25 * LEAST_MARGIN / self.fit.margins(here)[:, 0], 1.0))
        return np.concatenate([self.fit.residual(here), near])

    def at(self, v: Array) -> FitPoint | None:
        """The rows at a vector; None where they cannot be carried there."""
        for known in (self.last, self.kept):
            if np.array_equal(v, self.fit.vector(known)):
                return known
        found, came = self.fit.moved(self.kept, *self.fit.parts(v))
        if came:
            self.last = found
        return found if came else None

    def residual(self, v: Array) -> Array:
        """See ``Fit.residual``; large where the rows cannot be carried there."""
        here = self.at(v)
        return np.full(len(self.fit.asked[0]) + self.fit.rows, self.refused) if here is None else self._all(here)

    def jacobian(self, v: Array) -> Array:
        """See ``Fit.jacobian``; the vector is kept."""
        here = self.at(v)
        if here is not None:
            self.kept = here
        fit, margins = self.fit, self.fit.margins(self.kept)[:, 0]
        near, slopes = np.flatnonzero(margins < 1.25 * LEAST_MARGIN * (self.weight > 0)), np.zeros((fit.rows, len(v)))
        if near.size:
            slopes[near] = -self.weight * fit.margin_slopes(self.kept, near) / margins[near, None]
        return np.concatenate([fit.jacobian(self.kept), slopes])


Limit = tuple[Callable[[FitPoint], Array], float | None, float | None]
"""Numbers of the rows, and what they must not fall below or rise above."""


@dataclass(frozen=True)
class Fitted:
    """Optima found, the best first, and in words how they were."""

    points: tuple[FitPoint, ...]
    evidence: tuple[str, ...]


def fitted(
    fit: Fit,
    way: str | None,
    starts: int,
    bounds: Bounds,
    goal: Callable[[FitPoint], Array] | None = None,
    limits: Sequence[Limit] = (),
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
    exact: Iterable[Array] = (),
) -> Fitted:
    """The optima to which dimensions lead: the declared ones, those that do parts of the task exactly, and up to ``starts`` random ones.

    ``exact`` are values of all names. ``way``, ``goal`` and ``limits`` are those of ``constrained``.
    """
    low, high = fit.limits(bounds)
    rng, u = np.random.default_rng(seed), len(fit.z0)
    box = np.where(np.isfinite(low[:u]), low[:u], fit.z0 - 0.5), np.where(np.isfinite(high[:u]), high[:u], fit.z0 + 0.5)
    told = [fit.p.inside(values[:, None])[:, 0] for values in exact]
    tries = [fit.z0, *told, *(rng.uniform(*box) for _ in range(starts - 1 - len(told)))]
    begun, count = _best(fit, np.clip(np.transpose(tries), low[:u, None], high[:u, None]), low, high, progress)
    evolved = None if begun else _evolved(fit, *box, seed)
    begun += [] if evolved is None else [evolved]
    ends: list[FitPoint] = []
    unsafe = lost = early = 0
    wide: Limit = (lambda here: fit.margins(here)[:, 0]), LEAST_MARGIN, None
    for i, begin in enumerate(begun, 1):
        if progress is not None:
            progress(f"best start {i} of {len(begun)} to the end")
        # an optimum without a margin is none: it is looked for where it keeps one, by weights that grow from the size of what is missed
        end: FitPoint | None = begin
        for part in (0.0, 1.0, 10.0, 100.0):
            if end is not None and (fit.margins(end).min() < LEAST_MARGIN) == (part > 0):
                size = max(float(np.sqrt(np.mean(fit.residual(end) ** 2))), 1e-9)
                end = least_squares(fit, end, low, high, 200, part * size)
        narrow = end is not None and fit.margins(end).min() < LEAST_MARGIN
        kept_as_is = end is not None and all(keeps(f(end), least, most) for f, least, most in limits)
        if narrow or way != "least_squares" or not kept_as_is:
            best = begin if narrow or end is None else end
            end, came = constrained(fit, best, low, high, way, goal, [*limits, wide] if narrow else limits)
            early += end is not None and not came
        if end is None:
            lost += 1
        elif not fit.safe(end):
            unsafe += 1
        else:
            ends.append(end)

    def value(here: FitPoint) -> float:
        if way is None:
            return 0.0 if goal is None else float(goal(here).max())
        errors = fit.errors(here)
        return float(errors.max() if way == "minimax" else np.sqrt((errors**2).mean()))

    ends.sort(key=value)
    kept: list[FitPoint] = []
    for here in ends:
        # difference of dimensions, over L, up to which optima are one
        if all(np.abs(here.z - other.z).max() > 1e-3 for other in kept):
            kept.append(here)
    same = sum(abs(value(here) - value(ends[0])) <= 1e-4 * abs(value(ends[0])) + 1e-12 for here in ends) if ends else 0
    followed = (
        f"; the best {len(begun)} that differ were followed to the end, {same} of them to the best one" if begun else ""
    )
    followed = followed if evolved is None else "; the best that differential evolution finds was followed to the end"
    words = [f"{counted(count, 'start')} of {len(tries)} led to all rows{followed}."]
    if told:
        words.append(f"{counted(len(told), 'start')} of these do a part of the positions exactly.")
    if unsafe + lost:
        words.append(
            f"Left out: {unsafe} of which the path does not lead through all rows, {lost} that came to no optimum within the limits."
        )
    if early:
        words.append(f"Stopped after 100 steps, before the optimum: {early}; better ones may be near.")
    return Fitted(tuple(kept), tuple(words))


def _best(
    fit: Fit, tries: Array, low: Array, high: Array, progress: Callable[[str], None] | None
) -> tuple[list[FitPoint], int]:
    """The rows of the best mechanisms to which dimensions ``tries (u, n)`` lead, by some rows first; and how many lead to all rows."""
    # rows by which starts are compared, starts that go down together, and those whose end is sought
    coarse, together, most, found, sizes = fit.of_some(24), 64, 4, [tries[:, :0]], [np.zeros(0)]
    count = 0
    for k in range(0, tries.shape[1], together):
        here, came = coarse.begun(tries[:, k : k + together])
        here, count = coarse.taken(here, np.flatnonzero(came)), count + int(came.sum())
        # the better half goes on, with open drivers put anew where the path comes nearest
        for _ in range(4 if came.any() else 0):
            here, size = descended(coarse, here, low, high, 8)
            if coarse.open.any():
                there, came = coarse.begun(here.z)
                again = (coarse.missed(there) ** 2).sum(axis=(0, 2))
                here, size = (
                    coarse.mixed(came & (again < size), there, here),
                    np.where(came, np.minimum(size, again), size),
                )
            order = np.argsort(size, kind="stable")[: max(len(size) // 2, most)]
            here, size = coarse.taken(here, order), size[order]
        found.append(here.z)
        sizes.append((coarse.missed(here) ** 2).sum(axis=(0, 2)))
        if progress is not None:
            progress(f"{min(k + together, tries.shape[1])} of {tries.shape[1]} starts")
    z, size = np.concatenate(found, axis=1), np.concatenate(sizes)
    kept = list[int]()
    # those that differ, in L
    for i in np.argsort(size, kind="stable").tolist():
        if len(kept) < most and all(np.abs(z[:, i] - z[:, j]).max() > 1e-2 for j in kept):
            kept.append(i)
    here, came = fit.begun(z[:, kept]) if kept else (here, np.zeros(0, dtype=bool))
    if not came.any():
        return [], count
    here, _ = descended(fit, fit.taken(here, np.flatnonzero(came)), low, high, 24)
    return [fit.taken(here, np.array([i])) for i in range(here.z.shape[1])], count


def _evolved(fit: Fit, low: Array, high: Array, seed: int) -> FitPoint | None:
    """The rows of the best dimensions that differential evolution finds in a box; None where it finds none that reaches all rows."""

    def costs(Z: Array) -> Any:
        here, came = fit.begun(Z)
        return np.where(came, (fit.missed(here) ** 2).sum(axis=(0, 2)), 1e6)

    found = scipy.optimize.differential_evolution(
        costs,
        scipy.optimize.Bounds(low, high),
        vectorized=True,
        updating="deferred",
        maxiter=20,
        popsize=5,
        rng=seed,
        polish=False,
    )
    here, came = fit.begun(found.x[:, None])
    return here if came[0] else None


def least_squares(
    fit: Fit, begin: FitPoint, low: Array, high: Array, evaluations: int = 100, weight: float = 0.0
) -> FitPoint:
    """The rows with the least sum of squares to which a start leads; ``weight``: see ``Trials``."""
    here = begin
    # times that open drivers are put anew where the path comes nearest
    for _ in range(3):
        trials = Trials(fit, here, weight)
        v = np.clip(fit.vector(here), low, high)
        found = scipy.optimize.least_squares(
            trials.residual,
            v,
            trials.jacobian,
            (low, high),
            max_nfev=evaluations,
            x_scale="jac",
            xtol=1e-12,
            ftol=1e-12,
            gtol=1e-14,
        )
        here = trials.at(found.x) or trials.kept
        again, came = fit.begun(here.z) if fit.open.any() else (here, np.zeros(1, dtype=bool))
        if not came[0] or _size(fit, again) > (1 - 1e-6) * _size(fit, here):
            return here
        here = again
    return here


def _size(fit: Fit, here: FitPoint) -> float:
    return float((fit.residual(here) ** 2).sum())


def constrained(
    fit: Fit,
    begin: FitPoint,
    low: Array,
    high: Array,
    way: str | None,
    goal: Callable[[FitPoint], Array] | None,
    limits: Sequence[Limit],
) -> tuple[FitPoint | None, bool]:
    """The best rows to which a start leads under limits, by sequential quadratic programs; None where they are not kept there. Also
    whether the optimizer came to an end before it had to stop.

    ``way`` is ``"least_squares"``, ``"minimax"`` (the least slack ``s`` with ``|r_i|^2 <= s`` at every row), or None: what is asked is met,
    and the ``goal`` is as small as it can be.
    """
    course = _RowCourse(fit, begin, way, goal)
    constraints = [{"type": "ineq", "fun": f, "jac": df} for f, df in course.ends(low, high)]
    if way is None:
        # what the declared configuration meets whatever the dimensions is no condition on them
        told = np.abs(course.jacobian(course.begin)).max(axis=1) > MODES.span
        met = {"type": "eq", "fun": lambda w: course.residual(w)[told], "jac": lambda w: course.jacobian(w)[told]}
        constraints.append(met)
    if course.slack:
        constraints.append({"type": "ineq", "fun": course.slacks, "jac": course.slack_slopes})
    for f, least, most in limits:
        for sign, end in ((1.0, least), (-1.0, most)):
            if end is not None:
                constraints.append(course.limit(f, sign, end))
    aim, slope = course.aim
    found: Any = scipy.optimize.minimize(  # type: ignore[call-overload]  # the stubs know no constraints as tables
        aim, course.begin, jac=slope, constraints=constraints, method="SLSQP", options={"maxiter": 100, "ftol": 1e-12}
    )
    here = course.point(found.x)
    if way is None:  # met to rounding, where the optimizer leaves off before
        here = least_squares(fit, here, low, high, 20)
    if way is None and np.abs(fit.residual(here)).max() > 1e-9:
        return None, False
    return (here if all(keeps(f(here), least, most) for f, least, most in limits) else None), bool(found.success)


class _RowCourse:
    """Rows as functions of variables ``w``, in which what is missed changes by as much in all directions: ``v = v_0 + P w``.

    With ``J / unit = U S V^T`` at the start ``P = V S^-1``, small singular values left out of the inverse. Behind stands the slack.
    """

    def __init__(self, fit: Fit, begin: FitPoint, way: str | None, goal: Callable[[FitPoint], Array] | None) -> None:
        self.goal, self.slack = goal, way != "least_squares"
        self.fit, self.trials, self._last = fit, Trials(fit, begin), begin
        self.unit = max(float(np.abs(fit.residual(begin)).max(initial=0.0)), 1e-9)
        _, sigma, Vt = np.linalg.svd(fit.jacobian(begin) / self.unit, full_matrices=True)
        size = np.zeros(len(Vt))
        size[: len(sigma)] = sigma
        # directions in which nothing is missed are as long as the start's own unit; of others a step of a tenth of L is the longest
        scale = 1.0 / np.maximum(size, 10.0) if way is not None else np.ones(len(Vt))
        self.v, self.P = fit.vector(begin), Vt.T * scale
        w = np.zeros(len(Vt))
        self._asked = w
        self.begin = np.append(w, self._small(w).max()) if self.slack else w
        self.aim: tuple[Any, Any] = (lambda w: self.squares(w).sum()), (lambda w: self.squares_slope(w).sum(axis=0))
        if self.slack:
            self.aim = (lambda w: w[-1]), (lambda w: np.eye(len(w))[-1])

    def vector(self, w: Array) -> Array:
        """The vector of variables."""
        return self.v + self.P @ w[: len(self.v)]

    def point(self, w: Array) -> FitPoint:
        """The rows; where they cannot be carried there, as far on the way as they can."""
        if not np.array_equal(w[: len(self.v)], self._asked):
            self._asked = w[: len(self.v)].copy()
            self._last, _ = self.fit.moved(self.trials.kept, *self.fit.parts(self.vector(w)))
        return self._last

    def _padded(self, slopes: Array) -> Array:
        out: Array = slopes @ self.P
        return np.pad(out, ((0, 0), (0, 1))) if self.slack else out

    def residual(self, w: Array) -> Array:
        """What is missed."""
        return self.fit.residual(self.point(w))

    def jacobian(self, w: Array) -> Array:
        """Its derivatives."""
        self.trials.kept = self.point(w)
        return self._padded(self.fit.jacobian(self.trials.kept))

    def squares(self, w: Array) -> Array:
        """Squares of the errors of the rows."""
        squares = (self.residual(w) / self.unit) ** 2
        return np.asarray(np.bincount(self.fit.asked[0], squares, minlength=self.fit.rows), dtype=float)

    def squares_slope(self, w: Array) -> Array:
        """Their derivatives."""
        products = (2.0 / self.unit**2) * self.residual(w)[:, None] * self.jacobian(w)
        out = np.zeros((self.fit.rows, len(w)))
        np.add.at(out, self.fit.asked[0], products)
        return out

    def _small(self, w: Array) -> Array:
        """What is to be small everywhere: the goal, else the squares."""
        return self.squares(w) if self.goal is None else self.goal(self.point(w))

    def slacks(self, w: Array) -> Array:
        """How far that is below the slack."""
        return np.asarray(w[-1] - self._small(w))

    def slack_slopes(self, w: Array) -> Array:
        """Its derivatives."""
        return np.eye(len(w))[-1] - (self.squares_slope(w) if self.goal is None else self.slopes(self.goal, w))

    def slopes(self, f: Callable[[FitPoint], Array], w: Array) -> Array:
        """Central differences of numbers that have no exact derivatives; of one side where the rows come to that one alone."""
        here = self.trials.kept = self.point(w)
        v, base, step, u = self.fit.vector(here), f(here), 1e-5, len(here.z)
        out = np.zeros((len(base), len(v)))
        # one number a row: it changes with the driver of its own row alone, so that all drivers are moved at once
        row, _ = np.nonzero(self.fit.open)
        alone = len(base) == self.fit.rows
        ways = [np.eye(len(v))[k] for k in range(u if alone else len(v))]
        for k, way in enumerate([*ways, np.arange(len(v)) >= u] if alone and row.size else ways):
            sides = [self.fit.moved(here, *self.fit.parts(v + side * way)) for side in (step, -step)]
            a, b = (f(there) if came else base for there, came in sides)
            slope = (a - b) / (step * max(1, sum(came for _, came in sides)))
            if k < len(ways):
                out[:, k] = slope
            else:
                out[row, np.arange(u, len(v))] = slope[row]
        return self._padded(out)

    def limit(self, f: Callable[[FitPoint], Array], sign: float, end: float) -> dict[str, Any]:
        """A limit as the optimizer wants it."""
        return {
            "type": "ineq",
            "fun": lambda w: sign * (f(self.point(w)) - end),
            "jac": lambda w: sign * self.slopes(f, w),
        }

    def ends(self, low: Array, high: Array) -> Iterator[tuple[Any, Any]]:
        """Bounds of the vector as limits."""
        for sign, end in ((1.0, low), (-1.0, high)):
            kept = np.flatnonzero(np.isfinite(end))
            if kept.size:
                slope = self._padded(sign * np.eye(len(self.v))[kept])
                yield (
                    lambda w, sign=sign, end=end, kept=kept: sign * (self.vector(w) - end)[kept],
                    lambda w, slope=slope: slope,
                )
