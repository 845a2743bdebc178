"""The forty closed forms that machine elements and planar machines are accepted by: ``python tests/test_elements.py`` prints them all.

Sources: ISO 21771:2007 (gears); Niemann and Winter, Maschinenelemente II, 2003 (planets); Shigley and Mischke, Mechanical Engineering
Design, 1989, chapter 17 (belts); Norton, Cam Design and Manufacturing Handbook, 2009 (cams); Norton, Design of Machinery (slider-crank).
"""

import pathlib
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import test_belts as belts
import test_cams as cams
import test_meshes as meshes
import test_planar as flat

import mechgraph as mg

X, Y, Z = np.eye(3)
RAD, DEG = np.deg2rad, np.rad2deg
FULL = RAD(20.0)
Row = tuple[str, Any, Any, float]
"""What, the number expected, the number found, by how much both may differ: half the last digit of a rounded one."""
NUMBERS: dict[int, tuple[str, Callable[[], Iterator[Row]]]] = {}


def number(n: int, title: str) -> Callable[[Callable[[], Iterator[Row]]], Callable[[], Iterator[Row]]]:
    """One of the forty."""

    def keep(rows: Callable[[], Iterator[Row]]) -> Callable[[], Iterator[Row]]:
        NUMBERS[n] = title, rows
        return rows

    return keep


def refused(make: Callable[[], Any], words: str) -> Row:
    """A declaration that is refused with words."""
    try:
        make()
    except mg.DeclarationError as error:
        return f"refused: {words}", 1, int(words in str(error)), 0.0
    return f"refused: {words}", 1, 0, 0.0


def _slope(f: Callable[[float], float], h: float) -> float:
    """A derivative at zero by differences of the sixth order."""
    return sum(c * (f(k * h) - f(-k * h)) for k, c in ((1, 45), (2, -9), (3, 1))) / (60 * h)


def largest(v: Any) -> float:
    """The largest absolute value."""
    return float(np.abs(v).max())


# --- planar --------------------------------------------------------------------------------------------------------------


@number(1, "four-bar: count, redundancy, unknowns, equations")
def _() -> Iterator[Row]:
    r = mg.check(flat.four_bar())
    yield "count", 1, r.mobility_by_count, 0
    yield "redundancy", 0, r.redundancy, 0
    total = r.ledger().by_kind.values()
    yield "unknowns", 9, sum(row.unknowns for row in total), 0
    yield "equations", 9, sum(row.equations for row in total), 0


@number(2, "forces of every planar library mechanism, planar less spatial")
def _() -> Iterator[Row]:
    for name in flat.PLANAR:
        m = mg.load(name)
        drive = m.drives[0].freedom if m.drives else mg.check(m).drivable[0].freedoms[0]
        at = m.start.get(m.full_name(drive), 0.0) + np.linspace(0, 0.05, 3)
        motions = {d.freedom: m.start.get(m.full_name(d.freedom), 0.0) + np.linspace(0, 0.05, 3) for d in m.drives} | {
            drive: at
        }
        given = {k: mg.Motion(q, velocity=1.3, acceleration=0.4) for k, q in motions.items()}
        one, other = mg.solve(m, given), mg.solve(m.to_planar(), given, method="newton_euler")
        if mg.check(m.to_planar()).redundancy:
            continue
        known = [np.nan_to_num(one[p.name].magnitude) for p in m.pairs]
        found = [np.where(np.isnan(one[p.name].magnitude), 0.0, other[p.name].magnitude) for p in m.pairs]
        size = max(1.0, largest(known))
        yield name, 0.0, largest(np.subtract(found, known)) / size, 1e-11


@number(3, "slider-crank r .05, l .15, 60 deg, F 1000")
def _() -> Iterator[Row]:
    s, p = mg.solve(flat.slider_crank(), {"A": RAD(60)}), np.arcsin(np.sin(RAD(60)) / 3)
    torque = 50.0 * (np.sin(RAD(60)) + np.tan(p) * np.cos(RAD(60)))
    yield "torque, closed form", torque, abs(s["A"].effort[0]), 1e-9
    yield "torque", 50.8390, abs(s["A"].effort[0]), 1e-4  # the printed number is cut off, not rounded
    yield "guide", 301.5113, s["D"].magnitude, 5e-5


@number(4, "pose 1e5 lengths away: same verdict")
def _() -> Iterator[Row]:
    pose = np.eye(4)
    pose[:2, :2], pose[:2, 3] = [[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]], 1e5
    m = flat.four_bar()
    yield "same verdict", 1, int(mg.check(m.moved(pose)).verdict == mg.check(m).verdict), 0


