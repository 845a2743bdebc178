"""Gears and pulleys as places on links, and the lines along which they act.

A coupling along a line knows that from the poses of both links: its relation ``phi`` is dual to its force. With the point P and the unit
direction n of the force on link b,

    d phi / dt = n . (v_b - v_a) at P = sum_j s_j G . S_j q'_j,   G = (P x n, n),

over the freedoms j of the pairs on a way from a to b, passed in the sense ``s_j``. So the multiplier is the force, whatever the bearings
of the links are.

Cylindrical gears on parallel axes: with e the unit direction from axis a to axis b, t = z x e, their distance d, base radii k_a, k_b
(negative with teeth inside), k = k_a + k_b and the working angle cos w = |k| / d, a flank of side s (1: a positive turn of gear a drives
gear b, -1: the other one) has, up to the factor cos b of the base helix angle b of gear a,

    n = sgn(k_a k) cos w t + s sgn(k) sin w e - tan b z
    phi = -sgn(k_a) (k_a theta_a + k_b theta_b) + s k inv w - tan b h,   inv x = tan x - x,

theta the angles of the marks against e about z and h the advance of b along z: exact wherever the centers go. In a rack the line of action
stands still. Axes that cross or intersect keep their places: the line stands still between them, and phi is the sum of n . (z x r) theta +
n . z h over both gears.

Sources: Litvin and Fuentes, Gear Geometry and Applied Theory, 2004, chapters 10, 14 to 19; ISO 21771:2007, Cylindrical involute gears and
gear pairs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import field
from functools import cached_property, partial
from math import atan, cos, pi, tan
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np

from mechgraph.errors import DeclarationError
from mechgraph.fields import (
    DIRECTION,
    FLAG,
    INTEGER,
    LINK_NAME,
    NUMBER,
    POINT,
    POSITIVE,
    TEXT,
    Described,
    second_direction,
)
from mechgraph.maths.se3 import Array, compose, cross, identity, inverse
from mechgraph.memo import dataclass
from mechgraph.model.couplings import (
    FULL,
    PRESSURE,
    BaseCoupling,
    MeshStep,
    fitting_of,
    meeting,
    motion_of,
    plain_pairs,
    tooth_angle,
)
from mechgraph.pairs import pair_type as evaluation
from mechgraph.quantities import LENGTH, PURE, door, repeated, shown, unknown, wrong

# --- couplings along lines ------------------------------------------------------------------------------------------


class LinePlaces(NamedTuple):
    """Places on links: points, unit axes, and unit directions at right angles to these, ``(3, n, T)`` each."""

    point: Array
    axis: Array
    mark: Array


class LinesAt(NamedTuple):
    """Values ``phi (n, T)``, lengths, and the lines of the forces on b: points and unit directions ``(3, n, T)``."""

    value: Array
    point: Array
    along: Array


Relation = Callable[[LinePlaces, LinePlaces, Array], LinesAt]
"""What places on links a and b and lengths ``(k, n, T)`` of the coupling make: analytic in the places."""


class LinkPlace(NamedTuple):
    """A link by its name with a point, an axis and a direction at right angles to it, in the link's frame."""

    link: str
    point: tuple[float, ...]
    axis: tuple[float, ...]
    mark: tuple[float, ...]

    def seen(self, pose: Array) -> LinePlaces:
        """The place on a link with that pose ``(3, 4)``, as ``(3, 1, 1)`` each."""
        R, vectors = pose[:, :3], (np.asarray(self.point), np.asarray(self.axis), np.asarray(self.mark))
        point, axis, mark = ((R @ v)[:, None, None] for v in vectors)
        return LinePlaces(point + pose[:, 3][:, None, None], axis, mark)


