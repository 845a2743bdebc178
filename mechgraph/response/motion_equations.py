"""Equations of motion: charts of the freedoms, and accelerations.

Charts: independent freedoms in which the motion is followed for a while, and states closed for given values of them.

A chart is laid out at a closed state: its independent freedoms are those that a pivoted QR of the motions picks, so that all others move
at like rates there. Rotations are measured from the state at which the chart was laid out, so that no rotation has a singular place. When
the other freedoms come to move much faster, a new chart takes over.

Accelerations of many freedoms by one sparse factorization a state: the accelerations of all links stay unknowns.

The mass matrix of the independent rates is full: every link moves with all freedoms on its way to the frame. Gauss' principle with the
accelerations ``A`` of the links as unknowns of their own, and the way along the tree as a constraint, is sparse (a saddle point system),
so that the effort grows with the number of links, not with its square or third power:

    [ I   0        D^T  ] [A ]   [W            ]
    [ 0   0     -(SZ)^T ] [v'] = [Z^T tau      ]     D A = A_link - A_parent,   (SZ)_kl = sum over freedoms j of the pair: s S_j Z_jl
    [ D  -SZ       0    ] [mu]   [0            ]

for the tree's pairs ``k``, independent rates ``l`` and the sense ``s`` of the tree; ``-mu`` are the wrenches that carry the loads along it.
Source of the form: Featherstone, Rigid Body Dynamics Algorithms, 2008, section 3.2 (Gauss' principle), chapter 10.

The equations of motion in independent rates: accelerations beside the loads, for a batch of states.

The rates of all freedoms are ``q' = Z v + Z_p p'`` with the independent rates ``v (n,)`` and those of the prescribed freedoms ``p``; ``Z``
solves the closure ``J Z = 0``. The principle of virtual power along every column of ``Z`` eliminates the reactions:

    M v' = Q,   M_kl = sum over links V_k . I V_l,   Q_k = sum over links V_k . (W - I A_0 - V x* I V) + Z_k . tau

with ``V_k`` the twists of the links for the column, ``W`` the applied wrenches, ``tau`` the given efforts, and ``A_0`` the accelerations
for ``v' = 0``. It is the Schur complement of Lee's system (1977, section 3.5), in which the independent accelerations are unknowns beside
the reactions. Source of the form: Kane and Levinson, Dynamics: Theory and Applications, 1985, chapter 6.

The equations of motion by the compiled kernel, where it carries what moves (``kernel/motion.c``, ``kernel/calls.c``).
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property, partial
from itertools import chain
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
import scipy

from mechgraph import outcome
from mechgraph.force.friction import Rubbed
from mechgraph.force.friction_problem import rubbed_in_motion
from mechgraph.force.loads import Site, inertia_wrenches
from mechgraph.force.reactions import ForceProblem
from mechgraph.graph.linkgraph import Tree
from mechgraph.kernel import build
from mechgraph.kernel.tables import Integers, layout, pointer, tables, why_not, why_not_load
from mechgraph.kinematics.motion_path import BLOCK
from mechgraph.kinematics.rates import PassiveMotion, PassiveMotions, Rates, Velocities
from mechgraph.kinematics.solver import closure_rank, closure_solver
from mechgraph.kinematics.state import ClosureSolver, Configuration, FactoredClosure
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import Factors
from mechgraph.maths.se3 import Array, Index, cross, rotate, rotate_back
from mechgraph.maths.tolerances import PATH, RESPONSE
from mechgraph.memo import dataclass
from mechgraph.model.friction import Friction, rubbing_loads
from mechgraph.model.loads import Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.response.rough import Rolling, Rough, rough_freedoms


class Stopped(Exception):
    """The motion cannot be followed on; the message says why.

    ``kind``: why friction ends it, where it does; ``at``: the last time up to which it holds, where that is not the end of its last step.
    """

    def __init__(self, message: str, kind: str = "", at: float | None = None) -> None:
        super().__init__(message)
        self.kind, self.at = kind, at


@contextmanager
def stopping(what: str) -> Iterator[None]:
    """What a function of a user raises stops the motion, which is kept up to there."""
    try:
        yield
    except Exception as error:
        raise Stopped(f"{what} raised {type(error).__name__}: {error}") from error


@dataclass(frozen=True)
class Held:
    """Passive motions that are held at rest, and the ``places`` of the independent freedoms that stand for them in a chart."""

    motions: tuple[PassiveMotion, ...]
    places: Index


@dataclass(frozen=True)
class ClosedChart:
    """A closed state: evaluated, factored, which positions were closed ``(T,)``, and the passive motions held."""

    here: Configuration
    f: FactoredClosure
    done: Array
    held: Held | None = None


class Chart:
    """Independent freedoms ``free`` beside the ``prescribed`` ones, from the closed state ``x0 (nx,)``.

    Those that are ``moving`` have rates of their own; the others stand for the passive motions ``held`` at that state, whose rates follow.
    """

    def __init__(
        self,
        system: System,
        x0: Array,
        prescribed: Index,
        engine: Literal["dense", "sparse"],
        held: tuple[PassiveMotion, ...] = (),
    ) -> None:
        self.system, self.x0, self.prescribed = system, x0, prescribed
        here = Configuration(system, x0[:, None])
        null = closure_rank(here, prescribed, engine).motions
        passive, moving = _apart(null, held) if held else (np.zeros(0, dtype=np.intp), _leading(null))
        self.free: Index = np.sort(np.append(passive, moving)).astype(np.intp)
        self.moving: Index = np.sort(moving)
        self.held = Held(held, np.flatnonzero(np.isin(self.free, passive))) if held else None
        self.solver: ClosureSolver = closure_solver(engine, np.concatenate([self.free, prescribed]))
        self.which = self.solver.chosen(here, np.full(1, -1))
        self.start = here
        self.factors = self.solver.factored(here, self.which)
        self.steepness, self.condition = self.shape(self.factors)
        self._singles = system.single_rows[self.free]
        self.turns = bool((self._singles < 0).any())
        rows = system.single_rows[prescribed]
        # turns of balls that are held stay as they are, since nothing moves them
        self._given, self._rows = rows >= 0, rows[rows >= 0]
        # a slide along a straight line, which may travel far beyond the size of a mechanism, leads to no other branch
        curved = [c for b in system.moving_batches for c in np.ravel(np.arange(system.n_freedoms)[b.columns])]
        self._bends = ~system.is_length | np.isin(np.arange(system.n_freedoms), curved)

    def shape(self, f: FactoredClosure) -> tuple[float, float]:
        """The largest rate of a freedom for unit rates of the independent ones, and the condition, at a state."""
        return float(np.abs(f.sensitivity()[:, : len(self.free)]).max(initial=1.0)), float(f.condition[0])

    def worn(self, steepness: float, condition: float, u: Array) -> bool:
        """Whether another chart should take over at a state with coordinates ``u (n,)``, so steep and of this condition."""
        # angle of an independent rotation from where the chart was laid out above which a new one is
        far = self.turns and np.abs(u[self._singles < 0]).max(initial=0.0) > 1.0
        poor = not condition < max(PATH.doubtful, RESPONSE.steepest * self.condition)
        return bool(far or poor or steepness > RESPONSE.steepest * self.steepness)

    def coordinates(self, x: Array) -> Array:
        """Independent coordinates ``u (n, T)`` of states: how far they are from where the chart was laid out."""
        return self.system.difference(x, self.x0[:, None])[self.free]

    def rates_of_coordinates(self, x: Array, dq: Array) -> Array:
        """``u' (n, T)`` from the rates ``dq (F, T)`` of the freedoms."""
        if not self.turns:
            return dq[self.free]
        return self.system.tangent(self.system.difference(x, self.x0[:, None]), dq)[self.free]

    def close(self, x: Array, u: Array, p: Array, first: Configuration | None = None) -> ClosedChart:
        """States near ``x (nx, T)`` with independent coordinates ``u (n, T)`` and prescribed positions ``p (p, T)``, all loops closed.

        Newton on the closure and on ``difference(x, x0) = u``; what the first leaves free the second settles.
        """
        s, n = self.system, len(self.free)
        x = x.copy()
        x[self._rows] = p[self._given]
        single = self._singles >= 0
        x[self._singles[single]] = self.x0[self._singles[single], None] + u[single]
        total, before = np.zeros(x.shape[1]), np.full(x.shape[1], np.inf)
        # Newton steps to a closed state, at most
        for _ in range(12):
            here = Configuration(s, x)
            f = self.solver.factored(here, np.repeat(self.which, here.T))
            step = f.solve(-here.residual[:, None])[:, 0]
            size, bent = (np.abs(way).max(axis=0, initial=0.0) for way in (step, step[self._bends]))
            if self.turns:
                y = s.difference(x, self.x0[:, None])
                Z = f.sensitivity()[:, :n]
                A = np.stack([s.tangent(y, Z[:, k])[self.free] for k in range(n)], axis=1)
                wanted = u - y[self.free] - s.tangent(y, step)[self.free]
                a = np.linalg.solve(np.moveaxis(A, -1, 0), wanted.T[..., None])[..., 0].T
                step = step + (Z * a).sum(axis=1)
                size = np.maximum(size, np.abs(u - y[self.free]).max(axis=0, initial=0.0))
            total = total + bent
            with np.errstate(invalid="ignore"):
                # below what is asked for, or twice below what rounding (1e-15) allows where the condition is poor
                most = np.maximum(10 * RESPONSE.last_step, 1e-15 * f.condition)
                closed = (size <= RESPONSE.last_step) | ((size <= most) & (before <= most))
            before = size
            # correction above which closing is given up: the step was too long
            if closed.all() or not np.isfinite(size).all() or (total > 1.0).any():
                break
            x = s.advance(x, step)
        return ClosedChart(here, f, closed & (here.closure <= PATH.accepted), self.held)