@number(5, "parallel cranks, three")
def _() -> Iterator[Row]:
    yield "redundancy", 1, mg.check(flat.cranks(3)).redundancy, 0


@number(6, "S, U, H, R along x: refused with the remedy")
def _() -> Iterator[Row]:
    for symbol, more, take in (
        ("S", {}, "take R"),
        ("U", {"axis": Z}, "take R"),
        ("H", {"axis": Z, "lead": 0.01}, "take R"),
        ("R", {"axis": X}, "take W"),
        ("C", {"axis": X}, "take P"),
        ("E", {"axis": Z}, "take Fr"),
    ):
        pair = mg.Pair("A", symbol, "frame", "b", point=(0, 0, 0), **more)
        yield refused(lambda pair=pair: mg.Mechanism("m", pairs=[pair], planar=True), take)


@number(7, "to_spatial, to_planar: equal; TOML, command line")
def _() -> Iterator[Row]:
    m = flat.four_bar()
    yield "there and back", 1, int(m.to_spatial().to_planar() == m), 0
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "m.toml"
        mg.save(m, path)
        yield "file", 1, int(mg.load(path) == m and "planar = true" in path.read_text()), 0
        mg.save(m.to_spatial(), path)
        call = [sys.executable, "-m", "mechgraph", "check", str(path), "--planar"]
        told = subprocess.run(call, capture_output=True, text=True, check=True, timeout=60).stdout
    yield "command line", 1, int("Determinate (planar): 1 driver, 9 unknowns, 9 equations" in " ".join(told.split())), 0


@number(8, "response, frequencies, assemblies as spatial")
def _() -> Iterator[Row]:
    m = flat.four_bar().replace(drives=[], loads=[mg.Gravity((0, -9.81))])
    ends = [mg.respond(one, (0, 0.3))["A"].position[-1, 0] for one in (m, m.to_spatial())]
    yield "response", ends[1], ends[0], 1e-7
    rest = [mg.linearize(mg.equilibrium(one)).frequencies[0] for one in (m, m.to_spatial())]
    yield "frequency", rest[1], rest[0], 1e-9
    found = [mg.assemblies(one, {"A": 0.3}).coordinates for one in (flat.four_bar(), flat.four_bar().to_spatial())]
    yield "assemblies", 0.0, largest(np.subtract(*found)), 1e-9


@number(9, "engines and methods equal; no slower than spatial")
def _() -> Iterator[Row]:
    m, turn = flat.four_bar(), {"A": mg.Motion(np.linspace(0, 2 * np.pi, 360, endpoint=False), velocity=5.0)}
    first = mg.solve(m, turn)["C"].force
    for engine in flat.ENGINES:
        for method in flat.METHODS:
            force = mg.solve(m, turn, engine=engine, method=method)["C"].force
            yield f"{engine}, {method}", 0.0, largest(force - first) / largest(first), 1e-10
    twin = m.to_spatial()
    for engine in flat.ENGINES:
        seconds: dict[bool, list[float]] = {False: [], True: []}
        for _ in range(8):
            for one in (m, twin):
                begin = time.process_time()
                mg.solve(one, turn, engine=engine)
                seconds[one is m].append(time.process_time() - begin)
        over = min(seconds[True]) / min(seconds[False])  # .93 sparse, .91 dense, .93 compiled
        yield f"time over spatial, {engine}: at most 1.2 on a noisy machine", 1.0, max(1.0, over), 0.2


# --- gears ---------------------------------------------------------------------------------------------------------------


@number(10, "12/24 teeth, m 3, a 56.5")
def _() -> Iterator[Row]:
    f = meshes.facts(meshes.spur((12, 24), 56.5, 3.0, shift=(0.6, 0.36)))
    yield "working angle", 26.08883, DEG(f.working_angle), 5e-6
    yield "sum of shifts", 0.960056, f.asked_shifts, 5e-7
    yield "tip circle a", 44.84, 2 * f.tip_radii[0], 1e-9
    yield "tip circle b", 79.40, 2 * f.tip_radii[1], 1e-9
    yield "contact ratio", 1.202119, f.contact_ratio, 1e-6