class LineCoupling(BaseCoupling):
    """What couplings share whose force acts along a line between the links of two places.

    ``linear``: whether the relation is one of freedoms with constant coefficients, so that it is solved as that; else it is evaluated
    from the poses. ``numbers``: its lengths. ``period``: by what its value grows from tooth to tooth, where the residue tells as much.
    ``other``: the relation of the other flank of teeth, which negative multipliers press on, its line reversed so that the sense of the
    relation stays. ``longer``: by how much the closed row is above its value at the start. ``turning``: which of both turn
    about their axes; a rack slides along its own. ``play``: a slide by whose growth the value of a closed row grows.
    """

    ends: tuple[LinkPlace, LinkPlace]
    relation: Relation
    other: Relation | None = None
    numbers: tuple[float, ...] = ()
    period: float = float("inf")
    longer: float = 0.0
    linear: bool = False
    turning: tuple[bool, bool] = (True, True)
    play: str = ""
    terms = ()
    constant = None
    is_force = True

    @property
    def text(self) -> str:
        """The linear relation, or what stands for it."""
        return super().text if self.linear else "n . (v_b - v_a) = 0 along its line"

    def whole_turns(self, along: Array, a: LinePlaces, b: LinePlaces, turned: Callable[[str], Array]) -> Array | None:
        """What whole turns add to the value ``(T,)`` of a row with the direction ``along (3, 1, T)`` between two places, by how much
        freedoms have grown since the start, ``turned(name) (T,)``; None where its residue modulo ``period`` tells as much.
        """
        return None

    keeps: str = "axes that stay parallel: hold the shafts in bearings"
    """What its relation is about, and what to do for it."""

    def strayed(self, a: LinePlaces, b: LinePlaces, a0: LinePlaces, b0: LinePlaces) -> tuple[Array, Array]:
        """Sines of angles and lengths ``(n, T)`` by which places are out of those that its relation is about, where they were ``a0, b0``
        ``(3, n, 1)`` at the start.
        """
        lean = cross(a.axis, b.axis)
        return np.sqrt(dot(lean, lean)), np.zeros(lean.shape[1:])

    def _put(self, m: Any, steps: tuple[MeshStep, ...], coefficients: Mapping[str, float] | None, **known: Any) -> Self:
        """The same with what it has in a mechanism; ``coefficients`` by freedom where the relation is linear."""
        out = self.replace()
        names = [name for step in steps for name in m.pairs[step.pair].freedom_names]
        terms = tuple(coefficients.items()) if coefficients is not None else tuple((name, 1.0) for name in names)
        vars(out).update(known, terms=terms, steps=steps, linear=coefficients is not None)
        return out


def moving_lines(m: Any) -> tuple[str, ...]:
    """Names of the couplings whose rows are evaluated from poses."""
    return tuple(c.name for c in m.couplings if isinstance(c, LineCoupling) and not c.linear)


def pose_along(m: Any, steps: tuple[MeshStep, ...]) -> Array:
    """The pose ``(3, 4)`` of the link at the end of a way in the frame of the first one, at the start of a mechanism."""
    out = identity()
    for step in steps:
        pair = m.pairs[step.pair]
        q = np.array([getattr(m, "start", {}).get(name, 0.0) for name in pair.freedom_names], dtype=float)[
            :, None, None
        ]
        if pair.on_a is None and not q.any():
            continue
        x = evaluation.coordinates_to_state(pair.type, q)
        pitch = np.full((1, 1), pair.pitch_per_radian)
        moved = evaluation.frames_of(pair.type, pitch, x)[-1][:, :, 0, 0]
        A, B = (marker.pose() for marker in pair.markers)
        there = compose(compose(A, moved), inverse(B))
        out = compose(out, there if step.sense > 0 else inverse(there))
    return out


# --- relations -----------------------------------------------------------------------------------------------------------


def involute(a: Any) -> Any:
    """``tan a - a``."""
    return np.tan(a) - a


def dot(a: Array, b: Array) -> Array:
    """Products of vectors along the first axis."""
    return np.asarray((a * b).sum(axis=0))


def angle(u: Array, m: Array, z: Array) -> Array:
    """Angles about ``z`` from directions ``u`` to ``m``, at right angles to it, in (-pi, pi]; analytic in all of them."""
    y, x = dot(cross(u, m), z), dot(u, m)
    out = np.arctan2(y.real, x.real)
    if not (np.iscomplexobj(y) or np.iscomplexobj(x)):
        return np.asarray(out)
    return np.asarray(out + 1j * (x.real * y.imag - y.real * x.imag) / (x.real**2 + y.real**2))


def _middle(h: Array, half_a: Array, half_b: Array) -> Array:
    """Middle of the widths that overlap, along the axis from the middle of a, where that of b stands at ``h``."""
    low = np.where((h - half_b).real > -half_a, h - half_b, -half_a)
    high = np.where((h + half_b).real < half_a, h + half_b, half_a)
    return np.asarray((low + high) / 2)


