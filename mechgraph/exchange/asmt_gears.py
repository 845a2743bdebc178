"""Gears and racks of FreeCAD as couplings of the turns and slides of their parts against a common carrier.

The solver relates markers I and J themselves. With the angle a_I of the direction from I to J, seen in I and about its z, and a_J of that
from J to I, seen in J,

    GearJoint:        a_J + (radiusI / radiusJ) a_I = const
    RackPinionJoint:  x + pitchRadius b = const,   x of J in I, b the turn of J against I about z of I.

A gear that turns by q about its z against the carrier sees the line of centres turn by -q; a rack that slides by s along its x sees the
pinion slide by -s. So ``q_J + (radiusI / radiusJ) q_I`` and ``q_J - s / pitchRadius`` are constant. Where pairs about one axis lie between
a gear and the carrier (a sun wheel on the frame, its planet on an arm), their turns are added. Source: OndselSolver, constraints of these
joints.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mechgraph.algebra.se3 import Array, compose
from mechgraph.exchange.asmt import Connection
from mechgraph.exchange.asmt_standing import Standing
from mechgraph.exchange.exact import FITS
from mechgraph.model.couplings import Coupling
from mechgraph.model.pair import Pair

GEARED = ("GearJoint", "RackPinionJoint")
"""Joints that are couplings."""
Terms = dict[str, float]
"""Freedoms with coefficients."""


def geared(builder: Standing, joint: Connection, pairs: Sequence[Pair]) -> Coupling | None:
    """The coupling of a gear or rack joint; None, and a fault, where its parts have no carrier in common or a radius is zero."""
    if builder.ends(joint) is None:
        return None
    names = ("radiusI", "radiusJ") if joint.kind == "GearJoint" else ("pitchRadius",)
    radii = [float(joint.node.numbers(name, (1,), joint.title.partition(": ")[2], builder.faults)[0]) for name in names]
    if not all(radii):
        builder.faults.append(
            f"{joint.title}: {', '.join(names)} = {', '.join(f'{r:g}' for r in radii)}: expected no zero"
        )
        return None
    J = builder.pose(joint.j)
    if joint.kind == "GearJoint":
        first, second, what = _turns(builder, joint.i, pairs, builder.pose(joint.i)[:, 2]), J[:, 2], "turn about"
        ratio = radii[0] / radii[1]
    else:
        first, second, what = _slides(builder, joint.i, pairs), builder.pose(joint.i)[:, 2], "slide along x of"
        ratio = -1.0 / radii[0]
    others = _turns(builder, joint.j, pairs, second)
    carrier = next((part for part in first if part in others), None)
    if carrier is None:
        builder.faults.append(
            f"{joint.title}: no part carries both: I must {what} its marker, J turn about its own, against one part; join them to it"
        )
        return None
    terms: Terms = dict(others[carrier])
    for name, value in first[carrier].items():
        terms[name] = terms.get(name, 0.0) + ratio * value
    return Coupling({name: value for name, value in terms.items() if value}, name=joint.name)


def _turns(builder: Standing, marker: str, pairs: Sequence[Pair], z: Array) -> dict[str, Terms]:
    """Parts to which pairs about the z axis of a marker lead, the nearest first, and the turn about ``z`` of its part against them."""
    at, part = builder.pose(marker)[:, 3], builder.assembly.markers[marker].part
    found: dict[str, Terms] = {part: {}}
    queue = [part]
    for here in queue:
        for pair in pairs:
            names = {freedom.name for freedom in pair.type.freedoms}
            if here not in (pair.a, pair.b) or not {"Rz"} <= names <= {"Rz", "Tz"}:
                continue
            axis, other = _marker(builder, pair), pair.a if here == pair.b else pair.b
            off = np.linalg.norm(np.cross(at - axis[:, 3], axis[:, 2])) / builder.size
            if other not in found and off <= FITS and np.linalg.norm(np.cross(axis[:, 2], z)) <= FITS:
                sense = float(np.sign(axis[:, 2] @ z)) * (1.0 if here == pair.b else -1.0)
                found[other] = {**found[here], f"{pair.name}.Rz": sense}
                queue.append(other)
    del found[part]
    return found


def _slides(builder: Standing, marker: str, pairs: Sequence[Pair]) -> dict[str, Terms]:
    """Parts on which the part of a marker slides along its x, and the slide against them."""
    x, part = builder.pose(marker)[:, 0], builder.assembly.markers[marker].part
    found: dict[str, Terms] = {}
    for pair in pairs:
        if part in (pair.a, pair.b) and [freedom.name for freedom in pair.type.freedoms] == ["Tz"]:
            z = _marker(builder, pair)[:, 2]
            if np.linalg.norm(np.cross(z, x)) <= FITS:
                sense = float(np.sign(z @ x)) * (1.0 if part == pair.b else -1.0)
                found.setdefault(pair.a if part == pair.b else pair.b, {f"{pair.name}.Tz": sense})
    return found


def _marker(builder: Standing, pair: Pair) -> Array:
    """The marker of a pair on link a, in the assembly."""
    own = pair.markers[0].pose()
    return own if pair.a == builder.assembly.name else compose(builder.part(pair.a).pose, own)
