"""Catalogue parts: against closed forms, and against the same mechanism written by hand."""

import pickle
from pathlib import Path

import numpy as np
import pytest

import mechgraph as mg

Z = (0, 0, 1)
G = 9.81
PIN = mg.Pair("A", "R", "frame", "boom", point=(0, 0, 0), axis=Z)
BOOM = mg.Link("boom", 10.0, (0.5, 0, 0), points={"tip": (2, 0, 0)})
WEIGHT = (mg.Gravity((0, -G, 0)),)
FRAME = mg.Link("frame")


def crane(*parts, loads=WEIGHT, drives=("jack.lift.Tz",)):
    return mg.Mechanism("crane", [FRAME, BOOM], [PIN], drives, loads, parts=parts)


def jack(**more):
    return mg.parts.cylinder("jack", "frame", (1, -1, 0), "boom", (1, 0, 0), **more)


def lever(stroke):
    """Angle of the boom and lever of the cylinder about its pin: a triangle with sides sqrt 2 and 1 (law of cosines)."""
    length = 1.0 + np.asarray(stroke)
    between = np.arccos((3 - length**2) / (2 * np.sqrt(2)))
    return between - np.pi / 4, np.sqrt(2) * np.sin(between) / length


@pytest.mark.parametrize("pins", [{}, {"axis": Z}])
def test_a_cylinder_lifts_a_boom(pins):
    strokes = np.array([0.0, 0.1, 0.35])
    s = mg.solve(crane(jack(**pins)), {"jack.lift.Tz": strokes})
    angle, arm = lever(strokes)
    np.testing.assert_allclose(s["A"].position[:, 0], angle, atol=1e-9)
    np.testing.assert_allclose(s["jack.lift"].effort[:, -1], 10 * G * 0.5 * np.cos(angle) / arm, rtol=1e-9)
    assert mg.check(crane(jack())).determinate


def test_pressure_pushes_with_the_area_of_the_piston():
    angle = 0.3
    loaded = crane(jack(bore=0.08, pressure=3e4), drives=["A"], loads=())
    s = mg.solve(loaded, {"A": angle})
    _, arm = lever(s["jack.lift"].position[..., 1])
    np.testing.assert_allclose(s["A"].effort[0], -3e4 * np.pi * 0.04**2 * arm, rtol=1e-9)


def test_a_cylinder_is_what_one_would_write_by_hand():
    points = [np.array(p) for p in ((1.0, -1, 0), (1.0, -0.5, 0), (1.0, 0, 0))]
    solid = [mg.inertia.cylinder(2.0, 0.04, 0.5, (0, 1, 0))] * 2
    by_hand = mg.Mechanism(
        "crane",
        [
            FRAME,
            BOOM,
            mg.Link("jack.tube", 2.0, (1, -0.75, 0), solid[0]),
            mg.Link("jack.rod", 2.0, (1, -0.25, 0), solid[1]),
        ],
        [
            PIN,
            mg.Pair("jack.a", "S", "frame", "jack.tube", point=points[0]),
            mg.Pair("jack.lift", "C", "jack.tube", "jack.rod", point=points[0], axis=(0, 1, 0)),
            mg.Pair("jack.b", "S", "jack.rod", "boom", point=points[2]),
        ],
        ["jack.lift.Tz"],
        [mg.Gravity((0, -G, 0))],
    )
    assert crane(jack(mass=4.0, bore=0.08)) == by_hand


def test_two_numbers_make_pins_about_z():
    flat = mg.parts.cylinder("jack", "frame", (1, -1), "boom", (1, 0))
    assert flat == jack(axis=Z)
    assert [p.type.symbol for p in mg.parts.rod("tie", "a", (0, 0), "b", (1, 0)).pairs] == ["R", "R"]


def test_links_are_inferred_and_keep_the_masses_of_parts():
    m = mg.Mechanism("crane", pairs=[PIN], parts=[jack(mass=(3.0, 1.0))])
    assert m.link_names() == ("frame", "boom", "jack.tube", "jack.rod")
    assert [link.mass for link in m.links] == [0, 0, 3, 1]
    lone = mg.parts.Parts(links=(mg.Link("spare"),))
    with pytest.raises(mg.DeclarationError, match="'spare' is not connected"):
        mg.Mechanism("crane", pairs=[PIN], parts=[lone])


