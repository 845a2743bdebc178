"""The equations of motion in independent rates: accelerations beside the loads, for a batch of states.

The rates of all freedoms are ``q' = Z v + Z_p p'`` with the independent rates ``v (n,)`` and those of the prescribed freedoms ``p``; ``Z``
solves the closure ``J Z = 0``. The principle of virtual power along every column of ``Z`` eliminates the reactions:

    M v' = Q,   M_kl = sum over links V_k . I V_l,   Q_k = sum over links V_k . (W - I A_0 - V x* I V) + Z_k . tau

with ``V_k`` the twists of the links for the column, ``W`` the applied wrenches, ``tau`` the given efforts, and ``A_0`` the accelerations
for ``v' = 0``. It is the Schur complement of Lee's system (1977, section 3.5), in which the independent accelerations are unknowns beside
the reactions. Source of the form: Kane and Levinson, Dynamics: Theory and Applications, 1985, chapter 6.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace

import numpy as np

from mechgraph.algebra.se3 import Array, cross, rotate, rotate_back
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.driver_path import BLOCK
from mechgraph.closure.indexing import System
from mechgraph.closure.passive_motion import PassiveMotions
from mechgraph.closure.rates import Rates, Velocities
from mechgraph.closure.solver import FactoredClosure
from mechgraph.force.loads import Site, inertia_wrenches
from mechgraph.model.loads import Load
from mechgraph.response.chart import Closed, Held, Stopped
from mechgraph.response.saddle import saddle_accelerations

MASSLESS = 1e-12
"""Eigenvalue of the mass matrix, of which the diagonal is one, below which a motion has no inertia."""
RESISTED = 1e-9
"""Pivot (squared) of the same matrix above which every motion has inertia."""
NUMBERS = 5_000_000
"""Numbers in an array of twists."""
SPARSE_FROM = 8000
"""Freedoms times links from which on the sparse form is faster than the full mass matrix (measured on open chains)."""
UNOPPOSED = 1e-9
"""Part of the largest generalized force below which none acts along a motion without inertia."""


@dataclass(frozen=True)
class Loads:
    """Loads by whether they have a potential energy."""

    stored: tuple[Load, ...]
    rest: tuple[Load, ...]

    @classmethod
    def of(cls, loads: tuple[Load, ...]) -> Loads:
        """The loads of a mechanism, a spring apart from its damper."""
        parts = [load.parts() for load in loads]
        return cls(
            tuple(stored for stored, _ in parts if stored is not None),
            tuple(rest for _, rest in parts if rest is not None),
        )


@dataclass(frozen=True)
class Moved:
    """Rates and accelerations at a batch of states, with the power of loads and prescribed drivers.

    ``rates``; ``columns`` of the independent rates, with their masses, and the generalized ``force (n, T)``; ``power (T,)`` of prescribed
    drivers and of the loads without a potential energy; internal units.
    """

    rates: Rates
    columns: Columns
    force: Array
    power: Array


def _inertia(here: Configuration, V: Array, A: Array) -> Array:
    return inertia_wrenches(here, SimpleNamespace(V=V, A=A))  # type: ignore[arg-type]


NO_INERTIA = (
    "there is a motion that no inertia resists, so that its acceleration under loads has no bound. Give mass or inertia to what moves "
    "so, or prescribe its motion"
)


def positions_together(system: System, n: int) -> int:
    """Positions evaluated together, so that the twists of all links for ``n`` motions do not take much memory."""
    return max(1, min(BLOCK, NUMBERS // (6 * len(system.m.links) * max(n, 1))))


def link_twists(here: Configuration, Z: Array) -> Array:
    """Twists of all links ``(6, N, k, T)`` for several rates ``(F, k, T)`` at every position."""
    k, T = Z.shape[1:]
    terms = (here.S[:, :, None] * Z).reshape(6, len(Z), k * T)
    sums = here.system.tree.sums(here.pair_sums(terms))
    return np.asarray(sums.reshape(6, sums.shape[1], k, T))


def _momenta(here: Configuration, V: Array) -> Array:
    """Spatial inertias of all links times twists ``(6, N, k, T)``: moments of momentum about the internal origin, and momenta."""
    par, R = here.system.par, here.poses[:, :3, :, None]
    c = (rotate(here.poses[:, :3], par.center) + here.poses[:, 3])[:, :, None]
    momentum = par.mass[:, None] * (V[3:] + cross(V[:3], c))
    spin = rotate(R, rotate(par.inertia[:, :, :, None], rotate_back(R, V[:3])))
    return np.concatenate([cross(c, momentum) + spin, momentum])


class Columns:
    """What the motions of unit rates do at closed states: ``Z (F, n, T)`` of the independent columns and ``Zp`` of the prescribed ones.

    The factors ``f`` have the ``n`` independent columns fixed, and behind them the prescribed ones. Where passive motions are ``held``,
    only the others of them count, each with the passive motions that leave it at rest in these.
    """

    def __init__(self, here: Configuration, f: FactoredClosure, n: int, held: Held | None = None) -> None:
        self.here, self.f, self.n = here, f, n
        self.Z, self.Zp = np.split(f.sensitivity(), [n], axis=1)
        self.rest: PassiveMotions | None = None
        if held is not None:
            self.rest = rest = PassiveMotions(here, held.motions, self.Z[:, held.places])
            self.n = n - len(held.places)
            self.Z, self.Zp = (_at_rest(here, rest, Z) for Z in (np.delete(self.Z, held.places, axis=1), self.Zp))

    @cached_property
    def V(self) -> Array:
        """Twists of all links ``(6, N, n, T)``."""
        return link_twists(self.here, self.Z)

    @cached_property
    def mass(self) -> Array:
        """Mass matrices ``(n, n, T)``."""
        rows, n, T = 6 * len(self.here.system.m.links), self.n, self.here.T
        momenta = _momenta(self.here, self.V).reshape(rows, n, T)
        # a matrix product for every position: the masses of many freedoms are most of the work
        return np.moveaxis(np.moveaxis(self.V.reshape(rows, n, T), (2, 1), (0, 1)) @ np.moveaxis(momenta, 2, 0), 0, -1)

    def force(self, wrenches: Array, efforts: Array) -> Array:
        """Generalized forces ``(n, T)`` of wrenches on the links and efforts in the freedoms."""
        by_freedom = efforts + self.here.tree_efforts(wrenches)
        return np.asarray((self.Z * by_freedom[:, None]).sum(axis=0))

    def accelerations(self, wrenches: Array, efforts: Array) -> tuple[Array, Array]:
        """See ``accelerations``; of many freedoms in the sparse form where every motion has inertia."""
        if self.n * len(self.here.system.m.links) >= SPARSE_FROM:
            found = self.sparse_accelerations(wrenches, efforts)
            if found is not None:
                return found, np.zeros_like(found)
        return accelerations(self.mass, self.force(wrenches, efforts))

    def sparse_accelerations(self, wrenches: Array, efforts: Array) -> Array | None:
        """``v' (n, T)`` by one sparse factorization a position (see ``response.saddle``); None where a motion may have no inertia."""
        here = self.here
        unit = np.broadcast_to(np.eye(6)[:, None, :, None], (6, len(here.system.m.links), 6, here.T))
        inertia, forces = _momenta(here, unit), (self.Z * efforts[:, None]).sum(axis=0)
        found = []
        for t in range(here.T):
            at = (part[..., t] for part in (here.S, self.Z, inertia, wrenches, forces))
            a = saddle_accelerations(here.system.tree, here.system.pair_of_freedom, *at)
            if a is None:
                return None
            found.append(a)
        return np.stack(found, axis=1)

    def largest(self, wrenches: Iterable[Array], efforts: Iterable[Array]) -> float:
        """The largest part that a component of wrenches or of efforts has in a generalized force."""
        by_wrenches, by_efforts = (np.abs(columns).max(axis=-2, initial=0.0) for columns in (self.V, self.Z))
        parts = [float(np.abs(by_wrenches * one).max(initial=0.0)) for one in wrenches]
        return max([*parts, *(float(np.abs(by_efforts * one).max(initial=0.0)) for one in efforts)], default=0.0)

    def bound(self, dq: Array, ddq: Array | None = None) -> tuple[Velocities, Array, Array]:
        """At rates ``dq (F, T)``, the independent ones constant: velocities, accelerations ``ddq`` of all freedoms, and the inertia."""
        here, velocities = self.here, Velocities(self.here, dq)
        free = self.f.solve(-here.closure_bias(velocities.bias)[:, None])[:, 0]
        ddq = free if ddq is None else free + ddq
        if self.rest is not None:
            A = here.accelerations_with(ddq, velocities.bias)
            ddq = ddq + self.rest.still_at_rest(self.f, dq, velocities.V, velocities.bias, A)
        return velocities, ddq, _inertia(here, velocities.V, here.accelerations_with(ddq, velocities.bias))


