"""URDF, the robot description of ROS, as a mechanism: joints are pairs between parent and child, ``mimic`` is a coupling.

The frame of a child stands at the ``origin`` of its joint in the parent where the coordinate is 0. Roll, pitch and yaw turn about
fixed axes, ``R = Rz(yaw) Ry(pitch) Rx(roll)``. A link with two parents closes a loop, which URDF itself does not know. Source: ROS wiki,
urdf/XML (link, joint).
"""

from __future__ import annotations

from dataclasses import field
from pathlib import Path

import numpy as np
import scipy

from mechgraph.errors import DeclarationError, listed
from mechgraph.exchange.syntax import XmlElement, marker_at, pose_about, read_xml
from mechgraph.maths.inertia import physical_faults
from mechgraph.maths.se3 import Array, compose
from mechgraph.memo import dataclass
from mechgraph.model.couplings import Coupling
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Link, Pair
from mechgraph.quantities import shown

TYPES = {"revolute": "R", "continuous": "R", "prismatic": "P", "fixed": "W", "planar": "E"}
REFUSED = {"floating": "holds nothing; leave it out, or put a joint in its place"}
NOT_APPLIED = ("limit", "dynamics", "safety_controller")


@dataclass
class UrdfReader:
    """Collects links, pairs, couplings and faults."""

    root: XmlElement
    faults: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def origin(self, e: XmlElement) -> Array:
        """The pose of the ``origin`` of an element; the identity where it has none."""
        found = e.first("origin")
        if found is None:
            return np.eye(3, 4)
        angles = found.numbers("rpy", (3,), np.zeros(3), self.faults)
        R = scipy.spatial.transform.Rotation.from_euler("xyz", angles).as_matrix()
        return np.column_stack([R, found.numbers("xyz", (3,), np.zeros(3), self.faults)])

    def link(self, e: XmlElement) -> Link:
        """A link with its inertia; ``ixy`` and the like are entries of the tensor."""
        name, inertial = e.attributes.get("name", ""), e.first("inertial")
        mass = inertial and inertial.first("mass")
        if inertial is None or mass is None or not (weight := mass.number("value", None, self.faults)):
            return Link(name)
        X, tensor = self.origin(inertial), inertial.first("inertia")
        if tensor is None:
            return Link(name, weight, X[:, 3])
        entries = [[tensor.number(f"i{min(i, j)}{max(i, j)}", 0.0, self.faults) for j in "xyz"] for i in "xyz"]
        I = X[:, :3] @ np.array(entries) @ X[:, :3].T
        odd = bool(physical_faults(I))
        if odd:
            self.notes.append(f"the inertia of link {name!r} is that of no body")
        return Link(name, weight, X[:, 3], (I + I.T) / 2, unphysical=odd)

    def pair(self, e: XmlElement) -> Pair | None:
        """The pair of a joint; None, and a fault, where there is none."""
        name, kind = e.attributes.get("name", f"joint on line {e.line}"), e.attributes.get("type", "")
        ends = [e.of(side, "link") for side in ("parent", "child")]
        axis_of, fault = e.first("axis"), ""
        if kind not in TYPES:
            fault = f"type {shown(kind)} {REFUSED.get(kind, f'is not known (known: {listed(TYPES)})')}"
        elif not all(ends):
            fault = "needs <parent link=...> and <child link=...>"
        axis = axis_of.numbers("xyz", (3,), None, self.faults) if axis_of and not fault else np.array([1.0, 0, 0])
        if fault or not axis.any():
            self.faults.append(f"{e.title}: {fault or 'axis has length 0'}")
            return None
        M = pose_about(axis, np.zeros(3))
        on_a, on_b = marker_at(compose(self.origin(e), M)), marker_at(M)
        dropped = [child.tag for child in e.children if child.tag in NOT_APPLIED]
        if dropped:
            self.notes.append(f"joint {name!r}: {', '.join(dropped)} not applied")
        return Pair(name, TYPES[kind], *ends, on_a=on_a, on_b=on_b)

    def coupling(self, e: XmlElement, pairs: dict[str, Pair]) -> list[Coupling]:
        """``q = multiplier q_mimicked + offset`` of a joint that mimics another."""
        mimic, own = e.first("mimic"), pairs.get(e.attributes.get("name", ""))
        if mimic is None or own is None:
            return []
        other = pairs.get(mimic.attributes.get("joint", ""))
        ratio, offset = mimic.number("multiplier", 1.0, self.faults), mimic.number("offset", 0.0, self.faults)
        if other is None or own.type.f != 1 or other.type.f != 1:
            what = shown(mimic.attributes.get("joint", ""))
            self.faults.append(f"{e.title}: mimics {what}, which is no turn or slide here")
            return []
        terms = [(own.freedom_names[0], 1.0), (other.freedom_names[0], -ratio)]
        return [Coupling([term for term in terms if term[1]], name=f"{own.name} mimics {other.name}", constant=offset)]

    def read(self, name: str) -> tuple[Mechanism, tuple[str, ...]]:
        """The mechanism, and what was taken otherwise than it stands.

        Raises
        ------
        DeclarationError
            with all faults.
        """
        links = [self.link(e) for e in self.root.all("link")]
        found = [(e, pair) for e in self.root.all("joint") if (pair := self.pair(e)) is not None]
        pairs = {pair.name: pair for _, pair in found}
        couplings = [c for e, _ in found for c in self.coupling(e, pairs)]
        children = {pair.b for pair in pairs.values()}
        roots = [link.name for link in links if link.name not in children]
        if len(roots) != 1:
            names = listed(roots) or "none"
            self.faults.append(
                f"{len(roots)} links are no child of a joint ({names}); one has to be the root, which is the frame"
            )
        if self.faults:
            raise DeclarationError(f"URDF {shown(name)}", self.faults)
        made = Mechanism(
            name, links, [pair for _, pair in found], couplings=couplings, frame=roots[0],
            source="a URDF file", description=". ".join(self.notes),
        )  # fmt: skip
        return made, tuple(self.notes)


def read_urdf(path: Path) -> tuple[Mechanism, tuple[str, ...]]:
    """The mechanism of a URDF file, and what was taken otherwise than it stands."""
    root = read_xml(path, "URDF", "robot")
    return UrdfReader(root).read(root.attributes.get("name", path.stem))
