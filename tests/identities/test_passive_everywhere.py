"""Passive freedoms are passive at every position: what is so at one alone, or by a pair that holds nothing, is free."""

from __future__ import annotations

import os

import machines
import mechanisms as known
import numpy as np
import pytest
from attack import integer_mechanism
from mechanisms import X, Y, Z
from strategies import closed_mechanism

import mechgraph as mg
from mechgraph.determinacy import mobility
from mechgraph.determinacy.finite_motion import finite_motion
from mechgraph.determinacy.mobility import free_motion
from mechgraph.kinematics.assembly import closed_start
from mechgraph.kinematics.rates import PassiveMotions, are_alone
from mechgraph.kinematics.state import Configuration, close
from mechgraph.kinematics.system import System

ENGINES = ("dense", "sparse")


def loop(*pairs: tuple[str, tuple[float, ...], object], drive: str) -> mg.Mechanism:
    """A ring of (symbol, point, axis), the first pair at the frame."""
    return known.ring([p[0] for p in pairs], [p[1] for p in pairs], [p[2] for p in pairs], drives=[drive])


PARALLEL_HERE = {
    # the axes of both cylindrical pairs are parallel where they are declared, and turn out of it
    "C-S-C-R": loop(("C", (2, 0, 0), Y), ("S", (0, 2, 2), None), ("C", (0, 0, 1), Y), ("R", (1, 0, 2), X), drive="O4"),
    "C-R-R-C-R-R": loop(
        ("C", (0, 0, 0), Z), ("R", (1, 0, 0), Y), ("R", (2, 1, 0), X), ("C", (2, 2, 1), Z), ("R", (0, 2, 0), X),
        ("R", (0, 1, 2), Y), drive="O5",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", PARALLEL_HERE)
def test_what_is_passive_in_one_position_only_is_free(name: str) -> None:
    m = PARALLEL_HERE[name]
    report = mg.check(m)
    assert not report.passive
    assert not report.determinate
    assert len(report.undriven) == len(report.passive_here_only) == 1
    assert "passive in this position only" in report.verdict
    assert "passive in this position only" in str(report)
    for engine in ENGINES:
        with pytest.raises(mg.IndeterminateError, match="passive in this position only"):
            mg.kinematics(m, {m.drives[0].freedom: [0.0, -0.2]}, engine=engine)
    # driven as well, it is determinate, and both engines agree
    more = m.replace(drives=[*m.drives, *report.suggested_drives])
    assert mg.check(more).determinate
    given = {d.freedom: [0.05] for d in more.drives}
    one, other = (mg.kinematics(more, given, engine=engine) for engine in ENGINES)
    np.testing.assert_allclose(one.link("link1").pose, other.link("link1").pose, atol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_path_on_which_something_stops_being_passive_is_refused_there(monkeypatch, engine: str) -> None:
    """Were it not seen beside the start, the path itself would show it: the held motion moves other links from the first node on."""
    monkeypatch.setattr(mobility, "_lasting", lambda here, *_: here)
    m = PARALLEL_HERE["C-S-C-R"]
    with pytest.raises(
        mg.IndeterminateError, match=r"link1 and link2 is passive where .* moves other links at O4.Rz = -?0\.\d+"
    ):
        mg.kinematics(m, {"O4": [0.0, -0.2]}, engine=engine)
    assert mg.kinematics(m, {"O4": [0.0]}, engine=engine).status.tolist() == ["ok"]


@pytest.mark.parametrize("lasting", [True, False])
def test_what_strays_with_the_cube_of_the_way_is_no_passive_motion(monkeypatch, lasting: bool) -> None:
    """A spin that moves other links by 7e-9 of itself 0.01 from the start, by 8e-6 at 0.1: forces were wrong by as much."""
    if lasting:
        monkeypatch.setattr(mobility, "_lasting", lambda here, *_: here)
    m = integer_mechanism(5002295).replace(drives=["J2.Tx"])
    words = "moves other links at" if lasting else "passive in this position only"
    for engine in ENGINES:
        with pytest.raises(mg.IndeterminateError, match=words):
            mg.solve(m, {"J2.Tx": [0.0, 0.1]}, engine=engine)


def test_the_compiled_kernel_hands_it_over(monkeypatch, compiled: None) -> None:
    monkeypatch.setattr(mobility, "_lasting", lambda here, *_: here)
    m = PARALLEL_HERE["C-S-C-R"]
    with pytest.raises(mg.IndeterminateError, match=r"moves other links at O4\.Rz"):
        mg.kinematics(m, {"O4": [0.0, -0.2]}, engine="compiled")
    assert mg.kinematics(m, {"O4": [0.0]}, engine="compiled").engine == "compiled"
    c = mg.compile(m)
    assert np.isnan(c(-0.2))
    assert c.status == "no longer passive"


def test_what_is_passive_everywhere_stays_so() -> None:
    """The coupler of a four-bar on two cylindrical pairs slides on them in every position, the rod between two balls spins."""
    m = mg.load("four-bar")
    planar = m.replace(pairs=[p.replace(type="C") if p.name in ("B", "C") else p for p in m.pairs])
    assert [p.name for p in mg.check(planar).passive] == ["coupler"]
    assert not mg.check(planar).passive_here_only
    assert [p.name for p in mg.check(mg.load("rssr")).passive] == ["coupler"]


# --- rows that hold nothing -------------------------------------------------------------------------------------------------

BODIES = [
    mg.Link("ground"), mg.Link("body", 330.0, (0, 0, 1), np.eye(3)), mg.Link("wheel", 20.0, (0, 0, 0), np.eye(3)),
]  # fmt: skip
SLIDES = [
    mg.Pair("A", "P", "ground", "body", point=(0, 0, 1), axis=Z),
    mg.Pair("B", "P", "body", "wheel", point=(0, 0, 0), axis=Z),
]
TYRE = mg.Pair("F", "Fr", "ground", "wheel", point=(0, 0, 0), axis=Z)


@pytest.mark.parametrize("loads", [[], [mg.Gravity((0, 0, -9.81))], [mg.TorsionSpring("F.Tz", 2e5)]])
def test_a_pair_that_holds_nothing_makes_no_freedom_passive(loads: list[object]) -> None:
    """A quarter car driven in its strut: body and wheel fall together, with or without a place for the spring of the tyre."""
    with_it = mg.Mechanism("quarter car", BODIES, [*SLIDES, TYRE], ["B"], loads)
    bare = mg.Mechanism("quarter car", BODIES, SLIDES, ["B"])
    for m in (bare, with_it):
        report = mg.check(m)
        assert (report.mobility, len(report.undriven), report.passive, report.passive_here_only) == (2, 1, (), ())
        assert report.verdict.startswith("Under-driven: mobility 2, 1 driver; 1 freedom is neither driven nor passive")
        with pytest.raises(mg.IndeterminateError, match="neither driven nor passive"):
            mg.solve(m, {"B": [0.0, 0.1]})
    both = mg.solve(with_it, {"A": 0.0, "B": [0.0, 0.1]})
    np.testing.assert_allclose(both["F"].position[:, 2], [0.0, 0.1], atol=1e-15)


def test_a_freedom_in_which_a_spring_acts_is_not_passive() -> None:
    m = mg.load("four-bar")
    m = m.replace(pairs=[p.replace(type="C") if p.name in ("B", "C") else p for p in m.pairs], loads=[])
    assert len(mg.check(m).passive) == 1
    for load in (mg.TorsionSpring("B.Tz", 100.0), mg.Damper("C.Tz", coefficient=1.0), mg.Effort("B.Tz", 1.0)):
        report = mg.check(m.replace(loads=[load]))
        assert (len(report.passive), len(report.undriven)) == (0, 1)
        with pytest.raises(mg.IndeterminateError, match="neither driven nor passive"):
            mg.solve(m.replace(loads=[load]), {"A": 0.0})
    assert len(mg.check(m.replace(loads=[mg.TorsionSpring("B.Rz", 100.0)])).passive) == 1


def facts(report: mg.DeterminacyReport, pairs: tuple[mg.Pair, ...]) -> dict[str, object]:
    return {
        "determinate": report.determinate,
        "mobility": report.mobility,
        "finite": report.finite_mobility,
        "redundancy": report.redundancy,
        "passive": [(p.name, p.links, p.load_bearing) for p in report.passive],
        "here only": report.passive_here_only,
        "undriven": len(report.undriven),
        "unique": {p.name: report.unique.get(p.name) for p in pairs},
        "change point": report.change_point,
        "dead point": report.dead_point,
    }


@pytest.mark.daily(15)
@pytest.mark.parametrize("name", mg.library())
def test_pairs_that_hold_nothing_change_no_fact(name: str) -> None:
    m = mg.load(name)
    rng = np.random.default_rng(sum(map(ord, name)))
    more = []
    for k in range(2):
        a, b = rng.choice([link.name for link in m.links], 2, replace=False).tolist()
        more.append(mg.Pair(f"free{k}", "Fr", a, b, point=rng.uniform(-1, 1, 3), axis=Z))
    assert facts(mg.check(m.replace(pairs=[*m.pairs, *more])), m.pairs) == facts(mg.check(m), m.pairs)


# --- folded bars ------------------------------------------------------------------------------------------------------------

FOLDED = {
    # (corners, rates of the second to fourth pair on the branch along which the crank moves); on the other it stands still
    "kite": ([(0, 0), (2, 0), (2.5, 0), (2, 0)], (-2.5, 4.0, -2.5)),
    "folded square": ([(0, 0), (1, 0), (0, 0), (1, 0)], (0.0, -1.0, 0.0)),
    "stretched": ([(0, 0), (1, 0), (2, 0), (1, 0)], (-1.0, 1.0, -1.0)),
}


@pytest.mark.daily(2)
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", FOLDED)
def test_folded_bars_name_their_branches(name: str, engine: str) -> None:
    """Two pins coincide: the bars between them turn about both. By hand: a kite keeps its line of symmetry."""
    corners, rates = FOLDED[name]
    m = loop(*(("R", (*corner, 0.0), Z) for corner in corners), drive="O1")
    for values in ([0.0], [0.0, 0.1, 0.2]):
        with pytest.raises(mg.DeadPointError, match=r"2 branches meet there.*O1\.Rz at rest") as error:
            mg.kinematics(m, {"O1": values}, engine=engine, on_reach="flag")
        ways = sorted(
            ([way[f"O{k}.Rz"] for k in range(1, 5)] for way in error.value.branches), key=lambda way: abs(way[0])
        )
        assert ways[0][0] == 0.0
        assert max(map(abs, ways[0])) == pytest.approx(1.0)
        np.testing.assert_allclose(ways[1], [1.0, *rates], atol=1e-9)


# --- several passive motions --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("make", [lambda: known.hexapod("SPS"), machines.five_rods], ids=["hexapod", "five rods"])
def test_mixed_motions_of_rods_are_told_apart(make) -> None:
    m = make()
    here = closed_start(m)
    system = here.system
    columns = np.array([system.first_column[m.freedom(drive.freedom)[0]] for drive in m.drives])
    passive = free_motion(system, here.x[:, 0], columns, "dense").passive
    assert len(passive) >= 5
    assert are_alone(passive)
    Z = np.stack([motion.rates for motion in passive], axis=1)
    mixed = Z @ np.random.default_rng(3).normal(size=(len(passive), len(passive)))
    found = PassiveMotions(here, passive, mixed[:, :, None])
    for i, motion in enumerate(passive):
        rates = found.rates[:, i, 0] / np.linalg.norm(found.rates[:, i])
        assert abs(rates @ motion.rates) == pytest.approx(np.linalg.norm(motion.rates), abs=1e-12)
        own = [found.links.index(link) for link in motion.links]
        others = np.delete(found.twists[:, :, i, 0], own, axis=1)
        assert np.abs(others).max() < 1e-12 * np.abs(found.twists[:, own, i]).max()


def test_the_rods_of_a_suspension_rest_in_their_spins() -> None:
    m = machines.five_rods()
    s = mg.kinematics(m, {"road": mg.Motion(np.linspace(0, 0.05, 9), np.ones(9), np.full(9, 0.3))})
    for k in range(1, 6):
        pose, V, A = s.link(f"rod{k}").pose, s.link(f"rod{k}").twist, s.link(f"rod{k}").acceleration
        u = pose[:, :3, :3] @ np.subtract(m.pair(f"O{k}").point, m.pair(f"I{k}").point)
        turning = np.cross(V[:, :3], u)
        assert np.abs((V[:, :3] * u).sum(axis=1)).max() < 1e-13
        assert np.abs((A[:, :3] * u).sum(axis=1) + (V[:, :3] * turning).sum(axis=1)).max() < 1e-12


def test_a_washer_rests_whatever_two_drivers_do() -> None:
    """Between a table on a turning arm and the ground: three passive motions, of which none is begun."""
    Z, at = (0, 0, 1), (1, 0, 0)
    pairs = [
        mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "P", "arm", "table", point=at, axis=at),
    ]
    pairs += [
        mg.Pair("E", "E", "table", "washer", point=at, axis=Z),
        mg.Pair("F", "E", "washer", "frame", point=at, axis=Z),
    ]
    m = mg.Mechanism("washer", None, pairs, ["A", "B"], frame="frame")
    s = mg.kinematics(m, {"A": mg.Motion([0.0, 0.6], 1.0), "B": mg.Motion([0.0, 0.5], 0.5)})
    np.testing.assert_allclose(s.link("washer").pose[-1], np.eye(4), atol=1e-14)
    np.testing.assert_allclose(s["F"].position[-1], 0.0, atol=1e-14)


def test_a_rod_comes_to_rest_where_the_freedom_that_holds_it_hardly_does() -> None:
    """Near the end of this path a step is not as foretold along the held spin: its parts are, one after the other."""
    m = closed_mechanism(123)
    m = m.replace(drives=[mg.Drive("J1"), mg.Drive("J5")])
    given = {"J1": np.linspace(-0.64082407, 0.0, 5)[::-1], "J5": np.linspace(0.0, 4.02927, 5)}
    one, other = (mg.kinematics(m, given, engine=engine) for engine in ENGINES)
    assert (one.status == "ok").all()
    for pair in m.pairs:
        np.testing.assert_allclose(one[pair.name].position, other[pair.name].position, atol=1e-11)


# --- Finite mobility against the rank along the path: never above a nullity on the way, and not below what moves on ---


MANY = int(os.environ.get("MECHGRAPH_MANY", "240"))
STEP = 0.02
Z = np.array((0.0, 0.0, 1.0))


def random_loop(points: np.ndarray, axes: np.ndarray, letters: str) -> mg.Mechanism:
    return known.ring(letters, [tuple(p) for p in points], [tuple(a) for a in axes], name="random loop")


def planar(rng: np.random.Generator) -> mg.Mechanism:
    n = int(rng.choice([4, 4, 4, 5, 6]))
    points = np.column_stack([rng.uniform(-1, 1, (n, 2)), np.zeros(n)])
    letters = "".join(rng.choice(["R", "R", "R", "P"], n))
    if letters.count("R") < 2:
        letters = "R" * n
    slides = np.column_stack([rng.normal(size=(n, 2)), np.zeros(n)])
    return random_loop(points, np.array([Z if k == "R" else s for k, s in zip(letters, slides, strict=True)]), letters)


def spherical(rng: np.random.Generator) -> mg.Mechanism:
    n = int(rng.choice([4, 4, 5]))
    axes = rng.normal(size=(n, 3))
    return random_loop(axes * rng.uniform(0.3, 1.5, (n, 1)), axes, "R" * n)


def spatial(rng: np.random.Generator) -> mg.Mechanism:
    return closed_mechanism(int(rng.integers(2**31)), masses=False)


def ladder(rng: np.random.Generator) -> mg.Mechanism:
    return known.windows(int(rng.integers(2, 6)), general=bool(rng.random() < 0.7))


KINDS = {"planar": planar, "spherical": spherical, "spatial": spatial, "ladder": ladder}


def nullity(here: Configuration) -> int:
    """Nullity of the closure Jacobian, rows of every loop about its first pair."""
    J = here.J[:, :, 0].copy()
    for i, path in enumerate(here.system.graph.loops):
        p = here.pair_points[:, path[0][0], 0]
        J[6 * i + 3 : 6 * i + 6] += np.cross(J[6 * i : 6 * i + 3], p[:, None], axis=0)
    s = np.linalg.svd(J, compute_uv=False)
    return J.shape[1] - int((s > 1e-6 * s[0]).sum())


def along_the_path(system: System, x: np.ndarray, steps: int = 4) -> tuple[list[int], float]:
    """Nullities at closed positions along a motion; and the least part of a random step that closing left."""
    out = [nullity(Configuration(system, x[:, None]))]
    least = 1.0
    rng = np.random.default_rng(0)
    v = rng.normal(size=system.n_freedoms)
    for _ in range(steps):
        J = Configuration(system, x[:, None]).J[:, :, 0]
        _, s, Vt = np.linalg.svd(J)
        N = Vt[int((s > 1e-9 * s[0]).sum()) :].T
        v = N @ (N.T @ v)
        if not np.abs(v).max(initial=0.0) > 1e-6:
            break
        v /= np.linalg.norm(v)
        closed, error = close(system, system.advance(x[:, None], STEP * v[:, None])[:, 0], np.arange(0))
        if error > 1e-10 or np.abs(system.difference(closed[:, None], x[:, None])).max() < 0.1 * STEP / len(v):
            break
        change = system.difference(closed[:, None], x[:, None])[:, 0]
        least = min(least, 1.0 - float(np.linalg.norm(N.T @ (change / STEP - v))))
        x = closed
        out.append(nullity(Configuration(system, x[:, None])))
    return out, least


@pytest.mark.daily(1)
@pytest.mark.parametrize("kind", KINDS)
def test_random_mechanisms_against_the_rank_along_the_path(kind: str) -> None:
    for seed in range(MANY // len(KINDS)):
        report = mg.check(KINDS[kind](np.random.default_rng((seed, len(kind)))))
        g = report.geometry
        assert g is not None
        found, kept = along_the_path(g.system, g.x)
        assert report.finite_mobility is not None
        assert report.mobility is not None
        assert report.finite_mobility <= min(found), (kind, seed)
        if len(found) > 1 and len(set(found)) == 1 and kept > 0.995:  # constant rank, and it moves on in all directions
            assert report.finite_mobility == found[0], (kind, seed)
        assert report.motion is not None
        assert 0 <= report.finite_mobility <= report.mobility


def test_curved_motions_of_four_bars_have_mobility_one() -> None:
    """Of random planar four-bars one in twenty was said to move with mobility 2: two chords of one curve taken for directions."""
    for seed in range(150):
        rng = np.random.default_rng((seed, 77))
        m = random_loop(np.column_stack([rng.uniform(-1, 1, (4, 2)), np.zeros(4)]), np.tile(Z, (4, 1)), "RRRR")
        report = mg.check(m)
        assert report.finite_mobility == report.mobility == 1, seed


def test_a_chain_of_high_nullity_keeps_it() -> None:
    """Ten planar four-bars one after the other, each on the coupler of the one before: nullity 10 all around."""
    pairs, base, foot = [], "frame", np.zeros(3)
    for k in range(10):
        corners = [foot + np.array(p) for p in ((0, 0, 0), (0.3, 1, 0), (1.4, 1.2, 0), (1.1, 0.1, 0))]
        names = [base, f"a{k}", f"b{k}", f"c{k}", base]
        pairs += [mg.Pair(f"J{k}{i}", "R", names[i], names[i + 1], point=corners[i], axis=Z) for i in range(4)]
        base, foot = f"b{k}", corners[1] + (0.2, 0.3, 0.0)
    for engine in ("dense", "sparse"):
        report = mg.check(mg.Mechanism("chain", None, pairs), engine=engine)  # type: ignore[arg-type]
        assert report.finite_mobility == report.mobility == 10


@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize(
    ("build", "mobility", "finite"),
    [
        (lambda: known.ring("RRR", [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [Z] * 3, name="flat triangle"), 1, 0),
        (lambda: known.ring("RRRR", [(0, 0, 0), (0.5, 0, 0), (1.5, 0, 0), (1, 0, 0)], [Z] * 4, name="in line"), 2, 1),
        (known.bennett, 1, 1),
        (known.goldberg, 1, 1),
        (known.bricard_cube, 1, 1),
        (known.sarrus, 1, 1),
    ],
)
def test_shaky_and_singular_positions(build: object, mobility: int, finite: int, engine: str) -> None:
    report = mg.check(build(), engine=engine)  # type: ignore[operator, arg-type]
    assert (report.mobility, report.finite_mobility) == (mobility, finite)


@pytest.mark.daily(3)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("value", [0.1, -0.1, 0.001])
def test_no_position_of_a_shaky_mechanism_is_said_to_be_reached(value: float, engine: str) -> None:
    """A flat triangle: its loop opens by the square of the way, 1e-6 after a thousandth of a radian."""
    pairs = known.ring("RRR", [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [Z] * 3, name="flat triangle").pairs
    m = mg.Mechanism("flat triangle", None, pairs, [pairs[0].name])
    with pytest.raises(mg.ReachError, match="no finite motion keeps the loops closed from") as error:
        mg.solve(m, {pairs[0].name: [0.0, value]}, engine=engine)  # type: ignore[arg-type]
    assert list(error.value.value.values()) == [0.0]
    assert error.value.solution.status.tolist()[0] == "ok"
    with pytest.raises(mg.AssemblyError, match=f"came to {pairs[0].name} = 0,"):
        mg.assemble(m, {pairs[0].name: value})


def test_a_shaky_part_on_a_moving_mechanism_is_not_counted() -> None:
    """A flat triangle of hinges on the coupler of a four-bar: nullity 2 all along, of which 1 moves on."""
    corners = ((0, 0, 0), (0.3, 1, 0), (1.4, 1.2, 0), (1.1, 0.1, 0))
    names = ["frame", "a", "b", "c", "frame"]
    pairs = [mg.Pair(f"J{i}", "R", names[i], names[i + 1], point=corners[i], axis=Z) for i in range(4)]
    bars = ["b", "p", "q", "b"]
    pairs += [mg.Pair(f"K{i}", "R", bars[i], bars[i + 1], point=(0.5 + i, 2.0, 0), axis=Z) for i in range(3)]
    m = mg.Mechanism("shaky on a coupler", None, pairs)
    for engine in ("dense", "sparse"):
        report = mg.check(m, engine=engine)  # type: ignore[arg-type]
        assert (report.mobility, report.finite_mobility) == (2, 1)


def test_full_row_rank_needs_no_motion() -> None:
    report = mg.check(mg.load("7r"))
    g = report.geometry
    assert g is not None
    assert finite_motion(g.system, g.x, g.freedoms.closure).mobility == 1


@pytest.mark.parametrize("engine", ["dense", "sparse", "compiled"])
def test_a_bush_on_an_inclined_pin_turns_back_as_the_crank_turns_whatever_the_number_of_turns(
    engine: str, request
) -> None:
    """At rest it does not spin about its pin, fixed in the crank at an angle b to its axis: the hinge turns by ``-cos(b) q``."""
    if engine == "compiled":
        request.getfixturevalue("compiled")
    b = np.deg2rad(50)
    u, m = np.array([0.6 * np.sin(b), 0.8 * np.sin(b), np.cos(b)]), mg.load("rssr")
    at = m.pair("B").point
    hinge = mg.Pair("H", "R", "crank", "bush", point=tuple(at - 0.05 * u), axis=tuple(u))
    ball = mg.Pair("B", "S", "bush", "coupler", point=at)
    m = mg.Mechanism(
        "bush", [*m.links, mg.Link("bush")], [m.pair("A"), hinge, ball, m.pair("C"), m.pair("D")], drives=["A"]
    )
    for q in (np.array([0.3, 9.0]), np.linspace(0, 200, 9), np.array([0.0, 48.8, -40.0])):
        s = mg.kinematics(m, {"A": q}, engine=engine)
        np.testing.assert_allclose(s["H"].position[:, 0], -np.cos(b) * q, atol=1e-8)
