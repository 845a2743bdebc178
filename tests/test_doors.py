"""Wrong types at the public doors: one sentence that names the argument, never an error of Python's own; options known to type checkers."""

import base64
import importlib.metadata
import inspect
import pickle
import subprocess
import sys
import typing

import numpy as np
import pytest
from program import run

import mechgraph as mg
from mechgraph import show

M = mg.load("four-bar")
Z = (0, 0, 1)
HINGE = mg.Pair("A", "R", "frame", "door", point=(0, 0, 0), axis=Z)


BALL = mg.Pair("A", "Sp", "frame", "door", on_b=mg.Marker(), surface=mg.Surface.plane())
S = mg.free_body(mg.solve(M, {"A": 0.0}), "crank")


def door(**more):
    return mg.Mechanism("door", pairs=more.pop("pairs", [HINGE]), **more)


WRONG = {
    "solve a name": (lambda: mg.solve("four-bar"), "mechanism = 'four-bar'"),
    "kinematics of None": (lambda: mg.kinematics(None), "mechanism = None"),
    "check a list": (lambda: mg.check([M]), "expected a Mechanism"),
    "check at a number": (lambda: mg.check(M, at=3), "at = 3: expected a mapping"),
    "check with an unhashable engine": (lambda: mg.check(M, engine=["dense"]), "engine = "),
    "assemble a name": (lambda: mg.assemble("four-bar", {"A": 1}), "expected a Mechanism"),
    "assemble at a list": (lambda: mg.assemble(M, ["A"]), "values = "),
    "assemble from a list": (lambda: mg.assemble(M, {}, guess=["A"]), "guess = "),
    "formulate a name": (lambda: mg.formulate("four-bar"), "expected a Mechanism"),
    "formulate in a list": (lambda: mg.formulate(M, ["lee"]), "bookkeeping = "),
    "formulate for something else": (lambda: mg.formulate(M, unknowns="all"), "unknowns = 'all'"),
    "formulate with one effort": (lambda: mg.formulate(M, efforts="A"), "efforts = 'A'"),
    "save several": (lambda: mg.save(mg.assemblies(mg.load("four-bar"), {"A": 0.5}), "x.toml"), "such as the first of these"),
    "save a name": (lambda: mg.save("four-bar", "x.toml"), "expected a Mechanism"),
    "save to a number": (lambda: mg.save(M, 3), "path = 3"),
    "load a number": (lambda: mg.load(3), "name = 3"),
    "load bytes": (lambda: mg.load(b"four-bar"), "name = "),
    "chain of a list": (lambda: mg.chain(["R"]), "letters = ['R']: expected a text"),
    "chain with links by name": (lambda: mg.chain("RRRR", links=["link1"]), "links = ['link1']: expected a list, each a Link"),
    "chain with a text for lengths": (lambda: mg.chain("RRRR", length="1 2 3 4"), "length = "),
    "markers that are none": (lambda: door(pairs=[mg.Pair("A", "R", "frame", "door", on_a=3, on_b=4)]), "on_a = 3"),
    "ends that are links": (lambda: door(pairs=[mg.Pair("A", "R", mg.Link("frame"), "door")]), "expected the name of a link"),
    "a load alone": (lambda: mg.solve(M, {"A": 0.0}, loads=mg.Gravity(Z)), "expected a list"),
    "a load alone, declared": (lambda: door(loads=mg.Gravity(Z)), "loads = "),
    "a load alone, replaced": (lambda: M.replace(loads=mg.Gravity(Z)), "loads = "),
    "loads that are none": (lambda: mg.solve(M, {"A": 0.0}, loads=["gravity"]), "mg.Gravity(...)"),
    "drives in a text": (lambda: door(drives="A"), "drives = 'A': expected a list"),
    "drives replaced by a text": (lambda: M.replace(drives="A"), "drives = 'A'"),
    "pairs in a text": (lambda: door(pairs="RR"), "pairs = 'RR'"),
    "pairs missing": (lambda: door(pairs=None), "pairs = None"),
    "links by name": (lambda: door(links=["frame", "door"]), "mg.Link(...)"),
    "links in a mapping": (lambda: door(links={"frame": 1}), "links = "),
    "a motion that is none": (lambda: door(drives=[mg.Drive("A", 3.0)]), "motion = 3.0"),
    "a drive of a number": (lambda: door(drives=[mg.Drive(3)]), "freedom 3"),
    "an unhashable name of a link": (lambda: door(links=[mg.Link([]), mg.Link("door")]), "name must be"),
    "an unhashable name of a pair": (lambda: door(pairs=[mg.Pair([], "R", "frame", "door")]), "name must be"),
    "an unhashable frame": (lambda: door(frame=[]), "frame: unknown link []"),
    "an unhashable type": (lambda: door(pairs=[mg.Pair("A", [], "frame", "door")]), "unknown type"),
    "a load on an unhashable link": (lambda: door(loads=[mg.Wrench([], moment=Z)]), "link = []"),
    "a wrench in an unhashable frame": (lambda: door(loads=[mg.Wrench("door", moment=Z, frame=[])]), "frame = []"),
    "a start in a list": (lambda: door(start=["A"]), "start = "),
    "units in a list": (lambda: door(units=["m"]), "units = "),
    "a flag that is a number": (lambda: door(links=[mg.Link("frame"), mg.Link("door", unphysical=1)]), "true or false"),
    "an unknown method": (lambda: mg.solve(M, {"A": 0.0}, method="nope"), "'loop_wrench', 'newton_euler'"),
    "an unhashable method": (lambda: mg.solve(M, {"A": 0.0}, method=[]), "method = []"),
    "an unknown engine": (lambda: mg.kinematics(M, {"A": 0.0}, engine=1), "engine = 1"),
    "an unknown redundant": (lambda: mg.solve(M, {"A": 0.0}, redundant=None), "redundant = None"),
    "an unknown on_reach": (lambda: mg.solve(M, {"A": 0.0}, on_reach={}), "on_reach = {}"),
    "motions in a list": (lambda: mg.solve(M, [0.0]), "expected a mapping"),
    "motions of a number": (lambda: mg.solve(M, {3: 0.0}), "freedom 3"),
    "a pair type of a text": (lambda: mg.PairType("Q", freedoms="Rz"), "freedoms = 'Rz'"),
    "a pair type of numbers": (lambda: mg.PairType("Q", freedoms=[3], reactions=[[4]]), "freedom 3: unknown"),
    "a freedom without a name": (lambda: mg.PairType("Q", freedoms=[mg.Freedom(3, (0, 0, 1, 0, 0, 0))]), "freedom: name = 3"),
    "a bookkeeping that is none": (lambda: mg.PairType("Q", freedoms=["Rz"], bookkeeping=(7, 2)), "expected a Bookkeeping"),
    "a link by number": (lambda: M.link(0), "unknown link 0"),
    "a pair by list": (lambda: M.pair([]), "unknown pair []"),
    "a pose of text": (lambda: M.moved("up"), "expected a 4 x 4 pose"),
    "a mechanism where a solution is due": (lambda: mg.free_body(M, "crank"), "expected a Solution; mg.solve(mechanism)"),
    "a mechanism over time": (lambda: mg.over_time(M), "solution = "),
    "the transmission of a mechanism": (lambda: mg.transmission(M, "D"), "solution = "),
    "the curve of a mechanism": (lambda: show.effort_curve(M, "A"), "solution = "),
    "multiple joints by name": (lambda: mg.multiple_joints("four-bar"), "mechanism = 'four-bar'"),
    "joints that are none": (lambda: mg.identify(M, joints=[mg.MultipleJoint(("A",), 3)]), "joints[0]: pairs = 3"),
    "a position that there is not": (lambda: show.effort_curve(S.solution, "A", marked=3), "marked = 3: expected the index of one of 1"),
    "traces in an array": (lambda: show.draw_skeleton(S.solution, traces=np.array(["no"])), "no pair or named point"),
    "a pair without a name for a number": (lambda: door(pairs=[HINGE.replace(name=10**5000)]), "the name must be"),
    "friction of thousands of digits": (lambda: door(loads=[mg.Friction("A", mu=10**400, radius=1, static=1)]), "mu = "),
    "friction of no name": (lambda: door(loads=[mg.Friction(10**5000, mu=0.1, radius=1)], units={"length": "m"}), "of = an integer"),
    "axes that are none": (lambda: show.draw_graph(M, ax=3), "ax = 3: expected axes of matplotlib"),
    "options of a load deck": (lambda: S.write("x.inp", nonsense=1), "unexpected keyword argument 'nonsense'"),
    "options of a table": (lambda: S.write("x.csv", nonsense=1), "for a load deck"),
    "an argument too many": (lambda: mg.check(M, {}, {}), "too many positional arguments; it takes m, at, engine, tol"),
    "an argument too few": (lambda: mg.solve(), "missing a required argument: 'm'"),
    "an argument that a mechanism lacks": (lambda: door(drive=["A"]), "'drive'; did you mean drives? It takes name, links"),
    "a mechanism of nothing": (lambda: mg.Mechanism(), "missing a required argument: 'name'; it takes name"),
    "an argument that a pair lacks": (lambda: mg.Pair("A", "R", "frame", "door", axes=Z), "did you mean axis? It takes"),
    "an argument that a curve lacks": (lambda: mg.Curve.circle(rad=1), "did you mean radius? It takes"),
    "a method of a report": (lambda: mg.check(M).ledger("x"), "DeterminacyReport.ledger: 1 fault"),
    "an argument that a load lacks": (lambda: mg.Effort("A", 1, breaking=1), "did you mean breaks? It takes freedom"),
    "an unknown group of tolerances": (lambda: mg.Tolerances(ranks={}), "did you mean rank? It takes rank, motion"),
    "an option that a call lacks": (lambda: mg.solve(M, {"A": 0.0}, on_rech="flag"), "did you mean on_reach? It takes m"),
    "a field that a copy lacks": (lambda: M.replace(load=[]), "unknown field 'load'; did you mean loads"),
    "a freedom in small letters": (lambda: mg.solve(M, {"a": 0.0}), "unknown freedom 'a'; did you mean A? (freedoms: A.Rz"),
    "a link that is to be moved": (lambda: mg.solve(M, {"cuopler": np.eye(4)}), "unknown freedom 'cuopler'; did you mean coupler?"),
    "a link that is misspelled": (lambda: M.link("crnk"), "unknown link 'crnk'; did you mean crank? (links: frame"),
    "a base unit that is misspelled": (lambda: door(units={"lenght": "m"}), "unknown base unit 'lenght'; did you mean length?"),
    "a unit that is no text": (lambda: door(units={"length": 3}), "units: length = 3: expected the name of a unit"),
    "a field that no chain has": (lambda: mg.chain("RRRR", nonsense=1), "unknown field 'nonsense'"),
    "a tolerance in a list": (lambda: door(tol=[1], pairs=[BALL]), "tol = (1.0,): expected radians"),
    "a curve without a second direction": (
        lambda: door(pairs=[HINGE.replace(type="Sg", radius=0.1, curve=mg.Curve.circle(radius=1, second=(0, 0, 2)))]),
        "curve.second = (0.0, 0.0, 2.0): parallel to the axis",
    ),
    "rows of thousands of digits": (
        lambda: door(pairs=[HINGE.replace(type="Sp", surface=mg.Surface.patch(points=np.eye(16, 3), rows=10**5000))]),
        "rows = an integer of 16610 bits",
    ),
    "times within times": (
        lambda: door(response=mg.ResponseSetup(time=([0.0, 1.0], 2.0), points=5)),
        "expected (begin, end) or rising times",
    ),
    "a study of a name": (lambda: mg.study("four-bar", {"crank.mass": [1]}, "A.effort"), "mechanism = 'four-bar'"),
    "a study of a list": (lambda: mg.study(M, ["crank.mass"], "A.effort"), "expected a mapping"),
    "a study with a wrong sampling": (lambda: mg.study(M, {"crank.mass": [1]}, "A.effort", sampling=[]), "sampling = []"),
    "a study of 1e12 variants": (lambda: mg.study(M, {"crank.mass": [1]}, "A.effort", n=10**12), "at most"),
    "a frame of thousands of digits": (lambda: door(frame=10**5000), "unknown link an integer of 16610 bits"),
    "a name that is an array": (
        lambda: mg.PairType("Q", name=np.ones(2), freedoms=["Rz"], reactions=["Fx"]),
        "name = array([1., 1.]): expected a text",
    ),
    "masses that are not as many as tensors": (
        lambda: mg.inertia.shifted(np.ones((3, 3, 3)), [1.0, 2.0], [0, 0, 1]),
        "shifted: shape mismatch",
    ),
    "tensors that are none": (lambda: mg.inertia.physical([["x"] * 3] * 3), "expected real numbers"),
    "tensors with a tolerance that is none": (lambda: mg.inertia.physical(np.eye(3), tol={}), "tol = {}"),
    "tensors of another shape": (lambda: mg.inertia.physical([[1, 2], [3, 4]]), "tensors = [[1, 2], [3, 4]]: expected an array"),
    "a film without frames": (
        lambda: mg.show.animate(mg.kinematics(mg.load("four-bar"), {"A": 0.1}), "x.gif", frames=()),
        "frames = (): expected one or more",
    ),
    "a film without frames, by an array": (
        lambda: mg.show.animate(mg.kinematics(mg.load("four-bar"), {"A": 0.1}), "x.gif", frames=np.zeros(0, dtype=int)),
        "expected one or more",
    ),
    "a frame of a row that is no number to write": (
        lambda: mg.PairType("Q", freedoms=["Rz"], reactions=[mg.Component("Fx", (0, 0, 0, 1, 0, 0), frame=10**5000)]),
        "there is no frame an integer of 16610 bits",
    ),
    "a spring of a list": (lambda: door(loads=[mg.Spring(["b"], "c", "P", (0, 0, 0), stiffness=1)]), "a = ['b']: expected a text"),
    "what is read only once": (lambda: mg.identify(M, joints=iter([1])), "joints = (1,): expected a list, each a Multiple"),
    "drivers read only once": (lambda: mg.groups(M, (x for x in [[1]])), "drives = ([1],): expected a text or a list"),
    "a grid of 1e12 variants": (
        lambda: mg.study(M, {f"crank.center.{x}": list(range(10**4)) for x in "xyz"}, "A.effort", sampling="grid"),
        "at most",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_type_is_one_sentence(case):
    call, words = WRONG[case]
    with pytest.raises(mg.DeclarationError) as caught:
        call()
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("call", "option", "needed"),
    [(mg.solve, "method", ({"A": 0.0},)), (mg.formulate, "bookkeeping", ()), (mg.study, "sampling", ({}, ()))],
)
def test_the_options_that_type_checkers_see_are_those_that_are_taken(call, option, needed):
    with pytest.raises(mg.DeclarationError) as caught:
        call(mg.load("four-bar"), *needed, **{option: "none of them"})
    (fault,) = (fault for fault in caught.value.faults if fault.startswith(option))
    assert fault.endswith(
        "expected one of " + ", ".join(map(repr, typing.get_args(typing.get_type_hints(call)[option])))
    )


@pytest.mark.parametrize("call", [mg.solve, mg.kinematics, mg.check, mg.formulate, mg.study])
def test_options_are_literals(call):
    hints = typing.get_type_hints(call)
    options = [n for n, p in inspect.signature(call).parameters.items() if isinstance(p.default, str)]
    assert options
    for name in options:
        assert typing.get_origin(hints[name]) is typing.Literal, name


def test_chain_takes_arrays():
    lengths = np.array([1.0, 2.0, 2.5, 3.0])
    assert mg.chain("RRRR", length=lengths) == mg.chain("RRRR", length=lengths.tolist())


def test_no_setting_of_numpy_and_no_warning_of_it_reaches_a_result():
    """Underflow is everywhere, and a motion that rests has zeros to divide by: whatever a program has set, the numbers are the same."""
    swung = M.replace(drives=[])

    def results():
        response = mg.respond(swung, [0.0, 0.05])
        return response["A"].position, mg.assemblies(M, {"A": 0.1}).coordinates, mg.equilibrium(swung).start["A.Rz"]

    calm = results()
    with np.errstate(all="raise"):
        for found, expected in zip(results(), calm, strict=True):
            np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("what", ["events", "progress", "loads"])
def test_a_function_that_raises_keeps_the_motion_so_far(what):
    def fails(t):
        if np.max(t) > 0.02:
            raise ValueError("mine")
        return 0.0 * t + 1.0

    given = {
        "events": mg.Event(lambda s: float(fails(s.t)), 0.5),
        "progress": fails,
        "loads": [mg.Effort("A", lambda pose, twist, t: fails(t))],
    }
    with pytest.raises(mg.ResponseError, match="mine") as caught:
        mg.respond(M.replace(drives=[]), (0.0, 0.05), **{what: given[what]})
    assert 0 < caught.value.solution.t[-1] < 0.05
    assert isinstance(caught.value.__cause__, ValueError if what != "loads" else mg.DeclarationError)


def test_what_is_declared_shows_itself_alike_after_pickling():
    for one in (mg.Event("A"), mg.Wrench("crank", moment=Z), mg.Stop("A", 0.0), mg.ResponseSetup((0.0, 1.0))):
        assert repr(pickle.loads(pickle.dumps(one))) == repr(one)


@pytest.mark.parametrize(
    "line",
    [
        "1",
        "[" * 100_000,
        "9" * 6000,
        '{"links": 1000000000000000, "joints": [[0, 1]], "types": ["R"], "family": 3}',
        '{"links": 1e999, "joints": [], "types": [], "family": 3}',
        '{"links": 2, "joints": [[0, [1]]], "types": ["R"], "family": 3}',
        '{"links": 2, "joints": [[0, 1]], "types": [["R"]], "family": 3}',
    ],
)
def test_what_is_no_chain_is_refused_with_its_line(line, tmp_path):
    path = tmp_path / "chains"
    path.write_text(line)
    with pytest.raises(mg.FileError, match="line 1: expected a chain as save_chains writes it"):
        list(mg.load_chains(path))


def test_the_names_of_the_package_are_the_public_ones():
    assert dir(mg) == sorted(mg.__all__)


def test_the_version_is_that_of_the_package():
    assert mg.__version__ == importlib.metadata.version("mechgraph")
    with pytest.raises(AttributeError, match="no attribute 'slove'") as caught:
        _ = mg.slove
    assert (caught.value.name, caught.value.obj) == ("slove", mg)


def test_a_type_error_of_a_users_own_class_stays_one():
    class Lever(mg.Mechanism):
        def __init__(self, length):
            super().__init__("lever", pairs=[HINGE.replace(point=(length + "", 0, 0))])

    with pytest.raises(TypeError, match="unsupported operand"):
        Lever(1)


def test_a_notebook_shows_a_picture():
    """Also of a view, where what is exported from the notebook runs no widget."""
    start = b"\x89PNG"
    assert show.draw_graph(M)._repr_png_().startswith(start)
    assert base64.b64decode(M.view()._repr_mimebundle_()[0]["image/png"]).startswith(start)


def test_the_path_of_a_response_is_a_curve():
    coarse = mg.respond(M.replace(drives=[]), np.linspace(0.0, 0.3, 4))
    drawn = show.point_path(coarse, "B").lines[0].get_xydata()
    assert len(drawn) > 300
    np.testing.assert_allclose(np.hypot(*drawn.T), 0.1, rtol=1e-9)


def test_power_and_revolutions_in_words():
    turned = mg.solve(M, {"A": mg.Motion(np.linspace(0, 2 * np.pi, 25), 1.0)})
    text = str(mg.over_time(turned))
    assert "power of A.Rz [W]" in text
    assert "a whole cycle of 1 revolution;" in text


def test_named_points_are_outputs_of_studies():
    m = M.replace(links=[one.replace(points={"tip": (0, 0.1, 0)}) for one in M.links], drives=["A"])
    names = ["crank.tip", "crank.tip.velocity"]
    study = mg.study(m, {"crank.mass": [1.0, 2.0]}, names, n=2, motions={"A": mg.Motion([0.3], 2.0)})
    tip = mg.solve(m, {"A": mg.Motion([0.3], 2.0)}).link("crank").at("tip")
    for name, expected in zip(names, (tip.position, tip.velocity), strict=True):
        np.testing.assert_allclose(study.outputs[name], np.stack([expected, expected]), atol=1e-14)
    assert [study.units[name] for name in names] == ["m", "m/s"]


def test_a_planar_model_all_of_which_is_unique_is_green(tmp_path):
    run("report", "four-bar", "-o", tmp_path / "page.html")
    assert "All that a planar model has is unique" in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_without_matplotlib_a_picture_names_the_extra():
    code = """
import sys
sys.modules["matplotlib"] = None  # as where it is not installed
import mechgraph as mg
from mechgraph import cli, show
for call in (lambda: show.draw_graph(mg.load("four-bar")), lambda: show.draw_skeleton(mg.load("four-bar"))):
    try:
        call()
    except mg.MissingExtraError as error:
        print(error)
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == 2 * "matplotlib is not installed. Run: pip install 'mechgraph[plot]'\n"
