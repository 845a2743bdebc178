"""The command line, for a mechanism of the library or a TOML file. The only module that prints."""

from __future__ import annotations

import difflib
import errno
import importlib.metadata
import os
import shutil
import sys
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress
from rich.text import Text
from typer.core import TyperGroup

import mechgraph as mg
from mechgraph.document import Document, Table, to_text
from mechgraph.errors import visible
from mechgraph.exchange.comparison import compare
from mechgraph.exchange.files import READERS
from mechgraph.result.summary import OK, driver_value, summary
from mechgraph.starting import INTERRUPTED
from mechgraph.typed import drives_of, duration, parse_at, refuse
from mechgraph.writing import writable

DONE, NO_ANSWER, BAD_INPUT = 0, 1, 2
"""Exit statuses."""

NO_ANSWERS = (mg.AssemblyError, mg.ReachError, mg.DeadPointError, mg.IndeterminateError, mg.ResponseError)
"""Errors that say that the mechanism has no answer; every other error is bad input."""

LONGEST_NAME = 100
"""Characters of a wrong name that are compared with those of the library."""

UNBROKEN = 10_000
"""Width in which nothing is wrapped: where the output goes to a file or another program."""

EXIT_STATUS = (
    "Exit status: 0 done; 1 the mechanism has no answer, and the message says why; 2 wrong usage or bad input."
)

Named = Annotated[
    str,
    typer.Argument(
        metavar="NAME_OR_FILE",
        help=f"A mechanism of the library (see 'list'), a TOML file, or one of another program ({', '.join(READERS)}).",
    ),
]
Engine = Annotated[
    Literal["auto", "dense", "sparse"],
    typer.Option(help="Dense or sparse matrices, or the faster ones for the size; the results are the same."),
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
    typer.Option("--at", metavar="FREEDOM=VALUE", help="Assemble there first: A=30deg, B.Tz=0.02 (repeat)."),
]
EquationsAt = Annotated[
    list[str] | None,
    typer.Option(
        "--at", metavar="FREEDOM=VALUE[@RATE[@ACCELERATION]]", help="Numbers at this position: A=30deg@10 (repeat)."
    ),
]
Drives = Annotated[
    list[str] | None,
    typer.Option(
        "--drive",
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
        help="A freedom in which an unknown effort stands, in place of those that are moved (repeat: as many as these).",
    ),
]
Out = Annotated[
    Path | None, typer.Option("--out", metavar="FILE.csv", help="Write everything as CSV, one row a position.")
]

Compare = Annotated[
    bool, typer.Option("--compare", help="Also the results stored in a FreeCAD assembly (.asmt) beside ours.")
]


# --- output ------------------------------------------------------------------------------------------------------------


def _is_terminal(stream: Any) -> bool:
    """Whether a stream, which may have been closed, is shown to somebody."""
    return stream is not None and stream.isatty()


def _write(text: str, colour: str = "") -> None:
    """Write a text; on a terminal its headings in bold and the paragraph after the title in ``colour``."""
    if sys.stdout is None:
        raise OSError(errno.EBADF, os.strerror(errno.EBADF))
    if not sys.stdout.isatty():
        sys.stdout.write(text)
        sys.stdout.flush()
        return
    console = Console(highlight=False)
    lines = text.split("\n")
    first = 3 if colour else len(lines)
    last = lines.index("", first) if "" in lines[first:] else first
    for i, (line, following) in enumerate(zip(lines, [*lines[1:], ""], strict=True)):
        rule = (
            len(following) > 2
            and not following.strip(following[0])
            and following[0] in "=~-"
            and len(following) >= len(line.strip()) > 0
        )
        style = "bold" if rule else f"bold {colour}" if first <= i < last else ""
        console.print(Text(line, style=style), soft_wrap=True, end="\n" if i < len(lines) - 1 else "")


def _show(document: Document, colour: str = "") -> None:
    width = max(shutil.get_terminal_size().columns, 40) if _is_terminal(sys.stdout) else UNBROKEN
    _write(to_text(document, width), colour)


