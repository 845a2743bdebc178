"""Names that would be commands in a file or on a terminal are shown as names, whatever they are written into."""

import csv
import io
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

import mechgraph as mg

NAMES = [
    r"\input{secret}", r"$\write18{ls}$", "a%b&c#d_e^f~g", r"\end{verbatim}\input{x}", "=cmd|' /C calc'!A0", "+1+1", "-2-2", "@SUM(A1)",
    "<script>alert(1)</script>", '"><img src=x onerror=y>', "`rm` [a](javascript:b) ![c](d)", "| a | b |", "\x1b[2J\x1b]0;t\x07", "\x9b2J",
    "a\nb\r\tc", "\u202eabc", "a,\"b\";c", "]]>", "---", "# a", "\u03b1",
]  # fmt: skip
HIDDEN = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202e]")


def named(name: str) -> mg.Mechanism:
    """A four-bar all of whose names are that one, or begin with it."""
    z = (0, 0, 1)
    links = [mg.Link(f"{name}{i}", 1.0, (i, 0, 0)) for i in range(4)]
    points = [(0, 0, 0), (1, 0, 0), (3, 2, 0), (3, 0, 0)]
    ends = [(0, 1), (1, 2), (2, 3), (0, 3)]
    pairs = [
        mg.Pair(f"{name}p{i}", "R", f"{name}{a}", f"{name}{b}", point=points[i], axis=z)
        for i, (a, b) in enumerate(ends)
    ]
    return mg.Mechanism(
        name, links, pairs, [pairs[0].name], [mg.Effort(pairs[3].name, 1.0)], description=name, source=name
    )


class Tags(HTMLParser):
    def __init__(self, text: str) -> None:
        super().__init__()
        self.seen: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.add(tag)
        assert {key for key, _ in attrs} <= {
            "style",
            "border",
            "data-latex",
            "class",
            "display",
            "accent",
            "width",
            "stretchy",
        }


@pytest.mark.daily(2)
@pytest.mark.parametrize("name", NAMES)
def test_documents(name: str) -> None:
    m = named(name)
    s = mg.solve(m, {f"{name}p0": 0.1})
    for one in (mg.check(m), mg.formulate(m), s):
        shown = str(one), one._repr_latex_(), one._repr_html_()
        for text in shown:
            assert not HIDDEN.search(text)
            assert text.encode()
        outside = re.sub(r"\\begin\{verbatim\}.*?\\end\{verbatim\}", "", shown[1], flags=re.DOTALL)
        assert not re.search(r"\\(input|write|end\{verbatim\})", outside)
        assert Tags(shown[2]).seen <= {
            "h1", "h2", "h3", "h4", "p", "ul", "li", "table", "caption", "thead", "tbody", "tr", "th", "td", "pre",
            "dl", "dt", "dd", "code",
            "div", "math", "mi", "mo", "mn", "mtext", "mspace", "mrow", "mover", "msub", "msup", "msubsup",
        }  # fmt: skip
    markdown = mg.check(m).to_markdown()
    assert not HIDDEN.search(markdown)
    unfenced = re.sub(r"^(```+|\$\$)\n.*?^\1\n", "", markdown, flags=re.DOTALL | re.MULTILINE)
    assert not re.search(r"(?<!\\)(<script|<img|\]\(|`rm)", unfenced)
    assert json.loads(mg.check(m).to_json())["mechanism"] == name
    assert not HIDDEN.search(mg.check(m).to_json())


@pytest.mark.daily(7)
@pytest.mark.parametrize("name", NAMES)
def test_tables(name: str, tmp_path: Path) -> None:
    m = named(name)
    mg.solve(m, {f"{name}p0": np.array([0.1, 0.2])}).to_csv(tmp_path / "x.csv")
    text = (tmp_path / "x.csv").read_text(encoding="utf-8")
    for table in (text, mg.formulate(m).coefficients().csv()):
        assert not HIDDEN.search(table)
        rows = list(csv.reader(io.StringIO(table, newline="")))
        assert len({len(row) for row in rows}) == 1
        for value in (cell for row in rows for cell in row):
            assert not value.startswith(("=", "+", "-", "@")) or np.isfinite(float(value))


@pytest.mark.daily(7)
@pytest.mark.parametrize("name", NAMES)
def test_errors_and_files(name: str, tmp_path: Path) -> None:
    m = named(name)
    mg.save(m, tmp_path / "m.toml")
    assert mg.load(tmp_path / "m.toml") == m
    with pytest.raises(mg.DeclarationError) as found:
        m.replace(pairs=[*m.pairs, mg.Pair(name, "R", f"{name}0", f"{name}none")], drives=[f"{name}none"])
    assert not HIDDEN.search(str(found.value))


def test_an_error_lists_what_can_be_read() -> None:
    pairs = [mg.Pair(f"P{i}", "R", f"a{i}", f"b{i}") for i in range(3000)]
    with pytest.raises(mg.DeclarationError) as found:
        mg.Mechanism("wrong", [mg.Link(f"link{i}") for i in range(3000)], pairs)
    assert len(str(found.value)) < 100_000
    assert len(found.value.faults) >= 3000
    assert sum(map(len, found.value.faults)) < 3000 * 5000
    assert f"and {len(found.value.faults) - 30} more" in str(found.value)
