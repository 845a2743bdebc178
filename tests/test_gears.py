"""Gears, racks and belts: forces against hand calculations, motion against Willis' equation, and what holds for every contact."""

import sys

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mechgraph as mg

Z = (0.0, 0.0, 1.0)
TAN = np.tan(np.deg2rad(20.0))


def two(gears, b=(0.3, 0, 0), axis=Z, torque=10.0, swapped=(False, False), second="R", **more):
    """Two gears on the frame, the first driven, a torque (or force) on the second."""
    ends = [("frame", "one"), ("frame", "two")]
    (pa, qa), (pb, qb) = (end[::-1] if turn else end for end, turn in zip(ends, swapped, strict=True))
    pairs = [
        mg.Pair("A", "R", pa, qa, point=(0, 0, 0), axis=Z),
        mg.Pair("B", second, pb, qb, point=b, axis=axis),
    ]
    links = [mg.Link("frame"), mg.Link("one"), mg.Link("two")]
    return mg.Mechanism(
        "two gears", links, pairs, drives=["A"], couplings=[gears], loads=[mg.Effort("B", torque)], **more
    )


def solved(m, **more):
    return mg.solve(m, {m.drives[0].freedom: mg.Motion(np.array([0.0, 0.4, 1.0]), 2.0)}, **more)


def spur(**more):
    return mg.SpurGears("g", "A", "B", **{"teeth": (20, 40), **more})


# --- forces by hand --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("torque", [10.0, -10.0])
def test_spur_gears_by_hand(torque):
    """F_t = M / r across the line of centers, F_t tan 20 deg apart along it, whichever way the torque acts."""
    s = solved(two(spur(), torque=torque))
    np.testing.assert_allclose(s["B"].position[:, 0], -s["A"].position[:, 0] / 2, atol=1e-14)
    tangential, apart = torque / 0.2, abs(torque) / 0.2 * TAN
    for force in (s.coupling("g").force, -s["B"].force, s["A"].force):
        np.testing.assert_allclose(force, np.broadcast_to([apart, tangential, 0.0], (3, 3)), atol=1e-11)
    np.testing.assert_allclose(s.coupling("g").point, np.broadcast_to([0.1, 0, 0], (3, 3)), atol=1e-15)
    np.testing.assert_allclose(s["A"].effort, torque / 2, rtol=1e-13)
    assert s.checks.power.max() < 1e-12
    assert all(all(ok.all() for ok in s[name].unique.values()) for name in "AB")


def test_ring_gears_by_hand():
    """The ring is pushed outwards, wherever it is declared; both turn the same way."""
    for teeth, sign in (((20, 40), -1.0), ((40, 20), 1.0)):
        s = solved(two(spur(teeth=teeth, internal=True), b=(0.1, 0, 0)))
        np.testing.assert_allclose(s["B"].velocity[:, 0], 2.0 * teeth[0] / teeth[1], rtol=1e-13)
        radius = 0.1 * teeth[1] / 20
        np.testing.assert_allclose(s.coupling("g").point[:, 0], 0.1 + sign * radius, rtol=1e-12)
        np.testing.assert_allclose(s.coupling("g").force[:, 0], -10.0 / radius * TAN, rtol=1e-12)


@pytest.mark.parametrize("hand", [1.0, -1.0])
def test_helical_gears_by_hand(hand):
    """F_a = F_t tan beta, F_r = F_t tan alpha_n / cos beta; bearings take the couple F_a r too.

    Gear a has the hand, gear b the other one. The teeth of a right-handed gear a run along (0, sin beta, cos beta) at the mesh; what pushes
    gear b along +y has no part along them, so that it pushes along -z.
    """
    beta = 0.3 * hand
    s = solved(two(spur(helix_angle=beta)))
    tangential = 10.0 / 0.2
    wanted = [tangential * TAN / np.cos(beta), tangential, -tangential * np.tan(beta)]
    np.testing.assert_allclose(s.coupling("g").force[0], wanted, rtol=1e-12)
    # frame on gear a: minus the moment of -F at (0.1, 0, 0)
    np.testing.assert_allclose(s["A"].moment[0], [0.0, 0.1 * tangential * np.tan(beta), 0.0], atol=1e-12)


def test_bevel_gears_by_hand():
    """At right angles: F_r1 = F_t tan alpha cos delta_1 is the axial force of gear 2, and the other way round."""
    gears = mg.BevelGears("g", "A", "B", teeth=(20, 30), module=0.004)
    pairs = [
        mg.Pair("A", "R", "frame", "one", point=(0, 0, 0.1), axis=Z),
        mg.Pair("B", "R", "frame", "two", point=(0.1, 0, 0), axis=(1, 0, 0)),
    ]
    m = mg.Mechanism("bevel", pairs=pairs, drives=["A"], couplings=[gears], loads=[mg.Effort("B", 6.0)])
    s = solved(m)
    r1, r2 = 0.04, 0.06
    np.testing.assert_allclose(s.coupling("g").point, np.broadcast_to([r1, 0, r2], (3, 3)), atol=1e-14)
    delta = np.arctan2(20, 30)
    tangential = 6.0 / r2
    force = s.coupling("g").force[0]
    assert abs(force[1]) == pytest.approx(tangential, rel=1e-12)
    # gear b is pushed away along its own axis, and towards its own axis
    np.testing.assert_allclose(
        force[[0, 2]], [tangential * TAN * np.cos(delta), -tangential * TAN * np.sin(delta)], rtol=1e-12
    )
    np.testing.assert_allclose(np.abs(s["B"].velocity[:, 0]), 2.0 * 20 / 30, rtol=1e-13)


