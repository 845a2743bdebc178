"""Poles of the parameters of a sphere: a path that comes near one is followed with parameters about another axis.

At a pole the rates of the parameters have no value, though nothing happens to the mechanism: at the angle d from it the longitude turns at
a rate that grows as 1 / d, accelerations lose rounding over d squared, and a path that passes very near seems to end.
"""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array, compose, inverse, matrix_quaternion, quaternion_log
from mechgraph.closure.driver_path import Positions, Status
from mechgraph.closure.indexing import System
from mechgraph.model import pair_kinematics as evaluation
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.model.surface_rows import placed_surface

NEAR_POLE = 0.01
"""Angle from a pole below which too many digits are lost: nearer, accelerations are off by more than 1e-12."""


def away_from_poles(m: Mechanism, system: System, found: Positions) -> Mechanism | None:
    """The mechanism with spheres about other axes where positions lie beside poles, or a node of a path that ends; None where none does.

    The axes keep far from all places that are known. Spheres whose parameters are driven, coupled or loaded, and those placed by
    markers, keep theirs.
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
        kept = pair.surface is None or pair.on_b is not None or not bound.isdisjoint(pair.freedom_names)
        if place is None or kept or not (place.to_pole(q_near[own][:2]) < NEAR_POLE).any():
            continue
        assert pair.surface is not None
        pairs[k] = pair.replace(surface=pair.surface.with_poles_far_from(place.points(q[own][:2])))
        if not start.keys().isdisjoint(pair.freedom_names):
            start |= dict(zip(pair.freedom_names, _renamed(pair, pairs[k], begin[own]).tolist(), strict=True))
    return m.replace(pairs=pairs, start=start) if pairs != list(m.pairs) else None


def _renamed(old: Pair, new: Pair, q: Array) -> Array:
    """Coordinates ``(5,)`` of a pair about its new axis where the one about the old axis has ``q (5,)``.

    The marker of both links is turned by ``C``: ``D' = C^-1 D C``.
    """
    moved, pitch = placed_surface(new.type), np.zeros((1, 1))
    assert moved is not None
    C = compose(inverse(old.markers[0].pose()[..., None, None]), new.markers[0].pose()[..., None, None])
    x = evaluation.coordinates_to_state(old.type, q[:, None, None])
    D = compose(inverse(C), compose(evaluation.frames_of(old.type, pitch, x)[-1], C))
    at = moved.coordinates_at(moved.start[:, :3] @ D[:, 3, 0, 0] + moved.start[:, 3])
    turn = compose(inverse(moved.pose(at[:, None, None], pitch)), D)[:, :3, 0, 0]
    return np.concatenate([at, quaternion_log(matrix_quaternion(turn))])
