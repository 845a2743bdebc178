"""The page that is passed on: what stands in it, and what it does in Chromium."""

import base64
import json
import os
import re
import shutil
import subprocess
import time
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from hashlib import sha256
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree

import machines
import mechanisms
import numpy as np
import pytest
from chromium import DRAWS_NOT, Reader, chromium
from ladder import dyad, four_bar
from test_cli import run
from test_hostile_names import NAMES, named

import mechgraph as mg
from mechgraph.show.canvas import PALETTE, REACTION
from mechgraph.show.page import content, write
from mechgraph.show.page.content import packed
from mechgraph.show.page.write import json_for_script, report_page
from mechgraph.synthesis.answers import compared

pytestmark = pytest.mark.filterwarnings("ignore::mechgraph.MechgraphWarning")

WEB = Path(write.__file__).parent / "web"
SHOWN = ("four-bar", "rssr", "bricard-cube", "rcsr")
"""Redundant; with a passive freedom; without a stored motion; determinate."""
SVG = {"svg", "metadata", "RDF", "Work", "type", "format", "title", "creator", "Agent", "defs", "style", "g", "path", "use", "text",
       "clipPath", "rect", "tspan", "pattern"}  # fmt: skip
"""Elements of the still pictures."""
LARGEST_PAGE = 1_000_000
"""Bytes of a page without its data."""
MODULES = Path(os.environ.get("PAGE_NODE_MODULES", WEB / "node_modules"))
"""What npm installed for the scripts of the page."""
AXE = MODULES / "axe-core" / "axe.min.js"


@cache
def page_of(name: str) -> str:
    """The page of a mechanism of the library, made once."""
    return report_page(mg.load(name))


def numbers(packed: dict[str, Any]) -> np.ndarray:
    return np.frombuffer(base64.b64decode(packed["f32"]), "<f4").reshape(packed["shape"])


@pytest.fixture
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages without their still pictures, which take half of the time, where only data are read."""
    monkeypatch.setattr(write, "stills", lambda m, s: [])


def data_of(page: str) -> dict[str, Any]:
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page)[1])  # type: ignore[index]


class Shape(HTMLParser):
    """Elements and attributes of a page."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: set[str] = set()
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes |= {key for key, _ in attrs}


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pages")
    out = {}
    for name in SHOWN:
        out[name] = folder / f"{name}.html"
        out[name].write_text(page_of(name), encoding="utf-8")
    return out


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Reader]:
    with chromium(tmp_path_factory.mktemp("browser")) as found:
        yield found


# --- what stands in it -------------------------------------------------------------------------------------------------


@pytest.mark.daily(1)
@pytest.mark.parametrize("name", mg.library())
def test_a_page_for_every_mechanism(name: str) -> None:
    """One file that asks nothing of the network; what is not data fits into a megabyte."""
    page = page_of(name)
    pictures = re.findall(r'src="(data:image/svg[^"]*)"', page)
    data = re.search(r'id="data">(.*?)</script>', page)
    tables = re.search(r"<main>.*</main>", page, re.DOTALL)
    assert len(page) - sum(map(len, pictures)) - len(data[1]) - len(tables[0]) < LARGEST_PAGE  # type: ignore[index]
    outside = re.sub(r"<script>.*?</script>|<style>.*?</style>|<pre>.*?</pre>", "", page, flags=re.DOTALL)
    assert not re.search(r"""(?:src|href)=["'](?!data:)""", outside)
    assert not re.search(r"url\((?!['\"]?data:)", "".join(re.findall(r"<style>(.*?)</style>", page, re.DOTALL)))


def test_a_page_is_the_same_at_every_call(tmp_path: Path) -> None:
    mg.write_report(mg.load("four-bar"), path=tmp_path / "x.html")
    assert (tmp_path / "x.html").read_text(encoding="utf-8") == page_of("four-bar")


OTHERS = [
    machines.excavator, machines.five_rods, machines.double_cardan, mechanisms.hexapod, mechanisms.three_upu, mechanisms.sarrus,
    mechanisms.three_cranks, mechanisms.folded_bars, mechanisms.bricard_trihedral, mechanisms.door,
]  # fmt: skip


@pytest.mark.usefixtures("bare")
@pytest.mark.daily(1)
@pytest.mark.parametrize("build", OTHERS, ids=lambda build: build.__name__)
def test_a_page_for_other_mechanisms(build: Callable[[], mg.Mechanism]) -> None:
    m = build()
    page, report = report_page(m), mg.check(m)
    assert data_of(page)["figures"][0]["name"] == m.name
    assert len(items_of(page, "Freedoms")) + len(items_of(page, "Passive freedoms")) == report.mobility


def test_the_policy_allows_what_is_there_and_nothing_else() -> None:
    page = page_of("four-bar")
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1].replace("&#39;", "'")  # type: ignore[index]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules.pop("default-src") == rules.pop("base-uri") == rules.pop("form-action") == "'none'"
    assert rules.pop("img-src") == "data:"
    for directive, tag in (("script-src", "script"), ("style-src", "style")):
        hashes = [
            base64.b64encode(sha256(text.encode()).digest()).decode()
            for text in re.findall(f"<{tag}>(.*?)</{tag}>", page, re.DOTALL)
        ]
        assert hashes
        assert rules.pop(directive).split() == [f"'sha256-{digest}'" for digest in hashes]
    assert not rules
    assert "unsafe" not in policy
    assert not [name for name in Shape(page).attributes if name == "style" or name.startswith("on")]


