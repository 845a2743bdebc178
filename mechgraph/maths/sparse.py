"""Sparse systems: square ones of one pattern, those that fall into blocks, least-norm solutions.

Sparse square systems of one pattern: the order that keeps the fill low is found once, values change from position to position.

Source: Davis, Direct Methods for Sparse Linear Systems, 2006, chapters 6 and 7; the factorization is SuperLU's (scipy).

Many square systems of one sparse pattern, solved block by block in the order in which their unknowns can be found.

A matching of rows to columns and the strongly connected components of the graph "row needs column" permute the pattern to block triangular
form (the fine decomposition of Dulmage and Mendelsohn, 1958): of the closure equations of a mechanism, its structural groups. Blocks that
wait for none of each other are of one *level*. The diagonal blocks of all systems are inverted together, size by size; a solution goes
through the levels, and through them backwards for the transposed system.
Source: Duff, Erisman and Reid, Direct Methods for Sparse Matrices, 2017, chapter 6.

Least-norm solutions and the range of singular values of a sparse matrix, by its damped normal equations.

    dq = K^T (K K^T + d I)^-1 r

d lets directions with singular values below sqrt(d) alone, as a truncated singular value decomposition would; it also makes the
matrix definite where rows of K depend on each other. Source: Bjorck, Numerical Methods for Least Squares Problems, 1996, chapter 2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, Literal

import numpy as np
import scipy

from mechgraph.maths.linear import inverses, rank_of, singular_values
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import RANKS


class Pattern:
    """Places ``(rows, cols)`` of the nonzeros of a square matrix; order of columns and pivots of the first factorization are kept."""

    def __init__(self, rows: Index, cols: Index, size: int) -> None:
        self.size = size
        self._rows, self._cols = rows, cols
        self._known = False
        self._arrange(np.arange(size, dtype=np.intp), np.arange(size, dtype=np.intp))

    @property
    def places(self) -> tuple[Index, Index]:
        """Rows and columns of the values."""
        return self._rows, self._cols

    def _arrange(self, row_place: Index, col_place: Index) -> None:
        """Compressed columns with row ``i`` at ``row_place[i]``, column ``j`` at ``col_place[j]``; where each value goes."""
        self._row_place, self._col_place = row_place, col_place
        rows, cols = row_place[self._rows], col_place[self._cols]
        self._values = np.lexsort((rows, cols))
        self._indices = rows[self._values].astype(np.int32)
        self._starts = np.searchsorted(cols[self._values], np.arange(self.size + 1)).astype(np.int32)

    def factor(self, values: Array) -> SparseFactor:
        """The matrix with these values, factored."""
        if not self._known:
            first = self._factored(values, "COLAMD", 1.0)
            if first is None:
                return SparseFactor(self._matrix(values), None, self._row_place, self._col_place)
            self._known = True
            self._arrange(first.lu.perm_r.astype(np.intp), first.lu.perm_c.astype(np.intp))
        # part of the largest candidate that the pivot of the first factorization needs to be taken again
        lu = self._factored(values, "NATURAL", 0.1)
        return SparseFactor(self._matrix(values), lu, self._row_place, self._col_place)

    def _matrix(self, values: Array) -> scipy.sparse.csc_array:
        return scipy.sparse.csc_array((values[self._values], self._indices, self._starts), shape=(self.size,) * 2)

    def _factored(self, values: Array, order: Literal["COLAMD", "NATURAL"], threshold: float) -> Factors | None:
        """Factors of the matrix as it is arranged, None where it is exactly singular."""
        try:
            return Factors(self._matrix(values), permc_spec=order, diag_pivot_thresh=threshold)
        except RuntimeError:
            return None


class Factors:
    """SuperLU of a matrix. It is copied and pickled by the matrix, which is factored again: SuperLU itself cannot be."""

    def __init__(self, A: scipy.sparse.csc_array, **options: Any) -> None:
        self._A, self._options = A, options
        self.lu: Any = scipy.sparse.linalg.splu(A, **options)

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), **self._options), (self._A,)

    def solve(self, b: Array, trans: Literal["N", "T"] = "N") -> Array:
        """Solution of ``A x = b``, or ``A^T x = b``, for ``b (n, k)``."""
        return np.asarray(self.lu.solve(b, trans))


class SparseFactor:
    """One factored matrix; solves with one step of refinement. ``lu`` is None for a matrix that is exactly singular."""

    def __init__(self, A: scipy.sparse.csc_array, lu: Factors | None, row_place: Index, col_place: Index) -> None:
        self._A, self._lu, self._row_place, self._col_place = A, lu, row_place, col_place

    @cached_property
    def smallest_pivot(self) -> float:
        """The smallest pivot, at most 1; 0 where the matrix is exactly singular. Reading it costs as much as a solution."""
        return 0.0 if self._lu is None else float(np.abs(self._lu.lu.U.diagonal()).min(initial=1.0))

    @cached_property
    def distance(self) -> float:
        """Distance to the nearest singular matrix, ``1 / |A^-1|`` in the 1-norm, estimated (Higham and Tisseur 2000); 0 where singular."""
        n = self._A.shape[0]
        if not n:
            return 1.0
        if self._lu is None:
            return 0.0
        inverse = scipy.sparse.linalg.LinearOperator(
            (n, n),
            matvec=lambda b: self.solve(b.reshape(n, 1))[:, 0],
            rmatvec=lambda b: self.solve(b.reshape(n, 1), transposed=True)[:, 0],
            matmat=self.solve,
            rmatmat=lambda b: self.solve(b, transposed=True),
            dtype=np.dtype(float),
        )
        # one column: more of them begin with random numbers of the whole process, so that the same call could end in two ways
        size = float(scipy.sparse.linalg.onenormest(inverse, t=1))
        return 1.0 / size if 0 < size < np.inf else 0.0

    def solve(self, b: Array, transposed: bool = False) -> Array:
        """Solution of ``A x = b`` (or ``A^T x = b``) for ``b (n, k)``; NaN where the matrix is singular."""
        if self._lu is None:
            return np.full_like(b, np.nan)
        if not b.size:
            return np.zeros_like(b)
        if transposed:
            return self._refined(_to_places(b, self._col_place), "T", self._A.T)[self._row_place]
        return self._refined(_to_places(b, self._row_place), "N", self._A)[self._col_place]

    def _refined(self, b: Array, trans: Literal["N", "T"], A: Any) -> Array:
        assert self._lu is not None
        solve = self._lu.solve
        x = solve(b, trans)
        return np.asarray(x + solve(b - A @ x, trans))


class SparseFactors:
    """Factored matrices, one a position, for right sides ``(n, k, T)``."""

    def __init__(self, factors: list[SparseFactor]) -> None:
        self._factors = factors

    @cached_property
    def smallest_pivot(self) -> Array:
        """That of every matrix, ``(T,)``."""
        return np.array([factor.smallest_pivot for factor in self._factors])

    def solve(self, b: Array, transposed: bool = False) -> Array:
        """Solutions ``x (n, k, T)`` of ``A x = b``, or ``A^T x = b``; NaN where a matrix is singular."""
        return np.stack([factor.solve(b[:, :, t], transposed) for t, factor in enumerate(self._factors)], axis=2)

    def part(self, at: Index) -> SparseFactors:
        """Some of the matrices."""
        return SparseFactors([self._factors[i] for i in at.tolist()])


def _to_places(b: Array, order: Index) -> Array:
    out = np.empty_like(b)
    out[order] = b
    return out


def least_solution(A: scipy.sparse.csc_array, b: Array) -> Array:
    """The solution ``(n,)`` of ``A x = b`` with independent rows ``A (m, n)``, of least norm where ``n > m``, refined once.

    LU of ``A`` where it is square, of ``[w A^T; A 0]`` otherwise; a weight ``w`` near the smallest singular value keeps the condition that
    of ``A``, where 1 squares it (Bjorck, Numerical Methods for Least Squares Problems, 1996, sections 2.5 and 7.1).
    """
    m, n = A.shape
    if m != n:
        # weight of the norm in ``least_solution``, beside rows of size one
        A = scipy.sparse.block_array([[1e-4 * scipy.sparse.eye_array(n), A.T], [A, None]], format="csc")
        b = np.concatenate([np.zeros(n), b])
    if not b.size:
        return b
    lu = Factors(A)
    x = lu.solve(b)
    return np.asarray(x + lu.solve(b - A @ x))[:n]


WHOLE = 400
"""Unknowns up to which a singular value decomposition is a matter of a tenth of a second."""
OPEN = 1e-7
"""Part that an unknown has in the solutions without a right side, above which it is not unique; relative residual of a contradiction."""


def unique_solution(A: scipy.sparse.csc_array, b: Array) -> Array:
    """The solution ``(n,)`` of ``A x = b``, NaN in unknowns that the equations leave open; all NaN where they contradict each other.

    Rows may depend on each other: a singular value decomposition says what is open; LU of a large matrix that is square and regular.
    """
    rows, K = _unit_rows(A)
    columns, K = _unit_rows(K.T.tocsc())
    K, b = K.T.tocsc(), b / rows
    m, n = K.shape
    if (
        m == n > WHOLE and scipy.sparse.csgraph.structural_rank(K) == n
    ):  # SuperLU itself fails on a matrix without that rank
        places = K.tocoo()
        factor = Pattern(places.row.astype(np.intp), places.col.astype(np.intp), n).factor(places.data)
        # distance from a singular matrix, rows and columns of size one, below which an LU is not trusted
        if factor.distance > 1e-9:
            return np.asarray(factor.solve(b[:, None])[:, 0] / columns)
    U, s, Vt = np.linalg.svd(K.toarray())
    rank = rank_of(s)
    x = Vt[:rank].T @ ((U[:, :rank].T @ b) / s[:rank])
    left, size = np.abs(K @ x - b).max(initial=0.0), np.abs(b).max(initial=0.0)
    not_unique = np.sqrt((Vt[rank:] ** 2).sum(axis=0)) > OPEN
    return np.where(not_unique | (left > OPEN * size), np.nan, x / columns)


def _unit_rows(A: scipy.sparse.csc_array) -> tuple[Array, scipy.sparse.csc_array]:
    """Largest entry of every row, and the matrix with its rows divided by it; rows that are rounding stay what they are."""
    size = np.zeros(A.shape[0])
    places = A.tocoo()
    np.maximum.at(size, places.row, np.abs(places.data))
    # size of a row, against the largest, that is rounding of zeros
    size[size <= 1e-13 * size.max(initial=0.0)] = 1.0
    return size, scipy.sparse.csc_array(scipy.sparse.diags_array(1.0 / size) @ A)


@dataclass(frozen=True)
class _Sums:
    """Products of entries with unknowns, ``entries (n,)`` times ``factors (n,)``, summed from ``starts`` on into ``places``."""

    entries: Index
    factors: Index
    places: Index
    starts: Index

    @classmethod
    def of(cls, entries: Index, to: Index, factors: Index) -> _Sums:
        """Sums of entries by where they go ``to``."""
        order = np.argsort(to, kind="stable")
        places, starts = np.unique(to[order], return_index=True)
        return cls(entries[order], factors[order], places, starts.astype(np.intp))

    def subtract(self, y: Array, values: Array, x: Array) -> None:
        """Take the sums of ``values (entries, T)`` times ``x (size, k, T)`` from ``y (size, k, T)``."""
        if self.places.size:
            y[self.places] -= np.add.reduceat(values[self.entries][:, None] * x[self.factors], self.starts, axis=0)


@dataclass(frozen=True)
class _BlockStep:
    """Blocks of one ``size`` at one level: unknowns ``first`` to ``end``, blocks ``at`` among those of that size, what they need before.

    ``needs`` of the rows for the system itself, ``transposed`` of the columns for the transposed one.
    """

    size: int
    first: int
    end: int
    at: slice
    needs: _Sums
    transposed: _Sums


class BlockTriangular:
    """The block triangular form of a square pattern with entries at ``(rows, cols)``, each place once.

    ``blocks`` their number, ``sizes`` how many of which size, ``levels`` how many levels; none where the pattern has no matching
    (``blocks`` is 0).
    """

    def __init__(self, rows: Index, cols: Index, size: int) -> None:
        self.size, self.blocks, self.levels, self.sizes = size, 0, 0, dict[int, int]()
        pattern = scipy.sparse.csr_array((np.ones(len(rows)), (rows, cols)), shape=(size, size))
        row_of = scipy.sparse.csgraph.maximum_bipartite_matching(pattern, perm_type="row").astype(np.intp)
        if size == 0 or (row_of < 0).any():
            return
        needing = np.argsort(row_of)[rows]  # the unknown that a row is matched to
        needs = scipy.sparse.csr_array((np.ones(len(rows)), (needing, cols)), shape=(size, size))
        self.blocks, of = scipy.sparse.csgraph.connected_components(needs, connection="strong")
        block = of.astype(np.intp)
        level = _levels(block[cols], block[needing], self.blocks)
        self.levels = int(level.max()) + 1
        count = np.bincount(block)
        self.sizes = {int(n): int(c) for n, c in enumerate(np.bincount(count)) if c}
        order = np.lexsort((block, count[block], level[block]))
        place = np.argsort(order)
        self._unknowns, self._equations = order, row_of[order]
        self._arrange(place[needing], place[cols], block[order], count, level)

    def _arrange(self, rows: Index, cols: Index, block: Index, count: Index, level: Index) -> None:
        """Diagonal blocks and steps, for entries at places in the new order and the ``block`` of every place."""
        first = np.flatnonzero(np.diff(block, prepend=-1))
        own = first[np.cumsum(np.diff(block, prepend=-1) != 0) - 1]  # first place of the block of a place
        width, depth = count[block], level[block]
        inside = own[rows] == own[cols]
        number = np.zeros(self.size, dtype=np.intp)
        self._diagonal = []
        for n in self.sizes:
            starts = first[width[first] == n]
            number[starts] = np.arange(len(starts))
            e = np.flatnonzero(inside & (width[rows] == n))
            start = own[rows[e]]
            self._diagonal.append((n, len(starts), e, (number[start], rows[e] - start, cols[e] - start)))
        waiting = np.flatnonzero(~inside)
        (by_row, row), (by_col, col) = (_sorted(waiting, to) for to in (rows, cols))
        edges = np.flatnonzero((np.diff(depth, prepend=-1) != 0) | (np.diff(width, prepend=-1) != 0))
        self._steps = []
        for begin, end in pairwise([*edges.tolist(), self.size]):
            mine, theirs = by_row[_between(row, begin, end)], by_col[_between(col, begin, end)]
            n, at = int(width[begin]), int(number[begin])
            before, behind = _Sums.of(mine, rows[mine], cols[mine]), _Sums.of(theirs, cols[theirs], rows[theirs])
            self._steps.append(_BlockStep(n, begin, end, slice(at, at + (end - begin) // n), before, behind))
        every = np.arange(len(rows))
        self._products = {False: _Sums.of(every, rows, cols), True: _Sums.of(every, cols, rows)}

    def pays(self, T: int) -> bool:
        """Whether ``T`` systems are solved in less time by blocks, all together, than one after the other as a whole."""
        # on chains of N groups both take the same time for 8 systems of 20 steps, 32 of 100, 60 of 400; a dense inverse of 60 rows takes
        # as long as sparse factors (``tests/benchmarks/bench_large.py --groups``)
        return self.blocks > 0 and max(self.sizes) <= 60 and len(self._steps) <= 3 * T

    def factor(self, values: Array) -> BlockFactor:
        """The systems with values ``(T, entries)``, factored."""
        return BlockFactor(self, np.ascontiguousarray(values.T))


class BlockFactor:
    """Systems of one block triangular form with ``values (entries, T)``, factored; solves with one step of refinement."""

    def __init__(self, form: BlockTriangular, values: Array) -> None:
        self._form, self._values = form, values
        T = values.shape[1]
        self._inverse: dict[int, Array] = {}
        smallest = np.full(T, np.inf)
        for n, count, entries, (block, i, j) in form._diagonal:
            A = np.zeros((count, T, n, n))
            A[block, :, i, j] = values[entries]
            inverse = inverses(A.reshape(-1, n, n)).reshape(A.shape)
            size = np.abs(inverse).sum(axis=3).max(axis=(0, 2))
            smallest = np.fmin(smallest, np.where(size > 0, 1.0 / np.where(size > 0, size, 1.0), 0.0))
            self._inverse[n] = np.ascontiguousarray(inverse.transpose(0, 2, 3, 1))
        self.smallest_pivot = np.where(np.isfinite(smallest), np.minimum(smallest, 1.0), 0.0)

    def solve(self, b: Array, transposed: bool = False) -> Array:
        """Solution ``x (size, k, T)`` of ``A x = b``, or ``A^T x = b``; NaN where a system is singular."""
        if not b.size:
            return np.zeros_like(b)
        form = self._form
        given, wanted = (form._unknowns, form._equations) if transposed else (form._equations, form._unknowns)
        right = b[given]
        x = self._swept(right.copy(), transposed)
        form._products[transposed].subtract(right, self._values, x)
        x += self._swept(right, transposed)
        out = np.empty_like(x)
        out[wanted] = x
        return out

    def _swept(self, y: Array, transposed: bool) -> Array:
        """The solution in the new order, in place of the right sides ``y``."""
        for step in reversed(self._form._steps) if transposed else self._form._steps:
            (step.transposed if transposed else step.needs).subtract(y, self._values, y)
            right = y[step.first : step.end].reshape(-1, step.size, *y.shape[1:])
            found = np.einsum(
                "bjit,bjkt->bikt" if transposed else "bijt,bjkt->bikt", self._inverse[step.size][step.at], right
            )
            y[step.first : step.end] = found.reshape(-1, *y.shape[1:])
        return y

    def part(self, at: Index) -> BlockFactor:
        """Some of the systems."""
        out = BlockFactor.__new__(BlockFactor)
        out._form, out._values, out.smallest_pivot = self._form, self._values[:, at], self.smallest_pivot[at]
        out._inverse = {n: inverse[..., at] for n, inverse in self._inverse.items()}
        return out


def _sorted(items: Index, by: Index) -> tuple[Index, Index]:
    """Items in the order of their places ``by``, and these."""
    items = items[np.argsort(by[items], kind="stable")]
    return items, by[items]


def _between(values: Index, begin: int, end: int) -> slice:
    """Where rising values are at least ``begin`` and below ``end``."""
    return slice(*np.searchsorted(values, (begin, end)).tolist())


def _levels(before: Index, after: Index, count: int) -> Index:
    """For every node of a graph without cycles how many come before it at most, along edges from ``before`` to ``after``."""
    off = before != after
    graph = scipy.sparse.csr_array((np.ones(int(off.sum())), (before[off], after[off])), shape=(count, count))
    graph.sum_duplicates()
    waiting = np.bincount(graph.indices, minlength=count)
    level = np.zeros(count, dtype=np.intp)
    front, depth = np.flatnonzero(waiting == 0), 0
    while front.size:
        level[front] = depth
        reached = graph[front].indices
        np.subtract.at(waiting, reached, 1)
        front, depth = np.unique(reached[waiting[reached] == 0]), depth + 1
    return level


"""Rows or columns up to which singular values are those of the whole matrix (a tenth of a second at most)."""


class LeastNorm:
    """The normal equations of ``K (m, n)``, full or sparse, factored once."""

    def __init__(self, K: Array | scipy.sparse.csr_array) -> None:
        self.K = K
        m = K.shape[0]
        if isinstance(K, np.ndarray):
            factor = scipy.linalg.lu_factor(K @ K.T + RANKS.damping * np.eye(m))
            self._solve: Callable[[Array], Array] = partial(scipy.linalg.lu_solve, factor)
        elif m:
            A = (K @ K.T + RANKS.damping * scipy.sparse.eye_array(m)).tocsc()
            symmetric = {"SymmetricMode": True}
            self._solve = Factors(A, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric).solve

    def multipliers(self, r: Array) -> Array:
        """``(K K^T + d I)^-1 r`` for ``r (m, k)``."""
        return np.asarray(self._solve(r)) if self.K.shape[0] else r

    def solve(self, r: Array) -> Array:
        """Smallest ``(n, k)`` with ``K dq = r`` as far as that can be had, with one step of refinement."""
        dq = self.K.T @ self.multipliers(r)
        return np.asarray(dq + self.K.T @ self.multipliers(r - self.K @ dq))


def singular_ratio(K: scipy.sparse.csr_array, rank: int, factored: Callable[[], LeastNorm]) -> float:
    """Singular value number ``rank`` (the smallest kept) over the largest."""
    if min(K.shape) <= WHOLE:
        s = singular_values(K.toarray())
        return float(s[rank - 1] / s[0])
    normal = factored()
    start = np.random.default_rng(3).normal(size=K.shape[1])
    largest = _largest(lambda v: K.T @ (K @ v), start)

    def inverse(v: Array) -> Array:
        """``K^T (K K^T)^-2 K``: zero on motions, the inverse square of a singular value elsewhere."""
        return np.asarray(K.T @ normal.multipliers(normal.multipliers(K @ v)))

    return 1.0 / float(np.sqrt(largest * _largest(inverse, inverse(start))))


def _largest(apply: Callable[[Array], Array], v: Array) -> float:
    """Largest eigenvalue of a symmetric operator by Lanczos steps, every vector made orthogonal to all before."""
    basis = [v / np.linalg.norm(v)]
    alpha: list[float] = []
    beta: list[float] = []
    value = 0.0
    # Lanczos steps for the smallest singular value of a larger one
    # relative change at which the steps end
    lanczos_settled = 1e-3
    for _ in range(24):
        w = apply(basis[-1])
        alpha.append(float(w @ basis[-1]))
        for u in basis:
            w -= (w @ u) * u
        found = float(scipy.linalg.eigvalsh_tridiagonal(alpha, beta)[-1])
        size = float(np.linalg.norm(w))
        if abs(found - value) <= lanczos_settled * found or size <= lanczos_settled**2 * found:
            return found
        value = found
        beta.append(size)
        basis.append(w / size)
    return value
