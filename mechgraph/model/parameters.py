"""The numbers of a mechanism as one set of arrays: what every kernel reads.

Component axes first, then links or pairs, then a batch axis (of length 1 for one mechanism). Lengths are divided by ``L`` and
every link frame is shifted to the middle of its markers, so that the kernels see numbers of size one wherever the mechanism
stands and whatever its units: internal position = (R_b offset_b + p_b - center) / L.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import Array, cross
from mechgraph.model.connection import Pair
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


def _marker_poses(pairs: tuple[Pair, ...]) -> tuple[Array, Array]:
    """Poses ``(3, 4, P)`` of the markers on ``a`` and on ``b`` in the frames of their links (see ``Marker.pose``)."""
    markers = [pair.markers for pair in pairs]
    out = []
    for side in (0, 1):
        points, axes, seconds = (
            np.array([getattr(both[side], field) for both in markers], dtype=float).T
            for field in ("point", "axis", "second")
        )
        z = axes / np.sqrt((axes * axes).sum(axis=0))
        x = seconds - (z * seconds).sum(axis=0) * z
        x /= np.sqrt((x * x).sum(axis=0))
        out.append(np.stack([x, cross(z, x), z, points], axis=1))
    return out[0], out[1]


def parameters(m: Mechanism, origin: Array | None = None, L: float = 1.0) -> Parameters:
    """The arrays of a mechanism with geometry, about ``origin`` (global) with lengths divided by ``L``."""
    index = {name: i for i, name in enumerate(m.link_names())}
    on_a, on_b = _marker_poses(m.pairs)
    offset = np.zeros((3, len(m.links)))
    points: list[list[Array]] = [[] for _ in m.links]
    a, b = ([index[end] for end in ends] for ends in zip(*((p.a, p.b) for p in m.pairs), strict=True))
    for k in range(len(m.pairs)):
        points[a[k]].append(on_a[:, 3, k])
        points[b[k]].append(on_b[:, 3, k])
    for i, at in enumerate(points):
        offset[:, i] = np.mean(at, axis=0)
    origin = offset[:, index[m.frame]] if origin is None else origin

    marker_a, marker_b = on_a.copy(), on_b.copy()
    for marker, links in ((marker_a, a), (marker_b, b)):
        marker[:, 3] = (marker[:, 3] - offset[:, links]) / L
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
