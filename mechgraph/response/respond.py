"""Motion in time: what a user calls.

The course of a motion: what was integrated, the Response that is read from it, and its energies.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property, partial
from types import SimpleNamespace
from typing import Annotated, Any, Literal, Protocol, get_args

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mechgraph.determinacy.finite_motion import branches, branches_text, finite_motion
from mechgraph.determinacy.mobility import free_motion
from mechgraph.determinacy.report import hinted
from mechgraph.determinacy.snapping import SnappedMechanism, declared_closure, meant
from mechgraph.document import Bullets, Document, Heading, Paragraph, Shown
from mechgraph.errors import AssemblyError, DeclarationError, FrictionError, MechgraphWarning, ResponseError
from mechgraph.files import plain
from mechgraph.force.loads import Site
from mechgraph.kinematics.assembly import assembled_at, named_columns
from mechgraph.kinematics.motion_path import in_blocks
from mechgraph.kinematics.rates import Velocities
from mechgraph.kinematics.reach import BEYOND_END, beyond
from mechgraph.kinematics.solver import MotionEngineName, closure_rank, engine_for
from mechgraph.kinematics.state import CLOSED, Configuration
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import rank_of, singular_values
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import MOTIONS, RESPONSE, Tolerances
from mechgraph.memo import dataclass
from mechgraph.model.declaration import mapping_faults
from mechgraph.model.gear_facts import with_play
from mechgraph.model.loads import Law, Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.parameters import declared
from mechgraph.model.setups import (
    METHODS,
    Event,
    MethodName,
    Occurrence,
    PassiveName,
    ResponseSetup,
    Stop,
    read_times,
    tolerance_faults,
)
from mechgraph.outcome import COMPILED
from mechgraph.quantities import Limit, door, is_numeric, items_of, option_faults, real_array, without_units, wrong
from mechgraph.response.along_path import Arc, PathStage
from mechgraph.response.charts import OVER_POSITIONS, ChartStage, Prescribed, Task, read_motions, trajectory_of
from mechgraph.response.integration import (
    LOOKS_IN_STEP,
    OF_ALL,
    Integration,
    Stage,
    Watch,
    first_root,
    read_events,
    with_turns,
)
from mechgraph.response.motion_equations import (
    ClosedChart,
    Columns,
    Loads,
    Moved,
    Stopped,
    library_for,
    moved,
    positions_together,
    stopping,
)
from mechgraph.response.resting import Rests, read_stops, with_contacts
from mechgraph.response.rough import friction_faults
from mechgraph.result.notes import NotSolved
from mechgraph.result.solution import Solution
from mechgraph.result.summary import SolutionData, solution_data, summary
from mechgraph.result.trajectory import Trajectory
from mechgraph.result.values import ranges


@dataclass(frozen=True)
class EnergyLost:
    """The balance of energies is not kept: the motion is doubtful from about the time ``t`` on, by the part ``error``."""

    error: float
    t: float

    def __str__(self) -> str:
        return (
            f"energy balance: off by {self.error:.2g} of the largest energy from t = {self.t:.4g} on, so later results are "
            "unreliable (a change point or a discontinuous load that steps do not resolve). Pass a smaller rtol"
        )


@dataclass(frozen=True, repr=False)
class Energy(Shown):
    """Energies over the times ``t (T,)`` in the user's units.

    ``kinetic``; ``potential`` of gravity and springs; ``work`` done since the start by prescribed drivers and by loads without a potential
    energy, less what impacts and friction took, which is ``impact`` and ``friction``. ``kinetic + potential - work`` is constant; ``start``
    is its value at the start.
    """

    kinetic: Array
    potential: Array
    work: Array
    impact: Array
    friction: Array
    start: float
    t: Array

    @property
    def balance(self) -> Array:
        """``kinetic + potential - work`` less its value at the start: zero for an exact solution."""
        return np.asarray(self.kinetic + self.potential - self.work - self.start)

    @property
    def greatest(self) -> float:
        """The greatest energy, counted from the start, or work; 0 where that is rounding of the potential energy."""
        parts = self.kinetic, self.potential - self.start, self.work
        size = max(float(np.abs(part).max(initial=0.0)) for part in parts)
        # energies, of the potential energy, that are rounding: nothing moves
        return size if size > 1e-9 * float(np.abs(self.potential).max(initial=0.0)) else 0.0

    def document(self) -> Document:
        """Ranges over the output times."""
        rows = [(name, getattr(self, name)) for name in ("kinetic", "potential", "work", "balance")]
        return Document("Energies", (ranges(rows, lambda i: f"t = {self.t.reshape(-1)[i]:.5g}"),))


def _total(parts: Array) -> float:
    """What stays of energies ``(5,)``: kinetic and potential energy without the work done."""
    kinetic, potential, work = parts[:3].tolist()
    return float(kinetic + potential - work)


def _energy(parts: Array, start: float, t: Array) -> Energy:
    kinetic, potential, work, impact, friction = parts
    return Energy(kinetic, potential, work, impact, friction, start, t)


class Response(Solution):
    """A Solution over time: positions, rates, accelerations, efforts of prescribed drivers and all reactions. Returned by ``respond``.

    Attributes
    ----------
    energy : object
        ``kinetic``, ``potential``, ``work`` and ``balance`` ``(T,)``; an exact solution leaves the balance zero.
    stopped : str
        Why the integration stopped early; empty if it did not.
    events : tuple
        Events in the order of time.

    Examples
    --------
    >>> import mechgraph as mg
    >>> r = mg.respond(mg.load("windows-2"), [0.0, 0.5, 1.0], rates={"A0": -1.0})
    >>> r.t, r["A0"].position.shape
    (array([0. , 0.5, 1. ]), (3, 1))
    """

    integrated = True
    stopped = ""
    events: tuple[Occurrence, ...] = ()

    def __init__(self, trajectory: Trajectory, energy: Energy, course: Course) -> None:
        super().__init__(trajectory)
        self.energy, self._course = energy, course

    @property
    def warnings(self) -> tuple[Any, ...]:
        """What makes reactions doubtful, and the motion itself: see ``Solution.warnings``; energies that do not balance."""
        lost = self._energy_lost()
        return super().warnings if lost is None else (*super().warnings, lost)

    def _energy_lost(self) -> EnergyLost | None:
        off = np.abs(self.energy.balance)
        largest = float(np.nan_to_num(off).max(initial=0.0))
        if largest <= RESPONSE.lost_energy * self.energy.greatest:
            return None
        # times asked for may be few and of little energy: what is lost counts beside the whole motion too
        whole = self._course.greatest
        if largest <= RESPONSE.lost_energy * whole or not whole:
            return None
        return EnergyLost(largest / whole, float(np.asarray(self.t)[off > 0.5 * largest].min()))

    def document(self, asked: bool = False) -> Document:
        """The summary of a Solution, with the balance of energies, whether the motion is doubtful, and what happened."""
        largest = float(np.abs(self.energy.kinetic).max(initial=0.0)) or 1.0
        balance = ("energy balance, of the largest kinetic energy", self.energy.balance / largest)
        made = summary(self._values, asked, (balance,))
        events = Heading("Events" if self.events else "", 2), Bullets([str(one) for one in self.events])
        lost = self._energy_lost()
        doubtful = Paragraph("" if lost is None else f"Doubtful: {lost}.")
        return replace(made, blocks=(Paragraph(self.stopped), doubtful, *made.blocks, *events))

    def to_dict(self) -> dict[str, Any]:
        """What the summary tells as plain data."""
        return dict(plain(response_data(self)))

    def at(self, t: ArrayLike) -> Response:
        """Return the response at other times within the integrated range (dense output; closed, with all forces).

        Parameters
        ----------
        t : (...) array_like
            Times. At an impact the values are those before it.

        Returns
        -------
        Response

        Examples
        --------
        >>> import mechgraph as mg
        >>> r = mg.respond(mg.load("windows-2"), (0, 1), rates={"A0": -1.0})
        >>> r.at([0.25, 0.75]).t
        array([0.25, 0.75])
        """
        return self._course.response(t)

    def finely(self) -> Response:
        """The response at times between its outputs too, so that its paths are curves."""
        if len(self.t) < 2:
            return self
        # points that the path of a response has at least
        between = np.linspace(0.0, 1.0, max(2, -(-400 // (len(self.t) - 1)) + 1))[:-1]
        return self.at(np.append((self.t[:-1, None] + np.diff(self.t)[:, None] * between).ravel(), self.t[-1]))


@dataclass(frozen=True)
class Course:
    """The integrated motion of a mechanism; ``task`` is that without stops, ``times`` those asked for, or begin and end."""

    integration: Integration
    task: Task
    mechanism: Mechanism
    times: Array

    @property
    def begin(self) -> float:
        """The first time."""
        return float(self.times[0])

    @property
    def reached(self) -> float:
        """The last time that was reached."""
        return self.integration.segments[-1].end if self.integration.segments else self.begin

    def outputs(self, last: float | None = None) -> Response | None:
        """The response at the times asked for, or else where steps end, up to where the motion was followed; with ``last`` there too.

        None where no step was taken.
        """
        if not self.integration.segments:
            return None
        steps = [self.begin, *(segment.end for segment in self.integration.segments)]
        times = np.unique(self.times if len(self.times) > 2 else steps)
        times = times[times <= self.reached] if last is None else np.append(times[times < last], last)
        return self.response(times)

    def response(self, t: Any) -> Response:
        """The response at times ``t``, a number or ``(T,)``."""
        times = real_array(t)
        if (
            times is None
            or times.ndim > 1
            or not times.size
            or not ((times >= self.begin) & (times <= self.reached)).all()
        ):
            what = f"times between {self.begin:g} and {self.reached:g}, one or one-dimensional"
            raise DeclarationError("response", [wrong(t, "t", what)])
        trajectory, parts = self._read(times)
        if (start := np.flatnonzero(times.reshape(-1) == self.begin)).size:
            vars(self).setdefault("_energy_at_start", _total(parts[:, start[0]]))
        return Response(trajectory, _energy(parts.reshape(-1, *times.shape), self._energy_at_start, times), self)

    def moments(self, t: Array) -> list[Response]:
        """The responses at each of several times ``(T,)``, evaluated together."""
        (whole, parts), out = self._read(t), []
        for i, at in enumerate(t.tolist()):
            values = whole.part(slice(i, i + 1))
            values.batch, values.t = (), np.array(at)
            out.append(Response(values, _energy(parts[:, i], self._energy_at_start, values.t), self))
        return out

    @cached_property
    def _energy_at_start(self) -> float:
        return _total(self._read(np.array(self.begin))[1][:, 0])

    @cached_property
    def greatest(self) -> float:
        """The greatest energy of the motion at its steps, of many at some of them."""
        ends = np.array([self.begin, *(segment.end for segment in self.integration.segments)])
        # steps at which the greatest energy of a motion is looked for
        return self.response(ends[:: max(1, len(ends) // 100)]).energy.greatest

    def _read(self, times: Array) -> tuple[Trajectory, Array]:
        """The trajectory at times, flat, with energies ``(5, T)`` in the order of ``Energy``."""
        flat = times.reshape(-1)
        done = np.zeros((3, flat.size))
        blocks = []
        for places, task, closed, v, sums in self._states(flat):
            done[:, places] = sums
            blocks.append((places, task, closed, v))
        m, system = self.mechanism, self.task.system
        trajectory, kinetic, potential = trajectory_of(self.task, m, times, blocks)
        trajectory.work = self.integration.work
        if COMPILED in {segment.stage.engine for segment in self.integration.segments}:
            trajectory.engine = COMPILED
        if isinstance(m, SnappedMechanism):
            trajectory.as_declared(partial(declared_closure, system, declared(m.declared)), m.changes.tol)
        return trajectory, np.stack([kinetic, potential, *(done[[2, 0, 1]] * system.par.L**2)])

    def _states(self, flat: Array) -> Iterator[tuple[Index, Task, ClosedChart, Array, Array]]:
        """Closed states at times ``(T,)`` in blocks: places, task, states, rates of the independent columns, what was lost and
        done ``(3, T)``.
        """
        for places, stage, y, done in self.integration.at(flat):
            together = positions_together(self.task.system, len(y) // 2 - 1)
            for part in in_blocks(np.arange(len(places)), together):
                closed, v = stage.states(flat[places[part]], y[:, part])
                if not closed.done.all() or float(closed.here.closure.max()) > CLOSED:
                    raise ResponseError(
                        f"mechanism {self.mechanism.name!r}: the loops do not close at some time of {flat[places[part]]}"
                    )
                yield places[part], stage.task_at(flat[places[part]]), closed, v, done[:, part]

    def motion(self, t: Array) -> tuple[Array, Array]:
        """Internal states ``(nx, T)``, rates and accelerations of all freedoms ``(2, F, T)`` at times ``(T,)``."""
        s = self.task.system
        out = np.empty((s.n_state + 2 * s.n_freedoms, len(t)))
        for places, stage, y, _ in self.integration.at(t):
            known = stage.by_kernel(t[places], y)
            if known is None:
                parts = [found.rates for _, found in self._moved(t[places])]
                known = np.concatenate([np.concatenate([one.here.x, one.dq, one.ddq]) for one in parts], axis=1)
            out[:, places] = known
        return out[: s.n_state], out[s.n_state :].reshape(2, s.n_freedoms, len(t))

    def efforts_held(self, t: Array) -> Array:
        """Efforts ``(p, T)`` of the freedoms that are prescribed and held at times ``(T,)`` of one stage."""
        parts = sorted(self._moved(t), key=lambda one: int(one[0][0]))
        return np.concatenate([found.held for _, found in parts], axis=1)

    def _moved(self, t: Array) -> Iterator[tuple[Index, Moved]]:
        """Rates, accelerations and forces at times ``(T,)`` in blocks."""
        for places, task, closed, v, _ in self._states(t):
            yield places, moved(closed, v, task.prescribed_at(t[places])[1:], task.loads, t[places])

    def site(self, t: Array) -> Site:
        """What loads see of the motion at times ``(T,)``."""
        x, rates = self.motion(t)
        here = Configuration(self.task.system, x)
        velocities = Velocities(here, rates[0])
        return Site(here, velocities, self.task.system.coordinates_of(here.x), (len(t),), np.arange(len(t)), t)

    def freedom(self, name: str, t: Array) -> Array:
        """Position, velocity and acceleration ``(3, T)`` of a freedom at times ``(T,)``, user's units."""
        s = self.task.system
        k, j = self.mechanism.freedom(name)
        column = int(s.first_column[k]) + j
        unit = s.par.L if s.is_length[column] else 1.0
        x, rates = self.motion(t)
        return unit * np.stack([x[s.single_rows[column]], *rates[:, column]])


