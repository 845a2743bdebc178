"""A mechanism that stands somewhere, as everything that is drawn of it needs it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import Any, Literal

import numpy as np

from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.model.loads import Gravity, Law
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.pairs import pair_type as evaluation
from mechgraph.pairs.cams import Groove
from mechgraph.pairs.contact_types import is_open, takes_curves
from mechgraph.pairs.curves import Travel, outside
from mechgraph.pairs.travelling import AlongCurve, Beside
from mechgraph.show import shapes
from mechgraph.show.shapes import FreedomLine, Shape, frame_along, lines_of
from mechgraph.show.wheels import gears_of

FLAT_THICKNESS = 1e-6
"""Thickness over extent below which a mechanism is drawn as a plane one, and a link as a plate; points closer than that are one."""

Role = Literal[
    "link",
    "plate",
    "wheel",
    "face",
    "roller",
    "strand",
    "tie",
    "guide",
    "body",
    "dark",
    "axis",
    "foot",
    "center",
    "point",
    "spring",
    "load",
    "drive",
    "reaction",
]


@dataclass(frozen=True)
class DrawnPart:
    """One body of a drawing.

    ``role`` says how it is painted: ``link`` (rods) and ``plate`` in the color of ``link``, ``guide`` likewise but translucent, ``body``
    (white) and ``dark`` of a pair symbol, ``axis`` (a line), ``tie`` (from a link to a point off it), ``foot`` (of the frame), ``center``
    and ``point`` (one vertex), ``spring``, ``load``, ``drive``, ``reaction``; ``wheel`` (a tint of the color of its link) and ``strand`` of
    a belt. ``owner`` is the name of the pair, link, point, load, gear or belt. It is drawn where a unit of length has so many pixels as
    ``scales`` says.
    """

    role: Role
    owner: str
    link: str
    frame: str
    shape: Shape
    dashed: bool = False
    scales: tuple[float, float] = (0.0, np.inf)


@dataclass(frozen=True)
class Label:
    """A text that belongs to the point ``at (3,)`` of a frame; ``link`` gives its color, empty for ink."""

    kind: Literal["pair", "link", "point"]
    text: str
    owner: str
    link: str
    frame: str
    at: Array


@dataclass(frozen=True)
class DrawnPlace:
    """Where a mechanism stands at ``T`` positions: link poses ``(T, 4, 4)`` and coordinates of every pair ``(f, T)``."""

    poses: Mapping[str, Array]
    coordinates: Mapping[str, Array]


class DrawnPose:
    """A mechanism at ``T`` places: what its parts are made from.

    Attributes
    ----------
    frames : name -> affine maps ``(T, 3, 4)``; those of links and pairs, to which parts add their own.
    points : pair points ``points[pair, link]``, ``(T, 3)``.
    everything : these, mass centers and points of interest, ``(n, 3)``.
    normal : of the plane in which all of these lie, else None.
    size, symbol : extent over all positions, and half width of the largest symbols.
    gravity : the vector g, None where there is none.
    """

    def __init__(self, m: Mechanism, place: DrawnPlace, count: int) -> None:
        self.m, self.place, self.count = m, place, count
        self.frames: dict[str, Array] = {"": np.broadcast_to(np.eye(3, 4), (count, 3, 4))}
        self.frames |= {f"link:{name}": pose[:, :3] for name, pose in place.poses.items()}
        for pair in m.pairs:
            for k, frame in enumerate(self._pair_frames(pair)):
                self.frames[f"pair:{pair.name}@{k}"] = frame
        ends = ((p, link, k) for p in m.pairs for link, k in ((p.a, 0), (p.b, p.type.f)))
        self.points = {(p.name, link): self.frames[f"pair:{p.name}@{k}"][:, :, 3] for p, link, k in ends}
        self.wheels, _, self.belts = gears_of(m, {name: pose[0, :3] for name, pose in place.poses.items()})
        of_links = [
            self.on(k.name, c) for k in m.links for c in (*k.points.values(), *([k.center] if k.mass > 0 else []))
        ]
        rims = [self.on(w.link, p) for w in self.wheels for p in w.extent()]
        rims += [self.on(link, p) for pair in m.pairs for link, points in _profiles(pair) for p in points]
        self.everything = np.concatenate([*self.points.values(), *of_links, *rims])
        self.normal = self._plane()
        self.size = float(np.linalg.norm(np.ptp(self.everything, axis=0))) or 1.0
        # half width of a symbol over the extent of the mechanism, where pairs leave room for it
        self.symbol = 0.026 * self.size
        weights = (np.asarray(load.acceleration, dtype=float) for load in m.loads if isinstance(load, Gravity))
        self.gravity = next((g for g in weights if g.any()), None)

    def _plane(self) -> Array | None:
        """The normal of the plane of the mechanism: all points lie in it, what can only turn does so about the normal, and what can only
        slide does so across it. Points on one line lie in the plane about the normal of which things turn.
        """
        if self.m.planar:
            return np.array([0.0, 0.0, 1.0])
        ways = [
            (self.frames[f"pair:{pair.name}@0"][0, :, :3] @ line.direction, line.turns)
            for pair in self.m.pairs
            if pair.type.f == 1
            for line in lines_of(pair.type, pair.pitch_per_radian)
        ]
        normal = plane_normal(self.everything, next((axis for axis, turns in ways if turns), None))
        if normal is None:
            return None
        off = [np.linalg.norm(np.cross(way, normal)) if turns else abs(way @ normal) for way, turns in ways]
        return normal if max(off, default=0.0) < FLAT_THICKNESS else None

    def _pair_frames(self, pair: Pair) -> list[Array]:
        """Frames 0, 1, ... of a pair ``(T, 3, 4)``."""
        base, marker = self.place.poses[pair.a][:, :3], pair.markers[0].pose()
        origin = base[:, :, :3] @ marker[:, 3] + base[:, :, 3]
        start = np.concatenate([base[:, :, :3] @ marker[:, :3], origin[:, :, None]], axis=2)
        x = evaluation.coordinates_to_state(pair.type, self.place.coordinates[pair.name][:, None])
        pitch = np.array([[pair.pitch_per_radian]])
        found = evaluation.frames_of(pair.type, pitch, x, np.moveaxis(start, 0, -1)[:, :, None])
        return [np.moveaxis(frame[:, :, 0], -1, 0) for frame in found]

    def on(self, link: str, point: Any) -> Array:
        """A point of a link, given in its frame or by its name, in the global frame, ``(T, 3)``."""
        X = self.place.poses[link][:, :3]
        return np.asarray(X[:, :, :3] @ self.local(link, point) + X[:, :, 3])

    def local(self, link: str, point: Any) -> Array:
        """A point of a link, given by its coordinates or its name, in the link's frame."""
        return np.asarray(self.m.link(link).point(point) if isinstance(point, str) else point, dtype=float)

    def corners(self, link: str) -> list[Array]:
        """What a link joins, in its own frame: points of the pairs that bear it, middles of its gears, and where springs hold it.

        Not where something runs on its profile, which is drawn as such, nor where a guide of its own stands on the ground; of a body
        with a groove around it the middle.
        """
        ends = (
            np.asarray(p.markers[k].point, dtype=float)
            + k * self.piston(p) * (p.markers[k].pose()[:, :3] @ slide_of(p))
            for p, k in self.ends_on.get(link, ())
            if not (
                any(step.back == bool(k) and (is_profile(p, step) or is_groove(step)) for step in takes_curves(p.type))
                or (not k and self.grounded(p))
            )
        )
        laws = (load for load in self.m.loads if isinstance(load, Law) and load.between_links)
        sides = ((load, side) for load in laws for side in (0, 1) if (load.a, load.b)[side] == link)
        X = self.place.poses[link][0]
        held = ((self.held(load)[side][0] - X[:3, 3]) @ X[:3, :3] for load, side in sides)
        shafts = (w.at for w in self.wheels if w.link == link and link != self.m.frame)
        curves = (
            (step.curve, p.b if step.back else p.a)
            for p, _ in self.ends_on.get(link, ())
            for step in takes_curves(p.type)
        )
        middles = (np.asarray(curve.center) for curve, own in curves if isinstance(curve, Groove) and own == link)
        return [*ends, *shafts, *middles, *held]

    @cached_property
    def ends_on(self) -> dict[str, list[tuple[Pair, int]]]:
        """The pairs that bear a link, by its name, and whether it is their link a (0) or b (1)."""
        out: dict[str, list[tuple[Pair, int]]] = {}
        for p in self.m.pairs:
            for k, link in enumerate((p.a, p.b) if p.type.bears else ()):
                out.setdefault(link, []).append((p, k))
        return out

    def piston(self, pair: Pair) -> float:
        """How far from its marker on link b the piston of a cylinder is drawn, along its slide; 0 of other pairs.

        Where the marker is at the eye of link a, as that of a cylinder between two eyes: so that barrel and rod are as long as they may be.
        """
        lines = lines_of(pair.type, pair.pitch_per_radian)
        slides = [j for j, line in enumerate(lines) if not line.turns]
        if len(slides) != 1 or self.m.frame in (pair.a, pair.b) or takes_curves(pair.type):
            return 0.0
        eyes = []
        for link, marker in zip((pair.a, pair.b), pair.markers, strict=True):
            X, u = marker.pose(), marker.pose()[:, :3] @ slide_of(pair)
            others = ((p, k) for p, k in self.ends_on.get(link, ()) if p is not pair)
            away = (p.markers[k].pose()[:, 3] - X[:, 3] for p, k in others)
            eyes.append([float(d @ u) for d in away if np.linalg.norm(np.cross(d, u)) < FLAT_THICKNESS * self.size])
        if not all(eyes):
            return 0.0
        size, q, own = self.symbol_size(pair), self.place.coordinates[pair.name][slides[0]], eyes[0][0]
        far = max(eyes[1], key=lambda at: abs(float(q[0]) + at - own))
        sign = float(np.sign(q[0] + far - own))
        out, room = sign * (q - own), float((sign * (q + far - own)).min())
        if out.min() > 2.6 * size or room < 8.0 * size:
            return 0.0
        # the barrel takes a little more than half of the least distance of the eyes, or the stroke
        barrel = min(max(0.55 * room, float(np.ptp(q)) + 2.6 * shapes.PAD * size), 0.9 * room)
        return sign * (barrel - shapes.PAD * size - float(out.max()))

    def held(self, load: Law) -> tuple[Array, Array]:
        """Both ends of a law between links, ``(T, 3)``; along a direction from where the line through the second point passes the first."""
        begin, end = self.on(load.a, load.p), self.on(load.b, load.q)
        if load.along is not None:
            u = self.place.poses[load.a][:, :3, :3] @ (np.asarray(load.along) / np.linalg.norm(load.along))
            begin = end - ((end - begin) * u).sum(axis=1, keepdims=True) * u
        return begin, end

    def grounded(self, pair: Pair) -> bool:
        """Whether a pair is drawn as a guide on hatched ground: in a plane, where it slides on the frame."""
        lines = lines_of(pair.type, pair.pitch_per_radian)
        slides = sum(not line.turns for line in lines)
        return self.normal is not None and pair.a == self.m.frame and slides == 1 and not takes_curves(pair.type)

    def symbol_size(self, pair: Pair) -> float:
        """Half width of a symbol: less where another pair is near."""
        gaps = np.linalg.norm(self.places - self.points[pair.name, pair.b][0], axis=1)
        nearest = gaps[gaps > FLAT_THICKNESS * self.size].min(initial=self.size)
        return float(np.clip(0.4 * nearest, 0.45 * self.symbol, self.symbol))

    @cached_property
    def places(self) -> Array:
        """Where the pairs are at the first position, ``(P, 3)``."""
        return np.array([self.points[p.name, p.b][0] for p in self.m.pairs])

    def freedom(self, name: str) -> tuple[Pair, int, FreedomLine, str]:
        """The pair of a freedom, its number there, its line, and the frame of that."""
        k, j = self.m.freedom(name)
        pair = self.m.pairs[k]
        line = lines_of(pair.type, pair.pitch_per_radian)[j]
        return pair, j, line, f"pair:{pair.name}@{line.frame}"

    @cached_property
    def upright(self) -> Array:
        """Axes of what stands upright, as columns: two level ones, and up: z, or y of a mechanism in a plane that has no z."""
        if self.normal is None:
            return np.eye(3)
        n = self.normal
        inside = (v - (v @ n) * n for v in (np.eye(3)[2], np.eye(3)[1]))
        up = next(v / np.linalg.norm(v) for v in inside if np.linalg.norm(v) > 0.1)
        right = np.cross(up, n)
        right *= np.sign(right[np.argmax(np.abs(right))])  # seen from where x points to the right
        return np.column_stack([right, np.cross(up, right), up])


