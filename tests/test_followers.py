"""Cams and their followers, pins in slots, curves in contact: limits that are linkages and gears."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import mechgraph as mg

Z, I3 = (0, 0, 1), np.diag([0.1, 0.2, 0.3])
TURN = mg.Motion(np.linspace(0, 6, 13), 3.0, 2.0)
CENTER = np.array([0.3, 0, 0])
CIRCLE = mg.Curve.circle(radius=1.0, center=CENTER)


def driven_cam(*pairs, point, more=()):
    """A cam that turns about the origin and what follows it, the last link loaded."""
    links = [
        mg.Link("frame"),
        mg.Link("cam", mass=2.0, center=CENTER, inertia=I3),
        mg.Link("follower", mass=1.0, center=point, inertia=I3),
    ]
    loads = [mg.Wrench("follower", force=(0, -5, 0), point=point)]
    pairs = [mg.Pair("A", "R", "frame", "cam", point=(0, 0, 0), axis=Z), *pairs]
    return mg.Mechanism("cam", [*links, *map(mg.Link, more)], pairs, ["A"], loads)


def assert_same_plane_forces(one, other, given, pairs):
    """Motion of cam and follower, forces in the plane, moments about its normal, the drive; nothing along the tangent."""
    a, b = mg.solve(one, given), mg.solve(other, given)
    assert a.checks.power.max() < 1e-12
    for link in (link.name for link in one.links[1:]):
        for name in ("pose", "twist", "acceleration"):
            assert_allclose(getattr(a.link(link), name), getattr(b.link(link), name), atol=1e-10)
    size = np.abs(b["A"].effort).max()
    assert_allclose(a["A"].effort, b["A"].effort, atol=1e-10 * size)
    for mine, theirs in pairs.items():
        x, y = a[mine].reaction[:, [2, 3, 4]], b[theirs].reaction[:, [2, 3, 4]]
        assert_allclose(x, y, atol=1e-10 * np.abs(y).max())
    return a


ROLLER = 0.25


@pytest.mark.parametrize("swings", [False, True])
def test_an_eccentric_with_a_roller_is_a_slider_crank_or_a_four_bar(swings):
    """The center of the roller keeps its distance, radius plus radius, from that of the circle."""
    at = np.array([0.1, np.sqrt((1 + ROLLER) ** 2 - 0.2**2), 0])
    bearing = (
        mg.Pair("F", "R", "frame", "follower", point=(1.5, 1.0, 0), axis=Z)
        if swings
        else mg.Pair("F", "P", "frame", "follower", point=at, axis=(0, 1, 0))
    )
    cam = driven_cam(bearing, mg.Pair("K", "Ps", "cam", "follower", curve=CIRCLE, roller=ROLLER, point=at), point=at)
    rod = [
        mg.Pair("D", "R", "cam", "rod", point=CENTER, axis=Z),
        mg.Pair("E", "R", "rod", "follower", point=at, axis=Z),
    ]
    s = assert_same_plane_forces(
        cam, driven_cam(bearing, *rod, point=at, more=["rod"]), {"A": TURN}, {"A": "A", "F": "F", "K": "E"}
    )
    normal = s.link("cam").point(CENTER)[0] - s.link("follower").point(at)[0]
    force = s["K"].force
    assert np.abs(force[:, 0] * normal[:, 1] - force[:, 1] * normal[:, 0]).max() < 1e-11 * np.abs(force[:, :2]).max()
    assert_allclose(np.abs(s["K"].components["Fy"]), np.linalg.norm(force[:, :2], axis=1), rtol=1e-10)


def test_a_flat_face_on_an_eccentric_is_a_scotch_yoke():
    at = CENTER + np.array([0, 1.0, 0])
    bearing = mg.Pair("F", "P", "frame", "follower", point=at, axis=(0, 1, 0))
    flat = driven_cam(bearing, mg.Pair("K", "Kc", "cam", "follower", curve=CIRCLE, point=at), point=at)
    block = [
        mg.Pair("D", "R", "cam", "block", point=CENTER, axis=Z),
        mg.Pair("E", "P", "block", "follower", point=CENTER, axis=(1, 0, 0)),
    ]
    s = assert_same_plane_forces(
        flat, driven_cam(bearing, *block, point=at, more=["block"]), {"A": TURN}, {"A": "A", "K": "E"}
    )
    assert_allclose(s["F"].position[:, 0], 0.3 * np.sin(TURN.position), atol=1e-12)
    assert np.abs(s["K"].force[:, 0]).max() < 1e-11


def involutes(share):
    """Two spur gears of 20 and 30 teeth that touch at a ``share`` of the line of action, as flanks and as a coupling."""
    teeth, module, pressure = (20, 30), 0.1, np.deg2rad(20)
    pitch = [module * z / 2 for z in teeth]
    radius = [p * np.cos(pressure) for p in pitch]
    other = np.array([sum(pitch), 0, 0])
    way = sum(pitch) * np.sin(pressure)
    along, turn = (
        np.array([np.sin(pressure), -np.cos(pressure), 0]),
        [share * way / radius[0], (1 - share) * way / radius[1]],
    )
    at = radius[0] * np.array([np.cos(pressure), np.sin(pressure), 0]) + share * way * along
    angle = [pressure - turn[0], pressure + np.pi - turn[1]]
    flanks = [
        mg.Curve.involute(radius=r, angles=(0.05, 1.2), center=c, second=(np.cos(a), np.sin(a), 0))
        for r, c, a in zip(radius, ((0, 0, 0), other), angle, strict=True)
    ]
    links = [
        mg.Link("frame"),
        mg.Link("g1", mass=1.0, center=(0.1, 0, 0), inertia=I3),
        mg.Link("g2", mass=3.0, center=other, inertia=I3),
    ]
    pairs = [
        mg.Pair("A", "R", "frame", "g1", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "R", "frame", "g2", point=other, axis=Z),
    ]
    contact = mg.Pair("K", "Kc", "g1", "g2", curve=flanks[0], curve_b=flanks[1], point=at)
    loads, gears = (
        [mg.Effort("B", -7.0)],
        [mg.SpurGears("g", "A", "B", teeth=teeth, module=module, pressure_angle=pressure)],
    )
    return mg.Mechanism("flanks", links, [*pairs, contact], ["A"], loads), mg.Mechanism(
        "gears", links, pairs, ["A"], loads, couplings=gears
    )


def test_involute_flanks_in_contact_are_gears():
    """Ratio, and the force along the line of action, wherever on it the flanks touch."""
    flanks, gears = involutes(0.45)
    given = {"A": mg.Motion(np.linspace(0, 0.1, 6), 3.0, 2.0)}
    s = assert_same_plane_forces(flanks, gears, given, {"A": "A", "B": "B"})
    force = s["K"].force[:, :2]
    pressure = np.deg2rad(20)
    assert np.abs(force @ [np.cos(pressure), np.sin(pressure)]).max() < 1e-11 * np.abs(force).max()


def test_flanks_that_cross_are_refused():
    flanks, _ = involutes(0.45)
    pair = flanks.pairs[-1]
    tilted = pair.curve_b.replace(second=(np.cos(3.0), np.sin(3.0), 0))
    with pytest.raises(mg.DeclarationError, match=r"point: is \S+ off its curve_b"):
        flanks.replace(pairs=[*flanks.pairs[:-1], pair.replace(curve_b=tilted)])
    crossing = mg.Curve.line(point=pair.point, direction=(1, 0, 0))
    with pytest.raises(mg.DeclarationError, match="crosses the curve at"):
        flanks.replace(pairs=[*flanks.pairs[:-1], pair.replace(curve_b=crossing)])


ANGLE = np.linspace(0, 2 * np.pi, 361)


def law():
    """Rise by a polynomial, dwell, cycloidal return."""
    up = mg.Motion.law("poly345", 0.4, 2.0, ANGLE)
    down = mg.Motion.law("cycloidal", -0.4, 2.5, ANGLE - 3.0)
    return mg.Motion(
        up.position + down.position, up.velocity + down.velocity, up.acceleration + down.acceleration, t=ANGLE
    )


@pytest.mark.parametrize("follower", ["roller", "flat"])
def test_a_cam_of_a_law_lifts_by_it(follower):
    """The cam turns at the rate 3: the follower has the law's lift, slope times 3, and bend times 9, at angles between those given too."""
    shape = {"follower": "flat"} if follower == "flat" else {"roller_radius": 0.2, "offset": 0.15}
    curve = mg.Curve.cam.of(law(), 0.9, second=(0, 1, 0), **shape)
    at = curve.at(np.array(0.0))[0]
    kind = "Kc" if follower == "flat" else "Ps"
    m = driven_cam(
        mg.Pair("F", "P", "frame", "follower", point=at, axis=(0, 1, 0)),
        mg.Pair("K", kind, "cam", "follower", curve=curve, point=at, closed="form"),
        point=at,
    )
    given, fine = ANGLE[::10], law()
    s = mg.solve(m, {"A": mg.Motion(given, 3.0, 0.0)})
    for found, expected, tolerance in (
        (s["F"].position, fine.position, 1e-11),
        (s["F"].velocity, 3 * fine.velocity, 1e-10),
        (s["F"].acceleration, 9 * fine.acceleration, 1e-8),
    ):
        assert_allclose(found[:, 0], expected[::10], atol=tolerance)
    assert s.checks.power.max() < 1e-12
    between = mg.solve(m, {"A": ANGLE[:-1] + 0.5 * np.diff(ANGLE)})["F"].position[:, 0]
    half = mg.Motion.law("poly345", 0.4, 2.0, ANGLE[:100] + 0.5 * ANGLE[1])
    assert_allclose(between[:100], half.position, atol=1e-9)


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_cam_of_a_law_swings_an_arm_by_it(mirrored):
    """The arm has the law's swing, slope times 3 and bend times 9; the lengths of the triangle are those declared."""
    law_ = law()
    curve = mg.Curve.arm_cam.of(law_, 0.9, roller_radius=0.2, arm=1.4, pivot=1.6, second=(1, 0, 0), mirrored=mirrored)
    pivot, at = np.array([1.6, 0, 0]), curve.at(np.array(0.0))[0]
    assert np.linalg.norm(at) == pytest.approx(1.1, rel=1e-14)
    assert np.linalg.norm(at - pivot) == pytest.approx(1.4, rel=1e-14)
    assert (at[1] < 0) == mirrored
    m = driven_cam(
        mg.Pair("F", "R", "frame", "follower", point=pivot, axis=Z),
        mg.Pair("K", "Ps", "cam", "follower", curve=curve, point=at, closed="form"),
        point=at,
    )
    s = mg.solve(m, {"A": mg.Motion(ANGLE[::10], 3.0, 0.0)})
    sense = 1.0 if mirrored else -1.0
    for found, expected, tolerance in (
        (s["F"].position, law_.position, 1e-11),
        (s["F"].velocity, 3 * law_.velocity, 1e-10),
        (s["F"].acceleration, 9 * law_.acceleration, 1e-8),
    ):
        assert_allclose(found[:, 0], sense * expected[::10], atol=tolerance)
    assert s.checks.power.max() < 1e-12
    # by virtual work: the load acts at the center of the roller
    arm = s.link("follower").point(at)[0] - pivot
    power = s["A"].effort[:, 0] * 3.0 - 5.0 * arm[:, 0] * s["F"].velocity[:, 0]
    turning = 0.3 + 1.0 * 1.4**2  # the arm about its pivot, its mass at the roller; the cam turns at a constant rate
    expected = turning * s["F"].acceleration[:, 0] * s["F"].velocity[:, 0]
    assert_allclose(power, expected, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("arm", "radius", "times", "words"),
    [
        (0.4, 0.2, 1, r"arm = 0\.4: does not reach the base circle; give one between 0\.5 and 2\.7"),
        (1.4, 0.2, 8, r"swing: runs from 0 to 3\.2; the arm would pass the line through axis and pivot at -0\.73"),
        (1.4, 1.099, 1, r"undercut: the roller of radius 1\.099 is larger than the radius of curvature"),
    ],
)
def test_an_arm_that_does_not_fit_its_cam_is_refused(arm, radius, times, words):
    motion = mg.Motion(*(times * getattr(law(), name) for name in ("position", "velocity", "acceleration")), t=ANGLE)
    curve = mg.Curve.arm_cam.of(motion, 1.1 - radius, roller_radius=radius, pivot=1.6, arm=arm)
    with pytest.raises(mg.DeclarationError, match=words):
        mg.Mechanism("m", None, [mg.Pair("K", "Ps", "a", "b", curve=curve)])


