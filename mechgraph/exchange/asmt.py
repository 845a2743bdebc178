"""Assemblies of Ondsel and FreeCAD (ASMT): what a file says, and where it stands.

Joints of FreeCAD as pairs: a table of what marker J may do against marker I, and how the two are made to fit exactly.

Source of the conditions: the joints of OndselSolver, each a list of conditions that a point of J lies at, on the z axis or in the plane of
I (x, y or z of J in the frame of I, with an offset along z), and that axes of the two are perpendicular. Conditions on axes do not tell an
axis from its opposite; a pair does, so J is turned half round where that fits better, which is said.

FreeCAD assemblies as files hold them: parts, markers, joints, motions, limits, and the results that were stored with them.

The format is that of FreeCAD's Assembly workbench and its solver (OndselSolver 2023 to 2026, class names ASMT...): an indented text whose
first line names the program; `Position3D` and `RotationMatrix` place a part in the assembly, a `RefPoint` in its part and a `Marker` in
its RefPoint, the rows of a matrix one below the other; a `PrincipalMassMarker`, which is a marker too, has the mass center, the principal
directions as columns and the principal moments; joints and motions name markers by path, `/Assembly/Part/Marker`. Joints hold marker J to
marker I. `Variables` have names and formulas. An `Assembly` among the parts is a part of its own and brings its parts, placed in its frame,
its joints, motions, limits and forces; what is of it has its name before its own, `Inner/Part`.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mechgraph.document import Document, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError, FileError, listed
from mechgraph.exchange.syntax import Node, is_name, numbers_of, tree_of
from mechgraph.files import text_of
from mechgraph.maths.se3 import Array, compose, inverse, rotation_exp, rotation_log
from mechgraph.memo import dataclass
from mechgraph.model.toml import LONGEST_SWEEP
from mechgraph.pairs.factors import Freedom
from mechgraph.pairs.pair_type import PairType
from mechgraph.quantities import shown


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


class JointRow(NamedTuple):
    """A joint: its pair, which of x, y, z of J in I are free, what holds its axes, and the name of its number in the file.

    ``type`` is a symbol, a row of the pair table, or a function of ``angle`` (between the z axes) that makes one.
    """

    type: str | PairType | Callable[[float], PairType]
    slides: tuple[bool, bool, bool]
    turns: Callable[[Array, Array, float], Directions]
    number: str = ""
    angle: float = np.pi / 2


AT, ALONG, ACROSS, ANYWHERE = (False, False, False), (False, False, True), (True, True, False), (True, True, True)
SLIDES = ("Tx", "Ty", "Tz")


SCREW = PairType("Screw", "turn and slide in a fixed ratio", freedoms=["Tx", "Ty", "Rz + pitch Tz", "Rx", "Ry"])
"""Nothing else: in FreeCAD the bearings of a screw are joints of their own."""
PARALLEL = PairType("Parallel", "z axes parallel", freedoms=[*SLIDES, "Rz"], reactions=["Mx", "My"])
NO_ROTATION = PairType("NoRotation", "all axes parallel", freedoms=SLIDES, reactions=["Mx", "My", "Mz"])


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
    return PairType(f"Motion{order}", "held by a motion alone", freedoms=[*SLIDES, *turns_in(order)], reactions=[])


def ball_type(row: JointRow, order: str) -> PairType:
    """The pair of a ball in its seat, groove or on its plane whose rotation is turns in order, so that a motion can drive them."""
    slides = [name for name, is_free in zip(SLIDES, row.slides, strict=True) if is_free]
    return PairType(f"{row.type}{order}", "ball that turns in order", freedoms=[*slides, *turns_in(order)])


JOINTS: dict[str, JointRow] = {
    "FixedJoint": JointRow("W", AT, same),
    "RevoluteJoint": JointRow("R", AT, about_z),
    "TranslationalJoint": JointRow("P", ALONG, same),
    "CylindricalJoint": JointRow("C", ALONG, about_z),
    "SphericalJoint": JointRow("S", AT, free),
    "UniversalJoint": JointRow("U", AT, inclined),
    "PlanarJoint": JointRow("E", ACROSS, about_z, "offset"),
    "PointInLineJoint": JointRow("Sg", ALONG, free),
    "PointInPlaneJoint": JointRow("Sp", ACROSS, free, "offset"),
    "LineInPlaneJoint": JointRow("Cp", ACROSS, inclined, "offset"),
    "ScrewJoint": JointRow(SCREW, ANYWHERE, free, "pitch"),
    "ParallelAxesJoint": JointRow(PARALLEL, ANYWHERE, about_z),
    "PerpendicularJoint": JointRow(at_angle, ANYWHERE, inclined),
    "AngleJoint": JointRow(at_angle, ANYWHERE, inclined, "theIzJz"),
    "NoRotationJoint": JointRow(NO_ROTATION, ANYWHERE, same),
}
"""Joints that have a pair."""

REFUSED = {
    "CurveCurveContact": "its curves stand in sketches of the parts, which are not read; declare them in Python: "
    "mg.Pair(..., 'Kc', curve=, curve_b=, closed='force', restitution=)",
}
"""Joints that have none, and what to do."""


FIRST_LINES = ("OndselSolver", "FreeCADMbD", "freeCAD: 3D CAD with Motion Simulation  by  askoh.com")
IN_LINE = "InLineForceTorque"
"""The force that is read."""
NO_FORCE = "forces are not read from FreeCAD files; delete it there and give the load in Python (mg.Spring, mg.Wrench, mg.Effort)"
CONNECTIONS = ("Joints", "Motions", "Limits", "ForceTorques")
"""Blocks of what stands between two markers; the last one stands beside the others' block."""
SECTIONS = (
    "Notes", "Name", "Position3D", "RotationMatrix", "Velocity3D", "Omega3D", "RefPoints", "RefCurves", "RefSurfaces", "Parts",
    "Assemblies", "Variables", "KinematicIJs", "ConstraintSets", "ForceTorques", "ConstantGravity", "SimulationParameters",
    "AnimationParameters", "PrincipalMassMarker",
)  # fmt: skip
"""Blocks of an assembly that are read, or say nothing of how it moves."""
RESULTS = "TimeSeries"
"""The line from which on results stand."""