def test_a_rod_keeps_its_length_and_carries_its_line():
    tie = mg.parts.rod("tie", "frame", (1, 0.5, 1.0), "boom", (1, 0, 0))
    m = crane(tie, drives=())
    s = mg.solve(m)
    along = np.array([0, -0.5, -1.0])
    force = s["tie.b"].force
    np.testing.assert_allclose(np.cross(force, along), 0, atol=1e-9)
    np.testing.assert_allclose(force[1], 10 * G * 0.5, rtol=1e-12)
    hinged = mg.parts.four_bar("F", "frame", [(0, 0), (0, 1), (2, 1), (2, 0)])
    links = mg.parts.rod("F", "F.crank", (0, 1), "F.rocker", (2, 1))
    assert [p.type.symbol for p in links.pairs] == [p.type.symbol for p in hinged.pairs[1:3]]


def rotor(name="B", **more):
    held = mg.parts.bearings(name, "frame", "rotor", [(0, 0, 0), (0, 0, 0.5)], Z, **more)
    body = mg.Link("rotor", 5.0, (0, 0, 0.2), np.diag([0.1, 0.1, 0.02]))
    return mg.Mechanism("rotor", [FRAME, body], (), [f"{name}.turn.Rz"], [mg.Gravity((0, -G, -G))], parts=[held])


@pytest.mark.parametrize("fixed", [0, 1])
def test_bearings_share_the_load_by_the_lever_rule_and_one_takes_the_thrust(fixed):
    s = mg.solve(rotor(fixed=fixed), {"B.turn.Rz": mg.Motion([0.0, 2.0], 0.0, 3.0)})
    np.testing.assert_allclose(s["B.1"].force[:, 1], 5 * G * 0.6, rtol=1e-12)
    np.testing.assert_allclose(s["B.2"].force[:, 1], 5 * G * 0.4, rtol=1e-12)
    np.testing.assert_allclose([s[f"B.{k + 1}"].force[0, 2] for k in (fixed, 1 - fixed)], [5 * G, 0], atol=1e-12)
    np.testing.assert_allclose(s["B.turn"].effort[:, 5], 3 * 0.02, rtol=1e-12)
    np.testing.assert_allclose(s["B.turn"].position[:, 5], [0, 2])


def test_the_turn_of_bearings_holds_nothing():
    """With and without the pair Fr: the same counts, the same passive freedom, the same ledger."""
    m = rotor().replace(drives=[])
    bare = m.replace(pairs=m.pairs[:2])
    one, two = mg.check(m), mg.check(bare)
    for name in ("mobility_by_count", "mobility", "finite_mobility", "redundancy", "determinate"):
        assert getattr(one, name) == getattr(two, name)
    assert [f.links for f in one.passive] == [f.links for f in two.passive] == [("rotor",)]
    assert [one.ledger(k).unknowns for k in ("lee", "minimal")] == [two.ledger(k).unknowns for k in ("lee", "minimal")]
    np.testing.assert_allclose(mg.solve(m)["B.1"].force, mg.solve(bare)["B.1"].force, rtol=1e-14)


