"""Pictures of results, graphs and studies: what they show against what they are made from; units on every axis, gaps, hatches."""

import os
import subprocess
import sys
from itertools import combinations
from typing import Any

import matplotlib
import numpy as np
import pytest
import scipy.stats
from test_show import check_texts, four_bar, texts_of

import mechgraph as mg
from mechgraph import show

Z = (0.0, 0.0, 1.0)
UNITS = {"length": "m", "mass": "kg", "time": "s"}
THETA = np.linspace(0, 2 * np.pi, 25)


@pytest.fixture(scope="module")
def bars() -> mg.Solution:
    """The four-bar with its units, of which in the plane all is unique and across it nothing."""
    return mg.solve(mg.load("four-bar"))


@pytest.fixture(scope="module")
def two_drivers() -> mg.Solution:
    """A slide with an arm on it: a force and a torque, by hand ``m a`` and ``I alpha``."""
    links = [
        mg.Link("frame"),
        mg.Link("slide", 2.0, (0, 0, 0)),
        mg.Link("arm", 1.0, (0, 0, 0), np.eye(3), points={"tip": (1, 0, 0)}),
    ]
    m = mg.Mechanism("gantry", links, [
        mg.Pair("X", "P", "frame", "slide", point=(0, 0, 0), axis=(1, 0, 0)), mg.Pair("A", "R", "slide", "arm", point=(0, 0, 0), axis=Z),
    ], ["X", "A"], units=UNITS)  # fmt: skip
    t = np.linspace(0, 1, 11)
    return mg.solve(m, {"X": mg.Motion(t**2, 2 * t, 2.0), "A": mg.Motion(0.5 * t**2, t, 1.0)})


def labels(ax: Any) -> list[str]:
    return [text.get_text() for text in ax.get_legend().get_texts()] if ax.get_legend() else []


def curve(ax: Any, label: str) -> np.ndarray:
    (line,) = [line for line in ax.lines if line.get_label() == label]
    return np.array(line.get_data())


def test_efforts_of_several_drivers_over_time_or_a_freedom(two_drivers: mg.Solution) -> None:
    """Torques on the left, forces on the right: 3 kg at 2 m/s^2, 1 kg m^2 at 1 rad/s^2."""
    ax = show.effort_curve(two_drivers, over="A")
    right = next(other for other in ax.figure.axes if other is not ax)
    assert ax.get_xlabel() == "A.Rz [deg]"
    assert "[N m]" in ax.get_ylabel()
    assert "[N]" in right.get_ylabel()
    assert np.allclose(curve(ax, "A.Rz")[1], 1.0)
    assert np.allclose(curve(right, "X.Tz")[1], 6.0)
    assert labels(ax) == ["A.Rz", "X.Tz"] or labels(ax) == ["X.Tz", "A.Rz"]
    assert show.effort_curve(two_drivers).get_xlabel() == "X.Tz [m]"
    assert show.effort_curve(two_drivers, "X", over="position").get_xlabel() == "position"
    with pytest.raises(mg.DeclarationError, match="has no times"):
        show.effort_curve(two_drivers, over="t")
    check_texts(ax)


def test_a_response_is_drawn_over_time() -> None:
    m = four_bar().replace(drives=[], units=UNITS)
    r = mg.respond(m, np.linspace(0, 0.3, 7), start={"A": 0.3}, rates={"A": 1.0})
    ax = show.reaction_curve(r, "B")
    assert ax.get_xlabel() == "t [s]"
    assert np.allclose(curve(ax, next(x for x in labels(ax) if x.startswith("Fx")))[0], r.t)
    for drawn in (
        show.draw_skeleton(r),
        show.point_path(r),
        show.hodograph(r, "crank"),
        show.reaction_ranges(r),
        show.margin_curve(r),
        show.polar_force(r, "B"),
    ):
        check_texts(drawn)


