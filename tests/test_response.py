"""Motion in time against closed forms, equations written by hand and integrated by themselves, and identities of mechanics."""

import numpy as np
import pytest
import scipy

import mechgraph as mg

X, Y, Z = np.eye(3)
G = 9.81
DOWN = mg.Gravity((0, -G, 0))


def rod(name, p, q, mass=1.0):
    """A slender rod between two points."""
    p, q = np.array(p, dtype=float), np.array(q, dtype=float)
    d = q - p
    return mg.Link(name, mass=mass, center=(p + q) / 2, inertia=mass * (d @ d * np.eye(3) - np.outer(d, d)) / 12)


def pendulum(loads=()):
    """A1: point mass 1 kg on a massless bar of 1 m, released level."""
    links = [mg.Link("frame"), mg.Link("bob", mass=1.0, center=(-1, 0, 0))]
    return mg.Mechanism(
        "pendulum", links, [mg.Pair("A", "R", "frame", "bob", point=(0, 0, 0), axis=Z)], loads=[DOWN, *loads]
    )


def beside_a_block(m):
    """With a block that slides beside it: two freedoms, so that the motion is followed in charts and not along a path."""
    block = mg.Link("block", mass=1.0, center=(0, 0, 0), inertia=np.eye(3))
    slide = mg.Pair("slide", "P", m.frame, "block", point=(0, 0, 0), axis=X)
    return m.replace(links=[*m.links, block], pairs=[*m.pairs, slide])


def windows(n, loads=()):
    """A2: n four-bars in a row, rods of 1 m and 1 kg."""
    links = [mg.Link("frame"), *(rod(f"c{i}", (i, 0, 0), (i, 1, 0)) for i in range(n + 1))]
    links += [rod(f"r{i}", (i, 1, 0), (i + 1, 1, 0)) for i in range(n)]
    pairs = [mg.Pair(f"A{i}", "R", "frame", f"c{i}", point=(i, 0, 0), axis=Z) for i in range(n + 1)]
    for i in range(n):
        pairs.append(mg.Pair(f"B{i}", "R", f"c{i}", f"r{i}", point=(i, 1, 0), axis=Z))
        pairs.append(mg.Pair(f"C{i}", "R", f"r{i}", f"c{i + 1}", point=(i + 1, 1, 0), axis=Z))
    return mg.Mechanism("windows", links, pairs, loads=[DOWN, *loads])


def bricard():
    """A4: five rods of 1 m and 1 kg along the edges of a cube, six revolutes."""
    points = [(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)]
    links = [mg.Link("l0"), *(rod(f"l{k + 1}", points[k], points[k + 1]) for k in range(5))]
    axes = [Y, Z, X, Y, Z, X]
    pairs = [mg.Pair(f"J{k}", "R", f"l{k}", f"l{(k + 1) % 6}", point=points[k], axis=axes[k]) for k in range(6)]
    return mg.Mechanism("Bricard", links, pairs, loads=[DOWN])


def slider_crank():
    """Haug's spatial slider-crank: A revolute, B spherical, C universal, D prismatic."""
    a, b, c = np.array((0, 0.1, 0.12)), np.array((0, 0.1, 0.2)), np.array((0.2, 0, 0))
    u = (c - b) / np.linalg.norm(c - b)
    links = [
        mg.Link("frame"),
        mg.Link("crank", mass=0.12, center=(a + b) / 2, inertia=np.diag([1e-4, 1e-4, 1e-5])),
        mg.Link("rod", mass=0.5, center=(b + c) / 2, inertia=4e-3 * np.eye(3) - 3.6e-3 * np.outer(u, u)),
        mg.Link("slider", mass=2.0, center=c, inertia=1e-4 * np.eye(3)),
    ]
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=a, axis=X),
        mg.Pair("B", "S", "crank", "rod", point=b),
        mg.Pair("C", "U", "slider", "rod", point=c, axis=X, second=np.cross(X, u)),
        mg.Pair("D", "P", "frame", "slider", point=c, axis=X),
    ]
    return mg.Mechanism("slider-crank", links, pairs, loads=[mg.Gravity((0, 0, -G))])


