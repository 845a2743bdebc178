"""Free motions of a closed position: mobility, what drivers leave free, and which of that is passive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from mechgraph.algebra.screw import null_space
from mechgraph.algebra.se3 import Array
from mechgraph.motion.idle import Idle
from mechgraph.motion.system import Configuration, Index, System
from mechgraph.numerics.linear import RANK_TOLERANCE, rank_of, singular_values

STILL = 1e-8
"""Part of a unit motion below which a freedom or link counts as standing still."""
IN_PLACE = 1e-5
"""Rate at which a pair element may leave its place in a passive motion (differences of step ``STEP``)."""
STEP = 1e-4


@dataclass(frozen=True)
class PassiveMotion:
    """A passive freedom: unit rates ``(F,)``, the links that move as one, and their twist about the internal origin."""

    rates: Array
    links: tuple[int, ...]
    twist: Array


@dataclass(frozen=True)
class FreeMotion:
    """A motion that is neither driven nor passive: unit rates and the names of the freedoms that move."""

    rates: Array
    names: tuple[str, ...]


@dataclass(frozen=True)
class Freedoms:
    """What can move at a closed position.

    ``sigma`` singular values of the closure Jacobian, ``rank``; ``null (F, M)`` orthonormal motions; ``dependent`` whether
    drivers cannot move independently; ``passive`` and ``undriven`` motions with the drivers at rest; ``hold`` freedoms
    whose rest stops the passive motions.
    """

    sigma: Array
    rank: int
    null: Array
    dependent: bool
    passive: tuple[PassiveMotion, ...]
    undriven: tuple[FreeMotion, ...]
    hold: Index

    @property
    def mobility(self) -> int:
        """Freedoms minus rank."""
        return self.null.shape[1]

    def bodies(self, system: System) -> tuple[Idle, ...]:
        """The bodies that have passive freedoms."""
        out = []
        for links in dict.fromkeys(p.links for p in self.passive):
            border = [k for k, (a, b) in enumerate(system.graph.ends) if (a in links) != (b in links)]
            out.append(Idle(links[0], np.array(border, dtype=np.intp)))
        return tuple(out)

    @property
    def margin(self) -> float:
        """Smallest kept singular value over the largest; 1 where there is no constraint."""
        return float(self.sigma[self.rank - 1] / self.sigma[0]) if self.rank else 1.0

    @property
    def dropped(self) -> float:
        """Largest dropped singular value over the largest; 0 where none is dropped."""
        rest = self.sigma[self.rank :]
        return float(rest[0] / self.sigma[0]) if rest.size and self.sigma[0] > 0 else 0.0


def free_motion(system: System, x: Array, columns: Index) -> Freedoms:
    """Mobility at a closed state ``x (nx,)`` and what drivers in ``columns`` leave free."""
    here = system.at(x[:, None])
    J = here.J[:, :, 0]
    sigma = singular_values(J)
    rank = rank_of(sigma)
    null = motions_of(J)
    dependent = bool(len(columns)) and rank_of(singular_values(null[columns]), 1e-8) < len(columns)
    free = np.setdiff1d(np.arange(system.n_freedoms), columns)
    left = np.zeros((system.n_freedoms, 0))
    if null.shape[1]:
        inner = motions_of(J[:, free])
        left = np.zeros((system.n_freedoms, inner.shape[1]))
        left[free] = inner
    passive = _passive(here, left)
    if not len(columns) and passive and len(passive) == null.shape[1]:
        # nothing else can move: what could be driven is an input, not an idle freedom
        drivable = np.array([d for p in system.m.pairs for d in p.type.drivable])
        passive = [p for p in passive if not (np.abs(p.rates[drivable]) > STILL).any()]
    undriven = _complement(system, left, passive)
    hold = np.zeros(0, dtype=np.intp)
    if passive:
        _, pivots = scipy.linalg.qr(np.stack([p.rates for p in passive]), mode="r", pivoting=True)
        hold = np.sort(pivots[: len(passive)]).astype(np.intp)
    return Freedoms(sigma, rank, null, dependent, tuple(passive), tuple(undriven), hold)


def motions_of(J: Array) -> Array:
    """Orthonormal motions ``(F, M)`` with ``J q' = 0``."""
    return null_space(J, RANK_TOLERANCE) if J.shape[0] else np.eye(J.shape[1])