def test_reactions_have_their_range_and_what_is_not_unique_is_hatched(bars: mg.Solution) -> None:
    ax = show.reaction_curve(bars, "A")
    Fx = bars["A"].components["Fx"]
    assert f"Fx: {Fx.min():.4g} to {Fx.max():.4g} N" in labels(ax)
    assert "Fz: not unique" in labels(ax)
    (strip,) = [p for p in ax.patches if p.get_gid() == "not unique Fz"]
    assert strip.get_hatch()
    assert not [line for line in ax.lines if line.get_label().startswith("Fz")]
    assert ax.get_ylabel() == "force of frame on crank in A [N]"
    moments = show.reaction_curve(bars, "A", moment=True)
    assert not [line for line in moments.lines if not line.get_label().startswith("_")]
    assert len([p for p in moments.patches if p.get_hatch()]) == 2
    assert "[N m]" in moments.get_ylabel()
    check_texts(ax)
    check_texts(moments)


def test_values_of_least_norm_are_not_drawn_as_known() -> None:
    s = mg.solve(mg.load("four-bar"), redundant="minimum_norm")
    assert np.isfinite(s["A"].components["Fz"]).all()
    ax = show.reaction_curve(s, "A")
    assert "Fz: not unique" in labels(ax)
    assert [p for p in show.reaction_ranges(s).patches if p.get_hatch()]
    spherical = mg.solve(mg.load("spherical-four-bar"), redundant="minimum_norm")
    assert [c for c in show.draw_skeleton(spherical, forces=True).collections if c.get_gid() == "not unique"]


def test_ranges_of_all_pairs(bars: mg.Solution) -> None:
    """Bars reach from the least to the greatest size of what is unique, hatched beyond; a spatial mechanism has whole bars."""
    ax = show.reaction_ranges(bars)
    sizes = np.hypot(bars["A"].components["Fx"], bars["A"].components["Fy"])
    first = ax.patches[0]
    assert first.get_x() == pytest.approx(sizes.min())
    assert first.get_x() + first.get_width() == pytest.approx(sizes.max())
    assert ax.get_yticklabels()[0].get_text() == "A (Fx Fy unique)"
    assert len([p for p in ax.patches if p.get_hatch()]) == 4
    assert ax.get_xlabel() == "force of the reaction [N]"
    whole = show.reaction_ranges(mg.solve(mg.load("rssr")))
    assert not [p for p in whole.patches if p.get_hatch()]
    check_texts(ax)


def test_polar_force_turns_with_the_link_that_it_is_seen_on(bars: mg.Solution) -> None:
    on_frame, on_crank = (show.polar_force(bars, "A", on=on).lines[0].get_data() for on in ("a", "b"))
    force = bars["A"].force
    assert np.allclose(on_frame[1], np.hypot(force[:, 0], force[:, 1]))
    turned = np.exp(1j * (np.array(on_frame[0]) - bars["A"].position[:, 0]))
    assert np.allclose(turned, np.exp(1j * np.array(on_crank[0])))
    ax = show.polar_force(bars, "A")
    assert "[N]" in ax.get_title()
    check_texts(ax)
    with pytest.raises(mg.DeclarationError, match="not unique"):
        show.polar_force(mg.solve(mg.load("spherical-four-bar")), "A")
    with pytest.raises(mg.DeclarationError, match="polar axes"):
        show.polar_force(bars, "A", ax=matplotlib.figure.Figure().add_subplot())


def test_paths_and_hodographs(two_drivers: mg.Solution, bars: mg.Solution) -> None:
    ax = show.point_path(two_drivers)
    tip = two_drivers.link("arm").at("tip")
    assert np.allclose(curve(ax, "arm.tip").T, tip.position[:, :2])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x [m]", "y [m]")
    ax = show.hodograph(two_drivers, "arm.tip", of="acceleration")
    assert np.allclose(curve(ax, "arm.tip").T, tip.acceleration[:, :2])
    assert ax.get_xlabel() == "acceleration x [m/s^2]"
    space = show.point_path(mg.solve(mg.load("rssr")))
    assert (space.get_xlabel(), space.get_zlabel()) == ("x [m]", "z [m]")
    assert set(labels(show.point_path(bars))) == {"B", "C"}
    with pytest.raises(mg.DeclarationError, match="there is no point 'nose'"):
        show.point_path(bars, "nose")


