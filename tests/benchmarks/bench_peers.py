"""mechgraph beside other programs, complete job against complete job: ``python tests/benchmarks/bench_peers.py [--write]``.

The job: from the driver motion of a closed loop to the driver torque and all reactions at 1, 36, 360 and 3,600 positions of its cycle,
from the same numbers (``peer_cases``), on one core, in one run. Every round does every job once, one after the other, and gives the
ratio of each program to mechgraph; shown are the medians over all rounds. Errors are those of the torque and, where they are unique,
of the reaction forces against mechgraph's ``newton_euler``, in parts of the greatest. ``--write`` puts the table into docs/comparison.md. A
program that is not there says why and the others run (``pip install '.[bench]'``; the C++ job is compiled here where a compiler is).
"""

import ast
import importlib
import os
import platform
import re
import sys
import textwrap
import time
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from types import ModuleType

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("MKL_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
import peer_mechgraph
from peer_cases import POSITIONS, Case, cases

import mechgraph as mg

ROUNDS = {1: 75, 36: 45, 360: 25, 3600: 15}
"""Rounds by the number of positions, at most."""
FEWEST, BUDGET = 5, 10.0
"""Rounds that every case has, and processor seconds behind which it has no more than these: the whole takes some four minutes."""
SMALL = 1e-9
"""An error below it is not worth a word."""
WIDTH = 138
FROM_PYTHON, COMPILED, KERNEL = "Pinocchio from Python", "Pinocchio in C++", "mechgraph compiled"
PEERS = {
    KERNEL: "peer_compiled",
    FROM_PYTHON: "peer_pinocchio",
    COMPILED: "peer_pinocchio_cpp",
    "Exudyn": "peer_exudyn",
}
Programs = dict[str, ModuleType | str]
"""The programs by name; for one that is not there the reason."""
PAGE = Path(__file__).resolve().parents[2] / "docs" / "comparison.md"
MARKED = re.compile(
    r"(<!-- peers: written by tests/benchmarks/bench_peers\.py -->\n).*?(\n<!-- end of peers -->)", re.DOTALL
)


@dataclass(frozen=True)
class Result:
    """What one program made of one case: median time and ratio to mechgraph, error; or why it failed."""

    seconds: float = np.nan
    ratio: float = np.nan
    error: float = np.nan
    failure: str = ""


def installed() -> Programs:
    """The programs, with the reason for one that is not there."""
    found: Programs = {"mechgraph": peer_mechgraph}
    for name, module in PEERS.items():
        try:
            found[name] = importlib.import_module(module)
        except ModuleNotFoundError:
            found[name] = "not installed"
        except ImportError as error:
            found[name] = str(error)
    return found


def one_core() -> None:
    """Stay on one core, where the system lets a process choose."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def attempt(program: ModuleType, case: Case) -> tuple[float, np.ndarray]:
    """Seconds of processor time of one run, and the torque and the size of the force in every joint."""
    begin = time.process_time()
    torque, wrenches = program.solve(case)
    return time.process_time() - begin, sizes(program, torque, wrenches)


def sizes(program: ModuleType, torque: np.ndarray, wrenches: np.ndarray) -> np.ndarray:
    """The torque and the sizes of the forces ``(1 + joints, T)``, which do not depend on the frame a program uses."""
    return np.vstack([torque, np.linalg.norm(wrenches[..., program.FORCE], axis=-1)])


def compared(programs: Programs, case: Case, rounds: int) -> dict[str, Result]:
    """All programs on one case; the first round, which loads and warms up, does not count."""
    right = sizes(peer_mechgraph, *peer_mechgraph.solve(case, method="newton_euler"))
    there = {name: program for name, program in programs.items() if not isinstance(program, str)}
    failures: dict[str, str] = {}
    seconds: dict[str, list[float]] = {name: [] for name in there}
    errors: dict[str, float] = {}
    begin = time.process_time()
    for turn in range(rounds + 1):
        if turn > FEWEST and time.process_time() - begin > BUDGET:
            break
        for name in there.keys() - failures.keys():
            try:
                took, found = attempt(there[name], case)
            except Exception as error:
                failures[name] = (str(error) or repr(error)).splitlines()[0][:60]
                continue
            if turn:
                seconds[name].append(took)
            errors[name] = largest_error(found, right)
    base = np.array(seconds["mechgraph"])
    out = {name: Result(failure=words) for name, words in failures.items()}
    for name in there.keys() - out.keys():
        mine = np.array(seconds[name])
        out[name] = Result(float(np.median(mine)), float(np.median(mine / base)), errors[name])
    return out


def largest_error(found: np.ndarray, right: np.ndarray) -> float:
    """Of the torque, and of the forces where all are unique, each in parts of its own greatest.

    The first hundredth of the cycle, at least one position, is left out where there are more.
    """
    if found.shape != right.shape:
        return np.inf
    rows = slice(None) if np.isfinite(right).all() else slice(0, 1)
    begin = min(right.shape[1] - 1, max(1, right.shape[1] // 100))
    errors = np.abs(found - right)[rows, begin:].max(axis=1)
    return float((errors / np.abs(right[rows]).max(axis=1)).max())


def balance(case: Case) -> float:
    """Largest power balance of mechgraph's solution, relative."""
    s = mg.solve(case.mechanism, {case.driver: case.motion})
    return float(np.abs(s.checks.power).max())


def lines_of(program: ModuleType) -> int:
    """Lines of code of the job, without docstrings, comments, blank lines and what only the table needs."""
    program = getattr(program, "JOB", program)
    if hasattr(program, "SOURCE"):
        lines = program.SOURCE.read_text(encoding="utf-8").splitlines()
        return sum(1 for line in lines if line.strip() and not line.strip().startswith("//"))
    text = Path(program.__file__).read_text(encoding="utf-8")
    left = set()
    for node in ast.parse(text).body:
        if isinstance(node, ast.FunctionDef) and node.name == "verdict":
            continue
        if isinstance(node, ast.Expr) or ast.unparse(node).startswith(("VERSION", "FORCE")):
            continue
        left |= set(range(node.lineno, node.end_lineno + 1))
        for part in ast.walk(node):
            if isinstance(part, ast.FunctionDef) and ast.get_docstring(part) is not None:
                left -= set(range(part.body[0].lineno, part.body[0].end_lineno + 1))
    lines = text.splitlines()
    return sum(1 for number in left if lines[number - 1].strip())


def processor() -> str:
    """Maker's name of the processor where the system tells it."""
    try:
        names = re.findall(r"^model name\s*:\s*(.+)$", Path("/proc/cpuinfo").read_text(encoding="ascii"), re.MULTILINE)
    except OSError:
        names = []
    return names[0] if names else platform.machine()


def short(value: float) -> str:
    """Two digits, without an exponent."""
    return f"{float(f'{value:.2g}'):g}"


def cell(result: Result) -> str:
    """Time, ratio to mechgraph, and the error where it counts."""
    if result.failure:
        return result.failure
    ratio = "" if result.ratio == 1.0 else f" (x {short(result.ratio)})"
    return f"{short(1e3 * result.seconds)} ms{ratio}" + (f", error {result.error:.0e}" if result.error > SMALL else "")


def row(*cells: str) -> str:
    """A row of a Markdown table."""
    return f"| {' | '.join(cells)} |"


def table(programs: Programs, every: dict[str, list[Case]], results: dict[str, list[dict[str, Result]]]) -> str:
    """Times by mechanism and number of positions, and what each program takes and finds."""
    heads = {name: f"{name} {getattr(program, 'VERSION', '')}".strip() for name, program in programs.items()}
    lines = [row("mechanism", "positions", *heads.values()), row(*["---"] * (len(heads) + 2))]
    for name, cases_of in every.items():
        loop = "-".join(joint.kind for joint in cases_of[0].joints)
        for case, found in zip(cases_of, results[name], strict=True):
            cells = [cell(found[other]) if other in found else "-" for other in programs]
            lines.append(row(f"{name}, {loop}", f"{len(case.t):,}", *cells))
    last = [cases_of[-1] for cases_of in every.values()]
    there = [None if isinstance(program, str) else program for program in programs.values()]
    counts = [str(lines_of(program)) if program else "-" for program in there]
    said = [", ".join(filter(None, map(program.verdict, last))) or "no count" if program else "-" for program in there]
    lines.append(row("lines of code of the job", "", *counts))
    lines.append(row("redundant constraints found", "", *said))
    return "\n".join(lines) + "\n\n" + notes(programs, results, max(map(balance, last)))


MEANING = (
    "Median processor times, in brackets the median of the ratios to mechgraph (below 1 is faster). Errors, where they exceed "
    "1e-9: the largest of the torque and, where they are unique, of the reaction forces against mechgraph's other force "
    "method, in parts of the greatest, without the first hundredth of the cycle. Lines of code: without comments, from the "
    "same numbers for all."
)
LIMITS = (
    "Pinocchio has no call for this job: the loop is cut and closed by Newton's method, position by position, in code of our own, "
    "once in Python and once in C++ against the headers of its wheel. Where constraints are redundant it gets normal equations, "
    "which choose one of many reactions without saying so. Exudyn integrates the motion: its error falls with its step, one "
    "position has no meaning, and it was given the initial velocities, and a spectral radius and Newton tolerance that on these "
    "four gave less error than its defaults (a dozen settings tried); where constraints are redundant its default solver stops "
    "(`matrix is not factorized!`), so another was set. Written by people who know mechgraph better. Simulation in time, "
    "for which the two are made, has a table of its own (see [Motion in time](#motion-in-time))."
)


def span(values: list[float]) -> str:
    """The smallest and the largest number."""
    low, high = short(min(values)), short(max(values))
    return low if low == high else f"{low} to {high}"


def faster(name: str, results: dict[str, list[dict[str, Result]]], place: int) -> str:
    """How many times as fast as mechgraph a program is over the mechanisms, at one number of positions."""
    return span([1 / found[place][name].ratio for found in results.values()])


def in_short(programs: Programs, results: dict[str, list[dict[str, Result]]]) -> list[str]:
    """What the table says, where the programs are there."""
    out = []
    there = [name for name, program in programs.items() if not isinstance(program, str)]
    if KERNEL in there:
        one, few, many = (faster(KERNEL, results, place) for place in (0, 1, -1))
        at = f"{one} times as fast at one position, {few} at {POSITIONS[1]} and {many} at {POSITIONS[-1]:,}"
        out.append(f"With the compiled kernel mechgraph is {at}, the mechanism declared anew each time.")
    if KERNEL in there and COMPILED in there:
        parts = [[found[i][KERNEL].ratio / found[i][COMPILED].ratio for found in results.values()] for i in (1, -1)]
        few, many = map(span, parts)
        out.append(
            f"That is {few} times the time of Pinocchio in C++ at {POSITIONS[1]} positions, {many} at {POSITIONS[-1]:,}."
        )
    if not isinstance(programs.get(COMPILED, ""), str):
        few, many = faster(COMPILED, results, 1), faster(COMPILED, results, -1)
        out.append(
            f"Written in C++ the job is {many} times as fast as mechgraph at {POSITIONS[-1]:,} positions, {few} at {POSITIONS[1]}."
        )
    if not isinstance(programs.get(FROM_PYTHON, ""), str):
        few, many = faster(FROM_PYTHON, results, 1), faster(FROM_PYTHON, results, -1)
        out.append(f"From Python Pinocchio is {few} times as fast at {POSITIONS[1]} and {many} at {POSITIONS[-1]:,}.")
    return out


def notes(programs: Programs, results: dict[str, list[dict[str, Result]]], power: float) -> str:
    """In short; machine, versions, date; how each program was used."""
    others = sorted({f"{name.split()[0]} {p.VERSION}" for name, p in programs.items() if getattr(p, "VERSION", "")})
    versions = ", ".join([*others, f"numpy {np.__version__}", f"Python {platform.python_version()}"])
    run = (
        f"One core of {os.cpu_count()} ({processor()}), {versions}, {date.today().isoformat()}. "
        f"The power balance of mechgraph's own solutions is within {power:.0e}."
    )
    missing = "; ".join(f"{name} ({why})" for name, why in programs.items() if isinstance(why, str))
    run += f" Not there: {missing}." if missing else ""
    parts = [" ".join(in_short(programs, results)), f"{run} {MEANING}", LIMITS]
    return "\n\n".join(textwrap.fill(part, WIDTH, break_on_hyphens=False) for part in parts if part)


def main() -> None:
    one_core()
    programs = installed()
    every: dict[str, list[Case]] = {}
    for positions in POSITIONS:
        for case in cases(positions):
            every.setdefault(case.mechanism.name, []).append(case)
    results = {name: [compared(programs, case, ROUNDS[len(case.t)]) for case in of] for name, of in every.items()}
    text = table(programs, every, results)
    print(text)
    if "--write" in sys.argv:
        missing = {name: why for name, why in programs.items() if isinstance(why, str)}
        if missing:
            raise SystemExit(
                f"not written: needs all programs (missing: {missing}); pip install '.[bench]' and a C++ compiler"
            )
        page, times = MARKED.subn(lambda m: m[1] + "\n" + text + "\n" + m[2], PAGE.read_text(encoding="utf-8"))
        if times != 1:
            raise SystemExit("not written: the page has no place marked for the table")
        PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
