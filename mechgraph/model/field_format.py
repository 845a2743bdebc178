"""What the fields of a declaration hold, stated once, in the annotations of the dataclasses.

    mass: Annotated[float, NUMBER("mass", MASS, minimum=0.0)] = 0.0

Reading and checking a value, the TOML file, its JSON Schema, the tables of the library's README, the conversion of units, rigid motions
of the whole mechanism and the names of numbers in studies all follow from it.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any, ClassVar, Self, get_type_hints

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.errors import DeclarationError
from mechgraph.model.numeric import plain
from mechgraph.quantities import has_quantity, shown, without_units, wrong
from mechgraph.units import PURE, Dimension, factor_of, symbol_of

XYZ = "xyz"
Schema = Mapping[str, Any]
STANDS_AS = {str: "a text", bool: "true or false", dict: "a table"}
"""How the types of values are called in messages."""
NEEDED = object()
"""What stands for the default of a field that must not be left out."""


@dataclass(frozen=True, eq=False)
class Kind:
    """A kind of value.

    ``words`` name it in tables, ``schema`` is its JSON Schema, ``stands_as`` the type of a value in a file where a reader can tell
    (None: the constructor tells); ``shape`` that of a number, vector or tensor (None for all else); ``fault(value, what, minimum)``
    says what is wrong with a value; ``moved(value, pose)`` is the value after a rigid motion ``(3, 4)`` of the whole mechanism; ``names``
    are those of the components where they are not x, y, z; ``entry`` is the kind of one entry of a list.
    """

    words: str
    schema: Schema
    stands_as: type | None = None
    shape: tuple[int, ...] | None = None
    numeric: bool = False
    fault: Callable[[Any, str, float | None], str | None] | None = None
    moved: Callable[[Any, Array], Any] | None = None
    names: tuple[str, ...] = ()
    entry: Kind | None = None

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

    ``degrees``: may be given in degrees under its name with ``_deg`` added; ``minimum``: smallest number; ``choices``: the texts
    allowed; ``of``: of the name of a point, the field that names its link; ``key``: its name in files where it is another; ``table``:
    the table of the file that it holds; ``single``: of the name of a freedom, whether it must not be part of a rotation; ``default``:
    in words, where the value does not say it; ``held_in``: the array of ``Declared`` that holds the number, and the factor, where the
    array has another name than the field; ``rules``: more of its schema.
    """

    kind: Kind
    meaning: str
    slide: Dimension = PURE
    turn: Dimension = PURE
    degrees: bool = False
    minimum: float | None = None
    choices: tuple[str, ...] = ()
    of: str = ""
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

    @property
    def told(self) -> str:
        """The field in a line of a docstring."""
        kind = " or ".join(map(repr, self.choices)) or self.kind.words
        default = f" (left out: {self.default})" if self.default else ""
        return f"{kind}{self.unit and f' [{self.unit}]'}; {self.meaning}{default}."

    def fault(self, value: Any, what: str) -> str | None:
        """What is wrong with a value, or None."""
        if self.choices and not (isinstance(value, str) and value in self.choices):
            return wrong(value, what, " or ".join(map(repr, self.choices)))
        stands_as = self.kind.stands_as
        if stands_as in STANDS_AS and not isinstance(value, stands_as):
            return wrong(value, what, STANDS_AS[stands_as])
        return None if self.kind.fault is None else self.kind.fault(value, what, self.minimum)


class _Signature:
    """The signature of a class with fields as ``help`` shows it: what they hold stands in the docstring."""

    def __get__(self, instance: object, cls: type) -> inspect.Signature:
        every = list(inspect.signature(inspect.getattr_static(cls, "__init__")).parameters.values())[1:]
        return inspect.Signature([one.replace(annotation=inspect.Parameter.empty) for one in every])


