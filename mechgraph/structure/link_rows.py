"""What pairs and couplings ask of the motions of links, drivers at rest: rows in the twists of the links, in a frame of few directions.

With the relative twist ``V_b - V_a`` of a pair in the span of its free freedoms ``S``, its wrenches ``C`` (``C^T S = 0``) give the rows

    C^T T (v_b - v_a) = 0,      V = T v,

where ``T (6, b)`` holds the twists of the mechanism (b = 3 for a planar or spherical one, else 6). A coupling sum c_i q_i = 0 gives one
row, with q = S^+ (V_b - V_a).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.indexing import Index
from mechgraph.numerics.tolerances import RANKS
from mechgraph.structure.position import Position


@dataclass(frozen=True, eq=False)
class Constraint:
    """Rows ``(s, b)`` by link, s independent ones, of a pair (or a coupling) by its ``number`` (couplings count on from the pairs)."""

    number: int
    rows: Mapping[int, Array]

    @property
    def count(self) -> int:
        """Number of rows."""
        return next(iter(self.rows.values())).shape[0] if self.rows else 0


def rows_of_pair(S: Array, twists: Array) -> Array:
    """Rows ``(s, b)`` of the wrenches that free twists ``S (6, f)`` of a pair leave, in the directions ``twists (6, b)``."""
    wrenches = np.linalg.svd(S)[0][:, S.shape[1] :] if S.size else np.eye(6)
    _, s, Vt = np.linalg.svd(wrenches.T @ twists, full_matrices=False)
    return np.asarray(Vt[s > RANKS.position])


class Constraints:
    """Constraints between links whose motions have ``b`` directions."""

    def __init__(self, constraints: Iterable[Constraint], b: int) -> None:
        self.constraints = [c for c in constraints if c.count]
        self.b = b

    def matrix(self, links: Iterable[int], solved: Iterable[int]) -> Array:
        """Rows of all constraints among ``links`` and links ``solved`` before, in the ``links`` alone: ``(rows, b links)``."""
        mine = list(links)
        known = set(mine) | set(solved)
        blocks = [
            np.concatenate([c.rows.get(link, np.zeros((c.count, self.b))) for link in mine], axis=1)
            for c in self.constraints
            if known.issuperset(c.rows) and not c.rows.keys().isdisjoint(mine)
        ]
        return np.concatenate(blocks) if blocks else np.zeros((0, self.b * len(mine)))

    def moving(self, links: Iterable[int], solved: Iterable[int]) -> set[int]:
        """Which of ``links`` can still move when the links ``solved`` stand still and the others are away."""
        mine = list(links)
        A = self.matrix(mine, solved)
        if not A.size:
            return set(mine)
        _, s, Vt = np.linalg.svd(A)
        rank = int((s > RANKS.position * s[0]).sum()) if s.size else 0
        motions = Vt[rank:].reshape(-1, len(mine), self.b)
        still = np.abs(motions).max(axis=(0, 2), initial=0.0) < AT_REST
        return {link for link, at_rest in zip(mine, still, strict=True) if not at_rest}

    def determined(self, links: Iterable[int], solved: Iterable[int]) -> set[int]:
        """The largest set of ``links`` that stands still by the constraints among itself and the links ``solved``."""
        mine = set(links)
        while mine:
            moving = self.moving(sorted(mine), solved)
            if not moving:
                break
            mine -= moving
        return mine


class LinkRows(Constraints):
    """The constraints of a position with the freedoms ``fixed`` at rest, in the directions ``twists (6, b)``."""

    def __init__(self, position: Position, fixed: Index, twists: Array) -> None:
        self.position, self.twists = position, twists
        self._free = np.ones(position.n_freedoms, dtype=bool)
        self._free[fixed] = False
        super().__init__((*self.pairs, *self.couplings), twists.shape[1])

    def freedoms(self, k: int) -> Array:
        """Free twists ``(6, f)`` of a pair."""
        columns = np.array(self.position.columns(k), dtype=np.intp)
        return np.asarray(self.position.rows.S[:, columns[self._free[columns]]])

    @cached_property
    def pairs(self) -> list[Constraint]:
        """The constraints of all pairs."""
        out = []
        for k, (a, b) in enumerate(self.position.graph.ends):
            rows = rows_of_pair(self.freedoms(k), self.twists)
            out.append(Constraint(k, {a: -rows, b: rows}))
        return out

    @cached_property
    def couplings(self) -> list[Constraint]:
        """The constraints of rows behind those of the loops."""
        more = self.position.rows.more
        out = []
        for i in range(self.position.rows.further):
            coefficients = more[[i]].toarray()[0] * self._free  # type: ignore[index]
            rows: dict[int, Array] = {}
            for k, (a, b) in enumerate(self.position.graph.ends):
                mine = coefficients[list(self.position.columns(k))]
                if mine.any():
                    S = self.position.rows.S[:, list(self.position.columns(k))]
                    row = (mine @ np.linalg.pinv(S) @ self.twists)[None]
                    rows[a], rows[b] = rows.get(a, 0.0) - row, rows.get(b, 0.0) + row
            out.append(Constraint(len(self.position.graph.ends) + i, rows))
        return out


AT_REST = 1e-7
"""Part of a motion of size one below which a link stands still."""
