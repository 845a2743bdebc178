"""Short forms of meshes and belts: named by the pairs on which gears and pulleys turn, which stand at the points of these.

The relation, with the freedoms ``j`` on the way from gear a to gear b through their carrier, is ``sum_j c_j q_j = constant``, with 1 as
the coefficient of the freedom of a; so the multiplier is what acts in this one, and the force along the line of the flank, or strand, that
its sign asks for, follows (see ``model.gears``).
"""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property, partial
from math import cos
from typing import Annotated, Any, ClassVar

import numpy as np

from mechgraph.fields import FLAG, FREEDOM_NAME, POSITIVE, TEXT, TWO_POSITIVE, TWO_WHOLE, second_direction
from mechgraph.maths.se3 import Array, cross, identity
from mechgraph.memo import dataclass
from mechgraph.model.belts import span
from mechgraph.model.couplings import (
    FULL,
    OF_BELTS,
    PRESSURE,
    MeshStep,
    fitting_of,
    motion_of,
    tooth_angle,
    turning_pairs,
    way,
)
from mechgraph.model.gears import (
    BevelGear,
    Gear,
    GearRack,
    LinePlaces,
    LinesAt,
    LinkPlace,
    Pulley,
    Relation,
    Worm,
    WormWheel,
    dot,
    pose_along,
)
from mechgraph.model.meshes import Meeting, Meshing, about_ends, met_at
from mechgraph.model.pair import are_placed
from mechgraph.quantities import LENGTH, shown, wrong

SHOWN_TEETH = 20
"""Teeth of a pinion of which only the radius is declared."""


@dataclass(frozen=True)
class GearSeats:
    """Where the pairs of a and b sit on the links of both gears, of which that of b has the ``pose (3, 4)`` in the frame of that of a."""

    places: tuple[LinkPlace, LinkPlace]
    pose: Array

    @cached_property
    def seen(self) -> tuple[LinePlaces, LinePlaces]:
        """Both places in the frame of the link of a."""
        return self.places[0].seen(identity()), self.places[1].seen(self.pose)

    @cached_property
    def across(self) -> float:
        """Distance of parallel axes."""
        a, b = self.seen
        return float(np.linalg.norm(cross(b.point - a.point, a.axis)))

    @property
    def beside(self) -> Array:
        """The point of axis a ``(3,)`` in the plane through that of b."""
        a, b = self.seen
        return np.asarray(a.point + a.axis * dot(b.point - a.point, a.axis))[:, 0, 0]


