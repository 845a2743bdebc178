"""All assemblies: counts of the literature, nothing outside the set, the same set for any seed, certificates, singular points."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ladder import four_bar
from mechanisms import Z, bennett, linked_four_bar, ring

import mechgraph as mg
from mechgraph.files import cache_folder
from mechgraph.kinematics.assembly import closed_start
from mechgraph.kinematics.state import Configuration, close_all, user_poses
from mechgraph.model.mechanism import chain_symbols
from mechgraph.modes import start_sets, targets
from mechgraph.modes.assemblies import Finder, Question
from mechgraph.modes.family import Member
from mechgraph.modes.homotopy import Equations
from mechgraph.modes.start_sets import _beside, _poles, bound, rational, start_set, tame, trace_test
from mechgraph.modes.targets import Ends, TrackRun, _account


@pytest.fixture
def empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No start set is kept, and none came with the package."""
    monkeypatch.setenv("MECHGRAPH_CACHE", str(tmp_path))
    monkeypatch.setattr("mechgraph.modes.start_sets.PACKED", tmp_path / "none")


def general(letters: str, seed: int = 3, **more: object) -> mg.Mechanism:
    """A loop of pairs placed at random, closed where it is declared."""
    types, rng = chain_symbols(letters)[0], np.random.default_rng(seed)
    return ring(types, rng.normal(size=(len(types), 3)), rng.normal(size=(len(types), 3)), **more)


COUNTS = [
    *((letters, 2) for letters in ("R-Sp-R", "P-Sp-R", "R-Sg-C", "R-Sg-R-P", "R-Sg-P-R", "R-Sc-C-P", "R-Sc-P-C", "RSSR", "RCCC")),
    *((letters, 4) for letters in ("R-Sg-R-R", "RCSR", "RCRCR")),
    *((letters, 8) for letters in ("R-Sc-C-R", "R-Sc-R-C", "RCRRC")),
    ("RRRRRRR", 16),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("letters", "count"), COUNTS)
def test_general_loops_have_as_many_assemblies_over_c_as_the_literature_says(letters: str, count: int) -> None:
    modes = mg.assemblies(general(letters), {"O1": 0.2})
    assert modes.total == count
    assert len(modes) + len(modes.complex) + modes.infinite == count
    assert modes.completeness in {"proved", "tested"}


@pytest.mark.parametrize("angle", [0.4, 2.0, -1.3])
def test_a_four_bar_has_the_two_assemblies_of_its_closed_form(angle: float) -> None:
    a, b, c, d = 1.0, 2.5, 2.0, 3.0
    modes = mg.assemblies(linked_four_bar(a, b, c, d, 0.5), {"O0": angle})
    assert modes.completeness == "proved"
    assert modes.kinds == ("regular", "regular")
    tip = a * np.exp(1j * angle)
    way = d - tip
    along = (b * b - c * c + abs(way) ** 2) / (2 * abs(way))
    across = np.sqrt(b * b - along * along)
    expected = sorted([tip + way / abs(way) * (along + s * 1j * across) for s in (1, -1)], key=lambda z: z.imag)
    coupler = [link.name for link in modes.mechanism.links].index("coupler")
    rocker = [link.name for link in modes.mechanism.links].index("rocker")
    found = sorted((complex(*poses[rocker][:2, 3]) for poses in modes.poses), key=lambda z: z.imag)
    assert np.abs(np.array(found) - expected).max() < 1e-12
    assert np.abs(modes.poses[:, coupler, :2, 3] - [tip.real, tip.imag]).max() < 1e-12


def test_where_a_four_bar_cannot_be_closed_both_assemblies_are_complex() -> None:
    modes = mg.assemblies(linked_four_bar(2.0, 1.5, 2.5, 3.0, 0.5), {"O0": np.pi})
    assert len(modes) == 0
    assert len(modes.complex) == 2
    assert modes.completeness == "proved"


def test_at_its_fold_the_two_assemblies_of_a_four_bar_are_a_double_point() -> None:
    a, b, c, d = 2.0, 1.5, 2.5, 3.0
    fold = np.arccos((a * a + d * d - (b + c) ** 2) / (2 * a * d))
    modes = mg.assemblies(linked_four_bar(a, b, c, d, 0.5), {"O0": fold})
    assert modes.kinds == ("double",)
    assert modes.certificates == (None,)
    assert np.isinf(modes.condition[0])


@pytest.mark.daily(1)
@pytest.mark.parametrize("away", [0.0, 1e-6])
def test_where_a_single_rod_can_just_reach_there_is_a_double_point(away: float) -> None:
    """One row has one singular value, which says nothing by comparison with the largest."""
    foot, head = np.array([2.0, 0, 0]), np.array([0.6, 0.8, 0])
    pairs = [
        mg.Pair("A", "R", "ground", "flap", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "S", "ground", "sleeve", point=foot),
        mg.Pair("C", "P", "sleeve", "rod", point=foot, axis=head - foot),
        mg.Pair("D", "S", "rod", "flap", point=head),
    ]
    m = mg.Mechanism("flap", pairs=pairs, frame="ground")
    modes = mg.assemblies(m, {"C": 3.0 - away - np.linalg.norm(head - foot)})
    assert modes.completeness == "proved"
    assert modes.kinds == (("regular",) * 2 if away else ("double",))
    assert modes.condition.min() > 100.0


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_what_is_passive_where_the_mechanism_is_declared_need_not_be_elsewhere(angle: float) -> None:
    """The output of this RSSR turns about a line through the end of the rod at the crank, at that angle of the crank alone."""
    near, far, axis = np.array([0.8, 0.3, 0.4]), np.array([2.0, 1.0, 0.5]), np.array([0.3, 0.2, 1.0])
    pairs = [
        mg.Pair("A", "R", "ground", "crank", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "S", "crank", "coupler", point=near),
        mg.Pair("C", "S", "coupler", "output", point=far),
        mg.Pair("D", "R", "output", "ground", point=near, axis=axis),
    ]
    modes = mg.assemblies(mg.Mechanism("rssr", pairs=pairs, frame="ground"), {"A": angle})
    assert (modes.total, modes.completeness) == (2, "proved")
    assert modes.kinds == (("regular",) * 2 if angle else ())
    assert [(one.dimension, "D.Rz" in one.moves, "A.Rz" in one.moves) for one in modes.continua] == (
        [] if angle else [(1, True, False)]
    )


