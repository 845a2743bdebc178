"""Lee 1977, Tables III to IX: positions, velocities and accelerations of the RCSR mechanism.

Lee's global axes: x along his A_1, the unfolded chain along y, the screws left of the origin counted negative. The
library file has z = -A_1 and x from O1 towards O2, which is -y of Lee's, so

    (x, y, z) of Lee = G (x, y, z) of ours,   G = [[0, 0, -1], [-1, 0, 0], [0, 1, 0]];

the origins coincide. P_m are the mass centers; O2 is the point of the cylindrical pair on link 2, O3 the sphere center.
"""

import csv
from pathlib import Path

import numpy as np
import pytest

import mechgraph as mg

pytestmark = pytest.mark.reference

DATA = Path(__file__).parent / "data"
G = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
ROUNDING = 0.7e-3
"""0.7 of the last printed digit."""
DEGREE = 3e-6
"""The degree of the thesis is too short, by 2 in a million going in and 4 coming out (see test_lee_verdicts): their mean."""


@pytest.fixture(scope="module")
def solution() -> mg.Solution:
    return mg.kinematics(mg.load("rcsr"))


def table(number: str) -> tuple[list[str], np.ndarray]:
    with (DATA / f"lee_table_{number}.csv").open(encoding="utf-8") as handle:
        rows = list(csv.reader(line for line in handle if not line.startswith("#")))
    return rows[0], np.array(rows[1:], dtype=float)


def in_lees_axes(*vectors: np.ndarray) -> np.ndarray:
    """Vectors ``(T, 3)`` as columns x, y, z of one after the other."""
    return np.concatenate([v @ G.T for v in vectors], axis=1)


def test_pair_coordinates_and_rates_of_table_iii(solution: mg.Solution) -> None:
    names, rows = table("III")
    o2, o4 = solution["O2"], solution["O4"]
    angles = np.rad2deg(np.column_stack([o2.position[:, 0], o4.position[:, 0]]))
    slopes = np.abs(np.column_stack([o2.velocity[:, 0], o4.velocity[:, 0]]) / solution["O1"].velocity)
    printed = rows[:, [names.index(n) for n in ("theta2", "theta4")]]
    allowed = ROUNDING + DEGREE * (np.abs(printed) + slopes * rows[:, :1])
    assert (np.abs(angles - printed) <= allowed).all()
    ours = np.column_stack([
        o2.position[:, 1], o2.velocity[:, 0], o2.velocity[:, 1], o4.velocity[:, 0],
        o2.acceleration[:, 0], o2.acceleration[:, 1], o4.acceleration[:, 0],
    ])  # fmt: skip
    printed = rows[:, [names.index(n) for n in ("S2", "w2", "S2dot", "w4", "alpha2", "S2ddot", "alpha4")]]
    assert np.abs(ours - printed).max() <= ROUNDING


@pytest.mark.parametrize(
    ("number", "quantity"), [("IV", "center"), ("VI", "center_velocity"), ("VIII", "center_acceleration")]
)
def test_mass_centres_of_tables_iv_vi_viii(solution: mg.Solution, number: str, quantity: str) -> None:
    ours = in_lees_axes(*(getattr(solution.link(f"link{k}"), quantity) for k in (1, 2, 3)))
    assert np.abs(ours - table(number)[1][:, 1:]).max() <= ROUNDING


@pytest.mark.parametrize(("number", "order"), [("V", 0), ("VII", 1), ("IX", 2)])
def test_pair_points_of_tables_v_vii_ix(solution: mg.Solution, number: str, order: int) -> None:
    origin = (0.0, 0.0, 0.0)  # link frames are the markers B of O2 and O3
    ours = in_lees_axes(*(solution.link(link).point(origin)[order] for link in ("link2", "link3")))
    assert np.abs(ours - table(number)[1][:, 1:]).max() <= ROUNDING
