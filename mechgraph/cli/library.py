"""What there is: ``mechgraph list``, and in other files: ``mechgraph save``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import mechgraph as mg
from mechgraph.cli.options import Named
from mechgraph.cli.output import show, write
from mechgraph.cli.reading import loaded, refuse_own_file
from mechgraph.document import Document, Table
from mechgraph.exchange.files import WRITERS
from mechgraph.writing import formats_text


def list_library() -> None:
    """Name the mechanisms of the library, with what they are."""
    found = {name: mg.load(name) for name in mg.library()}
    rows = [(name, " ".join(p.type.symbol for p in m.pairs), m.description) for name, m in found.items()]
    show(Document("", (Table(("name", "pairs", "description"), tuple(rows)),)))


def save(
    mechanism: Named,
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            metavar="FILE",
            help=f"What is written; the suffix says how: .toml, {formats_text(WRITERS)}; others are TOML.",
        ),
    ],
) -> None:
    """Write a mechanism as another file: TOML, which holds all of it, or what other programs read.

    Exit status: 0 done; 1 it cannot be assembled, where the file holds it at its start; 2 wrong usage or bad input.
    """
    refuse_own_file(out, mechanism)
    mg.save(loaded(mechanism), out)
    write(f"Wrote {out}.\n")