@pytest.mark.daily(2)
@pytest.mark.parametrize("make", [pendulum, lambda: beside_a_block(pendulum())])
def test_pendulum_swings_as_the_elliptic_functions_say(make):
    """sin(theta / 2) = k sn(K - w t), k = sin(45 deg), from level."""
    period = 2.36784194757624
    t = np.linspace(0, period, 50)
    r = mg.respond(make(), t, rtol=1e-11, atol=1e-13)
    k2, w = 0.5, np.sqrt(G)
    sn, cn, dn, _ = scipy.special.ellipj(scipy.special.ellipk(k2) - w * t, k2)
    below = -2 * np.arcsin(np.sqrt(k2) * sn)  # from the vertical below, counter-clockwise: -90 deg at the start
    np.testing.assert_allclose(r["A"].position[:, 0], below + np.pi / 2, atol=2e-10)
    np.testing.assert_allclose(r["A"].velocity[:, 0], 2 * np.sqrt(k2) * w * cn, atol=2e-9)
    # tension in the bar: weight along it and the centripetal force
    tension = G * np.cos(below) + r["A"].velocity[:, 0] ** 2
    np.testing.assert_allclose(np.linalg.norm(r["A"].force, axis=1), np.abs(tension), atol=1e-8)
    assert np.abs(r.energy.balance).max() < 1e-8
    assert f"t = {t[r.energy.kinetic.argmax()]:.5g}" in str(r.energy)


def exact_windows(n, t):
    """All links translate or turn with the cranks: ((n + 1) / 3 + n) theta'' = -g ((n + 1) / 2 + n) cos theta."""
    inertia, arm = (n + 1) / 3 + n, (n + 1) / 2 + n
    exact = scipy.integrate.solve_ivp(
        lambda t, y: [y[1], -G * arm / inertia * np.cos(y[0])],
        (t[0], t[-1]), [np.pi / 2, -1.0], "DOP853", t, rtol=1e-12, atol=1e-13,
    )  # fmt: skip
    return exact.y[0] - np.pi / 2


@pytest.mark.daily(2)
@pytest.mark.parametrize("n", [1, 3])
@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_windows_pass_their_change_points(n, engine):
    """The cranks turn as their one equation says."""
    t = np.linspace(0, 4, 41)
    r = mg.respond(windows(n), t, rates={"A0": -1.0}, rtol=1e-10, atol=1e-12, engine=engine)
    np.testing.assert_allclose(r["A0"].position[:, 0], exact_windows(n, t), atol=2e-7)
    assert np.abs(r.energy.balance).max() < 1e-7
    assert r.checks.closure.max() < 1e-12
    assert r.engine == engine


