"""Dry friction in pairs and between teeth: what a user declares; ``mechgraph.force.friction`` solves for it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from copy import copy
from dataclasses import KW_ONLY
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from mechgraph.errors import DeclarationError
from mechgraph.fields import NUMBER, POSITIVE, TEXT
from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.model.loads import BASIC_LOADS, Load, LoadSite
from mechgraph.pairs.factors import UNIT_TWISTS
from mechgraph.pairs.pair_type import PairType
from mechgraph.quantities import FORCE, FORCE_PER_VELOCITY, LENGTH, MOMENT_PER_RATE, is_numeric, unknown, wrong

SINGLE = frozenset(UNIT_TWISTS.values())
"""Twists of freedoms that turn about or slide along an axis of the frame before them."""


@dataclass(frozen=True, eq=False)
class Friction(Load):
    """Declare dry friction in a pair or between teeth: it acts against the motion, in proportion to normal forces.

    A turn about an axis rubs as a journal: couple ``rho |F|`` of the radial force F, ``rho = radius sin(atan mu)`` (the friction
    circle), and ``mu thrust_radius |F_axial|`` where ``thrust_radius`` is given. A slide: ``mu |F|`` at the shoes, ``width`` puts
    them off the axis and bears the moment about it. Turn and slide along one axis share one force. A screw: ``radius |Q| (tan(lead
    +- phi) - +-tan lead)``, ``tan phi = mu / cos an``, ``tan an = tan(flank) cos(lead)`` of the normal section. A ball: ``rho |F|``
    against the relative angular velocity. A contact:
    ``mu N`` against its sliding. A plane: ``mu |F|`` at the center of pressure against the velocity there, its turn through
    ``radius``. With ``length`` two places ``+-length / 2`` along the axis carry ``F / 2 +- M x z / length``.

    Teeth: worms and crossed gears ``mu N`` against the sliding at the pitch point; others the couple ``mu N`` times the mean distance of
    the contact from the pitch point against their relative turn, or what leaves ``efficiency`` of the power that goes in. A flat belt:
    a limit alone, ``T1 / T2 <= e^(mu wrap)`` (Euler, Eytelwein); ``preload`` is a tension more in its strands.

    Solved in ``solve`` and ``study``; in ``respond`` by events. Sources: J. E. Shigley and J. J. Uicker, Theory of
    Machines and Mechanisms, 1995, chapter 13
    (friction circle); G. Niemann and H. Winter, Maschinenelemente II, 2003, chapter 21 (teeth).

    Examples
    --------
    >>> import mechgraph as mg
    >>> import numpy as np
    >>> m, given = mg.load("four-bar"), {"A": mg.Motion(0.5, velocity=10.0)}
    >>> smooth = mg.solve(m, given)
    >>> rough = mg.solve(m, given, loads=[*m.loads, mg.Friction("A", mu=0.1, radius=0.02)])
    >>> couple = 0.02 * np.sin(np.arctan(0.1)) * rough["A"].magnitude
    >>> np.allclose(rough["A"].effort - smooth["A"].effort, couple)
    True
    """

    kind: ClassVar[str] = "friction"
    subject: ClassVar[str] = "friction of {of}"
    of: Annotated[str, TEXT("name of the pair, or of gears, a rack, a worm or a belt")]
    _: KW_ONLY
    mu: Annotated[
        float | None, NUMBER("coefficient of friction", minimum=0.0, default="`efficiency` tells the losses")
    ] = None
    static: Annotated[float | None, NUMBER("coefficient at rest, `mu` or more", minimum=0.0, default="mu")] = None
    radius: Annotated[float | None, POSITIVE("of the journal, ball or thread (mean)", LENGTH)] = None
    thrust_radius: Annotated[float | None, POSITIVE("mean radius of the collar that bears the axial force", LENGTH)] = (
        None
    )
    length: Annotated[
        float | None, POSITIVE("distance of two places along the axis that carry", LENGTH, default="one place")
    ] = None
    width: Annotated[
        float | None, NUMBER("of a guide that b embraces; negative where a embraces b", LENGTH, default="0")
    ] = None
    on: Annotated[str, TEXT("link whose marker is the middle of the places", choices=("a", "b"), default="b")] = "b"
    flank: Annotated[
        float, NUMBER("half angle of a thread in the axial section", degrees=True, minimum=0.0, below=0.5 * np.pi)
    ] = 0.0
    model: Annotated[
        str,
        TEXT("`circle`: the force that the pair transmits is tangent to the circle; `total`: rho = mu radius", choices=("circle", "total"),
             default="circle"),
    ] = "circle"  # fmt: skip
    viscous: Annotated[
        float, NUMBER("effort per rate in every single freedom", FORCE_PER_VELOCITY, MOMENT_PER_RATE, minimum=0.0)
    ] = 0.0
    preload: Annotated[float, NUMBER("normal force more at every place", FORCE, minimum=0.0)] = 0.0
    stribeck: Annotated[
        float | None,
        POSITIVE("v of the coefficient mu + (static - mu) exp(-(s / v)^2) at the sliding speed s", (1, 0, -1), default="mu at any speed"),
    ] = None  # fmt: skip
    efficiency: Annotated[float | None, POSITIVE("of teeth, out over in whichever way power goes; at most 1")] = None
    wrap: Annotated[
        float | None, NUMBER("of a belt: angle of wrap", degrees=True, minimum=0.0, default="as it lies")
    ] = None

    def act(self, site: LoadSite) -> None:
        """What is viscous, ``-viscous x'``; the rest is solved with the reactions, and refused where nothing does so."""
        if not site.solves_friction:
            raise DeclarationError(
                self.where.removesuffix(": "),
                [
                    "friction follows the reactions, and is solved with them in solve, study and respond; leave it out here, "
                    "m.replace(loads=...)"
                ],
            )
        for name in site.freedoms_of(self.of) if self.viscous else ():
            site.add_effort(name, -site.number(self.viscous) * site.freedom(name)[1])

    @property
    def by_position(self) -> bool:
        """Always."""
        return True

    @property
    def follows_reactions(self) -> bool:
        """Yes."""
        return True

    @property
    def coefficient_at_rest(self) -> float:
        """``static``, or mu."""
        static: float = self._mu if self.static is None else self.static
        return static

    @property
    def _mu(self) -> float:
        return 0.0 if self.mu is None else self.mu

    def coefficient(self, speed: Array, at_rest: bool = False) -> Array:
        """At sliding speeds ``(T,)`` in the user's units, or ``at_rest``: on the verge of sliding."""
        rest, mu = self.coefficient_at_rest, self._mu
        if at_rest or self.stribeck is None:
            return np.broadcast_to(rest if at_rest else mu, speed.shape)
        return np.asarray(mu + (rest - mu) * np.exp(-np.square(speed / self.stribeck)))

    def numbers_turn(self, turns: Callable[[Any], bool]) -> bool:
        """Whether its pair turns."""
        names = (self.of, *(f"{self.of}.R{axis}" for axis in "xyz")) if isinstance(self.of, str) else ()
        return any(turns(name) for name in names)

    def with_numbers(self, number: Callable[[Any], Any]) -> Friction:
        """The same with what a function makes of its numbers."""
        out = copy(self)
        vars(out).update({name: number(getattr(self, name)) for name in self.formats})
        return out

    # --- faults ------------------------------------------------------------------------------------------------------

    def faults(self, names: Any) -> list[str]:
        """What is wrong with this load."""
        found = [*super().faults(names), *(self.where + fault for fault in self._of_numbers())]
        if not isinstance(self.of, str):
            return found
        pair: Any = next((p for p in names.pairs if p.name == self.of), None)
        coupling = coupling_of(names, self)
        if pair is None and coupling is None:
            known = [*(p.name for p in names.pairs), *(c.name for c in names.couplings)]
            return [*found, self.where + unknown("pair", self.of, known)]
        if coupling is None and not isinstance(pair.type, PairType):
            return found
        more: list[str] = []
        own = [load for load in names.loads if isinstance(load, Friction) and load.of == self.of]
        if len(own) > 1 and own[0] is not self:
            more.append("of: is declared before; a pair or coupling takes one mg.Friction")
        own_faults = self._of_pair(pair) if coupling is None else self._of_coupling(coupling)
        thread = () if found or coupling is not None else self._of_thread(pair)
        return found + [self.where + fault for fault in (*more, *own_faults, *thread)]

    def _of_numbers(self) -> Iterator[str]:
        if self.mu is None and self.efficiency is None:
            yield "mu: is missing; give the coefficient of friction"
        # what is no number, or below zero, is a fault of its own
        mu, static, part = (
            float(of) if of is not None and is_numeric(of, ()) and of >= 0 else np.nan
            for of in (self._mu, self.static, self.efficiency)
        )
        if static < mu:
            yield wrong(self.static, "static", f"mu = {mu:g} or more")
        if part > 1.0:
            yield wrong(self.efficiency, "efficiency", "a number above 0 and at most 1")
        if self.efficiency is not None and self.mu is not None:
            yield "mu, efficiency: both are given; give one of them"

    def _misplaced(self, taken: Iterable[str], what: str) -> Iterator[str]:
        """Arguments without meaning."""
        for name, default in zip(self.formats, self._defaults, strict=True):
            if name not in ("of", "mu", *taken) and getattr(self, name) != default:
                yield f"{name}: has no meaning for {what}; leave it out"

    def _of_coupling(self, coupling: Any) -> Iterator[str]:
        if not coupling.rubs:
            yield f"of: coupling {self.of}: nothing of it rubs; expected gears, a rack, a worm or a flat belt (toothed=False)"
            return
        yield from self._misplaced(coupling.rubs, f"a {coupling.kind} coupling")
        if self.mu is not None and "mu" not in coupling.rubs:
            yield "mu: takes the numbers of its teeth; declare mg.Gear, mg.GearRack and mg.Mesh, or give efficiency="

    def _of_pair(self, pair: Any) -> Iterator[str]:
        """Numbers without meaning for the pair, and those that are missing."""
        row = pair.type
        ways = [way for way in WAYS if way.of(row)]
        if pair.roller is not None or not ways:
            why = "nothing of it rubs under a normal force" if pair.roller is None else "a roller rolls"
            yield f"of: pair {pair.name} of type {row.symbol}: {why}; expected one that turns about, slides along or touches at a place"
            return
        taken = {*OF_PAIRS, *(name for way in ways for name in (*way.needs, *way.takes))}
        yield from self._misplaced(taken, f"type {row.symbol}")
        alone = self.thrust_radius is not None and self.length is None and row.f == 1
        if self.radius is None and not alone and any(way.needs for way in ways):
            yield f"radius: type {row.symbol} turns; give the radius at which it rubs"
        # what is no number is a fault of its own
        width, viscous = (of if isinstance(of, int | float) else None for of in (self.width, self.viscous))
        if width == 0.0:
            yield wrong(self.width, "width", "a number other than 0, or leave it out")
        if viscous and len({f.turns for f in row.freedoms}) > 1:
            yield f"viscous: type {row.symbol} turns and slides, in two units; give mg.Spring(freedom=, damping=) instead"

    def _of_thread(self, pair: Any) -> Iterator[str]:
        if pair.type.takes_pitch and self.radius is not None:
            lead = np.arctan2(abs(pair.pitch_per_radian), self.radius)
            phi = np.arctan(self.coefficient_at_rest / np.cos(np.arctan(np.tan(self.flank) * np.cos(lead))))
            if lead + phi >= 0.5 * np.pi:
                angles = f"lead angle {np.rad2deg(lead):.4g} deg and friction angle {np.rad2deg(phi):.4g}"
                yield f"mu: a thread with {angles} has no finite force"


