"""What is worked out of a thing that does not change once and kept with it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, Generic, TypeVar

Made = TypeVar("Made")


def of_graph(make: Callable[[Any], Made]) -> Callable[[Any], Made]:
    """Mark what follows from names, ends and types of links and pairs alone, whatever the numbers."""
    vars(make)["of_graph"] = True
    return make


class Once:
    """A thing that does not change, with what is made of it."""

    def once(self, make: Callable[[Any], Made]) -> Made:
        """``make(self)``, made once and kept."""
        if make not in self._kept:
            self._kept[make] = make(self)
        made: Made = self._kept[make]
        return made

    def take_graph_of(self, other: Once) -> None:
        """Take over what was made of the graph of another thing, of which the graph is the same."""
        known = list(other._kept.items())  # another thread may add to it meanwhile
        self._kept.update({make: made for make, made in known if "of_graph" in vars(make)})

    @cached_property
    def _kept(self) -> dict[Callable[..., Any], Any]:
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
