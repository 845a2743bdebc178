"""Fits: exact gradients against differences, curves against closed forms, and against differential evolution of a formula."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.optimize

import mechgraph as mg
from mechgraph.synthesis.fits import Fit, fitted
from mechgraph.synthesis.system import RowProblem

Z = (0.0, 0.0, 1.0)
PAIRS = {"A": (0.0, 0.0, 0.0), "B": (0.0, 1.0, 0.0), "C": (3.0, 2.5, 0.0), "D": (3.0, 0.0, 0.0)}
ENDS = {"A": ("frame", "crank"), "B": ("crank", "coupler"), "C": ("coupler", "rocker"), "D": ("frame", "rocker")}


def four_bar() -> mg.Mechanism:
    links = [mg.Link("frame"), mg.Link("crank"), mg.Link("coupler", points={"tip": (1.5, 2.5, 0.0)}), mg.Link("rocker")]
    pairs = [mg.Pair(name, "R", *ENDS[name], point=at, axis=Z) for name, at in PAIRS.items()]
    return mg.Mechanism("guide", links, pairs, drives=["A"], planar=True)


def ellipse(n: int) -> np.ndarray:
    t = np.linspace(0, 2 * np.pi, n, endpoint=False)
    return np.column_stack([0.5 + np.cos(t), 2.5 + 0.5 * np.sin(t)])


def asked(task: object, unknown: list[str]) -> Fit:
    return Fit(RowProblem(four_bar(), task, unknown), task)


EVERYTHING = ["A.point", "B.point", "C.point", "D.point", "coupler.tip"]
TASKS = {
    "path": (mg.path("coupler.tip", ellipse(9)), EVERYTHING),
    "timed path": (mg.path("coupler.tip", ellipse(5), at={"A": np.linspace(0, 1.5, 5)}), EVERYTHING),
    "poses": (
        mg.poses("coupler", [[0, 0, 0], [0.2, 0.1, 0.1], [0.5, 0.1, 0.0], [0.7, 0, -0.1]]),
        ["B.point", "D.point"],
    ),
    "function": (mg.function("A", "D", np.outer(np.linspace(0, 1, 5), (1.0, 0.4))), ["B.point", "C.point"]),
}


@pytest.mark.parametrize("name", TASKS)
def test_gradients_are_those_of_differences(name: str) -> None:
    fit = asked(*TASKS[name])
    here = fit.begun(fit.z0)
    assert here is not None
    v, way, step = fit.vector(here), np.random.default_rng(0).normal(size=len(fit.vector(here))), 1e-6
    ahead, back = (fit.residual(fit.moved(here, *fit.parts(v + s * way))[0]) for s in (step, -step))
    assert np.abs((ahead - back) / (2 * step) - fit.jacobian(here) @ way).max() < 1e-6


def test_a_curve_of_the_mechanism_is_met_and_the_driver_of_every_row_is_found() -> None:
    """Points of the curve of another four-bar, at crank angles that nothing tells; declared is one somewhat off."""
    m = four_bar()
    angles = np.array([0.0, 0.4, 0.9, 1.3, 2.0, 2.4, 3.0, 3.9, 4.6, 5.2, 5.9, 6.1])
    points = mg.kinematics(m, {"A": angles}).link("coupler").at("tip").position[:, :2]
    off = m.replace(
        pairs=[p.replace(point=np.add(p.point, (0.07, -0.05, 0))) if p.name in "BC" else p for p in m.pairs]
    )
    task = mg.path("coupler.tip", points)
    fit = Fit(RowProblem(off, task, ["B.point", "C.point"]), task)
    found = fitted(fit, "least_squares", 1, {})
    best = found.points[0]
    assert fit.errors(best).max() < 1e-8
    assert np.allclose(np.mod(best.theta[:, 0] + 1e-6, 2 * np.pi), angles, atol=1e-5)
    assert fit.p.outside(best.z[:, None])[:, 0] == pytest.approx([0, 1, 3, 2.5], abs=1e-6)


def test_the_least_largest_error_is_below_that_of_least_squares() -> None:
    """At the best fit in Chebyshev's sense several rows have the largest error: with one alone a step would make it less."""
    angles = np.linspace(0.0, 1.2, 9)
    fit = asked(mg.function("A", "D", np.column_stack([angles, 0.3 * angles**2])), ["C.point"])
    squares, chebyshev = (fitted(fit, way, 1, {}).points[0] for way in ("least_squares", "minimax"))
    errors = fit.errors(chebyshev)
    assert errors.max() < 0.9 * fit.errors(squares).max()
    assert (errors > 0.999 * errors.max()).sum() >= 2


def formula(z: np.ndarray, targets: np.ndarray) -> float:
    """Mean square distance of points from the curve of a four-bar, at 180 crank angles; large where it cannot turn so far."""
    A, B, C, D, P = (z[k : k + 2] @ [1, 1j] for k in range(0, 10, 2))
    crank = np.exp(1j * np.linspace(0, 2 * np.pi, 181)) * (B - A) + A
    length, rocker, reach = abs(C - B), abs(C - D), D - crank
    along = (length**2 - rocker**2 + abs(reach) ** 2) / (2 * abs(reach))
    if (along**2 >= length**2).any():
        return 1e3
    side = np.sign(((C - B) / (D - B)).imag)
    joint = crank + reach / abs(reach) * (along + 1j * side * np.sqrt(length**2 - along**2))
    curve = crank + (P - B) * (joint - crank) / (C - B)
    apart = np.abs(targets[:, None] @ np.array([1, 1j])[:, None] - curve[None, None])
    return float((apart.min(axis=-1) ** 2).mean())


@pytest.mark.slow
def test_a_path_of_sixty_points_is_met_no_worse_than_by_ten_thousand_evaluations_of_differential_evolution() -> None:
    points = ellipse(60)
    fit = asked(mg.path("coupler.tip", points), EVERYTHING)
    best = fitted(fit, "least_squares", 4, {}).points[0]
    other = scipy.optimize.differential_evolution(
        formula, [(-4, 4)] * 10, args=(points,), maxiter=66, popsize=15, polish=False, rng=1, tol=0
    )
    assert other.nfev >= 10_000
    assert (fit.errors(best) ** 2).mean() < other.fun
    assert fit.safe(best)