def test_what_was_built_is_what_is_recorded() -> None:
    """Versions, licenses and hashes of the bundled libraries; and nothing in the sources changed since they were built."""
    built = json.loads((WEB / "built.json").read_text(encoding="utf-8"))
    assert {p["name"]: p["license"] for p in built["packages"]} == {"three": "MIT", "uplot": "MIT"}
    lock = json.loads((WEB / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    vendor = (WEB / "vendor.js").read_text(encoding="utf-8")
    for package in built["packages"]:
        assert lock[f"node_modules/{package['name']}"]["version"] == package["version"]
        assert f"/*! {package['name']} {package['version']} (MIT)" in vendor
    assert vendor.count("Permission is hereby granted") == 2
    for name, digest in {**built["files"], **built["sources"]}.items():
        assert sha256((WEB / name).read_bytes()).hexdigest() == digest, f"{name}: npm run build in {WEB.name}"
    assert {f"src/{file.name}" for file in (WEB / "src").iterdir()} < set(built["sources"])
    assert not [entry for entry in lock.values() if "resolved" in entry]


@cache
def tame_shape() -> Shape:
    m = named("a")
    return Shape(report_page(m, mg.solve(m, {m.drives[0].freedom: np.array([0.1, 0.2])})))


@pytest.mark.daily(1)
@pytest.mark.parametrize("name", NAMES)
def test_no_name_becomes_markup(name: str) -> None:
    m = named(name)
    page = report_page(m, mg.solve(m, {m.drives[0].freedom: np.array([0.1, 0.2])}))
    tame, wild = tame_shape(), Shape(page)
    assert sorted(set(wild.tags)) == sorted(set(tame.tags))
    assert wild.tags.count("script") == tame.tags.count("script")
    assert wild.attributes == tame.attributes
    for picture in re.findall(r'src="data:image/svg\+xml,([^"]*)"', page):
        assert {node.tag.rpartition("}")[2] for node in ElementTree.fromstring(unquote(picture)).iter()} <= SVG


def test_json_ends_no_script() -> None:
    text = json_for_script({"a": "</script><!--<script>&\u2028"})
    assert not set(text) & set("<>&\u2028")
    assert json.loads(text) == {"a": "</script><!--<script>&\u2028"}
    with pytest.raises(ValueError, match="not JSON compliant"):
        json_for_script({"a": float("nan")})


def test_numbers_are_packed() -> None:
    values = np.array([[1.5, -2.0, np.nan]])
    np.testing.assert_array_equal(numbers(packed(values)), values)


def test_wrong_arguments_are_named(tmp_path: Path) -> None:
    m = mg.load("four-bar")
    other = mg.solve(mg.load("r-sg-c"), {"A": 0.1})
    with pytest.raises(mg.DeclarationError, match="belongs to the mechanism 'r-sg-c'"):
        mg.write_report(m, other, path=tmp_path / "x.html")
    with pytest.raises(mg.DeclarationError, match="solution = 3: expected a Solution"):
        mg.write_report(m, 3, path=tmp_path / "x.html")  # type: ignore[arg-type]
    with pytest.raises(mg.DeclarationError, match="expected a Mechanism"):
        mg.write_report("four-bar", path=tmp_path / "x.html")  # type: ignore[arg-type]
    with pytest.raises(mg.FileError, match="no such folder"):
        mg.write_report(m, path=tmp_path / "none" / "x.html")
    assert not list(tmp_path.iterdir())


# --- what it shows -----------------------------------------------------------------------------------------------------


def items_of(page: str, group: str) -> list[dict[str, Any]]:
    return [item for item in data_of(page)["items"] if item["group"] == group]


@pytest.mark.daily(2)
@pytest.mark.parametrize("name", mg.library())
def test_everything_there_is_is_shown(name: str) -> None:
    m = mg.load(name)
    page, report = page_of(name), mg.check(m)
    assert len(items_of(page, "Freedoms")) + len(items_of(page, "Passive freedoms")) == report.mobility
    assert len(items_of(page, "Passive freedoms")) == len(report.passive)
    assert len(items_of(page, "Self-stresses")) == len(report.self_stresses)
    assert len(items_of(page, "Advice")) == len(report.advice)
    for item, advice in zip(items_of(page, "Advice"), report.advice, strict=True):
        after = mg.check(advice.apply())
        assert item["after"]["verdict"] == after.verdict
        assert ["redundancy", str(report.redundancy), str(after.redundancy)] in item["after"]["rows"]


@pytest.mark.daily(2)
@pytest.mark.parametrize(
    "name", ["four-bar", "bricard-cube", "andrews", "slider-crank", "bennett", "spherical-four-bar", "windows-2"]
)
def test_self_stresses_balance_every_link(name: str) -> None:
    """The arrows drawn: on every link that moves their forces, and their moments about any point, add up to nothing."""
    m = mg.load(name)
    L = float(re.search(r"divided by ([\d.e-]+)", items_of(page_of(name), "Self-stresses")[0]["text"])[1])  # type: ignore[index]
    for item in items_of(page_of(name), "Self-stresses"):
        sums = {link: np.zeros(6) for link in m.link_names()}
        most = 0.0
        for arrow in item["arrows"]:
            pair, at = m.pairs[arrow["pair"]], np.array(arrow["at"])
            force, moment = np.array(arrow["force"]), L * np.array(arrow["moment"])
            wrench = np.concatenate([moment + np.cross(at, force), force])
            most = max(most, float(np.abs(wrench).max()))
            sums[pair.a] -= wrench
            sums[pair.b] += wrench
        for link, wrench in sums.items():
            if link != m.frame:
                np.testing.assert_allclose(wrench, 0, atol=2e-3 * most)  # L is printed to four digits


@pytest.mark.daily(3)
@pytest.mark.parametrize("name", ["four-bar", "rssr", "bricard-cube", "7r", "andrews"])
def test_freedoms_move_with_the_loops_closed(name: str) -> None:
    """Both sides of every pair stay together through every wiggle, and something moves."""
    m = mg.load(name)
    data = data_of(page_of(name))
    figure = data["figures"][0]
    links, base = m.link_names(), numbers(figure["frames"])
    for item in data["items"]:
        if item["group"] not in ("Freedoms", "Passive freedoms"):
            continue
        values = numbers(item["motion"]["values"])
        frames = np.repeat(base[None], len(values), axis=0)
        frames[:, item["motion"]["frames"]] = values
        X = frames.reshape(*frames.shape[:2], 3, 4)
        assert np.ptp(X, axis=0).max() > 0.02
        for pair in m.pairs:
            a, b = (X[:, links.index(link)] for link in (pair.a, pair.b))
            ends = [
                x[:, :, :3] @ marker.pose()[:, 3] + x[:, :, 3] for x, marker in zip((a, b), pair.markers, strict=True)
            ]
            if not any(not f.turns for f in pair.type.freedoms):
                np.testing.assert_allclose(*ends, atol=1e-5 * figure["size"])


def test_passive_spin_moves_its_link_alone() -> None:
    m = mg.load("rssr")
    data = data_of(page_of("rssr"))
    (item,) = [item for item in data["items"] if item["group"] == "Passive freedoms"]
    moved = [m.link_names()[i] for i in item["motion"]["frames"] if i < len(m.links)]
    assert moved == ["coupler"]
    assert item["motion"]["kind"] == "spin"
    values = numbers(item["motion"]["values"])
    np.testing.assert_allclose(values[0], values[-1], atol=1e-6)  # a whole turn


def test_curves_are_those_of_the_solution() -> None:
    m = mg.load("rcsr")
    s = mg.solve(m, {"O1": mg.Motion(np.deg2rad(np.arange(150.0, 200.0, 5.0)), 0.1)})
    cycle = data_of(report_page(m, s))["cycle"]
    np.testing.assert_allclose(numbers(cycle["x"]), np.arange(150, 200, 5), rtol=1e-6)
    np.testing.assert_allclose(numbers(cycle["efforts"][0]["series"][0]["values"]), s["O1"].effort[:, 0], rtol=1e-6)
    for k, pair in enumerate(m.pairs):
        np.testing.assert_allclose(
            numbers(cycle["forces"][k]["force"]), s[pair.name].force, atol=1e-5 * np.abs(s["O1"].force).max()
        )
        np.testing.assert_allclose(
            numbers(cycle["forces"][k]["moment"]), s[pair.name].moment, atol=1e-5 * np.abs(s["O1"].moment).max()
        )
        names = [row["name"] for chart in cycle["pairs"][k] for row in chart["series"]]
        assert set(pair.type.component_names) | {"|F|"} <= set(names)
    assert cycle["places"][1] == "O1.Rz = 155 deg"


@pytest.mark.usefixtures("bare")
@pytest.mark.parametrize("drive", [1.2, [0.0, 1.2]])
def test_the_mechanism_stands_where_the_solution_says(drive: Any) -> None:
    """Also at one position, or where nothing moves: not where the report was made."""
    m = mg.load("four-bar")
    s = mg.solve(m, {"A": np.array(drive)})
    data = data_of(report_page(m, s))
    motion = data["items"][0]["motion"]
    last = numbers(data["figures"][0]["frames"]).copy()
    last[motion["frames"]] = numbers(motion["values"])[-1]
    for link, pose in zip(m.link_names(), last, strict=False):
        found = s.link(link).pose.reshape(-1, 4, 4)[-1, :3]
        np.testing.assert_allclose(pose.reshape(3, 4), found, atol=1e-6)


@pytest.mark.usefixtures("bare")
@pytest.mark.parametrize("redundant", ["nan", "minimum_norm"])
def test_what_is_not_unique_is_never_drawn_as_known(redundant: Any) -> None:
    m = mg.load("four-bar")
    page = report_page(m, mg.solve(m, {"A": np.linspace(0, 1, 5)}, redundant=redundant))
    cycle = data_of(page)["cycle"]
    for k, pair in enumerate(m.pairs):
        loose = {name for name, ok in mg.check(m).unique[pair.name].items() if not ok}
        assert loose == {"Fz", "Mx", "My"}
        assert set(cycle["forces"][k]["open"]) == loose
        sure = {row["name"] for chart in cycle["pairs"][k] for row in chart["series"] if row["known"] == "unique"}
        assert not sure & (loose | {"|F|", "|M|"})
        named = {name for chart in cycle["pairs"][k] for name in chart["open"]}
        assert named == (loose if redundant == "nan" else set())


def test_friction_has_its_table_and_its_pictures() -> None:
    m = mg.load("four-bar").to_planar()
    rough = m.replace(loads=[*m.loads, *(mg.Friction(p.name, mu=0.1, radius=0.01) for p in m.pairs)])
    s = mg.solve(rough, {"A": mg.Motion([0.3, 0.9], velocity=10.0)})
    page = report_page(rough, s)
    assert "Power lost by friction" in page
    assert "tangent to the friction circles" in page
    assert f"{np.nanmax(s.losses['A']):.5g}" in page
    assert "Power lost by friction" not in report_page(m, mg.solve(m, {"A": [0.3]}))


@pytest.mark.usefixtures("bare")
def test_declaration_and_its_hash_stand_in_the_page(tmp_path: Path) -> None:
    m = mg.load("four-bar")
    mg.save(m, tmp_path / "m.toml")
    page = report_page(m)
    assert sha256((tmp_path / "m.toml").read_bytes()).hexdigest() in page
    assert "[[pair]]" in page
    held = m.replace(loads=[mg.Effort("D", lambda pose, twist, t: 1.0 + 0 * pose[:, 0, 0])])
    assert "none: it holds functions" in report_page(held, mg.solve(held, {"A": np.array([0.0, 0.1])}))


@pytest.mark.usefixtures("bare")
def test_without_geometry_and_without_closed_loops() -> None:
    page = report_page(mg.chain("RPRHRRR"))
    assert 'id="data"' not in page
    assert "determinate for general geometry" in page
    assert "<math" in page
    open_loop = mg.load("rcsr").replace(start={})
    open_loop = open_loop.replace(
        pairs=[p if p.name != "O4" else p.replace(on_a=mg.Marker((50, 0, 0), (0, 0, 1))) for p in open_loop.pairs]
    )
    page = report_page(open_loop)
    assert "No solution" in page


@pytest.mark.usefixtures("bare")
def test_what_is_too_large_is_left_out_and_said(monkeypatch: pytest.MonkeyPatch) -> None:
    m = mg.load("four-bar")
    monkeypatch.setattr(content, "MOST_ITEMS", 2)
    monkeypatch.setattr(content, "LEAST_ITEMS", 2)
    page = data_of(report_page(m))
    assert [len([i for i in page["items"] if i["group"] == group]) for group in ("Self-stresses", "Advice")] == [2, 2]
    assert page["note"] == "Of 3 self-stresses the first 2 are shown. Of 8 advice the first 2 are shown."
    s = mg.solve(m, {"A": np.linspace(0, 1, 31)})
    monkeypatch.setattr(content, "MOST_POSITIONS", 10)
    page = data_of(report_page(m, s))
    assert numbers(page["cycle"]["x"]) == pytest.approx(np.rad2deg(np.linspace(0, 1, 31))[::4])
    assert page["note"].startswith("Of 31 positions every 4th is shown.")
    monkeypatch.setattr(content, "MOST_LINKS", 3)
    assert "more links than are drawn in space" in report_page(m)
    assert 'id="data"' not in report_page(m)


SIGHT = {
    "usual": np.eye(3),
    "protanopia": np.array(
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    ),
    "deuteranopia": np.array(
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]]
    ),
    "tritanopia": np.array(
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]]
    ),
}
"""How linear red, green and blue are seen (Machado, Oliveira and Fernandes, 2009, severity 1)."""


