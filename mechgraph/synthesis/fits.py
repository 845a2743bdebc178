"""Fits: mechanisms that come as near as they can to more than they can do, or do it exactly and are best in something else.

At every row the coordinates are an implicit function of the unknown dimensions and of the driver, ``F(z, theta, q(z, theta)) = 0``, so

    dq/dz = -F_q^-1 F_z,    dq/dtheta = -F_q^-1 F_theta

are exact. What is asked of drivers is met; where nothing is, the driver of the row is an unknown of its own, so that errors are distances
from curves, not from samples of them. Rows keep to the branch of the first one: a trial on which the determinant of ``F_q`` changes its
sign at a row is refused, and of what is found the path follower of ``solve`` has to lead from row to row.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from mechgraph.errors import DeclarationError, listed
from mechgraph.kinematics.motion_path import DriverPath, Request
from mechgraph.kinematics.reach import follow
from mechgraph.kinematics.solver import closure_solver, engine_for
from mechgraph.maths.linear import complement
from mechgraph.maths.se3 import Array, Index, Mask
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.model.setups import keeps
from mechgraph.modes.compiled_tracks import CompiledTracks, Led, LedRow, LegNumbers
from mechgraph.synthesis.legs import marker_places
from mechgraph.synthesis.system import ArrowRows, RowProblem
from mechgraph.synthesis.tasks import FunctionTask

LEAST_MARGIN = 2e-2
"""Least margin of the rows of an optimum (see ``Fit.margins``); on the way a twentieth of that will do."""
Bounds = Mapping[str, tuple[float | None, float | None]]
"""Ends of unknowns by name."""


@dataclass(frozen=True)
class FitPoint:
    """Rows of ``T`` mechanisms: unknowns ``z (u, T)`` and drivers ``theta (n, d, T)`` in internal units, states ``x (nx, n, T)``, and their
    equations, from the kernel the ``rows (n, T, m, f + d + u + 1)`` of ``CompiledTracks.rows``.
    """

    fit: Fit
    z: Array
    theta: Array
    x: Array
    rows: Array | None = None

    @cached_property
    def at(self) -> ArrowRows:
        """The equations one by one."""
        p = self.fit.p
        return p.equations(p.numbers.with_values(p.places, self.z), self.x.swapaxes(0, 1))

    @cached_property
    def residual(self) -> Array:
        """What is left open ``(n, T, m)``."""
        return self.at.residual.swapaxes(1, 2) if self.rows is None else -self.rows[..., -1]

    @cached_property
    def by_drivers(self) -> Array:
        """``F_theta (n, T, m, d)``."""
        if self.rows is None:
            return np.moveaxis(self.at.by_coordinates[:, :, self.fit.drivers], 3, 1)
        return self.rows[..., len(self.fit.free) : -1 - len(self.z)]

    @cached_property
    def by_unknowns(self) -> Array:
        """``F_z (n, T, m, u)``."""
        return np.moveaxis(self.at.by_unknowns, 3, 1) if self.rows is None else self.rows[..., -1 - len(self.z) : -1]

    @cached_property
    def matrix(self) -> Array:
        """``F_q (n, T, m, f)``."""
        if self.rows is None:
            return np.moveaxis(self.at.by_coordinates[:, :, self.fit.free], 3, 1)
        return self.rows[..., : len(self.fit.free)]

    @cached_property
    def square(self) -> bool:
        """Whether as many rows as coordinates are independent."""
        return self.matrix.shape[2] == self.matrix.shape[3] == self.fit.rank

    @cached_property
    def inverse(self) -> Array:
        """That of ``F_q``."""
        if self.square:
            try:
                return np.asarray(np.linalg.inv(self.matrix))
            except np.linalg.LinAlgError:  # one of them is singular to the last digit
                pass
        return np.asarray(np.linalg.pinv(self.matrix, 1e-9), dtype=float)


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
    own, over : int, (k, d) array
        How many rows ask for something; behind them stand those that are led over values of the drivers, and asked for nothing.
    """

    wide = 1.1 * LEAST_MARGIN
    """Margin below which optima are led to wider ones."""

    def __init__(self, problem: RowProblem, tasks: Any, over: Any = None) -> None:
        self.p, self.tasks, s = problem, tasks, problem.system
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
        if over is not None and not isinstance(over, np.ndarray):
            over = self._over(over)
        self.own, self.over = self.rows, self.theta[:0] if over is None else np.asarray(over)
        more, self.rows = len(self.over), self.rows + len(self.over)
        self.theta = np.concatenate([self.theta, self.over])
        self.open, self.wanted = (
            np.pad(v, ((0, more), (0, 0)), constant_values=none)
            for v, none in ((self.open, False), (self.wanted, np.nan))
        )

    def of_some(self, most: int) -> Fit:
        """The same of so many rows at most of which something is asked, the first among them."""
        rows = np.unique(np.linspace(0, self.own - 1, min(most, self.own)).round().astype(np.intp))
        return Fit(self.p.with_rows(rows), self.tasks, self.over)

    def _over(self, over: Mapping[str, Any]) -> Array | None:
        """Values ``(k, d)`` of the drivers over which conditions hold; None where others drive there."""
        names = [self.p.whole.freedom_names()[k] for k in self.drivers]
        given = {self.p.m.full_name(name): np.ravel(values) for name, values in over.items()}
        if set(given) != set(names):
            return None
        unit = np.where(self.p.system.is_length[self.drivers], self.p.L, 1.0)
        return np.stack(np.broadcast_arrays(*map(given.__getitem__, names)), axis=1) / unit

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
        faults = []

        def left_at(z: Array) -> Array:
            numbers = self.p.numbers.with_values(self.p.places, z[:, None])
            J = self.p.equations(numbers, x.T[:, :, None]).by_coordinates[0, :, :, 0]
            return np.asarray(scipy.linalg.null_space(J[:, self.free], MODES.generic))

        left = left_at(self.z0)
        self.rank = len(self.free) - left.shape[1]
        loose = self.free[np.abs(left).max(axis=1, initial=0.0) > MODES.span]
        names = self.p.whole.freedom_names()
        if loose.size and np.isin(loose, self.others).any():
            told = "declare drives that move the rest"
            if left_at(self.z0 + np.random.default_rng(0).normal(size=len(self.z0))).shape[1] < left.shape[1]:
                told = "at the declared values of what is unknown points of a link coincide, or links lie in line; declare other ones"
            faults.append(f"the drivers leave {listed(names[k] for k in loose)} open; {told}")
        if len(self.drivers) > 1 and self.open.any():
            faults.append("several drivers without timing: give their values at all rows, e.g. mg.path(..., at={...})")
        if not np.isfinite(self.wanted).any():
            faults.append("nothing is asked beside values of drivers")
        if faults:
            raise DeclarationError(self.p.name, faults)

    @cached_property
    def z0(self) -> Array:
        """The declared dimensions."""
        return self.p.inside(self.p.unknowns.declared[:, None])[:, 0]

    # --- closing ---------------------------------------------------------------------------------------------------------

    def point(self, z: Array, theta: Array, x: Array) -> FitPoint:
        """Rows at states, and their equations."""
        return FitPoint(self, z, theta, x) if self.compiled is None else self._led(z, theta, x)[0]

    def _led(self, z: Array, theta: Array, x: Array, *until: float) -> tuple[FitPoint, Mask]:
        """Rows at states closed by the kernel, see ``CompiledTracks.rows``; which came there."""
        assert self.compiled is not None
        (tracks, numbers), (n, T) = self.compiled, x.shape[1:]
        states = np.concatenate([np.broadcast_to(z[:, None], (len(z), n, T)), x]).T.reshape(n * T, -1)
        x, rows, came = tracks.rows(numbers, states, *until)
        x = x.reshape(T, n, -1)[..., len(z) :].T
        return FitPoint(self, z, theta, x, rows.reshape(T, n, *rows.shape[1:]).swapaxes(0, 1)), came.reshape(T, n).T

    @cached_property
    def compiled(self) -> tuple[CompiledTracks, LegNumbers] | None:
        """The equations of a row in the kernel, and the numbers that are known; None where it does not serve."""
        p, s, places = self.p, self.p.system, marker_places(self.p)
        if places is None or not s.n_rows == self.rank == len(self.free):
            return None
        none, u = np.zeros((0, len(p.order))), len(p.places)
        row = LedRow(u, 0, np.append(self.free, self.drivers), None)
        led = Led(
            s, p.at_rest, s.n_state, p.columns[:0], none[:, :0].reshape(1, 0), [row], len(p.order), [], none, p.columns[:0], u, u, places
        )  # fmt: skip
        if not led.served:
            return None
        begin = np.stack(p.numbers.vectors).swapaxes(1, 2)
        still = np.zeros(begin.shape), np.zeros((1, 0, 1)), np.zeros((1, 0, 1))
        return CompiledTracks(led), LegNumbers(begin, np.zeros((6, *begin.shape[2:])), *still).joined

    def taken(self, here: FitPoint, which: Index) -> FitPoint:
        """Some of the mechanisms."""
        rows = None if here.rows is None else here.rows[:, which]
        return FitPoint(self, here.z[:, which], here.theta[..., which], here.x[..., which], rows)

    def mixed(self, first: Mask, one: FitPoint, other: FitPoint) -> FitPoint:
        """Those of the one where it is the ``first (T,)``, else those of the other."""
        if first.all():
            return one
        parts = ((one.z, other.z), (one.theta, other.theta), (one.x, other.x))
        z, theta, x = (np.where(first, a, b) for a, b in parts)
        known = one.rows is not None and other.rows is not None
        return FitPoint(self, z, theta, x, np.where(first[:, None, None], one.rows, other.rows) if known else None)  # type: ignore[arg-type]

    def closed(
        self, z: Array, theta: Array, x: Array, longest: float = 1.0, to: float = 1e-12
    ) -> tuple[FitPoint, Mask]:
        """Rows closed from states near by, but for an error; at which ``(n, T)`` Newton's method comes to an end there, the first step
        of which is shorter than the ``longest``.
        """
        s, x = self.p.system, x.copy()
        x[s.single_rows[self.drivers]] = theta.swapaxes(0, 1)
        if self.compiled is not None:
            return self._led(z, theta, x, longest, to)
        came, last = np.ones(x.shape[1:], dtype=bool), np.full(x.shape[1:], 2 * longest)
        # steps of Newton's method, each at most half as long as the one before
        for _ in range(12):
            here = self.point(z, theta, x)
            left = here.residual
            going = came & ~(np.abs(left).max(axis=2, initial=0.0) < to)
            if not going.any():
                return here, came
            step = -(here.inverse @ left[..., None])[..., 0]
            size = np.abs(step).max(axis=2, initial=0.0)
            came &= ~going | (size < 0.5 * last)
            last, dq = size, np.zeros((s.n_freedoms, *came.shape))
            dq[self.free] = np.where((came & going)[..., None], step, 0.0).transpose(2, 0, 1)
            x = s.advance(x, dq)
            # each step doubles the digits
            if (size[came & going] < 1e-8).all():
                return self.point(z, theta, x), came
        return here, came & ~going

    def by_drivers(self, here: FitPoint) -> Array:
        """``dq/dtheta (n, T, F, d)``."""
        out = np.zeros((*here.x.shape[1:], self.p.system.n_freedoms, len(self.drivers)))
        out[:, :, self.free] = -here.inverse @ here.by_drivers
        out[:, :, self.drivers] = np.eye(len(self.drivers))
        return out

    def rates(self, here: FitPoint) -> tuple[Array, Array]:
        """``dq/dz (n, T, F, u)`` and ``dq/dtheta (n, T, F, d)``."""
        by_z = np.zeros((*here.x.shape[1:], self.p.system.n_freedoms, len(here.z)))
        by_z[:, :, self.free] = -here.inverse @ here.by_unknowns
        return by_z, self.by_drivers(here)

    @staticmethod
    def moves(rates: tuple[Array, Array], dz: Array, dtheta: Array) -> Array:
        """How coordinates ``(F, n, T)`` move along tangents."""
        moved = rates[0] @ dz.T[:, :, None] + rates[1] @ np.moveaxis(dtheta, 1, 2)[..., None]
        return np.asarray(moved[..., 0].transpose(2, 0, 1))

    def stepped(
        self, here: FitPoint, rates: tuple[Array, Array], z: Array, theta: Array, bend: Array | float = 0.0
    ) -> tuple[FitPoint, Mask]:
        """Rows carried to other dimensions and drivers in one step along tangents, and a known ``bend (F, n, T)`` from these; which
        mechanisms ``(T,)`` come there, all rows on their branches.
        """
        dq = self.moves(rates, z - here.z, theta - here.theta)
        # the longest step (radians, lengths over L) of a row that may be predicted
        near = np.abs(dq).max(axis=(0, 1)) < 1.0
        dq = dq + bend
        x = np.broadcast_to(here.x, (len(here.x), *dq.shape[1:]))
        new, came = self.closed(z, theta, self.p.system.advance(x, np.where(near, dq, 0.0)))
        whole = near & came.all(axis=0) & (self._sides(new) == self._sides(here)).all(axis=0)
        return new, whole & (self.margins(new, LEAST_MARGIN / 20).min(axis=0) > LEAST_MARGIN / 20)

    def moved(self, here: FitPoint, z: Array, theta: Array) -> tuple[FitPoint, bool]:
        """Rows of one mechanism carried to other dimensions and drivers, in one step or in several; where a row would leave its branch as
        far as before.
        """
        at = here
        for parts in (1, 8):
            at = here
            for k in range(1, parts + 1):
                z1, theta1 = here.z + (z - here.z) * k / parts, here.theta + (theta - here.theta) * k / parts
                new, came = self.stepped(at, self.rates(at), z1, theta1)
                if not came[0]:
                    break
                at = new
            else:
                return at, True
        return at, False

    def _sides(self, here: FitPoint) -> Array:
        """Signs ``(n, T)`` of the determinants of ``F_q`` at the rows, where it has one."""
        return np.asarray(np.linalg.slogdet(here.matrix)[0] if here.square else np.ones(here.x.shape[1:]))

    def margins(self, here: FitPoint, below: float = np.inf) -> Array:
        """How far rows ``(n, T)`` are from folds, and links from having no length: least singular value of ``F_q`` over its largest. Where
        these lie above what is of interest ``below``, so do numbers that are less than they.
        """
        J, near = here.matrix, np.ones(here.x.shape[1:], dtype=bool)
        out = np.ones(near.shape)
        if here.square and np.isfinite(below):
            # norms of Frobenius are no less than the largest singular values
            out = 1.0 / np.maximum(np.linalg.norm(J, axis=(2, 3)) * np.linalg.norm(here.inverse, axis=(2, 3)), 1.0)
            near = ~(out > below)
        if near.any():
            size = np.linalg.svd(J[near], compute_uv=False)
            out[near] = size[:, self.rank - 1] / size[:, 0]
        return out

    def margin_slopes(
        self, here: FitPoint, rows: Index, which: Index, rates: tuple[Array, Array]
    ) -> tuple[Array, Array]:
        """Derivatives of the margins of some rows of mechanisms by the unknowns ``(r, u)`` and their drivers ``(r, d)``.

        With singular vectors ``ds_i = u_i^T dF_q v_i``; the matrix changes along tangents, by differences.
        """
        by_z, by_theta = (v[rows, which] for v in rates)
        ways, h = np.concatenate([by_z, by_theta], axis=2), 1e-6
        z = here.z[:, which, None] + h * np.eye(len(here.z), ways.shape[2])[:, None]
        dq = h * ways.swapaxes(0, 1).reshape(ways.shape[1], 1, -1)
        x = self.p.system.advance(np.repeat(here.x[:, rows, which], ways.shape[2], axis=1)[:, None], dq)
        J = self.point(z.reshape(len(z), -1), np.zeros(0), x).matrix[0]
        change = (J.reshape(len(rows), ways.shape[2], *J.shape[1:]) - here.matrix[rows, which][:, None]) / h
        U, sigma, V = np.linalg.svd(here.matrix[rows, which])
        some = [0, self.rank - 1]
        d = np.einsum("rmi,rwmf,rif->riw", U[:, :, some], change, V[:, some])
        out = d[:, 1] / sigma[:, :1] - d[:, 0] * (sigma[:, self.rank - 1] / sigma[:, 0] ** 2)[:, None]
        return out[:, : len(z)], out[:, len(z) :]

    # --- where rows begin ------------------------------------------------------------------------------------------------

    def led(self, z: Array, theta: Array, x: Array) -> tuple[Array, Mask]:
        """States ``(nx, n)`` at driver values ``(n, d)`` to which the path leads from a closed state ``x (nx,)``; which it reached."""
        numbers = self.p.numbers.with_values(self.p.places, z[:, None])
        system = self.p.system_with(numbers)
        solver = closure_solver(engine_for(system.n_rows, 1, "auto"), self.drivers)
        found = follow(
            DriverPath(system, solver, system.cases), [Request(x, 0, theta.T, np.arange(len(theta)))], len(theta)
        )
        return found.x, found.moved

    @cached_property
    def _ways(self) -> tuple[Array, Index]:
        """Values of the drivers ``(K, W, d)`` on ways from the first row, in short steps, and where on them rows ``(n, 2)`` are given.

        One driver goes from there up and down, several go from row to row.
        """
        begin, given = self.theta[:1], np.flatnonzero(~self.open.any(axis=1)).tolist()
        lines: list[list[tuple[Array, int]]] = [[(self.theta[row], row) for row in given]]
        if len(self.drivers) == 1:
            turn = self.p.system.periods[self.drivers[0]]
            reach = (turn if np.isfinite(turn) else MODES.slide_stroke) * self.open.any()
            # beyond the last row that is given the way goes on
            stops = [(self.theta[row], row) for row in given] + [(begin[0] + sign * reach, -1) for sign in (1, -1)]
            stops.sort(key=lambda stop: abs(stop[0][0] - begin[0, 0]))
            lines = [[stop for stop in stops if sign * (stop[0][0] - begin[0, 0]) >= 0] for sign in (1, -1)]
        places, ways = np.zeros((self.rows, 2), dtype=np.intp), []
        for w, line in enumerate(lines):
            way = [begin[0]]
            for stop, row in line:
                # the longest step of a driver, in radians or lengths over L
                parts = int(np.ceil(np.abs(stop - way[-1]).max() / 0.25))
                way += [*(way[-1] + (stop - way[-1]) * np.arange(1, parts + 1)[:, None] / max(parts, 1))]
                if row >= 0:
                    places[row] = len(way) - 1, w
            ways.append(np.array(way))
        longest = max(map(len, ways))
        return np.stack([np.pad(way, ((0, longest - len(way)), (0, 0)), mode="edge") for way in ways], axis=1), places

    def begun(self, z: Array) -> tuple[FitPoint, Mask]:
        """The rows of mechanisms ``z (u, T)``: open drivers where their paths come nearest to what is asked; which reach all rows."""
        (ways, places), s = self._ways, self.p.system
        T = z.shape[1]

        def values(k: int) -> Array:
            return np.repeat(ways[k][:, :, None], T, axis=2)

        rest = np.broadcast_to(self.p.at_rest[:, None, None], (len(self.p.at_rest), ways.shape[1], T))
        here, alive = self.closed(z, values(0), rest, np.inf)
        states, came, sides = [here.x], [alive], self._sides(here)
        slope = self.by_drivers(here)
        for k in range(1, len(ways)):
            slope, last = self.by_drivers(here), slope
            # along a parabola, where steps are alike
            ahead = np.moveaxis(values(k) - here.theta, 1, 2)[..., None]
            dq = ((1.5 * slope - 0.5 * last) @ ahead)[..., 0].transpose(2, 0, 1)
            near = alive & (np.abs(dq).max(axis=0) < 1.0)
            # what is left open on the way is closed where the rows are
            here, closed = self.closed(z, values(k), s.advance(here.x, np.where(near, dq, 0.0)), to=1e-3)
            alive = near & closed & (self._sides(here) == sides)
            states.append(here.x)
            came.append(alive)
        x, alive = np.array(states), np.array(came)
        theta = np.repeat(self.theta[:, :, None], T, axis=2)
        rows = x[places[:, 0], :, places[:, 1]].transpose(1, 0, 2).copy()
        whole = alive[places[:, 0], places[:, 1]].all(axis=0)
        if self.open.any():
            found = np.moveaxis(x[:, s.single_rows[self.others]], 1, 3)
            for i in np.flatnonzero(self.open[:, 0]):
                apart = self._wrapped(found - self.wanted[i] * self._factors(z))
                far = np.where(alive, np.nansum(apart**2, axis=3), np.inf).reshape(-1, T)
                k, w = np.unravel_index(far.argmin(axis=0), ways.shape[:2])
                theta[i], rows[:, i] = ways[k, w].T, x[k, :, w, np.arange(T)].T
        new, closed = self.closed(z, theta, rows)
        return new, np.asarray(whole & closed.all(axis=0))

    def safe(self, here: FitPoint) -> bool:
        """Whether the path of one mechanism leads from the first row to all others."""
        states, came = self.led(here.z[:, 0], here.theta[..., 0], here.x[:, 0, 0])
        if not came.all():
            return False
        apart = self.p.system.difference(states, here.x[..., 0])
        settled = np.isin(np.arange(len(apart)), self.others)
        return bool(np.abs(self._wrapped(apart[settled].T)).max(initial=0.0) < MODES.arrives)

    # --- what is to be small ---------------------------------------------------------------------------------------------

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
        """By what ``(T, k)`` that which is asked is multiplied."""
        scaled = self.factor_of >= 0
        out = np.ones((z.shape[1], len(scaled)))
        out[:, scaled] = z[len(z) - self.factor_of.max(initial=-1) - 1 :][self.factor_of[scaled]].T
        return out

    def missed(self, here: FitPoint) -> Array:
        """By how much each is missed ``(n, T, k)``; zero where nothing is asked."""
        q = here.x[self.p.system.single_rows[self.others]].transpose(1, 2, 0)
        return np.nan_to_num(self._wrapped(q - self.wanted[:, None] * self._factors(here.z)))

    def missed_rates(self, rates: tuple[Array, Array]) -> tuple[Array, Array]:
        """Its derivatives by the unknowns ``(n, T, k, u)``, and by the drivers ``(n, T, k, d)`` that are open."""
        asked = np.isfinite(self.wanted)[:, None, :, None]
        by_z, by_theta = (np.where(asked, v[:, :, self.others], 0.0) for v in rates)
        for k in np.flatnonzero(self.factor_of >= 0):
            column = by_z.shape[3] - self.factor_of.max() - 1 + self.factor_of[k]
            by_z[:, :, k, column] -= np.nan_to_num(self.wanted[:, k, None])
        return by_z, np.where(self.open[:, None, None], by_theta, 0.0)

    @cached_property
    def spare(self) -> int:
        """How many unknowns and open drivers there are more than conditions on them; what a row meets whatever the dimensions is none."""
        J = self.jacobian(self.begun(self.z0[:, None])[0])
        return J.shape[1] - int((np.abs(J).max(axis=1) > MODES.span).sum())

    def residual(self, here: FitPoint) -> Array:
        """By how much each is missed by one mechanism ``(a,)``."""
        return self.missed(here)[:, 0][self.asked]

    def jacobian(self, here: FitPoint) -> Array:
        """Its derivatives ``(a, v)`` by the unknowns and the open drivers."""
        by_z, by_theta = (v[:, 0][self.asked] for v in self.missed_rates(self.rates(here)))
        i, j = np.nonzero(self.open)
        return np.concatenate([by_z, np.where(self.asked[0][:, None] == i, by_theta[:, j], 0.0)], axis=1)

    @cached_property
    def unit(self) -> float:
        """The unit of errors: L where any length is asked, else radians."""
        return self.p.L if self.p.system.is_length[self.others].any() else 1.0

    def errors(self, here: FitPoint) -> Array:
        """Distances ``(n,)`` from what is asked at the rows, angles as arcs of radius L beside lengths."""
        return np.asarray(self.unit * np.linalg.norm(self.missed(here)[:, 0], axis=1))

    # --- as a vector -------------------------------------------------------------------------------------------------------

    def vector(self, here: FitPoint) -> Array:
        """Unknowns and open drivers ``(v,)`` of one mechanism."""
        return np.concatenate([here.z[:, 0], here.theta[self.open, 0]])

    def parts(self, v: Array) -> tuple[Array, Array]:
        """``z`` and ``theta`` of a vector."""
        theta = self.theta.copy()
        u = len(self.z0)
        theta[self.open] = v[u:]
        return v[:u, None], theta[:, :, None]

    def limits(self, bounds: Bounds) -> tuple[Array, Array]:
        """Lower and upper ends of a vector."""
        low, high = np.full(len(self.z0), -np.inf), np.full(len(self.z0), np.inf)
        for k, name in enumerate(self.p.unknowns.names):
            a, b = bounds.get(name, (None, None))
            low[k], high[k] = -np.inf if a is None else a, np.inf if b is None else b
        low, high = (self.p.inside(end[:, None])[:, 0] for end in (low, high))
        # units of some are negative
        low, high = np.minimum(low, high), np.maximum(low, high)
        rest = np.full(int(self.open.sum()), np.inf)
        return np.concatenate([low, -rest]), np.concatenate([high, rest])


