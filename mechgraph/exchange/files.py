"""Load and save: the suffix of a path says which program's file it is."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from pathlib import Path

from mechgraph.errors import ContentError, DeclarationError, FileError, MechgraphWarning
from mechgraph.exchange.asmt import Assembly, Reader
from mechgraph.exchange.asmt_mechanism import mechanism_of
from mechgraph.exchange.graph import save_graphml, save_node_link
from mechgraph.exchange.mjcf_read import read_mjcf
from mechgraph.exchange.mjcf_write import save_mjcf
from mechgraph.exchange.urdf import read_urdf
from mechgraph.files import Format, text_of
from mechgraph.model import toml
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import door

Notes = tuple[str, ...]


def assembly_of(path: Path) -> Assembly:
    """A FreeCAD assembly as its file holds it."""
    return Reader(path, text_of(path, "FreeCAD assembly")).read()


def _from_asmt(path: Path) -> tuple[Mechanism, Notes]:
    return mechanism_of(assembly_of(path))


READERS: dict[str, Callable[[Path], tuple[Mechanism, Notes]]] = {
    ".asmt": _from_asmt,
    ".xml": read_mjcf,
    ".mjcf": read_mjcf,
    ".urdf": read_urdf,
}
"""Readers by suffix: the mechanism of a file, and what was taken otherwise than it stands there."""


@door
def load(name: str | os.PathLike[str]) -> Mechanism:
    """A mechanism from the library (by name), from a TOML file, or from a file of another program, by its suffix.

    ``.asmt`` is an assembly of FreeCAD, ``.xml`` and ``.mjcf`` are MJCF (MuJoCo), ``.urdf`` is URDF. What is taken otherwise than it
    stands in such a file is a ``MechgraphWarning`` and stands in the mechanism's ``description``.

    Raises
    ------
    FileError
        where the file cannot be read or is none of its kind; ContentError, which is a DeclarationError too, where its content is at fault.
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
    Format("MJCF", (".xml", ".mjcf"), save_mjcf),
    Format("GraphML", (".graphml",), save_graphml),
    Format("node-link JSON", (".json",), save_node_link),
)
"""What a mechanism can be written as beside TOML, which all other suffixes are."""


@door
def save(m: Mechanism, path: str | os.PathLike[str]) -> None:
    """Write a mechanism as TOML, or as the suffix says; the file is written whole or not at all.

    TOML holds all of a mechanism: ``load`` gives back an equal one. ``.xml`` and ``.mjcf`` hold it at its start, see ``save_mjcf``.
    ``.graphml`` and ``.json`` (node-link JSON) are its graph: links as nodes, pairs as edges, for programs that know graphs.

    Raises
    ------
    FileError
        where the format cannot say something, or the file cannot be written.
    """
    suffix = Path(os.fsdecode(path)).suffix.lower() if isinstance(path, str | os.PathLike) else ""
    writers = {known: one.write for one in WRITERS for known in one.suffixes}
    if suffix in READERS and suffix not in writers:
        raise FileError(
            path, f"files of this kind ({suffix}) are read, not written; write .toml or {', '.join(writers)}"
        )
    writers.get(suffix, toml.save)(m, path)