def seen(colour: str, sight: str) -> np.ndarray:
    """CIELAB of what is seen of ``#rrggbb``."""
    c = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    rgb = np.clip(SIGHT[sight] @ np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4), 0, 1)
    xyz = (
        np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
        @ rgb
        / [0.9505, 1, 1.089]
    )
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("sight", SIGHT)
def test_colours_are_told_apart(sight: str) -> None:
    colours = [*PALETTE, REACTION]
    found = [seen(colour, sight) for colour in colours]
    assert min(np.linalg.norm(a - b) for i, a in enumerate(found) for b in found[:i]) > 12


@pytest.mark.usefixtures("bare")
def test_a_response_and_a_study_have_pages() -> None:
    scipy_stats = pytest.importorskip("scipy.stats")
    m = mg.load("windows-2")
    r = mg.respond(m, np.linspace(0, 1, 21), rates={"A0": -1.0})
    cycle = data_of(report_page(m, r))["cycle"]
    assert cycle["label"] == "time [s]"
    m = mg.load("rcsr")
    ways = {"length[2]": scipy_stats.norm(0.4, 0.001)}
    from concurrent.futures import ThreadPoolExecutor

    with ThreadPoolExecutor(1) as executor:
        study = mg.study(
            m,
            ways,
            {"torque": "O1.effort"},
            n=20,
            seed=1,
            motions={"O1": mg.Motion(np.deg2rad([150, 170]), 0.1)},
            executor=executor,
        )
    page = report_page(m, study=study)
    assert f"{float(study.mean('torque').max()):.5g}" in page
    assert "Sensitivities" in page