@pytest.mark.parametrize("left", [False, True])
def test_worm_and_wheel_by_hand(left):
    """tan lambda = z1 r2 / (z2 r1); without friction F_t1 = F_a1 tan lambda, and F_r = F_a1 tan alpha_n / cos lambda."""
    gears = mg.WormGear("g", "A", "B", teeth=(2, 40), radius=0.02, left_hand=left)
    s = solved(two(gears, b=(0.1, 0, 0), axis=(0, 1, 0), torque=80.0))
    r1, r2 = 0.02, 0.08
    lead = np.arctan(2 * r2 / (40 * r1))
    along = 80.0 / r2
    force = s.coupling("g").force[0]
    np.testing.assert_allclose(np.abs(force), [along * TAN / np.cos(lead), along * np.tan(lead), along], rtol=1e-12)
    assert abs(s["A"].effort[0, 0]) == pytest.approx(along * np.tan(lead) * r1, rel=1e-12)
    # a thread with the right hand, turned as a screw in +z, carries the teeth of the wheel along +z
    screw = 1.0 if not left else -1.0
    at_mesh = np.cross([0, s["B"].velocity[0, 0], 0], [-r2, 0, 0])
    assert at_mesh[2] == pytest.approx(-screw * 2.0 * r1 * np.tan(lead), rel=1e-12)


def test_rack_by_hand_and_as_a_wheel_that_grows():
    """x = r q; F_t = F; a wheel of radius R comes near to it as 1 / R."""
    rack = mg.Rack("g", "A", "B", radius=0.05)
    s = solved(two(rack, b=(0, -0.06, 0), axis=(1, 0, 0), torque=7.0, second="P"))
    np.testing.assert_allclose(s["B"].velocity[:, 0], 0.05 * 2.0, rtol=1e-13)
    np.testing.assert_allclose(
        s.coupling("g").force, np.broadcast_to([-7.0, -7.0 * TAN, 0], (3, 3)), rtol=1e-12, atol=1e-12
    )
    np.testing.assert_allclose(s.coupling("g").point, np.broadcast_to([0, -0.05, 0], (3, 3)), atol=1e-14)
    off = []
    for teeth in (2000, 20000):
        R = 0.05 * teeth / 20
        m = two(spur(teeth=(20, teeth)), b=(0, -0.05 - R, 0), torque=7.0 * R)
        wheel = solved(m)
        np.testing.assert_allclose(
            np.abs(wheel.coupling("g").force), np.abs(s.coupling("g").force), rtol=1e-12, atol=1e-11
        )
        # the driven point of the wheel's rim moves on a circle
        phi = wheel["B"].position[-1, 0] - wheel["B"].position[0, 0]
        off.append(abs(R * np.sin(abs(phi)) - 0.05 * 1.0))
    assert off[0] / off[1] == pytest.approx(100.0, rel=0.02)


@pytest.mark.parametrize("crossed", [False, True])
@pytest.mark.parametrize("torque", [6.0, -6.0])
def test_belt_by_hand(crossed, torque):
    """One strand pulls with M / r along the common tangent; an open belt turns both pulleys the same way."""
    belt = mg.Belt("g", "A", "B", radii=(0.1, 0.2), crossed=crossed)
    s = solved(two(belt, b=(0.6, 0, 0), torque=torque))
    np.testing.assert_allclose(s["B"].velocity[:, 0], -1.0 if crossed else 1.0, rtol=1e-13)
    force, point = s.coupling("g").force[0], s.coupling("g").point[0]
    assert np.linalg.norm(force) == pytest.approx(6.0 / 0.2, rel=1e-12)
    sine = (0.3 if crossed else -0.1) / 0.6
    assert force[0] == pytest.approx(-30.0 * np.sqrt(1 - sine**2), rel=1e-12)
    assert np.linalg.norm(point - [0.6, 0, 0]) == pytest.approx(0.2, rel=1e-12)
    assert np.cross(point - [0.6, 0, 0], force)[2] == pytest.approx(-torque, rel=1e-12)


# --- several meshes between the same shafts ------------------------------------------------------------------------------------


