"""The command line, for a mechanism of the library or a TOML file. The only module that prints."""

from __future__ import annotations

import difflib
import errno
import importlib.metadata
import re
import shutil
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, NoReturn

import numpy as np
import typer
from rich.console import Console
from rich.text import Text

import mechgraph as mg
from mechgraph.document import Document, Table, to_text
from mechgraph.model.toml import MOST_POSITIONS
from mechgraph.result.summary import driver_value, summary

DONE, NO_ANSWER, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130
"""Exit statuses."""

NO_ANSWERS = (mg.AssemblyError, mg.ReachError, mg.DeadPointError, mg.IndeterminateError)
"""Errors that say that the mechanism has no answer; every other error is bad input."""

"""Longest drive the command line takes."""

UNBROKEN = 10_000
"""Width in which nothing is wrapped: where the output goes to a file or another program."""

EXIT_STATUS = (
    "Exit status: 0 done; 1 the mechanism has no answer, and the message says why; 2 wrong usage or bad input."
)

app = typer.Typer(
    name="mechgraph",
    help="Spatial mechanisms as graphs of links and pairs: determinacy, equations, motion, driver efforts and reactions.\n\n"
    + EXIT_STATUS,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


class Bookkeeping(StrEnum):
    """Bookkeepings of the ledger."""

    lee = "lee"
    minimal = "minimal"


class Method(StrEnum):
    """Formulations of the forces."""

    loop_wrench = "loop_wrench"
    newton_euler = "newton_euler"


class Redundant(StrEnum):
    """What stands for reactions that are not unique."""

    nan = "nan"
    minimum_norm = "minimum_norm"


class Engine(StrEnum):
    """Linear algebra; the values are the same."""

    auto = "auto"
    dense = "dense"
    sparse = "sparse"


class OnReach(StrEnum):
    """What happens at positions that cannot be reached."""

    stop = "raise"
    flag = "flag"


Named = Annotated[
    str, typer.Argument(metavar="NAME_OR_FILE", help="A mechanism of the library (see 'list') or a TOML file.")
]

EngineOption = Annotated[
    Engine, typer.Option(help="Dense or sparse matrices, or the faster ones for the size; the results are the same.")
]


# --- output ------------------------------------------------------------------------------------------------------------


def _write(text: str, colour: str = "") -> None:
    """Write a text; on a terminal its headings in bold and the paragraph after the title in ``colour``."""
    if not sys.stdout.isatty():
        sys.stdout.write(text)
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
    width = max(shutil.get_terminal_size().columns, 40) if sys.stdout.isatty() else UNBROKEN
    _write(to_text(document, width), colour)


def _fail(message: str, status: int) -> NoReturn:
    if sys.stderr.isatty():
        Console(stderr=True, highlight=False).print(Text.assemble(("mechgraph: ", "bold red"), message), soft_wrap=True)
    else:
        sys.stderr.write(f"mechgraph: {message}\n")
    raise typer.Exit(status)


def _reached(error: mg.MechgraphError) -> str:
    """The driver values reached, in the words of the command line."""
    if not isinstance(error, mg.ReachError | mg.DeadPointError) or error.solution is None:
        return ""
    m = error.solution.mechanism
    at = ", ".join(driver_value(m, name, value) for name, value in error.value.items())
    return f"\n  reached {at}; --on-reach flag solves the positions that can be reached"


@contextmanager
def _outcome() -> Iterator[None]:
    """Errors of mechgraph as a message and an exit status; no traceback."""
    try:
        yield
    except NO_ANSWERS as error:
        _fail(str(error) + _reached(error), NO_ANSWER)
    except mg.MechgraphError as error:
        _fail(str(error), BAD_INPUT)
    except MemoryError:
        _fail("not enough memory for so many positions; take fewer", BAD_INPUT)
    except KeyboardInterrupt:
        raise typer.Exit(INTERRUPTED) from None
    except OSError as error:
        if error.errno != errno.EPIPE:
            raise
        raise typer.Exit(DONE) from None


@contextmanager
def _working(what: str) -> Iterator[None]:
    """A spinner on stderr, where that is a terminal."""
    if not sys.stderr.isatty():
        yield
        return
    with Console(stderr=True).status(what):
        yield


# --- input -------------------------------------------------------------------------------------------------------------


def _loaded(name: str) -> mg.Mechanism:
    """A mechanism of the library, else of a file; an unknown name is answered with its near matches."""
    known = mg.library()
    if name in known:
        return mg.load(name)
    path = Path(name)
    if path.exists() or path.suffix == ".toml" or len(path.parts) > 1:
        return mg.load(path)
    near = difflib.get_close_matches(name.lower(), known, n=4, cutoff=0.5)
    hint = f"did you mean {' or '.join(near)}?" if near else f"there are: {', '.join(known)}"
    raise mg.FileError(name, f"no mechanism of that name in the library, and no such file; {hint}")


def _usage(what: str, fault: str) -> NoReturn:
    _fail(f"{what}: {fault}", BAD_INPUT)


_NUMBER = re.compile(r"(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>[A-Za-z/^0-9]*)")


def _number(text: str, where: str) -> tuple[float, str]:
    """A number and the unit written after it."""
    found = _NUMBER.fullmatch(text.strip())
    value = float(found["number"]) if found else np.nan
    if found is None or not np.isfinite(value):
        _usage(where, f"{text!r} is no number; write e.g. 30deg, 0.5rad or 0.02")
    return value, found["unit"]


def _values(texts: Sequence[str], turns: bool, where: str) -> list[float]:
    """Numbers in radians or the declared length; the unit of the last holds for those without one of their own."""
    read = [_number(text, where) for text in texts]
    last = read[-1][1]
    scales = {"": 1.0, "rad": 1.0, "deg": np.pi / 180} if turns else {"": 1.0}
    out = []
    for text, (value, unit) in zip(texts, read, strict=True):
        if (unit or last) not in scales:
            what = (
                "is an angle: deg or rad (the default)"
                if turns
                else "is a length, in the unit that the mechanism declares: no unit"
            )
            _usage(where, f"unit {unit or last!r} in {text!r}: the freedom {what}")
        out.append(value * scales[unit or last])
    return out


def _named_value(text: str, what: str) -> tuple[str, str]:
    name, sign, rest = text.partition("=")
    if not sign or not name.strip() or not rest.strip():
        _usage(f"{what} {text!r}", "expected FREEDOM=VALUES, e.g. A=30deg")
    return name.strip(), rest.strip()


def _turns(m: mg.Mechanism, name: str, where: str) -> bool:
    fault = m.freedom_fault(name, single=True)
    if fault:
        _usage(where, fault)
    k, j = m.freedom(name)
    return m.pairs[k].type.freedoms[j].turns


def parse_drive(m: mg.Mechanism, text: str) -> tuple[str, mg.Motion]:
    """Freedom and motion of ``A=start:stop:step@rate@acceleration``, the end excluded; a single value in place of the range."""
    where = f"--drive {text!r}"
    name, rest = _named_value(text, "--drive")
    turns = _turns(m, name, where)
    spec, *rates = rest.split("@")
    parts = spec.split(":")
    if len(parts) not in (1, 3) or len(rates) > 2:
        _usage(where, "expected FREEDOM=START:STOP:STEP or FREEDOM=VALUE, then @RATE and @ACCELERATION where wanted")
    values = _values(parts, turns, where)
    velocity, acceleration = (
        *(_values([r.removesuffix("/s^2").removesuffix("/s2").removesuffix("/s")], turns, where)[0] for r in rates),
        0.0,
        0.0,
    )[:2]
    if len(values) == 1:
        return name, mg.Motion(values[0], velocity, acceleration)
    start, stop, step = values
    if step == 0 or (stop - start) / step <= 0:
        _usage(where, f"a step of {parts[2]!r} does not go from {parts[0]!r} to {parts[1]!r}")
    count = (stop - start) / step
    if count > MOST_POSITIONS:
        _usage(where, f"{count:.3g} positions: the command line takes at most {MOST_POSITIONS}")
    return name, mg.Motion(start + step * np.arange(int(np.ceil(count - 1e-9))), velocity, acceleration)


def _drives(m: mg.Mechanism, texts: Sequence[str]) -> dict[str, mg.Motion]:
    out: dict[str, mg.Motion] = {}
    for text in texts:
        name, motion = parse_drive(m, text)
        if m.full_name(name) in {m.full_name(n) for n in out}:
            _usage(f"--drive {text!r}", f"{name} is given twice")
        out[name] = motion
    return out


def _writable(out: Path) -> None:
    """Refuse a file that cannot be written, before a long run."""
    if out.is_dir():
        raise mg.FileError(out, "is a folder; name a file")
    if not out.absolute().parent.is_dir():
        raise mg.FileError(out, f"cannot be written: there is no folder {out.parent}")


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
    with _outcome():
        found = {name: mg.load(name) for name in mg.library()}
        rows = [(name, " ".join(p.type.symbol for p in m.pairs), m.description) for name, m in found.items()]
        _show(Document("", (Table(("name", "pairs", "description"), tuple(rows)),)))


@app.command()
def check(
    mechanism: Named,
    json: Annotated[bool, typer.Option("--json", help="All facts as JSON.")] = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="The report as Markdown.")] = False,
    at: Annotated[
        list[str] | None,
        typer.Option("--at", metavar="FREEDOM=VALUE", help="Assemble there first: A=30deg, B.Tz=0.02 (repeat)."),
    ] = None,
    engine: EngineOption = Engine.auto,
) -> None:
    """Print the determinacy report: counts, mobility, redundancy, which reactions are unique, and the verdict.

    Exit status: 0 where forces can be solved; 1 where the loops cannot be closed, drivers depend on each other or have nothing
    to move, or a freedom is neither driven nor passive. Redundancy is information: a mechanism some of whose reactions are not
    unique has exit status 0, and so has a topology without geometry. 2 wrong usage or bad input.
    """
    with _outcome():
        if json and markdown:
            _usage("check", "--json and --markdown exclude each other")
        m = _loaded(mechanism)
        values = {}
        for text in at or ():
            name, value = _named_value(text, "--at")
            values[name] = _values([value], _turns(m, name, f"--at {text!r}"), f"--at {text!r}")[0]
        with _working("checking"):
            report = mg.check(m, at=values or None, engine=engine.value)
            text = report.to_json() if json else report.to_markdown() if markdown else ""
            document = report.document()
        not_closed = m.has_geometry and report.mobility is None
        bearing = any(p.load_bearing for p in report.passive)
        unsolvable = not_closed or report.undriven or report.contradicting_drives
        if text:
            _write(text)
        else:
            _show(
                document,
                "red" if unsolvable else "green" if report.determinate and not (report.near or bearing) else "yellow",
            )
        if unsolvable:
            raise typer.Exit(NO_ANSWER)


