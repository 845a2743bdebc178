"""mechgraph beside other programs, complete job against complete job: ``python tests/benchmarks/bench_peers.py [--write]``.

The job: from the driver motion of a closed loop to the driver torque and all reactions at 3,600 positions, from the same numbers
(``peer_cases``), on one core, in one run. Every round does every job once, one after the other; the shortest time of a job
counts. Errors are those of the torque and, where they are unique, of the reaction forces against mechgraph's ``newton_euler``, in
parts of the greatest, after the first hundredth of the cycle. ``--write`` puts the table into the README. A program that is not
installed says so and the others run (``pip install '.[bench]'``).
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

ROUNDS = 5
WIDTH = 138
PEERS = {"Pinocchio": "peer_pinocchio", "Exudyn": "peer_exudyn"}
README = Path(__file__).resolve().parents[2] / "README.md"
MARKED = re.compile(
    r"(<!-- peers: written by tests/benchmarks/bench_peers\.py -->\n).*?(\n<!-- end of peers -->)", re.DOTALL
)


@dataclass(frozen=True)
class Result:
    """What one program made of one case: shortest time, error, redundant constraints; or why it failed."""

    seconds: float = np.nan
    error: float = np.nan
    verdict: str = ""
    failure: str = ""


def installed() -> dict[str, ModuleType | None]:
    """The programs, with None for one that is not installed."""
    found: dict[str, ModuleType | None] = {"mechgraph": peer_mechgraph}
    for name, module in PEERS.items():
        try:
            found[name] = importlib.import_module(module)
        except ImportError:
            found[name] = None
    return found


def one_core() -> None:
    """Stay on one core, where the system lets a process choose."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})


def attempt(program: ModuleType, case: Case) -> tuple[float, np.ndarray]:
    """Seconds of one run, and the torque and the size of the force in every joint."""
    begin = time.perf_counter()
    torque, wrenches = program.solve(case)
    return time.perf_counter() - begin, sizes(program, torque, wrenches)


def sizes(program: ModuleType, torque: np.ndarray, wrenches: np.ndarray) -> np.ndarray:
    """The torque and the sizes of the forces ``(1 + joints, T)``, which do not depend on the frame a program uses."""
    return np.vstack([torque, np.linalg.norm(wrenches[..., program.FORCE], axis=-1)])


def compared(programs: dict[str, ModuleType | None], case: Case, rounds: int) -> dict[str, Result]:
    """All programs on one case."""
    right = sizes(peer_mechgraph, *peer_mechgraph.solve(case, method="newton_euler"))
    out = {}
    runs: dict[str, list[tuple[float, np.ndarray]]] = {name: [] for name, program in programs.items() if program}
    for _ in range(rounds):
        for name in runs:
            if name not in out:
                try:
                    runs[name].append(attempt(programs[name], case))
                except Exception as error:
                    out[name] = Result(failure=(str(error) or repr(error)).splitlines()[0][:60])
    for name in runs.keys() - out.keys():
        seconds, found = min(runs[name], key=lambda run: run[0])
        out[name] = Result(seconds, largest_error(found, right), programs[name].verdict(case))
    return out


