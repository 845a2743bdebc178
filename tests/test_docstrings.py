"""Docstrings are the reference: every public name has an example, every example runs, every parameter has its entry."""

import doctest
import inspect
import re
from collections.abc import Callable, Iterator
from typing import Any

import matplotlib.pyplot as plt
import pytest

import mechgraph as mg
from mechgraph import show

MODULES = {
    "inertia": ("rod", "box", "cylinder", "sphere", "from_components"),
    "parts": (
        "Parts",
        "bearings",
        "cardan_shaft",
        "cylinder",
        "four_bar",
        "gear_stage",
        "planetary",
        "rack_and_pinion",
        "rod",
        "screw_drive",
        "slider_crank",
        "spring_strut",
    ),
}
"""Public modules, with their public functions."""
RETURNED = re.compile(r"(Returned|Yielded) by ``|Part of ``|Attribute ``")
"""What the docstring of a class says that users get and do not make."""
SECTION = re.compile(r"^ *(Parameters|Returns|Yields|Examples)\n *---", re.MULTILINE)
MOST = 8
"""Lines of an example."""
FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def public() -> Iterator[tuple[str, Any]]:
    """Every public name of the package and of ``show``."""
    for name in mg.__all__:
        thing = getattr(mg, name)
        if name in MODULES:
            yield from ((f"{name}.{own}", getattr(thing, own)) for own in MODULES[name])
        else:
            yield name, thing
    yield from ((f"show.{name}", getattr(show, name)) for name in show.__all__)


def methods() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Methods of the results, and of the mechanism, that have a section of parameters, results or examples."""
    for name, thing in public():
        for own in dir(thing) if inspect.isclass(thing) else ():
            if own.startswith("_") and own != "__call__":
                continue
            method = inspect.unwrap(getattr(inspect.getattr_static(thing, own), "__func__", getattr(thing, own)))
            if inspect.isfunction(method) and SECTION.search(method.__doc__ or ""):
                yield f"{name}.{own}", method


NAMES = dict(public())
ALL = NAMES | {name: method for name, method in methods() if name.count(".") < 2}


def example_of(name: str) -> doctest.DocTest:
    return doctest.DocTestParser().get_doctest(inspect.getdoc(ALL[name]) or "", {}, name, name, 0)


def entries(doc: str) -> set[str]:
    """Names that have an entry among the parameters."""
    section = re.search(r"^Parameters\n-+\n(.*?)(?=^\w[\w ]*\n---|\Z)", doc, re.MULTILINE | re.DOTALL)
    heads = re.findall(r"^([*\w][\w*, ]*?)(?: :.*)?$", section[1], re.MULTILINE) if section else []
    return {one.strip().lstrip("*") for head in heads for one in head.split(",")}


@pytest.mark.parametrize("name", NAMES)
def test_a_public_name_has_an_example(name: str) -> None:
    examples = example_of(name).examples
    assert examples
    assert examples[0].source == "import mechgraph as mg\n"


FILMS = {"Response.film", "show.film_orbit"}
"""Examples that take as long as that of ``Solution.film``: seconds."""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] if name in FILMS else [])
        for name in ALL
        if ">>>" in (inspect.getdoc(ALL[name]) or "")
    ],
)
def test_an_example_runs(name: str, request: pytest.FixtureRequest) -> None:
    test = example_of(name)
    if any("mg.compile(" in one.source for one in test.examples):
        request.getfixturevalue("compiled")
    said: list[str] = []
    doctest.DocTestRunner(optionflags=FLAGS).run(test, out=said.append)
    plt.close("all")
    assert not said, "".join(said)


@pytest.mark.parametrize("name", [name for name in ALL if callable(ALL[name])])
def test_a_parameter_has_its_entry(name: str) -> None:
    thing, doc = ALL[name], inspect.getdoc(ALL[name]) or ""
    if inspect.isclass(thing) and (RETURNED.search(doc) or "make one by" in doc or issubclass(thing, Warning)):
        return
    taken = set(inspect.signature(thing).parameters) - {"self", "cls"}
    assert taken - entries(doc) == set()


def test_an_example_is_short() -> None:
    """As it was written; the formatter breaks long lines."""
    counts = {name: sum(not one.want.startswith("Traceback") for one in example_of(name).examples) for name in NAMES}
    assert not {name: count for name, count in counts.items() if count > MOST}


def test_what_is_missing_is_found() -> None:
    assert entries(
        "A.\n\nParameters\n----------\na, b : int\n    Text: more.\n**more\n    Rest.\n\nReturns\n-------\nint\n"
    ) == {"a", "b", "more"}
