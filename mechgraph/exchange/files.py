"""Load and save: the suffix of a path says which program's file it is."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from pathlib import Path

from mechgraph.errors import ContentError, DeclarationError, FileError, MechgraphWarning
from mechgraph.exchange.asmt import Assembly, Reader
from mechgraph.exchange.asmt_mechanism import mechanism_of
from mechgraph.exchange.mjcf_read import read_mjcf
from mechgraph.exchange.mjcf_write import save_mjcf
from mechgraph.exchange.urdf import read_urdf
from mechgraph.model import toml
from mechgraph.model.mechanism import Mechanism

Notes = tuple[str, ...]


def assembly_of(path: Path) -> Assembly:
    """A FreeCAD assembly as its file holds it."""
    return Reader(path, toml.text_of(path, "FreeCAD assembly")).read()


def _from_asmt(path: Path) -> tuple[Mechanism, Notes]:
    return mechanism_of(assembly_of(path))


READERS: dict[str, Callable[[Path], tuple[Mechanism, Notes]]] = {
    ".asmt": _from_asmt,
    ".xml": read_mjcf,
    ".mjcf": read_mjcf,
    ".urdf": read_urdf,
}
"""Readers by suffix: the mechanism of a file, and what was taken otherwise than it stands there."""


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
        warnings.warn(f"{path.name}: {note}", MechgraphWarning, stacklevel=2)
    return made


WRITERS: dict[str, Callable[[Mechanism, str | os.PathLike[str]], None]] = {".xml": save_mjcf, ".mjcf": save_mjcf}
"""Writers by suffix; all other files are TOML."""


def save(m: Mechanism, path: str | os.PathLike[str]) -> None:
    """Write a mechanism as TOML, or as MJCF where the path ends in ``.xml`` or ``.mjcf``; the file is written whole or not at all.

    TOML holds all of a mechanism: ``load`` gives back an equal one. MJCF holds it at its start, see ``save_mjcf``.

    Raises
    ------
    FileError
        where the format cannot say something, or the file cannot be written.
    """
    suffix = Path(os.fsdecode(path)).suffix.lower() if isinstance(path, str | os.PathLike) else ""
    if suffix in READERS and suffix not in WRITERS:
        raise FileError(
            path, f"files of this kind ({suffix}) are read, not written; write .toml or {', '.join(WRITERS)}"
        )
    WRITERS.get(suffix, toml.save)(m, path)
