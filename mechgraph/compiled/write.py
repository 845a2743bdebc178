"""What a mechanism in the tables is written as: C, or a unit for co-simulation."""

from __future__ import annotations

import os

from mechgraph.compiled.c_file import write_c
from mechgraph.compiled.fmu import write_fmu
from mechgraph.compiled.tabled import Tabled
from mechgraph.writing import Format, format_of

WRITTEN = (
    Format("C99, with a header beside it", (".c",), write_c),
    Format("FMI 2.0 for co-simulation", (".fmu",), write_fmu),
)


def write_tables(tables: Tabled, path: str | os.PathLike[str], name: str | None = None) -> None:
    """Write the mechanism as the suffix of ``path`` says; symbols begin with ``name``, else with the name of the file.

    Raises
    ------
    DeclarationError
        where ``name`` is no identifier of C; FileError; MissingExtraError for a unit where there is no C compiler.
    """
    format_of(path, WRITTEN).write(tables, path, name)
