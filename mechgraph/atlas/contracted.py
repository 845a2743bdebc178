"""Contracted graphs: what is left of a chain when its binary links and their joints are taken as one edge between other links.

All connected graphs with a number of loops whose nodes have three or more edges, each once: the cubic ones grow loop by loop, the others
come of them by contracting edges. The two-connected ones have no node whose loss would part the chain.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from mechgraph.atlas.canonical import Order, least_orders, symmetries

Edges = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Contracted:
    """A graph on ``nodes`` by its ``edges`` (u <= v), sorted; u = v is a loop."""

    nodes: int
    edges: Edges

    @cached_property
    def counts(self) -> list[list[int]]:
        """How many edges join two nodes."""
        counts = [[0] * self.nodes for _ in range(self.nodes)]
        for u, v in self.edges:
            counts[u][v] += 1
            counts[v][u] += u != v
        return counts

    @cached_property
    def canonical(self) -> tuple[Order, list[Order]]:
        """The least matrix of counts with the orders of nodes that give it."""
        return least_orders(self.counts)

    @property
    def symmetries(self) -> list[Order]:
        """Permutations of the nodes that leave the graph as it is."""
        return symmetries(self.canonical[1])

    @cached_property
    def classes(self) -> dict[tuple[int, int], list[int]]:
        """Edges between the same two nodes."""
        out: dict[tuple[int, int], list[int]] = {}
        for e, ends in enumerate(self.edges):
            out.setdefault(ends, []).append(e)
        return out

    @property
    def in_one_block(self) -> bool:
        """Whether no node parts it when it is lost, and no edge is a loop (but for a single loop alone)."""
        import networkx as nx

        if len(self.edges) == 1:
            return True
        if any(u == v for u, v in self.edges):
            return False
        return (self.nodes == 2 and len(self.edges) > 1) or nx.is_biconnected(nx.Graph(self.edges))

    @cached_property
    def rings(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """All sets of edges that hang together, also when any edge is lost: ``(n, edges)``, their loops ``(n,)``, nodes ``(n, nodes)``.

        Labels of all sets of the first e edges give those with one edge more: it joins two labels, or closes a loop.
        """
        labels = np.arange(self.nodes, dtype=np.int8)[None]
        loops = np.zeros(1, dtype=np.int8)
        touched = np.zeros((1, self.nodes), dtype=bool)
        for u, v in self.edges:
            one, other = labels[:, u, None], labels[:, v, None]
            loops = np.concatenate([loops, loops + (one == other)[:, 0]])
            labels = np.concatenate([labels, np.where(labels == other, one, labels)])
            more = touched.copy()
            more[:, [u, v]] = True
            touched = np.concatenate([touched, more])
        E = len(self.edges)
        number = np.arange(1 << E)
        has = (number[:, None] >> np.arange(E)) & 1 == 1
        kept = (loops > 0) & (has.sum(axis=1) - touched.sum(axis=1) + 1 == loops)
        for e in range(E):
            kept &= ~has[:, e] | (loops[number ^ (1 << e)] < loops)
        return has[kept].astype(float), loops[kept].astype(float), touched[kept].astype(float)


def made(edges: list[tuple[int, int]]) -> Contracted:
    """The graph with its nodes in canonical order."""
    nodes = 1 + max(max(e) for e in edges)
    order = Contracted(nodes, tuple(sorted((min(e), max(e)) for e in edges))).canonical[1][0]
    place = {v: i for i, v in enumerate(order)}
    return Contracted(nodes, tuple(sorted((min(place[u], place[v]), max(place[u], place[v])) for u, v in edges)))


def contracted_graphs(loops: int, one_block: bool = True) -> Iterator[Contracted]:
    """All of them, those with most nodes first; of one loop the ring alone, with any of its links as node."""
    if loops == 1:
        yield Contracted(1, ((0, 0),))
        return
    level = _cubic(loops, one_block)
    while level:
        yield from level
        level = _once(_contractions(level, one_block))


def _once(graphs: Iterator[Contracted]) -> list[Contracted]:
    return sorted(set(graphs), key=lambda g: g.edges)


def _cubic(loops: int, one_block: bool) -> list[Contracted]:
    """Graphs all of whose nodes have three edges."""
    level = [made([(0, 1)] * 3)] + ([] if one_block else [made([(0, 0), (0, 1), (1, 1)])])
    for _ in range(loops - 2):
        level = _once(new for g in level for new in _with_a_loop(g, one_block))
    return level


def _with_a_loop(g: Contracted, one_block: bool) -> Iterator[Contracted]:
    """Two edges, or one twice, joined by a new one; else a loop that hangs at an edge."""
    a, b = g.nodes, g.nodes + 1
    for i, j in combinations_with_replacement(range(len(g.edges)), 2):
        rest = [e for k, e in enumerate(g.edges) if k not in (i, j)]
        (u, v), (w, x) = g.edges[i], g.edges[j]
        if i == j:
            yield made([*rest, (u, a), (a, b), (a, b), (b, v)])
            if not one_block:
                yield made([*rest, (u, a), (a, v), (a, b), (b, b)])
        else:
            yield made([*rest, (u, a), (a, v), (w, b), (b, x), (a, b)])


def _contractions(level: list[Contracted], one_block: bool) -> Iterator[Contracted]:
    """Graphs with one edge contracted. In one block only edges without a parallel one: those would become loops.

    Every graph in one block with a node of four or more edges comes so of one in one block: split that node in any way.
    """
    for g in level:
        for (u, v), members in g.classes.items():
            if u == v or (one_block and len(members) > 1):
                continue
            place = [w - (w > v) if w != v else u for w in range(g.nodes)]
            edges = list(g.edges)
            edges.remove((u, v))
            new = made([(place[a], place[b]) for a, b in edges])
            if not one_block or new.in_one_block:
                yield new
