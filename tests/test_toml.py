"""TOML files: round trip, faults told at once, nothing half-written."""

import contextlib
import inspect
import json
import os
import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import mechgraph as mg
from mechgraph.model import toml
from mechgraph.model.file_format import SCHEMA as NUMBER
from mechgraph.model.file_format import TABLES_OF_FILE, json_schema, schema_text, with_field_tables
from mechgraph.model.toml import library_path

SCHEMA = json_schema()
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)
FOUR_BAR = (library_path("four-bar")).read_text(encoding="utf-8")


def written(folder: Path, text: str) -> Path:
    path = folder / "m.toml"
    path.write_text(text, encoding="utf-8")
    return path


def faults_of(folder: Path, text: str) -> tuple[str, ...]:
    with pytest.raises(mg.DeclarationError) as caught:
        mg.load(written(folder, text))
    return caught.value.faults


# --- round trip ----------------------------------------------------------------------------------------------------------


def with_every_load() -> mg.Mechanism:
    force = np.arange(12.0).reshape(4, 3)
    return mg.load("four-bar").replace(
        loads=[
            mg.Gravity((0, -9.81, 0)),
            mg.Wrench("rocker", force=force, moment=(0, 0, 1), point=(0.1, 0.2, 0.3), frame="link"),
            mg.Wrench("coupler", force=(1, 2, 3)),
            mg.Effort("D", [0.1, 0.2, 0.3, 0.4]),
            mg.Spring("crank", "rocker", (0, 0.1, 0), (0.4, 0, 0), stiffness=100.0, free_length=0.1, damping=0.5),
            mg.TorsionSpring("D", stiffness=2.0, free=0.3, damping=0.01),
            mg.Damper("D", coefficient=2.0),
            mg.Damper(("crank", "rocker", (0, 0.1, 0), (0.4, 0, 0)), coefficient=3.0),
            mg.ForceLaw("D", law=mg.ForceTable(x=[0, 1, 3], force=[1, 2, 2], outside="hold"), free=0.2, scale=2.0),
            mg.ForceLaw(
                ("crank", "rocker", (0, 0.1, 0), (0.4, 0, 0)),
                law=mg.ForceTable(x=[0, 1], v=[0, 1, 2], force=[[1, 2, 3], [3, 4, 4]], interpolation="cubic"),
            ),
        ]
    )


def with_own_pair_type(reactions: list[str] | None) -> mg.Mechanism:
    slot = mg.PairType("PinInSlot", "pin in slot", freedoms=["Tx", "Rz"], reactions=reactions)
    return mg.Mechanism(
        "own",
        pairs=[
            mg.Pair("A", "R", "frame", "crank", point=(0, 0, 0), axis=(0, 0, 1)),
            mg.Pair("B", slot, "crank", "slider", point=(0.3, 0.1, 0), axis=(0, 0, 1), second=(1, 2, 0)),
            mg.Pair("C", "P", "slider", "frame", point=(0.3, 0, 0), axis=(1, 0, 0)),
        ],
        drives=["A"],
    )


def with_own_bookkeeping() -> mg.Mechanism:
    hinge = mg.pair_types()["R"].bookkeeping
    again = mg.PairType("Hinge", freedoms=["Rz"], reactions=["Fx", "Fy", "Fz", "Mx", "My"], bookkeeping=hinge)
    return mg.Mechanism("hinge", pairs=[mg.Pair("A", again, "frame", "door", point=(0, 0, 0), axis=(0, 0, 1))])


