"""The mechanism of an ASMT assembly.

Constant distances of FreeCAD as rods without mass: the pairs at the ends of a rod are those of the joint's name.

A joint holds two points (``Sph``), axes (``Rev``: at a point of the axis; ``Cyl``: anywhere on it) at the distance ``distanceIJ``.

Gears and racks of FreeCAD as couplings of the turns and slides of their parts against a common carrier.

The solver relates markers I and J themselves. With the angle a_I of the direction from I to J, seen in I and about its z, and a_J of that
from J to I, seen in J,

    GearJoint:        a_J + (radiusI / radiusJ) a_I = const
    RackPinionJoint:  x + pitchRadius b = const,   x of J in I, b the turn of J against I about z of I.

A gear that turns by q about its z against the carrier sees the line of centers turn by -q; a rack that slides by s along its x sees the
pinion slide by -s. So ``q_J + (radiusI / radiusJ) q_I`` and ``q_J - s / pitchRadius`` are constant. Where pairs about one axis lie between
a gear and the carrier (a sun wheel on the frame, its planet on an arm), their turns are added. Source: OndselSolver, constraints of these
joints.

Forces of FreeCAD along the line of two markers: springs where their formula is one, else force laws.

``InLineForceTorque``: the force on marker I is ``tension`` towards J, that on J opposite; a formula of ``rIJ(self)``, their distance,
``vrIJ(self)``, its rate, and ``time``. Source: OndselSolver, ForTorActionInLine.

Joints of constant velocity of FreeCAD: a link without mass between two universal joints about one point, which bend by equal halves.

The solver's condition is ``x_I . y_J + y_I . x_J = 0``, where each z leaves the joint along its own shaft. With J turned half round about
its x or y, it says that the rotation vector from I to J has no part along z. Such rotations are ``Rx(p) Ry(q) Ry(q) Rx(p)``: the first half
leads from I to a link in between, the second on to J, and couplings hold the halves to each other. Source: OndselSolver, constraint of this
joint.

From a FreeCAD assembly to a mechanism: parts are links, joints are pairs by markers, motions are drives.

Names, placements and the zeros of joint coordinates are FreeCAD's. CAD writes about as many digits as its solver closes loops to (1e-6), so
markers that fit to ``FITS`` are made to fit exactly where the parts stand: first axes that are parallel or perpendicular to that accuracy,
and lines that are one, are made so, then each marker J is moved to the place that its joint gives it. What was moved is said. Markers that
fit less are left as they are, and the loops are closed from there.

Results that FreeCAD stored with an assembly beside those of mechgraph: placements of parts, forces of joints, efforts of motions.

FreeCAD's solver stores for each part the place of its origin and its Bryant angles, ``R = Rx Ry Rz``; for each joint and motion the force
and moment that it exerts on the part of marker I, in the directions of the assembly, about the origin of marker I (OndselSolver,
ASMTConstraintSet). Where reactions are not unique it sets redundant conditions aside and stores one of many solutions.
"""

from __future__ import annotations

import dataclasses
import os
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import networkx as nx
import numpy as np
import scipy

