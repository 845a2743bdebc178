"""What a mechanism in the tables is written as: C, or a unit for co-simulation."""

from __future__ import annotations

import os
from typing import Literal, get_args

from mechgraph.compiled.c_file import write_c
from mechgraph.compiled.fmu import write_fmu
from mechgraph.compiled.tabled import Tabled
from mechgraph.errors import DeclarationError
from mechgraph.files import Format, format_of
from mechgraph.quantities import option_faults

WRITTEN = (
    Format("C99, with a header beside it", (".c",), write_c),
    Format("FMI 2.0 for co-simulation", (".fmu",), write_fmu),
)


InputsName = Literal["motion", "efforts"]
"""What is given of the drives."""


def write_tables(
    tables: Tabled, path: str | os.PathLike[str], name: str | None = None, inputs: InputsName = "motion"
) -> None:
    """Write the mechanism as the suffix of ``path`` says; symbols begin with ``name``, else with the name of the file.

    Raises
    ------
    DeclarationError
        where ``name`` is no identifier of C, ``inputs`` no such word, or efforts are given and there are passive freedoms: nothing would
        hold these; FileError; MissingExtraError for a unit where there is no C compiler.
    """
    faults = option_faults({"inputs": (inputs, get_args(InputsName))})
    if inputs == "efforts" and tables.layout.shapes["holds"][0]:
        faults.append(
            "inputs = 'efforts': there are passive freedoms, which no motion under efforts holds; use inputs='motion', or mg.respond"
        )
    if faults:
        raise DeclarationError(f"write {tables.m.name!r}", faults)
    format_of(path, WRITTEN).write(tables.under_efforts() if inputs == "efforts" else tables, path, name)
