"""Pictures: what is drawn, for every mechanism of the library, and what is said without matplotlib."""

import builtins
import gc
import itertools
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
from mechgraph import show

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


def texts_of(ax: Any) -> dict[str, Any]:
    """Visible texts of axes with their boxes on the screen, once everything is drawn."""
    ax.figure.draw_without_rendering()
    ticks, there = set(), set()
    for axis in (axis for a in ax.figure.axes for axis in a._axis_map.values()):
        ticks |= {id(text) for text in axis.findobj(matplotlib.text.Text)}
        low, high = sorted(axis.get_view_interval())
        inside = [t for t in axis.get_major_ticks() if low - 1e-9 <= t.get_loc() <= high + 1e-9]
        there |= (
            {id(text) for t in inside for text in (t.label1, t.label2)} | {id(axis.label)}
            if axis.axes.axison and axis.get_visible()
            else set()
        )
    every = {id(text): text for text in ax.figure.findobj(matplotlib.text.Text) if id(text) not in ticks - there}
    found = [text for text in every.values() if text.get_visible() and text.get_text().strip()]
    return {f"{i}: {text.get_text()}": text.get_window_extent() for i, text in enumerate(found)}


def check_texts(ax: Any) -> None:
    """No text lies on another or leaves the figure."""
    boxes = texts_of(ax)
    page = ax.figure.bbox
    for name, box in boxes.items():
        assert box.x0 >= page.x0 - 1, name
        assert box.y0 >= page.y0 - 1, name
        assert box.x1 <= page.x1 + 1, name
        assert box.y1 <= page.y1 + 1, name
    for (a, one), (b, other) in itertools.combinations(boxes.items(), 2):
        width = min(one.x1, other.x1) - max(one.x0, other.x0)
        height = min(one.y1, other.y1) - max(one.y0, other.y0)
        assert min(width, height) <= 1.0, f"{a} on {b}"


def shown(ax: Any) -> set[str]:
    return {name.partition(": ")[2] for name in texts_of(ax)}


def drawn(ax: Any, gid: str) -> list[Any]:
    return [c for c in ax.collections if c.get_gid() == gid]


def test_skeleton_names_pairs_and_links_and_keeps_scales_equal() -> None:
    """A plane mechanism on axes of two dimensions, in its plane wherever that is."""
    for z, size in ((0.0, (6, 4)), (3.0, (3, 6))):
        s = mg.solve(four_bar(z), {"A": THETA})
        ax = show.draw_skeleton(s, 3)
        ax.figure.set_size_inches(size)
        texts = shown(ax)
        assert {"A (R)", "D (R)", "crank", "coupler", "rocker", "x", "y"} <= texts
        assert "z" not in texts
        assert ax.name == "rectilinear"
        scale = np.ptp(ax.transData.transform([(0, 0), (1, 1)]), axis=0)
        assert scale[0] == pytest.approx(scale[1])
        check_texts(ax)


def test_links_and_traces_are_where_the_motion_takes_them() -> None:
    """Rods end at the pair points, on the axes as in space; more ghosts and traces draw more."""
    s = mg.solve(four_bar(2.0), {"A": THETA})
    tip = s.link("crank").point((1, 0, 2)).position
    ax = show.draw_skeleton(s, 9, ghosts=4, traces=["B"], labels=False)
    assert shown(ax) == {"x", "y", "0.5"}
    (path,) = drawn(ax, "trace of B")
    assert np.allclose(path.get_segments()[0], tip[:, :2])
    assert [len(c.get_segments()) for c in drawn(ax, "ghosts")] == [4, 4, 4]
    assert not drawn(show.draw_skeleton(s, ghosts=0, traces=False), "ghosts")
    whole = [path.vertices for c in ax.collections for path in c.get_paths()]
    assert min(np.abs(v - tip[9, :2]).sum(axis=1).min() for v in whole) < 0.2
    space = show.draw_skeleton(s, 9, ax=matplotlib.figure.Figure().add_subplot(projection="3d"))
    assert space.elev == pytest.approx(90.0)


@pytest.mark.daily(1)
@pytest.mark.parametrize("name", mg.library())
def test_skeleton_of_the_library(name: str) -> None:
    """Every pair and link is named, with no text on another or cut, whatever the size, with forces, and after a turn."""
    m = mg.load(name)
    try:
        s = mg.solve(m)
    except mg.MechgraphError:
        s = m
    ax = show.draw_skeleton(s, forces=True)
    assert {f"{p.name} ({p.type.symbol})" for p in m.pairs} <= shown(ax)
    check_texts(ax)
    ax.figure.set_size_inches(4.2, 3.4)
    if ax.name == "3d":
        ax.view_init(60, 20)
    check_texts(ax)


