"""Motion under given loads beside other programs: ``python tests/benchmarks/bench_response.py [--write] [--rows 1,2,10]``.

The job: from declared bodies and joints to the positions of one point over time, by each program at the coarsest setting (tolerance or
step) at which that point is nowhere further off than the wanted accuracy; all of them in one run, on one core, processor times.
mechgraph returns all reactions with it, the others are not asked for any. Variants of a program are all tried, the fastest counts.
``--write`` puts the table into docs/comparison.md.
"""

import importlib
import multiprocessing
import os
import platform
import re
import signal
import sys
import textwrap
import time
from dataclasses import dataclass
from datetime import date
from types import ModuleType

import numpy as np
from bench_peers import PAGE, WIDTH, one_core, processor, row, short
from motion_cases import ROWS, Case, others
from motion_cases import row as row_of
from motion_mechgraph import SMALL

ACCURACIES = (1e-3, 1e-6)
"""Wanted accuracies, in parts of the size of a mechanism."""
LIMIT = 3.0
"""Processor seconds after which a run of another program is ended, or twice those of mechgraph where these are more."""
STALE = 4
"""Settings, one finer than the other, after which a variant is left that is no nearer to the reference."""
ROUNDS = 3
"""Runs at the setting found, at most; fewer where they take long."""
PROGRAMS = {
    "mechgraph": "motion_mechgraph",
    "mechgraph compiled": "motion_compiled",
    "Pinocchio": "motion_pinocchio",
    "Exudyn": "motion_exudyn",
}
MARKED = re.compile(
    r"(<!-- motion: written by tests/benchmarks/bench_response\.py -->\n).*?(\n<!-- end of motion -->)", re.DOTALL
)


@dataclass(frozen=True)
class Run:
    """The fastest way of a program to an accuracy, or why there is none."""

    seconds: float = np.inf
    error: float = np.inf
    variant: str = ""
    place: int = 0
    failure: str = ""


def once(program: ModuleType, case: Case, variant: str, place: int) -> tuple[float, float, str]:
    """Seconds and error of a run, and why it failed."""
    begin = time.process_time()
    try:
        found = program.solve(case, variant, program.ladder(case, variant)[place])
    except Exception as error:
        return time.process_time() - begin, np.inf, (str(error) or type(error).__name__).splitlines()[0][:50]
    return time.process_time() - begin, case.error(found), ""


def limited(program: ModuleType, case: Case, variant: str, place: int, most: float) -> tuple[float, float, str]:
    """The same in a process of its own, which the system ends after so many processor seconds."""
    if most == np.inf:
        return once(program, case, variant, place)
    here, there = multiprocessing.Pipe(duplex=False)

    def run() -> None:
        signal.setitimer(signal.ITIMER_PROF, most)
        there.send(once(program, case, variant, place))

    process = multiprocessing.get_context("fork").Process(target=run)
    process.start()
    there.close()
    try:
        return here.recv()
    except EOFError:
        return most, np.inf, f"over {short(most)} s"
    finally:
        process.join()


def climbed(program: ModuleType, case: Case, variant: str, first: int, most: float) -> list[Run]:
    """The coarsest settings that reach the accuracies, one after the other, in at most so many seconds each."""
    out: list[Run] = []
    place = first
    while place and limited(program, case, variant, place, most)[1] <= ACCURACIES[0]:
        place -= 1  # a smaller row may have asked for more
    why, errors = "not reached", [np.inf]
    steps = len(program.ladder(case, variant))
    while len(out) < len(ACCURACIES) and place < steps:
        took, error, failure = limited(program, case, variant, place, most)
        why = failure or why
        errors.append(error)
        if took >= most:
            why = failure
            break
        if len(errors) > STALE and min(errors[-STALE:]) >= 0.5 * min(errors[:-STALE]) < np.inf:
            why = failure or f"error stays {error:.0e}"
            break
        while len(out) < len(ACCURACIES) and error <= ACCURACIES[len(out)]:
            out.append(Run(took, error, variant, place))
        place += 1
    return out + [Run(failure=why)] * (len(ACCURACIES) - len(out))


