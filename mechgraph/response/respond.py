"""Motion in time: what a user calls, and the Solution over time that comes back."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import CLOSED, assembled_at, named_columns
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.driver_path import in_blocks
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.rank import closure_rank
from mechgraph.closure.solver import engine_for
from mechgraph.errors import DeclarationError, ResponseError
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.linear import rank_of, singular_values
from mechgraph.numerics.tolerances import MOTIONS
from mechgraph.response.along_path import Arc, PathStage
from mechgraph.response.charts import ChartStage, Task
from mechgraph.response.events import Event, Occurrence, Watch, read_events
from mechgraph.response.integration import METHODS, Integration, Stage, Stopped
from mechgraph.response.motion_equations import Loads
from mechgraph.response.prescribed import Prescribed
from mechgraph.response.reading import trajectory_of
from mechgraph.result.solution import Solution
from mechgraph.result.trajectory import Trajectory

SLACK = 1e-9
"""Part of the given rates by which they may miss the closure before they contradict it."""


@dataclass(frozen=True)
class Energy:
    """Energies over time ``(T,)`` in the user's units.

    ``kinetic``; ``potential`` of gravity and springs; ``work`` done since the start by prescribed drivers and by loads without a potential
    energy. ``kinetic + potential - work`` is constant.
    """

    kinetic: Array
    potential: Array
    work: Array

    @property
    def balance(self) -> Array:
        """``kinetic + potential - work`` less its value at the start: zero for an exact solution."""
        total = self.kinetic + self.potential - self.work
        return np.asarray(total - total[..., :1])


class Response(Solution):
    """A Solution over time: positions, rates, accelerations, efforts of prescribed drivers and all reactions.

    Attributes
    ----------
    energy : kinetic and potential energy, and the work done.
    stopped : why the motion was not followed to its end; empty where it was.
    events : what happened, in the order of time.
    """

    stopped = ""
    events: tuple[Occurrence, ...] = ()

    def __init__(self, trajectory: Trajectory, energy: Energy, motion: _Motion) -> None:
        super().__init__(trajectory)
        self.energy, self._motion = energy, motion

    def at(self, t: Any) -> Response:
        """The response at other times within those that were integrated (dense output of the stepper, closed and with all forces)."""
        return self._motion.response(t)


@dataclass(frozen=True)
class _Motion:
    """The integrated motion, from which responses are read."""

    integration: Integration
    task: Task
    mechanism: Mechanism

    @property
    def ends(self) -> Array:
        """Times at which steps end."""
        return np.array([segment.end for segment in self.integration.segments])

    def response(self, t: Any) -> Response:
        """The response at times ``t``, a number or ``(T,)``."""
        times = np.asarray(t, dtype=float)
        flat, segments = times.reshape(-1), self.integration.segments
        begin, end = segments[0].begin, segments[-1].end
        if times.ndim > 1 or not np.isfinite(flat).all() or not flat.size or flat.min() < begin or flat.max() > end:
            raise DeclarationError(
                "response", [f"t: expected times between {begin:g} and {end:g}, one or one-dimensional, got {t!r}"]
            )
        return _read(self, times)


def _read(motion: _Motion, times: Array) -> Response:
    """States, rates and forces at times; the positions of a stage are closed and evaluated together."""
    task, m, flat = motion.task, motion.mechanism, times.reshape(-1)
    works, blocks = np.zeros(flat.size), []
    for places, stage, y, work in motion.integration.at(flat):
        works[places] = work
        for part in in_blocks(np.arange(len(places))):
            closed, v = stage.states(flat[places[part]], y[:, part])
            if not closed.done.all() or float(closed.here.closure.max()) > CLOSED:
                raise ResponseError(
                    f"mechanism {m.name!r}: the loops do not close at some time of {flat[places[part]]}"
                )
            blocks.append((places[part], closed, v))
    trajectory, kinetic, potential = trajectory_of(task, m, times, blocks)
    trajectory.work = motion.integration.work
    shape = times.shape
    energy = Energy(kinetic.reshape(shape), potential.reshape(shape), (works * task.system.par.L**2).reshape(shape))
    return Response(trajectory, energy, motion)


def respond(
    m: Mechanism,
    t: Any,
    *,
    start: Mapping[str, float] | None = None,
    rates: Mapping[str, float] | None = None,
    motions: Mapping[str, Any] | None = None,
    loads: Iterable[Any] | None = None,
    rtol: float = 1e-8,
    atol: float = 1e-10,
    method: str = "auto",
    engine: str = "auto",
    events: Iterable[Event] = (),
    on_stop: Literal["raise", "return"] = "raise",
    progress: Callable[[float], None] | None = None,
) -> Response:
    """The motion that given efforts and loads produce, with all reactions (dynamic response).

    The accelerations of as many independent freedoms as the mechanism has mobility are unknowns beside the reactions; see
    ``response.motion_equations``. Integrated by the steppers of ``scipy.integrate``; every output is closed.

    Parameters
    ----------
    t : ``(begin, end)``, for outputs at the steps taken, or the times of the outputs, rising.
    start : coordinates of freedoms at the beginning; others as near as they can stay to the declared ``start``.
    rates : rates of freedoms at the beginning; what they leave open is at rest (least rates).
    motions : freedoms that are prescribed: freedom -> ``Motion`` with ``t`` (its quintic spline), or a callable ``t -> (position,
        velocity, acceleration)``. A drive with a stored motion is prescribed; other declared drives are free.
    loads : replace the declared ones.
    rtol, atol : tolerances of a step, relative and absolute (radians and lengths / L, and their rates).
    method : a stepper of ``scipy.integrate``: explicit ``"RK23"``, ``"RK45"``, ``"DOP853"``, for stiff laws ``"Radau"``, ``"BDF"``,
        ``"LSODA"``; ``"auto"`` is DOP853.
    engine : as in ``solve``.
    events : ``Event``s to be watched; a terminal one ends the motion, at its time.
    on_stop : where the motion cannot be followed to its end, or is interrupted: ``"raise"``, or ``"return"`` what there is, with
        ``stopped`` saying why.
    progress : called with the time reached after every step.

    Raises
    ------
    DeclarationError, AssemblyError
    ResponseError
        where the motion cannot be followed to its end, or is interrupted; carries the Response so far.
    """
    times = _times(m, t)
    faults = [
        f"{name} = {value!r}: expected a number between 1e-14 and 0.1"
        for name, value in (("rtol", rtol), ("atol", atol))
        if not isinstance(value, int | float) or not 1e-14 <= value <= 0.1
    ]
    watched, wrong = read_events(m, events)
    faults += wrong
    if on_stop not in ("raise", "return"):
        faults.append(f"on_stop = {on_stop!r}: expected 'raise' or 'return'")
    if method not in ("auto", *METHODS):
        faults.append(f"method = {method!r}: expected one of 'auto', {', '.join(map(repr, METHODS))}")
    if faults:
        raise DeclarationError(f"respond {m.name!r}", faults)
    if loads is not None:
        m = m.replace(loads=tuple(loads))
    begin, end = float(times[0]), float(times[-1])
    given = Prescribed(m, motions)
    m = m.replace(drives=list(given.names))
    system, x, columns = _started(m, start, given, begin)
    name: Literal["dense", "sparse"] = engine_for(system.n_rows, 1, engine)
    task = Task(system, Loads.of(m.loads), given, columns, name)
    dq = _start_rates(m, task, x, rates, begin)
    it = Integration("DOP853" if method == "auto" else method, float(rtol), float(atol))
    motion = _Motion(it, task, m)
    watch, happened = Watch(watched, motion.response), []
    try:
        for segment in it.run(_first_stage(it, task, begin, x, dq), begin, end):
            if progress is not None:
                progress(segment.end)
            for one in watch.passed(segment.begin, segment.end):
                happened.append(one)
                if one.event.terminal:
                    out = motion.response(
                        np.append(times[times < one.t] if len(times) > 2 else _steps(motion, one.t), one.t)
                    )
                    out.stopped, out.events = str(one), tuple(happened)
                    return out
    except (Stopped, KeyboardInterrupt) as stop:
        reached = it.segments[-1].end if it.segments else begin
        why = (
            f"{stop} Steps collapse where loads are stiff or jump, and at positions where the mechanism locks; for stiff loads use "
            "method='Radau'"
            if isinstance(stop, Stopped)
            else "interrupted"
        )
        text = f"mechanism {m.name!r}: the motion was followed to t = {reached:.6g} of {end:.6g}: {why}"
        so_far = _so_far(motion, times)
        if on_stop == "raise" or so_far is None:
            raise ResponseError(text, so_far) from None
        so_far.stopped, so_far.events = text, tuple(happened)
        return so_far
    out = motion.response(times if len(times) > 2 else np.concatenate([[begin], motion.ends]))
    out.events = tuple(happened)
    return out


def _steps(motion: _Motion, end: float) -> Array:
    """The beginning and the ends of steps before a time."""
    ends = np.concatenate([[motion.integration.segments[0].begin], motion.ends])
    return ends[ends < end]


def _first_stage(it: Integration, task: Task, begin: float, x: Array, dq: Array) -> Stage:
    """Along the path where there is one path and loads that depend on the place on it, and linearly on the rate; charts otherwise."""
    motions = closure_rank(Configuration(task.system, x[:, None]), engine=task.engine).motions
    if (
        motions.shape[1] == 1
        and not len(task.columns)
        and all(load.smooth for load in (*task.loads.stored, *task.loads.rest))
    ):
        arc = Arc(task, x)
        it.work.coordinates = "along the path"
        return PathStage(arc, arc.begin, float(dq[arc.column]))
    it.work.coordinates = "in independent freedoms"
    return ChartStage(task, begin, x, dq)


def _so_far(motion: _Motion, times: Array) -> Response | None:
    segments = motion.integration.segments
    if not segments:
        return None
    reached = times[times <= segments[-1].end] if len(times) > 2 else np.concatenate([times[:1], motion.ends])
    return motion.response(reached)


def _times(m: Mechanism, t: Any) -> Array:
    try:
        times = np.array(t, dtype=float)
    except (TypeError, ValueError):
        times = np.zeros(0)
    if times.ndim != 1 or len(times) < 2 or not np.isfinite(times).all() or not (np.diff(times) > 0).all():
        raise DeclarationError(
            f"respond {m.name!r}", [f"t = {t!r}: expected (begin, end) or rising times of the outputs, at least two"]
        )
    return times


def _started(
    m: Mechanism, start: Mapping[str, float] | None, given: Prescribed, begin: float
) -> tuple[System, Array, Index]:
    """The scaled system, the closed state at the beginning, and the prescribed columns."""
    prescribed = dict(zip(given.names, given.at(begin)[0].tolist(), strict=True))
    wanted = {m.full_name(k): v for k, v in (start or {}).items() if not m.freedom_fault(k, single=True)}
    faults = [f"start of {k!r}: {why}" for k in start or {} if (why := m.freedom_fault(k, single=True))]
    faults += [
        f"start of {k!r} = {v!r}: its motion is prescribed, {prescribed[k]:g} at t = {begin:g}; leave it out"
        for k, v in wanted.items()
        if k in prescribed and v != prescribed[k]
    ]
    if faults:
        raise DeclarationError(f"respond {m.name!r}", faults)
    system, x = assembled_at(m, {**wanted, **prescribed})
    columns, _ = named_columns(m, system, dict.fromkeys(given.names, 0.0))
    return system, x, columns


def _start_rates(m: Mechanism, task: Task, x: Array, rates: Mapping[str, float] | None, begin: float) -> Array:
    """Rates ``(F,)`` at the beginning: those given and prescribed, the others as small as the closure lets them be."""
    s = task.system
    names, values = list(task.prescribed.names), task.prescribed.at(begin)[1].tolist()
    faults = []
    for name, value in (rates or {}).items():
        fault = m.freedom_fault(name, single=False)
        if fault:
            faults.append(f"rate of {name!r}: {fault}")
        elif isinstance(value, bool) or not isinstance(value, int | float | np.number) or not np.isfinite(value):
            faults.append(f"rate of {name!r} = {value!r}: expected a finite number")
        else:
            names.append(m.full_name(name))
            values.append(float(value))
    if faults:
        raise DeclarationError(f"respond {m.name!r}", faults)
    places = [m.freedom(name) for name in names]
    columns = np.array([int(s.first_column[k]) + j for k, j in places], dtype=np.intp)
    wanted = np.array(values) / np.where(s.is_length[columns], s.par.L, 1.0)
    N = closure_rank(Configuration(s, x[:, None]), engine=task.engine).motions
    if not len(names):
        return np.zeros(s.n_freedoms)
    a = np.linalg.lstsq(N[columns], wanted, rcond=MOTIONS.dependent)[0]
    left = np.abs(N[columns] @ a - wanted)
    if left.max() > SLACK * max(1.0, float(np.abs(wanted).max())):
        rank = rank_of(singular_values(N[columns]), MOTIONS.dependent)
        closed = ", ".join(f"{n} {v:.6g}" for n, v in zip(names, (N[columns] @ a).tolist(), strict=True))
        raise DeclarationError(
            f"respond {m.name!r}",
            [
                f"rates of {', '.join(names)}: contradict the closure, which lets {rank} of these {len(names)} move independently; nearest "
                f"rates that it allows (radians, or lengths / {s.par.L:.4g}, a unit of time): {closed}"
            ],
        )
    return np.asarray(N @ a)