def is_groove(step: AlongCurve) -> bool:
    """Whether a curve is a groove around a body, in which a roller runs."""
    return isinstance(step.curve, Groove)


def is_profile(pair: Pair, step: AlongCurve) -> bool:
    """Whether a curve is the outline of a body that something runs on from outside."""
    curve = step.curve
    if curve is None or not (is_open(pair) and curve.is_closed):
        return False
    hollow = isinstance(curve, Beside) and curve.distance * outside(curve.base) < 0
    return not hollow and curve.once(Travel).is_plane


def _profiles(pair: Pair) -> Iterator[tuple[str, Array]]:
    """Points ``(n, 3)`` of the closed curves of a pair, on their links."""
    for step in takes_curves(pair.type):
        if step.curve is not None and step.curve.is_closed:
            travel = step.curve.once(Travel)
            yield pair.b if step.back else pair.a, travel.at(np.linspace(travel.begin, travel.end, 13)[:-1]).x.T


def slide_of(pair: Pair) -> Array:
    """The direction of the first slide of a pair in its frames; zero where nothing slides."""
    lines = (line for line in lines_of(pair.type, pair.pitch_per_radian) if not line.turns)
    return next((line.direction for line in lines), np.zeros(3))


def distinct(points: Iterable[Array], tolerance: float) -> Array:
    """The points, each once, ``(n, 3)``."""
    out: list[Array] = []
    for p in points:
        if all(np.linalg.norm(p - other) > tolerance for other in out):
            out.append(p)
    return np.array(out).reshape(-1, 3)


def plane_normal(points: Array, across: Array | None = None) -> Array | None:
    """The normal of the plane in which all points lie, its largest component positive; None where there is no such plane.

    Of points on one line it is the direction ``across``, where that is at right angles to the line.
    """
    _, spread, Vt = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    if len(spread) < 3 or spread[2] > FLAT_THICKNESS * spread[0]:
        return None
    normal = Vt[2]
    if spread[1] <= FLAT_THICKNESS * spread[0]:
        if across is None or not spread[0] or abs(Vt[0] @ across) > FLAT_THICKNESS:
            return None
        normal = across
    return np.asarray(normal * np.sign(normal[np.argmax(np.abs(normal))]))


def stretched(along: Array, at: Array, length: Array, width: Array) -> Array:
    """Frames ``(T, 3, 4)`` at points, z along a vector and of some length, x and y of some width."""
    scale = np.stack([width, width, length], axis=1)
    return np.concatenate([frame_along(along) * scale[:, None], at[:, :, None]], axis=2)
