"""The skeleton of a mechanism: links as lines and plates between their pair points, pairs as symbols, in space or in a plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import assembled
from mechgraph.closure.configuration import Configuration
from mechgraph.errors import DeclarationError
from mechgraph.force.applied_loads import user_poses
from mechgraph.model.mechanism import Mechanism
from mechgraph.result.solution import Solution
from mechgraph.show.canvas import FAINT, INK, MUTED, PALETTE, new_axes, toolkit

FLAT = 1e-6
"""Thickness over extent below which a mechanism is drawn as a plane one."""

MARKS: dict[tuple[int, int], tuple[str, float]] = {
    (1, 0): ("o", 60.0),
    (0, 1): ("s", 58.0),
    (1, 1): ("h", 90.0),
    (2, 0): ("P", 85.0),
    (3, 0): ("o", 95.0),
    (0, 0): ("X", 60.0),
}
"""Symbol and size of a pair by its numbers of turns and slides; the others are diamonds."""


@dataclass(frozen=True)
class _Shape:
    """All that is drawn, over the positions drawn from.

    ``ends[pair, link]``, mass ``centers[link]`` and named ``points[link, name]``, ``(T, 3)`` each.
    """

    m: Mechanism
    good: Any
    ends: dict[tuple[str, str], Array]
    axes: dict[str, Array]
    centers: dict[str, Array]
    points: dict[tuple[str, str], Array]

    @cached_property
    def everything(self) -> Array:
        """All points that are drawn."""
        return np.concatenate([*self.ends.values(), *self.centers.values(), *self.points.values()])

    @cached_property
    def size(self) -> float:
        """Diagonal of the box about all points."""
        return float(np.linalg.norm(np.ptp(self.everything, axis=0))) or 1.0

    def corners(self, link: str, t: int) -> Array:
        """Pair points of a link at one position, ``(n, 3)``."""
        return np.array([self.ends[p.name, link][t] for p in self.m.pairs if link in (p.a, p.b)])


def _poses(drawn: Solution | Mechanism) -> tuple[Mechanism, dict[str, Array], Any, int]:
    """Poses ``(T, 3, 4)`` of every link at the positions that can be drawn, which these are, and of how many."""
    if isinstance(drawn, Mechanism):
        system, x = assembled(drawn)
        found = user_poses(Configuration(system, x[:, None]))
        poses = {name: found[i, :, :3] for i, name in enumerate(drawn.link_names())}
        return drawn, poses, np.zeros(1, dtype=np.intp), 1
    m = drawn.mechanism
    good = np.flatnonzero(np.asarray(drawn.status).reshape(-1) == "ok")
    if not good.size:
        raise DeclarationError(f"skeleton of {m.name!r}", ["the solution has no solved position"])
    poses = {name: drawn.link(name).pose.reshape(-1, 4, 4)[good, :3] for name in m.link_names()}
    return m, poses, good, int(np.asarray(drawn.status).size)


def _shape(m: Mechanism, poses: dict[str, Array], good: Any) -> _Shape:
    def moved(link: str, point: Any) -> Array:
        return np.asarray(poses[link][:, :, :3] @ np.asarray(point, dtype=float) + poses[link][:, :, 3])

    ends = {
        (pair.name, link): moved(link, marker.point)
        for pair in m.pairs
        for link, marker in zip((pair.a, pair.b), pair.markers, strict=True)
    }
    axes = {pair.name: poses[pair.a][:, :, :3] @ pair.markers[0].pose()[:, 2] for pair in m.pairs}
    centers = {k.name: moved(k.name, k.center) for k in m.links if k.mass > 0 and k.center is not None}
    points = {(k.name, name): moved(k.name, p) for k in m.links for name, p in k.points.items()}
    return _Shape(m, good, ends, axes, centers, points)


def draw_skeleton(
    s: Solution | Mechanism,
    position: int = 0,
    *,
    ax: Any = None,
    ghosts: int = 5,
    traces: bool | Sequence[str] = True,
    labels: bool = True,
    highlight: Sequence[str | tuple[str, int]] = (),
    view: tuple[float, float] = (24.0, -58.0),
) -> Any:
    """Draw the mechanism at one position, faint at others, with the paths of its pair points. Returns the axes.

    The frame is grey and stands on hatched feet, other links have a colour each; a circle with a dot is a mass centre. A
    mechanism all of whose points lie in a plane is drawn in that plane.

    Parameters
    ----------
    s : a solution; or a mechanism with geometry, which is drawn where its loops are closed.
    position : flat index of the position drawn in full.
    ax : three-dimensional axes of matplotlib; new ones where left out, in a figure of their own: ``ax.figure.savefig(...)``.
    ghosts : number of further positions, drawn faintly.
    traces : whether to draw the paths of pair points; or the names of the pairs whose paths are drawn.
    labels : names of pairs (with their type) and links.
    highlight : names of pairs, or a loop of the report (``report.loops[0]``): all other links are drawn in grey.
    view : elevation and azimuth in degrees of a spatial mechanism.

    Raises
    ------
    DeclarationError
        where that position was not solved, or a pair to be highlighted is not there; AssemblyError where a mechanism cannot be
        closed; MissingExtraError without matplotlib.
    """
    m, poses, good, size = _poses(s)
    chosen = [item if isinstance(item, str) else item[0] for item in highlight]
    unknown = [name for name in chosen if name not in {p.name for p in m.pairs}]
    faults = [f"highlight: there is no pair {name!r}; pairs: {', '.join(p.name for p in m.pairs)}" for name in unknown]
    if not -size <= position < size or position % size not in good:
        faults.append(f"position {position} was not solved, or is none of {size}")
    if faults:
        raise DeclarationError(f"skeleton of {m.name!r}", faults)
    shape = _shape(m, poses, good)
    t = int(np.searchsorted(shape.good, position % size))
    if ax is None:
        ax = new_axes(projection="3d")
    names = [p.name for p in m.pairs] if traces is True else [] if traces is False else list(traces)
    colours = _colours(m, chosen)
    for i in np.unique(np.linspace(0, shape.good.size - 1, ghosts + 1).astype(int)) if ghosts else ():
        if i != t:
            _links(ax, shape, int(i), colours, ghost=True)
    _traces(ax, shape, names, colours)
    _feet(ax, shape, t)
    _links(ax, shape, t, colours, ghost=False)
    _pairs(ax, shape, t)
    _set_view(ax, shape, view)
    if labels:
        _labels(ax, shape, t, colours)
    return ax


def _colours(m: Mechanism, highlight: Sequence[str]) -> dict[str, str]:
    """A colour for every link; grey for the frame and, where pairs are highlighted, for links that lie at none or one of them."""
    moving = [k for k in m.link_names() if k != m.frame]
    out = {m.frame: MUTED} | {k: PALETTE[i % len(PALETTE)] for i, k in enumerate(moving)}
    if highlight:
        ends = [link for p in m.pairs if p.name in highlight for link in (p.a, p.b)]
        out |= {k: FAINT for k in moving if ends.count(k) < min(2, len(highlight))}
    return out


def _ordered(points: Array) -> Array:
    """Points of a plate in the order of their angle about the middle, in their best plane."""
    middle = points - points.mean(axis=0)
    _, _, Vt = np.linalg.svd(middle)
    angle = np.arctan2(middle @ Vt[1], middle @ Vt[0])
    return points[np.argsort(angle, kind="stable")]


def _links(ax: Any, shape: _Shape, t: int, colours: dict[str, str], *, ghost: bool) -> None:
    Poly3DCollection = toolkit("art3d").Poly3DCollection
    for link, colour in colours.items():
        if link == shape.m.frame:
            continue
        points = shape.corners(link, t)
        line = {
            "color": colour,
            "lw": 1.2 if ghost else 3.4,
            "alpha": 0.28 if ghost else 1.0,
            "zorder": 1 if ghost else 4,
        }
        if len(points) > 2:
            plate = _ordered(points)
            closed = np.concatenate([plate, plate[:1]])
            ax.plot(*closed.T, solid_capstyle="round", solid_joinstyle="round", **line)
            if not ghost:
                ax.add_collection3d(Poly3DCollection([plate], facecolor=colour, alpha=0.16, edgecolor="none"))
        else:
            ax.plot(*points.T, solid_capstyle="round", **line)
        if not ghost and link in shape.centers:
            _center(ax, shape, link, t, colour)
        for at in [at[t] for (owner, _), at in shape.points.items() if owner == link and not ghost]:
            ax.plot(*np.array([points.mean(axis=0), at]).T, color=colour, lw=0.9, ls=(0, (2, 2)), zorder=3)
            ax.scatter(*at, marker="x", s=40, color=colour, depthshade=False, zorder=7)


def _center(ax: Any, shape: _Shape, link: str, t: int, colour: str) -> None:
    """The mass centre, tied to the link where it lies off its line."""
    at = shape.centers[link][t]
    middle = shape.corners(link, t).mean(axis=0)
    ax.plot(*np.array([middle, at]).T, color=colour, lw=0.9, ls=(0, (2, 2)), zorder=3)
    ax.scatter(*at, s=46, facecolor="white", edgecolor=colour, linewidth=1.2, depthshade=False, zorder=6)
    ax.scatter(*at, s=9, color=colour, depthshade=False, zorder=7)


def _traces(ax: Any, shape: _Shape, names: Sequence[str], colours: dict[str, str]) -> None:
    m = shape.m
    for name in names:
        pair = m.pair(name)
        path = shape.ends[name, pair.b]
        if np.ptp(path, axis=0).max() > 1e-3 * shape.size:
            ax.plot(
                *path.T,
                color=colours[pair.b if pair.b != m.frame else pair.a],
                lw=0.9,
                ls=(0, (1, 1.6)),
                alpha=0.8,
                zorder=2,
            )


def _feet(ax: Any, shape: _Shape, t: int) -> None:
    """A hatched foot under every pair point of the frame."""
    for at in shape.corners(shape.m.frame, t):
        ax.scatter(
            *at, marker=_foot(), s=560, facecolor=MUTED, edgecolor=MUTED, linewidth=1.1, depthshade=False, zorder=3
        )


def _foot() -> Any:
    """A marker: a triangle standing on a hatched line, its tip at the point."""
    from matplotlib.path import Path

    lines = [((0, 0), (-0.5, -0.8)), ((-0.5, -0.8), (0.5, -0.8)), ((0.5, -0.8), (0, 0)), ((-0.8, -0.8), (0.8, -0.8))]
    lines += [((x, -0.8), (x - 0.25, -1.05)) for x in (-0.5, -0.2, 0.1, 0.4, 0.7)]
    vertices = [v for line in lines for v in line]
    return Path(vertices, [Path.MOVETO, Path.LINETO] * len(lines))


def _pairs(ax: Any, shape: _Shape, t: int) -> None:
    """Pairs: a symbol on link b, the axis as a fine line through both points; a plane pair shows a piece of its plane."""
    Poly3DCollection = toolkit("art3d").Poly3DCollection
    for pair in shape.m.pairs:
        a, b = shape.ends[pair.name, pair.a][t], shape.ends[pair.name, pair.b][t]
        turns = sum(f.turns for f in pair.type.freedoms)
        axis = shape.axes[pair.name][t]
        if pair.type.f - turns > 1:
            across = np.linalg.svd(axis[None])[2][1:] * 0.06 * shape.size
            corners = [b + i * across[0] + j * across[1] for i, j in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
            ax.add_collection3d(
                Poly3DCollection([corners], facecolor=MUTED, alpha=0.25, edgecolor=MUTED, linewidth=0.8)
            )
        elif pair.type.directed:
            reach = 0.055 * shape.size * axis
            first, last = sorted((a, b), key=lambda p: float(p @ axis))
            ax.plot(*np.array([first - reach, last + reach]).T, color=INK, lw=1.0, ls=(0, (7, 2, 1.5, 2)), zorder=5)
        marker, area = MARKS.get((turns, pair.type.f - turns), ("D", 62.0))
        fill = INK if turns == 3 else "white"
        ax.scatter(*b, marker=marker, s=area, facecolor=fill, edgecolor=INK, linewidth=1.5, depthshade=False, zorder=8)


def _labels(ax: Any, shape: _Shape, t: int, colours: dict[str, str]) -> None:
    """Names beside pairs and links, each where it covers least."""
    m = shape.m
    camera = _camera(ax)
    moving = {link: shape.corners(link, t) @ camera.T for link in colours if link != m.frame}
    marks = np.array(
        [shape.ends[pair.name, pair.b][t] for pair in m.pairs]
        + [at[t] for at in (*shape.centers.values(), *shape.points.values())]
    )
    room = _Room([_sides(corners) for corners in moving.values()] + [marks @ camera.T], _extent(shape, camera))
    for pair in m.pairs:
        at = camera @ shape.ends[pair.name, pair.b][t]
        _label(ax, room, f"{pair.name} ({pair.type.symbol})", at, 0.05, camera, INK, "bold")
    for (link, name), at in shape.points.items():
        _label(ax, room, f"{link}.{name}", camera @ at[t], 0.04, camera, colours.get(link, INK), "normal")
    for link, corners in moving.items():
        at = corners.mean(axis=0)
        _label(ax, room, link, at, 0.035, camera, colours[link], "normal")


def _camera(ax: Any) -> Array:
    """Directions to the right and up on the screen, ``(2, 3)``."""
    el, az = np.deg2rad(ax.elev), np.deg2rad(ax.azim)
    return np.array([[-np.sin(az), np.cos(az), 0.0], [-np.sin(el) * np.cos(az), -np.sin(el) * np.sin(az), np.cos(el)]])


def _extent(shape: _Shape, camera: Array) -> float:
    """Diagonal of what is seen: less than the size of a long mechanism that is seen along its length."""
    seen = shape.everything @ camera.T
    return float(np.linalg.norm(np.ptp(seen, axis=0))) or shape.size


def _sides(corners: Array) -> Array:
    """Points along the lines between the corners of a link, on the screen."""
    u = np.linspace(0.0, 1.0, 13)[:, None]
    return np.concatenate([(1 - u) * p + u * q for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True)])


class _Room:
    """What is already drawn on the screen; a text is put where it covers least of it."""

    def __init__(self, drawn: list[Array], size: float) -> None:
        self.taken = np.concatenate(drawn)
        self.size = size

    def cells(self, text: str, corner: Array, side: float) -> Array:
        """Points that a text covers, ``side`` -1, 0, 1 for text to the left of, about, to the right of a point."""
        width = 0.0155 * self.size * len(text)
        x = corner[0] + width * (np.linspace(0.0, 1.0, 7) - 0.5 + 0.5 * side)
        return np.stack([np.tile(x, 2), corner[1] + 0.012 * self.size * np.repeat([-1.0, 1.0], 7)], axis=1)

    def place(self, text: str, at: Array, distance: float) -> tuple[Array, float]:
        """Where a text covers least, and on which side of that point it stands."""
        best: tuple[float, Array, float] | None = None
        for reach in (1.0, 1.5):
            for angle in np.linspace(0.0, 2 * np.pi, 16, endpoint=False) + 0.5 * np.pi:
                d = np.array([np.cos(angle), np.sin(angle)])
                side = float(np.sign(np.round(d[0], 1)) if abs(d[0]) > 0.3 else 0.0)
                corner = at + reach * distance * self.size * d
                gap = np.linalg.norm(self.cells(text, corner, side)[:, None] - self.taken, axis=2).min(axis=0)
                cost = float(np.exp(-((gap / (0.022 * self.size)) ** 2)).sum()) + 0.4 * (reach - 1.0)
                if best is None or cost < best[0] - 1e-9:
                    best = (cost, corner, side)
        assert best is not None
        self.taken = np.concatenate([self.taken, *[self.cells(text, best[1], best[2])] * 3])
        return best[1], best[2]


def _label(
    ax: Any, room: _Room, text: str, at: Array, distance: float, camera: Array, colour: str, weight: str
) -> None:
    """Text beside a point of the screen."""
    import matplotlib.patheffects as effects

    corner, side = room.place(text, at, distance)
    ax.text(
        *(corner @ camera),
        text,
        color=colour,
        weight=weight,
        fontsize=9.5,
        zorder=20,
        va="center",
        ha="left" if side > 0 else "right" if side < 0 else "center",
        path_effects=[effects.withStroke(linewidth=3.0, foreground="white")],
    )


def _plane_normal(points: Array) -> Array | None:
    _, spread, Vt = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    return None if spread[2] > FLAT * spread[0] else np.asarray(Vt[2] * np.sign(Vt[2][np.argmax(np.abs(Vt[2]))]))


def _set_view(ax: Any, shape: _Shape, view: tuple[float, float]) -> None:
    """Equal scales, no box, a small tripod of the global directions; a plane mechanism is seen along its normal."""
    points = shape.everything
    low, high = points.min(axis=0), points.max(axis=0)
    room, middle = np.maximum(high - low, 0.12 * shape.size), (low + high) / 2
    normal = _plane_normal(points)
    ax.set_proj_type("ortho")
    ax.set_axis_off()
    ax.computed_zorder = False
    if normal is None:
        ax.view_init(*view)
    else:
        upright = abs(normal[2]) > 0.99
        ax.view_init(
            np.rad2deg(np.arcsin(np.clip(normal[2], -1, 1))),
            -90.0 if upright else np.rad2deg(np.arctan2(normal[1], normal[0])),
        )
    right, up = camera = _camera(ax)
    extent = _extent(shape, camera)
    corner = middle + right * ((points - middle) @ right).min() + up * (((points - middle) @ up).min() - 0.04 * extent)
    _tripod(ax, corner, 0.06 * extent, normal)
    for setter, c, r in zip((ax.set_xlim, ax.set_ylim, ax.set_zlim), middle, room, strict=True):
        setter(c - r / 2, c + r / 2)
    ax.set_box_aspect(room)
    _fill(ax, points, room)
    for artist in (*ax.lines, *ax.collections, *ax.texts):
        artist.set_clip_on(False)
        artist.set_in_layout(False)


def _fill(ax: Any, points: Array, room: Array) -> None:
    """Zoom so that the mechanism fills its axes."""
    x, y, _ = toolkit("proj3d").proj_transform(*points.T, ax.get_proj())
    (x0, y0), (x1, y1) = ax.transData.inverted().transform(ax.bbox.get_points())
    ax.set_box_aspect(room, zoom=float(0.88 * min((x1 - x0) / max(np.ptp(x), 1e-9), (y1 - y0) / max(np.ptp(y), 1e-9))))


def _tripod(ax: Any, at: Array, length: float, normal: Array | None) -> None:
    for axis, name in zip(np.eye(3), "xyz", strict=True):
        if normal is not None and abs(normal @ axis) > 0.99:
            continue
        ax.plot(*np.array([at, at + length * axis]).T, color=MUTED, lw=1.2)
        ax.text(*(at + 1.4 * length * axis), name, color=MUTED, fontsize=8.5, ha="center", va="center")
