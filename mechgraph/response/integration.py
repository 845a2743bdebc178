"""Integration in time: steps, events, stops.

A look between the ends of a step at what depends on time by itself: a pulse between two evaluations leaves no trace in its error.

Over a step of length ``h`` in which the motion is followed to a tolerance, a force of time is close to the polynomial of degree 15 through
its values at Chebyshev points, all else held as it is where the step ends. Where it differs somewhere by an acceleration ``e``, the
step may miss a change ``h e`` of a rate; it is refused where that is far above the tolerance.

The equations of motion integrated in time by the steppers of scipy, stage after stage.

A stage is a choice of coordinates that serves for a while: a local chart of independent freedoms (``charts``), or the distance along the
only path there is (``along_path``). A segment is one accepted step: its times, its stage and the dense output of the stepper in the
stage's coordinates ``y = (u, v, work)``: independent coordinates, rates of independent freedoms, work done since the start.

Stops: freedoms that may not pass a limit. They strike it, rebound, rest on it and leave it.

At an impact with stops ``i`` closing at the rates ``w_i = g_i . v`` the impulses ``p_i >= 0`` are those of Newton's law of restitution,

    v+ = v + M^-1 G^T p,   w+ + e w >= 0,   p . (w+ + e w) = 0,

with ``G`` the rows ``g_i`` of independent rates. Stops that are closed at rest hold as long as they press: ``f >= 0``, ``G v' >= 0``,
``f . G v' = 0``. Both are linear complementarity problems of a positive semidefinite matrix ``G M^-1 G^T``, solved as least squares with
``p >= 0``. Source: Pfeiffer and Glocker, Multibody Dynamics with Unilateral Contacts, 1996, chapters 5 and 6.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.errors import MechgraphWarning, counted
from mechgraph.force.loads import kinetic_energy
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import RESPONSE
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.response_setup import WHATS, Event, Stop
from mechgraph.quantities import items_of, real_array, shown, wrong
from mechgraph.response.charts import Prescribed, Task
from mechgraph.response.motion_equations import NO_INERTIA, ClosedChart, Stopped, accelerations, moved, stopping
from mechgraph.result.solution import Solution

POINTS_OF_STEP = 16
"""Chebyshev points of a step."""
OF_ALL = 2000
"""Places at which is looked from the beginning of a motion to its end: a pulse longer than this part of it is seen."""

_AT = np.cos(np.pi * (np.arange(POINTS_OF_STEP) + 0.5) / POINTS_OF_STEP)
_SERIES = np.polynomial.chebyshev.chebvander(_AT, POINTS_OF_STEP - 1) * (2.0 / POINTS_OF_STEP)
_SERIES[:, 0] *= 0.5


def overlooked(by_time: Callable[[Array], Array], begin: float, end: float, apart: float, allowed: Array) -> bool:
    """Whether a step from ``begin`` to ``end`` may have missed something.

    ``by_time(t (T,))``: accelerations ``(k, T)`` that depend on time by themselves; ``apart``: greatest distance of looks; ``allowed
    (k,)``: changes of the rates within the tolerance.
    """
    h = end - begin
    # fewest places between them at which is looked
    places = np.linspace(-1.0, 1.0, max(64, int(np.ceil(h / apart))) + 1)
    found = by_time(begin + 0.5 * h * (1.0 + np.concatenate([_AT, places])))
    smooth = (found[:, :POINTS_OF_STEP] @ _SERIES) @ np.polynomial.chebyshev.chebvander(places, POINTS_OF_STEP - 1).T
    missed = h * np.abs(found[:, POINTS_OF_STEP:] - smooth).max(axis=1)
    # change of a rate, against the tolerance of a step, up to which a difference is left to the error estimate of the step
    return bool((missed > 100.0 * allowed).any())


WATCHED_IN_STEP = np.union1d(np.linspace(0.0, 1.0, 9), [1e-5, 1.0 - 1e-5])
"""Places of looks at events in a step of length 1; so close to its ends that a height that turns in the first or last part is seen to."""
LOOKS_IN_STEP = np.union1d(WATCHED_IN_STEP, 0.5 ** np.arange(4, 20))
"""Parts of a step at which stops are looked at: closely behind its beginning, where a freedom may have just left its stop."""


@dataclass(frozen=True)
class Occurrence:
    """An event that happened at time ``t``; ``rising`` or falling."""

    event: Event
    t: float
    rising: bool

    def __str__(self) -> str:
        return f"{self.event.text} at t = {self.t:.6g}"


class Watched(Protocol):
    """What events see of a motion."""

    def freedom(self, name: str, t: Array) -> Array:
        """Position, velocity and acceleration ``(3, T)`` of a freedom at times ``(T,)``."""

    def moments(self, t: Array) -> Sequence[Solution]:
        """Everything at each of several times."""


@dataclass
class Watch:
    """Events watched along a motion."""

    events: Sequence[Event]
    motion: Watched
    _before: dict[int, float] = field(default_factory=dict)

    def passed(self, begin: float, end: float) -> Iterator[Occurrence]:
        """What happens in a step, in the order of time."""
        found = []
        for which, event in enumerate(self.events):
            height = partial(_heights, event, self.motion)
            t = begin + (end - begin) * WATCHED_IN_STEP
            known = [self._before[which]] if which in self._before else []
            h = np.concatenate([known, height(t[len(known) :])])
            self._before[which] = float(h[-1])
            t, h = with_turns(height, t, h)
            turns = (h[:-1] != 0.0) & (np.sign(h[:-1]) != np.sign(h[1:]))
            for i in np.flatnonzero(turns & ((event.direction == 0) | (np.sign(h[1:] - h[:-1]) == event.direction))):
                found.append(Occurrence(event, first_root(height, t[i], t[i + 1]), bool(h[i + 1] > h[i])))
        yield from sorted(found, key=lambda one: one.t)


def _heights(event: Event, motion: Watched, t: Array) -> Array:
    """How far the quantity is above the value at times ``(T,)``."""
    if isinstance(event.of, str):
        return motion.freedom(event.of, t)[WHATS.index(event.what)] - event.value
    return np.array([_height(event, one) for one in motion.moments(t)])


def _height(event: Event, s: Solution) -> float:
    with stopping(f"event {event.text}"):
        height = real_array(event.of(s))
    if height is None or height.size != 1 or not np.isfinite(height).all():
        raise Stopped(f"event {event.text}: gave {shown(height)}; expected one finite number")
    return float(height.reshape(())) - event.value


def with_turns(height: Callable[[Array], Array], t: Array, h: Array) -> tuple[Array, Array]:
    """Times and heights ``(T,)`` with those, where a height turns back between them, at which it has passed zero, if it has.

    Between three looks of which the middle one is nearest to zero its rate is zero somewhere: there the height is nearest.
    """
    size = np.abs(h)
    same = (np.sign(h[:-2]) == np.sign(h[1:-1])) & (np.sign(h[1:-1]) == np.sign(h[2:])) & (h[1:-1] != 0.0)
    near = np.flatnonzero(same & (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])) + 1
    times, heights = [t], [h]
    for i in near.tolist():
        # a height that does not change with its looks beside it does not turn
        if size[i] == size[i - 1] == size[i + 1]:
            continue
        side = float(np.sign(h[i]))
        # part of a step to which the place of a turn is found; the height there is found to the square of it
        found = scipy.optimize.minimize_scalar(
            lambda at, side=side: side * float(height(np.array([at]))[0]),
            bounds=(t[i - 1], t[i + 1]),
            method="bounded",
            options={"xatol": 1e-9 * (t[i + 1] - t[i - 1])},
        )
        if found.fun < 0.0:
            times.append(np.array([found.x]))
            heights.append(np.array([side * found.fun]))
    order = np.argsort(np.concatenate(times), kind="stable")
    return np.concatenate(times)[order], np.concatenate(heights)[order]


def first_root(height: Callable[[Array], Array], begin: float, end: float) -> float:
    """The time between two at which a height of opposite signs there is zero."""
    # part of a step to which the time of an event is found
    root = scipy.optimize.brentq(
        lambda t: float(height(np.array([t]))[0]), begin, end, xtol=1e-12 * (end - begin), rtol=1e-15
    )
    return float(root)


def read_events(m: Mechanism, events: Any, faults: list[str]) -> tuple[Event, ...]:
    """The events of a call; adds what is wrong with them to ``faults``."""
    given = (events,) if isinstance(events, Event) else items_of(events, "events", faults)
    faults += [wrong(one, "an item of events", "an mg.Event") for one in given if not isinstance(one, Event)]
    known = tuple(one for one in given if isinstance(one, Event))
    faults += [fault for one in known for fault in one.faults(m)]
    return known


EXPLICIT = ("RK23", "RK45", "DOP853")


class Stage(Protocol):
    """Coordinates that serve for a while."""

    task: Task
    """What moves."""
    energy: float
    """An energy of the size that moves here, against which work is measured."""

    @property
    def engine(self) -> str:
        """What evaluates the equations of motion."""

    def begin(self) -> Array:
        """The coordinates ``y`` where the stage begins; the work is 0."""

    def rates(self, t: float, y: Array) -> Array:
        """``y'``; NaN where the coordinates do not reach (the stepper takes a shorter step)."""

    @property
    def jacobian(self) -> Callable[[float, Array], Array] | None:
        """Derivatives ``(k, k)`` of ``y'`` by ``y`` for implicit steppers; None to have them found by single evaluations."""

    def by_time(self, t: float, y: Array) -> tuple[Callable[[Array], Array], Array] | None:
        """Accelerations ``(k, T)`` at times ``(T,)`` of all that depends on time by itself, the rest as it is at one time with ``y``.

        Those of ``v``, then of the prescribed freedoms; and the rates ``(k,)`` that they change. None where nothing does.
        """

    def accepted(self, t: float, y: Array) -> bool:
        """Keep what is known at the end of an accepted step; whether the stage serves on."""

    def following(self, t: float, y: Array) -> Stage:
        """The stage that takes over."""

    def states(self, t: Array, y: Array) -> tuple[ClosedChart, Array]:
        """Closed states at times ``(T,)`` of accepted steps with coordinates ``y (k, T)``, and the rates ``v (n, T)`` of the columns that
        their factors hold fixed.
        """


