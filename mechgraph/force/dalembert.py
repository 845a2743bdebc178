"""Two ways to the wrenches of all pairs: one unknown wrench a loop, or all reaction components and efforts at once.

Both return total pair wrenches and independent self-stress states; they must agree to rounding.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index
from mechgraph.closure.solver import FactoredClosure
from mechgraph.equations.build import formulate
from mechgraph.equations.state import State
from mechgraph.equations.terms import Formulation
from mechgraph.numerics.linear import Choice, ChosenSystem, add_at, choose

CHUNK = 4_000_000
"""Largest number of matrix entries solved in one batch."""
BAD_CONDITION = 1e8
"""Condition number above which a choice of independent rows and columns is made anew."""


@dataclass(frozen=True)
class Problem:
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
    """Total pair wrenches ``(6, P, T)`` and self-stress states ``(6, P, s, T)``."""

    totals: Array
    stress: Array


def loop_wrench(problem: Problem) -> Wrenches:
    """``w = w_tree + C^T x`` with one wrench ``x`` a loop: ``J^T x = tau - S^T w_tree`` in the undriven freedoms.

    The transpose of the closure Jacobian, so the factors of the velocity serve again.
    """
    here = problem.here
    tree = tree_wrenches(here, problem.loads)
    rhs = problem.efforts - (here.S * tree[:, here.system.owners]).sum(axis=0)
    x = problem.solver.solve_transposed(rhs[:, None])
    tree += here.pair_wrenches(x)[:, :, 0]
    return Wrenches(tree, here.pair_wrenches(problem.solver.self_stresses()))


def tree_wrenches(here: Configuration, loads: Array) -> Array:
    """Pair wrenches that carry the loads along the spanning tree, chords free, ``(6, P, T)``."""
    return here.system.tree.wrenches(loads, len(here.system.m.pairs))


def newton_euler(problem: Problem) -> Wrenches:
    """All reaction components and driver efforts from the printed equations: six for every moving link.

    Assembled from the minimal formulation; redundant systems through independent rows and columns. Positions at which
    different freedoms are held are solved apart.
    """
    here = problem.here
    totals = np.empty((6, len(here.system.m.pairs), here.T))
    stress: list[tuple[Index, Array]] = []
    for held, at in problem.solver.by_held():
        mine = here if at.size == here.T else here.part(at)
        found = _components_and_efforts(mine, problem.loads[:, :, at], problem.efforts[:, at], problem.driven, held)
        totals[:, :, at] = found.totals
        stress.append((at, found.stress))
    out = np.zeros((6, totals.shape[1], max((part.shape[2] for _, part in stress), default=0), here.T))
    for at, part in stress:
        out[:, :, : part.shape[2], at] = part
    return Wrenches(totals, out)


def _components_and_efforts(here: Configuration, loads: Array, efforts: Array, driven: Index, held: Index) -> Wrenches:
    m = here.system.m
    names = m.freedom_names()
    f = formulate(m, "minimal", efforts=[names[c] for c in sorted({*driven.tolist(), *held.tolist()})])
    state = internal_state(here, loads + given_effort_loads(here, efforts))
    rows, cols, _, _ = f.pattern
    entries, right = f.entries(state), f.right_side(state)
    shape = (len(f.equations), len(f.unknowns))
    size = max(1, CHUNK // max(1, shape[0] * shape[1]))
    known: list[Choice] = []
    parts = []
    for begin in range(0, here.T, size):
        span = slice(begin, min(begin + size, here.T))
        A = np.zeros((*shape, span.stop - span.start))
        np.add.at(A, (rows, cols), entries[:, span])
        solver = chosen_for_all(A, known)
        parts.append((solver.solve(right[:, None, span])[:, 0], _null(A, solver)))
    u = np.concatenate([p[0] for p in parts], axis=1)
    null = np.concatenate([p[1] for p in parts], axis=2)
    totals = _pair_totals(here, f, state, u) + here.pair_sums(here.E * efforts)
    stress = np.zeros((6, len(m.pairs), null.shape[1], here.T))
    for i in range(null.shape[1]):
        stress[:, :, i] = _pair_totals(here, f, state, null[:, i])
    return Wrenches(totals, stress)


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


def _pair_totals(here: Configuration, f: Formulation, state: State, u: Array) -> Array:
    """Total pair wrenches from unknowns ``(unknowns, T)`` of the minimal formulation."""
    m = here.system.m
    out = np.zeros((6, len(m.pairs), here.T))
    at = 0
    for k, pair in enumerate(m.pairs):
        n = 6 - pair.type.f
        out[:, k] += np.einsum("ict,ct->it", state.reactions[k], u[at : at + n])
        at += n
    for unknown, value in zip(f.unknowns[at:], u[at:], strict=True):
        k, j = m.freedom(unknown.freedom)
        out[:, k] += state.efforts[k][:, j] * value
    return out


def given_effort_loads(here: Configuration, efforts: Array) -> Array:
    """What given efforts do to the links: ``+E tau`` on b, ``-E tau`` on a, ``(6, N, T)``."""
    s = here.system
    out = np.zeros((6, len(s.m.links), here.T))
    if efforts.any():
        pair = here.pair_sums(here.E * efforts)
        add_at(out, s.b, pair)
        add_at(out, s.a, -pair)
    return out


def internal_state(here: Configuration, loads: Array) -> State:
    """The State of a batch in internal units."""
    s = here.system
    reactions: list[Array] = [np.zeros(0)] * len(s.m.pairs)
    efforts = list(reactions)
    for g, W in zip(s.groups, here.W, strict=True):
        for i, k in enumerate(g.pairs):
            reactions[k] = W[:, :, i]
            efforts[k] = here.E[:, g.columns[:, i]]
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
    )


METHODS: dict[str, Callable[[Problem], Wrenches]] = {"loop_wrench": loop_wrench, "newton_euler": newton_euler}
"""Force methods by name."""
