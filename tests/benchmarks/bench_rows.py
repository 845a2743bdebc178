"""Paths by the reduced form (rods and spheres as rows of points) beside those by loops: ``python tests/benchmarks/bench_rows.py``.

Timed in turn in one run, the shortest of some rounds: the whole of a solution with rates, reactions and checks.
"""

import os
import sys
import time
import warnings
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import machines
import mechanisms as known
import numpy as np

import mechgraph as mg
from mechgraph.kinematics.prescribed import DriverMotion
from mechgraph.kinetostatics import Pipeline
from mechgraph.outcome import Options

ROUNDS = 5
FORMS = ("full", "reduced")
CASES = {
    "five-rod suspension": (machines.five_rods, 0.05),
    "6-PSS": (machines.sliders, 0.1),
    "6-SPS": (lambda: known.hexapod("SPS"), 0.1),
    "rods, spheres, planes": (lambda: machines.random_platforms(0), 0.02),
    "RSSR": (lambda: mg.load("rssr"), 0.5),
    "6-UPS": (known.hexapod, 0.1),
    "RCSR": (lambda: mg.load("rcsr"), 0.5),
    "R-Sp-R": (lambda: mg.load("r-sp-r"), 0.5),
    "R-Sg-C": (lambda: mg.load("r-sg-c"), 0.5),
}


def main() -> None:
    warnings.simplefilter("ignore")
    for name, (make, size) in CASES.items():
        m = make()
        for count in (36, 360, 3600):
            drives = enumerate(m.drives)
            motion = DriverMotion(
                m, {d.freedom: machines.sine(m, d.freedom, size * np.cos(k), count) for k, d in drives}
            )
            took: dict[str, list[float]] = {form: [] for form in FORMS}
            for _ in range(ROUNDS):
                for form in FORMS:
                    begin = time.perf_counter()
                    Pipeline(motion, Options(form=form)).run()
                    took[form].append(time.perf_counter() - begin)
            full, reduced = (1e3 * min(took[form]) for form in FORMS)
            own = "full" if Pipeline(motion, Options()).reduction is None else "reduced"
            print(f"{name}, {count}: full {full:.1f} ms, reduced {reduced:.1f} ms ({reduced / full:.2f}), taken: {own}")


if __name__ == "__main__":
    main()
