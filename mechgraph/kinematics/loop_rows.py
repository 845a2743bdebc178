"""The rows of the closure equations by loops: entries, the measure of every loop, and the rows of a loop reduced to independent ones.

The six rows of a loop, about its own middle, are taken over its own length, columns of unit size, and turned by a singular value
decomposition so that those that depend on the others (the redundancy of that loop alone) come last:

    U_l^T M_l J_l D = [K_l; 0].

Dense and sparse engine start from these rows, so that they reach the same decision on a single loop.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from mechgraph.graph.linkgraph import LinkGraph
from mechgraph.kinematics.layout import entries_of
from mechgraph.kinematics.state import Configuration
from mechgraph.maths.se3 import Array, Index, Mask, cross
from mechgraph.maths.sparse import LeastNorm
from mechgraph.maths.tolerances import RANKS


def lengths_of(graph: LinkGraph, pair_points: Array, middles: Array) -> Array:
    """Root mean square distance ``(loops,)`` of the pair points ``(3, P)`` of every loop from its middle ``(3, loops)``."""
    loop, pair, _ = graph.loop_steps
    off = pair_points[:, pair] - middles[:, loop]
    length = np.sqrt(np.bincount(loop, (off * off).sum(axis=0), minlength=graph.n_loops) / np.bincount(loop))
    # points that coincide but for rounding make no length
    rounding = 1e-13 * (1.0 + np.sqrt((middles * middles).sum(axis=0)))
    return np.where(length > rounding, length, 1.0)


@dataclass(frozen=True)
class ClosureRows:
    """The closure Jacobian of one position: twists ``S (6, F)`` along the loops, and ``more (n, F)`` rows behind those of the loops.

    Of several positions ``S (T, 6, F)`` and ``points (T, 3, P)``, with ``more`` of the first one.
    """

    graph: LinkGraph
    first_column: Index
    S: Array
    points: Array
    more: scipy.sparse.csr_array | None = None

    @classmethod
    def at(cls, here: Configuration, t: int = 0) -> ClosureRows:
        """The rows at one position of a configuration; rows of couplings stand behind those of the loops."""
        s = here.system
        others = [more for part in s.rows if (more := part.sparse_jacobian(t)) is not None]
        more = scipy.sparse.csr_array(scipy.sparse.vstack(others)) if others else None
        return cls(s.graph, s.first_column, here.S[:, :, t], here.pair_points[:, :, t], more)

    @classmethod
    def of(cls, here: Configuration, at: Index) -> ClosureRows:
        """The rows at several positions."""
        one, S, points = cls.at(here, int(at[0])), here.S[:, :, at], here.pair_points[:, :, at]
        return replace(one, S=S.transpose(2, 0, 1), points=points.transpose(2, 0, 1))

    @cached_property
    def middles(self) -> Array:
        """Middle of the pair points of every loop, ``(3, loops)``, of several positions ``(T, 3, loops)``."""
        averages = self.graph.loop_averages
        flat = self.points.reshape(-1, self.points.shape[-1])
        return np.asarray((averages @ flat.T).T).reshape(*self.points.shape[:-1], averages.shape[0])

    @property
    def further(self) -> int:
        """Number of rows behind those of the loops."""
        return 0 if self.more is None else int(self.more.shape[0])

    @property
    def count(self) -> int:
        """Number of rows."""
        return 6 * self.graph.n_loops + self.further


class ReducedRows:
    """The rows of every loop turned so that its ``kept (loops,)`` independent ones come first; columns ``fixed`` left out.

    ``dropped`` is the largest singular value of the others. Multipliers of the kept rows and of ``rows.more``, one below the other,
    have the length ``height``. ``dense``: whether ``K`` is worked with as a full matrix.
    """

    def __init__(self, rows: ClosureRows, fixed: Index, dense: bool = False) -> None:
        self.rows, self.fixed, self.dense = rows, fixed, dense
        self.entries = entries_of(rows.graph, rows.first_column)
        self.length = lengths_of(rows.graph, rows.points, rows.middles)
        self._free = np.ones(rows.S.shape[1], dtype=bool)
        self._free[fixed] = False
        blocks = self._blocks(rows.S, rows.middles)
        largest = np.zeros(rows.S.shape[1])
        np.maximum.at(largest, self.entries.column, np.abs(blocks).max(axis=0, initial=0.0))
        if rows.more is not None:
            largest = np.maximum(largest, abs(rows.more).max(axis=0).toarray())
        self._scale = np.where(largest > 0, 1.0 / np.where(largest > 0, largest, 1.0), 1.0)
        blocks *= self._scale[self.entries.column]
        self._first = blocks
        self._reduce(blocks)

    @property
    def loops(self) -> int:
        """Number of loops."""
        return len(self.entries.first) - 1

    @property
    def height(self) -> int:
        """Number of kept rows and further rows."""
        return int(self.kept.sum()) + self.rows.further

    @property
    def scale(self) -> Array:
        """Sizes ``(F,)`` by which columns were multiplied."""
        return self._scale

    @property
    def free(self) -> Mask:
        """Which columns ``(F,)`` are not fixed."""
        return self._free

    @cached_property
    def owners(self) -> Index:
        """For every kept or further row the number of its loop (further rows count on from the loops)."""
        mine = np.repeat(np.arange(self.loops), self.kept)
        return np.concatenate([mine, self.loops + np.arange(self.rows.further)]).astype(np.intp)

    def _blocks(self, S: Array, middles: Array) -> Array:
        """Entries ``(..., 6, entries)`` about the ``middles (..., 3, loops)``, over the lengths of the loops; zero in the fixed columns."""
        e = self.entries
        out = S[..., e.column]
        turns, slides = out[..., :3, :], out[..., 3:, :]
        slides += np.moveaxis(cross(np.moveaxis(turns, -2, 0), np.moveaxis(middles[..., e.loop], -2, 0)), 0, -2)
        slides /= self.length[e.loop]
        out *= e.sign * self._free[e.column]
        return out

    @cached_property
    def _by_width(self) -> list[tuple[Index, Index]]:
        """Loops with the same number of entries: their indices ``(n,)`` and entries ``(n, c)``."""
        width = np.diff(self.entries.first)
        out = []
        for c in np.flatnonzero(np.bincount(width)):
            loops = np.flatnonzero(width == c)
            out.append((loops, self.entries.first[loops][:, None] + np.arange(c)))
        return out

    def _reduce(self, blocks: Array) -> None:
        """Turn the rows of every loop so that the dependent ones come last, all loops of one width at once."""
        n = self.loops
        self._turn, self.kept, self.dropped = np.empty((n, 6, 6)), np.zeros(n, dtype=np.intp), 0.0
        for loops, at in self._by_width:
            block = np.moveaxis(blocks[:, at], 0, 1)
            U, s, _ = np.linalg.svd(block, full_matrices=block.shape[2] < 6)
            self._turn[loops] = np.swapaxes(U, 1, 2)
            s = s / np.maximum(s.max(axis=1, initial=0.0), 1.0)[:, None]
            self.kept[loops] = (s > RANKS.loop).sum(axis=1)
            self.dropped = max(self.dropped, float(s[s <= RANKS.loop].max(initial=0.0)))

    @cached_property
    def _live(self) -> Mask:
        """Which of the turned entries ``(6, entries)`` stand in the system: kept rows, free columns."""
        e = self.entries
        return (np.arange(6)[:, None] < self.kept[e.loop][None]) & self._free[e.column][None]

    def _turned_blocks(self, rows: ClosureRows) -> Array:
        """Entries ``(..., 6, entries)`` of rows at any positions in the turned rows of their loops and columns of unit size."""
        blocks = self._first if rows is self.rows else self._unit_blocks(rows)
        turned = np.empty_like(blocks)
        for loops, at in self._by_width:
            turned[..., at] = np.swapaxes(self._turn[loops] @ np.swapaxes(blocks[..., at], -3, -2), -3, -2)
        return turned

    def _unit_blocks(self, rows: ClosureRows) -> Array:
        """Entries ``(..., 6, entries)`` of rows at any positions in columns of unit size."""
        out = self._blocks(rows.S, rows.middles)
        out *= self._scale[self.entries.column]
        return out

    @cached_property
    def matrix(self) -> scipy.sparse.csr_array:
        """``K (height, free columns)``: kept rows of all loops and the further rows, columns of unit size."""
        e = self.entries
        starts = np.concatenate([[0], np.cumsum(self.kept)])
        place = np.cumsum(self._free) - 1
        rows = (starts[e.loop][None] + np.arange(6)[:, None])[self._live]
        cols = np.broadcast_to(place[e.column], (6, len(e.loop)))[self._live]
        shape = (int(starts[-1]), int(self._free.sum()))
        K = scipy.sparse.csr_array((self._turned_blocks(self.rows)[self._live], (rows, cols)), shape=shape)
        if self.rows.more is None:
            return K
        more = self.rows.more[:, self._free] * self._scale[self._free]
        return scipy.sparse.csr_array(scipy.sparse.vstack([K, more]))

    @cached_property
    def dense_matrix(self) -> Array:
        """The same as a full matrix."""
        e, m = self.entries, int(self.kept.sum())
        whole = np.zeros((6 * self.loops, len(self._free)))
        whole[6 * e.loop + np.arange(6)[:, None], e.column] = self._turned_blocks(self.rows)
        K = np.zeros((self.height, int(self._free.sum())))
        K[:m] = whole[(np.arange(6) < self.kept[:, None]).ravel()][:, self._free]
        if self.rows.more is not None:
            K[m:] = (self.rows.more.toarray() * self._scale)[:, self._free]
        return K

    def _turned(self, b: Array) -> Array:
        """Right sides ``(6 loops, k)`` as turned rows ``(loops, 6, k)``."""
        local = b.reshape(self.loops, 6, b.shape[1]).copy()
        local[:, 3:] /= self.length[:, None, None]
        return np.asarray(self._turn @ local)

    def open_part(self, residual: Array) -> float:
        """Largest component of a residual ``(rows,)`` in all rows, those of a loop in its own measure."""
        loops = np.abs(self._turned(residual[: 6 * self.loops, None])).max(initial=0.0)
        return float(max(loops, np.abs(residual[6 * self.loops :]).max(initial=0.0)))

    @property
    def rounding(self) -> float:
        """Rounding of a residual in the measure of the smallest loop, as positions are of size one."""
        return 20 * np.finfo(float).eps / min(1.0, float(self.length.min(initial=1.0)))

    def kept_part(self, b: Array) -> Array:
        """Right sides ``(rows, k)`` in the kept and the further rows, ``(height, k)``."""
        turned = self._turned(b[: 6 * self.loops])[np.arange(6) < self.kept[:, None]]
        return np.concatenate([turned, b[6 * self.loops :]])

    @cached_property
    def least_norm(self) -> LeastNorm:
        """The normal equations of ``K``, factored."""
        return LeastNorm(self.dense_matrix if self.dense else self.matrix)

    def correction(self, residual: Array) -> Array:
        """Smallest ``dq (F,)``, measured in columns of unit size, with ``J dq = -residual (rows,)`` in the kept rows."""
        out = np.zeros(len(self._free))
        dq = self.least_norm.solve(self.kept_part(residual[:, None]))[:, 0]
        out[self._free] = -dq * self._scale[self._free]
        return out

    def _wrenches(self, kept: Array, dropped: Array) -> Array:
        full = np.empty((self.loops, 6, kept.shape[1]))
        mask = np.arange(6) < self.kept[:, None]
        full[mask], full[~mask] = kept, dropped
        return self._unscaled(np.moveaxis(np.swapaxes(self._turn, 1, 2) @ full, 1, 0))

    def _unscaled(self, y: Array) -> Array:
        """Loop wrenches ``(6, loops, k)`` about the middles from multipliers of rows over the lengths."""
        return np.concatenate([y[:3], y[3:] / self.length[:, None]])

    def multipliers(self, kept: Array, dropped: Array | None = None) -> Array:
        """Loop wrenches and multipliers of further rows ``(rows, k)`` from those of kept (and of dropped) rows."""
        m = int(self.kept.sum())
        nothing = np.zeros((6 * self.loops - m, kept.shape[1]))
        wrenches = self._wrenches(kept[:m], nothing if dropped is None else dropped)
        return np.concatenate([np.moveaxis(wrenches, 0, 1).reshape(6 * self.loops, kept.shape[1]), kept[m:]])

    def unit_wrenches(self) -> Array:
        """Loop wrenches ``(6, 6, loops)`` of unit multipliers of the turned rows, one column a row."""
        return self._unscaled(self._turn.transpose(2, 0, 1)).transpose(0, 2, 1)

    def local_stress(self) -> tuple[Index, Array]:
        """Loops with self-stresses of their own, and these as loop wrenches ``(6, 6, n)``, those of rows that were kept left out."""
        some = np.flatnonzero(self.kept < 6)
        unit = self.unit_wrenches()[:, :, some]
        order = (np.arange(6)[:, None] + self.kept[some]) % 6
        return some, np.take_along_axis(unit, order[None], axis=1)
