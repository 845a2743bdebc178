"""``mechgraph check``."""

from __future__ import annotations

from typing import Annotated

import typer

import mechgraph as mg
from mechgraph.cli.options import AsJson, At, Compare, Engine, Named, Tolerance
from mechgraph.cli.outcome import NO_ANSWER
from mechgraph.cli.output import show, working, write
from mechgraph.cli.reading import loaded, show_compared
from mechgraph.cli.records import check_data, write_json
from mechgraph.typed import longest, parse_at, refuse


def check(
    mechanism: Named,
    json: AsJson = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="The report as Markdown.")] = False,
    full: Annotated[
        bool, typer.Option("--full", help="The whole report: every pair, self-stress, loop and count.")
    ] = False,
    at: At = None,
    engine: Engine = "auto",
    compared: Compare = False,
    tol: Tolerance = None,
    limit: Annotated[
        str | None,
        typer.Option(
            metavar="TIME", help="How long each search of the report may take, 20s by itself; it says what was left."
        ),
    ] = None,
) -> None:
    """Print the determinacy report: the verdict, what to do, and what may be trusted; with --full all of it.

    Example: mechgraph check four-bar --at A=30deg --full

    Exit status: 0 where forces can be solved; 1 where the loops cannot be closed, drivers depend on each other or have nothing
    to move, or a freedom is neither driven nor passive. Redundancy is information: a mechanism some of whose reactions are not
    unique has exit status 0, and so has a topology without geometry. 2 wrong usage or bad input.
    """
    if json + markdown + compared > 1:
        refuse("check", "--json, --markdown and --compare exclude each other")
    m = loaded(mechanism)
    values = dict(parse_at(m, text) for text in at or ())
    bounded = {} if limit is None else {"limit": longest(limit, "--limit")}
    with working(f"checking {m.name}: what can move"):
        report = mg.check(m, at=values or None, engine=engine, tol=tol, **bounded)
    with working(f"checking {m.name}: what is unique, what to do"):
        data = check_data(m, report) if json else {}
        text = report.to_markdown(full) if markdown else ""
        document = report.document(full)
    not_closed = m.has_geometry and report.mobility is None
    bearing = any(p.load_bearing for p in report.passive)
    unsolvable = not_closed or report.undriven or report.contradicting_drives
    doubtful = report.near or bearing or not report.determinate
    if json:
        write_json("check", data)
    elif text:
        write(text)
    else:
        show(document, "red" if unsolvable else "yellow" if doubtful else "green")
    if compared:
        show_compared(mechanism)
    if unsolvable:
        raise typer.Exit(NO_ANSWER)
