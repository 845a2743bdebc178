"""MJCF: written, read again, and taken at its word by MuJoCo itself."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import mechgraph as mg

Z = (0, 0, 1)


def link(name, k):
    return mg.Link(name, 1.0 + 0.3 * k, (0.1 * k, -0.05, 0.02 * k), np.diag([0.02, 0.03, 0.04]) + 0.002)


def machine(name, links, *pairs, **more):
    bodies = [mg.Link("frame"), *(link(v, k) for k, v in enumerate(links, 1))]
    return mg.Mechanism(
        name, bodies, [mg.Pair(*head, **kw) for *head, kw in pairs], loads=[mg.Gravity((0.1, 0, -9.81))], **more
    )


MACHINES = {
    "four-bar": machine(
        "four-bar", ["crank", "coupler", "rocker"],
        ("A", "R", "frame", "crank", {"point": (0, 0, 0), "axis": Z}),
        ("B", "R", "crank", "coupler", {"point": (0, 1, 0), "axis": Z}),
        ("C", "R", "coupler", "rocker", {"point": (2, 1.5, 0), "axis": Z}),
        ("D", "R", "frame", "rocker", {"point": (2.2, 0, 0), "axis": Z}), drives=["A"],
    ),
    "press": machine(
        "press", ["crank", "rod", "slider", "lever"],
        ("A", "R", "frame", "crank", {"point": (0, 0, 0), "axis": (0.3, 1, -0.2)}),
        ("B", "S", "crank", "rod", {"point": (0.02, 0.006, 0.06)}),
        ("C", "U", "rod", "slider", {"point": (0.24, 0.04, 0.02), "axis": Z, "second": (0, 1, 0)}),
        ("D", "P", "frame", "slider", {"point": (0.30, 0.04, -0.02), "axis": (1, 0, 0)}),
        ("E", "Sp", "lever", "slider", {"point": (0.36, 0.04, 0.02), "axis": (1, 0.1, 0.1)}),
        ("F", "R", "frame", "lever", {"point": (0.38, 0.04, 0.16), "axis": (0, 1, 0.2)}), drives=["A"],
    ),
    "rssr": machine(
        "rssr", ["crank", "coupler", "rocker"],
        ("A", "R", "frame", "crank", {"point": (0, 0, 0), "axis": Z}),
        ("B", "S", "coupler", "crank", {"point": (0.3, 0.1, 0)}),
        ("C", "R", "rocker", "frame", {"point": (1, 0, 0.3), "axis": (0.2, 1, 0.1)}),
        ("D", "S", "coupler", "rocker", {"point": (1.2, 0.4, 0.5)}), drives=["A"],
    ),
    "cylinders": machine(
        "cylinders", ["one", "two", "three"],
        ("A", "C", "one", "frame", {"point": (0, 0, 0), "axis": (0.2, 0.1, 1)}),
        ("B", "C", "one", "two", {"point": (1, 0.2, 0), "axis": (1, 0.1, 0.3)}),
        ("C", "H", "three", "two", {"point": (1, 1, 0.3), "axis": (0.2, 1, 0.1), "pitch": 0.05}),
        ("D", "C", "three", "frame", {"point": (0, 1, 0.6), "axis": (0.4, -0.5, 1)}), drives=["A.Rz"],
    ),
    "plane and welds": machine(
        "plane", ["crank", "plate", "lever", "tip"],
        ("A", "R", "frame", "crank", {"point": (0, 0, 0), "axis": (0.1, 0.2, 1)}),
        ("B", "U", "crank", "plate", {"point": (0.3, 0.1, 0), "axis": (0.3, 0, 1), "second": (0, 1, 0)}),
        ("C", "E", "plate", "lever", {"point": (0.5, 0.4, 0.2), "axis": (0.4, 1, 0.9), "second": (1, 0, 0.1)}),
        ("D", "R", "frame", "lever", {"point": (0.7, 0.1, 0.1), "axis": (0.1, 0.9, 0.3)}),
        ("E", "W", "plate", "tip", {"point": (0.9, 0.9, 0.1)}),
        ("F", "W", "tip", "plate", {"point": (0.8, 0.9, 0.1)}), drives=["A"],
    ),
    "gears": machine(
        "gears", ["pinion", "wheel"],
        ("A", "R", "frame", "pinion", {"point": (0, 0, 0), "axis": Z}),
        ("B", "R", "frame", "wheel", {"point": (0.06, 0, 0), "axis": Z}),
        couplings=[mg.Coupling({"A": 20, "B": 40}, name="teeth")], drives=["A"],
    ),
    "by markers": mg.Mechanism(
        "by markers", [mg.Link("frame"), link("crank", 1), link("coupler", 2), link("rocker", 3)], [
            mg.Pair("A", "R", "frame", "crank", on_a=mg.Marker((0, 0, 0), Z), on_b=mg.Marker((0, 0, 0), Z)),
            mg.Pair("B", "R", "crank", "coupler", on_a=mg.Marker((1, 0, 0), Z), on_b=mg.Marker((0, 0, 0), Z)),
            mg.Pair("C", "R", "coupler", "rocker", on_a=mg.Marker((3, 0, 0), Z), on_b=mg.Marker((2.5, 0, 0), Z)),
            mg.Pair("D", "R", "frame", "rocker", on_a=mg.Marker((3.2, 0, 0), Z), on_b=mg.Marker((0, 0, 0), Z)),
        ], drives=["A"], start={"A": 0.5, "B": 0.3, "D": 2.0},
    ),
}  # fmt: skip


def loaded(path):
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        return mg.load(path), [str(n.message) for n in notes]


def read(tmp_path, body, before="", after="", suffix="xml"):
    file = tmp_path / f"x.{suffix}"
    file.write_text(f"<mujoco model='m'>{before}<worldbody>{body}</worldbody>{after}</mujoco>", encoding="utf-8")
    return loaded(file)


def start_pose(m, name):
    """Pose of a link at the start, with the drives kept there."""
    return mg.kinematics(m, {d.freedom: m.start.get(m.full_name(d.freedom), 0.0) for d in m.drives}).link(name).pose


# --- there and back --------------------------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:mechanism 'rssr'. coupler. load-bearing passive freedom")
@pytest.mark.parametrize("name", MACHINES)
def test_a_mechanism_comes_back_with_its_mobility_closure_and_masses(tmp_path, name):
    m = MACHINES[name]
    mg.save(m, tmp_path / "m.xml")
    back, notes = loaded(tmp_path / "m.xml")
    assert not notes
    old, new = mg.check(m), mg.check(back)
    assert new.mobility == old.mobility
    assert new.redundancy == old.redundancy
    masses = {v.name: v for v in back.links if v.mass}
    assert set(masses) == {v.name for v in m.links if v.mass}
    for v in m.links:
        if v.mass:
            assert masses[v.name].mass == pytest.approx(v.mass)
            assert np.array(masses[v.name].center) == pytest.approx(np.array(v.center))
            assert np.array(masses[v.name].inertia) == pytest.approx(np.array(v.inertia))
            assert start_pose(back, v.name) == pytest.approx(start_pose(mg.assemble(m), v.name), abs=1e-9)
    drive = m.drives[0].freedom
    name = back.drives[0].freedom
    zero = mg.assemble(m).start[m.full_name(drive)]
    motion = mg.Motion(zero + np.array([0.0, 0.03, 0.06]), 1.0, 0.5)
    s, r = mg.solve(m, {drive: motion}), mg.solve(back, {name: motion})
    (old_pair, j), (new_pair, k) = m.freedom(drive), back.freedom(name)
    ours, theirs = s[m.pairs[old_pair].name].effort[:, j], r[back.pairs[new_pair].name].effort[:, k]
    assert theirs == pytest.approx(ours, rel=1e-8, abs=1e-9)
    for v in m.links[1:]:
        assert r.link(v.name).pose == pytest.approx(s.link(v.name).pose, abs=1e-9)
        assert r.link(v.name).acceleration == pytest.approx(s.link(v.name).acceleration, abs=1e-7)


@pytest.mark.daily(10)
@pytest.mark.parametrize("ends", [("frame", "body"), ("body", "frame")], ids=["a-b", "b-a"])
@pytest.mark.parametrize("symbol", mg.pair_types())
def test_every_pair_of_the_table_is_written_in_either_sense(tmp_path, symbol, ends):
    """A body on one pair that starts displaced: MuJoCo and mechgraph place it alike wherever its turns and slides go."""
    rng = np.random.default_rng(7)
    row = mg.pair_types()[symbol]
    more = {"pitch": 0.05} if row.takes_pitch else {}
    axes = [np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in ends]
    markers = [mg.Marker(tuple(rng.normal(size=3)), tuple(z), tuple(x)) for z, x, _ in axes]
    pair = mg.Pair("p", symbol, *ends, on_a=markers[0], on_b=markers[1], **more)
    singles = [f"p.{f.name}" for f, single in zip(row.freedoms, row.drivable, strict=True) if single]
    start = {name: 0.3 * (k + 1) for k, name in enumerate(singles)}
    m = mg.Mechanism("one", [mg.Link("frame"), link("body", 1)], [pair], drives=singles, start=start)
    mg.save(m, tmp_path / "m.xml")
    back, _ = loaded(tmp_path / "m.xml")
    assert mg.check(back).mobility == row.f
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml"))
    data = mujoco.MjData(model)
    if not all(row.drivable):  # the rotation stays at its start; slides move before it
        assert model.nv == row.f
        return
    values = {name: value + 0.2 - 0.5 * k for k, (name, value) in enumerate(start.items())}
    s = mg.kinematics(m, values)
    put(mujoco, model, data, s, m)
    mujoco.mj_forward(model, data)
    assert data.xpos[1] == pytest.approx(s.link("body").pose[:3, 3], abs=1e-12)
    assert data.xmat[1].reshape(3, 3) == pytest.approx(s.link("body").pose[:3, :3], abs=1e-12)


def test_toml_is_still_what_other_suffixes_mean(tmp_path):
    m = MACHINES["four-bar"]
    mg.save(m, tmp_path / "m.toml")
    assert mg.load(tmp_path / "m.toml") == m
    assert (tmp_path / "m.toml").read_text().startswith("schema")


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        (lambda m: m.replace(links=[replace(v, mass=0.0, inertia=None) for v in m.links]), "link 'crank': mass 0"),
        (
            lambda m: m.replace(links=[replace(v, inertia=None) if v.name == "rocker" else v for v in m.links]),
            "link 'rocker': mass 1.9",
        ),
        (lambda m: m.replace(loads=[mg.Effort("D", 1.0)]), "load 'effort'"),
        (
            lambda m: m.replace(couplings=[mg.Coupling({"A": 1, "B": 1, "D": 1}, name="g")], drives=[]),
            "coupling 'g': relates 3",
        ),
    ],
)
def test_what_mjcf_cannot_say_is_refused_by_name(tmp_path, changed, words):
    with pytest.raises(mg.FileError, match="cannot be written as MJCF") as caught:
        mg.save(changed(MACHINES["four-bar"]), tmp_path / "m.xml")
    assert words in str(caught.value)
    assert not (tmp_path / "m.xml").exists()


def test_names_are_escaped(tmp_path):
    m = MACHINES["gears"]
    odd = m.replace(pairs=[p.replace(name=f'{p.name} <&"> ü') for p in m.pairs], couplings=[], drives=[])
    mg.save(odd, tmp_path / "m.xml")
    assert [p.name for p in loaded(tmp_path / "m.xml")[0].pairs] == [p.name for p in odd.pairs]


@pytest.mark.parametrize("name", ["a\tb", "a\nb", "a\x00b", "a\u202eb"])
def test_names_that_xml_cannot_hold_are_refused(tmp_path, name):
    m = MACHINES["gears"]
    odd = m.replace(pairs=[m.pairs[0], m.pairs[1].replace(name=name)], couplings=[])
    with pytest.raises(mg.FileError, match="characters that XML cannot hold"):
        mg.save(odd, tmp_path / "m.xml")


# --- MuJoCo's own word -------------------------------------------------------------------------------------------------------


def rotation_quaternion(R):
    """Unit quaternion, scalar first, of a rotation below a half turn."""
    w = np.sqrt(max(0.0, 1 + np.trace(R))) / 2
    return np.array([w, *(np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4 * w))])


def put(mujoco, model, data, s, m):
    """Place all joints where a solution has them: hinges and slides by name, balls by the links' poses."""
    for j in range(model.njnt):
        name, at = model.joint(j).name, model.jnt_qposadr[j]
        pair, _, freedom = (name.removesuffix(" advance")).partition(".")
        if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_BALL:
            body = model.jnt_bodyid[j]
            poses = {v.name: s.link(v.name).pose for v in m.links} | {"world": np.eye(4)}
            child = poses[model.body(body).name.split(" (cut")[0]]
            parent = poses[model.body(model.body_parentid[body]).name.split(" (cut")[0]]
            R0 = np.zeros(9)
            mujoco.mju_quat2Mat(R0, model.body_quat[body])
            others = [i for i in range(model.njnt) if model.jnt_bodyid[i] == body and i != j]
            assert not [i for i in others if model.jnt_type[i] != mujoco.mjtJoint.mjJNT_SLIDE]
            data.qpos[at : at + 4] = rotation_quaternion(R0.reshape(3, 3).T @ parent[:3, :3].T @ child[:3, :3])
            continue
        row = m.pair(pair).type
        k = [f.name for f in row.freedoms].index(freedom) if freedom else 0
        value = s[pair].position[k]
        data.qpos[at] = (
            value
            if not name.endswith("advance")
            else m.pair(pair).pitch_per_radian * (value - m.start.get(f"{pair}.Rz", 0.0))
        )


