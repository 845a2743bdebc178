"""Loads on a link for a strength calculation: in balance, by hand, in files, and through a finite element program."""

from __future__ import annotations

import csv
import itertools
import re
import shutil
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import mechgraph as mg

Z = (0, 0, 1)
SI = {"length": "m", "mass": "kg", "time": "s"}
TURN = np.deg2rad(np.arange(0, 360, 15))


def crank_slider(gravity: bool = True) -> mg.Solution:
    """A spatial slider-crank (all reactions unique) with a spring and a couple on its rod, at 30 rad/s."""
    m = mg.load("haug-slider-crank")
    links = [link.replace(points={"eye": (0.05, 0.02, 0.1)}) if link.name == "rod" else link for link in m.links]
    loads = [
        mg.Gravity((0, 0, -9.81)), mg.Spring("frame", "rod", (0.1, 0.3, 0), "eye", stiffness=400.0, free_length=0.2, damping=3.0),
        mg.Wrench("rod", moment=(0.1, 0.2, 0.3), frame="link"), mg.Effort("D", -7.0),
    ]  # fmt: skip
    m = m.replace(links=links, loads=loads if gravity else [], drives=["A"])
    return mg.solve(m, {"A": mg.Motion(TURN, velocity=30.0, acceleration=5.0)})


SOLVABLE = [
    name for name in mg.library() if all(d.motion is not None for d in mg.load(name).drives) and mg.load(name).drives
]


@pytest.mark.daily(12)
@pytest.mark.parametrize("name", SOLVABLE)
def test_every_link_is_in_balance(name: str) -> None:
    m = mg.load(name)
    s = mg.solve(m.replace(loads=[*m.loads, mg.Gravity((1.0, -2.0, -9.81))]), redundant="minimum_norm")
    for link in m.links:
        body = mg.free_body(s, link.name)
        assert body.balance < 1e-12, link.name
        assert {one.kind for one in body.acting} >= {"pair"}


def test_balance_with_every_kind_of_load_and_in_link_frames_that_turn() -> None:
    s = crank_slider()
    for link in s.mechanism.links:
        assert mg.free_body(s, link.name).balance < 1e-13
    rod = mg.free_body(s, "rod")
    assert [one.name for one in rod.acting] == [
        "B",
        "C",
        "loads[0] gravity",
        "loads[1] spring",
        "loads[2] wrench",
        "inertia",
    ]
    np.testing.assert_allclose(rod["loads[2] wrench"].moment, np.tile([0.1, 0.2, 0.3], (24, 1)), atol=1e-12)
    assert rod["loads[1] spring"].point == (0.05, 0.02, 0.1)
    np.testing.assert_allclose(rod["loads[1] spring"].moment, 0.0, atol=1e-12)  # a force through its point
    np.testing.assert_allclose(rod["B"].moment, 0.0, atol=1e-11)  # a ball joint transmits none about its center
    np.testing.assert_allclose(np.linalg.norm(rod["B"].force, axis=1), np.linalg.norm(s["B"].force, axis=1))
    np.testing.assert_allclose(rod["loads[0] gravity"].force[0], [0, 0, -0.5 * 9.81], atol=1e-12)


