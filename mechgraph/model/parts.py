"""Catalogue parts: links, pairs, couplings and loads that belong together, written out where a mechanism takes them.

A part is plain data and has no mechanics of its own: what it holds is what one would declare by hand, under names that begin with that
of the part, ``boom.tube``, ``boom.lift.Tz``. Points are global, in the configuration in which the mechanism is declared.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from functools import partial
from typing import Any, ParamSpec

import numpy as np
from numpy.typing import ArrayLike

from mechgraph.errors import DeclarationError
from mechgraph.fields import second_direction
from mechgraph.maths import inertia
from mechgraph.maths.se3 import Array
from mechgraph.maths.tolerances import SHAPES
from mechgraph.model.declaration import Parts as Parts
from mechgraph.model.gears import Gear, planet_places
from mechgraph.model.loads import Effort, Load, Spring
from mechgraph.model.meshes import Mesh
from mechgraph.model.pair import Link, Pair
from mechgraph.model.plane import NORMAL
from mechgraph.model.short_forms import Rack, SpurGears
from mechgraph.quantities import (
    Count,
    Index,
    door,
    has_quantity,
    is_numeric,
    is_quantity,
    real_array,
    shown,
    wrong,
)

P = ParamSpec("P")


class _Given:
    """What a part is made of, read as numbers; ``end`` raises all faults at once."""

    def __init__(self, kind: str, name: str, **links: str) -> None:
        self.where, self.faults = f"parts.{kind} {shown(name)}", list[str]()
        for what, text in {"name": name, **links}.items():
            if not text:
                self.faults.append(wrong(text, what, "a text with at least one letter"))
        self.flat = False
        """Whether a point was given by two numbers."""

    def point(self, value: Any, what: str) -> Array:
        """A point ``(3,)``; two numbers are x and y."""
        if is_numeric(value, (2,)):
            self.flat = True
            return np.array([*np.asarray(value, dtype=float), 0.0])
        if not is_numeric(value, (3,)):
            self.faults.append(wrong(value, what, "three finite numbers, or x and y"))
            return np.full(3, np.nan)
        return np.array(value, dtype=float)

    def direction(self, value: Any, what: str) -> Array:
        """A unit direction ``(3,)``; two numbers are x and y."""
        out = self.point(value, what)
        size = float(np.linalg.norm(out))
        if not np.isnan(size) and not size > 0.0:
            self.faults.append(wrong(value, what, "a direction, not zero"))
        return out / (size or 1.0)

    def between(self, p: Array, q: Array, what: str) -> tuple[Array, float]:
        """Unit direction and distance from a point to another."""
        length = float(np.linalg.norm(q - p))
        if not np.isnan(length) and not length > 0.0:
            self.faults.append(f"{what} are the same point {p.tolist()}; they must be apart")
        return (q - p) / (length or 1.0), length

    def number(self, value: Any, what: str, *, positive: bool = False) -> float:
        """A finite number; not negative, or above zero."""
        if not is_numeric(value, ()) or value < 0 or (positive and value == 0):
            self.faults.append(wrong(value, what, "a number above 0" if positive else "a number of 0 or more"))
            return 1.0
        return float(value)

    def masses(self, value: Any, count: int) -> Array:
        """The masses ``(count,)`` of so many links; one number is shared equally."""
        if is_numeric(value, ()) and value >= 0:
            return np.full(count, float(value) / count)
        if not is_numeric(value, (count,)) or min(value) < 0:
            self.faults.append(wrong(value, "mass", f"a number of 0 or more, or {count} such numbers"))
            return np.zeros(count)
        return np.array(value, dtype=float)

    def across(self, axis: Any, along: Array, what: str) -> Array:
        """A unit axis at right angles to a direction."""
        out = self.direction(axis, "axis")
        if abs(float(out @ along)) > SHAPES.met:
            self.faults.append(wrong(axis, "axis", f"a direction at right angles to {what}"))
        return out

    def pin(self, axis: Any, along: Array) -> Array | None:
        """The axis of the pins at both ends, None for balls; z where points have two numbers."""
        return None if axis is None and not self.flat else self.across(NORMAL if axis is None else axis, along, "p-q")

    def end(self) -> None:
        """Raise the faults, if there are any."""
        if self.faults:
            raise DeclarationError(self.where, self.faults)


PURE = ("axis", "axis_a", "axis_b", "direction", "phase", "pressure_angle", "helix_angle", "teeth", "fixed")
"""Arguments of parts that are no lengths, masses or forces."""


FIRST = "    Parameters\n    ----------\n"
LAST = """    Returns
    -------
    Parts

    Raises
    ------
    DeclarationError
        With every fault.

