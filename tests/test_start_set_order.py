"""Start sets serve a mechanism however it is declared: pairs in any order, links of any names, pairs the other way round; their work."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mechanisms import ring
from test_assembly_groups import spatial
from test_modes import FOUR, STEPHENSON, WATT, planar, platform

import mechgraph as mg
from mechgraph.graph.chains import least_order, least_orders
from mechgraph.modes.assemblies import Question
from mechgraph.modes.family import Family, Labelling
from mechgraph.modes.homotopy import Care, Equations, Leg, Linear, follow
from mechgraph.modes.start_sets import MISSED, _Group, kept
from mechgraph.modes.targets import groups_of

BOTH_WAYS = frozenset("RPCS")
"""Pairs that are the same with their links exchanged."""


def shuffled(m: mg.Mechanism, seed: int) -> tuple[mg.Mechanism, dict[str, float]]:
    """The same declared another way, and by which sign its coordinates change."""
    rng = np.random.default_rng(seed)
    names = {link.name: f"body {i}" for link, i in zip(m.links, rng.permutation(len(m.links)), strict=True)}
    pairs, sign = [], {}
    for k in rng.permutation(len(m.pairs)):
        p = m.pairs[k]
        sign[p.name] = -1.0 if p.type.symbol in BOTH_WAYS and rng.random() < 0.5 else 1.0
        a, b, on_a, on_b = names[p.a], names[p.b], p.on_a, p.on_b
        ends = {"a": a, "b": b, "on_a": on_a, "on_b": on_b}
        back = {"a": b, "b": a, "on_a": on_b, "on_b": on_a}
        pairs.append(replace(p, **(ends if sign[p.name] > 0 else back)))
    links = [replace(m.links[i], name=names[m.links[i].name]) for i in rng.permutation(len(m.links))]
    start = {freedom: sign[freedom.split(".")[0]] * value for freedom, value in m.start.items()}
    return mg.Mechanism("another", links, pairs, frame=names[m.frame], start=start, units=m.units), sign


def stand(seed: int = 0, feet: int = 6, heads: int = 3) -> mg.Mechanism:
    """A platform of six legs, of which some share their feet or heads."""
    rng = np.random.default_rng(seed)
    A, B = rng.normal(size=(feet, 3)), rng.normal((0, 0, 3), 1.0, (heads, 3))
    return platform(A[np.arange(6) * feet // 6], B[np.arange(6) * heads // 6])


CASES: list[tuple[mg.Mechanism, Mapping[str, float]]] = [
    (mg.load("four-bar"), {"A": 0.3}),
    (mg.load("7r"), {"O1": 0.2}),
    (mg.load("r-sc-c-r"), {"A": 0.2}),
    (mg.load("rcsr"), {"O1": 3.0}),
    (mg.load("spherical-four-bar"), {"A": 0.2}),
    (planar("Watt", "A", **WATT), {"A": 0.1}),
    (planar("Stephenson", "A", **STEPHENSON), {"A": 0.1}),
    (planar("triad", "G", **STEPHENSON), {"G": 0.1}),
    (spatial(("RSSR", "frame", "frame"), ("SSP", "03", "frame")), {"O0": 0.1}),
    (spatial(*[("RRS", "frame", "top")] * 3), dict.fromkeys(("O0", "O3", "O6"), 0.1)),
    (spatial(("RUCRR", "frame", "frame")), {"O0": 0.1}),
    (stand(), {f"P{i}": 1e-3 * i for i in range(6)}),
    (stand(feet=6, heads=6), {f"P{i}": 1e-3 * i for i in range(6)}),
]  # fmt: skip


def keys(m: mg.Mechanism, at: Mapping[str, float]) -> list[str]:
    return sorted(Labelling(group.family).key for group in groups_of(Question(m, at).form.family))


@pytest.mark.daily(5)
@pytest.mark.parametrize(("m", "at"), CASES, ids=[m.name for m, _ in CASES])
def test_a_class_is_the_same_in_whatever_order_it_is_declared(m: mg.Mechanism, at: Mapping[str, float]) -> None:
    own = keys(m, at)
    for seed in range(3):
        other, sign = shuffled(m, seed)
        assert keys(other, {name: sign[name] * value for name, value in at.items()}) == own


def test_other_classes_have_other_keys() -> None:
    """Other drivers, dimensions where relations are kept, pairs, feet shared; a pair that is not the same the other way round."""
    watt, stephenson = planar("Watt", "A", **WATT), planar("Stephenson", "A", **STEPHENSON)
    rng = np.random.default_rng(1)
    loops = [ring(row, rng.normal(size=(4, 3)), rng.normal(size=(4, 3))) for row in ("RRSC", "RSRC", "RCSR")]
    asked = [
        (mg.load("four-bar"), {"A": 0.3}),
        (planar("four-bar", "A", **FOUR), {"A": 0.3}),
        (planar("four-bar", "D", **FOUR), {"D": 0.3}),
        (watt, {"B": 0.1}),
        (stephenson, {"G": 0.1}),
        *((loop, {"O1": 0.1}) for loop in loops[:2]),
        (loops[0], {"O2": 0.1}),
        (stand(), {f"P{i}": 0.0 for i in range(6)}),
        (stand(feet=6, heads=6), {f"P{i}": 0.0 for i in range(6)}),
    ]
    found = [tuple(keys(m, at)) for m, at in asked]
    assert len(set(found)) == len(found)
    # run through the other way the one loop is the other
    assert keys(loops[2], {"O1": 0.1}) == keys(loops[0], {"O1": 0.1})


@pytest.mark.parametrize(
    ("m", "at"), [CASES[i] for i in (0, 1, 2, 3, 4, 11)], ids=[CASES[i][0].name for i in (0, 1, 2, 3, 4, 11)]
)
def test_the_start_set_of_the_package_serves_every_order(
    m: mg.Mechanism, at: Mapping[str, float], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MECHGRAPH_CACHE", str(tmp_path))
    monkeypatch.setattr("mechgraph.modes.assemblies.start_set", lambda *_: pytest.fail("no start set was found"))
    first = mg.assemblies(m, at)
    other, sign = shuffled(m, 4)
    second = mg.assemblies(other, {name: sign[name] * value for name, value in at.items()})
    assert (second.total, second.completeness, len(second)) == (first.total, first.completeness, len(first))
    same(first, second, sign)


def test_a_start_set_of_the_user_serves_every_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two dyads, one behind the other, and their start sets in a folder: read whatever the order, and nothing more is written."""
    monkeypatch.setenv("MECHGRAPH_CACHE", str(tmp_path))
    m = planar("Watt", "A", **WATT)
    first = mg.assemblies(m, {"A": 0.1})
    files = sorted(tmp_path.iterdir())
    assert len(files) == 2
    monkeypatch.setattr("mechgraph.modes.assemblies.start_set", lambda *_: pytest.fail("no start set was found"))
    for seed in range(3):
        other, sign = shuffled(m, seed)
        same(first, mg.assemblies(other, {"A": 0.1 * sign["A"]}), sign)
    assert sorted(tmp_path.iterdir()) == files


