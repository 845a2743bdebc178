"""Facts of contacts: where the elements of a pair touch, with what force, how they slide and roll, and where a force would have to pull.

With the origin c of the frame of the normal force (centre of a ball or roller, point of a curve), the radius r and the normal n in which a
presses on b:

    p = c - r n,   sliding v = v_b(p) - v_a(p),   travel over a: u, over b: u - v,   rolling: the mean of both,

u the velocity of p as a place of that frame, seen from a. In a groove p also moves across with the direction of the force, which counts as
neither. Where the radius is not declared it counts as zero.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.document import Block, Document, Paragraph, Shown
from mechgraph.errors import DeclarationError
from mechgraph.model.contact_rows import pressing, takes_curves
from mechgraph.model.hertz import Pressed, pressed, pressed_along_line
from mechgraph.model.pair import Pair
from mechgraph.model.row_parts import Touching
from mechgraph.model.surface_rows import placed_surface
from mechgraph.quantities import wrong
from mechgraph.result.numbers import bracket, number, ranges, with_unit
from mechgraph.result.places import OK, Places, driver_value
from mechgraph.result.values import Mask, Values
from mechgraph.result.views import CouplingResult
from mechgraph.units import FORCE, LENGTH, PRESSURE, TIME, unit_of

PULL = 1e-10
"""Part of the greatest normal force of a contact below which a pull is rounding."""
STANDS = 1e-10
"""Part of the greatest velocity of a link at a contact below which it is rounding."""


@dataclass(frozen=True)
class LiftOff:
    """A range of positions in which a contact that only pushes would have to pull.

    ``first``, ``last``: flat positions; ``begins``, ``ends``: values of the drivers (and the time ``t``) where the force is zero, between
    positions by a straight line, at the ends of the motion those there; ``force``: the greatest pull, in a groove that against its opening.
    """

    pair: str
    first: int
    last: int
    begins: dict[str, float]
    ends: dict[str, float]
    force: float
    text: str

    def __str__(self) -> str:
        return self.text


def place_of_contact(values: Values, name: str) -> int:
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


class ContactResult(Shown):
    """Facts of one contact, arrays over the positions; see the properties."""

    def __init__(self, values: Values, index: int) -> None:
        self._values, self._index = values, index

    def document(self) -> Document:
        """Ranges of the facts over the positions, and where the contact would have to pull."""
        pair, units = self._pair, self._values.mechanism.units
        rows = [(name + bracket(unit_of(units, of)), value) for name, value, of in self.columns()]
        held = "held on both sides" if pair.closed == "form" else "only pushed"
        blocks: list[Block] = [
            Paragraph(f"{pair.type.name}, {pair.a} on {pair.b}, {held}. Paths are seen in the frames of its markers."),
            ranges(rows, Places(self._values).name),
            *(Paragraph(found.text) for found in (self.lift_off if self._values.has_forces else ())),
        ]
        return Document(f"Contact {pair.name} of {self._values.mechanism.name}", tuple(blocks))

    def columns(self) -> list[tuple[str, Array, tuple[int, int, int]]]:
        """Names, values ``(...)`` and dimensions of all facts."""
        out: list[tuple[str, Array, tuple[int, int, int]]] = []
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
        if self._values.has_forces and self._pair.hertz is not None:
            out.append(("pressure", self.hertz.pressure, PRESSURE))
        return out

    # --- geometry ------------------------------------------------------------------------------------------------------

    @property
    def _pair(self) -> Pair:
        return self._values.whole.pairs[self._index]

    @property
    def _form(self) -> Touching:
        assert self._pair.type.touching is not None
        return self._pair.type.touching

    @cached_property
    def _sense(self) -> float:
        """1 where a presses on b along the first direction of the pair, -1 where against it."""
        row = self._pair.type
        return pressing(row) if self._form.curved and len(self._form.forces) == 1 else 1.0

    @property
    def _frame(self) -> int:
        """The frame of the pair in which the normal force acts."""
        return next(c.frame for c in self._pair.type.reactions or () if c.name == self._form.forces[0])

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
    def point(self) -> Array:
        """Where they touch ``(..., 3)``, global; of a line its middle."""
        return self._values.frame_origin(self._index, self._frame) - (self._pair.radius_b or 0.0) * self.normal

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

    @property
    def lifts(self) -> Mask:
        """Where a contact that is only pushed would have to pull ``(...)``: b lifts off there, and the reactions are not real."""
        pushed = np.asarray(self._sense * self._parts[..., 0])
        if self._pair.closed == "form":
            return np.zeros(pushed.shape, dtype=bool)
        least = PULL * float(np.nanmax(np.linalg.norm(self._parts, axis=-1), initial=0.0))
        return np.asarray(pushed < -least)

    @cached_property
    def lift_off(self) -> tuple[LiftOff, ...]:
        """The ranges of positions in which b lifts off."""
        lifts = self.lifts.reshape(-1)
        if not lifts.any():
            return ()
        row = self._values.batch[-1] if self._values.batch else 1
        ends = np.flatnonzero(np.diff(lifts, prepend=False, append=False))
        cuts = np.arange(row, lifts.size, row)  # rows of positions are motions of their own
        cuts = cuts[lifts[cuts - 1] & lifts[cuts]]
        ends = np.sort(np.concatenate([ends, cuts, cuts]))
        return tuple(self._range(int(a), int(b) - 1, row) for a, b in ends.reshape(-1, 2))

    def _range(self, first: int, last: int, row: int) -> LiftOff:
        values, units = self._values, self._values.mechanism.units
        force = self._sense * self._parts[..., 0].reshape(-1)
        places = Places(values)
        of = dict(zip(places.drivers, places.driver_values, strict=True))
        if values.t is not None:
            of["t"] = np.broadcast_to(np.asarray(values.t, dtype=float), values.batch).reshape(-1)

        def crossing(inside: int, outside: int) -> dict[str, float]:
            near = 0 <= outside < force.size and outside // row == inside // row and np.isfinite(force[outside])
            part = force[inside] / (force[inside] - force[outside]) if near else 0.0
            there = outside if near else inside
            return {name: float(v[inside] + part * (v[there] - v[inside])) for name, v in of.items()}

        def said(name: str, value: float) -> str:
            if name == "t":
                return f"t = {with_unit(number(value), unit_of(units, TIME))}"
            return driver_value(values.whole, name, value)

        begins, ends = crossing(first, first - 1), crossing(last, last + 1)
        pull = float(-np.nanmin(force[first : last + 1]))
        where = " to ".join(", ".join(said(*item) for item in at.items()) for at in (begins, ends))
        unit = unit_of(units, FORCE)
        text = (
            f"{self._pair.name}: {self._pair.b} lifts off {self._pair.a} from {where}: the contact would have to pull with up to "
            f"{pull:.4g}{' ' * bool(unit)}{unit}. Forces there are not real; press harder, or hold it on both sides, closed='form'"
        )
        return LiftOff(self._pair.name, first, last, begins, ends, pull, text)

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
        force = np.abs(self.normal_force) if self._pair.closed == "form" else self.normal_force
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

        The centre of a ball or roller of ``radius`` r that bends by k towards the normal n touches what bends by ``k / (1 + r k)``: the
        relative curvature is ``1 / r - k / (1 + r k) = 1 / (r (1 + r k))``; of the cross section of a groove ``1 / r - 1 / groove_radius``.
        """
        row, x = self._pair.type, np.moveaxis(self._values.coordinates(self._index)[0], -1, 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            if (surface := placed_surface(row)) is not None:
                towards = np.sign((self.normal * self._directions[..., 0]).sum(axis=-1))
                one, two = towards * surface.curvatures(x[:2])
                return _between(radius, one), _between(radius, two)
            places = takes_curves(row)
            bends = places[0].curvatures(x[0])
            if len(self._form.forces) > 1:
                data = self._pair.hertz
                assert data is not None
                assert data.groove_radius is not None
                n = np.einsum("...ij,...i->j...", self._directions, self.normal)
                return _between(radius, (bends[:2] * n).sum(axis=0)), np.asarray(
                    1.0 / radius - 1.0 / data.groove_radius
                )
            path = self._sense * bends[1]
            if np.isfinite(radius):
                return np.zeros(path.shape), _between(radius, path)
            other = self._sense * places[1].curvatures(x[1])[1] if len(places) > 1 else 0.0
            return np.zeros(path.shape), np.asarray(other - path)

    # --- motion --------------------------------------------------------------------------------------------------------

    def _velocity(self, link: int, point: Array) -> Array:
        V = self._bodies[2 * link + 1]
        return V[..., 3:] + np.cross(V[..., :3], point)

    @property
    def sliding(self) -> Array:
        """Velocity ``(..., 3)`` of b's material relative to a's where they touch, global directions."""
        return self._velocity(1, self.point) - self._velocity(0, self.point)

    @property
    def rolling(self) -> Array:
        """Mean velocity ``(..., 3)`` with which the contact travels over both elements, as it draws oil in; global directions."""
        k = self._frame
        rates = self._values.coordinates(self._index)[1][..., None, :k]
        V = (self._values.screws(self._index)[..., :k] * rates).sum(axis=-1)
        return V[..., 3:] + np.cross(V[..., :3], self.point) - 0.5 * self.sliding

    @property
    def spin(self) -> Array:
        """Angular velocity ``(...)`` of b relative to a about the normal."""
        turning = self._bodies[3][..., :3] - self._bodies[1][..., :3]
        return np.asarray((turning * self.normal).sum(axis=-1))

    def pressure_angle(self, link: str) -> Array:
        """Angle ``(...)`` from 0 to pi/2 between the normal and the path of a link where they touch; NaN where that has no direction.

        The path of a link with one freedom on the frame is that of its pair, at rest too. Of any other link it has the direction of the
        velocity, and where that is zero of the acceleration. Of the driven link the angle is its deviation angle: the force moves it best
        at 0 and not at all at pi/2.
        """
        ends = (self._pair.a, self._pair.b)
        if link not in ends:
            raise DeclarationError(f"contact {self._pair.name!r}", [wrong(link, "link", " or ".join(map(repr, ends)))])
        return angle_between(self._along_path(link, ends.index(link)), self.normal)

    def _along_path(self, link: str, side: int) -> Array:
        """A vector ``(..., 3)`` along the path of a link where they touch; zero where it has none."""
        m = self._values.whole
        for k, pair in enumerate(m.pairs):
            if k != self._index and {pair.a, pair.b} == {link, m.frame} and pair.type.f == 1:
                guided = self._values.screws(k)[..., 0]
                return np.asarray(guided[..., 3:] + np.cross(guided[..., :3], self.point))
        v, w = self._velocity(side, self.point), self._bodies[2 * side + 1][..., :3]
        dV = self._values.link(m.place_of_link(link))[2]
        a = dV[..., 3:] + np.cross(dV[..., :3], self.point) + np.cross(w, v)
        size = np.linalg.norm(v, axis=-1, keepdims=True)
        return np.where(size <= STANDS * np.nanmax(size, initial=0.0), a, v)


def _between(radius: float, k: Array) -> Array:
    """Relative curvature of a ball or roller, whose centre bends by ``k`` towards the normal, and what it touches."""
    fits = 1.0 + radius * k
    return np.where(fits > 0, 1.0 / (radius * np.where(fits > 0, fits, 1.0)), np.nan)


def angle_between(v: Array, n: Array) -> Array:
    """Angle ``(...)`` between the lines of two vectors, 0 to pi/2; NaN where one is zero."""
    along, across = np.abs((v * n).sum(axis=-1)), np.linalg.norm(np.cross(v, n), axis=-1)
    return np.where(along + across > 0, np.arctan2(across, along), np.nan)


def contacts_of(values: Values) -> dict[str, ContactResult]:
    """The facts of all contacts by the names of their pairs."""
    return {p.name: ContactResult(values, k) for k, p in enumerate(values.whole.pairs) if p.type.touching}


def lift_offs(values: Values) -> tuple[LiftOff, ...]:
    """Where contacts that are only pushed would have to pull."""
    known = values.has_forces and bool((values.status() == OK).any())
    forced = [k for k, p in enumerate(values.whole.pairs) if p.closed == "force"] if known else []
    return tuple(found for k in forced for found in ContactResult(values, k).lift_off)


def contact_columns(values: Values) -> Iterator[tuple[str, Array, tuple[int, int, int]]]:
    """Columns of the table: ``B path on plane:x``, ``B normal force``, ``B sliding speed``, ...; of gears force and sliding speed.

    Paths are seen in the frames of the markers of the pair on these links.
    """
    for name, contact in contacts_of(values).items():
        yield from ((f"{name} {fact}", value, dimension) for fact, value, dimension in contact.columns())
    for k, coupling in enumerate(values.whole.couplings):
        if coupling.steps and values.has_forces:
            gears = CouplingResult(values, k)
            yield f"{coupling.name} force", np.linalg.norm(gears.force, axis=-1), FORCE
            yield f"{coupling.name} sliding speed", np.linalg.norm(gears.sliding, axis=-1), (1, 0, -1)
