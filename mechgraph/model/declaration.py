"""What a mechanism consists of, all of it by name, and the faults of a declaration, all at once.

Links and pairs are checked in whole columns (one array of masses, of points, of axes, ...). Only where a column fails are they gone
through one by one, to say in words what is wrong with which.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from functools import cached_property
from itertools import repeat
from math import isfinite
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.errors import DeclarationError
from mechgraph.fields import (
    BY_FREEDOM,
    FACTS,
    FLAG,
    NUMBER,
    TABLE,
    TABLES,
    TEXT,
    Formatted,
    same,
    sound_tol,
    tolerance_fault,
)
from mechgraph.maths.inertia import physical
from mechgraph.maths.se3 import IN_PLANE, IN_SPACE
from mechgraph.memo import Once, dataclass, of_graph
from mechgraph.model.couplings import BaseCoupling, fitting_of
from mechgraph.model.friction import LOADS
from mechgraph.model.gears import GEARS, gear_faults
from mechgraph.model.loads import Load
from mechgraph.model.motion import Drive
from mechgraph.model.pair import NO_POINTS, Link, Pair, are_names, pairs_are_sound, types_of
from mechgraph.model.setups import ResponseSetup, SynthesisSetup
from mechgraph.pairs.contact_types import travels
from mechgraph.pairs.pair_type import PairType
from mechgraph.quantities import (
    BASE_UNITS,
    LENGTH,
    PURE,
    column,
    is_numeric,
    items_of,
    repeated,
    shown,
    unknown,
    without_units,
    wrong,
)

START = {
    "type": "object",
    "additionalProperties": {"anyOf": [{"type": "number"}, {"type": "array", "items": {"type": "number"}}]},
}
"""JSON Schema of start values."""


@dataclass(frozen=True)
class Parts:
    """Links, pairs, couplings and loads for ``Mechanism(parts=[...])``; parts are added with ``+``.

    Parameters
    ----------
    links : tuple of Link
        Links that the part brings; it may name others.
    pairs : tuple of Pair
        Its pairs.
    gears : tuple of gear
        Its gears and pulleys.
    couplings : tuple of Coupling
        Its couplings.
    loads : tuple of load
        Its loads.

    Examples
    --------
    >>> import mechgraph as mg
    >>> part = mg.parts.Parts(pairs=(mg.Pair("A", "R", "frame", "arm", point=(0, 0, 0), axis=(0, 0, 1)),))
    >>> mg.Mechanism("pendulum", parts=[part]).link_names()
    ('frame', 'arm')
    """

    links: tuple[Link, ...] = ()
    pairs: tuple[Pair, ...] = ()
    gears: tuple[Any, ...] = ()
    couplings: tuple[BaseCoupling, ...] = ()
    loads: tuple[Load, ...] = ()

    def __add__(self, other: Parts) -> Parts:
        if not isinstance(other, Parts):
            return NotImplemented
        return Parts(*((*getattr(self, f.name), *getattr(other, f.name)) for f in fields(Parts)))

    @classmethod
    def joined(cls, given: Any, faults: list[str]) -> Parts:
        """All parts of a list as one; what is none of them is told in ``faults``."""
        out = cls()
        for one in items_of(given, "parts", faults):
            if isinstance(one, Parts):
                out += one
            else:
                faults.append(wrong(one, "parts", "a list of what mg.parts makes, such as mg.parts.rod(...)"))
        return out

    def links_with(self, pairs: Iterable[Any]) -> tuple[Any, ...]:
        """The links that pairs name, each once, in order: its own, massless ones for the others; then the rest of its own."""
        known = {link.name: link for link in self.links if isinstance(link, Link) and isinstance(link.name, str)}
        ends = (end for p in pairs if isinstance(p, Pair) for end in (p.a, p.b))
        named = {end: known.get(end) or Link(end) for end in ends if isinstance(end, str)}
        used = set(map(id, named.values()))
        return (*named.values(), *(link for link in self.links if id(link) not in used))


@dataclass(frozen=True, eq=False, init=False)
class DeclaredParts(Formatted, Once):
    """The fields of a mechanism (see ``Mechanism``), and its links, pairs, couplings and freedoms by name.

    Nothing is checked here: what is looked up may still be what a user declared wrongly.
    """

    name: Annotated[str, TEXT("name of the mechanism")]
    description: Annotated[str, TEXT("what it is", default="empty")]
    source: Annotated[str, TEXT("where it comes from", default="empty")]
    frame: Annotated[str, TEXT("the frame link", default="first link")]
    units: Annotated[Mapping[str, str], TABLE("names of the units of the numbers", table="units", default="no names")]
    tol: Annotated[
        float | None,
        NUMBER(
            "accuracy to which directions (radians) and distances (over L, the mean radius) are meant, as `tol=` of a call",
            default="exact",
        ),
    ]
    planar: Annotated[
        bool, FLAG("whether it moves in the x-y plane alone, and everything is counted there", default="false")
    ]
    links: Annotated[
        tuple[Link, ...], TABLES("links; left out, they follow from the pairs, massless", key="link", table="link")
    ]
    pairs: Annotated[tuple[Pair, ...], TABLES("pairs", key="pair", table="pair")]
    couplings: Annotated[
        tuple[BaseCoupling, ...],
        TABLES("linear relations between freedoms", key="coupling", table="coupling", default="none"),
    ]
    gears: Annotated[
        tuple[Any, ...], TABLES("gears and pulleys, as places on links", key="gear", table="gear", default="none")
    ]
    drives: Annotated[tuple[Drive, ...], TABLES("driven freedoms", key="drive", table="drive", default="none")]
    loads: Annotated[tuple[Load, ...], TABLES("loads", key="load", table="load", default="none")]
    start: Annotated[
        Mapping[str, float],
        BY_FREEDOM(
            "pair coordinates near which to assemble, freedom → number, or pair → one number a freedom; "
            "degrees with `_deg` added to the name",
            default="all 0",
            rules=START,
        ),
    ]
    response: Annotated[
        ResponseSetup | None,
        TABLE("what `respond` takes where it is given nothing else", table="response", default="none"),
    ]
    synthesis: Annotated[
        SynthesisSetup | None,
        TABLE("what `synthesize` takes where it is given nothing else", table="synthesis", default="none"),
    ]
    expected: Annotated[Mapping[str, Any], FACTS("facts that a test checks; any names", default="empty")]

    def leaving_the_plane(self, loads_alone: bool = False) -> list[str]:
        """What of a planar mechanism leaves its plane, one line each; of these parts nothing is known of one."""
        return []

    @property
    def span(self) -> slice:
        """The components of twists and wrenches in which it moves and is in balance: all six, or Rz Tx Ty (Mz Fx Fy)."""
        return IN_PLANE if self.planar else IN_SPACE

    @property
    def axes(self) -> str:
        """Letters of the global directions in which it moves, ``"xyz"`` or ``"xy"``."""
        return "xy" if self.planar else "xyz"

    def link_names(self) -> tuple[str, ...]:
        """Names of the links, in order."""
        return tuple([link.name for link in self.links])

    def massive_links(self) -> tuple[str, ...]:
        """Names of the links that have mass."""
        return tuple(link.name for link in self.links if link.mass > 0)

    def ends_of(self, freedom: str) -> tuple[str, str]:
        """Links a and b of the pair of a freedom."""
        pair = self.pairs[self.freedom(freedom)[0]]
        return pair.a, pair.b

    @cached_property
    def link_index(self) -> Mapping[str, int]:
        """Place of every link, by name."""
        return MappingProxyType(_places(link.name for link in self.links))

    @cached_property
    def pair_index(self) -> Mapping[str, int]:
        """Place of every pair, by name."""
        return MappingProxyType(_places(pair.name for pair in self.pairs))

    @cached_property
    def gear_index(self) -> Mapping[str, int]:
        """Place of every gear and pulley, by name."""
        return MappingProxyType(_places(gear.name for gear in self.gears))

    @cached_property
    def pair_ends(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Indices of the links a and b of every pair, ``(P,)`` each; -1 for what is no link."""
        place = self.link_index.get
        a, b = (
            np.fromiter(map(place, _hashed(ends), repeat(-1)), np.intp, len(ends))
            for ends in ([pair.a for pair in self.pairs], [pair.b for pair in self.pairs])
        )
        return a, b

    def _place_of_named(self, name: str) -> int | None:
        """Place of the first pair that answers to a name, its own or that of one of its freedoms."""
        places = [self.pair_index[name]] if name in self.pair_index else []
        for i, letter in enumerate(name):
            k = self.pair_index.get(name[:i]) if letter == "." else None
            if k is not None and name in self.pairs[k].freedom_names:
                places.append(k)
        return min(places, default=None)

    def link(self, name: str) -> Link:
        """The link of that name."""
        return self.links[self.place_of_link(name)]

    def pair(self, name: str) -> Pair:
        """The pair of that name."""
        return self.pairs[self.place_of_pair(name)]

    def gear(self, name: str) -> Any:
        """The gear or pulley of that name."""
        return self.gears[self._index(name, self.gear_index, "gear")]

    def coupling(self, name: str) -> BaseCoupling:
        """The coupling of that name."""
        belts = dict.fromkeys(c.part_of for c in self.couplings if c.part_of)
        return self.couplings[self._index(name, _places(c.name for c in self.couplings), "coupling", belts)]

    def place_of_link(self, name: str) -> int:
        """Index of the link of that name."""
        return self._index(name, self.link_index, "link")

    def place_of_pair(self, name: str) -> int:
        """Index of the pair of that name."""
        return self._index(name, self.pair_index, "pair")

    def _index(self, name: str, places: Mapping[str, int], what: str, also: Iterable[str] = ()) -> int:
        if not isinstance(name, str) or name not in places:
            raise DeclarationError(f"mechanism {self.name!r}", [unknown(what, name, (*also, *places))])
        return places[name]

    def freedom_names(self) -> tuple[str, ...]:
        """Full names of all freedoms, ``"B.Tz"``, in the order of the pairs."""
        return tuple(name for pair in self.pairs for name in pair.freedom_names)

    def freedom_fault(self, name: Any, *, single: bool) -> str | None:
        """Why ``name`` is no freedom (with ``single``: none that takes a drive), or None."""
        found = self._find_freedom(name)
        if isinstance(found, str):
            return found
        k, j = found
        if single and not self.pairs[k].type.drivable[j]:
            return (
                f"freedom {name!r} is part of a rotation; it takes an effort, not a drive, a start angle or a spring (a pair 'Fr' "
                "beside it, between the same links, has a turn Rz that takes all of these)"
            )
        return None

    def freedom(self, name: str) -> tuple[int, int]:
        """Index of the pair and of the freedom within it, for ``"B.Tz"`` or ``"B"`` (one freedom, or one driven)."""
        found = self._find_freedom(name)
        if isinstance(found, str):
            raise DeclarationError(f"mechanism {self.name!r}", [found])
        return found

    def turns(self, freedom: Any) -> bool:
        """Whether the coordinate of a freedom is an angle; False for what is no freedom."""
        found = self._find_freedom(freedom)
        return not isinstance(found, str) and self.pairs[found[0]].type.freedoms[found[1]].turns

    def period(self, freedom: str) -> float:
        """By how much the coordinate of a freedom grows until it is back: a turn, the length of a closed curve, or infinite."""
        pair, number = self.freedom(freedom)
        return [period for step in self.pairs[pair].type.steps for period in step.periods][number]

    def in_own_units(self, freedom: str, value: Any) -> Any:
        """A coordinate given as a quantity of pint as a plain number in the declared units; unchanged where it does not fit."""
        return without_units(value, PURE if self.turns(freedom) else LENGTH, self.units)

    def full_name(self, name: str) -> str:
        """The full spelling ``"B.Tz"`` of a freedom."""
        k, j = self.freedom(name)
        return self.pairs[k].freedom_names[j]

    def _find_freedom(self, name: Any) -> tuple[int, int] | str:
        """Index of the pair and of the freedom within it, or why there is none."""
        if not isinstance(name, str):
            return f"freedom {shown(name)}: expected a name such as 'B' or 'B.Tz'"
        known = vars(self).setdefault("_places_of_freedoms", {})
        found = known.get(name) or self._search_freedom(name)
        if not isinstance(found, str):
            known[name] = found
        return found

    def _search_freedom(self, name: str) -> tuple[int, int] | str:
        """The same for a name that is sought the first time."""
        k = self._place_of_named(name)
        if k is None:
            return unknown("freedom", name, self.freedom_names(), (*self.pair_index, *self.link_index))
        pair = self.pairs[k]
        names = pair.freedom_names
        if name in names:
            return k, names.index(name)
        if not isinstance(pair.type, PairType):
            return f"pair {name!r} has an unknown type"
        if len(names) == 1:
            return k, 0
        driven = [d.freedom for d in self.drives if d.freedom in names]
        if len(driven) == 1:
            return k, names.index(driven[0])
        if not names:
            return f"pair {name!r} ({pair.type.symbol}) has no freedom"
        able = [n for n, single in zip(names, pair.type.drivable, strict=True) if single]
        hint = f"; a drive or spring can take {', '.join(able) or 'none of them (a rotation takes efforts only)'}"
        return f"pair {name!r} has {len(names)} freedoms; name one of {', '.join(names)}" + (
            hint if len(able) < len(names) else ""
        )

    @cached_property
    def has_geometry(self) -> bool:
        """Whether every pair says where it sits (otherwise: a topology, which can be counted, not solved)."""
        return all(pair.has_geometry for pair in self.pairs)