@number(11, "20/40, m 2, at 60 and 61.2")
def _() -> Iterator[Row]:
    yield "contact ratio", 1.635186, meshes.facts(meshes.spur(distance=60.0, module=2.0)).contact_ratio, 5e-7
    f = meshes.facts(meshes.spur(distance=61.2, module=2.0))
    yield "working angle", 22.88794, DEG(f.working_angle), 5e-6
    yield "backlash", 0.954013, f.backlash, 5e-7
    for distance in (0.06, 0.0612):
        m, a, _ = meshes.stage(meshes.spur(distance=distance))
        m = m.replace(loads=[mg.Effort(m.loads[0].freedom, -3.0)])
        yield (
            f"force at {distance}",
            3.0 / (0.04 * np.cos(FULL)),
            mg.solve(m, {a: 0.3}).coupling("m").normal_force,
            1e-9,
        )
    yield "force", 79.81333, mg.solve(m, {a: 0.3}).coupling("m").normal_force, 5e-6


@number(12, "undercut")
def _() -> Iterator[Row]:
    yield "least teeth", 17.09726, 12 / (1 - meshes.facts(meshes.spur((12, 24), 54.0, 3.0)).undercut[0]), 5e-6
    yield "least shift of 12", 0.298133, meshes.facts(meshes.spur((12, 24), 54.0, 3.0)).undercut[0], 5e-7


@number(13, "helix 15 deg")
def _() -> Iterator[Row]:
    b = RAD(15)
    f = meshes.facts(meshes.spur(distance=60 / np.cos(b), module=2.0, helix=b, width=(30.0, 40.0)))
    yield "transverse angle", 20.64690, DEG(f.working_angle), 5e-6
    yield "overlap", 30 * np.sin(b) / (2 * np.pi), f.overlap_ratio, 1e-9


@number(14, "ring 30/84")
def _() -> Iterator[Row]:
    f = meshes.facts(meshes.spur((30, 84), 54.0, 2.0, internal=(False, True)))
    yield "contact ratio", 1.930568, f.contact_ratio, 5e-7
    tip = np.arccos(84 * np.cos(FULL) / 82)
    yield "1 - tan aa / tan a", 0.226845, 1 - np.tan(tip) / np.tan(FULL), 5e-7
    ring = lambda z: meshes.facts(meshes.spur((z, 84), 84.0 - z, 2.0, internal=(False, True))).faults
    yield (
        "interferes at 19, not at 20",
        1,
        int("interfere" in " ".join(ring(19)) and "interfere" not in " ".join(ring(20))),
        0,
    )


def _shares(degrees: tuple[float, ...]) -> np.ndarray:
    s = mg.solve(meshes.planetary(RAD(degrees)), {"C": 0.3})
    return np.abs([s.coupling(f"s{i}").effort for i in range(3)]) * 0.024 * np.cos(FULL) / 7.0


@number(15, "floating sun: shares of three planets")
def _() -> Iterator[Row]:
    for share in _shares((0, 120, 240)):
        yield "at 120", 1 / 3, share, 1e-9
    for known, share in zip((0.2578, 0.3473, 0.3949), _shares((0, 100, 240)), strict=True):
        yield "at 0, 100, 240", known, share, 5e-5
    opposite = np.sin(RAD(np.array([140.0, 120.0, 100.0])))
    yield "sines of the opposite angles", 0.0, largest(_shares((0, 100, 240)) - opposite / opposite.sum()), 1e-9


@number(16, "sun in R")
def _() -> Iterator[Row]:
    yield "redundancy", 2, mg.check(meshes.planetary(RAD([0, 120, 240]), "R")).redundancy, 0


@number(17, "20/17/54 by 3")
def _() -> Iterator[Row]:
    for known, found in zip((0.0, 121.6216, 238.3784), DEG(mg.planet_places(20, 54, 3)), strict=True):
        yield "place", known, found, 5e-5
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        meshes.planetary(RAD([0, 120, 240]), teeth=(20, 17, 54))
    yield "warned at 120", 1, int(any("cannot both be put in" in str(w.message) for w in told)), 0


@number(18, "6 planets of 24/30")
def _() -> Iterator[Row]:
    yield refused(lambda: mg.planet_places(24, 84, 6), "= 27; expected more than 32")


@number(19, "helical gears on balls: S takes all thrust")
def _() -> Iterator[Row]:
    b = 0.3
    gears = meshes.spur(distance=0.06 / np.cos(b), helix=b)
    m, q, _ = meshes.stage(gears, "S")
    s = mg.solve(m, {q: 0.4})
    yield "2 T tan b / d", 3.0 * np.tan(b) / gears[1].radius, abs(s["BS"].force[2]), 1e-9
    yield "groove", 0.0, abs(s["BG"].force[2]), 1e-9


