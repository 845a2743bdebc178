"""MJCF of MuJoCo, read and written.

A mechanism as MJCF, the XML of MuJoCo: a tree of bodies whose loops are cut, each at a link, and closed by equality constraints.

The file holds the mechanism at its start, loops closed. A freedom is a hinge or a slide, a helical one both with a joint equality, a
rotation a ball; ``ref`` makes their coordinates those of mechgraph. A pair that closes a loop is a ``connect`` (spherical) or a ``weld``;
for any other its link is cut in two: the second part, with its share of the mass, hangs on the pair and is welded to the first. Bodies
stand in the frames of their links. Source: MuJoCo documentation, XML reference (body, joint, inertial, equality).

MJCF, the XML of MuJoCo, as a mechanism: bodies are links, joints are pairs, equality constraints close loops.

Several joints of a body are pairs with massless links between them, in their order; a body without a joint is welded to its parent. The
configuration of the file, joint coordinates ``ref``, is the start. A link that ``save`` cut in two is one again. Source: MuJoCo
documentation, XML reference (compiler, default, body, joint, inertial, equality, actuator).
"""

from __future__ import annotations

import html
import os
import re
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from mechgraph.errors import HIDDEN, DeclarationError, FileError
from mechgraph.exchange.syntax import XmlElement, marker_at, pose_about, read_xml
from mechgraph.fields import axes_of
from mechgraph.files import write_whole
from mechgraph.kinetostatics import assemble
from mechgraph.maths.inertia import physical_faults, shifted
from mechgraph.maths.se3 import Array, compose, inverse, matrix_quaternion, move_twist, quaternion_matrix
from mechgraph.memo import dataclass
from mechgraph.model.couplings import Coupling
from mechgraph.model.loads import Gravity
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.motion import Drive
from mechgraph.model.pair import Link, Pair
from mechgraph.pairs import pair_type as evaluation
from mechgraph.pairs.factors import ConstantScrew
from mechgraph.quantities import shown


@dataclass(frozen=True)
class Compiler:
    """How angles are read, and where faults go."""

    radians: bool
    order: str
    faults: list[str]

    def angle(self, value: float) -> float:
        """An angle of the file in radians."""
        return value if self.radians else float(np.deg2rad(value))


def pose_of(e: XmlElement, c: Compiler) -> Array:
    """Position and orientation of an element in its parent."""
    given = [key for key in ORIENTATIONS if key in e.attributes]
    if len(given) > 1:
        c.faults.append(f"{e.title}: has {' and '.join(given)}; one of them says the orientation")
    R = _rotation(given[0], e.numbers(given[0], ORIENTATIONS[given[0]], None, c.faults), e, c) if given else np.eye(3)
    return np.column_stack([R, e.numbers("pos", (3,), np.zeros(3), c.faults)])


ORIENTATIONS = {"quat": (4,), "axisangle": (4,), "euler": (3,), "xyaxes": (2, 3), "zaxis": (3,)}
"""Attributes that say an orientation, with the shapes of their numbers."""


def _rotation(key: str, given: Array, e: XmlElement, c: Compiler) -> Array:
    """The orientation that an attribute says; one without a direction is none.

    ``euler``: three turns in the order of the compiler, about axes that turn along (small letters) or stay (capitals). ``zaxis``: the
    smallest turn that brings z there.
    """
    turn: Any = scipy.spatial.transform.Rotation
    if key == "euler":
        return np.asarray(turn.from_euler(c.order.swapcase(), [c.angle(v) for v in given]).as_matrix())
    if key == "xyaxes":
        x, z = given[0], np.cross(*given)
        if not z.any():
            c.faults.append(f"{e.title}: xyaxes are parallel")
            return np.eye(3)
        return axes_of(z, x)
    if not (given[:3] if key == "axisangle" else given).any():
        return np.eye(3)
    if key == "quat":
        return quaternion_matrix(given / np.linalg.norm(given))
    axis, angle = given[:3], c.angle(given[-1])
    if key == "zaxis":
        axis = np.cross([0.0, 0, 1], given)
        angle = np.arctan2(np.linalg.norm(axis), given[2])
        axis = axis if axis.any() else np.array([1.0, 0, 0])
    return np.asarray(turn.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix())


