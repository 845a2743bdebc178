"""Motion under given loads beside other programs: ``python tests/benchmarks/bench_response.py [--write] [--rows 1,2,10]``.

The job: from declared bodies and joints to the positions of one point over time, by each program at the coarsest setting (tolerance or
step) at which that point is nowhere further off than the wanted accuracy; all of them in one run, on one core, processor times.
mechgraph returns all reactions with it, the others are not asked for any. Variants of a program are all tried, the fastest counts.
``--write`` puts the table into the README.
"""

import importlib
import os
import platform
import re
import sys
import textwrap
import time
from dataclasses import dataclass
from datetime import date
from types import ModuleType

import numpy as np
from bench_peers import README, WIDTH, one_core, processor, row, short
from motion_cases import ROWS, Case, others
from motion_cases import row as row_of

ACCURACIES = (1e-3, 1e-6)
"""Wanted accuracies, in parts of the size of a mechanism."""
LIMIT = 5.0
"""Seconds above which no longer row is tried."""
FINER = 2.5
"""Seconds above which no finer setting is tried."""
STALE = 4
"""Settings, one finer than the other, after which a variant is left that is no nearer to the reference."""
ROUNDS = 5
"""Runs at the setting found, at most; fewer where they take long."""
PROGRAMS = {"mechgraph": "motion_mechgraph", "Pinocchio": "motion_pinocchio", "Exudyn": "motion_exudyn"}
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
        return time.process_time() - begin, np.inf, (str(error) or repr(error)).splitlines()[0][:50]
    return time.process_time() - begin, case.error(found), ""


def climbed(program: ModuleType, case: Case, variant: str, first: int, most: float) -> list[Run]:
    """The coarsest settings that reach the accuracies, one after the other; ``most`` seconds are worth a run."""
    out: list[Run] = []
    place = first
    while place and once(program, case, variant, place)[1] <= ACCURACIES[0]:
        place -= 1  # a smaller row may have asked for more
    why, took, errors = "", 0.0, [np.inf]
    steps = len(program.ladder(case, variant))
    while len(out) < len(ACCURACIES) and place < steps and took < most:
        took, error, why = once(program, case, variant, place)
        errors.append(error)
        if len(errors) > STALE and min(errors[-STALE:]) >= 0.5 * min(errors[:-STALE]) < np.inf:
            why = why or f"error stays {error:.0e}"
            break
        while len(out) < len(ACCURACIES) and error <= ACCURACIES[len(out)]:
            out.append(Run(took, error, variant, place))
        place += 1
    why = why or (f"over {short(2 * took)} s" if place < steps else "not reached")
    return out + [Run(failure=why)] * (len(ACCURACIES) - len(out))


def fastest(program: ModuleType, case: Case, before: list[Run]) -> list[Run]:
    """For every accuracy the fastest variant, timed again; ``before``: those of the smaller row, from which the search begins."""
    best = [Run(failure="not reached")] * len(ACCURACIES)
    if before and before[0].seconds > LIMIT:
        return [Run(failure="not run")] * len(ACCURACIES)
    for variant in program.variants(case):
        known = [run.place for run in before if run.variant == variant]
        if before and not known:
            continue
        for i, run in enumerate(climbed(program, case, variant, min(known, default=0), FINER)):
            if run.seconds < best[i].seconds or (best[i].seconds == np.inf and run.failure):
                best[i] = run
    return [again(program, case, run) if run.seconds < np.inf else run for run in best]


def again(program: ModuleType, case: Case, run: Run) -> Run:
    """The run with the median time of some more."""
    rounds = int(np.clip(2.0 / run.seconds, 1, ROUNDS))
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
        cells = [cell(found[name][i], found["mechgraph"][i]) for i in range(len(ACCURACIES)) for name in names]
        out.append(row(label, *cells))
    return "\n".join([*out, row("growth with N", *grown)])


MEANING = (
    "Each program at the coarsest tolerance or step at which a point of the mechanism is nowhere further off than 1e-3 or 1e-6 of a rod's "
    "length; median processor times, in brackets against mechgraph (above 1: mechgraph is faster). References: A2 its one-freedom "
    "equation, the others mechgraph at 1e-10. mechgraph returns all reactions with the motion, the others were asked for one point. "
    "Pinocchio: classical Runge-Kutta steps of our own or scipy's DOP853 around `constraintDynamics` with Baumgarte's stabilization, for "
    "Bricard also around `lcaba`; that leaves the stabilization out, so that it loses the row of four-bars at its flat position, and it "
    "was given up on Andrews' mechanism. The governor, which has no loops, by `aba` and LSODA. Exudyn: planar bodies where the "
    "mechanism is planar, its two implicit solvers with default settings (its "
    "explicit ones refuse joints), the solver that ignores redundant constraints where there are any. A time limit says that the next "
    "finer setting was not tried. Written by people who know mechgraph better."
)


def main() -> None:
    one_core()
    programs = {name: importlib.import_module(module) for name, module in PROGRAMS.items()}
    rows = [int(n) for n in sys.argv[sys.argv.index("--rows") + 1].split(",")] if "--rows" in sys.argv else list(ROWS)
    lines: list[tuple[str, dict[str, list[Run]]]] = []
    by_length: dict[str, dict[int, list[Run]]] = {name: {} for name in programs}
    before: dict[str, list[Run]] = {}
    for case, n in [*((row_of(n), n) for n in rows), *((case, 0) for case in others())]:
        found = {name: fastest(program, case, before.get(name, []) if n else []) for name, program in programs.items()}
        label = f"{case.name}, N = {n}" if n else case.name
        lines.append((label, found))
        for name, runs in found.items():
            print(label, name, *(f"{cell(r, r)} {r.variant} {r.error:.0e}" for r in runs), sep="  ", flush=True)
            if n:
                by_length[name][n] = runs
                before[name] = runs
    names = list(programs)
    grown = [exponent(by_length[name], i) for i in range(len(ACCURACIES)) for name in names]
    versions = ", ".join(f"{name} {p.VERSION}" for name, p in programs.items() if p.VERSION)
    versions = f"{versions}, numpy {np.__version__}, Python {platform.python_version()}, {date.today().isoformat()}"
    run = f"One core of {os.cpu_count()} ({processor()}), {versions}."
    text = table(names, lines, grown) + "\n\n" + textwrap.fill(f"{run} {MEANING}", WIDTH)
    print(text)
    if "--write" in sys.argv:
        page, times = MARKED.subn(lambda m: m[1] + "\n" + text + "\n" + m[2], README.read_text(encoding="utf-8"))
        if times != 1:
            raise SystemExit("not written: the README has no place marked for the table")
        README.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
