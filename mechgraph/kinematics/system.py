"""A mechanism made ready for evaluation: layout, numbers, states, rows of the closure equations.

The rows of the closure equations: every constraint contributes its own, a loop six (in the plane three), a coupling of freedoms one.

Rows of all contributors stand one below the other, in the order of ``System.rows``: the loops first. A new kind of constraint
implements the protocol ``Rows``; nothing else in the package knows how many rows there are or where they come from.

A mechanism made ready for evaluation: places of everything in arrays, numbers as the kernel multiplies them, closure rows.

What follows from links, pairs and frame is in ``kinematics.layout`` and is made once a mechanism; the numbers are in
``coefficients.Numbers`` and are made when first asked for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import pairwise, starmap
from typing import Any, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.graph.linkgraph import LinkGraph, link_graph
from mechgraph.kinematics.layout import FACTORS_AT_ONCE, Numbers, Places
from mechgraph.kinematics.lines import LineRows, RowsInOrder
from mechgraph.maths.linear import Place, compact
from mechgraph.maths.se3 import Array, Index, turn_between, turn_tangent, turned
from mechgraph.memo import graph_cached
from mechgraph.model.gears import moving_lines
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.parameters import Parameters, coupling_places, parameters
from mechgraph.pairs import pair_type as evaluation


class Evaluated(Protocol):
    """What rows need of a configuration of ``T`` positions."""

    x: Array
    T: int

    @property
    def S(self) -> Array:
        """Twists of all freedoms ``(6, F, T)``."""

    @property
    def poses(self) -> Array:
        """Poses of all links ``(3, 4, N, T)``."""

    @property
    def chord_gaps(self) -> Array:
        """Closure errors of the chords at their pair points, ``(6, chords, T)``."""

    @property
    def loop_errors(self) -> Array:
        """Closure errors of the loops about their middles, stacked ``(loop rows, T)``."""

    @property
    def loop_jacobian(self) -> Array:
        """Twists of the freedoms in the rows of every loop, about its middle, ``(loop rows, F, T)``."""

    def pair_sums(self, terms: Array) -> Array:
        """``(6, F, T)`` -> ``(6, P, T)``."""

    def loop_sums(self, per_pair: Array) -> Array:
        """``(6, P, T)`` -> ``(loop rows, T)``."""


class PositionRows(Protocol):
    """``n`` closure rows ``phi(q) = 0`` of one contributor, evaluated at a configuration of ``T`` positions."""

    @property
    def scale(self) -> Array:
        """Factors ``(n, 1)`` or one a position by which each row was multiplied, from the user's relation in the user's units."""

    def residual(self, here: Evaluated) -> Array:
        """``phi (n, T)``."""

    def error(self, here: Evaluated) -> Array:
        """The closure error ``(T,)``: the largest angle, length over L, or scaled residual."""

    def jacobian(self, here: Evaluated) -> Array:
        """``J (n, F, T)`` with ``d phi/dt = J q'``."""

    def rates(self, here: Evaluated, dq: Array) -> Array:
        """``J q' (n, T)`` for rates ``dq (F, T)``."""


class Rows(PositionRows, Protocol):
    """Rows that serve accelerations, forces and the sparse engine as well."""

    def sparse_jacobian(self, here: Evaluated, t: int) -> scipy.sparse.csr_array | None:
        """``J (n, F)`` at one position, entries at the same places at all of them; None for loops (see ``kinematics.state``)."""

    def bias(self, here: Evaluated, pairs: Array, V: Array) -> Array:
        """Velocity part ``(n, T)`` of ``d^2 phi/dt^2 = J q'' + bias``, from that of the relative accelerations of ``pairs (6, P, T)`` and
        the twists ``V (6, N, T)`` of all links.
        """

    def efforts(self, here: Evaluated, x: Array) -> Array | None:
        """``J^T x (F, k, T)`` for multipliers ``x (n, k, T)``; None where the rows act through pair wrenches, as loops do."""