@dataclass(frozen=True)
class AsmtPart:
    """A part, or the assembly itself, which is the ground: its placement, mass data in its own frame, where it stands in the file."""

    name: str
    path: str
    pose: Array
    mass: float = 0.0
    center: Array | None = None
    inertia: Array | None = None
    placeholder: bool = False
    line: int = 0


class AsmtMarker(NamedTuple):
    """A marker: its part and its pose ``(3, 4)`` in the frame of the part."""

    part: str
    pose: Array


@dataclass(frozen=True)
class Connection:
    """A joint, motion or limit between marker I and marker J; ``node`` holds its numbers and formulas."""

    kind: str
    name: str
    i: str
    j: str
    joint: str
    node: Node

    @property
    def title(self) -> str:
        """Kind, name and line, for messages."""
        return f"line {self.node.line}: {self.kind} {shown(self.name)}"


@dataclass(frozen=True)
class Assembly:
    """A whole file. ``ground`` is the assembly itself; ``notes`` says what was read otherwise than it stands."""

    name: str
    ground: AsmtPart
    parts: Mapping[str, AsmtPart]
    markers: Mapping[str, AsmtMarker]
    joints: Sequence[Connection]
    motions: Sequence[Connection]
    limits: Sequence[Connection]
    forces: Sequence[Connection]
    gravity: Array
    variables: Mapping[str, str]
    times: Array
    results: Sequence[str]
    results_line: int
    notes: Sequence[str]


