"""Impacts: the equations of motion at a state, nothing held, and what closed limits do to it.

At an impact with stops ``i`` closing at the rates ``w_i = g_i . v`` the impulses ``p_i >= 0`` are those of Newton's law of restitution,

    v+ = v + M^-1 G^T p,   w+ + e w >= 0,   p . (w+ + e w) = 0,

with ``G`` the rows ``g_i`` of independent rates. Stops that are closed at rest hold as long as they press: ``f >= 0``, ``G v' >= 0``,
``f . G v' = 0``. Both are linear complementarity problems of a positive semidefinite matrix ``G M^-1 G^T``, solved as least squares with
``p >= 0``.

Where a contact with friction is closed Poisson's law holds for all that are: compression and then expansion, each a phase in which impulses
``p >= p_least`` along the normals, 0 and e times those of compression, and those along the contacts, in Coulomb's cones of them, fit the
rates at its end. Source: Pfeiffer and Glocker, Multibody Dynamics with Unilateral Contacts, 1996, chapters 5, 6 and 8.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.force.friction import Came
from mechgraph.force.loads import kinetic_energy
from mechgraph.force.reactions import ForceProblem, user_wrench
from mechgraph.force.redundant import unique_reactions
from mechgraph.kinematics.state import Configuration
from mechgraph.maths.se3 import Array, Index, cross
from mechgraph.maths.tolerances import RESPONSE
from mechgraph.memo import dataclass
from mechgraph.model.setups import Event, Occurrence, Stop
from mechgraph.response.charts import Task
from mechgraph.response.motion_equations import NO_INERTIA, ClosedChart, Moved, Stopped, accelerations, moved
from mechgraph.response.rough import Rough


@dataclass(frozen=True)
class Limit:
    """One limit of one freedom, internal units: ``sign * (q - value) >= 0``; ``contact``: the pair that opens there."""

    stop: Stop
    name: str
    column: int
    row: int
    sign: float
    value: float
    contact: str = ""

    @property
    def user(self) -> float:
        """The limit in the user's units."""
        return float(getattr(self.stop, self.name))

    def occurrence(self, t: float, meets: bool) -> Occurrence:
        """What ``Response.events`` says of it."""
        text = f"{self.stop.freedom} {'meets' if meets else 'leaves'} its {self.name} stop"
        if self.contact:
            text = f"{self.contact} {'lands' if meets else 'opens'}"
        event = Event(self.stop.freedom, self.user, name=text)
        return Occurrence(event, t, (self.sign > 0) != meets)


def evaluated(task: Task, t: Array, x: Array, dq: Array) -> tuple[Moved, Configuration]:
    """Accelerations of a task at states ``x (nx, T)`` near each other with rates ``dq (F, T)``."""
    chart, here = task.chart(x[:, 0]), Configuration(task.system, x)
    f = chart.solver.factored(here, np.repeat(chart.which, here.T))
    at = ClosedChart(here, f, np.ones(here.T, dtype=bool), chart.held)
    return moved(at, dq[chart.moving], task.prescribed_at(t)[1:], task.loads, t), here


@dataclass(frozen=True)
class FrictionCone:
    """Friction of a closed limit in an impact: its place among those that are closed, what slides along it, the coefficient."""

    limit: int
    slides: Rough
    mu: float


def _phase(D: Array, w: Array, least: Array, cones: Sequence[tuple[int, Index, float]]) -> Array:
    """Impulses ``(normals, along)`` of a phase of an impact at rates ``w``, the normal ones ``least (n,)`` or more; ``cones``: of a normal
    one the places of those along its contact, and the coefficient.

    One contact after the other takes the impulses that fit its own rates, until all do (projected Gauss-Seidel).
    """
    p = np.zeros(len(w))
    p[: len(least)] = least
    moves = np.flatnonzero(D.diagonal()[: len(least)] > 0.0)
    sizes = [float(np.linalg.eigvalsh(D[np.ix_(along, along)])[-1]) for _, along, _ in cones]
    # rounds after which they do not settle, as where friction feeds on what it presses
    for _ in range(5000):
        before = p.copy()
        for i in moves.tolist():
            p[i] = max(least[i], p[i] - (w[i] + D[i] @ p) / D[i, i])
        for (i, along, mu), size in zip(cones, sizes, strict=True):
            if size > 0.0:
                free = p[along] - (w[along] + D[along] @ p) / size
                p[along] = free * min(1.0, mu * p[i] / max(float(np.linalg.norm(free)), 1e-300))
        if np.abs(D @ (p - before)).max() <= 1e-15 * np.abs(w).max():
            return p
    raise Stopped("an impact with friction has no impulses that agree with themselves", Came.NO_FINITE_FORCE.status)