def with_markers() -> mg.Mechanism:
    square = {"axis": (0, 0, 2.0), "second": (1 / 3, 0, 0)}
    return mg.Mechanism(
        "markers",
        links=[
            mg.Link("ground"),
            mg.Link("body", 1.5, (0.1, 0, 0), mg.inertia.box(1.5, (0.1, 0.2, 0.3))),
            mg.Link("end"),
        ],
        pairs=[
            mg.Pair(
                "A",
                "U",
                "ground",
                "body",
                on_a=mg.Marker((0, 0, 1), **square),
                on_b=mg.Marker((0.1, 0.2, 0.3), **square),
            ),
            mg.Pair("B", "S", "body", "end", on_a=mg.Marker((1, 0, 0)), on_b=mg.Marker()),
            mg.Pair("C", "H", "end", "ground", point=(0, 1, 0), axis=(1, 1, 1), lead=0.005),
            mg.Pair("D", "H", "body", "ground", point=(0, 1, 1), axis=(1, 0, 0), pitch=-0.002),
        ],
        drives=[mg.Drive("C", mg.Motion(np.linspace(0, 1, 7), 0.1, np.arange(7.0), np.linspace(0, 2, 7))), "A.Rz"],
        start={"A": (0.1, 0.2), "B.Rx": 1 / 3, "D": -0.5},
        units={"length": "m", "mass": "kg"},
        frame="ground",
        description='quotes " and \\ and é',
        expected={"loops": 1, "notes": ["a", "b"], "table": {"x": 0.1}},
    )


HAND_MADE = {
    "loads": with_every_load,
    "own pair type": lambda: with_own_pair_type(["Fy@1", "Fz", "Mx", "My"]),
    "own bookkeeping": with_own_bookkeeping,
    "own pair type, null space": lambda: with_own_pair_type(None),
    "markers, pitch, lead, units, start, motion": with_markers,
    "topology": lambda: mg.chain("RPRHRRR"),
    "unphysical": lambda: mg.Mechanism(
        "u", [mg.Link("a"), mg.Link("b", 1, (0, 0, 0), -np.eye(3), unphysical=True)], [mg.Pair("A", "R", "a", "b")]
    ),
    "moved": lambda: with_every_load().moved([[0, -1, 0, 0.1], [1, 0, 0, 1 / 3], [0, 0, 1, 1e5], [0, 0, 0, 1]]),
}


@pytest.mark.daily(15)
@pytest.mark.parametrize("name", mg.library())
def test_library_mechanisms_come_back_equal(tmp_path: Path, name: str) -> None:
    m = mg.load(name)
    mg.save(m, tmp_path / "m.toml")
    assert mg.load(tmp_path / "m.toml") == m


@pytest.mark.parametrize("case", HAND_MADE)
def test_hand_made_mechanisms_come_back_equal(tmp_path: Path, case: str) -> None:
    m = HAND_MADE[case]()
    mg.save(m, tmp_path / "m.toml")
    again = mg.load(tmp_path / "m.toml")
    assert again == m
    mg.save(again, tmp_path / "again.toml")
    assert (tmp_path / "again.toml").read_bytes() == (tmp_path / "m.toml").read_bytes()
    VALIDATOR.validate(tomllib.loads((tmp_path / "m.toml").read_text(encoding="utf-8")))


def test_degrees_are_radians_and_the_end_of_a_sweep_is_excluded() -> None:
    m = mg.load("rcsr")
    motion = m.drives[0].motion
    assert motion is not None
    assert np.allclose(np.rad2deg(motion.position), np.arange(150, 204, 2), rtol=0, atol=1e-12)
    for first, end, step, count in (
        (0, 360, 0.1, 3600),
        (30, 390, 1, 360),
        (0, -90, -0.3, 300),
        (0, 10, 3, 4),
        (0, 1e-10, 1, 1),
        (1000.1, 1000.4, 0.1, 3),
    ):
        swept = (
            toml.parse(tomllib.loads(FOUR_BAR.replace("[0.0, 360.0, 1.0]", f"[{first}, {end}, {step}]")), "x")
            .drives[0]
            .motion
        )
        assert swept is not None
        assert len(swept.position) == count


