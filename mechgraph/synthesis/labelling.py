"""Start sets of tasks in canonical order: one serves whatever the order of links, pairs, unknowns, and of the links of a pair."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Hashable
from functools import cached_property

import numpy as np

from mechgraph.graph.chains import least_order, ranked
from mechgraph.maths.se3 import Index
from mechgraph.modes.family import Array, same_back
from mechgraph.synthesis.classes import ClassMember, TaskClass
from mechgraph.synthesis.system import RowNumbers
from mechgraph.variants.numbers import MARKER


class TaskLabelling:
    """Links and pairs of a class of tasks in canonical order; ``turned (P,)`` are pairs whose links change places there."""

    def __init__(self, of: TaskClass) -> None:
        self.of, self._whole, s = of, of.whole.whole, of.whole.system
        links = self._whole.link_names()
        matrix, self._labels = ranked(self._graph(links))
        order = least_order(matrix)
        self._code = [matrix[u][v] for u in order for v in order]
        place = np.argsort(order)
        P = len(self._whole.pairs)
        # the pairs of the problem, in which those of rods stand last
        own = of.problem.order
        self.pairs: Index = np.argsort(place[len(links) :][own])
        turned = [self._may_turn(k) and bool(place[s.a[k]] > place[s.b[k]]) for k in range(P)]
        self.turned = np.array(turned, dtype=bool)[own]

    @property
    def key(self) -> str:
        """What a start set serves for: topology, unknowns, what is asked where, and the groups in which loops move."""
        told = [
            self._code,
            [repr(label) for label in self._labels],
            self.of.conditions.tolist(),
            self.of.problem.rows.tolist(),
        ]
        # the first figure is the version of the files
        return "3-" + hashlib.sha256(json.dumps(told).encode()).hexdigest()[:32]

    # --- the graph ---------------------------------------------------------------------------------------------------

    def _may_turn(self, k: int) -> bool:
        """Whether nothing tells one link of a pair from the other; rates of rotations are told from the first."""
        pair = self._whole.pairs[k]
        plain = pair.on_a is None and pair.contact is None and not self._whole.couplings
        rated = bool(self.of.problem.rates) and any(step.holds_rotation for step in pair.type.steps)
        return plain and not rated and same_back(pair.type)

    def _graph(self, links: tuple[str, ...]) -> list[list[Hashable]]:
        """What stands at nodes and between them."""
        n, s = len(links), self.of.whole.system
        out: list[list[Hashable]] = [[()] * (n + len(self._whole.pairs)) for _ in range(n + len(self._whole.pairs))]
        for i, link in enumerate(links):
            out[i][i] = ("link", link == self._whole.frame)
        for k in range(len(self._whole.pairs)):
            out[n + k][n + k] = ("pair", *self._pair(k))
            sides = ("end", "end") if self._may_turn(k) else ("a", "b")
            for side, link in zip(sides, (s.a[k], s.b[k]), strict=True):
                out[n + k][link] = out[link][n + k] = (side,)
        return out

    def _pair(self, k: int) -> tuple[Hashable, ...]:
        """What is known of a pair: its motions, what is asked of them and unknown of its place, and how that may be moved."""
        of, p, pair = self.of, self.of.whole, self._whole.pairs[k]
        place = int(np.argsort(of.problem.order)[k])
        freedoms = [(step.holds_rotation, *((f.label, *f.twist) for f in step.freedoms)) for step in pair.type.steps]
        first = p.system.first_column
        asked = [
            tuple(of.given[:, np.flatnonzero(p.asked_columns == c + order * p.system.n_freedoms)].any(axis=1).tolist())
            for c in range(first[k], first[k + 1])
            for order in range(1 + len(p.rates))
        ]
        factors = p.factor_of[p.system.pair_of_freedom[p.asked_columns % p.system.n_freedoms] == k]
        asked += [("scaled", *factors.tolist())] if (factors >= 0).any() else []
        unknown = sorted((q.array, q.side, q.component) for own in p.places for q in own if q.pair == k)
        B = of.algebras[place]
        # decimals that a class keeps of the motions by which markers may be moved
        moves: object = (np.round(B @ B.T, 5) + 0.0).tolist() if 0 < B.shape[1] < 6 else B.shape[1]
        lines = p.system.coupling_matrix[:, first[k] : first[k + 1], 0].tolist()
        return (
            repr(freedoms),
            tuple(asked),
            tuple(unknown),
            repr(moves),
            pair.on_a is None,
            repr(pair.contact),
            repr(lines),
            # rods have no states
            place < len(of.problem.whole.pairs),
        )

    # --- start sets --------------------------------------------------------------------------------------------------

    def _side(self, values: Array) -> Array:
        """``(2, ..., P)`` with the sides of pairs that turn exchanged."""
        return np.where(self.turned, values[::-1], values)

    @cached_property
    def _unknowns(self) -> Index:
        """For every unknown in canonical order its number."""
        place = np.argsort(self.pairs)
        told = [
            sorted((int(place[q.pair]), (*MARKER, "factor").index(q.array), q.side, q.component) for q in own)
            for own in self.of.problem.places
        ]
        return np.array(sorted(range(len(told)), key=told.__getitem__), dtype=np.intp)

    @cached_property
    def _asked(self) -> tuple[Index, Array]:
        """For every number that is asked, in canonical order, its place and its sign."""
        s, of = self.of.problem.system, self.of
        pair, place = s.pair_of_freedom[of.columns % s.n_freedoms], np.argsort(self.pairs)
        order = np.lexsort([of.columns % s.n_freedoms, place[pair], of.columns // s.n_freedoms])
        return order, np.where(self.turned, -1.0, 1.0)[pair[order]]

    @cached_property
    def _states(self) -> tuple[Index, Array]:
        """For every number of a state in canonical order its place and its sign."""
        of, s, P = self.of, self.of.problem.system, len(self.of.problem.whole.pairs)
        sign = np.ones(of.nx)
        rows = [np.arange(s.first_row[k], s.first_row[k + 1]) for k in range(P)]
        columns = [np.arange(s.first_column[k], s.first_column[k + 1]) for k in range(P)]
        orders = range(len(of.problem.rates))
        for k in np.flatnonzero(self.turned[:P]):
            sign[[*rows[k], *(of.states + i * s.n_freedoms + c for i in orders for c in columns[k])]] = -1.0
        if s.rotations is not None:
            sign[s.rotations[1][0]] = 1.0
        pairs = self.pairs[self.pairs < P]
        own = [rows[k] for k in pairs] + [of.states + i * s.n_freedoms + columns[k] for i in orders for k in pairs]
        row = np.concatenate([*own, np.zeros(0, dtype=np.intp)]).astype(np.intp)
        norms = np.arange(of.W).reshape(2, 2, -1) if of.W else np.zeros((2, 2, 0), dtype=np.intp)
        if of.W:
            norms = np.where(self.turned, norms[:, ::-1], norms)[:, :, self.pairs]
        every = [self._unknowns, of.u + norms.ravel(), *(of.head + i * of.nx + row for i in range(of.R))]
        return np.concatenate(every), np.concatenate([np.ones(of.head), *[sign[row]] * of.R])

    def ordered(self, member: ClassMember, x: Array) -> dict[str, Array]:
        """Vectors of markers, values asked and states ``(nx, N)`` in canonical order."""
        order, sign = self._asked
        rows, signs = self._states
        out = {
            name: np.moveaxis(self._side(np.moveaxis(v, 2, -1)), -1, 2)[:, :, self.pairs]
            for name, v in zip(MARKER, member.numbers.vectors, strict=True)
        }
        return out | {"drive": sign[:, None] * member.drive[:, order], "x": signs[:, None] * x[rows]}

    def taken(self, vectors: dict[str, Array], drive: Array, x: Array) -> tuple[ClassMember, Array]:
        """A member and its states from those in canonical order."""
        order, sign = self._asked
        rows, signs = self._states
        back, own, states = np.argsort(self.pairs), np.empty_like(drive), np.empty_like(x)
        numbers = [np.moveaxis(self._side(np.moveaxis(vectors[name][:, :, back], 2, -1)), -1, 2) for name in MARKER]
        own[:, order], states[rows] = sign[:, None] * drive, signs[:, None] * x
        return ClassMember(RowNumbers.of(*numbers), own), states
