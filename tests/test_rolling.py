"""Bodies that roll and slip on each other in time, teeth held by their friction, and feet that open: closed forms and solve_ivp.

Ball on a turntable: J. J. Burns, American Journal of Physics 49, 1981. Rolling and slipping: F. P. Beer and E. R. Johnston, Vector
Mechanics for Engineers: Dynamics, chapter 16.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mechgraph as mg

X, Y, Z = np.eye(3)
G = 9.81
FINE = {"rtol": 1e-9, "atol": 1e-11}
SLOW = pytest.mark.slow
OPENS = {"restitution": 0.0}


def round_body(name, center, mass=2.0, radius=0.1, part=0.4):
    return mg.Link(name, mass=mass, center=center, inertia=part * mass * radius**2 * np.eye(3))


def ball(mu, slope=0.0, radius=0.1, gap=0.0, swapped=False, **more):
    """A ball on a plane z = 0, under gravity that leans by a slope towards x."""
    on = {"axis": Z, "radius": radius, "closed": "force", "point": (0, 0, radius), **more}
    pair = mg.Pair("K", "Sp", "frame", "ball", gap=gap, **on)
    gravity = mg.Gravity((G * np.sin(slope), 0, -G * np.cos(slope)))
    links = [mg.Link("frame"), round_body("ball", (0, 0, radius), radius=radius)]
    return mg.Mechanism("ball", links, [pair], loads=[gravity, mg.Friction("K", mu=mu)])


def names(r):
    return [str(one).split(" at ")[0] for one in r.events]


@pytest.mark.parametrize("more", [{}, pytest.param(OPENS, marks=SLOW)])
def test_a_ball_rolls_down_a_slope_or_slips(more):
    """Rolling a = 5/7 g sin with the friction 2/7 m g sin; from tan(slope) = 7/2 mu on it slips with g (sin - mu cos)."""
    mu, t = 0.3, 0.4
    least = np.arctan(3.5 * mu)
    for slope in (0.98 * least, 1.02 * least):
        r = mg.respond(ball(mu, slope, **more), [0.0, t], **FINE)
        rolls = slope < least
        a = 5 / 7 * G * np.sin(slope) if rolls else G * (np.sin(slope) - mu * np.cos(slope))
        w = a / 0.1 if rolls else mu * G * np.cos(slope) / (0.4 * 0.1)
        assert r["K"].acceleration[-1, 0] == pytest.approx(a, rel=1e-10)
        assert r.link("ball").angular_velocity[-1, 1] == pytest.approx(w * t, rel=1e-9)
        held = 2 / 7 * 2.0 * G * np.sin(slope) if rolls else mu * 2.0 * G * np.cos(slope)
        assert r["K"].friction[-1, 0] == pytest.approx(-held, rel=1e-9)
        assert r["K"].normal_forces[-1, 0] == pytest.approx(2.0 * G * np.cos(slope), rel=1e-12)
        assert bool(r["K"].sticks[-1]) == rolls
        assert np.abs(r.energy.balance).max() < 1e-10


@SLOW
@pytest.mark.parametrize(("radius", "more"), [(0.1, {}), (0.02, OPENS)])
def test_a_thrown_ball_slips_for_2_v_over_7_mu_g_and_then_rolls(radius, more):
    """It keeps 5/7 of its speed and loses 2/7 of its energy, whatever its radius."""
    mu, v = 0.2, np.array([1.0, 0.5])
    r = mg.respond(ball(mu, radius=radius, **more), [0.0, 0.05, 0.5], rates={"K.Tx": v[0], "K.Ty": v[1]}, **FINE)
    assert names(r)[-1] == "K sticks"
    assert r.events[-1].t == pytest.approx(2 / 7 * np.hypot(*v) / (mu * G), abs=1e-9)
    np.testing.assert_allclose(r.link("ball").center_velocity[-1, :2], 5 / 7 * v, atol=1e-9)
    assert r.energy.friction[-1] == pytest.approx(2 / 7 * (v @ v), rel=1e-9)


@SLOW
@pytest.mark.parametrize(("swapped", "more"), [(False, {}), (True, {}), (False, OPENS)])
def test_a_ball_on_a_turntable_goes_round_at_two_sevenths_of_its_speed(swapped, more):
    """v' = 2/7 W x v: a circle whose middle is not that of the table; no coordinates would have it so."""
    speed, at = 3.0, (0.3, 0, 0.1)
    ends, axis = (("table", "frame"), -Z) if swapped else (("frame", "table"), Z)
    on = {"axis": Z, "radius": 0.1, "closed": "force", "point": at, **more}
    pairs = [mg.Pair("D", "R", *ends, point=(0, 0, 0), axis=axis), mg.Pair("K", "Sp", "table", "ball", **on)]
    loads = [mg.Gravity((0, 0, -G)), mg.Friction("K", mu=0.5)]
    m = mg.Mechanism("turntable", [mg.Link("frame"), mg.Link("table"), round_body("ball", at)], pairs, loads=loads)
    r = mg.respond(
        m, [0.0, 0.2, 0.5], motions={"D": lambda t: (speed * t, speed, 0.0)}, rates={"K.Tx": 0.0, "K.Ty": 0.0}, **FINE
    )
    v, angle = r.link("ball").center_velocity[:, :2], 2 / 7 * speed * r.t
    turned = np.stack(
        [v[0, 0] * np.cos(angle) - v[0, 1] * np.sin(angle), v[0, 0] * np.sin(angle) + v[0, 1] * np.cos(angle)], -1
    )
    assert np.hypot(*v[0]) == pytest.approx(0.9, rel=1e-12)
    np.testing.assert_allclose(v, turned, atol=1e-9)
    assert r["K"].sticks.all()
    # rolling takes nothing; the drive gives what the ball gains
    assert r.energy.friction[-1] == pytest.approx(0.0, abs=1e-12)
    assert np.abs(r.energy.balance).max() < 1e-9


