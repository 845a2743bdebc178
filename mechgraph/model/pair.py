"""Links and pairs of a mechanism: the nodes and edges of the graph, and where the pairs sit on their links."""

from __future__ import annotations

import operator
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, field
from functools import cached_property, partial
from operator import attrgetter
from types import MappingProxyType
from typing import Annotated, Any, ClassVar

import numpy as np

from mechgraph.errors import DeclarationError, ShapeError
from mechgraph.fields import (
    DIRECTION,
    FLAG,
    LINK_NAME,
    NUMBER,
    POINT,
    POINTS,
    POSITIVE,
    TENSOR,
    TEXT,
    Described,
    across,
    axes_of,
    cosine,
    remade,
)
from mechgraph.fields import TABLE as NESTED
from mechgraph.fields import second_direction as second_direction
from mechgraph.maths.inertia import physical_faults
from mechgraph.maths.se3 import Array
from mechgraph.maths.tolerances import SHAPES
from mechgraph.memo import dataclass
from mechgraph.pairs.contact_types import (
    ROWS,
    Hertz,
    PlacedRow,
    contact_faults,
    curve_faults,
    in_contact,
    kept_side,
    on_surface,
    row_of,
    shape_faults_of,
    surface_faults,
    travels,
)
from mechgraph.pairs.curves import Curve, parallel_faults
from mechgraph.pairs.journal import Journal, film_faults
from mechgraph.pairs.pair_type import TABLE, PairType
from mechgraph.pairs.surfaces import Surface
from mechgraph.quantities import FORCE_PER_LENGTH, INERTIA, LENGTH, MASS, MOMENT, column, is_numeric, shown, wrong

NO_POINTS: Mapping[str, tuple[float, ...]] = MappingProxyType({})


