"""Units, the one door for numbers, and the one check for arguments.

Dimensions and units: exponents of length, mass and time, their labels, and the factors between two sets of units.
A number of dimension ``(a, b, c)`` carries the unit ``length^a mass^b time^c``. Angles are radians and have no dimension.

Arguments at the public doors: one check and one sentence for each that is of the wrong kind.
What a public function or method takes stands once, in its annotations. ``door`` reads them, where it is first called, and refuses all
that does not fit in one DeclarationError, before anything is done.
"""

from __future__ import annotations

import collections.abc
import functools
import importlib
import inspect
import os
import reprlib
import sys
import types
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from math import isclose, pi, prod
from typing import Annotated, Any, Literal, NamedTuple, ParamSpec, TypeVar, Union, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mechgraph.errors import (
    DeclarationError,
    MechgraphError,
    MissingExtraError,
    did_you_mean,
    listed,
    near_names,
)
from mechgraph.memo import ASKED, Remembers, as_asked, carried

BASE_UNITS = ("length", "mass", "time")
"""The base units that a mechanism may declare."""

Dimension = tuple[int, int, int]
PURE, LENGTH, MASS, TIME = (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)
ACCELERATION, FORCE, MOMENT, ENERGY, POWER = (1, 0, -2), (1, 1, -2), (2, 1, -2), (2, 1, -2), (2, 1, -3)
INERTIA, PRESSURE, FORCE_PER_LENGTH = (2, 1, 0), (-1, 1, -2), (0, 1, -2)
FORCE_PER_VELOCITY, MOMENT_PER_RATE, PRESSURE_TIME = (0, 1, -1), (2, 1, -1), (-1, 1, -1)

