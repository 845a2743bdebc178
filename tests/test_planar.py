"""Planar mechanisms: three equations a link and three rows a loop; the same numbers as their spatial twins have in the plane."""

import json
import pathlib
import pickle
import re
import tomllib

import numpy as np
import pytest
from program import bad, run

import mechgraph as mg

Z = (0, 0, 1)
ENGINES = ("dense", "sparse", "compiled")
METHODS = ("loop_wrench", "newton_euler", "printed")


def four_bar(**more) -> mg.Mechanism:
    """A crank-rocker with masses and loads, declared in the plane."""
    links = [
        mg.Link("frame"),
        mg.Link("crank", 1.0, (0.05, 0.0), 0.001),
        mg.Link("coupler", 2.0, (0.3, 0.2), 0.01, points={"tip": (0.3, 0.35)}),
        mg.Link("rocker", 2.0, (0.5, 0.2), 0.01),
    ]
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0)),
        mg.Pair("B", "R", "crank", "coupler", point=(0.1, 0)),
        mg.Pair("C", "R", "coupler", "rocker", point=(0.5, 0.4)),
        mg.Pair("D", "R", "frame", "rocker", point=(0.5, 0)),
    ]
    loads = [mg.Gravity((0, -9.81)), mg.Wrench("rocker", force=(3, 4), moment=2.0, point=(0.5, 0.3))]
    return mg.Mechanism("bars", links, pairs, ["A"], loads, planar=True, **more)


def slider_crank(r: float = 0.05, length: float = 0.15) -> mg.Mechanism:
    """A slider-crank without mass, the piston pushed towards the crank."""
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0)),
        mg.Pair("B", "R", "crank", "rod", point=(r, 0)),
        mg.Pair("C", "R", "rod", "piston", point=(r + length, 0)),
        mg.Pair("D", "P", "frame", "piston", point=(r + length, 0), axis=(1, 0)),
    ]
    push = mg.Wrench("piston", force=(-1000, 0), point=(r + length, 0))
    return mg.Mechanism("slider-crank", pairs=pairs, drives=["A"], loads=[push], planar=True)


def cranks(count: int) -> mg.Mechanism:
    """A plate on parallel cranks."""
    pairs = [mg.Pair(f"A{i}", "R", "frame", f"crank{i}", point=(i, 0)) for i in range(count)]
    pairs += [mg.Pair(f"B{i}", "R", f"crank{i}", "plate", point=(i, 0.5)) for i in range(count)]
    return mg.Mechanism("cranks", pairs=pairs, drives=["A0"], planar=True)


PLANAR = (
    "andrews", "four-bar", "geneva", "marghitu-2-1", "marghitu-2-2", "marghitu-2-6", "marghitu-2-7", "marghitu-2-8", "slider-crank",
    "windows-2",
)  # fmt: skip
"""The library's mechanisms all of whose pairs move in one plane."""


# --- counts and verdicts -------------------------------------------------------------------------------------------------


def test_a_four_bar_counts_in_its_plane() -> None:
    r = mg.check(four_bar())
    assert (r.mobility_by_count, r.mobility, r.redundancy) == (1, 1, 0)
    assert r.verdict == "Determinate (planar): 1 driver, 9 unknowns, 9 equations; every reaction is unique."
    assert {name: (row.unknowns, row.equations) for name, row in r.ledger().by_kind.items()} == {
        "R": (8, 0), "driver": (1, 0), "link": (0, 9),
    }  # fmt: skip
    assert r.unique["B"] == {"Fx": True, "Fy": True}
    assert r.families.family == 3
    assert not r.advice
    assert "axial" not in r.text(full=True)


def test_a_topology_counts_in_the_plane() -> None:
    pairs = [
        mg.Pair(*ends)
        for ends in (("A", "R", "f", "a"), ("B", "R", "a", "b"), ("C", "R", "b", "c"), ("D", "P", "f", "c"))
    ]
    r = mg.check(mg.Mechanism("sketch", pairs=pairs, drives=["A"], planar=True))
    assert r.verdict == "1 driver, 9 unknowns, 9 equations: determinate in the plane for general geometry (mobility 1)."
    spatial = mg.Mechanism("sketch", pairs=pairs, drives=["A"])
    assert mg.check(spatial.to_planar()).verdict == r.verdict


def test_a_third_parallel_crank_is_redundant_in_the_plane_too() -> None:
    assert mg.check(cranks(2)).redundancy == 0
    r = mg.check(cranks(3))
    assert (r.mobility, r.redundancy, r.mobility_by_count) == (1, 1, 0)
    s = mg.solve(cranks(3), {"A0": 0.3})
    assert not s["B0"].unique["Fy"]
    assert s["B0"].unique["Fx"]


@pytest.mark.parametrize("away", [0.0, 1e5])
def test_the_verdict_does_not_depend_on_the_place(away: float) -> None:
    pose = np.eye(4)
    c, s = np.cos(0.7), np.sin(0.7)
    pose[:2, :2], pose[:2, 3] = [[c, -s], [s, c]], away
    moved = four_bar().moved(pose)
    assert mg.check(moved).verdict == mg.check(four_bar()).verdict
    effort = mg.solve(moved.replace(loads=[]), {"A": mg.Motion(0.4, velocity=3.0)})["A"].effort
    assert effort == pytest.approx(
        mg.solve(four_bar().replace(loads=[]), {"A": mg.Motion(0.4, velocity=3.0)})["A"].effort, rel=1e-6
    )


