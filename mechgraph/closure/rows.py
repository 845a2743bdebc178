"""The rows of the closure equations: every constraint contributes its own, a loop six, a coupling of freedoms one.

Rows of all contributors stand one below the other, in the order of ``System.rows``: the loops first. A new kind of constraint
implements the protocol ``Rows``; nothing else in the package knows how many rows there are or where they come from.
"""

from __future__ import annotations

from functools import cached_property
from typing import Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array

Index = NDArray[np.intp]


class Evaluated(Protocol):
    """What rows need of a configuration of ``T`` positions."""

    x: Array
    T: int

    @property
    def S(self) -> Array:
        """Twists of all freedoms ``(6, F, T)``."""

    @property
    def poses(self) -> Array:
        """Poses of all links ``(3, 4, N, T)``."""

    @property
    def chord_gaps(self) -> Array:
        """Closure errors of the chords at their pair points, ``(6, chords, T)``."""

    @property
    def loop_errors(self) -> Array:
        """Closure errors of the loops about their middles, stacked ``(6 loops, T)``."""

    @property
    def loop_jacobian(self) -> Array:
        """Twists of the freedoms in the rows of every loop, about its middle, ``(6 loops, F, T)``."""

    def pair_sums(self, terms: Array) -> Array:
        """``(6, F, T)`` -> ``(6, P, T)``."""

    def loop_sums(self, per_pair: Array) -> Array:
        """``(6, P, T)`` -> ``(6 loops, T)``."""


class PositionRows(Protocol):
    """``n`` closure rows ``phi(q) = 0`` of one contributor, evaluated at a configuration of ``T`` positions."""

    @property
    def scale(self) -> Array:
        """Factors ``(n, 1)`` or one a position by which each row was multiplied, from the user's relation in the user's units."""

    def residual(self, here: Evaluated) -> Array:
        """``phi (n, T)``."""

    def error(self, here: Evaluated) -> Array:
        """The closure error ``(T,)``: the largest angle, length over L, or scaled residual."""

    def jacobian(self, here: Evaluated) -> Array:
        """``J (n, F, T)`` with ``d phi/dt = J q'``."""

    def rates(self, here: Evaluated, dq: Array) -> Array:
        """``J q' (n, T)`` for rates ``dq (F, T)``."""


class Rows(PositionRows, Protocol):
    """Rows that serve accelerations, forces and the sparse engine as well."""

    def sparse_jacobian(self, t: int) -> scipy.sparse.csr_array | None:
        """``J (n, F)`` at one position, entries at the same places at all of them; None for loops (see ``closure.loop_rows``)."""

    def bias(self, here: Evaluated, pairs: Array) -> Array:
        """Velocity part ``(n, T)`` of ``d^2 phi/dt^2 = J q'' + bias``, from that of the relative accelerations of ``pairs (6, P, T)``."""

    def efforts(self, here: Evaluated, x: Array) -> Array | None:
        """``J^T x (F, k, T)`` for multipliers ``x (n, k, T)``; None where the rows act through pair wrenches, as loops do."""


class LoopRows:
    """Six rows a loop: the finite twist by which the loop is open, about its middle (the mean of its pair points), which moves with it.

    ``J`` and ``bias`` are the derivatives where the loops are closed and rates meet the rows, as the middle moves otherwise.
    """

    def __init__(self, n_loops: int) -> None:
        self.n_loops = n_loops

    @property
    def scale(self) -> Array:
        """Ones."""
        return np.ones((6 * self.n_loops, 1))

    def residual(self, here: Evaluated) -> Array:
        """Closure errors of the loops."""
        return here.loop_errors

    def error(self, here: Evaluated) -> Array:
        """Largest of angle and length / L over all chords."""
        if not self.n_loops:
            return np.zeros(here.T)
        gaps = here.chord_gaps
        angle, length = (np.sqrt(np.abs(part * part).sum(axis=0)).max(axis=0) for part in (gaps[:3], gaps[3:]))
        return np.maximum(angle, length)

    def jacobian(self, here: Evaluated) -> Array:
        """``(C x I6) diag(S_k)``."""
        return here.loop_jacobian

    def sparse_jacobian(self, t: int) -> None:
        """None: ``closure.loop_rows`` makes it."""

    def rates(self, here: Evaluated, dq: Array) -> Array:
        """``sum_k C_lk S_k q'_k``."""
        return here.loop_sums(here.pair_sums(here.S * dq))

    def bias(self, here: Evaluated, pairs: Array) -> Array:
        """The velocity parts of the relative accelerations, summed along the loops."""
        return here.loop_sums(pairs)

    def efforts(self, here: Evaluated, x: Array) -> None:
        """None: loops act through pair wrenches, ``Configuration.pair_wrenches``."""


class CouplingRows:
    """One row a coupling: a linear relation ``sum_j c_j q_j = constant`` between single freedoms.

    ``coefficients (K, B)`` of all terms stand in ``rows (K,)``, one after the other, and ``columns (K,)`` of the matrix; with ``constant
    (n, B)`` they are in internal coordinates (lengths over L), every row scaled so that its largest coefficient is one. B is 1, or one a
    position. Coordinates are those of the state (rows ``state_rows (F,)``): turns count on, they are not wrapped.
    """

    def __init__(
        self, coefficients: Array, rows: Index, columns: Index, constant: Array, scale: Array, state_rows: Index
    ) -> None:
        self.coefficients, self.constant, self.scale = coefficients, constant, scale
        self.term_rows, self.term_columns, self._state_rows = rows, columns, state_rows
        self._first = np.searchsorted(rows, np.arange(len(constant)))

    @cached_property
    def matrix(self) -> Array:
        """The coefficients ``(n, F, B)``."""
        out = np.zeros((len(self.constant), len(self._state_rows), self.coefficients.shape[1]))
        out[self.term_rows, self.term_columns] = self.coefficients
        return out

    def _sums(self, values: Array) -> Array:
        """``sum_j c_j v_j (n, T)`` of values ``(K, T)``, one a term."""
        return np.asarray(np.add.reduceat(self.coefficients * values, self._first, axis=0))

    def residual(self, here: Evaluated) -> Array:
        """``sum_j c_j q_j - constant``."""
        return self._sums(here.x[self._state_rows[self.term_columns]]) - self.constant

    def error(self, here: Evaluated) -> Array:
        """The largest of them."""
        return np.asarray(np.abs(self.residual(here)).max(axis=0))

    def jacobian(self, here: Evaluated) -> Array:
        """The coefficients."""
        return np.broadcast_to(self.matrix, (*self.matrix.shape[:2], here.T))

    def sparse_jacobian(self, t: int) -> scipy.sparse.csr_array:
        """The coefficients ``(n, F)`` at one position, entries at the same places at all of them."""
        values = self.coefficients[:, t if self.coefficients.shape[1] > 1 else 0]
        return scipy.sparse.csr_array((values, (self.term_rows, self.term_columns)), shape=self.matrix.shape[:2])

    def rates(self, here: Evaluated, dq: Array) -> Array:
        """``sum_j c_j q'_j``."""
        return self._sums(dq[self.term_columns])

    def bias(self, here: Evaluated, pairs: Array) -> Array:
        """Zero: the relation is linear."""
        return np.zeros((len(self.constant), here.T), dtype=pairs.dtype)

    def efforts(self, here: Evaluated, x: Array) -> Array:
        """``c_j x`` in every freedom."""
        return np.asarray(np.einsum("rft,rkt->fkt", self.matrix, x))