def test_jumps_of_a_jerk_take_no_more_nodes_than_a_circle():
    """Where the pieces of a law meet no step is halved time after time: no other branch of the motion is near."""
    lobe = mg.Curve.cam.of(law(), 0.9, second=(0, 1, 0), roller_radius=0.2, offset=0.15)
    nodes = []
    for curve, top in ((lobe, lobe.at(np.array(0.0))[0]), (CIRCLE, np.array([0.1, np.sqrt(1 - 0.2**2), 0]))):
        slide = mg.Pair("F", "P", "frame", "follower", point=top, axis=(0, 1, 0))
        m = driven_cam(slide, mg.Pair("K", "Ps", "cam", "follower", curve=curve, point=top), point=top)
        nodes.append(mg.kinematics(m, {"A": np.linspace(0, 6.2, 40)}).work.nodes)
    assert nodes[0] < 1.5 * nodes[1]


def test_a_roller_larger_than_the_radius_of_curvature_is_refused():
    hollow = mg.Curve.ellipse(a=1.0, b=0.3)
    pair = mg.Pair("K", "Ps", "a", "b", curve=hollow, roller=0.2, point=(0.75, 0, 0))
    with pytest.raises(
        mg.DeclarationError, match=r"the roller of radius 0\.2 is larger than the radius of curvature 0\.09 at \(1, "
    ):
        mg.Mechanism("m", None, [pair])
    outside = mg.Mechanism("m", None, [pair.replace(point=(1.2, 0, 0))])
    assert outside.pairs[0].point == pytest.approx((1.2, 0, 0))


