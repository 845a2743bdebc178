"""The tree of a document: headings, paragraphs, bullets, tables, equations and preformatted text, frozen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mechgraph.errors import visible

DEEPEST_HEADING = 5
"""Deepest heading level; the title is level 0."""

ALIGNMENTS = {"l": "left", "r": "right", "c": "center"}


def _strings(values: Sequence[str], what: str) -> tuple[str, ...]:
    """Return `values` as a tuple of strings; a bare string or any other entry is a TypeError."""
    if isinstance(values, str):
        raise TypeError(f"{what} must be a sequence of strings, not the single string {values!r}")
    wrong = [value for value in values if not isinstance(value, str)]
    if wrong:
        raise TypeError(f"{what} must be strings, got {wrong[0]!r}; format numbers before they enter a document")
    return tuple(values)


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading; `level` 1 is the first below the title, `DEEPEST_HEADING` the last (else ValueError)."""

    text: str
    level: int = 1

    def __post_init__(self) -> None:
        """Check the level."""
        if not 1 <= self.level <= DEEPEST_HEADING:
            raise ValueError(f"heading {self.text!r}: level must be 1 to {DEEPEST_HEADING}, got {self.level}")


@dataclass(frozen=True, slots=True)
class Paragraph:
    """Running text, wrapped where the rendering has a width."""

    text: str


@dataclass(frozen=True, slots=True)
class Bullets:
    """A list of strings; a sequence of strings among them is nested below the string before it.

    ``Bullets(["loops", ["A B C D", "D E F"], "pairs"])`` is a list of two items, the first with two items of
    its own. A nested sequence with no string before it raises ValueError, anything but strings in either
    TypeError.
    """

    items: Sequence[str | Sequence[str]]

    def __post_init__(self) -> None:
        """Copy the items into tuples."""
        if isinstance(self.items, str):
            raise TypeError(f"items must be a sequence, not the single string {self.items!r}")
        items = tuple(item if isinstance(item, str) else _strings(item, "nested items") for item in self.items)
        if items and not isinstance(items[0], str):
            raise ValueError(f"nested items {items[0]!r} stand below no item; put a string before them")
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


@dataclass(frozen=True, slots=True)
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
        header = _strings(self.header, "header")
        if isinstance(self.rows, str):
            raise TypeError(f"rows must be a sequence of rows, not the single string {self.rows!r}")
        rows = tuple(_strings(row, "cells") for row in self.rows)
        count = len(header or (rows[0] if rows else ()))
        for number, row in enumerate(rows):
            if len(row) != count:
                raise ValueError(f"row {number} has {len(row)} cells where {count} are expected: {row!r}")
        align = self.align or "l" * count
        if (rows or header) and (len(align) != count or set(align) - set(ALIGNMENTS)):
            raise ValueError(f"align must be {count} letters of 'l', 'r', 'c', got {self.align!r}")
        object.__setattr__(self, "header", header)
        object.__setattr__(self, "rows", rows)
        object.__setattr__(self, "align", align)

    @property
    def lines(self) -> list[tuple[str, ...]]:
        """The head, if there is one, and the rows, white space normalized."""
        lines = [self.header, *self.rows] if self.header else list(self.rows)
        return [tuple(plain(cell) for cell in line) for line in lines]


@dataclass(frozen=True, slots=True)
class Equation:
    r"""A displayed equation: `text` (may have several lines), `latex`, valid inside ``\[ \]``, and `mathml`, the content of a ``math``.

    Text shows `text`, Markdown and LaTeX show `latex`, HTML `mathml`; where one form is empty the text or the LaTeX form serves.
    `mathml` is markup: whoever makes it escapes the names in it.
    """

    text: str
    latex: str = ""
    mathml: str = ""


@dataclass(frozen=True, slots=True)
class Legend:
    """What symbols mean: entries ``(equation, meaning)``, a bullet each, ``A0_k = P_k x A_k: the moment of ...``."""

    entries: Sequence[tuple[Equation, str]]

    def __post_init__(self) -> None:
        """Copy the entries into a tuple."""
        object.__setattr__(self, "entries", tuple(self.entries))

    def bullets(self) -> Bullets:
        """The entries in words, symbols as plain text."""
        return Bullets([f"{equation.text}: {meaning}" for equation, meaning in self.entries])


@dataclass(frozen=True, slots=True)
class Code:
    """Preformatted text, kept line by line and never wrapped; blank lines at its ends are dropped."""

    text: str


Block = Heading | Paragraph | Bullets | Table | Equation | Legend | Code
"""What a document is made of."""


@dataclass(frozen=True, slots=True)
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
