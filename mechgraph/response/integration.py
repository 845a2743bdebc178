"""Integration in time: steps and events.

A look between the ends of a step at what tables and functions do: a pulse between two evaluations leaves no trace in its error.

Over a step of length ``h`` in which the motion is followed to a tolerance, a force along it is close to the polynomial of degree 15
through its values at Chebyshev points. Where it differs somewhere by an acceleration ``e``, the step may miss a change ``h e`` of a
rate; it is refused where that is far above the tolerance.

The equations of motion integrated in time by the steppers of scipy, stage after stage; the kernel takes the steps of DOP853 along a path.

A stage is a choice of coordinates that serves for a while: a local chart of independent freedoms (``charts``), or the distance along the
only path there is (``along_path``). A segment is one accepted step: its times, its stage and the dense output of the stepper in the
stage's coordinates ``y = (u, v, lost, work)``: independent coordinates, rates of independent freedoms, what friction took and the work
done since the start.
"""

from __future__ import annotations

import ctypes
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field, replace
from functools import partial
from typing import Any, Protocol

import numpy as np
import scipy

from mechgraph.errors import DeclarationError, MechgraphWarning, counted
from mechgraph.kernel.tables import pointer
from mechgraph.maths.linear import chebyshev
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import RESPONSE
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.setups import WHATS, Event, Occurrence
from mechgraph.quantities import items_of, real_array, shown, wrong
from mechgraph.response.charts import Task
from mechgraph.response.motion_equations import ClosedChart, Stopped, stopping
from mechgraph.result.solution import Solution

POINTS_OF_STEP = 16
"""Chebyshev points of a step."""
OF_ALL = 2000
"""Places at which is looked from the beginning of a motion to its end: a pulse that takes a longer part of it is seen."""

_AT, _, _TO_SERIES = chebyshev(POINTS_OF_STEP)


def overlooked(along: Callable[[Array], Array], begin: float, end: float, apart: float, allowed: Array) -> bool:
    """Whether a step from ``begin`` to ``end`` may have missed something.

    ``along(t (T,))``: accelerations ``(k, T)`` of what need not be smooth, NaN where they are not known; ``apart``: greatest distance
    of looks; ``allowed (k,)``: changes of the rates within the tolerance.
    """
    h = end - begin
    # fewest places between them at which is looked
    places = np.linspace(-1.0, 1.0, max(64, int(np.ceil(h / apart))) + 1)
    found = along(begin + 0.5 * h * (1.0 + np.concatenate([_AT, places])))
    smooth = (found[:, :POINTS_OF_STEP] @ _TO_SERIES.T) @ np.polynomial.chebyshev.chebvander(
        places, POINTS_OF_STEP - 1
    ).T
    missed = h * np.abs(found[:, POINTS_OF_STEP:] - smooth).max(axis=1)
    # change of a rate, against the tolerance of a step, up to which a difference is left to the error estimate of the step
    return not bool((missed <= 100.0 * allowed).all())


WATCHED_IN_STEP = np.union1d(np.linspace(0.0, 1.0, 9), [1e-5, 1.0 - 1e-5])
"""Places of looks at events in a step of length 1; so close to its ends that a height that turns in the first or last part is seen to."""
LOOKS_IN_STEP = np.union1d(WATCHED_IN_STEP, 0.5 ** np.arange(4, 20))
"""Parts of a step at which stops are looked at: closely behind its beginning, where a freedom may have just left its stop."""


class Watched(Protocol):
    """What events see of a motion."""

    def freedom(self, name: str, t: Array) -> Array:
        """Position, velocity and acceleration ``(3, T)`` of a freedom at times ``(T,)``."""

    def moments(self, t: Array) -> Sequence[Solution]:
        """Everything at each of several times."""


@dataclass
class Watch:
    """Events watched along a motion, looked at in times no further ``apart``."""

    events: Sequence[Event]
    motion: Watched
    apart: float = np.inf
    _before: dict[int, float] = field(default_factory=dict)

    def passed(self, begin: float, end: float) -> Iterator[Occurrence]:
        """What happens in a step, in the order of time."""
        found = []
        for which, event in enumerate(self.events):
            height = partial(_heights, event, self.motion)
            even = np.linspace(0.0, 1.0, int(np.ceil((end - begin) / self.apart)) + 1)
            t = begin + (end - begin) * np.union1d(WATCHED_IN_STEP, even)
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
        # part of a height by which rounding changes it between looks: so far above zero it does not turn there
        if max(size[i - 1], size[i + 1]) <= (1.0 + 1e-9) * size[i]:
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


