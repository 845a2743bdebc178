"""The command line: commands, exit statuses, bad input of many kinds, no partial files."""

import csv
import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from mechanisms import unclosable_four_bar
from program import bad, heard, invoke, process, run

import mechgraph as mg

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def free_chain(tmp_path: Path) -> Path:
    """A mechanism in which a freedom is neither driven nor passive."""
    m = mg.Mechanism("pendulum", [mg.Link("frame"), mg.Link("bob", 1.0, (0, -1, 0))],
                     [mg.Pair("A", "R", "frame", "bob", point=(0, 0, 0), axis=(0, 0, 1))])  # fmt: skip
    mg.save(m, tmp_path / "pendulum.toml")
    return tmp_path / "pendulum.toml"


@pytest.fixture
def unclosable(tmp_path: Path) -> Path:
    """A mechanism that no position closes."""
    mg.save(unclosable_four_bar(), tmp_path / "open.toml")
    return tmp_path / "open.toml"


@pytest.fixture
def crank_slider(tmp_path: Path) -> Path:
    """A slider on a table, driven in its slide, in millimetres, with a force that resists."""
    m = mg.Mechanism(
        "slide", [mg.Link("table"), mg.Link("slide", 2.0, (0, 0, 0))],
        [mg.Pair("A", "P", "table", "slide", point=(0, 0, 0), axis=(1, 0, 0))], ["A"],
        [mg.Effort("A", -7.0)], units={"length": "mm", "mass": "kg", "time": "s"},
    )  # fmt: skip
    mg.save(m, tmp_path / "slide.toml")
    return tmp_path / "slide.toml"


# --- what it does ------------------------------------------------------------------------------------------------------


def test_list_names_the_library() -> None:
    result = run("list")
    assert result.exit_code == 0
    for name in mg.library():
        assert re.search(rf"^{re.escape(name)} ", result.stdout, re.MULTILINE)


def test_check_prints_the_report() -> None:
    result = run("check", "rcsr")
    assert result.exit_code == 0
    assert mg.check(mg.load("rcsr")).verdict in result.stdout


def test_check_as_json_and_markdown() -> None:
    data = json.loads(run("check", "rcsr", "--json").stdout)
    assert data["mechanism"] == "rcsr"
    assert data["ledger"]["lee"]["unknowns"] == 24
    assert run("check", "rcsr", "--markdown").stdout.startswith("# ")


def test_check_at_a_position() -> None:
    assert run("check", "rcsr", "--at", "O1=170deg").exit_code == 0


def test_check_of_a_redundant_mechanism_is_no_failure() -> None:
    assert run("check", "four-bar").exit_code == 0


def test_check_says_what_is_not_driven(free_chain: Path) -> None:
    assert run("check", free_chain).exit_code == 1


def test_check_says_that_loops_cannot_be_closed(unclosable: Path) -> None:
    result = run("check", unclosable)
    assert result.exit_code == 1
    assert "no closed configuration" in result.stdout


def test_check_takes_no_longer_than_it_may() -> None:
    text = " ".join(run("check", "windows-2", "--limit", "1e-3ms").stdout.split())
    assert "looked for during 1e-06 s and not to the end" in text
    assert json.loads(run("check", "windows-2", "--limit", "1e-6", "--json").stdout)["not_sought"]
    assert json.loads(run("check", "four-bar", "--limit", "20s", "--json").stdout)["not_sought"] == []
    assert "--limit '5kg': expected a time above 0 in s, ms" in bad("check", "four-bar", "--limit", "5kg")


def test_equations() -> None:
    assert "R_41 + R_21" in run("equations", "rcsr").stdout
    assert "24 unknowns" in run("equations", "rcsr", "--blocks").stdout
    assert "18 unknowns" in run("equations", "rcsr", "--bookkeeping", "minimal").stdout
    assert r"\[" in run("equations", "rcsr", "--latex").stdout
    f = mg.formulate(mg.load("rcsr"))
    assert run("equations", "rcsr", "--coefficients").stdout == f.coefficients().text()
    assert run("equations", "rcsr", "--csv").stdout == f.coefficients().csv()
    assert "alpha_1" in run("equations", "rcsr", "--unknowns", "response", "--blocks").stdout


