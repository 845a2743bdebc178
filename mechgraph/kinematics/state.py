"""One batched evaluation at given states: poses, twists, wrenches, closure, lines along which gears press, independent rows of loops.

Everything here is internal: lengths over L, positions about the internal origin (see ``model.parameters``), component axes
first and positions last. ``S`` are the twists of all freedoms about the internal origin, one column a freedom. Results have the
type of the numbers that come in, real or complex.

The rows of the closure equations by loops: entries, the measure of every loop, and the rows of a loop reduced to independent ones.

The rows of a loop (six, in a plane three), about its own middle, are taken over its own length, columns of unit size, and turned by a
singular value decomposition so that those that depend on the others (the redundancy of that loop alone) come last:

    U_l^T M_l J_l D = [K_l; 0].

Dense and sparse engine start from these rows, so that they reach the same decision on a single loop.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, Protocol

import numpy as np
import scipy

from mechgraph.graph.linkgraph import LinkGraph, entries_of, run_sums
from mechgraph.kinematics.rows import in_places
from mechgraph.kinematics.system import ScrewTable, System
from mechgraph.maths.linear import LeastNorm, complement
from mechgraph.maths.newton import closest_zeros, least_norm_steps
from mechgraph.maths.se3 import (
    Array,
    Index,
    Mask,
    compose,
    cross,
    cross_twist,
    finite_twist,
    move_twist,
    multiplied,
    rotate,
    to_matrix,
)
from mechgraph.maths.tolerances import PATH, RANKS
from mechgraph.memo import dataclass
from mechgraph.model.gears import moving_lines
from mechgraph.pairs import pair_type as evaluation

CLOSED = 1e-10
"""Closure error (angle, or length / L) up to which loops count as closed."""

CLOSURE_GOAL = 1e-13
"""Closure error that Newton aims at."""

ROUNDINGS = 20
"""Roundings of a position that add up in a closure residual."""


class Configuration:
    """Poses, twists of freedoms and closure of a batch of states; parts are computed when first asked for."""

    def __init__(self, system: System, x: Array) -> None:
        """States ``x (nx, T)``."""
        self.system = system
        self.x = x
        self.T = x.shape[1]

    @cached_property
    def solvers(self) -> dict[Any, Any]:
        """What ``kinematics.solver`` keeps with a start."""
        return {}

    def part(self, at: Index) -> Configuration:
        """Some of the positions; what is evaluated is taken over."""
        return self._with(self.system.cases(at), lambda values: values[..., at])

    def repeated(self, system: System, count: int) -> Configuration:
        """The states ``count`` times, one after the other, for a system of which masses alone differ; what is evaluated is taken over."""
        return self._with(system, lambda values: np.tile(values, count))

    def _with(self, system: System, over: Callable[[Array], Array]) -> Configuration:
        """The states, and what is evaluated at them, taken ``over`` to a system; the last axis is that of positions."""
        out = Configuration(system, over(self.x))
        for name, known in vars(self).items():
            if isinstance(vars(type(self)).get(name), cached_property):
                if isinstance(known, np.ndarray):
                    out.__dict__[name] = over(known)
                elif isinstance(known, tuple) and isinstance(known[0], np.ndarray):
                    out.__dict__[name] = tuple(over(values) for values in known)
        return out

    def rescaled(self, system: System) -> Configuration:
        """The same state in a system about another origin, in another unit of length; poses are taken over, not evaluated again."""
        old, new = self.system.par, system.par
        out = Configuration(system, self.x.copy())
        out.x[system.single_rows[np.flatnonzero(system.is_length)]] *= old.L / new.L
        nodes = self._nodes.copy()
        nodes[:, 3] *= old.L / new.L
        nodes[:, 3] += ((old.origin - new.origin) / new.L)[:, None, None]
        out.__dict__["_nodes"] = nodes
        return out

    def evaluated(self) -> dict[str, Any]:
        """All that is known of the configuration beside its system, see ``of``."""
        return {name: value for name, value in vars(self).items() if name != "system"}

    @classmethod
    def of(cls, system: System, evaluated: dict[str, Any]) -> Configuration:
        """The configuration of which that is known."""
        out = cls.__new__(cls)
        vars(out).update(evaluated, system=system)
        return out

    # --- poses -------------------------------------------------------------------------------------------------------

    @cached_property
    def _steps(self) -> Array:
        """Poses of all factors with the markers beside them, in the sense of the walk: homogeneous, ``(4, 4, steps, T)``."""
        s = self.system
        dtype = self.x.dtype if s.numbers.is_real else complex
        out = np.empty((16, len(s.walk.parents), self.T), dtype=dtype)
        for b, C, (left, right) in s.numbers.parts():
            values = b.stack.values(self.x.take(b.state_rows, axis=0))
            many = C.ndim == 4
            steps = (
                np.einsum("cmnt,mnt->cnt", C, values) if many else (C @ values.transpose(1, 0, 2)).transpose(1, 0, 2)
            )
            steps = multiplied(multiplied(left, steps.reshape(4, 4, *steps.shape[1:])), right)
            out[:, b.at_steps] = steps.reshape(16, *steps.shape[2:])
        return out.reshape(4, 4, *out.shape[1:])

    @cached_property
    def _nodes(self) -> Array:
        """Poses of the frames behind all factors ``(3, 4, nodes, T)``, see ``Walk``."""
        return self.system.walk.poses(self._steps, self.system.par.frame)

    @cached_property
    def poses(self) -> Array:
        """Poses of all links ``(3, 4, N, T)``."""
        return self._nodes.take(self.system.walk.link_node, axis=2)

    @cached_property
    def frames(self) -> list[list[Array]]:
        """For every group the pair frames 0, 1, ... about the internal origin; places inside a factor hold its start."""
        out = []
        for g in self.system.groups:
            starts = [*g.row.frame_before, g.row.f]
            made = {k: self._frame(*self.system.frame_place(g, k)) for k in dict.fromkeys(starts)}
            out.append([made[k] for k in starts])
        return out

    def _frame(self, nodes: Index, const: Index) -> Array:
        """Frames ``(3, 4, n, T)``: poses of nodes with a constant pose behind them."""
        X = self._nodes.take(nodes, axis=2)
        return compose(X, self.system.numbers.constants[:, :, const]) if const.any() else X

    @cached_property
    def pair_points(self) -> Array:
        """Origins of the markers B, ``(3, P, T)``; of a chord, where its link a has it."""
        s = self.system
        X = self._nodes.take(s.walk.end_node, axis=2)
        out = multiplied(X[:, :3], s.numbers.ends)[:, 0]
        out += X[:, 3]
        return out

    # --- screws ------------------------------------------------------------------------------------------------------

    def _turned(self, local: Array, nodes: Index) -> tuple[Array, Array]:
        """Both parts of screws in outer directions ``(2, 3, K, T)`` from those in nodes ``(3, 2, K, B)``, and origins of the nodes."""
        dtype = self._nodes.dtype if local.dtype == float else np.result_type(local, self._nodes)
        out = np.empty((2, 3, len(nodes), self.T), dtype=dtype)
        X = self._nodes.take(nodes, axis=2)
        multiplied(X[:, :3], local, out=out.swapaxes(0, 1))
        return out, X[:, 3].copy()

    @cached_property
    def _twists(self) -> tuple[Array, Array]:
        """Turns and displacements of all freedoms ``(2, 3, F, T)`` about the origins of their nodes, and these origins ``(3, F, T)``."""
        s = self.system
        return self._turned(self._local_twists if s.moving_batches else s.numbers.twists, s.column_nodes)

    @cached_property
    def S(self) -> Array:
        """Twists of all freedoms ``(6, F, T)``: ``(R line, R free + p x R line)``."""
        parts, origins = self._twists
        out = parts.copy()
        out[1] += cross(origins, parts[0])
        return out.reshape(6, *out.shape[2:])

    @cached_property
    def _local_twists(self) -> Array:
        """The twists in their nodes ``(3, 2, F, T)`` where those of some factors move."""
        s = self.system
        constant = s.numbers.twists
        shape = (*constant.shape[:3], self.T)
        out = np.broadcast_to(constant, shape).astype(np.result_type(constant, self.x))
        for b in s.moving_batches:
            s.numbers.place_twists(out, b, b.stack.twists(self.x[b.state_rows], s.par.pitch[b.pairs]))
        return out

    @cached_property
    def E(self) -> Array:
        """Effort wrenches of all freedoms ``(6, F, T)``."""
        s = self.system
        out = self._wrenches(s.effort_table, s.effort_numbers)
        for g in s.groups:
            if g.row.computed_efforts:
                p = self.pair_points[:, g.pairs]
                out[:, g.columns] = evaluation.dual(g.row, out[:, g.columns], self.S[:, g.columns], p)
        return out

    @cached_property
    def W(self) -> list[Array]:
        """For every group the reaction wrenches ``(6, components, n, T)``."""
        s = self.system
        whole = self._wrenches(s.reaction_table, s.reaction_numbers)
        out, at = [], 0
        for number, g in enumerate(s.groups):
            if g.row.reactions is None:
                out.append(evaluation.reciprocal(self.S[:, g.columns], self.frames[number][-1], g.row.normal))
                continue
            count = len(g.row.reactions) * len(g.pairs)
            own = whole[:, at : at + count].reshape(6, len(g.row.reactions), len(g.pairs), self.T)
            if g.row.computed_reactions:
                own = evaluation.without_work(own, self.E[:, g.columns], self.S[:, g.columns])
            out.append(own)
            at += count
        return out

    def _wrenches(self, table: ScrewTable, local: Array) -> Array:
        """Wrenches ``(6, K, T)`` of components, moment first."""
        out, points = self._turned(local, table.nodes)
        if table.b_places.size:
            points[:, table.b_places] = self.pair_points.take(table.pairs[table.b_places], axis=1)
        out[0] += cross(points, out[1])
        return out.reshape(6, *out.shape[2:])

    @cached_property
    def lee_screws(self) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
        """For every pair the axial wrenches ``(6, n, T)`` and condition twists ``(6, n, T)`` of Lee's bookkeeping."""
        s = self.system
        along, conditions = ([np.zeros((6, 0, self.T))] * len(s.m.pairs) for _ in range(2))
        for g, frames in zip(s.groups, self.frames, strict=True):
            book = g.row.bookkeeping
            if book is None:
                continue
            pitch = s.par.pitch[g.pairs]
            wrenches = evaluation.components_of(book.along, pitch, frames)
            twists = evaluation.freedoms_of(book.conditions, pitch, frames[0])
            for i, k in enumerate(g.pairs):
                along[k], conditions[k] = wrenches[:, :, i], twists[:, :, i]
        return tuple(along), tuple(conditions)

    # --- closure -----------------------------------------------------------------------------------------------------

    @cached_property
    def chord_errors(self) -> Array:
        """Closure errors ``(6, chords, T)``: finite twist from marker B reached through b to that reached through a, about the origin."""
        reached, declared = (self._nodes.take(nodes, axis=2) for nodes in self.system.chord_nodes)
        R = multiplied(reached[:, :3], declared[:, :3].swapaxes(0, 1))
        return finite_twist(R, reached[:, 3], declared[:, 3])

    @property
    def chord_gaps(self) -> Array:
        """The same at the pair points of the chords, so that an angle does not count with the distance of the internal origin."""
        e = self.chord_errors
        return np.concatenate([e[:3], e[3:] + cross(e[:3], self.pair_points[:, self.system.chords])])

    @property
    def loop_errors(self) -> Array:
        """Closure errors of the loops about their middles, stacked ``(loop rows, T)``."""
        s = self.system
        return self._about_middles(_summed(s.loops_of_chords, self.chord_errors))

    @cached_property
    def middles(self) -> Array:
        """Middle of the pair points of every loop, ``(3, loops, T)``."""
        return _summed(self.system.graph.loop_averages, self.pair_points)

    def _about_middles(self, twists: Array) -> Array:
        """Twists ``(6, loops, T)`` about the internal origin taken about the middle of their loop, in place; stacked ``(loop rows, T)``.

        So the rows of a loop are as good anywhere: about a fixed point their condition would grow with the square of its distance.
        """
        twists[3:] += cross(twists[:3], self.middles)
        graph = self.system.graph
        return twists[graph.span].swapaxes(0, 1).reshape(graph.loop_rows, self.T)

    @cached_property
    def closure(self) -> Array:
        """Closure error ``(T,)``: largest of angle and length / L over all loops, and of the other rows."""
        errors = [part.error(self) for part in self.system.position_rows]
        return errors[0] if len(errors) == 1 else np.max(errors, axis=0)

    @cached_property
    def residual(self) -> Array:
        """What the closure rows leave open ``(n_rows, T)``: loops first, then the others."""
        rows = self.system.position_rows
        return in_places(rows, [part.residual(self) for part in rows])

    @property
    def rounding(self) -> Array:
        """Rounding of the residual ``(T,)``: that of positions, which grows with their distance from the internal origin."""
        return np.asarray(ROUNDINGS * np.finfo(float).eps * np.abs(self._nodes[:, 3]).max(axis=(0, 1), initial=1.0))

    @cached_property
    def J(self) -> Array:
        """Closure Jacobian ``(n_rows, F, T)``; of the loops ``J = (C x I6) diag(S_k)``."""
        rows = self.system.position_rows
        return in_places(rows, [part.jacobian(self) for part in rows])

    @property
    def loop_jacobian(self) -> Array:
        """Twists of the freedoms about the middles of the loops, with their signs in the rows of every loop, ``(loop rows, F, T)``."""
        s, e = self.system, self.system.entries
        twists, origins = self._twists
        parts, arms = twists.take(e.column, axis=2), origins.take(e.column, axis=1)
        parts *= e.signs
        arms -= self.middles[:, e.loops]
        parts[1] += cross(arms, parts[0])
        rows = parts.reshape(6, *parts.shape[2:])[s.graph.span]
        if s.entry_places is None:
            return rows
        n = s.graph.loop_rows
        out = np.zeros((n * s.n_freedoms, self.T), dtype=rows.dtype)
        out[s.entry_places] = rows
        return out.reshape(n, s.n_freedoms, self.T)

    @property
    def coupling_coefficients(self) -> Array:
        """The rows of the couplings in ``J``, ``(n, F, T)``; of one position where none changes with the poses, ``(n, F, B)``."""
        s = self.system
        return self.J[s.graph.loop_rows :] if s.m.once(moving_lines) else s.coupling_matrix

    def closure_rates(self, dq: Array) -> Array:
        """``J q' (n_rows, T)`` for rates ``dq (F, T)``, without forming ``J``."""
        rows = self.system.position_rows
        return in_places(rows, [part.rates(self, dq) for part in rows])

    def meets_all_rows(self, Z: Array) -> bool:
        """Whether the rates ``Z (F, d, T)`` for unit rates of the fixed columns meet all rows: the fixed columns move independently."""
        left = [np.abs(self.closure_rates(Z[:, i])).max(initial=0.0) for i in range(Z.shape[1])]
        return max(left, default=0.0) <= PATH.independent * max(1.0, float(np.abs(Z).max(initial=0.0)))

    def closure_bias(self, pairs: Array, V: Array) -> Array:
        """Velocity part ``(n_rows, T)`` of the closure accelerations ``J q'' + bias`` from that of the pairs (``bias``, ``(6, P, T)``) and
        the twists ``V (6, N, T)`` of all links.
        """
        rows = self.system.rows
        return in_places(rows, [part.bias(self, pairs, V) for part in rows])

    def row_efforts(self, x: Array) -> Array:
        """Efforts ``(F, k, T)`` that multipliers ``x (n_rows, k, T)`` of rows other than loops exert in the freedoms."""
        s = self.system
        out = np.zeros((s.n_freedoms, *x.shape[1:]), dtype=x.dtype)
        for part in s.rows:
            efforts = part.efforts(self, x[part.places])
            if efforts is not None:
                out += efforts
        return out

    # --- rates -------------------------------------------------------------------------------------------------------

    def link_twists(self, dq: Array) -> Array:
        """Twists of all links ``(6, N, T)`` for rates ``dq (F, T)``, along the tree."""
        return self.system.tree.sums(self.pair_sums(self.S * dq))

    def pair_sums(self, terms: Array) -> Array:
        """Sum of the columns of every pair: ``(6, F, T)`` -> ``(6, P, T)``."""
        return run_sums(terms, self.system.pair_ranks, len(self.system.m.pairs))

    def bias(self, dq: Array, V: Array) -> Array:
        """Velocity part of the relative accelerations ``(6, P, T)``.

        ``sum over the factors of a pair of ad(V of the frame before it) S q' + S' q'``, the second term the factor's own rate of
        its twists (seen from the frame before it): zero for a constant screw and for a rotation.
        """
        s = self.system
        steps = run_sums(self.S * dq, s.factor_ranks, int(s.n_factors.sum()))
        carriers = V[:, s.factor_carriers]
        if len(s.factors_by_pair) > 1:
            carriers = self._carriers(np.array(carriers), steps)
        out = cross_twist(carriers, steps)
        for b in s.moving_batches:
            rates = b.stack.twist_rates(self.x[b.state_rows], dq[b.columns], s.par.pitch[b.pairs])
            if rates is not None:
                const = s.numbers.marker_a_if_first(b)
                frame = compose(self._nodes.take(s.batch_nodes(b), axis=2), const)
                out[:, s.factor_numbers(b)] += move_twist(frame, rates)
        return run_sums(out, s.factors_by_pair, len(s.m.pairs))

    def _carriers(self, carriers: Array, steps: Array) -> Array:
        """Twists of the frames before every factor: that of link a and the factors before it in its pair."""
        firsts = self.system.factors_by_pair
        for r in range(1, len(firsts)):
            places = np.arange(carriers.shape[1])[firsts[r][1]]
            carriers[:, places] = carriers[:, places - 1] + steps[:, places - 1]
        return carriers

    def loop_sums(self, per_pair: Array) -> Array:
        """Signed sum of pair terms along every loop, about its middle, stacked ``(loop rows, T)``."""
        return self._about_middles(_summed(self.system.graph.sparse_loop_matrix, per_pair))

    def pair_wrenches(self, x: Array) -> Array:
        """Pair wrenches ``(6, P, k, T)`` of the loop rows of ``x (n_rows, k, T)``: ``w = C^T x``, taken about the internal origin."""
        s = self.system
        n, span = s.graph.n_loops, s.graph.span
        loops = np.zeros((n, 6, *x.shape[1:]), dtype=x.dtype)
        loops[:, span] = x[: s.graph.loop_rows].reshape(n, s.graph.width, *x.shape[1:])
        parts = loops.swapaxes(0, 1)
        parts[:3] += cross(self.middles[:, :, None], parts[3:])
        flat = np.asarray(s.graph.pairs_of_loops @ loops.reshape(n, 6 * math.prod(x.shape[1:])))
        return np.moveaxis(flat.reshape(len(s.m.pairs), 6, *x.shape[1:]), 1, 0)

    def tree_efforts(self, wrenches: Array) -> Array:
        """Efforts ``(F, T)`` of wrenches ``(6, N, T)`` on the links in the freedoms along the tree, those of the chords zero."""
        s = self.system
        carried = s.tree.wrenches(wrenches, len(s.m.pairs))
        return np.asarray(-(self.S * carried[:, s.owners]).sum(axis=0))

    def accelerations_with(self, ddq: Array, bias: Array) -> Array:
        """Accelerations dV/dt of all links ``(6, N, T)``, the velocity part ``bias (6, P, T)`` known."""
        relative = self.pair_sums(self.S * ddq)
        relative += bias
        return self.system.tree.sums(relative)


