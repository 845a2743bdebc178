"""Contacts: where elements touch, with what force and stress, how they slide and roll, where a force would have to pull.

Facts of contacts: where the elements of a pair touch, with what force, how they slide and roll, and where a force would have to pull.
With the origin c of the frame of the normal force (center of a ball or roller, point of a curve), the radius r and the normal n in which a
presses on b:

    p = c - r n,   sliding v = v_b(p) - v_a(p),   travel over a: u, over b: u - v,   rolling: the mean of both,

u the velocity of p as a place of that frame, seen from a. In a groove p also moves across with the direction of the force, which counts as
neither. Where the radius is not declared it counts as zero.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mechgraph.document import Block, Document, Paragraph, Shown
from mechgraph.errors import DeclarationError
from mechgraph.maths.se3 import Array
from mechgraph.maths.tolerances import SHAPES, STRESSES
from mechgraph.memo import dataclass
from mechgraph.model.belts import BeltDrive
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.meshes import Mesh
from mechgraph.model.pair import Pair
from mechgraph.pairs.contact_types import (
    Pressed,
    is_open,
    placed_surface,
    pressed,
    pressed_along_line,
    pressing,
    takes_curves,
)
from mechgraph.pairs.factors import Touching
from mechgraph.quantities import FORCE, LENGTH, PRESSURE, TIME, unit_of, wrong
from mechgraph.result.trajectory import Trajectory
from mechgraph.result.values import OK, Fact, Mask, PositionLabels, bracket, driver_value, number, ranges, with_unit


class ContactGeometry:
    """Center, point, normal and curvatures of one contact, arrays over the positions."""

    def __init__(self, values: Trajectory, index: int) -> None:
        self._values, self._index = values, index

    @property
    def _pair(self) -> Pair:
        return self._values.whole.pairs[self._index]

    @property
    def _form(self) -> Touching:
        assert self._pair.type.touching is not None
        return self._pair.type.touching

    @cached_property
    def _sense(self) -> float:
        """1 where a presses on b along the first direction of the pair, -1 where against it.

        Of two curves, the first of which is open and has no inside, towards the side on which the second bends away from it.
        """
        if not self._form.curved or len(self._form.forces) > 1:
            return 1.0
        known, apart = pressing(self._pair.type), self._apart
        if apart is None or (apart.size and takes_curves(self._pair.type)[0].travel.is_closed):
            return known
        most = apart.reshape(-1)[np.argmax(np.nan_to_num(np.abs(apart)))] if apart.size else 0.0
        return float(np.sign(most)) or known

    @property
    def _frame(self) -> int:
        """The frame of the pair in which the normal force acts."""
        return self._pair.type.normal_frame

    @cached_property
    def _bodies(self) -> tuple[Array, Array, Array, Array]:
        """Poses and twists of both links."""
        m = self._values.whole
        (Xa, Va, _), (Xb, Vb, _) = (self._values.link(m.place_of_link(name)) for name in (self._pair.a, self._pair.b))
        return Xa, Va, Xb, Vb

    def _marker(self, side: int) -> tuple[Array, Array]:
        """Axes ``(..., 3, 3)`` (columns) and origin ``(..., 3)`` of the marker on a link."""
        X, local = self._bodies[2 * side], self._pair.markers[side].pose()
        return X[..., :3, :3] @ local[:, :3], (X[..., :3, :3] @ local[:, 3]) + X[..., :3, 3]

    @cached_property
    def _directions(self) -> Array:
        """Global directions ``(..., 3, n)`` of the components of the normal force."""
        names = self._pair.type.component_names
        return self._values.directions(self._index)[..., [names.index(name) for name in self._form.forces]]

    @cached_property
    def _parts(self) -> Array:
        """The components of the normal force ``(..., n)``."""
        found = self._values.components(self._index)
        return np.stack([found[name] for name in self._form.forces], axis=-1)

    @cached_property
    def normal(self) -> Array:
        """Unit direction ``(..., 3)`` in which a presses on b: the way the force acts; without forces the first direction of the pair."""
        first = self._sense * self._directions[..., 0]
        if not self._values.has_forces:
            return first
        force = (self._directions * self._parts[..., None, :]).sum(axis=-1)
        size = np.linalg.norm(force, axis=-1, keepdims=True)
        if self._pair.closed == "force" and len(self._form.forces) == 1:
            return first
        return np.where(size > 0, force / np.where(size > 0, size, 1.0), first)

    @property
    def center(self) -> Array:
        """Center ``(..., 3)`` of the ball, roller or cylinder on b, global; where they touch where b has none."""
        return self._values.frame_origin(self._index, self._frame)

    @property
    def point(self) -> Array:
        """Where they touch ``(..., 3)``, global; of a line its middle."""
        return self.center - (self._pair.radius_b or 0.0) * self.normal

    def _velocity(self, link: int, point: Array) -> Array:
        V = self._bodies[2 * link + 1]
        return V[..., 3:] + np.cross(V[..., :3], point)

    # --- curvatures ----------------------------------------------------------------------------------------------------

    @cached_property
    def _of_centre(self) -> tuple[Array, Array]:
        """Curvatures ``(...)`` towards the normal: both principal ones of the surface of the centers of a ball; that of the curve of the
        centers of a ball or roller, twice; of two curves the relative one, twice.
        """
        row = self._pair.type
        if (surface := placed_surface(row)) is not None:
            towards = np.sign((self.normal * self._directions[..., 0]).sum(axis=-1))
            one, two = towards * self._where_known(surface.curvatures, slice(0, 2))
            return one, two
        bends = self._where_known(takes_curves(row)[0].curvatures, 0)
        if len(self._form.forces) > 1:
            n = np.einsum("...ij,...i->j...", self._directions, self.normal)
            return ((bends[:2] * n).sum(axis=0),) * 2
        return (self._sense * (bends[1] if self._apart is None else self._apart),) * 2

    @cached_property
    def _apart(self) -> Array | None:
        """By how much two curves bend away from each other ``(...)``, that of b against that of a towards y of the frame; None else."""
        places = takes_curves(self._pair.type)
        if len(places) < 2:
            return None
        one, two = (self._where_known(place.curvatures, k)[1] for k, place in enumerate(places))
        return np.asarray(two - one)

    def _where_known(self, of: Callable[[Array], Array], coordinates: int | slice) -> Array:
        """A function of some coordinates of the pair ``(n, ...)``, NaN where the position was not solved: no shape is asked there."""
        x = np.moveaxis(self._values.coordinates(self._index, 0), -1, 0)
        known = np.isfinite(x).all(axis=0)
        found = of(x[coordinates][..., known])
        out = np.full((len(found), *known.shape), np.nan)
        out[:, known] = found
        return out

    @cached_property
    def _room(self) -> tuple[Array, float]:
        """What is above zero where the elements touch at one place only ``(...)``, and its scale: the relative curvature of two curves,
        ``(1 + r k) / r`` of a ball or roller; infinite where nothing is known of the elements.
        """
        radius = self._pair.radius_b
        none = np.full(self._values.batch, np.inf)
        if not self._form.curved or len(self._form.forces) > 1 or (radius is None and self._apart is None):
            return none, 0.0
        least = np.minimum(*self._of_centre)
        if takes_curves(self._pair.type) and not is_open(self._pair) and self._pair.closed != "force":
            least = -np.abs(least)  # a slot has two sides
        if radius is not None:
            least = 1.0 / radius + least
        return least, float(np.nanmax(np.abs(least), initial=0.0))


@dataclass(frozen=True)
class ContactRange:
    """A range of positions of the contact ``pair``.

    ``first``, ``last``: flat positions; ``begins``, ``ends``: values of the drivers (and the time ``t``) at its ends, between positions
    by a straight line, at the ends of the motion those there.
    """

    pair: str
    first: int
    last: int
    begins: dict[str, float]
    ends: dict[str, float]

    text: str

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class LiftOff(ContactRange):
    """Where a contact that only pushes would have to pull.

    The ends are where the force is zero; ``force``: the greatest pull, in a groove that against its opening.
    """

    force: float


@dataclass(frozen=True)
class Overlap(ContactRange):
    """Where the elements of a contact cut into each other beside the point at which they touch.

    Their relative curvature is below zero; ``curvature``: the greatest amount by which.
    """

    curvature: float


class Stretch(NamedTuple):
    """The first and last flat position of a range, the values of the drivers at its ends, how a text says these, the greatest amount."""

    first: int
    last: int
    begins: dict[str, float]
    ends: dict[str, float]
    where: str
    amount: float


def stretches(values: Trajectory, below: Mask, of: Array) -> Iterator[Stretch]:
    """The ranges of positions ``below`` zero of a fact ``of (...)``, which crosses zero where they begin and end."""
    low, fact = below.reshape(-1), of.reshape(-1)
    if not low.any():
        return
    row = values.batch[-1] if values.batch else 1
    ends = np.flatnonzero(np.diff(low, prepend=False, append=False))
    cuts = np.arange(row, low.size, row)  # rows of positions are motions of their own
    cuts = cuts[low[cuts - 1] & low[cuts]]
    places = PositionLabels(values)
    drivers = dict(zip(places.drivers, places.driver_values, strict=True))
    if values.t is not None:
        drivers["t"] = np.broadcast_to(np.asarray(values.t, dtype=float), values.batch).reshape(-1)

    def crossing(inside: int, outside: int) -> dict[str, float]:
        near = 0 <= outside < fact.size and outside // row == inside // row and np.isfinite(fact[outside])
        part = fact[inside] / (fact[inside] - fact[outside]) if near else 0.0
        there = outside if near else inside
        return {name: float(v[inside] + part * (v[there] - v[inside])) for name, v in drivers.items()}

    def said(name: str, value: float) -> str:
        if name == "t":
            return f"t = {with_unit(number(value), unit_of(values.mechanism.units, TIME))}"
        return driver_value(values.whole, name, value)

    for first, end in np.sort(np.concatenate([ends, cuts, cuts])).reshape(-1, 2).tolist():
        at = crossing(first, first - 1), crossing(end - 1, end)
        begins, ends_ = (", ".join(said(*item) for item in place.items()) for place in at)
        where = f"at {begins}" if begins == ends_ else f"from {begins} to {ends_}"
        yield Stretch(first, end - 1, *at, where, float(-np.nanmin(fact[first:end])))


def place_of_contact(values: Trajectory, name: str) -> int:
    """The number of the pair of that name.

    Raises
    ------
    DeclarationError
        for a pair whose elements do not touch at a point or along a line.
    """
    k = values.whole.place_of_pair(name)
    row = values.whole.pairs[k].type
    if row.touching is None:
        have = ", ".join(p.name for p in values.whole.pairs if p.type.touching) or "none here"
        raise DeclarationError(f"contact {name!r}", [wrong(row.symbol, "type", f"a contact of two elements ({have})")])
    return k


class ContactResult(ContactGeometry, Shown):
    """Facts of one contact, arrays over the positions; see the properties."""

    def document(self) -> Document:
        """Ranges of the facts over the positions, and where the contact would have to pull."""
        pair, units = self._pair, self._values.mechanism.units
        rows = [(name + bracket(unit_of(units, of)), value) for name, value, of in self.columns()]
        held = "only pushed" if pair.closed == "force" else "held on both sides"
        blocks: list[Block] = [
            Paragraph(f"{pair.type.name}, {pair.a} on {pair.b}, {held}. Paths are seen in the frames of its markers."),
            ranges(rows, PositionLabels(self._values).name),
            *(Paragraph(found.text) for found in (self.lift_off if self._values.has_forces else ())),
            *(Paragraph(found.text) for found in self.overlap),
        ]
        return Document(f"Contact {pair.name} of {self._values.mechanism.name}", tuple(blocks))

    def columns(self) -> list[Fact]:
        """Names, values ``(...)`` and dimensions of all facts."""
        out: list[Fact] = []
        for link, path in ((self._pair.a, self.path_a), (self._pair.b, self.path_b)):
            out += [(f"path on {link}:{x}", path[..., i], LENGTH) for i, x in enumerate("xyz")]
        if self._values.has_forces:
            out.append(("normal force", self.normal_force, FORCE))
        speeds = {"sliding": self.sliding, "rolling": self.rolling}
        out += [(f"{name} speed", np.linalg.norm(of, axis=-1), (1, 0, -1)) for name, of in speeds.items()]
        out.append(("spin", self.spin, (0, 0, -1)))
        for link in (self._pair.a, self._pair.b):
            if link != self._values.whole.frame:
                out.append((f"pressure angle of {link}", self.pressure_angle(link), (0, 0, 0)))
        if self._pair.radius_b and self._pair.b != self._values.whole.frame:
            name = f"pressure angle of {self._pair.b} at the contact"
            out.append((name, self.pressure_angle(self._pair.b, "contact"), (0, 0, 0)))
        if self._values.has_forces and self._pair.hertz is not None:
            out.append(("pressure", self.hertz.pressure, PRESSURE))
        return out

    # --- geometry ------------------------------------------------------------------------------------------------------

    @property
    def path_a(self) -> Array:
        """The path of the contact ``(..., 3)`` on link a in the frame of its marker there: how large plane, groove or slot must be."""
        return self._seen(0)

    @property
    def path_b(self) -> Array:
        """The path ``(..., 3)`` on link b in the frame of its marker: what part of the ball or cylinder is used."""
        return self._seen(1)

    def _seen(self, side: int) -> Array:
        axes, origin = self._marker(side)
        return np.einsum("...ji,...j->...i", axes, self.point - origin)

    # --- forces --------------------------------------------------------------------------------------------------------

    @property
    def normal_force(self) -> Array:
        """The force with which a presses on b ``(...)``: negative where a contact that is only pushed would have to pull.

        Of a pair held on both sides it is positive where it acts along the axis, negative on the other side; in a groove its size.
        """
        if len(self._form.forces) == 1:
            return self._sense * self._parts[..., 0]
        size = np.linalg.norm(self._parts, axis=-1)
        return np.where(self.lifts, -size, size) if self._pair.closed == "force" else size

    @cached_property
    def _pulls(self) -> Mask:
        """Where elements that are not held on both sides would have to pull ``(...)``."""
        pushed = np.asarray(self._sense * self._parts[..., 0])
        if not (self._pair.closed == "force" or (not self._pair.closed and is_open(self._pair))):
            return np.zeros(pushed.shape, dtype=bool)
        # part of the greatest normal force of a contact below which a pull is rounding
        least = 1e-10 * float(np.nanmax(np.linalg.norm(self._parts, axis=-1), initial=0.0))
        least += STRESSES.rounding * self._values.radius * float(self._values.largest[0])
        return np.asarray(pushed < -least)

    @property
    def lifts(self) -> Mask:
        """Where a contact that is only pushed would have to pull ``(...)``: b lifts off there, and the reactions are not real."""
        return self._pulls & (self._pair.closed == "force")

    @cached_property
    def lift_off(self) -> tuple[LiftOff, ...]:
        """The ranges of positions in which b lifts off; of an open profile that does not say how it is closed, those in which it would."""
        if not self._pulls.any():
            return ()
        pair, unit = self._pair, unit_of(self._values.mechanism.units, FORCE)

        def text(found: Stretch) -> str:
            pull = f"{found.amount:.4g}{' ' * bool(unit)}{unit}"
            if pair.closed == "force":
                return (
                    f"{pair.name}: {pair.b} lifts off {pair.a} {found.where}: the contact would have to pull with up to {pull}. "
                    "Forces there are not physical. Add preload, or use closed='form' to hold it on both sides"
                )
            return (
                f"{pair.name}: {pair.a} pulls {pair.b} {found.where} with up to {pull}, and its profile is open: nothing is said to "
                "hold it on the other side. Give closed='force' where it is only pushed (it lifts off there) or closed='form' where a "
                "groove, a second disc or a frame around it holds it"
            )

        of = self._sense * self._parts[..., 0]
        return tuple(
            LiftOff(pair.name, *found[:4], text(found), found.amount)
            for found in stretches(self._values, self._pulls, of)
        )

    @cached_property
    def overlap(self) -> tuple[Overlap, ...]:
        """The ranges of positions in which the elements cut into each other beside the contact: their relative curvature is below zero."""
        room, scale = self._room
        below = room < -SHAPES.even * scale
        if not below.any():
            return ()
        pair, unit = self._pair, unit_of(self._values.mechanism.units, (-1, 0, 0))

        def text(found: Stretch) -> str:
            size = f"{-found.amount:.4g}{' ' * bool(unit)}{unit}"
            return (
                f"{pair.name}: {pair.a} and {pair.b} cut into each other {found.where}: beside the point where they touch they bend "
                f"towards each other (relative curvature down to {size}). No such contact is possible there; make what is hollow "
                "wider, or what runs in it smaller"
            )

        return tuple(
            Overlap(pair.name, *found[:4], text(found), found.amount) for found in stretches(self._values, below, room)
        )

    @cached_property
    def hertz(self) -> Pressed:
        """Greatest pressure, half axes and approach ``(...)``, for the materials of the pair.

        Raises
        ------
        DeclarationError
            where the pair has none.
        """
        data, form, radius = self._pair.hertz, self._form, self._pair.radius_b or np.inf
        if data is None:
            raise DeclarationError(
                f"contact {self._pair.name!r}", ["no materials: give the pair hertz=mg.Hertz(moduli=(E_a, E_b))"]
            )
        force = self.normal_force if self._pair.closed == "force" else np.abs(self.normal_force)
        groove = data.groove_radius or np.inf
        along, across = (np.asarray(a / groove + b / radius) for a, b in zip(form.a, form.b, strict=True))
        if form.curved:
            along, across = self._bends(radius)
        if not form.along_line:
            return pressed(force, (along, across), data.modulus)
        assert data.length is not None
        with np.errstate(invalid="ignore", divide="ignore"):
            off = self._values.components(self._index)[form.tilting] / force if form.tilting else np.zeros(force.shape)
        return pressed_along_line(force, np.nan_to_num(off), data.length, across, data.modulus)

    def _bends(self, radius: float) -> tuple[Array, Array]:
        """Relative curvatures ``(...)`` along and across, where elements are curves or surfaces; NaN where a ball or roller does not fit.

        The center of a ball or roller of ``radius`` r that bends by k towards the normal n touches what bends by ``k / (1 + r k)``: the
        relative curvature is ``1 / r - k / (1 + r k) = 1 / (r (1 + r k))``; of the cross section of a groove ``1 / r - 1 / groove_radius``.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            one, two = self._of_centre
            if np.isinf(radius):
                return np.zeros(one.shape), np.where(one >= 0, one, np.nan)
            if len(self._form.forces) > 1:
                data = self._pair.hertz
                assert data is not None
                assert data.groove_radius is not None
                return _between(radius, one), np.asarray(1.0 / radius - 1.0 / data.groove_radius)
            surface = placed_surface(self._pair.type) is not None
            return _between(radius, one) if surface else np.zeros(one.shape), _between(radius, two)

    # --- motion --------------------------------------------------------------------------------------------------------

    @property
    def sliding(self) -> Array:
        """Velocity ``(..., 3)`` of b's material relative to a's where they touch, global directions."""
        return self._velocity(1, self.point) - self._velocity(0, self.point)

    @property
    def rolling(self) -> Array:
        """Mean velocity ``(..., 3)`` with which the contact travels over both elements, as it draws oil in; global directions."""
        k = self._frame
        rates = self._values.coordinates(self._index, 1)[..., None, :k]
        V = (self._values.screws(self._index)[..., :k] * rates).sum(axis=-1)
        return V[..., 3:] + np.cross(V[..., :3], self.point) - 0.5 * self.sliding

    @property
    def spin(self) -> Array:
        """Angular velocity ``(...)`` of b relative to a about the normal."""
        turning = self._bodies[3][..., :3] - self._bodies[1][..., :3]
        return np.asarray((turning * self.normal).sum(axis=-1))

    def pressure_angle(self, link: str, at: str | None = None) -> Array:
        """Angle ``(...)`` from 0 to pi/2 between the normal and the path of a point of a link; NaN where that has no direction.

        Of link b it is that of the books for cams: the point is the center of its roller, ball or cylinder (roller and round followers,
        also where they swing), and where they touch for flat faces, edges and curves, as for link a. ``at="contact"`` or ``at="center"``
        says which of the two, as some take the contact of a roller that swings too; on a follower that slides both are the same.

        The path of a link with one freedom on the frame is that of its pair, at rest too. Of any other link it has the direction of the
        velocity, and where that is zero of the acceleration. Of the driven link the angle is its deviation angle: the force moves it best
        at 0 and not at all at pi/2. Source: H. A. Rothbart, Cam Design Handbook, 2004, and R. L. Norton, Cam Design and Manufacturing
        Handbook, 2009, chapters on pressure angle: between the common normal and the velocity of the follower, of a roller its center.

        Raises
        ------
        DeclarationError
            for a link that is not in contact here, or another ``at``.
        """
        ends = (self._pair.a, self._pair.b)
        faults = [] if link in ends else [wrong(link, "link", " or ".join(map(repr, ends)))]
        if at not in (None, "contact", "center"):
            faults.append(wrong(at, "at", "'contact', 'center' or None"))
        if faults:
            raise DeclarationError(f"contact {self._pair.name!r}", faults)
        side = ends.index(link)
        at = at or ("center" if side else "contact")
        return angle_between(self._along_path(link, side, self.center if at == "center" else self.point), self.normal)

    def _along_path(self, link: str, side: int, point: Array) -> Array:
        """A vector ``(..., 3)`` along the path of a point of a link; zero where it has none."""
        m = self._values.whole
        for k, pair in enumerate(m.pairs):
            if k != self._index and {pair.a, pair.b} == {link, m.frame} and pair.type.f == 1:
                guided = self._values.screws(k)[..., 0]
                return np.asarray(guided[..., 3:] + np.cross(guided[..., :3], point))
        v, w = self._velocity(side, point), self._bodies[2 * side + 1][..., :3]
        dV = self._values.link(m.place_of_link(link))[2]
        a = dV[..., 3:] + np.cross(dV[..., :3], point) + np.cross(w, v)
        size = np.linalg.norm(v, axis=-1, keepdims=True)
        # part of the greatest velocity of a link at a contact below which it is rounding
        return np.where(size <= 1e-10 * np.nanmax(size, initial=0.0), a, v)


