"""What holds freedoms for a while: stops on which they rest, friction by which they stick.

Stops: freedoms that may not pass a limit. They strike it, rebound, rest on it and leave it (see ``impact``).

Dry friction: freedoms that rub as one (see ``rough``) slip, against the direction of their rates, or they stick, all at rest. Where they
stick they are held, until they would slip against the greatest friction at rest. Freedoms at rest that move in proportion stick and slip
together. Which do what, where rates are zero, is a complementarity problem in accelerations and friction: its states are tried, the
stillest ones first; of many, what contradicts a state is changed in it until nothing does. What begins to slip in several freedoms goes
the way in which it then accelerates. Nothing is smoothed, so that what sticks stands still.

Source: Pfeiffer and Glocker, Multibody Dynamics with Unilateral Contacts, 1996, chapters 5 and 6.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import partial
from itertools import combinations, product
from typing import Any, Protocol

import numpy as np
import scipy

from mechgraph.force.friction import Came, places_of
from mechgraph.kinematics.assembly import closed_start
from mechgraph.kinematics.prescribed import with_pairs_at
from mechgraph.kinematics.rates import Rates
from mechgraph.kinematics.state import Configuration
from mechgraph.maths.linear import rank_of, singular_values
from mechgraph.maths.se3 import Array
from mechgraph.maths.tolerances import MOTIONS, RESPONSE
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Marker, Pair
from mechgraph.model.setups import Event, Occurrence, Stop
from mechgraph.pairs.contact_types import pressing
from mechgraph.pairs.pair_type import PairType
from mechgraph.quantities import items_of, wrong
from mechgraph.response.charts import Prescribed, Task, no_force
from mechgraph.response.impact import FreeEquations, FrictionCone, Limit, evaluated
from mechgraph.response.integration import LOOKS_IN_STEP, first_below
from mechgraph.response.motion_equations import Moved, Stopped
from mechgraph.response.rough import Rough, rough_freedoms


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
    said: dict[str, Any] = {"restitution": None, "gap": 0.0, "closed": "", "hertz": None}
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


@dataclass(frozen=True, eq=False)
class _Stuck:
    """What rubs at rest and sticks and slips together: its ``columns``, and as many of the rates in which it slides as are independent,
    ``free``, of something by their places in it; those of freedoms at ``places`` (in the user's units).
    """

    of: tuple[Rough, ...]
    columns: tuple[int, ...]
    free: tuple[tuple[Rough, int], ...]
    places: tuple[float, ...]

    def slides(self, here: Configuration, rates: Array) -> Array:
        """Sliding rates ``(free, ..., T)`` at rates ``(F, ..., T)``."""
        return np.stack([one.slides(here, rates)[i] for one, i in self.free])

    def accelerates(self, at: Rates) -> Array:
        """Sliding accelerations ``(free, T)``."""
        return np.stack([one.accelerates(at)[i] for one, i in self.free])


class Moving(Protocol):
    """What is seen of a motion."""

    def motion(self, t: Array) -> tuple[Array, Array]:
        """Internal states ``(nx, T)``, rates and accelerations of all freedoms ``(2, F, T)`` at times ``(T,)``."""

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
    """What holds freedoms at a time: limits that they rest on, what sticks; ``ways (F,)`` or ``(F, T)`` in which others slip.

    ``held``: freedoms that stick and move independently, with their places, ``rolls`` what rolls; the others that stick stand still by
    these, and ``shared`` tells that there are such ones.
    """

    limits: tuple[Limit, ...] = ()
    stuck: tuple[_Stuck, ...] = ()
    ways: Array | None = None
    held: tuple[tuple[int, float], ...] = ()
    rolls: tuple[Rough, ...] = ()
    shared: bool = False

    def task(self, task: Task, at_rest: Sequence[str] = ()) -> Task:
        """What moves with these held; friction of the pairs ``at_rest`` is that at rest."""
        loads = task.loads
        if self.ways is not None:
            dry = tuple(
                replace(load, mu=load.coefficient_at_rest) if load.of in at_rest else load for load in loads.dry
            )
            stuck = tuple(
                {c: None for one in self.stuck for some in one.of if some.rolls is None for c in some.columns}
            )
            rolls = tuple(one.rolls for one in self.rolls if one.rolls is not None)
            own = replace(loads, dry=dry, ways=self.ways, stuck=stuck, rolls=rolls, shared=self.shared)
            task = replace(task, loads=own)
        if not self.columns:
            return task
        columns = np.append(task.columns, self.columns).astype(np.intp)
        places = [limit.user for limit in self.limits] + [place for _, place in self.held]
        prescribed: Any = _Held(task.prescribed, tuple(places))
        return replace(task, prescribed=prescribed, columns=columns)

    @property
    def columns(self) -> list[int]:
        """The freedoms that are held, in order: those of limits, and of what sticks."""
        return [limit.column for limit in self.limits] + [column for column, _ in self.held]

    def sticks(self, one: Rough) -> bool:
        """Whether something that rubs sticks."""
        return any(one in some.of for some in self.stuck)


@dataclass
class Rests:
    """The stops and the friction of a motion; ``task`` is what moves without them, ``holding`` what holds freedoms now."""

    task: Task
    limits: tuple[Limit, ...]
    rough: tuple[Rough, ...] = ()
    holding: _Holding = field(default_factory=_Holding)
    _leaving: Array | None = None
    """Ways in which what has stuck begins to slip."""
    _rested: tuple[Rough, ...] = ()
    """What was at rest at the last event."""

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
                    limit = Limit(stop, name, column, int(s.single_rows[column]), sign, float(value) / unit, contact)
                    limits.append(limit)
        rough = rough_freedoms(s, task.loads.dry)
        task = replace(task, loads=replace(task.loads, rough=rough))
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
        x, rates = motion.motion(looks)
        bad = np.flatnonzero(np.isnan(rates[1]).any(axis=0))
        if bad.size:
            last = begin if bad[0] == 0 else float(looks[bad[0] - 1])
            raise no_force(self.task, Came.NO_FINITE_FORCE.status, float(looks[bad[0]]), last)
        times: list[float | None] = []
        free = [limit for limit in self.limits if limit not in self.holding.limits]
        for limit in free:
            gap = limit.sign * (x[limit.row] - limit.value)
            times.append(first_below(partial(_gap, motion, limit), looks, gap, RESPONSE.touching))
        if self.holding.limits:
            push = partial(self._pressing, motion)
            if push(looks[-1:])[0] < 0.0:
                times.append(first_below(push, looks, push(looks), 0.0) or looks[0])
        met = min((one for one in times if one is not None), default=None)
        self._leaving = None
        if self.rough:
            met = self._turned(motion, looks, x, rates[0], met)
            met = self._yielded(motion, looks, x, rates[0], met, apart)
        return met

    def _pressing(self, motion: Moving, times: Array) -> Array:
        """The least of the efforts with which the held limits press: negative where one would have to pull."""
        first, held = len(self.task.columns), self.holding.limits
        sign = np.array([[one.sign] for one in held])
        return np.asarray((sign * motion.efforts_held(times)[first : first + len(held)]).min(axis=0))

    def _turned(self, motion: Moving, looks: Array, x: Array, rates: Array, met: float | None) -> float | None:
        """The first time at which what slips comes to rest, or turns back, if that is before another."""
        ways = self.holding.ways
        assert ways is not None
        noise = RESPONSE.lowest * max(np.abs(rates[list(one.columns)]).max() for one in self.rough)
        here = Configuration(self.task.system, x)
        for one in self.rough:
            columns, slides = list(one.columns), one.slides(here, rates)
            if self._is_open(one, self.holding):
                continue
            if ways[columns].any():
                # of several freedoms the way as the step begins: it may turn on and on
                way = slides[:, 0] if len(columns) > 1 else ways[columns]
                way = way / (np.linalg.norm(way) or 1.0)
                found = first_below(partial(_rate, motion, self.task, one, way), looks, way @ slides, noise)
            elif not self.holding.sticks(one) and not set(columns) <= set(self.holding.columns):
                moves = np.flatnonzero(np.abs(slides).max(axis=0) > noise)
                found = float(looks[moves[0]]) if moves.size else None
            else:
                continue
            met = found if met is None or (found is not None and found < met) else met
        return met

    def _is_open(self, one: Rough, holding: _Holding) -> bool:
        """Whether it is a contact that is open."""
        contacts = [limit for limit in self.limits if limit.contact == one.name]
        return bool(contacts) and not any(limit in holding.limits for limit in contacts)

    def _yielded(
        self, motion: Moving, looks: Array, x: Array, rates: Array, met: float | None, apart: float
    ) -> float | None:
        """The first time at which friction does not hold any more, if that is before another."""
        loads = self.task.loads
        timed = len(self.task.columns) or any(load.of_time for load in (*loads.stored, *loads.rest))
        if not self.holding.stuck or not (timed or rates.any()):
            return met
        count = int(np.ceil((looks[-1] - looks[0]) / apart)) if timed and np.isfinite(apart) else 0
        if count > len(looks):
            looks = np.linspace(looks[0], looks[-1], count + 1)
            x, (rates, _) = motion.motion(looks)
        held, _ = evaluated(self.holding.task(self.task), looks, x, rates)
        for kept in self._modes(self.holding, held):

            def height(t: Array, kept: tuple[_Stuck, ...] = kept) -> Array:
                x, (dq, _) = motion.motion(t)
                return -self._verge(self.holding, kept, t, x, dq)[0]

            beyond, _ = self._verge(self.holding, kept, looks, x, rates, held)
            found = first_below(height, looks, -beyond, MOTIONS.rounding)
            if found is not None and (met is None or found < met):
                at = np.array([found])
                x_there, (dq, _) = motion.motion(at)
                _, ways = self._verge(self.holding, kept, at, x_there, dq)
                met, self._leaving = found, ways[:, 0]
        return met

    def _motions(self, holding: _Holding, held: Moved) -> Array:
        """Rates ``(F, k, T)`` of all freedoms for unit rates of those that stick, and of what rolls, in the state in which they do."""
        columns = held.columns
        B, rolling = columns.Zp[:, len(self.task.columns) + len(holding.limits) :], columns.rolling
        if rolling is None:
            return B
        slid = rolling.held(
            -np.broadcast_to(np.eye(len(rolling.rows))[..., None], (*rolling.rows.shape[:1] * 2, B.shape[-1]))
        )[1]
        return np.concatenate([B, np.einsum("fnt,nmt->fmt", columns.Z, slid)], axis=1)

    def _modes(self, holding: _Holding, held: Moved) -> list[tuple[_Stuck, ...]]:
        """What goes on to stick in every way in which something of what sticks may slip by itself.

        Where freedoms that stick depend on each other several have to slip at once: sets that move none of the others, and are not parts of
        larger ones, are those to which all that stands still by them belongs.
        """
        sets, B = holding.stuck, self._motions(holding, held)[..., :1]
        here = held.columns.here.part(np.zeros(1, dtype=np.intp))
        rows = [np.concatenate([some.slides(here, B)[..., 0] for some in one.of]) for one in sets]

        def rank(some: Sequence[int]) -> int:
            return _rank([rows[i] for i in some])

        every = range(len(sets))
        # sets of which all parts are looked at
        if len(sets) > 8 or rank(every) == sum(rank([i]) for i in every):
            return [tuple(sets[j] for j in every if j != i) for i in every if rank([i])]
        found: list[set[int]] = []
        for count in reversed(every):
            for kept in combinations(every, count):
                r = rank(kept)
                closed = {i for i in every if rank([*kept, i]) == r}
                if r < B.shape[1] and not any(closed <= other for other in found):
                    found.append(closed)
        return [tuple(sets[i] for i in sorted(kept)) for kept in found]

    def _verge(
        self, holding: _Holding, kept: Sequence[_Stuck], t: Array, x: Array, dq: Array, held: Moved | None = None
    ) -> tuple[Array, Array]:
        """The acceleration ``(T,)``, over the largest there, with which what is not ``kept`` would slip against friction at rest, and the
        ways ``(F, T)``; minus infinity where it jams.

        It would slip against the friction that holds it. Of a contact that opens, which may have no such state, the effort beyond that of
        friction, over its greatest one at rest. ``held``: the state in which all sticks, if it is known.
        """
        held = evaluated(holding.task(self.task), t, x, dq)[0] if held is None else held
        first, here = len(self.task.columns), held.columns.here
        efforts, B = held.held[first:], self._motions(holding, held)
        freed = [one for some in holding.stuck if some not in kept for one in some.of]
        columns = [c for one in freed for c in one.columns]
        slides = np.concatenate([one.slides(here, B) for one in freed])
        fixed = [one.slides(here, B) for some in kept for one in some.of]
        still = np.concatenate(fixed) if fixed else np.zeros((0, *B.shape[1:]))
        weights, ways = [w for one in freed for w in one.weights], np.zeros((len(dq), len(t)))
        for i in range(len(t)):
            N = _null(still[..., i])
            moves = slides[..., i] @ N
            c = np.linalg.lstsq((moves.T * weights) @ moves, -(N.T @ efforts[len(holding.limits) :, i]), rcond=None)[0]
            ways[columns, i] = B[columns, :, i] @ N @ c
        size = np.abs(ways).max(axis=0)
        ways /= np.where(size > 0.0, size, 1.0)
        presses = [i for i, limit in enumerate(holding.limits) if limit.contact == freed[0].name]
        alone = [len(holding.limits) + i for i, (column, _) in enumerate(holding.held) if column in columns]
        if freed[0].rolls is not None:
            before = [one.name for one in holding.rolls].index(freed[0].name) if freed[0] in holding.rolls else 0
            begin = len(holding.limits) + len(holding.held) + sum(len(one.weights) for one in holding.rolls[:before])
            alone = list(range(begin, begin + len(freed[0].weights)))
        if presses and len(freed) == 1 and len(alone) == len(freed[0].weights):
            normal = holding.limits[presses[0]].sign * efforts[presses[0]]
            rubs = [load for load in self.task.loads.dry if load.of == freed[0].name]
            most = sum(load.coefficient_at_rest * (normal + load.preload / self.task.system.par.L) for load in rubs)
            beyond = np.sqrt((efforts[alone] ** 2).sum(axis=0)) - most
            return np.asarray(beyond / (np.abs(efforts).sum(axis=0) + 1e-300)), ways
        bare, one = replace(holding, stuck=(), held=(), rolls=(), shared=False), np.zeros(1, dtype=np.intp)
        task = self._independent(bare, here.part(one), B[..., :1], kept, beside=False)
        assert task.ways is not None
        loads = replace(self.task.loads, ways=task.ways).followed(here, dq)
        found, _ = evaluated(replace(task, ways=loads + ways).task(self.task, [one.name for one in freed]), t, x, dq)
        assert found.rubs is not None
        none = np.zeros((6, len(self.task.system.m.links), len(t)))
        slows = (found.columns.Z * found.columns.accelerations(none, found.rubs.efforts)[0]).sum(axis=1)
        largest = np.abs(slows).max(axis=0) + np.abs(found.rates.ddq).max(axis=0) + 1e-300
        towards = sum((one.slides(here, ways) * one.accelerates(found.rates)).sum(axis=0) for one in freed)
        return np.nan_to_num(towards / largest, nan=-np.inf), ways

    # --- at an event -----------------------------------------------------------------------------------------------------

    def after(self, t: float, x: Array, dq: Array) -> tuple[Array, Array, float, list[Occurrence]]:
        """Rates after a time ``t`` at which something is met or left; ``holding`` is what holds freedoms afterwards.

        Also what impacts take, none of friction, and the work done ``(3,)``, the longest first step from here, and what happened.
        """
        closed = tuple(one for one in self.limits if one.sign * (x[one.row] - one.value) <= RESPONSE.touching)
        was, after, first = self.holding, dq, np.inf
        blow: dict[Limit, dict[str, Any]] = {}
        lost = spent = 0.0
        resting: tuple[Limit, ...] = ()
        pressing: tuple[Limit, ...] = ()
        if closed:
            task = _Holding(ways=self._ways(dq)).task(self.task)
            before = FreeEquations(task, t, x, dq, closed)
            e = np.array([limit.stop.restitution for limit in closed])
            cones = self._cones(closed)
            strike = (lambda e: before.struck_rough(e, cones)) if cones and before.hit.any() else before.struck
            after, lost, p = strike(e)
            free = FreeEquations(task, t, x, after, closed)
            if (free.still & (free.w > 0.0)).any():
                after, lost, p = strike(np.where(free.still, 0.0, e))
                free = FreeEquations(task, t, x, after, closed)
            which, w_rate = free.pressing()
            pressing = tuple(closed[i] for i in which)
            resting = tuple(closed[i] for i in np.flatnonzero(free.still & free.moves))
            hops = 2.0 * free.w / np.where((w_rate < 0.0) & ~free.still & (free.w > 0.0), -w_rate, np.inf)
            first = float(hops[hops > 0.0].min(initial=np.inf)) / 2
            spent = before.spent(p, after)
            blow = {closed[i]: before.blow(i, p, spent) for i in np.flatnonzero(before.hit).tolist()}
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
        return after, np.array([spent, 0.0, -lost]), first, [*found, *self._rubbing(t, x, was)]

    def _cones(self, closed: Sequence[Limit]) -> list[FrictionCone]:
        """The friction of what is closed."""
        by_name = {one.name: one for one in self.rough}
        mu = {load.of: load.mu for load in self.task.loads.dry}
        return [
            FrictionCone(i, by_name[one.contact], mu[one.contact])
            for i, one in enumerate(closed)
            if one.contact in by_name
        ]

    def _ways(self, dq: Array) -> Array | None:
        """The ways ``(F,)`` of what rubs and moves; None where nothing rubs."""
        if not self.rough:
            return None
        ways = np.zeros(len(dq))
        for columns in (list(one.columns) for one in self.rough):
            ways[columns] = np.sign(dq[columns]) if len(columns) == 1 else dq[columns]
        return ways

    def _rubbing(self, t: float, x: Array, was: _Holding) -> Iterator[Occurrence]:
        """What became of what rubs; what is struck back does not count as reversed."""
        if was.ways is None or self.holding.ways is None:
            return
        names = self.task.system.m.freedom_names()
        here = Configuration(self.task.system, x[:, None])
        for one in self.rough:
            before, now = (one.slides(here, ways[:, None])[:, 0] for ways in (was.ways, self.holding.ways))
            sticks, stuck = self.holding.sticks(one), was.sticks(one)
            turned = one in self._rested and float(before @ now) < 0.0
            what = (
                "sticks" if sticks and not stuck else "slips" if stuck and now.any() else "reverses" if turned else ""
            )
            if what:
                freedom = Event(names[one.columns[0]], what="velocity", name=f"{one.name} {what}")
                yield Occurrence(freedom, t, bool(now.sum() > before.sum()))

    def _settled(self, t: float, x: Array, dq: Array, resting: tuple[Limit, ...]) -> tuple[_Holding, Array]:
        """What holds freedoms from a time on, and the rates then: the first state that agrees with itself, the stillest ones first."""
        ways = self._ways(dq)
        assert ways is not None
        found, here = evaluated(_Holding(ways=ways).task(self.task), np.array([t]), x[:, None], dq[:, None])
        Z, size = found.columns.Z, float(np.nan_to_num(np.abs(found.rates.ddq)).max(initial=0.0))
        slow = []
        for one in self.rough:
            columns = list(one.columns)
            # rates that would end within the square of what counts as rest on a stop, of several freedoms, which pass zero at a distance,
            # within that
            lowest = RESPONSE.lowest ** (2 if len(columns) == 1 else 1)
            rates = dq[:, None]
            if not one.rests(here, rates)[0] and (one.slides(here, rates) ** 2).max() > 2.0 * lowest * size:
                continue
            ways[columns] = 0.0
            if np.abs(one.slides(here, Z)).max(initial=0.0) > MOTIONS.still:
                slow.append(one)
            elif np.abs(one.accelerates(found.rates)).max() > MOTIONS.still * size:
                ways[columns] = found.rates.ddq[columns, 0]
        self._rested = tuple(slow)
        sets = self._together(here, Z, slow, x)
        acts = found.rubs is None or not found.rubs.outcome[0]
        if acts and not sets and not resting:
            return _Holding(ways=ways), found.rates.dq[:, 0]
        # what is at rest is so exactly
        still = self._independent(_Holding(ways=ways), here, Z, sets)
        dq = evaluated(still.task(self.task), np.array([t]), x[:, None], dq[:, None])[0].rates.dq[:, 0]
        at, why = _Instant(here, Z, sets, resting, size, np.array([t]), x[:, None], dq[:, None]), 0
        # states that are tried one after the other: 3^4, with as many stops
        few = len(sets) <= 4 and len(resting) <= 6
        options = [self._options(here, one) for one in sets]
        states = (
            _State(ways, holds) for ways in product(*options) for holds in product((True, False), repeat=len(resting))
        )
        tries = iter(sorted(states, key=lambda one: one.motion)) if few else iter(())
        state = next(tries) if few else _State(tuple(some[0] for some in options), (True,) * len(resting))
        for count in range(81 * 64 if few else 50 * (len(sets) + len(resting))):
            holding, found = self._tried(ways, state, at)
            if found.rubs is not None and found.rubs.outcome[0]:
                why, better = int(found.rubs.outcome[0]), None
            else:
                better = self._amiss(state, holding, found, at)
                if better is None:
                    self._painleve(holding, resting, t, x, dq, agrees=True)
                    return holding, found.rates.dq[:, 0]
            # of many all that is amiss is changed at once, later on the first of it, so that it does not go in circles
            after = next(tries, None) if few else better if better is None or count < 8 else state.first_of(better)
            if after is None:
                break
            state = after
        self._painleve(_Holding(resting, (), ways), resting, t, x, dq, agrees=False)
        raise no_force(self.task, Came(why or Came.NO_FINITE_FORCE).status, t)

    def _tried(self, ways: Array, state: _State, at: _Instant) -> tuple[_Holding, Moved]:
        """A state, with the ways of what moves already, and the accelerations in it."""
        limits = tuple(one for one, holds in zip(at.resting, state.holds, strict=True) if holds)
        sticks = [one for one, way in zip(at.sets, state.ways, strict=True) if not way]
        holding = self._independent(_Holding(limits, ways=ways.copy()), at.here, at.Z, sticks)
        assert holding.ways is not None
        begin: list[_Stuck] = []
        for one, way in zip(at.sets, state.ways, strict=True):
            columns = list(one.columns)
            if way and self._leaves(one):
                assert self._leaving is not None
                holding.ways[columns] = self._leaving[columns]
            elif way and len(one.free) == 1:
                holding.ways[columns] = way * at.motion(one)[:, 0]
            elif way:
                begin.append(one)
        if begin:
            holding.ways[:] = self._begun(holding, begin, at)
        return holding, at.moved(holding.task(self.task))

    def _begun(self, holding: _Holding, begin: Sequence[_Stuck], at: _Instant) -> Array:
        """The ways with those in which something slips in several freedoms from rest: along the accelerations that they lead to."""
        ends = np.cumsum([0, *(len(one.free) for one in begin)])
        assert holding.ways is not None
        ways = holding.ways

        def put(d: Array) -> Array:
            out = ways.copy()
            for one, i, j in zip(begin, ends[:-1], ends[1:], strict=True):
                out[list(one.columns)] = at.motion(one) @ d[i:j]
            return out

        def along(d: Array) -> Array:
            rates = at.moved(replace(holding, ways=put(d)).task(self.task)).rates
            parts = [np.nan_to_num(one.accelerates(rates)[:, 0]) for one in begin]
            return np.concatenate([part / (np.linalg.norm(part) or 1.0) for part in parts])

        def off(d: Array) -> Array:
            return d - along(d)

        found = scipy.optimize.root(off, along(np.zeros(ends[-1])), tol=1e-13)
        return put(along(np.asarray(found.x)))

    def _amiss(self, state: _State, holding: _Holding, found: Moved, at: _Instant) -> _State | None:
        """None where what slips goes on, what presses does so, what is free leaves, and what sticks would not slip; otherwise the state
        with all of that changed that is amiss.
        """
        a, slack = found.rates.ddq[:, 0], MOTIONS.still * at.size
        ways, holds = list(state.ways), list(state.holds)
        assert holding.ways is not None
        for i, (one, way) in enumerate(zip(at.sets, state.ways, strict=True)):
            least, slips = -slack if self._leaves(one) else slack, one.slides(at.here, holding.ways[:, None])[:, 0]
            if way and not slips @ one.accelerates(found.rates)[:, 0] >= least * np.linalg.norm(slips):
                ways[i] = 0.0
        first = len(self.task.columns)
        efforts = found.held[first:, 0]
        strong = MOTIONS.still * float(np.abs(efforts).max(initial=0.0))
        pushes = iter(
            one.sign * effort >= -strong
            for one, effort in zip(holding.limits, efforts[: len(holding.limits)], strict=True)
        )
        for i, limit in enumerate(at.resting):
            holds[i] = next(pushes) if state.holds[i] else not limit.sign * a[limit.column] >= -slack
        for kept in self._modes(holding, found) if holding.held or holding.rolls else ():
            beyond, slips = self._verge(holding, kept, at.t, at.x, at.dq, found)
            if beyond[0] > MOTIONS.still:
                for i, some in enumerate(at.sets):
                    way = some.slides(at.here, slips)[0, 0]
                    if not state.ways[i] and slips[list(some.columns)].any():
                        ways[i] = 1.0 if len(some.free) > 1 else float(np.sign(way))
        better = _State(tuple(ways), tuple(holds))
        return None if better == state else better

    def _painleve(
        self, holding: _Holding, resting: Sequence[Limit], t: float, x: Array, dq: Array, *, agrees: bool
    ) -> None:
        """Stop where a contact that slips has no normal force N >= 0, or two: its normal acceleration is b + p N with p < 0."""
        slips = [one.name for one in self.rough if holding.ways is not None and holding.ways[list(one.columns)].any()]
        for limit in resting:
            if limit.contact not in slips:
                continue
            b, p = self._normal_law(holding, limit, t, x, dq)
            if p >= 0.0 or agrees != (b > 0.0):
                continue
            size = self.task.system.par.L
            law = f"contact {limit.contact} at t = {t:.6g}: its normal acceleration is b + p N with b = {b * size:.6g}, p = {p:.6g}"
            if agrees:
                raise Stopped(f"{law}: it may press with N = -b / p, or leave (Painleve)", Came.SEVERAL.status)
            raise Stopped(f"{law}: no N >= 0 holds it up (Painleve)", Came.NO_FINITE_FORCE.status)

    def _normal_law(self, holding: _Holding, limit: Limit, t: float, x: Array, dq: Array) -> tuple[float, float]:
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
        for place in places_of(here, task.loads.directions(here, dq[:, None]), press, rubs):
            efforts[mine] += np.einsum("cft,ct->ft", here.S[:, mine], place.D)
        a, _ = found.columns.accelerations(np.zeros((6, len(s.m.links), 1)), efforts)
        return float(limit.sign * found.rates.ddq[column, 0]), float(limit.sign * (found.columns.Z[column] * a).sum())

    def _leaves(self, one: _Stuck) -> bool:
        """Whether it has just begun to slip."""
        return self._leaving is not None and bool(self._leaving[list(one.columns)].any())

    def _options(self, here: Configuration, one: _Stuck) -> tuple[float, ...]:
        """To stick, or to slip, of one freedom one way or the other; what has just begun to slip goes on."""
        if self._leaves(one):
            assert self._leaving is not None
            return (float(np.sign(one.slides(here, self._leaving[:, None])[0, 0])) if len(one.free) == 1 else 1.0,)
        return (0.0, 1.0, -1.0) if len(one.free) == 1 else (0.0, 1.0)

    def _together(self, here: Configuration, Z: Array, slow: Sequence[Rough], x: Array) -> list[_Stuck]:
        """What is at rest, that of one freedom which moves in proportion as one that sticks."""
        s, out, left = self.task.system, [], list(slow)
        while left:
            rows = [one.slides(here, Z)[..., 0] for one in left]
            single = _rank(rows[:1]) == 1
            mine = [
                one
                for one, own in zip(left, rows, strict=True)
                if one is left[0] or (single and _rank([rows[0], own]) == 1)
            ]
            free: list[int] = []
            for i in range(len(rows[0])):
                if _rank([rows[0][[*free, i]]]) > len(free):
                    free.append(i)
            first, places = left[0], [0.0] * len(free)
            for n, i in enumerate(free if first.rolls is None else ()):
                c = first.columns[i]
                row = s.single_rows[c]
                places[n] = float(x[row]) * (s.par.L if s.is_length[c] else 1.0) if row >= 0 else 0.0
            columns = dict.fromkeys(column for one in mine for column in one.columns)
            out.append(_Stuck(tuple(mine), tuple(columns), tuple((first, i) for i in free), tuple(places)))
            left = [one for one in left if one not in mine]
        return out

    def _independent(
        self, holding: _Holding, here: Configuration, Z: Array, sets: Sequence[_Stuck], *, beside: bool = True
    ) -> _Holding:
        """The state in which sets stick, of which no contact is open: as many of their freedoms are held as move, ``beside`` those of
        limits.
        """
        used = [Z[limit.column, :, 0] for limit in holding.limits] if beside else []
        stuck, held, rolls, shared = [], [], [], False
        for one in sets:
            closed = tuple(some for some in one.of if not self._is_open(some, holding))
            if not closed:
                continue
            columns = dict.fromkeys(column for some in closed for column in some.columns)
            free = one.free if one.free[0][0] in closed else ((closed[0], 0),)
            stuck.append(replace(one, of=closed, columns=tuple(columns), free=free))
            for (some, i), place in zip(free, one.places, strict=True):
                row = some.slides(here, Z)[i, :, 0]
                if rank_of(singular_values(np.stack([*used, row])), MOTIONS.still) == len(used):
                    shared = True
                    continue
                used.append(row)
                if some.rolls is None:
                    held.append((some.columns[i], place))
                elif some not in rolls:
                    rolls.append(some)
            taken = {column for column, _ in held}
            shared |= any(
                not taken >= set(some.columns) if some.rolls is None else some not in rolls for some in closed
            )
        return replace(
            holding, stuck=tuple(stuck), held=tuple(held), rolls=tuple(rolls), shared=holding.shared or shared
        )


@dataclass(frozen=True)
class _State:
    """For every set at rest the way in which it slips, 0 where it sticks; for every limit that is rested on whether it holds."""

    ways: tuple[float, ...]
    holds: tuple[bool, ...]

    @property
    def motion(self) -> int:
        """How much moves in it."""
        return int(sum(map(abs, self.ways))) + self.holds.count(False)

    def first_of(self, better: _State) -> _State:
        """The state with the first of the changes to another one."""
        values, others = [*self.ways, *self.holds], [*better.ways, *better.holds]
        i = next(i for i, (value, other) in enumerate(zip(values, others, strict=True)) if value != other)
        values[i] = others[i]
        n = len(self.ways)
        return _State(tuple(map(float, values[:n])), tuple(map(bool, values[n:])))


@dataclass(frozen=True)
class _Instant:
    """Where a state is looked for: the place, the motions ``Z (F, n, 1)`` with nothing held, what is at rest, limits that are rested on,
    the size of accelerations, time ``(1,)``, state ``(nx, 1)`` and rates ``(F, 1)``.
    """

    here: Configuration
    Z: Array
    sets: Sequence[_Stuck]
    resting: Sequence[Limit]
    size: float
    t: Array
    x: Array
    dq: Array

    def motion(self, one: _Stuck) -> Array:
        """Rates ``(columns, k)`` of a set for unit rates of those of its freedoms that move independently."""
        return np.asarray(self.Z[list(one.columns), :, 0] @ np.linalg.pinv(one.slides(self.here, self.Z)[..., 0]))

    def moved(self, task: Task) -> Moved:
        """Accelerations of a task there."""
        return evaluated(task, self.t, self.x, self.dq)[0]


def _rank(parts: Sequence[Array]) -> int:
    """The number of independent motions of freedoms; those in proportion are one."""
    rows = np.concatenate(parts) if parts else np.zeros((0, 1))
    size = np.linalg.norm(rows, axis=1)
    moves = size > MOTIONS.still
    return rank_of(singular_values(rows[moves] / size[moves, None]), MOTIONS.proportional) if moves.any() else 0


def _null(A: Array) -> Array:
    """Orthonormal columns for which rows ``A (m, n)``, which may depend on each other, are zero."""
    size = np.linalg.norm(A, axis=1)
    rows = A[size > MOTIONS.still] / size[size > MOTIONS.still, None]
    return np.asarray(scipy.linalg.null_space(rows, MOTIONS.proportional)) if len(rows) else np.eye(A.shape[1])


def _gap(motion: Moving, limit: Limit, t: Array) -> Array:
    return np.asarray(limit.sign * (motion.motion(t)[0][limit.row] - limit.value))


def _rate(motion: Moving, task: Task, one: Rough, way: Array, t: Array) -> Array:
    x, rates = motion.motion(t)
    return np.asarray(way @ one.slides(Configuration(task.system, x), rates[0]))
