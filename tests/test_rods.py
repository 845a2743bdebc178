"""Assemblies of mechanisms with rods: found without the rods, which are put back."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from itertools import pairwise

import machines
import numpy as np
import pytest
from mechanisms import Z, hexapod, platform

import mechgraph as mg
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import indexed
from mechgraph.maths.se3 import quaternion_matrix, rotation_exp
from mechgraph.modes.assemblies import Finder, Question
from mechgraph.modes.family import Member, searched
from mechgraph.modes.form import least_turn, rods_of, two_turns
from mechgraph.modes.homotopy import Equations, Leg
from mechgraph.modes.start_sets import bound, distinct
from mechgraph.modes.targets import Ends, TrackRun, _account, ends
from mechgraph.pairs.factors import ConstantScrew


def states(q: Question, modes: mg.Assemblies) -> np.ndarray:
    """States of real assemblies ``(nx, M)``."""
    s = q.system
    return np.concatenate([s.state_of(s.start_coordinates(mode.start)[:, None]) for mode in modes], axis=1)


@pytest.mark.slow
def test_a_hexapod_has_forty_assemblies_whatever_carries_its_legs() -> None:
    """Balls at both ends, or universal joints at the feet, each leg in two ways then: eight real postures, the same ones."""
    found = []
    for legs, ways in (("SPS", 1), ("UPS", 64)):
        m = hexapod(legs)
        at = {f"P{k}": 0.02 * k for k in range(1, 7)}
        modes, q = mg.assemblies(m, at), Question(m, at)
        count = len(modes) + len(modes.complex)
        assert (modes.total, count, modes.completeness) == (40 * ways, 40 * ways, "proved")
        assert (len(modes), str(modes).count("regular")) == (8 * ways, 8)
        assert all(sure is not None and sure.proved and sure.apart > 0 for sure in modes.certificates)
        assert Configuration(q.system, states(q, modes)).closure.max() < 1e-12
        assert any("64 ways" in line for line in modes.evidence) == (legs == "UPS")
        prints = q.family.prints(Configuration(q.system, states(q, modes)))
        assert len(distinct(prints)) == len(modes)
        found.append(modes)
    at = [link.name for link in m.links].index("platform")
    both = [
        np.sort_complex(modes.poses[: modes.postures, at, 0, 3] + 1j * modes.poses[: modes.postures, at, 1, 3])
        for modes in found
    ]
    assert len(both[0]) == len(both[1]) == 8
    assert np.abs(both[0] - both[1]).max() < 1e-9
    # the assembly in which it is declared, legs as they stand there, is among the first
    home = mg.assemblies(m, {f"P{k}": 0.0 for k in range(1, 7)})
    assert "platform.Tz\n" in str(home)
    assert "condition" in str(home)
    assert f": {home.postures} postures in {64 * home.postures} modes at " in str(home)
    assert np.abs(home.coordinates[: home.postures]).max(axis=1).min() < 1e-9


def test_a_platform_is_mapped_with_its_other_legs_at_rest_and_each_posture_once() -> None:
    """Six legs of 64 ways are too many: they count as one; what held drivers are off grew from step to step."""
    corners = np.deg2rad([[5, 50, 130, 170, 245, 300], [30, 35, 150, 145, 268, 275]])
    heights = np.random.default_rng(3).normal(size=(2, 6)) * [[0.1], [0.05]]
    feet, heads = (
        np.column_stack([size * np.cos(at), size * np.sin(at), up])
        for size, at, up in zip((1.0, 0.6), corners, heights + np.array([[0.0], [1.0]]), strict=True)
    )
    legs = [(foot, head, np.cross(head - foot, (1, 0, 0))) for foot, head in zip(feet, heads, strict=True)]
    m = platform(legs, "UPS")
    held = [f"P{k}.Tz" for k in range(2, 7)]
    found = mg.branches(m, "P1", over=(0.0, 1.0), samples=5, points=30)
    columns = [m.freedom_names().index(name) for name in held]
    assert max(np.abs(one.coordinates[:, columns]).max() for one in found.branches) < 1e-9
    for value in (0.05, 0.4, 0.8):
        modes = mg.assemblies(m, {"P1": value, **dict.fromkeys(held, 0.0)})
        assert sum(one.interval[0] <= value <= one.interval[1] for one in found.branches) == modes.postures > 1


def test_assemblies_that_are_not_real_close_the_loops_too() -> None:
    """Legs are put back over the complex numbers."""
    for legs in ("SPS", "UPS"):
        m = hexapod(legs)
        modes = mg.assemblies(m, {f"P{k}": 0.0 for k in range(1, 7)})
        index = {link.name: i for i, link in enumerate(m.links)}
        for k in range(1, 7):
            rod, tube = (modes.complex.poses[:, index[f"{part}{k}"]] for part in ("rod", "tube"))
            # the slide is at rest: both links have one pose; all rotations are orthogonal
            assert np.abs(rod - tube).max() < 1e-7 * np.abs(rod).max()
            R = rod[:, :3, :3]
            assert np.abs(R @ R.swapaxes(1, 2) - np.eye(3)).max() < 1e-7 * np.abs(R).max() ** 2
            head = next(pair.point for pair in m.pairs if pair.name == f"B{k}")
            at = np.append(head, 1.0)
            top = modes.complex.poses[:, index["platform"]]
            assert (np.abs((tube - top) @ at).max(axis=1) < 1e-8 * np.abs(top).max(axis=(1, 2)) ** 2).all()


def turned_leg(second: np.ndarray, *, split: bool = False, back: bool = False) -> mg.Mechanism:
    """A crank and a rocker joined by a leg on two turns, the first about ``(0.3, 0.2, 1)``; ``split``: with a link between these."""
    ends, axes = (
        (("leg", "crank") if back else ("crank", "leg")),
        [np.array((0.3, 0.2, 1.0)), second][:: -1 if back else 1],
    )
    joint = [mg.Pair("U", "U", *ends, point=NEAR, axis=axes[0], second=axes[1])]
    if split:
        joint = [
            mg.Pair(f"U{i}", "R", *of, point=NEAR, axis=axes[i])
            for i, of in enumerate(pairwise([ends[0], "cross", ends[1]]))
        ]
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0.1, 0.2, 1)), *joint,
        mg.Pair("B", "S", "leg", "rocker", point=FAR),
        mg.Pair("G", "R", "rocker", "frame", point=(1, 3, 0), axis=(0.3, 0.1, 1)),
    ]  # fmt: skip
    return mg.Mechanism("leg", pairs=pairs, drives=["A"], frame="frame")


@pytest.mark.daily(1)
@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("slope", [0.0, 0.3, 1.0])
def test_both_ways_of_two_turns_are_those_of_two_pairs_with_a_link_between(slope: float, back: bool) -> None:
    """Where the leg lies across the second turn it comes everywhere, where it does not, to a part of all directions: not real beyond."""
    first = np.array((0.3, 0.2, 1.0))
    second = np.cross(first, FAR - NEAR)
    second = second + slope * np.cross(first, second)
    whole, split = (turned_leg(second, split=cut, back=back) for cut in (False, True))
    for angle in (0.1, 1.2, 2.2):
        modes, others = (mg.assemblies(m, {"A": angle}) for m in (whole, split))
        assert (modes.total, modes.completeness) == (others.total, "proved") == (4, "proved")
        assert (len(modes), len(modes.complex), 2 * modes.postures) == (len(others), len(others.complex), len(modes))
        at = [[link.name for link in m.links].index("leg") for m in (whole, split)]
        one, other = (of.poses[:, i].reshape(-1, 16) for of, i in zip((modes, others), at, strict=True))
        gaps = np.abs(one[:, None] - other[None]).max(axis=2)
        assert max(gaps.min(axis=0).max(initial=0.0), gaps.min(axis=1).max(initial=0.0)) < 1e-9
    maps = [mg.branches(m, "A", samples=8, points=80) for m in (whole, split)]
    for one, other in zip(*(sorted(f.value for f in b.folds) for b in maps), strict=True):
        assert abs(one - other) < 1e-6
    assert [len(b.circuits) for b in maps] == [2, 2] if slope < 1 else len(maps[0]) == len(maps[1])
    assert maps[0].completeness == ("tested" if slope == 1 else "proved")


def test_both_ways_of_a_leg_are_found_where_the_start_alone_lies_between_samples() -> None:
    """The crank swings by a fortieth of a turn; on the circuit of the start alone the leg would stand in one way."""
    near, far = NEAR, np.array((1.05, 0.1, 0.2))
    *pairs, _, ground = turned_leg(np.cross((0.3, 0.2, 1.0), far - near)).pairs
    m = mg.Mechanism(
        "short", pairs=[*pairs, mg.Pair("B", "S", "leg", "rocker", point=far), ground], drives=["A"], frame="frame"
    )
    b = mg.branches(m, "A", samples=3, points=12)
    assert (b.circuits, b.open_ends, b.completeness) == (((0, 1), (2, 3)), 0, "proved")
    (low, again, high, once_more) = (fold.value for fold in b.folds)
    assert (again, once_more) == pytest.approx((low, high), abs=1e-9)
    # next to both folds, outside and inside
    counts = [len(mg.assemblies(m, {"A": angle})) for angle in (low - 1e-3, low + 1e-3, high - 1e-3, high + 1e-3)]
    assert counts == [0, 4, 4, 0]


@pytest.mark.daily(1)
@pytest.mark.parametrize(
    ("feet", "heads"), [((0, 1, 2, 3, 4, 5), (0, 0, 1, 1, 2, 2)), ((0, 1, 1, 2, 2, 0), (0, 0, 1, 1, 2, 2))]
)
def test_a_platform_on_three_joints_has_sixteen(feet: tuple[int, ...], heads: tuple[int, ...]) -> None:
    """Joints that coincide stay one in all mechanisms of the class, which has fewer assemblies than the general platform."""
    rng = np.random.default_rng(4)
    A, B = rng.normal(size=(6, 3)), rng.normal((0.0, 0.0, 3.0), 1.0, (3, 3))
    pairs = []
    for i, (foot, head) in enumerate(zip(A[list(feet)], B[list(heads)], strict=True)):
        pairs += [
            mg.Pair(f"A{i}", "S", "base", f"leg{i}", point=foot),
            mg.Pair(f"B{i}", "S", f"leg{i}", "platform", point=head),
        ]
    m = mg.Mechanism("platform", pairs=pairs, frame="base")
    modes = mg.assemblies(m, {})
    assert (modes.total, len(modes) + len(modes.complex), modes.completeness) == (16, 16, "proved")
    assert "three joints on circles" in modes.evidence[0]
    place = [link.name for link in m.links].index("platform")
    gaps = np.abs(modes.poses[:, place] - np.eye(4)).max(axis=(1, 2))
    assert gaps.min() < 1e-9


@pytest.mark.daily(2)
@pytest.mark.parametrize(
    ("symbol", "flipped", "rods", "count"),
    [
        ("R", False, 1, 2),
        ("P", False, 1, 2),
        ("S", False, 3, 8),
        ("Sp", False, 5, 40),
        ("Sp", True, 5, 40),
        ("C", False, 2, None),
    ],
)
def test_a_body_on_one_pair_and_rods_has_a_bound(symbol: str, flipped: bool, rods: int, count: int | None) -> None:
    """A ball on a plane, carried by a crank: a rod from far away, so that five rods more make a platform."""
    rng = np.random.default_rng(1)
    links = ("body", "crank") if flipped else ("crank", "body")
    pairs = [
        mg.Pair("D", "R", "base", "crank", point=(0, 0, 0), axis=(0.1, 0.2, 1)),
        mg.Pair("J", symbol, *links, point=(1, 0.3, 0.2), axis=(0.4, 0.2, 1)),
    ]
    for i in range(rods):
        pairs.append(mg.Pair(f"A{i}", "S", "base", f"rod{i}", point=rng.normal(size=3)))
        pairs.append(mg.Pair(f"B{i}", "S", f"rod{i}", "body", point=rng.normal(size=3) + 3 * Z))
    m = mg.Mechanism("body on rods", pairs=pairs, drives=["D"], frame="base")
    found = bound(Question(m, {"D": 0.1}).form.family)
    assert (None if found is None else found.count) == count
    if count == 8:
        modes = mg.assemblies(m, {"D": 0.1})
        assert (modes.total, modes.completeness) == (count, "proved")


def leg_between(*middle: mg.Pair) -> mg.Mechanism:
    """A crank and a rocker, joined by pairs from the one to the other; a cylindrical pair carries the rocker where two turns lead to it."""
    ground = mg.Pair("G", "C" if len(middle) == 2 else "R", "rocker", "frame", point=(1, 3, 0), axis=(0.3, 0.1, 1))
    crank = mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0.1, 0.2, 1))
    return mg.Mechanism("leg", pairs=[crank, *middle, ground], drives=["A"], frame="frame")


NEAR, FAR = np.array((1.0, 0, 0.1)), np.array((1.5, 2, 0.8))
ALONG, ACROSS = FAR - NEAR, np.cross(FAR - NEAR, Z)


@pytest.mark.slow
def test_two_turns_of_which_one_lies_along_the_leg_are_no_rod() -> None:
    """That turn is a spin of the leg, which rests; it was taken for a rod, and its spin for one that all mechanisms of the class have."""
    two_turns = mg.Pair("U", "U", "leg", "crank", point=NEAR, axis=ALONG, second=ACROSS)
    m = leg_between(two_turns, mg.Pair("B", "S", "leg", "rocker", point=FAR))
    modes, q = mg.assemblies(m, {"A": 0.05}), Question(m, {"A": 0.05})
    assert [q.m.freedom_names()[k] for k in q.family.held] == ["U.Rz"]
    assert (modes.total, len(modes), modes.completeness) == (4, 2, "tested")
    assert all(sure is not None and sure.proved and sure.apart > 0.5 for sure in modes.certificates)
    x = searched(q.system, q.x, q.columns, q.drive[:, 0], 200, 1.0, np.random.default_rng(3))
    prints = np.concatenate([q.family.prints(Configuration(q.system, some)) for some in (states(q, modes), x)], axis=1)
    assert len(distinct(prints)) == 2


def test_a_rod_of_two_halves_that_turn_about_it_is_a_rod() -> None:
    m = leg_between(
        mg.Pair("S", "S", "crank", "half", point=NEAR),
        mg.Pair("T", "R", "half", "other", point=(NEAR + FAR) / 2, axis=ALONG),
        mg.Pair("B", "S", "other", "rocker", point=FAR),
    )
    modes = mg.assemblies(m, {"A": 0.05})
    assert (modes.total, len(modes), modes.completeness) == (2, 2, "proved")


def strut(name: str, a: str, b: str, p: tuple[float, ...], q: tuple[float, ...]) -> list[mg.Pair]:
    return [mg.Pair(f"{name}1", "S", a, name, point=p), mg.Pair(f"{name}2", "S", name, b, point=q)]


HINGED = [
    mg.Pair("E", "R", "frame", "plate", point=(0, 3, 0), axis=(1, 0.2, 0.3)),
    *strut("r", "frame", "plate", (0, 0, 1), (2, 0, 3)),
]


@pytest.mark.parametrize(
    ("extra", "total"),
    [
        (strut("r", "frame", "frame", (0, 0, 1), (2, 0, 3)), 2),
        (strut("r", "frame", "rocker", (5, 0, 1), (5, 0, -2)), 2),
        ([*HINGED, *strut("s", "frame", "plate", (0, 1, 1), (2, 2, 3))], 4),
    ],
    ids=["both ends on a link", "both ends on an axis", "a plate held twice"],
)
@pytest.mark.daily(1)
def test_rods_that_hold_nothing_leave_the_class(extra: list[mg.Pair], total: int) -> None:
    """Without them all is known; a plate that one rod would let stand in two ways, another one in one of them, stands in one."""
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "R", "crank", "coupler", point=(1, 1, 0), axis=Z),
    ]
    pairs += [
        mg.Pair("C", "R", "coupler", "rocker", point=(4, 2, 0), axis=Z),
        mg.Pair("D", "R", "rocker", "frame", point=(5, 0, 0), axis=Z),
    ]
    plain, braced = (mg.Mechanism("braced", pairs=[*pairs, *more], drives=["A"], frame="frame") for more in ([], extra))
    modes, others, q = mg.assemblies(braced, {"A": 0.1}), mg.assemblies(plain, {"A": 0.1}), Question(braced, {"A": 0.1})
    assert (len(modes), len(modes.complex), modes.total, modes.completeness) == (2, 0, total, "proved")
    assert any("Left out: 1 rod" in line for line in modes.evidence)
    assert Configuration(q.system, states(q, modes)).closure.max() < 1e-12
    angles = [sorted(mode.start["D.Rz"] for mode in found) for found in (modes, others)]
    assert np.abs(np.subtract(*angles)).max() < 1e-12


def test_rods_are_chains_between_balls_or_two_turns_with_nothing_free_between() -> None:
    def chain(*letters: str, driven: tuple[str, ...] = ()) -> int:
        """How many rods a loop has of an R at the frame and these pairs."""
        rng = np.random.default_rng(1)
        links = ["frame", *(f"l{i}" for i in range(len(letters))), "frame"]
        pairs = [
            mg.Pair(f"{s}{i}", s, links[i], links[i + 1], point=rng.normal(size=3), axis=rng.normal(size=3))
            for i, s in enumerate(("R", *letters))
        ]
        s = indexed(mg.Mechanism("loop", pairs=pairs))
        return len(rods_of(s, np.array([s.first_column[int(name[1:])] for name in ("R0", *driven)])))

    assert chain("S", "S", "R") == chain("U", "S", "R") == chain("S", "U", "R") == 1
    assert chain("S", "P", "S", driven=("P2",)) == 1
    assert chain("S", "R", "S", driven=("R2",)) == 1
    assert chain("S", "P", "S", driven=()) == chain("U", "U", "R", "R") == chain("Sg", "S") == 0


def test_balls_and_two_turns_point_where_they_shall() -> None:
    rng = np.random.default_rng(0)
    row = mg.Pair("U", "U", "a", "b", point=(0, 0, 0), axis=Z).type
    axes = [np.array(step.freedom.twist[:3]) for step in row.steps if isinstance(step, ConstantScrew)]
    angles, of = rng.uniform(-3, 3, (2, 50)), rng.normal(size=(3, 1))

    def turned(at: np.ndarray) -> np.ndarray:
        first, second = (rotation_exp(axis[:, None] * angle) for axis, angle in zip(axes, at, strict=True))
        return np.einsum("ijt,jkt,k->it", first, second, of[:, 0])

    to = turned(angles)
    near = np.zeros(50, dtype=bool)
    found = two_turns(row, of, to, angles.astype(complex), near)
    assert np.abs(found - angles).max() < 1e-9
    other = two_turns(row, of, to, angles.astype(complex), ~near)
    assert np.abs(other - angles).max(axis=0).min() > 1e-3
    assert np.abs(turned(other.real) - to).max() < 1e-9
    assert np.abs(other.imag).max() < 1e-9
    begin = rng.normal(size=(4, 50))
    begin /= np.linalg.norm(begin, axis=0)
    to[:, 0] = -np.einsum("ij,j->i", quaternion_matrix(begin)[:, :, 0], of[:, 0])  # half a turn from where it is
    reached = np.einsum("ijt,j->it", quaternion_matrix(least_turn(of, to, begin.astype(complex))), of[:, 0])
    assert np.abs(reached - to).max() < 1e-12


def test_a_slide_may_have_any_imaginary_length() -> None:
    """Its pose has no sine, which overflows at 710: tracks to assemblies far away were lost there."""
    s = indexed(mg.Mechanism("slide", pairs=[mg.Pair("P", "P", "frame", "body", point=(0, 0, 0), axis=Z)]))
    poses = Configuration(s, np.array([[2000j]])).poses
    assert np.abs(poses[2, 3, 1, 0] - 2000j) < 1e-9
    assert np.abs(poses[:, :3, 1, 0] - np.eye(3)).max() < 1e-12


@pytest.mark.parametrize("make", [lambda: mg.load("rssr"), hexapod, machines.sliders])
def test_rates_of_tracks_keep_rods_closed(make: Callable[[], mg.Mechanism]) -> None:
    """From member to member markers, points and lengths move: with the rates of the freedoms the rows open with the square of the step."""
    m = make()
    family = Question(m, {m.full_name(d.freedom): 0.0 for d in m.drives}).form.family
    rng = np.random.default_rng(0)
    closed = family.random_closed(rng)
    assert closed is not None
    member, x = closed
    leg = Leg(Equations(family, family.mixing(rng)), member, family.random_member(rng))
    one = np.zeros(1, dtype=np.intp)
    here = leg.at(x[:, None], np.zeros(1), one)
    rates = here.rates(here.idle())[0]
    open_by = []
    for h in (1e-4, 1e-5):
        there = leg.at(family.system.advance(here.here.x, h * rates), np.array([h]), one)
        open_by.append(np.abs(there.here.residual).max() / max(1.0, np.abs(rates).max()) ** 2)
    assert open_by[1] < 0.03 * open_by[0]


def test_a_track_led_round_to_no_assembly_is_at_infinity_only_if_a_second_run_says_so() -> None:
    """Of 300 platforms two were said to have all 40 with 39: a track that strayed near its end counted as one at infinity."""
    m = hexapod("SPS")
    q = Question(m, {f"P{k}": 0.0 for k in range(1, 7)})
    family, (start,) = q.form.family, Finder(q, 0, True, None).starts
    at = Member(family.target, q.form.drive)
    every = ends(family, start, at, np.random.default_rng(0), None)[0].x
    stray = np.arange(every.shape[1]) == 0
    none, off = np.zeros(len(stray), dtype=bool), every.copy()
    off[:, 0] = 1e3 * (1 + 1j)
    astray, whole = TrackRun(off, ~stray, stray, none), TrackRun(every, ~none, none, none)
    known = Ends.none(*every.shape)
    _account(family, at, known, astray, 0)
    assert (known.infinite, known.x.shape[1], known.clean) == (1, 39, False)
    again = deepcopy(known)
    _account(family, at, again, astray, 0)
    assert (again.infinite, again.x.shape[1], again.clean) == (1, 39, True)
    _account(family, at, known, whole, 0)
    assert (known.infinite, known.x.shape[1], known.clean) == (0, 40, True)
