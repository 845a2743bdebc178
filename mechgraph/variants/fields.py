"""Many variants of a mechanism as one set of arrays; how their numbers are named, ``number_names`` says."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.inertia import physical
from mechgraph.algebra.se3 import Array
from mechgraph.determinacy.snapping import SnappedMechanism
from mechgraph.errors import DeclarationError
from mechgraph.fields import PerCase
from mechgraph.model.chain import chain_numbers, markers_of_chain
from mechgraph.model.loads import Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Marker, Pair
from mechgraph.model.parameters import Declared, coupling_places, declared
from mechgraph.quantities import is_numeric
from mechgraph.variants.number_names import MARKER, AnyField, ChainField, Field, ItemField, LoadField, find_field

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
        lists: dict[str, list[Any]] = {"links": links, "pairs": pairs, "couplings": couplings}
        for field, values in self.own:
            items = lists[field.what]
            items[field.index] = field.changed(items[field.index], float(values[i]))
        return m.replace(links=links, pairs=pairs, couplings=couplings, loads=loads)


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
    numbers, chained = declared(m), chain_numbers(m)
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
    placed = any(
        isinstance(field, ChainField) or (isinstance(field, Field) and field.array in MARKER) for field, _ in rows
    )
    if not own:
        return made
    if placed or any(field.one_by_one for field, _ in own):
        return replace(made, missing=tuple(range(count)))
    return _with_gears(made)


def _with_gears(of: Variants) -> Variants:
    """Variants with the gears that each has; those with faults are missing."""
    n, m = of.numbers, of.mechanism
    items: Any = np.repeat(n.items, of.count // n.items.shape[1], axis=1)
    coefficients: Array = np.repeat(n.couplings, of.count // n.couplings.shape[1], axis=1)
    missing = []
    for i in range(of.count):
        changed = list(m.couplings)
        for field, values in of.own:
            changed[field.index] = field.changed(changed[field.index], float(values[i]))
        try:
            items[:, i] = m.replace(couplings=changed).couplings
        except DeclarationError:
            missing.append(i)
            continue
        for g in {field.index for field, _ in of.own}:
            coefficients[coupling_places(m)[g], i] = items[g, i].coefficients
    return replace(of, numbers=replace(n, items=items, couplings=coefficients), missing=tuple(missing))


def _chain_markers(
    m: Mechanism, arrays: Mapping[str, Array], chained: Sequence[tuple[ChainField, Array]], count: int
) -> dict[str, Array]:
    """Point, axis and second directions of a chain some of whose numbers vary; other markers stay unchanged."""
    start = chain_numbers(m)
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
    return Variants(m, _side_by_side(used), loads, len(used), missing, _side_by_side(before) if before else None)


def _side_by_side(mechanisms: Sequence[Mechanism]) -> Declared:
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
    kept = [[(p.type, p.closed, p.radius, p.hertz) for p in one.pairs] for one in (m, other)]
    if kept[0] != kept[1]:
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
