"""Identities of reach: no position behind a gap is reached, however the positions lie, and no branch is left where loops nearly fold."""

from dataclasses import replace

import mechanisms
import numpy as np
import pytest
from attack import Bars, anywhere, four_bars, just_out_of_reach, nearly_folded, solved, wrapped
from identities.test_change_points import four_bar
from mechanisms import Z

import mechgraph as mg
from mechgraph.kinematics import reach
from mechgraph.kinematics.motion_path import DriverPath, Request, Status
from mechgraph.kinematics.prescribed import DriverMotion
from mechgraph.kinematics.solver import closure_solver
from mechgraph.kinematics.system import System
from mechgraph.kinetostatics import Pipeline
from mechgraph.maths import singular_point
from mechgraph.maths.tolerances import PATH
from mechgraph.outcome import Options

COUNTS = (4, 5, 7, 10, 20, 36, 41, 100, 181)
LIMIT = 1e-6
"""Distance to the closed form of a limit within which a position may count as beyond it."""


def inside_reach(rng, bar):
    """A start well inside the reach, and its limits."""
    while True:
        start = rng.uniform(-np.pi, np.pi)
        low, high = bar.interval(start)
        if np.isfinite(bar.rocker(start)) and low + 0.02 < start < high - 0.02:
            return start, low, high


def positions_around(rng, bar, start):
    """Crank angles of a turn or two, none where the closed form has no position."""
    n = int(rng.choice(COUNTS))
    begin = start + (rng.uniform(-0.3, 0.3) if rng.random() < 0.5 else 0.0)
    crank = {
        0: begin + np.linspace(0, 2 * np.pi, n),
        1: begin - np.linspace(0, 2 * np.pi, n),
        2: begin + np.linspace(-np.pi, np.pi, n),
        3: begin + rng.uniform(-2 * np.pi, 2 * np.pi, n),
    }[int(rng.integers(4))]
    return crank[np.isfinite(bar.rocker(crank))]


def assert_reached(s, bar, crank, start, low, high):
    ok, inside = s.status == "ok", (crank > low) & (crank < high)
    margin = np.minimum(crank - low, high - crank)
    assert not (ok & ~inside).any(), f"led across a gap at {crank[ok & ~inside][:3]}"
    assert not (~ok & inside & (margin > LIMIT)).any()
    assert set(s.status[~ok]) <= {"out of reach"}
    good = ok & inside
    error = np.abs(wrapped(s["D0"].position[..., 0] - bar.rocker(crank) + bar.rocker(start)))
    # rates, and rounding with them, grow as the inverse square root of the distance to the limit
    assert (error[good] * np.sqrt(np.minimum(1.0, margin[good]))).max(initial=0.0) < 1e-11


@pytest.mark.seeds(6)
@pytest.mark.parametrize("folded", [False, True])
def test_the_other_branch_is_farther_than_a_certificate_takes_for_granted(seed, folded):
    """Near a limit of the crank both branches are close to each other: still many times as far apart as where one alone is looked for."""
    rng = np.random.default_rng((seed, 26))
    bar = just_out_of_reach(rng, folded=folded)
    start, low, high = inside_reach(rng, bar)
    limit = high if np.isfinite(high) else low
    for before in 10.0 ** -np.arange(1, 8):
        crank = limit + before * np.sign(start - limit)
        if not low < crank < high:
            continue
        line = Pipeline(DriverMotion(four_bars([bar], crank), {"A": [0.0]}), Options())
        condition = line.solver.factored(line.start, line.solver.chosen(line.start, np.full(1, -1))).condition[0]
        both = []
        for one in (bar, replace(bar, side=-bar.side)):
            rod = one.head(crank) - one.tip(crank)
            both.append([np.arctan2(rod[1], rod[0]), one.rocker(crank)])
        rod, rocker = wrapped(np.subtract(*both))
        assert max(abs(rod), abs(rocker), abs(wrapped(rod - rocker))) > 10 * PATH.alone / condition


@pytest.mark.seeds(16)
@pytest.mark.parametrize("folded", [False, True])
def test_no_gap_of_the_reach_is_leapt_over(seed, folded):
    rng = np.random.default_rng((seed, 20))
    bar = just_out_of_reach(rng, folded=folded)
    start, low, high = inside_reach(rng, bar)
    crank = positions_around(rng, bar, start)
    if not len(crank):
        pytest.skip("no position has a closed form")
    m = four_bars([bar], start, anywhere(rng))
    engine = "sparse" if seed % 8 == 7 else "dense"
    s = mg.kinematics(m, {"A": crank - start}, on_reach="flag", engine=engine)
    assert_reached(s, bar, crank, start, low, high)


