"""Numbers for people: five digits, units, and the range of quantities over positions."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from mechgraph.document import Table

SHOWN_AS_ZERO = 1e-11
"""Part of the largest value of its kind below which a value is rounding noise and shown as 0."""


def number(value: float, scale: float = 0.0) -> str:
    """Five digits; 0 for what is noise beside ``scale``."""
    if abs(value) <= SHOWN_AS_ZERO * scale or abs(value) < 1e-300:
        return "0"
    return f"{value:.5g}"


def with_unit(text: str, unit: str) -> str:
    """A number or name and the unit behind it, where there is one."""
    return f"{text} {unit}" if unit else text


def bracket(unit: str) -> str:
    """The unit in the head of a column."""
    return f" [{unit}]" if unit else ""


def ranges(rows: Iterable[tuple[str, Any]], name: Callable[[int], str] = "position {}".format) -> Table:
    """The range of every quantity over the positions, and at which it is reached; of one position the values."""
    found = [(label, np.asarray(values, dtype=float).reshape(-1)) for label, values in rows]
    if all(values.size == 1 for _, values in found):
        return Table(("quantity", "value"), [(label, _value(values[0], 0.0)) for label, values in found], "lr")
    cells: list[tuple[str, ...]] = []
    for label, values in found:
        if not np.isfinite(values).any():
            cells.append((label, "no value", "", "", ""))
            continue
        least, greatest = int(np.nanargmin(values)), int(np.nanargmax(values))
        size = max(abs(values[least]), abs(values[greatest]))
        cells.append((label, _value(values[least], size), name(least), _value(values[greatest], size), name(greatest)))
    return Table(("quantity", "least", "at", "greatest", "at"), cells, "lrrrr")


def _value(value: float, scale: float) -> str:
    return "no value" if np.isnan(value) else number(float(value), scale)