KNOWN: dict[str, dict[str, float]] = {
    "length": {
        "m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "km": 1e3, "ft": 0.3048, "in": 0.0254,
        "yd": 0.9144,
    },
    "mass": {
        "kg": 1.0, "g": 1e-3, "mg": 1e-6, "t": 1e3, "tonne": 1e3, "Mg": 1e3, "lb": 0.45359237, "oz": 0.45359237 / 16,
        "slug": 0.45359237 * 9.80665 / 0.3048,
    },
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0, "h": 3600.0},
}  # fmt: skip
"""Units of a base in terms of m, kg, s."""
EARTH, EARTHLY = 9.80665, 0.005
"""Acceleration of gravity on earth in m/s^2, and by what part of it it varies and is rounded."""
FORCES = {"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "µN": 1e-6, "nN": 1e-9, "dyn": 1e-5, "lbf": 0.45359237 * 9.80665}
"""Units of force in N."""
USUAL = ("N", "kN", "MN", "lbf")
"""Those in which people think."""


def force_unit(units: Mapping[str, str]) -> str:
    """The name of the force ``mass length / time^2`` of a set of units; empty where it has none."""
    if not all(units.get(base) in known for base, known in KNOWN.items()):
        return ""
    length, mass, time = (KNOWN[base][units[base]] for base in BASE_UNITS)
    return next((name for name, size in FORCES.items() if isclose(size, mass * length / time**2, rel_tol=1e-9)), "")


def force_hint(units: Mapping[str, str]) -> str:
    """What to say where the unit of force that belongs to a set of units is not a usual one; empty where it is, or is not known."""
    name = force_unit(units)
    if not name or name in USUAL:
        return ""
    set_, others = ", ".join(units[base] for base in BASE_UNITS), ("t", "kg", "g")
    better = next((mass for mass in others if force_unit({**units, "mass": mass}) == "N"), "")
    advice = (
        f"mass in {better} would make it N, m.to_units(mass={better!r})"
        if better
        else "m.to_units(length='m', mass='kg') makes it N"
    )
    return f"Units: {set_} belong to the force {name} ({FORCES[name]:g} N), in which loads are read and results given; {advice}."


def unit_hints(units: Mapping[str, str]) -> list[str]:
    """What to say of units that are none of the known ones: they are labels alone."""
    return [
        f"units: {base}: {unknown('unit', units[base], known)}; it labels results, and forces get no name of their own"
        for base, known in KNOWN.items()
        if units.get(base, next(iter(known))) not in known
    ]


def gravity_hint(units: Mapping[str, str], size: float) -> str:
    """What to say of an acceleration of gravity that is the earth's in other units than those declared; empty where there is nothing."""
    length, time = KNOWN["length"].get(units.get("length", "")), KNOWN["time"].get(units.get("time", ""))
    if length is None or time is None or isclose(size * length / time**2, EARTH, rel_tol=EARTHLY):
        return ""
    meant = next((name for name, known in KNOWN["length"].items() if isclose(size * known, EARTH, rel_tol=EARTHLY)), "")
    unit, right = f"{units['length']}/{units['time']}^2", EARTH * time**2 / length
    return (
        f"gravity of {size:.6g} {unit}: on earth it is {size:.6g} {meant}/s^2, which is {right:.6g} {unit}"
        if meant
        else ""
    )


def angle_hint(value: float) -> str:
    """What to say of an angle that is more likely meant in degrees; empty where there is nothing."""
    turns = value / (2 * pi)
    return f"read as radians, {turns:.4g} turns" if abs(turns) > 2 else ""


def _shortest(dimension: Sequence[float], force: bool = True) -> dict[str, float]:
    """Powers by the letters L, M, T and F = M L/T^2, whichever way is shorter."""
    a, b, c = dimension
    ways = [{"M": b, "L": a, "T": c}, {"F": b, "L": a - b, "T": c + 2 * b}]
    return min(ways[: 1 + force], key=lambda way: sum(map(abs, way.values())))


def unit_of(units: Mapping[str, str], dimension: Sequence[float]) -> str:
    """The unit of ``length^a mass^b time^c`` in the declared units, ``N mm``, ``m/s^2``; empty where units are not declared or not needed.

    A pure number of three exponents is an angle, in radians, and so is what is left of a rate.
    """
    if (
        not units
        or len(dimension) != 3
        or any(p and base not in units for base, p in zip(BASE_UNITS, dimension, strict=True))
    ):
        return ""
    force = force_unit(units)
    if tuple(dimension) == POWER and (force, units["length"], units["time"]) == ("N", "m", "s"):
        return "W"
    names = {"F": force, "L": units.get("length", ""), "M": units.get("mass", ""), "T": units.get("time", "")}
    powers = {names[letter]: n for letter, n in _shortest(dimension, bool(force)).items() if n}
    angle = "rad" if not any(dimension[:2]) and dimension[2] <= 0 else ""
    return _quotient(powers, lambda n: f"^{n:g}", angle)


def symbol_of(dimension: Dimension) -> str:
    """A dimension in letters: ``F L``, ``M L²``, ``L/T²``; empty for a pure number."""
    return _quotient(_shortest(dimension), lambda n: {2: "²", 3: "³"}.get(int(n), f"^{n:g}"))


def _quotient(powers: Mapping[str, float], power: Callable[[float], str], angle: str = "") -> str:
    """``F L/T²``: what has a positive power over what has a negative one."""
    above, below = (
        " ".join(name + (power(abs(n)) if abs(n) != 1 else "") for name, n in powers.items() if n * sign > 0)
        for sign in (1, -1)
    )
    above = above or angle
    return f"{above or '1'}/{below}" if below else above


def base_factors(old: Mapping[str, str], new: Mapping[str, str]) -> tuple[float, float, float]:
    """Numbers by which lengths, masses and times are multiplied from ``old`` to ``new`` units (``units`` extra: pint).

    Raises
    ------
    DeclarationError
        for a unit that is not declared, unknown or of another dimension; MissingExtraError without pint.
    """
    try:
        registry = importlib.import_module("pint").get_application_registry()  # made once, in half a second
    except ImportError:
        raise MissingExtraError("pint", "units") from None
    faults, out = [], []
    for name in BASE_UNITS:
        if name not in new or new[name] == old.get(name):
            out.append(1.0)
        elif name not in old:
            faults.append(f"{name}: the mechanism declares no unit of {name}; give units={{{name!r}: ...}} first")
        else:
            try:
                out.append(float(registry.Quantity(1.0, old[name]).to(new[name]).magnitude))
            except Exception as error:
                faults.append(f"{name}: cannot convert {old[name]!r} to {new[name]!r} ({error})")
    faults += [unknown("base unit", name, BASE_UNITS) for name in new if name not in BASE_UNITS]
    if faults:
        raise DeclarationError("to_units", faults)
    return out[0], out[1], out[2]


def factor_of(dimension: Dimension, base: Sequence[float]) -> float:
    """The number by which a number of this dimension is multiplied: ``prod_i base_i^dimension_i``."""
    return float(prod(f**power for f, power in zip(base, dimension, strict=True)))


LARGEST = 1e100
"""Numbers from here on are refused: their squares would overflow."""
DEEPEST = 32
"""Sequences nested more deeply are no arrays (numpy knows 64 axes), tables and lists of a file no mechanism (it needs six)."""

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


def repeated(names: Sequence[Any], what: str) -> list[str]:
    """Names that stand more than once, one line each."""
    if len(set(names)) == len(names):
        return []
    return [f"{what} {n!r} is declared {c} times; names must differ" for n, c in Counter(names).items() if c > 1]


def unknown(what: str, name: object, known: Iterable[str], also: Iterable[str] = ()) -> str:
    """The fault of a name that is none of the ``known`` ones: those that may be meant (of ``also``, too), and all."""
    names, low = list(known), dict[str, str]()
    # where there are more, a search for each of many wrong names takes too long
    for one in [*names, *also] if len(names) <= 200 else ():
        low.setdefault(one.lower(), one)
    text = name if isinstance(name, str) else shown(name)
    hint = did_you_mean([low[one] for one in near_names(text.lower(), low, 0.6)[:2]])
    return f"unknown {what} {shown(name)}{hint and f'; {hint}'} ({what}s: {listed(names) or 'none'})"


class ByName(dict[str, Any]):
    """Values by name; one that there is not is a fault that says which there are: of ``subject``, each a ``what``."""

    def __init__(self, subject: str, what: str, values: Iterable[tuple[str, Any]]) -> None:
        super().__init__(values)
        self.subject, self.what = subject, what

    def __missing__(self, name: object) -> Any:
        raise DeclarationError(self.subject, [unknown(self.what, name, self)])

    def __repr__(self) -> str:
        with np.printoptions(threshold=8, edgeitems=2):
            return "{" + ", ".join(f"{name!r}: {value}" for name, value in self.items()) + "}"


P = ParamSpec("P")
R = TypeVar("R")
FLOATING: dict[str, Any] = {"all": "ignore"}
"""What numpy says of overflow and of values that are none, in here: nothing, as results say it themselves, whatever a program has set."""
SPOKEN = {"m": "mechanism", "s": "solution", "f": "formulation"}
"""Parameters of one letter, in messages."""
RANGE = sys.maxsize
"""Whole numbers up to this one count and index something."""


def _unfit(value: Any, what: str, wanted: Wanted) -> str:
    """The fault of an argument; of several where one is wanted, as results are, that it is several."""
    if (
        isinstance(value, Sequence)
        and not isinstance(value, str | list | tuple)
        and len(value)
        and wanted.fits(value[0])
    ):
        one = wanted.words.partition(";")[0]
        return f"{what}: {type(value).__name__} of {len(value)}; expected {one}, such as the first of these, [0]"
    return wrong(value, what, wanted.words)


class Wanted(NamedTuple):
    """What an argument must be: a check, and the words for it."""

    fits: Callable[[Any], bool]
    words: str


def door(function: Callable[P, R]) -> Callable[P, R]:
    """A public function that refuses arguments which its annotations exclude, and calls without or with too many of them.

    It runs under the tolerances of its first argument that remembers some (the default ones count), or under those given as
    ``tolerances``, with which a mechanism is then asked.

    Raises
    ------
    DeclarationError
        with all faults.
    """

    @functools.cache
    def known() -> tuple[inspect.Signature, dict[str, Wanted | None], list[str], set[str]]:
        signature = inspect.signature(function)
        own = signature.parameters.values()
        by_place = [one.name for one in own if one.kind == one.POSITIONAL_OR_KEYWORD]
        whole = len(by_place) + sum(one.kind == one.KEYWORD_ONLY for one in own) == len(own)
        needed = {one.name for one in own if one.default is one.empty}
        return signature, wanted_of(function, signature), by_place if whole else [], needed

    @functools.wraps(function)
    def entered(*args: P.args, **named: P.kwargs) -> R:
        signature, wanted, by_place, needed = known()
        bound: dict[str, Any] = dict(zip(by_place, args, strict=False)) | named
        several = [name for name, value in bound.items() if isinstance(value, Iterator)]
        clear = len(bound) == len(args) + len(named) and needed <= bound.keys() <= wanted.keys()
        if several or not clear or not by_place:  # ``bind`` takes longer
            try:
                given = signature.bind(*args, **named)
            except TypeError as error:
                raise DeclarationError(_called(function, args), [_call_fault(error, named, signature)]) from None
            bound = given.arguments
            for name in [name for name, value in bound.items() if isinstance(value, Iterator)]:
                if (one := wanted[name]) is not None and one.fits(bound[name]):
                    bound[name] = tuple(bound[name])
                    args, named = given.args, given.kwargs  # type: ignore[assignment]
        faults = [
            _unfit(value, SPOKEN.get(name, name), one)
            for name, value in bound.items()
            if (one := wanted[name]) is not None and not one.fits(value)
        ]
        if faults:
            raise DeclarationError(_called(function, args), faults)
        asked = next((carried(value) for value in bound.values() if isinstance(value, Remembers)), ASKED.get())
        if (own := bound.get("tolerances")) is not None:
            asked = own.asked
            args, named = _asked_with(own, args), dict(zip(named, _asked_with(own, named.values()), strict=True))  # type: ignore[assignment]
        token = ASKED.set(asked)  # not by ``under``: warnings count the frames up to the caller
        try:
            with np.errstate(**FLOATING):
                return function(*args, **named)
        except MechgraphError as error:
            if asked is not None and error.args and ASIDE not in error.args[0]:
                error.args = (f"{error.args[0]}\n  {ASIDE} {asked.changed}", *error.args[1:])
            raise
        finally:
            ASKED.reset(token)

    return entered


ASIDE = "Decided with tolerances other than the default ones:"
"""What is said after an error that they may have made."""


def _call_fault(error: TypeError, named: Iterable[str], signature: inspect.Signature) -> str:
    """Why a call does not fit, and the names that may be meant."""
    strange = (name for name in named if name not in signature.parameters)
    near = [one for name in strange for one in near_names(name, signature.parameters, 0.6)]
    return f"{error}; {(near and f'{did_you_mean(near)} It') or 'it'} takes {_told(signature)}"


def with_clear_calls(cls: type) -> None:
    """Let a class refuse calls without or with too many arguments as doors do; it looks at the values itself."""
    make = vars(cls)["__init__"]

    @functools.wraps(make)
    def made(self: Any, *args: Any, **named: Any) -> None:
        try:
            make(self, *args, **named)
        except TypeError:
            signature = inspect.signature(make)
            try:
                signature.bind(self, *args, **named)
            except TypeError as error:
                raise DeclarationError(cls.__name__, [_call_fault(error, named, signature)]) from None
            raise

    cls.__init__ = made  # type: ignore[misc]


def _asked_with(tolerances: Any, arguments: Iterable[Any]) -> tuple[Any, ...]:
    return tuple(one.with_tolerances(tolerances) if hasattr(one, "with_tolerances") else one for one in arguments)


def with_doors(cls: type) -> None:
    """Make doors of the public methods of a class, its own and those of its bases, that take arguments."""
    ours = [base for base in reversed(cls.__mro__) if base.__module__.startswith("mechgraph")]
    for name, function in {name: one for base in ours for name, one in vars(base).items()}.items():
        public = not name.startswith("_") or name == "__getitem__"
        if public and inspect.isfunction(function) and not hasattr(function, "__wrapped__") and _takes_any(function):
            setattr(cls, name, door(function))


def with_memory(cls: type) -> None:
    """Let the public methods and properties of a class go by the tolerances under which an object was made."""
    ours = [base for base in reversed(cls.__mro__) if base is cls or base.__module__.startswith("mechgraph")]
    for name, one in {name: one for base in ours for name, one in vars(base).items()}.items():
        if name.startswith("_") or hasattr(getattr(one, "func", getattr(one, "fget", one)), "__wrapped__"):
            continue
        if inspect.isfunction(one):
            setattr(cls, name, as_asked(one))
        elif type(one) is property and one.fset is None and one.fget is not None:
            setattr(cls, name, property(as_asked(one.fget), doc=one.__doc__))
        elif type(one) is functools.cached_property:
            again = functools.cached_property(as_asked(one.func))
            again.__set_name__(cls, name)
            setattr(cls, name, again)


def _takes_any(method: types.FunctionType) -> bool:
    code = method.__code__
    return code.co_argcount + code.co_kwonlyargcount > 1 or bool(code.co_flags & inspect.CO_VARKEYWORDS)


def _called(function: Callable[..., Any], args: tuple[Any, ...]) -> str:
    """``solve 'four-bar'`` or ``Solution.point``: what was called, of what, by the names that users know."""
    what, name = function.__name__, getattr(args[0], "name", None) if args else None
    if "." in function.__qualname__ and args:
        what = f"{(args[0] if isinstance(args[0], type) else type(args[0])).__name__}.{what}"
    return f"{what} {name!r}" if isinstance(name, str) else what


def _told(signature: inspect.Signature) -> str:
    return ", ".join(name for name in signature.parameters if name not in ("self", "cls")) or "no arguments"


# --- what annotations say ----------------------------------------------------------------------------------------------------


def wanted_of(function: Callable[..., Any], signature: inspect.Signature) -> dict[str, Wanted | None]:
    """What each argument must be, by its name; None where its annotation leaves it open.

    Annotations are read with the names that the module of the function knows, then with those that a user knows.
    """
    names = {**vars(sys.modules["mechgraph"]), **getattr(function, "__globals__", {})}
    wanted = {}
    for name, parameter in signature.parameters.items():
        hint = parameter.annotation
        single = parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD)
        wanted[name] = wanted_by(eval(hint, names)) if single and isinstance(hint, str) else None
    return wanted


