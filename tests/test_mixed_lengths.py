"""Lengths far apart: an answer as long as ranks can be told, and at every door the same refusal where they cannot."""

import numpy as np
import pytest
from mechanisms import Z

import mechgraph as mg

D, C = np.array([1.0, 0.0, 0.0]), np.array([2.3, -1.5, 0.0])


def guided(long):
    """A four-bar whose crank and coupler are so long: the end C of its rocker moves along a line that turns with the crank."""
    points = np.zeros(3), long * np.array([np.cos(1), np.sin(1), 0]), C, D
    names = ("A", "frame", "crank"), ("B", "crank", "coupler"), ("C", "coupler", "rocker"), ("D", "frame", "rocker")
    pairs = [mg.Pair(name, "R", a, b, point=point, axis=Z) for (name, a, b), point in zip(names, points, strict=True)]
    return mg.Mechanism("guided", None, pairs, ["A"])


def loaded(m):
    return m.replace(drives=[], loads=[mg.TorsionSpring("A", stiffness=1.0, free=0.1)])


@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_what_can_be_told_is_right(engine):
    """``u . C`` stays, ``u`` the direction of the crank, up to one over its length."""
    q = np.linspace(-0.3, 0.3, 3)
    s = mg.kinematics(guided(1e8), {"A": q}, engine=engine)
    u, r = np.array([np.cos(1 + q), np.sin(1 + q)]), C - D
    phi = 1 + q - np.arccos((C[0] * np.cos(1) + C[1] * np.sin(1) - u[0]) / np.hypot(r[0], r[1]))
    np.testing.assert_allclose(s["D"].position[:, 0], phi - np.arctan2(r[1], r[0]), atol=3e-8)


DOORS = {
    "check": mg.check,
    "dense": lambda m: mg.solve(m, {"A": 0.05}, engine="dense"),
    "sparse": lambda m: mg.solve(m, {"A": 0.05}, engine="sparse"),
    "compiled": lambda m: mg.kinematics(m, {"A": 0.05}, engine="compiled"),
    "assemble": lambda m: mg.assemble(m, {"A": 0.05}),
    "a guess": lambda m: mg.assemble(m, {"A": 0.05}, guess={"D": 0.0}),
    "assemblies": lambda m: mg.assemblies(m, {"A": 0.05}),
    "equilibrium": lambda m: mg.equilibrium(loaded(m)),
    "respond": lambda m: mg.respond(loaded(m), [0.0, 0.1]),
}


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize("long", [1e10, 1e12])
def test_what_cannot_is_refused_at_every_door(door, long):
    with pytest.raises(
        mg.DeclarationError, match=r"lengths are too far apart: D and A are 1 apart in the loop A, B, C, D of size"
    ):
        DOORS[door](guided(long))


def test_points_that_are_meant_to_coincide_are_no_mixed_lengths():
    """Two pins at one place of a link, with digits of a drawing: no rank hangs on their distance."""
    at = {
        "A": (0, 0, 0),
        "B": (0.3, 1, 0),
        "C": (2, 1.5, 0),
        "D": (2, 0, 0),
        "E": (2 + 3e-10, 1.5, 0),
        "F": (3, 0.2, 0),
        "G": (4, 1, 0),
    }
    names = {
        "A": "frame crank",
        "B": "crank rod",
        "C": "rod rocker",
        "D": "rocker frame",
        "E": "rod arm",
        "F": "frame end",
        "G": "arm end",
    }
    m = mg.Mechanism(
        "six", None, [mg.Pair(n, "R", *names[n].split(), point=p, axis=Z) for n, p in at.items()], ["A"], frame="frame"
    )
    assert mg.check(m).mobility == 1


def test_an_equilibrium_of_links_without_mass():
    assert mg.equilibrium(loaded(guided(3.0))).start["A.Rz"] == pytest.approx(0.1)


@pytest.mark.parametrize("engine", ["dense", "sparse"])
@pytest.mark.parametrize("length", [6e8, 1e9])
def test_what_one_engine_would_call_singular_both_refuse(length: float, engine: str) -> None:
    """A crank of 1 and a frame of 1.5 between bars so long: 'out of reach' and 'beyond a dead point' were said, both false."""
    C = (1.25, np.sqrt(length**2 - 0.25**2))
    at = {
        "A": ("frame", "crank", (0, 0)),
        "B": ("crank", "rod", (1, 0)),
        "C": ("rod", "bar", C),
        "D": ("frame", "bar", (1.5, 0)),
    }
    pairs = [mg.Pair(name, "R", a, b, point=point) for name, (a, b, point) in at.items()]
    m = mg.Mechanism("long", pairs=pairs, drives=["A"], planar=True)
    with pytest.raises(mg.DeclarationError, match="lengths are too far apart: A and B are 1 apart"):
        mg.solve(m, {"A": 0.3}, engine=engine)
