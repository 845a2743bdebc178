"""Positions that are multiply separated: velocities, accelerations, twists and slopes are asked beside places."""

from typing import Any

import numpy as np
import pytest
from ladder import LADDER, dyad, four_bar, spatial, turned
from scipy.spatial.transform import Rotation

import mechgraph as mg

NAN = np.nan
TWISTS = np.random.default_rng(0).normal(size=(3, 6))
TWISTS[2] = NAN
BALLS = spatial("S-S", ("S", (0, 0, 0), None), ("S", (1, 0.3, 0.1), None))
CLASSES: dict[str, tuple[mg.Mechanism, Any, list[str], dict[int, int]]] = {
    "balls": (BALLS, mg.poses("body", turned(3, 1.0), twists=TWISTS), ["P.point"], {0: 1, 1: 2, 2: 1}),
    "plane and ball": (
        LADDER["R-Sp-R function, 6 pairs"]()[0],
        mg.function(
            "O", "Q", [[0, 0], [0.3, 0.4], [0.5, 0.7]], rates=[0.5, 0.6, NAN], accelerations=[0.1, NAN, NAN]
        ),
        ["P.point"],
        {0: 2, 1: 2, 2: 1},
    ),
    "directions": (
        LADDER["spherical R-R, 5 orientations"]()[0],
        mg.poses("body", turned(3, 0.0), twists=np.column_stack([TWISTS[:, :3], 0.0 * TWISTS[:, 3:]])),
        ["O.axis"],
        {0: 1, 1: 2, 2: 1},
    ),
    "path": (
        four_bar(),
        mg.path("coupler.tip", [[1.5, 1.2], [1.0, 1.3]], velocities=[[1, 0.1], [1, 0.4]], accelerations=[[NAN, NAN], [0, 1]]),
        ["B.point", "C.point", "D.point"],
        {0: 1, 1: 3},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CLASSES)
def test_each_rate_is_one_condition(name: str) -> None:
    m, task, unknown, conditions = CLASSES[name]
    told = ", ".join(f"{n} at row {row}" for row, n in conditions.items())
    with pytest.raises(mg.DeclarationError, match=rf"{sum(conditions.values())} conditions \({told}\) for "):
        mg.synthesize(m, task, unknown)


def test_a_dyad_through_a_pose_and_a_velocity_is_the_limit_of_those_through_poses() -> None:
    """Closed form: A and B stay at one distance, ``(T - 1) B . (A - B)`` of poses and ``V_B . (A - B) = 0``, linear in B for A = 0."""
    first, second = np.array([1.0, 0.2, 0.5]), (1.0, 0.5, 0.4)
    task = mg.poses("body", [(0, 0, 0), second], twists=[first, (NAN, NAN, NAN)])
    (m,) = s = mg.synthesize(dyad(), task, ["B.point"])
    B = s.values[0]
    c, si = np.cos(second[2]), np.sin(second[2])
    moved = np.array([[c, -si], [si, c]]) @ B + second[:2]
    speed = first[:2] + first[2] * np.array([-B[1], B[0]])
    assert (s.total, s.completeness) == (1, "tested")
    assert abs(speed @ B) < 1e-10 > abs(moved @ moved - B @ B)
    assert m.pair("B").point[:2] == pytest.approx(B)
    apart = []
    for h in (1e-2, 1e-3):
        near = mg.synthesize(dyad(), mg.poses("body", [(0, 0, 0), h * first, second]), ["B.point"])
        apart.append(np.abs(near.values - B).max())
    assert apart[1] == pytest.approx(0.1 * apart[0], rel=0.1)
    # a twist in space says the same of a body in the plane
    vw = [(0, 0, 0.5, 1.0, 0.2, 0), [NAN] * 6]
    again = mg.poses("body", [(0, 0, 0), second], twists=vw)
    assert mg.synthesize(dyad(), again, ["B.point"]).values == pytest.approx(s.values)


def motion(m: mg.Mechanism, angles: list[float]) -> Any:
    n = len(angles)
    return mg.kinematics(m, {"A": mg.Motion(np.array(angles), np.ones(n), np.zeros(n))})


def test_a_four_bar_is_found_again_from_its_slopes() -> None:
    m = four_bar(B=(0.4, 0.9), C=(1.9, 1.6))
    s = motion(m, [0.0, 0.5, 1.0])
    pairs, slopes = np.column_stack([s["A"].position, s["D"].position]), s["D"].velocity[:, 0]
    found = mg.synthesize(four_bar(), mg.function("A", "D", pairs, rates=[NAN, *slopes[1:]]), ["B.point", "C.point"])
    assert (found.total, found.completeness) == (3, "tested")
    assert np.abs(found.values - (0.4, 0.9, 1.9, 1.6)).max(axis=1).min() < 1e-9
    for one in found:
        assert motion(one, [0.0, 0.5, 1.0])["D"].velocity[1:, 0] == pytest.approx(slopes[1:], abs=1e-8)


@pytest.mark.slow
def test_a_four_bar_is_found_again_from_its_velocities_and_accelerations() -> None:
    m = four_bar(B=(0.4, 0.9), C=(1.9, 1.6))
    s, unknown = motion(m, [0.0, 1.0]), ["B.point", "C.point"]
    pairs, D = np.column_stack([s["A"].position, s["D"].position]), s["D"]
    function = mg.function("A", "D", pairs, rates=D.velocity[:, 0], accelerations=[NAN, D.acceleration[1, 0]])
    tip = s.link("coupler").at("tip")
    path = mg.path("coupler.tip", tip.position[:, :2], velocities=tip.velocity[:, :2])
    for task, declared, sought, total in (
        (function, four_bar(), unknown, 3),
        (path, m, [*unknown[:1], "C.point.x"], 6),
    ):
        found = mg.synthesize(declared, task, sought)
        assert (found.total, found.completeness) == (total, "tested")
        assert np.abs(found.values - (0.4, 0.9, 1.9, 1.6)[: len(found.unknown)]).max(axis=1).min() < 1e-9


def beside(x: Any, h: float, *rates: Any) -> list[Any]:
    """Rows beside ``x`` whose differences tend to these derivatives as ``h`` does to zero; the row itself where that is zero."""
    at = (0.0,) if not h else (0.0, h) if len(rates) == 1 else (-h, 0.0, h)
    return [np.asarray(x) + sum(np.asarray(d) * t**k / k for k, d in enumerate(rates, 1)) for t in at]


def rated_function(m: mg.Mechanism, h: float, orders: int) -> Any:
    first, last = m.pairs[0].name, m.pairs[-1].name
    out = mg.kinematics(m, {first: mg.Motion(np.array([0.0, 0.3]), np.ones(2), np.zeros(2))})[last]
    x, slope, bend = (float(v[1, 0]) for v in (out.position, out.velocity, out.acceleration))
    rows = [[0, 0], *beside([0.3, x], h, *[[1.0, slope], [0.0, bend]][:orders])]
    rates = {} if h else {"rates": [NAN, slope], "accelerations": [NAN, bend] if orders == 2 else None}
    return mg.function(first, last, rows, **rates)


def rated_path(m: mg.Mechanism, h: float) -> Any:
    tip = motion(m, [0.0, 0.3]).link("coupler").at("tip")
    x, v = (values[:, :2] for values in (tip.position, tip.velocity))
    rates = {} if h else {"velocities": [[NAN, NAN], v[1]]}
    return mg.path("coupler.tip", [x[0], *beside(x[1], h, v[1])], **rates)


def rated_poses(n: int, shift: float, h: float) -> Any:
    """The second of n poses with a twist, or another one a screw displacement of ``h`` times it away."""
    X, V = turned(n, shift), np.full((n, 6), NAN)
    V[1] = np.array([0.4, 0.3, -0.9, 0.1, -1.0, -0.5]) * np.repeat([1.0, shift], 3)
    if not h:
        return mg.poses("body", X, twists=V)
    moved = np.eye(4)
    moved[:3, :3], moved[:3, 3] = Rotation.from_rotvec(h * V[1, :3]).as_matrix(), h * V[1, 3:]
    return mg.poses("body", [*X, moved @ X[1]])


SPHERICAL = LADDER["spherical R-R, 5 orientations"]()[0]
RSSR = LADDER["RSSR function, 7 pairs"]()[0]
LIMITS: dict[str, tuple[mg.Mechanism, Any, list[str], int]] = {
    "spherical, a twist": (SPHERICAL, lambda h: rated_poses(2, 0.0, h), ["O.axis"], 1),
    "balls, a twist": (BALLS, lambda h: rated_poses(3, 1.0, h), ["P.point"], 1),
    "RSSR function, a rate": (RSSR, lambda h: rated_function(RSSR, h, 1), ["P.point.x", "Q.point.z"], 2),
    "four-bar function, an acceleration": (
        four_bar(), lambda h: rated_function(four_bar(), h, 2), ["B.point.x", "C.point.x", "C.point.y"], 3,
    ),
    "four-bar path, a velocity": (four_bar(), lambda h: rated_path(four_bar(), h), ["B.point.x", "C.point.y"], 4),
}  # fmt: skip
"""A mechanism; what is asked, of rates or of rows that lie ``h`` apart; numbers sought; solutions over C."""


@pytest.mark.slow
@pytest.mark.parametrize("name", LIMITS)
def test_what_is_asked_of_rates_is_the_limit_of_rows_that_come_together(name: str) -> None:
    m, task, unknown, total = LIMITS[name]
    s = mg.synthesize(m, task(0.0), unknown)
    assert (s.total, len(s) > 0) == (total, True)
    apart = []
    for h in (4e-3, 1e-3):
        near = mg.synthesize(m, task(h), unknown)
        apart.append([np.abs(near.values - values).max(axis=1).min() for values in s.values])
    assert (np.divide(*apart[::-1]) < 0.35).all()
    assert np.max(apart[1]) < 0.02


def test_a_crank_on_whose_path_an_acceleration_is_asked_has_its_pivot_in_the_center_of_curvature() -> None:
    """To which the center of the circle through rows tends that come together."""
    x, v, a = np.array([1.0, 0.5]), np.array([0.7, -0.4]), np.array([0.3, 1.1])
    links = [mg.Link("frame"), mg.Link("crank", points={"tip": tuple(x)})]
    m = mg.Mechanism("crank", links, [mg.Pair("A", "R", "frame", "crank", point=(0, 0))], drives=["A"], planar=True)
    s = mg.synthesize(m, mg.path("crank.tip", [x], velocities=[v], accelerations=[a]), ["A.point"])
    assert s.total == 1
    for h in (1e-2, 1e-3):
        first, *rows = beside(x, h, v, a)
        center = np.linalg.solve(2 * (np.array(rows) - first), [row @ row - first @ first for row in rows])
        assert s.values[0] == pytest.approx(center, abs=h * h)


def test_what_is_wrong_with_rates_is_told() -> None:
    points = [[1.5, 1.2], [1.0, 1.3]]
    with pytest.raises(mg.DeclarationError, match="beside velocities"):
        mg.synthesize(four_bar(), mg.path("coupler.tip", points, accelerations=points), ["B.point"])
    with pytest.raises(mg.DeclarationError, match="3 values at 2 positions"):
        mg.synthesize(four_bar(), mg.function("A", "D", [[0, 0], [1, 1]], rates=[1, 2, 3]), ["B.point"])
    with pytest.raises(mg.DeclarationError, match="met exactly or not at all"):
        mg.synthesize(four_bar(), mg.function("A", "D", [[0, 0], [1, 1]], rates=[1, 2]), ["B.point"], fit="minimax")
    with pytest.raises(mg.DeclarationError, match="beside whole poses"):
        mg.synthesize(dyad(), mg.poses("body", [[0, 0, 0], [NAN] * 3], twists=[[1, 0, 0]] * 2), ["B.point"])
    over = np.array([[0.0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]])
    with pytest.raises(mg.DeclarationError, match="90 degrees about y"):
        mg.synthesize(BALLS, mg.poses("body", [np.eye(4), over], twists=[[1.0] * 6] * 2), ["P.point"])


@pytest.mark.parametrize("rates", [[0.5, 0.7], [0.5, NAN]])
def test_mechanisms_of_which_all_rates_are_asked_are_not_taken_for_the_same(rates: list[float]) -> None:
    """All have the slopes asked; between the two pairs each one turns its rocker elsewhere."""
    pairs = [[0, 0], [0.5, 0.4], [0.8, 0.9]][: 2 if rates[1] == 0.7 else 3]
    task = mg.function("A", "D", pairs, rates=[*rates, NAN][: len(pairs)])
    s = mg.synthesize(four_bar(), task, ["B.point", "C.point.x"])
    assert (s.total, s.classes, s.completeness) == (3, 3, "tested")
    assert s.copies == tuple((i,) for i in range(len(s)))
