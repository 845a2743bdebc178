"""Relations that almost hold between the axes and points of the pairs.

Relations that axes, directions, centres and lengths nearly meet: parallel, perpendicular, intersecting, in one line or place, equal.
Nothing here knows a pair type. What a pair shows of itself follows from its twists: a turn is an axis, in a fixed place where no slide
of the pair moves it aside; one slide is a direction, two are the normal of a plane; three turns about one point are a centre.
Directions are unit vectors, lengths are over L; a miss is an angle (radians) or a length over L.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import System
from mechgraph.maths.se3 import Array, Index, compose, inverse, rotation_exp, rotation_log
from mechgraph.model.pair import Marker, Pair
from mechgraph.pairs.pair_type import PairType

COMPLEX_STEP = 1e-30
"""Step of the complex-step derivatives: exact, as the residuals are analytic."""
LONG = 10.0
"""Lengths of fewer tolerances than this are not compared."""


@dataclass(frozen=True)
class Feature:
    """What a pair shows: its place in the list of pairs, a name, direction ``(3,)`` or None, point ``(3,)`` or None (no fixed place)."""

    pair: int
    name: str
    turns: bool
    direction: Array | None
    point: Array | None

    @property
    def is_line(self) -> bool:
        """Whether it is an axis or groove in a fixed place."""
        return self.direction is not None and self.point is not None


def features(here: Configuration) -> tuple[Feature, ...]:
    """What all pairs show at the first position of a configuration."""
    first, m = here.system.first_column, here.system.m
    return tuple(
        feature
        for k, pair in enumerate(m.pairs)
        for feature in _shown(k, pair.name, pair.type, here.S[:, first[k] : first[k + 1], 0])
    )


def _shown(k: int, name: str, type: PairType, S: Array) -> Iterator[Feature]:
    """Of one pair with twists ``S (6, f)``."""
    turning = [j for j, f in enumerate(type.freedoms) if f.turns]
    # what travels along a bend turns as it slides: it has no direction that relations could be about
    straight = np.abs(S[:3]).max(axis=0, initial=0.0) < 1e-9
    slides = [S[3:, j] for j, f in enumerate(type.freedoms) if not f.turns and straight[j]]
    free = set(turning)
    if any(step.holds_rotation for step in type.steps):
        if all(f.turns for f in type.freedoms):
            center = np.linalg.lstsq(_arms(S[:3, turning]), S[3:, turning].T.ravel(), rcond=None)[0]
            yield Feature(k, f"centre of {name}", True, None, np.asarray(center))
        free = set()
    shown: list[Array] = []
    for j in sorted(free):
        w, v = S[:3, j], S[3:, j]
        if any(abs(w @ d) > 1 - 1e-9 for d in shown):
            continue
        fixed = all(np.linalg.norm(np.cross(s, w)) < 1e-9 for s in slides)
        shown.append(w)
        yield Feature(k, f"axis of {name}", True, w, np.cross(w, v) if fixed else None)
    plane = len(slides) == 2 and bool(np.linalg.norm(np.cross(slides[0], slides[1])) > 1e-9)
    way = np.cross(slides[0], slides[1]) if plane else slides[0] if slides else None
    if way is not None and not any(abs(way @ d) > (1 - 1e-9) * np.linalg.norm(way) for d in shown):
        yield Feature(k, f"{'normal' if plane else 'direction'} of {name}", False, way / np.linalg.norm(way), None)


def _arms(w: Array) -> Array:
    """Matrix of ``v = c x w`` in the point ``c``, for turns ``(3, n)``: ``(3 n, 3)``."""
    return np.concatenate([np.cross(np.eye(3), u).T for u in w.T])


@dataclass(frozen=True)
class Relation:
    """A relation of ``kind`` between ``features`` (places in the list), missed by ``miss``."""

    kind: str
    features: tuple[int, ...]
    miss: float
    text: str
    angular: bool = False


class Relations:
    """The features of a configuration, and the relations that they nearly meet."""

    def __init__(self, here: Configuration, frames: Array) -> None:
        self.m, self.features, self.frames = here.system.m, features(here), frames
        self.owner = np.array([f.pair for f in self.features], dtype=np.intp)
        zero = np.zeros(3)
        self.d = np.array([zero if f.direction is None else f.direction for f in self.features]).reshape(-1, 3)
        self.p = np.array([zero if f.point is None else f.point for f in self.features]).reshape(-1, 3)
        self.e = np.array([_square(d) for d in self.d]).reshape(-1, 2, 3)

    # --- finding -----------------------------------------------------------------------------------------------------

    def near(self, tol: float) -> tuple[Relation, ...]:
        """Relations missed by no more than two things may, each meant to ``tol``; lines also by the arms to where they come nearest."""
        return (*self._directions(2 * tol), *self._places(tol), *self._lengths(2 * tol))

    def _directed(self) -> list[int]:
        return [i for i, f in enumerate(self.features) if f.direction is not None]

    @cached_property
    def _angles(self) -> tuple[Array, Array]:
        """Angles between directions to parallel and to a right angle ``(K, K)``."""
        sine = np.linalg.norm(np.cross(self.d[:, None], self.d[None]), axis=2)
        cosine = np.abs(self.d @ self.d.T)
        return np.arctan2(sine, cosine), np.arctan2(cosine, sine)

    def _groups(self, width: float) -> list[list[int]]:
        """Directions in groups of parallel ones: each with the first one that is as near as ``width``."""
        groups: list[list[int]] = []
        for i in self._directed():
            near = [g for g in groups if self._angles[0][g[0], i] <= width]
            if near:
                min(near, key=lambda g: self._angles[0][g[0], i]).append(i)
            else:
                groups.append([i])
        return groups

    def _directions(self, width: float) -> Iterator[Relation]:
        groups = self._groups(width)
        for group in groups:
            for i in group[1:]:
                yield self._relation("parallel", (group[0], i), self._angles[0][group[0], i])
        for a, group in enumerate(groups):
            for other in groups[a + 1 :]:
                i, j = group[0], other[0]
                if self._angles[1][i, j] <= width and self.owner[i] != self.owner[j]:
                    yield self._relation("perpendicular", (i, j), self._angles[1][i, j])

    def _places(self, tol: float) -> Iterator[Relation]:
        placed = [i for i, f in enumerate(self.features) if f.point is not None]
        group = {i: n for n, members in enumerate(self._groups(2 * tol)) for i in members}
        for a, i in enumerate(placed):
            rest = np.array(placed[a + 1 :], dtype=np.intp)
            apart, arms = self._apart(i, rest, 2 * tol)
            # longest arm (over L) that counts: lines that come nearest farther away are as good as parallel
            near = (apart <= tol * (2.0 + np.minimum(arms, 10.0))) & (self.owner[rest] != self.owner[i])
            for j, miss in zip(rest[near].tolist(), apart[near].tolist(), strict=True):
                f, g = self.features[i], self.features[j]
                if f.is_line and g.is_line:
                    parallel = group[i] == group[j]
                    yield self._relation("in one line" if parallel else "intersecting", (i, j), miss)
                elif f.is_line or g.is_line:
                    yield self._relation("through", (i, j) if f.is_line else (j, i), miss)
                else:
                    yield self._relation("in one place", (i, j), miss)

    def _apart(self, i: int, rest: Index, width: float) -> tuple[Array, Array]:
        """Distances ``(n,)`` of lines and points from one of them, and the arms from their pairs to the places where they come nearest.

        Lines at an angle of no more than ``width`` count as parallel.
        """
        to, d, e = self.p[rest] - self.p[i], self.d[rest], self.d[i]
        cosine = d @ e
        sine2 = (np.cross(e, d) ** 2).sum(axis=1)
        both = sine2 > max(width, 1e-6) ** 2
        safe = np.where(both, sine2, 1.0)
        # feet on two lines; where one is a point or they are parallel, the foot on a line of them
        first, last = to @ e, (to * d).sum(axis=1)
        s = np.where(both, (first - cosine * last) / safe, first)
        t = np.where(both, (cosine * first - last) / safe, np.where(e.any(), 0.0, -last))
        gap = np.linalg.norm(to + t[:, None] * d - s[:, None] * e, axis=1)
        at = self.frames[:, 3, self.owner[rest]].T
        arms = [np.linalg.norm(self.p[rest] + t[:, None] * d - at, axis=1)]
        arms.append(np.linalg.norm(self.p[i] + s[:, None] * e - self.frames[:, 3, self.owner[i]], axis=1))
        return gap, np.where(both, arms[0] + arms[1], np.minimum(*arms))

    def _lengths(self, width: float) -> Iterator[Relation]:
        """Equal distances, on different links, of parallel axes and of centres."""
        on_link: dict[str, list[int]] = {}
        for i, f in enumerate(self.features):
            if f.point is not None:
                for end in (self.m.pairs[f.pair].a, self.m.pairs[f.pair].b):
                    on_link.setdefault(end, []).append(i)
        found: list[tuple[float, str, int, int]] = []
        for link, members in on_link.items():
            for a, i in enumerate(members):
                for j in members[a + 1 :]:
                    like = self.features[i].is_line == self.features[j].is_line and self.owner[i] != self.owner[j]
                    if like and (not self.features[i].is_line or self._angles[0][i, j] <= width):
                        length = float(self._apart(i, np.array([j]), width)[0][0])
                        if length > LONG * width:
                            found.append((length, link, i, j))
        found.sort(key=lambda item: item[0])
        for shorter, longer in pairwise(found):
            if longer[0] - shorter[0] <= width and shorter[1] != longer[1]:
                text = f"{_two(self, *shorter[2:])} ({shorter[1]}) and {_two(self, *longer[2:])} ({longer[1]}) equally far apart"
                yield Relation("equal", (*shorter[2:], *longer[2:]), longer[0] - shorter[0], text)

    def _relation(self, kind: str, which: tuple[int, int], miss: float) -> Relation:
        i, j = which
        names = f"{self.features[i].name} {kind} {self.features[j].name}"
        if kind != "through":
            names = f"{self.features[i].name} and {self.features[j].name} {kind}"
        return Relation(kind, which, float(miss), names, kind in ("parallel", "perpendicular"))

    # --- meeting -----------------------------------------------------------------------------------------------------

    def rows(self, relations: tuple[Relation, ...], change: Array) -> list[tuple[Array, Array, Index]]:
        """Residual ``(n,)``, derivatives ``(n, m)`` and their columns ``(m,)`` of every relation after ``change (6, P)`` of the pairs."""
        R = rotation_exp(change[:3])[:, :, self.owner].transpose(2, 0, 1)
        at = self.frames[:, 3, self.owner].T
        d, e = np.einsum("kij,kj->ki", R, self.d), np.einsum("kij,knj->kni", R, self.e)
        arm = np.einsum("kij,kj->ki", R, self.p - at)
        p = at + change[3:, self.owner].T + arm
        return [self._row(relation, d, e, p, arm) for relation in relations]

    def _row(self, relation: Relation, d: Array, e: Array, p: Array, arm: Array) -> tuple[Array, Array, Index]:
        which = np.array(relation.features)
        owners = np.unique(self.owner[which])
        m = 6 * len(owners)
        w, t = np.zeros((len(which), m, 3)), np.zeros((len(which), m, 3))
        for n, i in enumerate(which):
            at = 6 * int(np.searchsorted(owners, self.owner[i]))
            w[n, at : at + 3], t[n, at + 3 : at + 6] = np.eye(3), np.eye(3)
        D = d[which][:, None] + 1j * COMPLEX_STEP * np.cross(w, d[which][:, None])
        E = e[which][:, :, None] + 1j * COMPLEX_STEP * np.cross(w[:, None], e[which][:, :, None])
        P = p[which][:, None] + 1j * COMPLEX_STEP * (t + np.cross(w, arm[which][:, None]))
        r = _RESIDUALS[relation.kind](D, E, P)
        columns = (6 * owners[:, None] + np.arange(6)).ravel()
        return r[:, 0].real, r.imag / COMPLEX_STEP, columns


def _square(d: Array) -> Array:
    """Two unit vectors square to a direction ``(3,)`` and to each other, ``(2, 3)``."""
    if not d.any():
        return np.zeros((2, 3))
    return np.linalg.svd(d[None])[2][1:]


def _two(of: Relations, i: int, j: int) -> str:
    return " and ".join(of.m.pairs[of.features[k].pair].name for k in (i, j))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray((a * b).sum(axis=-1))


def _across(D: Array, P: Array) -> Array:
    """Distance of two points across the first direction (zero: of centres)."""
    to = P[1] - P[0]
    to = to - _dot(to, D[0])[:, None] * D[0]
    return np.sqrt(_dot(to, to))


def _meeting(D: Array, E: Array, P: Array) -> Array:
    normal = np.cross(D[0], D[1])
    return (_dot(P[1] - P[0], normal) / np.sqrt(_dot(normal, normal)))[None]


_RESIDUALS: dict[str, Callable[[Array, Array, Array], Array]] = {
    "parallel": lambda D, E, P: _dot(E[0], D[1]),
    "perpendicular": lambda D, E, P: _dot(D[0], D[1])[None],
    "intersecting": _meeting,
    "in one line": lambda D, E, P: _dot(E[0], P[1] - P[0]),
    "through": lambda D, E, P: _dot(E[0], P[1] - P[0]),
    "in one place": lambda D, E, P: (P[1] - P[0]).T,
    "equal": lambda D, E, P: (_across(D[:2], P[:2]) - _across(D[2:], P[2:]))[None],
}
"""What a relation leaves open ``(n, m)``, of directions, square directions and points of its features, for ``m`` perturbations."""


EXACT = 1e-13
"""Residual with which a relation, or a loop, counts as exact."""


class PlacedPairs:
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