def test_equations_are_printed_in_the_plane() -> None:
    f = mg.formulate(four_bar())
    assert (len(f.unknowns), len(f.equations), len(f.closure.velocity.equations)) == (9, 9, 3)
    assert "(9)  X0_3z FX_3 + Y0_3z FY_3 + X0_4z FX_4 + Y0_4z FY_4 + M_I3z + M_L3z = 0" in f.text()
    s = mg.solve(four_bar(), {"A": [0.3, 0.9]})
    found = dict(zip([u.name for u in f.unknowns], f.solve(s.state(1)), strict=True))
    assert found["MA_IN"] == pytest.approx(float(s["A"].effort[1, 0]), rel=1e-12)
    assert found["FX_2"] == pytest.approx(float(s["B"].components["Fx"][1]), rel=1e-12)


# --- forces --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("engine", ENGINES)
def test_forces_of_a_slider_crank(engine: str) -> None:
    """Closed form: torque F r (sin t + tan p cos t), guide F tan p, with sin p = r/l sin t (Norton, Design of Machinery, 11)."""
    t, r, length, F = np.radians(60), 0.05, 0.15, 1000.0
    p = np.arcsin(r / length * np.sin(t))
    s = mg.solve(slider_crank(), {"A": t}, engine=engine)
    torque = F * r * (np.sin(t) + np.tan(p) * np.cos(t))
    assert abs(s["A"].effort) == pytest.approx(torque, rel=1e-12)
    assert torque == pytest.approx(50.8390, abs=1e-4)
    assert np.linalg.norm(s["D"].force) == pytest.approx(F * np.tan(p), rel=1e-12)
    assert F * np.tan(p) == pytest.approx(301.5113, abs=1e-4)
    assert set(s["D"].components) == {"Fy", "Mx"}
    assert s.planar
    # about the marker on the guide, from which the piston has gone its way
    assert abs(s["D"].components["Mx"]) == pytest.approx(
        abs(float(s["D"].components["Fy"] * s["D"].position[0])), rel=1e-9
    )
    assert np.abs(s["D"].moment).max() < 1e-9


@pytest.mark.daily(6)
@pytest.mark.parametrize("name", PLANAR)
@pytest.mark.parametrize("engine", ENGINES)
def test_the_planar_twin_has_the_forces_of_the_spatial_one(name: str, engine: str) -> None:
    m = mg.load(name)
    planar = m.to_planar()
    drives = [d.freedom for d in m.drives] or [mg.check(m).drivable[0].freedoms[0]]
    at = {
        f: np.asarray(m.start.get(m.full_name(f), 0.0)) + mg.Motion(np.linspace(0, 0.05, 5), velocity=1.0).position
        for f in drives
    }
    motions = {f: mg.Motion(q, velocity=1.3, acceleration=0.4) for f, q in at.items()}
    try:
        spatial = mg.solve(m, motions, engine=engine)
    except mg.DeclarationError as error:  # a pair on a curve, or a callable: by numpy alone
        assert engine == "compiled"
        with pytest.raises(mg.DeclarationError, match=str(error).splitlines()[-1].strip()[:20].replace("(", ".")):
            mg.solve(planar, motions, engine=engine)
        return
    flat = {method: mg.solve(planar, motions, engine=engine, method=method) for method in METHODS}
    for s in flat.values():
        for pair in m.pairs:
            size = max(1.0, np.nanmax(np.abs(spatial[pair.name].magnitude), initial=0.0))
            known = ~np.isnan(spatial[pair.name].magnitude)
            assert np.abs(s[pair.name].position - spatial[pair.name].position).max() < 1e-11
            if mg.check(planar).redundancy == 0:
                assert not np.isnan(s[pair.name].reaction).any()
                assert (
                    np.abs(np.linalg.norm(s[pair.name].force, axis=-1) - spatial[pair.name].magnitude)[known].max()
                    < 1e-11 * size
                )
            assert not np.nan_to_num(s[pair.name].reaction[..., [0, 1, 5]]).any()
        for f in drives:
            own = m.full_name(f).split(".")[0]
            assert np.abs(s[own].effort - spatial[own].effort).max() < 1e-11 * max(
                1.0, np.abs(spatial[own].effort).max()
            )
        assert s.checks.equilibrium.max() < 1e-11
        assert s.checks.power.max() < 1e-11


def test_components_equal_those_of_the_spatial_one() -> None:
    a = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    m = four_bar()
    spatial = mg.solve(m.to_spatial(), {"A": mg.Motion(a, velocity=5.0)})
    for engine in ENGINES:
        for method in METHODS:
            s = mg.solve(m, {"A": mg.Motion(a, velocity=5.0)}, engine=engine, method=method)
            for pair in "ABCD":
                for name in ("Fx", "Fy"):
                    assert np.allclose(s[pair].components[name], spatial[pair].components[name], rtol=1e-11, atol=1e-10)
            assert np.allclose(s.shaking[..., 2:5], spatial.shaking[..., 2:5], atol=1e-10)


# --- motion, rest, modes -------------------------------------------------------------------------------------------------