def test_rounding_beside_change_points_of_a_long_row_stays_out_of_the_motion():
    """Forty windows and ten seconds; with tabulated accelerations 7e-8 and 4e-10."""
    t = np.linspace(0, 10, 101)
    r = mg.respond(windows(40), t, rates={"A0": -1.0}, rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(r["A0"].position[:, 0], exact_windows(40, t), atol=2e-8)
    assert np.abs(r.energy.balance).max() < 1.5e-10 * r.energy.kinetic.max()


@pytest.mark.slow
def test_spatial_slider_crank_starts_as_printed_and_moves_alone_and_in_charts():
    """Printed initial velocities (rod center, rod angular, slider); two choices of coordinates give one motion."""
    m, t = slider_crank(), np.linspace(0, 1, 21)
    r = mg.respond(m, t, rates={"A": 6.0}, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(r.link("rod").center_velocity[0], [0.12, -0.24, 0], atol=1e-12)
    np.testing.assert_allclose(r.link("rod").angular_velocity[0], [1.92, -0.96, 0.48], atol=1e-12)
    np.testing.assert_allclose(r["D"].velocity[0], 0.24, atol=1e-12)
    charts = mg.respond(beside_a_block(m), t, rates={"A": 6.0}, rtol=1e-10, atol=1e-12)
    for pair in "ABCD":
        np.testing.assert_allclose(charts[pair].position, r[pair].position, atol=1e-7)
        np.testing.assert_allclose(charts[pair].force, r[pair].force, atol=1e-5)


@pytest.mark.parametrize("make", [lambda: windows(1), bricard, slider_crank])
def test_what_moves_by_itself_needs_no_drive(make):
    """Kinetostatics along the response: the effort that drives it so is nothing, and the reactions are the same."""
    m = make()
    driver = m.pairs[0].name
    r = mg.respond(m, np.linspace(0, 0.9, 10), rates={driver: -1.0}, rtol=1e-10, atol=1e-12)
    q = r[driver]
    motion = mg.Motion(q.position[:, 0], velocity=q.velocity[:, 0], acceleration=q.acceleration[:, 0])
    s = mg.solve(m, {driver: motion})
    largest = 10.0  # the weight of a link
    assert np.abs(s[driver].effort).max() < 1e-9 * largest
    for p in m.pairs:
        np.testing.assert_allclose(r[p.name].reaction, s[p.name].reaction, atol=1e-8 * largest)


def test_bricard_keeps_its_energy():
    """One freedom, one redundant constraint, from rest."""
    r = mg.respond(bricard(), (0, 10), rtol=1e-11, atol=1e-13)
    assert np.abs(r.energy.balance).max() < 1e-8 * r.energy.kinetic.max()
    assert r.checks.closure.max() < 1e-12


@pytest.mark.slow
def test_double_pendulum():
    """Two rods, against Lagrange's equations written by hand."""
    links = [mg.Link("frame"), rod("upper", (0, 0, 0), (1, 0, 0)), rod("lower", (1, 0, 0), (2, 0, 0))]
    pairs = [
        mg.Pair("A", "R", "frame", "upper", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "R", "upper", "lower", point=(1, 0, 0), axis=Z),
    ]
    m = mg.Mechanism("double pendulum", links, pairs, loads=[DOWN])

    def by_hand(t, y):
        a, b, u, v = y  # absolute angles and rates
        c, s = np.cos(b - a), np.sin(b - a)
        M = np.array([[1 / 3 + 1, c / 2], [c / 2, 1 / 3]])
        Q = [v * v * s / 2 - 1.5 * G * np.cos(a), -u * u * s / 2 - 0.5 * G * np.cos(b)]
        return [u, v, *np.linalg.solve(M, Q)]

    t = np.linspace(0, 2, 21)
    exact = scipy.integrate.solve_ivp(by_hand, (0, 2), [0.0, 0.4, 1.0, 0.5], "DOP853", t, rtol=1e-11, atol=1e-12)
    r = mg.respond(m, t, start={"B": 0.4}, rates={"A": 1.0, "B": -0.5}, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(r["A"].position[:, 0], exact.y[0], atol=1e-8)
    np.testing.assert_allclose(r["B"].position[:, 0], exact.y[1] - exact.y[0], atol=1e-8)
    assert np.abs(r.energy.balance).max() < 1e-7


@pytest.mark.slow
def test_tumbling_body_keeps_its_angular_momentum():
    """An asymmetric body free about its mass center, near its unstable axis: rotations without a singular place."""
    I = np.diag([1.0, 2.0, 3.0])
    m = mg.Mechanism(
        "body",
        [mg.Link("frame"), mg.Link("body", mass=1.0, center=(0, 0, 0), inertia=I)],
        [mg.Pair("A", "S", "frame", "body", point=(0, 0, 0))],
    )
    r = mg.respond(m, np.linspace(0, 20, 41), rates={"A.Rx": 0.01, "A.Ry": 2.0, "A.Rz": 0.02}, rtol=1e-10, atol=1e-12)
    R, w = r.link("body").pose[:, :3, :3], r.link("body").angular_velocity
    momentum = np.einsum("tij,jk,tlk,tl->ti", R, I, R, w)
    np.testing.assert_allclose(momentum, np.broadcast_to(momentum[0], momentum.shape), atol=1e-7)
    np.testing.assert_allclose(r.energy.kinetic, r.energy.kinetic[0], rtol=1e-8)
    own = np.einsum("tji,tj->ti", R, w)
    assert own[:, 1].min() < -1.9  # it has turned over


@pytest.mark.slow
def test_pendulum_under_a_driven_slide():
    """The slide follows a law of time: theta'' = -(g cos(theta) - x'' sin(theta)) for a rod bob at 1 from level; driver effort by hand."""
    links = [mg.Link("frame"), mg.Link("cart"), mg.Link("bob", mass=2.0, center=(1, 0, 0))]
    pairs = [
        mg.Pair("P", "P", "frame", "cart", point=(0, 0, 0), axis=X),
        mg.Pair("A", "R", "cart", "bob", point=(0, 0, 0), axis=Z),
    ]
    m = mg.Mechanism("cart", links, pairs, loads=[DOWN])
    law = lambda t: (0.3 * np.sin(4 * t), 1.2 * np.cos(4 * t), -4.8 * np.sin(4 * t))
    t = np.linspace(0, 3, 31)
    exact = scipy.integrate.solve_ivp(
        lambda s, y: [y[1], -(G * np.cos(y[0]) - law(s)[2] * np.sin(y[0]))],
        (0, 3), [0.0, 0.5], "DOP853", t, rtol=1e-12, atol=1e-13,
    )  # fmt: skip
    fine = np.linspace(0, 3, 301)
    sampled = mg.Motion(*np.array([law(s) for s in fine]).T, t=fine)
    for motion in (law, sampled):
        r = mg.respond(m, t, rates={"A": 0.5}, motions={"P": motion}, rtol=1e-11, atol=1e-12)
        np.testing.assert_allclose(r["A"].position[:, 0], exact.y[0], atol=1e-7)
        theta, u, a = (r["A"].position[:, 0], r["A"].velocity[:, 0], r["A"].acceleration[:, 0])
        x2 = np.array([law(s)[2] for s in t])
        np.testing.assert_allclose(
            r["P"].effort[:, 0], 2.0 * (x2 - a * np.sin(theta) - u * u * np.cos(theta)), atol=1e-4
        )
        assert np.abs(r.energy.balance).max() < (1e-4 if motion is sampled else 1e-7)


def test_spring_and_damper():
    """m x'' = -k x - c x' in closed form, and the heat in the damper is the work that is missing."""
    links = [mg.Link("frame"), mg.Link("block", mass=2.0, center=(0, 0, 0))]
    m = mg.Mechanism(
        "oscillator",
        links,
        [mg.Pair("P", "P", "frame", "block", point=(0, 0, 0), axis=X)],
        loads=[mg.TorsionSpring("P", stiffness=50.0, damping=3.0)],
    )
    t = np.linspace(0, 4, 41)
    r = mg.respond(m, t, start={"P": 0.2}, rtol=1e-11, atol=1e-13)
    d, w = 3.0 / 4.0, np.sqrt(25.0 - (3.0 / 4.0) ** 2)
    np.testing.assert_allclose(
        r["P"].position[:, 0], 0.2 * np.exp(-d * t) * (np.cos(w * t) + d / w * np.sin(w * t)), atol=1e-9
    )
    np.testing.assert_allclose(r.energy.potential, 25.0 * r["P"].position[:, 0] ** 2, atol=1e-12)
    np.testing.assert_allclose(r.energy.balance, 0.0, atol=1e-9)


def test_any_stepper_and_time_reversal():
    """Every method of scipy follows the same motion; with the rates turned round it goes back."""
    m, t = windows(1), np.array([0.0, 0.5, 1.0])
    r = mg.respond(m, t, rates={"A0": -1.0}, rtol=1e-11, atol=1e-12)
    end = {"A0": float(r["A0"].position[-1, 0])}
    for method in ("RK23", "RK45", "Radau", "BDF", "LSODA"):
        other = mg.respond(m, t, rates={"A0": -1.0}, rtol=1e-6, atol=1e-8, method=method)
        np.testing.assert_allclose(other["A0"].position, r["A0"].position, atol=1e-3)
    back = mg.respond(m, t, start=end, rates={"A0": -float(r["A0"].velocity[-1, 0])}, rtol=1e-11, atol=1e-12)
    assert back["A0"].position[-1, 0] == pytest.approx(0.0, abs=1e-8)


def test_at_other_times():
    """The dense output is closed too."""
    r = mg.respond(windows(1), (0, 2), rates={"A0": -1.0}, rtol=1e-10, atol=1e-12)
    again = r.at(np.array([0.3, 1.7]))
    direct = mg.respond(windows(1), np.array([0.0, 0.3, 1.7]), rates={"A0": -1.0}, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(again["A0"].position, direct["A0"].position[1:], atol=1e-8)
    assert r.at(0.5)["A0"].position.shape == (1,)
    mixed = np.array([0.3, 1.7, 0.31, 0.9, 1.69])  # in any order, from any step
    for name in ("position", "velocity", "force"):
        alone = [getattr(r.at(t)["A0"], name) for t in mixed.tolist()]
        np.testing.assert_allclose(getattr(r.at(mixed)["A0"], name), alone, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(r.at(mixed).energy.work, [r.at(t).energy.work for t in mixed.tolist()], atol=1e-12)
    with pytest.raises(mg.DeclarationError, match="between 0 and 2"):
        r.at(3.0)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"t": 3.0}, "begin, end"),
        ({"t": (1.0, 0.0)}, "rising"),
        ({"rates": {"A0": 1.0, "A1": 2.0}}, "contradict the closure"),
        ({"rates": {"A0": 1.0}, "motions": {"A0": lambda t: (2.0 * t, 2.0, 0.0)}}, "A0"),
        (
            {"start": {"A0": 0.3}, "motions": {"A0": lambda t: (2.0 * t, 2.0, 0.0)}},
            "its motion is prescribed, 0 at t = 0",
        ),
        ({"rates": {"Q": 1.0}}, "unknown freedom"),
        ({"start": {"Q": 1.0}}, "unknown freedom"),
        ({"motions": {"A0": np.zeros(3)}}, "expected a Motion with t"),
        ({"motions": {"A0": mg.Motion(0.0)}}, "has no times"),
        ({"motions": {"A0": lambda t: 0.0}}, "three finite numbers"),
        ({"method": "Euler"}, "DOP853"),
        ({"rtol": 0.0}, "rtol"),
        ({"rates": [1.0]}, "rates = .1.0.: expected a mapping"),
        ({"rates": {"A0": True}}, "rate of 'A0' = True: expected a finite number"),
        ({"start": {"A0": "0.1"}}, "start of 'A0' = '0.1': expected a finite number"),
        ({"loads": DOWN}, "loads = .*: expected a list"),
        ({"loads": [mg.Effort("A0", np.ones(5))]}, "array over positions"),
        ({"events": 3}, "events = 3: expected an Event or a list"),
        ({"engine": "fast"}, "engine = 'fast'"),
        ({"method": "Euler", "stops": 1}, "2 faults"),
        ({"rtol": 2.0, "t": 1}, "2 faults"),
    ],
)
def test_bad_input_is_named(arguments, words):
    """One error, with what was expected."""
    with pytest.raises(mg.DeclarationError, match=words):
        mg.respond(windows(1), **{"t": (0, 1), **arguments})


def test_events_are_found_and_end_the_motion():
    """The pendulum passes its lowest place every half period; the bar's tension reaches 20 N on the way; terminal ones end it there."""
    period = 2.36784194757624
    lowest = mg.Event("A", np.pi / 2)
    r = mg.respond(pendulum(), (0, 2 * period), rtol=1e-11, atol=1e-13, events=[lowest])
    np.testing.assert_allclose([e.t for e in r.events], period * (np.arange(4) / 2 + 0.25), atol=1e-9)
    assert [e.rising for e in r.events] == [True, False, True, False]
    still = mg.Event("A", what="velocity", direction=-1, terminal=True)
    ended = mg.respond(pendulum(), np.linspace(0, 4, 401), rtol=1e-11, atol=1e-13, events=still)
    assert ended.t[-1] == pytest.approx(period / 2, abs=1e-9)
    assert ended["A"].position[-1, 0] == pytest.approx(np.pi, abs=1e-8)
    assert "passes 0 at t" in ended.stopped

    def tension(s):
        return np.linalg.norm(s["A"].force)

    pulled = mg.respond(pendulum(), (0, 2.0), rtol=1e-11, atol=1e-13, events=[mg.Event(tension, 20.0, direction=1)])
    # 3 g sin(angle from level) = 20
    found = pulled.at(pulled.events[0].t)["A"].position[0]
    assert 3 * G * np.sin(found) == pytest.approx(20.0, abs=1e-7)
    with pytest.raises(mg.DeclarationError, match="unknown freedom"):
        mg.respond(pendulum(), (0, 1), events=[mg.Event("Q")])


def test_samples_that_end_too_early():
    """A table that ends before the motion does."""
    motion = mg.Motion(np.linspace(0, 1, 11), velocity=1.0, t=np.linspace(0, 1, 11))
    with pytest.raises(mg.ResponseError, match="its samples end at t = 1") as caught:
        mg.respond(windows(1), (0, 2), motions={"A0": motion})
    assert isinstance(caught.value.__cause__, mg.DeclarationError)


def rotor(loads=(), inertia=1.0):
    links = [mg.Link("frame"), mg.Link("rotor", mass=inertia, center=(0, 0, 0), inertia=inertia * np.eye(3))]
    pairs = [mg.Pair("A", "R", "frame", "rotor", point=(0, 0, 0), axis=Z)]
    return mg.Mechanism("rotor", links, pairs, loads=list(loads))


def test_stiff_loads_on_an_explicit_stepper_are_told_and_lose_nothing():
    """A damper with a time of a microsecond, which Radau passes: a warning where that takes minutes, an end where it takes days."""
    m = rotor([mg.Damper("A", coefficient=1e6), mg.Effort("A", 1.0)])
    taken = []

    def progress(t):
        taken.append(t)
        if len(taken) > 600:
            raise KeyboardInterrupt

    with pytest.warns(mg.MechgraphWarning, match="method='Radau' takes far fewer.*An interrupt keeps"):
        r = mg.respond(m, (0, 2), rates={"A": 1.0}, progress=progress, on_stop="return")
    assert r.t[-1] == taken[-1]
    with pytest.raises(mg.ResponseError, match=r"followed to t = .*Radau") as failed:
        mg.respond(m, (0, 1e5), rates={"A": 1.0})
    assert failed.value.solution.t[-1] > 0.0
    done = mg.respond(m, (0, 1e5), rates={"A": 1.0}, method="Radau", rtol=1e-6)
    assert done["A"].velocity[-1, 0] == pytest.approx(1e-6, rel=1e-4)


def test_a_swing_that_no_stepper_passes_ends_with_a_sentence():
    """A shaft on a spring of 1e12 N m makes half a million swings a second, which are not damped."""
    with pytest.raises(mg.ResponseError, match="more lead to t = 10; something swings or jumps that fast"):
        mg.respond(rotor([mg.TorsionSpring("A", 1e12)]), (0, 10), start={"A": 0.01}, method="Radau")


def test_start_values_that_contradict_each_other_are_named():
    """All cranks of a parallelogram turn alike."""
    with pytest.raises(mg.AssemblyError, match=r"cannot be assembled at A0\.Rz = 0\.1, A1\.Rz = 0\.5"):
        mg.respond(windows(1), (0, 1), start={"A0": 0.1, "A1": 0.5})


def test_a_spring_that_is_wound_up_over_several_turns():
    """I q'' = -k q for any number of turns, though the links are back after each: q = w0 / w sin(w t)."""
    t, k, start = np.linspace(0, 30, 61), 0.1, 5.0
    r = mg.respond(rotor([mg.TorsionSpring("A", stiffness=k)]), t, rates={"A": start}, rtol=1e-11, atol=1e-13)
    w = np.sqrt(k)
    np.testing.assert_allclose(r["A"].position[:, 0], start / w * np.sin(w * t), atol=1e-7)
    assert np.abs(r["A"].position).max() > 2 * np.pi
    assert np.abs(r.energy.balance).max() < 1e-8


@pytest.mark.parametrize("function", [False, True])
def test_loads_along_motions_without_inertia_are_refused(function):
    """And nothing is moved by them in silence: a couple on a massless rotor; a force on a massless link at the end of a heavy one."""
    massless = rotor([mg.Effort("A", (lambda pose, twist, t: 1.0 + 0 * t) if function else 1.0)], 0.0)
    massless = massless.replace(links=[mg.Link("frame"), mg.Link("rotor")])
    links = [*rotor().links, mg.Link("light")]
    pairs = [*rotor().pairs, mg.Pair("B", "R", "rotor", "light", point=(1, 0, 0), axis=Z)]
    tail = mg.Mechanism("tail", links, pairs, loads=[mg.Wrench("light", force=(0, 1.0, 0), point=(2, 0, 0))])
    for m in (massless, tail):
        with pytest.raises(mg.ResponseError, match="one motion has no inertia"):
            mg.respond(m, (0, 1))
    with pytest.raises(mg.ResponseError, match="one motion has no inertia"):
        mg.respond(massless.replace(loads=[]), (0, 1), rates={"A": 1.0})
    # unloaded, what is carried goes along and is not moved
    r = mg.respond(tail.replace(loads=[]), (0, 1), rates={"A": 1.0})
    assert r["A"].velocity[-1, 0] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("loads", [[], [mg.Effort("A", 1.0)], [mg.TorsionSpring("A", stiffness=1.0, free=1.0)]])
def test_a_massless_crank_at_its_dead_point_is_refused_and_beside_it_keeps_the_power(loads):
    """Only the piston has mass: at the dead point nothing says how the crank goes on, there or a rounding beside it."""
    piston = mg.Mechanism("engine", [mg.Link("frame"), mg.Link("crank"), mg.Link("rod"), mg.Link("piston", 3.0, (0.4, 0, 0))], [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z), mg.Pair("B", "R", "crank", "rod", point=(0.1, 0, 0), axis=Z),
        mg.Pair("C", "R", "rod", "piston", point=(0.4, 0, 0), axis=Z),
        mg.Pair("D", "P", "frame", "piston", point=(0.4, 0, 0), axis=(1, 0, 0)),
    ], loads=loads)  # fmt: skip
    for at in (0.0, 1e-9):
        with pytest.raises(mg.ResponseError, match="only links without inertia move in this position"):
            mg.respond(piston, (0, 0.1), start={"A": at}, rates={"A": 8.0})
    r = mg.respond(piston, (0, 0.1), start={"A": 0.3}, rates={"A": 8.0})
    assert np.abs(r.energy.balance).max() < 1e-7 * r.energy.kinetic.max()


