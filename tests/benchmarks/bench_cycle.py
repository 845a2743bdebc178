"""One cycle, positions to all reactions, against dense solves: ``python tests/benchmarks/bench_cycle.py [--quick]``.

Timed is all of it: ``mg.solve`` with driver rates and gravity, the reaction of every pair, the efforts of the drivers, the checks. Beside
it, in the same run, ``np.linalg.solve`` of as many systems as the full equations of the mechanism have (Lee 1977). One BLAS thread.
"""

import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import mechanisms
import numpy as np
from bench_core import best, seven_r

import mechgraph as mg

TURN = (0.0, 360.0)


def with_gravity(m):
    if any(isinstance(load, mg.Gravity) for load in m.loads):
        return m
    return m.replace(loads=[*m.loads, mg.Gravity((0.0, 0.0, -9.81))])


def cases():
    """Mechanism, range of the driver in degrees, size n of the dense system, goal as a multiple of its time."""
    bricard = mechanisms.bricard_cube()
    return [
        ("7R", seven_r(), TURN, 50, 1.0),
        ("RCSR", mg.load("rcsr"), (150.0, 204.0), 24, 3.0),
        ("RCSR-CSR", mg.load("rcsr-csr"), (160.0, 214.0), 40, 2.0),
        ("four-bar", mg.load("four-bar"), TURN, 24, None),
        ("Bennett", mg.load("bennett"), (30.055, 390.055), 24, None),
        ("Bricard", bricard.replace(drives=["O1"]), (0.0, 200.0), 42, None),
    ]


def cycle(m, span, n):
    """A function that solves one cycle and asks for all results."""
    name = m.drives[0].freedom
    drive = {name: mg.Motion(np.radians(np.linspace(*span, n, endpoint=False)), 10.0)}

    def run():
        s = mg.solve(m, drive)
        for pair in m.pairs:
            assert s[pair.name].reaction.shape[-1] == 6
        checks = s.checks
        assert np.isfinite(s[name.split(".")[0]].effort).all()
        assert checks.closure.max() < 1e-12
        assert checks.equilibrium.max() < 1e-12
        return s

    return run


def dense(n, count, repeat):
    rng = np.random.default_rng(0)
    A, b = rng.normal(size=(count, n, n)), rng.normal(size=(count, n, 1))
    return best(lambda: np.linalg.solve(A, b), repeat)


def main():
    quick = "--quick" in sys.argv
    repeat = 3 if quick else 9
    print(
        f"{'mechanism':10s} {'positions':>9s} {'ms':>8s} {'1000/s':>8s} {'n':>4s} {'n x n ms':>9s} {'ratio':>6s} {'goal':>6s}"
    )
    reference = None
    for name, bare, span, n, goal in cases():
        m = with_gravity(bare)
        lapack = dense(n, 3600, repeat)
        for count in (73, 3600) if quick else (73, 3600, 36000):
            seconds = best(cycle(m, span, count), repeat if count < 10000 else 3)
            line = f"{name:10s} {count:9d} {1e3 * seconds:8.1f} {count / seconds / 1e3:8.1f}"
            if count == 3600:
                reference = seconds if name == "RCSR" else reference
                wanted = f"{goal:6.1f}" if goal else f"  {seconds / reference:4.2f} of RCSR (1.5)"
                line += f" {n:4d} {1e3 * lapack:9.1f} {seconds / lapack:6.2f} {wanted}"
            if count == 36000 and name == "7R":
                line += "  goal 150"
            print(line, flush=True)


if __name__ == "__main__":
    main()
