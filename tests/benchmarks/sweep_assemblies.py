"""Large sweeps of all assemblies, too long for the suite: run by hand, one line for every mechanism, faults at the end.

python tests/benchmarks/sweep_assemblies.py arms 100               sixteen postures of random arms of six turns
python tests/benchmarks/sweep_assemblies.py one-by-one 0 20 10 10000   random topologies whose loops can be solved one after the other
python tests/benchmarks/sweep_assemblies.py together 0 20 10 10000     random topologies of two loops that have to be solved together

Of random topologies, with numbers from the first to below the second, so many seeds must give the same set, and Newton from so many random
guesses nothing outside it; seeds after the first go without the trace test, which says nothing of the set. Small samples are in
``test_sweep_assemblies.py``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from unittest.mock import patch

import numpy as np

import mechgraph as mg
from mechgraph.kinematics.state import Configuration
from mechgraph.modes.assemblies import Question
from mechgraph.modes.family import searched
from mechgraph.modes.start_sets import NOT_PASSED

FREEDOMS = {"R": 1, "P": 1, "C": 2, "U": 2, "S": 3, "Sp": 5, "Sg": 4, "Sc": 3, "E": 3}
"""Pair types of random loops, and how many freedoms each has."""
PATIENCE = 240.0
"""Processor seconds after which a call is given up."""
SAME = 1e-6
"""Difference of link poses up to which two assemblies are one."""


class GivenUp(Exception):
    """A call took too long."""


def patience() -> Callable[[str], None]:
    """A function of progress that gives a call up after a while."""
    end = time.process_time() + PATIENCE

    def told(_: str) -> None:
        if time.process_time() > end:
            raise GivenUp

    return told


def arm(seed: int) -> tuple[mg.Mechanism, dict[str, object]]:
    """Six turns about lines that stand anywhere, and a pose of the hand that can be reached."""
    rng = np.random.default_rng(seed)
    points, axes = rng.normal(size=(6, 3)), rng.normal(size=(6, 3))
    m = mg.Mechanism(
        f"arm {seed}",
        pairs=[mg.Pair(f"A{i}", "R", f"L{i}", f"L{i + 1}", point=points[i], axis=axes[i]) for i in range(6)],
    )
    hand = mg.kinematics(m, {f"A{i}": v for i, v in enumerate(rng.uniform(-2, 2, 6))}).link("L6").pose
    return m, {"L6": hand}


ONE_BY_ONE, TOGETHER = (7, 6, 6), (8, 5)
"""Freedoms of the first loop, and of the further ones: those that can be solved one after the other, and two that cannot."""


def topology(seed: int, most: int = 3, freedoms: Sequence[int] | None = None) -> tuple[mg.Mechanism, dict[str, object]]:
    """One loop to ``most`` loops of random pairs, one freedom of the first pair driven; or loops of so many ``freedoms``."""
    rng = np.random.default_rng(seed)
    own = ONE_BY_ONE[: int(rng.integers(1, most + 1))] if freedoms is None else freedoms
    pairs: list[mg.Pair] = []
    links = ["frame"]
    for loop, count in enumerate(own):
        letters = ["R"] if loop == 0 else []
        while (left := count - sum(FREEDOMS[s] for s in letters)) > 0:
            letters.append(str(rng.choice([s for s, f in FREEDOMS.items() if f <= left])))
        begin, end = ("frame", "frame") if loop == 0 else rng.choice(links, 2, replace=False)
        chain = [begin, *(f"b{loop}{i}" for i in range(1, len(letters))), end]
        for i, symbol in enumerate(letters):
            name = f"O{len(pairs)}"
            pairs.append(
                mg.Pair(name, symbol, chain[i], chain[i + 1], point=rng.normal(size=3), axis=rng.normal(size=3))
            )
        links += chain[1:-1]
    m = mg.Mechanism(" ".join(p.type.symbol for p in pairs), pairs=pairs, drives=["O0"], frame="frame")
    return m, {"O0": 0.1}


def prints(q: Question, modes: mg.Assemblies) -> np.ndarray:
    """What tells the assemblies of a set apart ``(n, M)``."""
    s = q.system
    starts = [s.state_of(s.start_coordinates(mode.start)[:, None]) for mode in modes]
    x = np.concatenate(starts, axis=1) if starts else np.zeros((s.n_state, 0))
    return q.family.prints(Configuration(s, x))


def outside(found: np.ndarray, known: np.ndarray) -> int:
    """How many of what is found ``(n, V)`` is not known ``(n, M)``."""
    if not found.shape[1]:
        return 0
    if not known.shape[1]:
        return found.shape[1]
    gaps = (
        np.abs(found[:, :, None] - known[:, None, :]).max(axis=0) / np.maximum(1.0, np.abs(found).max(axis=0))[:, None]
    )
    return int((gaps.min(axis=1) > SAME).sum())


def arms(count: int) -> list[str]:
    """Faults of arms."""
    faults = []
    for seed in range(count):
        m, at = arm(seed)
        begin = time.process_time()
        modes = mg.assemblies(m, at, seed=seed)
        told = f"{len(modes)} real, {len(modes.complex)} not, {modes.infinite} at infinity, {modes.completeness}"
        sure = sum(c is not None and c.proved for c in modes.certificates)
        print(f"arm {seed}: {told}, {sure} certificates, {time.process_time() - begin:.2f} s", flush=True)
        if modes.total != 16 or len(modes) + len(modes.complex) != 16 or modes.completeness != "proved":
            faults.append(f"arm {seed}: {told}")
    return faults


def sets(first: int, last: int, runs: int, guesses: int, freedoms: Sequence[int] | None = None) -> list[str]:
    """Faults of topologies whose set depends on the seed, or misses what Newton finds."""
    faults = []
    for number in range(first, last):
        m, at = topology(number, freedoms=freedoms)
        begin, name = time.process_time(), f"{number} {m.name}"
        try:
            q = Question(m, at)
            found = mg.assemblies(m, at, cache=False, progress=patience())
            took = time.process_time() - begin
            with patch("mechgraph.modes.start_sets.trace_test", lambda *_: NOT_PASSED):
                others = [mg.assemblies(m, at, seed=seed, cache=False, progress=patience()) for seed in range(1, runs)]
        except (mg.MechgraphError, GivenUp) as error:
            print(f"{name}: {type(error).__name__}", flush=True)
            continue
        known = prints(q, found)
        same = [
            (one.total, len(one)) == (found.total, len(found)) and not outside(prints(q, one), known) for one in others
        ]
        x = searched(q.system, q.x, q.columns, q.drive[:, 0], guesses, 0.5, np.random.default_rng(number))
        missed = outside(q.family.prints(Configuration(q.system, x)), known)
        print(
            f"{name}: {len(found)} real of {found.total}, {found.infinite} at infinity, {found.completeness}, {took:.1f} s; "
            f"{1 + sum(same)} of {runs} seeds; {x.shape[1]} guesses of {guesses} closed, {missed} outside",
            flush=True,
        )
        if missed or not all(same):
            faults.append(f"{name}: {missed} of {x.shape[1]} outside a set called {found.completeness}; seeds {same}")
    return faults


def main() -> list[str]:
    """What the command line asks for."""
    what, *numbers = sys.argv[1:]
    counts = [int(n) for n in numbers]
    if what == "arms":
        return arms(*counts)
    return sets(*counts, freedoms=TOGETHER if what == "together" else None)


if __name__ == "__main__":
    found = main()
    print(f"{len(found)} faults", *found, sep="\n")
