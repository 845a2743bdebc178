"""The numbers that a formulation is assembled from: screws of all pairs and wrenches of all links at a batch of positions."""

from __future__ import annotations

from dataclasses import dataclass, replace

from mechgraph.algebra.se3 import Array


@dataclass(frozen=True, repr=False)
class State:
    """A batch of ``T`` positions (no batch axis is ever dropped here).

    Attributes
    ----------
    coordinates (F, T), velocities (F, T), poses (3, 4, N, T), twists (6, N, T)
    reactions : for every pair the unit wrenches of its components ``(6, 6 - f, T)``.
    efforts : for every pair the effort wrenches ``(6, f, T)``.
    along, conditions : for every pair the axial wrenches and the condition twists of Lee's bookkeeping.
    loads (6, N, T) : inertia and applied wrench of every link.
    coefficients : for every coupling the coefficients of its freedoms ``(terms, 1 or T)``; the declared ones where left out.
    contacts : for every coupling the wrench on its gear b for a unit multiplier ``(6, 1, T)``; ``(6, 0, T)`` for one without gears.
    """

    coordinates: Array
    velocities: Array
    poses: Array
    twists: Array
    reactions: tuple[Array, ...]
    efforts: tuple[Array, ...]
    along: tuple[Array, ...]
    conditions: tuple[Array, ...]
    loads: Array
    coefficients: tuple[Array, ...] = ()
    contacts: tuple[Array, ...] = ()

    def __repr__(self) -> str:
        freedoms, positions = self.coordinates.shape
        return f"{type(self).__name__}({self.loads.shape[1]} links, {freedoms} freedoms, {positions} positions)"

    def of_first(self, pairs: int, freedoms: int) -> State:
        """The same of the first pairs alone, which have so many freedoms."""
        by_pair = {name: getattr(self, name)[:pairs] for name in ("reactions", "efforts", "along", "conditions")}
        return replace(self, coordinates=self.coordinates[:freedoms], velocities=self.velocities[:freedoms], **by_pair)


@dataclass(frozen=True, kw_only=True, repr=False)
class MovingState(State):
    """A batch of positions with rates: what the closure equations and the equations of motion are assembled from, too.

    Attributes
    ----------
    accelerations (F, T)
    freedoms : for every pair the twists of its freedoms ``(6, f, T)``.
    biases (6, P, T) : velocity part of the acceleration of link b against link a, for every pair.
    inertias (6, 6, N, T) : the inertia of every link about the global origin, twist to wrench.
    applied (6, N, T) : the applied part of ``loads``.
    gyroscopic (6, N, T) : the inertia wrench of every link were the accelerations of all freedoms zero.
    """

    accelerations: Array
    freedoms: tuple[Array, ...]
    biases: Array
    inertias: Array
    applied: Array
    gyroscopic: Array

    def of_first(self, pairs: int, freedoms: int) -> MovingState:
        """The same of the first pairs alone."""
        first = super().of_first(pairs, freedoms)
        assert isinstance(first, MovingState)
        return replace(
            first,
            accelerations=self.accelerations[:freedoms],
            freedoms=self.freedoms[:pairs],
            biases=self.biases[:, :pairs],
        )
