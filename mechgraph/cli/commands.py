"""The commands: from ``list`` and ``check`` to ``compile``, and those whose answer can be drawn, from ``plot`` to ``branches``."""

from __future__ import annotations

import re
import warnings
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import typer

import mechgraph as mg
from mechgraph import show as pictures
from mechgraph.cli import options as opt
from mechgraph.cli import records
from mechgraph.compiled.fmu import WRITTEN, InputsName, write_tables
from mechgraph.compiled.tabled import tabled
from mechgraph.document import Document, Table
from mechgraph.equations.formulation import FORMATS as WRITINGS
from mechgraph.errors import counted
from mechgraph.exchange.files import WRITERS
from mechgraph.files import PAGES, formats_text
from mechgraph.memo import dataclass
from mechgraph.result.free_body import FORMATS as LOAD_FILES
from mechgraph.result.solution import FORMATS
from mechgraph.show.skeleton import FORMATS as FILMS
from mechgraph.show.skeleton import PICTURES


def list_library(json: opt.AsJson = False) -> None:
    """List the library mechanisms.

    Example: mechgraph list --json
    """
    found = {name: mg.load(name) for name in mg.library()}
    if json:
        items = [
            records.LibraryItem(name, m.description, m.link_names(), {p.name: p.type.symbol for p in m.pairs})
            for name, m in found.items()
        ]
        records.write_json("list", records.ListData(tuple(items)))
        return
    rows = [(name, " ".join(p.type.symbol for p in m.pairs), m.description) for name, m in found.items()]
    opt.show(Document("", (Table(("name", "pairs", "description"), tuple(rows)),)))


def save(
    mechanism: opt.Named,
    out: Annotated[
        Path,
        opt.file_option("The file; ", WRITERS),
    ],
    advice: Annotated[
        int | None, opt.option("--advice", "Apply recommendation NUMBER of 'check' (from 0).", "NUMBER")
    ] = None,
    json: opt.AsJson = False,
) -> None:
    """Write a mechanism as another file: TOML, which holds all of it, or what other programs read.

    Example: mechgraph save four-bar --advice 0 --out better.toml

    Exit status: 0 success; 1 it cannot be assembled, where the file holds it at its start; 2 usage or input error.
    """
    opt.check_out(out, mechanism, WRITERS)
    m = opt.loaded(mechanism)
    if advice is not None:
        known = mg.check(m).advice
        if not 0 <= advice < len(known):
            opt.refuse(
                f"--advice {advice}", f"there are {len(known)}, counted from 0: mechgraph check {mechanism} --json"
            )
        m = known[advice].apply()
    mg.save(m, out)
    records.tell_file("save", records.FileData(m.name, str(out)), json)


def check(
    mechanism: opt.Named,
    json: opt.AsJson = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="The report as Markdown.")] = False,
    full: Annotated[
        bool, typer.Option("--full", help="The whole report: every pair, self-stress, loop and count.")
    ] = False,
    at: opt.At = None,
    engine: opt.Engine = "auto",
    compared: opt.Compare = False,
    tol: opt.Tolerance = None,
    limit: Annotated[
        str | None,
        opt.option(
            "--limit", "Time for each search of the report, default 20s; the report lists unfinished searches.", "TIME"
        ),
    ] = None,
) -> None:
    """Print the determinacy report: verdict, recommended changes, determinacy. --full prints everything.

    Example: mechgraph check four-bar --at A=30deg --full

    Exit status: 0 where forces can be solved; 1 where the loops cannot be closed, drivers depend on each other or have nothing
    to move, or a freedom is neither driven nor passive. Redundancy is information: a mechanism some of whose reactions are not
    unique has exit status 0, and so has a topology without geometry. 2 usage or input error.
    """
    if json + markdown + compared > 1:
        opt.refuse("check", "--json, --markdown and --compare exclude each other")
    m = opt.loaded(mechanism)
    values = opt.values_of(m, at)
    bounded: dict[str, Any] = {} if limit is None else {"limit": opt.longest(limit, "--limit")}
    with opt.working(f"checking {m.name}: what can move"):
        report = mg.check(m, at=values, engine=engine, tol=tol, **bounded)
    with opt.working(f"checking {m.name}: what is unique, what to do"):
        data = records.check_data(m, report) if json else {}
        text = report.to_markdown(full) if markdown else ""
        document = report.document(full)
    not_closed = m.has_geometry and report.mobility is None
    bearing = any(p.load_bearing for p in report.passive)
    unsolvable = not_closed or report.undriven or report.contradicting_drives
    doubtful = report.near or bearing or not report.determinate
    if json:
        records.write_json("check", data)
    elif text:
        opt.write(text)
    else:
        opt.show(document, "red" if unsolvable else "yellow" if doubtful else "green")
    if compared:
        opt.show_compared(mechanism)
    if unsolvable:
        raise typer.Exit(opt.NO_ANSWER)