def test_beyond_a_dozen_pairs_numbers_stand_for_names() -> None:
    points = [(float(i), float(i % 2), 0.3 * (i % 3)) for i in range(14)]
    pairs = [
        mg.Pair(f"pair number {i}", "R", f"link {i}", f"link {i + 1}", point=p, axis=(0, 0, 1))
        for i, p in enumerate(points)
    ]
    ax = show.draw_skeleton(mg.Mechanism("long", pairs=pairs))
    texts = shown(ax)
    assert {"1", "14", "1  pair number 0 (R)", "14  pair number 13 (R)", "link 3"} <= texts
    assert "pair number 0 (R)" not in texts
    check_texts(ax)


@pytest.mark.slow
def test_a_legend_leaves_room_and_counts_what_it_leaves_out() -> None:
    pairs = [
        mg.Pair(f"p{i}", "R", f"k{i}", f"k{i + 1}", point=(float(i), float(i % 2), 0.3 * (i % 3)), axis=(0, 0, 1))
        for i in range(90)
    ]
    ax = show.draw_skeleton(mg.Mechanism("long", pairs=pairs))
    ax.figure.set_size_inches(5, 3)
    assert any(text.startswith("\u2026 and ") for text in shown(ax))
    check_texts(ax)
    ax.figure.set_size_inches(12, 24)
    assert not any(text.startswith("\u2026") for text in shown(ax))
    assert {"90  p89 (R)", "k90"} <= shown(ax)


def test_forces_that_are_not_unique_are_hatched_and_have_no_arrow() -> None:
    s = mg.solve(mg.load("spherical-four-bar"))
    ax = show.draw_skeleton(s, forces=True)
    (mark,) = drawn(ax, "not unique")
    assert mark.get_hatch()
    assert len(mark.get_offsets()) == 4
    assert "hatched: not unique" in shown(ax)
    assert not drawn(ax, "reaction A")
    known = show.draw_skeleton(mg.solve(mg.load("four-bar")), forces=True)
    assert drawn(known, "reaction A")
    assert not drawn(known, "not unique")


def test_positions_that_were_not_solved_leave_gaps_in_the_paths() -> None:
    bars = mg.Mechanism("double rocker", pairs=[
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0, 0, 1)),
        mg.Pair("B", "R", "crank", "coupler", point=(2, 0, 0), axis=(0, 0, 1)),
        mg.Pair("C", "R", "coupler", "rocker", point=(2.5, 1.9, 0), axis=(0, 0, 1)),
        mg.Pair("D", "R", "frame", "rocker", point=(3, 0, 0), axis=(0, 0, 1)),
    ], drives=["A"])  # fmt: skip
    angles = np.concatenate([np.linspace(0, 0.3, 6), [2.5, 2.6], np.linspace(0.3, 0, 6)])
    s = mg.kinematics(bars, {"A": angles}, on_reach="flag")
    assert (s.status != "ok").sum() == 2
    (path,) = drawn(show.draw_skeleton(s, traces=["B"]), "trace of B")
    assert [len(piece) for piece in path.get_segments()] == [6, 6]


def test_single_position_and_effort_curve() -> None:
    s = mg.solve(four_bar(), {"A": 0.5})
    show.draw_skeleton(s)
    ax = show.effort_curve(s)
    assert ax.get_xlabel() == "A.Rz [deg]"
    s = mg.solve(four_bar(), {"A": THETA})
    line = show.effort_curve(s, "A", marked=2).lines[0]
    assert np.allclose(line.get_xdata(), np.rad2deg(THETA))
    assert np.allclose(line.get_ydata(), s["A"].effort[:, 0])


def test_an_effort_curve_shows_motor_and_loads_apart() -> None:
    """A spring in the driver's freedom: two curves, the motor's of which falls by what the spring brings."""
    ax = show.effort_curve(s := mg.solve(four_bar(), {"A": THETA}, loads=[mg.TorsionSpring("A", 2.0)]))
    motor, spring = ax.lines[:2]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["driver", "applied"]
    assert np.allclose(spring.get_ydata(), -2.0 * THETA)
    assert np.allclose(motor.get_ydata(), 2.0 * THETA)
    assert np.allclose(s["A"].applied_effort[:, 0], -2.0 * THETA)


def test_faults_are_named() -> None:
    s = mg.solve(four_bar(), {"A": THETA})
    with pytest.raises(mg.DeclarationError, match="position 99"):
        show.draw_skeleton(s, 99)
    with pytest.raises(mg.DeclarationError, match="is no driver"):
        show.effort_curve(s, "D")
    with pytest.raises(mg.DeclarationError, match="solve"):
        show.effort_curve(mg.kinematics(four_bar(), {"A": THETA}))