@dataclass(frozen=True)
class StepSpan:
    """One accepted step from ``begin`` to ``end``; ``work`` was done before the stage began."""

    begin: float
    end: float
    stage: Stage
    dense: Callable[[Any], Array]
    work: float


@dataclass
class Count:
    """How much was computed: evaluations of ``y'``, accepted steps, stages, and which ``coordinates`` they had."""

    evaluations: int = 0
    steps: int = 0
    stages: int = 0
    coordinates: str = ""

    def __str__(self) -> str:
        return ", ".join(counted(number, name) for number, name in self.counts)

    @property
    def counts(self) -> tuple[tuple[int, str], ...]:
        """Numbers, and of what."""
        stage = f"stage {self.coordinates}".strip()
        return (self.evaluations, "evaluation"), (self.steps, "step"), (self.stages, stage)


@dataclass
class Integration:
    """A motion followed by a stepper; ``run`` adds ``segments``.

    ``max_step``: longest step; ``breaks``: times at which steps end and begin anew; ``apart``: greatest distance between looks at
    what depends on time.
    """

    method: str
    rtol: float
    atol: float
    max_step: float = np.inf
    breaks: tuple[float, ...] = ()
    apart: float = np.inf
    segments: list[StepSpan] = field(default_factory=list)
    done: float = 0.0
    """Work done since the start."""
    work: Count = field(default_factory=Count)
    _told: bool = False

    def run(self, stage: Stage, begin: float, end: float, first: float | None = None) -> Iterator[StepSpan]:
        """Follow the motion from a stage, behind what was followed before; yields every accepted step. ``first``: longest first step.

        Raises
        ------
        Stopped
            where steps become shorter than rounding.
        """
        t, h, y, work = begin, first, stage.begin(), self.done
        self.work.stages += 1
        while t < end:
            goal = min((one for one in self.breaks if one > t), default=end)
            stepper = self._stepper(stage, t, y, min(goal, end), h)
            serves = True
            try:
                while stepper.status == "running" and serves:
                    # trial steps may be far too long; what overflows there is taken back
                    with np.errstate(over="ignore", invalid="ignore"):
                        message = stepper.step()
                    # part of the time below which a step is rounding
                    rounding = stepper.t - t <= 1e-13 * max(abs(t), abs(stepper.t))
                    known = bool(np.isfinite(stepper.y).all())
                    if stepper.status == "failed" or (rounding and not known):
                        raise Stopped(
                            f"{message or ''} Steps collapse where loads are stiff or jump, and at positions where the mechanism locks or "
                            "only links without inertia move; for stiff loads use method='Radau'".strip()
                        )
                    if not known or (not rounding and self._missed(stage, t, stepper)):
                        # part of a step that was refused with which the next is tried
                        h = 0.25 * (stepper.t - t)
                        break
                    self.work.steps += 1
                    self.segments.append(StepSpan(t, stepper.t, stage, stepper.dense_output(), work))
                    # the step goes on with its length, which a multistep method finds anew, and any behind a break
                    h = None if self.method in ("BDF", "LSODA") or stepper.t == goal else stepper.t - t
                    t, y, self.done = stepper.t, stepper.y, work + float(stepper.y[-1])
                    self._look(end)
                    serves = stage.accepted(t, y)
                    yield self.segments[-1]
            finally:
                self.work.evaluations += stepper.nfev
            if t < end and not serves:
                stage = stage.following(t, y)
                y, work = stage.begin(), self.done
                self.work.stages += 1

    def _stepper(self, stage: Stage, t: float, y: Array, end: float, first: float | None) -> Any:
        """A stepper from a time on to another; what jumps at a break at either end is seen as it is between them."""
        low, high = (np.nextafter(one, mid) if one in self.breaks else one for one, mid in ((t, end), (end, t)))

        def between(function: Callable[[float, Array], Array]) -> Callable[[float, Array], Array]:
            return lambda at, y: function(min(max(at, low), high), y)

        atol = np.full(len(y), self.atol)
        atol[-1] *= stage.energy
        more: dict[str, Any] = {} if first is None else {"first_step": min(first, end - t)}
        if self.method not in EXPLICIT:
            more["jac"] = stage.jacobian and between(stage.jacobian)
        make = getattr(scipy.integrate, self.method)
        return make(between(stage.rates), t, y, end, rtol=self.rtol, atol=atol, max_step=self.max_step, **more)

    def _missed(self, stage: Stage, begin: float, stepper: Any) -> bool:
        """Whether a step that the stepper has just taken may have missed what depends on time by itself."""
        end, y = stepper.t, stepper.y
        by_time = stage.by_time(end, y)
        if by_time is None:
            return False
        accelerations, rates = by_time
        inside = np.nextafter(begin, end), np.nextafter(end, begin)
        return overlooked(accelerations, *inside, self.apart, self.rtol * np.abs(rates) + self.atol)

    def _look(self, end: float) -> None:
        """Say where steps have become so short that loads are likely stiff, and a long wait certain; give up where there is no end."""
        if self.method not in EXPLICIT or self.work.steps % RESPONSE.look:
            return
        t = self.segments[-1].end
        left = (end - t) * RESPONSE.look / (t - self.segments[-RESPONSE.look].begin)
        message = (
            f"at the length of the last {RESPONSE.look} steps of {self.method}, some {left:.0e} more lead to t = {end:g}; "
            "where loads are stiff, method='Radau' takes far fewer. Smooth discontinuous loads such as dry friction"
        )
        # steps to come from which on the motion is given up: hours and days
        if left > 1e8:
            raise Stopped(message)
        # steps to come from which on the user is told: minutes
        if left > 100_000 and not self._told:
            self._told = True
            warnings.warn(f"{message}. An interrupt keeps what there is", MechgraphWarning, stacklevel=2)

    def cut(self, t: float) -> None:
        """End the last step at a time within it."""
        last = self.segments[-1]
        self.segments[-1] = replace(last, end=t)
        self.done = last.work + float(last.dense(t)[-1])

    def at(self, t: Array) -> Iterator[tuple[Index, Stage, Array, Array]]:
        """Times ``(T,)`` by stage: their places, the stage, coordinates ``y (k, n)`` and the work ``(n,)`` since the start."""
        ends = np.array([segment.end for segment in self.segments])
        step = np.minimum(np.searchsorted(ends, t), len(ends) - 1)
        of = np.array([id(self.segments[i].stage) for i in step])
        for stage in dict.fromkeys(of.tolist()):
            places = np.flatnonzero(of == stage)
            first = self.segments[int(step[places[0]])]
            y, work = np.empty((len(first.stage.begin()), len(places))), np.empty(len(places))
            for i in np.unique(step[places]).tolist():
                segment, mine = self.segments[i], step[places] == i
                y[:, mine] = segment.dense(t[places[mine]])
                work[mine] = segment.work + y[-1, mine]
            yield places, first.stage, y, work