@dataclass(frozen=True)
class RowLimit:
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

    @property
    def ends(self) -> list[tuple[float, float]]:
        """The ends that there are, with the senses in which numbers lie on the right side of them, over their sizes."""
        return [(s / max(1.0, abs(end)), end) for s, end in ((1.0, self.least), (-1.0, self.most)) if end is not None]

    def amiss(self, here: FitPoint) -> float:
        """How far the rows of a mechanism fall short of it; infinite where there is no number."""
        values = self.of(here)
        short = max((float((-sense * (values - end)).max(initial=0.0)) for sense, end in self.ends), default=0.0)
        return short if np.isfinite(values).all() else np.inf


class RowDifferences:
    """Numbers of rows, and differences of those that have no exact derivatives; of the last rows that were asked they are known."""

    step = 1e-5
    """In variables of the vector."""

    def __init__(self, fit: Fit) -> None:
        self.fit, self._known = fit, dict[RowLimit, tuple[FitPoint, Array]]()
        self._near: tuple[Any, int, Any] = None, 0, None

    def values(self, limit: RowLimit, here: FitPoint) -> Array:
        """Numbers ``(k,)`` of the rows."""
        if self._known.get(limit, (None,))[0] is not here:
            # where there is no number rows are worse than any that have one
            self._known[limit] = here, np.nan_to_num(limit.of(here)[:, 0], nan=1e3 if limit.least is None else -1e3)
        return self._known[limit][1]

    def slopes(self, limit: RowLimit, here: FitPoint) -> Array:
        """Central differences by the vector; of one side where the rows come to that one alone."""
        base, (row, _), u = self.values(limit, here), np.nonzero(self.fit.open), len(here.z)
        # one number a row: it changes with the driver of its own row alone, so that all drivers are moved at once
        alone = len(base) >= self.fit.own
        more = (1 if alone else row.size) if limit.by_drivers and row.size else 0
        there, came = self._moved(here, u + more)
        values = limit.of(there)
        values = np.where(came & np.isfinite(values), values, base[:, None]).reshape(len(base), 2, -1)
        slope = (values[:, 0] - values[:, 1]) / (self.step * np.maximum(came.reshape(2, -1).sum(axis=0), 1))
        out = np.zeros((len(base), u + row.size))
        if more and alone:
            out[row, np.arange(u, u + row.size)] = slope[row, u]
            out[:, :u] = slope[:, :u]
        else:
            out[:, : u + more] = slope
        return out

    def _moved(self, here: FitPoint, n: int) -> tuple[FitPoint, Mask]:
        """Rows a step away from others along the first ``n`` variables, where these are one more than the unknowns along all others at
        once; which came.
        """
        if self._near[0] is not here or self._near[1] != n:
            u, v = len(here.z), len(self.fit.vector(here))
            ways, theta = np.eye(v)[:n], np.repeat(here.theta, 2 * n, axis=2)
            ways[u:, n - 1 :] = 1.0 if n == u + 1 else ways[u:, n - 1 :]
            dv = self.step * np.concatenate([ways, -ways]).T
            theta[self.fit.open] += dv[u:]
            self._near = here, n, self.fit.stepped(here, self.fit.rates(here), here.z + dv[:u], theta)
        return self._near[2]
