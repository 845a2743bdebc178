"""Facts of contacts on curves by hand: an eccentric disc as a cam with a roller and with a flat follower, a ball in a ring groove."""

import numpy as np
import pytest

import mechgraph as mg

R, ROLL, E, W, SPEED, G = 0.04, 0.01, 0.012, 30.0, 6.0, 9.81
Z, Y = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)
LENGTH, MODULUS = 0.015, 210e9 / (2 * (1 - 0.3**2))
THETA = np.deg2rad(np.arange(0.0, 360.0, 5.0))
DISC = {"center": (E, 0, 0), "radius": R}
STEEL = mg.Hertz((210e9, 210e9), length=LENGTH)


def cam(pair: mg.Pair) -> mg.Mechanism:
    """The disc turns about the origin under a follower that slides along y."""
    return mg.Mechanism(
        "eccentric",
        [mg.Link("frame"), mg.Link("cam"), mg.Link("follower", W / G, (0, 0.1, 0))],
        [
            mg.Pair("A", "R", "frame", "cam", point=(0, 0, 0), axis=Z),
            pair,
            mg.Pair("C", "P", "frame", "follower", point=(0, 0.1, 0), axis=Y),
        ],
        drives=["A"],
        loads=[mg.Gravity((0, -G, 0))],
    )


def with_roller(**more: object) -> mg.Mechanism:
    top = (0.0, float(np.sqrt((R + ROLL) ** 2 - E**2)), 0.0)
    return cam(
        mg.Pair(
            "B", "Ps", "cam", "follower", curve=mg.Curve.circle(**DISC), roller=ROLL, point=top, hertz=STEEL, **more
        )
    )


def test_roller_on_a_disc() -> None:
    s = mg.solve(with_roller(closed="force"), {"A": mg.Motion(THETA, SPEED)})
    c = s.contact("B")
    centre = E * np.stack([np.cos(THETA), np.sin(THETA), 0 * THETA], axis=-1)
    up = np.sqrt((R + ROLL) ** 2 - (E * np.cos(THETA)) ** 2)
    n = np.stack([-E * np.cos(THETA), up, 0 * THETA], axis=-1) / (R + ROLL)
    assert np.allclose(c.normal, n, atol=1e-10)
    assert np.allclose(c.point, centre + R * n, atol=1e-10)
    lift_rate = SPEED * (E * np.cos(THETA) + E**2 * np.sin(THETA) * np.cos(THETA) / up)
    dx = SPEED * (-E * np.sin(THETA))
    second = SPEED**2 * (-E * np.sin(THETA)) + (-(dx**2) - E * np.cos(THETA) * -(SPEED**2) * E * np.cos(THETA)) / up
    second -= (E * np.cos(THETA) * dx) ** 2 / up**3
    force = W / G * (G + second) / n[:, 1]
    assert np.allclose(c.normal_force, force, rtol=1e-9)
    assert np.allclose(c.pressure_angle("follower"), np.arcsin(E * np.abs(np.cos(THETA)) / (R + ROLL)), atol=1e-9)
    assert np.allclose(c.hertz.pressure, np.sqrt(force / LENGTH * MODULUS * (1 / R + 1 / ROLL) / np.pi), rtol=1e-8)
    t = np.cross(Z, n)
    turn = -SPEED * E * np.sin(THETA) / up  # rate of the direction of n
    over_cam, over_roller = R * (turn - SPEED), -ROLL * turn
    assert np.allclose(c.sliding, (over_cam - over_roller)[:, None] * t, atol=1e-10)
    assert np.allclose(c.rolling, 0.5 * (over_cam + over_roller)[:, None] * t, atol=1e-10)
    assert np.allclose(s["A"].effort[:, 0] * SPEED, (W + W / G * second) * lift_rate, atol=1e-9)
    assert not c.lifts.any()


def test_a_follower_leaves_a_fast_cam() -> None:
    with pytest.warns(mg.MechgraphWarning, match="follower lifts off cam"):
        s = mg.solve(with_roller(closed="force"), {"A": mg.Motion(THETA, 40.0)})
    c = s.contact("B")
    assert (c.lifts == (s["C"].acceleration[:, 0] < -G)).all()
    assert c.lifts.any()
    assert np.isnan(c.hertz.pressure[c.lifts]).all()
    found = c.lift_off
    assert min(f.force for f in found) > 0