def _hashed(names: list[Any]) -> list[Any]:
    """Names, with None for what is no text."""
    return names if set(map(type, names)) <= {str} else [name if isinstance(name, str) else None for name in names]


def _places(names: Iterable[Any]) -> dict[Any, int]:
    """Name -> its first place; what is no name has none."""
    out: dict[Any, int] = {}
    for i, name in enumerate(names):
        if isinstance(name, str):
            out.setdefault(name, i)
    return out


def _kind_faults(m: DeclaredParts) -> list[str]:
    """Items that are no links, pairs, couplings, drives or loads at all."""
    faults = []
    for what, items, kind in (
        ("link", m.links, (Link,)),
        ("pair", m.pairs, (Pair,)),
        ("coupling", m.couplings, (BaseCoupling,)),
        ("gear", m.gears, tuple(GEARS.values())),
        ("drive", m.drives, (Drive,)),
        ("load", m.loads, tuple(LOADS.values())),
    ):
        if set(map(type, items)) <= set(kind):
            continue
        strange = [item for item in items if not isinstance(item, kind)]
        faults += [f"{what} {shown(item)}: is not a {what}; use {_maker(what)}" for item in strange]
    return faults


def _maker(what: str) -> str:
    """How one makes an item of that kind."""
    kinds: Mapping[str, type[Any]] | None = LOADS if what == "load" else GEARS if what == "gear" else None
    names = [what.capitalize()] if kinds is None else [kind.__name__ for kind in kinds.values()]
    return " or ".join(f"mg.{name}(...)" for name in names)


