"""Symbols of pairs and shapes of bodies: lines, surfaces and arrows, in units of the mechanism."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby, pairwise
from typing import Any, Literal

import numpy as np
import scipy

from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.pairs.factors import Freedom
from mechgraph.pairs.pair_type import PairType

GUIDE, BODY, PIN, PAD = 0.95, 0.62, 0.24, 1.6
"""Radii of guides, of what runs in them, and of pins, over the size of a symbol; how far a guide or plate goes beyond the stroke."""

Role = Literal["guide", "body", "dark", "axis"]


@dataclass(frozen=True)
class Element:
    """A piece of a symbol: a shape in frame ``frame`` of the pair, of a role, and whether it is dashed (nothing touches)."""

    role: Role
    frame: int
    shape: Shape
    dashed: bool = False


@dataclass(frozen=True)
class FreedomLine:
    """The line of one freedom in frame ``frame`` of its pair: a unit ``direction`` through ``point``; ``advance`` a turn's per radian."""

    frame: int
    turns: bool
    direction: Array
    point: Array
    advance: float = 0.0


def lines_of(row: PairType, pitch: float) -> list[FreedomLine]:
    """The lines of all freedoms, at coordinates zero where a factor moves them."""
    return [_line(freedom, k, pitch) for freedom, k in zip(row.freedoms, row.frame_before, strict=True)]


def _line(freedom: Freedom, frame: int, pitch: float) -> FreedomLine:
    twist = np.array(freedom.twist) + pitch * np.array(freedom.per_pitch)
    w, v = twist[:3], twist[3:]
    if not freedom.turns:
        return FreedomLine(frame, False, v / np.linalg.norm(v), np.zeros(3))
    w = w / np.linalg.norm(w)
    return FreedomLine(frame, True, w, np.cross(w, v), float(w @ v))


def symbol(row: PairType, pitch: float, size: float, strokes: Sequence[tuple[float, float]]) -> list[Element]:
    """The pieces of a symbol of half width ``size``; ``strokes`` are least and greatest value of every coordinate."""
    lines = lines_of(row, pitch)
    drawn = [(step.outline, columns) for step, columns in zip(row.steps, row.factors, strict=True)]
    bent = {j for outline, columns in drawn if outline for j in columns}
    groups = [
        list(part) for _, part in groupby((j for j in range(row.f) if j not in bent), key=lambda j: lines[j].turns)
    ]
    slides = [j for j in range(row.f) if not lines[j].turns and j not in bent]
    touches = all(len(part) < 3 for part in groups if not lines[part[0]].turns)
    out = []
    for part in groups:
        if not lines[part[0]].turns:
            out += list(
                _slide_elements([lines[j] for j in part], [strokes[j] for j in part], size, len(slides) == row.f, row.f)
            )
        else:
            out += list(
                _turn_elements([lines[j] for j in part], strokes[part[0]], [lines[j] for j in slides], size, row.f)
            )
    for outline, columns in drawn:
        # a curve on link b goes with the frame behind all freedoms
        frame = row.f if columns and columns[0] and outline else row.frame_before[columns[0]] if columns else 0
        out += [Element("axis", frame, polyline(line)) for line in outline]
    if bent and all(j in bent for j in range(row.f)):
        out.append(Element("body", row.f, prism(4, 0.5 * size, -0.5 * size, 0.5 * size)))
    if not row.f:
        out.append(Element("dark", 0, prism(4, 0.5 * size, -0.5 * size, 0.5 * size)))
    return [Element(e.role, e.frame, e.shape, not touches) for e in out]


def _slide_elements(
    lines: list[FreedomLine], strokes: list[tuple[float, float]], size: float, square: bool, last: int
) -> Iterator[Element]:
    """A guide along one direction or a plate along two, and a block in or on it where nothing turns."""
    frame, directions = lines[0].frame, [line.direction for line in lines]
    low, high = np.array(strokes).T + np.array([[-1], [1]]) * PAD * size
    if len(lines) == 1:
        section = prism(4 if square else ROUND, GUIDE * size, low[0], high[0])
        yield Element("guide", frame, section.along(directions[0]))
    elif len(lines) == 2:
        yield Element("guide", frame, _plate(directions, low, high, size))
    if square and len(lines) < 3:
        block = prism(4, BODY * size, -1.3 * size, 1.3 * size)
        yield Element("body", last, block.along(directions[0]))


