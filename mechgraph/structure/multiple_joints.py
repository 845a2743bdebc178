"""Multiple joints: turning pairs of several links on one axis, declared as pairs of two links each.

Pairs that turn about one line and hang together by common links make a joint of k links, of order k - 1; which of these links carries the
others is a matter of the declaration, not of the motion. Source: Marghitu, Fundamentals, section 2.1 and figure 2.10.
"""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.graph.atlas import MultipleJoint
from mechgraph.numerics.tolerances import RANKS
from mechgraph.structure.position import Position


def joints_at(position: Position) -> tuple[MultipleJoint, ...]:
    """The multiple joints of a mechanism at a closed position; two bearings of the same two links count as one."""
    import networkx as nx

    m, graph = position.m, position.graph
    turning = [
        k for k, p in enumerate(m.pairs) if p.type.f == 1 and p.type.freedoms[0].turns and not p.type.takes_pitch
    ]
    lines = {k: position.rows.S[:, position.columns(k)[0]] for k in turning}
    near: nx.Graph[int] = nx.Graph()
    for link in range(graph.n_links):
        mine = [k for k in turning if link in graph.ends[k]]
        near.add_edges_from((i, k) for j, k in enumerate(mine) for i in mine[:j] if _same_line(lines[i], lines[k]))
    out = []
    for some in sorted(map(sorted, nx.connected_components(near))):
        ends: dict[frozenset[int], int] = {}
        for k in some:
            ends.setdefault(frozenset(graph.ends[k]), k)
        links = sorted(set().union(*ends))
        if len(links) > 2 and len(ends) == len(links) - 1:
            names = m.link_names()
            out.append(MultipleJoint(tuple(names[i] for i in links), tuple(m.pairs[k].name for k in ends.values())))
    return tuple(out)


def _same_line(a: Array, b: Array) -> bool:
    """Whether two turns (w, v), |w| = 1, are about one line, in whatever sense."""
    sense = 1.0 if a[:3] @ b[:3] > 0 else -1.0
    return bool(np.abs(a - sense * b).max() < RANKS.position)
