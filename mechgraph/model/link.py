"""Links: the nodes of the graph, rigid bodies with mass."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np

from mechgraph.algebra.inertia import physical_faults
from mechgraph.errors import DeclarationError
from mechgraph.model.field_format import Described
from mechgraph.model.field_kinds import FLAG, NUMBER, POINT, POINTS, TENSOR, TEXT
from mechgraph.quantities import is_numeric, shown
from mechgraph.units import INERTIA, LENGTH, MASS

NO_POINTS: Mapping[str, tuple[float, ...]] = MappingProxyType({})


@dataclass(frozen=True)
class Link(Described):
    """A link (rigid body).

    Parameters
    ----------
    name : its name in the graph.
    mass : not negative.
    center : mass centre in the link's frame (global coordinates at the declared configuration for the point/axis form);
        needed where mass > 0.
    inertia : 3 x 3 tensor about the mass centre, in the link's frame (off-diagonals are minus the products of inertia).
    unphysical : accept an inertia that no body can have.
    points : named points, ``{"tip": (x, y, z)}`` in the coordinates of ``center``, for loads, prescribed motion and results.
    """

    name: Annotated[str, TEXT("in a chain: `frame`, `link1`, `link2`, ...")]
    mass: Annotated[float, NUMBER("mass", MASS, minimum=0.0)] = 0.0
    center: Annotated[
        Any,
        POINT(
            "mass centre in the link's frame (global where pairs are given by point and axis)",
            LENGTH,
            default="needed where mass > 0",
        ),
    ] = None
    inertia: Annotated[
        Any,
        TENSOR(
            "tensor about the mass centre, in the link's frame; off-diagonals are minus the products of inertia",
            INERTIA,
            default="0",
        ),
    ] = None
    unphysical: Annotated[bool, FLAG("accept an inertia that no body can have")] = False
    points: Annotated[
        Any, POINTS("named points, name → 3 numbers, in the coordinates of `center`", LENGTH, default="none")
    ] = field(default=None, hash=False)

    def __post_init__(self) -> None:
        self.read_numbers()
        if self.points is None:
            object.__setattr__(self, "points", NO_POINTS)

    def __reduce__(self) -> tuple[Any, ...]:
        given = {name: getattr(self, name) for name in self.formats}
        return partial(type(self), **given | {"points": dict(self.points)}), ()

    def point(self, name: str) -> tuple[float, float, float]:
        """The point of that name, in the link's frame."""
        if name not in self.points:
            raise DeclarationError(f"link {self.name!r}", [self.point_fault(name)])
        at: tuple[float, float, float] = self.points[name]
        return at

    def point_fault(self, name: Any) -> str:
        """What to say of a name that is no point of this link."""
        known = (
            f"its points: {', '.join(self.points)}" if self.points else "it has none; declare points={'tip': (x, y, z)}"
        )
        return f"link {self.name!r} has no point {shown(name)} ({known})"

    def faults(self) -> list[str]:
        """What is wrong with this link, one line each."""
        where = f"link {shown(self.name)}: "
        if not isinstance(self.name, str) or not self.name:
            return [f"{where}the name must be a non-empty text"]
        found = self.value_faults(where)
        if self.center is None and is_numeric(self.mass, ()) and self.mass > 0:
            found.append(f"{where}mass = {self.mass:g} without a center; give center=(x, y, z)")
        if is_numeric(self.inertia, (3, 3)):
            if self.center is None:
                found.append(f"{where}inertia without a center; give center=(x, y, z)")
            if is_numeric(self.mass, ()) and self.mass == 0 and np.any(self.inertia):
                found.append(f"{where}inertia without mass; give mass=")
            if isinstance(self.unphysical, bool) and not self.unphysical:
                impossible = physical_faults(self.inertia)
                found += [
                    f"{where}inertia: {fault}; no body has it (unphysical=True accepts it)" for fault in impossible
                ]
        return found