@dataclass(frozen=True)
class ShortForm(Meshing):
    """What they share.

    ``a`` and ``b`` are the freedoms of the two gears on their carrier: pairs R (of a rack P) that share a link, or that pairs R about the
    axis of a or of b connect with it, as a planet on its arm and a sun wheel or a ring on the frame.
    """

    is_force = False
    slides: ClassVar[bool] = False
    """Whether gear b slides, as a rack does."""
    name: Annotated[str, TEXT("name", default="g1, g2, ...")]
    a: Annotated[str, FREEDOM_NAME("pair of the first gear on the carrier")]
    b: Annotated[str, FREEDOM_NAME("pair of the second gear on the carrier")]

    @abstractmethod
    def gears_at(self, seats: GearSeats) -> tuple[Any, Any]:
        """Both gears, or pulleys."""

    def misfits(self, seats: GearSeats, fitting: float) -> list[str]:
        """What is wrong with the places of the gears, which may miss theirs by ``fitting`` of a length, or angle."""
        return self._meeting(seats).misfits(fitting)

    def faults(self, m: Any) -> list[str]:
        """What is wrong with it in a mechanism, one line each."""
        ends = {side: getattr(self, side) for side in "ab"}
        found = [
            *self.value_faults(""),
            *(fault for q in ends.values() if (fault := m.freedom_fault(q, single=True))),
        ]
        for side, q in ends.items() if not found else ():
            pair, wanted = m.pairs[m.freedom(q)[0]], "slide" if side == "b" and self.slides else "turn"
            if motion_of(pair) != wanted:
                found.append(
                    f"{side} = {q!r}: is a pair {pair.type.symbol}; expected one whose only freedom is a {wanted} at its axis"
                )
        if not found:
            steps = self._known_way(m)
            found = [steps] if isinstance(steps, str) else self._places_faults(m, steps) if m.once(are_placed) else []
        return [f"coupling {shown(self.name)}: {fault}" for fault in found]

    def _places_faults(self, m: Any, steps: tuple[MeshStep, ...]) -> list[str]:
        """What is wrong with the pairs on the way, or with the places of the gears."""
        seats = self._seats(m)
        forward, backward, off = self._about(m, steps)
        if len(forward) + len(backward) == len(steps):
            return self.misfits(seats, fitting_of(m))
        return [
            f"pair {m.pairs[steps[len(forward)].pair].name!r} between the gears is not about the axis of {self.a!r} (off by {off:.3g}); "
            f"{self.a!r} and {self.b!r} need a common carrier"
        ]

    def _about(self, m: Any, steps: tuple[MeshStep, ...]) -> tuple[list[float], list[float], float]:
        """See ``Meshing``: as the faults have found it."""
        found: tuple[list[float], list[float], float] = m.once(ShortForm._followed, self)
        return found

    def _followed(self, m: Any) -> tuple[list[float], list[float], float]:
        return about_ends(m, self._steps(m)[0], self._seats(m).places, (False, self.slides))

    def _way(self, m: Any) -> tuple[MeshStep, ...] | str:
        """The pairs from gear a to gear b, or why there is no carrier between them."""
        first, last = (m.freedom(q)[0] for q in (self.a, self.b))
        if first == last:
            return f"a and b are the same freedom {self.a!r}; name those of two gears"
        turning, ends = m.once(turning_pairs), [(m.pairs[k].a, m.pairs[k].b) for k in (first, last)]
        ways = ((a, way(m, turning, a, b, (first, last)), b) for a in ends[0] for b in ends[1])
        known = [(a, steps, b) for a, steps, b in ways if steps is not None]
        if not known:
            return (
                f"{self.a!r} and {self.b!r} have no link in common that could carry both gears, and no pairs R about the axis of one of "
                "them connect them; gears need a common carrier"
            )
        a, steps, b = min(known, key=lambda one: len(one[1]))
        before, behind = (1.0 if m.pairs[first].b == a else -1.0), (1.0 if m.pairs[last].a == b else -1.0)
        return MeshStep(first, before), *steps, MeshStep(last, behind)

    def _steps(self, m: Any) -> tuple[tuple[MeshStep, ...], bool]:
        """See ``Meshing``."""
        steps = self._known_way(m)
        assert not isinstance(steps, str)
        return steps, True

    def _known_way(self, m: Any) -> tuple[MeshStep, ...] | str:
        found: tuple[MeshStep, ...] | str = m.once(ShortForm._way, self)
        return found

    def _seats(self, m: Any) -> GearSeats:
        """Where both pairs sit."""
        found: GearSeats = m.once(ShortForm._seated, self)
        return found

    def _seated(self, m: Any) -> GearSeats:
        steps, places = self._steps(m)[0], []
        for step, behind in ((steps[0], False), (steps[-1], True)):
            pair = m.pairs[step.pair]
            side = int((step.sense > 0) == behind)
            p, z = pair.markers[side].line
            places.append(LinkPlace(pair.b if side else pair.a, tuple(p), tuple(z), second_direction(z)))
        return GearSeats((places[0], places[1]), pose_along(m, steps))

    def _met(self, m: Any) -> Meeting:
        """See ``Meshing``."""
        return self._meeting(self._seats(m))

    def _meeting(self, seats: GearSeats) -> Meeting:
        return met_at(*self.gears_at(seats), seats.pose)

    def placed(self, m: Any) -> Any:
        """See ``Meshing``; by the full names of freedoms."""
        out = super().placed(m)
        vars(out).update({side: m.full_name(getattr(self, side)) for side in "ab"})
        return out

    def _sketched(self, m: Any, steps: tuple[MeshStep, ...]) -> dict[str, float]:
        """See ``Meshing``: the size of the last coefficient is known."""
        found = super()._sketched(m, steps)
        last = m.pairs[steps[-1].pair].freedom_names[0]
        return (
            found
            | {name: steps[0].sense * step.sense for name, step in zip(found, steps, strict=True)}
            | {last: steps[0].sense * steps[-1].sense * self.ratio}
        )

    def _coefficients(self, *of: Any) -> dict[str, float]:
        """See ``Meshing``: over that of a."""
        found = super()._coefficients(*of)
        assert found is not None
        first = next(iter(found.values()))
        return {name: value / first for name, value in found.items()}

    @property
    @abstractmethod
    def ratio(self) -> float:
        """By what the motion of a is greater than that of b."""


_TEETH = TWO_WHOLE("numbers of teeth of both gears")


class _OfTeeth(ShortForm):
    """Two gears with numbers of teeth."""

    teeth: Any

    @property
    def ratio(self) -> float:
        """``N_b / N_a``."""
        return float(self.teeth[1] / self.teeth[0])

    @property
    def names(self) -> tuple[tuple[str, int], tuple[str, int]]:
        """Names and teeth of both gears."""
        return (self.a, int(self.teeth[0])), (self.b, int(self.teeth[1]))


