"""FreeCAD assemblies, written by a script: the same numbers as the mechanism declared in Python, and what such files hold in practice."""

import re
import warnings
from pathlib import Path

import numpy as np
import pytest
import scipy
from asmt_writer import KINDS, Writer, lines_of, random_pose, written
from program import invoke

import mechgraph as mg
from mechgraph.document import to_text
from mechgraph.exchange.asmt import JOINTS, REFUSED
from mechgraph.exchange.asmt_mechanism import compare
from mechgraph.exchange.syntax import FUNCTIONS, FormulaFault, evaluated

Z = (0, 0, 1)
BODY = {"mass": 1.3, "inertia": np.diag([0.02, 0.03, 0.04])}
GRAVITY = mg.Gravity((0.3, -9.81, 1.0))


def link(name, center=(0.1, 0.2, 0.3)):
    return mg.Link(name, center=center, **BODY)


def bodies(*names):
    return [mg.Link("frame"), *map(link, names)]


def machine(name, links, *pairs):
    return mg.Mechanism(name, links, [mg.Pair(*head, **kw) for *head, kw in pairs], ["A"], [GRAVITY])


MACHINES = {
    "R S U P Sp": machine(
        "press", bodies("crank", "rod", "slider", "lever"),
        ("A", "R", "frame", "crank", {"point": (0, 0, 0), "axis": (0.3, 1, -0.2)}),
        ("B", "S", "crank", "rod", {"point": (0.02, 0.006, 0.06)}),
        ("C", "U", "rod", "slider", {"point": (0.24, 0.04, 0.02), "axis": Z, "second": (0, 1, 0)}),
        ("D", "P", "frame", "slider", {"point": (0.30, 0.04, -0.02), "axis": (1, 0, 0)}),
        ("E", "Sp", "lever", "slider", {"point": (0.36, 0.04, 0.02), "axis": (1, 0.1, 0.1)}),
        ("F", "R", "frame", "lever", {"point": (0.38, 0.04, 0.16), "axis": (0, 1, 0.2)}),
    ),
    "R U E": machine(
        "plate", bodies("crank", "plate", "lever"),
        ("A", "R", "frame", "crank", {"point": (0, 0, 0), "axis": (0.1, 0.2, 1)}),
        ("B", "U", "crank", "plate", {"point": (0.3, 0.1, 0), "axis": (0.3, 0, 1), "second": (0, 1, 0)}),
        ("C", "E", "plate", "lever", {"point": (0.5, 0.4, 0.2), "axis": (0.4, 1, 0.9), "second": (1, 0, 0.1)}),
        ("D", "R", "frame", "lever", {"point": (0.7, 0.1, 0.1), "axis": (0.1, 0.9, 0.3)}),
    ),
    "R Cp C W": machine(
        "cylinder on a face", bodies("crank", "face", "rod"),
        ("A", "R", "frame", "crank", {"point": (0, 0, 0), "axis": (0.1, 0.2, 1)}),
        ("B", "W", "crank", "face", {"point": (0.1, 0.1, 0)}),
        ("C", "Cp", "face", "rod", {"point": (0.3, 0.1, 0), "axis": (0.2, 1, 0.3), "second": (-3, 0, 2)}),
        ("D", "C", "frame", "rod", {"point": (0.5, 0.4, 0.2), "axis": (0.8, -0.3, 0.4)}),
    ),
    "R Sg C": mg.load("r-sg-c").replace(loads=[GRAVITY]),
    "P H C H C": mg.load("phchc").replace(loads=[GRAVITY]),
}  # fmt: skip


def loaded(tmp_path, text, silent=True):
    """The mechanism of a text, and its notes."""
    file = tmp_path / "made.asmt"
    file.write_text(text, encoding="utf-8")
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        made = mg.load(file)
    notes = [str(n.message) for n in notes]
    assert silent is False or not notes, notes
    return made, notes


def refused(tmp_path, text):
    with pytest.raises(mg.ContentError) as caught:
        loaded(tmp_path, text)
    return str(caught.value)


# --- the same numbers ----------------------------------------------------------------------------------------------------


def test_the_machines_have_every_pair_that_freecad_has():
    assert {p.type.symbol for m in MACHINES.values() for p in m.pairs} == set(KINDS)


@pytest.mark.daily(8)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", MACHINES)
def test_an_assembly_gives_the_numbers_of_the_same_mechanism_declared_in_python(tmp_path, name, seed):
    m, rng = MACHINES[name], np.random.default_rng(seed)
    drive = m.drives[0].freedom
    driven = drive.partition(".")[0]
    motion = mg.Motion(np.array([0.0, 0.02, 0.05, 0.1]), 2.0, 3.0)
    s = mg.solve(m, {drive: motion}, redundant="minimum_norm")
    made, _ = loaded(tmp_path, written(m, {drive: 0.0}, rng).text())
    r = mg.solve(made, {drive: motion}, redundant="minimum_norm")
    largest = max(float(np.abs(s[p.name].reaction).max()) for p in m.pairs)
    assert r[driven].effort == pytest.approx(s[driven].effort, abs=1e-10 * largest)
    assert [v.name for v in made.links] == [v.name for v in m.links]
    for old in m.links[1:]:
        assert r.link(old.name).center == pytest.approx(s.link(old.name).center, abs=1e-10)
        assert r.link(old.name).center_acceleration == pytest.approx(s.link(old.name).center_acceleration, rel=1e-9)
    for p in m.pairs:
        if p.type.symbol != "H":
            assert r[p.name].reaction == pytest.approx(s[p.name].reaction, abs=1e-10 * largest), p.name
        if p.type.symbol in ("R", "P", "C", "E"):  # with the zeros of FreeCAD; angles in any turn
            turns = np.array([2 * np.pi * f.turns for f in p.type.freedoms])
            off = r[p.name].position - s[p.name].position
            assert off == pytest.approx(np.round(off / (2 * np.pi)) * turns, abs=1e-10), p.name
            assert r[p.name].velocity == pytest.approx(s[p.name].velocity, abs=1e-9), p.name
    assert mg.check(made).mobility == mg.check(m).mobility


def test_a_link_stands_where_freecad_placed_the_part(tmp_path):
    m, rng = MACHINES["R U E"], np.random.default_rng(5)
    w = written(m, {"A": 0.0}, rng)
    made, _ = loaded(tmp_path, w.text())
    s = mg.kinematics(made, {"A": made.start["A.Rz"]})
    for name in ("crank", "plate", "lever"):
        assert s.link(name).pose == pytest.approx(w.poses[name], abs=1e-12)


def test_the_assembly_itself_may_stand_anywhere(tmp_path):
    m, rng = MACHINES["R U E"], np.random.default_rng(6)
    w = written(m, {"A": 0.0}, rng)
    stands = Writer("frame", random_pose(rng))
    for name, X in w.poses.items():
        if name != "frame":
            stands.part(name, X)
    for kind, p in zip(["RevoluteJoint", "SphericalJoint", "PlanarJoint", "RevoluteJoint"], m.pairs, strict=True):
        stands.joint(kind, p.name, p.a, marker(m, p.name), p.b, marker(m, p.name))
    s, r = mg.kinematics(m, {"A": 0.1}), mg.kinematics(loaded(tmp_path, stands.text())[0], {"A": 0.1})
    assert r.link("crank").pose @ np.linalg.inv(w.poses["crank"]) == pytest.approx(s.link("crank").pose)


