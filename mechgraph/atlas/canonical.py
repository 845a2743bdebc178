"""The canonical form of a small graph whose nodes and edges carry labels, and its symmetries.

A graph is a square matrix of whole numbers: those of the nodes on the diagonal, elsewhere what leads from row to column. Nodes are told
apart by what they see of others until nothing changes; where some look alike, each of them is singled out in turn. The least matrix of
all orders found so is the canonical one, and the orders that give it differ by the symmetries of the graph.
Source: McKay, Practical graph isomorphism, Congressus Numerantium 30, 1981 (without the pruning by symmetries found on the way: chains
are contracted to few nodes first).
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from typing import Any

Order = tuple[int, ...]
Matrix = Sequence[Sequence[int]]


def ranked(labels: Sequence[Sequence[Hashable]]) -> tuple[list[list[int]], tuple[Any, ...]]:
    """Labels by their places among all different ones, and these in order."""
    different: Any = sorted({label for row in labels for label in row}, key=_sortable)
    place = {label: i for i, label in enumerate(different)}
    return [[place[label] for label in row] for row in labels], tuple(different)


def _sortable(label: Hashable) -> tuple[int, str]:
    text = repr(label)
    return len(text), text


def least_orders(matrix: Matrix) -> tuple[Order, list[Order]]:
    """The least matrix, row by row, of all orders of nodes that the refinement leaves, and the orders that give it."""
    n = len(matrix)
    best: Order | None = None
    orders: list[Order] = []
    waiting = [_refined(matrix, [matrix[v][v] for v in range(n)])]
    while waiting:
        colours = waiting.pop()
        shared = [c for c in set(colours) if colours.count(c) > 1]
        if shared:
            first = min(shared)
            for v in (v for v in range(n) if colours[v] == first):
                waiting.append(_refined(matrix, [2 * c + (u != v) for u, c in enumerate(colours)]))
            continue
        order = tuple(sorted(range(n), key=colours.__getitem__))
        code = tuple(matrix[u][v] for u in order for v in order)
        if best is None or code < best:
            best, orders = code, []
        if code == best:
            orders.append(order)
    return best or (), orders


def _refined(matrix: Matrix, colours: Iterable[int]) -> list[int]:
    """Colours 0, 1, ... of the nodes, refined until nodes of one colour see the same labels on the way to the same colours."""
    mine = _numbered(list(colours))
    while True:
        seen = [
            (mine[v], tuple(sorted((mine[u], row[u]) for u in range(len(row)) if u != v)))
            for v, row in enumerate(matrix)
        ]
        finer = _numbered(seen)
        if max(finer, default=0) == max(mine, default=0):
            return mine
        mine = finer


def _numbered(values: Sequence[Any]) -> list[int]:
    place = {value: i for i, value in enumerate(sorted(set(values)))}
    return [place[value] for value in values]


def symmetries(orders: Sequence[Order]) -> list[Order]:
    """Permutations ``p`` (node v goes to p[v]) that leave a graph as it is, by the orders that give its least matrix."""
    first = orders[0]
    out = []
    for order in orders:
        image = [0] * len(first)
        for a, b in zip(first, order, strict=True):
            image[a] = b
        out.append(tuple(image))
    return out
