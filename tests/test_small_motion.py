"""Equilibrium and small motions against closed forms."""

import numpy as np
import pytest
import scipy
from test_response import DOWN, G, X, Z, pendulum, rod, windows

import mechgraph as mg


def test_pendulum_hangs_and_stands():
    """Below: stable, the bar carries the weight, frequency sqrt(g / l). Above: not stable."""
    below = mg.equilibrium(pendulum(), {"A": 0.3})
    assert below.start["A.Rz"] == pytest.approx(np.pi / 2, abs=1e-10)
    assert below.stable is True
    np.testing.assert_allclose(below.solution["A"].force, [0, G, 0], atol=1e-9)
    small = mg.linearize(below)
    np.testing.assert_allclose(small.frequencies, [np.sqrt(G)], rtol=1e-12)
    above = mg.equilibrium(pendulum(), {"A": -1.3}, kind="nearest")
    assert above.start["A.Rz"] == pytest.approx(-np.pi / 2, abs=1e-10)
    assert above.stable is False
    assert np.isnan(mg.linearize(above).frequencies).all()


def test_double_pendulum_frequencies():
    """(K - w^2 M) u = 0 by hand."""
    links = [mg.Link("frame"), rod("upper", (0, 0, 0), (1, 0, 0)), rod("lower", (1, 0, 0), (2, 0, 0))]
    pairs = [
        mg.Pair("A", "R", "frame", "upper", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "R", "upper", "lower", point=(1, 0, 0), axis=Z),
    ]
    e = mg.equilibrium(mg.Mechanism("double", links, pairs, loads=[DOWN]), {"A": -1.2, "B": 0.3})
    w2, U = scipy.linalg.eigh(G * np.diag([1.5, 0.5]), [[4 / 3, 0.5], [0.5, 1 / 3]])  # absolute angles
    small = mg.linearize(e)
    np.testing.assert_allclose(small.frequencies, np.sqrt(w2), rtol=1e-10)
    for i, mode in enumerate(small.modes):
        assert mode["B.Rz"] / mode["A.Rz"] == pytest.approx(U[1, i] / U[0, i] - 1.0, rel=1e-9)


def test_tailgate_on_its_spring():
    """A lid on a hinge and a spring from the body: moment balance and its slope by hand."""
    k, free, hook, foot = 900.0, 0.25, 0.4, np.array([0.1, -0.3])
    lid = mg.Link("lid", mass=8.0, center=(0.5, 0, 0), inertia=0.7 * np.eye(3))
    m = mg.Mechanism(
        "tailgate",
        [mg.Link("body"), lid],
        [mg.Pair("A", "R", "body", "lid", point=(0, 0, 0), axis=Z)],
        loads=[DOWN, mg.Spring("body", "lid", (*foot, 0), (hook, 0, 0), stiffness=k, free_length=free)],
    )

    def moment(a):
        at = hook * np.array([np.cos(a), np.sin(a)])
        d = foot - at
        length = np.linalg.norm(d)
        pull = k * (length - free) * d / length
        return at[0] * pull[1] - at[1] * pull[0] - 8.0 * G * 0.5 * np.cos(a)

    e = mg.equilibrium(m, {"A": -0.3})
    a = e.start["A.Rz"]
    exact = scipy.optimize.brentq(moment, a - 0.05, a + 0.05, xtol=1e-15)
    assert a == pytest.approx(exact, abs=1e-11)
    h = 1e-2
    slope = (
        sum(
            w * (moment(a + i * h) - moment(a - i * h))
            for i, w in ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
        )
        / h
    )
    inertia = 0.7 + 8.0 * 0.25
    assert e.stable is bool(slope < 0)
    if e.stable:
        np.testing.assert_allclose(mg.linearize(e).frequencies, [np.sqrt(-slope / inertia)], rtol=1e-10)


