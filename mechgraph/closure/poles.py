"""Poles of the parameters of a sphere: a path that comes near one is followed with parameters about another axis.

At a pole the rates of the parameters have no value, though nothing happens to the mechanism: at the angle d from it the longitude turns at
a rate that grows as 1 / d, accelerations lose rounding over d squared, and a path that passes very near seems to end.
"""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array, compose, inverse, matrix_quaternion, quaternion_log
from mechgraph.closure.driver_path import Positions, Status
from mechgraph.closure.indexing import System
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.pairs import kinematics as evaluation
from mechgraph.pairs.contact_types import placed_surface

AT_POLE = 1e-4
"""Angle from a pole below which a path that ends there ends because of it."""
NEAR_POLE = 0.01
"""Angle from a pole below which too many digits are lost: nearer, accelerations are off by more than 1e-12."""


def away_from_poles(m: Mechanism, system: System, found: Positions) -> Mechanism | None:
    """The mechanism with spheres about other axes where positions lie beside poles, or a node of a path that ends; None where none does.

    The axes keep far from all places that are known; spheres whose parameters are driven, coupled or loaded keep theirs.
    """
    if not any(pair.surface is not None for pair in m.pairs):
        return None
    asked, nodes = found.x[:, np.isfinite(found.x).all(axis=0)], found.tracks.nodes.x
    q, begin = system.coordinates_of(np.concatenate([asked, nodes], axis=1)), system.start_coordinates(m.start)
    whole = bool((found.status == Status.OK).all())
    q_near = q[:, : asked.shape[1]] if whole else q
    pairs, start, bound = list(m.pairs), dict(m.start), m.bound_freedoms
    for k, pair in enumerate(m.pairs):
        place, own = placed_surface(pair.type), slice(system.first_column[k], system.first_column[k + 1])
        free = pair.surface is not None and bound.isdisjoint(pair.freedom_names)
        if place is None or not free or not (place.to_pole(q_near[own][:2]) < NEAR_POLE).any():
            continue
        assert pair.surface is not None
        pairs[k] = pair.reshaped(surface=pair.surface.with_poles_far_from(place.points(q[own][:2])))
        start |= dict(zip(pair.freedom_names, _renamed(pair, pairs[k], begin[own]).tolist(), strict=True))
    return m.replace(pairs=pairs, start=start) if pairs != list(m.pairs) else None


def ends_at_pole(m: Mechanism, system: System, found: Positions, track: int) -> str:
    """The pair on a sphere at whose pole a track ends; empty where it does not."""
    nodes = found.nodes_of(track)
    for k, pair in enumerate(m.pairs if len(nodes) else ()):
        place = placed_surface(pair.type) if pair.surface is not None else None
        if place is not None:
            q = system.coordinates_of(nodes.x[:, -1:])[system.first_column[k] :][:2]
            if place.to_pole(q)[0] < AT_POLE:
                return pair.name
    return ""


def _renamed(old: Pair, new: Pair, q: Array) -> Array:
    """Coordinates ``(5,)`` of a pair about its new axis where the one about the old axis has ``q (5,)``.

    With the markers ``A`` on link a: ``A' D' = A D``.
    """
    moved, pitch = placed_surface(new.type), np.zeros((1, 1))
    assert moved is not None
    A, A_new = (pair.markers[0].pose()[..., None, None] for pair in (old, new))
    x = evaluation.coordinates_to_state(old.type, q[:, None, None])
    there = compose(A, evaluation.frames_of(old.type, pitch, x)[-1])
    at = moved.coordinates_at(there[:, 3, 0, 0])
    turn = compose(inverse(compose(A_new, moved.pose(at[:, None, None], pitch))), there)[:, :3, 0, 0]
    return np.concatenate([at, quaternion_log(matrix_quaternion(turn))])
