"""Loads as numbers of the kernel's tables: those that are constants, in internal units and in the frames that links have there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mechgraph.fields import PerCase
from mechgraph.kinematics.system import System
from mechgraph.maths.se3 import Array, rotate
from mechgraph.model.loads import Damper, Effort, ForceLaw, ForceTable, Gravity, Load, Spring, TorsionSpring, Wrench

WEIGHT, WRENCH, EFFORT, LAW, BETWEEN, TABLE, TABLE_BETWEEN = range(7)
"""Kinds of loads, as in ``kernel.h``."""


@dataclass
class Acting:
    """Loads in the tables: kind, two numbers and the place of the numbers of each, and the numbers, one row each: ``(1,)`` or ``(B,)``."""

    entries: list[tuple[int, int, int, int]]
    numbers: list[Array]

    def add(self, kind: int, i: int, j: int, *numbers: Array) -> None:
        """One load; ``numbers (n, B)``."""
        self.entries.append((kind, i, j, len(self.numbers)))
        for part in numbers:
            self.numbers += list(part)


@dataclass(frozen=True)
class _Places:
    """Where loads act: a system, and the poses ``own (3, 4, N, B)`` of the link frames in those of the tables."""

    system: System
    own: Array

    @property
    def L(self) -> float:
        """The unit of length."""
        return self.system.par.L

    def link(self, name: str) -> int:
        """Number of a link."""
        return self.system.m.link_index[name]

    def point(self, link: str, p: Any) -> Array:
        """A material point ``(3, B)``, given in the link's frame or by its name; the mass center where it is None."""
        i, par = self.link(link), self.system.par
        given = self.system.m.links[i].point(p) if isinstance(p, str) else p
        local = par.center[:, i] if given is None else (rows(given, 3) - par.offset[:, i, None]) / self.L
        return self.turned(link, local) + self.own[:, 3, i]

    def turned(self, link: str, v: Array) -> Array:
        """A vector ``(3, B)`` in the frame of a link, in that of the tables."""
        return rotate(self.own[:, :3, self.link(link)], v)

    def column(self, freedom: str) -> tuple[int, bool]:
        """Number of a freedom, and whether it is a slide."""
        pair, j = self.system.m.freedom(freedom)
        column = int(self.system.first_column[pair]) + j
        return column, bool(self.system.is_length[column])


def acting(system: System, own: Array, loads: Sequence[Load]) -> Acting | None:
    """All loads in the tables; None where one of them varies over the positions or is a function.

    ``own (3, 4, N, B)``: poses of the link frames in those of the tables.
    """
    out, places = Acting([], []), _Places(system, own)
    for load in loads:
        if not in_tables(load):
            return None
        KINDS[type(load)](places, load, out)
    return out


def in_tables(load: Load) -> bool:
    """Whether a load is numbers of the tables: its fields are no functions, and no arrays over positions."""
    values = [getattr(load, name) for name in load.formats]
    given = [name for name in load.over_positions if not isinstance(getattr(load, name), PerCase)]
    by_pieces = not isinstance(load, ForceLaw) or (isinstance(load.law, ForceTable) and load.law.pieces is not None)
    return type(load) in KINDS and not given and by_pieces and not any(callable(value) for value in values)


def rows(value: Any, width: int = 1) -> Array:
    """A number or vector as ``(width, 1)``; one that varies from case to case ``(width, B)``."""
    if isinstance(value, PerCase):
        return value.values.reshape(len(value.values), width).T
    return np.asarray(value, dtype=float).reshape(width, 1)


def _weight(places: _Places, load: Any, out: Acting) -> None:
    out.add(WEIGHT, 0, 0, rows(load.acceleration, 3) / places.L)


def _wrench(places: _Places, load: Any, out: Acting) -> None:
    i = places.link(load.link)
    force, moment = (np.zeros((3, 1)) if v is None else rows(v, 3) for v in (load.force, load.moment))
    turning = load.frame == "link"
    if turning:
        force, moment = (places.turned(load.link, part) for part in (force, moment))
    at = np.zeros((3, 1)) if load.force is None else places.point(load.link, load.point)
    out.add(WRENCH, i, int(turning), force / places.L, moment / places.L**2, at)


def _effort(places: _Places, load: Any, out: Acting) -> None:
    column, slides = places.column(load.freedom)
    out.add(EFFORT, column, 0, rows(load.value) / places.L ** (1 if slides else 2))


def _law(places: _Places, load: Any, out: Acting, *law: Any) -> None:
    """``F = -stiffness (x - rest) - damping x'`` in a freedom or between points."""
    stiffness, rest, damping = map(rows, law)
    if load.in_freedom is not None:
        column, slides = places.column(load.in_freedom)
        unit = 1.0 if slides else places.L**-2
        out.add(LAW, column, 0, stiffness * unit, rest / places.L if slides else rest, damping * unit)
        return
    p, q = places.point(load.a, load.p), places.point(load.b, load.q)
    out.add(BETWEEN, places.link(load.a), places.link(load.b), p, q, stiffness, rest / places.L, damping)


def _elastic(places: _Places, load: Any, out: Acting) -> None:
    _law(places, load, out, load.stiffness, getattr(load, load.rest), load.damping)


def _damper(places: _Places, load: Any, out: Acting) -> None:
    _law(places, load, out, 0.0, 0.0, load.coefficient)


def _tabled(places: _Places, load: Any, out: Acting) -> None:
    """The cubics of a table over the coordinate or the rate, in internal units."""
    pieces, slides, column = load.law.pieces, True, -1
    if load.in_freedom is not None:
        column, slides = places.column(load.in_freedom)
    length, unit = (places.L, 1.0 / places.L) if slides else (1.0, places.L**-2)
    cubics = (unit * pieces.c * length ** np.arange(3.0, -1.0, -1.0)[:, None]).T.reshape(-1, 1)
    kind = load.law.x is None, load.law.outside == "hold", len(pieces.x) - 1
    numbers = rows(load.free) / length, *map(rows, kind), (pieces.x / length)[:, None], cubics * rows(load.scale)
    if load.in_freedom is not None:
        out.add(TABLE, column, 0, *numbers)
        return
    p, q = places.point(load.a, load.p), places.point(load.b, load.q)
    out.add(TABLE_BETWEEN, places.link(load.a), places.link(load.b), p, q, *numbers)


KINDS: dict[type[Load], Callable[[_Places, Any, Acting], None]] = {
    Gravity: _weight,
    Wrench: _wrench,
    Effort: _effort,
    Spring: _elastic,
    TorsionSpring: _elastic,
    Damper: _damper,
    ForceLaw: _tabled,
}
"""What puts a load into the tables, by its class."""
