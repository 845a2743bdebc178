"""A FreeCAD assembly as its parts stand, with what is found wrong with it and what is taken otherwise while it is read."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field

import numpy as np

from mechgraph.algebra.se3 import Array, compose, inverse
from mechgraph.errors import listed
from mechgraph.exchange.asmt import Assembly, Connection, Part
from mechgraph.exchange.exact import FITS
from mechgraph.quantities import shown

UNMENTIONED = 1e-12
"""Corrections up to here are not worth a word."""


@dataclass
class Standing:
    """Collects what is wrong (``faults``) and what was taken otherwise than it stands (``notes``, markers that were ``moved``)."""

    assembly: Assembly
    faults: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    moved: dict[str, tuple[float, float]] = field(default_factory=dict)

    def part(self, name: str) -> Part:
        """The part, or the ground."""
        return self.assembly.parts.get(name, self.assembly.ground)

    def ends(self, found: Connection) -> tuple[str, str] | None:
        """The parts of the two markers; None, and a fault, where a marker is not there."""
        markers = self.assembly.markers
        missing = [path for path in (found.i, found.j) if path not in markers]
        if missing:
            known = listed(markers, 8)
            self.faults.append(
                f"{found.title}: there is no marker {', '.join(map(shown, missing))} (there are: {known})"
            )
            return None
        return markers[found.i].part, markers[found.j].part

    def pose(self, marker: str) -> Array:
        """A marker in the assembly, where the parts stand."""
        found = self.assembly.markers[marker]
        return compose(self.part(found.part).pose, found.pose)

    def own(self, part: str, X: Array) -> Array:
        """A pose of the assembly in the frame of a part; that of the ground is global."""
        return X if part == self.assembly.name else compose(inverse(self.part(part).pose), X)

    def fits(self, joint: Connection, distance: float, angle: float) -> bool:
        """Whether the markers of a joint meet; where they do not, or parts have to be moved for it, that is said."""
        fits = distance <= FITS * self.size and angle <= FITS
        if not fits:
            self.notes.append(
                f"{joint.kind} {joint.name!r} does not fit as the parts stand: its markers are {distance:.3g} and {angle:.3g} rad "
                "off; the loops are closed by moving the parts"
            )
        elif max(distance / self.size, angle) > UNMENTIONED:
            self.moved[joint.j] = (distance, angle)
        return fits

    @functools.cached_property
    def size(self) -> float:
        """Mean radius of the markers and of the mass centres; 1 where all are one point."""
        a = self.assembly
        centers = [part.pose @ [*part.center, 1.0] for part in a.parts.values() if part.center is not None]
        points = np.array([self.pose(path)[:, 3] for path in a.markers] + centers or [np.zeros(3)])
        radius = float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))
        return radius if radius > UNMENTIONED * max(1.0, float(np.abs(points).max())) else 1.0
