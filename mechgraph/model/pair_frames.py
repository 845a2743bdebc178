"""Displacements of pairs between constant markers, and the columns of pair frames that twists and wrenches ask for.

A displacement about a constant screw between two constant poses is linear in ``1, sin q, 1 - cos q, q``, so its coefficients
are made once; of the frames inside a pair only those columns are computed that are used, zeros of the table left out.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mechgraph.algebra.se3 import Array, compose, quaternion_matrix, rotate, skew

if TYPE_CHECKING:
    from mechgraph.model.pair_type import PairType


def screw_coefficients(twist: Array) -> list[Array | None]:
    """Coefficients ``(3, 4, ...)`` of ``sin q``, ``1 - cos q`` and ``q`` in ``exp(q s) - 1``; None where they vanish.

    For a unit twist ``s = (w, v)``, ``|w|`` one or zero: ``[W | -W^2 v]``, ``[W^2 | W v]``, ``[0 | (1 + W^2) v]``, ``W = w^``.
    """
    W, v = skew(twist[:3]), twist[3:]
    W2 = np.stack([rotate(W, W[:, i]) for i in range(3)], axis=1)
    parts = [
        np.concatenate([W, -rotate(W2, v)[:, None]], axis=1),
        np.concatenate([W2, rotate(W, v)[:, None]], axis=1),
        np.concatenate([np.zeros_like(W), (v + rotate(W2, v))[:, None]], axis=1),
    ]
    return [part if part.any() else None for part in parts]


def _between(before: Array | None, linear: Array, after: Array | None) -> Array:
    """A linear part ``[M | m]`` of a displacement between two poses: ``before [M | m] after`` without the constant terms."""
    out = linear
    if before is not None:
        out = np.stack([rotate(before[:, :3], out[:, i]) for i in range(4)], axis=1)
    if after is not None:
        columns = [rotate(out[:, :3], after[:, i]) for i in range(4)]
        columns[3] = columns[3] + out[:, 3]
        out = np.stack(columns, axis=1)
    return out


@dataclass(frozen=True)
class Factor:
    """One factor of the displacements of ``n`` pairs: a single freedom, or a rotation of three.

    ``terms`` are the coefficients of ``sin q``, ``1 - cos q``, ``q`` alone and ``between`` those between the constant poses beside
    the factor, with the constant term ``rest``; a rotation (``terms`` None) has the poses ``before`` and ``after`` themselves.
    """

    terms: list[Array | None] | None
    between: list[Array | None]
    rest: Array | None
    before: Array | None
    after: Array | None

    def values(self, x: Array) -> list[Array]:
        """``sin q, 1 - cos q, q`` of states ``(1, n, T)``, or the rotation matrices of quaternions ``(4, n, T)``."""
        if self.terms is None:
            return [quaternion_matrix(x)]
        q = x[0]
        turns = self.terms[0] is not None
        return [np.sin(q), 1.0 - np.cos(q), q] if turns else [q, q, q]

    def pose(self, values: list[Array]) -> Array:
        """The factor with its constant poses, ``(3, 4, n, T)``."""
        if self.terms is None:
            out = np.zeros((3, 4, *values[0].shape[2:]))
            out[:, :3] = values[0]
            out = out if self.before is None else compose(self.before, out)
            return out if self.after is None else compose(out, self.after)
        rest = self.rest if self.rest is not None else np.eye(3, 4)[:, :, None, None]
        used = [(c, v) for c, v in zip(self.between, values, strict=True) if c is not None]
        out = used[0][0] * used[0][1]
        part = np.empty_like(out)
        for coefficient, value in used[1:]:
            np.multiply(coefficient, value, out=part)
            out += part
        out += rest
        return out


def factors_between(row: PairType, pitch: Array, before: Array, after: Array) -> list[Factor]:
    """The factors of ``before D(q) after`` for ``n`` pairs of one type: constant poses ``(3, 4, n, 1)`` (or ``T``)."""
    out = []
    for number, group in enumerate(row.factors):
        first = before if number == 0 else None
        last = after if number == len(row.factors) - 1 else None
        if len(group) > 1:
            out.append(Factor(None, [], None, first, last))
            continue
        freedom = row.freedoms[group[0]]
        twist = np.array(freedom.twist)[:, None, None] + np.array(freedom.per_pitch)[:, None, None] * pitch
        terms = screw_coefficients(twist)
        between = [None if term is None else _between(first, term, last) for term in terms]
        rest = compose(first, last) if first is not None and last is not None else first if last is None else last
        out.append(Factor(terms, between, rest, first, last))
    return out


def factor_values(row: PairType, factors: list[Factor], x: Array) -> list[list[Array]]:
    """``Factor.values`` of every factor for states ``(nx, n, T)``."""
    out, at = [], 0
    for group, factor in zip(row.factors, factors, strict=True):
        width = 1 if len(group) == 1 else 4
        out.append(factor.values(x[at : at + width]))
        at += width
    return out


def displaced(factors: list[Factor], values: list[list[Array]]) -> Array:
    """``before D(q) after``, ``(3, 4, n, T)``."""
    out = factors[0].pose(values[0])
    for factor, value in zip(factors[1:], values[1:], strict=True):
        out = compose(out, factor.pose(value))
    return out


class Frame:
    """A frame whose columns ``0, 1, 2`` (axes) and ``3`` (origin), ``(3, n, T)``, are computed when first asked for."""

    def __init__(self, make: Callable[[int], Array]) -> None:
        self._make = make
        self._columns: dict[int, Array] = {}

    def column(self, i: int) -> Array:
        """Axis ``i`` of the frame, or its origin for ``i = 3``."""
        if i not in self._columns:
            self._columns[i] = self._make(i)
        return self._columns[i]


def moved_marker(X: Array, marker: Array) -> Frame:
    """The frame ``X marker`` of constant markers ``(3, 4, n, 1)`` on links of pose ``X (3, 4, n, T)``."""

    def column(i: int) -> Array:
        out = X[:, 0] * marker[0, i]
        part = np.empty_like(out)
        for j in (1, 2):
            np.multiply(X[:, j], marker[j, i], out=part)
            out += part
        if i == 3:
            out += X[:, 3]
        return out

    return Frame(column)


def _stepped(parent: Frame, factor: Factor, values: list[Array]) -> Frame:
    """The frame after one factor: columns of the parent combined, zeros and ones of the table left out."""

    def entry(j: int, i: int) -> Array | float:
        if factor.terms is None:
            return values[0][j, i] if i < 3 else 0.0
        out: Array | float = 1.0 if i == j else 0.0
        for term, value in zip(factor.terms, values, strict=True):
            if term is not None and term[j, i].any():
                out = out + term[j, i] * value
        return out

    def column(i: int) -> Array:
        parts = [parent.column(3)] if i == 3 else []
        for j in range(3):
            e = entry(j, i)
            if isinstance(e, float):
                parts += [parent.column(j)] if e else []
            else:
                parts.append(parent.column(j) * e)
        return parts[0] if len(parts) == 1 else np.asarray(sum(parts[1:], start=parts[0]))

    return Frame(column)


def frames_along(row: PairType, factors: list[Factor], values: list[list[Array]], base: Frame) -> list[Frame]:
    """Frames 0, 1, ... of a pair from that of its marker A (see ``pair_evaluation.frames_of``)."""
    frames = [base]
    for group, factor, value in zip(row.factors, factors, values, strict=True):
        frames += [frames[-1]] * (len(group) - 1)
        frames.append(_stepped(frames[-1], factor, value))
    return frames
