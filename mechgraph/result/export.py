"""Solutions as tables: columns with units, CSV, pandas, xarray. A new export is a new function here."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import items_of
from mechgraph.errors import DeclarationError, MissingExtraError
from mechgraph.model.force_law import Law
from mechgraph.quantities import wrong
from mechgraph.result.views import MaterialPoint, PairResult, Values
from mechgraph.units import unit_of
from mechgraph.writing import csv_of, write_whole

if TYPE_CHECKING:
    import os

    import pandas
    import xarray


ROWS_TOGETHER = 1024
"""Rows of a table that are made together: bounds the memory that a long table takes."""


def columns(s: Values, include: Sequence[Include] = ()) -> dict[str, Array]:
    """Columns by name: coordinates, rates, efforts, reaction components, status and checks.

    Names are ``B.Tz``, ``B.Tz velocity``, ``B.Tz effort`` (of the drive), ``B.Tz applied effort`` (of springs, dampers, given efforts),
    ``B:Fx`` (component of the reaction), with the unit in brackets where the mechanism declares units. ``include`` adds
    what ``MORE`` has under these names.
    """
    m = s.mechanism
    faults: list[str] = []
    asked = items_of(include, "include", faults)
    faults += [wrong(name, "include", " or ".join(map(repr, MORE))) for name in asked if name not in tuple(MORE)]
    if faults:
        raise DeclarationError("table of a solution", faults)
    out: dict[str, Array] = {}

    def put(name: str, values: Any, *dimension: float, unit: str = "") -> None:
        unit = unit or unit_of(m.units, dimension)
        out[f"{name} [{unit}]" if unit else name] = np.asarray(values)

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
    for name in ("closure", "equilibrium", "power"):
        out[name] = getattr(s.checks(), name)
    out["status"] = s.status()
    return out


Column = tuple[str, Array, tuple[int, ...]]
"""Name, values and dimension of a column; no exponents for a number without a unit."""
XYZ = "xyz"


def _vector(name: str, values: Array, dimension: tuple[int, ...], letters: Sequence[str] = XYZ) -> Iterator[Column]:
    for i, letter in enumerate(letters):
        yield f"{name}:{letter}", values[..., i], dimension


def _point(name: str, p: MaterialPoint) -> Iterator[Column]:
    for order, (label, values) in enumerate(zip(("", " velocity", " acceleration"), p, strict=True)):
        yield from _vector(name + label, values, (1, 0, -order))


def _points(s: Values) -> Iterator[Column]:
    """Motion of the named points of links: ``bucket.tip:x``, ``bucket.tip velocity:x``, ..."""
    for i, link in enumerate(s.mechanism.links):
        for name, p in link.points.items():
            yield from _point(f"{link.name}.{name}", s.link_point(i, p))


def _links(s: Values) -> Iterator[Column]:
    """Poses of the links: origin of the frame ``crank:x``, rotation matrix ``crank:Rxx``, and angular rates."""
    for i, link in enumerate(s.mechanism.links):
        pose, twist, acceleration = s.link(i)
        yield from _vector(link.name, pose[..., :3, 3], (1, 0, 0))
        for j, row in enumerate(XYZ):
            for k, column in enumerate(XYZ):
                yield f"{link.name}:R{row}{column}", pose[..., j, k], ()
        yield from _vector(f"{link.name} angular velocity", twist[..., :3], (0, 0, -1))
        yield from _vector(f"{link.name} angular acceleration", acceleration[..., :3], (0, 0, -2))


def _centers(s: Values) -> Iterator[Column]:
    """Motion of the mass centres: ``crank center:x``, ``crank center velocity:x``, ..."""
    for i, link in enumerate(s.mechanism.links):
        if link.center is not None:
            yield from _point(f"{link.name} center", s.link_point(i, None))


def _loads(s: Values) -> Iterator[Column]:
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


Include = Literal["points", "links", "centers", "loads"]
MORE: dict[str, Callable[[Values], Iterator[Column]]] = {
    "points": _points,
    "links": _links,
    "centers": _centers,
    "loads": _loads,
}
"""What a table may have beside the pairs, on request."""


def to_csv(s: Values, path: str | os.PathLike[str], include: Sequence[Include] = ()) -> None:
    """Write one row a position; numbers with all digits. The rows are made as they are written, some at a time."""
    write_whole(path, _csv_pieces(s, include))


def _csv_pieces(s: Values, include: Sequence[Include]) -> Iterator[str]:
    count = s.status().size
    for first in range(0, max(count, 1), ROWS_TOGETHER):
        table = columns(s.part(slice(first, first + ROWS_TOGETHER)), include)
        rows = zip(*(values.tolist() for values in table.values()), strict=True)
        yield csv_of(table if not first else (), rows)


def _optional(module: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError:
        raise MissingExtraError(module, module) from None


def to_pandas(s: Values, include: Sequence[Include] = ()) -> pandas.DataFrame:
    """The table as a DataFrame; several batch axes become index levels."""
    pd = _optional("pandas")
    frame = pd.DataFrame({name: np.asarray(values).reshape(-1) for name, values in columns(s, include).items()})
    if len(s.batch) > 1:
        frame.index = pd.MultiIndex.from_product([range(n) for n in s.batch], names=axis_names(s.batch))
    return frame


def to_xarray(s: Values, include: Sequence[Include] = ()) -> xarray.Dataset:
    """The table as a Dataset over the batch axes."""
    xr = _optional("xarray")
    dims = axis_names(s.batch)
    return xr.Dataset(
        {name: (dims, values) for name, values in columns(s, include).items()}, attrs={"mechanism": s.mechanism.name}
    )


def axis_names(batch: tuple[int, ...]) -> list[str]:
    """Names of the batch axes: the last is the position, those before it are cases."""
    return [f"case{i}" if len(batch) > 2 else "case" for i in range(len(batch) - 1)] + ["position"] * (len(batch) > 0)
