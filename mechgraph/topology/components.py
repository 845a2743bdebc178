"""Connected components and parts cut off, all by scipy.sparse.csgraph; nodes are numbers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

Index = NDArray[np.intp]


def components_of_edges(count: int, ends: Sequence[tuple[int, int]] | NDArray[np.intp]) -> Index:
    """For each of ``count`` nodes the number of its component, counted from the first node on."""
    a, b = np.asarray(ends, dtype=np.intp).reshape(-1, 2).T
    graph = scipy.sparse.csr_array((np.ones(len(a)), (a, b)), shape=(count, count))
    return component_numbers(scipy.sparse.csgraph.connected_components(graph, directed=False)[1])


def labels_of_bipartite(touch: scipy.sparse.csr_array | scipy.sparse.coo_array) -> Index:
    """For every row of ``touch`` the number of its component: rows that share a column belong together."""
    coo = touch.tocoo()
    rows, columns = (int(n) for n in touch.shape)
    ends = np.stack([coo.row, rows + coo.col], axis=1).astype(np.intp)
    return component_numbers(components_of_edges(rows + columns, ends)[:rows])


def component_numbers(labels: NDArray[np.signedinteger]) -> Index:
    """Labels renumbered in the order in which they appear."""
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    number = np.empty(len(first), dtype=np.intp)
    number[np.argsort(first)] = np.arange(len(first))
    return number[inverse]


def members(numbers: Index) -> list[list[int]]:
    """The nodes of every component."""
    if not len(numbers):
        return []
    order = np.argsort(numbers, kind="stable")
    return [part.tolist() for part in np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1)]


def cut_off(count: int, ends: Sequence[tuple[int, int]], frame: int, cut: Iterable[int]) -> tuple[int, ...]:
    """Nodes that lose the ``frame`` when the edges ``cut`` are taken away."""
    gone = set(cut)
    label = components_of_edges(count, [e for k, e in enumerate(ends) if k not in gone])
    return tuple(np.flatnonzero(label != label[frame]).tolist())


def reached(follows: scipy.sparse.csr_array, starts: Index) -> Index:
    """Nodes that can be reached from any of ``starts`` along the entries (from row to column) of ``follows``."""
    n = follows.shape[0]
    extra = scipy.sparse.coo_array((np.ones(len(starts)), (np.full(len(starts), n), starts)), shape=(n + 1, n + 1))
    whole = scipy.sparse.csr_array(extra + _padded(follows))
    order = scipy.sparse.csgraph.breadth_first_order(whole, n, return_predecessors=False)
    return np.sort(order[order < n]).astype(np.intp)


def _padded(matrix: scipy.sparse.csr_array) -> scipy.sparse.coo_array:
    coo = scipy.sparse.coo_array(matrix)
    n = coo.shape[0] + 1
    return scipy.sparse.coo_array((np.ones(coo.nnz), (coo.row, coo.col)), shape=(n, n))