# --- faults --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('description = "', 'descripton = "', "unknown field 'descripton'"),
        (
            "schema = 1",
            "schema = 99",
            "this version of mechgraph reads schemas 1 to 2; a file of a later one needs a newer version",
        ),
        ("schema = 1\n", "", "schema missing"),
        ('name = "crank"\nmass', 'name = "crank"\nweight', "unknown field 'weight'"),
        ('name = "crank"\nmass = ', 'name = "crank"\nmass = "heavy" # ', "expected a finite number"),
        ('type = "R"', 'type = "Q"', "unknown type 'Q'"),
        ('freedom = "A"', 'freedom = "Z"', "unknown freedom 'Z'"),
        ("sweep_deg = [0.0, 360.0, 1.0]", "sweep_deg = [0.0, 360.0]", "sweep"),
        ("sweep_deg = [0.0, 360.0, 1.0]", 'sweep_deg = ["a", 1, 2]', "expected numbers"),
        ("sweep_deg = [0.0, 360.0, 1.0], ", "", "position or sweep missing"),
        ('kind = "gravity"', 'kind = "levity"', "expected one of gravity"),
        ('kind = "gravity"', "kind = []", "expected one of gravity"),
        ('b = "rocker"\n', "", "field b missing"),
        ("[units]\n", "[[units]]\n", "expected a table"),
        ("axis = [0.0, 0.0, 1.0]", "axis = [0.0, 0.0, 0.0]", "has length 0"),
        ('description = "', 'expected = 3\ndescription = "', "expected"),
        ('name = "four-bar"', "name = 7", "expected a text"),
        ('name = "four-bar"', 'name = "four-bar"\nstart = { "A" = "x" }', "expected a finite number"),
        ('name = "four-bar"', 'name = "four-bar"\nchain = { pairs = "RRRR" }', "give one form"),
    ],
)
def test_a_fault_is_named(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in FOUR_BAR
    text = FOUR_BAR.replace(old, new, 1)
    if old == 'description = "' and "expected = 3" in new:
        text = text.partition("[expected]")[0]
    assert any(words in fault for fault in faults_of(tmp_path, text))


def test_several_faults_come_at_once(tmp_path: Path) -> None:
    text = (
        FOUR_BAR.replace("schema = 1", "schema = 3")
        .replace('kind = "gravity"', 'kind = "levity"')
        .replace("value = 1.0", "vallue = 1.0")
    )
    text += "\n[extra]\n"
    faults = faults_of(tmp_path, text)
    for words in ("schema", "levity", "vallue", "'extra'", "value missing"):
        assert any(words in fault for fault in faults), (words, faults)


WRONG: list[Any] = [None, -1, 1e400, "", "x", [], [[]], {}, {"x": 1}, True, [1, "a"]]


def places(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    return [q for key, value in items for q in [(*path, key), *places(value, (*path, key))]]


@pytest.mark.slow
@pytest.mark.daily(1)
@pytest.mark.parametrize("name", ["four-bar", "rchch", "bennett", "own"])
def test_whatever_stands_in_a_field_the_error_is_ours(name: str) -> None:
    m = with_own_pair_type(["Fy@1", "Fz", "Mx", "My"]) if name == "own" else None
    text = json.dumps(toml.to_data(m) if m else tomllib.loads(library_path(name).read_text(encoding="utf-8")))
    for place in places(json.loads(text)):
        for wrong in WRONG:
            data = json.loads(text)
            inner = data
            for key in place[:-1]:
                inner = inner[key]
            if wrong is None:
                inner.pop(place[-1])
            else:
                inner[place[-1]] = wrong
            with contextlib.suppress(mg.MechgraphError):
                toml.parse(data, "fuzzed")


def test_no_toml_and_no_file_are_file_errors(tmp_path: Path) -> None:
    with pytest.raises(mg.FileError, match=r"is not (valid TOML|a valid TOML file)"):
        mg.load(written(tmp_path, "name = = 3"))
    (tmp_path / "latin.toml").write_bytes(b'name = "\xe9"')
    with pytest.raises(mg.FileError, match=r"is not (valid TOML|a valid TOML file)"):
        mg.load(tmp_path / "latin.toml")
    with pytest.raises(mg.FileError, match="cannot be read"):
        mg.load(tmp_path / "absent.toml")
    with pytest.raises(mg.FileError, match="cannot be read"):
        mg.load(tmp_path)
    with pytest.raises(mg.FileError, match="neither a library mechanism"):
        mg.load("no-such-mechanism")


DEEP = 5000


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (FOUR_BAR.replace("schema = 1", f"schema = {'1' * 5000}", 1), "line 3: an integer of more digits"),
        (FOUR_BAR + f"\n[extra]\nx = {10**400}\n", "field 'extra': an integer beyond 64 bits"),
        (f"a = 1\nx = {'[' * DEEP}{']' * DEEP}", "line 2: nested too deeply"),
        (f"\n\nx = {'{a = ' * DEEP}1{'}' * DEEP}", "line 3: nested too deeply"),
        (f"{'[' * 100}{']' * 100}", "is not valid TOML"),
        (f"x = {'[' * 100}{']' * 100}", "field 'x': nested more than 32 levels deep"),
        ("a = 1\n" + ".".join(["b"] * 20000) + " = 1", "line 2: nested too deeply"),
        (b"\xef\xbb\xbf" + FOUR_BAR.encode(), "line 1 begins with a byte-order mark"),
        (FOUR_BAR.encode("utf-16"), "line 1: not in UTF-8"),
        (b"a = 1\nb = '\xff'", "line 2: not in UTF-8"),
    ],
    ids=range(10),
)
def test_what_no_reader_can_hold_is_refused_with_its_place(tmp_path: Path, content: str | bytes, words: str) -> None:
    path = tmp_path / "m.toml"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(mg.FileError, match=re.escape(words)):
        mg.load(path)