@cache
def found() -> mg.Syntheses:
    """Three four-bars that do one function, the last one with a branch defect."""
    asked = np.deg2rad([[0, 0], [72, -30], [144, -10], [216, 10], [288, 20]])
    return mg.synthesize(four_bar(), mg.function("A", "D", asked), ["B.point", "C.point"])


def test_mechanisms_of_a_synthesis_stand_side_by_side_and_move_through_the_positions() -> None:
    data = data_of(report_page(found()))
    assert [item["title"].split(",")[0] for item in data["items"]] == [
        "0: no defect",
        "1: no defect",
        "2: branch defect",
    ]
    for k, (m, item) in enumerate(zip(found(), data["items"], strict=True)):
        assert item["figure"] == k
        figure, motion = data["figures"][k], item["motion"]
        places = [next(i for i, text in enumerate(motion["places"]) if f"position {row}" in text) for row in range(5)]
        assert ("A.Rz = 144 deg, position 2" in motion["places"]) is (k < 2)
        moved = numbers(motion["values"])[places].reshape(5, -1, 3, 4)
        names = [f"link:{name}" for name in m.link_names()]
        for at, number in enumerate(motion["frames"][: len(names) - 1]):
            assert np.abs(moved[:, at] - found().poses[k][:, number, :3]).max() < 1e-4
        (point,) = [text for name, text in figure["pairs"][1]["rows"] if name == "point"]
        assert [float(v) for v in point.split(", ")] == pytest.approx(found().values[k, :2], rel=1e-5)


