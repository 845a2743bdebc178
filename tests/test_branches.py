"""Branches over a driver: folds, circuits and full turns of four-bars by their closed forms, and as solve meets them."""

from __future__ import annotations

import numpy as np
import pytest
from mechanisms import FourBarFormula, hexapod, linked_four_bar
from scipy.spatial.transform import Rotation
from test_assembly_groups import spatial

import mechgraph as mg
from mechgraph.modes import branches
from mechgraph.modes.circuits import Circuits
from mechgraph.modes.homotopy import RealLeg


def angle_at(a: float, d: float, reach: float) -> float:
    """Crank angle at which its tip is ``reach`` away from the other fixed pivot."""
    return float(np.arccos((a * a + d * d - reach * reach) / (2 * a * d)))


def test_the_crank_of_a_crank_rocker_turns_right_round_on_two_circuits() -> None:
    b = mg.branches(linked_four_bar(1.0, 2.5, 2.0, 3.0, 0.5), "O0", samples=12, points=120)
    assert b.full_turn == (True, True)
    assert b.circuits == ((0,), (1,))
    assert b.folds == ()
    assert b.open_ends == 0
    assert all(np.isclose(high - low, 2 * np.pi) for low, high in b.intervals)
    # the rocker swings between the positions in which crank and coupler are in line
    a, coupler, c, d = 1.0, 2.5, 2.0, 3.0
    swing = np.arccos((c * c + d * d - (coupler + a) ** 2) / (2 * c * d)) - np.arccos(
        (c * c + d * d - (coupler - a) ** 2) / (2 * c * d)
    )
    for ranges in b.ranges:
        low, high = ranges["O3.Rz"]
        assert np.isclose(high - low, swing, atol=2e-3)  # of 120 positions the extreme ones are not met exactly


def test_a_double_rocker_turns_back_where_coupler_and_follower_are_in_line_and_is_one_circuit() -> None:
    a, coupler, c, d = 2.0, 1.5, 2.5, 3.0
    m = linked_four_bar(a, coupler, c, d, 0.9)
    b = mg.branches(m, "O0", samples=12, points=120)
    upper = angle_at(a, d, coupler + c)
    assert b.full_turn == (False, False)
    assert b.circuits == ((0, 1),)
    folds = np.sort([np.angle(np.exp(1j * f.value)) for f in b.folds])
    assert np.allclose(folds, [-upper, upper], rtol=0, atol=1e-8)
    assert sorted(f.sense for f in b.folds) == [-1, 1]
    with pytest.raises(mg.ReachError) as caught:
        mg.kinematics(m, {"O0": np.linspace(0.9, 3.0, 40)})
    assert abs(caught.value.value["O0.Rz"] - upper) < 1e-8


def test_the_circuit_of_the_start_is_found_between_samples_and_what_moves_most_at_its_folds() -> None:
    """The crank swings by some 3 degrees, while coupler and follower fold through their line."""
    a, coupler, c, d = 2.0, 0.5, 0.505, 3.0
    m = linked_four_bar(a, coupler, c, d, 0.01)
    b = mg.branches(m, "O0", samples=3, points=9)
    fold = angle_at(a, d, coupler + c)
    assert (b.circuits, b.full_turn, b.open_ends) == (((0, 1),), (False, False), 0)
    assert np.allclose([f.value for f in b.folds], [-fold, fold], rtol=0, atol=1e-8)
    assert {f.fastest for f in b.folds} == {"O2.Rz"}  # in line the coupler turns against the follower


@pytest.mark.parametrize(("reach", "samples"), [(2.0, 24), (2.0, 3), (4.98, 3)])
def test_circuits_that_lie_wholly_between_samples_are_found(reach: float, samples: int) -> None:
    """A short rocker leaves the crank some degrees on either side of the ground; with 3 samples both circuits lie between the same two."""
    a, d, c = 2.0, 3.0, 0.01
    m = linked_four_bar(a, reach, c, d, angle_at(a, d, reach))
    b = mg.branches(m, "O0", samples=samples, points=2 * samples)
    folds = [sign * angle_at(a, d, reach + extreme) for sign in (1, -1) for extreme in (-c, c)]
    found = [np.angle(np.exp(1j * f.value)) for f in b.folds]
    assert np.allclose(np.sort(found), np.sort(folds), rtol=0, atol=1e-8)
    assert (len(b.circuits), b.full_turn, b.open_ends, b.completeness) == (2, (False,) * 4, 0, "proved")


