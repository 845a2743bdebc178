"""Large sweeps of all assemblies, too long for the suite: run by hand, one line for every mechanism, faults at the end.

python tests/benchmarks/sweep_assemblies.py arms 100          sixteen postures of random arms of six turns
python tests/benchmarks/sweep_assemblies.py seeds 20          random topologies: the same set for ten seeds
python tests/benchmarks/sweep_assemblies.py newton 20 3 10000 Newton from so many random guesses finds nothing outside the set

The number after the count is that of loops, at most. Small samples are in ``test_sweep_assemblies.py``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable

import numpy as np

import mechgraph as mg
from mechgraph.closure.configuration import Configuration
from mechgraph.modes.question import Question
from mechgraph.modes.search import searched

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


def topology(seed: int, most: int) -> tuple[mg.Mechanism, dict[str, object]]:
    """One loop to ``most`` loops of random pairs, one freedom of the first pair driven, each further loop with six freedoms."""
    rng = np.random.default_rng(seed)
    pairs: list[mg.Pair] = []
    links, loops = ["frame"], int(rng.integers(1, most + 1))
    for loop in range(loops):
        letters = ["R"] if loop == 0 else []
        while (left := (7 if loop == 0 else 6) - sum(FREEDOMS[s] for s in letters)) > 0:
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


def seeds(count: int, most: int = 3, runs: int = 10) -> list[str]:
    """Faults of topologies whose set depends on the seed."""
    faults = []
    for number in range(count):
        m, at = topology(number, most)
        try:
            begin = time.process_time()
            sets = [mg.assemblies(m, at, seed=seed, cache=False, progress=patience()) for seed in range(runs)]
        except (mg.MechgraphError, GivenUp) as error:
            print(f"{number} {m.name}: {type(error).__name__}", flush=True)
            continue
        totals = {(s.total, len(s), s.completeness) for s in sets}
        print(f"{number} {m.name}: {sorted(totals, key=str)}, {time.process_time() - begin:.1f} s", flush=True)
        good = [s for s in sets if s.completeness != "searched"]
        if len({(s.total, len(s)) for s in good}) > 1:
            faults.append(f"{number} {m.name}: {sorted(totals, key=str)}")
        elif good and any(outside(prints(Question(m, at), good[0]), prints(Question(m, at), s)) for s in good[1:]):
            faults.append(f"{number} {m.name}: other poses")
    return faults


def newton(count: int, most: int = 3, guesses: int = 10_000) -> list[str]:
    """Faults of topologies in which Newton finds what is not in the set."""
    faults = []
    for number in range(count):
        m, at = topology(number, most)
        try:
            modes = mg.assemblies(m, at, progress=patience())
            q = Question(m, at)
        except (mg.MechgraphError, GivenUp) as error:
            print(f"{number} {m.name}: {type(error).__name__}", flush=True)
            continue
        x = searched(q.system, q.x, q.columns, q.drive[:, 0], guesses, 0.5, np.random.default_rng(number))
        missed = outside(q.family.prints(Configuration(q.system, x)), prints(q, modes))
        print(
            f"{number} {m.name}: {len(modes)} real of {modes.total}, {modes.completeness}; {x.shape[1]} guesses closed, "
            f"{missed} of them outside",
            flush=True,
        )
        if missed:
            faults.append(f"{number} {m.name}: {missed} of {x.shape[1]} outside a set called {modes.completeness}")
    return faults


if __name__ == "__main__":
    found = {"arms": arms, "seeds": seeds, "newton": newton}[sys.argv[1]](*(int(n) for n in sys.argv[2:]))
    print(f"{len(found)} faults", *found, sep="\n")
