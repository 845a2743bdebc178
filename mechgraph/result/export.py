"""A solution in the forms of other programs: CSV, pandas and Parquet, xarray and NetCDF. A new file format is a row of ``FORMATS``."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import numpy as np

from mechgraph.errors import visible
from mechgraph.result.table import Include, table_of
from mechgraph.result.values import Values
from mechgraph.units import BASE_UNITS
from mechgraph.writing import Format, csv_of, format_of, optional, whole_file, write_whole

if TYPE_CHECKING:
    import pandas
    import xarray

ROWS_TOGETHER = 1024
"""Rows of a CSV table that are made together: bounds the memory that a long table takes."""
Path = str | os.PathLike[str]


def to_csv(s: Values, path: Path, include: Sequence[Include] = ()) -> None:
    """Write one row a position; numbers with all digits. The rows are made as they are written, some at a time."""
    write_whole(path, _csv_pieces(s, include))


def _csv_pieces(s: Values, include: Sequence[Include]) -> Iterator[str]:
    count = s.status().size
    for first in range(0, max(count, 1), ROWS_TOGETHER):
        table = table_of(s.part(slice(first, first + ROWS_TOGETHER)), include)
        rows = zip(*(column.values.tolist() for column in table), strict=True)
        yield csv_of([column.label for column in table] if not first else (), rows)


def to_pandas(s: Values, include: Sequence[Include] = ()) -> pandas.DataFrame:
    """The table as a DataFrame; several batch axes become index levels, units by column stand in ``attrs`` too."""
    pd = optional("pandas", "pandas")
    table = table_of(s, include)
    frame = pd.DataFrame({column.label: column.values.reshape(-1) for column in table})
    if len(s.batch) > 1:
        frame.index = pd.MultiIndex.from_product([range(n) for n in s.batch], names=axis_names(s.batch))
    frame.attrs = {**_facts(s), "units": {column.label: column.unit for column in table if column.unit}}
    return frame


def to_parquet(s: Values, path: Path, include: Sequence[Include] = ()) -> None:
    """Write the DataFrame as Parquet; ``pandas.read_parquet`` gives back an equal one, ``attrs`` included."""
    frame = to_pandas(s, include).rename(columns=visible)
    frame.attrs["units"] = {visible(name): unit for name, unit in frame.attrs["units"].items()}
    with whole_file(path) as temporary:
        frame.to_parquet(temporary, engine="pyarrow")


def to_xarray(s: Values, include: Sequence[Include] = ()) -> xarray.Dataset:
    """The table as a Dataset over the batch axes: units as attributes, times and what is prescribed as coordinates.

    One row of rising times is the dimension ``t``, every other last axis is ``position``.
    """
    xr = optional("xarray", "xarray")
    axes = axis_names(s.batch)
    if s.t is not None and np.shape(s.t) == s.batch and len(axes) == 1 and bool((np.diff(s.t) > 0).all()):
        axes = ["t"]
    data: dict[str, Any] = {}
    for name, values, unit in table_of(s, include):
        data[name] = (axes, values, {"units": unit} if unit else {})
    coordinates = [name for name in ("t", *s.prescribed) if name in data]
    return xr.Dataset(data, attrs=_facts(s)).set_coords(coordinates)


def to_netcdf(s: Values, path: Path, include: Sequence[Include] = ()) -> None:
    """Write the Dataset as NetCDF 4; ``xarray.open_dataset`` gives it back.

    A slash separates groups there and a space coordinates: they are quoted as in an address (``urllib.parse.unquote`` undoes it).
    """
    data = to_xarray(s, include)
    signs = {name: r"[%/\s]" if name in data.coords else "[%/]" for name in data.variables}
    names = {name: re.sub(sign, lambda found: quote(found[0], safe=""), str(name)) for name, sign in signs.items()}
    data = data.rename({name: visible(quoted) for name, quoted in names.items()})
    with whole_file(path) as temporary:
        data.to_netcdf(temporary, engine="h5netcdf")


FORMATS = (
    Format("CSV", (".csv",), to_csv),
    Format("NetCDF", (".nc",), to_netcdf, ("xarray", "h5netcdf", "h5py"), "netcdf"),
    Format("Parquet", (".parquet",), to_parquet, ("pandas", "pyarrow"), "parquet"),
)
"""What a solution can be written as."""


def write(s: Values, path: Path, include: Sequence[Include] = ()) -> None:
    """Write the table in the format that the suffix says."""
    format_of(path, FORMATS).write(s, path, include)


def _facts(s: Values) -> dict[str, str]:
    """What the solution is of, and how it was made; texts alone."""
    m = s.mechanism
    texts = {"mechanism": m.name, "description": m.description, "source": m.source, "engine": s.engine}
    texts |= {"method": s.method or "", **{f"unit of {name}": m.units.get(name, "") for name in BASE_UNITS}}
    return {name: visible(text) for name, text in texts.items() if text}


def axis_names(batch: tuple[int, ...]) -> list[str]:
    """Names of the batch axes: the last is the position, those before it are cases."""
    return [f"case{i}" if len(batch) > 2 else "case" for i in range(len(batch) - 1)] + ["position"] * (len(batch) > 0)
