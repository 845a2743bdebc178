"""The pairs of a mechanism where they stand, to be moved a little: its numbers with every pair turned and shifted as a whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mechgraph.algebra.se3 import Array, compose, inverse, rotation_exp, rotation_log
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import System
from mechgraph.model.pair import Marker, Pair

EXACT = 1e-13
"""Residual with which a relation, or a loop, counts as exact."""


class Placed:
    """The pairs where they stand in a start that is closed to the tolerance, the misfit of loops shared by all pairs.

    ``frames (3, 4, P)`` of the pairs (marker B), ``steps (3, 4, P)`` from marker A to them; ``misfit (6, P)`` of the two sides;
    ``until`` the time (of ``time.monotonic``) at which what is sought of them is given up.
    """

    def __init__(self, here: Configuration, until: float = np.inf) -> None:
        self.here, self.system, self.until = here, here.system, until
        self.x = here.x[:, 0]
        first, last = pair_frames(here)
        self.steps = compose(inverse(first), last)[..., 0]
        self.poses, self.frames, self.misfit = self._shared(last[..., 0])
        a, b = self.system.m.pair_ends
        self._to_a, self._to_b = inverse(self.poses[:, :, a]), inverse(self.poses[:, :, b])
        m = self.system.m
        q = self.system.coordinates_of(here.x, self.system.start_coordinates(m.start))[:, 0]
        self.start = dict(m.start) if not q.any() else dict(zip(m.freedom_names(), q.tolist(), strict=True))

    def _shared(self, as_a: Array) -> tuple[Array, Array, Array]:
        """Poses of the links, frames of the pairs in the middle of their sides, and half the misfit, with least sum of squares."""
        s = self.system
        a, b = s.m.pair_ends
        poses = self.here.poses[..., 0].copy()
        as_b = compose(poses[:, :, b], s.par.marker_b[..., 0])
        gap = _between(as_b, as_a)
        if np.abs(gap).max(initial=0.0) > EXACT:
            n, P = len(s.m.links), len(s.m.pairs)
            A = np.zeros((P, n))
            A[np.arange(P), b] += 1.0
            A[np.arange(P), a] -= 1.0
            A = np.delete(A, s.m.link_index[s.m.frame], axis=1)
            # every row of the gaps is one equation of the moves (w, v) of the links, taken about the internal origin
            spatial = np.concatenate([gap[:3], gap[3:] - np.cross(gap[:3].T, as_b[:, 3].T).T])
            moves = np.insert(np.linalg.lstsq(A, spatial.T, rcond=None)[0], s.m.link_index[s.m.frame], 0.0, axis=0).T
            move = np.concatenate([rotation_exp(moves[:3]), moves[3:, None]], axis=1)
            poses = compose(move, poses)
            as_a = compose(move[:, :, a], as_a)
            as_b = compose(move[:, :, b], as_b)
            gap = _between(as_b, as_a)
        return poses, _moved(as_b, gap / 2), gap / 2

    def moved(self, change: Array) -> tuple[Array, Array]:
        """Angle and shift ``(P,)`` of every pair, from the farther one of its two sides."""
        sides = []
        for side in (1.0, -1.0):
            turn = np.linalg.norm(change[:3] + side * self.misfit[:3], axis=0)
            sides.append((turn, np.linalg.norm(change[3:] + side * self.misfit[3:], axis=0)))
        return np.maximum(sides[0][0], sides[1][0]), np.maximum(sides[0][1], sides[1][1])

    def _markers(self, change: Array) -> tuple[Array, Array]:
        F = _moved(self.frames, change)
        return compose(self._to_a, compose(F, inverse(self.steps))), compose(self._to_b, F)

    def changed(self, change: Array) -> System:
        """The system with the pairs moved."""
        on_a, on_b = self._markers(change)
        return self.system.with_parameters(replace(self.system.par, marker_a=on_a[..., None], marker_b=on_b[..., None]))

    def carried(self, change: Array, here: Configuration) -> Array:
        """Twists ``(6, P, 6, T)`` about the internal origin that a unit turn or shift of a pair is for its relative pose at a state."""
        first, last = pair_frames(here)
        as_a = compose(first, np.broadcast_to(self.steps[..., None], first.shape))
        as_b = compose(
            here.poses[:, :, self.system.m.pair_ends[1]], np.broadcast_to(here.system.par.marker_b, last.shape)
        )
        back = _moved(self.frames, change)[:, :3]
        out = np.zeros((6, len(self.system.m.pairs), 6, here.T))
        for side, X in ((1.0, as_a), (-1.0, as_b)):
            Q = np.einsum("ikpt,jkp->ijpt", X[:, :3], back)
            arm = np.stack([np.cross(X[:, 3], Q[:, j], axis=0) for j in range(3)], axis=1)
            out[:3, :, :3] += side * Q.transpose(0, 2, 1, 3)
            out[3:, :, :3] += side * arm.transpose(0, 2, 1, 3)
            out[3:, :, 3:] += side * Q.transpose(0, 2, 1, 3)
        return out

    def pairs(self, change: Array) -> list[Pair]:
        """The declared pairs, those that move with other markers: in the form in which they are declared where that can express it."""
        par, m = self.system.par, self.system.m
        sides = self._markers(change)
        ends = m.pair_ends
        still = np.max(self.moved(change), axis=0, initial=0.0) <= EXACT
        out = []
        for k, pair in enumerate(m.pairs):
            on = [_marker(X[:, :, k], par.L, par.offset[:, end[k]]) for X, end in zip(sides, ends, strict=True)]
            if (
                still[k] and not pair.faults()
            ):  # a second direction that is perpendicular to a tolerance alone is made so
                out.append(pair)
            elif pair.on_a is None and _alike(*on):
                out.append(pair.replace(point=on[1].point, axis=on[1].axis, second=on[1].second))
            else:
                out.append(pair.replace(point=None, axis=None, second=None, on_a=on[0], on_b=on[1]))
        return out


def pair_frames(here: Configuration) -> tuple[Array, Array]:
    """Frames of all pairs ``(3, 4, P, T)``: marker A, and marker B as link a has it."""
    s = here.system
    out = np.empty((2, 3, 4, len(s.m.pairs), here.T))
    for k in range(len(s.m.pairs)):
        group, i = s.place_of(k)
        for side in (0, 1):
            out[side, :, :, k] = here.frames[group][-side][:, :, i]
    return out[0], out[1]


def _between(X: Array, Y: Array) -> Array:
    """Turn and shift ``(6, P)`` of the frames from ``X`` to ``Y``, in global directions about their own points."""
    turn = rotation_log(np.einsum("ikp,jkp->ijp", Y[:, :3], X[:, :3]))
    return np.concatenate([turn, Y[:, 3] - X[:, 3]])


def _moved(X: Array, change: Array) -> Array:
    """Frames after turns and shifts ``(6, P)``."""
    R = np.einsum("ijp,jkp->ikp", rotation_exp(change[:3]), X[:, :3])
    return np.concatenate([R, (X[:, 3] + change[3:])[:, None]], axis=1)


def _marker(X: Array, L: float, offset: Array) -> Marker:
    """A marker in the declared frame of its link, in its units."""
    numbers = (L * X[:, 3] + offset, X[:, 2], X[:, 0])
    return Marker(*(tuple((v + 0.0).tolist()) for v in numbers))


def _alike(one: Marker, other: Marker) -> bool:
    a, b = (np.concatenate([m.point, m.axis, m.second]) for m in (one, other))
    return bool(np.abs(a - b).max() <= EXACT * max(1.0, np.abs(a).max()))