def test_an_open_chain_has_one_assembly() -> None:
    places = {"A": ("ground", "arm", (0, 0, 0)), "B": ("arm", "hand", (1, 0, 0))}
    pairs = [mg.Pair(name, "R", a, b, point=point, axis=Z) for name, (a, b, point) in places.items()]
    modes = mg.assemblies(mg.Mechanism("chain", pairs=pairs, frame="ground"), {"A": 0.3, "B": 0.2})
    assert (len(modes), modes.total, modes.completeness) == (1, 1, "proved")
    assert "no loop has to be closed" in modes.evidence[0]


def test_a_search_finds_a_double_point_once() -> None:
    """It is known to the root of rounding: guesses come to ends that are a little apart."""
    a, b, c, d = 2.0, 1.5, 2.5, 3.0
    fold = np.arccos((a * a + d * d - (b + c) ** 2) / (2 * a * d))
    question = Question(linked_four_bar(a, b, c, d, 0.5), {"O0": fold})
    found = [Finder(question, seed, False, None)._searched(question.drive[:, 0], 200, 0.5) for seed in range(2)]
    assert [one.x.shape[1] for one in found] == [1, 1]


@pytest.mark.slow
def test_a_parallelogram_folded_flat_is_a_double_point_and_a_kite_that_spins_a_continuum() -> None:
    flat = mg.assemblies(linked_four_bar(1.0, 2.0, 1.0, 2.0, 0.5), {"O0": 0.0})
    assert (flat.kinds, flat.continua) == (("double",), ())
    kite, other = (mg.assemblies(linked_four_bar(2.0, 1.0, 1.0, 2.0, 0.7), {"O0": 0.0}, seed=seed) for seed in range(2))
    assert kite.continua[0].point.start == pytest.approx(other.continua[0].point.start, abs=1e-6)
    assert (len(kite), len(kite.complex), kite.on_continua, kite.completeness) == (0, 0, 2, "proved")
    assert [(one.dimension, one.moves) for one in kite.continua] == [(1, ("O1.Rz", "O3.Rz"))]
    assert "Continuum of dimension 1: O1.Rz, O3.Rz move with the drivers at rest" in str(kite)
    assert [ax.get_title() for ax in kite.plot().axes] == ["0 (continuum)"]


def wristed(bend: float) -> tuple[mg.Mechanism, np.ndarray]:
    """An arm whose last three axes meet, declared elsewhere, and its hand with the middle one of these at an angle."""
    points = [(0, 0, 0), (0, 0.2, 0.5), (0.5, 0.2, 0.9), *[(1.1, 0.3, 0.5)] * 3]
    axes = [(0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 1)]
    pairs = [
        mg.Pair(f"A{i}", "R", f"L{i}", f"L{i + 1}", point=point, axis=axis)
        for i, (point, axis) in enumerate(zip(points, axes, strict=True))
    ]
    arm = mg.Mechanism("arm", pairs=pairs)
    angles = dict(zip([f"A{i}" for i in range(6)], (0.3, 0.4, -0.9, 0.2, bend, 0.5), strict=True))
    return arm, mg.kinematics(arm, angles).link("L6").pose


@pytest.mark.slow
def test_beside_the_continuum_of_a_singular_wrist_isolated_postures_are_counted_and_certified() -> None:
    """Where the last axis lies along the fourth, both may turn against each other; six other postures have bent wrists."""
    arm, hand = wristed(np.pi / 4)
    modes = mg.assemblies(arm, {"L6": hand})
    assert modes.kinds == ("regular",) * 6
    assert all(sure is not None and sure.proved for sure in modes.certificates)
    assert len(modes) + len(modes.complex) + modes.on_continua + modes.infinite == modes.total == 16
    assert [(one.dimension, one.moves) for one in modes.continua] == [(1, ("A3.Rz", "A5.Rz"))]
    start = modes.continua[0].point.start
    assert start["A3.Rz"] + start["A5.Rz"] == pytest.approx(0.7)
    assert start["A3.Rz"] == pytest.approx(0.35)  # of A3 + A5 = 0.7 what is nearest to the start


@pytest.mark.daily(2)
@pytest.mark.parametrize("away", [1e-10, 1e-11, -1e-11])
def test_beyond_a_fold_there_is_no_assembly_and_before_it_are_two(away: float) -> None:
    a, b, c, d = 2.0, 1.5, 2.5, 3.0
    fold = np.arccos((a * a + d * d - (b + c) ** 2) / (2 * a * d))
    modes = mg.assemblies(linked_four_bar(a, b, c, d, 0.5), {"O0": fold + away})
    assert (modes.kinds, len(modes.complex)) == (((), 2) if away > 0 else (("regular",) * 2, 0))
    assert modes.completeness == "proved"


@pytest.mark.daily(1)
@pytest.mark.parametrize("longer", [1e-6, 1e-8])
def test_an_ill_conditioned_assembly_is_not_double(longer: float) -> None:
    """A rhombus of which one side is longer: with the crank on the frame two assemblies are left of a continuum, far apart."""
    modes = mg.assemblies(linked_four_bar(1.0, 1.0, 1.0, 1.0 + longer, 0.5), {"O0": 0.0})
    assert modes.kinds == ("regular",) * 2
    assert sorted(mode.start["O1.Rz"] for mode in modes) == pytest.approx([-np.pi / 2, np.pi / 2], abs=1e-5)


def test_bounds_grow_by_what_a_rounded_inverse_is_off() -> None:
    """With a factor r in all bounds ``eta = r e / (1 - r o)``, ``beta K eta = c r^3 / (1 - r o)^2``: both tell the same o > 0."""
    r, told = np.array([2.0, 2e11, 4e11]), []
    for factor in r:
        asked = mg.Tolerances(modes={"bound_rounding": factor})
        sure = mg.assemblies(mg.load("four-bar"), {"A": 0.5}, tolerances=asked).certificates[0]
        told.append((factor / sure.error, np.sqrt(factor**3 / sure.product)))
    by_error, by_product = np.array(told).T / np.array(told)[0][:, None]
    assert by_error[2] < 0.9
    np.testing.assert_allclose(by_error, 1 - (1 - by_error[1]) * r / r[1], rtol=1e-3)
    np.testing.assert_allclose(by_product, by_error, rtol=1e-3)


