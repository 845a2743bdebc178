"""Events of a motion: the times at which a quantity passes a value."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Protocol

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import items_of
from mechgraph.model.event import WHATS, Event
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import real_array, shown, wrong
from mechgraph.response.chart import Stopped, stopping
from mechgraph.result.solution import Solution

ACCURACY = 1e-12
"""Part of a step to which the time of an event is found."""
LOOKS = 8
"""Parts of a step at whose ends freedoms are looked at, so that one which passes its value and comes back is seen."""


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

    def response(self, t: float) -> Solution:
        """Everything at one time."""


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
            t = _looks(event, begin, end)
            known = [self._before[which]] if which in self._before else []
            h = np.concatenate([known, _heights(event, self.motion, t[len(known) :])])
            self._before[which] = float(h[-1])
            turns = (h[:-1] != 0.0) & (np.sign(h[:-1]) != np.sign(h[1:]))
            for i in np.flatnonzero(turns & ((event.direction == 0) | (np.sign(h[1:] - h[:-1]) == event.direction))):
                root = first_root(partial(_heights, event, self.motion), t[i], t[i + 1])
                found.append(Occurrence(event, root, bool(h[i + 1] > h[i])))
        yield from sorted(found, key=lambda one: one.t)


def _looks(event: Event, begin: float, end: float) -> Array:
    """Times of a step at which to look: a function, which needs a whole Solution, is looked at where the step ends."""
    return np.linspace(begin, end, LOOKS + 1) if isinstance(event.of, str) else np.array([begin, end])


def _heights(event: Event, motion: Watched, t: Array) -> Array:
    """How far the quantity is above the value at times ``(T,)``."""
    if isinstance(event.of, str):
        return motion.freedom(event.of, t)[WHATS.index(event.what)] - event.value
    return np.array([_height(event, motion.response(float(one))) for one in t])


def _height(event: Event, s: Solution) -> float:
    with stopping(f"event {event.text}"):
        height = real_array(event.of(s))
    if height is None or height.size != 1 or not np.isfinite(height).all():
        raise Stopped(f"event {event.text}: gave {shown(height)}; expected one finite number")
    return float(height.reshape(())) - event.value


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
