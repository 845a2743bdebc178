"""Benchmark problems of dynamics (IFToMM library, Test Set for IVP Solvers) against published values and closed forms."""

from pathlib import Path

import numpy as np
import pytest
import scipy

import mechgraph as mg

pytestmark = pytest.mark.reference

ANDREWS = {
    "J1": 15.81077119629904 + 0.06171389001427645,
    "J2": -15.75637105984298,
    "J4": 0.04082224013073101 - 0.45527981916307037,
    "J6": 0.5347301163226948 + 0.22266839016588588,
    "J7": 0.5244099658805303 - 0.48736497954384256,
    "J9": -0.5347301163226948 - 0.22266839016588588,
    "J10": 1.048080741042263 - 1.2305474445498212,
}
"""Angles from the start at t = 0.03 by pair (Test Set for IVP Solvers, release 2.4), signs as the pairs are declared."""


def test_andrews_squeezing_mechanism():
    """The published reference agrees with itself to 1.1e-9 in beta and 1.4e-9 in Theta (two independent models differ from it by that)."""
    r = mg.respond(mg.load("andrews"), np.array([0.0, 0.015, 0.03]), rtol=1e-13, atol=1e-14)
    for pair, value in ANDREWS.items():
        found = abs(r[pair].position[-1, 0])
        assert found == pytest.approx(abs(value), abs=2.5e-9), pair
    assert np.abs(r.energy.balance).max() < 1e-8 * r.energy.kinetic.max()
    assert r.checks.closure.max() < 1e-12


def test_windows_against_their_one_equation():
    """A2 over 10 s: the crank's angle by the exact one-freedom equation; energy drift below 1e-8."""
    m = mg.load("windows-2")
    r = mg.respond(m, np.linspace(0, 10, 101), rates={"A0": -1.0}, rtol=1e-11, atol=1e-13)
    inertia, arm = 3 / 3 + 2, 3 / 2 + 2
    exact = scipy.integrate.solve_ivp(
        lambda t, y: [y[1], -9.81 * arm / inertia * np.cos(y[0])],
        (0, 10), [np.pi / 2, -1.0], "DOP853", r.t, rtol=1e-13, atol=1e-14,
    )  # fmt: skip
    assert np.abs(r["A0"].position[:, 0] + np.pi / 2 - exact.y[0]).max() < 1e-6
    assert np.abs(r.energy.balance).max() < 1e-8 * r.energy.kinetic.max()


def test_bricard_drifts_by_less_than_its_tolerance():
    """A4 over 10 s."""
    r = mg.respond(mg.load("bricard-cube"), (0, 10), rtol=1e-11, atol=1e-13)
    assert np.abs(r.energy.balance).max() < 1e-8 * r.energy.kinetic.max()


def test_flyball_governor():
    """A5: stiff; the slider rises to about 0.743 m and comes back, 9.7 periods in 10 s (here the first one)."""
    m = mg.load(Path(__file__).parent / "data" / "flyball-governor.toml")
    r = mg.respond(m, np.linspace(0, 1.2, 121), rates={"A": 2 * np.pi}, method="Radau", rtol=1e-6, atol=1e-8)
    s = 0.5 + r["B"].position[:, 0]
    assert s.max() == pytest.approx(0.743, abs=1e-3)
    assert s.min() == pytest.approx(0.5, abs=1e-3)
    assert 1.0 < r.t[60 + int(np.argmin(s[60:]))] < 1.1
    assert np.abs(r.energy.balance).max() < 1e-5 * r.energy.kinetic.max()
