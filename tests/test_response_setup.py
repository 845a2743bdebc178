"""``[response]`` in a file: read and written without loss, taken where a call leaves out its arguments, faults all at once."""

from __future__ import annotations

import pickle
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from program import invoke, schema

import mechgraph as mg

Z = (0, 0, 1)
FILE = """
schema = 1
name = "pendulum on a slide"

[units]
length = "m"
mass = "kg"
time = "s"

[[link]]
name = "frame"

[[link]]
name = "slide"
mass = 2.0
center = [0, 0, 0]

[[link]]
name = "bob"
mass = 1.0
center = [0, -1, 0]

[[pair]]
name = "S"
type = "P"
a = "frame"
b = "slide"
point = [0, 0, 0]
axis = [1, 0, 0]

[[pair]]
name = "A"
type = "R"
a = "slide"
b = "bob"
point = [0, 0, 0]
axis = [0, 0, 1]

[[load]]
kind = "gravity"
acceleration = [0, -9.81, 0]
"""
RESPONSE = """
[response]
time = [0.0, 1.5]
points = 7
start = { A_deg = 40 }
rates = { A_deg = 90, S = 0.1 }
rtol = 1e-9
atol = 1e-11
method = "RK45"

[[response.event]]
of = "A"
value_deg = 10
direction = -1
name = "ten degrees"

[[response.event]]
of = "A"
value_deg = -70
what = "velocity"

[[response.stop]]
freedom = "A"
lower_deg = -30
restitution = 0.5
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "m.toml"
    path.write_text(FILE + RESPONSE)
    return path


def test_a_file_says_all_of_it(file: Path) -> None:
    m = mg.load(file)
    d = np.deg2rad
    assert m.response == mg.ResponseSetup(
        (0.0, 1.5), 7, {"A.Rz": d(40)}, {"A.Rz": d(90), "S.Tz": 0.1}, rtol=1e-9, atol=1e-11, method="RK45",
        events=[mg.Event("A.Rz", d(10), direction=-1, name="ten degrees"), mg.Event("A.Rz", d(-70), "velocity")],
        stops=[mg.Stop("A.Rz", lower=d(-30), restitution=0.5)],
    )  # fmt: skip
    np.testing.assert_allclose(m.response.times, np.linspace(0, 1.5, 7))


def test_it_is_written_and_read_without_loss(file: Path, tmp_path: Path) -> None:
    m = mg.load(file)
    mg.save(m, tmp_path / "again.toml")
    again = mg.load(tmp_path / "again.toml")
    assert again == m
    assert again.response == m.response
    assert pickle.loads(pickle.dumps(m)).response == m.response
    assert m.replace(response=None) != m
    assert "[response]" not in (
        mg.save(m.replace(response=None), tmp_path / "x.toml") or (tmp_path / "x.toml").read_text()
    )
    data = __import__("tomllib").loads((tmp_path / "again.toml").read_text())
    jsonschema.Draft202012Validator(schema("mechanism")).validate(data)
    data["response"]["what"] = 1
    assert not jsonschema.Draft202012Validator(schema("mechanism")).is_valid(data)


@pytest.mark.slow
def test_a_call_takes_what_it_leaves_out(file: Path) -> None:
    m, d = mg.load(file), np.deg2rad
    r = mg.respond(m)
    said = mg.respond(
        m.replace(response=None), np.linspace(0, 1.5, 7), start={"A": d(40)}, rates={"A": d(90), "S": 0.1}, rtol=1e-9, atol=1e-11,
        method="RK45", events=m.response.events, stops=m.response.stops,
    )  # fmt: skip
    np.testing.assert_array_equal(r["A"].position, said["A"].position)
    assert [str(one) for one in r.events] == [str(one) for one in said.events]
    assert any("ten degrees" in str(one) for one in r.events)
    assert r["A"].position.min() >= d(-30) - 1e-9
    other = mg.respond(m, (0, 0.2), start={"A": 0.1}, rates={}, stops=[], events=[])
    assert other["A"].position[0, 0] == pytest.approx(0.1)
    assert not other.events
    np.testing.assert_allclose(other["A"].velocity[0], 0.0, atol=1e-12)


def test_a_prescribed_freedom(tmp_path: Path) -> None:
    t = np.linspace(0, 1, 21)
    drive = f'[[response.drive]]\nfreedom = "S"\nmotion = {{ position = {(t**3).tolist()}, t = {t.tolist()} }}\n'
    (tmp_path / "m.toml").write_text(FILE + "[response]\ntime = [0.0, 1.0]\n" + drive)
    m = mg.load(tmp_path / "m.toml")
    r = mg.respond(m)
    np.testing.assert_allclose(r["S"].position[-1], 1.0, atol=1e-9)
    assert r.prescribed == ("S.Tz",)
    assert m.response.motions == (mg.Drive("S.Tz", mg.Motion(t**3, t=t)),)
    assert mg.ResponseSetup((0, 1), motions={"S": mg.Motion(t**3, t=t)}).motions[0].freedom == "S"
    mg.save(m, tmp_path / "again.toml")
    assert mg.load(tmp_path / "again.toml") == m


def test_all_faults_at_once(tmp_path: Path) -> None:
    wrong = """