def test_a_chain_of_sixty_pendulums_starts_as_lagrange_says():
    """M_ij = m l^2 (n - j - 1/2) cos(a_i - a_j) for j > i, m l^2 (n - i - 2/3) on the diagonal, of absolute angles a; batches agree."""
    n, m, rod_length = 60, 0.1, 0.05
    angles = np.random.default_rng(3).normal(scale=0.5, size=n)
    rates = np.random.default_rng(4).normal(size=n)
    links = [mg.Link("frame")]
    links += [rod(f"l{i}", (rod_length * i, 0, 0), (rod_length * (i + 1), 0, 0), m) for i in range(n)]
    pairs = [mg.Pair(f"A{i}", "R", links[i].name, f"l{i}", point=(rod_length * i, 0, 0), axis=Z) for i in range(n)]
    chain = mg.Mechanism("chain", links, pairs, loads=[DOWN])
    names = [f"A{i}" for i in range(n)]
    r = mg.respond(
        chain, (0, 1e-4), start=dict(zip(names, angles, strict=True)), rates=dict(zip(names, rates, strict=True))
    )
    a, w = np.cumsum(angles), np.cumsum(rates)
    i, j = np.indices((n, n))
    c = m * rod_length**2 * np.where(i == j, n - i - 2 / 3, n - np.maximum(i, j) - 0.5)
    off = a[:, None] - a
    Q = -m * G * rod_length * (n - np.arange(n) - 0.5) * np.cos(a) - (c * np.sin(off)) @ w**2
    expected = np.diff(np.linalg.solve(c * np.cos(off), Q), prepend=0.0)
    found = np.array([r[name].acceleration[0, 0] for name in names])
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())
    again = np.array([r.at(0.0)[name].acceleration[0] for name in names])
    np.testing.assert_allclose(again, found, atol=1e-11 * np.abs(expected).max())


