"""A link cut free: all that acts on it, in its own frame, in balance at every position. What a strength calculation begins with."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import door
from mechgraph.document import Bullets, Document, Heading, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError
from mechgraph.fields import NAMED_POINT
from mechgraph.model.couplings import BaseCoupling
from mechgraph.model.loads import Gravity, Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Link, Marker
from mechgraph.report.report import check
from mechgraph.result.balanced_loads import SMALL, At, BalancedLoads, PointLoad
from mechgraph.result.load_files import FORMATS
from mechgraph.result.numbers import bracket, number
from mechgraph.result.solution import Solution
from mechgraph.result.values import Mask
from mechgraph.units import FORCE, LENGTH, MOMENT, unit_of
from mechgraph.writing import format_of


class FreeBody(BalancedLoads, Shown):
    """A link with all that acts on it; see ``free_body``."""

    def write(self, path: str | os.PathLike[str], at: At = "worst", **options: Any) -> None:
        """Write the loads at positions as the suffix says, whole or not at all.

        ``.csv``: one row for each of what acts at each position, components that are not unique left empty and named. ``.inp``: a load
        deck of CalculiX or Abaqus with a step a position, see ``load_deck`` for its options.

        Raises
        ------
        DeclarationError
            where something not unique would have to be written as known; FileError.
        """
        format_of(path, FORMATS).write(self, path, at, **options)

    def document(self, at: At = "worst") -> Document:
        """What acts with its greatest force and moment, and the load cases at positions."""
        ranges = {(r.name, r.component): r for r in self.envelope()}
        most = dict(zip(("|F|", "|M|"), reversed(self.scales), strict=True))
        rows = []
        for one in self.acting:
            row = [one.name, one.kind, ", ".join(f"{x + 0.0:.6g}" for x in one.point)]
            for size, largest in most.items():
                r = ranges[one.name, size]
                row += (
                    [
                        number(r.greatest, largest),
                        self.solution.place(r.at_greatest) if r.greatest > SMALL * largest else "",
                    ]
                    if r.at_greatest >= 0
                    else ["not unique", ""]
                )
            rows.append(row)
        units = [bracket(unit_of(self.mechanism.units, powers)) for powers in (LENGTH, FORCE, MOMENT)]
        head = ("what", "kind", f"point{units[0]}", f"force{units[1]}", "at", f"moment{units[2]}", "at")
        cases = [f"{case.place}{': ' if case.why else ''}{', '.join(case.why)}" for case in self.cases(at)]
        words = "Greatest force and moment of each, in the frame of the link, moments about its point"
        found = "" if np.isnan(self.balance) else f"; the sum of all is zero to {self.balance:.0e} of the largest"
        return Document(
            f"Loads on link {self.link.name} of {self.mechanism.name}",
            (
                Paragraph(f"{words}{found}.{self._part()}"),
                Table(head, rows, "lllrlrl"),
                Heading("Positions", 2),
                Bullets(cases),
            ),
        )

    def _part(self) -> str:
        """What stands for that which is not unique."""
        if all(one.unique[self._solved].all() for one in self.acting):
            return ""
        report = check(self.mechanism)
        if report.own_forces_unique:
            return f" All that a {report.kind.name} model has is unique; what else the pairs carry is not, and is left out."
        return " Of what is not unique the part that is, at right angles to what self-stresses may add."

    def __repr__(self) -> str:
        names = ", ".join(one.name for one in self.acting)
        return f"FreeBody({self.link.name!r}, {np.size(self.solution.status)} positions, {names})"


@door
def free_body(s: Solution, link: str) -> FreeBody:
    """All that acts on a link, at points of it and in its own frame: what its pairs transmit, loads, and its inertia.

    The sum is zero at every position. Pairs act at their markers on the link, loads at their points, weight and inertia
    ``-m a``, ``-(I alpha + w x I w)`` at the mass centre. On the frame there is also what supports it.

    Raises
    ------
    DeclarationError
        for an unknown link, or a solution without forces.
    """
    m, i = s.mechanism, s.mechanism.place_of_link(link)
    if not s.has_forces:
        raise DeclarationError(f"loads on {link!r}", ["the solution has no forces: use solve()"])
    one, motion = m.links[i], s.link(link)
    pose = motion.pose
    R, at = pose[..., :3, :3], pose[..., :3, 3]
    acting = []
    for pair in s.whole.pairs:
        if link in (pair.a, pair.b):
            other, marker = (pair.a, pair.markers[1]) if pair.b == link else (pair.b, pair.markers[0])
            wrench, unique = s.on_link(pair.name, link)
            about = f"{pair.type.symbol}, from {other}"
            sizes = s.sizes_on_link(pair.name, link)
            acting.append(PointLoad(pair.name, "pair", _point(marker.point), wrench, unique, about, known_sizes=sizes))

    def add(name: str, kind: str, point: Any, wrench: Array, about: str, distributed: bool = False) -> None:
        """What is known at every position, (M, F) about the global origin."""
        p = _point(point)
        moment = wrench[..., :3] - np.cross(at + R @ np.array(p), wrench[..., 3:])
        local = np.concatenate([_turned_back(R, v) for v in (moment, wrench[..., 3:])], axis=-1)
        acting.append(PointLoad(name, kind, p, local, np.isfinite(local), about, distributed))

    for c in m.couplings:
        for link_of, marker, sign in _gears(m, c):
            if link_of == link:
                mesh = s.coupling(c.name)
                wrench = sign * np.concatenate([np.cross(mesh.point, mesh.force), mesh.force], axis=-1)
                add(c.name, "contact", marker.point, wrench, "force of the other gear, about the middle of this one")
    for place, load in enumerate(m.loads):
        found = s.load(place).wrenches
        if load.in_freedom is None and link in found:
            about = load.where.removesuffix(": ")
            add(f"loads[{place}] {load.kind}", "load", _place(load, one), found[link], about, isinstance(load, Gravity))
    hold = motion.hold
    if np.nan_to_num(hold).any():
        add("hold", "hold", one.center, hold, "keeps the passive body at rest; no part supplies it")
    wrench, acceleration = _inertia(one, s, R)
    if one.mass > 0:
        about = "minus mass times acceleration, of all of it"
        acting.append(PointLoad("inertia", "inertia", _point(one.center), wrench, _every(wrench), about, True))
    if link == m.frame:
        add("support", "support", None, -s.shaking, "what holds the frame, at the origin of its frame")
    return FreeBody(s, one, tuple(acting), acceleration)


def _gears(m: Mechanism, c: BaseCoupling) -> Iterator[tuple[str, Marker, float]]:
    """Both gears of a coupling that has them: the link, its marker on the carrier, and the sign with which the force acts on it."""
    for step, sense, sign in ((c.steps[0], -1.0, -1.0), (c.steps[-1], 1.0, 1.0)) if c.steps else ():
        pair, at_b = m.pairs[step.pair], step.sense * sense > 0
        yield (pair.b if at_b else pair.a), pair.markers[int(at_b)], sign


def _inertia(link: Link, s: Solution, R: Array) -> tuple[Array, Array]:
    """The inertia wrench about the mass centre and the accelerations (see ``FreeBody``), in the link's frame."""
    motion = s.link(link.name)
    point = motion.point(_point(link.center))
    a, w, alpha = (
        _turned_back(R, v) for v in (point.acceleration, motion.angular_velocity, motion.angular_acceleration)
    )
    inertia = np.zeros((3, 3)) if link.inertia is None else np.asarray(link.inertia, dtype=float)
    moment = -(alpha @ inertia.T + np.cross(w, w @ inertia.T))
    return np.concatenate([moment, -link.mass * a], axis=-1), np.concatenate([a, w, alpha], axis=-1)


def _every(wrench: Array) -> Mask:
    """All components are unique."""
    return np.ones(wrench.shape, dtype=np.bool_)


def _turned_back(R: Array, v: Array) -> Array:
    """``R^T v`` for ``(..., 3, 3)`` and ``(..., 3)``."""
    return np.asarray(np.einsum("...ji,...j->...i", R, v))


def _point(p: Any) -> tuple[float, float, float]:
    """A point of a link; the origin of its frame where there is none."""
    x, y, z = (0.0, 0.0, 0.0) if p is None else map(float, p)
    return x, y, z


def _place(load: Load, link: Link) -> Any:
    """The point of a link at which a load acts: the one that it names, else the mass centre."""
    for name, about in load.formats.items():
        point = getattr(load, name)
        if about.kind is NAMED_POINT and point is not None and getattr(load, about.of) == link.name:
            return link.point(point) if isinstance(point, str) else point
    return link.center