class LoopRows:
    """Six rows a loop: the finite twist by which the loop is open, about its middle (the mean of its pair points), which moves with it.

    ``J`` and ``bias`` are the derivatives where the loops are closed and rates meet the rows, as the middle moves otherwise.
    """

    def __init__(self, graph: LinkGraph) -> None:
        self.n_loops, self.count = graph.n_loops, graph.loop_rows

    @property
    def scale(self) -> Array:
        """Ones."""
        return np.ones((self.count, 1))

    def residual(self, here: Evaluated) -> Array:
        """Closure errors of the loops."""
        return here.loop_errors

    def error(self, here: Evaluated) -> Array:
        """Largest of angle and length / L over all chords."""
        if not self.n_loops:
            return np.zeros(here.T)
        gaps = here.chord_gaps
        angle, length = (np.sqrt(np.abs(part * part).sum(axis=0)).max(axis=0) for part in (gaps[:3], gaps[3:]))
        return np.maximum(angle, length)

    def jacobian(self, here: Evaluated) -> Array:
        """``(C x I6) diag(S_k)``."""
        return here.loop_jacobian

    def sparse_jacobian(self, here: Evaluated, t: int) -> None:
        """None: ``kinematics.state`` makes it."""

    def rates(self, here: Evaluated, dq: Array) -> Array:
        """``sum_k C_lk S_k q'_k``."""
        return here.loop_sums(here.pair_sums(here.S * dq))

    def bias(self, here: Evaluated, pairs: Array, V: Array) -> Array:
        """The velocity parts of the relative accelerations, summed along the loops."""
        return here.loop_sums(pairs)

    def efforts(self, here: Evaluated, x: Array) -> None:
        """None: loops act through pair wrenches, ``Configuration.pair_wrenches``."""


class CouplingRows:
    """One row a coupling: a linear relation ``sum_j c_j q_j = constant`` between single freedoms.

    ``coefficients (K, B)`` of all terms stand in ``rows (K,)``, one after the other, and ``columns (K,)`` of the matrix; with ``constant
    (n, B)`` they are in internal coordinates (lengths over L), every row scaled so that its largest coefficient is one. B is 1, or one a
    position. Coordinates are those of the state (rows ``state_rows (F,)``): turns count on, they are not wrapped.
    """

    def __init__(
        self, coefficients: Array, rows: Index, columns: Index, constant: Array, scale: Array, state_rows: Index
    ) -> None:
        self.coefficients, self.constant, self.scale = coefficients, constant, scale
        self.term_rows, self.term_columns, self._state_rows = rows, columns, state_rows
        self._first = np.searchsorted(rows, np.arange(len(constant)))

    @cached_property
    def matrix(self) -> Array:
        """The coefficients ``(n, F, B)``."""
        out = np.zeros((len(self.constant), len(self._state_rows), self.coefficients.shape[1]))
        out[self.term_rows, self.term_columns] = self.coefficients
        return out

    def _sums(self, values: Array) -> Array:
        """``sum_j c_j v_j (n, T)`` of values ``(K, T)``, one a term."""
        return np.asarray(np.add.reduceat(self.coefficients * values, self._first, axis=0))

    def residual(self, here: Evaluated) -> Array:
        """``sum_j c_j q_j - constant``."""
        return self._sums(here.x[self._state_rows[self.term_columns]]) - self.constant

    def error(self, here: Evaluated) -> Array:
        """The largest of them."""
        return np.asarray(np.abs(self.residual(here)).max(axis=0))

    def jacobian(self, here: Evaluated) -> Array:
        """The coefficients."""
        return np.broadcast_to(self.matrix, (*self.matrix.shape[:2], here.T))

    def sparse_jacobian(self, here: Evaluated, t: int) -> scipy.sparse.csr_array:
        """The coefficients ``(n, F)`` at one position, entries at the same places at all of them."""
        values = self.coefficients[:, t if self.coefficients.shape[1] > 1 else 0]
        return scipy.sparse.csr_array((values, (self.term_rows, self.term_columns)), shape=self.matrix.shape[:2])

    def rates(self, here: Evaluated, dq: Array) -> Array:
        """``sum_j c_j q'_j``."""
        return self._sums(dq[self.term_columns])

    def bias(self, here: Evaluated, pairs: Array, V: Array) -> Array:
        """Zero: the relation is linear."""
        return np.zeros((len(self.constant), here.T), dtype=pairs.dtype)

    def efforts(self, here: Evaluated, x: Array) -> Array:
        """``c_j x`` in every freedom."""
        return np.asarray(np.einsum("rft,rkt->fkt", self.matrix, x))