def test_a_synthesis_without_a_driver_is_shown_position_by_position() -> None:
    places = [(0, 0, 0), (1, 0.5, 0.4), (2, 0.4, 1.1)]
    page = report_page(mg.synthesize(dyad(), mg.poses("body", places), ["B.point"]))
    (item,) = data_of(page)["items"]
    # of defects nothing is known
    assert "without defects" not in page
    assert "without defects" in report_page(found())
    assert item["motion"]["places"] == [f"position {i}" for i in range(3) for _ in range(8)]
    with pytest.raises(mg.DeclarationError, match="no mechanism to show"):
        report_page(found().taken([]))
    with pytest.raises(mg.DeclarationError, match="no solution and no study"):
        report_page(found(), mg.solve(mg.load("four-bar")))


def test_what_is_asked_stands_beside_what_each_does() -> None:
    """A link that begins elsewhere and turns more than once: angles obtained are those that were asked, in degrees."""
    places = [(0.3, 0.1, 3.5), (1, 0.5, 4.0), (2, 0.4, 9)]
    s = mg.synthesize(dyad().replace(units={"length": "mm"}), mg.poses("body", places), ["B.point"])
    ((position, *slides), (_, *turns)) = (list(zip(table.header, *table.rows, strict=True)) for table in compared(s, 0))
    assert position == ("position", "0", "1", "2")
    assert [column[0] for column in slides] == [
        "body.Tx asked [mm]",
        "obtained",
        "error",
        "body.Ty asked [mm]",
        "obtained",
        "error",
    ]
    assert [column[0] for column in turns] == ["body.Rz asked [deg]", "obtained", "error"]
    assert "size [mm]" in str(s)
    for k, (asked, done, error) in enumerate((slides[:3], slides[3:], turns)):
        want = np.array(places)[:, k] * (np.rad2deg(1.0) if k == 2 else 1.0)
        assert asked[1:] == done[1:] == tuple(f"{v:.6g}" for v in want)
        assert max(abs(float(v)) for v in error[1:]) < 1e-12
    asked = mg.poses("body", [(0, 0, 0), (1, 0.5, 0.4), (2, 0.4, 1.1)], at={"A": [0, 0.3, 0.8], "B": [0, 0.1, 0.3]})
    nearly = mg.synthesize(dyad().replace(drives=["A", "B"]), asked, ["B.point"], fit="minimax", starts=1)
    _, *columns = zip(*compared(nearly, 0)[0].rows, strict=True)
    X = nearly.poses[0, :, nearly[0].link_names().index("body")]
    assert columns[2] == tuple(f"{v:.2g}" for v in X[:, 0, 3] - (0, 1, 2))


# --- on the command line -----------------------------------------------------------------------------------------------


def test_the_command_writes_a_page(tmp_path: Path) -> None:
    assert run("report", "rcsr", "--drive", "O1=150:200:10deg@0.1", "-o", tmp_path / "x.html").exit_code == 0
    assert data_of((tmp_path / "x.html").read_text(encoding="utf-8"))["cycle"]["places"][-1] == "O1.Rz = 190 deg"
    assert run("report", "four-bar", "--out", tmp_path / "y.html").stdout.startswith("Wrote ")
    assert (tmp_path / "y.html").read_text(encoding="utf-8") == page_of("four-bar")


@pytest.mark.usefixtures("bare")
def test_a_mechanism_without_an_answer_has_a_page_that_says_so(tmp_path: Path) -> None:
    m = mg.load("rssr")
    free = m.replace(loads=[], pairs=[p.replace(type="C") if p.name == "D" else p for p in m.pairs])
    mg.save(free, tmp_path / "m.toml")
    result = run("report", tmp_path / "m.toml", "-o", tmp_path / "x.html")
    assert result.exit_code == 1
    assert "neither driven nor passive" in result.stderr
    assert "No solution" in (tmp_path / "x.html").read_text(encoding="utf-8")
    assert (
        run("report", "rcsr", "--drive", "O1=150:220:5deg", "--on-reach", "raise", "-o", tmp_path / "y.html").exit_code
        == 1
    )
    assert len(data_of((tmp_path / "y.html").read_text(encoding="utf-8"))["cycle"]["places"]) == 12
    result = run("report", tmp_path / "m.toml", "-o", tmp_path / "m.toml")
    assert result.exit_code == 2
    assert "is the file of the mechanism" in result.stderr


# --- what it does in Chromium --------------------------------------------------------------------------------------------


def labels(reader: Reader) -> dict[str, str]:
    code = "return Object.fromEntries([...document.querySelectorAll('.label')].map((l) => [l.textContent, l.style.transform]))"
    return dict(reader.js(code))


def at_slider(reader: Reader, value: int) -> None:
    code = "const s = document.querySelector('.bar input'); s.value = arguments[0]; s.dispatchEvent(new Event('input', { bubbles: true }))"
    reader.js(code, value)
    reader.settled()


@pytest.mark.daily(1)
@pytest.mark.parametrize("name", SHOWN)
def test_nothing_goes_wrong_and_nothing_leaves(reader: Reader, pages: dict[str, Path], name: str) -> None:
    """Everything that can be chosen is chosen: the console stays silent, and nothing is asked of the network."""
    reader.open(pages[name])
    for button in reader.all(".choices button"):
        reader.js("arguments[0].click()", button)
        reader.settled()
        for side in reader.all(".switch button"):
            reader.js("arguments[0].click()", side)
            reader.settled()
    for option in range(len(reader.all(".panel select option"))):
        reader.js(
            "const s = document.querySelector('.panel select'); s.value = arguments[0]; s.dispatchEvent(new Event('change'))",
            option,
        )
    for part in reader.all("details"):
        reader.js("arguments[0].open = true", part)
    for button in reader.all(".copy, .sort, .tools button"):
        reader.js("arguments[0].click()", button)
    reader.settled()
    assert reader.complaints() == []
    assert reader.requests() == []
    assert "NaN" not in reader.js("return document.getElementById('view').innerText")


