"""Near-special geometry made exact with the least change.

Relations that axes, directions, centers and lengths nearly meet: parallel, perpendicular, intersecting, in one line or place, equal.
Nothing here knows a pair type. What a pair shows of itself follows from its twists: a turn is an axis, in a fixed place where no slide
of the pair moves it aside; one slide is a direction, two are the normal of a plane; three turns about one point are a center.
Directions are unit vectors, lengths are over L; a miss is an angle (radians) or a length over L.

The mechanism with the smallest change that makes near-special geometry exact.
Every pair is moved as a whole, by a small turn w_k about its point and a shift t_k, where it stands in the closed start (with
loops that close only to the tolerance: closed in the least-squares sense, the misfit shared by all pairs). Among all changes that meet

    the relations of axes, directions, centers and lengths that are missed by no more than the tolerance (``Relations``), and
    N_i^T (c_i + C_i (w, t)) = 0   at positions i along the motions that the tolerance leaves,

the smallest is taken, sum over the pairs of w^2 + (t / L)^2, by successive linearization. c_i is what the loops leave open, C_i its
derivative in the changes, N_i the self-stresses there: loops close at a position where no self-stress does work on what they leave open.
The second line needs no name for what makes a mechanism move (Bennett, Bricard, parallel cranks, ...); the first is what people mean
where the second leaves a choice: a planar four-bar is nearest to spherical ones with a far apex.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property, partial
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
import scipy

from mechgraph.document import Document, Paragraph, Shown, Table
from mechgraph.errors import Budget, DeclarationError, SearchEnded
from mechgraph.fields import tolerance_fault
from mechgraph.kinematics.assembly import closed_start
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import singular_values
from mechgraph.maths.se3 import Array, Index, compose, cross, inverse, rotation_exp, rotation_log
from mechgraph.maths.tolerances import COMPLEX_STEP
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Marker, Pair
from mechgraph.model.parameters import Declared
from mechgraph.pairs.pair_type import PairType


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
            yield Feature(k, f"center of {name}", True, None, np.asarray(center))
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
        """Equal distances, on different links, of parallel axes and of centers."""
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
                        # lengths of fewer tolerances than this are not compared
                        if length > 10.0 * width:
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
    """Distance of two points across the first direction (zero: of centers)."""
    to = P[1] - P[0]
    to = to - _dot(to, D[0])[:, None] * D[0]
    return np.sqrt(_dot(to, to))


def _lines_meet(D: Array, E: Array, P: Array) -> Array:
    normal = np.cross(D[0], D[1])
    return (_dot(P[1] - P[0], normal) / np.sqrt(_dot(normal, normal)))[None]


_RESIDUALS: dict[str, Callable[[Array, Array, Array], Array]] = {
    "parallel": lambda D, E, P: _dot(E[0], D[1]),
    "perpendicular": lambda D, E, P: _dot(D[0], D[1])[None],
    "intersecting": _lines_meet,
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
    ``budget`` what may be spent on what is sought of them.
    """

    def __init__(self, here: Configuration, budget: Budget | None = None) -> None:
        self.here, self.system, self.budget = here, here.system, budget or Budget(np.inf)
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


SLACK = 1.001
"""A tolerance is met up to this factor: it may be the printed size of the change itself."""
NEARER, FARTHER = 0.12, 0.3
"""Steps between the positions along a motion: at first, and once the loops close at those."""
POSITIONS, MOST_ROWS = 5, 60
"""Positions along a motion each way; closure rows up to which motions are followed, by dense decompositions."""


def least_change(placed: PlacedPairs, tol: float) -> tuple[Array, tuple[Relation, ...], tuple[Relation, ...], bool]:
    """Change ``(6, P)``, relations met and dropped, and whether motions asked for more."""
    none = np.zeros((6, placed.frames.shape[2]))
    declared = placed.changed(none)
    found = Relations(Configuration(declared, placed.x[:, None]), placed.frames)
    change, met, dropped = _meeting(placed, found, found.near(tol), tol)
    if placed.system.n_rows > MOST_ROWS:
        return change, met, dropped, False
    # parts of the tolerance: relations that are nearer than others stay, where not all let the mechanism move
    sure = [{r.text for r in found.near(tol * part)} for part in (0.25, 0.0625)]
    sets = dict.fromkeys((met, *(tuple(r for r in met if r.text in texts) for texts in sure), ()))
    for mobility in range(_mobility(declared, placed.x, tol), _mobility(placed.changed(change), placed.x, 0.0), -1):
        for relations in sets:
            moving = _moving(placed, found, relations, mobility, tol)
            if moving is not None:
                return moving, relations, (*dropped, *(r for r in met if r not in relations)), True
    return change, met, dropped, False


