"""Kinetostatics of large mechanisms: ``python tests/benchmarks/bench_large.py [--all] [kind ...]``, or ``--crossover`` or ``--groups``.

For ladders, grids, scissors, trees of loops and spatial ladders: seconds to declare; to solve one position from a closed start (one
driver, gravity, driver rate 1, all reactions) for the first time, when links and pairs are read and the graph is made, and once more with
another rate, when only the equations are new; to read one pair; the exponent of growth of the first and of the second ``solve`` against
the size before; the time of one factorization and solution by scipy's splu of a regular matrix of the size and pattern of the
Newton-Euler equations, which has six rows a moving link and as many reaction components and efforts, and both times over it; and the
peak of memory. Every row is measured in a process of its own.
"""

import os
import resource
import subprocess
import sys
from math import log
from pathlib import Path
from time import perf_counter, process_time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np
import scipy
from lattices import LATTICES

import mechgraph as mg
from mechgraph.graph.linkgraph import link_graph
from mechgraph.kinematics.assembly import assembled
from mechgraph.kinematics.sparse_system import LoopSystem
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import indexed
from mechgraph.maths.linear import SparseFactors

SIZES = [10, 100, 1_000, 10_000, 100_000]


def regular_matrix(m: mg.Mechanism) -> scipy.sparse.csc_array:
    """Random values in the pattern of the Newton-Euler equations, made square by a matching, whose entries are large (regular)."""
    graph = link_graph(m)
    rng = np.random.default_rng(0)
    rows, cols, at = [], [], 0
    for k, ends in enumerate(graph.ends):
        width = 6 - m.pairs[k].type.f + (k == 0)
        for link in ends:
            if link != graph.frame:
                row = link - (link > graph.frame)
                rows.append(6 * row + np.repeat(np.arange(6), width))
                cols.append(np.tile(at + np.arange(width), 6))
        at += width
    i, j = np.concatenate(rows), np.concatenate(cols)
    A = scipy.sparse.csr_array((rng.normal(size=len(i)), (i, j)), shape=(6 * (len(m.links) - 1), at))
    chosen = scipy.sparse.csgraph.maximum_bipartite_matching(A, perm_type="column")
    assert (chosen >= 0).all()
    large_part = scipy.sparse.csr_array((np.full(len(chosen), 20.0), (np.arange(len(chosen)), chosen)), shape=A.shape)
    return (A + large_part)[:, np.sort(chosen)].tocsc()


def reference(m: mg.Mechanism) -> float:
    """Seconds of one factorization and solution by splu."""
    A = regular_matrix(m)
    b = np.ones(A.shape[0])
    begin = perf_counter()
    scipy.sparse.linalg.splu(A).solve(b)
    return perf_counter() - begin


def measured(kind: str, links: int) -> list[float]:
    """Links, seconds to declare, to solve, to solve again and to read one pair, worst check, seconds of the reference, MB."""
    begin = perf_counter()
    m = LATTICES[kind](links)
    declared = perf_counter()
    mg.solve(m, {"J0": mg.Motion(0.0, velocity=1.0)})
    solved = perf_counter()
    s = mg.solve(m, {"J0": mg.Motion(0.0, velocity=2.0)})
    again = perf_counter()
    s["J1"].reaction, s["J1"].components
    read = perf_counter()
    worst = max(float(s.checks.closure), float(s.checks.equilibrium))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    seconds = [declared - begin, solved - declared, again - solved, read - again]
    return [len(m.links), *seconds, worst, min(reference(m) for _ in range(3)), peak]


def in_own_process(kind: str, links: int) -> list[float]:
    """The same, measured in a process of its own."""
    done = subprocess.run(
        [sys.executable, __file__, "--row", kind, str(links)], capture_output=True, text=True, check=True
    )
    return [float(x) for x in done.stdout.split()]


