"""Stages of independent freedoms, and motions that are prescribed.

Whether the rates that a prescribed motion states are those of its position, and where it jumps or bends.

In a panel from ``a`` to ``b`` a motion ``q, q', q''`` of time is that of one function where

    q(b) - q(a) = int q' dt,    q'(b) - q'(a) = int q'' dt

A panel in which it is not is halved, and the worse half taken on. Rates that are wrong stay wrong in every half by the same part; what is
merely fast is resolved at some length; a jump is left over in one half alone, and stays however short that is, while a jump of ``q''``
falls with it: there steps of an integration had better end.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any, Literal

import numpy as np
import scipy

from mechgraph.determinacy.mobility import free_motion
from mechgraph.errors import DeclarationError
from mechgraph.force.block import forces_of_block
from mechgraph.force.friction import Came
from mechgraph.force.loads import Site, kinetic_energy
from mechgraph.force.redundant import BlockForces, ForceTask
from mechgraph.kinematics.motion_path import in_blocks
from mechgraph.kinematics.rates import PassiveMotion, Rates, Velocities
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import System
from mechgraph.kinematics.touching import strayed
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import RESPONSE
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.motion import Motion
from mechgraph.outcome import COMPILED
from mechgraph.response.motion_equations import (
    Chart,
    ClosedChart,
    Columns,
    EvaluatedRates,
    KernelRates,
    Loads,
    Moved,
    Stopped,
    applied,
    moved,
    positions_together,
)
from mechgraph.result.trajectory import BlockMotion, Trajectory

Law = Callable[[float], tuple[float, float, float]]
"""Position, velocity and acceleration at a time."""
QUANTITIES = ("position", "velocity", "acceleration")
_PLACES, _WEIGHTS = np.polynomial.legendre.leggauss(6)


@dataclass(frozen=True)
class _TimePanel:
    """A panel, and by how much the changes ``(2,)`` of position and velocity miss the integrals of the rates.

    ``part``: the worse of both, against what is allowed; ``order`` which it is; ``said`` the integral, ``size`` the largest change by rate.
    """

    begin: float
    end: float
    part: float
    order: int
    change: float
    said: float
    size: float


def differentiated(law: Law, begin: float, end: float) -> str | tuple[float, ...]:
    """Times at which the acceleration of a motion jumps, or what is wrong with its rates between two times."""
    breaks, edges = [], np.linspace(begin, end, 257).tolist()  # 256 panels
    rounding = RESPONSE.noise_of_motion * np.abs([law(t) for t in edges]).max(axis=0)[:2]
    for a, b in pairwise(edges):
        panel = _panel(law, a, b, rounding)
        if panel.part > 1.0:
            found = _narrowed(law, panel, rounding)
            if isinstance(found, str):
                return found
            breaks += found
    return tuple(breaks)


def _panel(law: Law, a: float, b: float, rounding: Array) -> _TimePanel:
    h = b - a
    inside = np.array([law(float(t)) for t in a + 0.5 * h * (1.0 + _PLACES)])
    ends = np.array([law(a), law(b)])
    change, said = (ends[1] - ends[0])[:2], 0.5 * h * (_WEIGHTS @ inside)[1:]
    largest = np.abs(np.concatenate([ends, inside])).max(axis=0)
    # part of the change in a panel up to which it agrees with the rate: what interpolated tables of both may differ by
    allowed = 1e-5 * h * largest[1:] + rounding
    part = np.abs(change - said) / np.where(allowed > 0.0, allowed, np.inf)
    k = int(np.argmax(part))
    return _TimePanel(a, b, float(part[k]), k, float(change[k]), float(said[k]), float(h * largest[k + 1]))


def _narrowed(law: Law, panel: _TimePanel, rounding: Array) -> str | list[float]:
    """What is wrong in a panel, or the time at which an acceleration jumps there, if any."""
    parts: list[float] = []
    for _ in range(24):  # halvings of a panel, at most
        middle = 0.5 * (panel.begin + panel.end)
        halves = [_panel(law, *ends, rounding) for ends in ((panel.begin, middle), (middle, panel.end))]
        worse = max(halves, key=lambda half: half.part)
        if worse.part <= 1.0:
            return []
        parts = [*parts, worse.part] if min(half.part for half in halves) > 1.0 else []
        panel = worse
        if len(parts) > RESPONSE.halvings_alike and parts[-1] > 0.5 * parts[-1 - RESPONSE.halvings_alike]:
            return (
                f"its {QUANTITIES[panel.order]} changes by {panel.change:.6g} from t = {panel.begin:.9g} to {panel.end:.9g}, where its "
                f"{QUANTITIES[panel.order + 1]} says {panel.said:.6g}; give the derivatives of the position"
            )
    # change against what the rate says from which on it is a jump
    if abs(panel.change - panel.said) > 10.0 * panel.size:
        jump = f"jumps by {panel.change - panel.said:.6g} at t = {panel.begin:.6g}"
        return f"its {QUANTITIES[panel.order]} {jump}; give a motion that goes there"
    return [_jump(law, panel.begin, panel.end)]


def _jump(law: Law, a: float, b: float) -> float:
    """The first time behind a jump of the acceleration between two times."""
    before, behind = law(a)[2], law(b)[2]
    while a < (middle := 0.5 * (a + b)) < b:
        here = law(middle)[2]
        a, b = (middle, b) if abs(here - before) < abs(here - behind) else (a, middle)
    return b


def samples_fault(t: Array, rows: Array) -> str:
    """What is wrong with the rates of samples ``rows (T, 3)`` at times ``(T,)``; empty where nothing is."""
    h, change, mean = np.diff(t), np.diff(rows, axis=0), 0.5 * (rows[1:] + rows[:-1])
    said = h * mean[:, 1] - h**2 / 12.0 * change[:, 2], h * mean[:, 2]
    # part of the largest rate by which changes between samples may miss it; of accelerations more, as they may jump between two
    # samples
    for order, (integral, most) in enumerate(zip(said, (0.1, 0.75), strict=True)):
        off = np.abs(change[:, order] - integral)
        allowed = most * h * np.abs(rows[:, order + 1]).max() + RESPONSE.noise_of_motion * np.abs(rows[:, order]).max()
        i = int(np.argmax(off - allowed))
        if off[i] > allowed[i]:
            return (
                f"the {QUANTITIES[order]} of its samples changes by {change[i, order]:.6g} from t = {t[i]:.6g} to {t[i + 1]:.6g}, where "
                f"its {QUANTITIES[order + 1]} says {integral[i]:.6g}; give the derivatives of the position, or leave them out"
            )
    return ""


OVER_POSITIONS = "is an array over positions, which a motion in time does not have; give a number or a function"
"""What is wrong with a load that holds such an array."""


class SampledMotion:
    """The quintic spline through samples of position, velocity and acceleration; refuses times outside of them."""

    def __init__(self, name: str, motion: Motion) -> None:
        assert motion.t is not None
        self.name, self.t = name, motion.t
        rows = np.stack([motion.position, motion.velocity, motion.acceleration], axis=1)
        self._spline = scipy.interpolate.BPoly.from_derivatives(motion.t, rows)
        self._rates = (self._spline, self._spline.derivative(1), self._spline.derivative(2))

    def __call__(self, t: float) -> tuple[float, float, float]:
        """Position, velocity and acceleration at a time."""
        slack = 1e-9 * float(self.t[-1] - self.t[0])
        if not self.t[0] - slack <= t <= self.t[-1] + slack:
            raise DeclarationError(
                "respond",
                [
                    f"motion of {self.name!r}: its samples end at t = {self.t[-1]:g} (they begin at {self.t[0]:g}), asked for t = {t:g}; "
                    "give samples for the whole time"
                ],
            )
        at = min(max(t, self.t[0]), self.t[-1])
        q, rate, acceleration = (float(part(at)) for part in self._rates)
        return q, rate, acceleration


class Called:
    """A callable ``t -> (position, velocity, acceleration)``."""

    def __init__(self, name: str, law: Callable[[float], Any]) -> None:
        self.name, self.law = name, law

    def __call__(self, t: float) -> tuple[float, float, float]:
        """Position, velocity and acceleration at a time."""
        try:
            values = tuple(float(v) for v in self.law(t))
        except TypeError:
            values = ()
        if len(values) != 3 or not np.isfinite(values).all():
            raise DeclarationError(
                "respond",
                [
                    f"motion of {self.name!r} at t = {t:g}: expected (position, velocity, acceleration), three finite numbers, got "
                    f"{self.law(t)!r}"
                ],
            )
        return values[0], values[1], values[2]


def law_of(name: str, motion: Any) -> Law | str:
    """A motion as a function of time, or what is wrong with it."""
    if isinstance(motion, Motion):
        if motion.t is None or motion.t.ndim != 1 or len(motion.t) < 2:
            return (
                f"motion of {name!r}: has no times; give Motion(..., t=t) with at least two samples, or a callable of t"
            )
        if not (np.diff(motion.t) > 0).all():
            return f"motion of {name!r}: its times do not rise"
        fault = samples_fault(motion.t, np.stack([motion.position, motion.velocity, motion.acceleration], axis=1))
        return f"motion of {name!r}: {fault}" if fault else SampledMotion(name, motion)
    if callable(motion):
        return Called(name, motion)
    return f"motion of {name!r} = {type(motion).__name__}: expected a Motion with t, or a callable t -> (position, velocity, acceleration)"


class Prescribed:
    """The prescribed freedoms of a mechanism: names, and their values ``(3, p)`` in the user's units at a time.

    ``breaks``: times at which their accelerations jump.
    """

    def __init__(self, laws: Mapping[str, Law], breaks: Sequence[float] = ()) -> None:
        self.laws, self.breaks = dict(laws), tuple(breaks)

    @property
    def names(self) -> tuple[str, ...]:
        """Full names of the prescribed freedoms."""
        return tuple(self.laws)

    def at(self, t: float) -> Array:
        """Positions, velocities and accelerations ``(3, p)``."""
        return np.array([law(t) for law in self.laws.values()], dtype=float).reshape(-1, 3).T


def read_motions(m: Mechanism, motions: Mapping[str, Any], times: Array, faults: list[str]) -> Prescribed:
    """The motions of a call over its times, and those that drives carry; adds what is wrong with them to ``faults``."""
    named: dict[str, Any] = {m.full_name(d.freedom): d.motion for d in m.drives if d.motion is not None}
    for name, motion in motions.items():
        fault = m.freedom_fault(name, single=True)
        if fault:
            faults.append(f"motion of {name!r}: {fault}")
        else:
            named[m.full_name(name)] = motion
    laws = {name: law_of(name, motion) for name, motion in named.items()}
    breaks: list[float] = []
    for name, law in laws.items():
        found = differentiated(law, float(times[0]), float(times[-1])) if isinstance(law, Called) else ()
        if isinstance(found, str):
            faults.append(f"motion of {name!r}: {found}")
        else:
            breaks += found
    faults += [law for law in laws.values() if isinstance(law, str)]
    return Prescribed({name: law for name, law in laws.items() if not isinstance(law, str)}, breaks)


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


def no_force(task: Task, kind: str, t: float, at: float | None = None) -> Stopped:
    """That friction has no solution at a time, or none alone; ``at``: see ``Stopped``."""
    names = ", ".join(dict.fromkeys(load.of for load in task.loads.dry))
    return Stopped(f"friction of {names} at t = {t:.6g}: {kind}; no force is returned from there on", kind, at)


class ChartStage:
    """Implements ``integration.Stage`` from a closed state ``x (nx,)`` with rates ``dq (F,)`` at a time."""

    def __init__(self, task: Task, t: float, x: Array, dq: Array) -> None:
        self.task = task
        self.chart = task.chart(x)
        self.n = len(self.chart.free)
        self._first = np.concatenate([np.zeros(self.n), dq[self.chart.moving], np.zeros(2)])
        self._sizes = len(x), len(dq)
        self._last = _Known(t, np.concatenate([x, dq, np.zeros_like(dq)]), *self._sizes)
        self._path = [self._last]
        self._ways = [self._followed(task.loads, x, dq)]
        self._unsmooth = tuple(load for load in (*task.loads.stored, *task.loads.rest) if not load.smooth)
        self._kernel: KernelRates | None = None
        self.trouble: Stopped | None = None
        self.engine = task.engine if task.library is None else COMPILED
        self._shape: Callable[[], tuple[float, float]]
        self._y = np.full(0, np.nan)
        if task.library is not None and not task.loads.rolls:
            self._kernel = KernelRates(task.library, self.chart, task.loads)
        if not self._evaluated(t, self._first):
            raise Stopped(
                "the loops do not close any more to where a step led, as at positions where the mechanism locks"
            )
        if self.trouble is not None:
            raise self.trouble
        self._path = [self._last]
        # kinetic energy, and the work of the forces M v' over a unit of the coordinates
        columns = Columns(self.chart.start, self.chart.factors, self.n, self.chart.held)
        forces = columns.mass[..., 0] @ self._last.ddq[self.chart.moving]
        twists = self.chart.start.link_twists(self._last.dq[:, None])
        self.energy = float(kinetic_energy(self.chart.start, twists)[0] + np.abs(forces).sum()) or 1.0

    def __getstate__(self) -> dict[str, Any]:
        """What is kept of a motion is asked for its states, which need neither the kernel nor the last shape."""
        return vars(self) | {"_kernel": None, "_shape": None}

    def begin(self) -> Array:
        """See ``Stage``."""
        return self._first

    def table(self, place: float | None = None) -> None:
        """See ``Stage``: charts have none."""

    def rates(self, t: float, y: Array) -> Array:
        """See ``Stage``."""
        here = self._by_kernel(t, y)
        if here is None:
            return self._rates(t, y[:, None])[:, 0]
        return here.rates

    def _by_kernel(self, t: float, y: Array) -> EvaluatedRates | None:
        """The same by the kernel; None where there is none, or it does not serve: numpy says what is there."""
        if self._kernel is None:
            return None
        near = self._near(t)
        p = self.task.prescribed_at(np.array([t]))[..., 0]
        found = self._kernel(near.state, t - near.t, y[:-2], p, self._ways[-1])
        if found is not None:
            self._last = _Known(t, found.state, *self._sizes)
            self._y, self._shape = y, lambda: (found.steepness, found.condition)
        return found

    def by_kernel(self, t: Array, y: Array) -> Array | None:
        """See ``Stage``."""
        if self._kernel is None:
            return None
        before = self._before(t).tolist()
        h = t - np.array([self._path[i].t for i in before])
        known = np.stack([self._path[i].state for i in before])
        ways = None if self._ways[0] is None else np.stack([self._ways[i] for i in before])
        found = self._kernel.many(known, h, y[:-2].T, np.moveaxis(self.task.prescribed_at(t), -1, 0), ways)
        return None if found is None else found.T

    def _followed(self, loads: Loads, x: Array, dq: Array) -> Array | None:
        """The ways ``(F,)`` at a state; None without friction."""
        if loads.ways is None:
            return None
        return loads.followed(Configuration(self.task.system, x[:, None]), dq[:, None])[:, 0]

    @property
    def _loads(self) -> Loads:
        """The loads, with the ways in which freedoms slipped where the last step ended."""
        return replace(self.task.loads, ways=self._ways[-1])

    def task_at(self, t: Array) -> Task:
        """See ``Stage``."""
        if self._ways[0] is None:
            return self.task
        ways = np.stack([self._ways[i] for i in self._before(t)], axis=1)
        return replace(self.task, loads=replace(self.task.loads, ways=ways))

    def _before(self, t: Array) -> Index:
        """Places ``(T,)`` of the known states before times."""
        times = np.array([known.t for known in self._path])
        return np.asarray(np.maximum(np.searchsorted(times, t, side="right") - 1, 0), dtype=np.intp)

    def _near(self, t: float) -> _Known:
        """The known state next to a time."""
        return self._last if abs(self._last.t - t) < abs(self._path[-1].t - t) else self._path[-1]

    def _rates(self, t: float, y: Array) -> Array:
        """``y' (k, T)`` at one time and several ``y (k, T)``; NaN where no closed states are found near the last ones."""
        found = self._found(t, y) if np.isfinite(y).all() else None
        if found is None:
            return np.full(y.shape, np.nan)
        du = self.chart.rates_of_coordinates(found.rates.here.x, found.rates.dq)
        lost = found.lost[None]
        return np.concatenate([du, found.rates.ddq[self.chart.moving], lost, found.power[None]])

    def jacobian(self, t: float, y: Array) -> Array:
        """See ``Stage``: forward differences, all evaluated in one batch."""
        # part of a coordinate (or of one) by which it is changed for a derivative
        size = 1e-7 * np.maximum(1.0, np.abs(y[:-2]))
        places = y[:, None] + np.pad(np.diag(size), ((0, 2), (1, 0)))
        f = (
            self._rates(t, places)
            if self._kernel is None
            else np.stack([self.rates(t, one) for one in places.T], axis=1)
        )
        J = (f[:, 1:] - f[:, :1]) / size
        # where it does not close the rates are NaN as well, and the step is taken back
        return np.nan_to_num(np.pad(J, ((0, 0), (0, 2))), copy=False)

    def unsmooth(
        self, t: float, y: Array, dense: Callable[[Any], Array]
    ) -> tuple[Callable[[Array], Array], Array] | None:
        """See ``Stage``."""
        if not (self._unsmooth or len(self.task.columns)):
            return None
        rates = np.concatenate([y[self.n : -2], self.task.prescribed_at(np.array([t]))[1, :, 0]])
        return partial(self._along, dense), rates

    def astray(self, t: float, y: Array, begin: float, dense: Callable[[Any], Array], allowed: Array) -> bool:
        """See ``Stage``."""
        return False

    def _along(self, dense: Callable[[Any], Array], t: Array) -> Array:
        """Accelerations ``(n + p, T)`` at times of a step, see ``unsmooth``; those by the kernel are of all loads."""
        y, own = dense(t), np.zeros((len(self.chart.moving), len(t)))
        known = self.by_kernel(t, y) if self._unsmooth else None
        if known is not None:
            own = known[-self._sizes[1] :][self.chart.moving]
        elif self._unsmooth:
            for some in in_blocks(np.arange(len(t)), positions_together(self.task.system, self.n)):
                closed, v = self.states(t[some], y[:, some])
                columns = Columns(closed.here, closed.f, self.n, closed.held)
                rates = (columns.Z * v).sum(axis=1) + (columns.Zp * self.task.prescribed_at(t[some])[1]).sum(axis=1)
                found = applied(closed.here, self._unsmooth, Velocities(closed.here, rates), t[some])
                own[:, some] = np.where(closed.done, columns.accelerations(*found)[0], np.nan)
        return np.concatenate([own, self.task.prescribed_at(t)[2]])

    def _evaluated(self, t: float, y: Array) -> bool:
        """Evaluate at an accepted place, where that was not the last evaluation; whether the loops close there."""
        known = self._last.t == t and np.array_equal(self._y, y)
        return known or self._by_kernel(t, y) is not None or self._found(t, y[:, None]) is not None

    def accepted(self, t: float, y: Array) -> bool:
        """See ``Stage``."""
        self._evaluated(t, y)
        self.trouble = None
        self._path.append(self._last)
        loads = self._loads
        self._ways.append(self._followed(loads, self._last.x, self._last.dq))
        return not self.chart.worn(*self._shape(), y[: self.n])

    def following(self, t: float, y: Array) -> ChartStage:
        """See ``Stage``."""
        return ChartStage(self.task, t, self._last.x, self._last.dq)

    def states(self, t: Array, y: Array) -> tuple[ClosedChart, Array]:
        """See ``Stage``."""
        before = self._before(t)
        guess = np.concatenate(
            [self._path[i].ahead(self.task.system, t[before == i]) for i in dict.fromkeys(before.tolist())], axis=1
        )
        return self.chart.close(guess, y[: self.n], self.task.prescribed_at(t)[0]), y[self.n : -2]

    def _found(self, t: float, y: Array) -> Moved | None:
        """Rates and accelerations at a time for ``y (k, T)``; None where no closed states are found near the last ones."""
        at, n = np.full(y.shape[1], t), self.n
        near = self._near(t)
        p = self.task.prescribed_at(at[:1]).repeat(len(at), axis=2)
        closed = self.chart.close(near.ahead(self.task.system, at), y[:n], p[0])
        if not closed.done.all():
            return None
        found = moved(closed, y[n:-2], p[1:], self._loads, at)
        if found.rubs is not None and (outcome := int(found.rubs.outcome[0])):
            self.trouble = no_force(self.task, Came(outcome).status, t)
        rates = found.rates
        state = np.concatenate([closed.here.x[:, 0], rates.dq[:, 0], rates.ddq[:, 0]])
        self._last = _Known(t, state, *self._sizes)
        self._shape, self._y = partial(self.chart.shape, closed.f), y[:, 0]
        return found