def structure(
    mechanism: opt.Named,
    driver: opt.Drivers = None,
    at: opt.At = None,
    engine: opt.Engine = "auto",
    tol: opt.Tolerance = None,
    json: opt.AsJson = False,
) -> None:
    """Print the structure as the textbooks tell it: kinematic chain, mobility table and families, structural groups.

    Example: mechgraph structure windows-2 --driver A1

    Exit status: 0 success; 1 where the drivers leave links undetermined, or the loops cannot be closed; 2 usage or input error.
    """
    m = opt.loaded(mechanism)
    values = opt.values_of(m, at)
    with opt.working(f"structure of {m.name}"):
        found = mg.structure(m, driver or None, at=values, engine=engine, tol=tol)
        data = records.structure_data(found) if json else None
        document = found.document()
    if data:
        records.write_json("structure", data)
    else:
        opt.show(document)
    if found.groups.free:
        raise typer.Exit(opt.NO_ANSWER)


def solved_at(m: mg.Mechanism, at: list[str]) -> mg.Solution:
    """The one position that is named, with its rates."""
    motions = opt.drives_of(m, at, "--at")
    if any(np.ndim(motion.position) for motion in motions.values()):
        opt.refuse("--at", "expected one position, e.g. A=30deg@10")
    with opt.working("solving"):
        return mg.solve(m, motions)


def equations(
    mechanism: opt.Named,
    latex: Annotated[bool, typer.Option("--latex", help="As LaTeX.")] = False,
    bookkeeping: opt.Bookkeeping = "lee",
    blocks: Annotated[bool, typer.Option("--blocks", help="Vector equations only, without their components.")] = False,
    coefficients: Annotated[bool, typer.Option("--coefficients", help="The table of nonzero coefficients.")] = False,
    csv: Annotated[bool, typer.Option("--csv", help="The table of nonzero coefficients as CSV.")] = False,
    unknowns: Annotated[
        Literal["kinetostatics", "response"],
        typer.Option(help="Unknowns: forces for a given motion, or accelerations and reactions."),
    ] = "kinetostatics",
    at: opt.EquationsAt = None,
    out: Annotated[
        Path | None,
        opt.option("--out", f"Write them; {opt.SELECTS} {formats_text(WRITINGS)}, the first compiles.", "FILE"),
    ] = None,
    json: opt.AsJson = False,
) -> None:
    """Print the closure equations, the d'Alembert equations of every link and the conditions of the pairs; needs no geometry.

    With --at the coefficients {Q}, the right sides {C} and the unknowns {u} with numbers, at one position.

    Example: mechgraph equations rcsr --at O1=160deg@0.1

    Exit status: 0 success; 1 the mechanism has no such position; 2 usage or input error.
    """
    if (latex or blocks) and (coefficients or csv):
        opt.refuse(
            "equations", "--coefficients and --csv print a table, --latex and --blocks equations; take one of them"
        )
    if at and (latex or blocks):
        opt.refuse("equations", "--at prints a table of numbers, --latex and --blocks equations; take one of them")
    if json and (latex or blocks or coefficients or csv or out):
        opt.refuse("equations", "--json prints all; leave out --latex, --blocks, --coefficients, --csv and --out")
    if out and (latex or coefficients or csv or at):
        opt.refuse(
            "equations", "--out selects the format by its extension; leave out --latex, --coefficients, --csv and --at"
        )
    opt.check_out(out, mechanism, WRITINGS)
    m = opt.loaded(mechanism)
    s = solved_at(m, at) if at else None
    f = mg.formulate(s.mechanism if s else m, bookkeeping, unknowns=unknowns)
    if json:
        records.write_json("equations", records.equations_data(f, s))
    elif out is not None:
        f.write(out, components=not blocks)
        opt.write(f"Wrote {out}: {len(f.unknowns)} unknowns, {len(f.equations)} equations.\n")
    elif csv or coefficients or at:
        table = f.coefficients(s.state() if s else None)
        names = "" if csv or not at else "".join(f"u({i}): {u.name}\n" for i, u in enumerate(f.unknowns, 1))
        opt.write(names + (table.csv() if csv else table.text()))
    elif latex:
        opt.write(f.latex(components=not blocks))
    else:
        opt.show(f.document(components=not blocks))