def test_the_frame_is_supported_against_all_that_acts_on_it_its_own_loads_too() -> None:
    """Gas between piston and head cancels; what shakes the frame is weight and inertia of all links, by hand from their centers."""
    m = crank_slider().mechanism
    frame = m.link(m.frame).replace(mass=5.0, center=(0.3, 0.2, 0.1))
    gas = [
        mg.Wrench(link, force=(push, 0.0, 0.0), point=(0.2, 0.0, 0.0))
        for link, push in (("slider", -9e3), (m.frame, 9e3))
    ]
    m = m.replace(links=[frame, *(link for link in m.links if link.name != m.frame)], loads=[*m.loads, *gas])
    motion = {"A": mg.Motion(TURN, velocity=30.0, acceleration=5.0)}
    s = mg.solve(m, motion)
    weights = [(k.mass, s.link(k.name).center_acceleration) for k in m.links if k.mass > 0]
    np.testing.assert_allclose(
        s.shaking[:, 3:], sum(mass * (np.array([0, 0, -9.81]) - a) for mass, a in weights), atol=1e-9
    )
    body = mg.free_body(s, m.frame)
    support = next(one for one in body.acting if one.name == "support")
    np.testing.assert_allclose(support.wrench, -s.shaking, atol=1e-9)
    assert body.balance < 1e-12
    pushed = mg.solve(m, motion, loads=[*m.loads, mg.Wrench(m.frame, force=(0, 7.0, 0), point=(1.0, 0, 0))])
    more = np.broadcast_to([0, 0, 7.0, 0, 7.0, 0], (len(TURN), 6))
    np.testing.assert_allclose(pushed.shaking - s.shaking, more, atol=1e-9)


def test_the_support_of_a_planar_frame_is_known_though_its_pairs_are_not() -> None:
    m = mg.load("four-bar")
    s = mg.solve(m.replace(loads=[mg.Wrench(m.frame, force=(0, 3.0, 0), point=(1.0, 0, 0))]), {"A": TURN})
    support = next(one for one in mg.free_body(s, m.frame).acting if one.name == "support")
    np.testing.assert_allclose(support.wrench, np.broadcast_to([0, 0, -3.0, 0, -3.0, 0], (len(TURN), 6)), atol=1e-12)
    assert support.unique.all()


def test_a_pendulum_by_hand() -> None:
    """Mass m on a rod of length l at 2 m/s: the pin carries ``m g cos + m l w^2`` along it, and ``m g sin`` less inertia across."""
    m = mg.Mechanism(
        "pendulum", [mg.Link("frame"), mg.Link("rod", 3.0, (0, -0.8, 0))],
        [mg.Pair("A", "R", "frame", "rod", point=(0, 0, 0), axis=Z)], ["A"], [mg.Gravity((0, -10.0, 0))],
    )  # fmt: skip
    q, w, a = np.array([0.3, 1.2]), 2.0, 0.7
    body = mg.free_body(mg.solve(m, {"A": mg.Motion(q, w, a)}), "rod")
    np.testing.assert_allclose(body["inertia"].force, np.tile([-3 * 0.8 * a, -3 * 0.8 * w**2, 0], (2, 1)), atol=1e-12)
    np.testing.assert_allclose(body["A"].force[:, 1], 3 * 10 * np.cos(q) + 3 * 0.8 * w**2)
    np.testing.assert_allclose(body["A"].moment[:, 2], 3 * 0.8**2 * a + 3 * 10 * 0.8 * np.sin(q))  # the drive's torque
    np.testing.assert_allclose(
        body.acceleration, np.tile([0.8 * a, 0.8 * w**2, 0, 0, 0, w, 0, 0, a], (2, 1)), atol=1e-12
    )
    frame = mg.free_body(body.solution, "frame")
    np.testing.assert_allclose(frame["support"].force, -frame["A"].force)


def test_worst_positions_and_envelope() -> None:
    s = crank_slider()
    body = mg.free_body(s, "rod")
    size = np.linalg.norm(s["B"].force, axis=1)
    cases = {case.position: case for case in body.cases()}
    assert "greatest force of B" in cases[int(size.argmax())].why
    assert not any("gravity" in why for case in cases.values() for why in case.why)  # of the same size everywhere
    assert cases[int(size.argmax())].place == f"A.Rz = {15 * size.argmax()} deg"
    assert [case.position for case in body.cases([3, -1])] == [3, 23]
    assert len(body.cases("all")) == 24
    ranges = {(r.name, r.component): r for r in body.envelope()}
    r = ranges["B", "|F|"]
    assert (r.greatest, r.at_greatest, r.least) == (pytest.approx(size.max()), size.argmax(), pytest.approx(size.min()))
    fx = body["C"].force[:, 0]
    r = ranges["C", "Fx"]
    assert (r.least, r.at_least, r.greatest, r.at_greatest, r.unit) == (
        fx.min(),
        fx.argmin(),
        fx.max(),
        fx.argmax(),
        "N",
    )
    for at in (24, "best", [], 1.5):
        with pytest.raises(mg.DeclarationError, match=r"at = .*'worst', 'all'"):
            body.cases(at)  # type: ignore[arg-type]
    with pytest.raises(mg.DeclarationError, match="one of B, C, loads"):
        body["D"]
    with pytest.raises(mg.DeclarationError, match="one of the links that it joins, 'frame' and 'crank'"):
        s.on_link("A", "rod")
    with pytest.raises(mg.DeclarationError, match=r"no forces: use solve\(\)"):
        mg.free_body(mg.kinematics(s.mechanism, {"A": 0.1}), "rod")