@dataclass(frozen=True)
class EventData:
    """Something that happened, in words, and when."""

    text: str
    t: float


@dataclass(frozen=True)
class ResponseData(SolutionData):
    """What the summary of a response tells, of all pairs."""

    begin: Annotated[float, "the first output time, in the declared unit"]
    reached: Annotated[float, "the last output time"]
    stopped: Annotated[str, "why the motion was not followed to its end; empty where it was"]
    kinetic_energy: Annotated[float, "its greatest value"]
    energy_balance: Annotated[float, "greatest error of the balance of energies, of the greatest kinetic energy"]
    energy_lost: Annotated[
        EnergyLost | None, "how much is lost, of the greatest energy, and from when on the motion is doubtful"
    ]
    events: tuple[EventData, ...]


def response_data(r: Response) -> ResponseData:
    """All that a summary tells."""
    t, kinetic = np.atleast_1d(r.t), float(np.abs(r.energy.kinetic).max(initial=0.0))
    off = float(np.abs(r.energy.balance).max(initial=0.0)) / (kinetic or 1.0)
    events = tuple(EventData(str(one), float(one.t)) for one in r.events)
    return ResponseData(
        **vars(solution_data(r._values)),
        begin=float(t[0]),
        reached=float(t[-1]),
        stopped=r.stopped,
        kinetic_energy=kinetic,
        energy_balance=off,
        energy_lost=r._energy_lost(),
        events=events,
    )