def test_response_equilibrium_and_frequencies_are_those_of_the_spatial_one() -> None:
    m = four_bar().replace(drives=[], loads=[mg.Gravity((0, -9.81))])
    twin = m.to_spatial()
    one, other = mg.respond(m, (0, 0.3)), mg.respond(twin, (0, 0.3))
    assert one["A"].position[-1] == pytest.approx(other["A"].position[-1], abs=1e-7)
    rest, rest_twin = mg.equilibrium(m), mg.equilibrium(twin)
    assert rest.start["A.Rz"] == pytest.approx(rest_twin.start["A.Rz"], abs=1e-9)
    assert mg.linearize(rest).frequencies == pytest.approx(mg.linearize(rest_twin).frequencies, rel=1e-9)


def test_assemblies_branches_and_groups_are_those_of_the_spatial_one() -> None:
    m = four_bar()
    found, twin = (mg.assemblies(one, {"A": 0.3}) for one in (m, m.to_spatial()))
    assert len(found) == len(twin) == 2
    assert found.completeness == twin.completeness
    assert np.allclose(found.coordinates, twin.coordinates, atol=1e-9)
    assert len(mg.branches(m, "A").branches) == len(mg.branches(m.to_spatial(), "A").branches)
    assert mg.groups(m).symbol == mg.groups(m.to_spatial()).symbol == "R - D10"
    assert mg.groups(m).groups[1].redundancy == 0


def test_a_study_and_a_compiled_mechanism() -> None:
    m, masses = four_bar(), np.linspace(1, 2, 3)
    asked = {"parameters": {"crank.mass": masses}, "outputs": {"torque": "A.effort"}, "motions": {"A": [0.0, 1.0]}}
    one, other = mg.study(m, **asked), mg.study(m.to_spatial(), **asked)
    assert np.allclose(one.outputs["torque"], other.outputs["torque"], rtol=1e-11)
    c = mg.compile(m)
    assert c([0.3]) == pytest.approx(mg.solve(m, {"A": 0.3})["A"].effort, rel=1e-10)
    assert np.isfinite(c.reaction("B")).all()


def test_points_and_links_are_prescribed_in_the_plane() -> None:
    m = four_bar()
    s = mg.solve(m, {"A": mg.Motion(np.linspace(0.2, 0.6, 5), velocity=1.0)})
    tip, crank = s.link("coupler").at("tip"), s.link("crank")
    again = mg.solve(m, {"coupler.tip.Tx": mg.Motion(tip.position[:, 0], tip.velocity[:, 0], tip.acceleration[:, 0])})
    assert np.allclose(again["A"].position, s["A"].position, atol=1e-9)
    posed = mg.solve(m, {"crank.Rz": s["A"].position[:, 0]})
    assert np.allclose(posed["D"].position, s["D"].position, atol=1e-9)
    with pytest.raises(mg.DeclarationError, match="Tx, Ty, Rz"):
        mg.solve(m, {"crank.Rx": 0.1})
    with pytest.raises(mg.DeclarationError, match="in the plane"):
        mg.solve(m, {"coupler.tip.T(0,0,1)": 0.1})
    # all of a floating link: two numbers a point, poses and twists
    free = mg.Mechanism(
        "plate",
        [mg.Link("frame"), mg.Link("plate", 2.0, (0.1, 0.0), 0.1)],
        [mg.Pair("F", "Fr", "frame", "plate", point=(0, 0))],
        planar=True,
    )
    pose = np.tile(np.eye(4), (4, 1, 1))
    angle = np.array([0.0, 1.0, 2.0, 3.0])
    pose[:, 0, 0] = pose[:, 1, 1] = np.cos(angle)
    pose[:, 1, 0], pose[:, 0, 1], pose[:, 0, 3] = np.sin(angle), -np.sin(angle), 0.3 * angle
    moved = mg.solve(free, {"plate": mg.Motion(pose, velocity=np.tile([0, 0, 1.0, 0.3, 0, 0], (4, 1)))})
    assert np.allclose(moved["F"].position, np.stack([0.3 * angle, 0 * angle, angle], axis=1))
    assert np.allclose(moved["F"].velocity[:, 2], 1.0)
    assert crank.pose.shape == (5, 4, 4)


# --- declaration ---------------------------------------------------------------------------------------------------------

REFUSED = {
    "S": ({}, "take R,"),
    "U": ({"axis": Z}, "take R,"),
    "H": ({"axis": Z, "pitch": 0.1}, "take R,"),
    "C": ({"axis": Z}, "take R,"),
    "E": ({"axis": Z}, "take Fr,"),
    "Sg": ({"axis": (1, 0)}, "take Ps,"),
    "Sp": ({"axis": (0, 1)}, "take Ps,"),
}


@pytest.mark.parametrize("symbol", REFUSED)
def test_a_pair_that_can_leave_the_plane_is_refused_with_the_one_to_take(symbol: str) -> None:
    given, remedy = REFUSED[symbol]
    with pytest.raises(mg.DeclarationError, match=remedy):
        mg.Mechanism("x", pairs=[mg.Pair("A", symbol, "f", "a", point=(0, 0), **given)], planar=True)


def test_axes_that_leave_the_plane_are_refused() -> None:
    for symbol, axis, words in (
        ("R", (1, 0, 0), "leave it out, or take W"),
        ("C", (1, 0, 0), "take P,"),
        ("P", Z, r"axis=\(x, y\)"),
        ("R", (0, 0.1, 1), "leave it out"),
    ):
        with pytest.raises(mg.DeclarationError, match=words):
            mg.Mechanism("x", pairs=[mg.Pair("A", symbol, "f", "a", point=(0, 0), axis=axis)], planar=True)