def test_the_turn_measures_what_a_hinge_would():
    """A shaft with a crank in a four-bar, once in a hinge, once in bearings: the same motion and torque."""
    points = [(0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (3.0, 2.0, 0.0), (4.0, 0.0, 0.0)]
    bar = mg.parts.four_bar("F", "frame", points, mass=(1.0, 3.0, 2.0))
    hinged = mg.Mechanism("f", parts=[bar], drives=["F.A"], loads=[mg.Gravity((0, -G, 0))])
    held = mg.parts.bearings("S", "frame", "F.crank", [(0, 0, -0.5), (0, 0, 0.5)], Z)
    on = hinged.replace(pairs=[*hinged.pairs[1:], *held.pairs], drives=["S.turn.Rz"])
    motion = mg.Motion(np.linspace(0, 6, 9), 2.0, 0.5)
    one, two = mg.solve(hinged, {"F.A": motion}), mg.solve(on, {"S.turn.Rz": motion})
    np.testing.assert_allclose(one["F.C"].position, two["F.C"].position, atol=1e-9)
    np.testing.assert_allclose(one["F.A"].effort[:, 0], two["S.turn"].effort[:, 5], atol=1e-9)
    assert not two.warnings


def test_a_strut_pushes_with_its_spring_and_its_damper():
    strut = mg.parts.spring_strut(
        "S", "frame", (1, -1, 0), "boom", (1, 0, 0), stiffness=2e3, damping=50.0, free_length=1.2
    )
    s = mg.solve(crane(strut, drives=["A"], loads=()), {"A": mg.Motion([0.0, 0.2], 0.7)})
    stroke = s["S.lift"].position[:, 1]
    _, arm = lever(stroke)
    np.testing.assert_allclose(-s["A"].effort[:, 0], -(2e3 * (stroke - 0.2) + 50 * 0.7 * arm) * arm, rtol=1e-9)


def test_a_screw_drive_moves_a_table():
    """The table goes back by the lead in a turn; torque times 2 pi is force times lead."""
    slide = mg.Pair("X", "P", "frame", "table", point=(0, 0, 0), axis=(1, 0, 0))
    feed = mg.parts.screw_drive("feed", "frame", (-1, 0, 0), "table", (0, 0, 0), lead=0.01)
    m = mg.Mechanism("table", pairs=[slide], parts=[feed], drives=["feed.turn"], loads=[mg.Effort("X", -800.0)])
    assert mg.check(m).determinate
    s = mg.solve(m, {"feed.turn": 2 * np.pi * np.arange(4.0)})
    np.testing.assert_allclose(s["X"].position[:, 0], -0.01 * np.arange(4), atol=1e-12)
    np.testing.assert_allclose(s["feed.turn"].effort[:, 0], -800 * 0.01 / (2 * np.pi), rtol=1e-9)
    beside = m.replace(pairs=[p.replace(point=(0, 0.3, 0)) if p.name == "X" else p for p in m.pairs])
    np.testing.assert_allclose(mg.solve(beside, {"feed.turn": 1.0})["feed.turn"].effort[0], -8 / (2 * np.pi), rtol=1e-9)


@pytest.mark.parametrize("phase", [0.0, np.pi / 2])
def test_a_cardan_shaft_is_even_with_its_forks_in_one_plane(phase):
    """Two joints of 25 degrees in Z: even, or cos^2 twice over (tan chain of both joints), and torque by its rate."""
    bend = np.deg2rad(25.0)
    axis = np.array([np.cos(bend), np.sin(bend), 0])
    turn = np.linspace(0.0, 2.5, 6)
    shaft = mg.parts.cardan_shaft("K", "in", (0, 0, 0), "out", (1, 0, 0), axis_a=axis, axis_b=axis, phase=phase)
    pairs = [
        mg.Pair("I", "R", "frame", "in", point=(0, 0, 0), axis=axis),
        mg.Pair("O", "R", "frame", "out", point=(1, 0, 0), axis=axis),
    ]
    m = mg.Mechanism("cardan", pairs=pairs, parts=[shaft], drives=["I"], loads=[mg.Effort("O", -7.0)])
    report = mg.check(m)
    assert report.determinate
    assert report.redundancy == 0
    s = mg.solve(m, {"I": mg.Motion(turn, 1.0)})
    k = 1.0 if phase == 0 else np.cos(bend) ** 2
    expected = np.unwrap(np.arctan2(np.sin(turn), k * np.cos(turn)))
    rate = k / (np.sin(turn) ** 2 + k**2 * np.cos(turn) ** 2)
    np.testing.assert_allclose(s["O"].position[:, 0], expected, atol=1e-9)
    np.testing.assert_allclose(s["I"].effort[:, 0], 7.0 * rate, rtol=1e-9)


def test_rack_and_gears_are_the_couplings_they_stand_for():
    z, x = (0, 0, 1), (1, 0, 0)
    rack = mg.parts.rack_and_pinion("G", "frame", (0, 0, 0), z, x, radius=0.02)
    by_hand = mg.Mechanism(
        "g",
        pairs=[
            mg.Pair("G.turn", "R", "frame", "G.pinion", point=(0, 0, 0), axis=z),
            mg.Pair("G.slide", "P", "frame", "G.rack", point=(0, -0.02, 0), axis=x, second=z),
        ],
        couplings=[mg.Rack("G.mesh", "G.turn", "G.slide", 0.02)],
    )
    assert mg.Mechanism("g", parts=[rack]) == by_hand
    s = mg.solve(by_hand, {"G.turn": [0.5]}, loads=[mg.Effort("G.slide", -10.0)])
    np.testing.assert_allclose([s["G.slide"].position[0, 0], s["G.turn"].effort[0, 0]], [0.01, 0.2], rtol=1e-12)
    stage = mg.parts.gear_stage("G", "frame", (0, 0), (0.06, 0), z, teeth=(20, 40), module=0.002)
    m = mg.Mechanism("g", parts=[stage], drives=["G.in"])
    assert mg.check(m).ratios == {"G.out.Rz": {"G.in.Rz": -0.5}}


@pytest.mark.parametrize("helix", [0.0, 0.3])
@pytest.mark.parametrize("floating", [True, False])
def test_a_planetary_set_obeys_willis_and_a_floating_sun_shares_the_load(floating, helix):
    """24/30/84: carrier 24/108 of the sun with the ring held; sun in the plane: T / (3 r_b) a planet; in a bearing: two too many."""
    part = mg.parts.planetary("P", 24, 30, 84, module=0.002, floating=floating, helix_angle=helix)
    drives, loads = ["P.sun.Rz", "P.ring.Rz"], [mg.Effort("P.carrier.Rz", -10.0)]
    m = mg.Mechanism("set", parts=[part], drives=drives, loads=loads)
    report = mg.check(m)
    assert report.redundancy == (0 if floating else 2)
    s = mg.solve(m, {"P.sun.Rz": [0.0, 1.0, 30.0], "P.ring.Rz": [0.0, 0.0, 2.0]})
    sun, ring = np.array([0, 1, 30.0]), np.array([0, 0, 2.0])
    np.testing.assert_allclose(s["P.carrier"].position[:, 0], (24 * sun + 84 * ring) / 108, atol=1e-9)
    np.testing.assert_allclose(s["P.sun"].effort[:, -1], 10 * 24 / 108, rtol=1e-9)
    np.testing.assert_allclose(s["P.ring"].effort[:, -1], 10 * 84 / 108, rtol=1e-9)
    forces = np.array([np.linalg.norm(s.coupling(f"P.sun{i}").force, axis=-1) for i in (1, 2, 3)])
    if floating and not helix:
        base = 24 * 0.001 * np.cos(np.deg2rad(20))
        np.testing.assert_allclose(forces, 10 * 24 / 108 / (3 * base), rtol=1e-9)
    elif not floating:
        assert np.isnan(forces).all()


def test_a_planetary_set_in_the_plane_and_the_places_of_its_planets():
    """20/17/54 by 3: 74 / 3 is no integer, so the planets stand at 0, 121.6216, 238.3784 degrees."""
    part = mg.parts.planetary("P", 20, 17, 54, module=2.0, point=(10, 0))
    m = mg.Mechanism("set", parts=[part], drives=["P.sun.Rz", "P.ring.Rz"], planar=True)
    assert mg.check(m).determinate
    places = [np.rad2deg(np.arctan2(p.point[1], p.point[0] - 10)) % 360 for p in m.pairs[3:]]
    np.testing.assert_allclose(places, [0, 121.6216, 238.3784], atol=5e-5)
    s = mg.kinematics(m, {"P.sun.Rz": [0.0, 2.0], "P.ring.Rz": 0.0})
    np.testing.assert_allclose(s["P.carrier"].position[:, 0], [0, 2 * 20 / 74], atol=1e-9)


@pytest.mark.parametrize("name", ["cylinder", "rod", "strut", "rack", "gears", "four-bar", "slider-crank"])
def test_parts_of_two_numbers_fit_a_planar_mechanism(name):
    part = FLAT[name]
    m = mg.Mechanism("m", pairs=[mg.Pair("A", "R", "frame", "boom", point=(0, 0))], parts=[part], planar=True)
    twin = mg.Mechanism("m", pairs=[PIN], parts=[part])
    one, two = mg.check(m), mg.check(twin)
    assert (one.mobility, one.redundancy) == (two.mobility, 0)


def test_a_slider_crank_has_the_torque_of_the_books():
    """r .05, l .15, 60 degrees, 1000 N: F r (sin t + tan p cos t) = 50.8390, F tan p = 301.5113."""
    r, l, t = 0.05, 0.15, np.deg2rad(60)
    p = np.arcsin(r * np.sin(t) / l)
    B, C = (r * np.cos(t), r * np.sin(t)), (r * np.cos(t) + l * np.cos(p), 0.0)
    part = mg.parts.slider_crank("E", "frame", [(0, 0), B, C], (1, 0), mass=0.0)
    m = mg.Mechanism("engine", parts=[part], drives=["E.A"], loads=[mg.Effort("E.slide", -1000.0)])
    torque = mg.solve(m, {"E.A": 0.0})["E.A"].effort[0]
    np.testing.assert_allclose(torque, -1000 * r * (np.sin(t) + np.tan(p) * np.cos(t)), rtol=1e-9)
    np.testing.assert_allclose(abs(torque), 50.8390, atol=5e-5)
    heavy = mg.parts.slider_crank("E", "frame", [(0, 0), B, C], (1, 0), mass=(1.0, 2.0, 3.0))
    assert [link.mass for link in heavy.links] == [1, 2, 3]
    assert np.allclose(heavy.links[2].center, (*C, 0))


PARTS = {
    "cylinder": jack(mass=4.0, bore=0.08, pressure=2e5),
    "rod": mg.parts.rod("P", "frame", (0, 0, 1), "boom", (1, 0, 0), mass=2.0),
    "strut": mg.parts.spring_strut("P", "frame", (0, 1), "boom", (1, 0), stiffness=2.0, mass=1.0),
    "bearings": mg.parts.bearings("P", "frame", "boom", [(0, 0, 0), (0, 0, 1), (0, 0, 3)], Z, fixed=1),
    "screw": mg.parts.screw_drive("P", "frame", (0, 0, 1), "boom", (1, 0, 0), lead=-0.01, mass=3.0),
    "cardan": mg.parts.cardan_shaft(
        "P", "frame", (0, 0, 1), "boom", (1, 0, 0), axis_a=(1, 0, 0), axis_b=(1, 1, 0), mass=1.0
    ),
    "rack": mg.parts.rack_and_pinion("P", "frame", (0, 0, 1), Z, (1, 0, 0), radius=0.1),
    "gears": mg.parts.gear_stage("P", "frame", (0, 0), (1, 0), Z, teeth=(20, 30), helix_angle=0.1),
    "four-bar": mg.parts.four_bar("P", "frame", [(0, 0), (0, 1), (3, 2), (4, 0)], mass=3.0),
    "slider-crank": mg.parts.slider_crank("P", "frame", [(0, 0), (1, 0), (4, 0)], (1, 0), mass=3.0),
    "planetary": mg.parts.planetary("P", 24, 30, 84, module=0.002),
}


FLAT = {
    "cylinder": mg.parts.cylinder("P", "frame", (1, -1), "boom", (1, 0), mass=4.0),
    "rod": mg.parts.rod("P", "frame", (0, 1), "boom", (1, 0)),
    **{name: PARTS[name] for name in ("strut", "gears", "four-bar", "slider-crank")},
    "rack": mg.parts.rack_and_pinion("P", "frame", (0, 1), Z, (1, 0), radius=0.1),
}


@pytest.mark.daily(5)
@pytest.mark.parametrize("part", PARTS.values(), ids=PARTS)
def test_a_part_is_plain_data(part, tmp_path: Path):
    m = mg.Mechanism("m", pairs=[PIN], parts=[part], units={"length": "m", "mass": "kg", "time": "s"})
    assert m.pairs == (PIN, *part.pairs)
    assert (m.loads, {c.name for c in m.couplings}) == (part.loads, {c.name for c in part.couplings})
    mg.save(m, tmp_path / "m.toml")
    assert mg.load(tmp_path / "m.toml") == m
    assert pickle.loads(pickle.dumps(m)) == m
    assert m.replace(description="") == m
    back = m.to_units(length="mm").to_units(length="m")
    np.testing.assert_allclose([p.point for p in back.pairs], [p.point for p in m.pairs], atol=1e-15)
    turned = np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1.0]])
    mine, theirs = mg.check(m), mg.check(m.moved(turned))
    assert (mine.mobility, mine.redundancy) == (theirs.mobility, theirs.redundancy)