def _mobility(system: System, x: Array, tol: float) -> int:
    """Mobility at a state, singular values of less than the change that ``tol`` may make of them being zero."""
    s = singular_values(Configuration(system, x[:, None]).J[:, :, 0])
    change = weakness(system, tol) + EXACT * (s[0] if s.size else 1.0)
    return system.n_freedoms - int((s > change).sum())


def weakness(system: System, tol: float) -> float:
    """Singular value of the closure rows that changes of every pair by ``tol`` may make."""
    return 4.0 * tol * float(np.sqrt(len(system.m.pairs)))


def _meeting(
    placed: PlacedPairs, found: Relations, near: tuple[Relation, ...], tol: float
) -> tuple[Array, tuple[Relation, ...], tuple[Relation, ...]]:
    """The smallest change that meets all relations that hold together within the tolerance; these, and those left out."""
    dropped: list[Relation] = []
    while True:
        change, rest = _solved(placed, partial(_relation_rows, found, near))
        size = np.max(placed.moved(change), axis=0, initial=0.0)
        if not near or (rest.max(initial=0.0) <= EXACT and size.max() <= SLACK * tol):
            return change, near, tuple(dropped)
        open_ = np.array([np.abs(row[0]).max() for row in found.rows(near, change)])
        misses = np.array([r.miss for r in near])
        weight = np.where(open_ > EXACT, misses, 0.0) if open_.max() > EXACT else _weights(found, near, size, tol)
        # part of the worst miss from which relations that do not hold together are dropped at a time: the least likely
        # to be meant
        out = weight >= 0.7 * weight.max()
        dropped += [r for r, gone in zip(near, out, strict=True) if gone]
        near = tuple(r for r, gone in zip(near, out, strict=True) if not gone)


def _weights(found: Relations, near: tuple[Relation, ...], size: Array, tol: float) -> Array:
    """The misses of the relations of pairs that would move by more than the tolerance."""
    far = set(np.flatnonzero(size > SLACK * tol).tolist())
    return np.array([r.miss if far & {int(found.owner[f]) for f in r.features} else 0.0 for r in near])


Rows: TypeAlias = "tuple[Array, scipy.sparse.csr_array]"


def _relation_rows(found: Relations, relations: tuple[Relation, ...], change: Array) -> Rows:
    """Residuals ``(n,)`` and their derivatives ``(n, 6 P)``, sparse; the columns are those of ``change`` pair by pair."""
    parts = found.rows(relations, change)
    r = np.concatenate([np.zeros(0), *(p[0] for p in parts)])
    data, rows, columns, at = [np.zeros(0)], [np.zeros(0, dtype=int)], [np.zeros(0, dtype=int)], 0
    for residual, D, c in parts:
        n = len(residual)
        data.append(D.ravel())
        rows.append(np.repeat(np.arange(at, at + n), len(c)))
        columns.append(np.tile(c, n))
        at += n
    entries = np.concatenate(data), (np.concatenate(rows), np.concatenate(columns))
    return r, scipy.sparse.csr_array(entries, shape=(len(r), change.size))