def largest_error(found: np.ndarray, right: np.ndarray) -> float:
    """Of the torque, and of the forces where all are unique, each in parts of its own greatest; the start is left out."""
    if found.shape != right.shape:
        return np.inf
    rows = slice(None) if np.isfinite(right).all() else slice(0, 1)
    errors = np.abs(found - right)[rows, right.shape[1] // 100 :].max(axis=1)
    return float((errors / np.abs(right[rows]).max(axis=1)).max())


def balance(case: Case) -> float:
    """Largest power balance of mechgraph's solution, relative."""
    s = mg.solve(case.mechanism, {case.driver: case.motion})
    return float(np.abs(s.checks.power).max())


def lines_of(program: ModuleType) -> int:
    """Lines of code of the job: functions and imports, without docstrings, blank lines and what only the table needs."""
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


def cell(result: Result | None, base: float) -> str:
    """Time, ratio to mechgraph and error."""
    if result is None:
        return "not installed"
    if result.failure:
        return f"fails: {result.failure}"
    ratio = "" if result.seconds == base else f" (x {result.seconds / base:.1f})"
    return f"{result.seconds:.3f} s{ratio}, {result.error:.0e}"


def row(*cells: str) -> str:
    """A row of a Markdown table."""
    return f"| {' | '.join(cells)} |"


def said(name: str, results: list[dict[str, Result]]) -> str:
    """Redundant constraints that a program finds, mechanism by mechanism."""
    words = [found[name].verdict or found[name].failure for found in results if name in found]
    return ", ".join(words) if any(words) else "no count" if words else "not installed"


def table(programs: dict[str, ModuleType | None], every: tuple[Case, ...], results: list[dict[str, Result]]) -> str:
    """The table and what it does not show."""
    heads = [f"{name} {program.VERSION}".strip() if program else name for name, program in programs.items()]
    lines = [row("mechanism", "loop", *heads, "power balance"), row(*["---"] * (len(heads) + 3))]
    for case, found in zip(every, results, strict=True):
        base = found["mechgraph"].seconds
        loop = "-".join(joint.kind for joint in case.joints)
        cells = [cell(found.get(name), base) for name in programs]
        lines.append(row(case.mechanism.name, loop, *cells, f"{balance(case):.0e}"))
    counts = [str(lines_of(program)) if program else "not installed" for program in programs.values()]
    lines.append(row("lines of code of the job", "", *counts, ""))
    lines.append(row("redundant constraints found", "", *(said(name, results) for name in programs), ""))
    return "\n".join(lines) + "\n\n" + notes(programs)


MEANING = (
    "In brackets the ratio to mechgraph; behind the comma the largest error of the torque and, where they are unique, of the reaction "
    "forces against mechgraph's other force method, in parts of the greatest, without the first hundredth of the cycle. The power "
    "balance is that of mechgraph's own solution. Lines of code: without docstrings, from the same numbers for all."
)
LIMITS = (
    "What it does not show: Pinocchio and Exudyn were used through their Python interfaces by people who know mechgraph better. Pinocchio "
    "is called position by position; its C++ interface was not measured. Exudyn integrates the motion: its error falls with its step; it "
    "was given the initial velocities, and a spectral radius and Newton tolerance that on these four gave less error than its defaults "
    "in about the same time (a dozen settings tried). Where constraints are redundant its default solver stops (`matrix is not "
    "factorized!`), so another was set; it counts them but does not say which reactions they leave open. Single positions, large "
    "mechanisms and simulation in time, for which the two are made, are not in the table."
)


def notes(programs: dict[str, ModuleType | None]) -> str:
    """Machine, versions, date, and what the table does not show."""
    others = [f"{name} {program.VERSION}" for name, program in programs.items() if program and program.VERSION]
    versions = ", ".join([*others, f"numpy {np.__version__}", f"Python {platform.python_version()}"])
    run = (
        f"{POSITIONS:,} positions each: shortest of {ROUNDS} rounds on one core of {os.cpu_count()} ({processor()}), "
        f"{versions}, {date.today().isoformat()}."
    )
    return "\n\n".join(textwrap.fill(part, WIDTH) for part in (f"{run} {MEANING}", LIMITS))


def main() -> None:
    rounds = next((int(word) for word in sys.argv[1:] if word.isdigit()), ROUNDS)
    one_core()
    programs, every = installed(), cases()
    text = table(programs, every, [compared(programs, case, rounds) for case in every])
    print(text)
    if "--write" in sys.argv:
        missing = [name for name, program in programs.items() if program is None]
        if missing or rounds != ROUNDS:
            raise SystemExit(
                f"not written: needs {ROUNDS} rounds and all programs (missing: {missing}); pip install '.[bench]'"
            )
        page, times = MARKED.subn(lambda m: m[1] + "\n" + text + "\n" + m[2], README.read_text(encoding="utf-8"))
        if times != 1:
            raise SystemExit("not written: the README has no place marked for the table")
        README.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