def test_where_the_range_ends_and_not_the_branch_is_told() -> None:
    """The crank turns from the ground line to its fold."""
    m = linked_four_bar(2.0, 0.5, 0.505, 3.0, 0.01)
    told = [" ".join(str(mg.branches(m, "O0", over=over, samples=3, points=9)).split()) for over in ((0.0, 1.0), None)]
    assert "At 0 deg the range of O0.Rz ends, not the branch" in told[0]
    assert "the range of" not in told[1]


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_few_samples_tell_the_same_as_many_where_groups_fold_one_after_the_other(seed: int) -> None:
    """A fold of the first loop alone is a double point that is not real for the second: beyond it all goes on."""
    m = spatial(("RSSR", "frame", "frame"), ("SSP", "03", "frame"), seed=seed)
    coarse, fine = (mg.branches(m, "O0", samples=n, points=40) for n in (4, 40))
    assert (coarse.completeness, coarse.open_ends) == (fine.completeness, 0) == ("proved", 0)
    assert sorted(map(len, coarse.circuits)) == sorted(map(len, fine.circuits))
    assert np.allclose(
        *(np.sort(np.mod([f.value for f in b.folds], 2 * np.pi)) for b in (coarse, fine)), rtol=0, atol=1e-6
    )


def test_where_what_is_not_real_is_lost_nothing_is_proved(monkeypatch: pytest.MonkeyPatch) -> None:
    m = linked_four_bar(2.0, 1.5, 2.5, 3.0, 0.9)
    known = mg.branches(m, "O0", samples=3, points=6)
    monkeypatch.setattr(RealLeg, "keeps", lambda leg, before, after: np.zeros(after.shape[1], dtype=bool))
    b = mg.branches(m, "O0", samples=3, points=6)
    assert (known.completeness, b.completeness, len(b)) == ("proved", "tested", len(known))
    assert "may be missing" in str(b)
    assert "may be missing" not in str(known)


def test_a_parallelogram_has_its_branches_cross_and_all_are_one_circuit() -> None:
    b = mg.branches(linked_four_bar(1.0, 2.0, 1.0, 2.0, 0.5), "O0", samples=12, points=120)
    assert len(b.circuits) == 1
    assert sorted(round(np.cos(x.value), 6) for x in b.bifurcations) == [-1.0, 1.0]
    assert all(x.branches == (0, 1) for x in b.bifurcations)


def test_circuits_are_what_solve_runs_through() -> None:
    m = mg.load("rssr")
    b = mg.branches(m, "A", samples=8, points=64)
    assert b.open_ends == 0
    for one in b.branches:
        start = dict(zip(m.freedom_names(), one.coordinates[0].tolist(), strict=True))
        s = mg.kinematics(m.replace(start=start), {"A": one.values}, on_reach="flag")
        solved, rocker = s.status == "ok", m.freedom_names().index("D.Rz")
        assert solved.mean() > 0.9
        assert np.abs(s["D"].position[:, 0] - one.coordinates[:, rocker])[solved].max() < 1e-8


@pytest.mark.slow
def test_branches_between_samples_are_found_behind_folds() -> None:
    """Two of four branches begin between two samples, and are those of samples that lie on them."""
    m = spatial(("RSSR", "frame", "frame"), ("SSP", "03", "frame"), seed=3)
    coarse, fine = (mg.branches(m, "O0", over=(0.0, 0.09), samples=n, points=20) for n in (3, 20))
    for b in (coarse, fine):
        assert (len(b), len(b.circuits), b.open_ends) == (4, 1, 0)
    assert np.allclose(coarse.intervals, fine.intervals, rtol=0, atol=1e-8)
    assert np.allclose([f.value for f in coarse.folds], [f.value for f in fine.folds], rtol=0, atol=1e-8)


