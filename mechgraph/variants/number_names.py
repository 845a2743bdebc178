"""Declared numbers by name.

A number is named as it is declared: ``crank.mass``, ``crank.center.x``, ``crank.inertia.xy``, ``crank.tip.x`` of a named point ``tip``,
``B.point.x``, ``B.axis.z``, ``B.on_a.point.y``, ``B.pitch``, ``loads[0].stiffness``, ``loads[1].force.x``; of a coupling ``g.A`` and
``g.constant``, or ``couplings[0].A``; of gears, curves, surfaces and contacts ``g.module``, ``g.teeth.a``, ``K.curve.radius``,
``K.curve.points[3].x``, ``K.curve.lift[12]``, ``K.surface.center.z``, ``K.roller``, ``K.hertz.moduli.b``; of a chain ``length[2]``,
``twist[0]``, ``offset[1]`` (as in ``mg.chain``, counted from 0). Which fields of a link, pair, coupling or load are numbers, and of which
components, their annotations say (``model.field_format``).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mechgraph.errors import did_you_mean, near_names
from mechgraph.fields import POINT, Described, FieldFormat
from mechgraph.model.chain import NUMBERS_OF_CHAIN, chain_numbers
from mechgraph.model.couplings import BaseCoupling
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Link, Marker, Pair
from mechgraph.model.parameters import Declared, coupling_places
from mechgraph.quantities import is_numeric

PLACED = (*Marker.formats, "pitch")
"""Numbers of a pair that the kernels read."""
MARKER = tuple(Marker.formats)
"""Numbers of a marker."""
SIDES = [name for name, about in Pair.formats.items() if about.table == "marker"]
"""Fields of a pair that hold its markers, on link a and on link b."""
ALIKE = 0.8
"""How like a wrong name is to one that may be meant: they share the names of link, pair and curve."""
_INDEXED = re.compile(r"(?P<what>\w+)\[(?P<index>\d+)\](?:\.(?P<rest>.+))?")

Place = tuple[Any, ...]


@dataclass(frozen=True)
class Field:
    """A declared number: the array of ``Declared`` and the places in it that hold ``scale`` times the number."""

    array: str
    places: tuple[Place, ...]
    scale: float = 1.0

    def read(self, numbers: Declared) -> float:
        """The declared value."""
        return float(getattr(numbers, self.array)[self.places[0]][..., 0].reshape(-1)[0]) / self.scale


@dataclass(frozen=True)
class ChainField:
    """Twist, length or offset (``kind`` 0, 1, 2) of the ``index``-th link of a chain."""

    kind: int
    index: int


@dataclass(frozen=True)
class LoadField:
    """A number of the ``index``-th load, or a component of a vector of it."""

    index: int
    name: str
    component: int | None


@dataclass(frozen=True)
class ItemField:
    """A number that an item keeps to itself: the ``index``-th of ``what``, the fields on the way to it, and its place in the last one."""

    what: str
    index: int
    path: tuple[str, ...]
    place: Place

    @property
    def one_by_one(self) -> bool:
        """Whether mechanisms that differ in it do so in more than arrays: in their curves, surfaces, contacts, or named points."""
        return self.what != "couplings"

    def read(self, m: Mechanism) -> float:
        """The declared value."""
        item = getattr(m, self.what)[self.index]
        for name in self.path:
            item = _part(item, name)
        return float(np.asarray(item, dtype=float)[self.place])

    def changed(self, item: Any, value: float) -> Any:
        """The item with another value."""
        return _changed(item, self.path, self.place, value)


def _part(item: Any, name: str) -> Any:
    """What an item holds under a name; a named point."""
    return item[name] if isinstance(item, Mapping) else getattr(item, name)


def _changed(item: Any, path: tuple[str, ...], place: Place, value: float) -> Any:
    name, *rest = path
    old = _part(item, name)
    if rest:
        new = _changed(old, tuple(rest), place, value)
    else:
        new = np.array(old, dtype=float)
        new[place] = value
        new = new.tolist()
    if isinstance(item, Mapping):
        return {**item, name: new}
    return item.reshaped(**{name: new}) if isinstance(item, Pair) else item.replace(**{name: new})


AnyField = Field | ChainField | LoadField | ItemField
Finder = Callable[[Mechanism, int, str], AnyField | str | None]
"""Finds the number of the i-th link, pair, ... by the rest of its name; or says what is wrong with it."""


def find_field(m: Mechanism, name: str) -> AnyField | str:
    """The field of that name, or why there is none."""
    indexed = _INDEXED.fullmatch(name)
    if indexed and indexed["what"] in NUMBERS_OF_CHAIN and not indexed["rest"]:
        return _chain_field(m, name, indexed["what"], int(indexed["index"]))
    if indexed and indexed["what"] in INDEXED:
        count = len(getattr(m, indexed["what"]))
        if int(indexed["index"]) >= count:
            return f"{name!r}: there are {count} {indexed['what']}, counted from 0"
        return INDEXED[indexed["what"]](m, int(indexed["index"]), indexed["rest"] or "")
    named: Sequence[tuple[Sequence[Link | Pair | BaseCoupling], Finder]] = (
        (m.links, _link_field),
        (m.pairs, _pair_field),
        (m.couplings, _coupling_field),
    )
    for items, find in named:
        for i, item in enumerate(items):
            if name.startswith(item.name + ".") and (found := find(m, i, name.removeprefix(item.name + "."))):
                return found
    example = (
        f"expected e.g. {m.links[-1].name}.mass, {m.links[-1].name}.center.x, "
        f"{m.links[-1].name}.inertia.xx, {m.pairs[0].name}.{'point' if m.pairs[0].point is not None else 'on_a.point'}.x, "
        "loads[0].stiffness, or length[2] of a chain"
    )
    return f"{name!r}: no declared number of that name; {did_you_mean(_near(m, name)) or example}"


def _near(m: Mechanism, name: str) -> list[str]:
    """Names of numbers that may be meant by a wrong one, of the items with which it begins or whose names are near its first part."""
    named: list[Link | Pair | BaseCoupling] = [*m.links, *m.pairs, *m.couplings]
    items = {item.name: item for item in named}
    owners = [own for own in items if name.startswith(own + ".")] or near_names(name.partition(".")[0], items)
    return near_names(name, (f"{own}.{rest}" for own in owners for rest in _numbers_of(items[own])), ALIKE)


def _component(item: Described, rest: str) -> tuple[tuple[str, ...], FieldFormat, tuple[Place, ...]] | None:
    """Path, format and places of ``center.x`` or ``on_a.point.x`` in an item; None where it declares no such number."""
    what, _, at = rest.partition(".")
    listed = _INDEXED.fullmatch(what)
    if (
        listed
        and (about := item.formats.get(listed["what"]))
        and about.kind.entry
        and at in about.kind.entry.components()
    ):
        value, i = getattr(item, listed["what"]), int(listed["index"])
        fits = is_numeric(value, np.shape(value)) and i < len(value)
        places = about.kind.entry.components()[at]
        return ((listed["what"],), about, tuple((i, *place) for place in places)) if fits else None
    if what not in item.formats:
        return None
    about, value = item.formats[what], getattr(item, what)
    if isinstance(value, Described):
        inner = _component(value, at)
        return None if inner is None else ((what, *inner[0]), *inner[1:])
    if about.kind.shape is None or not is_numeric(value, about.kind.shape) or at not in about.kind.components():
        return None
    return (what,), about, about.kind.components()[at]


def _link_field(m: Mechanism, i: int, rest: str) -> Field | ItemField | str | None:
    link = m.links[i]
    found = _component(link, rest)
    if found is None:
        point, _, at = rest.rpartition(".")
        at_of = POINT.components()
        return ItemField("links", i, ("points", point), at_of[at][0]) if point in link.points and at in at_of else None
    (what,), _, places = found
    if what == "mass" and link.center is None:
        return f"'{link.name}.mass': link {link.name!r} has no mass centre; declare center=(x, y, z)"
    return Field(what, tuple((*place, i) for place in places))


def _pair_field(m: Mechanism, k: int, rest: str) -> Field | ItemField | str | None:
    pair = m.pairs[k]
    found = _component(pair, rest)
    if found is None:
        return None
    path, about, places = found
    *side, what = path
    array, scale = about.held_in or (what, 1.0)
    if pair.contact is None and len(path) <= 2 and array in PLACED:
        where: Place = () if array not in MARKER else (SIDES.index(side[0]),) if side else (slice(None),)
        return Field(array, tuple((*where, *place, k) for place in places), scale)
    if pair.contact is not None and path[0] in (*MARKER, SIDES[0]):
        return f"'{pair.name}.{rest}': follows from its curve or surface; vary numbers of that, or of {SIDES[1]}"
    return ItemField("pairs", k, path, places[0])


def _chain_field(m: Mechanism, name: str, what: str, index: int) -> ChainField | str:
    numbers = chain_numbers(m)
    if numbers is None:
        return f"{name!r}: mechanism {m.name!r} is no chain with twist, length and offset of every link"
    if index >= numbers.shape[1]:
        return f"{name!r}: the chain has {numbers.shape[1]} links, counted from 0"
    return ChainField(NUMBERS_OF_CHAIN.index(what), index)


def _load_field(m: Mechanism, index: int, rest: str) -> LoadField | str:
    load = m.loads[index]
    found = _component(load, rest)
    if found is not None:
        (what,), _, (place,) = found
        return LoadField(index, what, place[0] if place else None)
    shapes = {name: about.kind.shape for name, about in load.formats.items() if about.kind.shape is not None}
    known = ", ".join(name for name, shape in shapes.items() if is_numeric(getattr(load, name), shape))
    return f"'loads[{index}].{rest}': no number of that name in load {index} ({load.kind}: {known}; vectors with .x, .y, .z)"


def _coupling_field(m: Mechanism, index: int, rest: str) -> Field | ItemField | str:
    c, own = m.couplings[index], coupling_places(m)[index]
    if rest == "constant" and c.constant is not None:
        return Field("couplings", ((own.stop,),))
    if rest == "constant":
        return f"'{c.name}.constant': coupling {c.name!r} keeps the value that it has at the start; declare constant="
    if not c.varies:
        found = _component(c, rest)
        if found is not None:
            return ItemField("couplings", index, found[0], found[2][0])
        return f"'{c.name}.{rest}': coupling {c.name!r} has the numbers {', '.join(_numbers_of(c))}"
    if m.freedom_fault(rest, single=True) is None and m.full_name(rest) in c.freedoms:
        return Field("couplings", ((own.start + c.freedoms.index(m.full_name(rest)),),))
    return f"'{c.name}.{rest}': coupling {c.name!r} has the numbers {', '.join(c.freedoms)} and constant"


def _numbers_of(item: Described) -> list[str]:
    """Names of the numbers that are declared, those of what it holds too."""
    out = []
    for name, about in item.formats.items():
        if isinstance(held := getattr(item, name), Described):
            out += [f"{name}.{rest}" for rest in _numbers_of(held)]
        parts = (f"{name}.{part}".rstrip(".") for part in about.kind.components())
        out += [text for text in parts if _component(item, text) is not None]
    points = item.points if isinstance(item, Link) else ()
    return out + [f"{name}.{at}" for name in points for at in POINT.components()]


INDEXED: dict[str, Callable[[Mechanism, int, str], AnyField | str]] = {
    "loads": _load_field,
    "couplings": _coupling_field,
}
"""Lists of a mechanism whose items are named by their place, counted from 0."""
