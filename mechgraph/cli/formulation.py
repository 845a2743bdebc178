"""``mechgraph equations``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import typer

import mechgraph as mg
from mechgraph.cli.options import AsJson, Bookkeeping, EquationsAt, Named
from mechgraph.cli.output import show, working, write
from mechgraph.cli.reading import check_out, loaded
from mechgraph.cli.records import equations_data, write_json
from mechgraph.equations.formulation import FORMATS
from mechgraph.typed import drives_of, refuse
from mechgraph.writing import formats_text


def solved_at(m: mg.Mechanism, at: list[str]) -> mg.Solution:
    """The one position that is named, with its rates."""
    motions = drives_of(m, at, "--at")
    if any(np.ndim(motion.position) for motion in motions.values()):
        refuse("--at", "expected one position, e.g. A=30deg@10")
    with working("solving"):
        return mg.solve(m, motions)


def equations(
    mechanism: Named,
    latex: Annotated[bool, typer.Option("--latex", help="As LaTeX.")] = False,
    bookkeeping: Bookkeeping = "lee",
    blocks: Annotated[bool, typer.Option("--blocks", help="Vector equations only, without their components.")] = False,
    coefficients: Annotated[bool, typer.Option("--coefficients", help="The table of nonzero coefficients.")] = False,
    csv: Annotated[bool, typer.Option("--csv", help="The table of nonzero coefficients as CSV.")] = False,
    unknowns: Annotated[
        Literal["kinetostatics", "response"],
        typer.Option(help="What is sought: forces for a given motion, or accelerations beside the reactions."),
    ] = "kinetostatics",
    at: EquationsAt = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help=f"Write them; the suffix says how: {formats_text(FORMATS)}, the first compiles.",
        ),
    ] = None,
    json: AsJson = False,
) -> None:
    """Print the closure equations, the d'Alembert equations of every link and the conditions of the pairs; needs no geometry.

    With --at the coefficients {Q}, the right sides {C} and the unknowns {u} with numbers, at one position.

    Example: mechgraph equations rcsr --at O1=160deg@0.1

    Exit status: 0 done; 1 the mechanism has no such position; 2 wrong usage or bad input.
    """
    if (latex or blocks) and (coefficients or csv):
        refuse("equations", "--coefficients and --csv print a table, --latex and --blocks equations; take one of them")
    if at and (latex or blocks):
        refuse("equations", "--at prints a table of numbers, --latex and --blocks equations; take one of them")
    if json and (latex or blocks or coefficients or csv or out):
        refuse("equations", "--json prints all; leave out --latex, --blocks, --coefficients, --csv and --out")
    if out and (latex or coefficients or csv or at):
        refuse("equations", "--out writes what its suffix says; leave out --latex, --coefficients, --csv and --at")
    check_out(out, mechanism, FORMATS)
    m = loaded(mechanism)
    s = solved_at(m, at) if at else None
    f = mg.formulate(s.mechanism if s else m, bookkeeping, unknowns=unknowns)
    if json:
        write_json("equations", equations_data(f, s))
    elif out is not None:
        f.write(out, components=not blocks)
        write(f"Wrote {out}: {len(f.unknowns)} unknowns, {len(f.equations)} equations.\n")
    elif csv or coefficients or at:
        table = f.coefficients(s.state() if s else None)
        names = "" if csv or not at else "".join(f"u({i}): {u.name}\n" for i, u in enumerate(f.unknowns, 1))
        write(names + (table.csv() if csv else table.text()))
    elif latex:
        write(f.latex(components=not blocks))
    else:
        show(f.document(components=not blocks))
