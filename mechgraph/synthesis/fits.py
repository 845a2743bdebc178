"""Fits: mechanisms that come as near as they can to more than they can do, or do it exactly and are best in something else.

At every row the coordinates are an implicit function of the unknown dimensions and of the driver, ``F(z, theta, q(z, theta)) = 0``, so

    dq/dz = -F_q^-1 F_z,    dq/dtheta = -F_q^-1 F_theta

are exact. What is asked of drivers is met; where nothing is, the driver of the row is an unknown of its own, so that errors are distances
from curves, not from samples of them. Rows keep to the branch of the first one: a trial on which the determinant of ``F_q`` changes its
sign at a row is refused, and of what is found the path follower of ``solve`` has to lead from row to row.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from mechgraph.errors import DeclarationError, counted, listed
from mechgraph.kinematics.motion_path import DriverPath, Request
from mechgraph.kinematics.reach import follow
from mechgraph.kinematics.solver import closure_solver, engine_for
from mechgraph.maths.linear import complement
from mechgraph.maths.se3 import Array, Index, Mask
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.synthesis.fitness import keeps
from mechgraph.synthesis.system import ArrowRows, RowProblem
from mechgraph.synthesis.tasks import FunctionTask

LEAST_MARGIN = 1e-3
"""Least margin of rows on the way (see ``Fit.margins``); an optimum has twenty times that."""
Bounds = Mapping[str, tuple[float | None, float | None]]
"""Ends of unknowns by name."""


@dataclass(frozen=True)
class FitPoint:
    """Closed rows: unknowns ``z (u,)`` and drivers ``theta (n, d)`` in internal units, states ``x (nx, n)``, and their equations."""

    z: Array
    theta: Array
    x: Array
    at: ArrowRows


class Fit:
    """What is asked of a mechanism as numbers that are to be small: one per row and coordinate that no driver has.

    Attributes
    ----------
    drivers : Index
        Their columns ``(d,)``.
    theta, open : (n, d) arrays
        Values of the drivers, and which are unknown.
    wanted : (n, k) array
        Values of the other coordinates asked ``others (k,)``, NaN where nothing is; times ``factors`` where these are unknown.
    """

    def __init__(self, problem: RowProblem, tasks: Any) -> None:
        self.p, s = problem, problem.system
        if problem.rates:
            told = "rates (velocities, accelerations, twists) are met exactly or not at all; leave them out of a fit"
            raise DeclarationError(problem.name, [told])
        # a fit need not begin exactly where its first row asks it to
        problem.known.clear()
        self.drivers = self._drivers(tasks)
        self.free = complement(self.drivers, s.n_freedoms)
        self.rows = len(problem.asked)
        x = problem.at_rest[:, None]
        place = {column: j for j, column in enumerate(problem.columns.tolist())}
        self.theta = np.repeat(x[s.single_rows[self.drivers]].T, self.rows, axis=0)
        self.open = np.ones(self.theta.shape, dtype=bool)
        for j, column in enumerate(self.drivers.tolist()):
            if column in place:
                asked = problem.asked[:, place[column]]
                self.open[:, j] = np.isnan(asked)
                self.theta[:, j] = np.where(np.isnan(asked), self.theta[:, j], asked)
        if problem.closed_at_start:
            self.open[0] = False
        kept = [j for column, j in place.items() if column not in self.drivers]
        self.others: Index = problem.columns[kept]
        self.wanted, self.factor_of = problem.asked[:, kept], problem.factor_of[kept]
        self._check(x)

    def _drivers(self, tasks: Any) -> Index:
        """Columns of freedoms with given values: inputs of functions, those with timing, then the drives."""
        m, whole = self.p.m, self.p.whole
        given = tasks if isinstance(tasks, list | tuple) else [tasks]
        named = [t.input for t in given if isinstance(t, FunctionTask)] + [
            n for t in given for n in getattr(t, "at", ())
        ]
        names = list(dict.fromkeys(m.full_name(n) for n in [*named, *(d.freedom for d in m.drives)]))
        return np.array([whole.freedom_names().index(name) for name in names], dtype=np.intp)

    def _check(self, x: Array) -> None:
        """Refuse what drivers do not determine, and what cannot be fitted."""
        faults, at = [], self._equations(self.z0, np.repeat(x, self.rows, axis=1))
        J = at.by_coordinates[0, :, :, 0]
        left = scipy.linalg.null_space(J[:, self.free], MODES.generic)
        self.rank = len(self.free) - left.shape[1]
        loose = self.free[np.abs(left).max(axis=1, initial=0.0) > MODES.span]
        names = self.p.whole.freedom_names()
        if loose.size and np.isin(loose, self.others).any():
            faults.append(
                f"the drivers leave {listed(names[k] for k in loose)} open; declare drives that move the rest"
            )
        if len(self.drivers) > 1 and self.open.any():
            faults.append("several drivers without timing: give their values at all rows, e.g. mg.path(..., at={...})")
        if not np.isfinite(self.wanted).any():
            faults.append("nothing is asked beside values of drivers")
        if self.p.unknowns.others:
            faults.append(f"unknown {listed(self.p.unknowns.others)}: only points and directions can be fitted")
        if faults:
            raise DeclarationError(self.p.name, faults)

    @cached_property
    def z0(self) -> Array:
        """The declared dimensions."""
        return self.p.inside(self.p.unknowns.declared[:, None])[:, 0]

    def _equations(self, z: Array, x: Array) -> ArrowRows:
        numbers = self.p.numbers.with_values(self.p.places, z[:, None])
        return self.p.equations(numbers, x.T[:, :, None])

    # --- closing ---------------------------------------------------------------------------------------------------------

    def closed(self, z: Array, theta: Array, x: Array) -> FitPoint | None:
        """Rows closed from states near by; None where Newton's method does not come to an end there."""
        s = self.p.system
        x = x.copy()
        x[s.single_rows[self.drivers]] = theta.T
        # steps of Newton's method, the largest of them, and what may be left open
        for _ in range(12):
            at = self._equations(z, x)
            left = at.residual[:, :, 0]
            if np.abs(left).max(initial=0.0) < 1e-12:
                return FitPoint(z, theta, x, at)
            dq = np.zeros((s.n_freedoms, self.rows))
            dq[self.free] = -(self._inverse(at) @ left[:, :, None])[:, :, 0].T
            if not np.abs(dq).max() < 1.0:
                return None
            x = s.advance(x, dq)
        return None

    def _inverse(self, at: ArrowRows) -> Array:
        return np.asarray(np.linalg.pinv(at.by_coordinates[:, :, self.free, 0], 1e-9), dtype=float)

    def rates(self, here: FitPoint) -> tuple[Array, Array]:
        """``dq/dz (n, F, u)`` and ``dq/dtheta (n, F, d)``."""
        inverse, F = self._inverse(here.at), self.p.system.n_freedoms
        by_z, by_theta = np.zeros((self.rows, F, len(here.z))), np.zeros((self.rows, F, len(self.drivers)))
        by_z[:, self.free] = -inverse @ here.at.by_unknowns[..., 0]
        by_theta[:, self.free] = -inverse @ here.at.by_coordinates[:, :, self.drivers, 0]
        by_theta[:, self.drivers] = np.eye(len(self.drivers))
        return by_z, by_theta

    def moved(self, here: FitPoint, z: Array, theta: Array) -> tuple[FitPoint, bool]:
        """Rows carried to other dimensions and drivers, in one step or in several; where a row would leave its branch as far as before."""
        at = here
        for parts in (1, 8):
            at = here
            for k in range(1, parts + 1):
                by_z, by_theta = self.rates(at)
                z1, theta1 = here.z + (z - here.z) * k / parts, here.theta + (theta - here.theta) * k / parts
                dq = by_z @ (z1 - at.z) + (by_theta @ (theta1 - at.theta)[:, :, None])[:, :, 0]
                # the longest step (radians, lengths over L) of a row that may be predicted
                near = np.abs(dq).max() < 1.0
                new = self.closed(z1, theta1, self.p.system.advance(at.x, dq.T)) if near else None
                if new is None or (self._sides(new) != self._sides(at)).any() or self.margins(new).min() < LEAST_MARGIN:
                    break
                at = new
            else:
                return at, True
        return at, False

    def _sides(self, here: FitPoint) -> Array:
        """Signs of the determinants of ``F_q`` at the rows, where it has one."""
        J = here.at.by_coordinates[:, :, self.free, 0]
        return np.asarray(np.linalg.slogdet(J)[0] if J.shape[1] == J.shape[2] else np.ones(self.rows))

    def margins(self, here: FitPoint) -> Array:
        """How far rows ``(n,)`` are from folds, and links from having no length: least singular value of ``F_q`` over its largest."""
        size = np.linalg.svd(here.at.by_coordinates[:, :, self.free, 0], compute_uv=False)
        return np.asarray(size[:, self.rank - 1] / size[:, 0])

    # --- the path follower -----------------------------------------------------------------------------------------------

    def led(self, z: Array, theta: Array, x: Array) -> tuple[Array, Mask]:
        """States ``(nx, n)`` at driver values ``(n, d)`` to which the path leads from a closed state ``x (nx,)``; which it reached."""
        numbers = self.p.numbers.with_values(self.p.places, z[:, None])
        system = self.p.system_with(numbers)
        solver = closure_solver(engine_for(system.n_rows, 1, "auto"), self.drivers)
        found = follow(
            DriverPath(system, solver, system.cases), [Request(x, 0, theta.T, np.arange(len(theta)))], len(theta)
        )
        return found.x, found.moved

    def begun(self, z: Array) -> FitPoint | None:
        """The rows of a mechanism: open drivers where its path comes nearest to what is asked; None where it does not reach them all."""
        first = self.closed(
            z, np.repeat(self.theta[:1], self.rows, axis=0), np.repeat(self.p.at_rest[:, None], self.rows, axis=1)
        )
        if first is None:
            return None
        theta, x = self.theta.copy(), first.x[:, 0]
        if self.open.any():
            s, begin = self.p.system, self.theta[0, 0]
            turn = s.periods[self.drivers[0]]
            reach = turn if np.isfinite(turn) else MODES.slide_stroke
            # places on the way to either end at which the path is compared with what is asked
            ways = begin + reach * np.linspace(-1.0, 1.0, 181)
            states, came = self.led(z, ways[:, None], x)
            ways, states = ways[came], states[:, came]
            apart = self._coordinates(states)[:, None] - self.wanted * self._factors(z)
            far = np.nansum(self._wrapped(apart) ** 2, axis=2)
            nearest = ways[np.argmin(far, axis=0)]
            theta[:, 0] = np.where(self.open[:, 0], nearest, theta[:, 0])
        states, came = self.led(z, theta, x)
        return self.closed(z, theta, states) if came.all() else None

    def safe(self, here: FitPoint) -> bool:
        """Whether the path leads from the first row to all others."""
        states, came = self.led(here.z, here.theta, here.x[:, 0])
        if not came.all():
            return False
        apart = self.p.system.difference(states, here.x)
        settled = np.isin(np.arange(len(apart)), self.others)
        return bool(np.abs(self._wrapped(apart[settled].T)).max(initial=0.0) < MODES.arrives)

    # --- what is to be small ---------------------------------------------------------------------------------------------

    def _coordinates(self, x: Array) -> Array:
        """Coordinates ``(n, k)`` of what is asked."""
        return x[self.p.system.single_rows[self.others]].T

    def _wrapped(self, apart: Array) -> Array:
        """Differences ``(..., k)`` without whole turns."""
        period = self.p.system.periods[self.others]
        turning = np.isfinite(period)
        period = np.where(turning, period, 1.0)
        return np.asarray(apart - turning * period * np.round(apart / period))

    @cached_property
    def asked(self) -> tuple[Index, Index]:
        """Rows and coordinates of what is asked."""
        return np.nonzero(np.isfinite(self.wanted))  # type: ignore[return-value]

    def _factors(self, z: Array) -> Array:
        """By what ``(k,)`` that which is asked is multiplied."""
        scaled = self.factor_of >= 0
        out = np.ones(len(scaled))
        out[scaled] = z[len(z) - self.factor_of.max(initial=-1) - 1 :][self.factor_of[scaled]]
        return out

    def residual(self, here: FitPoint) -> Array:
        """By how much each is missed."""
        return self._wrapped(self._coordinates(here.x) - self.wanted * self._factors(here.z))[self.asked]

    def jacobian(self, here: FitPoint) -> Array:
        """Its derivatives by the unknowns and the open drivers."""
        by_z, by_theta = self.rates(here)
        row, k = self.asked
        column = self.others[k]
        out, u = [by_z[row, column].copy()], len(here.z)
        for i in np.flatnonzero(self.factor_of[k] >= 0):
            out[0][i, u - self.factor_of.max() - 1 + self.factor_of[k[i]]] -= self.wanted[row[i], k[i]]
        for i, j in np.argwhere(self.open):
            out.append(np.where(row == i, by_theta[row, column, j], 0.0)[:, None])
        return np.concatenate(out, axis=1)

    @cached_property
    def unit(self) -> float:
        """The unit of errors: L where any length is asked, else radians."""
        return self.p.L if self.p.system.is_length[self.others].any() else 1.0

    def errors(self, here: FitPoint) -> Array:
        """Distances ``(n,)`` from what is asked at the rows, angles as arcs of radius L beside lengths."""
        squares = np.bincount(self.asked[0], self.residual(here) ** 2, minlength=self.rows)
        return self.unit * np.sqrt(squares)

    # --- as a vector -------------------------------------------------------------------------------------------------------

    def vector(self, here: FitPoint) -> Array:
        """Unknowns and open drivers ``(v,)``."""
        return np.concatenate([here.z, here.theta[self.open]])

    def parts(self, v: Array) -> tuple[Array, Array]:
        """``z`` and ``theta`` of a vector."""
        theta = self.theta.copy()
        u = len(self.z0)
        theta[self.open] = v[u:]
        return v[:u], theta

    def limits(self, bounds: Bounds) -> tuple[Array, Array]:
        """Lower and upper ends of a vector."""
        low, high = np.full(len(self.z0), -np.inf), np.full(len(self.z0), np.inf)
        for k, name in enumerate(self.p.unknowns.names):
            a, b = bounds.get(name, (None, None))
            low[k], high[k] = -np.inf if a is None else a, np.inf if b is None else b
        low, high = (self.p.inside(end[:, None])[:, 0] for end in (low, high))
        rest = np.full(int(self.open.sum()), np.inf)
        return np.concatenate([low, -rest]), np.concatenate([high, rest])