def _solved(
    placed: PlacedPairs, rows_at: Callable[[Array], Rows], begin: Array | None = None, most: float = 1.0
) -> tuple[Array, Array]:
    """The smallest change with residual zero, by least-norm linearizations from ``begin``; and what is left of the residuals.

    Given up where a part of it exceeds ``most``.

    Rows that depend on each other do so at the solution only: singular values of the size of the residual count as zero.
    """
    change = np.zeros((6, placed.frames.shape[2])) if begin is None else begin
    best, least = change, np.full(1, np.inf)
    # most linearizations; each leaves a part of the size of the change
    for _ in range(25):
        r, A = rows_at(change)
        placed.budget.spend(3e-3 + 3e-4 * len(r))  # measured, as the others
        if not r.size or np.abs(r).max() < np.abs(least).max():
            best, least = change, np.abs(r)
        if not r.size or np.abs(r).max() <= EXACT / 10:
            break
        wanted = A @ change.T.ravel() - r
        cut = min(max(30.0 * float(np.abs(r).max()), 1e-8), 0.05)
        change = _least_norm(A, wanted, cut, placed.budget).reshape(-1, 6).T
        if not np.isfinite(change).all() or np.abs(change).max() > most:
            break
    return best, least


def _least_norm(A: scipy.sparse.csr_array, b: Array, cut: float, budget: Budget) -> Array:
    """The smallest ``x`` with least ``|A x - b|``; singular values below ``cut`` times the largest are dropped."""
    n, m = A.shape
    if m > 1200:  # numbers to be changed from which on relations are met by an iterative least-norm solution
        x, _, steps, *_ = scipy.sparse.linalg.lsmr(A, b, atol=1e-15, btol=1e-15, conlim=1 / cut, maxiter=20 * n)
        budget.spend(steps * (1e-4 + 7e-9 * A.nnz))
        return np.asarray(x)
    budget.spend(7e-9 * n * m * min(n, m))
    return np.asarray(scipy.linalg.lstsq(A.toarray(), b, cond=cut, check_finite=False)[0])


# --- motions ------------------------------------------------------------------------------------------------------------------


def _moving(
    placed: PlacedPairs, found: Relations, relations: tuple[Relation, ...], mobility: int, tol: float
) -> Array | None:
    """The smallest change that meets relations and lets the mechanism move with that mobility; None where there is none within ``tol``."""
    rank = placed.system.n_freedoms - mobility
    change = _solved(placed, partial(_relation_rows, found, relations))[0]
    for step in (NEARER, FARTHER):
        states = _followed(placed.changed(change), placed.x, rank, step, 100.0 * tol if step == NEARER else 10.0 * tol)
        if states is None:
            return None
        # tolerances beyond which a change on the way is given up: the first linearizations overshoot
        change, rest = _solved(placed, partial(_rows_along, placed, found, relations, states, rank), change, 4.0 * tol)
        # hundredth of the residual with which positions near the start, which tell little from each other, lead on to farther
        # ones
        if rest.max() > (1e-10 if step == NEARER else EXACT) * 100 or np.max(placed.moved(change)) > SLACK * tol:
            return None
    return change


def _rows_along(
    placed: PlacedPairs, found: Relations, relations: tuple[Relation, ...], states: Array, rank: int, change: Array
) -> Rows:
    """The rows of relations, and those of loops closed again at states ``(nx, T)``."""
    r, A = _relation_rows(found, relations, change)
    left, C = _closing_rows(placed, change, states, rank)
    return np.concatenate([r, left]), scipy.sparse.csr_array(scipy.sparse.vstack([A, scipy.sparse.csr_array(C)]))


def _followed(system: System, x: Array, rank: int, step: float, open_: float) -> Array | None:
    """States ``(nx, T)`` along the motions that are left where only ``rank`` rows count, as far as the loops close to ``open_``."""
    # seed of these motions
    rng = np.random.default_rng(11)
    mobility, out = system.n_freedoms - rank, []
    # random motions that are followed, each both ways; one where there is but one
    for _ in range(4 if mobility > 1 else 1):
        wish = rng.normal(size=system.n_freedoms)
        for sign in (1.0, -1.0):
            at, way = x[:, None], sign * wish
            for _ in range(POSITIONS):
                here = Configuration(system, at)
                null = np.linalg.svd(here.J[:, :, 0])[2][rank:]
                way = null.T @ (null @ way)
                at = _closed(system, system.advance(at, (step * way / np.abs(way).max())[:, None]), rank)
                if not np.isfinite(at).all() or Configuration(system, at).closure[0] > open_:
                    break
                out.append(at)
    return np.concatenate(out, axis=1) if len(out) > POSITIONS else None