def test_files_as_the_suffix_says(tmp_path: Path) -> None:
    pytest.importorskip("h5netcdf")
    pytest.importorskip("pyarrow")
    import pandas
    import xarray

    for name, read in (("x.csv", pandas.read_csv), ("x.parquet", pandas.read_parquet)):
        assert (
            f"Wrote {tmp_path / name}: 72 rows, 75 columns."
            in run("solve", "7r", "--drive", "O1=0:360:5deg@10", "--out", tmp_path / name).stdout
        )
        assert read(tmp_path / name).shape == (72, 75)
    assert run("respond", "windows-2", "--for", "1s", "--points", "5", "--out", tmp_path / "r.nc").exit_code == 0
    with xarray.open_dataset(tmp_path / "r.nc", engine="h5netcdf") as data:
        assert data["A0.Rz"].dims == ("t",)
        assert data.t.values.tolist() == np.linspace(0, 1, 5).tolist()
    for command in ("solve", "respond"):
        assert ".csv (CSV), .nc (NetCDF), .parquet (Parquet)" in bad(
            command, "7r", *(["--for", "1s"] * (command == "respond")), "--out", tmp_path / "x.xlsx"
        )
    assert "unknown file extension '.zzz'; known: .toml (TOML), .xml" in bad(
        "save", "rcsr", "--out", tmp_path / "m.zzz"
    )
    assert ".pdf (document), .gif (animated GIF), .mp4 (film)" in bad("plot", "rcsr", "--out", tmp_path / "m.foo")
    assert ".gif" not in bad("plot", "rcsr", "effort", "--out", tmp_path / "m.foo")
    assert "unknown file extension '.pdf'; known: .html" in bad("report", "rcsr", "--out", tmp_path / "m.pdf")
    with pytest.raises(mg.FileError, match=r"known: \.html"):
        mg.write_report(mg.load("rcsr"), path=tmp_path / "m.pdf")
    assert not {*tmp_path.glob("m.*")}
    assert "Wrote" in run("equations", "rcsr", "--blocks", "--out", tmp_path / "e.tex").stdout
    assert (tmp_path / "e.tex").read_text().startswith(r"\documentclass")
    assert "leave out" in bad("equations", "rcsr", "--csv", "--out", tmp_path / "e.csv")
    for name in ("m.toml", "m.graphml", "m.json"):
        assert run("save", "rcsr", "--out", tmp_path / name).exit_code == 0
    assert mg.load(tmp_path / "m.toml") == mg.load("rcsr")
    assert len(json.loads((tmp_path / "m.json").read_text())["nodes"]) == 4
    assert "file of the mechanism" in bad("save", tmp_path / "m.toml", "--out", tmp_path / "m.toml")


def test_letters_are_a_loop_and_a_word_of_the_description_finds_a_mechanism() -> None:
    assert "mobility 2 for general geometry" in run("check", "RSSP").stdout
    assert "did you mean marghitu-2-3?" in bad("check", "sarrus")
    assert "nor letters of pairs" in bad("check", "RRX")


def test_messages_name_the_options_of_the_command(tmp_path: Path) -> None:
    at = ("--drive", "O1=0:360:30deg")
    assert "Pass --on-reach flag to keep the reachable" in run("loads", "rcsr", "link2", *at).stderr
    said = run("equations", "rcsr", "--at", "O1=350deg").stderr
    assert "not reachable" in said
    assert "on_reach" not in said.replace("-", "_")
    assert "--redundant minimum_norm" in run("loads", "four-bar", "coupler", "--out", tmp_path / "x.inp").stderr


@pytest.mark.slow
def test_a_page_lacks_nothing_silently(tmp_path: Path) -> None:
    """What could not be solved is said, and how a mechanism without a stored motion is set in motion."""
    page = tmp_path / "page.html"
    told = run("report", "rcsr", "-o", page, "--drive", "O1=0:360:30deg")
    assert (told.exit_code, "10 positions of 12 not solved: status 'out of reach'." in told.stdout) == (0, True)
    mg.save(mg.load("four-bar").replace(drives=["A"]), tmp_path / "m.toml")
    assert "for motion and forces add --drive A=0:360:5deg." in run("report", tmp_path / "m.toml", "-o", page).stdout
    assert run("report", "four-bar", "-o", page).stdout.endswith(" MB.\n")


def test_figures_over_time() -> None:
    shown = run("solve", "7r", "--drive", "O1=0:360:5deg@10", "--over-time").stdout
    assert "over a whole cycle of 1 revolution" in shown
    assert "Work per revolution" in shown
    assert "no times" in bad("solve", "7r", "--drive", "O1=0:360:5deg", "--over-time")
    assert (
        "1 s, from the first position to the last" in run("respond", "windows-2", "--for", "1s", "--over-time").stdout
    )


def test_loads_on_a_link(tmp_path: Path) -> None:
    deck = tmp_path / "rod.inp"
    shown = run("loads", "haug-slider-crank", "rod", "--drive", "A=0:360:5deg@30", "--out", deck, "--held", "B")
    assert "Loads on link rod of haug-slider-crank" in shown.stdout
    assert "the sum of all is zero to" in shown.stdout
    assert "greatest force of C" in shown.stdout
    assert "** held: 900001, 1, " in deck.read_text()
    assert deck.read_text().count("*STEP") == int(re.search(r"rod.inp: (\d+) positions", shown.stdout)[1])
    assert (
        "1 positions"
        in run(
            "loads", "haug-slider-crank", "rod", "--drive", "A=30deg", "--at", "0", "--out", tmp_path / "r.csv"
        ).stdout
    )
    assert "All that a planar model has is unique" in run("loads", "four-bar", "coupler").stdout
    assert "not unique, first at position" in run("loads", "four-bar", "coupler", "--out", tmp_path / "x.inp").stderr
    assert (
        run("loads", "four-bar", "coupler", "--redundant", "minimum_norm", "--out", tmp_path / "x.inp").exit_code == 0
    )
    assert "NOT UNIQUE" in (tmp_path / "x.inp").read_text()
    assert "unknown link 'no'" in bad("loads", "four-bar", "no")
    assert "held: for a load deck" in bad("loads", "rcsr", "link1", "--held", "O1", "--out", tmp_path / "y.csv")
    assert "expected worst, all" in bad("loads", "rcsr", "link1", "--at", "30deg")