def meshes(*gears):
    """Gears between the same two shafts, a torque on the second: the shares are not unique."""
    m = two(spur(), b=(3, 0, 0), torque=5.0)
    return m.replace(
        couplings=[mg.SpurGears(f"g{i}", "A", "B", teeth=(20, 40), **more) for i, more in enumerate(gears)]
    )


@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("angles", [(20, 25), (25, 20), (25, 20, 22)])
def test_the_gear_of_the_smaller_pressure_angle_bears_all(angles, engine):
    """Shares m with sum M / r and sum |m| tan(angle) least: on either flank of the others the bearings would bear more."""
    s = solved(meshes(*({"pressure_angle": np.deg2rad(a)} for a in angles)), engine=engine, redundant="minimum_norm")
    shares = np.array([s.coupling(f"g{i}").effort[0] for i in range(len(angles))])
    np.testing.assert_allclose(shares, np.where(np.array(angles) == 20, -2.5, 0.0), atol=1e-6)
    np.testing.assert_allclose(s["A"].force, np.broadcast_to([2.5 * TAN, 2.5, 0.0], (3, 3)), rtol=1e-9, atol=1e-12)
    assert s.checks.equilibrium.max() < 1e-12


@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("second", [-0.3, -0.1])
def test_helices_of_opposite_hands_bear_each_other_s_axial_force(second, engine):
    """Shafts bear what both meshes exert; of equal angles half each, so that no axial force is left."""
    gears = ({"helix_angle": beta, "module": 0.1 * np.cos(beta)} for beta in (0.3, second))
    s = solved(meshes(*gears), engine=engine, redundant="minimum_norm")
    forces = [s.coupling(name).force for name in ("g0", "g1")]
    np.testing.assert_allclose(s["A"].force, forces[0] + forces[1], atol=1e-12)
    assert s.checks.equilibrium.max() < 1e-12
    assert np.abs(s["A"].force[:, 2]).max() < (1e-7 if second == -0.3 else 0.02)  # 0.25 and more of one mesh alone


# --- trains ------------------------------------------------------------------------------------------------------------------


def planetary(planets=1, teeth=(24, 18, 60)):
    """Sun and arm on the frame, planets on the arm, the ring is the frame."""
    sun, planet, ring = teeth
    module = 0.002
    r = module * (sun + planet) / 2
    links = [mg.Link("frame"), mg.Link("sun"), mg.Link("arm")]
    pairs = [
        mg.Pair("S", "R", "frame", "sun", point=(0, 0, 0), axis=Z),
        mg.Pair("C", "R", "frame", "arm", point=(0, 0, 0), axis=Z),
    ]
    gears = []
    for i in range(planets):
        turn = 2 * np.pi * i / planets
        links.append(mg.Link(f"p{i}"))
        pairs.append(mg.Pair(f"P{i}", "R", "arm", f"p{i}", point=(r * np.cos(turn), r * np.sin(turn), 0), axis=Z))
        gears.append(mg.SpurGears(f"sun{i}", "S", f"P{i}", teeth=(sun, planet), module=module))
        gears.append(mg.SpurGears(f"ring{i}", "C", f"P{i}", teeth=(ring, planet), module=module, internal=True))
    loads = [mg.Effort("C", -50.0)]
    return mg.Mechanism("planetary", links, pairs, drives=["S"], couplings=gears, loads=loads)


@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("planets", [1, 3])
def test_planetary_gears_obey_willis(planets, engine):
    """w_arm = w_sun z_s / (z_s + z_r); torques 1 : 1 + z_r / z_s; the share of each of three planets is not unique."""
    m = planetary(planets)
    s = solved(m, engine=engine)
    np.testing.assert_allclose(s["C"].velocity[:, 0], 2.0 * 24 / 84, rtol=1e-13)
    np.testing.assert_allclose(s["P0"].velocity[:, 0], -2.0 * 24 / 84 * 60 / 18, rtol=1e-12)
    np.testing.assert_allclose(s["S"].effort, 50.0 * 24 / 84, rtol=1e-12)
    report = mg.check(m)
    assert (report.mobility, report.redundancy) == (1, planets - 1)
    if planets == 1:
        # sun and ring push the planet with the same tangential force; its pin carries twice that, along the tangent
        tangential = 50.0 * 24 / 84 / 0.024
        pin = s["P0"].force[0]
        assert np.linalg.norm(pin) == pytest.approx(2 * tangential, rel=1e-11)
        np.testing.assert_allclose(s.coupling("sun0").force[0] + s.coupling("ring0").force[0] + pin, 0.0, atol=1e-10)
    else:
        assert not report.unique["sun0"]["effort"]
        shared = solved(m, engine=engine, redundant="minimum_norm")
        forces = [np.linalg.norm(shared.coupling(f"sun{i}").force, axis=1) for i in range(3)]
        np.testing.assert_allclose(
            forces, np.broadcast_to(50.0 * 24 / 84 / 0.024 / 3 / np.cos(np.deg2rad(20)), (3, 3)), rtol=1e-8
        )