def disk(mu, slope, planar, **more):
    """A disk on a line, by two curves in contact."""
    line, rim = (
        mg.Curve.line(point=(0, 0, 0), direction=(1, 0, 0)),
        mg.Curve.circle(center=(0, 0.1, 0), radius=0.1, axis=(0, 0, 1)),
    )
    pair = mg.Pair("K", "Kc", "frame", "disk", point=(0, 0, 0), axis=Z, curve=line, curve_b=rim, closed="force", **more)
    gravity = mg.Gravity((G * np.sin(slope), -G * np.cos(slope), 0))
    links = [mg.Link("frame"), round_body("disk", (0, 0.1, 0), part=0.5)]
    return mg.Mechanism("disk", links, [pair], loads=[gravity, mg.Friction("K", mu=mu)], planar=planar)


@pytest.mark.parametrize("angle", [0.3, 2.0, -1.0, 2.8])
def test_a_line_in_the_plane_that_says_no_axis_is_touched_in_it(angle):
    """A disk runs down a tilted line, on the side towards the axis that is closer to its normal, by 2/3 of g sin."""
    t = np.array([np.cos(angle), np.sin(angle)])
    n = np.array([-t[1], t[0]])
    n *= np.sign(n[np.argmax(np.abs(n))])
    line, rim = mg.Curve.line(point=(0, 0), direction=t), mg.Curve.circle(center=0.1 * n, radius=0.1)
    pair = mg.Pair("K", "Kc", "frame", "disk", point=(0, 0), curve=line, curve_b=rim, closed="force")
    loads = [mg.Gravity(G * (0.3 * t - n)), mg.Friction("K", mu=0.5)]
    m = mg.Mechanism(
        "disk", [mg.Link("frame"), mg.Link("disk", 2.0, 0.1 * n, 0.5 * 2.0 * 0.01)], [pair], loads=loads, planar=True
    )
    r = mg.respond(m, (0, 0.5))
    assert abs(r["K"].position[-1, 0]) == pytest.approx(0.3 * G / 3 * 0.25, rel=1e-6)
    assert r["K"].sticks.all()
    with pytest.raises(mg.DeclarationError, match="axis"):
        mg.Mechanism("disk", pairs=[pair.replace(point=(0, 0, 0), axis=(0.6, 0.8))])