def test_quantities_of_pint_are_numbers_in_the_units_of_the_mechanism():
    u = pytest.importorskip("pint").UnitRegistry()
    part = mg.parts.cylinder(
        "jack", "frame", (100, -100, 0) * u.cm, "boom", [1 * u.m, 0 * u.m, 0 * u.m],
        axis=Z, mass=4000 * u.g, bore=8 * u.cm, pressure=2 * u.bar,
    )  # fmt: skip
    units = {"length": "mm", "mass": "t", "time": "s"}
    m = mg.Mechanism("crane", pairs=[PIN], parts=[part], units=units)
    plain = jack(axis=Z, mass=4.0, bore=0.08, pressure=2e5)
    wanted = mg.Mechanism("crane", pairs=[PIN], parts=[plain], units={"length": "m", "mass": "kg", "time": "s"})
    wanted = wanted.to_units(length="mm", mass="t")
    for one, two in zip(m.links[2:], wanted.links[2:], strict=True):
        np.testing.assert_allclose([one.mass, *one.center], [two.mass, *two.center], rtol=1e-12)
        np.testing.assert_allclose(one.inertia, two.inertia, rtol=1e-12)
    np.testing.assert_allclose([p.point for p in m.pairs], [p.point for p in wanted.pairs], rtol=1e-12)
    assert m.loads[0].value == pytest.approx(wanted.loads[0].value)
    with pytest.raises(mg.DeclarationError) as error:
        mg.parts.cylinder("jack", "frame", (100, -100, 0) * u.cm, "boom", (1, 0, 0), mass=4.0)
    assert "q = (1, 0, 0): expected a quantity with its unit" in str(error.value)
    assert "mass = 4.0" in str(error.value)