def test_every_regular_assembly_of_7r_is_certified_and_goes_on_in_solve() -> None:
    m = mg.load("7r")
    modes = mg.assemblies(m, {"O1": 0.3})
    assert modes.total == 16
    assert len(modes) >= 2
    assert modes.completeness == "proved"
    assert all(sure.proved and sure.error < 1e-9 < sure.radius for sure in modes.certificates)
    for mode, poses in zip(modes, modes.poses, strict=True):
        s = mg.kinematics(mode, {"O1": 0.3})
        assert np.abs(np.array([s.link(link.name).pose for link in m.links]) - poses).max() < 1e-9


def test_two_loops_are_tested_though_complex_modes_lie_far_away() -> None:
    """Two of the four ways to close the first loop are not real and 400 lengths away: known to few digits, they were lost."""
    m = mg.load("rcsr-csr")
    modes = mg.assemblies(m, {"O1": m.start["O1.Rz"]})
    assert (len(modes), modes.total, modes.completeness) == (4, 16, "tested")
    assert all(sure is not None and sure.proved for sure in modes.certificates)


def test_ends_far_away_count_where_they_are_plainly_not_real_and_once() -> None:
    """What is known to few digits may be the end of another track too, or real: then one may be missing."""
    m = mg.load("four-bar")
    family, here = Question(m, {"A": 0.5}).form.family, Question(m, {"A": 0.5}).start
    at = Member(family.target, here.x[family.rows])

    def account(*angles: complex) -> Ends:
        x = np.repeat(here.x[:, :1], len(angles), axis=1).astype(complex)
        x[family.free[0]] = angles
        known = Ends.none(len(x), len(angles))
        none, every = np.zeros(len(angles), dtype=bool), np.ones(len(angles), dtype=bool)
        _account(family, at, known, TrackRun(x, every, none, none), 0)
        return known

    far = 9.0j  # cosines of some 4,000
    assert account(0.3, 1.0 + far, -1.0 - far).clean
    assert not account(0.3, 1.0 + far, 1.001 + far).clean
    assert account(0.3, 1.0, 1.001).clean


@pytest.mark.slow
def test_the_set_and_its_order_do_not_depend_on_the_seed() -> None:
    m = mg.load("r-sc-c-r")
    sets = [mg.assemblies(m, {m.drives[0].freedom: 0.3}, seed=seed, cache=False) for seed in range(2)]
    for other in sets[1:]:
        assert np.abs(other.poses - sets[0].poses).max() < 1e-9
        assert len(other.complex) == len(sets[0].complex)


@pytest.mark.daily(1)
@pytest.mark.parametrize("name", ["rcsr", "rssr"])
def test_newton_from_many_guesses_finds_nothing_outside_the_set(name: str) -> None:
    m = mg.load(name)
    driver = m.drives[0].freedom
    here = closed_start(m)
    s, rng = here.system, np.random.default_rng(1)
    column = s.first_column[m.freedom(driver)[0]]
    value = float(here.x[s.single_rows[column], 0])
    modes = mg.assemblies(m, {driver: value})
    guess = s.advance(np.repeat(here.x, 400, axis=1), rng.uniform(-np.pi, np.pi, (s.n_freedoms, 400)))
    guess[s.single_rows[column]] = value
    x, error = close_all(s, guess, np.array([column]))
    x = x[:, error < 1e-10]
    assert x.shape[1] > 5
    driven_links = [i for i, link in enumerate(m.links) if link.name != m.frame]
    known = modes.poses[:, driven_links]
    for i in range(x.shape[1]):
        q = s.coordinates_of(x[:, [i]])[:, 0]
        start = dict(zip(m.freedom_names(), q.tolist(), strict=True))
        poses = user_poses(closed_start(m.replace(start=start)))[:, 0][driven_links]
        # the coupler of an S-S pair may spin: its origin on the axis and all other links tell
        gaps = np.abs(known[:, :, :3, :] - poses[:, :3, :]).reshape(len(known), len(driven_links), -1).max(axis=2)
        assert np.sort(gaps.min(axis=0))[: len(driven_links) - (name == "rssr")].max() < 1e-6


def test_several_positions_are_indexed_by_position_then_mode() -> None:
    modes = mg.assemblies(mg.load("slider-crank"), {"A": [0.1, 0.5, 0.9]})
    assert len(modes) == 3
    assert modes.completeness == "proved"
    assert [len(one) for one in modes] == [2, 2, 2]
    assert modes[2][0].start["A.Rz"] == 0.9


@pytest.mark.usefixtures("empty")
def test_a_second_call_takes_the_start_set_that_was_kept() -> None:
    m = general("R-Sp-R", seed=5)
    first = mg.assemblies(m, {"O1": 0.1}, seed=1)
    assert len(list(cache_folder().glob("start-*.npz"))) == 1
    said: list[str] = []
    second = mg.assemblies(general("R-Sp-R", seed=8), {"O1": 0.1}, seed=2, progress=said.append)
    assert not any("random member" in line for line in said)
    assert first.total == second.total == 2


@pytest.mark.usefixtures("empty")
def test_a_damaged_start_set_is_worked_out_anew() -> None:
    m = mg.load("four-bar")
    mg.assemblies(m, {"A": 0.1})
    for file in cache_folder().glob("start-*.npz"):
        file.write_bytes(file.read_bytes()[:100])
    assert len(mg.assemblies(m, {"A": 0.1})) == 2


def test_where_no_class_is_known_the_word_is_searched() -> None:
    for m, why in ((bennett(), "relations"), (mg.load("rchch"), "helical")):
        modes = mg.assemblies(m, {m.drives[0].freedom: 0.0}, guesses=50)
        assert modes.completeness == "searched"
        assert why in modes.evidence[0]
        assert modes.total is None


def test_assemblies_with_helical_pairs_are_closed_at_their_start() -> None:
    """A helical pair that has turned once more stands elsewhere: no turns are taken off it."""
    m = mg.load("rchch")
    modes = mg.assemblies(m, {m.drives[0].freedom: 0.0}, guesses=40, turns=2.0)
    assert len(modes) > 2
    assert any(abs(mode.start["O3.Rz"]) > np.pi for mode in modes)
    for mode in modes:
        s = closed_start(mode).system
        given = Configuration(s, s.state_of(s.start_coordinates(mode.start)[:, None]))
        assert given.closure[0] < 1e-10


