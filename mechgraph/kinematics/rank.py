"""Rank, motions and self-stresses of the closure equations at one position: one protocol, a dense and a sparse engine behind it.

Both start from the reduced rows ``K`` of all loops (``kinematics.loop_rows``), so that a self-stress of a single loop is the same in both:

    rank J = rank K,   J q = 0  <=>  K (q / scale) = 0,   J^T x = 0  <=>  x = local self-stresses + those with K^T y = 0.

Dense: singular values of K. Sparse: the bordered system (``kinematics.sparse_system``) where its pivots prove the rank, otherwise the
elimination along the loops (``kinematics.sparse_system``).
"""

from __future__ import annotations

from functools import cached_property
from typing import Literal, Protocol

import numpy as np
import scipy

from mechgraph.graph.linkgraph import labels_of_bipartite, members
from mechgraph.kinematics.loop_rows import ClosureRows, ReducedRows
from mechgraph.kinematics.sparse_system import Elimination, LoopSystem
from mechgraph.kinematics.state import Configuration
from mechgraph.maths.linear import rank_of
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.sparse import SparseFactors, singular_ratio
from mechgraph.maths.tolerances import RANKS

EngineName = Literal["auto", "dense", "sparse"]


class RankSolution(Protocol):
    """What an engine determines about ``K``: self-stresses and motions in the kept rows and scaled free columns."""

    name: Literal["dense", "sparse"]
    rank: int
    dropped: float

    def margin(self) -> float:
        """Smallest singular value kept, as part of the largest, where there is one."""

    def stresses(self, shares: Array) -> Array:
        """``y (height, k)`` with ``K^T y = 0`` for shares ``(height - rank, k)`` of the self-stresses."""

    def motions(self) -> Array:
        """A basis of the ``q / scale`` with ``K (q / scale) = 0``, ``(free columns, nullity)``."""


class _Dense:
    name: Literal["dense", "sparse"] = "dense"

    def __init__(self, reduced: ReducedRows, tolerance: float) -> None:
        K = reduced.dense_matrix
        self._U, self._s, self._Vt = np.eye(K.shape[0]), np.zeros(0), np.eye(K.shape[1])
        if K.size:
            self._U, self._s, self._Vt = np.linalg.svd(K)
        self.rank = rank_of(self._s, tolerance)
        rest = self._s[self.rank :]
        self.dropped = float(rest[0] / self._s[0]) if rest.size and self._s[0] > 0 else 0.0

    def margin(self) -> float:
        return float(self._s[self.rank - 1] / self._s[0])

    def stresses(self, shares: Array) -> Array:
        return np.asarray(self._U[:, self.rank :] @ shares)

    def motions(self) -> Array:
        return np.asarray(self._Vt[self.rank :].T)


class _Bordered:
    name: Literal["dense", "sparse"] = "sparse"

    def __init__(self, loops: LoopSystem) -> None:
        self.loops, self.rank, self.dropped = loops, loops.rank, 0.0

    def margin(self) -> float:
        return singular_ratio(self.loops.matrix, self.rank, lambda: self.loops.least_norm)

    def stresses(self, shares: Array) -> Array:
        return self.loops.connecting_stress(self.loops.first, shares)

    def motions(self) -> Array:
        q = self.loops.motions(SparseFactors([self.loops.first]), 1)[:, :, 0]
        return np.asarray((q / self.loops.scale[:, None])[self.loops.free])


class _Eliminated:
    name: Literal["dense", "sparse"] = "sparse"

    def __init__(self, reduced: ReducedRows, tolerance: float) -> None:
        self._reduced = reduced
        self._found = Elimination(reduced.matrix, reduced.owners, tolerance)
        self.rank, self.dropped = self._found.rank, self._found.dropped

    def margin(self) -> float:
        return singular_ratio(self._reduced.matrix, self.rank, lambda: self._reduced.least_norm)

    def stresses(self, shares: Array) -> Array:
        return self._found.stresses(shares)

    def motions(self) -> Array:
        return self._found.motions()


