"""Load and save: the suffix of a path says which program's file it is."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from pathlib import Path

from mechgraph.errors import ContentError, DeclarationError, MechgraphWarning
from mechgraph.exchange.asmt import Assembly, Reader
from mechgraph.exchange.asmt_mechanism import mechanism_of
from mechgraph.model import toml
from mechgraph.model.mechanism import Mechanism

Notes = tuple[str, ...]


def assembly_of(path: Path) -> Assembly:
    """A FreeCAD assembly as its file holds it."""
    return Reader(path, toml.text_of(path, "FreeCAD assembly")).read()


def _from_asmt(path: Path) -> tuple[Mechanism, Notes]:
    return mechanism_of(assembly_of(path))


READERS: dict[str, Callable[[Path], tuple[Mechanism, Notes]]] = {".asmt": _from_asmt}
"""Readers by suffix: the mechanism of a file, and what was taken otherwise than it stands there."""


def load(name: str | os.PathLike[str]) -> Mechanism:
    """A mechanism from the library (by name), from a TOML file, or from a file of another program, by its suffix.

    ``.asmt`` is an assembly of FreeCAD. What is taken otherwise than it stands in such a file is a ``MechgraphWarning`` and stands in the
    mechanism's ``description``.

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
