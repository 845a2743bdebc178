"""Joints of constant velocity of FreeCAD: a link without mass between two universal joints about one point, which bend by equal halves.

The solver's condition is ``x_I . y_J + y_I . x_J = 0``, where each z leaves the joint along its own shaft. With J turned half round about
its x or y, it says that the rotation vector from I to J has no part along z. Such rotations are ``Rx(p) Ry(q) Ry(q) Rx(p)``: the first half
leads from I to a link in between, the second on to J, and couplings hold the halves to each other. Source: OndselSolver, constraint of this
joint.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.exchange.asmt import Connection
from mechgraph.exchange.asmt_joints import HALF_TURNS
from mechgraph.exchange.asmt_standing import Standing
from mechgraph.exchange.exact import FITS
from mechgraph.model.couplings import Coupling
from mechgraph.model.pair import Link, Marker, Pair

CONSTANT_VELOCITY = "ConstantVelocityJoint"
AXES = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
"""The first axis of a universal joint, z, along x of the marker, its second, x, along y."""


@dataclass(frozen=True)
class Bend:
    """What stands for a joint of constant velocity."""

    link: Link
    pairs: tuple[Pair, ...]
    couplings: tuple[Coupling, ...]
    start: Mapping[str, float]


def bent(builder: Standing, joint: Connection) -> Bend | None:
    """The parts of a joint of constant velocity; None, and a fault, where a marker is not there or both z point the same way."""
    if builder.ends(joint) is None:
        return None
    I, J = builder.pose(joint.i), builder.pose(joint.j)
    if I[:, 2] @ J[:, 2] > np.cos(FITS):
        builder.faults.append(
            f"{joint.title}: z of both markers points the same way, where the condition of this joint holds no turn; "
            "each z is to leave the joint along its own shaft: turn one marker half round"
        )
        return None
    half = max(HALF_TURNS[1:3], key=lambda F: float(np.trace(I[:, :3].T @ J[:, :3] @ F)))
    given = np.column_stack([J[:, :3] @ half, J[:, 3]])
    x, y, z, w = scipy.spatial.transform.Rotation.from_matrix(I[:, :3].T @ given[:, :3]).as_quat(canonical=True)
    p, q = float(np.arctan2(x, w)), float(np.arctan2(y, np.hypot(x, w)))
    turn = scipy.spatial.transform.Rotation.from_euler("XY", [p, q]).as_matrix()
    back = scipy.spatial.transform.Rotation.from_euler("YX", [q, p]).as_matrix()
    distance, angle = (
        float(np.linalg.norm(J[:, 3] - I[:, 3])),
        2 * float(np.arctan2(abs(z), np.hypot(np.hypot(x, y), w))),
    )
    fits = builder.fits(joint, distance, angle)
    between = np.column_stack([I[:, :3] @ turn, I[:, 3]])
    end = np.column_stack([between[:, :3] @ back, I[:, 3]]) if fits else given
    pairs = tuple(
        Pair(f"{joint.name} {side}", "U", part, joint.name, on_a=_marker(builder.own(part, X)), on_b=_marker(between))
        for side, path, X in (("I", joint.i, I), ("J", joint.j, end))
        for part in [builder.assembly.markers[path].part]
    )
    names = [f"{joint.name} {side}" for side in "IJ"]
    couplings = tuple(
        Coupling(
            dict.fromkeys([f"{name}.{turn}" for name in names], 1.0), name=f"{joint.name} halves {turn}", constant=0.0
        )
        for turn in ("Rz", "Rx")
    )
    start = {
        f"{name}.{turn}": sign * value
        for name, sign in zip(names, (1, -1), strict=True)
        for turn, value in (("Rz", p), ("Rx", q))
    }
    return Bend(Link(joint.name), pairs, couplings, start)


def _marker(X: Array) -> Marker:
    """The marker of a universal joint at a pose."""
    R = X[:, :3] @ AXES
    return Marker(tuple(X[:, 3]), tuple(R[:, 2]), tuple(R[:, 0]))
