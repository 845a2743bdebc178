"""Identities of what elements exchange: lengths of belts and their rates, lines of action of teeth, ellipses of pressure."""

import numpy as np
import pytest
import scipy

import mechgraph as mg
from mechgraph.model import meshes as kinds
from mechgraph.model.belts import course, span
from mechgraph.model.gears import LinePlaces, angle
from mechgraph.pairs.contact_types import pressed, pressed_along_line

X, Y, Z = np.eye(3)
UP = Z[:, None, None]
RADII = np.array([20, 40]) * 5 / (2 * np.pi)


def at(*places):
    return np.array([(*p, 0.0) for p in places]).T[:, :, None]


def test_open_and_crossed_belt_have_the_lengths_of_the_books():
    """20 and 40 teeth of pitch 5 at 200: 551.2672, wrap 170.8714 deg; crossed 561.4537."""
    open_, crossed = (course(at((0, 0), (200, 0)), UP, RADII * [1, s]) for s in (1, -1))
    r, R, C = *RADII, 200.0
    lean = np.arcsin((R - r) / C)
    assert open_.length[0] == pytest.approx(2 * C * np.cos(lean) + np.pi * (r + R) + 2 * lean * (R - r), rel=1e-13)
    np.testing.assert_allclose(open_.length, 551.2672, atol=5e-5)
    np.testing.assert_allclose(np.rad2deg(open_.wrap[0]), 170.8714, atol=5e-5)
    np.testing.assert_allclose(crossed.length, 561.4537, atol=5e-5)
    np.testing.assert_allclose([open_.turns[0], crossed.turns[0]], [1, 0], atol=1e-12)


def test_an_idler_on_the_back_takes_wrap_and_gives_it():
    """Two pulleys of radius 1 at 4; an idler of radius 0.5 presses the upper strand down: turns of the belt are one all the same."""
    plain = course(at((4, 0), (0, 0)), UP, np.ones(2))
    pressed = course(at((4, 0), (2, 1.2), (0, 0)), UP, np.array([1, -0.5, 1]))
    # the span from (4, 0) to the idler: inner tangent
    d, off = np.hypot(2, 1.2), 1.5
    np.testing.assert_allclose(pressed.spans.length[0], np.sqrt(d * d - off * off), rtol=1e-13)
    lean = np.arctan2(1.2, 2) - np.arcsin(off / d)
    np.testing.assert_allclose(pressed.wrap[1], -2 * lean, rtol=1e-12)
    np.testing.assert_allclose(pressed.wrap[[0, 2]], np.pi - lean, rtol=1e-12)
    np.testing.assert_allclose([plain.turns[0], pressed.turns[0]], 1, rtol=1e-13)


def test_the_rate_of_a_row_is_the_velocity_along_the_span():
    """Gradient of l + w_b (theta_b - phi) - w_a (theta_a - phi) by differences: u . (v_b - v_a) at the points on the span."""
    rng = np.random.default_rng(3)
    for wa, wb in ((0.3, 0.5), (0.3, -0.5), (-0.4, 0.2)):
        ca, cb, va, vb = (np.array([*rng.uniform(-1, 1, 2), 0.0])[:, None] for _ in range(4))
        cb = cb + np.array([[3.0], [1.0], [0.0]])
        theta, omega = rng.uniform(-1, 1, 2), rng.uniform(-1, 1, 2)

        def value(h, ca=ca, cb=cb, va=va, vb=vb, wa=wa, wb=wb, theta=theta, omega=omega):
            marks = [np.array([[np.cos(t)], [np.sin(t)], [0 * t]]) for t in theta + h * omega]
            made = span(ca + h * va, cb + h * vb, UP[:, 0], wa, wb)
            return made.length + wb * angle(made.along, marks[1], UP[:, 0]) - wa * angle(made.along, marks[0], UP[:, 0])

        here = span(ca, cb, UP[:, 0], wa, wb)
        points = [here.start - ca, here.end - cb]
        speed = [v + w * np.cross([0, 0, 1], p[:, 0])[:, None] for v, w, p in zip((va, vb), omega, points, strict=True)]
        rate = (here.along * (speed[1] - speed[0])).sum(axis=0)
        h = 1e-6
        np.testing.assert_allclose((value(h) - value(-h)) / (2 * h), rate, atol=1e-8)
        np.testing.assert_allclose(value(1e-30j).imag / 1e-30, rate, rtol=1e-12)


def place(point, axis, mark):
    return LinePlaces(*(np.asarray(v, dtype=float)[:, None, None] for v in (point, axis, mark)))