from mechgraph.errors import ContentError, DeclarationError, FileError, MechgraphWarning, listed
from mechgraph.exchange.asmt import (
    ACROSS,
    ALONG,
    AT,
    FITS,
    HALF_TURNS,
    JOINTS,
    REFUSED,
    SLIDES,
    UNMENTIONED,
    AsmtPart,
    Assembly,
    Comparison,
    Connection,
    Difference,
    Directions,
    JointRow,
    Results,
    Snapping,
    Standing,
    assembly_of,
    ball_type,
    difference,
    free,
    motion_type,
    results_of,
    turns_in,
)
from mechgraph.exchange.syntax import FormulaFault, evaluated, law, marker_at, pose_about
from mechgraph.fields import axes_of
from mechgraph.kinetostatics import solve
from mechgraph.maths.inertia import physical_faults
from mechgraph.maths.se3 import Array, compose, inverse
from mechgraph.memo import dataclass
from mechgraph.model.couplings import Coupling
from mechgraph.model.loads import ForceLaw, Gravity, Spring
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.motion import Drive, Motion
from mechgraph.model.pair import Link, Pair
from mechgraph.quantities import shown
from mechgraph.result.solution import Solution

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
    length = builder.number(joint, "distanceIJ")
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
        expected = "expected a distance above 0 of what is apart as the parts stand"
        builder.faults.append(f"{joint.title}: distanceIJ = {length:g}: {expected}")
        return None
    ends = [feet[0], feet[0] + length * across / np.linalg.norm(across)]
    pairs = []
    for side, (kind, _), path, foot, end, z in zip("IJ", kinds, (joint.i, joint.j), feet, ends, axes, strict=True):
        part = builder.assembly.markers[path].part
        on_a, on_b = marker_at(builder.own(part, pose_about(z, foot))), marker_at(pose_about(z, end))
        pairs.append(Pair(f"{joint.name} {side}", kind, part, joint.name, on_a=on_a, on_b=on_b))
    return Link(joint.name), pairs


GEARED = ("GearJoint", "RackPinionJoint")
"""Joints that are couplings."""
Terms = dict[str, float]
"""Freedoms with coefficients."""


def geared(builder: Standing, joint: Connection, pairs: Sequence[Pair]) -> Coupling | None:
    """The coupling of a gear or rack joint; None, and a fault, where its parts have no carrier in common or a radius is zero."""
    if builder.ends(joint) is None:
        return None
    names = ("radiusI", "radiusJ") if joint.kind == "GearJoint" else ("pitchRadius",)
    radii = [builder.number(joint, name) for name in names]
    if not all(radii):
        given = ", ".join(f"{r:g}" for r in radii)
        builder.faults.append(f"{joint.title}: {', '.join(names)} = {given}: expected no zero")
        return None
    axis = builder.pose(joint.i)[:, 2]
    if joint.kind == "GearJoint":
        first, what, ratio = _turns(builder, joint.i, pairs, axis), "turn about", radii[0] / radii[1]
        axis = builder.pose(joint.j)[:, 2]
    else:
        first, what, ratio = _slides(builder, joint.i, pairs), "slide along x of", -1.0 / radii[0]
    others = _turns(builder, joint.j, pairs, axis)
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


LOOKED_AT = np.array([[0.0, 1.0, 0.0, 0.7, 1.9, 0.7], [0.0, 0.0, 1.0, -1.3, 0.4, -1.3], [0.0, 0.0, 0.0, 0.0, 0.6, 2.0]])
"""Distances, rates and times at which it is looked at."""


def force(builder: Standing, found: Connection) -> Spring | ForceLaw | None:
    """The load of a force; None, and a fault, where a marker is not there or a formula is none."""
    ends = builder.ends(found)
    if ends is None:
        return None
    try:
        tension = law(found.node.word("tension"), builder.assembly.variables)
        if law(found.node.word("twist") or "0", builder.assembly.variables)(*LOOKED_AT).any():
            raise FormulaFault("twist: a couple about the line of two points is no load here; delete it there")
        T = tension(*LOOKED_AT)
    except FormulaFault as fault:
        builder.faults.append(f"{found.title}: {fault}")
        return None
    markers = builder.assembly.markers
    p, q = (
        tuple((builder.pose(path) if part == builder.assembly.name else markers[path].pose)[:, 3].tolist())
        for path, part in zip((found.i, found.j), ends, strict=True)
    )
    stiffness, damping = float(T[1] - T[0]), float(T[2] - T[0])
    off = np.abs(T - (T[0] + stiffness * LOOKED_AT[0] + damping * LOOKED_AT[1])).max()
    # part of the force by which a formula may differ from a line in distance and rate
    if np.isfinite(T).all() and stiffness and T[0] / stiffness <= 0 and off <= 1e-12 * np.abs(T).max():
        return Spring(*ends, p, q, stiffness, float(-T[0] / stiffness), damping)

    def push(x: Array, v: Array, t: Array | None) -> Array:
        return -tension(x, v, np.zeros_like(x) if t is None else np.broadcast_to(t, x.shape))

    return ForceLaw((*ends, p, q), law=push)


