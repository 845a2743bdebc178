"""Meshes between gears: what fits, the relation of every kind of axes, and how it stands in a mechanism (see ``model.gears``)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from math import atan, cos, pi, sin, tan
from typing import Annotated, Any, ClassVar, Self

import numpy as np

from mechgraph.fields import (
    NUMBER,
    TEXT,
)
from mechgraph.maths.se3 import Array, cross, identity
from mechgraph.memo import dataclass
from mechgraph.model.couplings import (
    OF_TEETH,
    MeshStep,
    fitting_of,
    followed,
    meeting,
    plain_pairs,
    way,
)
from mechgraph.model.gears import (
    CROSSING,
    CYLINDRICAL,
    RACKED,
    Gear,
    GearRack,
    LineCoupling,
    LinePlaces,
    LinesAt,
    LinkPlace,
    Relation,
    Worm,
    angle,
    dot,
    feet,
    gear_faults,
    gears_by_name,
    involute,
    pose_along,
    tip_radius,
)
from mechgraph.model.pair import are_placed
from mechgraph.quantities import LENGTH, shown, unknown

FLANKS = ("auto", "forward", "backward")


class Meshing(LineCoupling):
    """What meshes and the short forms of couplings share: two gears, or pulleys, where they meet.

    The multiplier is the normal force, the relation one of freedoms where both turn on pairs R about their axes, on one carrier.
    """

    rubs: ClassVar[tuple[str, ...]] = OF_TEETH
    held: ClassVar[tuple[bool, bool]] = (False, False)
    """Which gears must not slide along their axes."""
    sized: ClassVar[bool] = True
    """Whether the sizes of its teeth are known."""
    flank: str = "auto"
    play: str = ""
    backlash: float = 0.0
    reach: float = float("inf")
    """The distance of parallel axes from which on teeth do not reach each other, over that at the start."""

    @abstractmethod
    def _met(self, m: Any) -> Meeting:
        """Both gears where they meet in a mechanism without faults."""

    @abstractmethod
    def _steps(self, m: Any) -> tuple[tuple[MeshStep, ...], bool]:
        """The pairs on the way from a to b, and whether all of them are R or P."""

    def seen(self, m: Any) -> Meeting:
        """Both gears where they meet."""
        met: Meeting = m.once(type(self)._met, self)
        return met

    def placed(self, m: Any) -> Self:
        """See ``BaseCoupling``."""
        steps, plain = self._steps(m)
        if not m.has_geometry:
            return self._put(m, steps, self._sketched(m, steps) if plain else None)
        met = self.seen(m)
        ends, coefficients = (met.one.place, met.two.place), None
        if plain:
            coefficients = self._coefficients(m, steps)
        both = self.flank == "auto" or (bool(self.play) and coefficients is not None)
        flanks = met.flanks(both or self.flank == "forward")
        if coefficients is not None and self.play:
            coefficients[m.full_name(self.play)] = -1.0
        known = {
            "ends": ends,
            "numbers": met.numbers,
            "relation": flanks[0],
            "period": met.period,
            "held": met.held,
            "other": flanks[1] if both else flanks[0],
            "turning": tuple(not isinstance(gear, GearRack) for gear in (met.one, met.two)),
            "reach": met.reach if self.sized else float("inf"),
        }
        return self._put(m, steps, coefficients, **known)

    def _sketched(self, m: Any, steps: tuple[MeshStep, ...]) -> dict[str, float]:
        """Coefficients by freedom without geometry."""
        return {name: 1.0 for step in steps for name in m.pairs[step.pair].freedom_names}

    def _about(self, m: Any, steps: tuple[MeshStep, ...]) -> tuple[list[float], list[float], float]:
        """The senses of the pairs on the way about either gear, see ``about_ends``."""
        met = self.seen(m)
        return about_ends(
            m, steps, (met.one.place, met.two.place), [isinstance(g, GearRack) for g in (met.one, met.two)]
        )

    def _coefficients(self, m: Any, steps: tuple[MeshStep, ...]) -> dict[str, float] | None:
        """Coefficients by freedom where every pair on the way turns about the axis of one of the gears, or slides along a rack."""
        forward, backward, _ = self._about(m, steps)
        if len(forward) + len(backward) < len(steps):
            return None
        met = self.seen(m)
        first, other = met.powers(self.flank != "backward")
        other = float(np.copysign(first * met.ratio, other))
        signs = [*((s, first) for s in forward), *((s, other) for s in reversed(backward))]
        return {
            m.pairs[step.pair].freedom_names[0]: step.sense * sign * power
            for step, (sign, power) in zip(steps, signs, strict=True)
        }

    @property
    def keeps(self) -> str:  # type: ignore[override]
        """See ``LineCoupling``."""
        if self.relation in CROSSING.values():
            return "axes that keep their places: hold the shaft in bearings, with its gear on their axis"
        if self._racked:
            return "a rack that slides at right angles to the axis of its pinion"
        return super().keeps.replace(":", ", where teeth reach each other:")

    @property
    def _racked(self) -> bool:
        return self.relation in RACKED.values()

    def strayed(self, a: LinePlaces, b: LinePlaces, a0: LinePlaces, b0: LinePlaces) -> tuple[Array, Array]:
        """See ``LineCoupling``: of axes that cross their angle, their distance and where they are along them."""
        if self._racked:
            pinion, rack = (a, b) if self.turning[0] else (b, a)
            off = np.hypot(dot(pinion.axis, rack.axis), dot(pinion.axis, rack.mark))
            return off, 0.0 * off
        if self.relation not in CROSSING.values():
            leans, _ = super().strayed(a, b, a0, b0)
            now, then = (np.sqrt((cross(q.point - p.point, p.axis) ** 2).sum(axis=0)) for p, q in ((a, b), (a0, b0)))
            return leans, np.where(now > self.reach * then, now - then, 0.0)
        places = []
        for p, q in ((a, b), (a0, b0)):
            foot_a, foot_b, w = feet(p, q)
            apart = dot(q.point - p.point, w)
            places.append((dot(p.axis, q.axis), apart, dot(foot_a - p.point, p.axis), dot(foot_b - q.point, q.axis)))
        lean, *found = [now - then for now, then, held in zip(*places, (True, True, *self.held), strict=True) if held]
        return np.abs(lean), np.abs(found).max(axis=0)


def about_ends(
    m: Any, steps: tuple[MeshStep, ...], ends: tuple[LinkPlace, LinkPlace], racks: Sequence[bool]
) -> tuple[list[float], list[float], float]:
    """The senses of the pairs of a way that turn about the axis of its first place (slide along it, of a rack), and of those that do so
    about its last one, this one first; by how much the next one is off the first axis.
    """
    axes = [(np.asarray(end.point, dtype=float), np.asarray(end.axis)) for end in ends]
    motions = ["slide" if rack else "turn" for rack in racks]
    _, _, forward, off = followed(m, steps, *axes[0], fitting_of(m), motions[0])
    back = tuple(MeshStep(step.pair, -step.sense) for step in reversed(steps[len(forward) :]))
    return forward, followed(m, back, *axes[1], fitting_of(m), motions[1])[2], off


@dataclass(frozen=True)
class Mesh(Meshing):
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
    >>> mg.solve(m, {"p": 0.0}, loads=[mg.Effort("w", -3.0)]).coupling("m").force[:2].round(3)
    array([ 27.298, -75.   ])
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
            'which flanks touch: `"forward"`: those by which a positive turn of gear a (with a rack, of the pinion) drives gear b; '
            '`"backward"`: the others; `"auto"` as the load asks where centers stand still, else those that press at the first position '
            "with a load, without forces those forward",
            choices=FLANKS,
        ),
    ] = "auto"
    restitution: Annotated[float, NUMBER("with which flanks strike each other, in time", minimum=0.0)] = 0.0
    play: Annotated[
        str,
        TEXT(
            "a slide that counts by how much the flanks have parted; `respond` adds it where there is backlash",
            default="none",
        ),
    ] = ""

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
        names = {side: getattr(self, side) for side in "ab"}
        found += [
            f"{side}: {unknown('gear', q, known)}" for side, q in names.items() if isinstance(q, str) and q not in known
        ]
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
                if self.play and not found:
                    found += [fault] if (fault := m.freedom_fault(self.play, single=True)) else []
        return [where + fault for fault in found]

    @classmethod
    def doubts(cls, m: Any) -> list[str]:
        """Planets between the same two gears that cannot be put in, or overlap, at the declared places.

        The value of a mesh with the first gear less that with the second one leaves the turn of the planet out; modulo the base pitch it is
        the same for all that fit.
        """
        meshes = [c for c in m.couplings if isinstance(c, Mesh)]
        of_gear: dict[str, list[Mesh]] = {}
        for c in meshes:
            for name in (c.a, c.b):
                of_gear.setdefault(name, []).append(c)
        groups: dict[tuple[str, str], list[tuple[str, float, Gear]]] = {}
        period = {}
        for name, own in of_gear.items():
            if len(own) != 2 or not any(getattr(g, "internal", False) for c in own for g in c.pair_of(m)):
                continue
            met = [c.seen(m) for c in own]
            if not all(isinstance(one, Parallel) for one in met):
                continue
            values, mates = [], []
            for c, one in zip(own, met, strict=True):
                value = float(one.line().value[0, 0])
                values.append(value * np.sign(one.one.base_radius))
                mates.append(c.b if c.a == name else c.a)
            order = np.argsort(mates)
            key = mates[order[0]], mates[order[1]]
            gear = next(g for g in (met[0].one, met[0].two) if g.name == name)
            groups.setdefault(key, []).append((name, values[order[0]] - values[order[1]], gear))
            period[key] = met[0].period
        return [fault for key, planets in groups.items() for fault in _group_faults(m, key, planets, period[key])]

    def _met(self, m: Any) -> Meeting:
        """See ``Meshing``."""
        one, two = self.pair_of(m)
        return met_at(one, two, pose_along(m, self._steps(m)[0]))

    def _steps(self, m: Any) -> tuple[tuple[MeshStep, ...], bool]:
        """The pairs on the way from a to b, and whether all of them are R or P."""
        one, two = self.pair_of(m)
        plain = way(m, m.once(plain_pairs), one.link, two.link)
        if plain is not None:
            return plain, True
        found = way(m, m.once(meeting), one.link, two.link)
        assert found is not None
        return found, False


def _reached(m: Any) -> set[str]:
    """The links that pairs connect to the frame."""
    out, queue = {m.frame}, [m.frame]
    for link in queue:
        ahead = {other for _, other in m.once(meeting).get(link, ())} - out
        out |= ahead
        queue += sorted(ahead)
    return out


def _placed_soundly(m: Any) -> bool:
    """Whether all pairs and gears are sound and hang together, so that places can be looked at."""
    known = set(m.link_names())
    links = all(g.link in known for g in m.gears) and all(p.a in known and p.b in known for p in m.pairs)
    sound = links and m.once(are_placed) and not m.once(gear_faults)
    return sound and all(gear.link in m.once(_reached) for gear in m.gears)


class Meeting(ABC):
    """Two gears where they meet, in the frame of the link of the first."""

    numbers: tuple[float, ...] = ()
    period: float = np.inf
    held: tuple[bool, bool] = (False, False)
    reach: float = np.inf

    def __init__(self, one: Any, two: Any, a: LinePlaces, b: LinePlaces) -> None:
        self.one, self.two, self.a, self.b = one, two, a, b
        self.faults = list(self._unlike())

    def _unlike(self) -> Iterator[str]:
        """Why their teeth do not fit each other."""
        return iter(())

    relations: Mapping[float, Relation]
    """Those of both flanks, 1 and -1."""

    def flanks(self, forward: bool) -> tuple[Relation, Relation]:
        """The relation of the flank that is asked for, and that of the other one."""
        side = 1.0 if forward else -1.0
        return self.relations[side], self.relations[-side]

    def line(self, forward: bool = True) -> LinesAt:
        """Along which that flank pushes at the declared places."""
        return self.flanks(forward)[0](self.a, self.b, np.array(self.numbers)[:, None, None])

    def powers(self, forward: bool) -> tuple[float, float]:
        """Powers of a unit force along the line of a flank at unit rates of both gears."""
        (P, n), out = (part[:, 0, 0] for part in self.line(forward)[1:]), []
        for place, gear in ((self.a, self.one), (self.b, self.two)):
            z, p = place.axis[:, 0, 0], place.point[:, 0, 0]
            out.append(float(n @ (z if isinstance(gear, GearRack) else cross(z, P - p))))
        return out[0], out[1]

    def misfits(self, fitting: float) -> list[str]:
        """What is wrong with the gears and their places, and what would fit."""
        return self.faults

    @property
    def ratio(self) -> float:
        """By what the motion of a is greater than that of b."""
        return float(self.two.teeth / self.one.teeth)

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
        return float(dot(self.a.axis, self.b.axis)[0, 0])


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

    relations = CYLINDRICAL

    def __init__(self, one: Any, two: Any, a: LinePlaces, b: LinePlaces) -> None:
        super().__init__(one, two, a, b)
        self.k = one.base_radius + two.base_radius
        d = b.point - a.point
        self.h = float(dot(d, a.axis)[0, 0])
        across = d - a.axis * self.h
        self.distance = float(np.sqrt(dot(across, across))[0, 0])
        self.numbers = (one.base_radius, two.base_radius, one.base_radius * one.base_lean, *_halves(one, two))
        self.period = one.base_pitch
        if not (one.internal or two.internal):
            self.reach = (tip_radius(one) + tip_radius(two)) / self.distance

    def powers(self, forward: bool) -> tuple[float, float]:
        """See ``Meeting``: the base radii times the cosine of the lean of the line."""
        ka, kb, straight = self.one.base_radius, self.two.base_radius, cos(atan(self.one.base_lean))
        return abs(ka) * straight, -np.sign(ka) * kb * straight * np.sign(self._ways())

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


class WithRack(Meeting):
    """A gear and a rack."""

    def __init__(self, one: Any, two: Any, a: LinePlaces, b: LinePlaces) -> None:
        super().__init__(one, two, a, b)
        self.sign = -1.0 if isinstance(one, GearRack) else 1.0
        self.pinion, self.rack = (one, two) if self.sign > 0 else (two, one)
        self.at, self.there = (a, b) if self.sign > 0 else (b, a)
        self.relations = {side: RACKED[side, self.sign] for side in (1.0, -1.0)}
        base = self.pinion.base_radius
        halves = _halves(one, two)[:: int(self.sign)]
        self.numbers = (base, self.pinion.radius, base * self.pinion.base_lean, *halves)
        self.period = self.pinion.base_pitch

    @property
    def ratio(self) -> float:
        """See ``Meeting``: of a turn and a slide."""
        return float(self.pinion.radius**-self.sign)

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
        if max(abs(float(dot(z, v)[0, 0])) for v in (self.there.axis, self.there.mark)) > fitting:
            found.append(
                f"direction and normal of {rack.name!r} are not at right angles to the axis of {pinion.name!r}"
            )
        if abs(float(np.dot(rack.place.axis, np.asarray(rack.normal) / np.linalg.norm(rack.normal)))) > fitting:
            found.append(f"direction and normal of {rack.name!r} are not at right angles to each other")
        if found:
            return found
        distance = -float(dot(d, self.there.mark)[0, 0])
        wanted = pinion.radius + pinion.module * pinion.shift
        if distance < wanted - 2.0 * fitting * wanted or distance > wanted + 2.0 * pinion.module:
            found.append(
                f"the pitch line of {rack.name!r} is {distance:.7g} from the axis of {pinion.name!r}, against its normal; expected "
                f"{wanted:.7g}"
            )
        return [*found, *_apart(pinion, rack, float(dot(d, z)[0, 0]))]


def teeth_lines(P: Array, away: Array, trace: Array, pressure_angle: float) -> tuple[Array, Array, Array]:
    """A pitch point and the normals of both flanks there ``(3,)``, at the pressure angle to the pitch plane, across the ``trace`` of teeth.

    ``away``: from gear a to gear b, at right angles to the pitch plane.
    """
    over = np.cross(away, trace)
    over, out = cos(pressure_angle) * over / np.linalg.norm(over), sin(pressure_angle) * away
    return P, out + over, out - over


class Still(Meeting):
    """Axes that keep their places: the line stands still between them."""

    relations = CROSSING

    def __init__(self, one: Any, two: Any, a: LinePlaces, b: LinePlaces) -> None:
        super().__init__(one, two, a, b)
        self.za, self.zb, self.pa, self.pb = (v[:, 0, 0] for v in (a.axis, b.axis, a.point, b.point))
        n = cross(self.za, self.zb)
        if n.any():
            self.feet = [v[:, 0, 0] for v in feet(a, b)]
        if not self.faults and not self.misfits(1e-3):
            self._lay(*self.lines())

    @property
    def apart(self) -> float:
        """How far axis b passes axis a, along the direction across both."""
        return float((self.pb - self.pa) @ self.feet[2])

    @abstractmethod
    def lines(self) -> tuple[Array, Array, Array]:
        """A point and the directions ``(3,)`` of the force on b, for both flanks."""

    def _lay(self, P: Array, *push: Array) -> None:
        foot, _, w = self.feet
        frame = np.stack([self.za, w, np.cross(self.za, w)])
        powers = [float(v @ np.cross(self.za, P - foot)) for v in push]
        first = int(powers[1] > powers[0])
        both = push[first], -push[1 - first]
        self.numbers = (1.0, *(frame @ (P - foot)), *(frame @ both[0]), *(frame @ both[1]))
        self.period = abs(powers[first]) * 2 * pi / self.one.teeth


class Crossed(Still):
    """Helical gears on axes that cross (screw gears)."""

    def _laid(self) -> tuple[Array, Array, float]:
        """From axis a to axis b, the teeth of a where they touch, and the helix angle of b that fits these."""
        away = self.feet[2] * (1.0 if self.apart >= 0 else -1.0)
        trace = cos(self.one.helix_angle) * self.za + sin(self.one.helix_angle) * np.cross(self.za, away)
        x, y = float(trace @ self.zb), float(trace @ np.cross(self.zb, -away))
        return away, trace, atan(y / x) if x else pi / 2

    def misfits(self, fitting: float) -> list[str]:
        """See ``Meeting``."""
        one, two = self.one, self.two
        if one.internal or two.internal:
            return ["gears on crossing axes have their teeth outside"]
        found = list(self._base_pitches(fitting))
        helix, distance = self._laid()[2], abs(self.apart)
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

    def lines(self) -> tuple[Array, Array, Array]:
        """See ``Still``."""
        away, trace, _ = self._laid()
        P = self.feet[0] + away * (self.one.radius + self.one.module * self.one.shift)
        return teeth_lines(P, away, trace, self.one.pressure_angle)


def _cylinders(one: Any, two: Any, a: LinePlaces, b: LinePlaces) -> Meeting:
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

    def _unlike(self) -> Iterator[str]:
        one, two = self.one, self.two
        for name, wanted in (
            ("module", one.module),
            ("pressure_angle", one.pressure_angle),
            ("spiral_angle", -one.spiral_angle),
        ):
            if abs(getattr(two, name) - wanted) > 1e-9 * (1.0 + abs(wanted)):
                yield f"{two.name!r} has {name} = {getattr(two, name):.7g}; at {one.name!r} {wanted:.7g} meshes"

    @property
    def towards(self) -> tuple[Array, Array]:
        """The axes from the apex towards both gears."""
        sides = ((self.pa, self.za), (self.pb, self.zb))
        ea, eb = (z * np.sign((p - self.feet[0]) @ z) for p, z in sides)
        return ea, eb

    @property
    def cones(self) -> tuple[float, float]:
        """Half the angles of both pitch cones."""
        ea, eb = self.towards
        shaft = float(np.arccos(np.clip(ea @ eb, -1.0, 1.0)))
        first = float(np.arctan2(sin(shaft), self.two.teeth / self.one.teeth + cos(shaft)))
        return first, shaft - first

    def misfits(self, fitting: float) -> list[str]:
        """See ``Meeting``."""
        one, two = self.one, self.two
        if self.faults:
            return self.faults
        if np.abs(cross(self.za, self.zb)).max() < 1e-3:
            return ["the axes are parallel; bevel gears are on axes that intersect"]
        away = [float(np.abs(p - self.feet[0]).max()) for p in (self.pa, self.pb)]
        if abs(self.apart) > fitting * max(*away, one.module):
            return [f"the axes pass each other at {abs(self.apart):.4g}; bevel gears are on axes that intersect"]
        out = [
            f"the point of {gear.name!r} is where the axes intersect; give one on the side of the apex on which the gear stands"
            for gear, far in zip((one, two), away, strict=True)
            if far <= fitting * one.module
        ]
        for gear, cone in zip((one, two), self.cones if not out else (), strict=not out):
            if gear.cone is not None and abs(gear.cone - cone) > fitting:
                out.append(f"{gear.name!r} has the cone {gear.cone:.7g}; its teeth and axes ask for {cone:.7g}")
        return out

    def lines(self) -> tuple[Array, Array, Array]:
        """See ``Still``."""
        (ea, eb), (angle, _), spiral = self.towards, self.cones, self.one.spiral_angle
        side = eb - ea * (ea @ eb)
        side = side / np.linalg.norm(side)
        line = cos(angle) * ea + sin(angle) * side
        P = self.feet[0] + line * (self.one.module * self.one.teeth / 2 / sin(angle))
        trace = cos(spiral) * line + sin(spiral) * np.cross(self.za, side) * np.sign(ea @ self.za)
        return teeth_lines(P, cos(angle) * side - sin(angle) * ea, trace, self.one.pressure_angle)


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
    def in_order(self) -> tuple[Any, Any]:
        """The worm and its wheel."""
        return (self.one, self.two) if self._sign > 0 else (self.two, self.one)

    def misfits(self, fitting: float) -> list[str]:
        """See ``Meeting``."""
        cosine, radius = abs(float(self.za @ self.zb)), self.in_order[0].radius
        if cosine > fitting:
            degrees = np.rad2deg(np.arccos(min(cosine, 1.0)))
            return [f"the axes cross at {degrees:.5g} degrees; a worm and its wheel at 90"]
        if abs(self.apart) <= radius:
            return [f"the axes are {abs(self.apart):.7g} apart; expected more than the radius of the worm, {radius:g}"]
        return []

    def lines(self) -> tuple[Array, Array, Array]:
        """See ``Still``."""
        worm, wheel = self.in_order
        z, foot = (self.za, self.feet[0]) if self._sign > 0 else (self.zb, self.feet[1])
        away, r = self.feet[2] * np.sign(self.apart) * self._sign, worm.radius
        t = np.cross(z, away) * (-1.0 if worm.left_hand else 1.0)
        lead = np.arctan2((abs(self.apart) - r) * worm.teeth, wheel.teeth * r)
        P, *push = teeth_lines(foot + r * away, away, cos(lead) * t + sin(lead) * z, worm.pressure_angle)
        return P, self._sign * push[0], self._sign * push[1]


_KINDS: dict[tuple[str, str], Any] = {
    ("gear", "gear"): _cylinders,
    ("gear", "rack"): WithRack,
    ("rack", "gear"): WithRack,
    ("bevel", "bevel"): Bevels,
    ("worm", "worm_wheel"): Worms,
    ("worm_wheel", "worm"): Worms,
}


def met_at(one: Any, two: Any, pose: Array) -> Meeting:
    """Two gears where they meet, the link of the second with a pose in the frame of that of the first."""
    met: Meeting = _KINDS[one.kind, two.kind](one, two, one.place.seen(identity()), two.place.seen(pose))
    return met


def _words_of_kinds(kind: str) -> str:
    return " or ".join(f"a {b}" for a, b in _KINDS if a == kind)


def _group_faults(m: Any, key: tuple[str, str], planets: list[tuple[str, float, Gear]], period: float) -> Iterator[str]:
    """See ``Mesh.doubts``, for the planets between two gears."""
    first, tolerance = planets[0], max(1e-6, 10 * fitting_of(m))
    for name, value, _ in planets[1:]:
        off = (value - first[1]) / period
        if abs(off - round(off)) > tolerance:
            yield (
                f"planets {first[0]!r} and {name!r} between {key[0]!r} and {key[1]!r} cannot both be put in: their teeth are off by "
                f"{abs(off - round(off)):.4g} of a tooth; mg.planet_places gives places that fit"
            )
    for (one, _, gear), (two, _, other) in combinations(planets, 2):
        # planets on one carrier keep their distance
        apart = float(np.linalg.norm(np.subtract(gear.point, other.point)))
        if m.once(_as_assembled) and gear.link != other.link and apart < tip_radius(gear) + tip_radius(other):
            yield f"planets {one!r} and {two!r} overlap: {apart:.6g} apart; expected more than {tip_radius(gear) + tip_radius(other):.6g}"


def _as_assembled(m: Any) -> bool:
    """Whether all places are in one frame."""
    return all(pair.on_a is None for pair in m.pairs)
