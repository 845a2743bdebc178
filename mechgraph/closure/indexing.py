"""A mechanism made ready for evaluation: index arrays from the graph, coefficient arrays from the parameters.

What follows from links, pairs and frame alone is computed once a mechanism (``indexed``); what follows from its numbers is in
``coefficients.Numbers`` and is made when first asked for. All single factors of all pairs are evaluated together, whatever types
they belong to: their places in the walk, their coordinates and coefficients are arrays, so that no kernel goes through pairs.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise, starmap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.coefficients import MARKER_A, MARKER_B, Numbers
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.rows import CouplingRows, LoopRows, Rows, coupling_rows
from mechgraph.closure.tree import Ranks, Tree, Walk, ranked
from mechgraph.model import pair_kinematics as evaluation
from mechgraph.model.factors import Factor, FixedStack, Stack
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair_type import Component, PairType
from mechgraph.model.parameters import Parameters, parameters
from mechgraph.numerics.linear import Place, compact
from mechgraph.topology.linkgraph import LinkGraph, link_graph

Index = NDArray[np.intp]

MANY_LOOPS = 16
"""Loops above which the loop matrix is applied as a sparse one (measured: from here on it is the faster one)."""


@dataclass(frozen=True)
class Group:
    """The pairs of one type: their indices, the columns of their freedoms ``(f, n)`` and rows of their state ``(nx, n)``."""

    row: PairType
    pairs: Index
    columns: Index
    state_rows: Index


@dataclass(frozen=True)
class FactorBatch:
    """All factors of one kind: their steps in the walk, columns of their freedoms ``(f, n)`` and rows of their state ``(nx, n)``."""

    stack: Stack
    pairs: Index
    ranks: Index
    steps: Index
    columns: Index
    state_rows: Index

    @cached_property
    def at_steps(self) -> Place:
        """The steps, as a slice where that can be."""
        return compact(self.steps)


@dataclass(frozen=True)
class ScrewTable:
    """Constant screws, each in a frame of a pair: parts ``(3, K)``, the node of the frame and the constant pose behind it.

    The line of a screw goes through the origin of its frame, or that of marker B of its pair where ``at_b``.
    """

    bound: Array
    free: Array
    per_pitch: Array
    pairs: Index
    nodes: Index
    const: Index
    at_b: NDArray[np.bool_]

    @cached_property
    def b_places(self) -> Index:
        """The screws through the origin of marker B."""
        return np.flatnonzero(self.at_b)


class System:
    """A mechanism with geometry, indexed for the kernels."""

    def __init__(
        self,
        m: Mechanism,
        graph: LinkGraph | None = None,
        par: Parameters | None = None,
        couplings: Sequence[Any] | None = None,
    ) -> None:
        self.m = m
        self.graph = graph or m.once(link_graph)
        self.par = par or m.once(parameters)
        self.couplings = getattr(m, "couplings", ()) if couplings is None else couplings
        self.first_column = np.concatenate([[0], np.cumsum([p.type.f for p in m.pairs])]).astype(np.intp)
        self.first_row = np.concatenate([[0], np.cumsum([p.type.nx for p in m.pairs])]).astype(np.intp)
        self.n_freedoms, self.n_state = int(self.first_column[-1]), int(self.first_row[-1])
        self.a, self.b, self.chords = self.graph.a, self.graph.b, self.graph.chords
        self.groups = self._group_pairs()
        self.n_factors = np.array([len(p.type.steps) for p in m.pairs], dtype=np.intp)
        self.tree = Tree(self.graph)
        self.walk = Walk(self.tree, (self.a, self.b), self.chords, np.maximum(self.n_factors, 1))
        self.batches = self._factor_batches()
        self.is_length = np.zeros(self.n_freedoms, dtype=bool)
        for g in self.groups:
            self.is_length[g.columns] = np.array([not f.turns for f in g.row.freedoms], dtype=bool)[:, None]

    # --- index arrays ------------------------------------------------------------------------------------------------

    def _group_pairs(self) -> list[Group]:
        same: dict[int, list[int]] = {}
        for k, pair in enumerate(self.m.pairs):
            same.setdefault(id(pair.type), []).append(k)
        by_type: dict[PairType, list[int]] = {}
        for pairs in same.values():
            by_type.setdefault(self.m.pairs[pairs[0]].type, []).extend(pairs)
        groups = []
        for row, pairs in by_type.items():
            index = np.array(sorted(pairs), dtype=np.intp)
            columns = self.first_column[index] + np.arange(row.f, dtype=np.intp)[:, None]
            state = self.first_row[index] + np.arange(row.nx, dtype=np.intp)[:, None]
            groups.append(Group(row.scaled(self.par.L), index, columns, state))
        return groups

    def _factor_batches(self) -> list[FactorBatch]:
        """The factors of all pairs by kind, each kind in the order of the walk; pairs without a factor are a kind of their own."""
        kinds: dict[Hashable, list[tuple[Factor, Group, int]]] = {}
        for g in self.groups:
            for rank, factor in enumerate(g.row.steps):
                kinds.setdefault(factor.kind, []).append((factor, g, rank))
        batches = [self._batch(members) for members in kinds.values()]
        fixed = np.flatnonzero(self.n_factors == 0)
        if fixed.size:
            nothing = np.zeros((0, len(fixed)), dtype=np.intp)
            steps = self.walk.step_of[self.walk.first[fixed]]
            ranks = np.zeros(len(fixed), dtype=np.intp)
            batches.append(FactorBatch(FixedStack(len(fixed)), fixed, ranks, steps, nothing, nothing))
        return batches

    def _batch(self, members: Sequence[tuple[Factor, Group, int]]) -> FactorBatch:
        parts = []
        for number, (_, g, rank) in enumerate(members):
            columns, rows = evaluation.places(g.row)[rank]
            ranks = np.full(len(g.pairs), rank, dtype=np.intp)
            steps = self.walk.step_of[self.walk.first[g.pairs] + rank]
            parts.append([g.columns[columns], g.state_rows[rows], g.pairs, ranks, steps, np.full(len(g.pairs), number)])
        joined: list[Index] = [np.concatenate(part, axis=-1) for part in zip(*parts, strict=True)]
        order = np.argsort(joined[4], kind="stable")
        at_columns, at_rows, pairs, of_pair, at_steps, member = (part[..., order] for part in joined)
        starts = np.flatnonzero(np.concatenate([[True], member[1:] != member[:-1]]))
        counts = np.diff(np.append(starts, len(member))).tolist()
        factors = [members[int(member[i])][0] for i in starts]
        return FactorBatch(factors[0].stack(factors, counts), pairs, of_pair, at_steps, at_columns, at_rows)

    @cached_property
    def _group_of(self) -> Index:
        out = np.empty(len(self.m.pairs), dtype=np.intp)
        for number, g in enumerate(self.groups):
            out[g.pairs] = number
        return out

    def place_of(self, pair: int) -> tuple[int, int]:
        """Number of the group of a pair, and its place there."""
        number = int(self._group_of[pair])
        return number, int(np.searchsorted(self.groups[number].pairs, pair))

    @cached_property
    def owners(self) -> Place:
        """For every freedom its pair."""
        return compact(self._owner)

    @cached_property
    def _owner(self) -> Index:
        return np.repeat(np.arange(len(self.m.pairs)), np.diff(self.first_column))

    @cached_property
    def pair_ranks(self) -> Ranks:
        """Freedoms as runs by pair."""
        return ranked(np.diff(self.first_column))

    @cached_property
    def factor_ranks(self) -> Ranks:
        """Freedoms as runs by factor, factors pair by pair."""
        return ranked(np.array([len(step.freedoms) for p in self.m.pairs for step in p.type.steps], dtype=np.intp))

    @cached_property
    def factors_by_pair(self) -> Ranks:
        """Factors as runs by pair."""
        return ranked(self.n_factors)

    @cached_property
    def factor_carriers(self) -> Place:
        """For every factor the link a of its pair."""
        return compact(np.repeat(self.a, self.n_factors))

    def factor_numbers(self, batch: FactorBatch) -> Index:
        """Numbers of the factors of a batch, counted pair by pair."""
        return np.asarray((np.cumsum(self.n_factors) - self.n_factors)[batch.pairs] + batch.ranks)

    @cached_property
    def moving_batches(self) -> list[FactorBatch]:
        """The factors whose twists move with their coordinates."""
        return [b for b in self.batches if b.stack.constant_twists(self.par.pitch[b.pairs]) is None]

    @cached_property
    def chord_nodes(self) -> tuple[Place, Place]:
        """For every chord the node in which it ends, and that of its link b."""
        return compact(self.walk.end_node[self.chords]), compact(self.walk.link_node[self.b[self.chords]])

    @cached_property
    def column_nodes(self) -> Index:
        """For every freedom the node of the frame before its factor."""
        out = np.empty(self.n_freedoms, dtype=np.intp)
        for batch in self.batches:
            out[batch.columns] = self.batch_nodes(batch)
        return out

    def batch_nodes(self, batch: FactorBatch) -> Index:
        """Nodes of the frames before the factors of a batch."""
        return self.walk.node_before(batch.pairs, batch.ranks)

    def frame_place(self, g: Group, k: int) -> tuple[Index, Index]:
        """Node of frame ``k`` of the pairs of a group, and the constant pose behind it (a place in ``Numbers.constants``)."""
        n = len(self.m.pairs)
        if k == 0:
            return self.walk.link_node[self.a[g.pairs]], 1 + MARKER_A * n + g.pairs
        if k == g.row.f:
            return self.walk.end_node[g.pairs], 1 + MARKER_B * n + g.pairs
        rank = next(r for r, factor in enumerate(g.row.factors) if k in factor)
        return self.walk.node_before(g.pairs, rank), np.zeros(len(g.pairs), dtype=np.intp)

    # --- screws of components ----------------------------------------------------------------------------------------

    @cached_property
    def effort_table(self) -> ScrewTable:
        """Efforts of all freedoms, in the order of the freedoms."""
        parts = [(g, c) for g in self.groups for c in g.row.efforts]
        table = self._screw_table(parts)
        columns = [column for g in self.groups for column in g.columns]
        order = np.argsort(np.concatenate(columns)) if columns else np.zeros(0, dtype=np.intp)
        return replace(table, **{name: value[..., order] for name, value in vars(table).items()})

    @cached_property
    def reaction_table(self) -> ScrewTable:
        """Constant reaction components, group by group, component by component."""
        return self._screw_table([(g, c) for g in self.groups for c in g.row.reactions or ()])

    def _screw_table(self, parts: Sequence[tuple[Group, Component]]) -> ScrewTable:
        """The components of groups, one after the other, each for all pairs of its group."""
        counts = [len(g.pairs) for g, _ in parts]
        places: dict[tuple[int, int], tuple[Index, Index]] = {}
        for g, c in parts:
            if (id(g), c.frame) not in places:
                places[id(g), c.frame] = self.frame_place(g, c.frame)
        wrenches = np.array([(*c.wrench, *c.per_pitch) for _, c in parts]).reshape(len(parts), 12).T
        vectors = np.repeat(wrenches, counts, axis=1)
        at_b = np.repeat(np.array([c.at_b for _, c in parts], dtype=bool), counts)
        nothing = [np.zeros(0, dtype=np.intp)]
        pairs = np.concatenate([g.pairs for g, _ in parts] or nothing)
        nodes, const = (np.concatenate([places[id(g), c.frame][side] for g, c in parts] or nothing) for side in (0, 1))
        return ScrewTable(vectors[3:6], vectors[:3], vectors[6:9], pairs, nodes, const, at_b)

    # --- loops -------------------------------------------------------------------------------------------------------

    @cached_property
    def loop_columns(self) -> list[tuple[Index, Array]]:
        """Columns of the freedoms along every loop, and their signs."""
        return [self._columns_of_loop(loop) for loop in self.graph.loops]

    def _columns_of_loop(self, loop: tuple[tuple[int, int], ...]) -> tuple[Index, Array]:
        columns = [np.arange(self.first_column[k], self.first_column[k + 1]) for k, _ in loop]
        signs = [np.full(len(c), float(sign)) for c, (_, sign) in zip(columns, loop, strict=True)]
        return np.concatenate(columns), np.concatenate(signs)

    @cached_property
    def many_loops(self) -> bool:
        """Whether sums along loops are taken with the sparse loop matrix."""
        return self.graph.n_loops > MANY_LOOPS

    @cached_property
    def loop_matrix(self) -> Array:
        """The loop matrix, loops x pairs."""
        return self.graph.loop_matrix

    @cached_property
    def loop_pieces(self) -> list[list[tuple[slice, Array]]]:
        """For every loop the runs of its columns without a gap, with their signs ``(n, 1)``."""
        out = []
        for columns, signs in self.loop_columns:
            order = np.argsort(columns)
            breaks = np.flatnonzero(np.diff(columns[order]) != 1) + 1
            runs = zip(np.split(columns[order], breaks), np.split(signs[order], breaks), strict=True)
            out.append([(slice(int(c[0]), int(c[-1]) + 1), sign[:, None]) for c, sign in runs if len(c)])
        return out

    @cached_property
    def loops_of_chords(self) -> Array:
        """Which chord closures make up a loop, ``(loops, chords)`` with signs."""
        return self.graph.loop_matrix[:, self.chords]

    # --- rows --------------------------------------------------------------------------------------------------------

    @cached_property
    def rows(self) -> list[Rows]:
        """The contributors of closure rows: the loops, then the couplings."""
        loops: list[Rows] = [LoopRows(self.graph.n_loops)]
        return loops + ([coupling_rows(self, self.couplings, self.m.start)] if self.couplings else [])

    @cached_property
    def n_rows(self) -> int:
        """Number of closure rows."""
        return len(self.row_scale)

    @cached_property
    def row_scale(self) -> Array:
        """Factor ``(n_rows,)`` of every row over the user's relation: its multiplier in the user's units is ``scale * x``."""
        return np.concatenate([part.scale for part in self.rows])

    @property
    def coupling_matrix(self) -> Array:
        """Coefficients ``(couplings, F)`` of the rows behind those of the loops, internal units."""
        parts = [part.matrix for part in self.rows[1:] if isinstance(part, CouplingRows)]
        return np.concatenate([np.zeros((0, self.n_freedoms)), *parts])

    @property
    def coupled_freedoms(self) -> Index:
        """Freedoms into which rows other than those of loops bring efforts."""
        return np.flatnonzero(self.coupling_matrix.any(axis=0))

    @cached_property
    def row_places(self) -> list[slice]:
        """The rows of every contributor."""
        ends = np.cumsum([0, *(len(part.scale) for part in self.rows)]).tolist()
        return list(starmap(slice, pairwise(ends)))

    # --- other numbers -----------------------------------------------------------------------------------------------

    @cached_property
    def numbers(self) -> Numbers:
        """What follows from the parameters."""
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
        return self if self.par.batch == 1 else self.with_parameters(self.par.taken(which))

    def with_parameters(self, par: Parameters) -> System:
        """The same graph with other numbers."""
        out = copy(self)
        out.par = par
        for name in ("numbers", "effort_numbers", "reaction_numbers", "rows", "row_scale"):
            vars(out).pop(name, None)
        if par.L != self.par.L and any(g.row.has_lengths for g in self.groups):
            rows = [self.m.pairs[int(g.pairs[0])].type.scaled(par.L) for g in self.groups]
            out.groups = [replace(g, row=row) for g, row in zip(self.groups, rows, strict=True)]
            out.batches = out._factor_batches()
            for name in ("effort_table", "reaction_table", "moving_batches"):
                vars(out).pop(name, None)
        return out

    # --- state numbers -----------------------------------------------------------------------------------------------

    @cached_property
    def single_rows(self) -> Index:
        """For every freedom its row in the state, -1 for those of rotations."""
        out = np.full(self.n_freedoms, -1, dtype=np.intp)
        for g in self.groups:
            for factor, (columns, rows) in zip(g.row.steps, evaluation.places(g.row), strict=True):
                if not factor.holds_rotation:
                    out[g.columns[columns]] = g.state_rows[rows]
        return out

    @cached_property
    def _singles(self) -> tuple[Place, Place]:
        """Columns and state rows of the single freedoms."""
        columns = np.flatnonzero(self.single_rows >= 0)
        return compact(columns), compact(self.single_rows[columns])

    @cached_property
    def _rotations(self) -> tuple[Index, Index] | None:
        """Columns ``(3, n)`` and state rows ``(4, n)`` of the rotations; None where there are none."""
        parts = [
            (g.columns[columns], g.state_rows[rows])
            for g in self.groups
            for factor, (columns, rows) in zip(g.row.steps, evaluation.places(g.row), strict=True)
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

    def start_coordinates(self, start: Mapping[str, float]) -> Array:
        """User coordinates ``(F,)`` from a mapping freedom -> value, zero elsewhere."""
        q = np.zeros(self.n_freedoms)
        for name, value in start.items():
            k, j = self.m.freedom(name)
            q[self.first_column[k] + j] = value
        return q

    def advance(self, x: Array, dq: Array) -> Array:
        """States after increments ``dq (F, ...)``."""
        shape = np.broadcast_shapes(x.shape[1:], dq.shape[1:])
        out = np.empty((self.n_state, *shape), dtype=np.result_type(x, dq))
        columns, rows = self._singles
        out[rows] = x[rows] + dq[columns]
        if self._rotations is not None:
            turns, turned = self._rotations
            out[turned] = evaluation.turned(x[turned], dq[turns])
        return out

    def difference(self, x1: Array, x0: Array) -> Array:
        """Increments ``(F, ...)`` from ``x0`` to ``x1``."""
        shape = np.broadcast_shapes(x1.shape[1:], x0.shape[1:])
        out = np.empty((self.n_freedoms, *shape), dtype=np.result_type(x1, x0))
        columns, rows = self._singles
        out[columns] = x1[rows] - x0[rows]
        if self._rotations is not None:
            turns, turned = self._rotations
            out[turns] = evaluation.turn_between(x1[turned], x0[turned])
        return out

    def tangent(self, dq: Array, rates: Array) -> Array:
        """Rates of increments ``dq (F, ...)`` at the state that they lead to, from the rates of the freedoms there."""
        out = rates.copy()
        if self._rotations is not None:
            turns, _ = self._rotations
            out[turns] = evaluation.turn_tangent(dq[turns], rates[turns])
        return out

    def at(self, x: Array) -> Configuration:
        """Evaluate states ``(nx, T)``."""
        return Configuration(self, x)


GRAPH_ONLY = (
    "owners",
    "pair_ranks",
    "factor_ranks",
    "factors_by_pair",
    "factor_carriers",
    "moving_batches",
    "chord_nodes",
    "column_nodes",
    "single_rows",
    "_singles",
    "_rotations",
    "effort_table",
    "reaction_table",
)
"""What is made when first asked for and does not depend on numbers."""
FEW_LOOPS_ONLY = ("loop_columns", "loop_matrix", "loop_pieces", "loops_of_chords")
"""The same where it is used for few loops only."""


def _indices(m: Mechanism) -> dict[str, Any]:
    """What a system knows of links, pairs and frame alone."""
    made = System(m, couplings=())
    for name in ("numbers", *GRAPH_ONLY, *(() if made.many_loops else FEW_LOOPS_ONLY)):
        getattr(made, name)
    return {name: value for name, value in vars(made).items() if name not in ("m", "couplings")}


def indexed(m: Mechanism) -> System:
    """The system of a mechanism with its declared numbers; what follows from links, pairs and frame is computed once."""
    out = System.__new__(System)
    vars(out).update(m.once(_indices), m=m, couplings=getattr(m, "couplings", ()))
    return out
