"""The renderings of a document: wording, width, escaping, and nothing lost."""

from __future__ import annotations

import html
import inspect
import pydoc
import re
import shutil
import subprocess
from collections.abc import Iterator, Mapping
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import scipy
from test_hostile_names import NAMES, named

import mechgraph as mg
from mechgraph.document import (
    Bullets,
    Code,
    Document,
    Equation,
    Heading,
    Legend,
    Paragraph,
    Shown,
    Table,
    to_html,
    to_latex,
    to_latex_file,
    to_markdown,
    to_text,
)
from mechgraph.equations.terms import Symbol, mathml

RENDERERS = [to_text, to_markdown, to_html, to_latex]

EVERYTHING = Document(
    "RCSR",
    [
        Heading("Count"),
        Paragraph("One loop,  four\npairs."),
        Bullets(["loops", ["O A B C", "none"], "pairs"]),
        Heading("By kind", 2),
        Table(["pair", "type", "f"], [["A", "R", "1"], ["B", "C", "12"]], align="llr", caption="Freedoms"),
        Equation("F + M = 0", r"F + M = 0"),
        Code("a  b\n  c"),
    ],
)


def body(*blocks):
    return Document("", blocks)


# ---- all renderings


@pytest.mark.parametrize("render", RENDERERS)
def test_one_newline_at_the_end_and_no_trailing_spaces(render):
    text = render(EVERYTHING)
    assert text.endswith("\n")
    assert not text.endswith("\n\n")
    assert all(line == line.rstrip() for line in text.split("\n"))
    assert text == render(EVERYTHING)


@pytest.mark.parametrize("render", RENDERERS)
@pytest.mark.parametrize(
    "empty",
    [
        Table(["a", "b"], []),
        Table([], []),
        Bullets([]),
        Paragraph(" \n"),
        Heading(""),
        Code("\n\n"),
        Equation(""),
    ],
)
def test_blocks_without_content_render_as_nothing(render, empty):
    assert render(body(empty)) == "\n"
    assert render(body(Paragraph("a"), empty, Paragraph("b"))) == render(body(Paragraph("a"), Paragraph("b")))


def test_blocks_are_frozen_values():
    rows = [["1"]]
    table = Table(["a"], rows)
    rows[0][0] = "2"
    assert table == Table(("a",), (("1",),), "l")
    assert hash(EVERYTHING) == hash(Document(EVERYTHING.title, list(EVERYTHING.blocks)))
    with pytest.raises(AttributeError):
        table.caption = "x"


@pytest.mark.parametrize("header", [["a", "b"], []])
def test_a_table_is_rectangular(header):
    with pytest.raises(ValueError, match="a row has 1 cells where 2"):
        Table(header, [["1", "2"], ["1"]])


# ---- text


def test_text_of_everything():
    assert to_text(EVERYTHING) == (
        "RCSR\n====\n\n"
        "Count\n-----\n\n"
        "One loop, four pairs.\n\n"
        "- loops\n  - O A B C\n  - none\n- pairs\n\n"
        "By kind\n~~~~~~~\n\n"
        "Freedoms\npair  type   f\n----  ----  --\nA     R      1\nB     C     12\n\n"
        "    F + M = 0\n\n"
        "a  b\n  c\n"
    )


def test_text_wraps_paragraphs_and_bullets():
    words = "the reaction of pair A is not unique along its axis and tied to that of pair D " * 4
    for width in (20, 40, 80):
        text = to_text(body(Paragraph(words), Bullets([words, [words]])), width)
        assert max(map(len, text.splitlines())) <= width
        assert re.sub(r"[\s-]+", " ", text).split() == words.split() * 3
    lines = to_text(body(Bullets(["item", [words]])), 40).splitlines()
    assert lines[1].startswith("  - the")
    assert lines[2].startswith("    ")
    assert not lines[2].startswith("     ")


def test_long_words_are_kept_whole_in_text():
    word = "x" * 100
    assert to_text(body(Paragraph(f"a {word} b"))) == f"a\n{word}\nb\n"
    assert word in to_text(body(Bullets([word])))
    assert "rcsr-csr" in to_text(body(Paragraph("a rcsr-csr")), 8)


def test_headings_by_level():
    assert to_text(body(Heading("One", 1))) == "One\n---\n"
    assert to_text(body(Heading("Three", 3))) == "Three\n.....\n"
    assert to_text(body(Heading("Four", 4))) == "Four\n"


