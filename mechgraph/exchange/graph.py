"""The graph of a mechanism for programs that know graphs: GraphML and node-link JSON, by networkx's own writers.

Nodes are links and edges are pairs, with their names as keys; attributes are texts, numbers and truth values alone. ``loops`` of an edge
are the numbers of the loops that run through it (see ``DeterminacyReport.loops``), with the sign in which they do.
"""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING, Any

from mechgraph.errors import visible
from mechgraph.files import write_whole
from mechgraph.graph.linkgraph import link_graph
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair

if TYPE_CHECKING:
    import networkx as nx

Path = str | os.PathLike[str]


def save_graphml(m: Mechanism, path: Path) -> None:
    """Write the graph as GraphML; ``networkx.read_graphml(path, force_multigraph=True)`` reads it."""
    import networkx as nx

    write_whole(path, (f"{line}\n" for line in nx.generate_graphml(graph_of(m))))


def save_node_link(m: Mechanism, path: Path) -> None:
    """Write the graph as node-link JSON; ``networkx.node_link_graph(data, edges="edges")`` reads it."""
    import networkx as nx

    data = nx.node_link_data(graph_of(m), edges="edges")
    write_whole(path, [json.dumps(data, indent=1, ensure_ascii=False), "\n"])


def graph_of(m: Mechanism) -> nx.MultiGraph[str]:
    """The graph with plain attributes; several pairs may join the same two links."""
    import networkx as nx

    graph: nx.MultiGraph[str] = nx.MultiGraph()
    couplings = "; ".join(" + ".join(f"{c:g} {q}" for q, c in one.terms) for one in m.couplings)
    facts = {"name": m.name, "description": m.description, "couplings": couplings}
    facts |= {f"unit_of_{base}": unit for base, unit in m.units.items()}
    graph.graph.update({key: visible(text) for key, text in facts.items()})
    for link in m.links:
        graph.add_node(visible(link.name), mass=link.mass, frame=link.name == m.frame, **_vector("center", link.center))
    through: list[list[str]] = [[] for _ in m.pairs]
    for number, loop in enumerate(link_graph(m).loops, 1):
        for pair, sign in loop:
            through[pair].append(f"{sign * number:+d}")
    driven = {m.full_name(d.freedom) for d in m.drives}
    for one, loops in zip(m.pairs, through, strict=True):
        graph.add_edge(
            visible(one.a), visible(one.b), key=visible(one.name), **_facts(one, driven), loops=" ".join(loops)
        )
    return graph


def _facts(pair: Pair, driven: set[str]) -> dict[str, Any]:
    """What an edge says of a pair; ``a`` and ``b`` say which link acts on which, as an edge has no direction."""
    names = [freedom.name for freedom in pair.type.freedoms]
    drives = [name for name, full in zip(names, pair.freedom_names, strict=True) if full in driven]
    out = {"a": visible(pair.a), "b": visible(pair.b), "type": pair.type.symbol, "type_name": pair.type.name}
    out |= {"freedoms": " ".join(names), "driven": " ".join(drives)}
    return {**out, **_vector("point", pair.point), **_vector("axis", pair.axis)}


def _vector(name: str, values: Any) -> dict[str, float]:
    """Three numbers under a name each; nothing where there are none."""
    return {} if values is None else {f"{name}_{letter}": float(v) for letter, v in zip("xyz", values, strict=True)}