def test_a_round_of_a_closed_curve_makes_no_further_assembly() -> None:
    """An eccentric disc under a point that slides: two heights, wherever on the rim the point is counted from."""
    E, R = 0.1, 0.5
    rim = mg.Curve.circle(radius=R, center=(E, 0, 0), axis=Z)
    pairs = [
        mg.Pair("A", "R", "frame", "disc", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "Ps", "disc", "follower", curve=rim, point=(0, np.sqrt(R * R - E * E), 0)),
        mg.Pair("C", "P", "frame", "follower", point=(0, 0, 0), axis=(0, 1, 0)),
    ]
    m = mg.Mechanism("eccentric", pairs=pairs, drives=["A"], frame="frame")
    modes = mg.assemblies(m, {"A": 0.7}, guesses=40)
    assert len(modes) == 2
    q = Question(m, {"A": 0.7})
    s, column = q.system, m.freedom_names().index("B.Ts")
    x = np.concatenate([s.state_of(s.start_coordinates(mode.start)[:, None]) for mode in modes], axis=1)
    rounds = x.copy()
    rounds[s.single_rows[column]] += np.array([1, -2]) * 2 * np.pi * R / s.par.L
    here, there = (Configuration(s, states) for states in (x, rounds))
    assert np.abs(here.poses - there.poses).max() < 1e-12
    assert np.abs(q.family.prints(here) - q.family.prints(there)).max() < 1e-12
    assert np.abs(q.coordinates(x) - q.coordinates(rounds)).max() < 1e-12


@pytest.mark.parametrize(("ends_at", "offsets"), [(None, [-5.97, -0.03]), ((-2.5, 0.5), [-0.03]), ((-0.02, 0.5), [])])
def test_an_assembly_beyond_the_end_of_a_slot_is_none(ends_at, offsets) -> None:
    """A crank of 1 at 0.3 rad in a lever that turns 2 below: the pin, 3 from the pivot at the start, is at 2.97 on either side of it."""
    slot = mg.Curve.line(point=(0, 1, 0), direction=(0, 1, 0), ends_at=ends_at)
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
        mg.Pair("C", "R", "frame", "lever", point=(0, -2, 0), axis=Z),
        mg.Pair("S", "Ps", "lever", "crank", point=(0, 1, 0), axis=Z, curve=slot),
    ]
    m = mg.Mechanism("quick return", pairs=pairs, drives=["A"])
    modes = mg.assemblies(m, {"A": 0.3}, guesses=40)
    assert sorted(round(mode.start["S.Ts"], 2) for mode in modes) == offsets
    if offsets:
        assert mg.assemble(m, {"A": 0.3}).start["S.Ts"] == pytest.approx(-0.03, abs=0.01)
    else:
        assert np.arccos((2.98**2 - 5) / 4) == pytest.approx(0.245154, abs=1e-6)
        with pytest.raises(mg.AssemblyError, match=r"came to A = 0.245\d*; there S.Ts comes to the end of its"):
            mg.assemble(m, {"A": 0.3})
        with pytest.raises(mg.AssemblyError, match=r"came to A = 0\.3; there S.Ts is beyond the end of its"):
            mg.assemble(m, {"A": 0.3}, guess={"C": 0.1})


def test_bad_arguments_are_all_named() -> None:
    with pytest.raises(mg.DeclarationError) as caught:
        mg.assemblies(mg.load("four-bar"), {"A": 0.1}, seed=-1, guesses=0, turns=0, progress=3)
    assert len(caught.value.faults) == 4


@pytest.mark.usefixtures("empty")
def test_progress_may_interrupt() -> None:
    def stop(line: str) -> None:
        raise KeyboardInterrupt(line)

    with pytest.raises(KeyboardInterrupt):
        mg.assemblies(mg.load("four-bar"), {"A": 0.1}, progress=stop)
    assert not list(cache_folder().glob("*"))


def planar(name: str, driver: str, **pairs: tuple[str, str, float, float]) -> mg.Mechanism:
    """Revolute pairs in a plane, ``A=(link, link, x, y)``."""
    made = [mg.Pair(k, "R", a, b, point=(x, y, 0.0), axis=(0, 0, 1)) for k, (a, b, x, y) in pairs.items()]
    return mg.Mechanism(name, pairs=made, drives=[driver], frame="ground")


FOUR = {
    "A": ("ground", "crank", 0, 0),
    "B": ("crank", "coupler", 0.5, 0.9),
    "C": ("coupler", "rocker", 2.4, 1.5),
    "D": ("ground", "rocker", 2.6, 0.1),
}
WATT = FOUR | {
    "E": ("rocker", "link5", 3.1, 1.2),
    "F": ("link5", "link6", 4.6, 1.9),
    "G": ("ground", "link6", 5.0, -0.2),
}
STEPHENSON = FOUR | {
    "E": ("coupler", "link5", 1.5, 2.4),
    "F": ("link5", "link6", 3.9, 2.2),
    "G": ("ground", "link6", 4.4, 0.3),
}


@pytest.mark.slow
@pytest.mark.parametrize(("pairs", "driver", "count"), [(WATT, "A", 4), (STEPHENSON, "A", 4), (STEPHENSON, "G", 6)])
def test_six_bars_have_four_assemblies_or_six_where_a_triad_is_left(
    pairs: dict[str, tuple[str, str, float, float]], driver: str, count: int
) -> None:
    """Stephenson's driven outside its four-bar: the coupler hangs on three legs."""
    modes = mg.assemblies(planar("six-bar", driver, **pairs), {driver: 0.1})
    assert modes.total == count
    assert modes.completeness == "proved"
    assert len(modes) + len(modes.complex) + modes.infinite == count


@pytest.mark.slow
def test_the_inverse_kinematics_of_general_arms_has_sixteen_solutions() -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        points, axes = rng.normal(size=(6, 3)), rng.normal(size=(6, 3))
        pairs = [mg.Pair(f"A{i}", "R", f"L{i}", f"L{i + 1}", point=points[i], axis=axes[i]) for i in range(6)]
        arm = mg.Mechanism("arm", pairs=pairs)
        angles = {f"A{i}": value for i, value in enumerate(rng.uniform(-1, 1, 6))}
        hand = mg.kinematics(arm, angles).link("L6").pose
        modes = mg.assemblies(arm, {"L6": hand})
        assert (modes.total, modes.completeness) == (16, "proved")
        assert len(modes) + len(modes.complex) == 16
        assert np.abs(modes.poses[:, -1] - hand).max() < 1e-9
        wanted = np.array(list(angles.values()))
        gaps = np.abs(np.angle(np.exp(1j * (modes.coordinates - wanted)))).max(axis=1)
        assert gaps.min() < 1e-9


