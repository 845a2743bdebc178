"""``--json`` of every command: valid by the stored schema, true to the results, and advice that scripts can apply."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import tomli_w
from program import app, invoke

import mechgraph as mg
from mechgraph.cli import options
from mechgraph.cli.records import COMMANDS, output_schema
from mechgraph.files import json_text, patch, plain, schema_of
from mechgraph.kinematics.motion_path import Status
from mechgraph.model.file_format import laid_out
from mechgraph.model.toml import to_data

CALLS = [
    ("list",), ("check", "four-bar"), ("check", "rssr"), ("check", "rcsr"), ("check", "bricard-cube"), ("check", "windows-2"),
    ("check", "four-bar", "--at", "A=30deg"), ("equations", "rcsr"), ("equations", "rcsr", "--at", "O1=160deg@0.1"),
    ("equations", "rcsr", "--unknowns", "response"), ("solve", "four-bar"), ("solve", "four-bar", "--redundant", "minimum_norm"),
    ("solve", "rcsr", "--drive", "O1=150:220:1deg", "--on-reach", "flag"), ("solve", "rssr", "--drive", "A=30deg"),
    ("loads", "7r", "link3", "--drive", "O1=0:360:30deg@10", "--at", "all"), ("loads", "four-bar", "coupler"),
    ("solve", "7r", "--drive", "O1=0:360:5deg@10", "--over-time"), ("respond", "windows-2", "--for", "1s", "--over-time"),
    ("structure", "windows-2", "--driver", "A1"), ("structure", "bennett"),
    ("assemblies", "four-bar", "--at", "A=30deg"), ("branches", "four-bar", "--driver", "A"),
    ("respond", "haug-slider-crank", "--for", "100ms", "--rate", "A=6"),
]  # fmt: skip


def run(*arguments: str | Path, status: int = 0) -> Any:
    result = invoke(*arguments, "--json")
    assert result.exit_code == status, result.output
    return json.loads(result.stdout, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))


@pytest.fixture(scope="module")
def schema() -> jsonschema.protocols.Validator:
    made = output_schema()
    jsonschema.Draft202012Validator.check_schema(made)
    return jsonschema.Draft202012Validator(made)


def test_the_stored_schema_is_current(golden: Callable[[str, str], None]) -> None:
    golden("../../library/output.schema.json", laid_out(output_schema()) + "\n")


def test_every_command_has_a_schema() -> None:
    commands = {command.name for command in app.registered_commands}
    takes = {c.name for c in app.registered_commands if "json" in c.callback.__annotations__}
    assert takes == commands == set(COMMANDS)


@pytest.mark.daily(3)
@pytest.mark.parametrize("call", CALLS, ids=" ".join)
def test_output_is_valid(call: tuple[str, ...], schema: jsonschema.protocols.Validator) -> None:
    data = run(*call)
    schema.validate(data)
    assert (data["schema"], data["command"]) == (1, call[0])
    wrong = {**data, "more": 1}
    assert not schema.is_valid(wrong)
    del data["schema"]
    assert not schema.is_valid(data)


def test_everything_in_the_schema_is_described(schema: jsonschema.protocols.Validator) -> None:
    for name, of in schema.schema["$defs"].items():
        assert of["description"], name
    check = schema.schema["$defs"]["command check"]["properties"]
    assert all("description" in of for key, of in check.items() if key not in ("schema", "command"))


def applied(document: Any, steps: list[dict[str, Any]]) -> Any:
    """A JSON Patch applied, by RFC 6902."""
    document = json.loads(json.dumps(document))
    for step in steps:
        *way, last = [part.replace("~1", "/").replace("~0", "~") for part in step["path"].split("/")[1:]]
        at = document
        for part in way:
            at = at[int(part)] if isinstance(at, list) else at[part]
        if isinstance(at, list):
            if last == "-":
                at.append(step["value"])
            else:
                at[int(last)] = step["value"]
        elif step["op"] == "remove":
            del at[last]
        else:
            at[last] = step["value"]
    return document


@pytest.mark.daily(3)
@pytest.mark.parametrize("name", ["four-bar", "rssr", "windows-2", "bennett", "rprhrrr", "slider-crank"])
def test_each_advice_can_be_applied(name: str, tmp_path: Path) -> None:
    data = run("check", name)
    report = mg.check(mg.load(name))
    assert len(data["advice"]) == len(report.advice)
    for number, (told, advice) in enumerate(zip(data["advice"], report.advice, strict=True)):
        new = applied(data["declaration"], told["patch"])
        file = tmp_path / f"{number}.toml"
        file.write_text(tomli_w.dumps(new), encoding="utf-8")
        assert mg.load(file) == advice.apply()
        assert advice.patch() == patch(to_data(report.mechanism), to_data(advice.apply()))
        if advice.effect is not None:
            assert mg.check(mg.load(file)).redundancy == advice.effect.redundancy[1]


def test_an_advice_is_saved_by_its_number(tmp_path: Path) -> None:
    told = run("save", "four-bar", "--advice", "1", "--out", tmp_path / "better.toml")
    assert told == {"schema": 1, "command": "save", "mechanism": "four-bar", "file": str(tmp_path / "better.toml")}
    assert mg.load(tmp_path / "better.toml") == mg.check(mg.load("four-bar")).advice[1].apply()
    result = invoke("save", "four-bar", "--advice", "99", "--out", str(tmp_path / "x.toml"))
    assert result.exit_code == 2
    assert "counted from 0" in result.stderr


def test_solve_tells_the_results(tmp_path: Path) -> None:
    data = run("solve", "four-bar", "--out", tmp_path / "x.csv")
    s = mg.solve(mg.load("four-bar"))
    assert data["written"] == {"file": str(tmp_path / "x.csv"), "rows": 360, "columns": len(s.columns())}
    assert data["efforts"][0]["greatest"]["value"] == s["A"].effort.max()
    assert data["efforts"][0]["greatest"]["position"] == s["A"].effort.argmax()
    assert data["efforts"][0]["greatest"]["drivers"] == {"A.Rz": s["A"].position[s["A"].effort.argmax(), 0]}
    for told in data["reactions"]:
        parts = [s[told["pair"]].components[name] for name in told["force"]["parts"]]
        assert math.isclose(told["force"]["greatest"]["value"], np.linalg.norm(parts, axis=0).max())
        assert told["moment"]["greatest"] is None
        assert told["not_unique"] == ["Fz", "Mx", "My"]
    assert data["checks"]["closure"] == s.checks.closure.max()
    assert mg.kinematics(mg.load("four-bar"), {"A": [0.1]}).to_dict()["reactions"] == []


def test_a_page_is_named(tmp_path: Path, schema: jsonschema.protocols.Validator) -> None:
    data = run("report", "four-bar", "-o", tmp_path / "x.html")
    schema.validate(data)
    assert (data["mechanism"], data["file"]) == ("four-bar", str(tmp_path / "x.html"))


def test_loads_tells_what_acts() -> None:
    data = run("loads", "7r", "link3", "--drive", "O1=0:360:30deg@10", "--at", "all")
    body = mg.free_body(mg.solve(mg.load("7r"), {"O1": mg.Motion(np.deg2rad(np.arange(0, 360, 30.0)), 10.0)}), "link3")
    assert len(data["cases"]) == 12
    for case in data["cases"]:
        for name, told in case["wrenches"].items():
            wrench = body[name].wrench[case["position"]]
            np.testing.assert_allclose(told["moment"] + told["force"], wrench, rtol=1e-9, atol=1e-12)
            assert all(told["unique"])
    planar = run("loads", "four-bar", "coupler")["cases"][0]["wrenches"]["B"]
    assert (planar["force"][2], planar["unique"][5], planar["unique"][3]) == (None, False, True)


def test_a_failure_leaves_no_output() -> None:
    result = invoke("solve", "rcsr", "--drive", "O1=150:220:1deg", "--json")
    assert (result.exit_code, result.stdout) == (1, "")
    assert "out of reach" in result.stderr


@pytest.mark.parametrize(
    "call",
    [("check", "rcsr", "--markdown"), ("solve", "rcsr", "--compare"), ("equations", "rcsr", "--latex")],
    ids=" ".join,
)
def test_what_excludes_it(call: tuple[str, ...]) -> None:
    assert invoke(*call, "--json").exit_code == 2


def test_numbers_that_json_has_not() -> None:
    assert plain({"a": [math.nan, math.inf, 1.0]}) == {"a": [None, None, 1.0]}
    assert json.loads(json_text({"a": math.nan})) == {"a": None}
    with pytest.raises(TypeError, match="no JSON Schema"):
        schema_of(np.ndarray, {})


@pytest.mark.parametrize(
    ("text", "positions", "velocity", "acceleration"),
    [
        ("O1=0:360:90deg", np.deg2rad([0, 90, 180, 270]), 0.0, 0.0),
        ("O1=0:1:0.25", [0, 0.25, 0.5, 0.75], 0.0, 0.0),
        ("O1=0deg:90deg:45deg@10", np.deg2rad([0, 45]), 10.0, 0.0),
        ("O1=10:-20:-10deg@-2@0.5", np.deg2rad([10, 0, -10]), -2.0, 0.5),
        ("O1.Rz=30deg@60deg/s@90deg/s^2", np.deg2rad(30), np.deg2rad(60), np.deg2rad(90)),
        ("O1 = 0.1rad", 0.1, 0.0, 0.0),
        ("O1=0:0.3:0.1", [0, 0.1, 0.2], 0.0, 0.0),
        ("O1=1e-1:.25:5.e-2", [0.1, 0.15, 0.2], 0.0, 0.0),
        ("O2.Tz=-9:-8:0.5@2", [-9.0, -8.5], 2.0, 0.0),
    ],
)
def test_drive_syntax(text: str, positions: list[float], velocity: float, acceleration: float) -> None:
    name, motion = options.parse_drive(mg.load("rcsr"), text)
    assert name in text
    assert np.allclose(motion.position, positions, atol=1e-15)
    assert motion.shape == np.shape(positions)
    assert np.allclose(motion.velocity, velocity)
    assert np.allclose(motion.acceleration, acceleration)


def test_a_time_span_is_converted_to_the_declared_unit() -> None:
    assert [options.duration(text, "--for", "ms") for text in ("2s", "2ms", "2")] == [2000.0, 2.0, 2.0]
    assert options.duration("5ms", "--for") == 0.005


def test_every_outcome_and_every_error_stands_in_its_table() -> None:
    """And nothing else; warnings and the common base have no row."""
    page = (Path(__file__).parents[1] / "docs" / "reference" / "statuses.md").read_text(encoding="utf-8")
    first = [row.split("|")[1].strip().split(", ") for row in page.splitlines() if row.startswith("| ")]
    names = [name.strip("`") for row in first for name in row if name not in ("status", "error")]
    errors = {name for name in mg.__all__ if name.endswith("Error")} - {"MechgraphError"}
    assert sorted(names) == sorted([*(status.value for status in Status), *errors])