def _between(radius: float, k: Array) -> Array:
    """Relative curvature of a ball or roller, whose center bends by ``k`` towards the normal, and what it touches."""
    fits = 1.0 + radius * k
    return np.where(fits > 0, 1.0 / (radius * np.where(fits > 0, fits, 1.0)), np.nan)


def angle_between(v: Array, n: Array) -> Array:
    """Angle ``(...)`` between the lines of two vectors, 0 to pi/2; NaN where one is zero."""
    along, across = np.abs((v * n).sum(axis=-1)), np.linalg.norm(np.cross(v, n), axis=-1)
    return np.where(along + across > 0, np.arctan2(across, along), np.nan)


def contacts_of(values: Trajectory) -> dict[str, ContactResult]:
    """The facts of all contacts by the names of their pairs."""
    return {p.name: ContactResult(values, k) for k, p in enumerate(values.whole.pairs) if p.type.touching}


def lift_offs(values: Trajectory) -> tuple[LiftOff, ...]:
    """Where contacts that are only pushed, or do not say that they are held, would have to pull."""
    if not values.has_forces:
        return ()
    found = contacts_of(values).values() if bool((values.status() == OK).any()) else ()
    return (*(lift for contact in found for lift in contact.lift_off), *slack_spans(values), *pulled_flanks(values))