def test_a_position_that_was_not_solved_is_no_case() -> None:
    m = mg.load("rcsr").replace(loads=[mg.Effort("O4", 1.0)])
    s = mg.solve(m, {"O1": np.deg2rad(np.arange(190.0, 220.0, 5.0))}, on_reach="flag")
    body = mg.free_body(s, "link2")
    assert len(body.cases("all")) == (s.status == "ok").sum() < 6
    assert body.balance < 1e-12
    with pytest.raises(mg.DeclarationError, match=r"position 5 was not solved \(out of reach\)"):
        body.cases(5)


# --- what is not unique ----------------------------------------------------------------------------------------------------


def planar(redundant: str) -> mg.FreeBody:
    m = mg.load("four-bar").replace(loads=[mg.Gravity((0, -9.81, 0))], units=SI)
    return mg.free_body(mg.solve(m, {"A": mg.Motion(TURN[:8], 5.0)}, redundant=redundant), "coupler")  # type: ignore[arg-type]


def test_what_is_not_unique_is_never_written_as_known(tmp_path: Path) -> None:
    body = planar("nan")
    assert body.not_unique(0) == {"B": ("Mx", "My", "Fz"), "C": ("Mx", "My", "Fz")}
    assert np.isfinite(body["B"].force[:, :2]).all()
    assert np.isnan(body["B"].force[:, 2]).all()
    with pytest.raises(
        mg.DeclarationError, match=r"B: Mx, My, Fz not unique, first at position .*redundant='minimum_norm'"
    ) as found:
        body.write(tmp_path / "x.inp")
    assert len(found.value.faults) == 2
    assert not list(tmp_path.iterdir())
    body.write(tmp_path / "x.csv", at=0)
    rows = table(tmp_path / "x.csv")
    assert [row["Fz [N]"] for row in rows if row["kind"] == "pair"] == ["", ""]
    assert [row["not unique"] for row in rows if row["kind"] == "pair"] == ["Mx My Fz"] * 2
    ranges = {(r.name, r.component): r for r in body.envelope()}
    assert np.isnan(ranges["B", "Fz"].greatest)
    in_plane = np.linalg.norm(body["B"].force[:, :2], axis=1).max()
    assert ranges["B", "|F|"].greatest == pytest.approx(in_plane)
    assert ranges["B", "Fx"].at_greatest >= 0


def test_least_norm_is_said(tmp_path: Path) -> None:
    body = planar("minimum_norm")
    assert body.not_unique(0) == {"B": ("Mx", "My", "Fz"), "C": ("Mx", "My", "Fz")}
    body.write(tmp_path / "x.inp", at=0)
    text = " ".join((tmp_path / "x.inp").read_text().replace("**", "").split())
    assert "NOT UNIQUE: Mx, My, Fz of B. These are values of least norm, one set of many" in text
    body.write(tmp_path / "x.csv", at=0)
    assert {row["not unique"] for row in table(tmp_path / "x.csv") if row["kind"] == "pair"} == {"Mx My Fz"}


# --- files -----------------------------------------------------------------------------------------------------------------


