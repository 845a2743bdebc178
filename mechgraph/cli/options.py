"""What commands take and how they end: what is typed, arguments and options, what a shell completes, mechanisms by name or file.

What commands take and how they end: arguments and options, what a shell completes, mechanisms by the name or file that was typed.
Texts and documents go to standard output, work in progress to standard error; every error is a message with its exit status.
"""

from __future__ import annotations

import contextlib
import errno
import inspect
import io
import os
import re
import shutil
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn, get_type_hints

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.text import Text
from typer.core import TyperGroup

import mechgraph as mg
from mechgraph.document import Document, to_text
from mechgraph.errors import INTERRUPTED, MechgraphError, MechgraphWarning, did_you_mean, near_names, shortened, visible
from mechgraph.exchange.asmt_mechanism import compare
from mechgraph.exchange.files import READERS
from mechgraph.fields import TEXT
from mechgraph.files import Format, format_of, formats_text, writable
from mechgraph.kinematics.prescribed import coordinate
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.motion import Motion
from mechgraph.model.toml import swept
from mechgraph.quantities import KNOWN, angle_hint
from mechgraph.result.solution import FORMATS, MORE
from mechgraph.result.values import OK, driver_value


class UsageError(MechgraphError):
    """Options that are wrong, or that exclude each other."""


def refuse(what: str, fault: str) -> NoReturn:
    """Say what is wrong with something that was typed."""
    raise UsageError(f"{shortened(what)}: {shortened(fault)}")


NUMBER = re.compile(r"(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(?P<unit>[A-Za-z/^0-9]*)")


def _number(text: str, where: str, examples: str = "30deg, 0.5rad or 0.02") -> tuple[float, str]:
    """A number and the unit written after it."""
    found = NUMBER.fullmatch(text.strip())
    value = float(found["number"]) if found else np.nan
    if found is None or not np.isfinite(value):
        refuse(where, f"{text!r} is not a number; write e.g. {examples}")
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
                else "is a length: write the number alone, in the unit of length of the mechanism"
            )
            refuse(where, f"unit {unit or last!r} in {text if unit else texts[-1]!r}: the freedom {what}")
        out.append(value * scales[unit or last])
    return out


def _doubt(texts: Sequence[str], values: Sequence[float], where: str) -> None:
    """Warn of angles typed without a unit that are many turns."""
    told = angle_hint(max(values, key=abs))
    if told and not any(_number(text, where)[1] for text in texts):
        typed = texts[-1].strip()
        text = f"{where}: {told}; for degrees write {typed}deg, for radians {typed}rad"
        warnings.warn(text, MechgraphWarning, stacklevel=3)


def named_value(text: str, what: str) -> tuple[str, str]:
    """Both sides of ``A=30deg``."""
    name, sign, rest = text.partition("=")
    if not sign or not name.strip() or not rest.strip():
        refuse(f"{what} {text!r}", "expected FREEDOM=VALUES, e.g. A=30deg")
    return name.strip(), rest.strip()


def duration(text: str, option: str, declared: str = "s") -> float:
    """A time span: ``10`` or ``10s`` (``ms`` too), in the unit of time ``declared``."""
    value, unit = _number(text, f"{option} {text!r}", "10 or 10s")
    known = KNOWN["time"]
    scales = {"": 1.0, declared: 1.0}
    if declared in known:
        scales |= {name: known[name] / known[declared] for name in ("s", "ms")}
    if unit not in scales or value <= 0:
        refuse(f"{option} {text!r}", f"expected a time above 0 in {', '.join(filter(None, scales))}, e.g. 10{declared}")
    return value * scales[unit]


def longest(text: str, option: str, declared: str = "s") -> float:
    """A time span, or ``inf`` for no limit."""
    return np.inf if text.strip() == "inf" else duration(text, option, declared)


def _turns(m: Mechanism, name: str, where: str) -> bool:
    fault = m.freedom_fault(name, single=True)
    if fault:
        refuse(where, fault)
    return m.turns(name)


def _coordinate_turns(m: Mechanism, name: str, where: str) -> bool:
    """Whether a freedom, or a coordinate of a point or link, is an angle."""
    found = coordinate(m, name)
    if isinstance(found, str):
        refuse(where, found)
    return found


