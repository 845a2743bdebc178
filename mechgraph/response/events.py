"""Events of a motion: the times at which a quantity passes a value."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import scipy

from mechgraph.errors import DeclarationError
from mechgraph.model.mechanism import Mechanism
from mechgraph.result.solution import Solution

ACCURACY = 1e-12
"""Part of a step to which the time of an event is found."""


@dataclass(frozen=True)
class Event:
    """A quantity that passes a value: ``of`` is the name of a freedom, or a function of the Solution at one time that gives a number.

    ``what``: of a freedom its ``"position"``, ``"velocity"`` or ``"acceleration"``; ``direction``: 1 for rising, -1 for falling, 0 for
    both; ``terminal``: the motion ends there.
    """

    of: str | Callable[[Solution], Any]
    value: float = 0.0
    what: Literal["position", "velocity", "acceleration"] = "position"
    direction: int = 0
    terminal: bool = False
    name: str = ""

    @property
    def text(self) -> str:
        """The event in words."""
        if self.name:
            return self.name
        of = f"{self.what} of {self.of}" if isinstance(self.of, str) else getattr(self.of, "__name__", "function")
        return f"{of} passes {self.value:g}"

    def faults(self, m: Mechanism) -> list[str]:
        """What is wrong with it."""
        found = []
        if isinstance(self.of, str):
            fault = m.freedom_fault(self.of, single=True)
            found += [f"event: {fault}"] if fault else []
        elif not callable(self.of):
            found.append(f"event of {self.of!r}: expected the name of a freedom, or a function of a Solution")
        if self.what not in ("position", "velocity", "acceleration"):
            found.append(f"event {self.text}: what = {self.what!r}: expected 'position', 'velocity' or 'acceleration'")
        if self.direction not in (-1, 0, 1):
            found.append(f"event {self.text}: direction = {self.direction!r}: expected -1, 0 or 1")
        if isinstance(self.value, bool) or not isinstance(self.value, int | float) or not np.isfinite(self.value):
            found.append(f"event {self.text}: value = {self.value!r}: expected a finite number")
        return found

    def height(self, s: Solution) -> float:
        """How far the quantity is above the value, at one time."""
        if isinstance(self.of, str):
            k, j = s.mechanism.freedom(self.of)
            return float(getattr(s[s.mechanism.pairs[k].name], self.what)[..., j]) - self.value
        height = np.asarray(self.of(s), dtype=float)
        if height.size != 1 or not np.isfinite(height).all():
            raise DeclarationError("respond", [f"event {self.text}: gave {height!r}; expected one finite number"])
        return float(height.reshape(())) - self.value


@dataclass(frozen=True)
class Occurrence:
    """An event that happened at time ``t``; ``rising`` or falling."""

    event: Event
    t: float
    rising: bool

    def __str__(self) -> str:
        return f"{self.event.text} at t = {self.t:.6g}"


@dataclass
class Watch:
    """Events watched along a motion; ``at(t)`` is the Solution at one time of what was followed so far."""

    events: tuple[Event, ...]
    at: Callable[[float], Solution]
    _before: list[float] = field(default_factory=list)

    def passed(self, begin: float, end: float) -> Iterator[Occurrence]:
        """What happens in a step, in the order of time; a step in which a quantity passes its value twice is not seen."""
        if not self.events:
            return
        if not self._before:
            first = self.at(begin)
            self._before = [event.height(first) for event in self.events]
        last = self.at(end)
        after = [event.height(last) for event in self.events]
        found = []
        for event, a, b in zip(self.events, self._before, after, strict=True):
            if a != 0.0 and np.sign(a) != np.sign(b) and event.direction in (0, np.sign(b - a)):
                root = scipy.optimize.brentq(
                    lambda t, event=event: event.height(self.at(t)),
                    begin,
                    end,
                    xtol=ACCURACY * (end - begin),
                    rtol=1e-15,
                )
                found.append(Occurrence(event, float(root), bool(b > a)))
        self._before = after
        yield from sorted(found, key=lambda one: one.t)


def read_events(m: Mechanism, events: Iterable[Any]) -> tuple[tuple[Event, ...], list[str]]:
    """The events of a call, and what is wrong with them."""
    given = (events,) if isinstance(events, Event) else tuple(events)
    faults = [f"events: {one!r}: expected an mg.Event" for one in given if not isinstance(one, Event)]
    known = tuple(one for one in given if isinstance(one, Event))
    return known, faults + [fault for one in known for fault in one.faults(m)]
