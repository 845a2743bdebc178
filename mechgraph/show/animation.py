"""Films of a mechanism, and pictures as files: written by matplotlib's own writers, whole or not at all."""

from __future__ import annotations

import importlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import Positive, door
from mechgraph.errors import DeclarationError
from mechgraph.quantities import wrong
from mechgraph.result.solution import Solution
from mechgraph.show.canvas import DRAWN, Dpi, Size, colours, new_axes
from mechgraph.show.scene import Scene, scene
from mechgraph.show.skeleton import Drawing, course_of, painter_for, trace_faults
from mechgraph.writing import Format, format_of, optional, whole_file, writable

MOST_FRAMES = 72
"""Frames of a film unless they are asked for: the positions are thinned out to so many."""
SHOWN = 12
"""Positions from which the extent of a film is taken."""

Frames = Callable[[], Iterator[Any]]


@door
def animate(
    s: Solution,
    path: str | os.PathLike[str],
    *,
    frames: int | Sequence[int] | None = None,
    fps: Positive = 20.0,
    forces: bool = False,
    traces: bool | Sequence[str] = True,
    labels: bool = True,
    view: tuple[float, float] = (24.0, -58.0),
    size: Size = (6.4, 4.8),
    dpi: Dpi = 100.0,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write a film of the mechanism over its positions: ``.gif``, ``.mp4`` (needs ffmpeg, or the ``film`` extra) or ``.png``.

    Of ``motion.png`` the frames are ``motion-000.png``, ``motion-001.png``, ... Names keep their places from frame to frame as far as they
    can. Files are written whole or not at all.

    Parameters
    ----------
    frames : the number of frames, evenly spread over the solved positions, or flat indices of positions; left out, all of them, at most 72.
    fps : frames a second.
    size, dpi : of a frame, inches and pixels an inch.
    forces, traces, labels, view : as in ``draw_skeleton``.
    progress : called with the numbers of frames done and of all frames.

    Raises
    ------
    DeclarationError
        where no position was solved, or a frame is none; FileError where the file cannot be written or ffmpeg is not there;
        MissingExtraError without matplotlib.
    """
    target = format_of(path, FORMATS)
    writable(path)
    found = scene(s, forces=forces)
    chosen = _chosen(found, frames)
    if faults := trace_faults(found, traces):
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
        n = min(count, MOST_FRAMES) if frames is None else frames
        if n < 1:
            raise DeclarationError(where, [wrong(frames, "frames", "a positive number")])
        return np.linspace(0, count - 1, n).round().astype(int).tolist()
    places = {int(p): t for t, p in enumerate(found.positions)}
    bad = [p for p in frames if p not in places]
    if bad:
        raise DeclarationError(where, [f"frames: position {bad[0]} was not solved, or is none"])
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
        some = np.unique(np.linspace(0, len(chosen) - 1, SHOWN).round().astype(int))
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
    """Write the figure of axes, whole or not at all, as the suffix says: ``.png``, ``.svg`` or ``.pdf``; the same bytes each time.

    Raises
    ------
    FileError
        for another suffix, or where the file cannot be written.
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
