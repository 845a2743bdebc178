"""Lee 1977, Tables XXXIII to XXXVII: reactions of RCHCH. No closure stands behind them; some identities of statics hold."""

import numpy as np
import pytest
from lee_1977 import rchch
from lee_1977.rcsr import axis_2
from lee_1977.tables import axial_sums, largest, last_place, printed, table

import mechgraph as mg

pytestmark = pytest.mark.reference

PLACE = 0.01
"""The last printed digit."""
CALM = 100.0
"""Forces above it, up to 1.7e4 in four rows, are singular geometry: their moments about an axis drown in rounding."""


def test_every_column_is_printed_to_the_same_place() -> None:
    for number in ("XXXIII", "XXXIV", "XXXV", "XXXVI", "XXXVII"):
        places = {place for name, place in last_place(number).items() if table(number)[name].any() and name != "theta1"}
        assert places == {PLACE}


def test_equilibrium_of_link_1() -> None:
    """R51 + R21 + M_IN = 0 (link 1 turns about its own center line slowly: inertia below rounding), each side rounded."""
    assert rchch.force_identities()["XXXIII: R51 + R21 + M_IN"] <= 0.7 * 2 * PLACE


def test_the_two_damaged_cells_of_table_xxxiii() -> None:
    """M51y of -55 and -5 degrees is not minus M21y as it is elsewhere; -3.97 and -23.97 would be."""
    theta1 = table("XXXIII")["theta1"]
    away = np.abs(table("XXXIII")["M51y"] + table("XXXIV")["M21y"]) > 0.7 * 2 * PLACE
    assert list(theta1[away]) == [-55.0, -5.0]


def conditions(number: str) -> tuple[np.ndarray, np.ndarray]:
    """Force along and moment about the axis in the calm rows, and what rounding allows."""
    theta1 = np.deg2rad(table(number)["theta1"])
    if number == "XXXIV":
        axis = axis_2(theta1, rchch.TWIST_1)
        point = np.column_stack(
            [np.full_like(theta1, -rchch.S1), -rchch.P1 * np.cos(theta1), rchch.P1 * np.sin(theta1)]
        )
    else:
        axis, point = (np.broadcast_to(v, (len(theta1), 3)) for v in (rchch.A5, rchch.O5))
    values = printed(number)
    arm = np.abs(np.cross(point, axis)).sum(axis=1)
    along = np.abs(axis).sum(axis=1)
    allowed = 0.7 * PLACE * np.column_stack([along, along + arm])
    calm = np.abs(values[:, :3]).max(axis=1) < CALM
    return axial_sums(values[:, :3], values[:, 3:6], axis, point)[calm], allowed[calm]


@pytest.mark.parametrize("number", ["XXXIV", "XXXVII"])
def test_pair_conditions(number: str) -> None:
    """Cylindrical pair O2 with S1 = .2, helical pair O5: F^ . A^ = 0."""
    found, allowed = conditions(number)
    assert len(found) > 15
    assert (np.abs(found) <= allowed).all()


@pytest.mark.parametrize(("number", "k", "pitch"), [("XXXV", 3, 2.0), ("XXXVII", 5, 5.0)])
def test_couple_and_force_along_a_screw(number: str, k: int, pitch: float) -> None:
    """M^A + rho F^A = 0, both rounded."""
    t = table(number)
    assert largest(t[f"MA{k}"] + pitch * t[f"FA{k}"]) <= 0.7 * PLACE * (1 + pitch)
    assert largest(t[f"MA{k}"] - pitch * t[f"FA{k}"]) > 1.0


def test_output_of_the_calm_rows_does_no_work() -> None:
    """FA5 near 2 = M_out / rho5 where theta1 is small in size: C(21) to C(23) of Table XXXII cancel the output couple."""
    work = rchch.work_of_output()
    assert abs(work["as printed"]) < 1e-9
    assert work["couple"] == pytest.approx(1.776, abs=1e-3)


def test_force_row_of_link_4_holds_in_table_xxxvi() -> None:
    """3.104 with the term M_out / rho5 of Table XXXII: .0105 in all 25 rows, where forces reach 3891; not with another mass or output."""
    assert rchch.force_row_of_link_4().shape == (25, 3)
    assert largest(rchch.force_row_of_link_4()) < 0.011
    assert largest(rchch.force_row_of_link_4(mass=0.4)) > 100.0
    assert largest(rchch.force_row_of_link_4(mass=0.6)) > 100.0
    assert largest(rchch.force_row_of_link_4(output=5.0)) > 0.8
    assert largest(printed("XXXVI")[:, :3]) > 3800.0


def test_condition_of_o4_does_not_hold() -> None:
    """Table XXXVI: F43 . A4, A4 from theta5 of Table XI, is 6 lb where rounding would leave .01, whatever the signs."""
    assert rchch.axial_force_of_o4() == pytest.approx(5.98, abs=0.02)


def test_true_input_torque_is_another() -> None:
    """-1.0 to -2.0 over the range of the table; printed is -23 to 8 and more."""
    shown = table("XXXIII")["MIN"]
    for s in rchch.branches():
        assert np.abs(s["O1"].effort).max() < 3.0
    assert np.ptp(shown) > 30.0
    assert mg.check(mg.load("rchch")).determinate