@pytest.mark.seeds(12)
def test_loops_nearly_folded_together_keep_their_branches(seed):
    rng = np.random.default_rng((seed, 21))
    margin = 10 ** rng.uniform(-6, -3)
    bars, lean = [], rng.random() < 0.5
    for _ in range(int(rng.choice([1, 2, 2, 3, 4]))):
        off = rng.uniform(-1, 1) * np.sqrt(margin) if lean else 0.0
        bars.append(nearly_folded(rng, margin, offset=rng.uniform(-np.pi, np.pi), lean=off))
    if not lean and seed % 2:  # the same four-bar several times, turned
        one = bars[0]
        bars = [Bars(one.a, one.b, one.c, one.g, float(rng.choice([-1, 1])), bar.offset) for bar in bars]
    start = rng.uniform(-np.pi, np.pi)
    low, high = np.array([bar.interval(start) for bar in bars]).T
    crank = start + rng.choice([-1, 1]) * np.linspace(0, 2 * np.pi, int(rng.choice(COUNTS)))
    m = four_bars(bars, start, anywhere(rng))
    s = mg.kinematics(m, {"A": crank - start}, on_reach="flag", engine="sparse" if seed % 8 == 7 else "dense")
    inside = (crank > low.max()) & (crank < high.min())
    np.testing.assert_array_equal(s.status == "ok", inside)
    for i, bar in enumerate(bars):
        error = np.abs(wrapped(s[f"D{i}"].position[..., 0] - bar.rocker(crank) + bar.rocker(start)))
        assert error[inside].max() < 1e-9


@pytest.mark.daily(3)
@pytest.mark.parametrize("exponent", range(3, 10, 2))
@pytest.mark.parametrize("longer", [True, False])
def test_slider_crank_with_rod_about_as_long_as_the_crank(exponent, longer):
    rod = 1.0 + (1 if longer else -1) * 10.0**-exponent
    for start, n in ((0.3, 5), (-0.7, 18)):
        along = np.cos(start) + np.sqrt((rod - np.sin(start)) * (rod + np.sin(start)))
        pairs = [
            mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
            mg.Pair("B", "R", "crank", "rod", point=(np.cos(start), np.sin(start), 0), axis=Z),
            mg.Pair("C", "R", "rod", "slider", point=(along, 0, 0), axis=Z),
            mg.Pair("D", "P", "frame", "slider", point=(along, 0, 0), axis=(1, 0, 0)),
        ]
        q = np.linspace(0, 2 * np.pi, n)
        s = solved(mg.Mechanism("slider-crank", None, pairs, ["A"]), {"A": q})
        crank, ok = q + start, s.status == "ok"
        if longer:
            assert ok.all()
        else:
            inside = crank < np.arcsin(rod)
            assert not (ok & ~inside).any()
            assert not (~ok & inside & (np.arcsin(rod) - crank > LIMIT)).any()
        root = np.sqrt(np.maximum((rod - np.sin(crank)) * (rod + np.sin(crank)), 0.0))
        error = np.abs(s["D"].position[..., 0] - np.cos(crank) - root + along)[ok]
        assert (error * np.maximum(root[ok], 1e-9)).max() < 1e-11


@pytest.mark.daily(1)
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("size", [3e-4, 1e-3])
def test_a_small_bend_of_a_slot_that_leads_back_is_not_leapt_over(size, turned):
    """Between two nodes, on a slot that is straight elsewhere: past the place where the slot turns back the pin does not get along it.

    Nor does a ball along the ridge of a surface, which is the slot turned about an axis.
    """
    v = np.sinh(np.linspace(-1, 1, 140) * np.arcsinh(2 / size))
    x = size * (v - 3 * v * np.exp(-v * v))
    slot = mg.Curve.through(points=np.stack([x, 2 * size * np.tanh(v), np.zeros(140)], axis=1))
    begin = np.argmin(np.abs(x + 1))
    here = (x[begin], 2 * size * np.tanh(v[begin]), 0)
    pairs = [
        mg.Pair("X", "P", "frame", "carriage", point=here, axis=(1, 0, 0)),
        mg.Pair("Y", "P", "carriage", "pin", point=here, axis=(0, 1, 0)),
        mg.Pair(
            "G",
            "Sp",
            "frame",
            "pin",
            point=here,
            surface=mg.Surface.revolution(profile=slot, center=(0, -5, 0), axis=(1, 0, 0)),
        )
        if turned
        else mg.Pair("G", "Sg", "frame", "pin", point=here, curve=slot),
    ]
    along = np.linspace(-2, 0, 10_001)
    back = (size * (along - 3 * along * np.exp(-along * along))).max() - here[0]
    for n in (2, 10):
        q = np.linspace(0, 2, n)
        s = mg.kinematics(mg.Mechanism("slot", None, pairs, ["X"]), {"X": q}, on_reach="flag")
        np.testing.assert_array_equal(s.status == "ok", q < back)


