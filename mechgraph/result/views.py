"""What a solution hands out by name: values of pairs, couplings and links, their ranges for people, and labels of positions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from mechgraph.document import Block, Document, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError
from mechgraph.fields import vector_fault
from mechgraph.maths.se3 import Array
from mechgraph.model.belts import BeltCourse, BeltDrive
from mechgraph.model.friction import Friction
from mechgraph.model.gear_facts import behind_of
from mechgraph.model.meshes import Mesh
from mechgraph.model.pair import Pair
from mechgraph.model.short_forms import Belt
from mechgraph.pairs.pair_type import PairType
from mechgraph.quantities import FORCE, LENGTH, POWER, ByName, is_numeric, unit_of
from mechgraph.result.trajectory import Trajectory
from mechgraph.result.values import Fact, MaterialPoint, MisfitsLeftOut, PositionLabels, bracket, coupling_unit, ranges

UNASKED = 1_000_000
"""Links, or pairs, times positions up to which they are looked through without being asked for: a second, about."""

Row = tuple[str, Any]
"""A quantity and its values, one a position."""


def pair_document(values: Trajectory, k: int) -> Document:
    """Coordinates, rates, efforts and reaction of a pair."""
    places, pair = PositionLabels(values), values.whole.pairs[k]
    blocks: list[Block] = [
        Paragraph(f"{pair.type.symbol}, {pair.type.name}, from {pair.a} on {pair.b}; {_solved(places)}."),
        ranges(_pair_rows(values, pair, k), places.name),
    ]
    if values.has_forces and not _large(values):
        loose = [n for n, ok in values.unique(k).items() if not places.flat(ok)[places.solved].all()]
        how = "of least norm" if values.least_norm else "without a value (NaN)"
        blocks.append(Paragraph(f"Not unique, {how}: {', '.join(loose)}." if loose else ""))
    elif values.has_forces:
        blocks.append(Paragraph(_asked(values, f"s[{pair.name!r}].components")))
    return Document(f"Pair {pair.name} of {values.mechanism.name}", tuple(blocks))


def _pair_rows(values: Trajectory, pair: Pair, k: int) -> Iterator[Row]:
    units, coordinates = values.mechanism.units, [values.coordinates(k, rank) for rank in range(3)]
    for j, freedom in enumerate(pair.type.freedoms):
        turns = freedom.turns
        for order, (what, of) in enumerate(zip(("", " velocity", " acceleration"), coordinates, strict=True)):
            unit = unit_of(units, (0 if turns else 1, 0, -order))
            scale, unit = (180 / np.pi, "deg") if turns and not order else (1.0, unit)
            yield f"{freedom.name}{what}{bracket(unit)}", scale * of[..., j]
    if not values.has_forces:
        return
    force, moment = (unit_of(units, (power, 1, -2)) for power in (1, 2))
    driven = {values.whole.freedom(name) for name in values.actuated}
    own, applied = values.efforts(k)
    for j, (freedom, effort) in enumerate(zip(pair.type.freedoms, pair.type.efforts, strict=True)):
        unit = bracket(moment if effort.is_couple else force)
        if (k, j) in driven:
            yield f"{freedom.name} effort of the drive{unit}", own[..., j]
        if np.nan_to_num(applied[..., j]).any():
            yield f"{freedom.name} applied effort{unit}", applied[..., j]
    wrench = values.reaction_at_pair(k)
    size, unique = np.linalg.norm(wrench[..., 3:], axis=-1), values.magnitude(k)
    yield f"force{bracket(force)}", size
    if (np.isnan(size) & ~np.isnan(unique)).any():
        yield f"force, what is unique of it{bracket(force)}", unique
    yield f"moment{bracket(moment)}", np.linalg.norm(wrench[..., :3], axis=-1)
    if not _large(values):
        couples = {c.name: c.is_couple for c in pair.type.reactions or ()}
        for name, of in values.components(k).items():
            yield f"{name}{bracket(moment if couples.get(name) else force)}", of


def link_document(values: Trajectory, k: int) -> Document:
    """Motion of the mass center and the named points of a link, and how it turns."""
    m, places = values.mechanism, PositionLabels(values)
    link = m.links[k]
    if _large(values):
        shown: Block = Paragraph(_asked(values, f"s.link({link.name!r}).pose"))
    else:
        shown = ranges(_link_rows(values, k), places.name)
    return Document(f"Link {link.name} of {m.name}", (Paragraph(f"{_solved(places).capitalize()}."), shown))


def _link_rows(values: Trajectory, k: int) -> Iterator[Row]:
    m = values.mechanism
    link = m.links[k]
    length, speed, rate = (bracket(unit_of(m.units, (1, 0, -n))) for n in range(3))
    named = {"mass center": None} if link.center is not None else {}
    for name, at in {**named, **link.points}.items() or {"origin of the frame": (0.0, 0.0, 0.0)}.items():
        point = values.link_point(k, at)
        yield from ((f"{name} {axis}{length}", point.position[..., i]) for i, axis in enumerate(m.axes))
        yield f"{name} speed{speed}", np.linalg.norm(point.velocity, axis=-1)
        yield f"{name} acceleration{rate}", np.linalg.norm(point.acceleration, axis=-1)
    _, twist, change = values.link(k)
    for n, (what, of) in enumerate((("velocity", twist), ("acceleration", change)), 1):
        yield f"angular {what}{bracket(unit_of(m.units, (0, 0, -n)))}", np.linalg.norm(of[..., :3], axis=-1)


def _fact_ranges(values: Trajectory, facts: Iterable[Fact], *first: Row) -> Table:
    """Ranges of rows and facts; angles of wrap in degrees."""
    units, rows = values.mechanism.units, [*first]
    for name, of, dimension in facts:
        turns = name.startswith("wrap")
        rows.append(
            (name + (" [deg]" if turns else bracket(unit_of(units, dimension))), np.rad2deg(of) if turns else of)
        )
    return ranges(rows, PositionLabels(values).name)


def _solved(places: PositionLabels) -> str:
    of = places.status.size
    return f"solved {int(places.solved.sum())} of {of} position{'s' * (of != 1)}"


def _large(values: Trajectory) -> bool:
    return len(values.mechanism.links) * int(np.prod(values.batch)) > UNASKED


def _asked(values: Trajectory, call: str) -> str:
    """What is said in place of what would take long."""
    size = f"{len(values.mechanism.links):,} links at {int(np.prod(values.batch)):,} positions"
    return f"What follows from the motion was not evaluated ({size}): {call} does it."


def deflections(values: Trajectory, k: int) -> dict[str, Array]:
    """Small motions ``(...)`` of link b against link a along the components of a pair, ``misfit - l / k``."""
    p, out = values.whole.pairs[k], {}
    soft, off = ({} if seat is None else seat.by_component for seat in (p.stiffness, p.misfit))
    for name, of in values.components(k).items():
        stiff = soft.get(name)
        gives = np.zeros(of.shape) if stiff is None else of / stiff if stiff else np.full(of.shape, np.nan)
        out[name] = off.get(name, 0.0) - gives
    return out


def misfits_left_out(values: Trajectory) -> tuple[MisfitsLeftOut, ...]:
    """Misfits of components that are not unique where stiffness does not split them."""
    if not values.has_forces or values.split_by_stiffness:
        return ()
    given = {k: p.misfit.by_component for k, p in enumerate(values.whole.pairs) if p.misfit is not None}
    found = [
        f"{values.whole.pairs[k].name}.{name}"
        for k, off in given.items()
        for name, unique in values.unique(k).items()
        if off.get(name) and not unique.all()
    ]
    return (MisfitsLeftOut(tuple(found)),) if found else ()


class PairResult(Shown):
    """Values of one pair; see the properties."""

    def __init__(self, values: Trajectory, index: int) -> None:
        self._values, self._index = values, index

    def document(self) -> Document:
        """Ranges of the values over the positions, and where they are reached."""
        return pair_document(self._values, self._index)

    @property
    def position(self) -> Array:
        """Coordinates ``(..., f)`` in the order of the pair table; angles unwrapped, of a rotation the rotation vector."""
        return self._values.coordinates(self._index, 0)

    @property
    def velocity(self) -> Array:
        """Rates ``(..., f)``; of a rotation the angular velocity in frame k before it."""
        return self._values.coordinates(self._index, 1)

    @property
    def acceleration(self) -> Array:
        """Rates of the rates ``(..., f)``."""
        return self._values.coordinates(self._index, 2)

    @property
    def gap(self) -> Array:
        """By how much a contact is open ``(...)``, in ``respond``; 0 of one that stays closed."""
        place = self._values.whole.pairs[self._index].type.gap
        return np.zeros(self._values.batch) if place is None else self.position[..., place]

    @property
    def reaction(self) -> Array:
        """Wrench ``(..., 6)``, (M, F) about the global origin, that link a exerts on link b: the constraint part alone."""
        return self._values.reaction(self._index)

    @property
    def total(self) -> Array:
        """Reaction and all efforts (of couplings too), all that the pair transmits, ``(..., 6)``."""
        return self._values.total(self._index)

    @property
    def effort(self) -> Array:
        """What the drive supplies ``(..., f)``, the motor's torque or force: + on link b, - on link a; 0 in freedoms not driven."""
        return self._values.efforts(self._index)[0]

    @property
    def applied_effort(self) -> Array:
        """What loads do in the freedoms ``(..., f)``: springs, dampers, given efforts; 0 where nothing acts."""
        return self._values.efforts(self._index)[1]

    @property
    def force(self) -> Array:
        """Force of the reaction ``(..., 3)``, global directions."""
        return self._values.reaction_at_pair(self._index)[..., 3:]

    @property
    def magnitude(self) -> Array:
        """Size ``(...)`` of what is unique of the force: of its part at right angles to the forces that self-stresses may add.

        In a planar mechanism that is the force in its plane. NaN where nothing of it is unique.
        """
        return self._values.magnitude(self._index)

    @property
    def moment(self) -> Array:
        """Moment of the reaction ``(..., 3)`` about the origin of marker B, global directions."""
        return self._values.reaction_at_pair(self._index)[..., :3]

    @property
    def components(self) -> dict[str, Array]:
        """Reaction components of the pair table by name, in frame k about its origin; NaN where not unique.

        Components n1, n2, ... (of a null space) mix force and moment: they count wrenches with ``|F|^2 + |M / L|^2 = 1`` about marker B, L
        the mean radius of the mechanism, and have the unit of a force.
        """
        return self._by_name("component", self._values.components(self._index))

    def _by_name(self, what: str, values: Mapping[str, Array]) -> dict[str, Array]:
        return ByName(f"pair {self._values.whole.pairs[self._index].name!r}", what, values.items())

    @property
    def friction(self) -> Array:
        """Dry friction in the freedoms ``(..., f)``: a part of ``applied_effort``."""
        return self._values.friction(self._index)

    @property
    def normal_forces(self) -> Array:
        """Normal forces ``(..., n)`` at the places that rub, in the order of the axes of the pair; preload included."""
        return self._values.at_places("normals", self._name)

    @property
    def sliding(self) -> Array:
        """Speeds of sliding ``(..., n)`` at these places; zero where nothing slides."""
        return self._values.at_places("speeds", self._name)

    @property
    def sticks(self) -> Array:
        """Whether it rubs and is at rest ``(...)``: true or false."""
        rests = ~self.sliding.any(axis=-1) & np.isfinite(self.friction).all(axis=-1)
        return np.asarray(rests & bool(self.sliding.shape[-1]))

    @property
    def _name(self) -> str:
        return self._values.whole.pairs[self._index].name

    @property
    def effort_range(self) -> Array:
        """Least and greatest effort of a drive at rest ``(..., f, 2)``: between them friction holds it, with ``static``, other drives held.

        The ends are on the verge of motion to - and to +; infinite where it jams. In motion, and without friction, both are the effort.
        """
        return self._values.effort_range(self._index)

    @property
    def locked_in(self) -> dict[str, Array]:
        """What misfits lock in of the components, without any load, ``(...)`` by name; ``solve(..., redundant="elastic")``."""
        return self._by_name("component", self._values.locked_in(self._index))

    @property
    def deflection(self) -> dict[str, Array]:
        """Small motion ``(...)`` of link b against link a along the components, ``misfit - reaction / stiffness``, a turn for a moment.

        NaN for a component of stiffness 0, which says nothing of it.
        """
        return self._by_name("component", deflections(self._values, self._index))

    @property
    def unique(self) -> dict[str, Array]:
        """Which components are unique, and ``effort`` (or ``effort Tz``) of driven freedoms: ``(...)``, true or false.

        What is not unique is NaN, or of least norm where ``solve`` was asked for that.
        """
        return self._by_name("component", self._values.unique(self._index))

    @property
    def units(self) -> dict[str, Any]:
        """Units of the properties in the declared units: a tuple over freedoms, a dict over components, or one text."""
        m = self._values.whole
        return pair_units(m.units, m.pairs[self._index].type)