def test_what_leaves_the_plane_is_named_all_at_once() -> None:
    links = [
        mg.Link("f"),
        mg.Link("a", 1.0, (0, 0, 0.2), np.array([[1, 0, 0.1], [0, 1, 0], [0.1, 0, 1]]), points={"p": (0, 0, 1)}),
    ]
    loads = [mg.Gravity((0, 0, -9.81)), mg.Wrench("a", force=(0, 1, 1), moment=(1, 0, 0))]
    with pytest.raises(mg.DeclarationError) as error:
        mg.Mechanism("x", links, [mg.Pair("A", "R", "f", "a", point=(0, 0, 3))], loads=loads, planar=True)
    for words in ("center = ", "products of inertia", "p = ", "acceleration = ", "force = ", "moment = ", "point = "):
        assert words in str(error.value)
    assert len(error.value.faults) == 7


def test_what_is_no_number_is_a_fault_in_the_plane_too() -> None:
    odd = np.eye(3) * 1j
    for what in ("center", "inertia", "points"):
        links = [mg.Link("f"), mg.Link("a", 1.0, **{"center": (0, 0), what: odd})]
        with pytest.raises(mg.DeclarationError, match=what):
            mg.Mechanism("x", links, [mg.Pair("A", "R", "f", "a", point=(0, 0))], planar=True)
    for symbol, axis in (("R", Z), ("P", (1, 0))):
        for what in ("point", "axis", "second", "roller", "on_a"):
            pair = mg.Pair("A", symbol, "f", "a", **{"point": (0, 0), "axis": axis, what: odd})
            with pytest.raises(mg.DeclarationError):
                mg.Mechanism("x", pairs=[pair], planar=True)
    with pytest.raises(mg.DeclarationError, match="planar"):
        mg.Mechanism("x", pairs=[mg.Pair("A", "R", "f", "a")], planar=np.zeros(2))  # type: ignore[arg-type]


def test_two_numbers_are_for_planar_mechanisms() -> None:
    with pytest.raises(mg.DeclarationError, match="two where planar=True"):
        mg.Mechanism("x", pairs=[mg.Pair("A", "R", "f", "a", point=(0, 0), axis=Z)])
    with pytest.raises(mg.DeclarationError, match="true or false"):
        mg.Mechanism("x", pairs=[mg.Pair("A", "R", "f", "a")], planar="yes")  # type: ignore[arg-type]


def test_a_force_out_of_the_plane_from_a_function_is_refused() -> None:
    m = four_bar()
    lifting = mg.Wrench("rocker", force=lambda pose, twist, t: np.array([0.0, 1.0, 2.0]), point=(0.5, 0.3))
    with pytest.raises(mg.DeclarationError, match="leaves the x-y plane"):
        mg.solve(m.replace(loads=[lifting]), {"A": 0.3})
    flat = mg.Wrench(
        "rocker", force=lambda pose, twist, t: np.array([3.0, 4.0]), moment=lambda *_: 2.0, point=(0.5, 0.3)
    )
    s = mg.solve(m.replace(loads=[m.loads[0], flat]), {"A": 0.3})
    assert s["A"].effort == pytest.approx(mg.solve(m, {"A": 0.3})["A"].effort, rel=1e-12)


def test_a_number_is_the_inertia_of_a_lamina() -> None:
    assert four_bar().link("crank").inertia == ((0.0005, 0, 0), (0, 0.0005, 0), (0, 0, 0.001))
    assert mg.check(four_bar().to_spatial()).redundancy == 3


# --- there and back ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("m", [four_bar(), slider_crank(), cranks(3)], ids=lambda m: m.name)
def test_there_and_back_is_equal(m: mg.Mechanism, tmp_path: pathlib.Path) -> None:
    assert m.to_spatial().to_planar() == m
    assert m.to_planar() is m
    assert pickle.loads(pickle.dumps(m)) == m
    mg.save(m, tmp_path / "m.toml")
    again = mg.load(tmp_path / "m.toml")
    assert again == m
    assert again.planar
    assert "pair_type" not in (tmp_path / "m.toml").read_text(encoding="utf-8")
    assert not m.to_spatial().planar
    assert m.to_spatial().pairs[0].type is mg.pair_types()["R"]


PLANAR_FILE = """
schema = 1
name = "bars"
planar = true
link = [
  {name = "frame"}, {name = "crank", mass = 1.0, center = [0.05, 0.0], inertia = 0.001},
  {name = "coupler", mass = 2.0, center = [0.3, 0.2], inertia = 0.01, points = {tip = [0.3, 0.35]}},
  {name = "rocker", mass = 2.0, center = [0.5, 0.2], inertia = 0.01},
]
pair = [
  {name = "A", type = "R", a = "frame", b = "crank", point = [0, 0]},
  {name = "B", type = "R", a = "crank", b = "coupler", point = [0.1, 0]},
  {name = "C", type = "R", a = "coupler", b = "rocker", point = [0.5, 0.4]},
  {name = "D", type = "R", a = "frame", b = "rocker", point = [0.5, 0]},
]
drive = [{freedom = "A"}]
load = [
  {kind = "gravity", acceleration = [0, -9.81]}, {kind = "wrench", link = "rocker", force = [3, 4], moment = 2.0, point = [0.5, 0.3]}
]
"""