def cylindrical(side: float, a: LinePlaces, b: LinePlaces, numbers: Array) -> LinesAt:
    """See the head; ``numbers``: k_a, k_b, k_a tan b, half the widths of both."""
    ka, kb, rise, half_a, half_b = numbers
    k, z, d = ka + kb, a.axis, b.point - a.point
    h = dot(d, z)
    across = d - h * z
    distance = np.sqrt(dot(across, across))
    e = across / distance
    t, cosine = cross(z, e), np.abs(k) / distance
    sine = np.sqrt(np.where((1.0 - cosine * cosine).real > 0.0, 1.0 - cosine * cosine, np.nan))
    lean = rise / ka
    straight = 1.0 / np.sqrt(1.0 + lean * lean)
    n = straight * (np.sign(ka * k) * cosine * t + side * np.sign(k) * sine * e - lean * z)
    turns = ka * angle(e, a.mark, z) + kb * angle(e, b.mark, z)
    working = sine / cosine - np.arctan2(sine.real, cosine.real)  # of the value real parts are asked for alone
    value = straight * (side * k * working - np.sign(ka) * turns - lean * h)
    P = a.point + e * (ka / k * distance) + z * _middle(h, half_a, half_b)
    return LinesAt(value, P, n)


def racked(side: float, sign: float, a: LinePlaces, b: LinePlaces, numbers: Array) -> LinesAt:
    """A pinion and a rack, of which the axis is the direction of its teeth in a row and the mark the normal out of these.

    ``numbers``: base radius, pitch radius, base radius times tan b, half the widths of both. ``sign``: -1 where the rack comes first.
    """
    pinion, rack = (a, b) if sign > 0 else (b, a)
    base, radius, rise, half_a, half_b = numbers
    e, cosine = -rack.mark, base / radius
    z = cross(rack.axis, rack.mark)
    z = z * np.where(dot(z, pinion.axis).real < 0.0, -1.0, 1.0)
    t, sine, lean = cross(z, e), np.sqrt(1.0 - cosine * cosine), rise / base
    straight = 1.0 / np.sqrt(1.0 + lean * lean)
    n = straight * (cosine * t + side * sine * e - lean * z)
    d = rack.point - pinion.point
    value = dot(n, d) - straight * base * angle(e, pinion.mark, z)
    P = pinion.point + radius * e + z * _middle(dot(d, z), half_a, half_b)
    return LinesAt(value, P, sign * n)


def feet(a: LinePlaces, b: LinePlaces) -> tuple[Array, Array, Array]:
    """Points of both axes where they are nearest to each other, and the unit direction across both."""
    w, d = cross(a.axis, b.axis), b.point - a.point
    square = dot(w, w)
    on_a, on_b = (p.point + p.axis * (dot(cross(d, q.axis), w) / square) for p, q in ((a, b), (b, a)))
    return on_a, on_b, w / np.sqrt(square)


def between_axes(side: float, a: LinePlaces, b: LinePlaces, numbers: Array) -> LinesAt:
    """Axes that cross or intersect: the line stands still in the frame of a's axis, the common perpendicular and what is across both.

    ``numbers``: a length u, the point from the foot of the perpendicular on axis a, u times the direction of side 1, and of side -1.
    """
    u, P, n = numbers[0], numbers[1:4], (numbers[4:7] if side > 0 else numbers[7:10]) / numbers[0]
    foot_a, foot_b, w = feet(a, b)
    frame = (a.axis, w, cross(a.axis, w))
    at = foot_a + sum(x * v for x, v in zip(P, frame, strict=True))
    along = sum(x * v for x, v in zip(n, frame, strict=True))
    value = 0.0 * u
    for place, foot, sign in ((a, foot_a, -1.0), (b, foot_b, 1.0)):
        power = dot(along, cross(place.axis, at - foot))
        value = value + sign * power * angle(w, place.mark, place.axis)
        value = value + sign * dot(along, place.axis) * dot(place.point - foot, place.axis)
    return LinesAt(value, at, along)


CYLINDRICAL = {side: partial(cylindrical, side) for side in (1.0, -1.0)}
RACKED = {(side, sign): partial(racked, side, sign) for side in (1.0, -1.0) for sign in (1.0, -1.0)}
CROSSING = {side: partial(between_axes, side) for side in (1.0, -1.0)}


# --- gears ---------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _OnLink(Described):
    """What gears and pulleys share: a place on a link."""

    kind: ClassVar[str]
    name: Annotated[str, TEXT("differs from all gears and pulleys")]
    link: Annotated[str, LINK_NAME("the link on which it is")]

    @cached_property
    def place(self: Any) -> LinkPlace:
        """The place with unit directions."""
        axis: Array = np.asarray(self.axis, dtype=float)
        axis = axis / np.linalg.norm(axis)
        mark: Array = np.asarray(getattr(self, "mark", None) or second_direction(axis), dtype=float)
        mark = mark - axis * (mark @ axis)
        return LinkPlace(self.link, self.point, tuple(axis), tuple(mark / np.linalg.norm(mark)))

    def value_faults(self, where: str) -> list[str]:
        """See ``Described``."""
        found = super().value_faults(where)
        if getattr(self, "axis", None) is None:
            found.append(f"{where}axis: is missing; give a direction, e.g. (0, 0, 1) (planar=True needs none)")
        return found