@pytest.mark.parametrize("inward", [False, True])
def test_the_side_of_a_roller_decides_which_way_it_is_pushed(inward: bool) -> None:
    """A roller inside a ring is pushed towards its center."""
    side = -1 if inward else 1
    at = (0.0, R + side * ROLL, 0.0)
    ring = mg.Curve.circle(radius=R)
    m = cam(mg.Pair("B", "Ps", "cam", "follower", curve=ring, roller=ROLL, point=at, closed="force"))
    m = m.replace(loads=[mg.Effort("C", -side * 5.0)])
    c = mg.solve(m, {"A": 0.3}).contact("B")
    assert c.normal_force == pytest.approx(5.0)
    assert np.allclose(c.normal, (0, side, 0), atol=1e-10)
    assert np.allclose(c.point, (0, R, 0), atol=1e-10)


def test_pressure_angle_where_the_follower_stands_still() -> None:
    """It turns back at both ends of its stroke, and the whole mechanism may stand: the angle is that of its way."""
    theta = np.append(THETA, [-np.pi / 2, np.pi / 2])
    expected = np.arcsin(E * np.abs(np.cos(theta)) / (R + ROLL))
    for speed in (SPEED, 0.0):
        c = mg.solve(with_roller(), {"A": mg.Motion(theta, speed)}).contact("B")
        assert np.allclose(c.pressure_angle("follower"), expected, rtol=0, atol=1e-10)
        across = np.cross(Z, c.point)
        cosine = np.abs((across * c.normal).sum(axis=1)) / np.linalg.norm(across, axis=1)
        assert np.allclose(np.cos(c.pressure_angle("cam")), cosine, atol=1e-10)


def test_pressure_angle_of_a_link_that_is_guided_by_another_one() -> None:
    """A slide on a slide: the way of its velocity, of its acceleration where it begins to move; none where it rests."""
    pairs = [
        mg.Pair("A", "P", "frame", "cross", point=(0, 0, 0), axis=(1, 0, 0)),
        mg.Pair("C", "P", "cross", "foot", point=(0, 0, 0), axis=(0, 0, 1)),
        mg.Pair("K", "Sp", "frame", "foot", point=(0, 0, 0), axis=(np.sin(0.3), 0, np.cos(0.3))),
    ]
    m = mg.Mechanism("foot", None, pairs, ["A"])
    s = mg.kinematics(m, {"A": mg.Motion([0.0, 0.1, 0.2], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0])})
    found = s.contact("K").pressure_angle("foot")
    assert np.allclose(found[:2], np.pi / 2, atol=1e-12)
    assert np.isnan(found[2])


def test_flat_follower_on_a_disc() -> None:
    """The face bears the weight alone; the contact wanders by the eccentricity to both sides."""
    face = mg.Pair(
        "B", "Kc", "cam", "follower", curve=mg.Curve.circle(**DISC), point=(E, R, 0), closed="force", hertz=STEEL
    )
    s = mg.solve(cam(face), {"A": mg.Motion(THETA, SPEED)})
    c = s.contact("B")
    force = W / G * (G - E * SPEED**2 * np.sin(THETA))
    assert np.allclose(c.normal, (0, 1, 0), atol=1e-10)
    assert np.allclose(c.normal_force, force, rtol=1e-9)
    assert np.allclose(c.point, np.stack([E * np.cos(THETA), E * np.sin(THETA) + R, 0 * THETA], axis=-1), atol=1e-10)
    assert np.ptp(c.path_b, axis=0).max() == pytest.approx(2 * E, rel=1e-9)
    assert np.allclose(c.pressure_angle("follower"), 0.0, atol=1e-9)
    assert np.allclose(c.hertz.pressure, np.sqrt(force / LENGTH * MODULUS / (np.pi * R)), rtol=1e-8)
    assert np.allclose(c.sliding, SPEED * (R + E * np.sin(THETA))[:, None] * np.array([1.0, 0, 0]), atol=1e-10)


