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
    """A roller inside a ring is pushed towards its centre."""
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
