"""Whatever comes back can be read: at a prompt, printed, and in a notebook, through one mechanism."""

import inspect
import pydoc
import re
from collections.abc import Iterator, Mapping
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest
import scipy

import mechgraph as mg
from mechgraph.document import Document, Paragraph, Shown, to_html, to_latex, to_text

Z = (0.0, 0.0, 1.0)


def pendulum() -> mg.Mechanism:
    return mg.Mechanism("pendulum", [mg.Link("frame"), mg.Link("bob", 2.0, (0, -1, 0), points={"tip": (0, -2, 0)})],
                        [mg.Pair("A", "R", "frame", "bob", point=(0, 0, 0), axis=Z)], loads=[mg.Gravity((0, -9.81, 0))],
                        units={"length": "m", "mass": "kg", "time": "s"})  # fmt: skip


def gears() -> mg.Mechanism:
    return mg.Mechanism("gears", pairs=[
        mg.Pair("A", "R", "frame", "pinion", point=(0, 0, 0), axis=Z), mg.Pair("B", "R", "frame", "wheel", point=(0.06, 0, 0), axis=Z),
    ], couplings=[mg.Coupling({"A": 20, "B": 40}, name="teeth")], drives=["A"], loads=[mg.Effort("B", -3)])  # fmt: skip


@pytest.fixture(scope="module")
def results() -> dict[str, Any]:
    """One of everything that a user is given."""
    m = mg.load("four-bar")
    s, one, rssr = mg.solve(m), mg.solve(m, {"A": 0.3}), mg.load("rssr")
    moved = mg.solve(gears(), {"A": [0.0, 1.0, 2.0]})
    swing = mg.respond(pendulum(), (0.0, 1.0), start={"A": 0.2}, events=[mg.Event("A", 0.0)])
    return {
        "mechanism": m, "solution": s, "one position": one, "kinematics": mg.kinematics(m, {"A": [0.1, 0.2]}),
        "report": mg.check(m), "report of rssr": mg.check(rssr), "solution of rssr": mg.solve(rssr),
        "topology": mg.check(mg.chain("RPRHRRR")), "formulation": mg.formulate(m), "response system": mg.formulate(m, unknowns="response"),
        "over time": mg.over_time(mg.solve(m, {"A": mg.Motion(np.linspace(0, 1, 9), 2.0)})),
        "free body": mg.free_body(mg.solve(rssr), rssr.links[2].name),
        "pair": s["B"], "pair at one position": one["B"], "link": s.link("coupler"), "point": s.link("coupler").point((0, 0, 0)),
        "load": s.load(1), "gears": gears(), "coupling": moved.coupling("teeth"), "declared coupling": gears().couplings[0],
        "table": mg.pair_types(), "response": swing, "at a time": swing.at(0.5), "pendulum": pendulum(),
        "equilibrium": mg.equilibrium(pendulum(), {"A": 0.2}), "linear": mg.linearize(pendulum()),
        "snapped": m.snapped(1e-4), "changes": m.snapped(1e-4).changes, "assembled": mg.assemble(m, {"A": 0.3}),
        "study": mg.study(m, {"coupler.mass": scipy.stats.norm(0.1, 0.01)}, "A.effort", 5, motions={"A": [0.1, 0.2]}),
        "stop": mg.Stop("A", upper=1.0), "event": mg.Event("A", 0.3),
        "motion": mg.Motion.law("cycloidal", 1.0, 2.0, np.linspace(0, 2, 500)),
        "wrench": mg.Wrench("coupler", force=np.ones((500, 3)), point=(0, 0, 0)),
        "force table": mg.ForceTable(x=list(range(500)), force=list(range(500))),
    }  # fmt: skip


INTERNAL = ("mechgraph.kinematics", "mechgraph.maths", "mechgraph.document", "mechgraph.fields")
"""Where what a user does not ask for is made: unrolled equations, work arrays."""
INSIDE = {
    "System",
    "Freedoms",
    "Position",
    "Components",
    "Basis",
    "Parameters",
    "Course",
    "Trajectory",
    "Source",
    "Part",
    "Scene",
    "Stage",
}
"""Parts of results that are none themselves."""