def platform(feet: np.ndarray, heads: np.ndarray) -> mg.Mechanism:
    """Six legs, each with a slide between balls."""
    pairs = []
    for i, (foot, head) in enumerate(zip(feet, heads, strict=True)):
        pairs += [
            mg.Pair(f"A{i}", "S", "base", f"lower{i}", point=foot),
            mg.Pair(f"P{i}", "P", f"lower{i}", f"upper{i}", point=foot, axis=head - foot),
            mg.Pair(f"B{i}", "S", f"upper{i}", "platform", point=head),
        ]
    return mg.Mechanism("platform", pairs=pairs, frame="base")


def test_a_platform_of_six_legs_has_the_bound_of_forty() -> None:
    rng = np.random.default_rng(0)
    m = platform(rng.normal(size=(6, 3)), rng.normal(size=(6, 3)) + 3 * Z)
    family = Question(m, {f"P{i}": 0.0 for i in range(6)}).form.family
    found = bound(family)
    assert found is not None
    assert (found.count, family.rank, family.fault) == (40, 6, "")


def test_a_driver_at_its_dead_point_where_the_mechanism_is_declared_has_its_assemblies() -> None:
    """A slide cannot tell which way a stretched slider crank goes; its assemblies are those of the crank at other angles."""
    pins = {"A": ("frame", "crank", 0), "B": ("crank", "rod", 1), "C": ("rod", "slider", 4)}
    pairs = [mg.Pair(name, "R", a, b, point=(x, 0, 0), axis=(0, 0, 1)) for name, (a, b, x) in pins.items()]
    m = mg.Mechanism("stretched", None, [*pairs, mg.Pair("D", "P", "frame", "slider", point=(4, 0, 0), axis=(1, 0, 0))])
    modes = mg.assemblies(m, {"D": -1.0})
    crank = np.arccos((1 + 9 - 9) / (2 * 1 * 3))  # sides 1, 3 and 3
    assert np.allclose(sorted(mode.start["A.Rz"] for mode in modes), [-crank, crank], rtol=0, atol=1e-12)
    assert mg.assemblies(m, {"D": 0.0}).kinds == ("double",)
    over = mg.branches(m, "D", samples=8, points=40)
    assert sorted(round(fold.value, 9) for fold in over.folds) == [-2.0, 0.0]


def test_where_the_start_alone_is_flat_its_assemblies_are_those_of_any_other_start() -> None:
    """A parallelogram declared flat can begin two ways, which refuses no position; flat itself both are one."""
    places = {
        "A": ("ground", "crank", 0),
        "B": ("crank", "coupler", 1),
        "C": ("coupler", "rocker", 3),
        "D": ("rocker", "ground", 2),
    }
    pairs = [mg.Pair(name, "R", a, b, point=(x, 0, 0), axis=Z) for name, (a, b, x) in places.items()]
    bent, flat = mg.assemblies(mg.Mechanism("flat", pairs=pairs, frame="ground"), {"A": [0.4, 0.0]})
    assert (bent.kinds, bent.completeness) == (("regular",) * 2, "proved")
    # one is a parallelogram, the other that with its upper corner beyond the diagonal from the crank's tip
    tip = np.exp(0.4j)
    along = (2 - tip) / abs(2 - tip)
    corners = [tip + 2, tip + along * along * 2]
    rockers = sorted(-mode.start["D.Rz"] for mode in bent)
    assert rockers == pytest.approx(sorted(float(np.angle(corner - 2)) for corner in corners), abs=1e-11)
    assert (flat.kinds, flat.total) == (("double",), 2)


def test_couplings_whose_freedoms_are_driven_are_a_substitution() -> None:
    """Cranks of a five-bar geared to each other by two couplings, four turns of a motor on: two circles meet in two points."""
    places = {
        "A": ("ground", "left", 0, 0),
        "B": ("left", "one", 0.3, 1),
        "C": ("one", "two", 1.5, 2),
        "D": ("two", "right", 2.8, 0.8),
    }
    pairs = [mg.Pair(name, "R", a, b, point=(x, y, 0), axis=Z) for name, (a, b, x, y) in places.items()]
    pairs += [
        mg.Pair("E", "R", "ground", "right", point=(3, 0, 0), axis=Z),
        mg.Pair("M", "R", "ground", "motor", point=(9, 0, 0), axis=Z),
    ]
    couplings = [mg.Coupling({"A": 2.0, "E": 1.0, "M": 1.0}), mg.Coupling({"E": 1.0, "M": 0.5})]
    m = mg.Mechanism("geared", pairs=pairs, couplings=couplings, frame="ground")
    turn = 8 * np.pi + 0.2
    modes = mg.assemblies(m, {"M": turn})
    assert (modes.total, modes.completeness, len(modes)) == (2, "proved", 2)
    left = (0.3 + 1j) * np.exp(-0.25j * turn)
    right = 3 + (-0.2 + 0.8j) * np.exp(-0.5j * turn)
    way = right - left
    a, b = abs(1.2 + 1j), abs(1.3 - 1.2j)
    along = (a * a - b * b + abs(way) ** 2) / (2 * abs(way))
    pins = [left + way / abs(way) * (along + side * 1j * np.sqrt(a * a - along**2)) for side in (-1, 1)]
    one = [link.name for link in m.links].index("one")
    turned = modes.poses[:, one]
    found = (turned @ [1.5, 2.0, 0.0, 1.0])[:, :2] @ [1.0, 1.0j]
    assert sorted(found, key=lambda z: z.imag) == pytest.approx(sorted(pins, key=lambda z: z.imag), abs=1e-11)
    assert all(mode.start["E.Rz"] == pytest.approx(-0.5 * turn, abs=1e-12) for mode in modes)


def test_a_driver_that_can_never_drive_is_named() -> None:
    """Two loops side by side, one of them left alone."""
    pairs = []
    for side in ("left", "right"):
        links = ["ground", f"crank {side}", f"coupler {side}", f"rocker {side}", "ground"]
        for i, place in enumerate([(0, 0, 0), (0.5, 0.9, 0), (2.4, 1.5, 0), (2.6, 0.1, 0)]):
            pairs.append(mg.Pair(f"{side}{i}", "R", links[i], links[i + 1], point=place, axis=Z))
    m = mg.Mechanism("two", pairs=pairs, frame="ground")
    with pytest.raises(mg.IndeterminateError, match="neither driven nor passive"):
        mg.assemblies(m, {"left0": 0.5})