def _leading(null: Array) -> Index:
    """As many freedoms as there are motions ``null (F, n)``, by pivots: with them all others move at like rates."""
    n = null.shape[1]
    order = scipy.linalg.qr(null.T, mode="economic", pivoting=True)[2] if n else np.zeros(0)
    return np.asarray(order[:n], dtype=np.intp)


def _apart(null: Array, held: tuple[PassiveMotion, ...]) -> tuple[Index, Index]:
    """Freedoms that stand for the passive motions among ``null (F, n)``, and those for the others, which no passive motion moves."""
    passive = np.stack([motion.rates / np.linalg.norm(motion.rates) for motion in held], axis=1)
    # rate of a freedom in a unit passive motion below which it has no part in it
    still = np.flatnonzero(np.abs(passive).max(axis=1) < 1e-9)
    count = null.shape[1] - len(held)
    moving = still[_leading(null[still])[:count]]
    if np.linalg.matrix_rank(null[moving]) < count:
        raise Stopped(
            "no freedoms that the passive motions leave alone tell where the mechanism stands, so that these cannot be held"
        )
    return _leading(passive), moving


SIX = np.arange(6)


def saddle_accelerations(
    tree: Tree, pair_of: Index, S: Array, Z: Array, inertia: Array, loads: Array, forces: Array
) -> Array | None:
    """``v' (n,)`` at one state; None where the system is nearly singular.

    ``pair_of (F,)``: pair of every freedom; ``S (6, F)``, ``Z (F, n)``; ``inertia (6, N, 6)`` of the links about the origin of ``S``;
    ``loads (6, N)`` on the links, generalized ``forces (n,)`` of efforts.
    """
    n, N = Z.shape[1], len(tree.children)
    place = np.full(tree.n_links, -1, dtype=np.intp)
    place[tree.children] = np.arange(N)
    inner = np.flatnonzero(place[tree.parents] >= 0)
    masses = inertia[:, tree.children].transpose(1, 0, 2)
    size = np.abs(masses).max(initial=0.0) or 1.0
    link = 6 * np.arange(N)[:, None, None]
    D = scipy.sparse.eye_array(6 * N) - _entries(
        6 * inner[:, None] + SIX,
        6 * place[tree.parents[inner]][:, None] + SIX,
        np.ones((len(inner), 6)),
        (6 * N, 6 * N),
    )
    rows, cols, values = np.broadcast_arrays(link + SIX[:, None], link + SIX, masses / size)
    mass = _entries(rows, cols, values, (6 * N, 6 * N))
    SZ = _tree_twists(tree, pair_of, S) @ scipy.sparse.csr_array(Z)
    A = scipy.sparse.block_array(
        [[mass, None, D.T], [None, scipy.sparse.csr_array((n, n)), -SZ.T], [D, -SZ, None]], format="csc"
    )
    try:
        factors = Factors(A)
    except RuntimeError:  # exactly singular
        return None
    # smallest pivot, against unit rows, from which on a factorization is trusted; below, motions may have no inertia
    if np.abs(factors.lu.U.diagonal()).min() < 1e-7:
        return None
    b = np.concatenate([loads[:, tree.children].T.ravel(), forces, np.zeros(6 * N)]) / size
    x = factors.solve(b)
    return np.asarray(x + factors.solve(b - A @ x))[6 * N : 6 * N + n]