def fastest(program: ModuleType, case: Case, before: list[Run], most: float) -> list[Run]:
    """For every accuracy the fastest variant, timed again; ``before``: those of the smaller row, from which the search begins."""
    best = [Run(failure="not reached")] * len(ACCURACIES)
    best_before = {run.variant for run in before if run.seconds < np.inf}
    for variant in program.variants(case):
        if best_before and variant not in best_before:
            continue
        known = [run.place for run in before if run.variant == variant and run.seconds < np.inf]
        for i, run in enumerate(climbed(program, case, variant, min(known, default=0), most)):
            if run.seconds < best[i].seconds or (best[i].seconds == np.inf and not best[i].failure.startswith("over")):
                best[i] = run
    return [again(program, case, run) if run.seconds < np.inf else run for run in best]


def again(program: ModuleType, case: Case, run: Run) -> Run:
    """The run with the median time of some more."""
    rounds = int(np.clip(1.0 / run.seconds, 1, ROUNDS))
    times = [once(program, case, run.variant, run.place)[0] for _ in range(rounds)]
    return Run(float(np.median(times)), run.error, run.variant, run.place)


def cell(run: Run, base: Run) -> str:
    """Time and ratio to mechgraph."""
    if run.seconds == np.inf:
        return run.failure
    ratio = "" if run is base else f" (x {short(run.seconds / base.seconds)})"
    return f"{short(run.seconds)} s{ratio}"


def exponent(found: dict[int, list[Run]], place: int) -> str:
    """Growth of the time with the length of the row, from 40 to the longest."""
    times = {n: runs[place].seconds for n, runs in found.items() if n >= 40 and runs[place].seconds < np.inf}
    if len(times) < 2:
        return "-"
    n = sorted(times)
    return f"{np.log(times[n[-1]] / times[n[0]]) / np.log(n[-1] / n[0]):.2f} (N = {n[0]} to {n[-1]})"


def table(names: list[str], lines: list[tuple[str, dict[str, list[Run]]]], grown: list[str]) -> str:
    """Times by mechanism and accuracy."""
    heads = [f"{name}, {accuracy:.0e}" for accuracy in ACCURACIES for name in names]
    out = [row("mechanism", *heads), row(*["---"] * (len(heads) + 1))]
    for label, found in lines:
        cells = [
            cell(found[name][i], found["mechgraph"][i]) if name in found else "-"
            for i in range(len(ACCURACIES))
            for name in names
        ]
        out.append(row(label, *cells))
    return "\n".join([*out, row("growth with N", *grown)])


def told(lines: list[tuple[str, dict[str, list[Run]]]]) -> str:
    """What the table says at the finer accuracy."""
    out = []
    for peer in [name for name in lines[0][1] if not name.startswith("mechgraph")]:
        faster, slower, failed = [], [], []
        for label, found in lines:
            ours = [runs[-1] for name, runs in found.items() if name.startswith("mechgraph")]
            base, run = min(ours, key=lambda one: one.seconds), found[peer][-1]
            if base.seconds == np.inf or (run.failure and not run.failure.startswith("over")):
                failed.append(f"{label} ({base.failure or run.failure})")
            elif base.seconds < run.seconds:
                faster.append(label)
            else:
                slower.append(f"{label} (x {short(run.seconds / base.seconds)})")
        how = f"{ACCURACIES[-1]:.0e} mechgraph, with the kernel where it serves,"
        parts = [f"Against {peer} at {how} is faster on {'; '.join(faster) or 'nothing'}"]
        parts += [f"slower on {'; '.join(slower)}"] * bool(slower) + [f"not compared on {'; '.join(failed)}"] * bool(
            failed
        )
        out.append(", ".join(parts) + ".")
    return " ".join(out)