def test_ball_in_a_ring_groove() -> None:
    """An arm turns a ball through a ring: the groove exerts what keeps it on its circle, and does no work."""
    m = mg.Mechanism(
        "ring",
        [mg.Link("frame"), mg.Link("arm"), mg.Link("ball", 0.2, (0.1, 0, 0))],
        [
            mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=Z),
            mg.Pair("S", "P", "arm", "ball", point=(0.05, 0, 0), axis=(1, 0, 0)),
            mg.Pair("B", "Sg", "frame", "ball", curve=mg.Curve.circle(radius=0.1), point=(0.1, 0, 0), radius=0.005),
        ],
        drives=["A"],
    )
    s = mg.solve(m, {"A": mg.Motion(np.linspace(0, 1, 5), 8.0)}, redundant="minimum_norm")
    c = s.contact("B")
    assert np.allclose(c.normal_force, 0.2 * 0.1 * 64, rtol=1e-6)
    assert np.abs((c.normal * c.sliding).sum(axis=-1)).max() < 1e-12


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            {"type": "Ps", "roller": ROLL, "radius": 0.02, "point": (E, R + ROLL, 0)},
            "the curves and their roller say it",
        ),
        ({"type": "Kc", "radius": 0.02, "point": (E, R, 0)}, "the curves and their roller say it"),
        ({"type": "Ps", "hertz": STEEL, "point": (E, R, 0)}, "radius: the pressure depends on it"),
        (
            {"type": "Sg", "radius": 0.01, "hertz": STEEL, "point": (E, R, 0)},
            "groove_radius = None: expected a number above the radius 0.01",
        ),
    ],
)
def test_what_does_not_fit_is_named(given: dict[str, object], said: str) -> None:
    kind = given.pop("type")
    with pytest.raises(mg.DeclarationError, match=said):
        cam(mg.Pair("B", kind, "cam", "follower", curve=mg.Curve.circle(**DISC), **given))


# --- profiles that are open, and hollows too narrow ----------------------------------------------------------------------------


def open_profiles() -> dict[str, tuple[mg.Pair, float]]:
    """A pair by what it touches with, and the sense along y in which it pulls the follower if the follower is pulled up."""
    lift = mg.Motion.law("cycloidal", 0.01, 2 * np.pi, np.linspace(0, 2 * np.pi, 73))
    up = 0.5 * (1 - np.cos(lift.t)) * 0.004
    law = {"angle": lift.t, "lift": up, "slope": 0.002 * np.sin(lift.t), "bend": 0.002 * np.cos(lift.t)}
    lobe = mg.Curve.cam(**law, base_radius=R, roller_radius=ROLL, second=Y)
    knife = mg.Curve.cam(**law, base_radius=R, second=Y)
    disc, top = mg.Curve.circle(**DISC), (0.0, float(np.sqrt((R + ROLL) ** 2 - E**2)), 0.0)
    line = mg.Curve.line(point=(E, R, 0), direction=(1, 0, 0))
    back = mg.Curve.line(point=(E, R, 0), direction=(-1, 0, 0))
    return {
        "roller": mg.Pair("B", "Ps", "cam", "follower", curve=disc, roller=ROLL, point=top),
        "cam": mg.Pair("B", "Ps", "cam", "follower", curve=lobe, point=(0, R + ROLL, 0)),
        "knife edge": mg.Pair("B", "Ps", "cam", "follower", curve=knife, point=(0, R, 0)),
        "flat": mg.Pair("B", "Kc", "cam", "follower", curve=disc, point=(E, R, 0)),
        "face first": mg.Pair("B", "Kc", "follower", "cam", curve=line, curve_b=disc, point=(E, R, 0)),
        "face turned": mg.Pair("B", "Kc", "follower", "cam", curve=back, curve_b=disc, point=(E, R, 0)),
    }


@pytest.mark.daily(2)
@pytest.mark.parametrize("name", list(open_profiles()))
def test_an_open_profile_that_would_have_to_pull_asks_how_it_is_closed(name: str) -> None:
    """Pressed together it says nothing; pulled apart it warns, unless it says that it is held, and then it lifts off or does not."""
    pair = open_profiles()[name]
    pressed = mg.solve(cam(pair), {"A": 0.2})
    assert pressed.warnings == ()
    assert pressed.contact("B").normal_force > 0

    def pulled(closed: str) -> mg.Solution:
        return mg.solve(cam(pair.replace(closed=closed)).replace(loads=[mg.Effort("C", 7.0)]), {"A": 0.2})

    with pytest.warns(mg.MechgraphWarning, match=f"{pair.a} pulls {pair.b} at A.*its profile is open"):
        s = pulled("")
    (found,) = s.warnings
    assert found.force == pytest.approx(-s.contact("B").normal_force)
    assert not s.contact("B").lifts
    assert "profile is open" in " ".join(s.summary().split())
    assert pulled("form").warnings == ()
    with pytest.warns(mg.MechgraphWarning, match="lifts off"):
        assert pulled("force").contact("B").lifts


def test_a_slot_holds_its_pin_without_being_told() -> None:
    slot = mg.Pair(
        "B", "Ps", "cam", "follower", curve=mg.Curve.circle(**DISC), point=(0, float(np.sqrt(R**2 - E**2)), 0)
    )
    s = mg.solve(cam(slot).replace(loads=[mg.Effort("C", 7.0)]), {"A": 0.2})
    assert s.warnings == ()