def read_start(
    m: Mechanism, start: Mapping[str, Any], given: Prescribed, begin: float, faults: list[str]
) -> dict[str, float]:
    """Coordinates at the beginning by full names, those prescribed among them; adds what is wrong to ``faults``."""
    out: dict[str, float] = {}
    known = dict(zip(given.names, given.at(begin)[0].tolist(), strict=True))
    for name, value in start.items():
        fault = m.freedom_fault(name, single=True)
        number = value if fault else m.in_own_units(name, value)
        if fault:
            faults.append(f"start of {name!r}: {fault}")
        elif not is_numeric(number, ()):
            faults.append(wrong(number, f"start of {name!r}", "a finite number"))
        elif m.full_name(name) in out:
            faults.append(f"start of {name!r}: is given twice")
        elif known.get(m.full_name(name), number) != number:
            faults.append(
                f"start of {name!r} = {number!r}: its motion is prescribed, {known[m.full_name(name)]:g} at t = {begin:g}; leave it out"
            )
        else:
            out[m.full_name(name)] = float(number)
    return {**out, **known}


def read_rates(m: Mechanism, rates: Mapping[str, Any], faults: list[str]) -> dict[str, float]:
    """Rates at the beginning by full names; adds what is wrong to ``faults``."""
    out: dict[str, float] = {}
    for name, value in rates.items():
        fault = m.freedom_fault(name, single=False)
        number = value if fault else without_units(value, (0 if m.turns(name) else 1, 0, -1), m.units)
        if fault:
            faults.append(f"rate of {name!r}: {fault}")
        elif not is_numeric(number, ()):
            faults.append(wrong(number, f"rate of {name!r}", "a finite number"))
        else:
            out[m.full_name(name)] = float(number)
    return out


