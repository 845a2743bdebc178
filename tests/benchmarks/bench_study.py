"""Many variants: ``python tests/benchmarks/bench_study.py [--full]`` (one BLAS thread; with ``--full`` 10,000 variants).

A tolerance study of RCSR (three lengths, two twists, three masses) over 360 positions in this process, and with a process for every
processor; against ``mg.solve`` of single variants in a Python loop, in the same run. ``--compiled``: 2,000 variants x 3 positions in the
compiled kernel on one thread, and with ``--full`` 1,000,000 x 36 with quantiles on all processors.
"""

import os
import resource
import sys
import time
from concurrent.futures import Executor, Future

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import scipy.stats

import mechgraph as mg

POSITIONS = 360
ALONE = 20
WAYS = {
    "length[0]": scipy.stats.norm(0.5, 0.002),
    "length[1]": scipy.stats.norm(0.8, 0.002),
    "length[2]": scipy.stats.norm(0.4, 0.002),
    "twist[0]": scipy.stats.norm(np.deg2rad(12), 0.001),
    "twist[3]": scipy.stats.norm(np.deg2rad(15), 0.001),
    "link1.mass": scipy.stats.uniform(1.9, 0.2),
    "link2.mass": scipy.stats.uniform(4.8, 0.4),
    "link3.mass": scipy.stats.uniform(4.8, 0.4),
}


class Here(Executor):
    """An executor that works in this process."""

    def submit(self, fn, /, *args, **kwargs):
        """Do the work at once."""
        future = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def compiled() -> None:
    """Studies in the kernel: time and memory."""
    m = mg.load("rcsr")
    jobs = [(2_000, 3, Here()), *([(1_000_000, 36, None)] if "--full" in sys.argv else [])]
    for count, positions, executor in jobs:
        motions = {"O1": mg.Motion(np.deg2rad(np.linspace(150, 200, positions)), 0.1, 0.2)}
        for n in (20, count):
            begin = time.perf_counter()
            study = mg.study(
                m,
                WAYS,
                ["O1.effort", "O4.position"],
                n=n,
                seed=1,
                motions=motions,
                executor=executor,
                engine="compiled",
            )
            assert all(np.isfinite(study.quantiles(name)).all() for name in study.outputs)
            seconds = time.perf_counter() - begin
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"{count} x {positions}: {seconds:.2f} s, {seconds / count * 1e6:.0f} us a variant, {memory:.0f} MB")


def main() -> None:
    count = 10_000 if "--full" in sys.argv else 1_000
    m = mg.load("rcsr")
    motions = {"O1": mg.Motion(np.deg2rad(np.linspace(150, 200, POSITIONS)), 0.1, 0.2)}
    outputs = ["O1.effort", "O3.force", "O4.position"]
    print(f"RCSR, {count} variants x {POSITIONS} positions")
    rates = {}
    for name, executor in (("this process", Here()), ("a process for every processor", None)):
        begin = time.perf_counter()
        study = mg.study(m, WAYS, outputs, n=count, seed=1, motions=motions, executor=executor)
        seconds = time.perf_counter() - begin
        rates[name] = count / seconds
        print(
            f"  {name:32s} {seconds:8.1f} s {count * POSITIONS / seconds:10.0f} positions/s, {study.failed.sum()} not solved"
        )
    begin = time.perf_counter()
    for i in range(ALONE):
        s = mg.solve(study.variant(i), motions)
        assert s["O1"].effort.size + s["O3"].force.size
    seconds = (time.perf_counter() - begin) / ALONE
    print(
        f"  mg.solve one by one              {count * seconds:8.1f} s {POSITIONS / seconds:10.0f} positions/s (from {ALONE})"
    )
    print(f"  ratio of the first to the last   {rates['this process'] * seconds:8.1f}")
    print(f"  largest memory of this process   {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:8.0f} MB")


if __name__ == "__main__":
    compiled() if "--compiled" in sys.argv else main()
