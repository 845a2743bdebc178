"""Rank, motions and self-stresses of a large mechanism from its bordered closure equations, where their pivots prove the rank.

Speaks like ``structure.elimination.Elimination``, which decides where they do not.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.closure.bordering import LoopSystem
from mechgraph.closure.indexing import Index

SURE = 1e-3
"""Smallest pivot from which on the bordered system decides."""
FAR = 1e-8
"""Distance to a singular matrix (of unit rows) from which on it decides whatever its pivots; below both the elimination looks closer."""
SHARES = 1e-9
"""Part of a random self-stress below which a loop has none."""


class Bordered:
    """The facts of one position; ``sure`` whether the pivots prove them. Attributes as those of ``Elimination``."""

    def __init__(self, loops: LoopSystem, S: Array) -> None:
        self.loops, self._S = loops, S
        self.sure = loops.smallest > SURE or loops.first.distance > FAR
        self.rank, self.smallest, self.largest = loops.rank, loops.smallest, loops.dropped

    def motions(self) -> Array:
        """Orthonormal motions ``(F, M)``."""
        return np.asarray(np.linalg.qr(self.loops.motions(self.loops.first))[0])

    def random_stress(self, rng: np.random.Generator, count: int) -> Array:
        """Random self-stresses ``(6 loops, count)``, of size one in the measure of their loops."""
        return _rows(self.loops.random_stress(self.loops.first, self._S, rng, count))

    @property
    def zero_rows(self) -> Index:
        """Numbers of the self-stresses that connect loops."""
        return np.arange(self.loops.shared, dtype=np.intp)

    def wrenches(self, shared: Array) -> Array:
        """Loop wrenches ``(6 loops, k)`` of the self-stresses that connect loops, for coefficients ``shared (zero rows, k)``."""
        nothing = np.zeros((self._S.shape[1], shared.shape[1]))
        return _rows(self.loops.solve_transposed(self.loops.first, nothing, shared))

    @cached_property
    def local(self) -> list[tuple[int, Array]]:
        """Self-stresses of one loop alone: the loop and wrenches ``(6, s)``."""
        some, wrenches = self.loops.local_stress()
        return [(int(i), wrenches[:, : 6 - int(self.loops.kept[i]), j]) for j, i in enumerate(some)]

    @cached_property
    def sets(self) -> tuple[tuple[int, tuple[int, ...]], ...]:
        """(number of self-stresses, loops) of every set of loops that self-stresses connect."""
        own = 6 - self.loops.kept
        home = np.arange(len(own))
        shared = np.zeros(len(own), dtype=bool)
        if self.loops.shared:
            probe = self.wrenches(np.random.default_rng(SEED).normal(size=(self.loops.shared, 1)))
            size = np.abs(probe).reshape(len(own), 6).max(axis=1)
            shared = size > SHARES * size.max()
            e = self.loops.entries
            touch = scipy.sparse.csr_array((np.ones(len(e.loop)), (e.loop, e.column)))[shared]
            _, part = scipy.sparse.csgraph.connected_components(touch @ touch.T, directed=False)
            home[shared] = np.flatnonzero(shared)[np.unique(part, return_index=True)[1]][part]
        count = np.bincount(home, own, minlength=len(own)) + np.bincount(home[self.loops.shared_in], minlength=len(own))
        order = np.argsort(home, kind="stable")
        groups = np.split(order, np.flatnonzero(np.diff(home[order])) + 1) if len(order) else []
        return tuple((int(count[home[g[0]]]), tuple(g.tolist())) for g in groups if count[home[g[0]]])


SEED = 23


def _rows(x: Array) -> Array:
    return np.moveaxis(x, 0, 1).reshape(6 * x.shape[1], x.shape[2])