def applied(here: Configuration, loads: tuple[Load, ...], velocities: Velocities, t: Array) -> tuple[Array, Array]:
    """Wrenches ``(6, N, T)`` of loads on the links and efforts ``(F, T)`` in the freedoms."""
    if not loads:
        return np.zeros((6, len(here.system.m.links), here.T)), np.zeros((here.system.n_freedoms, here.T))
    site = Site(here, velocities, here.system.coordinates_of(here.x), (here.T,), np.arange(here.T), t)
    site.collect(loads)
    return site.applied(), site.scaled_efforts()


def _at_rest(here: Configuration, rest: PassiveMotions, Z: Array) -> Array:
    """Motions ``(F, k, T)`` with what leaves the passive links at rest."""
    out = Z.copy()
    for i in range(Z.shape[1]):
        out[:, i] += rest.at_rest(here.link_twists(Z[:, i]))
    return out


def moved(closed: Closed, v: Array, p: Array, loads: Loads, t: Array) -> Moved:
    """Accelerations at closed states with independent rates ``v (n, T)`` and prescribed rates and accelerations ``p (2, p, T)``.

    The factors as in ``Columns``.
    """
    here, held = closed.here, closed.held
    columns = Columns(here, closed.f, len(v) + (0 if held is None else len(held.places)), held)
    Z, Zp = columns.Z, columns.Zp
    dq = (Z * v).sum(axis=1) + (Zp * p[0]).sum(axis=1)
    velocities, ddq, inertia = columns.bound(dq, (Zp * p[1]).sum(axis=1))
    V = velocities.V
    (stored, by_stored), (rest, by_rest) = (applied(here, some, velocities, t) for some in (loads.stored, loads.rest))
    wrenches, efforts = stored + rest + inertia, by_stored + by_rest
    a, unopposed = columns.accelerations(wrenches, efforts)
    left = np.abs(unopposed).max(initial=0.0)
    if left and left > UNOPPOSED * columns.largest((stored, rest, inertia), (by_stored, by_rest)):
        raise Stopped(NO_INERTIA)
    further = (Z * a).sum(axis=1)
    power = (V * rest).sum(axis=(0, 1)) + (dq * by_rest).sum(axis=0)
    if Zp.shape[1]:
        left_over = wrenches - _momenta(here, here.link_twists(further)[:, :, None])[:, :, 0]
        by_freedom = efforts + here.tree_efforts(left_over)
        power -= (p[0] * (Zp * by_freedom[:, None]).sum(axis=0)).sum(axis=0)
    return Moved(Rates(velocities, ddq + further, np.zeros(here.T)), columns, columns.force(wrenches, efforts), power)