"""
"""What the docstrings of all parts share."""


def _part(make: Callable[P, Parts]) -> Callable[P, Parts]:
    """A door that makes a part; of quantities of pint it is made in SI units, and its numbers are quantities then."""
    doc = (make.__doc__ or "").replace(FIRST, f"{FIRST}    name : str\n        Name of the part.\n")
    make.__doc__ = doc.replace("    Examples\n", f"{LAST}    Examples\n")

    @door
    @functools.wraps(make)
    def made(*args: P.args, **named: P.kwargs) -> Parts:
        bound = inspect.signature(make).bind(*args, **named)
        given = bound.arguments
        known = {what: value for what, value in given.items() if has_quantity(value)}
        if not known:
            return _with_links(make(*args, **named), given["name"])
        numbers = {what: _in_si(value) for what, value in known.items()}
        faults = [
            wrong(given[what], what, "a quantity with its unit, as others of the part are")
            for what, value in given.items()
            if what not in (*PURE, *known)
            and real_array(value) is not None
            and np.any(value)
            and not isinstance(value, bool)
        ]
        faults += [
            wrong(given[what], what, "quantities with their units")
            for what, value in numbers.items()
            if has_quantity(value)
        ]
        if faults:
            raise DeclarationError(f"parts.{make.__name__} {shown(given['name'])}", faults)
        given.update(numbers)
        one = _a_quantity(next(iter(known.values())))
        return _with_units(_with_links(make(*bound.args, **bound.kwargs), given["name"]), one._REGISTRY)

    return made


def _with_links(parts: Parts, name: str) -> Parts:
    """The part with massless links for those of its own ``name.`` that its pairs join and that have no mass."""
    known = {link.name for link in parts.links}
    ends = dict.fromkeys(end for pair in parts.pairs for end in (pair.a, pair.b))
    own = [Link(end) for end in ends if end not in known and end.startswith(f"{name}.")]
    return replace(parts, links=(*parts.links, *own))


def _in_si(value: Any) -> Any:
    """Quantities as numbers in SI units, in sequences too."""
    if is_quantity(value):
        return value.to_base_units().magnitude
    return tuple(map(_in_si, value)) if isinstance(value, list | tuple) else value


def _a_quantity(value: Any) -> Any:
    """A value, or the first quantity in it."""
    return value if is_quantity(value) else next(_a_quantity(one) for one in value if has_quantity(one))


def _with_units(parts: Parts, registry: Any) -> Parts:
    """The same with quantities in SI units in place of numbers that have a unit."""

    def changed(record: Any) -> Any:
        held = {}
        for name, about in record.formats.items():
            value = getattr(record, name)
            if about.kind.numeric and about.slide != (0, 0, 0) and np.size(value) and real_array(value) is not None:
                unit = registry.Quantity(
                    1.0, " * ".join(f"{u} ** {p}" for u, p in zip(("m", "kg", "s"), about.slide, strict=True))
                )
                held[name] = np.asarray(value) * unit
        return record.replace(**held)

    return Parts(*(tuple(map(changed, getattr(parts, f.name))) for f in fields(Parts)))


def _bar(name: str, mass: float, p: Array, q: Array, radius: float | None = None) -> Link:
    """A uniform bar between two points: slender, or a solid cylinder of a radius."""
    if not mass > 0:
        return Link(name)
    length = float(np.linalg.norm(q - p))
    tensor = inertia.rod(mass, p, q) if radius is None else inertia.cylinder(mass, radius, length, q - p)
    return Link(name, float(mass), 0.5 * (p + q), tensor)


def _eye(name: str, a: str, b: str, point: Array, axis: Array | None) -> Pair:
    """A ball, or a pin about an axis."""
    return Pair(name, "S", a, b, point=point) if axis is None else Pair(name, "R", a, b, point=point, axis=axis)


@_part
def cylinder(
    name: str,
    a: str,
    p: ArrayLike,
    b: str,
    q: ArrayLike,
    *,
    axis: ArrayLike | None = None,
    mass: ArrayLike = 0.0,
    bore: float | None = None,
    pressure: float | None = None,
) -> Parts:
    """Return a hydraulic cylinder between two links: tube and rod on ball eyes (S-C-S), or on parallel pins (R-P-R).

    Its stroke is the freedom ``name.lift.Tz``: zero at the declared length, positive outward. Links ``name.tube`` and ``name.rod``, each
    half as long as the distance of the eyes; pairs ``name.a``, ``name.lift``, ``name.b``.

    Parameters
    ----------
    a, b : str
        Links at the eye of the tube and at that of the rod.
    p, q : (3,) or (2,) array_like
        Centers of these eyes [length].
    axis : (3,) array_like, optional
        Axis of the pins, at right angles to the line of the eyes. Default: balls; z if the points have two numbers.
    mass : float or (2,) array_like
        Mass of the cylinder, half of it each in tube and rod, or of both. They are slender bars.
    bore : float, optional
        Diameter of the piston [length]: tube and rod have the inertia of solid cylinders of it.
    pressure : float, optional
        Pressure on the piston, positive outward: an effort ``pressure pi bore^2 / 4`` in the stroke. Needs ``bore``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> boom = mg.Pair("A", "R", "frame", "boom", point=(0, 0, 0), axis=(0, 0, 1))
    >>> jack = mg.parts.cylinder("jack", "frame", (1, -1, 0), "boom", (1, 0, 0))
    >>> m = mg.Mechanism("crane", pairs=[boom], parts=[jack], drives=["jack.lift.Tz"])
    >>> print(mg.check(m).verdict)
    Determinate: 1 driver, 20 unknowns, 22 equations: 2 of them the spins of jack.tube and jack.rod; every reaction is unique.
    """
    given = _Given("cylinder", name, a=a, b=b)
    start, end = given.point(p, "p"), given.point(q, "q")
    along, _ = given.between(start, end, "p and q")
    masses = given.masses(mass, 2)
    size = None if bore is None else given.number(bore, "bore", positive=True)
    pin = given.pin(axis, along)
    if pressure is not None and bore is None:
        given.faults.append(f"pressure = {shown(pressure)}: needs bore=, the diameter of the piston")
    given.end()
    tube, rod, middle = f"{name}.tube", f"{name}.rod", 0.5 * (start + end)
    radius = None if size is None else 0.5 * size
    lift = Pair(
        f"{name}.lift",
        "C" if pin is None else "P",
        tube,
        rod,
        point=start,
        axis=along,
        second=second_direction(along) if pin is None else pin,
    )
    pushed: tuple[Load, ...] = ()
    if pressure is not None and size is not None:
        pushed = (Effort(f"{name}.lift.Tz", pressure * np.pi * size**2 / 4),)
    return Parts(
        (_bar(tube, masses[0], start, middle, radius), _bar(rod, masses[1], middle, end, radius)),
        (_eye(f"{name}.a", a, tube, start, pin), lift, _eye(f"{name}.b", rod, b, end, pin)),
        loads=pushed,
    )


@_part
def rod(
    name: str,
    a: str,
    p: ArrayLike,
    b: str,
    q: ArrayLike,
    *,
    axis: ArrayLike | None = None,
    mass: float = 0.0,
) -> Parts:
    """Return a rod between two links, on balls (S-S) or on parallel pins (R-R).

    Link ``name.rod``; pairs ``name.a`` and ``name.b``. On balls it spins passively.

    Parameters
    ----------
    a, b : str
        Links at its ends.
    p, q : (3,) or (2,) array_like
        Its ends [length].
    axis : (3,) array_like, optional
        Axis of the pins, at right angles to the rod. Default: balls; z if the points have two numbers.
    mass : float
        Mass; the rod is a slender bar.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.parts.rod("tie", "frame", (0, 0, 1), "wheel", (1, 0, 1), mass=2.0).links[0].center
    (0.5, 0.0, 1.0)
    """
    given = _Given("rod", name, a=a, b=b)
    start, end = given.point(p, "p"), given.point(q, "q")
    along, _ = given.between(start, end, "p and q")
    weight = given.number(mass, "mass")
    pin = given.pin(axis, along)
    given.end()
    link = f"{name}.rod"
    pairs = (_eye(f"{name}.a", a, link, start, pin), _eye(f"{name}.b", link, b, end, pin))
    return Parts((_bar(link, weight, start, end),), pairs)


@_part
def spring_strut(
    name: str,
    a: str,
    p: ArrayLike,
    b: str,
    q: ArrayLike,
    *,
    stiffness: float,
    free_length: float | None = None,
    damping: float = 0.0,
    axis: ArrayLike | None = None,
    mass: ArrayLike = 0.0,
) -> Parts:
    """Return a spring strut: a cylinder without drive, and a spring with a damper between its eyes.

    Parameters
    ----------
    a, b, p, q, axis, mass
        As of ``cylinder``.
    stiffness : float
        Force per length.
    free_length : float, optional
        Distance of the eyes without force [length]. Default: the declared distance.
    damping : float
        Force per velocity.

    Examples
    --------
    >>> import mechgraph as mg
    >>> strut = mg.parts.spring_strut("S", "frame", (0, 0.3), "arm", (0.2, 0), stiffness=2e4, damping=900.0)
    >>> float(round(strut.loads[0].free_length, 6))
    0.360555
    """
    given = _Given("spring_strut", name, a=a, b=b)
    start, end = given.point(p, "p"), given.point(q, "q")
    _, length = given.between(start, end, "p and q")
    c, d = given.number(stiffness, "stiffness", positive=True), given.number(damping, "damping")
    free = length if free_length is None else given.number(free_length, "free_length")
    given.end()
    spring = Spring(a, b, start, end, stiffness=c, free_length=free, damping=d)
    return cylinder(name, a, p, b, q, axis=axis, mass=mass) + Parts(loads=(spring,))


@_part
def bearings(
    name: str,
    housing: str,
    shaft: str,
    points: Sequence[ArrayLike],
    axis: ArrayLike,
    *,
    fixed: Index = 0,
) -> Parts:
    """Return the bearings of a shaft: one that locates it (S), the others floating (Sg), and the turn of the shaft by name.

    Pairs ``name.1``, ``name.2``, ... in the order of the points. The freedom ``name.turn.Rz`` (of a pair Fr, which holds nothing) is
    the turn of the shaft about the axis, for drives, efforts, springs and results.

    Parameters
    ----------
    housing, shaft : str
        Links.
    points : sequence of (3,) array_like
        Centers of the bearings [length], two or more, on one line along the axis.
    axis : (3,) array_like
        Direction of the shaft.
    fixed : int
        Place of the locating bearing among the points.

    Examples
    --------
    >>> import mechgraph as mg
    >>> held = mg.parts.bearings("B", "frame", "rotor", [(0, 0, 0), (0, 0, 0.5)], (0, 0, 1))
    >>> m = mg.Mechanism("rotor", parts=[held], drives=["B.turn.Rz"])
    >>> print(mg.check(m).verdict)
    Determinate: 1 driver, 6 unknowns, 6 equations; every reaction is unique.
    """
    given = _Given("bearings", name, housing=housing, shaft=shaft)
    z = given.direction(axis, "axis")
    centers = [given.point(one, f"points[{i}]") for i, one in enumerate(points)]
    if len(centers) < 2:
        given.faults.append(wrong(len(centers), "number of points", "two bearings or more"))
    if not 0 <= fixed < max(len(centers), 1):
        given.faults.append(wrong(fixed, "fixed", f"a place among the {len(centers)} points"))
    reach = max((float(np.abs(c - centers[0]).max()) for c in centers), default=0.0)
    for i, c in enumerate(centers):
        if float(np.linalg.norm(np.cross(c - centers[0], z))) > SHAPES.met * reach:
            given.faults.append(f"points[{i}] = {c.tolist()}: is not on the axis through points[0]")
        if any(np.array_equal(c, other) for other in centers[:i]):
            given.faults.append(f"points[{i}] = {c.tolist()}: is the place of another bearing")
    given.end()
    kinds = ["S" if i == fixed else "Sg" for i in range(len(centers))]
    held = [
        Pair(f"{name}.{i + 1}", kind, housing, shaft, point=c, axis=z)
        for i, (kind, c) in enumerate(zip(kinds, centers, strict=True))
    ]
    turn = Pair(f"{name}.turn", "Fr", housing, shaft, point=centers[fixed], axis=z)
    return Parts((), (*held, turn))


@_part
def screw_drive(
    name: str,
    a: str,
    p: ArrayLike,
    b: str,
    q: ArrayLike,
    *,
    lead: float,
    mass: ArrayLike = 0.0,
) -> Parts:
    """Return a screw drive between two links: housing, screw and nut between universal joints (U-R-H-U).

    The screw turns in the housing, ``name.turn.Rz``, and drives the nut along it; a right-handed screw that turns by ``+2 pi`` shortens
    the drive by ``lead``. Links ``name.housing``, ``name.screw``, ``name.nut``; pairs ``name.a``, ``name.turn``, ``name.thread``,
    ``name.b``. It leaves six freedoms between the links, so that a guided table stays determinate.

    Parameters
    ----------
    a, b : str
        Links at the housing and at the nut.
    p, q : (3,) array_like
        Centers of the joints there [length].
    lead : float
        Advance per turn [length], right-hand positive; not zero.
    mass : float or (3,) array_like
        Mass of housing, screw and nut together, shared equally, or of each; slender bars.

    Examples
    --------
    >>> import mechgraph as mg
    >>> slide = mg.Pair("X", "P", "frame", "table", point=(0, 0, 0), axis=(1, 0, 0))
    >>> feed = mg.parts.screw_drive("feed", "frame", (-1, 0, 0), "table", (0, 0, 0), lead=0.01)
    >>> m = mg.Mechanism("table", pairs=[slide], parts=[feed], drives=["feed.turn"])
    >>> print(mg.check(m).verdict)
    Determinate: 1 driver, 30 unknowns, 30 equations; every reaction is unique.
    """
    given = _Given("screw_drive", name, a=a, b=b)
    start, end = given.point(p, "p"), given.point(q, "q")
    along, _ = given.between(start, end, "p and q")
    masses = given.masses(mass, 3)
    if not is_numeric(lead, ()) or lead == 0:
        given.faults.append(wrong(lead, "lead", "a number other than 0"))
    given.end()
    x = np.array(second_direction(along))
    housing, screw, nut = (f"{name}.{what}" for what in ("housing", "screw", "nut"))
    third, more = start + (end - start) / 3, start + 2 * (end - start) / 3
    places = ((start, third), (third, more), (more, end))
    return Parts(
        tuple(_bar(link, m, *at) for link, m, at in zip((housing, screw, nut), masses, places, strict=True)),
        (
            Pair(f"{name}.a", "U", a, housing, point=start, axis=np.cross(along, x), second=x),
            Pair(f"{name}.turn", "R", housing, screw, point=start, axis=along),
            Pair(f"{name}.thread", "H", screw, nut, point=end, axis=along, lead=float(lead)),
            Pair(f"{name}.b", "U", nut, b, point=end, axis=x, second=np.cross(along, x)),
        ),
    )


@_part
def cardan_shaft(
    name: str,
    a: str,
    p: ArrayLike,
    b: str,
    q: ArrayLike,
    *,
    axis_a: ArrayLike,
    axis_b: ArrayLike,
    phase: float = 0.0,
    mass: ArrayLike = 0.0,
) -> Parts:
    """Return a cardan shaft between two shafts: two universal joints and a shaft that slides in itself (U-P-U).

    Each joint turns unevenly, ``tan(out) = tan(in) / cos(angle)`` from where the fork of the driving shaft is in the plane of both
    axes. With the inner forks in one plane (``phase`` 0) and equal angles in one plane the second makes up for the first. Links
    ``name.front`` and ``name.rear``; pairs ``name.a``, ``name.slip``, ``name.b``. It carries torque and no thrust.

    Parameters
    ----------
    a, b : str
        The shafts.
    p, q : (3,) array_like
        Centers of the joints [length].
    axis_a, axis_b : (3,) array_like
        Axes of the shafts, less than a right angle from the line of the joints.
    phase : float
        Angle between the inner forks [rad].
    mass : float or (2,) array_like
        Mass of the cardan shaft, half of it each in front and rear, or of both; slender bars.

    Examples
    --------
    >>> import mechgraph as mg
    >>> shaft = mg.parts.cardan_shaft("K", "in", (0, 0, 0), "out", (1, 0, 0), axis_a=(1, 1, 0), axis_b=(1, 1, 0))
    >>> [f"{pair.name} {pair.type.symbol}" for pair in shaft.pairs]
    ['K.a U', 'K.slip P', 'K.b U']
    """
    given = _Given("cardan_shaft", name, a=a, b=b)
    start, end = given.point(p, "p"), given.point(q, "q")
    along, _ = given.between(start, end, "p and q")
    shafts = [given.direction(value, what) for what, value in (("axis_a", axis_a), ("axis_b", axis_b))]
    for what, z in zip(("axis_a", "axis_b"), shafts, strict=True):
        if abs(float(z @ along)) <= SHAPES.met:
            given.faults.append(f"{what} = {z.tolist()}: is at right angles to p-q; a joint turns up to less than that")
    if not is_numeric(phase, ()) or abs(phase) > 2 * np.pi:
        given.faults.append(
            wrong(phase, "phase", f"an angle between -2 pi and 2 pi rad (degrees: np.deg2rad({shown(phase)}))")
        )
    masses = given.masses(mass, 2)
    given.end()
    front, rear, middle = f"{name}.front", f"{name}.rear", 0.5 * (start + end)
    normal = np.cross(along, shafts[0])
    bent = float(np.linalg.norm(normal)) > SHAPES.met
    fork_a = normal / np.linalg.norm(normal) if bent else np.array(second_direction(along))
    fork_b = np.cos(phase) * fork_a + np.sin(phase) * np.cross(along, fork_a)
    outer_a, outer_b = (np.cross(z, fork) for z, fork in zip(shafts, (fork_a, fork_b), strict=True))
    return Parts(
        (_bar(front, masses[0], start, middle), _bar(rear, masses[1], middle, end)),
        (
            Pair(f"{name}.a", "U", a, front, point=start, axis=outer_a, second=fork_a),
            Pair(f"{name}.slip", "P", front, rear, point=middle, axis=along, second=fork_a),
            Pair(f"{name}.b", "U", rear, b, point=end, axis=fork_b, second=outer_b),
        ),
    )


@_part
def rack_and_pinion(
    name: str,
    base: str,
    point: ArrayLike,
    axis: ArrayLike,
    direction: ArrayLike,
    *,
    radius: float,
    pressure_angle: float = float(np.deg2rad(20.0)),
) -> Parts:
    """Return a rack and a pinion on one link; the rack moves by ``radius`` times the angle of the pinion.

    The rack is on the side of the pinion where a positive turn moves it along ``direction``. Links ``name.pinion`` and ``name.rack``;
    pairs ``name.turn`` (R), ``name.slide`` (P); coupling ``name.mesh``.

    Parameters
    ----------
    base : str
        Link on which both are.
    point : (3,) or (2,) array_like
        Center of the pinion [length].
    axis : (3,) array_like
        Axis of the pinion.
    direction : (3,) or (2,) array_like
        Direction of the rack, at right angles to the axis.
    radius : float
        Pitch radius of the pinion [length].
    pressure_angle : float
        Of the flanks [rad]. Default: 20 degrees.

    Examples
    --------
    >>> import mechgraph as mg
    >>> part = mg.parts.rack_and_pinion("G", "frame", (0, 0, 0), (0, 0, 1), (1, 0, 0), radius=0.02)
    >>> m = mg.Mechanism("steering", parts=[part], drives=["G.turn"])
    >>> mg.kinematics(m, {"G.turn": 1.0})["G.slide"].position
    array([0.02])
    """
    given = _Given("rack_and_pinion", name, base=base)
    center, x = given.point(point, "point"), given.direction(direction, "direction")
    z, r = given.across(axis, x, "direction"), given.number(radius, "radius", positive=True)
    given.end()
    turn, slide = f"{name}.turn", f"{name}.slide"
    pairs = (
        Pair(turn, "R", base, f"{name}.pinion", point=center, axis=z),
        Pair(slide, "P", base, f"{name}.rack", point=center - r * np.cross(z, x), axis=x, second=z),
    )
    mesh = Rack(f"{name}.mesh", turn, slide, r, float(pressure_angle))
    return Parts(pairs=pairs, couplings=(mesh,))


@_part
def gear_stage(
    name: str,
    base: str,
    p: ArrayLike,
    q: ArrayLike,
    axis: ArrayLike,
    *,
    teeth: tuple[Count, Count],
    module: float | None = None,
    helix_angle: float = 0.0,
    internal: bool = False,
) -> Parts:
    """Return a stage of two cylindrical gears on one link.

    Links ``name.pinion`` and ``name.wheel``; pairs ``name.in`` and ``name.out`` (R); coupling ``name.mesh`` (``SpurGears``).

    Parameters
    ----------
    base : str
        Link on which both gears are.
    p, q : (3,) or (2,) array_like
        Centers of pinion and wheel [length].
    axis : (3,) array_like
        Direction of both axes.
    teeth : (2,) sequence of int
        Numbers of teeth of pinion and wheel.
    module, helix_angle, internal
        As of ``SpurGears``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> stage = mg.parts.gear_stage("G", "frame", (0, 0, 0), (0.06, 0, 0), (0, 0, 1), teeth=(20, 40), module=0.002)
    >>> m = mg.Mechanism("stage", parts=[stage], drives=["G.in"])
    >>> mg.kinematics(m, {"G.in": 1.0})["G.out"].position
    array([-0.5])
    """
    given = _Given("gear_stage", name, base=base)
    start, end, z = given.point(p, "p"), given.point(q, "q"), given.direction(axis, "axis")
    given.between(start, end, "p and q")
    given.end()
    turns = f"{name}.in", f"{name}.out"
    pairs = tuple(
        Pair(turn, "R", base, f"{name}.{link}", point=at, axis=z)
        for turn, link, at in zip(turns, ("pinion", "wheel"), (start, end), strict=True)
    )
    mesh = SpurGears(f"{name}.mesh", *turns, teeth, module, helix_angle=helix_angle, internal=internal)
    return Parts(pairs=pairs, couplings=(mesh,))


@_part
def planetary(
    name: str,
    sun: Count,
    planet: Count,
    ring: Count,
    planets: Count = 3,
    floating: bool = True,
    *,
    module: float,
    base: str = "frame",
    point: ArrayLike = (0.0, 0.0, 0.0),
    axis: ArrayLike = NORMAL,
    pressure_angle: float = float(np.deg2rad(20.0)),
    helix_angle: float = 0.0,
) -> Parts:
    """Return a planetary gear set: sun, ring and carrier, which turn on one link, and planets on the carrier.

    Freedoms ``name.sun.Rz``, ``name.ring.Rz``, ``name.carrier.Rz``: two of them are driven or held, and ``z_s w_s + z_r w_r = (z_s + z_r)
    w_c`` (Willis). A floating sun lies in a plane (E; Fr in a planar mechanism), so that statics shares the load among the planets; in a
    bearing of its own it makes ``planets - 1`` shares redundant. Places of planets are whole multiples of ``2 pi / (z_s + z_r)``, the
    nearest to equal ones. Links ``name.sun``, ``name.ring``, ``name.carrier``, ``name.planet1``, ...; couplings ``name.sun1``,
    ``name.ring1``, ...

    Parameters
    ----------
    sun, planet, ring : int
        Numbers of teeth, ``ring = sun + 2 planet``.
    planets : int
        Number of planets.
    floating : bool
        Whether the sun floats between the planets.
    module : float
        Normal module [length].
    base : str
        Link on which sun, ring and carrier turn.
    point : (3,) or (2,) array_like
        Center [length]. Two numbers are for a planar mechanism.
    axis : (3,) array_like
        Axis of all gears. Default: z.
    pressure_angle : float
        Of the flanks, in the normal section [rad]. Default: 20 degrees.
    helix_angle : float
        Of the sun, right-hand positive [rad].

    Examples
    --------
    >>> import mechgraph as mg
    >>> part = mg.parts.planetary("P", 24, 30, 84, module=0.002)
    >>> m = mg.Mechanism("set", parts=[part], drives=["P.sun.Rz", "P.ring.Rz"])
    >>> round(mg.check(m).ratios["P.carrier.Rz"]["P.sun.Rz"], 6)
    0.222222
    """
    given = _Given("planetary", name, base=base)
    center, z = given.point(point, "point"), given.direction(axis, "axis")
    m = given.number(module, "module", positive=True)
    if ring != sun + 2 * planet:
        given.faults.append(
            f"ring = {ring}: expected sun + 2 planet = {sun + 2 * planet}; other numbers take profile shifts: declare the gears one by one"
        )
    try:
        turns = planet_places(sun, ring, planets).tolist()
    except DeclarationError as error:
        given.faults += error.faults
    given.end()
    x = np.array(second_direction(z))
    distance = m * (sun + planet) / 2 / np.cos(helix_angle)
    at = [center + distance * (np.cos(t) * x + np.sin(t) * np.cross(z, x)) for t in turns]
    made = partial(Gear, module=m, pressure_angle=pressure_angle)
    of = {what: f"{name}.{what}" for what in ("sun", "ring", "carrier")}
    sunk = ("Fr" if given.flat else "E") if floating else "R"
    pairs = [
        Pair(of[what], type_, base, of[what], point=center, axis=z)
        for what, type_ in (("sun", sunk), ("ring", "R"), ("carrier", "R"))
    ]
    gears = [
        made(of["sun"], of["sun"], sun, center, z, helix_angle=helix_angle),
        made(of["ring"], of["ring"], ring, center, z, helix_angle=-helix_angle, internal=True),
    ]
    meshes = []
    for i, p in enumerate(at, 1):
        wheel = f"{name}.planet{i}"
        pairs.append(Pair(wheel, "R", of["carrier"], wheel, point=p, axis=z))
        gears.append(made(wheel, wheel, planet, p, z, helix_angle=-helix_angle))
        meshes += [Mesh(f"{name}.sun{i}", of["sun"], wheel), Mesh(f"{name}.ring{i}", wheel, of["ring"])]
    return Parts(pairs=tuple(pairs), gears=tuple(gears), couplings=tuple(meshes))


@_part
def four_bar(
    name: str,
    base: str,
    points: Sequence[ArrayLike],
    axis: ArrayLike = NORMAL,
    *,
    mass: ArrayLike = 0.0,
) -> Parts:
    """Return a planar four-bar linkage on a link: crank A-B, coupler B-C, rocker C-D.

    Links ``name.crank``, ``name.coupler``, ``name.rocker``; pairs ``name.A`` to ``name.D`` (R).

    Parameters
    ----------
    base : str
        Link on which A and D are.
    points : sequence of four (3,) or (2,) array_like
        A, B, C, D [length].
    axis : (3,) array_like
        Axis of all pairs. Default: z.
    mass : float or (3,) array_like
        Mass of all three links, shared equally, or of each; slender bars.

    Examples
    --------
    >>> import mechgraph as mg
    >>> part = mg.parts.four_bar("F", "frame", [(0, 0), (0, 1), (3, 2), (4, 0)])
    >>> mg.check(mg.Mechanism("wiper", parts=[part], drives=["F.A"])).mobility
    1
    """
    given = _Given("four_bar", name, base=base)
    if len(points) != 4:
        given.faults.append(wrong(len(points), "number of points", "four: A, B, C, D"))
    at = [given.point(one, f"points[{i}]") for i, one in enumerate(points)]
    z, masses = given.direction(axis, "axis"), given.masses(mass, 3)
    for one, other, what in zip(at, at[1:], ("A and B", "B and C", "C and D"), strict=False):
        given.between(one, other, what)
    given.end()
    links = tuple(f"{name}.{link}" for link in ("crank", "coupler", "rocker"))
    bars = tuple(_bar(link, m, u, v) for link, m, u, v in zip(links, masses, at, at[1:], strict=False))
    ends = ((base, links[0]), (links[0], links[1]), (links[1], links[2]), (base, links[2]))
    pairs = tuple(Pair(f"{name}.{k}", "R", *ab, point=c, axis=z) for k, ab, c in zip("ABCD", ends, at, strict=True))
    return Parts(bars, pairs)


@_part
def slider_crank(
    name: str,
    base: str,
    points: Sequence[ArrayLike],
    direction: ArrayLike,
    axis: ArrayLike = NORMAL,
    *,
    mass: ArrayLike = 0.0,
) -> Parts:
    """Return a planar slider-crank on a link: crank A-B, rod B-C, slider at C.

    Links ``name.crank``, ``name.rod``, ``name.slider``; pairs ``name.A`` to ``name.C`` (R) and ``name.slide`` (P).

    Parameters
    ----------
    base : str
        Link on which the crank turns and the slider slides.
    points : sequence of three (3,) or (2,) array_like
        A, B, C [length].
    direction : (3,) or (2,) array_like
        Direction of the slider, at right angles to the axis.
    axis : (3,) array_like
        Axis of the turning pairs. Default: z.
    mass : float or (3,) array_like
        Mass of all three links, shared equally, or of each; bars, the slider a point.

    Examples
    --------
    >>> import mechgraph as mg
    >>> part = mg.parts.slider_crank("E", "frame", [(0, 0), (0.05, 0), (0.2, 0)], (1, 0))
    >>> m = mg.Mechanism("engine", parts=[part], drives=["E.A"])
    >>> float(mg.kinematics(m, {"E.A": 3.141592653589793})["E.slide"].position[0].round(9))
    -0.1
    """
    given = _Given("slider_crank", name, base=base)
    if len(points) != 3:
        given.faults.append(wrong(len(points), "number of points", "three: A, B, C"))
    at = [given.point(one, f"points[{i}]") for i, one in enumerate(points)]
    x, masses = given.direction(direction, "direction"), given.masses(mass, 3)
    z = given.across(axis, x, "direction")
    for one, other, what in zip(at, at[1:], ("A and B", "B and C"), strict=False):
        given.between(one, other, what)
    given.end()
    crank, bar, slider = links = tuple(f"{name}.{link}" for link in ("crank", "rod", "slider"))
    bars = [_bar(link, m, u, v) for link, m, u, v in zip(links[:2], masses, at, at[1:], strict=False)]
    block = Link(slider, float(masses[2]), at[2]) if masses[2] > 0 else Link(slider)
    ends = ((base, crank), (crank, bar), (bar, slider))
    pairs = [Pair(f"{name}.{k}", "R", *ab, point=c, axis=z) for k, ab, c in zip("ABC", ends, at, strict=True)]
    return Parts((*bars, block), (*pairs, Pair(f"{name}.slide", "P", base, slider, point=at[2], axis=x, second=z)))


def __dir__() -> list[str]:
    return sorted(
        name for name, value in globals().items() if getattr(value, "__module__", "") == __name__ and name[0].islower()
    )


def __getattr__(name: str) -> Any:
    raise AttributeError(f"mg.parts has no {name!r}; there are {', '.join(__dir__())}")