@pytest.mark.parametrize("sweep", ["[0, 1e9, 1]", "[0, 1e99, 1e-99]", "[0.0, -1e12, -0.1]"])
def test_a_sweep_of_too_many_positions_is_refused(tmp_path: Path, sweep: str) -> None:
    path = written(tmp_path, FOUR_BAR.replace("[0.0, 360.0, 1.0]", sweep))
    with pytest.raises(mg.FileError, match=r"drive 1\.motion\.sweep = .* positions, at most 1000000 are taken"):
        mg.load(path)


@pytest.mark.parametrize(
    ("sweep", "words"),
    [
        ("[6, 5, 0.5]", "leads away"),
        ("[5.0, 6.0, -1.0]", "leads away"),
        ("[5, 5, 1]", "the end"),
        ("[0, 1, 0]", "is 0"),
    ],
)
def test_a_sweep_without_positions_is_refused(tmp_path: Path, sweep: str, words: str) -> None:
    path = written(tmp_path, FOUR_BAR.replace("[0.0, 360.0, 1.0]", sweep))
    with pytest.raises(mg.FileError, match=rf"drive 1\.motion\.sweep = .*: no positions: .*{words}"):
        mg.load(path)


def test_a_file_that_never_ends_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.toml")
    (tmp_path / "null.toml").symlink_to("/dev/zero")
    for name in ("pipe.toml", "null.toml"):
        with pytest.raises(mg.FileError, match="no regular file"):
            mg.load(tmp_path / name)
    with (tmp_path / "long.toml").open("wb") as file:
        file.truncate(2**40)
    with pytest.raises(mg.FileError, match="larger than"):
        mg.load(tmp_path / "long.toml")


def test_faults_of_the_format_and_of_the_mechanism_come_at_once(tmp_path: Path) -> None:
    text = FOUR_BAR.replace("schema = 1", "schema = 3").replace('kind = "gravity"', 'kind = "gravity"\nbad = 3')
    text = text.replace('freedom = "A"', 'freedom = "Z"').replace("axis = [0.0, 0.0, 1.0]", "axis = [0.0, 0.0, 0.0]", 1)
    path = written(tmp_path, re.sub(r'(name = "crank"\nmass = )([\d.]+)', r'\1"\2"', text))
    with pytest.raises(mg.ContentError) as caught:
        mg.load(path)
    assert isinstance(caught.value, mg.FileError)
    for words in ("schema = 3", "'bad'", "'Z'", "length 0", "mass = '"):
        assert words in str(caught.value)
    # where a thing is left out for its faults, what refers to it is not blamed
    text = text.replace('name = "rocker"', 'nam = "rocker"', 1)
    assert not any("not declared" in fault for fault in faults_of(tmp_path, text))
    assert any("length 0" in fault for fault in faults_of(tmp_path, text))


# --- writing -------------------------------------------------------------------------------------------------------------