def marker(m, pair):
    X = np.eye(4)
    X[:3] = m.pair(pair).markers[0].pose()
    return X


def test_kind_of_a_motion_drives_its_joint_at_the_times_of_the_file(tmp_path):
    w = written(MACHINES["R U E"], {"A": 0.0}, np.random.default_rng(1))
    w.motion("RotationalMotion", "turn", "A", "RotationZ", "0.1*sin(2.0d*pi*time)+time^2/10")
    w.simulation = (0.0, 0.4, 0.05)
    made, _ = loaded(tmp_path, w.text())
    motion = made.drives[0].motion
    t = np.arange(9) * 0.05
    assert made.drives[0].freedom == "A.Rz"
    assert motion.t == pytest.approx(t)
    assert motion.position == pytest.approx(0.1 * np.sin(2 * np.pi * t) + t**2 / 10)
    assert motion.acceleration == pytest.approx(-0.4 * np.pi**2 * np.sin(2 * np.pi * t) + 0.2)
    assert (mg.solve(made).status == "ok").all()


# --- what files hold in practice -------------------------------------------------------------------------------------------


def at(x, y, z=0.0, angle=0.0, rx=0.0):
    c, s, cx, sx = np.cos(angle), np.sin(angle), np.cos(rx), np.sin(rx)
    X = np.eye(4)
    X[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    X[:3, 3] = x, y, z
    return X


BARS = (("A", "frame", "crank", (0, 0)), ("B", "crank", "coupler", (0, 1)), ("C", "coupler", "rocker", (2, 1.5)),
        ("D", "frame", "rocker", (2.2, 0)))  # fmt: skip


def four_bar(noise=0.0, seed=0, kind="RevoluteJoint"):
    """A planar four-bar in mm whose marker J misses marker I by ``noise`` (angle, and length / 1000)."""
    rng = np.random.default_rng(seed)
    w = Writer("frame")
    for name in ("crank", "coupler", "rocker"):
        w.part(name, at(*rng.normal(size=3) * 300, rng.normal()), 2.0, (10, 20, 0), np.eye(3), (1e3, 1e3, 2e3))
    for name, a, b, (x, y) in BARS:
        turn = random_pose(rng)[:3, :3]
        miss = np.eye(4)
        axis = noise * turn[0]
        miss[:3, :3] += np.cross(np.eye(3), -axis)
        miss[:3, 3] = 1000 * noise * turn[1]
        I = at(1000 * x, 1000 * y)
        w.joint(kind, name, a, I, b, I @ miss)
    return w


@pytest.mark.parametrize("noise", [1e-9, 1e-7, 1e-6])
def test_markers_that_fit_to_few_digits_are_made_to_fit_and_the_move_is_reported(tmp_path, noise):
    made, notes = loaded(tmp_path, four_bar(noise).text(), silent=False)
    report = mg.check(made.replace(drives=["A"]))
    assert (report.mobility, report.redundancy) == (1, 3)
    (note,) = [n for n in notes if "moved so that the joints fit exactly" in n]
    size = float(re.search(r"by (\S+) and (\S+) rad", note)[2])
    assert 0.2 * noise < size < 3 * noise
    assert note.startswith("made.asmt: 4 markers")
    assert note.removeprefix("made.asmt: ") in made.description
    exact, _ = loaded(tmp_path, four_bar().text())
    drive = {"A": np.linspace(0, 0.5, 4)}
    assert mg.kinematics(made, drive)["D"].position == pytest.approx(
        mg.kinematics(exact, drive)["D"].position, abs=20 * noise
    )


def test_two_hinges_of_a_door_that_are_one_line_to_few_digits_turn(tmp_path):
    w = Writer()
    w.part("door", at(0.2, 0.1, 0.3))
    w.joint("RevoluteJoint", "lower", "Assembly1", at(1, 2, 0), "door", at(1, 2, 0))
    w.joint("RevoluteJoint", "upper", "Assembly1", at(1 + 3e-7, 2, 1.5, 0.4, 1e-7), "door", at(1, 2 - 2e-7, 1.5))
    made, notes = loaded(tmp_path, w.text(), silent=False)
    assert mg.check(made.replace(drives=["lower"])).mobility == 1
    assert any("lines that are one" in n for n in notes)


def test_parts_that_do_not_stand_in_place_are_brought_there_and_it_is_said(tmp_path):
    w = four_bar()
    text = w.text().replace(
        "\t\tPart\n\t\t\tName\n\t\t\t\tcrank\n\t\t\tPosition3D\n\t\t\t\t",
        "\t\tPart\n\t\t\tName\n\t\t\t\tcrank\n\t\t\tPosition3D\n\t\t\t\t1",
    )
    made, notes = loaded(tmp_path, text, silent=False)
    assert any("'A' does not fit as the parts stand" in n and "closed by moving the parts" in n for n in notes)
    assert mg.check(made.replace(drives=["A"])).mobility == 1


@pytest.mark.parametrize(
    "kind", ["RevoluteJoint", "CylindricalJoint", "TranslationalJoint", "FixedJoint", "PlanarJoint"]
)
def test_a_marker_that_points_the_opposite_way_is_turned_and_named(tmp_path, kind):
    w = Writer()
    w.part("arm", at(0.2, 0.1, 0.3, 0.7), 1.0, (1, 0, 0), np.eye(3), (1, 1, 1.5))
    w.joint(kind, "J", "Assembly1", at(1, 2, 0, 0.3), "arm", at(1, 2, 0, 0.3, np.pi))
    made, notes = loaded(tmp_path, w.text(), silent=False)
    assert ["points the opposite way" in n and "J J on arm" in n for n in notes] == [True]
    straight = Writer()
    straight.part("arm", at(0.2, 0.1, 0.3, 0.7), 1.0, (1, 0, 0), np.eye(3), (1, 1, 1.5))
    straight.joint(kind, "J", "Assembly1", at(1, 2, 0, 0.3), "arm", at(1, 2, 0, 0.3))
    other, _ = loaded(tmp_path, straight.text())
    assert made.pairs[0].on_a == other.pairs[0].on_a
    assert made.pairs[0].on_b.pose() == pytest.approx(other.pairs[0].on_b.pose())


@pytest.mark.parametrize(
    ("kind", "type_"), [("PlanarJoint", "E"), ("PointInPlaneJoint", "Sp"), ("LineInPlaneJoint", "Cp")]
)
def test_a_plane_with_an_offset_lies_that_far_along_z_of_marker_i(tmp_path, kind, type_):
    w = Writer()
    w.part("puck", at(0.2, 0.1, 0.3))
    tilt = np.pi / 2 if kind == "LineInPlaneJoint" else 0.0
    w.joint(kind, "J", "Assembly1", at(1, 2, 0), "puck", at(1.5, 2.7, 0.25, 0, tilt), "offset", 0.25)
    made, _ = loaded(tmp_path, w.text())
    pair = made.pairs[0]
    assert pair.type.symbol == type_
    assert pair.on_a.point == pytest.approx((1, 2, 0.25))
    assert made.start["J.Tx"] ** 2 + made.start["J.Ty"] ** 2 == pytest.approx(0.5**2 + 0.7**2)
    short, notes = loaded(tmp_path, w.text().replace("0.25\n\t\tMotions", "0.35\n\t\tMotions"), silent=False)
    assert "its markers are 0.1 " in notes[0]


def test_joints_of_the_ground_with_itself_and_joints_without_a_name(tmp_path):
    w = four_bar()
    w.joint("FixedJoint", "grounded", "frame", at(1, 2), "frame", at(1, 2))
    w.joints[1][1] = [""]
    made, notes = loaded(tmp_path, w.text(), silent=False)
    assert [p.name for p in made.pairs] == ["RevoluteJoint-1", "B", "C", "D"]
    assert any("RevoluteJoint on line" in n and "has no name" in n for n in notes)
    assert any("'grounded' joins the ground to itself" in n for n in notes)


def test_two_joints_of_one_name(tmp_path):
    w = four_bar()
    w.joints[3][1] = ["A"]
    made, notes = loaded(tmp_path, w.text(), silent=False)
    assert [p.name for p in made.pairs] == ["A", "A-2", "C", "D"]
    assert "second one named 'A'" in notes[0]


def test_a_part_held_by_a_motion_alone(tmp_path):
    w = Writer()
    w.part("tool", at(0.2, 0.1, 0.3), 2.0, (0.1, 0, 0), np.eye(3), (0.1, 0.1, 0.1))
    i, j = w.marker("Assembly1", "home", at(0, 0, 0.5)), w.marker("tool", "grip", at(0.2, 0.1, 0.6, 0.3))
    w.gravity = np.array([0, 0, -10.0])
    formulas = [
        ["rIJI1", ["time"]],
        ["rIJI2", ["0.1"]],
        ["rIJI3", ["0.1+time^2"]],
        ["angIJJ1", ["0"]],
        ["angIJJ2", ["0"]],
        ["angIJJ3", ["2*time"]],
    ]
    w.motions += [
        "GeneralMotion",
        ["Name", ["path"], "MarkerI", [i], "MarkerJ", [j], *(x for f in formulas for x in f)],
    ]
    made, notes = loaded(tmp_path, w.text(), silent=False)
    assert "which no joint connects" in notes[0]
    assert [d.freedom for d in made.drives] == [f"path.{f}" for f in ("Tx", "Ty", "Tz", "Rx", "Ry", "Rz")]
    s = mg.solve(made)
    t = made.drives[0].motion.t
    grip = s.link("tool").pose @ (np.linalg.inv(at(0.2, 0.1, 0.3)) @ at(0.2, 0.1, 0.6, 0.3))
    assert grip[:, :3, 3] == pytest.approx(np.stack([t, 0.1 + 0 * t, 0.6 + t**2], axis=1))
    assert np.arctan2(grip[:, 1, 0], grip[:, 0, 0]) == pytest.approx(2 * t)
    assert s["path"].effort[:, 2] == pytest.approx(2.0 * (2 + 10), rel=1e-9)  # m (z'' + g), by hand


def test_limits_are_kept_in_words(tmp_path):
    w = four_bar()
    w.limits += ["RotationLimit", ["Name", ["stop"], "MarkerI", ["/frame/m"], "MarkerJ", ["/frame/crank/n"], "MotionJoint", [""],
                 "Limit", ["30.0*pi/180.0"], "Type", ["=>"], "Tol", ["1e-9"]]]  # fmt: skip
    made, notes = loaded(tmp_path, w.text(), silent=False)
    assert "RotationLimit 'stop' between /frame/m and /frame/crank/n (=> 30.0*pi/180.0) is not applied" in notes[0]
    assert "RotationLimit 'stop'" in made.description


@pytest.mark.parametrize("kind", [*REFUSED, "TeleportJoint"])
def test_joints_that_are_no_pair_are_refused_by_name(tmp_path, kind):
    w = four_bar()
    w.joint(kind, "odd", "frame", at(1, 2), "crank", at(1, 2), "radiusI", 1, "radiusJ", 2)
    message = refused(tmp_path, w.text())
    assert f"{kind} 'odd'" in message
    assert re.search(r"line \d+: ", message)


def test_forces_of_the_file_are_refused_not_forgotten(tmp_path):
    w = four_bar()
    w.forces += ["ForceTorque", ["Name", ["spring"]]]
    assert "ForceTorque 'spring': forces are not read" in refused(tmp_path, w.text())


def test_faults_come_all_at_once_with_their_lines(tmp_path):
    w = four_bar()
    w.joint("RevoluteJoint", "lost", "frame", at(1, 2), "crank", at(1, 2))
    w.motion("RotationalMotion", "spin", "nobody", "RotationZ", "time")
    w.motion("RotationalMotion", "odd", "A", "RotationZ", "bessel(time)")
    w.motion("TranslationalMotion", "shove", "A", "TranslationZ", "time")
    text = w.text().replace("/frame/crank/lost J on crank", "/frame/crank/gone")
    message = refused(tmp_path, text)
    assert "there is no marker '/frame/crank/gone" in message
    assert "there is no joint '/frame/nobody'" in message
    assert "bessel(time)" in message
    assert "drives Tz of 'A' (revolute), which takes a drive in Rz" in message


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("OndselSolver", "[mechanism]", "is not a valid FreeCAD assembly file: line 1"),
        ("\nAssembly\n", "\nPart\n", "there is no line Assembly"),
        ("\t\t0\t0\t0", "\t\t0\tzero\t0", "Position3D = '0 zero 0': expected 3 finite numbers"),
        ("\t\t0\t0\t0", "\t\t0\t0\tnan", "expected 3 finite numbers"),
        ("\t\t1\t0\t0\t\n", "\t\t7\t0\t0\t\n", "RotationMatrix is no rotation"),
        ("\t\t1\t0\t0\t\n", "", "RotationMatrix = "),
        ("\t\t\t\tcoupler\n", "\t\t\t\tcrank\n", "has the name 'crank', which is taken"),
    ],
)
def test_files_at_fault_say_where(tmp_path, old, new, words):
    text = four_bar().text()
    assert old in text
    file = tmp_path / "bad.asmt"
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(mg.FileError) as caught:
        mg.load(file)
    assert words in str(caught.value)