def test_a_planet_may_be_named_before_the_ring():
    """The arm carries both: pairs between it and the ring turn about the axis of the ring, which may be gear a or gear b."""
    forces = []
    for planet_first in (False, True):
        gears = ("P", "G") if planet_first else ("G", "P")
        m = mg.Mechanism(
            "train",
            pairs=[
                mg.Pair("S", "R", "frame", "sun", point=(0, 0, 0), axis=(0, 0, 1)),
                mg.Pair("C", "R", "arm", "frame", point=(0, 0, 0.02), axis=(0, 0, -1)),
                mg.Pair("G", "R", "frame", "ring", point=(0, 0, 0.04), axis=(0, 0, 1)),
                mg.Pair("P", "R", "arm", "planet", point=(0.042, 0, 0), axis=(0, 0, 1)),
            ],
            couplings=[
                mg.SpurGears("inner", "S", "P", teeth=(24, 18), module=0.002),
                mg.SpurGears(
                    "outer", *gears, teeth=(18, 60) if planet_first else (60, 18), module=0.002, internal=True
                ),
            ],
            drives=["S", "G"],
            loads=[mg.Effort("C", -50.0)],
        )
        s = mg.solve(m, {"S": mg.Motion([0.0, 1.0], 3.0), "G": mg.Motion([0.0, 0.2], -1.0)})
        # Willis; C counts turns of the arm as positive
        np.testing.assert_allclose(s["C"].velocity[:, 0], (24 * 3.0 - 60 * 1.0) / 84, rtol=1e-12)
        np.testing.assert_allclose(s["G"].effort[:, 0], 50.0 * 60 / 84, rtol=1e-12)
        np.testing.assert_allclose(s["S"].effort[:, 0], 50.0 * 24 / 84, rtol=1e-12)
        forces.append(np.concatenate([s["P"].force[:, :2], s["G"].force[:, :2], s["C"].force[:, :2]], axis=1))
    np.testing.assert_allclose(*forces, rtol=1e-10, atol=1e-8)


def test_the_report_has_the_ratios():
    """Of a planetary train by Willis; of a rack behind a pinion in its own unit of length."""
    assert mg.check(planetary(3)).ratios["C.Rz"] == {"S.Rz": pytest.approx(24 / 84)}
    rack = mg.Mechanism(
        "rack",
        pairs=[
            mg.Pair("A", "R", "frame", "pinion", point=(0, 0, 0), axis=(0, 0, 1)),
            mg.Pair("B", "P", "frame", "rack", point=(0, -5.0, 0), axis=(1, 0, 0)),
        ],
        couplings=[mg.Rack("g", "A", "B", radius=3.0)],
    )
    assert mg.check(rack).ratios == {}
    assert mg.check(rack.replace(drives=["A"])).ratios == {"B.Tz": {"A.Rz": pytest.approx(3.0)}}
    assert mg.check(rack.replace(drives=["B"])).ratios == {"A.Rz": {"B.Tz": pytest.approx(1 / 3.0)}}
    assert "per A.Rz" in mg.check(rack.replace(drives=["A"])).text(full=True)


def test_bevel_differential():
    """Both axle shafts turn as their mean with the cage, and carry equal torques whatever their speeds."""
    pairs = [
        mg.Pair("C", "R", "frame", "cage", point=(0, 0, 0), axis=Z),
        mg.Pair("L", "R", "frame", "left", point=(0, 0, -0.1), axis=Z),
        mg.Pair("R", "R", "frame", "right", point=(0, 0, 0.1), axis=Z),
        mg.Pair("P", "R", "cage", "planet", point=(0.05, 0, 0), axis=(1, 0, 0)),
    ]
    gears = [
        mg.BevelGears("left gears", "L", "P", teeth=(20, 10), module=0.004),
        mg.BevelGears("right gears", "R", "P", teeth=(20, 10), module=0.004),
    ]
    m = mg.Mechanism("differential", pairs=pairs, drives=["C", "L"], couplings=gears, loads=[mg.Effort("R", -30.0)])
    t = np.linspace(0, 1, 5)
    s = mg.solve(m, {"C": mg.Motion(2 * t, 2.0), "L": mg.Motion(3 * t, 3.0)})
    np.testing.assert_allclose(s["R"].velocity[:, 0], 1.0, rtol=1e-13)
    np.testing.assert_allclose(s["L"].effort, -30.0, rtol=1e-12)
    np.testing.assert_allclose(s["C"].effort, 60.0, rtol=1e-12)
    assert s.checks.power.max() < 1e-12


# --- what holds for all --------------------------------------------------------------------------------------------------------


def anywhere(m, seed):
    """The same mechanism in another place of space."""
    rng = np.random.default_rng(seed)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
    return m.moved(pose), pose


