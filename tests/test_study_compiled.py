"""Studies in the compiled kernel against numpy: wide ways, whole turns, singular ones; on threads; how much work they take."""

from __future__ import annotations

import concurrent.futures
import os
from typing import Any

import mechanisms as known
import numpy as np
import pytest
import scipy.stats

import mechgraph as mg
from mechgraph import outcome

MOTION = {"O1": mg.Motion(np.deg2rad([150.0, 175.0, 200.0]), 0.1, 0.2)}
NOMINAL = {"length[0]": 0.5, "length[1]": 0.8, "length[2]": 0.4, "twist[0]": np.deg2rad(12), "twist[3]": np.deg2rad(15)}
OUTPUTS = ["O1.effort", "O4.position", "O3.force"]

pytestmark = pytest.mark.usefixtures("compiled")


def both(m: mg.Mechanism, ways: dict[str, Any], outputs: Any, **options: Any) -> mg.Study:
    """The study in the kernel, after it was found to be that of numpy."""
    plain, study = (mg.study(m, ways, outputs, engine=engine, seed=3, **options) for engine in ("dense", "compiled"))
    assert np.array_equal(plain.status, study.status)
    assert set(plain.messages) == set(study.messages)
    for name, values in plain.outputs.items():
        np.testing.assert_allclose(study.outputs[name], values, rtol=1e-10, atol=1e-11 * np.nanmax(np.abs(values)))
    return study


def share(part: float) -> dict[str, Any]:
    return {name: scipy.stats.uniform(value * (1 - part), 2 * part * value) for name, value in NOMINAL.items()}


@pytest.mark.parametrize("part", [0.01, 0.1])
def test_narrow_and_wide_studies_are_those_of_numpy(part: float) -> None:
    study = both(mg.load("rcsr"), share(part), OUTPUTS, n=12, motions=MOTION)
    assert study.failed.any() == (part > 0.05)


def test_a_way_of_turns_leads_over_true_mechanisms() -> None:
    """Turned by whole turns the mechanism is the same, and is led round: tables blended between its two ends would stand still."""
    twists = np.deg2rad(12) + 2 * np.pi * np.array([-1.0, 1.0, 2.0])
    both(mg.load("rcsr"), {"twist[0]": twists}, OUTPUTS, n=3, sampling="grid", motions=MOTION)


def test_a_way_through_a_singular_mechanism_is_not_led() -> None:
    """A rocker whose length goes through zero to its negative has a start on the other side, on a branch that is not its own."""
    ways = {"C.on_b.point.x": [-2.5, -0.9, 2.4]}
    both(known.marked_four_bar(), ways, "A.effort", n=3, sampling="grid", motions={"A": np.linspace(0.5, 5.5, 6)})


def test_threads_give_what_one_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts are solved on threads, not in processes; in any number the same bits in the same order."""
    monkeypatch.setattr("mechgraph.variants.study.POSITIONS_TOGETHER", 6)
    monkeypatch.setattr(concurrent.futures, "ProcessPoolExecutor", None)
    found, calls = [], []
    for workers in (1, 3):
        monkeypatch.setattr(os, "cpu_count", lambda workers=workers: workers)
        found.append(
            mg.study(
                mg.load("rcsr"), share(0.02), {"effort": "O1.effort", "own": lambda s: s["O4"].position[..., 0]}, n=24,
                motions=MOTION, engine="compiled", progress=lambda *done: calls.append(done),
            )
        )  # fmt: skip
    assert np.array_equal(found[0].status, found[1].status)
    for name in ("effort", "own"):
        assert np.array_equal(found[0].outputs[name], found[1].outputs[name], equal_nan=True)
    assert calls[: len(calls) // 2] == calls[len(calls) // 2 :]


def test_tables_are_filled_twice_for_a_narrow_study(monkeypatch: pytest.MonkeyPatch) -> None:
    """Once where variants end and once on the way there, and for the mechanism itself: that is what a variant costs beside its motion."""
    sizes = []

    def counted(layout: Any, system: Any, x: Any, loads: Any) -> Any:
        sizes.append(x.shape[1])
        return filled(layout, system, x, loads)

    filled = outcome.tables
    monkeypatch.setattr(outcome, "tables", counted)
    mg.study(mg.load("rcsr"), share(0.01), OUTPUTS, n=30, motions=MOTION, engine="compiled")
    assert sizes == [1, 41, 41]


def test_quantiles_of_what_was_solved() -> None:
    study = mg.study(mg.load("rcsr"), share(0.1), OUTPUTS, n=12, motions=MOTION, engine="compiled")
    values = study.outputs["O1.effort"]
    assert np.isnan(values).any()
    assert np.array_equal(study.quantiles("O1.effort", [0.1, 0.9]), np.nanquantile(values, [0.1, 0.9], axis=0))