def test_a_file_has_two_numbers_a_point(tmp_path: pathlib.Path) -> None:
    (tmp_path / "bars.toml").write_text(PLANAR_FILE, encoding="utf-8")
    assert mg.load(tmp_path / "bars.toml") == four_bar()
    jsonschema = pytest.importorskip("jsonschema")
    rules = json.loads(
        (pathlib.Path(__file__).parents[1] / "library" / "mechanism.schema.json").read_text(encoding="utf-8")
    )
    jsonschema.validate(tomllib.loads(PLANAR_FILE), rules)


def test_a_saved_file_has_two_numbers_a_point_and_comes_back_equal(tmp_path: pathlib.Path) -> None:
    """Links, hinges, guides, loads, gears and pulleys of the plane, as one declares them."""
    wheels = [mg.Gear("g", "crank", 20, (0, 0), module=0.1), mg.Pulley("q", "crank", (0, 0), radius=0.2)]
    for m in (four_bar(), slider_crank(), four_bar().replace(gears=wheels)):
        mg.save(m, tmp_path / "m.toml")
        text = (tmp_path / "m.toml").read_text(encoding="utf-8")
        assert mg.load(tmp_path / "m.toml") == m
        stored = tomllib.loads(text)
        for table in ("link", "pair", "load", "gear"):
            for item in stored.get(table, ()):
                assert all(len(item[name]) == 2 for name in ("point", "center", "force") if name in item)
                assert "second" not in item
                assert isinstance(item.get("inertia", 0.0), float)
                assert "axis" not in item or item["type"] == "P"
    tilted = mg.Link("x", 1.0, (0, 0), [[1, 0, 0], [0, 2, 0], [0, 0, 2.5]])  # more than its moment about z
    m = mg.Mechanism("x", [mg.Link("frame"), tilted], [mg.Pair("A", "R", "frame", "x", point=(0, 0))], planar=True)
    mg.save(m, tmp_path / "m.toml")
    assert mg.load(tmp_path / "m.toml") == m


def test_the_plane_speaks_of_two_numbers() -> None:
    with pytest.raises(mg.DeclarationError, match=r"point = .*two where planar=True"):
        mg.Mechanism("m", pairs=[mg.Pair("A", "R", "frame", "a", point=(0,))], planar=True)
    s = mg.solve(four_bar(), {"A": 0.3})
    np.testing.assert_array_equal(s.link("rocker").point((1, 2)).position, s.link("rocker").point((1, 2, 0)).position)
    with pytest.raises(mg.DeclarationError, match=r"unknown component 'Fz' \(components: Fx, Fy\)"):
        s["A"].components["Fz"]
    with pytest.raises(mg.DeclarationError, match="three finite numbers"):
        mg.solve(four_bar().to_spatial(), {"A": 0.3}).link("rocker").point((1, 2))


def test_layers_are_heights_of_links() -> None:
    m = four_bar().to_spatial(z={"coupler": 0.02})
    assert m.link("coupler").center[2] == m.link("coupler").points["tip"][2] == 0.02
    assert m.pair("B").point[2] == 0.01
    assert m.pair("A").point[2] == 0
    back = m.to_planar()
    assert back.replace(description="") == four_bar()
    assert "z = 0.02" in back.description
    with pytest.raises(mg.DeclarationError, match="cuopler"):
        four_bar().to_spatial(z={"cuopler": 1.0})


def test_a_tilted_mechanism_with_balls_and_round_guides_comes_into_the_plane() -> None:
    """A slider-crank in a tilted plane, with a ball and a round guide, has the forces of the plane."""
    plane = slider_crank().to_spatial()
    types = {"B": "S", "D": "C"}
    pairs = [
        p
        if p.name not in types
        else mg.Pair(p.name, types[p.name], p.a, p.b, point=p.point, axis=None if p.name == "B" else p.axis)
        for p in plane.pairs
    ]
    pose = np.eye(4)
    x, y = np.array([1, 2, 2]) / 3, np.array([2, 1, -2]) / 3
    pose[:3, :3] = np.stack([x, y, np.cross(x, y)], axis=1)
    tilted = plane.replace(pairs=pairs).moved(pose)
    flat = tilted.to_planar()
    assert [p.type.symbol for p in flat.pairs] == ["R", "R", "R", "P"]
    assert "B S -> R" in flat.description
    found = mg.solve(flat, {"A": np.radians(60)})
    assert abs(found["A"].effort) == pytest.approx(50.8390, abs=1e-4)
    assert found["D"].magnitude == pytest.approx(301.5113, abs=1e-4)
    with pytest.raises(mg.DeclarationError, match="moves in the plane with the normal"):
        tilted.to_planar((0, 0, 1))


def test_a_chain_by_markers_comes_into_the_plane() -> None:
    m = mg.chain("RRRR", twist=[0, np.pi, 0, np.pi], length=[1, 3, 2.5, 3.2], start={"O1": 0.4})
    flat = m.to_planar()
    assert mg.check(flat).redundancy == 0
    s, twin = mg.solve(flat, {"O1": [0.4, 0.6]}), mg.solve(m, {"O1": [0.4, 0.6]})
    assert np.allclose(s["O3"].position, twin["O3"].position, atol=1e-10)