def test_the_slider_moves_the_mechanism_and_the_curves_follow(reader: Reader, pages: dict[str, Path]) -> None:
    reader.open(pages["four-bar"])
    effort = mg.solve(mg.load("four-bar"))["A"].effort[:, 0]
    before = labels(reader)
    for frame in (90, 200):
        at_slider(reader, frame)
        assert labels(reader)["B (R)"] != before["B (R)"]
        assert reader.text(".bar output") == f"A.Rz = {frame} deg"
        shown = float(reader.text(".charts .legend output").split()[0])
        assert shown == pytest.approx(effort[frame], rel=1e-3)
        before = labels(reader)


def test_a_curve_sets_the_position(reader: Reader, pages: dict[str, Path]) -> None:
    reader.open(pages["four-bar"])
    actions = pytest.importorskip("selenium.webdriver").ActionChains(reader.driver)
    actions.move_to_element(reader.one(".charts .u-over")).click().perform()
    reader.settled()
    assert 170 < int(reader.js("return document.querySelector('.bar input').value")) < 190


def test_a_click_on_a_pair_shows_its_numbers(reader: Reader, pages: dict[str, Path]) -> None:
    """Where a pair is seen follows from the figure: the projection of the page is tested with it."""
    reader.open(pages["four-bar"])
    data = data_of(pages["four-bar"].read_text(encoding="utf-8"))
    figure = data["figures"][0]
    canvas = reader.one(".stage canvas")
    reader.js("arguments[0].scrollIntoView({ block: 'center' })", canvas)
    width, height = canvas.size["width"], canvas.size["height"]
    look, up = np.array(figure["look"]), np.array(figure["up"])
    right = np.cross(up, look)
    over = max(figure["span"][1], figure["span"][0] * height / width)
    s = mg.solve(mg.load("four-bar"))
    for number, pair in enumerate(mg.load("four-bar").pairs):
        at = s.link(pair.b).point(pair.markers[1].point).position[0] - np.array(figure["center"])
        x, y = (float(at @ d) / over * height for d in (right, np.cross(look, right)))
        actions = pytest.importorskip("selenium.webdriver").ActionChains(reader.driver)
        actions.move_to_element_with_offset(canvas, round(x), round(-y)).click().perform()
        reader.settled()
        assert reader.js("return document.querySelector('.panel select').value") == str(number)
        assert pair.b in reader.text(".facts")


@pytest.mark.slow
def test_names_of_pairs_with_unknown_reactions_are_hatched(reader: Reader, pages: dict[str, Path]) -> None:
    hatched = "return [...document.querySelectorAll('.label.open')].map((l) => l.textContent)"
    reader.open(pages["four-bar"])
    reader.settled()
    assert reader.js(hatched) == ["A (R)", "B (R)", "C (R)", "D (R)"]
    reader.js("[...document.querySelectorAll('.tools input')].at(-1).click()")
    reader.settled()
    assert reader.js(hatched) == []
    reader.open(pages["rcsr"])
    reader.settled()
    assert reader.js(hatched) == []


def test_another_mechanism_of_a_synthesis_is_played(reader: Reader, tmp_path: Path) -> None:
    mg.write_report(found(), path=tmp_path / "found.html")
    reader.open(tmp_path / "found.html")
    seen = labels(reader)
    reader.js("arguments[0].click()", reader.all(".choices button")[2])
    reader.wait(lambda: reader.text(".play") == "Pause")
    reader.js("arguments[0].click()", reader.all(".play")[0])
    assert labels(reader).keys() == seen.keys()
    assert labels(reader)["C (R)"] != seen["C (R)"]
    at_slider(reader, 8)
    assert reader.text(".bar output") == "position 1"
    assert reader.complaints() == []
    assert reader.requests() == []


def test_play_and_pause(reader: Reader, pages: dict[str, Path]) -> None:
    reader.open(pages["rcsr"])
    play = reader.one(".play")
    reader.js("arguments[0].click()", play)
    reader.wait(lambda: int(reader.js("return document.querySelector('.bar input').value")) > 2)
    reader.js("arguments[0].click()", play)
    stands = reader.js("return document.querySelector('.bar input').value")
    time.sleep(0.2)
    assert reader.js("return document.querySelector('.bar input').value") == stands
    assert reader.text(".play") == "Play"


@pytest.mark.slow
def test_nothing_moves_by_itself_for_those_who_want_that(reader: Reader, pages: dict[str, Path]) -> None:
    reader.open(pages["rssr"], prefers_reduced_motion="reduce")
    for button in reader.all(".choices button"):
        reader.js("arguments[0].click()", button)
        reader.settled()
        before = labels(reader)
        time.sleep(0.15)
        assert labels(reader) == before
        assert reader.text(".play") == "Play"
    reader.open(pages["rssr"])
    reader.js("document.querySelectorAll('.choices button')[1].click()")
    before = labels(reader)
    reader.wait(lambda: labels(reader) != before)


