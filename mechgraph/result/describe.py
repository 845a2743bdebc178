"""What a solution hands out by name, for people: ranges of the values of one pair, link or coupling, and where they are reached."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.document import Block, Document, Paragraph
from mechgraph.model.pair import Pair
from mechgraph.result.numbers import bracket, ranges
from mechgraph.result.places import Places, coupling_unit
from mechgraph.result.values import Values
from mechgraph.units import unit_of

UNASKED = 1_000_000
"""Links times positions up to which motions are evaluated again without being asked for."""

Row = tuple[str, Any]
"""A quantity and its values, one a position."""


def pair_document(values: Values, k: int) -> Document:
    """Coordinates, rates, efforts and reaction of a pair."""
    places, pair = Places(values), values.whole.pairs[k]
    blocks: list[Block] = [
        Paragraph(f"{pair.type.symbol}, {pair.type.name}, from {pair.a} on {pair.b}; {_solved(places)}."),
        ranges(_pair_rows(values, pair, k), places.name),
    ]
    if values.has_forces and not _large(values):
        loose = [n for n, ok in values.unique(k).items() if not places.flat(ok)[places.solved].all()]
        how = "of least norm" if values.least_norm else "without a value (NaN)"
        blocks.append(Paragraph(f"Not unique, {how}: {', '.join(loose)}." if loose else ""))
    elif values.has_forces:
        blocks.append(Paragraph(_asked(values, f"s[{pair.name!r}].components")))
    return Document(f"Pair {pair.name} of {values.mechanism.name}", tuple(blocks))


def _pair_rows(values: Values, pair: Pair, k: int) -> Iterator[Row]:
    units, coordinates = values.mechanism.units, values.coordinates(k)
    for j, freedom in enumerate(pair.type.freedoms):
        turns = freedom.turns
        for order, (what, of) in enumerate(zip(("", " velocity", " acceleration"), coordinates, strict=True)):
            unit = unit_of(units, (0 if turns else 1, 0, -order))
            scale, unit = (180 / np.pi, "deg") if turns and not order else (1.0, unit)
            yield f"{freedom.name}{what}{bracket(unit)}", scale * of[..., j]
    if not values.has_forces:
        return
    force, moment = (unit_of(units, (power, 1, -2)) for power in (1, 2))
    driven = {values.whole.freedom(name) for name in values.actuated}
    own, applied = values.efforts(k)
    for j, (freedom, effort) in enumerate(zip(pair.type.freedoms, pair.type.efforts, strict=True)):
        unit = bracket(moment if effort.is_couple else force)
        if (k, j) in driven:
            yield f"{freedom.name} effort of the drive{unit}", own[..., j]
        if np.nan_to_num(applied[..., j]).any():
            yield f"{freedom.name} applied effort{unit}", applied[..., j]
    wrench = values.reaction_at_pair(k)
    yield f"force{bracket(force)}", np.linalg.norm(wrench[..., 3:], axis=-1)
    yield f"moment{bracket(moment)}", np.linalg.norm(wrench[..., :3], axis=-1)
    if not _large(values):
        couples = {c.name: c.is_couple for c in pair.type.reactions or ()}
        for name, of in values.components(k).items():
            yield f"{name}{bracket(moment if couples.get(name) else force)}", of


def link_document(values: Values, k: int) -> Document:
    """Motion of the mass centre and the named points of a link, and how it turns."""
    m, places = values.mechanism, Places(values)
    link = m.links[k]
    if _large(values):
        shown: Block = Paragraph(_asked(values, f"s.link({link.name!r}).pose"))
    else:
        shown = ranges(_link_rows(values, k), places.name)
    return Document(f"Link {link.name} of {m.name}", (Paragraph(f"{_solved(places).capitalize()}."), shown))


def _link_rows(values: Values, k: int) -> Iterator[Row]:
    m = values.mechanism
    link = m.links[k]
    length, speed, rate = (bracket(unit_of(m.units, (1, 0, -n))) for n in range(3))
    named = {"mass centre": None} if link.center is not None else {}
    for name, at in {**named, **link.points}.items() or {"origin of the frame": (0.0, 0.0, 0.0)}.items():
        point = values.link_point(k, at)
        yield from ((f"{name} {axis}{length}", point.position[..., i]) for i, axis in enumerate("xyz"))
        yield f"{name} speed{speed}", np.linalg.norm(point.velocity, axis=-1)
        yield f"{name} acceleration{rate}", np.linalg.norm(point.acceleration, axis=-1)
    _, twist, change = values.link(k)
    for n, (what, of) in enumerate((("velocity", twist), ("acceleration", change)), 1):
        yield f"angular {what}{bracket(unit_of(m.units, (0, 0, -n)))}", np.linalg.norm(of[..., :3], axis=-1)


def coupling_document(values: Values, k: int) -> Document:
    """The relation that a coupling imposes, and its multiplier."""
    m = values.mechanism
    coupling, places = m.couplings[k], Places(values)
    unit = bracket(coupling_unit(m, coupling))
    blocks: list[Block] = [Paragraph(f"{coupling.text}; {_solved(places)}.")]
    if values.has_forces:
        rows: list[tuple[str, Array]] = [(f"multiplier{unit}", values.multiplier(k))]
        if coupling.steps:
            force = np.linalg.norm(values.contact(k)[0], axis=-1)
            rows.append((f"force of contact{bracket(unit_of(m.units, (1, 1, -2)))}", force))
        blocks.append(ranges(rows, places.name))
    return Document(f"Coupling {coupling.name} of {m.name}", tuple(blocks))


def _solved(places: Places) -> str:
    of = places.status.size
    return f"solved {int(places.solved.sum())} of {of} position{'s' * (of != 1)}"


def _large(values: Values) -> bool:
    return len(values.mechanism.links) * int(np.prod(values.batch)) > UNASKED


def _asked(values: Values, call: str) -> str:
    """What is said in place of what would take long."""
    size = f"{len(values.mechanism.links):,} links at {int(np.prod(values.batch)):,} positions"
    return f"What follows from the motion was not evaluated ({size}): {call} does it."