def test_parts_add_up():
    both = PARTS["cylinder"] + PARTS["rod"]
    assert mg.Mechanism("m", pairs=[PIN], parts=[both]) == mg.Mechanism(
        "m", pairs=[PIN], parts=[PARTS["cylinder"], PARTS["rod"]]
    )
    with pytest.raises(TypeError):
        PARTS["rod"] + 1


WRONG = {
    "same point": (lambda: mg.parts.rod("P", "a", (0, 0), "b", (0, 0)), ["same point"]),
    "all at once": (
        lambda: mg.parts.cylinder("", "", (0, 0, np.inf), "b", (1, 2, 3, 4), mass=-1.0, bore=0.0, pressure=1.0),
        ["name", "a = ''", "p = ", "q = ", "mass = ", "bore = "],
    ),
    "pressure without bore": (lambda: jack(pressure=3.0), ["needs bore="]),
    "pins along the line": (lambda: jack(axis=(0, 1, 0)), ["at right angles to p-q"]),
    "no axis": (lambda: jack(axis=(0, 0, 0)), ["a direction, not zero"]),
    "masses of three": (lambda: jack(mass=(1, 2, 3)), ["or 2 such numbers"]),
    "one bearing": (lambda: mg.parts.bearings("P", "a", "b", [(0, 0, 0)], Z, fixed=3), ["two bearings", "fixed = 3"]),
    "bearings off line": (lambda: mg.parts.bearings("P", "a", "b", [(0, 0, 0), (0, 1, 1), (0, 0, 0)], Z),
        ["not on the axis", "another bearing"]),
    "no lead": (lambda: mg.parts.screw_drive("P", "a", (0, 0, 0), "b", (1, 0, 0), lead=0.0), ["lead = 0.0"]),
    "a right angle": (lambda: mg.parts.cardan_shaft("P", "a", (0, 0, 0), "b", (1, 0, 0), axis_a=Z, axis_b=(1, 0, 0)), ["axis_a = "]),
    "three points": (lambda: mg.parts.four_bar("P", "a", [(0, 0), (1, 0), (1, 1)]), ["four: A, B, C, D"]),
    "a rack askew": (lambda: mg.parts.rack_and_pinion("P", "a", (0, 0), Z, (1, 0, 1), radius=-1), ["radius = -1", "right angles"]),
    "a guide askew": (lambda: mg.parts.slider_crank("P", "a", [(0, 0), (1, 0), (2, 0)], Z), ["right angles"]),
    "no springs": (
        lambda: mg.parts.spring_strut("P", "a", (0, 0), "b", (1, 0), stiffness=-1.0, damping=-2.0), ["stiffness = -1.0", "damping = -2.0"]),
    "planets that touch": (lambda: mg.parts.planetary("P", 24, 30, 84, 6, module=0.002), ["= 27; expected more than 32"]),
    "teeth that do not fit": (lambda: mg.parts.planetary("P", 24, 30, 80, module=0.002), ["expected sun + 2 planet = 84"]),
    "no part": (lambda: mg.Mechanism("m", pairs=[PIN], parts=[PIN]), ["parts = ", "mg.parts.rod"]),
    "names twice": (lambda: crane(jack(), jack()), ["'jack.tube' is declared 2 times", "'jack.lift' is declared 2 times"]),
}  # fmt: skip


