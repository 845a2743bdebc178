"""Fitness of mechanisms that meet positions: defects and transmission against closed forms, and against the map of all branches."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from ladder import LADDER, four_bar, spatial
from mechanisms import FourBarFormula

import mechgraph as mg
from mechgraph.synthesis.fitness import Fitness, fitnesses, least_between


def fitness(m: mg.Mechanism, q: np.ndarray, *of: str) -> Fitness:
    return fitnesses([m], q[None], *of)[0]


def rows_of(m: mg.Mechanism, starts: list[dict[str, float]]) -> np.ndarray:
    return np.array([[start[name] for name in ("O0", "O1", "O2", "O3")] for start in starts])


def out_of_order(values: np.ndarray, whole: bool) -> bool:
    steps = np.diff(values)
    if whole:
        return bool(min(np.mod(steps, 2 * np.pi).sum(), np.mod(-steps, 2 * np.pi).sum()) >= 2 * np.pi)
    return bool((steps > 0).any() and (steps < 0).any())


def transmission_angle(known: FourBarFormula, angle: float, side: int) -> float:
    tip, joint = known.joint(angle, side)
    mu = np.angle((joint - tip) / (joint - known.lengths[3]))
    return float(np.arcsin(abs(np.sin(mu))))


@pytest.mark.daily(3)
@pytest.mark.parametrize("seed", range(400))
def test_defects_and_transmission_of_four_bars_are_those_of_closed_forms(seed: int) -> None:
    known = FourBarFormula(np.random.default_rng(seed))
    rng, whole = known.rng, not known.folds.size
    angles = known.angles(4)
    if len(angles) < 2:
        return
    angles = np.roll(np.sort(angles), rng.integers(4)) if rng.random() < 0.7 else angles
    sides = rng.choice([-1, 1], len(angles)) if rng.random() < 0.3 else np.full(len(angles), rng.choice([-1, 1]))
    asked = list(zip(angles.tolist(), sides.tolist(), strict=True))
    m = known.mechanism(*asked[0])
    found = fitness(m, rows_of(m, [known.start(*at) for at in asked]), "O0", "O3")
    # cranks that swing about their other dead position count angles from there
    a, b, c, d = known.lengths
    values = np.mod(angles, 2 * np.pi) if abs(b - c) > abs(a - d) else angles
    branch = len({known.branch(*at) for at in asked}) > 1
    assert found.branch == branch
    assert found.circuit == (len({known.circuit(*at) for at in asked}) > 1)
    assert found.order == (not branch and out_of_order(values, whole))
    assert found.full_turn == whole
    assert found.transmission == pytest.approx(min(transmission_angle(known, *at) for at in asked), abs=1e-7)
    if found.good and not whole:
        between = [transmission_angle(known, angle, sides[0]) for angle in np.linspace(values[0], values[-1], 2001)]
        assert found.transmission_between == pytest.approx(min(between), abs=1e-3)


@pytest.mark.parametrize("gap", [1e-2, 1e-3, 1e-4, 1e-5])
def test_rows_beside_a_near_change_point_lie_on_one_branch(gap: float) -> None:
    """The crank passes its ground while coupler and rocker are nearly in line, where the other circuit comes as near as the gap."""
    rng, made, rows, least = np.random.default_rng(5), list[mg.Mechanism](), list[np.ndarray](), list[float]()
    while len(made) < 12:
        known, (a, b, c) = FourBarFormula(rng), np.round(np.exp(0.6 * rng.normal(size=3)), 2)
        known.lengths, side = (a, b, c, a + abs(c - b) + gap), rng.choice([-1, 1])
        reach = np.abs(known.lengths[3] - a * np.exp(0.3j))
        if abs(b - c) < 0.2 or reach > b + c:
            continue
        angles = np.sort(rng.uniform(-0.3, 0.3, 20))[:: rng.choice([-1, 1])]
        made.append(known.mechanism(angles[0], side))
        rows.append(rows_of(made[-1], [known.start(angle, side) for angle in angles]))
        dense = np.concatenate([np.linspace(angles[0], angles[-1], 4001), angles])
        least.append(min(transmission_angle(known, angle, side) for angle in dense))
    for one, angle in zip(fitnesses(made, np.array(rows), "O0", "O3"), least, strict=True):
        assert (one.branch, one.circuit, one.order) == (False, False, False)
        assert one.transmission_between == pytest.approx(angle, abs=1e-4)


def test_a_crank_that_turns_back_just_before_its_ground_has_one_circuit() -> None:
    """The links are 1e-6 too short for a whole turn of the crank: both sides of the coupler meet at folds beside it."""
    known = FourBarFormula(np.random.default_rng(0))
    known.lengths = a, b, c, _ = 0.1482443553669891, 1.2394762856049273, 6.141277460297319, 7.232510390535257
    asked = [(-1.6331, -1), (0.3005, 1), (0.9428, 1), (0.8938, -1)]
    m = known.mechanism(*asked[0])
    found = fitness(m, rows_of(m, [known.start(*at) for at in asked]), "O0", "O3")
    assert b + c < a + known.lengths[3]
    assert (found.branch, found.circuit, found.full_turn) == (True, False, False)


def test_a_slide_that_drives_beyond_its_folds_is_followed_to_them() -> None:
    """Both sides of an eccentric slider-crank meet where the slide turns back, however far from the first row: one circuit."""
    crank, rod, e = 1.0, 1.7, 0.8
    rows = []
    for x, side in ((0.0, -1), (1.0, 1)):
        r, tip = np.hypot(x, e), x + 1j * e
        u = (crank**2 - rod**2 + r**2) / (2 * r)
        rows.append((tip / r * (u + 1j * side * np.sqrt(crank**2 - u**2)), tip))
    (B, C), (B1, C1) = rows
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0)),
        mg.Pair("B", "R", "crank", "rod", point=(B.real, B.imag)),
        mg.Pair("C", "R", "rod", "slider", point=(C.real, C.imag)),
        mg.Pair("P", "P", "frame", "slider", point=(C.real, C.imag), axis=(1, 0)),
    ]
    m = mg.Mechanism("slider-crank", pairs=pairs, planar=True, frame="frame")
    turn, swing = np.angle(B1 / B), np.angle((C1 - B1) / (C - B))
    q = np.array([[0.0, 0, 0, 0], [turn, swing - turn, -swing, 1.0]])
    found = fitness(m, q, "P", "A")
    assert (found.branch, found.circuit) == (True, False)


def test_places_of_a_slider_crank_are_met_on_a_branch_if_the_rod_stays_on_one_side() -> None:
    """With the slider driven its crank stands on either side of the dead positions: one circuit, two branches."""
    z, crank, rod = (0.0, 0.0, 1.0), 1.0, 2.5
    m = mg.Mechanism(
        "slider-crank",
        [mg.Link("frame"), mg.Link("crank"), mg.Link("rod"), mg.Link("slider")],
        [
            mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=z),
            mg.Pair("B", "R", "crank", "rod", point=(0, crank, 0), axis=z),
            mg.Pair("C", "R", "rod", "slider", point=(np.sqrt(rod**2 - crank**2), 0, 0), axis=z),
            mg.Pair("D", "P", "frame", "slider", point=(0, 0, 0), axis=(1, 0, 0)),
        ],
        planar=True,
    )

    def row(angle: float) -> list[float]:
        turned, tilt = angle - np.pi / 2, np.arcsin(crank / rod * np.sin(angle)) - np.arcsin(crank / rod)
        way = crank * np.cos(angle) + np.sqrt(rod**2 - (crank * np.sin(angle)) ** 2) - np.sqrt(rod**2 - crank**2)
        return [turned, -tilt - turned, tilt, way]

    def of(angles: list[float], driver: str, output: str) -> Fitness:
        return fitness(m, np.array([row(angle) for angle in angles]), driver, output)

    crank_driven = of([1.5, 3.0, 4.5], "A", "D")
    assert (crank_driven.good, crank_driven.full_turn) == (True, True)
    assert np.cos(crank_driven.transmission) == pytest.approx(crank / rod * max(abs(np.sin([1.5, 3.0, 4.5]))), abs=1e-9)
    # least where the crank is square to the slide, between the second place and the third
    assert np.cos(crank_driven.transmission_between) == pytest.approx(crank / rod, abs=1e-4)
    slider_driven = of([1.0, 2.0, 3.0], "D", "A")
    assert (slider_driven.good, slider_driven.full_turn) == (True, False)
    beyond = of([1.0, 2.0, 4.0], "D", "A")
    assert (beyond.branch, beyond.circuit, beyond.good) == (True, False, False)
    assert of([1.0, 3.0, 2.0], "D", "A").order
    assert (crank_driven.size, crank_driven.ratio) == pytest.approx((rod, rod))


def test_sizes_are_those_of_axes_and_centers_wherever_on_these_points_are_declared() -> None:
    """A crank of 3, a rod of 13 with a ball at each end, and a slider of which the cylinder passes 5 beside its ball."""
    found = []
    for along, aside in ((0.0, 0.0), (7.0, -40.0)):
        m = mg.Mechanism(
            "crank and slider",
            pairs=[
                mg.Pair("A", "R", "frame", "crank", point=(0, 0, along), axis=(0, 0, 1)),
                mg.Pair("B", "S", "crank", "rod", point=(3, 0, 0)),
                mg.Pair("C", "S", "rod", "slider", point=(8, 12, 0)),
                mg.Pair("D", "C", "frame", "slider", point=(8 + aside, 12, 5), axis=(1, 0, 0)),
            ],
            drives=["A"],
        )
        found.append(fitness(m, np.zeros((1, 6 + 3)), None, None))
    # from the axis of the crank to that of the slider, across both: 12
    assert [(one.size, one.ratio) for one in found] == [pytest.approx((13.0, 13.0 / 3.0))] * 2


def test_verdicts_on_a_spatial_mechanism_are_those_of_the_map_of_its_branches() -> None:
    """RSSR, of which the ball-jointed rod may spin: places of one branch, of two, of another circuit."""
    m = mg.load("rssr")
    b = mg.branches(m, "A", samples=8, points=64)
    names = m.freedom_names()
    for number, one in enumerate(b.branches):
        rows = one.coordinates[[3, 20, 40]]
        found = fitness(m, rows, "A", "D")
        assert (found.branch, found.circuit, found.order) == (False, False, False)
        assert found.full_turn == b.full_turn[number]
        for other, two in enumerate(b.branches):
            mixed = np.concatenate([rows[:1], two.coordinates[[20]]])
            defects = b.defects([dict(zip(names, q.tolist(), strict=True)) for q in mixed])
            told = fitness(m, mixed, "A", "D")
            assert (
                (told.branch, told.circuit) == (defects.branch, defects.circuit) == (other != number, other != number)
            )


def test_without_a_driver_nothing_is_said_of_defects() -> None:
    m = mg.load("four-bar")
    found = fitness(m, np.zeros((1, len(m.freedom_names()))))
    assert (found.branch, found.circuit, found.order, found.full_turn, found.good) == (None, None, None, None, True)
    assert np.isnan(found.transmission)
    assert found.lacks(["branch", "full_turn"]) == ("branch", "full_turn")
    m, task, unknown, _ = LADDER["R-R dyad, 5 poses"]()
    s = mg.synthesize(m, task, unknown, require=["full_turn"])
    assert {one.reasons for one in s.rejected} == {("full turn not determined",)}


@pytest.mark.parametrize("seed", [8, 10])
def test_conditions_are_those_of_positions_to_which_the_driver_does_not_lead(seed: int) -> None:
    """The rocker stands where it is asked; the crank leads it elsewhere, or does not come so far."""
    pairs = np.random.default_rng(seed).uniform(-0.8, 0.8, (5, 2))
    pairs[0] = 0.0

    def turned(s: mg.Solution) -> np.ndarray:
        return s["D"].position

    ends = {turned: (pairs[:, 1].min() - 1e-6, pairs[:, 1].max() + 1e-6)}
    s = mg.synthesize(four_bar(), mg.function("A", "D", pairs), ["B.point", "C.point"], conditions=ends)
    assert [one.branch for one in s.fitness] == [True]
    assert s.rejected == ()
    beyond = mg.synthesize(
        four_bar(), mg.function("A", "D", pairs), ["B.point", "C.point"], conditions=ends, over={"A": [0, 3, -3]}
    )
    assert [one.reasons for one in beyond.rejected] == [("turned is not determined at all positions",)]


def test_a_sweep_is_kept_ranked_and_tabled_value_by_value() -> None:
    task = mg.function("A", "D", np.deg2rad([[0, 0], [72, -30], [144, -10], [216, 10]]))
    sweep = {"C.point.x": [-0.3, 0.1, 0.2]}
    every = mg.synthesize(four_bar(), task, ["B.point", "C.point.y"], sweep=sweep)
    kept = mg.synthesize(
        four_bar(), task, ["B.point", "C.point.y"], sweep=sweep, bounds={"B.point.x": (0.7, None)},
        conditions={"transmission D": (np.deg2rad(15), None)}, require=["branch"],
    )  # fmt: skip
    assert [len(s) for s in every] == [1, 3, 1]
    assert [len(s) for s in kept] == [1, 2, 0]
    for one, some, out in zip(every, kept, kept.rejected, strict=True):
        fits = [not f.branch and x >= 0.7 and f.transmission >= np.deg2rad(15)
                for f, x in zip(one.fitness, one.field("B.point.x"), strict=True)]  # fmt: skip
        assert np.allclose(some.values, one.values[fits], rtol=0, atol=1e-9)
        assert len(out) == len(one) - len(some)
    assert "left out" in str(kept)
    assert [[f.good for f in fits] for fits in every.good.fitness] == [[True], [True, True], []]
    assert [s.values.tolist() for s in every.distinct] == [s.distinct.values.tolist() for s in every]
    table = every.ranked("size").to_pandas()
    assert table.index.tolist() == [(0, 0), (1, 0), (1, 1), (1, 2), (2, 0)]
    assert table["C.point.x"].tolist() == [-0.3, 0.1, 0.1, 0.1, 0.2]
    assert table.loc[1, "size"].is_monotonic_increasing
    assert every.good[2:][0].to_pandas().empty


def test_conditions_without_a_driver_are_a_fault_and_those_of_two_drivers_are_taken_at_the_rows() -> None:
    m = four_bar().replace(drives=[])
    poses = mg.poses("coupler", [(0, 0, 0), (0.2, 0.1, 0.1), (0.5, 0.1, 0.3)])
    with pytest.raises(
        mg.DeclarationError, match=r"conditions: 'D.effort': .* 1 freedom is neither driven nor passive"
    ):
        mg.synthesize(m, poses, ["B.point", "C.point"], conditions={"D.effort": (None, 40)})

    def turned(s: mg.Solution) -> np.ndarray:
        return s["A"].position

    swing = [mg.Pair("D", "R", "swing", "rocker", point=(2.2, 0)), mg.Pair("E", "R", "frame", "swing", point=(5, 1))]
    five = mg.Mechanism("five-bar", pairs=[*m.pairs[:-1], *swing], drives=["A", "E"], planar=True, frame="frame")
    rows = mg.positions(
        [{"A": 0.0, "E": 0.0, "D": 0.0}, {"A": 0.1, "E": 0.2, "D": 0.2}, {"A": 0.3, "E": 0.1, "D": 0.1}]
    )
    for most in (0.31, 0.29):
        s = mg.synthesize(five, rows, ["B.point"], conditions={turned: (None, most)})
        assert [one.reasons for one in s.rejected] == [(f"turned = 0 to 0.3; asked: at most {most:g}",)] * (most < 0.3)
        assert len(s) == (most > 0.3)


def test_from_a_dead_point_a_driver_leads_nowhere_and_two_drivers_leave_defects_unknown() -> None:
    """A slider-crank driven by its slider, with crank and rod in line; a five-bar of which one of two drives is asked."""
    m = mg.Mechanism(
        "slider-crank",
        pairs=[
            mg.Pair("A", "R", "frame", "crank", point=(0, 0)),
            mg.Pair("B", "R", "crank", "rod", point=(1, 0)),
            mg.Pair("C", "R", "rod", "slider", point=(3, 0)),
            mg.Pair("D", "P", "frame", "slider", point=(3, 0), axis=(1, 0)),
        ],
        planar=True,
    )
    dead = fitness(m, np.zeros((2, len(m.freedom_names()))), "D", "A")
    assert (dead.branch, dead.circuit, dead.good) == (True, None, False)
    assert fitness(m, np.zeros((1, len(m.freedom_names()))), "A", "D").good
    at = [(0, 0), (0, 1), (1, 2), (2, 1), (2, 0)]
    ends = ["frame", "left", "upper left", "upper right", "right", "frame"]
    pairs = [mg.Pair("ABCDE"[i], "R", ends[i], ends[i + 1], point=at[i]) for i in range(5)]
    five = mg.Mechanism("five-bar", pairs=pairs, drives=["A", "E"], planar=True)
    found = fitness(five, np.zeros((2, len(five.freedom_names()))), "A")
    assert (found.branch, found.full_turn) == (None, None)
    assert np.isnan([found.transmission, found.transmission_between]).all()


def test_mechanisms_of_one_topology_are_judged_together_as_each_alone() -> None:
    made, rows = [], []
    for seed in range(16):
        known = FourBarFormula(np.random.default_rng(seed))
        angles = known.angles(3).tolist()
        if len(angles) == 3:
            made.append(known.mechanism(angles[0], 1))
            rows.append(rows_of(made[-1], [known.start(angle, 1) for angle in angles]))
    together = fitnesses(made, np.array(rows), "O0", "O3")
    for a, b in zip(together, [fitness(m, q, "O0", "O3") for m, q in zip(made[:3], rows, strict=False)], strict=False):
        assert (a.branch, a.circuit, a.order, a.full_turn) == (b.branch, b.circuit, b.order, b.full_turn)
        angles = [[fit.transmission, fit.transmission_between] for fit in (a, b)]
        assert np.allclose(*angles, atol=1e-5, equal_nan=True)
    assert {fit.full_turn for fit in together} == {fit.good for fit in together} == {True, False}


@pytest.mark.parametrize("name", ["bennett", "spherical-four-bar", "r-sp-r", "geneva"])
def test_transmission_is_that_of_solutions(name: str) -> None:
    """Redundant loops, a point in a plane, and contacts, whose forces act elsewhere."""
    m = mg.load(name)
    driver = m.full_name(m.drives[0].freedom)
    s = mg.kinematics(m, {driver: m.start.get(driver, 0.0) + np.array([0.0, 0.05, 0.1])})
    q = np.concatenate([s[p.name].position for p in m.pairs], axis=1)
    outputs = [p.freedom_names[0] for p in m.pairs if p.type.f == 1 and m.frame in (p.a, p.b)]
    wanted = [mg.transmission(s, output).transmission_angle for output in outputs if output != driver]
    found = fitness(m, q, driver)
    assert found.good
    assert found.transmission == pytest.approx(np.min(wanted), abs=1e-7)


def test_change_points_are_passed_straight_on() -> None:
    pairs = {"A": (0, 0), "B": (0.6, 0.8), "C": (2.6, 0.8), "D": (2, 0)}
    ends = ["frame", "crank", "coupler", "rocker", "frame"]
    made = [
        mg.Pair(name, "R", a, b, point=at) for (name, at), a, b in zip(pairs.items(), ends[:4], ends[1:], strict=True)
    ]
    m = mg.Mechanism("parallelogram", pairs=made, drives=["A"], planar=True)
    turned = np.array([0.0, 2.0, 4.0, 6.0])
    found = fitness(m, np.outer(turned, [1, -1, 1, -1]), "A", "D")
    assert (found.good, found.full_turn) == (True, True)


def test_the_transmission_of_spheres_on_planes_and_in_grooves_is_that_of_a_solution() -> None:
    """Where a contact acts moves on one of its links; of ten mechanisms each at once."""
    rng = np.random.default_rng(0)
    for output, pairs in (("Q", ("R", "Sp", "R")), ("Q.Rz", ("R", "Sg", "C"))):
        made, q, wanted = list[mg.Mechanism](), list[np.ndarray](), list[float]()
        while len(made) < 10:
            places = rng.normal(size=(3, 2, 3)).tolist()
            rows = [(symbol, tuple(at), tuple(axis)) for symbol, (at, axis) in zip(pairs, places, strict=True)]
            m = spatial("contact", *rows)
            s = mg.solve(m, {"O": [0.0, 0.05, 0.1]}, on_reach="flag")
            if (angle := mg.transmission(s, output).transmission_angle).min() > 0.01:
                made.append(m)
                q.append(np.concatenate([s[pair.name].position.reshape(3, -1) for pair in m.pairs], axis=1))
                wanted.append(float(angle.min()))
        found = [one.transmission for one in fitnesses(made, np.array(q), "O", output)]
        assert np.abs(np.array(found) - wanted).max() < 1e-12


def test_a_leg_that_stands_the_other_way_at_a_row_is_no_defect() -> None:
    """A function does not ask in which way a universal joint stands: the branch through the first row meets the others."""
    far, axis = np.array((1.5, 2, 0.8)), (0.3, 0.2, 1)
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0.1, 0.2, 1)),
        mg.Pair("U", "U", "crank", "leg", point=(1, 0, 0.1), axis=axis, second=np.cross(far - (1, 0, 0.1), axis)),
        mg.Pair("B", "S", "leg", "rocker", point=far),
        mg.Pair("G", "R", "rocker", "frame", point=(1, 3, 0), axis=(0.3, 0.1, 1)),
    ]
    links = [mg.Link(name) for name in ("frame", "crank", "leg")] + [mg.Link("rocker", points={"tip": (2, 2, 1)})]
    m = mg.Mechanism("leg", links, pairs, drives=["A"], frame="frame")
    b, output = mg.branches(m, "A", samples=6, points=60), m.freedom_names().index("G.Rz")
    rows = b.branches[0].coordinates[[8, 13, 18]]
    # of others at the same place of the crank the one that has the same place of the rocker, and one that has not
    modes = mg.assemblies(m, {"A": rows[1, 0]})
    gaps = [abs(np.sin(0.5 * (mode.start["G.Rz"] - rows[1, output]))) for mode in modes]
    near = [mode for mode, gap in zip(modes, gaps, strict=True) if gap < 1e-9]
    turned = max(near, key=lambda mode: abs(np.sin(0.5 * (mode.start["U.Rz"] - rows[1, 1]))))
    other, wrong = rows.copy(), rows.copy()
    other[1], wrong[1] = (list(mode.start.values()) for mode in (turned, modes[int(np.argmax(gaps))]))
    asked = {"A.Rz": rows[:, 0], "G.Rz": rows[:, output]}
    assert len(near) == 2
    plain = fitness(m, rows, "A", "G")
    assert fitness(m, other, "A", "G").circuit
    of_point = {f"rocker.tip.{part}": np.ones(3) for part in ("Tx", "Ty", "Tz")}
    for names in (asked, of_point, {"rocker.Rz": np.ones(3)}):
        (found,) = fitnesses([m], other[None], "A", "G", asked=names)
        assert (found.branch, found.circuit, found.order) == (plain.branch, plain.circuit, plain.order) == (False,) * 3
        assert abs(found.transmission - plain.transmission) < 1e-9
    # where the output is asked to be elsewhere, this is a defect; nothing is asked at the second row
    for names in (asked, of_point, {"rocker.Rz": np.ones(3)}, {"leg.Rz": np.ones(3)}):
        (found,) = fitnesses([m], wrong[None], "A", "G", asked=names)
        assert found.branch
    assert fitnesses([m], other[None], "A", "G", asked={"leg.Rz": np.ones(3)})[0].branch
    (found,) = fitnesses([m], wrong[None], "A", "G", asked=asked | {"G.Rz": rows[:, output] * [1, np.nan, 1]})
    assert not found.branch


def test_of_a_point_or_link_only_what_is_asked_counts() -> None:
    """At crank angle 0 a four-bar and its mirror image have the end of the coupler one above the other, and turned by opposite angles."""
    known, places = FourBarFormula(np.random.default_rng(0)), [(-0.4, 1), (0.0, -1), (0.5, 1)]
    known.lengths = 1.0, 2.5, 3.0, 2.0
    m = known.mechanism(*places[0])
    coupler = m.pairs[1].b
    m = m.replace(links=[link.replace(points={"end": (2.5, 0, 0)} if link.name == coupler else {}) for link in m.links])
    q = rows_of(m, [known.start(*at) for at in places])[None]
    every = {f"{coupler}.{part}": np.ones(3) for part in ("Rx", "Ry", "Rz")}
    free, away = ["end.Tx", "end.T(1,0,0)", "Rx", "Ry"], ["end.Ty", "end.T(1,1,0)", "Rz"]
    for names, wrong in ((free, False), (away, True)):
        for name in names:
            asked = {f"{coupler}.{name}": np.ones(3)}
            assert fitnesses([m], q, "O0", "O3", asked=asked)[0].circuit is wrong
    assert fitnesses([m], q, "O0", "O3", asked=every)[0].circuit


@pytest.mark.parametrize("end", [0.0, 1.0])
def test_the_least_of_angles_is_found_beside_an_end_that_is_a_node_too_but_for_rounding(end: float) -> None:
    """A parabola with its least value .0028 from the end; what rounding puts upon it makes a dip of the end itself."""
    sense = 1.0 if end == 0.0 else -1.0
    nodes = np.array([[end, end + sense * 1e-16, end + sense * 0.015]])
    of = SimpleNamespace(
        V=1, row=0, home=[0], of_branch=np.zeros(3), a=SimpleNamespace(case=np.zeros(3, dtype=np.intp), x=nodes),
        along=lambda _, values: (np.zeros(len(values), dtype=np.intp), values),
        states=lambda _, values: (values[None], np.ones(len(values), dtype=bool)),
        here=lambda x, _: x,
    )  # fmt: skip

    def angles(x: np.ndarray, *_: np.ndarray) -> np.ndarray:
        return 0.1 + (x[0] - end - sense * 0.0028) ** 2 + 1e-14 * (x[0] != end)

    found = least_between(of, np.zeros(1, dtype=np.intp), np.zeros(1), np.ones(1), angles)
    assert found == pytest.approx(0.1, abs=1e-9)