@pytest.mark.parametrize(
    ("planar", "more"),
    [(True, {}), *(pytest.param(*one, marks=SLOW) for one in ((True, OPENS), (False, {}), (False, OPENS)))],
)
def test_a_disk_on_a_line_rolls_or_slips_by_thirds(planar, more):
    """2/3 g sin and the friction m g sin / 3 up to tan(slope) = 3 mu; thrown with v it keeps 2/3 of it."""
    slope, mu = 0.3, 0.3
    r = mg.respond(disk(mu, slope, planar, **more), [0.0, 0.3], **FINE)
    v = r.link("disk").center_velocity[-1, 0]
    assert v == pytest.approx(2 / 3 * G * np.sin(slope) * 0.3, rel=1e-9)
    assert abs(r["K"].friction[-1, 0]) == pytest.approx(2.0 * G * np.sin(slope) / 3, rel=1e-9)
    # the place on the line moves on by Ts, that on the rim by Tsb: without a turn the disk slides by Ts alone
    thrown = mg.respond(disk(mu, 0.0, planar, **more), [0.0, 0.4], rates={"K.Ts": 1.0, "K.Tsb": 0.0}, **FINE)
    assert names(thrown)[-1] == "K sticks"
    assert thrown.events[-1].t == pytest.approx(1 / 3 / (mu * G), abs=1e-9)
    assert thrown.link("disk").center_velocity[-1, 0] == pytest.approx(2 / 3, rel=1e-9)


@SLOW
def test_a_cylinder_on_a_plane_rolls():
    """By its line of contact, 2/3 g sin; across it slides."""
    on = {"axis": Z, "second": X, "radius": 0.1, "closed": "force", "point": (0, 0, 0.1)}
    links = [mg.Link("frame"), round_body("roller", (0, 0, 0.1), part=0.5)]
    m = mg.Mechanism("roller", links, [mg.Pair("K", "Cp", "frame", "roller", **on)])
    for lean, a in (((0.0, 2.0), (0.0, 4 / 3)), ((3.0, 0.0), (3.0 - 0.2 * G, 0.0))):
        loads = [mg.Gravity((*lean, -G)), mg.Friction("K", mu=0.2)]
        r = mg.respond(m.replace(loads=loads), [0.0, 0.2], **FINE)
        np.testing.assert_allclose(r.link("roller").center_acceleration[-1, :2], a, atol=1e-9)


@SLOW
@pytest.mark.parametrize("mu", [0.5, 0.02])
def test_a_ball_lands_with_spin(mu):
    """Along the plane 2/7 m u, which stops the point of contact, or mu times the normal impulse; the moment of either turns the ball."""
    spin, e, m = 20.0, 0.5, 2.0
    r = mg.respond(ball(mu, gap=0.2, restitution=e), [0.0, 0.3], rates={"K.Ry": spin, "K.Tx": 0.3}, **FINE)
    strike, fall = r.events[0], np.sqrt(2 * G * 0.2)
    normal, slides = m * (1 + e) * fall, 0.3 - 0.1 * spin
    along = min(2 / 7 * m * abs(slides), mu * normal)
    np.testing.assert_allclose(strike.impulses["K"][3:], [along, 0, normal], atol=1e-8)
    place = np.array([0.3 * strike.t, 0, 0])
    np.testing.assert_allclose(strike.impulses["K"][:3], np.cross(place, strike.impulses["K"][3:]), atol=1e-8)
    assert r.link("ball").angular_velocity[-1, 1] == pytest.approx(spin - 0.1 * along / (0.4 * m * 0.01), rel=1e-8)
    assert r.link("ball").center_velocity[-1, 0] == pytest.approx(0.3 + along / m, rel=1e-8)
    assert np.abs(r.energy.balance).max() < 1e-8


def bowl(radius):
    """A ball of radius 0.1 (or a point) in a hollow sphere of radius 1, in its plane y = 0."""
    where = 0.4
    shell = mg.Surface.sphere(center=(0, 0, 0), radius=1.0 - radius)
    at = (1 - radius) * np.array([np.sin(where), 0, -np.cos(where)])
    pair = mg.Pair(
        "K",
        "Sp",
        "frame",
        "ball",
        point=tuple(at),
        axis=tuple(-at),
        surface=shell,
        closed="force",
        **({"radius": radius} if radius else {}),
    )
    links = [mg.Link("frame"), round_body("ball", tuple(at), radius=radius or 0.1)]
    return mg.Mechanism(
        "bowl", links, [pair], loads=[mg.Gravity((0, 0, -G)), mg.Friction("K", mu=0.8 if radius else 0.1)]
    ), where