def hollow(radius: float, wide: float, whole: bool = False) -> mg.Mechanism:
    """The eccentric under a face that is hollow with the radius ``wide``, its ends at 0.3 rad above the level."""
    disc = mg.Curve.circle(center=(E, 0, 0), radius=radius)
    ends = {} if whole else {"angles": (0.3, np.pi - 0.3), "second": (1, 0, 0)}
    face = mg.Curve.circle(center=(E, radius - wide, 0), radius=wide, **ends)
    return cam(mg.Pair("B", "Kc", "cam", "follower", curve=disc, curve_b=face, point=(E, radius, 0)))


@pytest.mark.parametrize("whole", [False, True])
def test_a_cam_does_not_fit_into_a_narrower_hollow(whole: bool) -> None:
    with pytest.raises(mg.DeclarationError, match=r"hollow there with the radius 0\.04, and the curve.* radius 0\.05"):
        hollow(0.05, 0.04, whole)
    s = mg.solve(hollow(0.04, 0.05, whole), {"A": [0.0, 0.2]})
    assert s.warnings == ()
    # the center of the disc, which rose by E sin A, keeps the difference of the radii from that of the hollow, E cos A aside
    aside = E * (1 - np.cos([0.0, 0.2]))
    lift = E * np.sin([0.0, 0.2]) + 0.01 - np.sqrt(0.01**2 - aside**2)
    assert np.allclose(s["C"].position[:, 0], lift, atol=1e-12)


def test_elements_that_cut_into_each_other_are_named_where_they_do() -> None:
    """Brought together by their markers, a disc of 50 mm in a ring of 40; and a pin wider than its slot, an ellipse, is bent."""
    m = hollow(0.05, 0.06, True)
    pair = m.pair("B")
    narrow = pair.curve_b.replace(radius=0.04, center=(E, 0.01, 0))
    at = mg.Marker((E, 0.05, 0), Z, (-1, 0, 0))
    apart = pair.replace(point=None, axis=None, second=None, curve_b=narrow, on_a=at, on_b=at)
    m = m.replace(pairs=[apart if p.name == "B" else p for p in m.pairs])
    with pytest.warns(
        mg.MechgraphWarning, match="cam and follower cut into each other from A.*relative curvature down to -5"
    ):
        s = mg.kinematics(m, {"A": [0.0, 0.1, 0.2]})
    (found,) = s.warnings
    assert (found.first, found.last, found.curvature) == (0, 2, pytest.approx(5.0))

    a, b, pin = 0.04, 0.02, 0.015
    slot = mg.Pair("B", "Ps", "cam", "follower", curve=mg.Curve.ellipse(a=a, b=b), point=(0, b, 0), radius=pin)
    u = np.linspace(0, 2 * np.pi, 73)
    with pytest.warns(mg.MechgraphWarning, match="cut into each other"):
        s = mg.kinematics(cam(slot), {"A": u})
    at = np.pi / 2 - u  # the place of the pin, in the frame of the cam
    k = a * b / (a**2 * np.sin(t := np.arctan2(a * np.sin(at), b * np.cos(at))) ** 2 + b**2 * np.cos(t) ** 2) ** 1.5
    cut = np.concatenate([np.arange(found.first, found.last + 1) for found in s.contact("B").overlap])
    assert (cut == np.flatnonzero(k > 1 / pin)).all()
    assert s.contact("B").overlap[0].curvature == pytest.approx(a / b**2 - 1 / pin)
    assert "cut into each other" in " ".join(str(s.contact("B")).split())
    assert mg.kinematics(cam(slot.replace(radius=0.009)), {"A": u}).warnings == ()


# --- pressure angles of the books ----------------------------------------------------------------------------------------------


def lobe() -> mg.Motion:
    """A lift of 1, once up and down over a turn, with its derivatives: ``(1 - cos u) / 2``."""
    u = np.linspace(0, 2 * np.pi, 361)
    return mg.Motion((1 - np.cos(u)) / 2, np.sin(u) / 2, np.cos(u) / 2, t=u)


def scaled(factor: float) -> mg.Motion:
    law = lobe()
    return mg.Motion(factor * law.position, factor * law.velocity, factor * law.acceleration, t=law.t)


def followed(pair: mg.Pair, guide: mg.Pair) -> mg.Solution:
    pairs = [mg.Pair("A", "R", "frame", "cam", point=(0, 0, 0), axis=Z), pair, guide]
    return mg.kinematics(mg.Mechanism("cam", pairs=pairs, drives=["A"]), {"A": mg.Motion(THETA, 1.0)})