@pytest.mark.parametrize(("make", "told"), WRONG.values(), ids=WRONG)
def test_faults_are_told_together(make, told):
    with pytest.raises(mg.DeclarationError) as error:
        make()
    for text in told:
        assert text in str(error.value)


def test_names_with_dots_work_everywhere(tmp_path: Path, compiled):
    """Freedoms ``pair.freedom``, points ``link.point``, parameters, columns, C and FMU names."""
    m = crane(jack(mass=4.0))
    assert m.full_name("jack.lift") == "jack.lift.Tz"
    ways = [
        mg.Pair(f"x.{k}", "P", a, b, point=(0, 0, 0), axis=z)
        for k, a, b, z in zip("123", ("frame", "x.a", "x.b"), ("x.a", "x.b", "x.c"), np.eye(3), strict=True)
    ]
    table = mg.Mechanism(
        "table", [*map(mg.Link, ("frame", "x.a", "x.b")), mg.Link("x.c", points={"tip": (1, 1, 1)})], ways
    )
    s = mg.solve(table, {"x.c.tip": [[2, 3, 4]]}, actuate=["x.1", "x.2", "x.3"])
    np.testing.assert_allclose([s[f"x.{k}"].position[0, 0] for k in "123"], [1, 2, 3], atol=1e-9)
    s = mg.solve(m, {"jack.lift.Tz": [0.0, 0.1]})
    assert "jack.lift.Tz effort" in s.to_pandas()
    varied = {"jack.rod.mass": [1.0, 3.0]}
    found = mg.study(m, varied, {"F": lambda s: s["jack.lift"].effort[..., 1]}, 3, motions={"jack.lift.Tz": 0.0})
    drawn = np.asarray(found.parameters["jack.rod.mass"])
    np.testing.assert_allclose(np.ravel(found.outputs["F"]), (10 * 0.5 + drawn) * G, rtol=1e-9)
    c = mg.compile(m)
    np.testing.assert_allclose(c([0.1]), mg.solve(m, {"jack.lift.Tz": 0.1})["jack.lift"].effort[1], rtol=1e-9)
    c.write(str(tmp_path / "crane.c"), name="crane")
    assert "jack.lift.Tz" in (tmp_path / "crane.h").read_text()


def test_a_part_that_there_is_not_is_told_with_those_there_are():
    with pytest.raises(
        AttributeError, match=r"mg\.parts has no 'crane'; there are bearings, cardan_shaft, cylinder, .* spring_strut"
    ):
        _ = mg.parts.crane
    assert "cylinder" in dir(mg.parts)
    assert "np" not in dir(mg.parts)