def started(m: Mechanism, start: Mapping[str, float], given: Prescribed) -> tuple[System, Array, Index]:
    """The scaled system, the closed state at the beginning, and the prescribed columns."""
    system, x = assembled_at(m, start)
    columns, _ = named_columns(m, system, dict.fromkeys(given.names, 0.0))
    return system, x, columns


def _rates_with_flanks(
    m: Mechanism, task: Task, x: Array, rates: Mapping[str, float], begin: float, closed: Mapping[str, float]
) -> Array:
    """The rates with which flanks that touch keep ``closed``, where those given let them."""
    try:
        return start_rates(m, task, x, {**closed, **rates}, begin)
    except DeclarationError:
        return start_rates(m, task, x, rates, begin)


def start_rates(m: Mechanism, task: Task, x: Array, rates: Mapping[str, float], begin: float) -> Array:
    """Rates ``(F,)`` at the beginning: those given and prescribed, the others as small as the closure lets them be.

    Raises
    ------
    DeclarationError
        where they contradict the closure.
    Stopped
        where they do not tell how the motion begins, as at a change point.
    """
    s = task.system
    names = [*task.prescribed.names, *rates]
    values = [*task.prescribed.at(begin)[1].tolist(), *rates.values()]
    columns = s.columns_of(names)
    wanted = np.array(values) / np.where(s.is_length[columns], s.par.L, 1.0)
    closure = closure_rank(Configuration(s, x[:, None]), engine=task.engine)
    N = closure.motions
    if N.shape[1] > 1 and closure.rank < closure.count:
        beside = finite_motion(s, x, closure, task.engine).mobility
        if beside < N.shape[1]:
            raise Stopped(_where_branches_meet(s, x, N, beside))
    if task.held:
        N = _at_rest(task, x)
    if not len(names):
        return np.zeros(s.n_freedoms)
    a = np.linalg.lstsq(N[columns], wanted, rcond=MOTIONS.dependent)[0]
    left = np.abs(N[columns] @ a - wanted)
    # part of the given rates by which they may miss the closure before they contradict it
    if left.max() > 1e-9 * max(1.0, float(np.abs(wanted).max())):
        rank = rank_of(singular_values(N[columns]), MOTIONS.dependent)
        held = " with the passive freedoms at rest" if task.held else ""
        closed = ", ".join(f"{n} {v:.6g}" for n, v in zip(names, (N[columns] @ a).tolist(), strict=True))
        raise DeclarationError(
            f"respond {m.name!r}",
            [
                f"rates of {', '.join(names)}: contradict the closure{held}, which lets {rank} of these {len(names)} move independently; "
                f"nearest rates that it allows (radians, or lengths / {s.par.L:.4g}, a unit of time): {closed}"
            ],
        )
    return np.asarray(N @ a)


