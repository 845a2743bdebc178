"""Coordinates of pairs as states: one number for a single freedom, a unit quaternion for a rotation of three."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mechgraph.algebra.se3 import Array, turn_between, turn_tangent, turned
from mechgraph.closure.batches import Index
from mechgraph.closure.places import Places, shared
from mechgraph.numerics.linear import Place, compact
from mechgraph.pairs import kinematics as evaluation


class States(Places):
    """States ``(nx, ...)`` of a mechanism, and increments ``(F, ...)`` between them."""

    @shared
    def single_rows(self) -> Index:
        """For every freedom its row in the state, -1 for those of rotations."""
        out = np.full(self.n_freedoms, -1, dtype=np.intp)
        for g in self.groups:
            for factor, (columns, rows) in zip(g.row.steps, evaluation.places(g.row), strict=True):
                if not factor.holds_rotation:
                    out[g.columns[columns]] = g.state_rows[rows]
        return out

    @shared
    def _singles(self) -> tuple[Place, Place]:
        """Columns and state rows of the single freedoms."""
        columns = np.flatnonzero(self.single_rows >= 0)
        return compact(columns), compact(self.single_rows[columns])

    @shared
    def rotations(self) -> tuple[Index, Index] | None:
        """Columns ``(3, n)`` and state rows ``(4, n)`` of the rotations; None where there are none."""
        parts = [
            (g.columns[columns], g.state_rows[rows])
            for g in self.groups
            for factor, (columns, rows) in zip(g.row.steps, evaluation.places(g.row), strict=True)
            if factor.holds_rotation
        ]
        if not parts:
            return None
        columns, rows = (np.concatenate(part, axis=1) for part in zip(*parts, strict=True))
        return columns, rows

    def state_of(self, coordinates: Array) -> Array:
        """State ``(nx, T)`` from user coordinates ``(F, T)`` (lengths in the user's units)."""
        q = np.where(self.is_length[:, None], coordinates / self.par.L, coordinates)
        x = np.empty((self.n_state, q.shape[1]), dtype=q.dtype)
        for g in self.groups:
            x[g.state_rows] = evaluation.coordinates_to_state(g.row, q[g.columns])
        return x

    def coordinates_of(self, x: Array, start: Array | None = None) -> Array:
        """User coordinates ``(F, ..., T)`` of states ``(nx, ..., T)``; rotation vectors continued along the last axis."""
        q = np.empty((self.n_freedoms, *x.shape[1:]), dtype=x.dtype)
        for g in self.groups:
            near = None if start is None else start[g.columns]
            q[g.columns] = evaluation.state_to_coordinates(g.row, x[g.state_rows], near)
        q[self.is_length] *= self.par.L
        return q

    def in_user_units(self, gained: Array) -> Array:
        """Amounts ``(F, ...)`` in the units of the user."""
        return gained * np.where(self.is_length, self.par.L, 1.0).reshape(-1, *(1,) * (gained.ndim - 1))

    def start_coordinates(self, start: Mapping[str, float]) -> Array:
        """User coordinates ``(F,)`` from a mapping freedom -> value, zero elsewhere."""
        q = np.zeros(self.n_freedoms)
        for name, value in start.items():
            k, j = self.m.freedom(name)
            q[self.first_column[k] + j] = value
        return q

    def advance(self, x: Array, dq: Array) -> Array:
        """States after increments ``dq (F, ...)``."""
        columns, rows = self._singles
        singles = x[rows] + dq[columns]
        if self.rotations is None and isinstance(rows, slice):
            return np.asarray(singles)
        out = np.empty((self.n_state, *singles.shape[1:]), dtype=singles.dtype)
        out[rows] = singles
        if self.rotations is not None:
            turns, rows = self.rotations
            out[rows] = turned(x[rows], dq[turns])
        return out

    def difference(self, x1: Array, x0: Array) -> Array:
        """Increments ``(F, ...)`` from ``x0`` to ``x1``."""
        columns, rows = self._singles
        singles = x1[rows] - x0[rows]
        if self.rotations is None:
            return np.asarray(singles)
        out = np.empty((self.n_freedoms, *singles.shape[1:]), dtype=singles.dtype)
        out[columns] = singles
        turns, rows = self.rotations
        out[turns] = turn_between(x1[rows], x0[rows])
        return out

    def tangent(self, dq: Array, rates: Array) -> Array:
        """Rates of increments ``dq (F, ...)`` at the state that they lead to, from the rates of the freedoms there."""
        if self.rotations is None:
            return rates
        out, (turns, _) = rates.copy(), self.rotations
        out[turns] = turn_tangent(dq[turns], rates[turns])
        return out
