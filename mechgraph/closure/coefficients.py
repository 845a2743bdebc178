"""The numbers of a mechanism as the kernel multiplies them: coefficients of the poses of all factors, screws in their frames."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np

from mechgraph.algebra.se3 import Array, cross, homogeneous, identity, inverse
from mechgraph.closure.batches import FactorBatch, Index, ScrewTable
from mechgraph.closure.tree import Walk
from mechgraph.model.parameters import Parameters

MARKER_A, MARKER_B = range(2)
"""Order of the constant poses in ``Numbers.constants``, after the identity."""
FACTORS_AT_ONCE = 2048
"""Factors whose coefficients are multiplied with their markers at once: what lies between stays in the cache."""


class Numbers:
    """Coefficients of poses and screws of a system, from its parameters; a trailing batch axis of length 1, or one a variant.

    ``for_one``: whether one state alone is evaluated, for which the coefficients of the poses are not kept.
    """

    def __init__(
        self,
        par: Parameters,
        walk: Walk,
        batches: Sequence[FactorBatch],
        n_factors: Index,
        n_freedoms: int,
        for_one: bool = False,
    ) -> None:
        self.par, self.walk, self.batches, self.for_one = par, walk, batches, for_one
        self.n_factors, self.n_freedoms = n_factors, n_freedoms
        self.n_pairs = len(n_factors)

    def taken(self, par: Parameters, which: Index) -> Numbers:
        """Those of some variants, with their parameters."""
        out = Numbers(par, self.walk, self.batches, self.n_factors, self.n_freedoms, self.for_one)
        vars(out).update(constants=_of(self.constants, which), twists=_of(self.twists, which))
        vars(out)["poses"] = [
            (_of(C, which) if C.ndim == 4 else C, beside and (_of(beside[0], which), _of(beside[1], which)))
            for C, beside in self.poses
        ]
        return out

    @cached_property
    def constants(self) -> Array:
        """Constant poses ``(3, 4, 1 + 2 P, B)``: the identity, markers A, markers B."""
        A, B = self.par.marker_a, self.par.marker_b
        batch = np.broadcast_shapes(A.shape[3:], B.shape[3:])[0]
        out = np.empty((3, 4, 1 + 2 * self.n_pairs, batch), dtype=np.result_type(A, B))
        out[:, :, :1], out[:, :, 1 : 1 + self.n_pairs], out[:, :, 1 + self.n_pairs :] = identity(1, 1), A, B
        return out

    @cached_property
    def is_real(self) -> bool:
        """Whether no parameter is complex."""
        return not any(np.iscomplexobj(part) for part in (self.constants, self.par.pitch, self.par.frame))

    @cached_property
    def poses(self) -> list[tuple[Array, tuple[Array, Array] | None]]:
        """For every batch of factors the coefficients of the poses of its steps with the markers beside them, seen from the nodes
        from which the steps start (from the global frame where that is the frame link).

        For one mechanism the markers are part of the coefficients, ``(n, 16, m)`` for a product of matrices. For variants, of
        which each has few positions, they stay beside them, ``(4, 4, n, B)``, and where pitches vary coefficients are
        ``(16, m, n, B)``.
        """
        out: list[tuple[Array, tuple[Array, Array] | None]] = []
        for b in self.batches:
            if self.constants.shape[3] == 1 and self.par.pitch.shape[1] == 1:
                out.append((self._folded(b), None))
                continue
            C, left, right = self._coefficients(b), *self._beside(b)
            C = C.reshape(16, *C.shape[2:])
            out.append((np.ascontiguousarray(C[..., 0].transpose(2, 0, 1)) if C.shape[3] == 1 else C, (left, right)))
        return out

    def parts(self) -> Iterator[tuple[FactorBatch, Array, tuple[Array, Array] | None]]:
        """The factors with their coefficients and the poses beside them, see ``poses``: whole batches, or few factors at once."""
        if not self.for_one:
            yield from ((b, *pose) for b, pose in zip(self.batches, self.poses, strict=True))
            return
        for b in self.batches:
            for i in range(0, len(b.pairs), FACTORS_AT_ONCE):
                part = b.part(slice(i, i + FACTORS_AT_ONCE))
                C = self._coefficients(part)
                yield part, C.reshape(16, *C.shape[2:]), self._beside(part)

    def _coefficients(self, b: FactorBatch) -> Array:
        """Coefficients ``(4, 4, m, n, B)`` of the poses of a batch in the sense of the walk."""
        return b.stack.coefficients(self.par.pitch[b.pairs], np.asarray(self.walk.back[b.steps], dtype=bool))

    def _folded(self, b: FactorBatch) -> Array:
        """The same with the markers beside them, ``(n, 16, m)``, of one mechanism."""
        n = len(b.pairs)
        if n > FACTORS_AT_ONCE:
            first = self._folded(b.part(slice(0, FACTORS_AT_ONCE)))
            out = np.empty((n, *first.shape[1:]), dtype=first.dtype)
            out[:FACTORS_AT_ONCE] = first
            for i in range(FACTORS_AT_ONCE, n, FACTORS_AT_ONCE):
                out[i : i + FACTORS_AT_ONCE] = self._folded(b.part(slice(i, i + FACTORS_AT_ONCE)))
            return out
        C = self._coefficients(b)[..., 0]
        left, right = self._beside(b)
        C = np.einsum("acmn,cdn->admn", np.einsum("abn,bcmn->acmn", left[..., 0], C), right[..., 0])
        return np.ascontiguousarray(C.reshape(16, *C.shape[2:]).transpose(2, 0, 1))

    def _beside(self, b: FactorBatch) -> tuple[Array, Array]:
        """Constant poses before and behind the factors of a batch in the sense of the walk, homogeneous ``(4, 4, n, B)``."""
        n, last = self.n_pairs, np.maximum(self.n_factors, 1) - 1
        back, begins, ends = self.walk.back[b.steps], b.ranks == 0, b.ranks == last[b.pairs]
        at_a, at_b = begins * (1 + MARKER_A * n + b.pairs), ends * (1 + MARKER_B * n + b.pairs)
        before = homogeneous(self.constants.take(np.where(back, at_b, at_a), axis=2))
        behind = homogeneous(inverse(self.constants.take(np.where(back, at_a, at_b), axis=2)))
        starts = self.walk.parents[b.steps] == 0
        before[:, :, starts] = np.einsum("abt,bcnt->acnt", homogeneous(self.par.frame), before[:, :, starts])
        return before, behind

    @cached_property
    def twists(self) -> Array:
        """Twists of all freedoms in their nodes, bound and free part ``(3, 2, F, B)``; zero for those that move."""
        batch = np.broadcast_shapes(self.constants.shape[3:], self.par.pitch.shape[1:])[0]
        out = np.zeros((3, 2, self.n_freedoms, batch), dtype=np.result_type(self.constants, self.par.pitch))
        for b in self.batches:
            S = b.stack.constant_twists(self.par.pitch[b.pairs])
            if S is not None:
                self.place_twists(out, b, S)
        return out

    def place_twists(self, out: Array, b: FactorBatch, S: Array) -> None:
        """Twists ``(6, f, n, T)`` in the frames before the factors of a batch, written into ``out (3, 2, F, T)`` in their nodes."""
        X = self.marker_a_if_first(b)
        for j, columns in enumerate(b.columns):
            out[:, 0, columns] = np.einsum("ijnt,jnt->int", X[:, :3], S[:3, j])
            out[:, 1, columns] = np.einsum("ijnt,jnt->int", X[:, :3], S[3:, j])
            out[:, 1, columns] += cross(X[:, 3], out[:, 0, columns])

    def marker_a_if_first(self, b: FactorBatch) -> Array:
        """The frames before the factors of a batch in their nodes ``(3, 4, n, B)``: markers A before the first ones of pairs."""
        return self.constants[:, :, np.where(b.ranks == 0, 1 + MARKER_A * self.n_pairs + b.pairs, 0)]

    def components(self, table: ScrewTable) -> Array:
        """Wrenches of a table in their nodes, moment and force ``(3, 2, K, B)``; without arms where they act at markers B."""
        batch = np.broadcast_shapes(self.constants.shape[3:], self.par.pitch.shape[1:])[0]
        out = np.empty((3, 2, len(table.pairs), batch), dtype=np.result_type(self.constants, self.par.pitch))
        for i in range(0, len(table.pairs), FACTORS_AT_ONCE):
            self._place_components(table.taken(slice(i, i + FACTORS_AT_ONCE)), out[:, :, i : i + FACTORS_AT_ONCE])
        return out

    def _place_components(self, table: ScrewTable, out: Array) -> None:
        X = self.constants[:, :, table.const]
        free = table.free[..., None] + table.per_pitch[..., None] * self.par.pitch[table.pairs]
        out[:, 0] = np.einsum("ijkt,jkt->ikt", X[:, :3], free)
        out[:, 1] = np.einsum("ijkt,jk->ikt", X[:, :3], table.bound)
        out[:, 0] += np.where(table.at_b[:, None], 0.0, cross(X[:, 3], out[:, 1]))

    @cached_property
    def ends(self) -> Array:
        """Origins of the markers B in the frames of their links b, ``(3, 1, P, B)``."""
        return self.par.marker_b[:, None, 3]


def _of(values: Array, which: Index) -> Array:
    """Some variants of a batch; of a batch of one, itself."""
    return values.take(which, axis=-1) if values.shape[-1] > 1 else values
