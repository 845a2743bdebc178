"""What a search may spend: work that is counted, so that what it finds does not depend on what else a computer does meanwhile."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TypeVar

from mechgraph.errors import MechgraphError

Item = TypeVar("Item")


class SearchEnded(MechgraphError):
    """A search was given up."""


class Budget:
    """Seconds that a search may take on one quiet core; every step of it says what it takes by the sizes of its arrays (measured)."""

    TOOK_TOO_LONG = "the search took longer than it may"

    def __init__(self, seconds: float) -> None:
        self.left = seconds

    @property
    def ended(self) -> bool:
        """Whether more was spent than there was."""
        return self.left < 0.0

    def spend(self, seconds: float) -> None:
        """Count a step.

        Raises
        ------
        SearchEnded
            where nothing is left.
        """
        self.left -= seconds
        if self.ended:
            raise SearchEnded(self.TOOK_TOO_LONG)

    def of(self, items: Iterable[Item], seconds: float) -> Iterator[Item]:
        """The items, each of which costs as much, as far as there is something left."""
        for item in items:
            self.left -= seconds
            if self.ended:
                return
            yield item
