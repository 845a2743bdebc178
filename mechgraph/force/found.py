"""What is found of a batch of positions, in internal units: motions, and what acts with the wrenches that balance it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index
from mechgraph.closure.path import Tracks
from mechgraph.closure.rates import Rates
from mechgraph.force.applied_loads import Site, inertia_wrenches
from mechgraph.force.dalembert import NO_WRENCHES, Wrenches


@dataclass(frozen=True)
class Motions:
    """Positions and rates of a batch: only solved positions are evaluated, ``good`` says which of the flat batch they are."""

    here: Configuration
    rates: Rates
    batch: tuple[int, ...]
    good: Index
    status: Any
    t: Any
    driven: Index
    held: tuple[Index, ...]
    which: Index
    tracks: Tracks = ()


@dataclass
class Forces:
    """What acts at the positions of a batch, and the wrenches of all pairs found for it.

    ``act`` lets all loads act; ``hold (6, N, T)`` keeps passive bodies at rest, ``holds`` are its sizes by name and whether they are
    couples; ``solver`` are the closure equations.
    """

    rates: Rates
    act: Callable[[], Site]
    mask_redundant: bool
    hold: Array
    solver: Any
    holds: tuple[tuple[str, bool, Array], ...] = ()
    wrenches: Wrenches = NO_WRENCHES

    @cached_property
    def site(self) -> Site:
        """What loads do."""
        return self.act()

    @cached_property
    def inertia(self) -> Array:
        """Inertia wrenches of all links, ``(6, N, T)``."""
        return inertia_wrenches(self.rates.here, self.rates)

    def forget(self) -> None:
        """Give back the memory of what is not asked for often; it is computed again where it is."""
        for name in ("site", "inertia"):
            self.__dict__.pop(name, None)
        self.wrenches, self.solver = NO_WRENCHES, None