def parse_drive(m: Mechanism, text: str, option: str = "--drive") -> tuple[str, Motion]:
    """Freedom and motion of ``A=start:stop:step@rate@acceleration``, the end excluded; a single value in place of the range."""
    where = f"{option} {text!r}"
    name, rest = named_value(text, option)
    turns = _coordinate_turns(m, name, where)
    spec, *rates = rest.split("@")
    parts = spec.split(":")
    if len(parts) not in (1, 3) or len(rates) > 2:
        refuse(where, "expected FREEDOM=START:STOP:STEP or FREEDOM=VALUE, then @RATE and @ACCELERATION where wanted")
    values = _values(parts, turns, where)
    if turns:
        _doubt(parts[:2], values[:2], where)
    velocity, acceleration = (
        *(_values([r.removesuffix("/s^2").removesuffix("/s2").removesuffix("/s")], turns, where)[0] for r in rates),
        0.0,
        0.0,
    )[:2]
    if len(values) == 1:
        return name, Motion(values[0], velocity, acceleration)
    positions = swept(*values)
    if isinstance(positions, str):
        refuse(where, positions)
    return name, Motion(positions, velocity, acceleration)


def drives_of(m: Mechanism, texts: Sequence[str], option: str = "--drive") -> dict[str, Motion]:
    """The motions of all drives."""
    out: dict[str, Motion] = {}
    known: set[str] = set()
    for text in texts:
        name, motion = parse_drive(m, text, option)
        full = name if m.freedom_fault(name, single=True) else m.full_name(name)
        if full in known:
            refuse(f"{option} {text!r}", f"{name} is given twice")
        known.add(full)
        out[name] = motion
    return out


def motions_of(m: Mechanism, texts: Sequence[str]) -> dict[str, Motion]:
    """The motions of all drives where one is needed of each that is declared."""
    out = drives_of(m, texts)
    given = {name if m.freedom_fault(name, single=True) else m.full_name(name) for name in out}
    declared = {m.full_name(drive.freedom): drive.motion for drive in m.drives}
    still = [name for name, motion in declared.items() if motion is None and name not in given]
    if still and (not given or given & set(declared)):
        refuse(f"drive {still[0]!r}", f"has no motion; give one, e.g. {drive_example(m, still[:1])}")
    return out


def drive_example(m: Mechanism, names: Sequence[str]) -> str:
    """Options that set drivers in motion."""
    return " ".join(f"--drive {name}={'0:360:5deg' if m.turns(name) else '0:0.1:0.01'}" for name in names)


def parse_at(m: Mechanism, text: str, option: str = "--at") -> tuple[str, float]:
    """Freedom and value of ``A=30deg``."""
    where = f"{option} {text!r}"
    name, value = named_value(text, option)
    turns = _turns(m, name, where)
    out = _values([value], turns, where)
    if turns and option != "--rate":
        _doubt([value], out, where)
    return name, out[0]


def values_of(m: Mechanism, texts: Sequence[str] | None, option: str = "--at") -> dict[str, float] | None:
    """The values of several freedoms, where there are any."""
    return dict(parse_at(m, text, option) for text in texts or ()) or None


def is_terminal(stream: Any) -> bool:
    """Whether a stream, which may have been closed, is shown to somebody."""
    return stream is not None and stream.isatty()


def write(text: str, colour: str = "") -> None:
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


def show(document: Document, colour: str = "") -> None:
    """Write a document as wide as the terminal; unbroken into a file or another program."""
    # width in which nothing is wrapped: where the output goes to a file or another program
    width = max(shutil.get_terminal_size().columns, 40) if is_terminal(sys.stdout) else 10_000
    write(to_text(document, width), colour)


@contextmanager
def working(what: str) -> Iterator[Callable[[str], None] | None]:
    """A spinner with the time passed on stderr, where that is a terminal; ``say(text)`` tells what is done."""
    if not is_terminal(sys.stderr):
        yield None
        return
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as spinner:
        task = spinner.add_task(what)
        yield lambda text: spinner.update(task, description=f"{what}: {text}")


@contextmanager
def progress(what: str, end: float | None = None) -> Iterator[Callable[..., None] | None]:
    """A bar on stderr, where that is a terminal; ``moved(reached, of=end)``. Without an end it runs to and fro until there is one."""
    if not is_terminal(sys.stderr):
        yield None
        return
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=end)

        def moved(reached: float, of: float | None = end) -> None:
            bar.update(task, completed=reached, total=of)

        yield moved


DONE, NO_ANSWER, BAD_INPUT = 0, 1, 2
"""Exit statuses."""

NO_ANSWERS = (
    mg.AssemblyError,
    mg.ReachError,
    mg.DeadPointError,
    mg.IndeterminateError,
    mg.ResponseError,
    mg.FrictionError,
)
"""Errors that say that the mechanism has no answer; every other error is bad input."""


EXIT_STATUS = "Exit status: 0 success; 1 no solution (see message); 2 usage or input error."