def test_an_end_that_is_not_told_is_none_and_leaves_the_map_open() -> None:
    """A slot ends where nothing else begins."""
    x = np.linspace(-0.5, 0.6, 12)
    slot = mg.Curve.through(points=np.stack([x, 0.3 * x * x, 0.0 * x], axis=1))
    m = mg.Mechanism(
        "pin in a slot",
        pairs=[
            mg.Pair("X", "P", "frame", "carriage", point=(0, 0, 0), axis=(1, 0, 0)),
            mg.Pair("Y", "P", "carriage", "pin", point=(0, 0, 0), axis=(0, 1, 0)),
            mg.Pair("G", "Sg", "frame", "pin", point=(0, 0, 0), curve=slot),
        ],
        drives=["X"],
    )
    b = mg.branches(m, "X", samples=3, points=6)
    assert (b.full_turn, b.open_ends) == ((None,), 2)
    assert b.intervals[0] == pytest.approx((-0.5, 0.6), abs=1e-8)
    assert "not told" in str(b)
    assert (b.completeness, b.evidence) == (
        "searched",
        ("Circuits that lie wholly between samples were not looked for.",),
    )


def test_branch_circuit_and_order_defects_are_told() -> None:
    m = linked_four_bar(1.0, 2.5, 2.0, 3.0, 0.5)
    b = mg.branches(m, "O0", samples=12, points=120)
    positions = mg.assemblies(m, {"O0": [0.3, 1.0, 2.0, 4.0]})
    first = b.defects([positions[0][0]]).branches[0]
    mine = [next(p for p in at if b.defects([p]).branches == (first,)) for at in positions]
    other = next(p for p in positions[1] if b.defects([p]).branches != (first,))
    good = b.defects(mine)
    assert (good.branch, good.circuit, good.order) == (False, False, False)
    assert b.defects([mine[0], mine[2], mine[1], mine[3]]).order
    assert not b.defects([mine[2], mine[3], mine[0], mine[1]]).order
    wrong = b.defects([mine[0], other])
    assert (wrong.branch, wrong.circuit) == (True, True)


def test_a_position_is_on_the_branch_that_leads_there() -> None:
    """Next to its change point branches of a four-bar pass each other closely; on each the rocker is on one side of the coupler."""
    m = linked_four_bar(1.17, 1.93, 1.1295, 1.97, 0.5)
    b = mg.branches(m, "O0", samples=12, points=60)
    rocker = m.freedom_names().index("O2.Rz")
    for angle in (-0.02, 0.02):
        for mode in mg.assemblies(m, {"O0": angle}):
            branch = b.branches[b.defects([mode]).branches[0]]
            assert branch.interval[0] - 2 * np.pi < angle < branch.interval[1]
            assert np.sin(mode.start["O2.Rz"]) * np.sin(branch.coordinates[3, rocker]) > 0
    with pytest.raises(mg.DeclarationError, match="position 1: expected one to which a branch of the map leads"):
        b.defects([mode, mode.start | {"O3.Rz": 0.2}])


@pytest.mark.daily(4)
@pytest.mark.parametrize("seed", range(1000))
def test_branch_and_circuit_of_every_position_are_those_of_the_closed_form(seed: int) -> None:
    """Of four-bars, many of them near a change point, at places anywhere and near folds; their crank turns right round without folds."""
    known = FourBarFormula(np.random.default_rng(seed))
    asked = [(angle, side) for angle in known.angles(5) for side in (1, -1)]
    if not asked:  # closes nowhere
        return
    b = mg.branches(known.mechanism(*asked[0]), "O0", samples=12, points=24)
    assert len(b.circuits) == (1 if len(known.folds) == 2 else 2)
    assert set(b.full_turn) == {not known.folds.size}
    found = b.defects([known.start(*at) for at in asked])
    for numbers, formula in ((found.branches, known.branch), (found.circuits, known.circuit)):
        told = {(number, formula(*at)) for number, at in zip(numbers, asked, strict=True)}
        assert len({number for number, _ in told}) == len({name for _, name in told}) == len(told)