def test_first_position_out_of_reach_and_later_ones_within():
    """B3 of issue 11: positions behind one that is out of reach, back inside, are solved."""
    bar = Bars(1.0, 0.6, 0.6, 1.3)
    _, high = bar.interval(0.3)
    q = np.array([high - 0.1, high - 0.4, 0.0, -0.2])
    for engine in ("dense", "sparse"):
        s = mg.kinematics(four_bars([bar], 0.3), {"A": q}, on_reach="flag", engine=engine)
        assert s.status.tolist() == ["out of reach", "ok", "ok", "ok"]
        with pytest.raises(mg.ReachError) as caught:
            mg.kinematics(four_bars([bar], 0.3), {"A": q}, engine=engine)
        assert "out of reach" in str(caught.value)


def at_dead_point():
    """A four-bar driven by its rocker, declared where crank and coupler are in line."""
    a, b, c, g = 0.5, 1.2, 1.1, 1.3
    foot = np.array([g, 0.0])
    x = ((a + b) ** 2 + g * g - c * c) / (2 * g)
    head = np.array([x, np.sqrt((a + b) ** 2 - x * x)])
    tip = head * a / (a + b)
    points = {"A": (0, 0), "B": tip, "C": head, "D": foot}
    ends = {"A": ("frame", "crank"), "B": ("crank", "coupler"), "C": ("coupler", "rocker"), "D": ("frame", "rocker")}
    pairs = [mg.Pair(k, "R", *ends[k], point=(*points[k], 0), axis=Z) for k in ends]
    return mg.Mechanism("at a dead point", None, pairs, ["D"])


@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("positions", [0.0, [0.0], [0.0, 0.01, -0.01]])
def test_a_driver_declared_at_its_dead_point_is_a_dead_point(engine, positions):
    """B1 of issue 11: not "drive as many more", not "contradict each other", and never solved."""
    with pytest.raises(mg.DeadPointError):
        mg.solve(at_dead_point(), {"D": positions}, engine=engine)


@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_a_structure_is_refused_for_any_subset_of_positions(engine):
    """A triangle: what is refused with a further position is refused for the first alone, as on its own it cannot be driven either."""
    m = mechanisms.ring("RRR", [(0, 0, 0), (1, 0, 0), (0.3, 1, 0)], [Z] * 3)
    found = [type(solved(m, {"O1": q}, engine=engine)) for q in ([0.0, 0.1], [0.1], [0.0], 0.0)]
    assert len(set(found)) == 1, found


def rssr_on_a_slide():
    """An RSSR whose rocker stands on a second driven slide; its coupler may spin."""
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
        mg.Pair("P", "P", "frame", "slide", point=(3, 0, 0), axis=(1, 0, 0)),
        mg.Pair("D", "R", "slide", "rocker", point=(3, 0, 0.5), axis=(0, 1, 0)),
        mg.Pair("B", "S", "crank", "coupler", point=(1, 0, 0)),
        mg.Pair("C", "S", "coupler", "rocker", point=(3, 0, 2.5)),
    ]
    return mg.Mechanism("rssr on a slide", None, pairs, ["A", "P"])


