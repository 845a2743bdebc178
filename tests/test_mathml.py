"""MathML says what LaTeX says: it is read back and compared, symbol by symbol."""

import re
from xml.etree import ElementTree

import pytest

import mechgraph as mg
from mechgraph.document import Equation, to_html
from mechgraph.equations.terms import Symbol, mathml

ACCENTS = {"¯": "bar", "˙": "dot", "¨": "ddot", "^": "hat"}
SIGNS = {
    "ϵ": r"\epsilon", "⋅": r"\cdot", "×": r"\times", "exp": r"\exp", "−": "-", "′": "'",
    "ρ": r"\rho", "θ": r"\theta", "ω": r"\omega", "α": r"\alpha",
}  # fmt: skip


def latex_of(node: ElementTree.Element) -> str:
    """LaTeX of a MathML element, without blanks."""
    inside = [latex_of(child) for child in node]
    text = "".join((node.text or "").split())
    match node.tag:
        case "mover":
            return rf"\{ACCENTS[node[1].text or '']}{{{inside[0]}}}"
        case "msub":
            return f"{inside[0]}_{{{inside[1]}}}"
        case "msup":
            return _raised(inside[0], inside[1], "")
        case "msubsup":
            return _raised(inside[0], inside[2], f"_{{{inside[1]}}}")
        case "mtext":
            return rf"\text{{{text}}}"
        case "mi" | "mo" | "mn":
            return SIGNS.get(text, text.replace("′", "'"))
        case _:
            return "".join(inside)


def _raised(base: str, above: str, below: str) -> str:
    """Primes in front stand at the base, what else is above in braces."""
    primes = re.match("'*", above)[0]  # type: ignore[index]
    rest = above[len(primes) :]
    return f"{base}{primes}{f'^{{{rest}}}' if rest else ''}{below}"


def same(latex: str) -> str:
    r"""LaTeX without blanks, escapes of names and commands around names."""
    return re.sub(r"\s|\\(?=[_#%&$])", "", latex)


@pytest.mark.parametrize("name", mg.library())
@pytest.mark.parametrize("unknowns", ["kinetostatics", "response"])
def test_every_equation_of_the_library_reads_the_same(name: str, unknowns: str) -> None:
    f = mg.formulate(mg.load(name), unknowns=unknowns)  # type: ignore[arg-type]
    found = [b for b in f.document().blocks if isinstance(b, Equation)]
    assert len(found) > 20
    for equation in found:
        read = latex_of(ElementTree.fromstring(f"<math>{equation.mathml}</math>"))
        number = re.match(r"\\text\{\((\w+)\)\}", read)
        if number:
            read = f"{read[number.end() :]}\\tag{{{number[1]}}}"
        assert read == same(equation.latex)


def test_names_are_text() -> None:
    name = "<script>alert(1)</script>&\x1b"
    made = mathml([Symbol("R", "12", "dual", name=name), "=", "0"])
    root = ElementTree.fromstring(f"<math>{made}</math>")
    assert {node.tag for node in root.iter()} == {"math", "msub", "mover", "mi", "mo", "mn", "mrow", "mtext"}
    assert [node.text for node in root.iter("mtext")] == ["<script>alert(1)</script>&\\x1b"]


def test_a_page_shows_mathml_and_keeps_latex() -> None:
    html = to_html(mg.formulate(mg.load("four-bar")).document())
    assert html.count('<div class="equation" data-latex=') == html.count('<math display="block">') > 20
    assert "<li><math>" in html