def test_table_alignment_and_missing_header():
    table = Table(["left", "right", "mid"], [["a", "b", "c"]], align="lrc")
    assert to_text(body(table)) == "left  right  mid\n----  -----  ---\na         b   c\n"
    assert to_text(body(Table([], [["a", "bb"], ["ccc", "d"]]))) == "a    bb\nccc  d\n"


def test_wide_tables_wrap_cells_and_lose_nothing():
    long = "turns about the line through the centers of the two spheres, moves no other link " * 2
    table = Table(["freedom", "what it does", "unique"], [["B.Rx", long, "yes"], ["C.Rx", "spins", "no"]])
    for width in (40, 80):
        lines = to_text(body(table), width).splitlines()
        assert max(map(len, lines)) <= width
        assert sorted(" ".join(lines[2:]).split()) == sorted(f"B.Rx {long} yes C.Rx spins no".split())
    assert lines[0].startswith("freedom  what it does")
    assert lines[3].startswith(" " * 11)  # a continuation hangs by two


def test_words_in_cells_are_broken_only_when_they_must_be():
    words = [f"{letter * 30}" for letter in "abc"]
    text = to_text(body(Table(["1", "2", "3"], [words])))
    assert max(map(len, text.splitlines())) <= 80
    for letter in "abc":
        assert text.count(letter) == 30
    assert to_text(body(Table(["1", "2"], [words[:2]]))).splitlines()[2] == f"{words[0]}  {words[1]}"


def test_tables_with_more_columns_than_room_overhang():
    cells = ["abc"] * 40
    text = to_text(body(Table([], [cells])))
    assert text.split() == cells


def test_equations_keep_their_lines_and_break_at_spaces():
    assert to_text(body(Equation("a = b\n  + c"))) == "    a = b\n      + c\n"
    terms = " + ".join(f"{k}.5  F{k}x" for k in range(20))
    text = to_text(body(Equation(terms)))
    assert max(map(len, text.splitlines())) <= 80
    assert text.split() == terms.split()
    assert to_text(body(Equation("", "x^2"))) == "    x^2\n"


def test_code_is_never_wrapped():
    line = "w  " * 50
    assert to_text(body(Code(f"\n{line}\n\n  b\n"))) == f"{line.rstrip()}\n\n  b\n"


# ---- Markdown


def test_markdown_of_everything():
    assert to_markdown(EVERYTHING) == (
        "# RCSR\n\n"
        "## Count\n\n"
        "One loop, four pairs.\n\n"
        "- loops\n  - O A B C\n  - none\n- pairs\n\n"
        "### By kind\n\n"
        "Freedoms\n\n| pair | type | f |\n| :--- | :--- | ---: |\n| A | R | 1 |\n| B | C | 12 |\n\n"
        "$$\nF + M = 0\n$$\n\n"
        "```\na  b\n  c\n```\n"
    )


@pytest.mark.parametrize(
    ("plain", "escaped"),
    [
        ("2 * a * b", r"2 \* a \* b"),
        ("link_1 and _x_", r"link_1 and \_x\_"),
        ("R at D -> S, a < b", r"R at D -> S, a \< b"),
        ("[a](b) `c` $d$", r"\[a\](b) \`c\` \$d\$"),
        ("back\\slash", r"back\\slash"),
        ("&lt; & co", r"\&lt; & co"),
        ("- no list", r"\- no list"),
        ("+ no list", r"\+ no list"),
        ("--- no rule", r"\--- no rule"),
        ("-3.5 is a number", "-3.5 is a number"),
        ("1. no list", r"1\. no list"),
        ("12) no list", r"12\) no list"),
        ("1.5 is a number", "1.5 is a number"),
        ("3-4 pairs", "3-4 pairs"),
        ("3- 4 pairs", "3- 4 pairs"),
        ("> no quote", r"\> no quote"),
        ("# no head", r"\# no head"),
        ("a | b", "a | b"),
    ],
)
def test_markdown_escapes(plain, escaped):
    assert to_markdown(body(Paragraph(plain))) == escaped + "\n"


def test_markdown_tables_escape_bars_and_have_a_head():
    text = to_markdown(body(Table([], [["|F|", "b"]], align="rc")))
    assert text == "|  |  |\n| ---: | :---: |\n| \\|F\\| | b |\n"


def test_markdown_fences_are_longer_than_the_fences_inside():
    assert to_markdown(body(Code("```\na\n```"))) == "````\n```\na\n```\n````\n"
    assert to_markdown(body(Equation("a = b"))) == "```\na = b\n```\n"


# ---- HTML


class Reader(HTMLParser):
    """Collects tags and text; complains where tags do not nest."""

    def __init__(self, text):
        super().__init__()
        self.open, self.seen, self.words = [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)
        self.seen.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


