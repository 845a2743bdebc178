"""MJCF, the XML of MuJoCo, as a mechanism: bodies are links, joints are pairs, equality constraints close loops.

Several joints of a body are pairs with massless links between them, in their order; a body without a joint is welded to its parent. The
configuration of the file, joint coordinates ``ref``, is the start. A link that ``save`` cut in two is one again. Source: MuJoCo
documentation, XML reference (compiler, default, body, joint, inertial, equality, actuator).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mechgraph.algebra.inertia import physical_faults, shifted
from mechgraph.algebra.se3 import Array, compose, inverse, quaternion_matrix
from mechgraph.errors import DeclarationError
from mechgraph.exchange.mjcf_orientation import Compiler, pose_of
from mechgraph.exchange.mjcf_write import CUT, WORLD
from mechgraph.exchange.xml_tree import Element, read_xml
from mechgraph.model.couplings import Coupling
from mechgraph.model.loads import Gravity
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.motion import Drive
from mechgraph.model.pair import Link, Marker, Pair, second_direction
from mechgraph.quantities import shown

JOINTS = {"hinge": ("R", "Rz"), "slide": ("P", "Tz"), "ball": ("S", "")}
"""Joints with the symbol of their pair and the freedom that ``ref`` belongs to."""
NOT_APPLIED = ("range", "stiffness", "damping", "frictionloss", "armature", "springref")
"""Attributes of joints that a mechanism of rigid links and ideal pairs does not have."""
REFUSED = ("include", "composite", "replicate", "attach", "flexcomp", "plugin", "deformable", "tendon", "frame")
"""Elements that change the bodies or their forces and are not read."""
IGNORED = {"geom", "site", "camera", "light", "inertial", "joint", "freejoint", "body"}
PART = re.compile(rf"(?P<link>.+) {re.escape(CUT)} \d+\)")


@dataclass
class Body:
    """A body with its parent and its pose there."""

    name: str
    parent: str
    pose: Array
    element: Element


@dataclass
class Reader:
    """Collects links, pairs and faults."""

    path: Path
    root: Element
    faults: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    bodies: dict[str, Body] = field(default_factory=dict)
    poses: dict[str, Array] = field(default_factory=lambda: {WORLD: np.eye(3, 4)})
    links: dict[str, Link] = field(default_factory=lambda: {WORLD: Link(WORLD)})
    pairs: list[Pair] = field(default_factory=list)
    couplings: list[Coupling] = field(default_factory=list)
    start: dict[str, float] = field(default_factory=dict)
    frame: str = WORLD
    turn: Array = field(default_factory=lambda: np.eye(3))

    def section(self, tag: str) -> list[Element]:
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

    def with_defaults(self, element: Element, inherited: str) -> Element:
        """An element with the attributes of its class; its own come first."""
        rows = self.classes.get(element.attributes.get("class", inherited))
        if rows is None:
            self.faults.append(
                f"{element.title}: there is no class {shown(element.attributes.get('class', inherited))}"
            )
            return element
        return Element(element.tag, rows.get(element.tag, {}) | element.attributes, element.line, element.children)

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
            body = self.bodies[name] = Body(name, parent, pose_of(e, self.compiler), e)
            self.poses[name] = compose(self.poses[parent], body.pose)
            self.links[name] = self.link(body)
            self.hang(body, inherited)
            stack += [(child, name, inherited) for child in reversed(e.children)]

    def link(self, body: Body) -> Link:
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
            xx, yy, zz, xy, xz, yz = e.numbers("fullinertia", (6,), None, self.faults)
            I = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        else:
            I = np.diag(e.numbers("diaginertia", (3,), None, self.faults))
        I = X[:, :3] @ I @ X[:, :3].T
        if not mass:
            return Link(body.name)
        return Link(body.name, mass, X[:, 3], (I + I.T) / 2, unphysical=bool(physical_faults((I + I.T) / 2)))

    def hang(self, body: Body, inherited: str) -> None:
        """The pairs between a body and its parent: its joints in order, or a weld."""
        joints = [child for child in body.element.children if child.tag in ("joint", "freejoint")]
        kinds = [
            ("free" if e.tag == "freejoint" else self.with_defaults(e, inherited).attributes.get("type", "hinge"))
            for e in joints
        ]
        if "free" in kinds:
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
            self.pairs.append(
                self.pair(f"{body.name} on {body.parent}", "W", body.parent, body.name, body.pose, np.eye(3, 4))
            )
        for k, e in enumerate(joints):
            last = k == len(joints) - 1
            a = body.parent if k == 0 else f"{body.name} before {joints[k].attributes.get('name', k)}"
            b = body.name if last else f"{body.name} before {joints[k + 1].attributes.get('name', k + 1)}"
            if not last:
                self.links[b] = Link(b)
            self.joint(self.with_defaults(e, inherited), a, b, body.pose if k == 0 else np.eye(3, 4))

    def joint(self, e: Element, a: str, b: str, X: Array) -> None:
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
        z = axis / np.linalg.norm(axis)
        x = np.array(second_direction(tuple(z)))
        M = np.column_stack([x, np.cross(z, x), z, e.numbers("pos", (3,), np.zeros(3), self.faults)])
        ref = e.number("ref", 0.0, self.faults)
        ref = self.compiler.angle(ref) if freedom.startswith("R") else ref
        back = np.eye(3, 4)
        if freedom.startswith("R"):
            c, s = np.cos(ref), np.sin(ref)
            back[:2, :2] = [[c, s], [-s, c]]
        elif freedom:
            back[2, 3] = -ref
        self.pairs.append(self.pair(name, symbol, a, b, compose(X, compose(M, back)), M))
        if ref:
            self.start[f"{name}.{freedom}"] = ref
        dropped = [key for key in NOT_APPLIED if key in e.attributes and set(e.attributes[key].split()) - {"0"}]
        if dropped:
            self.notes.append(f"{e.tag} {name!r}: {', '.join(dropped)} not applied")

    def pair(self, name: str, symbol: str, a: str, b: str, A: Array, B: Array) -> Pair:
        """A pair with these marker poses in its links."""
        on_a, on_b = (Marker(tuple(X[:, 3]), tuple(X[:, 2]), tuple(X[:, 0])) for X in (A, B))
        return Pair(name, symbol, a, b, on_a=on_a, on_b=on_b)

    # --- equality, parts, drives ---------------------------------------------------------------------------------------

    def equality(self, e: Element) -> None:
        """A pair or coupling that closes a loop."""
        if e.attributes.get("active", "true") != "true":
            self.notes.append(f"{e.title} is not active: left out")
            return
        makers: Mapping[str, Callable[[Element, str], None]] = {
            "connect": self.connect,
            "weld": self.weld,
            "joint": self.couple,
        }
        if e.tag not in makers:
            self.faults.append(f"{e.title}: this equality is not read (read are {', '.join(makers)})")
            return
        taken = {pair.name for pair in self.pairs} | {c.name for c in self.couplings}
        name = e.attributes.get("name", f"{e.tag} on line {e.line}")
        makers[e.tag](e, f"{name} ({e.tag})" if name in taken else name)

    def ends(self, e: Element) -> tuple[str, str] | None:
        """The two bodies of an equality; the second is the world where left out."""
        names = e.attributes.get("body1", ""), e.attributes.get("body2", WORLD)
        unknown = [shown(name) for name in names if name not in self.poses]
        if unknown or names[0] == names[1]:
            why = f"there is no body {', '.join(unknown)}" if unknown else "joins a body to itself"
            self.faults.append(f"{e.title}: {why} (bodies are read; sites are not)")
            return None
        return names

    def connect(self, e: Element, name: str) -> None:
        """A common point of two bodies, at the anchor in the first."""
        ends = self.ends(e)
        if ends is None:
            return
        A = np.column_stack([np.eye(3), e.numbers("anchor", (3,), None, self.faults)])
        B = compose(inverse(self.poses[ends[1]]), compose(self.poses[ends[0]], A))
        self.pairs.append(self.pair(name, "S", *ends, A, B))

    def weld(self, e: Element, name: str) -> None:
        """Two bodies as they stand, or at a relative pose."""
        ends = self.ends(e)
        if ends is None:
            return
        given = e.numbers("relpose", (7,), np.zeros(7), self.faults)
        A = compose(inverse(self.poses[ends[0]]), self.poses[ends[1]])
        if given[3:].any():
            A = np.column_stack([quaternion_matrix(given[3:] / np.linalg.norm(given[3:])), given[:3]])
        self.pairs.append(self.pair(name, "W", *ends, A, np.eye(3, 4)))

    def couple(self, e: Element, name: str) -> None:
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
            link = PART.fullmatch(name)["link"]  # type: ignore[index]
            weld = next((p for p in self.pairs if p.type.f == 0 and {p.a, p.b} == {name, link}), None)
            if weld is None or link not in self.links:
                continue
            self.pairs = [
                p.replace(a=link if p.a == name else p.a, b=link if p.b == name else p.b)
                for p in self.pairs
                if p is not weld
            ]
            self.links[link] = joined(self.links[link], self.links.pop(name))

    def drives(self) -> list[Drive]:
        """Joints that an actuator moves."""
        freedoms = {pair.name: pair.freedom_names[0] for pair in self.pairs if pair.type.f == 1}
        found = dict.fromkeys(
            freedoms[joint] for e in self.section("actuator") if (joint := e.attributes.get("joint", "")) in freedoms
        )
        other = [e.title for e in self.section("actuator") if e.attributes.get("joint", "") not in freedoms]
        self.notes += [f"{title} drives no hinge or slide: left out" for title in other]
        return [Drive(freedom) for freedom in found]


def joined(one: Link, other: Link) -> Link:
    """Two parts of one link, in the same frame: masses added, centre and inertia of both."""
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
    return Reader(path, read_xml(path, "MJCF", "mujoco")).read()
