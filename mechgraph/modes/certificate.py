"""A certificate of a real assembly: the theorem of Newton and Kantorovich on the independent closure rows, with rounding in it.

Of every loop, product ``M(u)`` of the motions along it, ``f = (vee (R - R^T) / 2, p)`` about its middle vanishes where it is closed and,
within half a turn, nowhere else. Both ``f`` and its derivative come with bounds of all rounding (see ``balls``). With ``A`` the independent
combinations of rows on the complement of the passive motions, ``beta >= |A^-1|``, ``eta >= |A^-1 f|``, and ``K`` a bound of the second
derivatives within ``BALL``:

    beta K eta <= 1/2  =>  one root, within (1 - sqrt(1 - 2 beta K eta)) / (beta K), and no other within min(BALL, 1 / (beta K)).

``beta``: with ``Y`` a computed inverse, ``|A^-1| <= |Y| / (1 - |1 - Y A|)`` for every ``A`` within its bounds. ``K``: the second
derivative along a unit ``u`` is that of a product of motions, ``sum_i u_i^2 s_i s_i + 2 sum_(i < j) u_i u_j s_i s_j``, so that with
``h^2 = |w|^2 + g^2`` and ``g`` a bound of ``|v|`` and the gap of the loop

    |f''|^2 <= sum_i |w_i|^2 h_i^2 + 2 sum_(i < j) |w_i|^2 h_j^2 <= 2 (sum |w_i|^2) (sum h_j^2).

Of a rod, ``f = ((p_b - p_a)^2 - l^2) / 2``: ``|f''| <= g^2 + sqrt(2) |w| g |p_b - p_a|`` with ``g`` the speeds of ``p_b`` and ``|w|`` the
turns, both summed as squares. All grow by no more than ``exp(2 BALL sqrt(m))`` over the reach (``m`` freedoms). These are sums of positive
numbers, of which rounding takes less than a part in 1e12: 1 % is added. Sources: Ortega and Rheinboldt, Iterative Solution of Nonlinear
Equations in Several Variables, 1970, section 12.6; Rump, Acta Numerica 19, 2010, section 10.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from mechgraph.algebra.se3 import cross, rotate
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index
from mechgraph.modes.balls import STORED, UP, Ball, Open, exact, loop_rows, rod_row
from mechgraph.modes.family import Array, Family
from mechgraph.modes.rods import RodSystem

BALL = 0.05
"""Size of the increments (radians, lengths / L) within which second derivatives are bounded."""
BOUND_ROUNDING = 1.01
"""Factor that stands for the rounding of bounds of second derivatives, and of bases that are orthonormal to rounding."""
SINGULAR_ROWS = 1e-13
"""Smallest singular value, as part of the largest, below which nothing is tried."""
APART_ROUNDING = 1e-13
"""Taken from the distance of two states for its rounding."""
TOLD_APART = 1e-7
"""Distance of the root up to which assemblies that are told apart have roots of their own."""


@dataclass(frozen=True)
class Certificate:
    """What is proved of a regular real assembly.

    Attributes
    ----------
    proved : whether ``product <= 1/2``, and the root is where the assembly is told apart from others.
    product : ``beta K eta`` of Newton and Kantorovich.
    error : bound of the distance of the root from the state given (radians, lengths / L).
    radius : distance within which there is no other root.
    rows, dependent : numbers of independent rows, on which it rests, and of those that depend on them.
    dependence : ``"structure"`` where all motions of the loops lie in one group, which makes them follow; otherwise ``"checked"``.
    residual : largest closure error in all rows.
    apart : bound from below of how far any other root that is proved at this position is (radians, lengths / L), in the coordinate or
        pose in which they differ most, of links in the frames in which they are solved (not those of ``modes.poses``); at most zero
        where they may be one, None where there is no other.
    """

    proved: bool
    product: float
    error: float
    radius: float
    rows: int
    dependent: int
    dependence: str
    residual: float
    apart: float | None = None


def certificate(here: Configuration, free: Index, passive: int, by_structure: bool) -> Certificate | None:
    """The certificate of a state; None where a pair is no product of screws and rotations."""
    s = here.system
    try:
        f, A = rows(here)
    except Open:
        return None
    A, rank = A[:, free], len(free) - passive
    U, sigma, Vt = np.linalg.svd(A.mid)
    how, residual = "structure" if by_structure else "checked", float(here.closure[0])
    dependent, off = s.n_rows - rank, np.inf
    if not rank or sigma[rank - 1] > SINGULAR_ROWS * sigma[0]:
        Y, independent = exact(np.diag(1.0 / sigma[:rank])), exact(U[:, :rank].T)
        off = BOUND_ROUNDING * float(
            np.linalg.norm((Y @ (independent @ A @ exact(Vt[:rank].T)) - exact(np.eye(rank))).bound)
        )
    if off >= 1.0:
        return Certificate(False, np.inf, np.inf, 0.0, rank, dependent, "checked", residual)
    beta = BOUND_ROUNDING / (sigma[rank - 1] * (1.0 - off)) if rank else 0.0
    eta = BOUND_ROUNDING * float(np.linalg.norm((Y @ (independent @ f)).bound)) / (1.0 - off)
    K = BOUND_ROUNDING * curvature(here)
    h = beta * K * eta
    proved = bool(h <= 0.5)
    error = float((1 - np.sqrt(1 - 2 * h)) / (beta * K)) if proved and h > 0 else float(eta)
    radius = float(min(BALL, 1 / (beta * K))) if proved and h > 0 else 0.0
    return Certificate(proved and error < TOLD_APART, float(h), error, radius, rank, dependent, how, residual)


def told_apart(family: Family, x: Array, sure: Sequence[Certificate | None]) -> list[Certificate | None]:
    """Certificates of states ``x (nx, M)`` with how far ``apart`` their roots are.

    A root lies within ``error`` of its state, measured by increments, so that no coordinate and no angle of a rotation differs by more:
    roots whose states differ by more than both errors are two. Coordinates that passive motions change do not count.
    """
    angles, lengths = family.settled_rows
    turns, proved = family.settled_rotations, [i for i, one in enumerate(sure) if one is not None and one.proved]
    error = np.array([one.error for one in sure if one is not None and one.proved])
    x, out = x[:, proved], list(sure)
    for n, i in enumerate(proved):
        off = (x - x[:, [n]])[angles]
        Q, R = x[turns], x[turns][:, :, [n]]
        gaps = [
            np.abs(off - 2 * np.pi * np.round(off / (2 * np.pi))),
            np.abs(x - x[:, [n]])[lengths],
            # twice the chord is no more than the angle
            2.0 * np.minimum(*(np.sqrt(((Q + sign * R) ** 2).sum(axis=0)) for sign in (1.0, -1.0))),
        ]
        least = np.delete(np.concatenate(gaps).max(axis=0, initial=0.0) / UP - error - error[n] - APART_ROUNDING, n)
        out[i] = replace(cast("Certificate", sure[i]), apart=float(least.min()) if least.size else None)
    return out


def rows(here: Configuration) -> tuple[Ball, Ball]:
    """What rows leave open ``(n,)`` and their derivatives ``(n, F)``, with bounds of their rounding; those of couplings are linear."""
    s = here.system
    J, size = here.J[:, :, 0], np.abs(here.J[:, :, 0])
    largest = s.n_freedoms * (1.0 + size.sum(axis=1) * np.abs(here.x).max(initial=1.0))
    f, A = Ball(here.residual[:, 0].copy(), STORED * largest), Ball(J.copy(), STORED * size)
    for loop, (columns, _) in enumerate(s.loop_columns):
        _put(f, A, slice(6 * loop, 6 * loop + 6), columns, loop_rows(here, loop))
    if isinstance(s, RodSystem):
        for rod, columns in enumerate(_columns_of_rods(s)):
            row = 6 * s.graph.n_loops + rod
            _put(f, A, slice(row, row + 1), columns, rod_row(here, rod))
    return f, A


def _put(f: Ball, A: Ball, at: slice, columns: Index, found: tuple[Ball, Ball]) -> None:
    for part in ("mid", "rad"):
        getattr(A, part)[at] = 0.0
        getattr(f, part)[at], getattr(A, part)[at, columns] = (getattr(ball, part) for ball in found)


def _columns_of_rods(s: RodSystem) -> list[Index]:
    """Freedoms between the bodies of every rod, pair by pair along the way."""
    first = s.first_column
    ways = (s.way(rod) for rod in range(len(s.points.a)))
    return [np.concatenate([np.arange(first[k], first[k + 1]) for k, _ in way]) for way in ways]


def curvature(here: Configuration) -> float:
    """A bound of the second derivatives of the rows of all loops and rods within ``BALL``."""
    s, S, total = here.system, here.S[:, :, 0], 0.0
    for loop, (columns, _) in enumerate(s.loop_columns):
        turn, arm, grown = _sizes(S[:, columns], here.middles[:, loop, 0])
        gap = BALL * grown * np.sqrt((turn**2 + arm**2).sum())
        h2 = turn**2 + (grown * arm + turn * gap) ** 2
        total += 2.0 * float((turn**2).sum() * h2.sum())
    if isinstance(s, RodSystem):
        W, k = s.rod_rows.lines(here)[1][..., 0], s.points
        for rod, columns in enumerate(_columns_of_rods(s)):
            end = rotate(here.poses[:, :3, k.b[rod]], k.at_b[:, rod]) + here.poses[:, 3, k.b[rod]]
            turn, arm, grown = _sizes(S[:, columns], end[:, 0])
            gone = BALL * grown * np.sqrt((arm**2).sum())
            speed, length = np.sqrt(((arm + turn * gone) ** 2).sum()), np.sqrt((W[3:, rod] ** 2).sum()) + gone
            total += float(speed**2 + np.sqrt(2.0 * (turn**2).sum()) * speed * length) ** 2
    return float(np.sqrt(total))


def _sizes(S: Array, point: Array) -> tuple[Array, Array, float]:
    """Sizes ``|w|, |v|`` of twists ``S (6, n)`` about a ``point (3,)``, and how far these grow within ``BALL``."""
    w = S[:3]
    v = S[3:] + cross(w, np.repeat(point[:, None], w.shape[1], axis=1))
    return np.sqrt((w * w).sum(axis=0)), np.sqrt((v * v).sum(axis=0)), float(np.exp(2 * BALL * np.sqrt(w.shape[1])))
