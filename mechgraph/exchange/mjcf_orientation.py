"""Orientations of MJCF: five ways to say one, angles in degrees unless the compiler section says radians."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array, quaternion_matrix
from mechgraph.exchange.xml_tree import Element


@dataclass(frozen=True)
class Compiler:
    """How angles are read, and where faults go."""

    radians: bool
    order: str
    faults: list[str]

    def angle(self, value: float) -> float:
        """An angle of the file in radians."""
        return value if self.radians else float(np.deg2rad(value))


def pose_of(e: Element, c: Compiler) -> Array:
    """Position and orientation of an element in its parent."""
    given = [key for key in ORIENTATIONS if key in e.attributes]
    if len(given) > 1:
        c.faults.append(f"{e.title}: has {' and '.join(given)}; one of them says the orientation")
    R = ORIENTATIONS[given[0]](e, c) if given else np.eye(3)
    return np.column_stack([R, e.numbers("pos", (3,), np.zeros(3), c.faults)])


def _of_euler(e: Element, c: Compiler) -> Array:
    """Three turns in the order of the compiler, about axes that turn along (small letters) or stay (capitals)."""
    angles = [c.angle(v) for v in e.numbers("euler", (3,), None, c.faults)]
    turn: Any = scipy.spatial.transform.Rotation
    return np.asarray(turn.from_euler(c.order.swapcase(), angles).as_matrix())


def _of_quat(e: Element, c: Compiler) -> Array:
    q = e.numbers("quat", (4,), None, c.faults)
    return quaternion_matrix(q / np.linalg.norm(q)) if q.any() else np.eye(3)


def _of_axisangle(e: Element, c: Compiler) -> Array:
    *axis, angle = e.numbers("axisangle", (4,), None, c.faults)
    turn: Any = scipy.spatial.transform.Rotation
    return np.asarray(turn.from_rotvec(np.array(axis) / (np.linalg.norm(axis) or 1.0) * c.angle(angle)).as_matrix())


def _of_xyaxes(e: Element, c: Compiler) -> Array:
    x, y = e.numbers("xyaxes", (2, 3), None, c.faults)
    z = np.cross(x, y)
    if not z.any():
        c.faults.append(f"{e.title}: xyaxes are parallel")
        return np.eye(3)
    return np.column_stack([v / np.linalg.norm(v) for v in (x, np.cross(z, x), z)])


def _of_zaxis(e: Element, c: Compiler) -> Array:
    """The smallest turn that brings z there."""
    z = e.numbers("zaxis", (3,), None, c.faults)
    z = z / (np.linalg.norm(z) or 1.0)
    axis, turn = np.cross([0.0, 0, 1], z), scipy.spatial.transform.Rotation
    if not axis.any():
        return np.diag([1.0, -1, -1]) if z[2] < 0 else np.eye(3)
    return np.asarray(turn.from_rotvec(axis / np.linalg.norm(axis) * np.arccos(np.clip(z[2], -1, 1))).as_matrix())


ORIENTATIONS: dict[str, Callable[[Element, Compiler], Array]] = {
    "quat": _of_quat,
    "axisangle": _of_axisangle,
    "euler": _of_euler,
    "xyaxes": _of_xyaxes,
    "zaxis": _of_zaxis,
}
"""Attributes that say an orientation."""
