"""Stops: freedoms that may not pass a limit. They strike it, rebound, rest on it and leave it.

At an impact with stops ``i`` closing at the rates ``w_i = g_i . v`` the impulses ``p_i >= 0`` are those of Newton's law of restitution,

    v+ = v + M^-1 G^T p,   w+ + e w >= 0,   p . (w+ + e w) = 0,

with ``G`` the rows ``g_i`` of independent rates. Stops that are closed at rest hold as long as they press: ``f >= 0``, ``G v' >= 0``,
``f . G v' = 0``. Both are linear complementarity problems of a positive semidefinite matrix ``G M^-1 G^T``, solved as least squares with
``p >= 0``. Source: Pfeiffer and Glocker, Multibody Dynamics with Unilateral Contacts, 1996, chapters 5 and 6.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.force.loads import kinetic_energy
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.response_setup import Event, Stop
from mechgraph.quantities import items_of, wrong
from mechgraph.response.chart import Closed, Stopped
from mechgraph.response.charts import Task
from mechgraph.response.events import LOOKS_IN_STEP, Occurrence, first_root, with_turns
from mechgraph.response.motion_equations import NO_INERTIA, UNOPPOSED, accelerations, moved
from mechgraph.response.prescribed import Prescribed

IMMOVABLE = 1e-12
"""Rate of a freedom for unit rates of the independent ones below which these do not move it."""
TOUCHING = 1e-9
"""Gap (radians, lengths / L) up to which a stop counts as closed."""
LOWEST = 1e-9
"""Height (radians, lengths / L) of a rebound below which the freedom rests on its stop; what it loses is of that order."""


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
            if limit.sign * (x[limit.row] - limit.value) < -TOUCHING
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
                deep = np.flatnonzero(gap < -TOUCHING)
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
        closed = tuple(one for one in self.limits if one.sign * (x[one.row] - one.value) <= TOUCHING)
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
        at = Closed(self.chart.start, f, np.ones(1, dtype=bool), self.chart.held)
        p = task.prescribed_at(np.array([t]))[1:]
        found = moved(at, dq[self.chart.moving][:, None], p, task.loads, np.array([t]))
        self.dq, self.mass = dq, found.columns.mass
        self.columns = np.array([limit.column for limit in closed])
        self.sign = np.array([limit.sign for limit in closed])
        self.Z = found.columns.Z[..., 0]
        G = self.sign[:, None] * self.Z[self.columns]
        self.moves = np.abs(G).max(axis=1, initial=0.0) > IMMOVABLE
        self.impulse_to_rate, left = np.zeros(G.T.shape), np.zeros(G.T.shape)
        for i in np.flatnonzero(self.moves):
            (self.impulse_to_rate[:, [i]], left[:, [i]]) = accelerations(self.mass, G[i][:, None])
        if np.abs(left).max(initial=0.0) > UNOPPOSED * np.abs(G).max(initial=0.0):
            raise Stopped(NO_INERTIA)
        self.D = G @ self.impulse_to_rate
        self.w, self.w_rate = self.sign * dq[self.columns], self.sign * found.rates.ddq[self.columns, 0]

    @property
    def still(self) -> NDArray[np.bool_]:
        """Which limits are closed at rest: they would open by next to nothing before they close again."""
        return np.asarray(self.w**2 <= 2.0 * LOWEST * np.maximum(np.abs(self.w_rate), LOWEST), dtype=bool)

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
