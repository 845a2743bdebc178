"""The equations of motion in independent rates: accelerations beside the loads, for a batch of states.

The rates of all freedoms are ``q' = Z v + Z_p p'`` with the independent rates ``v (n,)`` and those of the prescribed freedoms ``p``; ``Z``
solves the closure ``J Z = 0``. The principle of virtual power along every column of ``Z`` eliminates the reactions:

    M v' = Q,   M_kl = sum over links V_k . I V_l,   Q_k = sum over links V_k . (W - I A_0 - V x* I V) + Z_k . tau

with ``V_k`` the twists of the links for the column, ``W`` the applied wrenches, ``tau`` the given efforts, and ``A_0`` the accelerations
for ``v' = 0``. It is the Schur complement of Lee's system (1977, section 3.5), in which the independent accelerations are unknowns beside
the reactions. Source of the form: Kane and Levinson, Dynamics: Theory and Applications, 1985, chapter 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.rates import Rates, Velocities
from mechgraph.closure.solver import FactoredClosure
from mechgraph.force.applied_loads import Site, inertia_wrenches
from mechgraph.model.load import Load

MASSLESS = 1e-12
"""Eigenvalue of the mass matrix, against the largest, below which a motion has no inertia."""


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

    ``rates``; ``mass (n, n, T)`` and ``force (n, T)`` of the reduced equations; ``power (T,)`` of prescribed drivers and of the loads
    without a potential energy; internal units.
    """

    rates: Rates
    mass: Array
    force: Array
    power: Array


def _inertia(here: Configuration, V: Array, A: Array) -> Array:
    return inertia_wrenches(here, SimpleNamespace(V=V, A=A))  # type: ignore[arg-type]


def moved(
    here: Configuration,
    f: FactoredClosure,
    v: Array,
    p: Array,
    loads: Loads,
    t: Array,
) -> Moved:
    """Accelerations at closed states with independent rates ``v (n, T)`` and prescribed rates and accelerations ``p (2, p, T)``.

    ``f`` is factored with the independent columns fixed, and behind them the prescribed ones.
    """
    T, n = here.T, len(v)
    Z, Zp = np.split(f.sensitivity(), [n], axis=1)
    dq = (Z * v).sum(axis=1) + (Zp * p[0]).sum(axis=1)
    velocities = Velocities(here, dq)
    V = velocities.V
    ddq = f.solve(-here.closure_bias(dq, V)[:, None])[:, 0] + (Zp * p[1]).sum(axis=1)
    A = here.accelerations_with(ddq, velocities.bias)
    coordinates = here.system.coordinates_of(here.x)
    applied, efforts, power = np.zeros_like(V), np.zeros_like(dq), np.zeros(T)
    for some in (loads.stored, loads.rest):
        if some:
            site = Site(here, velocities, coordinates, (T,), np.arange(T), t)
            site.collect(some)
            wrenches, given = site.applied(), site.scaled_efforts()
            applied, efforts = applied + wrenches, efforts + given
            if some is loads.rest:
                power += (V * wrenches).sum(axis=(0, 1)) + (dq * given).sum(axis=0)
    rest = applied + _inertia(here, V, A)
    columns = [here.link_twists(Z[:, k]) for k in range(n)]
    still = np.zeros_like(V)
    reluctance = [_inertia(here, still, Vk) for Vk in columns]
    mass, force = np.empty((n, n, T)), np.empty((n, T))
    for k, Vk in enumerate(columns):
        force[k] = (Vk * rest).sum(axis=(0, 1)) + (Z[:, k] * efforts).sum(axis=0)
        for j in range(k, n):
            mass[k, j] = mass[j, k] = -(Vk * reluctance[j]).sum(axis=(0, 1))
    a = accelerations(mass, force)
    ddq = ddq + (Z * a).sum(axis=1)
    out = Rates(velocities, ddq, np.zeros(T))
    for j in range(n):
        rest = rest + reluctance[j] * a[j]
    for k in range(Zp.shape[1]):
        effort = -((here.link_twists(Zp[:, k]) * rest).sum(axis=(0, 1)) + (Zp[:, k] * efforts).sum(axis=0))
        power += effort * p[0, k]
    return Moved(out, mass, force, power)


def kinetic_energy(here: Configuration, V: Array) -> Array:
    """``sum over links V . I V / 2``, ``(T,)``, internal units."""
    return np.asarray(-0.5 * (V * _inertia(here, np.zeros_like(V), V)).sum(axis=(0, 1)))


def accelerations(mass: Array, force: Array) -> Array:
    """``v' (n, T)`` with ``M v' = Q``; zero along motions without inertia."""
    M, Q = np.moveaxis(mass, -1, 0), force.T[..., None]
    if mass.shape[0] == 1:
        return np.divide(force, mass[0], out=np.zeros_like(force), where=mass[0] > 0)
    size = np.sqrt(np.einsum("tii->ti", M))
    size = np.where(size > 0, size, 1.0)
    scaled = M / size[:, :, None] / size[:, None, :]
    w, U = np.linalg.eigh(scaled)
    kept = w > MASSLESS * w[:, -1:]
    parts = np.swapaxes(U, 1, 2) @ (Q / size[..., None])
    parts = np.where(kept[..., None], parts / np.where(kept, w, 1.0)[..., None], 0.0)
    return ((U @ parts) / size[..., None])[..., 0].T