Told = list[Document] | dict[str, Any]
"""Documents to be shown, or a record."""


def solve(
    mechanism: opt.Named,
    drive: opt.Drives = None,
    actuate: opt.Actuate = None,
    friction: opt.Dry = None,
    out: opt.Out = None,
    include: opt.Include = None,
    method: opt.Method = "loop_wrench",
    redundant: opt.Redundant = "nan",
    on_reach: opt.OnReach = "raise",
    engine: opt.MotionEngine = "auto",
    transmission: opt.Outputs = None,
    compared: opt.Compare = False,
    tol: opt.Tolerance = None,
    over_time: opt.OverTime = False,
    json: opt.AsJson = False,
) -> None:
    """Solve motion, driver torques and reactions; print a summary and write a table.

    Example: mechgraph solve 7r --drive O1=0:360:5deg@10 --out 7r.csv

    Exit status: 0 success; 1 the loops cannot be closed, a position is out of reach or a dead point (unless flagged and others were
    solved), a freedom is neither driven nor passive, or drivers contradict each other; 2 usage or input error. Files are
    written atomically.
    """
    if json and compared:
        opt.refuse("solve", "--json and --compare exclude each other")
    opt.check_out(out, mechanism, FORMATS)
    m = opt.loaded(mechanism, friction)
    motions = opt.motions_of(m, drive or ())
    with opt.progress(f"solving {m.name}") as moved, warnings.catch_warnings():
        warnings.simplefilter("ignore", mg.MechgraphWarning)  # the summary has them
        how: dict[str, Any] = {"method": method, "redundant": redundant, "on_reach": on_reach, "engine": engine}
        s = mg.solve(m, motions or None, actuate=actuate, tol=tol, progress=moved, **how)
    with opt.working(f"summary of {m.name}"):
        told, written = _told(s, out, tuple(include or ()), json, over_time)
        angles = [mg.transmission(s, name) for name in transmission or ()]
        if isinstance(told, dict):
            told |= {"transmission": [found.to_dict() for found in angles]}
        else:
            told += [found.document() for found in angles]
    _tell("solve", told, written)
    if compared:
        opt.show_compared(mechanism)
    if not (np.asarray(s.status) == "ok").any():
        raise typer.Exit(opt.NO_ANSWER)


def _told(
    s: mg.Solution, out: Path | None, include: tuple[Any, ...], json: bool, over_time: bool
) -> tuple[Told, records.Written | None]:
    """What is told of a solution, and the file that was written."""
    figures = mg.over_time(s) if over_time else None
    told: Told = [s.document(asked=True), *([figures.document()] if figures else [])]
    if json:
        told = s.to_dict() | {"over_time": figures and figures.to_dict()}
    if out is None:
        return told, None
    s.write(out, include)
    return told, records.Written(str(out), s.status.size, len(s.part(slice(1)).columns(include)))


def _tell(command: str, told: Told, written: records.Written | None) -> None:
    if isinstance(told, dict):
        records.write_json(command, told, written=written)
        return
    for place, document in enumerate(told):
        opt.write("\n" * bool(place))
        opt.show(document)
    if written is not None:
        opt.write(f"\nWrote {written.file}: {written.rows} rows, {written.columns} columns.\n")


