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
        self.axes = list(np.eye(3))
        self.lines: list[tuple[Array, Array]] = []

    def direction(self, z: Array) -> Array:
        """The direction made exact; kept for the next ones."""
        size = float(np.linalg.norm(z))
        z = z / size
        exact = z
        same = next((axis for axis in self.axes if np.linalg.norm(np.cross(axis, z)) <= FITS), None)
        if same is not None:
            exact = same * np.sign(same @ z)
        else:
            across = [axis for axis in self.axes if abs(axis @ z) <= FITS]
            if len(across) > 1:
                exact = np.cross(across[0], across[1])
                exact *= np.sign(exact @ z) / np.linalg.norm(exact)
            elif across:
                exact = z - (z @ across[0]) * across[0]
                exact /= np.linalg.norm(exact)
            if np.linalg.norm(np.cross(exact, z)) > FITS:
                exact = z
            self.axes.append(exact)
        self.largest = max(self.largest, float(np.linalg.norm(np.cross(exact, z))))
        return exact

    def on_line(self, p: Array, z: Array) -> Array:
        """The point moved onto a line of the same direction that passes it closely."""
        for q, axis in self.lines:
            off = (p - q) - ((p - q) @ axis) * axis
            if abs(axis @ z) > 1 - 1e-14 and np.linalg.norm(off) <= self.near:
                return p - off
        self.lines.append((p, z))
        return p