def _closed(system: System, x: Array, rank: int, times: int = 4) -> Array:
    """States ``(nx, T)`` after some least-squares corrections with the ``rank`` largest singular values; NaN where a belt lets go."""
    for _ in range(times):
        here = Configuration(system, x)
        if not np.isfinite(here.J).all():
            return np.full_like(x, np.nan)
        U, s, Vt = np.linalg.svd(here.J.transpose(2, 0, 1), full_matrices=False)
        part = np.einsum("tmr,mt->tr", U[:, :, :rank], here.residual) / s[:, :rank]
        x = system.advance(x, -np.einsum("tr,trn->nt", part, Vt[:, :rank]))
    return x


def _closing_rows(placed: PlacedPairs, change: Array, states: Array, rank: int) -> tuple[Array, Array]:
    """What self-stresses do on what the loops leave open after a change, closed again from states ``(nx, T)``; with its derivatives."""
    system = placed.changed(change)
    here = Configuration(system, _closed(system, states, rank))
    stress = np.linalg.svd(here.J.transpose(2, 0, 1))[0][:, :, rank:]
    C, n = np.zeros((here.T, system.n_rows, change.size)), system.graph.loop_rows
    twists = np.einsum("lp,ipct->ilpct", system.graph.loop_matrix, placed.carried(change, here))
    twists[3:] += cross(twists[:3], np.broadcast_to(here.middles[:, :, None, None], twists[:3].shape))
    C[:, :n] = twists[system.graph.span].transpose(4, 1, 0, 2, 3).reshape(here.T, n, change.size)
    r = np.einsum("tmk,mt->tk", stress, here.residual)
    return r.ravel(), np.einsum("tmk,tmn->tkn", stress, C).reshape(r.size, -1)


GIVEN_UP = "{} {!r}: what makes its geometry exact to tol={:g} was not found in {:g} s; pass limit= to look longer, or leave tol out"
"""What is said of a mechanism that is not made exact in time."""


@dataclass(frozen=True)
class MovedPair:
    """What one pair was moved: a turn (radians) and a shift (in the unit of length of the mechanism)."""

    pair: str
    angle: float
    shift: float


@dataclass(frozen=True, repr=False)
class Changes(Shown):
    """What ``Mechanism.snapped`` changed; prints as a table.

    ``moved`` what it moved, ``met`` the relations that are exact now, ``dropped`` those that cannot hold together with them within ``tol``
    (none of these is applied), ``largest`` change (radians, or length / ``L``), ``closure`` with which the loops met before; ``mobile``:
    further conditions, which have no name, were met for it to move.
    """

    tol: float
    moved: tuple[MovedPair, ...]
    met: tuple[Relation, ...]
    dropped: tuple[Relation, ...]
    largest: float
    closure: float
    mobile: bool
    L: float

    def document(self) -> Document:
        """The table as a document."""
        rows = [(c.pair, f"{np.degrees(c.angle):.3g}", f"{c.shift:.3g}") for c in self.moved]
        blocks: list[Any] = [Table(("pair", "turned [deg]", "shifted"), tuple(rows), align="lrr")] if rows else []
        for title, relations in (
            ("Exact now", [r for r in self.met if r.miss > EXACT]),
            ("Cannot hold together with these within the tolerance, not applied", self.dropped),
        ):
            if relations:
                lines = [
                    (r.text, f"{np.degrees(r.miss):.3g} deg" if r.angular else f"{r.miss:.3g} L") for r in relations
                ]
                blocks += [Paragraph(f"{title}:"), Table(("relation", "missed by"), tuple(lines), align="lr")]
        if self.mobile:
            blocks.append(
                Paragraph("Dimensions were fitted to each other so that the loops close all along the motion.")
            )
        head = f"With a tolerance of {self.tol:.3g} (radians, lengths / L) "
        head += f"the largest change is {self.largest:.3g}." if rows else "nothing is changed."
        return Document("", (Paragraph(head), *blocks))


class SnappedMechanism(Mechanism):
    """A mechanism with the ``changes`` that made it of the one that was ``declared``; copies of it are plain mechanisms."""

    changes: Changes
    declared: Mechanism


