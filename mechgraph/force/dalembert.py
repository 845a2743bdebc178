"""Ways to the wrenches of all pairs: one unknown wrench a loop, or all reaction components and efforts at once.

All return total pair wrenches and independent self-stress states; they must agree to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.contact_lines import ContactLines
from mechgraph.closure.indexing import Index
from mechgraph.closure.solver import FactoredClosure
from mechgraph.equations.build import BookkeepingName, formulate
from mechgraph.equations.formulation import Formulation
from mechgraph.equations.terms import State
from mechgraph.numerics.linear import Choice, ChosenSystem, add_at, choose
from mechgraph.numerics.sparse import least_solution

ENTRIES_TOGETHER = 4_000_000
"""Largest number of matrix entries solved in one batch."""
BAD_CONDITION = 1e8
"""Condition number above which other independent rows and columns are chosen."""


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
    loops = 6 * here.system.graph.n_loops
    # J^T x is minus the effort that a row exerts in a freedom
    return Wrenches(tree, here.pair_wrenches(null), -x[loops:, 0], -null[loops:])


def row_efforts(here: Configuration, multipliers: Array) -> Array:
    """Efforts ``(F, k, T)`` that multipliers ``(n, k, T)`` of the rows behind those of the loops exert in the freedoms."""
    if not len(multipliers):
        return np.zeros((here.system.n_freedoms, *multipliers.shape[1:]))
    loops = np.zeros((6 * here.system.graph.n_loops, *multipliers.shape[1:]))
    return here.row_efforts(np.concatenate([loops, multipliers]))


def tree_wrenches(here: Configuration, loads: Array) -> Array:
    """Pair wrenches that carry the loads along the spanning tree, chords free, ``(6, P, T)``."""
    return here.system.tree.wrenches(loads, len(here.system.m.pairs))


def newton_euler(problem: ForceProblem) -> Wrenches:
    """All reaction components and driver efforts: six equations for every moving link, in the minimal bookkeeping.

    Redundant systems through independent rows and columns.
    """
    return _by_equations(problem, "minimal", _by_choice if problem.solver.complete else _by_sparse)


def printed(problem: ForceProblem) -> Wrenches:
    """Exactly the system that ``formulate(m)`` prints, in Lee's bookkeeping (3.53), by sparse LU position by position.

    Redundant systems have more unknowns than equations: their solution of least norm.
    """
    return _by_equations(problem, "lee", _by_sparse)


Solve = Callable[[Formulation, State, int], tuple[Array, Array | None]]


def _by_equations(problem: ForceProblem, bookkeeping: BookkeepingName, solve: Solve) -> Wrenches:
    """The wrenches from the equations of a formulation; positions at which different freedoms are held are solved separately."""
    here = problem.here
    n = here.system.n_rows - 6 * here.system.graph.n_loops
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
        stress, multiplier_stress = here.pair_wrenches(loops), -loops[6 * here.system.graph.n_loops :]
    else:
        stress, multiplier_stress = _pair_totals(f, state, null)
        stress = stress + lines.through(multiplier_stress, flank) if lines else stress
    return Wrenches(totals, stress, multipliers, multiplier_stress)


def _by_choice(f: Formulation, state: State, T: int) -> tuple[Array, Array]:
    """Unknowns ``(unknowns, T)`` by independent equations and unknowns, and all solutions ``(unknowns, s, T)`` without load."""
    rows, cols, _, _ = f.pattern
    entries, right = f.entries(state), f.right_side(state)
    shape = (len(f.equations), len(f.unknowns))
    size = max(1, ENTRIES_TOGETHER // max(1, shape[0] * shape[1]))
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


def chosen_for_all(A: Array, known: list[Choice], fixed: Index | None = None) -> ChosenSystem:
    """Independent rows and columns for every position of a batch: one choice, and new ones where it fails.

    Columns in ``fixed`` are left out.
    """
    T = A.shape[2]
    nothing = np.zeros(0, dtype=np.intp) if fixed is None else fixed
    if not T:
        return ChosenSystem(A, known, np.zeros(0, dtype=np.intp))
    if not known:
        known.append(choose(A[:, :, 0], nothing))
    which = np.zeros(T, dtype=np.intp)
    best = np.full(T, np.inf)
    for i in range(len(known) + 6):
        if i == len(known):
            known.append(choose(A[:, :, int(np.argmax(best))], nothing))
        open_ = np.flatnonzero(best > BAD_CONDITION)
        condition = ChosenSystem(A[:, :, open_], [known[i]], np.zeros(open_.size, dtype=np.intp)).condition
        better = condition < best[open_]
        which[open_[better]] = i
        best[open_[better]] = condition[better]
        if (best <= BAD_CONDITION).all() or (i >= len(known) - 1 and i > 0 and not better.any()):
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


def given_effort_loads(here: Configuration, efforts: Array) -> Array:
    """What given efforts do to the links: ``+E tau`` on b, ``-E tau`` on a, ``(6, N, T)``."""
    s = here.system
    out = np.zeros((6, len(s.m.links), here.T))
    if efforts.any():
        pair = here.pair_sums(here.E * efforts)
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
    for row, coupling in zip(s.coupling_matrix, s.m.couplings, strict=True):
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
        tuple(ContactLines(here).unit(np.ones((len(s.m.couplings), here.T)) if flank is None else flank)),
    )


MethodName = Literal["loop_wrench", "newton_euler", "printed"]
METHODS: dict[str, Callable[[ForceProblem], Wrenches]] = {
    "loop_wrench": loop_wrench,
    "newton_euler": newton_euler,
    "printed": printed,
}
"""Force methods by name."""