class Formatted:
    """A dataclass whose annotations say what its fields hold (``FieldFormat``)."""

    __signature__ = _Signature()
    formats: ClassVar[Mapping[str, FieldFormat]] = {}
    """What the fields hold, by their names."""
    _numeric: ClassVar[tuple[str, ...]] = ()
    _defaults: ClassVar[tuple[Any, ...]] = ()

    def __init_subclass__(cls) -> None:
        if cls.__repr__ is Formatted.__repr__:
            cls.__repr__ = Formatted.__repr__  # type: ignore[method-assign]  # dataclass leaves alone what stands in the class itself
        hints = get_type_hints(cls, include_extras=True)
        found = {name: getattr(hint, "__metadata__", (None,))[0] for name, hint in hints.items()}
        cls.formats = {name: about for name, about in found.items() if isinstance(about, FieldFormat)}
        cls._numeric = tuple(name for name, about in cls.formats.items() if about.kind.numeric)
        cls._defaults = tuple(getattr(cls, name, NEEDED) for name in cls.formats)
        if cls.__doc__ and cls.formats and "Parameters\n" not in cls.__doc__:
            told = [f"    {name} : {about.told}" for name, about in cls.formats.items()]
            cls.__doc__ = "\n".join([cls.__doc__.rstrip(), "", "    Parameters", "    ----------", *told, "    "])

    def __repr__(self) -> str:
        """The fields that differ from what they are where they are left out."""
        given = {name: getattr(self, name) for name in self.formats}
        told = [
            f"{name}={dict(value) if isinstance(value, Mapping) else repr(value) if isinstance(value, Formatted) else shown(value)}"
            for name, value in given.items()
            if not is_default(type(self), name, value)
        ]
        return f"{type(self).__name__}({', '.join(told)})"


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

    def read_numbers(self) -> None:
        """Turn what the numeric fields hold into floats and tuples of floats; to be called where the fields are set."""
        for name in self._numeric:
            value = getattr(self, name)
            if value is not None and type(value) is not float:
                object.__setattr__(self, name, on_each(plain, value))

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

    def moved(self, pose: Array) -> Self:
        """The same after a rigid motion ``(3, 4)`` of the whole mechanism; itself where nothing in it has a place or direction."""
        changes = {}
        for name, about in self.formats.items():
            value = getattr(self, name)
            if isinstance(value, Described):
                changes[name] = value.moved(pose)
            elif value is not None and about.kind.moved is not None:
                changes[name] = about.kind.moved(value, pose)
        return self.replace(**changes) if changes else self

    def without_quantities(self, units: Mapping[str, str], turns: bool = False) -> Self:
        """The same with quantities of pint as plain numbers in these units; those that do not fit stay, and are faults.

        ``turns``: whether the freedom that it names is a turn.
        """
        changes = {}
        for name, about in self.formats.items():
            value = getattr(self, name)
            if isinstance(value, Described):
                changes[name] = value.without_quantities(units, turns)
            elif about.kind.numeric and has_quantity(value):
                changes[name] = without_units(value, about.turn if turns else about.slide, units)
        return self.replace(**changes) if changes else self

    def in_units(self, base: tuple[float, float, float], turns: bool = False) -> Self:
        """The same with every number times ``prod_i base_i^dimension_i``; ``turns``: whether the freedom that it names is a turn.

        ``base (3,)`` are the factors of lengths, masses and times. A callable is refused (DeclarationError).
        """
        changes = {}
        for name, about in self.formats.items():
            value = getattr(self, name)
            if isinstance(value, Described):
                changes[name] = value.in_units(base, turns)
            elif callable(value):
                what = f"{name} of a {type(self).__name__}"
                raise DeclarationError("to_units", [f"{what} is a callable; convert it yourself, or sample it first"])
            elif value is not None and about.kind.numeric:
                factor = factor_of(about.turn if turns else about.slide, base)
                if factor != 1.0 and not isinstance(value, str):
                    changes[name] = on_each(partial(_times, factor), value)
        return self.replace(**changes) if changes else self


def on_each(change: Callable[[Any], Any], value: Any) -> Any:
    """A changed value; of a table of values each, read-only."""
    if type(value) not in (tuple, np.ndarray) and isinstance(value, Mapping):  # asked last, as it takes long
        return MappingProxyType({name: change(item) for name, item in value.items()})
    return change(value)


def _times(factor: float, value: Any) -> Any:
    return plain(np.asarray(value) * factor)
