"""Times of the core, printed, never asserted: ``python tests/benchmarks/bench_core.py`` (one BLAS thread)."""

import os
import subprocess
import sys
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
from strategies import body, unit

import mechgraph as mg


def best(run, repeat=5):
    """Shortest of some runs, seconds."""
    times = []
    for _ in range(repeat):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return min(times)


def seven_r():
    """A 7R loop whose input turns fully: found among random geometries with a short crank."""
    for seed in range(200):
        rng = np.random.default_rng(seed)
        points = rng.uniform(-1, 1, (7, 3))
        points[1] = points[0] + 0.12 * unit(rng)
        names = ["frame", *(f"l{k}" for k in range(1, 7))]
        links = [mg.Link("frame"), *(body(rng, k, rng.uniform(-1, 1, 3)) for k in names[1:])]
        pairs = [mg.Pair(f"J{k}", "R", names[k], names[(k + 1) % 7], point=points[k], axis=unit(rng)) for k in range(7)]
        m = mg.Mechanism(f"7R {seed}", links=links, pairs=pairs, drives=["J0"], loads=[mg.Gravity((0, 0, -9.81))])
        try:
            if (mg.kinematics(m, {"J0": np.linspace(0, 2 * np.pi, 73)}, on_reach="flag").status == "ok").all():
                return m
        except mg.MechgraphError:
            continue
    raise SystemExit("no 7R loop with a full turn found")


def many_links(n=50):
    """A ladder of planar four-bars: ``n`` links."""
    pairs = [mg.Pair("A0", "R", "frame", "c0", point=(0, 0, 0), axis=(0, 0, 1))]
    k = 0
    while len({x for p in pairs for x in (p.a, p.b)}) < n:
        pairs += [
            mg.Pair(f"B{k}", "S", f"c{k}", f"r{k}", point=(k, 1, 0)),
            mg.Pair(f"C{k}", "U", f"r{k}", f"c{k + 1}", point=(k + 1, 1.1, 0.3), axis=(0, 0.1, 1), second=(1, 0, 0)),
            mg.Pair(f"A{k + 1}", "R", "frame", f"c{k + 1}", point=(k + 1, 0, 0), axis=(0, 0, 1)),
        ]
        k += 1
    return mg.Mechanism("ladder", pairs=pairs, drives=["A0"])


def main():
    root = Path(__file__).resolve().parents[2]
    code = "import time; t = time.perf_counter(); import mechgraph; print(time.perf_counter() - t)"
    importing = min(
        float(subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True).stdout)
        for _ in range(3)
    )
    print(f"import mechgraph                     {importing * 1e3:8.1f} ms  (bar 500)")
    m = seven_r()
    drive = {"J0": mg.Motion(np.linspace(0, 2 * np.pi, 3600, endpoint=False), 10.0)}
    for method in ("loop_wrench", "newton_euler"):

        def run(method=method):
            s = mg.solve(m, drive, method=method)
            for p in m.pairs:
                assert np.isfinite(s[p.name].reaction).all()
            assert s.checks.equilibrium.max() < 1e-9

        print(f"7R x 3600, {method:12s}             {best(run, 3) * 1e3:8.1f} ms  (bar 500)")
    print(
        f"7R x 3600, kinematics                {best(lambda: mg.kinematics(m, drive)['J0'].position, 3) * 1e3:8.1f} ms"
    )
    ladder = many_links()

    def check():
        report = mg.check(ladder)
        report.mobility, report.redundancy, report.unique, report.ledger("lee")

    print(f"check of {len(ladder.links)} links                   {best(check) * 1e3:8.1f} ms  (bar 100)")
    print(
        f"check of {len(ladder.links)} links, printed          {best(lambda: str(mg.check(ladder)), 2) * 1e3:8.1f} ms"
    )


if __name__ == "__main__":
    main()
