"""Where everything of a mechanism stands in arrays: columns of freedoms, rows of the state, nodes of the walk, screws, loops.

All of it follows from links, pairs and frame. It is made when first asked for, once for all systems of a mechanism. All single factors
of all pairs are evaluated together, whatever types they belong to: their places in the walk, their coordinates and coefficients
are arrays, so that no kernel goes through pairs.

What is evaluated together: links along the tree, pairs of a type, factors of a kind, and the numbers of all of them.

Along the spanning tree: poses and sums from the frame outwards, loads from the leaves inwards, for every link at once.

``Tree`` goes from link to link; ``Walk`` goes through every factor of the pairs, along the tree and once across every chord.
A tree of few levels is run through level by level. In a deep one (a chain of many loops) every link reaches its ancestors by
pointer doubling: after step ``s`` it knows the way to its ancestor ``2^s`` levels down, so that the logarithm of the depth counts.
Source: Jaja, An Introduction to Parallel Algorithms, 1992, section 2.2 (pointer jumping).
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import fields
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.graph.linkgraph import LinkGraph
from mechgraph.maths.linear import Place, add_at, compact, scattered_sum
from mechgraph.maths.se3 import Array, Index, compose, cross, homogeneous, identity, inverse, multiplied
from mechgraph.memo import dataclass, graph_cached, of_graph, unit_cached
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.parameters import Parameters
from mechgraph.pairs import pair_type as evaluation
from mechgraph.pairs.factors import Component, Factor, FixedStack, Stack
from mechgraph.pairs.pair_type import PairType
from mechgraph.pairs.travelling import Travelling

Level = tuple[Index, NDArray[np.bool_], Index, Index]

Step = tuple[Place, NDArray[np.bool_] | None, Place, Place]

DEEP = 200
"""Levels above which the tree is run through by pointer doubling."""


class Tree:
    """The spanning tree of a graph as arrays; level ``(pairs, forward, parents, children)``, ``forward`` from a to b."""

    def __init__(self, graph: LinkGraph) -> None:
        self.n_links, self.frame = graph.n_links, graph.frame
        self.pairs, sign, self.parents, self.children = graph.steps.T
        self.forward = sign > 0
        depth = np.zeros(self.n_links, dtype=np.intp)
        for parent, child in zip(self.parents.tolist(), self.children.tolist(), strict=True):
            depth[child] = depth[parent] + 1
        ends = np.searchsorted(depth[self.children], np.arange(1, depth.max(initial=0) + 2))
        spans = [slice(int(i), int(j)) for i, j in pairwise(ends)]
        parts = (self.pairs, self.forward, self.parents, self.children)
        self.levels: list[Level] = [tuple(part[span] for part in parts) for span in spans]
        self.deep = len(self.levels) > DEEP

    @cached_property
    def _walk(self) -> list[Step]:
        """The levels with indices that take no copy where they can; ``forward`` is None where all lead outwards."""
        return [
            (compact(pairs), None if forward.all() else forward, compact(parents), compact(children))
            for pairs, forward, parents, children in self.levels
        ]

    @property
    def _whole(self) -> Step:
        """All pairs of the tree in one step."""
        return self.pairs, self.forward, self.parents, self.children

    @cached_property
    def _jumps(self) -> list[Index]:
        """Ancestor of every link after 1, 2, 4, ... levels; the frame stands for all that lie beyond."""
        ancestor = np.full(self.n_links, self.frame, dtype=np.intp)
        ancestor[self.children] = self.parents
        return _doubled(ancestor, self.frame)

    def sums(self, relative: Array) -> Array:
        """Sums ``(6, N, T)`` of pair terms ``(6, P, T)`` from the frame to every link, with the sense of the way."""
        out = np.zeros((6, self.n_links, relative.shape[2]), dtype=relative.dtype)
        if not self.deep:
            for pairs, forward, parents, children in self._walk:
                step = relative[:, pairs]
                if forward is not None:
                    step = np.where(forward[:, None], 1.0, -1.0) * step
                out[:, children] = out[:, parents] + step
            return out
        out[:, self.children] = np.where(self.forward[:, None], 1.0, -1.0) * relative[:, self.pairs]
        for ancestor in self._jumps:
            out = out + out[:, ancestor]
        return out

    def carried(self, loads: Array) -> Array:
        """Sums ``(6, N, T)`` of the loads of every link and of all links behind it; the transpose of ``sums``."""
        out = loads.copy()
        if not self.deep:
            for _, _, parents, children in reversed(self._walk):
                if isinstance(parents, slice):
                    out[:, parents] += out[:, children]
                else:
                    add_at(out, parents, out[:, children])
            return out
        for ancestor in reversed(self._jumps):
            moving = out.copy()
            moving[:, ancestor == self.frame] = 0.0
            out = out + scattered_sum(moving, ancestor, self.n_links)
        out[:, self.frame] = loads.sum(axis=1)
        return out

    def wrenches(self, loads: Array, n_pairs: int) -> Array:
        """Pair wrenches ``(6, P, T)`` that carry the loads along the tree, chords free."""
        out = np.zeros((6, n_pairs, loads.shape[2]), dtype=loads.dtype)
        carried = self.carried(loads)
        for pairs, forward, _, children in [self._whole] if self.deep else self._walk:
            step = carried[:, children]
            out[:, pairs] = -step if forward is None else np.where(forward[:, None], -1.0, 1.0) * step
        return out


def _doubled(ancestor: Index, root: int) -> list[Index]:
    """Ancestors after 1, 2, 4, ... steps, until all have come to the root."""
    out = []
    while (ancestor != root).any():
        out.append(ancestor)
        ancestor = ancestor[ancestor]
    return out


class Walk:
    """The way from the frame through every factor of the pairs: a tree whose nodes are frames.

    A pair of the spanning tree takes as many steps as it has factors (one where it has none), each over one factor, against its
    direction (``back``) where the tree leads from b to a. A chord is walked from its link a and ends in a node of its own: the
    frame of its link b as it is reached through the chord. Node 0 is the frame link, step ``i`` leads to node ``i + 1``; steps
    come in the order of their levels, so that a level is one run of steps and of nodes.

    Attributes
    ----------
    parents, pair, rank, back : for every step the node from which it starts, its pair, the number of its factor in that pair
        and whether the factor is run through backwards.
    link_node, end_node : node of every link; node in which every pair ends at its link b, the own node for a chord.
    first : for every pair the first of its factors in ``step_of``, which lists the steps pair by pair, factor by factor.
    """

    def __init__(self, tree: Tree, ends: tuple[Index, Index], chords: Index, counts: Index) -> None:
        pairs = np.concatenate([tree.pairs, chords])
        back = np.concatenate([~tree.forward, np.zeros(len(chords), dtype=bool)])
        origin = np.concatenate([tree.parents, ends[0][chords]])
        depth = np.zeros(tree.n_links, dtype=np.intp)
        for through, _, parents, children in tree.levels:
            depth[children] = depth[parents] + counts[through]
        n = counts[pairs]
        owner, within = _runs(n)
        level = depth[origin][owner] + within
        order = np.argsort(level, kind="stable")
        node = np.empty(len(order), dtype=np.intp)
        node[order] = np.arange(1, len(order) + 1)
        last = node[np.cumsum(n) - 1]
        self.link_node = np.zeros(tree.n_links, dtype=np.intp)
        self.link_node[tree.children] = last[: len(tree.pairs)]
        self.end_node = self.link_node[ends[1]]
        self.end_node[chords] = last[len(tree.pairs) :]
        parents = np.where(within == 0, self.link_node[origin][owner], np.roll(node, 1))
        rank = np.where(back[owner], n[owner] - 1 - within, within)
        self.parents, self.pair, self.rank, self.back = (a[order] for a in (parents, pairs[owner], rank, back[owner]))
        self.first = np.cumsum(counts) - counts
        self.step_of = np.empty(len(order), dtype=np.intp)
        self.step_of[self.first[self.pair] + self.rank] = np.arange(len(order))
        self.levels = self._levels(level[order])
        self.n_first = int((level == 0).sum())

    def _levels(self, level: Index) -> list[tuple[Place, slice, slice]]:
        """For every level the nodes from which its steps start, the steps, and the nodes to which they lead."""
        ends = np.searchsorted(level, np.arange(level.max(initial=-1) + 2))
        return [
            (compact(self.parents[i:j]), slice(int(i), int(j)), slice(int(i) + 1, int(j) + 1))
            for i, j in pairwise(ends)
        ]

    def node_before(self, pairs: Index, rank: Index | int) -> Index:
        """Nodes of the frames before the factors of given ranks of pairs."""
        step = self.step_of[self.first[pairs] + rank]
        return np.where(self.back[step], step + 1, self.parents[step])

    @cached_property
    def _jumps(self) -> list[Index]:
        return _doubled(np.concatenate([[0], self.parents]), 0)

    def poses(self, relative: Array, frame: Array) -> Array:
        """Poses ``(3, 4, nodes, T)`` from those of the steps, homogeneous ``(4, 4, steps, T)``.

        ``frame (3, 4, 1)`` is the pose of node 0; the steps from there contain it already.
        """
        n, T = relative.shape[2:]
        X = np.empty((3, 4, n + 1, T), dtype=relative.dtype)
        if len(self.levels) > DEEP:
            X[:, :, 1:] = relative[:3]
            X[:, :, 0] = np.eye(3, 4)[:, :, None]
            for ancestor in self._jumps:
                X = compose(X[:, :, ancestor], X)
            X[:, :, 0] = frame
            return X
        X[:, :, 0] = frame
        X[:, :, 1 : self.n_first + 1] = relative[:3, :, : self.n_first]
        for parents, steps, nodes in self.levels[1:]:
            before = X[:, :, parents]
            multiplied(before[:, :3], relative[:3, :, steps], out=X[:, :, nodes])
            X[:, 3, nodes] += before[:, 3]
        return X


def _runs(counts: Index) -> tuple[Index, Index]:
    """For runs of given lengths, one after the other: the number of the run of every place, and the place in it."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - (np.cumsum(counts) - counts)[owner]