class AsmtReader:
    """Reads a file and collects its faults."""

    def __init__(self, path: Path, text: str) -> None:
        lines = text.splitlines()
        if not lines or lines[0].strip() not in FIRST_LINES:
            first = shown(lines[0][:80] if lines else "")
            raise FileError(path, f"is not a valid FreeCAD assembly file: line 1 is {first}")
        end = next((k for k, line in enumerate(lines) if line.startswith(RESULTS)), len(lines))
        self.results, self.results_line = lines[end:], end + 1
        top = tree_of(lines[1:end], 2).child("Assembly")
        if top is None:
            raise FileError(path, "is not a valid FreeCAD assembly file: there is no line Assembly")
        self.top, self.stem = top, path.stem
        self.faults, self.notes = list[str](), list[str]()
        self.markers, self.parts, self.variables = dict[str, AsmtMarker](), dict[str, AsmtPart](), dict[str, str]()
        self.connected: dict[str, list[Connection]] = {key: [] for key in CONNECTIONS}

    def pose(self, node: Node, where: str) -> Array:
        """Position3D and RotationMatrix of a node as a pose; the identity where it has neither."""
        if node.child("Position3D") is None and node.child("RotationMatrix") is None:
            return np.eye(3, 4)
        position = node.numbers("Position3D", (3,), where, self.faults)
        R = node.numbers("RotationMatrix", (3, 3), where, self.faults)
        error = float(np.abs(R.T @ R - np.eye(3)).max())
        if not R.any():  # a fault already
            R = np.eye(3)
        # largest entry of ``R^T R - 1`` of a rotation matrix of few digits; it is made orthogonal
        elif error > 1e-3 or np.linalg.det(R) < 0:
            self.faults.append(f"line {node.line}: {where}: RotationMatrix is no rotation (R^T R - 1 = {error:.2g})")
            R = np.eye(3)
        u, _, vt = np.linalg.svd(R)
        return np.column_stack([u @ vt if error > 1e-15 else R, position])

    def container(self, node: Node, name: str, path: str, within: Array) -> AsmtPart:
        """A part with its mass data, placed ``within`` a frame; its markers are noted."""
        where = f"part {shown(name)}"
        for point in node.under("RefPoints"):
            at = self.pose(point, f"{where}: RefPoint")
            for entry in point.under("Markers"):
                marker = f"{path}/{entry.word('Name')}"
                self.marker(entry, marker, name, compose(at, self.pose(entry, f"marker {marker}")))
        mass = node.child("PrincipalMassMarker")
        pose = compose(within, self.pose(node, where))
        if mass is None:
            return AsmtPart(name, path, pose, line=node.line)
        axes = self.pose(mass, f"{where}: PrincipalMassMarker")
        if mass.word("Name"):
            self.marker(mass, f"{path}/{mass.word('Name')}", name, axes)
        weight = mass.number("Mass", where, self.faults)
        moments = mass.numbers("MomentOfInertias", (3,), where, self.faults)
        if weight < 0:
            self.faults.append(f"line {mass.line}: {where}: Mass = {weight:g}: a mass is not below 0")
        inertia = axes[:, :3] @ np.diag(moments) @ axes[:, :3].T
        placeholder = weight == 1.0 and bool((moments == 1.0).all())
        return AsmtPart(name, path, pose, weight, axes[:, 3], (inertia + inertia.T) / 2, placeholder, node.line)

    def marker(self, node: Node, path: str, part: str, pose: Array) -> None:
        """Notes a marker."""
        if path in self.markers:
            self.faults.append(f"line {node.line}: two markers are named {path}")
        self.markers[path] = AsmtMarker(part, pose)

    def connections(self, entries: Sequence[Node], within: str) -> list[Connection]:
        """Joints, motions, limits or forces of an assembly; those without a name of their own get one."""
        found: dict[str, Connection] = {}
        taken = {entry.word("Name") for entry in entries}
        for k, entry in enumerate(entries, 1):
            name = given = entry.word("Name")
            if not given or given in found:
                tries = (f"{given or entry.text}-{n}" for n in itertools.count(k))
                name = next(free for free in tries if free not in taken)
                why = "has no name" if not given else f"is the second one named {given!r}"
                self.notes.append(f"{entry.text} on line {entry.line} {why} and is called {name!r}")
                taken.add(name)
            i, j, joint = (entry.word(key) for key in ("MarkerI", "MarkerJ", "MotionJoint"))
            found[name] = Connection(entry.text, within + name, i, j, joint, entry)
        return list(found.values())

    def assembly(self, node: Node, ground: AsmtPart) -> None:
        """Parts, variables, joints, motions, limits and forces of an assembly, and of the assemblies within it."""
        within = "" if node is self.top else f"{ground.name}/"
        for entry in (*node.under("Parts"), *node.under("Assemblies")):
            label = entry.word("Name")
            name = within + label
            if not label or name in self.parts or name == ground.name:
                why = "has no name" if not label else f"has the name {name!r}, which is taken"
                self.faults.append(f"line {entry.line}: a part {why}")
            frame = ground.pose if within else np.eye(3, 4)
            part = self.parts[name] = self.container(entry, name, f"{ground.path}/{label}", frame)
            if entry.text == "Assembly":
                self.notes.append(f"assembly {name!r} on line {entry.line} is a part; its own parts stand in its frame")
                self.assembly(entry, part)
        for entry in node.under("Variables"):
            self.variable(entry)
        self.between(node, within)
        for other in (child for child in node.children if child.children and child.text not in SECTIONS):
            self.notes.append(f"block {other.text} on line {other.line} was not read")

    def between(self, node: Node, within: str) -> None:
        """Joints, motions, limits and forces of an assembly; constraints and forces of other kinds are faults."""
        sets = node.child("ConstraintSets") or Node("", 0)
        forces = node.under(CONNECTIONS[-1])
        refused = [entry for key in sets.children if key.text not in CONNECTIONS for entry in key.children]
        for other in (*refused, *(force for force in forces if force.text != IN_LINE)):
            why = NO_FORCE if other in forces else REFUSED.get(other.text, "not known here")
            self.faults.append(f"line {other.line}: {other.text} {shown(other.word('Name'))}: {why}")
        lists = [*(sets.under(key) for key in CONNECTIONS[:-1]), [force for force in forces if force.text == IN_LINE]]
        for key, entries in zip(CONNECTIONS, lists, strict=True):
            self.connected[key] += self.connections(entries, within)

    def variable(self, node: Node) -> None:
        """A variable: its name with the formula below it, or a block of ``Name`` and one other line with the formula below."""
        others = [child for child in node.children if child.text != "Name"]
        named = node.word("Name") if len(others) < len(node.children) else ""
        name, formulas = (named, others[0].children if others else []) if named else (node.text, node.children)
        key = name.lower()
        if len(formulas) != 1 or (named and len(others) != 1):
            self.faults.append(f"line {node.line}: variable {shown(name)}: expected one formula")
        elif key in self.variables or not is_name(name):
            why = "is defined twice" if key in self.variables else "is no name for a variable"
            self.faults.append(f"line {node.line}: variable {shown(name)}: {why}")
        else:
            self.variables[key] = formulas[0].text

    def times(self) -> Array:
        """Times from tstart to tend in steps of hout."""
        node = self.top.child("SimulationParameters")
        if node is None:
            return np.zeros(1)
        start, end, step = (node.number(key, "SimulationParameters", self.faults) for key in ("tstart", "tend", "hout"))
        count = round((end - start) / step) if step > 0 and end > start else 0
        return np.asarray(start + step * np.arange(min(count, LONGEST_SWEEP - 1) + 1), float)

    def read(self) -> Assembly:
        """The whole file.

        Raises
        ------
        DeclarationError
            with all faults of the file.
        """
        name = self.top.word("Name") or self.stem
        ground = self.container(self.top, name, f"/{name}", np.eye(3, 4))
        self.assembly(self.top, ground)
        gravity = np.zeros(3)
        if self.top.child("ConstantGravity") is not None:
            gravity = self.top.numbers("ConstantGravity", (3,), "assembly", self.faults)
        joints, motions, limits, forces = self.connected.values()
        made = Assembly(
            name, ground, self.parts, self.markers, joints, motions, limits, forces,
            gravity, self.variables, self.times(), self.results, self.results_line, self.notes,
        )  # fmt: skip
        if self.faults:
            raise DeclarationError(f"assembly {shown(name)}", self.faults)
        return made


