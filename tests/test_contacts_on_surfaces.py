"""Balls on surfaces: facts of the contact by hand, offset surfaces, Hertz's pressure there and in curved grooves."""

import numpy as np
import pytest
import scipy
from numpy.testing import assert_allclose
from test_curves import T, ring
from test_surfaces import SAMPLE, on

import mechgraph as mg

BALL = 0.05
STEEL = mg.Hertz((210e9, 210e9), groove_radius=0.052)
MODULUS = STEEL.modulus


def greatest_pressure(force, curvatures):
    """Of an ellipsoid of pressure whose integrals (Johnson 1985, eq. 3.64) make these relative curvatures, ``(...)`` as the force."""
    least, most = sorted(curvatures)

    def made(of, other):
        f = lambda t: np.cos(t) ** 2 / np.hypot(other * np.cos(t), of * np.sin(t))
        return scipy.integrate.quad(f, 0, np.pi / 2, epsabs=0, epsrel=1e-13)[0]

    miss = lambda k: k**2 * made(1.0, k) / made(k, 1.0) - least / most
    k = 1.0 if miss(1.0) - 1e-12 <= 0 else scipy.optimize.brentq(miss, 1e-4, 1.0, xtol=1e-15)
    return (least * MODULUS / (2 * k * made(1.0, k)) * np.sqrt(3 * force / (2 * np.pi * k))) ** (2 / 3)


def solved(m):
    return mg.solve(m, {"J0": mg.Motion(0.05 * T, 1.3, 0.7)})


def foot(surface, side=1.0, away=BALL):
    x, xu, xv = surface.at(np.array([0.7]), np.array([0.4]))[:3, :, 0]
    n = np.cross(xu, xv) / np.linalg.norm(np.cross(xu, xv))
    return x + side * away * n, side * n


@pytest.mark.daily(5)
@pytest.mark.filterwarnings("ignore:.*lifts off")
@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("name", ["plane", "sphere", "cylinder", "cone", "torus"])
def test_a_ball_touches_the_surface_on_which_it_rolls(name, side):
    """Point, normal force, sliding and rolling at the true surface; the same as a point on the offset surface; power is balanced."""
    surface = SAMPLE[name]
    at, n = foot(surface, side)
    s = solved(ring(on(surface, at, roller=BALL, axis=tuple(n), closed="force"), n=2))
    other = solved(ring(on(surface.offset(side * BALL), at, axis=tuple(n), radius=BALL, closed="force"), n=2))
    assert s.checks.power.max() < 1e-12
    c, d = s.contact("X"), other.contact("X")
    assert_allclose(s["X"].reaction, other["X"].reaction, atol=1e-11 * np.abs(s["X"].reaction).max())
    for what in ("point", "normal_force", "sliding", "rolling", "spin", "path_a", "path_b"):
        assert_allclose(getattr(c, what), getattr(d, what), atol=1e-11 * max(1.0, np.abs(getattr(c, what)).max()))
    for p in c.point:
        nearest = surface.at(*np.array(surface.nearest(p))[:, None])[0][:, 0]
        assert_allclose(p, nearest, atol=1e-11)
    force = s["X"].force
    assert_allclose(np.abs((force * c.normal).sum(axis=1)), np.linalg.norm(force, axis=1), rtol=1e-11)
    across = np.abs((c.sliding * c.normal).sum(axis=1)), np.abs((c.rolling * c.normal).sum(axis=1))
    assert max(map(np.max, across)) < 1e-11
    body, p = s.link("b1"), c.point  # the frame stands still: what slides is the material of the ball
    assert_allclose(c.sliding, body.twist[:, 3:] + np.cross(body.twist[:, :3], p), atol=1e-12)


def test_a_ball_rolls_down_a_sphere_until_it_lifts_off():
    """A ball driven round a circle over a sphere lifts off where gravity no longer holds it: ``cos angle = v^2 / (g L)``."""
    R, r, g, w = 1.0, 0.1, 9.81, 2.0
    arm = R + r
    m = mg.Mechanism(
        "ball",
        [mg.Link("frame"), mg.Link("arm"), mg.Link("ball", 2.0, (0, 0, arm))],
        [
            mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=(0, 1, 0)),
            mg.Pair("B", "P", "arm", "ball", point=(0, 0, arm), axis=(0, 0, 1)),
            mg.Pair(
                "K", "Sp", "frame", "ball", point=(0, 0, arm), surface=mg.Surface.sphere(radius=R, axis=(0, 1, 0)),
                roller=r, closed="force",
            ),
        ],
        ["A"],
        [mg.Gravity((0, 0, -g))],
    )  # fmt: skip
    angle = np.linspace(0.0, 1.5, 31)
    with pytest.warns(mg.MechgraphWarning, match="lifts off"):
        s = mg.solve(m, {"A": mg.Motion(angle, w, 0.0)})
    c = s.contact("K")
    assert_allclose(c.normal_force, 2.0 * (g * np.cos(angle) - w**2 * arm), atol=1e-9)
    (off,) = c.lift_off
    assert off.begins["A.Rz"] == pytest.approx(np.arccos(w**2 * arm / g), abs=1e-3)
    assert_allclose(c.point, R * np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1), atol=1e-11)


