"""Arguments at the public doors: one check and one sentence for each that is of the wrong kind.

What a public function or method takes stands once, in its annotations. ``door`` reads them, where it is first called, and refuses all
that does not fit in one DeclarationError, before anything is done.
"""

from __future__ import annotations

import collections.abc
import functools
import inspect
import os
import sys
import types
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Annotated, Any, Literal, NamedTuple, ParamSpec, TypeVar, Union, get_args, get_origin

import numpy as np
from numpy.typing import ArrayLike

from mechgraph.errors import DeclarationError
from mechgraph.quantities import has_quantity, is_numeric, is_quantity, no_limit, real_array, wrong

P = ParamSpec("P")
R = TypeVar("R")
FLOATING: dict[str, Any] = {"all": "ignore"}
"""What numpy says of overflow and of values that are none, in here: nothing, as results say it themselves, whatever a program has set."""
SPOKEN = {"m": "mechanism", "s": "solution", "f": "formulation"}
"""Parameters of one letter, in messages."""
RANGE = sys.maxsize
"""Whole numbers up to this one count and index something."""


class Wanted(NamedTuple):
    """What an argument must be: a check, and the words for it."""

    fits: Callable[[Any], bool]
    words: str


def door(function: Callable[P, R]) -> Callable[P, R]:
    """A public function that refuses arguments which its annotations exclude, and calls without or with too many of them.

    Raises
    ------
    DeclarationError
        with all faults.
    """

    @functools.cache
    def known() -> tuple[inspect.Signature, dict[str, Wanted | None]]:
        signature = inspect.signature(function)
        return signature, wanted_of(function, signature)

    @functools.wraps(function)
    def entered(*args: P.args, **named: P.kwargs) -> R:
        signature, wanted = known()
        try:
            bound = signature.bind(*args, **named).arguments
        except TypeError as error:
            raise DeclarationError(_called(function, args), [f"{error}; it takes {_told(signature)}"]) from None
        faults = [
            wrong(value, SPOKEN.get(name, name), one.words)
            for name, value in bound.items()
            if (one := wanted[name]) is not None and not one.fits(value)
        ]
        if faults:
            raise DeclarationError(_called(function, args), faults)
        with np.errstate(**FLOATING):
            return function(*args, **named)

    return entered


def with_doors(cls: type) -> None:
    """Make doors of the public methods of a class, its own and those of its bases, that take arguments."""
    ours = [base for base in reversed(cls.__mro__) if base.__module__.startswith("mechgraph")]
    for name, function in {name: one for base in ours for name, one in vars(base).items()}.items():
        public = not name.startswith("_") or name == "__getitem__"
        if public and inspect.isfunction(function) and not hasattr(function, "__wrapped__") and _takes_any(function):
            setattr(cls, name, door(function))


def _takes_any(method: types.FunctionType) -> bool:
    code = method.__code__
    return code.co_argcount + code.co_kwonlyargcount > 1 or bool(code.co_flags & inspect.CO_VARKEYWORDS)


def _called(function: Callable[..., Any], args: tuple[Any, ...]) -> str:
    """``solve 'four-bar'``: what was called, of what."""
    name = getattr(args[0], "name", None) if args else None
    return f"{function.__qualname__} {name!r}" if isinstance(name, str) else function.__qualname__


def _told(signature: inspect.Signature) -> str:
    return ", ".join(name for name in signature.parameters if name != "self")


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
    """Several values; what is read only once is not looked into."""

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
