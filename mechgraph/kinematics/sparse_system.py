"""The closure equations of a large mechanism as sparse systems: eliminated along the loops, or bordered and factored.

Rank, null space and self-stresses by orthogonal elimination along the loops, with a rank decision at every column.

A front of rows goes over the blocks (the kept rows of every loop, each further row). The rows of a block enter; columns that no later
block has are eliminated by Householder reflections with a rank decision; what remains of the front has only columns shared with
blocks to come. Work grows as blocks times the square of the front, so chains cost blocks, lattices blocks to the second power. Every
step is orthogonal: self-stresses and motions come back through the same reflections.
Source: George and Heath, Solution of sparse linear least squares problems using Givens rotations, Linear Algebra and its Applications 34,
1980; Heath, Some extensions of an algorithm for sparse linear least squares problems, SIAM J. Sci. Stat. Comput. 3, 1982 (rank decision).

The closure equations of a large mechanism as one square sparse system: reduced loop by loop, bordered, factored.

The rows of a loop are taken with its own unit of length, and turned so that those without any pivot in that
loop alone (its local redundancy) fall away. A motion within a single loop (the spin of a coupler between spheres) gets a row that
holds it. A matching of the remaining rows to the free columns leaves some columns and rows unmatched; each is bordered by a random row
or column, placed at the loop where it lies. What results,

    B = [ U^T J   R ]        B [q; s] = [U^T b; 0],      B^T [x; m] = [tau; c],
        [   G     0 ]

is square. Where it is well away from a singular matrix the rank of J is proved: the bordering cannot make up for a rank below that of the
matching; pivots alone do not say so (0.001 at a singular value of 5e-8 has been met). Where geometry makes the rank lower, or the borders
do not meet what it leaves, they are bases of the self-stresses that connect loops and of the motions there, which an elimination finds.
Then q solves the rates, x gives the loop wrenches, a random ``c`` a random self-stress. Many positions are factored group by group where
that is faster: the blocks of B in block triangular form are the structural groups with these drivers.
Sources: Duff, Erisman and Reid, Direct Methods for Sparse Matrices, 2017, chapters 5 and 6 (matching, structural rank); Govaerts, Numerical
Methods for Bifurcations of Dynamical Equilibria, 2000, chapter 3 (bordered systems).
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

import numpy as np
import scipy

from mechgraph.graph.linkgraph import labels_of_bipartite, members
from mechgraph.kinematics.state import ClosureRows, Configuration, ReducedRows
from mechgraph.maths.linear import BlockFactor, BlockTriangular, Factors, Pattern, SparseFactor, SparseFactors
from mechgraph.maths.se3 import Array, Index, Mask
from mechgraph.maths.tolerances import MOTIONS, RANKS
from mechgraph.memo import dataclass


@dataclass(frozen=True)
class _Reflections:
    """``I - V T V^T`` on ``rows``, followed by ``U^T`` on the first of them."""

    rows: Index
    V: Array
    T: Array
    U: Array

    def back(self, y: Array) -> None:
        """Apply the orthogonal factor (not its transpose) to ``y (rows, k)`` in place."""
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
    """The elimination of ``K (m, n)``, its rows in the blocks ``owners (m,)``; pivots below ``tolerance`` count as zero.

    ``rank``, ``dropped`` largest pivot that counted as zero, ``zero_rows`` the rows that became zero: one self-stress each.
    """

    def __init__(self, K: scipy.sparse.csr_array, owners: Index, tolerance: float) -> None:
        self.tolerance = tolerance
        self.rank, self.dropped = 0, 0.0
        self.shape = K.shape
        self._steps: list[_Reflections] = []
        self._solved: list[_Solved] = []
        self._zero: list[Index] = []
        self._sweep(K, owners)
        self.zero_rows = np.concatenate(self._zero)

    def _sweep(self, K: scipy.sparse.csr_array, owners: Index) -> None:
        K.sum_duplicates()
        blocks = list(pairwise([*np.flatnonzero(np.diff(owners, prepend=-1)).tolist(), K.shape[0]]))
        columns = [np.unique(K.indices[K.indptr[i] : K.indptr[j]]).astype(np.intp) for i, j in blocks]
        order = _block_order(columns, K.shape[1])
        last = np.full(K.shape[1], -1)
        for step, i in enumerate(order):
            last[columns[i]] = step
        front, rows, active = np.zeros((0, 0)), np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
        place = np.full(K.shape[1], -1)  # of the columns in the front
        for step, i in enumerate(order):
            first, end = blocks[i]
            place[active] = np.arange(len(active))
            wide = np.concatenate([active, columns[i][place[columns[i]] < 0]])
            place[wide] = np.arange(len(wide))
            entries = slice(K.indptr[first], K.indptr[end])
            below = np.zeros((end - first, len(wide)))
            number = np.repeat(np.arange(end - first), np.diff(K.indptr[first : end + 1]))
            below[number, place[K.indices[entries]]] = K.data[entries]
            place[wide] = -1
            kept = np.pad(front, ((0, 0), (0, len(wide) - front.shape[1])))
            front, rows, active = np.concatenate([kept, below]), np.concatenate([rows, np.arange(first, end)]), wide
            front, rows, active = self._eliminate(front, rows, active, last[active] == step)
            front, rows = self._condense(front, rows)
        free = np.flatnonzero(last < 0)
        if free.size:
            self._solved.append(_Solved(free, np.zeros(0, dtype=np.intp), np.zeros((free.size, 0)), np.eye(free.size)))
        self._zero.append(rows)

    def _eliminate(self, front: Array, rows: Index, active: Index, done: Mask) -> tuple[Array, Index, Index]:
        """Solve the columns ``done`` (a mask over ``active``) from the front."""
        if not done.any():
            return front, rows, active
        at, others = active[done], active[~done]
        rest = front[:, ~done]
        V, T, R = householder(front[:, done])
        U, s, Vt = np.linalg.svd(R)
        kept = int((s > self.tolerance).sum())
        self.dropped = max(self.dropped, float(s[kept:].max(initial=0.0)))
        rest = rest - V @ (T.T @ (V.T @ rest))
        k = R.shape[0]
        rest[:k] = U.T @ rest[:k]
        self._steps.append(_Reflections(rows, V, T, U))
        A = -(Vt[:kept].T / s[:kept]) @ rest[:kept]
        self._solved.append(_Solved(at, others, A, Vt[kept:].T))
        self.rank += kept
        return rest[kept:], rows[kept:], others

    def _condense(self, front: Array, rows: Index) -> tuple[Array, Index]:
        """Where the front has more rows than columns, reflect it to triangular form; rows left over are self-stresses."""
        # rows a column that the front may have before it is condensed
        if front.shape[0] <= 2.0 * front.shape[1] + 6:
            return front, rows
        V, T, R = householder(front)
        self._steps.append(_Reflections(rows, V, T, np.eye(R.shape[0])))
        self._zero.append(rows[R.shape[0] :])
        return R, rows[: R.shape[0]]

    def stresses(self, shares: Array) -> Array:
        """``y (m, k)`` with ``K^T y = 0`` for shares ``(zero rows, k)``; orthonormal shares give orthonormal ``y``."""
        y = np.zeros((self.shape[0], shares.shape[1]))
        y[self.zero_rows] = shares
        for step in reversed(self._steps):
            step.back(y)
        return y

    def motions(self) -> Array:
        """A basis ``(n, n - rank)`` of the ``q`` with ``K q = 0``."""
        out = np.zeros((self.shape[1], self.shape[1] - self.rank))
        free = 0
        for part in reversed(self._solved):
            out[part.at] = part.A @ out[part.others]
            n = part.Z.shape[1]
            out[np.ix_(part.at, np.arange(free, free + n))] += part.Z
            free += n
        return out


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


def _block_order(columns: list[Index], width: int) -> list[int]:
    """An order of the blocks that keeps the front short: Cuthill and McKee on blocks that share columns."""
    if not columns:
        return []  # no loop has a freedom: a graph without nodes has no order for scipy
    rows = np.repeat(np.arange(len(columns)), [len(c) for c in columns])
    at = np.concatenate([*columns, np.zeros(0, dtype=np.intp)])
    touch = scipy.sparse.csr_array((np.ones(len(at)), (rows, at)), shape=(len(columns), width))
    order = scipy.sparse.csgraph.reverse_cuthill_mckee((touch @ touch.T).tocsr(), symmetric_mode=True)
    return [int(i) for i in order]


Factored = SparseFactors | BlockFactor
"""The system at many positions, factored one by one or group by group."""

PIVOT = 1e-8
"""Pivot (against unit rows and columns) below which a bordered system counts as singular."""
WORSE = 1e-2
"""Part of the smallest pivot at the position of choice below which another bordering is chosen."""


class LoopSystem(ReducedRows):
    """The bordered system chosen at one position, columns ``fixed`` left out; serves nearby positions.

    ``regular`` whether its pivots prove the rank there; ``rank`` of J without the fixed columns; ``smallest`` pivot; ``redundant``
    number of self-stresses; ``held`` number of motions left; ``kept (loops,)`` rows of every loop that are
    independent there, ``dropped`` the largest singular value among the others; ``shared`` number of self-stresses that connect loops,
    ``shared_in`` a loop of each; ``borders`` self-stresses ``(height, shared)`` and motions ``(free columns, held)`` that were given as
    such; None where borders are random.
    """

    shared: int
    held: int
    _motions: int
    _size: int

    def __init__(self, rows: ClosureRows, fixed: Index, borders: tuple[Array, Array] | None = None) -> None:
        super().__init__(rows, fixed)
        self.borders = borders
        self._match()
        self.pattern, self._constant = self._border()
        self.first = self.factor(rows)
        self.smallest = self.first.smallest_pivot
        self.regular = self.smallest > PIVOT
        self.pivot_limit = max(PIVOT, WORSE * self.smallest)
        self.rank = self._n - self.held

    @classmethod
    def at(cls, here: Configuration, fixed: Index) -> LoopSystem:
        """The system chosen at the first position of a configuration."""
        return cls(ClosureRows.at(here), fixed)

    @classmethod
    def of_rank(cls, here: Configuration, fixed: Index) -> LoopSystem:
        """The same with the rank that the position has, be it below that of the graph."""
        out = cls.at(here, fixed)
        return out.well_held() if out.regular else cls(out.rows, fixed, out.null_spaces())

    @classmethod
    def like(cls, other: LoopSystem, here: Configuration) -> LoopSystem:
        """The system of another position chosen at the first one of a configuration, of the same rank."""
        out = cls(ClosureRows.at(here), other.fixed)
        if other.borders is None:
            return out.well_held()
        own = out.null_spaces()
        as_there = own[1].shape == other.borders[1].shape or out.height != other.height
        return cls(out.rows, other.fixed, own if as_there else other.borders)

    def well_held(self) -> LoopSystem:
        """Itself, with motions of several loops held along themselves: random rows, which prove the rank, may hardly hold them."""
        if self.held == self._motions or not self.regular:
            return self
        rhs = np.zeros((self._size, self.held))
        rhs[self._m :] = np.eye(self.held)
        motions = self.first.solve(rhs)[: self._n]
        motions /= np.abs(motions).max(axis=0)
        moving = scipy.sparse.csr_array(np.abs(motions.T) > MOTIONS.rounding)
        for group in members(labels_of_bipartite(moving)):  # orthonormal; those without a freedom in common stay apart
            motions[:, group] = np.linalg.qr(motions[:, group])[0]
        (row, column), (held, moved) = self.pattern.places, (np.abs(motions.T) > MOTIONS.rounding).nonzero()
        rest, self._motions = row < self._m, 0
        self.pattern = Pattern(
            np.concatenate([row[rest], self._m + held]), np.concatenate([column[rest], moved]), self._size
        )
        self._constant = np.concatenate([self._constant[rest[len(rest) - len(self._constant) :]], motions[moved, held]])
        self.first = self.factor(self.rows)
        self.smallest = self.first.smallest_pivot
        self.pivot_limit = max(PIVOT, WORSE * self.smallest)
        return self

    def null_spaces(self) -> tuple[Array, Array]:
        """Orthonormal self-stresses ``(height, s)`` that connect loops and motions ``(free columns, p)``, columns of unit size."""
        found = Elimination(self.matrix, self.owners, RANKS.position)
        return np.linalg.qr(found.stresses(np.eye(self.height - found.rank)))[0], np.linalg.qr(found.motions())[0]

    # --- the choice ------------------------------------------------------------------------------------------------------

    @staticmethod
    def _own_motions(block: Array, own: Mask, columns: Index) -> list[tuple[Array, Index]]:
        """Orthonormal motions of single loops in columns that no other loop has: rows ``(n, c)`` and their columns."""
        some = np.flatnonzero(own.sum(axis=1) > 1)
        c = own.shape[1]
        others = np.eye(c) * ~own[some][:, None]  # columns of other loops, and fixed ones, are at rest
        rows = np.concatenate([block[some] * own[some][:, None], others], axis=1)
        # det R^T R is at most the square of the smallest singular value times the trace to the power c - 1: where that proves the
        # columns independent no decomposition is needed
        G = rows.swapaxes(1, 2) @ rows
        size = np.maximum(np.trace(G, axis1=1, axis2=2), 1.0)
        # smallest over largest singular value that a determinant has to prove, far above ``RANKS.loop`` and above its own rounding
        doubtful = np.linalg.slogdet(G)[1] <= 2 * np.log(1e-5) + c * np.log(size)
        some, rows = some[doubtful], rows[doubtful]
        if not some.size:
            return []
        s = np.linalg.svd(rows, compute_uv=False)
        free = (s <= RANKS.loop * np.maximum(s.max(axis=1), 1.0)[:, None]).sum(axis=1)
        mine = np.flatnonzero(free)
        Vt = np.linalg.svd(rows[mine], full_matrices=False)[2]
        out = []
        for extra in range(int(free.max(initial=0))):
            with_it = free[mine] > extra
            null = Vt[with_it, c - 1 - extra] * own[some[mine[with_it]]]
            out.append((null, columns[some[mine[with_it]]]))
        return out

    def _motions_of_single_loops(self) -> list[tuple[Array, Index]]:
        shared = np.bincount(self.entries.column, minlength=len(self.free)) > 1
        if self.rows.more is not None:
            shared[self.rows.more.indices] = True
        own = self.free & ~shared
        rows: list[tuple[Array, Index]] = []
        for _, at in self._by_width:
            block = np.moveaxis(self._first[:, at], 0, 1)
            rows += self._own_motions(block, own[self.entries.column[at]], self.entries.column[at])
        return rows

    def _match(self) -> None:
        """Match kept rows and the rows of single-loop motions to the free columns; what stays unmatched."""
        e = self.entries
        starts = np.concatenate([[0], np.cumsum(self.kept)])
        self._m, self._n = self.height, int(self.free.sum())
        place = np.cumsum(self.free) - 1
        more = scipy.sparse.coo_array(self._more(self.rows))
        rows = [
            (starts[e.loop][None] + np.arange(self.width)[:, None])[self._live],
            int(starts[-1]) + more.row.astype(np.intp),
        ]
        cols = [np.broadcast_to(place[e.column], (self.width, len(e.loop)))[self._live], more.col.astype(np.intp)]
        data = [np.zeros(0)]
        self._motions = 0
        for null, columns in self._motions_of_single_loops() if self.borders is None else ():
            keep = np.abs(null) > 0
            number = self._m + self._motions + np.repeat(np.arange(len(null))[:, None], null.shape[1], axis=1)
            rows.append(number[keep])
            cols.append(place[columns[keep]])
            data.append(null[keep])
            self._motions += len(null)
        self._inner = (np.concatenate(rows), np.concatenate(cols), np.concatenate(data))
        shape = (self._m + self._motions, self._n)
        self._touch = scipy.sparse.csr_array((np.ones(len(self._inner[0])), self._inner[:2]), shape=shape)
        match = scipy.sparse.csgraph.maximum_bipartite_matching(self._touch, perm_type="column")
        self._left_rows = np.flatnonzero(match < 0).astype(np.intp)
        left = np.ones(self._n, dtype=bool)
        left[match[match >= 0]] = False
        self._left_cols = np.flatnonzero(left)
        self._matched = int((match >= 0).sum())
        self.shared, self.held = len(self._left_rows), self._motions + len(self._left_cols)
        if self.borders is not None:
            self.shared, self.held = (part.shape[1] for part in self.borders)
        self.redundant = self.rows.count - (self._n - self.held)
        owner = np.concatenate([self.owners, np.zeros(self._motions, dtype=np.intp)])
        self.shared_in = owner[self._left_rows]

    def _more(self, rows: ClosureRows) -> scipy.sparse.csr_array:
        """The rows behind those of the loops at any position in the free columns, of unit size; entries always at the same places."""
        if rows.more is None:
            return scipy.sparse.csr_array((0, int(self.free.sum())))
        out = rows.more[:, self.free]
        out.data *= self.scale[self.free][out.indices]
        return scipy.sparse.csr_array(out)

    def _border(self) -> tuple[Pattern, Array]:
        """The pattern of the square system and its constant values.

        A random column for every row left over, in the rows of its loop; a random row for every column left over. Or the borders that
        are given.
        """
        rows, cols, data = self._inner
        rng = np.random.default_rng(17)
        if self.borders is not None:
            (number, support), (held, columns) = (np.indices(part.T.shape).reshape(2, -1) for part in self.borders)
            constant = np.concatenate([part.T.ravel() for part in self.borders])
        else:
            height = np.concatenate([self.kept, np.ones(self.rows.further, dtype=np.intp)])
            count = height[self.shared_in]
            number = np.repeat(np.arange(len(count)), count)
            first = np.cumsum(height)[self.shared_in] - count
            support = first[number] + np.arange(len(number)) - (np.cumsum(count) - count)[number]
            held, columns = _shares(self._touch.T.tocsr(), self._touch, self._left_cols.astype(np.intp))
            constant = np.concatenate([data, _random_units(rng, number), _random_units(rng, held)])
        self._size = self._n + self.shared
        pattern = Pattern(
            np.concatenate([rows, support, self._m + self._motions + held]),
            np.concatenate([cols, self._n + number, columns]),
            self._size,
        )
        return pattern, constant

    @cached_property
    def holding(self) -> scipy.sparse.csr_array:
        """The rows ``G (held, free columns)`` that hold the motions left free."""
        at, to = self.pattern.places
        values = np.concatenate([np.zeros(len(at) - len(self._constant)), self._constant])
        mine = (at >= self._m) & (to < self._n)
        return scipy.sparse.csr_array((values[mine], (at[mine] - self._m, to[mine])), shape=(self.held, self._n))

    @cached_property
    def _normal(self) -> Factors:
        return Factors(scipy.sparse.csc_array(self.holding @ self.holding.T))

    def unheld(self, dq: Array) -> Array:
        """Increments ``(F, k)`` with the least change that takes the held motions out of them, ``G (dq / scale) = 0``."""
        G = self.holding
        y = dq[self.free] / self.scale[self.free][:, None]
        y = y - G.T @ self._normal.solve(G @ y)
        out = dq.copy()
        out[self.free] = y * self.scale[self.free][:, None]
        return out

    # --- solving ---------------------------------------------------------------------------------------------------------

    def factor(self, rows: ClosureRows) -> SparseFactor:
        """The system factored for the rows at one position."""
        values = (self._turned_blocks(rows)[self._live], self._more(rows).data, self._constant)
        return self.pattern.factor(np.concatenate(values))

    @cached_property
    def groups(self) -> BlockTriangular:
        """The system in the order of the structural groups."""
        return BlockTriangular(*self.pattern.places, self._size)

    def factors(self, here: Configuration, at: Index) -> Factored:
        """The system factored at positions: of many group by group, all positions together, where that takes less time."""
        values = self.values_at(here, at)
        # the order of groups costs some factors: it is made for 8 positions or more, and up to 25 unknowns a position
        if len(at) >= 8 and self._size <= 25 * len(at) and self.groups.pays(len(at)):
            return self.groups.factor(values)
        return SparseFactors([self.pattern.factor(one) for one in values])

    def values_at(self, here: Configuration, at: Index) -> Array:
        """Values ``(T, entries)`` of the pattern at positions."""
        rows = ClosureRows.of(here, at)
        inner = self._turned_blocks(rows)[:, self._live]
        each = at if self.rows.further else at[:1]
        more = np.array([self._more(ClosureRows.at(here, t)).data for t in each.tolist()])
        constant = np.broadcast_to(self._constant, (len(at), len(self._constant)))
        return np.concatenate([inner, np.broadcast_to(more, (len(at), more.shape[1])), constant], axis=1)

    def fits(self, factors: Factored) -> Mask:
        """Whether no pivot is small against those at the position of choice, ``(T,)``."""
        if isinstance(factors, BlockFactor):
            return np.asarray(factors.smallest_pivot > self._group_limit)
        return np.asarray(factors.smallest_pivot > self.pivot_limit)

    @cached_property
    def _group_limit(self) -> float:
        values = (self._turned_blocks(self.rows)[self._live], self._more(self.rows).data, self._constant)
        return max(PIVOT, WORSE * float(self.groups.factor(np.concatenate(values)[None]).smallest_pivot[0]))

    def turned_matrix(self, there: ClosureRows) -> scipy.sparse.csr_array:
        """``J (rows, free columns)`` in turned rows and columns of unit size; rows behind those of the loops as they are."""
        e = self.entries
        place = np.cumsum(self.free) - 1
        w = self.width
        live = np.broadcast_to(self.free[e.column], (w, len(e.loop)))
        rows = (w * e.loop + np.arange(w)[:, None])[live]
        cols = np.broadcast_to(place[e.column], (w, len(e.loop)))[live]
        shape = (w * len(self.kept), int(self.free.sum()))
        J = scipy.sparse.csr_array((self._turned_blocks(there)[live], (rows, cols)), shape=shape)
        return scipy.sparse.csr_array(scipy.sparse.vstack([J, self._more(there)]))

    @property
    def unit(self) -> float:
        """A length in the middle of those of the loops."""
        return float(np.median(self.length)) if len(self.kept) else 1.0

    @property
    def turned_rows(self) -> scipy.sparse.csr_array:
        """Multipliers of the closure rows for unit ones of the turned rows (wrenches of size ``unit``), ``(rows, rows)``."""
        n, w = len(self.kept), self.width
        blocks = self.unit * self.unit_wrenches()
        rows = np.broadcast_to(w * np.arange(n) + np.arange(w)[:, None, None], blocks.shape)
        cols = np.broadcast_to(w * np.arange(n) + np.arange(w)[None, :, None], blocks.shape)
        loops = scipy.sparse.csr_array((blocks.ravel(), (rows.ravel(), cols.ravel())), shape=(w * n, w * n))
        return scipy.sparse.csr_array(
            scipy.sparse.block_diag([loops, self.unit * scipy.sparse.eye_array(self.rows.further)])
        )

    def _columns(self, y: Array) -> Array:
        """Freedoms ``(F, ...)`` of solutions ``y (size, ...)``, zero in fixed columns."""
        q = np.zeros((len(self.free), *y.shape[1:]))
        q[self.free] = y[: self._n] * self.scale[self.free].reshape(-1, *[1] * (y.ndim - 1))
        return q

    def solve(self, factor: Factored, b: Array) -> Array:
        """``q (F, k, T)`` with ``J q = b (rows, k, T)`` in the kept rows, zero in fixed columns."""
        rhs = np.zeros((self._size, *b.shape[1:]))
        rhs[: self._m] = self.kept_part(_flat(b)).reshape(self._m, *b.shape[1:])
        return self._columns(factor.solve(rhs))

    def solve_transposed(self, factor: Factored, tau: Array) -> Array:
        """Multipliers ``x (rows, k, T)`` with ``J^T x = tau (F, k, T)`` in the free columns."""
        rhs = np.zeros((self._size, *tau.shape[1:]))
        rhs[: self._n] = tau[self.free] * self.scale[self.free][:, None, None]
        kept = factor.solve(rhs, transposed=True)[: self._m]
        return self.multipliers(_flat(kept)).reshape(self.rows.count, *tau.shape[1:])

    def connecting_stress(self, factor: SparseFactor, shares: Array) -> Array:
        """Multipliers ``(kept rows, k)`` of self-stresses that connect loops, for shares ``(shared, k)``."""
        rhs = np.zeros((self._size, shares.shape[1]))
        if self.shared:
            rhs[self._n :] = shares
        return factor.solve(rhs, transposed=True)[: self._m]

    def random_stress(self, factor: Factored, rows: ClosureRows, rng: np.random.Generator, count: int) -> Array:
        """Random self-stresses ``(rows, count, T)`` for rows at T positions, of size one in the measure of their loops.

        In the rows that fell away they are random; what these bring to the free columns where they are not zero there (in the
        positions behind the first) the other rows take up.
        """
        e, T = self.entries, len(rows.S)
        free = self._turned_blocks(rows)
        dropped = ~(np.arange(self.width) < self.kept[:, None])
        local = np.zeros(
            (len(self.kept), self.width, count)
        )  # zero in the kept rows; fixed columns are zero in the blocks
        local[dropped] = rng.normal(size=(int(dropped.sum()), count))
        power = np.empty((len(e.column), count, T))
        for loops, at in self._by_width:
            power[at] = np.moveaxis(free[..., at].transpose(0, 2, 3, 1) @ local[loops], 0, -1)
        to = scipy.sparse.csr_array(
            (np.ones(len(e.column)), (e.column, np.arange(len(e.column)))), shape=(len(self.free), len(e.column))
        )
        rhs = np.zeros((self._size, count, T))
        rhs[: self._n] = -np.asarray(to[self.free] @ _flat(power)).reshape(self._n, count, T)
        if self.shared:
            rhs[self._n :] = rng.normal(size=(self.shared, count))[:, :, None]
        kept = factor.solve(rhs, transposed=True)[: self._m]
        size = np.maximum(np.abs(kept).max(axis=0, initial=0.0), 1.0)
        own = local[dropped][:, :, None] / size
        return self.multipliers(_flat(kept / size), _flat(own)).reshape(self.rows.count, count, T)

    def motions(self, factor: Factored, T: int) -> Array:
        """Motions ``(F, held, T)`` with the fixed columns at rest, one a held motion."""
        rhs = np.zeros((self._size, self.held, T))
        rhs[self._m : self._m + self._motions, : self._motions] = np.eye(self._motions)[:, :, None]
        others = self.held - self._motions
        if others:
            rhs[self._size - others :, self._motions :] = np.eye(others)[:, :, None]
        return self._columns(factor.solve(rhs))


def _flat(values: Array) -> Array:
    """``(n, k, T)`` as ``(n, k T)``."""
    return values.reshape(len(values), int(np.prod(values.shape[1:])))


def _shares(touch: scipy.sparse.csr_array, back: scipy.sparse.csr_array, left: Index) -> tuple[Index, Index]:
    """Rows that share a column with each of the rows ``left``: its number, and the row."""
    near = (touch[left] @ back).tocsr() if left.size else touch[left]
    return np.repeat(np.arange(left.size), np.diff(near.indptr)), near.indices.astype(np.intp)


def _random_units(rng: np.random.Generator, number: Index) -> Array:
    """Random values of size one together for every number."""
    return rng.normal(size=len(number)) / np.sqrt(np.maximum(np.bincount(number)[number], 1))