def _where_branches_meet(s: System, x: Array, motions: Array, beside: int) -> str:
    """What is said of a start in a singular position: its motions are not those that the mechanism has ``beside`` it."""
    fastest = int(np.argmax(np.where(s.single_rows >= 0, np.abs(motions).max(axis=1), 0.0)))
    ways = branches(s, x, np.array([fastest], dtype=np.intp)) if beside == 1 else ()
    meet = f" ({branches_text(ways, s.m.freedom_names()[fastest])})" if ways else ""
    return (
        f"it begins in a singular position{meet}: its mobility is {motions.shape[1]} there and {beside} beside it, so that rates do not "
        "tell how the motion goes on; start beside it, on the branch that is meant"
    )


def _at_rest(task: Task, x: Array) -> Array:
    """Orthonormal motions that leave the passive links at rest."""
    chart = task.chart(x)
    f = chart.solver.factored(chart.start, chart.which)
    columns = Columns(chart.start, f, len(chart.free), chart.held)
    Z = np.concatenate([columns.Z, columns.Zp], axis=1)[..., 0]
    return np.asarray(scipy.linalg.orth(Z))


class SeenMotion(Protocol):
    """What is seen of a motion."""

    def site(self, t: Array) -> Site:
        """What loads see of it at times ``(T,)``."""


class Chatter:
    """Watches short steps for laws that jump with the sign of their rate."""

    def __init__(self, motion: SeenMotion, loads: tuple[Load, ...], span: float) -> None:
        self.motion, self.span = motion, span
        self.laws = [load for load in loads if isinstance(load, Law) and load.of_time]
        self._ends: list[float] = []

    def look(self, begin: float, end: float) -> None:
        """Look at an accepted step.

        Raises
        ------
        Stopped
            where a law makes steps chatter.
        """
        # part of the time of a motion below which a step is one of those that chatter
        if not self.laws or end - begin > 1e-5 * self.span:
            self._ends = []
            return
        self._ends.append(end)
        # short steps, one after the other, after which the laws are looked at
        if len(self._ends) < 12:
            return
        site, self._ends = self.motion.site(np.array(self._ends)), []
        for law in self.laws:
            x, v = law.coordinate(site)
            if (np.diff(np.sign(v)) != 0).sum() < 2:
                continue
            fast = np.abs(v).max()
            # part of the rates at which a law is asked again: what jumps does so however near to zero they are
            both = (np.full(len(v), rate) for rate in (fast, 1e-4 * fast))
            wide, near = (law.force(site, x, rate) - law.force(site, x, -rate) for rate in both)
            # part of the difference of the forces to both sides that a jump leaves at these rates
            if np.abs(near).min() > 0.5 * np.abs(wide).max():
                raise Stopped(
                    f"{law.where}its force jumps by {abs(near[-1]):.4g} where its rate changes sign, as dry friction does; at "
                    f"t = {end:.6g}, x = {x[-1]:.6g}, it holds what it acts on, and steps chatter about a rate of zero. A force law "
                    "carries no friction that sticks: declare it with mg.Friction, or let the force rise over a small rate, as "
                    "np.tanh(v / v0) does"
                )