def test_what_does_not_move_in_a_plane_stays_spatial() -> None:
    with pytest.raises(mg.DeclarationError, match="does not move in a plane"):
        mg.load("rcsr").to_planar()


# --- pairs on curves, couplings ------------------------------------------------------------------------------------------


def test_a_pin_in_a_slot_and_a_weld() -> None:
    """Scotch yoke: the slot pushes square to itself; torque F r sin t (closed form)."""
    r = 0.1
    slot = mg.Curve.line(point=(r, 0), direction=(0, 1))
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=(0, 0)),
        mg.Pair("B", "Ps", "yoke", "crank", point=(r, 0), curve=slot),
        mg.Pair("C", "P", "frame", "yoke", point=(r, 0), axis=(1, 0)),
        mg.Pair("D", "W", "yoke", "tool", point=(r + 0.1, 0)),
    ]
    push = mg.Wrench("tool", force=(-100.0, 0), point=(r + 0.1, 0))
    m = mg.Mechanism("yoke", pairs=pairs, drives=["A"], loads=[push], planar=True)
    r_ = mg.check(m)
    assert (r_.mobility, r_.redundancy) == (1, 0)
    assert r_.unique["D"] == {"Fx": True, "Fy": True, "Mz": True}
    t = np.linspace(0.2, 1.2, 5)
    for engine in ("dense", "sparse"):
        s = mg.solve(m, {"A": t}, engine=engine)
        assert np.allclose(np.abs(s["A"].effort[:, 0]), 100 * r * np.sin(t), rtol=1e-9)
        assert np.allclose(np.abs(s["B"].components["Fy"]), 100.0)
        assert np.allclose(s["D"].force, [[-100.0, 0, 0]] if s["D"].force[0, 0] < 0 else [[100.0, 0, 0]])
    assert m.to_spatial().to_planar() == m


def test_a_spur_gear_train_in_the_plane() -> None:
    pairs = [mg.Pair("A", "R", "frame", "pinion", point=(0, 0)), mg.Pair("B", "R", "frame", "wheel", point=(0.06, 0))]
    gears = mg.SpurGears("g", "A", "B", teeth=(20, 40), module=0.002)
    m = mg.Mechanism("gears", pairs=pairs, couplings=[gears], drives=["A"], loads=[mg.Effort("B", 6.0)], planar=True)
    r = mg.check(m)
    assert (r.mobility, r.redundancy) == (1, 0)
    s, twin = mg.solve(m, {"A": 0.3}), mg.solve(m.to_spatial(), {"A": 0.3})
    assert np.isfinite(s["A"].force).all()
    assert np.allclose(s["A"].force[:2], twin["A"].force[:2])
    assert np.allclose(s["A"].effort, twin["A"].effort)


# --- results and files ---------------------------------------------------------------------------------------------------


def test_tables_show_the_plane_alone(tmp_path: pathlib.Path) -> None:
    s = mg.solve(four_bar(), {"A": mg.Motion(np.linspace(0, 2 * np.pi, 25), t=np.linspace(0, 1, 25))})
    body = mg.free_body(s, "coupler")
    assert {r.component for r in body.envelope()} == {"Mz", "Fx", "Fy", "|F|", "|M|"}
    body.write(tmp_path / "loads.csv")
    assert "position,at,name,kind,x,y,Fx,Fy,Mz,not unique" in (tmp_path / "loads.csv").read_text(encoding="utf-8")
    assert set(mg.over_time(s).shaking) == {"Mz", "Fx", "Fy", "|M|", "|F|"}
    s.write(tmp_path / "s.csv", include=["points", "links"])
    head = (tmp_path / "s.csv").read_text(encoding="utf-8").splitlines()[0]
    assert "coupler.tip:y" in head
    assert "coupler.tip:z" not in head
    assert "crank:Rzz" not in head
    assert np.isfinite(np.linalg.norm(s["B"].force, axis=-1)).all()


def test_rows_of_loops_are_counted_in_one_place() -> None:
    """Six a loop is said by the graph alone (``LinkGraph.loop_rows``), which says three in the plane."""
    package = pathlib.Path(mg.__file__).parent
    six = re.compile(r"6 \* [\w.]*(n_loops|\bloops\b)")
    assert not [path.name for path in package.rglob("*.py") if six.search(path.read_text(encoding="utf-8"))]


def test_the_command_line_takes_the_plane() -> None:
    found = run("check", "four-bar", "--planar")
    assert found.exit_code == 0
    assert "Determinate (planar): 1 driver, 9 unknowns, 9 equations" in " ".join(found.stdout.split())
    assert "does not move in a plane" in bad("check", "rcsr", "--planar")


def test_magnitudes_of_positions_that_are_not_solved_are_not_there() -> None:
    s = mg.solve(mg.load("slider-crank"), {"D": np.linspace(0.0, 2.0, 5)}, on_reach="flag")
    assert (s.status != "ok").any()
    assert (np.isnan(s["B"].magnitude) == (s.status != "ok")).all()


# --- stiffness, films, catalogue parts -----------------------------------------------------------------------------------