def test_the_table_of_assemblies_shows_their_coordinates() -> None:
    modes = mg.assemblies(mg.load("four-bar"), {"A": 0.3})
    for i, mode in enumerate(modes):
        angles = " +".join(f"{np.rad2deg(mode.start[name]):.5g}" for name in ("B.Rz", "C.Rz", "D.Rz"))
        assert re.search(rf"^{i} +{angles} +regular", str(modes), re.MULTILINE)
    # as it is declared: what is rounding is shown as zero
    assert re.search(r"^\d +0 +0 +0 +regular", str(mg.assemblies(mg.load("slider-crank"), {"A": 1e-17})), re.MULTILINE)


def test_platforms_are_told_by_their_poses_where_these_tell_all_apart() -> None:
    """Three legs of two bars: poses of the platform, in degrees; where two assemblies differ in legs alone the angles of pairs."""
    pairs = []
    for i, turn in enumerate(2 * np.pi * np.arange(3) / 3):
        out = np.array([np.cos(turn), np.sin(turn), 0.0])
        at = [3 * out, 2 * out + np.array([-out[1], out[0], 0.0]), out]
        links = ["ground", f"crank {i}", f"bar {i}", "platform"]
        pairs += [
            mg.Pair(f"{name}{i}", "R", a, b, point=p[:2])
            for name, a, b, p in zip("ABC", links[:3], links[1:], at, strict=True)
        ]
    m = mg.Mechanism("platform", pairs=pairs, frame="ground", planar=True)
    modes = mg.assemblies(m, {"A0": 0.1, "A1": 0.1, "A2": 0.15})
    table = modes.document().blocks[0]
    assert table.header[1:4] == ("platform.Tx", "platform.Ty", "platform.Rz [deg]")
    for row, X in zip(table.rows, modes.poses[:, modes[0].link_names().index("platform")], strict=True):
        x, y, angle = X[0, 3], X[1, 3], np.rad2deg(np.arctan2(X[1, 0], X[0, 0]))
        assert row[1:4] == tuple(f"{v:.5g}" for v in (x, y, angle))
    alike = mg.assemblies(m, {"platform": np.eye(4)})
    assert len(alike) == 8
    assert alike.document().blocks[0].header[1] == "A0.Rz [deg]"


def test_faults_of_what_is_given_name_the_question() -> None:
    with pytest.raises(mg.DeclarationError, match="assemblies of 'andrews': 1 fault"):
        mg.assemblies(mg.load("andrews"), {"no": 0})


