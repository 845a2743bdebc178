"""The canonical form of a small graph whose nodes and edges carry labels, and its symmetries.

A graph is a square matrix of whole numbers: those of the nodes on the diagonal, elsewhere what leads from row to column. Nodes are told
apart by what they see of others until nothing changes; where some look alike, each of them is singled out in turn. The least matrix of
all orders found so is the canonical one, and the orders that give it differ by the symmetries of the graph.
Source: McKay, Practical graph isomorphism, Congressus Numerantium 30, 1981 (without the pruning by symmetries found on the way: chains
are contracted to few nodes first).
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Sequence
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
        if choices := _singled_out(matrix, colours):
            waiting += choices
            continue
        order = tuple(sorted(range(n), key=colours.__getitem__))
        code = tuple(matrix[u][v] for u in order for v in order)
        if best is None or code < best:
            best, orders = code, []
        if code == best:
            orders.append(order)
    return best or (), orders


def least_order(matrix: Matrix) -> Order:
    """An order of nodes that gives the least matrix, row by row, of those that the refinement leaves.

    Of nodes that look alike one is left out where a symmetry takes another one to it, as two orders that give the same matrix tell.
    """
    n = len(matrix)

    def code(order: Order) -> list[int]:
        return [matrix[u][v] for u in order for v in order]

    def any_order(colours: list[int]) -> Order:
        while choices := _singled_out(matrix, colours):
            colours = next(choices)
        return tuple(sorted(range(n), key=colours.__getitem__))

    def least(colours: list[int]) -> Order:
        known: list[list[int]] = []
        found: list[Order] = []
        for finer in _singled_out(matrix, colours) or ():
            if (seen := code(any_order(finer))) not in known:
                known.append(seen)
                found.append(least(finer))
        return min(found, key=code, default=any_order(colours))

    return least(_refined(matrix, [matrix[v][v] for v in range(n)]))


def _singled_out(matrix: Matrix, colours: list[int]) -> Iterator[list[int]] | None:
    """The colours when one of the first nodes that look alike is told from the others, each in turn; None where all are told apart."""
    shared = [c for c in set(colours) if colours.count(c) > 1]
    if not shared:
        return None
    alike = [v for v, c in enumerate(colours) if c == min(shared)]
    return (_refined(matrix, [2 * c + (u != v) for u, c in enumerate(colours)]) for v in alike)


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