OnStopName = Literal["raise", "return"]


@door
def respond(
    m: Mechanism,
    t: Any = None,
    *,
    start: Mapping[str, float] | None = None,
    rates: Mapping[str, float] | None = None,
    motions: Mapping[str, Any] | None = None,
    loads: Iterable[Load] | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    method: MethodName | None = None,
    max_step: Limit | None = None,
    engine: MotionEngineName = "auto",
    events: Iterable[Event] | Event | None = None,
    stops: Iterable[Stop] | Stop | None = None,
    on_stop: OnStopName = "raise",
    passive: PassiveName | None = None,
    tol: float | None = None,
    progress: Callable[[float], None] | None = None,
    tolerances: Tolerances | None = None,
) -> Response:
    """Integrate the motion under given loads (forward dynamics), with all reactions.

    The accelerations of as many independent freedoms as the mechanism has mobility are unknowns beside the reactions:
    ``M(u) u'' + h(u, u') = Q``. Steppers of ``scipy.integrate``; the loops are closed at every output. Arguments from ``t`` to
    ``stops`` default to those of ``m.response``. Dry friction (``Friction``) of pairs and teeth slips, sticks and reverses by events, so
    that nothing creeps at rest; where several pairs stick together, how they share the load is not determined: NaN. Impacts know the
    friction of contacts that are closed, by Poisson's law, and none of other pairs.

    Parameters
    ----------
    m : Mechanism
        The mechanism. Declared drives without a motion are free.
    t : (2,) or (T,) array_like, optional
        ``(begin, end)``, for outputs at the steps taken, or the rising times of the outputs.
    start : mapping of str to float, optional
        Coordinates at the beginning [rad, length]; others stay as near as possible to the declared ``start``.
    rates : mapping of str to float, optional
        Rates at the beginning; what they leave open is stationary (least rates).
    motions : mapping, optional
        Prescribed freedoms: freedom -> ``Motion`` with ``t`` (its quintic spline), or a function
        ``t -> (position, velocity, acceleration)``. A drive with a stored motion is prescribed.
    loads : iterable of load, optional
        Replace the declared loads; constants and functions, no arrays over positions.
    rtol, atol : float
        Relative and absolute tolerance of a step (radians and lengths / L, and their rates). Default: 1e-8 and 1e-10.
    method : str
        Integrator: explicit ``"RK23"``, ``"RK45"``, ``"DOP853"`` (default), for stiff loads ``"Radau"``, ``"BDF"``, ``"LSODA"``.
    max_step : float, optional
        Longest step. Steps end at the ``breaks`` of loads. A look at 2,000 times between begin and end finds pulses, and humps of tables
        and functions of place or rate, that steps missed; shorter ones need ``breaks``, or ``max_step``.
    engine : {"auto", "dense", "sparse", "compiled"}
        As in ``solve``; the kernel finds the accelerations of independent freedoms, or tabulates the path of a single one and takes the
        steps of DOP853 along it.
    events : Event or iterable of Event, optional
        Watched quantities; a terminal event ends the motion.
    stops : Stop or iterable of Stop, optional
        Limits of freedoms: impact, rest and release; their force is an ``applied_effort``.

    on_stop : {"raise", "return"}
        If the motion cannot be integrated to its end: raise, or return what there is, with ``stopped`` set.
    passive : {"free", "held"}
        Passive freedoms move by inertia and loads, or are held fixed as in ``solve`` (``passive_effort`` is what that takes).
    tol : float, optional
        As in ``solve``.
    progress : callable, optional
        Called with the time reached after every step.
    tolerances : Tolerances, optional
        Numbers by which to decide, see ``Tolerances``. Default: those of the mechanism, which are the default ones.

    Returns
    -------
    Response

    Raises
    ------
    DeclarationError
        Invalid arguments, or what ``engine="compiled"`` does not carry.
    AssemblyError
        The loops cannot be closed at the beginning.
    ResponseError
        The motion cannot be integrated to its end; ``error.solution`` is the Response so far.
    FrictionError
        Friction has no finite force from some time on, or several; ``.kind`` says which.
    MissingExtraError
        ``engine="compiled"`` without a C compiler.

    Examples
    --------
    >>> import mechgraph as mg
    >>> r = mg.respond(mg.load("windows-2"), (0, 1), rates={"A0": -1.0})
    >>> bool(abs(r.energy.balance).max() < 1e-6 * r.energy.kinetic.max())
    True
    """
    given = {"t": t, "start": start, "rates": rates, "motions": motions, "rtol": rtol, "atol": atol, "method": method}
    how = _how(m, given | {"max_step": max_step, "events": events, "stops": stops, "passive": passive})
    faults = option_faults(
        {
            "method": (how.method, METHODS),
            "passive": (how.passive, get_args(PassiveName)),
            "engine": (engine, get_args(MotionEngineName)),
            "on_stop": (on_stop, get_args(OnStopName)),
        }
    )
    faults += mapping_faults(start=how.start, rates=how.rates, motions=how.motions)
    faults += tolerance_faults(how.rtol, how.atol, how.max_step)
    times, watched, limits = (
        read_times(how.t, faults),
        read_events(m, how.events, faults),
        read_stops(m, how.stops, faults),
    )
    replaced = None if loads is None else items_of(loads, "loads", faults)
    if faults:
        raise DeclarationError(f"respond {m.name!r}", faults)
    declared = m if replaced is None else m.replace(loads=replaced)
    faults += friction_faults(declared, how.passive)
    bounces = {f"{pair.name}.gap": pair.restitution for pair in declared.pairs if pair.restitution is not None}
    declared, flanks = with_play(declared)
    limits = (*flanks, *limits)
    declared, gaps = with_contacts(declared, limits, declared.tol or 0.0 if tol is None else tol)
    m = meant(declared, tol, "respond")
    begin = float(times[0])
    prescribed = read_motions(m, how.motions, times, faults)
    wanted = gaps | read_start(m, how.start, prescribed, begin, faults) if not faults else {}
    wanted_rates = read_rates(m, how.rates, faults)
    faults += [f"{one.where}{', '.join(one.over_positions)}: {OVER_POSITIONS}" for one in m.loads if one.over_positions]
    if faults:
        raise DeclarationError(f"respond {m.name!r}", faults)
    m = m.replace(drives=list(prescribed.names))
    try:
        system, x, columns = started(m, wanted, prescribed)
    except AssemblyError as error:
        if tol is None and m.tol is None:
            hinted(declared, error)
        raise
    task = Task(system, Loads.of(m), prescribed, columns, engine_for(system.n_rows, 1, engine))
    if how.passive == "held":
        task = replace(task, held=free_motion(system, x, columns, task.engine).passive)
    task = replace(task, library=library_for(system, task.loads, bool(task.held), engine))
    try:
        dq = _rates_with_flanks(
            m, task, x, wanted_rates, begin, {one.freedom: 0.0 for one in flanks if 0.0 in (one.lower, one.upper)}
        )
    except Stopped as stop:
        raise ResponseError(f"mechanism {m.name!r}: {stop}") from None
    standing = Rests.of(m, task, limits, bounces)
    faults = standing.faults(x)
    if faults:
        raise DeclarationError(f"respond {m.name!r}", faults)
    it = Integration(
        "DOP853" if how.method == "auto" else how.method,
        float(how.rtol),
        float(how.atol),
        np.inf if how.max_step is None else float(how.max_step),
        tuple(sorted({time for load in m.loads for time in load.break_times} | set(prescribed.breaks))),
        float(times[-1] - begin) / OF_ALL,
    )
    return _followed(Course(it, task, m, times), standing, watched, x, dq, on_stop, progress)


