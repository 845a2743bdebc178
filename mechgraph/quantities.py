"""The one door for numbers: what counts as a number, how it is shown in a message, and how quantities of pint become plain numbers."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping, Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.units import BASE_UNITS, Dimension

LARGEST = 1e100
"""Numbers from here on are refused: their squares would overflow."""
DEEPEST = 32
"""Sequences nested more deeply are no arrays (numpy knows 64 axes)."""

_FLOATS, _PLAIN = {float}, {float, int}
_is_finite = LARGEST.__gt__
"""Whether the size of a number is below the largest; not so of what is no number (NaN)."""


def real_array(value: Any) -> NDArray[np.float64] | None:
    """An array of real numbers, or None.

    Numbers are integers and floats, Python's and numpy's, and sequences and arrays of them. Texts, true and false, complex numbers,
    dates, masked arrays and quantities are none.
    """
    if type(value) is np.ndarray and value.dtype == float:
        return value
    if not _is_real(value, DEEPEST):
        return None
    try:
        with np.errstate(over="ignore"):
            return np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return None


def _is_real(value: Any, depth: int) -> bool:
    kind = type(value)
    if kind in _PLAIN:
        return True
    if kind is np.ndarray or isinstance(value, np.generic):
        return bool(value.dtype.kind in "iuf")
    if isinstance(value, list | tuple):
        kinds = set(map(type, value))
        return kinds <= _PLAIN or (depth > 0 and all(_is_real(item, depth - 1) for item in value))
    if kind is bool or isinstance(value, np.ma.MaskedArray) or is_quantity(value):
        return False
    if isinstance(value, int | float | range):
        return True
    try:
        return bool(hasattr(value, "__array__") and np.asarray(value).dtype.kind in "iuf")
    except (TypeError, ValueError):
        return False


def all_floats(value: Sequence[Any]) -> bool:
    """Whether a sequence holds floats only, so that it needs no reading."""
    return set(map(type, value)) == _FLOATS


def is_numeric(value: Any, shape: tuple[int, ...]) -> bool:
    """Whether ``value`` is an array of finite numbers of the given shape."""
    if type(value) is float:
        return shape == () and abs(value) < LARGEST
    if type(value) is tuple and all_floats(value):
        return shape == (len(value),) and all(map(_is_finite, map(abs, value)))
    array = real_array(value)
    return array is not None and array.shape == shape and bool((np.abs(array) < LARGEST).all())


def no_limit(value: Any) -> bool:
    """Whether a limit is infinity, which means none."""
    return isinstance(value, float | np.floating) and value == np.inf


def column(values: Sequence[Any], shape: tuple[int, ...]) -> NDArray[np.float64] | None:
    """Floats and nested tuples of floats as an array ``(len(values), *shape)``; None where one is no such or not finite."""
    flat = values
    for width in shape:
        if not (set(map(type, flat)) <= {tuple} and set(map(len, flat)) <= {width}):
            return None
        flat = list(chain.from_iterable(flat))
    if not set(map(type, flat)) <= _FLOATS:
        return None
    made = np.array(flat, dtype=float).reshape(len(values), *shape)
    return made if bool((np.abs(made) < LARGEST).all()) else None


# --- quantities ------------------------------------------------------------------------------------------------------------


def is_quantity(value: Any) -> bool:
    """Whether a value carries a unit of its own, as those of pint do (those of other packages are not converted, and refused)."""
    return (hasattr(value, "units") or hasattr(value, "unit")) and hasattr(value, "to")


def has_quantity(value: Any, depth: int = DEEPEST) -> bool:
    """Whether a value is a quantity, or a sequence or table with one."""
    if type(value) is float or value is None:
        return False
    if isinstance(value, Mapping):
        value = tuple(value.values())
    if isinstance(value, list | tuple):
        return depth > 0 and not set(map(type, value)) <= _PLAIN and any(has_quantity(v, depth - 1) for v in value)
    return not isinstance(value, str) and is_quantity(value)


def without_units(value: Any, dimension: Dimension, units: Mapping[str, str]) -> Any:
    """Quantities, in sequences and tables too, as plain numbers in the given units, angles in radians; unchanged where they do not fit.

    Plain numbers beside them stay what they are. Without ``units`` nothing is converted.
    """
    if isinstance(value, Mapping):
        return {name: without_units(item, dimension, units) for name, item in value.items()}
    if isinstance(value, list | tuple) and has_quantity(value):
        return tuple(without_units(item, dimension, units) for item in value)
    powers = {name: power for name, power in zip(BASE_UNITS, dimension, strict=True) if power}
    if not units or not set(powers) <= set(units) or not is_quantity(value):
        return value
    wanted = " * ".join(f"({units[name]}) ** {power}" for name, power in powers.items())
    try:
        return value.to(wanted or "radian").magnitude
    except Exception:  # the errors of pint have no base that could be named without importing it
        return value


# --- messages --------------------------------------------------------------------------------------------------------------


class _Shown(reprlib.Repr):
    def __init__(self) -> None:
        super().__init__()
        self.maxlevel, self.maxstring, self.maxlong, self.maxother = 4, 80, 40, 120
        self.maxtuple = self.maxlist = self.maxdict = 12

    def repr_Quantity(self, x: Any, level: int) -> str:
        """A quantity of pint, with its unit in words."""
        return str(x)

    def repr_int(self, x: int, level: int) -> str:
        """An integer; Python itself refuses to write one of more than 4300 digits."""
        return super().repr_int(x, level) if abs(x) < 10**1000 else f"an integer of {x.bit_length()} bits"


_SHOWN = _Shown()


def shown(value: Any) -> str:
    """A value as messages show it: ``repr`` in one line, cut where it is long or nested deeply."""
    return " ".join(_SHOWN.repr(value).split())


def wrong(value: Any, what: str, wanted: str) -> str:
    """The fault of a value that is not what is ``wanted``."""
    hint = "; quantities are converted where the mechanism declares units that they fit, else give plain numbers"
    return f"{what} = {shown(value)}: expected {wanted}{hint if has_quantity(value) else ''}"
