"""What is worked out of a thing that does not change once and kept with it, and the tolerances under which that is done.

``dataclass`` is that of the standard library, worked out where a class is first used: the methods of some 250 classes take longer to
write than all else that ``import mechgraph`` does.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable
from contextvars import ContextVar
from functools import cached_property, wraps
from threading import RLock
from typing import TYPE_CHECKING, Any, Generic, ParamSpec, Self, TypeVar

Made = TypeVar("Made")
P = ParamSpec("P")
ASKED: ContextVar[Any] = ContextVar("tolerances", default=None)
"""The tolerances of the running call (see ``maths.tolerances``); None are the default ones."""


class _Unwritten:
    """Stands for an attribute of a dataclass until it is asked for; then its methods are written, ``__init__`` last, in one thread."""

    lock = RLock()

    def __init__(self, name: str, cls: type, options: dict[str, Any]) -> None:
        self.name, self.cls, self.options = name, cls, options
        self.then: list[Callable[[type], None]] = []

    def __get__(self, instance: object, owner: type) -> Any:
        cls = self.cls
        with self.lock:
            if vars(cls).get(self.name) is self:
                then = vars(cls)["__init__"].then
                words, cls.__doc__ = vars(cls)["__doc__"], "-"  # which takes long where it tells the fields
                dataclasses.dataclass(**self.options, init=False)(cls)
                cls.__doc__ = words
                every = [(f.name, f.type, f) for f in dataclasses.fields(cls)]
                own = {name: getattr(cls, name) for name in ("__module__", "__post_init__") if hasattr(cls, name)}
                frozen = self.options.get("frozen", False)
                like = dataclasses.make_dataclass(
                    cls.__name__, every, namespace=own, repr=False, eq=False, frozen=frozen
                )
                start = vars(like)["__init__"]
                start.__qualname__ = f"{cls.__qualname__}.__init__"
                type.__setattr__(cls, "__init__", start)
                for change in then:
                    change(cls)
                if "__setstate__" in vars(cls):
                    delattr(cls, "__setstate__")
        return getattr(owner if instance is None else instance, self.name)


if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(cls=None, /, **options):
        """A dataclass as in the standard library, of which the methods are written where it is first used.

        That is by a call, by ``fields`` of the class, or by an object that comes out of a pickle.
        """
        if cls is None:
            return lambda cls: dataclass(cls, **options)
        if "__init__" in vars(cls) or options.get("slots") or not options.get("init", True):
            return dataclasses.dataclass(**options)(cls)
        for name in ("__init__", "__dataclass_fields__", "__setstate__"):
            if name == "__init__" or isinstance(inspect.getattr_static(cls, name, None), _Unwritten | None):
                setattr(cls, name, _Unwritten(name, cls, options))
        return cls


class class_cached:
    """An attribute of a class, ``make(cls)``, worked out where it is first asked for; of a subclass it is its own."""

    def __init__(self, make: Callable[[type], Any], name: str, cls: type) -> None:
        self.make, self.name, self.cls = make, name, cls

    def __get__(self, instance: object, owner: type) -> Any:
        value = self.make(self.cls)
        setattr(self.cls, self.name, value)
        return value


def once_written(cls: type, change: Callable[[type], None]) -> None:
    """Change a class after its methods are written."""
    start = vars(cls).get("__init__")
    if isinstance(start, _Unwritten):
        start.then.append(change)
    elif start is not None:
        change(cls)


class Remembers:
    """Something that is asked under the tolerances under which it was made, whoever asks it, when, and in which thread.

    So no fact that is kept with a mechanism or a result mixes two sets of tolerances.
    """

    __slots__ = ()

    def __new__(cls, *args: Any, **named: Any) -> Self:
        """An object that carries the tolerances of the running call."""
        beside = super().__new__  # a tuple's, where the class is one too
        made = beside(cls) if beside is object.__new__ else beside(cls, *args, **named)
        if (tolerances := ASKED.get()) is not None and hasattr(made, "__dict__"):  # a tuple is no more than its values
            vars(made)["_tolerances"] = tolerances
        return made


def carried(thing: object) -> Any:
    """The tolerances that something carries; None are the default ones."""
    return getattr(thing, "__dict__", {}).get("_tolerances")


def under(tolerances: Any, make: Callable[P, Made], /, *args: P.args, **named: P.kwargs) -> Made:
    """What a function gives under tolerances."""
    if tolerances is ASKED.get():
        return make(*args, **named)
    token = ASKED.set(tolerances)
    try:
        return make(*args, **named)
    finally:
        ASKED.reset(token)


def as_asked(method: Callable[P, Made]) -> Callable[P, Made]:
    """A method that goes by the tolerances of its own object."""

    @wraps(method)
    def asked(*args: P.args, **named: P.kwargs) -> Made:
        return under(carried(args[0]), method, *args, **named)

    return asked


def of_graph(make: Callable[[Any], Made]) -> Callable[[Any], Made]:
    """Mark what follows from names, ends and types of links and pairs alone, whatever the numbers."""
    vars(make)["of_graph"] = True
    return make


class Once:
    """A thing that does not change, with what is made of it."""

    def once(self, make: Callable[..., Made], *of: Any) -> Made:
        """``make(*of, self)``, made once and kept."""
        kept = self._kept_of_graph if "of_graph" in vars(make) else self._kept
        key = (make, *of) if of else make
        if key not in kept:
            kept[key] = under(carried(self), make, *of, self)
        made: Made = kept[key]
        return made

    def take_graph_of(self, other: Once) -> None:
        """Share what is made of the graph with another thing, of which the graph is the same."""
        vars(self)["_kept_of_graph"] = other._kept_of_graph

    @cached_property
    def _kept(self) -> dict[Any, Any]:
        return {}

    @cached_property
    def _kept_of_graph(self) -> dict[Any, Any]:
        return {}


Value = TypeVar("Value")


class graph_cached(Generic[Value]):
    """A cached property that follows from names, ends and types alone, made once for all objects that share the dictionary ``store``."""

    store = "_shared"

    def __init__(self, make: Callable[[Any], Value]) -> None:
        self.make, self.__doc__ = make, make.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    def __get__(self, instance: Any, owner: type) -> Value:
        known = vars(instance)[self.store]
        if self.name not in known:
            known[self.name] = self.make(instance)
        instance.__dict__[self.name] = value = known[self.name]
        return value


class unit_cached(graph_cached[Value]):
    """The same of what also follows from the unit of length, where a pair type has lengths of its own."""

    store = "_sized"