@dataclass(frozen=True)
class Results:
    """What a file that was simulated holds: times ``(T,)`` and, by kind and path, rows of numbers ``(T,)``; the input state is left out."""

    times: Array
    series: Mapping[tuple[str, str], Mapping[str, Array]]


def results_of(assembly: Assembly, path: Path) -> Results:
    """The stored results: lines ``Time``, then ``PartSeries``, ``...JointSeries`` and ``...MotionSeries`` with their path and rows.

    The first number of a row belongs to the input state. Rows of some writers are longer than the times; the rest is left out.

    Raises
    ------
    FileError
        where there are none, or a row has too few numbers.
    """
    series: dict[tuple[str, str], dict[str, Array]] = {}
    times, here = np.zeros(0), None
    for number, line in enumerate(assembly.results, assembly.results_line):
        label, _, rest = line.strip().partition("\t")
        head, _, tail = label.partition(" ")
        if head.endswith("Series") and head != RESULTS:
            here = series.setdefault((head.removesuffix("Series"), (rest or tail).strip()), {})
        elif label in ("Time", "Number") or here is not None:
            row = numbers_of(rest.replace("Input", ""))
            if row is None:
                raise FileError(path, f"line {number}: {label}: expected finite numbers")
            if label == "Time":
                ends = np.flatnonzero(np.diff(row) <= 0)
                times = np.array(row[: int(ends[0]) + 1] if ends.size else row)
            elif here is not None and label:
                here[label] = np.array(row[1:])
    for (kind, owner), rows in series.items():
        short = {label: row.size for label, row in rows.items() if row.size < times.size}
        if short:
            raise FileError(path, f"{kind}Series {owner}: {shown(short)} numbers at {times.size} times")
        rows.update({label: row[: times.size] for label, row in rows.items()})
    if not times.size or not series:
        raise FileError(path, "holds no results to compare with: simulate it in FreeCAD and save it again")
    return Results(times, series)


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


