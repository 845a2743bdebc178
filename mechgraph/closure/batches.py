"""What is evaluated together, as arrays: pairs of one type, factors of one kind, screws of components."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.tree import Walk
from mechgraph.numerics.linear import Place, compact
from mechgraph.pairs import kinematics as evaluation
from mechgraph.pairs.factors import Factor, FixedStack, Stack
from mechgraph.pairs.pair_type import PairType

Index = NDArray[np.intp]


@dataclass(frozen=True)
class Group:
    """The pairs of one type: their indices, the columns of their freedoms ``(f, n)`` and rows of their state ``(nx, n)``."""

    row: PairType
    pairs: Index
    columns: Index
    state_rows: Index


@dataclass(frozen=True)
class FactorBatch:
    """All factors of one kind: their steps in the walk, columns of their freedoms ``(f, n)`` and rows of their state ``(nx, n)``.

    ``member (n,)`` says which of ``factors`` each one is; without ``factors`` it is a pair that has none.
    """

    factors: tuple[Factor, ...]
    member: Index
    pairs: Index
    ranks: Index
    steps: Index
    columns: Index
    state_rows: Index

    @cached_property
    def stack(self) -> Stack:
        """The factors for evaluation together."""
        if not self.factors:
            return FixedStack(len(self.member))
        starts = np.flatnonzero(np.concatenate([[True], self.member[1:] != self.member[:-1]]))
        counts = np.diff(np.append(starts, len(self.member))).tolist()
        runs = [self.factors[i] for i in self.member[starts].tolist()]
        return runs[0].stack(runs, counts)

    def part(self, at: slice) -> FactorBatch:
        """Some of the factors."""
        arrays = (self.member, self.pairs, self.ranks, self.steps, self.columns, self.state_rows)
        return FactorBatch(self.factors, *(array[..., at] for array in arrays))

    @cached_property
    def at_steps(self) -> Place:
        """The steps, as a slice where that can be."""
        return compact(self.steps)


@dataclass(frozen=True)
class ScrewTable:
    """Constant screws, each in a frame of a pair: parts ``(3, K)``, the node of the frame and the constant pose behind it.

    The line of a screw goes through the origin of its frame, or that of marker B of its pair where ``at_b``.
    """

    bound: Array
    free: Array
    per_pitch: Array
    pairs: Index
    nodes: Index
    const: Index
    at_b: NDArray[np.bool_]

    @cached_property
    def b_places(self) -> Index:
        """The screws through the origin of marker B."""
        return np.flatnonzero(self.at_b)

    def taken(self, order: Place) -> ScrewTable:
        """Some of the screws, in that order."""
        return ScrewTable(*(getattr(self, part.name)[..., order] for part in fields(self)))


def factor_batches(groups: Sequence[Group], walk: Walk, n_factors: Index) -> list[FactorBatch]:
    """The factors of all pairs by kind, each kind in the order of the walk; pairs without a factor are a kind of their own."""
    kinds: dict[Hashable, list[tuple[Factor, Group, int]]] = {}
    for g in groups:
        for rank, factor in enumerate(g.row.steps):
            kinds.setdefault(factor.kind, []).append((factor, g, rank))
    batches = [_batch(members, walk) for members in kinds.values()]
    fixed = np.flatnonzero(n_factors == 0)
    if fixed.size:
        nothing = np.zeros((0, len(fixed)), dtype=np.intp)
        steps = walk.step_of[walk.first[fixed]]
        zeros = np.zeros(len(fixed), dtype=np.intp)
        batches.append(FactorBatch((), zeros, fixed, zeros, steps, nothing, nothing))
    return batches


def _batch(members: Sequence[tuple[Factor, Group, int]], walk: Walk) -> FactorBatch:
    parts = []
    for number, (_, g, rank) in enumerate(members):
        at_columns, at_rows = evaluation.places(g.row)[rank]
        same = [np.full(len(g.pairs), value, dtype=np.intp) for value in (rank, number)]
        parts.append(
            [g.columns[at_columns], g.state_rows[at_rows], g.pairs, walk.step_of[walk.first[g.pairs] + rank], *same]
        )
    joined: list[Index] = [np.concatenate(part, axis=-1) for part in zip(*parts, strict=True)]
    order = np.argsort(joined[3], kind="stable")
    columns, rows, pairs, steps, ranks, member = (part[..., order] for part in joined)
    return FactorBatch(tuple(factor for factor, _, _ in members), member, pairs, ranks, steps, columns, rows)