def snapped(m: Mechanism, tol: float, budget: Budget | None = None) -> SnappedMechanism:
    """The mechanism with the smallest change, ``sum angle^2 + (shift / L)^2`` over the pairs, that makes near-special geometry exact.

    Raises
    ------
    DeclarationError
        where ``tol`` is no number above 0 and at most 0.1, or the mechanism has no geometry.
    AssemblyError
        where the loops do not even close to ``tol``.
    SearchEnded
        where nothing is left of the ``budget``.
    """
    fault = tolerance_fault(tol)
    if fault:
        raise DeclarationError(f"mechanism {m.name!r}", [fault])
    here = closed_start(m, tol=tol)
    placed = PlacedPairs(here, budget)
    change, met, dropped, mobile = least_change(placed, tol)
    pairs = placed.pairs(change)
    L, moved = here.system.par.L, placed.moved(change)
    rows = [
        MovedPair(pair.name, float(angle) if angle > EXACT else 0.0, float(shift * L) if shift > EXACT else 0.0)
        for pair, angle, shift in zip(m.pairs, *moved, strict=True)
        if max(angle, shift) > EXACT
    ]
    changes = Changes(
        tol, tuple(rows), met, dropped, float(np.max(moved, initial=0.0)), float(here.closure[0]), mobile, L
    )
    return _made(m, changes, pairs=pairs, start=placed.start, tol=tol)


def _made(m: Mechanism, changes: Changes, like: Mechanism | None = None, **fields: Any) -> SnappedMechanism:
    """What was made of ``m`` by changes: ``like`` it (left out, like ``m``) with other fields."""
    kept = like or m
    out = SnappedMechanism(**{**{k: getattr(kept, k) for k in kept.formats}, **fields})
    object.__setattr__(out, "changes", changes)
    object.__setattr__(out, "declared", m)
    return out


def started(m: Mechanism, start: Mapping[str, float]) -> Mechanism:
    """The same with another start; what was snapped stays so."""
    if isinstance(m, SnappedMechanism):
        return _made(m.declared, m.changes, like=m, start=start)
    return m.replace(start=start)


def meant(m: Mechanism, tol: float | None, call: str, limit: float = np.inf) -> Mechanism:
    """The mechanism as it is meant with the tolerance of a call, or its own; itself where there is none, or nothing to move.

    Raises
    ------
    SearchEnded
        where that takes more than ``limit`` seconds (see ``errors.Budget``).
    """
    tol = m.tol if tol is None else tol
    if tol is None or isinstance(m, SnappedMechanism):
        return m
    fault = tolerance_fault(tol)
    if fault:
        raise DeclarationError(f"{call} {m.name!r}", [fault])
    if not m.has_geometry:
        return m
    try:
        return snapped(m, tol, Budget(limit))
    except SearchEnded as error:
        raise SearchEnded(GIVEN_UP.format(call, m.name, tol, limit)) from error


def candidates(m: Mechanism, tol: float) -> Array:
    """Sizes of the changes that near relations and nearly dependent closure rows ask for, and of the misfit of the loops."""
    here = closed_start(m, tol=tol)
    placed = PlacedPairs(here)
    declared = Configuration(placed.changed(np.zeros_like(placed.misfit)), placed.x[:, None])
    sizes = [r.miss / 2 for r in Relations(declared, placed.frames).near(tol)] + [float(here.closure[0])]
    s = singular_values(declared.J[:, :, 0]) if here.system.n_rows <= MOST_ROWS else np.zeros(0)
    weak = s[(s > EXACT * s.max(initial=0.0)) & (s < weakness(here.system, tol))] if s.size else s
    return np.array([*sizes, *(weak * tol / weakness(here.system, tol)).tolist()])


def declared_closure(system: System, numbers: Declared, x: Array, which: Index) -> Array:
    """Closure errors ``(T,)`` at states ``x (nx, T)`` of what was snapped, with the ``numbers`` as declared of variants ``which (T,)``."""
    par = system.par
    own = numbers.with_rest(system.m).parameters(system.m, par.offset, par.origin, par.L)
    return Configuration(system.with_parameters(own).cases(which), x).closure
