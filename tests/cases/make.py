"""Makes the files of cases: python tests/cases/make.py [NAME ...]

The library, random and special mechanisms, asked of mechgraph by two engines that have to agree; what a closed form knows carries that form
as its source and is checked against it here. A case whose engines differ by more than ``MOST`` is no number to ask for and is left out, by
name; so are those that take longer than ``LONGEST``.
"""

from __future__ import annotations

import json
import math
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE.parent), str(HERE), str(HERE.parent / "identities")]

import adapter  # noqa: E402
import attack  # noqa: E402
import judge  # noqa: E402
import lattices  # noqa: E402
import machines  # noqa: E402
import mechanisms as known  # noqa: E402
import numpy as np  # noqa: E402
import scipy.special  # noqa: E402
import strategies  # noqa: E402
from test_change_points import four_bar  # noqa: E402

import mechgraph as mg  # noqa: E402

LEAST, MOST = 1e-10, 1e-5
"""Tolerance of a case: thirty times what the engines differ by, within these."""
LONGEST = 1.0
"""Processor seconds of both engines on a case: beside singular positions a path may take many steps."""
AGREED = "mechgraph, dense and sparse engine"
Case = dict[str, Any]


def tables(m: mg.Mechanism) -> Any:
    """The tables of the file of a mechanism."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "case.toml"
        mg.save(m, file)
        return tomllib.loads(file.read_text(encoding="utf-8"))


def case(name: str, m: mg.Mechanism | str, source: str = AGREED, tolerance: float = 0.0, **ask: Any) -> Case | None:
    """A case, or None where the engines do not agree or take too long for a test that asks a thousand."""
    declaration = m if isinstance(m, str) else tables(m)
    begin = time.process_time()
    one, other = (adapter.answer(declaration, ask, engine) for engine in adapter.ENGINES)
    apart = least_tolerance(one, other)
    if apart is None or 30 * apart > MOST:
        print(
            f"left out: {name}: engines differ by {apart}: {judge.differences(one, other, LEAST)[:2]}", file=sys.stderr
        )
        return None
    if time.process_time() - begin > LONGEST:
        print(f"left out: {name}: takes {time.process_time() - begin:.1f} s", file=sys.stderr)
        return None
    within = float(f"{max(LEAST, 30 * apart, tolerance):.1e}")
    return {"name": name, "mechanism": declaration, "ask": ask, "answer": one, "tolerance": within, "source": source}


def least_tolerance(one: Any, other: Any) -> float | None:
    """The power of ten within which two answers are the same; None where they never are."""
    for exponent in range(-15, -3):
        if not judge.differences(one, other, 10.0**exponent):
            return 10.0**exponent
    return None


def motion_of(given: Any) -> dict[str, Any]:
    """A motion as it stands in a question."""
    if not isinstance(given, mg.Motion):
        return np.asarray(given, dtype=float).tolist()
    fields = {"position": given.position, "velocity": given.velocity, "acceleration": given.acceleration}
    return {name: np.asarray(value, dtype=float).tolist() for name, value in fields.items() if value is not None}


def asked(given: Any) -> Any:
    return {name: motion_of(motion) for name, motion in given.items()}


# --- what is asked ------------------------------------------------------------------------------------------------------------


def library() -> Iterator[Case | None]:
    """Every mechanism of the library: facts, report, and three positions of its stored motion."""
    for name in mg.library():
        m = mg.load(name)
        yield case(f"{name}: facts", name, what="facts")
        yield case(f"{name}: report", name, what="text")
        given = {d.freedom: d.motion.position for d in m.drives if d.motion is not None}
        if given:
            picked = {k: mg.Motion(np.asarray(v)[[0, len(v) // 3, -1]], 2.0, 0.5) for k, v in given.items()}
            yield case(f"{name}: motion", name, what="solve", motion=asked(picked))


def random() -> Iterator[Case | None]:
    """Random mechanisms of one to four loops, all pairs, with loads; random chains that are open at the start."""
    for seed in range(150):
        m = strategies.solvable(seed)
        if m is not None:
            yield case(f"{seed}: facts", m, what="facts")
            t = np.array([0.0, 0.7])
            yield case(f"{seed}: motion", m, what="solve", motion=asked(strategies.motions(m, seed, t)))
    for seed, letters in enumerate(
        ("RCSR", "RSSR", "RRCCR", "PCSR", "CPSR", "RHCSH", "RUSR", "HCCR", "RESR", "RPRHRRR")
    ):
        m = strategies.open_chain(seed, letters)
        able = [n for p in m.pairs for n, d in zip(p.freedom_names, p.type.drivable, strict=True) if d]
        if able:
            m = m.replace(drives=[able[0]])
            yield case(f"chain {letters}", m, what="solve", motion={able[0]: [0.0, 0.1]})


def overconstrained() -> Iterator[Case | None]:
    """Known overconstrained, redundant and passive mechanisms."""
    for make in (
        known.bennett, known.goldberg, known.myard, known.bricard_line_symmetric, known.bricard_cube, known.bricard_trihedral,
        known.sarrus,
        known.spherical, known.planar, known.folded_bars, known.three_cranks, known.concurrent_cranks, known.rsur,
        known.rssr_sc, known.rccc,
        known.door, known.hexapod, known.three_upu, machines.excavator, machines.five_rods, machines.double_cardan, machines.sliders,
    ):  # fmt: skip
        m = make()
        yield case(f"{m.name}: facts", m, what="facts")
        if m.drives:
            given = {d.freedom: mg.Motion(np.linspace(0.0, 0.1, 3), 1.0, 0.5) for d in m.drives}
            for more in ({}, {"redundant": "minimum_norm"}, {"method": "newton_euler"}):
                word = next(iter(more.values()), "motion")
                yield case(f"{m.name}: {word}", m, what="solve", motion=asked(given), **more)


def singular() -> Iterator[Case | None]:
    """Change points, dead points, narrow gaps, positions out of reach, starts beside them."""
    for side in (-1, 1):
        q = (math.pi / 2 + side * np.array([0.3, 1e-2, 1e-3, 1e-4])).tolist()
        m = four_bar(1, 2, 1, 2, math.pi / 2)
        one = case(f"parallelogram, {side}", m, "the rocker follows the crank", 1e-7, what="solve", motion={"A": q})
        if one is not None:
            np.testing.assert_allclose(np.ravel(one["answer"]["position"]["D"]), q, atol=1e-9)
            yield one
        yield case(
            f"kite, {side}", four_bar(1, 2, 2, 1, -1.0, side), what="solve", motion={"A": [0.5, 0.99, 1.01, 1.5]}
        )
    for seed in range(60):
        rng = np.random.default_rng((seed, 77))
        bars = attack.just_out_of_reach(rng) if seed % 2 else attack.nearly_folded(rng, 10.0 ** -rng.uniform(2, 7))
        start = rng.uniform(0.5, 2.5)
        m, (low, high) = attack.four_bars([bars], start), bars.interval(start)
        before = 10.0 ** -rng.uniform(1, 6)
        q = (
            np.array([2.0, math.pi - before, math.pi + before, 4.0])
            if np.isinf(high)
            else high + before * np.array([-1.0, 1.0])
        )
        one = case(
            f"four-bar {seed}",
            m,
            "the triangle of coupler and rocker",
            what="solve",
            motion={"A": (q - start).tolist()},
            forces=False,
        )
        if one is not None:
            reached = (low < q) & (q < high)
            assert [status == "ok" for status in one["answer"]["status"]] == reached.tolist(), (bars, q)
            turned = (
                np.ravel(np.array(one["answer"]["position"]["D0"], dtype=float)) - bars.rocker(q) + bars.rocker(start)
            )
            assert np.abs(attack.wrapped(turned[reached])).max(initial=0.0) < 1e-7
            yield one


def large() -> Iterator[Case | None]:
    """Lattices of a few dozen links."""
    for kind, make in lattices.LATTICES.items():
        m = make(16)
        yield case(f"{kind}: facts", m, what="facts")
        given = {m.drives[0].freedom: mg.Motion(np.linspace(0.0, 0.1, 2), 1.0, 0.5)}
        yield case(f"{kind}: motion", m, what="solve", motion=asked(given))


def in_time() -> Iterator[Case | None]:
    """Motion in time, equilibrium."""
    t = [0.0, 0.3, 0.9, 2.0]
    bob = mg.Mechanism("pendulum", [mg.Link("frame"), mg.Link("bob", mass=1.0, center=(-1.0, 0, 0))], [
        mg.Pair("A", "R", "frame", "bob", point=(0, 0, 0), axis=(0, 0, 1))], loads=[mg.Gravity((0, -9.81, 0))])  # fmt: skip
    one = case(
        "pendulum", bob, "elliptic functions: sin(phi / 2) = k sn(K - w t), k^2 = 1/2", 1e-7, what="respond", t=t
    )
    if one is not None:
        k2, w = 0.5, math.sqrt(9.81)
        sn = scipy.special.ellipj(scipy.special.ellipk(k2) - w * np.array(t), k2)[0]
        turned = math.pi / 2 - 2 * np.arcsin(math.sqrt(k2) * sn)
        np.testing.assert_allclose(np.ravel(one["answer"]["position"]["A"]), turned, atol=1e-7)
        yield one
    for seed in range(30):
        m = strategies.closed_mechanism(seed, loops=1, mobility=1)
        if mg.check(m).mobility == 1:
            m = strategies.with_loads(m, seed)
            yield case(f"random {seed}", m, tolerance=1e-6, what="respond", t=[0.0, 0.1, 0.2])
    start = {"A": 1.3}
    rest = case("pendulum at rest", bob, "w^2 = g / l", what="rest", start=start)
    if rest is not None:
        np.testing.assert_allclose(rest["answer"]["frequencies"], [math.sqrt(9.81)], rtol=1e-9)
        yield rest


def modes() -> Iterator[Case | None]:
    """Assemblies and branches."""
    for name, at, count in (
        ("four-bar", {"A": 0.9}, "2: two circles"),
        ("rssr", None, "a bound of 8 and the mirror of the rocker"),
    ):
        m = mg.load(name)
        at = at or {m.drives[0].freedom: 0.4}
        yield case(name, name, f"{count}; {AGREED}", 1e-8, what="assemblies", at=at)
        yield case(f"{name}: branches", name, f"Grashof; {AGREED}", 1e-6, what="branches", driver=m.drives[0].freedom)
    for seed in range(12):
        m = strategies.with_drives(strategies.closed_mechanism(seed, loops=1, mobility=1, branches=0), seed)
        if m is not None and len(m.drives) == 1:
            yield case(f"random {seed}", m, tolerance=1e-7, what="assemblies", at={m.drives[0].freedom: 0.1})


def structure() -> Iterator[Case | None]:
    """Chains, families, groups."""
    for name in mg.library():
        yield case(name, name, what="structure")
    for links, mobility, number in ((4, 1, 1), (6, 1, 2), (8, 1, 16), (10, 1, 230), (7, 2, 3), (9, 2, 35)):
        source = "Mruthyunjaya, Kinematic structure of mechanisms revisited, Mech. Mach. Theory 38, 2003: no fractionated ones"
        one = case(
            f"{links} links, mobility {mobility}", "four-bar", source, what="chains", links=links, mobility=mobility
        )
        assert one is not None
        assert one["answer"]["number"] == number
        yield one


ALL = (library, random, overconstrained, singular, large, in_time, modes, structure)


def main() -> None:
    """Write the files that are named, or all."""
    wanted = set(sys.argv[1:]) or {make.__name__ for make in ALL}
    for make in ALL:
        if make.__name__ in wanted:
            cases = [json.dumps(one, separators=(",", ":"), ensure_ascii=False) for one in make() if one is not None]
            file = HERE / f"{make.__name__}.json"
            file.write_text("[\n" + ",\n".join(cases) + "\n]\n", encoding="utf-8")
            print(f"{file.name}: {len(cases)} cases, {file.stat().st_size // 1024} KiB")


if __name__ == "__main__":
    main()
