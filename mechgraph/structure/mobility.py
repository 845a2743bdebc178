"""Free motions of a closed position: mobility, what drivers leave free, and which of that is passive."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.passive_motion import PassiveMotion
from mechgraph.closure.rank import ClosureRank, EngineName, rank_of_rows
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.linear import independent_rows, rank_of, singular_values
from mechgraph.numerics.tolerances import MOTIONS, PATH, RANKS
from mechgraph.structure.finite_motion import MOVED, states_nearby
from mechgraph.structure.passive import lasting, passive_motions, small_combinations
from mechgraph.structure.position import Position


@dataclass(frozen=True)
class FreeMotion:
    """A motion that is neither driven nor passive: unit rates and the names of the freedoms that move."""

    rates: Array
    names: tuple[str, ...]


@dataclass(frozen=True)
class Freedoms:
    """What can move at a closed position.

    ``closure`` the rank of the closure equations with its margin, ``driven_closure`` the same with the drivers at rest;
    ``null (F, M)`` orthonormal motions;
    ``dependent`` whether drivers cannot move independently, ``drive`` how strongly the weakest of them moves (against the freedom that
    moves most; small near a dead point); ``left (F, n)`` orthonormal motions with the drivers at rest, ``passive`` motions among them;
    ``hold`` freedoms whose rest stops the passive motions. ``passing`` motions are passive in this position only: they are free.
    """

    closure: ClosureRank
    driven_closure: ClosureRank
    null: Array
    dependent: bool
    passive: tuple[PassiveMotion, ...]
    position: Position
    left: Array
    hold: Index
    drive: float = 1.0
    passing: tuple[PassiveMotion, ...] = ()

    @cached_property
    def undriven(self) -> tuple[FreeMotion, ...]:
        """Motions with the drivers at rest that are not passive."""
        return tuple(_complement(self.position.m, self.left, self.passive))

    @cached_property
    def inputs(self) -> Array:
        """Motions ``(F, M)`` without their passive part."""
        return _beside(self.null, self.passive)

    def still(self, columns: Index) -> NDArray[np.bool_]:
        """Which of the drivers ``columns`` stand still in all motions, as at a dead point."""
        return np.asarray(np.linalg.norm(self.null[columns], axis=1) < PATH.independent)

    def leading(self, columns: Index) -> Index:
        """Places of the drivers that lead among ``columns``: as many as can move independently, taken in their order."""
        if not self.dependent:
            return np.arange(len(columns))
        rank = rank_of(singular_values(self.null[columns]), PATH.independent)
        order = columns.tolist()
        chosen = independent_rows(self.null, order, rank)
        return np.array([order.index(c) for c in sorted(chosen, key=order.index)], dtype=np.intp)

    @property
    def redundancy(self) -> int:
        """Closure equations minus rank."""
        return self.closure.count - self.closure.rank

    @property
    def mobility(self) -> int:
        """Freedoms minus rank."""
        return self.null.shape[1]


def _left_free(closure: ClosureRank, at_rest: ClosureRank, columns: Index) -> Array:
    """Orthonormal motions with the freedoms ``columns`` at rest."""
    null = closure.motions
    if not len(columns) or not null.shape[1]:
        return null
    if closure.engine == "dense":
        return at_rest.motions
    # the motions are of size one: a driver whose part in all of them is below the threshold stands still
    return np.asarray(null @ small_combinations(null[columns], MOTIONS.dependent))


def _drive(null: Array, columns: Index) -> float:
    """Smallest singular value of the drivers' part in the motions, over the part of the freedom that moves most."""
    if not len(columns):
        return 1.0
    if len(columns) > null.shape[1]:
        return 0.0
    most = float(np.sqrt((null**2).sum(axis=1).max()))
    return float(singular_values(null[columns])[-1]) / most


def free_motion(system: System, x: Array, columns: Index, engine: EngineName = "auto") -> Freedoms:
    """Mobility at a closed state ``x (nx,)`` and what drivers in ``columns`` leave free."""
    return freedoms_at(Position.at(Configuration(system, x[:, None])), columns, engine)


