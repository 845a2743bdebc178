"""Findings of the determinacy report: directions that stay unique, passive freedoms of several links, locked freedoms, drivers."""

from __future__ import annotations

import mechanisms as known
import numpy as np
import pytest
from mechanisms import X, Z
from screws import pose_exp

import mechgraph as mg

# --- unique by principal direction ----------------------------------------------------------------------------------------


def pinned_bar(types: str = "RR", end: tuple[float, float, float] = (3, 4, 0)) -> mg.Mechanism:
    """A bar on two pins to the frame: what lies in its line is tied."""
    return known.ring(types, [(0, 0, 0), end], [Z, Z], drives=[], name="pinned bar")


def test_force_across_a_pinned_bar_is_unique() -> None:
    report = mg.check(pinned_bar())
    assert not report.unique["O1"]["Fx"]
    assert not report.unique["O1"]["Fy"]
    assert report.reactions is not None
    texts = [t.text for t in report.reactions.unique_directions]
    assert len(texts) == 2
    for t in report.reactions.unique_directions:
        assert not t.across
        assert np.allclose(t.direction, (0.8, -0.6, 0))
        assert abs(np.dot(t.in_space, (0.6, 0.8, 0))) < 1e-12
    assert texts[0] == "O1: force along (0.8, -0.6, 0) is unique"
    assert texts[0] in report.text(full=True)


def test_force_across_a_bar_on_two_spheres() -> None:
    report = mg.check(pinned_bar("SS", (2, 3, 6)))
    assert report.reactions is not None
    assert [t.text for t in report.reactions.unique_directions] == [
        f"{pair}: force across (0.2857, 0.4286, 0.8571) is unique" for pair in report.pairs
    ]


def test_combinations_do_not_repeat_the_directions() -> None:
    report = mg.check(pinned_bar())
    assert report.reactions is not None
    for _, text in report.reactions.combinations:
        assert not ("O1:Fx" in text and "O1:Fy" in text)
    assert "Unique only in combination" in report.text(full=True)


def test_directions_and_combinations_together_are_all_there_is() -> None:
    """Their number is that of the components touched minus that of the self-stresses."""
    for build in (
        known.planar,
        known.three_cranks,
        known.sarrus,
        pinned_bar,
        lambda: pinned_bar("SS", (2, 3, 6)),
        known.door,
    ):
        report = mg.check(build())
        found = report.reactions
        assert found is not None
        loose = sum(not ok for row in report.unique.values() for ok in row.values())
        directions = sum(2 if t.across else 1 for t in found.unique_directions)
        assert directions + len(found.combinations) == loose - found.count


# --- passive freedoms --------------------------------------------------------------------------------------------------------


def rssr_with_coupler(middle: str | None, axis: object = None) -> mg.Mechanism:
    """RSSR with a coupler of two links, joined by ``middle`` on the line of the spheres."""
    b, c = np.array([0.3, 0, 0.1]), np.array([1.5, 0.6, 0.4])
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "S", "crank", "half1", point=b),
        mg.Pair("M", middle or "W", "half1", "half2", point=(b + c) / 2, axis=c - b if axis is None else axis),
        mg.Pair("C", "S", "half2", "rocker", point=c),
        mg.Pair("D", "R", "rocker", "frame", point=(1.3, -0.2, 0.5), axis=(-1, 2, 1)),
    ]
    return mg.Mechanism("RSSR", None, pairs, ["A"])


def test_welded_halves_spin_together() -> None:
    report = mg.check(rssr_with_coupler("W"))
    (spin,) = report.passive
    assert spin.links == ("half1", "half2")
    assert "half1 and half2 turn about the line B-C (S-S)" in spin.text
    assert spin.text.count("together") == 1
    assert report.determinate


@pytest.mark.parametrize("middle", ["R", "C"])
def test_coaxial_halves_spin_each_by_itself(middle: str) -> None:
    """A pair on the line of the spheres lets both halves turn; with C the distance of the spheres is free besides."""
    m = rssr_with_coupler(middle)
    m = m if middle == "R" else m.replace(drives=["A", "D"])
    report = mg.check(m)
    assert [p.links for p in report.passive] == [("half1",), ("half2",)]
    assert report.mobility == (3 if middle == "R" else 4)
    assert not report.undriven


def test_telescopic_coupler_spins_as_one_though_it_slides() -> None:
    report = mg.check(rssr_with_coupler("P"))
    assert [p.links for p in report.passive] == [("half1", "half2")]
    assert len(report.undriven) == 1


