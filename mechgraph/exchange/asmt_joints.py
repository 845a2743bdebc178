"""Joints of FreeCAD as pairs: a table of what marker J may do against marker I, and how the two are made to fit exactly.

Source of the conditions: the joints of OndselSolver, each a list of conditions that a point of J lies at, on the z axis or in the plane of
I (x, y or z of J in the frame of I, with an offset along z), and that axes of the two are perpendicular. Conditions on axes do not tell an
axis from its opposite; a pair does, so J is turned half round where that fits better, which is said.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mechgraph.algebra.se3 import Array, rotation_exp, rotation_log
from mechgraph.pairs.factors import Freedom
from mechgraph.pairs.pair_type import PairType


class Directions(NamedTuple):
    """Orientations ``(3, 3)`` in the assembly where the parts stand: of I and of J as they shall be, and of J as the file has it.

    ``angle``: the turn about z from I to J. ``turned``: whether J was taken half a turn further.
    """

    on_a: Array
    on_b: Array
    given: Array
    angle: float = 0.0
    turned: bool = False

    @property
    def error(self) -> float:
        """Angle by which J misses."""
        return float(np.linalg.norm(rotation_log(self.on_b.T @ self.given)))


HALF_TURNS = [np.diag(signs) for signs in ([1.0, 1, 1], [1.0, -1, -1], [-1.0, 1, -1], [-1.0, -1, 1])]


def same(RI: Array, RJ: Array, _: float) -> Directions:
    """All three axes along those of I, or opposite."""
    best = max(HALF_TURNS, key=lambda F: float(np.trace(RI.T @ RJ @ F)))
    return Directions(RI, RI, RJ @ best, 0.0, best is not HALF_TURNS[0])


def about_z(RI: Array, RJ: Array, _: float) -> Directions:
    """Z along that of I, or opposite; x of J stays where it is."""
    turned = bool(RI[:, 2] @ RJ[:, 2] < 0)
    given = RJ @ HALF_TURNS[1] if turned else RJ
    angle = float(np.arctan2(given[:, 0] @ RI[:, 1], given[:, 0] @ RI[:, 0]))
    return Directions(RI, RI @ rotation_exp(np.array([0.0, 0.0, angle])), given, angle, turned)


def free(RI: Array, RJ: Array, _: float) -> Directions:
    """Any orientation: J's is taken as it is, and I's counts as the same."""
    return Directions(RI, RI, RI)


def inclined(RI: Array, RJ: Array, angle: float) -> Directions:
    """Z of J at an angle to z of I; the markers of the pair have z of I, and z of J lies in their x-z plane."""
    z, other = RI[:, 2], RJ[:, 2]
    x = other - (other @ z) * z
    x = x / np.linalg.norm(x) if np.linalg.norm(x) > 1e-9 else RI[:, 0]
    made = np.column_stack([x, np.cross(z, x), z])
    ideal = np.sin(angle) * x + np.cos(angle) * z
    axis, sine = np.cross(ideal, other), np.linalg.norm(np.cross(ideal, other))
    tilt = axis / sine * np.arctan2(sine, ideal @ other) if sine > 0 else np.zeros(3)
    return Directions(made, made, rotation_exp(tilt) @ made)


class Row(NamedTuple):
    """A joint: its pair, which of x, y, z of J in I are free, what holds its axes, and the name of its number in the file.

    ``type`` is a symbol, or a function of ``angle`` (between the z axes) that makes the row of the pair table.
    """

    type: str | Callable[[float], PairType]
    slides: tuple[bool, bool, bool]
    turns: Callable[[Array, Array, float], Directions]
    number: str = ""
    angle: float = np.pi / 2

    @property
    def anywhere(self) -> bool:
        """Whether x, y and z of J in I are all free."""
        return all(self.slides)

    def pair_type(self) -> str | PairType:
        """The pair."""
        return self.type if isinstance(self.type, str) else self.type(self.angle)


AT, ALONG, ACROSS, ANYWHERE = (False, False, False), (False, False, True), (True, True, False), (True, True, True)
SLIDES = ("Tx", "Ty", "Tz")
HELD_BY_MOTION = "held by a motion alone"


def screw(_: float) -> PairType:
    """Turn and slide in a fixed ratio, nothing else: in FreeCAD the bearings of a screw are joints of their own."""
    return PairType("Screw", "turn and slide in a fixed ratio", freedoms=["Tx", "Ty", "Rz + pitch Tz", "Rx", "Ry"])


def parallel(_: float) -> PairType:
    """Z axes parallel."""
    return PairType("Parallel", "z axes parallel", freedoms=[*SLIDES, "Rz"], reactions=["Mx", "My"])


def no_rotation(_: float) -> PairType:
    """All axes parallel."""
    return PairType("NoRotation", "all axes parallel", freedoms=SLIDES, reactions=["Mx", "My", "Mz"])


def at_angle(angle: float) -> PairType:
    """Z axes at a constant angle: slides, a turn about z of I and one about z of J, which is ``(sin, 0, cos)`` there."""
    axis = Freedom("Rj", (float(np.sin(angle)), 0.0, float(np.cos(angle)), 0.0, 0.0, 0.0))
    return PairType("Angle", "z axes at a constant angle", freedoms=[*SLIDES, "Rz", axis])


def turns_in(order: str) -> list[Freedom]:
    """Turns about axes in some order, ``zxz``; an axis that comes again has the freedom ``Rz2``."""
    found: list[Freedom] = []
    for k, axis in enumerate(order):
        twist = [0.0] * 6
        twist["xyz".index(axis)] = 1.0
        found.append(Freedom(f"R{axis}{order[: k + 1].count(axis)}".removesuffix("1"), tuple(twist)))  # type: ignore[arg-type]
    return found


def motion_type(order: str) -> str | PairType:
    """A pair without any reaction, for a motion between markers that no joint connects: slides along the axes of I, then turns in order."""
    if order == "xyz":
        return "Fr"
    return PairType(f"Motion{order}", HELD_BY_MOTION, freedoms=[*SLIDES, *turns_in(order)], reactions=[])


def ball_type(row: Row, order: str) -> PairType:
    """The pair of a ball in its seat, groove or on its plane whose rotation is turns in order, so that a motion can drive them."""
    slides = [name for name, is_free in zip(SLIDES, row.slides, strict=True) if is_free]
    return PairType(f"{row.type}{order}", "ball that turns in order", freedoms=[*slides, *turns_in(order)])


JOINTS: dict[str, Row] = {
    "FixedJoint": Row("W", AT, same),
    "RevoluteJoint": Row("R", AT, about_z),
    "TranslationalJoint": Row("P", ALONG, same),
    "CylindricalJoint": Row("C", ALONG, about_z),
    "SphericalJoint": Row("S", AT, free),
    "UniversalJoint": Row("U", AT, inclined),
    "PlanarJoint": Row("E", ACROSS, about_z, "offset"),
    "PointInLineJoint": Row("Sg", ALONG, free),
    "PointInPlaneJoint": Row("Sp", ACROSS, free, "offset"),
    "LineInPlaneJoint": Row("Cp", ACROSS, inclined, "offset"),
    "ScrewJoint": Row(screw, ANYWHERE, free, "pitch"),
    "ParallelAxesJoint": Row(parallel, ANYWHERE, about_z),
    "PerpendicularJoint": Row(at_angle, ANYWHERE, inclined),
    "AngleJoint": Row(at_angle, ANYWHERE, inclined, "theIzJz"),
    "NoRotationJoint": Row(no_rotation, ANYWHERE, same),
}
"""Joints that have a pair."""

REFUSED = {
    "CurveCurveContact": "its curves stand in sketches of the parts and may part and bounce (coeffRestitution), which no pair here does; "
    "declare curves that stay in touch in Python: mg.Pair(..., 'Kc', curve=, curve_b=)",
}
"""Joints that have none, and what to do."""
