"""The course of a motion: what was integrated, the Response that is read from it, and its energies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from mechgraph.by_kernel import COMPILED
from mechgraph.determinacy.snapping import SnappedMechanism, declared_closure
from mechgraph.document import Bullets, Document, Heading, Paragraph, Shown
from mechgraph.errors import DeclarationError, ResponseError
from mechgraph.files import plain
from mechgraph.force.loads import Site
from mechgraph.kinematics.assembly import CLOSED
from mechgraph.kinematics.motion_path import in_blocks
from mechgraph.kinematics.rates import Velocities
from mechgraph.kinematics.state import Configuration
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import RESPONSE
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.parameters import declared
from mechgraph.quantities import real_array, wrong
from mechgraph.response.charts import Task, trajectory_of
from mechgraph.response.integration import Integration, Occurrence
from mechgraph.response.motion_equations import ClosedChart, moved, positions_together
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
            f"energy balance: off by {self.error:.2g} of the greatest energy, from t = {self.t:.4g} on, so that the motion "
            "from there is doubtful (a change point or a jump of the loads that steps do not resolve); give a smaller rtol"
        )


@dataclass(frozen=True, repr=False)
class Energy(Shown):
    """Energies over the times ``t (T,)`` in the user's units.

    ``kinetic``; ``potential`` of gravity and springs; ``work`` done since the start by prescribed drivers and by loads without a potential
    energy. ``kinetic + potential - work`` is constant; ``start`` is its value at the start.
    """

    kinetic: Array
    potential: Array
    work: Array
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
        trajectory, *parts = self._read(times)
        kinetic, potential, work = (part.reshape(times.shape) for part in parts)
        return Response(trajectory, Energy(kinetic, potential, work, self._energy_at_start, times), self)

    def moments(self, t: Array) -> list[Response]:
        """The responses at each of several times ``(T,)``, evaluated together."""
        (whole, *parts), out = self._read(t), []
        for i, at in enumerate(t.tolist()):
            values = whole.part(slice(i, i + 1))
            values.batch, values.t = (), np.array(at)
            kinetic, potential, work = (part[i] for part in parts)
            out.append(Response(values, Energy(kinetic, potential, work, self._energy_at_start, values.t), self))
        return out

    @cached_property
    def _energy_at_start(self) -> float:
        _, kinetic, potential, work = self._read(np.array(self.begin))
        return float((kinetic + potential - work)[0])

    @cached_property
    def greatest(self) -> float:
        """The greatest energy of the motion at its steps, of many at some of them."""
        ends = np.array([self.begin, *(segment.end for segment in self.integration.segments)])
        # steps at which the greatest energy of a motion is looked for
        return self.response(ends[:: max(1, len(ends) // 100)]).energy.greatest

    def _read(self, times: Array) -> tuple[Trajectory, Array, Array, Array]:
        """The trajectory at times, with kinetic and potential energy and work, flat."""
        flat = times.reshape(-1)
        works = np.zeros(flat.size)
        blocks = []
        for places, task, closed, v, work in self._states(flat):
            works[places] = work
            blocks.append((places, task, closed, v))
        m, system = self.mechanism, self.task.system
        trajectory, kinetic, potential = trajectory_of(self.task, m, times, blocks)
        trajectory.work = self.integration.work
        if COMPILED in {segment.stage.engine for segment in self.integration.segments}:
            trajectory.engine = COMPILED
        if isinstance(m, SnappedMechanism):
            trajectory.as_declared(partial(declared_closure, system, declared(m.declared)), m.changes.tol)
        return trajectory, kinetic, potential, works * system.par.L**2

    def _states(self, flat: Array) -> Iterator[tuple[Index, Task, ClosedChart, Array, Array]]:
        """Closed states at times ``(T,)`` in blocks: places, task, states, rates of the independent columns, work done."""
        for places, stage, y, work in self.integration.at(flat):
            together = positions_together(self.task.system, (len(y) - 1) // 2)
            for part in in_blocks(np.arange(len(places)), together):
                closed, v = stage.states(flat[places[part]], y[:, part])
                if not closed.done.all() or float(closed.here.closure.max()) > CLOSED:
                    raise ResponseError(
                        f"mechanism {self.mechanism.name!r}: the loops do not close at some time of {flat[places[part]]}"
                    )
                yield places[part], stage.task, closed, v, work[part]

    def positions(self, t: Array) -> Array:
        """Internal states ``(nx, T)`` at times ``(T,)``."""
        x = np.empty((self.task.system.n_state, len(t)))
        for places, _, closed, _, _ in self._states(t):
            x[:, places] = closed.here.x
        return x

    def rates(self, t: Array) -> Array:
        """Rates and accelerations ``(2, F, T)`` of all freedoms at times ``(T,)``, internal units."""
        out = np.empty((2, self.task.system.n_freedoms, len(t)))
        for places, task, closed, v, _ in self._states(t):
            at = t[places]
            rates = moved(closed, v, task.prescribed_at(at)[1:], task.loads, at).rates
            out[0][:, places], out[1][:, places] = rates.dq, rates.ddq
        return out

    def site(self, t: Array) -> Site:
        """What loads see of the motion at times ``(T,)``."""
        here = Configuration(self.task.system, self.positions(t))
        velocities = Velocities(here, self.rates(t)[0])
        return Site(here, velocities, self.task.system.coordinates_of(here.x), (len(t),), np.arange(len(t)), t)

    def freedom(self, name: str, t: Array) -> Array:
        """Position, velocity and acceleration ``(3, T)`` of a freedom at times ``(T,)``, user's units."""
        s = self.task.system
        k, j = self.mechanism.freedom(name)
        column = int(s.first_column[k]) + j
        unit = s.par.L if s.is_length[column] else 1.0
        return unit * np.stack([self.positions(t)[s.single_rows[column]], *self.rates(t)[:, column]])


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
