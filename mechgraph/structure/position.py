"""The pairs of a mechanism at one position: as declared, or with other types at some pairs and without some couplings.

Rank, motions and passive freedoms follow from the closure rows and the place of every pair. So a change needs no new mechanism: its
twists take the place of those declared, at the same frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index
from mechgraph.closure.loop_rows import ClosureRows
from mechgraph.graph.linkgraph import LinkGraph
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.linear import complement
from mechgraph.pairs import kinematics as evaluation
from mechgraph.pairs.pair_type import PairType


@dataclass(frozen=True)
class PlacedPair:
    """One pair where it stands: ``pitch (1, 1)``, frame 0 ``(3, 4, 1)`` about the internal origin, state numbers ``(nx, 1)``."""

    type: PairType
    pitch: Array
    frame: Array
    x: Array

    @classmethod
    def at_zero(cls, type: PairType, frame: Array) -> PlacedPair:
        """A pair of a type without pitch with its coordinates zero in ``frame (3, 4)``."""
        x = evaluation.coordinates_to_state(type, np.zeros((type.f, 1)))
        return cls(type, np.zeros((1, 1)), frame[:, :, None], x)

    @cached_property
    def twists(self) -> Array:
        """Twists ``(6, f)`` of its freedoms."""
        x = self.x[:, None]
        frames = evaluation.frames_of(self.type, self.pitch, x, self.frame[:, :, None])
        return evaluation.twists_of(self.type, self.pitch, frames, x)[:, :, 0, 0]


@dataclass(frozen=True)
class Position:
    """Closure ``rows`` and pairs at the first position of a configuration; ``changed`` pairs stand in place of those declared."""

    declared: Configuration
    rows: ClosureRows
    changed: Mapping[int, PlacedPair] = field(default_factory=dict)

    @classmethod
    def at(cls, here: Configuration) -> Position:
        """The pairs as declared."""
        return cls(here, ClosureRows.at(here))

    @property
    def m(self) -> Mechanism:
        """The mechanism as declared."""
        return self.declared.system.m

    @property
    def graph(self) -> LinkGraph:
        """Links and pairs."""
        return self.rows.graph

    @property
    def n_freedoms(self) -> int:
        """Number of freedoms."""
        return self.rows.S.shape[1]

    def type_of(self, k: int) -> PairType:
        """The type of a pair."""
        return self.changed[k].type if k in self.changed else self.m.pairs[k].type

    def columns(self, k: int) -> range:
        """The columns of the freedoms of a pair."""
        return range(int(self.rows.first_column[k]), int(self.rows.first_column[k + 1]))

    def pair(self, k: int) -> PlacedPair:
        """A pair where it stands."""
        if k in self.changed:
            return self.changed[k]
        system, here = self.declared.system, self.declared
        number, i = system.place_of(k)
        group = system.groups[number]
        frame = here.frames[number][0][:, :, i, :1]
        return PlacedPair(group.row, system.par.pitch[k : k + 1], frame, here.x[group.state_rows[:, i], :1])

    @property
    def altered(self) -> bool:
        """Whether pairs or couplings are not those declared."""
        return bool(self.changed) or self.rows.count != self.declared.system.n_rows

    @cached_property
    def holding(self) -> NDArray[np.bool_]:
        """Which pairs ``(P,)`` hold something, by reactions or by a coupling."""
        held = np.zeros(self.n_freedoms, dtype=bool)
        if self.rows.more is not None:
            held[self.rows.more.indices] = True
        every = range(len(self.graph.ends))
        return np.array([bool(self.type_of(k).reactions) or held[self.columns(k)].any() for k in every], dtype=bool)

    @cached_property
    def drivable(self) -> NDArray[np.bool_]:
        """Which freedoms ``(F,)`` take a drive."""
        return np.array([d for k in range(len(self.m.pairs)) for d in self.type_of(k).drivable], dtype=bool)

    def with_changes(self, pairs: Mapping[int, PlacedPair], dropped: Index) -> tuple[Position, Index]:
        """Other ``pairs`` and without the couplings ``dropped``; also the new column of every freedom (-1 where it is gone).

        A freedom of a changed pair is the one of the same name in the new type.
        """
        old, width = self.rows.first_column, np.diff(self.rows.first_column)
        width[list(pairs)] = [pair.type.f for pair in pairs.values()]
        first = np.concatenate([[0], np.cumsum(width)]).astype(np.intp)
        column = np.arange(self.n_freedoms) + np.repeat(first[:-1] - old[:-1], np.diff(old))
        for k, pair in pairs.items():
            place = {f.name: int(first[k]) + j for j, f in enumerate(pair.type.freedoms)}
            column[self.columns(k)] = [place.get(f.name, -1) for f in self.type_of(k).freedoms]
        S = np.empty((6, int(first[-1])))
        stays = np.flatnonzero(column >= 0)
        S[:, column[stays]] = self.rows.S[:, stays]
        for k, pair in pairs.items():
            S[:, first[k] : first[k + 1]] = pair.twists
        more = self.rows.more
        if more is not None:
            kept = more[complement(dropped, self.rows.further)].tocoo()
            shape = (kept.shape[0], S.shape[1])
            more = scipy.sparse.csr_array((kept.data, (kept.row, column[kept.col])), shape=shape) if shape[0] else None
        rows = replace(self.rows, first_column=first, S=S, more=more)
        return Position(self.declared, rows, {**self.changed, **pairs}), column