def freedoms_at(position: Position, columns: Index, engine: EngineName = "auto") -> Freedoms:
    """The same at a position, which may have changed pairs."""
    closure = rank_of_rows(position.rows, None, engine)
    null = closure.motions
    drive = _drive(null, columns)
    at_rest = rank_of_rows(position.rows, columns, engine) if len(columns) else closure
    left = _left_free(closure, at_rest, columns)
    here = passive_motions(position, left, columns)
    passive = _lasting(here, position, closure, columns) if here else here
    passing = tuple(p for p in here if all(p is not other for other in passive))
    if not len(columns) and passive and len(passive) == null.shape[1]:
        # nothing else can move: what could be driven is an input, whatever pairs that hold nothing could drive
        inputs = position.drivable & np.repeat(position.holding, np.diff(position.rows.first_column))
        passive = [p for p in passive if not (np.abs(p.rates[inputs]) > MOTIONS.still).any()]
    hold = np.zeros(0, dtype=np.intp)
    if passive:
        _, pivots = scipy.linalg.qr(np.stack([p.rates for p in passive]), mode="r", pivoting=True)
        hold = np.sort(pivots[: len(passive)]).astype(np.intp)
    return Freedoms(
        closure, at_rest, null, drive < MOTIONS.dependent, tuple(passive), position, left, hold, drive, passing
    )


def _beside(motions: Array, passive: Sequence[PassiveMotion]) -> Array:
    """Motions without their passive part."""
    if not passive:
        return motions
    P, _ = np.linalg.qr(np.stack([p.rates for p in passive], axis=1))
    return np.asarray(motions - P @ (P.T @ motions))


def _lasting(
    here: list[PassiveMotion], position: Position, closure: ClosureRank, columns: Index
) -> list[PassiveMotion]:
    """Those of the passive motions that are passive at a position nearby as well, where the mechanism can move as declared.

    A position with the others moved, as on the way of a driver; else any other one.
    """
    if position.altered:
        return here
    reached, most = None, 0.0
    for x, change in states_nearby(position.declared.system, position.declared.x[:, 0], closure):
        moved = float(np.abs(_beside(change[:, None], here)).max() / np.abs(change).max())
        if reached is None or moved > most:
            reached, most = x, moved
        if moved > MOVED or closure.motions.shape[1] == len(here):
            break
    if reached is None:
        return here
    there = Position.at(Configuration(position.declared.system, reached[:, None]))
    left = rank_of_rows(there.rows, columns, closure.engine, RANKS.nearby).motions
    return lasting(here, passive_motions(there, left, columns, RANKS.nearby), position, columns)


def _complement(m: Mechanism, left: Array, passive: Sequence[PassiveMotion]) -> list[FreeMotion]:
    """Motions of ``left`` that are not passive: in each one freedom moves while those of the other motions rest.

    These freedoms are the first independent ones in the order in which drivers are wanted, so a motion is what one more driver does.
    """
    if left.shape[1] == len(passive):
        return []
    rest = left
    if passive:
        rest = _beside(left, passive)
        U, s, _ = np.linalg.svd(rest, full_matrices=False)
        rest = U[:, : left.shape[1] - len(passive)]
    Q, _ = np.linalg.qr(rest)
    order = drive_order(m, passive)
    wanted = set(order)
    order += [c for c in range(len(Q)) if c not in wanted]
    chosen = independent_rows(Q, order, Q.shape[1])
    basis = np.linalg.solve(Q[chosen].T, Q.T)
    basis /= np.abs(basis).max(axis=1, keepdims=True)
    names = m.freedom_names()
    out = []
    for rates in np.where(np.abs(basis) < MOTIONS.rounding, 0.0, basis):
        moving = tuple(names[i] for i in np.flatnonzero(np.abs(rates) > MOTIONS.still))
        out.append(FreeMotion(rates, moving))
    return out


def single_freedoms(m: Mechanism) -> list[tuple[int, str]]:
    """Freedoms that take a drive, as (column, name)."""
    single = [d for p in m.pairs for d in p.type.drivable]
    return [(i, n) for i, (n, s) in enumerate(zip(m.freedom_names(), single, strict=True)) if s]


def drive_order(m: Mechanism, passive: Sequence[PassiveMotion]) -> list[int]:
    """Freedoms that take a drive in the order in which they are wanted: free of passive motions first, then at the frame."""
    in_passive = np.zeros(sum(p.type.f for p in m.pairs), dtype=bool)
    for p in passive:
        in_passive |= np.abs(p.rates) > MOTIONS.still
    at_frame = {n: m.frame in (p.a, p.b) for p in m.pairs for n in p.freedom_names}
    singles = single_freedoms(m)
    return [i for i, name in sorted(singles, key=lambda item: (in_passive[item[0]], not at_frame[item[1]], item[0]))]
