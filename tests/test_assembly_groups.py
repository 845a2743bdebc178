"""Assemblies group by group: the groups that are found, and the same modes as when all is solved at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mechanisms import ring
from test_modes import FOUR, STEPHENSON, WATT, planar, platform

import mechgraph as mg
from mechgraph.graph.chains import least_order, least_orders
from mechgraph.modes.assemblies import Question
from mechgraph.modes.family import Family, Labelling
from mechgraph.modes.homotopy import Care, Equations, Leg, Linear, follow
from mechgraph.modes.start_sets import MISSED, _Group, kept
from mechgraph.modes.targets import EquationGroup, Undivided, groups_of

ON_A_COUPLER = {
    "A": ("a", "b", 0.0, 2.0),
    "B": ("b", "c", 0.5, 2.9),
    "C": ("c", "d", 2.4, 3.5),
    "D": ("a", "d", 2.6, 2.1),
    "E": ("ground", "f", -0.4, 0.1),
    "F": ("f", "a", -0.2, 1.6),
    "G": ("ground", "e", 4.0, 0.2),
    "H": ("c", "e", 3.5, 3.0),
}
"""A driven four-bar of moving links, one of them on a rocker, another on a driven crank."""


def spatial(*chains: tuple[str, str, str], seed: int = 5) -> mg.Mechanism:
    """Chains of pairs anywhere, each given by its letters and the links at its ends."""
    rng, pairs = np.random.default_rng(seed), []
    for number, (letters, begin, end) in enumerate(chains):
        links = [begin, *(f"{number}{i}" for i in range(1, len(letters))), end]
        for symbol, a, b in zip(letters, links, links[1:], strict=False):
            place = {"point": rng.normal(size=3)} | ({} if symbol == "S" else {"axis": rng.normal(size=3)})
            pairs.append(mg.Pair(f"O{len(pairs)}", symbol, a, b, **place))
    return mg.Mechanism("spatial", pairs=pairs, frame="frame")


RODS = spatial(("RSSR", "frame", "frame"), ("SSP", "03", "frame"))
"""An RSSR, and at its output link a rod to a slide."""


@pytest.mark.parametrize(
    ("m", "driven", "groups"),
    [
        (planar("Watt", "A", **WATT), "A", ["BCD", "EFG"]),
        (planar("Stephenson", "A", **STEPHENSON), "A", ["BCD", "EFG"]),
        (planar("triad", "G", **STEPHENSON), "G", ["ABCDEFG"]),
        (planar("coupler", "A", **ON_A_COUPLER), "AG", ["BCD", "EFH"]),
    ],
)
def test_a_planar_mechanism_falls_into_its_groups(m: mg.Mechanism, driven: str, groups: list[str]) -> None:
    found = groups_of(Question(m, dict.fromkeys(driven, 0.1)).form.family)
    assert ["".join(group.names) for group in found] == groups


def test_rods_belong_to_the_groups_of_the_bodies_that_they_join() -> None:
    found = groups_of(Question(RODS, {"O0": 0.1}).form.family)
    assert [(group.names, group.family.rank) for group in found] == [(["O3"], 1), (["O6"], 1)]


def test_every_leg_of_a_platform_whose_pose_is_given_is_a_group() -> None:
    """Legs turn about themselves: that they do so against the platform holds them, not that they stand still alone."""
    rng = np.random.default_rng(0)
    m = platform(rng.normal(size=(6, 3)), rng.normal((0.0, 0.0, 3.0), 1.0, (6, 3)))
    pose = mg.kinematics(m, {f"P{i}": 0.0 for i in range(6)}).link("platform").pose
    found = groups_of(Question(m, {"platform": pose}).form.family)
    assert [group.names for group in found] == [[f"A{i}", f"P{i}", f"B{i}"] for i in range(6)]


@pytest.mark.parametrize(
    ("m", "at"),
    [
        pytest.param(planar("Stephenson", "A", **STEPHENSON), {"A": 0.1}, marks=pytest.mark.slow),
        pytest.param(planar("coupler", "A", **ON_A_COUPLER), {"A": 0.1, "G": [0.05, -0.1]}, marks=pytest.mark.slow),
        (RODS, {"O0": 0.1}),
    ],
)
def test_group_by_group_the_modes_are_those_of_all_at_once(
    m: mg.Mechanism, at: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    apart = mg.assemblies(m, at, cache=False)
    monkeypatch.setattr("mechgraph.modes.assemblies.groups_of", lambda family: [Undivided(family)])
    at_once = mg.assemblies(m, at, cache=False)
    for one, other in zip(*((s,) if isinstance(s, mg.Assemblies) else s for s in (apart, at_once)), strict=True):
        assert "groups are solved one after the other" in one.evidence[0]
        assert "groups" not in other.evidence[0]
        assert (one.total, len(one), len(one.complex)) == (other.total, len(other), len(other.complex))
        assert len(one) > 0
        assert one.poses == pytest.approx(other.poses, abs=1e-9)
        assert one.completeness in {"proved", "tested"}


def test_where_there_are_too_many_tracks_complex_modes_of_groups_are_left(monkeypatch: pytest.MonkeyPatch) -> None:
    m = planar("Watt", "A", **WATT)
    closed, open_ = (mg.assemblies(m, {"A": angle}) for angle in (3.0, 2.0))
    assert [(len(one), len(one.complex)) for one in (closed, open_)] == [(4, 0), (0, 4)]
    monkeypatch.setattr("mechgraph.modes.targets.MOST_FOLLOWED", 3)
    real, none = (mg.assemblies(m, {"A": angle}) for angle in (3.0, 2.0))
    assert real.poses == pytest.approx(closed.poses)
    assert [(one.total, len(one), len(one.complex), one.completeness) for one in (real, none)] == [
        (4, 4, 0, "proved"),
        (4, 0, 0, "proved"),
    ]
    assert any("not gone on with" in text for text in none.evidence)
    assert not any("not gone on with" in text for text in real.evidence)


def test_a_group_that_leaves_its_class_is_no_group() -> None:
    """A dyad of parallel axes stays in its plane on a link that turns in it, and not on one that tilts."""
    for axis, stays in (((0, 0, 1), True), ((1, 0, 0), False)):
        pairs = [
            mg.Pair(k, "R", a, b, point=(x, y, 0), axis=axis if k == "A" else (0, 0, 1))
            for k, (a, b, x, y) in FOUR.items()
        ]
        family = Question(mg.Mechanism("dyad", pairs=pairs, frame="ground"), {"A": 0.0}).family
        group = EquationGroup(family, np.array([1, 2, 3]), np.zeros(0, dtype=np.intp), np.array([0]))
        assert (group.family.rank, group.within) == (3, stays)


@pytest.mark.slow
def test_feet_at_one_place_of_links_that_part_are_two() -> None:
    """A body on a ball and three rods, two of them from one place at the start, which only the rocker of an RSSR leaves."""
    rng, place = np.random.default_rng(3), {}
    for name in ("crank", "near", "far", "rocker"):
        place[name] = {"point": rng.normal(size=3), "axis": rng.normal(size=3)}
    ball, foot, other, *heads = rng.normal(size=(6, 3))
    pairs = [
        mg.Pair("A", "R", "ground", "crank", **place["crank"]),
        mg.Pair("B", "S", "crank", "coupler", point=place["near"]["point"]),
        mg.Pair("C", "S", "coupler", "rocker", point=place["far"]["point"]),
        mg.Pair("D", "R", "rocker", "ground", **place["rocker"]),
        mg.Pair("E", "S", "ground", "body", point=ball),
    ]
    for i, (link, at, head) in enumerate(zip(("ground", "rocker", "ground"), (foot, foot, other), heads, strict=True)):
        pairs += [
            mg.Pair(f"F{i}", "S", link, f"rod{i}", point=at),
            mg.Pair(f"G{i}", "S", f"rod{i}", "body", point=head),
        ]
    modes = mg.assemblies(mg.Mechanism("feet", pairs=pairs, frame="ground"), {"A": 0.2})
    assert len(groups_of(Question(modes.mechanism, {"A": 0.2}).form.family)) == 2
    assert (modes.total, modes.completeness) == (2 * 8, "proved")


@pytest.fixture(autouse=True)
def _empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MECHGRAPH_CACHE", str(tmp_path))


# --- Start sets serve a mechanism however it is declared: pairs in any order, links of any names, pairs the other way round; their work ---


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
