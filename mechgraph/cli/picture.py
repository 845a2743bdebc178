"""``mechgraph plot``: pictures and films."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import mechgraph as mg
from mechgraph import show
from mechgraph.cli.options import Actuate, AsJson, Drives, Named, OnReach, Tolerance
from mechgraph.cli.output import progress, working, write
from mechgraph.cli.reading import loaded, refuse_own_file
from mechgraph.cli.records import PlotData, write_json
from mechgraph.show.animation import FORMATS as FILMS
from mechgraph.show.animation import PICTURES
from mechgraph.typed import drives_of, motions_of, refuse
from mechgraph.writing import format_of, formats_text


@dataclass(frozen=True)
class _Asked:
    """What was asked for beside the kind of picture."""

    of: tuple[str, ...]
    over: str | None
    position: int
    forces: bool
    moment: bool

    def one(self, what: str) -> str:
        """The one name that a picture needs."""
        if len(self.of) != 1:
            refuse(what, "needs the name of one pair: --of A")
        return self.of[0]


@dataclass(frozen=True)
class _Picture:
    """A kind of picture: whether it needs a motion, with forces, and how it is drawn."""

    draw: Callable[[Any, _Asked], Any]
    moves: bool = True
    forces: bool = False


KINDS: dict[str, _Picture] = {
    "skeleton": _Picture(lambda s, a: show.draw_skeleton(s, a.position, forces=a.forces, highlight=a.of)),
    "graph": _Picture(lambda m, a: show.draw_graph(m), moves=False),
    "structure": _Picture(lambda m, a: show.draw_structure(m), moves=False),
    "groups": _Picture(lambda m, a: show.draw_structure(m, groups=mg.groups(m)), moves=False),
    "equations": _Picture(lambda m, a: show.draw_sparsity(mg.formulate(m)), moves=False),
    "efforts": _Picture(lambda s, a: show.effort_curve(s, a.of or None, over=a.over), forces=True),
    "reaction": _Picture(
        lambda s, a: show.reaction_curve(s, a.one("reaction"), moment=a.moment, over=a.over), forces=True
    ),
    "ranges": _Picture(lambda s, a: show.reaction_ranges(s, moment=a.moment), forces=True),
    "polar": _Picture(lambda s, a: show.polar_force(s, a.one("polar")), forces=True),
    "path": _Picture(lambda s, a: show.point_path(s, a.of or None)),
    "hodograph": _Picture(lambda s, a: show.hodograph(s, a.of or None)),
    "margin": _Picture(lambda s, a: show.margin_curve(s, over=a.over)),
}


def _kinds(incomplete: str) -> list[str]:
    return [kind for kind in KINDS if kind.startswith(incomplete)]


def plot(
    mechanism: Named,
    what: Annotated[
        str, typer.Argument(metavar="WHAT", autocompletion=_kinds, help=f"What is drawn: {', '.join(KINDS)}.")
    ] = "skeleton",
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help=f"The file; the suffix says how: {formats_text(PICTURES)}, of a skeleton also {formats_text(FILMS[:2])}. "
            "Left out, NAME.png here.",
        ),
    ] = None,
    of: Annotated[
        list[str] | None,
        typer.Option(
            "--of",
            metavar="NAME",
            help="The pair, freedom or point that is shown (repeat); of a skeleton pairs to highlight.",
        ),
    ] = None,
    over: Annotated[
        str | None,
        typer.Option(
            "--over",
            metavar="FREEDOM",
            help="What curves are drawn over: a freedom, t, or position; the first driver without it.",
        ),
    ] = None,
    position: Annotated[int, typer.Option("--position", help="Number of the position that a skeleton shows.")] = 0,
    frames: Annotated[
        int | None, typer.Option("--frames", min=1, help="Frames of a film; without it one a position, at most 72.")
    ] = None,
    forces: Annotated[bool, typer.Option("--forces", help="Reaction forces as arrows in a skeleton.")] = False,
    moment: Annotated[bool, typer.Option("--moment", help="Moments rather than forces of reactions.")] = False,
    drive: Drives = None,
    actuate: Actuate = None,
    on_reach: OnReach = "raise",
    tol: Tolerance = None,
    json: AsJson = False,
) -> None:
    """Draw a picture, or a film of the skeleton.

    Example: mechgraph plot four-bar reaction --of B --out B.svg

    Exit status: 0 done; 1 the mechanism has no answer (the message says why); 2 wrong usage or bad input. A file is written whole or not
    at all.
    """
    if what not in KINDS:
        refuse(f"WHAT {what!r}", f"expected one of {', '.join(KINDS)}")
    kind, m = KINDS[what], loaded(mechanism)
    target = Path(f"{Path(mechanism).stem}.png") if out is None else out
    film = what == "skeleton" and (
        frames is not None or target.suffix.lower() in (s for one in FILMS[:2] for s in one.suffixes)
    )
    refuse_own_file(target, mechanism)
    format_of(target, FILMS if film else PICTURES)
    asked = _Asked(tuple(of or ()), over, position, forces, moment)
    still = what == "skeleton" and not (film or drive or any(d.motion is not None for d in m.drives))
    moves = kind.moves and not still
    motions = (motions_of if moves else drives_of)(m, drive or ())
    with working(f"drawing {m.name}"):
        drawn: Any = m
        if moves:
            how: dict[str, Any] = {"on_reach": on_reach, "tol": tol}
            needs = kind.forces or forces
            drawn = (
                mg.solve(m, motions or None, actuate=actuate, **how)
                if needs
                else mg.kinematics(m, motions or None, **how)
            )
        if not film:
            show.save_picture(kind.draw(drawn, asked), target)
    if film:
        count = frames or min(int((np.asarray(drawn.status) == "ok").sum()), 72)
        with progress(f"drawing {m.name}", count) as reached:
            each = None if reached is None else lambda done, of_all: reached(done)
            show.animate(drawn, target, frames=frames, forces=forces, progress=each)
    if json:
        write_json("plot", PlotData(m.name, what, str(target)))
    else:
        write(f"Wrote {target}.\n")