@number(20, "middle shaft of one hand without thrust")
def _() -> Iterator[Row]:
    b2 = np.arctan(np.tan(FULL) * 40 / 100)
    yield "helix for diameters 100 and 40", 8.2834, DEG(b2), 5e-5
    mb, mc = 0.002 * np.cos(FULL), 0.002 * np.cos(b2)
    gears = [
        mg.Gear("a", "one", 25, (0, 0, 0), Z, module=mb, helix_angle=-FULL),
        mg.Gear("b", "two", 50, (0.075, 0, 0), Z, module=mb, helix_angle=FULL),
        mg.Gear("c", "two", 20, (0.075, 0, 0.03), Z, module=mc, helix_angle=b2),
        mg.Gear("d", "three", 40, (0.135, 0, 0.03), Z, module=mc, helix_angle=-b2),
    ]
    shafts = [
        meshes.on_bearings(n, gears[i].link, gears[i].point, Z, "S")[0] for n, i in (("A", 0), ("B", 1), ("D", 3))
    ]
    m = mg.Mechanism(
        "shaft", pairs=[p for shaft in shafts for p in shaft], gears=gears, drives=["A.Rz"], loads=[mg.Effort("D.Rz", 5.0)],
        couplings=[mg.Mesh("m1", "a", "b"), mg.Mesh("m2", "c", "d")],
    )  # fmt: skip
    yield "thrust", 0.0, abs(mg.solve(m, {"A.Rz": 0.4})["BS"].force[2]), 1e-9


@number(21, "screw gears 45/45 deg, 20/20, m 2")
def _() -> Iterator[Row]:
    gears = meshes.KINDS["screw"][0]
    yield "distance", 56.5685, 1000 * gears[1].point[1], 5e-5
    m, q, _ = meshes.stage(gears)
    s = mg.solve(m, {q: mg.Motion(0.2, 100.0)})
    yield "sliding", 4.0, np.linalg.norm(s.coupling("m").sliding), 1e-9


@number(22, "mesh = Sp along its line of action")
def _() -> Iterator[Row]:
    m, q, _ = meshes.stage(meshes.spur(distance=0.06 / np.cos(0.3), helix=0.3), "S")
    s = mg.solve(m, {q: 0.0})
    c = s.coupling("m")
    plane = mg.Pair("K", "Sp", "one", "two", point=c.point, axis=c.force)
    alone = mg.solve(m.replace(gears=[], couplings=[], pairs=[*m.pairs, plane]), {q: 0.0})
    worst = max(largest(alone[p.name].force - s[p.name].force) for p in m.pairs if p.type.symbol != "Fr")
    yield "bearings", 0.0, worst / largest(c.force), 1e-9


@number(23, "gradient of the position relation = n")
def _() -> Iterator[Row]:
    one, two = (
        mg.Gear(k, k, z, (0, 0, 0), Z, module=2.0, helix_angle=h) for k, z, h in (("a", 20, 0.3), ("b", 60, -0.3))
    )
    d = (one.base_radius + two.base_radius) / np.cos(0.45)
    made = meshes.kinds.Parallel(
        one, two, meshes.place((1, 2, 0.3), Z, X), meshes.place((1 + 0.6 * d, 2 + 0.8 * d, 1), Z, Y)
    )
    relation, numbers = made.flanks(True)[0], np.array(made.numbers)[:, None, None]
    at = relation(made.a, made.b, numbers)
    P, n = at.point[:, 0, 0], at.along[:, 0, 0]
    for w, v in ((Z, X), (Z, Y), (2 * Z, Z)):
        value = lambda h, w=w, v=v: relation(made.a, meshes.moved(made.b, w, v, h), numbers).value[0, 0]
        yield f"w {w}, v {v}", n @ (v + np.cross(w, P)), _slope(value, 1e-3), 1e-9