@SLOW
@pytest.mark.parametrize("radius", [0.1, 0.0])
def test_in_a_bowl_a_ball_rolls_and_a_point_slides(radius):
    """7/5 (R - r) q'' = -g sin q; a point slows by mu (g cos q + R q'^2) besides."""
    m, where = bowl(radius)
    r = mg.respond(m, [0.0, 0.25, 0.5], **FINE)

    def rates(t, y):
        if radius:
            return [y[1], -5 / 7 * G * np.sin(y[0]) / 0.9]
        return [y[1], -G * np.sin(y[0]) + 0.1 * (G * np.cos(y[0]) + y[1] ** 2)]

    q = solve_ivp(rates, (0, 0.5), [where, 0.0], t_eval=r.t, method="DOP853", rtol=1e-12, atol=1e-13).y[0]
    c = r.link("ball").center
    np.testing.assert_allclose(np.arctan2(c[:, 0], -c[:, 2]), q, atol=1e-8)
    assert np.abs(r.energy.balance).max() < 1e-8


def test_a_ball_that_rolls_in_a_bowl_off_its_meridian_is_in_balance():
    """Friction does on the freedoms what the force does that its center needs, and turns the ball: ``J a = -R n x F``."""
    R, rho, M, out = 0.05, 0.45, 1.0, np.array([0.6, 0.0, -0.8])
    J = 0.4 * M * R**2
    shell = mg.Surface.sphere(center=(0, 0, 0), radius=rho, axis=(0, 1, 0))
    links = [mg.Link("frame"), mg.Link("ball", M, tuple(rho * out), inertia=J * np.eye(3))]
    touch = mg.Pair(
        "K", "Sp", "frame", "ball", point=tuple(rho * out), axis=tuple(-out), surface=shell, radius=R, closed="force"
    )
    m = mg.Mechanism("bowl", links, [touch], loads=[mg.Gravity((0, 0, -G)), mg.Friction("K", mu=0.8)])
    r = mg.respond(m, [0.0, 0.05, 0.1], rates={"K.Tu": 0.0, "K.Tv": 1.0})
    assert names(r) == ["K sticks"]
    assert r.checks.equilibrium.max() < 1e-12
    n = -r.link("ball").center / rho
    F = M * (r.link("ball").center_acceleration + np.array([0.0, 0.0, G]))
    np.testing.assert_allclose(J * r.link("ball").angular_acceleration, -R * np.cross(n, F), atol=1e-10)
    # the direction of the sliding is known to the last: tight steps end where it sticks
    rough = m.replace(loads=[m.loads[0], mg.Friction("K", mu=2.0)])
    assert names(mg.respond(rough, (0, 0.0065), rates={"K.Tu": 0.0, "K.Tv": 0.3}, rtol=1e-10, atol=1e-12)) == [
        "K sticks"
    ]


def ladder(mu, foot=0.5, **more):
    """A rod of 2 m and 3 kg between floor y = 0 and wall x = 0, which only push, its foot this far from the wall."""
    top = np.sqrt(4 - foot**2)
    floor, wall = (
        mg.Curve.line(point=(0, 0, 0), direction=(1, 0, 0)),
        mg.Curve.line(point=(0, 0, 0), direction=(0, -1, 0)),
    )
    on = {"type": "Ps", "a": "frame", "b": "rod", "axis": Z, "closed": "force", "restitution": 0.0}
    pairs = [mg.Pair("A", curve=floor, point=(foot, 0, 0), **on), mg.Pair("B", curve=wall, point=(0, top, 0), **on)]
    rod = mg.Link("rod", mass=3.0, center=(foot / 2, top / 2, 0), inertia=np.eye(3))
    loads = [mg.Gravity((0, -G, 0)), mg.Friction("A", mu=mu), mg.Friction("B", mu=mu)]
    return mg.Mechanism("ladder", [mg.Link("frame"), rod], pairs, loads=loads, planar=True)


