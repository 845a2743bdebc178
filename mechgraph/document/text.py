"""Plain text of a given width."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from typing import assert_never

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

WIDTH = 80
"""Default width of a text rendering, in columns."""

GAP = 2
"""Blank columns between two columns of a text table."""


def to_text(document: Document, width: int = WIDTH) -> str:
    """Return the document as plain text of at most `width` columns.

    Paragraphs, bullets and equations are wrapped at spaces; a word longer than the line stands whole and
    overhangs. Cells of a table that is too wide are wrapped, first between words, then inside them; a table
    overhangs only when its columns would have no room at all. Preformatted text is never wrapped. Nothing is
    ever cut. ValueError for `width` < 1.
    """
    if width < 1:
        raise ValueError(f"width must be at least 1 column, got {width}")
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
        case _:
            assert_never(block)


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


def column_widths(lines: list[tuple[str, ...]], width: int) -> list[int]:
    """Return column widths that stay within `width`: cells whole, else words whole, else neither."""
    columns = list(zip(*lines, strict=True))
    natural = [max(1, *(len(cell) for cell in column)) for column in columns]
    words = [max(1, *(len(word) for cell in column for word in cell.split() or [""])) for column in columns]
    room = width - GAP * (len(columns) - 1)
    for least in (natural, words, [1] * len(columns)):
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
            out.append((" " * GAP).join(pieces).rstrip())
        if number == 0 and table.header:
            out.append((" " * GAP).join("-" * size for size in widths))
    return "\n".join(out)
