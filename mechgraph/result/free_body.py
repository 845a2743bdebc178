"""A link cut free: all that acts on it, in its own frame, in balance at every position. What a strength calculation begins with."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.document import Bullets, Document, Heading, Paragraph, Table, to_text
from mechgraph.errors import DeclarationError
from mechgraph.model.field_format import NAMED_POINT
from mechgraph.model.link import Link
from mechgraph.model.load import Gravity
from mechgraph.model.load_base import Load
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import wrong
from mechgraph.result.load_files import COMPONENTS, FORMATS
from mechgraph.result.places import OK, bracket, driver_value, number
from mechgraph.result.solution import Solution
from mechgraph.result.values import Mask
from mechgraph.units import FORCE, LENGTH, MOMENT, TIME, unit_of
from mechgraph.writing import format_of

SMALL = 1e-9
"""Part of the largest force (or moment) on a link below which one is rounding."""
At = Literal["worst", "all"] | int | slice | Sequence[int]
"""Positions: the worst ones, all, or those that an index of the flat batch picks."""


@dataclass(frozen=True, eq=False)
class PointLoad:
    """What one thing does to the link at one point of it.

    ``kind``: ``"pair"`` (all that the pair transmits: reaction and efforts), ``"load"``, ``"inertia"`` (at the mass centre), ``"hold"``
    (what keeps a passive body at rest, a load that no part supplies) or ``"support"`` (what holds the frame). ``point (3,)`` and
    ``wrench (..., 6)``, (M, F) about that point, are in the link's frame; ``unique (..., 6)`` says which numbers equilibrium alone gives:
    the others are NaN, or those of least norm where the solution has these. ``about``: in words, what it is; ``distributed``: whether it
    acts on all of the mass (weight and inertia), at whose centre it stands.
    """

    name: str
    kind: str
    point: tuple[float, float, float]
    wrench: Array
    unique: Mask
    about: str
    distributed: bool = False

    @property
    def force(self) -> Array:
        """Force ``(..., 3)``."""
        return self.wrench[..., 3:]

    @property
    def moment(self) -> Array:
        """Moment about the point ``(..., 3)``."""
        return self.wrench[..., :3]


class Case(NamedTuple):
    """A position of the flat batch as a load case: its number, the drivers' values, and what is greatest there."""

    position: int
    place: str
    why: tuple[str, ...]


class Range(NamedTuple):
    """Least and greatest value of a component (``Fx`` ..., ``|F|``, ``|M|``) of what one thing does, and the positions where they occur.

    NaN (and position -1) where the component is not unique at some position.
    """

    name: str
    component: str
    unit: str
    least: float
    at_least: int
    greatest: float
    at_greatest: int