def test_skew_hinge_in_the_coupler_spins_as_one_only() -> None:
    """The hinge folds the coupler, which is a true freedom; only the spin about the line of the spheres is passive."""
    report = mg.check(rssr_with_coupler("R", axis=(0.3, -1, 0.4)))
    assert report.mobility == 3
    assert [p.links for p in report.passive] == [("half1", "half2")]


def test_a_pendulum_is_not_passive() -> None:
    m = mg.Mechanism("pendulum", None, [mg.Pair("A", "R", "frame", "bob", point=(0, 0, 0), axis=Z)])
    report = mg.check(m)
    assert not report.passive
    assert len(report.undriven) == 1
    assert "Under-driven" in str(report)


# --- locked freedoms and drivers -----------------------------------------------------------------------------------------------


def test_locked_turns_are_named_with_their_reason() -> None:
    (found,) = mg.check(mg.load("pphchp")).locked
    assert found.freedoms == ("O3.Rz", "O4.Rz", "O5.Rz")
    assert "stand still" in found.text
    assert "rigid spherical triangle" in found.text


def test_locked_freedoms_cannot_drive() -> None:
    report = mg.check(mg.load("pphchp"))
    assert {n for f in report.not_drivable for n in f.freedoms} == {"O3.Rz", "O4.Rz", "O5.Rz"}
    assert all("stands still" in f.text for f in report.not_drivable)


def test_freedoms_that_move_in_proportion_cannot_both_drive() -> None:
    """Two four-bars on one frame: within each, one driver is enough."""
    pairs = []
    for side, shift in (("a", 0.0), ("b", 5.0)):
        points = np.array([(0, 0, 0), (0.2, 1, 0), (2.2, 1.6, 0), (2, 0, 0)]) + np.array((shift, 0, 0))
        links = ["frame", *(f"{side}{k}" for k in range(1, 4)), "frame"]
        pairs += [mg.Pair(f"{side}{k}", "R", links[k - 1], links[k], point=points[k - 1], axis=Z) for k in range(1, 5)]
    report = mg.check(mg.Mechanism("two four-bars", None, pairs))
    assert report.mobility == 2
    groups = {tuple(sorted({n[0] for n in group})) for group in report.dependent_drives}
    assert groups == {("a",), ("b",)}
    assert [n[0] for n in report.suggested_drives] == ["a", "b"]
    both = mg.check(report.mechanism.replace(drives=["a1", "a4"]))
    assert both.contradicting_drives
    assert not both.determinate


def test_over_driven() -> None:
    report = mg.check(known.planar().replace(drives=["O1", "O4"]))
    assert report.contradicting_drives
    assert report.verdict.startswith("Over-driven")
    assert not report.unique["O1"]["effort"]


def test_passive_freedoms_cannot_drive() -> None:
    """Coupler between two coaxial cylinders: its slide and turn reach nothing."""
    m = known.ring("CC", [(0, 0, 0), (0, 0, 1)], [Z, Z], drives=[])
    report = mg.check(m)
    assert report.mobility == 2
    assert report.inputs == 2 - len(report.passive)


def test_sliding_plate_between_parallel_planes() -> None:
    m = known.ring("EE", [(0, 0, 0), (0.3, 0.2, 1)], [Z, Z], drives=[])
    report = mg.check(m)
    assert report.mobility == 3
    assert report.redundancy == 3
    assert X @ Z == 0


def test_freedoms_that_only_rest_here_are_not_called_locked() -> None:
    """A slider-crank stretched out: the slider stands still here, and moves in every nearby position."""
    bars = (("A", "frame", "crank", 0.0), ("B", "crank", "rod", 1.0), ("C", "rod", "slider", 3.0))
    pairs = [mg.Pair(name, "R", a, b, point=(x, 0, 0), axis=(0, 0, 1)) for name, a, b, x in bars]
    slide = mg.Pair("D", "P", "slider", "frame", point=(3, 0, 0), axis=(1, 0, 0))
    found = mg.check(mg.Mechanism("slider-crank", pairs=[*pairs, slide], drives=["A"])).locked
    assert [(f.freedoms, f.text) for f in found] == [
        (("D.Tz",), "D.Tz stands still in this position only: it moves in nearby positions")
    ]