def wanted_by(hint: Any) -> Wanted | None:
    """What an annotation asks of a value; None where it is open."""
    origin, inner = get_origin(hint), get_args(hint)
    if hint is Any:
        return None
    if origin is Annotated:
        return next(one for one in inner if isinstance(one, Wanted))
    if origin in (Union, types.UnionType):
        numbers = set(ARRAY_LIKE) <= set(inner)
        each = [wanted_by(one) for one in inner if one is not type(None) and not (numbers and one in ARRAY_LIKE)]
        each += [REAL] * numbers
        ways = [one for one in each if one is not None]
        if len(ways) < len(each):
            return None
        optional = type(None) in inner
        words = dict.fromkeys(one.words.partition(";")[0] if len(ways) > 1 else one.words for one in ways)
        return Wanted(
            lambda value: (optional and value is None) or any(one.fits(value) for one in ways),
            " or ".join(sorted(words, key=lambda text: text.startswith("a list"))),
        )
    if origin is Literal:
        return Wanted(lambda value: isinstance(value, str) and value in inner, f"one of {', '.join(map(repr, inner))}")
    if hint in PLAIN:
        return PLAIN[hint]
    if origin is tuple and Ellipsis not in inner:
        return _tuple(inner)
    kind = origin or hint
    if kind is collections.abc.Mapping:
        return Wanted(lambda value: isinstance(value, Mapping), "a mapping")
    if kind in (collections.abc.Iterable, collections.abc.Sequence, tuple, list):
        return _items(wanted_by(inner[0]), kind is not collections.abc.Iterable)
    if kind is collections.abc.Callable:
        return Wanted(callable, "a function")
    if kind is os.PathLike:
        return Wanted(lambda value: isinstance(value, os.PathLike), "a path")
    if kind is np.ndarray:
        return REAL
    if isinstance(kind, type):
        article = "an" if kind.__name__[0] in "AEIOU" else "a"
        return Wanted(lambda value: isinstance(value, kind), getattr(kind, "_wanted", f"{article} {kind.__name__}"))
    return None