def test_what_makes_forces_doubtful_is_said_beside_loads_and_pictures(tmp_path: Path) -> None:
    """A ball that its plane can only push, with a load that takes it off."""
    m = mg.Mechanism("ball", pairs=[
        mg.Pair("A", "P", "frame", "ball", point=(0, 0, 0), axis=(1, 0, 0)),
        mg.Pair("B", "Sp", "frame", "ball", point=(0, 0, 0), axis=(1, 0, 0), closed="force"),
    ], loads=[mg.Effort("A", 1.0)])  # fmt: skip
    mg.save(m, tmp_path / "ball.toml")
    for command in (
        ("loads", tmp_path / "ball.toml", "ball"),
        ("plot", tmp_path / "ball.toml", "ranges", "--out", tmp_path / "b.svg"),
    ):
        assert "would have to pull" in run(*command).stderr
    press = mg.Mechanism("press", pairs=[
        mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=(0, 0, 1)),
        mg.Pair("B", "P", "frame", "pin", point=(1, 0, 0), axis=(0, 1, 0)),
        mg.Pair("C", "Sp", "arm", "pin", point=(1, 0, 0), axis=(0, 1, 0), closed="force"),
    ], drives=["A"], loads=[mg.Effort("B", 1.0)])  # fmt: skip
    mg.save(press, tmp_path / "press.toml")
    assert "would have to pull" in run("equations", tmp_path / "press.toml", "--at", "A=0").stderr


def test_messages_name_the_option_and_the_text_that_was_typed(tmp_path: Path) -> None:
    assert "unit 'grad' in '10grad'" in bad("solve", "four-bar", "--drive", "A=0:360:10grad")
    assert "write e.g. 10 or 10s" in bad("respond", "four-bar", "--for", "one")
    m = mg.load("four-bar")
    mg.save(m.replace(drives=[mg.Drive("A", mg.Motion([0.0, 0.5, 1.0]))]), tmp_path / "still.toml")
    said = bad("respond", tmp_path / "still.toml", "--for", "1s")
    assert "stored motion of A has no times; add t = [...]" in said
    assert "Motion(" not in said
    assert "--at 'A=30grad'" in bad("equations", "four-bar", "--at", "A=30grad")


def test_assemblies_with_other_drives_at_their_start(tmp_path: Path) -> None:
    points = [(-1, 0, 0), (-1, 1, 0), (0, 2, 0), (1, 1, 0), (1, 0, 0)]
    links = ["frame", "a", "b", "c", "d", "frame"]
    pairs = [mg.Pair(f"J{i}", "R", *links[i : i + 2], point=p, axis=(0, 0, 1)) for i, p in enumerate(points)]
    m = mg.Mechanism("five-bar", pairs=pairs, drives=["J0", "J4"])
    mg.save(m, tmp_path / "m.toml")
    assert "J0.Rz = 5 deg, J4.Rz = 0 deg" in run("assemblies", tmp_path / "m.toml", "--at", "J0=5deg").stdout
    # in Python too
    m = m.replace(start=mg.assemblies(m, {"J0": 0.1, "J4": 0.2})[0].start)
    for given, at in ((None, (0.1, 0.2)), ({"J0": 0.15}, (0.15, 0.2))):
        assert dict(mg.assemblies(m, given).at) == pytest.approx(dict(zip(("J0.Rz", "J4.Rz"), at, strict=True)))
    assert [*mg.assemblies(m, {"J0": 0.1, "J1": m.start["J1.Rz"]}).at] == ["J0.Rz", "J1.Rz"]


def test_equations_with_numbers() -> None:
    """{Q}, {C} and {U} at a position with its rates are those of the solution there."""
    shown = run("equations", "rcsr", "--at", "O1=160deg@0.1").stdout
    m = mg.load("rcsr")
    s = mg.solve(m, {"O1": mg.Motion(np.deg2rad(160), 0.1, 0.0)})
    f = mg.formulate(m)
    values = {key: float(value) for key, value in re.findall(r"^([QCu]\(.*\)) = (\S+)$", shown, re.MULTILINE)}
    A, b = f.assemble(s.state())
    Q, u = np.zeros(A.shape), np.array([values[f"u({j + 1})"] for j in range(24)])
    for i, j in zip(*A.nonzero(), strict=True):
        Q[i, j] = values[f"Q({i + 1}, {j + 1})"]
    np.testing.assert_allclose(Q, A.toarray(), atol=1e-9)
    np.testing.assert_allclose(Q @ u, [values.get(f"C({i + 1})", 0.0) for i in range(24)], atol=1e-6)
    np.testing.assert_allclose(u[23], s["O1"].effort[0], rtol=1e-9)
    assert "u(24): MA_IN" in shown
    assert run("equations", "four-bar", "--at", "A=30deg", "--csv").stdout.count("u,0,") == 29


def test_solve_prints_a_summary() -> None:
    result = run("solve", "7r", "--drive", "O1=0:360:5deg@10")
    assert result.exit_code == 0
    assert "Solved 72 of 72 positions." in result.stdout
    s = mg.solve(mg.load("7r"), {"O1": mg.Motion(np.deg2rad(np.arange(0, 360, 5.0)), 10.0)})
    effort, force = s["O1"].effort[:, 0], np.linalg.norm(s["O1"].force, axis=1)
    row = re.search(r"^O1\.Rz \[N m\] +(\S+) +(\S+) deg +(\S+) +(\S+) deg$", result.stdout, re.MULTILINE)
    assert row is not None
    assert np.allclose([float(row[1]), float(row[3])], [effort.min(), effort.max()], rtol=1e-4)
    assert [float(row[2]), float(row[4])] == [5.0 * effort.argmin(), 5.0 * effort.argmax()]
    row = re.search(r"^O1 +R +frame +link1 +(\S+) +(\S+) deg", result.stdout, re.MULTILINE)
    assert row is not None
    assert np.isclose(float(row[1]), force.max(), rtol=1e-4)
    assert float(row[2]) == 5.0 * force.argmax()
    assert re.search(r"^closure error.*e-", result.stdout, re.MULTILINE)
    words = r"72 positions, (\d+) nodes of the path, (\d+) evaluations, (\d+) factorizations\."
    work = re.search(r"^Engine dense, method loop_wrench: " + words, result.stdout, re.MULTILINE)
    assert work is not None
    # The angles are read from degrees: other rounding, and with it now and then another step.
    shown, own = [int(n) for n in work.groups()], [s.work.nodes, s.work.evaluations, s.work.factorizations]
    assert np.allclose(shown, own, rtol=0.1)


