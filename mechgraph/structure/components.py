"""The reaction components and driver efforts of a mechanism in one row of numbers, and their parts in self-stresses.

A component is counted pair by pair in the order of declaration: the reaction components of the pair table, then the efforts of driven
freedoms. With the basis of all components and efforts of a pair at its point, ``w = [W, E] (lambda, tau)``, one inverse a pair gives
both.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index
from mechgraph.closure.rank import ClosureRank
from mechgraph.model.pair import Pair
from mechgraph.structure.reaction_split import PairFrames, at_pair_points

Label = tuple[str, str]


class Components:
    """Places of the components at one position; ``first (P + 1,)`` the first of every pair, ``count`` of them all."""

    def __init__(self, configuration: Configuration, driven: Index) -> None:
        self.configuration, self.system = configuration, configuration.system
        widths = np.diff(self.system.first_column)
        self._driven = np.zeros(self.system.n_freedoms, dtype=bool)
        self._driven[driven] = True
        owner = np.repeat(np.arange(len(widths)), widths)
        efforts = np.bincount(owner[self._driven], minlength=len(widths))
        self.first = np.concatenate([[0], np.cumsum(6 - widths + efforts)]).astype(np.intp)
        self.count = int(self.first[-1])

    @cached_property
    def owners(self) -> Index:
        """The pair of every component."""
        return np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))

    @property
    def efforts(self) -> Index:
        """Places of the driver efforts, which stand last in their pair."""
        last = self.first[1:] - self.first[:-1] - (6 - np.diff(self.system.first_column))
        some = np.flatnonzero(last)
        return np.concatenate(
            [np.arange(self.first[k + 1] - last[k], self.first[k + 1]) for k in some.tolist()] or [some]
        )

    @cached_property
    def labels(self) -> list[Label]:
        """(pair, component) of all components."""
        return [label for k in range(len(self.system.m.pairs)) for label in self._labels_of(k)]

    def label(self, i: int) -> Label:
        """(pair, component) of one of them."""
        k = int(np.searchsorted(self.first, i, side="right")) - 1
        return self._labels_of(k)[i - int(self.first[k])]

    def _labels_of(self, k: int) -> list[Label]:
        own = slice(*self.system.first_column[k : k + 2])
        return labels_of(self.system.m.pairs[k], np.flatnonzero(self._driven[own]))

    @cached_property
    def _rows(self) -> list[Array]:
        """For every group the inverses of ``[W, E]`` at the pair points ``(n, 6, 6)``."""
        return [inverse[:, 0] for inverse in PairFrames(self.configuration).dual]

    def _spread(self, g: int, pairs: Index, values: Array, out: Array, at: Index) -> None:
        """Components ``values (6, n, ...)`` of pairs of group ``g``, driven efforts last, into ``out`` from the rows ``at (n,)`` on."""
        group = self.system.groups[g]
        plain = 6 - group.row.f
        for j in range(plain):
            out[at + j] = values[j]
        place = at + plain
        columns = self.system.first_column[pairs]
        for j in range(group.row.f):
            on = self._driven[columns + j]
            out[place[on]] = values[plain + j][on]
            place = place + on

    def table(self, wrenches: Array) -> Array:
        """Parts ``(count, s)`` in total pair wrenches ``(6, P, s, 1)``."""
        local = at_pair_points(self.configuration, wrenches)[..., 0]
        out = np.zeros((self.count, wrenches.shape[2]))
        for g, (group, inverse) in enumerate(zip(self.system.groups, self._rows, strict=True)):
            values = np.einsum("nij,jns->ins", inverse, local[:, group.pairs])
            self._spread(g, group.pairs, values, out, self.first[group.pairs])
        return out

    def of_loops(self, closure: ClosureRank) -> list[tuple[Index, Index, Array]]:
        """Self-stresses of single loops, loops of one shape together: loops ``(n,)``, places ``(n, c)`` and parts ``(n, c, s)``."""
        some, wrenches, counts = closure.local
        if not some.size:
            return []
        loop, pair, sign = self.system.graph.loop_steps
        number = np.full(self.system.graph.n_loops, -1)
        number[some] = np.arange(some.size)
        mine = np.flatnonzero(number[loop] >= 0)
        order = np.lexsort((pair[mine], number[loop[mine]]))
        steps, loops = mine[order], number[loop[mine[order]]]
        width = np.diff(self.first)[pair[steps]]
        starts = np.concatenate([[0], np.cumsum(width)])
        values = self._along(pair[steps], sign[steps] * wrenches[:, :, loops], loop[steps], starts[:-1])
        within = np.arange(starts[-1]) - np.repeat(starts[:-1], width)
        places = np.repeat(self.first[pair[steps]], width) + within
        begin = starts[np.searchsorted(loops, np.arange(some.size + 1))]
        out = []
        shapes = np.stack([np.diff(begin), counts], axis=1)
        for c, s in np.unique(shapes, axis=0):
            mine = np.flatnonzero((shapes == (c, s)).all(axis=1))
            at = begin[mine][:, None] + np.arange(c)
            out.append((some[mine], places[at], values[at][:, :, :s]))
        return out

    def _along(self, pairs: Index, wrenches: Array, loop: Index, at: Index) -> Array:
        """Parts ``(all places, 6)`` in wrenches ``(6, 6 states, steps)`` of pairs in loops, each from its place ``at`` on."""
        s = self.system
        out = np.zeros((int(at[-1] + np.diff(self.first)[pairs[-1]]), 6))
        points = (self.configuration.pair_points[:, pairs] - self.configuration.middles[:, loop])[:, :, 0]
        local = wrenches.copy()
        local[:3] -= np.cross(points[:, None], wrenches[3:], axis=0)
        group = np.empty(len(s.m.pairs), dtype=np.intp)
        for g, members in enumerate(s.groups):
            group[members.pairs] = g
        group = group[pairs]
        for g, inverse in enumerate(self._rows):
            mine = np.flatnonzero(group == g)
            place = np.searchsorted(s.groups[g].pairs, pairs[mine])
            self._spread(g, pairs[mine], np.einsum("nij,jsn->ins", inverse[place], local[:, :, mine]), out, at[mine])
        return out


def labels_of(pair: Pair, driven: Index) -> list[Label]:
    """(pair, component) of the reaction components of a pair, then of the efforts of its freedoms ``driven`` (numbers)."""
    out = [(pair.name, name) for name in pair.type.component_names]
    if len(driven) == 1:
        return [*out, (pair.name, "effort")]
    return out + [(pair.name, f"effort {pair.type.freedoms[j].name}") for j in driven]
