"""The mechanism: links, pairs, drives and loads. The only model; everything else is derived from it."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from mechgraph.errors import DeclarationError
from mechgraph.model.connection import Marker, Pair
from mechgraph.model.conversion import UNIT_NAMES, converted
from mechgraph.model.drive import Drive
from mechgraph.model.link import Link
from mechgraph.model.load import LOADS, Effort, Load, TorsionSpring
from mechgraph.model.pair import PairType
from mechgraph.model.values import is_numeric, plain, same_fields


@dataclass(frozen=True, eq=False)
class Mechanism:
    """A mechanism: a graph whose nodes are links and whose edges are kinematic pairs.

    Parameters
    ----------
    name : for messages and reports.
    links : the first is the frame unless ``frame`` names another; left out, links are inferred from the pairs, massless.
    pairs, drives, loads : see ``Pair``, ``Drive`` (a name alone will do) and the loads.
    start : pair coordinates near which to assemble, freedom -> value; picks the branch.
    units : names of the units of ``length``, ``mass`` and ``time`` in which the numbers are declared (a consistent set).
    source, description, expected : where it comes from, what it is, and facts that a test checks.

    Raises
    ------
    DeclarationError
        with all faults at once.
    """

    name: str
    links: tuple[Link, ...]
    pairs: tuple[Pair, ...]
    drives: tuple[Drive, ...]
    loads: tuple[Load, ...]
    frame: str
    start: Mapping[str, float]
    units: Mapping[str, str]
    source: str
    description: str
    expected: Mapping[str, Any]

    def __init__(
        self,
        name: str,
        links: Iterable[Link] | None = None,
        pairs: Iterable[Pair] = (),
        drives: Iterable[Drive | str] = (),
        loads: Iterable[Load] = (),
        *,
        frame: str | None = None,
        start: Mapping[str, Any] | None = None,
        units: Mapping[str, str] | None = None,
        source: str = "",
        description: str = "",
        expected: Mapping[str, Any] | None = None,
    ) -> None:
        pair_tuple = tuple(pairs)
        ends = dict.fromkeys(
            end for p in pair_tuple if isinstance(p, Pair) for end in (p.a, p.b) if isinstance(end, str)
        )
        link_tuple = tuple(links) if links is not None else tuple(Link(end) for end in ends)
        first = next((link.name for link in link_tuple if isinstance(link, Link)), "")
        fields: dict[str, Any] = {
            "name": name,
            "links": link_tuple,
            "pairs": pair_tuple,
            "drives": tuple(Drive(d) if isinstance(d, str) else d for d in drives),
            "loads": tuple(loads),
            "frame": first if frame is None else frame,
            "start": MappingProxyType({}),
            "units": MappingProxyType(dict(units) if isinstance(units, Mapping) else {}),
            "source": source,
            "description": description,
            "expected": MappingProxyType(dict(expected) if isinstance(expected, Mapping) else {}),
        }
        for key, value in fields.items():
            object.__setattr__(self, key, value)
        faults = _declaration_faults(self)
        for what, value in (("units", units), ("start", start), ("expected", expected)):
            if value is not None and not isinstance(value, Mapping):
                faults.append(f"{what} = {value!r}: expected a mapping")
        flat: dict[str, float] = {}
        if all(isinstance(p, Pair) for p in pair_tuple):
            flat, start_faults = _flat_start(self, start if isinstance(start, Mapping) else {})
            faults += start_faults
        if faults:
            raise DeclarationError(f"mechanism {name!r}", faults)
        object.__setattr__(self, "start", MappingProxyType(flat))

    def __eq__(self, other: object) -> bool:
        return same_fields(self, other)

    def __hash__(self) -> int:
        return hash((self.name, tuple(p.name for p in self.pairs)))

    def __repr__(self) -> str:
        return f"Mechanism({self.name!r}, {len(self.links)} links, {len(self.pairs)} pairs)"

    def __reduce__(self) -> tuple[Callable[..., Mechanism], tuple[dict[str, Any]]]:
        return _rebuilt, (self._arguments(),)

    def _arguments(self) -> dict[str, Any]:
        out = {k: getattr(self, k) for k in self.__dataclass_fields__}
        return {k: dict(v) if isinstance(v, Mapping) else v for k, v in out.items()}

    # --- names -----------------------------------------------------------------------------------------------------

    def link_names(self) -> tuple[str, ...]:
        """Names of the links, in order."""
        return tuple(link.name for link in self.links)

    def massive_links(self) -> tuple[str, ...]:
        """Names of the links that have mass."""
        return tuple(link.name for link in self.links if link.mass > 0)

    def ends_of(self, freedom: str) -> tuple[str, str]:
        """Links a and b of the pair of a freedom."""
        pair = self.pairs[self.freedom(freedom)[0]]
        return pair.a, pair.b

    def link(self, name: str) -> Link:
        """The link of that name."""
        return self.links[self._index(name, self.link_names(), "link")]

    def pair(self, name: str) -> Pair:
        """The pair of that name."""
        return self.pairs[self._index(name, tuple(p.name for p in self.pairs), "pair")]

    def _index(self, name: str, names: Sequence[str], what: str) -> int:
        if name not in names:
            raise DeclarationError(
                f"mechanism {self.name!r}", [f"unknown {what} {name!r} ({what}s: {', '.join(names)})"]
            )
        return names.index(name)

    def freedom_names(self) -> tuple[str, ...]:
        """Full names of all freedoms, ``"B.Tz"``, in the order of the pairs."""
        return tuple(name for pair in self.pairs for name in pair.freedom_names)

    def freedom_fault(self, name: Any, *, single: bool) -> str | None:
        """Why ``name`` is no freedom (with ``single``: none that takes a drive), or None."""
        found = self._find_freedom(name)
        if isinstance(found, str):
            return found
        pair, j = found
        if single and not pair.type.drivable[j]:
            return f"freedom {name!r} is part of a rotation; it takes an effort, not a drive, a start angle or a spring"
        return None

    def freedom(self, name: str) -> tuple[int, int]:
        """Index of the pair and of the freedom within it, for ``"B.Tz"`` or ``"B"`` (one freedom, or one driven)."""
        found = self._find_freedom(name)
        if isinstance(found, str):
            raise DeclarationError(f"mechanism {self.name!r}", [found])
        return self.pairs.index(found[0]), found[1]

    def full_name(self, name: str) -> str:
        """The full spelling ``"B.Tz"`` of a freedom."""
        k, j = self.freedom(name)
        return self.pairs[k].freedom_names[j]

    def _find_freedom(self, name: Any) -> tuple[Pair, int] | str:
        if not isinstance(name, str):
            return f"freedom {name!r}: expected a name such as 'B' or 'B.Tz'"
        for pair in self.pairs:
            names = pair.freedom_names
            if name in names:
                return pair, names.index(name)
            if name != pair.name:
                continue
            if not isinstance(pair.type, PairType):
                return f"pair {name!r} has an unknown type"
            if len(names) == 1:
                return pair, 0
            driven = [d.freedom for d in self.drives if d.freedom in names]
            if len(driven) == 1:
                return pair, names.index(driven[0])
            if not names:
                return f"pair {name!r} ({pair.type.symbol}) has no freedom"
            able = [n for n, single in zip(names, pair.type.drivable, strict=True) if single]
            hint = f"; a drive or spring can take {', '.join(able) or 'none of them (a rotation takes efforts only)'}"
            return f"pair {name!r} has {len(names)} freedoms; name one of {', '.join(names)}" + (
                hint if len(able) < len(names) else ""
            )
        return f"unknown freedom {name!r} (freedoms: {', '.join(self.freedom_names())})"

    @property
    def has_geometry(self) -> bool:
        """Whether every pair says where it sits (otherwise: a topology, which can be counted, not solved)."""
        return all(pair.has_geometry for pair in self.pairs)

    # --- changed copies ----------------------------------------------------------------------------------------------

    def replace(self, **changes: Any) -> Mechanism:
        """A copy with the named fields changed, checked again."""
        unknown = set(changes) - set(self.__dataclass_fields__)
        if unknown:
            raise DeclarationError(
                f"mechanism {self.name!r}", [f"replace: unknown field {k!r}" for k in sorted(unknown)]
            )
        return Mechanism(**{**self._arguments(), **changes})

    def with_pair_type(self, pair: str, type: str | PairType, *, pitch: float | None = None) -> Mechanism:
        """A copy in which one pair has another type, at the same markers; drives that it cannot take are dropped."""
        old = self.pair(pair)
        new = Pair(
            old.name,
            type,
            old.a,
            old.b,
            point=old.point,
            axis=old.axis,
            second=old.second,
            on_a=old.on_a,
            on_b=old.on_b,
        )
        if not isinstance(new.type, PairType):
            raise DeclarationError(f"mechanism {self.name!r}", new.faults())
        if new.type.takes_pitch:
            kept = {"pitch": old.pitch, "lead": old.lead} if pitch is None else {"pitch": pitch}
            new = new.replace(**kept)
        gone = set(old.freedom_names) - set(new.freedom_names)
        able = {n for n, single in zip(new.freedom_names, new.type.drivable, strict=True) if single}
        lost = set(old.freedom_names) - able
        drives = [
            dataclasses.replace(d, freedom=name) for d in self.drives if (name := self.full_name(d.freedom)) not in lost
        ]
        loads = [
            dataclasses.replace(load, freedom=self.full_name(load.freedom))
            if isinstance(load, Effort | TorsionSpring)
            else load
            for load in self.loads
        ]
        start = {k: v for k, v in self.start.items() if k not in gone}
        pairs = [new if p.name == pair else p for p in self.pairs]
        return self.replace(pairs=pairs, drives=drives, loads=loads, start=start)

    def to_units(self, **units: str) -> Mechanism:
        """The same mechanism in other units, e.g. ``m.to_units(length="mm", mass="g")`` (``units`` extra).

        Needs the present units declared.
        """
        return converted(self, units)

    def moved(self, pose: Any) -> Mechanism:
        """The whole mechanism after a rigid motion: a 4 x 4 (or 3 x 4) pose. Coordinates of the pairs stay what they are."""
        given = np.asarray(pose, dtype=float) if is_numeric(pose, np.shape(pose)) else np.zeros(0)
        G = given[:3] if given.shape in ((4, 4), (3, 4)) else np.zeros((3, 4))
        R, p = G[:, :3], G[:, 3]
        if np.abs(R @ R.T - np.eye(3)).max() > 1e-9 or np.linalg.det(R) < 0:
            raise DeclarationError(f"mechanism {self.name!r}", ["moved: expected a 4 x 4 pose with a proper rotation"])

        def at(v: Any) -> Any:
            return None if v is None else plain(R @ np.asarray(v) + p)

        def turned(v: Any) -> Any:
            return None if v is None else plain(R @ np.asarray(v))

        def marker(m: Marker | None) -> Marker | None:
            return None if m is None else Marker(at(m.point), turned(m.axis), turned(m.second))

        links = [
            dataclasses.replace(
                link,
                center=at(link.center),
                inertia=None if link.inertia is None else plain(_symmetric(R @ np.asarray(link.inertia) @ R.T)),
            )
            for link in self.links
        ]
        pairs = [
            q.replace(
                point=at(q.point),
                axis=turned(q.axis),
                second=turned(q.second),
                on_a=marker(q.on_a),
                on_b=marker(q.on_b),
            )
            for q in self.pairs
        ]
        return self.replace(links=links, pairs=pairs, loads=[load.moved(G) for load in self.loads])


def _symmetric(A: Any) -> Any:
    return (A + A.T) / 2


def _rebuilt(arguments: dict[str, Any]) -> Mechanism:
    return Mechanism(**arguments)


def _repeated(names: Iterable[Any], what: str) -> list[str]:
    return [f"{what} {n!r} is declared {c} times; names must differ" for n, c in Counter(names).items() if c > 1]


def _declaration_faults(m: Mechanism) -> list[str]:
    faults = []
    for what, items, kind in (
        ("link", m.links, Link),
        ("pair", m.pairs, Pair),
        ("drive", m.drives, Drive),
        ("load", m.loads, tuple(LOADS.values())),
    ):
        wrong = [item for item in items if not isinstance(item, kind)]
        faults += [f"{what} {item!r}: is no {what}; use mg.{what.capitalize()}(...)" for item in wrong]
    if not isinstance(m.name, str) or not m.name:
        faults.append(f"name {m.name!r}: expected a text")
    if not m.pairs:
        faults.append("no pairs; a mechanism needs at least one pair")
    if faults:
        return faults
    names = m.link_names()
    for link in m.links:
        faults += link.faults()
    faults += _repeated(names, "link") + _repeated([p.name for p in m.pairs], "pair")
    for pair in m.pairs:
        faults += pair.faults()
        for end in (pair.a, pair.b):
            if end is None:
                faults.append(f"pair {pair.name!r}: is on one link only; name both links")
            elif end not in names:
                faults.append(f"pair {pair.name!r}: link {end!r} is not declared (links: {', '.join(map(str, names))})")
    if m.frame not in names:
        faults.append(f"frame {m.frame!r}: is no link (links: {', '.join(map(str, names))})")
    for key, value in m.units.items():
        if key not in UNIT_NAMES or not isinstance(value, str) or not value:
            faults.append(f"units: {key} = {value!r}: expected names for {', '.join(UNIT_NAMES)}")
    by_symbol: dict[str, PairType] = {}
    for pair in m.pairs:
        if isinstance(pair.type, PairType) and by_symbol.setdefault(pair.type.symbol, pair.type) != pair.type:
            faults.append(
                f"pair {pair.name!r}: its type shares the symbol {pair.type.symbol!r} with another type; rename one"
            )
    ends = {end for pair in m.pairs for end in (pair.a, pair.b)}
    if m.frame in names and ends <= set(names):
        faults += _connection_faults(m)
    return faults + _reference_faults(m)


def _connection_faults(m: Mechanism) -> list[str]:
    near: dict[str, list[str]] = {name: [] for name in m.link_names()}
    for p in m.pairs:
        near[p.a].append(p.b)
        near[p.b].append(p.a)
    reached, ahead = {m.frame}, [m.frame]
    while ahead:
        new = set(near[ahead.pop()]) - reached
        reached |= new
        ahead += new
    return [
        f"link {name!r} is not connected to the frame {m.frame!r} by any chain of pairs; add the pair that holds it"
        for name in m.link_names()
        if name not in reached
    ]


def _reference_faults(m: Mechanism) -> list[str]:
    faults = []
    drives = []
    for drive in m.drives:
        fault = m.freedom_fault(drive.freedom, single=True)
        if fault:
            faults.append(f"drive {drive.freedom!r}: {fault}")
        else:
            drives.append(m.full_name(drive.freedom))
    faults += _repeated(drives, "drive")
    for load in m.loads:
        faults += load.faults(m)
    return faults


def _flat_start(m: Mechanism, start: Mapping[str, Any]) -> tuple[dict[str, float], list[str]]:
    """Start values by full freedom name; a pair's name may carry one value for each of its freedoms."""
    flat: dict[str, float] = {}
    faults = []
    for key, value in start.items():
        pair = next((p for p in m.pairs if p.name == key), None)
        many = len(pair.freedom_names) if pair is not None else 0
        if pair is not None and many > 1 and is_numeric(value, (many,)):
            flat.update(zip(pair.freedom_names, map(float, value), strict=True))
            continue
        fault = m.freedom_fault(key, single=False)
        if fault or not is_numeric(value, ()):
            faults.append(f"start {key!r} = {value!r}: {fault or 'expected a finite number'}")
        else:
            flat[m.full_name(key)] = float(value)
    return flat, faults