def pair_units(units: Mapping[str, str], row: PairType) -> dict[str, Any]:
    """Units of what a solution says of a pair: a tuple over freedoms, a dict over components, or one text."""
    lengths = [0 if f.turns else 1 for f in row.freedoms]
    efforts = tuple(unit_of(units, (2 if c.is_couple else 1, 1, -2)) for c in row.efforts)
    force, moment = (unit_of(units, (power, 1, -2)) for power in (1, 2))
    return {
        "position": tuple(unit_of(units, (n, 0, 0)) for n in lengths),
        "velocity": tuple(unit_of(units, (n, 0, -1)) for n in lengths),
        "acceleration": tuple(unit_of(units, (n, 0, -2)) for n in lengths),
        "effort": efforts,
        "applied_effort": efforts,
        "force": force,
        "magnitude": force,
        "moment": moment,
        "reaction": (moment,) * 3 + (force,) * 3,
        "total": (moment,) * 3 + (force,) * 3,
        "components": {c.name: moment if c.is_couple else force for c in row.reactions}
        if row.reactions is not None
        else dict.fromkeys(row.component_names, force and f"{force}, M/L"),
    }


class CouplingResult(Shown):
    """Values of one coupling ``sum c_i q_i = constant``."""

    def __init__(self, values: Trajectory, index: int) -> None:
        self._values, self._index = values, index

    def document(self) -> Document:
        """The relation that the coupling imposes; ranges of its values over the positions, and where they are reached."""
        m = self._values.mechanism
        c = m.couplings[self._index]
        blocks: list[Block] = [Paragraph(f"{c.text}; {_solved(PositionLabels(self._values))}.")]
        if self._values.has_forces:
            multiplier = f"multiplier{bracket(coupling_unit(m, c))}", self.effort
            blocks.append(_fact_ranges(self._values, (*self.forces(), *self.geometry()), multiplier))
        return Document(f"Coupling {c.name} of {m.name}", tuple(blocks))

    def forces(self) -> Iterator[Fact]:
        """What acts between teeth, or in the strands of a belt, as columns of tables; nothing of a relation between freedoms."""
        values, c = self._values, self._values.whole.couplings[self._index]
        if not c.steps or not values.has_forces:
            return
        belt = isinstance(c, Belt)
        yield (
            ("tension", np.linalg.norm(self.force, axis=-1), FORCE)
            if belt
            else ("normal force", self.normal_force, FORCE)
        )
        if _rubs(values, c.name):
            yield "loss", self.loss, POWER
            if belt:
                yield "slip margin", self.slip_margin, ()

    def geometry(self) -> Iterator[Fact]:
        """The size of the force, and the sliding speed, in the same way."""
        if self._values.whole.couplings[self._index].steps and self._values.has_forces:
            yield "force", np.linalg.norm(self.force, axis=-1), FORCE
            yield "sliding speed", np.linalg.norm(self.sliding, axis=-1), (1, 0, -1)

    @property
    def effort(self) -> Array:
        """The multiplier m ``(...)``: the coupling exerts the effort ``c_i m`` in freedom i, + on link b.

        Its power ``m sum_i c_i q'_i`` is zero.
        """
        return self._values.multiplier(self._index)

    @property
    def force(self) -> Array:
        """The force ``(..., 3)`` of gears, racks and belts on the second one, global directions; minus that acts on the first.

        Raises
        ------
        DeclarationError
            for a coupling that acts in freedoms alone.
        """
        return self._values.contact(self._index)[0]

    @property
    def point(self) -> Array:
        """The point ``(..., 3)`` at which it acts."""
        return self._values.contact(self._index)[1]

    @property
    def normal_force(self) -> Array:
        """Size ``(...)`` of the normal force between teeth, preload included."""
        found = self._values.at_places("normals", self._name)
        return found[..., 0] if found.shape[-1] else self._values.pressing(self._index)

    @property
    def loss(self) -> Array:
        """Power ``(...)`` lost by friction between teeth; zero without."""
        return losses(self._values).get(self._name, np.zeros(self._values.batch))

    @property
    def slip_margin(self) -> Array:
        """Of a flat belt with ``mg.Friction``: ``e^(mu wrap)`` over the ratio of the strands, less one ``(...)``: negative where it slips.

        The strands of an ``mg.Belt``: its force and nothing, and ``preload`` more in each; on the pulley with the smaller wrap.
        """
        values, c = self._values, self._values.whole.couplings[self._index]
        if not isinstance(c, Belt):
            raise DeclarationError(f"coupling {c.name!r}", ["is no belt, which alone has a slip_margin"])
        load, force = friction_of(values, c.name), np.linalg.norm(self.force, axis=-1)
        return margin_to_slip(load, c.wrap_in(values.whole), force, np.zeros_like(force))

    @property
    def moment(self) -> Array:
        """Moment ``(..., 3)`` of friction between teeth on the second gear about ``point``, global directions; zero without."""
        return self._values.contact(self._index)[2]

    @property
    def _name(self) -> str:
        return self._values.whole.couplings[self._index].name

    @property
    def sliding(self) -> Array:
        """Velocity ``(..., 3)`` of the second of two gears relative to the first where they touch: zero for gears that roll on each other.

        Of a belt it is the difference of the velocities that both pulleys have there, though they are apart.
        """
        m, point = self._values.whole, self.point
        coupling = m.couplings[self._index]
        Va, Vb = (self._values.link(m.place_of_link(name))[1] for name in coupling.gears(m))
        return np.asarray(Vb[..., 3:] - Va[..., 3:] + np.cross(Vb[..., :3] - Va[..., :3], point))


