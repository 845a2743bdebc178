"""Reactions: d'Alembert's equations, what they tell of every pair, flanks of gears.

Ways to the wrenches of all pairs: one unknown wrench a loop, or all reaction components and efforts at once.
All return total pair wrenches and independent self-stress states; they must agree to rounding.

Multipliers of least norm where gears touch each other on flanks that hang on the signs of these very multipliers.
On given flanks reactions are linear in the multipliers, and the least ones solve a least-squares problem under the condition that every
multiplier keeps the sign of its flank. Where the least ones touch each other no more (a multiplier is zero there) the other flank may make
the reactions less: flanks are changed one after the other while it does, so that the norm only falls.
Source: Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23 (LSI, least distance programming by NNLS).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from itertools import pairwise
from types import SimpleNamespace
from typing import Literal

import numpy as np
import scipy

from mechgraph.equations.build import BookkeepingName, formulate
from mechgraph.equations.formulation import Formulation
from mechgraph.equations.terms import MovingState, State
from mechgraph.errors import DeclarationError
from mechgraph.force.loads import inertia_wrenches, user_twists
from mechgraph.kinematics.rates import Rates
from mechgraph.kinematics.state import Configuration, FactoredClosure, user_poses
from mechgraph.kinematics.touching import ContactLines, pretension_conditions
from mechgraph.maths.linear import Choice, ChosenSystem, add_at, choose, least_solution
from mechgraph.maths.se3 import Array, Index, batch_last, cross, shift_wrench
from mechgraph.maths.tolerances import STRESSES
from mechgraph.memo import dataclass
from mechgraph.model.belts import pretensions
from mechgraph.model.gears import moving_lines
from mechgraph.model.parameters import Parameters


@dataclass(frozen=True)
class Stress:
    """Self-stresses: reaction states without load, orthonormal in the measure ``sum |F|^2 + |M / L|^2`` at the pair points.

    ``wrenches (6, P, s, T)`` are the reaction parts about the internal origin, ``efforts (F, s, T)`` what they bring to driven and
    coupled freedoms, ``multipliers (n, s, T)`` those of the closure rows behind those of the loops.
    """

    wrenches: Array
    efforts: Array
    multipliers: Array


def at_pair_points(here: Configuration, wrenches: Array) -> Array:
    """Wrenches ``(6, P, ..., T)`` about the internal origin, taken about the origin of marker B of their pair."""
    points = here.pair_points
    extra = wrenches.ndim - 3
    return shift_wrench(wrenches, points.reshape(3, points.shape[1], *(1,) * extra, points.shape[2]))


def reaction_part(here: Configuration, totals: Array, efforts: Array) -> Array:
    """Reaction wrenches ``w - E tau``; totals ``(6, P, T)``, efforts ``(F, T)``."""
    return totals - here.pair_sums(here.E * efforts)


def pair_power(here: Configuration, totals: Array) -> Array:
    """``S^T w`` of every freedom, ``(F, T)``: the efforts that the total wrenches ``(6, P, T)`` stand for."""
    return np.asarray((here.S * totals[:, here.system.owners]).sum(axis=0))


def split_stress(here: Configuration, states: Array, multipliers: Array, acting: Index) -> Stress:
    """Reaction parts and efforts of pair wrench states ``(6, P, s, T)``; only the freedoms ``acting`` (driven, coupled) have efforts.

    The reaction parts take the place of ``states``, as these are large.
    """
    s = states.shape[2]
    efforts = np.zeros((here.system.n_freedoms, s, here.T))
    for i in range(s):
        tau = pair_power(here, states[:, :, i])
        efforts[acting, i] = tau[acting]
        states[:, :, i] = reaction_part(here, states[:, :, i], efforts[:, i])
    return Stress(states, efforts, multipliers)


def orthonormal_stress(here: Configuration, states: Array, multipliers: Array, acting: Index) -> Stress:
    """Self-stresses from independent total wrench states ``(6, P, s, T)``, orthonormal at every position."""
    stress, s = split_stress(here, states, multipliers, acting), states.shape[2]
    if not s:
        return stress
    reactions, efforts = stress.wrenches, stress.efforts
    flat = at_pair_points(here, reactions).transpose(3, 0, 1, 2).reshape(here.T, 6 * states.shape[1], s)
    mix = batch_last(_orthonormal(flat, np.concatenate([efforts, multipliers]).transpose(2, 0, 1)))
    mixed = (np.einsum("fit,ijt->fjt", values, mix) for values in (efforts, multipliers))
    return Stress(np.einsum("cpit,ijt->cpjt", reactions, mix), *mixed)


def _orthonormal(reactions: Array, efforts: Array) -> Array:
    """Mixes ``(T, s, s)`` that make states orthonormal in their reactions ``(T, n, s)``; in their efforts where those are all zero."""
    R = np.linalg.qr(reactions, mode="r")
    size = np.abs(np.einsum("tii->ti", R))
    if (size.min(axis=1) > STRESSES.drivers_alone * size.max(axis=1)).all():
        return np.asarray(np.linalg.inv(R))
    _, sigma, Vt = np.linalg.svd(reactions, full_matrices=False)
    out = np.swapaxes(Vt, 1, 2).copy()
    for t, (mix, values) in enumerate(zip(out, sigma, strict=True)):
        alone = values <= STRESSES.drivers_alone * max(values[0], float(np.abs(efforts[t]).max()))
        mix[:, ~alone] /= values[~alone]
        mix[:, alone] = mix[:, alone] @ np.linalg.inv(np.linalg.qr(efforts[t] @ mix[:, alone], mode="r"))
    return out


def least_multiples(here: Configuration, reactions: Array, efforts: Array, multipliers: Array, stress: Stress) -> Array:
    """Multiples ``(s, T)`` of the self-stresses with which reactions ``(6, P, T)`` have minimum norm: no part along any of them."""
    states = at_pair_points(here, stress.wrenches)
    y = -np.einsum("cpit,cpt->it", states, at_pair_points(here, reactions))
    alone = (states**2).sum(axis=(0, 1)) < 0.5  # drivers or couplings that strain each other without any reaction
    acting = np.einsum("fit,ft->it", stress.efforts, efforts) + np.einsum("nit,nt->it", stress.multipliers, multipliers)
    y -= np.where(alone, acting, 0.0)
    return np.asarray(y)


class PairFrames:
    """Components of reaction wrenches in the frames of the pair table, by the dual basis of ``[W, E]``."""

    def __init__(self, here: Configuration) -> None:
        self.here, self.span = here, here.system.graph.span

    @cached_property
    def dual(self) -> list[Array]:
        """For every group the inverse of ``[W, E]`` at the pair points, ``(n, T, width, width)``."""
        here = self.here
        out = []
        for g, W in zip(here.system.groups, here.W, strict=True):
            E = here.E[:, g.columns]
            basis = np.concatenate([W, E], axis=1)
            points = here.pair_points[:, None, g.pairs]
            local = np.concatenate([basis[:3] - cross(points, basis[3:]), basis[3:]])
            out.append(np.linalg.inv(local[self.span].transpose(2, 3, 0, 1)))
        return out

    def components(self, wrenches: Array) -> list[Array]:
        """For every group the components ``(6 - f, n, ..., T)`` of reaction wrenches ``(6, P, ..., T)``."""
        local = at_pair_points(self.here, wrenches)[self.span]
        out = []
        for g, inverse in zip(self.here.system.groups, self.dual, strict=True):
            values = np.einsum("ijnt,jn...t->in...t", batch_last(inverse), local[:, g.pairs])
            out.append(values[: g.row.held])
        return out

    def components_of(self, number: int, i: int, wrenches: Array) -> Array:
        """Components ``(6 - f, ..., T)`` of the ``i``-th pair of a group from its reaction wrenches ``(6, ..., T)``."""
        here = self.here
        g = here.system.groups[number]
        basis = np.concatenate([here.W[number][:, :, i], here.E[:, g.columns[:, i]]], axis=1)
        point = here.pair_points[:, int(g.pairs[i])]
        local = np.concatenate([basis[:3] - cross(point[:, None], basis[3:]), basis[3:]])
        inverse = np.linalg.inv(np.moveaxis(local[self.span], 2, 0))
        shifted = shift_wrench(wrenches, point.reshape(3, *(1,) * (wrenches.ndim - 2), here.T))[self.span]
        return np.asarray(np.einsum("ijt,j...t->i...t", batch_last(inverse), shifted)[: g.row.held])


@dataclass(frozen=True)
class ForceProblem:
    """What a method solves: closed positions with loads (internal units).

    ``loads (6, N, T)`` inertia and applied wrenches, ``efforts (F, T)`` given efforts, ``driven`` the freedoms with a driver,
    ``solver`` the closure equations, which hold what the drivers leave free.
    """

    here: Configuration
    loads: Array
    efforts: Array
    driven: Index
    solver: FactoredClosure


@dataclass(frozen=True)
class Wrenches:
    """Total pair wrenches ``(6, P, T)`` and self-stress states ``(6, P, s, T)``; ``multipliers (n, T)`` of the closure rows behind those
    of the loops, with ``multiplier_stress (n, s, T)``: row ``r`` brings the effort ``J_ri m`` into freedom ``i``.
    """

    totals: Array
    stress: Array
    multipliers: Array
    multiplier_stress: Array


def loop_wrench(problem: ForceProblem) -> Wrenches:
    """``w = w_tree + C^T x`` with one wrench ``x`` a loop: ``J^T x = tau - S^T w_tree`` in the undriven freedoms.

    The transpose of the closure Jacobian, so the factors of the velocity serve again.
    """
    here = problem.here
    tree = tree_wrenches(here, problem.loads)
    rhs = problem.efforts - (here.S * tree[:, here.system.owners]).sum(axis=0)
    x = problem.solver.solve_transposed(rhs[:, None])
    tree += here.pair_wrenches(x)[:, :, 0]
    null = problem.solver.self_stresses()
    loops = here.system.graph.loop_rows
    # J^T x is minus the effort that a row exerts in a freedom
    return Wrenches(tree, here.pair_wrenches(null), -x[loops:, 0], -null[loops:])


def together(here: Configuration, f: FactoredClosure, loads: Array, efforts: Array) -> tuple[Array, Array, Array]:
    """The same of k loads ``(6, N, k, T)`` and given efforts ``(F, k, T)`` at every position: reactions ``(6, P, k, T)``, efforts ``(F, k,
    T)`` and multipliers ``(n, k, T)``.
    """
    P, k, T = len(here.system.m.pairs), *efforts.shape[1:]
    totals = here.system.tree.wrenches(loads.reshape(6, -1, k * T), P).reshape(6, P, k, T)
    x = f.solve_transposed(efforts - (here.S[:, :, None] * totals[:, here.system.owners]).sum(axis=0))
    totals += here.pair_wrenches(x)
    through = (here.S[:, :, None] * totals[:, here.system.owners]).sum(axis=0)
    through[here.system.gaps] = 0.0
    own = here.pair_sums((here.E[:, :, None] * through).reshape(6, -1, k * T)).reshape(totals.shape)
    return totals - own, through, -x[here.system.graph.loop_rows :]


def pretensioned(here: Configuration, wrenches: Wrenches, f: FactoredClosure, part: float = 1.0) -> Wrenches:
    """The same with a ``part`` of the pretension of belts, and without the self-stresses that it decides.

    With multipliers ``m + M y`` the conditions are ``C M y = c - C m``; of the self-stresses those with ``C M y = 0`` stay.

    Raises
    ------
    DeclarationError
        where the tensions of a belt with pretension are unique without it.
    """
    if not here.system.m.once(pretensions):
        return wrenches
    belts, C, c = pretension_conditions(here)
    stress, change = wrenches.stress, wrenches.multiplier_stress
    if not f.complete:
        x = f.self_stresses(every=True)
        stress, change = here.pair_wrenches(x), -x[here.system.graph.loop_rows :]
    A = np.einsum("int,nst->tis", C, change)
    known = np.abs(A).max(axis=(0, 2), initial=0.0) <= STRESSES.unique * np.abs(C).max(axis=(1, 2), initial=0.0)
    if known.any():
        belt = belts[int(np.argmax(known))]
        fault = f"pretension = {belt.pretension:g}: the tensions follow from equilibrium, as of a belt with a tensioner; leave it out"
        raise DeclarationError(f"coupling {belt.belt!r}", [fault])
    y = np.linalg.pinv(A) @ (part * c - np.einsum("int,nt->it", C, wrenches.multipliers)).T[..., None]
    # the rows of V^T behind the conditions span what these leave open
    mix = np.concatenate([y, np.linalg.svd(A)[2][:, len(belts) :].swapaxes(1, 2)], axis=2)
    states, multipliers = (np.einsum("...st,tsk->...kt", part, mix) for part in (stress, change))
    return Wrenches(
        wrenches.totals + states[:, :, 0],
        states[:, :, 1:],
        wrenches.multipliers + multipliers[:, 0],
        multipliers[:, 1:],
    )


def row_efforts(here: Configuration, multipliers: Array) -> Array:
    """Efforts ``(F, k, T)`` that multipliers ``(n, k, T)`` of the rows behind those of the loops exert in the freedoms."""
    if not len(multipliers):
        return np.zeros((here.system.n_freedoms, *multipliers.shape[1:]))
    loops = np.zeros((here.system.graph.loop_rows, *multipliers.shape[1:]))
    return here.row_efforts(np.concatenate([loops, multipliers]))


def tree_wrenches(here: Configuration, loads: Array) -> Array:
    """Pair wrenches that carry the loads along the spanning tree, chords free, ``(6, P, T)``."""
    return here.system.tree.wrenches(loads, len(here.system.m.pairs))


def newton_euler(problem: ForceProblem) -> Wrenches:
    """All reaction components and driver efforts: six equations (in the plane three) for every moving link, in the minimal bookkeeping.

    Redundant systems through independent rows and columns.
    """
    return _by_equations(problem, "minimal", _by_choice if problem.solver.dense else _by_sparse)


def printed(problem: ForceProblem) -> Wrenches:
    """Exactly the system that ``formulate(m)`` prints, in Lee's bookkeeping (3.53), by sparse LU position by position.

    Redundant systems have more unknowns than equations: their solution of least norm.
    """
    return _by_equations(problem, "lee", _by_sparse)


Solve = Callable[[Formulation, State, int], tuple[Array, Array | None]]


def _by_equations(problem: ForceProblem, bookkeeping: BookkeepingName, solve: Solve) -> Wrenches:
    """The wrenches from the equations of a formulation; positions at which different freedoms are held are solved separately."""
    here = problem.here
    n = here.system.n_rows - here.system.graph.loop_rows
    parts = []
    for held, at in problem.solver.by_held():
        mine = here if at.size == here.T else here.part(at)
        f = problem.solver if at.size == here.T else problem.solver.part(at, mine)
        mine_alone = ForceProblem(mine, problem.loads[:, :, at], problem.efforts[:, at], problem.driven, f)
        parts.append((at, _components_and_efforts(mine_alone, held, bookkeeping, solve)))
    s = max((part.stress.shape[2] for _, part in parts), default=0)
    P = len(here.system.m.pairs)
    shapes = {"totals": (6, P), "stress": (6, P, s), "multipliers": (n,), "multiplier_stress": (n, s)}
    out = {name: np.zeros((*shape, here.T)) for name, shape in shapes.items()}
    for at, part in parts:
        k = part.stress.shape[2]
        out["totals"][..., at], out["multipliers"][..., at] = part.totals, part.multipliers
        out["stress"][:, :, :k, at], out["multiplier_stress"][:, :k, at] = part.stress, part.multiplier_stress
    return Wrenches(**out)


def _components_and_efforts(problem: ForceProblem, held: Index, bookkeeping: BookkeepingName, solve: Solve) -> Wrenches:
    here, m = problem.here, problem.here.system.m
    names = m.freedom_names()
    f = formulate(m, bookkeeping, efforts=[names[c] for c in sorted({*problem.driven.tolist(), *held.tolist()})])
    state = internal_state(here, problem.loads + given_effort_loads(here, problem.efforts))
    u, null = solve(f, state, here.T)
    totals, multipliers = (part[..., 0, :] for part in _pair_totals(f, state, u[:, None]))
    totals = totals + here.pair_sums(here.E * problem.efforts)
    lines, flank = ContactLines(here), np.ones(multipliers.shape)
    if lines:
        totals = totals + lines.through(multipliers, flank)
    if null is None:
        loops = problem.solver.self_stresses()
        stress, multiplier_stress = here.pair_wrenches(loops), -loops[here.system.graph.loop_rows :]
    else:
        stress, multiplier_stress = _pair_totals(f, state, null)
        stress = stress + lines.through(multiplier_stress, flank) if lines else stress
    return Wrenches(totals, stress, multipliers, multiplier_stress)


def _by_choice(f: Formulation, state: State, T: int) -> tuple[Array, Array]:
    """Unknowns ``(unknowns, T)`` by independent equations and unknowns, and all solutions ``(unknowns, s, T)`` without load."""
    rows, cols, _, _ = f.pattern
    entries, right = f.entries(state), f.right_side(state)
    shape = (len(f.equations), len(f.unknowns))
    # largest number of matrix entries solved in one batch
    size = max(1, 4_000_000 // max(1, shape[0] * shape[1]))
    known: list[Choice] = []
    parts = []
    for begin in range(0, T, size):
        span = slice(begin, min(begin + size, T))
        A = np.zeros((*shape, span.stop - span.start))
        np.add.at(A, (rows, cols), entries[:, span])
        solver = chosen_for_all(A, known)
        parts.append((solver.solve(right[:, None, span])[:, 0], _null(A, solver)))
    return np.concatenate([p[0] for p in parts], axis=1), np.concatenate([p[1] for p in parts], axis=2)


def _by_sparse(f: Formulation, state: State, T: int) -> tuple[Array, None]:
    """Unknowns ``(unknowns, T)`` by sparse LU, of least norm where there are more than equations; the equations are independent."""
    rows, cols, _, _ = f.pattern
    entries, right = f.entries(state), f.right_side(state)
    shape = (len(f.equations), len(f.unknowns))
    out = np.empty((shape[1], T))
    for t in range(T):
        out[:, t] = least_solution(scipy.sparse.csc_array((entries[:, t], (rows, cols)), shape=shape), right[:, t])
    return out, None


def chosen_for_all(A: Array, known: list[Choice]) -> ChosenSystem:
    """Independent rows and columns for every position of a batch: one choice, and new ones where it fails."""
    T = A.shape[2]
    nothing = np.zeros(0, dtype=np.intp)
    if not T:
        return ChosenSystem(A, known, np.zeros(0, dtype=np.intp))
    if not known:
        known.append(choose(A[:, :, 0], nothing))
    which = np.zeros(T, dtype=np.intp)
    best = np.full(T, np.inf)
    # condition number above which other independent rows and columns are chosen
    bad_condition = 1e8
    for i in range(len(known) + 6):
        if i == len(known):
            known.append(choose(A[:, :, int(np.argmax(best))], nothing))
        open_ = np.flatnonzero(best > bad_condition)
        condition = ChosenSystem(A[:, :, open_], [known[i]], np.zeros(open_.size, dtype=np.intp)).condition
        better = condition < best[open_]
        which[open_[better]] = i
        best[open_[better]] = condition[better]
        if (best <= bad_condition).all() or (i >= len(known) - 1 and i > 0 and not better.any()):
            break
    return ChosenSystem(A, known, which)


def _null(A: Array, solver: ChosenSystem) -> Array:
    """Basis ``(n, n - r, T)`` of the null space of A: one vector a column that was not chosen."""
    flipped = ChosenSystem(
        np.swapaxes(A, 0, 1), [Choice(c.cols, c.rows, c.held, c.fixed) for c in solver.choices], solver.which
    )
    return flipped.null_of_transpose()


def _pair_totals(f: Formulation, state: State, u: Array) -> tuple[Array, Array]:
    """Total pair wrenches ``(6, P, k, T)`` and multipliers of couplings ``(n, k, T)`` from unknowns ``(unknowns, k, T)``."""
    rows, cols, _, _ = f.transmitted.pattern
    out = np.zeros((len(f.transmitted.equations), *u.shape[1:]))
    np.add.at(out, rows, f.transmitted.entries(state)[:, None] * u[cols])
    multipliers = [i for i, unknown in enumerate(f.unknowns) if unknown.group == "coupling"]
    return out.reshape(len(f.mechanism.pairs), 6, *u.shape[1:]).swapaxes(0, 1), u[multipliers]


def given_effort_loads(here: Configuration, efforts: Array, more: Array | float = 0.0) -> Array:
    """What given efforts and ``more`` wrenches ``(6, P, T)`` do to the links: ``+E tau`` on b, ``-E tau`` on a, ``(6, N, T)``."""
    s = here.system
    out = np.zeros((6, len(s.m.links), here.T))
    if efforts.any():
        pair = here.pair_sums(here.E * efforts) + more
        add_at(out, s.b, pair)
        add_at(out, s.a, -pair)
    return out


def internal_state(here: Configuration, loads: Array, flank: Array | None = None) -> State:
    """The State of a batch in internal units; ``flank (n, T)``: signs of the multipliers of couplings, all positive where left out."""
    s = here.system
    reactions: list[Array] = [np.zeros(0)] * len(s.m.pairs)
    efforts = list(reactions)
    for g, W in zip(s.groups, here.W, strict=True):
        for i, k in enumerate(g.pairs):
            reactions[k] = W[:, :, i]
            efforts[k] = here.E[:, g.columns[:, i]]
    coefficients = []
    for row, coupling in zip(here.coupling_coefficients, s.m.couplings, strict=True):
        places = [s.m.freedom(freedom) for freedom in coupling.freedoms]
        coefficients.append(np.array([row[s.first_column[k] + j] for k, j in places]))
    along, conditions = here.lee_screws
    nothing = np.zeros((s.n_freedoms, here.T))
    return State(
        nothing,
        nothing,
        here.poses,
        np.zeros((6, len(s.m.links), here.T)),
        tuple(reactions),
        tuple(efforts),
        along,
        conditions,
        loads,
        tuple(coefficients),
        tuple(_lines_of(here, flank)),
    )


def _lines_of(here: Configuration, flank: Array | None) -> list[Array]:
    """Wrenches on gears b for unit multipliers, on the first flanks or on those of signs ``(n, T)``."""
    lines = ContactLines(here)
    if flank is None:
        return lines.unit(np.ones((len(here.system.m.couplings), here.T)))
    lines.settle(flank)
    return lines.unit(flank)


MethodName = Literal["loop_wrench", "newton_euler", "printed"]
METHODS: dict[str, Callable[[ForceProblem], Wrenches]] = {
    "loop_wrench": loop_wrench,
    "newton_euler": newton_euler,
    "printed": printed,
}
"""Force methods by name."""


def reaction_map(here: Configuration, t: int) -> scipy.sparse.csr_array:
    """``R (6 P, rows)`` at position ``t``: reaction parts at the pair points for unit wrenches of every loop; other rows bring none."""
    s = here.system
    loop, pair, sign = s.graph.loop_steps
    points = here.pair_points[:, :, t]
    about = (points[:, pair] - here.middles[:, loop, t])[:, None]
    width = s.graph.width
    w = shift_wrench(np.einsum("ij,n->ijn", np.eye(6)[:, s.graph.span], sign), about)
    owner = np.repeat(np.arange(len(s.m.pairs)), np.diff(s.first_column))
    E = shift_wrench(here.E[:, :, t], points[:, owner])
    S = here.S[:, :, t]
    S = np.concatenate([S[:3], S[3:] + cross(S[:3], points[:, owner])])
    for g in s.groups:
        place = np.full(len(s.m.pairs), -1)
        place[g.pairs] = np.arange(len(g.pairs))
        mine = np.flatnonzero(place[pair] >= 0)
        columns = g.columns[:, place[pair[mine]]]
        effort = np.einsum("ifn,ijn->fjn", S[:, columns], w[:, :, mine])
        w[:, :, mine] -= np.einsum("ifn,fjn->ijn", E[:, columns], effort)
    rows = np.broadcast_to(6 * pair + np.arange(6)[:, None, None], w.shape)
    cols = np.broadcast_to(width * loop + np.arange(width)[None, :, None], w.shape)
    return scipy.sparse.csr_array((w.ravel(), (rows.ravel(), cols.ravel())), shape=(6 * len(s.m.pairs), s.n_rows))


def effort_map(here: Configuration, t: int, acting: Index) -> scipy.sparse.csr_array:
    """``M (n, rows)`` at position ``t``: efforts in the freedoms ``acting`` for unit multipliers of all rows, then minus the multipliers
    of the rows behind those of the loops.
    """
    s = here.system
    loop, pair, sign = s.graph.loop_steps
    step, place = np.nonzero(pair[:, None] == np.arange(len(s.m.pairs))[s.owners][acting])
    values = here.S[:, acting[place], t]
    values[3:] += cross(values[:3], here.middles[:, loop[step], t])
    values *= sign[step]
    values, width = values[s.graph.span], s.graph.width
    rows, cols = np.broadcast_to(place, values.shape), width * loop[step] + np.arange(width)[:, None]
    efforts = scipy.sparse.csr_array((values.ravel(), (rows.ravel(), cols.ravel())), shape=(len(acting), s.n_rows))
    others = s.n_rows - s.graph.loop_rows
    return scipy.sparse.csr_array(
        scipy.sparse.vstack([efforts, -scipy.sparse.eye_array(others, s.n_rows, k=s.n_rows - others)])
    )


def on_their_flanks(here: Configuration, wrenches: Wrenches, lines: ContactLines) -> Wrenches:
    """The same where gears on moving shafts touch on the flanks that their multipliers ask for, as far as the centers stand still.

    ``wrenches`` were found with the rows of the first flanks; which flanks act is kept in ``lines``.
    """
    if not lines.moving or not (wrenches.multipliers[list(lines.moving)] < 0.0).any():
        return wrenches
    base = here.system.graph.loop_rows
    lines.settled = {g: np.zeros(here.T, dtype=bool) for g in lines.moving}
    for t in range(here.T):
        own = wrenches.multipliers[:, t]
        flips = [g for g in lines.moving if own[g] < 0.0]
        # flanks follow the signs, which the flanks may change in turn
        for _ in range(4):
            y = lines.flipped(t, flips, own[:, None]) if flips else None
            if y is None:
                break
            new = own - y[base:, 0]
            asked = [g for g in lines.moving if new[g] < 0.0]
            if asked == flips:
                for g in flips:
                    lines.settled[g][t] = True
                break
            flips = asked
    return on_settled_flanks(here, wrenches, lines)


def on_settled_flanks(here: Configuration, wrenches: Wrenches, lines: ContactLines) -> Wrenches:
    """Wrenches that were found with the rows of the first flanks, with those of the flanks that ``lines`` say act."""
    turned: list[int] = np.flatnonzero(np.any([*lines.settled.values()], axis=0)).tolist() if lines.settled else []
    if not turned:
        return wrenches
    multipliers, totals = wrenches.multipliers.copy(), wrenches.totals.copy()
    stress, change = wrenches.stress.copy(), wrenches.multiplier_stress.copy()
    base = here.system.graph.loop_rows
    for t in turned:
        every = np.concatenate([multipliers[:, [t]], change[:, :, t]], axis=1)
        y = lines.flipped(t, [g for g in lines.moving if lines.settled[g][t]], every)
        assert y is not None  # it was, when they settled
        more = here.part(np.array([t])).pair_wrenches(y[..., None])[..., 0]
        totals[..., t] += more[:, :, 0]
        stress[..., t] += more[:, :, 1:]
        multipliers[:, t] -= y[base:, 0]
        change[:, :, t] -= y[base:, 1:]
    return Wrenches(totals, stress, multipliers, change)


STRAIN = 1e-4
"""Weight of efforts beside reactions: where drivers or couplings strain each other without any reaction, their efforts decide alone."""


def least_under_signs(
    here: Configuration, wrenches: Wrenches, lines: ContactLines, acting: Index
) -> tuple[Array, Array]:
    """Multiples ``(s,)`` of all self-stresses that make the reactions of one position least, and the signs ``(n,)`` of the flanks.

    ``wrenches`` are total ones of which contacts take nothing off yet, with a basis of all self-stresses.
    """
    own, change = wrenches.multipliers[:, 0], wrenches.multiplier_stress[:, :, 0]
    size = max(float(np.abs(own).max()), np.finfo(float).tiny)
    free = [g for g, _ in lines.contacts if np.abs(change[g]).max() > STRESSES.unique * np.abs(change).max()]

    def tried(flank: Array) -> tuple[Array, float] | None:
        A, b = _norm(here, wrenches, lines, acting, flank)
        y = least_above(A, b, flank[free, None] * change[free], -flank[free] * own[free] - STRESSES.rounding * size)
        return None if y is None else (y, float(np.linalg.norm(A @ y + b)))

    flank = np.where(own < 0.0, -1.0, 1.0)
    best = tried(flank) or (np.zeros(change.shape[1]), np.inf)
    going = True
    while going:
        going = False
        now = own + change @ best[0]
        for g in free:
            if abs(now[g]) <= STRESSES.unique * np.abs(now).max():
                other = flank.copy()
                other[g] = -flank[g]
                found = tried(other)
                if found is not None and found[1] < (1.0 - STRESSES.unique) * best[1]:
                    flank, best, going = other, found, True
                    break
    return best[0], flank


def _norm(
    here: Configuration, wrenches: Wrenches, lines: ContactLines, acting: Index, flank: Array
) -> tuple[Array, Array]:
    """``A`` and ``b`` of the norm ``|A y + b|`` of reactions, and of efforts with their weight, on flanks ``(n,)``."""
    states = np.concatenate([wrenches.stress, wrenches.totals[:, :, None]], axis=2)
    multipliers = np.concatenate([wrenches.multiplier_stress, wrenches.multipliers[:, None]], axis=1)
    every = np.arange(here.system.n_freedoms)
    split = split_stress(here, states - lines.relief(multipliers, flank[:, None]), multipliers, every)
    points = at_pair_points(here, split.wrenches).reshape(-1, states.shape[2])
    whole = np.concatenate([points, STRAIN * split.efforts[acting, :, 0], STRAIN * multipliers[:, :, 0]])
    return whole[:, :-1], whole[:, -1]


def least_above(A: Array, b: Array, G: Array, h: Array) -> Array | None:
    """``y`` with ``G y >= h`` that makes ``|A y + b|`` least; None where there is none. A has full column rank."""
    Q, R = np.linalg.qr(A)
    shift = Q.T @ b
    # z = R y + Q^T b is to be the shortest one
    G = scipy.linalg.solve_triangular(R, G.T, trans="T").T
    h = h + G @ shift
    size = max(float(np.abs(h).max(initial=0.0)), np.finfo(float).tiny)
    E = np.vstack([G.T, h / size])
    unit = np.zeros(len(E))
    unit[-1] = 1.0
    left = E @ scipy.optimize.nnls(E, unit)[0] - unit
    if -left[-1] <= STRESSES.rounding:
        return None
    return np.asarray(scipy.linalg.solve_triangular(R, -size * left[:-1] / left[-1] - shift))


def user_wrench(par: Parameters, f: Array) -> Array:
    """Wrench about the internal origin -> user's units about the global origin, ``(6, ...)``."""
    out = np.empty(f.shape)
    origin = par.origin.reshape(3, *(1,) * (f.ndim - 1))
    np.multiply(f[3:], par.L, out=out[3:])
    np.multiply(f[:3], par.L**2, out=out[:3])
    out[:3] += cross(origin, out[3:])
    return out


