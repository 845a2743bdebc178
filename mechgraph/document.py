r"""A document as a small frozen tree, and its renderings as text, Markdown, HTML and LaTeX.

The tree knows no mechanism: reports and equation listings are built from headings, paragraphs, bullets,
tables, equations and preformatted text, and every rendering is a pure function of the tree. All renderings
are deterministic, end with one newline and hold no trailing spaces. Blocks without content (a table without
rows, bullets without items, an empty text) render as nothing.

White space in running text (headings, paragraphs, bullets, cells, captions) counts as one space, as in HTML;
only `Code` and the text form of an `Equation` keep theirs.

A document as text of a given width, Markdown (CommonMark with GitHub tables, equations between ``$$``), HTML and LaTeX.

HTML and LaTeX are fragments that need no style sheet and no package beyond amsmath. A LaTeX file compiles by itself: a preamble, long
equations in lines, long tables over pages; it needs what every distribution brings (amsmath, geometry, longtable) and no fonts but
Knuth's, and a sign that these do not have is shown by its number, ``[U+4E2D]``.
"""

from __future__ import annotations

import re
import textwrap
import unicodedata
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import ClassVar, TypeVar

from mechgraph.errors import TellsNames, visible
from mechgraph.memo import Remembers, dataclass
from mechgraph.quantities import with_doors, with_memory

LISTED, NAMED = 20, 8
"""Most rows of a table and names of a sentence; all are in the JSON."""
ALIGNMENTS = {"l": "left", "r": "right", "c": "center"}


@dataclass(frozen=True)
class Heading:
    """A heading; `level` 1 is the first below the title, `DEEPEST_HEADING` the last (else ValueError)."""

    text: str
    level: int = 1


@dataclass(frozen=True)
class Paragraph:
    """Running text, wrapped where the rendering has a width."""

    text: str


@dataclass(frozen=True)
class Bullets:
    """A list of strings; a sequence of strings among them is nested below the string before it.

    ``Bullets(["loops", ["A B C D", "D E F"], "pairs"])`` is a list of two items, the first with two items of
    its own. A nested sequence with no string before it raises ValueError, anything but strings in either
    TypeError.
    """

    items: Sequence[str | Sequence[str]]

    def __post_init__(self) -> None:
        """Copy the items into tuples."""
        items = tuple(item if isinstance(item, str) else tuple(item) for item in self.items)
        object.__setattr__(self, "items", items)

    def grouped(self) -> list[tuple[str, tuple[str, ...]]]:
        """Return every item with the items nested below it."""
        groups: list[tuple[str, tuple[str, ...]]] = []
        for item in self.items:
            if isinstance(item, str):
                groups.append((item, ()))
            else:
                text, nested = groups[-1]
                groups[-1] = (text, nested + tuple(item))
        return groups