def _whole(value: Any) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool) and bool(-RANGE <= value <= RANGE)


def at_least(number: int) -> Wanted:
    """A whole number that is not too small."""
    return Wanted(lambda value: _whole(value) and value >= number, f"a whole number from {number} on")


Count = Annotated[int, at_least(1)]
Index = Annotated[int, at_least(0)]
Positive = Annotated[float, Wanted(lambda value: is_numeric(value, ()) and value > 0, "a number above 0")]
Limit = Annotated[
    float,
    Wanted(lambda value: no_limit(value) or (is_numeric(value, ()) and value > 0), "a number above 0, or infinity"),
]


PLAIN: dict[Any, Wanted] = {
    str: Wanted(lambda value: isinstance(value, str), "a text"),
    bool: Wanted(lambda value: isinstance(value, bool | np.bool_), "True or False"),
    int: Wanted(_whole, "a whole number"),
    float: Wanted(lambda value: is_numeric(value, ()) or is_quantity(value), "a finite number"),
    slice: Wanted(lambda value: isinstance(value, slice), "a slice"),
}
"""What plain types ask for."""
ARRAY_LIKE = get_args(ArrayLike)
REAL = Wanted(lambda value: real_array(value) is not None or has_quantity(value), "real numbers")


def _tuple(inner: tuple[Any, ...]) -> Wanted:
    """So many values in a row."""
    each = [wanted_by(one) for one in inner]

    def fits(value: Any) -> bool:
        items = items_of(value, "", [])
        return len(items) == len(each) and all(one is None or one.fits(v) for one, v in zip(each, items, strict=True))

    words = dict.fromkeys(one.words for one in each if one is not None)
    return Wanted(fits, f"{len(each)} values, each {' or '.join(words)}" if words else f"{len(each)} values")