def slipping(q, w, mu):
    """q'' of the angle to the wall, and the forces of floor and wall, where both slip."""
    s, c = np.sin(q), np.cos(q)
    # x = s, y = c of the middle: m x'' = B - mu A, m y'' = A + mu B - m g, J q'' = A (s + mu c) ... about the middle
    A = np.array([[3.0 * c, mu, -1.0], [-3.0 * s, -1.0, -mu], [1.0, -(s - mu * c), c - mu * -s]])
    b = np.array([3.0 * s * w * w, 3.0 * c * w * w - 3.0 * G, 0.0])
    return np.linalg.solve(A, b)


@SLOW
def test_a_ladder_slips_down_and_leaves_the_wall():
    mu, foot = 0.1, 0.9
    r = mg.respond(ladder(mu, foot), [0.0, 0.2, 0.7], **FINE)

    def leaves(t, y):
        return slipping(*y, mu)[2]

    leaves.terminal = True
    found = solve_ivp(
        lambda t, y: [y[1], slipping(*y, mu)[0]], (0, 2), [np.arcsin(foot / 2), 0.0], method="DOP853", rtol=1e-12, atol=1e-13,
        dense_output=True, events=leaves,
    )  # fmt: skip
    opens = [one.t for one in r.events if str(one).startswith("B opens")]
    np.testing.assert_allclose(opens, found.t_events[0], atol=1e-8)
    q = found.sol(0.2)
    np.testing.assert_allclose(r["A"].normal_forces[1, 0], slipping(*q, mu)[1], rtol=1e-8)
    np.testing.assert_allclose(r["B"].normal_forces[1, 0], slipping(*q, mu)[2], rtol=1e-8)
    np.testing.assert_allclose(r.link("rod").center[1, 0], np.sin(q[0]), atol=1e-9)


def test_teeth_held_by_their_friction_know_their_force():
    """Two moments, two unknowns: the normal force of the teeth and the couple between the gears."""
    teeth = mg.SpurGears("t", "p", "w", teeth=(20, 40), module=0.002)
    at = {"p": (0.0, 0.002), "w": (0.06, 0.02)}
    links = [mg.Link("frame"), *(mg.Link(n, 1.0, (x, 0, 0), j * np.eye(3)) for n, (x, j) in at.items())]
    pairs = [mg.Pair(n, "R", "frame", n, point=(x, 0, 0), axis=Z) for n, (x, _) in at.items()]
    push, brake = 1.0, 2.0 * 0.98
    loads = [mg.Effort("p", push), mg.Effort("w", brake), mg.Friction("t", efficiency=0.9)]
    m = mg.Mechanism("stage", links, pairs, couplings=[teeth], loads=loads)
    r = mg.respond(m, [0.0, 0.05], **FINE)
    assert not r["p"].velocity.any()
    # N on the pinion at the base radius 0.02 cos 20: push = N rp + C, brake = N rw - C
    arms = np.array([0.02, 0.04]) * np.cos(np.deg2rad(20.0))
    N = (push + brake) / arms.sum()
    np.testing.assert_allclose(np.linalg.norm(r["p"].force[-1]), N, rtol=1e-10)
    assert r.coupling("t").normal_force[-1] == pytest.approx(N, rel=1e-10)
    assert np.max(r.checks.equilibrium) < 1e-12
    turns = mg.respond(m.replace(loads=[loads[0], mg.Effort("w", 2.0 * 0.85), loads[2]]), [0.0, 0.05], **FINE)
    assert turns["p"].velocity[-1, 0] > 0


@pytest.mark.parametrize(
    ("kind", "more", "words"),
    [("Sp", {"axis": Z}, "closed='force'"), ("Sg", {"axis": Z, "closed": "force"}, "touches its groove")],
)
def test_where_the_side_of_a_ball_is_not_known_it_is_refused(kind, more, words):
    pair = mg.Pair("K", kind, "frame", "ball", point=(0, 0, 0), radius=0.1, **more)
    m = mg.Mechanism("one", [mg.Link("frame"), round_body("ball", (0, 0, 0))], [pair], loads=[mg.Friction("K", mu=0.1)])
    with pytest.raises(mg.DeclarationError, match=words):
        mg.respond(m, (0, 1))