def test_file_reading_rules_are_those_of_toml(tmp_path):
    file = tmp_path / "x.asmt"
    with pytest.raises(mg.FileError, match="cannot be read"):
        mg.load(file)
    file.write_bytes(b"OndselSolver\nAssembly\n\xff\xfe")
    with pytest.raises(mg.FileError, match="is not a valid FreeCAD assembly file: line 3: not in UTF-8"):
        mg.load(file)
    file.write_bytes(four_bar().text().replace("\n", "\r\n").encode())
    assert len(mg.load(file).pairs) == 4


def test_parts_that_nothing_holds_and_parts_that_are_not_tied_to_the_ground(tmp_path):
    w = four_bar()
    w.part("lamp", at(0, 0))
    made, notes = loaded(tmp_path, w.text(), silent=False)
    assert "no joint and no motion holds lamp: left out" in notes[0]
    assert "lamp" not in [v.name for v in made.links]
    w.part("cord", at(0, 0))
    w.joint("RevoluteJoint", "loose", "lamp", at(0, 0), "cord", at(0, 0))
    assert "parts lamp, cord are joined to each other, but not to the ground" in refused(tmp_path, w.text())


def test_masses_that_freecad_made_up_are_named(tmp_path):
    w = Writer()
    w.part("arm", at(0, 0), 1.0, (0, 0, 0), np.eye(3), (1, 1, 1))
    w.joint("RevoluteJoint", "J", "Assembly1", at(1, 2), "arm", at(1, 2))
    _, notes = loaded(tmp_path, w.text(), silent=False)
    assert "FreeCAD writes where it was told none" in notes[0]


