"""Numbers as a user types them: read leniently, kept as floats and tuples of floats, faults described in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

LARGEST = 1e100
"""Numbers from here on are refused: their squares would overflow."""

_FLOAT_ONLY = {float}


@dataclass(frozen=True, eq=False)
class PerCase:
    """One number or vector for each of many variants, ``(cases, ...)``: what stands in a load that varies."""

    values: NDArray[np.float64]


def plain(value: Any) -> Any:
    """Numbers, sequences and arrays as floats and nested tuples; what is no number is kept unchanged."""
    kind = type(value)
    if value is None or kind is float or kind is str or (kind is tuple and _all_floats(value)) or callable(value):
        return value
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return value
    if array.ndim == 1:
        return tuple(array.tolist())
    return tuple(map(tuple, array.tolist())) if array.ndim == 2 else _as_tuples(array.tolist())


def _as_tuples(value: Any) -> Any:
    return tuple([_as_tuples(v) for v in value]) if isinstance(value, list) else value


def _all_floats(value: tuple[Any, ...]) -> bool:
    """Whether a tuple holds floats only, so that it needs no reading."""
    return set(map(type, value)) == _FLOAT_ONLY


def is_numeric(value: Any, shape: tuple[int, ...]) -> bool:
    """Whether ``value`` is an array of finite numbers of the given shape."""
    if type(value) is float:
        return shape == () and abs(value) < LARGEST
    if type(value) is tuple and _all_floats(value):
        return shape == (len(value),) and all(abs(v) < LARGEST for v in value)
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return False
    return array.shape == shape and bool((np.abs(array) < LARGEST).all())


def vector_fault(value: Any, what: str, *, direction: bool = False, hint: str = "") -> str | None:
    """The fault of a vector of three numbers, or None; a direction must not be zero."""
    if not is_numeric(value, (3,)):
        return f"{what} = {value!r}: expected three finite numbers{hint}"
    if direction and not math.hypot(*value) > 1e-12:
        return f"{what} = {value!r}: has length 0; give a direction, e.g. (0, 0, 1)"
    return None


def number_fault(value: Any, what: str, *, minimum: float | None = None) -> str | None:
    """The fault of one number, or None."""
    if not is_numeric(value, ()):
        return f"{what} = {value!r}: expected a finite number"
    if minimum is not None and float(value) < minimum:
        return f"{what} = {value!r}: expected a number not below {minimum:g}"
    return None


def same(a: Any, b: Any) -> bool:
    """Equality that also holds for arrays."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.shape(a) == np.shape(b) and bool(np.array_equal(np.asarray(a), np.asarray(b)))
    return bool(a == b)


def same_fields(a: Any, b: Any) -> bool:
    """Field by field equality of two dataclasses of one type, arrays included."""
    return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a) if f.compare)


def column(values: Sequence[Any], shape: tuple[int, ...]) -> NDArray[np.float64] | None:
    """A whole column of values ``(len(values), *shape)``; None where one of them is no array of finite numbers of that shape."""
    try:
        made = np.array(values, dtype=float) if values else np.zeros((0, *shape))
    except (TypeError, ValueError, OverflowError):
        return None
    return made if made.shape == (len(values), *shape) and bool((np.abs(made) < LARGEST).all()) else None
