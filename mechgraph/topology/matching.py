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
from mechgraph.topology.components import Index, reached
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
    supply = np.array([6 - p.type.f for p in m.pairs], dtype=np.intp)
    np.add.at(supply, [m.freedom(drive.freedom)[0] for drive in m.drives], 1)
    pair = np.repeat(np.arange(P), 2)
    link = np.stack([graph.a, graph.b], axis=1).ravel()
    moving = link != graph.frame
    pair, link = pair[moving], link[moving]
    links = np.delete(np.arange(N), graph.frame)
    source, sink = P + N, P + N + 1
    rows = np.concatenate([np.full(P, source), pair, P + links])
    columns = np.concatenate([np.arange(P), P + link, np.full(len(links), sink)])
    capacity = np.concatenate([supply, np.full(len(pair), 12), np.full(len(links), 6)]).astype(np.int32)
    network = scipy.sparse.csr_array((capacity, (rows, columns)), shape=(P + N + 2, P + N + 2))
    result = scipy.sparse.csgraph.maximum_flow(network, source, sink)
    flow = scipy.sparse.csr_array(result.flow)
    used, filled = flow[[source]].toarray()[0, :P], flow[:, [sink]].toarray()[P : P + N, 0]
    serves = np.asarray(flow[pair, P + link]).ravel() > 0
    everywhere, back = (pair, P + link), (P + link[serves], pair[serves])
    over = _reached(P + N, everywhere, back, np.flatnonzero(used < supply))
    under = _reached(P + N, everywhere[::-1], back[::-1], P + links[filled[links] < 6])
    names, pair_names = m.link_names(), [p.name for p in m.pairs]
    return Parts(
        structural_rank=int(result.flow_value),
        redundant_links=tuple(names[i - P] for i in over if i >= P),
        redundant_pairs=tuple(pair_names[k] for k in over if k < P),
        free_links=tuple(names[i - P] for i in under if i >= P),
        free_pairs=tuple(pair_names[k] for k in under if k < P),
        spare_unknowns=int((supply - used).sum()),
        spare_equations=int(6 * len(links) - filled.sum()),
    )


def _reached(count: int, out: tuple[Index, Index], back: tuple[Index, Index], starts: Index) -> list[int]:
    """Nodes on alternating paths from ``starts``: outwards along every edge, back along those that the matching uses."""
    rows, columns = (np.concatenate([a, b]) for a, b in zip(out, back, strict=True))
    return reached(scipy.sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(count, count)), starts).tolist()