def table(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))


def test_the_table_is_in_balance(tmp_path: Path) -> None:
    body = mg.free_body(crank_slider(), "rod")
    body.write(tmp_path / "x.csv", at="all")
    rows = table(tmp_path / "x.csv")
    assert len(rows) == 24 * len(body.acting)
    for position in range(24):
        total = np.zeros(6)
        for row in rows:
            if int(row["position"]) == position:
                p, f, moment = (np.array([float(row[k]) for k in keys]) for keys in (
                    ("x [m]", "y [m]", "z [m]"), ("Fx [N]", "Fy [N]", "Fz [N]"), ("Mx [N m]", "My [N m]", "Mz [N m]")))  # fmt: skip
                total += np.concatenate([moment + np.cross(p, f), f])
        np.testing.assert_allclose(total, 0.0, atol=1e-10)


def deck_of(text: str) -> tuple[dict[int, np.ndarray], list[dict[tuple[int, int], float]]]:
    """Nodes, and the concentrated loads of every step, as another program would read them."""
    nodes: dict[int, np.ndarray] = {}
    steps: list[dict[tuple[int, int], float]] = []
    card = ""
    for line in text.splitlines():
        if line.startswith("**"):
            continue
        if line.startswith("*"):
            card = line.split(",")[0]
            steps += [{}] if card == "*STEP" else []
        elif card == "*NODE":
            number, *x = line.split(",")
            nodes[int(number)] = np.array(x, dtype=float)
        elif card == "*CLOAD":
            node, freedom, value = line.split(",")
            assert (int(node), int(freedom)) not in steps[-1]
            assert len(value.strip()) <= 20
            steps[-1][int(node), int(freedom)] = float(value)
    return nodes, steps


def total_of(nodes: dict[int, np.ndarray], step: dict[tuple[int, int], float]) -> np.ndarray:
    """Force and moment about the origin of all loads of a step."""
    out = np.zeros(6)
    for (node, freedom), value in step.items():
        unit = np.eye(6)[freedom - 1] * value
        out[:3] += unit[:3]
        out[3:] += unit[3:] + np.cross(nodes[node], unit[:3])
    return out


@pytest.mark.parametrize("couples", [None, 0.01])
def test_the_deck_is_in_balance(tmp_path: Path, couples: float | None) -> None:
    body = mg.free_body(crank_slider(), "rod")
    body.write(tmp_path / "x.inp", at="all", couples=couples)
    text = (tmp_path / "x.inp").read_text()
    assert "Units: length m, mass kg, time s, force N, moment N m" in text
    assert max(map(len, text.splitlines())) <= 132
    nodes, steps = deck_of(text)
    assert len(steps) == 24
    assert {tuple(x) for x in nodes.values()} >= {one.point for one in body.acting}
    largest = max(abs(v) for step in steps for v in step.values())
    for step in steps:
        np.testing.assert_allclose(total_of(nodes, step), 0.0, atol=1e-11 * largest)
        assert couples is None or all(freedom <= 3 for _, freedom in step)
    B = next(n for n, x in nodes.items() if tuple(x) == body["B"].point)
    np.testing.assert_allclose([steps[7].get((B, k), 0.0) for k in (1, 2, 3)], body["B"].force[7], rtol=1e-11)


def test_options_of_the_deck(tmp_path: Path) -> None:
    body = mg.free_body(crank_slider(), "rod")
    with pytest.raises(mg.DeclarationError) as found:
        body.write(tmp_path / "x.inp", inertia="no", couples=-1.0, first_node=0)
    assert len(found.value.faults) == 3
    with pytest.raises(mg.DeclarationError, match="held = 'D': expected one of"):
        body.write(tmp_path / "x.inp", held="D")
    with pytest.raises(mg.FileError, match=r"known: .csv \(table\), .inp \(CalculiX or Abaqus\)"):
        body.write(tmp_path / "x.txt")
    with pytest.raises(mg.DeclarationError, match=r"held, couples: for a load deck \(.inp\) alone"):
        body.write(tmp_path / "x.csv", held="B", couples=0.1)
    body.write(tmp_path / "x.inp", model="rod_mesh.inp", first_node=500, at=2)
    text = (tmp_path / "x.inp").read_text()
    assert "\n*INCLUDE, INPUT=rod_mesh.inp\n" in text
    assert "\n500, " in text