class FlanksResult(CouplingResult):
    """Values of a mesh with backlash whose axes move: sums over the rows of its flanks, of which one at most presses, but for a jam."""

    def __init__(self, values: Trajectory, index: int, behind: int) -> None:
        super().__init__(values, index)
        self._rows = CouplingResult(values, index), CouplingResult(values, behind)

    def _sum(self, name: str) -> Array:
        return np.asarray(sum(getattr(one, name) for one in self._rows))

    effort = property(lambda self: self._sum("effort"), doc=CouplingResult.effort.__doc__)
    force = property(lambda self: self._sum("force"), doc=CouplingResult.force.__doc__)
    normal_force = property(lambda self: self._sum("normal_force"), doc=CouplingResult.normal_force.__doc__)
    loss = property(lambda self: self._sum("loss"), doc=CouplingResult.loss.__doc__)
    moment = property(lambda self: self._sum("moment"), doc=CouplingResult.moment.__doc__)

    @property
    def point(self) -> Array:
        """The point ``(..., 3)`` at which it acts."""
        first, other = self._rows
        behind = other.normal_force > first.normal_force
        return np.where(behind[..., None], other.point, first.point)


def losses(values: Trajectory) -> dict[str, Array]:
    """Power lost in what rubs, by name, ``(...)``."""
    dry = {i: load.of for i, load in enumerate(values.loads) if isinstance(load, Friction)}
    return {name: -values.load(i).power for i, name in dry.items() if name in values.rubbing}


