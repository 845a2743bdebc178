"""What a row of the pair table consists of: freedoms, components of reactions and efforts, Lee's bookkeeping; and how they are read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from mechgraph.arguments import items_of
from mechgraph.quantities import is_numeric, shown, wrong

Six = tuple[float, float, float, float, float, float]

UNIT_TWISTS: dict[str, Six] = {
    name: tuple(float(i == j) for j in range(6))  # type: ignore[misc]
    for i, name in enumerate(("Rx", "Ry", "Rz", "Tx", "Ty", "Tz"))
}
UNIT_WRENCHES: dict[str, Six] = {
    name: tuple(float(i == j) for j in range(6))  # type: ignore[misc]
    for i, name in enumerate(("Mx", "My", "Mz", "Fx", "Fy", "Fz"))
}


@dataclass(frozen=True)
class Freedom:
    """One freedom: a constant unit twist ``twist + pitch * per_pitch``, angular part first.

    The angular part has length one (a turn) or zero (a slide; then the linear part has length one). ``per_pitch`` is the
    part that is multiplied by the pitch of the pair, as in a helical pair.
    """

    name: str
    twist: Six
    per_pitch: Six = (0.0,) * 6

    @property
    def label(self) -> str:
        """The freedom as the table shows it: ``Rz``, or ``Rz+pitch*Tz`` where the pitch enters."""
        moved = [name for name, unit in UNIT_TWISTS.items() if np.dot(unit, self.per_pitch)]
        return "+".join([self.name, *(f"pitch*{name}" for name in moved)])

    @property
    def turns(self) -> bool:
        """Whether the coordinate is an angle (radians) rather than a length."""
        return any(self.twist[:3])

    def scaled(self, L: float) -> Freedom:
        """The freedom with its lengths divided by ``L``: the linear part of a turn; itself where it has none."""
        if not self.turns or not any(self.twist[3:]):
            return self
        a, b, c, x, y, z = self.twist
        return replace(self, twist=(a, b, c, x / L, y / L, z / L))


@dataclass(frozen=True)
class Touching:
    """How the elements of a pair touch each other at a point or along a line.

    ``forces``: the components of the normal force; where a force closes the pair, a presses on b with a positive first one. ``a``, ``b``:
    the curvatures of the elements along the groove (or line) and across it, times their radii: (0, -1) is a groove, (1, 1) a ball,
    (0, 1) a cylinder, (0, 0) a plane, or curves that say theirs. ``tilting``: of a line the couple that moves the force along it.
    ``curved``: whether the elements are curves.
    """

    forces: tuple[str, ...]
    a: tuple[float, float]
    b: tuple[float, float]
    tilting: str | None = None
    curved: bool = False

    @property
    def along_line(self) -> bool:
        """Whether it is a line."""
        return not (self.a[0] or self.b[0])


@dataclass(frozen=True)
class Component:
    """One reaction component or effort: a constant wrench ``wrench + pitch * per_pitch`` in frame ``frame``.

    Its origin is that of the frame, or of marker B where ``at_b``.
    """

    name: str
    wrench: Six
    frame: int = 0
    per_pitch: Six = (0.0,) * 6
    at_b: bool = False

    @property
    def is_couple(self) -> bool:
        """Whether the component is a couple (unit of a moment) rather than a force."""
        return not any(self.wrench[3:])

    def scaled(self, L: float) -> Component:
        """The component with its lengths divided by ``L``: the moment (an arm) of a force; itself where it has none."""
        if self.is_couple or not any(self.wrench[:3]):
            return self
        a, b, c, x, y, z = self.wrench
        return replace(self, wrench=(a / L, b / L, c / L, x, y, z))


@dataclass(frozen=True)
class Bookkeeping:
    """How a ledger in Lee's manner writes the pair: a free dual force plus parts along the axis, under conditions.

    The dual force has six unknowns; ``conditions`` are unit twists of frame 0 to which it is reciprocal (equations) and
    ``along`` the components that the pair does transmit along its axis (unknowns). Source: Lee 1977, section 3.3.
    """

    conditions: tuple[Freedom, ...]
    along: tuple[Component, ...]

    @property
    def unknowns(self) -> int:
        """Number of unknowns, ``6 + len(along)``."""
        return 6 + len(self.along)

    @property
    def equations(self) -> int:
        """Number of constraint equations, ``len(conditions)``."""
        return len(self.conditions)

    def scaled(self, L: float) -> Bookkeeping:
        """The bookkeeping with its lengths divided by ``L``."""
        return Bookkeeping(all_scaled(self.conditions, L), all_scaled(self.along, L))


Scaled = TypeVar("Scaled", Freedom, Component)


def all_scaled(parts: Sequence[Scaled], L: float) -> tuple[Scaled, ...]:
    """Freedoms or components with their lengths divided by ``L``."""
    return tuple(part.scaled(L) for part in parts)


def read_freedom(item: object, faults: list[str]) -> Freedom | None:
    """A freedom from ``Freedom``, ``"Tz"`` or ``"Rz + pitch Tz"``; what is wrong with it is added to ``faults``."""
    if isinstance(item, Freedom):
        found = _name_fault(item.name, "freedom")
        found += _six_faults(item.twist, item.per_pitch, f"freedom {shown(item.name)}: twist")
        faults += found
        return None if found else item
    text = item if isinstance(item, str) else ""
    head, _, tail = (part.strip() for part in text.replace("pitch*", "pitch ").partition("+"))
    slide = tail.removeprefix("pitch").strip()
    if head in UNIT_TWISTS and (not tail or slide in UNIT_TWISTS):
        return Freedom(head, UNIT_TWISTS[head], UNIT_TWISTS[slide] if tail else (0.0,) * 6)
    faults.append(
        f"freedom {shown(item)}: unknown; give one of {', '.join(UNIT_TWISTS)}, 'rotation', 'Rz + pitch Tz' or a Freedom"
    )
    return None


def _name_fault(name: object, what: str) -> list[str]:
    return [] if isinstance(name, str) and name else [wrong(name, f"{what}: name", "a text")]


def _six_faults(constant: object, per_pitch: object, what: str) -> list[str]:
    order = "angular part first" if what.endswith("twist") else "moment part first"
    return [
        wrong(row, what, f"six finite numbers, {order}") for row in (constant, per_pitch) if not is_numeric(row, (6,))
    ]


def read_component(item: object, faults: list[str], what: str) -> Component | None:
    """A component from ``Component``, ``"Fz@2"`` or ``("Fz", 2)``; what is wrong with it is added to ``faults``."""
    if isinstance(item, Component):
        found = _name_fault(item.name, what) + _six_faults(
            item.wrench, item.per_pitch, f"{what} {shown(item.name)}: wrench"
        )
        if not isinstance(item.at_b, bool):
            found.append(wrong(item.at_b, f"{what} {shown(item.name)}: at_b", "true or false"))
        if type(item.frame) is not int:
            found.append(wrong(item.frame, f"{what} {shown(item.name)}: frame", "a whole number"))
        faults += found
        return None if found else item
    name, frame = item if isinstance(item, tuple) and len(item) == 2 else (item, 0)
    if isinstance(name, str) and "@" in name:
        name, _, frame = name.partition("@")
    if not isinstance(name, str) or name not in UNIT_WRENCHES or not (str(frame).isdecimal() and len(str(frame)) < 3):
        faults.append(
            f"{what} {shown(item)}: expected one of {', '.join(UNIT_WRENCHES)}, with '@k' for frame k, or a Component"
        )
        return None
    return Component(name, UNIT_WRENCHES[name], int(frame))


def bookkeeping_faults(given: object) -> list[str]:
    """What is wrong with a bookkeeping."""
    if not isinstance(given, Bookkeeping):
        return [wrong(given, "bookkeeping", "a Bookkeeping")]
    faults: list[str] = []
    for item in items_of(given.conditions, "bookkeeping: conditions", faults):
        if not isinstance(item, Freedom):
            faults.append(wrong(item, "bookkeeping: conditions", "a Freedom"))
        else:
            read_freedom(item, faults)
    for item in items_of(given.along, "bookkeeping: along", faults):
        if not isinstance(item, Component):
            faults.append(wrong(item, "bookkeeping: along", "a Component"))
        else:
            read_component(item, faults, "bookkeeping: along")
    return faults