WORLD = "world"
"""Name of the frame in MJCF."""
ENTRIES = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])
"""Places of the entries of a tensor in ``fullinertia``: xx, yy, zz, xy, xz, yz."""
CUT = "(cut"
"""What follows the name of a link in that of a part cut from it."""


@dataclass
class WrittenBody:
    """A body: its name, the link whose frame it stands in, its pose in its parent, its joints as tag and attributes."""

    name: str
    link: str
    pose: Array
    joints: list[tuple[str, dict[str, Any]]] = field(default_factory=list)
    children: list[WrittenBody] = field(default_factory=list)


def _numbers(values: Any) -> str:
    return " ".join(f"{v + 0.0:.17g}" for v in np.ravel(values).tolist())


class Writer:
    """The elements of the file, and what MJCF cannot say (``faults``)."""

    def __init__(self, m: Mechanism) -> None:
        self.m = assemble(m)
        self.faults: list[str] = []
        self.equalities: list[tuple[str, dict[str, Any]]] = []
        self.poses: dict[str, Array] = {self.m.frame: np.eye(3, 4)}
        self.cuts: dict[str, int] = {}
        self.root = WrittenBody(WORLD, self.m.frame, np.eye(3, 4))
        self.bodies = {self.m.frame: self.root}
        self.build()

    # --- geometry ---------------------------------------------------------------------------------------------------

    def coordinates(self, pair: Pair) -> Array:
        """Coordinates ``(f,)`` of a pair at the start."""
        return np.array([self.m.start[name] for name in pair.freedom_names])

    def inner_frames(self, pair: Pair) -> list[Array]:
        """Frames ``(3, 4, 1, 1)`` of a pair in that of marker A."""
        x = evaluation.coordinates_to_state(pair.type, self.coordinates(pair)[:, None, None])
        return evaluation.frames_of(pair.type, np.array([[pair.pitch_per_radian]]), x)

    def step(self, pair: Pair) -> Array:
        """The pose of link b in link a at the start."""
        A, B = (marker.pose() for marker in pair.markers)
        return compose(compose(A, self.inner_frames(pair)[-1][:, :, 0, 0]), inverse(B))

    def joints(self, pair: Pair, child: str) -> list[tuple[str, dict[str, Any]]]:
        """The joints of a body that moves by a pair, in the frame of its link: screws as they stand at the start.

        ``T_b = T_a A D(q) B^-1``: about the start the factors of D follow each other as turns and slides along their present screws;
        from b to a their order and sense are the opposite ones.
        """
        forward, pitch = child == pair.b, np.array([[pair.pitch_per_radian]])
        A = compose(inverse(self.poses[child]), compose(self.poses[pair.a], pair.markers[0].pose()))
        frames = [compose(A[:, :, None, None], X) for X in self.inner_frames(pair)]
        q, out = self.coordinates(pair), []
        for step, columns, _ in evaluation.placed(pair.type):
            names = pair.freedom_names[columns]
            before = frames[columns.start]
            if step.holds_rotation:
                made = [("joint", {"name": pair.name, "type": "ball", "pos": before[:, 3, 0, 0]})]
            elif isinstance(step, ConstantScrew):
                local = step.twists(np.zeros((1, 1, 1)), pitch)
                twist = move_twist(before, local[:, 0])[:, 0, 0]
                alone = pair.type.f == 1
                made = self.screw(pair.name if alone else names[0], twist if forward else -twist, q[columns.start])
            else:
                self.faults.append(
                    f"pair {pair.name!r} ({pair.type.name}): a motion that is no turn, slide or rotation"
                )
                made = []
            out.append(made)
        return [joint for made in (out if forward else reversed(out)) for joint in made]

    def screw(self, name: str, twist: Array, q: float) -> list[tuple[str, dict[str, Any]]]:
        """Hinge, slide, or both coupled: a twist ``(w, p x w + h w)`` turns about the line through p and advances by h a radian."""
        w, v = twist[:3], twist[3:]
        if not w.any():
            return [("joint", {"name": name, "type": "slide", "axis": v, "ref": q})]
        h = float(w @ v)
        hinge = ("joint", {"name": name, "type": "hinge", "pos": np.cross(w, v), "axis": w, "ref": q})
        if abs(h) <= 1e-15 * (1 + np.linalg.norm(v)):
            return [hinge]
        slide = f"{name} advance"
        self.equalities.append(("joint", {"joint1": slide, "joint2": name, "polycoef": [0, h, 0, 0, 0]}))
        return [hinge, ("joint", {"name": slide, "type": "slide", "axis": w, "ref": 0.0})]

    # --- tree and loops ----------------------------------------------------------------------------------------------

    def build(self) -> None:
        """Grow the tree from the frame, the nearest links first; close loops with the pairs that are left."""
        m, hung = self.m, set()
        at: dict[str, list[Pair]] = {link.name: [] for link in m.links}
        for pair in m.pairs:
            at[pair.a].append(pair)
            at[pair.b].append(pair)
        front = deque([m.frame])
        while front:
            parent = front.popleft()
            for pair in at[parent]:
                child = pair.b if pair.a == parent else pair.a
                if child not in self.bodies:
                    move = self.step(pair) if pair.a == parent else inverse(self.step(pair))
                    self.poses[child] = compose(self.poses[parent], move)
                    self.bodies[child] = self.hung(WrittenBody(child, child, move), parent, pair)
                    hung.add(pair.name)
                    front.append(child)
        for pair in m.pairs:
            if pair.name not in hung:
                self.close(pair)
        for coupling in m.couplings:
            self.couple(coupling.name, coupling.terms)

    def hung(self, body: WrittenBody, parent: str, pair: Pair) -> WrittenBody:
        """A body hung on its parent by a pair."""
        body.joints = self.joints(pair, body.link)
        self.bodies[parent].children.append(body)
        return body

    def close(self, pair: Pair) -> None:
        """Close a loop by a pair: at a point, rigidly, or by a weld between the two parts of a link that is cut."""
        ends = [self.bodies[end].name for end in (pair.a, pair.b)]
        steps = pair.type.steps
        if len(steps) == 1 and steps[0].holds_rotation:
            anchor = pair.markers[0].point
            given = {"name": pair.name, "body1": ends[0], "body2": ends[1], "anchor": anchor}
            self.equalities.append(("connect", given))
            return
        if not steps:
            self.weld(pair.name, ends[0], ends[1], self.step(pair))
            return
        child, parent = (pair.a, pair.b) if pair.b == self.m.frame else (pair.b, pair.a)
        count = self.cuts[child] = self.cuts.get(child, 0) + 1
        pose = compose(inverse(self.poses[parent]), self.poses[child])
        part = self.hung(WrittenBody(f"{child} {CUT} {count})", child, pose), parent, pair)
        self.weld(f"{part.name} closed", child, part.name, np.eye(3, 4))

    def weld(self, name: str, body1: str, body2: str, pose: Array) -> None:
        """A weld that holds body2 at a pose in body1."""
        relative = [*pose[:, 3], *matrix_quaternion(pose[:, :3])]
        self.equalities.append(("weld", {"name": name, "body1": body1, "body2": body2, "relpose": relative}))

    def couple(self, name: str, terms: Sequence[tuple[str, float]]) -> None:
        """``c_1 q_1 + c_2 q_2 = constant`` as a joint equality about the start."""
        if len(terms) > 2:
            self.faults.append(f"coupling {name!r}: relates {len(terms)} freedoms; a joint equality relates two")
            return
        names = [self.joint_name(freedom) for freedom, _ in terms]
        ratio = -terms[1][1] / terms[0][1] if len(terms) == 2 else 0.0
        second = {"joint2": names[1]} if len(terms) == 2 else {}
        self.equalities.append(("joint", {"name": name, "joint1": names[0], **second, "polycoef": [0, ratio, 0, 0, 0]}))

    def joint_name(self, freedom: str) -> str:
        """The joint of a freedom."""
        pair = self.m.pairs[self.m.freedom(freedom)[0]]
        return pair.name if pair.type.f == 1 else self.m.full_name(freedom)

    # --- text --------------------------------------------------------------------------------------------------------

    def inertial(self, body: WrittenBody) -> dict[str, Any]:
        """Mass, center and inertia of a body: its share of those of its link."""
        link = self.m.link(body.link)
        share = 1 / (1 + self.cuts.get(body.link, 0))
        inertia = np.zeros((3, 3)) if link.inertia is None else np.array(link.inertia)
        smallest = float(np.linalg.eigvalsh(inertia)[0])
        if not link.mass > 0 or smallest * share < 1e-14 or physical_faults(inertia):
            self.faults.append(
                f"link {link.name!r}: mass {link.mass:g}, least moment of inertia {smallest:.3g}; MuJoCo moves only bodies with a mass "
                "and three moments above 0, those of a body. Give it an inertia (mg.inertia.box, .cylinder, ...)"
            )
            return {}
        full = inertia[(0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)] * share
        return {"pos": link.center, "mass": link.mass * share, "fullinertia": full}

    def element(self, tag: str, attributes: dict[str, Any], depth: int, end: str = "/>") -> str:
        """One line of the file."""
        words = [tag]
        for key, value in attributes.items():
            if isinstance(value, str) and (HIDDEN.search(value) or not {"\t", "\n"}.isdisjoint(value)):
                self.faults.append(f"{key} {shown(value)}: a name with characters that XML cannot hold")
            words.append(f'{key}="{html.escape(value if isinstance(value, str) else _numbers(value))}"')
        return "  " * depth + "<" + " ".join(words) + end

    def tree(self) -> Iterator[str]:
        """The lines of all bodies; a tag to close stands below its children on the stack."""
        stack: list[tuple[WrittenBody | None, int]] = [(body, 2) for body in reversed(self.root.children)]
        while stack:
            body, depth = stack.pop()
            if body is None:
                yield "  " * depth + "</body>"
                continue
            place = {"pos": body.pose[:, 3], "quat": matrix_quaternion(body.pose[:, :3])}
            yield self.element("body", {"name": body.name, **place}, depth, ">")
            yield self.element("inertial", self.inertial(body), depth + 1)
            for tag, attributes in body.joints:
                yield self.element(tag, attributes, depth + 1)
            stack.append((None, depth))
            stack += [(child, depth + 1) for child in reversed(body.children)]

    def lines(self) -> Iterator[str]:
        """The lines of the file."""
        m = self.m
        gravity = np.zeros(3)
        for load in m.loads:
            if isinstance(load, Gravity):
                gravity = gravity + np.asarray(load.acceleration, float)
            else:
                self.faults.append(
                    f"load {shown(load.kind)}: only Gravity is written; save m.replace(loads=[...]) without it"
                )
        if any(link.name == WORLD and link.name != m.frame for link in m.links):
            self.faults.append(f"link {WORLD!r}: MJCF has this name for the frame alone; rename it")
        yield self.element("mujoco", {"model": m.name}, 0, ">")
        yield self.element("compiler", {"angle": "radian", "autolimits": "true"}, 1)
        yield self.element("option", {"gravity": gravity}, 1)
        yield "  <worldbody>"
        yield from self.tree()
        yield "  </worldbody>"
        for tag, rows in (("equality", self.equalities), ("actuator", self.motors())):
            if rows:
                yield f"  <{tag}>"
                yield from (self.element(kind, attributes, 2) for kind, attributes in rows)
                yield f"  </{tag}>"
        yield "</mujoco>"

    def motors(self) -> list[tuple[str, dict[str, Any]]]:
        """A motor for each driven freedom."""
        names = [self.joint_name(drive.freedom) for drive in self.m.drives]
        return [("motor", {"name": f"{name} drive", "joint": name}) for name in names]