def test_spherical_pendulum_swings_alike_in_both_directions_and_spins_freely():
    """Rotations as independent coordinates: sqrt(g m l / I) twice, and a spin without stiffness."""
    bob = mg.Link("bob", mass=2.0, center=(0, -0.5, 0), inertia=np.diag([0.1, 0.02, 0.1]))
    m = mg.Mechanism(
        "bell", [mg.Link("frame"), bob], [mg.Pair("A", "S", "frame", "bob", point=(0, 0, 0))], loads=[DOWN]
    )
    small = mg.linearize(m)
    w = np.sqrt(2.0 * G * 0.5 / (0.1 + 2.0 * 0.25))
    np.testing.assert_allclose(small.frequencies[1:], [w, w], rtol=1e-9)
    np.testing.assert_allclose(np.abs(small.eigenvalues[0]), 0.0, atol=1e-5)
    assert mg.equilibrium(m).stable is None


@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_windows_about_their_lowest_place(engine):
    """All links on cranks that hang: g ((n + 1) / 2 + n) / ((n + 1) / 3 + n); mass in the units of the declaration."""
    n = 2
    e = mg.equilibrium(windows(n), {"A0": 2.8}, engine=engine)
    small = mg.linearize(e, engine=engine)
    inertia, arm = (n + 1) / 3 + n, (n + 1) / 2 + n
    np.testing.assert_allclose(small.M, [[inertia]], rtol=1e-10)
    np.testing.assert_allclose(small.K, [[G * arm]], rtol=1e-9)
    np.testing.assert_allclose(small.frequencies, [np.sqrt(G * arm / inertia)], rtol=1e-10)


def test_damped_oscillator():
    """m s^2 + c s + k = 0."""
    m = mg.Mechanism(
        "oscillator",
        [mg.Link("frame"), mg.Link("block", mass=2.0, center=(0, 0, 0))],
        [mg.Pair("P", "P", "frame", "block", point=(0, 0, 0), axis=X)],
        loads=[mg.TorsionSpring("P", stiffness=50.0, free=0.1, damping=3.0)],
    )
    e = mg.equilibrium(m)
    assert e.start["P.Tz"] == pytest.approx(0.1, abs=1e-12)
    small = mg.linearize(e)
    np.testing.assert_allclose(small.eigenvalues, [-0.75 + 1j * np.sqrt(25 - 0.5625)], rtol=1e-10)
    np.testing.assert_allclose(small.damping, [0.15], rtol=1e-10)
    np.testing.assert_allclose(np.linalg.eigvals(small.A).real, -0.75, rtol=1e-10)


def test_no_equilibrium_is_said():
    """A torque that nothing balances; a mechanism in which nothing is free."""
    spun = pendulum().replace(loads=[mg.Effort("A", 1.0)])
    with pytest.raises(mg.ResponseError, match="no equilibrium"):
        mg.equilibrium(spun)
    with pytest.raises(mg.DeclarationError, match="every freedom is driven"):
        mg.equilibrium(pendulum().replace(drives=["A"]))


def test_statics_of_a_mechanism_without_mass_and_drives_that_stand_still():
    """A massless lever between two springs stands in the middle, on two driven slides that are held; it has no frequency."""
    links = [mg.Link("frame"), mg.Link("x"), mg.Link("y"), mg.Link("lever")]
    pairs = [
        mg.Pair("X", "P", "frame", "x", point=(0, 0, 0), axis=(1, 0, 0)),
        mg.Pair("Y", "P", "x", "y", point=(0, 0, 0), axis=(0, 1, 0)),
        mg.Pair("A", "R", "y", "lever", point=(0, 0, 0), axis=(0, 0, 1)),
    ]
    loads = [mg.TorsionSpring("A", stiffness=3.0), mg.Effort("A", 1.5)]
    m = mg.Mechanism("lever", links, pairs, drives=["X", "Y"], loads=loads)
    found = mg.equilibrium(m, {"X": 0.2})
    assert found.start["A.Rz"] == pytest.approx(0.5, abs=1e-12)
    assert found.start["X.Tz"] == pytest.approx(0.2, abs=1e-15)
    assert found.stable
    with pytest.raises(mg.DeclarationError, match="motion without inertia"):
        mg.linearize(found)