def test_html_nests_and_holds_everything():
    reader = Reader(to_html(EVERYTHING))
    assert reader.seen[:6] == ["h1", "h2", "p", "ul", "li", "ul"]
    assert {"h3", "table", "caption", "thead", "tbody", "th", "td", "pre"} <= set(reader.seen)
    words = "".join(reader.words)
    assert all(word in words for word in ("RCSR", "O A B C", "Freedoms", "12", "F + M = 0", "a  b\n  c"))
    assert '<td style="text-align: right">12</td>' in to_html(EVERYTHING)


def test_html_escapes_everywhere():
    bad = '<b onclick="x">&amp;\'</b>'
    document = Document(
        bad,
        [
            Heading(bad),
            Paragraph(bad),
            Bullets([bad, [bad]]),
            Table([bad], [[bad]], caption=bad),
            Equation(bad, bad),
            Code(bad),
        ],
    )
    text = to_html(document)
    assert "<b" not in text
    assert text.count(html.escape(bad)) == 11
    assert "".join(Reader(text).words).count(bad) == 10  # the eleventh is the attribute


def test_html_nested_bullets_and_empty_cells():
    assert to_html(body(Bullets(["a", ["b"], "c"]))) == ("<ul>\n<li>a<ul><li>b</li></ul></li>\n<li>c</li>\n</ul>\n")
    assert '<td style="text-align: left"></td>' in to_html(body(Table([], [["", "b"]])))


# ---- LaTeX


def test_latex_of_everything():
    assert to_latex(EVERYTHING) == (
        "\\section{RCSR}\n\n"
        "\\subsection{Count}\n\n"
        "One loop, four pairs.\n\n"
        "\\begin{itemize}\n\\item loops\n\\begin{itemize}\n\\item O A B C\n\\item none\n\\end{itemize}\n"
        "\\item pairs\n\\end{itemize}\n\n"
        "\\subsubsection{By kind}\n\n"
        "\\begin{table}[htbp]\n\\centering\n\\caption{Freedoms}\n\\begin{tabular}{llr}\n"
        "pair & type & f \\\\\n\\hline\nA & R & 1 \\\\\nB & C & 12 \\\\\n\\end{tabular}\n\\end{table}\n\n"
        "\\[\nF + M = 0\n\\]\n\n"
        "\\begin{verbatim}\na  b\n  c\n\\end{verbatim}\n"
    )


def test_latex_escapes_every_special_character():
    text = to_latex(body(Paragraph(r"\ { } $ & # % _ ^ ~ < > | ` --drive")))
    assert text == (
        r"\textbackslash{} \{ \} \$ \& \# \% \_ \textasciicircum{} \textasciitilde{} \textless{} "
        r"\textgreater{} \textbar{} \textasciigrave{} -{}-drive" + "\n"
    )


def test_latex_rows_and_items_that_start_like_options():
    table = to_latex(body(Table([], [["[0]", "a & b"], ["*", "c"]])))
    assert "{[}0{]} & a \\& b \\\\" in table
    assert "\n{}* & c \\\\" in table
    assert "\\item {[}a{]}" in to_latex(body(Bullets(["[a]"])))


def test_latex_wide_columns_become_paragraphs():
    text = to_latex(body(Table(["a", "b"], [["short", "word " * 40]])))
    assert r"\begin{tabular}{lp{0.91\linewidth}}" in text


def test_latex_equations_have_no_blank_lines_and_verbatim_cannot_be_left():
    assert to_latex(body(Equation("", "a\n\n b"))) == "\\[\na\n b\n\\]\n"
    assert to_latex(body(Equation("a = b"))) == "\\begin{verbatim}\na = b\n\\end{verbatim}\n"
    assert r"\end{verbatim}" not in to_latex(body(Code("x\n\\end{verbatim}")))


def test_a_legend_has_its_symbols_as_text_or_as_mathematics() -> None:
    legend = Legend([(Equation("rho_k", r"\rho_{k}"), "pitch of a_b"), (Equation("P_k", "P_{k}"), "point")])
    assert to_text(body(legend)) == "- rho_k: pitch of a_b\n- P_k: point\n"
    assert to_markdown(body(legend)) == "- $\\rho_{k}$: pitch of a_b\n- $P_{k}$: point\n"
    assert "<li>rho_k: pitch of a_b</li>" in to_html(body(legend))
    assert to_latex(body(legend)).splitlines()[1:3] == [r"\item $\rho_{k}$: pitch of a\_b", r"\item $P_{k}$: point"]
    assert [render(body(Legend([]))) for render in RENDERERS] == ["\n"] * 4


