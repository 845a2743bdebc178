"""Lee 1977, Tables XV to XVIII: kinetostatics of RCSR, reproduced with his inertia torque (3.31) in place of the true one."""

import numpy as np
import pytest
from lee_1977 import rcsr
from lee_1977.tables import largest, printed

pytestmark = pytest.mark.reference

TABLES = ("XV", "XVI", "XVII", "XVIII")
ROUNDING = 0.7e-2
"""0.7 of the last printed digit."""


@pytest.mark.parametrize("number", TABLES)
def test_with_the_inertia_torque_of_the_thesis(number: str) -> None:
    """Equation 3.31 as an applied wrench on links without mass: every column, every row."""
    assert np.abs(rcsr.reactions(rcsr.as_lee())[number] - printed(number)).max() <= ROUNDING


@pytest.mark.parametrize("number", TABLES)
def test_with_the_true_inertia_the_table_is_another(number: str) -> None:
    assert largest(rcsr.reactions(rcsr.physical())[number] - printed(number)) > 50.0


def test_true_input_torque() -> None:
    """M_IN at 150 and 202 degrees, by what the printed tensors are taken to be (they belong to no body)."""
    assert rcsr.true_driver()[150] == pytest.approx((-27.313, 8.38), abs=1e-3)
    assert rcsr.true_driver()[202] == pytest.approx((-135.036, -45.57), abs=1e-3)
    found = rcsr.true_drivers()
    assert found["without tensors"] == pytest.approx((-27.289, -134.850), abs=1e-3)
    assert found["about the mass center"] == pytest.approx((-27.313, -135.036), abs=1e-3)
    assert found["about O_i"] == pytest.approx((-14.522, -53.720), abs=1e-3)


def test_both_are_in_balance() -> None:
    """His torque is a load like any other: the equations hold, only the load is wrong."""
    for s in (rcsr.as_lee(), rcsr.physical()):
        assert np.abs(s.checks.power).max() < 1e-10
        assert s.checks.equilibrium.max() < 1e-10