# --- through CalculiX ------------------------------------------------------------------------------------------------------


def bar(
    a: Sequence[float], b: Sequence[float], width: float, count: int
) -> tuple[str, dict[str, list[int]], np.ndarray]:
    """The mesh of a square bar from a to b: the text of its nodes and elements, node sets of its sections, and the nodes."""
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    x = (b - a) / np.linalg.norm(b - a)
    y = np.linalg.svd(x[None])[2][1]
    z = np.cross(x, y)
    places = [(i, j, k) for i in range(count + 1) for j in range(3) for k in range(3)]
    nodes = np.array([a + (b - a) * i / count + width / 2 * ((j - 1) * y + (k - 1) * z) for i, j, k in places])
    number = {place: n for n, place in enumerate(places, 1)}
    lines = [
        "*NODE",
        *(f"{n}, {', '.join(f'{v:.12e}' for v in p)}" for n, p in enumerate(nodes, 1)),
        "*ELEMENT, TYPE=C3D8I, ELSET=EALL",
    ]
    face = [(0, 0), (1, 0), (1, 1), (0, 1)]
    for n, (i, j, k) in enumerate(((i, j, k) for i in range(count) for j in range(2) for k in range(2)), 1):
        corners = [number[i + d, j + s, k + t] for d in (0, 1) for s, t in face]
        lines.append(f"{n}, {', '.join(map(str, corners))}")
    sections = {f"S{i}": [number[i, j, k] for j in range(3) for k in range(3)] for i in range(count + 1)}
    return "\n".join(lines) + "\n", sections, nodes


def run_ccx(folder: Path, deck: str) -> list[dict[int, np.ndarray]]:
    """Reactions by node, step by step."""
    if shutil.which("ccx") is None:
        pytest.skip("no ccx here (Debian: calculix-ccx)")
    (folder / "rod.inp").write_text(deck)
    ran = subprocess.run(["ccx", "rod"], cwd=folder, capture_output=True, text=True, check=False)
    assert "Job finished" in ran.stdout, ran.stdout[-3000:]
    steps: list[dict[int, np.ndarray]] = []
    time = ""
    for block in re.split(r"\n(?= forces)", (folder / "rod.dat").read_text()):
        head = re.match(r" forces \(fx,fy,fz\) for set (\w+) and time\s+(\S+)", block)
        if head:
            if head[2] != time:
                steps.append({})
                time = head[2]
            for line in block.splitlines()[1:]:
                parts = line.split()
                if len(parts) == 4 and parts[0].isdigit():
                    steps[-1][int(parts[0])] = np.array(parts[1:], dtype=float)
    return steps


SECTIONS = 8
"""Elements along the bar."""


def model_of(body: mg.FreeBody, coupled: dict[int, str], arms: int, density: float) -> tuple[str, np.ndarray]:
    """A bar from B to C held at its section at C; the nodes of the deck, and ``arms`` more of each, are coupled to others."""
    mesh, sections, nodes = bar(body["B"].point, body["C"].point, 0.01, SECTIONS)
    lines = [mesh.rstrip(), "*NSET, NSET=HELD", ", ".join(map(str, sections[f"S{SECTIONS}"]))]
    for node, section in coupled.items():
        lines += [f"*NSET, NSET={section}", ", ".join(map(str, sections[section]))]
        lines += [", ".join(str(node + 1 + i) for i in range(arms))] * bool(arms)
        lines += [f"*SURFACE, NAME=F{section}, TYPE=NODE", section]
        lines += [f"*COUPLING, REF NODE={node}, SURFACE=F{section}, CONSTRAINT NAME=C{section}", "*KINEMATIC", "1, 3"]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", "2.1e11, 0.3", "*DENSITY", f"{density:.12e}"]
    lines += ["*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL", "*BOUNDARY", "HELD, 1, 3"]
    return "\n".join(lines) + "\n", nodes


