"""A mechanism at rest: the generalized forces about a position in independent freedoms, and their derivatives.

    M u'' + C u' + K u = 0,   C = -dQ/du',   K = -dQ/du,   Q the generalized forces at rest

in the independent freedoms of a chart (see ``response.chart``); drives of the mechanism stand still.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import assembled_at, named_columns
from mechgraph.closure.rates import Velocities
from mechgraph.closure.solver import EngineName, engine_for
from mechgraph.errors import DeclarationError, ResponseError
from mechgraph.model.mechanism import Mechanism
from mechgraph.response.chart import Chart, Closed
from mechgraph.response.charts import Task
from mechgraph.response.motion_equations import Columns, Loads, applied
from mechgraph.response.prescribed import OVER_POSITIONS, Prescribed
from mechgraph.response.reading import trajectory_of
from mechgraph.response.settled import settled_slopes
from mechgraph.result.solution import Solution

STEP = 0.004
"""First length of differences (radians, lengths / L); their error and rounding are both near 1e-13 where forces bend within 0.3."""
RATE_STEP = 0.25
"""The same of rates (radians, lengths / L, a unit of time)."""
NOISE_OF_FORCES = 1e-12
"""Rounding of the differences, of the largest force."""


@dataclass(frozen=True)
class Derivatives:
    """Force ``Q (n,)``, ``M``, ``C``, ``K (n, n)`` and the ``noise (n, n)`` of K.

    ``bent, dry``: coordinates in which K, rates in which C is not known, as at a corner of a force or where it jumps with a rate.
    """

    Q: Array
    M: Array
    C: Array
    K: Array
    noise: Array
    bent: tuple[int, ...]
    dry: tuple[int, ...]


class Place:
    """Forces about a chart at rest."""

    def __init__(self, m: Mechanism, call: str, at: Mapping[str, float] | None, engine: EngineName) -> None:
        faults = [
            f"{one.where}{', '.join(one.over_positions)}: {OVER_POSITIONS}" for one in m.loads if one.over_positions
        ]
        if faults:
            raise DeclarationError(f"{call} {m.name!r}", faults)
        self.m = m
        system, x = assembled_at(m, dict(at or {}))
        columns, _ = named_columns(m, system, {d.freedom: 0.0 for d in m.drives})
        q = system.coordinates_of(x[:, None])[columns, 0].tolist()
        still = Prescribed({d.freedom: partial(_still, value) for d, value in zip(m.drives, q, strict=True)})
        self.task = Task(system, Loads.of(m.loads), still, columns, engine_for(system.n_rows, 1, engine))
        self.go(x)
        if not self.n:
            raise DeclarationError(
                f"{call} {m.name!r}", ["nothing can move while its drives are held; m.replace(drives=[]) frees them"]
            )

    def go(self, x: Array) -> None:
        """Lay out a chart at a closed state."""
        self.chart = Chart(self.task.system, x, self.task.columns, self.task.engine)
        self.held = x[self.task.system.single_rows[self.task.columns]][:, None]
        self.n = len(self.chart.free)

    def closed(self, u: Array) -> Closed:
        """Closed states at coordinates ``u (n, T)`` in the chart."""
        guess = self.task.system.advance(self.chart.x0[:, None], self.motions @ u)
        return self.chart.close(guess, u, np.repeat(self.held, u.shape[1], axis=1))

    @property
    def motions(self) -> Array:
        """Rates of all freedoms ``(F, n)`` for unit rates of the independent ones."""
        return self.chart.solver.factored(self.chart.start, self.chart.which).sensitivity()[:, : self.n, 0]

    def forces(self, closed: Closed, v: Array) -> tuple[Array, Array]:
        """Generalized forces ``(n, T)`` and masses ``(n, n, T)`` at closed states with rates ``v (n, T)``, the drives at rest."""
        columns, loads = Columns(closed.here, closed.f, self.n), self.task.loads
        velocities, _, inertia = columns.bound((columns.Z * v).sum(axis=1))
        wrenches, efforts = applied(closed.here, (*loads.stored, *loads.rest), velocities, np.zeros(closed.here.T))
        return columns.force(wrenches + inertia, efforts), columns.mass

    def largest(self) -> float:
        """The largest part that a component of a load has in a generalized force, at rest."""
        closed, loads = self.closed(np.zeros((self.n, 1))), self.task.loads
        columns = Columns(closed.here, closed.f, self.n)
        still = Velocities(closed.here, np.zeros((self.task.system.n_freedoms, 1)))
        acting = [applied(closed.here, some, still, np.zeros(1)) for some in (loads.stored, loads.rest)]
        return columns.largest(*zip(*acting, strict=True))

    def derivatives(self) -> Derivatives:
        """Force, mass, damping and stiffness where the chart was laid out."""
        n = self.n

        def at_rest(u: Array) -> Array:
            at = self.closed(u)
            return np.where(at.done, self.forces(at, np.zeros(u.shape))[0], np.nan)

        place = settled_slopes(at_rest, n, STEP)
        if place is None:
            raise ResponseError(f"mechanism {self.m.name!r}: the loops do not close beside this position")
        one = self.closed(np.zeros((n, 1)))

        def moving(v: Array) -> Array:
            here = one.here.part(np.zeros(v.shape[1], dtype=np.intp))
            f = self.chart.solver.factored(here, np.repeat(self.chart.which, v.shape[1]))
            return self.forces(Closed(here, f, np.ones(v.shape[1], dtype=bool)), v)[0]

        rates = settled_slopes(moving, n, RATE_STEP)
        assert rates is not None  # the position is closed
        M = self.forces(one, np.zeros((n, 1)))[1][..., 0]
        noise = NOISE_OF_FORCES * self.largest() + place.error
        return Derivatives(place.values, M, -rates.slopes, -place.slopes, noise, place.unsettled, rates.unsettled)

    def solution(self) -> Solution:
        """Everything at rest where the chart was laid out."""
        closed = self.closed(np.zeros((self.n, 1)))
        block = np.zeros(1, dtype=np.intp), self.task, closed, np.zeros((self.n, 1))
        trajectory, _, _ = trajectory_of(self.task, self.m, np.zeros(()), [block], at_rest=True)
        return Solution(trajectory)

    def start(self) -> dict[str, float]:
        """Coordinates of all freedoms where the chart was laid out."""
        q = self.task.system.coordinates_of(self.chart.x0[:, None])[:, 0]
        return dict(zip(self.m.freedom_names(), q.tolist(), strict=True))


def _still(value: float, t: float) -> tuple[float, float, float]:
    return value, 0.0, 0.0