@pytest.mark.slow
def test_by_keyboard_alone(reader: Reader, pages: dict[str, Path]) -> None:
    keys = pytest.importorskip("selenium.webdriver.common.keys").Keys
    reader.open(pages["rcsr"])
    canvas = reader.one(".stage canvas")
    for key in (keys.ARROW_LEFT, keys.ARROW_UP, "+"):
        before = labels(reader)
        canvas.send_keys(key)
        reader.settled()
        assert labels(reader) != before
    canvas.send_keys("0")
    slider = reader.one(".bar input")
    slider.send_keys(keys.ARROW_RIGHT)
    assert reader.text(".bar output") == "O1.Rz = 152 deg"
    reached = set()
    reader.js("document.activeElement.blur(); window.scrollTo(0, 0)")
    for _ in range(60):
        reader.driver.switch_to.active_element.send_keys(keys.TAB)
        reached.add(reader.js("const e = document.activeElement; return e.tagName + '.' + e.className + '.' + e.type"))
    assert {
        "CANVAS..undefined",
        "INPUT..range",
        "SUMMARY..undefined",
        "BUTTON.play.button",
        "SELECT..select-one",
    } <= reached


def test_tables_sort_and_copy(reader: Reader, pages: dict[str, Path]) -> None:
    reader.open(pages["rcsr"])
    table = next(t for t in reader.all("main table") if "force" in t.text)
    column = 4
    cells = "return [...arguments[0].tBodies[0].rows].map((row) => row.cells[arguments[1]].textContent)"
    button = table.find_elements("css selector", "th button")[column]
    reader.js("arguments[0].click()", button)
    up = [float(text) for text in reader.js(cells, table, column)]
    assert up == sorted(up)
    reader.js("arguments[0].click()", button)
    assert [float(text) for text in reader.js(cells, table, column)] == up[::-1]
    assert table.find_elements("css selector", "th")[column].get_attribute("aria-sort") == "descending"
    reader.command("Browser.grantPermissions", permissions=["clipboardReadWrite", "clipboardSanitizedWrite"])
    frame = reader.js("return arguments[0].closest('.table').querySelector('.copy')", table)
    reader.js("arguments[0].click()", frame)
    reader.wait(lambda: reader.js("return arguments[0].textContent", frame) == "Copied")


@pytest.mark.daily(1)
@pytest.mark.parametrize("name", SHOWN)
@pytest.mark.parametrize("width", [320, 390])
def test_a_phone_shows_it_without_scrolling_sideways(
    reader: Reader, pages: dict[str, Path], name: str, width: int
) -> None:
    reader.open(pages[name], width=width, height=800)
    for part in reader.all("details"):
        reader.js("arguments[0].open = true", part)
    assert reader.js("return document.documentElement.scrollWidth") <= width


@pytest.mark.slow
def test_on_paper_stand_still_pictures(reader: Reader, pages: dict[str, Path]) -> None:
    reader.open(pages["four-bar"])
    shown = "return [...document.querySelectorAll(arguments[0])].map((e) => e.getClientRects().length > 0)"
    assert reader.js(shown, ".stills, #view") == [True, False]
    reader.command("Emulation.setEmulatedMedia", media="print", features=[])
    assert reader.js(shown, ".stills, #view") == [False, True]
    assert all(reader.js("return [...document.querySelectorAll('.stills img')].map((p) => p.naturalWidth > 100)"))
    pdf = base64.b64decode(reader.command("Page.printToPDF")["data"])
    assert pdf.startswith(b"%PDF")
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) > 3  # what is folded is printed
    assert reader.complaints() == []


@pytest.mark.slow
def test_without_drawing_in_space_all_else_works(tmp_path: Path, pages: dict[str, Path]) -> None:
    with chromium(tmp_path / "profile", *DRAWS_NOT) as reader:
        reader.open(pages["four-bar"])
        assert "cannot draw in three dimensions" in reader.text(".stage")
        assert reader.all(".charts canvas")
        reader.js(
            "document.querySelector('.panel select').value = 2; document.querySelector('.panel select').dispatchEvent(new Event('change'))"
        )
        assert "coupler" in reader.text(".facts")
        assert reader.complaints() == []


def test_a_hostile_name_runs_nothing(reader: Reader, tmp_path: Path) -> None:
    name = "<script>window.ran = 1</script><img src=x onerror='window.ran = 2'>"
    m = named(name)
    mg.write_report(m, mg.solve(m, {m.drives[0].freedom: np.linspace(0, 1, 4)}), path=tmp_path / "x.html")
    reader.open(tmp_path / "x.html")
    for button in reader.all(".choices button"):
        reader.js("arguments[0].click()", button)
    assert reader.js("return window.ran") is None
    assert name in reader.text("h1")
    assert reader.complaints() == []
    reader.js("const s = document.createElement('script'); s.textContent = 'window.ran = 3'; document.body.append(s)")
    assert reader.js("return window.ran") is None  # the policy of the page
    assert any("Content Security Policy" in text for text in reader.complaints())