def declaration_faults(m: DeclaredParts) -> list[str]:
    """All that is wrong with a mechanism, one line each."""
    faults = _kind_faults(m)
    if not isinstance(m.name, str) or not m.name:
        faults.append(wrong(m.name, "name", "a text"))
    if not m.pairs:
        faults.append("no pairs; a mechanism needs at least one pair")
    if faults:
        return faults
    before = vars(m).get("_changed_from")  # what is sound of that mechanism is so in this one
    if (links := _others(m.links, before and before.links)) and not _links_are_sound(links):
        faults += [fault for link in links for fault in link.faults()]
    plain = (m.formats[what].fault(getattr(m, what), what) for what in ("planar", "source", "description"))
    faults += filter(None, plain)
    if m.planar is True:
        faults += m.leaving_the_plane()
    names, pair_names = _texts(m.link_names()), _texts([pair.name for pair in m.pairs])
    faults += repeated(names, "link") + repeated(pair_names, "pair")
    tol = sound_tol(m.tol)
    pairs = _others(m.pairs, before and before.pairs if before and before.tol == m.tol else ())
    if pairs and not pairs_are_sound(pairs, tol):
        faults += [fault for pair in pairs for fault in pair.faults(tol)]
    faults += _end_faults(m, names)
    faults += [f"units: {unknown('base unit', key, BASE_UNITS)}" for key in m.units if key not in BASE_UNITS]
    faults += [
        wrong(value, f"units: {key}", "the name of a unit")
        for key, value in m.units.items()
        if key in BASE_UNITS and not (isinstance(value, str) and value)
    ]
    if m.tol is not None:
        faults += filter(None, [tolerance_fault(m.tol)])
    return faults + _symbol_faults(m) + _reference_faults(m) + m.once(gear_faults) + _coupling_faults(m)


