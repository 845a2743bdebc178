"""Times of ``mg.check`` and of the printed report: python tests/benchmarks/bench_check.py [--all]."""

import sys
from itertools import pairwise
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import mechanisms as known

import mechgraph as mg


def measure(m: mg.Mechanism) -> tuple[mg.DeterminacyReport, float, float, float]:
    """The report, and seconds for check, text and JSON."""
    times = [perf_counter()]
    report = mg.check(m)
    times.append(perf_counter())
    str(report)
    times.append(perf_counter())
    report.to_json()
    times.append(perf_counter())
    check, text, json = (b - a for a, b in pairwise(times))
    return report, check, text, json


def main() -> None:
    """Print a table over growing chains and grids."""
    full = "--all" in sys.argv
    chains = [5, 24, 50, 100, 200, 500, 1000] + [2000, 4000] * full
    grids = [3, 5, 8, 16, 24, 32] + [45, 60] * full
    print(f"{'mechanism':24} {'links':>6} {'loops':>6} {'check s':>8} {'text s':>8} {'json s':>8}  mobility redundancy")
    for m in (*map(known.windows, chains), *map(known.grid, grids)):
        report, check, text, json = measure(m)
        print(
            f"{m.name:24} {len(m.links):6} {len(report.loops):6} {check:8.3f} {text:8.3f} {json:8.3f}"
            f"  {report.mobility:8} {report.redundancy:10}"
        )


if __name__ == "__main__":
    main()
