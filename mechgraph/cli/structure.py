"""``mechgraph structure``."""

from __future__ import annotations

import typer

import mechgraph as mg
from mechgraph.cli.options import AsJson, At, Drivers, Engine, Named, Tolerance
from mechgraph.cli.outcome import NO_ANSWER
from mechgraph.cli.output import show, working
from mechgraph.cli.reading import loaded
from mechgraph.cli.records import structure_data, write_json
from mechgraph.typed import parse_at


def structure(
    mechanism: Named,
    driver: Drivers = None,
    at: At = None,
    engine: Engine = "auto",
    tol: Tolerance = None,
    json: AsJson = False,
) -> None:
    """Print the structure as the textbooks tell it: kinematic chain, mobility table and families, structural groups.

    Example: mechgraph structure windows-2 --driver A1

    Exit status: 0 done; 1 where the drivers leave links undetermined, or the loops cannot be closed; 2 wrong usage or bad input.
    """
    m = loaded(mechanism)
    values = dict(parse_at(m, text) for text in at or ())
    with working(f"structure of {m.name}"):
        found = mg.structure(m, driver or None, at=values or None, engine=engine, tol=tol)
        data = structure_data(found) if json else None
        document = found.document()
    if data:
        write_json("structure", data)
    else:
        show(document)
    if found.groups.free:
        raise typer.Exit(NO_ANSWER)
