"""Loops in ball arithmetic: what a loop is open by, and the twists along it, with bounds of all rounding in them.

A ball is a number with a radius within which the exact one lies. Sums and products carry the radii along and add what rounding may have
done: half a unit in the last place of every operation, ``n + 2`` of them in a product of matrices with ``n`` terms (Rump, Verification
methods, Acta Numerica 19, 2010, section 10). Radii are rounded up by more than the few operations that make them can lose. Sines and
cosines are taken to be right to four units in the last place, the bound that NumPy states for them. Markers count as the exact rigid
poses next to the stored ones; coordinates, points and lengths of rods are taken as they are stored.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mechgraph.closure.configuration import Configuration
from mechgraph.modes.family import Array
from mechgraph.modes.rods import RodSystem
from mechgraph.pairs.factors import ConstantScrew, Rotation, screw_terms

HALF_ULP = 2.0**-53
"""Largest relative rounding of one operation."""
UP, TINY = 1.0 + 2.0**-40, 1e-300
"""Factor by which radii are rounded up, and what is added for numbers too small to be rounded relatively."""
TRIGONOMETRY = 2.0**-50
"""Relative rounding of sines and cosines: four units in the last place."""
STORED = 16 * HALF_ULP
"""Distance of stored entries of rotations (markers, and unit quaternions' matrices) from those of the exact one next to them."""


@dataclass(frozen=True)
class Ball:
    """Numbers ``mid`` with radii ``rad`` of the same shape."""

    mid: Array
    rad: Array

    @staticmethod
    def rounded(mid: Array, rad: Array, size: Array) -> Ball:
        """A result whose operations rounded terms that add up to ``size`` at most."""
        return Ball(mid, UP * (rad + HALF_ULP * size) + TINY)

    def __add__(self, other: Ball) -> Ball:
        mid = self.mid + other.mid
        return Ball.rounded(mid, self.rad + other.rad, np.abs(mid))

    def __sub__(self, other: Ball) -> Ball:
        return self + Ball(-other.mid, other.rad)

    def __matmul__(self, other: Ball) -> Ball:
        a, b = np.abs(self.mid), np.abs(other.mid)
        rad = a @ other.rad + self.rad @ (b + other.rad)
        return Ball.rounded(self.mid @ other.mid, rad, (self.mid.shape[-1] + 2) * (a @ b))

    def __getitem__(self, at: Any) -> Ball:
        return Ball(self.mid[at], self.rad[at])

    @property
    def bound(self) -> Array:
        """The largest size that the numbers can have."""
        return np.asarray(UP * (np.abs(self.mid) + self.rad))


def exact(mid: Array) -> Ball:
    """Numbers as they are stored."""
    return Ball(mid, np.zeros_like(mid))


def crossed(a: Ball, b: Ball) -> Ball:
    """Cross products of vectors ``(3,)`` and ``(3, n)``."""
    return Ball(_skew(a.mid), _skew_size(a.rad)) @ b


def _skew(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _skew_size(v: Array) -> Array:
    return np.abs(_skew(v))


class Open(ValueError):
    """A loop has pairs for which there is no ball arithmetic."""


def rod_row(here: Configuration, rod: int) -> tuple[Ball, Ball]:
    """Of a rod at one position ``((p_b - p_a)^2 - l^2) / 2 (1,)`` and its derivatives by the freedoms between its bodies ``(1, n)``.

    Raises
    ------
    Open
        where a pair is no product of screws and rotations.
    """
    assert isinstance(here.system, RodSystem)
    k = here.system.points
    walk = _Walk(here, np.zeros(3))
    for pair, sign in here.system.way(rod):
        walk.along(pair, sign)
    return walk.distance(k.at_a[:, rod, 0], k.at_b[:, rod, 0], k.length[rod, 0])


def loop_rows(here: Configuration, loop: int) -> tuple[Ball, Ball]:
    """Of a loop at one position ``f (6,)`` by which it is open, about its middle, and its derivatives by the freedoms along it ``(6, n)``.

    ``f = (vee (R - R^T) / 2, p)`` and ``f' = (w + vee part of w x (R - 1), v + w x p)`` for a twist ``(w, v)``.

    Raises
    ------
    Open
        where a pair is no product of screws and rotations.
    """
    walk = _Walk(here, here.middles[:, loop, 0])
    for pair, sign in here.system.graph.loops[loop]:
        walk.along(pair, sign)
    return walk.rows()


class _Walk:
    """Along a loop: the ``pose`` reached, and the twists of the freedoms passed, about ``middle`` in outer directions."""

    def __init__(self, here: Configuration, middle: Array) -> None:
        self.here, self.system, self.middle = here, here.system, middle
        self.pose: Ball | None = None
        self.twists: list[Ball] = []

    def along(self, pair: int, sign: int) -> None:
        """One pair, from its link a to b or back; its twists are kept in the order of its freedoms either way."""
        par, s = self.system.par, self.system
        if self.pose is None:
            first = s.a[pair] if sign > 0 else s.b[pair]
            self.pose = self.first = _rigid(self.here.poses[:, :, first, 0], self.middle)
        ends = [_rigid(marker[:, :, pair, 0]) for marker in (par.marker_a, par.marker_b)]
        steps = self._steps(pair)
        if sign < 0:
            ends = ends[::-1]
            steps = [(_inverse(step), -unit) for step, unit in steps[::-1]]
        self.pose, passed = self.pose @ ends[0], []
        for step, unit in steps:
            if sign > 0:
                passed.append(self._outside(unit))
            self.pose = self.pose @ step
            if sign < 0:
                passed.append(self._outside(unit))
        self.pose = self.pose @ _inverse(ends[1])
        self.twists += passed[::sign]

    def _steps(self, pair: int) -> list[tuple[Ball, Array]]:
        """Motions of the factors of a pair, with unit twists ``(6, n)`` in the frame before each."""
        s, x, column, out = self.system, self.here.x[:, 0], int(self.system.first_column[pair]), []
        for factor in s.m.pairs[pair].type.steps:
            factor = factor.scaled(float(s.par.L))
            if isinstance(factor, ConstantScrew):
                unit = factor.twists(x[:1, None, None], s.par.pitch[[pair]])[:, 0, 0, 0]
                out.append((_screw(unit, float(x[s.single_rows[column]])), unit[:, None]))
                column += 1
            elif isinstance(factor, Rotation) and s.rotations is not None:
                at = int(np.flatnonzero(s.rotations[0][0] == column)[0])
                out.append((_turn(x[s.rotations[1][:, at]], factor), np.eye(6, 3)))
                column += 3
            else:
                raise Open
        return out

    def _outside(self, unit: Array) -> Ball:
        """Twists ``(6, n)`` in the frame reached, in outer directions about the middle."""
        assert self.pose is not None
        w = self.pose[:3, :3] @ exact(unit[:3])
        return _stacked(w, self.pose[:3, :3] @ exact(unit[3:]) + crossed(self.pose[:3, 3], w))

    def rows(self) -> tuple[Ball, Ball]:
        """See ``loop_rows``."""
        assert self.pose is not None
        motion = (self.pose @ _inverse(self.first))[:3]
        motion = motion - exact(np.eye(3, 4))
        S = self._columns()
        R, p = motion[:, :3], motion[:, 3]
        # the skew part of w x (R - 1), by its size
        loose = 2.0 * np.abs(R.bound).max() * S.bound[:3].sum(axis=0)
        turning = Ball(S.mid[:3], UP * (S.rad[:3] + loose))
        columns = _stacked(turning, S[3:] - crossed(p, S[:3]))
        odd = R - Ball(R.mid.T, R.rad.T)
        turned = Ball(0.5 * odd.mid[[2, 0, 1], [1, 2, 0]], 0.5 * odd.rad[[2, 0, 1], [1, 2, 0]])
        return _stacked(turned, p), columns

    def distance(self, at_a: Array, at_b: Array, square: float) -> tuple[Ball, Ball]:
        """See ``rod_row``: points in the frames of the links where the walk began and ended."""
        assert self.pose is not None
        a, b = (X[:3] @ exact(np.append(at, 1.0)) for X, at in ((self.first, at_a), (self.pose, at_b)))
        d, S = (b - a)[None], self._columns()
        f = d @ d[0] - exact(np.array([square]))
        return Ball(0.5 * f.mid, 0.5 * f.rad), d @ (S[3:] - crossed(b, S[:3]))

    def _columns(self) -> Ball:
        return Ball(*(np.concatenate([getattr(t, part) for t in self.twists], axis=1) for part in ("mid", "rad")))


def _stacked(*balls: Ball) -> Ball:
    return Ball(*(np.concatenate([getattr(b, part) for b in balls]) for part in ("mid", "rad")))


def _rigid(pose: Array, origin: Array | None = None) -> Ball:
    """A stored pose ``(3, 4)``, homogeneous; its place is counted from ``origin``."""
    out = np.eye(4)
    out[:3] = pose
    if origin is not None:
        out[:3, 3] -= origin
    rad = np.zeros((4, 4))
    rad[:3, :3] = STORED
    return Ball(out, rad)


def _inverse(X: Ball) -> Ball:
    """Of rigid poses, homogeneous."""
    R = Ball(X.mid[:3, :3].T, X.rad[:3, :3].T)
    p = R @ X[:3, 3]
    mid, rad = np.eye(4), np.zeros((4, 4))
    mid[:3, :3], mid[:3, 3], rad[:3, :3], rad[:3, 3] = R.mid, -p.mid, R.rad, p.rad
    return Ball(mid, rad)


def _screw(unit: Array, q: float) -> Ball:
    """``exp(q s)`` of a unit twist ``(6,)``: four terms, of which the first is one."""
    terms = screw_terms(unit[:, None, None])[..., 0, 0]
    sine, cosine = float(np.sin(q)), float(np.cos(q))
    values = np.array([1.0, sine, 1.0 - cosine, q])
    radii = UP * np.array([0.0, TRIGONOMETRY * abs(sine), TRIGONOMETRY * abs(cosine) + HALF_ULP * 2.0, 0.0]) + TINY
    # terms are made of a few products of the unit twist
    known = Ball(terms, 4 * HALF_ULP * np.abs(terms))
    return known @ Ball(values, radii)


def _turn(quaternion: Array, factor: Rotation) -> Ball:
    """The rotation next to a stored quaternion."""
    out = np.eye(4)
    out[:3] = factor.pose(quaternion[:, None, None], np.zeros((1, 1)))[:, :, 0, 0]
    off = abs(float(quaternion @ quaternion) - 1.0)
    rad = np.zeros((4, 4))
    rad[:3, :3] = UP * (STORED + 2.0 * off)
    return Ball(out, rad)
