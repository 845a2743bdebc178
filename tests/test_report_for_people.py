"""The report on one page, planar and spherical mechanisms by name, and advice that can be applied."""

from __future__ import annotations

from itertools import product

import machines
import mechanisms as known
import numpy as np
import pytest
from lattices import ladder, parallelograms, scissors, spatial_ladder, tree_of_loops
from program import invoke
from screws import pose_exp

import mechgraph as mg

BUILDERS = (
    {n: (lambda n=n: mg.load(n)) for n in mg.library()}
    | {
        "excavator": machines.excavator,
        "excavator on balls": lambda: machines.excavator("SCS"),
        "five rods": machines.five_rods,
        "double Cardan": machines.double_cardan,
        "hexapod": lambda: known.hexapod("SPS"),
        "hexapod, not driven": lambda: known.hexapod("UPS", driven=False),
        "grid": lambda: known.grid(6),
        "windows": lambda: known.windows(50),
        "topology": lambda: mg.chain("RCHCH"),
        "not closed": known.unclosable_four_bar,
    }
    | {
        n: getattr(known, n)
        for n in ("door", "sarrus", "goldberg", "folded_bars", "three_upu", "concurrent_cranks", "rccc")
    }
    | {f.__name__: (lambda f=f: f(60)) for f in (ladder, parallelograms, scissors, tree_of_loops, spatial_ladder)}
)


@pytest.mark.daily(5)
@pytest.mark.parametrize("name", BUILDERS)
def test_the_page_has_25_lines_and_begins_with_the_verdict(name: str) -> None:
    report = mg.check(BUILDERS[name]())
    lines = report.text().splitlines()
    assert len(lines) <= 25
    assert max(map(len, lines)) <= 80
    page = " ".join(report.text().split())
    assert page.index(" ".join(report.verdict.split())) < page.index("Determinacy:")
    assert page.count("preload from misalignment") == bool(
        report.mobility is not None and report.reactions and not report.reactions.all_unique
    )
    assert len(report.text(full=True)) > len(report.text())
    assert str(report) == report.text()
    assert "Determinacy:" in report.to_markdown()
    assert "Determinacy:" in report._repr_html_()
    assert report.to_markdown(full=True) != report.to_markdown()


# --- planar and spherical ---------------------------------------------------------------------------------------------------


def turned(m: mg.Mechanism, rng: np.random.Generator) -> mg.Mechanism:
    pose = np.eye(4)
    pose[:3] = pose_exp(np.concatenate([rng.normal(size=3), 10 * rng.normal(size=3)]))
    return m.moved(pose)


def random_mechanism(kind: str, types: str, rng: np.random.Generator) -> mg.Mechanism:
    """A ring with random points: pins along z and slides across it, pins through one center, or anything."""
    n = len(types)
    points = rng.normal(size=(n, 3))
    axes = rng.normal(size=(n, 3))
    if kind == "planar":
        slides = np.array([t == "P" for t in types])
        axes = np.where(slides[:, None], axes * (1, 1, 0), np.array(known.Z))
    if kind == "spherical":
        axes = (points - (0.3, -0.2, 0.5)) * np.sign(rng.normal(size=(n, 1)))
    return known.ring(types, list(points), list(axes), drives=[])


@pytest.mark.daily(6)
@pytest.mark.parametrize(
    ("kind", "types"),
    [
        *product(["planar", "spatial"], ["RRRR", "RRRP", "RPRRR", "RRPP"]),
        *product(["spherical", "spatial"], ["RRR", "RRRR", "RRRRR"]),
    ],
)
def test_kinds_are_found_in_any_plane_and_about_any_centre(kind: str, types: str) -> None:
    rng = np.random.default_rng(len(types) + 7 * (kind == "planar"))
    for _ in range(5):
        m = random_mechanism(kind, types, rng)
        pose = pose_exp(np.concatenate([rng.normal(size=3), 10 * rng.normal(size=3)]))
        report = mg.check(m.moved(np.concatenate([pose, [[0, 0, 0, 1]]])))
        assert report.kind.name == kind.replace("spatial", "")
        if kind == "planar":
            assert abs(abs(np.dot(report.kind.place, pose[:, 2])) - 1) < 1e-9
        if kind == "spherical":
            centre = pose[:, :3] @ (0.3, -0.2, 0.5) + pose[:, 3]
            np.testing.assert_allclose(report.kind.place, centre, atol=1e-8)


@pytest.mark.daily(4)
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("engine", ["dense", "sparse"])
def test_the_sentence_of_a_planar_and_of_a_spherical_four_bar(seed: int, engine: str) -> None:
    rng = np.random.default_rng(seed)
    planar = mg.check(turned(known.planar(), rng), engine=engine)  # type: ignore[arg-type]
    assert planar.verdict == (
        "Moves with mobility 1, planar: all in-plane forces and the driver effort are unique; not unique: "
        "axial forces and tilting moments at the pins (redundancy 3)."
    )
    spherical = mg.check(turned(known.spherical(), rng), engine=engine)  # type: ignore[arg-type]
    assert (
        "spherical: all moments about the center and the driver effort are unique; not unique: forces through the center"
        in (spherical.verdict)
    )