def _entries(rows: Index, cols: Index, values: Array, shape: tuple[int, int]) -> scipy.sparse.csr_array:
    return scipy.sparse.csr_array((values.ravel(), (rows.ravel(), cols.ravel())), shape=shape)


def _tree_twists(tree: Tree, pair_of: Index, S: Array) -> scipy.sparse.csr_array:
    """Twists ``(6 N, F)`` of the links against those before them on the tree, for unit rates of the freedoms."""
    step = np.full(int(max(tree.pairs.max(initial=-1), pair_of.max(initial=-1))) + 1, -1, dtype=np.intp)
    step[tree.pairs] = np.arange(len(tree.pairs))
    freedom = np.flatnonzero(step[pair_of] >= 0)
    k = step[pair_of[freedom]]
    values = (S[:, freedom] * np.where(tree.forward[k], 1.0, -1.0)).T
    return _entries(
        6 * k[:, None] + SIX, np.repeat(freedom[:, None], 6, axis=1), values, (6 * len(tree.pairs), S.shape[1])
    )


SPARSE_FROM = 8000
"""Freedoms times links from which on the sparse form is faster than the full mass matrix (measured on open chains)."""


@dataclass(frozen=True)
class Loads:
    """Loads by whether they have a potential energy; ``dry`` friction, which acts against the ``ways`` in which freedoms slip.

    ``ways (F,)`` or ``(F, T)``: rates of what slips, zero where nothing does, of any size; they tell the direction of what is about to
    slip, and the side to which each of the ``rough`` ones slides. ``stuck`` are the freedoms that friction holds, ``rolls`` the friction
    that keeps bodies from sliding on each other; ``shared``: whether several hold the same, and share the load as they like. With ``ways``
    loads are those of a motion with friction, without them friction is refused.
    """

    stored: tuple[Load, ...]
    rest: tuple[Load, ...]
    dry: tuple[Any, ...] = ()
    ways: Array | None = None
    rough: tuple[Rough, ...] = ()
    stuck: tuple[int, ...] = ()
    rolls: tuple[Friction, ...] = ()
    shared: bool = False

    @classmethod
    def of(cls, m: Mechanism) -> Loads:
        """The loads of a mechanism, a spring apart from its damper, without the limits of belts, which are no forces."""
        dry = tuple(rubbing_loads(m, m.loads))
        parts = [load.parts() for load in m.loads if load in dry or not load.follows_reactions]
        return cls(
            tuple(stored for stored, _ in parts if stored is not None),
            tuple(rest for _, rest in parts if rest is not None),
            dry,
        )

    def followed(self, here: Configuration, dq: Array) -> Array:
        """The ways ``(F, T)`` at rates ``dq (F, T)``: where several freedoms slip as one, the way in which they move now."""
        assert self.ways is not None
        out = np.array(np.broadcast_to(self.ways.reshape(len(dq), -1), dq.shape))
        for one in self.rough:
            columns = list(one.columns)
            if len(columns) > 1:
                slips = out[columns].any(axis=0) & ~one.rests(here, dq)
                out[columns] = np.where(slips, dq[columns], out[columns])
        return out

    def directions(self, here: Configuration, dq: Array) -> Array:
        """Rates ``(F, T)`` that tell where friction acts: those of freedoms that slip, on the side of their ways also where they have just
        passed zero, so that the equations of motion are smooth there; the ways where they are about to slip.
        """
        assert self.ways is not None
        ways = np.broadcast_to(self.ways.reshape(len(dq), -1), dq.shape)
        out = np.zeros_like(dq)
        for one in self.rough:
            columns, along = list(one.columns), (one.slides(here, dq) * one.slides(here, ways)).sum(axis=0)
            side, way = np.where(along < 0.0, -1.0, 1.0), ways[columns]
            out[columns] = np.where(one.rests(here, dq), 1e-100 * way, side * dq[columns]) * way.any(axis=0)
        return out


