"""A mechanism as MJCF, the XML of MuJoCo: a tree of bodies whose loops are cut, each at a link, and closed by equality constraints.

The file holds the mechanism at its start, loops closed. A freedom is a hinge or a slide, a helical one both with a joint equality, a
rotation a ball; ``ref`` makes their coordinates those of mechgraph. A pair that closes a loop is a ``connect`` (spherical) or a ``weld``;
for any other its link is cut in two: the second part, with its share of the mass, hangs on the pair and is welded to the first. Bodies
stand in the frames of their links. Source: MuJoCo documentation, XML reference (body, joint, inertial, equality).
"""

from __future__ import annotations

import html
import os
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mechgraph.algebra.inertia import physical_faults
from mechgraph.algebra.se3 import Array, compose, inverse, matrix_quaternion, move_twist
from mechgraph.errors import HIDDEN, FileError
from mechgraph.files import write_whole
from mechgraph.kinetostatics import assemble
from mechgraph.model.loads import Gravity
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.pairs import kinematics as evaluation
from mechgraph.pairs.factors import ConstantScrew
from mechgraph.quantities import shown

WORLD = "world"
"""Name of the frame in MJCF."""
CUT = "(cut"
"""What follows the name of a link in that of a part cut from it."""


@dataclass
class Body:
    """A body: its name, the link whose frame it stands in, its pose in its parent, its joints as tag and attributes."""

    name: str
    link: str
    pose: Array
    joints: list[tuple[str, dict[str, Any]]] = field(default_factory=list)
    children: list[Body] = field(default_factory=list)


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
        self.root = Body(WORLD, self.m.frame, np.eye(3, 4))
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
        for step, (columns, _) in zip(pair.type.steps, evaluation.places(pair.type), strict=True):
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
                    self.bodies[child] = self.hung(Body(child, child, move), parent, pair)
                    hung.add(pair.name)
                    front.append(child)
        for pair in m.pairs:
            if pair.name not in hung:
                self.close(pair)
        for coupling in m.couplings:
            self.couple(coupling.name, coupling.terms)

    def hung(self, body: Body, parent: str, pair: Pair) -> Body:
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
            self.equalities.append(
                ("connect", {"name": pair.name, "body1": ends[0], "body2": ends[1], "anchor": anchor})
            )
            return
        if not steps:
            self.weld(pair.name, ends[0], ends[1], self.step(pair))
            return
        child, parent = (pair.a, pair.b) if pair.b == self.m.frame else (pair.b, pair.a)
        count = self.cuts[child] = self.cuts.get(child, 0) + 1
        pose = compose(inverse(self.poses[parent]), self.poses[child])
        part = self.hung(Body(f"{child} {CUT} {count})", child, pose), parent, pair)
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

    def inertial(self, body: Body) -> dict[str, Any]:
        """Mass, centre and inertia of a body: its share of those of its link."""
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
        I = inertia * share
        full = [I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]]
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
        stack: list[tuple[Body | None, int]] = [(body, 2) for body in reversed(self.root.children)]
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
        raise FileError(
            path, f"mechanism {m.name!r} cannot be written as MJCF:\n  " + "\n  ".join(dict.fromkeys(writer.faults))
        )
    write_whole(path, [text])
