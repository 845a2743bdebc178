"""The kinds of values that the fields of a declaration hold, with their checks and what a rigid motion makes of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.model.field_format import Kind, Schema, on_each
from mechgraph.model.numeric import number_fault, plain, vector_fault
from mechgraph.quantities import is_numeric, real_array, wrong
from mechgraph.units import LENGTH, PURE


@dataclass(frozen=True)
class MovedFunction:
    """A callable value of a load, carried along by a rigid motion of the whole mechanism."""

    function: Callable[..., Any]
    pose: tuple[tuple[float, ...], ...]

    def __call__(self, pose: Array, twist: Array, t: Any) -> Array:
        """The value, asked for in the coordinates before the motion and turned into those after it."""
        G = np.asarray(self.pose)
        R, back = G[:3, :3], np.linalg.inv(G)
        w, v = twist[..., :3], twist[..., 3:]
        p = back[:3, 3]
        local = np.concatenate([w @ R, v @ R + np.cross(p, w @ R)], axis=-1)
        return np.asarray(self.function(back @ pose @ G, local, t)) @ R.T


def _moved_point(value: Any, pose: Array) -> Any:
    if isinstance(value, str):
        return value
    return on_each(lambda p: plain(pose[:, :3] @ np.asarray(p) + pose[:, 3]), value)


def _turned(value: Any, pose: Array) -> Any:
    if callable(value):
        return MovedFunction(value, plain(np.vstack([pose, (0.0, 0.0, 0.0, 1.0)])))
    return plain(np.asarray(value) @ pose[:, :3].T)


def _turned_tensor(value: Any, pose: Array) -> Any:
    A = pose[:, :3] @ np.asarray(value) @ pose[:, :3].T
    return plain((A + A.T) / 2)


def _series_fault(width: int) -> Callable[[Any, str, float | None], str | None]:
    """The check of a number or vector that may be an array over positions or a callable."""
    wanted = "a finite number" if width == 1 else f"{width} finite numbers"

    def fault(value: Any, what: str, minimum: float | None) -> str | None:
        if callable(value):
            return None
        array = real_array(value)
        if array is not None and np.isfinite(array).all() and (width == 1 or array.shape[-1:] == (width,)):
            return None
        return wrong(value, what, f"{wanted}, an array of them over positions, or a callable (pose, twist, t)")

    return fault


def _samples_fault(value: Any, what: str, minimum: float | None) -> str | None:
    array = real_array(value)
    good = array is not None and is_numeric(array, array.shape)
    return None if good else wrong(value, what, "finite numbers")


def _rising_fault(value: Any, what: str, minimum: float | None) -> str | None:
    array = real_array(value)
    rises = (
        array is not None
        and array.ndim <= 1
        and is_numeric(array, array.shape)
        and (np.diff(np.ravel(array)) > 0).all()
    )
    return None if rises else wrong(value, what, "finite numbers that rise")


def _tensor_fault(value: Any, what: str, minimum: float | None) -> str | None:
    return None if is_numeric(value, (3, 3)) else wrong(value, what, "a 3 x 3 tensor of finite numbers")


def _positive_fault(
    shape: tuple[int, ...], words: str, whole: bool = False
) -> Callable[[Any, str, float | None], str | None]:
    def fault(value: Any, what: str, minimum: float | None) -> str | None:
        good = is_numeric(value, shape) and np.min(value) > 0 and not (whole and np.any(np.mod(value, 1)))
        return None if good else wrong(value, what, f"{words} above 0")

    return fault


def _whole_fault(value: Any, what: str, minimum: float | None) -> str | None:
    good = isinstance(value, int | np.integer) and not isinstance(value, bool) and value >= 0
    return None if good else wrong(value, what, "a whole number, 0 or more")


def _two_fault(value: Any, what: str, minimum: float | None) -> str | None:
    return None if is_numeric(value, (2,)) else wrong(value, what, "two finite numbers")


def _vector_fault(value: Any, what: str, minimum: float | None) -> str | None:
    return vector_fault(value, what)


def _named_point_fault(value: Any, what: str, minimum: float | None) -> str | None:
    if isinstance(value, str) or is_numeric(value, (3,)):
        return None
    return wrong(value, what, "three finite numbers, or the name of a point of the link")


def _points_fault(value: Any, what: str, minimum: float | None) -> str | None:
    if not isinstance(value, Mapping):
        return wrong(value, what, "a table name -> (x, y, z)")
    for name, point in value.items():
        if not isinstance(name, str) or not name:
            return wrong(name, f"{what}: name", "a text")
        fault = vector_fault(point, f"{what}: {name}")
        if fault:
            return fault
    return None


def _interval_fault(value: Any, what: str, minimum: float | None) -> str | None:
    return (
        None
        if is_numeric(value, (2,)) and value[0] < value[1]
        else wrong(value, what, "two finite numbers, the second above the first")
    )


def _point_list_fault(value: Any, what: str, minimum: float | None) -> str | None:
    array = real_array(value)
    good = array is not None and array.ndim == 2 and array.shape[1] == 3 and is_numeric(value, array.shape)
    return None if good else wrong(value, what, "points of three finite numbers each")


def _moved_points(value: Any, pose: Array) -> Any:
    return plain(np.asarray(value) @ pose[:, :3].T + pose[:, 3])


def _function_fault(value: Any, what: str, minimum: float | None) -> str | None:
    return None if callable(value) else wrong(value, what, "a function")


@dataclass(frozen=True)
class MovedShape:
    """A function that returns a position and its derivatives ``(3, n)``, carried along by a rigid motion of the whole mechanism."""

    function: Callable[..., Any]
    pose: tuple[tuple[float, ...], ...]

    def __call__(self, *parameters: Array) -> list[Array]:
        """Position and derivatives after the motion."""
        G = np.asarray(self.pose)
        parts = [G[:, :3] @ np.asarray(part) for part in self.function(*parameters)]
        parts[0] = parts[0] + G[:, 3:]
        return parts


_VECTOR: Schema = {"$ref": "#/$defs/vector"}
TEXT = Kind("text", {"type": "string"}, str)
LINK_NAME = Kind("text", {"type": "string"}, str)
FREEDOM_NAME = Kind("text", {"type": "string"}, str)
FLAG = Kind("true/false", {"type": "boolean"}, bool)
INTEGER = Kind("integer", {"type": "integer", "minimum": 0}, fault=_whole_fault)
NUMBER = Kind(
    "number", {"type": "number"}, None, (), True, lambda value, what, least: number_fault(value, what, minimum=least)
)
POINT = Kind("3 numbers", _VECTOR, None, (3,), True, _vector_fault, _moved_point)
NAMED_POINT = Kind(
    "3 numbers or a name",
    {"anyOf": [_VECTOR, {"type": "string", "minLength": 1}]},
    None,
    (3,),
    True,
    _named_point_fault,
    _moved_point,
)
POINTS = Kind(
    "table of 3 numbers",
    {"type": "object", "additionalProperties": _VECTOR},
    None,
    None,
    True,
    _points_fault,
    _moved_point,
)
VECTOR = Kind("3 numbers", _VECTOR, None, (3,), True, _vector_fault, _turned)
DIRECTION = Kind(
    "3 numbers", _VECTOR, None, (3,), True, lambda value, what, _: vector_fault(value, what, direction=True), _turned
)
TENSOR = Kind(
    "3 × 3",
    {"type": "array", "items": _VECTOR, "minItems": 3, "maxItems": 3},
    None,
    (3, 3),
    True,
    _tensor_fault,
    _turned_tensor,
)
SIX = Kind("6 numbers", {"$ref": "#/$defs/six"})
SERIES = Kind("number(s)", {"$ref": "#/$defs/series"}, None, (), True, _series_fault(1))
VECTOR_SERIES = Kind(
    "3 numbers (series)", {"$ref": "#/$defs/vector_series"}, None, (3,), True, _series_fault(3), _turned
)
SAMPLES = Kind("n numbers", {"$ref": "#/$defs/series"}, None, None, True, _samples_fault, entry=NUMBER)
_ABOVE_0: Schema = {"type": "number", "exclusiveMinimum": 0}
_AB, _ENDS = ("a", "b"), ("begin", "end")
_TWO: Schema = {"type": "array", "minItems": 2, "maxItems": 2}
POSITIVE = Kind("number > 0", _ABOVE_0, None, (), True, _positive_fault((), "a finite number"))
TWO = Kind("2 numbers", {**_TWO, "items": {"type": "number"}}, None, (2,), True, _two_fault, names=_AB)
TWO_POSITIVE = Kind(
    "2 numbers > 0",
    {**_TWO, "items": _ABOVE_0},
    None,
    (2,),
    True,
    _positive_fault((2,), "two finite numbers"),
    names=_AB,
)
TWO_WHOLE = Kind(
    "2 integers > 0",
    {**_TWO, "items": {"type": "integer", "exclusiveMinimum": 0}},
    None,
    (2,),
    True,
    _positive_fault((2,), "two whole numbers", whole=True),
    names=_AB,
)
INTERVAL = Kind("2 numbers", {**_TWO, "items": {"type": "number"}}, None, (2,), True, _interval_fault, names=_ENDS)
POINT_LIST = Kind(
    "n × 3", {"type": "array", "items": _VECTOR}, None, None, True, _point_list_fault, _moved_points, entry=POINT
)
FUNCTION = Kind("function", {"not": {}}, None, None, False, _function_fault, lambda f, pose: MovedShape(f, plain(pose)))
BREAKS = Kind("rising numbers", {"not": {}}, None, None, True, _rising_fault)
"""Where a function is not smooth; files hold no functions."""
NUMBERS = Kind("n numbers", {"type": "array", "items": {"type": "number"}})
FACTS = Kind("table", {"type": "object"}, dict)
COEFFICIENTS = Kind("table", {"type": "object", "additionalProperties": {"type": "number"}, "minProperties": 1}, dict)
BY_FREEDOM = Kind("table", {"type": "object", "additionalProperties": {"type": "number"}})
"""Numbers by freedoms; in a file in degrees under the name of the freedom with ``_deg`` added."""
TABLE = Kind("table", {})
TABLES = Kind("tables", {})
OTHER = Kind("", {})
"""A kind whose schema the field itself gives, in ``rules``."""

POSITION = {"dimension": LENGTH, "turn": PURE, "degrees": True}
"""Of a field that holds a coordinate: an angle or a length, as the freedom is."""
RATE = {"dimension": (1, 0, -1), "turn": (0, 0, -1), "degrees": True}
"""Of a field that holds its rate."""