def test_positions_that_were_not_solved_leave_gaps() -> None:
    bars = mg.Mechanism("double rocker", pairs=[
        mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=Z), mg.Pair("B", "R", "crank", "coupler", point=(2, 0, 0), axis=Z),
        mg.Pair("C", "R", "coupler", "rocker", point=(2.5, 1.9, 0), axis=Z), mg.Pair("D", "R", "frame", "rocker", point=(3, 0, 0), axis=Z),
    ], drives=["A"], loads=[mg.Effort("D", 1.0)])  # fmt: skip
    s = mg.solve(bars, {"A": [0.0, 0.1, 2.5, 0.2, 2.6, 0.1, 0.0]}, on_reach="flag")
    assert (s.status == "ok").tolist() == [True, True, False, True, False, True, True]
    for ax in (show.effort_curve(s, over="position"), show.margin_curve(s, over="position")):
        line = next(line for line in ax.lines if len(line.get_xdata()) == 7)
        assert np.isnan(line.get_ydata()).tolist() == [False, False, True, False, True, False, False]
        dots = [line for line in ax.lines if line.get_marker() == "o"]
        assert np.allclose([line.get_xdata() for line in dots], 3.0)


def test_margins_are_those_of_the_report() -> None:
    """At every position what ``check`` says there; with the driver at rest it falls to nothing at its dead point."""
    m = mg.load("slider-crank")
    s = mg.kinematics(m, {"A": [0.0, 0.4, 1.3]})
    ax = show.margin_curve(s)
    drawn = {line.get_label(): line.get_ydata() for line in ax.lines}
    assert np.allclose(drawn["drivers free"], [mg.check(m, at={"A": a}).margin for a in (0.0, 0.4, 1.3)], rtol=1e-6)
    slide = m.replace(drives=["D"])
    stroke = s["D"].position[:, 0]
    near = show.margin_curve(mg.kinematics(slide, {"D": np.linspace(stroke[1], stroke[2], 5)}))
    (rest,) = (line.get_ydata() for line in near.lines if line.get_label() == "drivers at rest")
    assert (rest > drawn["nearly singular below"][0]).all()
    assert ax.get_yscale() == "log"
    assert "nearly singular below" in labels(ax)


@pytest.mark.daily(2)
@pytest.mark.parametrize("name", mg.library())
def test_graphs_and_structures_of_the_library(name: str) -> None:
    m = mg.load(name)
    ax = show.draw_graph(m)
    texts = {text.partition(": ")[2] for text in texts_of(ax)}
    assert {f"{p.name} ({p.type.symbol})" for p in m.pairs} | set(m.link_names()) <= texts
    strands = [line.get_gid() for line in ax.lines if str(line.get_gid()).startswith("pair ")]
    loops = mg.check(m).loops
    for pair in m.pairs:
        assert strands.count(f"pair {pair.name}") == max(sum(pair.name in [n for n, _ in loop] for loop in loops), 1)
    check_texts(ax)
    ax = show.draw_structure(m)
    assert {f"{p.name} ({p.type.symbol})" for p in m.pairs} <= {text.partition(": ")[2] for text in texts_of(ax)}
    check_texts(ax)


def test_couplings_tie_pairs() -> None:
    gears = mg.Mechanism("gears", pairs=[
        mg.Pair("A", "R", "frame", "pinion", point=(0, 0, 0), axis=Z), mg.Pair("B", "R", "frame", "wheel", point=(0.06, 0, 0), axis=Z),
    ], couplings=[mg.Coupling({"A": 20, "B": 40}, name="teeth")], drives=["A"])  # fmt: skip
    for ax in (show.draw_graph(gears), show.draw_structure(gears)):
        assert [line for line in ax.lines if line.get_gid() == "coupling teeth"]
        assert "teeth" in {text.partition(": ")[2] for text in texts_of(ax)}
        check_texts(ax)


