"""Parts of a drawing that a mechanism consists of: links as what they join, the feet of the frame, symbols of pairs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.document.tree import plain
from mechgraph.model.pair import Pair
from mechgraph.show import shapes
from mechgraph.show.shapes import Shape, frame_along
from mechgraph.show.stage import FLAT_THICKNESS, Label, Part, Stage, distinct
from mechgraph.show.symbols import Line, lines_of, symbol

ROD, EDGE = 0.3, 0.2
"""Radii of rods, and of the edges of plates, over the size of a symbol."""


def links(stage: Stage) -> Iterator[Part]:
    """Links as what they join: a rod between two points, a plate or a body between more; mass centres and points of interest."""
    for link in stage.m.links:
        frame, moving = f"link:{link.name}", link.name != stage.m.frame
        corners = [*stage.corners(link.name), *(np.asarray(p, dtype=float) for p in link.points.values())]
        if moving:
            yield from _body(stage, link.name, corners)
        else:
            yield from _feet(stage)
        for name, p in link.points.items():
            yield Part("point", f"{link.name}.{name}", link.name, frame, Shape(np.array([p], dtype=float)))
        if link.mass > 0 and moving:
            center = np.asarray(link.center, dtype=float)
            middle = np.mean(corners, axis=0) if corners else center
            yield Part("tie", link.name, link.name, frame, shapes.polyline([middle, center]))
            yield Part("center", link.name, link.name, frame, Shape(center[None]))


def _body(stage: Stage, link: str, corners: list[Array]) -> Iterator[Part]:
    frame, near = f"link:{link}", FLAT_THICKNESS * stage.size
    points = distinct(corners, near)
    if len(points) == 1 and stage.m.link(link).mass > 0:
        points = distinct([*points, np.asarray(stage.m.link(link).center, dtype=float)], near)
    if len(points) < 2:
        return
    faces, edges = hull(points)
    if faces:
        yield Part("plate", link, link, frame, Shape(points, faces))
    radius = (EDGE if faces else ROD) * stage.symbol
    yield Part("link", link, link, frame, shapes.together([rod(points[i], points[j], radius) for i, j in edges]))


def _feet(stage: Stage) -> Iterator[Part]:
    """A hatched foot under every pair point of the frame."""
    name = stage.m.frame
    X = stage.frames[f"link:{name}"][0]
    foot = shapes.foot().moved(1.8 * stage.symbol * X[:, :3].T @ stage.upright)
    for at in distinct(stage.corners(name), FLAT_THICKNESS * stage.size):
        yield Part("foot", name, "", f"link:{name}", foot.moved(np.eye(3), at))


def rod(p: Array, q: Array, radius: float) -> Shape:
    """A thin round rod between two points, in pieces so that it can be sorted by depth; its one line is its middle line."""
    length = float(np.linalg.norm(q - p))
    solid = shapes.prism(6, radius, 0.0, length, int(np.clip(length / (12 * radius), 1, 12))).along(q - p, p)
    return shapes.together([replace(solid, lines=(), rims=0), shapes.polyline([p, q])])


def hull(points: Array) -> tuple[tuple[tuple[int, ...], ...], tuple[tuple[int, int], ...]]:
    """Faces and edges of the convex hull of points: none and a line, a flat plate, or a body."""
    middle = points - points.mean(axis=0)
    _, spread, Vt = np.linalg.svd(middle, full_matrices=False)
    if len(points) == 2 or spread[1] <= FLAT_THICKNESS * spread[0]:
        order = np.argsort(middle @ Vt[0]).tolist()
        return (), tuple(pairwise(order))
    if len(points) == 3 or spread[2] <= FLAT_THICKNESS * spread[0]:
        corners = [int(i) for i in scipy.spatial.ConvexHull(middle @ Vt[:2].T).vertices]
        return (tuple(corners),), tuple(pairwise([*corners, corners[0]]))
    solid = scipy.spatial.ConvexHull(points)
    edges: dict[tuple[int, int], list[int]] = {}
    for k, face in enumerate(solid.simplices.tolist()):
        for i, j in pairwise([*face, face[0]]):
            edges.setdefault((min(i, j), max(i, j)), []).append(k)
    normals = solid.equations[:, :3]
    sharp = tuple(edge for edge, (k, m) in edges.items() if normals[k] @ normals[m] < 1 - FLAT_THICKNESS)
    return tuple(tuple(face) for face in solid.simplices.tolist()), sharp


def pairs(stage: Stage) -> Iterator[Part]:
    """Symbols of the pairs with their axes, and arrows at the driven freedoms."""
    driven = {stage.m.full_name(d.freedom) for d in stage.m.drives}
    for pair in stage.m.pairs:
        size, lines = stage.symbol_size(pair), lines_of(pair.type, pair.pitch_per_radian)
        for e in symbol(pair.type, pair.pitch_per_radian, size, _strokes(stage, pair, lines, size)):
            link = pair.a if e.role == "guide" else ""
            yield Part(e.role, pair.name, link, f"pair:{pair.name}@{e.frame}", e.shape, e.dashed)
        for name, line, single in zip(pair.freedom_names, lines, pair.type.drivable, strict=True):
            frame = f"pair:{pair.name}@{line.frame}"
            if line.turns and single:
                reach = 2.6 * size * line.direction
                yield Part("axis", pair.name, "", frame, shapes.polyline([line.point - reach, line.point + reach]))
            if name in driven:
                yield Part("drive", name, "", frame, freedom_arrow(line, 1.75 * size))


def _strokes(stage: Stage, pair: Pair, lines: list[Line], size: float) -> list[tuple[float, float]]:
    """Least and greatest coordinates, zero among them.

    A guide on the line of which link a is held by another pair reaches to there: the barrel of a cylinder, from its eye to the piston.
    """
    q = stage.place.coordinates[pair.name]
    out = [(float(row.min(initial=0.0)), float(row.max(initial=0.0))) for row in q]
    slides = [j for j, line in enumerate(lines) if not line.turns]
    if len(slides) != 1 or pair.a == stage.m.frame:
        return out
    X = pair.markers[0].pose()
    along, (low, high) = X[:, :3] @ lines[slides[0]].direction, out[slides[0]]
    for d in (p - X[:, 3] for p in stage.corners(pair.a)):
        if np.linalg.norm(np.cross(d, along)) < FLAT_THICKNESS * stage.size:
            low, high = min(low, float(d @ along) + 2.6 * size), max(high, float(d @ along) - 2.6 * size)
    out[slides[0]] = (low, high)
    return out


def freedom_arrow(line: Line, size: float, sign: float = 1.0) -> Shape:
    """An arrow about the line of a turn, or beside that of a slide."""
    turn = frame_along(line.direction)
    if line.turns:
        return shapes.turn_arrow(sign).moved(size * turn, line.point)
    lengthwise = turn @ np.diag([0.3 * size, 0.3 * size, sign * 2.2 * size])
    return shapes.arrow().moved(lengthwise, size * (turn[:, 0] - line.direction))


def labels(stage: Stage) -> Iterator[Label]:
    """Names of pairs with their types, of points, and of moving links."""
    for pair in stage.m.pairs:
        text = plain(f"{pair.name} ({pair.type.symbol})")
        yield Label("pair", text, pair.name, "", f"pair:{pair.name}@{pair.type.f}", np.zeros(3))
    for link in stage.m.links:
        frame, corners = f"link:{link.name}", stage.corners(link.name)
        for name, p in link.points.items():
            text = f"{link.name}.{name}"
            yield Label("point", plain(text), text, link.name, frame, np.asarray(p, dtype=float))
        if link.name != stage.m.frame and corners:
            yield Label("link", plain(link.name), link.name, link.name, frame, np.mean(corners, axis=0))