@pytest.mark.daily(1)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_two_drivers_go_on_behind_a_gap_in_space(engine):
    """What can be reached behind a gap is solved, though the way straight along its edge does not lead there."""
    t = np.linspace(0, 1, 61)
    crank, out = 0.5 + 0.2 * t, 8 * np.sin(np.pi * t) ** 2
    s = mg.kinematics(rssr_on_a_slide(), {"A": crank, "P": out}, on_reach="flag", engine=engine)
    # the distance of B from the circle of C, against the rod
    B = np.stack([np.cos(crank), np.sin(crank), np.zeros(61)], axis=1)
    across = np.hypot(B[:, 0] - 3 - out, B[:, 2] - 0.5)
    can = (np.hypot(np.abs(across - 2), B[:, 1]) < np.sqrt(10.25)) & (np.hypot(across + 2, B[:, 1]) > np.sqrt(10.25))
    assert 20 < can.sum() < 40
    assert s.status.tolist() == np.where(can, "ok", "out of reach").tolist()
    for i in (50, 60):
        alone = mg.kinematics(rssr_on_a_slide(), {"A": crank[i : i + 1], "P": out[i : i + 1]}, engine=engine)
        np.testing.assert_allclose(s["D"].position[i], alone["D"].position[0], atol=1e-10)


def test_turns_behind_a_gap_are_those_of_the_way_back():
    """The way back is straight from the nearest point reached: rotation vectors and the spin of a passive rod are those along it."""
    before, behind = [(0.6, 1.0), (0.6, 2.0)], [(0.2, 2.7), (0.3, 1.0), (1.3, 0.5), (1.0, 1.5)]
    gap, way = [(0.6, 3.2), (0.2, 3.2)], [(0.6, 2.7)]
    found = []
    for between in (gap, way):
        crank, out = np.array(before + between + behind).T
        found.append(mg.kinematics(rssr_on_a_slide(), {"A": crank, "P": out}, on_reach="flag"))
    s, straight = found
    assert s.status.tolist() == ["ok"] * 2 + ["out of reach"] * 2 + ["ok"] * 4
    for name in "BCD":
        np.testing.assert_allclose(s[name].position[4:], straight[name].position[3:], atol=1e-10)
    np.testing.assert_allclose(s.link("coupler").pose[4:], straight.link("coupler").pose[3:], atol=1e-10)


def five_bar(rng):
    """A planar five-bar with both cranks driven, and the closed form of its head for crank angles: NaN out of reach."""
    while True:
        first, second, b, c, g = rng.uniform(0.5, 1.5, 5)
        start, side = rng.uniform(-np.pi, np.pi, 2), rng.choice([-1, 1])

        def tips(turns, first=first, second=second, g=g, start=start):
            t = start[:, None] + turns
            return (
                first * np.stack([np.cos(t[0]), np.sin(t[0])]),
                np.array([[g], [0.0]]) + second * np.stack([np.cos(t[1]), np.sin(t[1])]),
            )

        def head(turns, tips=tips, b=b, c=c, side=side):
            p, q = tips(turns)
            d = np.linalg.norm(q - p, axis=0)
            x = (b * b - c * c + d * d) / (2 * d)
            with np.errstate(invalid="ignore"):
                y = side * np.sqrt((b - x) * (b + x))
            u = (q - p) / d
            return p + x * u + y * np.stack([-u[1], u[0]]), np.minimum(b + c - d, d - abs(b - c))

        (p, q), (h, margin) = tips(np.zeros((2, 1))), head(np.zeros((2, 1)))
        if margin > 0.1:
            break
    points = {"A": (0, 0), "B": p[:, 0], "C": h[:, 0], "D": q[:, 0], "E": (g, 0)}
    ends = ("frame", "crank"), ("crank", "rod"), ("rod", "other rod"), ("other rod", "other"), ("other", "frame")
    pairs = [mg.Pair(k, "R", *e, point=(*points[k], 0), axis=Z) for k, e in zip(points, ends, strict=True)]
    pairs[4] = mg.Pair("E", "R", "frame", "other", point=(g, 0, 0), axis=Z)
    return mg.Mechanism("five-bar", None, pairs, ["A", "E"]), head