def test_passive_freedoms_are_never_more_than_the_mobility() -> None:
    """Without drivers nearly everything in this loop is passive by definition; sums of motions that overlap count once."""
    rng = np.random.default_rng(0)
    direction = rng.normal(size=3)
    letters, parallel = "RRECSE", (True, True, True, False, False, True)
    pairs = []
    for k, (letter, along) in enumerate(zip(letters, parallel, strict=True)):
        ends = ("frame" if k == 0 else f"link{k}", "frame" if k == 5 else f"link{k + 1}")
        axis = direction if along else rng.normal(size=3)
        pairs.append(mg.Pair(f"O{k}", letter, *ends, point=rng.normal(size=3), axis=axis))
    report = mg.check(mg.Mechanism("overlapping", pairs=pairs))
    assert report.mobility == 7
    assert report.inputs == len(report.undriven) == len(report.suggested_drives) > 0
    assert report.inputs + len(report.passive) == 7


def test_motions_left_free_are_what_one_more_driver_does() -> None:
    """A planar five-bar: each motion moves one freedom at the frame and leaves the other at rest, in any placement."""
    corners = ((0, 0), (-1, 1), (0.5, 2.5), (2, 1.5), (1.5, 0))
    links = ("frame", "a", "b", "c", "d", "frame")
    pairs = [mg.Pair(f"P{i}", "R", links[i], links[i + 1], point=(*corners[i], 0), axis=(0, 0, 1)) for i in range(5)]
    m = mg.Mechanism("five-bar", pairs=pairs)
    for placed in (m, m.moved(pose_exp(np.array([0.3, -0.8, 0.5, 4.0, 5.0, 6.0])))):
        names = [f.freedoms for f in mg.check(placed).undriven]
        assert names == [("P0.Rz", "P1.Rz", "P2.Rz", "P3.Rz"), ("P1.Rz", "P2.Rz", "P3.Rz", "P4.Rz")]
        assert mg.check(placed).suggested_drives == ("P0.Rz", "P4.Rz")


def test_self_stress_names_every_driver_of_a_pair() -> None:
    """Two cylindrical pairs on one line, both freedoms of both driven: the drivers can strain each other."""
    pairs = [
        mg.Pair(name, "C", "frame", "body", point=(0, 0, z), axis=(0, 0, 1)) for name, z in (("A", 0.0), ("B", 1.0))
    ]
    m = mg.Mechanism("twice driven", pairs=pairs, drives=["A.Rz", "A.Tz", "B.Rz", "B.Tz"])
    efforts = [set(s.efforts) for s in mg.check(m).self_stresses if s.efforts]
    assert efforts == [{"A.Rz", "B.Rz"}, {"A.Tz", "B.Tz"}]


def test_second_direction_that_was_left_out_is_named() -> None:
    """A universal joint without its second direction: what was taken is said, and not where it is given."""
    pair = mg.Pair("A", "U", "frame", "body", point=(0, 0, 0), axis=Z)
    line = "A (U): its second direction is (1, 0, 0), by default."
    assert line in str(mg.check(mg.Mechanism("gimbal", pairs=[pair])))
    given = pair.replace(second=(0, 1, 0))
    assert "second direction" not in str(mg.check(mg.Mechanism("gimbal", pairs=[given])))


def test_more_drivers_than_motions_are_no_dead_point() -> None:
    corners = ((0, 0), (-1, 1), (0.5, 2.5), (2, 1.5), (1.5, 0))
    links = ("frame", "a", "b", "c", "d", "frame")
    pairs = [mg.Pair(f"P{i}", "R", links[i], links[i + 1], point=(*corners[i], 0), axis=(0, 0, 1)) for i in range(5)]
    report = mg.check(mg.Mechanism("five-bar", pairs=pairs, drives=["P0", "P1", "P4"]))
    assert report.verdict.startswith("Over-driven: mobility 2, 3 drivers")
    assert "ead point" not in str(report)


def test_a_driven_structure_says_that_it_is_one() -> None:
    with pytest.raises(mg.IndeterminateError, match="mobility is 0 at the start position"):
        mg.solve(mg.load("prprrh"), {"O1": [0.0, 0.1]})


# --- dead points and change points -----------------------------------------------------------------------------------------


def slider_crank(drive: str) -> mg.Mechanism:
    """Stretched out: the slider is at its dead point."""
    bars = (("A", "frame", "crank", 0.0), ("B", "crank", "rod", 1.0), ("C", "rod", "slider", 3.0))
    pairs = [mg.Pair(name, "R", a, b, point=(x, 0, 0), axis=Z) for name, a, b, x in bars]
    slide = mg.Pair("D", "P", "slider", "frame", point=(3, 0, 0), axis=X)
    return mg.Mechanism("slider-crank", pairs=[*pairs, slide], drives=[drive])