def user_poses(here: Configuration, links: slice = slice(None)) -> Array:
    """Poses of the declared link frames (of some links) in the global frame, ``(N, T, 4, 4)``."""
    par = here.system.par
    X = here.poses[:, :, links].copy()
    shift = rotate(X[:, :3], par.offset[:, links, None])
    X[:, 3] = par.L * X[:, 3] + par.origin[:, None, None] - shift
    return to_matrix(X)


def _summed(matrix: scipy.sparse.csr_array, values: Array) -> Array:
    """``sum_p M_lp v_p``, ``(k, L, T)`` for values ``(k, P, T)``."""
    k, _, T = values.shape
    flat = values.swapaxes(0, 1).reshape(matrix.shape[1], k * T)
    return np.asarray(matrix @ flat).reshape(matrix.shape[0], k, T).swapaxes(0, 1)


class FactoredClosure(Protocol):
    """The closure equations at a batch of positions, factored. ``m`` rows, ``F`` freedoms, ``T`` positions."""

    which: Index
    dense: bool
    """Whether matrices are dense."""
    complete: bool
    """Whether ``self_stresses`` is a basis of all self-stresses; otherwise it holds random ones that represent them."""
    groups: int
    """Number of groups that are solved one after the other; 0 where all equations are factored as a whole."""

    @property
    def condition(self) -> Array:
        """Condition numbers ``(T,)``."""

    def solve(self, b: Array) -> Array:
        """``q (F, k, T)`` with ``J q = b (m, k, T)``, zero in fixed and held columns."""

    def solve_transposed(self, b: Array) -> Array:
        """``x (m, k, T)`` with ``J^T x = b (F, k, T)`` in the columns neither fixed nor held."""

    def residual_size(self, r: Array) -> Array:
        """Largest entry ``(T,)`` of residuals ``(m, T)``, displacements over the sizes of their loops."""

    def sensitivity(self) -> Array:
        """Rates ``Z (F, d, T)`` of all freedoms for unit rates of the fixed ones."""

    def motions(self) -> Array:
        """Motions ``(F, p, T)`` with the fixed columns at rest: one a held motion."""

    def self_stresses(self, every: bool = False) -> Array:
        """Multipliers ``(m, s, T)`` with ``J^T x = 0`` in the columns not fixed: a basis if ``complete`` or ``every``, or random."""

    def regular_between(self, ends: Configuration, a: Index, b: Index) -> Mask:
        """Whether no matrix on the parabola through those at ``ends`` ``a (T,)``, here and at ``b`` is singular or nearly so, ``(T,)``."""

    def part(self, at: Index, here: Configuration) -> FactoredClosure:
        """Some of the positions, evaluated in ``here``."""

    def least(self, R: Sequence[scipy.sparse.csr_array], r0: Array) -> Array:
        """Multipliers ``x (m, T)`` with ``J^T x = 0`` that make ``|r0 + R x|`` least; ``R[t] (n, m)``, ``r0 (n, T)``.

        Only asked for where ``self_stresses`` are not complete.
        """

    def by_held(self) -> list[tuple[Index, Index]]:
        """Freedoms that are held (beside the fixed ones), and the positions at which they are."""