def save_mjcf(m: Mechanism, path: str | os.PathLike[str]) -> None:
    """Write a mechanism as MJCF, at its start, loops cut at links and closed by equality constraints.

    Raises
    ------
    FileError
        where MJCF cannot say something (all of it is named), or the file cannot be written; AssemblyError where the loops cannot be closed.
    """
    writer = Writer(m)
    text = "\n".join(writer.lines()) + "\n"
    if writer.faults:
        why = "\n  ".join(dict.fromkeys(writer.faults))
        raise FileError(path, f"mechanism {m.name!r} cannot be written as MJCF:\n  {why}")
    write_whole(path, [text])


JOINTS = {"hinge": ("R", "Rz"), "slide": ("P", "Tz"), "ball": ("S", "")}
"""Joints with the symbol of their pair and the freedom that ``ref`` belongs to."""
NOT_APPLIED = ("range", "stiffness", "damping", "frictionloss", "armature", "springref")
"""Attributes of joints that a mechanism of rigid links and ideal pairs does not have."""
REFUSED = ("include", "composite", "replicate", "attach", "flexcomp", "plugin", "deformable", "tendon", "frame")
"""Elements that change the bodies or their forces and are not read."""
IGNORED = {"geom", "site", "camera", "light", "inertial", "joint", "freejoint", "body"}
PART = re.compile(rf".+ {re.escape(CUT)} \d+\)")


