"""Redundant reactions split by the stiffness of the pairs, and the forces that misfits lock in.

Of all reactions ``l = l0 + N x`` in balance with the loads (N: self-stresses) those come about that make ``sum l^2 / (2 k) - sum l misfit``
least (Castigliano): with the compliances ``C = diag 1/k``, zero where rigid,

    (N^T C N) x = N^T (misfit - C l0).

A component with k = 0 carries nothing: ``l = 0`` is a condition. Self-stresses that strain rigid components alone stay unknown. Where a
force closes a pair its normal component is not negative, and lifts off else (least squares under signs, ``force.reactions``).
Source: S. Timoshenko, Strength of Materials II, 1956; C. L. Lawson and R. J. Hanson, Solving Least Squares Problems, 1974.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.errors import DeclarationError
from mechgraph.force.reactions import PairFrames, Stress, least_above
from mechgraph.kinematics.state import Configuration
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import STRESSES
from mechgraph.model.mechanism import Mechanism


@dataclass(frozen=True)
class Seats:
    """What pairs say of their seats: for every reaction component ``(K,)`` of all pairs, group by group, the ``compliance`` and the
    ``misfit`` in internal units, whether it carries nothing (``loose``), the sense in which it can only push (``push``, 0 for none).
    """

    compliance: Array
    misfit: Array
    loose: Array
    push: Array

    @property
    def soft(self) -> Index:
        """The components with a stiffness that is not 0."""
        return np.flatnonzero(self.compliance > 0)


@dataclass(frozen=True)
class ElasticSplit:
    """Multiples ``y (s, T)`` of the self-stresses, those of them that misfits lock in ``locked (s, T)``; ``left (s, s, T)`` are the mixes
    that stay unknown (columns of zeros else), ``unit (s, K, T)`` what a misfit of one in each component adds, ``soft`` the components
    that are not rigid.
    """

    y: Array
    locked: Array
    left: Array
    unit: Array
    soft: Index


def component_values(here: Configuration, wrenches: Array) -> Array:
    """Components ``(K, ..., T)`` of reaction wrenches ``(6, P, ..., T)``, group by group."""
    parts = [part.reshape(-1, *part.shape[2:]) for part in PairFrames(here).components(wrenches)]
    return np.concatenate(parts)


def seats_of(here: Configuration) -> Seats:
    """The seats of the pairs of a system, in the order of ``component_values``."""
    m: Mechanism = here.system.m
    L = here.system.par.L
    rows: list[tuple[float, float, bool, float]] = []
    for g in here.system.groups:
        parts = g.row.reactions or ()
        for c, name in enumerate(g.row.component_names):
            couple = bool(parts) and parts[c].is_couple
            for k in g.pairs:
                pair = m.pairs[k] if k < len(m.pairs) else None
                stiff = None if pair is None or pair.stiffness is None else getattr(pair.stiffness, name, None)
                off = 0.0 if pair is None or pair.misfit is None else getattr(pair.misfit, name, None) or 0.0
                unit = L * L if couple else 1.0
                form = None if pair is None or pair.closed != "force" else pair.type.touching
                pushed = form is not None and not form.curved and form.forces == (name,)
                rows.append((unit / stiff if stiff else 0.0, off if couple else off / L, stiff == 0.0, float(pushed)))
    compliance, misfit, loose, push = (np.array(part) for part in zip(*rows, strict=True))
    return Seats(compliance, misfit, loose.astype(bool), push)


def elastic_split(here: Configuration, reactions: Array, efforts: Array, stress: Stress) -> ElasticSplit:
    """The multiples of all self-stresses that come about in reactions ``(6, P, T)`` beside ``efforts (F, T)``, at every position."""
    seats, T = seats_of(here), here.T
    if not (seats.compliance.any() or seats.loose.any()):
        m = here.system.m
        raise DeclarationError(
            f"solve {m.name!r}",
            ["redundant='elastic': no pair has a stiffness; give those that share a load stiffness="],
        )
    N = np.moveaxis(component_values(here, stress.wrenches), -1, 0)
    own = component_values(here, reactions).T
    s, K = N.shape[2], N.shape[1]
    out = ElasticSplit(np.zeros((s, T)), np.zeros((s, T)), np.zeros((s, s, T)), np.zeros((s, K, T)), seats.soft)
    size = max(float(np.abs(own).max(initial=0.0)), float(np.abs(efforts).max(initial=0.0)))
    for t in range(T):
        _split_at(t, seats, N[t], own[t], out, size)
    return out


def _split_at(t: int, seats: Seats, N: Array, own: Array, out: ElasticSplit, size: float) -> None:
    """Fill in one position: self-stresses ``N (K, s)``, reactions ``own (K,)``; ``size`` of the largest reaction of all positions."""
    C, s = seats.compliance, N.shape[1]
    free, fixed = _conditions(N[seats.loose], own[seats.loose], s, size)
    if fixed is None:  # the loads ask for what carries nothing: no self-stress is known
        out.left[:, :, t] = np.eye(s)
        return
    strain = np.sqrt(C)[:, None] * (N @ free)
    _, sizes, turn = np.linalg.svd(strain, full_matrices=True)
    known = np.zeros(turn.shape[0], dtype=bool)
    known[: len(sizes)] = sizes > STRESSES.unique * max(sizes.max(initial=0.0), 1e-300)
    Z, left = free @ turn[known].T, free @ turn[~known].T
    out.left[:, : left.shape[1], t] = left
    if not known.any():
        out.y[:, t] = fixed
        return
    A = np.sqrt(C)[:, None] * (N @ Z)
    inverse = np.linalg.inv(A.T @ A)
    N_own = own + N @ fixed

    def least(misfit: Array) -> tuple[Array, Array]:
        """Multiples of Z, and the self-stresses that stay where what lifts off carries nothing."""
        pull = (N @ Z).T @ (misfit - C * N_own)
        z, stays = inverse @ pull, np.eye(Z.shape[1])
        pushed = np.flatnonzero(seats.push)
        G = N[pushed] @ Z
        if pushed.size and not left.shape[1] and (N_own[pushed] + G @ z < -STRESSES.rounding * size).any():
            b = -A @ inverse @ pull
            found = least_above(A, b, G, -N_own[pushed])
            z = np.full(Z.shape[1], np.nan) if found is None else found
            lifted = G[np.abs(N_own[pushed] + G @ z) <= STRESSES.unique * max(size, 1e-300)]
            stays = _conditions(lifted, np.zeros(len(lifted)), Z.shape[1])[0]
        return z, stays

    z, stays = least(seats.misfit)
    out.y[:, t] = fixed + Z @ z
    if seats.misfit.any():
        out.locked[:, t] = Z @ (z - least(np.zeros(len(C)))[0])
    Zs = Z @ stays
    if Zs.shape[1]:
        out.unit[:, :, t] = Zs @ np.linalg.solve(Zs.T @ N.T @ (C[:, None] * N) @ Zs, (N @ Zs).T)


def _conditions(A: Array, b: Array, s: int, size: float = 0.0) -> tuple[Array, Array | None]:
    """The null space of conditions ``A y + b = 0``, and a solution; None where there is none beside reactions of a ``size``."""
    if not len(A):
        return np.eye(s), np.zeros(s)
    ways, sizes, turn = np.linalg.svd(A, full_matrices=True)
    r = int((sizes > STRESSES.unique * max(sizes.max(initial=0.0), 1.0)).sum())
    y = -turn[:r].T @ ((ways[:, :r].T @ b) / sizes[:r])
    met = np.abs(A @ y + b).max() <= STRESSES.unique * max(np.abs(b).max(), size, 1e-300)
    return turn[r:].T, y if met else None
