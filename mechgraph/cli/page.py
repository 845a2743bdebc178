"""``mechgraph report``."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import mechgraph as mg
from mechgraph.cli.options import Actuate, AsJson, Drives, Engine, Method, Named, OnReach, Redundant, Tolerance
from mechgraph.cli.outcome import NO_ANSWER, NO_ANSWERS
from mechgraph.cli.output import working, write
from mechgraph.cli.reading import loaded, refuse_own_file
from mechgraph.cli.records import FileData, write_json
from mechgraph.typed import drives_of


def report(
    mechanism: Named,
    out: Annotated[Path, typer.Option("--out", "-o", metavar="FILE.html", help="The page: one file, without network.")],
    drive: Drives = None,
    actuate: Actuate = None,
    method: Method = "loop_wrench",
    redundant: Redundant = "nan",
    on_reach: OnReach = "flag",
    engine: Engine = "auto",
    tol: Tolerance = None,
    json: AsJson = False,
) -> None:
    """Write a page to pass on: verdict, determinacy report, the mechanism in space, curves, tables, equations.

    Without --drive the stored motion is solved, where all drivers store one; else the page shows the mechanism as it stands.

    Exit status: 0 done; 1 the loops cannot be closed for a motion, a freedom is neither driven nor passive, drivers contradict each
    other, or a position cannot be reached (the page says what there is); 2 wrong usage or bad input. The file is written whole or not
    at all.

    Example: mechgraph report four-bar -o four-bar.html
    """
    refuse_own_file(out, mechanism)
    m = loaded(mechanism)
    motions = drives_of(m, drive or ())
    stored = bool(m.drives) and all(d.motion is not None for d in m.drives)
    s, failure = None, None
    with working(f"writing the page of {m.name}"), warnings.catch_warnings():
        warnings.simplefilter("ignore", mg.MechgraphWarning)  # the page has them
        if motions or actuate or stored:
            how: dict[str, Any] = {"method": method, "redundant": redundant, "on_reach": on_reach, "engine": engine}
            try:
                s = mg.solve(m, motions or None, actuate=actuate, tol=tol, **how)
            except NO_ANSWERS as error:
                failure, s = error, getattr(error, "solution", None)
        mg.write_report(m, s, path=out)
    if json:
        write_json("report", FileData(m.name, str(out)))
    else:
        write(f"Wrote {out}: {out.stat().st_size / 1e6:.2f} MB.\n")
    if failure is not None:
        raise failure
    if s is not None and not (np.asarray(s.status) == "ok").any():
        raise typer.Exit(NO_ANSWER)