@dataclass(frozen=True)
class SpurGears(_OfTeeth):
    """Declare two spur or helical gears on parallel axes, external or internal.

    The mesh lies in the plane through the point of pair b. Center distance and tooth numbers set the pitch radii; a normal ``module``
    must fit the center distance. The sign of the load selects the loaded flank. Power: ``z_a q'_a = -+ z_b q'_b``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> pairs = [
    ...     mg.Pair(k, "R", "frame", link, point=(x, 0, 0), axis=(0, 0, 1))
    ...     for k, link, x in [("A", "p", 0), ("B", "w", 0.06)]
    ... ]
    >>> m = mg.Mechanism(
    ...     "gears", pairs=pairs, couplings=[mg.SpurGears("g", "A", "B", teeth=(20, 40), module=0.002)], drives=["A"]
    ... )
    >>> s = mg.solve(m, {"A": 0.0}, loads=[mg.Effort("B", -3)])
    >>> s.coupling("g").force.round(3)
    array([ 27.298, -75.   ,   0.   ])
    """

    kind: ClassVar[str] = "spur"
    teeth: Annotated[Any, _TEETH]
    module: Annotated[
        float | None, POSITIVE("normal module", LENGTH, default="what the distance of the axes asks for")
    ] = None
    pressure_angle: Annotated[float, PRESSURE] = FULL
    helix_angle: Annotated[float, tooth_angle("of gear a, right-hand positive")] = 0.0
    internal: Annotated[bool, FLAG("whether the gear with more teeth has them inside")] = False

    def value_faults(self, where: str) -> list[str]:
        """See ``Described``."""
        found = super().value_faults(where)
        if not found and self.internal and self.teeth[0] == self.teeth[1]:
            found.append(wrong(self.teeth, "teeth", "different numbers of an internal pair"))
        return found

    def _module_at(self, distance: float) -> float:
        """The normal module that a distance of the axes asks for."""
        a, b = self.teeth
        return float(2 * distance * cos(self.helix_angle) / (abs(b - a) if self.internal else a + b))

    def misfits(self, seats: GearSeats, fitting: float) -> list[str]:
        """See ``ShortForm``."""
        if np.abs(cross(*(place.axis for place in seats.seen))).max() > fitting:
            return ["the axes are not parallel. Use BevelGears (intersecting) or WormGear (crossed)"]
        distance = seats.across
        if distance == 0.0:
            return ["both gears have the same axis; their axes must be apart"]
        asked = self._module_at(distance)
        if self.module is None or abs(asked - self.module) <= fitting * self.module:
            return []
        return [
            f"the axes are {distance:.7g} apart; {self.teeth[0]:g} and {self.teeth[1]:g} teeth of module {self.module:g} mesh at "
            f"{distance * self.module / asked:.7g} (at {distance:.7g} with module {asked:.7g})"
        ]

    @property
    def rims(self) -> tuple[tuple[str, float, float], ...]:  # type: ignore[override]
        """Freedom, teeth and helix angle, right-hand positive, of both gears."""
        helix = self.helix_angle if self.internal else -self.helix_angle
        return (self.a, self.teeth[0], self.helix_angle), (self.b, self.teeth[1], helix)

    def module_in(self, m: Any) -> float:
        """The normal module, that which the distance of the axes asks for where none is given."""
        return self.seen(m).one.module if self.module is None else float(self.module)

    def gears_at(self, seats: GearSeats) -> tuple[Any, Any]:
        """See ``ShortForm``."""
        module = self._module_at(seats.across)
        out = []
        for place, point, (name, teeth, helix) in zip(
            seats.places, (seats.beside, seats.places[1].point), self.rims, strict=True
        ):
            inner = self.internal and teeth == max(self.teeth)
            more: dict[str, Any] = {
                "module": module,
                "pressure_angle": self.pressure_angle,
                "helix_angle": helix,
                "internal": inner,
            }
            out.append(Gear(name, place.link, int(teeth), point, place.axis, **more))
        return out[0], out[1]