def fail(message: str, status: int) -> NoReturn:
    """End with a message on standard error."""
    try:
        if is_terminal(sys.stderr):
            text = Text.assemble(("mechgraph: ", "bold red"), visible(message))
            Console(stderr=True, highlight=False).print(text, soft_wrap=True)
        elif sys.stderr is not None:
            sys.stderr.write(f"mechgraph: {visible(message)}\n")
            sys.stderr.flush()
    except OSError:  # where messages cannot be written either, the status says it
        forget(sys.stderr)
    sys.exit(status)


@contextmanager
def warned() -> Iterator[None]:
    """Every warning of the package as a message."""

    def say(message: Warning | str, *_: Any, **__: Any) -> None:
        if sys.stderr is not None:
            sys.stderr.write(f"mechgraph: {visible(str(message))}\n")

    with warnings.catch_warnings():
        warnings.simplefilter("always", mg.MechgraphWarning)
        warnings.showwarning = say
        yield


def _reached(error: mg.MechgraphError) -> str:
    """The driver values reached, in the words of the command line."""
    if not isinstance(error, mg.ReachError | mg.DeadPointError) or error.solution is None:
        return ""
    if not (np.asarray(error.solution.status) == OK).any():
        return ""
    m = error.solution.whole
    at = ", ".join(driver_value(m, name, value) for name, value in error.value.items())
    return f"\n  reached {at}"


LEFT_OUT = re.compile(r"(?:,? or(?: pass)?|\. Pass) on_reach='flag'[^.\n]*")
"""What a message says of an argument that not every command has as an option."""
ARGUMENT = re.compile(r"\b(on_reach|redundant|tol|limit)=('?)([\w.+-]*)\2")


def spelled(message: str, options: Sequence[str]) -> str:
    """A message with options, as they are typed, in place of the arguments of a call."""
    if "on_reach" not in options:
        message = LEFT_OUT.sub("", message)

    def typed(found: re.Match[str]) -> str:
        name = f"--{found[1].replace('_', '-')}"
        return f"{name} {found[3]}".rstrip() if found[1] in options else found[0]

    return ARGUMENT.sub(typed, message)


@contextmanager
def outcome(options: Callable[[], Sequence[str]] = tuple) -> Iterator[None]:
    """Every error as a message and an exit status; ``options`` are those of the command, by the names of their arguments."""
    try:
        yield
    except NO_ANSWERS as error:
        fail(spelled(str(error), options()) + _reached(error), NO_ANSWER)
    except mg.MechgraphError as error:
        fail(spelled(str(error), options()), BAD_INPUT)
    except MemoryError:
        fail("out of memory; request fewer positions", BAD_INPUT)
    except KeyboardInterrupt:
        fail("interrupted", INTERRUPTED)
    except OSError as error:  # of files there is a FileError: this is the output itself
        forget(sys.stdout)
        if error.errno == errno.EPIPE:
            sys.exit(DONE)
        fail(f"the output cannot be written: {error.strerror or error}", BAD_INPUT)