class States(Places):
    """States ``(nx, ...)`` of a mechanism, and increments ``(F, ...)`` between them."""

    @graph_cached
    def single_rows(self) -> Index:
        """For every freedom its row in the state, -1 for those of rotations."""
        out = np.full(self.n_freedoms, -1, dtype=np.intp)
        for g in self.groups:
            for factor, columns, rows in evaluation.placed(g.row):
                if not factor.holds_rotation:
                    out[g.columns[columns]] = g.state_rows[rows]
        return out

    @graph_cached
    def _singles(self) -> tuple[Place, Place]:
        """Columns and state rows of the single freedoms."""
        columns = np.flatnonzero(self.single_rows >= 0)
        return compact(columns), compact(self.single_rows[columns])

    @graph_cached
    def rotations(self) -> tuple[Index, Index] | None:
        """Columns ``(3, n)`` and state rows ``(4, n)`` of the rotations; None where there are none."""
        parts = [
            (g.columns[columns], g.state_rows[rows])
            for g in self.groups
            for factor, columns, rows in evaluation.placed(g.row)
            if factor.holds_rotation
        ]
        if not parts:
            return None
        columns, rows = (np.concatenate(part, axis=1) for part in zip(*parts, strict=True))
        return columns, rows

    def state_of(self, coordinates: Array) -> Array:
        """State ``(nx, T)`` from user coordinates ``(F, T)`` (lengths in the user's units)."""
        q = np.where(self.is_length[:, None], coordinates / self.par.L, coordinates)
        x = np.empty((self.n_state, q.shape[1]), dtype=q.dtype)
        for g in self.groups:
            x[g.state_rows] = evaluation.coordinates_to_state(g.row, q[g.columns])
        return x

    def coordinates_of(self, x: Array, start: Array | None = None) -> Array:
        """User coordinates ``(F, ..., T)`` of states ``(nx, ..., T)``; rotation vectors continued along the last axis."""
        q = np.empty((self.n_freedoms, *x.shape[1:]), dtype=x.dtype)
        for g in self.groups:
            near = None if start is None else start[g.columns]
            q[g.columns] = evaluation.state_to_coordinates(g.row, x[g.state_rows], near)
        q[self.is_length] *= self.par.L
        return q

    def in_user_units(self, gained: Array) -> Array:
        """Amounts ``(F, ...)`` in the units of the user."""
        return gained * np.where(self.is_length, self.par.L, 1.0).reshape(-1, *(1,) * (gained.ndim - 1))

    def start_coordinates(self, start: Mapping[str, float]) -> Array:
        """User coordinates ``(F,)`` from a mapping freedom -> value, zero elsewhere."""
        q = np.zeros(self.n_freedoms)
        for name, value in start.items():
            k, j = self.m.freedom(name)
            q[self.first_column[k] + j] = value
        return q

    def advance(self, x: Array, dq: Array) -> Array:
        """States after increments ``dq (F, ...)``."""
        columns, rows = self._singles
        singles = x[rows] + dq[columns]
        if self.rotations is None and isinstance(rows, slice):
            return np.asarray(singles)
        out = np.empty((self.n_state, *singles.shape[1:]), dtype=singles.dtype)
        out[rows] = singles
        if self.rotations is not None:
            turns, rows = self.rotations
            out[rows] = turned(x[rows], dq[turns])
        return out

    def difference(self, x1: Array, x0: Array) -> Array:
        """Increments ``(F, ...)`` from ``x0`` to ``x1``."""
        columns, rows = self._singles
        singles = x1[rows] - x0[rows]
        if self.rotations is None:
            return np.asarray(singles)
        out = np.empty((self.n_freedoms, *singles.shape[1:]), dtype=singles.dtype)
        out[columns] = singles
        turns, rows = self.rotations
        out[turns] = turn_between(x1[rows], x0[rows])
        return out

    def tangent(self, dq: Array, rates: Array) -> Array:
        """Rates of increments ``dq (F, ...)`` at the state that they lead to, from the rates of the freedoms there."""
        if self.rotations is None:
            return rates
        out, (turns, _) = rates.copy(), self.rotations
        out[turns] = turn_tangent(dq[turns], rates[turns])
        return out