MEANING = (
    "Each program at the coarsest tolerance or step at which a point of the mechanism is nowhere further off than 1e-3 or 1e-6 of a rod's "
    "length; median processor times, in brackets against mechgraph (above 1: mechgraph is faster). A run of another program that "
    f"took more than {LIMIT:g} s, or twice the time of mechgraph where that is more, was ended ('over'); other words in place of a "
    "time are how that program's own run ended; it is not run again on longer rows. Of many links the kernel solves none. "
    "References: A2 its one-freedom equation, "
    "the others mechgraph at 1e-10. mechgraph returns all reactions with the motion, the others were asked for one point. "
    "Pinocchio: classical Runge-Kutta steps of our own or scipy's DOP853 around `constraintDynamics` with Baumgarte's stabilization, for "
    "Bricard also around `lcaba`; that leaves the stabilization out, so that it loses the row of four-bars at its flat position, and it "
    "was given up on Andrews' mechanism. The governor, which has no loops, by `aba` and LSODA. Exudyn: planar bodies where the "
    "mechanism is planar, its two implicit solvers with default settings (its "
    "explicit ones refuse joints), the solver that ignores redundant constraints where there are any. "
    "Written by people who know mechgraph better."
)


def measured(programs: dict[str, ModuleType], case: Case, before: dict[str, list[Run]]) -> dict[str, list[Run]]:
    """The runs of all programs, mechgraph first, by whose time the others are limited."""
    found: dict[str, list[Run]] = {}
    for name, program in programs.items():
        if name == "mechgraph compiled" and len(case.mechanism.links) >= SMALL:
            continue
        if name in before and all(run.failure.startswith("over") for run in before[name]):
            found[name] = before[name]
            continue
        longest = max((run.seconds for run in found.get("mechgraph", []) if run.seconds < np.inf), default=0.0)
        most = max(LIMIT, 2.0 * longest) if found else np.inf
        found[name] = fastest(program, case, before.get(name, []), most)
        print(case.name, name, *(f"{cell(r, r)} {r.variant} {r.error:.0e}" for r in found[name]), sep="  ", flush=True)
    return found


def installed() -> tuple[dict[str, ModuleType], list[str]]:
    """The programs that are there, and the names of the others."""
    found, missing = {}, []
    for name, module in PROGRAMS.items():
        try:
            found[name] = importlib.import_module(module)
        except ImportError:
            missing.append(name)
    return found, missing


def main() -> None:
    one_core()
    programs, missing = installed()
    rows = [int(n) for n in sys.argv[sys.argv.index("--rows") + 1].split(",")] if "--rows" in sys.argv else list(ROWS)
    lines: list[tuple[str, dict[str, list[Run]]]] = []
    by_length: dict[str, dict[int, list[Run]]] = {name: {} for name in programs}
    before: dict[str, list[Run]] = {}
    for program in programs.values():  # what is loaded and compiled at first use counts for none
        once(program, row_of(1), program.variants(row_of(1))[0], 0)
    for case, n in [*((row_of(n), n) for n in rows), *((case, 0) for case in others())]:
        found = measured(programs, case, before if n else {})
        lines.append((f"{case.name}, N = {n}" if n else case.name, found))
        for name, runs in found.items():
            if n:
                by_length[name][n] = runs
                before[name] = runs
    names = list(PROGRAMS)
    grown = [exponent(by_length.get(name, {}), i) for i in range(len(ACCURACIES)) for name in names]
    versions = ", ".join(f"{name} {p.VERSION}" for name, p in programs.items() if p.VERSION)
    versions = f"{versions}{', ' * bool(versions)}numpy {np.__version__}, Python {platform.python_version()}, {date.today().isoformat()}"
    run = f"One core of {os.cpu_count()} ({processor()}), {versions}."
    run += f" Not there: {', '.join(missing)}." if missing else ""
    parts = [told(lines), f"{run} {MEANING}"]
    text = "\n\n".join(
        [table(names, lines, grown), *(textwrap.fill(part, WIDTH, break_on_hyphens=False) for part in parts)]
    )
    print(text)
    if "--write" in sys.argv:
        if missing:
            raise SystemExit(f"not written: needs all programs (missing: {', '.join(missing)}); pip install '.[bench]'")
        page, times = MARKED.subn(lambda m: m[1] + "\n" + text + "\n" + m[2], PAGE.read_text(encoding="utf-8"))
        if times != 1:
            raise SystemExit("not written: the page has no place marked for the table")
        PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