class _Toothed(_OnLink):
    """Gears."""

    def value_faults(self, where: str) -> list[str]:
        """See ``Described``."""
        found = super().value_faults(where)
        if not found and getattr(self, "teeth", 1) < 1:
            found.append(wrong(self.teeth, where + "teeth", "1 or more"))  # type: ignore[attr-defined]
        return found


class _Involute(_Toothed):
    """Cylindrical gears and racks: angles of their teeth."""

    if TYPE_CHECKING:
        module: float
        pressure_angle: float
        helix_angle: float

    @property
    def transverse_angle(self) -> float:
        """Pressure angle in the plane across the axis."""
        return atan(tan(self.pressure_angle) / cos(self.helix_angle))

    @property
    def base_lean(self) -> float:
        """Tangent of the helix angle on the base cylinder."""
        return tan(self.helix_angle) * cos(self.transverse_angle)

    @property
    def base_pitch(self) -> float:
        """Distance of flanks along their common normal."""
        return pi * self.module * cos(self.pressure_angle)


_POINT = POINT("in the middle of its width, on its axis", LENGTH)
_MODULE = POSITIVE("normal module, at the pitch circle", LENGTH)
_HELIX = tooth_angle("at the pitch circle, right-hand positive")
_WIDTH = POSITIVE("of the teeth", LENGTH, default="wider than the other gear")
_MARK = DIRECTION("across the axis: the middle of a tooth", default="one across the axis, of no meaning")


@dataclass(frozen=True)
class Gear(_Involute):
    """Declare a cylindrical gear, a place on a link, for ``Mechanism(gears=[...])`` and ``Mesh``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> round(mg.Gear("g1", "shaft", 19, (0, 0, 0), (0, 0, 1), module=0.002).radius, 6)
    0.019
    """

    kind: ClassVar[str] = "gear"
    teeth: Annotated[int, INTEGER("number of teeth")]
    point: Annotated[Any, _POINT]
    axis: Annotated[Any, DIRECTION("its axis", normal=True, default="in a plane its normal")] = None
    module: Annotated[float, _MODULE] = field(kw_only=True)
    pressure_angle: Annotated[float, PRESSURE] = FULL
    helix_angle: Annotated[float, _HELIX] = 0.0
    shift: Annotated[float, NUMBER("profile shift, in modules; outwards positive")] = 0.0
    internal: Annotated[bool, FLAG("whether its teeth are inside")] = False
    width: Annotated[float | None, _WIDTH] = None
    mark: Annotated[Any, _MARK] = None

    @property
    def radius(self) -> float:
        """Of the pitch circle, ``m z / (2 cos beta)``."""
        return float(self.module * self.teeth / (2 * cos(self.helix_angle)))

    @property
    def base_radius(self) -> float:
        """Of the base circle, negative with teeth inside."""
        return (-1.0 if self.internal else 1.0) * self.radius * cos(self.transverse_angle)


@dataclass(frozen=True)
class GearRack(_Involute):
    """Declare a rack, a place on a link, for ``Mechanism(gears=[...])`` and ``Mesh``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.GearRack("r", "slide", (0, -0.02, 0), direction=(1, 0, 0), normal=(0, 1, 0), module=0.002).name
    'r'
    """

    kind: ClassVar[str] = "rack"
    point: Annotated[Any, POINT("in the middle of its width, on the pitch line", LENGTH)]
    direction: Annotated[Any, DIRECTION("in which its teeth stand in a row, across the axis of the pinion")]
    normal: Annotated[Any, DIRECTION("out of its teeth, towards the pinion")]
    module: Annotated[float, _MODULE]
    pressure_angle: Annotated[float, PRESSURE] = FULL
    helix_angle: Annotated[float, tooth_angle("minus that of its pinion")] = 0.0
    width: Annotated[float | None, _WIDTH] = None

    @property
    def axis(self) -> Any:
        """The direction of its teeth in a row."""
        return self.direction

    @property
    def mark(self) -> Any:
        """The normal."""
        return self.normal


