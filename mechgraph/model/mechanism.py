"""The mechanism: links, pairs, couplings, drives and loads. The only model; everything else is derived from it.

Single-loop chains from pair letters, with or without twist, length and offset of every link.
"""

from __future__ import annotations

import dataclasses
import inspect
import itertools
import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mechgraph import methods
from mechgraph.document import LISTED, Block, Bullets, Document, Heading, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError, MechgraphWarning, counted
from mechgraph.fields import Described, plain, same_fields
from mechgraph.maths.se3 import Array, identity, inverse
from mechgraph.maths.tolerances import Tolerances
from mechgraph.memo import carried, dataclass, under
from mechgraph.model.couplings import BaseCoupling
from mechgraph.model.declaration import (
    DeclaredParts,
    Parts,
    declaration_faults,
    flat_start,
    item_faults,
    mapping_faults,
)
from mechgraph.model.gears import off_axis
from mechgraph.model.loads import Gravity, Load
from mechgraph.model.motion import Drive, Motion
from mechgraph.model.pair import Link, Marker, Pair
from mechgraph.model.plane import in_plane, in_space, is_flat, pair_in_plane, pair_in_space, plane_faults, spatial_row
from mechgraph.model.setups import ResponseSetup, SynthesisSetup
from mechgraph.pairs.contact_types import row_of, travels
from mechgraph.pairs.pair_type import TABLE, PairType
from mechgraph.quantities import (
    LENGTH,
    MASS,
    PURE,
    base_factors,
    door,
    gravity_hint,
    is_numeric,
    items_of,
    real_array,
    shown,
    unit_hints,
    unit_of,
    unknown,
    without_units,
    wrong,
)


def mechanism_document(m: DeclaredParts) -> Document:
    """The mechanism as a document; what is long is cut, with the number of what is left out."""
    blocks: list[Block] = [Paragraph(m.description), Paragraph(f"Source: {m.source}" if m.source else "")]
    blocks.append(Paragraph(_counts(m)))
    lines = {title: _listed(items) for title, items in _in_lines(m).items()}
    for title, parts in {"Links": _links(m), "Pairs": _pairs(m), "Drivers": _drives(m), **lines}.items():
        blocks += [Heading(title, 2), *found] if (found := list(parts)) else []
    return Document(f"Mechanism {m.name}", tuple(blocks))


def _counts(m: DeclaredParts) -> str:
    units = ", ".join(f"{base} in {unit}" for base, unit in m.units.items())
    counts = ((m.links, "link"), (m.pairs, "pair"), (m.couplings, "coupling"), (m.drives, "driver"), (m.loads, "load"))
    plane = "; planar, in x and y" * m.planar
    return (
        ", ".join(counted(len(of), what) for of, what in counts if of) + plane + (f"; {units}" if units else "") + "."
    )


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


def _links(m: DeclaredParts) -> Iterator[Block]:
    mass, length = (f" [{u}]" if (u := unit_of(m.units, dimension)) else "" for dimension in (MASS, LENGTH))
    rows = (
        (
            link.name,
            "frame" if link.name == m.frame else "",
            _number(link.mass) if link.mass else "",
            _vector(link.center, m.axes),
            "yes" if link.inertia is not None else "",
            ", ".join(link.points),
        )
        for link in m.links
    )
    head = ("link", "", f"mass{mass}", f"mass center{length}", "inertia", "points")
    yield from _rows(head, rows, len(m.links), "llrlll")