class FreeEquations:
    """The equations of motion at a state, nothing held: what closed limits do."""

    def __init__(self, task: Task, t: float, x: Array, dq: Array, closed: tuple[Limit, ...]) -> None:
        found, self.here = evaluated(task, np.array([t]), x[:, None], dq[:, None])
        self.dq, self.mass, self.motions, self.closed = dq, found.columns.mass, found.columns, closed
        self.columns = np.array([limit.column for limit in closed])
        self.sign = np.array([limit.sign for limit in closed])
        self.Z = found.columns.Z[..., 0]
        self.rows = np.zeros((len(closed), len(dq)))
        self.rows[np.arange(len(closed)), self.columns.astype(np.intp)] = self.sign
        G = self.rows @ self.Z
        # rate of a freedom for unit rates of the independent ones below which these do not move it
        self.moves = np.abs(G).max(axis=1, initial=0.0) > 1e-12
        self.impulse_to_rate = self._yielding(G)
        self.D = G @ self.impulse_to_rate
        self.w, self.w_rate = self.sign * dq[self.columns], self.sign * np.nan_to_num(found.rates.ddq[self.columns, 0])

    def _yielding(self, G: Array) -> Array:
        """Independent rates ``(n, k)`` that unit impulses along rows ``G (k, n)`` bring."""
        out, left = np.zeros(G.T.shape), np.zeros(G.T.shape)
        for i in np.flatnonzero(np.abs(G).max(axis=1, initial=0.0) > 1e-12):
            (out[:, [i]], left[:, [i]]) = accelerations(self.mass, G[i][:, None])
        if np.abs(left).max(initial=0.0) > RESPONSE.unopposed * np.abs(G).max(initial=0.0):
            raise Stopped(NO_INERTIA)
        return out

    @property
    def still(self) -> NDArray[np.bool_]:
        """Which limits are closed at rest: they would open by next to nothing before they close again."""
        return np.asarray(
            self.w**2 <= 2.0 * RESPONSE.lowest * np.maximum(np.abs(self.w_rate), RESPONSE.lowest), dtype=bool
        )

    @property
    def hit(self) -> NDArray[np.bool_]:
        """Which limits are struck."""
        return np.asarray((self.w < 0.0) & ~self.still)

    def _least(self, D: Array, c: Array) -> Array:
        """``p >= 0`` with ``D p + c >= 0`` and ``p . (D p + c) = 0``."""
        w, U = np.linalg.eigh(D)
        kept = w > 1e-12 * w.max(initial=0.0)
        root = np.sqrt(w[kept])[:, None] * U[:, kept].T
        return np.asarray(scipy.optimize.nnls(root, -(U[:, kept].T @ c) / np.sqrt(w[kept]))[0])

    def struck(self, e: Array) -> tuple[Array, float, Array]:
        """Rates after an impact with coefficients of restitution ``e``, the kinetic energy lost, and the impulses of the limits."""
        if (~self.moves & self.hit).any():
            raise Stopped("a freedom is moved against its stop by prescribed motions alone, which no force can hold up")
        p = self._least(self.D, self.w + e * np.minimum(self.w, 0.0))
        return self._after(self.impulse_to_rate @ p, p @ self.rows)

    def struck_rough(self, e: Array, cones: Sequence[FrictionCone]) -> tuple[Array, float, Array]:
        """The same where some of what is closed rubs: by Poisson's law, compression and then expansion (see ``_phase``)."""
        every = np.eye(len(self.dq))[..., None]
        along = [one.slides.slides(self.here, every)[..., 0] for one in cones]
        rows = np.concatenate([self.rows, *along])
        ends = np.cumsum([len(self.sign), *map(len, along)])
        places = [
            (one.limit, np.arange(begin, end), one.mu)
            for one, begin, end in zip(cones, ends[:-1], ends[1:], strict=True)
        ]
        G = rows @ self.Z
        to_rate = self._yielding(G)
        D, w, none = G @ to_rate, rows @ self.dq, np.zeros(len(self.sign))
        first = _phase(D, w, none, places)
        p = first + _phase(D, w + D @ first, e * first[: len(e)], places)
        return self._after(to_rate @ p, p @ rows)

    def _after(self, change: Array, efforts: Array) -> tuple[Array, float, Array]:
        """Rates after a ``change (n,)`` of the independent ones, and the energy lost, with the impulses in the freedoms."""
        here, after = self.here, self.dq + self.Z @ change
        before, behind = (float(kinetic_energy(here, here.link_twists(dq[:, None]))[0]) for dq in (self.dq, after))
        if self.spent(efforts, after) < -RESPONSE.lost_energy * before:
            raise Stopped(
                "an impact would gain energy: contacts that are closed beside it lead it back; give them restitution=0"
            )
        return after, before - behind, efforts

    def spent(self, impulses: Array, after: Array) -> float:
        """The energy that ``impulses (F,)`` take: not what the kinetic energy loses where prescribed motions do work in the impact."""
        return float(-0.5 * impulses @ (self.dq + after))

    def blow(self, i: int, impulses: Array, spent: float) -> dict[str, Any]:
        """What an occurrence says of an impact with the ``impulses (F,)`` in freedoms, as limit ``i`` is struck; the user's units."""
        here, par = self.here, self.here.system.par
        efforts = impulses[:, None].copy()
        loads = self.motions.inertia_of(
            self.motions.accelerations(np.zeros((6, len(here.system.m.links), 1)), efforts)[0]
        )
        found = unique_reactions(ForceProblem(here, loads, efforts, np.zeros(0, dtype=np.intp), self.motions.f))[..., 0]
        found[:3] += cross(here.pair_points[..., 0], found[3:])
        # what a contact presses is among the reactions
        efforts[here.system.gaps] = 0.0
        found += here.pair_sums(here.E * efforts)[..., 0]
        unit = par.L if here.system.is_length[self.columns[i]] else par.L**2
        wrenches = zip(here.system.m.pairs, user_wrench(par, found).T, strict=True)
        return {
            "impulse": float(unit * self.sign[i] * impulses[self.columns[i]]),
            "energy_lost": float(spent * par.L**2),
            "impulses": {pair.name: wrench for pair, wrench in wrenches},
        }

    def pressing(self) -> tuple[list[int], Array]:
        """Which of the limits that are closed at rest press, so that they hold: independent ones; and the accelerations then."""
        rest = np.flatnonzero(self.still)
        p = np.zeros(len(self.w))
        if len(rest):
            p[rest] = self._least(self.D[np.ix_(rest, rest)], self.w_rate[rest])
        return np.flatnonzero(p > 0.0).tolist(), self.w_rate + self.D @ p
