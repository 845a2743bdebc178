"""What ``bench_response`` hands to other programs, and how it chooses; without those programs, and without a clock."""

from types import SimpleNamespace

import bench_response
import motion_mechgraph
import numpy as np
import pytest
from motion_cases import row


def test_a_row_is_told_in_numbers():
    """Cranks turn at -1 rad/s about their feet, rods only travel; the path comes near to the exact one."""
    case = row(2)
    spin = {body.name: body.angular_velocity[2] for body in case.bodies}
    assert [spin[name] for name in ("c0", "c1", "c2", "r0", "r1")] == pytest.approx([-1, -1, -1, 0, 0], abs=1e-12)
    assert [joint.name for joint in case.joints] == ["A0", "A1", "A2", "B0", "C0", "B1", "C1"]
    assert case.error(motion_mechgraph.solve(case, "DOP853", 1e-9)) < 1e-5
    assert case.error(np.full((101, 3), np.nan)) == np.inf


def stepping(errors):
    """A program with an error for every setting; None fails."""

    def solve(case, variant, setting):
        if errors[setting] is None:
            raise RuntimeError("stopped")
        return errors[setting]

    return SimpleNamespace(
        ladder=lambda case, variant: list(range(len(errors))), variants=lambda case: ("only",), solve=solve
    )


case_of_errors = SimpleNamespace(error=lambda found: found)


@pytest.mark.parametrize(
    ("errors", "places", "failures"),
    [
        ([1.0, 1e-2, 1e-4, 1e-5, 1e-7], [2, 4], ["", ""]),
        ([1.0, 1e-8], [1, 1], ["", ""]),
        ([None, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-9], [1, 0], ["", "error stays 1e-04"]),
        ([1.0, None], [0, 0], ["stopped", "stopped"]),
    ],
)
def test_the_coarsest_setting_that_reaches_an_accuracy_counts(errors, places, failures):
    found = bench_response.climbed(stepping(errors), case_of_errors, "only", 0, np.inf)
    assert [run.place for run in found] == places
    assert [run.failure for run in found] == failures


def test_growth_is_told_from_forty_on():
    runs = {n: [bench_response.Run(seconds=float(n))] for n in (1, 40, 400)}
    assert bench_response.exponent(runs, 0) == "1.00 (N = 40 to 400)"
    assert bench_response.exponent({1: [bench_response.Run(seconds=1.0)]}, 0) == "-"