def found_in(value: Any, path: str, depth: int, seen: set[type]) -> Iterator[tuple[str, Any]]:
    """What can be reached through attributes and calls without arguments, one of every class."""
    if isinstance(value, Mapping) and not type(value).__module__.startswith("mechgraph"):
        value = tuple(value.values())
    if isinstance(value, tuple | list) and not hasattr(value, "_fields"):
        for item in value[:2]:
            yield from found_in(item, f"{path}[0]", depth, seen)
        return
    kind = type(value)
    own = kind.__module__.startswith("mechgraph") and not kind.__module__.startswith(INTERNAL)
    if not own or kind.__name__ in INSIDE or kind.__name__.startswith("_") or kind in seen:
        return
    seen.add(kind)
    yield path, value
    for name in [] if depth == 0 else sorted({*dir(kind), *getattr(value, "__dict__", ())}):
        if name.startswith("_") or name in {"write", "formats", "read_numbers"}:
            continue
        try:
            of = getattr(value, name)
            if callable(of) and not isinstance(of, type) and not inspect.signature(of).parameters:
                of = of()
        except (mg.MechgraphError, AttributeError, TypeError, ValueError):
            continue
        yield from found_in(of, f"{path}.{name}", depth - 1, seen)


def test_everything_that_comes_back_can_be_read(results: dict[str, Any]) -> None:
    seen: set[type] = set()
    known = [one for name, value in results.items() for one in found_in(value, name, 3, seen)]
    assert len(known) > 40
    for path, value in known:
        text = repr(value)
        assert not re.search(r" object at 0x|mappingproxy|array\(|<function|<class|dtype", text), (
            f"{path}: {text[:200]}"
        )
        assert len(text.splitlines()) <= 40, f"{path}: {text[:200]}"
        assert len(text) < 4000, path
        assert max(map(len, text.splitlines())) < 500, path


@pytest.mark.parametrize(
    "name",
    [
        "mechanism", "solution", "one position", "kinematics", "report", "topology", "formulation", "pair", "pair at one position", "link",
        "point", "load", "coupling", "table", "response", "at a time", "equilibrium", "linear", "snapped", "changes", "assembled", "study",
    ],
)  # fmt: skip
def test_a_notebook_shows_what_is_printed(name: str, results: dict[str, Any]) -> None:
    value = results[name]
    assert isinstance(value, Shown)
    document = value.document()
    assert str(value) == to_text(document)
    assert value._repr_html_() == to_html(document)
    assert value._repr_latex_() == to_latex(document)
    assert document.blocks
    assert max(map(len, str(value).splitlines())) <= 80 or name == "formulation"


def test_names_are_escaped() -> None:
    evil = '<script>alert("x")</script>'
    m = mg.Mechanism(evil, [mg.Link("frame"), mg.Link(evil, 1.0, (1, 0, 0), points={evil: (0, 0, 0)})],
                     [mg.Pair(evil, "R", "frame", evil, point=(0, 0, 0), axis=Z)], [evil], description=evil, source=evil)  # fmt: skip
    s = mg.solve(m, {evil: mg.Motion([0.0, 1.0], 1.0, 0.0)})
    for value in (m, s, s[evil], s.link(evil), mg.check(m), mg.formulate(m)):
        tags: set[str] = set()
        reader = HTMLParser()
        reader.handle_starttag = lambda tag, _, tags=tags: tags.add(tag)  # type: ignore[method-assign]
        reader.feed(value._repr_html_())
        assert not tags & {"script", "img", "a", "iframe", "object", "form", "style"}
        assert "alert" in value._repr_html_()