class Trials:
    """Trial vectors of an optimizer, each carried from the last one that was kept."""

    def __init__(self, fit: Fit, begin: FitPoint) -> None:
        self.fit, self.kept, self.last = fit, begin, begin
        self.refused = 1e3 * (1.0 + float(np.abs(fit.residual(begin)).max(initial=0.0)))

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
        return np.full(len(self.fit.asked[0]), self.refused) if here is None else self.fit.residual(here)

    def jacobian(self, v: Array) -> Array:
        """See ``Fit.jacobian``; the vector is kept."""
        here = self.at(v)
        if here is not None:
            self.kept = here
        return self.fit.jacobian(self.kept)


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

    ``exact`` are values of all names.
    ``way``, ``goal`` and ``limits`` are those of ``constrained``. All starts are followed a few steps, the best of them to the end.
    """
    low, high = fit.limits(bounds)
    rng, u = np.random.default_rng(seed), len(fit.z0)
    box = np.where(np.isfinite(low[:u]), low[:u], fit.z0 - 0.5), np.where(np.isfinite(high[:u]), high[:u], fit.z0 + 0.5)
    begun: list[FitPoint] = []
    told = [fit.p.inside(values[:, None])[:, 0] for values in exact]
    tries = [fit.z0, *told, *(rng.uniform(*box) for _ in range(starts - 1 - len(told)))]
    for tried, z in enumerate(tries, 1):
        here = fit.begun(np.clip(z, low[:u], high[:u]))
        if here is not None:
            begun.append(least_squares(fit, here, low, high, 12))
        if progress is not None:
            progress(f"start {tried} of {len(tries)}")
    if not begun and (evolved := _evolved(fit, *box, seed)) is not None:
        begun.append(evolved)
    order = sorted(range(len(begun)), key=lambda i: _size(fit, begun[i]))
    ends: list[FitPoint] = []
    unsafe = lost = early = 0
    wide: Limit = fit.margins, 20 * LEAST_MARGIN, None
    # the best starts, which are followed to the end
    for i in order[:4]:
        end: FitPoint | None = least_squares(fit, begun[i], low, high, 200)
        narrow = end is not None and fit.margins(end).min() < 20 * LEAST_MARGIN
        if narrow or way != "least_squares" or limits:
            # an optimum without a margin is none: it is looked for again where it keeps one
            best = begun[i] if narrow or end is None else end
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
    words = [
        f"{counted(len(begun), 'start')} of {len(tries)} led to all rows; the best {min(4, len(begun))} were followed to the end, "
        f"{same} of them to the best one."
    ]
    if told:
        words.append(f"{counted(len(told), 'start')} of these do a part of the positions exactly.")
    if unsafe + lost:
        words.append(
            f"Left out: {unsafe} of which the path does not lead through all rows, {lost} without an end within the limits."
        )
    if early:
        words.append(f"Stopped after 100 steps, before the optimum: {early}; better ones may be near.")
    return Fitted(tuple(kept), tuple(words))


def _evolved(fit: Fit, low: Array, high: Array, seed: int) -> FitPoint | None:
    """The rows of the best dimensions that differential evolution finds in a box; None where it finds none that reaches all rows."""

    def costs(Z: Array) -> Any:
        found = [fit.begun(z) for z in Z.T]
        return np.array([1e6 if here is None else _size(fit, here) for here in found])

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
    return fit.begun(found.x)


def least_squares(fit: Fit, begin: FitPoint, low: Array, high: Array, evaluations: int = 100) -> FitPoint:
    """The rows with the least sum of squares to which a start leads."""
    here = begin
    # times that open drivers are put anew where the path comes nearest
    for _ in range(3):
        trials = Trials(fit, here)
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
        again = fit.begun(here.z) if fit.open.any() else None
        if again is None or _size(fit, again) > (1 - 1e-6) * _size(fit, here):
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
