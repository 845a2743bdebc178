"""Named points of links: in files, units and motions of the whole, in loads, results and pictures."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import mechgraph as mg
from mechgraph import show
from mechgraph.kinematics.assembly import scaled_system
from mechgraph.kinematics.prescribed import with_pairs_at
from mechgraph.kinematics.state import Configuration
from mechgraph.response.resting import with_contacts

Z = (0.0, 0.0, 1.0)


def arm(**changes: object) -> mg.Mechanism:
    """A crank in a bearing, with a hook at (3, 4, 0) in place of its end."""
    fields = {
        "links": [mg.Link("frame", points={"wall": (5, 0, 0)}), mg.Link("arm", 2.0, (1, 0, 0), points={"hook": (3, 4, 0)})],
        "pairs": [mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=Z)],
        "drives": ["A"],
        "units": {"length": "m", "mass": "kg", "time": "s"},
    }  # fmt: skip
    return mg.Mechanism("arm", **{**fields, **changes})  # type: ignore[arg-type]


def test_a_named_point_moves_with_its_link() -> None:
    q, w = np.array([0.0, 0.7, np.pi / 2]), 2.0
    s = mg.kinematics(arm(), {"A": mg.Motion(q, velocity=w)})
    found, same = s.link("arm").at("hook"), s.link("arm").point((3, 4, 0))
    np.testing.assert_array_equal(found, same)
    np.testing.assert_allclose(found.position[2], (-4, 3, 0), atol=1e-12)
    np.testing.assert_allclose(found.velocity[2], (-3 * w, -4 * w, 0), atol=1e-12)
    np.testing.assert_allclose(s.link("frame").at("wall").position, np.tile((5.0, 0, 0), (3, 1)), atol=1e-12)


def test_loads_act_at_named_points() -> None:
    q = np.linspace(0, 2, 5)
    named = [
        mg.Wrench("arm", force=(0, -7, 1), point="hook"),
        mg.Spring("frame", "arm", "wall", "hook", stiffness=3.0, free_length=0.5),
    ]
    placed = [
        mg.Wrench("arm", force=(0, -7, 1), point=(3, 4, 0)),
        mg.Spring("frame", "arm", (5, 0, 0), (3, 4, 0), stiffness=3.0, free_length=0.5),
    ]
    one, two = (mg.solve(arm(loads=loads), {"A": q}) for loads in (named, placed))
    np.testing.assert_array_equal(one["A"].effort, two["A"].effort)
    # at q = 0: the weight of the force has the arm 3, the spring pulls along (2, -4) with 3 (sqrt(20) - 0.5)
    pull = 3 * (np.sqrt(20) - 0.5) * np.array([2, -4]) / np.sqrt(20)
    assert one["A"].effort[0, 0] == pytest.approx(7 * 3 - (3 * pull[1] - 4 * pull[0]), rel=1e-12)


def test_named_points_in_files_copies_units_and_motions_of_the_whole(tmp_path: Path) -> None:
    m = arm(loads=[mg.Wrench("arm", force=(0, -7, 1), point="hook")])
    mg.save(m, tmp_path / "arm.toml")
    assert mg.load(tmp_path / "arm.toml") == m
    assert "hook" in (tmp_path / "arm.toml").read_text()
    assert pickle.loads(pickle.dumps(m)) == m
    assert hash(m.link("arm")) == hash(pickle.loads(pickle.dumps(m.link("arm"))))
    assert m.to_units(length="mm").link("arm").points["hook"] == (3000.0, 4000.0, 0.0)
    turned = m.moved(np.array([[0, -1, 0, 10], [1, 0, 0, 20], [0, 0, 1, 30.0]]))
    assert turned.link("arm").points["hook"] == (6.0, 23.0, 30.0)
    assert turned != m
    assert arm(links=[mg.Link("frame"), mg.Link("arm", 2.0, (1, 0, 0))]) != m
    s, t = (mg.solve(one, {"A": 0.4}) for one in (m, turned))
    np.testing.assert_allclose(t["A"].effort.shape, s["A"].effort.shape)


def test_points_with_units() -> None:
    pint = pytest.importorskip("pint")
    unit = pint.UnitRegistry()
    link = mg.Link("arm", 2.0, (1, 0, 0), points={"hook": [3000, 4000, 0] * unit.mm})
    assert arm(links=[mg.Link("frame"), link]).link("arm").points["hook"] == (3.0, 4.0, 0.0)


def test_faults_of_points_say_what_is_there() -> None:
    with pytest.raises(mg.DeclarationError) as error:
        arm(
            links=[mg.Link("frame"), mg.Link("arm", points={"hook": (3, 4), "": (0, 0, 0)})],
            loads=[mg.Wrench("arm", force=(1, 0, 0), point="tip"), mg.Spring("frame", "arm", "x", (0, 0, 0), 1.0)],
        )
    text = str(error.value)
    assert "link 'arm': points: hook = (3.0, 4.0): expected three finite numbers" in text
    assert "link 'arm' has no point 'tip' (its points: hook, )" in text
    assert "link 'frame' has no point 'x' (it has none; declare points={'tip': (x, y, z)})" in text
    with pytest.raises(mg.DeclarationError, match="expected a table name"):
        arm(links=[mg.Link("frame"), mg.Link("arm", points=[(0, 0, 0)])])
    with pytest.raises(mg.DeclarationError, match=r"link 'arm' has no point 'tip' \(its points: hook\)"):
        mg.solve(arm(), {"A": 0.0}).link("arm").at("tip")


def test_variants_that_differ_in_named_points_are_told_apart() -> None:
    def build(reach: float) -> mg.Mechanism:
        links = [mg.Link("frame"), mg.Link("arm", 2.0, (1, 0, 0), points={"hook": (reach, 0, 0)})]
        return arm(links=links, loads=[mg.Wrench("arm", force=(0, -1, 0), point="hook")])

    study = mg.study(build, {"reach": [2.0, 3.0, 5.0]}, ["A.effort"], n=3, motions={"A": [0.0]}, sampling="grid")
    np.testing.assert_allclose(study.outputs["A.effort"].ravel(), [2.0, 3.0, 5.0])


def test_named_points_are_drawn() -> None:
    pytest.importorskip("matplotlib")
    texts = [text.get_text() for text in show.draw_skeleton(arm()).texts]
    assert "arm.hook" in texts
    assert "frame.wall" in texts
    s = mg.kinematics(arm(), {"A": np.linspace(0, 2, 9)})
    for traces in (True, ["arm.hook"]):
        drawn = {line.get_gid(): line for line in show.draw_skeleton(s, traces=traces).collections}
        (path,) = drawn["trace of arm.hook"].get_segments()
        np.testing.assert_allclose(path, s.link("arm").at("hook").position[:, :2], atol=1e-12)
        assert "trace of frame.wall" not in drawn  # it stands still
    with pytest.raises(
        mg.DeclarationError, match=r"no pair or named point 'arm\.tip'; there are: frame\.wall, arm\.hook, A"
    ):
        show.draw_skeleton(s, traces=["arm.tip"])


def test_coordinates_of_named_points_are_parameters_and_motions_outputs() -> None:
    """The force at the hook has the moment 7 x at q = 0; where the hook is, and how fast, is told by its name."""
    m = arm(loads=[mg.Wrench("arm", force=(0, -7, 1), point="hook")])
    outputs = ["A.effort", "arm.hook", "arm.hook.velocity"]
    motions = {"A": mg.Motion(np.zeros(1), velocity=2.0)}
    study = mg.study(m, {"arm.hook.x": [2.0, 3.0, 5.0]}, outputs, n=3, motions=motions, sampling="grid")
    np.testing.assert_allclose(study.outputs["A.effort"].ravel(), [14.0, 21.0, 35.0])
    np.testing.assert_allclose(study.outputs["arm.hook"][:, 0], [(2, 4, 0), (3, 4, 0), (5, 4, 0)])
    np.testing.assert_allclose(study.outputs["arm.hook.velocity"][:, 0], [(-8, 4, 0), (-8, 6, 0), (-8, 10, 0)])
    parts = mg.study(
        m, {"arm.mass": [1.0]}, ["arm.hook.y", "arm.hook.velocity.x"], n=1, motions=motions, sampling="grid"
    )
    np.testing.assert_allclose(parts.outputs["arm.hook.y"], [[4.0]])
    np.testing.assert_allclose(parts.outputs["arm.hook.velocity.x"], study.outputs["arm.hook.velocity"][1:2, :, 0])
    with pytest.raises(mg.DeclarationError, match=r"'arm\.hok\.x'.*did you mean arm\.hook\.x"):
        mg.study(m, {"arm.hok.x": [2.0]}, outputs, n=1, motions=motions)


def two(tip: float = 2.0) -> mg.Mechanism:
    """Two bars of length 1 and, with its tip, ``tip - 1``."""
    return mg.Mechanism(
        "two", links=[mg.Link("g"), mg.Link("one"), mg.Link("two", points={"tip": (tip, 0, 0)})],
        pairs=[mg.Pair("A", "R", "g", "one", point=(0, 0, 0), axis=Z), mg.Pair("B", "R", "one", "two", point=(1, 0, 0), axis=Z)],
        start={"A": 0.5, "B": -1.0},
    )  # fmt: skip


@pytest.mark.parametrize("name", ["tip", "two.tip.x"])
def test_prescribed_motion_of_a_point_that_differs_between_variants(name: str) -> None:
    """The tip goes where it is asked to be, at a distance of 1.2: the angle between the bars by the cosine."""
    of, tips = two if name == "tip" else two(), [1.8, 2.0, 2.3]
    motions = {"two.tip": np.array([[1.2, 0.0, 0.0]])}
    study = mg.study(of, {name: tips}, ["B.position", "two.tip"], n=3, motions=motions, sampling="grid")
    r = np.array(tips) - 1
    np.testing.assert_allclose(np.cos(study.outputs["B.position"].ravel()), (1.44 - 1 - r**2) / (2 * r), atol=1e-9)
    np.testing.assert_allclose(study.outputs["two.tip"][:, 0], np.tile((1.2, 0, 0), (3, 1)), atol=1e-9)


def test_coordinates_of_named_points_are_parameters_of_a_compiled_mechanism(compiled: None) -> None:
    m = arm(loads=[mg.Wrench("arm", force=(0, -7, 1), point="hook")])
    c = mg.compile(m)
    assert c(0.0) == pytest.approx([21.0])
    assert c.gradient("A.effort", ["arm.hook.x"]) == pytest.approx(7.0)
    c.parameters["arm.hook.x"] = 5.0
    assert c(0.0) == pytest.approx([35.0])


def test_the_path_of_a_response_is_drawn_through_what_lies_between_its_outputs() -> None:
    """On the circle of its hook's radius everywhere, though six positions were asked for."""
    r = mg.respond(arm(drives=[], loads=[mg.Gravity((0, -9.81, 0))]), np.linspace(0, 2, 6), start={"A": 0.0})
    drawn = {line.get_gid(): line for line in show.draw_skeleton(r, traces=["arm.hook"]).collections}
    (path,) = drawn["trace of arm.hook"].get_segments()
    np.testing.assert_allclose(np.linalg.norm(path, axis=1), 5.0, atol=1e-9)
    assert len(path) > 400


