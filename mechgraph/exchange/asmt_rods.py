"""Constant distances of FreeCAD as rods without mass: the pairs at the ends of a rod are those of the joint's name.

A joint holds two points (``Sph``), axes (``Rev``: at a point of the axis; ``Cyl``: anywhere on it) at the distance ``distanceIJ``.
"""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.exchange.asmt import Connection
from mechgraph.exchange.asmt_standing import Standing
from mechgraph.exchange.exact import FITS
from mechgraph.fields import second_direction
from mechgraph.model.pair import Link, Marker, Pair

BALL, HINGE, SLEEVE = ("S", False), ("R", False), ("C", True)
RODS = {
    "SphSphJoint": (BALL, BALL),
    "RevRevJoint": (HINGE, HINGE),
    "CylSphJoint": (SLEEVE, BALL),
    "RevCylJoint": (HINGE, SLEEVE),
}
"""The pairs at I and at J, and whether they slide along the axis of the marker."""


def rod(builder: Standing, joint: Connection) -> tuple[Link, list[Pair]] | None:
    """The rod of a joint and its two pairs; None, and a fault, where its ends say no direction.

    The rod's frame is that of the assembly where the parts stand; where the distance is another there, the loops are closed from there.
    """
    if builder.ends(joint) is None:
        return None
    kinds = RODS[joint.kind]
    length = float(joint.node.numbers("distanceIJ", (1,), joint.title.partition(": ")[2], builder.faults)[0])
    poses = [builder.pose(path) for path in (joint.i, joint.j)]
    points, axes = [X[:, 3] for X in poses], [X[:, 2] for X in poses]
    if np.linalg.norm(np.cross(axes[0], axes[1])) <= FITS:
        axes[1] = axes[0] * np.sign(axes[0] @ axes[1])
    feet = [
        p + z * (z @ (q - p)) if slides else p
        for (_, slides), p, q, z in zip(kinds, points, points[::-1], axes, strict=True)
    ]
    across = feet[1] - feet[0]
    if not (length > 0 and np.linalg.norm(across) > FITS * builder.size):
        builder.faults.append(
            f"{joint.title}: distanceIJ = {length:g}: expected a distance above 0 of what is apart as the parts stand"
        )
        return None
    ends = [feet[0], feet[0] + length * across / np.linalg.norm(across)]
    pairs = []
    for side, (kind, _), path, foot, end, z in zip("IJ", kinds, (joint.i, joint.j), feet, ends, axes, strict=True):
        part = builder.assembly.markers[path].part
        X = np.column_stack([_axes(z), foot])
        markers = [
            Marker(tuple(Y[:, 3]), tuple(Y[:, 2]), tuple(Y[:, 0]))
            for Y in (builder.own(part, X), np.column_stack([X[:, :3], end]))
        ]
        pairs.append(Pair(f"{joint.name} {side}", kind, part, joint.name, on_a=markers[0], on_b=markers[1]))
    return Link(joint.name), pairs


def _axes(z: Array) -> Array:
    """A rotation with the third axis ``z``."""
    x = np.asarray(second_direction(tuple(z.tolist())), dtype=float)
    x = x - (x @ z) * z
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