def test_friction_that_was_typed() -> None:
    rough = ["--friction", "A:mu=0.1,radius=0.02,model=total", "--friction", "D:mu=0.2,radius=0.01,static=0.3"]
    shown = json.loads(run("solve", "four-bar", "--drive", "A=0:360:30deg@10", *rough, "--json").stdout)
    m = mg.load("four-bar")
    loads = [mg.Friction("A", mu=0.1, radius=0.02, model="total"), mg.Friction("D", mu=0.2, radius=0.01, static=0.3)]
    s = mg.solve(m, {"A": mg.Motion(np.deg2rad(np.arange(0, 360, 30.0)), 10.0)}, loads=[*m.loads, *loads])
    assert np.isclose(shown["efforts"][0]["greatest"]["value"], s["A"].effort.max(), rtol=1e-9)
    assert "friction" in run("report", "--help").stdout
    for typed, words in (
        ("A:nu=0.1", "did you mean"), ("A:radius=0.1", "expected PAIR:mu=NUMBER"), ("Q:mu=0.1", "unknown pair 'Q'"),
        ("A:mu=0,1", "a comma ends a field"), ("A:mu", "'mu': expected FIELD=VALUE"), ("A:mu=.1,mu=.2", "mu is given twice"),
        ("A:efficiency=0.9", "efficiency: has no meaning"),
        ("A:mu=much", "is not a number"), ("A:mu=0.1,radius=0.1,flank=5deg", "flank: has no meaning"),
    ):  # fmt: skip
        assert words in bad("solve", "four-bar", "--drive", "A=1", "--friction", typed)


def test_the_engine_is_taken_and_named() -> None:
    shown = {}
    for engine in ("dense", "sparse"):
        result = run("solve", "rssr", "--drive", "A=0:30:10deg@10", "--engine", engine)
        assert result.exit_code == 0
        assert f"Engine {engine}, method loop_wrench: 3 positions, " in result.stdout
        shown[engine] = result.stdout.partition("Passive freedoms")[0]
        assert json.loads(run("check", "rssr", "--json", "--engine", engine).stdout)["engine"] == engine
    assert shown["dense"] == shown["sparse"]
    assert bad("solve", "rssr", "--engine", "fast")


def test_solve_uses_the_stored_motion() -> None:
    assert "Solved 27 of 27 positions." in run("solve", "rcsr").stdout


def test_solve_of_one_position_and_of_a_slide(crank_slider: Path) -> None:
    result = run("solve", crank_slider, "--drive", "A=12.5@1@3")
    assert result.exit_code == 0
    assert "Solved 1 of 1 position." in result.stdout
    assert "12.5 mm" in result.stdout
    row = re.search(r"^A\.Tz \[mN\] +(\S+)", result.stdout, re.MULTILINE)
    assert row is not None
    assert np.isclose(float(row[1]), 2.0 * 3.0 + 7.0)


def test_a_point_is_moved_by_a_cylinder(tmp_path: Path) -> None:
    """Level, by hand: lift sqrt(2) = 5 * 1000; the same as through Python."""
    z = (0, 0, 1)
    crane = mg.Mechanism("crane", [
        mg.Link("frame"), mg.Link("arm", points={"hook": (5, 0, 0)}), mg.Link("tube"), mg.Link("rod"),
    ], [
        mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=z), mg.Pair("B", "R", "frame", "tube", point=(1, -1, 0), axis=z),
        mg.Pair("lift", "P", "tube", "rod", point=(1, -1, 0), axis=(1, 1, 0)), mg.Pair("C", "R", "rod", "arm", point=(2, 0, 0), axis=z),
    ], loads=[mg.Wrench("arm", force=(0, -1000, 0), point="hook")])  # fmt: skip
    mg.save(crane, tmp_path / "crane.toml")
    out = tmp_path / "crane.csv"
    result = run(
        "solve", tmp_path / "crane.toml", "--drive", "arm.hook.Ty=0:2:0.5@1", "--actuate", "lift", "--out", out
    )
    assert result.exit_code == 0, result.output
    assert "arm.hook.Ty     0  1.5     1" in result.stdout
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert float(rows[0]["lift.Tz effort"]) == pytest.approx(5000 / np.sqrt(2))
    assert float(rows[3]["arm.hook.Ty"]) == pytest.approx(1.5)
    s = mg.solve(crane, {"arm.hook.Ty": mg.Motion(np.arange(0, 2, 0.5), 1.0)}, actuate=["lift"])
    np.testing.assert_allclose([float(row["lift.Tz effort"]) for row in rows], s["lift"].effort[:, 0], rtol=1e-12)
    along = run("solve", tmp_path / "crane.toml", "--drive", "arm.hook.T(0,1,0)=0.5")
    assert "arm.hook.T(0,1,0)" in along.stdout
    turned = run("solve", tmp_path / "crane.toml", "--drive", "arm.Rz=0:20:10deg", "--actuate", "lift")
    assert turned.exit_code == 0, turned.output
    where = tmp_path / "crane.toml"
    assert "has several coordinates; give one or more of arm.hook.Tx" in bad("solve", where, "--drive", "arm.hook=1")
    assert "link 'arm' has no point 'tip' (its points: hook)" in bad("solve", where, "--drive", "arm.tip.Ty=1")
    assert "unit 'deg' in '1deg': the freedom is a length" in bad("solve", where, "--drive", "arm.hook.Ty=1deg")
    assert "given twice" in bad("solve", where, "--drive", "arm.hook.Ty=1", "--drive", "arm.hook.Ty=2")
    stuck = run("solve", where, "--drive", "arm.hook.Ty=1", "--actuate", "lift", "--actuate", "A")
    assert (stuck.exit_code, "2 freedoms are named, 1 independent motion is prescribed" in stuck.stderr) == (1, True)


