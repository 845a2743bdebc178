"""All that acts on a link at a batch of positions: at points of it, in its own frame; worst positions and envelope."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import place_among
from mechgraph.document import Document, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Link
from mechgraph.quantities import wrong
from mechgraph.result.numbers import number
from mechgraph.result.places import OK
from mechgraph.result.solution import Solution
from mechgraph.result.values import Mask
from mechgraph.units import unit_of

COMPONENTS = ("Mx", "My", "Mz", "Fx", "Fy", "Fz")
"""Names of the components of a wrench."""
SMALL = 1e-9
"""Part of the largest force (or moment) on a link below which one is rounding."""
At = Literal["worst", "all"] | int | slice | Sequence[int]
"""Positions: the worst ones, all, or those that an index of the flat batch picks."""


@dataclass(frozen=True, eq=False, repr=False)
class PointLoad(Shown):
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
    known_sizes: Array | None = None

    @property
    def sizes(self) -> Array:
        """Sizes ``(..., 2)`` of moment and force, of what is unique of them; NaN where nothing is."""
        parts = np.stack([self.moment, self.force], axis=-2)
        return np.asarray(np.linalg.norm(parts, axis=-1)) if self.known_sizes is None else self.known_sizes

    @property
    def force(self) -> Array:
        """Force ``(..., 3)``."""
        return self.wrench[..., 3:]

    @property
    def moment(self) -> Array:
        """Moment about the point ``(..., 3)``."""
        return self.wrench[..., :3]

    def document(self) -> Document:
        """Least and greatest of its components; what is not unique has none."""
        rows = []
        for name, values in zip(COMPONENTS, self.wrench.reshape(-1, 6).T, strict=True):
            known = values[np.isfinite(values)]
            rows.append(
                (name, *(number(float(v)) for v in (known.min(), known.max()))) if known.size else (name, "", "")
            )
        at = ", ".join(f"{x + 0.0:.6g}" for x in self.point)
        about = Paragraph(f"{self.kind} at ({at}) in the frame of the link: {self.about}.")
        return Document(self.name, (about, Table(("component", "least", "greatest"), rows, "lrr")))


class Case(NamedTuple):
    """A position of the flat batch as a load case: its number, the drivers' values, and what is greatest there."""

    position: int
    place: str
    why: tuple[str, ...]


class Range(NamedTuple):
    """Least and greatest value of a component (``Fx`` ..., ``|F|``, ``|M|``) of what one thing does, and the positions where they occur.

    ``|F|`` and ``|M|`` are those of what is unique. NaN (and position -1) where the component, or all of them, is not unique at some
    position.
    """

    name: str
    component: str
    unit: str
    least: float
    at_least: int
    greatest: float
    at_greatest: int


@dataclass(frozen=True, eq=False)
class BalancedLoads:
    """All that acts on a link, ``acting``: its positions, its sum and its greatest values.

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
        return np.sum([about_origin(one) for one in self.acting], axis=0)

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
        return tuple(Case(i, self.solution.place(i), tuple(why.get(i, ()))) for i in sorted(places))

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
        for what, scale in zip(("moment", "force"), self.scales, strict=True):
            for one in self.acting:
                name, size = one.name, np.where(self._solved, one.sizes[..., int(what == "force")], np.nan).ravel()
                largest = np.nanmax(size, initial=0.0)
                if largest > SMALL * scale and largest - np.nanmin(size) > SMALL * largest:
                    out.setdefault(int(np.nanargmax(size)), []).append(f"greatest {what} of {name}")
        return out or {i: [] for i in np.flatnonzero(self._solved)[:1].tolist()}

    @cached_property
    def scales(self) -> tuple[float, float]:
        """The largest moment and force, or what either makes of the other at the largest arm: beside it what is small is rounding."""
        sizes = [one.sizes[self._solved].reshape(-1, 2) for one in self.acting]
        moment, force = np.nanmax(np.concatenate([np.zeros((1, 2)), *sizes]), axis=0).tolist()
        arm = max((float(np.linalg.norm(one.point)) for one in self.acting), default=0.0)
        return max(moment, arm * force), max(force, moment / arm if arm else 0.0)

    def envelope(self) -> tuple[Range, ...]:
        """Least and greatest of every component of all that acts, over the solved positions."""
        out = []
        units = {letter: unit_of(self.mechanism.units, (2 if letter == "M" else 1, 1, -2)) for letter in "MF"}
        for one in self.acting:
            values = dict(zip(COMPONENTS, np.moveaxis(one.wrench, -1, 0), strict=True))
            values |= {"|F|": one.sizes[..., 1], "|M|": one.sizes[..., 0]}
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
        at = place_among(position, self.solution.status.size, "position", f"free body of {self.link.name!r}")
        found = {one.name: one.unique.reshape(-1, 6)[at] for one in self.acting}
        return {
            name: tuple(c for c, known in zip(COMPONENTS, unique, strict=True) if not known)
            for name, unique in found.items()
            if not unique.all()
        }


def about_origin(one: PointLoad) -> Array:
    """Its wrench about the origin of the link's frame."""
    return np.concatenate([one.moment + np.cross(np.array(one.point), one.force), one.force], axis=-1)
