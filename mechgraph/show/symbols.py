"""Symbols of pairs, made from their freedoms: what slides runs in a guide or on a plate, what turns is a drum, a cross of pins or a ball.

Nothing depends on the name of a type, so that a row that a user adds has a symbol too: consecutive slides are one guide (one direction),
one plate (two) or nothing that touches (three: what is left is drawn dashed); consecutive turns are one drum, a ball with two pins, or a
ball. A turn about the normal of a plate needs no bearing: a drum lies or stands on it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Literal

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.model.pair_type import PairType
from mechgraph.model.row_parts import Freedom
from mechgraph.show.shapes import ROUND, Shape, ball, frame_along, polyline, prism, thread

GUIDE, BODY, PIN = 0.95, 0.62, 0.24
"""Radii of guides, of what runs in them, and of pins, over the size of a symbol."""
PAD = 1.6
"""How far a guide or plate goes beyond the stroke."""
PARALLEL_SINE = 1e-6
"""Sine below which two directions are parallel."""

Role = Literal["guide", "body", "dark", "axis"]


@dataclass(frozen=True)
class Element:
    """A piece of a symbol: a shape in frame ``frame`` of the pair, of a role, and whether it is dashed (nothing touches)."""

    role: Role
    frame: int
    shape: Shape
    dashed: bool = False


@dataclass(frozen=True)
class Line:
    """The line of one freedom in frame ``frame`` of its pair: a unit ``direction`` through ``point``; ``advance`` a turn's per radian."""

    frame: int
    turns: bool
    direction: Array
    point: Array
    advance: float = 0.0


def lines_of(row: PairType, pitch: float) -> list[Line]:
    """The lines of all freedoms, at coordinates zero where a factor moves them."""
    return [_line(freedom, k, pitch) for freedom, k in zip(row.freedoms, row.frame_before, strict=True)]


def _line(freedom: Freedom, frame: int, pitch: float) -> Line:
    twist = np.array(freedom.twist) + pitch * np.array(freedom.per_pitch)
    w, v = twist[:3], twist[3:]
    if not freedom.turns:
        return Line(frame, False, v / np.linalg.norm(v), np.zeros(3))
    w = w / np.linalg.norm(w)
    return Line(frame, True, w, np.cross(w, v), float(w @ v))


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
    lines: list[Line], strokes: list[tuple[float, float]], size: float, square: bool, last: int
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
    lines: list[Line], stroke: tuple[float, float], slides: list[Line], size: float, last: int
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


def _drum(line: Line, stroke: tuple[float, float], slides: list[Line], size: float, last: int) -> Iterator[Element]:
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
    return float(np.linalg.norm(np.cross(u, v))) < PARALLEL_SINE
