"""What holds freedoms for a while: stops on which they rest, friction by which they stick.

Stops: freedoms that may not pass a limit. They strike it, rebound, rest on it and leave it.

At an impact with stops ``i`` closing at the rates ``w_i = g_i . v`` the impulses ``p_i >= 0`` are those of Newton's law of restitution,

    v+ = v + M^-1 G^T p,   w+ + e w >= 0,   p . (w+ + e w) = 0,

with ``G`` the rows ``g_i`` of independent rates. Stops that are closed at rest hold as long as they press: ``f >= 0``, ``G v' >= 0``,
``f . G v' = 0``. Both are linear complementarity problems of a positive semidefinite matrix ``G M^-1 G^T``, solved as least squares with
``p >= 0``.

Dry friction: a freedom slips one way, which turns where its rate passes zero, or it sticks. Where it sticks it is held, until it would slip
one way against the greatest friction at rest. Freedoms at rest that move in proportion stick and slip together. Which do what, where rates
are zero, is a linear complementarity problem in accelerations and friction; its states are tried one after the other. Nothing is smoothed,
so that what sticks stands still.

Source: Pfeiffer and Glocker, Multibody Dynamics with Unilateral Contacts, 1996, chapters 5 and 6.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from typing import Any, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.force.block import unique_reactions
from mechgraph.force.friction import OUTCOMES, places_of
from mechgraph.force.loads import kinetic_energy
from mechgraph.force.reactions import ForceProblem, user_wrench
from mechgraph.kinematics.assembly import closed_start
from mechgraph.kinematics.prescribed import with_pairs_at
from mechgraph.kinematics.state import Configuration
from mechgraph.maths.linear import rank_of, singular_values
from mechgraph.maths.se3 import Array, cross
from mechgraph.maths.tolerances import MOTIONS, RESPONSE
from mechgraph.model.friction import Friction
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Marker, Pair
from mechgraph.model.response_setup import Event, Stop
from mechgraph.pairs.contact_types import pressing
from mechgraph.pairs.pair_type import PairType
from mechgraph.quantities import items_of, wrong
from mechgraph.response.charts import Prescribed, Task, no_force
from mechgraph.response.integration import LOOKS_IN_STEP, Occurrence, first_root, with_turns
from mechgraph.response.motion_equations import NO_INERTIA, ClosedChart, Moved, Stopped, accelerations, moved


def read_stops(m: Mechanism, stops: Any, faults: list[str]) -> tuple[Stop, ...]:
    """The stops of a call; adds what is wrong with them to ``faults``."""
    given = (stops,) if isinstance(stops, Stop) else items_of(stops, "stops", faults)
    faults += [wrong(one, "an item of stops", "an mg.Stop") for one in given if not isinstance(one, Stop)]
    known = [one for one in given if isinstance(one, Stop)]
    bad = [fault for one in known for fault in one.faults(m)]
    faults += bad
    return () if bad else tuple(known)


def with_contacts(m: Mechanism, stops: Iterable[Stop], tol: float) -> tuple[Mechanism, dict[str, float]]:
    """The mechanism with contacts that open, and with the coordinates of named points that have stops; where its gaps start."""
    gaps = {f"{pair.name}.gap": pair.gap for pair in m.pairs if pair.restitution is not None}
    said: dict[str, Any] = {"restitution": None, "gap": 0.0, "closed": "", "hertz": None, "radius": None}
    pairs = [
        p if p.restitution is None else p.replace(type=p.type.opened(pressing(p.type.spatial or p.type)), **said)
        for p in m.pairs
    ]
    places = dict.fromkeys(place for stop in stops if (place := stop.point(m)) is not None)
    names = {pair.name for pair in m.pairs}
    free: list[Pair] = []
    for link, point in (place for place in places if ".".join(place) not in names):
        row = PairType("Fr", "coordinates of a point", freedoms=["Tx", "Ty", "Tz", "rotation"], reactions=[])
        on_a, on_b = (Marker(at, (0.0, 0.0, 1.0)) for at in ((0.0, 0.0, 0.0), m.link(link).point(point)))
        free.append(Pair(f"{link}.{point}", row, m.frame, link, on_a=on_a, on_b=on_b))
    m = m.replace(pairs=pairs) if gaps else m
    # their coordinates begin where the points are, so that they do not move what start= leaves open
    return (with_pairs_at(m, free, m.drives, closed_start(m, tol=tol)) if free else m), gaps


def _rubs_in(pair: Pair) -> int | None:
    """The one freedom of a pair in which it rubs; None where there are several."""
    slides = [j for j, freedom in enumerate(pair.type.freedoms) if not freedom.turns and j != pair.type.gap]
    if pair.type.touching or pair.type.opens:
        return slides[0] if len(slides) == 1 and pair.radius_b is None else None
    return 0 if len(pair.type.freedoms) == 1 else None


def friction_faults(m: Mechanism, passive: str) -> list[str]:
    """Friction that a motion in time does not carry."""
    found = []
    for load in m.loads:
        if isinstance(load, Friction):
            pair = next((pair for pair in m.pairs if pair.name == load.of), None)
            if pair is None:
                found.append(f"{load.where}is that of a coupling, which is not followed in time; leave it out")
            elif _rubs_in(pair) is None:
                found.append(
                    f"{load.where}slips in several freedoms (type {pair.type.symbol}) together, which is not followed in time; leave it "
                    "out, take the pair apart into pairs of one freedom, or let a contact be a point in a planar mechanism"
                )
            elif passive == "held":
                found.append(f"{load.where}is not followed beside passive='held'; give passive='free'")
    return found


@dataclass(frozen=True)
class _Limit:
    """One limit of one freedom, internal units: ``sign * (q - value) >= 0``; ``contact``: the pair that opens there."""

    stop: Stop
    name: str
    column: int
    row: int
    sign: float
    value: float
    contact: str = ""

    @property
    def user(self) -> float:
        """The limit in the user's units."""
        return float(getattr(self.stop, self.name))

    def occurrence(self, t: float, meets: bool) -> Occurrence:
        """What ``Response.events`` says of it."""
        text = f"{self.stop.freedom} {'meets' if meets else 'leaves'} its {self.name} stop"
        if self.contact:
            text = f"{self.contact} {'lands' if meets else 'opens'}"
        event = Event(self.stop.freedom, self.user, name=text)
        return Occurrence(event, t, (self.sign > 0) != meets)