def test_redundant_reactions_split_by_stiffness_in_the_plane() -> None:
    pairs = [p.replace(stiffness={"Fx": 1e6, "Fy": 2e6}) for p in cranks(3).pairs]
    pairs[4] = pairs[4].replace(misfit={"Fy": 1e-5})
    m = cranks(3).replace(pairs=pairs, loads=[mg.Wrench("plate", force=(1, 2), moment=0.3, point=(1, 0.5))])
    twin = mg.solve(m.to_spatial(), {"A0": [0.3, 0.4]}, redundant="elastic")["B1"].force
    for engine in ENGINES:
        for method in METHODS:
            s = mg.solve(m, {"A0": [0.3, 0.4]}, redundant="elastic", engine=engine, method=method)
            assert np.allclose(s["B1"].force[:, :2], twin[:, :2], rtol=1e-9)


def test_stiffness_and_misfit_go_along_into_the_plane() -> None:
    """The marker of a slide is turned so that x stands on the plane: its y takes over from x, with the sign of the misfit."""
    spatial = slider_crank().to_spatial()
    seats = {"stiffness": {"Fx": 7.0, "Fy": 8.0, "Mx": 1.0, "My": 2.0}, "misfit": {"Fx": 1e-3}}
    pairs = [*spatial.pairs[:3], spatial.pair("D").replace(second=(0, 1, 0), **seats)]
    flat = spatial.replace(pairs=pairs).to_planar()
    assert flat.pair("D").stiffness.by_component == {"Fy": 7.0, "Mx": 2.0}
    assert flat.pair("D").misfit.by_component == {"Fy": -1e-3}
    assert "D stiffness Fy" in flat.description


def test_a_part_with_two_numbers_a_point_is_planar() -> None:
    boom = [mg.Pair("O", "R", "frame", "boom", point=(0, 0))]
    jack = mg.parts.cylinder("jack", "frame", (0.5, -1), "boom", (1, 0))
    links = [mg.Link("frame"), mg.Link("boom", 10.0, (1, 0), 5.0)]
    m = mg.Mechanism("crane", links, boom, ["jack.lift.Tz"], [mg.Gravity((0, -9.81))], parts=[jack], planar=True)
    assert mg.check(m).verdict == "Determinate (planar): 1 driver, 9 unknowns, 9 equations; every reaction is unique."
    arm = 1.0 * 1.0 / np.hypot(0.5, 1.0)  # of the line of the eyes about O
    assert mg.solve(m, {"jack.lift.Tz": 0.0})["jack.lift"].effort == pytest.approx(10 * 9.81 * 1.0 / arm, rel=1e-9)


# --- gears and belts on links --------------------------------------------------------------------------------------------


def stage(helix: float = 0.0, **more) -> mg.Mechanism:
    """Two gears without axes on pins."""
    far = (0.06 / np.cos(helix), 0.0)
    pairs = [mg.Pair("A", "R", "frame", "pinion", point=(0, 0)), mg.Pair("B", "R", "frame", "wheel", point=far)]
    gears = [
        mg.Gear("g1", "pinion", 20, (0, 0), module=0.002, helix_angle=helix),
        mg.Gear("g2", "wheel", 40, far, module=0.002, helix_angle=-helix),
    ]
    return mg.Mechanism(
        "stage",
        pairs=pairs,
        gears=gears,
        couplings=[mg.Mesh("m", "g1", "g2")],
        drives=["A"],
        loads=[mg.Effort("B", 6.0)],
        planar=True,
        **more,
    )


@pytest.mark.parametrize("helix", [0.0, 0.2])
def test_gears_press_as_in_space(helix: float) -> None:
    """Closed form: tangential T / r with r = m z / 2 cos b, radial that times tan of the transverse angle (Shigley, 13-10)."""
    m, r = stage(helix), 0.02 / np.cos(helix)
    tangential, radial = 3.0 / r, 3.0 / r * np.tan(np.radians(20)) / np.cos(helix)
    for engine in ENGINES:
        for method in METHODS:
            s = mg.solve(m, {"A": [0.1, 0.2]}, engine=engine, method=method)
            assert np.allclose(np.abs(s["A"].force), [radial, tangential, 0.0], rtol=1e-9)
    assert mg.check(m).verdict == "Determinate (planar): 1 driver, 6 unknowns, 6 equations; every reaction is unique."
    assert m.to_spatial().to_planar() == m
    with pytest.raises(mg.DeclarationError, match="axis: is missing"):
        m.replace(planar=False, gears=[mg.Gear("g1", "pinion", 20, (0, 0, 0), module=0.002), m.gears[1]])
    with pytest.raises(mg.DeclarationError, match="leave it out"):
        m.replace(gears=[m.gears[0].replace(axis=(0, 1, 1)), m.gears[1]])
    with pytest.raises(mg.DeclarationError, match="worm 'g1': meshes across the plane"):
        m.replace(gears=[mg.Worm("g1", "pinion", 1, (0, 0), (1, 0), radius=0.01), m.gears[1]])


def test_a_rack_takes_the_force_of_its_pinion() -> None:
    gears = [
        mg.Gear("g", "pinion", 20, (0, 0), module=0.002),
        mg.GearRack("r", "slide", (0, -0.02), (1, 0), (0, 1), module=0.002),
    ]
    pairs = [
        mg.Pair("A", "R", "frame", "pinion", point=(0, 0)),
        mg.Pair("B", "P", "frame", "slide", point=(0, -0.02), axis=(1, 0)),
    ]
    couplings, loads = [mg.Mesh("m", "g", "r")], [mg.Effort("B", 1.0)]
    m = mg.Mechanism("rack", pairs=pairs, gears=gears, couplings=couplings, drives=["A"], loads=loads, planar=True)
    s = mg.solve(m, {"A": 0.1})
    assert np.allclose(s["A"].force, [-1.0, -np.tan(np.radians(20)), 0.0])
    assert s["A"].effort == pytest.approx(-0.02)
    assert m.to_spatial().to_planar() == m