def test_both_methods_print_the_same() -> None:
    first, second = (run("solve", "7r", "--method", method).stdout for method in ("loop_wrench", "newton_euler"))
    assert first.partition("Checks")[0] == second.partition("Checks")[0]


def test_reactions_that_are_not_unique_are_said_to_be_so() -> None:
    plain = run("solve", "four-bar").stdout
    assert "Not unique" in plain
    assert "not unique" in plain
    assert "(Fx Fy)" in plain
    least = run("solve", "four-bar", "--redundant", "minimum_norm").stdout
    assert "least norm" in least
    assert "nan" not in plain + least


def test_positions_out_of_reach() -> None:
    result = run("solve", "rcsr", "--drive", "O1=150:220:1deg")
    assert result.exit_code == 1
    assert "out of reach" in result.stderr
    assert "205.14 deg" in result.stderr
    result = run("solve", "rcsr", "--drive", "O1=150:220:1deg", "--on-reach", "flag")
    assert result.exit_code == 0
    assert "Solved 56 of 70 positions." in result.stdout
    assert "positions 56 to 69: out of reach (after O1.Rz = 205 deg)" in result.stdout


def test_nothing_solved_of_a_mechanism_with_a_passive_freedom(tmp_path: Path) -> None:
    mg.save(mg.load("rssr").replace(drives=["D"]), tmp_path / "m.toml")
    result = run("solve", tmp_path / "m.toml", "--drive", "D=2")
    assert result.exit_code == 1
    assert "out of reach" in result.stderr
    flagged = (
        "solve",
        tmp_path / "m.toml",
        "--drive",
        "D=2:2.2:0.1",
        "--on-reach",
        "flag",
        "--out",
        tmp_path / "x.csv",
    )
    result = run(*flagged)
    assert result.exit_code == 1
    assert "Solved 0 of 2 positions." in result.stdout
    assert (tmp_path / "x.csv").read_text().count(",out of reach\n") == 2


def test_nothing_solved_is_no_success() -> None:
    result = run("solve", "rcsr", "--drive", "O1=0deg", "--on-reach", "flag")
    assert result.exit_code == 1
    assert "Solved 0 of 1 position." in result.stdout


@pytest.mark.slow
def test_loops_that_cannot_be_closed(unclosable: Path) -> None:
    assert run("solve", unclosable, "--drive", "A=0").exit_code == 1


def test_a_freedom_that_nothing_drives(free_chain: Path) -> None:
    result = run("solve", free_chain)
    assert result.exit_code == 1
    assert "neither driven nor passive" in result.stderr
    assert "add one driver (such as A.Rz), or change a pair" in result.stderr


def test_out_writes_the_table(tmp_path: Path) -> None:
    target = tmp_path / "7r.csv"
    result = run("solve", "7r", "--out", target)
    assert result.exit_code == 0
    assert "Wrote" in result.stdout
    with target.open(encoding="utf-8", newline="") as handle:
        rows = list(csv.DictReader(handle))
    assert len(rows) == 360
    s = mg.solve(mg.load("7r"))
    assert np.array_equal([float(r["O1.Rz effort [N m]"]) for r in rows], s["O1"].effort[:, 0])
    assert list(tmp_path.iterdir()) == [target]


# --- drives ------------------------------------------------------------------------------------------------------------


def test_several_drives_describe_the_same_positions(tmp_path: Path) -> None:
    z = (0, 0, 1)
    m = mg.Mechanism("five-bar", pairs=[
        mg.Pair("A", "R", "frame", "a", point=(-1, 0, 0), axis=z), mg.Pair("B", "R", "a", "b", point=(-1, 1, 0), axis=z),
        mg.Pair("C", "R", "b", "c", point=(0, 2, 0), axis=z), mg.Pair("D", "R", "d", "c", point=(1, 1, 0), axis=z),
        mg.Pair("E", "R", "frame", "d", point=(1, 0, 0), axis=z),
    ], drives=["A", "E"], loads=[mg.Effort("B", 1.0)])  # fmt: skip
    mg.save(m, tmp_path / "m.toml")
    result = run("solve", tmp_path / "m.toml", "--drive", "A=0:10:1deg", "--drive", "E=0:-10:-1deg")
    assert result.exit_code == 0
    assert "Solved 10 of 10" in result.stdout
    assert "E.Rz" in result.stdout
    assert "different numbers of positions" in bad(
        "solve", tmp_path / "m.toml", "--drive", "A=0:10:1deg", "--drive", "E=0:-10:-2deg"
    )
    assert "no motion" in bad("solve", tmp_path / "m.toml", "--drive", "A=0:10:1deg")