def read_stops(m: Mechanism, stops: Any, faults: list[str]) -> tuple[Stop, ...]:
    """The stops of a call; adds what is wrong with them to ``faults``."""
    given = (stops,) if isinstance(stops, Stop) else items_of(stops, "stops", faults)
    faults += [wrong(one, "an item of stops", "an mg.Stop") for one in given if not isinstance(one, Stop)]
    known = [one for one in given if isinstance(one, Stop)]
    bad = [fault for one in known for fault in one.faults(m)]
    faults += bad
    return () if bad else tuple(known)


@dataclass(frozen=True)
class _Limit:
    """One limit of one freedom, internal units: ``sign * (q - value) >= 0``."""

    stop: Stop
    name: str
    column: int
    row: int
    sign: float
    value: float

    @property
    def user(self) -> float:
        """The limit in the user's units."""
        return float(getattr(self.stop, self.name))

    def occurrence(self, t: float, meets: bool) -> Occurrence:
        """What ``Response.events`` says of it."""
        text = f"{self.stop.freedom} {'meets' if meets else 'leaves'} its {self.name} stop"
        event = Event(self.stop.freedom, self.user, name=text)
        return Occurrence(event, t, (self.sign > 0) != meets)


class Moving(Protocol):
    """What stops see of a motion."""

    def positions(self, t: Array) -> Array:
        """Internal states ``(nx, T)`` at times ``(T,)``."""

    def rates(self, t: Array) -> Array:
        """Rates and accelerations ``(2, F, T)`` of all freedoms at times ``(T,)``."""