def table(kinds: list[str], sizes: list[int]) -> None:
    """Print one line a mechanism."""
    names = (
        "declare s",
        "first s",
        "growth",
        "again s",
        "growth",
        "read s",
        "splu s",
        "first/",
        "again/",
        "checks",
        "MB",
    )
    print(f"{'kind':10} {'links':>7}", *(f"{name:>9}" for name in names))
    for kind in kinds:
        before: tuple[float, float, float] | None = None
        for links in sizes:
            n, declare, first, again, read, worst, splu, peak = in_own_process(kind, links)
            growth = [""] * 2
            if before and n > before[0]:
                growth = [
                    f"{log(now / t) / log(n / before[0]):.2f}"
                    for now, t in zip((first, again), before[1:], strict=True)
                ]
            print(
                f"{kind:10} {n:7.0f} {declare:9.3f} {first:9.3f} {growth[0]:>9} {again:9.3f} {growth[1]:>9} {read:9.3f} {splu:9.3f} "
                f"{first / splu:9.2f} {again / splu:9.2f} {worst:9.1e} {peak:9.0f}",
                flush=True,
            )
            before = (n, first, again)


def crossover() -> None:
    """Dense against sparse by closure rows: ratio of the shortest times, for some numbers of positions."""
    counts = (1, 16, 36, 200, 1000)
    print(f"{'links':>6} {'rows':>6}  dense/sparse for {', '.join(map(str, counts))} positions")
    for links in (8, 10, 13, 16, 20, 24, 32, 48):
        m = LATTICES["four-bars"](links)
        ratios = []
        for count in counts:
            runs: dict[str, list[float]] = {"dense": [], "sparse": []}
            for _ in range(3 if count < 1000 else 1):
                for engine, times in runs.items():
                    begin = process_time()
                    mg.solve(m, {"J0": mg.Motion(np.linspace(0.0, 0.3, count), 1.0)}, engine=engine)
                    times.append(process_time() - begin)
            ratios.append(min(runs["dense"]) / min(runs["sparse"]))
        print(f"{len(m.links):6} {indexed(m).n_rows:6}  {'  '.join(f'{r:6.2f}' for r in ratios)}", flush=True)


def groups() -> None:
    """Sparse factors position by position, and group by group: milliseconds of processor time for factors and four solutions."""
    print(f"{'kind':10} {'links':>6} {'unknowns':>9} {'blocks':>7} {'levels':>7}  positions: whole, by groups (ms)")
    for kind in LATTICES:
        for links in (10, 40, 200, 800):
            m = LATTICES[kind](links)
            system, x = assembled(m)
            form = LoopSystem.at(Configuration(system, x[:, None]), np.array([0]))
            rng, out = np.random.default_rng(0), []
            for count in (8, 36, 360):
                here = Configuration(system, x[:, None] + 1e-4 * rng.normal(size=(len(x), count)))
                values = form.values_at(here, np.arange(count))
                b = rng.normal(size=(form.groups.size, 1, count))
                whole, grouped = (min(_linear(form, values, b, way) for _ in range(3)) for way in (False, True))
                out.append(f"{count}: {whole:.1f}, {grouped:.1f}")
            g = form.groups
            print(f"{kind:10} {len(m.links):6} {g.size:9} {g.blocks:7} {g.levels:7}  {'   '.join(out)}", flush=True)


def _linear(form: LoopSystem, values: np.ndarray, b: np.ndarray, grouped: bool) -> float:
    """Milliseconds for factors and four solutions."""
    begin = process_time()
    if grouped:
        factors = form.groups.factor(values)
    else:
        factors = SparseFactors([form.pattern.factor(one) for one in values])
    factors.smallest_pivot.min()
    for _ in range(4):
        factors.solve(b)
    return 1e3 * (process_time() - begin)


def main() -> None:
    """Print what the arguments ask for."""
    if "--row" in sys.argv:
        kind, links = sys.argv[-2:]
        print(*measured(kind, int(links)))
        return
    if "--crossover" in sys.argv:
        crossover()
        return
    if "--groups" in sys.argv:
        groups()
        return
    kinds = [a for a in sys.argv[1:] if a in LATTICES] or list(LATTICES)
    table(kinds, SIZES if "--all" in sys.argv else SIZES[:-1])


if __name__ == "__main__":
    main()