@number(24, "two involutes (Kc) = mesh, moving centers")
def _() -> Iterator[Row]:
    d, w = 0.0502, np.arccos(0.05 * np.cos(FULL) / 0.0502)
    pairs = [
        mg.Pair("A", "R", "frame", "one", point=(0, 0, 0), axis=Z),
        mg.Pair("P", "P", "frame", "slide", point=(d, 0, 0), axis=X),
        mg.Pair("B", "R", "slide", "two", point=(d, 0, 0), axis=Z),
    ]
    gears = [mg.Gear(k, k, n, (x, 0, 0), Z, module=0.002) for k, n, x in (("one", 20, 0), ("two", 30, d))]
    more = {"drives": ["A", "P"], "loads": [mg.Effort("B", 2.0)]}
    mesh = mg.Mechanism("mesh", pairs=pairs, gears=gears, couplings=[mg.Mesh("m", "one", "two")], **more)
    one, two = meshes.involutes(d, w)
    at = (0.02 * np.cos(FULL) / np.cos(w), 0, 0)
    touch = mg.Pair("K", "Kc", "one", "two", curve=one, curve_b=two, point=at, closed="form")
    flanks = mg.Mechanism("flanks", pairs=[*pairs, touch], **more)
    given = {"A": np.linspace(0, 0.08, 5), "P": 0.0008 * np.linspace(0, 1, 5) ** 2}
    s, k = mg.solve(mesh, given), mg.solve(flanks, given)
    yield "positions", 0.0, largest(s["B"].position - k["B"].position), 1e-9
    yield "normal force", 0.0, largest(np.abs(s.coupling("m").effort) / np.abs(k.contact("K").normal_force) - 1), 1e-7
    yield "effort of the slide", 0.0, largest(s["P"].effort - k["P"].effort), 1e-7


@number(25, "Willis; ratios unchanged through Gear")
def _() -> Iterator[Row]:
    s = mg.solve(meshes.planetary(RAD([0, 120, 240])), {"C": 0.3})
    yield "sun", 0.3 * (1 + 84 / 24), s["S"].position[2], 1e-9
    yield "torque of the carrier", 7.0 * (1 + 84 / 24), s["C"].effort[0], 1e-9
    at = {"A": (0, 0, 0), "B": (0.06, 0, 0)}
    pairs = [mg.Pair(k, "R", "frame", k, point=p, axis=Z) for k, p in at.items()]
    gears = [mg.Gear(k, k, n, at[k], Z, module=0.002) for k, n in (("A", 20), ("B", 40))]
    short, placed = (
        mg.Mechanism("m", pairs=pairs, drives=["A"], loads=[mg.Effort("B", -3.0)], **own)
        for own in (
            {"couplings": [mg.SpurGears("g", "A", "B", teeth=(20, 40))]},
            {"gears": gears, "couplings": [mg.Mesh("g", "A", "B")]},
        )
    )
    yield "ratio", mg.check(short).ratios["B.Rz"]["A.Rz"], mg.check(placed).ratios["B.Rz"]["A.Rz"], 1e-12
    F = [mg.solve(m, {"A": 0.3}).coupling("g").force for m in (short, placed)]
    yield "force", 0.0, largest(F[0] - F[1]), 1e-10
    ratios = [mg.mesh_facts(m)["g"].contact_ratio for m in (short, placed)]
    yield "contact ratio", ratios[1], ratios[0], 1e-12
    turn = {"A": mg.Motion(0.0, 1.0, 0.5)}
    bars = [mg.kinematics(m.equivalent(), turn)["B"] for m in (short, placed)]
    for q in bars:
        yield "linkage in its place, rate", -0.5, q.velocity[0], 1e-12
        yield "linkage in its place, acceleration", -0.25, q.acceleration[0], 1e-9


@number(26, "spur to helical continuous; rack = wheel of radius 1e6")
def _() -> Iterator[Row]:
    thrust = [
        mg.solve(meshes.stage(meshes.spur(distance=0.06 / np.cos(b), helix=b), "S")[0], {"A.Rz": 0.4})
        .coupling("m")
        .force
        for b in (0.0, 1e-9)
    ]
    yield "force at a helix of 1e-9", 0.0, largest(thrust[0] - thrust[1]), 1e-6
    s, wheel = (mg.solve(m, {"A": 0.7}) for m in (meshes.rack(), meshes.rack(wheel=10**9)))
    yield "rack", 0.0, largest(s.coupling("m").force - wheel.coupling("m").force), 1e-6


@number(27, "open and crossed belt 20/40, pitch 5, C 200")
def _() -> Iterator[Row]:
    at = {"p": (0.0, 0.0), "w": (200.0, 0.0)}
    own, crossed = (
        mg.solve(belts.drive(at, belts.RADII, backs=backs), {"p": 0.1}).coupling("B") for backs in ((), ("w",))
    )
    yield "length", 551.2672, own.length, 5e-5
    yield "wrap", 170.8714, DEG(own.wrap["p"]), 5e-5
    yield "crossed", 561.4537, crossed.length, 5e-5


