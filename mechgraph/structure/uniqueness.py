"""Self-stresses at a position: which reaction components and efforts are unique, which only in some direction or combination."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.contact_lines import ContactLines
from mechgraph.closure.indexing import Index
from mechgraph.closure.rank import ClosureRank, EngineName, closure_rank
from mechgraph.closure.sparse_solver import PROBES, SEED
from mechgraph.numerics.tolerances import STRESSES
from mechgraph.structure.components import Components
from mechgraph.structure.reaction_split import UNIQUE
from mechgraph.structure.self_stress import Basis, SelfStress, basis_of, combinations
from mechgraph.structure.unique_directions import UniqueDirection, unique_directions

BASIS = 48
"""Number of self-stresses up to which all of them tell what is unique; more are represented by random ones."""
CONNECTING = 200
"""Number of self-stresses that connect loops up to which they are computed; their echelon form is dense, of that width."""


@dataclass(frozen=True, repr=False)
class Uniqueness:
    """The verdict on reactions at one position; what is expensive is computed when first asked for.

    ``closure`` are the closure equations with the drivers at rest, ``table (components, probes)`` the parts of the components in
    self-stresses of size one in the measure of every loop, so that the verdict does not depend on how many loops there are: in an
    orthonormal basis of them, or in random ones where they are many; ``coupled (couplings, probes)`` the greatest effort of every
    coupling in them; ``probes`` are these self-stresses in the closure rows.
    """

    components: Components
    closure: ClosureRank
    table: Array
    coupled: Array
    probes: Array

    def __repr__(self) -> str:
        return f"Uniqueness({int(self.is_unique.sum())} of {len(self.is_unique)} components unique, {self.count} self-stresses)"

    @property
    def count(self) -> int:
        """Number of self-stresses with the drivers in place."""
        return self.closure.count - self.closure.rank

    @cached_property
    def sizes(self) -> Array:
        """Part in the self-stresses of every component, in the order of ``components.labels``, and then of every coupling."""
        return np.sqrt((np.concatenate([self.table, self.coupled]) ** 2).sum(axis=1))

    @property
    def is_unique(self) -> NDArray[np.bool_]:
        """Whether each component is unique, in the order of ``components.labels``."""
        return self.sizes[: self.components.count] <= UNIQUE

    @property
    def coupling_is_unique(self) -> NDArray[np.bool_]:
        """Whether the multiplier of each coupling is unique, in order of declaration."""
        return self.sizes[self.components.count :] <= UNIQUE

    def is_unique_on(self, twists: Array) -> bool:
        """Whether the power of every pair's total wrench on ``twists (6, n)`` about the internal origin is unique, and every multiplier."""
        states = _on_every_flank(self.components.configuration, self.probes)
        power = np.einsum("in,ips->nps", twists, np.concatenate(states, axis=2)[..., 0])
        return bool(np.abs(power).max(initial=0.0) <= UNIQUE and self.coupling_is_unique.all())

    @property
    def all_unique(self) -> bool:
        """Whether every reaction component, effort and multiplier is unique."""
        return bool((self.sizes <= UNIQUE).all())

    @property
    def margin(self) -> float:
        """Smallest part of a self-stress in what is not unique; 1 where all is."""
        return float(self.sizes[self.sizes > UNIQUE].min(initial=1.0))

    @property
    def dropped(self) -> float:
        """Largest part of a self-stress in what is called unique."""
        return float(self.sizes[self.sizes <= UNIQUE].max(initial=0.0))

    @property
    def is_near(self) -> bool:
        """Whether a small change of dimensions may change what is unique at the same rank: parts come continuously from zero."""
        return self.margin < STRESSES.near or self.dropped > STRESSES.doubt

    @property
    def most_doubtful(self) -> tuple[str, float, bool]:
        """What has the part nearest to the limit (by ratio): its name, this part, and whether it is called unique."""
        size = np.maximum(self.sizes, np.finfo(float).tiny)
        i = int(np.argmin(np.abs(np.log(size / UNIQUE))))
        known = self.components
        behind = i - known.count
        name = ":".join(known.label(i)) if behind < 0 else f"coupling {known.system.m.couplings[behind].name}"
        return name, float(self.sizes[i]), bool(self.sizes[i] <= UNIQUE)

    @cached_property
    def unique(self) -> dict[str, dict[str, bool]]:
        """Pair -> component -> whether it is unique; ``effort`` (or ``effort Tz``) for driven freedoms and for couplings."""
        out: dict[str, dict[str, bool]] = {pair.name: {} for pair in self.components.system.m.pairs}
        for (pair, name), ok in zip(self.components.labels, self.is_unique.tolist(), strict=True):
            out[pair][name] = ok
        for coupling, ok in zip(self.components.system.m.couplings, self.coupling_is_unique.tolist(), strict=True):
            out[coupling.name] = {"effort": ok}
        return out

    @cached_property
    def basis(self) -> Basis:
        """Canonical sparse self-stresses: of single loops, then (up to ``CONNECTING``) those that connect loops."""
        local = self.components.of_loops(self.closure)
        shared = self.closure.shared
        if not shared:
            return basis_of(self.components.count, local, [])
        if shared > CONNECTING:
            return basis_of(self.components.count, local, self._places_of_sets())
        states = self.components.table(
            relieved_states(self.components.configuration, self.closure.connecting(np.eye(shared)), 1.0)
        )
        touched = np.flatnonzero(np.abs(states).max(axis=1) > UNIQUE * np.abs(states).max())
        number = np.array([self.components.system.graph.n_loops])
        return basis_of(self.components.count, [*local, (number, touched[None], states[touched][None])], [])

    def _places_of_sets(self) -> list[Index]:
        """For every set of connected loops the components there that are not unique."""
        loop, pair, _ = self.components.system.graph.loop_steps
        home = np.full(self.components.system.graph.n_loops, -1)
        sets = [loops for _, loops in self.closure.sets if len(loops) > 1]
        for number, loops in enumerate(sets):
            home[list(loops)] = number
        loose = ~self.is_unique
        steps = [pair[home[loop] == number] for number in range(len(sets))]
        return [np.flatnonzero(loose & np.isin(self.components.owners, pairs)) for pairs in steps]

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
        return tuple(self.basis.state(i, self.components.labels) for i in range(min(count, self.listed)))

    @cached_property
    def states(self) -> tuple[SelfStress, ...]:
        """All self-stresses that can be listed."""
        return self.first_states(self.listed)

    @cached_property
    def _directions(self) -> tuple[tuple[UniqueDirection, ...], set[int]]:
        return unique_directions(self.components, self.table)

    @property
    def unique_directions(self) -> tuple[UniqueDirection, ...]:
        """Directions of force and moment that are unique in a pair though its components are not."""
        return self._directions[0]

    @cached_property
    def _sums(self) -> tuple[tuple[tuple[int, str], ...], int]:
        return combinations(self.basis, self.components.labels, self._directions[1])

    @property
    def combinations(self) -> tuple[tuple[int, str], ...]:
        """Per group the further sums of components that are unique although their terms are not, as text."""
        return self._sums[0]

    @property
    def unsought(self) -> int:
        """Number of groups in which such sums were not sought, as they have too many components."""
        return self._sums[1]