def _flanks(values: Trajectory) -> Iterator[tuple[Mesh, Array, Mask]]:
    """Meshes with the forces ``(T,)`` that their flanks push with, and where these would have to pull."""
    meshes = [(k, one) for k, one in enumerate(values.whole.couplings) if isinstance(one, Mesh) and not one.play]
    if not meshes or not values.has_forces:
        return
    multipliers, loose = values.multipliers()
    for k, one in meshes:
        push = (-1.0 if one.flank == "backward" else 1.0) * np.where(loose[k], 0.0, np.nan_to_num(multipliers[k]))
        # part of the greatest force below which a pull is rounding
        pulls = push < -1e-9 * float(np.abs(push).max(initial=0.0))
        if one.other is not one.relation and pulls.any():
            pulls &= ~values.turned_over(k)
        yield one, push, pulls


def pulled_flanks(values: Trajectory) -> Iterator[LiftOff]:
    """Where flanks of teeth would have to pull: given ones, and those of gears whose centers move, which touch on one flank."""
    for one, push, pulls in _flanks(values):
        for found in stretches(values, pulls.reshape(values.batch), push.reshape(values.batch)):
            unit = unit_of(values.mechanism.units, FORCE)
            pull = f"{found.amount:.4g}{' ' * bool(unit)}{unit}"
            text = (
                f"mesh {one.name}: its flank would have to pull {found.where}, with up to {pull}; with centers that move it keeps to one "
                "flank. Forces there are not physical. Give flank='forward' or 'backward' as the load asks, or more load"
            )
            yield LiftOff(one.name, *found[:4], text, found.amount)