class ClosureSolver(Protocol):
    """The closure equations of one mechanism with the columns ``fixed``; makes and keeps forms."""

    fixed: Index
    engine: str

    def chosen(self, here: Configuration, which: Index) -> Index:
        """Forms ``(T,)`` for positions: ``which`` where these are good enough, new ones where they are not (or are -1)."""

    def factored(self, here: Configuration, which: Index) -> FactoredClosure:
        """The equations at positions, each in its form."""

    def leaves_nothing_free(self, here: Configuration) -> bool:
        """Whether the factors at a position prove that the fixed columns determine all others; False proves nothing."""

    def begun(self, here: Configuration) -> ClosureSolver:
        """A solver that goes on from here with the forms of this one, which was last asked at the same state."""

    def corrigible(self, dq: Array, which: Index) -> Array:
        """Increments ``(F, T)`` without the motions that are held: no correction can remove what a prediction adds to them."""


def lengths_of(graph: LinkGraph, pair_points: Array, middles: Array) -> Array:
    """Root mean square distance ``(loops,)`` of the pair points ``(3, P)`` of every loop from its middle ``(3, loops)``."""
    loop, pair, _ = graph.loop_steps
    off = pair_points[:, pair] - middles[:, loop]
    length = np.sqrt(np.bincount(loop, (off * off).sum(axis=0), minlength=graph.n_loops) / np.bincount(loop))
    # points that coincide but for rounding make no length
    rounding = 1e-13 * (1.0 + np.sqrt((middles * middles).sum(axis=0)))
    return np.where(length > rounding, length, 1.0)