@pytest.mark.parametrize(
    ("kind", "freedoms", "extra"),
    [("ParallelAxesJoint", 4, ()), ("NoRotationJoint", 3, ()), ("PerpendicularJoint", 5, ()), ("AngleJoint", 5, ("theIzJz", 0.8)),
     ("AngleJoint", 4, ("theIzJz", 0.0)), ("ScrewJoint", 5, ("pitch", 2.0))],
)  # fmt: skip
def test_joints_of_directions_alone(tmp_path, kind, freedoms, extra):
    w = Writer()
    w.part("arm", at(0.3, 0.4, 0.5, 0.2))
    tilt = {"PerpendicularJoint": np.pi / 2, "AngleJoint": extra[-1] if extra else 0}.get(kind, 0.0)
    w.joint(kind, "J", "Assembly1", at(1, 2), "arm", at(3, 1, 2, 0.0, tilt), *extra)
    made, _ = loaded(tmp_path, w.text())
    report = mg.check(made)
    assert report.mobility == freedoms
    assert made.start == pytest.approx(dict.fromkeys(made.start, 0.0), abs=1e-12)


def test_every_joint_of_the_table_is_tested():
    text = Path(__file__).read_text(encoding="utf-8") + str(KINDS)
    assert [kind for kind in (*JOINTS, *REFUSED) if kind not in text and kind not in REFUSED] == []


# --- formulas ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    ["2*pi*time", "4.0d*pi*time", "-time^3+2.5", "1/(2+time)", "(1+time)^0.5", "2^3*time", "3", "-(time)", "+time",
     *(f"{f}(0.3+0.4*time)*time" for f in FUNCTIONS), "sin(cos(2*time)^2)", "1.5e-1d*time", "(0-2)^3*time", "sqrt(0)+time",
     '"2*pi<n>*time"', "1.5d-1*time-2d0", "integral(time, sin(3*time)^2)", "integral(time, rampstep(2*time, 0, 1, 5, 3)/2)"],
)  # fmt: skip
def test_rates_of_formulas_are_their_derivatives(text):
    t = np.linspace(0.1, 0.9, 9)
    s, v, a = evaluated(text, t)
    h = 1e-4
    before, after = evaluated(text, t - h)[0], evaluated(text, t + h)[0]
    assert v == pytest.approx((after - before) / (2 * h), abs=1e-6)
    assert a == pytest.approx((after - 2 * s + before) / h**2, abs=1e-5)
    if "integral" not in text:
        python = re.sub(r"(?<=\d)d\b|<n>", "", re.sub(r"d(?=-?\d)", "e", text)).strip('"').replace("^", "**")
        assert s == pytest.approx(eval(python, {"pi": np.pi, "time": t, "ln": np.log, **vars(np)}) + 0 * t)


def test_a_speed_that_grows_in_a_ramp_is_integrated():
    """At rest until .25, then evenly faster until 2, then 8.75 / 2: areas under straight lines by hand."""
    t, top = np.linspace(0, 4, 17), 8.75 / 2
    s, v, a = evaluated("integral(time,  rampstep(time, T1, 0.0, 2.0, 0.0 + 5.0*(2.0 - T1))/2)", t, {"t1": "0.25d"})
    ramp = np.clip(t - 0.25, 0, 1.75)
    assert s == pytest.approx(top * ramp**2 / 3.5 + top * np.maximum(t - 2, 0), abs=1e-14)
    assert v == pytest.approx(top * ramp / 1.75, abs=1e-14)
    assert a == pytest.approx(top / 1.75 * ((t >= 0.25) & (t < 2)), abs=1e-14)
    for coarse in (t[:1], t[::8]):
        assert evaluated("integral(time, sin(time))", coarse)[0] == pytest.approx(1 - np.cos(coarse), abs=1e-13)


@pytest.mark.parametrize(
    "text",
    ["", "time time", "x", "__import__('os')", "time.real", "[1]", "2**time", "1/0", "ln(-1)", "sin(1, 2)", "9" * 5000,
     "(" * 500 + "1" + ")" * 500, "10^(10^10)", "lambda: 1", "'a'", "True", "1j", "(0-2)^(1/3)", "((0-2)^(1/3))^3",
     "0*ln(0-1)", "sqrt(time)", "0x10", "0b1", "1_0", "2 # 3", "1.2.3", "2time", "1" * 1900 + "?",
     "rampstep(time, 2, 0, 1, 0)", "rampstep(time)", "rampstep()", "rampstep(time, time, 0, 1, 0)", "integral(time)",
     "integral(2*time, 1)", "integral(time, x)"],
)  # fmt: skip
def test_what_is_no_formula_is_refused(text):
    with pytest.raises(FormulaFault):
        evaluated(text, np.zeros(2))


def test_what_changes_too_quickly_to_be_integrated_is_named():
    with pytest.raises(FormulaFault, match="changes too quickly"):
        evaluated("integral(time, sin(1000*time))", np.array([0.0, 1.0]))


# --- stored results ------------------------------------------------------------------------------------------------------


def swing(force=1.0, torque=1.0, shift=0.0):
    """An arm of 2 kg at 0.5 m that turns at 3 rad/s against gravity, with results by hand: forces on the ground."""
    w = Writer()
    w.part("arm", at(0, 0), 2.0, (0.5, 0, 0.1), np.eye(3), (0.01, 0.02, 0.03))
    w.joint("RevoluteJoint", "J", "Assembly1", at(0, 0), "arm", at(0, 0))
    w.motion("RotationalMotion", "M", "J", "RotationZ", "3*time")
    w.gravity, w.simulation = np.array([0, -9.81, 0]), (0.0, 1.0, 0.25)
    t = np.arange(5) * 0.25
    c, s = np.cos(3 * t), np.sin(3 * t)
    f = {"X": 2 * 9 * 0.5 * c, "Y": 2 * 9 * 0.5 * s - 2 * 9.81, "Z": 0 * t}  # of the arm on the ground: m (w^2 r + g)
    m = {"X": -0.1 * f["Y"], "Y": 0.1 * f["X"], "Z": 0 * t}  # about the marker, the mass center 0.1 above it

    def row(label, values):
        return "\t".join([label, "0", *(f"{v:.17g}" for v in values)]) + "\t"

    zero = 0 * t
    rows = [["X", shift + zero], ["Y", zero], ["Z", zero], ["Bryantx", zero], ["Bryanty", zero], ["Bryantz", 3 * t]]
    joint = [[f"F{k}onI", force * f[k]] for k in "XYZ"] + [[f"T{k}onI", m[k]] for k in "XYZ"]
    motion = [[f"F{k}onI", zero] for k in "XYZ"] + [
        ["TXonI", zero],
        ["TYonI", zero],
        ["TZonI", -torque * 2 * 9.81 * 0.5 * c],
    ]
    w.results = ["TimeSeries", "\t".join(["Number", "Input", *"12345"]), "\t".join(["Time", "Input", *map(str, t)]),
        "AssemblySeries\t/Assembly1", row("X", zero), "PartSeries\t/Assembly1/arm", *(row(*r) for r in rows),
        "RevoluteJointSeries\t/Assembly1/J", *(row(*r) for r in joint),
        "RotationalMotionSeries\t/Assembly1/M", *(row(*r) for r in motion)]  # fmt: skip
    return w