UNMENTIONED = 1e-12
"""Corrections up to here are not worth a word."""


@dataclass
class Standing:
    """Collects what is wrong (``faults``) and what was taken otherwise than it stands (``notes``, markers that were ``moved``)."""

    assembly: Assembly
    faults: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    moved: dict[str, tuple[float, float]] = field(default_factory=dict)

    def part(self, name: str) -> AsmtPart:
        """The part, or the ground."""
        return self.assembly.parts.get(name, self.assembly.ground)

    def ends(self, found: Connection) -> tuple[str, str] | None:
        """The parts of the two markers; None, and a fault, where a marker is not there."""
        markers = self.assembly.markers
        missing = [path for path in (found.i, found.j) if path not in markers]
        if missing:
            names, known = ", ".join(map(shown, missing)), listed(markers, 8)
            self.faults.append(f"{found.title}: there is no marker {names} (there are: {known})")
            return None
        return markers[found.i].part, markers[found.j].part

    def pose(self, marker: str) -> Array:
        """A marker in the assembly, where the parts stand."""
        found = self.assembly.markers[marker]
        return compose(self.part(found.part).pose, found.pose)

    def own(self, part: str, X: Array) -> Array:
        """A pose of the assembly in the frame of a part; that of the ground is global."""
        return X if part == self.assembly.name else compose(inverse(self.part(part).pose), X)

    def number(self, joint: Connection, label: str) -> float:
        """A number of a joint."""
        return joint.node.number(label, joint.title.partition(": ")[2], self.faults)

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
        """Mean radius of the markers and of the mass centers; 1 where all are one point."""
        a = self.assembly
        centers = [part.pose @ [*part.center, 1.0] for part in a.parts.values() if part.center is not None]
        points = np.array([self.pose(path)[:, 3] for path in a.markers] + centers or [np.zeros(3)])
        radius = float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))
        return radius if radius > UNMENTIONED * max(1.0, float(np.abs(points).max())) else 1.0


def assembly_of(path: Path) -> Assembly:
    """A FreeCAD assembly as its file holds it."""
    return AsmtReader(path, text_of(path, "FreeCAD assembly")).read()


AGREES = 1e-4
"""Differences up to here count as agreement: FreeCAD's solver closes to 1e-6 and differentiates twice."""


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
        verdict = f"All that is unique agrees to {AGREES:g}"
        if off:
            worst = max(off, key=lambda d: d.relative)
            count = f"Quantities off by more than {AGREES:g}: {len(off)} of {len(self.differences)}"
            verdict = f"{count}, {worst.quantity} of {worst.of} the most"
        head = ("of", "quantity", "greatest in the file", "difference", "relative", "")
        rows = tuple(d.cells() for d in self.differences)
        blocks = (Paragraph(f"{verdict}, at {self.times} times."), Table(head, rows, "llrrrl"))
        return Document(f"{self.name}: FreeCAD's stored results beside mechgraph's", blocks)


def difference(of: str, quantity: str, ours: Array, theirs: Array, size: float | None = None) -> Difference:
    """The largest difference of vectors ``(T, 3)``; NaN where none of ours is unique."""
    off = np.abs(ours - theirs)
    known = ~np.isnan(off)
    largest = float(off[known].max()) if known.any() else np.nan
    return Difference(of, quantity, largest, float(np.abs(theirs).max()) if size is None else size, int((~known).sum()))
