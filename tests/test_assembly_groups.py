"""Assemblies group by group: the groups that are found, and the same modes as when all is solved at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from mechanisms import hexapod, linked_four_bar, ring
from test_modes import FOUR, STEPHENSON, WATT, planar, platform

import mechgraph as mg
from mechgraph.graph.chains import least_order, least_orders
from mechgraph.kinematics.assembly import closed_start, scaled_start
from mechgraph.kinematics.state import Configuration, close_all
from mechgraph.maths.se3 import compose, pose_exp
from mechgraph.maths.tolerances import ModeTolerances
from mechgraph.modes import certificate as certificates
from mechgraph.modes import start_sets
from mechgraph.modes.assemblies import Question
from mechgraph.modes.certificate import Ball, MovedMarker, certificate, curvature, loop_rows, rows, told_apart
from mechgraph.modes.family import Family, Labelling
from mechgraph.modes.homotopy import Care, Equations, Leg, Linear, follow
from mechgraph.modes.start_sets import MISSED, TrackGroup, kept
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
        (planar("triad", "G", **STEPHENSON), "G", ["ABCDEF"]),
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
    """Other drivers, centers of spheres, pairs, feet shared; a pair that is not the same the other way round."""
    watt, stephenson = planar("Watt", "A", **WATT), planar("Stephenson", "A", **STEPHENSON)
    rng = np.random.default_rng(1)
    loops = [ring(row, rng.normal(size=(4, 3)), rng.normal(size=(4, 3))) for row in ("RRSC", "RSRC", "RCSR")]
    asked = [
        (mg.load("four-bar"), {"A": 0.3}),
        (mg.load("spherical-four-bar"), {"A": 0.3}),
        (mg.load("slider-crank"), {"A": 0.3}),
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


@pytest.mark.daily(2)
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
    """Two dyads, one behind the other, and their start set in a folder: read whatever the order, and nothing more is written."""
    monkeypatch.setenv("MECHGRAPH_CACHE", str(tmp_path))
    monkeypatch.setattr("mechgraph.modes.start_sets.PACKED", tmp_path / "none")
    m = planar("Watt", "A", **WATT)
    first = mg.assemblies(m, {"A": 0.1})
    files = sorted(tmp_path.iterdir())
    assert len(files) == 1
    monkeypatch.setattr("mechgraph.modes.assemblies.start_set", lambda *_: pytest.fail("no start set was found"))
    for seed in range(3):
        other, sign = shuffled(m, seed)
        same(first, mg.assemblies(other, {"A": 0.1 * sign["A"]}), sign)
    assert sorted(tmp_path.iterdir()) == files


TRUSSES = [(joints, count, slides) for joints, count, _ in start_sets.TRUSSES for slides in ((), (0,))]


@pytest.mark.parametrize(("joints", "count", "slides"), TRUSSES, ids=[f"{n}, {len(s)} slides" for _, n, s in TRUSSES])
def test_one_start_set_serves_every_truss_of_a_topology(
    joints: str, count: int, slides: Sequence[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """In any plane, at any heights, with axes up and down: the same assemblies as in the plane of the drawing, and no start set made."""
    monkeypatch.setattr("mechgraph.modes.assemblies.start_set", lambda *_: pytest.fail("no start set was found"))
    rng = np.random.default_rng(7)
    plane = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    plane[:, 2] = np.cross(plane[:, 0], plane[:, 1])
    flat, tilted, sign = [], [], {"crank": 1.0}
    for k, (a, b) in enumerate([("0", "c"), ("c", joints[1]), *joints.split()[1:]]):
        name, letter = f"J{k}" if k else "crank", "P" if k and k - 1 in slides else "R"
        at, axis = np.append(rng.normal(size=2), 0.0), np.append(rng.normal(size=2), 0.0)
        sign[name] = 1.0 if not k or letter == "P" else float(rng.choice([-1.0, 1.0]))
        axis = axis if letter == "P" else np.array([0.0, 0.0, 1.0])
        flat.append(mg.Pair(name, letter, a, b, point=at, axis=axis))
        up = at + np.array([0.0, 0.0, rng.normal()])
        tilted.append(mg.Pair(name, letter, a, b, point=plane @ up, axis=sign[name] * plane @ axis))
    first, second = (
        mg.assemblies(mg.Mechanism("truss", pairs=pairs, frame="0"), {"crank": 0.1}) for pairs in (flat, tilted)
    )
    for modes in (first, second):
        assert (modes.total, len(modes) + len(modes.complex) + modes.infinite) == (count, count)
        assert modes.completeness == ("tested" if slides else "proved")
        assert all(sure is not None and sure.proved for sure in modes.certificates)
    assert len(first) == len(second) > 0
    table, other = (
        np.array(
            [[s * mode.start[f"{n}.{'Tz' if n == 'J1' and slides else 'Rz'}"] for n, s in of.items()] for mode in modes]
        )
        for modes, of in ((first, dict.fromkeys(sign, 1.0)), (second, sign))
    )
    gaps = np.abs(np.exp(1j * table)[:, None] - np.exp(1j * other)).max(axis=2)
    assert gaps.min(axis=0).max() < 1e-9
    assert gaps.min(axis=1).max() < 1e-9


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

    def back(group: TrackGroup, _: Family, loops: int, *__: object) -> tuple[np.ndarray, np.ndarray]:
        rounds.append(loops)
        return np.tile(group.x, loops), np.repeat(np.arange(loops), group.x.shape[1])

    monkeypatch.setattr(TrackGroup, "_round", back)
    group = TrackGroup(Equations(family, start.mixing), start.member, start.x, 100)
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


# --- Certificates of assemblies: ball arithmetic encloses, roots are within their bounds, what is no root has none ---


def exactly(A: np.ndarray) -> np.ndarray:
    """The stored numbers as fractions."""
    return np.vectorize(Fraction, otypes=[object])(A)


@pytest.mark.parametrize("seed", range(5))
def test_sums_and_products_of_balls_contain_what_is_exact(seed: int) -> None:
    rng = np.random.default_rng(seed)
    scales = 10.0 ** rng.integers(-12, 12, (3, 4, 4))
    a, b, c = (Ball(rng.normal(size=(4, 4)) * s, np.abs(rng.normal(size=(4, 4))) * 1e-9 * s) for s in scales)
    found = (a @ b + c) @ a - b
    for _ in range(20):
        x, y, z = (exactly(ball.mid + rng.uniform(-0.99, 0.99, (4, 4)) * ball.rad) for ball in (a, b, c))
        inside = (x @ y + z) @ x - y
        assert (np.abs(inside - exactly(found.mid)) <= exactly(found.rad)).all()
    tight = Ball(a.mid, np.zeros((4, 4))) @ Ball(b.mid, np.zeros((4, 4)))
    assert (tight.rad <= 1e-15 * (np.abs(a.mid) @ np.abs(b.mid)) + 1e-290).all()


@pytest.mark.parametrize("name", ["four-bar", "rssr", "rcsr-csr", "rchch", "7r"])
def test_loops_of_balls_are_those_of_the_closure_rows(name: str) -> None:
    """Another walk along the loops: the rows of the engine lie within the balls, and these are small."""
    m = mg.load(name)
    q = Question(m, {m.full_name(d.freedom): m.start.get(m.full_name(d.freedom), 0.0) for d in m.drives})
    for loop, (columns, _) in enumerate(q.system.loop_columns):
        opened, twists = loop_rows(q.start, loop)
        at = slice(6 * loop, 6 * loop + 6)
        assert (np.abs(opened.mid - q.start.residual[at, 0]) <= opened.rad + 1e-13).all()
        assert np.abs(twists.mid - q.start.loop_jacobian[at, columns, 0]).max() < 1e-12
        assert max(opened.rad.max(), twists.rad.max()) < 1e-11


@pytest.mark.parametrize("turned", [(), (1,), (2,), (1, 2, 3), (0, 1, 2, 3, 4)])
def test_pairs_declared_against_the_way_of_a_loop_have_their_columns_in_order(turned: tuple[int, ...]) -> None:
    """Of a pair of several freedoms that is passed from link b to a, the last is passed first: two columns were exchanged."""
    rng, pairs = np.random.default_rng(2), []
    for i, symbol in enumerate(("R", "C", "U", "Sp", "E")):
        links = [f"L{i}", f"L{(i + 1) % 5}"]
        axis = rng.normal(size=3)
        more = {"second": np.cross(axis, rng.normal(size=3))} if symbol == "U" else {}
        links = links[::-1] if i in turned else links
        pairs.append(mg.Pair(f"P{i}", symbol, *links, point=rng.normal(size=3), axis=axis, **more))
    here = closed_start(mg.Mechanism("loop", pairs=pairs, frame="L0"))
    found = rows(here)[1].mid
    assert np.abs(found - here.J[:, :, 0]).max() < 1e-12
    assert np.abs(found).max() > 0.5


@pytest.mark.parametrize("make", [hexapod, lambda: mg.load("rssr")])
def test_rods_of_balls_are_those_of_the_rows_of_rods(make: object) -> None:
    m = make()
    here = Question(m, {m.full_name(d.freedom): 0.0 for d in m.drives}).form.family.here
    opened, turned = rows(here)
    assert len(here.system.points.a) > 0
    assert (np.abs(opened.mid - here.residual[:, 0]) <= opened.rad + 1e-13).all()
    assert np.abs(turned.mid - here.J[:, :, 0]).max() < 1e-12
    assert max(opened.rad.max(), turned.rad.max()) < 1e-11


def placed(here: Configuration, moved: list[MovedMarker], u: np.ndarray) -> Configuration:
    """Other coordinates, and markers moved along their twists, by ``u``."""
    s, F = here.system, here.system.n_freedoms
    markers = [np.array(s.par.marker_a), np.array(s.par.marker_b)]
    for (pair, side, twist), h in zip(moved, u[F:], strict=True):
        markers[side][:, :, pair] = compose(pose_exp(h * twist[:, None]), markers[side][:, :, pair])
    par = replace(s.par, marker_a=markers[0], marker_b=markers[1])
    return Configuration(s.with_parameters(par) if moved else s, s.advance(here.x, u[:F, None]))


def largest_curvature(here: Configuration, rng: np.random.Generator, moved: list[MovedMarker] | None = None) -> float:
    """The largest second derivative along a unit direction that is found, by differences of first ones."""
    h, moved = 1e-5, moved or []
    n = here.system.n_freedoms + len(moved)
    sides = [[rows(placed(here, moved, sign * h * e), moved)[1].mid for e in np.eye(n)] for sign in (1, -1)]
    T = np.stack([(a - b) / (2 * h) for a, b in zip(*sides, strict=True)], axis=2)
    T, best = 0.5 * (T + T.transpose(0, 2, 1)), 0.0
    for _ in range(10):
        u = rng.normal(size=n)
        for _ in range(30):
            v = np.einsum("rij,i,j->r", T, u, u)
            w, V = np.linalg.eigh(np.einsum("rij,r->ij", T, v / np.linalg.norm(v)))
            u = V[:, np.argmax(np.abs(w))]
        best = max(best, float(np.linalg.norm(np.einsum("rij,i,j->r", T, u, u))))
    return best


def test_second_derivatives_do_not_pass_their_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    """A turn before slides has the most: its part in them counts twice."""
    monkeypatch.setattr(certificates, "MODES", ModeTolerances(ball=1e-9))
    rng = np.random.default_rng(0)
    found = [Question(hexapod(), dict.fromkeys((f"P{k}" for k in range(1, 7)), 0.0)).form.family.here]
    for letters, arm in (("RRCRC", 1.0), ("RPPPPP", 1.0), ("RPPPPP", 0.1), ("RPPPPP", 3.0), ("RPPPPP", 10.0)):
        points, axes = rng.normal(size=(2, len(letters), 3))
        found.append(scaled_start(ring(letters, arm * points, axes)))
    for here in found:
        assert largest_curvature(here, rng) <= curvature(here) * (1 + 1e-6)


@pytest.mark.parametrize("name", ["rssr", "four-bar", "rcsr-csr"])
def test_markers_that_may_move_open_loops_as_fast_as_differences_say(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(certificates, "MODES", ModeTolerances(ball=1e-9))
    rng, h = np.random.default_rng(1), 1e-6
    here = scaled_start(mg.load(name))
    moved = [MovedMarker(k, side, twist) for k in (1, 2) for side in (0, 1) for twist in (np.eye(6)[3], np.eye(6)[4])]
    moved.append(MovedMarker(0, 1, np.array([0.0, 0.6, 0.8, 0.3, 0.1, -0.2])))
    A, F = rows(here, moved)[1], here.system.n_freedoms
    assert np.abs(A.mid[:, :F] - here.J[:, :, 0]).max() < 1e-12
    for k in range(len(moved)):
        u = h * np.eye(F + len(moved))[F + k]
        opened = [rows(placed(here, moved, sign * u), moved)[0].mid for sign in (1, -1)]
        assert (opened[0] - opened[1]) / (2 * h) == pytest.approx(A.mid[:, F + k], abs=1e-8)
    assert largest_curvature(here, rng, moved) <= curvature(here, moved) * (1 + 1e-6)


def test_roots_are_apart_where_their_balls_are() -> None:
    """Two assemblies of a four-bar; the same state twice, by a whole turn of a pair, is one root."""
    q = Question(linked_four_bar(1.0, 2.5, 2.0, 3.0, 0.5), {"O0": 0.5})
    family, s = q.family, q.system
    modes = mg.assemblies(q.m, {"O0": 0.5})
    states = np.concatenate([s.state_of(s.start_coordinates(mode.start)[:, None]) for mode in modes], axis=1)
    sure = [certificate(Configuration(s, states[:, [i]]), family.free, 0, True) for i in (0, 1)]
    apart = [one.apart for one in told_apart(family, states, sure)]
    angles = np.abs(np.angle(np.exp(1j * np.diff(states, axis=1)))).max()
    assert apart == pytest.approx([one.apart for one in modes.certificates], rel=1e-14)
    assert apart[0] == apart[1] == pytest.approx(angles, abs=1e-9)
    same = np.repeat(states[:, :1], 2, axis=1)
    same[s.single_rows[family.free[0]], 1] += 2 * np.pi
    assert all(one.apart < 0 for one in told_apart(family, same, [sure[0], sure[0]]))


def test_a_root_lies_within_its_bound_and_what_is_no_root_has_no_certificate() -> None:
    m = linked_four_bar(1.0, 2.5, 2.0, 3.0, 0.5)
    q = Question(m, {"O0": 0.5})
    family, s = q.family, q.system
    root, _ = close_all(s, q.start.x, q.columns)
    for off in (1e-14, 1e-11, 1e-9):
        x = root.copy()
        x[s.single_rows[family.free], 0] += off
        found = certificate(Configuration(s, x), family.free, 0, True)
        assert found is not None
        assert found.proved
        assert found.error >= np.linalg.norm(x - root)
        assert found.error < 20 * off + 1e-11
    for off in (1e-6, 1e-2):
        x = root.copy()
        x[s.single_rows[family.free], 0] += off
        found = certificate(Configuration(s, x), family.free, 0, True)
        assert found is not None
        assert not found.proved


def test_certificates_hold_for_every_matrix_within_the_bounds_of_rounding(monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows known so coarsely that the inverse may be half as large again: the product is that of the worst of them, or more."""
    q = Question(linked_four_bar(1.0, 2.5, 2.0, 3.0, 0.5), {"O0": 0.5})
    free = q.family.free
    f, A = rows(q.start)
    U, sigma, Vt = np.linalg.svd(A.mid[:, free])
    u, v, least = U[:, 2], Vt[2], sigma[2]
    rad, open_ = A.rad.copy(), 1e-6 * u
    rad[:, free] += 0.35 * least * np.abs(np.outer(u, v))
    monkeypatch.setattr(certificates, "rows", lambda here: (Ball(open_, f.rad), Ball(A.mid, rad)))
    found = certificate(q.start, free, 0, True)
    assert found is not None
    worst = A.mid[:, free] - 0.34 * least * np.outer(u, v)
    inverse, step = np.linalg.pinv(worst), np.linalg.pinv(worst) @ open_
    K = curvature(q.start)
    assert np.linalg.norm(inverse, 2) * K * np.linalg.norm(step) <= found.product < 0.5
    assert np.linalg.norm(step) <= found.error
    assert found.radius <= 1 / (np.linalg.norm(inverse, 2) * K)


