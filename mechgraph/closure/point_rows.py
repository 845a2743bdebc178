"""Contacts as the rows that they are: two points at a distance from each other, a point in planes.

    rod:     |p_b - p_a| = l            n = (p_b - p_a) / |p_b - p_a|
    contact: n . (p_b - p_a) = 0        n fixed in link a

Both move by the relative twist of the links on the line of ``n`` through ``p_b``: ``phi' = W . (V_b - V_a)``, ``W = (p_b x n, n)``, the
reaction of a unit force. They serve positions; accelerations and forces are those of the loops.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mechgraph.algebra.se3 import Array, cross, rotate
from mechgraph.closure.rows import Evaluated, Index


@dataclass(frozen=True)
class PointNumbers:
    """Rows of points, rods first: links ``a, b (n,)``, points ``at_a, at_b (3, n, B)`` in their frames, lengths of rods ``(rods, B)`` and
    normals ``(3, n - rods, B)`` of the others in link a.
    ``slide (rods,)``: the pair that makes a rod longer, with its ``sense (rods, 1)``; -1 where there is none.
    """

    a: Index
    b: Index
    at_a: Array
    at_b: Array
    length: Array
    normal: Array
    slide: Index
    sense: Array

    def taken(self, cases: Index) -> PointNumbers:
        """The numbers of some variants; of one, itself."""
        names = ("at_a", "at_b", "length", "normal")
        arrays = {name: getattr(self, name) for name in names}
        return replace(self, **{k: v[..., cases] if v.shape[-1] > 1 else v for k, v in arrays.items()})


class PointRows:
    """The rows of ``numbers`` (implements ``closure.rows.PositionRows``); ``way (n, F)``: the freedoms between both links, with signs."""

    def __init__(self, numbers: PointNumbers, way: Array, columns: Index, rows: Index) -> None:
        self.numbers, self.way = numbers, way
        self._slides = np.flatnonzero(columns >= 0)
        self._columns, self._rows = columns[self._slides], rows[self._slides]

    def lengths(self, here: Evaluated) -> Array:
        """Lengths of the rods ``(rods, T)``."""
        k = self.numbers
        if not self._slides.size:
            return k.length
        out = np.repeat(k.length, here.T // k.length.shape[1], axis=1)
        out[self._slides] += k.sense[self._slides] * here.x[self._rows]
        return out

    @property
    def scale(self) -> Array:
        """Ones."""
        return np.ones((len(self.way), 1))

    def lines(self, here: Evaluated) -> tuple[Array, Array]:
        """``phi (n, T)`` and ``W (6, n, T)``."""
        k, rods = self.numbers, len(self.numbers.length)
        A, B = here.poses.take(k.a, axis=2), here.poses.take(k.b, axis=2)
        p = rotate(B[:, :3], k.at_b) + B[:, 3]
        d = p - rotate(A[:, :3], k.at_a) - A[:, 3]
        n, phi = np.empty_like(d), np.empty(d.shape[1:], dtype=d.dtype)
        size = np.sqrt((d[:, :rods] * d[:, :rods]).sum(axis=0))
        n[:, :rods], phi[:rods] = d[:, :rods] / size, size - self.lengths(here)
        n[:, rods:] = rotate(A[:, :3, rods:], k.normal)
        phi[rods:] = (n[:, rods:] * d[:, rods:]).sum(axis=0)
        return phi, np.concatenate([cross(p, n), n])

    def residual(self, here: Evaluated) -> Array:
        """``phi (n, T)``."""
        return self.lines(here)[0]

    def error(self, here: Evaluated) -> Array:
        """The largest of them."""
        return np.asarray(np.abs(self.residual(here)).max(axis=0, initial=0.0))

    def jacobian(self, here: Evaluated) -> Array:
        """``W . S`` in the freedoms between both links."""
        W = self.lines(here)[1].transpose(2, 1, 0) @ here.S.transpose(2, 0, 1)
        W *= self.way
        W[:, self._slides, self._columns] -= self.numbers.sense[self._slides, 0]
        return W.transpose(1, 2, 0)

    def rates(self, here: Evaluated, dq: Array) -> Array:
        """``J q'``."""
        return np.asarray((self.jacobian(here) * dq).sum(axis=1))