@pytest.mark.daily(1)
@pytest.mark.parametrize("name", ["$x$", "_hidden", "$\\frac{", "a\nb", "50 %", "<b>&amp;"])
def test_names_are_shown_as_they_are(name: str) -> None:
    """No formula is made of them, no legend leaves them out, nothing fails."""
    m = mg.Mechanism(name, [mg.Link("frame"), mg.Link(name, 1.0, (0.5, 0, 0), points={name: (1, 0, 0)})],
        [mg.Pair(name, "R", "frame", name, point=(0, 0, 0), axis=Z)], [name], [mg.Gravity((0, -9.81, 0))], units=UNITS)  # fmt: skip
    s = mg.solve(m, {name: [0.0, 0.5, 1.0]})
    drawn = [
        show.draw_graph(m),
        show.draw_structure(m),
        show.draw_sparsity(mg.formulate(m)),
        show.draw_skeleton(s, forces=True),
    ]
    drawn += [show.reaction_curve(s, name), show.polar_force(s, name), show.reaction_ranges(s)]
    drawn += [draw(s) for draw in (show.effort_curve, show.point_path, show.hodograph, show.margin_curve)]
    for ax in drawn:
        ax.figure.draw_without_rendering()
    assert len(labels(show.point_path(s))) == 1
    assert name.replace("\n", r"\n").replace("$", r"\$") in labels(show.point_path(s))[0]


def test_the_frame_of_a_structure_is_hatched_and_parallel_pairs_bulge_apart() -> None:
    m = mg.load("rcsr-csr")
    (frame,) = [p for p in show.draw_structure(m).patches if p.get_gid() == "link frame"]
    assert frame.get_hatch()
    twin = mg.Mechanism("twin", pairs=[mg.Pair(n, "S", "frame", "body") for n in "AB"])
    lines = [line for line in show.draw_graph(twin).lines if str(line.get_gid()).startswith("pair ")]
    assert np.abs(np.array(lines[0].get_data()) - np.array(lines[1].get_data())).max() > 0.1


@pytest.mark.parametrize("count", [2, 4])
@pytest.mark.parametrize("others", [False, True])
def test_names_of_parallel_pairs_lie_on_their_own_lines(count: int, others: bool) -> None:
    """The middle of a name is on its line, no other line runs through its box, and no two boxes overlap."""
    pairs = [mg.Pair(f"Hinge{n}", "S", "frame", "body") for n in range(count)]
    if others:
        pairs += [
            mg.Pair("B", "S", "body", "wing"),
            mg.Pair("second", "S", "body", "wing"),
            mg.Pair("D", "U", "wing", "frame"),
        ]
    ax = show.draw_graph(mg.Mechanism("parallel", pairs=pairs))
    ax.figure.draw_without_rendering()
    boxes = {
        text.get_text().partition(" (")[0]: text.get_window_extent()
        for text in ax.texts
        if text.get_text().endswith(")")
    }
    through: dict[str, set[str]] = {name: set() for name in boxes}
    for line in ax.lines:
        points = ax.transData.transform(np.array(line.get_data()).T)
        for name, box in boxes.items():
            if np.any((points > box.min).all(axis=1) & (points < box.max).all(axis=1)):
                through[name].add(str(line.get_gid()))
    assert through == {name: {f"pair {name}"} for name in boxes}
    assert len(boxes) == len(pairs)
    assert not any(a.overlaps(b) for a, b in combinations(boxes.values(), 2))


@pytest.mark.slow
def test_graphs_are_laid_out_the_same_each_time() -> None:
    """Whatever order sets of texts have in a process."""
    code = (
        "import mechgraph as mg; from mechgraph.show import draw_graph, draw_structure; m = mg.load('andrews'); "
        "print([[[round(float(v), 9) for v in line.get_xdata()] for line in draw(m).lines] for draw in (draw_graph, draw_structure)])"
    )
    runs = []
    for seed in ("1", "2"):
        surroundings = os.environ | {"PYTHONHASHSEED": seed}
        done = subprocess.run(
            [sys.executable, "-c", code], env=surroundings, capture_output=True, text=True, check=True
        )
        runs.append(done.stdout)
    assert runs[0] == runs[1]
    assert len(runs[0]) > 1000


