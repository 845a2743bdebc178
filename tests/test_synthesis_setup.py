"""``[synthesis]`` in a file: read and written without loss, faults all at once."""

from __future__ import annotations

import json
import pickle
import re
import tomllib
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from program import bad, run, schema

import mechgraph as mg

FILE = """
schema = 1
name = "function"
planar = true
pair = [
    { name = "A", type = "R", a = "frame", b = "crank", point = [0, 0] },
    { name = "B", type = "R", a = "crank", b = "coupler", point = [0, 1] },
    { name = "C", type = "R", a = "coupler", b = "rocker", point = [3, 2] },
    { name = "D", type = "R", a = "frame", b = "rocker", point = [3, 0] },
]

[synthesis]
unknown = ["B.point", "C.point"]
conditions = { "D.effort" = [-inf, 40] }

[[synthesis.task]]
kind = "function"
input = "A"
output = "D"
pairs_deg = [[0, 0], [20, 31], [45, 52]]
"""


def four_bar() -> mg.Mechanism:
    z = (0, 0, 1)
    ends = {"A": ("frame", "crank"), "B": ("crank", "coupler"), "C": ("coupler", "rocker"), "D": ("frame", "rocker")}
    at = {"A": (0, 0, 0), "B": (0, 1, 0), "C": (3, 2, 0), "D": (3, 0, 0)}
    pairs = [mg.Pair(name, "R", *ends[name], point=at[name], axis=z) for name in ends]
    links = [
        mg.Link(name, points={"tip": (1, 2, 0)} if name == "coupler" else {})
        for name in ("frame", "crank", "coupler", "rocker")
    ]
    return mg.Mechanism("four-bar", links, pairs, drives=["A"], planar=True)


def test_a_file_is_read_with_its_degrees_and_keeps_the_schema(tmp_path: Path) -> None:
    jsonschema.Draft202012Validator(schema("mechanism")).validate(tomllib.loads(FILE))
    path = tmp_path / "function.toml"
    path.write_text(FILE, encoding="utf-8")
    asked = mg.load(path).synthesis
    assert asked.unknown == ("B.point", "C.point")
    assert asked.conditions == {"D.effort": (-np.inf, 40.0)}
    (task,) = asked.tasks
    assert np.allclose(task.pairs, np.deg2rad([[0, 0], [20, 31], [45, 52]]), rtol=0, atol=1e-15)


def test_angles_by_name_may_be_in_degrees(tmp_path: Path) -> None:
    path, quarter = tmp_path / "function.toml", np.pi / 2
    text = FILE.replace(
        '{ "D.effort" = [-inf, 40] }', '{ "transmission D_deg" = [40, inf], size = [1, 3] }\nover = { A_deg = [0, 90] }'
    )
    path.write_text(
        text.partition("kind =")[0] + 'kind = "path"\npoint = "coupler.tip"\npoints = [[0, 0], [1, 1]]\nat = { A_deg = [0, 90] }'
        '\n[[synthesis.task]]\nkind = "positions"\nrows = [{ D = 0 }, { D_deg = 90, "coupler.tip" = [1, 1] }]\n', encoding="utf-8",
    )  # fmt: skip
    jsonschema.Draft202012Validator(schema("mechanism")).validate(tomllib.loads(path.read_text(encoding="utf-8")))
    asked = mg.load(path).synthesis
    assert asked.conditions == {"transmission D": (pytest.approx(np.deg2rad(40)), np.inf), "size": (1, 3)}
    assert [asked.over["A"], asked.tasks[0].at["A"]] == [pytest.approx([0, quarter])] * 2
    assert asked.tasks[1].rows == ({"D": 0}, {"D": pytest.approx(quarter), "coupler.tip": pytest.approx([1, 1])})
    path.write_text(text.replace("[40, inf]", '"a"'), encoding="utf-8")
    with pytest.raises(mg.DeclarationError, match="transmission D_deg = 'a': expected numbers"):
        mg.load(path)


def test_faults_of_a_task_in_a_file_stand_alone_with_its_name(tmp_path: Path) -> None:
    path = tmp_path / "function.toml"
    for wrong, fault in (
        (FILE.replace('kind = "function"\n', ""), "synthesis.task 1: field kind missing"),
        (FILE.replace("[20, 31]", "[20]"), "synthesis.task 1.pairs_deg = [[0, 0], [20], [45, 52]]: expected numbers"),
        (FILE.replace('output = "D"', 'output = "D"\noutpt = "D"'), "synthesis.task 1: unknown field 'outpt'; did you mean output?"),
    ):  # fmt: skip
        path.write_text(wrong, encoding="utf-8")
        with pytest.raises(mg.DeclarationError) as caught:
            mg.load(path)
        assert [told[: len(fault)] for told in caught.value.faults] == [fault]