@pytest.mark.parametrize("size", [1.0, 1000.0])
def test_the_coordinates_of_a_point_with_a_stop_begin_where_it_is(size):
    """A pendulum of 2 and a point on it, turned by 0.7, whatever the unit."""
    rod = mg.Link("rod", 1.0, (size, 0, 0), size**2 * np.eye(3), points={"tip": (2 * size, 0, 0)})
    pairs = [
        mg.Pair("A", "R", "frame", "rod", point=(0, 0, 0), axis=Z),
        mg.Pair("B", "R", "rod", "end", point=(size, size, 0), axis=Z),
    ]
    m = mg.Mechanism("rod", [mg.Link("frame"), rod, mg.Link("end")], pairs, start={"A": 0.7})
    made, _ = with_contacts(m, [mg.Stop("rod.tip.Tx", lower=-9 * size)], 1e-9)
    system = scaled_system(m, np.zeros(2))
    closed = Configuration(system, system.state_of(np.array([[0.7], [0.0]])))
    # as a stop sees it, and as a solution does, which has lengths over L
    for whole in (made, with_pairs_at(m, made.pairs[2:], (), closed)):
        found = [whole.start[f"rod.tip.T{x}"] for x in "xyz"]
        np.testing.assert_allclose(found, 2 * size * np.array([np.cos(0.7), np.sin(0.7), 0.0]), rtol=1e-12, atol=1e-9)