def along_one(here: Configuration, f: FactoredClosure, loads: Loads) -> Array:
    """Of mobility 1: ``(M, Q_0, P_1, P_2) (4, T)`` of the energy's rate ``(M u'^2 / 2)' = Q_0 u' + P_1 u' + P_2 u'^2``.

    ``Q_0`` is the force of the loads with a potential energy, ``P_1 + P_2 u'`` that of the others, which may depend on rates linearly.
    """
    columns, t = Columns(here, f, 1), np.zeros(here.T)
    if not (columns.mass > 0.0).all():
        raise Stopped(NO_INERTIA)
    still, ahead, back = (Velocities(here, factor * columns.Z[:, 0]) for factor in (0.0, 1.0, -1.0))
    stored, forth, behind = (
        columns.force(*applied(here, some, way, t))[0]
        for some, way in ((loads.stored, still), (loads.rest, ahead), (loads.rest, back))
    )
    return np.stack([columns.mass[0, 0], stored, 0.5 * (forth + behind), 0.5 * (forth - behind)])


def accelerations(mass: Array, force: Array) -> tuple[Array, Array]:
    """``v' (n, T)`` with ``M v' = Q``, zero along motions without inertia; and the part of ``Q`` that acts along these, ``(n, T)``."""
    if mass.shape[0] == 1:
        moves = mass[0] > 0.0
        return np.divide(force, mass[0], out=np.zeros_like(force), where=moves), np.where(moves, 0.0, force)
    M, Q = np.moveaxis(mass, -1, 0), force.T[..., None]
    size = _sizes(M)
    unit = in_unit_inertias(M)
    try:
        pivots = np.linalg.cholesky(unit)
    except np.linalg.LinAlgError:
        pivots = np.zeros_like(unit)
    if (np.einsum("...ii->...i", pivots) ** 2 > RESISTED).all():
        return (np.linalg.solve(unit, Q / size[..., None]) / size[..., None])[..., 0].T, np.zeros_like(force)
    w, U = np.linalg.eigh(unit)
    kept = (w > MASSLESS * w[:, -1:])[..., None]
    parts = np.swapaxes(U, 1, 2) @ (Q / size[..., None])
    a = U @ np.where(kept, parts / np.where(kept, w[..., None], 1.0), 0.0)
    left = U @ np.where(kept, 0.0, parts)
    return (a / size[..., None])[..., 0].T, (left * size[..., None])[..., 0].T


def _sizes(M: Array) -> Array:
    size = np.sqrt(np.einsum("...ii->...i", M))
    return np.where(size > 0, size, 1.0)


def in_unit_inertias(M: Array) -> Array:
    """Mass matrices ``(..., n, n)`` in coordinates of which each has inertia 1 (or none)."""
    size = _sizes(M)
    return np.asarray(M / size[..., :, None] / size[..., None, :])
