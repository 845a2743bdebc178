"""Where a mechanism stands at the drawn positions: frames of links and pairs, points, sizes; and what the parts of a drawing are."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.model import pair_kinematics
from mechgraph.model.force_law import Law
from mechgraph.model.load import Gravity
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.show.shapes import Shape
from mechgraph.show.symbols import Line, lines_of

FLAT_THICKNESS = 1e-6
"""Thickness over extent below which a mechanism is drawn as a plane one, and a link as a plate; points closer than that are one."""
SYMBOL = 0.026
"""Half width of a symbol over the extent of the mechanism, where pairs leave room for it."""

Role = Literal[
    "link",
    "plate",
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
class Part:
    """One body of a drawing.

    ``role`` says how it is painted: ``link`` (rods) and ``plate`` in the colour of ``link``, ``guide`` likewise but translucent, ``body``
    (white) and ``dark`` of a pair symbol, ``axis`` (a line), ``tie`` (from a link to a point off it), ``foot`` (of the frame), ``center``
    and ``point`` (one vertex), ``spring``, ``load``, ``drive``, ``reaction``. ``owner`` is the name of the pair, link, point or load.
    """

    role: Role
    owner: str
    link: str
    frame: str
    shape: Shape
    dashed: bool = False


@dataclass(frozen=True)
class Label:
    """A text that belongs to the point ``at (3,)`` of a frame; ``link`` gives its colour, empty for ink."""

    kind: Literal["pair", "link", "point"]
    text: str
    owner: str
    link: str
    frame: str
    at: Array


@dataclass(frozen=True)
class Place:
    """Where a mechanism stands at ``T`` positions: link poses ``(T, 4, 4)`` and coordinates of every pair ``(f, T)``."""

    poses: Mapping[str, Array]
    coordinates: Mapping[str, Array]


class Stage:
    """A mechanism at ``T`` places: what its parts are made from.

    Attributes
    ----------
    frames : name -> affine maps ``(T, 3, 4)``; those of links and pairs, to which parts add their own.
    points : pair points ``points[pair, link]``, ``(T, 3)``.
    everything : these, mass centres and points of interest, ``(n, 3)``.
    normal : of the plane in which all of these lie, else None.
    size, symbol : extent over all positions, and half width of the largest symbols.
    gravity : the vector g, None where there is none.
    """

    def __init__(self, m: Mechanism, place: Place, count: int) -> None:
        self.m, self.place, self.count = m, place, count
        self.frames: dict[str, Array] = {"": np.broadcast_to(np.eye(3, 4), (count, 3, 4))}
        self.frames |= {f"link:{name}": pose[:, :3] for name, pose in place.poses.items()}
        for pair in m.pairs:
            for k, frame in enumerate(self._pair_frames(pair)):
                self.frames[f"pair:{pair.name}@{k}"] = frame
        ends = ((p, link, k) for p in m.pairs for link, k in ((p.a, 0), (p.b, p.type.f)))
        self.points = {(p.name, link): self.frames[f"pair:{p.name}@{k}"][:, :, 3] for p, link, k in ends}
        of_links = [
            self.on(k.name, c) for k in m.links for c in (*k.points.values(), *([k.center] if k.mass > 0 else []))
        ]
        self.everything = np.concatenate([*self.points.values(), *of_links])
        self.normal = self._plane()
        self.size = float(np.linalg.norm(np.ptp(self.everything, axis=0))) or 1.0
        self.symbol = SYMBOL * self.size
        weights = (np.asarray(load.acceleration, dtype=float) for load in m.loads if isinstance(load, Gravity))
        self.gravity = next((g for g in weights if g.any()), None)

    def _plane(self) -> Array | None:
        """The normal of the plane of the mechanism: all points lie in it, and what can only turn does so about the normal."""
        normal = plane_normal(self.everything)
        for pair in self.m.pairs:
            if (
                normal is not None
                and pair.type.f == 1
                and (line := lines_of(pair.type, pair.pitch_per_radian)[0]).turns
            ):
                axis = self.frames[f"pair:{pair.name}@0"][0, :, :3] @ line.direction
                normal = normal if np.linalg.norm(np.cross(axis, normal)) < FLAT_THICKNESS else None
        return normal

    def _pair_frames(self, pair: Pair) -> list[Array]:
        """Frames 0, 1, ... of a pair ``(T, 3, 4)``."""
        base, marker = self.place.poses[pair.a][:, :3], pair.markers[0].pose()
        origin = base[:, :, :3] @ marker[:, 3] + base[:, :, 3]
        start = np.concatenate([base[:, :, :3] @ marker[:, :3], origin[:, :, None]], axis=2)
        x = pair_kinematics.coordinates_to_state(pair.type, self.place.coordinates[pair.name][:, None])
        pitch = np.array([[pair.pitch_per_radian]])
        found = pair_kinematics.frames_of(pair.type, pitch, x, np.moveaxis(start, 0, -1)[:, :, None])
        return [np.moveaxis(frame[:, :, 0], -1, 0) for frame in found]

    def on(self, link: str, point: Any) -> Array:
        """A point of a link, given in its frame or by its name, in the global frame, ``(T, 3)``."""
        X = self.place.poses[link][:, :3]
        return np.asarray(X[:, :, :3] @ self.local(link, point) + X[:, :, 3])

    def local(self, link: str, point: Any) -> Array:
        """A point of a link, given by its coordinates or its name, in the link's frame."""
        return np.asarray(self.m.link(link).point(point) if isinstance(point, str) else point, dtype=float)

    def corners(self, link: str) -> list[Array]:
        """What a link joins, in its own frame: points of the pairs that bear it, and where springs and other laws hold it."""
        ends = (end for p in self.m.pairs if p.type.bears for end in zip((p.a, p.b), p.markers, strict=True))
        laws = (load for load in self.m.loads if isinstance(load, Law) and load.between_links)
        held = ((end, p) for load in laws for end, p in ((load.a, load.p), (load.b, load.q)) if end == link)
        return [
            *(np.asarray(marker.point, dtype=float) for name, marker in ends if name == link),
            *(self.local(link, p) for _, p in held),
        ]

    def symbol_size(self, pair: Pair) -> float:
        """Half width of a symbol: less where another pair is near."""
        here = self.points[pair.name, pair.b][0]
        gaps = (float(np.linalg.norm(here - self.points[p.name, p.b][0])) for p in self.m.pairs if p is not pair)
        nearest = min((gap for gap in gaps if gap > FLAT_THICKNESS * self.size), default=self.size)
        return float(np.clip(0.4 * nearest, 0.45 * self.symbol, self.symbol))

    def freedom(self, name: str) -> tuple[Pair, int, Line, str]:
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


def distinct(points: Iterable[Array], tolerance: float) -> Array:
    """The points, each once, ``(n, 3)``."""
    out: list[Array] = []
    for p in points:
        if all(np.linalg.norm(p - other) > tolerance for other in out):
            out.append(p)
    return np.array(out).reshape(-1, 3)


def plane_normal(points: Array) -> Array | None:
    """The normal of the plane in which all points lie, its largest component positive; None where there is no such plane."""
    _, spread, Vt = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    flat = len(spread) > 2 and spread[2] <= FLAT_THICKNESS * spread[0] < spread[1]
    return np.asarray(Vt[2] * np.sign(Vt[2][np.argmax(np.abs(Vt[2]))])) if flat else None