class System(States):
    """A mechanism with geometry, indexed for the kernels, with the numbers ``par`` (the declared ones where left out)."""

    _taken_from: tuple[System, Index] | None = None

    def __init__(self, m: Mechanism, graph: LinkGraph | None = None, par: Parameters | None = None) -> None:
        super().__init__(m, graph or m.once(link_graph), par or m.once(parameters))

    # --- rows --------------------------------------------------------------------------------------------------------

    @cached_property
    def rows(self) -> list[Rows]:
        """The contributors of closure rows: the loops, then the couplings."""
        loops: list[Rows] = [LoopRows(self.graph)]
        return loops + ([self._coupling_rows()] if self.m.couplings else [])

    @property
    def position_rows(self) -> Sequence[PositionRows]:
        """The same where positions alone are asked for."""
        return self.rows

    def _coupling_rows(self) -> Rows:
        """The rows of the couplings, in order."""
        moving = self.m.once(moving_lines)
        on_lines = np.array([c.name in moving for c in self.m.couplings])
        linear, lines = np.flatnonzero(~on_lines), np.flatnonzero(on_lines)
        if not lines.size:
            return self._linear_rows(linear)
        parts: list[tuple[Index, Rows]] = [(linear, self._linear_rows(linear))] if linear.size else []
        return RowsInOrder([*parts, (lines, LineRows(self, lines))])

    def _linear_rows(self, which: Index) -> CouplingRows:
        """The rows of linear couplings, by their places; one without a constant keeps the value that it has at the start."""
        numbers, every = self.par.couplings, coupling_places(self.m)
        couplings, places = [self.m.couplings[g] for g in which], [every[g] for g in which]
        found = [self.m.freedom(name) for c in couplings for name in c.freedoms]
        columns = np.array([self.first_column[pair] + freedom for pair, freedom in found])
        rows = np.repeat(np.arange(len(couplings)), [len(c.terms) for c in couplings])
        first = np.searchsorted(rows, np.arange(len(couplings)))
        coefficients = np.concatenate([numbers[own] for own in places])
        start = self.start_coordinates(self.m.start)[columns, None]
        free = np.array([c.constant is None for c in couplings])[:, None]
        at_start = np.add.reduceat(coefficients * start, first, axis=0)
        constant = np.where(free, at_start, numbers[[own.stop for own in places]])
        coefficients = coefficients * np.where(self.is_length[columns], self.par.L, 1.0)[:, None]
        largest = np.maximum.reduceat(np.abs(coefficients), first, axis=0)
        scale = 1.0 / np.where(largest > 0, largest, 1.0)
        return CouplingRows(coefficients * scale[rows], rows, columns, constant * scale, scale, self.single_rows)

    @cached_property
    def n_rows(self) -> int:
        """Number of closure rows."""
        return len(self.row_scale)

    @cached_property
    def row_scale(self) -> Array:
        """Factors ``(n_rows, B)`` of every row over the user's relation: its multiplier in the user's units is ``scale * x``."""
        B = self.par.couplings.shape[1]
        return np.concatenate([np.broadcast_to(part.scale, (len(part.scale), B)) for part in self.position_rows])

    @property
    def coupling_matrix(self) -> Array:
        """Coefficients ``(couplings, F, B)`` of the rows behind those of the loops, internal units."""
        out = np.zeros((len(self.m.couplings), self.n_freedoms, self.par.couplings.shape[1]))
        for at, part in self.rows[1].parts if self.m.couplings and isinstance(self.rows[1], RowsInOrder) else ():
            out[at] = part.matrix if isinstance(part, CouplingRows) else 0.0
        parts = [part.matrix for part in self.rows[1:] if isinstance(part, CouplingRows)]
        return parts[0] if parts else out

    @property
    def coupled_freedoms(self) -> Index:
        """Freedoms into which rows other than those of loops bring efforts."""
        places = [self.m.freedom(name) for c in self.m.couplings for name in c.freedoms]
        return np.unique(np.array([self.first_column[pair] + freedom for pair, freedom in places], dtype=np.intp))

    @cached_property
    def gaps(self) -> Index:
        """Freedoms in which contacts open."""
        found = [(k, pair.type.gap) for k, pair in enumerate(self.m.pairs)]
        return np.array([self.first_column[k] + gap for k, gap in found if gap is not None], dtype=np.intp)

    @cached_property
    def carrying(self) -> NDArray[np.bool_]:
        """Which freedoms ``(F,)`` are slides that stand in no closure row: they carry what is behind them, and leave the rows alone."""
        out = self.is_length.copy()
        out[self.entries.column] = out[self.coupled_freedoms] = False
        return out

    @cached_property
    def row_places(self) -> list[slice]:
        """The rows of every contributor."""
        ends = np.cumsum([0, *(len(part.scale) for part in self.rows)]).tolist()
        return list(starmap(slice, pairwise(ends)))

    # --- numbers ------ -----------------------------------------------------------------------------------------------

    @cached_property
    def numbers(self) -> Numbers:
        """What follows from the parameters; of variants taken from more what is known there."""
        if self._taken_from is not None:
            return self._taken_from[0].numbers.taken(self.par, self._taken_from[1])
        return Numbers(self.par, self.walk, self.batches, self.n_factors, self.n_freedoms)

    @cached_property
    def effort_numbers(self) -> Array:
        """The efforts of all freedoms in their nodes, moment and force ``(3, 2, F, B)``."""
        return self.numbers.components(self.effort_table)

    @cached_property
    def reaction_numbers(self) -> Array:
        """The constant reaction components in their nodes, moment and force ``(3, 2, K, B)``."""
        return self.numbers.components(self.reaction_table)

    def cases(self, which: Index) -> System:
        """The system with the numbers of some variants of its batch, in that order; of a batch of one, itself."""
        if self.par.batch == 1:
            return self
        out = self.with_parameters(self.par.taken(which))
        if len(which) > 1:  # of one the numbers have another form
            out._taken_from = self, which
        return out

    def with_parameters(self, par: Parameters) -> System:
        """The same mechanism with other numbers."""
        return System(self.m, self.graph, par)

    # --- kept with the mechanism -------------------------------------------------------------------------------------

    def known(self) -> dict[str, Any]:
        """All that is known of the system beside the mechanism itself, see ``remembered``."""
        return {name: value for name, value in vars(self).items() if name != "m"}

    @classmethod
    def remembered(cls, m: Mechanism, known: dict[str, Any]) -> System:
        """A system of a mechanism of which links, pairs, couplings and start are those of another one, all that is known taken over."""
        out = cls.__new__(cls)
        vars(out).update(known, m=m)
        return out


def _numbers(m: Mechanism) -> Numbers:
    return System(m).numbers


def indexed(m: Mechanism) -> System:
    """The system of a mechanism with its declared numbers, which are made once.

    Of many pairs they take more memory than all else, and serve for one state, the declared one: then they are not kept.
    """
    out = System(m)
    if len(m.pairs) <= FACTORS_AT_ONCE:
        vars(out)["numbers"] = m.once(_numbers)
    else:
        vars(out)["numbers"] = Numbers(out.par, out.walk, out.batches, out.n_factors, out.n_freedoms, for_one=True)
    return out