def friction_of(values: Trajectory, name: str) -> Friction:
    """The friction that is declared of a pair or coupling, its numbers one a position ``(...)`` where they vary."""
    load = next((load for load in values.loads if isinstance(load, Friction) and load.of == name), None)
    if load is None:
        why = f"{name}: no friction is declared of it; mg.Friction({name!r}, mu=)"
        raise DeclarationError(f"solution of {values.mechanism.name!r}", [why])
    return load.with_numbers(values.number)


def margin_to_slip(load: Friction, wrap: Array | float, one: Array, other: Array) -> Array:
    """``e^(mu wrap) T2 / T1 - 1`` of strands with tensions ``T1 >= T2``."""
    strands = np.stack([one, other]) + load.preload
    with np.errstate(invalid="ignore", divide="ignore"):
        return (
            np.exp(load.coefficient_at_rest * (wrap if load.wrap is None else load.wrap))
            * strands.min(axis=0)
            / strands.max(axis=0)
            - 1.0
        )


class BeltResult(Shown):
    """Tensions, spans and wraps of a belt."""

    def __init__(self, values: Trajectory, name: str) -> None:
        self._values, self._name = values, name
        own = [(k, c) for k, c in enumerate(values.whole.couplings) if isinstance(c, BeltDrive) and c.belt == name]
        rows = {c.span_names[c.span or 0]: k for k, c in own}
        self._belt = own[0][1]
        self._spans = {name: rows.get(name) for name in self._belt.span_names}

    def document(self) -> Document:
        """Ranges of the values over the positions, and where they are reached."""
        m = self._values.mechanism
        text = f"Over {', '.join(self._belt.over)}; {_solved(PositionLabels(self._values))}."
        table = _fact_ranges(self._values, (*self.geometry(), *self.forces()))
        return Document(f"Belt {self._name} of {m.name}", (Paragraph(text), table))

    def forces(self) -> Iterator[Fact]:
        """Tensions, and where it rubs the margins to slip, as columns of tables."""
        if self._values.has_forces:
            yield from ((f"tension {name}", of, FORCE) for name, of in self.tension.items())
            if _rubs(self._values, self._name):
                yield from ((f"slip margin {name}", of, ()) for name, of in self.slip_margin.items())

    def geometry(self) -> Iterator[Fact]:
        """Lengths of the spans, and angles of wrap, in the same way."""
        yield from ((f"span {name}", of, LENGTH) for name, of in self.span.items())
        yield from ((f"wrap {name}", of, ()) for name, of in self.wrap.items())

    @cached_property
    def _course(self) -> BeltCourse:
        m = self._values.whole
        links = [m.place_of_link(p.link) for p in self._belt.pulleys(m)]
        return self._belt.course_of(m, [np.moveaxis(self._values.link(k)[0].reshape(-1, 4, 4), 0, 2) for k in links])

    def _of_spans(self, values: Iterable[Array], *shape: int) -> dict[str, Array]:
        """Values ``(n, positions, *shape)`` by the spans, ``(..., *shape)`` each."""
        return self._by_name("span", zip(self._spans, values, strict=True), *shape)

    def _by_name(self, what: str, values: Iterable[tuple[str, Array]], *shape: int) -> dict[str, Array]:
        batch = self._values.batch
        return ByName(f"belt {self._name!r}", what, ((name, one.reshape((*batch, *shape))) for name, one in values))

    @property
    def tension(self) -> dict[str, Array]:
        """Tension of every span ``(...)``, ``"p1-p2"``: minus the multiplier of its row, NaN where it is not unique; zero of a
        slack one.
        """
        loose = np.zeros(self._values.batch)
        return self._of_spans(loose if k is None else -self._values.multiplier(k) for k in self._spans.values())

    @property
    def span(self) -> dict[str, Array]:
        """Length of every span ``(...)``."""
        return self._of_spans(self._course.spans.length)

    @property
    def wrap(self) -> dict[str, Array]:
        """Angle of wrap on every pulley ``(...)`` [rad]."""
        return self._by_name("pulley", zip(self._belt.over, self._course.wrap, strict=True))

    @property
    def length(self) -> Array:
        """Length of the whole belt ``(...)``."""
        return self._course.length.reshape(self._values.batch)

    @property
    def ends(self) -> dict[str, Array]:
        """Where every span leaves a pulley and where it runs onto the next, ``(..., 2, 3)``, global."""
        both = np.stack([self._course.spans.start, self._course.spans.end])
        return self._of_spans(np.moveaxis(both, (2, 3), (0, 1)), 2, 3)

    @property
    def friction(self) -> dict[str, Array]:
        """Friction coefficient that the belt needs on every pulley ``(...)`` to not slip, ``|ln(T1 / T2)| / wrap`` (Euler, Eytelwein).

        Infinite where a strand is slack. Centrifugal force is left out; teeth do without it.
        """
        T = np.array(list(self.tension.values()))
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.roll(T, 1, axis=0) / T
            needed = np.abs(np.log(np.where(ratio > 0.0, ratio, np.nan)))
            needed = np.where((ratio <= 0.0) | (np.minimum(T, np.roll(T, 1, axis=0)) < 0.0), np.inf, needed)
            needed = needed.reshape(len(needed), -1) / self._course.wrap
        return self._by_name("pulley", zip(self._belt.over, needed, strict=True))

    @property
    def slip_margin(self) -> dict[str, Array]:
        """On every pulley ``e^(mu wrap)`` over the ratio of the strands, less one ``(...)``; negative where it slips."""
        load, T = friction_of(self._values, self._name), np.array(list(self.tension.values()))
        both = zip(self._belt.over, np.roll(T, 1, axis=0), T, strict=True)
        return {name: margin_to_slip(load, self.wrap[name], one, other) for name, one, other in both}


