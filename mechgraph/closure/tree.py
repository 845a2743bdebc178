"""Along the spanning tree: poses and sums from the frame outwards, loads from the leaves inwards, for every link at once.

A tree of few levels is run through level by level. In a deep one (a chain of many loops) every link reaches its ancestors by
pointer doubling: after step ``s`` it knows the way to its ancestor ``2^s`` levels down, so that the logarithm of the depth counts.
Source: Jaja, An Introduction to Parallel Algorithms, 1992, section 2.2 (pointer jumping).
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array, compose, identity, inverse
from mechgraph.numerics.linear import Place, add_at, compact, scattered_sum
from mechgraph.topology.linkgraph import LinkGraph

Index = NDArray[np.intp]
Level = tuple[Index, NDArray[np.bool_], Index, Index]

Step = tuple[Place, NDArray[np.bool_] | None, Place, Place]

DEEP = 200
"""Levels above which the tree is run through by pointer doubling."""


class Tree:
    """The spanning tree of a graph as arrays; level ``(pairs, forward, parents, children)``, ``forward`` from a to b."""

    def __init__(self, graph: LinkGraph) -> None:
        self.n_links, self.frame = graph.n_links, graph.frame
        steps = np.array(graph.tree, dtype=np.intp).reshape(len(graph.tree), 4)
        self.pairs, self.parents, self.children = steps[:, 0], steps[:, 2], steps[:, 3]
        self.forward = steps[:, 1] > 0
        depth = np.zeros(self.n_links, dtype=np.intp)
        for parent, child in zip(self.parents.tolist(), self.children.tolist(), strict=True):
            depth[child] = depth[parent] + 1
        ends = np.searchsorted(depth[self.children], np.arange(1, depth.max(initial=0) + 2))
        spans = [slice(int(i), int(j)) for i, j in pairwise(ends)]
        parts = (self.pairs, self.forward, self.parents, self.children)
        self.levels: list[Level] = [tuple(part[span] for part in parts) for span in spans]  # type: ignore[misc]
        self.deep = len(self.levels) > DEEP

    @cached_property
    def _walk(self) -> list[Step]:
        """The levels with indices that take no copy where they can; ``forward`` is None where all lead outwards."""
        return [
            (compact(pairs), None if forward.all() else forward, compact(parents), compact(children))
            for pairs, forward, parents, children in self.levels
        ]

    @cached_property
    def _back(self) -> Place | None:
        """Pairs of the tree that lead inwards, from b to a; None where there are none."""
        back = np.sort(self.pairs[~self.forward])
        return compact(back) if back.size else None

    @property
    def _whole(self) -> Step:
        """All pairs of the tree in one step."""
        return self.pairs, self.forward, self.parents, self.children

    @cached_property
    def _jumps(self) -> list[Index]:
        """Ancestor of every link after 1, 2, 4, ... levels; the frame stands for all that lie beyond."""
        ancestor = np.full(self.n_links, self.frame, dtype=np.intp)
        ancestor[self.children] = self.parents
        out = []
        while (ancestor != self.frame).any():
            out.append(ancestor)
            ancestor = ancestor[ancestor]
        return out

    def poses(self, relative: Array, frame: Array) -> Array:
        """Poses ``(3, 4, N, T)`` of all links from those of b seen from a, ``relative (3, 4, P, T)``, which is used up."""
        if not self.deep:
            return self._poses_by_levels(relative, frame)
        X = identity(self.n_links, relative.shape[3])
        X[:, :, self.children] = relative[:, :, self.pairs]
        back = self.children[~self.forward]
        X[:, :, back] = inverse(X[:, :, back])
        for ancestor in self._jumps:
            X = compose(X[:, :, ancestor], X)
        return compose(np.broadcast_to(frame[:, :, None], X.shape), X)

    def _poses_by_levels(self, relative: Array, frame: Array) -> Array:
        X = np.empty((3, 4, self.n_links, relative.shape[3]))
        X[:, :, self.frame] = frame
        if self._back is not None:
            relative[:, :, self._back] = inverse(relative[:, :, self._back])
        for pairs, _, parents, children in self._walk:
            X[:, :, children] = compose(X[:, :, parents], relative[:, :, pairs])
        return X

    def sums(self, relative: Array) -> Array:
        """Sums ``(6, N, T)`` of pair terms ``(6, P, T)`` from the frame to every link, with the sense of the way."""
        out = np.zeros((6, self.n_links, relative.shape[2]))
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
        out = np.zeros((6, n_pairs, loads.shape[2]))
        carried = self.carried(loads)
        for pairs, forward, _, children in [self._whole] if self.deep else self._walk:
            step = carried[:, children]
            out[:, pairs] = -step if forward is None else np.where(forward[:, None], -1.0, 1.0) * step
        return out
