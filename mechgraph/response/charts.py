"""Stages of independent freedoms, for any mobility: the loops are closed at every evaluation."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.by_kernel import COMPILED
from mechgraph.closure.driver_path import in_blocks
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.passive_motion import PassiveMotion
from mechgraph.closure.rates import Velocities
from mechgraph.determinacy.mobility import free_motion
from mechgraph.force.loads import kinetic_energy
from mechgraph.model.loads import Load
from mechgraph.response.chart import Chart, Closed, Stopped
from mechgraph.response.kernel_rates import Evaluated, KernelRates
from mechgraph.response.motion_equations import Loads, Moved, accelerations, applied, moved, positions_together
from mechgraph.response.prescribed import Prescribed

NUDGE = 1e-7
"""Part of a coordinate (or of one) by which it is changed for a derivative."""


@dataclass(frozen=True)
class Task:
    """What moves: the scaled system, its loads, the prescribed freedoms and their columns, the engine, passive motions held."""

    system: System
    loads: Loads
    prescribed: Prescribed
    columns: Index
    engine: Literal["dense", "sparse"]
    held: tuple[PassiveMotion, ...] = ()
    library: Any = None
    """The compiled kernel, where it serves."""

    def __getstate__(self) -> dict[str, Any]:
        """Without the library, a thing of this process."""
        return vars(self) | {"library": None}

    def chart(self, x: Array) -> Chart:
        """A chart laid out at a closed state ``x (nx,)``."""
        return Chart(self.system, x, self.columns, self.engine, self._held_at(x))

    def _held_at(self, x: Array) -> tuple[PassiveMotion, ...]:
        """The passive motions that are held, at a closed state."""
        if not self.held:
            return ()
        here = free_motion(self.system, x, self.columns, self.engine).passive
        found = [next((motion for motion in here if motion.links == held.links), None) for held in self.held]
        if len({motion.links for motion in self.held}) < len(found):
            raise Stopped("several passive freedoms of the same links cannot be held; give passive='free'")
        if None in found:
            raise Stopped("the passive freedoms are not those of the start here, so that they cannot be held on")
        return tuple(motion for motion in found if motion is not None)

    def prescribed_at(self, t: Array) -> Array:
        """Prescribed positions, velocities, accelerations ``(3, p, T)``, internal units."""
        if not len(self.columns):
            return np.zeros((3, 0, len(t)))
        unit = np.where(self.system.is_length[self.columns], self.system.par.L, 1.0)
        return np.stack([self.prescribed.at(float(one)) / unit for one in t], axis=-1)


@dataclass(frozen=True)
class _Known:
    """A state that was evaluated, ``(x, q', q'')`` of so many numbers, from which others are predicted."""

    t: float
    state: Array
    of_x: int
    of_dq: int

    @property
    def x(self) -> Array:
        """The position."""
        return self.state[: self.of_x]

    @property
    def dq(self) -> Array:
        """Rates."""
        return self.state[self.of_x : self.of_x + self.of_dq]

    @property
    def ddq(self) -> Array:
        """Accelerations."""
        return self.state[self.of_x + self.of_dq :]

    def ahead(self, system: System, t: Array) -> Array:
        """States at other times, to second order, ``(nx, T)``."""
        h = t - self.t
        return system.advance(self.x[:, None], self.dq[:, None] * h + 0.5 * self.ddq[:, None] * (h * h))


class ChartStage:
    """Implements ``integration.Stage`` from a closed state ``x (nx,)`` with rates ``dq (F,)`` at a time."""

    def __init__(self, task: Task, t: float, x: Array, dq: Array) -> None:
        self.task = task
        self.chart = task.chart(x)
        self.n = len(self.chart.free)
        self._first = np.concatenate([np.zeros(self.n), dq[self.chart.moving], [0.0]])
        self._sizes = len(x), len(dq)
        self._last = _Known(t, np.concatenate([x, dq, np.zeros_like(dq)]), *self._sizes)
        self._path = [self._last]
        self._of_time = tuple(load for some in (task.loads.stored, task.loads.rest) for load in some if load.of_time)
        self._kernel: KernelRates | None = None
        self.engine = task.engine if task.library is None else COMPILED
        self._shape: Callable[[], tuple[float, float]]
        found = self._found(t, self._first[:, None])
        if found is None:
            raise Stopped(
                "the loops do not close any more to where a step led, as at positions where the mechanism locks"
            )
        self._path = [self._last]
        # kinetic energy, and the work of the forces over a unit of the coordinates
        kinetic = float(kinetic_energy(found.rates.here, found.rates.V)[0])
        self.energy = kinetic + float(np.abs(found.force).sum()) or 1.0
        if task.library is not None:
            self._kernel = KernelRates(task.library, self.chart, task.loads)

    def __getstate__(self) -> dict[str, Any]:
        """What is kept of a motion is asked for its states, which need neither the kernel nor the last shape."""
        return vars(self) | {"_kernel": None, "_shape": None}

    def begin(self) -> Array:
        """See ``Stage``."""
        return self._first

    def rates(self, t: float, y: Array) -> Array:
        """See ``Stage``."""
        here = self._by_kernel(t, y)
        if here is None:
            return self._rates(t, y[:, None])[:, 0]
        return here.rates

    def _by_kernel(self, t: float, y: Array) -> Evaluated | None:
        """The same by the kernel; None where there is none, or it does not serve: numpy says what is there."""
        if self._kernel is None:
            return None
        near = self._near(t)
        found = self._kernel(near.state, t - near.t, y[:-1], self.task.prescribed_at(np.array([t]))[..., 0])
        if found is not None:
            self._last = _Known(t, found.state, *self._sizes)
            self._y, self._shape = y, lambda: (found.steepness, found.condition)
        return found

    def _near(self, t: float) -> _Known:
        """The known state next to a time."""
        return self._last if abs(self._last.t - t) < abs(self._path[-1].t - t) else self._path[-1]

    def _rates(self, t: float, y: Array) -> Array:
        """``y' (k, T)`` at one time and several ``y (k, T)``; NaN where no closed states are found near the last ones."""
        found = self._found(t, y)
        if found is None:
            return np.full(y.shape, np.nan)
        du = self.chart.rates_of_coordinates(found.rates.here.x, found.rates.dq)
        return np.concatenate([du, found.rates.ddq[self.chart.moving], found.power[None]])

    def jacobian(self, t: float, y: Array) -> Array:
        """See ``Stage``: forward differences, all evaluated in one batch."""
        size = NUDGE * np.maximum(1.0, np.abs(y[:-1]))
        places = y[:, None] + np.pad(np.diag(size), ((0, 1), (1, 0)))
        f = (
            self._rates(t, places)
            if self._kernel is None
            else np.stack([self.rates(t, one) for one in places.T], axis=1)
        )
        J = (f[:, 1:] - f[:, :1]) / size
        # where it does not close the rates are NaN as well, and the step is taken back
        return np.nan_to_num(np.pad(J, ((0, 0), (0, 1))), copy=False)

    def by_time(self, t: float, y: Array) -> tuple[Callable[[Array], Array], Array] | None:
        """See ``Stage``."""
        loads = self._of_time
        if not (loads or len(self.task.columns)) or (loads and not self._evaluated(t, y)):
            return None
        rates = np.concatenate([y[self.n : -1], self.task.prescribed_at(np.array([t]))[1, :, 0]])
        return partial(_by_time, self.task, self._moved, loads), rates

    def _evaluated(self, t: float, y: Array) -> bool:
        """Evaluate at an accepted place, where that was not the last evaluation; whether the loops close there."""
        known = self._last.t == t and np.array_equal(self._y, y)
        return known or self._by_kernel(t, y) is not None or self._found(t, y[:, None]) is not None

    def accepted(self, t: float, y: Array) -> bool:
        """See ``Stage``."""
        self._evaluated(t, y)
        self._path.append(self._last)
        return not self.chart.worn(*self._shape(), y[: self.n])

    def following(self, t: float, y: Array) -> ChartStage:
        """See ``Stage``."""
        return ChartStage(self.task, t, self._last.x, self._last.dq)

    def states(self, t: Array, y: Array) -> tuple[Closed, Array]:
        """See ``Stage``."""
        times = np.array([known.t for known in self._path])
        before = np.maximum(np.searchsorted(times, t, side="right") - 1, 0)
        guess = np.concatenate(
            [self._path[i].ahead(self.task.system, t[before == i]) for i in dict.fromkeys(before.tolist())], axis=1
        )
        return self.chart.close(guess, y[: self.n], self.task.prescribed_at(t)[0]), y[self.n : -1]

    def _found(self, t: float, y: Array) -> Moved | None:
        """Rates and accelerations at a time for ``y (k, T)``; None where no closed states are found near the last ones."""
        at, n = np.full(y.shape[1], t), self.n
        near = self._near(t)
        p = self.task.prescribed_at(at[:1]).repeat(len(at), axis=2)
        closed = self.chart.close(near.ahead(self.task.system, at), y[:n], p[0])
        if not closed.done.all():
            return None
        found = moved(closed, y[n:-1], p[1:], self.task.loads, at)
        rates = found.rates
        state = np.concatenate([closed.here.x[:, 0], rates.dq[:, 0], rates.ddq[:, 0]])
        self._last = _Known(t, state, *self._sizes)
        self._shape, self._y, self._moved = partial(self.chart.shape, closed.f), y[:, 0], found
        return found


def _by_time(task: Task, at: Moved, loads: tuple[Load, ...], t: Array) -> Array:
    """Accelerations ``(n + p, T)`` of loads, and of the prescribed freedoms, at times, the state as it is ``at`` one."""
    columns, here, force = at.columns, at.columns.here, np.zeros((at.columns.n, len(t)))
    for some in in_blocks(np.arange(len(t)), positions_together(task.system, 1)) if loads else ():
        many = here.part(np.zeros(len(some), dtype=np.intp))
        velocities = Velocities(many, np.repeat(at.rates.dq[:, :1], len(some), axis=1))
        wrenches, efforts = applied(many, loads, velocities, t[some])
        force[:, some] = (columns.Z[..., :1] * (efforts + many.tree_efforts(wrenches))[:, None]).sum(axis=0)
    own = accelerations(np.repeat(columns.mass[..., :1], len(t), axis=2), force)[0]
    return np.concatenate([own, task.prescribed_at(t)[2]])
