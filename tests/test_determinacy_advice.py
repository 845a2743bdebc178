"""Advice: every effect said is that of the changed mechanism, computed anew at the same position."""

from __future__ import annotations

import mechanisms as known
import numpy as np
import pytest

import mechgraph as mg
from mechgraph.algebra.se3 import rotation_exp
from mechgraph.report.report import DeterminacyReport
from mechgraph.structure.pair_changes import Effect

BUILDERS = {
    "planar": known.planar,
    "library four-bar": lambda: mg.load("four-bar"),
    "slider-crank": lambda: mg.load("slider-crank"),
    "spherical": known.spherical,
    "bennett": known.bennett,
    "sarrus": known.sarrus,
    "three cranks": known.three_cranks,
    "door": known.door,
    "prprrh": known.prprrh_special,
}


def changed(m: mg.Mechanism, effect: Effect) -> DeterminacyReport:
    for (pair, old, new), turn in zip(effect.changes, effect.turns, strict=True):
        assert m.pair(pair).type.symbol == old
        m = m.with_pair_type(pair, new)
        if turn:
            changed = m.pair(pair)
            axis = np.array(changed.axis) / np.linalg.norm(changed.axis)
            second = rotation_exp(np.radians(turn) * axis) @ changed.second
            m = m.replace(pairs=[p.replace(second=second) if p.name == pair else p for p in m.pairs])
    return mg.check(m)


@pytest.mark.parametrize("name", BUILDERS)
def test_effects_are_true(name: str) -> None:
    report = mg.check(BUILDERS[name]())
    assert report.effects
    assert report.inputs is not None
    for effect in report.effects:
        after = changed(report.mechanism, effect)
        assert effect.redundancy == (report.redundancy, after.redundancy), effect.text
        assert effect.mobility == (report.mobility, after.mobility), effect.text
        assert effect.passive == (len(report.passive), len(after.passive)), effect.text
        assert effect.redundancy[1] < effect.redundancy[0]
        assert after.inputs == report.inputs
        assert len(after.mechanism.drives) == len(report.mechanism.drives)


@pytest.mark.parametrize("name", [n for n in BUILDERS if n != "three cranks"])
def test_some_advice_removes_all_redundancy(name: str) -> None:
    """Three cranks are left out: the tie in their plane takes a slide across the axes, which adds a turn or a slide too many."""
    report = mg.check(BUILDERS[name]())
    assert min(effect.redundancy[1] for effect in report.effects) == 0


def test_planar_four_bar_is_offered_single_changes_and_sets() -> None:
    """C with S, as in L. Reshetov, Self-Aligning Mechanisms, 1982: a planar four-bar without redundant constraints."""
    effects = mg.check(known.planar()).effects
    kinds = {tuple(sorted(new for _, _, new in e.changes)) for e in effects}
    assert ("C", "S") in kinds
    assert any(len(kind) == 1 for kind in kinds)


@pytest.mark.parametrize("build", [lambda: mg.load("prprrh"), lambda: known.three_cranks(0.05), known.folded_bars])
def test_a_structure_is_told_what_frees_it(build: object) -> None:
    report = mg.check(build())  # type: ignore[operator]
    freeing = [e for e in report.effects if e.mobility[1] - e.passive[1] > (report.finite_mobility or 0)]
    assert freeing
    for effect in freeing:
        after = changed(report.mechanism, effect)
        assert effect.mobility[1] == after.mobility


def test_under_driven_mechanisms_get_the_drivers_that_complete_them() -> None:
    for m in (
        known.pphchp(known.Z, known.Z, known.Z),
        known.hexapod("UPS", driven=False),
        mg.load("7r").replace(drives=[]),
    ):
        report = mg.check(m)
        assert report.undriven
        whole = mg.check(m.replace(drives=[*m.drives, *report.suggested_drives]))
        assert not whole.undriven
        assert not whole.contradicting_drives
        assert report.advice[0].freedoms == report.suggested_drives