class ClosureRank:
    """Rank, motions and self-stresses of the closure equations at one position, the columns ``fixed`` left out.

    ``rank``; ``count`` number of rows; ``dropped`` largest value that counted as zero, as part of the largest; ``shared`` number of
    self-stresses that connect loops; ``engine`` which one ran.
    """

    def __init__(self, reduced: ReducedRows, solution: RankSolution, tolerance: float) -> None:
        self.reduced, self._solution, self._tolerance = reduced, solution, tolerance
        self.engine, self.rank, self.count = solution.name, solution.rank, reduced.rows.count
        self.shared = reduced.height - solution.rank
        self.dropped = max(solution.dropped, reduced.dropped)

    @cached_property
    def margin(self) -> float:
        """Smallest singular value of K that was kept, as part of the largest; 1 where there is none."""
        return self._solution.margin() if self.rank else 1.0

    @cached_property
    def motions(self) -> Array:
        """Orthonormal motions ``(F, M)`` with the fixed columns at rest."""
        r = self.reduced
        y = self._solution.motions()
        out = np.zeros((len(r.free), y.shape[1]))
        out[r.free] = np.linalg.qr(y * r.scale[r.free][:, None])[0]
        return out

    # --- self-stresses -----------------------------------------------------------------------------------------------------

    @cached_property
    def local(self) -> tuple[Index, Array, Index]:
        """Loops with self-stresses of their own ``(n,)``, their wrenches ``(6, 6, n)`` of which the first few count, and how many."""
        some, wrenches = self.reduced.local_stress()
        return some, wrenches, 6 - self.reduced.kept[some]

    def connecting(self, shares: Array) -> Array:
        """Self-stresses ``(rows, k)`` that connect loops, for shares ``(shared, k)``; none has a part in the local ones."""
        return self.reduced.multipliers(self._solution.stresses(shares))

    def random_stress(self, rng: np.random.Generator, count: int) -> Array:
        """Random self-stresses ``(rows, count)``, each with a part of every one; of size one in the measure of their loops."""
        r = self.reduced
        kept = self._solution.stresses(rng.normal(size=(self.shared, count)))
        dropped = rng.normal(size=(6 * r.loops - int(r.kept.sum()), count))
        size = np.maximum(np.abs(kept).max(axis=0, initial=0.0), 1.0)
        return r.multipliers(kept / size, dropped / size)

    def orthonormal_stress(self) -> Array:
        """All self-stresses ``(rows, count - rank)``, orthonormal in the measure of the loops."""
        r = self.reduced
        kept = np.linalg.qr(self._solution.stresses(np.eye(self.shared)))[0]
        own = 6 * r.loops - int(r.kept.sum())
        dropped = np.concatenate([np.zeros((own, self.shared)), np.eye(own)], axis=1)
        return r.multipliers(np.concatenate([kept, np.zeros((len(kept), own))], axis=1), dropped)

    @cached_property
    def sets(self) -> tuple[tuple[int, tuple[int, ...]], ...]:
        """(number of self-stresses, loops) of every set of loops that self-stresses can connect."""
        own = 6 - self.reduced.kept
        connected = self._connected_blocks() if self.shared else []
        taken = np.zeros(len(own), dtype=bool)
        out = []
        for blocks in connected:
            loops = [i for i in blocks if i < len(own)]
            taken[loops] = True
            count = self.shared if len(connected) == 1 else self._shared_in(blocks)
            out.append((count + int(own[loops].sum()), tuple(loops)))
        out += [(int(own[i]), (int(i),)) for i in np.flatnonzero(~taken & (own > 0))]
        return tuple(sorted(out, key=lambda item: item[1]))

    def _connected_blocks(self) -> list[list[int]]:
        """Loops (and further rows) with parts of self-stresses that connect loops: those that share freedoms belong together."""
        r = self.reduced
        probe = np.abs(self._solution.stresses(np.random.default_rng(23).normal(size=(self.shared, 1))))[:, 0]
        size = np.zeros(r.loops + r.rows.further)
        np.maximum.at(size, r.owners, probe)
        # part of a random self-stress below which a row has none
        some = np.flatnonzero(size > 1e-9 * size.max())
        K = r.matrix.tocoo()
        touch = scipy.sparse.csr_array((np.ones(K.nnz), (r.owners[K.row], K.col)), shape=(len(size), K.shape[1]))
        return [some[part].tolist() for part in members(labels_of_bipartite(touch[some]))]

    def _shared_in(self, blocks: list[int]) -> int:
        """Number of self-stresses that connect only these blocks: their rows minus the rank of these."""
        rows = np.flatnonzero(np.isin(self.reduced.owners, blocks))
        found = Elimination(self.reduced.matrix[rows], self.reduced.owners[rows], self._tolerance)
        return len(rows) - found.rank


def closure_rank(here: Configuration, fixed: Index | None = None, engine: EngineName = "auto") -> ClosureRank:
    """Rank, motions and self-stresses at the first position of a configuration, with the columns ``fixed`` at rest."""
    return rank_of_rows(ClosureRows.at(here), fixed, engine)


def rank_of_rows(
    rows: ClosureRows,
    fixed: Index | None = None,
    engine: EngineName = "auto",
    tolerance: float | None = None,
    proved: float | None = None,
) -> ClosureRank:
    """The same for rows given as such; pivots of a bordered system above ``proved`` decide by themselves."""
    fixed = np.zeros(0, dtype=np.intp) if fixed is None else fixed
    tolerance = RANKS.position if tolerance is None else tolerance
    proved = RANKS.proved if proved is None else proved
    # rows from which ``auto`` takes the sparse engine: measured on verdicts of ladders and grids, where the two meet at 100 to 240 rows
    if engine == "dense" or not rows.graph.n_loops or (engine == "auto" and rows.count < 144):
        reduced = ReducedRows(rows, fixed, dense=True)
        return ClosureRank(reduced, _Dense(reduced, tolerance), tolerance)
    bordered = LoopSystem(rows, fixed)
    if bordered.smallest > proved or bordered.first.distance > max(RANKS.distance, tolerance):
        return ClosureRank(bordered, _Bordered(bordered), tolerance)
    reduced = ReducedRows(rows, fixed)
    return ClosureRank(reduced, _Eliminated(reduced, tolerance), tolerance)
