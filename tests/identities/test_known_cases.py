"""The determinacy report on mechanisms whose answer is known; sources stand with their builders in ``mechanisms.py``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import mechanisms as known
import pytest
from mechanisms import X, Y, Z

import mechgraph as mg


@dataclass(frozen=True)
class Case:
    """Mobility, finite mobility, redundancy; excess (structural, by dimensions, here); number of passive freedoms."""

    build: Callable[[], mg.Mechanism]
    mobility: int
    finite: int
    redundancy: int
    excess: tuple[int, int, int] = (0, 0, 0)
    passive: int = 0


CASES = {
    "bennett": Case(known.bennett, 1, 1, 3, (2, 1, 0)),
    "goldberg": Case(known.goldberg, 1, 1, 2, (1, 1, 0)),
    "myard": Case(known.myard, 1, 1, 2, (1, 1, 0)),
    "bricard line": Case(known.bricard_line_symmetric, 1, 1, 1, (0, 1, 0)),
    "bricard trihedral": Case(known.bricard_trihedral, 1, 1, 1, (0, 1, 0)),
    "bricard cube": Case(known.bricard_cube, 1, 1, 1, (0, 1, 0)),
    "sarrus": Case(known.sarrus, 1, 1, 1, (0, 1, 0)),
    "spherical": Case(known.spherical, 1, 1, 3, (2, 1, 0)),
    "planar": Case(known.planar, 1, 1, 3, (2, 1, 0)),
    "three cranks": Case(known.three_cranks, 1, 1, 7, (6, 1, 0)),
    "three cranks, detuned": Case(lambda: known.three_cranks(1e-4), 0, 0, 6, (6, 0, 0)),
    "concurrent cranks": Case(known.concurrent_cranks, 1, 0, 7, (6, 1, 0)),
    "folded bars": Case(known.folded_bars, 1, 0, 4, (3, 1, 0)),
    "rssr": Case(lambda: mg.load("rssr"), 2, 2, 0, passive=1),
    "rsur": Case(known.rsur, 1, 1, 0),
    "rssr-sc": Case(known.rssr_sc, 1, 1, 0),
    "rccc": Case(known.rccc, 1, 1, 0),
    "3-upu": Case(known.three_upu, 3, 3, 0),
    "6-ups": Case(known.hexapod, 6, 6, 0),
    "6-sps": Case(lambda: known.hexapod("SPS"), 12, 12, 0, passive=6),
    "6-sps undriven": Case(lambda: known.hexapod("SPS", driven=False), 12, 12, 0, passive=6),
    "door": Case(known.door, 1, 1, 5, (4, 1, 0)),
    "door, ball and groove": Case(lambda: known.door("S", "Sg"), 1, 1, 0, passive=1),
    "pphchp, three parallel": Case(lambda: known.pphchp(Z, Z, Z), 3, 3, 2, (0, 2, 0)),
    "pphchp, 3 and 4 parallel": Case(lambda: known.pphchp(Z, Z, (1, 0.3, 0.2)), 2, 2, 1, (0, 1, 0)),
    "pphchp, 3 and 5 parallel": Case(lambda: known.pphchp(Z, (0.3, 0.2, 1), Z), 2, 2, 1, (0, 1, 0)),
    "pphchp, 4 and 5 parallel": Case(lambda: known.pphchp((1, 0.3, 0.2), Z, Z), 2, 2, 1, (0, 1, 0)),
    "pphchp, coplanar": Case(lambda: known.pphchp(Z, X + Z, X), 2, 1, 1, (0, 1, 0)),
    "prprrh, in general": Case(lambda: mg.load("prprrh"), 0, 0, 0),
    "prprrh, parallel": Case(known.prprrh_special, 1, 1, 1, (0, 1, 0)),
}
DETERMINATE = {
    "rssr", "rsur", "rssr-sc", "rccc", "3-upu", "6-ups", "6-sps", "door, ball and groove",
}  # fmt: skip


@cache
def report(name: str) -> mg.DeterminacyReport:
    return mg.check(CASES[name].build())


def loose(r: mg.DeterminacyReport, pair: str) -> set[str]:
    return {name for name, ok in r.unique[pair].items() if not ok}


@pytest.mark.parametrize("name", CASES)
def test_mobility_and_redundancy(name: str) -> None:
    case, r = CASES[name], report(name)
    assert (r.mobility, r.finite_mobility, r.redundancy) == (case.mobility, case.finite, case.redundancy)
    assert tuple(r.excess.values()) == case.excess
    assert len(r.passive) == case.passive
    assert r.inputs == case.mobility - case.passive
    assert r.redundancy == r.mobility - r.mobility_by_count


@pytest.mark.parametrize("name", CASES)
def test_determinate_or_not(name: str) -> None:
    r = report(name)
    assert r.determinate == (name in DETERMINATE)
    assert r.verdict.startswith("Determinate:") == (name in DETERMINATE)


@pytest.mark.parametrize("name", [n for n, case in CASES.items() if not case.finite and case.mobility])
def test_shaky_structures_are_named(name: str) -> None:
    assert "haky" in report(name).verdict
    assert "infinitesimal only" in " ".join(str(report(name)).split())


@pytest.mark.parametrize("name", ["prprrh, in general", "three cranks, detuned"])
def test_structures_are_named(name: str) -> None:
    r = report(name)
    assert "tructure" in r.verdict
    assert {n for found in r.locked for n in found.freedoms} == set(r.mechanism.freedom_names())
    assert not r.drivable


def test_detuned_parallelogram_is_near() -> None:
    r = report("three cranks, detuned")
    assert r.near
    assert r.margin is not None
    assert 1e-7 < r.margin < 1e-4
    assert "early singular" in r.verdict


def test_planar_four_bar_knows_the_forces_in_its_plane_and_no_others() -> None:
    r = report("planar")
    for pair in r.pairs:
        assert loose(r, pair) == {"Fz", "Mx", "My"}
    assert r.unique["O1"]["effort"]


def test_door_on_two_hinges() -> None:
    r = report("door")
    assert r.redundancy == 5
    assert len(r.self_stresses) == 5
    for pair in "AB":
        assert loose(r, pair) == {"Fx", "Fy", "Fz", "Mx", "My"}
    assert r.unique["A"]["effort"]


def test_prprrh_with_parallel_axes() -> None:
    r = report("prprrh, parallel")
    assert r.unique["O1"]["effort"]
    assert any(loose(r, pair) for pair in r.pairs)


def test_bennett_knows_its_driver_effort_only() -> None:
    r = report("bennett")
    assert r.unique["O1"]["effort"]
    assert all(loose(r, pair) == set(r.unique[pair]) - {"effort"} for pair in r.pairs)


def test_rssr_coupler_spins_about_the_line_of_its_centres() -> None:
    r = report("rssr")
    (spin,) = r.passive
    assert spin.links == ("coupler",)
    assert spin.axis is not None
    assert "coupler turns about the line B-C (S-S)" in spin.text


@pytest.mark.parametrize("name", ["6-sps", "6-sps undriven"])
def test_every_leg_of_the_6_sps_is_named(name: str) -> None:
    r = report(name)
    assert [found.links for found in r.passive] == [(f"rod{k}", f"tube{k}") for k in range(1, 7)]
    for k, found in enumerate(r.passive, 1):
        assert f"rod{k} and tube{k} turn about the line A{k}-B{k} (S-S)" in found.text


def test_undriven_platform_gets_its_drivers() -> None:
    r = report("6-sps undriven")
    assert len(r.undriven) == 6
    assert set(r.suggested_drives) == {f"P{k}.Tz" for k in range(1, 7)}
    driven = mg.check(r.mechanism.replace(drives=r.suggested_drives))
    assert driven.determinate


def test_pphchp_with_three_parallel_axes_is_under_driven() -> None:
    r = report("pphchp, three parallel")
    assert r.verdict.startswith("Under-driven")
    assert len(r.undriven) == 2


def test_coplanar_pphchp_has_an_instantaneous_freedom() -> None:
    """It only slides, so that the three axes stay coplanar: the rank is the same all along (values of 4e-8 there are a double root's)."""
    text = report("pphchp, coplanar").text(full=True)
    assert "instantaneous" in text
    assert "Overconstrained by its dimensions" in text
    assert "Singular here" not in text


LIBRARY = mg.library()


@pytest.mark.parametrize("name", LIBRARY)
def test_library(name: str) -> None:
    """What the library files expect (I.-P. J. Lee, thesis, 1977, chapter III, and the sources in the files)."""
    m = mg.load(name)
    r = mg.check(m)
    assert r.mobility == m.expected["mobility"]
    assert r.redundancy == m.expected["redundancy"]
    assert len(r.passive) == m.expected["passive"]
    assert {n for found in r.locked for n in found.freedoms} == set(m.expected["locked"])
    assert (r.ledger("lee").unknowns, r.ledger("lee").equations) == (
        m.expected["lee_unknowns"],
        m.expected["lee_equations"],
    )


def test_a_loop_that_cannot_close_still_gets_the_facts_of_its_graph() -> None:
    r = mg.check(known.unclosable_four_bar())
    assert r.mobility is None
    assert "no closed configuration" in r.note
    assert r.mobility_by_count == -2
    assert not r.determinate


def test_sarrus_ties_two_sides() -> None:
    """Each side holds back the turn that the other holds back: one moment about the common normal, in all six pairs."""
    r = report("sarrus")
    assert [loose(r, pair) for pair in r.pairs] == [loose(r, "O1")] * 3 + [loose(r, "O4")] * 3
    assert len(loose(r, "O1")) == 1
    assert Y @ X == 0
