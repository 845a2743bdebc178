"""The numbers of a mechanism as one set of arrays: what every kernel reads.

Component axes first, then links or pairs, then a batch axis (of length 1 for one mechanism). Lengths are divided by ``L`` and
every link frame is shifted to the middle of its markers, so that the kernels see numbers of size one wherever the mechanism
stands and whatever its units: internal position = (R_b offset_b + p_b - center) / L.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import cached_property
from itertools import accumulate, chain, pairwise
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.maths.se3 import Array, cross
from mechgraph.memo import dataclass
from mechgraph.model.declaration import DeclaredParts

Index = NDArray[np.intp]
Items = NDArray[np.object_]


@dataclass(frozen=True)
class Parameters:
    """Arrays of one mechanism (or of many variants of it).

    ``marker_a, marker_b (3, 4, P, B)``, ``pitch (P, B)``, ``mass (N, B)``, ``center (3, N, B)``, ``inertia (3, 3, N, B)``,
    ``couplings (K, B)``, ``items (couplings, B)`` as in ``Declared``, ``offset (3, N)`` origin of the internal link frame in the
    declared one, ``frame (3, 4, 1)`` pose of the frame link; ``origin (3,)`` global position of the internal origin, ``L`` its unit.
    """

    marker_a: Array
    marker_b: Array
    pitch: Array
    mass: Array
    center: Array
    inertia: Array
    couplings: Array
    items: Items
    offset: Array
    frame: Array
    origin: Array
    L: float

    @cached_property
    def batch(self) -> int:
        """Number of variants."""
        return max(getattr(self, name).shape[-1] for name in BATCHED)

    def taken(self, cases: Index) -> Parameters:
        """The numbers of some variants of a batch, in that order (one may stand several times); of a batch of one, itself."""
        arrays = {name: getattr(self, name) for name in BATCHED}
        return replace(self, **{k: v[..., cases] if v.shape[-1] > 1 else v for k, v in arrays.items()})

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


BATCHED = ("marker_a", "marker_b", "pitch", "mass", "center", "inertia", "couplings", "items")
"""The arrays that differ between variants."""


@dataclass(frozen=True)
class Declared:
    """The numbers of a mechanism as they are declared, in its units; the batch axis of variants is last, of length 1 or B.

    ``point, axis, second (2, 3, P, B)`` of the markers on ``a`` and ``b`` in the frames of their links, ``pitch (P, B)`` per
    radian, ``mass (N, B)``, ``center (3, N, B)``, ``inertia (3, 3, N, B)``, ``couplings (K, B)`` (see ``coupling_places``); zeros
    where nothing is declared. ``items (couplings, B)``: the couplings themselves, of which gears have numbers of their own.
    """

    point: Array
    axis: Array
    second: Array
    pitch: Array
    mass: Array
    center: Array
    inertia: Array
    couplings: Array
    items: Items

    def offset(self, m: DeclaredParts) -> Array:
        """Middle of the markers of every link in its frame, ``(3, N)``: of the first variant."""
        ends = np.concatenate(m.pair_ends)
        points = np.concatenate([self.point[0, :, :, 0], self.point[1, :, :, 0]], axis=1)
        count = np.bincount(ends, minlength=len(m.links))
        return np.stack([np.bincount(ends, row, minlength=len(m.links)) for row in points]) / count

    def with_rest(self, m: DeclaredParts) -> Declared:
        """The numbers with those of the pairs of ``m`` behind theirs (free pairs, which do not vary)."""
        P = self.pitch.shape[0]
        if len(m.pairs) == P:
            return self
        rest, joined = declared(m), {}
        for name in ("point", "axis", "second", "pitch"):
            mine, theirs = getattr(self, name), getattr(rest, name)[..., P:, :]
            joined[name] = np.concatenate([mine, np.repeat(theirs, mine.shape[-1], axis=-1)], axis=-2)
        return replace(self, **joined)

    def parameters(self, m: DeclaredParts, offset: Array, origin: Array, L: float) -> Parameters:
        """The arrays that kernels read, about ``origin (3,)`` with lengths over ``L`` and link frames moved by ``offset (3, N)``."""
        frame_link = m.link_index[m.frame]
        frame = np.zeros((3, 4, 1))
        frame[:, :3, 0] = np.eye(3)
        frame[:, 3, 0] = (offset[:, frame_link] - origin) / L
        placed = np.array([link.center is not None for link in m.links])
        center = np.where(placed[:, None], self.center - offset[:, :, None], 0.0)
        a, b = m.pair_ends
        return Parameters(
            marker_a=self._markers(0, offset[:, a], L),
            marker_b=self._markers(1, offset[:, b], L),
            pitch=self.pitch / L,
            mass=self.mass,
            center=center / L,
            inertia=self.inertia / L**2,
            couplings=self.couplings,
            items=self.items,
            offset=offset,
            frame=frame,
            origin=np.asarray(origin, dtype=float),
            L=L,
        )

    def _markers(self, side: int, offset: Array, L: float) -> Array:
        """Poses ``(3, 4, P, B)`` of the markers on one side (see ``Marker.pose``)."""
        z = self.axis[side] / np.sqrt((self.axis[side] ** 2).sum(axis=0))
        x = self.second[side] - (z * self.second[side]).sum(axis=0) * z
        x = x / np.sqrt((x * x).sum(axis=0))
        at = (self.point[side] - offset[:, :, None]) / L
        out = np.empty((3, 4, at.shape[1], max(z.shape[2], x.shape[2], at.shape[2])), dtype=np.result_type(x, at))
        out[:, 0], out[:, 1], out[:, 2], out[:, 3] = x, cross(z, x), z, at
        return out


def coupling_places(m: DeclaredParts) -> list[slice]:
    """For every coupling the places of its coefficients among the numbers of all; behind the last one stands its constant."""
    ends = accumulate((len(c.terms) + 1 for c in m.couplings), initial=0)
    return [slice(begin, end - 1) for begin, end in pairwise(ends)]


def _rows(vectors: Iterable[Any], count: int) -> Array:
    """``count`` vectors of three numbers as rows ``(count, 3)``."""
    return np.fromiter(chain.from_iterable(vectors), float, 3 * count).reshape(-1, 3)


def _of_sides(m: DeclaredParts, fields: tuple[str, ...]) -> list[Array]:
    """Fields of the markers on both sides of all pairs, ``(2, 3, P)`` each."""
    marked = [k for k, pair in enumerate(m.pairs) if pair.on_a is not None]
    sides = [pair.on_a or pair for pair in m.pairs], [m.pairs[k].on_b for k in marked]
    out = []
    for value in map(attrgetter, fields):
        first, second = (_rows(map(value, side), len(side)) for side in sides)
        both = np.stack([first, first])
        both[1, marked] = second
        out.append(both.transpose(0, 2, 1))
    return out


def declared(m: DeclaredParts) -> Declared:
    """The declared numbers of one mechanism with geometry, a batch of one."""
    point, axis, second = _of_sides(m, ("point", "axis", "second"))
    n = len(m.links)
    nowhere = (0.0, 0.0, 0.0)
    center = _rows((nowhere if link.center is None else link.center for link in m.links), n).T
    tensors = ((nowhere,) * 3 if link.inertia is None else link.inertia for link in m.links)
    inertia = _rows(chain.from_iterable(tensors), 3 * n).reshape(n, 3, 3).transpose(1, 2, 0)
    return Declared(
        point[..., None],
        axis[..., None],
        second[..., None],
        np.fromiter((p.pitch_per_radian for p in m.pairs), float, len(m.pairs))[:, None],
        np.fromiter((link.mass for link in m.links), float, n)[:, None],
        np.ascontiguousarray(center)[..., None],
        np.ascontiguousarray(inertia)[..., None],
        np.array([x for c in m.couplings for x in (*c.coefficients, c.constant or 0.0)], dtype=float)[:, None],
        np.fromiter(m.couplings, object, len(m.couplings))[:, None],
    )


def parameters(m: DeclaredParts) -> Parameters:
    """The arrays of a mechanism with geometry as it is declared, about the origin of its frame."""
    numbers = declared(m)
    offset = numbers.offset(m)
    return numbers.parameters(m, offset, offset[:, m.link_index[m.frame]], 1.0)
