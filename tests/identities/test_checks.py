"""The checks of a solution: rounding where nothing flows, an error where a number is beyond the largest."""

import numpy as np
import pytest

import mechgraph as mg

TURN = {"A": mg.Motion(np.linspace(0, 6, 30), velocity=1.0)}


def tilted(seed: int, *loads: mg.Wrench) -> tuple[mg.Mechanism, np.ndarray]:
    """A massless planar four-bar in a random plane, and the normal of that plane."""
    rng = np.random.default_rng(seed)
    normal, x, y = np.linalg.qr(rng.normal(size=(3, 3)))[0].T
    places = {"A": (0, 0), "B": (1, 0), "C": (3, 2), "D": (3, 0)}
    ends = {"A": ("frame", "crank"), "B": ("crank", "coupler"), "C": ("coupler", "rocker"), "D": ("frame", "rocker")}
    pairs = [mg.Pair(n, "R", *ends[n], point=tuple(u * x + v * y), axis=tuple(normal)) for n, (u, v) in places.items()]
    return mg.Mechanism("four-bar", pairs=pairs, drives=["A"], loads=loads), normal


@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("seed", range(4))
def test_a_load_that_does_no_work_leaves_a_power_balance_of_rounding(seed: int, engine: str) -> None:
    """A force across the plane of motion: no power anywhere, effort zero; the check compares with force times speed."""
    m, normal = tilted(seed)
    s = mg.solve(
        m, TURN, loads=[mg.Wrench("coupler", force=tuple(9.81 * normal), point=(1.0, 1.0, 0.0))], engine=engine
    )
    np.testing.assert_allclose(s["A"].effort, 0, atol=1e-12)
    assert np.abs(s.checks.power).max() < 1e-13
    assert s.checks.equilibrium.max() < 1e-13


def test_a_wrong_effort_would_be_seen() -> None:
    """The balance is measured against what flows: an error of a tenth of a percent in the effort of a loaded crank shows."""
    m, _ = tilted(0)
    s = mg.solve(m, TURN, loads=[mg.Effort("D", 2.0)], redundant="minimum_norm")
    largest = np.abs(s["A"].effort * s["A"].velocity).max()
    through = max(np.abs(s.link(p.b).twist).max() * np.abs(s[p.name].total).max() for p in m.pairs)
    assert largest > 1e-2 * through


def test_where_nothing_acts_the_checks_are_zero() -> None:
    s = mg.solve(tilted(1)[0], TURN)
    assert not s.checks.power.any()
    assert not s.checks.equilibrium.any()


@pytest.mark.parametrize(("mass", "speed"), [(1e99, 1e110), (1.0, 1e140), (1.0, 1e155), (1.0, 1e300)])
def test_forces_beyond_the_largest_number_are_refused(mass: float, speed: float) -> None:
    bar = mg.Link("bar", mass, (1, 0, 0))
    m = mg.Mechanism(
        "bar",
        [mg.Link("frame"), bar],
        [mg.Pair("A", "R", "frame", "bar", point=(0, 0, 0), axis=(0, 0, 1))],
        drives=["A"],
    )
    for flag in ("raise", "flag"):
        with pytest.raises(mg.DeclarationError, match="beyond the largest number"):
            mg.solve(m, {"A": mg.Motion([0.0, 0.1], speed)}, on_reach=flag)
