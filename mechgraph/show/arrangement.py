"""Names beside their points, a corner with the directions and a scale. A class of matplotlib's: loaded where something is drawn."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field
from typing import Any

import matplotlib.patheffects as effects
import numpy as np
from matplotlib.artist import Artist
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.transforms import IdentityTransform

from mechgraph.errors import visible
from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.show.canvas import MUTED


@dataclass
class PlacedText:
    """A text, the point of space that it belongs to, the length in space that it keeps away from it, and its leader line."""

    text: Text
    at: Array
    away: float
    leader: Line2D = field(default_factory=lambda: Line2D([], [], lw=0.6, color=MUTED, zorder=19))


class Arrangement(Artist):
    """Names beside their points, a corner with the directions and a scale; placed when they are drawn.

    ``taken`` gives points ``(n, 2)`` on the screen that texts should not cover, ``pixels`` the screen place of points in space, ``camera``
    the directions to the right, up and towards the viewer, ``inside`` the box (pixels) in which everything has to stay; ``prepare`` is
    called first, with the part of that box that the legend leaves. ``places`` holds how texts stood beside their points before
    (by the text, in points of a 72nd inch): they are kept where that covers little more, and noted anew.
    """

    def __init__(
        self,
        ax: Any,
        pixels: Callable[[Array], Array],
        taken: Callable[[], Array],
        camera: Callable[[], Array],
        inside: Callable[[], Array],
        prepare: Callable[[Array], None],
        places: dict[str, Array] | None = None,
    ) -> None:
        super().__init__()
        self._places = {} if places is None else places
        self._pixels, self._taken, self._camera, self._inside, self._prepare = pixels, taken, camera, inside, prepare
        self._ax, self._placed = ax, list[PlacedText]()
        self._corner: list[tuple[Line2D, Text, Array]] = []
        self._bars: list[tuple[Line2D, Text, float]] = []
        self._legend: list[Text] = []
        self._lines: list[str] = []
        self.set_zorder(-50)
        self.set_in_layout(False)
        ax.add_artist(self)

    def name(self, text: str, at: Array, colour: str, away: float, **style: Any) -> None:
        """A text that is put beside a point of space."""
        placed = PlacedText(self._text(text, colour, **style), np.asarray(at, dtype=float), away)
        self._placed.append(placed)
        self._line(placed.leader)

    def directions(self, arrows: Sequence[tuple[str, Array, str]]) -> None:
        """Arrows of names and directions in the lower left corner."""
        for name, direction, colour in arrows:
            line = self._line(Line2D([], [], lw=1.2, color=colour, zorder=19, marker="o", ms=3, markevery=[1]))
            self._corner.append((line, self._text(name, colour, fontsize=8.5), direction))

    def scale(self, length: float, text: str, colour: str = MUTED) -> None:
        """A bar of some length with its text, beside the corner and those before it; a text alone for length 0."""
        line = self._line(Line2D([], [], lw=1.4, color=colour, zorder=19, marker="|", ms=7))
        self._bars.append((line, self._text(text, colour, fontsize=8.5), length))

    def legend(self, lines: Sequence[tuple[str, str]]) -> None:
        """Lines of a text and a color each, on the right, in as many columns as they need."""
        self._legend = [self._text(text, colour, fontsize=8.0) for text, colour in lines]
        self._lines = [text.get_text() for text in self._legend]

    def room(self, renderer: Any = None) -> Array:
        """The box that the legend leaves: its lines go from the upper right corner down, a few broad ones along the lower edge."""
        unit, box = self._ax.figure.dpi / 72.0, self._inside().copy()
        if not self._legend:
            return box
        for text, line in zip(self._legend, self._lines, strict=True):
            text.set_text(line)  # the last one may have counted others
        sizes = np.array([_size(text, renderer) for text in self._legend])
        height = float(sizes[:, 1].max()) + 2.0 * unit
        width, n = float(sizes[:, 0].max()), len(sizes)
        # a legend of few lines stands below where it is broad
        if n <= 8 and width > 0.25 * (box[1, 0] - box[0, 0]):
            for row, text in enumerate(reversed(self._legend)):
                text.set_position((box[0, 0], box[0, 1] + row * height))
            box[0, 1] += (n + 1) * height
            return box
        rows = max(int((box[1, 1] - box[0, 1]) / height), 1)
        # part of the width of the axes that the columns of a legend may take; lines beyond are counted
        left = box[1, 0] - 0.45 * (box[1, 0] - box[0, 0])
        columns: list[range] = []
        for i in range(0, n, rows):
            column = range(i, min(i + rows, n))
            if columns and box[1, 0] - sizes[: column.stop, 0].max() * (len(columns) + 1) < left:
                break
            columns.append(column)
        shown = columns[-1].stop
        for i, text in enumerate(self._legend):
            text.set_visible(i < shown)
        if shown < n:
            shown -= 1
            self._legend[shown].set_text(f"\u2026 and {n - shown} more")
            sizes[shown] = _size(self._legend[shown], renderer)
        for column in reversed(columns):
            box[1, 0] -= sizes[column, 0].max()
            for row, i in enumerate(column):
                self._legend[i].set_position((box[1, 0], box[1, 1] - (row + 1) * height))
            box[1, 0] -= 8.0 * unit
        return box

    def _text(self, text: str, colour: str, **style: Any) -> Text:
        where: dict[str, Any] = {"ha": "left", "va": "bottom", "transform": IdentityTransform()}
        out = Text(0, 0, visible(text), color=colour, zorder=20, parse_math=False, **where, **style)
        out.set_path_effects([effects.withStroke(linewidth=2.6, foreground="white")])
        out.set_in_layout(False)
        self._ax.add_artist(out)
        out.set_clip_on(False)
        return out

    def _line(self, line: Line2D) -> Line2D:
        line.set_transform(IdentityTransform())
        line.set_in_layout(False)
        self._ax.add_artist(line)
        line.set_transform(IdentityTransform())
        line.set_clip_on(False)
        return line

    def draw(self, renderer: Any) -> None:
        """Place everything; the texts and lines are drawn after this, as artists of the axes."""
        unit = self._ax.figure.dpi / 72.0
        box = self.room(renderer)
        self._prepare(box)
        # points closer than a letter's stroke count once
        taken = (2 * unit) * np.unique(np.round(self._taken() / (2 * unit)), axis=0)
        boxes = self._furniture(renderer, unit, box)
        points = [self._pixels(p.at[None])[0] for p in self._placed]
        right = self._camera()[0]
        for placed, point in zip(self._placed, points, strict=True):
            size = _size(placed.text, renderer) + 2.0 * unit
            away = float(np.linalg.norm(self._pixels((placed.at + placed.away * right)[None])[0] - point)) + 3.0 * unit
            before = self._places.get(placed.text.get_text())
            kept = None if before is None else point + before * unit
            corner, ring, free = _best(point, size, away, box, boxes, taken, kept)
            placed.text.set_visible(free)
            if not free:
                placed.leader.set_data([], [])
                continue
            self._places[placed.text.get_text()] = (corner - point) / unit
            placed.text.set_position(tuple(corner + unit))
            boxes.append(np.array([corner, corner + size]))
            # distance over the nearest from which on a fine line leads from the point to its text
            far = ring >= 2.4
            end = np.clip(point, corner, corner + size)
            placed.leader.set_data([point[0], end[0]] if far else [], [point[1], end[1]] if far else [])

    def _furniture(self, renderer: Any, unit: float, box: Array) -> list[Array]:
        """Place the directions and the scale along the lower edge; the boxes that they fill."""
        length, room = 19.0 * unit, 17.0 * unit
        origin = box[0] + np.array([1.0, 1.0]) * (length + room)
        flat = self._camera()[:2]
        out: list[Array] = []
        right = float(origin[0])
        for line, text, direction in self._corner:
            seen = flat @ direction
            shown = float(np.linalg.norm(seen)) > 0.15
            tip, size = origin + length * seen, _size(text, renderer)
            line.set_data(*(np.array([origin, tip]).T if shown else ([], [])))
            text.set_visible(shown)
            if shown:
                away = seen / float(np.linalg.norm(seen))
                places = (tip + k * room * away - size / 2 for k in (0.5, 1.0, 1.5, 2.0))
                corner = next((p for p in places if not any(_meet(p, p + size, other) for other in out)), tip)
                text.set_position(tuple(corner))
                out.append(np.array([corner, corner + size]))
                right = max(right, float(corner[0] + size[0]))
        for line, text, meant in self._bars:
            begin, along = np.array([right + room, box[0][1] + 0.6 * room]), self._camera()[0] * meant
            ends, size = self._pixels(np.stack([np.zeros(3), along])), _size(text, renderer)
            width = float(np.linalg.norm(ends[1] - ends[0]))
            line.set_data(*(([begin[0], begin[0] + width], [begin[1]] * 2) if meant else ([], [])))
            text.set_position((begin[0] + max(0.5 * (width - size[0]), 0.0), begin[1] + 4.0 * unit))
            right = float(begin[0]) + max(width, size[0])
            out.append(np.array([begin - 4 * unit, [right, begin[1] + size[1] + 6 * unit]]))
        return out


def _size(text: Text, renderer: Any) -> Array:
    text.set_visible(True)  # one that is hidden has no size
    box = text.get_window_extent(renderer)
    return np.array([box.width, box.height])


def _meet(low: Array, high: Array, other: Array) -> bool:
    return bool((np.minimum(high, other[1]) > np.maximum(low, other[0])).all())


def _best(
    point: Array, size: Array, away: float, box: Array, boxes: Sequence[Array], taken: Array, kept: Array | None = None
) -> tuple[Array, float, bool]:
    """Lower left corner of a text near a point, its distance over the nearest one, and whether it is free; it would rather be ``kept``."""
    # distances, over the nearest, and directions in which a place is looked for
    distances, angles = (1.0, 1.6, 2.4, 3.4, 4.6, 6.0, 8.0), np.linspace(0.0, 2 * np.pi, 24, endpoint=False) + 0.3
    rings = np.repeat(distances, len(angles))
    d = np.tile(np.stack([np.cos(angles), np.sin(angles)], axis=1), (len(distances), 1))
    # the middle of the text is so far away that its nearest edge is at the distance asked for
    reach = rings[:, None] * away * d + 0.5 * size * np.clip(1.6 * d, -1.0, 1.0)
    low = point + reach - 0.5 * size
    high = low + size
    cost = 0.35 * (rings - 1.0) + 0.02 * (1.0 - d[:, 0]) + 0.02 * (1.0 - d[:, 1])
    if kept is not None:
        # cost of moving a text by its height from where it stood before, over that of covering one point of the drawing
        cost += 1.2 * np.minimum(np.linalg.norm(low - kept, axis=1) / float(size[1]), 2.0)
    beyond = np.maximum(box[0] - low, 0.0).sum(axis=1) + np.maximum(high - box[1], 0.0).sum(axis=1)
    # cost of covering another text, or of reaching beyond the axes, over that of covering one point of the drawing
    forbidden = 1e4
    cost += forbidden * (beyond > 0) * (1.0 + beyond)
    if boxes:
        others = np.array(boxes)[:, :, None]
        overlap = np.clip(np.minimum(high, others[:, 1]) - np.maximum(low, others[:, 0]), 0.0, None).prod(axis=2)
        cost += forbidden * ((overlap > 0) * (1.0 + overlap / size.prod())).sum(axis=0)
    near = taken[(np.abs(taken - point) < np.abs(reach).max(axis=0) + size).all(axis=1)]
    if len(near):
        covered = ((near > low[:, None] - away / 3) & (near < high[:, None] + away / 3)).all(axis=2)
        cost += covered.sum(axis=1) * 0.6
    best = int(np.argmin(cost))
    return low[best], float(rings[best]), bool(cost[best] < forbidden)
