"""The verdict does not depend on where a mechanism stands, how it is turned or in what units it is told; and it never flips silently."""

from __future__ import annotations

import mechanisms as known
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from screws import rotation_exp

import mechgraph as mg

pytestmark = pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")
"""Random loads move passive freedoms; ``test_passive_loads`` looks at what is said of it."""

BUILDERS = {
    "planar": known.planar,
    "three cranks": known.three_cranks,
    "sarrus": known.sarrus,
    "bennett": known.bennett,
    "rssr-sc": known.rssr_sc,
    "6-sps": known.hexapod,
    "door": known.door,
    "pphchp": lambda: known.pphchp((0, 0, 1), (0.3, 0.2, 1), (0, 0, 1)),
    "concurrent cranks": known.concurrent_cranks,
}


def said(r: mg.DeterminacyReport) -> tuple[object, ...]:
    """What must stay: verdict, counts, uniqueness, self-stresses, combinations, who is passive, drivable or locked, advice."""
    assert r.reactions is not None
    return (
        r.verdict,
        r.mobility,
        r.finite_mobility,
        r.redundancy,
        r.excess,
        r.unique,
        [s.text for s in r.self_stresses],
        [t.text for t in r.reactions.unique_directions],
        r.reactions.combinations,
        [p.links for p in r.passive],
        [d.freedoms for d in r.drivable],
        [d.text for d in r.locked],
        [a.text for a in r.advice],
    )


def scaled(m: mg.Mechanism, size: float) -> mg.Mechanism:
    """All lengths times ``size``."""

    def longer(v: object) -> object:
        return None if v is None else np.asarray(v) * size

    pairs = [p.replace(point=longer(p.point), pitch=None if p.pitch is None else p.pitch * size) for p in m.pairs]
    return m.replace(pairs=pairs)


def pose(turn: np.ndarray, shift: np.ndarray) -> np.ndarray:
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = rotation_exp(turn), shift
    return out


@pytest.mark.daily(4)
@pytest.mark.parametrize("name", BUILDERS)
def test_metres_and_millimetres(name: str) -> None:
    m = BUILDERS[name]()
    assert said(mg.check(scaled(m, 1000.0))) == said(mg.check(m))


@pytest.mark.parametrize("name", BUILDERS)
def test_far_away(name: str) -> None:
    m = BUILDERS[name]()
    far = mg.check(m.moved(pose(np.zeros(3), np.array([1e5, -2e5, 1e5]))))
    here = mg.check(m)
    assert far.verdict == here.verdict
    assert far.unique == here.unique
    assert far.finite_mobility == here.finite_mobility


@pytest.mark.daily(2)
@pytest.mark.parametrize("name", BUILDERS)
@settings(max_examples=6)
@given(seed=st.integers(0, 10**6))
def test_turned_and_moved(name: str, seed: int) -> None:
    m = BUILDERS[name]()
    rng = np.random.default_rng(seed)
    there = mg.check(m.moved(pose(rng.uniform(-3, 3, 3), rng.normal(0, 5, 3))))
    assert said(there) == said(mg.check(m))


@pytest.mark.parametrize("detuned", [10.0**-k for k in range(2, 10)])
def test_detuning_never_flips_silently(detuned: float) -> None:
    """A detuned three-crank parallelogram is a structure; when the singular value drowns, the report says that it took it for zero."""
    report = mg.check(known.three_cranks(detuned))
    assert report.near
    assert "ear" in report.verdict
    assert report.margin is not None
    if report.mobility == 0:
        assert 1e-9 < report.margin < detuned
    else:
        assert detuned < 1e-7
        assert report.dropped is not None
        assert 1e-2 * detuned < report.dropped < detuned


def test_tuned_is_not_near() -> None:
    assert not mg.check(known.three_cranks()).near


@pytest.mark.parametrize("angle", [1e-4, 1e-6])
def test_near_a_dead_point_is_said(angle: float) -> None:
    """A slider-crank a little off its dead point: the slider hardly moves when the crank does."""
    head = (np.cos(angle), np.sin(angle), 0.0)
    m = known.ring("RRRP", [(0, 0, 0), head, (3, 0, 0), (3, 0, 0)], [known.Z] * 3 + [known.X], drives=["O4"])
    report = mg.check(m)
    assert report.mobility == 1
    assert report.near
    assert "dead point: the driver O4.Tz" in report.verdict


def test_at_a_dead_point() -> None:
    m = known.ring("RRRP", [(0, 0, 0), (1, 0, 0), (3, 0, 0), (3, 0, 0)], [known.Z] * 3 + [known.X], drives=["O4"])
    report = mg.check(m)
    assert report.contradicting_drives
    assert not report.determinate
    assert report.verdict.startswith(("Singular drive", "Under-driven"))
    assert any("O4.Tz is not a valid driver: dead point" in found.text for found in report.not_drivable)


@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("slope", [0.0, 1e-10, 1e-9, 1e-6, 1e-5, 1e-2])
def test_uniqueness_that_a_small_change_turns_is_near(slope: float, engine: str) -> None:
    """A bar on two pins is strained along its line: Fy of the pins is unique only where the line is x, at any rank the same."""
    m = known.ring("RR", [(0, 0, 0), (1, slope, 0)], [known.Z] * 2, drives=[])
    report = mg.check(m, engine=engine)  # type: ignore[arg-type]
    assert (report.mobility, report.redundancy) == (0, 4)
    assert report.unique["O1"]["Fy"] == (slope < 1e-7)
    nearly = 0.0 < slope < 1e-4
    assert report.near == report.near_other_uniqueness == nearly
    assert not report.near_other_rank
    if nearly:
        verb = "unique, but has a part" if slope < 1e-7 else "not unique, but has only a part"
        assert f"Near another verdict: O1:Fy is called {verb} of " in report.verdict
        assert "A small change of dimensions may change what is unique" in " ".join(str(report).split())
