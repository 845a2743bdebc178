"""Loops that close with one marker axis reversed: the message names the pair and the marker."""

import numpy as np
import pytest
from attack import anywhere

import mechgraph as mg

Z, BACK = (0, 0, 1), (0, 0, -1)
BARS = [
    ("A", "frame", "crank", 0.0, 0.0),
    ("B", "crank", "coupler", 1.0, 0.0),
    ("C", "coupler", "rocker", 3.0, 2.5),
    ("D", "frame", "rocker", 3.2, 0.0),
]


def four_bar(turned=None, size=1.0, frames=None):
    """A four-bar by markers of which one axis may be ``turned``; ``frames``: poses that change the frames of the links."""
    frames = frames or {}

    def marker(pair, side, link, x):
        X = frames.get(link, np.eye(4))
        z = np.array(BACK if turned == (pair, side) else Z)
        return mg.Marker(X[:3, :3] @ [size * x, 0, 0] + X[:3, 3], X[:3, :3] @ z, X[:3, :3] @ [1.0, 0, 0])

    pairs = [
        mg.Pair(p, "R", a, b, on_a=marker(p, "on_a", a, x), on_b=marker(p, "on_b", b, y)) for p, a, b, x, y in BARS
    ]
    return mg.Mechanism("four-bar", None, pairs, ["A"], start={"A": 0.5, "B": 0.3, "D": 2.0})


@pytest.mark.daily(1)
@pytest.mark.parametrize("side", ["on_a", "on_b"])
@pytest.mark.parametrize("pair", "ABCD")
@pytest.mark.parametrize("size", [1.0, 1e-3, 1e4])
def test_the_reversed_marker_is_named(pair, side, size):
    assert mg.solve(four_bar(size=size), {"A": 0.5}).status == "ok"
    with pytest.raises(mg.AssemblyError, match=f"axis of marker {side} of pair '{pair}' reversed") as caught:
        mg.solve(four_bar((pair, side), size), {"A": 0.5})
    assert caught.value.residual > 1


def test_where_link_frames_stand_anyhow_the_marker_named_closes_the_loops():
    rng = np.random.default_rng(3)
    frames = {link: anywhere(rng) for link in ("crank", "coupler", "rocker")}
    assert mg.kinematics(four_bar(frames=frames), {"A": 0.5}).status == "ok"
    m = four_bar(("C", "on_b"), frames=frames)
    with pytest.raises(mg.AssemblyError, match="reversed") as caught:
        mg.kinematics(m, {"A": 0.5})
    words = str(caught.value).partition("axis of marker ")[2].split()
    side, name = words[0], words[3].strip("'")
    pair = m.pair(name)
    old = getattr(pair, side)
    mended = pair.replace(**{side: mg.Marker(old.point, -np.array(old.axis), old.second)})
    assert mg.kinematics(m.replace(pairs=[mended if p.name == name else p for p in m.pairs]), {"A": 0.5}).status == "ok"


def test_loops_that_no_reversal_closes_say_nothing_of_it():
    m = four_bar()
    skew = m.pair("C").replace(on_b=mg.Marker((2.5, 0, 0), (0, 1, 0.2)))
    with pytest.raises(mg.AssemblyError, match="Check the dimensions"):
        mg.kinematics(m.replace(pairs=[skew if p.name == "C" else p for p in m.pairs]), {"A": 0.5})
