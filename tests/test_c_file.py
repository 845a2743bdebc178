"""C and units for co-simulation to take away: they compile without a warning, whatever things are called, and give what ``solve`` gives."""

import ctypes
import os
import re
import shutil
import subprocess
import zipfile
from pathlib import Path

import numpy as np
import pytest
from program import invoke

import mechgraph as mg
from mechgraph.compiled.fmu import description, variables, write_tables
from mechgraph.compiled.tabled import STATUSES, source_text, tabled, write_c
from mechgraph.kernel import build, compiler

ROOT = Path(__file__).resolve().parents[1]
STRICT = ("-std=c99", "-O0", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wtrigraphs", "-Wcomment")
HOSTILE = (
    "*/ int x; /*",
    "a\nb */",
    "??/",
    "/*",
    "x*",
    "/",
    "\\",
    "\\\n#error",
    '"',
    "</fmiModelDescription>&",
    "%s",
    "\u202e",
    "Kurbel ä",
    "@GUID@",
)


def c_compiler() -> list[str]:
    return compiler.compilers()[0]


def run_c(file: Path, *more: Path) -> str:
    """What a program prints, compiled without a warning."""
    program = file.with_suffix(".exe")
    sources = [str(part) for part in (file, *more)]
    done = subprocess.run(
        [*c_compiler(), *STRICT, *sources, "-o", str(program), "-lm"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout


def library_of(file: Path, name: str) -> ctypes.CDLL:
    target = file.with_suffix(".so")
    line = [*c_compiler(), *STRICT, "-shared", "-fPIC", "-ffp-contract=off", str(file), "-o", str(target), "-lm"]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    library = ctypes.CDLL(str(target))
    getattr(library, f"{name}_state_size").restype = ctypes.c_size_t
    return library


def solved(library: ctypes.CDLL, name: str, m: mg.Mechanism, q: list[float]) -> tuple[int, list[np.ndarray]]:
    state = np.zeros(getattr(library, f"{name}_state_size")() // 8 + 1)
    out = [np.full(n, 7.0) for n in (len(q), 6 * len(m.pairs), len(m.freedom_names()))]
    given = [np.array(values, dtype=float) for values in (q, np.full(len(q), 2.0), np.full(len(q), 0.5))]
    getattr(library, f"{name}_start")(ctypes.c_void_p(state.ctypes.data))
    status = getattr(library, f"{name}_solve")(*(ctypes.c_void_p(part.ctypes.data) for part in (state, *given, *out)))
    return status, out


@pytest.mark.daily(3)
@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("name", ["rcsr-csr", "bricard-cube", "rssr", "planar marghitu-2-1", "rough rcsr"])
def test_c_gives_what_solve_gives(name, tmp_path):
    m = mg.load(name.split()[-1])
    m = m.to_planar() if name.startswith("planar") else m
    if name.startswith("rough"):
        m = m.replace(loads=[*m.loads, *(mg.Friction(p.name, mu=0.05, radius=0.02) for p in m.pairs)])
    t = tabled(m)
    write_c(t, tmp_path / "press.c")
    q = (t.home + 0.1).tolist()
    library = library_of(tmp_path / "press.c", "press")
    status, (effort, reaction, position) = solved(library, "press", m, q)
    s = mg.solve(m, {n: mg.Motion(q[i], 2.0, 0.5) for i, n in enumerate(t.drives)}, engine="dense")
    assert status == 0
    expected = np.concatenate([s[p.name].reaction for p in m.pairs])
    assert (np.isnan(reaction) == np.isnan(expected)).all()
    np.testing.assert_allclose(reaction, expected, atol=1e-11 * np.nanmax(np.abs(expected)))
    np.testing.assert_allclose(position, np.concatenate([s[p.name].position for p in m.pairs]), atol=1e-12)
    np.testing.assert_allclose(effort[0], s[m.pairs[m.freedom(t.drives[0])[0]].name].effort.sum(), rtol=1e-11)


@pytest.mark.usefixtures("compiled")
def test_a_refused_position_leaves_outputs_and_state(tmp_path):
    m = mg.load("rcsr")
    write_c(tabled(m), tmp_path / "press.c")
    library = library_of(tmp_path / "press.c", "press")
    for bad in (4.0, float("nan"), float("inf")):
        status, out = solved(library, "press", m, [bad])
        assert 0 < status < len(STATUSES)
        assert all((part == 7.0).all() for part in out)


@pytest.mark.usefixtures("compiled")
def test_parameters_are_written_as_they_are(tmp_path):
    m = mg.load("7r")
    c = mg.compile(m)
    c.parameters["length[2]"] = 1.01 * c.parameters["length[2]"]
    c.write(tmp_path / "press.c", name="other")
    status, (effort, _, position) = solved(library_of(tmp_path / "press.c", "other"), "other", m, c.tables.home + 0.1)
    assert status == 0
    assert effort[0] == pytest.approx(c(c.tables.home + 0.1, 2.0, 0.5)[0], rel=1e-10)
    np.testing.assert_allclose(position, [c.position(p.name)[0] for p in m.pairs], atol=1e-12)


def hostile() -> mg.Mechanism:
    """A four-bar whose names would end comments, strings and elements."""
    m = mg.load("four-bar")
    links = {link.name: f"{HOSTILE[i]}{i}" for i, link in enumerate(m.links)}
    pairs = {pair.name: f"{HOSTILE[4 + i]}{HOSTILE[8 + i]}" for i, pair in enumerate(m.pairs)}
    return m.replace(
        name="".join(HOSTILE), description="".join(HOSTILE), frame=links[m.frame], drives=[pairs["A"]],
        links=[link.replace(name=links[link.name]) for link in m.links],
        pairs=[p.replace(name=pairs[p.name], a=links[p.a], b=links[p.b]) for p in m.pairs],
        loads=[mg.Gravity((0, -9.81, 0))], units={"length": "*/ m", "mass": "??/", "time": '"s'},
    )  # fmt: skip


@pytest.mark.filterwarnings("ignore:.*unknown unit")
@pytest.mark.usefixtures("compiled")
def test_hostile_names(tmp_path):
    m = hostile()
    write_c(tabled(m), tmp_path / "press.c")
    status, (effort, *_) = solved(library_of(tmp_path / "press.c", "press"), "press", m, [0.5])
    plain = mg.solve(mg.load("four-bar"), {"A": mg.Motion(0.5, 2.0, 0.5)}, loads=m.loads, engine="dense")["A"].effort[0]
    assert (status, effort[0]) == (0, pytest.approx(plain, rel=1e-11))
    both = [(tmp_path / file).read_text(encoding="utf-8") for file in ("press.c", "press.h")]
    assert "\u202e" not in "".join(both)
    assert "Kurbel ä" in both[0]


@pytest.mark.parametrize("name", ["1a", "a b", "a-b", "", "a*/", "ä", "x" * 41, "a\n", 3])
def test_a_name_is_an_identifier(name, tmp_path):
    with pytest.raises(mg.DeclarationError, match="identifier of C"):
        write_c(tabled(mg.load("four-bar")), tmp_path / "press.c", name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.daily(1)
@pytest.mark.parametrize("name", ["int", "mgk", "MGK"])
def test_names_do_not_meet_those_of_the_kernel(name, compiled, tmp_path):
    write_c(tabled(mg.load("four-bar")), tmp_path / "press.c", name)
    assert solved(library_of(tmp_path / "press.c", name), name, mg.load("four-bar"), [0.5])[0] == 0


def test_file_names(tmp_path):
    for name in ('a"b.c', "a\\b.c", "x\ny.c"):
        with pytest.raises(mg.FileError, match="#include"):
            write_c(tabled(mg.load("four-bar")), tmp_path / name, "press")
    with pytest.raises(mg.FileError, match=r"known: \.c"):
        write_tables(tabled(mg.load("four-bar")), tmp_path / "press.rs")


def test_c_is_written_without_a_compiler(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(build, "installed", lambda: None)
    out = tmp_path / "press.c"
    done = invoke("compile", "four-bar", "--out", str(out), "--name", "mill")
    assert done.exit_code == 0, done.output
    assert "int mill_solve(void *state" in out.read_text(encoding="utf-8")
    assert "size_t mill_state_size(void);" in out.with_suffix(".h").read_text(encoding="utf-8")
    monkeypatch.setattr(compiler, "compilers", list)
    done = invoke("compile", "four-bar", "--out", str(tmp_path / "press.fmu"))
    assert done.exit_code == 2
    assert "C compiler" in done.output
    assert not (tmp_path / "press.fmu").exists()


def test_statuses_are_those_of_the_kernel():
    header = compiler.INCLUDED[1].read_text(encoding="utf-8")
    known = re.findall(r"^  MGK_(\w+) = (\d+),? *(?:/\*|\n|$)", header[header.index("What comes back") :], re.MULTILINE)
    assert [(key, str(i)) for i, (key, _, _) in enumerate(STATUSES)] == known[: len(STATUSES)]


def test_every_status_of_a_compiled_mechanism_stands_in_its_table() -> None:
    page = (ROOT / "docs" / "how-to" / "control-loop.md").read_text(encoding="utf-8")
    table = page.partition("| `c.status` |")[2].partition("\n\n")[0]
    words = [word for row in table.splitlines()[2:] for word in row.split("|")[1].strip().split(", ")]
    assert sorted(words) == sorted(word for _, word, _ in STATUSES)


def test_no_heap_and_no_globals():
    text = source_text(tabled(mg.load("four-bar")), "press", "press.h")
    code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
    assert not re.search(r"\b(?:malloc|calloc|free|realloc|printf)\b", code)
    assert set(re.findall(r"#include (.*)", code)) == {'"press.h"', "<math.h>", "<string.h>"}
    assert not re.search(r"^static (?!const)(?!.*\().*;$", code, re.MULTILINE)


@pytest.mark.usefixtures("compiled")
def test_the_controller_loop_of_the_manual(tmp_path):
    page = (ROOT / "docs" / "how-to" / "control-loop.md").read_text(encoding="utf-8")
    (loop,) = re.findall(r"^```c\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    (tmp_path / "loop.c").write_text(loop)
    write_c(tabled(mg.load("four-bar")), tmp_path / "press.c")
    printed = float(run_c(tmp_path / "loop.c", tmp_path / "press.c").split()[-1])
    expected = mg.solve(mg.load("four-bar"), {"A": mg.Motion([0.0, 10.0 * 0.999], 10.0)}, engine="dense")["A"].effort[
        -1, 0
    ]
    assert printed == pytest.approx(expected, abs=5e-7)


@pytest.fixture
def plainly(monkeypatch):
    """Units compiled without the optimizations that take the compiler seconds."""
    monkeypatch.setattr(compiler, "FLAGS", ("-O0", *compiler.FLAGS[1:]))


def entered(file, folder):
    """A unit that is valid, in its initialization, with the numbers of its variables."""
    fmpy = pytest.importorskip("fmpy")
    from fmpy.fmi2 import FMU2Slave
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(file)) == []
    about = fmpy.read_model_description(str(file))
    places = {v.name: v.valueReference for v in about.modelVariables}
    slave = FMU2Slave(
        guid=about.guid, unzipDirectory=fmpy.extract(str(file), str(folder / "x")), instanceName="press",
        modelIdentifier=about.coSimulation.modelIdentifier,
    )  # fmt: skip
    slave.instantiate()
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    return slave, places


@pytest.mark.usefixtures("compiled", "plainly")
def test_a_unit_runs_in_fmpy(tmp_path):
    m = mg.load("rcsr")
    c, file = mg.compile(m), tmp_path / "press.fmu"
    c.write(file)
    slave, places = entered(file, tmp_path)
    slave.exitInitializationMode()
    q = 2.7 + np.linspace(0.0, 0.6, 7)
    s = mg.solve(m, {"O1": mg.Motion(q, 2.0, 0.5)}, engine="dense")
    for i, value in enumerate(q):
        slave.setReal([places[f"O1.Rz.{kind}"] for kind in "qva"], [value, 2.0, 0.5])
        slave.doStep(0.1 * i, 0.1)
        assert slave.getReal([places["O1.Rz.effort"]])[0] == pytest.approx(s["O1"].effort[i, 0], rel=1e-9)
        for p in m.pairs:
            reaction = slave.getReal(
                [places[f"{p.name}.reaction.{part}"] for part in ("Mx", "My", "Mz", "Fx", "Fy", "Fz")]
            )
            np.testing.assert_allclose(reaction, s[p.name].reaction[i], atol=1e-9 * np.abs(s[p.name].reaction[i]).max())
            position = slave.getReal([places[f"{name}.position"] for name in p.freedom_names])
            np.testing.assert_allclose(position, s[p.name].position[i], atol=1e-12)
    kept = slave.getFMUstate()
    slave.setReal([places["O1.Rz.q"]], [4.0])
    assert np.isnan(slave.getReal([places["O1.Rz.effort"]])[0])
    assert slave.getInteger([0])[0] != 0
    slave.setFMUstate(kept)
    assert slave.getReal([places["O1.Rz.effort"]])[0] == pytest.approx(s["O1"].effort[-1, 0], rel=1e-9)
    slave.freeFMUstate(kept)
    slave.terminate()
    slave.freeInstance()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*unknown unit")
@pytest.mark.usefixtures("compiled")
def test_a_unit_of_hostile_names(tmp_path):
    from xml.etree import ElementTree

    t = tabled(hostile())
    root = ElementTree.fromstring(description(t, "press", "{1}"))
    inputs, outputs = variables(t)
    assert len(root.findall(".//ScalarVariable")) == len(inputs) + len(outputs) + 1
    write_tables(t, tmp_path / "press.fmu")
    with zipfile.ZipFile(tmp_path / "press.fmu") as archive:
        assert any(name.startswith("binaries/") for name in archive.namelist())
    again = (tmp_path / "press.fmu").read_bytes()
    os.remove(tmp_path / "press.fmu")
    write_tables(t, tmp_path / "press.fmu")
    assert (tmp_path / "press.fmu").read_bytes() == again


@pytest.mark.usefixtures("compiled", "plainly")
def test_a_unit_under_efforts_runs_in_fmpy(tmp_path):
    """Efforts that change from step to step: the motion that ``respond`` gives with them as loads, its reactions too."""
    m, file, h, efforts = mg.load("rcsr"), tmp_path / "press.fmu", 0.05, (0.1, -0.2, 0.3)
    mg.compile(m).write(file, inputs="efforts")
    slave, places = entered(file, tmp_path)
    slave.setReal([places["O1.Rz.velocity.start"]], [3.0])
    slave.exitInitializationMode()
    start, rates = dict(m.start), {"O1": 3.0}
    for i, effort in enumerate(efforts):
        r = mg.respond(
            m.replace(drives=[], start=start, loads=[*m.loads, mg.Effort("O1", effort)]), [0.0, 0.5 * h, h], rates=rates, rtol=1e-11,
            atol=1e-12, engine="dense",
        )  # fmt: skip
        slave.setReal([places["O1.Rz.effort"]], [effort])
        slave.doStep(h * i, h)
        for p in m.pairs:
            known = {"position": r[p.name].position[-1], "velocity": r[p.name].velocity[-1]}
            for what, values in known.items():
                found = slave.getReal([places[f"{name}.{what}"] for name in p.freedom_names])
                np.testing.assert_allclose(found, np.ravel(values), atol=1e-7, err_msg=f"{p.name} {what}")
            found = slave.getReal(
                [places[f"{p.name}.reaction.{part}"] for part in ("Mx", "My", "Mz", "Fx", "Fy", "Fz")]
            )
            np.testing.assert_allclose(found, r[p.name].reaction[-1], atol=1e-6 * np.abs(r[p.name].reaction[-1]).max())
        start = {
            name: float(value)
            for p in m.pairs
            for name, value in zip(p.freedom_names, np.ravel(r[p.name].position[-1]), strict=True)
        }
        rates = {"O1": float(r["O1"].velocity[-1, 0])}
    assert slave.getInteger([0])[0] == 0
    slave.terminate()
    slave.freeInstance()


@pytest.mark.usefixtures("compiled")
@pytest.mark.parametrize("command", ["gcc", "clang"])
def test_steps_of_the_motion_in_c(command, tmp_path):
    """It compiles without a warning; what is refused leaves the state, and a step may be cut into others."""
    if shutil.which(command) is None:
        pytest.skip(f"no {command} here")
    m, file = mg.load("four-bar"), tmp_path / "press.c"
    mg.compile(m).write(file, inputs="efforts")
    line = [command, *STRICT, "-shared", "-fPIC", str(file), "-o", str(tmp_path / "press.so"), "-lm"]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    press = ctypes.CDLL(str(tmp_path / "press.so"))
    press.press_state_size.restype = ctypes.c_size_t
    pointer = np.ctypeslib.ndpointer(dtype=float)
    press.press_begin.argtypes = [pointer, pointer]
    press.press_step.argtypes = [pointer, ctypes.c_double, *[pointer] * 4]
    position, velocity, reaction = np.zeros(4), np.zeros(4), np.zeros((4, 6))

    def ends(*times: float, effort: float = 0.5) -> list[int]:
        return [press.press_step(state, h, np.array([effort]), position, velocity, reaction) for h in times]

    state = np.zeros(press.press_state_size() // 8 + 1)
    assert press.press_begin(state, np.array([2.0])) == 0
    assert ends(0.0, 0.1) == [0, 0]
    whole = position.copy(), velocity.copy()
    assert press.press_begin(state, np.array([2.0])) == 0
    assert ends(0.03, 0.04) == [0, 0]
    assert [status != 0 for status in (*ends(-1.0), *ends(np.nan), *ends(0.1, effort=np.inf))] == [True] * 3
    assert ends(0.03) == [0]
    np.testing.assert_allclose(position, whole[0], atol=1e-8)
    np.testing.assert_allclose(velocity, whole[1], atol=1e-7)
    loads = [*m.loads, mg.Effort("A", 0.5)]
    r = mg.respond(
        m.replace(drives=[], loads=loads), [0.0, 0.05, 0.1], rates={"A": 2.0}, rtol=1e-11, atol=1e-12, engine="dense"
    )
    np.testing.assert_allclose(position, np.concatenate([r[p.name].position[-1] for p in m.pairs]), atol=1e-7)


def test_inputs_of_what_is_written(tmp_path):
    with pytest.raises(mg.DeclarationError, match="inputs = 'forces': expected one of 'motion', 'efforts'"):
        write_tables(tabled(mg.load("four-bar")), tmp_path / "press.c", inputs="forces")
    done = invoke("compile", "four-bar", "--out", str(tmp_path / "press.c"), "--inputs", "efforts")
    assert done.exit_code == 0, done.output
    assert "int press_step(void *state, double time" in (tmp_path / "press.h").read_text(encoding="utf-8")
