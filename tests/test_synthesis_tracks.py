"""Tracks of synthesis: the kernel and numpy lead them alike."""

from typing import Any

import numpy as np
import pytest
from ladder import LADDER, four_bar

import mechgraph as mg
from mechgraph.modes.homotopy import Ways
from mechgraph.synthesis import legs
from mechgraph.synthesis.classes import TaskClass
from mechgraph.synthesis.legs import Arrow, CompiledArrow, TaskLeg
from mechgraph.synthesis.system import RowProblem

ALL_KINDS = [
    "R-R dyad, 5 poses",  # a rod in a plane
    "slider-crank function up to a factor, 5 pairs",  # what is asked up to a factor
    "geared five-bar path, 3 points, timed",  # a coupling
    "four-bar, function and path, 3 rows",  # rows of several shapes
    "spherical R-R, 5 orientations",  # axes that are sought
    "RCCC, turns and slides at 3 positions",  # loops in space, and dependent equations
    "RSSR-SC, 3 poses",  # balls, and links that turn about themselves
    "four-bar function by markers, 3 pairs",  # places on each link by itself
    "S-S dyad, 7 poses",
    *("a rod that turns about itself", "a plane in space"),
]


def leg_of(name: str) -> tuple[TaskLeg, np.ndarray, np.ndarray, np.ndarray]:
    """A way between random members of the class of a rung, three states near a solution at its begin, places and tracks."""
    m, task, unknown = (LADDER | OWN)[name]()[:3]
    rng = np.random.default_rng(4)
    of = TaskClass(RowProblem(m, task, unknown), rng)
    (begin, end), x = of.random_closed(rng, 2)
    aside = 1e-6 * (rng.normal(size=(len(x), 3)) + 1j * rng.normal(size=(len(x), 3)))
    return of.leg(begin, end), of.normal(x[:, :1] + aside), np.full(3, 1e-6), np.arange(3)


def parallel() -> tuple[mg.Mechanism, Any, list[str]]:
    """A planar four-bar declared in space, with three dependent equations a row."""
    task = mg.function("A", "D", [[0, 0], [0.3, 0.2], [0.7, 0.3]])
    return four_bar().replace(planar=False), task, ["B.point.x", "C.point.x"]


def turning_rod() -> tuple[mg.Mechanism, Any, list[str]]:
    """RSSR, the balls of which are placed on each link by itself, so that its rod turns about itself and stays a link."""
    ball = {"on_a": mg.Marker((0.5, 0.4, 0.1)), "on_b": mg.Marker((0, 0, 0))}
    pairs = [
        mg.Pair("O", "R", "frame", "crank", point=(0, 0, 0), axis=(0, 0.2, 1)),
        mg.Pair("P", "S", "crank", "rod", **ball),
        mg.Pair("Q", "S", "rod", "rocker", on_a=mg.Marker((1.1, 0.1, 0.8)), on_b=mg.Marker((1.6, 0.5, 0.9))),
        mg.Pair("R", "R", "frame", "rocker", point=(2, 0.2, 0.5), axis=(0, 1, 0.4)),
    ]
    m = mg.Mechanism("RSSR", pairs=pairs, drives=["O"])
    return (
        m,
        mg.function("O", "R", [[0, 0], [0.3, 0.1], [0.5, 0.2]]),
        ["P.on_a.point.x", "P.on_a.point.y", "Q.on_b.point.x"],
    )


OWN = {"a rod that turns about itself": turning_rod, "a plane in space": parallel}


def near(a: Any, b: Any, part: float) -> bool:
    return bool(np.abs(np.subtract(a, b)).max() < part * np.abs(b).max())


@pytest.mark.parametrize("name", ALL_KINDS)
def test_the_kernel_steps_as_numpy_does(name: str, compiled: None) -> None:
    leg, x, t, tracks = leg_of(name)
    plain, fast = Arrow(leg, t, tracks, x), CompiledArrow(leg, t, tracks, x)
    idle = plain.idle()
    # what a loop leaves open is taken to third order in either way
    assert near(fast.newton(idle), plain.newton(idle), 1e-4)
    assert near(fast.rates(idle)[0], plain.rates(idle)[0], 1e-9)
    assert near(fast.noise, plain.noise, 1e-12)
    assert near(fast.matrix, plain.matrix, 1e-12)


@pytest.mark.parametrize("name", ALL_KINDS)
def test_the_kernel_corrects_as_numpy_does(name: str, compiled: None) -> None:
    leg, x, t, tracks = leg_of(name)
    idle, dt = np.zeros((3, 0, 0)), np.full(3, 0.5 + 0.1j)
    fast = leg.corrected(x, t, dt, tracks, idle)
    rows, vars(leg.equations)["compiled"] = leg.equations.compiled, None
    plain = Ways.corrected(leg, x, t, dt, tracks, idle)
    assert rows is not None
    assert near(fast.x, plain.x, 1e-9)
    assert near(fast.v, plain.v, 1e-7)
    assert near(fast.sizes[0], plain.sizes[0], 1e-3)
    assert near(fast.noise, plain.noise, 1e-3)


def test_curves_of_rates_are_led_by_numpy() -> None:
    assert leg_of("R-R dyad, 2 poses and a velocity")[0].equations.compiled is None


@pytest.mark.parametrize("name", ["R-R dyad, 4 poses", "four-bar function by markers, 3 pairs"])
def test_without_a_kernel_the_same_is_found(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    m, task, unknown, _ = LADDER[name]()
    fast = mg.synthesize(m, task, unknown)
    monkeypatch.setattr(legs.build, "installed", lambda: None)
    plain = mg.synthesize(m, task, unknown)
    assert np.allclose(np.sort_complex(plain.values.ravel()), np.sort_complex(fast.values.ravel()), atol=1e-10)
    assert plain.total == fast.total