def _how(m: Mechanism, given: Mapping[str, Any]) -> Any:
    """The arguments of a call; those left out are what is stored with the mechanism, else what serves by itself."""
    stored = m.response
    setup = stored or ResponseSetup((0.0, 1.0))
    fallback = {name: getattr(setup, name) for name in given if name not in ("t", "motions")}
    fallback |= {"t": stored and stored.times, "motions": {one.freedom: one.motion for one in setup.motions}}
    return SimpleNamespace(**{name: fallback[name] if value is None else value for name, value in given.items()})


def _followed(
    course: Course,
    stops: Rests,
    watched: tuple[Event, ...],
    x: Array,
    dq: Array,
    on_stop: OnStopName,
    progress: Callable[[float], None] | None,
) -> Response:
    """The response to the end, to a terminal event, or to where the motion cannot be followed on."""
    happened: list[Occurrence] = []
    last, why = None, ""
    try:
        for one in _occurrences(course, stops, Watch(watched, course, course.integration.apart), x, dq, progress):
            happened.append(one)
            if one.event.terminal:
                last, why = one.t, str(one)
                break
    except (Stopped, KeyboardInterrupt, DeclarationError) as stop:
        if isinstance(stop, DeclarationError) and not course.integration.segments:
            raise
        why = str(stop) or "interrupted"
        why = f"mechanism {course.mechanism.name!r}: the motion was followed to t = {course.reached:.6g} of {course.times[-1]:.6g}: {why}"
        out = course.outputs()
        if getattr(stop, "kind", "") and (on_stop == "raise" or out is None):
            raise FrictionError(why, {}, out, kind=stop.kind, factor=np.nan) from None  # type: ignore[union-attr]
        if on_stop == "raise" or out is None:
            raise ResponseError(why, out) from (stop if isinstance(stop, DeclarationError) else stop.__cause__)
    else:
        out = course.outputs(last)
    assert out is not None
    out.stopped, out.events = why, tuple(happened)
    # what has no value is NaN in its status, as in solve, and stands in the summary
    for warning in (one for one in out.warnings if not isinstance(one, NotSolved)):
        warnings.warn(f"mechanism {course.mechanism.name!r}: {warning}", MechgraphWarning, stacklevel=4)
    return out