@pytest.mark.parametrize("name", MACHINES)
def test_mujoco_finds_the_same_mobility_closure_and_links(tmp_path, name):
    mujoco = pytest.importorskip("mujoco")
    m = mg.assemble(MACHINES[name])
    mg.save(m, tmp_path / "m.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml"))
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    drive = m.drives[0].freedom
    for step in (0.0, 0.03, 0.07):
        s = mg.kinematics(m, {drive: m.start[m.full_name(drive)] + step})
        put(mujoco, model, data, s, m)
        mujoco.mj_forward(model, data)
        assert np.abs(data.efc_pos[: data.ne]).max(initial=0.0) < 1e-9  # closure
        J = data.efc_J.reshape(-1, model.nv)[: data.ne]
        assert model.nv - np.linalg.matrix_rank(J, tol=1e-7) == mg.check(m).mobility
        for body in range(1, model.nbody):
            v = model.body(body).name.split(" (cut")[0]
            assert data.xpos[body] == pytest.approx(s.link(v).pose[:3, 3], abs=1e-9)
            assert data.xmat[body].reshape(3, 3) == pytest.approx(s.link(v).pose[:3, :3], abs=1e-9)
    assert model.body_mass.sum() == pytest.approx(sum(v.mass for v in m.links))
    assert model.nu == len(m.drives)