MACHINES = {
    "spur": lambda: two(spur()),
    "other way round": lambda: two(spur(helix_angle=-0.2), swapped=(True, False)),
    "both": lambda: two(spur(internal=True, helix_angle=0.2), b=(0.1, 0, 0.02), swapped=(True, True)),
    "worm": lambda: two(mg.WormGear("g", "A", "B", teeth=(1, 30), radius=0.02), b=(0.1, 0, 0), axis=(0, 1, 0)),
    "rack": lambda: two(mg.Rack("g", "A", "B", radius=0.05), b=(0, -0.06, 0), axis=(1, 0, 0), second="P"),
    "belt": lambda: two(mg.Belt("g", "A", "B", radii=(0.1, 0.2), crossed=True), b=(0.6, 0, 0)),
    "bevel": lambda: two(
        mg.BevelGears("g", "A", "B", teeth=(20, 30), module=0.1, spiral_angle=0.4), b=(0.3, 0, 0.7), axis=(1, 0, 0.4)
    ),
    "planetary": planetary,
}  # fmt: skip


@pytest.mark.parametrize("name", MACHINES)
def test_contacts_in_any_place_by_any_method(name):
    """No work, no force on the links between, the same in any frame, the same by all methods, and printed as solved."""
    m = MACHINES[name]()
    s = solved(m)
    assert s.checks.power.max() < 1e-12
    assert s.checks.equilibrium.max() < 1e-12
    moved, pose = anywhere(m, 1)
    again = solved(moved)
    others = [solved(m, method=way) for way in ("newton_euler", "printed")]
    for c in m.couplings:
        np.testing.assert_allclose(again.coupling(c.name).force, s.coupling(c.name).force @ pose[:3, :3].T, atol=1e-9)
        point = s.coupling(c.name).point @ pose[:3, :3].T + pose[:3, 3]
        np.testing.assert_allclose(again.coupling(c.name).point, point, atol=1e-12)
        for other in others:
            np.testing.assert_allclose(other.coupling(c.name).force, s.coupling(c.name).force, rtol=1e-10, atol=1e-9)
    for p in m.pairs:
        for other in others:
            np.testing.assert_allclose(other[p.name].reaction, s[p.name].reaction, rtol=1e-9, atol=1e-9)
            np.testing.assert_allclose(other[p.name].total, s[p.name].total, rtol=1e-9, atol=1e-9)
    # every link is in equilibrium under what its pairs and gears exert
    for link in m.links[1:]:
        left = np.zeros((3, 6))
        for p in m.pairs:
            sign = (p.b == link.name) - (p.a == link.name)
            left = left + sign * s[p.name].total
        for c in m.couplings:
            first, last = c.steps[0], c.steps[-1]
            for step, side, sign in ((first, -first.sense, -1), (last, last.sense, 1)):
                pair = m.pairs[step.pair]
                if (pair.b if side > 0 else pair.a) == link.name:
                    F, P = s.coupling(c.name).force, s.coupling(c.name).point
                    left = left + sign * np.concatenate([np.cross(P, F), F], axis=1)
        np.testing.assert_allclose(left, 0.0, atol=1e-9)
    f = mg.formulate(m)
    found = dict(zip([u.name for u in f.unknowns], f.solve(s.state(1)), strict=True))
    for c in m.couplings:
        assert found[f"M_C({c.name})"] == pytest.approx(s.coupling(c.name).effort[1], rel=1e-9)


@pytest.mark.daily(4)
@pytest.mark.parametrize("name", MACHINES)
def test_contacts_in_files_units_and_motion(name, tmp_path):
    m = MACHINES[name]().replace(units={"length": "m", "mass": "kg", "time": "s"})
    mg.save(m, tmp_path / "gears.toml")
    again = mg.load(tmp_path / "gears.toml")
    assert again == m
    assert [c.terms for c in again.couplings] == [c.terms for c in m.couplings]
    s, small = solved(m), solved(m.to_units(length="mm"))
    for c in m.couplings:
        np.testing.assert_allclose(small.coupling(c.name).force, 1e3 * s.coupling(c.name).force, rtol=1e-9, atol=1e-7)
        np.testing.assert_allclose(small.coupling(c.name).point, 1e3 * s.coupling(c.name).point, rtol=1e-9, atol=1e-9)