def _occurrences(
    course: Course, stops: Rests, watch: Watch, x: Array, dq: Array, progress: Callable[[float], None] | None
) -> Iterable[Occurrence]:
    """Follow the motion to its end; yields what happens, in the order of time."""
    it, end, t, crowd = course.integration, float(course.times[-1]), course.begin, 0
    chatter = Chatter(course, course.mechanism.loads, end - t)
    dq, lost, first, found = stops.after(t, x, dq)
    it.done = it.done + lost
    yield from found
    while t < end:
        met = None
        for segment in it.run(
            _first_stage(it, stops.held_task(), t, x, dq), t, end, first if np.isfinite(first) else None
        ):
            if progress is not None:
                with stopping("progress"):
                    progress(segment.end)
            chatter.look(segment.begin, segment.end)
            try:
                met = stops.met(course, segment.begin, segment.end, it.apart) if stops else None
            except Stopped as stop:
                if stop.at is not None:
                    it.cut(stop.at)
                raise
            _end_at_ranges(course, segment.begin, segment.end if met is None else met)
            if met is not None:
                crowd = crowd + 1 if met - segment.begin < RESPONSE.soon * (end - t) else 0
                it.cut(met)
            yield from watch.passed(segment.begin, segment.end if met is None else met)
            if met is not None:
                break
        if met is None:
            return
        # impacts and releases, each ``RESPONSE.soon`` after the one before, after which the motion is given up
        if crowd > 1000:
            raise Stopped("impacts and releases of stops follow each other without end")
        at = np.array([met])
        x, (dq, _) = course.motion(at)
        t, x, dq = met, x[:, 0], dq[:, 0]
        dq, lost, first, found = stops.after(t, x, dq)
        it.done = it.done + lost
        yield from found


def _end_at_ranges(course: Course, begin: float, end: float) -> None:
    """End the motion where a pair comes to the end of its curve or surface."""
    system = course.task.system
    columns = system.limits[0]
    if not columns.size:
        return
    looks = begin + (end - begin) * LOOKS_IN_STEP
    over = beyond(system, course.motion(looks)[0]) - BEYOND_END
    met = {}
    for k in range(len(columns)):
        height = partial(_over, course, k)
        t, h = with_turns(height, looks, over[k])
        first = int(np.argmax(h > 0.0))
        if h[first] > 0.0:
            met[k] = first_root(height, t[first - 1], t[first]) if first else begin
    if met:
        k = min(met, key=lambda k: met[k])
        course.integration.cut(met[k])
        name = system.m.freedom_names()[int(columns[k])]
        raise Stopped(f"{name} is at the end of its curve or surface; give a Stop there, or a longer one")


def _over(course: Course, k: int, t: Array) -> Array:
    """How far a pair is beyond the end of its curve or surface at times ``(T,)``."""
    return np.asarray(beyond(course.task.system, course.motion(t)[0])[k] - BEYOND_END)


def _first_stage(it: Integration, task: Task, begin: float, x: Array, dq: Array) -> Stage:
    """Along the path where there is one path; charts otherwise."""
    last = it.segments[-1] if it.segments else None
    if last is not None and isinstance(last.stage, PathStage) and last.stage.task is task:
        arc = last.stage.arc
        return PathStage(arc, begin, float(last.dense(begin)[0]), float(dq[arc.column]))
    motions = closure_rank(Configuration(task.system, x[:, None]), engine=task.engine).motions
    if motions.shape[1] == 1 and not len(task.columns) and not task.loads.dry:
        arc = Arc(task, x, dq)
        it.work.coordinates = "along the path"
        return PathStage(arc, begin, arc.begin, arc.rate)
    it.work.coordinates = "in independent freedoms"
    return ChartStage(task, begin, x, dq)