def place_of_coupling(m: Any, load: Any) -> int:
    """The place of the coupling that a friction names, of a belt its first span; -1 for one of a pair."""
    return next((g for g, c in enumerate(m.couplings) if load.of in (c.name, getattr(c, "belt", None))), -1)


def coupling_of(m: Any, load: Any) -> Any:
    """The coupling that a friction names, of a belt its first span; None for one of a pair."""
    g = place_of_coupling(m, load)
    return None if g < 0 else m.couplings[g]


def rubbing_loads(m: Any, loads: Iterable[Load]) -> list[Friction]:
    """The friction among loads that exerts forces, which belts do not."""
    dry = [load for load in loads if isinstance(load, Friction)]
    return [load for load in dry if "wrap" not in getattr(coupling_of(m, load), "rubs", ())]


def way_of(m: Any, load: Friction) -> tuple[tuple[int, float], ...]:
    """The pair that rubs, or those on the way between gears, each with its sense."""
    coupling = coupling_of(m, load)
    return ((m.pair_index[load.of], 1.0),) if coupling is None else tuple((s.pair, s.sense) for s in coupling.steps)


def pairs_of(m: Any, load: Friction) -> list[int]:
    """Places of these pairs."""
    return [pair for pair, _ in way_of(m, load)]


def rests_on(m: Any, load: Friction) -> tuple[str, ...]:
    """Names of the reaction components that friction follows: forces, with a ``length`` moments too; of gears their effort."""
    if load.of not in m.pair_index:
        return ("effort",)
    row = m.pair(load.of).type
    journal = row.f == 1 and rubs_as_journal(row)
    axial = "Fz" if journal and load.thrust_radius is None else ""
    if journal and load.radius is None:
        return ("Fz",)
    moments = load.length is not None or load.width is not None or rubs_as_plane(row)
    return tuple(c.name for c in row.reactions or () if (moments if c.is_couple else c.name != axial))