ASKED = {
    "function": mg.SynthesisSetup(mg.function("A", "D", [(0, 0), (0.2, 0.3)]), "B.point.x", fit="minimax", starts=3),
    "path": mg.SynthesisSetup(
        mg.path("coupler.tip", [(1, 2), (1.1, 2.2)], at={"A": [0, 0.1]}),
        ["B"],
        bounds={"B.point.x": (None, 2)},
        require=["branch"],
    ),
    "poses": mg.SynthesisSetup(
        [mg.poses("coupler", [[0, 0, 0], [0.1, 0.2, 0.3]])], ["B"], sweep={"A.point.x": [0.0, 0.1]}
    ),
    "matrices": mg.SynthesisSetup(
        [mg.poses("coupler", [np.eye(4), np.eye(4)])], ["B"], minimize="size", over={"A": [0, 1]}
    ),
    "positions": mg.SynthesisSetup(
        mg.positions([{"A": 0.0, "coupler.tip": (1, 2)}, {"A": 0.1}]), ["B"], maximize="transmission D"
    ),
}


@pytest.mark.parametrize("name", ASKED)
def test_what_is_written_is_read_again(name: str, tmp_path: Path) -> None:
    m = four_bar().replace(synthesis=ASKED[name])
    mg.save(m, tmp_path / "m.toml")
    text = (tmp_path / "m.toml").read_text(encoding="utf-8")
    jsonschema.Draft202012Validator(schema("mechanism")).validate(tomllib.loads(text))
    assert mg.load(tmp_path / "m.toml") == m == pickle.loads(pickle.dumps(m))
    assert mg.load(tmp_path / "m.toml").replace(synthesis=None) != m
    assert type(m.synthesis).__name__ in str(m)


SLIDER = """
schema = 2
name = "slider"
planar = true
start = { D = 0.1 }
link = [{ name = "frame" }, { name = "crank" }, { name = "rod", points = { tip = [2, 0] } }, { name = "slider" }]
pair = [
    { name = "A", type = "R", a = "frame", b = "crank", point = [0, 0] },
    { name = "B", type = "R", a = "crank", b = "rod", point = [1, 0] },
    { name = "C", type = "R", a = "rod", b = "slider", point = [3, 0] },
    { name = "D", type = "P", a = "frame", b = "slider", point = [3, 0], axis = [1, 0] },
]
drive = [{ freedom = "D", motion = { sweep = [0.0, 1.0, 0.1] } }]
load = [{ kind = "spring", freedom = "D", stiffness = 1.0, free_length = 1.0 }]
response.time = [0.0, 1.0]
response.stop = [{ freedom = "D", upper = 9.0 }, { freedom = "A", lower_deg = -90.0 }]
response.event = [{ name = "here", of = "D", value = 1.0 }]
synthesis.unknown = ["B.point"]
synthesis.bounds = { "B.point.x" = [0, 2] }
synthesis.conditions = { "size" = [0, 2] }
synthesis.task = [
    { kind = "function", input = "A", output = "D", pairs = [[0, 0], [1, 1]] },
    { kind = "positions", rows = [{ "rod.tip" = [1, 2], "rod.Tx" = 3 }, { "rod.Rz_deg" = 3 }] },
]
"""


@pytest.mark.parametrize(
    ("new", "where"),
    [
        ("start = { D", "start.D_deg: D"),
        ("sweep", "drive 1.motion.sweep_deg: D"),
        ("free_length", "load 1.free_length_deg: D"),
        ("upper", "response.stop 1.upper_deg: D"),
        ("value", "response.event 'here'.value_deg: D"),
        ("pairs", "synthesis.task 1.pairs_deg: D"),
        ('"B.point.x', "synthesis.bounds.B.point.x_deg: B.point.x"),
        ('"size', "synthesis.conditions.size_deg: size"),
        ('"rod.tip', "synthesis.task 2.rows 0.rod.tip_deg: rod.tip"),
        ('"rod.Tx', "synthesis.task 2.rows 0.rod.Tx_deg: rod.Tx"),
    ],
)
def test_lengths_are_not_given_in_degrees(tmp_path: Path, new: str, where: str) -> None:
    file = tmp_path / "slider.toml"
    file.write_text(SLIDER, encoding="utf-8")
    assert mg.load(file).turns("A")
    file.write_text(re.sub(rf"({re.escape(new)})(?= =|\" =)", r"\1_deg", SLIDER), encoding="utf-8")
    with pytest.raises(mg.DeclarationError, match=f": 1 fault\n  {re.escape(where)} is no angle; leave _deg out"):
        mg.load(file)


