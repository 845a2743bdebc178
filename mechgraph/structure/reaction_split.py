"""From total pair wrenches to reactions: the split into reaction and effort, self-stress, what is unique."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mechgraph.algebra.se3 import Array, batch_last, cross, shift_wrench
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index
from mechgraph.numerics.tolerances import STRESSES

UNIQUE = STRESSES.unique
"""Part of a unit self-stress in a component above which the component is not unique (forces and moments / L compared)."""


@dataclass(frozen=True)
class Stress:
    """Self-stresses: reaction states without load, orthonormal in the measure ``sum |F|^2 + |M / L|^2`` at the pair points.

    ``wrenches (6, P, s, T)`` are the reaction parts about the internal origin, ``efforts (F, s, T)`` what they bring to driven and
    coupled freedoms, ``multipliers (n, s, T)`` those of the closure rows behind those of the loops.
    """

    wrenches: Array
    efforts: Array
    multipliers: Array


def at_pair_points(here: Configuration, wrenches: Array) -> Array:
    """Wrenches ``(6, P, ..., T)`` about the internal origin, taken about the origin of marker B of their pair."""
    points = here.pair_points
    extra = wrenches.ndim - 3
    return shift_wrench(wrenches, points.reshape(3, points.shape[1], *(1,) * extra, points.shape[2]))


def reaction_part(here: Configuration, totals: Array, efforts: Array) -> Array:
    """Reaction wrenches ``w - E tau``; totals ``(6, P, T)``, efforts ``(F, T)``."""
    return totals - here.pair_sums(here.E * efforts)


def pair_power(here: Configuration, totals: Array) -> Array:
    """``S^T w`` of every freedom, ``(F, T)``: the efforts that the total wrenches ``(6, P, T)`` stand for."""
    return np.asarray((here.S * totals[:, here.system.owners]).sum(axis=0))


def split_stress(here: Configuration, states: Array, multipliers: Array, acting: Index) -> Stress:
    """Reaction parts and efforts of pair wrench states ``(6, P, s, T)``; only the freedoms ``acting`` (driven, coupled) have efforts.

    The reaction parts take the place of ``states``, as these are large.
    """
    s = states.shape[2]
    efforts = np.zeros((here.system.n_freedoms, s, here.T))
    for i in range(s):
        tau = pair_power(here, states[:, :, i])
        efforts[acting, i] = tau[acting]
        states[:, :, i] = reaction_part(here, states[:, :, i], efforts[:, i])
    return Stress(states, efforts, multipliers)


def orthonormal_stress(here: Configuration, states: Array, multipliers: Array, acting: Index) -> Stress:
    """Self-stresses from independent total wrench states ``(6, P, s, T)``, orthonormal at every position."""
    stress, s = split_stress(here, states, multipliers, acting), states.shape[2]
    if not s:
        return stress
    reactions, efforts = stress.wrenches, stress.efforts
    flat = at_pair_points(here, reactions).transpose(3, 0, 1, 2).reshape(here.T, 6 * states.shape[1], s)
    mix = batch_last(_orthonormal(flat, np.concatenate([efforts, multipliers]).transpose(2, 0, 1)))
    mixed = (np.einsum("fit,ijt->fjt", values, mix) for values in (efforts, multipliers))
    return Stress(np.einsum("cpit,ijt->cpjt", reactions, mix), *mixed)


def _orthonormal(reactions: Array, efforts: Array) -> Array:
    """Mixes ``(T, s, s)`` that make states orthonormal in their reactions ``(T, n, s)``; in their efforts where those are all zero."""
    R = np.linalg.qr(reactions, mode="r")
    size = np.abs(np.einsum("tii->ti", R))
    if (size.min(axis=1) > STRESSES.drivers_alone * size.max(axis=1)).all():
        return np.asarray(np.linalg.inv(R))
    _, sigma, Vt = np.linalg.svd(reactions, full_matrices=False)
    out = np.swapaxes(Vt, 1, 2).copy()
    for t, (mix, values) in enumerate(zip(out, sigma, strict=True)):
        alone = values <= STRESSES.drivers_alone * max(values[0], float(np.abs(efforts[t]).max()))
        mix[:, ~alone] /= values[~alone]
        mix[:, alone] = mix[:, alone] @ np.linalg.inv(np.linalg.qr(efforts[t] @ mix[:, alone], mode="r"))
    return out


def least_multiples(here: Configuration, reactions: Array, efforts: Array, multipliers: Array, stress: Stress) -> Array:
    """Multiples ``(s, T)`` of the self-stresses with which reactions ``(6, P, T)`` have minimum norm: no part along any of them."""
    states = at_pair_points(here, stress.wrenches)
    y = -np.einsum("cpit,cpt->it", states, at_pair_points(here, reactions))
    alone = (states**2).sum(axis=(0, 1)) < 0.5  # drivers or couplings that strain each other without any reaction
    acting = np.einsum("fit,ft->it", stress.efforts, efforts) + np.einsum("nit,nt->it", stress.multipliers, multipliers)
    y -= np.where(alone, acting, 0.0)
    return np.asarray(y)


class PairFrames:
    """Components of reaction wrenches in the frames of the pair table, by the dual basis of ``[W, E]``."""

    def __init__(self, here: Configuration) -> None:
        self.here = here

    @cached_property
    def dual(self) -> list[Array]:
        """For every group the inverse of ``[W, E]`` at the pair points, ``(n, T, 6, 6)``."""
        here = self.here
        out = []
        for g, W in zip(here.system.groups, here.W, strict=True):
            E = here.E[:, g.columns]
            basis = np.concatenate([W, E], axis=1)
            points = here.pair_points[:, None, g.pairs]
            local = np.concatenate([basis[:3] - cross(points, basis[3:]), basis[3:]])
            out.append(np.linalg.inv(local.transpose(2, 3, 0, 1)))
        return out

    def components(self, wrenches: Array) -> list[Array]:
        """For every group the components ``(6 - f, n, ..., T)`` of reaction wrenches ``(6, P, ..., T)``."""
        local = at_pair_points(self.here, wrenches)
        out = []
        for g, inverse in zip(self.here.system.groups, self.dual, strict=True):
            values = np.einsum("ijnt,jn...t->in...t", batch_last(inverse), local[:, g.pairs])
            out.append(values[: 6 - g.row.f])
        return out

    def components_of(self, number: int, i: int, wrenches: Array) -> Array:
        """Components ``(6 - f, ..., T)`` of the ``i``-th pair of a group from its reaction wrenches ``(6, ..., T)``."""
        here = self.here
        g = here.system.groups[number]
        basis = np.concatenate([here.W[number][:, :, i], here.E[:, g.columns[:, i]]], axis=1)
        point = here.pair_points[:, int(g.pairs[i])]
        local = np.concatenate([basis[:3] - cross(point[:, None], basis[3:]), basis[3:]])
        inverse = np.linalg.inv(np.moveaxis(local, 2, 0))
        shifted = shift_wrench(wrenches, point.reshape(3, *(1,) * (wrenches.ndim - 2), here.T))
        return np.asarray(np.einsum("ijt,j...t->i...t", batch_last(inverse), shifted)[: 6 - g.row.f])