@pytest.mark.parametrize(
    ("changed", "found"),
    [({}, []), ({"force": 1.01}, ["force"]), ({"torque": -1}, ["moment"]), ({"shift": 0.01}, ["place"])],
)
def test_stored_results_stand_beside_ours(tmp_path, changed, found):
    file = tmp_path / "swing.asmt"
    file.write_text(swing(**changed).text())
    got = compare(file)
    assert got.agrees == (not found)
    assert got.times == 5
    off = [d for d in got.differences if d.relative > 1e-9]
    assert [d.quantity for d in off] == found
    assert {d.of for d in got.differences} == {"arm", "J", "M"}
    if found:
        assert f"off by more than 0.0001: 1 of 6, {found[0]} of" in " ".join(to_text(got.document()).split())
    if "force" in changed:
        assert off[0].relative == pytest.approx(0.01 / 1.01, rel=1e-6)


def test_a_driven_slide_by_hand(tmp_path):
    """A block of 2 kg on a rail along x, pushed with 0.5 m/s^2 against a field of -3 along it; results on the ground, about marker I."""
    along = np.eye(4)
    along[:3, :3] = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0.0]])  # z of the markers along x
    stands = np.eye(4)
    stands[0, 3] = 0.1
    w = Writer()
    w.part("block", stands, 2.0, (0, 0, 0), np.eye(3), (1, 1, 1))
    w.joint("TranslationalJoint", "rail", "Assembly1", along, "block", stands @ along)
    w.motion("TranslationalMotion", "push", "rail", "TranslationZ", "0.1+0.25*time^2")
    w.gravity, w.simulation = np.array([-3.0, -9.81, 0]), (0.0, 2.0, 0.5)
    t = np.arange(5) * 0.5
    x, zero = 0.1 + 0.25 * t**2, 0 * t

    def rows(**found):
        labels = [f"{kind}{axis}onI" for kind in "FT" for axis in "XYZ"]
        return ["\t".join([label, "0", *(f"{v:.17g}" for v in found.get(label[:2], zero))]) for label in labels]

    w.results = ["TimeSeries", "\t".join(["Time", "Input", *map(str, t)]),
        "TranslationalJointSeries\t/Assembly1/rail", *rows(FY=zero - 2 * 9.81, TZ=-2 * 9.81 * x),
        "TranslationalMotionSeries\t/Assembly1/push", *rows(FX=zero - 2 * (0.5 + 3))]  # fmt: skip
    file = tmp_path / "slide.asmt"
    file.write_text(w.text())
    got = compare(file)
    assert {(d.of, d.quantity) for d in got.differences} == {
        (n, q) for n in ("rail", "push") for q in ("force", "moment")
    }
    assert max(d.relative for d in got.differences) < 1e-10


@pytest.mark.parametrize(("first", "second", "sign"), [(0, 1, 1.0), (1, 0, -1.0)])
def test_a_motion_names_the_markers_of_its_joint_in_either_order(tmp_path, first, second, sign):
    w = Writer()
    w.part("arm", at(0.3, 0.4))
    markers = w.joint("RevoluteJoint", "J", "Assembly1", at(1, 2), "arm", at(1, 2))
    w.motions += [
        "RotationalMotion",
        ["Name", ["M"], "MarkerI", [markers[first]], "MarkerJ", [markers[second]], "RotationZ", ["0.2+time"]],
    ]
    made, notes = loaded(tmp_path, w.text())
    (drive,) = made.drives
    assert drive.freedom == "J.Rz"
    assert drive.motion.position == pytest.approx(sign * (0.2 + drive.motion.t))


def test_of_redundant_reactions_it_is_said_that_the_file_has_one_of_many(tmp_path):
    w = swing()
    w.joint("RevoluteJoint", "second", "Assembly1", at(0, 0, 1), "arm", at(0, 0, 1))
    file = tmp_path / "swing.asmt"
    file.write_text(w.text())
    got = compare(file)
    missing = {d.quantity for d in got.differences if d.missing}
    assert missing == {"force", "moment"}
    assert "one of many" in str(got.document())


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda w: setattr(w, "results", []), "holds no results"),
        (lambda w: setattr(w, "motions", []), "has no motions"),
        (lambda w: w.results.__setitem__(6, "X\t0\t1"), "1} numbers at 5 times"),
        (lambda w: w.results.__setitem__(6, "X\t0\tone\t2\t3\t4\t5"), "expected finite numbers"),
    ],
)
def test_results_that_cannot_be_compared_say_why(tmp_path, edit, words):
    w = swing()
    edit(w)
    file = tmp_path / "swing.asmt"
    file.write_text(w.text())
    with pytest.raises(mg.FileError, match=re.escape(words)):
        compare(file)


def test_rows_longer_than_the_times_and_times_that_start_again(tmp_path):
    w = swing()
    w.results[2] += "\t0\t0\t0.25"
    w.results = [line + "7\t7\t" if line[0] in "XYZBFT" and "Time" not in line else line for line in w.results]
    file = tmp_path / "swing.asmt"
    file.write_text(w.text())
    assert compare(file).agrees


# --- command line ---------------------------------------------------------------------------------------------------------


def run(*arguments):
    result = invoke(*arguments)
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


@pytest.mark.parametrize("command", ["check", "solve"])
def test_the_command_line_reads_an_assembly_and_compares(tmp_path, command):
    w = swing()
    w.part("lamp", np.eye(4))
    file = tmp_path / "swing.asmt"
    file.write_text(w.text())
    plain, both = run(command, file), run(command, file, "--compare")
    assert plain.exit_code == both.exit_code == 0
    assert plain.stderr == "mechgraph: swing.asmt: no joint and no motion holds lamp: left out\n"
    assert both.stdout.startswith(plain.stdout)
    assert "FreeCAD's stored results beside mechgraph's" in both.stdout
    assert "All that is unique agrees to 0.0001, at 5 times." in both.stdout


def test_the_command_line_compares_assemblies_only(tmp_path):
    assert "is not a FreeCAD assembly" in run("check", "four-bar", "--compare").stderr
    file = tmp_path / "x.asmt"
    file.write_text(four_bar().text())
    result = run("check", file, "--compare")
    assert (result.exit_code, "holds no results" in result.stderr) == (2, True)
    assert "exclude each other" in run("check", file, "--compare", "--json").stderr
    assert run("check", tmp_path / "none.urdf").exit_code == 2


def test_the_solver_writes_its_name_in_the_first_line(tmp_path):
    text = four_bar().text()
    same = [loaded(tmp_path, text.replace("OndselSolver", name, 1))[0].pairs for name in ("OndselSolver", "FreeCADMbD")]
    assert same[0] == same[1]
    with pytest.raises(mg.FileError, match="line 1 is 'SomeSolver'"):
        loaded(tmp_path, text.replace("OndselSolver", "SomeSolver", 1))


def test_lines_are_written_by_their_depth():
    assert lines_of(0, "a", ["b", np.array([1.0, 2.0])]) == ["a", "\tb", "\t\t1\t2\t"]