def test_a_number_by_name_is_given_in_radians_or_in_degrees(tmp_path: Path) -> None:
    file = tmp_path / "slider.toml"
    file.write_text(SLIDER.replace("start = { D", "start = { A_deg = 2.0, A = 0.1, D"), encoding="utf-8")
    with pytest.raises(mg.DeclarationError, match=": 1 fault\n  start: A and A_deg are both given; leave one out"):
        mg.load(file)


def test_angles_of_poses_are_degrees_in_the_file_and_radians_in_the_call(tmp_path: Path) -> None:
    (task,) = ASKED["poses"].tasks
    assert task.places[1] == pytest.approx((0.1, 0.2, np.rad2deg(0.3)))
    assert np.allclose(task.arguments()["poses"], [[0, 0, 0], [0.1, 0.2, 0.3]], rtol=0, atol=1e-15)


def test_all_that_is_wrong_is_said_at_once() -> None:
    bad = mg.SynthesisSetup(
        ["A", mg.function("A", "", None)], ["B"], require=["turn"], bounds={"B.point.x": (2, 1)}, fit="best", starts=0
    )
    with pytest.raises(mg.DeclarationError) as caught:
        four_bar().replace(synthesis=bad)
    said = "\n".join(caught.value.faults)
    for part in ("task 1", "output is missing", "pairs is missing", "bounds['B.point.x']", "fit", "require", "starts"):
        assert part in said
    with pytest.raises(mg.DeclarationError, match=r"an mg\.SynthesisSetup"):
        four_bar().replace(synthesis={"unknown": ["B"]})


def test_what_a_file_may_not_hold_is_said(tmp_path: Path) -> None:
    m = four_bar().replace(synthesis=mg.SynthesisSetup(mg.function("A", "D", [(0, 0)]), ["B"], minimize=len))
    with pytest.raises(mg.FileError, match="callable"):
        mg.save(m, tmp_path / "m.toml")
    with pytest.raises(mg.DeclarationError, match="synthesis is in units of its own"):
        m.to_units(length="mm")


FITTED = FILE.replace("[synthesis]", '[synthesis]\nfit = "least_squares"\nstarts = 1').replace(
    "[[0, 0], [20, 31], [45, 52]]", "[[0, 0], [20, 16], [40, 31], [60, 44], [80, 53], [100, 60]]"
)
FITTED = FITTED.replace('conditions = { "D.effort" = [-inf, 40] }', "")
"""A fit: more pairs than can be met exactly."""


def test_a_mechanism_is_found_ranked_drawn_and_written_by_the_program(tmp_path: Path) -> None:
    path, best, picture, page = (tmp_path / name for name in ("f.toml", "best.toml", "s.svg", "s.html"))
    path.write_text(FITTED, encoding="utf-8")
    result = run("synthesize", path, "--good", "--rank", "size", "--out", best, "--plot", picture, "--page", page)
    assert result.exit_code == 0
    assert "Completeness: searched" in result.output
    assert picture.read_text(encoding="utf-8").startswith("<?xml")
    told = page.read_text(encoding="utf-8")
    # what is asked, what is obtained, and the error of the fit
    assert "<summary>0: no defect, " in told
    for cell in ("D.Rz asked [deg]", '<td class="right">53</td>', '<td class="right">0.12</td>'):
        assert cell in told
    told = json.loads(run("synthesize", path, "--good", "--rank", "size", "--json").output)
    jsonschema.Draft202012Validator(schema("output")).validate(told)
    assert told["fitness"][0]["error"] < 0.02
    # what was written does what was asked of it, to the error that is told
    m = mg.load(best)
    crank, rocker = np.deg2rad([[0, 20, 40, 60, 80, 100], [0, 16, 31, 44, 53, 60]])
    assert (
        np.abs(mg.kinematics(m, {"A": crank})["D"].position[:, 0] - rocker).max() <= told["fitness"][0]["error"] + 1e-9
    )
    assert [m.pair("B").point[0], m.pair("C").point[1]] == pytest.approx(
        [told["values"][0][0], told["values"][0][3]], abs=1e-6
    )