def same(first: mg.Assemblies, second: mg.Assemblies, sign: Mapping[str, float]) -> None:
    """Every assembly of the one is one of the other, by the coordinates of single freedoms."""
    assert len(first)
    alone = {p.name for p in first.mechanism.pairs if not any(step.holds_rotation for step in p.type.steps)}
    names = [name for name in first[0].start if name.split(".")[0] in alone]
    table = np.array([[mode.start[name] for name in names] for mode in first])
    other = np.array([[sign[name.split(".")[0]] * mode.start[name] for name in names] for mode in second])
    gaps = np.abs(np.exp(1j * table)[:, None] - np.exp(1j * other)).max(axis=2, initial=0.0)
    assert gaps.min(axis=1).max() < 1e-8
    assert gaps.min(axis=0).max() < 1e-8


def test_members_are_worked_out_once_a_step_and_only_what_moves_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    """A step solves the equations twice, for the same markers; what no member moves stays where it is, to the last digit."""
    family = groups_of(Question(planar("Watt", "A", **WATT), {"A": 0.1}).form.family)[0].family
    rng = np.random.default_rng(0)
    member, x = family.random_closed(rng)
    equations, goal = Equations(family, family.mixing(rng)), family.random_member(rng)
    goal.markers[:, :, 1:] = member.markers[:, :, 1:]
    made: list[np.ndarray] = []
    solved: list[int] = []
    system_with, newton = Family.system_with, Linear.newton
    monkeypatch.setattr(Family, "system_with", lambda f, m, d: (made.append(m), system_with(f, m, d))[1])
    monkeypatch.setattr(Linear, "newton", lambda here, idle: (solved.append(1), newton(here, idle))[1])
    tracked = follow(Leg(equations, member, goal), x[:, None], Care())
    assert tracked.arrived.all()
    assert len(solved) >= 2 * len(made) - 4
    assert all((markers[:, :, 1:] == member.markers[:, :, 1:]).all() for markers in made)
    assert np.abs(made[-1] - goal.markers).max() < 1e-12


def test_loops_are_followed_in_one_go_where_many_assemblies_need_many(monkeypatch: pytest.MonkeyPatch) -> None:
    """With sixteen known, four loops without a further one are enough for a chance below one in ten thousand."""
    family = groups_of(Question(mg.load("7r"), {"O1": 0.2}).form.family)[0].family
    start = kept(family)
    assert start is not None
    rounds: list[int] = []

    def back(group: _Group, _: Family, loops: int, __: np.random.Generator) -> np.ndarray:
        rounds.append(loops)
        return np.tile(group.x, loops)

    monkeypatch.setattr(_Group, "_round", back)
    group = _Group(Equations(family, start.mixing), start.member, start.x, 100)
    group.grow(MISSED, np.random.default_rng(0), None)
    assert rounds == [4]
    assert group.chance == pytest.approx(17.0**-4)


def test_the_least_order_of_a_graph_is_the_same_however_its_nodes_are_numbered() -> None:
    rng = np.random.default_rng(0)
    six_legs = np.kron(np.eye(6, dtype=int), np.ones((3, 3), dtype=int))
    cube = np.array([[bin(u ^ v).count("1") == 1 for v in range(8)] for u in range(8)], dtype=int)
    # two cubic graphs of which all nodes look alike before one is singled out
    prism, mobius = (np.zeros((8, 8), dtype=int) for _ in range(2))
    for v in range(8):
        for u in ((v + 1) % 8, (v + 4) % 8):
            mobius[u, v] = mobius[v, u] = 1
        for u in (4 * (v // 4) + (v + 1) % 4, (v + 4) % 8):
            prism[u, v] = prism[v, u] = 1
    codes = []
    for A in (six_legs, cube, prism, mobius, rng.integers(0, 2, (7, 7))):
        found = set()
        for _ in range(4):
            p = rng.permutation(len(A))
            B = A[np.ix_(p, p)]
            order = least_order(B.tolist())
            found.add(B[np.ix_(order, order)].tobytes())
        assert len(found) == 1
        codes.append(found.pop())
        if len(A) < 9:
            first = least_orders(A.tolist())[1][0]
            assert A[np.ix_(first, first)].tobytes() == codes[-1]
    assert codes[1] == codes[2] != codes[3]