def _gap(motion: Moving, limit: _Limit, t: Array) -> Array:
    return np.asarray(limit.sign * (motion.positions(t)[limit.row] - limit.value))


@dataclass(frozen=True)
class _Held:
    """Prescribed freedoms with those that rest on a stop behind them (see ``Prescribed``)."""

    prescribed: Prescribed
    limits: tuple[float, ...]

    @property
    def names(self) -> tuple[str, ...]:
        return self.prescribed.names

    def at(self, t: float) -> Array:
        """Positions, velocities and accelerations ``(3, p)``."""
        still = np.zeros((3, len(self.limits)))
        still[0] = self.limits
        return np.concatenate([self.prescribed.at(t), still], axis=1)


@dataclass
class Stops:
    """The stops of a motion; ``task`` is what moves without them, ``held`` the limits that freedoms rest on."""

    task: Task
    limits: tuple[_Limit, ...]
    held: tuple[_Limit, ...] = ()

    @classmethod
    def of(cls, m: Mechanism, task: Task, stops: Iterable[Stop]) -> Stops:
        """Stops of the scaled system of a task."""
        s, limits = task.system, []
        for stop in stops:
            k, j = m.freedom(stop.freedom)
            column = int(s.first_column[k]) + j
            unit = s.par.L if s.is_length[column] else 1.0
            for name, sign in (("lower", 1.0), ("upper", -1.0)):
                value = getattr(stop, name)
                if value is not None:
                    limits.append(_Limit(stop, name, column, int(s.single_rows[column]), sign, float(value) / unit))
        return cls(task, tuple(limits))

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

    def held_task(self) -> Task:
        """The task with what rests on a stop held there."""
        if not self.held:
            return self.task
        columns = np.append(self.task.columns, [limit.column for limit in self.held]).astype(np.intp)
        held: Any = _Held(self.task.prescribed, tuple(limit.user for limit in self.held))
        return replace(self.task, prescribed=held, columns=columns)

    def met(self, motion: Moving, begin: float, end: float) -> float | None:
        """The first time in a step at which a free limit is passed, or a held one no longer presses."""
        times: list[float] = []
        looks = (
            begin + (end - begin) * LOOKS_IN_STEP[1:]
        )  # rates at the beginning are those before an impact, if there was one
        free = [limit for limit in self.limits if limit not in self.held]
        if free:
            x = motion.positions(looks)
            for limit in free:
                height = partial(_gap, motion, limit)
                t, gap = with_turns(height, looks, limit.sign * (x[limit.row] - limit.value))
                deep = np.flatnonzero(gap < -RESPONSE.touching)
                if deep.size:
                    before = np.flatnonzero(gap[: deep[0]] > 0.0)
                    times.append(first_root(height, t[before[-1]], t[deep[0]]) if before.size else looks[0])
        if self.held:
            push = partial(self._pressing, motion)
            if push(looks[-1:])[0] < 0.0:
                times.append(first_root(push, looks[0], end) if push(looks[:1])[0] > 0.0 else looks[0])
        return min(times, default=None)

    def _pressing(self, motion: Moving, times: Array) -> Array:
        """The least of the efforts with which the held limits press: negative where one would have to pull."""
        states, rates = motion.positions(times), motion.rates(times)
        out = []
        for t, x, dq in zip(times.tolist(), states.T, rates[0].T, strict=True):
            free = _Free(self.task, t, x, dq, self.held)
            out.append(float(np.linalg.lstsq(free.D, -free.w_rate, rcond=1e-12)[0].min()))
        return np.array(out)

    def after(self, t: float, x: Array, dq: Array) -> tuple[Array, float, float, list[Occurrence]]:
        """Rates after a time ``t`` at which stops are met or left; ``held`` is what rests on them afterwards.

        Also the energy that impacts take away, the longest first step from here, and what happened.
        """
        closed = tuple(one for one in self.limits if one.sign * (x[one.row] - one.value) <= RESPONSE.touching)
        if not closed:
            self.held = ()
            return dq, 0.0, np.inf, []
        before = _Free(self.task, t, x, dq, closed)
        e = np.array([limit.stop.restitution for limit in closed])
        after, lost = before.struck(e)
        free = _Free(self.task, t, x, after, closed)
        if (free.still & (free.w > 0.0)).any():
            after, lost = before.struck(np.where(free.still, 0.0, e))
            free = _Free(self.task, t, x, after, closed)
        pressing, w_rate = free.pressing()
        now = tuple(closed[i] for i in pressing)
        hops = 2.0 * free.w / np.where((w_rate < 0.0) & ~free.still & (free.w > 0.0), -w_rate, np.inf)
        hit = (before.w < 0.0) & ~before.still
        found = [
            one.occurrence(t, True) for i, one in enumerate(closed) if hit[i] or (one in now and one not in self.held)
        ]
        found += [one.occurrence(t, False) for one in self.held if one not in now]
        self.held = now
        return after, lost, float(hops[hops > 0.0].min(initial=np.inf)) / 2, found