def _plate(directions: list[Array], low: Array, high: Array, size: float) -> Shape:
    """A thin plate under two slides, one body radius below their plane."""
    u, v = directions
    n = np.cross(u, v)
    corners = [(a, b) for a, b in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))]
    top = np.array([a * u + b * v - BODY * size * n for a, b in corners])
    vertices = np.concatenate([top - 0.2 * size * n, top])
    sides = tuple((i, (i + 1) % 4, 4 + (i + 1) % 4, 4 + i) for i in range(4))
    return Shape(vertices, ((3, 2, 1, 0), (4, 5, 6, 7), *sides), ((0, 1, 2, 3, 0), (4, 5, 6, 7, 4)), 6)


def _turn_elements(
    lines: list[FreedomLine], stroke: tuple[float, float], slides: list[FreedomLine], size: float, last: int
) -> Iterator[Element]:
    """A drum, a ball with two pins, or a ball; in or on a guide of its own size."""
    normal = np.cross(slides[0].direction, slides[1].direction) if len(slides) == 2 else None
    borne = [line for line in lines if normal is None or not _parallel(line.direction, normal)]
    if len(lines) > 2:
        yield Element("dark", last, ball((BODY if slides else 0.8) * size))
    elif not borne:
        drum = prism(ROUND, 1.05 * size, -BODY * size, 0.5 * size)
        yield Element("body", last, drum.along(lines[0].direction, lines[0].point))
    elif len(borne) == 1:
        yield from _drum(borne[0], stroke, slides, size, last)
    elif len(borne) == 2:
        yield Element("dark", borne[1].frame, ball(BODY * size))
        for line in borne:
            yield Element(
                "body", line.frame, prism(8, PIN * size, -1.3 * size, 1.3 * size).along(line.direction, line.point)
            )


def _drum(
    line: FreedomLine, stroke: tuple[float, float], slides: list[FreedomLine], size: float, last: int
) -> Iterator[Element]:
    """A drum about its axis: a bearing by itself, a piston in a guide along it, a roller on a plate, or a nut on a threaded spindle."""
    coaxial = any(_parallel(line.direction, slide.direction) for slide in slides)
    radius, half = (BODY, 0.8) if coaxial else (BODY, 1.3) if len(slides) == 2 else (0.8, 1.15)
    turn, frame = frame_along(line.direction), last if coaxial else line.frame
    if line.advance:
        low, high = sorted(line.advance * q for q in stroke)
        low, high = low - PAD * size, high + PAD * size
        yield Element("body", frame, prism(8, 0.36 * size, low, high).moved(turn, line.point))
        turns = int(np.clip((high - low) / (0.7 * size), 3, 24))
        yield Element("dark", frame, thread(0.42 * size, low, high, line.advance, turns).moved(turn, line.point))
        half, frame = 0.6, last
    yield Element("body", frame, prism(ROUND, radius * size, -half * size, half * size).moved(turn, line.point))


def _parallel(u: Array, v: Array) -> bool:
    # sine below which two directions are parallel
    return float(np.linalg.norm(np.cross(u, v))) < 1e-6


ROUND = 16
"""Corners of a round section."""


@dataclass(frozen=True)
class Shape:
    """Vertices ``(n, 3)``; polygons and polylines by their indices; polygons whose edges are drawn come first, ``rims`` of them."""

    vertices: Array
    faces: tuple[tuple[int, ...], ...] = ()
    lines: tuple[tuple[int, ...], ...] = ()
    rims: int = 0

    def moved(self, A: Array, p: Array | Sequence[float] = (0.0, 0.0, 0.0)) -> Shape:
        """The shape under ``x -> A x + p``."""
        return replace(self, vertices=self.vertices @ np.asarray(A).T + np.asarray(p))

    def along(self, z: Array, at: Array | Sequence[float] = (0.0, 0.0, 0.0)) -> Shape:
        """The shape with its z turned into a direction, at a point."""
        return self.moved(frame_along(np.asarray(z)), at)