@pytest.mark.parametrize("name", ["rcsr", "7r"])
def test_pattern_of_the_equations(name: str) -> None:
    f = mg.formulate(mg.load(name))
    ax = show.draw_sparsity(f)
    filled = np.argwhere(np.isfinite(np.asarray(ax.images[0].get_array().filled(np.nan))))
    assert {tuple(map(int, cell)) for cell in filled} == {(int(i), int(j)) for i, j in zip(*f.pattern[:2], strict=True)}
    assert [t.get_text() for t in ax.get_yticklabels()] == [e.name for e in f.equations]
    assert [t.get_text() for t in ax.get_xticklabels()] == [u.name for u in f.unknowns]
    assert ax.get_xlabel() == f"{len(f.unknowns)} unknowns"


@pytest.fixture(scope="module")
def variants() -> mg.Study:
    m = mg.load("four-bar")
    parameters = {
        "B.point.x": scipy.stats.norm(m.pair("B").point[0], 2e-4),
        "coupler.mass": scipy.stats.uniform(0.9 * m.link("coupler").mass, 0.2 * m.link("coupler").mass),
    }
    outputs = {"torque": "A.effort", "B.force": "B.force", "swing": lambda s: np.ptp(s["D"].position[..., 0], axis=1)}
    return mg.study(m, parameters, outputs, n=60, motions={"A": THETA})


def test_pictures_of_a_study(variants: mg.Study) -> None:
    ax = show.study_histogram(variants, "torque")
    assert ax.get_xlabel() == "greatest |torque| [N m]"
    assert sum(p.get_height() for p in ax.patches) == 60
    ax = show.study_histogram(variants, "torque", position=3)
    assert f"mean: {variants.outputs['torque'][:, 3].mean():.4g}" in labels(ax)
    assert show.study_histogram(variants, "swing").get_xlabel() == "swing"
    ax = show.study_bands(variants, "torque")
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("A.Rz [deg]", "torque [N m]")
    assert np.allclose(curve(ax, "median")[1], np.median(variants.outputs["torque"], axis=0))
    assert len(ax.collections) == 3
    ax = show.study_tornado(variants, "torque")
    at = int(np.argmax(np.abs(variants.nominal["torque"])))
    assert ax.get_xlabel() == f"torque at position {at} [N m]"
    moves = {name: move[:, at] for name, move in variants.moves("torque").items()}
    assert sorted(moves, key=lambda n: -np.abs(moves[n]).max()) == [t.get_text() for t in ax.get_yticklabels()]
    low, high = variants.worst_case("torque")
    assert variants.nominal["torque"][at] + sum(m.min() for m in moves.values()) == pytest.approx(low[at])
    with pytest.raises(mg.DeclarationError, match="has 3 entries"):
        show.study_histogram(variants, "B.force")
    assert show.study_histogram(variants, "B.force", part=1, position=0).get_xlabel() == "B.force[1] at position 0 [N]"
    for one in (
        show.study_histogram(variants, "torque"),
        show.study_bands(variants, "torque"),
        show.study_tornado(variants, "torque"),
    ):
        check_texts(one)


def test_least_base_radii_are_drawn_over_the_pressure_angle() -> None:
    """The curve holds the numbers of ``mg.least_base_radius``; smaller angles ask for larger discs."""
    law = mg.CamLaw([mg.Segment("cycloidal", rise, np.pi) for rise in (0.02, -0.02)])
    line = show.least_base_radius(law, angles=np.deg2rad([20, 30]), roller_radius=0.008).get_lines()[0]
    assert line.get_xdata() == pytest.approx([20, 30])
    wanted = [mg.least_base_radius(law, max_pressure=np.deg2rad(a), roller_radius=0.008) for a in (20, 30)]
    assert line.get_ydata() == pytest.approx(wanted)
    assert wanted[0] > wanted[1]
    with pytest.raises(mg.DeclarationError, match="angles"):
        show.least_base_radius(law, angles=["wide"])
