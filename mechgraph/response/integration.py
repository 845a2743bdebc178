"""The equations of motion integrated in time by the steppers of scipy, stage after stage.

A stage is a choice of coordinates that serves for a while: a local chart of independent freedoms (``charts``), or the distance along the
only path there is (``along_path``). A segment is one accepted step: its times, its stage and the dense output of the stepper in the
stage's coordinates ``y = (u, v, work)``: independent coordinates, rates of independent freedoms, work done since the start.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.closure.indexing import Index
from mechgraph.errors import MechgraphWarning, counted
from mechgraph.response.chart import Closed, Stopped
from mechgraph.response.charts import Task
from mechgraph.response.looks import SHORTER, overlooked

EXPLICIT = ("RK23", "RK45", "DOP853")
LOOK = 500
"""Steps after which the length of steps is looked at."""
TOLD_FROM = 100_000
"""Steps to come from which on the user is told: minutes."""
SHORTEST = 1e-13
"""Part of the time below which a step is rounding."""
GIVEN_UP_FROM = 1e8
"""Steps to come from which on the motion is given up: hours and days."""


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

    def states(self, t: Array, y: Array) -> tuple[Closed, Array]:
        """Closed states at times ``(T,)`` of accepted steps with coordinates ``y (k, T)``, and the rates ``v (n, T)`` of the columns that
        their factors hold fixed.
        """


@dataclass(frozen=True)
class Segment:
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
    segments: list[Segment] = field(default_factory=list)
    done: float = 0.0
    """Work done since the start."""
    work: Count = field(default_factory=Count)
    _told: bool = False

    def run(self, stage: Stage, begin: float, end: float, first: float | None = None) -> Iterator[Segment]:
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
                    rounding = stepper.t - t <= SHORTEST * max(abs(t), abs(stepper.t))
                    known = bool(np.isfinite(stepper.y).all())
                    if stepper.status == "failed" or (rounding and not known):
                        raise Stopped(
                            f"{message or ''} Steps collapse where loads are stiff or jump, and at positions where the mechanism locks or "
                            "only links without inertia move; for stiff loads use method='Radau'".strip()
                        )
                    if not known or (not rounding and self._missed(stage, t, stepper)):
                        h = SHORTER * (stepper.t - t)
                        break
                    self.work.steps += 1
                    self.segments.append(Segment(t, stepper.t, stage, stepper.dense_output(), work))
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
        if self.method not in EXPLICIT or self.work.steps % LOOK:
            return
        t = self.segments[-1].end
        left = (end - t) * LOOK / (t - self.segments[-LOOK].begin)
        message = (
            f"at the length of the last {LOOK} steps of {self.method}, some {left:.0e} more lead to t = {end:g}; where loads are stiff, "
            "method='Radau' takes far fewer. Loads that jump, as dry friction does, want to be smoothed"
        )
        if left > GIVEN_UP_FROM:
            raise Stopped(message)
        if left > TOLD_FROM and not self._told:
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