def test_the_program_says_where_nothing_is_left_and_what_is_not_there(tmp_path: Path) -> None:
    path = tmp_path / "f.toml"
    exact = FILE.replace("[[0, 0], [20, 31], [45, 52]]", "[[0, 0], [72, -30], [144, -10], [216, 10], [288, 20]]")
    path.write_text(exact.replace('"D.effort" = [-inf, 40]', "size = [-inf, 0.5]"), encoding="utf-8")
    result = run("synthesize", path)
    assert result.exit_code == 1
    assert re.search(r"- B\.point\.x = \S+, B\.point\.y = \S+, C\.point\.x = .*: size = ", result.output)
    assert "no [synthesis]" in bad("synthesize", "four-bar")
    path.write_text(exact.replace('conditions = { "D.effort" = [-inf, 40] }', ""), encoding="utf-8")
    page = tmp_path / "s.html"
    assert "there are 3 mechanisms, counted from 0" in bad("synthesize", path, "--solution", "3", "--page", page)
    assert not page.exists()
    path.write_text(exact.replace('"D.effort" = [-inf, 40]', "size = [-inf, 3.5]"), encoding="utf-8")
    assert "there is 1 mechanism, counted from 0" in bad("synthesize", path, "--solution", "1")


SWEPT = """
[synthesis]
unknown = ["B.point", "C.point.y"]
require = ["branch"]

[synthesis.sweep]
"C.point.x" = [-0.3, 0.1, 0.2]

[[synthesis.task]]
kind = "function"
input = "A"
output = "D"
pairs_deg = [[0, 0], [72, -30], [144, -10], [216, 10]]
"""
"""Four pairs: one coordinate less, for three values of which one to three mechanisms do it."""


def test_a_sweep_is_told_drawn_and_written_by_the_program(tmp_path: Path) -> None:
    path, picture, page = (tmp_path / name for name in ("f.toml", "s.svg", "s.html"))
    path.write_text(FILE.partition("[synthesis]")[0] + SWEPT, encoding="utf-8")
    result = run("synthesize", path, "--good", "--rank", "size", "--plot", picture, "--page", page)
    assert result.exit_code == 0
    found = mg.synthesize(mg.load(path)).good.ranked("size")
    assert str(found) in result.output
    assert "circle points" in picture.read_text(encoding="utf-8")
    assert "<summary>0, 0: no defect" in page.read_text(encoding="utf-8")
    told = json.loads(run("synthesize", path, "--good", "--rank", "size", "--json").output)
    jsonschema.Draft202012Validator(schema("output")).validate(told)
    assert told["sweep"] == {"C.point.x": [-0.3, 0.1, 0.2]}
    assert [np.shape(one["values"])[0] for one in told["positions"]] == list(map(len, found))
    assert "a sweep" in bad("synthesize", path, "--out", tmp_path / "best.toml")
    path.write_text(path.read_text(encoding="utf-8").replace("[-0.3, 0.1, 0.2]", "[0.2]"), encoding="utf-8")
    assert run("synthesize", path).exit_code == 1


def test_faults_of_tasks_and_unknowns_are_told_together_and_no_field_twice(tmp_path: Path) -> None:
    path = tmp_path / "f.toml"
    path.write_text(
        FILE.replace('"B.point", "C.point"', '"Q.point"').replace('output = "D"', 'output = "Z"'), encoding="utf-8"
    )
    told = bad("synthesize", path)
    assert "unknown freedom 'Z'" in told
    assert "'Q.point'" in told
    path.write_text(f"{FILE}pairs = [[0, 0], [1, 1]]\n", encoding="utf-8")
    with pytest.raises(mg.MechgraphError, match="pairs_deg are both given"):
        mg.load(path)


def test_what_is_given_beside_a_stored_setup_replaces_it() -> None:
    m = four_bar().replace(synthesis=ASKED["function"])
    with pytest.raises(mg.DeclarationError, match="best"):
        mg.synthesize(m, fit="best")
    with pytest.raises(mg.DeclarationError, match="starts"):
        mg.synthesize(m, starts=0)


def test_stored_poses_are_asked_as_given_ones_are() -> None:
    A = mg.Pair("A", "R", "frame", "crank", point=(0, 0))
    B = mg.Pair("B", "R", "crank", "body", point=(1, 0))
    m = mg.Mechanism("dyad", None, [A, B], planar=True)
    asked = mg.poses("body", [(0, 0, 0), (1, 0.5, 0.4), (2, 0.4, 1.1)])
    stored = mg.synthesize(m.replace(synthesis=mg.SynthesisSetup(asked, ["B.point"])))
    assert len(stored) == 1
    assert np.allclose(stored.values, mg.synthesize(m, asked, ["B.point"]).values, rtol=0, atol=1e-12)