def _fail(message: str, status: int) -> NoReturn:
    try:
        if _is_terminal(sys.stderr):
            text = Text.assemble(("mechgraph: ", "bold red"), visible(message))
            Console(stderr=True, highlight=False).print(text, soft_wrap=True)
        elif sys.stderr is not None:
            sys.stderr.write(f"mechgraph: {visible(message)}\n")
            sys.stderr.flush()
    except OSError:  # where messages cannot be written either, the status says it
        _forget(sys.stderr)
    sys.exit(status)


def _reached(error: mg.MechgraphError) -> str:
    """The driver values reached, in the words of the command line."""
    if not isinstance(error, mg.ReachError | mg.DeadPointError) or error.solution is None:
        return ""
    if not (np.asarray(error.solution.status) == OK).any():
        return ""
    m = error.solution.whole
    at = ", ".join(driver_value(m, name, value) for name, value in error.value.items())
    return f"\n  reached {at}; --on-reach flag solves the positions that can be reached"


@contextmanager
def _outcome() -> Iterator[None]:
    """Every error as a message and an exit status."""
    try:
        yield
    except NO_ANSWERS as error:
        _fail(str(error) + _reached(error), NO_ANSWER)
    except mg.MechgraphError as error:
        _fail(str(error), BAD_INPUT)
    except MemoryError:
        _fail("not enough memory for so many positions; take fewer", BAD_INPUT)
    except KeyboardInterrupt:
        _fail("interrupted", INTERRUPTED)
    except OSError as error:  # of files there is a FileError: this is the output itself
        _forget(sys.stdout)
        if error.errno == errno.EPIPE:
            sys.exit(DONE)
        _fail(f"the output cannot be written: {error.strerror or error}", BAD_INPUT)


def _forget(stream: Any) -> None:
    """Let nothing of what waits in a stream be written when the program ends: that would fail again."""
    with suppress(OSError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


class Program(TyperGroup):
    """The command line, all of which comes to an outcome: options and help as well as commands."""

    def main(self, *arguments: Any, **options: Any) -> Any:
        """Run it, with streams that show what they cannot encode; a stream may have been closed."""
        for stream in (sys.stdout, sys.stderr):
            if stream is not None and hasattr(stream, "reconfigure"):
                stream.reconfigure(errors="backslashreplace")
        with _outcome():
            return super().main(*arguments, **options)

    def invoke(self, context: Any) -> Any:
        """Run a command, before the errors that are left are taken for those of the command line itself."""
        with _outcome():
            return super().invoke(context)


@contextmanager
def _working(what: str) -> Iterator[None]:
    """A spinner on stderr, where that is a terminal."""
    if not _is_terminal(sys.stderr):
        yield
        return
    with Console(stderr=True).status(what):
        yield


@contextmanager
def _progress(what: str, end: float) -> Iterator[Callable[[float], None] | None]:
    """A bar on stderr over a time span, where that is a terminal."""
    if not _is_terminal(sys.stderr):
        yield None
        return
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=end)
        yield lambda reached: bar.update(task, completed=reached)