def rubs_as_journal(row: PairType) -> bool:
    """Whether it turns about axes under radial forces."""
    return (
        not row.touching
        and not row.takes_pitch
        and _bears(row)
        and any(_is(f, turn=True) for f in row.freedoms)
        and all(row.drivable)
    )


def rubs_as_slide(row: PairType) -> bool:
    """Whether it slides along one axis under forces across it."""
    return not row.touching and _bears(row) and sum(_is(f, turn=False) for f in row.freedoms) == 1


def rubs_as_screw(row: PairType) -> bool:
    """Whether it turns along a thread."""
    return row.takes_pitch


def rubs_as_ball(row: PairType) -> bool:
    """Whether it turns as a ball and bears forces in all directions."""
    return not row.touching and len(row.freedoms) == 3 and not any(row.drivable) and len(row.component_names) == 3


def rubs_as_plane(row: PairType) -> bool:
    """Whether it slides in a plane under a force across it."""
    return (
        not row.touching
        and all(row.drivable)
        and sum(_is(f, turn=False) for f in row.freedoms) == 2
        and row.component_names[:1] == ("Fz",)
    )


def rubs_as_contact(row: PairType) -> bool:
    """Whether its elements touch at a place."""
    return row.touching is not None or row.opens


class Rubs(NamedTuple):
    """A place at which a pair rubs: in which ``way``, the freedoms in which it turns and slides there, the ``side`` of the middle on which
    it lies (0: in the middle).
    """

    way: str
    turn: int | None = None
    slide: int | None = None
    side: float = 0.0


