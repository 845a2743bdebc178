"""Pictures: what is drawn, for every mechanism of the library, and what is said without matplotlib."""

import builtins
import gc
import os
import random
import signal
import sys
import warnings
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

import mechgraph as mg
from mechgraph.show import draw_skeleton, effort_curve

matplotlib.use("agg")


@pytest.fixture(autouse=True)
def _close_figures() -> Any:
    yield
    plt.close("all")


def four_bar(z: float = 0.0) -> mg.Mechanism:
    def at(x: float, y: float) -> tuple[float, float, float]:
        return (x, y, z)

    axis = (0, 0, 1)
    return mg.Mechanism("four-bar", [mg.Link("frame"), mg.Link("crank", 1.0, at(0.5, 0)), mg.Link("coupler"), mg.Link("rocker")], [
        mg.Pair("A", "R", "frame", "crank", point=at(0, 0), axis=axis),
        mg.Pair("B", "R", "crank", "coupler", point=at(1, 0), axis=axis),
        mg.Pair("C", "R", "coupler", "rocker", point=at(3, 2), axis=axis),
        mg.Pair("D", "R", "frame", "rocker", point=at(3, 0), axis=axis),
    ], ["A"], [mg.Effort("D", 1.0)])  # fmt: skip


THETA = np.linspace(0, 2 * np.pi, 37)


def test_skeleton_names_pairs_and_links_and_keeps_scales_equal() -> None:
    s = mg.solve(four_bar(), {"A": THETA})
    ax = draw_skeleton(s, 3)
    texts = {text.get_text() for text in ax.texts}
    assert {"A (R)", "D (R)", "crank", "coupler", "rocker", "x", "y"} <= texts
    assert "z" not in texts
    spans = np.array([np.ptp(limits) for limits in (ax.get_xlim(), ax.get_ylim(), ax.get_zlim())])
    assert np.ptp(ax._box_aspect / spans) < 1e-9 * (ax._box_aspect / spans).max()
    assert ax.elev == pytest.approx(90.0)
    ax.figure.canvas.draw()


def test_full_links_end_at_the_pair_points() -> None:
    s = mg.solve(four_bar(2.0), {"A": THETA})
    ax = draw_skeleton(s, 9, ghosts=0, traces=False, labels=False)
    assert not [t for t in ax.texts if t.get_text() not in "xyz"]
    drawn = [np.array(line.get_data_3d()).T for line in ax.lines if line.get_linewidth() > 3]
    tip = s.link("crank").point((1, 0, 2)).position[9]
    assert len(drawn) == 3
    assert np.allclose(drawn[0], [[0, 0, 2], tip])


def test_more_ghosts_and_traces_draw_more() -> None:
    s = mg.solve(four_bar(), {"A": THETA})
    few = draw_skeleton(s, ghosts=0, traces=False)
    many = draw_skeleton(s, ghosts=4, traces=["B"])
    assert len(many.lines) == len(few.lines) + 3 * 4 + 1


@pytest.mark.slow
@pytest.mark.parametrize("name", mg.library())
def test_skeleton_of_the_library(name: str) -> None:
    m = mg.load(name)
    try:
        s = mg.kinematics(m)
    except mg.MechgraphError:
        pytest.skip("has no motion")
    ax = draw_skeleton(s)
    assert {f"{p.name} ({p.type.symbol})" for p in m.pairs} <= {text.get_text() for text in ax.texts}
    ax.figure.canvas.draw()


def test_single_position_and_effort_curve() -> None:
    s = mg.solve(four_bar(), {"A": 0.5})
    draw_skeleton(s)
    ax = effort_curve(s)
    assert ax.get_xlabel() == "A.Rz [deg]"
    s = mg.solve(four_bar(), {"A": THETA})
    line = effort_curve(s, "A", marked=2).lines[0]
    assert np.allclose(line.get_xdata(), np.rad2deg(THETA))
    assert np.allclose(line.get_ydata(), s["A"].effort[:, 0])


def test_an_effort_curve_shows_motor_and_loads_apart() -> None:
    """A spring in the driver's freedom: two curves, the motor's of which falls by what the spring brings."""
    ax = effort_curve(s := mg.solve(four_bar(), {"A": THETA}, loads=[mg.TorsionSpring("A", 2.0)]))
    motor, spring = ax.lines[:2]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["driver", "applied"]
    assert np.allclose(spring.get_ydata(), -2.0 * THETA)
    assert np.allclose(motor.get_ydata(), 2.0 * THETA)
    assert np.allclose(s["A"].applied_effort[:, 0], -2.0 * THETA)


def test_faults_are_named() -> None:
    s = mg.solve(four_bar(), {"A": THETA})
    with pytest.raises(mg.DeclarationError, match="position 99"):
        draw_skeleton(s, 99)
    with pytest.raises(mg.DeclarationError, match="is no driver"):
        effort_curve(s, "D")
    with pytest.raises(mg.DeclarationError, match="solve"):
        effort_curve(mg.kinematics(four_bar(), {"A": THETA}))


def test_without_matplotlib(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def missing(name: str, *rest: Any) -> Any:
        if name.partition(".")[0] in ("matplotlib", "mpl_toolkits"):
            raise ImportError(name)
        return real(name, *rest)

    s = mg.solve(four_bar(), {"A": THETA})
    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(mg.MissingExtraError, match=r"mechgraph\[plot\]"):
        draw_skeleton(s)


def test_highlighted_loop_of_a_mechanism_that_was_not_solved() -> None:
    """Links outside the loop are grey; the picture needs no drivers."""
    m = mg.load("rcsr-csr")
    ax = draw_skeleton(m, highlight=mg.check(m).loops[1])
    colours = {text.get_text(): text.get_color() for text in ax.texts}
    grey = {name for name in m.link_names() if colours.get(name) == colours["link3"]}
    assert {p for p, _ in mg.check(m).loops[1]} == {"O1", "O2", "O5", "O6", "O7"}
    assert grey == {"link3"}
    s = mg.solve(four_bar(), {"A": 0.0})
    drawn, same = (draw_skeleton(x, ghosts=0, traces=False) for x in (s, four_bar()))
    for one, other in zip(drawn.lines, same.lines, strict=True):
        assert np.allclose(one.get_data_3d(), other.get_data_3d())
    with pytest.raises(mg.DeclarationError, match="there is no pair 'X'"):
        draw_skeleton(m, highlight=["X"])


def test_nothing_outside_is_changed() -> None:
    """No figure is left with pyplot; settings, warnings, random numbers, surroundings and numpy's errors stay as they were."""

    def outside() -> list[Any]:
        return [
            plt.get_fignums(), dict(matplotlib.rcParams), list(warnings.filters), dict(os.environ), np.geterr(),
            np.random.get_state()[1].tolist(), random.getstate(), gc.isenabled(), signal.getsignal(signal.SIGINT), os.getcwd(),  # noqa: NPY002
            sys.excepthook, np.get_printoptions(),
        ]  # fmt: skip

    before = outside()
    m = mg.load("rssr")
    s = mg.solve(m, {"A": THETA})
    draw_skeleton(s).figure.canvas.draw()
    draw_skeleton(m)
    effort_curve(s, "A")
    mg.check(m)
    mg.formulate(m).latex()
    mg.study(m, {"coupler.mass": [0.08, 0.09]}, ["A.effort"], n=2)
    assert outside() == before
