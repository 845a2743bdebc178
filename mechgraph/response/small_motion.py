"""Equilibrium, and small motions about it: mass, damping and stiffness in independent coordinates, frequencies and modes.

    M u'' + C u' + K u = 0,   C = -dQ/du',   K = -dQ/du,   Q the generalized forces at rest

in the independent freedoms of a chart (see ``response.chart``); drives of the mechanism stand still.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import door
from mechgraph.closure.assembly import assembled_at, named_columns
from mechgraph.closure.rates import Velocities
from mechgraph.closure.solver import EngineName, engine_for
from mechgraph.document import Document, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError, MechgraphWarning, ResponseError, counted, listed
from mechgraph.model.mechanism import Mechanism
from mechgraph.response.chart import Chart, Closed
from mechgraph.response.charts import Task
from mechgraph.response.motion_equations import MASSLESS, Columns, Loads, in_unit_inertias
from mechgraph.response.prescribed import OVER_POSITIONS, Prescribed
from mechgraph.response.reading import trajectory_of
from mechgraph.result.numbers import bracket, number
from mechgraph.result.solution import Solution
from mechgraph.units import unit_of

STEP = 0.004
"""Step of the differences (radians, lengths / L); their error and rounding are both near 1e-13 where forces bend within 0.3."""
STENCIL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
"""Steps and weights of the first derivative by central differences of eighth order."""
EQUILIBRIUM_STEPS = 60
"""Most Newton steps to an equilibrium."""
LONGEST_EQUILIBRIUM_STEP = 0.3
"""Longest of them."""
BALANCED = 1e-12
"""Generalized force, against the largest that a load exerts on the way, that counts as none."""
UNBALANCED = 1e-6
"""The same above which a position is said to be none of equilibrium."""
STIFF = 1e-9
"""Eigenvalue of the stiffness, against the largest, that counts as none: neither stable nor unstable."""

STABLE = {True: "stable", False: "unstable", None: "neither stable nor unstable to second order"}
"""How a position of equilibrium is called."""
NAMED = 8
"""Most motions or coordinates that are shown."""


class _Place:
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
        guess = self.task.system.advance(self.chart.x0[:, None], self._motions @ u)
        return self.chart.close(guess, u, np.repeat(self.held, u.shape[1], axis=1))

    @property
    def _motions(self) -> Array:
        return self.chart.solver.factored(self.chart.start, self.chart.which).sensitivity()[:, : self.n, 0]

    def forces(self, closed: Closed, v: Array) -> tuple[Array, Array]:
        """Generalized forces ``(n, T)`` and masses ``(n, n, T)`` at closed states with rates ``v (n, T)``, the drives at rest."""
        columns, loads = Columns(closed.here, closed.f, self.n), self.task.loads
        velocities, _, inertia = columns.bound((columns.Z * v).sum(axis=1))
        wrenches, efforts = columns.applied((*loads.stored, *loads.rest), velocities, np.zeros(closed.here.T))
        return columns.force(wrenches + inertia, efforts), columns.mass

    def largest(self) -> float:
        """The largest part that a component of a load has in a generalized force, at rest."""
        closed, loads = self.closed(np.zeros((self.n, 1))), self.task.loads
        columns = Columns(closed.here, closed.f, self.n)
        still = Velocities(closed.here, np.zeros((self.task.system.n_freedoms, 1)))
        applied = [columns.applied(some, still, np.zeros(1)) for some in (loads.stored, loads.rest)]
        return columns.largest(*zip(*applied, strict=True))

    def derivatives(self) -> tuple[Array, Array, Array, Array]:
        """Force ``(n,)``, mass, damping and stiffness ``(n, n)`` where the chart was laid out."""
        n, eye = self.n, np.eye(self.n)
        steps = np.concatenate([sign * k * STEP * eye for k, _ in STENCIL for sign in (1, -1)], axis=1)
        at = self.closed(np.concatenate([np.zeros((n, 1)), steps], axis=1))
        if not at.done.all():
            raise ResponseError(
                f"mechanism {self.m.name!r}: the loops do not close {STEP * 4:g} (radians, lengths / L) from here"
            )
        Q, M = self.forces(at, np.zeros((n, at.here.T)))
        K = np.zeros((n, n))
        for i, (_, weight) in enumerate(STENCIL):
            ahead, back = (Q[:, 1 + (2 * i + j) * n : 1 + (2 * i + j + 1) * n] for j in (0, 1))
            K -= weight * (ahead - back) / STEP
        here = Closed(at.here.part(np.zeros(n, dtype=np.intp)), at.f, np.ones(n, dtype=bool))
        f = self.chart.solver.factored(here.here, np.repeat(self.chart.which, n))
        here = Closed(here.here, f, here.done)
        ahead, back = (self.forces(here, sign * eye)[0] for sign in (1.0, -1.0))
        return Q[:, 0], M[:, :, 0], -0.5 * (ahead - back), K

    def solution(self) -> Solution:
        """Everything at rest where the chart was laid out."""
        closed = self.closed(np.zeros((self.n, 1)))
        trajectory, _, _ = trajectory_of(
            self.task, self.m, np.zeros(()), [(np.zeros(1, dtype=np.intp), self.task, closed, np.zeros((self.n, 1)))]
        )
        return Solution(trajectory)

    def start(self) -> dict[str, float]:
        """Coordinates of all freedoms where the chart was laid out."""
        q = self.task.system.coordinates_of(self.chart.x0[:, None])[:, 0]
        return dict(zip(self.m.freedom_names(), q.tolist(), strict=True))


def _still(value: float, t: float) -> tuple[float, float, float]:
    return value, 0.0, 0.0


class Equilibrium(Mechanism):
    """The mechanism with ``start`` set to a position in which its loads balance.

    Attributes
    ----------
    stable : whether the potential energy is least there (True), not (False), or flat to second order in some direction (None).
    solution : everything at rest there, reactions included.
    """

    stable: bool | None
    solution: Solution

    def document(self) -> Document:
        """The position found, its kind, and the mechanism."""
        m = super().document()
        return Document(f"Equilibrium of {self.name}", (Paragraph(f"{STABLE[self.stable].capitalize()}."), *m.blocks))

    def __repr__(self) -> str:
        start = ", ".join(f"{name} = {value:.6g}" for name, value in list(self.start.items())[:NAMED])
        more = ", ..." if len(self.start) > NAMED else ""
        return f"Equilibrium({self.name!r}, {STABLE[self.stable]}, at {start or 'the declared configuration'}{more})"

    def __reduce__(self) -> tuple[Any, ...]:
        return _balanced, (self._arguments(), self.stable, self.solution)


@door
def equilibrium(m: Mechanism, start: Mapping[str, float] | None = None, *, engine: EngineName = "auto") -> Equilibrium:
    """A position in which the declared loads balance, with the declared drives at their place: Newton from ``start``.

    Parameters
    ----------
    start : coordinates of freedoms near which to look, beside the declared ``start``.
    engine : as in ``solve``.

    Raises
    ------
    DeclarationError, AssemblyError
    ResponseError
        where none is found.
    """
    place = _Place(m, "equilibrium of", start, engine)
    largest = 0.0
    for _ in range(EQUILIBRIUM_STEPS):
        Q, M, _, K = place.derivatives()
        largest = max(largest, float(np.abs(Q).max()), float(np.abs(K).max()) * STEP)
        if np.abs(Q).max() <= BALANCED * largest or not largest:
            break
        step: Array = np.asarray(np.linalg.lstsq(K, Q, rcond=1e-12)[0], dtype=float)
        size = float(np.abs(step).max())
        closed = place.closed(step[:, None] * min(1.0, LONGEST_EQUILIBRIUM_STEP / size if size else 1.0))
        if not closed.done[0]:
            closed = place.closed(0.1 * step[:, None] * min(1.0, LONGEST_EQUILIBRIUM_STEP / size))
        if not closed.done[0]:
            break
        place.go(closed.here.x[:, 0])
    else:
        raise ResponseError(
            f"mechanism {m.name!r}: no equilibrium was found near start in {EQUILIBRIUM_STEPS} steps; generalized forces of "
            f"{np.abs(Q).max():.3g} are left (internal units). Give another start; loads that drive it on and on have none"
        )
    if np.abs(Q).max() > 1e3 * BALANCED * (largest or 1.0):
        raise ResponseError(
            f"mechanism {m.name!r}: no equilibrium was found: the motion towards it is stopped by the loops"
        )
    w = np.linalg.eigvalsh(0.5 * (K + K.T))
    flat = STIFF * float(np.abs(w).max(initial=0.0))
    stable = None if np.abs(w).min() <= flat else bool(w.min() > 0)
    return _balanced({**m._arguments(), "start": place.start()}, stable, place.solution())


def _balanced(arguments: dict[str, Any], stable: bool | None, solution: Solution) -> Equilibrium:
    out = Equilibrium(**arguments)
    out._set(stable=stable, solution=solution)
    return out


@dataclass(frozen=True, repr=False)
class Linearized(Shown):
    """Small motions about a position of equilibrium.

    ``freedoms``: names of the independent ones ``(n,)``; ``M, C, K (n, n)`` in the user's units (coordinates of these freedoms);
    ``force (n,)`` what is left of the balance, zero in an equilibrium; ``motions (F, n)`` rates of all freedoms for unit rates of the
    independent ones, user's units; ``solution`` everything at rest there.
    """

    mechanism: Mechanism
    freedoms: tuple[str, ...]
    M: Array
    C: Array
    K: Array
    force: Array
    motions: Array
    solution: Solution

    def document(self) -> Document:
        """Frequencies, damping and shapes of the motions."""
        time = self.mechanism.units.get("time", "")
        per = unit_of(self.mechanism.units, (0, 0, -1))
        rows = []
        for w, ratio, shape in zip(self.frequencies[:NAMED], self.damping[:NAMED], self.modes[:NAMED], strict=False):
            largest = sorted(shape, key=lambda name: -abs(shape[name]))[:4]
            swings = (number(w), number(w / (2 * np.pi))) if np.isfinite(w) else ("none", "")
            rows.append((*swings, number(ratio), " ".join(f"{name} {abs(shape[name]):.3g}" for name in largest)))
        head = (
            f"frequency{bracket(per)}",
            f"cycles{bracket(f'1/{time}' if time else '')}",
            "damping",
            "greatest amplitudes",
        )
        count = f"{counted(len(self.freedoms), 'independent freedom')}: {listed(self.freedoms)}"
        return Document(f"Small motions of {self.mechanism.name}", (Paragraph(f"{count}."), Table(head, rows, "rrrl")))

    @cached_property
    def A(self) -> Array:
        """State matrix ``(2 n, 2 n)``: ``d(u, u')/dt = A (u, u')``."""
        n = len(self.M)
        lower = -np.linalg.solve(self.M, np.concatenate([self.K, self.C], axis=1))
        return np.concatenate([np.concatenate([np.zeros((n, n)), np.eye(n)], axis=1), lower])

    @cached_property
    def _modes(self) -> tuple[Array, Array]:
        if not self.C.any() and np.abs(self.K - self.K.T).max(initial=0.0) <= 1e-9 * np.abs(self.K).max(initial=0.0):
            w, U = scipy.linalg.eigh(0.5 * (self.K + self.K.T), self.M)
            return np.emath.sqrt(-w.astype(complex)), U.astype(complex)
        w, V = np.linalg.eig(self.A)
        kept = np.flatnonzero(w.imag > 0) if (w.imag > 0).sum() == len(self.M) else np.flatnonzero(w.imag >= 0)
        kept = kept[np.argsort(np.abs(w[kept]), kind="stable")]
        return w[kept], V[: len(self.M), kept]

    @property
    def eigenvalues(self) -> Array:
        """Exponents ``s`` of the motions ``exp(s t)``, one of every conjugate pair, slowest first."""
        return self._modes[0]

    @property
    def frequencies(self) -> Array:
        """Undamped natural frequencies ``|s|`` in rad a unit of time; NaN of a motion that grows or creeps without swinging."""
        s = self.eigenvalues
        return np.where(np.abs(s.imag) > 0, np.abs(s), np.nan)

    @property
    def damping(self) -> Array:
        """Damping ratios ``-Re s / |s|``."""
        s = self.eigenvalues
        return np.asarray(-s.real / np.where(np.abs(s) > 0, np.abs(s), 1.0))

    @property
    def modes(self) -> tuple[dict[str, complex], ...]:
        """Mode shapes: amplitudes of all freedoms by name, the largest one 1."""
        shapes = (self.motions @ self._modes[1]).T
        names = self.mechanism.freedom_names()
        return tuple(
            dict(zip(names, (shape / shape[np.argmax(np.abs(shape))]).tolist(), strict=True)) for shape in shapes
        )


@door
def linearize(m: Mechanism, at: Mapping[str, float] | None = None, *, engine: EngineName = "auto") -> Linearized:
    """Small motions about the declared ``start`` or the coordinates ``at``, the drives at rest; meant for an equilibrium.

    Raises
    ------
    DeclarationError, AssemblyError
    """
    place = _Place(m, "linearize", at, engine)
    Q, M, C, K = place.derivatives()
    if np.linalg.eigvalsh(in_unit_inertias(M)).min() <= MASSLESS:
        raise DeclarationError(
            f"linearize {m.name!r}", ["has a motion without inertia; give mass or inertia to what moves so"]
        )
    largest = max(place.largest(), float(np.abs(K).max()) * STEP)
    if np.abs(Q).max() > UNBALANCED * largest:
        warnings.warn(
            f"mechanism {m.name!r}: is not in equilibrium there (generalized forces of {np.abs(Q).max() / largest:.2g} of "
            "the largest that a load exerts); mg.equilibrium(m) finds a position that is",
            MechgraphWarning,
            stacklevel=3,
        )
    s, free = place.task.system, place.chart.free
    L = s.par.L
    unit = np.where(s.is_length, L, 1.0)
    u = unit[free]
    work = L**2 / np.outer(u, u)
    names = m.freedom_names()
    motions: Any = unit[:, None] * place._motions / u
    return Linearized(
        m, tuple(names[i] for i in free), work * M, work * C, work * K, L**2 / u * Q, motions, place.solution()
    )
