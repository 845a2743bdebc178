"""Markdown (CommonMark with GitHub tables, equations between ``$$``)."""

from __future__ import annotations

import re
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
        case _:
            assert_never(block)


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