def forget(stream: Any) -> None:
    """Let nothing of what waits in a stream be written when the program ends: that would fail again."""
    with suppress(OSError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def library_names(incomplete: str) -> list[str]:
    """Mechanisms of the library; where none begins so, the shell completes files."""
    return [name for name in mg.library() if name.startswith(incomplete)]


def freedom_names(ctx: typer.Context, incomplete: str) -> list[str]:
    """Freedoms of the mechanism that stands before, as far as it can be read."""
    typed = [ctx.params.get("mechanism"), *ctx.args]  # an option that lacks its value leaves what was typed unread
    try:
        with contextlib.redirect_stderr(io.StringIO()):
            names = mg.load(next(filter(None, typed), "")).freedom_names()
    except mg.MechgraphError:
        return []
    return [name for name in names if name.startswith(incomplete)]


def freedoms(ctx: typer.Context, incomplete: str) -> list[str]:
    """The same, to be followed by a value."""
    return [f"{name}=" for name in freedom_names(ctx, incomplete)]


def option(flag: str, help: str, metavar: str | None = None, complete: Callable[..., Any] | None = None) -> Any:
    """An option that takes a value, for ``Annotated``."""
    return typer.Option(*flag.split(), help=help, metavar=metavar, autocompletion=complete)


SELECTS = "the extension selects the format:"


def file_option(what: str, formats: Sequence[Format]) -> Any:
    """The option that names the file to write, whose extension selects one of ``formats``."""
    return option("--out", f"{what}{SELECTS} {formats_text(formats)}.", "FILE")


Named = Annotated[
    str,
    typer.Argument(
        metavar="NAME_OR_FILE",
        autocompletion=library_names,
        help=f"A mechanism of the library (see 'list'), a TOML file, or one of another program ({', '.join(READERS)}).",
    ),
]
Texts = list[str] | None
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON (schema: library/output.schema.json).")]
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
TOLERANCE = "Accuracy of directions [rad] and distances (relative to L), e.g. 1e-4."
Tolerance = Annotated[float | None, option("--tol", TOLERANCE, "TOL")]
Bookkeeping = Annotated[Literal["lee", "minimal"], typer.Option(help="Choice of unknowns.")]
Method = Annotated[Literal["loop_wrench", "newton_euler", "printed"], typer.Option(help="How the forces are solved.")]
REDUNDANT = "Indeterminate reactions: NaN, the minimum-norm solution, or split by the stiffness of the pairs."
Redundant = Annotated[Literal["nan", "minimum_norm", "elastic"], typer.Option(help=REDUNDANT)]
OnReach = Annotated[
    Literal["raise", "flag"], option("--on-reach", "Unreachable positions: stop, or flag and continue.")
]
At = Annotated[Texts, option("--at", "Assemble there first: A=30deg, B.Tz=0.02 (repeat).", "FREEDOM=VALUE", freedoms)]
Drivers = Annotated[Texts, option("--driver", "Driver in place of the declared ones (repeat).", "FREEDOM", freedoms)]
EquationsAt = Annotated[
    Texts,
    option("--at", "Numbers at this position: A=30deg@10 (repeat).", "FREEDOM=VALUE[@RATE[@ACCELERATION]]", freedoms),
]
DRIVES = (
    "Motion of a driver, the end excluded: A=0:360:1deg@10, B.Tz=0:0.1:0.01, or one value A=30deg. Angles in rad, "
    "or in deg where the suffix says so; lengths, rates and accelerations in the declared units (rates of turns in "
    "rad/s, or @600deg). "
    "Repeat for several drivers: they describe the same positions. Also coordinates of a named point (bucket.tip.Tz, or "
    "bucket.tip.T(1,0,1) along a direction) and of a link (platform.Rz). Without it the stored motion."
)
Drives = Annotated[Texts, option("--drive", DRIVES, "FREEDOM=START:STOP:STEP[@RATE[@ACCELERATION]]", freedoms)]
ACTUATE = "Freedom that carries an actuator, if not the prescribed one (repeat: one per prescribed motion)."
Actuate = Annotated[Texts, option("--actuate", ACTUATE, "FREEDOM", freedom_names)]
Out = Annotated[Path | None, file_option("Write a table, one row per position; ", FORMATS)]
Include = Annotated[Texts, option("--include", f"More columns for --out (repeat): {', '.join(MORE)}.", "WHAT")]
TRANSMISSION = "Also print transmission and deviation angle of this output (repeat)."
FRICTION = (
    "Dry friction in a pair or between teeth, beside the declared loads: B:mu=0.1,radius=0.01 or g:efficiency=0.97 (repeat); "
    "the fields of mg.Friction, flank=15deg."
)
Dry = Annotated[Texts, option("--friction", FRICTION, "PAIR:mu=NUMBER[,FIELD=VALUE]")]
Outputs = Annotated[Texts, option("--transmission", TRANSMISSION, "FREEDOM", freedom_names)]
Compare = Annotated[bool, typer.Option("--compare", help="Compare with results stored in a FreeCAD assembly (.asmt).")]
OVER_TIME = "Also peak, mean, RMS and work of drivers, and shaking, over time or a whole cycle."
OverTime = Annotated[bool, typer.Option("--over-time", help=OVER_TIME)]


PLANAR = "Take the mechanism in the plane in which it moves, as m.to_planar() does."


FLATTENED: ContextVar[bool] = ContextVar("planar", default=False)
"""Whether the running command is asked for in the plane."""


def in_plane(command: Callable[..., None]) -> Callable[..., None]:
    """A command with the option ``--planar``, which ``loaded`` goes by."""

    @wraps(command)
    def run(planar: bool = False, **named: Any) -> None:
        token = FLATTENED.set(planar)
        try:
            command(**named)
        finally:
            FLATTENED.reset(token)

    hints = get_type_hints(command, include_extras=True)
    hints["planar"] = Annotated[bool, typer.Option("--planar", help=PLANAR)]
    own = [one.replace(annotation=hints[name]) for name, one in inspect.signature(command).parameters.items()]
    asked = inspect.Parameter("planar", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=hints["planar"])
    vars(run)["__signature__"] = inspect.Signature([*own, asked])
    run.__annotations__ = hints
    return run


def loaded(name: str, dry: Texts = None) -> mg.Mechanism:
    """A mechanism by its name on the command line, in its plane where that is asked for, with the friction that was typed."""
    m = _found(name)
    m = m.to_planar() if FLATTENED.get() else m
    return m.replace(loads=[*m.loads, *map(parse_friction, dry)]) if dry else m


def parse_friction(text: str) -> mg.Friction:
    """The friction of ``B:mu=0.1,radius=0.01,flank=15deg``."""
    where, known = f"--friction {text!r}", mg.Friction.formats
    of, _, rest = text.partition(":")
    found: dict[str, Any] = {}
    for part in filter(None, rest.split(",")):
        name, sign, value = map(str.strip, part.partition("="))
        if not (sign and name and value):
            comma = "; a decimal point is a point, a comma ends a field" if found else ""
            refuse(where, f"{part!r}: expected FIELD=VALUE, e.g. B:mu=0.1,radius=0.01{comma}")
        if name not in known or name == "of":
            near = did_you_mean(near_names(name, known)) or f"expected one of {', '.join(list(known)[1:])}"
            refuse(where, f"{name} is no field of friction; {near}")
        if name in found:
            refuse(where, f"{name} is given twice")
        is_text = known[name].kind is TEXT
        found[name] = value if is_text else _values([value], known[name].degrees, where)[0]
    if not {"mu", "efficiency"} & set(found):
        refuse(where, "expected PAIR:mu=NUMBER, e.g. B:mu=0.1,radius=0.01, or of teeth GEARS:efficiency=NUMBER")
    return mg.Friction(of, **found)


def _found(name: str) -> mg.Mechanism:
    """A mechanism of the library, else of a file, else a loop by its letters; an unknown name is answered with its near matches."""
    known = mg.library()
    if name in known:
        return mg.load(name)
    path = Path(name)
    if os.path.lexists(path) or path.suffix.lower() in (".toml", *READERS) or len(path.parts) > 1:
        return mg.load(path)
    with suppress(mg.DeclarationError):
        return mg.chain(name)
    near = near_names(name.lower(), known) or [one for one in known if name.lower() in mg.load(one).description.lower()]
    hint = did_you_mean(near) or f"available: {', '.join(known)}"
    raise mg.FileError(name, f"neither a library mechanism, an existing file, nor letters of pairs (RSSR); {hint}")


def refuse_own_file(out: Path, mechanism: str) -> None:
    """Let no output take the place of the file that the mechanism is read from."""
    if writable(out).exists() and os.path.lexists(mechanism) and out.samefile(mechanism):
        refuse(f"--out {str(out)!r}", "is the file of the mechanism; name another")


def check_out(out: Path | None, mechanism: str, formats: Sequence[Format]) -> None:
    """Refuse an output that no format takes, or that is the file of the mechanism, before anything is computed."""
    if out is not None:
        refuse_own_file(out, mechanism)
        format_of(out, formats)


def show_compared(mechanism: str) -> None:
    """What FreeCAD stored beside what comes out here, below a report or summary."""
    if Path(mechanism).suffix.lower() != ".asmt":
        refuse(f"--compare {mechanism!r}", "is not a FreeCAD assembly (.asmt)")
    write("\n")
    show(compare(mechanism).document())


class Program(TyperGroup):
    """The command line, all of which comes to an outcome: options and help as well as commands."""

    def main(self, *arguments: Any, **options: Any) -> Any:
        """Run it, with streams that show what they cannot encode; a stream may have been closed."""
        for stream in (sys.stdout, sys.stderr):
            if stream is not None and hasattr(stream, "reconfigure"):
                stream.reconfigure(errors="backslashreplace")
        with outcome():
            return super().main(*arguments, **options)

    def invoke(self, context: Any) -> Any:
        """Run a command, before the errors that are left are taken for those of the command line itself."""

        def options() -> list[str]:
            command = self.commands.get(context.invoked_subcommand or "")
            return [one.name or "" for one in command.params] if command else []

        with outcome(options), warned():
            return super().invoke(context)


app = typer.Typer(
    name="mechgraph",
    cls=Program,
    help="Analyze spatial mechanisms: determinacy, equations, motion, driver efforts and reactions.\n\n" + EXIT_STATUS,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback(invoke_without_command=True)
def _main(
    context: typer.Context, version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False
) -> None:
    if version:
        write(f"mechgraph {mg.__version__}\n")
        raise typer.Exit(DONE)