def frame_along(z: Array) -> Array:
    """A rotation ``(..., 3, 3)`` whose third column is the direction of ``z (..., 3)``; that of the global z where it has no length."""
    z = np.asarray(z, dtype=float)
    length = np.linalg.norm(z, axis=-1, keepdims=True)
    z = np.where(length > 0, z / np.where(length > 0, length, 1.0), [0.0, 0.0, 1.0])
    least = np.eye(3)[np.argmin(np.abs(z), axis=-1)]
    x = least - (least * z).sum(axis=-1, keepdims=True) * z
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)


def together(shapes: Sequence[Shape]) -> Shape:
    """Several shapes as one."""
    starts = np.cumsum([0, *(len(s.vertices) for s in shapes)])
    faces = [
        (k < s.rims, tuple(i + n for i in f))
        for s, n in zip(shapes, starts, strict=False)
        for k, f in enumerate(s.faces)
    ]
    lines = tuple(tuple(i + n for i in line) for s, n in zip(shapes, starts, strict=False) for line in s.lines)
    rims = [f for rim, f in faces if rim]
    return Shape(
        np.concatenate([s.vertices for s in shapes]), (*rims, *(f for rim, f in faces if not rim)), lines, len(rims)
    )


def prism(corners: int, radius: float, low: float, high: float, pieces: int = 1) -> Shape:
    """A prism about z with a regular section (four corners: a square of half side ``radius``), cut into pieces along its length."""
    turn = np.arange(corners) * 2 * np.pi / corners + np.pi / corners
    reach = radius / np.cos(np.pi / 4) if corners == 4 else radius
    ring = reach * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    z = np.repeat(np.linspace(low, high, pieces + 1), corners)
    vertices = np.column_stack([np.tile(ring, (pieces + 1, 1)), z])
    n, last = corners, pieces * corners
    ends = (tuple(range(n))[::-1], tuple(range(last, last + n)))
    sides = tuple(
        (k * n + i, k * n + (i + 1) % n, (k + 1) * n + (i + 1) % n, (k + 1) * n + i)
        for k in range(pieces)
        for i in range(n)
    )
    around = (*range(n), 0), (*range(last, last + n), last)
    spars = tuple((i, last + i) for i in range(0, n, max(n // 4, 1)))
    whole = corners == 4
    return Shape(vertices, (*ends, *sides), (*around, *spars), len(ends) + (len(sides) if whole and pieces == 1 else 0))


def ball(radius: float) -> Shape:
    """A sphere about the origin; its lines are three great circles."""
    rows, columns = 8, ROUND
    u, v = np.meshgrid(np.linspace(0, np.pi, rows + 1), np.arange(columns) * 2 * np.pi / columns, indexing="ij")
    grid = radius * np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], axis=-1).reshape(-1, 3)
    faces = tuple(
        (i * columns + j, (i + 1) * columns + j, (i + 1) * columns + (j + 1) % columns, i * columns + (j + 1) % columns)
        for i in range(rows) for j in range(columns)
    )  # fmt: skip
    circle = ring(radius)
    loops = [circle @ np.roll(np.eye(3), k, axis=0) for k in range(3)]
    n, m = len(grid), len(circle)
    return Shape(
        np.concatenate([grid, *loops]), faces, tuple(tuple(range(n + k * m, n + (k + 1) * m)) for k in range(3))
    )


def ring(radius: float) -> Array:
    """A closed circle about z, ``(n, 3)``."""
    turn = np.linspace(0, 2 * np.pi, 2 * ROUND + 1)
    return radius * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)


def polyline(points: Array | Sequence[Any]) -> Shape:
    """A line through points."""
    return Shape(np.asarray(points, dtype=float), lines=(tuple(range(len(points))),))


def hatching(run: Array, away: Array, height: float) -> Shape:
    """Ground along a line ``(n, 3)``: strokes of a height, slanting ``away (n, 3)`` from it."""
    along = np.gradient(run, axis=0)
    ends = run + height * (away - 0.7 * along / np.linalg.norm(along, axis=1, keepdims=True))
    return together([polyline(run), *(polyline(stroke) for stroke in zip(run, ends, strict=True))])


