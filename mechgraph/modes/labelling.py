"""A class whatever the order of its declaration: links, pairs and rods by number alone, and start sets in that order.

Links, pairs, rods and the points at the ends of rods are the nodes of a graph, of which the canonical form is the class, see
``atlas.canonical``: names are left out, and which link of a pair is the first where its motions are a group that says as much the other
way round. A pair declared the other way round has its markers exchanged and the inverse of its motion: the coordinates of turns and slides
that commute change their signs, and so does the vector part of a rotation's quaternion.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Hashable
from functools import cached_property

import numpy as np

from mechgraph.algebra.se3 import compose, cross_twist, inverse
from mechgraph.graph.chains import least_order, ranked
from mechgraph.modes.family import SPAN, Array, Family, Member
from mechgraph.numerics.linear import Index
from mechgraph.pairs.pair_type import PairType

GEOMETRY_DIGITS, ALGEBRA_DIGITS = 9, 6
"""Decimals of numbers that a class keeps: of markers, over L, and of the motions by which they may be moved."""


class Labelling:
    """Links, pairs and rods of a class in canonical order."""

    def __init__(self, family: Family) -> None:
        self.family, self._system = family, family.system
        s = self._system
        self._P, self._n = len(s.m.pairs), len(family.bearers) // 2 - len(s.m.pairs)
        # links, pairs, rods, and points
        self._links = len(s.m.links)
        self._rods = self._links + self._P
        matrix, self._labels = ranked(self._graph())
        order = least_order(matrix)
        self._code = [matrix[u][v] for u in order for v in order]
        place = np.argsort(order)
        self.pairs: Index = np.argsort(place[self._links : self._rods])
        self.rods: Index = np.argsort(place[self._rods : self._rods + self._n])
        may = np.array([_same_back(pair.type) for pair in s.m.pairs], dtype=bool)
        self._turned = may & (place[s.a] > place[s.b])
        ends = place[family.bearers[2 * self._P :]].reshape(2, self._n)
        points = place[self._points].reshape(2, self._n)
        self._rods_turned = np.where(ends[0] == ends[1], points[0] > points[1], ends[0] > ends[1])

    @cached_property
    def key(self) -> str:
        """What a start set serves for, without what its files are."""
        family = self.family
        parts = [self._code, [repr(label) for label in self._labels], family.rank, family.passive.shape[1]]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()

    # --- the graph ---------------------------------------------------------------------------------------------------

    @cached_property
    def _points(self) -> Index:
        """The node of the point at each end ``(2 n,)`` of the rods."""
        joints = self.family.points[2] if self._n else []
        return self._rods + self._n + np.unique(joints, return_inverse=True)[1].astype(np.intp).reshape(-1)

    @cached_property
    def _still(self) -> Array:
        """The markers where the class is told, in the global frame, as far as it keeps them."""
        return np.round(compose(self._gauge, self.family.target)[..., 0].real, GEOMETRY_DIGITS) + 0.0

    @cached_property
    def _gauge(self) -> Array:
        """Poses ``(3, 4, markers, 1)`` of the frames in which markers are kept: links' own, or the global one where relations are kept."""
        poses = self.family.here.poses[:, :, self.family.bearers, :1]
        return np.broadcast_to(np.eye(3, 4)[:, :, None, None], poses.shape) if self.family.whole else poses

    def _geometry(self, marker: int) -> Hashable:
        """What a class keeps of a marker; of a point its place."""
        if self.family.whole:
            return ()
        kept = self._still[:, :, marker] if marker < 2 * self._P else self._still[:, 3, marker]
        return tuple(kept.ravel().tolist())

    def _graph(self) -> list[list[Hashable]]:
        """What stands at nodes and between them."""
        family, s = self.family, self._system
        nodes = self._rods + self._n + len(set(self._points.tolist()))
        out: list[list[Hashable]] = [[()] * nodes for _ in range(nodes)]

        def join(u: int, v: int, *label: Hashable) -> None:
            out[u][v] = out[v][u] = tuple(sorted([*(out[u][v] or ()), label], key=repr))  # type: ignore[misc]

        # from where it is seen what tells assemblies apart that something idle leaves alone
        seen = s.graph.frame if family.idle.shape[1] else -1
        for i in range(self._links):
            out[i][i] = ("link", i == seen)
        for k, ends in enumerate(s.graph.ends):
            out[self._links + k][self._links + k] = ("pair", *self._pair(k))
            sides = ("end", "end") if _same_back(s.m.pairs[k].type) else ("a", "b")
            for marker, side, link in zip((k, self._P + k), sides, ends, strict=True):
                join(self._links + k, link, side, self._geometry(marker))
        for i, (point, link) in enumerate(
            zip(self._points.tolist(), family.bearers[2 * self._P :].tolist(), strict=True)
        ):
            rod = self._rods + i % self._n
            out[rod][rod] = ("rod",)
            out[point][point] = ("point", self._geometry(2 * self._P + i))
            out[point][link] = out[link][point] = ("of",)
            join(rod, point, "end")
        return out

    def _pair(self, k: int) -> tuple[Hashable, ...]:
        """What is known of a pair: its motions, which of them are given or rest, and how its markers may be moved."""
        family, s = self.family, self._system
        columns = range(s.first_column[k], s.first_column[k + 1])
        freedoms = [
            (step.holds_rotation, *((f.label, *f.twist) for f in step.freedoms)) for step in s.m.pairs[k].type.steps
        ]
        B = family.algebras[k]
        algebra = () if family.whole else (np.round(B @ B.T, ALGEBRA_DIGITS) + 0.0).ravel().tolist()
        given, rest = ([c in of.tolist() for c in columns] for of in (family.columns, family.held))
        return (tuple(freedoms), tuple(given), tuple(rest), tuple(algebra))

    # --- start sets --------------------------------------------------------------------------------------------------

    @cached_property
    def _markers(self) -> Index:
        """For every marker in canonical order its number in the class."""
        both = [
            np.where(turned, [second, first], [first, second])[:, order]
            for turned, first, second, order in (
                (self._turned, np.arange(self._P), self._P + np.arange(self._P), self.pairs),
                (
                    self._rods_turned,
                    2 * self._P + np.arange(self._n),
                    2 * self._P + self._n + np.arange(self._n),
                    self.rods,
                ),
            )
        ]
        return np.concatenate([both[0].ravel(), both[1].ravel()])

    @cached_property
    def _rows(self) -> tuple[Index, Array]:
        """For every state row in canonical order its number in the class, and its sign there."""
        s = self._system
        sign = np.ones(s.n_state)
        for k in np.flatnonzero(self._turned).tolist():
            sign[s.first_row[k] : s.first_row[k + 1]] = -1.0
        if s.rotations is not None:
            sign[s.rotations[1][0]] = 1.0
        rows = [np.arange(s.first_row[k], s.first_row[k + 1]) for k in self.pairs.tolist()]
        order = np.concatenate([*rows, np.zeros(0, dtype=np.intp)]).astype(np.intp)
        return order, sign[order]

    def ordered(self, member: Member, x: Array) -> dict[str, Array]:
        """Markers, squares of lengths and states ``(nx, N)`` of a member in canonical order; values of drivers are in the states."""
        rows, sign = self._rows
        return {
            "markers": compose(self._gauge, member.markers)[:, :, self._markers],
            "squares": member.drive[len(member.drive) - self._n :][self.rods],
            "x": sign[:, None] * x[rows],
        }

    def taken(self, markers: Array, squares: Array, x: Array) -> tuple[Member, Array]:
        """A member and its states from those in canonical order."""
        rows, sign = self._rows
        own, out, drive = np.empty_like(markers), np.empty_like(x), np.empty_like(squares)
        own[:, :, self._markers] = markers
        own = compose(inverse(self._gauge), own)
        own[:, :3, 2 * self._P :] = np.eye(3)[:, :, None, None]
        out[rows] = sign[:, None] * x
        drive[self.rods] = squares
        return Member(own, np.concatenate([out[self.family.rows, :1], drive])), out


def _same_back(row: PairType) -> bool:
    """Whether a pair is the same with its links exchanged: turns and slides that commute, or a rotation and nothing else."""
    if len(row.steps) == 1 and row.steps[0].holds_rotation:
        return True
    S = np.array([f.twist for f in row.freedoms]).reshape(-1, 6).T
    n = S.shape[1]
    return bool(np.abs(cross_twist(np.repeat(S, n, axis=1), np.tile(S, (1, n)))).max(initial=0.0) < SPAN)