# --- gears and racks -----------------------------------------------------------------------------------------------------


def geared(internal=False, turned=False, planet=False):
    """Gears of radius 0.2 and 0.3 on the ground, or the second on an arm about the axis of the first; a marker may point back."""
    w = Writer()
    centre = at(0.1 if internal else 0.5, 0)
    for name in ("one", "two", "arm")[: 2 + planet]:
        w.part(name, at(0, 0), 1.0, (0, 0, 0.1), moments=(1, 2, 2.5))
    w.joint("RevoluteJoint", "A", w.name, at(0, 0), "one", at(0, 0))
    carrier = "arm" if planet else w.name
    if planet:
        w.joint("RevoluteJoint", "C", w.name, at(0, 0), "arm", at(0, 0))
    w.joint(
        "RevoluteJoint", "B", "two", centre, carrier, centre
    )  # J is the carrier: the coordinate turns the other way
    back = at(0, 0, rx=np.pi) if turned else np.eye(4)
    w.joint(
        "GearJoint", "mesh", "one", at(0, 0) @ back, "two", centre, "radiusI", -0.2 if internal else 0.2, "radiusJ", 0.3
    )
    w.motion("RotationalMotion", "drive", "A", "RotationZ", "time")
    if planet:
        w.motion("RotationalMotion", "swing", "C", "RotationZ", "0.5*time")
    return w


@pytest.mark.parametrize("internal", [False, True])
@pytest.mark.parametrize("turned", [False, True])
def test_gears_of_a_file_turn_by_their_radii(tmp_path, internal, turned):
    """w_two = -(2 / 3) w_one of external gears, both about z; the other way for internal ones, whose first radius is negative."""
    s = mg.solve(loaded(tmp_path, geared(internal, turned).text())[0])
    w = s.link("two").angular_velocity[:, 2]
    # a marker that points back turns the other way about its z: the solver takes the sign as it is
    assert w == pytest.approx(-2 / 3 * (-1 if internal else 1) * (-1 if turned else 1))


def test_a_planet_of_a_file_obeys_willis(tmp_path):
    """(w_two - w_arm) = -(2 / 3) (w_one - w_arm), as the solver's own condition on the lines of centers says position by position."""
    s = mg.solve(loaded(tmp_path, geared(planet=True).text())[0])
    one, two, arm = (s.link(name).angular_velocity[:, 2] for name in ("one", "two", "arm"))
    assert two - arm == pytest.approx(-2 / 3 * (one - arm))
    X, Y = s.link("one").pose, s.link("two").pose
    centre = s.link("arm").point((0.5, 0, 0))[0]
    seen = [
        np.unwrap(np.arctan2(line[:, 1], line[:, 0]))
        for line in (
            np.einsum("tji,tj->ti", X[:, :3, :3], centre), np.einsum("tji,tj->ti", Y[:, :3, :3], -centre)
        )
    ]  # fmt: skip
    condition = seen[1] + 2 / 3 * seen[0]
    assert np.ptp(condition) < 1e-9


@pytest.mark.parametrize("reverse", [False, True])
def test_a_rack_of_a_file_slides_by_the_turn_of_its_pinion(tmp_path, reverse):
    """x + r b is constant: x of the pinion in the rack, b its turn against it, read off the poses."""
    w = Writer()
    w.part("rack", at(0.3, -0.1), 1.0, (0, 0, 0.1), moments=(1, 2, 2.5))
    w.part("pinion", at(0, 0), 1.0, (0, 0, 0.1), moments=(1, 2, 2.5))
    along = at(0.3, -0.1) @ np.array([[0.0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]])
    ends = [("rack", along), (w.name, along)]
    w.joint("TranslationalJoint", "P", *(ends if reverse else ends[::-1])[0], *(ends if reverse else ends[::-1])[1])
    w.joint("RevoluteJoint", "A", w.name, at(0, 0), "pinion", at(0, 0))
    w.joint("RackPinionJoint", "mesh", "rack", at(0.3, -0.1), "pinion", at(0, 0), "pitchRadius", 0.1)
    w.motion("RotationalMotion", "drive", "A", "RotationZ", "time")
    s = mg.solve(loaded(tmp_path, w.text())[0])
    x = 0.3 - s.link("rack").pose[:, 0, 3]
    b = np.arctan2(s.link("pinion").pose[:, 1, 0], s.link("pinion").pose[:, 0, 0])
    assert np.ptp(s.link("rack").pose[:, 0, 3]) == pytest.approx(0.1)
    assert np.ptp(x + 0.1 * b) < 1e-12


def test_gears_without_a_carrier_or_a_radius_are_named(tmp_path):
    w = four_bar()
    w.joint("GearJoint", "odd", "crank", at(1, 2), "rocker", at(1, 2), "radiusI", 1, "radiusJ", 2)
    w.joint("RackPinionJoint", "flat", "crank", at(1, 2), "rocker", at(1, 2), "pitchRadius", 0)
    message = refused(tmp_path, w.text())
    assert "GearJoint 'odd': no part carries both" in message
    assert "RackPinionJoint 'flat': pitchRadius = 0: expected no zero" in message


# --- constant distances --------------------------------------------------------------------------------------------------


def sliding(kind, z=(0.0, 0.0, 1.0), height=0.0, distance=0.5):
    """Two blocks that slide along x and y, at (0.3, 0) and (0, 0.4), the second raised by ``height``, 0.5 apart, axes along ``z``."""
    w = Writer()
    x, y = np.eye(4), np.eye(4)
    x[:3, :3] = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])
    y[:3, :3] = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    for name, X, along in (("one", at(0.3, 0), x), ("two", at(0, 0.4, height), y)):
        w.part(name, X, 1.0, (0, 0, 0.1), moments=(1, 2, 2.5))
        along = X @ along
        w.joint("TranslationalJoint", f"P{name}", w.name, along, name, along)
    w.joint(kind, "rod", "one", at(0.3, 0), "two", at(0, 0.4, height), "distanceIJ", distance)
    w.motion("TranslationalMotion", "drive", "Pone", "TranslationZ", "0.1*time")
    return w


@pytest.mark.parametrize(
    ("kind", "height"), [("SphSphJoint", 0.0), ("RevRevJoint", 0.0), ("CylSphJoint", 0.2), ("RevCylJoint", 0.2)]
)
def test_a_constant_distance_of_a_file_is_a_rod(tmp_path, kind, height):
    """x^2 + y^2 = 0.5^2 across the axes, whatever the height of what may slide along one; the rod carries a force along itself."""
    made, _ = loaded(tmp_path, sliding(kind, height=height).text())
    assert made.link("rod").mass == 0
    s = mg.solve(made, redundant="minimum_norm")
    x, y = s.link("one").pose[:, 0, 3], s.link("two").pose[:, 1, 3]
    assert np.ptp(x) == pytest.approx(0.1)
    assert x**2 + y**2 == pytest.approx(0.25, abs=1e-12)
    assert s.link("two").pose[:, 2, 3] == pytest.approx(height)


def test_a_distance_that_is_another_as_the_parts_stand_is_closed(tmp_path):
    made, _ = loaded(tmp_path, sliding("SphSphJoint", distance=0.6).text())
    s = mg.kinematics(made)
    assert s.link("one").pose[:, 0, 3] ** 2 + s.link("two").pose[:, 1, 3] ** 2 == pytest.approx(0.36, abs=1e-12)


