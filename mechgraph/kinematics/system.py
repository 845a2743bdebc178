"""A mechanism made ready for evaluation: places of everything in arrays, numbers as the kernel multiplies them, states, closure rows.

Where everything stands (columns of freedoms, rows of the state, nodes of the walk, screws, loops) follows from links, pairs and frame. It
is made when first asked for, once for all systems of a mechanism. All single factors of all pairs are evaluated together, whatever types
they belong to: their places in the walk, their coordinates and coefficients are arrays, so that no kernel goes through pairs. ``Numbers``
follow from the parameters and are made when first asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.graph.linkgraph import Entries, LinkGraph, Ranks, Tree, Walk, entries_of, link_graph, ranked
from mechgraph.kinematics.rows import CouplingRows, LineRows, LoopRows, Rows, in_places
from mechgraph.maths.linear import Place, compact
from mechgraph.maths.se3 import Array, Index, cross, homogeneous, identity, inverse, turn_between, turn_tangent, turned
from mechgraph.memo import dataclass, graph_cached, of_graph, unit_cached
from mechgraph.model.gears import moving_lines
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.parameters import Parameters, coupling_places, parameters
from mechgraph.pairs import pair_type as evaluation
from mechgraph.pairs.factors import Component, Factor, FixedStack, Stack
from mechgraph.pairs.pair_type import PairType
from mechgraph.pairs.travelling import Travelling

MARKER_A, MARKER_B = range(2)
"""Order of the constant poses in ``Numbers.constants``, after the identity."""


@dataclass(frozen=True)
class PairsOfType:
    """The pairs of one type: their indices, the columns of their freedoms ``(f, n)`` and rows of their state ``(nx, n)``."""

    row: PairType
    pairs: Index
    columns: Index
    state_rows: Index


@dataclass(frozen=True)
class FactorBatch:
    """All factors of one kind: their steps in the walk, columns of their freedoms ``(f, n)`` and rows of their state ``(nx, n)``.

    ``member (n,)`` says which of ``factors`` each one is; without ``factors`` it is a pair that has none.
    """

    factors: tuple[Factor, ...]
    member: Index
    pairs: Index
    ranks: Index
    steps: Index
    columns: Index
    state_rows: Index

    @cached_property
    def stack(self) -> Stack:
        """The factors for evaluation together."""
        if not self.factors:
            return FixedStack(len(self.member))
        starts = np.flatnonzero(np.concatenate([[True], self.member[1:] != self.member[:-1]]))
        counts = np.diff(np.append(starts, len(self.member))).tolist()
        runs = [self.factors[i] for i in self.member[starts].tolist()]
        return runs[0].stack(runs, counts)

    def part(self, at: slice) -> FactorBatch:
        """Some of the factors."""
        arrays = (self.member, self.pairs, self.ranks, self.steps, self.columns, self.state_rows)
        return FactorBatch(self.factors, *(array[..., at] for array in arrays))

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

    def taken(self, order: Place) -> ScrewTable:
        """Some of the screws, in that order."""
        return ScrewTable(*(getattr(self, part.name)[..., order] for part in fields(self)))


def factor_batches(groups: Sequence[PairsOfType], walk: Walk, n_factors: Index) -> list[FactorBatch]:
    """The factors of all pairs by kind, each kind in the order of the walk; pairs without a factor are a kind of their own."""
    kinds: dict[Hashable, list[tuple[Factor, PairsOfType, int]]] = {}
    for g in groups:
        for rank, factor in enumerate(g.row.steps):
            kinds.setdefault(factor.kind, []).append((factor, g, rank))
    batches = [_batch(members, walk) for members in kinds.values()]
    fixed = np.flatnonzero(n_factors == 0)
    if fixed.size:
        nothing = np.zeros((0, len(fixed)), dtype=np.intp)
        steps = walk.step_of[walk.first[fixed]]
        zeros = np.zeros(len(fixed), dtype=np.intp)
        batches.append(FactorBatch((), zeros, fixed, zeros, steps, nothing, nothing))
    return batches


def _batch(members: Sequence[tuple[Factor, PairsOfType, int]], walk: Walk) -> FactorBatch:
    parts = []
    for number, (_, g, rank) in enumerate(members):
        _, at_columns, at_rows = evaluation.placed(g.row)[rank]
        same = [np.full(len(g.pairs), value, dtype=np.intp) for value in (rank, number)]
        parts.append(
            [g.columns[at_columns], g.state_rows[at_rows], g.pairs, walk.step_of[walk.first[g.pairs] + rank], *same]
        )
    joined: list[Index] = [np.concatenate(part, axis=-1) for part in zip(*parts, strict=True)]
    order = np.argsort(joined[3], kind="stable")
    columns, rows, pairs, steps, ranks, member = (part[..., order] for part in joined)
    return FactorBatch(tuple(factor for factor, _, _ in members), member, pairs, ranks, steps, columns, rows)


FACTORS_AT_ONCE = 2048
"""Factors whose coefficients are multiplied with their markers at once: what lies between stays in the cache."""


class Numbers:
    """Coefficients of poses and screws of a system, from its parameters; a trailing batch axis of length 1, or one a variant.

    ``for_one``: whether one state alone is evaluated, for which the coefficients of the poses are not kept.
    """

    def __init__(
        self,
        par: Parameters,
        walk: Walk,
        batches: Sequence[FactorBatch],
        n_factors: Index,
        n_freedoms: int,
        for_one: bool = False,
    ) -> None:
        self.par, self.walk, self.batches, self.for_one = par, walk, batches, for_one
        self.n_factors, self.n_freedoms = n_factors, n_freedoms
        self.n_pairs = len(n_factors)

    def taken(self, par: Parameters, which: Index) -> Numbers:
        """Those of some variants, with their parameters."""
        out = Numbers(par, self.walk, self.batches, self.n_factors, self.n_freedoms, self.for_one)
        vars(out).update(constants=_of(self.constants, which), twists=_of(self.twists, which))
        vars(out)["poses"] = [
            (_of(C, which) if C.ndim == 4 else C, (_of(left, which), _of(right, which)))
            for C, (left, right) in self.poses
        ]
        return out

    @cached_property
    def constants(self) -> Array:
        """Constant poses ``(3, 4, 1 + 2 P, B)``: the identity, markers A, markers B."""
        A, B = self.par.marker_a, self.par.marker_b
        batch = np.broadcast_shapes(A.shape[3:], B.shape[3:])[0]
        out = np.empty((3, 4, 1 + 2 * self.n_pairs, batch), dtype=np.result_type(A, B))
        out[:, :, :1], out[:, :, 1 : 1 + self.n_pairs], out[:, :, 1 + self.n_pairs :] = identity(1, 1), A, B
        return out

    @cached_property
    def is_real(self) -> bool:
        """Whether no parameter is complex."""
        return not any(np.iscomplexobj(part) for part in (self.constants, self.par.pitch, self.par.frame))

    @cached_property
    def poses(self) -> list[tuple[Array, tuple[Array, Array]]]:
        """For every batch of factors the coefficients ``(n, 16, m)`` of the poses of its steps (``(16, m, n, B)`` where pitches vary), and
        the markers beside them ``(4, 4, n, B)``, seen from the nodes from which the steps start (from the global frame where that is
        the frame link).
        """
        out: list[tuple[Array, tuple[Array, Array]]] = []
        for b in self.batches:
            C = self._coefficients(b)
            C = C.reshape(16, *C.shape[2:])
            out.append((np.ascontiguousarray(C[..., 0].transpose(2, 0, 1)) if C.shape[3] == 1 else C, self._beside(b)))
        return out

    def parts(self) -> Iterator[tuple[FactorBatch, Array, tuple[Array, Array]]]:
        """The factors with their coefficients and the poses beside them, see ``poses``: whole batches, or few factors at once."""
        if not self.for_one:
            yield from ((b, *pose) for b, pose in zip(self.batches, self.poses, strict=True))
            return
        for b in self.batches:
            for i in range(0, len(b.pairs), FACTORS_AT_ONCE):
                part = b.part(slice(i, i + FACTORS_AT_ONCE))
                C = self._coefficients(part)
                yield part, C.reshape(16, *C.shape[2:]), self._beside(part)

    def _coefficients(self, b: FactorBatch) -> Array:
        """Coefficients ``(4, 4, m, n, B)`` of the poses of a batch in the sense of the walk."""
        return b.stack.coefficients(self.par.pitch[b.pairs], np.asarray(self.walk.back[b.steps], dtype=bool))

    def _beside(self, b: FactorBatch) -> tuple[Array, Array]:
        """Constant poses before and behind the factors of a batch in the sense of the walk, homogeneous ``(4, 4, n, B)``."""
        n, last = self.n_pairs, np.maximum(self.n_factors, 1) - 1
        back, begins, ends = self.walk.back[b.steps], b.ranks == 0, b.ranks == last[b.pairs]
        at_a, at_b = begins * (1 + MARKER_A * n + b.pairs), ends * (1 + MARKER_B * n + b.pairs)
        before = homogeneous(self.constants.take(np.where(back, at_b, at_a), axis=2))
        behind = homogeneous(inverse(self.constants.take(np.where(back, at_a, at_b), axis=2)))
        starts = self.walk.parents[b.steps] == 0
        before[:, :, starts] = np.einsum("abt,bcnt->acnt", homogeneous(self.par.frame), before[:, :, starts])
        return before, behind

    @cached_property
    def twists(self) -> Array:
        """Twists of all freedoms in their nodes, bound and free part ``(3, 2, F, B)``; zero for those that move."""
        batch = np.broadcast_shapes(self.constants.shape[3:], self.par.pitch.shape[1:])[0]
        out = np.zeros((3, 2, self.n_freedoms, batch), dtype=np.result_type(self.constants, self.par.pitch))
        for b in self.batches:
            S = b.stack.constant_twists(self.par.pitch[b.pairs])
            if S is not None:
                self.place_twists(out, b, S)
        return out

    def place_twists(self, out: Array, b: FactorBatch, S: Array) -> None:
        """Twists ``(6, f, n, T)`` in the frames before the factors of a batch, written into ``out (3, 2, F, T)`` in their nodes."""
        X = self.marker_a_if_first(b)
        for j, columns in enumerate(b.columns):
            out[:, 0, columns] = np.einsum("ijnt,jnt->int", X[:, :3], S[:3, j])
            out[:, 1, columns] = np.einsum("ijnt,jnt->int", X[:, :3], S[3:, j])
            out[:, 1, columns] += cross(X[:, 3], out[:, 0, columns])

    def marker_a_if_first(self, b: FactorBatch) -> Array:
        """The frames before the factors of a batch in their nodes ``(3, 4, n, B)``: markers A before the first ones of pairs."""
        return self.constants[:, :, np.where(b.ranks == 0, 1 + MARKER_A * self.n_pairs + b.pairs, 0)]

    def components(self, table: ScrewTable) -> Array:
        """Wrenches of a table in their nodes, moment and force ``(3, 2, K, B)``; without arms where they act at markers B."""
        batch = np.broadcast_shapes(self.constants.shape[3:], self.par.pitch.shape[1:])[0]
        out = np.empty((3, 2, len(table.pairs), batch), dtype=np.result_type(self.constants, self.par.pitch))
        for i in range(0, len(table.pairs), FACTORS_AT_ONCE):
            self._place_components(table.taken(slice(i, i + FACTORS_AT_ONCE)), out[:, :, i : i + FACTORS_AT_ONCE])
        return out

    def _place_components(self, table: ScrewTable, out: Array) -> None:
        X = self.constants[:, :, table.const]
        free = table.free[..., None] + table.per_pitch[..., None] * self.par.pitch[table.pairs]
        out[:, 0] = np.einsum("ijkt,jkt->ikt", X[:, :3], free)
        out[:, 1] = np.einsum("ijkt,jk->ikt", X[:, :3], table.bound)
        out[:, 0] += np.where(table.at_b[:, None], 0.0, cross(X[:, 3], out[:, 1]))

    @cached_property
    def ends(self) -> Array:
        """Origins of the markers B in the frames of their links b, ``(3, 1, P, B)``."""
        return self.par.marker_b[:, None, 3]


def _of(values: Array, which: Index) -> Array:
    """Some variants of a batch; of a batch of one, itself."""
    return values.take(which, axis=-1) if values.shape[-1] > 1 else values


@of_graph
def _nothing_yet(m: Mechanism) -> dict[str, Any]:
    """What the systems of a mechanism share."""
    return {}


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

    def columns_of(self, names: Iterable[str]) -> Index:
        """The freedoms of that name."""
        return np.array([self.first_column[k] + j for k, j in map(self.m.freedom, names)], dtype=np.intp)

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
        moving = self.m.once(moving_lines)
        on_lines = np.array([c.name in moving for c in self.m.couplings], dtype=bool)
        linear, lines = np.flatnonzero(~on_lines), np.flatnonzero(on_lines)
        out: list[Rows] = [LoopRows(self.graph.n_loops, self.graph.loop_rows)]
        out += [self._linear_rows(linear)] if linear.size else []
        return out + ([LineRows(self, lines)] if lines.size else [])

    @property
    def position_rows(self) -> Sequence[Rows]:
        """The same where positions alone are asked for, and further ones of these."""
        return self.rows

    def _linear_rows(self, which: Index) -> CouplingRows:
        """The rows of linear couplings, by their places; one without a constant keeps the value that it has at the start."""
        numbers, every = self.par.couplings, coupling_places(self.m)
        couplings, places = [self.m.couplings[g] for g in which], [every[g] for g in which]
        columns = self.columns_of(name for c in couplings for name in c.freedoms)
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
        at = compact(self.graph.loop_rows + which)
        return CouplingRows(at, coefficients * scale[rows], rows, columns, constant * scale, scale, self.single_rows)

    @cached_property
    def n_rows(self) -> int:
        """Number of closure rows."""
        return sum(len(part.scale) for part in self.position_rows)

    @cached_property
    def row_scale(self) -> Array:
        """Factors ``(n_rows, B)`` of every row over the user's relation: its multiplier in the user's units is ``scale * x``."""
        B = self.par.couplings.shape[1]
        each = [np.broadcast_to(part.scale, (len(part.scale), B)) for part in self.position_rows]
        return in_places(self.position_rows, each)

    @property
    def coupling_matrix(self) -> Array:
        """Coefficients ``(couplings, F, B)`` of the rows behind those of the loops, internal units."""
        out = np.zeros((len(self.m.couplings), self.n_freedoms, self.par.couplings.shape[1]))
        for part in self.rows:
            if isinstance(part, CouplingRows):
                out[np.arange(self.n_rows)[part.places] - self.graph.loop_rows] = part.matrix
        return out

    @property
    def coupled_freedoms(self) -> Index:
        """Freedoms into which rows other than those of loops bring efforts."""
        return np.unique(self.columns_of(name for c in self.m.couplings for name in c.freedoms))

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
        """The system with the numbers of some variants of its batch, in that order; of a batch of one, or of all of them, itself."""
        if self.par.batch == 1 or np.array_equal(which, np.arange(self.par.batch)):
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