def _others(items: Sequence[Any], known: Iterable[Any] | None) -> list[Any]:
    """The items that are not among the known ones."""
    places = set(map(id, known or ()))
    return [one for one in items if id(one) not in places]


def mapping_faults(**given: Any) -> list[str]:
    """Arguments that should be mappings and are not."""
    return [
        wrong(value, what, "a mapping")
        for what, value in given.items()
        if value is not None and not isinstance(value, Mapping)
    ]


def _end_faults(m: DeclaredParts, names: Sequence[str]) -> list[str]:
    """Ends of pairs and the frame that are no links; links that no pairs connect to the frame."""
    known = m.link_index
    faults = []
    all_known = bool((np.concatenate(m.pair_ends) >= 0).all())
    for pair in () if all_known else m.pairs:
        for end in (pair.a, pair.b):
            if end is None:
                faults.append(f"pair {pair.name!r}: is on one link only; name both links")
            elif isinstance(end, str) and end not in known:
                faults.append(f"pair {pair.name!r}: {unknown('link', end, names)}")
    if not isinstance(m.frame, str) or m.frame not in known:
        faults.append(f"frame: {unknown('link', m.frame, names)}")
    elif all_known and len(names) == len(m.links):
        faults += m.once(_connection_faults)
    return faults


def _symbol_faults(m: DeclaredParts) -> list[str]:
    """Pair types that share a symbol and differ."""
    by_symbol: dict[str, PairType] = {}
    rows = [row for row in types_of(m.pairs) if isinstance(row, PairType) and not travels(row)]
    others = {id(row) for row in rows if by_symbol.setdefault(row.symbol, row) != row}
    return [
        f"pair {pair.name!r}: its type shares the symbol {pair.type.symbol!r} with another type; rename one"
        for pair in (m.pairs if others else ())
        if id(pair.type) in others
    ]


