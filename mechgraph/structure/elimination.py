"""Rank, null space and self-stresses of large closure Jacobians: orthogonal elimination along the loops.

A front of rows goes over the loops. The rows of a loop enter, reduced by a singular value decomposition of their own (what it drops are
self-stresses of that loop alone); columns that no later loop has are eliminated by Householder reflections with a rank decision; what
remains of the front has only columns shared with loops to come. Work grows as loops times the square of the front, so chains cost
loops, lattices loops to the second power. Every step is orthogonal: self-stresses and motions come back through the same reflections.
Source: George and Heath, Solution of sparse linear least squares problems using Givens rotations, Linear Algebra and its Applications 34,
1980; Heath, Some extensions of an algorithm for sparse linear least squares problems, SIAM J. Sci. Stat. Comput. 3, 1982 (rank decision).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array, cross
from mechgraph.closure.indexing import Index

Mask = NDArray[np.bool_]

SPARE = 2.0
"""Rows a column that the front may have before it is condensed."""


@dataclass(frozen=True)
class LoopRows:
    """A closure Jacobian by loops: ``blocks[i] (6, n_i)`` stand in the columns ``columns[i]`` of the six rows of loop ``i``."""

    columns: tuple[Index, ...]
    blocks: tuple[Array, ...]
    width: int

    def without(self, dropped: Index) -> LoopRows:
        """The same with some columns left out (they keep their numbers)."""
        gone = np.zeros(self.width, dtype=bool)
        gone[dropped] = True
        keep = [~gone[c] for c in self.columns]
        return LoopRows(
            tuple(c[k] for c, k in zip(self.columns, keep, strict=True)),
            tuple(b[:, k] for b, k in zip(self.blocks, keep, strict=True)),
            self.width,
        )


def loop_rows(S: Array, loop_columns: Sequence[tuple[Index, Array]]) -> LoopRows:
    """Rows of all loops from twists ``S (6, F)`` and the (columns, signs) of every loop."""
    columns = tuple(np.asarray(c, dtype=np.intp) for c, _ in loop_columns)
    return LoopRows(columns, tuple(signs * S[:, c] for c, signs in loop_columns), S.shape[1])


@dataclass(frozen=True)
class _Reflections:
    """``I - V T V^T`` on ``rows`` (slots), followed by ``U^T`` on the first of them."""

    rows: Index
    V: Array
    T: Array
    U: Array

    def back(self, y: Array) -> None:
        """Apply the orthogonal factor (not its transpose) to ``y (slots, k)`` in place."""
        part = y[self.rows]
        k = self.U.shape[0]
        part[:k] = self.U @ part[:k]
        y[self.rows] = part - self.V @ (self.T @ (self.V.T @ part))


@dataclass(frozen=True)
class _Solved:
    """Columns ``at`` in terms of ``others``: ``q[at] = A q[others] + Z z``, ``z`` free."""

    at: Index
    others: Index
    A: Array
    Z: Array


class Elimination:
    """What an elimination along the loops found; ``tolerance`` is the part of a unit row below which a pivot counts as zero.

    Rows are taken about a point of their own loop with its own unit of length, so that pivots compare wherever a loop lies.
    ``rank``, ``smallest`` pivot kept, ``largest`` pivot dropped, ``local`` (loop, coefficients ``(6, s)``) self-stresses of one
    loop alone; ``sets`` the loops that a self-stress can connect, with their numbers of self-stresses.
    """

    def __init__(self, rows: LoopRows, points: Sequence[Array], tolerance: float) -> None:
        self.rows, self.tolerance = rows, tolerance
        self.rank, self.smallest, self.largest = 0, 1.0, 0.0
        self.local: list[tuple[int, Array]] = []
        self._start: list[tuple[int, Array, Index]] = []
        self._steps: list[_Reflections] = []
        self._solved: list[_Solved] = []
        self._zero: list[Index] = []
        self._home = list(range(len(rows.blocks)))
        self._owner: list[int] = []
        self._sweep(points)

    # --- the sweep ---------------------------------------------------------------------------------------------------------

    def _sweep(self, points: Sequence[Array]) -> None:
        order = loop_order(self.rows.columns)
        last = np.full(self.rows.width, -1)
        for step, i in enumerate(order):
            last[self.rows.columns[i]] = step
        front = np.zeros((0, 0))
        slots = np.zeros(0, dtype=np.intp)
        active = np.zeros(0, dtype=np.intp)
        for step, i in enumerate(order):
            front, slots, active = self._enter(front, slots, active, i, points[i])
            front, slots, active = self._eliminate(front, slots, active, last[active] == step)
            front, slots = self._condense(front, slots)
        free = np.flatnonzero(last < 0)
        if free.size:
            self._solved.append(_Solved(free, np.zeros(0, dtype=np.intp), np.zeros((free.size, 0)), np.eye(free.size)))
        self._zero.append(slots)

    def _enter(self, front: Array, slots: Index, active: Index, i: int, points: Array) -> tuple[Array, Index, Index]:
        """Put the independent rows of loop ``i`` under the front."""
        move = local_measure(points)
        block = move @ self.rows.blocks[i]
        U, s, _ = np.linalg.svd(block, full_matrices=True) if block.shape[1] else (np.eye(6), np.zeros(0), None)
        kept = int((s > self.tolerance * max(s.max(initial=0.0), 1.0)).sum())
        self._note(s / max(s.max(initial=0.0), 1e-300), kept)
        if kept < 6:
            self.local.append((i, move.T @ U[:, kept:]))
        fresh = np.setdiff1d(self.rows.columns[i], active, assume_unique=True)
        columns = np.concatenate([active, fresh])
        place = {int(c): j for j, c in enumerate(columns)}
        below = np.zeros((kept, len(columns)))
        below[:, [place[int(c)] for c in self.rows.columns[i]]] = U[:, :kept].T @ block
        new = np.arange(len(self._owner), len(self._owner) + kept)
        self._owner += [i] * kept
        self._start.append((i, move.T @ U[:, :kept], new))
        out = np.zeros((front.shape[0] + kept, len(columns)))
        out[: front.shape[0], : front.shape[1]] = front
        out[front.shape[0] :] = below
        return out, np.concatenate([slots, new]), columns

    def _eliminate(self, front: Array, slots: Index, active: Index, done: Mask) -> tuple[Array, Index, Index]:
        """Solve the columns ``done`` (a mask over ``active``) from the front."""
        if not done.any():
            return front, slots, active
        at, others = active[done], active[~done]
        mine, rest = front[:, done], front[:, ~done]
        V, T, R = householder(mine)
        U, s, Vt = np.linalg.svd(R)
        kept = int((s > self.tolerance).sum())
        self._note(s, kept)
        rest = rest - V @ (T.T @ (V.T @ rest))
        k = R.shape[0]
        rest[:k] = U.T @ rest[:k]
        self._join(slots)
        self._steps.append(_Reflections(slots, V, T, U))
        A = -(Vt[:kept].T / s[:kept]) @ rest[:kept]
        self._solved.append(_Solved(at, others, A, Vt[kept:].T))
        self.rank += kept
        return rest[kept:], slots[kept:], others

    def _condense(self, front: Array, slots: Index) -> tuple[Array, Index]:
        """Where the front has more rows than columns, reflect it to triangular form; rows left over are self-stresses."""
        if front.shape[0] <= SPARE * front.shape[1] + 6:
            return front, slots
        V, T, R = householder(front)
        self._steps.append(_Reflections(slots, V, T, np.eye(R.shape[0])))
        self._zero.append(slots[R.shape[0] :])
        return R, slots[: R.shape[0]]

    def _note(self, s: Array, kept: int) -> None:
        self.smallest = min(self.smallest, float(s[:kept].min(initial=1.0)))
        self.largest = max(self.largest, float(s[kept:].max(initial=0.0)))

    def _join(self, slots: Index) -> None:
        roots = {self._root(self._owner[int(slot)]) for slot in slots}
        if len(roots) > 1:
            first = min(roots)
            for r in roots:
                self._home[r] = first

    def _root(self, i: int) -> int:
        while self._home[i] != i:
            self._home[i] = self._home[self._home[i]]
            i = self._home[i]
        return i

    # --- what it gives -----------------------------------------------------------------------------------------------------

    @property
    def zero_rows(self) -> Index:
        """Slots of the rows that became zero: one self-stress each, beside the local ones."""
        return np.concatenate(self._zero)

    @property
    def sets(self) -> tuple[tuple[int, tuple[int, ...]], ...]:
        """(number of self-stresses, loops) of every set of loops that self-stresses can connect."""
        count: dict[int, int] = {}
        for i, Y in self.local:
            count[self._root(i)] = count.get(self._root(i), 0) + Y.shape[1]
        for slot in self.zero_rows:
            root = self._root(self._owner[int(slot)])
            count[root] = count.get(root, 0) + 1
        members: dict[int, list[int]] = {}
        shared = {self._root(self._owner[int(slot)]) for slot in self.zero_rows}
        for i in range(len(self._home)):
            root = self._root(i)
            if root in shared:
                members.setdefault(root, []).append(i)
        alone = [(Y.shape[1], (i,)) for i, Y in self.local if self._root(i) not in shared]
        together = [(count[root], tuple(loops)) for root, loops in members.items()]
        return tuple(sorted(alone + together, key=lambda item: item[1]))

    def wrenches(self, shared: Array) -> Array:
        """Loop wrenches ``(6 loops, k)`` of the self-stresses that connect loops, for coefficients ``shared (zero rows, k)``."""
        y = np.zeros((len(self._owner), shared.shape[1]))
        y[self.zero_rows] = shared
        for step in reversed(self._steps):
            step.back(y)
        out = np.zeros((6 * len(self.rows.blocks), shared.shape[1]))
        for i, U, slots in self._start:
            out[6 * i : 6 * i + 6] = U @ y[slots]
        return out

    def random_stress(self, rng: np.random.Generator, count: int) -> Array:
        """Random self-stresses ``(6 loops, count)``: every one has a part of every self-stress."""
        out = self.wrenches(rng.normal(size=(len(self.zero_rows), count)))
        for i, Y in self.local:
            out[6 * i : 6 * i + 6] += Y @ rng.normal(size=(Y.shape[1], count))
        return out

    def motions(self) -> Array:
        """Orthonormal motions ``(F, M)``."""
        out = np.zeros((self.rows.width, self.rows.width - self.rank))
        free = 0
        for part in reversed(self._solved):
            out[part.at] = part.A @ out[part.others]
            n = part.Z.shape[1]
            out[np.ix_(part.at, np.arange(free, free + n))] += part.Z
            free += n
        return np.asarray(np.linalg.qr(out)[0])


def householder(A: Array) -> tuple[Array, Array, Array]:
    """``A = (I - V T V^T) [R; 0]`` with ``T`` upper triangular (compact WY form); the work is LAPACK's."""
    k = min(A.shape)
    h, tau = np.linalg.qr(A, mode="raw")
    qr = h.T
    V = np.tril(qr[:, :k], -1) + np.eye(A.shape[0], k)
    T = np.zeros((k, k))
    G = V.T @ V
    for j in range(k):
        T[:j, j] = -tau[j] * (T[:j, :j] @ G[:j, j])
        T[j, j] = tau[j]
    return V, T, np.triu(qr[:k])


def local_measure(points: Array) -> Array:
    """``6 x 6``: twists about the origin -> about the middle of ``points (3, n)``, lengths over their RMS distance from it."""
    middle = points.mean(axis=1)
    size = float(np.sqrt(((points - middle[:, None]) ** 2).sum(axis=0).mean())) or 1.0
    out = np.eye(6)
    out[3:, :3] = cross(np.eye(3), middle[:, None])
    out[3:] /= size
    return out


def loop_order(columns: Sequence[Index]) -> list[int]:
    """An order of the loops that keeps the front short: Cuthill and McKee on loops that share freedoms."""
    n = len(columns)
    sizes = [len(c) for c in columns]
    rows = np.repeat(np.arange(n), sizes)
    at = np.concatenate([*columns, np.zeros(0, dtype=np.intp)])
    touch = scipy.sparse.csr_array((np.ones(len(at)), (rows, at)))
    graph = (touch @ touch.T).tocsr()
    order = scipy.sparse.csgraph.reverse_cuthill_mckee(graph, symmetric_mode=True)
    return [int(i) for i in order]
