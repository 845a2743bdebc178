"""Whether an infinitesimal motion continues as a finite one, and where branches meet.

Finite mobility: the nullity at regular positions reached by a motion, confirmed by moving on in all its directions.
A position is regular where the nearby closed positions form a manifold whose dimension is the nullity n of the closure Jacobian.
That is confirmed by actual motion: after a random step in the null space the rows that are independent here close all loops, so
that the others depend on them there too and the rank is constant. Where that fails at every step size, the position is a change point
or shaky; steps along what goes on to second order (below) and random ones reach nearby positions, where the test is repeated: branches
of several dimensions may meet, of which random steps alone find one now and then. If none of these is regular, each direction v of the null
space N is tried alone, and what is left of it once the loops are closed by the smallest change is compared with it:

    kept = N^T (x' - x) / h,   x' closed;

a direction in which nothing moves on loses its part at any step size and does not count.
So the mobility is never above a nullity on the way. Chords of a curved motion are never ranked against each other: they differ in
direction by its curvature. Source for the notion: Connelly and Whiteley, Second-order rigidity and prestress stability, 1996.

From a regular position the motion is then followed as every path is (``maths.tracker``), n of its freedoms being given. The test
itself cannot be left to the follower: it presumes a regular start, chooses other rows where those chosen do not close all loops, and
takes no step on a branch along which the rank is nowhere full (a shaky part carried by a mechanism that moves).

Branches that meet at a singular position, to second order.
Where the closure matrix loses rank more motions ``q' = N a`` are free to first order than the mechanism has. Those that go on to second
order meet the curvature of the closure: with a basis ``x_j`` of the self-stresses, ``J^T x_j = 0``,

    x_j . bias(N a) = 0  for all j,    bias(q') the velocity part of the closure accelerations, quadratic in q'.

Source: Connelly and Servatius, Higher-order rigidity: what is the proper definition?, Discrete Comput. Geom. 11, 1994 (second order).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import field
from functools import cached_property

import numpy as np

from mechgraph.kinematics.motion_path import DriverPath
from mechgraph.kinematics.rates import PassiveMotion
from mechgraph.kinematics.solver import ClosureRank, EngineName, closure_solver, engine_for, rank_of_rows
from mechgraph.kinematics.state import CLOSED, CLOSURE_GOAL, ClosureRows, Configuration, ReducedRows, close
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import independent_rows
from mechgraph.maths.newton import Paths, closest_zeros
from mechgraph.maths.se3 import Array, Index, null_space
from mechgraph.maths.tolerances import RANKS
from mechgraph.maths.tracker import Follower
from mechgraph.memo import dataclass

BRANCHING_MOTIONS = 24
"""Motions up to which branches are sought: of more, far more branches than are told apart meet, or all of a continuum."""
TRIAL_STEPS = (0.05, 0.0125, 0.003)
"""Lengths of trial steps (radians, or lengths / L): the first ones tell a motion that returns, the last ones tolerate curvature."""
MOVED = 0.05
"""Part of a step that must be left for the position reached to count as another one."""
STEPS_SEED = 7


@dataclass(frozen=True)
class _Closed:
    """A closed position and the motions there, ``N`` orthonormal in columns of unit size."""

    system: System
    x: Array
    closure: ClosureRank
    engine: EngineName

    def reached(self, x: Array) -> _Closed:
        """A closed position reached from here."""
        rows = ClosureRows.at(Configuration(self.system, x[:, None]))
        return _Closed(self.system, x, rank_of_rows(rows, None, self.engine, RANKS.nearby), self.engine)

    @cached_property
    def N(self) -> Array:
        """Ordered by how much they meet the rows, whatever the engine: what returns meets them a little (see ``RANKS.nearby``)."""
        rows = self.closure.reduced
        N = np.linalg.qr(self.closure.motions / rows.scale[:, None])[0]
        return np.asarray(N @ np.linalg.svd(rows.matrix @ N[rows.free], full_matrices=True)[2].T)

    def increments(self, v: Array) -> Array:
        """The motion ``N v`` with its largest increment one."""
        dq = self.closure.reduced.scale * (self.N @ v)
        return np.asarray(dq / np.abs(dq).max())

    def moved(self, v: Array, h: float) -> Array | None:
        """State after a step of ``N v`` of length ``h`` with the loops closed again by the smallest change; None where not."""
        x, error = close(self.system, self._stepped(v, h), np.zeros(0, dtype=np.intp))
        return x if error <= CLOSED else None

    def _stepped(self, v: Array, h: float) -> Array:
        return self.system.advance(self.x[:, None], h * self.increments(v)[:, None])[:, 0]

    def change(self, x: Array) -> Array:
        """Increments ``(F,)`` from here to a state."""
        return self.system.difference(x[:, None], self.x[:, None])[:, 0]

    def kept(self, v: Array, h: float) -> Array:
        """What is left of the step ``v`` in the null space, in units of the step; nothing where the loops do not close."""
        x = self.moved(v, h)
        if x is None:
            return np.zeros(len(v))
        factor = h / float(np.abs(self.closure.reduced.scale * (self.N @ v)).max())
        return np.asarray(self.N.T @ (self.change(x) / self.closure.reduced.scale) / factor)

    def random(self, rng: np.random.Generator) -> Array:
        """A random direction of size one: of a random vector of all freedoms, so that no basis of the motions matters."""
        v = self.N.T @ rng.normal(size=self.N.shape[0])
        return np.asarray(v / np.linalg.norm(v))

    def steps(self, rng: np.random.Generator) -> Iterator[tuple[Array, Array]]:
        """States to which random steps lead, and the increments from here; those that do not close or come back left out."""
        # random steps away from a position that is not regular
        yield from self._away(self.random(rng) for _ in range(6))

    def along_branches(self) -> Iterator[tuple[Array, Array]]:
        """The same for steps along what goes on to second order: from each set of such motions, by their dimension, the largest first."""
        n = self.N.shape[1]
        if n > BRANCHING_MOTIONS:
            return
        rng = np.random.default_rng(STEPS_SEED)
        stress = self.closure.random_stress(rng, min(self.closure.count - self.closure.rank, n + 1))
        motions = self.closure.reduced.scale[:, None] * self.N
        curvature = _Curvature(self.system, self.x, motions, stress, np.zeros((0, n)))
        # random starts; every set attracts a part of them
        first = _unit(rng.normal(size=(n, 24)))
        a, error = closest_zeros(
            curvature.at, _CurvaturePoint.descent, lambda a, step: _unit(a + step), first, BRANCH_RESIDUAL
        )
        a = a[:, error < 1e3 * BRANCH_RESIDUAL]
        fixed = np.linalg.matrix_rank(curvature.at(a).derivatives, tol=SAME) if a.size else np.zeros(0)
        yield from self._away(a[:, np.argmax(fixed == rank)] for rank in np.unique(fixed))

    def _away(self, directions: Iterable[Array]) -> Iterator[tuple[Array, Array]]:
        for v in directions:
            x = self.moved(v, TRIAL_STEPS[0])
            if x is not None and np.abs(self.change(x)).max() > MOVED * TRIAL_STEPS[0]:
                yield x, self.change(x)

    def regular(self, v: Array) -> float:
        """Length of the first step after which the rows that are independent here close; 0 where this leaves loops open, or none does.

        Then the rank is constant nearby: the other rows depend on them not only here. Where it is not, they stay open by the square
        of the step (a change point) or a higher power (shaky), far above the closure error; of high powers a shorter step shows nothing.
        """
        rows = self.closure.reduced
        already = rows.open_part(Configuration(self.system, self.x[:, None]).residual[:, 0])
        limit = 10 * max(CLOSURE_GOAL, rows.rounding, already)
        for h in TRIAL_STEPS:
            closed = _corrected(self.system, self._stepped(v, h), rows)
            if closed is not None:
                stays = rows.open_part(Configuration(self.system, closed[:, None]).residual[:, 0]) <= limit
                return h if stays else 0.0
        return 0.0

    def proved(self, rng: np.random.Generator) -> tuple[Array, float]:
        """A random direction and the length of a step after which it is ``regular``; 0 unless it is so in a second one as well.

        One direction may lie by chance, to the accuracy of a step, in a branch of fewer dimensions; two do not.
        """
        v, other = self.random(rng), self.random(rng)
        step = self.regular(v)
        return v, step if step and self.regular(other if len(v) > 1 else -v) else 0.0

    def dimension(self) -> int:
        """Number of directions in which a step is kept."""
        table = np.stack([self.kept(v, TRIAL_STEPS[1]) for v in np.eye(self.N.shape[1])])
        # part of a step in one direction that must be left for it to count: about 1 on a motion, 0 where it returns
        return int((np.linalg.svd(table, compute_uv=False) > 0.5).sum())

    def followed(self, v: Array) -> float:
        """Length over which the motion ``N v`` goes on with the loops closed, as many single freedoms given as move independently.

        Only these can be given along a path; what turns in spheres alone (the spin of a coupler) is held, as in every solution.
        """
        single = np.flatnonzero(self.system.single_rows >= 0)
        given = np.array(independent_rows(self.N, single.tolist(), self.N.shape[1]), dtype=np.intp)
        # freedoms up to which a motion is followed with all of them given; of more a trial step says enough, and takes no
        # gigabytes of rates
        if len(given) > 200:
            return 0.0
        stroke = 0.35  # length over which a motion is followed
        ahead = stroke * self.increments(v)[given]
        if not np.abs(ahead).max(initial=0.0) > MOVED * TRIAL_STEPS[0]:
            return 0.0
        solver = closure_solver(engine_for(self.system.n_rows, 1, self.engine), given)
        path = DriverPath(self.system, solver, lambda variants: self.system)
        path.variant_of = np.zeros(1, dtype=np.intp)
        begin = self.x[path.rows]
        paths = Paths([np.stack([begin, begin + ahead], axis=1)])
        nodes = Follower(path).follow(self.x[:, None], paths).nodes
        closed = Configuration(self.system, nodes.x).closure <= CLOSED
        length = stroke * float(nodes.place[closed].max(initial=0.0)) / float(paths.end[0])
        resolution = 0.01  # parts in which that length is given: just where it ends is a matter of step control
        return resolution * np.floor(length / resolution + 1e-6)


@dataclass(frozen=True)
class FiniteMotion:
    """Result of following the motions.

    Attributes
    ----------
    mobility : dimension of the set of nearby closed positions.
    rank_nearby : largest rank of the closure Jacobian at nearby closed positions.
    begin : a position and a direction in which it moves on; None where nothing moves.
    step : length of the step by which that was confirmed.
    """

    mobility: int
    rank_nearby: int
    begin: tuple[_Closed, Array] | None = field(default=None, repr=False)
    step: float = 0.0

    @cached_property
    def stroke(self) -> float:
        """Length over which a motion was followed with the loops closed (0 where nothing moves)."""
        if not self.begin or not self.mobility:
            return 0.0
        start, v = self.begin
        return start.followed(v) or self.step or start.regular(v)

    @cached_property
    def closure_nearby(self) -> ClosureRank | None:
        """The closure equations at a position reached by a motion; None where nothing moves."""
        x = self.begin[0].moved(self.begin[1], TRIAL_STEPS[0]) if self.begin else None
        return self.begin[0].reached(x).closure if self.begin and x is not None else None

    @property
    def null_nearby(self) -> Array | None:
        """Motions ``(F, M)`` there."""
        return self.closure_nearby.motions if self.closure_nearby else None


def states_nearby(system: System, x: Array, closure: ClosureRank) -> Iterator[tuple[Array, Array]]:
    """Closed states random steps away from a closed state ``x (nx,)``, and the increments ``(F,)`` that lead there."""
    return _Closed(system, x, closure, closure.engine).steps(np.random.default_rng(STEPS_SEED))


def finite_motion(system: System, x: Array, closure: ClosureRank, engine: EngineName = "auto") -> FiniteMotion:
    """Follow the motions of a closed state ``x (nx,)`` where ``closure`` is the rank of its closure equations.

    Where the closure Jacobian has full row rank the dimension is its nullity (implicit function theorem).
    """
    start = _Closed(system, x, closure, engine)
    nullity = closure.motions.shape[1]
    if not nullity:
        return FiniteMotion(0, closure.rank)
    rng = np.random.default_rng(STEPS_SEED)
    if closure.rank == closure.count:
        return FiniteMotion(nullity, closure.rank, (start, start.random(rng)), 0.0)
    v, step = start.proved(rng)
    if step:
        return FiniteMotion(nullity, closure.rank, (start, v), step)
    return _near_by(start, rng)


def _near_by(start: _Closed, rng: np.random.Generator) -> FiniteMotion:
    """The mobility about a position that is not regular: the largest of those at positions reached from it."""
    best = FiniteMotion(0, start.closure.rank)
    rank = best.rank_nearby
    for x, change in itertools.chain(start.along_branches(), start.steps(rng)):
        length, there = float(np.abs(change).max()), start.reached(x)
        rank = max(rank, there.closure.rank)
        dimension = there.N.shape[1]
        if dimension and not there.proved(rng)[1]:
            # this near to where branches meet a step may cross to another one: only where nothing else is known
            near = length < 2 * TRIAL_STEPS[1]
            dimension = 0 if near and best.mobility else there.dimension()
        if dimension > best.mobility:
            v = there.N.T @ (change / there.closure.reduced.scale)
            best = FiniteMotion(min(dimension, start.N.shape[1]), rank, (there, v), length)
    return FiniteMotion(best.mobility, rank, best.begin, best.step)


def _corrected(system: System, x: Array, rows: ReducedRows) -> Array | None:
    """The loops closed from ``x`` in the kept rows of a nearby position alone, or as far as they close; None where that is slow from the
    first correction on.
    """
    before, goal, gained = np.inf, max(CLOSURE_GOAL, rows.rounding), False
    # corrections with the equations of the position left
    slow = 0.2  # part of the closure error that such a correction may leave
    for _ in range(12):
        residual = Configuration(system, x[:, None]).residual[:, 0]
        error = float(np.abs(rows.kept_part(residual[:, None])).max(initial=0.0))
        if error <= goal or (error < 10 * goal and error > slow * before):
            return x
        if error > slow * before:
            # curvature slows all corrections alike; what the first ones gain and a later one does not is open
            return x if gained and error > 0.5 * before else None
        before, gained = error, before < np.inf
        x = system.advance(x[:, None], rows.correction(residual)[:, None])[:, 0]
    return None


BRANCH_RESIDUAL = 1e-9
"""Residual of a branch."""
SAME = 1e-3
"""Difference of rates up to which two branches are one: rates of branches that touch are found to the square root of rounding."""


class _Curvature:
    """``x_j . bias(q')`` at multiples ``a (n, T)`` of the motions ``N (F, n)``, and rates ``given (k, n)`` of these less one."""

    def __init__(self, system: System, x: Array, N: Array, stress: Array, given: Array) -> None:
        self.system, self.x, self.N, self.stress, self.given = system, x, N, stress, given

    def residual(self, a: Array) -> Array:
        """Residuals ``(self-stresses + drivers, T)``."""
        here = Configuration(self.system, np.repeat(self.x[:, None], a.shape[1], axis=1))
        dq = self.N @ a
        V = here.link_twists(dq)
        bias = here.closure_bias(here.bias(dq, V), V)
        return np.concatenate([self.stress.T @ bias, self.given @ a - 1.0])

    def at(self, a: Array) -> _CurvaturePoint:
        """The residual with its derivatives."""
        return _CurvaturePoint(self, a)


class _CurvaturePoint:
    def __init__(self, curvature: _Curvature, a: Array) -> None:
        self.curvature, self.x, self.residual = curvature, a, curvature.residual(a)

    @cached_property
    def derivatives(self) -> Array:
        """``(T, m, n)`` in the multiples; differences are exact, as the residual is quadratic."""
        n, T = self.x.shape
        shifted = np.repeat(self.x, 2 * n, axis=1).reshape(n, T, 2, n)
        shifted += np.stack([np.eye(n), -np.eye(n)], axis=1)[:, None]
        r = self.curvature.residual(shifted.reshape(n, -1)).reshape(-1, T, 2, n)
        return np.asarray(0.5 * (r[:, :, 0] - r[:, :, 1]).swapaxes(0, 1))

    def descent(self) -> Array:
        """Steps down the sum of squares: those of Newton's method lead quadratic forms to where all vanish twice, past simple zeros."""
        J = self.derivatives
        return -np.einsum("tmn,mt->nt", J, self.residual) / np.maximum((J * J).sum(axis=(1, 2)), 1e-300)

    def steps(self) -> Array:
        """Steps of least norm to a zero."""
        return -np.einsum("tnm,mt->nt", np.linalg.pinv(self.derivatives), self.residual)


def _unit(a: Array) -> Array:
    return np.asarray(a / np.linalg.norm(a, axis=0))


def branches(
    system: System, x: Array, columns: Index, passive: Sequence[PassiveMotion] = (), miss: float = 0.0
) -> tuple[dict[str, float], ...]:
    """The branches that meet at a closed state ``x (nx,)``: rates of all freedoms by name, for unit rates of the drivers ``columns``.

    Of branches along which the drivers stand still the largest rate is one.
    Empty where there is one alone (without self-stresses there is no other), where more than ``BRANCHING_MOTIONS`` motions are possible,
    or where more than ``MOST_BRANCHES`` directions are: then a freedom is left free. The rank is decided
    to the accuracy with which closing meets a singular position (``RANKS.nearby``), and one that ``miss`` opens is found at all: branches
    that pass each other at a distance leave its square. Passive motions are at rest.
    """
    near = max(RANKS.nearby, 10.0 * np.sqrt(miss))
    found = rank_of_rows(ClosureRows.at(Configuration(system, x[:, None])), tolerance=near)
    N = found.motions
    if passive:
        idle, _ = np.linalg.qr(np.stack([p.rates for p in passive], axis=1))
        U, s, _ = np.linalg.svd(N - idle @ (idle.T @ N), full_matrices=False)
        N = U[:, s > 0.5]
    if found.rank == found.count or N.shape[1] > BRANCHING_MOTIONS:
        return ()
    # of these starts
    rng = np.random.default_rng(5)
    # so many random combinations of the self-stresses say as much about N.shape[1] motions as all of them
    stress = found.random_stress(rng, min(found.count - found.rank, N.shape[1] + 1))
    ways = _ways(_Curvature(system, x, N, stress, N[columns]), rng)
    resting = N @ null_space(N[columns], RANKS.nearby)
    if ways and resting.shape[1]:
        # a random rate of one gives every direction its size
        beside = _ways(_Curvature(system, x, resting, stress, rng.normal(size=(1, resting.shape[1]))), rng)
        ways += [way / way[np.argmax(np.abs(way))] + 0.0 for way in beside]
    # most branches that are told apart
    if not 1 < len(ways) <= 16:
        return ()
    unit = np.where(system.is_length, system.par.L, 1.0)
    names = system.m.freedom_names()
    # in an order that rounding does not change
    rates = sorted((way * unit / unit[columns[0]] for way in ways), key=lambda way: np.round(way / SAME).tolist())
    return tuple(dict(zip(names, one.tolist(), strict=True)) for one in rates)


def _ways(curvature: _Curvature, rng: np.random.Generator) -> list[Array]:
    """The rates ``(F,)`` that have no residual, found from random starts."""
    # random starts of the search; k self-stresses that are not those of a regular position allow 2^k branches
    first = rng.normal(size=(curvature.N.shape[1], 64))
    a, error = closest_zeros(curvature.at, _CurvaturePoint.steps, np.add, first, BRANCH_RESIDUAL)
    ways: list[Array] = []
    for one in (curvature.N @ a[:, error < 1e3 * BRANCH_RESIDUAL]).T:
        if all(np.abs(one - other).max() > SAME for other in ways):
            ways.append(np.where(np.abs(one) < SAME**2, 0.0, one))
    return ways


def branches_text(ways: Sequence[dict[str, float]], driver: str) -> str:
    """Branches by the rates of the freedoms in which they differ, in words."""
    # most freedoms listed of a branch
    differ = [name for name in ways[0] if np.ptp([way[name] for way in ways]) > SAME][:8]
    texts = [
        (f"{driver} at rest, " if not way[driver] else "")
        + ", ".join(f"{n} {way[n]:.4g}" for n in differ if n != driver)
        for way in ways
    ]
    return f"{len(ways)} branches meet there, by their rates for a unit rate of {driver}: " + "; ".join(
        f"({i}) {text}" for i, text in enumerate(texts, 1)
    )