@pytest.mark.parametrize(
    "change", [{"O2": "S"}, {"O1": "C", "O2": "S"}, {"O3": "Sg"}, {"O2": "S", "O3": "S"}, {"O4": "Cp"}]
)
def test_balls_and_sliding_bearings_leave_a_mechanism_planar_in_its_motion(change: dict[str, str]) -> None:
    m = turned(known.planar(), np.random.default_rng(2))
    for pair, new in change.items():
        m = m.with_pair_type(pair, new)
    report = mg.check(m)
    assert (report.kind.name, report.kind.by_pairs) == ("planar", False)
    assert "planar" in report.text().lower()


def test_a_spherical_linkage_with_a_ball_still_moves_about_its_centre() -> None:
    m = known.spherical()
    assert mg.check(m.with_pair_type("O2", "S")).kind.name == "spherical"
    assert mg.check(m.with_pair_type("O3", "C")).kind.name == "spherical"


@pytest.mark.parametrize("name", ["rssr", "rcsr", "bennett", "7r", "r-sp-r", "r-sg-c", "rchch"])
def test_spatial_mechanisms_are_called_neither(name: str) -> None:
    report = mg.check(mg.load(name))
    assert not report.kind.name
    assert "planar" not in report.verdict


def test_an_rssr_at_its_dead_point_is_not_taken_for_planar() -> None:
    """There the rocker stands, so that for the moment all links move parallel to the plane of the crank."""
    b, a = np.array((1.0, 0, 0)), np.array((0.0, 0, 0))
    c = np.array((3.0, 0, 1.0))
    pairs = [
        mg.Pair("A", "R", "frame", "crank", point=a, axis=known.Z), mg.Pair("B", "S", "crank", "rod", point=b),
        mg.Pair("C", "S", "rod", "rocker", point=c), mg.Pair("D", "R", "rocker", "frame", point=(3.0, 1, 0), axis=(1, 0.5, 0.2)),
    ]  # fmt: skip
    assert not mg.check(mg.Mechanism("RSSR", None, pairs, ["A"])).kind.name


def test_loops_of_different_kinds_are_told_apart() -> None:
    plane, sphere = known.planar(), known.spherical()
    other = [
        p.replace(name=f"s{p.name}", a=p.a if p.a == "frame" else f"s{p.a}", b=p.b if p.b == "frame" else f"s{p.b}")
        for p in sphere.pairs
    ]
    report = mg.check(mg.Mechanism("both", None, [*plane.pairs, *other], ["O1", "sO1"]))
    assert [k.name for k in report.loop_kinds] == ["planar", "spherical"]
    text = " ".join(report.text().split())
    assert "Loops of different kinds: loop O1-O2-O3-O4 is planar" in text
    assert "loop sO1-sO2-sO3-sO4 is spherical" in text
    assert not report.kind.name


def test_in_plane_forces_that_are_not_unique_are_not_called_so() -> None:
    report = mg.check(known.three_cranks())
    assert report.kind.name == "planar"
    assert not report.own_forces_unique
    assert "all in-plane" not in report.verdict


# --- words ------------------------------------------------------------------------------------------------------------------


def test_components_stand_beside_their_direction_in_words() -> None:
    assert "Fx and Fy (across the pin)" in " ".join(mg.check(mg.load("four-bar")).text().split())
    full = " ".join(mg.check(mg.load("four-bar")).text(full=True).split())
    assert "In words: R: Fx and Fy (across the pin), Fz (along the pin), Mx and My (moment across the pin)." in full


def test_spins_explain_the_count() -> None:
    report = mg.check(machines.five_rods())
    assert "39 unknowns, 44 equations: 5 of them the spins of rod1, rod2, rod3, rod4 and rod5" in report.verdict


def test_a_load_that_no_part_takes_is_what_to_do_first() -> None:
    m = machines.five_rods()
    links = [mg.Link(n, 1.0, (0.3, 0.5, 0.2)) if n == "rod1" else mg.Link(n) for n in m.link_names()]
    text = " ".join(mg.check(m.replace(links=links, loads=[mg.Gravity((0, 0, -9.81))])).text().split())
    assert "Recommended changes: - Hold rod1 or balance the load on it: a couple of" in text
    assert "Nothing" not in text


def test_the_command_line_prints_the_page_and_the_whole() -> None:
    page, whole = (invoke("check", "four-bar", *more).stdout for more in ([], ["--full"]))
    assert "Recommended changes:" in page
    assert "Self-stresses" not in page
    assert "Self-stresses" in whole