@dataclass(frozen=True)
class _Stuck:
    """Freedoms that stick together, the first held where it stands (in the user's units); ``signs`` of their rates when they slip."""

    columns: tuple[int, ...]
    signs: tuple[float, ...]
    user: float

    @property
    def column(self) -> int:
        """The freedom that is held."""
        return self.columns[0]


class Moving(Protocol):
    """What is seen of a motion."""

    def positions(self, t: Array) -> Array:
        """Internal states ``(nx, T)`` at times ``(T,)``."""

    def rates(self, t: Array) -> Array:
        """Rates and accelerations ``(2, F, T)`` of all freedoms at times ``(T,)``."""

    def efforts_held(self, t: Array) -> Array:
        """Efforts ``(p, T)`` of the freedoms that are prescribed and held, in their order."""


@dataclass(frozen=True)
class _Held:
    """Prescribed freedoms with those that are held behind them (see ``Prescribed``)."""

    prescribed: Prescribed
    places: tuple[float, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return self.prescribed.names

    def at(self, t: float) -> Array:
        """Positions, velocities and accelerations ``(3, p)``."""
        still = np.zeros((3, len(self.places)))
        still[0] = self.places
        return np.concatenate([self.prescribed.at(t), still], axis=1)


@dataclass(frozen=True)
class _Holding:
    """What holds freedoms at a time: limits that they rest on, freedoms that stick; ``senses (F,)`` in which others slip."""

    limits: tuple[_Limit, ...] = ()
    stuck: tuple[_Stuck, ...] = ()
    senses: Array | None = None

    def task(self, task: Task, at_rest: Sequence[str] = ()) -> Task:
        """What moves with these held; friction of the pairs ``at_rest`` is that at rest."""
        loads = task.loads
        holds: list[Any] = [*self.limits, *self.stuck]
        if self.senses is not None:
            dry = tuple(
                replace(load, mu=load.coefficient_at_rest) if load.of in at_rest else load for load in loads.dry
            )
            task = replace(task, loads=replace(loads, dry=dry, senses=self.senses, stuck=self.stuck_columns))
        if not holds:
            return task
        columns = np.append(task.columns, [one.column for one in holds]).astype(np.intp)
        prescribed: Any = _Held(task.prescribed, tuple(one.user for one in holds))
        return replace(task, prescribed=prescribed, columns=columns)

    @property
    def stuck_columns(self) -> tuple[int, ...]:
        """All freedoms that stick."""
        return tuple(column for one in self.stuck for column in one.columns)

    def slipping(self, one: _Stuck, sense: float) -> _Holding:
        """The same where freedoms that stick slip one way instead."""
        assert self.senses is not None
        senses = self.senses.copy()
        senses[list(one.columns)] = sense * np.array(one.signs)
        return replace(self, stuck=tuple(other for other in self.stuck if other is not one), senses=senses)


def evaluated(task: Task, t: Array, x: Array, dq: Array) -> tuple[Moved, Configuration]:
    """Accelerations of a task at states ``x (nx, T)`` near each other with rates ``dq (F, T)``."""
    chart, here = task.chart(x[:, 0]), Configuration(task.system, x)
    f = chart.solver.factored(here, np.repeat(chart.which, here.T))
    at = ClosedChart(here, f, np.ones(here.T, dtype=bool), chart.held)
    return moved(at, dq[chart.moving], task.prescribed_at(t)[1:], task.loads, t), here


def _first_below(height: Callable[[Array], Array], t: Array, h: Array, slack: float) -> float | None:
    """The first of the times at which a height has fallen below zero by more than ``slack``; the first one, if it was never above."""
    t, h = with_turns(height, t, h)
    deep = np.flatnonzero(h < -slack)
    if not deep.size:
        return None
    before = np.flatnonzero(h[: deep[0]] > 0.0)
    return first_root(height, t[before[-1]], t[deep[0]]) if before.size else float(t[0])


@dataclass
class Rests:
    """The stops and the friction of a motion; ``task`` is what moves without them, ``holding`` what holds freedoms now.

    ``rough``: freedoms with friction, by column, and the names of their pairs.
    """

    task: Task
    limits: tuple[_Limit, ...]
    rough: dict[int, str] = field(default_factory=dict)
    holding: _Holding = field(default_factory=_Holding)
    _leaving: dict[int, float] = field(default_factory=dict)

    @classmethod
    def of(cls, m: Mechanism, task: Task, stops: Iterable[Stop], bounces: Mapping[str, float]) -> Rests:
        """Stops of the scaled system of a task, its contacts that open, with their restitution, and its friction."""
        s, limits = task.system, []
        contacts = {f"{p.name}.gap": p for p in m.pairs if p.type.opens}
        own = [Stop(gap, lower=0.0, restitution=bounces[gap]) for gap in contacts]
        for stop in (*own, *stops):
            k, j = m.freedom(stop.freedom)
            column = int(s.first_column[k]) + j
            unit = s.par.L if s.is_length[column] else 1.0
            for name, sign in (("lower", 1.0), ("upper", -1.0)):
                value = getattr(stop, name)
                if value is not None:
                    contact = contacts[stop.freedom].name if stop in own else ""
                    limit = _Limit(stop, name, column, int(s.single_rows[column]), sign, float(value) / unit, contact)
                    limits.append(limit)
        rough = {}
        for load in task.loads.dry:
            place = _rubs_in(s.m.pair(load.of))
            assert place is not None
            rough[int(s.first_column[s.m.place_of_pair(load.of)]) + place] = load.of
        return cls(task, tuple(limits), rough)

    def faults(self, x: Array) -> list[str]:
        """What is wrong with them at the start, a state ``x (nx,)``: freedoms that are prescribed, or beyond their limits."""
        driven = {limit.stop.freedom for limit in self.limits if limit.column in self.task.columns}
        found = [
            f"stop of {name!r}: its motion is prescribed; leave the stop or the motion out" for name in sorted(driven)
        ]
        return found + [
            f"start of {limit.stop.freedom!r}: is beyond its {limit.name} stop at {limit.user:g}; give a start within its limits"
            for limit in self.limits
            if limit.sign * (x[limit.row] - limit.value) < -RESPONSE.touching
        ]

    def __bool__(self) -> bool:
        return bool(self.limits or self.rough)

    def held_task(self) -> Task:
        """The task with what rests or sticks held there."""
        return self.holding.task(self.task)

    # --- within a step --------------------------------------------------------------------------------------------------

    def met(self, motion: Moving, begin: float, end: float, apart: float = np.inf) -> float | None:
        """The first time in a step at which a free limit is passed, a held one no longer presses, or friction turns, holds or yields.

        ``apart``: greatest distance of looks at what sticks under loads of time.
        """
        # rates at the beginning are those before an impact, if there was one
        looks = begin + (end - begin) * LOOKS_IN_STEP[1:]
        rates = motion.rates(looks) if self.rough else np.zeros((2, 0, len(looks)))
        bad = np.flatnonzero(np.isnan(rates[1]).any(axis=0))
        if bad.size:
            last = begin if bad[0] == 0 else float(looks[bad[0] - 1])
            raise no_force(self.task, OUTCOMES[2], float(looks[bad[0]]), last)
        times: list[float | None] = []
        free = [limit for limit in self.limits if limit not in self.holding.limits]
        if free:
            x = motion.positions(looks)
            for limit in free:
                gap = limit.sign * (x[limit.row] - limit.value)
                times.append(_first_below(partial(_gap, motion, limit), looks, gap, RESPONSE.touching))
        if self.holding.limits:
            push = partial(self._pressing, motion)
            if push(looks[-1:])[0] < 0.0:
                times.append(_first_below(push, looks, push(looks), 0.0) or looks[0])
        met = min((one for one in times if one is not None), default=None)
        self._leaving = {}
        if self.rough:
            met = self._turned(motion, looks, rates[0], met)
            met = self._yielded(motion, looks, rates[0], met, apart)
        return met

    def _pressing(self, motion: Moving, times: Array) -> Array:
        """The least of the efforts with which the held limits press: negative where one would have to pull."""
        first, held = len(self.task.columns), self.holding.limits
        sign = np.array([[one.sign] for one in held])
        return np.asarray((sign * motion.efforts_held(times)[first : first + len(held)]).min(axis=0))

    def _turned(self, motion: Moving, looks: Array, rates: Array, met: float | None) -> float | None:
        """The first time at which a freedom that slips comes to rest, if that is before another."""
        senses = self.holding.senses
        assert senses is not None
        noise = RESPONSE.lowest * np.abs(rates[list(self.rough)]).max()
        for column in self.rough:
            if self._is_open(column, self.holding):
                continue
            if senses[column]:
                h = senses[column] * rates[column]
                found = _first_below(partial(_rate, motion, column, senses[column]), looks, h, noise)
            elif column not in self.holding.stuck_columns and not self._blocked(column):
                moves = np.flatnonzero(np.abs(rates[column]) > noise)
                found = float(looks[moves[0]]) if moves.size else None
            else:
                continue
            met = found if met is None or (found is not None and found < met) else met
        return met

    def _is_open(self, column: int, holding: _Holding) -> bool:
        """Whether a freedom is that of a contact that is open."""
        name = self.rough[column]
        contacts = [limit for limit in self.limits if limit.contact == name]
        return bool(contacts) and not any(limit in holding.limits for limit in contacts)

    def _blocked(self, column: int) -> bool:
        """Whether a freedom is held by a limit."""
        return column in [one.column for one in self.holding.limits]

    def _yielded(self, motion: Moving, looks: Array, rates: Array, met: float | None, apart: float) -> float | None:
        """The first time at which friction does not hold any more, if that is before another."""
        loads, x = self.task.loads, motion.positions(looks)
        timed = len(self.task.columns) or any(load.of_time for load in (*loads.stored, *loads.rest))
        if not self.holding.stuck or not (timed or rates.any()):
            return met
        count = int(np.ceil((looks[-1] - looks[0]) / apart)) if timed and np.isfinite(apart) else 0
        if count > len(looks):
            looks = np.linspace(looks[0], looks[-1], count + 1)
            x, rates = motion.positions(looks), motion.rates(looks)[0]
        for one, sense in product(self.holding.stuck, (1.0, -1.0)):
            height = partial(self._margin, motion, self.holding, one, sense)
            found = _first_below(height, looks, -self._verge(self.holding, one, sense, looks, x, rates), 0.0)
            if found is not None and (met is None or found < met):
                met, self._leaving = found, {one.column: sense}
        return met

    def _margin(self, motion: Moving, holding: _Holding, one: _Stuck, sense: float, t: Array) -> Array:
        return -self._verge(holding, one, sense, t, motion.positions(t), motion.rates(t)[0])

    def _verge(self, holding: _Holding, one: _Stuck, sense: float, t: Array, x: Array, dq: Array) -> Array:
        """The acceleration ``(T,)`` one way with which freedoms that stick would slip against friction at rest; not a bit where it jams.

        Of a contact that opens, which may have no such state, the effort beyond that of friction, over its greatest one at rest.
        """
        pair = self.rough[one.column]
        presses = [i for i, limit in enumerate(holding.limits) if limit.contact == pair]
        if presses and len(one.columns) == 1:
            found, _ = evaluated(holding.task(self.task), t, x, dq)
            efforts = found.held[len(self.task.columns) :]
            normal = holding.limits[presses[0]].sign * efforts[presses[0]]
            rubs = [load for load in self.task.loads.dry if load.of == pair]
            most = sum(load.coefficient_at_rest * (normal + load.preload / self.task.system.par.L) for load in rubs)
            beyond = -sense * efforts[len(holding.limits) + holding.stuck.index(one)] - most
            return np.asarray(beyond / (np.abs(efforts).sum(axis=0) + 1e-300))
        task = holding.slipping(one, sense).task(self.task, [self.rough[column] for column in one.columns])
        found, _ = evaluated(task, t, x, dq)
        return np.nan_to_num(sense * one.signs[0] * found.rates.ddq[one.column], nan=-np.inf)

    # --- at an event -----------------------------------------------------------------------------------------------------

    def after(self, t: float, x: Array, dq: Array) -> tuple[Array, Array, float, list[Occurrence]]:
        """Rates after a time ``t`` at which something is met or left; ``holding`` is what holds freedoms afterwards.

        Also what impacts take, none of friction, and the work done ``(3,)``, the longest first step from here, and what happened.
        """
        closed = tuple(one for one in self.limits if one.sign * (x[one.row] - one.value) <= RESPONSE.touching)
        was, after, first = self.holding, dq, np.inf
        blow: dict[_Limit, dict[str, Any]] = {}
        lost = spent = 0.0
        resting: tuple[_Limit, ...] = ()
        pressing: tuple[_Limit, ...] = ()
        if closed:
            task = _Holding(senses=self._senses(dq)).task(self.task)
            before = _Free(task, t, x, dq, closed)
            e = np.array([limit.stop.restitution for limit in closed])
            rough = self._rough_blow(before)
            after, lost, p = before.struck(e) if rough is None else before.struck_rough(*rough, e[0])
            free = _Free(task, t, x, after, closed)
            if (free.still & (free.w > 0.0)).any():
                e = np.where(free.still, 0.0, e)
                after, lost, p = before.struck(e) if rough is None else before.struck_rough(*rough, e[0])
                free = _Free(task, t, x, after, closed)
            which, w_rate = free.pressing()
            pressing = tuple(closed[i] for i in which)
            resting = tuple(closed[i] for i in np.flatnonzero(free.still & free.moves))
            hops = 2.0 * free.w / np.where((w_rate < 0.0) & ~free.still & (free.w > 0.0), -w_rate, np.inf)
            first = float(hops[hops > 0.0].min(initial=np.inf)) / 2
            hit, spent = (before.w < 0.0) & ~before.still, before.spent(p, after)
            if hit.any():
                blow = {closed[i]: before.blow(i, p, spent) for i in np.flatnonzero(hit).tolist()}
        if self.rough:
            self.holding, after = self._settled(t, x, after, resting)
        else:
            self.holding = _Holding(pressing)
        now = self.holding.limits
        found = [
            replace(one.occurrence(t, True), **blow.get(one, {}))
            for one in closed
            if one in blow or (one in now and one not in was.limits)
        ]
        found += [one.occurrence(t, False) for one in was.limits if one not in now]
        return after, np.array([spent, 0.0, -lost]), first, [*found, *self._rubbing(t, was)]

    def _rough_blow(self, before: _Free) -> tuple[int, float] | None:
        """The freedom in which a contact that is struck rubs, and its coefficient; None where what is struck is smooth."""
        rubs = {name: column for column, name in self.rough.items()}
        struck = (before.w < 0.0) & ~before.still
        rough = [one.contact for one in before.closed if one.contact in rubs]
        if not rough or not struck.any():
            return None
        name = rough[0]
        if len(before.closed) > 1:
            raise Stopped(
                f"an impact while contact {name} with friction and others are closed is not followed; leave its friction out"
            )
        return rubs[name], sum(load.mu for load in self.task.loads.dry if load.of == name)

    def _senses(self, dq: Array) -> Array | None:
        """The senses ``(F,)`` of the freedoms with friction that move; None where none has friction."""
        if not self.rough:
            return None
        senses, columns = np.zeros(len(dq)), list(self.rough)
        senses[columns] = np.sign(dq[columns])
        return senses

    def _rubbing(self, t: float, was: _Holding) -> Iterator[Occurrence]:
        """What became of freedoms with friction."""
        if was.senses is None or self.holding.senses is None:
            return
        names = self.task.system.m.freedom_names()
        for column, pair in self.rough.items():
            before, now = was.senses[column], self.holding.senses[column]
            sticks, stuck = column in self.holding.stuck_columns, column in was.stuck_columns
            what = (
                "sticks"
                if sticks and not stuck
                else "slips"
                if stuck and now
                else "reverses"
                if before * now < 0
                else ""
            )
            if what:
                yield Occurrence(Event(names[column], what="velocity", name=f"{pair} {what}"), t, bool(now > before))

    def _settled(self, t: float, x: Array, dq: Array, resting: tuple[_Limit, ...]) -> tuple[_Holding, Array]:
        """What holds freedoms from a time on, and the rates then: the first state that agrees with itself, the stillest ones first."""
        senses = self._senses(dq)
        assert senses is not None
        found, _ = evaluated(_Holding(senses=senses).task(self.task), np.array([t]), x[:, None], dq[:, None])
        Z, size = found.columns.Z[..., 0], float(np.nan_to_num(np.abs(found.rates.ddq)).max(initial=0.0))
        # rates that would end within the square of what counts as rest on a stop
        slow = [c for c in self.rough if dq[c] ** 2 <= 2.0 * RESPONSE.lowest**2 * size]
        senses[slow] = 0.0
        for column in slow:
            if (
                np.abs(Z[column]).max(initial=0.0) <= MOTIONS.still
                and abs(found.rates.ddq[column, 0]) > MOTIONS.still * size
            ):
                senses[column] = np.sign(found.rates.ddq[column, 0])
        groups = self._together(Z, [c for c in slow if np.abs(Z[c]).max(initial=0.0) > MOTIONS.still], x)
        # states that are tried: 3^4, with as many stops
        if len(groups) > 4 or len(resting) > 6:
            names = ", ".join(self.rough[one.column] for one in groups)
            raise Stopped(
                f"more than 4 freedoms with friction are at rest at once, each by itself ({names}), which is not decided"
            )
        # what is at rest is so exactly
        still = self._independent(_Holding(senses=senses), Z, groups, [0.0] * len(groups))
        dq = evaluated(still.task(self.task), np.array([t]), x[:, None], dq[:, None])[0].rates.dq[:, 0]
        options = [self._options(one) for one in groups]
        states = product(product(*options), product((True, False), repeat=len(resting)))
        why = 0
        for ways, held in sorted(states, key=lambda one: sum(map(abs, one[0])) + one[1].count(False)):
            limits = tuple(one for one, holds in zip(resting, held, strict=True) if holds)
            holding = self._independent(_Holding(limits, (), senses.copy()), Z, groups, ways)
            found, _ = evaluated(holding.task(self.task), np.array([t]), x[:, None], dq[:, None])
            if found.rubs is not None and found.rubs.outcome[0]:
                why = int(found.rubs.outcome[0])
            elif self._agrees(holding, found, groups, ways, resting, size, t, x, dq):
                self._painleve(holding, resting, t, x, dq, agrees=True)
                return holding, found.rates.dq[:, 0]
        self._painleve(_Holding(resting, (), senses), resting, t, x, dq, agrees=False)
        raise no_force(self.task, OUTCOMES[why or OUTCOMES.index("no finite force")], t)

    def _painleve(
        self, holding: _Holding, resting: Sequence[_Limit], t: float, x: Array, dq: Array, *, agrees: bool
    ) -> None:
        """Stop where a contact that slips has no normal force N >= 0, or two: its normal acceleration is b + p N with p < 0."""
        columns = {name: column for column, name in self.rough.items()}
        for limit in resting:
            column = columns.get(limit.contact)
            if column is None or holding.senses is None or not holding.senses[column]:
                continue
            b, p = self._normal_law(holding, limit, t, x, dq)
            if p >= 0.0 or agrees != (b > 0.0):
                continue
            size = self.task.system.par.L
            law = f"contact {limit.contact} at t = {t:.6g}: its normal acceleration is b + p N with b = {b * size:.6g}, p = {p:.6g}"
            if agrees:
                raise Stopped(f"{law}: it may press with N = -b / p, or leave (Painleve)", OUTCOMES[3])
            raise Stopped(f"{law}: no N >= 0 holds it up (Painleve)", OUTCOMES[2])

    def _normal_law(self, holding: _Holding, limit: _Limit, t: float, x: Array, dq: Array) -> tuple[float, float]:
        """The normal acceleration of a contact that slips, without a normal force, and for a unit one with its friction."""
        task = replace(holding, limits=tuple(one for one in holding.limits if one is not limit)).task(self.task)
        found, here = evaluated(task, np.array([t]), x[:, None], dq[:, None])
        s, column = here.system, limit.column
        press = np.zeros((6, len(s.m.pairs), 1))
        press[:, s.m.place_of_pair(limit.contact)] = limit.sign * here.E[:, column]
        efforts = np.zeros((s.n_freedoms, 1))
        efforts[column] = limit.sign
        rubs = [load for load in task.loads.dry if load.of == limit.contact]
        mine = s.pair_of_freedom == s.m.place_of_pair(limit.contact)
        for place in places_of(here, task.loads.directions(dq[:, None]), press, rubs):
            efforts[mine] += np.einsum("cft,ct->ft", here.S[:, mine], place.D)
        a, _ = found.columns.accelerations(np.zeros((6, len(s.m.links), 1)), efforts)
        return float(limit.sign * found.rates.ddq[column, 0]), float(limit.sign * (found.columns.Z[column] * a).sum())

    def _options(self, one: _Stuck) -> tuple[float, ...]:
        """To stick, or to slip one way or the other; what has just left does not stick."""
        left = [self._leaving[c] * s for c, s in zip(one.columns, one.signs, strict=True) if c in self._leaving]
        return (left[0],) if left else (0.0, 1.0, -1.0)

    def _together(self, Z: Array, columns: Sequence[int], x: Array) -> list[_Stuck]:
        """Freedoms that move in proportion, each set as one that sticks."""
        s, out, left = self.task.system, [], list(columns)
        while left:
            unit = Z[left] / np.linalg.norm(Z[left], axis=1)[:, None]
            along = unit @ unit[0]
            mine = np.abs(unit - along[:, None] * unit[0]).max(axis=1) <= MOTIONS.proportional
            first = left[0]
            size = s.par.L if s.is_length[first] else 1.0
            members = [(c, float(np.sign(a))) for c, a, m in zip(left, along, mine, strict=True) if m]
            place = float(x[s.single_rows[first]]) * size
            out.append(_Stuck(tuple(c for c, _ in members), tuple(sign for _, sign in members), place))
            left = [c for c, m in zip(left, mine, strict=True) if not m]
        return out

    def _independent(self, holding: _Holding, Z: Array, groups: Sequence[_Stuck], ways: Sequence[float]) -> _Holding:
        """The state with what sticks, of freedoms that limits leave free, and the senses of what slips."""
        held = [one.column for one in holding.limits]
        for one, way in zip(groups, ways, strict=True):
            if way:
                holding = holding.slipping(one, way)
            elif self._is_open(one.column, holding):
                continue
            elif rank_of(singular_values(Z[[*held, one.column]]), MOTIONS.still) > len(held):
                held, holding = [*held, one.column], replace(holding, stuck=(*holding.stuck, one))
        return holding

    def _agrees(
        self,
        holding: _Holding,
        found: Moved,
        groups: Sequence[_Stuck],
        ways: Sequence[float],
        resting: Sequence[_Limit],
        size: float,
        t: float,
        x: Array,
        dq: Array,
    ) -> bool:
        """Whether what slips goes on, what presses does so, what is free leaves, and what sticks would not slip."""
        a, slack = found.rates.ddq[:, 0], MOTIONS.still * size
        for one, way in zip(groups, ways, strict=True):
            least = -slack if one.column in self._leaving else slack
            if way and not way * one.signs[0] * a[one.column] >= least:
                return False
        first, at = len(self.task.columns), (np.array([t]), x[:, None], dq[:, None])
        efforts = found.held[first:, 0]
        strong = MOTIONS.still * float(np.abs(efforts).max(initial=0.0))
        pushes = all(one.sign * effort >= -strong for one, effort in zip(holding.limits, efforts, strict=False))
        leaves = all(one.sign * a[one.column] >= -slack for one in resting if one not in holding.limits)
        holds = all(self._verge(holding, one, way, *at)[0] <= slack for one in holding.stuck for way in (1.0, -1.0))
        return pushes and leaves and holds


def _gap(motion: Moving, limit: _Limit, t: Array) -> Array:
    return np.asarray(limit.sign * (motion.positions(t)[limit.row] - limit.value))


def _rate(motion: Moving, column: int, sense: float, t: Array) -> Array:
    return np.asarray(sense * motion.rates(t)[0, column])


def _phase(D: Array, w: Array, mu: float, least: float) -> Array:
    """Impulses (normal, along) of a phase of an impact at rates ``w (2,)``, the normal one ``least`` or more."""
    for way in (0.0, 1.0, -1.0):
        # the impulse along the contact that goes with a normal one: along = shift + slope * normal
        shift, slope = (0.0, -way * mu) if way else (-w[1] / D[1, 1], -D[1, 0] / D[1, 1])
        end, rise = w[0] + D[0, 1] * shift, D[0, 0] + D[0, 1] * slope
        if end + rise * least < 0.0 and rise <= 0.0:
            continue
        normal = least if end + rise * least >= 0.0 else -end / rise
        p = np.array([normal, shift + slope * normal])
        slips = way * (w[1] + D[1] @ p) >= 0.0
        if slips if way else abs(p[1]) <= mu * normal:
            return p
    raise Stopped("an impact with friction has no impulses that agree with themselves", OUTCOMES[2])


class _Free:
    """The equations of motion at a state, nothing held: what closed limits do."""

    def __init__(self, task: Task, t: float, x: Array, dq: Array, closed: tuple[_Limit, ...]) -> None:
        found, self.here = evaluated(task, np.array([t]), x[:, None], dq[:, None])
        self.dq, self.mass, self.motions, self.closed = dq, found.columns.mass, found.columns, closed
        self.columns = np.array([limit.column for limit in closed])
        self.sign = np.array([limit.sign for limit in closed])
        self.Z = found.columns.Z[..., 0]
        G = self.sign[:, None] * self.Z[self.columns]
        # rate of a freedom for unit rates of the independent ones below which these do not move it
        self.moves = np.abs(G).max(axis=1, initial=0.0) > 1e-12
        self.impulse_to_rate = self._yielding(G)
        self.D = G @ self.impulse_to_rate
        self.w, self.w_rate = self.sign * dq[self.columns], self.sign * np.nan_to_num(found.rates.ddq[self.columns, 0])

    def _yielding(self, G: Array) -> Array:
        """Independent rates ``(n, k)`` that unit impulses along rows ``G (k, n)`` bring."""
        out, left = np.zeros(G.T.shape), np.zeros(G.T.shape)
        for i in np.flatnonzero(np.abs(G).max(axis=1, initial=0.0) > 1e-12):
            (out[:, [i]], left[:, [i]]) = accelerations(self.mass, G[i][:, None])
        if np.abs(left).max(initial=0.0) > RESPONSE.unopposed * np.abs(G).max(initial=0.0):
            raise Stopped(NO_INERTIA)
        return out

    @property
    def still(self) -> NDArray[np.bool_]:
        """Which limits are closed at rest: they would open by next to nothing before they close again."""
        return np.asarray(
            self.w**2 <= 2.0 * RESPONSE.lowest * np.maximum(np.abs(self.w_rate), RESPONSE.lowest), dtype=bool
        )

    def _least(self, D: Array, c: Array) -> Array:
        """``p >= 0`` with ``D p + c >= 0`` and ``p . (D p + c) = 0``."""
        w, U = np.linalg.eigh(D)
        kept = w > 1e-12 * w.max(initial=0.0)
        root = np.sqrt(w[kept])[:, None] * U[:, kept].T
        return np.asarray(scipy.optimize.nnls(root, -(U[:, kept].T @ c) / np.sqrt(w[kept]))[0])

    def struck(self, e: Array) -> tuple[Array, float, Array]:
        """Rates after an impact with coefficients of restitution ``e``, the kinetic energy lost, and the impulses of the limits."""
        if (~self.moves & (self.w < 0.0) & ~self.still).any():
            raise Stopped("a freedom is moved against its stop by prescribed motions alone, which no force can hold up")
        p = self._least(self.D, self.w + e * np.minimum(self.w, 0.0))
        efforts = np.zeros(len(self.dq))
        np.add.at(efforts, self.columns, self.sign * p)
        return self._after(self.impulse_to_rate @ p, efforts)

    def struck_rough(self, column: int, mu: float, e: float) -> tuple[Array, float, Array]:
        """The same of the one contact that is closed, which rubs in a freedom: by Poisson's law, compression and then expansion.

        In both phases ends ``w+ >= 0`` where the normal impulse has its least value, 0 and e times that of compression; the one along
        the contact is in Coulomb's cone with the rate at the end of the phase.
        """
        G = np.stack([self.sign[0] * self.Z[self.columns[0]], self.Z[column]])
        to_rate = self._yielding(G)
        D, w = G @ to_rate, np.array([self.w[0], self.dq[column]])
        first = _phase(D, w, mu, 0.0)
        p = first + _phase(D, w + D @ first, mu, e * first[0])
        efforts = np.zeros(len(self.dq))
        efforts[[self.columns[0], column]] = self.sign[0] * p[0], p[1]
        return self._after(to_rate @ p, efforts)

    def _after(self, change: Array, efforts: Array) -> tuple[Array, float, Array]:
        """Rates after a ``change (n,)`` of the independent ones, and the energy lost, with the impulses in the freedoms."""
        here, after = self.here, self.dq + self.Z @ change
        before, behind = (float(kinetic_energy(here, here.link_twists(dq[:, None]))[0]) for dq in (self.dq, after))
        if self.spent(efforts, after) < -RESPONSE.lost_energy * before:
            raise Stopped(
                "an impact would gain energy: contacts that are closed beside it lead it back; give them restitution=0"
            )
        return after, before - behind, efforts

    def spent(self, impulses: Array, after: Array) -> float:
        """The energy that ``impulses (F,)`` take: not what the kinetic energy loses where prescribed motions do work in the impact."""
        return float(-0.5 * impulses @ (self.dq + after))

    def blow(self, i: int, impulses: Array, spent: float) -> dict[str, Any]:
        """What an occurrence says of an impact with the ``impulses (F,)`` in freedoms, as limit ``i`` is struck; the user's units."""
        here, par = self.here, self.here.system.par
        efforts = impulses[:, None].copy()
        loads = self.motions.inertia_of(
            self.motions.accelerations(np.zeros((6, len(here.system.m.links), 1)), efforts)[0]
        )
        found = unique_reactions(ForceProblem(here, loads, efforts, np.zeros(0, dtype=np.intp), self.motions.f))[..., 0]
        found[:3] += cross(here.pair_points[..., 0], found[3:])
        # what a contact presses is among the reactions
        efforts[here.system.gaps] = 0.0
        found += here.pair_sums(here.E * efforts)[..., 0]
        unit = par.L if here.system.is_length[self.columns[i]] else par.L**2
        wrenches = zip(here.system.m.pairs, user_wrench(par, found).T, strict=True)
        return {
            "impulse": float(unit * self.sign[i] * impulses[self.columns[i]]),
            "energy_lost": float(spent * par.L**2),
            "impulses": {pair.name: wrench for pair, wrench in wrenches},
        }

    def pressing(self) -> tuple[list[int], Array]:
        """Which of the limits that are closed at rest press, so that they hold: independent ones; and the accelerations then."""
        rest = np.flatnonzero(self.still)
        p = np.zeros(len(self.w))
        if len(rest):
            p[rest] = self._least(self.D[np.ix_(rest, rest)], self.w_rate[rest])
        return np.flatnonzero(p > 0.0).tolist(), self.w_rate + self.D @ p
