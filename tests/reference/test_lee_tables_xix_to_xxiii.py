"""Lee 1977, Tables XIX to XXIII: RCSR under a torque of 10. What can be had of XIX, and the identities of XX to XXIII."""

import numpy as np
import pytest
from lee_1977 import response
from lee_1977.rcsr import axis_2
from lee_1977.tables import X, axial_sums, last_place, printed, table

import mechgraph as mg

pytestmark = pytest.mark.reference

ROUNDING = 0.7e-3
"""0.7 of the last digit of Table XIX."""


def test_speed_of_table_xix_is_the_trapezoid_of_its_acceleration() -> None:
    """w1 from rest, alpha1 zero before the first row; equation 3.69, the slope at the beginning, is not what was used."""
    found = response.integration()
    assert found["w1"] <= ROUNDING
    assert found["w1 by 3.69"] > 4 * ROUNDING


def test_angle_of_table_xix_is_the_trapezoid_of_its_speed() -> None:
    """theta1 one row late. The rounding of alpha1 (half of .001) is summed twice over the rows before: an upper bound."""
    steps = np.arange(len(table("XIX")["alpha1"]))
    summed = np.rad2deg(0.5e-3 * response.STEP**2 * steps**2 / 2).max()
    found = response.integration()["theta1"]
    assert found <= ROUNDING + summed
    assert found <= 0.01


def test_dependent_rates_of_table_xix_are_a_row_late() -> None:
    """w2, w4, alpha2, alpha4 with w1, alpha1 of the row before, which are rounded themselves."""
    t = table("XIX")
    unit = mg.kinematics(response.mechanism(), {"O1": mg.Motion(np.deg2rad(t["theta1"]), 0.0, 1.0)})
    found = response.dependent_rates()
    for k in (2, 4):
        per_alpha1 = np.abs(unit[f"O{k}"].acceleration[:, 0]).max()
        assert found[f"w{k}"] <= ROUNDING
        assert found[f"alpha{k}"] <= ROUNDING + 0.5e-3 * per_alpha1


def test_dependent_rates_of_table_xix_do_not_fit_their_own_row() -> None:
    t = table("XIX")
    s = mg.kinematics(response.mechanism(), {"O1": mg.Motion(np.deg2rad(t["theta1"]), t["w1"], t["alpha1"])})
    assert np.abs(s["O2"].velocity[:, 0] - t["w2"]).max() > 10 * ROUNDING


def test_acceleration_of_table_xix_is_not_to_be_had() -> None:
    """At rest the point masses alone allow 10 / 365 = .0274 rad/s2; printed is .175."""
    assert response.acceleration_at_rest() == pytest.approx(0.0274, abs=1e-4)
    assert table("XIX")["alpha1"][0] == 0.175


def pairs() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Axis and point of the pair behind each table, over its rows."""
    theta1 = np.deg2rad(table("XIX")["theta1"])
    a2 = axis_2(theta1, response.TWIST_1)
    o2 = np.column_stack(
        [np.full_like(theta1, -response.S1), -response.P1 * np.cos(theta1), response.P1 * np.sin(theta1)]
    )
    still = np.ones((len(theta1), 1))
    return {"XX": (X * still, 0.0 * still * X), "XXI": (a2, o2), "XXIII": (response.A4 * still, response.O4 * still)}


@pytest.mark.parametrize("number", ["XX", "XXI", "XXIII"])
def test_pair_conditions(number: str) -> None:
    """F . A = 0 and M . A + F . (P x A) = 0 with S1 = P1 = 5, P4 = 10: each rounded component counts with its factor."""
    axis, point = pairs()[number]
    values = printed(number)
    place = max(last_place(number).values())
    arm = np.abs(np.cross(point, axis)).sum(axis=1)
    allowed = 0.7 * place * np.column_stack([np.abs(axis).sum(axis=1), np.abs(axis).sum(axis=1) + arm])
    assert (np.abs(axial_sums(values[:, :3], values[:, 3:6], axis, point)) <= allowed).all()
    shifted = axial_sums(values[:, :3], values[:, 3:6], axis + np.array([0.0, 0.3, 0.0]), point)
    assert (np.abs(shifted) > 3 * allowed).any()


def test_input_torque_stands_in_table_xxi() -> None:
    np.testing.assert_array_equal(table("XXI")["M12x"], response.TORQUE)


def test_force_row_of_link_3_lacks_the_velocity_terms() -> None:
    """R43 + R23 = M3 a of Tables XXIII and XXII only without w1^2: three rounded vectors (.01, .01, .001 times 5)."""
    found = response.link_3()
    assert found["decoded"] <= 0.7 * (0.01 + 0.01 + 3 * 0.001)
    assert found["true"] > 1.0
