"""A long batch of positions solved in blocks that stay in the cache of a core, handed out as one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.indexing import Index
from mechgraph.equations.state import State
from mechgraph.errors import MechgraphError
from mechgraph.force.analysis import Analysis, flat_place
from mechgraph.result.solution import Checks, MaterialPoint


class Blocks:
    """The values of a Solution (implements ``result.solution.Values``) from those of blocks of its positions.

    ``places`` are the positions of every block in the flat batch.
    """

    def __init__(
        self,
        parts: Sequence[Analysis],
        places: Sequence[Index],
        batch: tuple[int, ...],
        status: Any,
        t: Any,
    ) -> None:
        self._parts, self._places, self._status = parts, places, status
        self.mechanism, self.batch, self.t = parts[0].mechanism, batch, t
        self.has_forces = parts[0].has_forces
        self._count = int(np.prod(batch))
        self._whole = sum(len(at) for at in places) == self._count

    def _joined(self, values: Sequence[Array]) -> Array:
        """Values of the blocks ``(T, ...)`` -> ``(*batch, ...)``, NaN where not solved; read-only."""
        shape = (self._count, *values[0].shape[1:])
        full = np.empty(shape) if self._whole else np.full(shape, np.nan)
        for at, part in zip(self._places, values, strict=True):
            full[at] = part
        out = full.reshape(*self.batch, *shape[1:])
        out.setflags(write=False)
        return out

    def _each(self, value: Callable[[Analysis], Array]) -> Array:
        return self._joined([value(part) for part in self._parts])

    def _tuples(self, value: Callable[[Analysis], tuple[Array, ...]]) -> list[Array]:
        return [self._joined(parts) for parts in zip(*(value(part) for part in self._parts), strict=True)]

    def _dicts(self, value: Callable[[Analysis], dict[str, Array]]) -> dict[str, Array]:
        found = [value(part) for part in self._parts]
        return {name: self._joined([part[name] for part in found]) for name in found[0]}

    def status(self) -> Any:
        """Named outcomes."""
        return self._status

    def coordinates(self, pair: int) -> tuple[Array, Array, Array]:
        """Coordinates, rates, accelerations of a pair."""
        position, velocity, acceleration = self._tuples(lambda part: part.coordinates(pair))
        return position, velocity, acceleration

    def link(self, link: int) -> tuple[Array, Array, Array]:
        """Pose, twist and dV/dt of a link."""
        pose, twist, acceleration = self._tuples(lambda part: part.link(link))
        return pose, twist, acceleration

    def link_point(self, link: int, p: Any) -> MaterialPoint:
        """Position, velocity and acceleration of a material point."""
        return MaterialPoint(*self._tuples(lambda part: part.link_point(link, p)))

    def reaction(self, pair: int) -> Array:
        """Reaction about the global origin."""
        return self._each(lambda part: part.reaction(pair))

    def total(self, pair: int) -> Array:
        """Total wrench about the global origin."""
        return self._each(lambda part: part.total(pair))

    def reaction_at_pair(self, pair: int) -> Array:
        """Reaction about the origin of marker B."""
        return self._each(lambda part: part.reaction_at_pair(pair))

    def components(self, pair: int) -> dict[str, Array]:
        """Reaction components by name."""
        return self._dicts(lambda part: part.components(pair))

    def efforts(self, pair: int) -> tuple[Array, Array]:
        """Efforts of all kinds and of the driver alone."""
        total, own = self._tuples(lambda part: part.efforts(pair))
        return total, own

    def shaking(self) -> Array:
        """Wrench on the frame."""
        return self._each(lambda part: part.shaking())

    def link_hold(self, link: int) -> Array:
        """Wrench that keeps a passive body at rest, about the global origin."""
        return self._each(lambda part: part.link_hold(link))

    def passive_efforts(self) -> dict[str, Array]:
        """What keeps passive bodies at rest, by body."""
        return self._dicts(lambda part: part.passive_efforts())

    def checks(self) -> Checks:
        """Closure error, equilibrium and power; the last two relative to the largest term in the whole batch."""
        closure = self._each(lambda part: part.closure())
        if not self.has_forces:
            nothing = np.full(self.batch, np.nan)
            return Checks(closure, nothing, nothing)
        ratios = []
        for found in ([part.equilibrium for part in self._parts], [part.power for part in self._parts]):
            largest = max(size for _, size in found) or 1.0
            ratios.append(self._joined([values / largest for values, _ in found]))
        return Checks(closure, *ratios)

    def state(self, index: Any) -> State:
        """Screws and loads at one position, user's units, global origin."""
        flat = flat_place(self.batch, index)
        for part, at in zip(self._parts, self._places, strict=True):
            found = np.flatnonzero(at == flat)
            if found.size:
                return part.state(int(found[0]))
        raise MechgraphError(f"state({index!r}): this position was not solved ({np.ravel(self._status)[flat]})")