@pytest.mark.parametrize(
    ("inertia", "couples", "at"),
    [("wrench", None, [5, 16]), ("wrench", 0.005, [5, 16]), ("acceleration", None, [5]), ("acceleration", None, [16])],
)
def test_a_finite_element_program_finds_our_reaction(
    tmp_path: Path, inertia: str, couples: float | None, at: list[int]
) -> None:
    """The rod held at C, all else applied: what CalculiX finds at C is what we wrote for it, force and moment."""
    m = mg.load("haug-slider-crank")
    rod = uniform_bar(m.link("rod"), m.pair("B").point, m.pair("C").point, 0.01)
    m = m.replace(links=[rod if link.name == "rod" else link for link in m.links], loads=[mg.Gravity((0, 0, -9.81))])
    body = mg.free_body(mg.solve(m, {"A": mg.Motion(TURN, 30.0, 400.0)}), "rod")
    body.write(tmp_path / "deck.inp", at=at, model="model.inp", held="C", couples=couples, inertia=inertia)
    text = (tmp_path / "deck.inp").read_text()
    number = {one.name: n for n, x in deck_of(text)[0].items() for one in body.acting if tuple(x) == one.point}
    length = np.linalg.norm(np.subtract(body["B"].point, body["C"].point))
    coupled = {number["B"]: "S0", number["inertia"]: f"S{SECTIONS // 2}"}
    model, nodes = model_of(body, coupled, 0 if couples is None else 6, rod.mass / (length * 0.01**2))
    (tmp_path / "model.inp").write_text(model)
    found = run_ccx(tmp_path, text.replace("*NODE FILE", "*NODE PRINT, NSET=HELD\nRF\n*NODE FILE"))
    assert len(found) == len(at)
    for step, position in zip(found, at, strict=True):
        held = {n: f for n, f in step.items() if n <= len(nodes)}
        if (
            inertia == "acceleration"
        ):  # what CalculiX prints of a held node is its reaction and the load of the elements on it
            field = field_of(body, position, rod)
            loaded = loads_of_last_elements(nodes, rod.mass / SECTIONS / 4, field)
            held = {n: f - loaded[n] for n, f in held.items()}
        assert len(held) == 9
        force = sum(held.values())
        moment = sum(np.cross(nodes[n - 1] - body["C"].point, f) for n, f in held.items())
        largest = np.abs(body["C"].force).max()
        np.testing.assert_allclose(force, body["C"].force[position], atol=2e-6 * largest)
        np.testing.assert_allclose(moment, body["C"].moment[position], atol=1e-5 * length * largest)


def test_loads_of_elements_are_written_one_position_a_file(tmp_path: Path) -> None:
    """CalculiX 2.20 keeps the axis of a CENTRIF load from the first step."""
    with pytest.raises(mg.DeclarationError, match="one, as CalculiX takes the axis of CENTRIF"):
        mg.free_body(crank_slider(), "rod").write(tmp_path / "x.inp", at=[5, 16], inertia="acceleration")


def field_of(body: mg.FreeBody, position: int, link: mg.Link) -> Callable[[np.ndarray], np.ndarray]:
    """Weight and inertia of a unit of mass at a point, without the part of the angular acceleration."""
    a, w, _ = body.acceleration[position].reshape(3, 3)
    g = body["loads[0] gravity"].force[position] / link.mass
    return lambda r: g - a - np.cross(w, np.cross(w, r - link.center))