def with_other_flanks(m: Mechanism, values: Trajectory) -> Mechanism | None:
    """The mechanism on the other flanks of gears whose centers move where ``"auto"`` would pull from the first force on; None for none."""
    pulling = {
        one.name
        for one, push, pulls in _flanks(values)
        if one.flank == "auto" and pulls[np.argmax(np.abs(push) > 1e-9 * np.abs(push).max())]
    }
    turned = [c.replace(flank="backward") if c.name in pulling else c for c in m.couplings]
    return m.replace(couplings=turned) if pulling else None


def slack_spans(values: Trajectory) -> Iterator[LiftOff]:
    """Where spans of belts would have to push."""
    belts = [(k, one) for k, one in enumerate(values.whole.couplings) if isinstance(one, BeltDrive)]
    multipliers, loose = values.multipliers() if belts else (np.zeros((0, 0)), np.zeros((0, 0), dtype=bool))
    for name in dict.fromkeys(one.belt for _, one in belts):
        own = [(k, one.span_names[one.span or 0]) for k, one in belts if one.belt == name]
        tensions = np.array([np.where(loose[k], 0.0, np.nan_to_num(-multipliers[k])) for k, _ in own])
        # part of the greatest tension below which a push is rounding
        slack, least = tensions < -1e-10 * np.abs(tensions).max(initial=0.0), tensions.min(axis=0)
        for found in stretches(values, slack.any(axis=0).reshape(values.batch), least.reshape(values.batch)):
            unit = unit_of(values.mechanism.units, FORCE)
            push, there = (
                f"{found.amount:.4g}{' ' * bool(unit)}{unit}",
                slack[:, found.first : found.last + 1].any(axis=1),
            )
            spans = ", ".join(span for (_, span), so in zip(own, there.tolist(), strict=True) if so)
            text = (
                f"belt {name}: its {'spans' if there.sum() > 1 else 'span'} {spans} {'are' if there.sum() > 1 else 'is'} slack "
                f"{found.where}: it would have to push with up to {push}. Forces there are not physical. Give the belt more pretension, "
                "or its tensioner more load"
            )
            yield LiftOff(name, *found[:4], text, found.amount)


def overlaps(values: Trajectory) -> tuple[Overlap, ...]:
    """Where the elements of contacts cut into each other."""
    return tuple(overlap for contact in contacts_of(values).values() for overlap in contact.overlap)


def contact_columns(values: Trajectory) -> Iterator[Fact]:
    """Columns of the table: ``B path on plane:x``, ``B normal force``, ``B sliding speed``, ...

    Paths are seen in the frames of the markers of the pair on these links.
    """
    for name, contact in contacts_of(values).items():
        yield from ((f"{name} {fact}", value, dimension) for fact, value, dimension in contact.columns())
