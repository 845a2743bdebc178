"""Painters of polygons and lines in space: on axes of two dimensions, seen along a direction, or on three-dimensional ones.

Polygons come sorted by depth. Both painters say where points are on the screen, so that what stands beside them can be arranged.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.show.canvas import INK, toolkit

LIGHT = np.array([-0.45, 0.65, 0.75]) / np.linalg.norm([-0.45, 0.65, 0.75])
"""Direction to the light: right, up, towards the viewer."""
MARGIN = np.array([0.07, 0.13, 0.07])
"""Part of a box that is left free beside, below and above a drawing: for names, and for the directions and the scale."""
AMBIENT = 0.66
"""Brightness of what lies in the shade."""


class Painter(Protocol):
    """Draws on axes ``ax``, seen with ``camera (3, 3)``: rows to the right, up, and towards the viewer."""

    ax: Any

    @property
    def camera(self) -> Array:
        """Directions to the right, up and towards the viewer."""

    def polygons(self, corners: Sequence[Array], faces: Array, edges: Array, zorder: float) -> Any:
        """Polygons ``(n, 3)`` with colours ``(count, 4)``, the nearest last."""

    def lines(self, runs: Sequence[Array], **style: Any) -> Any:
        """Polylines of one style."""

    def marks(self, points: Array, **style: Any) -> Any:
        """Markers at points."""

    def pixels(self, points: Array) -> Array:
        """Where points ``(n, 3)`` are on the screen, ``(n, 2)``."""

    def fit(self, points: Array, room: Callable[[], Array]) -> None:
        """Equal scales, at which points ``(n, 3)`` fill a box on the screen, with margins; ``room()`` gives the box."""

    def fill(self, box: Array) -> None:
        """Fill a box that may have changed, just before everything is drawn."""


class FlatPainter:
    """On axes of two dimensions."""

    def __init__(self, ax: Any, camera: Array) -> None:
        self.ax, self.camera = ax, camera
        self._content = np.zeros((2, 2))
        self._filled = np.zeros((2, 2))

    def fit(self, points: Array, room: Callable[[], Array]) -> None:
        """See ``Painter``."""
        seen = points @ self.camera[:2].T
        self._content = np.array([seen.min(axis=0), seen.max(axis=0)])
        self.fill(room())

    def fill(self, box: Array) -> None:
        """See ``Painter``; the limits are set again where the box has another shape."""
        if np.allclose(box, self._filled):
            return
        self._filled = box
        whole = self.ax.bbox.get_points()
        low, high = box[0] + MARGIN[:2] * (box[1] - box[0]), box[1] - MARGIN[[0, 2]] * (box[1] - box[0])
        span = np.ptp(self._content, axis=0)
        scale = float(np.max(span / (high - low))) or 1.0
        begin = self._content.mean(axis=0) - scale * (0.5 * (low + high) - whole[0])
        end = begin + scale * (whole[1] - whole[0])
        self.ax.set_xlim(begin[0], end[0])
        self.ax.set_ylim(begin[1], end[1])

    def polygons(self, corners: Sequence[Array], faces: Array, edges: Array, zorder: float) -> Any:
        """See ``Painter``."""
        from matplotlib.collections import PolyCollection

        order = np.argsort([float((p @ self.camera[2]).mean()) for p in corners], kind="stable")
        flat = [corners[i] @ self.camera[:2].T for i in order]
        drawn = PolyCollection(flat, facecolors=faces[order], edgecolors=edges[order], linewidths=0.7, zorder=zorder)
        return self.ax.add_collection(drawn, autolim=False)

    def lines(self, runs: Sequence[Array], **style: Any) -> Any:
        """See ``Painter``."""
        from matplotlib.collections import LineCollection

        return self.ax.add_collection(LineCollection([run @ self.camera[:2].T for run in runs], **style), autolim=False)

    def marks(self, points: Array, **style: Any) -> Any:
        """See ``Painter``."""
        return self.ax.scatter(*(points @ self.camera[:2].T).T, **style)

    def pixels(self, points: Array) -> Array:
        """See ``Painter``."""
        return np.asarray(self.ax.transData.transform(np.asarray(points) @ self.camera[:2].T))


class SpacePainter:
    """On three-dimensional axes, which can be turned afterwards; the drawing fills its place again whenever they are."""

    def __init__(self, ax: Any) -> None:
        self.ax = ax
        self._seen: tuple[float, ...] = ()

    def fit(self, points: Array, room: Callable[[], Array]) -> None:
        """See ``Painter``; matplotlib asks where the axes are just before it draws them, which is when they are fitted."""
        self._points, self._room = points, room
        self.ax.set_axes_locator(self._located)

    def _located(self, ax: Any, renderer: Any) -> Any:
        place = ax.get_position(original=True)
        ax.apply_aspect(place)
        box = self._room()
        seen = (*np.round(box, 3).ravel().tolist(), ax.elev, ax.azim, ax.roll)
        if seen != self._seen:
            self._seen = seen
            self._fill(box)
        return place

    def _fill(self, box: Array) -> None:
        """Zoom and shift so that the points fill the box; the axes themselves take but a square of it."""
        seen = self._points @ self.camera.T
        middle = self.camera.T @ (0.5 * (seen.min(axis=0) + seen.max(axis=0)))
        extent = float(np.linalg.norm(np.ptp(seen, axis=0))) or 1.0
        self._look(middle, extent, 1.0)
        here, size = self.pixels(middle[None])[0], np.ptp(self.pixels(self._points), axis=0)
        low, high = box[0] + MARGIN[:2] * (box[1] - box[0]), box[1] - MARGIN[[0, 2]] * (box[1] - box[0])
        zoom = float(np.min((high - low) / np.maximum(size, 1e-9)))
        unit = zoom * float(np.linalg.norm(self.pixels((middle + extent * self.camera[0])[None])[0] - here)) / extent
        right, up = (0.5 * (low + high) - here) / unit
        self._look(middle - right * self.camera[0] - up * self.camera[1], extent, zoom)

    def _look(self, middle: Array, extent: float, zoom: float) -> None:
        for setter, c in zip((self.ax.set_xlim, self.ax.set_ylim, self.ax.set_zlim), middle, strict=True):
            setter(c - extent / 2, c + extent / 2)
        self.ax.set_box_aspect((1.0, 1.0, 1.0), zoom=zoom)

    def fill(self, box: Array) -> None:
        """See ``Painter``; it was filled before."""

    @property
    def camera(self) -> Array:
        """See ``Painter``."""
        el, az = np.deg2rad(self.ax.elev), np.deg2rad(self.ax.azim)
        right = np.array([-np.sin(az), np.cos(az), 0.0])
        toward = np.array([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])
        return np.stack([right, np.cross(toward, right), toward])

    def polygons(self, corners: Sequence[Array], faces: Array, edges: Array, zorder: float) -> Any:
        """See ``Painter``."""
        # corners are repeated until all have as many: what matplotlib fills up itself holds any numbers
        most = max(map(len, corners))
        equal = [np.concatenate([p, np.repeat(p[-1:], most - len(p), axis=0)]) for p in corners]
        drawn = toolkit("art3d").Poly3DCollection(
            equal, facecolors=faces, edgecolors=edges, linewidths=0.7, zorder=zorder
        )
        return self.ax.add_collection3d(drawn, autolim=False)

    def lines(self, runs: Sequence[Array], **style: Any) -> Any:
        """See ``Painter``."""
        return self.ax.add_collection3d(toolkit("art3d").Line3DCollection(list(runs), **style), autolim=False)

    def marks(self, points: Array, **style: Any) -> Any:
        """See ``Painter``."""
        return self.ax.scatter(*points.T, depthshade=False, **style)

    def pixels(self, points: Array) -> Array:
        """See ``Painter``."""
        x, y, _ = toolkit("proj3d").proj_transform(*np.asarray(points).T, self.ax.get_proj())
        return np.asarray(self.ax.transData.transform(np.column_stack([x, y])))


def shaded(colour: str, corners: Sequence[Array], camera: Array, alpha: float = 1.0) -> Array:
    """Colours ``(n, 4)`` of polygons in the light: ``c (a + (1 - a) |n . l|)``."""
    from matplotlib.colors import to_rgba

    light = LIGHT @ camera
    normals = np.array([np.cross(p[1] - p[0], p[2] - p[0]) for p in corners])
    sizes = np.linalg.norm(normals, axis=1)
    bright = AMBIENT + (1 - AMBIENT) * np.abs(normals @ light) / np.where(sizes > 0, sizes, 1.0)
    out = np.tile(to_rgba(colour, alpha), (len(corners), 1))
    out[:, :3] *= bright[:, None]
    return out


def edges_of(faces: Array, rims: Sequence[bool], alpha: float = 1.0) -> Array:
    """Edges of polygons: ink where they are rims, else as the face, so that no seam shows."""
    from matplotlib.colors import to_rgba

    return np.where(np.asarray(rims, dtype=bool)[:, None], to_rgba(INK, alpha), faces)


def inside(ax: Any) -> Array:
    """The place of axes on the screen as their figure gives it, ``[[left, bottom], [right, top]]`` in pixels."""
    place = ax.get_position(original=True).transformed(ax.figure.transSubfigure)
    return np.array(place.get_points())