# --- advice -----------------------------------------------------------------------------------------------------------------


@pytest.mark.daily(3)
@pytest.mark.parametrize("name", [*BUILDERS])
def test_every_advice_does_what_it_says(name: str) -> None:
    report = mg.check(BUILDERS[name]())
    for a in report.advice:
        after = mg.check(a.apply())
        if a.effect is None:
            assert not after.undriven
            assert not after.contradicting_drives
            continue
        assert a.effect.redundancy == (report.redundancy, after.redundancy), a.text
        assert a.effect.mobility == (report.mobility, after.mobility), a.text
        assert a.effect.passive == (len(report.passive), len(after.passive)), a.text
        assert len(after.mechanism.drives) == len(report.mechanism.drives)


@pytest.mark.daily(3)
@pytest.mark.parametrize("name", ["four-bar", "slider-crank", "bennett", "spherical-four-bar"])
@pytest.mark.parametrize("markers", [False, True])
def test_advice_applies_at_the_position_of_the_report(name: str, markers: bool) -> None:
    m = mg.load(name)
    if markers:
        m = m.replace(
            pairs=[p.replace(point=None, axis=None, second=None, on_a=p.markers[0], on_b=p.markers[1]) for p in m.pairs]
        )
    report = mg.check(m, at={m.drives[0].freedom: 0.4})
    assert report.advice
    for a in report.advice:
        assert a.effect is not None
        changed = a.apply()
        after = mg.check(changed)
        assert (a.effect.redundancy[1], a.effect.mobility[1]) == (after.redundancy, after.mobility), a.text
        assert changed.start[m.full_name(m.drives[0].freedom)] == pytest.approx(0.4)


def test_bearings_come_first() -> None:
    for m in (mg.load("four-bar"), known.planar(), mg.load("spherical-four-bar")):
        first = mg.check(m).advice[0]
        assert first.effect is not None
        assert {new for *_, new in first.effect.changes} == {"C", "S"}
        assert first.effect.redundancy == (3, 0)


@pytest.mark.parametrize("name", ["four-bar", "slider-crank", "spherical-four-bar", "excavator", "bennett"])
def test_no_plane_takes_the_place_of_a_hinge_where_bearings_do(name: str) -> None:
    for a in mg.check(BUILDERS[name]()).advice:
        assert a.effect is not None
        assert not {new for *_, new in a.effect.changes} & {"E", "Cp", "Sp"}
    door = [a.effect for a in mg.check(known.door()).advice if a.effect]
    planes = [bool({new for *_, new in e.changes} & {"E", "Cp", "Sp"}) for e in door]
    assert planes == sorted(planes)


@pytest.mark.parametrize("height", [0.0, 1e-4])
def test_advice_at_a_dead_point_and_near_it_says_instead(height: float) -> None:
    bars = (("A", "frame", "crank", 0, 0), ("B", "crank", "rod", 1, height), ("C", "rod", "slider", 3, 0))
    pairs = [mg.Pair(name, "R", a, b, point=(x, y, 0), axis=known.Z) for name, a, b, x, y in bars]
    slide = mg.Pair("D", "P", "slider", "frame", point=(3, 0, 0), axis=known.X)
    report = mg.check(mg.Mechanism("slider-crank", None, [*pairs, slide], ["D"]))
    assert report.advice[0].text.startswith("drive A.Rz instead of D.Tz")
    assert "also" not in report.text()
    changed = report.advice[0].apply()
    assert [d.freedom for d in changed.drives] == ["A.Rz"]
    assert not mg.check(changed).near


def test_a_cylinder_between_balls_and_a_spline_are_advised() -> None:
    first = mg.check(machines.excavator()).advice[0]
    assert first.brief.startswith("cylinders boomcyl, stickcyl and bucketcyl between ball joints (S-C-S)")
    assert "redundancy 12 -> 0" in first.brief
    shaft = mg.check(machines.double_cardan()).advice[-1]
    assert shaft.text == "spline inserted in shaft: redundancy 1 -> 0, mobility 1 -> 1, passive 0 -> 0"
    assert {p.type.symbol for p in shaft.apply().pairs} == {"R", "U", "P"}


@pytest.mark.daily(5)
@pytest.mark.parametrize("seed", range(12))
def test_advice_on_random_mechanisms_does_what_it_says(seed: int) -> None:
    rng = np.random.default_rng(seed)
    kind = ["planar", "spherical", "spatial"][seed % 3]
    types = "".join(rng.choice(list("RRP" if kind == "planar" else "R" if kind == "spherical" else "RPCU"), size=4))
    m = turned(random_mechanism(kind, types, rng), rng)
    report = mg.check(m)
    for a in report.advice:
        after = mg.check(a.apply())
        if a.effect is not None:
            assert a.effect.redundancy == (report.redundancy, after.redundancy), a.text
            assert a.effect.mobility == (report.mobility, after.mobility), a.text
