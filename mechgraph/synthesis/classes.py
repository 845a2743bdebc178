"""The class of a task: random complex mechanisms of the topology, and the tasks that they do; tracks of their dimensions between tasks.

Known dimensions move as in ``modes.family``, such that loops keep the groups in which they move; what is asked is whatever a random
mechanism does at random positions, so that a class holds tasks which can be done. Of every row of the task as many equations count as
the closure has independent ones in its coordinates and the unknowns; beyond the coordinates that it settles these are its conditions.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from copy import copy
from functools import cached_property

import numpy as np
import scipy.linalg

from mechgraph.graph.linkgraph import link_graph
from mechgraph.kinematics.state import CLOSED, Configuration, close
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import complement, rank_of, singular_values
from mechgraph.maths.newton import least_norm_steps
from mechgraph.maths.se3 import Index, cross, finite_twist, inverse, move_twist, pose_exp, rotation_exp
from mechgraph.maths.tolerances import MODES
from mechgraph.modes.compiled_tracks import CompiledTracks
from mechgraph.modes.family import Array, Family, common, generated
from mechgraph.modes.homotopy import ENDLESS_STATE, Equations, Mask
from mechgraph.synthesis.legs import ClassMember, RowBlock, TaskLeg, compiled_tracks
from mechgraph.synthesis.rods import RodProblem, rods_of
from mechgraph.synthesis.system import ArrowRows, RowNumbers, RowProblem


class NoClass(Exception):
    """No random mechanism of the class could be closed at random positions."""


class TaskClass:
    """Equations of a class of tasks, as ``modes.homotopy`` follows them: states are the unknowns ``z (u,)`` and those of all rows.

    ``free[i]`` are the freedoms of row ``i`` of which nothing is asked; rows of equal shape are eliminated together, in ``blocks``;
    ``conditions (R,)`` are left for the unknowns, of which ``matrix (u, u)`` is that of a random member at its solution ``x``; solutions of
    two runs are one where ``fingerprints`` are less than ``apart``, against their size, from each other.

    Raises
    ------
    NoClass
    """

    idle = 0
    apart = MODES.one_assembly

    def __init__(self, problem: RowProblem, rng: np.random.Generator) -> None:
        self.whole = problem
        self._lay_out(problem)
        start = problem.inside(problem.unknowns.declared[:, None])
        # declared values may be anything, all in one place too: the class is read at others, with which some may not close
        for _ in range(8):
            spread = problem.numbers.with_values(problem.places, start + rng.normal(size=start.shape))
            here = Configuration(problem.system_with(spread), problem.at_rest[:, None])
            if problem.closed_at_start or close(here.system, here.x[:, 0], _NONE)[1] < CLOSED:
                break
        if not problem.closed_at_start:
            here = Configuration(here.system, close(here.system, here.x[:, 0], _NONE)[0][:, None])
        algebras, rods = self._algebras(here), rods_of(problem)
        free = [np.zeros((6, 0))] * (len(problem.order) - len(algebras))
        if rods:
            problem = RodProblem(problem, rods)
            numbers = spread.of_pairs(problem.order)
            here = Configuration(problem.system_with(numbers), here.x[problem.state_rows])
            self._lay_out(problem)
        self.algebras = [[*algebras, *free][k] for k in problem.order]
        self._of_rows(here)
        self._read(rng)

    def _lay_out(self, problem: RowProblem) -> None:
        """Where everything stands in the states of a problem."""
        self.problem, s = problem, problem.system
        self.u, self.R, self.states = problem.u, len(problem.rows), s.n_state
        # behind the state of a row stand the coefficients of its rates, as far as any are asked
        orders, F = len(problem.rates), s.n_freedoms
        self.nx, self.F = s.n_state + orders * F, F * (1 + orders)
        self.columns = problem.asked_columns
        rows = [s.single_rows[problem.columns], *(s.n_state + k * F + problem.columns for k in range(orders))]
        self.asked_rows: Index = np.concatenate(rows)
        self.is_length = np.concatenate(
            [s.is_length[problem.columns], np.ones(orders * len(problem.columns), dtype=bool)]
        )
        self.asked = np.concatenate([problem.asked, *problem.rates], axis=1)[problem.rows]
        self.given = ~np.isnan(self.asked)
        asked = self.given.reshape(self.R, 1 + orders, -1).any(axis=2)
        # the highest order of which anything is asked of a row
        self.orders = np.where(asked, np.arange(1 + orders), 0).max(axis=1, initial=0)
        self.free = self._free_columns()
        self.W = problem.numbers.norms.size if any(p.turns for own in problem.places for p in own) else 0
        self.family = self

    def _of_rows(self, here: Configuration) -> None:
        """What is known of a row."""
        self.here, s = here, here.system
        self.of_row = Equations(Family(here, self.problem.columns, np.zeros((s.n_freedoms, 0))), None)

    @cached_property
    def full(self) -> TaskClass:
        """The same with all rods in their places and all that is asked: for what ``lifted`` makes of states."""
        if self.problem is self.whole and not self.followed.any():
            return self
        out = copy(self)
        vars(out)["compiled"] = None
        out._lay_out(self.whole)
        out._of_rows(Configuration(self.whole.system, self.whole.at_rest[:, None]))
        # what is lifted needs places in states alone
        vars(self)["full"] = out
        out.start, x = self.lifted(self.start, self.x[:, None])
        out.x = x[:, 0]
        return out

    def row(self, i: int) -> TaskClass:
        """A row by itself."""
        out = copy(self)
        out.R, out.given, out.free, out.orders = 1, self.given[[i]], [self.free[i]], self.orders[[i]]
        return out

    def lifted(self, member: ClassMember, x: Array) -> tuple[ClassMember, Array]:
        """A member and states ``x (nx, T)`` of it with all rods in their places."""
        p = self.problem
        if not isinstance(p, RodProblem):
            return member, x
        numbers = self.numbers_at(member, x)
        rows = x[self.head :].reshape(self.R, self.nx, -1)
        back = np.argsort(p.order)
        states = p.lifted(numbers, rows[:, : self.states])
        norms = (
            x[self.u : self.head].reshape(4, len(back), x.shape[1])[:, back].reshape(self.W, x.shape[1])
            if self.W
            else x[:0]
        )
        every = [x[: self.u], norms]
        member, whole, T = ClassMember(member.numbers.of_pairs(back), member.drive), self.full, x.shape[1]
        F = whole.problem.system.n_freedoms
        states = np.concatenate([states, np.zeros((self.R, whole.nx - whole.states, T), dtype=x.dtype)], axis=1)
        # rates are linear in those of lower orders
        for k in range(1, 1 + len(p.rates)):
            here = whole.at(member, np.concatenate([*every, states.reshape(self.R * whole.nx, T)]).astype(complex))
            n = here.residual.shape[1] // (1 + len(p.rates))
            J, left = here.by_coordinates[:, :n, :F].copy(), here.residual[:, k * n : (k + 1) * n]
            asked = whole.given.reshape(self.R, 1 + len(p.rates), -1)[:, k]
            for i, given in enumerate(asked):
                J[i][:, whole.problem.columns[given]] = 0.0
            own = slice(whole.states + (k - 1) * F, whole.states + k * F)
            step = [least_norm_steps(A, b, MODES.generic) for A, b in zip(J, left, strict=True)]
            rates = here.x[:, own] + np.where((self.orders >= k)[:, None, None], step, 0.0)
            states[:, own] = rates if np.iscomplexobj(x) else rates.real
        return member, np.concatenate([*every, states.reshape(self.R * whole.nx, T)])

    # --- the class ---------------------------------------------------------------------------------------------------

    def _free_columns(self) -> list[Index]:
        """Of every row the coordinates of which nothing is asked; of rates those of as high an order as any asked there."""
        p, out = self.problem, list[Index]()
        for i, given in enumerate(self.given):
            free = complement(self.columns[given], p.system.n_freedoms * (1 + int(self.orders[i])))
            # a declared row that is closed by itself stays where it is, but for what names its points
            out.append(free[free >= p.system.first_column[p.own]] if self._rests(i) else free)
        return out

    def _rests(self, i: int) -> bool:
        """Whether a row is the declared one, closed by itself."""
        return bool(self.problem.closed_at_start and self.problem.rows[i] == 0)

    def _algebras(self, here: Configuration) -> list[Array]:
        """For every pair a basis ``(6, k)`` of the motions by which its place may be moved, in the global frame ``here``.

        Of loops of the mechanism itself their own twists tell; of those that only what is asked of a link closes, its poses do too.
        """
        P, S = len(self.problem.m.pairs), here.S[:, :, 0]
        through: list[list[Array]] = [[] for _ in range(P)]

        def pass_through(loops: Iterable[list[int]], pairs: list[int]) -> None:
            for loop in loops:
                algebra = generated(np.concatenate([self._motions(k, S) for k in loop], axis=1))
                for k in set(loop).intersection(pairs):
                    through[k].append(algebra)

        pass_through(([k for k, _ in loop] for loop in self.problem.m.once(link_graph).loops), list(range(P)))
        alone = [k for k in range(P) if not through[k]]
        pass_through(([k for k, _ in loop] for loop in here.system.graph.loops), alone)
        return [common(algebras) if algebras else np.zeros((6, 0)) for algebras in through]

    def _motions(self, k: int, S: Array) -> Array:
        """Twists ``(6, n)`` that a pair adds to a loop: its own; of a free pair those to poses asked, where nothing is free."""
        problem, s = self.problem, self.problem.system
        columns = np.arange(s.first_column[k], s.first_column[k + 1])
        at = [int(j[0]) for column in columns if (j := np.flatnonzero(problem.columns == column)).size]
        values = problem.asked[:, at].T
        if k < len(problem.m.pairs) or len(values) < 6 or np.isnan(values).any():
            return S[:, columns]

        def pose(values: Array) -> tuple[Array, Array]:
            turns = [rotation_exp(np.eye(3)[:, [j]] * values[3 + j]) for j in range(3)]
            return np.einsum("iat,abt,bjt->ijt", *turns), values[:3]

        R, place = pose(values)
        # from the first pose, which is the identity where pairs stand by point and axis
        turn = np.einsum("iat,ja->ijt", R, R[:, :, 0])
        moved = place - np.einsum("ijt,j->it", turn, place[:, 0])
        e = finite_twist(turn, moved, np.zeros_like(place))
        # where twists are asked their rates add to the motions: derivatives by complex steps
        for rates in (rates[:, at].T for rates in problem.rates[:1]):
            step = np.nan_to_num(rates) * MODES.span
            R1, place1 = pose(values + 1j * step)
            w = np.einsum("ijt,kjt->ikt", R1.imag, R) / MODES.span
            w = np.array([w[2, 1], w[0, 2], w[1, 0]])
            e = np.concatenate([e, [*w, *(place1.imag / MODES.span - cross(w, place))]], axis=1)
        e[3:] += cross(e[:3], problem.origin[:, None]) / problem.L
        size = np.abs(e).max(axis=0)
        return np.asarray(e[:, size > MODES.span] / size[size > MODES.span])

    def _read(self, rng: np.random.Generator) -> None:
        """Ranks of all rows at a random mechanism of the class, and a start there."""
        # random mechanisms of which the best one is the start
        found, x = self.random_closed(rng, 6)
        self.start, self.x = found[0], x[:, 0]
        rows = self.at(self.start, self.x[:, None])
        J, B = rows.by_coordinates[..., 0], rows.by_unknowns[..., 0]
        n, ranks, settled = J.shape[1], [], []
        self._leave_followers(J, B)
        for i, free in enumerate(self.free):
            own = slice(self.counted(n, i))
            settled.append(_rank(J[i][own, free]))
            ranks.append(_rank(np.concatenate([J[i][own, free], B[i][own]], axis=1)))
        self.conditions = np.array(ranks) - np.array(settled)
        shapes = [
            (rank, many, len(free), int(order))
            for rank, many, free, order in zip(ranks, settled, self.free, self.orders, strict=True)
        ]
        self.blocks = [
            self._block(shape, [i for i, own in enumerate(shapes) if own == shape], n, rng)
            for shape in dict.fromkeys(shapes)
        ]
        matrices = self._matrices(found, x)
        best = int(_by_condition(matrices)[0])
        self.start, self.x, self.matrix = found[best], x[:, best], matrices[best]

    def _leave_followers(self, J: Array, B: Array) -> None:
        """Ask nothing of numbers that follow from others of their row, whatever the mechanism: what they are is looked at in the end.

        Ways between tasks lead straight on, and would ask of such numbers what no mechanism does. Angles are kept before lengths.
        """
        angles_first, every = np.argsort(self.is_length, kind="stable"), self.given.copy()
        for i, own in enumerate(every):
            k, F = self.counted(J.shape[1], i), self.problem.system.n_freedoms
            # a declared row that is closed by itself stays where it is: of it rates alone may follow
            columns = [c for c in angles_first if own[c] and (not self._rests(i) or self.columns[c] >= F)]
            A = np.concatenate([J[i][:k, self.columns[columns]], J[i][:k, self.free[i]], B[i][:k]], axis=1)
            ways = scipy.linalg.null_space(A, MODES.generic)[: len(columns)]
            for j, c in enumerate(columns):
                self.given[i, c] = (
                    np.subtract(*(np.linalg.matrix_rank(ways[:n], MODES.generic) for n in (j + 1, j))) > 0
                )
        self.free, self.followed = self._free_columns(), (every & ~self.given).any(axis=1)

    def missed(self, rng: np.random.Generator) -> Array:
        """By how much every row ``(R,)`` that asks for numbers which follow from others is missed, each with dimensions of its own."""
        of, out, which = self.full, np.zeros(self.R), np.flatnonzero(self.followed)
        p, goal = of.problem, of.goal(of.problem.numbers)
        goal = ClassMember(goal.numbers, goal.drive.real)
        # tries of each row, more where none of the first ones comes to rest
        for tries in (6, 24) if which.size else ():
            row = np.repeat(which, tries)
            T = len(row)
            z = p.inside(p.unknowns.declared[:, None]) + rng.normal(size=(of.u, T))
            moved = np.array([not self._rests(i) for i in row.tolist()]) * rng.normal(size=(p.system.n_freedoms, T))
            rest = p.system.advance(p.at_rest[:, None], moved)
            states = np.concatenate([rest, np.zeros((of.nx - of.states, T))])
            norms = p.numbers.with_values(p.places, z).norms.reshape(-1, T)[: of.W]
            x, left = np.concatenate([z, norms, *[states] * of.R]), np.full(T, np.inf)
            # Newton steps, until one of each comes to rest there
            for _ in range(40):
                rows, step = of.at(goal, x), np.zeros((of.head + of.R * of.F, T))
                for i in which.tolist():
                    at, free = np.flatnonzero(row == i), of.free[i]
                    k = of.counted(rows.residual.shape[1], i)
                    open_ = rows.residual[i][:k, at]
                    left[at] = np.abs(open_).max(axis=0)
                    J = np.concatenate(
                        [rows.by_unknowns[i][:k, :, at], rows.by_coordinates[i][:k, free][..., at]], axis=1
                    )
                    own = np.array([*range(of.u), *(of.head + i * of.F + free)])
                    step[np.ix_(own, at)] = least_norm_steps(J, open_, MODES.generic).real
                out[which] = [left[row == i].min() for i in which]
                if (out[which] <= MODES.real_closed).all():
                    break
                x = of.advance(of.state(rows).real, step / np.maximum(1.0, np.abs(step).max(axis=0)))
            if not (which := np.flatnonzero(out > MODES.real_closed)).size:
                break
        return out

    def _matrices(self, members: Sequence[ClassMember], x: Array) -> Array:
        """Matrices ``(n, u, u)`` of the unknowns of members at their solutions ``x (nx, n)``; of none but zeros ``(n, u, 0)``."""
        every = np.arange(len(members))
        if not (self.u and self.conditions.any()):
            return np.zeros((len(every), self.u, 0))
        joined = ClassMember.joined(members)
        return self.leg(joined, joined, every).at(x, np.zeros(len(every)), every).matrix

    def random_closed(self, rng: np.random.Generator, n: int) -> tuple[list[ClassMember], Array]:
        """Random mechanisms of the class at random positions: what they do there are tasks that they solve; their states ``(nx, n)``.

        Raises
        ------
        NoClass
        """
        s, problem, R = self.problem.system, self.problem, self.R
        members, states = list[ClassMember](), list[Array]()
        still = [i for i in range(R) if problem.closed_at_start and problem.rows[i] == 0]
        # rounds of random mechanisms, after which a class is said to have none
        for _ in range(8):
            # some of them do not close
            more = n - len(members) + 2
            z = _random(rng, self.u * more).reshape(self.u, more)
            places = np.concatenate([self._random_places(rng) for _ in range(more)], axis=-1)
            numbers = problem.numbers.moved(places).with_values(problem.places, z)
            system, X = problem.system_with(numbers), np.full((R, s.n_state, more), np.nan, dtype=complex)
            # random positions tried until one closes without angles far from real ones
            for _ in range(6):
                row, which = np.nonzero(np.isnan(X[:, 0]))
                if not len(row):
                    break
                dq = _random(rng, s.n_freedoms * len(row)).reshape(s.n_freedoms, -1)
                dq[:, np.isin(row, still)] = 0.0
                begin = s.advance(np.tile(problem.at_rest[:, None].astype(complex), len(row)), dq)
                x, error = _closed(system.cases(which), begin)
                good = (error < MODES.member_closed) & ~self.of_row.far(x, MOST_TURNED)
                X[row[good], :, which[good]] = x[:, good].T
            for i in np.flatnonzero(~np.isnan(X[:, 0]).any(axis=0))[: n - len(members)]:
                own = numbers.taken(np.array([i]))
                x = self._with_rates(own, X[:, :, i, None], rng)
                members.append(ClassMember(own, x[:, self.asked_rows] / problem.factors(own)))
                states.append(np.concatenate([z[:, i], own.norms.ravel()[: self.W], x.ravel()]))
            if len(members) == n:
                return members, np.array(states).T
        raise NoClass

    def _with_rates(self, numbers: RowNumbers, x: Array, rng: np.random.Generator) -> Array:
        """Closed states ``x (R, nx, 1)`` with random rates behind them, where any are asked, that the closure allows."""
        F = self.problem.system.n_freedoms
        x = np.concatenate([x, np.zeros((self.R, self.nx - self.states, 1), dtype=complex)], axis=1)
        for k in range(1, 1 + len(self.problem.rates)):
            mine = [i for i in range(self.R) if self.given[i].reshape(-1, len(self.problem.columns))[k:].any()]
            own = slice(self.states + (k - 1) * F, self.states + k * F)
            x[mine, own, 0] = _random(rng, F * len(mine)).reshape(len(mine), F)
            rows = self.problem.equations(numbers, x)
            n = rows.residual.shape[1] // (1 + len(self.problem.rates))
            J, left = rows.by_coordinates[:, :n, :F, 0], rows.residual[:, k * n : (k + 1) * n]
            step = least_norm_steps(J.transpose(1, 2, 0), left[:, :, 0].T, MODES.generic)
            x[mine, own, 0] += step.T[mine]
        return x

    def _random_places(self, rng: np.random.Generator) -> Array:
        """Known places moved at random, such that loops keep the groups in which they move ``(3, 4, 2, P, 1)``."""
        P, s = len(self.problem.order), self.problem.system
        moves = np.zeros((6, 2, P, 1), dtype=complex)
        for k, basis in enumerate(self.algebras):
            moves[:, :, k] = (basis @ (0.5 * _random(rng, basis.shape[1])))[:, None, None]
            if k < self.problem.own and self.problem.whole.pairs[k].on_a is not None:
                # a place that is declared on each link by itself moves on each by itself
                for side, link in enumerate((s.a[k], s.b[k])):
                    own = basis @ (0.5 * _random(rng, basis.shape[1]))
                    moves[:, side, k] = move_twist(inverse(self.here.poses[:, :, link]), own[:, None])
        return pose_exp(moves)

    def random_members(self, rng: np.random.Generator, n: int) -> list[ClassMember]:
        """Random mechanisms and random tasks like those that they do; what is asked of one row is asked of it alone.

        Of three times as many those that are far from singular: ways to solutions that nearly meet take many steps.

        Raises
        ------
        NoClass
        """
        found, x = self.random_closed(rng, 3 * n)
        return [found[i] for i in _by_condition(self._matrices(found, x))[:n]]

    def counted(self, n: int, i: int) -> int:
        """How many of ``n`` equations, order by order, count at a row: of no higher order than is asked there."""
        return n * (1 + int(self.orders[i])) // (1 + len(self.problem.rates))

    def error(self, rows: ArrowRows) -> Array:
        """The largest part of what is left open at any row ``(T,)``."""
        left = [np.abs(own[: self.counted(len(own), i)]).max(axis=0) for i, own in enumerate(rows.residual)]
        return np.max(left, axis=0, initial=0.0) if left else np.zeros(rows.T)

    def _block(self, shape: tuple[int, int, int, int], rows: list[int], n: int, rng: np.random.Generator) -> RowBlock:
        """Rows of ``(rank, settled, free, order)`` such equations and coordinates, of ``n`` equations in all."""
        rank, settled, free, _ = shape
        k = self.counted(n, rows[0])
        mix = np.zeros((len(rows), rank, n), dtype=complex)
        mix[:, :, :k] = np.linalg.qr(rng.normal(size=(len(rows), k, k)) + 1j * rng.normal(size=(len(rows), k, k)))[0][
            :, :rank
        ]
        columns = np.array([self.free[i] for i in rows], dtype=np.intp).reshape(len(rows), free)
        ways = np.zeros((len(rows), self.F, free))
        ways[np.arange(len(rows))[:, None], columns, np.arange(free)] = 1.0
        return RowBlock(np.array(rows), settled, ways, None if rank == n else mix)

    # --- states ------------------------------------------------------------------------------------------------------

    @property
    def head(self) -> int:
        """Numbers of a state before those of rows: unknowns, and norms of directions where these are unknown."""
        return self.u + self.W

    def wide(self, values: Array) -> Array:
        """``(R n, T)`` as ``(n, R T)``."""
        T = values.shape[1]
        n = len(values) // self.R
        return values.reshape(self.R, n, T).transpose(1, 0, 2).reshape(n, self.R * T)

    def tall(self, values: Array) -> Array:
        """``(n, R T)`` as ``(R n, T)``."""
        n = len(values)
        T = values.shape[1] // self.R
        return values.reshape(n, self.R, T).transpose(1, 0, 2).reshape(n * self.R, T)

    def advance(self, x: Array, dq: Array) -> Array:
        """States after increments."""
        here, step, F = self.wide(x[self.head :]), self.wide(dq[self.head :]), self.problem.system.n_freedoms
        rows = self.problem.system.advance(here[: self.states], step[:F])
        return self._joined(x[: self.head] + dq[: self.head], rows, here[self.states :] + step[F:])

    def _joined(self, head: Array, rows: Array, rates: Array) -> Array:
        """What stands before rows, in them, and in the rates behind them."""
        return np.concatenate([head, self.tall(np.concatenate([rows, rates]))])

    def state_rates(self, x: Array, dq: Array) -> Array:
        """Rates of states for rates of increments."""
        here, step, F = self.wide(x[self.head :]), self.wide(dq[self.head :]), self.problem.system.n_freedoms
        return self._joined(dq[: self.head], self.of_row.state_rates(here[: self.states], step[:F]), step[F:])

    def normal(self, x: Array) -> Array:
        """States with unit quaternions."""
        here = self.wide(x[self.head :])
        return self._joined(x[: self.head], self.of_row.normal(here[: self.states]), here[self.states :])

    def far(self, x: Array, angle: float = ENDLESS_STATE[0]) -> Mask:
        """Which are on their way to infinity."""
        here = self.wide(x[self.head :])
        rows = self.of_row.far(here[: self.states], angle) | (
            np.abs(here[self.states :]).max(axis=0, initial=0.0) > ENDLESS_STATE[1]
        )
        return rows.reshape(self.R, -1).any(axis=0) | (np.abs(x[: self.u]).max(axis=0, initial=0.0) > ENDLESS_STATE[1])

    def wound(self, change: Array) -> Array:
        """Largest change ``(T,)`` of an angle."""
        return self.of_row.wound(self.wide(change[self.head :])[: self.states]).reshape(self.R, -1).max(axis=0)

    def size(self, x: Array, dq: Array) -> Array:
        """Largest increment ``(T,)``, against the size of lengths."""
        here, step, F = self.wide(x[self.head :]), self.wide(dq[self.head :]), self.problem.system.n_freedoms
        rates = (np.abs(step[F:]) / (1.0 + np.abs(here[self.states :]))).max(axis=0, initial=0.0)
        rows = np.maximum(self.of_row.size(here[: self.states], step[:F]), rates).reshape(self.R, -1).max(axis=0)
        own = (np.abs(dq[: self.u]) / (1.0 + np.abs(x[: self.u]))).max(axis=0, initial=0.0)
        return np.maximum(rows, own)

    def fingerprints(self, member: ClassMember, x: Array) -> Array:
        """What tells mechanisms apart: their unknowns."""
        return self.told(x)

    def told(self, x: Array) -> Array:
        """Unknowns ``(u, T)`` at states; those that whole turns change as what is the same for all of these."""
        turns, out = self.problem.turns, x[: self.u]
        if turns.whole:
            told = turns.told @ out[turns.which]
            told[: turns.whole] = np.exp(2j * np.pi * told[: turns.whole])
            out = out.astype(complex)
            out[turns.which] = told
        return out

    # --- equations ---------------------------------------------------------------------------------------------------

    @cached_property
    def compiled(self) -> CompiledTracks | None:
        """Tracks in the kernel, where it serves the class."""
        return compiled_tracks(self)

    def leg(self, begin: ClassMember, end: ClassMember, which: Index | None = None) -> TaskLeg:
        """The ways between members."""
        return TaskLeg(self, begin, end, which)

    @cached_property
    def turning(self) -> Mask:
        """Which markers ``(2 P,)`` have unknown directions: the others go on rigidly from member to member."""
        out = np.zeros((2, len(self.problem.order)), dtype=bool)
        for p in (p for own in self.problem.places for p in own if p.turns):
            out[p.side, p.pair] = True
        return out.ravel()

    def goal(self, numbers: RowNumbers) -> ClassMember:
        """Mechanisms with such numbers, and the task at hand."""
        drive = np.nan_to_num(self.asked)[:, :, None].astype(complex)
        return ClassMember(numbers, np.repeat(drive, numbers.point.shape[-1], axis=-1))

    def numbers_at(self, member: ClassMember, x: Array) -> RowNumbers:
        """The numbers of members at states, with the unknown ones of these."""
        near = x[self.u : self.head].reshape(2, 2, len(self.problem.order), x.shape[1]) if self.W else None
        return member.numbers.with_values(self.problem.places, x[: self.u], near)

    def at(self, member: ClassMember, x: Array) -> ArrowRows:
        """The equations of members at states of which what is asked is set to what they ask."""
        numbers = self.numbers_at(member, x)
        X, drive = x[self.head :].reshape(self.R, self.nx, -1).copy(), member.drive * self.problem.factors(numbers)
        for i, given in enumerate(self.given):
            X[i, self.asked_rows[given]] = drive[i, given]
        return self.problem.equations(numbers, X, np.where(self.given[:, :, None], member.drive, 0.0))

    def state(self, rows: ArrowRows) -> Array:
        """The states of equations."""
        z = [rows.numbers.at(places) for places in self.problem.places]
        norms = rows.numbers.norms.reshape(-1, rows.T)[: self.W]
        return np.concatenate([np.array(z).reshape(self.u, rows.T), norms, rows.x.reshape(-1, rows.T)])


_NONE: Index = np.zeros(0, dtype=np.intp)
MOST_TURNED = 2.0
"""Imaginary part of an angle up to which a random mechanism serves as a start."""


def _random(rng: np.random.Generator, n: int) -> Array:
    return np.asarray(rng.normal(size=(n, 2)) @ [0.7, 0.5j])


def _closed(system: System, x: Array) -> tuple[Array, Array]:
    """States ``(nx, T)`` of as many cases after limited Gauss-Newton steps, and their closure errors: most random ones close."""
    out, going = x.copy(), np.arange(x.shape[1])
    with np.errstate(all="ignore"):
        # steps after which one that is not closed is given up
        for _ in range(20):
            here = Configuration(system.cases(going), x)
            step = least_norm_steps(here.J, here.residual, MODES.generic)
            size = np.abs(step).max(axis=0)
            out[:, going] = x = system.advance(x, step * np.minimum(1.0, 0.5 / np.maximum(size, 1e-300)))
            # a step to rounding from what its square is left of
            left = size > 1e-9
            going, x = going[left], x[:, left]
            if not going.size:
                break
        return out, Configuration(system, out).closure


def _by_condition(matrices: Array) -> Index:
    """Numbers of matrices ``(n, ., .)`` in the order of their condition."""
    return np.argsort(np.linalg.cond(matrices)) if matrices.size else np.arange(len(matrices))


def _rank(A: Array) -> int:
    return rank_of(singular_values(A), MODES.generic) if A.size else 0