def test_a_slot_must_be_plane_and_a_contact_needs_a_curve():
    helix = mg.Curve.helix(radius=1.0, pitch=0.2)
    with pytest.raises(mg.DeclarationError, match="is not planar; a planar curve is required by pair Ps"):
        mg.Mechanism("m", None, [mg.Pair("K", "Ps", "a", "b", curve=helix)])
    with pytest.raises(mg.DeclarationError, match="type Kc needs a curve"):
        mg.Mechanism("m", None, [mg.Pair("K", "Kc", "a", "b", point=(0, 0, 0), axis=(0, 0, 1))])
    assert (
        mg.check(mg.Mechanism("m", None, [mg.Pair("K", "Kc", "a", "b"), mg.Pair("A", "R", "a", "b")])).mobility_by_count
        == -3
    )


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1e-17, 1, 0)])
@pytest.mark.parametrize("turn", [0.0, 0.3, np.pi / 2])
def test_a_straight_slot_has_the_plane_that_its_axis_asks_for(direction, turn):
    """A straight curve lies in many planes; the pin's axis is the one given, and the slot's normal follows."""
    t = np.array(direction, dtype=float) / np.linalg.norm(direction)
    n = np.cross(t, np.eye(3)[np.argmin(np.abs(t))])
    n /= np.linalg.norm(n)
    axis = np.cos(turn) * n + np.sin(turn) * np.cross(t, n)
    pair = mg.Pair("K", "Ps", "frame", "pin", curve=mg.Curve.line(direction=direction), point=(0, 0, 0), axis=axis)
    assert_allclose(pair.axis, axis, atol=1e-11)
    assert not pair.faults()
    assert pair.replace() == pair
    assert pair.replace(point=None, axis=None, on_a=pair.markers[0], on_b=pair.markers[1]).type == pair.type


