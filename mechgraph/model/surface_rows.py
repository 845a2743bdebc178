"""The row of a sphere on a surface, and the row of any type with or without curve and surface."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array, cross
from mechgraph.model.contact_rows import ROWS
from mechgraph.model.on_surface import OnSurface
from mechgraph.model.pair_table import TABLE
from mechgraph.model.pair_type import PairType
from mechgraph.model.placed_rows import (
    OFF_CURVE,
    UNIT_ROUNDING,
    Contact,
    extent,
    filled,
    of_function,
    pair_row,
    rounded,
    travels,
)
from mechgraph.model.row_parts import Touching
from mechgraph.model.surfaces import Surface
from mechgraph.quantities import is_numeric

SURFACE_ROWS = {
    "Sp": pair_row(
        "Sp",
        "sphere on surface",
        [OnSurface(), "rotation"],
        ["Fz@2"],
        ["Fx@2", "Fy@2", "Mx@2", "My@2", "Mz@2"],
        Touching(("Fz",), a=(0.0, 0.0), b=(1.0, 1.0), curved=True),
    )
}
"""The same of those that take a surface."""
_BY_SYMBOL = {**ROWS, **TABLE}
_WITH_CURVE = {**TABLE, **ROWS}
_WITH_SURFACE = {**TABLE, **SURFACE_ROWS}
_SYMBOLS = {
    name: symbol
    for rows in (ROWS, SURFACE_ROWS, TABLE)
    for symbol, row in rows.items()
    for name in (row.name, row.name.partition(" (")[0], row.name.partition(",")[0])
}
"""Symbols by full names, ``"revolute"`` or ``"sphere in groove"``, and by what stands there before a bracket or comma."""


def row_of(type: Any, curve: Any, surface: Any = None) -> Any:
    """The row of a pair of a type (a symbol or a row) with or without a curve or surface; what is no type is kept."""
    bent = curve is not None or surface is not None
    symbol = type.symbol if isinstance(type, PairType) and (bent or travels(type)) else type
    if not isinstance(symbol, str):
        return symbol
    rows = _WITH_SURFACE if surface is not None else _WITH_CURVE if bent else _BY_SYMBOL
    return rows.get(symbol) or rows.get(_SYMBOLS.get(symbol.lower().replace("_", " "), ""), type)


def placed_surface(row: PairType) -> OnSurface | None:
    """The place for a surface in a row."""
    return next((step for step in row.steps if isinstance(step, OnSurface)), None)


def on_surface(
    row: PairType,
    surface: Surface,
    point: Sequence[float] | None,
    axis: Sequence[float] | None,
    pair: str,
    on_b: Array | None = None,
    roller: float | None = None,
) -> Contact:
    """A row of a ``pair`` with its surface put in; coordinates zero at ``point`` (in the middle if left out), z towards ``axis``.

    The centre of a ball (``roller``) travels beside the surface, on the side of the point.
    """
    surface = _beside(surface, roller, point) or surface
    if point is not None:
        surface = surface.away_from_pole(np.asarray(point))
    middle = tuple(
        0.5 * (low + high) if np.isfinite(low + high) else 1.0 if np.isfinite(low) else 0.0
        for low, high in surface.ends
    )
    home = middle if point is None else surface.nearest(np.asarray(point))
    x, *along = surface.at(*np.array(home)[:, None])[:3, :, 0]
    u, v = map(rounded, home, extent(surface, x) / np.linalg.norm(along, axis=1))
    placed = OnSurface(surface, (u, v))
    if axis is not None and placed.start[:, 2] @ np.asarray(axis) < 0:
        placed = replace(placed, turned=True)
    off = 0.0 if point is None or on_b is not None else float(np.linalg.norm(placed.start[:, 3] - point))
    return Contact(filled(row, [placed], pair), placed.start, (off,))


def _beside(surface: Surface, roller: float | None, point: Sequence[float] | None) -> Surface | None:
    """The surface itself, or that of the centre of a ball on the side of the point, or of the normal; None where there is none."""
    if not roller:
        return surface
    side = 1.0
    if point is not None:
        surface = surface.away_from_pole(np.asarray(point))
        x, xu, xv = surface.at(*np.array(surface.nearest(np.asarray(point)))[:, None])[:3, :, 0]
        side = 1.0 if (np.asarray(point) - x) @ cross(xu, xv) > 0 else -1.0
    return surface.offset(side * roller)


def _ball_faults(surface: Surface, roller: Any, point: Any, where: str) -> list[str]:
    """What is wrong with a ball on a surface."""
    if roller is None or not is_numeric(roller, ()) or not roller > 0:
        return []  # said as the number that it is
    if _beside(surface, roller, point) is not None:
        return []
    return [
        f"{where}roller: the centre of a ball of radius {roller:.6g} has no {surface.kind} beside this one; give the surface on which the "
        "centre travels, and radius="
    ]


def surface_faults(row: Any, surface: Surface, point: Any, where: str, roller: Any = None) -> list[str]:
    """What is wrong with a surface in a row, before it is put in."""
    if not isinstance(row, PairType) or not any(isinstance(step, OnSurface) for step in row.steps):
        return [
            f"{where}surface: a pair {getattr(row, 'symbol', '?')} takes none; those that do: {', '.join(SURFACE_ROWS)}"
        ]
    if not (point is None or is_numeric(point, (3,))):
        return [f"{where}surface: point is at fault"]
    found = of_function(lambda: surface.faults(f"{where}surface."), f"{where}surface.")
    found = found or _ball_faults(surface, roller, point, where)
    if found or point is None:
        return found
    surface = surface.away_from_pole(np.asarray(point))
    x = surface.at(*np.array(surface.nearest(np.asarray(point)))[:, None])[:, :, 0]
    normal, sizes = np.linalg.norm(np.cross(x[1], x[2])), np.linalg.norm(x[1:3], axis=1)
    if normal <= 1e-9 * sizes.max() ** 2 + 1e-300:
        return [
            f"{where}surface: has no normal at ({', '.join(f'{v:.6g}' for v in x[0])}), as at a pole or an apex; take another point"
        ]
    return []


def surface_miss(contact: Contact, tol: float, where: str) -> Iterator[str]:
    """A contact that is not on its surface."""
    surface = next(
        step.surface for step in contact.row.steps if isinstance(step, OnSurface) and step.surface is not None
    )
    size = max(extent(surface, contact.marker[:, 3]), UNIT_ROUNDING / OFF_CURVE)
    if contact.misses[0] > max(OFF_CURVE, tol) * size:
        at = ", ".join(f"{v:.6g}" for v in contact.marker[:, 3])
        yield (
            f"{where}point: is {contact.misses[0]:.6g} off its surface, which is nearest at ({at}); give that point, or the marker on "
            "link b (on_b=mg.Marker(...), and no point) to have the mechanism assembled"
        )
