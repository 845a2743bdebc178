"""Rods in the closure equations of assemblies: two points at a distance as one row each, polynomial in the poses of the links.

    ((p_b - p_a)^2 - l^2) / 2 = 0

Members of a class have other points and lengths; the squares ``l^2`` stand behind the values of the drivers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import cast

import numpy as np

from mechgraph.algebra.se3 import Array as Reals
from mechgraph.algebra.se3 import cross, identity, rotate
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.point_rows import PointNumbers, PointRows
from mechgraph.closure.rows import Evaluated, PositionRows
from mechgraph.graph.linkgraph import LinkGraph
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.parameters import Parameters
from mechgraph.modes.family import SPAN, Array, Family
from mechgraph.numerics.linear import rank_of, singular_values
from mechgraph.numerics.tolerances import RANKS


class RodRows(PointRows):
    """``(d^2 - l^2) / 2`` of every rod, polynomial in the poses; ``length`` of the numbers holds the squares ``l^2``."""

    def lines(self, here: Evaluated) -> tuple[Reals, Reals]:
        """``phi (n, T)`` and ``W (6, n, T)`` with ``phi' = W . (V_b - V_a)``."""
        k = self.numbers
        A, B = here.poses.take(k.a, axis=2), here.poses.take(k.b, axis=2)
        p = rotate(B[:, :3], k.at_b) + B[:, 3]
        d = p - rotate(A[:, :3], k.at_a) - A[:, 3]
        return 0.5 * ((d * d).sum(axis=0) - k.length), np.concatenate([cross(p, d), d])


class RodSystem(System):
    """A mechanism with rows of rods behind its own; their points and squares of lengths are numbers as its markers are."""

    def __init__(self, m: Mechanism, graph: LinkGraph | None, par: Parameters, points: PointNumbers) -> None:
        super().__init__(m, graph, par)
        self.points = points

    @cached_property
    def rod_rows(self) -> RodRows:
        """The rows of rods."""
        none = np.full(len(self.points.a), -1)
        return RodRows(self.points, self.ways[:, self.pair_of_freedom], none, none)

    @cached_property
    def ways(self) -> Reals:
        """Pairs ``(n, P)`` between the links of every rod, with signs."""
        paths = np.zeros((len(self.m.links), len(self.m.pairs)))
        for pair, sign, parent, child in self.graph.tree:
            paths[child] = paths[parent]
            paths[child, pair] = sign
        return np.asarray(paths[self.points.b] - paths[self.points.a])

    def way(self, rod: int) -> list[tuple[int, int]]:
        """Pairs with their signs along the tree from link a of a rod to link b."""
        before = {child: (pair, sign, parent) for pair, sign, parent, child in self.graph.tree}
        ways: list[list[tuple[int, int]]] = []
        for link in (int(self.points.a[rod]), int(self.points.b[rod])):
            steps = []
            while link in before:
                pair, sign, link = before[link]
                steps.append((pair, sign))
            ways.append(steps)
        up, down = ways
        while up and down and up[-1] == down[-1]:
            up.pop()
            down.pop()
        return [(pair, -sign) for pair, sign in up] + down[::-1]

    @cached_property
    def position_rows(self) -> Sequence[PositionRows]:
        """Those of loops and of rods."""
        return [*self.rows, self.rod_rows]

    def with_points(self, points: PointNumbers) -> RodSystem:
        """The same with other points and lengths; all else that is known of it is taken over."""
        out = RodSystem(self.m, self.graph, self.par, points)
        for name in ("numbers", "ways"):
            vars(out)[name] = getattr(self, name)
        return out

    def with_parameters(self, par: Parameters) -> RodSystem:
        """The same with other markers."""
        out = RodSystem(self.m, self.graph, par, self.points)
        vars(out)["ways"] = self.ways
        return out