# --- many turns ------------------------------------------------------------------------------------------------------


def lifted():
    """A cam of a law with its roller."""
    lobe = mg.Curve.cam.of(law(), 0.9, second=(0, 1, 0), roller_radius=0.2, offset=0.15)
    top = lobe.at(np.array(0.0))[0]
    return driven_cam(
        mg.Pair("F", "P", "frame", "follower", point=top, axis=(0, 1, 0)),
        mg.Pair("K", "Ps", "cam", "follower", curve=lobe, point=top, closed="form"),
        point=top,
    )


@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_a_closed_curve_comes_back_after_every_round(engine):
    """Positions of fifty turns are those of the first, the place on the curve its length further each turn; one turn is followed."""
    m, one = (
        lifted(),
        0.05 + np.linspace(0, 2 * np.pi, 13)[:-1],
    )  # off the samples, at which the roller's acceleration jumps
    every = (one + 2 * np.pi * np.arange(50)[:, None]).ravel()
    first = mg.solve(m, {"A": mg.Motion(one, 3.0, 2.0)}, engine=engine)
    s = mg.solve(m, {"A": mg.Motion(every, 3.0, 2.0)}, engine=engine)
    assert s.work.nodes < 4 * first.work.nodes
    for name in ("F", "K"):
        for what in ("velocity", "acceleration", "reaction"):
            x, y = (
                getattr(of[name], what)[:, 2:5] if what == "reaction" else getattr(of[name], what) for of in (s, first)
            )
            x = x.reshape(50, *y.shape)
            assert_allclose(x, np.broadcast_to(y, x.shape), atol=1e-9 * np.abs(y).max())
    length = m.pair("K").type.steps[0].travel.length
    rounds = s["K"].position[:, 0].reshape(50, 12) - first["K"].position[:, 0]
    assert_allclose(
        rounds, np.sign(rounds[1, 0]) * length * np.arange(50)[:, None] * np.ones(12), atol=1e-9 * 50 * length
    )