@pytest.mark.slow
def test_the_spin_of_a_rod_between_spheres_is_held_by_a_slotted_one():
    """Free it keeps its spin, a second freedom; slotted it goes along with the crank, on one path. Energy stays in both."""
    free = mg.load("rssr").replace(drives=[])
    held = free.with_pair_type("B", "U")
    t = np.linspace(0, 0.3, 7)
    for m, coordinates in ((free, "in independent freedoms"), (held, "along the path")):
        r = mg.respond(m, t, rates={"A": 2.0}, rtol=1e-10, atol=1e-12)
        assert r.work.coordinates == coordinates
        assert np.abs(r.energy.balance).max() < 1e-8 * r.energy.kinetic.max()
    assert mg.check(free).mobility == mg.check(held).mobility + 1 == 2


def coupled(m):
    """RSSR with a coupler whose center and inertia are off its line, free to move."""
    links = [
        link
        if link.name == m.frame
        else link.replace(mass=1.0, center=(0.1, 0.2, 0.3), inertia=np.diag([0.3, 0.2, 0.1]))
        for link in m.links
    ]
    return m.replace(links=links, drives=[], loads=[mg.Gravity((0, -G, 0))])


def between(r, *names):
    """From the point of one pair to that of another, both of one link, in space."""
    link = r.link("coupler").pose
    pairs = [r.mechanism.pair(name) for name in names]
    p, q = (np.asarray(pair.markers[[pair.a, pair.b].index("coupler")].point) for pair in pairs)
    return link[:, :3, :3] @ (q - p)