def _complement(system: System, left: Array, passive: list[PassiveMotion]) -> list[FreeMotion]:
    """Motions of ``left`` that are not passive, as sparse as elimination makes them."""
    if left.shape[1] == len(passive):
        return []
    rest = left
    if passive:
        P, _ = np.linalg.qr(np.stack([p.rates for p in passive], axis=1))
        rest = left - P @ (P.T @ left)
        U, s, _ = np.linalg.svd(rest, full_matrices=False)
        rest = U[:, : left.shape[1] - len(passive)]
    names = system.m.freedom_names()
    out = []
    for rates in reduced(rest).T:
        moving = tuple(names[i] for i in np.flatnonzero(np.abs(rates) > STILL))
        out.append(FreeMotion(rates, moving))
    return out


def reduced(columns: Array) -> Array:
    """The column space with unit pivots, by elimination with full pivoting: a sparse, canonical basis."""
    A = columns.copy()
    taken: list[int] = []
    for j in range(A.shape[1]):
        rest = np.abs(A[:, j:])
        rest[taken] = 0.0
        i, k = divmod(int(np.argmax(rest > (1 - 1e-9) * rest.max())), rest.shape[1])
        k += j
        A[:, [j, k]] = A[:, [k, j]]
        A[:, j] /= A[i, j]
        for other in range(A.shape[1]):
            if other != j:
                A[:, other] -= A[i, other] * A[:, j]
        taken.append(int(i))
    A[np.abs(A) < 1e-11] = 0.0
    order = np.argsort(taken)
    return np.asarray(A[:, order])


def clusters(system: System, V: Array) -> list[list[int]]:
    """Links that move as one in all motions ``V (6, N, p)``, joined through pairs that stand still."""
    size = max(float(np.abs(V).max(initial=0.0)), 1e-300)
    parent = list(range(V.shape[1]))

    def root(i: int) -> int:
        while parent[i] != i:
            i = parent[i]
        return i

    for a, b in system.graph.ends:
        if np.abs(V[:, a] - V[:, b]).max(initial=0.0) < STILL * size:
            parent[root(a)] = root(b)
    out: dict[int, list[int]] = {}
    for i in range(V.shape[1]):
        out.setdefault(root(i), []).append(i)
    return list(out.values())


def _passive(here: Configuration, left: Array) -> list[PassiveMotion]:
    """Passive motions among ``left (F, p)``: one cluster of links moves, its pair elements stay in place."""
    if not left.shape[1]:
        return []
    system = here.system
    V = here.link_twists(left)
    out = []
    for cluster in clusters(system, V):
        if system.graph.frame in cluster:
            continue
        border = [k for k, (a, b) in enumerate(system.graph.ends) if (a in cluster) != (b in cluster)]
        others = [i for i in range(V.shape[1]) if i not in cluster]
        alone = _small_combinations(V[:, others].reshape(-1, left.shape[1]) / np.abs(V).max(), STILL)
        if len(border) < 2 or not alone.shape[1]:
            continue
        moves = left @ alone
        leaving = np.stack([_leaving(here, border, dq) for dq in moves.T], axis=1)
        still = _small_combinations(leaving, IN_PLACE)
        for rates in (moves @ still).T:
            rates = rates / np.abs(rates).max()
            rates = rates * np.sign(rates[np.argmax(np.abs(rates) > 1 - 1e-9)])
            twist = here.link_twists(rates[:, None])[:, cluster[0], 0]
            out.append(PassiveMotion(rates, tuple(cluster), twist))
    return out


def _small_combinations(rows: Array, tolerance: float) -> Array:
    """Orthonormal combinations of columns for which all rows vanish, against an absolute tolerance."""
    _, s, Vt = np.linalg.svd(rows, full_matrices=True)
    small = np.concatenate([s, np.zeros(Vt.shape[0] - len(s))]) < tolerance
    return np.asarray(Vt[small].T)


def _leaving(here: Configuration, border: list[int], dq: Array) -> Array:
    """Rate at which the constraint wrenches of the border pairs leave their span when the links move by ``dq``."""
    system = here.system
    steps = np.stack([dq * STEP, -dq * STEP, 0 * dq], axis=1)
    moved = system.at(system.advance(np.repeat(here.x, 3, axis=1), steps))
    out = []
    for g, W in zip(system.groups, moved.W, strict=True):
        for i, k in enumerate(g.pairs):
            if int(k) in border and W.shape[1]:
                Q, _ = np.linalg.qr(W[:, :, i, 2])
                change = (W[:, :, i, 0] - W[:, :, i, 1]) / (2 * STEP)
                out.append((change - Q @ (Q.T @ change)).ravel())
    return np.concatenate(out) if out else np.zeros(1)
