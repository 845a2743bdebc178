"""Words for people: reaction components by pair type and direction, what a pair is as a part, kinds of mechanisms. Rows of data."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from mechgraph.model.pair_type import PairType
from mechgraph.model.row_parts import Component

NAMED = 8
"""Most names that a sentence lists."""

LINES = {
    "R": "pin",
    "P": "slide",
    "H": "screw",
    "C": "shaft",
    "U": "first pin",
    "E": "normal of the plane",
    "Sc": "groove",
    "Sg": "groove",
    "Cp": "normal of the plane",
    "Sp": "normal of the plane",
}
"""What z of the marker is, by pair type; "axis" for the others that have one."""

PARTS = {
    "C": "floating bearing",
    "S": "ball joint or self-aligning bearing",
    "Sg": "self-aligning bearing that floats",
    "U": "universal joint",
    "E": "plane contact",
    "Cp": "cylinder on a plane",
    "Sp": "ball on a plane",
    "Sc": "pinned ball in a slotted cylinder",
    ("P", "C"): "round guide that lets it turn",
    ("P", "Sg"): "ball in a groove",
    ("P", "E"): "flat guide",
}
"""What a new pair is as a part that can be bought or made, by its type or by the old and the new one; else its name in the pair table."""


@dataclass(frozen=True)
class KindWords:
    """The forces that a kind of mechanism is about, and the others where all pairs are of this kind (and where none turns)."""

    own: str
    others: str
    without_pins: str


KINDS = {
    "planar": KindWords(
        "in-plane forces", "forces along and moments across the pins", "forces across the plane and moments in it"
    ),
    "spherical": KindWords("moments about the centre", "forces through the centre", "forces through the centre"),
}
"""By the kind of ``structure.kind``."""


def plural(count: int, one: str, many: str = "") -> str:
    """``1 driver``, ``3 drivers``."""
    return f"{count} {one if count == 1 else many or one + 's'}"


def listed(names: Sequence[str], most: int = NAMED) -> str:
    """Names in a row, the first few of many."""
    more = len(names) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def joined(names: Sequence[str], word: str = "and", most: int = NAMED) -> str:
    """``A, B and C``, the first few of many."""
    shown = [*names[:most], *([f"{len(names) - most} more"] if len(names) > most else [])]
    return f" {word} ".join(filter(None, (", ".join(shown[:-1]), shown[-1])))


def component_words(row: PairType, names: Iterable[str]) -> str:
    """Components of a pair type with their direction in words: ``Fz (along the pin), Mx and My (moments across the pin)``."""
    components = {c.name: c for c in row.reactions or ()}
    by_words: dict[str, list[str]] = {}
    for name in names:
        by_words.setdefault(_direction(row, components.get(name)), []).append(name)
    parts = [joined(some) + (f" ({words})" if words else "") for words, some in by_words.items()]
    return ", ".join(parts) if len(by_words) > 1 or "" not in by_words else parts[0]


def _direction(row: PairType, c: Component | None) -> str:
    """The direction of a force or moment against z of its frame; nothing for a pair without an axis."""
    if c is None or not row.directed:
        return ""
    turning, slot = divmod(int(np.flatnonzero(c.wrench)[0]), 3)
    how = {(0, True): "moment about", (0, False): "moment across", (1, True): "along", (1, False): "across"}
    return f"{how[turning, slot == 2]} the {LINES.get(row.symbol, 'axis')}"


def exchange(old: str, new: PairType) -> str:
    """A new pair as a part, with the symbols: ``ball joint or self-aligning bearing (R -> S)``."""
    return f"{PARTS.get((old, new.symbol), PARTS.get(new.symbol, new.name))} ({old} -> {new.symbol})"
