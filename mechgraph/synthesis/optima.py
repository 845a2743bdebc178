"""Starts of fits and their way to optima: all together by the method of Levenberg and Marquardt, the best of them to the end.

Starts go down on some of the rows, from which drivers are eliminated one by one: each acts on its own row. The best of them are followed to
the end on all rows.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
import scipy

from mechgraph.errors import DeclarationError, MechgraphWarning, counted
from mechgraph.kinematics.prescribed import driven
from mechgraph.kinetostatics import transmission_index, with_unit_effort
from mechgraph.maths.se3 import Array, Index, Mask
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.outcome import Options
from mechgraph.synthesis.answers import ComplexSyntheses, Syntheses
from mechgraph.synthesis.fitness import Measure, fitnesses, keeps
from mechgraph.synthesis.fits import LEAST_MARGIN, Bounds, Fit, FitPoint
from mechgraph.synthesis.system import RowProblem
from mechgraph.variants.numbers import ItemField, varied
from mechgraph.variants.work import quantity, solve_together


ACC = True

def descended(
    fit: Fit, here: FitPoint, low: Array, high: Array, steps: int, weight: Array | None = None
) -> tuple[FitPoint, Array]:
    """The rows of mechanisms on their way to the least sums of squares, some steps on; and these sums ``(T,)``.

    With ``J = [Z Y]`` by the unknowns and the drivers ``Y^T Y`` is diagonal, as a driver acts on its own row: the unknowns are those of
    ``(Z^T Z + m D - Z^T Y (Y^T Y)^-1 Y^T Z) dz``, ``D`` the diagonal of ``Z^T Z``, the damping ``m`` one for each mechanism.

    What is missed is followed by a ``weight (T,)`` times how far margins are below what an optimum has and a quarter more, as logarithms.
    """
    low, high = low[: len(here.z), None], high[: len(here.z), None]
    T, open_, unit = here.z.shape[1], np.asarray(fit.open.any(axis=1))[:, None], np.eye(len(here.z), dtype=bool)
    weight = np.zeros(T) if weight is None else weight
    left = _left(fit, here, weight)
    size, damping, quiet = (left**2).sum(axis=(0, 2)), np.full(T, 1e-2), np.zeros(T, dtype=np.intp)
    for _ in range(steps):
        rates = fit.rates(here)
        Z, y = _left_rates(fit, here, rates, weight)
        rows = Z.swapaxes(0, 1)
        whole = rows.reshape(T, -1, len(here.z))
        across = (y.swapaxes(0, 1)[:, :, None] @ rows)[:, :, 0]
        own = np.where(open_, (y**2).sum(axis=2) * (1 + damping) + np.finfo(float).tiny, 1.0).T
        A = whole.swapaxes(1, 2) @ whole
        scale = np.where(unit, A, 0.0).max(axis=1) + 1e-14
        A += unit * (scale * damping[:, None])[:, None] - across.swapaxes(1, 2) @ (across / own[..., None])

        def way(r: Array, z: Array) -> tuple[Array, Array]:
            """By how much unknowns and open drivers change to make ``r (n, T, k)`` least; unknowns at a bound that would leave it stay."""
            pull = (y * r).sum(axis=2).T
            g = (r.swapaxes(0, 1).reshape(T, 1, -1) @ whole)[:, 0] - ((pull / own)[:, None] @ across)[:, 0]
            held = (((z <= low) & (g.T > 0)) | ((z >= high) & (g.T < 0))).T
            dz = -np.linalg.solve(
                np.where(held[:, :, None] | held[:, None], unit, A), np.where(held, 0.0, g)[..., None]
            )[..., 0].T
            dz = np.clip(z + dz, low, high) - z
            return dz, np.where(open_, -(pull + (across @ dz.T[..., None])[..., 0]).T / own.T, 0.0)

        dz, dt = way(left, here.z)
        ahead = np.where(fit.open[:, :, None], 1.0, 0.0)
        if ACC:
            h = 0.1
            there, came = fit.stepped(here, rates, here.z + h * dz, here.theta + ahead * (h * dt)[:, None])
            along = (rows @ dz.T[:, None, :, None])[..., 0].swapaxes(0, 1) + y * dt[..., None]
            bend = 2 / h * ((_left(fit, there, weight) - left) / h - along)
            az, at = way(np.where(came[:, None], bend, 0.0), here.z)
            short = (scale * az.T**2).sum(axis=1) < 0.5 * (scale * dz.T**2).sum(axis=1)
            curved = fit.p.system.difference(there.x, here.x) - h * fit.moves(rates, dz, ahead * dt[:, None])
            dz, dt = dz + np.where(short, 0.5 * az, 0.0), dt + np.where(short, 0.5 * at, 0.0)
        z = np.clip(here.z + dz, low, high)
        there, came = fit.stepped(here, rates, z, here.theta + ahead * dt[:, None], np.where(came & short, curved / h**2, 0.0))
        new = _left(fit, there, weight)
        sizes = np.where(came, (new**2).sum(axis=(0, 2)), np.inf)
        better = sizes < size
        damping = np.clip(np.where(better, damping / 5, damping * 6), 1e-12, 1e12)
        # a few steps by which little is gained, or none that gains
        quiet = np.where(better & (sizes < (1 - 1e-5) * size), 0, quiet + 1)
        size, left = np.where(better, sizes, size), np.where(better[:, None], new, left)
        here = fit.mixed(better, there, here)
        if (quiet > 8).all():
            break
    return here, (fit.missed(here) ** 2).sum(axis=(0, 2))


def _left(fit: Fit, here: FitPoint, weight: Array) -> Array:
    """What is missed ``(n, T, k + 1)``, and what is to be added for margins."""
    near = np.zeros(here.x.shape[1:])
    if weight.any():
        near = weight * np.log(np.maximum(fit.wide / fit.margins(here, fit.wide), 1.0))
    return np.concatenate([fit.missed(here), near[..., None]], axis=2)


def _left_rates(fit: Fit, here: FitPoint, rates: tuple[Array, Array], weight: Array) -> tuple[Array, Array]:
    """Its derivatives by the unknowns ``(n, T, k + 1, u)``, and by the driver of the row ``(n, T, k + 1)`` where it is open."""
    Z, Y = fit.missed_rates(rates)
    Z, Y = (np.concatenate([v, np.zeros((*v.shape[:2], 1, v.shape[3]))], axis=2) for v in (Z, Y))
    if weight.any():
        margins = fit.margins(here, fit.wide)
        rows, which = np.nonzero((margins < fit.wide) & (weight > 0))
        if rows.size:
            by = -(weight[which] / margins[rows, which])[:, None]
            by_z, by_theta = fit.margin_slopes(here, rows, which, rates)
            Z[rows, which, -1], Y[rows, which, -1] = by * by_z, by * np.where(fit.open[rows], by_theta, 0.0)
    return Z, Y.sum(axis=3)


def settled(fit: Fit, here: FitPoint, low: Array, high: Array) -> FitPoint:
    """The rows of mechanisms at optima of sums of squares with margins, as far as they come there.

    An optimum without a margin is none: margins have weights, from the size of what is missed on, that grow until they are kept.
    """
    size, part = (fit.missed(here) ** 2).sum(axis=(0, 2)), np.full(here.z.shape[1], 10.0)
    # rounds after which an optimum is not sought any further
    for _ in range(8):
        weight = part * np.maximum(np.sqrt(size / max(len(fit.asked[0]), 1)), 1e-9)
        here, new = descended(fit, here, low, high, 40, weight)
        gained = new < 0.6 * size
        if fit.open.any() and not gained.any():
            # open drivers are put anew where the path comes nearest
            there, came = fit.begun(here.z)
            again = (fit.missed(there) ** 2).sum(axis=(0, 2))
            better = came & (again < (1 - 1e-6) * new)
            here, new, gained = fit.mixed(better, there, here), np.where(better, again, new), better
        narrow = fit.margins(here, LEAST_MARGIN).min(axis=0) < LEAST_MARGIN
        # what comes to the same, or stays far behind the best one, goes no further
        kept = _different(here.z, new, 16.0 * new.min())
        here, part, size = fit.taken(here, kept), np.where(narrow, 10.0 * part, part)[kept], new[kept]
        if not (gained | narrow)[kept].any():
            break
    return here


def _different(z: Array, size: Array, most: float) -> Index:
    """Which of mechanisms ``z (u, T)`` differ and are not above a size, the best first."""
    kept = list[int]()
    for i in np.argsort(size, kind="stable").tolist():
        # in L
        if size[i] <= most and all(np.abs(z[:, i] - z[:, j]).max() > 1e-2 for j in kept):
            kept.append(i)
    return np.array(kept, dtype=np.intp)


@dataclass(frozen=True)
class Limit:
    """Numbers ``of (k, T)`` the rows of mechanisms, which must not fall below the ``least`` or rise above the ``most``.

    ``by_drivers``: whether they change with the open drivers of rows.
    """

    of: Callable[[FitPoint], Array]
    least: float | None = None
    most: float | None = None
    by_drivers: bool = True

    def kept(self, here: FitPoint) -> bool:
        """Whether the rows of a mechanism keep it."""
        return keeps(self.of(here), self.least, self.most)


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
    goal: Limit | None = None,
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
    wide = Limit(fit.margins, LEAST_MARGIN, None)
    for i, begin in enumerate(begun, 1):
        if progress is not None:
            progress(f"best start {i} of {len(begun)} to the end")
        end: FitPoint | None = begin
        narrow = fit.margins(begin).min() < LEAST_MARGIN
        if narrow or way != "least_squares" or not all(limit.kept(begin) for limit in limits):
            end, came = constrained(fit, begin, low, high, way, goal, [*limits, wide] if narrow else limits)
            early += end is not None and not came
        if end is None:
            lost += 1
        elif not fit.safe(end):
            unsafe += 1
        else:
            ends.append(end)

    def value(here: FitPoint) -> float:
        if way is None:
            return 0.0 if goal is None else float(goal.of(here).max())
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
    coarse, together, most, found, sizes = fit.of_some(20), 64, 4, [tries[:, :0]], [np.zeros(0)]
    count = 0
    for k in range(0, tries.shape[1], together):
        here, came = coarse.begun(tries[:, k : k + together])
        here, count = coarse.taken(here, np.flatnonzero(came)), count + int(came.sum())
        # the better half goes on, with open drivers put anew where the path comes nearest
        for n in (3, 6, 10, 16) if came.any() else ():
            here, size = descended(coarse, here, low, high, n)
            if coarse.open.any() and n > 3:
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
    kept = _different(z, size, np.inf)[:most]
    here, came = fit.begun(z[:, kept]) if kept.size else (here, np.zeros(0, dtype=bool))
    if not came.any():
        return [], count
    here = settled(fit, fit.taken(here, np.flatnonzero(came)), low, high)
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


def constrained(
    fit: Fit,
    begin: FitPoint,
    low: Array,
    high: Array,
    way: str | None,
    goal: Limit | None,
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
    for limit in limits:
        for sign, end in ((1.0, limit.least), (-1.0, limit.most)):
            if end is not None:
                constraints.append(course.limit(limit, sign, end))
    aim, slope = course.aim
    found: Any = scipy.optimize.minimize(  # type: ignore[call-overload]  # the stubs know no constraints as tables
        aim, course.begin, jac=slope, constraints=constraints, method="SLSQP", options={"maxiter": 100, "ftol": 1e-12}
    )
    here = course.point(found.x)
    if way is None:  # met to rounding, where the optimizer leaves off before
        here, _ = descended(fit, here, low, high, 20)
    if way is None and np.abs(fit.residual(here)).max() > 1e-9:
        return None, False
    return (here if all(limit.kept(here) for limit in limits) else None), bool(found.success)


class _RowCourse:
    """Rows as functions of variables ``w``, in which what is missed changes by as much in all directions: ``v = v_0 + P w``.

    With ``J / unit = U S V^T`` at the start ``P = V S^-1``, small singular values left out of the inverse. Behind stands the slack.
    """

    step = 1e-5
    """Of differences, in variables of the vector."""

    def __init__(self, fit: Fit, begin: FitPoint, way: str | None, goal: Limit | None) -> None:
        self.goal, self.slack = goal, way != "least_squares"
        self.fit, self.kept, self._last = fit, begin, begin
        self._known, self._near = dict[Limit, tuple[FitPoint, Array]](), (None, 0, None)
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
            self._last, _ = self.fit.moved(self.kept, *self.fit.parts(self.vector(w)))
        return self._last

    def _padded(self, slopes: Array) -> Array:
        out: Array = slopes @ self.P
        return np.pad(out, ((0, 0), (0, 1))) if self.slack else out

    def residual(self, w: Array) -> Array:
        """What is missed."""
        return self.fit.residual(self.point(w))

    def jacobian(self, w: Array) -> Array:
        """Its derivatives."""
        self.kept = self.point(w)
        return self._padded(self.fit.jacobian(self.kept))

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
        return self.squares(w) if self.goal is None else self.values(self.goal, w)

    def slacks(self, w: Array) -> Array:
        """How far that is below the slack."""
        return np.asarray(w[-1] - self._small(w))

    def slack_slopes(self, w: Array) -> Array:
        """Its derivatives."""
        return np.eye(len(w))[-1] - (self.squares_slope(w) if self.goal is None else self.slopes(self.goal, w))

    def values(self, limit: Limit, w: Array) -> Array:
        """Numbers ``(k,)`` of the rows."""
        here = self.point(w)
        if self._known.get(limit, (None,))[0] is not here:
            self._known[limit] = here, limit.of(here)[:, 0]
        return self._known[limit][1]

    def slopes(self, limit: Limit, w: Array) -> Array:
        """Central differences of numbers that have no exact derivatives; of one side where the rows come to that one alone."""
        here = self.kept = self.point(w)
        base, (row, _), u = self.values(limit, w), np.nonzero(self.fit.open), len(here.z)
        # one number a row: it changes with the driver of its own row alone, so that all drivers are moved at once
        alone = len(base) == self.fit.rows
        more = (1 if alone else row.size) if limit.by_drivers and row.size else 0
        there, came = self._beside(here, u + more)
        values = np.where(came, limit.of(there), base[:, None]).reshape(len(base), 2, -1)
        slope = (values[:, 0] - values[:, 1]) / (self.step * np.maximum(came.reshape(2, -1).sum(axis=0), 1))
        out = np.zeros((len(base), len(self.v)))
        if more and alone:
            out[row, np.arange(u, len(self.v))] = slope[row, u]
            out[:, :u] = slope[:, :u]
        else:
            out[:, : u + more] = slope
        return self._padded(out)

    def _beside(self, here: FitPoint, n: int) -> tuple[FitPoint, Mask]:
        """Rows a step away from others along the first ``n`` variables of the vector, the last way along all that are left; which came."""
        if self._near[0] is not here or self._near[1] != n:
            ways, u, theta = np.eye(len(self.v))[:n], len(here.z), np.repeat(here.theta, 2 * n, axis=2)
            ways[u:, n - 1 :] = 1.0 if n == u + 1 else ways[u:, n - 1 :]
            dv = self.step * np.concatenate([ways, -ways]).T
            theta[self.fit.open] += dv[u:]
            self._near = here, n, self.fit.stepped(here, self.fit.rates(here), here.z + dv[:u], theta)
        return self._near[2]

    def limit(self, limit: Limit, sign: float, end: float) -> dict[str, Any]:
        """A limit as the optimizer wants it."""
        return {
            "type": "ineq",
            "fun": lambda w: sign * (self.values(limit, w) - end),
            "jac": lambda w: sign * self.slopes(limit, w),
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


class FittedSynthesis:
    """What a fit asks, and its answers."""

    def __init__(self, problem: RowProblem, tasks: Any, over: Any, driver: str | None, output: str | None) -> None:
        self.problem, self.over, self.driver, self.output = problem, over, driver, output
        # exact ones come back in their own frames; the error of a place is that of the origin of its frame, which is another one here
        if elsewhere := list(self.problem.first.poses):
            first = f"the first pose of {', '.join(map(repr, elsewhere))} is not the identity"
            raise DeclarationError(
                self.problem.name, [f"{first}: a fit begins there; measure its poses from the first one"]
            )
        self.fit = Fit(self.problem, tasks)

    def rows(self, here: FitPoint) -> tuple[Mechanism, Array]:
        """The mechanism of fitted rows, and its coordinates ``(rows, F)``."""
        p = self.problem
        q = p.system.coordinates_of(here.x[..., 0]).T[:, : len(p.m.freedom_names())]
        m = p.unknowns.mechanism(p.outside(here.z)[:, 0])
        return m.replace(start=dict(zip(m.freedom_names(), q[0].tolist(), strict=True))), q

    def limit(self, what: Any, least: float | None = None, most: float | None = None, sign: float = 1.0) -> Limit:
        """A quantity of fitted rows, times a sign; where it has no value one that keeps no limit."""
        measure = what if isinstance(what, Measure) else Measure(self.problem.m, what, self.over)
        of = partial(self._measured, measure, sign, -1e3 if least is not None else 1e3, least is None and sign > 0)
        return Limit(of, least, most, not (measure.of_dimensions or self.over))

    def _measured(self, measure: Measure, sign: float, none: float, smooth: bool, here: FitPoint) -> Array:
        """A quantity ``(k, T)`` of mechanisms."""
        values = self._together(measure, here)
        if values is None:
            each = (self.rows(self.fit.taken(here, np.array([i]))) for i in range(here.z.shape[1]))
            values = np.stack([measure(m, q, self.driver, smooth) for m, q in each], axis=1)
        return np.nan_to_num(sign * values, nan=none)

    def _together(self, measure: Measure, here: FitPoint) -> Array | None:
        """A quantity of mechanisms side by side, near the first of them; None where it has to be taken of each alone."""
        p, u, what = self.problem, self.problem.unknowns, measure.output or measure.what
        alone = {name: f.what for name, f in u.fields.items() if isinstance(f, ItemField) and f.one_by_one}
        # the place of a named point matters to what is said of it alone
        unread = {n for n, of in alone.items() if of == "links" and not str(what).startswith(n.rpartition(".")[0])}
        if here.z.shape[1] == 1 or measure.of_dimensions or callable(what) or alone.keys() - unread:
            return None
        m, q = self.rows(self.fit.taken(here, np.zeros(1, dtype=np.intp)))
        own = {name: f for name, f in u.fields.items() if name not in alone}
        values = p.outside(here.z)[[name in own for name in u.names]]
        motions, names = dict(self.over or {}), p.m.freedom_names()
        if not motions and self.driver is not None:
            every = p.system.coordinates_of(here.x.reshape(len(here.x), -1)).reshape(-1, *here.x.shape[1:])
            motions = {self.driver: every[names.index(p.m.full_name(self.driver))].T}
        m = with_unit_effort(m, what) if measure.output else m
        options = Options(redundant="minimum_norm" if measure.output else "nan")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MechgraphWarning)
            _, given = driven(m, {name: np.atleast_2d(v) for name, v in motions.items()})
            found = solve_together(
                lambda part, which: varied(m, own, values[:, :1] + part * (values[:, which] - values[:, :1])),
                here.z.shape[1],
                given,
                options,
            )
            if found.solution is None or found.alone.any():
                return None
            if measure.output:
                told = np.arcsin(transmission_index(found.solution, what, tuple(given)))
            else:
                told = quantity(found.solution, what, what)
        return np.asarray(told).reshape(here.z.shape[1], -1).T

    def answer(self, found: Fitted) -> Syntheses:
        """The optima found, the best first."""
        p, points = self.problem, found.points
        made = [self.rows(here) for here in points]
        errors = [float(self.fit.errors(here).max(initial=0.0)) for here in points]
        shape = (self.fit.rows, len(p.m.links), 4, 4)
        closed = [float(np.abs(here.at.residual).max(initial=0.0)) for here in points]
        return Syntheses(
            p.first.declared,
            tuple(m for m, _ in made),
            p.unknowns.names,
            np.array([p.outside(here.z)[:, 0] for here in points]).reshape(len(points), len(p.unknowns.names)),
            np.array([p.first.poses_of(here.at.here) for here in points]).reshape(-1, *shape),
            np.array([q for _, q in made]).reshape(len(made), self.fit.rows, len(p.m.freedom_names())),
            np.array(closed),
            ComplexSyntheses(np.zeros((0, len(p.unknowns.names)))),
            None,
            (),
            0,
            "searched",
            found.evidence,
            np.array([1.0 / self.fit.margins(here).min() for here in points]),
            tuple(fitnesses([m for m, _ in made], np.array([q for _, q in made]), self.driver, self.output, errors)),
            driver=self.driver,
        )