[response]
time = [1.0, 0.5]
points = 1
start = { B = 1.0, A = "x" }
rates = { S = nan }
rtol = 0.5
method = "Euler"
speed = 3

[[response.event]]
of = "C"
value = inf
direction = 2

[[response.stop]]
freedom = "A"

[[response.drive]]
freedom = "S"
motion = { position = [0.0, 1.0] }
"""
    (tmp_path / "m.toml").write_text(FILE + wrong)
    with pytest.raises(mg.DeclarationError) as found:
        mg.load(tmp_path / "m.toml")
    text = str(found.value)
    for words in (
        "response: unknown field 'speed'", "t = (1.0, 0.5): expected (begin, end)", "points = 1", "start of 'B': unknown freedom 'B'",
        "start of 'A' = 'x'", "rates of 'S' = nan", "rtol = 0.5: expected a number from 1e-14 to 0.1", "method = 'Euler'",
        "unknown freedom 'C'", "value = inf", "has neither lower nor upper limit", "motion of 'S': has no times",
    ):  # fmt: skip
        assert words in text, words
    for bad, words in (
        ("response = 3", "response = 3: expected a table"), ("[response]", "field time missing"),
        ("[response]\ntime = [0, 1]\nevent = 3", "[[response.event]] = 3: expected an array of tables"),
        ("[response]\ntime = [0, 1]\nstart = 3", "[response.start] = 3: expected a table"),
        ("[response]\ntime = [0, 1]\n[[response.stop]]\nfreedom = 3", "response.stop 1.freedom = 3: expected a text"),
    ):  # fmt: skip
        (tmp_path / "m.toml").write_text(bad + "\n" + FILE if bad.startswith("response") else FILE + bad)
        with pytest.raises(mg.DeclarationError) as found:
            mg.load(tmp_path / "m.toml")
        assert words in str(found.value), str(found.value)


def test_faults_in_python() -> None:
    m = mg.load("windows-2")
    for setup, words in (
        (3, "expected an mg.ResponseSetup"), (mg.ResponseSetup("now"), "t = 'now'"), (mg.ResponseSetup((0, 1), start=3), "start = 3"),
        (mg.ResponseSetup((0, 1), events=[3]), "an item of events"), (mg.ResponseSetup((0, 1), stops=mg.Stop("no", 1.0)), "freedom 'no'"),
        (mg.ResponseSetup((0, 1, 2), 5), "points = 5"), (mg.ResponseSetup((0, 1), motions=3), "motions = 3"),
    ):  # fmt: skip
        with pytest.raises(mg.DeclarationError) as found:
            m.replace(response=setup)  # type: ignore[arg-type]
        assert words in str(found.value), str(found.value)
    with pytest.raises(mg.DeclarationError, match="t = None"):
        mg.respond(m.replace(response=None))


def test_what_a_file_cannot_hold(tmp_path: Path) -> None:
    setup = mg.ResponseSetup((0, 1), events=[mg.Event(lambda s: 1.0)])
    m = mg.load("windows-2").replace(response=setup)
    with pytest.raises(mg.FileError, match="callable"):
        mg.save(m, tmp_path / "x.toml")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_it_follows_changes_of_the_mechanism(file: Path) -> None:
    pytest.importorskip("pint")
    m = mg.load(file)
    mm = m.to_units(length="mm", time="ms")
    assert mm.response.rates == {"A.Rz": pytest.approx(np.pi / 2 / 1000), "S.Tz": pytest.approx(0.1)}
    assert mm.response.time == (0.0, 1500.0)
    assert mm.response.events[1].value == pytest.approx(np.deg2rad(-70) / 1000)
    r, other = mg.respond(m), mg.respond(mm)
    np.testing.assert_allclose(other["S"].position, 1000 * r["S"].position, atol=1e-3)
    welded = m.with_pair_type("A", "W")
    assert welded.response.start == {}
    assert welded.response.rates == {"S.Tz": 0.1}
    assert welded.response.stops == () == welded.response.events
    assert m.moved(np.eye(4)).response == m.response


@pytest.mark.parametrize("name", ["andrews", "haug-slider-crank", "windows-2"])
def test_the_command_line_needs_no_options(name: str, tmp_path: Path) -> None:
    m = mg.load(name)
    short = m.replace(response=mg.ResponseSetup((0.0, m.response.time[-1] / 50), rates=dict(m.response.rates)))
    mg.save(short, tmp_path / "x.toml")
    result = invoke("respond", str(tmp_path / "x.toml"), "--points", "3")
    assert result.exit_code == 0, result.output
    assert "Solved 3 of 3 positions" in result.output
    assert mg.respond(short).t[-1] == pytest.approx(m.response.time[-1] / 50)


def test_the_command_line_asks_how_long() -> None:
    result = invoke("respond", "rssr")
    assert result.exit_code == 2
    assert "Give --for TIME" in result.stderr