@dataclass(frozen=True)
class ClosureRows:
    """The closure Jacobian of one position: twists ``S (6, F)`` along the loops, and ``more (n, F)`` rows behind those of the loops.

    Of several positions ``S (T, 6, F)`` and ``points (T, 3, P)``, with ``more`` of the first one.
    """

    graph: LinkGraph
    first_column: Index
    S: Array
    points: Array
    more: scipy.sparse.csr_array | None = None

    @classmethod
    def at(cls, here: Configuration, t: int = 0) -> ClosureRows:
        """The rows at one position of a configuration; rows of couplings stand behind those of the loops."""
        s = here.system
        others = [(part.places, more) for part in s.rows if (more := part.sparse_jacobian(here, t)) is not None]
        more = scipy.sparse.csr_array(scipy.sparse.vstack([own for _, own in others])) if others else None
        if more is not None and len(others) > 1:
            more = more[np.argsort(np.concatenate([np.arange(s.n_rows)[at] for at, _ in others]))]
        return cls(s.graph, s.first_column, here.S[:, :, t], here.pair_points[:, :, t], more)

    @classmethod
    def of(cls, here: Configuration, at: Index) -> ClosureRows:
        """The rows at several positions."""
        one, S, points = cls.at(here, int(at[0])), here.S[:, :, at], here.pair_points[:, :, at]
        return replace(one, S=S.transpose(2, 0, 1), points=points.transpose(2, 0, 1))

    @cached_property
    def middles(self) -> Array:
        """Middle of the pair points of every loop, ``(3, loops)``, of several positions ``(T, 3, loops)``."""
        averages = self.graph.loop_averages
        flat = self.points.reshape(-1, self.points.shape[-1])
        return np.asarray((averages @ flat.T).T).reshape(*self.points.shape[:-1], averages.shape[0])

    @property
    def further(self) -> int:
        """Number of rows behind those of the loops."""
        return 0 if self.more is None else int(self.more.shape[0])

    @property
    def count(self) -> int:
        """Number of rows."""
        return self.graph.loop_rows + self.further


