"""What the benchmarks hand to other programs, and how they report; without those programs, and without a clock."""

import ast
import re
import sys
import tomllib
from pathlib import Path

import bench_peers
import numpy as np
import peer_mechgraph
import pytest
from peer_cases import cases

import mechgraph as mg

HERE = Path(__file__).resolve().parent
CASES = {case.mechanism.name: case for case in cases(24)}
each_case = pytest.mark.parametrize("case", CASES.values(), ids=list(CASES))


@each_case
def test_bodies_and_joints_are_the_mechanism(case):
    """Declared anew from the numbers alone, the mechanism needs the same torque, and the power balances."""
    s = mg.solve(case.mechanism, {case.driver: case.motion})
    torque, wrenches = peer_mechgraph.solve(case)
    np.testing.assert_allclose(torque, s[case.driver].effort[:, 0], atol=1e-9 * np.abs(torque).max())
    assert wrenches.shape == (len(case.joints), 24, 6)
    assert np.abs(s.checks.power).max() < 1e-11


@each_case
def test_joints_go_round_the_loop(case):
    ends = [case.frame, *(joint.b for joint in case.joints)]
    assert [joint.a for joint in case.joints] == ends[:-1]
    assert ends[-1] == case.frame
    assert [body.name for body in case.bodies] == ends[1:-1]
    for joint in case.joints:
        np.testing.assert_allclose(joint.axes.T @ joint.axes, np.eye(3), atol=1e-12)


@each_case
def test_velocities_are_those_of_the_first_step(case):
    """Velocity of a mass center against the difference of its places."""
    step = 1e-6
    q, rate = case.motion.position[0], case.turned()[1][0]
    s = mg.kinematics(case.mechanism, {case.driver: np.array([q - step * rate, q, q + step * rate])})
    for body in case.bodies:
        place = s.link(body.name).center
        np.testing.assert_allclose(body.velocity, (place[2] - place[0]) / (2 * step), rtol=1e-6, atol=1e-6)


def test_a_program_that_is_not_installed_says_so(monkeypatch):
    monkeypatch.setattr(bench_peers, "PEERS", {"Other": "no_such_program"})
    programs, every = bench_peers.installed(), {"four-bar": [CASES["four-bar"]]}
    assert programs["Other"] == "not installed"
    text = bench_peers.table(programs, every, {"four-bar": [bench_peers.compared(programs, CASES["four-bar"], 1)]})
    assert "| four-bar, R-R-R-R | 24 | " in text
    assert " ms | - |" in text
    assert "Not there: Other (not installed)." in " ".join(text.split())


def test_a_program_that_fails_says_why():
    assert bench_peers.cell(bench_peers.Result(failure="the loop does not close")) == "the loop does not close"


def test_a_cell_tells_the_ratio_and_an_error_that_counts():
    assert bench_peers.cell(bench_peers.Result(0.0123, 1.0, 1e-15)) == "12 ms"
    assert bench_peers.cell(bench_peers.Result(0.213, 0.184, 1e-2)) == "210 ms (x 0.18), error 1e-02"


def test_what_the_table_says_in_short_is_what_it_holds():
    """Ratios of 1 / 4 and 1 / 2 at the most positions are two to four times as fast."""
    names = ("mechgraph", *bench_peers.PEERS)
    programs = dict.fromkeys(names, peer_mechgraph)
    rows = {
        f"m{k}": [dict.fromkeys(names, bench_peers.Result(1.0, ratio)) for ratio in (1.0, 0.1, 1.0, 1 / k)]
        for k in (2, 4)
    }
    said = " ".join(bench_peers.in_short(programs, rows))
    assert "in C++ the job is 2 to 4 times as fast as mechgraph at 3,600 positions, 10 at 36." in said
    assert "From Python Pinocchio is 10 times as fast at 36 and 2 to 4 at 3,600." in said


def test_a_single_position_has_no_step():
    (case, *_) = cases(1)
    assert (len(case.t), case.step) == (1, 0.0)
    torque, wrenches = peer_mechgraph.solve(case)
    right, _ = peer_mechgraph.solve(case, method="newton_euler")
    assert bench_peers.largest_error(torque[None], right[None]) < 1e-12
    assert wrenches.shape == (len(case.joints), 1, 6)


def imported(script: Path, seen: set[Path]) -> set[str]:
    """Packages that a script imports, and what the modules of the tests imports that it takes from beside it."""
    seen.add(script)
    out: set[str] = set()
    for node in ast.walk(ast.parse(script.read_text(encoding="utf-8"))):
        names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
        names += [node.module] if isinstance(node, ast.ImportFrom) and node.module else []
        for name in (name.partition(".")[0] for name in names):
            beside = [path for folder in (HERE, HERE.parent) if (path := folder / f"{name}.py").exists()]
            out |= {name} if not beside else set().union(*(imported(p, seen) for p in beside if p not in seen))
    return out


def test_the_extra_bench_has_all_that_the_benchmarks_import():
    """``pip install '.[bench]'`` suffices; headers of Eigen for the C++ job are in cmeel-eigen."""
    needed = set().union(*(imported(script, set()) for script in HERE.glob("[bp]e*.py"))) - {"mechgraph"}
    project = tomllib.loads((HERE.parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extra = project["optional-dependencies"]["bench"]
    given = {re.match(r"[\w-]+", line)[0] for line in (*project["dependencies"], *extra)}
    packages = {name.replace("pinocchio", "pin") for name in needed - sys.stdlib_module_names}
    assert {"pin", "exudyn", "hypothesis", "numpy"} <= packages
    assert packages <= given
    assert "cmeel-eigen" in given


def test_the_table_has_its_place_in_the_readme():
    assert len(bench_peers.MARKED.findall(bench_peers.PAGE.read_text(encoding="utf-8"))) == 1
