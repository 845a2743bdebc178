"""What there is: ``mechgraph list``, and in other files: ``mechgraph save``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import mechgraph as mg
from mechgraph.cli.options import AsJson, Named
from mechgraph.cli.output import show, write
from mechgraph.cli.reading import loaded, refuse_own_file
from mechgraph.cli.records import FileData, LibraryItem, ListData, write_json
from mechgraph.document import Document, Table
from mechgraph.exchange.files import WRITERS
from mechgraph.typed import refuse
from mechgraph.writing import formats_text


def list_library(json: AsJson = False) -> None:
    """Name the mechanisms of the library, with what they are.

    Example: mechgraph list --json
    """
    found = {name: mg.load(name) for name in mg.library()}
    if json:
        items = [
            LibraryItem(name, m.description, m.link_names(), {p.name: p.type.symbol for p in m.pairs})
            for name, m in found.items()
        ]
        write_json("list", ListData(tuple(items)))
        return
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
    advice: Annotated[
        int | None,
        typer.Option(
            "--advice", metavar="NUMBER", help="Changed as 'check --json' advises, by the number of the advice from 0."
        ),
    ] = None,
    json: AsJson = False,
) -> None:
    """Write a mechanism as another file: TOML, which holds all of it, or what other programs read.

    Example: mechgraph save four-bar --advice 0 --out better.toml

    Exit status: 0 done; 1 it cannot be assembled, where the file holds it at its start; 2 wrong usage or bad input.
    """
    refuse_own_file(out, mechanism)
    m = loaded(mechanism)
    if advice is not None:
        known = mg.check(m).advice
        if not 0 <= advice < len(known):
            refuse(f"--advice {advice}", f"there are {len(known)}, counted from 0: mechgraph check {mechanism} --json")
        m = known[advice].apply()
    mg.save(m, out)
    if json:
        write_json("save", FileData(m.name, str(out)))
    else:
        write(f"Wrote {out}.\n")