def test_a_driver_at_its_dead_point_is_replaced() -> None:
    report = mg.check(slider_crank("D"))
    assert report.verdict.startswith(
        "Singular drive: mobility 1, but the driver D.Tz cannot move it here (a dead point)."
    )
    assert (report.suggested_drives, report.replaced_drives) == (("A.Rz",), ("D.Tz",))
    assert report.advice[0].text == "drive A.Rz instead of D.Tz: then every freedom is driven or passive"
    text = report.text(full=True)
    assert "instead of D.Tz: A.Rz" in text
    assert "drive also" not in text
    assert "take one away" not in text
    instead = mg.check(slider_crank("A"))
    assert not instead.undriven
    assert not instead.replaced_drives


def test_the_driver_that_depends_on_another_is_replaced() -> None:
    """Two parallel four-bars side by side, both drivers in the first: the second of them is to move to the other one."""
    pairs = []
    for side, shift in (("a", 0.0), ("b", 5.0)):
        points = np.array([(0, 0, 0), (0.2, 1, 0), (2.2, 1.6, 0), (2, 0, 0)]) + np.array((shift, 0, 0))
        links = ["frame", *(f"{side}{k}" for k in range(1, 4)), "frame"]
        pairs += [mg.Pair(f"{side}{k}", "R", links[k - 1], links[k], point=points[k - 1], axis=Z) for k in range(1, 5)]
    report = mg.check(mg.Mechanism("two four-bars", None, pairs, ["a1", "a4"]))
    assert (report.suggested_drives, report.replaced_drives) == (("b1.Rz",), ("a4.Rz",))


@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_a_flat_parallelogram_says_its_finite_mobility_first(engine: str) -> None:
    corners = [(0, 0, 0), (1.0, 0, 0), (3, 0, 0), (2, 0, 0)]
    flat = known.ring("RRRR", corners, [Z] * 4, name="flat parallelogram")
    report = mg.check(flat, engine=engine)  # type: ignore[arg-type]
    assert (report.mobility, report.finite_mobility, report.change_point) == (2, 1, True)
    assert report.verdict.startswith("Finite mobility 1, 1 driver, at a change point: mobility 2 here")
    assert not report.suggested_drives
    assert not report.determinate
    undriven = mg.check(flat.replace(drives=[]), engine=engine)  # type: ignore[arg-type]
    assert undriven.verdict.startswith("Finite mobility 1, 0 drivers, under-driven at a change point")
    assert undriven.suggested_drives == ("O1.Rz",)


def test_a_freedom_that_is_shaky_everywhere_makes_no_change_point() -> None:
    corners = ((0, 0, 0), (0.3, 1, 0), (1.4, 1.2, 0), (1.1, 0.1, 0))
    names = ["frame", "a", "b", "c", "frame"]
    pairs = [mg.Pair(f"J{i}", "R", names[i], names[i + 1], point=corners[i], axis=Z) for i in range(4)]
    bars = ["b", "p", "q", "b"]
    pairs += [mg.Pair(f"K{i}", "R", bars[i], bars[i + 1], point=(0.5 + i, 2.0, 0), axis=Z) for i in range(3)]
    report = mg.check(mg.Mechanism("shaky on a coupler", None, pairs, ["J0"]))
    assert (report.mobility, report.finite_mobility, report.change_point) == (2, 1, False)


def test_drivers_are_suggested_for_a_ring_of_many_links() -> None:
    """A ring of 200 links has 194 freedoms; drivers that nearly depend on each other do not repeat a declared one."""
    turns = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    points = np.stack([5 * np.cos(turns), 5 * np.sin(turns), 0.1 * np.sin(3 * turns)], axis=1)
    axes = np.stack([0.1 * np.cos(5 * turns), 0.2 * np.sin(7 * turns), np.ones(200)], axis=1)
    report = mg.check(known.ring("R" * 200, points, axes))
    assert report.mobility == 194
    assert len(set(report.suggested_drives)) == len(report.suggested_drives) == 193
    assert "O1.Rz" not in report.suggested_drives


# --- one body, several motions; links that stand still together ---------------------------------------------------------------