def test_bad_input_of_small_motions_is_named():
    """One error each; a position that is none of equilibrium is linearized with a warning."""
    links = [mg.Link("frame"), mg.Link("bob", mass=1.0, center=(-1, 0, 0))]
    m = mg.Mechanism(
        "pendulum",
        links,
        [mg.Pair("A", "R", "frame", "bob", point=(0, 0, 0), axis=(0, 0, 1))],
        loads=[mg.Gravity((0, -9.81, 0))],
    )
    for call in (mg.equilibrium, mg.linearize):
        with pytest.raises(mg.DeclarationError, match="expected a Mechanism"):
            call("pendulum")
        with pytest.raises(mg.DeclarationError, match="expected a mapping"):
            call(m, 0.3)
        with pytest.raises(mg.DeclarationError, match="engine = 'fast'"):
            call(m, engine="fast")
        with pytest.raises(mg.DeclarationError, match="array over positions"):
            call(m.replace(loads=[mg.Effort("A", np.ones(5))]))
    with pytest.warns(mg.MechgraphWarning, match="not in equilibrium"):
        mg.linearize(m)


@pytest.mark.parametrize("angle", [0.0, np.pi / 6, -np.pi / 6, np.pi / 2, -np.pi / 2 + 1e-3])
def test_a_pendulum_comes_to_hang_from_wherever_it_is_let_go(angle):
    """Level, 30 degrees above and below it, straight up; nearest to straight up is straight up, and it is said to be unstable."""
    m = pendulum()
    e = mg.equilibrium(m, {"A": angle})
    assert np.sin(e.start["A.Rz"]) == pytest.approx(1.0, abs=1e-12)
    assert e.stable is True
    up = mg.equilibrium(m, {"A": -np.pi / 2 + 0.02}, kind="nearest")
    assert (up.start["A.Rz"], up.stable) == (pytest.approx(-np.pi / 2), False)
    with pytest.raises(mg.DeclarationError, match="kind"):
        mg.equilibrium(m, kind="any")


def block(*loads, mass=2.0):
    """A block on a slide."""
    body = mg.Link("block", mass=mass, center=(0, 0, 0))
    return mg.Mechanism(
        "oscillator",
        [mg.Link("frame"), body],
        [mg.Pair("P", "P", "frame", "block", point=(0, 0, 0), axis=X)],
        loads=loads,
    )


@pytest.mark.daily(3)
@pytest.mark.parametrize("power", [1.0, 1.5])
@pytest.mark.parametrize("start", [-3.0, -0.01, 0.0, 0.4])
def test_a_block_comes_to_rest_on_one_sided_springs(start, power):
    """F = k x^p where x > 0, else nothing: x = (w / k)^(1 / p), stiffness p k x^(p - 1)."""
    k, weight = 1e6, 30.0
    m = block(mg.ForceLaw("P", law=lambda x, v, t: -k * np.maximum(x, 0.0) ** power), mg.Effort("P", weight))
    e = mg.equilibrium(m, {"P": start})
    x = (weight / k) ** (1 / power)
    assert e.start["P.Tz"] == pytest.approx(x, rel=1e-7)
    assert e.stable is True
    stiffness = power * k * x ** (power - 1)
    np.testing.assert_allclose(mg.linearize(e).frequencies, [np.sqrt(stiffness / 2.0)], rtol=1e-6)


def test_slopes_are_those_of_the_place_however_short_they_hold():
    """-tanh(x / 0.001), -tanh(v / 0.001): 1,000 each; v |v|: none."""
    steep = mg.linearize(block(mg.ForceLaw("P", law=lambda x, v, t: -np.tanh(x / 1e-3)), mass=1.0))
    np.testing.assert_allclose(steep.frequencies, [np.sqrt(1000.0)], rtol=1e-8)
    spring = mg.TorsionSpring("P", stiffness=1.0)
    dry = mg.linearize(block(mg.ForceLaw("P", law=lambda x, v, t: -np.tanh(v / 1e-3)), spring))
    np.testing.assert_allclose(dry.C, [[1000.0]], rtol=1e-8)
    drag = mg.linearize(block(mg.ForceLaw("P", law=lambda x, v, t: -v * np.abs(v)), spring))
    np.testing.assert_allclose(drag.C, [[0.0]], atol=1e-3)


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (lambda x, v, t: -1e3 * np.maximum(x, 0.0), "has no stiffness in P.Tz"),
        (lambda x, v, t: -x - np.sign(v), "has no damping in P.Tz"),
    ],
)
def test_where_there_is_no_slope_it_is_said(law, words):
    with pytest.warns(mg.MechgraphWarning, match=words):
        mg.linearize(block(mg.ForceLaw("P", law=law)))