def _texts(names: Sequence[Any]) -> Sequence[str]:
    return names if set(map(type, names)) <= {str} else [name for name in names if isinstance(name, str)]


def _links_are_sound(links: Sequence[Link]) -> bool:
    """Whether every link passes, checked in columns; False where it takes a closer look."""
    if not are_names([link.name for link in links]) or {type(link.unphysical) for link in links} != {bool}:
        return False
    mass = column([link.mass for link in links], ())
    placed = [link.center for link in links if link.center is not None]
    if mass is None or (mass < 0).any() or column(placed, (3,)) is None:
        return False
    named = [link for link in links if link.points is not NO_POINTS and not same(link.points, {})]
    if any(link.faults() for link in named):
        return False
    if any(link.center is None and (link.mass > 0 or link.inertia is not None) for link in links):
        return False
    solid = [link for link in links if link.inertia is not None]
    tensors = column([link.inertia for link in solid], (3, 3))
    if tensors is None or any(link.mass == 0 for link in solid):
        return False
    A = np.moveaxis(tensors, 0, -1)
    meant = np.array([link.unphysical for link in solid], dtype=bool)
    apart, size = np.abs(A - A.swapaxes(0, 1)).max(axis=(0, 1)), np.abs(A).max(axis=(0, 1))
    symmetric = apart <= 1e-9 * size  # to rounding, as the fault of a link has it
    return bool((symmetric & physical(0.5 * (A + A.swapaxes(0, 1))) | meant).all())


def item_faults(m: DeclaredParts) -> list[str]:
    """Faults of drives and loads alone, for links, pairs and couplings that were checked before."""
    return _kind_faults(m) or (m.leaving_the_plane(loads_alone=True) if m.planar else []) + _reference_faults(m)


@of_graph
def _connection_faults(m: DeclaredParts) -> list[str]:
    place, n = m.link_index, len(m.links)
    graph = scipy.sparse.coo_array((np.ones(len(m.pairs), dtype=bool), m.pair_ends), shape=(n, n))
    _, part = scipy.sparse.csgraph.connected_components(graph, directed=False)
    names = m.link_names()
    return [
        f"link {names[i]!r} is not connected to the frame {m.frame!r}. Add the missing pair"
        for i in np.flatnonzero(part != part[place[m.frame]])
        if place[names[i]] == i
    ]


