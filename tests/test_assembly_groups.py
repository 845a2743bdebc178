"""Assemblies group by group: the groups that are found, and the same modes as when all is solved at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_modes import FOUR, STEPHENSON, WATT, planar, platform

import mechgraph as mg
from mechgraph.modes.assemblies import Question
from mechgraph.modes.targets import EquationGroup, Undivided, groups_of

ON_A_COUPLER = {
    "A": ("a", "b", 0.0, 2.0),
    "B": ("b", "c", 0.5, 2.9),
    "C": ("c", "d", 2.4, 3.5),
    "D": ("a", "d", 2.6, 2.1),
    "E": ("ground", "f", -0.4, 0.1),
    "F": ("f", "a", -0.2, 1.6),
    "G": ("ground", "e", 4.0, 0.2),
    "H": ("c", "e", 3.5, 3.0),
}
"""A driven four-bar of moving links, one of them on a rocker, another on a driven crank."""


def spatial(*chains: tuple[str, str, str], seed: int = 5) -> mg.Mechanism:
    """Chains of pairs anywhere, each given by its letters and the links at its ends."""
    rng, pairs = np.random.default_rng(seed), []
    for number, (letters, begin, end) in enumerate(chains):
        links = [begin, *(f"{number}{i}" for i in range(1, len(letters))), end]
        for symbol, a, b in zip(letters, links, links[1:], strict=False):
            place = {"point": rng.normal(size=3)} | ({} if symbol == "S" else {"axis": rng.normal(size=3)})
            pairs.append(mg.Pair(f"O{len(pairs)}", symbol, a, b, **place))
    return mg.Mechanism("spatial", pairs=pairs, frame="frame")


RODS = spatial(("RSSR", "frame", "frame"), ("SSP", "03", "frame"))
"""An RSSR, and at its output link a rod to a slide."""


@pytest.mark.parametrize(
    ("m", "driven", "groups"),
    [
        (planar("Watt", "A", **WATT), "A", ["BCD", "EFG"]),
        (planar("Stephenson", "A", **STEPHENSON), "A", ["BCD", "EFG"]),
        (planar("triad", "G", **STEPHENSON), "G", ["ABCDEFG"]),
        (planar("coupler", "A", **ON_A_COUPLER), "AG", ["BCD", "EFH"]),
    ],
)
def test_a_planar_mechanism_falls_into_its_groups(m: mg.Mechanism, driven: str, groups: list[str]) -> None:
    found = groups_of(Question(m, dict.fromkeys(driven, 0.1)).form.family)
    assert ["".join(group.names) for group in found] == groups


def test_rods_belong_to_the_groups_of_the_bodies_that_they_join() -> None:
    found = groups_of(Question(RODS, {"O0": 0.1}).form.family)
    assert [(group.names, group.family.rank) for group in found] == [(["O3"], 1), (["O6"], 1)]


def test_every_leg_of_a_platform_whose_pose_is_given_is_a_group() -> None:
    """Legs turn about themselves: that they do so against the platform holds them, not that they stand still alone."""
    rng = np.random.default_rng(0)
    m = platform(rng.normal(size=(6, 3)), rng.normal((0.0, 0.0, 3.0), 1.0, (6, 3)))
    pose = mg.kinematics(m, {f"P{i}": 0.0 for i in range(6)}).link("platform").pose
    found = groups_of(Question(m, {"platform": pose}).form.family)
    assert [group.names for group in found] == [[f"A{i}", f"P{i}", f"B{i}"] for i in range(6)]


@pytest.mark.parametrize(
    ("m", "at"),
    [
        pytest.param(planar("Stephenson", "A", **STEPHENSON), {"A": 0.1}, marks=pytest.mark.slow),
        pytest.param(planar("coupler", "A", **ON_A_COUPLER), {"A": 0.1, "G": [0.05, -0.1]}, marks=pytest.mark.slow),
        (RODS, {"O0": 0.1}),
    ],
)
def test_group_by_group_the_modes_are_those_of_all_at_once(
    m: mg.Mechanism, at: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    apart = mg.assemblies(m, at, cache=False)
    monkeypatch.setattr("mechgraph.modes.assemblies.groups_of", lambda family: [Undivided(family)])
    at_once = mg.assemblies(m, at, cache=False)
    for one, other in zip(*((s,) if isinstance(s, mg.Assemblies) else s for s in (apart, at_once)), strict=True):
        assert "groups are solved one after the other" in one.evidence[0]
        assert "groups" not in other.evidence[0]
        assert (one.total, len(one), len(one.complex)) == (other.total, len(other), len(other.complex))
        assert len(one) > 0
        assert one.poses == pytest.approx(other.poses, abs=1e-9)
        assert one.completeness in {"proved", "tested"}


def test_where_there_are_too_many_tracks_complex_modes_of_groups_are_left(monkeypatch: pytest.MonkeyPatch) -> None:
    m = planar("Watt", "A", **WATT)
    closed, open_ = (mg.assemblies(m, {"A": angle}) for angle in (3.0, 2.0))
    assert [(len(one), len(one.complex)) for one in (closed, open_)] == [(4, 0), (0, 4)]
    monkeypatch.setattr("mechgraph.modes.targets.MOST_FOLLOWED", 3)
    real, none = (mg.assemblies(m, {"A": angle}) for angle in (3.0, 2.0))
    assert real.poses == pytest.approx(closed.poses)
    assert [(one.total, len(one), len(one.complex), one.completeness) for one in (real, none)] == [
        (4, 4, 0, "proved"),
        (4, 0, 0, "proved"),
    ]
    assert any("not gone on with" in text for text in none.evidence)
    assert not any("not gone on with" in text for text in real.evidence)


def test_a_group_that_leaves_its_class_is_no_group() -> None:
    """A dyad of parallel axes stays in its plane on a link that turns in it, and not on one that tilts."""
    for axis, stays in (((0, 0, 1), True), ((1, 0, 0), False)):
        pairs = [
            mg.Pair(k, "R", a, b, point=(x, y, 0), axis=axis if k == "A" else (0, 0, 1))
            for k, (a, b, x, y) in FOUR.items()
        ]
        family = Question(mg.Mechanism("dyad", pairs=pairs, frame="ground"), {"A": 0.0}).family
        group = EquationGroup(family, np.array([1, 2, 3]), np.zeros(0, dtype=np.intp), np.array([0]))
        assert (group.family.rank, group.within) == (3, stays)


@pytest.mark.slow
def test_feet_at_one_place_of_links_that_part_are_two() -> None:
    """A body on a ball and three rods, two of them from one place at the start, which only the rocker of an RSSR leaves."""
    rng, place = np.random.default_rng(3), {}
    for name in ("crank", "near", "far", "rocker"):
        place[name] = {"point": rng.normal(size=3), "axis": rng.normal(size=3)}
    ball, foot, other, *heads = rng.normal(size=(6, 3))
    pairs = [
        mg.Pair("A", "R", "ground", "crank", **place["crank"]),
        mg.Pair("B", "S", "crank", "coupler", point=place["near"]["point"]),
        mg.Pair("C", "S", "coupler", "rocker", point=place["far"]["point"]),
        mg.Pair("D", "R", "rocker", "ground", **place["rocker"]),
        mg.Pair("E", "S", "ground", "body", point=ball),
    ]
    for i, (link, at, head) in enumerate(zip(("ground", "rocker", "ground"), (foot, foot, other), heads, strict=True)):
        pairs += [
            mg.Pair(f"F{i}", "S", link, f"rod{i}", point=at),
            mg.Pair(f"G{i}", "S", f"rod{i}", "body", point=head),
        ]
    modes = mg.assemblies(mg.Mechanism("feet", pairs=pairs, frame="ground"), {"A": 0.2})
    assert len(groups_of(Question(modes.mechanism, {"A": 0.2}).form.family)) == 2
    assert (modes.total, modes.completeness) == (2 * 8, "proved")


@pytest.fixture(autouse=True)
def _empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MECHGRAPH_CACHE", str(tmp_path))