@pytest.mark.parametrize("name", ["four-bar", "rssr", "rcsr"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_accessibility(reader: Reader, pages: dict[str, Path], name: str, scheme: str) -> None:
    """axe-core finds nothing serious, everything unfolded, and with an advice shown."""
    if not AXE.is_file():
        pytest.skip("axe-core is not there: npm ci in the folder of the scripts")
    reader.open(pages[name], prefers_color_scheme=scheme)
    for part in reader.all("details"):
        reader.js("arguments[0].open = true", part)
    reader.js("[...document.querySelectorAll('.choices button')].at(-1).click()")
    reader.settled()
    # the page allows no script but its own: the checker runs beside it
    reader.command("Page.setBypassCSP", enabled=True)
    source = AXE.read_text(encoding="utf-8")
    reader.command("Runtime.evaluate", expression=source)
    found = reader.command(
        "Runtime.evaluate", expression="axe.run().then((r) => JSON.stringify(r.violations))", awaitPromise=True
    )
    violations = json.loads(found["result"]["value"])
    told = [(v["id"], v["impact"], [node["target"] for node in v["nodes"]][:3]) for v in violations]
    assert not [v for v in told if v[1] in ("serious", "critical")]


@pytest.mark.slow
def test_a_notebook_shows_the_same_view(reader: Reader, tmp_path: Path) -> None:
    """The module of the widget in a page that does what a notebook's front end does: it calls ``render`` and takes it away again."""
    pytest.importorskip("anywidget", reason="anywidget is not installed (extra: notebook)")
    widget = mg.solve(mg.load("four-bar"), {"A": np.linspace(0, 1, 11)}).view()
    module = f"data:text/javascript;base64,{base64.b64encode(widget._esm.encode()).decode()}"
    data = json_for_script(widget.data)
    page = (
        f'<!DOCTYPE html><style>{widget._css}</style><div id="cell"></div><script type="application/json" id="d">{data}</script>'
        f'<script type="module">import w from "{module}"; const data = JSON.parse(document.getElementById("d").textContent);'
        'window.done = w.render({ model: { get: () => data }, el: document.getElementById("cell") });</script>'
    )
    (tmp_path / "cell.html").write_text(page, encoding="utf-8")
    reader.open(tmp_path / "cell.html")
    reader.wait(lambda: reader.all("#cell .label"))
    before = labels(reader)
    at_slider(reader, 9)
    assert labels(reader) != before
    reader.js("window.done()")
    assert reader.js("return document.getElementById('cell').childElementCount") == 0
    assert reader.complaints() == []
    assert reader.requests() == []


@pytest.mark.slow
def test_a_notebook_that_runs_holds_the_view() -> None:
    pytest.importorskip("anywidget", reason="anywidget is not installed (extra: notebook)")
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    code = "import mechgraph as mg\nmg.load('four-bar').view()"
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])
    nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    (output,) = notebook.cells[0].outputs
    assert "application/vnd.jupyter.widget-view+json" in output.data
    states = notebook.metadata.widgets["application/vnd.jupyter.widget-state+json"]["state"].values()
    (state,) = [s["state"] for s in states if "_esm" in s["state"]]
    assert state["data"]["items"][0]["title"] == "solved motion"
    assert "mechgraphView.mount" in state["_esm"]


def test_views_that_cannot_be_drawn_say_why() -> None:
    pytest.importorskip("anywidget", reason="anywidget is not installed (extra: notebook)")
    with pytest.raises(mg.DeclarationError, match="no geometry is declared"):
        mg.chain("RRRR").view()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert mg.load("bricard-cube").view().data["cycle"] is None


@pytest.mark.skipif(
    not AXE.is_file() or shutil.which("node") is None, reason="no node, or no npm ci in the folder of the scripts"
)
def test_the_scripts_are_built_from_their_sources(tmp_path: Path) -> None:
    """Checked by TypeScript, linted and tested; what they are built to is what stands in the repository."""
    copy = tmp_path / "web"
    shutil.copytree(WEB, copy, ignore=shutil.ignore_patterns("node_modules"))
    (copy / "node_modules").symlink_to(MODULES)
    for command in (["npm", "run", "check"], ["npm", "test"], ["npm", "run", "build"]):
        done = subprocess.run(command, cwd=copy, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-1000:]
    for name in ("vendor.js", "vendor.css", "view.js", "built.json"):
        assert (copy / name).read_bytes() == (WEB / name).read_bytes()


def door(soft: bool = False) -> mg.Mechanism:
    """A door on two hinges, on springs if it is ``soft``."""
    stiff = {"stiffness": dict.fromkeys(("Fx", "Fy", "Fz", "Mx", "My"), 1e6)} if soft else {}
    hinges = [
        mg.Pair(k, "R", "frame", "door", point=(0, 0, z), axis=(0, 0, 1), **stiff) for k, z in (("A", 0.0), ("B", 1.0))
    ]
    return mg.Mechanism("door", pairs=hinges, drives=["A"])


def verdicts(page: str) -> list[tuple[str, str]]:
    """Color and word of the banner."""
    return re.findall(r'<p class="verdict (\w+)"><span class="word">([^<]*)</span>', page)


@pytest.mark.parametrize(
    ("m", "motion", "banner"),
    [
        (mg.load("rcsr"), None, ("good", "All is determined")),
        (mg.load("rcsr"), {"O1": np.deg2rad([150.0, 220.0])}, ("fair", "See warnings")),
        (door(), None, ("fair", "Not all reactions are unique")),
        (door(soft=True), {"A": 0.0}, ("fair", "Split by stiffness")),
        (door().replace(drives=[]), None, ("bad", "No solution")),
        (mg.Mechanism("graph", pairs=[mg.Pair(k, "R", a, b) for k, a, b in zip("ABC", "fab", "abf", strict=True)], frame="f"), None,
         ("fair", "Topology only")),
    ],
)  # fmt: skip
def test_the_banner_says_what_stands_below(m: mg.Mechanism, motion: Any, banner: tuple[str, str]) -> None:
    """Green only where no warning follows; its word for those who do not see the color."""
    elastic = any(p.stiffness for p in m.pairs)
    s = None if motion is None else mg.solve(m, motion, on_reach="flag", redundant="elastic" if elastic else "nan")
    assert verdicts(report_page(m, s)) == [banner]


def test_the_banner_stands_in_its_color_on_the_page() -> None:
    assert verdicts(page_of("four-bar")) == [("good", "All that a planar model has is unique")]
