"""Solutions as tables: columns with units, CSV, pandas, xarray. A new export is a new function here."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.errors import MissingExtraError
from mechgraph.result.views import PairResult, Values
from mechgraph.units import unit_of
from mechgraph.writing import csv_of, write_whole

if TYPE_CHECKING:
    import os

    import pandas
    import xarray


ROWS_TOGETHER = 1024
"""Rows of a table that are made together: bounds the memory that a long table takes."""


def columns(s: Values) -> dict[str, Array]:
    """Columns by name: coordinates, rates, efforts, reaction components, status and checks.

    Names are ``B.Tz``, ``B.Tz velocity``, ``B.Tz effort`` (of the drive), ``B.Tz applied effort`` (of springs, dampers, given efforts),
    ``B:Fx`` (component of the reaction), with the unit in brackets where the mechanism declares units.
    """
    m = s.mechanism
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
    for name in ("closure", "equilibrium", "power"):
        out[name] = getattr(s.checks(), name)
    out["status"] = s.status()
    return out


def to_csv(s: Values, path: str | os.PathLike[str]) -> None:
    """Write one row a position; numbers with all digits. The rows are made as they are written, some at a time."""
    write_whole(path, _csv_pieces(s))


def _csv_pieces(s: Values) -> Iterator[str]:
    count = s.status().size
    for first in range(0, max(count, 1), ROWS_TOGETHER):
        table = columns(s.part(slice(first, first + ROWS_TOGETHER)))
        rows = zip(*(values.tolist() for values in table.values()), strict=True)
        yield csv_of(table if not first else (), rows)


def _optional(module: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError:
        raise MissingExtraError(module, module) from None


def to_pandas(s: Values) -> pandas.DataFrame:
    """The table as a DataFrame; several batch axes become index levels."""
    pd = _optional("pandas")
    frame = pd.DataFrame({name: np.asarray(values).reshape(-1) for name, values in columns(s).items()})
    if len(s.batch) > 1:
        frame.index = pd.MultiIndex.from_product([range(n) for n in s.batch], names=axis_names(s.batch))
    return frame


def to_xarray(s: Values) -> xarray.Dataset:
    """The table as a Dataset over the batch axes."""
    xr = _optional("xarray")
    dims = axis_names(s.batch)
    return xr.Dataset(
        {name: (dims, values) for name, values in columns(s).items()}, attrs={"mechanism": s.mechanism.name}
    )


def axis_names(batch: tuple[int, ...]) -> list[str]:
    """Names of the batch axes: the last is the position, those before it are cases."""
    return [f"case{i}" if len(batch) > 2 else "case" for i in range(len(batch) - 1)] + ["position"] * (len(batch) > 0)