def test_a_callable_load_leaves_no_file(tmp_path: Path) -> None:
    m = mg.load("four-bar").replace(loads=[mg.Effort("D", lambda pose, twist, t: 1.0)])
    with pytest.raises(mg.FileError, match="callable"):
        mg.save(m, tmp_path / "m.toml")
    assert not list(tmp_path.iterdir())


def test_an_unwritable_path_is_a_file_error(tmp_path: Path) -> None:
    with pytest.raises(mg.FileError, match="cannot be written"):
        mg.save(mg.load("four-bar"), tmp_path / "absent" / "m.toml")
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(mg.FileError, match="cannot be written"):
        mg.save(mg.load("four-bar"), tmp_path / "folder.toml")
    assert [p.name for p in tmp_path.iterdir()] == ["folder.toml"]


def test_an_existing_file_survives_a_failed_save(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "m.toml"
    mg.save(mg.load("four-bar"), path)
    before = path.read_bytes()
    with pytest.raises(mg.FileError):
        mg.save(mg.load("four-bar").replace(loads=[mg.Effort("D", lambda pose, twist, t: 1.0)]), path)

    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(toml.os, "replace", full)
    with pytest.raises(mg.FileError, match="No space left"):
        mg.save(mg.load("bennett"), path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["m.toml"]


def test_a_file_has_the_least_number_that_serves_it_and_a_newer_one_is_refused_by_name(tmp_path: Path) -> None:
    plain = mg.load("four-bar")
    law = mg.CamLaw([mg.Segment("cycloidal", rise=0.01, over=np.pi), mg.Segment("cycloidal", rise=-0.01, over=np.pi)])
    groove = mg.Pair(
        "K", "Rg", "cam", "f", curve=mg.Curve.barrel(law=law, radius=0.05), on_b=mg.Marker((0, 0, 0), (1, 0, 0))
    )
    later = [plain.to_planar(), plain.replace(gears=[mg.Pulley("w", "crank", (0, 0, 0), (0, 0, 1), radius=0.01)])]
    for m, number in [(plain, 1), *((one, 2) for one in later)]:
        mg.save(m, tmp_path / "m.toml")
        text = (tmp_path / "m.toml").read_text()
        assert f"schema = {number}\n" in text
        assert mg.load(tmp_path / "m.toml") == m
        (tmp_path / "m.toml").write_text(text.replace(f"schema = {number}", "schema = 1"))
        assert mg.load(tmp_path / "m.toml") == m  # as versions before the number 2 wrote it
    cam = mg.Mechanism("cam", pairs=[mg.Pair("A", "R", "frame", "cam", point=(0, 0, 0), axis=(0, 0, 1)), groove])
    mg.save(cam, tmp_path / "m.toml")
    assert "schema = 2\n" in (tmp_path / "m.toml").read_text()


# --- the JSON Schema for editors -----------------------------------------------------------------------------------------


def test_the_schema_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.daily(15)
@pytest.mark.parametrize("name", mg.library())
def test_library_files_keep_the_schema(name: str) -> None:
    text = library_path(name).read_text(encoding="utf-8")
    assert text.startswith("#:schema ./mechanism.schema.json\n")
    VALIDATOR.validate(tomllib.loads(text))


@pytest.mark.parametrize(
    "kind", ["pair_type", "freedom", "component", "bookkeeping", "link", "marker", "hertz", "pair", "drive"]
)
def test_a_table_holds_what_its_constructor_takes(kind: str) -> None:
    table = TABLES_OF_FILE[kind]
    assert set(table.fields) == set(inspect.signature(table.make).parameters)


def test_the_stored_schema_is_the_one_of_the_code(golden: Callable[[str, str], None]) -> None:
    golden("../../library/mechanism.schema.json", schema_text())


def test_the_tables_of_the_readme_are_those_of_the_code(golden: Callable[[str, str], None]) -> None:
    text = (library_path() / "README.md").read_text(encoding="utf-8")
    assert text.count("<!-- fields: ") == 14
    golden("../../library/README.md", with_field_tables(text))
    assert SCHEMA["properties"]["schema"]["enum"][-1] == NUMBER


@pytest.mark.parametrize(
    ("old", "new"),
    [("mass = ", "weight = "), ("schema = 1", "schema = 3"), ('kind = "gravity"', 'kind = "levity"'), ('a = "frame"', ""),
     ("sweep_deg = [0.0, 360.0, 1.0]", "sweep_deg = [0.0, 360.0]")],
)  # fmt: skip
def test_the_schema_finds_what_the_loader_finds(tmp_path: Path, old: str, new: str) -> None:
    text = FOUR_BAR.replace(old, new, 1)
    assert not VALIDATOR.is_valid(tomllib.loads(text))
    assert faults_of(tmp_path, text)


def test_a_saved_file_says_what_a_reader_would(tmp_path):
    """What stands where it is left out is left out, and lists fill their lines: some seven lines a link and pair."""
    pairs = [mg.Pair(f"P{i}", "R", f"l{i}", f"l{(i + 1) % 8}", point=(i, i * i, 0.5), axis=(0, 0, 1)) for i in range(8)]
    links = [mg.Link(f"l{i}", 1.0, (i, 0, 0), np.eye(3)) for i in range(8)]
    m = mg.Mechanism("eight", links, pairs, ["P0"])
    mg.save(m, tmp_path / "m.toml")
    text = (tmp_path / "m.toml").read_text()
    assert mg.load(tmp_path / "m.toml") == m
    assert "inertia = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n" in text
    assert not re.search("closed|unphysical|second", text)
    assert text.count("\n") < 120
    long = m.replace(drives=[mg.Drive("P0", mg.Motion(np.arange(100) / 7))], description="[\n    1.0,\n]")
    mg.save(long, tmp_path / "m.toml")
    assert mg.load(tmp_path / "m.toml") == long
    assert max(map(len, (tmp_path / "m.toml").read_text().splitlines())) <= 125


def test_a_saved_file_is_as_short_as_a_written_one() -> None:
    """But for chains, which are saved pair by pair: characters of the files of the library without comments and spaces."""

    def size(text: str) -> int:
        return sum(len("".join(line.partition("#")[0].split())) for line in text.splitlines())

    files = {name: library_path(name).read_text(encoding="utf-8") for name in mg.library()}
    longer = {
        name: (found, size(text))
        for name, text in files.items()
        if "[chain]" not in text and (found := size(toml.written(mg.load(name)))) > 1.1 * size(text)
    }
    assert longer == {}


def test_rates_of_a_motion_are_saved_as_they_were_given() -> None:
    t = np.linspace(0, 1, 9)
    m = mg.load("four-bar")
    for motion in (mg.Motion(t**2, t=t), mg.Motion(t, 2.0), mg.Motion(t, 2 * t, 0.0), mg.Motion(3.0, t)):
        made = m.replace(drives=[mg.Drive("A", motion=motion)])
        text = toml.written(made)
        assert toml.parse(tomllib.loads(text), "again") == made
        assert "acceleration = [\n" not in text


def test_evenly_spaced_positions_are_saved_as_a_sweep() -> None:
    """The motion of 7r took 64 lines; what is read again is the same to the last bit."""
    assert "sweep_deg = [0.0, 360.0, 1.0]" in toml.written(mg.load("7r"))
    m = mg.load("four-bar")

    def again(positions: Any) -> str:
        made = m.replace(drives=[mg.Drive("A", motion=mg.Motion(positions, velocity=2.0))])
        text = toml.written(made)
        assert toml.parse(tomllib.loads(text), "again") == made
        return text

    even = np.arange(0, 1, 0.01), 0.1 * np.arange(4), 0.3 - np.radians(2.0) * np.arange(50)
    assert all("sweep" in again(positions) for positions in even)
    again(np.linspace(0.3, -2, 77)), again(np.radians(np.arange(20.0, -40, -3)))  # to the last bit, as a sweep or not
    odd = [0, 0, 0, 0], [0, 0.1, 0.2, 0.3 + 1e-9], [0.0, 1.0], [0.5]
    assert not any("sweep" in again(positions) for positions in odd)