def _rubs(values: Trajectory, name: str) -> bool:
    """Whether friction is declared of what has that name."""
    return any(isinstance(load, Friction) and load.of == name for load in values.loads)


def forces_of_couplings(values: Trajectory) -> Iterator[Fact]:
    """What acts in all couplings along lines, by names such as ``g normal force``, ``belt tension p1-p2``."""
    for name, of in couplings_of(values).items():
        yield from ((f"{name} {fact}", value, dimension) for fact, value, dimension in of.forces())


def geometry_of_couplings(values: Trajectory) -> Iterator[Fact]:
    """Of gears force and sliding speed, of belts spans and wraps, by the same names."""
    for name, of in couplings_of(values).items():
        yield from ((f"{name} {fact}", value, dimension) for fact, value, dimension in of.geometry())


def couplings_of(values: Trajectory) -> dict[str, CouplingResult | BeltResult]:
    """What is told of every coupling, of a belt and of both flanks of teeth as a whole, by name."""
    found: dict[str, CouplingResult | BeltResult] = {}
    places = {c.name: k for k, c in enumerate(values.whole.couplings)}
    parting = [c.name for c in values.whole.couplings if isinstance(c, Mesh) and c.play]
    behind = {places[other]: name for name in parting if (other := behind_of(name)) in parting}
    for name, k in places.items():
        c = values.whole.couplings[k]
        if isinstance(c, BeltDrive):
            found.setdefault(c.belt, BeltResult(values, c.belt))
        elif k in behind:
            found[behind[k]] = FlanksResult(values, places[behind[k]], k)
        else:
            found[name] = CouplingResult(values, k)
    return found