@pytest.mark.usefixtures("empty")
@pytest.mark.parametrize("letters", ["R-Sg-C", pytest.param("R-Sc-C-R", marks=pytest.mark.slow)])
def test_the_trace_test_passes_with_all_assemblies_and_with_none_left_out(
    letters: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sums over all are rational functions over a pencil of mechanisms; with any one left out they are not."""
    m = general(letters)
    modes = mg.assemblies(m, {"O1": 0.2})
    assert modes.completeness == "tested"
    assert re.search(
        r"Trace test passed: over \d+ random mechanisms .* rational function of degree \d+", modes.evidence[0]
    )
    family = Question(m, {"O1": 0.2}).form.family
    start = start_sets.kept(family)
    assert start is not None
    assert start.trace.passed
    assert start.trace.beyond < 1e-9 < start.trace.last
    equations = Equations(family, start.mixing)
    monkeypatch.setattr("mechgraph.modes.start_sets.MOST_TRACKS", 200 * (start.x.shape[1] - 1))
    for i in range(min(2, start.x.shape[1])):
        some = np.delete(start.x, i, axis=1)
        assert not trace_test(equations, start.member, some, np.random.default_rng(i)).passed


@pytest.mark.usefixtures("empty")
def test_in_a_plane_a_sum_along_an_isotropic_direction_has_a_low_degree(monkeypatch: pytest.MonkeyPatch) -> None:
    """Over turned markers a sum over the six ways to close Stephenson's triad is of degree 19, told by hundreds of mechanisms."""
    family = Question(planar("triad", "G", **STEPHENSON), {"G": 0.1}).form.family
    start = start_set(family, np.random.default_rng(0))
    equations, rng = Equations(family, start.mixing), np.random.default_rng(1)
    whole = trace_test(equations, start.member, start.x, rng)
    assert (whole.degree, whole.samples) == (1, 16)
    monkeypatch.setattr("mechgraph.modes.start_sets.MOST_TRACKS", 16 * 5)
    assert not trace_test(equations, start.member, start.x[:, :5], rng).passed


@pytest.mark.usefixtures("empty")
def test_a_linear_sum_is_not_taken_of_groups_that_do_not_depend_on_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two four-bars on one crank, not split: two of their four assemblies that differ in both have a linear sum."""
    rng = np.random.default_rng(3)
    pairs = [mg.Pair("A", "R", "f", "c", point=(0, 0, 0), axis=Z)]
    for i in range(2):
        ends = [("c", f"k{i}"), (f"k{i}", f"r{i}"), (f"r{i}", "f")]
        pairs += [
            mg.Pair(f"{n}{i}", "R", *on, point=(*rng.normal(size=2), 0), axis=Z)
            for n, on in zip("BCD", ends, strict=True)
        ]
    monkeypatch.setattr("mechgraph.modes.start_sets.MOST_TRACKS", 64)
    family = Question(mg.Mechanism("bars", pairs=pairs, frame="f"), {"A": 0.1}).form.family
    start = start_set(family, np.random.default_rng(0))
    equations = Equations(family, start.mixing)
    for some in itertools.combinations(range(start.x.shape[1]), 2):
        assert not trace_test(equations, start.member, start.x[:, list(some)], np.random.default_rng(1)).passed


TRUSSES = {14: "01 05 06 12 23 26 34 45 46", 16: "01 03 06 12 14 23 35 45 46", 18: "01 02 05 06 14 23 34 36 45"}
"""The three trusses of three loops in a plane, by the links of their joints, and how many assemblies each has.

Source: N. Rojas and F. Thomas, Distance-based position analysis of the three seven-link Assur kinematic chains, MMT 46, 2011.
"""


@pytest.mark.slow
@pytest.mark.usefixtures("empty")
@pytest.mark.parametrize("count", TRUSSES)
def test_trusses_of_three_loops_pass_the_trace_test(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """That of fourteen was called searched, after 24,000 tracks; the others took thousands of tracks. One joint is on a crank."""
    monkeypatch.setattr("mechgraph.modes.start_sets.TRUSSES", ())
    rng = np.random.default_rng(1)
    ends = [(f"l{a}", f"l{b}") for a, b in TRUSSES[count].split()]
    joints = [("l0", "crank"), ("crank", ends[0][1]), *ends[1:]]
    pairs = [mg.Pair(f"J{k}", "R", *on, point=[*rng.normal(size=2), 0], axis=Z) for k, on in enumerate(joints)]
    modes = mg.assemblies(mg.Mechanism("truss", pairs=pairs, frame="l0"), {"J0": 0.1})
    assert (modes.total, modes.completeness) == (count, "tested")
    assert len(modes) + len(modes.complex) == count


def test_rational_functions_are_told_from_others() -> None:
    rng = np.random.default_rng(0)
    z = rng.normal(size=(60, 2)) @ [1.0, 1.0j]
    poles = rng.normal(size=(7, 2)) @ [1.0, 1.0j]
    exact = rational(z, (1.0 / (z[:, None] - poles)).sum(axis=1), np.ones(60))
    assert exact.degree == 7
    # of the last one nothing varies but the last digit of a value, which a function of low degree would do too
    still = 5.0 + 0j * z
    still[7] = np.nextafter(5.0, 6.0)
    for other in (np.sqrt(z - poles[0]), np.exp(z), np.log(z), z.conj(), still):
        assert not rational(z, other, np.ones(60)).passed


def test_what_passed_no_trace_test_is_tried_again_with_another_seed(
    empty: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of assemblies and of syntheses: kept as what was searched for; passed once it stays so."""
    loop, four = general("RRRSR"), four_bar()
    task = mg.function("A", "D", [[0.0, 0.0], [0.3, 0.2], [0.7, 0.5]])

    def words(seed: int) -> list[str]:
        one = mg.synthesize(four, task, ["C.point"], seed=seed)
        return [mg.assemblies(loop, {"O1": 0.1}, seed=seed).completeness, one.completeness]

    with monkeypatch.context() as failing:
        for module in ("synthesis.solve", "modes.start_sets"):
            failing.setattr(f"mechgraph.{module}.trace_test", lambda *_: start_sets.NOT_PASSED)
        assert [words(seed) for seed in (0, 1)] == [["searched"] * 2] * 2
    assert [words(seed) for seed in (0, 1, 0)] == [["searched"] * 2, ["tested"] * 2, ["tested"] * 2]


def test_samples_beside_poles_tell_a_rational_function_and_no_other() -> None:
    """Of 24 poles many are hidden among the others; further ones of a root are only ever found where it is sampled more."""

    def told(function: Callable[[np.ndarray], np.ndarray], beside: bool) -> int:
        rng = np.random.default_rng(0)
        z = rng.normal(size=(96, 2)) @ [1.0, 1.0j]
        for _ in range(3):
            if (found := rational(z, function(z), np.ones(len(z)))).passed:
                break
            more = np.exp(1j * _beside(_poles(z, function(z), np.ones(len(z))), rng)) if beside else z[:0]
            z = np.concatenate([z, more, rng.normal(size=(max(0, len(z) - len(more)), 2)) @ [1.0, 1.0j]])
        return found.degree

    poles = 0.2 * np.random.default_rng(1).normal(size=(24, 2)) @ [1.0, 1.0j] + 0.8
    assert told(lambda z: (1.0 / (z[:, None] - poles)).sum(axis=1), beside=False) == -1
    assert told(lambda z: (1.0 / (z[:, None] - poles)).sum(axis=1), beside=True) == 24
    assert told(lambda z: np.sqrt((z - poles[0]) * (z - poles[1])), beside=True) == -1


def test_after_a_stated_effort_what_was_found_is_called_searched(empty: None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mechgraph.modes.start_sets.MOST_TRACKED", 1)
    m = general("RCSR")
    modes = mg.assemblies(m, {"O1": 0.2})
    assert (modes.total, modes.completeness) == (4, "searched")
    assert any("others were not looked for any further" in text for text in modes.evidence)
    assert not list(cache_folder().glob("*"))


def test_how_many_there_are_is_estimated_from_what_random_loops_bring_again() -> None:
    """Loops that are random permutations of 4,000 numbers: from a third of them it is known to some percent how many there are."""

    class Numbers:
        family = None

        @staticmethod
        def fingerprints(_base: None, x: np.ndarray) -> np.ndarray:
            return x

    class Shuffled(start_sets.TrackGroup):
        def _round(self, _family: None, loops: int, rng: np.random.Generator, _progress: None) -> tuple[Any, Any]:
            come = [1.0 * rng.permutation(4000)[: self.x.shape[1]] for _ in range(loops)]
            return np.concatenate(come)[None], np.repeat(np.arange(loops), self.x.shape[1])

    told = list[float]()
    for seed in range(4):
        group, rng = Shuffled(Numbers(), None, np.zeros((1, 1)), 1300), np.random.default_rng(seed)
        group.grow(1e-4, rng, None)
        told.append(float(re.findall(r"of some (\S+) \(\+-\d+ %\)", group.estimate)[0]))
    assert np.abs(np.array(told) / 4000 - 1).max() < 0.15


@pytest.mark.slow
def test_an_assembly_that_rounding_had_told_apart_from_itself_is_one() -> None:
    """One of four is known to a few digits the second time: at another member both are one, so that a bound is not met too early."""
    q = Question(general("RCSR"), {"O1": 0.2})
    rng = np.random.default_rng(0)
    known = start_set(q.family, rng)
    off = known.x[:, 1] + 1e-5 * rng.normal(size=len(known.x))
    x = np.concatenate([known.x[:, :2], off[:, None], known.x[:, 2:]], axis=1)
    _, moved = tame(Equations(q.family, known.mixing), known.member, x, rng)
    assert (known.x.shape[1], moved.shape[1]) == (4, 4)


def test_tracks_to_infinity_are_none_that_come_to_an_assembly_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    """A horizontal platform on a usual base: twelve of forty tracks have no end, and Newton leads from there to ends of others.

    That eight of the others are real was found by Newton from 400 random poses of the platform, with the lengths of the legs alone.
    """
    feet, heads = (
        np.array([[r * np.cos(a), r * np.sin(a), z] for a in np.deg2rad(angles)])
        for r, z, angles in ((1.0, 0.0, [-10, 10, 110, 130, 230, 250]), (0.6, 1.0, [-50, 50, 70, 170, 190, 290]))
    )
    sought = list[int]()
    monkeypatch.setattr(targets, "close_all", lambda s, x, c: sought.append(x.shape[1]) or close_all(s, x, c))
    modes = mg.assemblies(platform(feet, heads), {f"P{i}": 0.0 for i in range(6)})
    assert (len(modes), len(modes.complex), modes.infinite, modes.completeness) == (8, 20, 12, "proved")
    assert sum(sought) == 0
    assert "Some paths failed" not in str(modes)


def test_a_platform_on_a_sphere_has_not_the_bound_of_one_in_a_plane() -> None:
    """Spherical triads have eight assemblies, planar ones six."""

    def triad(point: object) -> mg.Mechanism:
        rng = np.random.default_rng(1)
        pairs = []
        for i in range(3):
            for name, a, b in ((f"A{i}", "base", f"leg{i}"), (f"B{i}", f"leg{i}", "top")):
                place = rng.normal(size=3)
                pairs.append(
                    mg.Pair(name, "R", a, b, point=place * [1, 1, 0], axis=Z)
                    if point == "plane"
                    else mg.Pair(name, "R", a, b, point=(0, 0, 0), axis=place)
                )
        return mg.Mechanism("triad", pairs=pairs, frame="base")

    planar_bound = bound(Question(triad("plane"), {}).form.family)
    assert planar_bound is not None
    assert planar_bound.count == 6
    assert bound(Question(triad("sphere"), {}).form.family) is None


DIETMAIER = np.array(
    [
        [0, 1.107915, 0.549094, 0.735077, 0.514188, 0.590473],
        [0, 0, 0.756063, -0.223935, -0.526063, 0.094733],
        [0, 0, 0, 0.525991, -0.368418, -0.205018],
        [0, 0.542805, 0.956919, 0.665885, 0.478359, -0.137087],
        [0, 0, -0.528915, -0.353482, 1.158742, -0.235121],
        [0, 0, 0, 1.402538, 0.107672, 0.353913],
        [1, 0.645275, 1.086284, 1.503439, 1.281933, 0.771071],
    ]
)
"""Feet, heads and lengths of the legs of a platform with forty real postures.

Source: P. Dietmaier, The Stewart-Gough platform of general geometry can have 40 real postures, Advances in Robot Kinematics, 1998.
"""


@pytest.mark.parametrize("seeds", [2, pytest.param(10, marks=pytest.mark.slow)])
def test_a_platform_has_forty_real_assemblies_whatever_the_seed(seeds: int) -> None:
    feet, heads, lengths = DIETMAIER[:3].T, DIETMAIER[3:6].T + np.array([0.1, 0.2, 1.2]), DIETMAIER[6]
    m = platform(feet, heads)
    at = {f"P{i}": lengths[i] - np.linalg.norm(heads[i] - feet[i]) for i in range(6)}
    sets = [mg.assemblies(m, at, seed=seed) for seed in range(seeds)]
    for modes in sets:
        assert (len(modes), modes.total, modes.completeness) == (40, 40, "proved")
        assert all(sure is not None and sure.proved and sure.apart > 0.1 for sure in modes.certificates)
        assert np.abs(modes.poses - sets[0].poses).max() < 1e-6
    # the lengths of all legs in all postures, from the pose of the platform alone
    top = modes.poses[:, [link.name for link in m.links].index("platform")]
    ends = np.einsum("mij,lj->mli", top[:, :3, :3], heads) + top[:, None, :3, 3]
    assert np.abs(np.linalg.norm(ends - feet, axis=2) - lengths).max() < 1e-9


@pytest.mark.usefixtures("empty")
def test_where_a_bound_is_met_no_further_loops_are_run() -> None:
    family = Question(linked_four_bar(1.0, 2.5, 2.0, 3.0, 0.5), {"O0": 0.3}).form.family
    start = start_set(family, np.random.default_rng(0))
    assert (start.x.shape[1], start.loops, start.whole) == (2, 0, True)


def test_a_mode_is_one_line_of_the_table() -> None:
    """No number is broken over two lines in a text of the usual width."""
    modes = mg.assemblies(mg.load("7r"), {"O1": 0.3})
    lines = str(modes).splitlines()
    rule = next(i for i, line in enumerate(lines) if line.startswith("----"))
    rows = lines[rule + 1 :]
    assert [line.split()[0] for line in rows[: len(modes)]] == [str(i) for i in range(len(modes))]
    assert not rows[len(modes)]


def test_postures_of_a_planar_mechanism_at_a_coordinate_of_a_point_are_those_of_a_swept_crank() -> None:
    """The driver is free: of crank angles on both sides of the coupler those at which its point comes there."""
    m = four_bar()
    A, B, C, D = (complex(*pair.point[:2]) for pair in m.pairs)
    tip = complex(*m.link("coupler").points["tip"][:2])
    angles = np.linspace(0, 2 * np.pi, 100_001)
    pin = A + (B - A) * np.exp(1j * angles)
    reach, rod, rocker = D - pin, abs(C - B), abs(C - D)
    along = (rod**2 - rocker**2 + np.abs(reach) ** 2) / (2 * np.abs(reach))
    across = np.sqrt((rod**2 - along**2).astype(complex))
    count = 0
    for side in (1, -1):
        joint = pin + reach / np.abs(reach) * (along + 1j * side * across.real)
        off = (pin + (tip - B) * (joint - pin) / (C - B)).real - 1.4
        closed = across.imag[1:] + across.imag[:-1] == 0
        count += int((closed & (off[1:] * off[:-1] < 0)).sum())
    modes = mg.assemblies(m, {"coupler.tip.Tx": 1.4})
    assert len(modes) == count == 4
    places = [mg.kinematics(mode, {"A": mode.start["A.Rz"]}).link("coupler").at("tip").position[0] for mode in modes]
    assert places == pytest.approx([1.4] * 4)
    assert "coupler.Rz: read as radians" in str(mg.assemblies(m, {"coupler.Rz": 900.0}))
