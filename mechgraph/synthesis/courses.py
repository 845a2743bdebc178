"""Courses of fits to optima: all starts together by the method of Levenberg and Marquardt; under limits, or with a goal, each by itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import scipy

from mechgraph.maths.se3 import Array, Index, Mask
from mechgraph.maths.tolerances import MODES
from mechgraph.synthesis.fits import Fit, FitPoint, RowDifferences, RowLimit


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
        # longer steps go half a radian, or half of L, in their direction
        far = np.abs(fit.moves(rates, dz, each * dt[:, None])).max(axis=(0, 1))
        dz, dt = (v * np.minimum(1.0, 0.5 / np.maximum(far, 1e-9)) for v in (dz, dt))
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
    if goal is not None:
        return _met(fit, begin, low, high, goal, limits)
    course = _RowCourse(fit, begin, None)
    found = course.led(course.limits(low, high, limits), 60, np.inf)
    here = course.point(found.x)
    return (here if all(limit.kept(here) for limit in limits) else None), bool(found.success)


def _met(
    fit: Fit, here: FitPoint, low: Array, high: Array, goal: RowLimit, limits: Sequence[RowLimit]
) -> tuple[FitPoint | None, bool]:
    """The rows that do what is asked with the least goal, from a start; steps go along the solutions, a region of them at a time."""
    here, _ = descended(fit, here, low, high, 20)
    if np.abs(fit.residual(here)).max() > 1e-9:
        return None, False
    # in L and radians
    radius, came = 0.3, False
    for _ in range(40):
        course = _RowCourse(fit, here, goal)
        found = course.led(course.limits(low, high, limits), 20, radius)
        there, least = course.point(found.x), course.begin[-1]
        gained = least - float(goal.of(there).max())
        if gained > 0 and course.came and all(limit.kept(there) for limit in limits):
            here, radius = there, radius * (2.0 if np.abs(found.x[:-1]).max() > 0.9 * radius else 1.0)
            came = bool(found.success) and gained < 1e-8 * (1.0 + abs(least))
        else:
            radius, came = 0.25 * radius, radius < 1e-5
        if came:
            break
    return (here if all(limit.kept(here) for limit in limits) else None), came


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
    """Rows as functions of variables ``w``, and behind these a slack above what is to be small everywhere: a goal, or squares of errors.

    For errors ``v = v_0 + P w``: what is missed changes by as much in all directions. With ``J / unit = U S V^T`` at the start
    ``P = V S^-1``, small singular values left out of the inverse. With a goal what is asked is met: ``v = v_0 + P w + J_0^T c``, where
    ``J_0 P = 0`` at the start.
    """

    def __init__(self, fit: Fit, begin: FitPoint, goal: RowLimit | None) -> None:
        self.goal, self.fit, self.kept, self._last, self.came = goal, fit, begin, begin, True
        self.beside, J = RowDifferences(fit), fit.jacobian(begin)
        self.unit = max(float(np.abs(fit.residual(begin)).max(initial=0.0)), 1e-9)
        # what the declared configuration meets whatever the dimensions is no condition on them
        self._told = np.abs(J).max(axis=1) > MODES.span
        self._across = J[self._told].T
        if goal is None:
            _, sigma, Vt = np.linalg.svd(J / self.unit, full_matrices=True)
            size = np.zeros(len(Vt))
            size[: len(sigma)] = sigma
            # directions in which nothing is missed are as long as the start's own unit; of others a step of a tenth of L is the longest
            self.P = Vt.T / np.maximum(size, 10.0)
        else:
            self.P = scipy.linalg.null_space(self._across.T, MODES.generic)
        self.v, self._asked = fit.vector(begin), np.zeros(self.P.shape[1])
        self.begin = np.append(self._asked, self._small(self._asked).max())

    def led(self, limits: list[dict[str, Any]], steps: int, radius: float) -> Any:
        """What the optimizer comes to."""
        slope, ends = np.eye(len(self.begin))[-1], [(-radius, radius)] * (len(self.begin) - 1) + [(None, None)]
        return scipy.optimize.minimize(  # type: ignore[call-overload]  # the stubs know no constraints as tables
            lambda w: w[-1],
            self.begin,
            jac=lambda w: slope,
            bounds=ends,
            constraints=limits,
            method="SLSQP",
            options={"maxiter": steps, "ftol": 1e-9},
        )

    def point(self, w: Array) -> FitPoint:
        """The rows; where they cannot be carried there, as far on the way as they can."""
        if not np.array_equal(w[: len(self._asked)], self._asked):
            self._asked = w[: len(self._asked)].copy()
            v = self.v + self.P @ self._asked
            self._last, self.came = self.fit.moved(self.kept, *self.fit.parts(v))
            for _ in range(8 if self.goal is not None else 0):
                r = self.fit.residual(self._last)[self._told]
                if not self.came or np.abs(r).max(initial=0.0) < 1e-13:
                    break
                v = v - self._across @ self._back(self._last) @ r
                self._last, self.came = self.fit.moved(self._last, *self.fit.parts(v))
        return self._last

    def _back(self, here: FitPoint) -> Array:
        """``(J J_0^T)^-1``."""
        return np.asarray(np.linalg.pinv(self.fit.jacobian(here)[self._told] @ self._across, MODES.generic))

    def _padded(self, slopes: Array) -> Array:
        ways = self.P
        if self.goal is not None:
            ways = ways - self._across @ (self._back(self.kept) @ (self.fit.jacobian(self.kept)[self._told] @ ways))
        return np.pad(slopes @ ways, ((0, 0), (0, 1)))

    def _small(self, w: Array) -> Array:
        """What is to be small everywhere: the goal, else the squares of the errors of the rows."""
        if self.goal is not None:
            return self.beside.values(self.goal, self.point(w))
        squares = (self.fit.residual(self.point(w)) / self.unit) ** 2
        return np.asarray(np.bincount(self.fit.asked[0], squares, minlength=self.fit.rows), dtype=float)

    def slacks(self, w: Array) -> Array:
        """How far that is below the slack; where there are no such rows, far above."""
        return w[-1] - self._small(w) - (0.0 if self.came or self.goal is None else 1e2)

    def slack_slopes(self, w: Array) -> Array:
        """Its derivatives."""
        self.kept = self.point(w)
        if self.goal is None:
            slopes = np.zeros((self.fit.rows, len(self.v)))
            products = self.fit.residual(self.kept)[:, None] * self.fit.jacobian(self.kept)
            np.add.at(slopes, self.fit.asked[0], (2.0 / self.unit**2) * products)
        else:
            slopes = self.beside.slopes(self.goal, self.kept)
        return np.asarray(np.eye(len(w))[-1] - self._padded(slopes))

    def limits(self, low: Array, high: Array, limits: Sequence[RowLimit]) -> list[dict[str, Any]]:
        """Slack, bounds of the vector and limits as the optimizer wants them."""
        out: list[dict[str, Any]] = [{"type": "ineq", "fun": self.slacks, "jac": self.slack_slopes}]

        def limited(
            of: Callable[[FitPoint], Array], slopes: Callable[[FitPoint], Array], sense: float, end: Any
        ) -> None:
            def slope(w: Array) -> Array:
                self.kept = self.point(w)
                return sense * self._padded(slopes(self.kept))

            out.append({"type": "ineq", "fun": lambda w: sense * (of(self.point(w)) - end), "jac": slope})

        for sense, ends in ((1.0, low), (-1.0, high)):
            kept = np.flatnonzero(np.isfinite(ends))
            if kept.size:
                limited(partial(_taken, self.fit, kept), partial(_unit, np.eye(len(self.v))[kept]), sense, ends[kept])
        for limit in limits:
            for sense, end in limit.ends:
                limited(partial(self.beside.values, limit), partial(self.beside.slopes, limit), sense, end)
        return out


def _taken(fit: Fit, which: Index, here: FitPoint) -> Array:
    return fit.vector(here)[which]


def _unit(unit: Array, here: FitPoint) -> Array:
    return unit