@app.command()
def equations(
    mechanism: Named,
    latex: Annotated[bool, typer.Option("--latex", help="As LaTeX.")] = False,
    bookkeeping: Annotated[Bookkeeping, typer.Option(help="How the unknowns of a pair are written.")] = Bookkeeping.lee,
    blocks: Annotated[bool, typer.Option("--blocks", help="Vector equations only, without their components.")] = False,
    coefficients: Annotated[bool, typer.Option("--coefficients", help="The table of nonzero coefficients.")] = False,
    csv: Annotated[bool, typer.Option("--csv", help="The table of nonzero coefficients as CSV.")] = False,
) -> None:
    """Print the d'Alembert equations of every link and the conditions of the pairs; needs no geometry.

    Exit status: 0 done; 2 wrong usage or bad input.
    """
    with _outcome():
        if (latex or blocks) and (coefficients or csv):
            _usage(
                "equations", "--coefficients and --csv print a table, --latex and --blocks equations; take one of them"
            )
        f = mg.formulate(_loaded(mechanism), bookkeeping.value)
        if csv:
            _write(f.coefficients().csv())
        elif coefficients:
            _write(f.coefficients().text())
        elif latex:
            _write(f.latex(components=not blocks))
        else:
            _show(f.document(components=not blocks))


@app.command()
def solve(
    mechanism: Named,
    drive: Annotated[
        list[str] | None,
        typer.Option(
            "--drive",
            metavar="FREEDOM=START:STOP:STEP[@RATE[@ACCELERATION]]",
            help="Motion of a driver, the end excluded: A=0:360:1deg@10, B.Tz=0:0.1:0.01, or one value A=30deg. Angles in rad, "
            "or in deg where the suffix says so; lengths, rates and accelerations in the declared units (rates of turns in "
            "rad/s, or @600deg). "
            "Repeat for several drivers: they describe the same positions. Without it the stored motion.",
        ),
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE.csv", help="Write everything as CSV, one row a position.")
    ] = None,
    method: Annotated[Method, typer.Option(help="How the forces are solved.")] = Method.loop_wrench,
    redundant: Annotated[
        Redundant,
        typer.Option(
            help="What stands for reactions that are not unique: no value, or the least (all pairs equally stiff)."
        ),
    ] = Redundant.nan,
    on_reach: Annotated[
        OnReach, typer.Option("--on-reach", help="Stop at a position that cannot be reached, or flag it and go on.")
    ] = OnReach.stop,
    engine: EngineOption = Engine.auto,
) -> None:
    """Solve positions, efforts of the drivers and all reactions, print a summary and write a table.

    Exit status: 0 done; 1 the loops cannot be closed, a position is out of reach or a dead point (unless flagged and others were
    solved), a freedom is neither driven nor passive, or drivers contradict each other; 2 wrong usage or bad input. A file is
    written whole or not at all.
    """
    with _outcome():
        if out is not None:
            _writable(out)
        m = _loaded(mechanism)
        motions = _drives(m, drive or ())
        with _working(f"solving {m.name}"):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", mg.MechgraphWarning)  # the summary has them
                s = mg.solve(
                    m,
                    motions or None,
                    method=method.value,
                    redundant=redundant.value,
                    on_reach=on_reach.value,
                    engine=engine.value,
                )
            unique = mg.check(s.mechanism).unique if redundant is Redundant.minimum_norm else None
            document = summary(s, unique)
            if out is not None:
                s.to_csv(out)
        _show(document)
        if out is not None:
            _write(f"\nWrote {out}: {s.status.size} rows, {len(s.columns())} columns.\n")
        if not (np.asarray(s.status) == "ok").any():
            raise typer.Exit(NO_ANSWER)
