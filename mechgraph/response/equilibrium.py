"""Positions in which loads balance, and small motions about them.

Derivatives by central differences at several lengths, of which two that agree are believed.

One length does not know what bends within it: the slope of ``-tanh(x / 0.001)`` over 0.004 is off by two thirds. The lengths fall by four
until two derivatives agree; where none do, as at a jump or a corner, that is said.

A mechanism at rest: the generalized forces about a position in independent freedoms, and their derivatives.

    M u'' + C u' + K u = 0,   C = -dQ/du',   K = -dQ/du,   Q the generalized forces at rest

in the independent freedoms of a chart (see ``response.chart``); drives of the mechanism stand still.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from functools import cached_property, partial
from typing import Any, Literal

import numpy as np
import scipy

from mechgraph.determinacy.mobility import free_motion
from mechgraph.document import NAMED, Document, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError, MechgraphWarning, ResponseError, counted, listed
from mechgraph.kinematics.assembly import assembled_at, named_columns
from mechgraph.kinematics.rates import Velocities
from mechgraph.kinematics.solver import EngineName, engine_for
from mechgraph.maths.se3 import Array
from mechgraph.maths.tolerances import RESPONSE
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import door, unit_of
from mechgraph.response.charts import OVER_POSITIONS, Prescribed, Task, trajectory_of
from mechgraph.response.motion_equations import Chart, ClosedChart, Columns, Loads, applied, in_unit_inertias
from mechgraph.result.solution import Solution
from mechgraph.result.values import bracket, number

STENCIL = ((1, 4 / 5), (2, -1 / 5), (3, 4 / 105), (4, -1 / 280))
"""Steps and weights of the first derivative by central differences of eighth order."""


@dataclass(frozen=True)
class Slopes:
    """Values ``(r,)`` at the place, their derivatives ``(r, n)``, and by how much these differ at two lengths.

    ``unsettled``: coordinates by which no derivative is known.
    """

    values: Array
    slopes: Array
    error: Array
    unsettled: tuple[int, ...]


def settled_slopes(values: Callable[[Array], Array], n: int, first: float) -> Slopes | None:
    """Derivatives of ``values(u (n, T)) -> (r, T)`` at 0; NaN where values are unknown. None where they are known at no length."""
    eye, signs = np.eye(n), [(sign * k, sign * weight) for k, weight in STENCIL for sign in (1.0, -1.0)]
    known: list[tuple[Array, Array, Array, Array]] = []
    best: tuple[Array, Array] | None = None
    for i in range(8):  # lengths, at most
        h = first * 0.25**i
        f = values(np.concatenate([np.zeros((n, 1)), *(k * h * eye for k, _ in signs)], axis=1))
        if not np.isfinite(f).all():
            continue
        parts = f[:, 1:].reshape(len(f), len(signs), n)
        slopes = np.einsum("rkn,k->rn", parts, [weight for _, weight in signs]) / h
        corner = np.abs(parts[:, 0] + parts[:, 1] - 2.0 * f[:, :1]) / h
        known.append((f[:, 0], slopes, corner, np.abs(parts[:, 0] - parts[:, 1])))
        if len(known) < 2:
            continue
        error = np.abs(known[-1][1] - known[-2][1])
        scale = max(float(np.abs(one[1]).max(initial=0.0)) for one in known) or 1.0
        if best is None or error.max() < best[1].max():
            # of the first two the longer one has less rounding, later on the shorter one bends less
            best = (known[0][1] if len(known) == 2 else slopes), error
        # difference of two derivatives, of the largest, from which on they agree as well as rounding lets them
        if error.max() <= 1e-10 * scale:
            break
    if not known:
        return None
    if best is None:
        best = known[0][1], np.full(known[0][1].shape, np.inf)
    largest = max(float(np.abs(one[1]).max(initial=0.0)) for one in known) or 1.0
    # difference of two derivatives, of the largest, above which none is known
    off = (best[1] > 1e-3 * largest).any(axis=0)
    if len(known) > 1:
        (*_, wide, apart), (*_, corner, jump) = known[-2], known[-1]
        off |= ((corner > RESPONSE.falls * wide) & (corner > RESPONSE.corner * largest)).any(axis=0)
        off |= ((jump > RESPONSE.falls * apart) & (jump > RESPONSE.corner * first * largest)).any(axis=0)
    return Slopes(known[0][0], best[0], best[1], tuple(np.flatnonzero(off).tolist()))


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


class RestPlace:
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
        self.task = Task(system, Loads.of(m), still, columns, engine_for(system.n_rows, 1, engine))
        self.go(x)
        if not self.n:
            raise DeclarationError(f"{call} {m.name!r}", ["every freedom is driven; m.replace(drives=[]) frees them"])

    def go(self, x: Array) -> None:
        """Lay out a chart at a closed state."""
        self.chart = Chart(self.task.system, x, self.task.columns, self.task.engine)
        self.held = x[self.task.system.single_rows[self.task.columns]][:, None]
        self.n = len(self.chart.free)

    def closed(self, u: Array) -> ClosedChart:
        """Closed states at coordinates ``u (n, T)`` in the chart."""
        guess = self.task.system.advance(self.chart.x0[:, None], self.motions @ u)
        return self.chart.close(guess, u, np.repeat(self.held, u.shape[1], axis=1))

    @property
    def motions(self) -> Array:
        """Rates of all freedoms ``(F, n)`` for unit rates of the independent ones."""
        return self.chart.solver.factored(self.chart.start, self.chart.which).sensitivity()[:, : self.n, 0]

    def forces(self, closed: ClosedChart, v: Array) -> tuple[Array, Array]:
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

        place = settled_slopes(at_rest, n, RESPONSE.first_difference)
        if place is None:
            raise ResponseError(f"mechanism {self.m.name!r}: the loops do not close beside this position")
        one = self.closed(np.zeros((n, 1)))

        def moving(v: Array) -> Array:
            here = one.here.part(np.zeros(v.shape[1], dtype=np.intp))
            f = self.chart.solver.factored(here, np.repeat(self.chart.which, v.shape[1]))
            return self.forces(ClosedChart(here, f, np.ones(v.shape[1], dtype=bool)), v)[0]

        # first length of differences of rates (radians, lengths / L, a unit of time)
        rates = settled_slopes(moving, n, 0.25)
        assert rates is not None  # the position is closed
        M = self.forces(one, np.zeros((n, 1)))[1][..., 0]
        # rounding of the differences, of the largest force
        noise = 1e-12 * self.largest() + place.error
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


EndKind = Literal["stable", "nearest"]

STABLE = {True: "stable", False: "unstable", None: "neither stable nor unstable to second order"}
"""How a position of equilibrium is called."""


class Equilibrium(Mechanism):
    """The mechanism with ``start`` set to a position in which its loads balance.

    Attributes
    ----------
    stable : whether small motions stay small (True): the potential energy is least there; or grow (False). None where it is flat to
        second order in some direction. Where forces circulate or feed the motion the eigenvalues of the small motions decide: True where
        all of these die away, None where they go on. Passive freedoms do not count.
    idle : what passive freedoms there are, in words; nothing resists them.
    solution : everything at rest there, reactions included.
    """

    stable: bool | None
    idle: tuple[str, ...]
    solution: Solution

    def document(self) -> Document:
        """The position found, its kind, and the mechanism."""
        m = super().document()
        idle = f" Nothing resists {listed(self.idle)}." if self.idle else ""
        return Document(
            f"Equilibrium of {self.name}", (Paragraph(f"{STABLE[self.stable].capitalize()}.{idle}"), *m.blocks)
        )

    def __repr__(self) -> str:
        start = ", ".join(f"{name} = {value:.6g}" for name, value in list(self.start.items())[:NAMED])
        more = ", ..." if len(self.start) > NAMED else ""
        return f"Equilibrium({self.name!r}, {STABLE[self.stable]}, at {start or 'the declared configuration'}{more})"

    def __reduce__(self) -> tuple[Any, ...]:
        return _balanced, (self._arguments(), self.stable, self.idle, self.solution)


def _balanced(arguments: dict[str, Any], stable: bool | None, idle: tuple[str, ...], solution: Solution) -> Equilibrium:
    out = Equilibrium(**arguments)
    out._set(stable=stable, idle=idle, solution=solution)
    return out


@door
def equilibrium(
    m: Mechanism, start: Mapping[str, float] | None = None, *, kind: EndKind = "stable", engine: EngineName = "auto"
) -> Equilibrium:
    """Find a position in which the declared loads balance, with the declared drives fixed.

    Parameters
    ----------
    m : Mechanism
        The mechanism.
    start : mapping of str to float, optional
        Coordinates [rad, length] near which to look, beside the declared ``start``.
    kind : {"stable", "nearest"}
        ``"stable"``: descend from ``start`` along the work of the loads, as damped motion does; ``"nearest"``: Newton from ``start``,
        which ends in any equilibrium. If one finds none, mechgraph tries the other; ``stable`` of the result says which it is.
    engine : {"auto", "dense", "sparse"}
        As in ``solve``.

    Returns
    -------
    Equilibrium
        A Mechanism with ``start`` set, ``stable``, and ``solution`` with all forces.

    Raises
    ------
    DeclarationError, AssemblyError
        Invalid arguments; loops that cannot be closed.
    ResponseError
        No equilibrium found.

    Examples
    --------
    >>> import mechgraph as mg
    >>> m = mg.equilibrium(mg.load("windows-2").replace(drives=[]), {"A0": 3.0})
    >>> m.stable, round(m.start["A0.Rz"], 6)
    (True, 3.141593)
    """
    place = RestPlace(m, "equilibrium of", start, engine)
    begin, why = place.chart.x0, ""
    ways: tuple[Callable[[RestPlace], Derivatives | str], ...] = (_downhill, _newton)
    for way in ways if kind == "stable" else ways[::-1]:
        place.go(begin)
        found = way(place)
        if not isinstance(found, str):
            idle = free_motion(place.task.system, place.chart.x0, place.task.columns, place.task.engine).passive
            words = tuple(
                f"the {'spin' if one.turns else 'slide'} of {listed(m.links[i].name for i in one.links)}"
                for one in idle
            )
            rates = np.array([one.rates[place.chart.free] for one in idle]).reshape(len(idle), place.n)
            stable = _stability(found, scipy.linalg.null_space(rates) if len(idle) else np.eye(place.n))
            return _balanced({**m._arguments(), "start": place.start()}, stable, words, place.solution())
        why = why or found
    raise ResponseError(f"mechanism {m.name!r}: no equilibrium was found{why}")


def _largest(d: Derivatives) -> float:
    return max(float(np.abs(d.Q).max()), float(np.abs(d.K).max()) * RESPONSE.first_difference)


def _left(d: Derivatives) -> str:
    return (
        f" near start in {RESPONSE.equilibrium_steps} steps or fewer; generalized forces of "
        f"{np.abs(d.Q).max():.3g} are left (internal units). Give another start; loads that drive it on and on have none"
    )


def _newton(place: RestPlace) -> Derivatives | str:
    """Newton to where the forces balance, or why it does not come there."""
    largest = 0.0
    for _ in range(RESPONSE.equilibrium_steps):
        d = place.derivatives()
        largest = max(largest, _largest(d))
        if np.abs(d.Q).max() <= RESPONSE.balanced * largest or not largest:
            return d
        step: Array = np.asarray(np.linalg.lstsq(d.K, d.Q, rcond=1e-12)[0], dtype=float)
        size = float(np.abs(step).max())
        if not size:
            return _left(d)
        for part in (1.0, 0.1):
            closed = place.closed(step[:, None] * part * min(1.0, RESPONSE.longest_equilibrium_step / size))
            if closed.done[0]:
                break
        else:
            return ": the motion towards it is stopped by the loops"
        place.go(closed.here.x[:, 0])
    return _left(d)


def _downhill(place: RestPlace) -> Derivatives | str:
    """Steps along which the loads do work, to where they balance and every small step costs some; or why it does not come there."""
    largest, longest = 0.0, RESPONSE.longest_equilibrium_step
    for _ in range(RESPONSE.equilibrium_steps):
        d = place.derivatives()
        largest = max(largest, _largest(d))
        w, U = np.linalg.eigh(0.5 * (d.K + d.K.T))
        balanced = RESPONSE.balanced * largest
        if np.abs(d.Q).max() <= balanced or not largest:
            if not w[0] < -RESPONSE.stiff * float(np.abs(w).max()):
                return d
            ways = [RESPONSE.push * U[:, 0], -RESPONSE.push * U[:, 0]]
        else:
            ways = [_step(d, w, U, balanced, longest)]
        tried = [_shortened(place, d.Q, way, balanced) for way in ways]
        work, step, x = max(tried, key=lambda one: one[0])
        if x is None:
            return ": the motion towards it is stopped by the loops"
        longest = min(RESPONSE.longest_equilibrium_step, 4.0 * float(np.abs(step).max()))
        place.go(x)
    return _left(d)


def _step(d: Derivatives, w: Array, U: Array, balanced: float, longest: float) -> Array:
    """Newton's step where the energy curves upwards; elsewhere along the curvatures with their signs turned, which leads downwards."""
    if w[0] > RESPONSE.stiff * w[-1]:
        step = np.linalg.solve(d.K, d.Q)
    else:
        q, size = U.T @ d.Q, np.abs(w)
        far = np.abs(q) >= longest * size
        step = U @ np.where(
            np.abs(q) > balanced, np.where(far, longest * np.sign(q), q / np.where(far, 1.0, size)), 0.0
        )
    return np.asarray(step * min(1.0, longest / max(float(np.abs(step).max()), longest)))