class LinkResult(Shown):
    """Motion of one link in the global frame."""

    def __init__(self, values: Trajectory, index: int) -> None:
        self._values, self._index = values, index

    def document(self) -> Document:
        """Ranges of the values over the positions, and where they are reached."""
        return link_document(self._values, self._index)

    @property
    def pose(self) -> Array:
        """Pose of the link's frame, ``(..., 4, 4)``."""
        return self._values.link(self._index)[0]

    @property
    def twist(self) -> Array:
        """Twist ``(..., 6)``, (w, v) with v of the body point at the global origin."""
        return self._values.link(self._index)[1]

    @property
    def acceleration(self) -> Array:
        """dV/dt of the twist about the global origin, ``(..., 6)``."""
        return self._values.link(self._index)[2]

    @property
    def displacement(self) -> Array:
        """Small twist ``(..., 6)``, (turn, motion of the body point at the global origin), by what pairs with ``stiffness`` and ``misfit``
        give way; drives, passive freedoms, teeth and links are rigid.

        NaN for what pairs that carry nothing leave open, or where deflections contradict each other: pass ``redundant="elastic"``.
        """
        pairs = enumerate(self._values.whole.pairs)
        moved = {f"{p.name}.{c}": of for k, p in pairs for c, of in deflections(self._values, k).items()}
        return self._values.displacement(self._index, moved)

    @property
    def hold(self) -> Array:
        """Wrench ``(..., 6)`` about the global origin that keeps a passive body from spinning; zero for all other links."""
        return self._values.link_hold(self._index)

    @property
    def angular_velocity(self) -> Array:
        """Angular velocity ``(..., 3)``."""
        return self.twist[..., :3]

    @property
    def angular_acceleration(self) -> Array:
        """Angular acceleration ``(..., 3)``."""
        return self.acceleration[..., :3]

    def point(self, p: Any) -> MaterialPoint:
        """Position, velocity and acceleration of the material point ``p``, given in the link's frame."""
        if self._values.mechanism.planar and is_numeric(p, (2,)):
            p = (*p, 0.0)
        fault = vector_fault(p, "point")
        if fault:
            raise DeclarationError(f"link {self._values.mechanism.links[self._index].name!r}", [fault])
        return self._values.link_point(self._index, p)

    def at(self, name: str) -> MaterialPoint:
        """Position, velocity and acceleration of a named point, ``Link(points={name: (x, y, z)})``."""
        link = self._values.mechanism.links[self._index]
        return self._values.link_point(self._index, link.point(name))

    @property
    def units(self) -> dict[str, Any]:
        """Units of the properties in the declared units; of twists angular part first."""
        return link_units(self._values.mechanism.units)

    def _center(self) -> MaterialPoint:
        link = self._values.mechanism.links[self._index]
        if link.center is None:
            raise DeclarationError(f"link {link.name!r}", ["has no mass center; declare center=, or use point(p)"])
        return self._values.link_point(self._index, None)

    @property
    def center(self) -> Array:
        """Mass center ``(..., 3)``."""
        return self._center().position

    @property
    def center_velocity(self) -> Array:
        """Velocity of the mass center ``(..., 3)``."""
        return self._center().velocity

    @property
    def center_acceleration(self) -> Array:
        """Acceleration of the mass center ``(..., 3)``."""
        return self._center().acceleration


def link_units(units: Mapping[str, str]) -> dict[str, Any]:
    """Units of what a solution says of a link; of twists angular part first."""
    length, speed, rate = (unit_of(units, (1, 0, -n)) for n in range(3))
    angular = tuple(unit_of(units, (0, 0, -n)) for n in range(3))
    force, moment = (unit_of(units, (power, 1, -2)) for power in (1, 2))
    return {
        "pose": length,
        "twist": (angular[1],) * 3 + (speed,) * 3,
        "acceleration": (angular[2],) * 3 + (rate,) * 3,
        "center": length,
        "center_velocity": speed,
        "center_acceleration": rate,
        "angular_velocity": angular[1],
        "angular_acceleration": angular[2],
        "hold": (moment,) * 3 + (force,) * 3,
        "displacement": (angular[0],) * 3 + (length,) * 3,
    }