def first_below(height: Callable[[Array], Array], t: Array, h: Array, slack: float) -> float | None:
    """The first of the times at which a height has fallen below zero by more than ``slack``, if it has; where it jumps, behind the jump."""
    t, h = with_turns(height, t, h)
    deep = np.flatnonzero(h < -slack)
    if not deep.size:
        return None
    held, above = np.flatnonzero(h[: deep[0]] >= -slack), np.flatnonzero(h[: deep[0]] > 0.0)
    if not held.size:
        return float(t[0])
    # what holds without any load is never above
    level, last = (0.0, above[-1]) if above.size else (slack, held[-1])
    found, end = first_root(lambda at: height(at) + level, t[last], t[deep[0]]), float(t[deep[0]])
    # of a step: twice as far as a root is found
    behind = min(found + 2e-12 * (end - float(t[last])), end)
    return behind if float(height(np.array([behind]))[0]) < -slack else found


def read_events(m: Mechanism, events: Any, faults: list[str]) -> tuple[Event, ...]:
    """The events of a call; adds what is wrong with them to ``faults``."""
    given = (events,) if isinstance(events, Event) else items_of(events, "events", faults)
    faults += [wrong(one, "an item of events", "an mg.Event") for one in given if not isinstance(one, Event)]
    known = tuple(one for one in given if isinstance(one, Event))
    faults += [fault for one in known for fault in one.faults(m)]
    return known


_SUMS = np.eye(3)[:, 1:]
EXPLICIT = ("RK23", "RK45", "DOP853")


class Stage(Protocol):
    """Coordinates that serve for a while."""

    task: Task
    """What moves."""
    energy: float
    """An energy of the size that moves here, against which work is measured."""
    trouble: Stopped | None
    """Why the last evaluations had no value, where that is known."""

    @property
    def engine(self) -> str:
        """What evaluates the equations of motion."""

    def begin(self) -> Array:
        """The coordinates ``y`` where the stage begins; its last two, what friction took and the work, are 0."""

    def table(self, place: float | None = None) -> tuple[Any, Array, Array] | None:
        """The library of the kernel with the tables of all that ``rates`` needs (``mgk_step_along``), as far as known or, if it can be,
        to a ``place`` asked for; None where ``rates`` are to be asked.
        """

    def rates(self, t: float, y: Array) -> Array:
        """``y'``; NaN where the coordinates do not reach (the stepper takes a shorter step)."""

    @property
    def jacobian(self) -> Callable[[float, Array], Array] | None:
        """Derivatives ``(k, k)`` of ``y'`` by ``y`` for implicit steppers; None to have them found by single evaluations."""

    def unsmooth(
        self, t: float, y: Array, dense: Callable[[Any], Array]
    ) -> tuple[Callable[[Array], Array], Array] | None:
        """Accelerations ``(k, T)`` at times ``(T,)`` of a step by the loads that need not be smooth along it; NaN where not known.

        Those of ``v``, then of the prescribed freedoms; and the rates ``(k,)`` that they change at its end ``t`` with ``y``. None where all
        is smooth.
        """

    def astray(self, t: float, y: Array, begin: float, dense: Callable[[Any], Array], allowed: Array) -> bool:
        """Whether a step to a time ``t`` with ``y`` has left the motion further than ``allowed (k,)``, where the stage knows."""

    def accepted(self, t: float, y: Array) -> bool:
        """Keep what is known at the end of an accepted step; whether the stage serves on."""

    def following(self, t: float, y: Array) -> Stage:
        """The stage that takes over."""

    def task_at(self, t: Array) -> Task:
        """What moves at times ``(T,)`` of accepted steps: the task, with the ways in which freedoms slip then."""

    def states(self, t: Array, y: Array) -> tuple[ClosedChart, Array]:
        """Closed states at times ``(T,)`` of accepted steps with coordinates ``y (k, T)``, and the rates ``v (n, T)`` of the columns that
        their factors hold fixed.
        """

    def by_kernel(self, t: Array, y: Array) -> Array | None:
        """States, rates and accelerations ``(nx + 2 F, T)`` at such places by the kernel; None where it does not serve."""


@dataclass(frozen=True)
class StepPolynomial:
    """The polynomial of DOP853 over a step from ``y (k,)`` at a time ``begin`` on, with coefficients ``F (7, k)``."""

    begin: float
    length: float
    y: Array
    F: Array

    def __call__(self, t: Any) -> Array:
        """``y (k, ...)`` at times."""
        x = ((np.asarray(t) - self.begin) / self.length)[..., None]
        out = np.zeros_like(self.y)
        for i, f in enumerate(self.F[::-1]):
            out = (out + f) * (1.0 - x if i % 2 else x)
        return np.asarray((out + self.y).T)