def test_no_distance_is_named(tmp_path):
    assert "distanceIJ = 0: expected a distance above 0" in refused(
        tmp_path, sliding("RevRevJoint", distance=0.0).text()
    )


def test_a_motion_that_allows_a_turn_drives_nothing(tmp_path):
    w = four_bar()
    drives = len(loaded(tmp_path, w.text())[0].drives)
    w.motions += ["AllowRotation", ["Name", ["loose"], "MotionJoint", ["/Assembly1/A"]]]
    made, notes = loaded(tmp_path, w.text(), silent=False)
    assert len(made.drives) == drives
    assert any("AllowRotation 'loose' drives nothing" in note for note in notes)


# --- forces along a line -------------------------------------------------------------------------------------------------


def sprung(tension, twist="0.0"):
    """A block that is driven along x from 0.5 on, and a force between it and the ground's origin."""
    w = sliding("SphSphJoint")
    w.joints, w.motions = w.joints[:2], []
    w.parts.pop("two")
    w.joints = w.joints[:2]
    i, j = w.marker(w.name, "anchor", at(0, 0)), w.marker("one", "hook", at(0.3, 0))
    w.forces += [
        "InLineForceTorque", ["Name", ["spring"], "MarkerI", [i], "MarkerJ", [j], "tension", [tension], "twist", [twist]]
    ]  # fmt: skip
    w.motion("TranslationalMotion", "drive", "Pone", "TranslationZ", "0.1*time")
    return w


@pytest.mark.parametrize(
    ("tension", "by_hand"),
    [
        ("100.0d*(rIJ(self) - 0.1d) + 5.0*vrIJ(self)", lambda r, v, t: 100 * (r - 0.1) + 5 * v),
        ('"50*rIJ(self)^2<n>+ time"', lambda r, v, t: 50 * r**2 + t),
        ("7.0", lambda r, v, t: 7.0 + 0 * r),
    ],
    ids=["spring", "law", "constant"],
)
def test_a_force_along_a_line_of_a_file_pulls_its_markers_together(tmp_path, tension, by_hand):
    """What drives the block away from the anchor supplies the tension, by the formula read by hand."""
    made, _ = loaded(tmp_path, sprung(tension).text())
    assert isinstance(made.loads[0], mg.Spring if "0.1d" in tension else mg.ForceLaw)
    s = mg.solve(made)
    t = made.drives[0].motion.t
    r = 0.3 + 0.1 * t
    assert s["Pone"].effort[:, 0] == pytest.approx(by_hand(r, 0.1, t), rel=1e-12)


@pytest.mark.parametrize(
    ("tension", "twist", "words"),
    [
        ("100*(rIJ(other) - 0.1)", "0", r"InLineForceTorque 'spring': .* is not known in a formula"),
        ("0x10", "0", "'0x10' is no formula"),
        ("1.0", "2*time", "twist: a couple about the line"),
    ],
)
def test_a_force_along_a_line_that_is_none_is_named(tmp_path, tension, twist, words):
    assert re.search(words, refused(tmp_path, sprung(tension, twist).text()))


# --- joints of constant velocity, motions in several freedoms, variables, assemblies within assemblies ------------------


def shafts(bend, quarter=False):
    """Two shafts along z of their markers, which leave the joint at the origin, the second bent about x; the first is driven."""
    w = Writer()
    out = at(0, 0, rx=np.pi + bend)
    X, Y = at(0, 0, angle=0.4), out @ at(0, 0, angle=-0.4)  # Y turned half round about its x is X, bent
    w.part("one", X, 1.0, (0, 0, -0.1), moments=(1, 2, 2.5))
    w.part("two", Y, 1.0, (0, 0, 0.1), moments=(1, 2, 2.5))
    w.joint("RevoluteJoint", "A", w.name, at(0, 0), "one", X)
    w.joint("CylindricalJoint", "B", w.name, out, "two", Y)
    w.joint("ConstantVelocityJoint", "J", "one", X, "two", Y @ at(0, 0, angle=np.pi * quarter))
    w.motion("RotationalMotion", "drive", "A", "RotationZ", "0.4+2*time")
    return w


@pytest.mark.parametrize(("bend", "quarter"), [(0.0, False), (0.5, False), (0.5, True), (-1.2, False)])
def test_a_joint_of_constant_velocity_hands_on_a_constant_speed(tmp_path, bend, quarter):
    """The condition of the solver, ``x_I . y_J + y_I . x_J = 0``, at every position, and equal speeds about axes that leave the joint."""
    made, _ = loaded(tmp_path, shafts(bend, quarter).text())
    s = mg.solve(made, redundant="minimum_norm")
    X, Y = s.link("one").pose[:, :3, :3], s.link("two").pose[:, :3, :3]
    condition = (X[:, :, 0] * Y[:, :, 1]).sum(1) + (X[:, :, 1] * Y[:, :, 0]).sum(1)
    assert np.abs(condition).max() < 1e-12
    assert (s.link("one").angular_velocity * X[:, :, 2]).sum(1) == pytest.approx(2.0)
    assert (s.link("two").angular_velocity * Y[:, :, 2]).sum(1) == pytest.approx(-2.0)
    assert (s.link("two").angular_acceleration * Y[:, :, 2]).sum(1) == pytest.approx(0.0, abs=1e-9)


def test_a_joint_of_constant_velocity_has_two_freedoms_and_takes_a_moment(tmp_path):
    w = shafts(0.5)
    w.joints, w.motions = w.joints[4:], []
    w.joint("FixedJoint", "A", w.name, at(0, 0), "one", at(0, 0))
    made, _ = loaded(tmp_path, w.text())
    assert mg.check(made).mobility == 2


def test_markers_of_a_joint_of_constant_velocity_that_look_the_same_way_are_named(tmp_path):
    w = four_bar()
    w.joint("ConstantVelocityJoint", "J", "frame", at(1, 2), "crank", at(1, 2, angle=0.3))
    assert "z of both markers points the same way" in refused(tmp_path, w.text())


def general(w, name, i, j, order, *formulas):
    keys = ["rIJI1", "rIJI2", "rIJI3", "angIJJ1", "angIJJ2", "angIJJ3"]
    lines = [part for key, text in zip(keys, formulas, strict=True) for part in (key, [text])]
    w.motions += ["GeneralMotion", ["Name", [name], "MarkerI", [i], "MarkerJ", [j], *lines, "RotationOrder", [order]]]


TURNS = {"1 2 3": "XYZ", "3 1 3": "ZXZ", "2 1 3": "YXZ"}


