"""Self-stresses at a position: which reaction components and efforts are unique, which only in some direction or combination."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index
from mechgraph.closure.rank import ClosureRank, EngineName, closure_rank
from mechgraph.closure.sparse_solver import PROBES, SEED
from mechgraph.structure.components import Components
from mechgraph.structure.reaction_split import UNIQUE
from mechgraph.structure.self_stress import Basis, SelfStress, basis_of, combinations
from mechgraph.structure.unique_directions import UniqueDirection, unique_directions

CONNECTING = 200
"""Number of self-stresses that connect loops up to which they are computed; their echelon form is dense, of that width."""


@dataclass(frozen=True)
class Uniqueness:
    """The verdict on reactions at one position; what is expensive is computed when first asked for.

    ``parts`` the components, ``found`` the closure equations with the drivers at rest, ``table (components, probes)`` their parts in
    random self-stresses of size one in the measure of every loop, so that the verdict does not depend on how many loops there are;
    ``coupled (couplings, probes)`` the greatest effort of every coupling in them.
    """

    parts: Components
    found: ClosureRank
    table: Array
    coupled: Array

    @property
    def count(self) -> int:
        """Number of self-stresses with the drivers in place."""
        return self.found.count - self.found.rank

    @cached_property
    def sizes(self) -> Array:
        """Part of every component in the random self-stresses."""
        return np.sqrt((self.table**2).sum(axis=1))

    @property
    def is_unique(self) -> NDArray[np.bool_]:
        """Whether each component is unique, in the order of ``parts.labels``."""
        return self.sizes <= UNIQUE

    @property
    def coupling_is_unique(self) -> NDArray[np.bool_]:
        """Whether the multiplier of each coupling is unique, in order of declaration."""
        return np.asarray(np.sqrt((self.coupled**2).sum(axis=1)) <= UNIQUE)

    @property
    def all_unique(self) -> bool:
        """Whether every reaction component, effort and multiplier is unique."""
        return bool(self.is_unique.all() and self.coupling_is_unique.all())

    @property
    def weakest(self) -> float:
        """Largest part of a self-stress in a component called unique."""
        return float(self.sizes[self.is_unique].max(initial=0.0))

    @cached_property
    def unique(self) -> dict[str, dict[str, bool]]:
        """Pair -> component -> whether it is unique; ``effort`` (or ``effort Tz``) for driven freedoms and for couplings."""
        out: dict[str, dict[str, bool]] = {pair.name: {} for pair in self.parts.system.m.pairs}
        for (pair, name), ok in zip(self.parts.labels, self.is_unique.tolist(), strict=True):
            out[pair][name] = ok
        for coupling, ok in zip(self.parts.system.couplings, self.coupling_is_unique.tolist(), strict=True):
            out[coupling.name] = {"effort": ok}
        return out

    @cached_property
    def basis(self) -> Basis:
        """Canonical sparse self-stresses: of single loops, then (up to ``CONNECTING``) those that connect loops."""
        local = self.parts.of_loops(self.found)
        shared = self.found.shared
        if not shared:
            return basis_of(self.parts.count, local, [])
        if shared > CONNECTING:
            return basis_of(self.parts.count, local, self._places_of_sets())
        states = self.parts.table(pair_states(self.parts.here, self.found.connecting(np.eye(shared))))
        touched = np.flatnonzero(np.abs(states).max(axis=1) > UNIQUE * np.abs(states).max())
        number = np.array([self.parts.system.graph.n_loops])
        return basis_of(self.parts.count, [*local, (number, touched[None], states[touched][None])], [])

    def _places_of_sets(self) -> list[Index]:
        """For every set of connected loops the components there that are not unique."""
        loop, pair, _ = self.parts.system.graph.loop_steps
        home = np.full(self.parts.system.graph.n_loops, -1)
        sets = [loops for _, loops in self.found.sets if len(loops) > 1]
        for number, loops in enumerate(sets):
            home[list(loops)] = number
        loose = ~self.is_unique
        steps = [pair[home[loop] == number] for number in range(len(sets))]
        return [np.flatnonzero(loose & np.isin(self.parts.owners, pairs)) for pairs in steps]

    @property
    def groups(self) -> int:
        """Number of groups of self-stresses that share components."""
        return self.basis.groups

    @property
    def listed(self) -> int:
        """Number of self-stresses that can be listed: all but those that connect loops where these are more than ``CONNECTING``."""
        return len(self.basis.group)

    def first_states(self, count: int) -> tuple[SelfStress, ...]:
        """The first few self-stresses."""
        return tuple(self.basis.state(i, self.parts.labels) for i in range(min(count, self.listed)))

    @cached_property
    def states(self) -> tuple[SelfStress, ...]:
        """All self-stresses that can be listed."""
        return self.first_states(self.listed)

    @cached_property
    def _directions(self) -> tuple[tuple[UniqueDirection, ...], set[int]]:
        return unique_directions(self.parts, self.table)

    @property
    def transverse(self) -> tuple[UniqueDirection, ...]:
        """Directions of force and moment that are unique in a pair though its components are not."""
        return self._directions[0]

    @cached_property
    def _sums(self) -> tuple[tuple[tuple[int, str], ...], int]:
        return combinations(self.basis, self.parts.labels, self._directions[1])

    @property
    def combinations(self) -> tuple[tuple[int, str], ...]:
        """Per group the further sums of components that are unique although their terms are not, as text."""
        return self._sums[0]

    @property
    def unsought(self) -> int:
        """Number of groups in which such sums were not sought, as they have too many components."""
        return self._sums[1]


def uniqueness(
    here: Configuration, driven: Index, engine: EngineName = "auto", found: ClosureRank | None = None
) -> Uniqueness:
    """Which reaction components and efforts are unique: those in which no self-stress has a part, drivers in place.

    ``found``, where it is known, is the rank of the closure equations with the drivers at rest. The self-stresses are the null space
    of ``[J^T, -E]``: of ``J^T`` in the columns that are not driven.
    """
    parts = Components(here, driven)
    found = found or closure_rank(here, driven, engine)
    count = min(PROBES, found.count - found.rank)
    probes = found.random_stress(np.random.default_rng(SEED), count)
    coefficients = np.abs(here.system.coupling_matrix).max(axis=1, initial=0.0)
    multipliers = probes[6 * here.system.graph.n_loops :]
    return Uniqueness(parts, found, parts.table(pair_states(here, probes)), coefficients[:, None] * multipliers)


def pair_states(here: Configuration, rows: Array) -> Array:
    """Total pair wrenches ``(6, P, s, 1)`` of loop wrenches, the first of ``rows (rows, s)``: ``w = C^T x``."""
    return here.pair_wrenches(rows[: 6 * here.system.graph.n_loops, :, None])