def _items(one: Wanted | None, kept: bool) -> Wanted:
    """Several values; of what is read only once the door looks at what it read."""

    def fits(value: Any) -> bool:
        faults: list[str] = []
        if isinstance(value, Iterator):
            return not kept
        items = items_of(value, "", faults)
        return not faults and (one is None or all(one.fits(item) for item in items))

    return Wanted(fits, f"a list, each {one.words}" if one else "a list")


# --- arguments whose annotation leaves them open -----------------------------------------------------------------------------


def option_faults(allowed: Mapping[str, tuple[Any, Iterable[str]]]) -> list[str]:
    """Options, name -> (value, allowed texts), whose value is not allowed."""
    return [
        wrong(value, name, f"one of {', '.join(map(repr, texts))}")
        for name, (value, texts) in allowed.items()
        if not isinstance(value, str) or value not in texts
    ]


def items_of(value: Any, what: str, faults: list[str]) -> tuple[Any, ...]:
    """The items of a list (or of any other iterable but a text or a mapping); for all else a fault and no items."""
    if not isinstance(value, str | bytes | Mapping):
        try:
            return tuple(value)
        except TypeError:
            pass
    faults.append(wrong(value, what, "a list"))
    return ()


def place_among(place: int, count: int, what: str, of: str) -> int:
    """A place in a row of ``count``, counted from 0.

    Raises
    ------
    DeclarationError
        where there is none.
    """
    if not (_whole(place) and 0 <= place < count):
        wanted = f"a number below {count}, counted from 0" if count else "none, as there are none"
        raise DeclarationError(of, [wrong(place, what, wanted)])
    return int(place)