def respond(
    mechanism: opt.Named,
    span: Annotated[
        str | None, opt.option("--for", "Duration, e.g. 10s. Default: [response] of the file.", "TIME")
    ] = None,
    start: Annotated[opt.Texts, opt.option("--start", "Coordinate at the beginning (repeat).", "FREEDOM=VALUE")] = None,
    rate: Annotated[
        opt.Texts,
        opt.option("--rate", "Rate at the beginning: A=2, A=90deg a unit of time (repeat).", "FREEDOM=VALUE"),
    ] = None,
    points: Annotated[
        int | None,
        typer.Option("--points", min=2, help="Number of evenly spread output times. Default: the steps taken."),
    ] = None,
    out: opt.Out = None,
    include: opt.Include = None,
    method: Annotated[
        Literal["auto", "RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA"] | None,
        typer.Option(help="Stepper of scipy; Radau for stiff loads."),
    ] = None,
    rtol: Annotated[float | None, opt.option("--rtol", "Relative tolerance of a step. Default: 1e-8.")] = None,
    atol: Annotated[
        float | None,
        opt.option("--atol", "Absolute tolerance (radians, lengths / L, and their rates). Default: 1e-10."),
    ] = None,
    max_step: Annotated[
        str | None, opt.option("--max-step", "Longest step, e.g. 5ms. Default: as the tolerances allow.", "TIME")
    ] = None,
    passive: Annotated[
        Literal["free", "held"] | None, typer.Option(help="Whether passive freedoms move freely, or are held at rest.")
    ] = None,
    friction: opt.Dry = None,
    engine: opt.MotionEngine = "auto",
    over_time: opt.OverTime = False,
    json: opt.AsJson = False,
) -> None:
    """Simulate the motion under loads: print a summary with the energy balance, write a table.

    What is left out is that of [response] of the file, where it has one.

    Example: mechgraph respond windows-2 --for 500ms --rate A0=-1

    Exit status: 0 success; 1 the loops cannot be closed, or the motion cannot be followed to its end (what there is is written); 2 usage
    or input error. Ctrl-C keeps what was computed. Files are written atomically.
    """
    opt.check_out(out, mechanism, FORMATS)
    m = opt.loaded(mechanism, friction)
    begin = opt.values_of(m, start, "--start")
    rates = opt.values_of(m, rate, "--rate")
    declared = m.units.get("time", "s")
    if span is not None:
        times = np.array([0.0, opt.duration(span, "--for", declared)])
    elif m.response is not None:
        times = m.response.times
    else:
        opt.refuse("respond", "how long? Give --for TIME; the mechanism has no [response] that says it")
    given = {m.full_name(d.freedom) for d in (m.response.motions if m.response else ())}
    still = [d.freedom for d in m.drives if isinstance(d.motion, mg.Motion) and d.motion.t is None]
    if still := [name for name in still if m.full_name(name) not in given]:
        opt.refuse(
            "respond",
            f"the stored motion of {', '.join(still)} has no times; add t = [...], a time for each position, to its [drive.motion] in "
            "the file, or leave that out: the freedom then moves as the loads drive it",
        )
    longest_step = None if max_step is None else opt.longest(max_step, "--max-step", declared)
    t = np.linspace(times[0], times[-1], points) if points else times
    with opt.progress(f"moving {m.name}", float(times[-1])) as moved, warnings.catch_warnings():
        warnings.simplefilter("ignore", mg.MechgraphWarning)  # the summary has them
        r = mg.respond(
            m, t, start=begin, rates=rates, rtol=rtol, atol=atol, method=method, passive=passive, engine=engine,
            max_step=longest_step, on_stop="return", progress=moved,
        )  # fmt: skip
    with opt.working(f"summary of {m.name}"):
        told = _told(r, out, tuple(include or ()), json, over_time)
    _tell("respond", *told)
    if r.stopped:
        opt.fail(r.stopped, opt.NO_ANSWER)


def loads(
    mechanism: opt.Named,
    link: Annotated[str, typer.Argument(metavar="LINK", help="The link.")],
    drive: opt.Drives = None,
    actuate: opt.Actuate = None,
    out: Annotated[Path | None, opt.file_option("Write the loads; ", LOAD_FILES)] = None,
    at: Annotated[
        str, opt.option("--at", "'worst', 'all', or the number of a position, from 0.", "POSITIONS")
    ] = "worst",
    model: Annotated[str, opt.option("--model", "Deck: file with mesh and couplings, to be included.")] = "",
    held: Annotated[
        str, opt.option("--held", "Deck: what acts where your model is held, e.g. a pair; a reaction there.")
    ] = "",
    couples: Annotated[float | None, opt.option("--couples", "Deck: moments as two forces at this distance.")] = None,
    inertia: Annotated[
        Literal["wrench", "acceleration"] | None,
        opt.option("--inertia", "Deck: inertia as a force and couple on a node (wrench), or as loads of the elements."),
    ] = None,
    redundant: opt.Redundant = "nan",
    on_reach: opt.OnReach = "raise",
    engine: opt.Engine = "auto",
    tol: opt.Tolerance = None,
    json: opt.AsJson = False,
) -> None:
    """Print the loads on a link in its own frame; write a table or an FE input deck.

    Example: mechgraph loads 7r link3 --drive O1=0:360:5deg@10 --at all

    Exit status: 0 success; 1 as for solve; 2 usage or input error, or something that is not unique would have to be written as known.
    """
    opt.check_out(out, mechanism, LOAD_FILES)
    m = opt.loaded(mechanism)
    if at not in ("worst", "all") and not re.fullmatch(r"-?\d+", at):
        opt.refuse(f"--at {at!r}", "expected worst, all, or the number of a position, from 0")
    places: Any = at if at in ("worst", "all") else int(at)
    options = {"model": model, "held": held, "couples": couples, "inertia": inertia}
    m.place_of_link(link)
    motions = opt.motions_of(m, drive or ()) or None
    with opt.working(f"solving {m.name}"):
        s = mg.solve(m, motions, actuate=actuate, redundant=redundant, on_reach=on_reach, engine=engine, tol=tol)
        body = mg.free_body(s, link)
        document = body.document(places)
        if out is not None:
            body.write(out, places, **{name: value for name, value in options.items() if value})
    if json:
        records.write_json("loads", records.loads_data(body, places, None if out is None else str(out)))
        return
    opt.show(document)
    if out is not None:
        opt.write(f"\nWrote {out}: {len(body.cases(places))} positions.\n")