@number(28, "pretension T0: T0 +- M / 2r")
def _() -> Iterator[Row]:
    m = belts.drive(pretension=300.0, loads=[mg.Effort("w", 7.0)])
    T = mg.solve(m, {"p": 0.1}).coupling("B").tension
    yield "tight", 300 + 7.0 / 0.1, T["p-w"], 1e-9
    yield "loose", 300 - 7.0 / 0.1, T["w-p"], 1e-9
    bare = mg.check(m.replace(couplings=[])).redundancy
    yield "redundancy of the belt", 1, mg.check(m).redundancy - bare, 0


@number(29, "tensioner: tension = couple over the arms of both strands")
def _() -> Iterator[Row]:
    for load in (6.0, -6.0):
        b = mg.solve(belts.tensioner([mg.Effort("arm", 12.0), mg.Effort("w", load)]), {"p": 2.0}).coupling("B")
        moment = 0.0
        for name, sense in (("w-i", -1.0), ("i-p", 1.0)):
            start, end = b.ends[name]
            moment += sense * np.cross(start - [0.35, 0.1, 0], (end - start) / b.span[name])[2]
        yield f"load {load:g}", -12.0 / moment, b.tension["w-i"], 1e-9 * abs(12.0 / moment)


@number(30, "row of a span: arm rate = -(dL/dx) / (dL/dpsi)")
def _() -> Iterator[Row]:
    s = mg.solve(belts.on_a_slide(), {"x": mg.Motion([0.0, 0.004], 0.1), "p": mg.Motion([0.0, 0.002], 0.0)})

    def length(x: float, psi: float) -> float:
        turn = np.array([[np.cos(psi), -np.sin(psi)], [np.sin(psi), np.cos(psi)]])
        idler = np.array([0.35, 0.1]) + turn @ [-0.15, -0.05]
        return float(
            belts.course(belts.at((0.4 + x, 0), idler, (0, 0)), belts.UP, np.array([0.1, -0.04, 0.05])).length[0]
        )

    psi = s["arm"].position[1, 0]
    dx, dpsi = _slope(lambda e: length(0.004 + e, psi), 1e-4), _slope(lambda e: length(0.004, psi + e), 1e-4)
    yield "rate", -0.1 * dx / dpsi, s["arm"].velocity[1, 0], 1e-9
    yield "length", length(0, 0), length(0.004, psi), 1e-9


@number(31, "1000 gears in 1 s")
def _() -> Iterator[Row]:
    def seconds(n: int) -> tuple[float, float]:
        """Of processor: for the declaration, and for a check and a replacement."""
        at = [(0.04 * i, 0, 0) for i in range(n)]
        pairs = [mg.Pair(f"P{i}", "R", "frame", f"w{i}", point=p, axis=Z) for i, p in enumerate(at)]
        gears = [mg.Gear(f"g{i}", f"w{i}", 20, p, Z, module=0.002) for i, p in enumerate(at)]
        meshed = [mg.Mesh(f"m{i}", f"g{i}", f"g{i + 1}") for i in range(n - 1)]
        begin = time.process_time()
        m = mg.Mechanism("train", pairs=pairs, gears=gears, couplings=meshed, drives=["P0"])
        declared = time.process_time()
        assert mg.check(m).determinate
        m.replace(couplings=m.couplings[:-1])
        return declared - begin, time.process_time() - declared

    few, many = (np.min([seconds(n) for _ in range(3)], axis=0) for n in (500, 1000))
    for what, one, two in zip(("declaration", "check and replacement"), few, many, strict=True):
        yield f"{what}: seconds of processor, at most 1 (.55)", 0.5, two, 0.5
        yield f"{what}, twice the gears: times the time, at most 3 (2.1)", 1.5, two / one, 1.5


# --- cams ----------------------------------------------------------------------------------------------------------------


@number(32, "factors of the laws")
def _() -> Iterator[Row]:
    for name, known in cams.TABLE.items():
        for what, one, other in zip(("Cv", "Ca", "Cj"), known, mg.cam_laws()[name], strict=True):
            if np.isfinite(one):
                yield f"{name} {what}", one, other, 1e-9
    for shares, printed in (((1 / 3,) * 3, (2, 5.278810, 49.751614)), ((0.2, 0, 0.6), (1.527539, 5.998630, 94.226265))):
        law = cams.double_dwell("scca", sine=shares[0], constant=shares[1], cosine=shares[2])
        for one, other in zip(printed, law.factors[0], strict=True):
            yield "scca", one, other, 5e-7
        yield "scca, formula", 0.0, largest(np.subtract(law.factors[0], cams.neklutin(*shares))), 1e-9


