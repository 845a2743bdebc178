"""URDF read with the XML library of Python: poses, inertias, couplings, loops, and what it refuses."""

import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mechgraph as mg

ARM = """<?xml version="1.0" encoding="utf-8"?>
<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0.1 0.2 0.3" rpy="0.1 0.2 0.3"/><mass value="2"/>
    <inertia ixx="1" iyy="1.2" izz="1.4" ixy="0.1" ixz="-0.05" iyz="0.02"/></inertial><visual><geometry/></visual></link>
  <link name="lower"/><link name="tool"/>
  <joint name="j1" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 1" rpy="0.3 -0.2 0.5"/><axis xyz="0 0 2"/>
    <limit lower="-1" upper="1" effort="3" velocity="1"/></joint>
  <joint name="j2" type="prismatic"><parent link="upper"/><child link="lower"/><origin xyz="1 0 0"/></joint>
  <joint name="j3" type="continuous"><parent link="lower"/><child link="tool"/><axis xyz="0 1 1"/>
    <mimic joint="j1" multiplier="-2" offset="0.1"/></joint>
</robot>"""  # fmt: skip


def read(tmp_path, text):
    file = tmp_path / "x.urdf"
    file.write_text(text, encoding="utf-8")
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        return mg.load(file), [str(n.message) for n in notes]


def test_poses_by_hand(tmp_path):
    m, notes = read(tmp_path, ARM)
    assert [n for n in notes if "joint 'j1': limit not applied" in n]
    assert (m.name, m.frame) == ("arm", "base")
    assert [(p.name, p.type.symbol, p.a, p.b) for p in m.pairs] == [
        ("j1", "R", "base", "upper"), ("j2", "P", "upper", "lower"), ("j3", "R", "lower", "tool"),
    ]  # fmt: skip
    s = mg.kinematics(m, {"j1": 0.4, "j2": 0.25})
    upper = Rotation.from_euler("xyz", [0.3, -0.2, 0.5]) * Rotation.from_rotvec([0, 0, 0.4])
    assert s.link("upper").pose[:3, :3] == pytest.approx(upper.as_matrix())
    assert s.link("upper").pose[:3, 3] == pytest.approx([0, 0, 1])
    assert s.link("lower").pose[:3, 3] == pytest.approx(
        upper.apply([1.25, 0, 0]) + np.array([0, 0, 1])
    )  # the axis left out is x
    turn = Rotation.from_rotvec(np.array([0, 1, 1]) / np.sqrt(2) * (-2 * 0.4 + 0.1))
    assert s.link("tool").pose[:3, :3] == pytest.approx((upper * turn).as_matrix())


def test_inertia_turns_with_its_origin(tmp_path):
    v = read(tmp_path, ARM)[0].link("upper")
    I = np.array([[1, 0.1, -0.05], [0.1, 1.2, 0.02], [-0.05, 0.02, 1.4]])
    R = Rotation.from_euler("xyz", [0.1, 0.2, 0.3]).as_matrix()
    assert (v.mass, v.center) == (2.0, pytest.approx((0.1, 0.2, 0.3)))
    assert np.array(v.inertia) == pytest.approx(R @ I @ R.T)


def test_a_link_with_two_parents_closes_a_loop(tmp_path):
    bars = "".join(f'<link name="{n}"/>' for n in ("frame", "crank", "coupler", "rocker", "pin"))

    def joint(name, kind, a, b, x, y):
        ends = f'<parent link="{a}"/><child link="{b}"/>'
        return f'<joint name="{name}" type="{kind}">{ends}<origin xyz="{x} {y} 0"/><axis xyz="0 0 1"/></joint>'

    joints = (
        joint("A", "continuous", "frame", "crank", 0, 0) + joint("B", "continuous", "crank", "coupler", 0, 1)
        + joint("D", "continuous", "frame", "rocker", 2, 0) + joint("C", "continuous", "rocker", "pin", 0, 1)
        + joint("E", "fixed", "coupler", "pin", 2, 0)
    )  # fmt: skip
    m, _ = read(tmp_path, f'<robot name="r">{bars}{joints}</robot>')
    assert mg.check(m).mobility == 1
    assert mg.kinematics(m, {"A": 0.3})["D"].position == pytest.approx([0.3], abs=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('type="prismatic"', 'type="floating"', "type 'floating' holds nothing"),
        ('type="prismatic"', 'type="ball"', "type 'ball' is not known (known: revolute"),
        ('<parent link="upper"/>', "", "needs <parent link=...>"),
        ('<axis xyz="0 1 1"/>', '<axis xyz="0 0 0"/>', "axis has length 0"),
        ('<axis xyz="0 1 1"/>', '<axis xyz="0 1 x"/>', "xyz = '0 1 x': expected 3 finite numbers"),
        ('mimic joint="j1"', 'mimic joint="j9"', "mimics 'j9'"),
        ('<link name="base"/>', '<link name="base"/><link name="spare"/>', "2 links are no child of a joint (base, spare)"),
        ('value="2"', 'value="two"', "value = 'two'"),
    ],
)  # fmt: skip
def test_faults_are_named_with_their_lines(tmp_path, old, new, words):
    assert old in ARM
    with pytest.raises(mg.ContentError) as caught:
        read(tmp_path, ARM.replace(old, new))
    assert words in str(caught.value)


@pytest.mark.parametrize(("kind", "symbol", "mobility"), [("fixed", "W", 0), ("planar", "E", 3), ("revolute", "R", 1)])
def test_types_of_joints(tmp_path, kind, symbol, mobility):
    joint = f'<joint name="j" type="{kind}"><parent link="a"/><child link="b"/></joint>'
    text = f'<robot name="r"><link name="a"/><link name="b"/>{joint}</robot>'
    m, _ = read(tmp_path, text)
    assert m.pairs[0].type.symbol == symbol
    assert mg.check(m).mobility == mobility
    assert m.pairs[0].on_a.axis == pytest.approx((1, 0, 0))


def test_urdf_is_read_not_written(tmp_path):
    m, _ = read(tmp_path, ARM)
    with pytest.raises(mg.FileError, match="urdf"):
        mg.save(m, tmp_path / "m.urdf")