def test_geared_rotors_swing_as_one():
    """Under a torsion spring two wheels geared 1 : 2 have the inertia I_a + I_b / 4."""
    wheels = (("one", (0, 0, 0), 2.0), ("two", (0.3, 0, 0), 5.0))
    links = [mg.Link("frame"), *(mg.Link(n, mass=1, center=c, inertia=i * np.eye(3)) for n, c, i in wheels)]
    m = two(spur()).replace(links=links, drives=[], loads=[mg.TorsionSpring("A", stiffness=4.0)])
    assert mg.linearize(m).frequencies == pytest.approx([np.sqrt(4.0 / (2.0 + 5.0 / 4))], rel=1e-9)
    r = mg.respond(m, (0, 5), start={"A": 0.3})
    np.testing.assert_allclose(r["A"].position[:, 0], 0.3 * np.cos(np.sqrt(4 / 3.25) * r.t), atol=1e-6)
    # the contact turns gear b
    np.testing.assert_allclose(
        np.abs(r.coupling("g").force[:, 1] * 0.2), np.abs(5.0 * r["B"].acceleration[:, 0]), rtol=1e-9, atol=1e-12
    )


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: two(spur(module=0.02)), "0.3 apart; 20 and 40 teeth of module 0.02 mesh at 0.6 .at 0.3 with module 0.01"),
        (lambda: two(spur(), axis=(0, 1, 0)), "axes are not parallel"),
        (lambda: two(spur(teeth=(20, 0))), "teeth = .20.0, 0.0.: expected two whole numbers above 0"),
        (lambda: two(spur(teeth=(20.5, 40))), "teeth = .20.5, 40.0.: expected two whole numbers above 0"),
        (lambda: two(spur(teeth=(20, 40, 60))), "expected two whole numbers above 0"),
        (lambda: two(spur(module=0.0)), "module = 0.0: expected a finite number above 0"),
        (lambda: two(mg.Rack("g", "A", "B", radius=-0.05), second="P"), "radius = -0.05: expected a finite number above 0"),
        (lambda: two(mg.Belt("g", "A", "B", radii=(0.1, 0.0))), "radii = .0.1, 0.0.: expected two finite numbers above 0"),
        (lambda: two(spur(teeth=(20, 20), internal=True)), "different numbers of an internal pair"),
        (lambda: two(spur(), b=(0, 0, 0.1)), "same axis"),
        (lambda: two(mg.SpurGears("g", "A", "Q", teeth=(1, 2))), "unknown freedom 'Q'"),
        (lambda: two(mg.SpurGears("g", "A", "A", teeth=(1, 2))), "the same freedom"),
        (lambda: two(spur(), second="P"), "b = 'B': is a pair P; expected one whose only freedom is a turn"),
        (lambda: two(mg.BevelGears("g", "A", "B", teeth=(1, 2), module=0.1), b=(0.3, 0.1, 0), axis=(1, 0, 0)), "pass each other at 0.1"),
        (lambda: two(mg.BevelGears("g", "A", "B", teeth=(1, 2), module=0.1), b=(1, 0, 0), axis=(1, 0, 0)), "point of 'A' is where"),
        (lambda: two(mg.WormGear("g", "A", "B", teeth=(1, 30), radius=0.2), b=(0.1, 0, 0), axis=(0, 1, 0)), "more than the radius"),
        (lambda: two(mg.Belt("g", "A", "B", radii=(0.2, 0.2), crossed=True)), "expected more than 0.4"),
        (lambda: two(mg.Belt("g", "A", "B", radii=(0.2, 0.15))), "0.3 apart, and the pulleys overlap; expected more than 0.35"),
        (lambda: two(mg.Rack("g", "A", "B", radius=0.05), b=(0.1, 0, 0), axis=(1, 0, 0), second="P"), "level with the pinion's axis"),
    ],
)  # fmt: skip
def test_gears_that_cannot_mesh_are_named(make, words):
    with pytest.raises(mg.DeclarationError, match=words):
        make()


@pytest.mark.parametrize("kind", ["spur", "bevel", "worm", "rack", "belt"])
def test_numbers_that_decide_are_never_assumed(kind, tmp_path):
    made = {"spur": mg.SpurGears, "bevel": mg.BevelGears, "worm": mg.WormGear, "rack": mg.Rack, "belt": mg.Belt}[kind]
    with pytest.raises(mg.DeclarationError, match=r"missing .* required"):
        made("g", "A", "B")
    file = tmp_path / "gears.toml"
    mg.save(two(spur()), file)
    lines = file.read_text().replace('kind = "spur"', f'kind = "{kind}"').splitlines()
    start = next(i for i, line in enumerate(lines) if line.startswith("teeth"))
    end = next(i for i in range(start, len(lines)) if lines[i].endswith("]"))
    file.write_text("\n".join(lines[:start] + lines[end + 1 :]))
    with pytest.raises(mg.FileError, match=r"fields? (teeth, )?(module|radius|radii|teeth) missing"):
        mg.load(file)


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda: mg.SpurGears("g", "A", "B", (20, 40), pressure_angle=20), "pressure_angle"),
        (lambda: mg.Rack("g", "A", "B", 0.02, 20.0), "pressure_angle"),
        (lambda: mg.WormGear("g", "A", "B", (2, 40), 0.01, 20), "pressure_angle"),
        (lambda: mg.BevelGears("g", "A", "B", (20, 40), 0.002, spiral_angle=35), "spiral_angle"),
        (lambda: mg.Gear("g", "p", 20, (0, 0, 0), (0, 0, 1), module=0.002, helix_angle=15), "helix_angle"),
        (lambda: mg.BevelGear("g", "p", 20, (0, 0, 1), (0, 0, 1), module=0.002, cone=45), "cone"),
        (lambda: mg.Friction("A", mu=0.1, radius=0.01, flank=30), "flank"),
    ],
)
def test_degrees_in_place_of_radians_are_a_fault_that_says_the_radians(make, name):
    pairs = [mg.Pair(k, "R", "frame", k, point=(x, 0, 0), axis=(0, 0, 1)) for k, x in (("A", 0), ("B", 0.06))]
    one = make()
    room = {"Gear": "gears", "BevelGear": "gears", "Friction": "loads"}.get(type(one).__name__, "couplings")
    degrees = getattr(one, name)
    with pytest.raises(
        mg.DeclarationError, match=rf"{name} = .* rad \({degrees:g} degrees are {np.deg2rad(degrees):.7g} rad\)"
    ):
        mg.Mechanism("degrees", pairs=pairs, **{room: [one]})