@number(33, "prime circle 50, cycloidal 20 in 120 deg")
def _() -> Iterator[Row]:
    law, u = cams.double_dwell(rise=20.0), np.linspace(0, RAD(120), 20001)
    cam = mg.Curve.cam(law=law, base_radius=40.0, roller_radius=10.0)
    s, v = law.at(u)[:2]
    yield "atan(s' / (50 + s))", 0.0, largest(cam.facts(u).pressure_angle - np.arctan(np.abs(v) / (50 + s))), 1e-9
    yield "pressure angle", 17.84659, DEG(cam.facts(u).pressure_angle.max()), 5e-6
    yield "offset 5", 13.38567, DEG(cam.replace(offset=-5.0).facts(u).pressure_angle.max()), 5e-6
    yield "least prime circle", 24.29011, mg.least_base_radius(law), 5e-6
    whole = cam.facts(np.linspace(0, 2 * np.pi, 20001)).pitch_radius
    yield "least pitch radius", 47.77415, whole[whole > 0].min(), 5e-5


@number(34, "flat face")
def _() -> Iterator[Row]:
    law = cams.double_dwell(rise=20.0)
    yield "least base radius", 10.66399, mg.least_base_radius(law, follower="flat"), 5e-6
    found = mg.Curve.cam(law=law, base_radius=12.0, follower="flat").facts(np.linspace(0, RAD(120), 20001))
    yield "face", 19.09859, found.face, 5e-6


@number(35, "arm: c 120, l 90, r0 50")
def _() -> Iterator[Row]:
    for mirrored in (False, True):
        law, u = cams.double_dwell(rise=0.3), np.linspace(0, 2 * np.pi, 401)
        cam = mg.Curve.arm_cam(law=law, base_radius=40.0, roller_radius=10.0, arm=90.0, pivot=120.0, mirrored=mirrored)
        q, rate = law.at(u)[:2]
        p = np.arccos((120**2 + 90**2 - 50**2) / (2 * 120 * 90)) + q
        tan = np.abs(90 * (1 + (-1 if mirrored else 1) * rate) - 120 * np.cos(p)) / (120 * np.sin(p))
        yield "formula", 0.0, largest(cam.facts(u).pressure_angle - np.arctan(tan)), 1e-9
        yield "dwell", 24.975, DEG(cam.facts(6.2).pressure_angle), 5e-4


@number(36, "barrel and globoid")
def _() -> Iterator[Row]:
    law, R, F = cams.double_dwell("modified_sine", rise=0.03), 0.05, 200.0
    cam, at = mg.Curve.barrel(law=law, radius=R, roller_radius=0.006, second=X), (R, 0, 0)
    m = cams.driven(
        mg.Pair("K", "Rg", "cam", "follower", curve=cam, point=at),
        mg.Pair("B", "P", "frame", "follower", point=at, axis=Z),
        [mg.Wrench("follower", force=(0, 0, -F), point=at)],
    )
    s, rate = mg.solve(m, {"A": cams.TURN}), law.at(cams.TURN.position)[1]
    alpha = np.arctan(np.abs(rate) / R)
    yield "barrel: tan a = s'/R", 0.0, largest(s.contact("K").pressure_angle("follower") - alpha), 1e-9
    yield "N = F / cos a", 0.0, largest(np.abs(s["K"].components["Fy"]) * np.cos(alpha) / F - 1), 1e-9
    yield "torque F s'", 0.0, largest(s["A"].effort[:, 0] - F * rate) / F, 1e-9
    rest = mg.Segment("dwell", over=np.pi - 2.0)
    swing = mg.CamLaw(
        [mg.Segment("modified_sine", 0.6, 2.0), rest, mg.Segment("modified_sine", -0.6, 2.0), rest], start=-0.3
    )
    globoid = mg.Curve.globoid(law=swing, distance=0.1, arm=0.06, roller_radius=0.006, second=X)
    q, rate = swing.at(cams.TURN.position)[:2]
    tan = 0.06 * np.abs(rate) / (0.1 - 0.06 * np.cos(q))
    yield "globoid", 0.0, largest(globoid.facts(cams.TURN.position).pressure_angle - np.arctan(tan)), 1e-9