@pytest.mark.seeds(6, daily=(1, 2))
def test_a_polygon_misses_nothing_that_is_reached_alone(seed):
    """Behind gaps of random polygons: on the branch of the closed form, nothing flagged that is reached by itself, the same for any
    further positions on the polygon."""
    rng = np.random.default_rng((seed, 25))
    m, head = five_bar(rng)
    n = int(rng.choice([3, 7, 20]))
    turns = np.cumsum(rng.uniform(-1, 1, (2, n)), axis=1) if seed % 2 else rng.uniform(-1.5, 1.5, (2, n))
    engine = "sparse" if seed % 5 == 4 else "dense"
    s = mg.kinematics(m, {"A": turns[0], "E": turns[1]}, on_reach="flag", engine=engine)
    h, margin = head(turns)
    ok = s.status == "ok"
    assert not (ok & ~(margin > 0)).any()
    C = s.link("rod").point((*head(np.zeros((2, 1)))[0][:, 0], 0.0)).position
    np.testing.assert_allclose(C[ok, :2] * np.sqrt(margin[ok, None]), h.T[ok] * np.sqrt(margin[ok, None]), atol=1e-9)
    for i in np.flatnonzero(~ok & (margin > 0)):
        alone = mg.kinematics(m, {"A": turns[0, i : i + 1], "E": turns[1, i : i + 1]}, on_reach="flag", engine=engine)
        assert alone.status[0] != "ok"
    corners = np.concatenate([np.zeros((2, 1)), turns], axis=1)
    finer = np.stack([corners[:, :-1], 0.5 * (corners[:, :-1] + corners[:, 1:])], axis=2).reshape(2, -1)[:, 1:]
    finer = np.concatenate([finer, turns[:, -1:]], axis=1)
    more = mg.kinematics(m, {"A": finer[0], "E": finer[1]}, on_reach="flag", engine=engine)
    assert more.status[1::2].tolist() == s.status.tolist()
    np.testing.assert_allclose(more["C"].position[1::2], s["C"].position, atol=1e-9)


@pytest.mark.daily(1)
@pytest.mark.parametrize("seed", [5, 3])
def test_both_engines_say_the_same_of_positions_out_of_reach(seed):
    """A five-bar with both cranks driven to random angles, most of them out of reach or behind a gap."""
    rng = np.random.default_rng((seed, 21))
    corners = np.array([[0, 0], [0.3, 1], [1.2, 1.6], [2.1, 0.9], [1.8, 0]]) + 0.3 * rng.normal(size=(5, 2))
    names = ["frame", "a", "b", "c", "d", "frame"]
    pairs = [mg.Pair("ABCDE"[i], "R", names[i], names[i + 1], point=(*corners[i], 0), axis=Z) for i in range(5)]
    wanted = dict(zip("AE", rng.uniform(-2.5, 2.5, (2, 4)), strict=True))
    m = mg.Mechanism("five-bar", None, pairs, ["A", "E"])
    dense, sparse = (mg.solve(m, wanted, on_reach="flag", engine=e) for e in ("dense", "sparse"))
    assert dense.status.tolist() == sparse.status.tolist()
    assert len(set(dense.status.tolist())) > 1


# --- Identities of motions that repeat themselves: far positions are those followed all the way ---


def geared():
    """A four-bar whose crank is geared to the driven wheel by 2 : 3: it repeats itself after three turns of the wheel."""
    four_bar = mg.load("four-bar")
    wheel = mg.Pair("G", "R", "frame", "wheel", point=(-1, 0, 0), axis=Z)
    coupling = mg.Coupling({"G": 2.0, "A": -3.0})
    return mg.Mechanism("geared", pairs=[wheel, *four_bar.pairs], couplings=[coupling], drives=["G"])


def screw():
    """A screw geared to a wheel: it goes on and on."""
    pairs = [
        mg.Pair("A", "R", "frame", "wheel", point=(0, 0, 0), axis=Z),
        mg.Pair("H", "H", "frame", "bolt", point=(1, 0, 0), axis=Z, lead=0.1),
    ]
    return mg.Mechanism("screw", pairs=pairs, couplings=[mg.Coupling({"A": 1.0, "H": -1.0})], drives=["A"])


MADE = {"geared": geared, "screw": screw, "four-bar": None, "rssr": None, "7r": None, "rcsr": None}


@pytest.mark.daily(4)
@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("name", MADE)
def test_far_positions_are_those_followed_all_the_way(name, sense, monkeypatch):
    m = MADE[name]() if MADE[name] else mg.load(name)
    q = {m.drives[0].freedom: mg.Motion(sense * np.array([0.3, 7.0, 60.0, 61.0]), velocity=1.0)}
    s = mg.kinematics(m, q, on_reach="flag", engine="dense")
    monkeypatch.setattr(reach, "_find_periods", lambda *_: None)
    r = mg.kinematics(m, q, on_reach="flag", engine="dense")
    assert s.status.tolist() == r.status.tolist()
    for link in m.link_names():
        np.testing.assert_allclose(s.link(link).pose, r.link(link).pose, atol=1e-9)
        np.testing.assert_allclose(s.link(link).twist, r.link(link).twist, atol=1e-9)
    for pair in m.pairs:
        if len(np.atleast_1d(s[pair.name].position[0])) == 1:
            np.testing.assert_allclose(s[pair.name].position, r[pair.name].position, atol=1e-9)
    if name not in ("screw", "rcsr"):
        assert s.work.nodes < 0.5 * r.work.nodes


