"""A certificate of a real assembly: the theorem of Newton and Kantorovich on the independent closure rows.

Of every loop, product ``M(u)`` of the motions along it, ``f = (vee (R - R^T) / 2, p)`` about its middle vanishes where it is closed and,
within half a turn, nowhere else. With ``A`` its independent rows and the passive motions held, ``beta = |A^-1|``,
``eta = |A^-1 f|`` with all rounding in it, and ``K`` a bound of the second derivatives within ``BALL``:

    beta K eta <= 1/2  =>  one root, within (1 - sqrt(1 - 2 beta K eta)) / (beta K), and no other within min(BALL, 1 / (beta K)).

``K``: the second derivative along a unit ``u`` is a sum of products of two twists ``(w_i, v_i) u_i``, so that
``|f''| <= (sum |w_i| |u_i|) (sum h_j |u_j|)``, ``h^2 = |w|^2 + g^2``; ``g`` bounds ``|v|`` and the gap of the loop, and grows by no more
than ``exp(2 BALL sqrt(m))`` over the reach (``m`` freedoms). Source: Ortega and Rheinboldt, Iterative Solution of Nonlinear Equations
in Several Variables, 1970, section 12.6. The bound is evaluated in floating point, with a margin for rounding, not in intervals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import cross
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index
from mechgraph.numerics.linear import choose

BALL = 0.05
"""Size of the increments (radians, lengths / L) within which second derivatives are bounded."""
ROW_ROUNDING = 1e-14
"""Rounding of a closure row, against the largest number in it."""
BOUND_ROUNDING = 1.01
"""Factor that stands for the rounding of the bounds themselves."""


@dataclass(frozen=True)
class Certificate:
    """What is proved of a regular real assembly.

    Attributes
    ----------
    proved : whether ``product <= 1/2``.
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


def certificate(here: Configuration, free: Index, passive: int, by_structure: bool) -> tuple[Certificate, float]:
    """The certificate of a state, and the condition number of its independent rows."""
    J, s = here.J[:, :, 0], here.system
    fixed = np.setdiff1d(np.arange(s.n_freedoms), free)
    rows = choose(J, fixed).rows
    A = J[rows[:, None], free]
    U, sigma, Vt = np.linalg.svd(A)
    rank = len(rows)
    if rank + passive != len(free):
        return Certificate(False, np.inf, np.inf, 0.0, rank, s.n_rows - rank, "checked", float(here.closure[0])), np.inf
    beta = BOUND_ROUNDING / sigma[rank - 1] if rank else 0.0
    r = here.residual[rows, 0]
    size = max(1.0, float(np.abs(here.poses).max()))
    eta = BOUND_ROUNDING * beta * (float(np.linalg.norm(r)) + ROW_ROUNDING * size * np.sqrt(len(r) + 1.0))
    K = BOUND_ROUNDING * curvature(here)
    h = beta * K * eta
    proved = bool(h <= 0.5)
    error = float((1 - np.sqrt(1 - 2 * h)) / (beta * K)) if proved and h > 0 else float(eta)
    radius = float(min(BALL, 1 / (beta * K))) if proved and h > 0 else 0.0
    proved = proved and error < BALL
    how = "structure" if by_structure else "checked"
    condition = float(sigma[0] / sigma[rank - 1]) if rank else 1.0
    return Certificate(proved, float(h), error, radius, rank, s.n_rows - rank, how, float(here.closure[0])), condition


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
