"""Directions and lines of CAD, which have few digits: those that are nearly parallel, perpendicular or one are made so exactly."""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array

FITS = 1e-5
"""Angle [rad] and length / L to which markers count as meant to fit: OndselSolver closes to 1e-6, placements may have fewer digits."""


class Snapping:
    """Directions and lines met so far; a new one that is nearly parallel or perpendicular to them, or nearly the same, is made so."""

    def __init__(self, near: float) -> None:
        self.near, self.largest = near, 0.0
        self.axes = np.eye(3)
        self.points, self.along = np.zeros((0, 3)), np.zeros((0, 3))

    def direction(self, z: Array) -> Array:
        """The direction made exact; a new one is kept for the next ones."""
        z = z / float(np.linalg.norm(z))
        cosines = self.axes @ z
        nearest = int(np.argmax(np.abs(cosines)))
        if np.linalg.norm(np.cross(self.axes[nearest], z)) <= FITS:
            exact = self.axes[nearest] * np.sign(cosines[nearest])
        else:
            exact = self._perpendicular(z, self.axes[np.abs(cosines) <= FITS])
            self.axes = np.vstack([self.axes, exact])
        self.largest = max(self.largest, float(np.linalg.norm(np.cross(exact, z))))
        return exact

    def _perpendicular(self, z: Array, across: Array) -> Array:
        """The direction made perpendicular to the first two of ``across``; unchanged where that turns it by more than ``FITS``."""
        if not len(across):
            return z
        exact = np.cross(across[0], across[1]) if len(across) > 1 else z - (z @ across[0]) * across[0]
        exact = exact / (np.linalg.norm(exact) or 1.0) * np.sign(exact @ z)
        return exact if np.linalg.norm(np.cross(exact, z)) <= FITS and exact.any() else z

    def on_line(self, p: Array, z: Array) -> Array:
        """The point moved onto a line of the same direction that passes it closely."""
        away = p - self.points
        away = away - (away * self.along).sum(axis=1, keepdims=True) * self.along
        same = (np.abs(self.along @ z) > 1 - 1e-14) & (np.linalg.norm(away, axis=1) <= self.near)
        if same.any():
            return np.asarray(p - away[int(np.argmax(same))])
        self.points, self.along = np.vstack([self.points, p]), np.vstack([self.along, z])
        return p