@dataclass(frozen=True)
class BevelGear(_Toothed):
    """Declare a bevel gear, a place on a link, for ``Mechanism(gears=[...])`` and ``Mesh``; it is on the side of the apex of its point.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.BevelGear("b", "shaft", 20, (0.1, 0, 0), (1, 0, 0), module=0.002).teeth
    20
    """

    kind: ClassVar[str] = "bevel"
    teeth: Annotated[int, INTEGER("number of teeth")]
    point: Annotated[Any, POINT("on its axis, on the side of the apex where it is", LENGTH)]
    axis: Annotated[Any, DIRECTION("its axis")]
    module: Annotated[float, POSITIVE("at the middle of the face", LENGTH)]
    pressure_angle: Annotated[float, PRESSURE] = FULL
    spiral_angle: Annotated[float, tooth_angle("right-hand positive, minus that of its mate")] = 0.0
    cone: Annotated[
        float | None,
        NUMBER("half angle of its pitch cone", PURE, default="as teeth and axes ask for", degrees=True, below=pi),
    ] = None
    mark: Annotated[Any, _MARK] = None


@dataclass(frozen=True)
class Worm(_Toothed):
    """Declare a worm, a place on a link, for ``Mechanism(gears=[...])`` and ``Mesh``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.Worm("w", "shaft", 2, (0, 0, 0), (1, 0, 0), radius=0.01).teeth
    2
    """

    kind: ClassVar[str] = "worm"
    teeth: Annotated[int, INTEGER("number of starts")]
    point: Annotated[Any, POINT("on its axis", LENGTH)]
    axis: Annotated[Any, DIRECTION("its axis")]
    radius: Annotated[float, POSITIVE("of the pitch cylinder", LENGTH)]
    pressure_angle: Annotated[float, PRESSURE] = FULL
    left_hand: Annotated[bool, FLAG("whether the thread is left-handed")] = False
    mark: Annotated[Any, _MARK] = None


@dataclass(frozen=True)
class WormWheel(_Toothed):
    """Declare the wheel of a worm, a place on a link, for ``Mechanism(gears=[...])`` and ``Mesh``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.WormWheel("v", "wheel", 40, (0, 0.05, 0), (0, 0, 1)).teeth
    40
    """

    kind: ClassVar[str] = "worm_wheel"
    teeth: Annotated[int, INTEGER("number of teeth")]
    point: Annotated[Any, POINT("on its axis", LENGTH)]
    axis: Annotated[Any, DIRECTION("its axis")]
    mark: Annotated[Any, _MARK] = None


@dataclass(frozen=True)
class Pulley(_OnLink):
    """Declare a pulley or sprocket: a place on a link, for ``Mechanism(gears=[...])`` and the belts over it.

    Give ``radius``, to the middle of the belt, or ``teeth`` and ``pitch``: ``r = teeth pitch / (2 pi)``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.Pulley("p1", "shaft", (0, 0, 0), (0, 0, 1), teeth=20, pitch=0.005).pitch_radius
    0.015915494309189534
    """

    kind: ClassVar[str] = "pulley"
    name: Annotated[str, TEXT("differs from all pulleys")]
    point: Annotated[Any, POINT("its center, in the plane of the belt", LENGTH)]
    axis: Annotated[
        Any,
        DIRECTION(
            "its axis; all pulleys of a belt have the same direction", normal=True, default="in a plane its normal"
        ),
    ] = None
    radius: Annotated[float | None, POSITIVE("to the middle of the belt", LENGTH, default="by teeth")] = None
    teeth: Annotated[int | None, INTEGER("number of teeth", default="none")] = None
    pitch: Annotated[float | None, POSITIVE("of the teeth, along the belt", LENGTH, default="none")] = None

    @property
    def pitch_radius(self) -> float:
        """The radius to the middle of the belt."""
        if self.radius is not None:
            return float(self.radius)
        return float(self.teeth * self.pitch / (2 * np.pi))  # type: ignore[operator]

    def value_faults(self, where: str) -> list[str]:
        """See ``Described``."""
        found = super().value_faults(where)
        given = self.radius is not None, self.teeth is not None and self.pitch is not None
        if not found and (sum(given) != 1 or (self.teeth is None) != (self.pitch is None) or self.teeth == 0):
            found.append(
                f"{where}radius = {shown(self.radius)}, teeth = {shown(self.teeth)}, pitch = {shown(self.pitch)}: "
                "expected the radius, or teeth (1 or more) and their pitch"
            )
        return found