def sleeve() -> mg.Mechanism:
    """A body on one line of two cylindrical pairs, heavy, with a couple about the line."""
    links = [mg.Link("frame"), mg.Link("crank"), mg.Link("body", 2.0, (1.2, 0, 0.5), np.eye(3))]
    pairs = [mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z)]
    pairs += [mg.Pair(n, "C", *ends, point=(1, 0, z), axis=Z) for n, ends, z in
              (("B", ("crank", "body"), 0.0), ("C", ("body", "crank"), 1.0))]  # fmt: skip
    loads = [mg.Gravity((0, -1, -9.81)), mg.Wrench("body", moment=(0, 0, 3.0), point=(0, 0, 0))]
    return mg.Mechanism("sleeve", links, pairs, ["A"], loads)


def test_a_sleeve_turns_and_slides() -> None:
    """Two passive freedoms of one body are a turn and a slide, not twice the same words."""
    turn, slide = mg.check(sleeve()).passive
    assert turn.text.startswith("body turns about the line B-C (C-C)")
    assert slide.text.startswith("body slides along (0, 0, 1) in the pairs B, C")
    assert slide.freedoms == ("B.Tz", "C.Tz")


def test_holds_of_one_body_are_numbered() -> None:
    """The couple against 3 and the weight across, 2 * 0.2; the force against the weight along the line."""
    with pytest.warns(mg.MechgraphWarning, match="load-bearing"):
        s = mg.solve(sleeve(), {"A": 0.0})
    assert list(s.passive_effort) == ["body", "body (2)"]
    np.testing.assert_allclose(s.passive_effort["body"], -2.6, atol=1e-9)
    np.testing.assert_allclose(s.passive_effort["body (2)"], 2 * 9.81, atol=1e-9)


def test_halves_that_no_motion_moves_against_each_other_spin_together() -> None:
    """Two skew hinges make one body of two links, though each allows a turn."""
    m = rssr_with_coupler("R")
    b, c = np.array([0.3, 0, 0.1]), np.array([1.5, 0.6, 0.4])
    again = mg.Pair("M2", "R", "half1", "half2", point=(b + c) / 2 + (0, 0, 0.2), axis=(0.3, -1, 0.4))
    report = mg.check(m.replace(pairs=[*m.pairs, again]))
    (spin,) = report.passive
    assert spin.links == ("half1", "half2")
    assert "half1 and half2 turn about the line B-C (S-S)" in spin.text


def test_a_welded_shaft_in_three_bearings_is_one_body() -> None:
    """No two pairs cut it off, so that its two links have to be taken together."""
    pairs = [mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z)]
    pairs.append(mg.Pair("B", "C", "crank", "half1", point=(1, 0, 0), axis=Z))
    pairs.append(mg.Pair("M", "W", "half1", "half2", point=(1, 0, 0.5)))
    pairs += [mg.Pair(n, "C", "half2", "crank", point=(1, 0, z), axis=Z) for n, z in (("C", 1.0), ("D", 2.0))]
    report = mg.check(mg.Mechanism("shaft", None, pairs, ["A"]))
    assert [p.links for p in report.passive] == [("half1", "half2")] * 2
    assert not report.undriven


def test_efforts_of_several_drivers_are_unique() -> None:
    pairs = []
    for side, shift in (("a", 0.0), ("b", 5.0)):
        points = np.array([(0, 0, 0), (0.2, 1, 0), (2.2, 1.6, 0), (2, 0, 0)]) + np.array((shift, 0, 0))
        links = ["frame", *(f"{side}{k}" for k in range(1, 4)), "frame"]
        pairs += [mg.Pair(f"{side}{k}", "R", links[k - 1], links[k], point=points[k - 1], axis=Z) for k in range(1, 5)]
    report = mg.check(mg.Mechanism("two four-bars", None, pairs, ["a1", "b1"]))
    assert report.unique["a1"]["effort"]
    assert report.unique["b1"]["effort"]
    assert "all in-plane forces and driver efforts are unique" in report.verdict


@pytest.mark.parametrize(
    ("drives", "words"),
    [
        (["O1"], "and the driver effort are unique"),
        (["O3"], "and the driver effort are unique"),
    ],
)
def test_driver_efforts_are_told_apart_from_reactions_that_are_not_unique(drives: list[str], words: str) -> None:
    """A planar four-bar is redundant by three; one driver balances what it has to, two strain each other."""
    report = mg.check(known.planar().replace(drives=drives))
    assert words in report.verdict
    assert [report.unique[d]["effort"] for d in drives] == [len(drives) == 1] * len(drives)