def test_a_platform_on_legs_that_spin_has_as_many_branches_as_assemblies() -> None:
    """Legs between balls spin: at a fold nothing but the platform tells its motion from theirs, and they come back elsewhere."""
    m = hexapod("SPS")
    b = mg.branches(m, "P1", over=(-1.5, 2.0), samples=4, points=8)
    assert (sorted(map(len, b.circuits)), b.open_ends) == ([4, 4], 0)
    found = mg.assemblies(m, dict.fromkeys((f"P{k}" for k in range(2, 7)), 0.0) | {"P1": 0.86})
    assert sum(low < 0.86 < high for low, high in b.intervals) == len(found)
    assert len(set(b.defects(list(found)).branches)) == len(found)


def test_nothing_is_lost_where_a_leg_passes_length_zero() -> None:
    """Squares of its length turn back there, between samples."""
    b = mg.branches(hexapod("UPS"), "P1", over=(-2.5, -1.5), samples=3, points=3)
    assert (len(b), b.completeness) == (0, "proved")


def test_of_assemblies_on_one_circuit_one_is_followed(monkeypatch: pytest.MonkeyPatch) -> None:
    made = list[Circuits]()
    monkeypatch.setattr(branches, "Circuits", lambda *given: made.append(Circuits(*given)) or made[-1])
    m = linked_four_bar(2.0, 1.5, 2.5, 3.0, 0.9)
    assert mg.branches(m, "O0", samples=6, points=6).circuits == ((0, 1),)
    assert [(of.V, len(np.unique(of.a.case))) for of in made] == [(2, 1)]


def test_a_driver_that_cannot_move_has_no_branches() -> None:
    """A structure; a five-bar held by two of its three drives."""
    with pytest.raises(mg.IndeterminateError, match="mobility is 0"):
        mg.branches(mg.load("prprrh"), "O1")
    corners, links = ((0, 0), (-1, 1), (0.5, 2.5), (2, 1.5), (1.5, 0)), ("frame", *"abcd", "frame")
    pairs = [mg.Pair(f"P{i}", "R", *links[i : i + 2], point=(*at, 0), axis=(0, 0, 1)) for i, at in enumerate(corners)]
    with pytest.raises(mg.IndeterminateError, match=r"P0\.Rz cannot move while P1\.Rz, P4\.Rz rest"):
        mg.branches(mg.Mechanism("five-bar", pairs=pairs, drives=["P0", "P1", "P4"]), "P0")


def test_bad_arguments_of_a_map_are_all_named() -> None:
    """Those of a wrong kind at once, then wrong values at once."""
    for bad, count in (({"samples": 1, "points": 0}, 2), ({"over": (1.0, 0.0)}, 2)):
        with pytest.raises(mg.DeclarationError) as caught:
            mg.branches(mg.load("four-bar"), "Q", **bad)
        assert len(caught.value.faults) == count


def test_turns_are_those_next_to_the_start() -> None:
    """The output of RSSR stands at 0 where the crank does, on the branch of the start."""
    m = mg.load("rssr")
    s = mg.solve(m, {"A": np.linspace(0, 2 * np.pi, 25)[:-1]})["D"].position
    ranges = [found["D.Rz"] for found in mg.branches(m, "A", samples=12, points=24).ranges]
    assert any(np.allclose(one, (s.min(), s.max()), atol=0.02) for one in ranges)
    assert all(-np.pi < middle <= np.pi for middle in map(np.mean, ranges))


