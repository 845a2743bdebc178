"""Wrong types at the public doors: one sentence that names the argument, never an error of Python's own; options known to type checkers."""

import inspect
import typing

import numpy as np
import pytest

import mechgraph as mg
from mechgraph.equations.build import BOOKKEEPINGS, BookkeepingName
from mechgraph.force.dalembert import METHODS, MethodName
from mechgraph.variants.sampling import SAMPLINGS, SamplingName

M = mg.load("four-bar")
Z = (0, 0, 1)
HINGE = mg.Pair("A", "R", "frame", "door", point=(0, 0, 0), axis=Z)


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
    "save a name": (lambda: mg.save("four-bar", "x.toml"), "expected a Mechanism"),
    "save to a number": (lambda: mg.save(M, 3), "path = 3"),
    "load a number": (lambda: mg.load(3), "name = 3"),
    "load bytes": (lambda: mg.load(b"four-bar"), "name = "),
    "chain of a list": (lambda: mg.chain(["R"]), "pairs = ['R']"),
    "chain with links by name": (lambda: mg.chain("RRRR", links=["link1"]), "link 'link1'"),
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
    "an unhashable frame": (lambda: door(frame=[]), "frame []"),
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
    "a study of a name": (lambda: mg.study("four-bar", {"crank.mass": [1]}, "A.effort"), "mechanism = 'four-bar'"),
    "a study of a list": (lambda: mg.study(M, ["crank.mass"], "A.effort"), "expected a mapping"),
    "a study with a wrong sampling": (lambda: mg.study(M, {"crank.mass": [1]}, "A.effort", sampling=[]), "sampling = []"),
    "a study of 1e12 variants": (lambda: mg.study(M, {"crank.mass": [1]}, "A.effort", n=10**12), "at most"),
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
    ("names", "known"), [(MethodName, METHODS), (BookkeepingName, BOOKKEEPINGS), (SamplingName, SAMPLINGS)]
)
def test_the_options_that_type_checkers_see_are_those_that_are_taken(names, known):
    assert list(typing.get_args(names)) == list(known)


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
