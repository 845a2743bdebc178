"""Commands whose answer can be drawn: ``plot`` (pictures and films), ``report``, ``assemblies``, ``branches``."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import mechgraph as mg
from mechgraph import show as pictures
from mechgraph.cli import options as opt
from mechgraph.cli import records
from mechgraph.errors import counted
from mechgraph.files import PAGES, formats_text
from mechgraph.show.skeleton import FORMATS as FILMS
from mechgraph.show.skeleton import PICTURES


@dataclass(frozen=True)
class _PictureOptions:
    """What was asked for beside the kind of picture."""

    of: tuple[str, ...]
    over: str | None
    position: int | None
    forces: bool
    moment: bool

    def one(self, what: str) -> str:
        """The one name that a picture needs."""
        if len(self.of) != 1:
            opt.refuse(what, "needs the name of one pair: --of A")
        return self.of[0]


@dataclass(frozen=True)
class _Picture:
    """A kind of picture: whether it needs a motion, with forces, and how it is drawn."""

    draw: Callable[[Any, _PictureOptions], Any]
    moves: bool = True
    forces: bool = False


KINDS: dict[str, _Picture] = {
    "skeleton": _Picture(lambda s, a: pictures.draw_skeleton(s, a.position, forces=a.forces, highlight=a.of)),
    "graph": _Picture(lambda m, a: pictures.draw_graph(m), moves=False),
    "structure": _Picture(lambda m, a: pictures.draw_structure(m), moves=False),
    "groups": _Picture(lambda m, a: pictures.draw_structure(m, groups=mg.groups(m)), moves=False),
    "equations": _Picture(lambda m, a: pictures.draw_sparsity(mg.formulate(m)), moves=False),
    "efforts": _Picture(lambda s, a: pictures.effort_curve(s, a.of or None, over=a.over), forces=True),
    "reaction": _Picture(
        lambda s, a: pictures.reaction_curve(s, a.one("reaction"), moment=a.moment, over=a.over), forces=True
    ),
    "ranges": _Picture(lambda s, a: pictures.reaction_ranges(s, moment=a.moment), forces=True),
    "polar": _Picture(lambda s, a: pictures.polar_force(s, a.one("polar")), forces=True),
    "path": _Picture(lambda s, a: pictures.point_path(s, a.of or None)),
    "hodograph": _Picture(lambda s, a: pictures.hodograph(s, a.of or None)),
    "margin": _Picture(lambda s, a: pictures.margin_curve(s, over=a.over)),
}


def _kinds(incomplete: str) -> list[str]:
    return [kind for kind in KINDS if kind.startswith(incomplete)]


PICTURE = (
    f"The file; {opt.SELECTS} {formats_text(PICTURES)}, of a skeleton also {formats_text(FILMS[:2])}. "
    "Left out, NAME.png here."
)


def plot(
    mechanism: opt.Named,
    what: Annotated[
        str, typer.Argument(metavar="WHAT", autocompletion=_kinds, help=f"What is drawn: {', '.join(KINDS)}.")
    ] = "skeleton",
    out: Annotated[Path | None, opt.option("--out", PICTURE, "FILE")] = None,
    of: Annotated[
        opt.Texts,
        opt.option(
            "--of", "The pair, freedom or point that is shown (repeat); of a skeleton pairs to highlight.", "NAME"
        ),
    ] = None,
    over: Annotated[
        str | None, opt.option("--over", "Abscissa: a freedom, t, or position. Default: the first driver.", "FREEDOM")
    ] = None,
    position: Annotated[
        int | None, opt.option("--position", "Number of the position that a skeleton shows. Default: the first solved.")
    ] = None,
    frames: Annotated[
        int | None,
        typer.Option("--frames", min=1, help="Frames of an animation. Default: one per position, at most 72."),
    ] = None,
    forces: Annotated[bool, typer.Option("--forces", help="Reaction forces as arrows in a skeleton.")] = False,
    moment: Annotated[bool, typer.Option("--moment", help="Moments rather than forces of reactions.")] = False,
    drive: opt.Drives = None,
    actuate: opt.Actuate = None,
    on_reach: opt.OnReach = "raise",
    tol: opt.Tolerance = None,
    json: opt.AsJson = False,
) -> None:
    """Draw a figure or an animation.

    Example: mechgraph plot four-bar reaction --of B --out B.svg

    Exit status: 0 done; 1 the mechanism has no answer (the message says why); 2 wrong usage or bad input. A file is written whole or not
    at all.
    """
    if what not in KINDS:
        opt.refuse(f"WHAT {what!r}", f"expected one of {', '.join(KINDS)}")
    kind, m = KINDS[what], opt.loaded(mechanism)
    target = Path(f"{Path(mechanism).stem}.png") if out is None else out
    film = what == "skeleton" and (
        frames is not None or target.suffix.lower() in (s for one in FILMS[:2] for s in one.suffixes)
    )
    opt.check_out(target, mechanism, FILMS if film else PICTURES)
    asked = _PictureOptions(tuple(of or ()), over, position, forces, moment)
    still = what == "skeleton" and not (film or drive or any(d.motion is not None for d in m.drives))
    moves = kind.moves and not still
    motions = (opt.motions_of if moves else opt.drives_of)(m, drive or ())
    with opt.working(f"drawing {m.name}"):
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
            pictures.save_picture(kind.draw(drawn, asked), target)
    if film:
        count = frames or min(int((np.asarray(drawn.status) == "ok").sum()), 72)
        with opt.progress(f"drawing {m.name}", count) as reached:
            each = None if reached is None else lambda done, of_all: reached(done)
            pictures.animate(drawn, target, frames=frames, forces=forces, progress=each)
    records.tell_file("plot", records.PlotData(m.name, what, str(target)), json)


def report(
    mechanism: opt.Named,
    out: Annotated[Path, opt.option("--out -o", "The page: one file, without network.", "FILE.html")],
    drive: opt.Drives = None,
    actuate: opt.Actuate = None,
    method: opt.Method = "loop_wrench",
    redundant: opt.Redundant = "nan",
    on_reach: opt.OnReach = "flag",
    engine: opt.Engine = "auto",
    tol: opt.Tolerance = None,
    json: opt.AsJson = False,
) -> None:
    """Write a self-contained HTML report: verdict, determinacy report, the mechanism in space, curves, tables, equations.

    Without --drive the stored motion is solved, where all drivers store one; else the page shows the mechanism as it stands.

    Exit status: 0 done; 1 the loops cannot be closed for a motion, a freedom is neither driven nor passive, drivers contradict each
    other, or a position cannot be reached (the page says what there is); 2 wrong usage or bad input. The file is written whole or not
    at all.

    Example: mechgraph report four-bar -o four-bar.html
    """
    opt.check_out(out, mechanism, PAGES)
    m = opt.loaded(mechanism)
    motions = opt.drives_of(m, drive or ())
    stored = bool(m.drives) and all(d.motion is not None for d in m.drives)
    s, failure = None, None
    with opt.working(f"writing the page of {m.name}"), warnings.catch_warnings():
        warnings.simplefilter("ignore", mg.MechgraphWarning)  # the page has them
        if motions or actuate or stored:
            how: dict[str, Any] = {"method": method, "redundant": redundant, "on_reach": on_reach, "engine": engine}
            try:
                s = mg.solve(m, motions or None, actuate=actuate, tol=tol, **how)
            except opt.NO_ANSWERS as error:
                failure, s = error, getattr(error, "solution", None)
        mg.write_report(m, s, path=out)
    more = f": {out.stat().st_size / 1e6:.2f} MB{_hint(m, s, failure)}"
    records.tell_file("report", records.FileData(m.name, str(out)), json, more)
    if failure is not None:
        raise failure
    if s is not None and not (np.asarray(s.status) == "ok").any():
        raise typer.Exit(opt.NO_ANSWER)


def _hint(m: mg.Mechanism, s: mg.Solution | None, failure: Exception | None) -> str:
    """What a page lacks, and the option that would show it."""
    if failure is not None:
        return ""
    if s is not None:
        status = np.asarray(s.status)
        lost = Counter(str(one) for one in status[status != "ok"])
        return "".join(
            f". {counted(n, 'position')} of {status.size} not solved: status '{why}'" for why, n in lost.items()
        )
    report = mg.check(m)
    if not report.mobility:
        return ""
    still = [d.freedom for d in m.drives if d.motion is None] or list(report.suggested_drives)
    return f". It shows the start position; for motion and forces add {opt.drive_example(m, still)}" if still else ""


Picture = Annotated[Path | None, opt.file_option("Also plot them; ", PICTURES)]


def assemblies(mechanism: opt.Named, at: opt.At = None, out: Picture = None, json: opt.AsJson = False) -> None:
    """Find all real assemblies with drivers at given values, and report whether the list is complete.

    Declared drives stay at their start, those that --at does not name as well.

    Example: mechgraph assemblies four-bar --at A=30deg

    Exit status: 0 done; 1 where there is no real assembly; 2 wrong usage or bad input.
    """
    opt.check_out(out, mechanism, PICTURES)
    m = opt.loaded(mechanism)
    at_start = {m.full_name(d.freedom): m.start.get(m.full_name(d.freedom), 0.0) for d in m.drives}
    values = {m.full_name(name): value for name, value in (opt.values_of(m, at) or {}).items()}
    if values.keys() <= at_start.keys():
        values = at_start | values
    with opt.working(f"assemblies of {m.name}"):
        found = mg.assemblies(m, values)
        figure = found.plot() if out is not None and len(found) else None
    _tell("assemblies", found, figure, out, json)
    if not len(found):
        raise typer.Exit(opt.NO_ANSWER)


def branches(
    mechanism: opt.Named,
    driver: Annotated[
        str | None,
        opt.option("--driver", "The driver. Default: the first declared drive.", "FREEDOM", opt.freedoms),
    ] = None,
    output: Annotated[str | None, opt.option("--output", "What a picture shows over the driver.", "FREEDOM")] = None,
    out: Picture = None,
    json: opt.AsJson = False,
) -> None:
    """Follow every assembly over the range of a driver: branches, folds, circuits, full turns.

    Example: mechgraph branches rssr --driver A --out rssr.svg

    Exit status: 0 done; 1 where there is no branch; 2 wrong usage or bad input.
    """
    opt.check_out(out, mechanism, PICTURES)
    m = opt.loaded(mechanism)
    name = driver if driver is not None else next((d.freedom for d in m.drives), "")
    with opt.working(f"branches of {m.name}"):
        found = mg.branches(m, name)
        figure = found.plot(output).figure if out is not None and len(found) else None
    _tell("branches", found, figure, out, json)
    if not len(found):
        raise typer.Exit(opt.NO_ANSWER)


def _tell(command: str, found: Any, figure: Any, out: Path | None, json: bool) -> None:
    """What was found, as a table or a record, and the picture."""
    drawn = None if figure is None or out is None else out
    if drawn is not None:
        pictures.save_picture(figure, drawn)
    if json:
        records.write_json(command, found.data, file=None if drawn is None else str(drawn))
        return
    opt.show(found.document())
    if drawn is not None:
        opt.write(f"\nWrote {drawn}.\n")