@dataclass
class ReadBody:
    """A body with its parent and its pose there."""

    name: str
    parent: str
    pose: Array
    element: XmlElement


@dataclass
class MjcfReader:
    """Collects links, pairs and faults."""

    path: Path
    root: XmlElement
    faults: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    bodies: dict[str, ReadBody] = field(default_factory=dict)
    poses: dict[str, Array] = field(default_factory=lambda: {WORLD: np.eye(3, 4)})
    links: dict[str, Link] = field(default_factory=lambda: {WORLD: Link(WORLD)})
    pairs: list[Pair] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)
    start: dict[str, float] = field(default_factory=dict)
    frame: str = WORLD
    turn: Array = field(default_factory=lambda: np.eye(3))

    def section(self, tag: str) -> list[XmlElement]:
        """The children of all sections of a tag."""
        return [child for part in self.root.all(tag) for child in part.children]

    def option(self, tag: str, key: str, default: str) -> str:
        """The last value of an attribute of the sections of a tag."""
        return next((part.attributes[key] for part in reversed(self.root.all(tag)) if key in part.attributes), default)

    # --- attributes -------------------------------------------------------------------------------------------------

    def defaults(self) -> dict[str, dict[str, dict[str, str]]]:
        """Attributes by class and tag; a class inside another begins with those of the outer one."""
        found: dict[str, dict[str, dict[str, str]]] = {"main": {}}
        stack = [(part, "main", "main") for part in self.root.all("default")]
        while stack:
            part, outer, fallback = stack.pop()
            name = part.attributes.get("class", fallback)
            rows = found[name] = {tag: dict(row) for tag, row in found[outer].items()}
            for child in part.children:
                if child.tag == "default":
                    stack.append((child, name, f"{name} (line {child.line})"))
                else:
                    rows[child.tag] = rows.get(child.tag, {}) | child.attributes
        return found

    def with_defaults(self, element: XmlElement, inherited: str) -> XmlElement:
        """An element with the attributes of its class; its own come first."""
        rows = self.classes.get(element.attributes.get("class", inherited))
        if rows is None:
            given = shown(element.attributes.get("class", inherited))
            self.faults.append(f"{element.title}: there is no class {given}")
            return element
        return XmlElement(element.tag, rows.get(element.tag, {}) | element.attributes, element.line, element.children)

    # --- bodies -----------------------------------------------------------------------------------------------------

    def read(self) -> tuple[Mechanism, tuple[str, ...]]:
        """The mechanism, and what was taken otherwise than it stands.

        Raises
        ------
        DeclarationError
            with all faults.
        """
        self.classes = self.defaults()
        radians = self.option("compiler", "angle", "degree") == "radian"
        self.compiler = Compiler(radians, self.option("compiler", "eulerseq", "xyz"), self.faults)
        if self.option("compiler", "coordinate", "local") != "local":
            self.faults.append("compiler: coordinate='global' is not read; save the file with a newer MuJoCo")
        for element in self.root.children:
            if element.tag in REFUSED and (element.children or element.attributes):
                self.faults.append(f"{element.title}: is not read")
        self.grow()
        for element in self.section("equality"):
            self.equality(self.with_defaults(element, "main"))
        self.join_parts()
        drives = self.drives()
        g = next((e.numbers("gravity", (3,), None, self.faults) for e in reversed(self.root.all("option")) if "gravity" in e.attributes),
                 np.array([0, 0, -9.81]))  # fmt: skip
        name = self.root.attributes.get("model", self.path.stem)
        if self.faults:
            raise DeclarationError(f"MJCF {shown(name)}", self.faults)
        made = Mechanism(
            name, list(self.links.values()), self.pairs, drives, [Gravity(tuple(self.turn.T @ g))] if g.any() else [],
            couplings=self.couplings, frame=self.frame, start=self.start, source="an MJCF file", description=". ".join(self.notes),
        )  # fmt: skip
        return made, tuple(self.notes)

    def grow(self) -> None:
        """All bodies, their links and the pairs that hang them on their parents."""
        stack = [(child, WORLD, "main") for child in reversed(self.section("worldbody"))]
        while stack:
            e, parent, inherited = stack.pop()
            if e.tag in REFUSED:
                self.faults.append(f"{e.title}: is not read")
            if e.tag != "body":
                continue
            name = e.attributes.get("name", f"body on line {e.line}")
            if name in self.links:
                self.faults.append(f"{e.title}: the name is taken")
            inherited = e.attributes.get("childclass", inherited)
            body = self.bodies[name] = ReadBody(name, parent, pose_of(e, self.compiler), e)
            self.poses[name] = compose(self.poses[parent], body.pose)
            self.links[name] = self.link(body)
            self.hang(body, inherited)
            stack += [(child, name, inherited) for child in reversed(e.children)]

    def link(self, body: ReadBody) -> Link:
        """The link of a body with its mass."""
        e = body.element.first("inertial")
        if e is None:
            if body.element.first("geom") is not None:
                self.notes.append(
                    f"body {body.name!r} has no <inertial>: masses of geoms are not computed, it is taken as massless"
                )
            return Link(body.name)
        X = pose_of(e, self.compiler)
        mass = e.number("mass", None, self.faults)
        if "fullinertia" in e.attributes:
            I = e.numbers("fullinertia", (6,), None, self.faults)[ENTRIES]
        else:
            I = np.diag(e.numbers("diaginertia", (3,), None, self.faults))
        if not mass:
            return Link(body.name)
        I = X[:, :3] @ I @ X[:, :3].T
        return Link(body.name, mass, X[:, 3], (I + I.T) / 2, unphysical=bool(physical_faults((I + I.T) / 2)))

    def hang(self, body: ReadBody, inherited: str) -> None:
        """The pairs between a body and its parent: its joints in order, or a weld."""
        joints = [child for child in body.element.children if child.tag in ("joint", "freejoint")]
        elements = [self.with_defaults(e, inherited) for e in joints]
        if any(e.tag == "freejoint" or e.attributes.get("type") == "free" for e in elements):
            roots = [child for child in self.section("worldbody") if child.tag == "body"]
            if body.parent == WORLD and len(roots) == 1 and len(joints) == 1:
                self.frame = body.name
                del self.links[WORLD]
                self.turn = body.pose[:, :3]
                self.poses[body.name] = np.eye(3, 4)
                self.notes.append(f"body {body.name!r} is free in the world: it is the frame here")
            else:
                self.faults.append(f"{body.element.title}: a free joint; only a single body on the world may have one")
            return
        if not joints:
            self.pair(f"{body.name} on {body.parent}", "W", body.parent, body.name, body.pose, np.eye(3, 4))
        between = [f"{body.name} before {e.attributes.get('name', k)}" for k, e in enumerate(joints[1:], 1)]
        self.links |= {name: Link(name) for name in between}
        for k, (e, (a, b)) in enumerate(zip(elements, pairwise([body.parent, *between, body.name]), strict=False)):
            self.joint(e, a, b, np.eye(3, 4) if k else body.pose)

    def joint(self, e: XmlElement, a: str, b: str, X: Array) -> None:
        """The pair of a joint from a to b, whose frame stands at X in a where the coordinate is ``ref``."""
        kind = e.attributes.get("type", "hinge")
        if kind not in JOINTS:
            self.faults.append(f"{e.title}: type {shown(kind)} is not known (known: {', '.join(JOINTS)}, free)")
            return
        name = e.attributes.get("name", f"joint on line {e.line}")
        axis = e.numbers("axis", (3,), np.array([0.0, 0, 1]), self.faults)
        if not axis.any():
            self.faults.append(f"{e.title}: axis has length 0")
            return
        symbol, freedom = JOINTS[kind]
        M = pose_about(axis, e.numbers("pos", (3,), np.zeros(3), self.faults))
        ref = e.number("ref", 0.0, self.faults)
        ref = self.compiler.angle(ref) if freedom.startswith("R") else ref
        back = np.eye(3, 4)
        if freedom.startswith("R"):
            c, s = np.cos(ref), np.sin(ref)
            back[:2, :2] = [[c, s], [-s, c]]
        elif freedom:
            back[2, 3] = -ref
        self.pair(name, symbol, a, b, compose(X, compose(M, back)), M)
        if ref:
            self.start[f"{name}.{freedom}"] = ref
        dropped = [key for key in NOT_APPLIED if key in e.attributes and set(e.attributes[key].split()) - {"0"}]
        if dropped:
            self.notes.append(f"{e.tag} {name!r}: {', '.join(dropped)} not applied")

    def pair(self, name: str, symbol: str, a: str, b: str, A: Array, B: Array) -> None:
        """A pair with these marker poses in its links."""
        self.pairs.append(Pair(name, symbol, a, b, on_a=marker_at(A), on_b=marker_at(B)))

    # --- equality, parts, drives ---------------------------------------------------------------------------------------

    def equality(self, e: XmlElement) -> None:
        """A pair or coupling that closes a loop."""
        if e.attributes.get("active", "true") != "true":
            self.notes.append(f"{e.title} is not active: left out")
            return
        makers = {"connect": self.connect, "weld": self.connect, "joint": self.couple}
        if e.tag not in makers:
            self.faults.append(f"{e.title}: this equality is not read (read are {', '.join(makers)})")
            return
        taken = {pair.name for pair in self.pairs} | {c.name for c in self.couplings}
        name = e.attributes.get("name", f"{e.tag} on line {e.line}")
        makers[e.tag](e, f"{name} ({e.tag})" if name in taken else name)

    def ends(self, e: XmlElement) -> tuple[str, str] | None:
        """The two bodies of an equality; the second is the world where left out."""
        names = e.attributes.get("body1", ""), e.attributes.get("body2", WORLD)
        unknown = [shown(name) for name in names if name not in self.poses]
        if unknown or names[0] == names[1]:
            why = f"there is no body {', '.join(unknown)}" if unknown else "joins a body to itself"
            self.faults.append(f"{e.title}: {why} (bodies are read; sites are not)")
            return None
        return names

    def connect(self, e: XmlElement, name: str) -> None:
        """A common point of two bodies, at the anchor in the first; or a weld as they stand, or at a relative pose."""
        ends = self.ends(e)
        if ends is None:
            return
        if e.tag == "weld":
            given = e.numbers("relpose", (7,), np.zeros(7), self.faults)
            A = compose(inverse(self.poses[ends[0]]), self.poses[ends[1]])
            if given[3:].any():
                A = np.column_stack([quaternion_matrix(given[3:] / np.linalg.norm(given[3:])), given[:3]])
            self.pair(name, "W", *ends, A, np.eye(3, 4))
            return
        A = np.column_stack([np.eye(3), e.numbers("anchor", (3,), None, self.faults)])
        B = compose(inverse(self.poses[ends[1]]), compose(self.poses[ends[0]], A))
        self.pair(name, "S", *ends, A, B)

    def couple(self, e: XmlElement, name: str) -> None:
        """``q_1 - ref_1 = c_0 + c_1 (q_2 - ref_2)``."""
        freedoms = {pair.name: pair.freedom_names[0] for pair in self.pairs if pair.type.f == 1}
        names = [e.attributes[key] for key in ("joint1", "joint2") if key in e.attributes]
        poly = e.numbers("polycoef", (5,), np.array([0.0, 1, 0, 0, 0]), self.faults)
        unknown = [shown(joint) for joint in names if joint not in freedoms]
        if unknown or not names:
            self.faults.append(f"{e.title}: there is no hinge or slide {', '.join(unknown)}")
        elif len(names) == 2 and poly[2:].any():
            self.faults.append(f"{e.title}: polycoef of degree above 1; a coupling is linear")
        else:
            terms, factors = [freedoms[joint] for joint in names], (1.0, -float(poly[1]))
            refs = [self.start.get(freedom, 0.0) for freedom in terms]
            constant = float(poly[0]) + sum(c * ref for c, ref in zip(factors, refs, strict=False))
            kept = [(q, c) for q, c in zip(terms, factors, strict=False) if c]
            self.couplings.append(Coupling(kept, name=name, constant=constant))

    def join_parts(self) -> None:
        """Links that ``save`` cut: the parts and the welds between them become one link again."""
        for name in [name for name in self.links if PART.fullmatch(name)]:
            link = name.rpartition(f" {CUT} ")[0]
            weld = next((p for p in self.pairs if p.type.f == 0 and {p.a, p.b} == {name, link}), None)
            if weld is None or link not in self.links:
                continue
            whole = {name: link}
            self.pairs = [p.replace(a=whole.get(p.a, p.a), b=whole.get(p.b, p.b)) for p in self.pairs if p is not weld]
            self.links[link] = joined(self.links[link], self.links.pop(name))

    def drives(self) -> list[Drive]:
        """Joints that an actuator moves."""
        freedoms = {pair.name: pair.freedom_names[0] for pair in self.pairs if pair.type.f == 1}
        moved = {e.title: freedoms.get(e.attributes.get("joint", "")) for e in self.section("actuator")}
        self.notes += [f"{title} drives no hinge or slide: left out" for title, q in moved.items() if q is None]
        return [Drive(freedom) for freedom in dict.fromkeys(filter(None, moved.values()))]


def joined(one: Link, other: Link) -> Link:
    """Two parts of one link, in the same frame: masses added, center and inertia of both."""
    if not other.mass:
        return one
    if not one.mass:
        return other.replace(name=one.name)
    masses = np.array([one.mass, other.mass])
    centers = np.array([one.center, other.center], float)
    total, center = float(masses.sum()), masses @ centers / masses.sum()
    I = sum(shifted(part.inertia, part.mass, center - np.array(part.center)) for part in (one, other))
    return Link(one.name, total, center, I, unphysical=one.unphysical or other.unphysical)


def read_mjcf(path: Path) -> tuple[Mechanism, tuple[str, ...]]:
    """The mechanism of an MJCF file, and what was taken otherwise than it stands."""
    return MjcfReader(path, read_xml(path, "MJCF", "mujoco")).read()
