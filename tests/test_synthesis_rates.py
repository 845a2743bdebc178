"""Positions that are multiply separated: velocities, accelerations, twists and slopes are asked beside places."""

from typing import Any

import numpy as np
import pytest
from ladder import LADDER, dyad, four_bar, spatial, turned

import mechgraph as mg
from mechgraph.synthesis.classes import TaskClass
from mechgraph.synthesis.solve import real_states
from mechgraph.synthesis.system import RowProblem

NAN = np.nan
TWISTS = np.random.default_rng(0).normal(size=(3, 6))
TWISTS[2] = NAN
BALLS = spatial("S-S", ("S", (0, 0, 0), None), ("S", (1, 0.3, 0.1), None))
CLASSES: dict[str, tuple[mg.Mechanism, Any, list[str], list[int]]] = {
    "balls": (BALLS, mg.poses("body", turned(3, 1.0), twists=TWISTS), ["P.point", "O.point.x"], [1, 2, 1]),
    "plane and ball": (
        LADDER["R-Sp-R function, 6 pairs"]()[0],
        mg.function(
            "O", "Q", [[0, 0], [0.3, 0.4], [0.5, 0.7]], rates=[0.5, 0.6, NAN], accelerations=[0.1, NAN, NAN]
        ),
        ["P"],
        [2, 2, 1],
    ),
    "directions": (
        LADDER["spherical R-R, 5 orientations"]()[0],
        mg.poses("body", turned(3, 0.0), twists=np.column_stack([TWISTS[:, :3], 0.0 * TWISTS[:, 3:]])),
        ["O.axis", "P.axis"],
        [1, 2, 1],
    ),
    "path": (
        four_bar(),
        mg.path("coupler.tip", [[1.5, 1.2], [1.0, 1.3]], velocities=[[1, 0.1], [1, 0.4]], accelerations=[[NAN, NAN], [0, 1]]),
        ["B.point", "C.point"],
        [1, 3],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CLASSES)
def test_each_rate_is_one_condition_and_derivatives_of_equations_are_those_of_differences(name: str) -> None:
    m, task, unknown, conditions = CLASSES[name]
    of, rng = TaskClass(RowProblem(m, task, unknown), np.random.default_rng(0)), np.random.default_rng(1)
    assert of.conditions.tolist() == conditions
    x, h = of.x[:, None], 1e-5
    here = of.at(of.start, x)
    assert of.error(here).max() < 1e-10
    dz, dq = rng.normal(size=of.u), rng.normal(size=(of.R, of.F))
    for own, given in zip(dq, of.given, strict=True):
        own[of.columns[given]] = 0.0
    step = h * np.concatenate([dz, np.zeros(of.W), dq.ravel()])[:, None]
    ahead, behind = (of.at(of.start, of.advance(x, way * step)).residual[..., 0] for way in (1.0, -1.0))
    exact = np.einsum("rnkt,k->rn", here.by_unknowns, dz) + np.einsum("rnft,rf->rn", here.by_coordinates, dq)
    orders = 1 + len(of.problem.rates)
    for i in range(of.R):
        n = exact.shape[1] * (1 + int(of.orders[i])) // orders
        assert np.abs((ahead - behind)[i, :n] / (2 * h) - exact[i, :n]).max() < 1e-7


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


def test_a_four_bar_solves_the_task_of_its_own_velocities_and_accelerations() -> None:
    m, angles = four_bar(B=(0.4, 0.9), C=(1.9, 1.6)), np.array([0.0, 0.5, 1.0])
    s = mg.kinematics(m, {"A": mg.Motion(angles, np.ones(3), np.zeros(3))})
    names = [pair.name for pair in m.pairs]
    q, v, a = (
        np.column_stack([np.ravel(getattr(s[name], what)) for name in names])
        for what in ("position", "velocity", "acceleration")
    )
    task = mg.function("A", "D", q[[0, 2]][:, [0, 3]], rates=v[[0, 2], 3], accelerations=[NAN, a[2, 3]])
    of = TaskClass(RowProblem(four_bar(), task, ["B.point", "C.point"]), np.random.default_rng(0))
    # the coupler is a rod, without coordinates
    kept = [names.index(pair.name) for pair in of.problem.whole.pairs]
    q, v, a = (values[[0, 2]][:, kept] for values in (q, v, a))
    assert of.conditions.tolist() == [1, 3]
    z = of.problem.inside(np.array([[0.4], [0.9], [1.9], [1.6]]))
    a = np.where([[False], [True]], a / 2, 0.0)
    x = np.concatenate([z[:, 0], np.concatenate([q, v, a], axis=1).ravel()]).astype(complex)
    goal = of.goal(of.problem.numbers.taken(np.zeros(1, dtype=int)))
    assert of.error(of.at(goal, x[:, None])).max() < 1e-10
    # a real solution is found near by, and is exactly real
    found, error, which = real_states(of, goal, x[:, None] * (1 + 1e-9j))
    assert which.size == 1
    assert error.max() < 1e-12
    assert of.problem.outside(found[: of.u])[:, 0] == pytest.approx((0.4, 0.9, 1.9, 1.6), abs=1e-9)


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