def compile_(
    mechanism: opt.Named,
    out: Annotated[Path, opt.option("--out -o", f"{opt.SELECTS.capitalize()} {formats_text(WRITTEN)}.", "FILE")],
    name: Annotated[
        str | None, opt.option("--name", "Prefix of the symbols. Default: the name of the file.", "NAME")
    ] = None,
    inputs: Annotated[
        InputsName,
        opt.option("--inputs", "Inputs: motion of the drives, or their efforts (then the motion is integrated)."),
    ] = "motion",
    json: opt.AsJson = False,
) -> None:
    """Write a mechanism as C99 that runs by itself, for a controller, or as a unit for co-simulation (FMI 2.0).

    The C needs no compiler here: positions, efforts of the drives and reactions by the equations that 'mechgraph equations' prints.

    Exit status: 0 success; 1 the loops cannot be closed, or a freedom is neither driven nor passive; 2 usage or input error, or the
    kernel does not carry the mechanism.

    Example: mechgraph compile four-bar --out press.c
    """
    opt.check_out(out, mechanism, WRITTEN)
    m = opt.loaded(mechanism)
    with opt.working(f"compiling {m.name}"):
        write_tables(tabled(m), out, name, inputs)
    records.tell_file("compile", records.FileData(m.name, str(out)), json)


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
    "losses": _Picture(lambda s, a: pictures.friction_losses(s), forces=True),
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
    friction: opt.Dry = None,
    on_reach: opt.OnReach = "raise",
    tol: opt.Tolerance = None,
    json: opt.AsJson = False,
) -> None:
    """Draw a figure or an animation.

    Example: mechgraph plot four-bar reaction --of B --out B.svg

    Exit status: 0 success; 1 no solution (see message); 2 usage or input error. Files are written atomically.
    """
    if what not in KINDS:
        opt.refuse(f"WHAT {what!r}", f"expected one of {', '.join(KINDS)}")
    kind, m = KINDS[what], opt.loaded(mechanism, friction)
    target = Path(f"{Path(mechanism).stem}.png") if out is None else out
    films = FILMS[:2] if what == "skeleton" else ()
    film = what == "skeleton" and (
        frames is not None or target.suffix.lower() in (s for one in films for s in one.suffixes)
    )
    opt.check_out(target, mechanism, FILMS if film else (*PICTURES, *films))
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
    friction: opt.Dry = None,
    method: opt.Method = "loop_wrench",
    redundant: opt.Redundant = "nan",
    on_reach: opt.OnReach = "flag",
    engine: opt.Engine = "auto",
    tol: opt.Tolerance = None,
    json: opt.AsJson = False,
) -> None:
    """Write a self-contained HTML report: verdict, determinacy report, the mechanism in space, curves, tables, equations.

    Without --drive the stored motion is solved, where all drivers store one; else the page shows the mechanism as it stands.

    Exit status: 0 success; 1 the loops cannot be closed for a motion, a freedom is neither driven nor passive, drivers contradict each
    other, or a position cannot be reached (the page says what there is); 2 usage or input error. The file is written
    atomically.

    Example: mechgraph report four-bar -o four-bar.html
    """
    opt.check_out(out, mechanism, PAGES)
    m = opt.loaded(mechanism, friction)
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

    Exit status: 0 success; 1 where there is no real assembly; 2 usage or input error.
    """
    opt.check_out(out, mechanism, PICTURES)
    m = opt.loaded(mechanism)
    at_start = {m.full_name(d.freedom): m.start.get(m.full_name(d.freedom), 0.0) for d in m.drives}
    values = {m.full_name(name): value for name, value in (opt.values_of(m, at) or {}).items()}
    if values.keys() <= at_start.keys():
        values = at_start | values
    with opt.working(f"assemblies of {m.name}") as say:
        found = mg.assemblies(m, values, progress=say)
        figure = found.plot() if out is not None and len(found) else None
    _tell_found("assemblies", found, figure, out, json)
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

    Exit status: 0 success; 1 where there is no branch; 2 usage or input error.
    """
    opt.check_out(out, mechanism, PICTURES)
    m = opt.loaded(mechanism)
    name = driver if driver is not None else next((d.freedom for d in m.drives), "")
    with opt.working(f"branches of {m.name}"):
        found = mg.branches(m, name)
        figure = found.plot(output).figure if out is not None and len(found) else None
    _tell_found("branches", found, figure, out, json)
    if not len(found):
        raise typer.Exit(opt.NO_ANSWER)


