"""The numbers of a mechanism as one set of arrays: what every kernel reads.

Component axes first, then links or pairs, then a batch axis (of length 1 for one mechanism). Lengths are divided by ``L`` and
every link frame is shifted to the middle of its markers, so that the kernels see numbers of size one wherever the mechanism
stands and whatever its units: internal position = (R_b offset_b + p_b - center) / L.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.model.mechanism import Mechanism


@dataclass(frozen=True)
class Parameters:
    """Arrays of one mechanism (or of many variants of it).

    ``marker_a, marker_b (3, 4, P, B)``, ``pitch (P, B)``, ``mass (N, B)``, ``center (3, N, B)``, ``inertia (3, 3, N, B)``,
    ``offset (3, N)`` origin of the internal link frame in the declared one, ``frame (3, 4, 1)`` pose of the frame link;
    ``origin (3,)`` global position of the internal origin, ``L`` its unit of length.
    """

    marker_a: Array
    marker_b: Array
    pitch: Array
    mass: Array
    center: Array
    inertia: Array
    offset: Array
    frame: Array
    origin: Array
    L: float


def parameters(m: Mechanism, origin: Array | None = None, L: float = 1.0) -> Parameters:
    """The arrays of a mechanism with geometry, about ``origin`` (global) with lengths divided by ``L``."""
    index = {name: i for i, name in enumerate(m.link_names())}
    poses = [tuple(marker.pose() for marker in pair.markers) for pair in m.pairs]
    offset = np.zeros((3, len(m.links)))
    points: list[list[Array]] = [[] for _ in m.links]
    for pair, (A, B) in zip(m.pairs, poses, strict=True):
        points[index[pair.a]].append(A[:, 3])
        points[index[pair.b]].append(B[:, 3])
    for i, at in enumerate(points):
        offset[:, i] = np.mean(at, axis=0)
    origin = offset[:, index[m.frame]] if origin is None else origin

    def local(X: Array, link: str) -> Array:
        out = X.copy()
        out[:, 3] = (X[:, 3] - offset[:, index[link]]) / L
        return out

    marker_a = np.stack([local(A, p.a) for p, (A, _) in zip(m.pairs, poses, strict=True)], axis=-1)
    marker_b = np.stack([local(B, p.b) for p, (_, B) in zip(m.pairs, poses, strict=True)], axis=-1)
    center = np.stack(
        [np.zeros(3) if k.center is None else (np.asarray(k.center) - offset[:, i]) / L for i, k in enumerate(m.links)],
        axis=-1,
    )
    inertia = np.stack(
        [np.zeros((3, 3)) if k.inertia is None else np.asarray(k.inertia) / L**2 for k in m.links], axis=-1
    )
    frame = np.zeros((3, 4, 1))
    frame[:, :3, 0] = np.eye(3)
    frame[:, 3, 0] = (offset[:, index[m.frame]] - origin) / L
    return Parameters(
        marker_a=marker_a[..., None],
        marker_b=marker_b[..., None],
        pitch=np.array([[p.pitch_per_radian / L] for p in m.pairs]),
        mass=np.array([[link.mass] for link in m.links]),
        center=center[..., None],
        inertia=inertia[..., None],
        offset=offset,
        frame=frame,
        origin=np.asarray(origin, dtype=float),
        L=L,
    )
