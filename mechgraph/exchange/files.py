"""Files of other programs by their ending, and graphs for other programs.

The graph of a mechanism for programs that know graphs: GraphML and node-link JSON, by networkx's own writers.

Nodes are links and edges are pairs, with their names as keys; attributes are texts, numbers and truth values alone. ``loops`` of an edge
are the numbers of the loops that run through it (see ``DeterminacyReport.loops``), with the sign in which they do.

Results that FreeCAD stored with an assembly beside those of mechgraph: placements of parts, forces of joints, efforts of motions.

FreeCAD's solver stores for each part the place of its origin and its Bryant angles, ``R = Rx Ry Rz``; for each joint and motion the force
and moment that it exerts on the part of marker I, in the directions of the assembly, about the origin of marker I (OndselSolver,
ASMTConstraintSet). Where reactions are not unique it sets redundant conditions aside and stores one of many solutions.
"""

from __future__ import annotations

import dataclasses
import json
import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from mechgraph.document import Document, Paragraph, Shown, Table
from mechgraph.errors import ContentError, DeclarationError, FileError, MechgraphWarning, visible
from mechgraph.files import Format, format_of, text_of, write_whole
from mechgraph.graph.linkgraph import link_graph
from mechgraph.kinetostatics import solve
from mechgraph.maths.se3 import Array
from mechgraph.model import toml
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.quantities import door
from mechgraph.result.solution import Solution

if TYPE_CHECKING:
    import networkx as nx

    from mechgraph.exchange.asmt import Assembly, Connection, Results


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


Notes = tuple[str, ...]


def assembly_of(path: Path) -> Assembly:
    """A FreeCAD assembly as its file holds it."""
    from mechgraph.exchange.asmt import AsmtReader

    return AsmtReader(path, text_of(path, "FreeCAD assembly")).read()


# files of other programs are rare: what reads and writes them is loaded where it is asked for


def _from_asmt(path: Path) -> tuple[Mechanism, Notes]:
    from mechgraph.exchange.asmt_mechanism import mechanism_of

    return mechanism_of(assembly_of(path))


def _from_mjcf(path: Path) -> tuple[Mechanism, Notes]:
    from mechgraph.exchange.mjcf import read_mjcf

    return read_mjcf(path)


def _to_mjcf(m: Mechanism, path: str | os.PathLike[str]) -> None:
    from mechgraph.exchange.mjcf import save_mjcf

    save_mjcf(m, path)


def _from_urdf(path: Path) -> tuple[Mechanism, Notes]:
    from mechgraph.exchange.urdf import read_urdf

    return read_urdf(path)


READERS: dict[str, Callable[[Path], tuple[Mechanism, Notes]]] = {
    ".asmt": _from_asmt,
    ".xml": _from_mjcf,
    ".mjcf": _from_mjcf,
    ".urdf": _from_urdf,
}
"""Readers by suffix: the mechanism of a file, and what was taken otherwise than it stands there."""


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
    reader = READERS.get(Path(os.fsdecode(name)).suffix.lower()) if isinstance(name, str | os.PathLike) else None
    if reader is None:
        return toml.load(name)
    path = Path(os.fsdecode(name))
    try:
        made, notes = reader(path)
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


AGREES = 1e-4
"""Differences up to here count as agreement: FreeCAD's solver closes to 1e-6 and differentiates twice."""
FORCES = ("FXonI", "FYonI", "FZonI")
TORQUES = ("TXonI", "TYonI", "TZonI")
AXES = {"RotationalMotion": "Rz", "TranslationalMotion": "Tz"}


@dataclass(frozen=True)
class Difference:
    """The largest difference of a quantity over the stored times, and the size to which it is relative.

    ``missing``: the number of values that are not unique, so that the file has one of many.
    """

    of: str
    quantity: str
    largest: float
    size: float
    missing: int = 0

    @property
    def relative(self) -> float:
        """The difference relative to the size; the difference itself where that is 0."""
        return self.largest / self.size if self.size else self.largest

    def cells(self) -> tuple[str, ...]:
        """The cells of the table."""
        remark = "not unique: the file has one of many" if self.missing else ""
        shown = ("", "") if np.isnan(self.largest) else (f"{self.largest:.3g}", f"{self.relative:.2g}")
        return self.of, self.quantity, f"{self.size:.4g}" if self.size else "", *shown, remark


@dataclass(frozen=True, repr=False)
class Comparison(Shown):
    """All differences between a file's results and mechgraph's."""

    name: str
    times: int
    differences: tuple[Difference, ...]

    @property
    def agrees(self) -> bool:
        """Whether everything that is unique agrees to ``AGREES``."""
        return all(np.isnan(d.largest) or d.relative <= AGREES for d in self.differences)

    def document(self) -> Document:
        """The verdict and a table."""
        off = [d for d in self.differences if d.relative > AGREES]
        worst = max(off, key=lambda d: d.relative, default=None)
        verdict = f"All that is unique agrees to {AGREES:g}"
        if worst is not None:
            count = f"Quantities off by more than {AGREES:g}: {len(off)} of {len(self.differences)}"
            verdict = f"{count}, {worst.quantity} of {worst.of} the most"
        head = ("of", "quantity", "greatest in the file", "difference", "relative", "")
        rows = tuple(d.cells() for d in self.differences)
        return Document(
            f"{self.name}: FreeCAD's stored results beside mechgraph's",
            (Paragraph(f"{verdict}, at {self.times} times."), Table(head, rows, "llrrrl")),
        )