def test_rounded_places_fit_within_the_tolerance_of_the_mechanism():
    """A distance written as 0.3333 for a third: said where nothing says how the numbers are meant, fit where tol does."""
    gears, b = spur(module=1 / 90), (0.3333, 0.0, 0.0)
    with pytest.raises(
        mg.DeclarationError, match=r"0\.3333 apart; 20 and 40 teeth of module 0\.0111111 mesh at 0\.3333333"
    ):
        two(gears, b=b)
    s = solved(two(gears, b=b, tol=1e-4))
    np.testing.assert_allclose(s["B"].velocity[:, 0], -1.0, rtol=1e-13)


def test_gears_without_a_common_carrier_are_named():
    pairs = [
        mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "R", "arm", "one", point=(1, 0, 0), axis=Z),
        mg.Pair("C", "R", "one", "two", point=(2, 0, 0), axis=Z),
        mg.Pair("D", "P", "two", "three", point=(2, 0, 0), axis=Z),
        mg.Pair("E", "R", "three", "four", point=(3, 0, 0), axis=Z),
    ]
    with pytest.raises(mg.DeclarationError, match="pair 'B' between the gears is not about the axis of 'A'"):
        mg.Mechanism("chain", pairs=pairs, couplings=[mg.SpurGears("g", "A", "C", teeth=(1, 2))])
    with pytest.raises(mg.DeclarationError, match="no link in common"):
        mg.Mechanism("chain", pairs=pairs, couplings=[mg.SpurGears("g", "C", "E", teeth=(1, 2))])


@pytest.mark.parametrize("name", MACHINES)
def test_links_cut_free_feel_the_teeth(name):
    s = solved(MACHINES[name]())
    for link in s.mechanism.links[1:]:
        assert mg.free_body(s, link.name).balance < 1e-10


def test_gears_roll_and_worms_slide():
    """Spur gears do not slide at the pitch point; a worm slides along its thread with ``w r / cos(lead angle)``."""
    assert np.abs(solved(two(spur())).coupling("g").sliding).max() < 1e-14
    worm = mg.WormGear("g", "A", "B", teeth=(2, 40), radius=0.02)
    s = solved(two(worm, b=(0.1, 0, 0), axis=(0, 1, 0)))
    lead = np.arctan(2 * 0.08 / (40 * 0.02))
    c = s.coupling("g")
    np.testing.assert_allclose(np.linalg.norm(c.sliding, axis=-1), 2.0 * 0.02 / np.cos(lead), rtol=1e-12)
    np.testing.assert_allclose((c.force * c.sliding).sum(axis=-1), 0.0, atol=1e-12)
    columns = s.columns(["contacts"])
    np.testing.assert_allclose(columns["g force"], np.linalg.norm(c.force, axis=-1))
    np.testing.assert_allclose(columns["g sliding speed"], 2.0 * 0.02 / np.cos(lead), rtol=1e-12)


def test_a_gear_has_one_module():
    """A ring of 61 teeth about sun 24 and planet 18: each pair of gears would fit with a module of its own, the planet with neither."""

    def train(ring, **more):
        r = 0.002 * (24 + 18) / 2
        pairs = [
            mg.Pair("S", "R", "frame", "sun", point=(0, 0, 0), axis=Z),
            mg.Pair("C", "R", "frame", "arm", point=(0, 0, 0), axis=Z),
            mg.Pair("P", "R", "arm", "planet", point=(r, 0, 0), axis=Z),
        ]
        inner = mg.SpurGears("inner", "S", "P", teeth=(24, 18), **more)
        outer = mg.SpurGears(
            "outer", "C", "P", teeth=(ring, 18), internal=True, **({"module": 0.042 / 21.5} if more else {})
        )
        return mg.Mechanism("train", pairs=pairs, couplings=[inner, outer], drives=["S"])

    assert train(60).couplings
    said = "the 18 teeth on 'P' would have the module 0.002 in one and 0.001953488 in the other"
    with pytest.raises(mg.DeclarationError, match=said):
        train(61)
    assert train(61, module=0.002).couplings  # two rims, as is said


