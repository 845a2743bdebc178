"""A mechanism for people: links, pairs, drivers, couplings and loads as tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from mechgraph.document import Block, Bullets, Document, Heading, Paragraph, Table
from mechgraph.errors import counted
from mechgraph.model.motion import Motion
from mechgraph.model.pair import Pair
from mechgraph.model.parts import Parts
from mechgraph.units import LENGTH, MASS, unit_of

LISTED = 20
"""Most rows of one table."""


def mechanism_document(m: Parts) -> Document:
    """The mechanism as a document; what is long is cut, with the number of what is left out."""
    blocks: list[Block] = [Paragraph(m.description), Paragraph(f"Source: {m.source}" if m.source else "")]
    blocks.append(Paragraph(_counts(m)))
    for title, parts in PARTS.items():
        blocks += [Heading(title, 2), *found] if (found := list(parts(m))) else []
    return Document(f"Mechanism {m.name}", tuple(blocks))


def _counts(m: Parts) -> str:
    units = ", ".join(f"{base} in {unit}" for base, unit in m.units.items())
    counts = ((m.links, "link"), (m.pairs, "pair"), (m.couplings, "coupling"), (m.drives, "driver"), (m.loads, "load"))
    return ", ".join(counted(len(of), what) for of, what in counts if of) + (f"; {units}" if units else "") + "."


def _rows(head: Sequence[str], rows: Iterator[tuple[str, ...]], count: int, align: str) -> Iterator[Block]:
    """A table of the first rows, without the columns in which nothing stands."""
    listed = [row for row, _ in zip(rows, range(LISTED), strict=False)]
    if not listed:
        return
    filled = [i for i in range(len(head)) if any(row[i] for row in listed)]
    cells = [tuple(row[i] for i in filled) for row in listed]
    yield Table([head[i] for i in filled], cells, "".join(align[i] for i in filled))
    if count > LISTED:
        yield Paragraph(f"... and {count - LISTED:,} more.")


def _links(m: Parts) -> Iterator[Block]:
    mass, length = (f" [{u}]" if (u := unit_of(m.units, dimension)) else "" for dimension in (MASS, LENGTH))
    rows = (
        (
            link.name,
            "frame" if link.name == m.frame else "",
            _number(link.mass) if link.mass else "",
            _vector(link.center),
            "yes" if link.inertia is not None else "",
            ", ".join(link.points),
        )
        for link in m.links
    )
    head = ("link", "", f"mass{mass}", f"mass centre{length}", "inertia", "points")
    yield from _rows(head, rows, len(m.links), "llrlll")


def _pairs(m: Parts) -> Iterator[Block]:
    length = f" [{u}]" if (u := unit_of(m.units, LENGTH)) else ""
    rows = (
        (
            p.name,
            p.type.symbol,
            p.a,
            p.b,
            _vector(p.point) if p.on_a is None else "by markers",
            _vector(p.axis),
            _pitch(p),
        )
        for p in m.pairs
    )
    yield from _rows(("pair", "type", "from", "on", f"point{length}", "axis", "pitch"), rows, len(m.pairs), "llllllr")


def _pitch(pair: Pair) -> str:
    """The advance per radian."""
    if pair.pitch is not None:
        return _number(pair.pitch)
    return "" if pair.lead is None else _number(pair.lead / (2 * np.pi))


def _drives(m: Parts) -> Iterator[Block]:
    rows = ((m.full_name(d.freedom), _motion(d.motion)) for d in m.drives)
    yield from _rows(("driven freedom", "stored motion"), rows, len(m.drives), "ll")


def _motion(motion: Motion | None) -> str:
    return "" if motion is None else repr(motion).removeprefix("Motion(").removesuffix(")")


def _couplings(m: Parts) -> Iterator[Block]:
    yield from _listed(f"{c.name}: {c.text}" for c in m.couplings)


def _loads(m: Parts) -> Iterator[Block]:
    yield from _listed(map(repr, m.loads))


def _response(m: Parts) -> Iterator[Block]:
    yield from _listed([] if m.response is None else [repr(m.response)])


def _start(m: Parts) -> Iterator[Block]:
    yield from _listed(f"{name} = {value:.6g}" for name, value in m.start.items() if value)


def _listed(items: Iterable[str]) -> Iterator[Block]:
    texts = list(items)
    more = [f"... and {len(texts) - LISTED:,} more"] if len(texts) > LISTED else []
    if texts:
        yield Bullets([*texts[:LISTED], *more])


PARTS: Mapping[str, Any] = {
    "Links": _links, "Pairs": _pairs, "Drivers": _drives, "Couplings": _couplings, "Loads": _loads, "Response": _response, "Start": _start,
}  # fmt: skip
"""The parts of the document by title."""


def _number(value: float) -> str:
    return f"{value:.4g}"


def _vector(value: Any) -> str:
    return "" if value is None else f"({', '.join(f'{x + 0.0:.4g}' for x in value)})"