def slab(outline: Array, normal: Array, half: float) -> Shape:
    """What a closed outline ``(n, 3)`` in a plane encloses, convex or not, as thick as twice ``half``; its lines are the outlines."""
    n, frame = len(outline), frame_along(normal)
    flat = (outline - outline.mean(axis=0)) @ frame[:, :2]
    found = scipy.spatial.Delaunay(flat).simplices
    begin, end = flat, np.roll(flat, -1, axis=0)
    x, y = flat[found].mean(axis=1).T[:, :, None]
    above = (begin[:, 1] > y) != (end[:, 1] > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossed = begin[:, 0] + (y - begin[:, 1]) * (end[:, 0] - begin[:, 0]) / (end[:, 1] - begin[:, 1])
    inside = (above & (x < crossed)).sum(axis=1) % 2 == 1
    faces, loop = [tuple(face) for face in found[inside].tolist()], (*range(n), 0)
    if not half:
        return Shape(outline, tuple(faces), (loop,))
    sides = [(i, j, j + n, i + n) for i, j in pairwise(loop)]
    both = [tuple(i + n for i in face) for face in faces]
    vertices = np.concatenate([outline - half * frame[:, 2], outline + half * frame[:, 2]])
    return Shape(vertices, (*faces, *both, *sides), (loop, tuple(i + n for i in loop)))


def grooved(x: Array, across: Array, center: Array, axis: Array, wide: float) -> tuple[Shape, Shape]:
    """A body of revolution about an axis and the groove around it, along points ``x (n, 3)`` on its surface over whole turns, ``wide`` to
    both sides along the unit vectors ``across (n, 3)``: one skin, so that neither hides the other.
    """
    columns, rows = 96, 4
    d = x - center
    z, d = d @ axis, d - np.outer(d @ axis, axis)
    first, r = d[0] / np.linalg.norm(d[0]), np.linalg.norm(d, axis=1)
    frame = np.column_stack([first, np.cross(axis, first), axis])
    angle = np.unwrap(np.arctan2(d @ frame[:, 1], d @ first))
    order = np.argsort(angle)
    turns = max(round(float(np.ptp(angle)) / (2 * np.pi)), 1)
    phi = np.linspace(0.0, 2 * np.pi, columns + 1)
    at = phi + angle.min() + 2 * np.pi * np.arange(turns)[:, None]
    middle = np.sort(np.interp(at, angle[order], z[order]), axis=0)
    half = np.interp(at, angle[order], (wide / np.maximum(np.abs(across @ axis), 0.2))[order])
    reach = z.min() - 2.0 * wide, z.max() + 2.0 * wide
    cuts = np.stack([middle - half, middle + half], axis=1).reshape(2 * turns, -1)
    ends = (np.full((1, columns + 1), end) for end in reach)
    cuts = np.clip(np.maximum.accumulate(np.concatenate([next(ends), cuts, next(ends)]), axis=0), *reach)
    levels, sunk = [], []
    for k, (low, high) in enumerate(pairwise(cuts)):
        n = 1 if k % 2 else rows
        levels += [low + (high - low) * i / n for i in range(n)]
        sunk += [bool(k % 2)] * n
    height = np.array([*levels, cuts[-1]])
    by_height = np.argsort(z)
    rho = np.interp(height, z[by_height], r[by_height])
    local = np.stack([rho * np.cos(phi + angle.min()), rho * np.sin(phi + angle.min()), height], axis=-1)
    vertices, m = center + local.reshape(-1, 3) @ frame.T, columns + 1
    quads = [
        [(i * m + j, i * m + j + 1, (i + 1) * m + j + 1, (i + 1) * m + j) for j in range(columns)]
        for i in range(len(sunk))
    ]
    body = [face for row, low in zip(quads, sunk, strict=True) for face in row if not low]
    groove = [face for row, low in zip(quads, sunk, strict=True) for face in row if low]
    rims = tuple(range(columns)), tuple(range(len(sunk) * m, len(sunk) * m + columns))
    edges = [
        tuple(range(i * m, (i + 1) * m)) for i in range(len(height)) if i in (0, len(sunk)) or sunk[i] != sunk[i - 1]
    ]
    return Shape(vertices, (*body, rims[0][::-1], rims[1])), Shape(vertices, tuple(groove), tuple(edges))


def thread(radius: float, low: float, high: float, hand: float, turns: int = 3) -> Shape:
    """A ribbon that winds about z on a cylinder: the thread of a screw, right-hand for ``hand > 0``."""
    n = turns * ROUND
    angle = np.copysign(1.0, hand) * np.linspace(0, 2 * np.pi * turns, n + 1)
    width = 0.35 * (high - low) / turns
    z = np.linspace(low, high - width, n + 1)
    lower = np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
    vertices = np.concatenate([lower, lower + np.array([0, 0, width])])
    return Shape(vertices, tuple((i, i + 1, n + 2 + i, n + 1 + i) for i in range(n)), (tuple(range(n + 1)),))


def coil() -> Shape:
    """A helical spring of radius one from z = 0 to z = 1."""
    u = np.linspace(0.0, 1.0, 99)
    angle = 14 * np.pi * u
    wound = np.stack([np.cos(angle), np.sin(angle), 0.12 + 0.76 * u], axis=1)
    ends = np.array([[0, 0, 0], [0, 0, 0.12]]), np.array([[0, 0, 0.88], [0, 0, 1.0]])
    return polyline(np.concatenate([ends[0], wound, ends[1]]))


def spiral() -> Shape:
    """A flat spiral spring about z, from radius 0.3 to 1."""
    angle = np.linspace(0, 5 * np.pi, 70)
    radius = np.linspace(0.3, 1.0, 70)
    return polyline(np.stack([radius * np.cos(angle), radius * np.sin(angle), 0 * angle], axis=1))


def dashpot() -> Shape:
    """A damper of half width one from z = 0 to z = 1: a pot, and a piston in it, seen from two sides."""
    flat: list[list[tuple[float, float]]] = [
        [(0, 0), (0, 0.35)], [(-1, 0.75), (-1, 0.35), (1, 0.35), (1, 0.75)], [(-0.8, 0.55), (0.8, 0.55)], [(0, 0.55), (0, 1)],
    ]  # fmt: skip
    runs = [np.array([[x, 0.0, z] for x, z in run]) for run in flat]
    runs += [run[:, [1, 0, 2]] for run in runs[1:3]]
    return together([polyline(run) for run in runs])


def ram() -> Shape:
    """A strut of half width one from z = 0 to z = 1 that pushes by some law: a round box on a line."""
    box = prism(ROUND, 1.0, 0.3, 0.7)
    return together([polyline([[0, 0, 0], [0, 0, 0.3]]), box, polyline([[0, 0, 0.7], [0, 0, 1.0]])])


def arrow() -> Shape:
    """An arrow along z from 0 to 1 with a head of radius one."""
    rim = ring(1.0)[::4] + np.array([0, 0, 0.78])
    n = len(rim) - 1
    head = Shape(
        np.concatenate([rim[:-1], [[0, 0, 1.0]]]), (tuple(range(n))[::-1], *((i, (i + 1) % n, n) for i in range(n)))
    )
    return together([polyline([[0, 0, 0], [0, 0, 0.8]]), head])


def turn_arrow() -> Shape:
    """An arrow of radius one about z, by the right hand."""
    angle = np.linspace(-0.75 * np.pi, 0.6 * np.pi, 28)
    arc = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    tip, ahead = angle[-1], np.array([-np.sin(angle[-1]), np.cos(angle[-1]), 0.0])
    out = np.array([np.cos(tip), np.sin(tip), 0.0])
    sides = 0.19 * np.array([out, [0, 0, 1.0], -out, [0, 0, -1.0]])
    head = Shape(arc[-1] + np.array([*sides, 0.46 * ahead]), ((0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4), (0, 1, 2, 3)))
    return together([polyline(arc), head])


def foot() -> Shape:
    """A support of height one below the origin, down along -z: a pyramid on hatched ground."""
    base = np.array([[-0.6, -0.6, -1.0], [0.6, -0.6, -1.0], [0.6, 0.6, -1.0], [-0.6, 0.6, -1.0]])
    body = Shape(np.concatenate([base, np.zeros((1, 3))]), tuple((i, (i + 1) % 4, 4) for i in range(4)), rims=4)
    ground, strokes = [], []
    for side in (np.eye(3)[0], np.eye(3)[1]):
        ground.append(polyline([-1.05 * side - [0, 0, 1.0], 1.05 * side - [0, 0, 1.0]]))
        strokes += [
            polyline([x * side - [0, 0, 1.0], (x - 0.35) * side - [0, 0, 1.4]]) for x in np.linspace(-0.7, 1.05, 6)
        ]
    return together([body, *ground, *strokes])