def _reference_faults(m: DeclaredParts) -> list[str]:
    faults = []
    drives = []
    for drive in m.drives:
        fault = m.freedom_fault(drive.freedom, single=True)
        if fault:
            faults.append(f"drive {shown(drive.freedom)}: {fault}")
        else:
            drives.append(m.full_name(drive.freedom))
            faults += drive.faults()
    faults += repeated(drives, "drive")
    for load in m.loads:
        faults += load.faults(m)
    if isinstance(m.response, ResponseSetup):
        faults += m.response.faults(m)
    elif m.response is not None:
        faults.append(wrong(m.response, "response", "an mg.ResponseSetup"))
    if isinstance(m.synthesis, SynthesisSetup):
        faults += m.synthesis.faults()
    elif m.synthesis is not None:
        faults.append(wrong(m.synthesis, "synthesis", "an mg.SynthesisSetup"))
    return faults


def _coupling_faults(m: DeclaredParts) -> list[str]:
    if m.once(gear_faults):
        return []
    own = [coupling.faults(m) for coupling in m.couplings]
    faults = [fault for found in own for fault in found]
    faults += _rim_faults([c for c, found in zip(m.couplings, own, strict=True) if not found], m)
    names = [c.name for c in m.couplings if isinstance(c.name, str) and c.name]
    shared = [name for name in dict.fromkeys(names) if name in m.pair_index]
    faults += [f"coupling {name!r}: a pair has that name; names must differ" for name in shared]
    return faults + repeated(names, "coupling")


def flat_start(m: DeclaredParts, start: Mapping[str, Any]) -> tuple[dict[str, float], list[str]]:
    """Start values by full freedom name; a pair's name may carry one value for each of its freedoms."""
    flat: dict[str, float] = {}
    faults, known = [], set(m.freedom_names())
    for key, given in start.items():
        if type(given) is float and isfinite(given) and key in known:
            flat[key] = given
            continue
        pair = m.pairs[m.pair_index[key]] if isinstance(key, str) and key in m.pair_index else None
        names: Sequence[str] = pair.freedom_names if pair is not None else ()
        several = isinstance(given, list | tuple) or (isinstance(given, np.ndarray) and given.ndim == 1)
        values: Sequence[Any] = given
        if not several or len(names) < 2 or len(given) != len(names):
            fault = m.freedom_fault(key, single=False)
            if fault:
                faults.append(f"start {shown(key)} = {shown(given)}: {fault}")
                continue
            names, values = (m.full_name(key),), (given,)
        for name, value in zip(names, values, strict=True):
            number = m.in_own_units(name, value)
            if is_numeric(number, ()):
                flat[name] = float(number)
            else:
                faults.append(wrong(number, f"start {name!r}", "a finite number"))
    return flat, faults


def _rim_faults(couplings: Iterable[BaseCoupling], m: Any) -> Iterator[str]:
    """Gears that would have two modules, because the distances of the axes ask for it, or two helices, among couplings without faults.

    The meshes of one rim are compared with the first that leaves the module to the axes: the time is proportional to their number.
    """
    rims: dict[tuple[str, float], list[tuple[Any, str, float]]] = {}
    for gears in couplings:
        for q, teeth, helix in gears.rims:
            rims.setdefault((m.full_name(q), teeth), []).append((gears, q, helix))
    for (_, teeth), meshes in rims.items():
        first = next((i for i, (gears, *_) in enumerate(meshes) if not gears.module), len(meshes))
        for i in range(len(meshes)) if first < len(meshes) else ():
            if i == first:
                continue
            (one, q, helix), (two, _, other) = (meshes[k] for k in sorted((i, first)))
            # radians by which the helix angles of one gear in two meshes may differ: more than
            # tolerances, less than another hand
            if abs(helix - other) > 0.02:
                yield (
                    f"couplings {one.name!r} and {two.name!r}: the {teeth:g} teeth on {q!r} would have the helix angle {helix:.7g} "
                    f"in one and {other:.7g} in the other (gear b has the opposite of helix_angle, in an internal pair the same); "
                    "change one, or give module= in both where the gear has two rims"
                )
            mine, yours = one.module_in(m), two.module_in(m)
            if abs(mine - yours) > fitting_of(m) * max(mine, yours):
                yield (
                    f"couplings {one.name!r} and {two.name!r}: the {teeth:g} teeth on {q!r} would have the module {mine:.7g} in one "
                    f"and {yours:.7g} in the other, as the distances of the axes ask for; change the teeth or the places, or give "
                    "module= in both where the gear has two rims"
                )