class _Free:
    """The equations of motion at a state, nothing held: what closed limits do."""

    def __init__(self, task: Task, t: float, x: Array, dq: Array, closed: tuple[_Limit, ...]) -> None:
        self.chart = task.chart(x)
        f = self.chart.solver.factored(self.chart.start, self.chart.which)
        at = ClosedChart(self.chart.start, f, np.ones(1, dtype=bool), self.chart.held)
        p = task.prescribed_at(np.array([t]))[1:]
        found = moved(at, dq[self.chart.moving][:, None], p, task.loads, np.array([t]))
        self.dq, self.mass = dq, found.columns.mass
        self.columns = np.array([limit.column for limit in closed])
        self.sign = np.array([limit.sign for limit in closed])
        self.Z = found.columns.Z[..., 0]
        G = self.sign[:, None] * self.Z[self.columns]
        # rate of a freedom for unit rates of the independent ones below which these do not move it
        self.moves = np.abs(G).max(axis=1, initial=0.0) > 1e-12
        self.impulse_to_rate, left = np.zeros(G.T.shape), np.zeros(G.T.shape)
        for i in np.flatnonzero(self.moves):
            (self.impulse_to_rate[:, [i]], left[:, [i]]) = accelerations(self.mass, G[i][:, None])
        if np.abs(left).max(initial=0.0) > RESPONSE.unopposed * np.abs(G).max(initial=0.0):
            raise Stopped(NO_INERTIA)
        self.D = G @ self.impulse_to_rate
        self.w, self.w_rate = self.sign * dq[self.columns], self.sign * found.rates.ddq[self.columns, 0]

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

    def struck(self, e: Array) -> tuple[Array, float]:
        """Rates after an impact with coefficients of restitution ``e``, and the kinetic energy lost."""
        if (~self.moves & (self.w < 0.0) & ~self.still).any():
            raise Stopped("a freedom is moved against its stop by prescribed motions alone, which no force can hold up")
        p = self._least(self.D, self.w + e * np.minimum(self.w, 0.0))
        after = self.dq + self.Z @ (self.impulse_to_rate @ p)
        here = self.chart.start
        before, behind = (float(kinetic_energy(here, here.link_twists(dq[:, None]))[0]) for dq in (self.dq, after))
        return after, before - behind

    def pressing(self) -> tuple[list[int], Array]:
        """Which of the limits that are closed at rest press, so that they hold: independent ones; and the accelerations then."""
        rest = np.flatnonzero(self.still)
        p = np.zeros(len(self.w))
        if len(rest):
            p[rest] = self._least(self.D[np.ix_(rest, rest)], self.w_rate[rest])
        return np.flatnonzero(p > 0.0).tolist(), self.w_rate + self.D @ p