def _pairs(m: DeclaredParts) -> Iterator[Block]:
    length = f" [{u}]" if (u := unit_of(m.units, LENGTH)) else ""
    rows = (
        (
            p.name,
            p.type.symbol,
            p.a,
            p.b,
            _vector(p.point, m.axes) if p.on_a is None else "by markers",
            "" if m.planar and p.type.normal == 2 else _vector(p.axis, m.axes),
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


def _drives(m: DeclaredParts) -> Iterator[Block]:
    rows = ((m.full_name(d.freedom), _motion(d.motion)) for d in m.drives)
    yield from _rows(("driven freedom", "stored motion"), rows, len(m.drives), "ll")


def _motion(motion: Motion | None) -> str:
    return "" if motion is None else repr(motion).removeprefix("Motion(").removesuffix(")")


def _listed(items: Iterable[str]) -> Iterator[Block]:
    texts = list(items)
    more = [f"... and {len(texts) - LISTED:,} more"] if len(texts) > LISTED else []
    if texts:
        yield Bullets([*texts[:LISTED], *more])


def _in_lines(m: DeclaredParts) -> dict[str, Iterable[str]]:
    """What is told in a line each, by headings."""
    return {
        "Gears": map(repr, m.gears),
        "Couplings": (f"{c.name}: {c.text}" for c in m.couplings),
        "Loads": map(repr, m.loads),
        "Response": [] if m.response is None else [repr(m.response)],
        "Synthesis": [] if m.synthesis is None else [repr(m.synthesis)],
        "Start": (f"{name} = {value:.6g}" for name, value in m.start.items() if value),
    }


def _number(value: float) -> str:
    return f"{value:.4g}"


def _vector(value: Any, axes: str) -> str:
    return "" if value is None else f"({', '.join(f'{x + 0.0:.4g}' for x in value[: len(axes)])})"


DESCRIBED = ("links", "pairs", "drives", "loads", "gears", "couplings")
"""What a mechanism holds of things with numbers of their own."""


@dataclass(frozen=True, eq=False)
class Mechanism(DeclaredParts, Shown):
    """Declare a mechanism: a graph with links as nodes and kinematic pairs as edges.

    Parameters
    ----------
    name : str
        Name for messages and reports.
    links : iterable of Link or str, optional
        The first is the frame unless ``frame`` names another. Default: inferred from the pairs, massless.
    pairs : iterable of Pair
        The pairs; several may join the same two links.
    drives : iterable of Drive or str
        Driven freedoms, ``"A"`` or ``"B.Tz"``.
    loads : iterable of load
        ``Gravity``, ``Wrench``, ``Effort``, ``Spring``, ``TorsionSpring``, ``Damper``, ``ForceLaw``.
    couplings : iterable of Coupling
        Linear relations between freedoms, gears and belts among them; kept with full freedom names, ``"A.Rz"``.
    gears : iterable of gear
        ``Gear``, ``GearRack``, ``BevelGear``, ``Worm``, ``WormWheel``, ``Pulley``, as places on links.
    parts : iterable of parts.Parts
        Catalogue parts, ``mg.parts.cylinder(...)``: their links, pairs, couplings and loads are written out behind the others.
    frame : str, optional
        Name of the fixed link. Default: the first link.
    start : mapping of str to float, optional
        Pair coordinates [rad, length] near which to assemble; they select the assembly mode. Default: all 0.
    units : mapping of str to str, optional
        Names of the units of ``length``, ``mass`` and ``time``, a consistent set. They label results and change no number.
    tol : float, optional
        Accuracy of directions [rad] and distances (relative to L), see ``snapped``. Default: exact.
    response : ResponseSetup, optional
        Default arguments of ``respond``.
    synthesis : SynthesisSetup, optional
        Default arguments of ``synthesize``.
    planar : bool
        It moves in the x-y plane alone: points, centers and forces may have two numbers, inertias and moments one (about z), R needs no
        axis, P one in the plane. What leaves the plane is zero by the model; 3 closure equations a loop, 3 equilibrium equations a link.
    source : str
        Where the mechanism comes from.
    description : str
        What it is.
    expected : mapping, optional
        Facts that a test checks; any names.

    Raises
    ------
    DeclarationError
        With every fault of the declaration.

    Examples
    --------
    >>> import mechgraph as mg
    >>> z = (0, 0, 1)
    >>> m = mg.Mechanism(
    ...     "pendulum",
    ...     [mg.Link("frame"), mg.Link("bob", 2.0, (0, -0.5, 0))],
    ...     [mg.Pair("A", "R", "frame", "bob", point=(0, 0, 0), axis=z)],
    ... )
    >>> m.freedom_names()
    ('A.Rz',)
    """

    _every_method_is_a_door = False
    _wanted = "a Mechanism; mg.load(name) reads one"

    def __init__(
        self,
        name: str,
        links: Iterable[Link] | None = None,
        pairs: Iterable[Pair] = (),
        drives: Iterable[Drive | str] = (),
        loads: Iterable[Load] = (),
        *,
        couplings: Iterable[BaseCoupling] = (),
        gears: Iterable[Any] = (),
        parts: Iterable[Parts] = (),
        frame: str | None = None,
        start: Mapping[str, Any] | None = None,
        units: Mapping[str, str] | None = None,
        tol: float | None = None,
        response: ResponseSetup | None = None,
        synthesis: SynthesisSetup | None = None,
        planar: bool = False,
        source: str = "",
        description: str = "",
        expected: Mapping[str, Any] | None = None,
    ) -> None:
        faults: list[str] = []
        more = Parts.joined(parts, faults)
        pair_tuple = (*items_of(pairs, "pairs", faults), *more.pairs)
        link_tuple = more.links_with(pair_tuple) if links is None else (*items_of(links, "links", faults), *more.links)
        first = next((link.name for link in link_tuple if isinstance(link, Link)), "")
        self._set(
            name=name,
            links=link_tuple,
            pairs=pair_tuple,
            couplings=_named((*items_of(couplings, "couplings", faults), *more.couplings), pair_tuple),
            gears=(*items_of(gears, "gears", faults), *more.gears),
            drives=_as_drives(items_of(drives, "drives", faults)),
            loads=(*items_of(loads, "loads", faults), *more.loads),
            frame=first if frame is None else frame,
            units=MappingProxyType(dict(units) if isinstance(units, Mapping) else {}),
            tol=plain(tol),
            response=response,
            synthesis=synthesis,
            planar=planar,
            source=source,
            description=description,
            expected=MappingProxyType(dict(expected) if isinstance(expected, Mapping) else {}),
        )
        if not faults:
            faults = self._checked(declaration_faults)
        self._finish(start, faults + mapping_faults(units=units, start=start, expected=expected))
        self._set(couplings=tuple(one for c in self.couplings for one in c.written(self)))
        self._doubt()
        if self.gears and self.has_geometry and "_changed_from" not in vars(self):
            kinds = {type(c): None for c in self.couplings}
            for fault in (*off_axis(self), *(fault for kind in kinds for fault in kind.doubts(self))):
                warnings.warn(f"mechanism {self.name!r}: {fault}", MechgraphWarning, stacklevel=3)

    def leaving_the_plane(self, loads_alone: bool = False) -> list[str]:
        """What leaves the x-y plane, one line each."""
        parts: tuple[Any, ...] = (
            ((), (), self.loads) if loads_alone else (self.links, self.pairs, self.loads, self.gears)
        )
        return plane_faults(*parts)

    def _set(self, **fields: Any) -> None:
        for key, value in fields.items():
            object.__setattr__(self, key, value)

    def _checked(self, faults_of: Callable[[Mechanism], list[str]]) -> list[str]:
        """Its faults, with what follows from the plane filled in; where there are some, after its quantities are read."""
        self._take_plane()
        faults = faults_of(self)
        if faults and self._take_quantities():
            self._take_plane()
            self._set(_kept={}, _kept_of_graph={})  # what was found of pairs with quantities
            faults = faults_of(self)
        return faults

    def _take_quantities(self) -> bool:
        """Turn quantities of pint into plain numbers, where units are declared; whether there may have been any."""
        if not self.units or not _are_pairs(self.pairs):
            return False
        for key in DESCRIBED:
            if all(isinstance(item, Described) for item in getattr(self, key)):
                self._set(**{key: tuple(item.in_own_units(self.units, self.turns) for item in getattr(self, key))})
        return True

    def _take_plane(self) -> None:
        """Of a planar mechanism what is declared with two numbers in three, pairs as rows of the plane; of others rows of space."""
        if self.planar is not True:
            if any(
                isinstance(p, Pair) and isinstance(p.type, PairType) and p.type.normal is not None for p in self.pairs
            ):
                self._set(pairs=tuple(map(pair_in_space, self.pairs)))
            return
        self._set(
            links=tuple(
                in_space(link) if isinstance(link, Link) and not is_flat(link) else link for link in self.links
            ),
            pairs=tuple(map(pair_in_plane, self.pairs)),
            gears=tuple(in_space(gear) if isinstance(gear, Described) else gear for gear in self.gears),
            loads=tuple(in_space(load) if isinstance(load, Load) else load for load in self.loads),
        )

    def _finish(self, start: Any, faults: list[str]) -> None:
        """Raise all faults at once, those of ``start`` too; keep start values by full freedom names."""
        flat: dict[str, float] = {}
        if _are_pairs(self.pairs) and all(isinstance(link, Link) for link in self.links):
            flat, start_faults = flat_start(self, start if isinstance(start, Mapping) else {})
            faults += start_faults
        if faults:
            raise DeclarationError(f"mechanism {shown(self.name)}", faults)
        self._set(start=MappingProxyType(flat))
        if self.response is not None:
            self._set(response=self.response.with_full_names(self.full_name))

    def _doubt(self) -> None:
        """Warn of what is sound and hardly meant: units that are not known, gravity in other units than those declared."""
        if not self.units:
            return
        sizes = [math.hypot(*load.acceleration) for load in self.loads if isinstance(load, Gravity)]
        for hint in [*unit_hints(self.units), *(gravity_hint(self.units, size) for size in sizes)]:
            if hint:
                warnings.warn(f"mechanism {self.name!r}: {hint}", MechgraphWarning, stacklevel=4)

    def __eq__(self, other: object) -> bool:
        return same_fields(self, other)

    def __hash__(self) -> int:
        return hash((self.name, tuple(p.name for p in self.pairs)))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, {len(self.links)} links, {len(self.pairs)} pairs)"

    def document(self) -> Document:
        """Links, pairs, drivers, couplings and loads as tables."""
        return mechanism_document(self)

    def __reduce__(self) -> tuple[Callable[..., Mechanism], tuple[dict[str, Any], Tolerances | None]]:
        return _rebuilt, (self._arguments(), carried(self))

    def _arguments(self) -> dict[str, Any]:
        out = {k: getattr(self, k) for k in self.formats}
        return {k: dict(v) if isinstance(v, Mapping) else v for k, v in out.items()}

    def freedom_names(self) -> tuple[str, ...]:
        """Full names of all freedoms, ``"B.Tz"``, in the order of the pairs."""
        return self.once(DeclaredParts.freedom_names)

    @property
    def bound_freedoms(self) -> set[str]:
        """Full names of the freedoms that drives, loads, couplings and the response name."""
        named = {d.freedom for d in self.drives} | {name for c in self.couplings for name in c.freedoms}
        named |= {name for load in self.loads for name in load.freedoms}
        return {self.full_name(name) for name in named.union(self.response.freedoms if self.response else ())}

    # --- changed copies ----------------------------------------------------------------------------------------------

    def replace(self, **changes: Any) -> Mechanism:
        """Return a copy with changed fields, checked again.

        Parameters
        ----------
        **changes
            Fields of ``Mechanism``.

        Returns
        -------
        Mechanism

        Examples
        --------
        >>> import mechgraph as mg
        >>> mg.load("four-bar").replace(loads=[]).loads
        ()
        """
        if strange := set(changes) - set(self.formats):
            raise DeclarationError(
                f"mechanism {self.name!r}", [f"replace: {unknown('field', k, self.formats)}" for k in sorted(strange)]
            )
        if not set(changes) <= {"drives", "loads", "start"}:
            changed = under(carried(self), Mechanism.__new__, Mechanism)
            changed._set(_changed_from=self)
            under(carried(self), changed.__init__, **{**self._arguments(), **changes})  # type: ignore[misc]
            return changed
        # links, pairs and couplings stay, and with them what is kept of the graph: only what refers to them is checked again
        out = under(carried(self), Mechanism.__new__, Mechanism)
        fields = {k: getattr(self, k) for k in self.formats}
        wrong_kinds: list[str] = []
        fields["drives"] = _as_drives(items_of(changes.get("drives", self.drives), "drives", wrong_kinds))
        fields["loads"] = items_of(changes.get("loads", self.loads), "loads", wrong_kinds)
        out._set(**fields, _kept=self._kept, _kept_of_graph=self._kept_of_graph)
        vars(out).update(
            (k, v) for k, v in vars(self).items() if isinstance(getattr(Mechanism, k, None), cached_property)
        )
        start = changes.get("start", self.start)
        out._finish(start, wrong_kinds + out._checked(item_faults) + mapping_faults(start=start))
        if "loads" in changes:
            out._doubt()
        return out

    @property
    def tolerances(self) -> Tolerances:
        """The tolerances with which the mechanism is asked."""
        return carried(self) or Tolerances()

    @door
    def with_tolerances(self, numbers: Tolerances) -> Mechanism:
        """Return the mechanism as it is asked with other tolerances; the same argument of ``solve`` and others does that for one call.

        Everything that is made of the copy goes by them: copies of it, solutions, reports, what is worked out of these later.

        Parameters
        ----------
        numbers : Tolerances
            See ``Tolerances``.

        Returns
        -------
        Mechanism

        Examples
        --------
        >>> import mechgraph as mg
        >>> m = mg.load("four-bar").with_tolerances(mg.Tolerances(path={"longest": 0.1}))
        >>> m.tolerances.path.longest
        0.1
        """
        known: dict[Tolerances | None, Mechanism] = vars(self).setdefault("_asked_otherwise", {})
        asked = numbers.asked
        if asked not in known:
            out = under(asked, Mechanism.__new__, type(self))
            vars(out).update(
                (k, v) for k, v in vars(self).items() if k not in ("_kept", "_tolerances", "_asked_otherwise")
            )
            out.take_graph_of(self)
            known[asked] = out
        return known[asked]

    @cached_property
    def _kept_of_graph(self) -> dict[Callable[..., Any], Any]:
        other = vars(self).pop("_changed_from", None)
        return other._kept_of_graph if other is not None and self.has_graph_of(other) else {}

    def has_graph_of(self, other: Mechanism) -> bool:
        """Whether links and pairs have the names, ends and types of those of another mechanism, in the same order."""
        return (
            self.frame == other.frame
            and self.planar == other.planar
            and [link.name for link in self.links] == [link.name for link in other.links]
            and len(self.pairs) == len(other.pairs)
            and all(
                (p.name, p.a, p.b) == (q.name, q.a, q.b) and (p.type is q.type or p.type == q.type)
                for p, q in zip(self.pairs, other.pairs, strict=True)
            )
        )

    @door
    def with_pair_type(self, pair: str, type: str | PairType, *, pitch: float | None = None) -> Mechanism:
        """Return a copy in which one pair has another type at the same markers; drives that it cannot take are dropped.

        Parameters
        ----------
        pair : str
            Name of the pair.
        type : str or PairType
            The new type.
        pitch : float, optional
            Advance per radian [length] of a helical pair.

        Returns
        -------
        Mechanism

        Raises
        ------
        DeclarationError
            Unknown pair or type.

        Examples
        --------
        >>> import mechgraph as mg
        >>> mg.check(mg.load("four-bar").with_pair_type("B", "S")).redundancy
        1
        """
        old = self.pair(pair)
        row = row_of(type, old.curve, old.surface)
        if (
            self.planar
            and isinstance(row, PairType)
            and (flat := in_plane(spatial_row(row)))
            and flat.normal != old.type.normal
        ):
            old = old.replace(axis=None, second=None)  # those of the plane
        place = {name: getattr(old, name) for name in ("point", "axis", "second", "on_a", "on_b")}
        new = Pair(old.name, type, old.a, old.b, **place, **(old.curves if travels(row) else {}))
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
        loads = [load.with_full_names(self.full_name) for load in self.loads]
        start = {k: v for k, v in self.start.items() if k not in gone}
        pairs = [new if p.name == pair else p for p in self.pairs]
        response = None if self.response is None else self.response.without(lost)
        return self.replace(pairs=pairs, drives=drives, loads=loads, start=start, response=response)

    @door
    def to_units(self, **units: str) -> Mechanism:
        """Return the mechanism in other units (``units`` extra).

        Parameters
        ----------
        **units
            Names of units by ``length``, ``mass``, ``time``.

        Returns
        -------
        Mechanism

        Raises
        ------
        DeclarationError
            The mechanism declares no units, or a name is unknown.
        MissingExtraError
            Without pint.

        Examples
        --------
        >>> import mechgraph as mg
        >>> mg.load("four-bar").to_units(length="mm").link("crank").center
        (0.0, 50.0, 0.0)
        """
        faults = [wrong(unit, name, "the name of a unit") for name, unit in units.items() if not isinstance(unit, str)]
        if faults:
            raise DeclarationError("to_units", faults)
        if self.synthesis is not None:
            what = "its synthesis is in units of its own; leave it out with m.replace(synthesis=None)"
            raise DeclarationError("to_units", [f"mechanism {self.name!r}: {what}"])
        base, turns = base_factors(self.units, units), self.turns
        return self.replace(
            **{name: [item.converted(base, turns) for item in getattr(self, name)] for name in DESCRIBED},
            start={name: value if turns(name) else value * base[0] for name, value in self.start.items()},
            response=None if self.response is None else self.response.converted(base, turns),
            units={**self.units, **units},
        )

    @door
    def snapped(self, tol: float) -> Mechanism:
        """Return the mechanism with the smallest change that makes near-special geometry exact; ``changes`` of it lists the changes.

        Axes, directions, centers and lengths that are parallel, perpendicular, in line, intersecting or equal within rounding to
        ``tol`` become exactly so; the rest is fitted for the mechanism to move. The change is the least
        ``sum angle^2 + (shift / L)^2`` over the pairs. Relations that cannot hold together are in ``changes.dropped``.

        Parameters
        ----------
        tol : float
            Accuracy of directions [rad] and distances (relative to L).

        Returns
        -------
        Mechanism

        Raises
        ------
        DeclarationError, AssemblyError
            No geometry, or loops that do not close to ``tol``.

        Examples
        --------
        >>> import mechgraph as mg
        >>> m = mg.load("four-bar")
        >>> tilted = m.replace(pairs=[*m.pairs[:3], m.pairs[3].replace(axis=(0.001, 0, 1))])
        >>> mg.check(tilted).mobility, mg.check(tilted.snapped(0.005)).mobility
        (0, 1)
        """
        made: Mechanism = methods.call("snapped", self, tol)
        return made

    @door
    def equivalent(self, at: Mapping[str, float] | None = None, *, rollers: str = "removed") -> Mechanism:
        """Return the planar mechanism with links and lower pairs in place of higher pairs, gears and belts.

        It has the same velocities and accelerations at that position.

        Parameters
        ----------
        at : mapping of str to float, optional
            Coordinates [rad, length]. Default: the start.
        rollers : {"removed", "kept"}
            Keep a roller on a pin as a link that spins passively.

        Returns
        -------
        Mechanism

        Raises
        ------
        DeclarationError
            Not planar, or couplings without a line of contact.

        Examples
        --------
        >>> import mechgraph as mg
        >>> mg.load("geneva").equivalent().name
        'geneva, lower pairs'
        """
        made: Mechanism = methods.call("equivalent", self, at, rollers=rollers)
        return made

    @door
    def to_planar(self, normal: ArrayLike | None = None) -> Mechanism:
        """Return the planar mechanism of a spatial one that moves in a plane; ``description`` tells what is left out.

        Points are moved into the plane along its normal, and the plane becomes x-y; z of an upright one becomes y. Forces along the normal,
        moments across it and products of inertia with it are dropped. A pair that can leave the plane gives way to the one
        that holds the same in it (S to R).
        Coordinates of pairs keep their values.

        Parameters
        ----------
        normal : (3,) array_like, optional
            Normal of the plane. Default: found from the motion.

        Returns
        -------
        Mechanism

        Raises
        ------
        DeclarationError
            It does not move in that plane, or a drive leaves it.

        Examples
        --------
        >>> import mechgraph as mg
        >>> m = mg.load("four-bar")
        >>> mg.check(m).redundancy, mg.check(m.to_planar()).redundancy
        (3, 0)
        """
        made: Mechanism = methods.call("to_planar", self, normal)
        return made

    @door
    def to_spatial(self, z: Mapping[str, float] | None = None) -> Mechanism:
        """Return the spatial mechanism of a planar one, its links in layers where asked.

        Parameters
        ----------
        z : mapping of str to float, optional
            Height of a link over the plane [length]; its pairs stand in the middle between its links. Default: all 0.

        Returns
        -------
        Mechanism

        Raises
        ------
        DeclarationError
            Unknown link; layers of pairs that are given by markers or curves.

        Examples
        --------
        >>> import mechgraph as mg
        >>> m = mg.load("four-bar").to_planar()
        >>> m.to_spatial(z={"coupler": 0.02}).pair("B").point[2]
        0.01
        """
        made: Mechanism = methods.call("to_spatial", self, z)
        return made

    def view(self) -> Any:
        """Show the mechanism in a notebook, in space, with every freedom, self-stress and recommendation (``notebook`` extra).

        Returns
        -------
        object
            A widget; it moves as the stored motions of its drives say, if all have one.

        Raises
        ------
        DeclarationError
            It cannot be drawn.
        MissingExtraError
            Without anywidget.
        """
        return methods.call("view", self)

    @door
    def moved(self, pose: Any) -> Mechanism:
        """Return the mechanism after a rigid motion; pair coordinates do not change.

        Parameters
        ----------
        pose : (4, 4) or (3, 4) array_like
            The motion.

        Returns
        -------
        Mechanism

        Examples
        --------
        >>> import mechgraph as mg
        >>> import numpy as np
        >>> pose = np.eye(4)
        >>> pose[:3, 3] = 1, 2, 3
        >>> mg.load("four-bar").moved(pose).pair("A").point
        (1.0, 2.0, 3.0)
        """
        fits = is_numeric(pose, (4, 4)) or is_numeric(pose, (3, 4))
        G = np.asarray(pose, dtype=float)[:3] if fits else np.zeros((3, 4))
        R = G[:, :3]
        if np.abs(R @ R.T - np.eye(3)).max() > 1e-9 or np.linalg.det(R) < 0:
            raise DeclarationError(f"mechanism {self.name!r}", ["moved: expected a 4 x 4 pose with a proper rotation"])
        return self.replace(
            links=[link.moved(G) for link in self.links],
            pairs=[pair.moved(G) for pair in self.pairs],
            loads=[load.moved(G) for load in self.loads],
            gears=[g.moved(G) for g in self.gears],
        )


def _are_pairs(items: Iterable[Any]) -> bool:
    return all(issubclass(kind, Pair) for kind in set(map(type, items)))


def _as_drives(drives: Iterable[Any]) -> tuple[Any, ...]:
    return tuple(Drive(d) if isinstance(d, str) else d for d in drives)


def _named(items: tuple[Any, ...], pairs: Iterable[Any]) -> tuple[Any, ...]:
    """The couplings; those without a name are called g1, g2, ... as far as these are free."""
    if not items:
        return ()
    taken = {getattr(item, "name", None) for item in (*items, *pairs) if isinstance(getattr(item, "name", None), str)}
    free = (name for name in (f"g{i}" for i in itertools.count(1)) if name not in taken)
    return tuple(
        c.replace(name=next(free)) if isinstance(c, BaseCoupling) and isinstance(c.name, str) and not c.name else c
        for c in items
    )


def _rebuilt(arguments: dict[str, Any], tolerances: Tolerances | None = None) -> Mechanism:
    return under(tolerances, Mechanism, **arguments)


NUMBERS_OF_CHAIN = ("twist", "length", "offset")
"""What places the link after every pair of a chain, in the order of the rows of its numbers."""


def chain_symbols(letters: str) -> tuple[list[str], list[str]]:
    """Split ``"RSgC"`` into symbols of the pair table, the longest first; also the faults."""
    known = sorted(TABLE, key=len, reverse=True)
    symbols: list[str] = []
    at = 0
    if not isinstance(letters, str):
        return symbols, [wrong(letters, "pairs", "letters of pair types in one text, e.g. 'RSSR'")]
    while at < len(letters):
        symbol = next((s for s in known if letters.startswith(s, at)), None)
        if symbol is None and letters[at] in "-_ ":
            at += 1
            continue
        if symbol is None:
            return symbols, [
                f"pairs {letters!r}: no pair type starts with {letters[at:]!r} (known: {', '.join(TABLE)})"
            ]
        symbols.append(symbol)
        at += len(symbol)
    return symbols, []


def _marker(X: Array) -> Marker:
    return Marker(point=X[:, 3].tolist(), axis=X[:, 2].tolist(), second=X[:, 0].tolist())


@door
def chain(
    letters: str,
    *,
    twist: ArrayLike | None = None,
    length: ArrayLike | None = None,
    offset: ArrayLike | None = None,
    pitch: ArrayLike | Mapping[str, float] | None = None,
    name: str | None = None,
    drive: str | None = "O1",
    links: Iterable[Link] | None = None,
    **more: Any,
) -> Mechanism:
    """Declare a single closed loop by its pair letters: links ``frame, link1, ...``, pairs ``O1, O2, ...`` (Lee 1977).

    Around the loop from the frame ``prod_k D_k(q_k) Tz(offset_k) Tx(length_k) Rx(twist_k) = 1``; the numbers ``k`` belong to the link
    after pair ``k`` (the last to the frame). The global frame is marker A of ``O1``; every other link frame is marker B of the pair
    before it. Without numbers the chain is a topology.

    Parameters
    ----------
    letters : str
        E.g. ``"RPRHRRR"``; Sp, Sg, Sc, Cp are recognized, hyphens skipped.
    twist, length, offset : (pairs,) array_like, optional
        [rad, length, length] per pair. Default: 0 if another of them is given.
    pitch : array_like or mapping, optional
        Advance per radian of the helical pairs, in order, or pair -> pitch.
    name : str, optional
        Default: the letters.
    drive : str or None
        Driven pair or freedom.
    links : iterable of Link, optional
        Links with mass, each in the link frame described above; the others are massless.
    **more
        Further fields of ``Mechanism``: loads, start, units, ...

    Returns
    -------
    Mechanism

    Raises
    ------
    DeclarationError
        With every fault.

    Examples
    --------
    >>> import mechgraph as mg
    >>> print(mg.check(mg.chain("RPRHRRR")).verdict)
    1 driver, 50 unknowns, 50 equations: determinate for general geometry (mobility 1).
    """
    title = letters if name is None else name
    symbols, faults = chain_symbols(letters)
    n = len(symbols)
    if not faults and n < 2:
        faults.append(f"pairs {letters!r}: a loop needs at least two pairs")
    numbers = {}
    units = more["units"] if isinstance(more.get("units"), Mapping) else {}
    for what, given in zip(NUMBERS_OF_CHAIN, (twist, length, offset), strict=True):
        values = (0.0,) * n if given is None else without_units(given, PURE if what == "twist" else LENGTH, units)
        numbers[what] = plain(values)
        if not is_numeric(values, (n,)):
            faults.append(wrong(values, what, f"{n} finite numbers, one a pair"))
    pitches, pitch_faults = _pitches(symbols, without_units(pitch, LENGTH, units))
    faults += pitch_faults
    names = ["frame", *(f"link{k}" for k in range(1, n))]
    massive: dict[str, Link] = {}
    for link in items_of(() if links is None else links, "links", faults):
        if isinstance(link, Link) and isinstance(link.name, str) and link.name in names:
            massive[link.name] = link
        else:
            faults.append(unknown("link", getattr(link, "name", link), names))
    fields = set(inspect.signature(Mechanism).parameters)
    faults += [unknown("field", name, sorted(fields)) for name in sorted(set(more) - fields)]
    if faults:
        raise DeclarationError(f"chain {shown(title)}", faults)
    placed = any(v is not None for v in (twist, length, offset))
    poses = markers_of_chain(np.array(list(numbers.values()))[:, :, None])
    pairs = []
    for k, symbol in enumerate(symbols):
        markers: dict[str, Any] = {}
        if placed:
            markers = {side: _marker(X[:, :, k, 0]) for side, X in zip(("on_a", "on_b"), poses, strict=True)}
        pairs.append(Pair(f"O{k + 1}", symbol, names[k], names[(k + 1) % n], pitch=pitches.get(k), **markers))
    if drive is not None:
        more.setdefault("drives", [_first_freedom(pairs, drive)])
    return Mechanism(title, [massive.get(link, Link(link)) for link in names], pairs, **more)


def _first_freedom(pairs: list[Pair], drive: str) -> str:
    """The drive as given; for a pair with several freedoms its first."""
    pair = next((p for p in pairs if isinstance(drive, str) and p.name == drive), None)
    return pair.freedom_names[0] if pair is not None and pair.type.f > 1 else drive


def _pitches(symbols: list[str], pitch: Any) -> tuple[dict[int, float], list[str]]:
    takers = [k for k, symbol in enumerate(symbols) if TABLE[symbol].takes_pitch]
    if pitch is None:
        return {}, []
    if isinstance(pitch, Mapping):
        names = {f"O{k + 1}": k for k in takers}
        strange = [f"pitch: {shown(key)} is no helical pair of this chain" for key in pitch if key not in names]
        return {names[key]: value for key, value in pitch.items() if key in names}, strange
    array = real_array(pitch)
    if array is None:
        return {}, [wrong(pitch, "pitch", "numbers, or a mapping pair -> pitch")]
    values = array.reshape(-1).tolist()
    if len(values) == len(symbols) and len(takers) < len(symbols):
        values = [values[k] for k in takers]
    if len(values) != len(takers):
        return {}, [f"pitch: {len(values)} given for {len(takers)} helical pairs"]
    return dict(zip(takers, values, strict=True)), []


def markers_of_chain(numbers: Array) -> tuple[Array, Array]:
    """Poses ``(3, 4, n, B)`` of the markers on links a and b of the pairs of a chain, from its numbers ``(3, n, B)``.

    ``numbers`` are twist, length and offset. Marker A of the first pair and marker B of all but the last are the link frames.
    """
    twist, length, offset = numbers
    steps = np.zeros((3, 4, *twist.shape))
    steps[0, 0] = 1.0
    steps[1, 1] = steps[2, 2] = np.cos(twist)
    steps[2, 1], steps[1, 2] = np.sin(twist), -np.sin(twist)
    steps[0, 3], steps[2, 3] = length, offset
    plain_frames = identity(*twist.shape)
    on_a = np.concatenate([plain_frames[:, :, :1], steps[:, :, :-1]], axis=2)
    on_b = np.concatenate([plain_frames[:, :, :-1], inverse(steps[:, :, -1:])], axis=2)
    return on_a, on_b


def chain_numbers(m: Mechanism) -> Array | None:
    """Twist, length and offset ``(3, n)`` of a mechanism that stands as ``chain`` places it; None of any other."""
    if any(p.on_a is None or p.on_b is None for p in m.pairs):
        return None
    poses = [[pair.markers[side].pose() for pair in m.pairs] for side in (0, 1)]
    steps = [*poses[0][1:], inverse(poses[1][-1][:, :, None])[:, :, 0]]
    numbers = np.array([[np.arctan2(X[2, 1], X[1, 1]), X[0, 3], X[2, 3]] for X in steps]).T
    again = markers_of_chain(numbers[:, :, None])
    ends = [(p.a, p.b) for p in m.pairs]
    ring = all(one[1] == following[0] for one, following in zip(ends, [*ends[1:], ends[0]], strict=True))
    same = all(np.allclose(np.stack(part, axis=2), made[..., 0]) for part, made in zip(poses, again, strict=True))
    return numbers if ring and ends[0][0] == m.frame and same else None
