"""All assemblies and branch maps: ``python tests/benchmarks/bench_modes.py [--platform]``.

Every question is asked twice, without a start set kept and with it. Printed, never asserted; the aims stand beside the times.
"""

import os
import sys
import tempfile
import time

import numpy as np

import mechgraph as mg


def platform(seed: int = 0) -> mg.Mechanism:
    """A general platform of six driven legs between balls."""
    rng = np.random.default_rng(seed)
    pairs = []
    for i in range(6):
        foot, head = rng.normal(size=3), rng.normal(size=3) + np.array([0, 0, 3])
        pairs += [
            mg.Pair(f"A{i}", "S", "base", f"lower{i}", point=foot),
            mg.Pair(f"P{i}", "P", f"lower{i}", f"upper{i}", point=foot, axis=head - foot),
            mg.Pair(f"B{i}", "S", f"upper{i}", "platform", point=head),
        ]
    return mg.Mechanism("platform", pairs=pairs, drives=[f"P{i}" for i in range(6)], frame="base")


def timed(name: str, ask: object, aims: tuple[float, float]) -> None:
    """Times of a question without and with a start set."""
    for word, aim in zip(("without a start set", "with it"), aims, strict=True):
        begin, cpu = time.perf_counter(), time.process_time()
        found = ask()
        wall, cpu = time.perf_counter() - begin, time.process_time() - cpu
        what = (
            f"{found.total} over C, {len(found)} real" if isinstance(found, mg.Assemblies) else f"{len(found)} branches"
        )
        print(
            f"{name:28} {word:20} {wall:8.2f} s wall {cpu:8.2f} s CPU   aim {aim:g} s   {what}, {found.completeness}",
            flush=True,
        )


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        os.environ["MECHGRAPH_CACHE"] = folder
        seven, rssr = mg.load("7r"), mg.load("rssr")
        timed("7R", lambda: mg.assemblies(seven, {"O1": 0.3}), (10, 0.5))
        timed("RSSR, 720 driver values", lambda: mg.branches(rssr, "A"), (np.inf, 0.5))
        if "--platform" in sys.argv:
            m = platform()
            timed("Gough-Stewart", lambda: mg.assemblies(m, {f"P{i}": 0.0 for i in range(6)}), (60, 0.3))


if __name__ == "__main__":
    main()
