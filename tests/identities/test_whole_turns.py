"""Identities of motions that repeat themselves: far positions are those followed all the way."""

import numpy as np
import pytest
from mechanisms import Z

import mechgraph as mg
from mechgraph.kinematics import reach
from mechgraph.kinematics.motion_path import DriverPath


def geared():
    """A four-bar whose crank is geared to the driven wheel by 2 : 3: it repeats itself after three turns of the wheel."""
    four_bar = mg.load("four-bar")
    wheel = mg.Pair("G", "R", "frame", "wheel", point=(-1, 0, 0), axis=Z)
    coupling = mg.Coupling({"G": 2.0, "A": -3.0})
    return mg.Mechanism("geared", pairs=[wheel, *four_bar.pairs], couplings=[coupling], drives=["G"])


def screw():
    """A screw geared to a wheel: it goes on and on."""
    pairs = [
        mg.Pair("A", "R", "frame", "wheel", point=(0, 0, 0), axis=Z),
        mg.Pair("H", "H", "frame", "bolt", point=(1, 0, 0), axis=Z, lead=0.1),
    ]
    return mg.Mechanism("screw", pairs=pairs, couplings=[mg.Coupling({"A": 1.0, "H": -1.0})], drives=["A"])


MADE = {"geared": geared, "screw": screw, "four-bar": None, "rssr": None, "7r": None, "rcsr": None}


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("name", MADE)
def test_far_positions_are_those_followed_all_the_way(name, sense, monkeypatch):
    m = MADE[name]() if MADE[name] else mg.load(name)
    q = {m.drives[0].freedom: mg.Motion(sense * np.array([0.3, 7.0, 60.0, 61.0]), velocity=1.0)}
    s = mg.kinematics(m, q, on_reach="flag", engine="dense")
    monkeypatch.setattr(reach, "WORTH", 1e9)
    r = mg.kinematics(m, q, on_reach="flag", engine="dense")
    assert s.status.tolist() == r.status.tolist()
    for link in m.link_names():
        np.testing.assert_allclose(s.link(link).pose, r.link(link).pose, atol=1e-9)
        np.testing.assert_allclose(s.link(link).twist, r.link(link).twist, atol=1e-9)
    for pair in m.pairs:
        if len(np.atleast_1d(s[pair.name].position[0])) == 1:
            np.testing.assert_allclose(s[pair.name].position, r[pair.name].position, atol=1e-9)
    if name not in ("screw", "rcsr"):
        assert s.work.nodes < 0.5 * r.work.nodes


@pytest.mark.parametrize("name", ["four-bar", "rssr", "geared"])
def test_a_thousand_radians_take_one_period(name):
    m = MADE[name]() if MADE[name] else mg.load(name)
    s = mg.kinematics(m, {m.drives[0].freedom: [1000.0]}, engine="dense")
    assert s.work.nodes < 200
    np.testing.assert_allclose(s[m.drives[0].freedom.split(".")[0]].position[0, 0], 1000.0, rtol=1e-15)


def test_periods_of_a_rod_that_turns_are_continued_many_together(monkeypatch):
    """Rotation vectors of the ball joints over 16,000 turns of the crank: in some hundred batches, not one a turn."""
    calls, advance = [], DriverPath.advance
    monkeypatch.setattr(DriverPath, "advance", lambda *given: calls.append(1) or advance(*given))
    m = mg.load("rssr")
    s = mg.kinematics(m, {"A": [1e5]})
    assert len(calls) < 1000
    near = mg.kinematics(m, {"A": [1e5 - 2 * np.pi * np.floor(1e5 / (2 * np.pi))]})
    np.testing.assert_allclose(s["D"].position % (2 * np.pi), near["D"].position % (2 * np.pi), atol=1e-8)


@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("turns", [2.4, 10.0, -3.0])
def test_a_bush_at_rest_counts_every_turn(engine: str, turns: float) -> None:
    """Between two hinges on one axis of a crank about z: at rest it turns in the crank by the crank's turn times the cosine of the axes."""
    axes = np.array([[0, 0, 1.0], [0.3, 0.05, 1.0], [0.9, 0.8, 0.7], [-0.3, 1.0, 0.6]])
    hinges = [
        ("A", "frame", "a", 0),
        ("B1", "a", "bush", 1),
        ("B2", "bush", "b", 1),
        ("C", "b", "c", 2),
        ("D", "c", "frame", 3),
    ]
    pairs = [mg.Pair(name, "R", a, b, point=1.2 * axes[i], axis=axes[i]) for name, a, b, i in hinges]
    crank = np.array([0.4, 1.0]) * 2 * np.pi * turns
    s = mg.kinematics(mg.Mechanism("bush", None, pairs, ["A"]), {"A": crank}, engine=engine)
    assert np.allclose(s["B1"].position.ravel(), -crank / np.linalg.norm(axes[1]), atol=1e-10)
