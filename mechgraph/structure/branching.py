"""Branches that meet at a singular position, to second order.

Where the closure matrix loses rank more motions ``q' = N a`` are free to first order than the mechanism has. Those that go on to second
order meet the curvature of the closure: with a basis ``x_j`` of the self-stresses, ``J^T x_j = 0``,

    x_j . bias(N a) = 0  for all j,    bias(q') the velocity part of the closure accelerations, quadratic in q'.

Source: Connelly and Servatius, Higher-order rigidity: what is the proper definition?, Discrete Comput. Geom. 11, 1994 (second order).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mechgraph.algebra.se3 import Array, null_space
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.loop_rows import ClosureRows
from mechgraph.closure.passive_motion import PassiveMotion
from mechgraph.closure.rank import rank_of_rows
from mechgraph.numerics.newton import closest_zeros
from mechgraph.numerics.tolerances import RANKS

STARTS = 64
"""Random starts of the search; k self-stresses that are not those of a regular position allow 2^k branches."""
STARTS_SEED = 5
"""Of these starts."""
BRANCH_RESIDUAL = 1e-9
"""Residual of a branch."""
FREEDOMS_LISTED = 8
"""Most freedoms listed of a branch."""
MOST_BRANCHES = 16
"""Most branches that are told apart."""
BRANCHING_MOTIONS = 24
"""Motions up to which branches are sought: of more, far more branches than are told apart meet, or all of a continuum."""
SAME = 1e-3
"""Difference of rates up to which two branches are one: rates of branches that touch are found to the square root of rounding."""


class _Curvature:
    """``x_j . bias(q')`` at multiples ``a (n, T)`` of the motions ``N (F, n)``, and rates ``given (k, n)`` of these less one."""

    def __init__(self, system: System, x: Array, N: Array, stress: Array, given: Array) -> None:
        self.system, self.x, self.N, self.stress, self.given = system, x, N, stress, given

    def residual(self, a: Array) -> Array:
        """Residuals ``(self-stresses + drivers, T)``."""
        here = Configuration(self.system, np.repeat(self.x[:, None], a.shape[1], axis=1))
        dq = self.N @ a
        bias = here.closure_bias(here.bias(dq, here.link_twists(dq)))
        return np.concatenate([self.stress.T @ bias, self.given @ a - 1.0])

    def at(self, a: Array) -> _Point:
        """The residual with its derivatives."""
        return _Point(self, a)


class _Point:
    def __init__(self, curvature: _Curvature, a: Array) -> None:
        self.curvature, self.x, self.residual = curvature, a, curvature.residual(a)

    def steps(self) -> Array:
        """Steps of least norm to a zero; differences are exact, as the residual is quadratic."""
        n, T = self.x.shape
        shifted = np.repeat(self.x, 2 * n, axis=1).reshape(n, T, 2, n)
        shifted += np.stack([np.eye(n), -np.eye(n)], axis=1)[:, None]
        r = self.curvature.residual(shifted.reshape(n, -1)).reshape(-1, T, 2, n)
        J = 0.5 * (r[:, :, 0] - r[:, :, 1])
        return -np.einsum("tnm,mt->nt", np.linalg.pinv(J.swapaxes(0, 1)), self.residual)


def branches(
    system: System, x: Array, columns: Index, passive: Sequence[PassiveMotion] = ()
) -> tuple[dict[str, float], ...]:
    """The branches that meet at a closed state ``x (nx,)``: rates of all freedoms by name, for unit rates of the drivers ``columns``.

    Of branches along which the drivers stand still the largest rate is one.
    Empty where there is one alone (without self-stresses there is no other), where more than ``BRANCHING_MOTIONS`` motions are possible,
    or where more than ``MOST_BRANCHES`` directions are: then a freedom is left free. The rank is decided
    to the accuracy with which closing meets a singular position (``RANKS.nearby``). Passive motions are at rest.
    """
    found = rank_of_rows(ClosureRows.at(Configuration(system, x[:, None])), tolerance=RANKS.nearby)
    N = found.motions
    if passive:
        idle, _ = np.linalg.qr(np.stack([p.rates for p in passive], axis=1))
        U, s, _ = np.linalg.svd(N - idle @ (idle.T @ N), full_matrices=False)
        N = U[:, s > 0.5]
    if found.rank == found.count or N.shape[1] > BRANCHING_MOTIONS:
        return ()
    rng = np.random.default_rng(STARTS_SEED)
    # so many random combinations of the self-stresses say as much about N.shape[1] motions as all of them
    stress = found.random_stress(rng, min(found.count - found.rank, N.shape[1] + 1))
    ways = _ways(_Curvature(system, x, N, stress, N[columns]), rng)
    resting = N @ null_space(N[columns], RANKS.nearby)
    if ways and resting.shape[1]:
        # a random rate of one gives every direction its size
        beside = _ways(_Curvature(system, x, resting, stress, rng.normal(size=(1, resting.shape[1]))), rng)
        ways += [way / way[np.argmax(np.abs(way))] + 0.0 for way in beside]
    if not 1 < len(ways) <= MOST_BRANCHES:
        return ()
    unit = np.where(system.is_length, system.par.L, 1.0)
    names = system.m.freedom_names()
    # in an order that rounding does not change
    rates = sorted((way * unit / unit[columns[0]] for way in ways), key=lambda way: np.round(way / SAME).tolist())
    return tuple(dict(zip(names, one.tolist(), strict=True)) for one in rates)


def _ways(curvature: _Curvature, rng: np.random.Generator) -> list[Array]:
    """The rates ``(F,)`` that have no residual, found from random starts."""
    first = rng.normal(size=(curvature.N.shape[1], STARTS))
    a, error = closest_zeros(curvature.at, _Point.steps, np.add, first, tolerance=BRANCH_RESIDUAL)
    ways: list[Array] = []
    for one in (curvature.N @ a[:, error < 1e3 * BRANCH_RESIDUAL]).T:
        if all(np.abs(one - other).max() > SAME for other in ways):
            ways.append(np.where(np.abs(one) < SAME**2, 0.0, one))
    return ways


def branches_text(ways: Sequence[dict[str, float]], driver: str) -> str:
    """Branches by the rates of the freedoms in which they differ, in words."""
    differ = [name for name in ways[0] if np.ptp([way[name] for way in ways]) > SAME][:FREEDOMS_LISTED]
    texts = [
        (f"{driver} at rest, " if not way[driver] else "")
        + ", ".join(f"{n} {way[n]:.4g}" for n in differ if n != driver)
        for way in ways
    ]
    return f"{len(ways)} branches meet there, by their rates for a unit rate of {driver}: " + "; ".join(
        f"({i}) {text}" for i, text in enumerate(texts, 1)
    )