TOOTHED: dict[str, type[_Toothed]] = {kind.kind: kind for kind in (Gear, GearRack, BevelGear, Worm, WormWheel)}
GEARS: dict[str, type[Described]] = {Pulley.kind: Pulley, **TOOTHED}
"""What stands in ``gears=``, by the name of its kind in files."""


def gear_faults(m: Any) -> list[str]:
    """What is wrong with the gears and pulleys of a mechanism by themselves, one line each."""
    faults = []
    for gear in m.gears:
        where = f"{gear.kind} {shown(gear.name)}: "
        faults += gear.value_faults(where)
        if isinstance(gear.link, str) and gear.link not in m.link_index:
            faults.append(where + unknown("link", gear.link, m.link_names()))
    return faults + repeated([gear.name for gear in m.gears if isinstance(gear.name, str)], "gear")


def gears_by_name(m: Any) -> Mapping[str, Any]:
    """The gears of a mechanism that have teeth, by name."""
    return {gear.name: gear for gear in m.gears if isinstance(gear, _Toothed) and isinstance(gear.name, str)}


def tip_radius(gear: Any, shorter: float = 0.0) -> float:
    """Radius of the tip circle, the addendum ``shorter`` by so many modules."""
    if gear.internal:
        return float(gear.radius - gear.module * (1.0 - gear.shift))
    return float(gear.radius + gear.module * (1.0 + gear.shift - shorter))


# --- their places -----------------------------------------------------------------------------------------------------------


def off_axis(m: Any) -> Iterator[str]:
    """Gears and pulleys beside the axis about which their link turns."""
    near, turning, fitting = m.once(meeting), m.once(plain_pairs), fitting_of(m)
    for gear in m.gears:
        pairs = [m.pairs[k] for k, _ in turning.get(gear.link, ())]
        if gear.link == m.frame or isinstance(gear, GearRack) or len(pairs) < len(near[gear.link]):
            continue
        away = {}
        for pair in pairs:
            (p, w), z = pair.markers[int(pair.b == gear.link)].line, np.array(gear.place.axis)
            d = p - gear.point
            if motion_of(pair) == "turn" and np.abs(cross(z, w)).max() <= fitting:
                away[pair.name] = float(np.linalg.norm(cross(d, z))), fitting * max(1.0, float(np.abs(d).max()))
        if away and all(off > least for off, least in away.values()):
            name = min(away, key=away.__getitem__)
            yield (
                f"{gear.kind} {gear.name!r} is {away[name][0]:.6g} beside the axis of pair {name!r}, about which its link turns: it runs "
                "eccentrically; move its point onto that axis if it should not"
            )


@door
def planet_places(sun: int, ring: int, n: int) -> Array:
    """Return the angles ``(n,)`` [rad] at which ``n`` planets between a sun and a ring can be put in, as evenly as teeth allow.

    The planets have ``(ring - sun) / 2`` teeth. Even places need ``(sun + ring) / n`` whole; others are multiples of ``2 pi / (sun +
    ring)``. Neighbors need ``(sun + planet) sin(pi / n) > planet + 2``.

    Parameters
    ----------
    sun, ring, n : int
        Teeth of the sun and of the ring; number of planets.

    Raises
    ------
    DeclarationError
        Planets that would overlap, or whose teeth are no whole number.

    Examples
    --------
    >>> import mechgraph as mg
    >>> import numpy as np
    >>> np.rad2deg(mg.planet_places(20, 54, 3)).round(4)
    array([  0.    , 121.6216, 238.3784])
    """
    faults = [
        f"{name} = {shown(value)}: expected a whole number above 0"
        for name, value in (("sun", sun), ("ring", ring), ("n", n))
        if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < 1
    ]
    if not faults and (ring - sun < 2 or (ring - sun) % 2):
        faults.append(f"sun = {sun}, ring = {ring}: planets have half the difference, a whole number above 0")
    if not faults:
        planet, steps = (ring - sun) // 2, np.round(np.arange(n) * (sun + ring) / n)
        found = 2 * pi * steps / (sun + ring)
        gaps = np.diff(np.append(found, 2 * pi))
        room = float((sun + planet) * np.sin(min(gaps.min(), pi) / 2)) if n > 1 else np.inf
        if room <= planet + 2:
            faults.append(
                f"n = {n}: neighbors overlap, ({sun} + {planet}) sin(half their angle) = {room:.6g}; expected more than {planet + 2}"
            )
    if faults:
        raise DeclarationError("planet_places", faults)
    return np.asarray(found)
