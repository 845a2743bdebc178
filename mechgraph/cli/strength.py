"""``mechgraph loads``: what acts on a link, for a strength calculation."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

import mechgraph as mg
from mechgraph.cli.options import Actuate, AsJson, Drives, Engine, Named, OnReach, Redundant, Tolerance
from mechgraph.cli.output import show, working, write
from mechgraph.cli.reading import check_out, loaded
from mechgraph.cli.records import loads_data, write_json
from mechgraph.result.load_files import FORMATS
from mechgraph.typed import motions_of, refuse
from mechgraph.writing import formats_text


def loads(
    mechanism: Named,
    link: Annotated[str, typer.Argument(metavar="LINK", help="The link.")],
    drive: Drives = None,
    actuate: Actuate = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help=f"Write the loads; the suffix says how: {formats_text(FORMATS)}."),
    ] = None,
    at: Annotated[
        str, typer.Option("--at", metavar="POSITIONS", help="'worst', 'all', or the number of a position, from 0.")
    ] = "worst",
    model: Annotated[str, typer.Option(help="Deck: file with mesh and couplings, to be included.")] = "",
    held: Annotated[
        str, typer.Option(help="Deck: what acts where your model is held, e.g. a pair; a reaction there.")
    ] = "",
    couples: Annotated[float | None, typer.Option(help="Deck: moments as two forces at this distance.")] = None,
    inertia: Annotated[
        Literal["wrench", "acceleration"] | None,
        typer.Option(help="Deck: inertia as a force and couple on a node (wrench), or as loads of the elements."),
    ] = None,
    redundant: Redundant = "nan",
    on_reach: OnReach = "raise",
    engine: Engine = "auto",
    tol: Tolerance = None,
    json: AsJson = False,
) -> None:
    """Print what acts on a link over the positions, in its own frame and in balance, and write it as a table or a load deck.

    Example: mechgraph loads 7r link3 --drive O1=0:360:5deg@10 --at all

    Exit status: 0 done; 1 as for solve; 2 wrong usage or bad input, or something that is not unique would have to be written as known.
    """
    check_out(out, mechanism, FORMATS)
    m = loaded(mechanism)
    if at not in ("worst", "all") and not re.fullmatch(r"-?\d+", at):
        refuse(f"--at {at!r}", "expected worst, all, or the number of a position, from 0")
    places: Any = at if at in ("worst", "all") else int(at)
    options = {"model": model, "held": held, "couples": couples, "inertia": inertia}
    m.place_of_link(link)
    motions = motions_of(m, drive or ()) or None
    with working(f"solving {m.name}"):
        s = mg.solve(m, motions, actuate=actuate, redundant=redundant, on_reach=on_reach, engine=engine, tol=tol)
        body = mg.free_body(s, link)
        document = body.document(places)
        if out is not None:
            body.write(out, places, **{name: value for name, value in options.items() if value})
    if json:
        write_json("loads", loads_data(body, places, None if out is None else str(out)))
        return
    show(document)
    if out is not None:
        write(f"\nWrote {out}: {len(body.cases(places))} positions.\n")
