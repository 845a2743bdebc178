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
    "up to a factor": (
        mg.function("A", "D", [[0, 0], [0.3, 0.1], [0.6, 0.3], [0.9, 0.6]], scale="free"),
        ["B.point", "C.point"],
    ),
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


def test_a_function_is_met_up_to_the_factor_that_it_was_divided_by() -> None:
    angles = np.linspace(0.0, 1.2, 9)
    turned = mg.kinematics(four_bar(), {"A": angles})["D"].position[:, 0]
    fit = asked(mg.function("A", "D", np.column_stack([angles, turned / 1.5]), scale="free"), ["B.point.x", "C.point"])
    best = fitted(fit, "least_squares", 1, {}).points[0]
    assert fit.p.unknowns.names[-1] == "D.Rz.scale"
    assert fit.p.outside(best.z[:, None])[:, 0] == pytest.approx([0, 3, 2.5, 1.5], abs=1e-7)


def test_the_least_largest_error_is_below_that_of_least_squares() -> None:
    """At the best fit in Chebyshev's sense several rows have the largest error: with one alone a step would make it less."""
    angles = np.linspace(0.0, 1.2, 9)
    fit = asked(mg.function("A", "D", np.column_stack([angles, 0.3 * angles**2])), ["C.point"])
    squares, chebyshev = (fitted(fit, way, 1, {}).points[0] for way in ("least_squares", "minimax"))
    errors = fit.errors(chebyshev)
    assert errors.max() < 0.9 * fit.errors(squares).max()
    assert (errors > 0.999 * errors.max()).sum() >= 2


def test_the_least_ratio_of_lengths_is_less_than_that_of_all_others_near_by_that_do_the_same() -> None:
    """Of three pairs of angles: with A, B, D given, C is as far from B in all three positions as the rocker sees them."""
    pairs, A, D = np.deg2rad([[0, 0], [40, 15], [75, 45]]), 0j, 3 + 0j

    def ratio(B: complex) -> float:
        seen = D + np.exp(-1j * pairs[:, 1]) * ((B - A) * np.exp(1j * pairs[:, 0]) + A - D)
        rows = np.array([[p.real, p.imag, 1.0] for p in seen])
        x, y, _ = np.linalg.solve(rows, (abs(seen) ** 2) / 2)
        lengths = abs(np.array([B - A, x + 1j * y - B, x + 1j * y - D, D - A]))
        return float(lengths.max() / lengths.min())

    m = four_bar()
    # without the point on the coupler, which counts as an element of it
    m = m.replace(links=[mg.Link(link.name) for link in m.links])
    s = mg.synthesize(m, mg.function("A", "D", pairs), ["B.point", "C.point"], minimize="ratio", starts=1)
    best = s.values[0, 0] + 1j * s.values[0, 1]
    assert s.fitness[0].ratio == pytest.approx(ratio(best), rel=1e-9)
    assert not any("Stopped" in text for text in s.evidence)
    ways = np.exp(2j * np.pi * np.arange(16) / 16)
    assert min(ratio(best + step * way) for way in ways for step in (0.01, 0.1, 0.3)) > s.fitness[0].ratio


def test_fits_begin_with_exact_solutions_of_parts_of_the_task() -> None:
    """A function of another four-bar: every part of it that determines a mechanism exactly gives that one among its answers."""
    other = {"A": (0, 0), "B": (-0.3, 0.8), "C": (2.6, 1.9), "D": (3, 0)}
    given = mg.Mechanism("other", pairs=[mg.Pair(k, "R", *ENDS[k], point=at) for k, at in other.items()], planar=True)
    angles = np.linspace(0.0, 1.2, 8)
    pairs = np.column_stack([angles, mg.kinematics(given, {"A": angles})["D"].position[:, 0]])
    s = mg.synthesize(four_bar(), mg.function("A", "D", pairs), ["B.point", "C.point"], fit="least_squares", starts=2)
    assert s.values[0] == pytest.approx([-0.3, 0.8, 2.6, 1.9], abs=1e-7)
    assert any("do a part of the positions exactly" in text for text in s.evidence)


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