def test_mujoco_finds_the_same_holding_torque(tmp_path):
    """Virtual work with MuJoCo's own gravity forces and constraint Jacobian against the driver effort at rest."""
    mujoco = pytest.importorskip("mujoco")
    m = mg.assemble(MACHINES["press"])
    mg.save(m, tmp_path / "m.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "m.xml"))
    model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    J = data.efc_J.reshape(-1, model.nv)[: data.ne]
    motor = model.jnt_dofadr[model.joint("A").id]
    unit = np.zeros((1, model.nv))
    unit[0, motor] = 1.0
    tau = np.linalg.lstsq(np.vstack([J, unit]).T, data.qfrc_bias, rcond=None)[0]
    assert tau[-1] == pytest.approx(float(mg.solve(m, {"A": 0.0})["A"].effort[0]), rel=1e-8)


@pytest.mark.parametrize(
    ("attribute", "compiler"),
    [
        ('quat="0.9 0.1 -0.3 0.2"', ""), ('axisangle="1 2 3 40"', ""), ('axisangle="1 2 3 0.7"', 'angle="radian"'),
        ('euler="30 40 -50"', ""), ('euler="0.3 0.4 -0.5"', 'angle="radian" eulerseq="zyx"'), ('euler="30 40 -50"', 'eulerseq="XYZ"'),
        ('euler="30 40 -50"', 'eulerseq="ZXZ"'), ('xyaxes="1 0.2 0 -0.3 1 0.4"', ""), ('zaxis="0.1 0.2 -0.3"', ""), ('zaxis="0 0 -2"', ""),
    ],
)  # fmt: skip
def test_orientations_are_those_of_mujoco(tmp_path, attribute, compiler):
    mujoco = pytest.importorskip("mujoco")
    body = f'<body name="b" pos="1 2 3" {attribute}><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    text = f"<mujoco><compiler {compiler}/><worldbody>{body}</worldbody></mujoco>"
    (tmp_path / "m.xml").write_text(text)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    made, _ = loaded(tmp_path / "m.xml")
    pose = mg.kinematics(made).link("b").pose
    assert pose[:3, :3] == pytest.approx(data.xmat[1].reshape(3, 3), abs=1e-12)
    assert pose[:3, 3] == pytest.approx(data.xpos[1])


def test_joints_in_a_row_classes_and_references_are_those_of_mujoco(tmp_path):
    mujoco = pytest.importorskip("mujoco")
    text = """<mujoco><compiler angle="degree"/>
      <default><joint axis="0 1 0"/><default class="odd"><joint type="slide" axis="1 1 0" ref="0.2"/></default></default>
      <worldbody><body name="b" pos="0 0 1" euler="10 20 30">
        <inertial pos="0 0 0.1" mass="1" diaginertia="1 1 1"/>
        <joint name="h" pos="0.1 0 0" ref="25"/><joint name="s" class="odd"/><joint name="k" axis="0 0.3 1" pos="0 0.2 0"/>
        <body name="c" childclass="odd" pos="0.5 0 0">
          <inertial pos="0 0 0.1" mass="1" fullinertia="1 2 2.5 0.1 0.2 0"/><joint name="t"/></body>
      </body></worldbody>
      <equality><joint joint1="t" joint2="s" polycoef="0.3 -2 0 0 0"/></equality></mujoco>"""
    (tmp_path / "m.xml").write_text(text)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    made, notes = loaded(tmp_path / "m.xml")
    assert not notes
    values = {"h": 0.7, "s": 0.35, "k": -0.4}
    data.qpos[:] = [0.7, 0.35, -0.4, 0.2 + 0.3 - 2 * (0.35 - 0.2)]
    mujoco.mj_forward(model, data)
    s = mg.kinematics(made.replace(drives=["h", "s", "k"]), values)
    assert np.abs(data.efc_pos).max() < 1e-12
    assert s["t"].position[0] == pytest.approx(data.qpos[3])
    for k, name in ((1, "b"), (2, "c")):
        assert s.link(name).pose[:3, 3] == pytest.approx(data.xpos[k])
        assert s.link(name).center == pytest.approx(data.xipos[k])
    assert np.linalg.eigvalsh(made.link("c").inertia)[::-1] == pytest.approx(np.sort(model.body_inertia[2])[::-1])


# --- reading -------------------------------------------------------------------------------------------------------------

MASS = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'


def test_loops_closed_by_connect_and_weld(tmp_path):
    arms = "".join(
        f'<body name="{n}" pos="{x} 0 0">{MASS}<joint name="{n}0" axis="0 0 1"/>'
        f'<body name="{n}2" pos="0 1 0">{MASS}<joint name="{n}1"/></body></body>'
        for n, x in (("a", 0), ("b", 1))
    )
    closed = '<equality><connect name="tip" body1="a2" body2="b2" anchor="0.5 0.5 0"/><weld body1="a" body2="b" active="false"/></equality>'
    made, notes = read(tmp_path, arms, after=closed)
    tip = made.pair("tip")
    assert (tip.type.symbol, tip.a, tip.b, tip.on_a.point) == ("S", "a2", "b2", (0.5, 0.5, 0.0))
    assert tip.on_b.point == pytest.approx((-0.5, 0.5, 0))
    assert [n for n in notes if "is not active" in n]
    assert mg.check(made).mobility == 2  # a five-bar
    welded, _ = read(tmp_path, arms, after='<equality><weld body1="a2" body2="b2" relpose="1 0 0 1 0 0 0"/></equality>')
    assert welded.pairs[-1].on_a.point == pytest.approx((1, 0, 0))
    assert mg.check(welded).mobility == 1  # a four-bar


def test_a_free_root_becomes_the_frame_and_gravity_turns_with_it(tmp_path):
    body = f'<body name="base" euler="90 0 0"><freejoint/>{MASS}<body name="arm">{MASS}<joint name="j" axis="0 1 0"/></body></body>'
    made, notes = read(tmp_path, body)
    assert made.frame == "base"
    assert any("free in the world" in n for n in notes)
    assert made.loads[0].acceleration == pytest.approx((0, -9.81, 0))
    with pytest.raises(mg.ContentError, match="a free joint; only a single body"):
        read(tmp_path, body + f'<body name="other">{MASS}<freejoint/></body>')


@pytest.mark.parametrize(
    ("body", "after", "words"),
    [
        ('<body name="a"><joint type="screw"/></body>', "", "type 'screw' is not known"),
        ('<body name="a"><joint axis="0 0 0"/></body>', "", "axis has length 0"),
        ('<body name="a" pos="1 2"/>', "", "pos = '1 2': expected 3 finite numbers"),
        ('<body name="a" pos="1 2 inf"/>', "", "expected 3 finite numbers"),
        ('<body name="a"/><body name="a"/>', "", "the name is taken"),
        ('<body name="a" quat="1 0 0 0" euler="0 0 1"/>', "", "has quat and euler"),
        ('<body name="a" childclass="none"><joint/></body>', "", "there is no class 'none'"),
        ('<frame><body name="a"/></frame>', "", "line 1: frame: is not read"),
        ('<body name="a"/>', "<tendon><fixed/></tendon>", "tendon: is not read"),
        ('<body name="a"/>', '<include file="b.xml"/>', "include: is not read"),
        ('<body name="a"/>', '<equality><connect body1="a" body2="c" anchor="0 0 0"/></equality>', "there is no body 'c'"),
        ('<body name="a"/>', '<equality><connect site1="a" site2="b"/></equality>', "sites are not"),
        ('<body name="a"/>', '<equality><flex/></equality>', "this equality is not read"),
        ('<body name="a"><joint name="j"/></body>', '<equality><joint joint1="j" joint2="k"/></equality>', "no hinge or slide 'k'"),
        ('<body name="a"><joint name="j"/><joint name="k"/></body>',
         '<equality><joint joint1="j" joint2="k" polycoef="0 1 2 0 0"/></equality>', "of degree above 1"),
    ],
)  # fmt: skip
def test_what_is_not_read_is_refused_with_its_line(tmp_path, body, after, words):
    with pytest.raises(mg.ContentError) as caught:
        read(tmp_path, body, after=after)
    assert words in str(caught.value)


def test_what_is_not_applied_is_named(tmp_path):
    body = f'<body name="a">{MASS}<joint name="j" range="-1 1" stiffness="3" damping="0"/></body>'
    body += '<body name="g"><geom size="1"/><joint name="k"/></body>'
    _, notes = read(tmp_path, body, after='<actuator><motor joint="j"/><motor tendon="t"/></actuator>')
    assert any("joint 'j': range, stiffness not applied" in n for n in notes)
    assert any("body 'g' has no <inertial>" in n for n in notes)
    assert any("drives no hinge or slide" in n for n in notes)


# --- strangers -------------------------------------------------------------------------------------------------------------

BOMB = '<!DOCTYPE mujoco [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]><mujoco model="&b;"><worldbody/></mujoco>'
OUTSIDE = '<!DOCTYPE mujoco SYSTEM "http://localhost/x.dtd"><mujoco><worldbody/></mujoco>'


@pytest.mark.parametrize("suffix", ["xml", "mjcf", "urdf"])
@pytest.mark.parametrize(
    ("content", "words"),
    [
        (BOMB.encode(), "line 1: a document type declaration is not read"),
        (OUTSIDE.encode(), "line 1: a document type declaration is not read"),
        (b"<mujoco>\n<worldbody>\n</mujoco>", "line 3: mismatched tag"),
        (b"", "no element found"),
        (b"<sdf/>", "its root is <sdf>"),
        (b"<mujoco>\n\xff</mujoco>", "line 2: not in UTF-8"),
        (b"\xef\xbb\xbf<mujoco/>", "byte-order mark"),
        (b"<mujoco>&undefined;</mujoco>", "undefined entity"),
    ],
)
def test_xml_of_strangers_is_refused_with_its_place(tmp_path, suffix, content, words):
    file = tmp_path / f"x.{suffix}"
    file.write_bytes(content)
    with pytest.raises(mg.FileError, match="x") as caught:
        mg.load(file)
    assert words in str(caught.value)


@pytest.mark.slow
def test_a_chain_of_many_bodies_nested_in_each_other_is_written_and_read(tmp_path):
    n = 1500
    pairs = [
        mg.Pair(f"p{k}", "R", f"b{k}" if k else "frame", f"b{k + 1}", point=(k, 0, 0), axis=(0, 1, k % 3))
        for k in range(n)
    ]
    links = [mg.Link("frame"), *(mg.Link(f"b{k + 1}", 1.0, (k, 0, 0), np.eye(3)) for k in range(n))]
    mg.save(mg.Mechanism("chain", links, pairs), tmp_path / "m.xml")
    assert len(loaded(tmp_path / "m.xml")[0].pairs) == n