def test_a_driven_place_on_a_closed_curve_comes_back():
    """A block carried round and round a track by its arc length."""
    track = mg.Curve.ellipse(a=2.0, b=1.0)
    block = mg.Link("block", 2.0, (2.1, 0, 0), np.diag([0.1, 0.2, 0.3]))
    m = mg.Mechanism(
        "track", [mg.Link("frame"), block], [mg.Pair("K", "P", "frame", "block", curve=track, point=(2, 0, 0))], ["K"]
    )
    length = m.pair("K").type.steps[0].travel.length
    part = length * np.linspace(0, 1, 7)[:-1]
    s = mg.solve(m, {"K": mg.Motion((part + length * np.arange(30)[:, None]).ravel(), 1.0)})
    x = s.link("block").center.reshape(30, 6, 3)
    assert_allclose(x, np.broadcast_to(x[0], x.shape), atol=1e-10)


def test_a_response_round_a_closed_curve_is_tabulated_once():
    """A cam turned by a constant torque against a damper goes round and round; energy is balanced and the lift is the law's."""
    m = lifted().replace(
        drives=[], loads=[mg.Effort("A", 20.0), mg.Damper("A", coefficient=4.0), mg.Gravity((0, -9.81, 0))]
    )
    r = mg.respond(m, np.linspace(0, 12.0, 25), rates={"A": 5.0}, rtol=1e-9)
    angle = r["A"].position[:, 0]
    assert angle[-1] > 8 * np.pi
    lift = mg.kinematics(lifted(), {"A": angle % (2 * np.pi)})["F"].position
    assert_allclose(r["F"].position, lift, atol=1e-8)
    e = r.energy
    assert_allclose(
        e.kinetic + e.potential - e.work, (e.kinetic + e.potential - e.work)[0], atol=1e-5 * np.abs(e.work).max()
    )


def test_two_cams_in_contact_by_their_closed_form():
    """Two eccentric discs that touch: their centers keep their distance, so that they move as a four-bar; forces along the centers."""
    pivot, ra, rb = np.array([1.6, 0.8, 0]), 0.9, 0.7
    ca = np.array([0.2, 0.1, 0])
    along = 0.1
    cb = ca + (ra + rb) * np.array([np.cos(along), np.sin(along), 0])
    at = ca + ra * (cb - ca) / (ra + rb)
    bearing = mg.Pair("F", "R", "frame", "follower", point=pivot, axis=Z)
    discs = mg.Pair(
        "K", "Kc", "cam", "follower", point=at, closed="form",
        curve=mg.Curve.circle(radius=ra, center=ca), curve_b=mg.Curve.circle(radius=rb, center=cb),
    )  # fmt: skip
    rod = [
        mg.Pair("D", "R", "cam", "rod", point=ca, axis=Z),
        mg.Pair("E", "R", "rod", "follower", point=cb, axis=Z),
    ]
    turn = {"A": mg.Motion(np.linspace(0, 1.0, 9), 3.0, 2.0)}
    s = assert_same_plane_forces(
        driven_cam(bearing, discs, point=cb),
        driven_cam(bearing, *rod, point=cb, more=["rod"]),
        turn,
        {"A": "A", "F": "F"},
    )
    way = s.link("follower").point(cb)[0] - s.link("cam").point(ca)[0]
    assert_allclose(np.linalg.norm(way, axis=1), ra + rb, rtol=1e-12)
    force = s["K"].force
    assert np.abs(force[:, 0] * way[:, 1] - force[:, 1] * way[:, 0]).max() < 1e-11 * np.abs(force[:, :2]).max()


def test_cams_that_touch_on_the_line_of_their_pivots_are_at_a_dead_point():
    """The force passes both axes; said so, where the search for near relations failed on two slides along one tangent."""
    discs = [mg.Curve.ellipse(a=1.0, b=0.8, center=(x, 0, 0)) for x in (0.6, 2.6)]
    pair = mg.Pair("K", "Kc", "cam", "follower", curve=discs[0], curve_b=discs[1], point=(1.6, 0, 0))
    m = driven_cam(mg.Pair("F", "R", "frame", "follower", point=(2.0, 0, 0), axis=Z), pair, point=(2.6, 0, 0))
    with pytest.raises(mg.DeadPointError):
        mg.solve(m, {"A": TURN})
    assert not mg.check(m).determinate
