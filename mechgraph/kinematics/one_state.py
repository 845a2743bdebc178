"""One state of a small mechanism: poses, closure and Jacobian of the loops by a few products of whole matrices.

``Configuration`` takes a call for every kind of factor, level of the tree and part of a screw, and of one state calls are all the
cost. Here the poses of all steps are one product of a constant matrix with the values of the factors, and all that the loops need of
the poses of the nodes, which is linear in them, is another. These matrices grow with the square of the number of nodes.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mechgraph.kinematics.batches import FactorBatch, Numbers
from mechgraph.kinematics.layout import Places
from mechgraph.maths.se3 import LEFT_FACTORS, RIGHT_FACTORS, Array, Index, finite_twist, homogeneous, skew

DIFFERENCES = np.concatenate([np.eye(3), -np.eye(3)])
"""From the six products of a vector product to its components."""
FEW_NODES = 24
"""Nodes up to which whole matrices are faster (measured)."""


class OneStateMatrices:
    """The constant matrices: ``poses (16 steps, values)``, and ``loops (3 K + 2 C, 4 nodes)`` for ``K`` entries of ``L`` loops.

    Poses are transposed, ``(nodes, 4, 4)``, so that a row of ``loops`` makes a vector of them: turns and displacements of the entries,
    each with its sign, arms from the middles of their loops to their nodes, and from the middle of a loop to both nodes that one of its
    ``C`` chords closes. ``middles (L, 4 nodes)`` are those of the loops, component by component.
    """

    def __init__(self, s: Places, numbers: Numbers, middles: Array) -> None:
        parents, e = s.walk.parents, s.entries
        self.nodes, self.entries = n, K = len(parents) + 1, len(e.column)
        self.batches = [(b.stack, b.state_rows) for b in s.batches]
        parts = [_placed(C, b.steps, n - 1) for b, (C, _) in zip(s.batches, numbers.poses, strict=True)]
        self.poses, self.frame = np.hstack(parts), homogeneous(numbers.par.frame)[:, :, 0].T
        self.products = [(step + 1, parent) for step, parent in enumerate(parents.tolist()) if parent]
        signs = s.graph.loop_matrix[:, s.chords]
        loop, chord = signs.nonzero()
        # a chord against its loop is closed from the other end
        self.ends = np.where(signs[loop, chord] > 0, *np.stack([s.chord_nodes, s.chord_nodes[::-1]])[:, :, chord])
        self.sums = None if len(loop) == len(signs) else np.eye(len(signs))[:, loop]
        nodes, each, twists = s.column_nodes[e.column], np.arange(K), numbers.twists[:, :, e.column, 0] * e.sign
        rows = np.zeros((3 * K + 2 * len(loop), n, 4), dtype=np.result_type(twists, middles))
        rows[each, nodes, :3], rows[K + each, nodes, :3] = twists.transpose(1, 2, 0)
        rows[2 * K :] = -middles.reshape(-1, 4, n).swapaxes(1, 2)[np.concatenate([e.loop, loop, loop])]
        rows[np.arange(2 * K, len(rows)), np.concatenate([nodes, *self.ends]), 3] += 1.0
        self.loops = rows.reshape(len(rows), 4 * n)
        self.moving = [_Moving(s, numbers, b) for b in s.moving_batches]


class _Moving:
    """Factors whose twists move: ``at`` which entries they stand, from which ``nodes`` seen, and what takes their twists there with the
    signs of the entries, ``(k, 6, 6)``.
    """

    def __init__(self, s: Places, numbers: Numbers, b: FactorBatch) -> None:
        self.stack, self.state_rows, self.pitch = b.stack, b.state_rows, numbers.par.pitch[b.pairs]
        self.at, self.freedom, self.member = np.nonzero(s.entries.column[:, None, None] == b.columns)
        self.nodes = s.column_nodes[s.entries.column[self.at]]
        X = numbers.marker_a_if_first(b)[..., 0]
        moved = np.zeros((6, 6, X.shape[2]), dtype=X.dtype)
        moved[:3, :3] = moved[3:, 3:] = X[:, :3]
        moved[3:, :3] = np.einsum("ijn,jkn->ikn", skew(X[:, 3]), X[:, :3])
        self.moved = np.moveaxis(moved[:, :, self.member] * s.entries.sign[self.at], -1, 0)

    def entries(self, x: Array, X: Array) -> Array:
        """Turns and displacements ``(k, 2, 3)`` about the nodes at a state, poses ``X`` of nodes transposed."""
        S = self.stack.twists(x.take(self.state_rows, axis=0), self.pitch)[:, self.freedom, self.member, 0]
        return np.asarray((self.moved @ S.T[..., None]).reshape(-1, 2, 3) @ X[self.nodes, :3, :3])


def _placed(C: Array, steps: Index, n: int) -> Array:
    """Coefficients ``(k, 16, m)`` of the poses of ``k`` of ``n`` steps as columns ``(16 n, m k)``, poses transposed."""
    k, _, m = C.shape
    out = np.zeros((n, 4, 4, m, k), dtype=C.dtype)
    out[steps, :, :, :, np.arange(k)] = C.reshape(k, 4, 4, m).swapaxes(1, 2)
    return out.reshape(16 * n, m * k)


class OneState:
    """A state ``x (nx, 1)`` evaluated by these matrices."""

    def __init__(self, by: OneStateMatrices, x: Array) -> None:
        self._by, self._x = by, x
        values = [stack.values(x.take(rows, axis=0)).reshape(-1) for stack, rows in by.batches]
        steps = by.poses.dot(values[0] if len(values) == 1 else np.concatenate(values)).reshape(-1, 4, 4)
        self._X = X = np.empty((by.nodes, 4, 4), dtype=steps.dtype)
        X[0], X[1:] = by.frame, steps
        for node, parent in by.products:
            X[node] = X[node].dot(X[parent])

    @property
    def nodes(self) -> Array:
        """Poses of the nodes ``(3, 4, nodes, 1)``."""
        return np.ascontiguousarray(self._X.transpose(2, 1, 0)[:3, ..., None])

    @cached_property
    def _vectors(self) -> Array:
        """What the rows of ``loops`` make ``(3 K + 2 C, 4)``."""
        return np.asarray(self._by.loops.dot(self._X.reshape(-1, 4)))

    @property
    def loop_errors(self) -> Array:
        """Closure errors of the loops, about their middles, stacked ``(6 loops, 1)``."""
        by = self._by
        reached, declared = self._X.take(by.ends, axis=0)[..., :3, :3]
        to, start = self._vectors[3 * by.entries :, :3].T.reshape(3, 2, -1, 1).swapaxes(0, 1)
        R = (reached.swapaxes(1, 2) @ declared).transpose(1, 2, 0)
        errors = finite_twist(R[..., None], to, start)
        return (errors if by.sums is None else by.sums @ errors).swapaxes(0, 1).reshape(-1, 1)

    @property
    def entries(self) -> Array:
        """Twists of the freedoms along the loops, about the middle of each, with their signs, ``(6, K, 1)``."""
        K, vectors = self._by.entries, self._vectors
        for part in self._by.moving:
            found = part.entries(self._x, self._X)
            vectors[part.at, :3], vectors[K + part.at, :3] = found[:, 0], found[:, 1]
        turns, arms = vectors[:K], vectors[2 * K : 3 * K]
        products = arms.take(LEFT_FACTORS, 1) * turns.take(RIGHT_FACTORS, 1)
        out = np.empty((K, 6), dtype=vectors.dtype)
        out[:, :3] = turns[:, :3]
        np.add(vectors[K : 2 * K, :3], products.dot(DIFFERENCES), out=out[:, 3:])
        return out.T[..., None]