Ranks = list[tuple[Place, Place]]


def ranked(counts: Index) -> Ranks:
    """For runs of given lengths: the runs that have a first, second, ... place, and that place."""
    first = np.cumsum(counts) - counts
    owners = [np.flatnonzero(counts > r) for r in range(int(counts.max(initial=0)))]
    return [(compact(who), compact(first[who] + r)) for r, who in enumerate(owners)]


def run_sums(terms: Array, ranks: Ranks, n: int) -> Array:
    """Sums over runs: ``(6, places, T)`` -> ``(6, n, T)``."""
    out = np.zeros((6, n, terms.shape[2]), dtype=terms.dtype)
    for r, (owners, places) in enumerate(ranks):
        if r == 0:
            out[:, owners] = terms[:, places]
        else:
            out[:, owners] += terms[:, places]
    return out


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
            (_of(C, which) if C.ndim == 4 else C, beside and (_of(beside[0], which), _of(beside[1], which)))
            for C, beside in self.poses
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
    def poses(self) -> list[tuple[Array, tuple[Array, Array] | None]]:
        """For every batch of factors the coefficients of the poses of its steps with the markers beside them, seen from the nodes
        from which the steps start (from the global frame where that is the frame link).

        For one mechanism the markers are part of the coefficients, ``(n, 16, m)`` for a product of matrices. For variants, of
        which each has few positions, they stay beside them, ``(4, 4, n, B)``, and where pitches vary coefficients are
        ``(16, m, n, B)``.
        """
        out: list[tuple[Array, tuple[Array, Array] | None]] = []
        for b in self.batches:
            if self.constants.shape[3] == 1 and self.par.pitch.shape[1] == 1:
                out.append((self._folded(b), None))
                continue
            C, left, right = self._coefficients(b), *self._beside(b)
            C = C.reshape(16, *C.shape[2:])
            out.append((np.ascontiguousarray(C[..., 0].transpose(2, 0, 1)) if C.shape[3] == 1 else C, (left, right)))
        return out

    def parts(self) -> Iterator[tuple[FactorBatch, Array, tuple[Array, Array] | None]]:
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

    def _folded(self, b: FactorBatch) -> Array:
        """The same with the markers beside them, ``(n, 16, m)``, of one mechanism."""
        n = len(b.pairs)
        if n > FACTORS_AT_ONCE:
            first = self._folded(b.part(slice(0, FACTORS_AT_ONCE)))
            out = np.empty((n, *first.shape[1:]), dtype=first.dtype)
            out[:FACTORS_AT_ONCE] = first
            for i in range(FACTORS_AT_ONCE, n, FACTORS_AT_ONCE):
                out[i : i + FACTORS_AT_ONCE] = self._folded(b.part(slice(i, i + FACTORS_AT_ONCE)))
            return out
        C = self._coefficients(b)[..., 0]
        left, right = self._beside(b)
        C = np.einsum("acmn,cdn->admn", np.einsum("abn,bcmn->acmn", left[..., 0], C), right[..., 0])
        return np.ascontiguousarray(C.reshape(16, *C.shape[2:]).transpose(2, 0, 1))

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


