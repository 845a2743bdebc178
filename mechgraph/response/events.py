"""Events of a motion: the times at which a quantity passes a value."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.response_setup import WHATS, Event
from mechgraph.quantities import items_of, real_array, shown, wrong
from mechgraph.response.chart import Stopped, stopping
from mechgraph.result.solution import Solution

ACCURACY = 1e-12
"""Part of a step to which the time of an event is found."""
LOOKS = 8
"""Parts of a step at whose ends a height is looked at."""
BESIDE_ENDS = 1e-5
"""Part of a step beside its ends at which is looked too, so that a height that turns in the first or last part is seen to."""
TURN_FOUND = 1e-9
"""Part of a step to which the place of a turn is found; the height there is found to the square of it."""
WATCHED_IN_STEP = np.union1d(np.linspace(0.0, 1.0, LOOKS + 1), [BESIDE_ENDS, 1.0 - BESIDE_ENDS])
"""Places of looks at events in a step of length 1."""
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
        found = scipy.optimize.minimize_scalar(
            lambda at, side=side: side * float(height(np.array([at]))[0]),
            bounds=(t[i - 1], t[i + 1]),
            method="bounded",
            options={"xatol": TURN_FOUND * (t[i + 1] - t[i - 1])},
        )
        if found.fun < 0.0:
            times.append(np.array([found.x]))
            heights.append(np.array([side * found.fun]))
    order = np.argsort(np.concatenate(times), kind="stable")
    return np.concatenate(times)[order], np.concatenate(heights)[order]


def first_root(height: Callable[[Array], Array], begin: float, end: float) -> float:
    """The time between two at which a height of opposite signs there is zero."""
    root = scipy.optimize.brentq(
        lambda t: float(height(np.array([t]))[0]), begin, end, xtol=ACCURACY * (end - begin), rtol=1e-15
    )
    return float(root)


def read_events(m: Mechanism, events: Any, faults: list[str]) -> tuple[Event, ...]:
    """The events of a call; adds what is wrong with them to ``faults``."""
    given = (events,) if isinstance(events, Event) else items_of(events, "events", faults)
    faults += [wrong(one, "an item of events", "an mg.Event") for one in given if not isinstance(one, Event)]
    known = tuple(one for one in given if isinstance(one, Event))
    faults += [fault for one in known for fault in one.faults(m)]
    return known
