"""The link graph: incidence matrix, spanning tree and a short cycle basis, in an order fixed by the declaration."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.model.mechanism import Mechanism

if TYPE_CHECKING:
    import networkx as nx

Loop = tuple[tuple[int, int], ...]
"""A loop as (pair index, sign) in the order in which it is run through."""


@dataclass(frozen=True)
class LinkGraph:
    """The graph of a mechanism: links are nodes, pairs are edges; several pairs may join the same two links.

    Attributes
    ----------
    ends : (a, b) link indices of every pair.
    frame : index of the frame link.
    tree : (pair, sign, parent, child) of the spanning tree, breadth first from the frame; sign +1 where the pair leads
        from parent to child.
    chords : the pairs outside the tree, one a loop.
    loops : a short cycle basis.
    """

    n_links: int
    ends: tuple[tuple[int, int], ...]
    frame: int
    tree: tuple[tuple[int, int, int, int], ...]
    chords: tuple[int, ...]
    loops: tuple[Loop, ...]

    @property
    def incidence(self) -> NDArray[np.float64]:
        """Incidence matrix, moving links x pairs: +1 where the pair acts on the link as its second, -1 as its first."""
        A = np.zeros((self.n_links, len(self.ends)))
        for k, (a, b) in enumerate(self.ends):
            A[b, k] += 1.0
            A[a, k] -= 1.0
        return np.delete(A, self.frame, axis=0)

    @cached_property
    def loop_steps(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
        """All steps of all loops, one after the other: loop, pair and sign of each."""
        loop = np.repeat(np.arange(len(self.loops)), [len(steps) for steps in self.loops])
        flat = np.array([step for steps in self.loops for step in steps], dtype=np.intp).reshape(len(loop), 2)
        return loop.astype(np.intp), flat[:, 0], flat[:, 1].astype(float)

    @cached_property
    def sparse_loop_matrix(self) -> scipy.sparse.csr_array:
        """The loop matrix, loops x pairs, stored sparsely."""
        loop, pair, sign = self.loop_steps
        return scipy.sparse.csr_array((sign, (loop, pair)), shape=(len(self.loops), len(self.ends)))

    @property
    def loop_matrix(self) -> NDArray[np.float64]:
        """Loop matrix, loops x pairs: sign with which a loop runs through a pair, 0 elsewhere. A C^T = 0."""
        C = np.zeros((len(self.loops), len(self.ends)))
        for row, loop in zip(C, self.loops, strict=True):
            for k, sign in loop:
                row[k] = sign
        return C


def network(m: Mechanism) -> nx.MultiGraph[str]:
    """The mechanism as a networkx multigraph; edge keys are pair names, nodes and edges carry ``link`` and ``pair``."""
    import networkx as nx

    graph: nx.MultiGraph[str] = nx.MultiGraph(name=m.name)
    for link in m.links:
        graph.add_node(link.name, link=link)
    for pair in m.pairs:
        graph.add_edge(pair.a, pair.b, key=pair.name, pair=pair)
    return graph


def link_graph(m: Mechanism) -> LinkGraph:
    """Tree, chords and loops of a mechanism."""
    index = m.link_index
    ends = tuple([(index[p.a], index[p.b]) for p in m.pairs])
    return graph_of_ends(len(m.links), ends, index[m.frame])


def graph_of_ends(n_links: int, ends: tuple[tuple[int, int], ...], frame: int) -> LinkGraph:
    """Tree, chords and loops of a connected graph given by the ends of its edges."""
    edges_at: list[list[tuple[int, int, int]]] = [[] for _ in range(n_links)]
    for k, (a, b) in enumerate(ends):
        edges_at[a].append((k, 1, b))
        edges_at[b].append((k, -1, a))
    tree: list[tuple[int, int, int, int]] = []
    depth = {frame: 0}
    queue = deque([frame])
    while queue:
        parent = queue.popleft()
        for k, sign, child in edges_at[parent]:
            if child not in depth:
                depth[child] = depth[parent] + 1
                tree.append((k, sign, parent, child))
                queue.append(child)
    in_tree = {k for k, *_ in tree}
    chords = tuple(k for k in range(len(ends)) if k not in in_tree)
    return LinkGraph(n_links, ends, frame, tuple(tree), chords, _short_loops(n_links, ends, tree, chords, depth))


def _short_loops(
    n_links: int,
    ends: tuple[tuple[int, int], ...],
    tree: list[tuple[int, int, int, int]],
    chords: tuple[int, ...],
    depth: dict[int, int],
) -> tuple[Loop, ...]:
    """One loop a chord: the chord and a shortest path in the tree with the chords before it.

    Chords come by the depth of their ends, so that the cells of a lattice close one after the other and stay small.
    Every loop has a chord that no earlier loop has, so they are independent.
    """
    present: list[list[tuple[int, int, int]]] = [[] for _ in range(n_links)]

    def add(k: int) -> None:
        a, b = ends[k]
        present[a].append((k, 1, b))
        present[b].append((k, -1, a))

    for k, *_ in tree:
        add(k)
    loops = []
    for chord in sorted(chords, key=lambda k: (sum(depth[e] for e in ends[k]), k)):
        a, b = ends[chord]
        loops.append(_oriented([(chord, 1), *_shortest_path(present, b, a)], ends))
        add(chord)
    return tuple(sorted(loops, key=lambda loop: (loop[0][0], len(loop), loop)))


def _shortest_path(present: list[list[tuple[int, int, int]]], start: int, goal: int) -> list[tuple[int, int]]:
    """Edges (pair, sign) of a shortest path, searched from both ends; ties go to the earlier declaration."""
    back: tuple[dict[int, tuple[int, int, int] | None], ...] = ({start: None}, {goal: None})
    fronts = [[start], [goal]]
    meet = start if start == goal else None
    while meet is None:
        side = 0 if len(fronts[0]) <= len(fronts[1]) else 1
        following: list[int] = []
        for node in fronts[side]:
            for k, sign, other in present[node]:
                if other not in back[side]:
                    back[side][other] = (k, sign, node)
                    following.append(other)
                    if other in back[1 - side] and meet is None:
                        meet = other
        fronts[side] = following
    path: list[tuple[int, int]] = []
    node = meet
    while (step := back[0][node]) is not None:
        path.append((step[0], step[1]))
        node = step[2]
    path.reverse()
    node = meet
    while (step := back[1][node]) is not None:
        path.append((step[0], -step[1]))
        node = step[2]
    return path


def _oriented(loop: list[tuple[int, int]], ends: tuple[tuple[int, int], ...]) -> Loop:
    """The loop begun at its first declared pair, run through from that pair's a to its b."""
    at = min(range(len(loop)), key=lambda i: loop[i][0])
    turned = loop[at:] + loop[:at]
    if turned[0][1] < 0:
        turned = [(k, -sign) for k, sign in [turned[0], *reversed(turned[1:])]]
    return tuple(turned)