def uniqueness(
    here: Configuration, driven: Index, engine: EngineName = "auto", closure: ClosureRank | None = None
) -> Uniqueness:
    """Which reaction components and efforts are unique: those in which no self-stress has a part, drivers in place.

    ``closure``, where it is known, is the rank of the closure equations with the drivers at rest. The self-stresses are the null space
    of ``[J^T, -E]``: of ``J^T`` in the columns that are not driven.
    """
    components = Components(here, driven)
    closure = closure or closure_rank(here, driven, engine)
    few = closure.count - closure.rank <= BASIS
    probes = closure.orthonormal_stress() if few else closure.random_stress(np.random.default_rng(SEED), PROBES)
    coefficients = np.abs(here.system.coupling_matrix[:, :, 0]).max(axis=1, initial=0.0)
    multipliers = probes[6 * here.system.graph.n_loops :]
    states = _on_every_flank(here, probes)
    table = np.concatenate([components.table(one) for one in states], axis=1)
    return Uniqueness(components, closure, table, np.tile(coefficients[:, None] * multipliers, len(states)), probes)


def pair_states(here: Configuration, rows: Array) -> Array:
    """Total pair wrenches ``(6, P, s, 1)`` of loop wrenches, the first of ``rows (rows, s)``: ``w = C^T x``."""
    return here.pair_wrenches(rows[: 6 * here.system.graph.n_loops, :, None])


def _on_every_flank(here: Configuration, rows: Array) -> list[Array]:
    """``relieved_states`` on both flanks of gears: what is unique must be so on either; where there are none, these are the same."""
    return [relieved_states(here, rows, flank) for flank in ((1.0, -1.0) if ContactLines(here) else (1.0,))]


def relieved_states(here: Configuration, rows: Array, flank: float) -> Array:
    """The same less what gears transmit that touch each other on one flank (sign 1 or -1), ``(6, P, s, 1)``."""
    states, lines = pair_states(here, rows), ContactLines(here)
    multipliers = -rows[6 * here.system.graph.n_loops :, :, None]
    return states - lines.relief(multipliers, np.full((len(multipliers), here.T), flank)) if lines else states