@dataclass(frozen=True)
class BevelGears(_OfTeeth):
    """Declare two bevel gears, straight or spiral, on intersecting axes.

    Each gear is on the side of the apex on which the point of its pair lies. ``module`` is that at the middle of the face, where the
    force acts.

    Examples
    --------
    >>> import mechgraph as mg
    >>> axes = [("A", "p", (0.1, 0, 0), (1, 0, 0)), ("B", "w", (0, 0.1, 0), (0, 1, 0))]
    >>> pairs = [mg.Pair(k, "R", "frame", link, point=p, axis=z) for k, link, p, z in axes]
    >>> m = mg.Mechanism(
    ...     "bevel", pairs=pairs, couplings=[mg.BevelGears("g", "A", "B", teeth=(20, 40), module=0.002)], drives=["A"]
    ... )
    >>> abs(mg.kinematics(m, {"A": 1.0})["B"].position)
    array([0.5])
    """

    kind: ClassVar[str] = "bevel"
    teeth: Annotated[Any, _TEETH]
    module: Annotated[float, POSITIVE("at the middle of the face", LENGTH)]
    pressure_angle: Annotated[float, PRESSURE] = FULL
    spiral_angle: Annotated[float, tooth_angle("of gear a, right-hand positive")] = 0.0

    def gears_at(self, seats: GearSeats) -> tuple[Any, Any]:
        """See ``ShortForm``."""
        hands = self.spiral_angle, -self.spiral_angle
        one, two = (
            BevelGear(name, place.link, teeth, place.point, place.axis, self.module, self.pressure_angle, hand)
            for place, (name, teeth), hand in zip(seats.places, self.names, hands, strict=True)
        )
        return one, two


@dataclass(frozen=True)
class WormGear(_OfTeeth):
    """Declare a worm a and its wheel b on perpendicular crossed axes.

    ``radius`` is that of the pitch cylinder of the worm.

    Examples
    --------
    >>> import mechgraph as mg
    >>> axes = [("A", "worm", (0, 0, 0), (1, 0, 0)), ("B", "wheel", (0, 0.05, 0), (0, 0, 1))]
    >>> pairs = [mg.Pair(k, "R", "frame", link, point=p, axis=z) for k, link, p, z in axes]
    >>> m = mg.Mechanism(
    ...     "worm", pairs=pairs, couplings=[mg.WormGear("g", "A", "B", teeth=(2, 40), radius=0.01)], drives=["A"]
    ... )
    >>> abs(mg.kinematics(m, {"A": 1.0})["B"].position)
    array([0.05])
    """

    kind: ClassVar[str] = "worm"
    teeth: Annotated[Any, TWO_WHOLE("starts of the worm and teeth of the wheel")]
    radius: Annotated[float, POSITIVE("of the pitch cylinder of the worm", LENGTH)]
    pressure_angle: Annotated[float, PRESSURE] = FULL
    left_hand: Annotated[bool, FLAG("whether the thread is left-handed")] = False

    def gears_at(self, seats: GearSeats) -> tuple[Any, Any]:
        """See ``ShortForm``."""
        a, b, (one, starts), (two, teeth) = *seats.places, *self.names
        worm = Worm(one, a.link, starts, a.point, a.axis, self.radius, self.pressure_angle, self.left_hand)
        return worm, WormWheel(two, b.link, teeth, b.point, b.axis)


@dataclass(frozen=True)
class Rack(ShortForm):
    """Declare a pinion a on a revolute pair and a rack b on a prismatic pair.

    The rack is on the side of the pinion on which the point of its pair lies.

    Examples
    --------
    >>> import mechgraph as mg
    >>> pairs = [mg.Pair("A", "R", "frame", "pinion", point=(0, 0, 0), axis=(0, 0, 1))]
    >>> pairs += [mg.Pair("B", "P", "frame", "rack", point=(0, -0.02, 0), axis=(1, 0, 0))]
    >>> m = mg.Mechanism("rack", pairs=pairs, couplings=[mg.Rack("g", "A", "B", radius=0.02)], drives=["A"])
    >>> mg.kinematics(m, {"A": 1.0})["B"].position
    array([0.02])
    """

    kind: ClassVar[str] = "rack"
    rubs: ClassVar[tuple[str, ...]] = ("preload", "efficiency")
    slides: ClassVar[bool] = True
    sized: ClassVar[bool] = False
    radius: Annotated[float, POSITIVE("pitch radius of the pinion", LENGTH)]
    pressure_angle: Annotated[float, PRESSURE] = FULL

    @property
    def ratio(self) -> float:
        """``1 / r``."""
        return 1.0 / self.radius

    @staticmethod
    def _away(seats: GearSeats) -> tuple[Array, float]:
        """The direction across pinion and rack ``(3,)``, and how far along it the point of the rack is."""
        a, b = seats.seen
        across = cross(a.axis, b.axis)
        return across[:, 0, 0], float(dot(b.point - a.point, across)[0, 0])

    def misfits(self, seats: GearSeats, fitting: float) -> list[str]:
        """See ``ShortForm``."""
        a, b = seats.seen
        if np.abs(dot(a.axis, b.axis)).max() > fitting:
            return ["the rack does not slide at right angles to the axis of the pinion"]
        if abs(self._away(seats)[1]) <= fitting * self.radius:
            return [
                "the point of the rack's pair is level with the pinion's axis; give one on the side where the rack is"
            ]
        return []

    def gears_at(self, seats: GearSeats) -> tuple[Any, Any]:
        """See ``ShortForm``: teeth of a size that none is said of."""
        across, far = self._away(seats)
        away, R, module = across * np.sign(far), seats.pose[:, :3], 2 * self.radius / SHOWN_TEETH
        more: dict[str, Any] = {"module": module, "pressure_angle": self.pressure_angle}
        at, (a, b) = seats.beside, seats.places
        pinion = Gear(self.a, a.link, SHOWN_TEETH, at, a.axis, **more)
        there = R.T @ (at + self.radius * away - seats.pose[:, 3])
        return pinion, GearRack(self.b, b.link, there, b.axis, -R.T @ away, **more)