@pytest.mark.daily(1)
@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")
def test_passive_freedoms_held_as_in_kinetostatics(engine):
    """The same motion prescribed takes no effort, and the same couple holds the coupler; free, its spin takes energy."""
    m = coupled(mg.load("rssr"))
    given = {"rates": {"A": 3.0}, "rtol": 1e-10, "atol": 1e-12, "engine": engine}
    r = mg.respond(m, np.linspace(0, 0.15, 5), passive="held", **given)
    assert np.abs(r.energy.balance).max() < 1e-9
    a = r["A"]
    motion = mg.Motion(a.position[:, 0], a.velocity[:, 0], a.acceleration[:, 0])
    s = mg.solve(m.replace(drives=["A"]), {"A": motion})
    np.testing.assert_allclose(s["A"].effort, 0.0, atol=1e-10)
    assert np.abs(r.passive_effort["coupler"]).max() > 0.1
    np.testing.assert_allclose(s.passive_effort["coupler"], r.passive_effort["coupler"], atol=1e-10)
    for p in m.pairs:
        np.testing.assert_allclose(s[p.name].force, r[p.name].force, atol=1e-9)
    np.testing.assert_allclose((r.link("coupler").twist[:, :3] * between(r, "B", "C")).sum(axis=1), 0.0, atol=1e-12)
    free = mg.respond(m, np.linspace(0, 0.15, 5), **given)
    assert np.abs(free["A"].position - a.position).max() > 1e-3
    assert not free.warnings