def _shortened(place: RestPlace, Q: Array, step: Array, noise: float) -> tuple[float, Array, Array | None]:
    """A step, or a shorter one, along which the loads do work: the work, the step, and the state; None where there is none."""
    # most halvings of a step that does not lead downhill, or to where the loops do not close
    for _ in range(40):
        at = place.closed(step[:, None] * np.array([0.5, 1.0]))
        if at.done.all():
            middle, end = place.forces(at, np.zeros((place.n, 2)))[0].T
            work = float(step @ (Q + 4.0 * middle + end)) / 6.0
            if work > -noise * float(np.abs(step).max()):
                return work, step, at.here.x[:, 1]
        step = 0.5 * step
    return -np.inf, step, None


def _stability(d: Derivatives, kept: Array) -> bool | None:
    """Whether small motions in the directions ``kept (n, k)`` stay small; see ``Equilibrium.stable``."""
    M, C, K = (kept.T @ part @ kept for part in (d.M, d.C, d.K))
    if not len(K):
        return True
    w = np.linalg.eigvalsh(0.5 * (K + K.T))
    flat = RESPONSE.stiff * float(np.abs(w).max(initial=0.0))
    if np.abs(K - K.T).max() <= flat and np.linalg.eigvalsh(0.5 * (C + C.T))[0] >= -RESPONSE.stiff * np.abs(C).max():
        return False if w[0] < -flat else None if d.bent or w[0] <= flat else True
    n = len(K)
    still, unit = np.zeros((n, n)), np.eye(n)
    s = np.asarray(
        scipy.linalg.eigvals(np.block([[still, unit], [-K, -C]]), np.block([[unit, still], [still, M]])), dtype=complex
    )
    s = s[np.isfinite(s)]
    # part of the fastest rate at which a small motion grows or dies away above which it does
    slow = 1e-7 * float(np.abs(s).max(initial=0.0))
    return False if (s.real > slow).any() else True if (s.real < -slow).all() and not d.bent else None


