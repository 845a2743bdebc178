"""Named points of links: in files, units and motions of the whole, in loads, results and pictures."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import mechgraph as mg
from mechgraph.show import draw_skeleton

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
    texts = [text.get_text() for text in draw_skeleton(arm()).texts]
    assert "arm.hook" in texts
    assert "frame.wall" in texts
