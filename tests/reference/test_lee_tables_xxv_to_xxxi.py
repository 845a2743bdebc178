"""Lee 1977, Tables XXV to XXXI: kinetostatics of RCSR-CSR without mass, reproduced with four errors copied.

The errors: the two of Table X (see there); the dual parts of E, F and G taken at other points than O6 (2.70, 2.77), so that R25
is no pure force; and the z component of the output couple about A7 with the wrong sign.
"""

import numpy as np
import pytest
from lee_1977 import rcsr_csr
from lee_1977.tables import largest, printed, table

import mechgraph as mg

pytestmark = pytest.mark.reference

ROUNDING = 0.7e-3
"""0.7 of the last printed digit."""
DEGREE = 3e-6
"""The truncated degree of the thesis, see test_lee_table_x: it counts where a reaction changes steeply with theta1."""


@pytest.mark.parametrize("number", ["XXV", "XXVI", "XXVII", "XXVIII", "XXIX", "XXX"])
def test_with_four_errors(number: str) -> None:
    """Every column and row but the three damaged cells; theta1 itself is uncertain by 3e-6."""
    theta1 = table(number)["theta1"]
    slope = np.abs(np.gradient(rcsr_csr.copied()[number], theta1, axis=0, edge_order=2))
    found = rcsr_csr.differences(number)
    assert np.isnan(found).sum() == len(rcsr_csr.DAMAGED.get(number, []))
    assert (np.nan_to_num(np.abs(found)) <= ROUNDING + DEGREE * slope * theta1[:, None]).all()


def test_with_his_short_degree() -> None:
    """The .0018 of row 214 is that of theta1: 1.8 in a million shorter, all seven tables agree to .0008."""
    assert 1.7e-3 < max(rcsr_csr.kinetostatics().values()) < 1.9e-3
    assert max(rcsr_csr.kinetostatics(rcsr_csr.SHORT).values()) < 0.8e-3


@pytest.mark.parametrize(("row", "name", "same"), [(188, "F21y", "F41y"), (210, "F21x", "FA1")])
def test_damaged_cells_of_table_xxvi(row: int, name: str, same: str) -> None:
    """Link 1 has no mass, so O1 and O2 carry the same force: Tables XXV and XXVI agree in all rows but these."""
    away = np.abs(table("XXVI")[name] - table("XXV")[same])
    assert list(table("XXVI")["theta1"][away > 1.5e-3]) == [row]


def test_damaged_cell_of_table_xxvii() -> None:
    """FA4 of the last row: .743, where the forces at O3 of Table XXVIII and the copied formulation both ask for .748.

    An 8 read as a 3, as .608 as .603 above. The other rows agree: four rounded numbers, 1 + sqrt(3) places.
    """
    away = np.abs(rcsr_csr.axial_force_from_table_xxviii() - printed("XXVII")[:, 6])
    assert list(table("XXVII")["theta1"][away > 0.7e-3 * (1 + np.sqrt(3))]) == [214.0]
    assert rcsr_csr.axial_force_from_table_xxviii()[-1] == pytest.approx(0.748, abs=ROUNDING)
    assert rcsr_csr.copied()["XXVII"][-1, 6] == pytest.approx(0.748, abs=ROUNDING)


def test_columns_of_table_xxxi_are_those_of_table_xxv() -> None:
    """Rows 160 to 212 hold F46x alone; F46y to FA7 are the next row of Table XXV. Row 214 is whole."""
    assert rcsr_csr.shifted_columns() == 0.0
    first, last = rcsr_csr.table_xxxi()
    assert np.abs(first).max() <= ROUNDING
    assert np.abs(last).max() <= ROUNDING + DEGREE * 214.0 * 5.0  # moments change by 5 a degree there


def test_printed_r25_is_no_pure_force() -> None:
    low, high = rcsr_csr.spread_of_printed_r25()
    assert (low, high) == pytest.approx((-14.2, 8.3), abs=0.1)


def test_pure_forces_at_o6_give_another_input_torque() -> None:
    """Same closures, M_IN -14.40 and 2.02 in the first and last row; printed -6.022 and .098."""
    found = rcsr_csr.driver_without_errors_at_o6()
    assert found[160] == pytest.approx((-14.396, -6.022), abs=1e-3)
    assert found[214] == pytest.approx((2.020, 0.098), abs=1e-3)
    for number in ("XXV", "XXVI", "XXVII", "XXVIII"):
        assert largest(rcsr_csr.without_errors_at_o6()[number] - printed(number)) > 1.0
    force = rcsr_csr.true_forces_at_o6()
    assert np.abs((force[:, :3] * force[:, 3:]).sum(axis=1)).max() < 1e-9


def test_the_true_mechanism_obeys_virtual_work() -> None:
    """``rcsr-csr`` (P6 = 1): M1 w1 + 1 w4 + 4 w7 = 0."""
    s = mg.solve(mg.load("rcsr-csr"))
    power = sum(c * s[name].velocity[:, 0] for name, c in (("O4", 1.0), ("O7", 4.0)))
    np.testing.assert_allclose(s["O1"].effort[:, 0] * s["O1"].velocity[:, 0], -power, atol=1e-10)