@pytest.mark.slow
def test_a_pair_on_a_curve_has_no_certificate() -> None:
    """Bounds of second derivatives hold for screws and rotations; the word says so."""
    modes = mg.assemblies(mg.load("geneva"), guesses=20)[0]
    assert modes.completeness == "searched"
    assert all(sure is None for sure in modes.certificates)
    assert "none" in str(modes)


def test_couplings_are_rows_of_certificates() -> None:
    """A four-bar whose crank goes half a turn for each of its motor: the two assemblies of the four-bar, both proved."""
    bare = linked_four_bar(1.0, 2.5, 2.0, 3.0, 0.5)
    motor = mg.Pair("M", "R", "ground", "motor", on_a=mg.Marker((-2.0, 0.0, 0.0)), on_b=mg.Marker())
    couplings = [mg.Coupling({"M": 1.0, "O0": 2.0})]
    links = [*bare.links, mg.Link("motor")]
    geared = bare.replace(links=links, pairs=[motor, *bare.pairs], couplings=couplings, drives=["M"])
    here = Question(geared, {"M": -0.6}).start
    opened, turned = rows(here)
    assert (np.abs(opened.mid - here.residual[:, 0]) <= opened.rad + 1e-13).all()
    assert np.abs(turned.mid - here.J[:, :, 0]).max() < 1e-12
    modes, alone = mg.assemblies(geared, {"M": -0.6}), mg.assemblies(bare, {"O0": 0.5 + 0.3})
    assert len(modes) == len(alone) == 2
    assert [one.proved for one in modes.certificates] == [True, True]
    for mode, other in zip(modes, alone, strict=True):
        assert mode.start["O0.Rz"] == pytest.approx(0.5 + 0.3, abs=1e-12)
        for name, value in other.start.items():
            assert np.cos(mode.start[name] - value) == pytest.approx(1.0, abs=1e-14)