@dataclass(frozen=True)
class Entries:
    """The nonzero 6-vectors of the closure Jacobian: loop, column and sign of each, loop by loop."""

    loop: Index
    column: Index
    sign: Array
    first: Index
    width: int = 6

    @cached_property
    def loops(self) -> Place:
        """The loops; of one loop alone, one place for all."""
        return self.loop if len(self.first) > 2 else slice(0, 1)

    @cached_property
    def signs(self) -> Array:
        """The signs, ``(entries, 1)``."""
        return self.sign[:, None]

    def places(self, n_columns: int) -> Index | None:
        """Places ``(width, entries)`` of the entries in a matrix with ``width`` rows a loop; None where they fill one loop in order."""
        if len(self.first) == 2 and np.array_equal(self.column, np.arange(n_columns)):
            return None
        return (self.width * self.loop + np.arange(self.width)[:, None]) * n_columns + self.column


def entries_of(graph: LinkGraph, first_column: Index) -> Entries:
    """All (loop, column) places of the closure Jacobian of a graph whose pairs have their freedoms from ``first_column`` on."""
    loop, pair, sign = graph.loop_steps
    width = np.diff(first_column)[pair]
    step = np.repeat(np.arange(len(loop)), width)
    within = np.arange(len(step)) - np.repeat(np.cumsum(width) - width, width)
    first = np.searchsorted(loop[step], np.arange(graph.n_loops + 1))
    return Entries(loop[step], first_column[pair[step]] + within, sign[step], first.astype(np.intp), graph.width)


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