def moved(p, w, v, h):
    """A place on a body after a small motion ``h``: turned by w about the origin, displaced by v."""
    angle = np.linalg.norm(w) * h
    k = np.asarray(w) / np.linalg.norm(w)
    K = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    R = np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
    turned = lambda x: (R @ x[:, 0, 0])[:, None, None]
    return LinePlaces(turned(p.point) + h * np.asarray(v)[:, None, None], turned(p.axis), turned(p.mark))


@pytest.mark.parametrize("forward", [True, False])
@pytest.mark.parametrize("inner", ["none", "a", "b", "rack", "rack first"])
def test_the_gradient_of_the_relation_is_the_line_of_action(inner, forward):
    """Any motion of both gears in the plane and along their axes: d phi = n . (v_b - v_a) at the pitch point."""
    rng = np.random.default_rng(5)
    teeth, helix = ((60, 20) if inner == "a" else (20, 60)), 0.3
    one = mg.Gear("a", "a", teeth[0], (0, 0, 0), Z, module=2.0, helix_angle=helix, internal=inner == "a")
    if "rack" in inner:
        two = mg.GearRack("b", "b", (0, 0, 0), X, Y, module=2.0, helix_angle=-helix)
        met = kinds.WithRack, [one, two], [place((1, 2, 0.3), Z, X), place((4, 2 - 22.0, 0.1), X, Y)]
        order = slice(None, None, -1 if "first" in inner else 1)
        made = met[0](*met[1][order], *met[2][order])
    else:
        two = mg.Gear(
            "b",
            "b",
            teeth[1],
            (0, 0, 0),
            Z,
            module=2.0,
            helix_angle=helix if inner != "none" else -helix,
            internal=inner == "b",
        )
        d = abs(one.base_radius + two.base_radius) / np.cos(0.45)
        made = kinds.Parallel(one, two, place((1, 2, 0.3), Z, X), place((1 + 0.6 * d, 2 + 0.8 * d, 1), -Z, Y))
    relation, numbers = made.flanks(forward)[0], np.array(made.numbers)[:, None, None]
    line = relation(made.a, made.b, numbers)
    P, n = line.point[:, 0, 0], line.along[:, 0, 0]
    assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-14)
    for _ in range(4):
        (wa, va), (wb, vb) = ((Z * rng.normal(), rng.normal(size=3)) for _ in range(2))
        h = 1e-5
        ends = [relation(moved(made.a, wa, va, s * h), moved(made.b, wb, vb, s * h), numbers).value for s in (1, -1)]
        rate = (ends[0] - ends[1])[0, 0] / (2 * h)
        assert rate == pytest.approx(n @ (vb + np.cross(wb, P) - va - np.cross(wa, P)), abs=1e-6)


@pytest.mark.parametrize("ratio", [1.0, 1.3, 4.0, 60.0, 2000.0])
def test_ellipse_of_pressure_by_its_integrals(ratio: float) -> None:
    """The curvatures that an ellipsoid of pressure makes, as integrals (Johnson 1985, eq. 3.64), are those that were asked for."""
    modulus, one, F = 115e9, 50.0, 250.0
    p = pressed(np.array(F), (np.array(one), np.array(ratio * one)), modulus)
    a, b, p0 = (float(v) for v in (p.along, p.across, p.pressure))
    assert 2 * np.pi * a * b * p0 / 3 == pytest.approx(F, rel=1e-12)

    def curvature(of: float, other: float) -> float:
        # w = of^2 tan^2(t) takes the roots out of the integral
        value, _ = scipy.integrate.quad(
            lambda t: np.cos(t) ** 2 / np.sqrt(other**2 * np.cos(t) ** 2 + of**2 * np.sin(t) ** 2), 0, np.pi / 2
        )
        return float(p0 * a * b / modulus * value / of**2 * 2)

    assert curvature(a, b) == pytest.approx(one, rel=1e-7)
    assert curvature(b, a) == pytest.approx(ratio * one, rel=1e-7)


def test_crossed_cylinders_and_a_line() -> None:
    p = pressed(
        np.array([0.0, 100.0, -1.0]), (np.array(100.0), np.array(100.0)), 115e9
    )  # as a ball of 10 mm on a plane
    assert p.pressure[0] == 0.0
    assert p.pressure[1] == pytest.approx((6 * 100 * 115e9**2 / (np.pi**3 * 0.01**2)) ** (1 / 3))
    assert np.isnan(p.pressure[2])
    line = pressed_along_line(np.array(100.0), np.array(0.0), 0.02, np.array(100.0), 115e9)
    assert line.pressure == pytest.approx(2 * (100 / 0.02) / (np.pi * line.across))