class ReducedRows:
    """The rows of every loop turned so that its ``kept (loops,)`` independent ones come first; columns ``fixed`` left out.

    ``dropped`` is the largest singular value of the others. Multipliers of the kept rows and of ``rows.more``, one below the other,
    have the length ``height``. ``scale (F,)``: the sizes by which columns were multiplied; ``free (F,)``: which are not fixed.
    """

    def __init__(self, rows: ClosureRows, fixed: Index) -> None:
        self.rows, self.fixed = rows, fixed
        self.entries = entries_of(rows.graph, rows.first_column)
        self.length = lengths_of(rows.graph, rows.points, rows.middles)
        self.free = np.ones(rows.S.shape[1], dtype=bool)
        self.free[fixed] = False
        blocks = self._blocks(rows.S, rows.middles)
        largest = np.zeros(rows.S.shape[1])
        np.maximum.at(largest, self.entries.column, np.abs(blocks).max(axis=0, initial=0.0))
        if rows.more is not None:
            largest = np.maximum(largest, abs(rows.more).max(axis=0).toarray())
        self.scale = np.where(largest > 0, 1.0 / np.where(largest > 0, largest, 1.0), 1.0)
        blocks *= self.scale[self.entries.column]
        self._first = blocks
        self._reduce(blocks)

    @property
    def loops(self) -> int:
        """Number of loops."""
        return len(self.entries.first) - 1

    @property
    def width(self) -> int:
        """Number of rows of a loop."""
        return self.rows.graph.width

    @property
    def height(self) -> int:
        """Number of kept rows and further rows."""
        return int(self.kept.sum()) + self.rows.further

    @cached_property
    def owners(self) -> Index:
        """For every kept or further row the number of its loop (further rows count on from the loops)."""
        mine = np.repeat(np.arange(self.loops), self.kept)
        return np.concatenate([mine, self.loops + np.arange(self.rows.further)]).astype(np.intp)

    def _blocks(self, S: Array, middles: Array) -> Array:
        """Entries ``(..., width, entries)`` about the ``middles (..., 3, loops)``, over the lengths of the loops; zero in fixed columns."""
        e = self.entries
        out = S[..., e.column]
        turns, slides = out[..., :3, :], out[..., 3:, :]
        slides += np.moveaxis(cross(np.moveaxis(turns, -2, 0), np.moveaxis(middles[..., e.loop], -2, 0)), 0, -2)
        slides /= self.length[e.loop]
        out *= e.sign * self.free[e.column]
        return out[..., self.rows.graph.span, :]

    @cached_property
    def _by_width(self) -> list[tuple[Index, Index]]:
        """Loops with the same number of entries: their indices ``(n,)`` and entries ``(n, c)``."""
        width = np.diff(self.entries.first)
        out = []
        for c in np.flatnonzero(np.bincount(width)):
            loops = np.flatnonzero(width == c)
            out.append((loops, self.entries.first[loops][:, None] + np.arange(c)))
        return out

    def _reduce(self, blocks: Array) -> None:
        """Turn the rows of every loop so that the dependent ones come last, all loops of one width at once."""
        n, w = self.loops, self.width
        self._turn, self.kept, self.dropped = np.empty((n, w, w)), np.zeros(n, dtype=np.intp), 0.0
        for loops, at in self._by_width:
            block = np.moveaxis(blocks[:, at], 0, 1)
            U, s, _ = np.linalg.svd(block, full_matrices=block.shape[2] < w)
            self._turn[loops] = np.swapaxes(U, 1, 2)
            s = s / np.maximum(s.max(axis=1, initial=0.0), 1.0)[:, None]
            self.kept[loops] = (s > RANKS.loop).sum(axis=1)
            self.dropped = max(self.dropped, float(s[s <= RANKS.loop].max(initial=0.0)))

    @cached_property
    def _live(self) -> Mask:
        """Which of the turned entries ``(width, entries)`` stand in the system: kept rows, free columns."""
        e = self.entries
        return (np.arange(self.width)[:, None] < self.kept[e.loop][None]) & self.free[e.column][None]

    def _turned_blocks(self, rows: ClosureRows) -> Array:
        """Entries ``(..., width, entries)`` of rows at any positions in the turned rows of their loops and columns of unit size."""
        blocks = self._first if rows is self.rows else self._unit_blocks(rows)
        turned = np.empty_like(blocks)
        for loops, at in self._by_width:
            turned[..., at] = np.swapaxes(self._turn[loops] @ np.swapaxes(blocks[..., at], -3, -2), -3, -2)
        return turned

    def _unit_blocks(self, rows: ClosureRows) -> Array:
        """Entries ``(..., width, entries)`` of rows at any positions in columns of unit size."""
        out = self._blocks(rows.S, rows.middles)
        out *= self.scale[self.entries.column]
        return out

    @cached_property
    def matrix(self) -> scipy.sparse.csr_array:
        """``K (height, free columns)``: kept rows of all loops and the further rows, columns of unit size."""
        e = self.entries
        starts = np.concatenate([[0], np.cumsum(self.kept)])
        place = np.cumsum(self.free) - 1
        rows = (starts[e.loop][None] + np.arange(self.width)[:, None])[self._live]
        cols = np.broadcast_to(place[e.column], (self.width, len(e.loop)))[self._live]
        shape = (int(starts[-1]), int(self.free.sum()))
        K = scipy.sparse.csr_array((self._turned_blocks(self.rows)[self._live], (rows, cols)), shape=shape)
        if self.rows.more is None:
            return K
        more = self.rows.more[:, self.free] * self.scale[self.free]
        return scipy.sparse.csr_array(scipy.sparse.vstack([K, more]))

    def _turned(self, b: Array) -> Array:
        """Right sides ``(loop rows, k)`` as turned rows ``(loops, width, k)``."""
        local = b.reshape(self.loops, self.width, b.shape[1]).copy()
        local[:, self.rows.graph.turns :] /= self.length[:, None, None]
        return np.asarray(self._turn @ local)

    def open_part(self, residual: Array) -> float:
        """Largest component of a residual ``(rows,)`` in all rows, those of a loop in its own measure."""
        n = self.rows.graph.loop_rows
        loops = np.abs(self._turned(residual[:n, None])).max(initial=0.0)
        return float(max(loops, np.abs(residual[n:]).max(initial=0.0)))

    @property
    def rounding(self) -> float:
        """Rounding of a residual in the measure of the smallest loop, as positions are of size one."""
        return 20 * np.finfo(float).eps / min(1.0, float(self.length.min(initial=1.0)))

    def kept_part(self, b: Array) -> Array:
        """Right sides ``(rows, k)`` in the kept and the further rows, ``(height, k)``."""
        n = self.rows.graph.loop_rows
        turned = self._turned(b[:n])[np.arange(self.width) < self.kept[:, None]]
        return np.concatenate([turned, b[n:]])

    @cached_property
    def least_norm(self) -> LeastNorm:
        """The normal equations of ``K``, factored."""
        return LeastNorm(self.matrix)

    def correction(self, residual: Array) -> Array:
        """Smallest ``dq (F,)``, measured in columns of unit size, with ``J dq = -residual (rows,)`` in the kept rows."""
        out = np.zeros(len(self.free))
        dq = self.least_norm.solve(self.kept_part(residual[:, None]))[:, 0]
        out[self.free] = -dq * self.scale[self.free]
        return out

    def _wrenches(self, kept: Array, dropped: Array) -> Array:
        full = np.empty((self.loops, self.width, kept.shape[1]))
        mask = np.arange(self.width) < self.kept[:, None]
        full[mask], full[~mask] = kept, dropped
        return self._unscaled(np.moveaxis(np.swapaxes(self._turn, 1, 2) @ full, 1, 0))

    def _unscaled(self, y: Array) -> Array:
        """Loop wrenches ``(width, loops, k)`` about the middles from multipliers of rows over the lengths."""
        t = self.rows.graph.turns
        return np.concatenate([y[:t], y[t:] / self.length[:, None]])

    def multipliers(self, kept: Array, dropped: Array | None = None) -> Array:
        """Loop wrenches and multipliers of further rows ``(rows, k)`` from those of kept (and of dropped) rows."""
        m, n = int(self.kept.sum()), self.rows.graph.loop_rows
        nothing = np.zeros((n - m, kept.shape[1]))
        wrenches = self._wrenches(kept[:m], nothing if dropped is None else dropped)
        return np.concatenate([np.moveaxis(wrenches, 0, 1).reshape(n, kept.shape[1]), kept[m:]])

    def unit_wrenches(self) -> Array:
        """Loop wrenches ``(width, width, loops)`` of unit multipliers of the turned rows, one column a row."""
        return self._unscaled(self._turn.transpose(2, 0, 1)).transpose(0, 2, 1)

    def local_stress(self) -> tuple[Index, Array]:
        """Loops with self-stresses of their own, and these as loop wrenches ``(width, width, n)``, kept rows left out."""
        some = np.flatnonzero(self.kept < self.width)
        unit = self.unit_wrenches()[:, :, some]
        order = (np.arange(self.width)[:, None] + self.kept[some]) % self.width
        return some, np.take_along_axis(unit, order[None], axis=1)


