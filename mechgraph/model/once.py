"""What is worked out of a declared thing once and kept with it."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, TypeVar

Made = TypeVar("Made")


class Once:
    """A thing that does not change, with what is made of it."""

    def once(self, make: Callable[[Any], Made]) -> Made:
        """``make(self)``, made once and kept."""
        if make not in self._kept:
            self._kept[make] = make(self)
        made: Made = self._kept[make]
        return made

    @cached_property
    def _kept(self) -> dict[Callable[..., Any], Any]:
        return {}
