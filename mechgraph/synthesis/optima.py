"""Starts of fits and their way to optima, all together: by the method of Levenberg and Marquardt, under limits each by itself.

Starts go down on some of the rows, from which drivers are eliminated one by one: each acts on its own row. The best of them are followed to
the end on all rows.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import scipy

from mechgraph.errors import DeclarationError, MechgraphWarning, counted
from mechgraph.kinematics.prescribed import DriverMotion
from mechgraph.kinetostatics import Pipeline, transmission_index, with_unit_effort
from mechgraph.maths.se3 import Array, Index, Mask
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.outcome import Options, Starts, in_kernel
from mechgraph.result.solution import Solution
from mechgraph.synthesis.answers import ComplexSyntheses, Syntheses
from mechgraph.synthesis.fitness import Measure, distances, fitnesses
from mechgraph.synthesis.fits import LEAST_MARGIN, Bounds, Fit, FitPoint, RowDifferences, RowLimit
from mechgraph.synthesis.system import RowProblem
from mechgraph.variants.numbers import ItemField, varied
from mechgraph.variants.work import quantity


class _DampedStep:
    """Steps of mechanisms by the method of Levenberg and Marquardt.

    With ``J = [Z Y]`` by the unknowns and the drivers ``Y^T Y`` is diagonal, as a driver acts on its own row: the unknowns are those of
    ``(Z^T Z + m D - Z^T Y (Y^T Y)^-1 Y^T Z) dz``, ``D`` the diagonal of ``Z^T Z``, the damping ``m`` one for each mechanism.
    """

    def __init__(
        self, here: FitPoint, Z: Array, y: Array, damping: Array, open_: Mask, ends: tuple[Array, Array]
    ) -> None:
        self.z, self.rows, self.y, self.ends, self.open = here.z, Z.swapaxes(0, 1), y, ends, open_
        u, T = here.z.shape
        self.unit, self.whole = np.eye(u, dtype=bool), self.rows.reshape(T, -1, u)
        self.across = (y.swapaxes(0, 1)[:, :, None] @ self.rows)[:, :, 0]
        self.own = np.where(open_[:, None], (y**2).sum(axis=2) * (1 + damping) + np.finfo(float).tiny, 1.0).T
        A = self.whole.swapaxes(1, 2) @ self.whole
        self.scale = np.where(self.unit, A, 0.0).max(axis=1) + 1e-14
        damped = self.unit * (self.scale * damping[:, None])[:, None]
        self.A = A + damped - self.across.swapaxes(1, 2) @ (self.across / self.own[..., None])

    def least(self, r: Array) -> tuple[Array, Array]:
        """Changes of unknowns ``(u, T)`` and open drivers ``(n, T)`` that make ``r (n, T, k)`` least."""
        pull, (low, high) = (self.y * r).sum(axis=2).T, self.ends
        flat = r.swapaxes(0, 1).reshape(len(pull), 1, -1)
        g = (flat @ self.whole)[:, 0] - ((pull / self.own)[:, None] @ self.across)[:, 0]
        # unknowns at a bound that would leave it stay
        held = (((self.z <= low) & (g.T > 0)) | ((self.z >= high) & (g.T < 0))).T
        A = np.where(held[:, :, None] | held[:, None], self.unit, self.A)
        dz = -np.linalg.solve(A, np.where(held, 0.0, g)[..., None])[..., 0].T
        dz = np.clip(self.z + dz, low, high) - self.z
        moved = -(pull + (self.across @ dz.T[..., None])[..., 0]) / self.own
        return dz, np.where(self.open[:, None], moved.T, 0.0)

    def along(self, dz: Array, dt: Array) -> Array:
        """By how much what is missed changes ``(n, T, k)``."""
        return (self.rows @ dz.T[:, None, :, None])[..., 0].swapaxes(0, 1) + self.y * dt[..., None]

    def size(self, dz: Array) -> Array:
        """Squares ``(T,)`` of the lengths of changes."""
        return (self.scale * dz.T**2).sum(axis=1)


def descended(
    fit: Fit, here: FitPoint, low: Array, high: Array, steps: int, weight: Array | None = None
) -> tuple[FitPoint, Array]:
    """The rows of mechanisms on their way to the least sums of squares, some steps on; and these sums ``(T,)``.

    Steps bend with the valley, by the second derivative along them: Transtrum and Sethna, Improvements to the Levenberg-Marquardt
    algorithm, arXiv:1201.5885, 2012. What is missed is followed by a ``weight (T,)`` times how far margins are below ``fit.wide``, as
    logarithms.
    """
    u, T, open_ = len(here.z), here.z.shape[1], np.asarray(fit.open.any(axis=1))
    ends, weight = (low[:u, None], high[:u, None]), np.zeros(T) if weight is None else weight
    left = _left(fit, here, weight)
    size, damping, quiet = (left**2).sum(axis=(0, 2)), np.full(T, 1e-2), np.zeros(T, dtype=np.intp)
    # part of a step on which its bend is seen
    part, each = 0.1, fit.open[:, :, None].astype(float)
    for _ in range(steps):
        rates = fit.rates(here)
        step = _DampedStep(here, *_left_rates(fit, here, rates, weight), damping, open_, ends)
        dz, dt = step.least(left)
        there, came = fit.stepped(here, rates, here.z + part * dz, here.theta + each * (part * dt)[:, None])
        bend = ((_left(fit, there, weight) - left) / part - step.along(dz, dt)) / part
        az, at = step.least(np.where(came[:, None], bend, 0.0))
        curved = fit.p.system.difference(there.x, here.x) / part - fit.moves(rates, dz, each * dt[:, None])
        short = came & (step.size(az) < 0.125 * step.size(dz))
        dz, dt = np.clip(here.z + dz + np.where(short, az, 0.0), *ends) - here.z, dt + np.where(short, at, 0.0)
        theta = here.theta + each * dt[:, None]
        there, came = fit.stepped(here, rates, here.z + dz, theta, np.where(short, curved / part, 0.0))
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
        here, new = descended(fit, here, low, high, 40, part * _typical(fit, size))
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


def _typical(fit: Fit, size: Array) -> Array:
    """What is missed in the mean ``(T,)``, from the sums of the squares."""
    return np.maximum(np.sqrt(size / max(len(fit.asked[0]), 1)), 1e-9)


def _different(z: Array, size: Array, most: float) -> Index:
    """Which of mechanisms ``z (u, T)`` differ and are not above a size, the best first."""
    kept = list[int]()
    for i in np.argsort(size, kind="stable").tolist():
        # in L
        if size[i] <= most and all(np.abs(z[:, i] - z[:, j]).max() > 1e-2 for j in kept):
            kept.append(i)
    return np.array(kept, dtype=np.intp)


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
    goal: RowLimit | None = None,
    limits: Sequence[RowLimit] = (),
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
    exact: Iterable[Array] = (),
) -> Fitted:
    """The optima to which dimensions lead: the declared ones, those that do parts of the task exactly, and four random ones for
    each of ``starts`` that is left.

    ``exact`` are values of all names. ``way``, ``goal`` and ``limits`` are those of ``constrained``.
    """
    low, high = fit.limits(bounds)
    rng, u = np.random.default_rng(seed), len(fit.z0)
    box = np.where(np.isfinite(low[:u]), low[:u], fit.z0 - 0.5), np.where(np.isfinite(high[:u]), high[:u], fit.z0 + 0.5)
    told = [fit.p.inside(values[:, None])[:, 0] for values in exact]
    tries = [fit.z0, *told, *(rng.uniform(*box) for _ in range(4 * (starts - 1 - len(told))))]
    begun, count = _best(fit, np.clip(np.transpose(tries), low[:u, None], high[:u, None]), low, high, limits, progress)
    # quadratic programs take long
    begun = begun if way == "least_squares" and not limits else begun[:4]
    evolved = None if begun else _evolved(fit, *box, seed)
    begun += [] if evolved is None else [evolved]
    ends: list[FitPoint] = []
    unsafe = lost = early = 0
    wide = RowLimit(fit.margins, LEAST_MARGIN, None)
    for i, begin in enumerate(begun, 1):
        if progress is not None:
            progress(f"best start {i} of {len(begun)} to the end")
        end: FitPoint | None = begin
        narrow = fit.margins(begin).min() < LEAST_MARGIN
        if narrow or way != "least_squares" or limits:
            end, came = constrained(fit, begin, low, high, way, goal, [*limits, wide] if narrow else limits)
            early += end is not None and not came
        if end is None or (goal is not None and not np.isfinite(goal.of(end)).all()):
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
        words.append(f"Stopped before the optimum: {early}; better ones may be near.")
    return Fitted(tuple(kept), tuple(words))


def _best(
    fit: Fit, tries: Array, low: Array, high: Array, limits: Sequence[RowLimit], progress: Callable[[str], None] | None
) -> tuple[list[FitPoint], int]:
    """The rows of the best mechanisms to which dimensions ``tries (u, n)`` lead, by some rows first; and how many lead to all rows.

    Under limits also those that fall short of them by the least, before what is missed is as small as can be.
    """
    # rows by which starts are compared, starts that go down together, and those whose end is sought
    coarse, together, most, found, sizes = fit.of_some(20), 256, 8, [tries[:, :0]], [np.zeros(0)]
    count = 0
    for k in range(0, tries.shape[1], together):
        here, came = coarse.begun(tries[:, k : k + together])
        here, count = coarse.taken(here, np.flatnonzero(came)), count + int(came.sum())
        # the better ones go on, with open drivers put anew where the path comes nearest
        for n, part in ((3, 4), (6, 2), (10, 2), (16, 2)) if came.any() else ():
            # without margins most of them end where a row is about to leave its branch
            weight = 3.0 * _typical(coarse, (coarse.missed(here) ** 2).sum(axis=(0, 2)))
            here, size = descended(coarse, here, low, high, n, weight)
            if coarse.open.any() and n > 3:
                there, came = coarse.begun(here.z)
                again = (coarse.missed(there) ** 2).sum(axis=(0, 2))
                here, size = (
                    coarse.mixed(came & (again < size), there, here),
                    np.where(came, np.minimum(size, again), size),
                )
            order = np.argsort(size, kind="stable")[: max(len(size) // part, most)]
            here, size = coarse.taken(here, order), size[order]
            if limits and n == 6:
                found.append(here.z)
                sizes.append(size)
        found.append(here.z)
        sizes.append((coarse.missed(here) ** 2).sum(axis=(0, 2)))
        if progress is not None:
            progress(f"{min(k + together, tries.shape[1])} of {tries.shape[1]} starts")
    z, size = np.concatenate(found, axis=1), np.concatenate(sizes)
    kept = _different(z, size, np.inf)[: 3 * most if limits else most]
    here, came = fit.begun(z[:, kept]) if kept.size else (here, np.zeros(0, dtype=bool))
    if not came.any():
        return [], count
    here = fit.taken(here, np.flatnonzero(came))
    each = [fit.taken(here, np.array([i])) for i in range(here.z.shape[1])]
    best = settled(fit, fit.taken(here, np.arange(min(most, len(each)))), low, high)
    ends = [fit.taken(best, np.array([i])) for i in range(best.z.shape[1])]
    if not limits:
        return ends, count
    # that which misses least leads the way, in parts of L and of limits
    amiss = {id(one): max(limit.amiss(one) for limit in limits) for one in [*ends, *each]}
    each.sort(key=lambda one: amiss[id(one)] + float(np.sqrt((fit.residual(one) ** 2).mean())))
    every = [*ends[:2], *each]
    return [one for one in every if np.isfinite(amiss[id(one)])][:most] or every[:1], count


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
    goal: RowLimit | None,
    limits: Sequence[RowLimit],
) -> tuple[FitPoint | None, bool]:
    """The best rows to which a start leads under limits, by sequential quadratic programs; None where they are not kept there. Also
    whether the optimizer came to an end before it had to stop.

    ``way`` is ``"least_squares"``, ``"minimax"`` (the least slack ``s`` with ``|r_i|^2 <= s`` at every row), or None: what is asked is met,
    and the ``goal`` is as small as it can be.
    """
    came = True
    if limits and (way == "least_squares" or not all(limit.kept(begin) for limit in limits)):
        begin, came = within(fit, begin, low, high, limits, 60)
    # no error is less than none
    if way == "least_squares" or (way is not None and np.abs(fit.residual(begin)).max(initial=0.0) < 1e-9):
        return (begin if all(limit.kept(begin) for limit in limits) else None), came
    course = _RowCourse(fit, begin, way, goal)
    constraints = [{"type": "ineq", "fun": f, "jac": df} for f, df in course.ends(low, high)]
    if way is None:
        # what the declared configuration meets whatever the dimensions is no condition on them
        told = np.abs(course.jacobian(course.begin)).max(axis=1) > MODES.span
        met = {"type": "eq", "fun": lambda w: course.residual(w)[told], "jac": lambda w: course.jacobian(w)[told]}
        constraints.append(met)
    if course.slack:
        constraints.append({"type": "ineq", "fun": course.slacks, "jac": course.slack_slopes})
    constraints += [course.limit(limit, *end) for limit in limits for end in limit.ends]
    aim, slope = course.aim
    found: Any = scipy.optimize.minimize(  # type: ignore[call-overload]  # the stubs know no constraints as tables
        aim, course.begin, jac=slope, constraints=constraints, method="SLSQP", options={"maxiter": 60, "ftol": 1e-9}
    )
    here = course.point(found.x)
    if way is None:  # met to rounding, where the optimizer leaves off before
        here, _ = descended(fit, here, low, high, 20)
    if way is None and np.abs(fit.residual(here)).max() > 1e-9:
        return None, False
    return (here if all(limit.kept(here) for limit in limits) else None), bool(found.success)


def within(
    fit: Fit, here: FitPoint, low: Array, high: Array, limits: Sequence[RowLimit], steps: int
) -> tuple[FitPoint, bool]:
    """The rows with the least sum of squares under limits to which a start leads; whether it comes to rest there.

    By the method of Levenberg and Marquardt with limits that are linear in each step, missed by a slack that costs much; steps are taken
    that make the sum of the squares smaller, and how far limits are missed times more than all multipliers.
    """
    beside, ends = RowDifferences(fit), [(limit, *end) for limit in limits for end in limit.ends]

    def told(at: FitPoint) -> tuple[Array, Array]:
        """What is missed, and how far above limits the numbers are, over their sizes."""
        above = [sense * (beside.values(limit, at) - end) for limit, sense, end in ends]
        return fit.residual(at), np.concatenate(above)

    # limits may be missed by a little on the way, as they bend
    (r, c), damping, price, quiet, slip = told(here), 1e-3, 0.0, 0, 1e-3
    for k in range(steps):
        v, J, rates = fit.vector(here), fit.jacobian(here), fit.rates(here)
        C = [sense * beside.slopes(limit, here) for limit, sense, _ in ends]
        bounded = [np.flatnonzero(np.isfinite(end)) for end in (low, high)]
        C += [np.eye(len(v))[bounded[0]], -np.eye(len(v))[bounded[1]]]
        room = np.concatenate([c, (v - low)[bounded[0]], (high - v)[bounded[1]]])
        for _ in range(12):
            D = np.sqrt(damping) * np.maximum(np.linalg.norm(J, axis=0), 1e-2)
            d, most = _step(np.concatenate([J, np.diag(D)]), np.append(-r, np.zeros(len(v))), np.concatenate(C), room)
            price = max(price, 2.0 * most)
            z, theta = fit.parts(v + d)
            dq = np.abs(fit.moves(rates, z - here.z, theta - here.theta)).max()
            if dq > 0.5:
                z, theta = fit.parts(v + d * (0.5 / dq))
            there, came = fit.stepped(here, rates, z, theta)
            if came[0]:
                new = told(there)
                gained = _merit(r, c + slip, price) - _merit(new[0], new[1] + slip, price)
            if came[0] and gained > 0:
                break
            damping = min(damping * 6, 1e12)
        else:
            gained, there, new, quiet = 0.0, here, (r, c), quiet + 4
        quiet = 0 if gained > 1e-6 * _merit(new[0], new[1] + slip, price) + 1e-20 else quiet + 1
        here, (r, c), damping = there, new, max(damping / 5, 1e-12)
        if quiet > 3 and not slip:
            return here, True
        if quiet > 3 or 3 * k > 2 * steps:
            slip, quiet = 0.0, 0
    return here, False


def _merit(r: Array, c: Array, price: float) -> float:
    return 0.5 * float(r @ r) + price * float(np.maximum(-c, 0.0).max(initial=0.0))


def _step(E: Array, f: Array, C: Array, room: Array) -> tuple[Array, float]:
    """The least ``|E d - f|`` under ``C d + s + room >= 0``, with a slack ``s`` that costs much; and the sum of the multipliers.

    A problem of least distance, which becomes one of least squares without negative numbers: Lawson and Hanson, Solving Least Squares
    Problems, 1974, chapter 23.
    """
    n = E.shape[1]
    E = np.pad(E, ((0, 1), (0, 1)))
    E[-1, -1] = 1e3
    Q, R = np.linalg.qr(E)
    base = Q.T @ np.append(f, 0.0)
    G = np.concatenate([np.pad(C, ((0, 0), (0, 1)), constant_values=1.0), np.eye(n + 1)[-1:]])
    GR = scipy.linalg.solve_triangular(R, G.T, trans="T").T
    h = -np.append(room, 0.0) - GR @ base
    u, _ = scipy.optimize.nnls(np.vstack([GR.T, h]), np.append(np.zeros(n + 1), 1.0))
    left = np.append(GR.T @ u, h @ u - 1.0)
    y = -left[:-1] / left[-1]
    return scipy.linalg.solve_triangular(R, base + y)[:n], float(-u[:-1].sum() / left[-1])


class _RowCourse:
    """Rows as functions of variables ``w``, in which what is missed changes by as much in all directions: ``v = v_0 + P w``.

    With ``J / unit = U S V^T`` at the start ``P = V S^-1``, small singular values left out of the inverse. Behind stands the slack.
    """

    def __init__(self, fit: Fit, begin: FitPoint, way: str | None, goal: RowLimit | None) -> None:
        self.goal, self.slack = goal, way != "least_squares"
        self.fit, self.kept, self._last = fit, begin, begin
        self.beside = RowDifferences(fit)
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
        return self.squares(w) if self.goal is None else self.beside.values(self.goal, self.point(w))

    def slacks(self, w: Array) -> Array:
        """How far that is below the slack."""
        return np.asarray(w[-1] - self._small(w))

    def slack_slopes(self, w: Array) -> Array:
        """Its derivatives."""
        return np.eye(len(w))[-1] - (self.squares_slope(w) if self.goal is None else self.slopes(self.goal, w))

    def slopes(self, limit: RowLimit, w: Array) -> Array:
        """Of numbers by the variables."""
        self.kept = self.point(w)
        return self._padded(self.beside.slopes(limit, self.kept))

    def limit(self, limit: RowLimit, sense: float, end: float) -> dict[str, Any]:
        """A limit as the optimizer wants it."""
        return {
            "type": "ineq",
            "fun": lambda w: sense * (self.beside.values(limit, self.point(w)) - end),
            "jac": lambda w: sense * self.slopes(limit, w),
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

    def __init__(
        self, problem: RowProblem, tasks: Any, over: Any, driver: str | None, output: str | None, faults: list[str]
    ) -> None:
        self.problem, self.over, self.driver, self.output = problem, over, driver, output
        # exact ones come back in their own frames; the error of a place is that of the origin of its frame, which is another one here
        if elsewhere := list(problem.first.poses):
            first = f"the first pose of {', '.join(map(repr, elsewhere))} is not the identity"
            faults.append(f"{first}: a fit begins there; measure its poses from the first one")
        try:
            self.fit = Fit(problem, tasks, over)
        except DeclarationError as error:
            faults += error.faults
        if faults:
            raise DeclarationError(problem.name, faults)

    def answered(
        self,
        fit: str | None,
        bounds: Mapping[str, Any],
        limits: Sequence[Any],
        goals: Sequence[tuple[Measure, float]],
        starts: int,
        seed: int,
        progress: Callable[[str], None] | None,
        exact: Iterable[Array],
    ) -> Syntheses:
        """What comes nearest to what is asked, or meets it and is best in something else."""
        goal = self.limit(goals[0][0], sign=goals[0][1]) if goals else None
        limited = [self.limit(measure, least, most) for _, measure, least, most in limits]
        return self.answer(fitted(self.fit, fit, starts, bounds, goal, limited, seed, progress, exact))

    def rows(self, here: FitPoint) -> tuple[Mechanism, Array]:
        """The mechanism of fitted rows, and its coordinates ``(rows, F)``."""
        p = self.problem
        q = p.system.coordinates_of(here.x[:, : self.fit.own, 0]).T[:, : len(p.m.freedom_names())]
        m = p.unknowns.mechanism(p.outside(here.z)[:, 0])
        return m.replace(start=dict(zip(m.freedom_names(), q[0].tolist(), strict=True))), q

    def limit(
        self, measure: Measure, least: float | None = None, most: float | None = None, sign: float = 1.0
    ) -> RowLimit:
        """A quantity of fitted rows, times a sign."""
        of = partial(self._measured, measure, sign, least is None and sign > 0)
        return RowLimit(of, least, most, not (measure.of_dimensions or self.over))

    def _measured(self, measure: Measure, sign: float, smooth: bool, here: FitPoint) -> Array:
        """A quantity ``(k, T)`` of mechanisms; NaN where it has no value."""
        values = self._together(measure, smooth, here)
        if values is None:
            each = (self.rows(self.fit.taken(here, np.array([i]))) for i in range(here.z.shape[1]))
            values = np.stack([measure(m, q, self.driver, smooth) for m, q in each], axis=1)
        return np.asarray(sign * values)

    @cached_property
    def _by_points(self) -> bool:
        """Whether no numbers are sought but those of points, and what has no part in dimensions."""
        return all(p.array in ("point", "factors") for own in self.problem.unknowns.places for p in own)

    @cached_property
    def _squared(self) -> tuple[Array, Array, Array, Array]:
        """Squares of all distances of elements of a link: at some unknowns ``(u,)``, there ``(k,)``, and their derivatives ``(k, u)`` and
        ``(k, u, u)``: they are polynomials of degree two.
        """
        p, u = self.problem, len(self.fit.z0)
        z, unit = np.random.default_rng(0).normal(size=u), np.eye(u)

        def squares(*ways: Array) -> Array:
            return np.asarray(distances(p.unknowns.mechanism(p.outside(sum(ways, z)[:, None])[:, 0])) ** 2)

        base, ahead = squares(), np.stack([squares(e) for e in unit])
        both = np.zeros((u, u, len(base)))
        for i, j in combinations_with_replacement(range(u), 2):
            both[i, j] = both[j, i] = squares(unit[i], unit[j]) - ahead[i] - ahead[j] + base
        return z, base, (ahead - base - 0.5 * both[range(u), range(u)]).T, both.transpose(2, 0, 1)

    def _lengths(self, what: Any, smooth: bool, z: Array) -> Array:
        """Distances of elements of a link, or their ratios ``(k, T)``; the largest alone, where that need not be ``smooth``."""
        begin, base, slope, both = self._squared
        d = z - begin[:, None]
        squares = base[:, None] + slope @ d + 0.5 * np.einsum("kij,it,jt->kt", both, d, d)
        lengths = np.sqrt(np.maximum(squares, 0.0))
        if what == "ratio":
            lengths = (lengths[:, None] / lengths).reshape(-1, z.shape[1])
        return lengths if smooth else lengths.max(axis=0, keepdims=True)

    def _together(self, measure: Measure, smooth: bool, here: FitPoint) -> Array | None:
        """A quantity of mechanisms side by side, at the states of their rows; None where it has to be taken of each alone."""
        p, u, what, T = self.problem, self.problem.unknowns, measure.output or measure.what, here.z.shape[1]
        if measure.of_dimensions:
            return self._lengths(what, smooth, here.z) if self._by_points else None
        alone = {name: f.what for name, f in u.fields.items() if isinstance(f, ItemField) and f.one_by_one}
        # the place of a named point matters to what is said of it alone
        unread = {n for n, of in alone.items() if of == "links" and not str(what).startswith(n.rpartition(".")[0])}
        drivers = [self.driver] if self.over is None else [*self.over]
        if callable(what) or alone.keys() - unread or None in drivers or len(self.fit.over) < (self.over is not None):
            return None
        rows = slice(self.fit.own, None) if len(self.fit.over) else slice(None)
        names, states = p.m.freedom_names(), np.moveaxis(here.x[:, rows], 1, 2)
        q = p.system.coordinates_of(states.reshape(len(states), -1))[: len(names)]
        own = {name: f for name, f in u.fields.items() if name not in alone}
        values, which = p.outside(here.z), np.repeat(np.arange(T), states.shape[2])
        m = u.mechanism(values[:, 0]).replace(start=dict(zip(names, q[:, 0].tolist(), strict=True)))
        m = with_unit_effort(m, what) if measure.output else m
        motions = {p.m.full_name(name): q[names.index(p.m.full_name(name))][:, None] for name in drivers if name}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MechgraphWarning)
            line = Pipeline(DriverMotion(m, motions), Options(redundant="minimum_norm" if measure.output else "nan"))
            par = line.system.par
            numbers = varied(m, own, values[[name in own for name in u.names]]).numbers
            made = numbers.with_rest(line.m).parameters(line.m, par.offset, par.origin, par.L)
            system = line.system.with_parameters(replace(made, mass=np.broadcast_to(made.mass, (len(m.links), T))))
            begin = line.system.state_of(q)
            kernel = in_kernel(line, system.cases(which), m.loads, len(which))
            if kernel is not None:
                kernel.begin(begin)
            starts = Starts(begin, lambda at: system.cases(which[at]), m.loads, 1, kernel)
            found = Solution(line.run(starts, (len(which), 1)).trajectory)
            if measure.output:
                told = np.arcsin(transmission_index(found, what, tuple(motions)))
            else:
                told = quantity(found, what, what)
        return np.asarray(told).reshape(T, -1).T

    def answer(self, found: Fitted) -> Syntheses:
        """The optima found, the best first."""
        p, points = self.problem, found.points
        made = [self.rows(here) for here in points]
        errors = [float(self.fit.errors(here).max(initial=0.0)) for here in points]
        shape = (self.fit.own, len(p.m.links), 4, 4)
        closed = [float(np.abs(here.at.residual).max(initial=0.0)) for here in points]
        return Syntheses(
            p.first.declared,
            tuple(m for m, _ in made),
            p.unknowns.names,
            np.array([p.outside(here.z)[:, 0] for here in points]).reshape(len(points), len(p.unknowns.names)),
            np.array([p.first.poses_of(here.at.here)[: self.fit.own] for here in points]).reshape(-1, *shape),
            np.array([q for _, q in made]).reshape(len(made), self.fit.own, len(p.m.freedom_names())),
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
