"""``mechgraph solve`` and ``mechgraph respond``."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer

import mechgraph as mg
from mechgraph.cli.options import (
    Actuate,
    AsJson,
    Compare,
    Drives,
    Include,
    Method,
    MotionEngine,
    Named,
    OnReach,
    Out,
    Outputs,
    OverTime,
    Redundant,
    Tolerance,
)
from mechgraph.cli.outcome import NO_ANSWER, fail
from mechgraph.cli.output import progress, show, working, write
from mechgraph.cli.reading import check_out, loaded, show_compared
from mechgraph.cli.records import Written, write_json
from mechgraph.document import Document
from mechgraph.result.export import FORMATS
from mechgraph.typed import duration, longest, motions_of, parse_at, refuse

Told = list[Document] | dict[str, Any]
"""Documents to be shown, or a record."""


def solve(
    mechanism: Named,
    drive: Drives = None,
    actuate: Actuate = None,
    out: Out = None,
    include: Include = None,
    method: Method = "loop_wrench",
    redundant: Redundant = "nan",
    on_reach: OnReach = "raise",
    engine: MotionEngine = "auto",
    transmission: Outputs = None,
    compared: Compare = False,
    tol: Tolerance = None,
    over_time: OverTime = False,
    json: AsJson = False,
) -> None:
    """Solve positions, efforts of the drivers and all reactions, print a summary and write a table.

    Example: mechgraph solve 7r --drive O1=0:360:5deg@10 --out 7r.csv

    Exit status: 0 done; 1 the loops cannot be closed, a position is out of reach or a dead point (unless flagged and others were
    solved), a freedom is neither driven nor passive, or drivers contradict each other; 2 wrong usage or bad input. A file is
    written whole or not at all.
    """
    if json and compared:
        refuse("solve", "--json and --compare exclude each other")
    check_out(out, mechanism, FORMATS)
    m = loaded(mechanism)
    motions = motions_of(m, drive or ())
    with progress(f"solving {m.name}") as moved, warnings.catch_warnings():
        warnings.simplefilter("ignore", mg.MechgraphWarning)  # the summary has them
        how: dict[str, Any] = {"method": method, "redundant": redundant, "on_reach": on_reach, "engine": engine}
        s = mg.solve(m, motions or None, actuate=actuate, tol=tol, progress=moved, **how)
    with working(f"summary of {m.name}"):
        told, written = _told(s, out, tuple(include or ()), json, over_time)
        angles = [mg.transmission(s, name) for name in transmission or ()]
        if isinstance(told, dict):
            told |= {"transmission": [found.to_dict() for found in angles]}
        else:
            told += [found.document() for found in angles]
    _tell("solve", told, written)
    if compared:
        show_compared(mechanism)
    if not (np.asarray(s.status) == "ok").any():
        raise typer.Exit(NO_ANSWER)


def _told(
    s: mg.Solution, out: Path | None, include: tuple[Any, ...], json: bool, over_time: bool
) -> tuple[Told, Written | None]:
    """What is told of a solution, and the file that was written."""
    figures = mg.over_time(s) if over_time else None
    told: Told = [s.document(asked=True), *([figures.document()] if figures else [])]
    if json:
        told = s.to_dict() | {"over_time": figures and figures.to_dict()}
    if out is None:
        return told, None
    s.write(out, include)
    return told, Written(str(out), s.status.size, len(s.part(slice(1)).columns(include)))


def _tell(command: str, told: Told, written: Written | None) -> None:
    if isinstance(told, dict):
        write_json(command, told, written=written)
        return
    for place, document in enumerate(told):
        write("\n" * bool(place))
        show(document)
    if written is not None:
        write(f"\nWrote {written.file}: {written.rows} rows, {written.columns} columns.\n")


def respond(
    mechanism: Named,
    span: Annotated[
        str | None,
        typer.Option("--for", metavar="TIME", help="How long: 10s. Left out, as [response] of the file says."),
    ] = None,
    start: Annotated[
        list[str] | None, typer.Option("--start", metavar="FREEDOM=VALUE", help="Coordinate at the beginning (repeat).")
    ] = None,
    rate: Annotated[
        list[str] | None,
        typer.Option(
            "--rate", metavar="FREEDOM=VALUE", help="Rate at the beginning: A=2, A=90deg a unit of time (repeat)."
        ),
    ] = None,
    points: Annotated[
        int | None,
        typer.Option("--points", min=2, help="Number of output times, evenly spread; without it the steps taken."),
    ] = None,
    out: Out = None,
    include: Include = None,
    method: Annotated[
        Literal["auto", "RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA"] | None,
        typer.Option(help="Stepper of scipy; Radau for stiff loads."),
    ] = None,
    rtol: Annotated[float | None, typer.Option(help="Relative tolerance of a step, 1e-8 by itself.")] = None,
    atol: Annotated[
        float | None,
        typer.Option(help="Absolute tolerance (radians, lengths / L, and their rates), 1e-10 by itself."),
    ] = None,
    max_step: Annotated[
        str | None,
        typer.Option("--max-step", metavar="TIME", help="Longest step: 5ms. By itself as the tolerances allow."),
    ] = None,
    passive: Annotated[
        Literal["free", "held"] | None, typer.Option(help="Whether passive freedoms move freely, or are held at rest.")
    ] = None,
    engine: MotionEngine = "auto",
    over_time: OverTime = False,
    json: AsJson = False,
) -> None:
    """Follow the motion that the loads produce, print a summary with the energy balance and write a table.

    What is left out is that of [response] of the file, where it has one.

    Example: mechgraph respond windows-2 --for 500ms --rate A0=-1

    Exit status: 0 done; 1 the loops cannot be closed, or the motion cannot be followed to its end (what there is is written); 2 wrong
    usage or bad input. Ctrl-C keeps what was computed. A file is written whole or not at all.
    """
    check_out(out, mechanism, FORMATS)
    m = loaded(mechanism)
    begin = dict(parse_at(m, text, "--start") for text in start or ())
    rates = dict(parse_at(m, text, "--rate") for text in rate or ())
    declared = m.units.get("time", "s")
    if span is not None:
        times = np.array([0.0, duration(span, "--for", declared)])
    elif m.response is not None:
        times = m.response.times
    else:
        refuse("respond", "how long? Give --for TIME; the mechanism has no [response] that says it")
    given = {m.full_name(d.freedom) for d in (m.response.motions if m.response else ())}
    still = [d.freedom for d in m.drives if isinstance(d.motion, mg.Motion) and d.motion.t is None]
    if still := [name for name in still if m.full_name(name) not in given]:
        refuse(
            "respond",
            f"the stored motion of {', '.join(still)} has no times; add t = [...], a time for each position, to its [drive.motion] in "
            "the file, or leave that out: the freedom then moves as the loads drive it",
        )
    longest_step = None if max_step is None else longest(max_step, "--max-step", declared)
    t = np.linspace(times[0], times[-1], points) if points else times
    with progress(f"moving {m.name}", float(times[-1])) as moved, warnings.catch_warnings():
        warnings.simplefilter("ignore", mg.MechgraphWarning)  # the summary has them
        r = mg.respond(
            m, t, start=begin or None, rates=rates or None, rtol=rtol, atol=atol, method=method, passive=passive, engine=engine,
            max_step=longest_step, on_stop="return", progress=moved,
        )  # fmt: skip
    with working(f"summary of {m.name}"):
        told = _told(r, out, tuple(include or ()), json, over_time)
    _tell("respond", *told)
    if r.stopped:
        fail(r.stopped, NO_ANSWER)
