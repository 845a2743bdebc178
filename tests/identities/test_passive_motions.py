"""Passive motions at positions: whatever basis the equations give, each one is told apart from the others by the links that it moves."""

from __future__ import annotations

import numpy as np
import pytest

import mechgraph as mg
from mechgraph.determinacy.mobility import free_motion
from mechgraph.kinematics.assembly import closed_start
from mechgraph.kinematics.rates import PassiveMotions, are_alone
from tests import machines
from tests import mechanisms as known


@pytest.mark.parametrize("make", [lambda: known.hexapod("SPS"), machines.five_rods], ids=["hexapod", "five rods"])
def test_mixed_motions_of_rods_are_told_apart(make) -> None:
    m = make()
    here = closed_start(m)
    system = here.system
    columns = np.array([system.first_column[m.freedom(drive.freedom)[0]] for drive in m.drives])
    passive = free_motion(system, here.x[:, 0], columns, "dense").passive
    assert len(passive) >= 5
    assert are_alone(passive)
    Z = np.stack([motion.rates for motion in passive], axis=1)
    mixed = Z @ np.random.default_rng(3).normal(size=(len(passive), len(passive)))
    found = PassiveMotions(here, passive, mixed[:, :, None])
    for i, motion in enumerate(passive):
        rates = found.rates[:, i, 0] / np.linalg.norm(found.rates[:, i])
        assert abs(rates @ motion.rates) == pytest.approx(np.linalg.norm(motion.rates), abs=1e-12)
        own = [found.links.index(link) for link in motion.links]
        others = np.delete(found.twists[:, :, i, 0], own, axis=1)
        assert np.abs(others).max() < 1e-12 * np.abs(found.twists[:, own, i]).max()


def test_the_rods_of_a_suspension_rest_in_their_spins() -> None:
    m = machines.five_rods()
    s = mg.kinematics(m, {"road": mg.Motion(np.linspace(0, 0.05, 9), np.ones(9), np.full(9, 0.3))})
    for k in range(1, 6):
        pose, V, A = s.link(f"rod{k}").pose, s.link(f"rod{k}").twist, s.link(f"rod{k}").acceleration
        u = pose[:, :3, :3] @ np.subtract(m.pair(f"O{k}").point, m.pair(f"I{k}").point)
        turning = np.cross(V[:, :3], u)
        assert np.abs((V[:, :3] * u).sum(axis=1)).max() < 1e-13
        assert np.abs((A[:, :3] * u).sum(axis=1) + (V[:, :3] * turning).sum(axis=1)).max() < 1e-12


def test_a_washer_rests_whatever_two_drivers_do() -> None:
    """Between a table on a turning arm and the ground: three passive motions, of which none is begun."""
    Z, at = (0, 0, 1), (1, 0, 0)
    pairs = [
        mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "P", "arm", "table", point=at, axis=at),
    ]
    pairs += [
        mg.Pair("E", "E", "table", "washer", point=at, axis=Z),
        mg.Pair("F", "E", "washer", "frame", point=at, axis=Z),
    ]
    m = mg.Mechanism("washer", None, pairs, ["A", "B"], frame="frame")
    s = mg.kinematics(m, {"A": mg.Motion([0.0, 0.6], 1.0), "B": mg.Motion([0.0, 0.5], 0.5)})
    np.testing.assert_allclose(s.link("washer").pose[-1], np.eye(4), atol=1e-14)
    np.testing.assert_allclose(s["F"].position[-1], 0.0, atol=1e-14)
