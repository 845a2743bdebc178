"""What the fields of a declaration hold, stated once, in the annotations of the dataclasses.

    mass: Annotated[float, NUMBER("mass", MASS, minimum=0.0)] = 0.0

Reading and checking a value, the TOML file, its JSON Schema, the tables of the library's README, the conversion of units, rigid motions
of the whole mechanism and the names of numbers in studies all follow from it. Numbers are kept as floats and tuples of floats.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, Field, field, fields
from functools import lru_cache, partial
from operator import methodcaller
from types import MappingProxyType
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from mechgraph.errors import DeclarationError, ShapeError
from mechgraph.maths.se3 import Array
from mechgraph.memo import class_cached, dataclass
from mechgraph.quantities import (
    LENGTH,
    PURE,
    Dimension,
    all_floats,
    factor_of,
    has_quantity,
    is_numeric,
    real_array,
    shown,
    symbol_of,
    without_units,
    wrong,
)


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


def axes_of(axis: Any, second: Any) -> Array:
    """Right-handed axes ``(3, 3)``, one a column: z along ``axis``, x along ``second`` less its part along z."""
    z = np.asarray(axis) / np.linalg.norm(axis)
    x = np.asarray(second) - (z @ np.asarray(second)) * z
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def vector_fault(value: Any, what: str) -> str | None:
    """The fault of a vector of three numbers, or None."""
    return None if is_numeric(value, (3,)) else wrong(value, what, THREE)


def _direction_fault(value: Any, what: str, minimum: float | None) -> str | None:
    if is_numeric(value, (3,)) and not math.hypot(*value) > 1e-12:
        return f"{what} = {value!r}: has length 0; give a direction, e.g. (0, 0, 1)"
    return vector_fault(value, what)


def cosine(one: Sequence[float], other: Sequence[float]) -> float:
    """Of the angle between two directions."""
    along = sum(a * b for a, b in zip(one, other, strict=True))
    return along / (math.hypot(*one) * math.hypot(*other))


def number_fault(value: Any, what: str, minimum: float | None = None) -> str | None:
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
    good = is_numeric(tol, ()) and 0 < tol <= 0.1  # beyond, a change is no rounding
    return None if good else wrong(tol, "tol", "radians and lengths / L, above 0 and at most 0.1")


def same(a: Any, b: Any) -> bool:
    """Equality that also holds for arrays."""
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.shape(a) == np.shape(b) and bool(np.array_equal(np.asarray(a), np.asarray(b)))
    return bool(a == b)


def same_fields(a: Any, b: Any) -> bool:
    """Field by field equality of two dataclasses of one type, arrays included."""
    return type(a) is type(b) and all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a) if f.compare)


XYZ = "xyz"
THREE = "three finite numbers (two where planar=True)"
Schema = Mapping[str, Any]
STANDS_AS = {str: "a text", bool: "true or false", dict: "a table"}
"""How the types of values are called in messages."""
NEEDED = object()
"""What stands for the default of a field that must not be left out."""


@dataclass(frozen=True, eq=False)
class FieldKind:
    """A kind of value.

    ``words`` name it in tables, ``schema`` is its JSON Schema, ``stands_as`` the type of a value in a file where a reader can tell
    (None: the constructor tells); ``shape`` that of a number, vector or tensor (None for all else); ``wanted`` says what a value must be
    (empty: anything) and ``fits(value, shape)`` whether it is that, by default finite numbers of the shape; ``fault(value, what, minimum)``
    stands for both where a value can be wrong in several ways; ``moved(value, pose)`` is the value after a rigid motion ``(3, 4)`` of the
    whole mechanism; ``names`` are those of the components where they are not x, y, z; ``entry`` is the kind of one entry of a list.
    """

    words: str
    schema: Schema
    stands_as: type | None = None
    shape: tuple[int, ...] | None = None
    numeric: bool = False
    wanted: str = ""
    fits: Callable[[Any, Any], bool] = is_numeric
    fault: Callable[[Any, str, float | None], str | None] | None = None
    moved: Callable[[Any, Array], Any] | None = None
    names: tuple[str, ...] = ()
    entry: FieldKind | None = None

    def __call__(
        self, meaning: str, dimension: Dimension = PURE, turn: Dimension | None = None, **more: Any
    ) -> FieldFormat:
        """A field of this kind; ``dimension`` is that for a slide where ``turn``, that for a turn, is given too."""
        return FieldFormat(self, meaning, dimension, dimension if turn is None else turn, **more)

    def components(self) -> Mapping[str, tuple[tuple[int, ...], ...]]:
        """Names of the components as studies spell them, and the places of each in the array; a number has one, named ``""``."""
        if self.shape == ():
            return {"": ((),)}
        if self.shape is not None and len(self.shape) == 1:
            return {name: ((i,),) for i, name in enumerate(self.names or XYZ)}
        if self.shape == (3, 3):
            places = {a + b: [(i, j), (j, i)] for i, a in enumerate(XYZ) for j, b in enumerate(XYZ)}
            return {name: tuple(dict.fromkeys(both)) for name, both in places.items()}
        return {}


@dataclass(frozen=True)
class FieldFormat:
    """One field: its kind, its meaning in a sentence, and its dimension (``slide`` and ``turn`` differ where a freedom decides).

    ``degrees``: may be given in degrees under its name with ``_deg`` added; ``minimum``: smallest number; ``below``: what the size of
    an angle stays below; ``choices``: the texts allowed; ``of``: of the name of a point, the field that names its link; ``across``: of a
    direction, the one across which it is where it is left out; ``normal``: of a
    vector, whether in a plane it stands on that (a moment); ``key``: its name in files where it is another; ``table``:
    the table of the file that it holds; ``single``: of the name of a freedom, whether it must not be part of a rotation; ``default``:
    in words, where the value does not say it; ``held_in``: the array of ``Declared`` that holds the number, and the factor, where the
    array has another name than the field; ``rules``: more of its schema.
    """

    kind: FieldKind
    meaning: str
    slide: Dimension = PURE
    turn: Dimension = PURE
    degrees: bool = False
    minimum: float | None = None
    below: float | None = None
    choices: tuple[str, ...] = ()
    of: str = ""
    across: str = ""
    normal: bool = False
    key: str = ""
    table: str = ""
    single: bool = True
    default: str = ""
    held_in: tuple[str, float] | None = None
    rules: Schema = field(default_factory=dict)

    @property
    def unit(self) -> str:
        """The unit in letters, ``M L²``, ``rad or L``."""
        if self.kind.stands_as is not None:
            return ""
        both = (symbol_of(self.turn) or "rad", symbol_of(self.slide) or "rad")
        if self.slide != self.turn:
            return " or ".join(both).replace("1/", "rad/")
        return both[0] if self.degrees or self.slide != PURE else ""

    def told(self, name: str, usual: Any) -> list[str]:
        """The field as a parameter in a docstring, with the default that stands in the class, ``NEEDED`` for none."""
        kind = f"{{{', '.join(map(repr, self.choices))}}}" if self.choices else self.kind.words or "value"
        plain = f"{usual:.6g}" if isinstance(usual, float) else repr(usual)
        default = self.default or ("" if usual is NEEDED or usual is None else plain)
        meaning = f"{self.meaning[:1].upper()}{self.meaning[1:]}{self.unit and f' [{self.unit}]'}."
        fallback = default and f" Default: {default.rstrip('.')}."
        return [f"    {name} : {kind}", f"        {meaning}{fallback}"]

    def fault(self, value: Any, what: str) -> str | None:
        """What is wrong with a value, or None."""
        if self.choices and not (isinstance(value, str) and value in self.choices):
            return wrong(value, what, " or ".join(map(repr, self.choices)))
        stands_as = self.kind.stands_as
        if stands_as in STANDS_AS and not isinstance(value, stands_as):
            return wrong(value, what, STANDS_AS[stands_as])
        if self.below is not None and is_numeric(value, ()) and abs(value) >= self.below:
            return wrong(
                value,
                what,
                f"an angle below {self.below:.4g} rad ({value:g} degrees are {math.radians(value):.7g} rad)",
            )
        if self.kind.fault is not None:
            return self.kind.fault(value, what, self.minimum)
        fits = not self.kind.wanted or self.kind.fits(value, self.kind.shape)
        return None if fits else wrong(value, what, self.kind.wanted)


class _Signature:
    """The signature of a class with fields as ``help`` shows it: what they hold stands in the docstring."""

    def __get__(self, instance: object, cls: type) -> inspect.Signature:
        every = list(inspect.signature(cls.__init__).parameters.values())[1:]  # type: ignore[misc]
        return inspect.Signature([one.replace(annotation=inspect.Parameter.empty) for one in every])


class Formatted:
    """A dataclass whose annotations say what its fields hold (``FieldFormat``)."""

    __signature__ = _Signature()
    formats: ClassVar[Mapping[str, FieldFormat]] = {}
    """What the fields hold, by their names."""
    _own: ClassVar[Mapping[str, FieldFormat]] = {}
    _numeric: ClassVar[tuple[str, ...]] = ()
    _lists: ClassVar[tuple[str, ...]] = ()
    _across: ClassVar[tuple[tuple[str, str], ...]] = ()
    _defaults: ClassVar[tuple[Any, ...]] = ()

    def __init_subclass__(cls) -> None:
        if cls.__repr__ is Formatted.__repr__:
            cls.__repr__ = Formatted.__repr__  # type: ignore[method-assign]  # dataclass leaves alone what stands in the class itself
        for name, make in WORKED_OUT.items():
            setattr(cls, name, class_cached(make, name, cls))
        if words := cls.__doc__:
            cls.__doc__ = class_cached(partial(_described, words), "__doc__", cls)  # type: ignore[assignment]

    def __repr__(self) -> str:
        """The fields that differ from what they are where they are left out."""
        given = {name: getattr(self, name) for name in self.formats}
        told = [
            f"{name}={dict(value) if isinstance(value, Mapping) else repr(value) if isinstance(value, Formatted) else shown(value)}"
            for name, value in given.items()
            if not is_default(type(self), name, value)
        ]
        return f"{type(self).__name__}({', '.join(told)})"


def _own(cls: type[Formatted]) -> Mapping[str, FieldFormat]:
    hints = inspect.get_annotations(cls, eval_str=True)
    own = {name: getattr(hint, "__metadata__", (None,))[0] for name, hint in hints.items()}
    return {name: about for name, about in own.items() if isinstance(about, FieldFormat)}


def _formats(cls: type[Formatted]) -> Mapping[str, FieldFormat]:
    bases = [base for base in reversed(cls.__mro__) if issubclass(base, Formatted)]
    return {name: about for base in bases for name, about in base._own.items()}


def _numeric(cls: type[Formatted]) -> tuple[str, ...]:
    return tuple(name for name, about in cls.formats.items() if about.kind.numeric)


def _lists(cls: type[Formatted]) -> tuple[str, ...]:
    return tuple(name for name, about in cls.formats.items() if about.kind in (NAMES, TABLES))


def _across(cls: type[Formatted]) -> tuple[tuple[str, str], ...]:
    return tuple((name, about.across) for name, about in cls.formats.items() if about.across)


def _defaults(cls: type[Formatted]) -> tuple[Any, ...]:
    given = (getattr(cls, name, NEEDED) for name in cls.formats)
    return tuple(
        (NEEDED if one.default is MISSING else one.default) if isinstance(one, Field) else one for one in given
    )


WORKED_OUT: dict[str, Callable[[type[Formatted]], Any]] = {
    "_own": _own, "formats": _formats, "_numeric": _numeric, "_lists": _lists, "_across": _across, "_defaults": _defaults,
}  # fmt: skip
"""What a class with fields knows of them, worked out where it is first asked for."""


def _described(text: str, cls: type[Formatted]) -> str:
    """The docstring of a class with its fields as parameters."""
    if not cls.formats or "Parameters\n" in text:
        return text
    usual = zip(cls.formats.items(), cls._defaults, strict=True)
    told = [line for (name, about), default in usual for line in about.told(name, default)]
    words, heading, examples = text.rstrip().partition("\n\n    Examples\n")
    return "\n".join([words, "", "    Parameters", "    ----------", *told]) + heading + examples + "\n    "


def is_default(cls: type, name: str, value: Any) -> bool:
    """Whether a value says nothing: that of a field that was left out, or an empty table."""
    default = getattr(cls, name, NEEDED)
    return (
        value is default
        or (isinstance(value, bool | float | str | tuple) and value == default)
        or (isinstance(value, Mapping) and not value)
    )


class Described(Formatted):
    """A declared thing whose numbers are read, checked, moved and converted by what its fields hold."""

    def __post_init__(self) -> None:
        self.read_numbers()
        self.fill_directions()

    def __eq__(self, other: object) -> bool:
        return same_fields(self, other)

    def __hash__(self) -> int:
        return hash(type(self).__name__)

    def read_numbers(self) -> None:
        """Turn what the numeric fields hold into floats and tuples of floats, and lists into tuples; where the fields are set."""
        for name in self._numeric:
            value = getattr(self, name)
            if value is not None and type(value) is not float:
                object.__setattr__(self, name, on_each(plain, value))
        for name in self._lists:
            if isinstance(value := getattr(self, name), list):
                object.__setattr__(self, name, tuple(value))

    def fill_directions(self) -> None:
        """Set the directions across others that are left out."""
        for name, axis in self._across:
            if getattr(self, name) is None:
                object.__setattr__(self, name, filled_second(getattr(self, axis)))

    def value_faults(self, where: str) -> list[str]:
        """What is wrong with the values alone; None is no fault where the field may be left out."""
        faults = []
        for (name, about), default in zip(self.formats.items(), self._defaults, strict=True):
            value = getattr(self, name)
            if value is not None or default is not None:
                faults.append(about.fault(value, where + name))
        return [fault for fault in faults if fault]

    def replace(self, **changes: Any) -> Self:
        """A copy with fields changed."""
        return type(self)(**{**{name: getattr(self, name) for name in self.formats}, **changes})

    def changed(self, change: Callable[[str, FieldFormat, Any], Any], inner: Callable[[Any], Any]) -> Self:
        """With ``change(name, about, value)`` in place of every value, ``inner(value)`` of what is described itself.

        Where all values stay, it is the same object.
        """
        changes = {}
        for name, about in self.formats.items():
            value = getattr(self, name)
            made = inner(value) if isinstance(value, Described) else change(name, about, value)
            if made is not value:
                changes[name] = made
        return self.replace(**changes) if changes else self

    def moved(self, pose: Array) -> Self:
        """The same after a rigid motion ``(3, 4)`` of the whole mechanism; itself where nothing in it has a place or direction."""

        def change(name: str, about: FieldFormat, value: Any) -> Any:
            return value if value is None or about.kind.moved is None else about.kind.moved(value, pose)

        return self.changed(change, methodcaller("moved", pose))

    def without_quantities(self, units: Mapping[str, str], turns: bool = False) -> Self:
        """The same with quantities of pint as plain numbers in these units; those that do not fit stay, and are faults.

        ``turns``: whether the freedom that it names is a turn.
        """

        def change(name: str, about: FieldFormat, value: Any) -> Any:
            known = not about.kind.numeric or not has_quantity(value)
            return value if known else without_units(value, about.turn if turns else about.slide, units)

        return self.changed(change, methodcaller("without_quantities", units, turns))

    def in_units(self, base: tuple[float, float, float], turns: bool = False) -> Self:
        """The same with every number times ``prod_i base_i^dimension_i``; ``turns``: whether the freedom that it names is a turn.

        ``base (3,)`` are the factors of lengths, masses and times. A callable is refused (DeclarationError).
        """

        def change(name: str, about: FieldFormat, value: Any) -> Any:
            if callable(value):
                what = f"{name} of a {type(self).__name__}"
                raise DeclarationError("to_units", [f"{what} is a callable; convert it yourself, or sample it first"])
            if value is None or isinstance(value, str) or not about.kind.numeric:
                return value
            factor = factor_of(about.turn if turns else about.slide, base)
            return value if factor == 1.0 else on_each(partial(_times, factor), value)

        return self.changed(change, methodcaller("in_units", base, turns))

    @property
    def freedoms(self) -> tuple[str, ...]:
        """Names of the freedoms that it names."""
        named = (getattr(self, name) for name, about in self.formats.items() if about.kind is FREEDOM_NAME)
        return tuple(name for name in named if isinstance(name, str))

    def with_full_names(self, full_name: Callable[[str], str]) -> Self:
        """The same with these spelled in full."""

        def change(name: str, about: FieldFormat, value: Any) -> Any:
            return full_name(value) if about.kind is FREEDOM_NAME and isinstance(value, str) and value else value

        return self.changed(change, as_it_is)

    def numbers_turn(self, turns: Callable[[Any], bool]) -> bool:
        """Whether its numbers are those of a turn; ``turns(freedom)`` says so of a freedom."""
        return turns(getattr(self, "freedom", None))

    def in_own_units(self, units: Mapping[str, str], turns: Callable[[Any], bool]) -> Self:
        """``without_quantities`` in a mechanism with these units."""
        return self.without_quantities(units, self.numbers_turn(turns))

    def converted(self, base: tuple[float, float, float], turns: Callable[[Any], bool]) -> Self:
        """``in_units`` in a mechanism of which the units change."""
        return self.in_units(base, self.numbers_turn(turns))


def as_it_is(value: Any) -> Any:
    """What stays."""
    return value


def remade(item: Any) -> tuple[Any, tuple[Any, ...]]:
    """By its fields alone, as ``__reduce__``: what is worked out stays behind, and tables that are read-only do not pickle."""
    given = {f.name: getattr(item, f.name) for f in fields(item)}
    make: Any = type(item)
    return partial(make, **{name: dict(v) if isinstance(v, Mapping) else v for name, v in given.items()}), ()


def on_each(change: Callable[[Any], Any], value: Any) -> Any:
    """A changed value; of a table of values each, read-only."""
    if type(value) not in (tuple, np.ndarray) and isinstance(value, Mapping):  # asked last, as it takes long
        return MappingProxyType({name: change(item) for name, item in value.items()})
    return change(value)


def _times(factor: float, value: Any) -> Any:
    return plain(np.asarray(value) * factor)


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


def _is_series(value: Any, shape: tuple[int, ...]) -> bool:
    array = real_array(value)
    if array is None:
        return callable(value)
    return array.shape[array.ndim - len(shape) :] == shape and bool(np.isfinite(array).all())


def _are_finite(value: Any, shape: Any) -> bool:
    array = real_array(value)
    return array is not None and is_numeric(array, array.shape)


def _rise(value: Any, shape: Any) -> bool:
    return _are_finite(value, shape) and np.ndim(value) <= 1 and bool((np.diff(np.ravel(value)) > 0).all())


def _are_positive(value: Any, shape: tuple[int, ...]) -> bool:
    return is_numeric(value, shape) and bool(np.min(value) > 0)


def _are_whole(value: Any, shape: tuple[int, ...]) -> bool:
    return _are_positive(value, shape) and not bool(np.any(np.mod(value, 1)))


def _is_count(value: Any, shape: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool) and bool(value >= 0)


def _is_named_point(value: Any, shape: tuple[int, ...]) -> bool:
    return isinstance(value, str) or is_numeric(value, shape)


def _are_names(value: Any, shape: Any) -> bool:
    return isinstance(value, list | tuple) and all(isinstance(name, str) and name for name in value)


def _is_interval(value: Any, shape: tuple[int, ...]) -> bool:
    return is_numeric(value, shape) and value[0] < value[1]


def are_rows(width: int, value: Any, shape: Any) -> bool:
    """Whether a value is rows of so many finite numbers each."""
    array = real_array(value)
    return array is not None and array.ndim == 2 and is_numeric(array, (len(array), width))


def _is_function(value: Any, shape: Any) -> bool:
    return callable(value)


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


def _moved_function(function: Any, pose: Array) -> MovedShape:
    return MovedShape(function, plain(pose))


def _moved_points(value: Any, pose: Array) -> Any:
    return plain(np.asarray(value) @ pose[:, :3].T + pose[:, 3])


BESIDE = 0.5 * (3.0 - np.sqrt(5.0))
"""Where in an interval slopes are taken, a part of it that is no ratio of whole numbers, as places where a shape changes are."""


def asked(function: Callable[..., Any], at: Sequence[Array], least: int, most: int) -> Array:
    """Position and derivatives ``(most, 3, n)`` at parameters ``(n,)`` each; zeros for those that may be left out, beyond ``least``.

    Raises
    ------
    ShapeError
        where the function raises (its cause), or returns anything but ``least`` or more finite arrays ``(3, n)``.
    """
    if not at[0].size:  # as where all positions are interpolated beside a change point; what reduces nothing raises
        return np.zeros((most, 3, 0))
    found = _asked(function, at, least, most)
    if isinstance(found, np.ndarray):
        return found
    first = next((i for i in range(at[0].size) if not _fits(function, [u[i : i + 1] for u in at], least, most)), None)
    where = "; each of the values alone does" if first is None else f" at {_named([u[first] for u in at])}"
    text, cause = found
    raise ShapeError(f"position: {text}{where}") from cause


def _asked(
    function: Callable[..., Any], at: Sequence[Array], least: int, most: int
) -> Array | tuple[str, Exception | None]:
    """The arrays, or what is wrong with them and what was raised."""
    shape = (3, at[0].size)
    try:
        given = list(function(*at))[:most]
        parts = [np.asarray(part, dtype=float) for part in given]
    except Exception as error:
        return f"raised {type(error).__name__}: {error}", error
    wrong = next((part.shape for part in parts if part.shape not in (shape, (3, 1))), None)
    if wrong is not None or len(parts) < least:
        got = f"{len(parts)} arrays" if wrong is None else f"an array {wrong}"
        return f"returned {got}, expected {least} arrays (3, n), here {shape}", None
    out = np.zeros((most, *shape))
    for own, part in zip(out, parts, strict=False):
        own[:] = part
    return out if np.isfinite(out).all() else ("returned a number that is not finite", None)


def _fits(function: Callable[..., Any], at: Sequence[Array], least: int, most: int) -> bool:
    return isinstance(_asked(function, at, least, most), np.ndarray)


def _named(values: Sequence[float]) -> str:
    return ", ".join(f"{name} = {value:.6g}" for name, value in zip("uv", values, strict=False))


def between(grid: Array) -> Array:
    """Parameters ``(n,)`` in the intervals of a grid ``(n + 1,)`` at which slopes are taken."""
    return np.asarray(grid[:-1] + BESIDE * np.diff(grid))


def slope_faults(
    ask: Callable[..., Array],
    at: Sequence[Array],
    steps: Sequence[tuple[int, int, int]],
    words: Sequence[str],
    where: str,
    room: Array | float = np.inf,
) -> list[str]:
    """Derivatives that are not the slopes of what they belong to.

    ``at``: parameters ``(n,)`` each, as from ``between``; of ``steps`` each is a derivative, what it is derived from, and the parameter by
    which: numbers of what ``ask`` returns ``(orders, 3, n)``, called as in ``words``. Slopes are taken over shorter and shorter steps,
    none longer than the ``room``: that over one of them fits a true derivative, however fast it changes.
    """
    found, known = [], ask(*at)
    for high, low, by in steps:
        extent = float(np.ptp(at[by]))
        most = 1e-3 * np.abs(known[[low, high]]).max() / min(1.0, extent)
        miss = np.full(at[by].shape, np.inf)
        for part in (1e-4, 1e-5, 1e-6):
            h = np.minimum(part * extent, room)
            ahead, back = (ask(*(u + sign * h * (i == by) for i, u in enumerate(at)))[low] for sign in (1.0, -1.0))
            miss = np.minimum(miss, np.abs((ahead - back) / (2 * h) - known[high]).max(axis=0))
            if miss.max() <= most:
                break
        else:
            worst = int(np.argmax(miss))
            at_worst = _named([u[worst] for u in at])
            found.append(
                f"{where}position: {words[high]} differs from the slope of {words[low]} by {miss[worst]:.3g} at {at_worst}"
            )
    return found


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
TEXT = FieldKind("text", {"type": "string"}, str)
LINK_NAME = FieldKind("text", {"type": "string"}, str)
FREEDOM_NAME = FieldKind("text", {"type": "string"}, str)
FLAG = FieldKind("true/false", {"type": "boolean"}, bool)
INTEGER = FieldKind("integer", {"type": "integer", "minimum": 0}, wanted="a whole number, 0 or more", fits=_is_count)
NUMBER = FieldKind("number", {"type": "number"}, None, (), True, fault=number_fault)
POINT = FieldKind("3 numbers", _VECTOR, None, (3,), True, THREE, moved=_moved_point)
_NAMED: Schema = {"anyOf": [_VECTOR, {"type": "string", "minLength": 1}]}
_OR_NAME = f"{THREE}, or the name of a point of the link"
NAMED_POINT = FieldKind("3 numbers or a name", _NAMED, None, (3,), True, _OR_NAME, _is_named_point, moved=_moved_point)
_NAMED_VECTORS: Schema = {"type": "object", "additionalProperties": _VECTOR}
POINTS = FieldKind("table of 3 numbers", _NAMED_VECTORS, numeric=True, fault=_points_fault, moved=_moved_point)
VECTOR = FieldKind("3 numbers", _VECTOR, None, (3,), True, THREE, moved=_turned)
DIRECTION = FieldKind("3 numbers", _VECTOR, None, (3,), True, fault=_direction_fault, moved=_turned)
_TENSOR: Schema = {"anyOf": [{"type": "array", "items": _VECTOR, "minItems": 3, "maxItems": 3}, {"type": "number"}]}
TENSOR = FieldKind("3 × 3", _TENSOR, None, (3, 3), True, "a 3 x 3 tensor of finite numbers", moved=_turned_tensor)
SIX = FieldKind("6 numbers", {"$ref": "#/$defs/six"})
_SERIES, _VECTORS = {"$ref": "#/$defs/series"}, {"$ref": "#/$defs/vector_series"}
_OR_SERIES = "an array of them over positions, or a callable (pose, twist, t)"
_THREE_OR_SERIES = f"3 finite numbers (one less where planar=True), {_OR_SERIES}"
SERIES = FieldKind("number(s)", _SERIES, None, (), True, f"a finite number, {_OR_SERIES}", _is_series)
VECTOR_SERIES = FieldKind("3 numbers (series)", _VECTORS, None, (3,), True, _THREE_OR_SERIES, _is_series, moved=_turned)
SAMPLES = FieldKind("n numbers", _SERIES, numeric=True, wanted="finite numbers", fits=_are_finite, entry=NUMBER)
_ABOVE_0: Schema = {"type": "number", "exclusiveMinimum": 0}
_AB, _ENDS = ("a", "b"), ("begin", "end")
_TWO: Schema = {"type": "array", "minItems": 2, "maxItems": 2}
_TWO_NUMBERS: Schema = {**_TWO, "items": {"type": "number"}}
_TWO_WHOLE: Schema = {**_TWO, "items": {"type": "integer", "exclusiveMinimum": 0}}
_TWO_RISING = "two finite numbers, the second above the first"
POSITIVE = FieldKind("number > 0", _ABOVE_0, None, (), True, "a finite number above 0", _are_positive)
TWO = FieldKind("2 numbers", _TWO_NUMBERS, None, (2,), True, "two finite numbers", names=_AB)
TWO_POSITIVE = FieldKind(
    "2 numbers > 0",
    {**_TWO, "items": _ABOVE_0},
    None,
    (2,),
    True,
    "two finite numbers above 0",
    _are_positive,
    names=_AB,
)
TWO_WHOLE = FieldKind(
    "2 integers > 0", _TWO_WHOLE, None, (2,), True, "two whole numbers above 0", _are_whole, names=_AB
)
INTERVAL = FieldKind("2 numbers", _TWO_NUMBERS, None, (2,), True, _TWO_RISING, _is_interval, names=_ENDS)
_LIST: Schema = {"type": "array", "items": _VECTOR}
_POINTS = "points of three finite numbers each"
POINT_LIST = FieldKind(
    "n × 3", _LIST, None, None, True, _POINTS, partial(are_rows, 3), moved=_moved_points, entry=POINT
)
FUNCTION = FieldKind("function", {"not": {}}, wanted="a function", fits=_is_function, moved=_moved_function)
BREAKS = FieldKind("rising numbers", {"not": {}}, numeric=True, wanted="finite numbers that rise", fits=_rise)
"""Where a function is not smooth; files hold no functions."""

_TEXTS: Schema = {"type": "array", "items": {"type": "string", "minLength": 1}}
NAMES = FieldKind("names", _TEXTS, wanted="a list of names", fits=_are_names)
NUMBERS = FieldKind("n numbers", {"type": "array", "items": {"type": "number"}})
FACTS = FieldKind("table", {"type": "object"}, dict)
COEFFICIENTS = FieldKind(
    "table", {"type": "object", "additionalProperties": {"type": "number"}, "minProperties": 1}, dict
)
BY_FREEDOM = FieldKind("table", {"type": "object", "additionalProperties": {"type": "number"}})
"""Numbers by freedoms; in a file in degrees under the name of the freedom with ``_deg`` added."""
TABLE = FieldKind("table", {})
TABLES = FieldKind("tables", {})
OTHER = FieldKind("", {})
"""A kind whose schema the field itself gives, in ``rules``."""


def across(meaning: str) -> FieldFormat:
    """A second direction beside ``axis``."""
    return DIRECTION(meaning, across="axis", default="global axis least aligned with `axis`")


POSITION = {"dimension": LENGTH, "turn": PURE, "degrees": True}
"""Of a field that holds a coordinate: an angle or a length, as the freedom is."""
RATE = {"dimension": (1, 0, -1), "turn": (0, 0, -1), "degrees": True}
"""Of a field that holds its rate."""
