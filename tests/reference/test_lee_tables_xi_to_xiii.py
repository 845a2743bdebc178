"""Lee 1977, Tables XI to XIII: kinematics of the RCHCH mechanism. No row closes; only the conditions of the pitches hold."""

import numpy as np
import pytest
from lee_1977 import rchch
from lee_1977.tables import last_place, table

pytestmark = pytest.mark.reference

ANGLES = ("theta1", "theta2", "theta3", "theta5")


@pytest.mark.parametrize(
    ("number", "turn", "slide"), [("XI", "theta", "S"), ("XII", "w", "S{}dot"), ("XIII", "alpha", "S{}ddot")]
)
@pytest.mark.parametrize(("k", "pitch"), [(3, 2.0), (5, 5.0)])
def test_conditions_of_the_pitches(number: str, turn: str, slide: str, k: int, pitch: float) -> None:
    """S = rho theta, and its rates: both sides are rounded, the turn times the pitch."""
    t, place = table(number), last_place(number)
    turn, slide = f"{turn}{k}", slide.format(k) if "{}" in slide else f"{slide}{k}"
    radians = np.deg2rad(1.0) if number == "XI" else 1.0
    allowed = 0.7 * (place[slide] + pitch * radians * place[turn])
    assert np.abs(pitch * radians * t[turn] - t[slide]).max() <= allowed
    assert np.abs(1.1 * pitch * radians * t[turn] - t[slide]).max() > 3 * allowed


def test_no_row_of_table_xi_is_a_closure() -> None:
    """The directions of A4 on the two halves of the chain, by mechgraph and by rotations alone."""
    low, high = rchch.gap_of_table_xi()
    assert (low, high) == pytest.approx((81.4, 160.3), abs=0.1)
    t = table("XI")
    gaps = rchch.direction_gap({name: np.deg2rad(t[name]) for name in ANGLES})
    assert (gaps.min(), gaps.max()) == pytest.approx((low, high), abs=1e-9)


def test_the_gap_of_a_true_closure_is_zero() -> None:
    """The same measure on the four assembly modes of the corrected table; arccos near 1 leaves 2e-6 degrees."""
    assert len(rchch.branches()) == 4
    for s in rchch.branches():
        assert s.checks.closure.max() < 1e-10
        assert rchch.direction_gap({f"theta{k}": s[f"O{k}"].position[:, 0] for k in (1, 2, 3, 5)}).max() < 1e-5


def test_no_choice_of_signs_closes_table_xi() -> None:
    """256 choices of the signs of angles and twists: at best half the rows are 10 degrees open, and the worst 68."""
    greatest, median = rchch.smallest_gaps_of_all_signs()
    assert greatest > 60.0
    assert median == pytest.approx(10.1, abs=0.1)


def test_speeds_of_table_xii_are_no_slope_of_table_xi() -> None:
    """w5 (rad/s) differs from the difference quotient of theta5 by up to 308 w1, w1 = .1 rad/s."""
    assert rchch.slope_of_table_xi() == pytest.approx(307.85, abs=0.1)
