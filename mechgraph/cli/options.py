"""Arguments and options that several commands take."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from mechgraph.cli.completion import freedom_names, freedoms, library_names
from mechgraph.exchange.files import READERS
from mechgraph.result.export import FORMATS
from mechgraph.result.table import MORE
from mechgraph.writing import formats_text

Named = Annotated[
    str,
    typer.Argument(
        metavar="NAME_OR_FILE",
        autocompletion=library_names,
        help=f"A mechanism of the library (see 'list'), a TOML file, or one of another program ({', '.join(READERS)}).",
    ),
]
AsJson = Annotated[
    bool, typer.Option("--json", help="As JSON for scripts; output.schema.json beside the library describes it.")
]
Engine = Annotated[
    Literal["auto", "dense", "sparse"],
    typer.Option(help="Dense or sparse matrices, or the faster ones for the size; the results are the same."),
]
MotionEngine = Annotated[
    Literal["auto", "dense", "sparse", "compiled"],
    typer.Option(
        help="Dense or sparse matrices, the compiled kernel, or the fastest for the size; the results are the same."
    ),
]
Tolerance = Annotated[
    float | None,
    typer.Option(
        "--tol",
        metavar="TOL",
        help="Accuracy to which directions (radians) and distances (over the mean radius L) are meant, e.g. 1e-4.",
    ),
]
Bookkeeping = Annotated[Literal["lee", "minimal"], typer.Option(help="How the unknowns of a pair are written.")]
Method = Annotated[Literal["loop_wrench", "newton_euler", "printed"], typer.Option(help="How the forces are solved.")]
Redundant = Annotated[
    Literal["nan", "minimum_norm"],
    typer.Option(
        help="What stands for reactions that are not unique: no value, or the least (all pairs equally stiff)."
    ),
]
OnReach = Annotated[
    Literal["raise", "flag"],
    typer.Option("--on-reach", help="Stop at a position that cannot be reached, or flag it and go on."),
]
At = Annotated[
    list[str] | None,
    typer.Option(
        "--at",
        metavar="FREEDOM=VALUE",
        autocompletion=freedoms,
        help="Assemble there first: A=30deg, B.Tz=0.02 (repeat).",
    ),
]
Drivers = Annotated[
    list[str] | None,
    typer.Option(
        "--driver", metavar="FREEDOM", autocompletion=freedoms, help="Driver instead of those declared (repeat)."
    ),
]
EquationsAt = Annotated[
    list[str] | None,
    typer.Option(
        "--at",
        metavar="FREEDOM=VALUE[@RATE[@ACCELERATION]]",
        autocompletion=freedoms,
        help="Numbers at this position: A=30deg@10 (repeat).",
    ),
]
Drives = Annotated[
    list[str] | None,
    typer.Option(
        "--drive",
        autocompletion=freedoms,
        metavar="FREEDOM=START:STOP:STEP[@RATE[@ACCELERATION]]",
        help="Motion of a driver, the end excluded: A=0:360:1deg@10, B.Tz=0:0.1:0.01, or one value A=30deg. Angles in rad, "
        "or in deg where the suffix says so; lengths, rates and accelerations in the declared units (rates of turns in "
        "rad/s, or @600deg). "
        "Repeat for several drivers: they describe the same positions. Also coordinates of a named point (bucket.tip.Tz, or "
        "bucket.tip.T(1,0,1) along a direction) and of a link (platform.Rz). Without it the stored motion.",
    ),
]
Actuate = Annotated[
    list[str] | None,
    typer.Option(
        "--actuate",
        metavar="FREEDOM",
        autocompletion=freedom_names,
        help="A freedom in which an unknown effort stands, in place of those that are moved (repeat: as many as these).",
    ),
]
Out = Annotated[
    Path | None,
    typer.Option(
        "--out",
        metavar="FILE",
        help=f"Write everything, one row a position; the suffix says how: {formats_text(FORMATS)}.",
    ),
]
Include = Annotated[
    list[str] | None,
    typer.Option("--include", metavar="WHAT", help=f"More columns for --out (repeat): {', '.join(MORE)}."),
]
Outputs = Annotated[
    list[str] | None,
    typer.Option(
        "--transmission",
        metavar="FREEDOM",
        autocompletion=freedom_names,
        help="Also how well the drivers move this output: its transmission and deviation angle (repeat).",
    ),
]

Compare = Annotated[
    bool, typer.Option("--compare", help="Also the results stored in a FreeCAD assembly (.asmt) beside ours.")
]
OverTime = Annotated[
    bool,
    typer.Option(
        "--over-time", help="Also peak, mean, RMS and work of drivers, and shaking, over time or a whole cycle."
    ),
]