@dataclass(frozen=True)
class Moved:
    """Rates and accelerations at a batch of states, with the power of loads and prescribed drivers.

    ``rates``; ``columns`` of the independent rates, with their masses, and the generalized ``force (n, T)``; ``power (T,)`` of prescribed
    drivers and of the loads without a potential energy; the efforts ``held (p + m, T)`` of the prescribed freedoms, and behind them the
    forces of what rolls; the friction that acts, ``rubs``, if any; internal units.
    """

    rates: Rates
    columns: Columns
    force: Array
    power: Array
    held: Array
    rubs: Rubbed | None = None

    @property
    def lost(self) -> Array:
        """Power ``(T,)`` that friction takes."""
        return np.zeros(len(self.power)) if self.rubs is None else -(self.rates.dq * self.rubs.efforts).sum(axis=0)


def _inertia(here: Configuration, V: Array, A: Array) -> Array:
    return inertia_wrenches(here, SimpleNamespace(V=V, A=A))  # type: ignore[arg-type]


NO_INERTIA = (
    "the mass matrix is singular: one motion has no inertia. Add mass or inertia to the moving links, or prescribe "
    "that motion"
)


def positions_together(system: System, n: int) -> int:
    """Positions evaluated together, so that the twists of all links for ``n`` motions do not take much memory."""
    # numbers in an array of twists
    return max(1, min(BLOCK, 5_000_000 // (6 * len(system.m.links) * max(n, 1))))


def link_twists(here: Configuration, Z: Array) -> Array:
    """Twists of all links ``(6, N, k, T)`` for several rates ``(F, k, T)`` at every position."""
    k, T = Z.shape[1:]
    terms = (here.S[:, :, None] * Z).reshape(6, len(Z), k * T)
    sums = here.system.tree.sums(here.pair_sums(terms))
    return np.asarray(sums.reshape(6, sums.shape[1], k, T))


def _momenta(here: Configuration, V: Array) -> Array:
    """Spatial inertias of all links times twists ``(6, N, k, T)``: moments of momentum about the internal origin, and momenta."""
    par, R = here.system.par, here.poses[:, :3, :, None]
    c = (rotate(here.poses[:, :3], par.center) + here.poses[:, 3])[:, :, None]
    momentum = par.mass[:, None] * (V[3:] + cross(V[:3], c))
    spin = rotate(R, rotate(par.inertia[:, :, :, None], rotate_back(R, V[:3])))
    return np.concatenate([cross(c, momentum) + spin, momentum])


class Columns:
    """What the motions of unit rates do at closed states: ``Z (F, n, T)`` of the independent columns and ``Zp`` of the prescribed ones.

    The factors ``f`` have the ``n`` independent columns fixed, and behind them the prescribed ones. Where passive motions are ``held``,
    only the others of them count, each with the passive motions that leave it at rest in these.
    """

    def __init__(
        self,
        here: Configuration,
        f: FactoredClosure,
        n: int,
        held: Held | None = None,
        rolls: Sequence[Friction] = (),
    ) -> None:
        self.here, self.f, self.n = here, f, n
        self.Z, self.Zp = np.split(f.sensitivity(), [n], axis=1)
        self.rest: PassiveMotions | None = None
        if held is not None:
            self.rest = rest = PassiveMotions(here, held.motions, self.Z[:, held.places])
            self.n = n - len(held.places)
            self.Z, self.Zp = (_at_rest(here, rest, Z) for Z in (np.delete(self.Z, held.places, axis=1), self.Zp))
        self.rolling = Rolling(here, rolls, self.Z, self._moved_by) if rolls else None
        if self.rolling is not None:
            slid = self.rolling.held(np.einsum("mft,fpt->mpt", self.rolling.rows, self.Zp))[1]
            self.Zp = self.Zp + np.einsum("fnt,npt->fpt", self.Z, slid)

    @cached_property
    def V(self) -> Array:
        """Twists of all links ``(6, N, n, T)``."""
        return link_twists(self.here, self.Z)

    @cached_property
    def mass(self) -> Array:
        """Mass matrices ``(n, n, T)``."""
        rows, n, T = 6 * len(self.here.system.m.links), self.n, self.here.T
        momenta = _momenta(self.here, self.V).reshape(rows, n, T)
        # a matrix product for every position: the masses of many freedoms are most of the work
        return np.moveaxis(np.moveaxis(self.V.reshape(rows, n, T), (2, 1), (0, 1)) @ np.moveaxis(momenta, 2, 0), 0, -1)

    def force(self, wrenches: Array, efforts: Array) -> Array:
        """Generalized forces ``(n, T)`` of wrenches on the links and efforts in the freedoms."""
        by_freedom = efforts + self.here.tree_efforts(wrenches)
        return np.asarray((self.Z * by_freedom[:, None]).sum(axis=0))

    def rolled(self, a: Array, bias: Array | float = 0.0) -> tuple[Array, Array]:
        """Rates, or accelerations, ``(n, ..., T)`` at which nothing slides that rolls, ``bias (m, ..., T)`` apart, and the forces
        ``(m, ..., T)`` that see to it.
        """
        if self.rolling is None:
            return a, np.zeros((0, *a.shape[1:]))
        forces, change = self.rolling.held(np.einsum("mnt,n...t->m...t", self.rolling.C, a) + bias)
        return a + change, forces

    def on_links(self, forces: Array) -> Array:
        """Wrenches ``(6, N, ..., T)`` of forces ``(m, ..., T)`` of what rolls."""
        if self.rolling is None:
            return np.zeros((6, len(self.here.system.m.links), *forces.shape[1:]))
        return self.rolling.on_links(forces)

    def _moved_by(self, efforts: Array) -> Array:
        """Accelerations ``(n, T)`` under efforts ``(F, T)`` alone, with nothing that rolls."""
        return self.accelerations(np.zeros((6, len(self.here.system.m.links), self.here.T)), efforts)[0]

    def accelerations(self, wrenches: Array, efforts: Array) -> tuple[Array, Array]:
        """See ``accelerations``; of many freedoms in the sparse form where every motion has inertia. Nothing rolls in them."""
        if self.n * len(self.here.system.m.links) >= SPARSE_FROM:
            found = self.sparse_accelerations(wrenches, efforts)
            if found is not None:
                return found, np.zeros_like(found)
        return accelerations(self.mass, self.force(wrenches, efforts))

    def sparse_accelerations(self, wrenches: Array, efforts: Array) -> Array | None:
        """``v' (n, T)`` by one sparse factorization a position (see ``response.saddle``); None where a motion may have no inertia."""
        here = self.here
        unit = np.broadcast_to(np.eye(6)[:, None, :, None], (6, len(here.system.m.links), 6, here.T))
        inertia, forces = _momenta(here, unit), (self.Z * efforts[:, None]).sum(axis=0)
        found = []
        for t in range(here.T):
            at = (part[..., t] for part in (here.S, self.Z, inertia, wrenches, forces))
            a = saddle_accelerations(here.system.tree, here.system.pair_of_freedom, *at)
            if a is None:
                return None
            found.append(a)
        return np.stack(found, axis=1)

    def inertia_of(self, a: Array) -> Array:
        """Inertia wrenches ``(6, N, T)`` of accelerations ``(n, T)`` of the independent columns alone."""
        here = self.here
        return -_momenta(here, here.link_twists((self.Z * a).sum(axis=1))[:, :, None])[:, :, 0]

    def yields(self, efforts: Array) -> Array:
        """Wrenches ``(6, N, k, T)`` of inertia, and of what rolls, with which the links yield to efforts ``(F, k, T)`` in the freedoms."""
        nothing = np.zeros((6, len(self.here.system.m.links), self.here.T))
        if self.n * len(self.here.system.m.links) >= SPARSE_FROM:
            each = [self.accelerations(nothing, efforts[:, i])[0] for i in range(efforts.shape[1])]
            a = np.stack(each, axis=1) if each else np.zeros((self.n, 0, self.here.T))
        else:
            forces = np.einsum("fnt,fkt->nkt", self.Z, efforts)
            many = forces.reshape(self.n, forces.shape[1] * forces.shape[2])
            a = accelerations(np.tile(self.mass, efforts.shape[1]), many)[0].reshape(forces.shape)
        a, forces = self.rolled(a)
        return self.on_links(forces) - _momenta(self.here, link_twists(self.here, np.einsum("fnt,nkt->fkt", self.Z, a)))

    def largest(self, wrenches: Iterable[Array], efforts: Iterable[Array]) -> float:
        """The largest part that a component of wrenches or of efforts has in a generalized force."""
        by_wrenches, by_efforts = (np.abs(columns).max(axis=-2, initial=0.0) for columns in (self.V, self.Z))
        parts = [float(np.abs(by_wrenches * one).max(initial=0.0)) for one in wrenches]
        return max([*parts, *(float(np.abs(by_efforts * one).max(initial=0.0)) for one in efforts)], default=0.0)

    def bound(self, dq: Array, ddq: Array | None = None) -> tuple[Velocities, Array, Array]:
        """At rates ``dq (F, T)``, the independent ones constant, or as what rolls has it: velocities, accelerations ``ddq`` of all
        freedoms, and the inertia, which the forces of what rolls take up with all others.
        """
        here, velocities = self.here, Velocities(self.here, dq)
        free = self.f.solve(-here.closure_bias(velocities.bias, velocities.V)[:, None])[:, 0]
        ddq = free if ddq is None else free + ddq
        if self.rest is not None:
            A = here.accelerations_with(ddq, velocities.bias)
            ddq = ddq + self.rest.still_at_rest(self.f, dq, velocities.V, velocities.bias, A)
        still, rolling = np.zeros((self.Z.shape[1], here.T)), self.rolling
        own = self.rolled(still, 0.0 if rolling is None else rolling.accelerations(velocities, ddq))[0]
        ddq = ddq if rolling is None else ddq + (self.Z * own).sum(axis=1)
        return velocities, ddq, _inertia(here, velocities.V, here.accelerations_with(ddq, velocities.bias))


def applied(
    here: Configuration, loads: tuple[Load, ...], velocities: Velocities, t: Array, rough: bool = False
) -> tuple[Array, Array]:
    """Wrenches ``(6, N, T)`` of loads on the links and efforts ``(F, T)`` in the freedoms; ``rough``: dry friction is added elsewhere."""
    if not loads:
        return np.zeros((6, len(here.system.m.links), here.T)), np.zeros((here.system.n_freedoms, here.T))
    site = Site(here, velocities, here.system.coordinates_of(here.x), (here.T,), np.arange(here.T), t)
    site.solves_friction = rough
    site.collect(loads)
    return site.applied(), site.scaled_efforts()


def _at_rest(here: Configuration, rest: PassiveMotions, Z: Array) -> Array:
    """Motions ``(F, k, T)`` with what leaves the passive links at rest."""
    out = Z.copy()
    for i in range(Z.shape[1]):
        out[:, i] += rest.at_rest(here.link_twists(Z[:, i]))
    return out


def moved(closed: ClosedChart, v: Array, p: Array, loads: Loads, t: Array) -> Moved:
    """Accelerations at closed states with independent rates ``v (n, T)`` and prescribed rates and accelerations ``p (2, p, T)``.

    The factors as in ``Columns``.
    """
    here, held = closed.here, closed.held
    columns = Columns(here, closed.f, len(v) + (0 if held is None else len(held.places)), held, loads.rolls)
    Z, Zp = columns.Z, columns.Zp
    dq = (Z * columns.rolled(v)[0]).sum(axis=1) + (Zp * p[0]).sum(axis=1)
    velocities, ddq, inertia = columns.bound(dq, (Zp * p[1]).sum(axis=1))
    V, rough = velocities.V, loads.ways is not None
    (stored, by_stored), (rest, by_rest) = (
        applied(here, some, velocities, t, rough) for some in (loads.stored, loads.rest)
    )
    wrenches, efforts = stored + rest + inertia, by_stored + by_rest
    a, unopposed = columns.accelerations(wrenches, efforts)
    left = np.abs(unopposed).max(initial=0.0)
    if left and left > RESPONSE.unopposed * columns.largest((stored, rest, inertia), (by_stored, by_rest)):
        raise Stopped(NO_INERTIA)
    a, forces = columns.rolled(a)
    left_over, rubs = wrenches + columns.inertia_of(a) + columns.on_links(forces), None
    if rough and loads.dry:
        problem = ForceProblem(here, left_over, efforts, np.zeros(0, dtype=np.intp), closed.f)
        rubs = rubbed_in_motion(problem, loads.dry, loads.directions(here, dq), columns.yields)
        more, more_forces = columns.rolled(columns.accelerations(0.0 * wrenches, rubs.efforts)[0])
        a, forces, by_rest, efforts = a + more, forces + more_forces, by_rest + rubs.efforts, efforts + rubs.efforts
        left_over = left_over + columns.inertia_of(more) + columns.on_links(more_forces)
        rubs = rubs if columns.rolling is None else columns.rolling.rubbing(rubs, forces)
    power = (V * rest).sum(axis=(0, 1)) + (dq * by_rest).sum(axis=0)
    held = -(Zp * (efforts + here.tree_efforts(left_over))[:, None]).sum(axis=0)
    power += (p[0] * held).sum(axis=0)
    rates = Rates(velocities, ddq + (Z * a).sum(axis=1), np.zeros(here.T))
    return Moved(rates, columns, columns.force(wrenches, efforts), power, np.concatenate([held, forces]), rubs)


def along_one(here: Configuration, f: FactoredClosure, loads: Loads) -> Array:
    """Of mobility 1: ``(M, Q_0, P_1, P_2) (4, T)`` of the energy's rate ``(M u'^2 / 2)' = Q_0 u' + P_1 u' + P_2 u'^2``.

    ``Q_0`` is the force of the loads with a potential energy, ``P_1 + P_2 u'`` that of the others, which may depend on rates linearly.
    """
    columns, t = Columns(here, f, 1), np.zeros(here.T)
    if not (columns.mass > 0.0).all():
        raise Stopped(NO_INERTIA)
    still, ahead, back = (Velocities(here, factor * columns.Z[:, 0]) for factor in (0.0, 1.0, -1.0))
    stored, forth, behind = (
        columns.force(*applied(here, some, way, t))[0]
        for some, way in ((loads.stored, still), (loads.rest, ahead), (loads.rest, back))
    )
    return np.stack([columns.mass[0, 0], stored, 0.5 * (forth + behind), 0.5 * (forth - behind)])


def accelerations(mass: Array, force: Array) -> tuple[Array, Array]:
    """``v' (n, T)`` with ``M v' = Q``, zero along motions without inertia; and the part of ``Q`` that acts along these, ``(n, T)``."""
    if mass.shape[0] == 1:
        moves = mass[0] > 0.0
        return np.divide(force, mass[0], out=np.zeros_like(force), where=moves), np.where(moves, 0.0, force)
    M, Q = np.moveaxis(mass, -1, 0), force.T[..., None]
    size = _sizes(M)
    unit = in_unit_inertias(M)
    try:
        pivots = np.linalg.cholesky(unit)
    except np.linalg.LinAlgError:
        pivots = np.zeros_like(unit)
    # pivot (squared) of the mass matrix above which every motion has inertia
    if (np.einsum("...ii->...i", pivots) ** 2 > 1e-9).all():
        return (np.linalg.solve(unit, Q / size[..., None]) / size[..., None])[..., 0].T, np.zeros_like(force)
    w, U = np.linalg.eigh(unit)
    kept = (w > RESPONSE.massless * w[:, -1:])[..., None]
    parts = np.swapaxes(U, 1, 2) @ (Q / size[..., None])
    a = U @ np.where(kept, parts / np.where(kept, w[..., None], 1.0), 0.0)
    left = U @ np.where(kept, 0.0, parts)
    return (a / size[..., None])[..., 0].T, (left * size[..., None])[..., 0].T


def _sizes(M: Array) -> Array:
    size = np.sqrt(np.einsum("...ii->...i", M))
    return np.where(size > 0, size, 1.0)


def in_unit_inertias(M: Array) -> Array:
    """Mass matrices ``(..., n, n)`` in coordinates of which each has inertia 1 (or none)."""
    size = _sizes(M)
    return np.asarray(M / size[..., :, None] / size[..., None, :])


@dataclass(frozen=True)
class EvaluatedRates:
    """Of one state: the rates of ``u``, ``v``, what friction took and the work, how steep the chart is there and its condition; and the
    state itself.
    """

    rates: Array
    steepness: float
    condition: float
    state: Array


def cannot(system: System, loads: Loads, held: bool, always: bool) -> str | None:
    """Why the kernel does not serve a motion, as long as nothing rolls in it or ``always``; None where it does."""
    if held:
        return "passive freedoms are held at rest"
    if always and any(one.rolls is not None for one in rough_freedoms(system, loads.dry)):
        return "friction acts between bodies that may roll on each other, or teeth"
    if system.n_freedoms * len(system.m.links) >= SPARSE_FROM:
        return f"it has {system.n_freedoms} freedoms and {len(system.m.links)} links; expected fewer than {SPARSE_FROM} of the product"
    whys = (why_not_load(load, system.m) for load in (*loads.stored, *loads.rest))
    return next(filter(None, whys), None) or why_not(system)


def library_for(system: System, loads: Loads, held: bool, engine: str) -> Any:
    """The library as ``engine`` asks, for a motion with passive freedoms held or not; None where numpy is to serve.

    Raises
    ------
    DeclarationError
        where the kernel was asked for by name and cannot carry it; MissingExtraError without a compiler.
    """
    library = build.built() if engine == outcome.COMPILED else outcome.at_hand() if engine == "auto" else None
    why = None if library is None else cannot(system, loads, held, engine == outcome.COMPILED)
    if why is not None and engine == outcome.COMPILED:
        raise build.not_served(f"respond {system.m.name!r}", why)
    return library if why is None else None


def _tables(
    library: Any, system: System, drives: Index, x: Array, loads: Loads
) -> tuple[tuple[Integers, Array], Array]:
    """The tables of a system at a closed state ``x (nx,)``, ``drives`` its independent freedoms, and memory for a motion."""
    found = tables(layout(system, drives, ()), system, x[:, None], (*loads.stored, *loads.rest))
    assert found is not None
    size = library.mgk_motion_size
    size.argtypes, size.restype = [ctypes.c_void_p], ctypes.c_size_t
    return found, np.empty(size(found[0].ctypes.data) // 8 + 1)


class KernelRates:
    """The tables of a chart with the library that evaluates them."""

    def __init__(self, library: Any, chart: Chart, loads: Loads) -> None:
        columns, F = np.concatenate([chart.free, chart.prescribed]), chart.system.n_freedoms
        self._tables, self._memory = _tables(library, chart.system, columns, chart.x0, loads)
        self.n, self._x0 = len(chart.free), np.ascontiguousarray(chart.x0)
        slips = [(len(one.columns), one.touches(chart.system.m), *one.columns) for one in loads.rough]
        self._rough = np.array([len(slips), *chain.from_iterable(slips)], dtype=np.intc)
        of_motion = library.mgk_motion
        of_motion.argtypes = [
            *[ctypes.c_void_p] * 3,
            *[ctypes.c_int] * 2,
            *[ctypes.c_void_p] * 2,
            ctypes.c_int,
            *[ctypes.c_void_p] * 7,
        ]
        own = (*self._tables, self._memory, self._x0, self._rough)
        I, P, memory, x0, rough = (array.ctypes.data for array in own)
        self._call = partial(of_motion, I, P, memory, self.n, len(loads.stored), x0, rough)
        # numbers of a single state, and where they lie
        size = len(chart.x0) + 2 * F
        self._one = [np.empty(n) for n in (2 * self.n, 3 * len(chart.prescribed), F, size, 1, size, 2 * self.n + 4)]
        self._at: list[int | None] = [array.ctypes.data for array in self._one]
        if not loads.dry:
            self._at[2] = None

    def __call__(self, known: Array, h: float, y: Array, p: Array, ways: Array | None) -> EvaluatedRates | None:
        """At ``y = (u, v)`` a time ``h`` behind a ``known`` state (x, q', q''), prescribed freedoms at ``p (3, p)``, with friction in the
        ``ways (F,)``; None where it does not serve.
        """
        to_y, to_p, to_ways, to_known, to_h, found, out = self._one
        to_y[:], to_p[:], to_known[:], to_h[0] = y, p.ravel(), known, h
        if ways is not None:
            to_ways[:] = ways
        if self._call(1, *self._at):
            return None
        *_, steepness, condition = out.tolist()
        return EvaluatedRates(out[:-2].copy(), steepness, condition, found.copy())

    def many(self, known: Array, h: Array, y: Array, p: Array, ways: Array | None) -> Array | None:
        """States ``(T, k)`` of the same for several ``(T, ...)`` of each; None where one of them is not served."""
        given = [None if one is None else np.ascontiguousarray(one) for one in (y, p, ways, known, h)]
        found, out = np.empty_like(known), np.empty((len(h), 2 * self.n + 4))
        at = [None if one is None else one.ctypes.data for one in (*given, found, out)]
        return None if self._call(len(h), *at) else found


class KernelPath:
    """The tables of a mechanism of mobility 1, by the coordinate of one freedom, with the library that evaluates them."""

    def __init__(self, library: Any, system: System, column: int, x: Array, loads: Loads) -> None:
        self._tables, self._memory = _tables(library, system, np.array([column]), x, loads)
        self._library, self._stored = library, len(loads.stored)

    def nodes(self, x: Array, end: float) -> tuple[Array, Array]:
        """Distances ``(n,)`` and states ``(nx, n)`` of the nodes of certified steps from a closed state ``x (nx,)`` towards a place of
        the coordinate; up to there, or to where a step is refused.
        """
        # nodes of a path that are found at once
        out = np.empty((256, 1 + len(x)))
        known = (*self._tables, self._memory, np.ascontiguousarray(x))
        n = self._library.mgk_nodes(*map(pointer, known), ctypes.c_double(end), ctypes.c_int(len(out)), pointer(out))
        return out[:n, 0], out[:n, 1:].T

    def closed(self, x: Array, u: Array) -> tuple[Array, Array] | None:
        """States ``(nx, T)`` near ``x``, closed where the coordinate is ``u (T,)``, and what ``terms`` gives of each ``(T, 6)``; None where
        one of them is refused.
        """
        out, states = np.empty((len(u), 6)), x.T.copy()
        counts = ctypes.c_int(len(u)), ctypes.c_int(self._stored)
        known = map(pointer, (*self._tables, self._memory))
        if self._library.mgk_along(*known, *counts, *map(pointer, (np.ascontiguousarray(u), states, out))):
            return None
        return states.T, out

    def terms(self, x: Array, u: Array) -> tuple[Array, Array, Array] | None:
        """Terms ``(4, T)`` as of ``motion_equations.along_one``, steepness and condition ``(T,)``, at states near ``x (nx, T)``, closed
        where the coordinate is ``u (T,)``; None where one of them is refused.
        """
        found = self.closed(x, u)
        return None if found is None else (found[1][:, :4].T, found[1][:, 4], found[1][:, 5])
