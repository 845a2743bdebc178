"""Couplings whose force acts along a line between two links, found from the poses of both: gears, spans of belts.

The relation ``phi`` of the poses of links a and b is dual to its force: with the point P and the unit direction n of the force on b,

    d phi / dt = n . (v_b - v_a) at P = sum_j s_j G . S_j q'_j,   G = (P x n, n),

over the freedoms j of the pairs on a way from a to b, passed in the sense ``s_j``. So the multiplier is the force, whatever the bearings
of the links are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Self

import numpy as np

from mechgraph.maths.se3 import Array, compose, identity, inverse
from mechgraph.model.couplings import BaseCoupling, MeshStep
from mechgraph.pairs import pair_type as evaluation


class LinePlaces(NamedTuple):
    """LinePlaces on links: points, unit axes, and unit directions at right angles to these, ``(3, n, T)`` each."""

    point: Array
    axis: Array
    mark: Array


class LinesAt(NamedTuple):
    """Values ``phi (n, T)``, lengths, and the lines of the forces on b: points and unit directions ``(3, n, T)``."""

    value: Array
    point: Array
    along: Array


Relation = Callable[[LinePlaces, LinePlaces, Array], LinesAt]
"""What places on links a and b and lengths ``(k, n, T)`` of the coupling make: analytic in the places."""


class LinkPlace(NamedTuple):
    """A link by its name with a point, an axis and a direction at right angles to it, in the link's frame."""

    link: str
    point: tuple[float, ...]
    axis: tuple[float, ...]
    mark: tuple[float, ...]

    def seen(self, pose: Array) -> LinePlaces:
        """The place on a link with that pose ``(3, 4)``, as ``(3, 1, 1)`` each."""
        R, vectors = pose[:, :3], (np.asarray(self.point), np.asarray(self.axis), np.asarray(self.mark))
        point, axis, mark = ((R @ v)[:, None, None] for v in vectors)
        return LinePlaces(point + pose[:, 3][:, None, None], axis, mark)


class LineCoupling(BaseCoupling):
    """What couplings share whose force acts along a line between the links of two places.

    ``linear``: whether the relation is one of freedoms with constant coefficients, so that it is solved as that; else it is evaluated
    from the poses. ``numbers``: its lengths. ``period``: by what its value grows from tooth to tooth, where the residue tells as much.
    ``other``: the relation of the other flank of teeth, which negative multipliers press on, its line reversed so that the sense of the
    relation stays. ``longer``: by how much the closed row is above its value at the start. ``turning``: which
    of both turn about their axes; a rack slides along its own.
    """

    ends: tuple[LinkPlace, LinkPlace]
    relation: Relation
    other: Relation | None = None
    numbers: tuple[float, ...] = ()
    period: float = float("inf")
    longer: float = 0.0
    linear: bool = False
    turning: tuple[bool, bool] = (True, True)
    is_force = True

    @property
    def text(self) -> str:
        """The linear relation, or what stands for it."""
        return super().text if self.linear else "n . (v_b - v_a) = 0 along its line"

    def whole_turns(self, along: Array, a: LinePlaces, b: LinePlaces, turned: Callable[[str], Array]) -> Array | None:
        """What whole turns add to the value ``(T,)`` of a row with the direction ``along (3, 1, T)`` between two places, by how much
        freedoms have grown since the start, ``turned(name) (T,)``; None where its residue modulo ``period`` tells as much.
        """
        return None

    def strayed(self, a: LinePlaces, b: LinePlaces, a0: LinePlaces, b0: LinePlaces) -> Array | None:
        """By how much ``(n, T)`` the places are out of those that its relation is about, radians and lengths, where they were ``a0, b0``
        ``(3, n, 1)`` at the start; None where it holds wherever they are.
        """
        return None

    def _put(self, m: Any, steps: tuple[MeshStep, ...], coefficients: Mapping[str, float] | None, **known: Any) -> Self:
        """The same with what it has in a mechanism; ``coefficients`` by freedom where the relation is linear."""
        out = self.replace()
        names = [name for step in steps for name in m.pairs[step.pair].freedom_names]
        terms = tuple(coefficients.items()) if coefficients is not None else tuple((name, 1.0) for name in names)
        vars(out).update(known, terms=terms, steps=steps, linear=coefficients is not None)
        return out


def moving_lines(m: Any) -> tuple[str, ...]:
    """Names of the couplings whose rows are evaluated from poses."""
    return tuple(c.name for c in m.couplings if isinstance(c, LineCoupling) and not c.linear)


def meeting(m: Any) -> dict[str, list[tuple[int, str]]]:
    """The pairs on every link: their places, and the links at their other ends."""
    found: dict[str, list[tuple[int, str]]] = {}
    for k, pair in enumerate(m.pairs):
        for link, other in ((pair.a, pair.b), (pair.b, pair.a)):
            found.setdefault(link, []).append((k, other))
    return found


def way(m: Any, neighbors: Mapping[str, list[tuple[int, str]]], a: str, b: str) -> tuple[MeshStep, ...] | None:
    """The pairs of a shortest way from link a to link b; None where there is none.

    Searched from both ends, the one with fewer pairs ahead first, so that the frame of many links is hardly ever gone through.
    """
    came: tuple[dict[str, tuple[int, str] | None], ...] = ({a: None}, {b: None})
    fronts = [[a], [b]]
    meet = a if a == b else None
    while meet is None:
        cost = [sum(len(neighbors.get(link, ())) for link in front) for front in fronts]
        if not all(fronts):
            return None
        i = int(cost[1] < cost[0])
        ahead: list[str] = []
        for link in fronts[i]:
            for k, other in neighbors.get(link, ()):
                if other not in came[i]:
                    came[i][other] = (k, link)
                    ahead.append(other)
                    if other in came[1 - i]:
                        meet = other
                        break
            if meet is not None:
                break
        fronts[i] = ahead
    halves: list[list[tuple[int, str]]] = []
    for known in came:
        link, half = meet, []
        while (before := known[link]) is not None:
            half.append(before)
            link = before[1]
        halves.append(half)
    steps = [MeshStep(k, 1.0 if m.pairs[k].a == start else -1.0) for k, start in reversed(halves[0])]
    return (*steps, *(MeshStep(k, -1.0 if m.pairs[k].a == start else 1.0) for k, start in halves[1]))


def pose_along(m: Any, steps: tuple[MeshStep, ...]) -> Array:
    """The pose ``(3, 4)`` of the link at the end of a way in the frame of the first one, at the start of a mechanism."""
    out = identity()
    for step in steps:
        pair = m.pairs[step.pair]
        q = np.array([getattr(m, "start", {}).get(name, 0.0) for name in pair.freedom_names], dtype=float)[
            :, None, None
        ]
        if pair.on_a is None and not q.any():
            continue
        x = evaluation.coordinates_to_state(pair.type, q)
        pitch = np.full((1, 1), pair.pitch_per_radian)
        moved = evaluation.frames_of(pair.type, pitch, x)[-1][:, :, 0, 0]
        A, B = (marker.pose() for marker in pair.markers)
        there = compose(compose(A, moved), inverse(B))
        out = compose(out, there if step.sense > 0 else inverse(there))
    return out