def close(system: System, x: Array, fixed: Index, tol: float = 0.0) -> tuple[Array, float]:
    """Close the loops from state ``x (nx,)`` with the coordinates in ``fixed`` kept; smallest change of the others."""
    closed, error = close_all(system, x[:, None], fixed, tol)
    return closed[:, 0], float(error[0])


def close_all(system: System, x: Array, fixed: Index, tol: float = 0.0) -> tuple[Array, Array]:
    """``close`` for states ``(nx, T)``; also the closure errors ``(T,)``. Rows that depend on others to ``tol`` are left alone."""
    free = complement(fixed, system.n_freedoms)

    def least(here: Configuration) -> Array:
        # closure rows from which on loops are closed by sparse normal equations
        if here.T == 1 and system.n_rows >= 300 and not tol:
            return ReducedRows(ClosureRows.at(here), fixed).correction(here.residual[:, 0])[:, None]
        dq = np.zeros((system.n_freedoms, here.T), dtype=here.x.dtype)
        # relative singular value below which a direction is left alone while closing
        dq[free] = least_norm_steps(here.J[:, free], here.residual, max(1e-9, tol))
        return dq

    x, _ = closest_zeros(partial(Configuration, system), least, system.advance, x, CLOSURE_GOAL)
    return x, Configuration(system, x).closure