@dataclass(frozen=True, eq=False)
class FreeBody:
    """A link with all that acts on it, ``acting``; see ``free_body``.

    ``acceleration (..., 9)``: of the mass centre (of the frame's origin where it has none), angular velocity and angular acceleration,
    in the link's frame.
    """

    solution: Solution
    link: Link
    acting: tuple[PointLoad, ...]
    acceleration: Array

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism whose link it is."""
        return self.solution.mechanism

    def __getitem__(self, name: str) -> PointLoad:
        found = {one.name: one for one in self.acting}
        if name not in found:
            raise DeclarationError(f"loads on {self.link.name!r}", [wrong(name, "name", f"one of {', '.join(found)}")])
        return found[name]

    @cached_property
    def sum(self) -> Array:
        """Sum of all, ``(..., 6)``, (M, F) about the origin of the link's frame: zero but for rounding, NaN where not unique."""
        return np.sum([_about_origin(one) for one in self.acting], axis=0)

    @property
    def balance(self) -> float:
        """The largest sum, of forces over the largest force, of moments over the largest moment or force at its arm; NaN if not unique."""
        if not self.acting:
            return 0.0
        moments, forces = (np.abs(self.sum[self._solved][..., part]) for part in (slice(0, 3), slice(3, 6)))
        force = max(float(np.abs(one.force[self._solved]).max(initial=0.0)) for one in self.acting)
        moment = max(float(np.abs(one.moment[self._solved]).max(initial=0.0)) for one in self.acting)
        arm = max(float(np.linalg.norm(one.point)) for one in self.acting)
        return max(
            float(forces.max(initial=0.0)) / (force or 1.0),
            float(moments.max(initial=0.0)) / (max(moment, arm * force) or 1.0),
        )

    @property
    def _solved(self) -> Any:
        return np.asarray(self.solution.status) == OK

    # --- positions -----------------------------------------------------------------------------------------------------

    def cases(self, at: At = "worst") -> tuple[Case, ...]:
        """The load cases at positions.

        ``"worst"``: where the force or the moment of something that acts is greatest; ``"all"``; or an index of the flat batch.

        Raises
        ------
        DeclarationError
            for no such position, or one that was not solved.
        """
        why = self._greatest()
        places = list(why) if isinstance(at, str) and at == "worst" else self._positions(at)
        return tuple(Case(i, self.place(i), tuple(why.get(i, ()))) for i in sorted(places))

    def _positions(self, at: Any) -> list[int]:
        solved = np.flatnonzero(self._solved)
        if isinstance(at, str) and at == "all":
            return solved.tolist()
        try:
            places = np.atleast_1d(np.arange(np.size(self._solved))[at]).ravel().tolist()
        except (IndexError, TypeError, ValueError):
            places = []
        missing = [i for i in places if i not in set(solved.tolist())]
        if not places or missing:
            fault = (
                f"at = {at!r}: position {missing[0]} was not solved ({np.ravel(self.solution.status)[missing[0]]})"
                if missing
                else wrong(at, "at", f"'worst', 'all', or an index of {np.size(self._solved)} positions")
            )
            raise DeclarationError(f"loads on {self.link.name!r}", [fault])
        return places

    def _greatest(self) -> dict[int, list[str]]:
        """Positions at which something is greatest that is not the same everywhere, and what; the first where everything is."""
        out: dict[int, list[str]] = {}
        for what in ("force", "moment"):
            sizes = {one.name: self._sizes(getattr(one, what)) for one in self.acting}
            most = max((np.nanmax(size, initial=0.0) for size in sizes.values()), default=0.0)
            for name, size in sizes.items():
                largest = np.nanmax(size, initial=0.0)
                if largest > SMALL * most and largest - np.nanmin(size) > SMALL * largest:
                    out.setdefault(int(np.nanargmax(size)), []).append(f"greatest {what} of {name}")
        return out or {i: [] for i in np.flatnonzero(self._solved)[:1].tolist()}

    def _sizes(self, vectors: Array) -> Array:
        """Sizes of what is known of vectors, flat; NaN where not solved."""
        sizes = np.linalg.norm(np.nan_to_num(vectors), axis=-1)
        return np.where(self._solved, sizes, np.nan).ravel()

    def place(self, position: int) -> str:
        """The drivers' values at a position, and its time."""
        s = self.solution
        parts = []
        for name in s.prescribed:
            k, j = s.whole.freedom(name)
            parts.append(
                driver_value(s.whole, name, float(s[s.whole.pairs[k].name].position[..., j].ravel()[position]))
            )
        if s.t is not None:
            t = float(np.broadcast_to(s.t, s.batch).ravel()[position])
            parts.append(f"t = {t:.6g} {unit_of(s.mechanism.units, TIME)}".rstrip())
        return ", ".join(parts) or "as assembled"

    def envelope(self) -> tuple[Range, ...]:
        """Least and greatest of every component of all that acts, over the solved positions."""
        out = []
        units = {letter: unit_of(self.mechanism.units, (2 if letter == "M" else 1, 1, -2)) for letter in "MF"}
        for one in self.acting:
            values = dict(zip(COMPONENTS, np.moveaxis(one.wrench, -1, 0), strict=True))
            values |= {f"|{letter}|": np.linalg.norm(v, axis=-1) for letter, v in (("F", one.force), ("M", one.moment))}
            for component, value in values.items():
                flat = np.ravel(value)
                known = np.where(np.ravel(self._solved), flat, np.nan)
                unique = not np.isnan(flat[np.ravel(self._solved)]).any() and known.size > 0
                low, high = (int(np.nanargmin(known)), int(np.nanargmax(known))) if unique else (-1, -1)
                ends = (float(known[low]), low, float(known[high]), high) if unique else (np.nan, -1, np.nan, -1)
                out.append(Range(one.name, component, units[component.strip("|")[0]], *ends))
        return tuple(out)

    def not_unique(self, position: int) -> dict[str, tuple[str, ...]]:
        """What acts -> its components that equilibrium alone does not give, at a position."""
        found = {one.name: one.unique.reshape(-1, 6)[position] for one in self.acting}
        return {
            name: tuple(c for c, known in zip(COMPONENTS, unique, strict=True) if not known)
            for name, unique in found.items()
            if not unique.all()
        }

    # --- files ---------------------------------------------------------------------------------------------------------

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
        most = {
            size: np.nanmax([r.greatest for r in ranges.values() if r.component == size], initial=0.0)
            for size in ("|F|", "|M|")
        }
        rows = []
        for one in self.acting:
            row = [one.name, one.kind, ", ".join(f"{x + 0.0:.6g}" for x in one.point)]
            for size, largest in most.items():
                r = ranges[one.name, size]
                row += (
                    [number(r.greatest, largest), self.place(r.at_greatest)]
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
            (Paragraph(f"{words}{found}."), Table(head, rows, "lllrlrl"), Heading("Positions", 2), Bullets(cases)),
        )

    def __str__(self) -> str:
        return to_text(self.document())

    def __repr__(self) -> str:
        names = ", ".join(one.name for one in self.acting)
        return f"FreeBody({self.link.name!r}, {np.size(self._solved)} positions, {names})"


def _about_origin(one: PointLoad) -> Array:
    """Its wrench about the origin of the link's frame."""
    return np.concatenate([one.moment + np.cross(np.array(one.point), one.force), one.force], axis=-1)


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
            acting.append(PointLoad(pair.name, "pair", _point(marker.point), wrench, unique, about))

    def add(name: str, kind: str, point: Any, wrench: Array, about: str, distributed: bool = False) -> None:
        """What is known at every position, (M, F) about the global origin."""
        p = _point(point)
        moment = wrench[..., :3] - np.cross(at + R @ np.array(p), wrench[..., 3:])
        local = np.concatenate([_turned_back(R, v) for v in (moment, wrench[..., 3:])], axis=-1)
        acting.append(PointLoad(name, kind, p, local, _every(local), about, distributed))

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
        left = -np.sum([_about_origin(other) for other in acting], axis=0)
        about = "what holds the frame, at the origin of its frame"
        acting.append(PointLoad("support", "support", (0.0, 0.0, 0.0), left, np.isfinite(left), about))
    return FreeBody(s, one, tuple(acting), acceleration)


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
