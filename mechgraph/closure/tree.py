"""Along the spanning tree: poses and sums from the frame outwards, loads from the leaves inwards, for every link at once.

``Tree`` goes from link to link; ``Walk`` goes through every factor of the pairs, along the tree and once across every chord.
A tree of few levels is run through level by level. In a deep one (a chain of many loops) every link reaches its ancestors by
pointer doubling: after step ``s`` it knows the way to its ancestor ``2^s`` levels down, so that the logarithm of the depth counts.
Source: Jaja, An Introduction to Parallel Algorithms, 1992, section 2.2 (pointer jumping).
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import SMALL_BATCH, Array, compose, multiplied
from mechgraph.graph.linkgraph import LinkGraph
from mechgraph.numerics.linear import Place, add_at, compact, scattered_sum

Index = NDArray[np.intp]
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
        self.widest = int(np.bincount(level).max(initial=0))

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
        if self.widest * T <= SMALL_BATCH:
            there, motion = X.transpose(2, 3, 0, 1), relative.transpose(2, 3, 0, 1)
            for parents, steps, nodes in self.levels[1:]:
                np.matmul(there[parents], motion[steps], out=there[nodes])
            return X
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