CONSTANT_VELOCITY = "ConstantVelocityJoint"
AXES = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0]])
"""The first axis of a universal joint, z, along x of the marker, its second, x, along y."""


class Bend(NamedTuple):
    """What stands for a joint of constant velocity."""

    link: Link
    pairs: Sequence[Pair]
    couplings: Sequence[Coupling]
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
    turn, back = (
        scipy.spatial.transform.Rotation.from_euler(order, angles).as_matrix()
        for order, angles in (("XY", [p, q]), ("YX", [q, p]))
    )
    distance, angle = np.linalg.norm(J[:, 3] - I[:, 3]), 2 * np.arctan2(abs(z), np.hypot(np.hypot(x, y), w))
    fits = builder.fits(joint, float(distance), float(angle))
    between = np.column_stack([I[:, :3] @ turn, I[:, 3]])
    end = np.column_stack([between[:, :3] @ back, I[:, 3]]) if fits else given
    pairs, start = list[Pair](), dict[str, float]()
    for side, path, X, sign in (("I", joint.i, I, 1), ("J", joint.j, end, -1)):
        part, name = builder.assembly.markers[path].part, f"{joint.name} {side}"
        on_a, on_b = (marker_at(compose(Y, AXES)) for Y in (builder.own(part, X), between))
        pairs.append(Pair(name, "U", part, joint.name, on_a=on_a, on_b=on_b))
        start |= {f"{name}.Rz": sign * p, f"{name}.Rx": sign * q}
    couplings = [
        Coupling({f"{pair.name}.{turn}": 1.0 for pair in pairs}, name=f"{joint.name} halves {turn}", constant=0.0)
        for turn in ("Rz", "Rx")
    ]
    return Bend(Link(joint.name), pairs, couplings, start)


@dataclass
class Seat:
    """A joint with its row and marker poses in the assembly: I, J as the file has it, J as it shall be, and the pair coordinates there."""

    joint: Connection
    row: JointRow
    on_a: Array
    on_b: Array
    given: Array
    start: dict[str, float]
    directions: Directions

    @property
    def is_ball(self) -> bool:
        """Whether J turns in any way about a point that the joint holds."""
        return self.row.turns is free and not all(self.row.slides)


GENERAL = "GeneralMotion"
"""The motion that prescribes place and turns."""


