"""The rows of the closure equations: every constraint contributes its own, a loop six, a coupling of freedoms one.

Rows of all contributors stand one below the other, in the order of ``System.rows``: the loops first. A new kind of constraint
implements the protocol ``Rows``; nothing else in the package knows how many rows there are or where they come from.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array

if TYPE_CHECKING:
    from mechgraph.closure.configuration import Configuration
    from mechgraph.closure.indexing import System


class Rows(Protocol):
    """``n`` closure rows ``phi(q) = 0`` of one contributor, evaluated at a configuration of ``T`` positions."""

    @property
    def scale(self) -> Array:
        """Factor ``(n,)`` by which each row was multiplied, from the user's relation in the user's units."""

    def residual(self, here: Configuration) -> Array:
        """``phi (n, T)``."""

    def error(self, here: Configuration) -> Array:
        """The closure error ``(T,)``: the largest angle, length over L, or scaled residual."""

    def jacobian(self, here: Configuration) -> Array:
        """``J (n, F, T)`` with ``d phi/dt = J q'``."""

    def rates(self, here: Configuration, dq: Array) -> Array:
        """``J q' (n, T)`` for rates ``dq (F, T)``."""

    def bias(self, here: Configuration, dq: Array, V: Array) -> Array:
        """Velocity part ``(n, T)`` of ``d^2 phi/dt^2 = J q'' + bias`` for rates ``dq`` and link twists ``V (6, N, T)``."""

    def efforts(self, here: Configuration, x: Array) -> Array | None:
        """``J^T x (F, k, T)`` for multipliers ``x (n, k, T)``; None where the rows act through pair wrenches, as loops do."""


class LoopRows:
    """Six rows a loop: the finite twist by which the loop is open."""

    def __init__(self, n_loops: int) -> None:
        self.n_loops = n_loops

    @property
    def scale(self) -> Array:
        """Ones."""
        return np.ones(6 * self.n_loops)

    def residual(self, here: Configuration) -> Array:
        """Closure errors of the loops."""
        return here.loop_errors

    def error(self, here: Configuration) -> Array:
        """Largest of angle and length / L over all chords."""
        if not self.n_loops:
            return np.zeros(here.T)
        e = here.chord_errors
        angle, length = (np.sqrt(np.abs(part * part).sum(axis=0)).max(axis=0) for part in (e[:3], e[3:]))
        return np.maximum(angle, length)

    def jacobian(self, here: Configuration) -> Array:
        """``(C x I6) diag(S_k)``."""
        return here.stacked(here.S)

    def rates(self, here: Configuration, dq: Array) -> Array:
        """``sum_k C_lk S_k q'_k``."""
        return here.loop_sums(here.pair_sums(here.S * dq))

    def bias(self, here: Configuration, dq: Array, V: Array) -> Array:
        """The velocity parts of the relative accelerations, summed along the loops."""
        return here.loop_sums(here.bias(dq, V))

    def efforts(self, here: Configuration, x: Array) -> None:
        """None: loops act through pair wrenches, ``Configuration.pair_wrenches``."""


class CouplingRows:
    """One row a coupling: a linear relation ``sum_j c_j q_j = constant`` between single freedoms.

    ``matrix (n, F)`` and ``constant (n,)`` are in internal coordinates (lengths over L), each row scaled so that its largest
    coefficient is one. Coordinates are those of the state: turns count on, they are not wrapped.
    """

    def __init__(self, matrix: Array, constant: Array, scale: Array, state_rows: NDArray[np.intp]) -> None:
        self.matrix, self.constant, self.scale = matrix, constant, scale
        self._used = np.flatnonzero(matrix.any(axis=0))
        self._state_rows = state_rows[self._used]
        self._part = matrix[:, self._used]

    def residual(self, here: Configuration) -> Array:
        """``sum_j c_j q_j - constant``."""
        return np.asarray(self._part @ here.x[self._state_rows] - self.constant[:, None])

    def error(self, here: Configuration) -> Array:
        """The largest of them."""
        return np.asarray(np.abs(self.residual(here)).max(axis=0))

    def jacobian(self, here: Configuration) -> Array:
        """The coefficients."""
        return np.broadcast_to(self.matrix[:, :, None], (*self.matrix.shape, here.T))

    def rates(self, here: Configuration, dq: Array) -> Array:
        """``sum_j c_j q'_j``."""
        return np.asarray(self._part @ dq[self._used])

    def bias(self, here: Configuration, dq: Array, V: Array) -> Array:
        """Zero: the relation is linear."""
        return np.zeros((len(self.matrix), here.T), dtype=dq.dtype)

    def efforts(self, here: Configuration, x: Array) -> Array:
        """``c_j x`` in every freedom."""
        return np.asarray(np.einsum("rf,rkt->fkt", self.matrix, x))


def coupling_rows(system: System, couplings: Sequence[Any], start: Mapping[str, float]) -> CouplingRows:
    """The rows of couplings with ``terms`` (freedom, coefficient) and a ``constant`` (None: its value at ``start``), user's units."""
    matrix = np.zeros((len(couplings), system.n_freedoms))
    for row, coupling in zip(matrix, couplings, strict=True):
        for name, coefficient in coupling.terms:
            pair, freedom = system.m.freedom(name)
            row[system.first_column[pair] + freedom] += coefficient
    at_start = matrix @ system.start_coordinates(start)
    given = [value if c.constant is None else c.constant for c, value in zip(couplings, at_start, strict=True)]
    matrix[:, system.is_length] *= system.par.L
    scale = 1.0 / np.abs(matrix).max(axis=1)
    return CouplingRows(matrix * scale[:, None], np.array(given) * scale, scale, system.single_rows)