@pytest.mark.parametrize(
    ("drive", "message"),
    [
        ("O1", "FREEDOM=VALUES"),
        ("=3", "FREEDOM=VALUES"),
        ("O1=", "FREEDOM=VALUES"),
        ("O1=0:360", "START:STOP:STEP"),
        ("O1=0:1:2:3", "START:STOP:STEP"),
        ("O1=0:360:1deg@1@2@3", "START:STOP:STEP"),
        ("O1=0:360:0deg", "no positions: the step is 0"),
        ("O1=0:360:-1deg", "no positions: the step leads away from the end; change its sign"),
        ("O1=6:5:0.5", "no positions: the step leads away from the end; change its sign"),
        ("O1=5:5:1deg", "no positions: the end, which is excluded, is also the first"),
        ("O1=a:b:c", "is not a number"),
        ("O1=0::1", "is not a number"),
        ("O1=nan", "is not a number"),
        ("O1=1e999", "is not a number"),
        ("O1=0:1:0.1@", "is not a number"),
        ("O1=30mm", "is an angle"),
        ("O2.Tz=1deg", "is a length"),
        ("O2.Tz=1mm", "is a length"),
        ("O9=0:1:0.1", "unknown freedom"),
        ("O2=0:1:0.1", "name one of"),
        ("O3.Rx=0:1:0.1", "rotation"),
        ("O1=0:1:1e-12", "at most"),
    ],
)
def test_bad_drives(drive: str, message: str) -> None:
    assert message in bad("solve", "rcsr", "--drive", drive)


def test_a_drive_given_twice() -> None:
    assert "given twice" in bad("solve", "rcsr", "--drive", "O1=1", "--drive", "O1.Rz=2")


# --- bad input ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["check", "equations", "solve"])
def test_names_and_files_that_are_none(command: str, tmp_path: Path) -> None:
    assert "did you mean rcsr" in bad(command, "rcs")
    assert "available:" in bad(command, "zzzzzz")
    assert "No such file" in bad(command, tmp_path / "none.toml")
    assert "directory" in bad(command, tmp_path).lower()
    assert "is not valid TOML" in bad(command, _written(tmp_path / "broken.toml", "schema = = 1"))
    assert "missing" in bad(command, _written(tmp_path / "empty.toml", ""))
    assert "is not a valid TOML file" in bad(command, _written(tmp_path / "binary.toml", b"\xff\xfe\x00"))


def _written(path: Path, content: str | bytes) -> Path:
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("solve",),
        ("dance", "rcsr"),
        ("check", "rcsr", "--nope"),
        ("check", "rcsr", "--json", "--markdown"),
        ("check", "rcsr", "--at", "O1"),
        ("check", "rcsr", "--at", "Q=1"),
        ("check", "rcsr", "--at", "O1=1:2:1"),
        ("equations", "rcsr", "--bookkeeping", "other"),
        ("equations", "rcsr", "--latex", "--at", "O1=160deg"),
        ("equations", "rcsr", "--at", "O1=150:160:1deg"),
        ("equations", "rcsr", "--latex", "--csv"),
        ("solve", "rcsr", "--method", "guess"),
        ("solve", "rcsr", "--redundant", "maybe"),
        ("solve", "rcsr", "--on-reach", "hope"),
        ("solve", "rcsr", "7r"),
    ],
)
def test_wrong_usage(arguments: tuple[str, ...]) -> None:
    assert run(*arguments).exit_code == 2


def test_at_a_position_that_cannot_be_had() -> None:
    assert run("check", "rcsr", "--at", "O1=0deg").exit_code == 1


def test_out_that_cannot_be_written(tmp_path: Path) -> None:
    assert "folder" in bad("solve", "rcsr", "--out", tmp_path)
    assert "folder" in bad("solve", "rcsr", "--out", tmp_path / "none" / "x.csv")
    file = _written(tmp_path / "file", "x")
    assert bad("solve", "rcsr", "--out", file / "x.csv")
    assert file.read_text() == "x"


def test_no_file_is_left_where_there_is_no_answer(tmp_path: Path) -> None:
    target = tmp_path / "x.csv"
    assert run("solve", "rcsr", "--drive", "O1=150:220:1deg", "--out", target).exit_code == 1
    assert not list(tmp_path.iterdir())
    target.write_text("kept")
    assert run("solve", "rcsr", "--drive", "O1=150:220:1deg", "--out", target).exit_code == 1
    assert target.read_text() == "kept"


def test_no_file_is_left_where_writing_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    assert "No space left" in bad("solve", "rcsr", "--out", tmp_path / "x.csv")
    assert not list(tmp_path.iterdir())


# --- as a program ------------------------------------------------------------------------------------------------------


def test_without_typer(tmp_path: Path) -> None:
    _written(tmp_path / "typer.py", "raise ModuleNotFoundError('No module named typer', name='typer')")
    done = process("list", PYTHONPATH=os.pathsep.join([str(tmp_path), str(ROOT)]))
    assert done.returncode == 2
    assert "pip install 'mechgraph[cli]'" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals of another kind")
