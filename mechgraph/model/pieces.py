"""Polynomials in pieces, with their derivatives: what splines, cams and arc lengths are evaluated by."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mechgraph.algebra.se3 import Array

DERIVATIVES = 4
"""The highest derivative that is asked for."""


@dataclass(frozen=True)
class Pieces:
    """Polynomials ``(degree + 1, pieces, ...)``, highest power first, between ``breaks``: evaluated for complex arguments too.

    ``orders``: of how many, the value and its derivatives, the coefficients are kept.
    """

    breaks: Array
    coefficients: Array
    orders: int = DERIVATIVES + 1

    @cached_property
    def _terms(self) -> Array:
        """Coefficients of value and derivatives, ``(pieces, orders, components, degree + 1)``, lowest power first."""
        c = self.coefficients[::-1].reshape(len(self.coefficients), len(self.breaks) - 1, -1)
        return np.ascontiguousarray(derivatives(c, self.orders).transpose(2, 0, 3, 1))

    def at(self, u: Array) -> Array:
        """Values and derivatives ``(orders, ..., *u.shape)``; of the first and last piece beyond the ends."""
        flat = u.reshape(-1)
        piece = self.breaks[1:-1].searchsorted(flat.real, side="right")
        terms = self._terms.take(piece, axis=0)
        powers = np.empty((flat.size, terms.shape[3]), dtype=u.dtype)
        powers[:, 0] = 1.0
        powers[:, 1:] = (flat - self.breaks[piece])[:, None]
        np.multiply.accumulate(powers, axis=1, out=powers)
        out = (terms @ powers[:, None, :, None])[..., 0].transpose(1, 2, 0)
        return np.asarray(out.reshape(self.orders, *self.coefficients.shape[2:], *u.shape))

    @classmethod
    def meeting(cls, breaks: Array, values: Sequence[Array], orders: int = DERIVATIVES + 1) -> Pieces:
        """The polynomials that meet values and derivatives ``(n, ...)`` at the breaks."""
        ends = [y[:-1] for y in values], [y[1:] for y in values]
        return cls(np.asarray(breaks), hermite(np.diff(breaks), *ends)[::-1], orders)


def derivatives(c: Array, orders: int) -> Array:
    """Coefficients of polynomials ``c (degree + 1, ...)``, lowest power first, and of their derivatives, ``(orders, degree + 1, ...)``."""
    out = np.zeros((orders, *c.shape))
    for order in range(orders):
        for power in range(order, len(c)):
            out[order, power - order] = math.perm(power, order) * c[power]
    return out


def hermite(length: Array, begin: Sequence[Array], end: Sequence[Array]) -> Array:
    """The polynomials over ``(0, length (n,))`` that meet ``k`` values and derivatives ``(n, ...)`` at both ends, ``(2 k, n, ...)``.

    Coefficients, lowest power first: the lower half is Taylor's series at the beginning, the upper half follows from the end.
    """
    k, h = len(begin), length.reshape(-1, *(1,) * (begin[0].ndim - 1))
    low, there = (np.stack([h**j / math.factorial(j) * y for j, y in enumerate(values)]) for values in (begin, end))
    choose = np.array([[math.comb(m, j) for m in range(2 * k)] for j in range(k)], dtype=float)
    high = np.tensordot(np.linalg.inv(choose[:, k:]), there - np.tensordot(choose[:, :k], low, 1), 1)
    return np.concatenate([low, high]) / np.stack([h**m for m in range(2 * k)])


def parted(breaks: Array, parts: int) -> Array:
    """Every interval in equal parts."""
    fine = breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(parts) / parts
    return np.append(fine.ravel(), breaks[-1])
