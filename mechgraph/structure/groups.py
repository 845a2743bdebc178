"""Structural groups (Assur groups): the smallest sets of links whose motion is known once that of the links before is.

With the drivers at rest nothing moves. A set of links is determined when it stands still by its own pairs and those to links that do so
already; the smallest such sets, one after the other, are the driver links and the groups in the order in which they can be solved.

Where the links have as many rows as motions, pattern alone decides: the strongly connected components of a matching of rows to links (the
fine decomposition of Dulmage and Mendelsohn, 1958), each checked by its rank. Where there are more rows (overconstrained spatial loops,
slides that only slide), or a rank is less, the ranks of smaller and smaller sets decide.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy

from mechgraph.structure.link_rows import Constraint, Constraints, LinkRows

MOST_SPLIT = 40
"""Links up to which sets are made smaller by their ranks: some seconds."""


@dataclass(frozen=True)
class LinkSet:
    """A group by numbers: its ``links``, the ``pairs`` among them and to links before, and the ``couplings`` with these."""

    links: tuple[int, ...]
    pairs: tuple[int, ...]
    couplings: tuple[int, ...] = ()


def link_sets(rows: LinkRows) -> tuple[list[LinkSet], list[int]]:
    """The groups in the order in which they can be solved, and the links that no driver determines."""
    frame = rows.position.graph.frame
    links = [i for i in range(rows.position.graph.n_links) if i != frame]
    fixed = rows.determined(links, (frame,))
    found = _by_pattern(rows, fixed) if fixed else []
    if found is None:
        found = list(_by_rank(rows, fixed))
    return _with_pairs(rows, found), sorted(set(links) - fixed)


def _with_pairs(rows: LinkRows, found: list[list[int]]) -> list[LinkSet]:
    """The sets with what constrains each."""
    solved = {rows.position.graph.frame}
    count = len(rows.position.graph.ends)
    out = []
    for mine in found:
        known = solved | set(mine)
        touching = [
            c.number
            for c in (*rows.pairs, *rows.couplings)
            if known.issuperset(c.rows) and not c.rows.keys().isdisjoint(mine)
        ]
        out.append(
            LinkSet(
                tuple(mine), tuple(k for k in touching if k < count), tuple(k - count for k in touching if k >= count)
            )
        )
        solved = known
    return out


# --- by the pattern of a square system -------------------------------------------------------------------------------------


def _by_pattern(rows: LinkRows, links: set[int]) -> list[list[int]] | None:
    """Strongly connected components, those that depend on nothing first; None where rows and motions are not as many, or a rank is less."""
    import networkx as nx

    known = links | {rows.position.graph.frame}
    constraints = [c for c in rows.constraints if known.issuperset(c.rows)]
    if sum(c.count for c in constraints) != rows.b * len(links):
        return None
    flow = _matched(constraints, rows.b, links)
    if flow is None:
        return None
    graph: nx.DiGraph[int] = nx.DiGraph()
    graph.add_nodes_from(sorted(links))
    for c, used in zip(constraints, flow, strict=True):
        graph.add_edges_from((other, link) for link in used for other in c.rows if other in links and other != link)
    whole = nx.condensation(graph)
    order = nx.lexicographical_topological_sort(whole, key=lambda n: min(whole.nodes[n]["members"]))
    found = [sorted(whole.nodes[n]["members"]) for n in order]
    solved = {rows.position.graph.frame}
    for mine in found:
        if rows.moving(mine, solved):
            return None
        solved |= set(mine)
    return found


def _matched(constraints: list[Constraint], b: int, links: set[int]) -> list[list[int]] | None:
    """For every constraint the links whose motions its rows are matched to, by maximum flow; None where not all can be."""
    place = {link: i for i, link in enumerate(sorted(links))}
    n, count = len(constraints), len(place)
    source, sink = n + count, n + count + 1
    edges = [(source, i, c.count) for i, c in enumerate(constraints)]
    edges += [(n + i, sink, b) for i in range(count)]
    edges += [(i, n + place[link], b) for i, c in enumerate(constraints) for link in c.rows if link in place]
    start, end, capacity = np.array(edges, dtype=np.int32).T
    network = scipy.sparse.csr_array((capacity, (start, end)), shape=(sink + 1, sink + 1))
    result = scipy.sparse.csgraph.maximum_flow(network, source, sink)
    if result.flow_value != b * count:
        return None
    flow = scipy.sparse.csr_array(result.flow)
    back = sorted(place, key=place.__getitem__)
    out = []
    for i in range(n):
        row = flow[[i]].tocoo()
        out.append(
            [
                back[j - n]
                for j, value in zip(row.col.tolist(), row.data.tolist(), strict=True)
                if value > 0 and n <= j < n + count
            ]
        )
    return out


# --- by ranks ------------------------------------------------------------------------------------------------------------


def _by_rank(rows: LinkRows, links: set[int]) -> Iterator[list[int]]:
    """The smallest determined sets, one after the other."""
    solved, left = {rows.position.graph.frame}, set(links)
    while left:
        mine = smallest(rows, left, solved) if len(left) <= MOST_SPLIT else left
        yield sorted(mine)
        solved |= mine
        left -= mine


def smallest(rows: Constraints, links: set[int], solved: set[int]) -> set[int]:
    """A determined set none of whose parts is: links are taken away, the last ones first, as long as something stays determined."""
    mine, kept = set(links), set[int]()
    while mine - kept:
        link = max(mine - kept)
        rest = rows.determined(mine - {link}, solved)
        if rest:
            mine = rest
        else:
            kept.add(link)
    return mine