@pytest.mark.daily(1)
@pytest.mark.parametrize("samples", [12, 13])
def test_whether_the_driver_turns_right_round_does_not_depend_on_the_samples(samples: int) -> None:
    """Declared at a right angle, samples of a parallelogram at whole parts of a turn from there would lie where its branches cross."""
    b = mg.branches(linked_four_bar(1.0, 2.0, 1.0, 2.0, np.pi / 2), "O0", samples=samples, points=5 * samples)
    assert (b.full_turn, b.circuits, b.open_ends) == ((True, True), ((0, 1),), 0)


@pytest.mark.slow
def test_samples_that_lie_on_double_points_change_nothing() -> None:
    m = linked_four_bar(1.0, 2.0, 1.0, 2.0, np.pi - 2 * np.pi / 12 * (2 + (3 - 5**0.5) / 2))
    b = mg.branches(m, "O0", samples=12, points=24)
    assert (b.full_turn, b.circuits, b.open_ends) == ((True, True), ((0, 1),), 0)


def test_circuits_of_two_loops_that_meet_at_one_place_are_one() -> None:
    """Cranks of two parallelograms in a row are in line with their ground together, where four branches cross."""
    ends = [("frame", "first"), ("first", "rod"), ("rod", "middle"), ("frame", "middle")]
    ends += [("middle", "other rod"), ("other rod", "last"), ("frame", "last")]
    points = [(0, 0), (0.6, 0.8), (2.6, 0.8), (2, 0), (2.6, 0.8), (5.6, 0.8), (5, 0)]
    pairs = [mg.Pair(n, "R", *of, point=at) for n, of, at in zip("ABCDEFG", ends, points, strict=True)]
    b = mg.branches(mg.Mechanism("parallelograms", pairs=pairs, drives=["A"], planar=True), "A", samples=4, points=8)
    assert (b.circuits, b.full_turn, b.open_ends) == (((0, 1, 2, 3),), (True,) * 4, 0)
    assert [at.branches for at in b.bifurcations] == [(0, 1, 2, 3)] * 2
    assert np.allclose(np.sin([at.value + np.arctan2(0.8, 0.6) for at in b.bifurcations]), 0.0, atol=1e-5)


def test_a_whole_turn_has_no_ends_in_the_table() -> None:
    b = mg.branches(mg.load("four-bar"), "A", samples=6, points=60)
    assert [row[2:] for row in b.document().blocks[0].rows] == [("all round", "yes")] * 2
    swings = mg.branches(mg.load("four-bar"), "D", samples=6, points=60)
    assert all(" .. " in row[2] for row in swings.document().blocks[0].rows)


def test_a_circuit_closes_where_both_ways_along_it_end_not_beyond() -> None:
    """The rod of an RSSR spins; a crank turns back only where the rocker has one position: ``A cos + B sin + C = 0`` of its angle."""
    rng = np.random.default_rng(1)
    (one, p), (two, q), a, b = *((rng.normal(size=3), rng.uniform(-1, 1, 3)) for _ in "AD"), *rng.uniform(-1, 1, (2, 3))
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=p, axis=one),
        mg.Pair("D", "R", "frame", "rocker", point=q, axis=two),
        mg.Pair("B", "S", "crank", "rod", point=a),
        mg.Pair("C", "S", "rod", "rocker", point=b),
    ]
    found = mg.branches(mg.Mechanism("RSSR", pairs=pairs, drives=["A"]), "A", points=24)
    assert (found.circuits, found.completeness) == (((0, 1), (2, 3)), "proved")

    def turned(u: float, axis: np.ndarray, center: np.ndarray, at: np.ndarray) -> np.ndarray:
        return center + Rotation.from_rotvec(u * axis / np.linalg.norm(axis)).apply(at - center)

    for fold in found.folds:
        tip = turned(fold.value, one, p, a)
        left = [np.sum((turned(u, two, q, b) - tip) ** 2) - np.sum((a - b) ** 2) for u in (0.0, np.pi / 2, np.pi)]
        C = 0.5 * (left[0] + left[2])
        assert np.hypot(left[0] - C, left[1] - C) == pytest.approx(abs(C), abs=1e-8)