# --- MathML -------------------------------------------------------------------------------------------------------------


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


@pytest.mark.daily(24)
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


# --- LaTeX files --------------------------------------------------------------------------------------------------------


BEYOND_ASCII = "ü é ñ Å ç ß ø ł ° ² ³ · × − → ≤ π Ω λ Σ – “x” … 中 ☃ \u0416"


def compiled(text: str, folder: Path) -> str:
    """What pdflatex says about a file that it takes."""
    if shutil.which("pdflatex") is None:
        pytest.skip("no pdflatex here (Debian: texlive-latex-base)")
    (folder / "x.tex").write_text(text, encoding="utf-8")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "-no-shell-escape", "x.tex"]
    ran = subprocess.run(command, cwd=folder, capture_output=True, check=False)
    log = ran.stdout.decode("utf-8", "replace")
    assert ran.returncode == 0, log[-3000:]
    assert (folder / "x.pdf").stat().st_size > 10_000
    return log


def too_wide(log: str) -> list[float]:
    """By how many points lines stand out of the page."""
    return [float(points) for points in re.findall(r"Overfull \\hbox \(([\d.]+)pt too wide", log)]


@pytest.mark.daily(3)
@pytest.mark.parametrize("name", mg.library())
def test_the_equations_of_the_library_fit_the_page(name: str, tmp_path: Path) -> None:
    f = mg.formulate(mg.load(name), unknowns="response" if name == "rcsr" else "kinetostatics")
    f.write(tmp_path / "f.tex")
    assert not too_wide(compiled((tmp_path / "f.tex").read_text(encoding="utf-8"), tmp_path))


def test_names_that_would_be_commands(tmp_path: Path) -> None:
    blocks = [block for name in NAMES for block in mg.formulate(named(name)).document().blocks]
    log = compiled(to_latex_file(Document("names", blocks)), tmp_path)
    assert "secret" not in re.sub(r"\s", "", "".join(re.findall(r"\(\S+", log)))


def test_signs_beyond_ascii(tmp_path: Path) -> None:
    text = to_latex_file(
        Document(BEYOND_ASCII, (Paragraph(BEYOND_ASCII), Table(("α",), ((BEYOND_ASCII,),)), Heading(BEYOND_ASCII)))
    )
    assert r"\DeclareUnicodeCharacter{03C0}{\ensuremath{\pi}}" in text
    assert r"\DeclareUnicodeCharacter{4E2D}{[U+4E2D]}" in text
    assert "00FC" not in text  # TeX knows the letters of Latin with their accents
    log = compiled(text, tmp_path)
    assert "Missing character" not in log


def test_long_equations_are_broken_before_signs_and_in_long_products(tmp_path: Path) -> None:
    total = " + ".join(rf"\hat{{F}}_{{{i}}} (a_{{{i}}} + b)" for i in range(30)) + r" = 0 \tag{7}"
    product = " ".join(rf"\exp(\theta_{{{i}}} \hat{{A}})" for i in range(30)) + " = 1"
    short = r"a_{1} + b = 0 \tag{8}"
    text = to_latex_file(Document("", tuple(Equation("x", latex) for latex in (total, product, short))))
    first, second = re.findall(r"\\begin\{multline\*\}\n(.*?)\n\\end\{multline\*\}", text, re.DOTALL)
    lines = first.split(" \\\\\n")
    assert len(lines) > 3
    assert all(line.startswith("+ ") for line in lines[1:])
    assert " ".join(lines) == total
    assert " ".join(second.split(" \\\\\n")) == product
    assert f"\\[\n{short}\n\\]" in text
    assert not too_wide(compiled(text, tmp_path))


def test_other_files_of_a_formulation(tmp_path: Path) -> None:
    f = mg.formulate(mg.load("rcsr"))
    for suffix, text in ((".txt", f.text()), (".csv", f.coefficients().csv())):
        f.write(tmp_path / f"f{suffix}")
        assert (tmp_path / f"f{suffix}").read_text(encoding="utf-8") == text
    f.write(tmp_path / "f.md", components=False)
    assert (tmp_path / "f.md").read_text(encoding="utf-8").startswith("# Equations of rcsr")
    with pytest.raises(mg.FileError, match=r"known: .tex \(LaTeX\)"):
        f.write(tmp_path / "f.pdf")


# --- Whatever comes back can be read: at a prompt, printed, and in a notebook, through one mechanism ---


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
    "BeltCourse",
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
