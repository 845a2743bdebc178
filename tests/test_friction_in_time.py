"""Dry friction in a motion in time against closed forms: sliding, sticking, reversal.

Mass on a belt, pendulum on a journal: K. Magnus and K. Popp, Schwingungen, 1997. Screws: J. E. Shigley and C. R. Mischke, Mechanical
Engineering Design, 1989, chapter 8.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import lsq_linear

import mechgraph as mg

X, Y, Z = np.eye(3)
G = 9.81
FINE = {"rtol": 1e-10, "atol": 1e-12}
SLOW = pytest.mark.slow
UNBORNE = pytest.mark.filterwarnings("ignore:.*rubs nothing")
"""Moments that friction without a length does not ask for."""


def block(mass=2.0, inertia=0.01):
    return mg.Link("block", mass=mass, center=(0, 0, 0), inertia=inertia * np.eye(3))


def slide(*loads, mass=2.0, swapped=False, planar=False, along=X, **friction):
    """A block on a rough slide, on a spring of 40 N/m from a point to one side of it."""
    a, b = ("block", "frame") if swapped else ("frame", "block")
    pair = mg.Pair("A", "P", a, b, point=(0, 0, 0), axis=along)
    spring, dry = (
        mg.Spring(freedom="A", stiffness=40.0),
        mg.Friction("A", on="a" if swapped else "b", **{"mu": 0.1, **friction}),
    )
    return mg.Mechanism(
        "slide",
        [mg.Link("frame"), block(mass)],
        [pair],
        loads=[mg.Gravity((0, -G, 0)), spring, dry, *loads],
        planar=planar,
    )


@pytest.mark.parametrize(
    "more", [{"planar": True}, *(pytest.param(more, marks=SLOW) for more in ({}, {"swapped": True}))]
)
def test_a_mass_on_a_spring_loses_2_mu_N_over_k_a_half_swing(more):
    """Turning points lie at 0.3 less so much each, half a period apart, until one is in the dead band, where it stays for good."""
    d, half = 0.1 * 2.0 * G / 40.0, np.pi / np.sqrt(20.0)
    r = mg.respond(slide(**more), np.linspace(0, 2.6, 27), start={"A": 0.3}, **FINE)
    assert [str(one).split(" at ")[0] for one in r.events] == ["A reverses"] * 2 + ["A sticks"]
    np.testing.assert_allclose([one.t for one in r.events], half * np.arange(1, 4), atol=1e-7)
    n = np.minimum(np.floor(r.t / half), 3)
    side, size = (-1.0) ** n, 0.3 - 2 * n * d
    moving = side * (d + (size - d) * np.cos(np.sqrt(20.0) * (r.t - n * half)))
    np.testing.assert_allclose(r["A"].position[:, 0], np.where(n < 3, moving, side * size), atol=1e-8)
    # nothing creeps
    assert np.ptp(r["A"].position[r.t > 2.2]) == 0.0
    assert np.abs(r.energy.balance).max() < 1e-8
    lost = 20.0 * (0.3**2 - size[-1] ** 2)
    assert r.energy.friction[-1] == pytest.approx(lost, rel=1e-8)
    assert r.energy.work[-1] == pytest.approx(-lost, rel=1e-8)
    assert r.energy.impact[-1] == 0.0
    np.testing.assert_allclose(r["A"].normal_forces[..., 0], 2.0 * G, rtol=1e-12)
    np.testing.assert_allclose(r["A"].friction[r.t > 2.2, 0], 40.0 * r["A"].position[-1, 0], rtol=1e-9)
    # 1.962 N against the motion while it slips: to the left at first
    np.testing.assert_allclose(r["A"].friction[:7, 0], 0.1 * 2.0 * G, rtol=1e-12)


@UNBORNE
@pytest.mark.parametrize("on", ["b", "a"])
def test_a_moment_that_rubs_nothing_is_that_about_the_marker_that_is_named(on):
    """A block 0.5 beside the marker of its guide: about its own marker there is no moment, about that of the guide m g 0.5."""
    loads = [mg.Gravity((0, -G, 0)), mg.Friction("A", mu=0.1, on=on)]
    s = mg.solve(slide().replace(loads=loads, drives=["A"]), {"A": mg.Motion([0.0, 0.5])})
    said = [str(one) for one in s.warnings if "rubs nothing" in str(one)]
    assert (len(said) == 1 and "up to 9.81 " in said[0]) if on == "a" else not said


def test_friction_of_nothing_is_no_friction():
    r, free = (mg.respond(slide(mu=mu), [0, 0.1, 0.3], start={"A": 0.5}, **FINE) for mu in (1e-12, 0.0))
    np.testing.assert_allclose(r["A"].position[:, 0], 0.5 * np.cos(np.sqrt(20.0) * r.t), atol=1e-9)
    np.testing.assert_allclose(free["A"].position[:, 0], 0.5 * np.cos(np.sqrt(20.0) * r.t), atol=1e-9)


@pytest.mark.parametrize(("angle", "stays"), [(0.25, True), (0.35, False)])
def test_a_block_pushed_up_a_slope_stays_or_comes_back(angle, stays):
    """Up with g (sin + mu cos) against it, down with g (sin - mu cos), from tan(angle) = mu = 0.3 on."""
    along, mu, v = (np.cos(angle), np.sin(angle), 0), 0.3, 2.0
    pair = mg.Pair("A", "P", "frame", "block", point=(0, 0, 0), axis=along)
    m = mg.Mechanism(
        "slope", [mg.Link("frame"), block()], [pair], loads=[mg.Gravity((0, -G, 0)), mg.Friction("A", mu=mu)]
    )
    r = mg.respond(m, [0, 1.0, 1.5], rates={"A": v}, **FINE)
    up, down = (G * (np.sin(angle) + s * mu * np.cos(angle)) for s in (1, -1))
    assert r.events[0].t == pytest.approx(v / up, abs=1e-9)
    assert str(r.events[0]).startswith("A sticks" if stays else "A reverses")
    back = 0.0 if stays else 0.5 * down * (1.5 - v / up) ** 2
    assert r["A"].position[-1, 0] == pytest.approx(v * v / up / 2 - back, abs=1e-9)


@pytest.mark.daily(1)
@pytest.mark.parametrize("swapped", [False, True])
def test_a_pendulum_on_a_journal(swapped):
    """L q'' + g sin q = -+ rho |g cos q + L w^2| / sqrt(L^2 - rho^2): the reaction is tangent to the friction circle and meets the mass."""
    L, mu, radius = 0.5, 0.3, 0.06
    rho = radius * np.sin(np.arctan(mu))
    a, b = ("bob", "frame") if swapped else ("frame", "bob")
    sign = -1.0 if swapped else 1.0
    pin = mg.Pair("A", "R", a, b, point=(0, 0, 0), axis=Z)
    bob = mg.Link("bob", mass=3.0, center=(0, -L, 0))
    m = mg.Mechanism(
        "pendulum",
        [mg.Link("frame"), bob],
        [pin],
        loads=[mg.Gravity((0, -G, 0)), mg.Friction("A", mu=mu, radius=radius)],
    )
    r = mg.respond(m, (0, 4), start={"A": sign * 0.25}, **FINE)

    def swing(q, sense):
        """The turning point after one, with the time that it takes."""

        def rates(t, y):
            couple = rho * abs(G * np.cos(y[0]) + L * y[1] ** 2) / np.sqrt(L * L - rho * rho)
            return [y[1], -(G * np.sin(y[0]) + sense * couple) / L]

        def turn(t, y):
            return y[1] if t > 0.1 else sense

        turn.terminal = True
        found = solve_ivp(rates, (0, 3), [q, 0.0], method="DOP853", rtol=1e-12, atol=1e-13, events=turn)
        return found.t_events[0][0], found.y_events[0][0][0]

    t, q, times, sense = 0.0, 0.25, [], -1.0
    while abs(q) > np.arcsin(rho / L):
        step, q = swing(q, sense)
        t, sense = t + step, -sense
        times.append(t)
    np.testing.assert_allclose([one.t for one in r.events], times, atol=1e-7)
    assert str(r.events[-1]).startswith("A sticks")
    assert r["A"].position[-1, 0] == pytest.approx(sign * q, abs=1e-8)
    assert abs(q) < np.arcsin(rho / L)
    assert np.abs(r.energy.balance).max() < 1e-7


def belt(mu, static, v, units=None):
    """A mass on a spring, on a belt that is driven at a speed; its friction is that between mass and belt."""
    links = [mg.Link("frame"), mg.Link("belt"), block(1.0)]
    pairs = [
        mg.Pair("D", "P", "frame", "belt", point=(0, 0, 0), axis=X),
        mg.Pair("A", "P", "belt", "block", point=(0, 0, 0), axis=X),
    ]
    spring = mg.Spring("frame", "block", (-50.0, 0, 0), (0, 0, 0), stiffness=25.0, free_length=50.0)
    loads = [mg.Gravity((0, -G, 0)), spring, mg.Friction("A", mu=mu, static=static)]
    return mg.Mechanism("belt", links, pairs, loads=loads), {"D": lambda t: (v * t, v, 0.0)}


def test_a_mass_on_a_belt_sticks_and_slips():
    """It sticks for 2 d / v and slips for 2 (pi - atan(d w / v)) / w, d = (static - mu) N / k."""
    mu, static, v, w = 0.1, 0.3, 0.25, 5.0
    m, motions = belt(mu, static, v)
    r = mg.respond(m, (0, 2.0), motions=motions, **FINE)
    d = (static - mu) * G / 25.0
    names = [str(one).split(" at ")[0] for one in r.events]
    assert names == ["A slips", "A sticks", "A slips"]
    t = np.array([one.t for one in r.events])
    # from the middle on at first: static N / k at the speed of the belt
    assert t[0] == pytest.approx(static * G / 25.0 / v, abs=1e-7)
    np.testing.assert_allclose(t[1] - t[0], 2 * (np.pi - np.arctan(d * w / v)) / w, atol=1e-7)
    np.testing.assert_allclose(t[2] - t[1], 2 * d / v, atol=1e-7)
    assert np.abs(r.energy.balance).max() < 1e-7


def screw(mu, cut):
    """A lift: a motor turns a spindle whose nut carries 400 N up, until it is cut off; the spindle has inertia, the nut mass."""
    links = [
        mg.Link("frame"),
        mg.Link("spindle", mass=1.0, center=(0, 0, 0), inertia=np.diag([0.01, 0.01, 0.002])),
        mg.Link("nut", mass=40.0, center=(0, 0, 0), inertia=0.1 * np.eye(3)),
    ]
    pairs = [
        mg.Pair("M", "R", "frame", "spindle", point=(0, 0, 0), axis=Z),
        mg.Pair("A", "H", "spindle", "nut", point=(0, 0, 0), axis=Z, pitch=PITCH),
        mg.Pair("D", "P", "frame", "nut", point=(0, 0, 0), axis=Z),
    ]
    motor = mg.Effort("M", lambda pose, twist, t: np.where(t < cut, -5.0, 0.0), breaks=[cut])
    loads = [mg.Gravity((0, 0, -G)), motor, mg.Friction("A", mu=mu, radius=RADIUS)]
    return mg.Mechanism("lift", links, pairs, loads=loads)


PITCH, RADIUS = 0.004, 0.012


@pytest.mark.daily(1)
@pytest.mark.parametrize(("mu", "stays"), [(0.15, False), (0.4, True)])
def test_a_screw_whose_motor_is_cut_off(mu, stays):
    """The nut rises against r Q tan(lead + phi); it stops, and stays where lead < phi, or runs back against r Q tan(lead - phi).

    The nut does not turn: the spindle turns against it by -q where it rises by pitch q; Q = m (g + z'').
    """
    cut, mass, inertia = 0.2, 40.0, 0.002
    lead, phi = np.arctan(PITCH / RADIUS), np.arctan(mu)
    r = mg.respond(screw(mu, cut), [0.0, cut, 0.5], **FINE)

    def acceleration(couple, way):
        arm = RADIUS * np.tan(lead + way * phi)
        # J a = couple - arm m (g + pitch a)
        return (couple - arm * mass * G) / (inertia + arm * mass * PITCH)

    speed = acceleration(5.0, 1) * cut
    stop = cut - speed / acceleration(0.0, 1)
    assert str(r.events[0]).split(" at ")[0] == ("A sticks" if stays else "A reverses")
    assert len(r.events) == 1
    assert r.events[0].t == pytest.approx(stop, abs=1e-7)
    top = 0.5 * speed * stop
    back = 0.0 if stays else 0.5 * acceleration(0.0, -1) * (0.5 - stop) ** 2
    assert (lead < phi) == stays
    assert abs(r["M"].position[-1, 0]) == pytest.approx(top + back, rel=1e-8)
    assert r["D"].position[-1, 0] == pytest.approx(PITCH * (top + back), rel=1e-8)
    assert np.abs(r.energy.balance).max() < 1e-8


def stack(push, *, low=0.1, up=0.3):
    """A block of 1 kg on one of 2 kg on the ground, the lower one pushed."""
    links = [mg.Link("frame"), *(mg.Link(n, m, (0, 0, 0), 0.01 * np.eye(3)) for n, m in (("low", 2.0), ("up", 1.0)))]
    pairs = [
        mg.Pair("A", "P", "frame", "low", point=(0, 0, 0), axis=X),
        mg.Pair("B", "P", "low", "up", point=(0, 0, 0), axis=X),
    ]
    force = mg.Wrench("low", force=(push, 0, 0), point=(0, 0, 0))
    loads = [mg.Gravity((0, -G, 0)), force, mg.Friction("A", mu=low), mg.Friction("B", mu=up)]
    return mg.Mechanism("stack", links, pairs, loads=loads)


@pytest.mark.daily(2)
@UNBORNE
@pytest.mark.parametrize(
    ("push", "lower", "upper"), [(2.0, 0.0, 0.0), (5.0, (5 - 0.3 * G) / 3, 0.0), (20.0, (20 - 0.6 * G) / 2, 0.3 * G)]
)
def test_of_two_blocks_none_slips_or_one_or_both(push, lower, upper):
    """Which stick and which slip at rest: none below 0.1 (3 g), both together up to 0.3 g, the upper one less above."""
    r = mg.respond(stack(push), [0.0, 0.2], **FINE)
    assert r["A"].acceleration[-1, 0] == pytest.approx(lower, abs=1e-10)
    assert r["B"].acceleration[-1, 0] == pytest.approx(upper - lower if push > 6 else 0.0, abs=1e-10)
    assert r["A"].friction[-1, 0] == pytest.approx(-min(push, 0.3 * G), rel=1e-10)
    assert r["B"].friction[-1, 0] == pytest.approx(upper if push > 6 else lower, abs=1e-10)


@UNBORNE
def test_two_blocks_come_to_rest_one_after_the_other():
    """The upper one slows by 0.3 g, while the lower one goes on, pulled as much forward as back; then both slow by 0.1 g."""
    r = mg.respond(stack(0.0), [0.0, 3.0], rates={"A": 1.0, "B": 2.0}, **FINE)
    assert [str(one).split(" at ")[0] for one in r.events] == ["B sticks", "A sticks"]
    first = 2.0 / (0.3 * G)
    np.testing.assert_allclose([one.t for one in r.events], [first, first + 1.0 / (0.1 * G)], atol=1e-8)
    np.testing.assert_allclose(r["A"].position[-1, 0], first + 0.5 / (0.1 * G), atol=1e-8)
    assert r.energy.friction[-1] == pytest.approx(0.5 * 2.0 + 0.5 * 9.0, rel=1e-9)


def test_a_block_rebounds_from_a_stop_with_friction():
    """In and back by 0.2 g; what is lost is split into impact and friction."""
    pair = mg.Pair("A", "P", "frame", "block", point=(0, 0, 0), axis=X)
    m = mg.Mechanism(
        "slide", [mg.Link("frame"), block()], [pair], loads=[mg.Gravity((0, -G, 0)), mg.Friction("A", mu=0.2)]
    )
    r = mg.respond(m, [0.0, 2.0], rates={"A": 2.0}, stops=mg.Stop("A", upper=0.5, restitution=0.6), **FINE)
    v = np.sqrt(4 - 0.2 * G)
    back = (0.6 * v) ** 2 / (0.4 * G)
    assert [str(one).split(" at ")[0] for one in r.events] == ["A meets its upper stop", "A sticks"]
    assert r["A"].position[-1, 0] == pytest.approx(0.5 - back, abs=1e-9)
    assert r.energy.impact[-1] == pytest.approx(0.64 * v * v, rel=1e-9)
    assert r.energy.friction[-1] == pytest.approx(0.4 * G * (0.5 + back), rel=1e-9)


def slider_crank(planar):
    r, l = 0.05, 0.15
    at = {"A": (0, 0, 0), "B": (r, 0, 0), "C": (r + l, 0, 0), "D": (r + l, 0, 0)}
    ends = {"A": ("frame", "crank"), "B": ("crank", "rod"), "C": ("rod", "piston"), "D": ("frame", "piston")}
    pairs = [mg.Pair(n, "P" if n == "D" else "R", *ends[n], point=at[n], axis=X if n == "D" else Z) for n in at]
    masses = {"crank": (1.0, r / 2), "rod": (0.5, r + l / 2), "piston": (0.8, r + l)}
    links = [mg.Link("frame"), *(mg.Link(n, m, (c, 0, 0), 1e-4 * np.eye(3)) for n, (m, c) in masses.items())]
    dry = [mg.Friction(n, mu=0.1, radius=0.01) for n in "ABC"] + [mg.Friction("D", mu=0.1)]
    return mg.Mechanism("slider-crank", links, pairs, loads=[mg.Gravity((0, -G, 0)), *dry], planar=planar)


@UNBORNE
@pytest.mark.parametrize("planar", [True, pytest.param(False, marks=SLOW)])
def test_a_slider_crank_rough_everywhere_runs_out(planar):
    """Its accelerations are those at which `solve`, given the same motion with its friction, needs no effort at the crank."""
    m = slider_crank(planar)
    r = mg.respond(m, (0, 0.26), rates={"A": 30.0}, rtol=1e-7, atol=1e-9)
    assert np.abs(r.energy.balance).max() < 1e-6 * r.energy.kinetic.max()
    # where the slider is at its dead point `solve` knows no way in which it is about to go
    early = (r.t > 0.0) & (r.t < r.events[0].t)
    crank = r["A"]
    motion = mg.Motion(
        crank.position[early, 0], velocity=crank.velocity[early, 0], acceleration=crank.acceleration[early, 0]
    )
    s = mg.solve(m.replace(drives=["A"]), {"A": motion})
    assert np.abs(s["A"].effort).max() < 1e-8 * np.abs(s["A"].friction).max()
    np.testing.assert_allclose(s["B"].friction, r["B"].friction[early], rtol=1e-6, atol=1e-9)
    # at rest all four stick together, and share the load as they like
    assert {str(one).split(" at ")[0] for one in r.events} == {f"{name} sticks" for name in "ABCD"}
    assert r.status[-1] == "friction not determined"
    assert np.isnan(r["A"].force[-1]).all()
    assert np.isfinite(r["A"].position).all()


def test_units_change_nothing():
    m = slide().replace(units={"length": "m", "mass": "kg", "time": "s"})
    r = mg.respond(m, [0.0, 0.5, 0.75], start={"A": 0.5}, **FINE)
    q = mg.respond(m.to_units(length="mm", mass="g", time="ms"), [0.0, 500.0, 750.0], start={"A": 500.0}, **FINE)
    np.testing.assert_allclose([one.t for one in q.events], [1000 * one.t for one in r.events], rtol=1e-9)
    np.testing.assert_allclose(q["A"].position, 1000 * r["A"].position, atol=1e-5)
    np.testing.assert_allclose(q.energy.friction, 1e3 * r.energy.friction, rtol=1e-7)


LOOSE = {"rtol": 1e-9, "atol": 1e-11}


def alone(kind, *loads, gravity=(0, 0, -G), **more):
    """A body of 2 kg on one pair at its center."""
    pair = mg.Pair("A", kind, "frame", "block", point=(0, 0, 0), **more)
    return mg.Mechanism("one", [mg.Link("frame"), block()], [pair], loads=[mg.Gravity(gravity), *loads])


def followed(rates, y, t):
    return solve_ivp(lambda t, y: rates(y), (0, t[-1]), y, t_eval=t, method="DOP853", rtol=1e-11, atol=1e-12).y.T


def test_a_puck_that_slides_and_spins_on_a_slope():
    """One force mu N against (v, r w) at its center: it slides on for long while it spins."""
    mu, r, push = 0.2, 0.05, 2.0
    m = alone("E", mg.Friction("A", mu=mu, radius=r), gravity=(push, 0, -G), axis=Z)
    found = mg.respond(m, np.linspace(0, 0.4, 5), rates={"A.Tx": -0.3, "A.Ty": 0.5, "A.Rz": 4.0}, **LOOSE)

    def rates(y):
        part = mu * G / np.linalg.norm([y[0], y[1], r * y[2]])
        return [push - part * y[0], -part * y[1], -part * 2.0 * r * r * y[2] / 0.01]

    np.testing.assert_allclose(found["A"].velocity, followed(rates, [-0.3, 0.5, 4.0], found.t), atol=1e-8)
    assert np.abs(found.energy.balance).max() < 1e-9


def test_a_turning_shaft_creeps_along_its_bearing():
    """A force far below mu N moves it as it turns: one force of friction for both."""
    mu, r, push = 0.2, 0.02, 1.0
    m = alone("C", mg.Friction("A", mu=mu, radius=r, model="total"), mg.Effort("A.Tz", push), axis=X)
    found = mg.respond(m, np.linspace(0, 0.2, 5), rates={"A.Rz": 60.0}, **LOOSE)

    def rates(y):
        part = mu * 2.0 * G / np.hypot(r * y[0], y[1])
        return [-part * r * r * y[0] / 0.01, (push - part * y[1]) / 2.0]

    np.testing.assert_allclose(found["A"].velocity, followed(rates, [60.0, 0.0], found.t), atol=1e-7)
    still = mg.respond(m, [0.0, 0.1])
    assert not still["A"].position.any()
    assert still["A"].friction[-1, 1] == pytest.approx(-push, rel=1e-12)


def test_a_ball_comes_to_rest_in_its_socket():
    """It slows by rho m g / J, whatever its axis, and stays as it then stands."""
    mu, r, w = 0.3, 0.05, np.array([1.0, -2.0, 0.5])
    found = mg.respond(
        alone("S", mg.Friction("A", mu=mu, radius=r)),
        [0.0, 0.05, 0.4, 0.5],
        rates=dict(zip(("A.Rx", "A.Ry", "A.Rz"), w, strict=True)),
        **LOOSE,
    )
    couple = r * np.sin(np.arctan(mu)) * 2.0 * G
    assert [str(one).split(" at ")[0] for one in found.events] == ["A sticks"]
    assert found.events[0].t == pytest.approx(np.linalg.norm(w) / (couple / 0.01), abs=1e-8)
    np.testing.assert_allclose(found["A"].friction[1], -couple * w / np.linalg.norm(w), rtol=1e-8)
    assert not found["A"].velocity[2:].any()
    assert np.ptp(found.link("block").pose[2:], axis=0).max() == 0.0


@pytest.mark.parametrize(("part", "stays"), [(0.99, True), (1.01, False)])
def test_a_cross_holds_a_pendulum_by_either_pin(part, stays):
    """Below asin(rho / L) it stays; the other pin then sticks too."""
    L, mu, r = 0.3, 0.2, 0.03
    angle = np.arcsin(part * r * np.sin(np.arctan(mu)) / L)
    m = alone("U", mg.Friction("A", mu=mu, radius=r), axis=X, second=Y)
    m = m.replace(links=[m.links[0], mg.Link("block", mass=2.0, center=(0, 0, -L), inertia=0.01 * np.eye(3))])
    first, second = m.freedom_names()
    found = mg.respond(m, [0.0, 0.05], start={first: angle})
    assert (found["A"].position[-1, 0] == found["A"].position[0, 0]) == stays
    assert abs(found["A"].position[-1, 1]) < 1e-12


def test_a_point_on_a_plane_slides_round_and_lands():
    """On a slope its way bends; where it lands mu times the normal impulse slows it."""
    mu, push, v = 0.25, 0.5, np.array([0.6, 0.8])
    contact = {"axis": Z, "closed": "force", "restitution": 0.5}
    m = alone("Sp", mg.Friction("A", mu=mu), gravity=(push, 0, -G), **contact)
    found = mg.respond(m, np.linspace(0, 0.4, 5), rates={"A.Tx": v[0], "A.Ty": v[1]}, **LOOSE)

    def rates(y):
        return [push - mu * G * y[0] / np.hypot(*y), -mu * G * y[1] / np.hypot(*y)]

    np.testing.assert_allclose(found["A"].velocity[:, :2], followed(rates, v, found.t), atol=1e-8)
    lands = alone("Sp", mg.Friction("A", mu=mu), **contact, gap=0.1)
    strike = mg.respond(lands, (0, 0.2), rates={"A.Tx": v[0], "A.Ty": v[1]}, **LOOSE).events[0]
    normal = 2.0 * 1.5 * np.sqrt(2 * G * 0.1)
    np.testing.assert_allclose(strike.impulses["A"][3:], [*(-mu * normal * v), normal], rtol=1e-8)


@SLOW
def test_a_point_that_slides_round_stops_for_good():
    mu, push = 0.25, 0.5
    m = alone("Sp", mg.Friction("A", mu=mu), gravity=(push, 0, -G), axis=Z, closed="force", restitution=0.5)
    r = mg.respond(m, [0.0, 0.5, 0.6], rates={"A.Tx": 0.6, "A.Ty": 0.8}, **LOOSE)

    def stop(t, y):
        return np.hypot(*y) - 1e-9

    def rates(t, y):
        return [push - mu * G * y[0] / np.hypot(*y), -mu * G * y[1] / np.hypot(*y)]

    stop.terminal = True
    end = solve_ivp(rates, (0, 1), [0.6, 0.8], method="DOP853", rtol=1e-11, atol=1e-13, events=stop).t_events[0][0]
    assert str(r.events[-1]).startswith("A sticks")
    assert r.events[-1].t == pytest.approx(end, abs=1e-7)
    assert np.ptp(r["A"].position[1:, :2], axis=0).max() == 0.0


@pytest.mark.parametrize(("push", "brake"), [(3.0, 1.0), (0.0, 1.0)])
def test_gears_lose_what_their_efficiency_leaves(push, brake):
    """J_p a = T - T_p, J_w a / u = eta T_p u - B, or the other way where power goes back; it goes from the heavier wheel to the brake."""
    eta, u, low, high = 0.9, 2.0, 0.002, 0.02
    at = {"p": (0.0, low), "w": (0.06, high)}
    links = [mg.Link("frame"), *(mg.Link(n, 1.0, (x, 0, 0), j * np.eye(3)) for n, (x, j) in at.items())]
    pairs = [mg.Pair(n, "R", "frame", n, point=(x, 0, 0), axis=Z) for n, (x, _) in at.items()]
    loads = [mg.Effort("p", push), mg.Effort("w", brake), mg.Friction("t", efficiency=eta)]
    teeth = mg.SpurGears("t", "p", "w", teeth=(20, 40), module=0.002)
    m = mg.Mechanism("stage", links, pairs, couplings=[teeth], loads=loads)
    r = mg.respond(m, (0, 0.1), rates={"p": 5.0}, **LOOSE)

    def acceleration(part):
        return (push - brake / (part * u)) / (low + high / (part * u * u))

    assert r["p"].acceleration[1, 0] == pytest.approx(acceleration(eta), rel=1e-10)
    if not push:
        assert str(r.events[0]).startswith("t reverses")
        assert r["p"].acceleration[-1, 0] == pytest.approx(acceleration(1 / eta), rel=1e-10)
    assert r.energy.friction[-1] > 0
    assert np.abs(r.energy.balance).max() < 1e-12
    motion = mg.Motion(r["p"].position[:, 0], velocity=r["p"].velocity[:, 0], acceleration=r["p"].acceleration[:, 0])
    s = mg.solve(m.replace(drives=["p"]), {"p": motion})
    moves = np.abs(r["p"].velocity[:, 0]) > 1e-6
    np.testing.assert_allclose(r.coupling("t").loss[moves], s.coupling("t").loss[moves], rtol=1e-9)
    np.testing.assert_allclose(r["w"].force[moves], s["w"].force[moves], rtol=1e-9, atol=1e-9)


@UNBORNE
def test_six_blocks_on_each_other_decide_at_once_which_slip():
    """Accelerations in which they are least: min |f - B^T friction| with friction within its limits (Gauss)."""
    n, push, mu = 6, 12.0, np.array([0.02, 0.1, 0.1, 0.1, 0.1, 0.1])
    links = [mg.Link("frame"), *(block(1.0).replace(name=f"b{i}") for i in range(n))]
    names = [link.name for link in links]
    pairs = [mg.Pair(f"A{i}", "P", names[i], names[i + 1], point=(0, 0, 0), axis=X) for i in range(n)]
    dry = [mg.Friction(f"A{i}", mu=one) for i, one in enumerate(mu)]
    force = mg.Wrench("b2", force=(push, 0, 0), point=(0, 0, 0))
    r = mg.respond(mg.Mechanism("stack", links, pairs, loads=[mg.Gravity((0, -G, 0)), force, *dry]), [0, 0.02])
    B, most = np.eye(n) - np.eye(n, k=-1), mu * G * np.arange(n, 0, -1)
    f = push * (np.arange(n) == 2)
    a = f - B.T @ lsq_linear(B.T, f, (-most, most), tol=1e-14).x
    np.testing.assert_allclose([r[f"A{i}"].acceleration[0, 0] for i in range(n)], B @ a, atol=1e-9)


def test_a_puck_without_a_radius_is_refused():
    with pytest.raises(mg.DeclarationError, match="give the radius="):
        mg.respond(alone("E", mg.Friction("A", mu=0.1), axis=Z), (0, 1))


@pytest.mark.parametrize("begun", [np.greater, np.greater_equal])
def test_a_block_that_sticks_is_pushed_off_at_once(begun):
    """Whether a pulse of force has its new value at the break itself or only behind it; friction held the block there without any load."""
    push = mg.Effort("A", lambda q, v, t: np.where(begun(t, 0.5), 60.0, 0.0), breaks=[0.5])
    slide = mg.Pair("A", "P", "frame", "block", point=(0, 0, 0), axis=(1, 0, 0))
    links = [mg.Link("frame"), mg.Link("block", 2.0, (0, 0, 0))]
    m = mg.Mechanism("slide", links, [slide], loads=[mg.Gravity((0, 0, -9.81)), push, mg.Friction("A", mu=0.2)])
    r = mg.respond(m, [0.0, 0.5, 0.52])
    assert [str(one).split(" at t")[0] for one in r.events] == ["A slips"]
    assert r.events[0].t == pytest.approx(0.5, abs=1e-11)
    assert r["A"].position[-1, 0] == pytest.approx(0.5 * (30.0 - 0.2 * 9.81) * 0.02**2, rel=1e-9)
