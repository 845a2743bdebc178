"""Steps of a path whose middles the certificate would refuse are halved before it is asked."""

import numpy as np
import pytest

from mechgraph.numerics.certificate import bent
from mechgraph.numerics.tolerances import PATH
from mechgraph.numerics.tracks import Nodes


class Numbers:
    """A problem whose states are plain numbers."""

    def difference(self, x1, x0):
        return x1 - x0

    def tangent(self, dq, rates):
        return rates


def node(x, rate, drive, place):
    one = np.ones(1, dtype=np.intp)
    drive, place = np.array([[drive]]), np.array([place])
    return Nodes(np.array([[x]]), np.array([[[rate]]]), drive, 0 * one, place, 0 * one, place + 1.0, one > 0)


@pytest.mark.parametrize(
    ("missed", "h", "halved"),
    [
        (0.8 * PATH.uneven, 0.1, False),
        (1.2 * PATH.uneven, 0.1, True),
        (0.9 * PATH.correction / 0.3, 0.3, True),
        (1.1 * PATH.correction / 0.3, 0.3, False),
    ],
)
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_steps_of_uneven_rates(missed, h, halved, sense):
    """On ``x = q + c q^3`` the mean of both rates misses the mean rate by ``c h^2 / 2``; on ``q + q^2`` by nothing, however bent."""
    c = 2.0 * missed / h**2
    a = node(0.0, 1.0, 0.0, 0.0)
    b = node(sense * (h + c * h**3), 1.0 + 3.0 * c * h**2, sense * h, h)
    assert bent(Numbers(), a, b).tolist() == [halved]
    b = node(sense * h + 50.0 * h**2, 1.0 + sense * 100.0 * h, sense * h, h)
    assert not bent(Numbers(), a, b).any()
