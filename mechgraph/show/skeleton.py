"""Skeletons of mechanisms, still and moving."""

from __future__ import annotations

import importlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from mechgraph.errors import DeclarationError, counted
from mechgraph.files import Format, format_of, optional, whole_file, writable
from mechgraph.maths.se3 import Array
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import Positive, door, shown, unit_of, wrong
from mechgraph.result.solution import Solution
from mechgraph.show.canvas import (
    DRAWN,
    HATCH,
    INK,
    LOAD,
    MUTED,
    REACTION,
    Axes,
    Dpi,
    FlatPainter,
    Painter,
    Size,
    SpacePainter,
    camera_of,
    colours,
    edges_of,
    inside,
    new_axes,
    nice_length,
    said,
    scale_in,
    shaded,
    tint,
)
from mechgraph.show.scene import DrawnPart, Scene, scene

BODY = "#f2f4f7"
LINES = {
    "wheel": (0.9, "-"), "face": (2.2, "-"), "axis": (0.9, (0, (8, 2, 1.5, 2))), "tie": (0.9, (0, (2, 2))), "spring": (1.3, "-"),
    "load": (2.2, "-"), "drive": (1.8, "-"), "reaction": (2.4, "-"), "foot": (0.8, "-"),
}  # fmt: skip
"""Width and style of the lines of parts by their role."""
SOLID = {
    "strand": "#3e4c59", "roller": BODY, "body": BODY, "dark": "#52606d", "spring": BODY, "load": LOAD, "drive": INK, "reaction": REACTION,
    "foot": "#d5dbe1",
}  # fmt: skip
"""Colors of the polygons of parts by their role; others have that of their link."""
LINE_COLOUR = {"axis": INK, "spring": "#3e4c59", "load": LOAD, "drive": INK, "reaction": REACTION, "foot": MUTED}
ABOVE = {
    "guide": 1.6, "wheel": 1.7, "strand": 1.9, "plate": 2.0, "foot": 2.1, "face": 2.2, "spring": 5.0, "load": 6.0, "drive": 6.0,
    "reaction": 6.5,
}  # fmt: skip
"""Height of roles over others; links and symbols lie together at 4, sorted by depth."""
SOLIDS = ("guide", "wheel", "strand", "foot")
"""Roles that in space lie with the links and symbols, as one hides the other."""