def test_a_held_passive_freedom_that_carries_load_is_said():
    m = coupled(mg.load("rssr"))
    with pytest.warns(mg.MechgraphWarning, match="load-bearing passive freedom"):
        mg.respond(m, (0, 0.1), passive="held")
    with pytest.raises(mg.DeclarationError, match="with the passive freedoms at rest, which lets"):
        mg.respond(m, (0, 0.1), rates={"B.Rx": 3.0, "A": 0.0}, passive="held")
    with pytest.raises(mg.DeclarationError, match="passive = 'no': expected"):
        mg.respond(m, (0, 0.1), passive="no")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")
def test_held_passive_freedoms_and_stops():
    """The crank falls on its stop and rests there, the coupler at rest in its spin."""
    m = coupled(mg.load("rssr"))
    r = mg.respond(m, np.linspace(0, 1.5, 31), passive="held", stops=mg.Stop("A", lower=-0.5, restitution=0.3))
    assert r["A"].position.min() > -0.5 - 1e-8
    assert any("A" in str(one) for one in r.events)
    lost = np.diff(r.energy.kinetic + r.energy.potential)
    assert lost.max() < 1e-8
    np.testing.assert_allclose((r.link("coupler").twist[:, :3] * between(r, "B", "C")).sum(axis=1), 0.0, atol=1e-12)


