"""Certificates: balls that hold one root each.

Loops in ball arithmetic: what a loop is open by, and the twists along it, with bounds of all rounding in them.

A ball is a number with a radius within which the exact one lies. Sums and products carry the radii along and add what rounding may have
done: half a unit in the last place of every operation, ``n + 2`` of them in a product of matrices with ``n`` terms (Rump, Verification
methods, Acta Numerica 19, 2010, section 10). Radii are rounded up by more than the few operations that make them can lose. Sines and
cosines are taken to be right to four units in the last place, the bound that NumPy states for them. Markers count as the exact rigid
poses next to the stored ones; coordinates, points and lengths of rods are taken as they are stored.

A certificate of a real assembly: the theorem of Newton and Kantorovich on the independent closure rows, with rounding in it.

Of every loop, product ``M(u)`` of the motions along it, ``f = (vee (R - R^T) / 2, p)`` about its middle vanishes where it is closed and,
within half a turn, nowhere else. Both ``f`` and its derivative come with bounds of all rounding (see ``balls``). With ``A`` the independent
combinations of rows on the complement of the passive motions, ``beta >= |A^-1|``, ``eta >= |A^-1 f|``, and ``K`` a bound of the second
derivatives within ``MODES.ball``:

    beta K eta <= 1/2  =>  one root, within (1 - sqrt(1 - 2 beta K eta)) / (beta K), and no other within min(ball, 1 / (beta K)).

``beta``: with ``Y`` a computed inverse, ``|A^-1| <= |Y| / (1 - |1 - Y A|)`` for every ``A`` within its bounds. ``K``: the second
derivative along a unit ``u`` is that of a product of motions, ``sum_i u_i^2 s_i s_i + 2 sum_(i < j) u_i u_j s_i s_j``, so that with
``h^2 = |w|^2 + g^2`` and ``g`` a bound of ``|v|`` and the gap of the loop

    |f''|^2 <= sum_i |w_i|^2 h_i^2 + 2 sum_(i < j) |w_i|^2 h_j^2 <= 2 (sum |w_i|^2) (sum h_j^2).

Of a rod, ``f = ((p_b - p_a)^2 - l^2) / 2``: ``|f''| <= g^2 + sqrt(2) |w| g |p_b - p_a|`` with ``g`` the speeds of ``p_b`` and ``|w|`` the
turns, both summed as squares. All grow by no more than ``exp(2 ball sqrt(m))`` over the reach (``m`` freedoms). These are sums of positive
numbers, of which rounding takes less than a part in 1e12: 1 % is added. Sources: Ortega and Rheinboldt, Iterative Solution of Nonlinear
Equations in Several Variables, 1970, section 12.6; Rump, Acta Numerica 19, 2010, section 10.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple, cast

import numpy as np

from mechgraph.kinematics.state import Configuration
from mechgraph.maths.se3 import Index, cross, move_twist, rotate
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.modes.family import Array, Family
from mechgraph.modes.form import RodSystem
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
    return Ball(_skew(a.mid), np.abs(_skew(a.rad))) @ b


def _skew(v: Array) -> Array:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


class Open(ValueError):
    """A loop has pairs for which there is no ball arithmetic."""


class MovedMarker(NamedTuple):
    """A marker, of a pair on a side (0 or 1), that may move along a unit twist ``(6,)`` in the frame of its link."""

    pair: int
    side: int
    twist: Array


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
    return walk.distance(k.at_a[:, rod, 0], k.at_b[:, rod, 0], k.squares[rod, 0])


def loop_rows(here: Configuration, loop: int, moved: Sequence[MovedMarker] = ()) -> tuple[Ball, Ball]:
    """Of a loop at one position ``f (width,)`` by which it is open, about its middle, and its derivatives by its freedoms ``(width, n)``.

    ``f = (vee (R - R^T) / 2, p)`` and ``f' = (w + vee part of w x (R - 1), v + w x p)`` for a twist ``(w, v)``. Behind the freedoms stand
    all markers that may move, zero where the loop does not pass them.

    Raises
    ------
    Open
        where a pair is no product of screws and rotations.
    """
    walk = _Walk(here, here.middles[:, loop, 0], moved)
    for pair, sign in here.system.graph.loops[loop]:
        walk.along(pair, sign)
    f, A = walk.rows()
    return f[here.system.graph.span], A[here.system.graph.span]


class _Walk:
    """Along a loop: the ``pose`` reached, and the twists of the freedoms passed, about ``middle`` in outer directions."""

    def __init__(self, here: Configuration, middle: Array, moved: Sequence[MovedMarker] = ()) -> None:
        self.here, self.system, self.middle, self.moved = here, here.system, middle, moved
        self.pose: Ball | None = None
        self.twists: list[Ball] = []
        self.of_markers = [exact(np.zeros((6, 1)))] * len(moved)

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
        self._mark(pair, (1 - sign) // 2, 1.0)
        self.pose, passed = self.pose @ ends[0], []
        for step, unit in steps:
            if sign > 0:
                passed.append(self._outside(unit))
            self.pose = self.pose @ step
            if sign < 0:
                passed.append(self._outside(unit))
        self.pose = self.pose @ _inverse(ends[1])
        self._mark(pair, (1 + sign) // 2, -1.0)
        self.twists += passed[::sign]

    def _mark(self, pair: int, side: int, sign: float) -> None:
        """Twists of the markers of a pair on a side, in the frame reached, which is that of their link."""
        for k, marker in enumerate(self.moved):
            if marker[:2] == (pair, side):
                self.of_markers[k] = self._outside(sign * marker.twist[:, None])

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
        twists = [*self.twists, *self.of_markers]
        return Ball(*(np.concatenate([getattr(t, part) for t in twists], axis=1) for part in ("mid", "rad")))


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


@dataclass(frozen=True)
class Certificate:
    """What is proved of a regular real assembly.

    Attributes
    ----------
    proved : whether ``product <= 1/2``, and the root is where the assembly is told apart from others.
    product : ``beta K eta`` of Newton and Kantorovich.
    error : bound of the distance of the root from the state given (radians, lengths / L).
    radius : distance within which there is no other root.
    rows, dependent : numbers of independent rows, on which it rests, and of those that depend on them.
    dependence : ``"structure"`` where all motions of the loops lie in one group, which makes them follow; otherwise ``"checked"``.
    residual : largest closure error in all rows.
    apart : bound from below of how far any other root that is proved at this position is (radians, lengths / L), in the coordinate or
        pose in which they differ most, of links in the frames in which they are solved (not those of ``modes.poses``); at most zero
        where they may be one, None where there is no other. The two ways of a leg on a universal joint have the certificate of both, and
        are not compared.
    """

    proved: bool
    product: float
    error: float
    radius: float
    rows: int
    dependent: int
    dependence: str
    residual: float
    apart: float | None = None


def certificate(here: Configuration, free: Index, passive: int, by_structure: bool) -> Certificate | None:
    """The certificate of a state; None where a pair is no product of screws and rotations."""
    try:
        f, A = rows(here)
    except Open:
        return None
    return root_near(f, A[:, free], len(free) - passive, curvature(here), by_structure, float(here.closure[0]))


def root_near(f: Ball, A: Ball, rank: int, K: float, by_structure: bool, residual: float) -> Certificate:
    """The certificate of rows ``f (n,)``, of which so many are independent, with derivatives ``A (n, k)`` and second ones below ``K``."""
    U, sigma, Vt = np.linalg.svd(A.mid)
    how = "structure" if by_structure else "checked"
    dependent, off = len(f.mid) - rank, np.inf
    # smallest singular value, as part of the largest, below which nothing is tried
    if not rank or sigma[rank - 1] > 1e-13 * sigma[0]:
        Y, independent = exact(np.diag(1.0 / sigma[:rank])), exact(U[:, :rank].T)
        off = MODES.bound_rounding * float(
            np.linalg.norm((Y @ (independent @ A @ exact(Vt[:rank].T)) - exact(np.eye(rank))).bound)
        )
    if off >= 1.0:
        return Certificate(False, np.inf, np.inf, 0.0, rank, dependent, "checked", residual)
    beta = MODES.bound_rounding / (sigma[rank - 1] * (1.0 - off)) if rank else 0.0
    eta = MODES.bound_rounding * float(np.linalg.norm((Y @ (independent @ f)).bound)) / (1.0 - off)
    K = MODES.bound_rounding * K
    h = beta * K * eta
    proved = bool(h <= 0.5)
    error = float((1 - np.sqrt(1 - 2 * h)) / (beta * K)) if proved and h > 0 else float(eta)
    radius = float(min(MODES.ball, 1 / (beta * K))) if proved and h > 0 else 0.0
    # distance of the root up to which assemblies that are told apart have roots of their own
    return Certificate(proved and error < 1e-7, float(h), error, radius, rank, dependent, how, residual)


def told_apart(family: Family, x: Array, sure: Sequence[Certificate | None]) -> list[Certificate | None]:
    """Certificates of states ``x (nx, M)`` with how far ``apart`` their roots are.

    A root lies within ``error`` of its state, measured by increments, so that no coordinate and no angle of a rotation differs by more:
    roots whose states differ by more than both errors are two. Coordinates that passive motions change do not count.
    """
    angles, lengths = family.settled_rows
    turns, proved = family.settled_rotations, [i for i, one in enumerate(sure) if one is not None and one.proved]
    error = np.array([one.error for one in sure if one is not None and one.proved])
    x, out = x[:, proved], list(sure)
    for n, i in enumerate(proved):
        off = (x - x[:, [n]])[angles]
        Q, R = x[turns], x[turns][:, :, [n]]
        gaps = [
            np.abs(off - 2 * np.pi * np.round(off / (2 * np.pi))),
            np.abs(x - x[:, [n]])[lengths],
            # twice the chord is no more than the angle
            2.0 * np.minimum(*(np.sqrt(((Q + sign * R) ** 2).sum(axis=0)) for sign in (1.0, -1.0))),
        ]
        # taken from the distance of two states for its rounding
        least = np.delete(np.concatenate(gaps).max(axis=0, initial=0.0) / UP - error - error[n] - 1e-13, n)
        out[i] = replace(cast("Certificate", sure[i]), apart=float(least.min()) if least.size else None)
    return out


def rows(here: Configuration, moved: Sequence[MovedMarker] = ()) -> tuple[Ball, Ball]:
    """What rows leave open ``(n,)`` and their derivatives ``(n, F)``, with bounds of their rounding; those of couplings are linear.

    Behind the freedoms stand the markers that may move.
    """
    s = here.system
    J = np.pad(here.J[:, :, 0], ((0, 0), (0, len(moved))))
    size, markers = np.abs(J), np.arange(s.n_freedoms, J.shape[1])
    largest = s.n_freedoms * (1.0 + size.sum(axis=1) * np.abs(here.x).max(initial=1.0))
    f, A = Ball(here.residual[:, 0].copy(), STORED * largest), Ball(J.copy(), STORED * size)
    for loop, (columns, _) in enumerate(s.loop_columns):
        at = slice(s.graph.width * loop, s.graph.width * (loop + 1))
        _put(f, A, at, np.append(columns, markers), loop_rows(here, loop, moved))
    if isinstance(s, RodSystem):
        for rod, columns in enumerate(_columns_of_rods(s)):
            row = s.graph.loop_rows + rod
            _put(f, A, slice(row, row + 1), columns, rod_row(here, rod))
    return f, A


def _put(f: Ball, A: Ball, at: slice, columns: Index, found: tuple[Ball, Ball]) -> None:
    for part in ("mid", "rad"):
        getattr(A, part)[at] = 0.0
        getattr(f, part)[at], getattr(A, part)[at, columns] = (getattr(ball, part) for ball in found)


def _columns_of_rods(s: RodSystem) -> list[Index]:
    """Freedoms between the bodies of every rod, pair by pair along the way."""
    first = s.first_column
    ways = (s.way(rod) for rod in range(len(s.points.a)))
    return [np.concatenate([np.arange(first[k], first[k + 1]) for k, _ in way]) for way in ways]


def curvature(here: Configuration, moved: Sequence[MovedMarker] = ()) -> float:
    """A bound of the second derivatives of the rows of all loops and rods within ``MODES.ball``."""
    s, S, total = here.system, here.S[:, :, 0], 0.0
    ends = [here.poses[:, :, (s.a, s.b)[side][pair]] for pair, side, _ in moved]
    S = np.concatenate([S, *(move_twist(X, one.twist[:, None]) for X, one in zip(ends, moved, strict=True))], axis=1)
    for loop, (columns, _) in enumerate(s.loop_columns):
        passed = {pair for pair, _ in s.graph.loops[loop]}
        markers = s.n_freedoms + np.flatnonzero([one.pair in passed for one in moved])
        turn, arm, grown = _sizes(S[:, np.append(columns, markers)], here.middles[:, loop, 0])
        gap = MODES.ball * grown * np.sqrt((turn**2 + arm**2).sum())
        h2 = turn**2 + (grown * arm + turn * gap) ** 2
        total += 2.0 * float((turn**2).sum() * h2.sum())
    if isinstance(s, RodSystem):
        W, k = s.rod_rows.lines(here)[1][..., 0], s.points
        for rod, columns in enumerate(_columns_of_rods(s)):
            end = rotate(here.poses[:, :3, k.b[rod]], k.at_b[:, rod]) + here.poses[:, 3, k.b[rod]]
            turn, arm, grown = _sizes(S[:, columns], end[:, 0])
            gone = MODES.ball * grown * np.sqrt((arm**2).sum())
            speed, length = np.sqrt(((arm + turn * gone) ** 2).sum()), np.sqrt((W[3:, rod] ** 2).sum()) + gone
            total += float(speed**2 + np.sqrt(2.0 * (turn**2).sum()) * speed * length) ** 2
    return float(np.sqrt(total))


def _sizes(S: Array, point: Array) -> tuple[Array, Array, float]:
    """Sizes ``|w|, |v|`` of twists ``S (6, n)`` about a ``point (3,)``, and how far these grow within ``MODES.ball``."""
    w = S[:3]
    v = S[3:] + cross(w, np.repeat(point[:, None], w.shape[1], axis=1))
    return (
        np.sqrt((w * w).sum(axis=0)),
        np.sqrt((v * v).sum(axis=0)),
        float(np.exp(2 * MODES.ball * np.sqrt(w.shape[1]))),
    )
