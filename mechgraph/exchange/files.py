"""Files of other programs by their ending, and graphs for other programs.

The graph of a mechanism for programs that know graphs: GraphML and node-link JSON, by networkx's own writers.

Nodes are links and edges are pairs, with their names as keys; attributes are texts, numbers and truth values alone. ``loops`` of an edge
are the numbers of the loops that run through it (see ``DeterminacyReport.loops``), with the sign in which they do.
"""

from __future__ import annotations

import json
import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mechgraph.errors import ContentError, DeclarationError, MechgraphWarning, visible
from mechgraph.files import Format, format_of, write_whole
from mechgraph.graph.linkgraph import link_graph
from mechgraph.model import toml
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.quantities import door

if TYPE_CHECKING:
    import networkx as nx


def save_graphml(m: Mechanism, path: str | os.PathLike[str]) -> None:
    """Write the graph as GraphML; ``networkx.read_graphml(path, force_multigraph=True)`` reads it."""
    import networkx as nx

    write_whole(path, (f"{line}\n" for line in nx.generate_graphml(graph_of(m))))


def save_node_link(m: Mechanism, path: str | os.PathLike[str]) -> None:
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
        key, facts = visible(one.name), _facts(one, driven)
        graph.add_edge(visible(one.a), visible(one.b), key=key, **facts, loops=" ".join(loops))
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


READERS = (".asmt", ".xml", ".mjcf", ".urdf")
"""Suffixes of files of other programs; these are rare: what reads and writes them is loaded where it is asked for."""


def _read(path: Path) -> tuple[Mechanism, tuple[str, ...]]:
    """The mechanism of such a file, and what was taken otherwise than it stands there."""
    match path.suffix.lower():
        case ".asmt":
            from mechgraph.exchange.asmt import assembly_of
            from mechgraph.exchange.asmt_mechanism import mechanism_of

            return mechanism_of(assembly_of(path))
        case ".urdf":
            from mechgraph.exchange.urdf import read_urdf

            return read_urdf(path)
    from mechgraph.exchange.mjcf import read_mjcf

    return read_mjcf(path)


def _to_mjcf(m: Mechanism, path: str | os.PathLike[str]) -> None:
    from mechgraph.exchange.mjcf import save_mjcf

    save_mjcf(m, path)


@door
def load(name: str | os.PathLike[str]) -> Mechanism:
    """Read a mechanism from the library (by name), a TOML file, or a file of another program.

    The extension selects the format: ``.asmt`` (FreeCAD assembly), ``.xml`` and ``.mjcf`` (MuJoCo), ``.urdf``; other files are TOML.

    Parameters
    ----------
    name : str or path
        Name in the library, or path of a file.

    Returns
    -------
    Mechanism

    Raises
    ------
    FileError
        The file cannot be read or has the wrong format.
    ContentError
        Its content has faults; a DeclarationError too.

    Warns
    -----
    MechgraphWarning
        Something in a file of another program was changed or left out; ``description`` lists it.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.load("rcsr")
    Mechanism('rcsr', 4 links, 4 pairs)
    """
    path = Path(os.fsdecode(name)) if isinstance(name, str | os.PathLike) else Path()
    if path.suffix.lower() not in READERS:
        return toml.load(name)
    try:
        made, notes = _read(path)
    except DeclarationError as error:
        raise ContentError(path, error) from None
    for note in notes:
        warnings.warn(f"{path.name}: {note}", MechgraphWarning, stacklevel=3)
    return made


WRITERS = (
    Format("TOML", (".toml",), toml.save),
    Format("MJCF", (".xml", ".mjcf"), _to_mjcf),
    Format("GraphML", (".graphml",), save_graphml),
    Format("node-link JSON", (".json",), save_node_link),
)
"""What a mechanism can be written as."""


@door
def save(m: Mechanism, path: str | os.PathLike[str]) -> None:
    """Write a mechanism to a file, atomically; the extension selects the format.

    ``.toml`` holds the whole mechanism: ``load`` returns an equal one. ``.xml`` and ``.mjcf`` hold it at its start. ``.graphml``
    and ``.json`` (node-link) hold the graph: links as nodes, pairs as edges.

    Parameters
    ----------
    m : Mechanism
        The mechanism.
    path : str or path
        The file.

    Raises
    ------
    FileError
        Unknown file extension; the format cannot hold the mechanism (functions as loads); or the file cannot be written.

    Examples
    --------
    >>> import mechgraph as mg
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / "press.toml"
    ...     mg.save(mg.load("rcsr"), path)
    ...     print(mg.load(path) == mg.load("rcsr"))
    True
    """
    format_of(path, WRITERS).write(m, path)
