"""Structure of the force equations without geometry: matching of unknowns to equations, Dulmage-Mendelsohn parts.

Links offer six equations each, pairs (6 - f) reaction unknowns and one a driver; an unknown can serve the equations of the two links
of its pair. What stays unmatched, and all that it can be exchanged with, is over- or underdetermined whatever the geometry.
Source: Dulmage and Mendelsohn, Coverings of bipartite graphs, Canadian Journal of Mathematics 10, 1958.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from mechgraph.model.mechanism import Mechanism
from mechgraph.topology.linkgraph import LinkGraph


@dataclass(frozen=True)
class Parts:
    """Dulmage-Mendelsohn parts of the force equations.

    Attributes
    ----------
    structural_rank : size of the largest matching of unknowns to equations.
    redundant_links, redundant_pairs : the part with more reaction unknowns than equations (reactions not unique).
    free_links, free_pairs : the part with more equations than unknowns (something can move undriven).
    spare_unknowns, spare_equations : how many are left over in these parts.
    """

    structural_rank: int
    redundant_links: tuple[str, ...]
    redundant_pairs: tuple[str, ...]
    free_links: tuple[str, ...]
    free_pairs: tuple[str, ...]
    spare_unknowns: int
    spare_equations: int


def parts_of(m: Mechanism, graph: LinkGraph) -> Parts:
    """Matching and parts from the graph and the freedoms of the pairs, by maximum flow from unknowns to equations."""
    P, N = len(m.pairs), graph.n_links
    supply = np.array([6 - p.type.f for p in m.pairs])
    for drive in m.drives:
        supply[m.freedom(drive.freedom)[0]] += 1
    source, sink = P + N, P + N + 1
    rows, cols, caps = [], [], []
    for k, ends in enumerate(graph.ends):
        rows.append(source)
        cols.append(k)
        caps.append(int(supply[k]))
        for link in ends:
            if link != graph.frame:
                rows.append(k)
                cols.append(P + link)
                caps.append(12)
    for link in range(N):
        if link != graph.frame:
            rows.append(P + link)
            cols.append(sink)
            caps.append(6)
    network = scipy.sparse.csr_array((np.array(caps, dtype=np.int32), (rows, cols)), shape=(P + N + 2, P + N + 2))
    result = scipy.sparse.csgraph.maximum_flow(network, source, sink)
    found = result.flow.tocoo()
    flow = {(int(i), int(j)): int(v) for i, j, v in zip(found.row, found.col, found.data, strict=True) if v > 0}
    used = np.array([flow.get((source, k), 0) for k in range(P)])
    filled = np.array([flow.get((P + i, sink), 0) for i in range(N)])
    near: list[list[int]] = [[link for link in ends if link != graph.frame] for ends in graph.ends]
    at_link: list[list[int]] = [[] for _ in range(N)]
    for k, links in enumerate(near):
        for link in links:
            at_link[link].append(k)
    spare_pairs = [k for k in range(P) if used[k] < supply[k]]
    spare_links = [i for i in range(N) if i != graph.frame and filled[i] < 6]
    pairs_r, links_r = set(spare_pairs), set[int]()
    front = list(spare_pairs)
    while front:
        k = front.pop()
        for link in near[k]:
            if link not in links_r:
                links_r.add(link)
                fresh = [j for j in at_link[link] if j not in pairs_r and (j, P + link) in flow]
                pairs_r.update(fresh)
                front += fresh
    links_f, pairs_f = set(spare_links), set[int]()
    front = list(spare_links)
    while front:
        link = front.pop()
        for k in at_link[link]:
            if k not in pairs_f:
                pairs_f.add(k)
                fresh = [j for j in near[k] if j not in links_f and (k, P + j) in flow]
                links_f.update(fresh)
                front += fresh
    names, pair_names = m.link_names(), tuple(p.name for p in m.pairs)
    return Parts(
        structural_rank=int(result.flow_value),
        redundant_links=tuple(names[i] for i in sorted(links_r)),
        redundant_pairs=tuple(pair_names[k] for k in sorted(pairs_r)),
        free_links=tuple(names[i] for i in sorted(links_f)),
        free_pairs=tuple(pair_names[k] for k in sorted(pairs_f)),
        spare_unknowns=int((supply - used).sum()),
        spare_equations=int(6 * (N - 1) - filled.sum()),
    )
