"""Results that FreeCAD stored with an assembly beside those of mechgraph: placements of parts, forces of joints, efforts of motions.

FreeCAD's solver stores for each part the place of its origin and its Bryant angles, ``R = Rx Ry Rz``; for each joint and motion the force
and moment that it exerts on the part of marker I, in the directions of the assembly, about the origin of marker I (OndselSolver,
ASMTConstraintSet). Where reactions are not unique it sets redundant conditions aside and stores one of many solutions.
"""

from __future__ import annotations

import dataclasses
import os
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy

from mechgraph.document import Document, Paragraph, Shown, Table
from mechgraph.errors import ContentError, DeclarationError, FileError, MechgraphWarning
from mechgraph.exchange.asmt import Assembly, Connection, Results, results_of
from mechgraph.exchange.asmt_mechanism import mechanism_of
from mechgraph.exchange.files import assembly_of
from mechgraph.kinetostatics import solve
from mechgraph.maths.se3 import Array
from mechgraph.result.solution import Solution

AGREES = 1e-4
"""Differences up to here count as agreement: FreeCAD's solver closes to 1e-6 and differentiates twice."""
FORCES = ("FXonI", "FYonI", "FZonI")
TORQUES = ("TXonI", "TYonI", "TZonI")
AXES = {"RotationalMotion": "Rz", "TranslationalMotion": "Tz"}


@dataclass(frozen=True)
class Difference:
    """The largest difference of a quantity over the stored times, and the size to which it is relative.

    ``missing``: the number of values that are not unique, so that the file has one of many.
    """

    of: str
    quantity: str
    largest: float
    size: float
    missing: int = 0

    @property
    def relative(self) -> float:
        """The difference relative to the size; the difference itself where that is 0."""
        return self.largest / self.size if self.size else self.largest

    def cells(self) -> tuple[str, ...]:
        """The cells of the table."""
        remark = "not unique: the file has one of many" if self.missing else ""
        shown = ("", "") if np.isnan(self.largest) else (f"{self.largest:.3g}", f"{self.relative:.2g}")
        return self.of, self.quantity, f"{self.size:.4g}" if self.size else "", *shown, remark


@dataclass(frozen=True, repr=False)
class Comparison(Shown):
    """All differences between a file's results and mechgraph's."""

    name: str
    times: int
    differences: tuple[Difference, ...]

    @property
    def agrees(self) -> bool:
        """Whether everything that is unique agrees to ``AGREES``."""
        return all(np.isnan(d.largest) or d.relative <= AGREES for d in self.differences)

    def document(self) -> Document:
        """The verdict and a table."""
        off = [d for d in self.differences if d.relative > AGREES]
        worst = max(off, key=lambda d: d.relative, default=None)
        verdict = f"All that is unique agrees to {AGREES:g}"
        if worst is not None:
            count = f"Quantities off by more than {AGREES:g}: {len(off)} of {len(self.differences)}"
            verdict = f"{count}, {worst.quantity} of {worst.of} the most"
        head = ("of", "quantity", "greatest in the file", "difference", "relative", "")
        rows = tuple(d.cells() for d in self.differences)
        return Document(
            f"{self.name}: FreeCAD's stored results beside mechgraph's",
            (Paragraph(f"{verdict}, at {self.times} times."), Table(head, rows, "llrrrl")),
        )


def difference(of: str, quantity: str, ours: Array, theirs: Array, size: float | None = None) -> Difference:
    """The largest difference of vectors ``(T, 3)``; NaN where none of ours is unique."""
    off = np.abs(ours - theirs)
    known = ~np.isnan(off)
    largest = float(off[known].max()) if known.any() else np.nan
    return Difference(of, quantity, largest, float(np.abs(theirs).max()) if size is None else size, int((~known).sum()))


def _rows(rows: Mapping[str, Array], labels: tuple[str, ...]) -> Array | None:
    return np.stack([rows[label] for label in labels], axis=-1) if set(labels) <= set(rows) else None