def strand(side: float, a: LinePlaces, b: LinePlaces, numbers: Array) -> LinesAt:
    """A strand of a belt, in the plane of b: on the right (side 1) or left of the way from a to b; ``numbers``: the signed radii."""
    wa, wb = side * numbers
    level = a.axis * dot(b.point - a.point, a.axis)
    made = span(a.point + level, b.point, a.axis, wa, wb)
    return LinesAt(-made.length, made.end, -made.along)


STRANDS: dict[float, Relation] = {side: partial(strand, side) for side in (1.0, -1.0)}


class Pulleys(Meeting):
    """Two pulleys in an open, or a crossed belt."""

    relations = STRANDS

    def __init__(self, one: Pulley, two: Pulley, a: LinePlaces, b: LinePlaces, crossed: bool) -> None:
        super().__init__(one, two, a, b)
        self.numbers = (one.pitch_radius, -two.pitch_radius if crossed else two.pitch_radius)

    @property
    def ratio(self) -> float:
        """See ``Meeting``."""
        return float(self.two.pitch_radius / self.one.pitch_radius)


@dataclass(frozen=True)
class Belt(ShortForm):
    """Declare a belt or chain around two pulleys on parallel axes, open or crossed.

    The tight side carries the whole load, the slack side nothing.

    Examples
    --------
    >>> import mechgraph as mg
    >>> pairs = [
    ...     mg.Pair(k, "R", "frame", link, point=(x, 0, 0), axis=(0, 0, 1))
    ...     for k, link, x in [("A", "p", 0), ("B", "w", 0.5)]
    ... ]
    >>> m = mg.Mechanism("belt", pairs=pairs, couplings=[mg.Belt("g", "A", "B", radii=(0.1, 0.2))], drives=["A"])
    >>> mg.kinematics(m, {"A": 1.0})["B"].position
    array([0.5])
    """

    kind: ClassVar[str] = "belt"
    rubs: ClassVar[tuple[str, ...]] = OF_BELTS
    sized: ClassVar[bool] = False
    radii: Annotated[Any, TWO_POSITIVE("of both pulleys", LENGTH)]
    crossed: Annotated[bool, FLAG("whether the strands cross")] = False

    @property
    def ratio(self) -> float:
        """``r_b / r_a``."""
        return float(self.radii[1] / self.radii[0])

    def wrap_in(self, m: Any) -> float:
        """The smaller angle of wrap."""
        a, b = self.radii
        reach = -(a + b) if self.crossed else abs(a - b)
        return float(np.pi - 2 * np.arcsin(reach / self._seats(m).across))

    def misfits(self, seats: GearSeats, fitting: float) -> list[str]:
        """See ``ShortForm``."""
        if np.abs(cross(*(place.axis for place in seats.seen))).max() > fitting:
            return ["the axes are not parallel"]
        distance, needed = seats.across, sum(self.radii)
        if distance > needed:
            return []
        return [f"the axes are {distance:.7g} apart, and the pulleys overlap; expected more than {needed:.7g}"]

    def gears_at(self, seats: GearSeats) -> tuple[Any, Any]:
        """See ``ShortForm``."""
        points, names = (seats.beside, seats.places[1].point), (self.a, self.b)
        one, two = (
            Pulley(name, place.link, point, place.axis, radius=r)
            for name, place, point, r in zip(names, seats.places, points, self.radii, strict=True)
        )
        return one, two

    def _meeting(self, seats: GearSeats) -> Meeting:
        one, two = self.gears_at(seats)
        return Pulleys(one, two, one.place.seen(identity()), two.place.seen(seats.pose), self.crossed)