class Builder(Standing):
    """Builds a mechanism."""

    # --- joints ----------------------------------------------------------------------------------------------------

    def rows(self) -> Iterator[tuple[Connection, JointRow]]:
        """The joints that hold two parts to each other."""
        for joint in self.assembly.joints:
            ends = self.ends(joint)
            row = JOINTS.get(joint.kind)
            if joint.kind in (*GEARED, *RODS, CONSTANT_VELOCITY):
                continue
            if row is None:
                why = REFUSED.get(joint.kind, f"not known here (known: {', '.join(JOINTS)})")
                self.faults.append(f"{joint.title}: {why}")
            elif ends and ends[0] == ends[1]:
                what = "the ground" if ends[0] == self.assembly.name else f"part {ends[0]!r}"
                self.notes.append(f"{joint.kind} {joint.name!r} joins {what} to itself and was left out")
            elif ends:
                yield joint, self.numbered(joint, row)

    def numbered(self, joint: Connection, row: JointRow) -> JointRow:
        """The row with the angle of the joint; axes at the angle 0 are parallel."""
        if row.number != "theIzJz" or joint.node.child(row.number) is None:
            return row
        angle = self.number(joint, row.number)
        return row._replace(angle=angle) if abs(np.sin(angle)) > FITS else JOINTS["ParallelAxesJoint"]

    def row_number(self, joint: Connection, row: JointRow) -> float:
        """The number of a joint (offset, pitch); 0 where it has none."""
        return self.number(joint, row.number) if row.number and joint.node.child(row.number) else 0.0

    def seat(self, joint: Connection, row: JointRow, I: Array) -> Seat:
        """Markers of the pair for the pose of I: the place of J, and the coordinates there."""
        J = self.pose(joint.j)
        d = row.turns(I[:, :3], J[:, :3], row.angle)
        offset = self.row_number(joint, row) if row.slides == ACROSS else 0.0
        A = np.column_stack([d.on_a, J[:, 3] if all(row.slides) else I[:, 3] + offset * I[:, 2]])
        along = np.where(row.slides, d.on_a.T @ (J[:, 3] - A[:, 3]), 0.0)
        on_b = np.column_stack([d.on_b, A[:, 3] + d.on_a @ along])
        start = {name: float(value) for name, value, is_free in zip(SLIDES, along, row.slides, strict=True) if is_free}
        return Seat(joint, row, A, on_b, np.column_stack([d.given, J[:, 3]]), start | {"Rz": d.angle}, d)

    def seats(self) -> list[Seat]:
        """All joints, their axes and lines made exactly parallel, perpendicular and one where they are nearly so."""
        snap = Snapping(FITS * self.size)
        out = [self.seat(joint, row, self.straightened(snap, row, self.pose(joint.i))) for joint, row in self.rows()]
        if snap.largest > UNMENTIONED:
            self.notes.append(
                f"axes that are parallel or perpendicular to {FITS:g} rad, and lines that are one to {FITS:g} L, were made so exactly "
                f"(largest turn {snap.largest:.2g} rad)"
            )
        return out

    def straightened(self, snap: Snapping, row: JointRow, I: Array) -> Array:
        """The pose of marker I with its axis made exact."""
        if row.turns is free and not any(row.slides):
            return I
        z = snap.direction(I[:, 2])
        x = snap.direction(I[:, 0] - (I[:, 0] @ z) * z)
        point = snap.on_line(I[:, 3], z) if row.slides in (AT, ALONG) else I[:, 3]
        return np.column_stack([axes_of(z, x), point])

    def pair(self, seat: Seat) -> Pair:
        """The pair, marker J moved to its place where it is meant to be there."""
        joint, d, row = seat.joint, seat.directions, seat.row
        if d.turned:
            self.notes.append(
                f"{joint.kind} {joint.name!r}: marker {joint.j} points the opposite way of {joint.i} and was turned half round"
            )
        fits = self.fits(joint, float(np.linalg.norm(seat.given[:, 3] - seat.on_b[:, 3])), d.error)
        pitch = self.row_number(joint, row) / (2 * np.pi) if row.number == "pitch" else None
        kind = row.type(row.angle) if callable(row.type) else row.type
        return self.by_markers(joint.name, kind, joint, seat.on_a, seat.on_b if fits else seat.given, pitch)

    def by_markers(
        self, name: str, kind: object, of: Connection, A: Array, B: Array, pitch: float | None = None
    ) -> Pair:
        """A pair whose markers have these poses in the assembly; each is written in the frame of its part, that of the ground is global."""
        a, b = (self.assembly.markers[path].part for path in (of.i, of.j))
        return Pair(name, kind, a, b, on_a=marker_at(self.own(a, A)), on_b=marker_at(self.own(b, B)), pitch=pitch)

    # --- motions ---------------------------------------------------------------------------------------------------

    def driven(self, seats: Sequence[Seat]) -> tuple[list[Pair], list[Drive], dict[str, float]]:
        """Drives of all motions, pairs for those between markers that no joint connects, and start values of all pairs."""
        pairs = {seat.joint.name: self.pair(seat) for seat in seats}
        start = {
            f"{seat.joint.name}.{key}": value
            for seat in seats
            for key, value in seat.start.items()
            if key in [f.name for f in pairs[seat.joint.name].type.freedoms] and not all(seat.row.slides)
        }
        drives: dict[str, Drive] = {}
        for motion in self.assembly.motions:
            if motion.kind == "AllowRotation":
                self.notes.append(f"{motion.kind} {motion.name!r} drives nothing: the turn of its joint is free anyway")
                continue
            found, formulas = self.moved_by(motion, seats), self.formulas(motion)
            if found is None:
                continue
            seat, sign = found
            name = motion.name if seat is None else seat.joint.name
            if seat is None and self.ends(motion) is None:
                continue
            if seat is None or (motion.kind == GENERAL and seat.is_ball and any(key[0] == "R" for key in formulas)):
                pairs[name], at = self.motion_pair(motion, seat, sign, list(formulas))
                start |= {f"{name}.{key}": value for key, value in at.items()}
                sign = 1.0
            self.drive(motion, pairs[name], formulas, sign, start, drives)
        return list(pairs.values()), list(drives.values()), start

    def moved_by(self, motion: Connection, seats: Sequence[Seat]) -> tuple[Seat | None, float] | None:
        """The joint that a motion moves, and -1 where it names the markers the other way round; no joint where it names markers alone."""
        if motion.kind not in ("RotationalMotion", "TranslationalMotion", GENERAL):
            self.faults.append(f"{motion.title}: not known here")
            return None
        for seat in seats:
            joint = seat.joint
            if motion.joint in (f"/{self.assembly.name}/{joint.name}", joint.name) or (motion.i, motion.j) == (
                joint.i,
                joint.j,
            ):
                return seat, 1.0
            if (motion.i, motion.j) == (joint.j, joint.i):
                if (motion.kind == GENERAL and any(seat.row.slides[:2])) or (seat.is_ball and any(seat.row.slides)):
                    self.faults.append(
                        f"{motion.title}: names the markers of {joint.name!r} the other way round, "
                        "where slides of J in I are not those of I in J; exchange MarkerI and MarkerJ of the joint"
                    )
                    return None
                return seat, -1.0
        if motion.joint and not motion.i:
            joints = listed(f"/{self.assembly.name}/{seat.joint.name}" for seat in seats)
            self.faults.append(f"{motion.title}: there is no joint {shown(motion.joint)} (joints: {joints})")
            return None
        return None, 1.0

    def formulas(self, motion: Connection) -> dict[str, str]:
        """The formulas of a motion by freedom."""
        node = motion.node
        order = node.word("rotationOrder") or node.word("RotationOrder") or "1 2 3"
        axes = "".join("xyz"[int(c) - 1] for c in order.split() if c in ("1", "2", "3"))
        if motion.kind == GENERAL and len(axes) != 3:
            self.faults.append(f"{motion.title}: RotationOrder {shown(order)}: expected three of 1, 2, 3")
        keys = {
            "RotationalMotion": {"Rz": "RotationZ"},
            "TranslationalMotion": {"Tz": "TranslationZ"},
            GENERAL: {
                **{name: f"rIJI{k}" for k, name in enumerate(SLIDES, 1)},
                **{turn.name: f"angIJJ{k}" for k, turn in enumerate(turns_in(axes), 1)},
            },
        }.get(motion.kind, {})
        found = {freedom: " ".join(line.text for line in node.under(key)) for freedom, key in keys.items()}
        if keys and not any(found.values()):
            self.faults.append(f"{motion.title}: has no formula ({', '.join(keys.values())})")
        return {freedom: text for freedom, text in found.items() if text}

    def motion_pair(
        self, motion: Connection, seat: Seat | None, sign: float, freedoms: Sequence[str]
    ) -> tuple[Pair, dict[str, float]]:
        """The pair of a motion between markers that no joint connects, or of a ball whose turns it prescribes, and its coordinates now."""
        order = "".join(name[1] for name in freedoms if name.startswith("R")) or "z"
        order = order if len(order) == 3 else order[0] + {"x": "yz", "y": "zx", "z": "xy"}[order[0]]
        if seat is None:
            self.notes.append(
                f"{motion.kind} {motion.name!r} moves marker {motion.j} against {motion.i}, which no joint connects"
            )
            name, of, kind, A, B = motion.name, motion, motion_type(order), self.pose(motion.i), self.pose(motion.j)
        else:
            name, of, kind, A = seat.joint.name, seat.joint, ball_type(seat.row, order), seat.on_a
            B = np.column_stack([self.pose(seat.joint.j)[:, :3], seat.on_b[:, 3]])
            if sign < 0:
                of, A, B = motion, B, A
        relative = compose(inverse(A), B)
        angles = scipy.spatial.transform.Rotation.from_matrix(relative[:, :3]).as_euler(order.upper())  # type: ignore[call-overload]
        turns = [turn.name for turn in turns_in(order)]
        at = dict(zip([*SLIDES, *turns], [*relative[:, 3].tolist(), *angles.tolist()], strict=True))
        pair = self.by_markers(name, kind, of, A, B)
        return pair, {freedom.name: at[freedom.name] for freedom in pair.type.freedoms}

    def drive(
        self,
        motion: Connection,
        pair: Pair,
        formulas: dict[str, str],
        sign: float,
        start: dict[str, float],
        drives: dict[str, Drive],
    ) -> None:
        """Drives of a motion in the freedoms of a pair; an angle starts in the turn in which its motion does."""
        able = [f.name for f, single in zip(pair.type.freedoms, pair.type.drivable, strict=True) if single]
        for freedom, text in formulas.items():
            try:
                s, v, a = (sign * part for part in evaluated(text, self.assembly.times, self.assembly.variables))
            except FormulaFault as fault:
                self.faults.append(f"{motion.title}: {fault}")
                continue
            name = f"{pair.name}.{freedom}"
            if freedom not in able:
                if motion.kind == GENERAL and not (s.any() or v.any()):
                    continue
                where = f"{motion.title}: drives {freedom} of {pair.name!r} ({pair.type.name})"
                self.faults.append(f"{where}, which takes a drive in {', '.join(able) or 'no freedom'}")
            elif name in drives:
                self.faults.append(f"{motion.title}: {name} is driven twice")
            else:
                drives[name] = Drive(name, Motion(s, v, a, self.assembly.times))
                if freedom.startswith("R") and name in start:
                    start[name] += 2 * np.pi * round((s[0] - start[name]) / (2 * np.pi))

    # --- links -----------------------------------------------------------------------------------------------------

    def links(self, pairs: Sequence[Pair]) -> list[Link]:
        """The ground and the parts that joints or motions reach; parts that hang together without the ground are a fault."""
        a = self.assembly
        joined: nx.Graph[str] = nx.Graph((pair.a, pair.b) for pair in pairs)
        reached = nx.node_connected_component(joined, a.name) if a.name in joined else {a.name}
        loose = [name for name in a.parts if name in joined and name not in reached]
        alone = [name for name in a.parts if name not in joined]
        if loose:
            self.faults.append(
                f"parts {listed(loose)} are joined to each other, but not to the ground; ground one of them in FreeCAD"
            )
        if alone:
            self.notes.append(f"no joint and no motion holds {listed(alone)}: left out")
        used = [part for name, part in a.parts.items() if name in reached]
        if used and all(part.placeholder for part in used):
            self.notes.append(
                "all parts have mass 1 and moments of inertia 1, which FreeCAD writes where it was told none"
            )
        return [Link(a.name), *(self.link(part) for part in used)]

    def link(self, part: AsmtPart) -> Link:
        """A link with the mass of its part."""
        if not part.mass:
            return Link(part.name)
        odd = part.inertia is not None and bool(physical_faults(part.inertia))
        if odd:
            self.notes.append(f"the moments of inertia of part {part.name!r} are those of no body")
        return Link(part.name, part.mass, part.center, part.inertia, unphysical=odd)

    def build(self) -> tuple[Mechanism, tuple[str, ...]]:
        """The mechanism and the notes.

        Raises
        ------
        DeclarationError
            with all faults.
        """
        a = self.assembly
        pairs, drives, start = self.driven(self.seats())
        rods = [found for joint in a.joints if joint.kind in RODS and (found := rod(self, joint)) is not None]
        balls = [joint for joint in a.joints if joint.kind == CONSTANT_VELOCITY]
        bends = [bend for joint in balls if (bend := bent(self, joint)) is not None]
        pairs += [pair for _, ends in rods for pair in ends] + [pair for bend in bends for pair in bend.pairs]
        start |= {freedom: value for bend in bends for freedom, value in bend.start.items()}
        links = [*self.links(pairs), *(link for link, _ in rods), *(bend.link for bend in bends)]
        couplings = [geared(self, joint, pairs) for joint in a.joints if joint.kind in GEARED]
        couplings += [coupling for bend in bends for coupling in bend.couplings]
        loads = [load for found in a.forces if (load := force(self, found)) is not None]
        if self.moved:
            far = max(self.moved, key=lambda path: max(self.moved[path][0] / self.size, self.moved[path][1]))
            distance, angle = self.moved[far]
            self.notes.append(
                f"{len(self.moved)} marker{'s' * (len(self.moved) > 1)} moved so that the joints fit exactly, {far} the most: "
                f"by {distance:.2g} and {angle:.2g} rad"
            )
        for limit in a.limits:
            what = f"between {limit.i} and {limit.j}" if limit.i else f"of {limit.joint}"
            bound = f"{limit.node.word('Type')} {limit.node.word('Limit')}"
            self.notes.append(f"{limit.kind} {limit.name!r} {what} ({bound}) is not applied")
        notes = (*a.notes, *self.notes)
        if self.faults:
            raise DeclarationError(f"assembly {shown(a.name)}", self.faults)
        made = Mechanism(
            a.name, links, pairs, drives, [*([Gravity(tuple(a.gravity))] if a.gravity.any() else []), *loads],
            couplings=[coupling for coupling in couplings if coupling is not None],
            start=start, source="a FreeCAD assembly", description=". ".join(notes),
        )  # fmt: skip
        return made, notes