class StepsInKernel:
    """The stepper DOP853 of scipy, its first step and coefficients, with steps taken by the kernel along the tables of a stage."""

    def __init__(
        self,
        stage: Stage,
        table: tuple[Any, Array, Array],
        rates: Callable[[float, Array], Array],
        t: float,
        y: Array,
        end: float,
        **how: Any,
    ) -> None:
        first = scipy.integrate.DOP853(rates, t, y, end, **how)
        parts = [getattr(first, name).ravel() for name in ("A", "B", "E3", "E5", "A_EXTRA", "D")]
        self._given = np.concatenate(parts), how["atol"]
        self._bounds = [ctypes.c_double(value) for value in (end, how["max_step"], how["rtol"])]
        self._at, self._slope = np.array([t, first.h_abs, 0.0]), first.f.copy()
        self._evaluations, self._end = np.array([first.nfev], dtype=np.intc), end
        self._stage, self._table = stage, table
        self.t, self.y, self.status = t, y, "running"

    @property
    def nfev(self) -> int:
        """Number of evaluations."""
        return int(self._evaluations[0])

    def step(self) -> str | None:
        """Take a step; why it failed."""
        y, dense, (rule, atol) = self.y.copy(), np.empty((7, len(self.y))), self._given
        found = 2
        while found == 2:
            library, pieces, about = self._table
            sizes = map(ctypes.c_int, (len(pieces), (pieces.shape[-1] - 2) // 4))
            begun = (
                *map(pointer, (pieces, about, rule)),
                *self._bounds,
                *map(pointer, (atol, self._at, y, self._slope, dense)),
            )
            found = library.mgk_step_along(*sizes, *begun, pointer(self._evaluations))
            if found == 2:
                further = self._stage.table(float(self._at[2]))
                assert further is not None
                self._table = further
        if found:
            self.status = "failed"
            return "Required step size is less than spacing between numbers."
        length = float(self._at[0]) - self.t
        self._polynomial = StepPolynomial(self.t, length, self.y, dense)
        self.t, self.y = float(self._at[0]), y
        self.status = "finished" if self.t >= self._end else "running"
        return None

    def dense_output(self) -> StepPolynomial:
        """The polynomial over the last step."""
        return self._polynomial


@dataclass(frozen=True)
class StepSpan:
    """One accepted step from ``begin`` to ``end``; ``before`` the stage began so much was lost in impacts and in friction, and so much work
    done.
    """

    begin: float
    end: float
    stage: Stage
    dense: Callable[[Any], Array]
    before: Array


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
    done: Array = field(default_factory=lambda: np.zeros(3))
    """Lost in impacts and in friction, and work done, since the start."""
    work: Count = field(default_factory=Count)
    _told: bool = False

    def run(self, stage: Stage, begin: float, end: float, first: float | None = None) -> Iterator[StepSpan]:
        """Follow the motion from a stage, behind what was followed before; yields every accepted step. ``first``: longest first step.

        Raises
        ------
        Stopped
            where steps become shorter than rounding.
        """
        t, h, y, before = begin, first, stage.begin(), self.done
        self.work.stages += 1
        while t < end:
            goal = min((one for one in self.breaks if one > t), default=end)
            stepper, serves = None, True
            try:
                stepper = self._stepper(stage, t, y, min(goal, end), h)
                while stepper.status == "running" and serves:
                    # trial steps may be far too long; what overflows there is taken back
                    with np.errstate(over="ignore", invalid="ignore"):
                        message = stepper.step()
                    # part of the time below which a step is rounding
                    rounding = stepper.t - t <= 1e-13 * max(abs(t), abs(stepper.t))
                    known = bool(np.isfinite(stepper.y).all())
                    if known and stepper.status != "failed":
                        # evaluated at more places, which may be out of reach
                        dense = stepper.dense_output()
                        known = bool(np.isfinite(dense(0.5 * (t + stepper.t))).all())
                    if stepper.status == "failed" or (rounding and not known):
                        raise stage.trouble or Stopped(
                            f"{message or ''} Steps collapse where loads are stiff or jump, and at positions where the mechanism locks or "
                            "only links without inertia move; for stiff loads use method='Radau'".strip()
                        )
                    if not known or (not rounding and self._missed(stage, (t, y), stepper, dense)):
                        # part of a step that was refused with which the next is tried
                        h = 0.25 * (stepper.t - t)
                        break
                    self.work.steps += 1
                    self.segments.append(StepSpan(t, stepper.t, stage, dense, before))
                    # the step goes on with its length, which a multistep method finds anew, and any behind a break
                    h = None if self.method in ("BDF", "LSODA") or stepper.t == goal else stepper.t - t
                    t, y, self.done = stepper.t, stepper.y, before + _SUMS @ stepper.y[-2:]
                    self._look(end)
                    serves = stage.accepted(t, y)
                    yield self.segments[-1]
            except DeclarationError:
                # a trial state may lie outside of a table in which the motion stays
                tried = (h or goal - t) if stepper is None else stepper.t - t or getattr(stepper, "h_abs", goal - t)
                h = 0.25 * tried
                if h <= 1e-13 * max(abs(t), abs(goal)):
                    raise
            finally:
                self.work.evaluations += 0 if stepper is None else stepper.nfev
            if t < end and not serves:
                stage = stage.following(t, y)
                y, before = stage.begin(), self.done
                self.work.stages += 1

    def _stepper(self, stage: Stage, t: float, y: Array, end: float, first: float | None) -> Any:
        """A stepper from a time on to another; what jumps at a break at either end is seen as it is between them."""
        low, high = (np.nextafter(one, mid) if one in self.breaks else one for one, mid in ((t, end), (end, t)))

        def between(function: Callable[[float, Array], Array]) -> Callable[[float, Array], Array]:
            return lambda at, y: function(min(max(at, low), high), y)

        atol = np.full(len(y), self.atol)
        atol[-2:] *= stage.energy
        more: dict[str, Any] = {} if first is None else {"first_step": min(first, end - t)}
        if self.method not in EXPLICIT:
            more["jac"] = stage.jacobian and between(stage.jacobian)
        make: Any = getattr(scipy.integrate, self.method)
        if self.method == "DOP853" and (table := stage.table()) is not None:
            make = partial(StepsInKernel, stage, table)
        return make(between(stage.rates), t, y, end, rtol=self.rtol, atol=atol, max_step=self.max_step, **more)

    def _missed(self, stage: Stage, before: tuple[float, Array], stepper: Any, dense: Callable[[Any], Array]) -> bool:
        """Whether a step that the stepper has just taken may have missed what tables and functions do within it.

        It is looked at along its polynomial, and along the cubic between its ends: stages that serve the polynomial alone may lie on a hump
        that the step has missed, and bend it away.
        """
        (begin, y), end = before, stepper.t
        inside = np.nextafter(begin, end), np.nextafter(end, begin)

        def missed(along: Callable[[Any], Array]) -> bool | None:
            found = stage.unsmooth(end, stepper.y, along)
            return found and overlooked(found[0], *inside, self.apart, self.rtol * np.abs(found[1]) + self.atol)

        if stage.astray(end, stepper.y, begin, dense, self.rtol * np.abs(stepper.y) + self.atol):
            return True
        if (seen := missed(dense)) is not False:
            return bool(seen)
        slopes = np.stack([stage.rates(*one) for one in (before, (end, stepper.y))])
        if not np.isfinite(slopes).all():
            return True
        cubic = scipy.interpolate.CubicHermiteSpline((begin, end), (y, stepper.y), slopes, axis=0)
        return bool(missed(lambda t: cubic(t).T))

    def _look(self, end: float) -> None:
        """Say where steps have become so short that a long wait is certain; give up where there is no end."""
        if self.work.steps % RESPONSE.look:
            return
        t = self.segments[-1].end
        left = (end - t) * RESPONSE.look / (t - self.segments[-RESPONSE.look].begin)
        stiff = (
            "where loads are stiff, method='Radau' takes far fewer"
            if self.method in EXPLICIT
            else "something swings or jumps that fast; damp it, hold it, or ask for a shorter time"
        )
        message = (
            f"at the length of the last {RESPONSE.look} steps of {self.method}, some {left:.0e} more lead to t = {end:g}; {stiff}. "
            "Declare dry friction with mg.Friction; smooth other loads that jump"
        )
        # steps to come from which on the motion is given up: all are kept, some kilobytes each
        if left > 1e6:
            raise Stopped(message)
        # steps to come from which on the user is told: minutes
        if left > 100_000 and not self._told:
            self._told = True
            warnings.warn(f"{message}. An interrupt keeps what there is", MechgraphWarning, stacklevel=2)

    def cut(self, t: float) -> None:
        """End the last step at a time within it."""
        last = self.segments[-1]
        self.segments[-1] = replace(last, end=t)
        self.done = last.before + _SUMS @ last.dense(t)[-2:]

    def at(self, t: Array) -> Iterator[tuple[Index, Stage, Array, Array]]:
        """Times ``(T,)`` by stage: their places, the stage, coordinates ``y (k, n)`` and what was lost and done ``(3, n)``."""
        ends = np.array([segment.end for segment in self.segments])
        step = np.minimum(np.searchsorted(ends, t), len(ends) - 1)
        of = np.array([id(self.segments[i].stage) for i in step])
        for stage in dict.fromkeys(of.tolist()):
            places = np.flatnonzero(of == stage)
            first = self.segments[int(step[places[0]])]
            y, done = np.empty((len(first.stage.begin()), len(places))), np.empty((3, len(places)))
            for i in np.unique(step[places]).tolist():
                segment, mine = self.segments[i], step[places] == i
                y[:, mine] = segment.dense(t[places[mine]])
                done[:, mine] = segment.before[:, None] + _SUMS @ y[-2:, mine]
            yield places, first.stage, y, done
