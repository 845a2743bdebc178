"""Where it is drawn: axes, colors, names, painting in depth, and places for texts and graphs."""

from __future__ import annotations

import functools
import importlib
import io
from collections.abc import Callable, Iterable, Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np

from mechgraph.errors import MissingExtraError, visible
from mechgraph.maths.se3 import Array, Index
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import Wanted, is_numeric

if TYPE_CHECKING:
    import networkx as nx

MOST_DPI, MOST_INCHES, PNG_DPI = 10_000, 400, 110
MOST_PATHS = 800
"""Most polygons that are written as such to a drawing (SVG, PDF); more, as of gears in space, are a picture in it."""


def _sized(value: Any) -> bool:
    return is_numeric(value, (2,)) and min(value) >= 0.1 and max(value) <= MOST_INCHES


DRAWN = Wanted(lambda value: hasattr(value, "get_figure"), "axes of matplotlib")
Axes = Annotated[Any, Wanted(lambda value: value is None or DRAWN.fits(value), DRAWN.words)]
"""Axes to draw on, or None for new ones."""
Dpi = Annotated[
    float, Wanted(lambda value: is_numeric(value, ()) and 10 <= value <= MOST_DPI, f"a number from 10 to {MOST_DPI}")
]
Size = Annotated[tuple[float, float], Wanted(_sized, f"width and height, inches from 0.1 to {MOST_INCHES}")]

INK = "#1f2933"
MUTED = "#7b8794"
FAINT = "#c8d0d8"
GRID = "#e4e7eb"
PALETTE = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#6b3a00")
"""Colors of moving links and of curves, in order and then again; told apart by color-blind readers too (Okabe and Ito, and a brown)."""
REACTION, LOAD = "#d55e00", "#a3006a"
"""Colors of reaction forces and of loads."""
HATCH = "/////"
"""How what is not unique is filled: it has no value."""


def new_axes(size: tuple[float, float] | None = None, **options: Any) -> Any:
    """Axes in a figure of their own (of a size in inches), which pyplot does not keep: it goes when nobody holds it.

    Raises
    ------
    MissingExtraError
        where matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "plot") from None
    ax: Any = Figure(figsize=size, layout="constrained").add_subplot(**options)
    ax._repr_png_ = functools.partial(_png, ax.figure)  # a notebook shows axes by name, and only figures of pyplot
    return ax


def _png(figure: Any) -> bytes:
    """The picture of a figure."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=PNG_DPI)
    return file.getvalue()


def toolkit(name: str) -> Any:
    """A module of matplotlib's three-dimensional toolkit, which has no types."""
    return importlib.import_module(f"mpl_toolkits.mplot3d.{name}")


