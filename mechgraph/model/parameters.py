"""The numbers of a mechanism as one set of arrays: what every kernel reads.

Component axes first, then links or pairs, then a batch axis (of length 1 for one mechanism). Lengths are divided by ``L`` and
every link frame is shifted to the middle of its markers, so that the kernels see numbers of size one wherever the mechanism
stands and whatever its units: internal position = (R_b offset_b + p_b - center) / L.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

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

    def rescaled(self, origin: Array, L: float) -> Parameters:
        """The same numbers about another ``origin (3,)`` (global), with lengths over another ``L``."""
        ratio = self.L / L
        moved = {}
        for name in ("marker_a", "marker_b", "frame"):
            moved[name] = getattr(self, name).copy()
            moved[name][:, 3] *= ratio
        moved["frame"][:, 3, 0] += (self.origin - origin) / L
        return replace(
            self,
            **moved,
            pitch=self.pitch * ratio,
            center=self.center * ratio,
            inertia=self.inertia * ratio**2,
            origin=np.asarray(origin, dtype=float),
            L=L,
        )


def _marker_poses(pairs: tuple[Pair, ...]) -> tuple[Array, Array]:
    """Poses ``(3, 4, P)`` of the markers on ``a`` and on ``b`` in the frames of their links (see ``Marker.pose``)."""
    out = []
    for side in ("on_a", "on_b"):
        placed = [pair if getattr(pair, side) is None else getattr(pair, side) for pair in pairs]
        points, axes, seconds = (
            np.array([getattr(marker, field) for marker in placed], dtype=float).T
            for field in ("point", "axis", "second")
        )
        z = axes / np.sqrt((axes * axes).sum(axis=0))
        x = seconds - (z * seconds).sum(axis=0) * z
        x /= np.sqrt((x * x).sum(axis=0))
        out.append(np.stack([x, cross(z, x), z, points], axis=1))
    return out[0], out[1]


def parameters(m: Mechanism, origin: Array | None = None, L: float = 1.0) -> Parameters:
    """The arrays of a mechanism with geometry, about ``origin`` (global) with lengths divided by ``L``."""
    index = m.link_index
    on_a, on_b = _marker_poses(m.pairs)
    a, b = (np.array([index[getattr(p, end)] for p in m.pairs], dtype=np.intp) for end in ("a", "b"))
    count = np.bincount(np.concatenate([a, b]), minlength=len(m.links))
    points = np.concatenate([on_a[:, 3], on_b[:, 3]], axis=1)
    ends = np.concatenate([a, b])
    offset = np.stack([np.bincount(ends, row, minlength=len(m.links)) for row in points]) / count
    origin = offset[:, index[m.frame]] if origin is None else origin

    marker_a, marker_b = on_a.copy(), on_b.copy()
    for marker, links in ((marker_a, a), (marker_b, b)):
        marker[:, 3] = (marker[:, 3] - offset[:, links]) / L
    center, inertia = np.zeros((3, len(m.links))), np.zeros((3, 3, len(m.links)))
    placed = [i for i, link in enumerate(m.links) if link.center is not None]
    center[:, placed] = np.array([m.links[i].center for i in placed], dtype=float).reshape(-1, 3).T
    center[:, placed] = (center[:, placed] - offset[:, placed]) / L
    turning = [i for i, link in enumerate(m.links) if link.inertia is not None]
    tensors = np.array([m.links[i].inertia for i in turning], dtype=float).reshape(-1, 3, 3)
    inertia[:, :, turning] = np.moveaxis(tensors, 0, -1) / L**2
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
