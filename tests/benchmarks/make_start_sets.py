"""Make the start sets that come with the package: of the library's mechanisms and of common topologies, where a class is known.

    python tests/benchmarks/make_start_sets.py          writes mechgraph/modes/start-sets.npz anew; those that it has are taken over

Only sets of which a bound or a trace test says that they are all are taken in.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import combinations
from typing import Any

import numpy as np

import mechgraph as mg
from mechgraph.model.mechanism import chain_symbols
from mechgraph.model.toml import library_path
from mechgraph.modes import start_sets
from mechgraph.modes.assemblies import Question
from mechgraph.modes.family import Labelling
from mechgraph.modes.start_sets import Irregular, bound, start_set
from mechgraph.modes.targets import groups_of

LOOPS = ("RSSR", "RCSR", "RRSC", "RSCR", "RCCC", "RCRCR", "RCRRC", "RRRRRRR", "RRRRRRP")
"""Loops of pairs that stand anywhere, driven at the first."""
TRUSSES = (("01 12 20", 2), (start_sets.TRUSSES[0][0], 2), *((joints, 1) for joints, *_ in start_sets.TRUSSES[1:]))
"""Trusses in a plane by the links of their joints, and how many of these slide at most."""
MOST = 64
"""Assemblies of a set, at most: larger ones take long and fill the file."""


def wanted() -> Iterator[tuple[mg.Mechanism, dict[str, Any]]]:
    """Mechanisms, and what is given."""
    for name in sorted(file.stem for file in library_path("7r").parent.glob("*.toml")):
        m = mg.load(name)
        if m.drives:
            yield m, {m.full_name(d.freedom): m.start.get(m.full_name(d.freedom), 0.0) for d in m.drives}
    rng = np.random.default_rng(3)
    for letters in LOOPS:
        types = chain_symbols(letters)[0]
        links = ["frame", *(f"link{i}" for i in range(1, len(types))), "frame"]
        pairs = [
            mg.Pair(f"O{i + 1}", symbol, links[i], links[i + 1], point=rng.normal(size=3), axis=rng.normal(size=3))
            for i, symbol in enumerate(types)
        ]
        yield mg.Mechanism(letters, pairs=pairs, drives=["O1"]), {"O1": 0.2}
    for feet, heads in ((6, 6), (6, 3)):
        A, B = rng.normal(size=(feet, 3)), rng.normal((0.0, 0.0, 3.0), 1.0, (heads, 3))
        pairs = []
        for i in range(6):
            foot, head = A[i], B[i * heads // 6]
            pairs += [
                mg.Pair(f"A{i}", "S", "base", f"lower{i}", point=foot),
                mg.Pair(f"P{i}", "P", f"lower{i}", f"upper{i}", point=foot, axis=head - foot),
                mg.Pair(f"B{i}", "S", f"upper{i}", "platform", point=head),
            ]
        m = mg.Mechanism(f"platform {feet}-{heads}", pairs=pairs, frame="base")
        yield m, {f"P{i}": 0.0 for i in range(6)}
    for joints, most in TRUSSES:
        ends = joints.split()
        for slides in (those for n in range(most + 1) for those in combinations(range(len(ends)), n)):
            pairs = [
                mg.Pair(f"J{k}", "P", *on, point=[*rng.normal(size=2), 0.0], axis=[*rng.normal(size=2), 0.0])
                if k in slides
                else mg.Pair(f"J{k}", "R", *on, point=[*rng.normal(size=2), 0.0], axis=(0, 0, 1))
                for k, on in enumerate(ends)
            ]
            yield mg.Mechanism(f"truss {joints}, slides {slides}", pairs=pairs, frame=ends[0][0]), {}
    pairs = [
        mg.Pair(f"A{i}", "R", f"L{i}", f"L{i + 1}", point=rng.normal(size=3), axis=rng.normal(size=3)) for i in range(6)
    ]
    arm = mg.Mechanism("arm", pairs=pairs)
    yield arm, {"L6": mg.kinematics(arm, {f"A{i}": 0.3 * i for i in range(6)}).link("L6").pose}


def families() -> Iterator[tuple[str, Labelling]]:
    """Classes of the groups of these mechanisms, where they are known, each once, with the names of their mechanisms."""
    keys = set()
    for m, at in wanted():
        try:
            whole = Question(m, at).form.family
        except mg.MechgraphError as error:
            print(f"{m.name}: {type(error).__name__}", flush=True)
            continue
        for group in [] if whole.fault else groups_of(whole):
            labelling = Labelling(group.family)
            if labelling.key not in keys:
                keys.add(labelling.key)
                yield m.name, labelling


def main() -> None:
    """Work them out and write them."""
    found: dict[str, Any] = {}
    for name, labelling in families():
        family, begin = labelling.family, time.process_time()
        try:
            start = start_sets.packed(labelling) or start_set(family, np.random.default_rng(0))
        except Irregular:
            print(f"{name}: irregular", flush=True)
            continue
        known, N = bound(family), start.x.shape[1]
        sure = start.trace.passed or (known is not None and known.count == N)
        print(f"{name}: {N}, {'sure' if sure else 'not sure'}, {time.process_time() - begin:.1f} s", flush=True)
        if sure and N <= MOST:
            found |= {
                f"{start_sets.key(labelling)}/{part}": value
                for part, value in start_sets.arrays(labelling, start).items()
            }
    np.savez_compressed(start_sets.PACKED, **found)


if __name__ == "__main__":
    main()