class RodFamily(Family):
    """The class of a mechanism with rods: points that are one on a body stay one, all else of points and lengths is free.

    ``same (2 n,)`` are numbers that points which are one share; left out, points at the same place of a link are one.
    """

    system: RodSystem

    def __init__(
        self, here: Configuration, columns: Index, idle: Array, held: Index, same: Index | None = None
    ) -> None:
        super().__init__(here, columns, idle, held)
        k, self._same = self.system.points, same
        self.rods = len(k.a)
        self.bearers = np.concatenate([self.bearers, k.a, k.b])
        points = identity(2 * self.rods, 1).astype(complex)
        points[:, 3] = np.concatenate([k.at_a, k.at_b], axis=1)
        self.target = np.concatenate([self.target, points], axis=2)

    @cached_property
    def joints(self) -> Index:
        """For every point ``(2 n,)``, those on links a first, the first one that is the same point of the same link."""
        if self._same is not None:
            return np.asarray(np.argmax(self._same[:, None] == self._same, axis=1))
        k = self.system.points
        links, at = np.concatenate([k.a, k.b]), np.concatenate([k.at_a, k.at_b], axis=1)[:, :, 0]
        same = (np.abs(at[:, :, None] - at[:, None]).max(axis=0) < SPAN) & (links[:, None] == links)
        return np.asarray(np.argmax(same, axis=0))

    @property
    def points(self) -> list[list[int]]:
        """See there."""
        return [self.system.points.a.tolist(), self.system.points.b.tolist(), self.joints.tolist()]

    @cached_property
    def algebras(self) -> list[Array]:
        """Markers of pairs that no loop holds may go anywhere."""
        held = {pair for loop in self.system.graph.loops for pair, _ in loop}
        return [basis if pair in held else np.eye(6) for pair, basis in enumerate(super().algebras)]

    @property
    def bases(self) -> list[Array]:
        """Points go along all directions."""
        return [*super().bases, *[np.eye(6)[:, 3:]] * (2 * self.rods)]

    @property
    def moved_as(self) -> Index:
        """Points that are one move as one."""
        markers = super().moved_as
        return np.concatenate([markers, len(markers) + self.joints])

    @property
    def rank(self) -> int:
        """That of the loops, and one a rod."""
        return super().rank + self.rods

    @property
    def independent(self) -> bool:
        """See there."""
        return rank_of(singular_values(self.here.J[:, self.free, 0]), RANKS.position) == self.rank

    def system_with(self, markers: Array, drive: Array) -> System:
        """The system with other markers and points ``(3, 4, 2 P + 2 n, B)``, and squares of lengths behind the drivers."""
        n, s = self.rods, self.system
        at = markers[:, 3, -2 * n :]
        points = replace(s.points, at_a=at[:, :n], at_b=at[:, n:], length=drive[-n:])
        if self.still:
            return s.with_points(points)
        moved = super().system_with(markers[:, :, : -2 * n], drive)
        return cast("RodSystem", moved).with_points(points)

    @cached_property
    def still(self) -> bool:
        """Whether members have the same markers, as all pairs that are left float."""
        return not any(basis.size for basis in self.moving)

    def drive_of(self, markers: Array, x: Array) -> Array:
        """Drivers, and squares of the lengths that the points have."""
        here = Configuration(self.system_with(markers, np.zeros((self.rods, 1))), x)
        return np.concatenate([super().drive_of(markers, x), 2.0 * _rows(here).residual(here)])

    def random_drive(self, rng: np.random.Generator) -> Array:
        """Random drivers and squares of lengths."""
        squares = 2.0 * rng.normal(size=(self.rods, 2)) @ [1.0, 1.0j]
        return np.concatenate([super().random_drive(rng), squares])

    def lengths_of(self, drive: Array) -> Array:
        """See there."""
        return np.concatenate([np.zeros_like(drive[: -self.rods]), drive[-self.rods :]])

    def open_by(self, here: Configuration, V: Array, change: Array) -> Array:
        """Points too open rows, and squares of lengths do."""
        n, P = self.rods, len(self.system.m.pairs)
        out = super().open_by(here, V[:, : -2 * n], change)
        W = _rows(here).lines(here)[1]
        moved = np.einsum("np,ipt->int", self.system.ways, V[:, :P] - V[:, P : 2 * P]) + V[:, -n:] - V[:, -2 * n : -n]
        out[-n:] += (W * moved).sum(axis=0) - 0.5 * change[-n:]
        return out


def _rows(here: Configuration) -> RodRows:
    assert isinstance(here.system, RodSystem)
    return here.system.rod_rows