@pytest.mark.parametrize("name", ["four-bar", "rssr", "geared"])
def test_a_thousand_radians_take_one_period(name):
    m = MADE[name]() if MADE[name] else mg.load(name)
    s = mg.kinematics(m, {m.drives[0].freedom: [1000.0]}, engine="dense")
    assert s.work.nodes < 200
    np.testing.assert_allclose(s[m.drives[0].freedom.split(".")[0]].position[0, 0], 1000.0, rtol=1e-15)


def test_periods_of_a_rod_that_turns_are_continued_many_together(monkeypatch):
    """Rotation vectors of the ball joints over 16,000 turns of the crank: in some hundred batches, not one a turn."""
    calls, advance = [], DriverPath.advance
    monkeypatch.setattr(DriverPath, "advance", lambda *given: calls.append(1) or advance(*given))
    m = mg.load("rssr")
    s = mg.kinematics(m, {"A": [1e5]})
    assert len(calls) < 1000
    near = mg.kinematics(m, {"A": [1e5 - 2 * np.pi * np.floor(1e5 / (2 * np.pi))]})
    np.testing.assert_allclose(s["D"].position % (2 * np.pi), near["D"].position % (2 * np.pi), atol=1e-8)


@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("turns", [2.4, 10.0, -3.0])
def test_a_bush_at_rest_counts_every_turn(engine: str, turns: float) -> None:
    """Between two hinges on one axis of a crank about z: at rest it turns in the crank by the crank's turn times the cosine of the axes."""
    axes = np.array([[0, 0, 1.0], [0.3, 0.05, 1.0], [0.9, 0.8, 0.7], [-0.3, 1.0, 0.6]])
    hinges = [
        ("A", "frame", "a", 0),
        ("B1", "a", "bush", 1),
        ("B2", "bush", "b", 1),
        ("C", "b", "c", 2),
        ("D", "c", "frame", 3),
    ]
    pairs = [mg.Pair(name, "R", a, b, point=1.2 * axes[i], axis=axes[i]) for name, a, b, i in hinges]
    crank = np.array([0.4, 1.0]) * 2 * np.pi * turns
    s = mg.kinematics(mg.Mechanism("bush", None, pairs, ["A"]), {"A": crank}, engine=engine)
    assert np.allclose(s["B1"].position.ravel(), -crank / np.linalg.norm(axes[1]), atol=1e-10)


def test_positions_beside_a_change_point_are_closed_or_are_not_solved(monkeypatch):
    """What is interpolated there is no better than its nodes: loops left open by more than closing counts are said to be."""
    states = singular_point.Crossing.states

    def off(crossing, places):
        return states(crossing, places) + np.where(np.abs(places - crossing.place) < 1.5e-3, 1e-6, 0.0)

    m, q = four_bar(1, 2, 1, 2, np.pi / 2), np.pi / 2 + np.array([-0.1, -1e-3, 0.0, 1.8e-3, 0.1])
    monkeypatch.setattr(singular_point.Crossing, "states", off)
    s = mg.solve(m, {"A": q}, on_reach="flag")
    assert list(s.status) == ["ok", "loops not closed", "loops not closed", "ok", "ok"]
    assert np.isnan(s["A"].effort[1:3]).all()
    assert np.isnan(s["D"].position[1:3]).all()
    with pytest.raises(mg.ReachError, match="the closure residual stays above round-off"):
        mg.solve(m, {"A": q})


def test_what_is_asked_at_an_open_start_is_not_closed() -> None:
    """Tracks that end where they begin have no step: an IndexError, where no other track had one."""
    s = System(mechanisms.linked_four_bar(2.0, 1.5, 2.5, 3.0, 0.9))
    x, beyond = s.state_of(np.zeros((s.n_freedoms, 1)))[:, 0], 2.9
    x[s.single_rows[0]] = beyond
    path = DriverPath(s, closure_solver("dense", np.array([0])), s.cases)
    found = reach.follow(path, [Request(x, 0, np.full((1, 1), beyond), np.array([i])) for i in range(3)], 3)
    assert list(found.status) == [Status.NOT_CLOSED] * 3