@dataclass(frozen=True)
class Table:
    """A table of strings.

    Parameters
    ----------
    header : sequence of str
        Column heads; empty for a table without a head.
    rows : sequence of sequences of str
        Cells. Every row is as long as the head (or as the first row, where there is no head), else
        ValueError.
    align : str
        One letter a column, of "l", "r" and "c" (else ValueError); empty for left throughout.
    caption : str
        Stands above the table.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    align: str = ""
    caption: str = ""

    def __post_init__(self) -> None:
        """Copy into tuples and check that the table is rectangular."""
        header, rows = tuple(self.header), tuple(map(tuple, self.rows))
        count = len(header or (rows[0] if rows else ()))
        if uneven := [row for row in rows if len(row) != count]:
            raise ValueError(f"a row has {len(uneven[0])} cells where {count} are expected: {uneven[0]!r}")
        object.__setattr__(self, "header", header)
        object.__setattr__(self, "rows", rows)
        object.__setattr__(self, "align", self.align or "l" * count)

    @property
    def lines(self) -> list[tuple[str, ...]]:
        """The head, if there is one, and the rows, white space normalized."""
        lines = [self.header, *self.rows] if self.header else list(self.rows)
        return [tuple(plain(cell) for cell in line) for line in lines]


@dataclass(frozen=True)
class Equation:
    r"""A displayed equation: `text` (may have several lines), `latex`, valid inside ``\[ \]``, and `mathml`, the content of a ``math``.

    Text shows `text`, Markdown and LaTeX show `latex`, HTML `mathml`; where one form is empty the text or the LaTeX form serves.
    `mathml` is markup: whoever makes it escapes the names in it.
    """

    text: str
    latex: str = ""
    mathml: str = ""


@dataclass(frozen=True)
class Legend:
    """What symbols mean: entries ``(equation, meaning)``, a bullet each, ``A0_k = P_k x A_k: the moment of ...``."""

    entries: Sequence[tuple[Equation, str]]

    def __post_init__(self) -> None:
        """Copy the entries into a tuple."""
        object.__setattr__(self, "entries", tuple(self.entries))

    def bullets(self) -> Bullets:
        """The entries in words, symbols as plain text."""
        return Bullets([f"{equation.text}: {meaning}" for equation, meaning in self.entries])


@dataclass(frozen=True)
class Code:
    """Preformatted text, kept line by line and never wrapped; blank lines at its ends are dropped."""

    text: str


Block = Heading | Paragraph | Bullets | Table | Equation | Legend | Code
"""What a document is made of."""


@dataclass(frozen=True)
class Document:
    """A title (may be empty) and the blocks below it."""

    title: str
    blocks: Sequence[Block] = ()

    def __post_init__(self) -> None:
        """Copy the blocks into a tuple."""
        object.__setattr__(self, "blocks", tuple(self.blocks))


def plain(text: str) -> str:
    """Return running text with every run of white space as one space and control characters written out."""
    return visible(" ".join(text.split()))


def kept_lines(text: str) -> list[str]:
    """Return the lines of preformatted text without trailing spaces, without blank lines at the ends, control characters written out."""
    lines = [visible(line.rstrip()) for line in text.splitlines()]
    filled = [number for number, line in enumerate(lines) if line]
    return lines[filled[0] : filled[-1] + 1] if filled else []


def joined(parts: list[str], gap: str) -> str:
    """Join the parts that hold something, strip trailing spaces and end with one newline."""
    text = gap.join(part for part in parts if part)
    return "\n".join(line.rstrip() for line in text.split("\n")) + "\n"


WIDTH = 80
"""Default width of a text rendering, in columns."""


def to_text(document: Document, width: int = WIDTH) -> str:
    """Return the document as plain text of at most `width` columns.

    Paragraphs, bullets and equations are wrapped at spaces; a word longer than the line stands whole and
    overhangs. Cells of a table that is too wide are wrapped, first between words, then inside them, but not inside numbers; a table
    overhangs only when these would have no room. Preformatted text is never wrapped. Nothing is
    ever cut. ValueError for `width` < 1.
    """
    parts = [_underlined(document.title, "=", width)]
    parts += [_block_text(block, width) for block in document.blocks]
    return joined(parts, "\n\n")


def _block_text(block: Block, width: int) -> str:
    """Render one block as text; empty where the block is."""
    match block:
        case Heading(text, level):
            return _underlined(text, "-~."[level - 1 : level], width)
        case Paragraph(text):
            return "\n".join(_wrapped(text, width))
        case Bullets():
            lines: list[str] = []
            for text, nested in block.grouped():
                lines += _wrapped(text, width, "- ")
                for inner in nested:
                    lines += _wrapped(inner, width, "  - ")
            return "\n".join(lines)
        case Legend():
            return _block_text(block.bullets(), width)
        case Table():
            return _table_text(block, width)
        case Equation(text=text, latex=latex):
            return "\n".join(_equation_line(line, width) for line in kept_lines(text) or kept_lines(latex))
        case Code(text):
            return "\n".join(kept_lines(text))


def _wrapped(text: str, width: int, mark: str = "") -> list[str]:
    """Wrap running text behind a mark, later lines indented below the first; long words stay whole."""
    return textwrap.wrap(
        plain(text) or " ",
        width,
        initial_indent=mark,
        subsequent_indent=" " * len(mark),
        break_long_words=False,
        break_on_hyphens=False,
    ) or ([mark] if mark else [])


def _underlined(text: str, rule: str, width: int) -> str:
    """Return a heading over a rule of the given character (none if empty)."""
    lines = _wrapped(text, width)
    under = [rule * max(map(len, lines))] if lines and rule else []
    return "\n".join(lines + under)


def _equation_line(line: str, width: int) -> str:
    """Indent one line of an equation by 4; break it at spaces where it is too long, inner spaces kept."""
    indent = " " * (4 + len(line) - len(line.lstrip()))
    return "\n".join(
        textwrap.wrap(
            line.strip(),
            width,
            initial_indent=indent,
            subsequent_indent=indent + "    ",
            break_long_words=False,
            break_on_hyphens=False,
            expand_tabs=False,
        )
    )


def _fitted(natural: list[int], least: list[int], room: int) -> list[int] | None:
    """Return column widths of sum <= room: the widest shrink to one common cap, none below `least`."""
    for cap in range(max(natural), 0, -1):
        widths = [min(n, max(cap, m)) for n, m in zip(natural, least, strict=True)]
        if sum(widths) <= room:
            return widths
    return None


_NUMBER = re.compile(r"[(\[±~<>=]*[-+]?\.?\d")


def column_widths(lines: list[tuple[str, ...]], width: int) -> list[int]:
    """Return column widths that stay within `width`: cells whole, else words whole, else numbers: one in two parts reads as another."""
    columns = list(zip(*lines, strict=True))
    natural = [max(1, *(len(cell) for cell in column)) for column in columns]
    words = [max(1, *(len(word) for cell in column for word in cell.split() or [""])) for column in columns]
    room = width - 2 * (len(columns) - 1)
    numbers = [
        max(1, *(len(word) * bool(_NUMBER.match(word)) for cell in column for word in cell.split() or [""]))
        for column in columns
    ]
    for least in (natural, words, numbers):
        widths = _fitted(natural, least, room)
        if widths is not None:
            return widths
    return words


def _cell_lines(cell: str, width: int) -> list[str]:
    """Wrap one cell; later lines hang by 2, where words leave room, to tell them from a new row."""
    longest = max((len(word) for word in cell.split()), default=0)
    hang = "  " if longest + 2 <= width else ""
    return textwrap.wrap(cell, width, subsequent_indent=hang, break_on_hyphens=False) or [""]


def _table_text(table: Table, width: int) -> str:
    """Render a table with its head over a rule of dashes, columns two spaces apart."""
    if not table.rows or not table.align:
        return ""
    lines = table.lines
    widths = column_widths(lines, width)
    justify: dict[str, Callable[[str, int], str]] = {"l": str.ljust, "r": str.rjust, "c": str.center}
    out = _wrapped(table.caption, width)
    for number, line in enumerate(lines):
        cells = [_cell_lines(cell, size) for cell, size in zip(line, widths, strict=True)]
        for depth in range(max(map(len, cells))):
            pieces = [
                justify[side](cell[depth] if depth < len(cell) else "", size)
                for cell, side, size in zip(cells, table.align, widths, strict=True)
            ]
            out.append("  ".join(pieces).rstrip())
        if number == 0 and table.header:
            out.append("  ".join("-" * size for size in widths))
    return "\n".join(out)


_MARKDOWN_SPECIAL = re.compile(r"[\\`*\[\]<$~#]|(?<![A-Za-z0-9])_|_(?![A-Za-z0-9])|&(?=#?\w+;)")
_MARKDOWN_START = re.compile(r"^()([-+](?= |$|-)|>)|^(\d{1,9})([.)](?= |$))")


def to_markdown(document: Document) -> str:
    """Return the document as Markdown (CommonMark with GitHub tables, equations between ``$$``), escaped.

    An underscore between letters or digits is left unchanged: it has no meaning there, and names stay legible.
    """
    parts = [f"# {_markdown(document.title)}" if plain(document.title) else ""]
    parts += [_block_markdown(block) for block in document.blocks]
    return joined(parts, "\n\n")


def _markdown(text: str) -> str:
    """Escape running text for Markdown."""
    escaped = _MARKDOWN_SPECIAL.sub(r"\\\g<0>", plain(text))
    return _MARKDOWN_START.sub(r"\1\3\\\2\4", escaped)


def _fenced(lines: list[str]) -> str:
    """Return preformatted lines inside a fence longer than any run of backticks in them."""
    longest = max((len(run) for run in re.findall("`+", "\n".join(lines))), default=0)
    fence = "`" * max(3, longest + 1)
    return "\n".join([fence, *lines, fence]) if lines else ""


def _block_markdown(block: Block) -> str:
    """Render one block as Markdown; empty where the block is."""
    match block:
        case Heading(text, level):
            return f"{'#' * (level + 1)} {_markdown(text)}" if plain(text) else ""
        case Paragraph(text):
            return _markdown(text)
        case Bullets():
            lines: list[str] = []
            for text, nested in block.grouped():
                lines += [f"- {_markdown(text)}", *(f"  - {_markdown(inner)}" for inner in nested)]
            return "\n".join(lines)
        case Table():
            return _table_markdown(block)
        case Legend(entries):
            return "\n".join(f"- ${plain(e.latex)}$: {_markdown(meaning)}" for e, meaning in entries)
        case Equation(text=text, latex=latex):
            lines = [line for line in kept_lines(latex) if line]
            return "\n".join(["$$", *lines, "$$"]) if lines else _fenced(kept_lines(text))
        case Code(text):
            return _fenced(kept_lines(text))


def _table_markdown(table: Table) -> str:
    """Render a table as a GitHub table, which always has a head (an empty one where the table has none)."""
    if not table.rows or not table.align:
        return ""
    rule = {"l": ":---", "r": "---:", "c": ":---:"}
    lines = [[_markdown(cell).replace("|", "\\|") for cell in line] for line in table.lines]
    if not table.header:
        lines.insert(0, [""] * len(table.align))
    lines.insert(1, [rule[side] for side in table.align])
    grid = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    caption = _markdown(table.caption)
    return f"{caption}\n\n{grid}" if caption else grid


def to_html(document: Document) -> str:
    """Return the document as an HTML fragment, escaped, legible without a style sheet and without a script.

    Equations appear as MathML where they have that form, else as text; their LaTeX form is in the attribute ``data-latex``.
    """
    parts = [_tagged("h1", document.title)]
    parts += [_block_html(block) for block in document.blocks]
    return joined(parts, "\n")


def _escaped(text: str) -> str:
    import html

    return html.escape(text)


def _tagged(tag: str, text: str, attributes: str = "", *, always: bool = False) -> str:
    """Return running text, escaped, in a tag; nothing for an empty text unless `always`."""
    inner = _escaped(plain(text))
    return f"<{tag}{attributes}>{inner}</{tag}>" if inner or always else ""


def _preformatted(lines: list[str], attributes: str = "") -> str:
    """Return preformatted lines, escaped, in a pre tag."""
    return f"<pre{attributes}>{_escaped(chr(10).join(lines))}</pre>" if lines else ""


def _block_html(block: Block) -> str:
    """Render one block as HTML; empty where the block is."""
    match block:
        case Heading(text, level):
            return _tagged(f"h{level + 1}", text)
        case Paragraph(text):
            return _tagged("p", text)
        case Bullets():
            return _bullets_html(block)
        case Table():
            return _table_html(block)
        case Legend(entries):
            signs = [f"<math>{e.mathml}</math>" if e.mathml else _escaped(plain(e.text)) for e, _ in entries]
            lines = [f"<li>{s}: {_escaped(plain(means))}</li>" for s, (_, means) in zip(signs, entries, strict=True)]
            return "\n".join(["<ul>", *lines, "</ul>"]) if lines else ""
        case Equation(text, latex, mathml):
            source = _escaped(plain(latex))
            attributes = f' data-latex="{source}"' if source else ""
            if mathml:
                return f'<div class="equation"{attributes}><math display="block">{mathml}</math></div>'
            return _preformatted(kept_lines(text) or kept_lines(latex), attributes)
        case Code(text):
            return _preformatted(kept_lines(text))


def _bullets_html(block: Bullets) -> str:
    """Render bullets as nested lists."""
    lines: list[str] = []
    for text, nested in block.grouped():
        inner = "".join(_tagged("li", item, always=True) for item in nested)
        lines.append(f"<li>{_escaped(plain(text))}{f'<ul>{inner}</ul>' if inner else ''}</li>")
    return "\n".join(["<ul>", *lines, "</ul>"]) if lines else ""


def _table_html(table: Table) -> str:
    """Render a table with a caption, head and body, aligned cell by cell."""
    if not table.rows or not table.align:
        return ""
    styles = [f' style="text-align: {ALIGNMENTS[side]}"' for side in table.align]

    def row(tag: str, line: Sequence[str]) -> str:
        cells = (_tagged(tag, cell, style, always=True) for cell, style in zip(line, styles, strict=True))
        return f"<tr>{''.join(cells)}</tr>"

    head = ["<thead>", row("th", table.header), "</thead>"] if table.header else []
    caption = [_tagged("caption", table.caption)] if plain(table.caption) else []
    body = ["<tbody>", *(row("td", line) for line in table.rows), "</tbody>"]
    return "\n".join(['<table border="1">', *caption, *head, *body, "</table>"])


_LATEX_SPECIAL = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "%": r"\%",
    "_": r"\_", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}", "<": r"\textless{}",
    ">": r"\textgreater{}", "|": r"\textbar{}", "`": r"\textasciigrave{}", "[": "{[}", "]": "{]}",
}  # fmt: skip
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


ACCENTS = {0x300, 0x301, 0x302, 0x303, 0x304, 0x306, 0x307, 0x308, 0x30A, 0x30B, 0x30C, 0x327}
"""Combining accents that TeX sets on letters; it knows these letters itself."""
SIGNS = {
    "°": r"^\circ", "²": "^2", "³": "^3", "¹": "^1", "·": r"\cdot", "×": r"\times", "±": r"\pm", "µ": r"\mu", "−": "-", "→": r"\to",
    "≤": r"\le", "≥": r"\ge", "≠": r"\ne", "≈": r"\approx", "∞": r"\infty", "∑": r"\sum", "√": r"\surd", "∂": r"\partial",
}  # fmt: skip
"""Signs as formulas."""
LETTERS = "ßæøåÆØÅœŒłŁ¡¿§¶©–—‘’“”…"
"""What TeX knows itself beside letters with accents."""
GREEK = "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi psi omega"
GREEK_CAPITALS = "Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega"


def to_latex_file(document: Document) -> str:
    """The document as a whole file for pdflatex."""
    body = joined([section(document.title, 0), *map(_block, document.blocks)], "\n\n")
    declared = [_declared(sign) for sign in sorted(set(body)) if ord(sign) > 127 and not _known(sign)]
    head = [
        r"\documentclass[a4paper]{article}",
        r"\usepackage{amsmath}",
        r"\usepackage[margin=2cm]{geometry}",
        r"\usepackage{longtable}",
        r"\allowdisplaybreaks",
        r"\setcounter{secnumdepth}{0}",
        *declared,
        r"\begin{document}",
    ]
    return "\n".join(head) + f"\n{body}\\end{{document}}\n"


def _block(block: Block) -> str:
    if isinstance(block, Equation) and plain(block.latex):
        return _broken(plain(block.latex))
    if isinstance(block, Table) and not plain(block.caption):
        return "\n".join(tabular(block, "longtable"))
    return block_latex(block)


# --- equations in lines ------------------------------------------------------------------------------------------------


def _broken(latex: str) -> str:
    """A displayed equation, in lines where it is long: broken before signs, and within a product where that alone is too long."""
    lines: list[str] = []
    line_signs = 78  # signs of usual width that a line of an equation holds
    for term in _terms(latex):
        for part in [term] if _width(term) <= line_signs else _pieces(term):
            if lines and _width(lines[-1]) + _width(part) < line_signs:
                lines[-1] += f" {part}"
            else:
                lines.append(part)
    if len(lines) == 1:
        return f"\\[\n{latex}\n\\]"
    return "\n".join([r"\begin{multline*}", *(rf"{line} \\" for line in lines[:-1]), lines[-1], r"\end{multline*}"])


def _pieces(latex: str) -> list[str]:
    """The pieces between spaces that stand in no brackets."""
    depth, out = 0, [""]
    for sign in latex:
        depth += (sign in "{([") - (sign in "})]")
        if sign == " " and depth == 0:
            out.append("")
        else:
            out[-1] += sign
    return [piece for piece in out if piece]


def _terms(latex: str) -> list[str]:
    """The terms of a sum with their signs; ``= 0`` is one."""
    pieces = _pieces(latex)
    cuts = [i for i, piece in enumerate(pieces) if piece in ("+", "-", "=") and i]
    return [" ".join(pieces[a:b]) for a, b in pairwise([0, *cuts, len(pieces)])]


def _width(latex: str) -> float:
    """About how many signs of usual width a formula is wide: what is raised or lowered is smaller, operators stand apart."""
    small = re.findall(r"[_^](\{[^{}]*\}|.)", latex)
    no_marks = re.sub(r"\\(hat|bar|dot|ddot|text|tag)\b", "", latex)
    operators = len(re.findall(r" (?:[-+=]|\\times) ", f" {latex} "))
    signs = re.sub(r"[{}_^\\ ]", "", re.sub(r"\\(?!exp)[a-zA-Z]+", "x", no_marks))
    return len(signs) + 1.2 * operators - 0.35 * sum(len(part.strip("{}")) for part in small)


# --- signs beyond ASCII ------------------------------------------------------------------------------------------------


def _known(sign: str) -> bool:
    """Whether TeX has a sign without being told."""
    parts = list(unicodedata.normalize("NFD", sign))
    accented = len(parts) == 2 and parts[0].isascii() and parts[0].isalpha() and ord(parts[1]) in ACCENTS
    return accented or sign in LETTERS


def _declared(sign: str) -> str:
    """What pdflatex is to make of a sign: a formula, a Greek letter, or its number."""
    greek = re.fullmatch(r"GREEK (SMALL|CAPITAL) LETTER (\w+)", unicodedata.name(sign, ""))
    letter = (
        (greek[2].capitalize() if greek[1] == "CAPITAL" else greek[2].lower().replace("lamda", "lambda"))
        if greek
        else ""
    )
    shown = SIGNS.get(sign) or (f"\\{letter}" if letter in f"{GREEK} {GREEK_CAPITALS}".split() else "")
    meaning = rf"\ensuremath{{{shown}}}" if shown else f"[U+{ord(sign):04X}]"
    return rf"\DeclareUnicodeCharacter{{{ord(sign):04X}}}{{{meaning}}}"


class Shown(Remembers, TellsNames, ABC):
    """Something that a document tells: ``print(x)`` shows it as text, a notebook as HTML, what a notebook exports as LaTeX.

    At a prompt it shows the same text; a class whose document is long or takes time has a line of its own there (``__repr__``).
    """

    __slots__ = ()

    _every_method_is_a_door: ClassVar[bool] = True
    """Whether public methods that take arguments check them (``arguments``); a class may name its doors itself."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if cls._every_method_is_a_door:
            with_doors(cls)
            with_memory(cls)

    @abstractmethod
    def document(self) -> Document:
        """What is to be read."""

    def __str__(self) -> str:
        return to_text(self.document())

    def __repr__(self) -> str:
        return str(self).rstrip("\n")

    def _repr_html_(self) -> str:
        return to_html(self.document())

    def _repr_latex_(self) -> str:
        return to_latex(self.document())


Row = TypeVar("Row")


class RowsByName(Mapping[str, Row], Shown):
    """Rows of a table by their names."""

    _every_method_is_a_door = False  # a Mapping has KeyErrors
    _rows: Mapping[str, Row]

    def __getitem__(self, name: str) -> Row:
        return self._rows[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)