app = typer.Typer(
    name="mechgraph",
    cls=Program,
    help="Spatial mechanisms as graphs of links and pairs: determinacy, equations, motion, driver efforts and reactions.\n\n"
    + EXIT_STATUS,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


# --- input -------------------------------------------------------------------------------------------------------------


def _loaded(name: str) -> mg.Mechanism:
    """A mechanism of the library, else of a file; an unknown name is answered with its near matches."""
    known = mg.library()
    if name in known:
        return mg.load(name)
    path = Path(name)
    if os.path.lexists(path) or path.suffix.lower() in (".toml", *READERS) or len(path.parts) > 1:
        with warnings.catch_warnings(record=True) as notes:
            warnings.simplefilter("always", mg.MechgraphWarning)
            made = mg.load(path)
        if sys.stderr is not None:
            sys.stderr.write("".join(f"mechgraph: {visible(str(note.message))}\n" for note in notes))
        return made
    near = difflib.get_close_matches(name.lower()[:LONGEST_NAME], known, n=4, cutoff=0.5)
    hint = f"did you mean {' or '.join(near)}?" if near else f"there are: {', '.join(known)}"
    raise mg.FileError(name, f"no mechanism of that name in the library, and no such file; {hint}")


def _show_compared(mechanism: str) -> None:
    """What FreeCAD stored beside what comes out here, below a report or summary."""
    if Path(mechanism).suffix.lower() != ".asmt":
        refuse(f"--compare {mechanism!r}", "is no FreeCAD assembly (.asmt)")
    _write("\n")
    _show(compare(mechanism).document())


# --- commands ----------------------------------------------------------------------------------------------------------


@app.callback(invoke_without_command=True)
def _main(
    context: typer.Context, version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False
) -> None:
    if version:
        try:
            number = importlib.metadata.version("mechgraph")
        except importlib.metadata.PackageNotFoundError:
            number = "(not installed)"
        _write(f"mechgraph {number}\n")
        raise typer.Exit(DONE)


@app.command("list")
def list_() -> None:
    """Name the mechanisms of the library, with what they are."""
    found = {name: mg.load(name) for name in mg.library()}
    rows = [(name, " ".join(p.type.symbol for p in m.pairs), m.description) for name, m in found.items()]
    _show(Document("", (Table(("name", "pairs", "description"), tuple(rows)),)))


@app.command()
def check(
    mechanism: Named,
    json: Annotated[bool, typer.Option("--json", help="All facts as JSON.")] = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="The report as Markdown.")] = False,
    full: Annotated[
        bool, typer.Option("--full", help="The whole report: every pair, self-stress, loop and count.")
    ] = False,
    at: At = None,
    engine: Engine = "auto",
    compared: Compare = False,
    tol: Tolerance = None,
) -> None:
    """Print the determinacy report: the verdict, what to do, and what may be trusted; with --full all of it.

    Exit status: 0 where forces can be solved; 1 where the loops cannot be closed, drivers depend on each other or have nothing
    to move, or a freedom is neither driven nor passive. Redundancy is information: a mechanism some of whose reactions are not
    unique has exit status 0, and so has a topology without geometry. 2 wrong usage or bad input.
    """
    if json + markdown + compared > 1:
        refuse("check", "--json, --markdown and --compare exclude each other")
    m = _loaded(mechanism)
    values = dict(parse_at(m, text) for text in at or ())
    with _working("checking"):
        report = mg.check(m, at=values or None, engine=engine, tol=tol)
        text = report.to_json() if json else report.to_markdown(full) if markdown else ""
        document = report.document(full)
    not_closed = m.has_geometry and report.mobility is None
    bearing = any(p.load_bearing for p in report.passive)
    unsolvable = not_closed or report.undriven or report.contradicting_drives
    doubtful = report.near or bearing or not report.determinate
    if text:
        _write(text)
    else:
        _show(document, "red" if unsolvable else "yellow" if doubtful else "green")
    if compared:
        _show_compared(mechanism)
    if unsolvable:
        raise typer.Exit(NO_ANSWER)


@app.command()
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
) -> None:
    """Print the closure equations, the d'Alembert equations of every link and the conditions of the pairs; needs no geometry.

    With --at the coefficients {Q}, the right sides {C} and the unknowns {u} with numbers, at one position.

    Exit status: 0 done; 1 the mechanism has no such position; 2 wrong usage or bad input.
    """
    if (latex or blocks) and (coefficients or csv):
        refuse("equations", "--coefficients and --csv print a table, --latex and --blocks equations; take one of them")
    if at and (latex or blocks):
        refuse("equations", "--at prints a table of numbers, --latex and --blocks equations; take one of them")
    m = _loaded(mechanism)
    s = _solved_at(m, at) if at else None
    f = mg.formulate(s.mechanism if s else m, bookkeeping, unknowns=unknowns)
    if csv or coefficients or at:
        table = f.coefficients(s.state() if s else None)
        names = "" if csv or not at else "".join(f"u({i}): {u.name}\n" for i, u in enumerate(f.unknowns, 1))
        _write(names + (table.csv() if csv else table.text()))
    elif latex:
        _write(f.latex(components=not blocks))
    else:
        _show(f.document(components=not blocks))