@dataclass(frozen=True)
class Link(Described):
    """Declare a link, a rigid body.

    Parameters
    ----------
    name : str
        Name in the graph.
    mass : float
        Mass, not negative. Default: 0.
    center : (3,) array_like, optional
        Mass center [length] in the frame of the link (global coordinates if pairs are given by point and axis). Required if mass > 0.
    inertia : (3, 3) array_like, optional
        Tensor about the mass center [mass length^2] in the frame of the link; off-diagonals are minus the products of inertia.
        Default: 0, a point mass.
    unphysical : bool
        Accept an inertia that no body can have.
    points : mapping of str to (3,) array_like, optional
        Named points in the coordinates of ``center``, for loads, prescribed motion and results.

    Raises
    ------
    DeclarationError
        From ``Mechanism``, which checks all links.

    Examples
    --------
    >>> import mechgraph as mg
    >>> rod = mg.inertia.rod(12.0, (0, 0, 0), (1, 0, 0))
    >>> mg.Link("crank", 12.0, (0.5, 0, 0), rod, points={"tip": (1, 0, 0)}).inertia
    ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    """

    name: Annotated[str, TEXT("in a chain: `frame`, `link1`, `link2`, ...")]
    mass: Annotated[float, NUMBER("mass", MASS, minimum=0.0)] = 0.0
    center: Annotated[
        Any,
        POINT(
            "mass center in the link's frame (global where pairs are given by point and axis)",
            LENGTH,
            default="needed where mass > 0",
        ),
    ] = None
    inertia: Annotated[
        Any,
        TENSOR(
            "tensor about the mass center, in the link's frame; off-diagonals are minus the products of inertia",
            INERTIA,
            default="0",
        ),
    ] = None
    unphysical: Annotated[bool, FLAG("accept an inertia that no body can have")] = False
    points: Annotated[
        Any, POINTS("named points, name → 3 numbers, in the coordinates of `center`", LENGTH, default="none")
    ] = field(default=None, hash=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.points is None:
            object.__setattr__(self, "points", NO_POINTS)

    __reduce__ = remade

    def point(self, name: str) -> tuple[float, float, float]:
        """The point of that name, in the link's frame."""
        if name not in self.points:
            raise DeclarationError(f"link {self.name!r}", [self.point_fault(name)])
        at: tuple[float, float, float] = self.points[name]
        return at

    def point_fault(self, name: Any) -> str:
        """What to say of a name that is no point of this link."""
        known = (
            f"its points: {', '.join(self.points)}" if self.points else "it has none; declare points={'tip': (x, y, z)}"
        )
        return f"link {self.name!r} has no point {shown(name)} ({known})"

    def faults(self) -> list[str]:
        """What is wrong with this link, one line each."""
        where = f"link {shown(self.name)}: "
        if not isinstance(self.name, str) or not self.name:
            return [f"{where}the name must be a non-empty text"]
        found = self.value_faults(where)
        if self.center is None and is_numeric(self.mass, ()) and self.mass > 0:
            found.append(f"{where}mass = {self.mass:g} without a center; give center=(x, y, z)")
        if is_numeric(self.inertia, (3, 3)):
            if self.center is None:
                found.append(f"{where}inertia without a center; give center=(x, y, z)")
            if is_numeric(self.mass, ()) and self.mass == 0 and np.any(self.inertia):
                found.append(f"{where}inertia without mass; give mass=")
            if isinstance(self.unphysical, bool) and not self.unphysical:
                impossible = physical_faults(self.inertia)
                found += [
                    f"{where}inertia: {fault}; no body has it (unphysical=True accepts it)" for fault in impossible
                ]
        return found


def largest_cosine(tol: float) -> float:
    """Of axis and second direction that count as perpendicular where directions are meant to ``tol``: both may be off by so much."""
    return max(SHAPES.met, 2.0 * tol)


class SeatNumbers(Described):
    """Numbers of a pair by its reaction components; those left out are None."""

    what: ClassVar[str]

    @property
    def by_component(self) -> dict[str, float]:
        """The numbers that are given."""
        return {name: value for name in self.formats if (value := getattr(self, name)) is not None}


_RIGID: dict[str, Any] = {"minimum": 0.0, "default": "rigid"}


@dataclass(frozen=True)
class Stiffness(SeatNumbers):
    """Declare how stiff a pair is in its reaction components: force per length, moment per radian.

    What is left out is rigid, 0 carries nothing. ``solve(..., redundant="elastic")`` splits redundant reactions by it.

    Examples
    --------
    >>> import mechgraph as mg
    >>> p = mg.Pair("A", "R", "frame", "door", point=(0, 0, 0), axis=(0, 0, 1), stiffness={"Fx": 3e7, "Fz": 2e6})
    >>> p.stiffness.by_component
    {'Fx': 30000000.0, 'Fz': 2000000.0}
    """

    what: ClassVar[str] = "stiffness"
    Fx: Annotated[float | None, NUMBER("along x", FORCE_PER_LENGTH, **_RIGID)] = None
    Fy: Annotated[float | None, NUMBER("along y", FORCE_PER_LENGTH, **_RIGID)] = None
    Fz: Annotated[float | None, NUMBER("along z", FORCE_PER_LENGTH, **_RIGID)] = None
    Mx: Annotated[float | None, NUMBER("about x", MOMENT, **_RIGID)] = None
    My: Annotated[float | None, NUMBER("about y", MOMENT, **_RIGID)] = None
    Mz: Annotated[float | None, NUMBER("about z", MOMENT, **_RIGID)] = None


@dataclass(frozen=True)
class Misfit(SeatNumbers):
    """Declare by how much the seat of a pair on link a is off its place: a length along a force, an angle about a moment.

    With the small motion u of link b there the reaction is ``-k (u - misfit)``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> p = mg.Pair("A", "R", "frame", "door", point=(0, 0, 0), axis=(0, 0, 1), misfit={"Fz": 2e-5})
    >>> p.misfit.by_component
    {'Fz': 2e-05}
    """

    what: ClassVar[str] = "misfit"
    Fx: Annotated[float | None, NUMBER("along x", LENGTH, default="0")] = None
    Fy: Annotated[float | None, NUMBER("along y", LENGTH, default="0")] = None
    Fz: Annotated[float | None, NUMBER("along z", LENGTH, default="0")] = None
    Mx: Annotated[float | None, NUMBER("about x", degrees=True, default="0")] = None
    My: Annotated[float | None, NUMBER("about y", degrees=True, default="0")] = None
    Mz: Annotated[float | None, NUMBER("about z", degrees=True, default="0")] = None


SEATS: dict[str, type[SeatNumbers]] = {kind.what: kind for kind in (Stiffness, Misfit)}
"""The records by the fields of a pair that hold them."""


def seat_faults(pair: Any, where: str) -> Iterator[str]:
    """What is wrong with what a pair says of its seat."""
    for what, kind in SEATS.items():
        given = getattr(pair, what)
        if given is None:
            continue
        if not isinstance(given, kind):
            yield wrong(
                given,
                where + what,
                f"a table by reaction components, such as {{'Fz': 1e7}}, or mg.{kind.__name__}(...)",
            )
            continue
        yield from given.value_faults(f"{where}{what}.")
        have = pair.type.component_names
        for name in given.by_component:
            if name not in have:
                yield f"{where}{what}: {name} is no reaction component of {pair.type.symbol}; it has {', '.join(have)}"


@dataclass(frozen=True)
class Marker(Described):
    """Declare a marker frame on a link: origin ``point``, z along ``axis``, x along ``second`` (projected perpendicular to z).

    Examples
    --------
    >>> import mechgraph as mg
    >>> a, b = mg.Marker((1, 0, 0), (0, 0, 1)), mg.Marker((0, 0, 0), (0, 0, 1))
    >>> mg.Pair("B", "R", "crank", "rod", on_a=a, on_b=b).on_a.point
    (1.0, 0.0, 0.0)
    """

    point: Annotated[Any, POINT("origin", LENGTH, default="0")] = (0.0, 0.0, 0.0)
    axis: Annotated[Any, DIRECTION("z: pair axis, plane normal or groove direction, any length", default="z")] = (
        0.0,
        0.0,
        1.0,
    )
    second: Annotated[Any, across("x: second direction")] = None

    def faults(self, where: str, most: float) -> list[str]:
        """What is wrong with this marker; ``most`` is the largest cosine that its axis and second direction may have."""
        found = self.value_faults(where)
        if not found:
            found = parallel_faults(self.axis, self.second, where)
            if not found and abs(off := cosine(self.axis, self.second)) > most:
                found.append(
                    f"{where}second = {self.second!r}: not perpendicular to the axis {self.axis!r} (cosine {off:.3g}); "
                    "this type needs a perpendicular direction. For rounded numbers pass tol= to Mechanism (tol = ... in a file)"
                )
        return found

    @cached_property
    def line(self) -> tuple[Array, Array]:
        """Its axis: a point and the unit direction ``(3,)``."""
        z: Array = np.array(self.axis, dtype=float)
        return np.array(self.point, dtype=float), z / np.linalg.norm(z)

    def pose(self) -> Array:
        """The marker as a pose ``(3, 4)`` in the frame of its link."""
        return np.column_stack([axes_of(self.axis, self.second), np.asarray(self.point)])


SAID_MORE = attrgetter(
    "pitch", "lead", "closed", "restitution", "gap", "radius", "hertz", "curve", "curve_b", "roller", "surface", "film",
    "stiffness", "misfit",
)  # fmt: skip
"""What may be said of a pair beside its type, its links and its place."""


@dataclass(frozen=True)
class Pair(Described):
    """Declare a kinematic pair from link ``a`` to link ``b``; its reaction is the wrench of ``a`` on ``b``.

    Give the marker of the pair either as ``point`` and ``axis`` in global coordinates, at a configuration with closed loops, or as
    ``on_a`` and ``on_b``, one marker per link in the frame of that link. With neither, the pair is topology: it can be counted, not
    solved.

    Parameters
    ----------
    name : str
        Name in the graph; its freedoms are named after it, ``"name.Rz"``.
    type : str or PairType
        Symbol or name in the pair table (``"R"``, ``"revolute"``), or a pair type of your own.
    a, b : str
        Names of the links. Groove, plane and slot belong to ``a``.
    point : (3,) array_like, optional
        Origin of the marker [length], global.
    axis : (3,) array_like, optional
        z of the marker: pair axis, plane normal or groove direction; any length.
    second : (3,) array_like, optional
        x of the marker. Default: the global axis least aligned with ``axis``.
    pitch, lead : float, optional
        Advance per radian or per turn [length], right-hand positive; give exactly one for a helical pair.
    on_a, on_b : Marker, optional
        Marker on each link, in the frame of that link.
    closed : {"", "form", "force"}
        Of a contact: ``"form"`` holds b on both sides; with ``"force"`` a can only push b (along the axis of a plane, along
        ``second`` of a groove), and the solution reports loss of contact. Default: held; an open profile (cam, two curves) with
        tensile contact force warns.
    restitution : float, optional
        Coefficient of restitution, from 0 to 1, of a contact ``closed="force"`` that touches at a point of a plane: in ``respond`` it
        opens where it would have to pull, and lands. Elsewhere, and if left out, it stays closed.
    gap : float
        By how much it is open [length] where ``respond`` starts; its coordinate there is ``"name.gap"``.
    radius : float, optional
        Radius [length] of the ball or cylinder on link b.
    hertz : Hertz, optional
        Materials, for the contact pressure.
    curve : Curve, optional
        Curve in the frame of link a along which the marker travels: P, C, Sg, and required for Ps, Kc and Rg. ``point`` is then a place
        on it (default: where it begins), ``axis`` and ``second`` are those of its frame there; in a straight slot (Ps) ``axis`` is
        that of the pin.
    curve_b : Curve, optional
        Curve on link b that touches ``curve`` (Kc). Default: a straight face.
    roller : float, optional
        Radius [length] of a roller on the curve or a ball on the surface; ``point`` is its center.
    surface : Surface, optional
        Surface in the frame of link a on which the marker of Sp travels; ``point`` is a place on it.
    film : Journal, optional
        Oil film of a journal bearing: link a is the bearing, link b the journal. ``Solution.film`` evaluates it.
    stiffness, misfit : mapping of str to float, optional
        Reaction component -> stiffness [force / length, moment] or misfit [length, rad] of the seat, for ``redundant="elastic"``: what is
        left out is rigid and in its place, a stiffness of 0 carries nothing.

    Raises
    ------
    DeclarationError
        From ``Mechanism``, which checks all pairs.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.Pair("B", "C", "crank", "rod", point=(0.1, 0, 0), axis=(0, 0, 1)).freedom_names
    ('B.Rz', 'B.Tz')
    """

    name: Annotated[str, TEXT("freedoms are named NAME.Rz and so on")]
    type: Annotated[Any, TEXT("R P H C U S E Sc Sg Cp Sp Tc Fr W, with a curve Ps Kc Rg, or a `[[pair_type]]`")]
    a: Annotated[str, LINK_NAME("first link; groove, plane and slot belong to it; the reaction is that of `a` on `b`")]
    b: Annotated[str, LINK_NAME("second link")]
    _: KW_ONLY
    point: Annotated[Any, POINT("a point of the pair, global, at the declared configuration", LENGTH)] = None
    axis: Annotated[
        Any,
        DIRECTION(
            "axis, plane normal or groove direction (z of the marker), global, any length", default="z for S and W"
        ),
    ] = None
    second: Annotated[Any, across("x of the marker; must be perpendicular to `axis` for U, Sc, Cp")] = None
    pitch: Annotated[
        float | None, NUMBER("advance per radian of H, right-hand positive", LENGTH, default="exactly one")
    ] = None
    lead: Annotated[
        float | None,
        NUMBER("advance per turn of H", LENGTH, default="of the two", held_in=("pitch", 1 / (2 * np.pi))),
    ] = None
    on_a: Annotated[
        Marker | None, NESTED("marker on link a, in its frame; instead of `point` and `axis`", table="marker")
    ] = None
    on_b: Annotated[Marker | None, NESTED("marker on link b, in its frame", table="marker")] = None
    closed: Annotated[
        str,
        TEXT(
            'of a contact: b is held on both sides, `"form"`, or only pushed, `"force"`',
            choices=("form", "force", ""),
            default='as `"form"`; an open profile that would have to pull asks for it',
        ),
    ] = ""
    restitution: Annotated[
        float | None,
        NUMBER(
            '0 to 1: in `respond` the contact, `closed = "force"`, opens, and lands so',
            minimum=0.0,
            default="it stays closed",
        ),
    ] = None
    gap: Annotated[float, NUMBER("by how much it is open where `respond` starts", LENGTH, minimum=0.0)] = 0.0
    radius: Annotated[float | None, POSITIVE("of the ball or cylinder of a contact, on b", LENGTH)] = None
    hertz: Annotated[Hertz | None, NESTED("materials of a contact, for its pressure", table="hertz")] = None
    curve: Annotated[Curve | None, NESTED("curve on link a along which the marker travels", table="curve")] = None
    curve_b: Annotated[Curve | None, NESTED("curve on link b, of Kc", table="curve", default="a straight face")] = None
    roller: Annotated[
        float | None,
        POSITIVE(
            "radius of a roller on `curve`, or a ball on `surface`; `point` is its center", LENGTH, default="none"
        ),
    ] = None
    surface: Annotated[
        Surface | None, NESTED("surface on link a on which the center of a sphere travels, of Sp", table="surface")
    ] = None
    film: Annotated[Journal | None, NESTED("oil film of a journal bearing, of R or C", table="film")] = None
    stiffness: Annotated[
        Stiffness | None, NESTED("of the seat by reaction components", table="stiffness", default="rigid")
    ] = None
    misfit: Annotated[Misfit | None, NESTED("of the seat by reaction components", table="misfit", default="none")] = (
        None
    )
    contact: ClassVar[PlacedRow | None] = None
    asked_point: ClassVar[Any] = None
    """The point as it was given, where the pair travels on a curve or surface and ``point`` is the nearest place on it."""

    def __post_init__(self) -> None:
        self.read_numbers()
        put = partial(object.__setattr__, self)
        for what, kind in SEATS.items():
            given = getattr(self, what)
            if isinstance(given, Mapping):
                put(what, kind(**given))
        put("type", row_of(self.type, self.curve, self.surface))
        if self.curve is not None or self.surface is not None:
            try:
                contact = self._on_its_shape()
            except ShapeError as error:
                raise error.of(self.name) from error.__cause__
            if contact is not None:
                self._place(contact)
        if self.axis is None and self.point is not None and isinstance(self.type, PairType) and not self.type.directed:
            put("axis", (0.0, 0.0, 1.0))
        self.fill_directions()

    def _on_its_shape(self) -> PlacedRow | None:
        """The row with the curves or the surface that are given; None where they have faults."""
        row, point, axis, on_a, on_b = self.type, self.point, self.axis, self.on_a, self.on_b
        if point is None and isinstance(on_a, Marker):
            point, axis = on_a.point, on_a.axis
        towards = axis if point is not None and is_numeric(axis, (3,)) else None
        apart = on_b.pose() if isinstance(on_b, Marker) and not on_b.faults("", 1.0) else None
        curve, surface, curve_b, roller = self.curve, self.surface, self.curve_b, self.roller
        if isinstance(curve, Curve) and not curve_faults(row, curve, curve_b, roller, point, ""):
            return in_contact(row, curve, curve_b, roller, point, towards, self.name, apart)
        if curve is None and isinstance(surface, Surface) and not surface_faults(row, surface, point, "", roller):
            return on_surface(row, surface, point, towards, self.name, apart, roller)
        return None

    def _place(self, contact: PlacedRow) -> None:
        """Put the pair where its curve or surface is nearest to the place that was asked for."""
        on_a, on_b = self.on_a, self.on_b
        point = on_a.point if self.point is None and isinstance(on_a, Marker) else self.point
        second, _, axis, at = map(tuple, contact.marker.T.tolist())
        placed = {"contact": contact, "asked_point": point if on_b is None else None, "type": contact.row}
        if on_b is None:
            placed |= {"point": at, "axis": axis, "second": second}
        else:
            placed |= {"point": None, "axis": None, "second": None, "on_a": Marker(at, axis, second)}
        if contact.marker_b is not None:
            x, _, z, at = contact.marker_b.T.tolist()
            placed["on_b"] = Marker(at, z, x)
        vars(self).update(placed)

    def replace(self, **changes: Any) -> Pair:
        """A copy with fields changed; a point that is off its curve or surface stays so, to be refused by the mechanism."""
        asked = {} if self.asked_point is None else {"point": self.asked_point}
        return super().replace(**{**asked, **changes})

    def reshaped(self, **changes: Any) -> Pair:
        """The same pair with fields changed; with another curve or surface its marker on b stays, that on a goes to the nearest place."""
        if self.contact is None or not changes.keys() & self.curves.keys():
            return self.replace(**changes)
        on_a, on_b = self.markers
        begins = self.on_b is not None and self.replace(on_a=None).type == self.type
        if on_a is not None and isinstance(curve := changes.get("curve", self.curve), Curve):
            on_a = on_a.replace(point=kept_side(self.type, curve, changes.get("roller", self.roller), on_a.point))
        placed = {"point": None, "axis": None, "second": None, "on_a": None if begins else on_a, "on_b": on_b}
        return self.replace(**placed, **changes)

    @property
    def has_geometry(self) -> bool:
        """Whether the pair says where it sits."""
        return self.point is not None or self.axis is not None or self.on_a is not None or self.on_b is not None

    @property
    def says_more(self) -> bool:
        """Whether it says more than its type and where it sits."""
        return any(one is not usual for one, usual in zip(SAID_MORE(self), SAID_MORE(Pair), strict=True))

    @property
    def curves(self) -> dict[str, Any]:
        """What says along which curves it travels."""
        return {"curve": self.curve, "curve_b": self.curve_b, "roller": self.roller, "surface": self.surface}

    @property
    def radius_b(self) -> float | None:
        """Radius of the ball, roller or cylinder on link b, where it is known."""
        rolls = self.curve.roller if isinstance(self.curve, Curve) else None
        return self.roller or rolls or self.radius

    @property
    def pitch_per_radian(self) -> float:
        """Advance per radian; 0 where the type takes none."""
        if self.lead is not None:
            return self.lead / (2 * np.pi)
        return 0.0 if self.pitch is None else self.pitch

    @cached_property
    def markers(self) -> tuple[Marker, Marker]:
        """The markers on ``a`` and ``b``; for the point/axis form one marker in coinciding frames."""
        if self.on_a is not None and self.on_b is not None:
            return self.on_a, self.on_b
        marker = Marker(self.point, self.axis, self.second)
        return marker, marker

    @property
    def freedom_names(self) -> tuple[str, ...]:
        """Full names of the freedoms, ``"B.Tz"``."""
        if not isinstance(self.type, PairType) or not isinstance(self.name, str):
            return ()
        return tuple(f"{self.name}.{f.name}" for f in self.type.freedoms)

    def in_units(self, base: tuple[float, float, float], turns: bool = False) -> Pair:
        """The same pair with its numbers, and the lengths in a type of its own, in other units (see ``Described``)."""
        return super().in_units(base, turns).replace(type=(self.type.spatial or self.type).scaled(1 / base[0]))

    def faults(self, tol: float = 0.0) -> list[str]:
        """What is wrong with this pair alone, one line each, in a mechanism whose directions are meant to ``tol``."""
        where = f"pair {shown(self.name)}: "
        if not isinstance(self.name, str) or not self.name:
            return [f"{where}the name must be a non-empty text"]
        if not isinstance(self.type, PairType):
            return [
                f"{where}unknown type {shown(self.type)}; known: {', '.join({**TABLE, **ROWS})}, or pass a PairType"
            ]
        found: list[str | None] = [
            wrong(end, where + side, "the name of a link")
            for side, end in (("a", self.a), ("b", self.b))
            if not isinstance(end, str | None)
        ]
        if isinstance(self.a, str) and isinstance(self.b, str) and self.a == self.b:
            found.append(f"{where}joins link {self.a!r} to itself; a pair joins two links")
        curved = [*shape_faults_of(self, where, tol)]
        found += [*self._pitch_faults(where), *contact_faults(self, where), *curved]
        found += [] if self.film is None else film_faults(self, where)
        found += seat_faults(self, where)
        most = largest_cosine(tol) if self.type.square_second else 1 - SHAPES.parallel
        if self.contact is not None or not curved:  # a curve or surface that is at fault says no markers
            found += self._form_faults(where)
        if self.on_a is not None and self.on_b is not None:
            for side, marker in (("on_a", self.on_a), ("on_b", self.on_b)):
                if isinstance(marker, Marker):
                    found += marker.faults(f"{where}{side}.", most)
                else:
                    found.append(wrong(marker, where + side, "a Marker, mg.Marker(point, axis)"))
        elif self.point is not None and self.axis is not None:
            found += Marker(self.point, self.axis, self.second).faults(where, most)
        return [fault for fault in found if fault]

    def _form_faults(self, where: str) -> Iterator[str]:
        """What is missing or too much of a point with an axis, or markers."""
        if (self.on_a is None) != (self.on_b is None):
            missing = "on_b" if self.on_b is None else "on_a"
            yield f"{where}{missing} is missing; a pair by markers needs one on each link"
        elif self.on_a is not None and (self.point is not None or self.axis is not None):
            yield f"{where}has both point/axis and markers on_a/on_b; give one form"
        elif self.on_a is None and self.has_geometry:
            if self.point is None:
                yield f"{where}has an axis but no point; give point=(x, y, z), two numbers where planar=True"
            if self.axis is None:
                yield f"{where}has a point but no axis; type {self.type.symbol} needs axis=(x, y, z)"

    def _pitch_faults(self, where: str) -> Iterator[str | None]:
        given = [(n, v) for n, v in (("pitch", self.pitch), ("lead", self.lead)) if v is not None]
        if not self.type.takes_pitch:
            yield from (
                f"{where}{n} = {shown(v)}: type {self.type.symbol} has no pitch; leave it out" for n, v in given
            )
        elif len(given) == 2:
            yield f"{where}has both pitch and lead; give exactly one (lead = 2 pi pitch)"
        elif not given and self.has_geometry:
            yield f"{where}type {self.type.symbol} needs a pitch (advance per radian) or a lead (advance per turn)"
        yield from (self.formats[n].fault(v, where + n) for n, v in given)


def types_of(pairs: Sequence[Pair]) -> list[Any]:
    """The types of pairs, each object once."""
    return list({id(pair.type): pair.type for pair in pairs}.values())


def are_names(names: Sequence[Any]) -> bool:
    """Whether all of them are texts that say something."""
    return set(map(type, names)) <= {str} and all(names)


def pairs_are_sound(pairs: Sequence[Pair], tol: float) -> bool:
    """Whether every pair passes, checked in columns; False where it takes a closer look."""
    types = types_of(pairs)
    if not are_names([p.name for p in pairs]) or not all(isinstance(t, PairType) for t in types):
        return False
    a, b = [p.a for p in pairs], [p.b for p in pairs]
    if not set(map(type, a)) | set(map(type, b)) <= {str} or any(map(operator.eq, a, b)):
        return False
    closer = {id(t) for t in types if t.takes_pitch or travels(t)}
    if any(p.faults(tol) for p in pairs if p.says_more or id(p.type) in closer):
        return False
    by_markers = [p for p in pairs if p.on_a is not None or p.on_b is not None]
    if not all(isinstance(side, Marker) for p in by_markers for side in (p.on_a, p.on_b)):
        return False
    by_point = [p for p in pairs if p.point is not None or p.axis is not None]
    if by_markers and any(p.on_a is not None for p in by_point):
        return False
    markers = [*by_point, *(p.on_a for p in by_markers), *(p.on_b for p in by_markers)]
    square = np.array([p.type.square_second for p in (*by_point, *by_markers, *by_markers)], dtype=bool)
    return _markers_are_sound(markers, np.where(square, largest_cosine(tol), 1 - SHAPES.parallel))


def _markers_are_sound(markers: Sequence[Any], most: Array) -> bool:
    """Whether points, axes and second directions (of markers or of pairs placed by point and axis) are what they must be.

    ``most`` are the largest cosines that axis and second direction may have.
    """
    p, z, x = (column([getattr(marker, name) for marker in markers], (3,)) for name in ("point", "axis", "second"))
    if p is None or z is None or x is None:
        return False
    length = np.sqrt((z * z).sum(axis=1)), np.sqrt((x * x).sum(axis=1))
    if not all((one > 1e-12).all() for one in length):
        return False
    cosine = np.abs((z * x).sum(axis=1)) / (length[0] * length[1])
    return not (cosine > most).any()


def are_placed(m: Any) -> bool:
    """Whether every pair says where it sits, without faults."""
    return all(pair.has_geometry for pair in m.pairs) and (
        pairs_are_sound(m.pairs, 0.0) or not any(pair.faults() for pair in m.pairs)
    )