def test_the_rate_of_a_slide_is_in_the_declared_unit_of_length():
    """A cart with an arm: the mean radius of the mechanism, in which slides are solved, is not one."""
    arm = mg.Link("arm", mass=1.0, center=(0.1, 0, 0), inertia=0.01 * np.eye(3))
    pairs = [
        mg.Pair("P", "P", "frame", "cart", point=(0, 0, 0), axis=(1, 0, 0)),
        mg.Pair("R", "R", "cart", "arm", point=(0.3, 0, 0), axis=(0, 0, 1)),
    ]
    m = mg.Mechanism("cart", [mg.Link("frame"), mg.Link("cart", mass=1.0, center=(0, 0, 0)), arm], pairs)
    r = mg.respond(m, [0.0, 0.1], rates={"P": 0.5, "R": 0.2})
    assert [r[name].velocity[0, 0] for name in "PR"] == pytest.approx([0.5, 0.2], rel=1e-12)


@pytest.mark.parametrize("prescribed", [True, False])
def test_rates_that_are_left_open_are_the_least_ones(prescribed):
    """Wheels with ``A + B = C``, C at 2 rad/s: A and B at 1 rad/s each, and without loads they stay so."""
    links = [mg.Link("frame"), *(mg.Link(n, 1.0, (0, 0, 0), np.eye(3)) for n in "abc")]
    pairs = [mg.Pair(n.upper(), "R", "frame", n, point=(0, 0, 0), axis=Z) for n in "abc"]
    m = mg.Mechanism("sum", links, pairs, couplings=[mg.Coupling({"A": 1.0, "B": 1.0, "C": -1.0}, name="g")])
    how = {"motions": {"C": lambda t: (2 * t, 2 + 0 * t, 0 * t)}} if prescribed else {"rates": {"C": 2.0}}
    r = mg.respond(m, [0.0, 1.0], **how)
    np.testing.assert_allclose([r[n].velocity[:, 0] for n in "AB"], 1.0, rtol=1e-9)
    np.testing.assert_allclose(r["A"].position[[0, -1], 0], [0.0, 1.0], atol=1e-9)