def test_a_floating_sun_shares_its_load() -> None:
    """Three planets at 120 degrees press with T / (3 rb) each; in a bearing the sun is redundant twice."""
    module, zs, zp, zr = 0.002, 18, 18, 54
    places = [0.036 * np.array([np.cos(t), np.sin(t)]) for t in 2 * np.pi * np.arange(3) / 3]
    gears = [
        mg.Gear("s", "sun", zs, (0, 0), module=module),
        mg.Gear("r", "frame", zr, (0, 0), module=module, internal=True),
    ]
    gears += [mg.Gear(f"p{i}", f"planet{i}", zp, at, module=module) for i, at in enumerate(places)]
    meshes = [mg.Mesh(f"{a}{i}", *ends) for i in range(3) for a, ends in (("s", ("s", f"p{i}")), ("r", (f"p{i}", "r")))]
    for symbol, redundancy in (("Fr", 0), ("R", 2)):
        pairs = [
            mg.Pair("C", "R", "frame", "carrier", point=(0, 0)),
            mg.Pair("S", symbol, "frame", "sun", point=(0, 0)),
        ]
        pairs += [mg.Pair(f"P{i}", "R", "carrier", f"planet{i}", point=at) for i, at in enumerate(places)]
        m = mg.Mechanism(
            "set",
            pairs=pairs,
            gears=gears,
            couplings=meshes,
            drives=["S.Rz"],
            loads=[mg.Effort("C", -8.0)],
            planar=True,
        )
        assert mg.check(m).redundancy == redundancy
        if not redundancy:
            s = mg.solve(m, {"S.Rz": [0.0, 0.1]})
            force = 2.0 / (3 * 0.018 * np.cos(np.radians(20)))
            assert np.allclose([np.linalg.norm(s.coupling(f"s{i}").force, axis=-1) for i in range(3)], force, rtol=1e-9)


def test_a_belt_over_pulleys_without_axes() -> None:
    """T0 +- M / 2r; the pins carry what both spans pull."""
    places = {"p": (0, 0), "w": (0.2, 0)}
    pairs = [mg.Pair(k, "R", "frame", k, point=at) for k, at in places.items()]
    gears = [mg.Pulley(k, k, at, radius=r) for (k, at), r in zip(places.items(), (0.05, 0.1), strict=True)]
    belt = mg.BeltDrive("B", over=["p", "w"], pretension=300.0)
    m = mg.Mechanism(
        "belt", pairs=pairs, gears=gears, couplings=[belt], drives=["p"], loads=[mg.Effort("w", -20.0)], planar=True
    )
    for engine in ENGINES:
        s = mg.solve(m, {"p": 0.5}, engine=engine)
        assert s.coupling("B").tension["p-w"] == pytest.approx(200.0)
        assert s["w"].magnitude == pytest.approx(mg.solve(m.to_spatial(), {"p": 0.5}, engine=engine)["w"].magnitude)
    assert m.to_spatial().to_planar() == m


def test_friction_of_pins_and_guides_in_the_plane() -> None:
    m = slider_crank()
    loads = [*m.loads, mg.Friction("D", mu=0.2, length=0.05, width=0.02), mg.Friction("C", mu=0.1, radius=0.02)]
    motion = {"A": mg.Motion(np.linspace(0.3, 2, 4), velocity=3.0)}
    s, twin = (mg.solve(one, motion, loads=loads) for one in (m, m.to_spatial()))
    assert np.allclose(s["A"].effort, twin["A"].effort, rtol=1e-10)
    assert not np.allclose(s["A"].effort, mg.solve(m, motion)["A"].effort, rtol=1e-2)


def test_loads_in_the_frames_of_turned_links_come_along() -> None:
    """The arm's frame is turned about x against the frame's; the end of a spring and a wrench that turns with it stand in that."""
    pin = mg.Pair(
        "A",
        "R",
        "frame",
        "arm",
        on_a=mg.Marker((0, 0, 0), (0, 0, 1), (1, 0, 0)),
        on_b=mg.Marker((0, 0, 0), (0, 1, 0), (1, 0, 0)),
    )
    loads = [
        mg.Spring("frame", "arm", (0, 2.0, 0), (1.0, 0, -0.3), 50.0, 0.5),
        mg.Wrench("arm", force=(0, 0, -3.0), point=(1.0, 0, -0.2), frame="link"),
    ]  # fmt: skip
    for tilt in (np.eye(3), [[0, 0, 1], [1, 0, 0], [0, 1, 0]]):
        pose = np.column_stack([tilt, [0.1, 0.2, 0.3]])
        m = mg.Mechanism("arm", [mg.Link("frame"), mg.Link("arm", 1.0, (0.5, 0, 0))], [pin], ["A"], loads).moved(pose)
        given = {"A": mg.Motion([0.1, 0.5], velocity=2.0)}
        space, plane = mg.solve(m, given), mg.solve(m.to_planar(), given)
        assert np.allclose(plane["A"].effort, space["A"].effort, rtol=1e-12)
