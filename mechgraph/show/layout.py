"""Where the nodes of a graph are drawn. Loaded only when one is drawn, as networkx takes its time."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations
from typing import Any

import networkx as nx
import numpy as np

from mechgraph.algebra.se3 import Array

LARGE = 40
"""Nodes from which on one layout is taken, unseen; from four times as many on that of springs, which is faster."""
CLEAR = 0.15
"""Distance of a line from a node that is not its end, over that of neighbours, below which they clash."""


def places(names: Iterable[str], edges: Iterable[tuple[str, str]]) -> dict[str, Array]:
    """Where the nodes of a graph are drawn, neighbours at a distance of about one; the same each time."""
    number = {name: i for i, name in enumerate(names)}
    graph: nx.Graph[int] = nx.Graph()  # of numbers: sets of texts have another order each time
    graph.add_nodes_from(number.values())
    graph.add_edges_from((number[a], number[b]) for a, b in edges)
    begin: dict[int, Any]
    if len(graph) < 3:
        begin = {name: (float(i), 0.0) for i, name in enumerate(graph)}
    elif max(degree for _, degree in graph.degree) == 2:
        turn = 2 * np.pi * np.arange(len(graph)) / len(graph)
        begin = {name: (np.cos(a), np.sin(a)) for name, a in zip(_cycle_order(graph), turn, strict=True)}
    else:
        begin = _clearest(graph)
    at = _scaled(graph, begin)
    return {name: at[i] for name, i in number.items()}


def _clearest(graph: nx.Graph[int]) -> dict[int, Any]:
    """Of several layouts that give distances their due, the one in which the fewest lines cross each other or run over nodes."""
    if len(graph) > LARGE:
        return nx.kamada_kawai_layout(graph) if len(graph) < 4 * LARGE else nx.spring_layout(graph, seed=0)
    first = [nx.planar_layout(graph)] if nx.is_planar(graph) else []
    first += [nx.circular_layout(graph), *(nx.spring_layout(graph, seed=seed) for seed in range(3))]
    found = [_scaled(graph, nx.kamada_kawai_layout(graph, pos=pos)) for pos in first]
    return min(found, key=lambda at: _clashes(graph, at))


def _clashes(graph: nx.Graph[int], at: dict[int, Array]) -> int:
    """Pairs of lines that cross, and lines that nearly run over a node that is not their end."""
    count = 0
    for (a, b), (c, d) in combinations(graph.edges, 2):
        if len({a, b, c, d}) == 4:
            p, q, r, s = at[a], at[b], at[c], at[d]
            count += _side(p, q, r) != _side(p, q, s) and _side(r, s, p) != _side(r, s, q)
    for a, b in graph.edges:
        for name in graph:
            if name not in (a, b):
                along = at[b] - at[a]
                u = np.clip((at[name] - at[a]) @ along / (along @ along), 0.0, 1.0)
                count += bool(np.linalg.norm(at[a] + u * along - at[name]) < CLEAR)
    return count


def _side(p: Array, q: Array, r: Array) -> bool:
    return bool((q[0] - p[0]) * (r[1] - p[1]) > (q[1] - p[1]) * (r[0] - p[0]))


def _scaled(graph: nx.Graph[int], begin: dict[int, Any]) -> dict[int, Array]:
    at = {name: np.asarray(begin[name], dtype=float) for name in graph}
    lengths = [float(np.linalg.norm(at[a] - at[b])) for a, b in graph.edges]
    unit = float(np.median(lengths)) if lengths else 1.0
    return {name: p / unit for name, p in at.items()}


def _cycle_order(graph: nx.Graph[int]) -> list[int]:
    """Nodes of a cycle or path, one after the other."""
    ends = [name for name, degree in graph.degree if degree < 2]
    return list(nx.dfs_preorder_nodes(graph, source=(ends or list(graph))[0]))