@dataclass(frozen=True)
class _Compared:
    """The solution at the stored times, and what it is compared with."""

    assembly: Assembly
    results: Results
    s: Solution

    def place(self, marker: str) -> tuple[Array, Array]:
        """Origin ``(T, 3)`` and z axis ``(T, 3)`` of a marker."""
        found = self.assembly.markers[marker]
        X = self.s.link(found.part).pose
        at = self.assembly.ground.pose if found.part == self.assembly.name else np.eye(3, 4)
        p, z = at[:, :3] @ found.pose[:, 3] + at[:, 3], at[:, :3] @ found.pose[:, 2]
        return X[:, :3, :3] @ p + X[:, :3, 3], X[:, :3, :3] @ z

    def parts(self) -> Iterator[Difference]:
        """Places, relative to the largest coordinate of all, and turns of the parts."""
        paths = {part.path: part.name for part in self.assembly.parts.values()}
        known = set(self.s.mechanism.link_names())
        stored = {
            paths[path]: rows for (kind, path), rows in self.results.series.items() if kind == "Part" and path in paths
        }
        stored = {name: rows for name, rows in stored.items() if name in known}
        size = max(
            (float(np.abs(p).max()) for rows in stored.values() if (p := _rows(rows, ("X", "Y", "Z"))) is not None),
            default=1.0,
        )
        for name, rows in stored.items():
            place, angles = _rows(rows, ("X", "Y", "Z")), _rows(rows, ("Bryantx", "Bryanty", "Bryantz"))
            X = self.s.link(name).pose
            if place is not None:
                yield difference(name, "place", X[:, :3, 3], place, size)
            if angles is not None:
                rotation = scipy.spatial.transform.Rotation
                turn = rotation.from_matrix(X[:, :3, :3]).inv() * rotation.from_euler("XYZ", angles)
                yield difference(name, "turn [rad]", turn.as_rotvec(), np.zeros((len(X), 3)), 0.0)

    def wrenches(self) -> Iterator[tuple[str, Array, Array, Array, Array]]:
        """Name, force and moment on I of ours and theirs, for each joint and each motion of a single joint."""
        root = f"/{self.assembly.name}/"
        for found in [*self.assembly.joints, *self.assembly.motions]:
            rows = self.results.series.get((found.kind, root + found.name))
            stored = rows and (_rows(rows, FORCES), _rows(rows, TORQUES))
            ours = self.on_i(found) if stored and stored[0] is not None and stored[1] is not None else None
            if ours is not None:
                yield found.name, *ours, *stored  # type: ignore[misc]

    def on_i(self, found: Connection) -> tuple[Array, Array] | None:
        """Force and moment of a joint or motion on the part of I, about marker I; None where there is no pair of it."""
        names = {pair.name for pair in self.s.mechanism.pairs}
        if found.kind not in AXES:
            if found.name not in names:
                return None
            origin, _ = self.place(found.i)
            moment, force = -self.s[found.name].reaction[..., :3], -self.s[found.name].reaction[..., 3:]
            return force, moment - np.cross(origin, force)
        joint = next((j for j in self.assembly.joints if found.joint.endswith(f"/{j.name}") or found.i == j.i), found)
        pair = self.s.mechanism.pair(joint.name) if joint.name in names and found.i in ("", joint.i) else None
        place = [f.name for f in pair.type.freedoms].index(AXES[found.kind]) if pair else 0
        if pair is None:
            return None
        (origin, z), (other, _) = self.place(joint.i), self.place(joint.j)
        along = -self.s[joint.name].effort[:, place, None] * z
        if pair.type.freedoms[place].turns:
            return np.zeros_like(along), along
        return along, np.cross(other - origin, along)

    def all(self) -> Iterator[Difference]:
        """All differences; forces relative to the greatest force of all, moments to the greatest moment."""
        yield from self.parts()
        found = list(self.wrenches())
        largest = [max((float(np.abs(row[k]).max()) for row in found), default=0.0) for k in (3, 4)]
        for name, force, moment, stored_force, stored_moment in found:
            yield difference(name, "force", force, stored_force, largest[0])
            yield difference(name, "moment", moment, stored_moment, largest[1])


def compare(path: str | os.PathLike[str]) -> Comparison:
    """FreeCAD's stored results beside those of mechgraph for the same motions at the same times.

    Raises
    ------
    FileError
        where the file holds no results, or no motions that prescribe the movement.
    """
    path = Path(path)
    assembly = assembly_of(path)
    results = results_of(assembly, path)
    if not assembly.motions:
        raise FileError(
            path, "has no motions: its results are a free movement, which cannot be computed from positions alone"
        )
    try:
        m, _ = mechanism_of(dataclasses.replace(assembly, times=results.times))
    except DeclarationError as error:
        raise ContentError(path, error) from None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MechgraphWarning)
        s = solve(m, on_reach="flag")
    return Comparison(assembly.name, results.times.size, tuple(_Compared(assembly, results, s).all()))
