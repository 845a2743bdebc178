"""Declared numbers by name, and the mechanisms that other numbers make.

Declared numbers by name.

A number is named as it is declared: ``crank.mass``, ``crank.center.x``, ``crank.inertia.xy``, ``crank.tip.x`` of a named point ``tip``,
``B.point.x``, ``B.axis.z``, ``B.on_a.point.y``, ``B.pitch``, ``loads[0].stiffness``, ``loads[1].force.x``; of a coupling ``g.A`` and
``g.constant``, or ``couplings[0].A``; of gears, belts, curves, surfaces and contacts ``g.module``, ``gears[0].shift``, ``g.teeth.a``,
``belt.pretension``, ``K.curve.radius``, ``K.curve.points[3].x``, ``K.curve.lift[12]``, ``K.surface.center.z``, ``K.roller``,
``K.hertz.moduli.b``; of a chain ``length[2]``, ``twist[0]``, ``offset[1]`` (as in ``mg.chain``, counted from 0). Which fields of a link,
pair, coupling or load are numbers, and of which components, their annotations say (``model.field_format``).
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.determinacy.snapping import SnappedMechanism
from mechgraph.errors import DeclarationError, did_you_mean, near_names
from mechgraph.fields import POINT, XYZ, Described, FieldFormat, PerCase
from mechgraph.maths.inertia import physical
from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.model.belts import BeltDrive
from mechgraph.model.friction import Friction
from mechgraph.model.gears import LineCoupling
from mechgraph.model.loads import Load
from mechgraph.model.mechanism import NUMBERS_OF_CHAIN, Mechanism, chain_numbers, markers_of_chain
from mechgraph.model.pair import Link, Marker, Pair
from mechgraph.model.parameters import Declared, coupling_places, declared
from mechgraph.model.plane import plane_faults
from mechgraph.model.short_forms import ShortForm
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
    also: tuple[int, ...] = ()
    """Other items that hold the same number, as the spans of a belt do."""

    @property
    def one_by_one(self) -> bool:
        """Whether mechanisms that differ in it do so in more than arrays: in their curves, surfaces, contacts, or named points."""
        return self.what != "couplings" or bool(self.also)

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
        i, rest = int(indexed["index"]), indexed["rest"] or ""
        return _leaving(m, name, getattr(m, indexed["what"])[i], rest) or INDEXED[indexed["what"]](m, i, rest)
    named: Sequence[tuple[Sequence[Any], Finder]] = (
        (m.links, _link_field),
        (m.pairs, _pair_field),
        (m.couplings, _coupling_field),
        (m.gears, _gear_field),
    )
    for items, find in named:
        for i, item in enumerate(items):
            rest = name.removeprefix(item.name + ".")
            if rest != name and (found := find(m, i, rest)):
                return _leaving(m, name, item, rest) or found
    if found := _belt_field(m, name):
        return found
    example = (
        f"expected e.g. {m.links[-1].name}.mass, {m.links[-1].name}.center.x, "
        f"{m.links[-1].name}.inertia.xx, {m.pairs[0].name}.{'point' if m.pairs[0].point is not None else 'on_a.point'}.x, "
        "loads[0].stiffness, or length[2] of a chain"
    )
    return f"{name!r}: no declared number of that name; {did_you_mean(_near(m, name)) or example}"


def _leaving(m: Mechanism, name: str, item: Described, rest: str) -> str | None:
    """Why a number of a planar mechanism does not vary: what it belongs to would leave the plane; None where it would not."""
    if not m.planar:
        return None
    found, (point, _, at) = _component(item, rest), rest.rpartition(".")
    if found is None and not (isinstance(item, Link) and point in item.points and at in XYZ):
        return None
    path, _, (place, *_) = (("points", point), POINT, ((XYZ.index(at),),)) if found is None else found
    value: Any = item
    for part in path:
        value = _part(value, part)
    moved = _changed(item, path, place, float(np.asarray(value, dtype=float)[place]) + 1.0)
    of = ([moved] if isinstance(moved, kind) else [] for kind in (Link, Pair, Load))
    return f"{name!r}: leaves the x-y plane of a planar mechanism; m.to_spatial() has it" if plane_faults(*of) else None


def _near(m: Mechanism, name: str) -> list[str]:
    """Names of numbers that may be meant by a wrong one, of the items with which it begins or whose names are near its first part."""
    items: dict[str, list[Described]] = {}
    for item in (*m.links, *m.pairs, *m.couplings, *m.gears):
        items.setdefault(item.name, []).append(item)
    owners = [own for own in items if name.startswith(own + ".")] or near_names(name.partition(".")[0], items)
    return near_names(
        name, (f"{own}.{rest}" for own in owners for item in items[own] for rest in _numbers_of(item)), ALIKE
    )


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
        return f"'{link.name}.mass': link {link.name!r} has no mass center; declare center=(x, y, z)"
    if m.planar and rest == "inertia.zz":  # the others, which do nothing in the plane, go with it: a body that can be
        places = tuple((j, j) for j in range(3))
    return Field(what, tuple((*place, i) for place in places))


def _pair_field(m: Mechanism, k: int, rest: str) -> Field | ItemField | str | None:
    pair = m.pairs[k]
    found = _component(pair, rest)
    if found is None:
        return None
    path, about, places = found
    *side, what = path
    array, scale = about.held_in or (what, 1.0)
    if array in MARKER and (gears := _gears_about(m, k)):
        return f"'{pair.name}.{rest}': {gears}"
    if pair.contact is None and len(path) <= 2 and array in PLACED:
        where: Place = () if array not in MARKER else (SIDES.index(side[0]),) if side else (slice(None),)
        return Field(array, tuple((*where, *place, k) for place in places), scale)
    if pair.contact is not None and path[0] in (*MARKER, SIDES[0]):
        return f"'{pair.name}.{rest}': follows from its curve or surface; vary numbers of that, or of {SIDES[1]}"
    return ItemField("pairs", k, path, places[0])


def _gears_about(m: Mechanism, pair: int | None = None) -> str:
    """Why the axis of a pair (of any) does not vary, where places of gears and pulleys on it would have to follow."""
    held = (
        c.name
        for c in m.couplings
        if isinstance(c, LineCoupling)
        and not isinstance(c, ShortForm)
        and c.linear
        and pair in (None, *(s.pair for s in c.steps))
    )
    if not (name := next(held, "")):
        return ""
    return (
        f"gears or pulleys of {name!r} sit on that axis, and would not move with it; give a function that returns the mechanism of a "
        "variant"
    )


def _belt_field(m: Mechanism, name: str) -> ItemField | None:
    belt, _, rest = name.rpartition(".")
    own = [k for k, c in enumerate(m.couplings) if isinstance(c, BeltDrive) and c.belt == belt]
    found = _component(m.couplings[own[0]], rest) if own else None
    return None if found is None else ItemField("couplings", own[0], found[0], found[2][0], tuple(own[1:]))


def _gear_field(m: Mechanism, i: int, rest: str) -> ItemField | None:
    found = _component(m.gears[i], rest)
    return None if found is None else ItemField("gears", i, found[0], found[2][0])


def _indexed_gear(m: Mechanism, i: int, rest: str) -> ItemField | str:
    numbers = ", ".join(_numbers_of(m.gears[i]))
    return (
        _gear_field(m, i, rest)
        or f"'gears[{i}].{rest}': no number of that name in gear {m.gears[i].name!r} ({numbers})"
    )


def _chain_field(m: Mechanism, name: str, what: str, index: int) -> ChainField | str:
    numbers = m.once(chain_numbers)
    if numbers is None:
        return f"{name!r}: mechanism {m.name!r} is no chain with twist, length and offset of every link"
    if index >= numbers.shape[1]:
        return f"{name!r}: the chain has {numbers.shape[1]} links, counted from 0"
    if gears := _gears_about(m):
        return f"{name!r}: {gears}"
    if m.planar and what != "length":
        return f"{name!r}: leaves the x-y plane of a planar mechanism; m.to_spatial() has it"
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
    if not c.alone:
        return f"'{c.name}.{rest}': its numbers belong to the whole belt; vary '{c.name.rpartition('.')[0]}.{rest}'"
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
    "gears": _indexed_gear,
}
"""Lists of a mechanism whose items are named by their place, counted from 0."""


__all__ = ["AnyField", "Variants", "clashes", "field_values", "find_field", "stacked", "topology_of", "varied"]


@dataclass(frozen=True)
class Variants:
    """``count`` variants of one mechanism: declared numbers and loads with a batch axis (``PerCase`` where a load varies).

    Those ``missing`` could not be built; the numbers of the mechanism itself stand in their places. ``declared``: the numbers of what
    was declared, where variants are taken as they are meant with a tolerance; ``own``: numbers that items keep to themselves, with their
    values ``(count,)``.
    """

    mechanism: Mechanism
    numbers: Declared
    loads: tuple[Load, ...]
    count: int
    missing: tuple[int, ...] = ()
    declared: Declared | None = None
    own: tuple[tuple[ItemField, Array], ...] = ()

    def valid(self) -> NDArray[np.bool_]:
        """Which variants are physical: finite numbers, no negative mass, axes of some length, possible inertias, ``(count,)``."""
        n = self.numbers
        ok = np.ones(self.count, dtype=bool)
        ok[list(self.missing)] = False
        for field in dataclasses.fields(n):
            values = getattr(n, field.name)
            if values.dtype == object:
                continue
            ok &= np.isfinite(values).all(axis=tuple(range(values.ndim - 1)))
        ok &= (n.mass >= 0).all(axis=0)
        ok &= ((n.axis**2).sum(axis=1) > 1e-24).all(axis=(0, 1))
        if n.inertia.shape[-1] == self.count:
            free = np.array([link.unphysical for link in self.mechanism.links])
            ok &= (physical(np.nan_to_num(n.inertia)) | free[:, None]).all(axis=0)
        for own in coupling_places(self.mechanism):
            ok &= (n.couplings[own] != 0).all(axis=0)
        for load in self.loads:
            if _varies(load):
                ok &= np.array([not _load_of(load, i).faults(self.mechanism) for i in range(self.count)])
        return ok

    def one(self, i: int) -> Mechanism:
        """The ``i``-th variant as a mechanism of its own.

        Raises
        ------
        DeclarationError
            where no such mechanism can be.
        """
        n = replace(
            self.numbers,
            **{
                f.name: v[..., i if v.shape[-1] > 1 else 0]
                for f in dataclasses.fields(self.numbers)
                for v in [getattr(self.numbers, f.name)]
            },
        )
        m = self.mechanism
        links = [
            link
            if link.center is None
            else replace(
                link,
                mass=float(n.mass[k]),
                center=n.center[:, k],
                inertia=None if link.inertia is None else n.inertia[:, :, k],
            )
            for k, link in enumerate(m.links)
        ]
        pairs = [_placed(pair, n, k) for k, pair in enumerate(m.pairs)]
        couplings = [
            c.renumbered(n.couplings[own].tolist(), float(n.couplings[own.stop]))
            for c, own in zip(m.couplings, coupling_places(m), strict=True)
        ]
        loads = [_load_of(load, i) for load in self.loads]
        lists: dict[str, list[Any]] = {"links": links, "pairs": pairs, "couplings": couplings, "gears": list(m.gears)}
        for field, values in self.own:
            items = lists[field.what]
            for k in (field.index, *field.also):
                items[k] = field.changed(items[k], float(values[i]))
        return m.replace(**lists, loads=loads)


def _placed(pair: Pair, n: Declared, k: int) -> Pair:
    """A pair with the numbers of one variant; a second direction that must be perpendicular is made so again.

    What travels on a curve or surface stands where that says, and has its numbers among the variants' own.
    """
    if pair.contact is not None:
        return pair
    markers = []
    for side in (0, 1):
        axis, second = n.axis[side, :, k], n.second[side, :, k]
        if pair.type.square_second:
            second = second - (axis @ second) / (axis @ axis) * axis
        markers.append(Marker(n.point[side, :, k], axis, second))
    changes: dict[str, Any] = {"pitch": None, "lead": None}
    if pair.type.takes_pitch:
        changes["pitch"] = float(n.pitch[k])
    if pair.on_a is not None:
        return pair.replace(on_a=markers[0], on_b=markers[1], **changes)
    return pair.replace(point=markers[0].point, axis=markers[0].axis, second=markers[0].second, **changes)


def _varies(load: Load) -> bool:
    return any(isinstance(getattr(load, f.name), PerCase) for f in dataclasses.fields(load))


def _load_of(load: Load, i: int) -> Load:
    varied = {f.name: getattr(load, f.name) for f in dataclasses.fields(load)}
    changes: dict[str, Any] = {k: v.values[i].tolist() for k, v in varied.items() if isinstance(v, PerCase)}
    return replace(load, **changes)


def field_values(m: Mechanism, fields: Mapping[str, AnyField]) -> dict[str, float]:
    """Declared values of fields."""
    numbers, chained = declared(m), m.once(chain_numbers)
    out = {}
    for name, field in fields.items():
        if isinstance(field, Field):
            out[name] = field.read(numbers)
        elif isinstance(field, ItemField):
            out[name] = field.read(m)
        elif isinstance(field, ChainField):
            assert chained is not None
            out[name] = float(chained[field.kind, field.index])
        else:
            value = np.asarray(getattr(m.loads[field.index], field.name), dtype=float)
            out[name] = float(value if field.component is None else value[field.component])
    return out


def varied(m: Mechanism, fields: Mapping[str, AnyField], values: Array) -> Variants:
    """Variants of a mechanism in which the fields take ``values (fields, count)``."""
    count = values.shape[1]
    start, loads = declared(m), list(m.loads)
    arrays = {f.name: getattr(start, f.name) for f in dataclasses.fields(start)}
    rows = list(zip(fields.values(), values, strict=True))
    chained = [(field, row) for field, row in rows if isinstance(field, ChainField)]
    if chained:
        arrays |= _chain_markers(m, arrays, chained, count)
    for field, row in rows:
        if isinstance(field, Field):
            old = arrays[field.array]
            if old is getattr(start, field.array):
                arrays[field.array] = np.repeat(old, count, axis=-1)
            for place in field.places:
                arrays[field.array][place] = field.scale * row
        elif isinstance(field, LoadField):
            loads[field.index] = _varied_load(loads[field.index], field, row)
    own = tuple((field, row) for field, row in rows if isinstance(field, ItemField))
    made = Variants(m, Declared(**arrays), tuple(loads), count, own=own)
    moved = {
        place[-1] for field, _ in rows if isinstance(field, Field) and field.array in MARKER for place in field.places
    }
    geared = {step.pair for c in m.couplings if isinstance(c, ShortForm) for step in c.steps}
    follows = bool(geared and chained) or not geared.isdisjoint(moved)
    alone = any(field.one_by_one for field, _ in own) or (_rubbing_teeth(m) and (chained or moved or own))
    if alone:
        return replace(made, missing=tuple(range(count)))
    return _with_gears(made) if own or follows else made


def _rubbing_teeth(m: Mechanism) -> bool:
    """Whether a gear or belt rubs: how far its teeth slide and how far it wraps follow from the places and numbers of one mechanism."""
    return any(isinstance(load, Friction) and load.of not in m.pair_index for load in m.loads)


def _with_gears(of: Variants) -> Variants:
    """Variants with the gears that each has, where its pairs are; those with faults are missing."""
    missing = []
    items: Any = np.repeat(of.numbers.items, of.count // of.numbers.items.shape[1], axis=1)
    for i in range(of.count):
        try:
            items[:, i] = of.one(i).couplings
        except DeclarationError:
            missing.append(i)
    couplings = np.array([[x for c in one for x in (*c.coefficients, c.constant or 0.0)] for one in items.T]).T
    return replace(of, numbers=replace(of.numbers, items=items, couplings=couplings), missing=tuple(missing))


def _chain_markers(
    m: Mechanism, arrays: Mapping[str, Array], chained: Sequence[tuple[ChainField, Array]], count: int
) -> dict[str, Array]:
    """Point, axis and second directions of a chain some of whose numbers vary; other markers stay unchanged."""
    start = m.once(chain_numbers)
    assert start is not None
    numbers = np.repeat(start[:, :, None], count, axis=2)
    for field, row in chained:
        numbers[field.kind, field.index] = row
    poses = np.stack(markers_of_chain(numbers))
    out = {name: np.repeat(arrays[name], count, axis=-1) for name in MARKER}
    for side, k in {chain_marker(m, field) for field, _ in chained}:
        for name, column in zip(MARKER, (3, 2, 0), strict=True):  # origin, z and x of a pose
            out[name][side, :, k] = poses[side, :, column, k]
    return out


def chain_marker(m: Mechanism, field: ChainField) -> tuple[int, int]:
    """Side and pair of the marker that a number of a chain places."""
    last = len(m.pairs) - 1
    return (0, field.index + 1) if field.index < last else (1, last)


def clashes(m: Mechanism, fields: Mapping[str, AnyField]) -> list[str]:
    """Parameters that set the same number: two spellings of one, or a number of a chain and of the marker that it places."""
    placed: dict[Any, str] = {}
    out = []
    for name, field in fields.items():
        mine: list[Any] = [("load", field.index, field.name, field.component)] if isinstance(field, LoadField) else []
        if isinstance(field, ItemField):
            mine = [(field.what, field.index, field.path, field.place)]
        if isinstance(field, ChainField):
            mine = [("chain", field.kind, field.index)]
        if isinstance(field, Field):
            mine = [(field.array, str(field.places[0]))]
            sides = (0, 1) if field.places[0][0] == slice(None) else (field.places[0][0],)
            if field.array in MARKER:
                mine += [("marker", side, field.places[0][2]) for side in sides]
        elif isinstance(field, ChainField):
            mine.append(("marker", *chain_marker(m, field)))
        for key in mine:
            other = placed.setdefault(key, name)
            kinds = {isinstance(fields[other], ChainField), isinstance(field, ChainField)}
            if other != name and (key[0] != "marker" or len(kinds) == 2):
                out.append(f"{name!r} and {other!r} set the same numbers; name one of them")
    return out


def _varied_load(load: Load, field: LoadField, row: Array) -> Load:
    old = getattr(load, field.name)
    values = row
    if field.component is not None:
        values = old.values.copy() if isinstance(old, PerCase) else np.tile(np.asarray(old, dtype=float), (len(row), 1))
        values[:, field.component] = row
    changes: dict[str, Any] = {field.name: PerCase(values)}
    return replace(load, **changes)


def stacked(m: Mechanism, mechanisms: Sequence[Mechanism | None]) -> Variants:
    """Variants from mechanisms of the topology of ``m``; those that are None or differ in more than numbers are ``missing``."""
    same = [other is not None and topology_of(other) == topology_of(m) and _alike(m, other) for other in mechanisms]
    used = [other if ok and other is not None else m for other, ok in zip(mechanisms, same, strict=True)]
    loads = tuple(_stacked_loads(group) for group in zip(*(other.loads for other in used), strict=True))
    missing = tuple(i for i, ok in enumerate(same) if not ok)
    before = [other.declared for other in used if isinstance(other, SnappedMechanism)]
    return Variants(m, side_by_side(used), loads, len(used), missing, side_by_side(before) if before else None)


def side_by_side(mechanisms: Sequence[Mechanism]) -> Declared:
    """The declared numbers of mechanisms as one batch."""
    every = [declared(m) for m in mechanisms]
    return Declared(
        **{f.name: np.concatenate([getattr(n, f.name) for n in every], axis=-1) for f in dataclasses.fields(Declared)}
    )


def topology_of(m: Mechanism) -> tuple[Any, ...]:
    """What variants must share: names, types and ends of pairs, the way they are placed, couplings, drives, kinds of loads, units."""
    return (
        tuple(sorted(m.units.items())),
        m.link_names(),
        m.frame,
        tuple((p.name, p.type if p.contact is None else p.type.symbol, p.a, p.b, p.on_a is None) for p in m.pairs),
        tuple((c.name, c.freedoms, c.constant is None) for c in m.couplings),
        tuple(d.freedom for d in m.drives),
        tuple(
            (load.kind, *(v for f in dataclasses.fields(load) if isinstance(v := getattr(load, f.name), str)))
            for load in m.loads
        ),
        tuple(link.center is None for link in m.links),
        tuple(link.inertia is None for link in m.links),
    )


def _alike(m: Mechanism, other: Mechanism) -> bool:
    """Whether start, stored motions, named points, and all of the loads that is no number are the same, so that only numbers differ."""
    points = [[link.points for link in one.links] for one in (m, other)]
    if dict(m.start) != dict(other.start) or m.drives != other.drives or points[0] != points[1]:
        return False
    kept = [
        [(p.type, p.closed, p.radius, p.hertz, p.film, p.stiffness, p.misfit) for p in one.pairs] for one in (m, other)
    ]
    along = [
        [(c, c.ends, c.numbers, c.longer, c.terms) for c in one.couplings if isinstance(c, LineCoupling)]
        for one in (m, other)
    ]
    if kept[0] != kept[1] or along[0] != along[1]:
        return False
    if _rubbing_teeth(m) and (m.pairs != other.pairs or m.couplings != other.couplings):
        return False
    for one, two in zip(m.loads, other.loads, strict=True):
        for f in dataclasses.fields(one):
            a, b = getattr(one, f.name), getattr(two, f.name)
            if a != b and not (is_numeric(a, np.shape(a)) and is_numeric(b, np.shape(a)) and np.ndim(a) <= 1):
                return False
    return True


def _stacked_loads(loads: Sequence[Load]) -> Load:
    changes: dict[str, Any] = {}
    for f in dataclasses.fields(loads[0]):
        values = [getattr(load, f.name) for load in loads]
        if any(v != values[0] for v in values):
            changes[f.name] = PerCase(np.array(values, dtype=float))
    return replace(loads[0], **changes)