def places_in(load: Friction, row: PairType) -> Iterator[Rubs]:
    """All places at which a pair of this type rubs, in order."""
    alone = {
        "opening": row.opens,
        "contact": rubs_as_contact(row),
        "plane": rubs_as_plane(row),
        "ball": rubs_as_ball(row),
    }
    if way := next((way for way, so in alone.items() if so), None):
        yield Rubs(way)
        return
    axes: dict[int, dict[bool, int]] = {}
    for j, f in enumerate(row.freedoms):
        axes.setdefault(int(np.argmax(np.abs(f.twist[:3] if f.turns else f.twist[3:]))), {})[f.turns] = j
    for found in axes.values():
        turn, slide = found.get(True), found.get(False)
        if row.takes_pitch:
            yield Rubs("thread", turn)
        rubs = turn is None or load.radius is not None  # else a collar alone
        if rubs and (not row.takes_pitch or load.length is not None):
            yield from (Rubs("axis", turn, slide, side) for side in ((0.0,) if load.length is None else (1.0, -1.0)))
            if load.width is not None:
                yield Rubs("couple", turn, slide)
        if load.thrust_radius is not None:
            yield Rubs("collar", turn)


def _is(freedom: Any, *, turn: bool) -> bool:
    return freedom.turns is turn and freedom.twist in SINGLE and not any(freedom.per_pitch)


def _bears(row: PairType) -> bool:
    """Whether it bears forces across its axes: at least two components that are forces, in a plane one."""
    return sum(not c.is_couple for c in row.reactions or ()) >= (2 if row.normal is None else 1)


class _RubsBy(NamedTuple):
    """A way in which pairs rub: which ones, and the arguments of ``Friction`` that it needs and takes."""

    of: Callable[[PairType], bool]
    needs: tuple[str, ...] = ()
    takes: tuple[str, ...] = ()


OF_PAIRS = ("static", "stribeck", "model", "viscous", "preload", "on")
"""Arguments that all pairs take."""
WAYS = (
    _RubsBy(rubs_as_journal, ("radius",), ("thrust_radius", "length")),
    _RubsBy(rubs_as_slide, (), ("length", "width")),
    _RubsBy(rubs_as_screw, ("radius",), ("length", "flank")),
    _RubsBy(rubs_as_ball, ("radius",)),
    _RubsBy(rubs_as_plane, (), ("radius",)),
    _RubsBy(rubs_as_contact),
)


LOADS: dict[str, type[Load]] = {**BASIC_LOADS, Friction.kind: Friction}
"""Load classes by the name of their kind in files."""