@app.command()
def respond(
    mechanism: Named,
    span: Annotated[str, typer.Option("--for", metavar="TIME", help="How long: 10s.")],
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
    method: Annotated[
        Literal["auto", "RK23", "RK45", "DOP853", "Radau", "BDF", "LSODA"],
        typer.Option(help="Stepper of scipy; Radau for stiff loads."),
    ] = "auto",
    rtol: Annotated[float, typer.Option(help="Relative tolerance of a step.")] = 1e-8,
    atol: Annotated[float, typer.Option(help="Absolute tolerance (radians, lengths / L, and their rates).")] = 1e-10,
    engine: Engine = "auto",
) -> None:
    """Follow the motion that the loads produce, print a summary with the energy balance and write a table.

    Exit status: 0 done; 1 the loops cannot be closed, or the motion cannot be followed to its end (what there is is written); 2 wrong
    usage or bad input. Ctrl-C keeps what was computed. A file is written whole or not at all.
    """
    if out is not None and writable(out).exists() and os.path.lexists(mechanism) and out.samefile(mechanism):
        refuse(f"--out {str(out)!r}", "is the file of the mechanism; name another")
    m, end = _loaded(mechanism), duration(span)
    begin = dict(parse_at(m, text, "--start") for text in start or ())
    rates = dict(parse_at(m, text, "--rate") for text in rate or ())
    t = np.linspace(0.0, end, points) if points else (0.0, end)
    with _progress(f"moving {m.name}", end) as progress:
        r = mg.respond(
            m, t, start=begin, rates=rates, rtol=rtol, atol=atol, method=method, engine=engine, on_stop="return",
            progress=progress,
        )  # fmt: skip
        document = summary(r, None)
        if out is not None:
            r.to_csv(out)
    _show(document)
    largest = float(np.abs(r.energy.kinetic).max())
    off = float(np.abs(r.energy.balance).max()) / (largest or 1.0)
    _write(f"\nEnergy balance to {off:.0e} of the largest kinetic energy; {r.work}.\n")
    if out is not None:
        _write(f"Wrote {out}: {r.status.size} rows, {len(r.part(slice(1)).columns())} columns.\n")
    if r.stopped:
        _fail(r.stopped, NO_ANSWER)


def _solved_at(m: mg.Mechanism, at: list[str]) -> mg.Solution:
    """The one position that is named, with its rates."""
    motions = drives_of(m, at)
    if any(np.ndim(motion.position) for motion in motions.values()):
        refuse("--at", "expected one position, e.g. A=30deg@10")
    with _working("solving"), warnings.catch_warnings():
        warnings.simplefilter("ignore", mg.MechgraphWarning)
        return mg.solve(m, motions)


@app.command()
def solve(
    mechanism: Named,
    drive: Drives = None,
    actuate: Actuate = None,
    out: Out = None,
    method: Method = "loop_wrench",
    redundant: Redundant = "nan",
    on_reach: OnReach = "raise",
    engine: Engine = "auto",
    compared: Compare = False,
    tol: Tolerance = None,
) -> None:
    """Solve positions, efforts of the drivers and all reactions, print a summary and write a table.

    Exit status: 0 done; 1 the loops cannot be closed, a position is out of reach or a dead point (unless flagged and others were
    solved), a freedom is neither driven nor passive, or drivers contradict each other; 2 wrong usage or bad input. A file is
    written whole or not at all.
    """
    if out is not None and writable(out).exists() and os.path.lexists(mechanism) and out.samefile(mechanism):
        refuse(f"--out {str(out)!r}", "is the file of the mechanism; name another")
    m = _loaded(mechanism)
    motions = drives_of(m, drive or ())
    with _working(f"solving {m.name}"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", mg.MechgraphWarning)  # the summary has them
            how: dict[str, Any] = {"method": method, "redundant": redundant, "on_reach": on_reach, "engine": engine}
            s = mg.solve(m, motions or None, actuate=actuate, tol=tol, **how)
        unique = mg.check(s.mechanism).unique if redundant == "minimum_norm" else None
        document = summary(s, unique)
        if out is not None:
            s.to_csv(out)
    _show(document)
    if out is not None:
        _write(f"\nWrote {out}: {s.status.size} rows, {len(s.part(slice(1)).columns())} columns.\n")
    if compared:
        _show_compared(mechanism)
    if not (np.asarray(s.status) == "ok").any():
        raise typer.Exit(NO_ANSWER)