@pytest.mark.parametrize("module", [None, 0.002])
def test_a_gear_has_one_hand(module):
    """Sun and planet have opposite hands, planet and ring the same: by hand the axial forces tilt the planet, and cancel in sum."""
    beta = 0.3
    r, rp = 0.021 / np.cos(beta), 0.018 / np.cos(beta)

    def train(hand):
        pairs = [
            mg.Pair("S", "R", "frame", "sun", point=(0, 0, 0), axis=Z),
            mg.Pair("C", "R", "frame", "arm", point=(0, 0, 0), axis=Z),
            mg.Pair("P", "R", "arm", "planet", point=(2 * r, 0, 0), axis=Z),
        ]
        inner = mg.SpurGears("inner", "S", "P", teeth=(24, 18), helix_angle=beta, module=module)
        outer = mg.SpurGears("outer", "P", "C", teeth=(18, 60), internal=True, helix_angle=hand, module=module)
        return mg.Mechanism("train", pairs=pairs, couplings=[inner, outer], drives=["S"], loads=[mg.Effort("C", -7.0)])

    s = mg.solve(train(-beta), {"S": 0.0})
    across = 2.0 / (0.024 / np.cos(beta))  # 7 N m on the arm are 2 on the sun
    np.testing.assert_allclose(s["P"].force, [0, -2 * across, 0], atol=1e-9)
    np.testing.assert_allclose(s["P"].moment, [0, 2 * across * np.tan(beta) * rp, 0], atol=1e-9)
    if module is not None:  # two rims
        assert train(beta).couplings
        return
    with pytest.raises(
        mg.DeclarationError, match=r"the 18 teeth on 'P' would have the helix angle -0\.3 in one and 0\.3 in"
    ):
        train(beta)


# --- declaring many gears ------------------------------------------------------------------------------------------------------


def calls_of(work):
    """How many functions ``work`` calls."""
    count = 0

    def note(frame, event, arg):
        nonlocal count
        count += event in ("call", "c_call")

    sys.setprofile(note)
    try:
        work()
    finally:
        sys.setprofile(None)
    return count


@pytest.mark.parametrize("sun", [False, True])
def test_declaring_a_train_takes_time_in_proportion_to_its_gears(sun):
    """Twice as many gears, without module=, take twice as many calls; another load or source does not check each against all again."""

    def train(n):
        places = [(3.0 * i, 0, 0) for i in range(n)]
        if sun:
            places[1:] = [(3 * np.cos(a), 3 * np.sin(a), 0) for a in 2 * np.pi * np.arange(1, n) / n]
        pairs = [mg.Pair(f"R{i}", "R", "frame", f"gear{i}", point=p, axis=Z) for i, p in enumerate(places)]
        meshes = [mg.SpurGears(f"m{i}", f"R{0 if sun else i}", f"R{i + 1}", teeth=(20, 20)) for i in range(n - 1)]
        return lambda: mg.Mechanism("train", pairs=pairs, couplings=meshes, drives=["R0"])

    def counts(n):
        m = train(n)()
        loads = [mg.Effort("R1", 1.0)]
        return np.array(
            [calls_of(f) for f in (train(n), lambda: m.replace(source="x"), lambda: m.replace(loads=loads))]
        )

    counts(3)
    few, many = counts(12), counts(24)
    assert (many < 2.2 * few).all()


def test_a_wrong_pair_beside_gears_is_named():
    pairs = [
        mg.Pair("A", "R", "frame", "one", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "R", "two", "three", point=(1, 0, 0), axis=Z),
        mg.Pair("C", "ZZ", "frame", "two"),
        mg.Pair("D", "R", "frame", [3], point=(0, 0, 0), axis=Z),
    ]
    with pytest.raises(mg.DeclarationError, match=r"unknown type 'ZZ'(.|\n)*b = \[3\](.|\n)*no link in common"):
        mg.Mechanism("x", pairs=pairs, couplings=[mg.SpurGears("g", "A", "B", teeth=(20, 20))])


@pytest.mark.parametrize("ratio", [0.01, 0.05, 20.0, 300.0])
def test_far_ratios_are_solved_by_every_engine(ratio: float) -> None:
    """Relations without loops, their coefficients far apart: the kernel had no numbers for some positions, and called them solved."""
    pins = [mg.Pair(k, "R", "frame", k.lower(), point=(x, 0, 0), axis=(0, 0, 1)) for k, x in (("A", 0.0), ("B", 0.05))]
    m = mg.Mechanism(
        "ratio", pairs=pins, couplings=[mg.Coupling({"A": ratio, "B": 1.0})], drives=["A"], loads=[mg.Effort("B", 2.0)]
    )
    angle = np.linspace(0, 3, 9)
    for engine in ("dense", "sparse", "compiled"):
        s = mg.solve(m, {"A": angle}, engine=engine)
        assert np.allclose(s["B"].position[:, 0], -ratio * angle, rtol=1e-12)
        assert np.allclose(s["A"].effort, 2.0 * ratio, rtol=1e-10)