def synthesize(
    mechanism: opt.Named,
    good: Annotated[bool, typer.Option("--good", help="Only mechanisms without defects.")] = False,
    rank: Annotated[
        Literal["transmission", "size", "ratio", "error"] | None,
        typer.Option(
            "--rank",
            help="What the best mechanism is best in. Default: good ones first, then transmission; of a sweep as found.",
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Write a mechanism as a TOML file.", metavar="FILE")] = None,
    solution: Annotated[
        int, typer.Option("--solution", help="Which one is written, counted from 0.", metavar="NUMBER", min=0)
    ] = 0,
    plot: Annotated[
        Path | None, opt.option("--plot", "Also plot them side by side; of a sweep center and circle points.", "FILE")
    ] = None,
    page: Annotated[Path | None, opt.option("--page", "Also write a page on which each can be played.", "FILE")] = None,
    json: opt.AsJson = False,
) -> None:
    """Find the mechanisms that do what [synthesis] of a file asks, and report whether the list is complete.

    Example: mechgraph synthesize function.toml --good --rank size --out best.toml

    Exit status: 0 success; 1 where no mechanism is left; 2 usage or input error.
    """
    opt.check_out(plot, mechanism, PICTURES)
    opt.check_out(page, mechanism, PAGES)
    if out is not None:
        opt.refuse_own_file(out, mechanism)
    m = opt.loaded(mechanism)
    if m.synthesis is None:
        opt.refuse("synthesize", "what is asked? The mechanism has no [synthesis] that says it")
    if m.synthesis.sweep and out is not None:
        opt.refuse("--out", "[synthesis] has a sweep; call mg.synthesize, and mg.save of one of its mechanisms s[k][i]")
    with opt.working(f"synthesis of {m.name}") as say:
        found = mg.synthesize(m, progress=say)
        found = found.good if good else found
        found = found if rank is None else found.ranked(rank)
        left = sum(map(len, found)) if m.synthesis.sweep else len(found)
        if left and not m.synthesis.sweep and solution >= left:
            there = f"there {'is' if left == 1 else 'are'} {counted(left, 'mechanism')}, counted from 0"
            opt.refuse("synthesize", f"--solution {solution}: {there}")
        figure = found.plot().figure if plot is not None and left else None
        if page is not None and left:
            mg.write_report(found, path=page)
    if out is not None and left:
        mg.save(found[solution], out)
    _tell_found("synthesize", found, figure, plot, json)
    if out is not None and left and not json:
        opt.write(f"\nWrote mechanism {solution} to {out}.\n")
    if page is not None and left and not json:
        opt.write(f"\nWrote {page}.\n")
    if not left:
        raise typer.Exit(opt.NO_ANSWER)


def _tell_found(command: str, found: Any, figure: Any, out: Path | None, json: bool) -> None:
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


app = opt.app
app.command("list")(list_library)
for command in (
    check,
    structure,
    equations,
    solve,
    respond,
    save,
    plot,
    loads,
    report,
    assemblies,
    branches,
    synthesize,
):
    app.command(command.__name__)(opt.in_plane(command))
app.command("compile")(opt.in_plane(compile_))
