"""A certificate of a real assembly: the theorem of Newton and Kantorovich on the independent closure rows, with rounding in it.

Of every loop, product ``M(u)`` of the motions along it, ``f = (vee (R - R^T) / 2, p)`` about its middle vanishes where it is closed and,
within half a turn, nowhere else. Both ``f`` and its derivative come with bounds of all rounding (see ``balls``). With ``A`` the independent
combinations of rows on the complement of the passive motions, ``beta >= |A^-1|``, ``eta >= |A^-1 f|``, and ``K`` a bound of the second
derivatives within ``BALL``:

    beta K eta <= 1/2  =>  one root, within (1 - sqrt(1 - 2 beta K eta)) / (beta K), and no other within min(BALL, 1 / (beta K)).

``beta``: with ``Y`` a computed inverse, ``|A^-1| <= |Y| / (1 - |1 - Y A|)`` for every ``A`` within its bounds. ``K``: the second
derivative along a unit ``u`` is a sum of products of two twists ``(w_i, v_i) u_i``, so that ``|f''| <= (sum |w_i| |u_i|) (sum h_j |u_j|)``,
``h^2 = |w|^2 + g^2``; ``g`` bounds ``|v|`` and the gap of the loop, and grows by no more than ``exp(2 BALL sqrt(m))`` over the reach
(``m`` freedoms). It is a sum of positive numbers, of which rounding takes less than a part in 1e12: 1 % is added. Sources: Ortega and
Rheinboldt, Iterative Solution of Nonlinear Equations in Several Variables, 1970, section 12.6; Rump, Acta Numerica 19, 2010, section 10.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import cross
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index
from mechgraph.modes.balls import STORED, Ball, Open, exact, loop_rows

BALL = 0.05
"""Size of the increments (radians, lengths / L) within which second derivatives are bounded."""
BOUND_ROUNDING = 1.01
"""Factor that stands for the rounding of bounds of second derivatives, and of bases that are orthonormal to rounding."""
SINGULAR_ROWS = 1e-13
"""Smallest singular value, as part of the largest, below which nothing is tried."""
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
    """

    proved: bool
    product: float
    error: float
    radius: float
    rows: int
    dependent: int
    dependence: str
    residual: float


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


def rows(here: Configuration) -> tuple[Ball, Ball]:
    """What the rows leave open ``(n,)`` and their derivatives ``(n, F)``, with bounds of their rounding; those of couplings are linear."""
    s, J, r = here.system, here.J[:, :, 0], here.residual[:, 0]
    f, A = Ball(r.copy(), np.zeros_like(r)), Ball(J.copy(), np.zeros_like(J))
    for loop, (columns, _) in enumerate(s.loop_columns):
        at = slice(6 * loop, 6 * loop + 6)
        opened, twists = loop_rows(here, loop)
        f.mid[at], f.rad[at] = opened.mid, opened.rad
        A.mid[at], A.rad[at] = 0.0, 0.0
        A.mid[at, columns], A.rad[at, columns] = twists.mid, twists.rad
    linear = slice(6 * s.graph.n_loops, None)
    A.rad[linear] = STORED * np.abs(J[linear])
    f.rad[linear] = STORED * s.n_freedoms * (1.0 + np.abs(J[linear]).sum(axis=1) * np.abs(here.x).max(initial=1.0))
    return f, A


def curvature(here: Configuration) -> float:
    """A bound of the second derivatives of the rows of all loops within ``BALL``."""
    s, total = here.system, 0.0
    S = here.S[:, :, 0]
    for loop, (columns, _) in enumerate(s.loop_columns):
        w, v = (
            S[:3, columns],
            S[3:, columns] + cross(S[:3, columns], np.repeat(here.middles[:, loop], len(columns), axis=1)),
        )
        turn, arm = np.sqrt((w * w).sum(axis=0)), np.sqrt((v * v).sum(axis=0))
        grown = np.exp(2 * BALL * np.sqrt(len(columns)))
        gap = BALL * grown * np.sqrt((turn**2 + arm**2).sum())
        h2 = turn**2 + (grown * arm + turn * gap) ** 2
        total += float((turn**2).sum() * h2.sum())
    return float(np.sqrt(total))
