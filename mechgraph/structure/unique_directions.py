"""Directions in which the force or moment of a pair is unique though its components are not.

``Fx`` and ``Fy`` in an arbitrary marker frame may both be called not unique where only the force in one direction across the axis
is. So the components of one kind in one frame are taken as a vector; the directions in which no self-stress has a part are found
and named. Pairs of one type with the same components in doubt are decomposed together.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import Array, null_space
from mechgraph.closure.indexing import Index
from mechgraph.pairs.factors import Component
from mechgraph.structure.components import Components
from mechgraph.structure.reaction_split import UNIQUE

ZERO_ENTRY = 5e-13
"""Entry of a unit direction that counts as zero for its sign."""


@dataclass(frozen=True)
class UniqueDirection:
    """Force or moment of ``pair`` that is unique along ``direction`` or (``across``) in every direction across it.

    ``direction`` in the axes of the marker frame in which the components stand, first entry that is not zero positive;
    ``in_space`` the same in the global frame.
    """

    pair: str
    kind: str
    direction: tuple[float, ...]
    across: bool
    in_space: tuple[float, ...]

    @property
    def text(self) -> str:
        """E.g. ``D: force along (0.6, 0.8, 0) is unique``."""
        shown = ", ".join(f"{0.0 if abs(v) < 5e-7 else v:.4g}" for v in self.direction)
        return f"{self.pair}: {self.kind} {'across' if self.across else 'along'} ({shown}) is unique"


def unique_directions(components: Components, table: Array) -> tuple[tuple[UniqueDirection, ...], set[int]]:
    """Directions unique in a pair though its components are not; and components that these make known from others.

    ``table (components, s)`` are the parts of the components in the self-stresses.
    """
    not_unique = (table**2).sum(axis=1) > UNIQUE**2
    named: list[tuple[tuple[int, int], UniqueDirection]] = []
    known: set[int] = set()
    for g, group in enumerate(components.system.groups):
        for order, ((frame, kind), axes, numbers) in enumerate(_vectors(group.row.reactions or ())):
            rows = components.first[group.pairs][:, None] + numbers
            for some, mine in _alike(not_unique[rows]):
                for i, unique in zip(some, _directions(table[rows[np.ix_(some, mine)]]), strict=True):
                    if unique.shape[1]:
                        pair = int(group.pairs[i])
                        R = components.configuration.frames[g][frame][:, :3, i, 0]
                        named.append(((pair, order), _named(components, pair, kind, axes[mine], unique, R)))
                        known |= set(_dependent(unique, rows[i, mine].tolist()))
    return tuple(direction for _, direction in sorted(named, key=lambda item: item[0])), known


def _vectors(reactions: tuple[Component, ...]) -> Iterator[tuple[tuple[int, str], Index, Index]]:
    """Components of one kind in one frame: (frame, kind), their axes and their numbers in the row of the pair."""
    out: dict[tuple[int, str], list[tuple[int, int]]] = {}
    for number, c in enumerate(reactions):
        axes = np.flatnonzero(c.wrench)
        if len(axes) == 1:
            kind = "moment" if axes[0] < 3 else "force"
            out.setdefault((c.frame, kind), []).append((int(axes[0]) % 3, number))
    for key, items in out.items():
        yield key, np.array([axis for axis, _ in items]), np.array([number for _, number in items])


def _alike(not_unique: Array) -> Iterator[tuple[Index, Index]]:
    """Pairs ``(n,)`` with the same two or more components that are not unique, and which these are."""
    code = not_unique @ (1 << np.arange(not_unique.shape[1]))
    for value in np.unique(code):
        mine = np.flatnonzero((value >> np.arange(not_unique.shape[1])) & 1)
        if len(mine) > 1:
            yield np.flatnonzero(code == value), mine


def _directions(rows: Array) -> list[Array]:
    """For every pair orthonormal combinations of its components ``(n, c, s)`` in which no self-stress has a part."""
    U, s, _ = np.linalg.svd(rows, full_matrices=True)
    size = np.zeros(U.shape[:2])
    size[:, : s.shape[1]] = s
    none = np.zeros((rows.shape[1], 0))
    out = [none] * len(rows)
    for i in np.flatnonzero((size <= UNIQUE).any(axis=1)):
        out[int(i)] = U[i][:, size[i] <= UNIQUE]
    return out


def _named(components: Components, pair: int, kind: str, axes: Index, unique: Array, R: Array) -> UniqueDirection:
    across = unique.shape[1] > 1
    inner = null_space(unique.T, 1e-9) if across else unique
    direction = np.zeros(3)
    direction[axes] = inner[:, 0]
    direction = np.where(np.abs(direction) < ZERO_ENTRY, 0.0, direction)
    direction = direction * np.sign(direction[np.flatnonzero(direction)[0]])
    name = components.system.m.pairs[pair].name
    return UniqueDirection(name, kind, tuple(direction.tolist()), across, tuple((R @ direction).tolist()))


def _dependent(unique: Array, rows: list[int]) -> list[int]:
    """As many components as there are unique directions: those that the others then give.

    By elimination with pivoting of the projector on these directions, which does not depend on their basis; of equal ones the last.
    """
    P, chosen = unique @ unique.T, []
    for _ in range(unique.shape[1]):
        size = np.diag(P)
        i = int(np.flatnonzero(size > (1 - 1e-6) * size.max())[-1])
        P = P - np.outer(P[:, i], P[i]) / P[i, i]
        chosen.append(rows[i])
    return chosen
