"""Multipliers of least norm where gears touch each other on flanks that hang on the signs of these very multipliers.

On given flanks reactions are linear in the multipliers, and the least ones solve a least-squares problem under the condition that every
multiplier keeps the sign of its flank. Where the least ones touch each other no more (a multiplier is zero there) the other flank may make
the reactions less: flanks are changed one after the other while it does, so that the norm only falls.
Source: Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23 (LSI, least distance programming by NNLS).
"""

from __future__ import annotations

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.contact_lines import ContactLines
from mechgraph.closure.indexing import Index
from mechgraph.force.dalembert import Wrenches
from mechgraph.numerics.tolerances import STRESSES
from mechgraph.structure.reaction_split import at_pair_points, split_stress

STRAIN = 1e-4
"""Weight of efforts beside reactions: where drivers or couplings strain each other without any reaction, their efforts decide alone."""


def least_under_signs(
    here: Configuration, wrenches: Wrenches, lines: ContactLines, acting: Index
) -> tuple[Array, Array]:
    """Multiples ``(s,)`` of all self-stresses that make the reactions of one position least, and the signs ``(n,)`` of the flanks.

    ``wrenches`` are total ones of which contacts take nothing off yet, with a basis of all self-stresses.
    """
    own, change = wrenches.multipliers[:, 0], wrenches.multiplier_stress[:, :, 0]
    size = max(float(np.abs(own).max()), np.finfo(float).tiny)
    free = [g for g, _ in lines.contacts if np.abs(change[g]).max() > STRESSES.unique * np.abs(change).max()]

    def tried(flank: Array) -> tuple[Array, float] | None:
        A, b = _norm(here, wrenches, lines, acting, flank)
        y = _least_above(A, b, flank[free, None] * change[free], -flank[free] * own[free] - STRESSES.rounding * size)
        return None if y is None else (y, float(np.linalg.norm(A @ y + b)))

    flank = np.where(own < 0.0, -1.0, 1.0)
    best = tried(flank) or (np.zeros(change.shape[1]), np.inf)
    going = True
    while going:
        going = False
        now = own + change @ best[0]
        for g in free:
            if abs(now[g]) <= STRESSES.unique * np.abs(now).max():
                other = flank.copy()
                other[g] = -flank[g]
                found = tried(other)
                if found is not None and found[1] < (1.0 - STRESSES.unique) * best[1]:
                    flank, best, going = other, found, True
                    break
    return best[0], flank


def _norm(
    here: Configuration, wrenches: Wrenches, lines: ContactLines, acting: Index, flank: Array
) -> tuple[Array, Array]:
    """``A`` and ``b`` of the norm ``|A y + b|`` of reactions, and of efforts with their weight, on flanks ``(n,)``."""
    states = np.concatenate([wrenches.stress, wrenches.totals[:, :, None]], axis=2)
    multipliers = np.concatenate([wrenches.multiplier_stress, wrenches.multipliers[:, None]], axis=1)
    every = np.arange(here.system.n_freedoms)
    split = split_stress(here, states - lines.relief(multipliers, flank[:, None]), multipliers, every)
    points = at_pair_points(here, split.wrenches).reshape(-1, states.shape[2])
    whole = np.concatenate([points, STRAIN * split.efforts[acting, :, 0], STRAIN * multipliers[:, :, 0]])
    return whole[:, :-1], whole[:, -1]


def _least_above(A: Array, b: Array, G: Array, h: Array) -> Array | None:
    """``y`` with ``G y >= h`` that makes ``|A y + b|`` least; None where there is none. A has full column rank."""
    Q, R = np.linalg.qr(A)
    shift = Q.T @ b
    # z = R y + Q^T b is to be the shortest one
    G = scipy.linalg.solve_triangular(R, G.T, trans="T").T
    h = h + G @ shift
    size = max(float(np.abs(h).max(initial=0.0)), np.finfo(float).tiny)
    E = np.vstack([G.T, h / size])
    unit = np.zeros(len(E))
    unit[-1] = 1.0
    left = E @ scipy.optimize.nnls(E, unit)[0] - unit
    if -left[-1] <= STRESSES.rounding:
        return None
    return np.asarray(scipy.linalg.solve_triangular(R, -size * left[:-1] / left[-1] - shift))
