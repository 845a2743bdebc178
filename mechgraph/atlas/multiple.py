"""A multiple joint by names: turning pairs of three or more links on one axis."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MultipleJoint:
    """A turning joint of three or more ``links``, declared as the ``pairs``."""

    links: tuple[str, ...]
    pairs: tuple[str, ...]

    @property
    def order(self) -> int:
        """Number of pairs that it counts as, one less than links."""
        return len(self.links) - 1

    @property
    def text(self) -> str:
        """E.g. ``B, C: joint of order 2 of the links crank, rod, arm``."""
        return f"{', '.join(self.pairs)}: joint of order {self.order} of the links {', '.join(self.links)}"

    def __str__(self) -> str:
        return self.text
