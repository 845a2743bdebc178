"""``mechgraph assemblies`` and ``mechgraph branches``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

import mechgraph as mg
from mechgraph import show as pictures
from mechgraph.cli.completion import freedoms
from mechgraph.cli.options import AsJson, At, Named
from mechgraph.cli.outcome import NO_ANSWER
from mechgraph.cli.output import show, working, write
from mechgraph.cli.reading import loaded, refuse_own_file
from mechgraph.cli.records import write_json
from mechgraph.show.animation import PICTURES
from mechgraph.typed import parse_at
from mechgraph.writing import format_of, formats_text

Picture = Annotated[
    Path | None,
    typer.Option("--out", metavar="FILE", help=f"Also draw them; the suffix says how: {formats_text(PICTURES)}."),
]


def assemblies(mechanism: Named, at: At = None, out: Picture = None, json: AsJson = False) -> None:
    """Find all real assemblies with drivers at given values, and say how sure it is that these are all.

    Declared drives stay at their start, those that --at does not name as well.

    Example: mechgraph assemblies four-bar --at A=30deg

    Exit status: 0 done; 1 where there is no real assembly; 2 wrong usage or bad input.
    """
    _check_picture(out, mechanism)
    m = loaded(mechanism)
    at_start = {m.full_name(d.freedom): m.start.get(m.full_name(d.freedom), 0.0) for d in m.drives}
    values = {m.full_name(name): value for name, value in (parse_at(m, text) for text in at or ())}
    if values.keys() <= at_start.keys():
        values = at_start | values
    with working(f"assemblies of {m.name}"):
        found = mg.assemblies(m, values)
        figure = found.plot() if out is not None and len(found) else None
    _tell("assemblies", found, figure, out, json)
    if not len(found):
        raise typer.Exit(NO_ANSWER)


def branches(
    mechanism: Named,
    driver: Annotated[
        str | None,
        typer.Option(
            "--driver",
            metavar="FREEDOM",
            autocompletion=freedoms,
            help="The driver; left out, the first declared drive.",
        ),
    ] = None,
    output: Annotated[
        str | None, typer.Option("--output", metavar="FREEDOM", help="What a picture shows over the driver.")
    ] = None,
    out: Picture = None,
    json: AsJson = False,
) -> None:
    """Follow every assembly over the range of a driver: branches, folds, circuits, full turns.

    Example: mechgraph branches rssr --driver A --out rssr.svg

    Exit status: 0 done; 1 where there is no branch; 2 wrong usage or bad input.
    """
    _check_picture(out, mechanism)
    m = loaded(mechanism)
    name = driver if driver is not None else next((d.freedom for d in m.drives), "")
    with working(f"branches of {m.name}"):
        found = mg.branches(m, name)
        figure = found.plot(output).figure if out is not None and len(found) else None
    _tell("branches", found, figure, out, json)
    if not len(found):
        raise typer.Exit(NO_ANSWER)


def _check_picture(out: Path | None, mechanism: str) -> None:
    """Refuse a picture that could not be written, before anything is computed."""
    if out is not None:
        refuse_own_file(out, mechanism)
        format_of(out, PICTURES)


def _tell(command: str, found: Any, figure: Any, out: Path | None, json: bool) -> None:
    """What was found, as a table or a record, and the picture."""
    drawn = None if figure is None or out is None else out
    if drawn is not None:
        pictures.save_picture(figure, drawn)
    if json:
        write_json(command, found.data, file=None if drawn is None else str(drawn))
        return
    show(found.document())
    if drawn is not None:
        write(f"\nWrote {drawn}.\n")