def test_interrupted(tmp_path: Path) -> None:
    out = tmp_path / "x.csv"
    running = subprocess.Popen(
        [sys.executable, "-m", "mechgraph", "solve", "7r", "--drive", "O1=0:100000:0.1", "--out", str(out)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": str(ROOT)},
        preexec_fn=heard,
    )  # fmt: skip
    for _ in range(20):  # a signal that arrives in a destructor is lost: as at a terminal, it is sent again
        time.sleep(3.0)
        if running.poll() is not None:
            break
        running.send_signal(signal.SIGINT)
    _, error = running.communicate(timeout=60)
    assert running.returncode in (130, -signal.SIGINT)  # which a shell shows as 130
    assert "Traceback" not in error
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(os.name == "nt", reason="signals of another kind")
def test_interrupted_while_it_starts(tmp_path: Path) -> None:
    loading = "import os, signal\ntry:\n    os.kill(os.getpid(), signal.SIGINT)\n    input()\nexcept BaseException:\n    1 / 0"
    _written(tmp_path / "numpy.py", loading)
    done = process("list", PYTHONPATH=os.pathsep.join([str(tmp_path), str(ROOT)]))
    assert done.returncode == 130
    assert done.stderr == "mechgraph: interrupted\n"


def shell(command: str, **environment: str) -> "subprocess.CompletedProcess[str]":
    """A command line with redirections, ``mechgraph`` being this one."""
    return subprocess.run(
        ["bash", "-c", command.replace("mechgraph", f"{sys.executable} -m mechgraph")], capture_output=True, text=True,
        check=False, env=os.environ | {"PYTHONPATH": str(ROOT)} | environment,
    )  # fmt: skip


@pytest.mark.daily(1)
@pytest.mark.skipif(os.name == "nt", reason="a shell of another kind")
@pytest.mark.parametrize(
    ("command", "status", "message"),
    [
        ("mechgraph list >/dev/full", 2, "mechgraph: the output cannot be written: No space left on device\n"),
        ("mechgraph --version >/dev/full", 2, "No space left"),
        ("mechgraph --help >/dev/full", 2, "No space left"),
        ("mechgraph list >&-", 2, "the output cannot be written: Bad file descriptor\n"),
        ("mechgraph check rcs 2>/dev/full", 2, ""),
        ("mechgraph check rcs 2>&-", 2, ""),
        ("mechgraph check rcsr >/dev/full 2>/dev/full", 2, ""),
        ("mechgraph equations rcsr | true; exit ${PIPESTATUS[0]}", 0, ""),
        ("mechgraph solve 7r --out /dev/full", 2, "mechgraph: /dev/full: cannot be written: No space left on device\n"),
        ("mechgraph solve 7r --drive O1=0 --out /dev/stdout | grep -c ,ok", 0, ""),
        ("mechgraph list </dev/null >/dev/null", 0, ""),
    ],
)  # fmt: skip
def test_outputs_that_fail(command: str, status: int, message: str) -> None:
    done = shell(command)
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr
    assert done.returncode == status
    assert message in done.stderr


def test_outputs_that_cannot_show_every_character(tmp_path: Path) -> None:
    text = (ROOT / "library" / "four-bar.toml").read_text(encoding="utf-8")
    _written(tmp_path / "m.toml", text.replace('"crank"', '"\N{GREEK SMALL LETTER ALPHA}"'))
    told = ("check", "--full", tmp_path / "m.toml", "--engine", "dense")
    done = process(*map(str, told), PYTHONIOENCODING="ascii", PYTHONUTF8="0", COLUMNS="30")
    assert done.returncode == 0
    assert not done.stderr
    assert "\x1b" not in done.stdout
    assert done.stdout == run(*told).stdout.encode("ascii", "backslashreplace").decode()
    assert r"\u03b1" in done.stdout


@pytest.mark.daily(4)
@pytest.mark.parametrize("command", ["check", "equations", "solve"])
@pytest.mark.parametrize(
    "name", ["x" * 300, "x" * 100_000, "a\0b", "\udcff", "x/" * 5000, "", " ", "\x1b[2J", "~", "."]
)
def test_names_that_nothing_can_have(command: str, name: str) -> None:
    message = bad(command, name)
    assert message.startswith("mechgraph: ")
    assert "\x1b" not in message
    assert len(message) < 10_000


def test_the_file_of_the_mechanism_is_not_overwritten(crank_slider: Path) -> None:
    before = crank_slider.read_text()
    assert "file of the mechanism" in bad("solve", crank_slider, "--drive", "A=1", "--out", crank_slider)
    assert crank_slider.read_text() == before


def test_the_summary_and_the_table_tell_motor_from_spring(tmp_path: Path) -> None:
    """A massless arm on a spring k = 7 about its hinge: the spring pulls with -7 q, the motor supplies 7 q."""
    m = mg.Mechanism("arm", pairs=[mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=(0, 0, 1))], drives=["A"],
                     loads=[mg.TorsionSpring("A", stiffness=7.0)])  # fmt: skip
    mg.save(m, tmp_path / "arm.toml")
    out = tmp_path / "arm.csv"
    text = run("solve", str(tmp_path / "arm.toml"), "--drive", "A=0:1.5:0.5", "--out", str(out)).stdout
    motor, spring = re.findall(r"^A\.Rz +(\S+) +\S+ deg +(\S+) +\S+ deg$", text, re.MULTILINE)
    assert (motor, spring) == (("0", "7"), ("-7", "0"))
    assert "Applied efforts (springs, dampers, friction, given efforts)" in text
    rows = list(csv.DictReader(out.read_text().splitlines()))
    assert [(float(r["A.Rz effort"]), float(r["A.Rz applied effort"])) for r in rows] == [(0, 0), (3.5, -3.5), (7, -7)]


