"""Interpolation between the nodes of a path: divided differences of values and sensitivities, evaluated for any number of positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.march import Node

WIDTH = 6
"""Most nodes through which one interpolation goes (each with value and rate)."""
STRAIGHT_ON = 1 - 1e-9
"""Cosine between two steps of the path above which interpolation goes across the node between them."""


@dataclass(frozen=True)
class Interpolation:
    """Hermite interpolation through the nodes beside an interval, as far as the path goes straight on.

    What lies off the chord between two nodes is added by the sensitivity to the drivers.
    """

    system: System
    nodes: Sequence[Node]
    rows: Index

    @cached_property
    def _place(self) -> Array:
        return np.array([n.at for n in self.nodes])

    @cached_property
    def _x(self) -> Array:
        return np.stack([n.x for n in self.nodes], axis=1)

    @cached_property
    def _Z(self) -> Array:
        return np.stack([n.Z for n in self.nodes], axis=2)

    @cached_property
    def _drive(self) -> Array:
        return np.stack([n.drive for n in self.nodes], axis=1)

    @cached_property
    def _slope(self) -> Array:
        """Driver values per path length of every interval, ``(d, n - 1)``."""
        return np.asarray(np.diff(self._drive, axis=1) / np.diff(self._place))

    def intervals(self, at: Array) -> tuple[Index, Index]:
        """Nodes left and right of places on the path."""
        last = len(self.nodes) - 1
        right = np.clip(np.searchsorted(self._place, at), min(1, last), last)
        return np.maximum(right - 1, 0), right

    def __call__(self, at: Array, values: Array) -> Array:
        """States ``(nx, T)`` at places ``at (T,)`` with driver values ``(d, T)``."""
        left, right = self.intervals(at)
        if len(self.nodes) == 1:
            dq = np.asarray((self._Z[:, :, left] * (values - self._drive[:, left])).sum(axis=1))
        else:
            dq = self._polynomial(left, at - self._place[left])
            off = values - (self._drive[:, left] + (at - self._place[left]) * self._slope[:, left])
            if np.abs(off).max(initial=0.0) > 0.0:
                u = (at - self._place[left]) / (self._place[right] - self._place[left])
                dq += (((1 - u) * self._Z[:, :, left] + u * self._Z[:, :, right]) * off).sum(axis=1)
        out = self.system.advance(self._x[:, left], dq)
        out[self.rows] = values
        return out

    def _polynomial(self, left: Index, at: Array) -> Array:
        """Increments ``(F, T)`` from the left nodes, by the Newton form ``c_0 + (s - z_0) (c_1 + (s - z_1) (c_2 + ...))``."""
        c, z = self._coefficients
        out = c[-1][:, left]
        for order in range(len(c) - 2, -1, -1):
            out *= at - z[order, left]
            out += c[order][:, left]
        return out

    @cached_property
    def _windows(self) -> list[tuple[Index, Index]]:
        """Intervals by the number of nodes through which they are interpolated, with these nodes ``(width, n)``, nearest first."""
        n = len(self.nodes)
        length = np.sqrt((self._slope * self._slope).sum(axis=0))
        unit = self._slope / np.where(length > 0, length, 1.0)
        same = np.array([a.choice == b.choice for a, b in zip(self.nodes[:-1], self.nodes[1:], strict=True)])
        breaks = np.flatnonzero(~(((unit[:, 1:] * unit[:, :-1]).sum(axis=0) > STRAIGHT_ON) & same[1:] & same[:-1])) + 1
        begin = np.concatenate([[0], breaks])[np.searchsorted(breaks, np.arange(n - 1), side="right")]
        end = np.concatenate([breaks, [n - 1]])[np.searchsorted(breaks, np.arange(n - 1), side="right")]
        width = np.minimum(WIDTH, end - begin + 1)
        out = []
        for w in np.unique(width):
            i = np.flatnonzero(width == w)
            first = np.clip(i - (w - 2) // 2, begin[i], end[i] - w + 1)
            names = first + np.arange(w)[:, None]
            order = np.argsort(np.abs(names - i - 0.25), axis=0, kind="stable")
            out.append((i, np.take_along_axis(names, order, axis=0)))
        return out

    @cached_property
    def _coefficients(self) -> tuple[Array, Array]:
        """Coefficients ``(2 width, F, n - 1)`` and places ``(2 width, n - 1)``, from the left node of each interval."""
        width = max(len(names) for _, names in self._windows)
        n = len(self.nodes) - 1
        c = np.zeros((2 * width, self._Z.shape[0], n))
        z = np.zeros((2 * width, n))
        for i, names in self._windows:
            c[: 2 * len(names), :, i], z[: 2 * len(names), i] = self._divided(i, names)
        return c, z

    def _divided(self, interval: Index, names: Index) -> tuple[Array, Array]:
        """Divided differences over double nodes ``names (w, n)`` for some intervals."""
        z = np.repeat(self._place[names] - self._place[interval], 2, axis=0)
        dq = self.system.difference(self._x[:, names], self._x[:, None, interval])
        rates = (self._Z[:, :, names] * self._slope[:, None, interval]).sum(axis=1)
        column = np.repeat(dq.swapaxes(0, 1), 2, axis=0)
        slopes = np.zeros((len(z) - 1, *column.shape[1:]))
        slopes[::2] = self.system.tangent(dq, rates).swapaxes(0, 1)
        coefficients = [column[0]]
        for order in range(1, len(z)):
            width = z[order:] - z[:-order]
            if order == 1:
                same = width == 0
                column = np.where(same[:, None], slopes, np.diff(column, axis=0) / np.where(same, 1.0, width)[:, None])
            else:
                column = np.diff(column, axis=0) / width[:, None]
            coefficients.append(column[0])
        return np.stack(coefficients), z