def plain(ax: Any) -> None:
    """Axes of curves: two spines, a grid behind."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(True, color=GRID, lw=0.8)
    ax.set_axisbelow(True)


def said(text: str) -> str:
    """A text with names of a user as matplotlib shows it: no formula is made of it, and a legend leaves none out."""
    plain_text = visible(text).replace("$", r"\$")
    return f"\u2009{plain_text}" if plain_text.startswith("_") else plain_text


def axis_label(text: str, unit: str) -> str:
    """``force [N]``; the text alone where there is no unit."""
    return said(f"{text} [{unit}]" if unit else text)


def colours(m: Mechanism, highlight: Sequence[str] = ()) -> dict[str, str]:
    """A color for every link; grey for the frame and, where pairs are highlighted, for links that lie at none or one of them."""
    moving = [k for k in m.link_names() if k != m.frame]
    out = {m.frame: MUTED} | {k: PALETTE[i % len(PALETTE)] for i, k in enumerate(moving)}
    if highlight:
        ends = [link for p in m.pairs if p.name in highlight for link in (p.a, p.b)]
        out |= {k: FAINT for k in moving if ends.count(k) < min(2, len(highlight))}
    return out


LIGHT = np.array([-0.45, 0.65, 0.75]) / np.linalg.norm([-0.45, 0.65, 0.75])
"""Direction to the light: right, up, towards the viewer."""
MARGIN = np.array([0.07, 0.13, 0.07])
"""Part of a box that is left free beside, below and above a drawing: for names, and for the directions and the scale."""


def camera_of(elevation: float, azimuth: float) -> Array:
    """Directions to the right, up and towards a viewer at some elevation and azimuth (degrees), ``(3, 3)``."""
    el, az = np.deg2rad(elevation), np.deg2rad(azimuth)
    right = np.array([-np.sin(az), np.cos(az), 0.0])
    toward = np.array([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])
    return np.stack([right, np.cross(toward, right), toward])


def within_margins(box: Array) -> tuple[Array, Array]:
    """Corners of what a drawing may fill of a box."""
    return box[0] + MARGIN[:2] * (box[1] - box[0]), box[1] - MARGIN[[0, 2]] * (box[1] - box[0])


def scale_in(box: Array, points: Array, camera: Array) -> float:
    """Pixels of a unit of length where points ``(n, 3)``, seen with a camera, fill a box, with its margins."""
    span = np.ptp(points @ camera[:2].T, axis=0)
    room = (1.0 - np.array([2 * MARGIN[0], MARGIN[1] + MARGIN[2]])) * (box[1] - box[0])
    return float(np.min(room / np.maximum(span, 1e-9 * span.max(initial=1e-300))))


class FlatPainter:
    """Draws on axes ``ax`` of two dimensions, seen with ``camera (3, 3)``: rows to the right, up, and towards the viewer."""

    def __init__(self, ax: Any, camera: Array) -> None:
        self.ax, self.camera = ax, camera
        self._content = np.zeros((2, 2))
        self._filled = np.zeros((2, 2))

    def fit(self, points: Array, room: Callable[[], Array]) -> None:
        """Equal scales, at which points ``(n, 3)`` fill a box on the screen, with margins; ``room()`` gives the box."""
        seen = points @ self.camera[:2].T
        self._content = np.array([seen.min(axis=0), seen.max(axis=0)])
        self.fill(room())

    def fill(self, box: Array) -> None:
        """Fill a box, just before everything is drawn; the limits are set again where it has another shape."""
        if np.allclose(box, self._filled):
            return
        self._filled = box
        whole, (low, high) = self.ax.bbox.get_points(), within_margins(box)
        span = np.ptp(self._content, axis=0)
        scale = float(np.max(span / (high - low))) or 1.0
        begin = self._content.mean(axis=0) - scale * (0.5 * (low + high) - whole[0])
        end = begin + scale * (whole[1] - whole[0])
        self.ax.set_xlim(begin[0], end[0])
        self.ax.set_ylim(begin[1], end[1])

    def polygons(self, corners: Sequence[Array], faces: Array, edges: Array, zorder: float) -> Any:
        """Polygons ``(n, 3)`` with colors ``(count, 4)``, the nearest last."""
        from matplotlib.collections import PolyCollection

        order = np.argsort([float((p @ self.camera[2]).mean()) for p in corners], kind="stable")
        flat = [corners[i] @ self.camera[:2].T for i in order]
        style: dict[str, Any] = {"linewidths": 0.7, "zorder": zorder, "rasterized": len(flat) > MOST_PATHS}
        drawn = PolyCollection(flat, facecolors=faces[order], edgecolors=edges[order], **style)
        return self.ax.add_collection(drawn, autolim=False)

    def lines(self, runs: Sequence[Array], **style: Any) -> Any:
        """Polylines of one style."""
        from matplotlib.collections import LineCollection

        return self.ax.add_collection(LineCollection([run @ self.camera[:2].T for run in runs], **style), autolim=False)

    def marks(self, points: Array, **style: Any) -> Any:
        """Markers at points."""
        return self.ax.scatter(*(points @ self.camera[:2].T).T, **style)

    def pixels(self, points: Array) -> Array:
        """Where points ``(n, 3)`` are on the screen, ``(n, 2)``."""
        return np.asarray(self.ax.transData.transform(np.asarray(points) @ self.camera[:2].T))


class SpacePainter:
    """On three-dimensional axes, which can be turned afterwards; the drawing fills its place again whenever they are."""

    def __init__(self, ax: Any) -> None:
        self.ax = ax
        self._seen: tuple[float, ...] = ()

    def fit(self, points: Array, room: Callable[[], Array]) -> None:
        """See ``FlatPainter``; matplotlib asks where the axes are just before it draws them, which is when they are fitted."""
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
        low, high = within_margins(box)
        zoom = float(np.min((high - low) / np.maximum(size, 1e-9)))
        unit = zoom * float(np.linalg.norm(self.pixels((middle + extent * self.camera[0])[None])[0] - here)) / extent
        right, up = (0.5 * (low + high) - here) / unit
        self._look(middle - right * self.camera[0] - up * self.camera[1], extent, zoom)

    def _look(self, middle: Array, extent: float, zoom: float) -> None:
        for setter, c in zip((self.ax.set_xlim, self.ax.set_ylim, self.ax.set_zlim), middle, strict=True):
            setter(c - extent / 2, c + extent / 2)
        self.ax.set_box_aspect((1.0, 1.0, 1.0), zoom=zoom)

    def fill(self, box: Array) -> None:
        """See ``FlatPainter``; it was filled before."""

    @property
    def camera(self) -> Array:
        """See ``FlatPainter``."""
        return camera_of(self.ax.elev, self.ax.azim)

    def polygons(self, corners: Sequence[Array], faces: Array, edges: Array, zorder: float) -> Any:
        """See ``FlatPainter``."""
        # corners are repeated until all have as many: what matplotlib fills up itself holds any numbers
        most = max(map(len, corners))
        equal = [np.concatenate([p, np.repeat(p[-1:], most - len(p), axis=0)]) for p in corners]
        drawn = toolkit("art3d").Poly3DCollection(
            equal, facecolors=faces, edgecolors=edges, linewidths=0.7, zorder=zorder, rasterized=len(equal) > MOST_PATHS
        )
        return self.ax.add_collection3d(drawn, autolim=False)

    def lines(self, runs: Sequence[Array], **style: Any) -> Any:
        """See ``FlatPainter``."""
        return self.ax.add_collection3d(toolkit("art3d").Line3DCollection(list(runs), **style), autolim=False)

    def marks(self, points: Array, **style: Any) -> Any:
        """See ``FlatPainter``."""
        return self.ax.scatter(*points.T, depthshade=False, **style)

    def pixels(self, points: Array) -> Array:
        """See ``FlatPainter``."""
        x, y, _ = toolkit("proj3d").proj_transform(*np.asarray(points).T, self.ax.get_proj())
        return np.asarray(self.ax.transData.transform(np.column_stack([x, y])))


Painter = FlatPainter | SpacePainter


def shaded(colour: str, corners: Sequence[Array], camera: Array, alpha: float = 1.0) -> Array:
    """Colors ``(n, 4)`` of polygons in the light: ``c (a + (1 - a) |n . l|)``."""
    from matplotlib.colors import to_rgba

    light = LIGHT @ camera
    normals = np.array([np.cross(p[1] - p[0], p[2] - p[0]) for p in corners])
    sizes = np.linalg.norm(normals, axis=1)
    ambient = 0.66  # brightness of what lies in the shade
    bright = ambient + (1 - ambient) * np.abs(normals @ light) / np.where(sizes > 0, sizes, 1.0)
    out = np.tile(to_rgba(colour, alpha), (len(corners), 1))
    out[:, :3] *= bright[:, None]
    return out


def tint(colour: str) -> str:
    """A color, mixed with white: that of a body through whose outline others are seen."""
    from matplotlib.colors import to_hex, to_rgb

    r, g, b = (1.0 - 0.28 * (1.0 - part) for part in to_rgb(colour))
    return str(to_hex((r, g, b)))


def edges_of(faces: Array, rims: Sequence[bool], alpha: float = 1.0) -> Array:
    """Edges of polygons: ink where they are rims, else as the face, so that no seam shows."""
    from matplotlib.colors import to_rgba

    return np.where(np.asarray(rims, dtype=bool)[:, None], to_rgba(INK, alpha), faces)


def inside(ax: Any) -> Array:
    """The place of axes on the screen as their figure gives it, ``[[left, bottom], [right, top]]`` in pixels."""
    place = ax.get_position(original=True).transformed(ax.figure.transSubfigure)
    return np.array(place.get_points())


def places(names: Iterable[str], edges: Iterable[tuple[str, str]]) -> dict[str, Array]:
    """Where the nodes of a graph are drawn, neighbors at a distance of about one; the same each time."""
    import networkx as nx

    number = {name: i for i, name in enumerate(names)}
    graph: nx.Graph[int] = nx.Graph()  # of numbers: sets of texts have another order each time
    graph.add_nodes_from(number.values())
    graph.add_edges_from((number[a], number[b]) for a, b in edges)
    begin: dict[int, Any]
    if len(graph) < 3:
        begin = {name: (float(i), 0.0) for i, name in enumerate(graph)}
    elif max(degree for _, degree in graph.degree) == 2:
        turn = 2 * np.pi * np.arange(len(graph)) / len(graph)
        begin = {name: (np.cos(a), np.sin(a)) for name, a in zip(_cycle_order(graph), turn, strict=True)}
    else:
        begin = _clearest(graph)
    at = _scaled(graph, begin)
    return {name: at[i] for name, i in number.items()}


def _clearest(graph: nx.Graph[int]) -> dict[int, Any]:
    """Of several layouts that give distances their due, the one in which the fewest lines cross each other or run over nodes."""
    import networkx as nx

    # nodes from which on one layout is taken, unseen; from four times as many on that of springs, which is faster
    large = 40
    if len(graph) > large:
        return nx.kamada_kawai_layout(graph) if len(graph) < 4 * large else nx.spring_layout(graph, seed=0)
    first = [nx.planar_layout(graph)] if nx.is_planar(graph) else []
    first += [nx.circular_layout(graph), *(nx.spring_layout(graph, seed=seed) for seed in range(3))]
    found = [_scaled(graph, nx.kamada_kawai_layout(graph, pos=pos)) for pos in first]
    number, n = {name: i for i, name in enumerate(graph)}, len(graph)
    edges = np.array([(number[a], number[b]) for a, b in graph.edges])
    apart = [(i, j) for i, j in combinations(range(len(edges)), 2) if not {*edges[i]} & {*edges[j]}]
    beside = np.array([(e, k) for e, ends in enumerate(edges) for k in range(n) if k not in ends])
    pairs = np.array(apart, dtype=np.intp).reshape(-1, 2)
    # distance of a line from a node that is not its end, over that of neighbors, below which they clash
    return min(found, key=lambda at: clashes(np.array([at[name] for name in graph]), edges, pairs, beside, 0.15))


def clashes(at: Array, edges: Index, apart: Index, beside: Index, near: float) -> int:
    """Pairs ``apart (n, 2)`` of ``edges (m, 2)`` that cross between nodes ``at (k, 2)``, and pairs ``beside`` of an edge and a node that
    are nearer to each other than ``near``.
    """
    p, q = at[edges[:, 0]], at[edges[:, 1]]

    def side(a: Array, b: Array, c: Array) -> Array:
        return np.asarray((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) > (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]), float)

    a, b, c, d = p[apart[:, 0]], q[apart[:, 0]], p[apart[:, 1]], q[apart[:, 1]]
    crossings = (side(a, b, c) != side(a, b, d)) & (side(c, d, a) != side(c, d, b))
    along, start, point = (q - p)[beside[:, 0]], p[beside[:, 0]], at[beside[:, 1]]
    u = np.clip(((point - start) * along).sum(axis=1) / np.maximum((along * along).sum(axis=1), 1e-9), 0.0, 1.0)
    return int(crossings.sum()) + int((np.linalg.norm(start + u[:, None] * along - point, axis=1) < near).sum())


def _scaled(graph: nx.Graph[int], begin: dict[int, Any]) -> dict[int, Array]:
    at = {name: np.asarray(begin[name], dtype=float) for name in graph}
    lengths = [float(np.linalg.norm(at[a] - at[b])) for a, b in graph.edges]
    unit = float(np.median(lengths)) if lengths else 1.0
    return {name: p / unit for name, p in at.items()}


def _cycle_order(graph: nx.Graph[int]) -> list[int]:
    """Nodes of a cycle or path, one after the other."""
    import networkx as nx

    ends = [name for name, degree in graph.degree if degree < 2]
    return list(nx.dfs_preorder_nodes(graph, source=(ends or list(graph))[0]))


def nice_length(extent: float) -> float:
    """A round length of about a sixth of an extent: 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(extent / 6))
    return float(power * max(f for f in (1.0, 2.0, 5.0) if f * power <= extent / 6 * (1 + 1e-9)))