def mechanism_of(assembly: Assembly) -> tuple[Mechanism, tuple[str, ...]]:
    """The mechanism of an assembly, and what was taken otherwise than it stands in the file."""
    return Builder(assembly).build()


FORCES = ("FXonI", "FYonI", "FZonI")
TORQUES = ("TXonI", "TYonI", "TZonI")
FREEDOM_OF = {"RotationalMotion": "Rz", "TranslationalMotion": "Tz"}


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
        of = {path: name for path, name in paths.items() if name in self.s.mechanism.link_index}
        stored = {of[path]: rows for (kind, path), rows in self.results.series.items() if kind == "Part" and path in of}
        places = {name: _rows(rows, ("X", "Y", "Z")) for name, rows in stored.items()}
        size = max((float(np.abs(p).max()) for p in places.values() if p is not None), default=1.0)
        for name, place in places.items():
            X, angles = self.s.link(name).pose, _rows(stored[name], ("Bryantx", "Bryanty", "Bryantz"))
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
        if found.kind not in FREEDOM_OF:
            if found.name not in names:
                return None
            origin, _ = self.place(found.i)
            moment, force = -self.s[found.name].reaction[..., :3], -self.s[found.name].reaction[..., 3:]
            return force, moment - np.cross(origin, force)
        joint = next((j for j in self.assembly.joints if found.joint.endswith(f"/{j.name}") or found.i == j.i), found)
        pair = self.s.mechanism.pair(joint.name) if joint.name in names and found.i in ("", joint.i) else None
        place = [f.name for f in pair.type.freedoms].index(FREEDOM_OF[found.kind]) if pair else 0
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
        why = "its results are a free movement, which cannot be computed from positions alone"
        raise FileError(path, f"has no motions: {why}")
    try:
        m, _ = mechanism_of(dataclasses.replace(assembly, times=results.times))
    except DeclarationError as error:
        raise ContentError(path, error) from None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MechgraphWarning)
        s = solve(m, on_reach="flag")
    return Comparison(assembly.name, results.times.size, tuple(_Compared(assembly, results, s).all()))