def user_state(rates: Rates, coordinates: Array, loads: Array, applied: Array, flank: Array) -> MovingState:
    """The State at one position with user coordinates ``(F, 1)``, internal loads, all and the applied ones alone, ``(6, N, 1)``, and the
    signs ``(n, 1)`` of the multipliers of couplings, which tell on which flanks gears touch each other.
    """
    here = rates.here
    s, par = here.system, here.system.par
    inner = internal_state(here, loads, flank)
    scale = np.broadcast_to(s.row_scale, (s.n_rows, 1))[s.graph.loop_rows :]
    rows = [p.type for p in s.m.pairs]
    couples = [[c.is_couple for c in row.reactions or ()] for row in rows]
    efforts = [[c.is_couple for c in row.efforts] for row in rows]
    along = [[c.is_couple for c in row.bookkeeping.along] if row.bookkeeping else [] for row in rows]
    unit = np.where(s.is_length, par.L, 1.0)[:, None]
    freedoms = user_twists(here, here.S) / unit
    columns = [slice(first, end) for first, end in pairwise(s.first_column.tolist())]
    without = here.accelerations_with(np.zeros_like(rates.ddq), rates.bias)
    return MovingState(
        coordinates=coordinates,
        velocities=unit * rates.dq,
        poses=np.moveaxis(user_poses(here)[..., :3, :], (0, 1), (2, 3)),
        twists=user_twists(here, rates.V),
        reactions=tuple(_user_screws(par, w, which) for w, which in zip(inner.reactions, couples, strict=True)),
        efforts=tuple(_user_screws(par, w, which) for w, which in zip(inner.efforts, efforts, strict=True)),
        along=tuple(_user_screws(par, w, which) for w, which in zip(inner.along, along, strict=True)),
        conditions=tuple(user_twists(here, w) if w.shape[1] else w for w in inner.conditions),
        loads=user_wrench(par, loads),
        contacts=tuple(user_wrench(par, G) / (par.L**2 * one) for G, one in zip(inner.contacts, scale, strict=True)),
        accelerations=unit * rates.ddq,
        freedoms=tuple(freedoms[:, mine] for mine in columns),
        biases=user_twists(here, rates.bias),
        inertias=_user_inertias(here),
        applied=user_wrench(par, applied),
        gyroscopic=user_wrench(par, _inertia_wrenches(here, rates.V, without)),
        row_biases=here.closure_bias(rates.bias, rates.V)[s.graph.loop_rows :] / scale,
        coefficients=_user_coefficients(here, scale, unit),
    )