@pytest.mark.parametrize("order", TURNS)
@pytest.mark.parametrize("held", ["ball", "nothing", "ball the other way round", "ball in a groove"])
def test_a_general_motion_prescribes_turns_in_their_order(tmp_path, held, order):
    """The rotation of J in I is the product of three turns, here multiplied by another library."""
    w = Writer()
    turn = scipy.spatial.transform.Rotation.from_euler(TURNS[order], [0.2, 0.7, -0.3]).as_matrix()
    J = at(0.1, 0.2, 0.3)
    J[:3, :3] = turn
    w.part("body", at(0, 0), 1.0, (0, 0, 0.1), moments=(1, 2, 2.5))
    ends = (w.name, at(0.1, 0.2, 0.3), "body", J)
    back, groove = held == "ball the other way round", held == "ball in a groove"
    if held == "nothing":
        i, j = w.marker(w.name, "mi", at(0.1, 0.2, 0.3)), w.marker("body", "mj", J)
    elif back:
        j, i = w.joint("SphericalJoint", "S", *ends[2:], *ends[:2])
    else:
        i, j = w.joint("PointInLineJoint" if groove else "SphericalJoint", "S", *ends)
    general(w, "M", i, j, order, "0", "0", "0.1*time" if groove else "0", "0.2+time", "0.7", "time^2-0.3")
    made, _ = loaded(tmp_path, w.text(), silent=held != "nothing")
    s = mg.kinematics(made)
    t = made.drives[0].motion.t
    angles = np.stack([0.2 + t, 0.7 + 0 * t, t**2 - 0.3], axis=1)
    expected = scipy.spatial.transform.Rotation.from_euler(TURNS[order], angles).as_matrix() @ turn.T
    assert s.link("body").pose[:, :3, :3] == pytest.approx(expected, abs=1e-9)
    assert s.link("body").point((0.1, 0.2, 0.3))[0][:, 2] == pytest.approx(0.3 + 0.1 * t * groove)


def test_what_a_general_motion_cannot_say_is_named(tmp_path):
    w = Writer()
    w.part("body", at(0, 0))
    i, j = w.joint("PlanarJoint", "E", w.name, at(0, 0), "body", at(0, 0))
    general(w, "M", j, i, "1 2 3", "time", "0", "0", "0", "0", "time")
    general(w, "N", i, j, "1 2", "time", "0", "0", "0", "0", "time")
    message = refused(tmp_path, w.text())
    assert "GeneralMotion 'M': names the markers of 'E' the other way round" in message
    assert "GeneralMotion 'N': RotationOrder '1 2': expected three" in message


@pytest.mark.parametrize("block", [False, True], ids=["lines", "blocks"])
def test_formulas_may_use_the_variables_of_the_file(tmp_path, block):
    """Variables in any order, by each other and by time; a block has its name and its formula in lines of their own."""
    w = sprung("K1*(rIJ(self) - L0) + w")
    entries = [("K1", "10.0d*L0*100"), ("W", "2*time^2"), ("L0", "0.1d")]
    w.variables = [
        part
        for name, text in entries
        for part in (["Variable", ["Name", [name], "Expression", [text]]] if block else [name, [text]])
    ]
    w.motions[-1][-1] = ["0.1*w/L0"]
    made, _ = loaded(tmp_path, w.text())
    s = mg.solve(made)
    t = made.drives[0].motion.t
    r = 0.3 + 2 * t**2
    assert s.link("one").pose[:, 0, 3] == pytest.approx(r)
    assert s["Pone"].effort[:, 0] == pytest.approx(
        100 * (r - 0.1) + 2 * t**2 + 4.0, rel=1e-12
    )  # the mass of 1, 4 m/s^2


@pytest.mark.parametrize(
    ("variables", "words"),
    [
        (["K", ["L"], "L", ["K"]], "variable 'k' is defined by itself"),
        (["K", ["1"], "k", ["2"]], r"line \d+: variable 'k': is defined twice"),
        (["time", ["1"]], "variable 'time': is no name for a variable"),
        (["2K", ["1"]], "variable '2K': is no name"),
        (["K"], "variable 'K': expected one formula"),
        (["Variable", ["Name", ["K"], "Value", ["1"], "Unit", ["m"]]], "variable 'K': expected one formula"),
        (["L", ["1"]], r"'k' is not known in a formula \(known: time, pi, .*\bl\b"),
    ],
)
def test_variables_at_fault_are_named(tmp_path, variables, words):
    w = sprung("K*rIJ(self)")
    w.variables = variables
    assert re.search(words, refused(tmp_path, w.text()))


def within(place):
    """A slide that carries an assembly within the assembly, standing at ``place`` on it: an arm on a pivot, driven both."""
    w, inner = Writer(), Writer("Assembly1/Inner")
    x = np.array([[0.0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]])
    w.part("slide", at(0.3, 0.4), 1.0, (0, 0, 0.1), moments=(1, 2, 2.5))
    w.joint("TranslationalJoint", "P", w.name, x, "slide", x)
    w.motion("TranslationalMotion", "push", "P", "TranslationZ", "0.5*time^2")
    inner.part("arm", at(0.5, 0.0), 2.0, (0.1, 0, 0), moments=(0.1, 0.2, 0.3))
    inner.joint("RevoluteJoint", "J", inner.name, at(0, 0), "arm", at(0, 0))
    inner.motion("RotationalMotion", "M", "J", "RotationZ", "2*time")
    w.joint("FixedJoint", "hold", "slide", place, "slide", place)
    w.joints[-1][-1] = [inner.marker(inner.name, "foot", at(0, 0))]
    w.assemblies = ["Assembly", inner.body("Inner", place)]
    return w


def test_an_assembly_within_an_assembly_brings_its_parts_joints_and_motions(tmp_path):
    """The arm turns with 2 rad/s about a pivot that is pushed with 1 m/s^2: its mass center and the moment about the pivot by hand."""
    place = at(0.3, 0.4, 0.1, 0.7)
    made, notes = loaded(tmp_path, within(place).text(), silent=False)
    assert any("assembly 'Inner' on line" in note and "its own parts stand in its frame" in note for note in notes)
    assert {link.name for link in made.links} == {"Assembly1", "slide", "Inner", "Inner/arm"}
    s = mg.solve(made)
    t = made.drives[0].motion.t
    arm = 0.6 * np.exp(1j * (0.7 + 2 * t))
    center = s.link("Inner/arm").center
    assert center == pytest.approx(np.stack([0.3 + 0.5 * t**2 + arm.real, 0.4 + arm.imag, 0.1 + 0 * t], axis=1))
    assert s["Inner/J"].effort[:, 0] == pytest.approx(2.0 * -arm.imag)  # m a, by its lever


def test_what_is_mass_marker_to_a_part_is_a_marker(tmp_path):
    w = Writer()
    w.part("ball", at(0.3, 0.4), 1.0, (0, 0.2, 0.1), moments=(1, 2, 2.5))
    w.joint("SphericalJoint", "S", w.name, at(0.3, 0.6, 0.1), "ball", at(0, 0))
    w.joints[-1][-1] = ["/Assembly1/ball/MassMarker"]
    made, notes = loaded(tmp_path, w.text())
    assert marker_of(made, "S") == pytest.approx((0, 0.2, 0.1))


def marker_of(made, pair):
    """Where the marker of a pair stands on its second link."""
    return next(p for p in made.pairs if p.name == pair).markers[1].point


def test_blocks_and_constraints_that_are_not_known_are_named(tmp_path):
    w = four_bar()
    w.general += ["CurveCurveContact", ["Name", ["cam"]]]
    assert re.search(r"line \d+: CurveCurveContact 'cam': its curves .* 'Kc'", refused(tmp_path, w.text()))
    w.general = []
    text = w.text().replace("\tKinematicIJs\n", "\tSensors\n\t\tSensor\n\tKinematicIJs\n")
    _, notes = loaded(tmp_path, text, silent=False)
    assert re.search(r"block Sensors on line \d+ was not read", notes[0])