def column(load, damping=0.0):
    """Ziegler's column: two rods of length 1, masses 2 and 1 at their ends, springs 1 in the hinges, a force that follows the last."""
    links = [
        mg.Link("frame"), mg.Link("low", mass=2.0, center=(1, 0, 0)),
        mg.Link("high", mass=1.0, center=(2, 0, 0)),
    ]  # fmt: skip
    pairs = [
        mg.Pair("A", "R", "frame", "low", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "R", "low", "high", point=(1, 0, 0), axis=Z),
    ]
    springs = [mg.TorsionSpring(name, stiffness=1.0, damping=damping) for name in "AB"]
    force = mg.Wrench("high", force=(-load, 0, 0), point=(2, 0, 0), frame="link")
    return mg.Mechanism("Ziegler", links, pairs, loads=[*springs, force])


@pytest.mark.parametrize(
    ("load", "damping", "stable"), [(2.0, 0.0, None), (2.2, 0.0, False), (1.3, 0.02, True), (2.0, 0.02, False)]
)
def test_a_column_under_a_force_that_follows_flutters(load, damping, stable):
    """Undamped up to P l / c = 7/2 - sqrt 2 = 2.086 it goes on swinging; equal dampers bring that to 41/28 = 1.464 (Ziegler 1952)."""
    e = mg.equilibrium(column(load, damping))
    assert e.stable is stable
    # M, C, K of the angles of both rods against the frame, by hand
    M, c = np.array([[3.0, 1.0], [1.0, 1.0]]), damping * np.array([[2.0, -1.0], [-1.0, 1.0]])
    K = np.array([[2.0 - load, load - 1.0], [-1.0, 1.0]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, K), -np.linalg.solve(M, c)]])
    np.testing.assert_allclose(np.poly(mg.linearize(e).A), np.poly(A), atol=1e-9)
    assert bool(np.linalg.eigvals(A).real.max() > 1e-3) is (stable is False)


def test_a_force_that_feeds_the_motion_makes_it_unstable():
    m = block(mg.TorsionSpring("P", stiffness=5.0), mg.ForceLaw("P", law=lambda x, v, t: 0.3 * v))
    assert mg.equilibrium(m).stable is False


@pytest.mark.parametrize("damping", [0.0, 3.0])
def test_the_spin_of_a_tie_rod_is_zero_in_words(damping):
    """A rod between two spheres spins about its own line: no frequency and no damping, and no part in what is stable."""
    tie = rod("tie", (0, 1, 0), (2, 1, 0)).replace(inertia=np.diag([0.01, 0.4, 0.4]))
    links = [mg.Link("frame"), rod("left", (0, 0, 0), (0, 1, 0)), tie, rod("right", (2, 0, 0), (2, 1, 0))]
    pairs = [
        mg.Pair("A", "R", "frame", "left", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "S", "left", "tie", point=(0, 1, 0)),
        mg.Pair("C", "S", "tie", "right", point=(2, 1, 0)),
        mg.Pair("D", "R", "frame", "right", point=(2, 0, 0), axis=Z),
    ]
    m = mg.Mechanism("tie rod", links, pairs, loads=[DOWN, mg.TorsionSpring("D", stiffness=99.0, damping=damping)])
    e = mg.equilibrium(m)
    assert e.stable is True
    assert e.idle == ("the spin of tie",)
    assert "Nothing resists the spin of tie" in str(e)
    small = mg.linearize(e)
    assert small.eigenvalues[0] == small.frequencies[0] == small.damping[0] == 0.0
    inertia, stiffness = 2 / 3 + 1, 99.0 - 2 * G  # two cranks and a rod that is carried by both
    s = np.roots([inertia, damping, stiffness])
    np.testing.assert_allclose(np.abs(small.eigenvalues[1:]), np.abs(s[:1]), rtol=1e-9)
    assert "free" in str(small)


def test_modes_are_told_by_the_freedoms_that_are_named():
    """Of four hinges that turn alike the one is shown on which the declaration has a spring."""
    m = windows(3, (mg.TorsionSpring("A2", stiffness=500.0),))
    small = mg.linearize(m, {"A0": 0.0})
    line = str(small).splitlines()[-1]
    assert "A2.Rz 1" in line
    assert not any(f"A{i}.Rz" in line for i in (0, 1, 3))