def difference(of: str, quantity: str, ours: Array, theirs: Array, size: float | None = None) -> Difference:
    """The largest difference of vectors ``(T, 3)``; NaN where none of ours is unique."""
    off = np.abs(ours - theirs)
    known = ~np.isnan(off)
    largest = float(off[known].max()) if known.any() else np.nan
    return Difference(of, quantity, largest, float(np.abs(theirs).max()) if size is None else size, int((~known).sum()))


def _rows(rows: Mapping[str, Array], labels: tuple[str, ...]) -> Array | None:
    return np.stack([rows[label] for label in labels], axis=-1) if set(labels) <= set(rows) else None


@dataclass(frozen=True)
class _Compared:
    """The solution at the stored times, and what it is compared with."""

    assembly: Assembly
    results: Results
    s: Solution

    def place(self, marker: str) -> tuple[Array, Array]:
        """Origin ``(T, 3)`` and z axis ``(T, 3)`` of a marker."""
        found = self.assembly.markers[marker]
        X = self.s.link(found.part).pose
        at = self.assembly.ground.pose if found.part == self.assembly.name else np.eye(3, 4)
        p, z = at[:, :3] @ found.pose[:, 3] + at[:, 3], at[:, :3] @ found.pose[:, 2]
        return X[:, :3, :3] @ p + X[:, :3, 3], X[:, :3, :3] @ z

    def parts(self) -> Iterator[Difference]:
        """Places, relative to the largest coordinate of all, and turns of the parts."""
        paths = {part.path: part.name for part in self.assembly.parts.values()}
        known = set(self.s.mechanism.link_names())
        stored = {
            paths[path]: rows for (kind, path), rows in self.results.series.items() if kind == "Part" and path in paths
        }
        stored = {name: rows for name, rows in stored.items() if name in known}
        size = max(
            (float(np.abs(p).max()) for rows in stored.values() if (p := _rows(rows, ("X", "Y", "Z"))) is not None),
            default=1.0,
        )
        for name, rows in stored.items():
            place, angles = _rows(rows, ("X", "Y", "Z")), _rows(rows, ("Bryantx", "Bryanty", "Bryantz"))
            X = self.s.link(name).pose
            if place is not None:
                yield difference(name, "place", X[:, :3, 3], place, size)
            if angles is not None:
                rotation = scipy.spatial.transform.Rotation
                turn = rotation.from_matrix(X[:, :3, :3]).inv() * rotation.from_euler("XYZ", angles)
                yield difference(name, "turn [rad]", turn.as_rotvec(), np.zeros((len(X), 3)), 0.0)

    def wrenches(self) -> Iterator[tuple[str, Array, Array, Array, Array]]:
        """Name, force and moment on I of ours and theirs, for each joint and each motion of a single joint."""
        root = f"/{self.assembly.name}/"
        for found in [*self.assembly.joints, *self.assembly.motions]:
            rows = self.results.series.get((found.kind, root + found.name))
            stored = rows and (_rows(rows, FORCES), _rows(rows, TORQUES))
            ours = self.on_i(found) if stored and stored[0] is not None and stored[1] is not None else None
            if ours is not None:
                yield found.name, *ours, *stored  # type: ignore[misc]

    def on_i(self, found: Connection) -> tuple[Array, Array] | None:
        """Force and moment of a joint or motion on the part of I, about marker I; None where there is no pair of it."""
        names = {pair.name for pair in self.s.mechanism.pairs}
        if found.kind not in AXES:
            if found.name not in names:
                return None
            origin, _ = self.place(found.i)
            moment, force = -self.s[found.name].reaction[..., :3], -self.s[found.name].reaction[..., 3:]
            return force, moment - np.cross(origin, force)
        joint = next((j for j in self.assembly.joints if found.joint.endswith(f"/{j.name}") or found.i == j.i), found)
        pair = self.s.mechanism.pair(joint.name) if joint.name in names and found.i in ("", joint.i) else None
        place = [f.name for f in pair.type.freedoms].index(AXES[found.kind]) if pair else 0
        if pair is None:
            return None
        (origin, z), (other, _) = self.place(joint.i), self.place(joint.j)
        along = -self.s[joint.name].effort[:, place, None] * z
        if pair.type.freedoms[place].turns:
            return np.zeros_like(along), along
        return along, np.cross(other - origin, along)

    def all(self) -> Iterator[Difference]:
        """All differences; forces relative to the greatest force of all, moments to the greatest moment."""
        yield from self.parts()
        found = list(self.wrenches())
        largest = [max((float(np.abs(row[k]).max()) for row in found), default=0.0) for k in (3, 4)]
        for name, force, moment, stored_force, stored_moment in found:
            yield difference(name, "force", force, stored_force, largest[0])
            yield difference(name, "moment", moment, stored_moment, largest[1])


def compare(path: str | os.PathLike[str]) -> Comparison:
    """FreeCAD's stored results beside those of mechgraph for the same motions at the same times.

    Raises
    ------
    FileError
        where the file holds no results, or no motions that prescribe the movement.
    """
    from mechgraph.exchange.asmt import results_of
    from mechgraph.exchange.asmt_mechanism import mechanism_of

    path = Path(path)
    assembly = assembly_of(path)
    results = results_of(assembly, path)
    if not assembly.motions:
        raise FileError(
            path, "has no motions: its results are a free movement, which cannot be computed from positions alone"
        )
    try:
        m, _ = mechanism_of(dataclasses.replace(assembly, times=results.times))
    except DeclarationError as error:
        raise ContentError(path, error) from None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MechgraphWarning)
        s = solve(m, on_reach="flag")
    return Comparison(assembly.name, results.times.size, tuple(_Compared(assembly, results, s).all()))