def loads_of_last_elements(
    nodes: np.ndarray, mass: float, field: Callable[[np.ndarray], np.ndarray]
) -> dict[int, np.ndarray]:
    """What a field of acceleration does to the nodes of the last section through the four elements of that ``mass`` before it."""
    out: dict[int, np.ndarray] = {n: np.zeros(3) for n in range(len(nodes) - 8, len(nodes) + 1)}
    gauss = 0.5 - 0.5 / np.sqrt(3), 0.5 + 0.5 / np.sqrt(3)
    first = len(nodes) - 18
    for j, k in itertools.product((0, 1), (0, 1)):
        corners = {
            (d, e, f): first + 9 * d + 3 * (j + e) + k + f + 1 for d, e, f in itertools.product((0, 1), repeat=3)
        }
        for at in itertools.product(gauss, repeat=3):
            shape = {c: np.prod([x if one else 1 - x for x, one in zip(at, c, strict=True)]) for c in corners}
            r = sum(shape[c] * nodes[n - 1] for c, n in corners.items())
            for c, n in corners.items():
                if n in out:
                    out[n] = out[n] + shape[c] * mass / 8 * field(r)
    return out


def uniform_bar(link: mg.Link, a: Sequence[float], b: Sequence[float], width: float) -> mg.Link:
    """The link as a square bar of its mass between two points."""
    x = np.subtract(b, a)
    length = np.linalg.norm(x)
    along = np.outer(x, x) / length**2
    I = link.mass / 12 * (2 * width**2 * along + (length**2 + width**2) * (np.eye(3) - along))
    return mg.Link(link.name, link.mass, tuple((np.asarray(a) + b) / 2), I)


def test_what_is_unique_of_a_planar_model_has_its_size_in_any_frame():
    """In the plane of motion: of the components there where the frame lies in it, and the same after any turn."""
    m, turn = mg.load("four-bar").replace(drives=["A"]), np.eye(4)
    turn[:3, :3] = Rotation.from_rotvec((0.3, 0.5, -0.7)).as_matrix()
    s, turned = (mg.solve(one, {"A": mg.Motion(np.linspace(0, 1, 4), 3.0)}) for one in (m, m.moved(turn)))
    for pair in m.pairs:
        assert np.isnan(turned[pair.name].force).all()
        expected = np.linalg.norm(s[pair.name].force[:, :2], axis=1)
        np.testing.assert_allclose(s[pair.name].magnitude, expected, rtol=1e-13)
        np.testing.assert_allclose(turned[pair.name].magnitude, expected, rtol=1e-12)
    body = mg.free_body(turned, "crank")
    ranges = {(r.name, r.component): r.greatest for r in body.envelope()}
    assert ranges["B", "|F|"] == pytest.approx(s["B"].magnitude.max(), rel=1e-12)
    assert np.isnan(ranges["B", "Fx"])
    assert ranges["A", "|M|"] == pytest.approx(np.abs(s["A"].effort).max(), rel=1e-12)
    assert "All that a planar model has is unique" in str(body)


def test_where_every_direction_is_open_no_size_is_unique():
    """Two hinges on one axis share force and moment as they like; those of least norm have a size."""
    door = [mg.Pair(n, "R", "f", "d", point=(0, 0, z), axis=(0, 0, 1)) for n, z in (("A", 0.0), ("B", 1.0))]
    load = mg.Wrench("d", force=(3.0, 4.0, 5.0), point=(0, 0, 0.5))
    m = mg.Mechanism("m", None, door, ["A"], [load])
    assert np.isnan(mg.solve(m, {"A": 0.0})["A"].magnitude)
    least = mg.solve(m, {"A": 0.0}, redundant="minimum_norm")["A"]
    assert least.magnitude == pytest.approx(np.linalg.norm(least.force))


def test_rounding_is_no_load_case():
    m = mg.load("four-bar").replace(drives=["A"])
    body = mg.free_body(mg.solve(m, {"A": mg.Motion(np.linspace(0, 1, 4), 3.0)}), "crank")
    told = {why for case in body.cases() for why in case.why}
    assert told <= {"greatest force of A", "greatest force of B", "greatest moment of A"}
    assert "e-1" not in str(body)