@door
def draw_skeleton(
    s: Solution | Mechanism,
    position: int | None = None,
    *,
    ax: Axes = None,
    ghosts: int = 5,
    traces: bool | Sequence[str] = True,
    labels: bool = True,
    forces: bool = False,
    centers: bool = True,
    highlight: Sequence[str | tuple[str, int]] = (),
    view: tuple[float, float] = (24.0, -58.0),
) -> Any:
    """Draw the mechanism at one position, faint at others, with the paths of its pair points.

    Links are rods between two pairs, plates between more; a circle with a dot is a mass center. Pair symbols follow from the
    freedoms: a drum rotates (with a thread: screw), a guide translates, a ball is spherical, a cross of pins universal, a square a
    weld. Driven freedoms have an arrow in their positive sense; springs, dampers, forces and moments are drawn where they act. Gears
    have their pitch circles and, from 8 pixels a tooth on, involute teeth that interleave; belts are the thicker the tighter they are;
    cams have their profiles, rollers their radii. A planar mechanism is drawn in its plane, with its guides on hatched ground.

    Parameters
    ----------
    s : Solution or Mechanism
        A solution or response; or a mechanism with geometry, drawn where its loops are closed.
    position : int, optional
        Flat index of the position drawn in full. Default: the first that was solved.
    ax : Axes, optional
        Axes of matplotlib in two or three dimensions. Default: new ones, ``ax.figure.savefig(...)``.
    ghosts : int
        Number of further positions, drawn faintly.
    traces : bool or sequence of str
        Draw the paths of pair points and named points, or those named: ``["B", "arm.tip"]``.
    labels : bool
        Names of pairs (with their type) and links.
    forces : bool
        Arrows of the reaction forces of link a on link b; hatched if the force is indeterminate. Where a journal rubs its friction circle
        and the line of the force, tangent to it.
    centers : bool
        Mass centers.
    highlight : sequence
        Names of pairs, or a loop (``report.loops[0]``); all other links are gray. Left out, what jams where the position does.
    view : (2,) tuple of float
        Elevation and azimuth [deg] of a spatial mechanism.

    Returns
    -------
    Axes

    Raises
    ------
    DeclarationError
        That position was not solved, or a highlighted pair does not exist.
    AssemblyError
        The mechanism cannot be closed.
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> ax = show.draw_skeleton(mg.load("four-bar"))
    """
    found = scene(s, forces=forces, centers=centers)
    m, size = found.mechanism, 1 if isinstance(s, Mechanism) else int(np.asarray(s.status).size)
    chosen = [item if isinstance(item, str) else item[0] for item in highlight]
    names = [p.name for p in m.pairs]
    known = ", ".join(names)
    faults = [f"highlight: there is no pair {name!r}; pairs: {known}" for name in chosen if name not in names]
    faults += trace_faults(found, traces)
    if not len(found.positions):
        faults.append(f"none of {counted(size, 'position')} was solved")
    elif position is not None and (not -size <= position < size or position % size not in found.positions):
        faults.append(f"position {position} was not solved, or is none of {size}")
    if faults:
        raise DeclarationError(f"skeleton of {m.name!r}", faults)
    t = 0 if position is None else int(np.searchsorted(found.positions, position % size))
    painter = painter_for(found, ax, view)
    if isinstance(s, Solution) and (stuck := s.jams.get(int(found.positions[t]))) is not None:
        chosen = chosen or [name for name in stuck.places if name in names]
        what = f"{np.asarray(s.status).reshape(-1)[found.positions[t]]}: {', '.join(map(said, stuck.places))}"
        painter.ax.set_title(f"{what}\nfrom {stuck.factor:.3g} of its friction on", color=INK, fontsize=10)
    drawing = Drawing(found, painter, colours(m, chosen))
    others = np.unique(np.linspace(0, len(found.positions) - 1, ghosts + 1).astype(int)) if ghosts else ()
    drawing.ghosts([int(i) for i in others if i != t])
    drawing.traces(traces, course_of(s, found, traces))
    drawing.position(t)
    drawing.furniture(t, labels)
    return painter.ax


def traceable(found: Scene) -> dict[str, tuple[str, Array]]:
    """What has a path, by its name: the link that moves and the path ``(T, 3)``. Pairs have that of their point, named points their own."""
    m = found.mechanism
    out = {
        part.owner: (part.link, X[:, :, :3] @ part.shape.vertices[0] + X[:, :, 3])
        for part in found.parts
        if part.role == "point"
        for X in [found.frames[part.frame]]
    }
    return out | {p.name: (p.b if p.b != m.frame else p.a, found.points[p.name, p.b]) for p in m.pairs}


def course_of(s: Solution | Mechanism, found: Scene, traces: bool | Sequence[str]) -> Scene:
    """The scene whose positions paths run through: of a response that at times between its outputs too."""
    return scene(s.finely()) if isinstance(s, Solution) and s.integrated and traces else found


def _pieces(course: Scene, path: Array) -> list[Array]:
    """A path cut where positions between were not solved, and between cases."""
    gaps = (np.diff(course.positions) > 1) | (np.diff(course.cases) > 0)
    return [piece for piece in np.split(path, np.flatnonzero(gaps) + 1) if len(piece) > 1]


def trace_faults(found: Scene, traces: bool | Sequence[str]) -> list[str]:
    """What is wrong with names of paths."""
    names, known = [] if isinstance(traces, bool) else list(traces), traceable(found)
    bad = [shown(name) for name in names if name not in known]
    return [f"traces: there is no pair or named point {name}; there are: {', '.join(known)}" for name in bad]


def painter_for(found: Scene, ax: Any, view: tuple[float, float]) -> Painter:
    """A painter on given or new axes; a plane mechanism is seen along its normal, from where it stands upright."""
    if ax is None:
        ax = new_axes((7.2, 5.4)) if found.normal is not None else new_axes((7.2, 5.4), projection="3d")
    if ax.name == "3d":
        ax.set_proj_type("ortho")
        ax.computed_zorder = False
        if found.normal is not None:
            x, y, z = -found.upright[:, 1]
            view = (np.rad2deg(np.arcsin(np.clip(z, -1, 1))), -90.0 if abs(z) > 0.99 else np.rad2deg(np.arctan2(y, x)))
        ax.view_init(*view)
        return SpacePainter(ax)
    if found.normal is not None:
        return FlatPainter(ax, found.upright.T[[0, 2, 1]] * [[1], [1], [-1]])
    return FlatPainter(ax, camera_of(*view))