@dataclass(frozen=True, repr=False)
class Linearized(Shown):
    """Small motions about a position of equilibrium.

    ``freedoms``: names of the independent ones ``(n,)``; ``M, C, K (n, n)`` in the user's units (coordinates of these freedoms);
    ``force (n,)`` what is left of the balance, zero in an equilibrium; ``motions (F, n)`` rates of all freedoms for unit rates of the
    independent ones, user's units; ``unresisted (n, k)`` the motions against which there is no stiffness (K takes nothing of them);
    ``solution`` everything at rest there.
    """

    mechanism: Mechanism
    freedoms: tuple[str, ...]
    M: Array
    C: Array
    K: Array
    force: Array
    motions: Array
    unresisted: Array
    solution: Solution

    def document(self) -> Document:
        """Frequencies, damping and shapes of the motions."""
        time = self.mechanism.units.get("time", "")
        per = unit_of(self.mechanism.units, (0, 0, -1))
        rows = []
        for w, ratio, shape in zip(self.frequencies[:NAMED], self.damping[:NAMED], self.modes[:NAMED], strict=False):
            swings = (number(w), number(w / (2 * np.pi))) if np.isfinite(w) else ("none", "")
            told = (number(ratio),) if w != 0.0 else ("free",)
            rows.append((*swings, *told, " ".join(f"{name} {abs(shape[name]):.3g}" for name in self._told(shape))))
        head = (
            f"frequency{bracket(per)}",
            f"cycles{bracket(f'1/{time}' if time else '')}",
            "damping",
            "greatest amplitudes",
        )
        count = f"Independent: {counted(len(self.freedoms), 'freedom')}, {listed(self.freedoms)}"
        return Document(f"Small motions of {self.mechanism.name}", (Paragraph(f"{count}."), Table(head, rows, "rrrl")))

    def _told(self, shape: Mapping[str, complex]) -> list[str]:
        """The freedoms that tell a mode: those of which the declaration says something, then the largest; no two that move alike."""
        m, names = self.mechanism, self.mechanism.freedom_names()
        said = {*m.start, *(d.freedom for d in m.drives), *(name for one in m.loads for name in one.freedoms)}
        said.update(m.response.freedoms if m.response else ())
        said = {m.full_name(name) for name in said}
        largest = max(map(abs, shape.values()))
        moving = [name for name in names if abs(shape[name]) > 1e-3 * largest]
        told: list[int] = []
        for name in sorted(moving, key=lambda name: (name not in said, -abs(shape[name]))):
            i = names.index(name)
            rows = [self.motions[i] - sign * self.motions[j] for j in told for sign in (1.0, -1.0)]
            # difference of the rates of two freedoms up to which they move alike, as two hinges on one line do
            if not any(np.abs(row).max() <= 1e-9 * np.abs(self.motions[i]).max() for row in rows):
                told.append(i)
        return [names[i] for i in told[:4]]

    @cached_property
    def A(self) -> Array:
        """State matrix ``(2 n, 2 n)``: ``d(u, u')/dt = A (u, u')``."""
        n = len(self.M)
        lower = -np.linalg.solve(self.M, np.concatenate([self.K, self.C], axis=1))
        return np.concatenate([np.concatenate([np.zeros((n, n)), np.eye(n)], axis=1), lower])

    @cached_property
    def _modes(self) -> tuple[Array, Array]:
        n, k = self.unresisted.shape
        if not self.C.any() and np.abs(self.K - self.K.T).max(initial=0.0) <= 1e-9 * np.abs(self.K).max(initial=0.0):
            w, U = scipy.linalg.eigh(0.5 * (self.K + self.K.T), self.M)
            w[np.argsort(np.abs(w))[:k]] = 0.0
            order = np.argsort(np.abs(w), kind="stable")
            return np.emath.sqrt(-w[order].astype(complex)), U[:, order].astype(complex)
        # along what is unresisted the place tells nothing: only the rates count, so that its zero is simple and exact
        R = scipy.linalg.null_space(self.unresisted.T) if k else np.eye(n)
        lower = -np.linalg.solve(self.M, np.concatenate([self.K @ R, self.C], axis=1))
        w, V = np.linalg.eig(np.concatenate([np.concatenate([np.zeros((n - k, n - k)), R.T], axis=1), lower]))
        # rate of a motion, of the fastest, that is none
        still = np.abs(w) <= 1e-12 * np.abs(w).max(initial=0.0)
        w, V = w[~still], V[n - k :, ~still]
        kept = np.flatnonzero(w.imag > 0) if 2 * (w.imag > 0).sum() == len(w) else np.flatnonzero(w.imag >= 0)
        kept = kept[np.argsort(np.abs(w[kept]), kind="stable")]
        return np.append(np.zeros(k), w[kept]), np.concatenate([self.unresisted, V[:, kept]], axis=1)

    @property
    def eigenvalues(self) -> Array:
        """Exponents ``s`` of the motions ``exp(s t)``, one of every conjugate pair, slowest first."""
        return self._modes[0]

    @property
    def frequencies(self) -> Array:
        """Undamped natural frequencies ``|s|`` in rad a unit of time; 0 of a motion that nothing resists, NaN of one that grows or creeps
        without swinging.
        """
        s = self.eigenvalues
        return np.where((np.abs(s.imag) > 0) | (s == 0), np.abs(s), np.nan)

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
    """Compute small motions about the declared ``start`` or the coordinates ``at``: ``M u'' + C u' + K u = 0``, drivers stationary.

    Parameters
    ----------
    m : Mechanism
        The mechanism, usually in equilibrium.
    at : mapping of str to float, optional
        Coordinates [rad, length] at which to assemble first.
    engine : {"auto", "dense", "sparse"}
        As in ``solve``.

    Returns
    -------
    Linearized
        ``M``, ``C``, ``K``, ``eigenvalues``, ``frequencies`` [rad / time], ``damping``, ``modes``.

    Raises
    ------
    DeclarationError, AssemblyError
        Every freedom is driven; the position cannot be reached.

    Examples
    --------
    >>> import mechgraph as mg
    >>> hanging = mg.equilibrium(mg.load("windows-2").replace(drives=[]), {"A0": 3.0})
    >>> mg.linearize(hanging).frequencies.round(4)
    array([3.383])
    """
    place = RestPlace(m, "linearize", at, engine)
    d = place.derivatives()
    if np.linalg.eigvalsh(in_unit_inertias(d.M)).min() <= RESPONSE.massless:
        raise DeclarationError(
            f"linearize {m.name!r}", ["has a motion without inertia; give mass or inertia to what moves so"]
        )
    largest = max(place.largest(), float(np.abs(d.K).max()) * RESPONSE.first_difference)
    s, free, names = place.task.system, place.chart.free, m.freedom_names()
    said = []
    # generalized force, against the largest that a load exerts, above which a position is said to be none of equilibrium
    if np.abs(d.Q).max() > 1e-6 * largest:
        said.append(
            f"is not in equilibrium there (generalized forces of {np.abs(d.Q).max() / largest:.2g} of the largest that a load exerts); "
            "mg.equilibrium(m) finds a position that is"
        )
    for what, which, hint in (
        ("stiffness", d.bent, "a force has a corner or a jump there, as a one-sided spring at its contact"),
        ("damping", d.dry, "a force jumps with the sign of a rate, as dry friction does"),
    ):
        if which:
            where = listed(names[free[i]] for i in which)
            said.append(
                f"has no {what} in {where}: slopes at several lengths differ ({hint}); what is given is doubtful"
            )
    for one in said:
        warnings.warn(f"mechanism {m.name!r}: {one}", MechgraphWarning, stacklevel=3)
    zero = _unresisted(d.K, d.noise)
    K = d.K - d.K @ zero @ zero.T
    L = s.par.L
    unit = np.where(s.is_length, L, 1.0)
    u = unit[free]
    work = L**2 / np.outer(u, u)
    motions: Any = unit[:, None] * place.motions / u
    parts = (work * d.M, work * d.C, work * K, L**2 / u * d.Q, motions, scipy.linalg.orth(u[:, None] * zero))
    return Linearized(m, tuple(names[i] for i in free), *parts, place.solution())


def _unresisted(K: Array, noise: Array) -> Array:
    """Orthonormal motions ``(n, k)`` of which the stiffness is rounding."""
    _, sizes, V = np.linalg.svd(K)
    # stiffness, against its rounding, up to which there is none
    return np.asarray(V[sizes <= 10.0 * np.linalg.norm(noise)].T)
