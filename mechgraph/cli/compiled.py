"""``mechgraph compile``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mechgraph.cli.options import AsJson, Named
from mechgraph.cli.output import working, write
from mechgraph.cli.reading import check_out, loaded
from mechgraph.cli.records import FileData, write_json
from mechgraph.compiled.tabled import tabled
from mechgraph.compiled.write import WRITTEN, InputsName, write_tables
from mechgraph.writing import formats_text


def compile_(
    mechanism: Named,
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="FILE", help=f"The suffix says how: {formats_text(WRITTEN)}.")
    ],
    name: Annotated[
        str | None,
        typer.Option("--name", metavar="NAME", help="What symbols begin with; left out, the name of the file."),
    ] = None,
    inputs: Annotated[
        InputsName,
        typer.Option(
            "--inputs",
            help="What is given of the drives: their motion, or their efforts, under which the motion is followed as well.",
        ),
    ] = "motion",
    json: AsJson = False,
) -> None:
    """Write a mechanism as C99 that runs by itself, for a controller, or as a unit for co-simulation (FMI 2.0).

    The C needs no compiler here: positions, efforts of the drives and reactions by the equations that 'mechgraph equations' prints.

    Exit status: 0 done; 1 the loops cannot be closed, or a freedom is neither driven nor passive; 2 wrong usage or bad input, or the
    kernel does not carry the mechanism.

    Example: mechgraph compile four-bar --out press.c
    """
    check_out(out, mechanism, WRITTEN)
    m = loaded(mechanism)
    with working(f"compiling {m.name}"):
        write_tables(tabled(m), out, name, inputs)
    if json:
        write_json("compile", FileData(m.name, str(out)))
    else:
        write(f"Wrote {out}.\n")