def _user_coefficients(here: Configuration, scale: Array, unit: Array) -> tuple[Array, ...]:
    """The coefficients of the couplings in the user's units where some change with the poses; none where they are those declared."""
    s = here.system
    if not s.m.once(moving_lines):
        return ()
    rows = here.coupling_coefficients / (scale[:, None] * unit)
    columns = [[s.first_column[k] + j for k, j in map(s.m.freedom, c.freedoms)] for c in s.m.couplings]
    return tuple(row[own] for row, own in zip(rows, columns, strict=True))


def _inertia_wrenches(here: Configuration, V: Array, A: Array) -> Array:
    return inertia_wrenches(here, SimpleNamespace(V=V, A=A))  # type: ignore[arg-type]


def _user_inertias(here: Configuration) -> Array:
    """Inertias of all links about the global origin ``(6, 6, N, T)``, in the user's units."""
    par, still = here.system.par, np.zeros((6, len(here.system.m.links), here.T))
    columns = []
    for unit in np.eye(6):
        inner = np.concatenate([unit[:3], (unit[3:] - cross(par.origin, unit[:3])) / par.L])
        wrenches = -_inertia_wrenches(here, still, np.broadcast_to(inner[:, None, None], still.shape))
        columns.append(user_wrench(par, wrenches))
    return np.stack(columns, axis=1)


def _user_screws(par: Parameters, wrenches: Array, couples: list[bool]) -> Array:
    """Unit wrenches ``(6, n, T)``: arms in the user's length, about the global origin; unit couples stay, forces that go with them are
    per length.
    """
    out = wrenches.copy()
    for j in range(out.shape[1]):
        if j < len(couples) and couples[j]:
            out[3:, j] /= par.L
        else:
            out[:3, j] *= par.L
        out[:3, j] += cross(par.origin[:, None], out[3:, j])
    return out
