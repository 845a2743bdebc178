"""HTML fragments without style sheet and script."""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import assert_never

from mechgraph.document.tree import (
    ALIGNMENTS,
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


def to_html(document: Document) -> str:
    """Return the document as an HTML fragment, escaped, legible without a style sheet and without a script.

    Equations appear as MathML where they have that form, else as text; their LaTeX form is in the attribute ``data-latex``.
    """
    parts = [_tagged("h1", document.title)]
    parts += [_block_html(block) for block in document.blocks]
    return joined(parts, "\n")


def _tagged(tag: str, text: str, attributes: str = "", *, always: bool = False) -> str:
    """Return running text, escaped, in a tag; nothing for an empty text unless `always`."""
    inner = html.escape(plain(text))
    return f"<{tag}{attributes}>{inner}</{tag}>" if inner or always else ""


def _preformatted(lines: list[str], attributes: str = "") -> str:
    """Return preformatted lines, escaped, in a pre tag."""
    return f"<pre{attributes}>{html.escape(chr(10).join(lines))}</pre>" if lines else ""


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
            lines = [f"<li>{_inline(e)}: {html.escape(plain(meaning))}</li>" for e, meaning in entries]
            return "\n".join(["<ul>", *lines, "</ul>"]) if lines else ""
        case Equation(text, latex, mathml):
            source = html.escape(plain(latex))
            attributes = f' data-latex="{source}"' if source else ""
            if mathml:
                return f'<div class="equation"{attributes}><math display="block">{mathml}</math></div>'
            return _preformatted(kept_lines(text) or kept_lines(latex), attributes)
        case Code(text):
            return _preformatted(kept_lines(text))
        case _:
            assert_never(block)


def _inline(equation: Equation) -> str:
    """An equation in running text."""
    return f"<math>{equation.mathml}</math>" if equation.mathml else html.escape(plain(equation.text))


def _bullets_html(block: Bullets) -> str:
    """Render bullets as nested lists."""
    lines: list[str] = []
    for text, nested in block.grouped():
        inner = "".join(_tagged("li", item, always=True) for item in nested)
        lines.append(f"<li>{html.escape(plain(text))}{f'<ul>{inner}</ul>' if inner else ''}</li>")
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