@pytest.mark.parametrize("mirrored", [False, True])
def test_pressure_angle_of_a_swinging_roller_is_that_at_its_centre(mirrored: bool) -> None:
    """tan alpha = |a cos p - l (1 + p')| / (a sin p), by the instant center of cam and arm on the line of their axes (p' < 0: mirrored)."""
    a, l, swing = 0.11, 0.09, 0.4
    sense = -1 if mirrored else 1
    curve = mg.Curve.arm_cam.of(
        scaled(swing), 0.03, roller_radius=0.012, pivot=a, arm=l, second=(1, 0, 0), mirrored=mirrored
    )
    arm = mg.Pair("C", "R", "frame", "arm", point=(a, 0, 0), axis=Z)
    s = followed(mg.Pair("B", "Ps", "cam", "arm", curve=curve, point=curve.at(np.array(0.0))[0]), arm)
    p = np.arccos((a**2 + l**2 - 0.042**2) / (2 * a * l)) + swing * (1 - np.cos(THETA)) / 2
    rate = sense * swing * np.sin(THETA) / 2
    expected = np.arctan(np.abs(a * np.cos(p) - l * (1 + rate)) / (a * np.sin(p)))
    c = s.contact("B")
    assert np.allclose(c.pressure_angle("arm"), expected, atol=1e-8)
    assert np.allclose(c.center[:, 0], a - l * np.cos(p), atol=1e-9)
    # at the contact, r from the center against the normal, the arm moves at right angles to another radius
    way = np.cross(Z, c.center - 0.012 * c.normal - (a, 0, 0))
    there = np.arccos(np.abs((way * c.normal).sum(axis=1)) / np.linalg.norm(way, axis=1))
    assert np.allclose(c.pressure_angle("arm", at="contact"), there, atol=1e-9)
    assert np.abs(there - expected).max() > np.deg2rad(2)
    both = {name: value for name, value, _ in c.columns() if name.startswith("pressure angle of arm")}
    assert np.allclose(both["pressure angle of arm"], expected, atol=1e-8)
    assert np.allclose(both["pressure angle of arm at the contact"], there, atol=1e-9)


@pytest.mark.parametrize("roller", [0.0, 0.01])
def test_pressure_angle_of_a_sliding_roller_or_edge(roller: float) -> None:
    """tan alpha = |e + s'| / (d + s) with the offset e of the line of the follower and its distance d."""
    e, lift = 0.008, 0.015
    curve = mg.Curve.cam.of(scaled(lift), 0.03, roller_radius=roller, offset=e, second=Y)
    at = curve.at(np.array(0.0))[0]
    s = followed(
        mg.Pair("B", "Ps", "cam", "rod", curve=curve, point=at), mg.Pair("C", "P", "frame", "rod", point=at, axis=Y)
    )
    d = np.sqrt((0.03 + roller) ** 2 - e**2)
    expected = np.arctan(np.abs(e + lift * np.sin(THETA) / 2) / (d + lift * (1 - np.cos(THETA)) / 2))
    for where in (None, "contact", "center"):
        assert np.allclose(s.contact("B").pressure_angle("rod", where), expected, atol=1e-8)


def test_pressure_angle_of_a_swinging_flat_follower() -> None:
    """tan alpha = f / d: the face passes its pivot at the distance f and is touched at d along it; the transmission says the same."""
    q, f = np.array([0.12, 0.0]), 0.01
    across = (R - f) / (q[0] - E)
    n = np.array(
        [across, np.sqrt(1 - across**2)]
    )  # normal of the face at the start: (center of the disc + R n - q) . n = f
    at = (*(np.array([E, 0]) + R * n), 0.0)
    face = mg.Curve.line(point=at, direction=(n[1], -n[0], 0))
    pair = mg.Pair("B", "Kc", "cam", "arm", curve=mg.Curve.circle(**DISC), curve_b=face, point=at)
    s = followed(pair, mg.Pair("C", "R", "frame", "arm", point=(*q, 0), axis=Z))
    off = E * np.stack([np.cos(THETA), np.sin(THETA)], axis=1) - q
    d = np.sqrt((off**2).sum(axis=1) - (R - f) ** 2)
    found = s.contact("B").pressure_angle("arm")
    assert np.allclose(found, np.arctan(f / d), atol=1e-9)
    assert np.allclose(mg.transmission(mg.solve(s.mechanism, {"A": THETA}), "C").deviation_angle, found, atol=1e-9)


def test_a_wrong_place_of_a_pressure_angle_is_named() -> None:
    c = mg.solve(with_roller(), {"A": 0.0}).contact("B")
    with pytest.raises(
        mg.DeclarationError, match=r"(?s)link = 'frame'.*at = 'middle': expected 'contact', 'center' or None"
    ):
        c.pressure_angle("frame", at="middle")