Block = tuple[Index, Task, ClosedChart, Array]
"""Places, the task by which they were followed, closed states, and the rates ``v (n, T)`` of the independent columns of their factors."""


def trajectory_of(
    task: Task, m: Mechanism, times: Array, blocks: Iterable[Block], at_rest: bool = False
) -> tuple[Trajectory, Array, Array]:
    """The trajectory at times (a number or ``(T,)``) from blocks of states, with kinetic and potential energy ``(T,)``.

    The efforts of the prescribed freedoms of ``task`` are those of drives; what else holds the tasks of the blocks acts as a load.
    ``at_rest``: nothing moves nor is about to, also where no inertia resists.
    """
    s, t, blocks = task.system, times.reshape(-1), list(blocks)
    x = np.full((s.n_state, t.size), np.nan)
    for places, _, closed, _ in blocks:
        x[:, places] = closed.here.x
    coordinates = s.coordinates_of(x, s.start_coordinates(m.start))
    out = Trajectory(s, partial(_same, s), times.shape, times, task.columns, coordinates, True, task.held)
    out.engine, out.method = task.engine, "loop_wrench"
    kinetic, potential = np.zeros(t.size), np.zeros(t.size)
    for places, own, closed, v in blocks:
        if fault := strayed(closed.here):
            raise DeclarationError(f"mechanism {m.name!r}", [fault])
        # the batch of a block is its own: loads are functions of time here, not arrays over positions
        at, count, q = t[places], len(places), coordinates[:, places]
        found = None if at_rest else moved(closed, v, own.prescribed_at(at)[1:], own.loads, at)
        rates = _still(closed.here) if found is None else found.rates
        idle = None if closed.held is None else closed.held.places
        force_task = ForceTask(out.method, m.loads, own.columns, own.held, (count,), at, "nan", idle)
        forces = forces_of_block(
            force_task, rates, closed.f, q, np.arange(count), None if found is None else found.rubs
        )
        held = np.setdiff1d(own.columns, task.columns)
        given = forces.given.copy()
        given[held] = (forces.efforts - forces.coupled)[held]
        if forces.rubs is not None:
            stuck = np.intersect1d(own.loads.stuck, held).astype(np.intp)
            forces.rubs.efforts[stuck] += (given - forces.given)[stuck]
        forces = replace(forces, given=given)
        if own.loads.shared:
            forces = _undetermined(forces)
            out.mark(places, Came.NOT_UNIQUE.status)
        out.put(BlockMotion(places, rates), forces)
        kinetic[places] = kinetic_energy(closed.here, rates.V) * s.par.L**2
        site = Site(closed.here, rates, q, (count,), np.arange(count), at)
        for load in task.loads.stored:
            potential[places] += load.energy(site)
    return out, kinetic, potential


def _undetermined(forces: BlockForces) -> BlockForces:
    """Without values that depend on how several freedoms share the friction by which they stick together."""
    assert forces.rubs is not None
    rubs = replace(forces.rubs, efforts=forces.rubs.efforts * np.nan, normals=forces.rubs.normals * np.nan)
    names = ("reactions", "efforts", "given", "balance", "power")
    values: dict[str, Any] = {name: np.full_like(getattr(forces, name), np.nan) for name in names}
    return replace(forces, rubs=rubs, **values)


def _still(here: Configuration) -> Rates:
    nothing = np.zeros((here.system.n_freedoms, here.T))
    return Rates(Velocities(here, nothing), nothing, np.zeros(here.T))


def _same(system: System, places: Any) -> System:
    """The one system of all positions; a function of the module, so that solutions can be pickled."""
    return system