def test_without_matplotlib(monkeypatch: pytest.MonkeyPatch) -> None:
    real = builtins.__import__

    def missing(name: str, *rest: Any) -> Any:
        if name.partition(".")[0] in ("matplotlib", "mpl_toolkits"):
            raise ImportError(name)
        return real(name, *rest)

    s = mg.solve(four_bar(), {"A": THETA})
    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(mg.MissingExtraError, match=r"mechgraph\[plot\]"):
        show.draw_skeleton(s)


def test_cases_have_paths_of_their_own() -> None:
    s = mg.kinematics(four_bar(), {"A": np.stack([np.linspace(0, 1, 5), np.linspace(0, 2, 5)])})
    (path,) = drawn(show.draw_skeleton(s, 7, traces=["B"]), "trace of B")
    tip = s.link("crank").point((1, 0, 0)).position[..., :2]
    assert np.allclose(path.get_segments(), tip)


def test_highlighted_loop_of_a_mechanism_that_was_not_solved() -> None:
    """Links outside the loop are grey; the picture needs no drivers."""
    m = mg.load("rcsr-csr")
    ax = show.draw_skeleton(m, highlight=mg.check(m).loops[1])
    ax.figure.draw_without_rendering()
    colours = {text.get_text(): text.get_color() for text in ax.texts}
    grey = {name for name in m.link_names() if colours.get(name) == colours["link3"]}
    assert {p for p, _ in mg.check(m).loops[1]} == {"O1", "O2", "O5", "O6", "O7"}
    assert grey == {"link3"}
    s = mg.solve(four_bar(), {"A": 0.0})
    drawings = [show.draw_skeleton(x, ghosts=0, traces=False) for x in (s, four_bar().replace(loads=[]))]
    rods = [[path.vertices for c in ax.collections if c.get_zorder() == 4 for path in c.get_paths()] for ax in drawings]
    assert all(np.allclose(a, b) for a, b in zip(*rods, strict=True))
    with pytest.raises(mg.DeclarationError, match="there is no pair 'X'"):
        show.draw_skeleton(m, highlight=["X"])


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
    show.draw_skeleton(s).figure.draw_without_rendering()
    show.draw_skeleton(m)
    show.effort_curve(s, "A")
    mg.check(m)
    mg.formulate(m).latex()
    mg.study(m, {"coupler.mass": [0.08, 0.09]}, ["A.effort"], n=2)
    assert outside() == before


def test_forces_are_tangent_to_friction_circles() -> None:
    """Each line of force passes its journal at r sin(atan mu); both of a rod that bears nothing else are one: the inner tangent."""
    m = mg.load("slider-crank").to_planar()
    at = {link.name: link.replace(mass=0.0, center=None, inertia=None) for link in m.links}
    m = m.replace(links=[*at.values()], loads=[])
    pins = [p for p in m.pairs if p.type.symbol == "R"]
    slider = next(p for p in m.pairs if p.type.symbol == "P")
    moving = slider.b if slider.a == m.frame else slider.a
    mu, radius = 0.3, 0.02
    rough = [mg.Friction(p.name, mu=mu, radius=radius) for p in pins]
    push = mg.Wrench(moving, force=(-100.0, 30.0), point=(0, 0))
    s = mg.solve(m, {m.drives[0].freedom: mg.Motion([0.8], velocity=5.0)}, loads=[push, *rough])
    ax = show.draw_skeleton(s, forces=True, ghosts=0, traces=False)
    lines = []
    for p in pins:
        (circle,), (line,) = (
            drawn(ax, f"{what} {p.name} friction {of}") for what, of in (("reaction", "circle"), ("axis", "line"))
        )
        ring, ends = circle.get_segments()[0], line.get_segments()[0]
        center, rho = 0.5 * (ring.min(axis=0) + ring.max(axis=0)), 0.5 * np.ptp(ring[:, 0])
        assert rho == pytest.approx(radius * np.sin(np.arctan(mu)), rel=1e-3)
        way = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        normal = np.array([-way[1], way[0]])
        assert abs((ends[0] - center) @ normal) == pytest.approx(rho, rel=1e-3)
        lines.append((abs(way[0]), abs(way[1]), abs(normal @ ends[0])))
    assert np.allclose(lines[1], lines[2], atol=1e-9)


def test_losses_by_pair_as_bars() -> None:
    m = mg.load("four-bar")
    rough = [mg.Friction(name, mu=0.1, radius=0.01) for name in "AD"]
    s = mg.solve(m, {"A": mg.Motion([0.3, 0.9, 1.8], velocity=10.0)}, loads=[*m.loads, *rough])
    ax = show.friction_losses(s)
    assert [bar.get_width() for bar in ax.patches] == pytest.approx([s.losses[name].mean() for name in "AD"])
    assert [label.get_text() for label in ax.get_yticklabels()] == ["A", "D"]
    with pytest.raises(mg.DeclarationError, match="friction"):
        show.friction_losses(mg.solve(m, {"A": [0.1]}))