@number(37, "harmonic 20 mm a turn, .5 kg, 100 rad/s")
def _() -> Iterator[Row]:
    law = mg.CamLaw([mg.Segment("harmonic", 0.02, np.pi), mg.Segment("harmonic", -0.02, np.pi)])
    cam, at = mg.Curve.cam(law=law, base_radius=0.05, roller_radius=0.01, second=Y), (0, 0.06, 0)
    m = cams.driven(
        mg.Pair("K", "Ps", "cam", "follower", curve=cam, point=at, closed="force"),
        mg.Pair("B", "P", "frame", "follower", point=at, axis=Y),
        [],
    ).replace(links=[mg.Link("frame"), mg.Link("cam"), mg.Link("follower", 0.5, at)])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        s = mg.solve(m, {"A": mg.Motion(np.linspace(0, 2 * np.pi, 73), velocity=100.0)})
    yield "preload", 50.0, mg.least_preload(s, "K"), 1e-8
    yield "preload, k 1000", 30.0, mg.least_preload(s, "K", stiffness=1000.0), 1e-8


@number(38, "seam jumps of a modified sine")
def _() -> Iterator[Row]:
    seam = cams.double_dwell("modified_sine").seams[0]
    yield "jerk h Cj / over^3", 0.02 * 16 * np.pi**3 / (np.pi + 4) / RAD(120) ** 3, seam.jump[3], 1e-9
    yield "others", 0.0, largest(seam.jump[:3]), 1e-9


@number(39, "360 points rounded to 10 um, smoothed")
def _() -> Iterator[Row]:
    law, degrees = (
        mg.CamLaw([mg.Segment("harmonic", 0.02, np.pi), mg.Segment("harmonic", -0.02, np.pi)]),
        np.arange(0.0, 360.0),
    )
    read = mg.CamLaw.read({"angle": degrees, "lift": np.round(law.at(RAD(degrees))[0], 5)}, smooth=1e-5)
    u = np.linspace(0, 2 * np.pi, 2001)
    off = largest(read.at(u)[2] - law.at(u)[2]) / largest(law.at(u)[2])
    yield "acceleration, part of the law's: at most .02", 0.01, off, 0.01
    yield "deviation: at most 1e-5", 5e-6, read.deviation, 5.0000001e-6


@number(40, "DXF read back; cutter path less radius = profile")
def _() -> Iterator[Row]:
    cam = cams.SHAPES["cam"]
    s = np.linspace(0, cam.length, 801)
    profile, path = (cam.cutter_path(r).at(s)[0] for r in (0.0, 0.016))
    yield "path less profile", 0.016, np.linalg.norm(path - profile, axis=0).max(), 1e-9
    ezdxf = pytest.importorskip("ezdxf")
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "cam.dxf"
        cam.write(file, error=1e-5, unit="m")
        (entity,) = ezdxf.readfile(file).modelspace().query('*[layer=="PROFILE"]')
        read = np.array([tuple(p) for p in entity.flattening(1e-7, segments=64)])[::31]
    fine = cam.cutter_path(0.0).at(np.linspace(0, cam.length, 100001))[0].T
    yield "DXF, at most the chord error", 0.0, max(np.linalg.norm(fine - p, axis=1).min() for p in read), 1.1e-5


@pytest.mark.daily(3)
@pytest.mark.parametrize("n", sorted(NUMBERS))
def test_a_number_of_the_acceptance(n: int) -> None:
    rows = [(what, float(known), float(found), within) for what, known, found, within in NUMBERS[n][1]()]
    assert rows
    assert not [row for row in rows if not abs(row[2] - row[1]) <= row[3]]


def test_all_forty_are_there() -> None:
    assert sorted(NUMBERS) == list(range(1, 41))


def table() -> Iterator[str]:
    """All numbers: what, expected, found, error; of a number with many rows the worst, and how many they are."""
    for n, (title, rows) in sorted(NUMBERS.items()):
        own = [(what, float(known), float(found), float(within)) for what, known, found, within in rows()]
        yield f"{n} {title}"
        own.sort(key=lambda row: -abs(row[2] - row[1]) / (row[3] or 1e-300))
        for what, known, found, within in own[:5]:
            off = abs(found - known)
            yield f"   {what}: {known:.10g} | {found:.10g} | {off:.2g}{'' if off <= within else '  MISSED'}"
        if len(own) > 5:
            yield f"   and {len(own) - 5} more, each nearer"


if __name__ == "__main__":
    for line in table():
        sys.stdout.write(line + "\n")
