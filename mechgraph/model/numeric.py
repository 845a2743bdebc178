"""Numbers of a declaration: kept as floats and tuples of floats, faults described in words."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.quantities import all_floats, is_numeric, real_array, wrong

PARALLEL_COSINE = 1 - 1e-12
"""Cosine above which a second direction is parallel to the axis."""
MOST_TOL = 0.1
"""Largest tolerance: beyond, a change is no rounding."""


@dataclass(frozen=True, eq=False)
class PerCase:
    """One number or vector for each of many variants, ``(cases, ...)``: what stands in a load that varies."""

    values: NDArray[np.float64]


def plain(value: Any) -> Any:
    """Numbers, sequences and arrays as floats and nested tuples; what is no number is kept unchanged."""
    kind = type(value)
    if value is None or kind is float or kind is str or (kind is tuple and all_floats(value)) or callable(value):
        return value
    array = real_array(value)
    return value if array is None else _as_tuples(array.tolist(), array.ndim)


def _as_tuples(value: Any, depth: int) -> Any:
    if depth < 3:
        return tuple(map(tuple, value)) if depth == 2 else tuple(value) if depth else value
    return tuple([_as_tuples(v, depth - 1) for v in value])


def filled_second(axis: Any) -> tuple[float, ...] | None:
    """What fills ``second`` where it is left out, of an axis as ``plain`` gives it; None where that is no direction."""
    try:
        return _filled(axis)
    except TypeError:  # what has no hash is no tuple of numbers
        return None


@lru_cache
def _filled(axis: Any) -> tuple[float, ...] | None:
    return second_direction(axis) if is_numeric(axis, (3,)) else None


def second_direction(axis: Any) -> tuple[float, ...]:
    """The global axis least aligned with ``axis``, made perpendicular to it: what fills ``second`` where it is left out."""
    length = math.hypot(*axis)
    if not length > 0:
        return (1.0, 0.0, 0.0)
    z = [c / length for c in axis]
    sizes = [abs(c) for c in z]
    least = sizes.index(min(sizes))
    along = z[least]
    x = [0.0 - along * c for c in z]
    x[least] = 1.0 - along * along
    size = math.hypot(*x)
    return x[0] / size, x[1] / size, x[2] / size


def vector_fault(value: Any, what: str, *, direction: bool = False) -> str | None:
    """The fault of a vector of three numbers, or None; a direction must not be zero."""
    if not is_numeric(value, (3,)):
        return wrong(value, what, "three finite numbers")
    if direction and not math.hypot(*value) > 1e-12:
        return f"{what} = {value!r}: has length 0; give a direction, e.g. (0, 0, 1)"
    return None


def cosine(one: Sequence[float], other: Sequence[float]) -> float:
    """Of the angle between two directions."""
    along = sum(a * b for a, b in zip(one, other, strict=True))
    return along / (math.hypot(*one) * math.hypot(*other))


def parallel_faults(axis: Sequence[float], second: Sequence[float], where: str) -> list[str]:
    """A second direction that has no part at right angles to its axis, one line or none."""
    if abs(cosine(axis, second)) <= PARALLEL_COSINE:
        return []
    return [f"{where}second = {second!r}: parallel to the axis {axis!r}; give another direction"]


def number_fault(value: Any, what: str, *, minimum: float | None = None) -> str | None:
    """The fault of one number, or None."""
    if not is_numeric(value, ()):
        return wrong(value, what, "a finite number")
    if minimum is not None and float(value) < minimum:
        return f"{what} = {value!r}: expected a number not below {minimum:g}"
    return None


def sound_tol(tol: Any) -> float:
    """A tolerance of a whole mechanism as far as it is one, else 0."""
    return float(tol) if tol is not None and tolerance_fault(tol) is None else 0.0


def tolerance_fault(tol: Any) -> str | None:
    """The fault of a tolerance of a whole mechanism, or None."""
    good = is_numeric(tol, ()) and 0 < tol <= MOST_TOL
    return None if good else wrong(tol, "tol", f"radians and lengths / L, above 0 and at most {MOST_TOL:g}")


def same(a: Any, b: Any) -> bool:
    """Equality that also holds for arrays."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.shape(a) == np.shape(b) and bool(np.array_equal(np.asarray(a), np.asarray(b)))
    return bool(a == b)


def same_fields(a: Any, b: Any) -> bool:
    """Field by field equality of two dataclasses of one type, arrays included."""
    return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a) if f.compare)