class Drawing:
    """A scene that is painted, layer by layer."""

    def __init__(self, found: Scene, painter: Painter, colour: dict[str, str]) -> None:
        self.scene, self.painter, self.colour = found, painter, colour
        self.ax = painter.ax

    # --- layers --------------------------------------------------------------------------------------------------------

    def ghosts(self, positions: Sequence[int]) -> None:
        """The middle lines of links and edges of plates at other positions."""
        for part in self.scene.parts:
            if part.role == "link" and positions:
                runs = [run for t in positions for run in _runs(part, self.scene.vertices(part, t))]
                style = {"linewidths": 1.2, "alpha": 0.3, "zorder": 1.0, "gid": "ghosts"}
                self.painter.lines(runs, colors=self.colour[part.link], **style)

    def traces(self, traces: bool | Sequence[str], course: Scene) -> None:
        """Paths of pair points on link b, or on link a where b is the frame, and of named points: of all, of none, or of some by name."""
        known = traceable(course)
        for name in () if traces is False else known if traces is True else traces:
            mover, path = known[name]
            if np.ptp(path, axis=0).max() > 1e-3 * self.scene.size:
                pieces = _pieces(course, path)
                style = {"linewidths": 0.9, "linestyles": [(0, (1, 1.6))], "alpha": 0.8, "zorder": 1.5}
                self.painter.lines(pieces, colors=self.colour[mover], gid=f"trace of {name}", **style)

    def position(self, t: int) -> None:
        """Everything at one position."""
        heights: dict[float, list[tuple[DrawnPart, Array]]] = {}
        scale = scale_in(inside(self.ax), self.scene.all_vertices(t), self.painter.camera)
        for part in self.scene.parts:
            vertices = self.scene.vertices(part, t)
            if np.isnan(vertices).any() or not part.scales[0] <= scale < part.scales[1]:
                continue
            level = {} if self.scene.normal is None and part.role in SOLIDS else ABOVE
            heights.setdefault(level.get(part.role, 4.0), []).append((part, vertices))
            if part.role in ("center", "point"):
                self._mark(part, vertices)
            elif part.dashed or part.role in LINES:
                self._outline(part, vertices)
        for height, parts in sorted(heights.items()):
            self._polygons(parts, height)
        lost = [self.scene.points[name, self.scene.mechanism.pair(name).b][t] for name in self.scene.not_unique]
        if lost:
            style = {
                "marker": "o",
                "s": 520,
                "facecolor": "none",
                "edgecolor": REACTION,
                "hatch": HATCH,
                "linewidth": 1.0,
            }
            self.painter.marks(np.array(lost), zorder=6.4, gid="not unique", **style)

    def _polygons(self, parts: list[tuple[DrawnPart, Array]], height: float) -> None:
        corners, faces, edges = [], [], []
        for part, vertices in parts:
            if part.dashed or not part.shape.faces:
                continue
            own = [vertices[list(face)] for face in part.shape.faces]
            alpha = {"plate": 0.2, "guide": 0.28}.get(part.role, 1.0)
            colour = SOLID.get(part.role) or self.colour[part.link]
            if part.role == "wheel":
                colour = tint(colour)
            shade = shaded(colour, own, self.painter.camera, alpha)
            rims = [i < part.shape.rims and part.role != "plate" for i in range(len(own))]
            corners += own
            faces.append(shade)
            edges.append(edges_of(shade, rims, 0.8 if alpha < 1 else 1.0))
        if corners:
            self.painter.polygons(corners, np.concatenate(faces), np.concatenate(edges), height)

    def _outline(self, part: DrawnPart, vertices: Array) -> None:
        width, style = LINES.get(part.role, (1.0, "-"))
        colour = LINE_COLOUR.get(part.role) or self.colour.get(part.link, INK)
        self.painter.lines(
            _runs(part, vertices), colors=colour, linewidths=width, linestyles=[(0, (3, 2)) if part.dashed else style],
            zorder=ABOVE.get(part.role, 5.0) + 0.05, gid=f"{part.role} {part.owner}",
        )  # fmt: skip

    def _mark(self, part: DrawnPart, vertices: Array) -> None:
        colour = self.colour[part.link]
        if part.role == "point":
            self.painter.marks(vertices, marker="x", s=40, color=colour, zorder=7, gid=f"point {part.owner}")
            return
        self.painter.marks(vertices, s=46, facecolor="white", edgecolor=colour, linewidth=1.2, zorder=6)
        self.painter.marks(vertices, s=9, color=colour, zorder=6.1, gid=f"center {part.owner}")

    # --- what stands beside it -----------------------------------------------------------------------------------------

    def furniture(
        self, t: int, labels: bool, extent: Array | None = None, places: dict[str, Array] | None = None
    ) -> None:
        """Equal scales, no frame; names, directions and a scale; where pairs are many, numbers and a legend.

        ``extent``: points that fill the axes, those at this position where left out; ``places``: where names stood before, which is
        where they are put again if they can.
        """
        from mechgraph.show.arrangement import Arrangement  # not above: matplotlib is an extra

        painter, samples = self.painter, self._samples(t)
        self.ax.set_axis_off()
        arranged = Arrangement(
            self.ax, painter.pixels, lambda: painter.pixels(samples), lambda: painter.camera, lambda: inside(self.ax), painter.fill,
            places,
        )  # fmt: skip
        axes = [(name, axis, MUTED) for name, axis in zip("xyz", np.eye(3), strict=True)]
        if self.scene.gravity is not None:
            axes.append(("g", self.scene.gravity / np.linalg.norm(self.scene.gravity), LOAD))
        arranged.directions(axes)
        units, scale = self.scene.mechanism.units, self.scene.reaction_scale
        length = nice_length(self.scene.size)
        arranged.scale(length, f"{length:g} {unit_of(units, (1, 0, 0))}".strip())
        if scale:
            force = nice_length(self.scene.size / scale)
            arranged.scale(scale * force, f"{force:g} {unit_of(units, (1, 1, -2))}".strip(), REACTION)
        if self.scene.not_unique:
            arranged.scale(0.0, "hatched: not unique", REACTION)
        if labels:
            self._names(arranged, t)
        painter.fit(self.scene.all_vertices(t) if extent is None else extent, arranged.room)
        for artist in (*self.ax.lines, *self.ax.collections):
            artist.set_clip_on(False)
            artist.set_in_layout(False)

    def _names(self, arranged: Any, t: int) -> None:
        m, lines = self.scene.mechanism, []
        # pairs up to which all names stand in the drawing; beyond, numbers stand there and a legend beside it says what they are
        numbered = len(m.pairs) > 12
        for label in self.scene.labels:
            text, colour = label.text, self.colour.get(label.link, INK)
            if numbered and label.kind == "pair":
                text = str(m.place_of_pair(label.owner) + 1)
                lines.append((f"{text}  {label.text}", INK))
            elif numbered and label.kind == "link":
                lines.append((text, colour))
                continue
            style = {"fontsize": 9.5, "weight": "bold"} if label.kind == "pair" else {"fontsize": 9.0}
            away = self.scene.symbol * (1.15 if label.kind == "pair" else 0.6)
            arranged.name(text, self.scene.place(label, t), colour, away, **style)
        arranged.legend(lines)

    def _samples(self, t: int) -> Array:
        """Points along what texts should not cover: middle lines of links, symbols, arrows and springs."""
        out = []
        for part in self.scene.parts:
            vertices = self.scene.vertices(part, t)
            if part.role in ("plate", "wheel", "axis", "tie") or np.isnan(vertices).any():
                continue
            if part.role == "link":
                u = np.linspace(0, 1, 25)[:, None]
                out += [(1 - u) * run[0] + u * run[-1] for run in _runs(part, vertices)]
            else:
                out.append(vertices[:: max(len(vertices) // 40, 1)])
        return np.concatenate(out)


def _runs(part: DrawnPart, vertices: Array) -> list[Array]:
    return [vertices[list(line)] for line in part.shape.lines]


Frames = Callable[[], Iterator[Any]]


@door
def animate(
    s: Solution,
    path: str | os.PathLike[str],
    *,
    frames: int | Sequence[int] | None = None,
    fps: Positive = 20.0,
    forces: bool = False,
    centers: bool = True,
    traces: bool | Sequence[str] = True,
    labels: bool = True,
    view: tuple[float, float] = (24.0, -58.0),
    size: Size = (6.4, 4.8),
    dpi: Dpi = 100.0,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write an animation of the mechanism: ``.gif``, ``.mp4`` (ffmpeg or the ``film`` extra) or ``.png``.

    ``motion.png`` gives the frames ``motion-000.png``, ``motion-001.png``, ... Labels keep their places from frame to frame if possible.

    Parameters
    ----------
    s : Solution
        A solution or response.
    path : str or path
        The file, written atomically; the extension selects the format.
    frames : int or sequence of int, optional
        Number of frames, evenly spread over the solved positions, or flat indices of positions. Default: all, at most 72.
    fps : float
        Frames per second.
    forces, centers, traces, labels, view
        As in ``draw_skeleton``.
    size, dpi
        Of a frame: inches, and pixels per inch.
    progress : callable, optional
        Called with the numbers of frames done and of all frames.

    Raises
    ------
    DeclarationError
        No position was solved, or a frame does not exist.
    FileError
        The file cannot be written, or ffmpeg is missing.
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     show.animate(mg.kinematics(mg.load("four-bar"), {"A": [0, 1]}), pathlib.Path(folder) / "a.gif", frames=2)
    ...     print([file.name for file in pathlib.Path(folder).iterdir()])
    ['a.gif']
    """
    target = format_of(path, FORMATS)
    writable(path)
    found = scene(s, forces=forces, centers=centers)
    chosen = _chosen(found, frames)
    slow = 0.01  # frames a second: formats hold the time of a picture in whole milliseconds, of 32 bits
    if faults := trace_faults(found, traces) + ([] if fps >= slow else [wrong(fps, "fps", f"{slow:g} or more")]):
        raise DeclarationError(f"animation of {found.mechanism.name!r}", faults)
    film = _Film(found, course_of(s, found, traces), chosen, traces, labels, view, size)

    def drawn() -> Iterator[Any]:
        for done, t in enumerate(chosen, 1):
            yield film.frame(t)
            if progress is not None:
                progress(done, len(chosen))

    target.write(drawn, path, fps, dpi)


def _chosen(found: Scene, frames: int | Sequence[int] | None) -> list[int]:
    """Numbers of the drawn positions that are frames."""
    count, where = len(found.positions), f"film of {found.mechanism.name!r}"
    if frames is None or isinstance(frames, int):
        # frames of a film unless they are asked for: the positions are thinned out to so many
        n = min(count, 72) if frames is None else frames
        if n < 1:
            raise DeclarationError(where, [wrong(frames, "frames", "a positive number")])
        return np.linspace(0, count - 1, n).round().astype(int).tolist()
    places = {int(p): t for t, p in enumerate(found.positions)}
    bad = [p for p in frames if p not in places]
    if bad:
        raise DeclarationError(where, [f"frames: position {bad[0]} was not solved, or is none"])
    if not len(frames):
        raise DeclarationError(where, [wrong(frames, "frames", "one or more")])
    return [places[p] for p in frames]


class _Film:
    """Draws one frame after the other on the same axes, at the same scale."""

    def __init__(
        self,
        found: Scene,
        course: Scene,
        chosen: Sequence[int],
        traces: bool | Sequence[str],
        labels: bool,
        view: Any,
        size: Any,
    ) -> None:
        self.scene, self.labels, self.view = found, labels, view
        m = found.mechanism
        self.course, self.traces = course, traces
        self.colour = colours(m)
        self.ax = new_axes(size) if found.normal is not None else new_axes(size, projection="3d")
        # every frame alike, and drawn once: without a layout that measures it first
        self.ax.figure.set_layout_engine("none")
        self.ax.set_position((0.0, 0.0, 1.0, 1.0))
        # positions from which the extent of a film is taken
        some = np.unique(np.linspace(0, len(chosen) - 1, 12).round().astype(int))
        self.extent: Array = np.concatenate([found.all_vertices(chosen[i]) for i in some])
        self.places: dict[str, Array] = {}

    def frame(self, t: int) -> Any:
        """The figure at a drawn position."""
        self.ax.clear()
        painter = painter_for(self.scene, self.ax, self.view)
        drawing = Drawing(self.scene, painter, self.colour)
        drawing.traces(self.traces, self.course)
        drawing.position(t)
        drawing.furniture(t, self.labels, self.extent, self.places)
        return self.ax.figure


def _film(writer: Callable[[float], Any], suffix: str) -> Callable[..., None]:
    """How a film of a kind is written: first beside, then in its place."""

    def write(frames: Frames, path: str | os.PathLike[str], fps: float, dpi: float) -> None:
        with tempfile.TemporaryDirectory() as folder, whole_file(path) as temporary:
            made, started = Path(folder) / f"film{suffix}", None
            try:
                for figure in frames():
                    if started is None:
                        started = writer(fps)
                        started.setup(figure, made, dpi)
                    started.grab_frame()
            finally:
                if started is not None:
                    started.finish()
            shutil.copyfile(made, temporary)

    return write


def _gif(fps: float) -> Any:
    return importlib.import_module("matplotlib.animation").PillowWriter(fps=fps)


def _mp4(fps: float) -> Any:
    writer = importlib.import_module("matplotlib.animation").FFMpegWriter
    if writer.isAvailable():
        return writer(fps=fps, codec="h264")
    program = optional("imageio_ffmpeg", "film").get_ffmpeg_exe()
    # a class of its own with another program, as settings of matplotlib are the user's
    own = type("OwnFFMpegWriter", (writer,), {"bin_path": classmethod(lambda cls: program)})
    return own(fps=fps, codec="h264")


def _stills(frames: Frames, path: str | os.PathLike[str], fps: float, dpi: float) -> None:
    """All frames are made before the first is put in its place."""
    target = Path(path)
    with tempfile.TemporaryDirectory() as folder:
        made: list[Path] = []
        for figure in frames():
            made.append(Path(folder) / f"{len(made):05d}.png")
            figure.savefig(made[-1], dpi=dpi)
        digits = max(3, len(str(len(made) - 1)))
        for i, still in enumerate(made):
            with whole_file(target.with_name(f"{target.stem}-{i:0{digits}d}{target.suffix}")) as temporary:
                shutil.copyfile(still, temporary)


FORMATS = (
    Format("animated GIF", (".gif",), _film(_gif, ".gif"), ("matplotlib",), "plot"),
    Format("film", (".mp4",), _film(_mp4, ".mp4"), ("matplotlib",), "plot"),
    Format("PNG frames", (".png",), _stills, ("matplotlib",), "plot"),
)
"""What a film can be written as."""


@door
def save_picture(ax: Annotated[Any, DRAWN], path: str | os.PathLike[str], *, dpi: Dpi = 150.0) -> None:
    """Write the figure of axes atomically; the extension selects the format. The same picture gives the same bytes.

    Parameters
    ----------
    ax : Axes or Figure
        Of matplotlib.
    path : str or path
        ``.png``, ``.svg`` or ``.pdf``.
    dpi : float
        Pixels per inch of a ``.png``.

    Raises
    ------
    FileError
        Another extension, or the file cannot be written.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     show.save_picture(show.draw_graph(mg.load("rcsr")), pathlib.Path(folder) / "graph.svg")
    ...     print([file.name for file in pathlib.Path(folder).iterdir()])
    ['graph.svg']
    """
    format_of(path, PICTURES).write(ax, path, dpi)


def _picture(kind: str, unstamped: dict[str, None]) -> Callable[..., None]:
    def write(ax: Any, path: str | os.PathLike[str], dpi: float) -> None:
        import matplotlib

        with whole_file(path) as temporary, matplotlib.rc_context({"svg.hashsalt": "mechgraph"}):
            ax.figure.canvas.figure.savefig(temporary, format=kind, dpi=dpi, metadata=unstamped)

    return write


PICTURES = (
    Format("picture", (".png",), _picture("png", {"Software": None}), ("matplotlib",), "plot"),
    Format("drawing", (".svg",), _picture("svg", {"Date": None}), ("matplotlib",), "plot"),
    Format("document", (".pdf",), _picture("pdf", {"CreationDate": None}), ("matplotlib",), "plot"),
)
"""What a picture can be written as."""
