"""The table of a solution: columns with their units, and what they may hold beside the pairs on request."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import items_of
from mechgraph.errors import DeclarationError
from mechgraph.model.loads import Law
from mechgraph.quantities import wrong
from mechgraph.result.contacts import contact_columns
from mechgraph.result.values import MaterialPoint, Values
from mechgraph.result.views import PairResult
from mechgraph.units import unit_of


class Column(NamedTuple):
    """Name, values ``(...)`` and unit of a column; no unit where the mechanism declares none, and for what has none."""

    name: str
    values: Array
    unit: str = ""

    @property
    def label(self) -> str:
        """``A.Rz effort [N m]``."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


def table_of(s: Values, include: Sequence[Include] = ()) -> list[Column]:
    """All columns: coordinates, rates, efforts, reaction components, status and checks.

    Names are ``B.Tz``, ``B.Tz velocity``, ``B.Tz effort`` (of the drive), ``B.Tz applied effort`` (of springs, dampers, given efforts),
    ``B:Fx`` (component of the reaction). ``include`` adds what ``MORE`` has under these names.
    """
    m = s.mechanism
    faults: list[str] = []
    asked = items_of(include, "include", faults)
    faults += [wrong(name, "include", " or ".join(map(repr, MORE))) for name in asked if name not in tuple(MORE)]
    if faults:
        raise DeclarationError("table of a solution", faults)
    out: list[Column] = []

    def put(name: str, values: Array | NDArray[np.str_], *dimension: float, unit: str = "") -> None:
        out.append(Column(name, np.asarray(values), unit or unit_of(m.units, dimension)))

    if s.t is not None:
        put("t", np.broadcast_to(s.t, s.batch), 0, 0, 1)
    shown = {*m.freedom_names(), *s.prescribed}
    for k, pair in enumerate(s.whole.pairs):
        r = PairResult(s, k)
        values = (r.position, r.velocity, r.acceleration)
        for j, (name, freedom) in enumerate(zip(pair.freedom_names, pair.type.freedoms, strict=True)):
            if name not in shown:
                continue
            for order, (label, value) in enumerate(zip(("", " velocity", " acceleration"), values, strict=True)):
                put(name + label, value[..., j], 0 if freedom.turns else 1, 0, -order)
    if s.has_forces:
        for k, pair in enumerate(s.whole.pairs):
            r = PairResult(s, k)
            efforts = {"effort": r.effort, "applied effort": r.applied_effort}
            for j, (name, part) in enumerate(zip(pair.freedom_names, pair.type.efforts, strict=True)):
                for label, effort in efforts.items() if name in shown else ():
                    put(f"{name} {label}", effort[..., j], 2 if part.is_couple else 1, 1, -2)
            for name, value in r.components.items():
                put(f"{pair.name}:{name}", value, unit=r.units["components"][name])
    for name in asked:
        for column, more, dimension in MORE[name](s):
            put(column, more, *dimension)
    for name in ("closure", "equilibrium", "power", "accuracy"):
        put(name, getattr(s.checks(), name))
    put("status", s.status())
    return out


Extra = tuple[str, Array, tuple[int, ...]]
"""Name, values and dimension of a column; no exponents for a number without a unit."""
XYZ = "xyz"


def _vector(name: str, values: Array, dimension: tuple[int, ...], letters: Sequence[str] = XYZ) -> Iterator[Extra]:
    for i, letter in enumerate(letters):
        yield f"{name}:{letter}", values[..., i], dimension


def _point(name: str, p: MaterialPoint) -> Iterator[Extra]:
    for order, (label, values) in enumerate(zip(("", " velocity", " acceleration"), p, strict=True)):
        yield from _vector(name + label, values, (1, 0, -order))


def _points(s: Values) -> Iterator[Extra]:
    """Motion of the named points of links: ``bucket.tip:x``, ``bucket.tip velocity:x``, ..."""
    for i, link in enumerate(s.mechanism.links):
        for name, p in link.points.items():
            yield from _point(f"{link.name}.{name}", s.link_point(i, p))


def _links(s: Values) -> Iterator[Extra]:
    """Poses of the links: origin of the frame ``crank:x``, rotation matrix ``crank:Rxx``, and angular rates."""
    for i, link in enumerate(s.mechanism.links):
        pose, twist, acceleration = s.link(i)
        yield from _vector(link.name, pose[..., :3, 3], (1, 0, 0))
        for j, row in enumerate(XYZ):
            for k, column in enumerate(XYZ):
                yield f"{link.name}:R{row}{column}", pose[..., j, k], ()
        yield from _vector(f"{link.name} angular velocity", twist[..., :3], (0, 0, -1))
        yield from _vector(f"{link.name} angular acceleration", acceleration[..., :3], (0, 0, -2))


def _centers(s: Values) -> Iterator[Extra]:
    """Motion of the mass centres: ``crank center:x``, ``crank center velocity:x``, ..."""
    for i, link in enumerate(s.mechanism.links):
        if link.center is not None:
            yield from _point(f"{link.name} center", s.link_point(i, None))


def _loads(s: Values) -> Iterator[Extra]:
    """What loads do: coordinate, rate and force of laws, efforts, else wrenches on links about the global origin; and their power."""
    m = s.mechanism
    for i, load in enumerate(m.loads):
        found, name = s.load(i), f"loads[{i}] {load.kind}"
        turns = m.turns(load.in_freedom)
        if isinstance(load, Law):
            yield f"{name} x", found.coordinate, (0 if turns else 1, 0, 0)
            yield f"{name} v", found.rate, (0 if turns else 1, 0, -1)
        if isinstance(load, Law) or load.in_freedom is not None:
            yield f"{name} force", found.force, (2 if turns else 1, 1, -2)
        else:
            for link, wrench in found.wrenches.items():
                yield from _vector(f"{name} on {link}", wrench[..., :3], (2, 1, -2), ("Mx", "My", "Mz"))
                yield from _vector(f"{name} on {link}", wrench[..., 3:], (1, 1, -2), ("Fx", "Fy", "Fz"))
        yield f"{name} power", found.power, (2, 1, -3)


Include = Literal["points", "links", "centers", "loads", "contacts"]
MORE: dict[str, Callable[[Values], Iterator[Extra]]] = {
    "points": _points,
    "links": _links,
    "centers": _centers,
    "loads": _loads,
    "contacts": contact_columns,
}
"""What a table may have beside the pairs, on request."""
