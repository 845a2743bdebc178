"""Gears as places on links, and meshes between them.

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

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from math import atan, cos, pi, sin, tan
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

import numpy as np

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
from mechgraph.maths.se3 import Array, cross, identity
from mechgraph.model.belts import GEARS as PULLEYS
from mechgraph.model.belts import angle
from mechgraph.model.couplings import (
    Axes,
    BevelGears,
    MeshStep,
    WormGear,
    fitting_of,
    motion_of,
    teeth_lines,
)
from mechgraph.model.lines import LineCoupling, LinesAt, LinkPlace, Places, Relation, meeting, pose_along, way
from mechgraph.model.pair import Pair
from mechgraph.pairs.pair_type import PairType
from mechgraph.quantities import LENGTH, PURE, shown, unknown, wrong

_FULL = float(np.deg2rad(20.0))


def involute(a: Any) -> Any:
    """``tan a - a``."""
    return np.tan(a) - a


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b).sum(axis=0))


# --- relations -----------------------------------------------------------------------------------------------------------


def _middle(h: Array, half_a: Array, half_b: Array) -> Array:
    """Middle of the widths that overlap, along the axis from the middle of a, where that of b stands at ``h``."""
    low = np.where((h - half_b).real > -half_a, h - half_b, -half_a)
    high = np.where((h + half_b).real < half_a, h + half_b, half_a)
    return np.asarray((low + high) / 2)


def cylindrical(side: float, a: Places, b: Places, numbers: Array) -> LinesAt:
    """See the head; ``numbers``: k_a, k_b, k_a tan b, half the widths of both."""
    ka, kb, rise, half_a, half_b = numbers
    k, z, d = ka + kb, a.axis, b.point - a.point
    h = _dot(d, z)
    across = d - h * z
    distance = np.sqrt(_dot(across, across))
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


def racked(side: float, sign: float, a: Places, b: Places, numbers: Array) -> LinesAt:
    """A pinion and a rack, of which the axis is the direction of its teeth in a row and the mark the normal out of these.

    ``numbers``: base radius, pitch radius, base radius times tan b, half the widths of both. ``sign``: -1 where the rack comes first.
    """
    pinion, rack = (a, b) if sign > 0 else (b, a)
    base, radius, rise, half_a, half_b = numbers
    e, cosine = -rack.mark, base / radius
    z = cross(rack.axis, rack.mark)
    z = z * np.where(_dot(z, pinion.axis).real < 0.0, -1.0, 1.0)
    t, sine, lean = cross(z, e), np.sqrt(1.0 - cosine * cosine), rise / base
    straight = 1.0 / np.sqrt(1.0 + lean * lean)
    n = straight * (cosine * t + side * sine * e - lean * z)
    d = rack.point - pinion.point
    value = _dot(n, d) - straight * base * angle(e, pinion.mark, z)
    P = pinion.point + radius * e + z * _middle(_dot(d, z), half_a, half_b)
    return LinesAt(value, P, sign * n)


def between_axes(side: float, a: Places, b: Places, numbers: Array) -> LinesAt:
    """Axes that cross or intersect: the line stands still in the frame of a's axis, the common perpendicular and what is across both.

    ``numbers``: a length u, the point from the foot of the perpendicular on axis a, u times the direction of side 1, and of side -1.
    """
    u, P, n = numbers[0], numbers[1:4], (numbers[4:7] if side > 0 else numbers[7:10]) / numbers[0]
    za, zb, d = a.axis, b.axis, b.point - a.point
    w = cross(za, zb)
    square = _dot(w, w)
    foot_a = a.point + za * (_dot(cross(d, zb), w) / square)
    foot_b = b.point + zb * (_dot(cross(d, za), w) / square)
    w = w / np.sqrt(square)
    frame = (za, w, cross(za, w))
    at = foot_a + sum(x * v for x, v in zip(P, frame, strict=True))
    along = sum(x * v for x, v in zip(n, frame, strict=True))
    value = 0.0 * u
    for place, foot, sign in ((a, foot_a, -1.0), (b, foot_b, 1.0)):
        power = _dot(along, cross(place.axis, at - foot))
        value = value + sign * power * angle(w, place.mark, place.axis)
        value = value + sign * _dot(along, place.axis) * _dot(place.point - foot, place.axis)
    return LinesAt(value, at, along)


CYLINDRICAL = {side: partial(cylindrical, side) for side in (1.0, -1.0)}
RACKED = {(side, sign): partial(racked, side, sign) for side in (1.0, -1.0) for sign in (1.0, -1.0)}
BETWEEN = {side: partial(between_axes, side) for side in (1.0, -1.0)}


# --- gears ---------------------------------------------------------------------------------------------------------------


class _Toothed(Described):
    """What gears share: a place on a link."""

    kind: ClassVar[str]
    if TYPE_CHECKING:
        name: str
        link: str
        point: Any
        axis: Any
        mark: Any

    def __post_init__(self) -> None:
        self.read_numbers()

    @cached_property
    def place(self) -> LinkPlace:
        """The place with unit directions."""
        axis: Array = np.asarray(self.axis, dtype=float)
        axis = axis / np.linalg.norm(axis)
        mark: Array = np.asarray(second_direction(axis) if self.mark is None else self.mark, dtype=float)
        mark = mark - axis * (mark @ axis)
        return LinkPlace(self.link, self.point, tuple(axis), tuple(mark / np.linalg.norm(mark)))

    def value_faults(self, where: str) -> list[str]:
        """See ``Described``."""
        found = super().value_faults(where)
        if self.axis is None:
            found.append(f"{where}axis: is missing; give a direction, e.g. (0, 0, 1) (planar=True needs none)")
        for name in ("pressure_angle", "helix_angle", "spiral_angle"):
            value = getattr(self, name, 0.0)
            if not found and abs(value) >= 1.2:
                found.append(wrong(value, where + name, "an angle below 1.2 rad"))
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
_PRESSURE = NUMBER("of the flanks, in the normal section", PURE, degrees=True, minimum=0.0)
_HELIX = NUMBER("at the pitch circle, right-hand positive", PURE, degrees=True)
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
    name: Annotated[str, TEXT("differs from all gears and pulleys")]
    link: Annotated[str, LINK_NAME("the link on which it is")]
    teeth: Annotated[int, INTEGER("number of teeth")]
    point: Annotated[Any, _POINT]
    axis: Annotated[Any, DIRECTION("its axis", normal=True, default="in a plane its normal")] = None
    module: Annotated[float, _MODULE] = field(kw_only=True)
    pressure_angle: Annotated[float, _PRESSURE] = _FULL
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
    name: Annotated[str, TEXT("differs from all gears and pulleys")]
    link: Annotated[str, LINK_NAME("the link on which it is")]
    point: Annotated[Any, POINT("in the middle of its width, on the pitch line", LENGTH)]
    direction: Annotated[Any, DIRECTION("in which its teeth stand in a row, across the axis of the pinion")]
    normal: Annotated[Any, DIRECTION("out of its teeth, towards the pinion")]
    module: Annotated[float, _MODULE]
    pressure_angle: Annotated[float, _PRESSURE] = _FULL
    helix_angle: Annotated[float, NUMBER("minus that of its pinion", PURE, degrees=True)] = 0.0
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
    name: Annotated[str, TEXT("differs from all gears and pulleys")]
    link: Annotated[str, LINK_NAME("the link on which it is")]
    teeth: Annotated[int, INTEGER("number of teeth")]
    point: Annotated[Any, POINT("on its axis, on the side of the apex where it is", LENGTH)]
    axis: Annotated[Any, DIRECTION("its axis")]
    module: Annotated[float, POSITIVE("at the middle of the face", LENGTH)]
    pressure_angle: Annotated[float, _PRESSURE] = _FULL
    spiral_angle: Annotated[float, NUMBER("right-hand positive, minus that of its mate", PURE, degrees=True)] = 0.0
    cone: Annotated[
        float | None, NUMBER("half angle of its pitch cone", PURE, default="as teeth and axes ask for", degrees=True)
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
    name: Annotated[str, TEXT("differs from all gears and pulleys")]
    link: Annotated[str, LINK_NAME("the link on which it is")]
    teeth: Annotated[int, INTEGER("number of starts")]
    point: Annotated[Any, POINT("on its axis", LENGTH)]
    axis: Annotated[Any, DIRECTION("its axis")]
    radius: Annotated[float, POSITIVE("of the pitch cylinder", LENGTH)]
    pressure_angle: Annotated[float, _PRESSURE] = _FULL
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
    name: Annotated[str, TEXT("differs from all gears and pulleys")]
    link: Annotated[str, LINK_NAME("the link on which it is")]
    teeth: Annotated[int, INTEGER("number of teeth")]
    point: Annotated[Any, POINT("on its axis", LENGTH)]
    axis: Annotated[Any, DIRECTION("its axis")]
    mark: Annotated[Any, _MARK] = None


TOOTHED: dict[str, type[_Toothed]] = {kind.kind: kind for kind in (Gear, GearRack, BevelGear, Worm, WormWheel)}
GEARS: dict[str, type[Described]] = {**PULLEYS, **TOOTHED}
"""What stands in ``gears=``, by the name of its kind in files."""


def gears_by_name(m: Any) -> Mapping[str, Any]:
    """The gears of a mechanism that have teeth, by name."""
    return {gear.name: gear for gear in m.gears if isinstance(gear, _Toothed) and isinstance(gear.name, str)}


# --- meshes --------------------------------------------------------------------------------------------------------------

FLANKS = ("auto", "forward", "backward")


@dataclass(frozen=True)
class Mesh(LineCoupling):
    """Declare that two gears mesh: on parallel axes (also inside each other), crossing ones, intersecting ones, a worm, a rack.

    The relation is dual to the force, ``n . (v_b - v_a) = 0`` at the pitch point along the line of action, whatever the bearings are; its
    multiplier is the normal force. Where both gears turn on pairs R about their axes, on one carrier, it is linear, ``N_a q_a +- N_b q_b``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> z, at = (0, 0, 1), {"p": (0, 0, 0), "w": (0.06, 0, 0)}
    >>> m = mg.Mechanism(
    ...     "stage",
    ...     pairs=[mg.Pair(k, "R", "frame", k, point=x, axis=z) for k, x in at.items()],
    ...     gears=[mg.Gear(k, k, N, at[k], z, module=0.002) for k, N in (("p", 20), ("w", 40))],
    ...     couplings=[mg.Mesh("m", "p", "w")],
    ...     drives=["p"],
    ... )
    >>> mg.solve(m, {"p": 0.0}, loads=[mg.Effort("w", -3.0)]).coupling("m").force.round(3)
    array([ 27.298, -75.   ,   0.   ])
    """

    kind: ClassVar[str] = "mesh"
    name: Annotated[str, TEXT("name", default="g1, g2, ...")]
    a: Annotated[str, TEXT("the first gear")]
    b: Annotated[str, TEXT("the second gear")]
    backlash: Annotated[
        float, NUMBER("along the pitch circles, beside what the distance leaves", LENGTH, minimum=0.0)
    ] = 0.0
    flank: Annotated[
        str,
        TEXT(
            'which flanks touch: `"auto"` as the load asks where centers stand still, else `"forward"`: those by which a positive turn of '
            'gear a (with a rack, of the pinion) drives gear b; `"backward"`: the others',
            choices=FLANKS,
        ),
    ] = "auto"

    held: ClassVar[tuple[bool, bool]] = (False, False)
    """Which gears must not slide along their axes."""

    def __post_init__(self) -> None:
        self.read_numbers()
        for name, value in (("terms", ()), ("constant", None), ("steps", ())):
            object.__setattr__(self, name, value)

    # --- in a mechanism ----------------------------------------------------------------------------------------------

    def pair_of(self, m: Any) -> tuple[Any, Any]:
        """Both gears."""
        known = m.once(gears_by_name)
        return known[self.a], known[self.b]

    def faults(self, m: Any) -> list[str]:
        """What is wrong with it in a mechanism, one line each."""
        where = f"coupling {shown(self.name)}: "
        known = m.once(gears_by_name)
        found = self.value_faults("")
        found += [f"{side}: {unknown('gear', q, known)}" for side in "ab" if (q := getattr(self, side)) not in known]
        if not found:
            one, two = self.pair_of(m)
            if one.link == two.link:
                found.append(
                    f"{self.a!r} and {self.b!r} are on the same link {one.link!r}; gears that mesh are on two links"
                )
            elif (one.kind, two.kind) not in _KINDS:
                found.append(f"a {one.kind} and a {two.kind} do not mesh; expected {_words_of_kinds(one.kind)}")
            elif m.has_geometry and m.once(_placed_soundly):
                found += self.seen(m).misfits(fitting_of(m))
        return [where + fault for fault in found]

    def seen(self, m: Any) -> Meeting:
        """Both gears where they meet."""
        known = m.once(_meetings)
        if (self.a, self.b) not in known:
            one, two = self.pair_of(m)
            steps = self._steps(m)[0]
            places = one.place.seen(identity()), two.place.seen(pose_along(m, steps))
            known[self.a, self.b] = _KINDS[one.kind, two.kind](one, two, *places)
        met: Meeting = known[self.a, self.b]
        return met

    def _steps(self, m: Any) -> tuple[tuple[MeshStep, ...], bool]:
        """The pairs on the way from a to b, and whether all of them are R or P."""
        one, two = self.pair_of(m)
        plain = way(m, m.once(plain_pairs), one.link, two.link)
        if plain is not None:
            return plain, True
        found = way(m, m.once(meeting), one.link, two.link)
        assert found is not None
        return found, False

    def placed(self, m: Any) -> Self:
        """See ``BaseCoupling``."""
        steps, plain = self._steps(m)
        one, two = self.pair_of(m)
        if not m.has_geometry:
            names = [m.pairs[step.pair].freedom_names for step in steps]
            ones = {name: 1.0 for some in names for name in some}
            return self._put(m, steps, ones if plain else None, ends=(one.place, two.place))
        met = self.seen(m)
        flanks = met.flanks(self.flank != "backward")
        ends, coefficients = (one.place, two.place), None
        if plain:
            line = flanks[0](met.a, met.b, np.array(met.numbers)[:, None, None])
            coefficients = self._coefficients(m, steps, line, ends)
        known = {
            "ends": ends,
            "numbers": met.numbers,
            "relation": flanks[0],
            "period": met.period,
            "held": met.held,
            "other": flanks[1] if self.flank == "auto" else flanks[0],
        }
        return self._put(m, steps, coefficients, **known)

    def _coefficients(
        self, m: Any, steps: tuple[MeshStep, ...], line: LinesAt, ends: tuple[LinkPlace, LinkPlace]
    ) -> dict[str, float] | None:
        """Coefficients by freedom where every pair on the way turns about the axis of one of the gears, or slides along a rack."""
        P, n = line.point[:, 0, 0], line.along[:, 0, 0]
        racks = [isinstance(gear, GearRack) for gear in self.pair_of(m)]
        forward = on_line(m, steps, ends[0], racks[0], fitting_of(m))
        back = tuple(MeshStep(step.pair, -step.sense) for step in reversed(steps[len(forward) :]))
        backward = on_line(m, back, ends[1], racks[1], fitting_of(m))
        if len(forward) + len(backward) < len(steps):
            return None
        met, powers = self.seen(m), []
        for place, rack in zip((met.a, met.b), racks, strict=True):
            z, p = place.axis[:, 0, 0], place.point[:, 0, 0]
            powers.append(float(n @ (z if rack else cross(z, P - p))))
        signs = [*((s, powers[0]) for s in forward), *((s, powers[1]) for s in reversed(backward))]
        return {
            m.pairs[step.pair].freedom_names[0]: step.sense * sign * power
            for step, (sign, power) in zip(steps, signs, strict=True)
        }

    def strayed(self, a: Places, b: Places, a0: Places, b0: Places) -> Array:
        """See ``LineCoupling``: the angle between the axes, and of those that cross their distance and where they are along them."""
        if self.relation not in BETWEEN.values():
            lean = cross(a.axis, b.axis) if self.relation in CYLINDRICAL.values() else 0.0 * a.axis
            return np.asarray(np.sqrt(_dot(lean, lean)))
        places = []
        for p, q in ((a, b), (a0, b0)):
            w, d = cross(p.axis, q.axis), q.point - p.point
            square = _dot(w, w)
            feet = [_dot(cross(d, axis), w) / square for axis in (q.axis, p.axis)]
            places.append((_dot(p.axis, q.axis), _dot(d, w) / np.sqrt(square), *feet))
        found = [now - then for now, then, held in zip(*places, (True, True, *self.held), strict=True) if held]
        return np.asarray(np.abs(found).max(axis=0))

    def in_own_units(self, units: Any, turns: Any) -> Self:
        """See ``BaseCoupling``."""
        return self.without_quantities(units)

    def converted(self, base: tuple[float, float, float], turns: Any) -> Self:
        """See ``BaseCoupling``."""
        return self.in_units(base)


def plain_pairs(m: Any) -> dict[str, list[tuple[int, str]]]:
    """The pairs on every link whose only freedom is a turn or a slide: their places, and the links at their other ends."""
    found: dict[str, list[tuple[int, str]]] = {}
    for k, pair in enumerate(m.pairs):
        if isinstance(pair.type, PairType) and motion_of(pair):
            for link, other in ((pair.a, pair.b), (pair.b, pair.a)):
                found.setdefault(link, []).append((k, other))
    return found


def on_line(m: Any, steps: tuple[MeshStep, ...], place: LinkPlace, slides: bool, fitting: float) -> list[float]:
    """Senses of the first pairs on a way from the link of a gear that turn about its axis (of a rack: the one that slides along it)."""
    p, z = np.asarray(place.point, dtype=float), np.asarray(place.axis)
    senses: list[float] = []
    for step in steps[: 1 if slides else None]:
        pair: Pair = m.pairs[step.pair]
        before, behind = (pair.markers[int((step.sense > 0) == later)] for later in (False, True))
        axis = np.asarray(before.axis, dtype=float)
        w, q = axis / np.sqrt(axis @ axis), np.asarray(before.point, dtype=float)
        off = 0.0 if slides else np.abs(cross(q - p, z)).max() / max(1.0, np.abs(q - p).max())
        if motion_of(pair) != ("slide" if slides else "turn") or max(off, np.abs(cross(z, w)).max()) > fitting:
            break
        senses.append(float(np.sign(z @ w)))
        axis = np.asarray(behind.axis, dtype=float)
        along, z = (p - q) @ z, senses[-1] * axis / np.sqrt(axis @ axis)
        p = np.asarray(behind.point, dtype=float) + along * z
    return senses


def _reached(m: Any) -> set[str]:
    """The links that pairs connect to the frame."""
    out, queue = {m.frame}, [m.frame]
    for link in queue:
        ahead = {other for _, other in m.once(meeting).get(link, ())} - out
        out |= ahead
        queue += sorted(ahead)
    return out


def _meetings(m: Any) -> dict[tuple[str, str], Meeting]:
    """Where gears meet, as far as it was asked for."""
    return {}


def _placed_soundly(m: Any) -> bool:
    """Whether all pairs and gears are sound and hang together, so that places can be looked at."""
    known = set(m.link_names())
    links = all(g.link in known for g in m.gears) and all(p.a in known and p.b in known for p in m.pairs)
    return (
        links
        and all(pair.has_geometry and not pair.faults() for pair in m.pairs)
        and not any(gear.value_faults("") for gear in m.gears)
        and all(gear.link in m.once(_reached) for gear in m.gears)
    )


class Meeting:
    """Two gears where they meet, in the frame of the link of the first."""

    numbers: tuple[float, ...] = ()
    period: float = np.inf
    held: tuple[bool, bool] = (False, False)

    def __init__(self, one: Any, two: Any, a: Places, b: Places) -> None:
        self.one, self.two, self.a, self.b = one, two, a, b
        self.faults = list(self._unlike())

    def _unlike(self) -> Iterator[str]:
        """Why their teeth do not fit each other."""
        return iter(())

    def flanks(self, forward: bool) -> tuple[Relation, Relation]:
        """The relation of the flank that is asked for, and that of the other one."""
        raise NotImplementedError

    def misfits(self, fitting: float) -> list[str]:
        """What is wrong with the gears and their places, and what would fit."""
        return self.faults

    def _base_pitches(self, fitting: float) -> Iterator[str]:
        one, two = self.one, self.two
        if abs(one.base_pitch - two.base_pitch) > fitting * one.base_pitch:
            fit = one.base_pitch / (pi * cos(two.pressure_angle))
            yield (
                f"{one.name!r} and {two.name!r} have the base pitches {one.base_pitch:.7g} and {two.base_pitch:.7g}; "
                f"expected equal ones: module {fit:.7g} of {two.name!r}"
            )

    def _ways(self) -> float:
        """Signed cosine of both axes."""
        return float(_dot(self.a.axis, self.b.axis)[0, 0])


def _halves(one: Any, two: Any) -> tuple[float, float]:
    """Half the widths; of those that have none, the plane of b."""
    if one.width is None and two.width is None:
        return np.inf, 0.0
    return tuple(np.inf if g.width is None else g.width / 2 for g in (one, two))  # type: ignore[return-value]


def _apart(one: Any, two: Any, h: float) -> Iterator[str]:
    """Widths that do not overlap, of which the middles are ``h`` apart."""
    half = [0.0 if g.width is None else g.width / 2 for g in (one, two)]
    if all(half) and abs(h) >= sum(half):
        yield f"{one.name!r} and {two.name!r} stand {abs(h):.6g} beside each other; their widths overlap below {sum(half):.6g}"


class Parallel(Meeting):
    """Cylindrical gears on parallel axes."""

    def __init__(self, one: Any, two: Any, a: Places, b: Places) -> None:
        super().__init__(one, two, a, b)
        self.k = one.base_radius + two.base_radius
        d = b.point - a.point
        self.h = float(_dot(d, a.axis)[0, 0])
        across = d - a.axis * self.h
        self.distance = float(np.sqrt(_dot(across, across))[0, 0])
        self.numbers = (one.base_radius, two.base_radius, one.base_radius * one.base_lean, *_halves(one, two))
        self.period = one.base_pitch

    def flanks(self, forward: bool) -> tuple[Relation, Relation]:
        """See ``Meeting``."""
        order = (1.0, -1.0) if forward else (-1.0, 1.0)
        return CYLINDRICAL[order[0]], CYLINDRICAL[order[1]]

    @property
    def sum_of_teeth(self) -> int:
        """Teeth along the line of centers, the difference of an internal pair."""
        return abs(sum((-1 if g.internal else 1) * g.teeth for g in (self.one, self.two)))

    @property
    def working_angle(self) -> float:
        """In the plane across the axes."""
        return float(np.arccos(abs(self.k) / self.distance))

    @property
    def shifts(self) -> float:
        """Sum of the profile shifts: the difference, ring minus gear, of an internal pair."""
        one, two = self.one, self.two
        if one.internal or two.internal:
            ring, other = (one, two) if one.internal else (two, one)
            return float(ring.shift - other.shift)
        return float(one.shift + two.shift)

    @property
    def asked_shifts(self) -> float:
        """The sum of shifts at which the gears run without backlash at this distance."""
        gap = involute(self.working_angle) - involute(self.one.transverse_angle)
        return float(gap * self.sum_of_teeth / (2 * tan(self.one.pressure_angle)))

    @property
    def backlash(self) -> float:
        """Along the working pitch circles: what the distance leaves."""
        sign = -1.0 if self.one.internal or self.two.internal else 1.0
        more = sign * (self.asked_shifts - self.shifts)
        return 4 * self.distance * tan(self.one.pressure_angle) * more / self.sum_of_teeth

    def misfits(self, fitting: float) -> list[str]:
        """See ``Meeting``."""
        one, two = self.one, self.two
        names = f"{one.name!r} and {two.name!r}"
        found = list(self._base_pitches(fitting))
        if one.internal and two.internal:
            return [f"{names} both have their teeth inside; one of them does"]
        inner = one.internal or two.internal
        ring, other = (one, two) if one.internal else (two, one)
        if inner and ring.teeth <= other.teeth:
            found.append(
                f"{ring.name!r} has {ring.teeth} teeth inside; expected more than the {other.teeth} of {other.name!r}"
            )
        wanted = one.helix_angle if inner else -one.helix_angle
        if abs(two.helix_angle - wanted) > fitting:
            found.append(f"{two.name!r} has the helix angle {two.helix_angle:.7g}; at {one.name!r} {wanted:.7g} meshes")
        if not found:
            found += self._at_distance(fitting, inner, names)
            found += _apart(one, two, self.h)
        return found or list(self._off_gap())

    def _off_gap(self) -> Iterator[str]:
        """Teeth that do not stand in gaps, where both gears have a mark."""
        one, two, k = self.one, self.two, self.k
        if one.mark is None or two.mark is None:
            return
        d = self.b.point - self.a.point
        across = d - self.a.axis * self.h
        turns = 0.5
        for gear, place, sense in ((one, self.a, 1.0), (two, self.b, -1.0)):
            e = across * (sense * np.sign(gear.base_radius * k) / self.distance)
            lean = self.h * one.base_lean / one.base_radius if gear is one else 0.0
            own = float(angle(e, place.mark, self.a.axis)[0, 0]) + lean
            turns += np.sign(gear.base_radius) * gear.teeth * own / (2 * pi)
        off = turns - round(turns)
        pitch = 2 * pi * abs(one.base_radius) / cos(self.working_angle) / one.teeth
        # a thousandth of a tooth: the mark is rounded
        if abs(off) > max(self.backlash, 0.0) / (2 * pitch) + 1e-3:
            yield (
                f"teeth of {one.name!r} and {two.name!r} are {abs(off):.4g} of a tooth off the gaps, by their marks; turn that of "
                f"{two.name!r} by {360 * abs(off) / two.teeth:.6g} degrees one way, or leave it out"
            )

    def _at_distance(self, fitting: float, inner: bool, names: str) -> Iterator[str]:
        one, two, d = self.one, self.two, self.distance
        nominal = abs(self.k) / cos(one.transverse_angle)
        if not d > abs(self.k) * (1.0 + fitting):
            yield f"the axes of {names} are {d:.7g} apart; expected {nominal:.7g} (without shifts; more than {abs(self.k):.7g})"
            return
        if self.backlash < -4.0 * fitting * nominal:
            yield (
                f"{names} jam at the distance {d:.7g}, which asks for the sum {self.asked_shifts:.7g} of shifts (ring minus gear inside); "
                f"they have {self.shifts:.7g} (without shifts the distance is {nominal:.7g})"
            )
        tips = [tip_radius(g) for g in (one, two)]
        reach = abs(tips[0] - tips[1]) if inner else sum(tips)
        beyond = d < reach if inner else d > reach
        if beyond:
            yield f"the teeth of {names} do not reach each other at the distance {d:.7g}; expected {nominal:.7g} (without shifts)"


def tip_radius(gear: Any, shorter: float = 0.0) -> float:
    """Radius of the tip circle, the addendum ``shorter`` by so many modules."""
    if gear.internal:
        return float(gear.radius - gear.module * (1.0 - gear.shift))
    return float(gear.radius + gear.module * (1.0 + gear.shift - shorter))


class WithRack(Meeting):
    """A gear and a rack."""

    def __init__(self, one: Any, two: Any, a: Places, b: Places) -> None:
        super().__init__(one, two, a, b)
        self.sign = -1.0 if isinstance(one, GearRack) else 1.0
        self.pinion, self.rack = (one, two) if self.sign > 0 else (two, one)
        self.at, self.there = (a, b) if self.sign > 0 else (b, a)
        base = self.pinion.base_radius
        halves = _halves(one, two)[:: int(self.sign)]
        self.numbers = (base, self.pinion.radius, base * self.pinion.base_lean, *halves)
        self.period = self.pinion.base_pitch

    def flanks(self, forward: bool) -> tuple[Relation, Relation]:
        """See ``Meeting``."""
        order = (1.0, -1.0) if forward else (-1.0, 1.0)
        return RACKED[order[0], self.sign], RACKED[order[1], self.sign]

    def misfits(self, fitting: float) -> list[str]:
        """See ``Meeting``."""
        pinion, rack = self.pinion, self.rack
        found = list(self._base_pitches(fitting))
        if pinion.internal:
            found.append(f"{pinion.name!r} has its teeth inside; a rack meshes with a gear")
        if abs(pinion.helix_angle + rack.helix_angle) > fitting:
            found.append(
                f"{rack.name!r} has the helix angle {rack.helix_angle:.7g}; at {pinion.name!r} {-pinion.helix_angle:.7g} meshes"
            )
        z, d = self.at.axis, self.there.point - self.at.point
        if max(abs(float(_dot(z, v)[0, 0])) for v in (self.there.axis, self.there.mark)) > fitting:
            found.append(
                f"direction and normal of {rack.name!r} are not at right angles to the axis of {pinion.name!r}"
            )
        if abs(float(np.dot(rack.place.axis, np.asarray(rack.normal) / np.linalg.norm(rack.normal)))) > fitting:
            found.append(f"direction and normal of {rack.name!r} are not at right angles to each other")
        if found:
            return found
        distance = -float(_dot(d, self.there.mark)[0, 0])
        wanted = pinion.radius + pinion.module * pinion.shift
        if distance < wanted - 2.0 * fitting * wanted or distance > wanted + 2.0 * pinion.module:
            found.append(
                f"the pitch line of {rack.name!r} is {distance:.7g} from the axis of {pinion.name!r}, against its normal; expected "
                f"{wanted:.7g}"
            )
        return [*found, *_apart(pinion, rack, float(_dot(d, z)[0, 0]))]


class Still(Meeting):
    """Axes that keep their places: the line stands still between them."""

    def __init__(self, one: Any, two: Any, a: Places, b: Places) -> None:
        super().__init__(one, two, a, b)
        self.axes = Axes(a.point[:, 0], a.axis[:, 0], b.point[:, 0], b.axis[:, 0])
        if not self.faults and not self.misfits(1e-3):
            self._lay(*self.lines())

    def lines(self) -> tuple[Array, Array]:
        """Points and directions ``(3, 2, 1)`` of the force on b, for both flanks."""
        raise NotImplementedError

    def _lay(self, P: Array, n: Array) -> None:
        za, zb, d = self.axes.za[:, 0], self.axes.zb[:, 0], (self.axes.pb - self.axes.pa)[:, 0]
        w = np.cross(za, zb)
        foot = self.axes.pa[:, 0] + za * (np.cross(d, zb) @ w) / (w @ w)
        w /= np.linalg.norm(w)
        frame, at = np.stack([za, w, np.cross(za, w)]), P[:, 0, 0]
        push = [n[:, i, 0] for i in range(2)]
        powers = [float(v @ np.cross(za, at - foot)) for v in push]
        first = int(powers[1] > powers[0])
        both = push[first], -push[1 - first]
        self.numbers = (1.0, *(frame @ (at - foot)), *(frame @ both[0]), *(frame @ both[1]))
        self.period = abs(powers[first]) * 2 * pi / self.one.teeth

    def flanks(self, forward: bool) -> tuple[Relation, Relation]:
        """See ``Meeting``."""
        order = (1.0, -1.0) if forward else (-1.0, 1.0)
        return BETWEEN[order[0]], BETWEEN[order[1]]


class Crossed(Still):
    """Helical gears on axes that cross (screw gears)."""

    def _laid(self) -> tuple[Array, float, Array, float]:
        """From axis a to axis b, their distance, the teeth of a where they touch, and the helix angle of b that fits these."""
        za, zb = self.axes.za[:, 0], self.axes.zb[:, 0]
        w = np.cross(za, zb)
        w /= np.linalg.norm(w)
        off = float((self.axes.pb - self.axes.pa)[:, 0] @ w)
        away = w * (1.0 if off >= 0 else -1.0)
        trace = cos(self.one.helix_angle) * za + sin(self.one.helix_angle) * np.cross(za, away)
        x, y = float(trace @ zb), float(trace @ np.cross(zb, -away))
        return away, abs(off), trace, atan(y / x) if x else pi / 2

    def misfits(self, fitting: float) -> list[str]:
        """See ``Meeting``."""
        one, two = self.one, self.two
        if one.internal or two.internal:
            return ["gears on crossing axes have their teeth outside"]
        found = list(self._base_pitches(fitting))
        _, distance, _, helix = self._laid()
        if abs(helix - two.helix_angle) > fitting:
            found.append(
                f"the axes of {one.name!r} and {two.name!r} cross; the teeth of {two.name!r} would need the helix angle {helix:.7g}, not "
                f"{two.helix_angle:.7g}"
            )
        wanted = one.radius + two.radius + one.module * one.shift + two.module * two.shift
        if not found and abs(distance - wanted) > 2.0 * fitting * wanted:
            found.append(
                f"the axes of {one.name!r} and {two.name!r} pass each other at {distance:.7g}; expected {wanted:.7g}"
            )
        return found

    def lines(self) -> tuple[Array, Array]:
        """See ``Still``."""
        away, _, trace, _ = self._laid()
        za, zb, d = self.axes.za[:, 0], self.axes.zb[:, 0], (self.axes.pb - self.axes.pa)[:, 0]
        w = np.cross(za, zb)
        foot = self.axes.pa[:, 0] + za * (np.cross(d, zb) @ w) / (w @ w)
        P = foot + away * (self.one.radius + self.one.module * self.one.shift)
        return teeth_lines(P[:, None], away[:, None], trace[:, None], self.one.pressure_angle)


def _cylinders(one: Any, two: Any, a: Places, b: Places) -> Meeting:
    """Two cylindrical gears, by their axes."""
    off = float(np.abs(cross(a.axis, b.axis)).max())
    # a few degrees: axes that were meant to be parallel
    return Crossed(one, two, a, b) if off > 0.05 else Tilted(one, two, a, b) if off > 1e-4 else Parallel(one, two, a, b)


class Tilted(Parallel):
    """Cylindrical gears on axes that are neither parallel nor cross."""

    def misfits(self, fitting: float) -> list[str]:
        """See ``Meeting``."""
        off = float(np.abs(cross(self.a.axis, self.b.axis)).max())
        if off <= fitting:
            return super().misfits(fitting)
        return [f"the axes of {self.one.name!r} and {self.two.name!r} are {off:.4g} rad off parallel"]


class Bevels(Still):
    """Bevel gears on axes that intersect."""

    held = (True, True)

    @property
    def _pair(self) -> BevelGears:
        one, two = self.one, self.two
        return BevelGears(
            "", one.name, two.name, (one.teeth, two.teeth), one.module, one.pressure_angle, one.spiral_angle
        )

    def _unlike(self) -> Iterator[str]:
        one, two = self.one, self.two
        for name, wanted in (
            ("module", one.module),
            ("pressure_angle", one.pressure_angle),
            ("spiral_angle", -one.spiral_angle),
        ):
            if abs(getattr(two, name) - wanted) > 1e-9 * (1.0 + abs(wanted)):
                yield f"{two.name!r} has {name} = {getattr(two, name):.7g}; at {one.name!r} {wanted:.7g} meshes"

    def misfits(self, fitting: float) -> list[str]:
        """See ``Meeting``."""
        found = self.faults or self._pair.misfits(self.axes, fitting)
        if found:
            return found
        apex = self._pair._apex(self.axes)[0]
        ea, eb = (
            z * np.sign(_dot(p - apex, z)) for p, z in ((self.axes.pa, self.axes.za), (self.axes.pb, self.axes.zb))
        )
        shaft = float(np.arccos(np.clip(_dot(ea, eb)[0], -1.0, 1.0)))
        out = []
        for gear, mate in ((self.one, self.two), (self.two, self.one)):
            cone = float(np.arctan2(sin(shaft), mate.teeth / gear.teeth + cos(shaft)))
            if gear.cone is not None and abs(gear.cone - cone) > fitting:
                out.append(f"{gear.name!r} has the cone {gear.cone:.7g}; its teeth and axes ask for {cone:.7g}")
        return out

    def lines(self) -> tuple[Array, Array]:
        """See ``Still``."""
        return self._pair.lines(self.axes)


class Worms(Still):
    """A worm and its wheel."""

    @property
    def held(self) -> tuple[bool, bool]:  # type: ignore[override]
        """A worm may slide, its wheel may not."""
        return self._sign < 0, self._sign > 0

    @property
    def _sign(self) -> float:
        return 1.0 if isinstance(self.one, Worm) else -1.0

    @property
    def _pair(self) -> tuple[WormGear, Axes]:
        x, swapped = self.axes, Axes(self.axes.pb, self.axes.zb, self.axes.pa, self.axes.za)
        worm, wheel = (self.one, self.two) if self._sign > 0 else (self.two, self.one)
        made = WormGear(
            "", worm.name, wheel.name, (worm.teeth, wheel.teeth), worm.radius, worm.pressure_angle, worm.left_hand
        )
        return made, x if self._sign > 0 else swapped

    def misfits(self, fitting: float) -> list[str]:
        """See ``Meeting``."""
        pair, axes = self._pair
        return pair.misfits(axes, fitting)

    def lines(self) -> tuple[Array, Array]:
        """See ``Still``."""
        pair, axes = self._pair
        P, n = pair.lines(axes)
        return P, self._sign * n


_KINDS: dict[tuple[str, str], Any] = {
    ("gear", "gear"): _cylinders,
    ("gear", "rack"): WithRack,
    ("rack", "gear"): WithRack,
    ("bevel", "bevel"): Bevels,
    ("worm", "worm_wheel"): Worms,
    ("worm_wheel", "worm"): Worms,
}


def _words_of_kinds(kind: str) -> str:
    return " or ".join(f"a {b}" for a, b in _KINDS if a == kind)
