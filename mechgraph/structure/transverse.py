"""Transverse verdicts by principal direction: forces and moments of a pair that are unique in one direction but not in another.

``Fx`` and ``Fy`` in an arbitrary marker frame may both be called not unique where only the force in one direction across the axis
is. So the components of one kind in one frame are taken as a vector; the directions in which no self-stress has a part are found
and named.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.screw import null_space
from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.model.pair_type import Component
from mechgraph.structure.reaction_split import UNIQUE

ROUND = 5e-13
"""Entry of a unit direction that counts as zero for its sign."""


@dataclass(frozen=True)
class Transverse:
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


def transverse(
    here: Configuration, labels: list[tuple[str, str]], table: Array
) -> tuple[tuple[Transverse, ...], set[int]]:
    """Directions unique in a pair though its components are not; and components that these make known from others.

    ``table (components, s)`` are the parts of the components ``labels`` in the self-stresses.
    """
    place = {label: i for i, label in enumerate(labels)}
    loose = np.sqrt((table**2).sum(axis=1)) > UNIQUE
    found: list[Transverse] = []
    known: set[int] = set()
    poses = {int(k): (g, i) for g, group in enumerate(here.system.groups) for i, k in enumerate(group.pairs)}
    vectors = [_vectors(g.row.reactions or ()) for g in here.system.groups]
    for k, pair in enumerate(here.system.m.pairs):
        for (frame, kind), parts in vectors[poses[k][0]].items():
            mine = [(axis, place[pair.name, name]) for axis, name in parts if loose[place[pair.name, name]]]
            if len(mine) < 2:
                continue
            axes, rows = [axis for axis, _ in mine], [row for _, row in mine]
            unique = _unique_directions(table[rows])
            if not unique.shape[1]:
                continue
            across = unique.shape[1] > 1
            inner = _null_of(unique) if across else unique
            direction = np.zeros(3)
            direction[axes] = inner[:, 0]
            direction = _signed(direction)
            g, i = poses[k]
            R = here.frames[g][frame][:, :3, i, 0]
            found.append(
                Transverse(pair.name, kind, tuple(direction.tolist()), across, tuple((R @ direction).tolist()))
            )
            known |= set(_dependent(unique, rows))
    return tuple(found), known


def _vectors(reactions: tuple[Component, ...]) -> dict[tuple[int, str], list[tuple[int, str]]]:
    """Components of one kind in one frame: (frame, kind) -> (axis, name)."""
    out: dict[tuple[int, str], list[tuple[int, str]]] = {}
    for c in reactions:
        axes = np.flatnonzero(c.wrench)
        if len(axes) == 1:
            kind = "moment" if axes[0] < 3 else "force"
            out.setdefault((c.frame, kind), []).append((int(axes[0]) % 3, c.name))
    return out


def _unique_directions(rows: Array) -> Array:
    """Orthonormal combinations of a few components in which no self-stress has a part."""
    U, s, _ = np.linalg.svd(rows, full_matrices=True)
    size = np.concatenate([s, np.zeros(U.shape[1] - len(s))])
    return np.asarray(U[:, size <= UNIQUE])


def _null_of(columns: Array) -> Array:
    return null_space(columns.T, 1e-9)


def _signed(direction: Array) -> Array:
    direction = np.where(np.abs(direction) < ROUND, 0.0, direction)
    return np.asarray(direction * np.sign(direction[np.flatnonzero(direction)[0]]))


def _dependent(unique: Array, rows: list[int]) -> list[int]:
    """As many components as there are unique directions: those that the others then give (elimination with pivoting)."""
    A, chosen = unique.copy(), []
    for j in range(A.shape[1]):
        size = np.abs(A[:, j:]).max(axis=1)
        i = int(np.flatnonzero(size > (1 - 1e-6) * size.max())[-1])
        k = j + int(np.argmax(np.abs(A[i, j:])))
        A[:, [j, k]] = A[:, [k, j]]
        A[:, j + 1 :] -= np.outer(A[:, j], A[i, j + 1 :] / A[i, j])
        chosen.append(rows[i])
    return chosen