def test_values_are_those_of_the_arrays(results: dict[str, Any]) -> None:
    s = results["solution"]
    row = re.search(r"^Fx \[N\] +(\S+) +(\S+) deg +(\S+) +(\S+) deg$", str(s["B"]), re.MULTILINE)
    assert row is not None
    fx = s["B"].components["Fx"]
    assert np.allclose([float(row[1]), float(row[3])], [fx.min(), fx.max()], rtol=1e-4)
    assert [float(row[2]), float(row[4])] == [fx.argmin(), fx.argmax()]
    assert "Not unique, without a value (NaN): Fz, Mx, My." in str(s["B"])
    speed = np.linalg.norm(s.link("coupler").center_velocity, axis=1).max()
    assert f"{speed:.5g}" in str(s.link("coupler"))
    assert "20 A.Rz + 40 B.Rz = its value at start" in str(results["coupling"])
    row = re.search(r"^multiplier +(\S+) ", str(results["coupling"]), re.MULTILINE)
    assert row is not None
    assert np.isclose(float(row[1]), 0.075)
    w = np.sqrt(9.81)
    assert re.search(rf"^ *{w:.5g} +{w / 2 / np.pi:.5g} +0  A\.Rz 1$", str(results["linear"]), re.MULTILINE)


def test_nothing_expensive_is_evaluated_unasked(results: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    s = results["solution"]
    monkeypatch.setattr("mechgraph.result.views.UNASKED", 100)
    monkeypatch.setattr(type(s._values), "_evaluated", lambda *_: pytest.fail("the motion was evaluated"))
    assert "(4 links at 360 positions): s['B'].components does it." in " ".join(str(s["B"]).split())
    assert "(4 links at 360 positions): s.link('coupler').pose does it." in " ".join(str(s.link("coupler")).split())


def test_energies_at_one_time_are_compared_with_the_start(results: dict[str, Any]) -> None:
    r = results["response"]
    for at in (0.0, 0.37, 1.0):
        assert abs(r.at(at).energy.balance) < 1e-6 * r.energy.kinetic.max()
    np.testing.assert_allclose(
        r.at([0.2, 0.5]).energy.balance, [r.at(t).energy.balance for t in (0.2, 0.5)], atol=1e-15
    )


def test_a_large_mechanism_is_cut() -> None:
    from lattices import ladder

    m = ladder(200)
    assert len(str(m).splitlines()) < 80
    assert f"... and {len(m.pairs) - 20} more." in str(m)
    f = mg.formulate(m)
    assert len(f._repr_html_()) < len(to_html(f.document()))


def test_what_is_shown_needs_a_document() -> None:
    class Told(Shown):
        def document(self) -> Document:
            return Document("title", (Paragraph("a & b"),))

    assert repr(Told()) == "title\n=====\n\na & b"
    assert Told()._repr_html_() == "<h1>title</h1>\n<p>a &amp; b</p>\n"
    with pytest.raises(TypeError):
        type("Untold", (Shown,), {})()


@pytest.mark.slow
def test_in_a_notebook() -> None:
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    cells = [
        "import mechgraph as mg\nm = mg.load('four-bar')\ns = mg.solve(m, engine='dense')\nm",
        "s", "s['B']", "s.link('coupler')", "mg.check(m)", "mg.formulate(m)", "print(s)", "mg.check(m).advice[:1]",
    ]  # fmt: skip
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    nbformat.validate(notebook)
    s = mg.solve(mg.load("four-bar"), engine="dense")
    expected = [s.mechanism, s, s["B"], s.link("coupler"), mg.check(s.mechanism), mg.formulate(s.mechanism)]
    for cell, value in zip(notebook.cells, expected, strict=False):
        (output,) = cell.outputs
        assert output.data["text/html"] == value._repr_html_()
        assert output.data["text/latex"] == value._repr_latex_()
        assert output.data["text/plain"] == repr(value)
    assert notebook.cells[6].outputs[0].text == f"{s}\n"
    assert notebook.cells[7].outputs[0].data["text/plain"].startswith("(Advice('")


def test_help_of_what_has_fields_tells_them_once() -> None:
    """The signature of names and defaults, a line a field; annotations for programs stay out of it."""
    shown = pydoc.plain(pydoc.render_doc(mg.Curve.line))
    assert (
        "Line(*, frame='minimizing', guide=None, point=(0.0, 0.0, 0.0), direction=(0.0, 0.0, 1.0), ends_at=None)"
        in shown
    )
    told = " ".join(shown.replace("|", "").split())
    assert "point : 3 numbers Where the arc length is zero [L]. Default: 0. direction :" in told
    assert pydoc.plain(pydoc.render_doc(mg.Pair)).count("Parameters\n") == 1
