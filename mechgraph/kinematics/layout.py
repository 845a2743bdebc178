"""Where everything of a mechanism stands in arrays: columns of freedoms, rows of the state, nodes of the walk, screws, loops.

All of it follows from links, pairs and frame. It is made when first asked for, once for all systems of a mechanism. All single factors
of all pairs are evaluated together, whatever types they belong to: their places in the walk, their coordinates and coefficients
are arrays, so that no kernel goes through pairs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.graph.linkgraph import LinkGraph
from mechgraph.kinematics.batches import (
    MARKER_A,
    MARKER_B,
    FactorBatch,
    PairsOfType,
    Ranks,
    ScrewTable,
    Tree,
    Walk,
    factor_batches,
    ranked,
)
from mechgraph.maths.linear import Place, compact
from mechgraph.maths.se3 import Array, Index
from mechgraph.memo import graph_cached, of_graph, unit_cached
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.parameters import Parameters
from mechgraph.pairs.factors import Component
from mechgraph.pairs.pair_type import PairType
from mechgraph.pairs.travelling import Travelling


@of_graph
def _nothing_yet(m: Mechanism) -> dict[str, Any]:
    """What the systems of a mechanism share."""
    return {}


@dataclass(frozen=True)
class Entries:
    """The nonzero 6-vectors of the closure Jacobian: loop, column and sign of each, loop by loop."""

    loop: Index
    column: Index
    sign: Array
    first: Index

    @cached_property
    def loops(self) -> Place:
        """The loops; of one loop alone, one place for all."""
        return self.loop if len(self.first) > 2 else slice(0, 1)

    @cached_property
    def signs(self) -> Array:
        """The signs, ``(entries, 1)``."""
        return self.sign[:, None]

    def places(self, n_columns: int) -> Index | None:
        """Places ``(6, entries)`` of the entries in a matrix of six rows a loop, by rows; None where they fill one loop in order."""
        if len(self.first) == 2 and np.array_equal(self.column, np.arange(n_columns)):
            return None
        return (6 * self.loop + np.arange(6)[:, None]) * n_columns + self.column


def entries_of(graph: LinkGraph, first_column: Index) -> Entries:
    """All (loop, column) places of the closure Jacobian of a graph whose pairs have their freedoms from ``first_column`` on."""
    loop, pair, sign = graph.loop_steps
    width = np.diff(first_column)[pair]
    step = np.repeat(np.arange(len(loop)), width)
    within = np.arange(len(step)) - np.repeat(np.cumsum(width) - width, width)
    first = np.searchsorted(loop[step], np.arange(graph.n_loops + 1))
    return Entries(loop[step], first_column[pair[step]] + within, sign[step], first.astype(np.intp))


class Places:
    """The places of a mechanism with geometry; ``par`` gives the unit of length of pair types that have lengths."""

    def __init__(self, m: Mechanism, graph: LinkGraph, par: Parameters) -> None:
        self.m, self.graph, self.par = m, graph, par
        self.a, self.b, self.chords = graph.a, graph.b, graph.chords
        self._shared = m.once(_nothing_yet)
        self._sized = {} if self.has_lengths else self._shared

    @property
    def sized_once(self) -> dict[Any, Any]:
        """What is kept for all systems of the mechanism that have the same unit of length, or whose pair types have no lengths."""
        return self._sized

    @property
    def types(self) -> list[PairType]:
        """The pair types."""
        return self._types[0]

    @property
    def type_of(self) -> Index:
        """For every pair the number of its type among ``types``."""
        return self._types[1]

    @graph_cached
    def _types(self) -> tuple[list[PairType], Index]:
        """The pair types, and for every pair the number of its own."""
        each = [pair.type for pair in self.m.pairs]
        ids = np.fromiter(map(id, each), np.int64, len(each))
        _, first, same = np.unique(ids, return_index=True, return_inverse=True)
        numbers: dict[PairType, int] = {}
        number = np.empty(len(first), dtype=np.intp)
        for i in np.argsort(first).tolist():
            number[i] = numbers.setdefault(each[first[i]], len(numbers))
        return list(numbers), number[same]

    def _by_type(self, of: Callable[[PairType], int]) -> Index:
        """A number of every pair that follows from its type."""
        types, number = self._types
        return np.array([of(row) for row in types], dtype=np.intp)[number]

    @graph_cached
    def has_lengths(self) -> bool:
        """Whether a pair type has lengths of its own."""
        return any(row.has_lengths for row in self._types[0])

    # --- index arrays ------------------------------------------------------------------------------------------------

    @graph_cached
    def first_column(self) -> Index:
        """For every pair its first freedom, and the number of all behind the last."""
        return np.concatenate([[0], np.cumsum(self._by_type(lambda row: row.f))]).astype(np.intp)

    @graph_cached
    def first_row(self) -> Index:
        """For every pair its first number in the state, and the number of all behind the last."""
        return np.concatenate([[0], np.cumsum(self._by_type(lambda row: row.nx))]).astype(np.intp)

    @graph_cached
    def n_freedoms(self) -> int:
        """Number ``F`` of freedoms."""
        return int(self.first_column[-1])

    @graph_cached
    def n_state(self) -> int:
        """Length ``nx`` of the state."""
        return int(self.first_row[-1])

    @graph_cached
    def n_factors(self) -> Index:
        """For every pair the number of its factors."""
        return self._by_type(lambda row: len(row.steps))

    @graph_cached
    def tree(self) -> Tree:
        """The spanning tree."""
        return Tree(self.graph)

    @graph_cached
    def walk(self) -> Walk:
        """The way through every factor of the pairs."""
        return Walk(self.tree, (self.a, self.b), self.chords, np.maximum(self.n_factors, 1))

    @unit_cached
    def groups(self) -> list[PairsOfType]:
        """The pairs by type."""
        out = []
        for number, row in enumerate(self._types[0]):
            index = np.flatnonzero(self._types[1] == number)
            columns = self.first_column[index] + np.arange(row.f, dtype=np.intp)[:, None]
            state = self.first_row[index] + np.arange(row.nx, dtype=np.intp)[:, None]
            out.append(PairsOfType(row.scaled(self.par.L), index, columns, state))
        return out

    @unit_cached
    def batches(self) -> list[FactorBatch]:
        """The factors by kind."""
        return factor_batches(self.groups, self.walk, self.n_factors)

    @graph_cached
    def is_length(self) -> NDArray[np.bool_]:
        """Which freedoms are slides."""
        out = np.zeros(self.n_freedoms, dtype=bool)
        for g in self.groups:
            out[g.columns] = np.array([not f.turns for f in g.row.freedoms], dtype=bool)[:, None]
        return out

    @unit_cached
    def limits(self) -> tuple[Index, Array, Array]:
        """The single freedoms whose coordinates have a range, and least and greatest values."""
        ranges = np.full((self.n_freedoms, 2), (-np.inf, np.inf))
        for g in self.groups:
            ranges[g.columns] = (
                np.array([end for step in g.row.steps for end in step.ranges])[:, None] if g.row.f else 0.0
            )
        columns = np.flatnonzero(np.isfinite(ranges).any(axis=1))
        return columns, ranges[columns, 0], ranges[columns, 1]

    @unit_cached
    def periods(self) -> Array:
        """By how much every freedom ``(F,)`` grows until it is back: a turn, the length of a closed curve; infinite where it goes on."""
        out = np.full(self.n_freedoms, np.inf)
        for g in self.groups:
            out[g.columns] = np.array([p for step in g.row.steps for p in step.periods])[:, None] if g.row.f else np.inf
        return out

    def rounds(self, columns: Index | NDArray[np.bool_], gained: Array) -> Array:
        """What whole rounds amount to in gains ``(n, ...)`` of some freedoms: zero in those that do not come back."""
        period = self.periods[columns].reshape(-1, *(1,) * (gained.ndim - 1))
        back = np.isfinite(period)
        return np.where(back, np.where(back, period, 0.0) * np.round(gained / period), 0.0)

    def place_of(self, pair: int) -> tuple[int, int]:
        """Number of the group of a pair, and its place there."""
        number = int(self._types[1][pair])
        return number, int(np.searchsorted(self.groups[number].pairs, pair))

    @graph_cached
    def pair_of_freedom(self) -> Index:
        """For every freedom its pair, as numbers."""
        return np.repeat(np.arange(len(self.m.pairs)), np.diff(self.first_column))

    def freedom_names_of(self, columns: Index) -> tuple[str, ...]:
        """Full names of some freedoms."""
        pairs = self.pair_of_freedom[columns]
        places = columns - self.first_column[pairs]
        return tuple(self.m.pairs[k].freedom_names[i] for k, i in zip(pairs.tolist(), places.tolist(), strict=True))

    @graph_cached
    def owners(self) -> Place:
        """For every freedom its pair."""
        return compact(self.pair_of_freedom)

    @graph_cached
    def pair_ranks(self) -> Ranks:
        """Freedoms as runs by pair."""
        return ranked(np.diff(self.first_column))

    @graph_cached
    def factor_ranks(self) -> Ranks:
        """Freedoms as runs by factor, factors pair by pair."""
        widths = [[len(step.freedoms) for step in row.steps] for row in self._types[0]]
        table = np.array([w + [0] * (max(map(len, widths)) - len(w)) for w in widths], dtype=np.intp)
        used = np.arange(table.shape[1]) < self.n_factors[:, None]
        return ranked(table[self._types[1]][used])

    @graph_cached
    def factors_by_pair(self) -> Ranks:
        """Factors as runs by pair."""
        return ranked(self.n_factors)

    @graph_cached
    def factor_carriers(self) -> Place:
        """For every factor the link a of its pair."""
        return compact(np.repeat(self.a, self.n_factors))

    def factor_numbers(self, batch: FactorBatch) -> Index:
        """Numbers of the factors of a batch, counted pair by pair."""
        return np.asarray((np.cumsum(self.n_factors) - self.n_factors)[batch.pairs] + batch.ranks)

    @unit_cached
    def moving_batches(self) -> list[FactorBatch]:
        """The factors whose twists move with their coordinates."""
        return [b for b in self.batches if b.stack.constant_twists(self.par.pitch[b.pairs]) is None]

    @unit_cached
    def bend(self) -> float:
        """Greatest curvature of curves and surfaces, over one of the length of the mechanism; 0 where there are none."""
        factors = [factor for b in self.moving_batches for factor in b.factors]
        return max((factor.bend for factor in factors if isinstance(factor, Travelling)), default=0.0)

    @graph_cached
    def chord_nodes(self) -> tuple[Index, Index]:
        """For every chord the node in which it ends, and that of its link b."""
        return self.walk.end_node[self.chords], self.walk.link_node[self.b[self.chords]]

    @graph_cached
    def column_nodes(self) -> Index:
        """For every freedom the node of the frame before its factor."""
        out = np.empty(self.n_freedoms, dtype=np.intp)
        for batch in self.batches:
            out[batch.columns] = self.batch_nodes(batch)
        return out

    def batch_nodes(self, batch: FactorBatch) -> Index:
        """Nodes of the frames before the factors of a batch."""
        return self.walk.node_before(batch.pairs, batch.ranks)

    def frame_place(self, g: PairsOfType, k: int) -> tuple[Index, Index]:
        """Node of frame ``k`` of the pairs of a group, and the constant pose behind it (a place in ``Numbers.constants``)."""
        n = len(self.m.pairs)
        if k == 0:
            return self.walk.link_node[self.a[g.pairs]], 1 + MARKER_A * n + g.pairs
        if k == g.row.f:
            return self.walk.end_node[g.pairs], 1 + MARKER_B * n + g.pairs
        rank = next(r for r, factor in enumerate(g.row.factors) if k in factor)
        return self.walk.node_before(g.pairs, rank), np.zeros(len(g.pairs), dtype=np.intp)

    # --- screws of components ----------------------------------------------------------------------------------------

    @unit_cached
    def effort_table(self) -> ScrewTable:
        """Efforts of all freedoms, in the order of the freedoms."""
        parts = [(g, c) for g in self.groups for c in g.row.efforts]
        table = self._screw_table(parts)
        columns = [column for g in self.groups for column in g.columns]
        order = np.argsort(np.concatenate(columns)) if columns else np.zeros(0, dtype=np.intp)
        return table.taken(order)

    @unit_cached
    def reaction_table(self) -> ScrewTable:
        """Constant reaction components, group by group, component by component."""
        return self._screw_table([(g, c) for g in self.groups for c in g.row.reactions or ()])

    def _screw_table(self, parts: Sequence[tuple[PairsOfType, Component]]) -> ScrewTable:
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

    @graph_cached
    def loop_columns(self) -> list[tuple[Index, Array]]:
        """Columns of the freedoms along every loop, and their signs."""
        return [self._columns_of_loop(loop) for loop in self.graph.loops]

    def _columns_of_loop(self, loop: tuple[tuple[int, int], ...]) -> tuple[Index, Array]:
        columns = [np.arange(self.first_column[k], self.first_column[k + 1]) for k, _ in loop]
        signs = [np.full(len(c), float(sign)) for c, (_, sign) in zip(columns, loop, strict=True)]
        return np.concatenate(columns), np.concatenate(signs)

    @graph_cached
    def entries(self) -> Entries:
        """The freedoms along the loops."""
        return entries_of(self.graph, self.first_column)

    @graph_cached
    def entry_places(self) -> Index | None:
        """Where they stand in the Jacobian of the loops, see ``Entries.places``."""
        return self.entries.places(self.n_freedoms)

    @graph_cached
    def loops_of_chords(self) -> scipy.sparse.csr_array:
        """Which chord closures make up a loop, ``(loops, chords)`` with signs."""
        return self.graph.sparse_loop_matrix[:, self.chords]
