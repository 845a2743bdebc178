r"""LaTeX fragments that need no package beyond amsmath."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import assert_never

from mechgraph.document.text import WIDTH, column_widths
from mechgraph.document.tree import (
    Block,
    Bullets,
    Code,
    Document,
    Equation,
    Heading,
    Legend,
    Paragraph,
    Table,
    joined,
    kept_lines,
    plain,
)

_LATEX_SPECIAL = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "$": r"\$",
    "&": r"\&",
    "#": r"\#",
    "%": r"\%",
    "_": r"\_",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    "`": r"\textasciigrave{}",
    "[": "{[}",
    "]": "{]}",
}
_LATEX_TABLE = str.maketrans(_LATEX_SPECIAL)
_LATEX_SECTIONS = ("section", "subsection", "subsubsection", "paragraph", "subparagraph", "subparagraph")


def to_latex(document: Document) -> str:
    r"""Return the document as a LaTeX fragment: sections, itemize, tabular, displayed equations, escaped.

    The title is a ``\section``, headings go down from there. Columns that are wrapped in the text rendering
    at 80 columns become paragraph columns of the same share of the line. No package beyond amsmath (for what
    equations use) is needed.
    """
    parts = [section(document.title, 0)]
    parts += [block_latex(block) for block in document.blocks]
    return joined(parts, "\n\n")


def latex_words(text: str) -> str:
    """Running text escaped for LaTeX; double hyphens stay two hyphens."""
    return re.sub("-(?=-)", "-{}", plain(text).translate(_LATEX_TABLE))


def section(text: str, level: int) -> str:
    """Return the sectioning command of a level; nothing for an empty text."""
    return rf"\{_LATEX_SECTIONS[level]}{{{latex_words(text)}}}" if plain(text) else ""


def _verbatim(lines: list[str]) -> str:
    r"""Return lines verbatim; lines that themselves end a verbatim are set one by one in ``\texttt``."""
    if any(r"\end{verbatim}" in line for line in lines):
        typed = [re.sub("-(?=-)", "-{}", line.translate(_LATEX_TABLE)).replace(" ", "~") for line in lines]
        return "\\\\\n".join(rf"\noindent\mbox{{\texttt{{{line}}}}}" for line in typed)
    return "\n".join([r"\begin{verbatim}", *lines, r"\end{verbatim}"]) if lines else ""


def block_latex(block: Block) -> str:
    """Render one block as LaTeX; empty where the block is."""
    match block:
        case Heading(text, level):
            return section(text, level)
        case Paragraph(text):
            return latex_words(text)
        case Bullets():
            return _bullets_latex(block)
        case Table():
            return _table_latex(block)
        case Legend(entries):
            items = [rf"\item ${plain(e.latex)}$: {latex_words(meaning)}" for e, meaning in entries]
            return "\n".join(_itemize(items))
        case Equation(text=text, latex=latex):
            lines = [line for line in kept_lines(latex) if line]
            return "\n".join([r"\[", *lines, r"\]"]) if lines else _verbatim(kept_lines(text))
        case Code(text):
            return _verbatim(kept_lines(text))
        case _:
            assert_never(block)


def _itemize(lines: list[str]) -> list[str]:
    """Return lines inside an itemize, or none where there are none."""
    return [r"\begin{itemize}", *lines, r"\end{itemize}"] if lines else []


def _bullets_latex(block: Bullets) -> str:
    """Render bullets as nested itemize."""
    lines: list[str] = []
    for text, nested in block.grouped():
        lines += [rf"\item {latex_words(text)}", *_itemize([rf"\item {latex_words(inner)}" for inner in nested])]
    return "\n".join(_itemize(lines))


def _table_latex(table: Table) -> str:
    """Render a table as a tabular, in a float where it has a caption."""
    grid = tabular(table, "tabular")
    if not grid:
        return ""
    if plain(table.caption):
        heads = [r"\begin{table}[htbp]", r"\centering", rf"\caption{{{latex_words(table.caption)}}}"]
        return "\n".join([*heads, *grid, r"\end{table}"])
    return "\n".join([r"\begin{center}", *grid, r"\end{center}"])


def tabular(table: Table, environment: str) -> list[str]:
    """The lines of a table in an environment that takes columns as ``tabular`` does; none where it has no rows."""
    if not table.rows or not table.align:
        return []
    lines = table.lines
    natural = [max(map(len, column)) for column in zip(*lines, strict=True)]
    fitted = column_widths(lines, WIDTH)
    columns = "".join(
        side if size >= full else rf"p{{{size / WIDTH:.2f}\linewidth}}"
        for side, size, full in zip(table.align, fitted, natural, strict=True)
    )

    def row(line: Sequence[str]) -> str:
        cells = " & ".join(latex_words(cell) for cell in line)
        return rf"{'{}' if cells.startswith('*') else ''}{cells} \\"

    rows = [row(line) for line in lines]
    if table.header:
        rows.insert(1, r"\hline")
    return [rf"\begin{{{environment}}}{{{columns}}}", *rows, rf"\end{{{environment}}}"]