@pytest.mark.parametrize(
    ("surface", "bends"),
    [
        (SAMPLE["plane"], (0.0, 0.0)),
        (SAMPLE["sphere"], (1 / 0.8, 1 / 0.8)),
        (SAMPLE["cylinder"], (1 / 0.8, 0.0)),
        (SAMPLE["torus"], (1 / 0.3, np.cos(0.4) / (0.9 + 0.3 * np.cos(0.4)))),
    ],
    ids=["plane", "sphere", "cylinder", "torus"],
)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_pressure_between_a_ball_and_a_surface(surface, bends, side):
    """Relative curvatures are the sums of those of ball and surface, on its outside and on its inside."""
    at, n = foot(surface, side)
    s = mg.solve(ring(on(surface, at, roller=BALL, axis=tuple(n), closed="form", hertz=STEEL), n=2), {"J0": 0.0})
    c = s.contact("X")
    sign = side * np.sign(float(c.normal_force))  # held on both sides: the force may be that of a wall beyond the ball
    expected = greatest_pressure(np.abs(c.normal_force), [1 / BALL + sign * k for k in bends])
    if sign == side:
        assert_allclose(c.hertz.pressure, expected, rtol=1e-9)
    assert (c.hertz.pressure > 0).all()


@pytest.mark.parametrize("outward", [True, False])
def test_pressure_in_a_raceway(outward):
    """A ball between races: along the groove its curvature adds to that of the inner race and is lessened by that of the outer one."""
    R, w, mass = 0.4, 20.0, 0.3
    at = (R, 0, 0)
    pair = mg.Pair("K", "Sg", "frame", "ball", curve=mg.Curve.circle(radius=R), point=at, radius=BALL, hertz=STEEL)
    m = mg.Mechanism(
        "bearing",
        [mg.Link("frame"), mg.Link("cage"), mg.Link("ball", mass, at)],
        [
            mg.Pair("A", "R", "frame", "cage", point=(0, 0, 0), axis=(0, 0, 1)),
            mg.Pair("B", "Fr", "cage", "ball")
            if False
            else mg.Pair("B", "E", "cage", "ball", point=at, axis=(0, 1, 0)),
            pair,
        ],
        ["A"],
        [mg.Wrench("ball", force=(0 if outward else -2 * mass * w**2 * R, 0, 0), point=at, frame="link")],
    )
    s = mg.solve(m, {"A": mg.Motion(np.array([0.0, 0.5, 1.0]), w, 0.0)})
    c = s.contact("K")
    force = mass * w**2 * R
    race = R + BALL if outward else R - BALL
    along = 1 / BALL + (-1 if outward else 1) / race
    expected = greatest_pressure(force, [along, 1 / BALL - 1 / 0.052])
    assert_allclose(c.normal_force, force, rtol=1e-9)
    assert_allclose(c.hertz.pressure, expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("surface", "more", "words"),
    [
        (SAMPLE["patch"], {"roller": 0.1}, "the center of a ball of radius 0.1 has no patch beside this one"),
        (
            mg.Surface.torus(radius=2.0, tube=0.4),
            {"roller": 0.5, "point": (2.1, 0, 0.0)},
            "has no torus beside this one",
        ),
        (mg.Surface.sphere(radius=1.0), {"roller": -0.5}, "roller = -0.5"),
        (mg.Surface.sphere(radius=1.0), {"roller": 0.5, "point": (1.4, 0, 0)}, "is 0.1 off its surface"),
        (mg.Surface.plane(), {"hertz": STEEL, "point": (0, 0, 0)}, "radius: the pressure depends on it"),
    ],
)
def test_balls_that_do_not_fit_are_named(surface, more, words):
    with pytest.raises(mg.DeclarationError, match=words):
        mg.Mechanism("m", None, [mg.Pair("X", "Sp", "frame", "ball", surface=surface, **more)])


@pytest.mark.filterwarnings("ignore:.*lifts off")
def test_files_keep_a_ball_on_a_surface(tmp_path):
    at, n = foot(SAMPLE["torus"])
    m = ring(on(SAMPLE["torus"], at, roller=BALL, axis=tuple(n), closed="force", hertz=STEEL), n=2)
    mg.save(m, tmp_path / "m.toml")
    again = mg.load(tmp_path / "m.toml")
    assert again == m
    assert_allclose(solved(again).contact("X").point, solved(m).contact("X").point, atol=1e-15)
