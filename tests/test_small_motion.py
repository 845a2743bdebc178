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
    above = mg.equilibrium(pendulum(), {"A": -1.3})
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
    with pytest.raises(mg.DeclarationError, match="nothing can move"):
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