def test_a_drive_of_the_call_takes_the_place_of_the_declared_one() -> None:
    text = run("solve", "four-bar", "--drive", "D=0:10deg:5deg").stdout
    assert "D.Rz [N m]" in text
    assert "A.Rz [N m]" not in text


def test_respond_prints_a_summary_and_writes_the_motion(tmp_path):
    out = tmp_path / "motion.csv"
    done = run("respond", "windows-2", "--for", "500ms", "--rate", "A0=-1", "--points", "6", "--out", str(out))
    assert done.exit_code == 0, done.output
    assert "energy balance, of the largest kinetic energy" in done.output
    assert len(out.read_text().splitlines()) == 7


def test_respond_takes_steps_no_longer_than_it_may(tmp_path):
    out = tmp_path / "motion.csv"
    free = run("respond", "windows-2", "--for", "100ms", "--out", str(out)), out.read_text().splitlines()
    bounded = (
        run("respond", "windows-2", "--for", "100ms", "--max-step", "2ms", "--out", str(out)),
        out.read_text().splitlines(),
    )
    assert free[0].exit_code == bounded[0].exit_code == 0, bounded[0].output
    assert len(bounded[1]) >= 51 > len(free[1])


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--for", "-1s"), "above 0"),
        (("--for", "1min"), "above 0 in s, ms"),
        (("--for", "3min"), "expected a time"),
        (("--for", "1s", "--max-step", "0"), "--max-step '0': expected a time above 0"),
        (("--for", "1s", "--rate", "A0=1", "--rate", "A1=2"), "contradict the closure"),
        (("--for", "1s", "--start", "A0=3kg"), "--start"),
    ],
)
def test_respond_refuses_what_it_cannot_read(options, words):
    done = run("respond", "windows-2", *options)
    assert done.exit_code == 2
    assert words in done.output


def test_a_drive_declared_at_its_dead_point_is_told_without_a_hint_that_does_not_help(tmp_path: Path) -> None:
    z = (0, 0, 1)
    gear = mg.Mechanism("gear", pairs=[
        mg.Pair("A", "R", "frame", "leg", point=(0, 0, 0), axis=z), mg.Pair("B", "R", "leg", "lower", point=(0, -1, 0), axis=z),
        mg.Pair("C", "R", "lower", "upper", point=(0.5, -0.5, 0), axis=z), mg.Pair("D", "R", "upper", "frame", point=(1, 0, 0), axis=z),
    ], drives=["A"])  # fmt: skip
    mg.save(gear, tmp_path / "gear.toml")
    result = invoke("solve", str(tmp_path / "gear.toml"), "--drive", "A=0:10:5deg")
    assert result.exit_code == 1
    assert "A.Rz is stationary there" in result.output
    assert "--on-reach" not in result.output


def test_an_angle_of_many_turns_without_a_unit_is_doubted() -> None:
    """It is read as radians all the same; with a unit nothing is said, and lengths and rates have no turns."""
    told = run("solve", "four-bar", "--drive", "A=0:360:30")
    assert told.exit_code == 0
    assert "--drive 'A=0:360:30': read as radians, 57.3 turns; for degrees write 360deg" in told.stderr
    assert json.loads(run("solve", "four-bar", "--drive", "A=0:360:30", "--json").stdout)["positions"] == 12
    assert "write 30deg" in run("check", "four-bar", "--at", "A=30").stderr
    for quiet in ("A=0:360:30deg", "A=0:12:1", "A=0:360rad:30", "A=0:6:1@600"):
        assert "read as" not in run("solve", "four-bar", "--drive", quiet).stderr


def test_a_motion_in_whole_numbers_beyond_two_turns_is_doubted_in_python_too() -> None:
    m = mg.load("four-bar")

    def told(motion: object) -> list[str]:
        return [str(one) for one in mg.solve(m, {"A": motion}).warnings]

    assert told(np.arange(0, 361, 30)) == ["A.Rz: read as radians, 57.3 turns; for degrees write np.deg2rad(...)"]
    for quiet in (
        np.arange(12),
        np.linspace(0, 20, 12),
        np.deg2rad([0, 720]),
        mg.Motion([0.0, 20.0, 40.0], 20.0, t=[0, 1, 2]),
    ):
        assert told(quiet) == []
    # where nothing closes there is no solution to say so
    rocker, word = m.replace(drives=["D"]), r"D\.Rz: read as radians, 7\.162 turns; for degrees write np\.deg2rad"
    with pytest.raises(mg.ReachError, match=f"{word}.*on_reach"):
        mg.kinematics(rocker, {"D": [0, 45]})
    with pytest.raises(mg.ReachError) as caught:
        mg.kinematics(rocker, {"D": 2.5})
    assert "read as" not in str(caught.value)
    assert re.search(word, " ".join(str(mg.assemblies(rocker, {"D": 45})).split()))
    assert "read as" not in str(mg.assemblies(m, {"A": 45})) + str(mg.assemblies(rocker, {"D": 2.5}))


def test_a_drive_without_a_motion_is_answered_in_options(tmp_path: Path) -> None:
    m = mg.load("four-bar")
    mg.save(m.replace(drives=["A"]), tmp_path / "still.toml")
    for arguments in (("plot", "efforts"), ("plot", "path"), ("solve",), ("loads", "coupler")):
        message = bad(arguments[0], tmp_path / "still.toml", *arguments[1:])
        assert "drive 'A.Rz': has no motion; give one, e.g. --drive A.Rz=0:360:5deg" in message
    out = tmp_path / "still.svg"
    assert run("plot", tmp_path / "still.toml", "--out", out).exit_code == 0
