"""Shapes and numbers as the scripts of the page read them."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.document.tree import plain
from mechgraph.model.pair import Pair
from mechgraph.show.canvas import colours
from mechgraph.show.scene import Part, Scene
from mechgraph.show.shapes import Shape


def packed(values: Any) -> dict[str, Any]:
    """An array as 32-bit numbers, little-endian, in base64; NaN stays NaN."""
    array = np.ascontiguousarray(values, dtype="<f4")
    return {"shape": list(array.shape), "f32": base64.b64encode(array.tobytes()).decode()}


def rounded(values: Array) -> list[float]:
    """A few numbers, to seven digits."""
    return [float(f"{value:.7g}") for value in np.asarray(values, dtype=float).ravel()]


def json_for_script(data: Any) -> str:
    """JSON that ends no script element and no line of one, whatever its texts hold.

    ValueError where a number is not finite: what is not known is packed, or is no number.
    """
    text = json.dumps(data, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


OBLIQUE = (0.6, -1.0, 0.55)
"""Direction from which a spatial mechanism is seen, in upright axes."""
ROOM = 6.0
"""Room about what is drawn, for names and arrows, over the half width of a symbol."""
LEFT_OUT = {"reaction"}
"""Parts that the page draws itself, from numbers."""


class Figure:
    """What is drawn of a scene, and where it ``stands``; ``names`` are the frames that are handed over, in order."""

    def __init__(self, scene: Scene, stands: Mapping[str, Array]) -> None:
        self.stands = stands
        self.scene, self.m = scene, scene.mechanism
        self.colours = colours(self.m)
        self.home = {f"pair:{p.name}@0": (p.a, p.markers[0].pose()) for p in self.m.pairs}
        self.home |= {f"pair:{p.name}@{p.type.f}": (p.b, p.markers[1].pose()) for p in self.m.pairs}
        self.parts = [part for part in scene.parts if part.role not in LEFT_OUT]
        used = [self.placed(part.frame)[0] for part in self.parts]
        links = [f"link:{name}" for name in self.m.link_names()]
        self.names = list(dict.fromkeys([*links, *used]))
        self.number = {name: i for i, name in enumerate(self.names)}

    def placed(self, frame: str) -> tuple[str, Array]:
        """The frame that is handed over for a frame, and its pose in that."""
        if frame in self.home:
            link, pose = self.home[frame]
            return f"link:{link}", pose
        return frame, np.eye(3, 4)

    def data(self, rows: Mapping[str, list[list[str]]]) -> dict[str, Any]:
        """The figure where it stands; ``rows`` are facts of the pairs."""
        scene, frames = self.scene, self.stands
        points = np.concatenate([scene.everything, *(moved(part.shape, frames[part.frame][0]) for part in self.parts)])
        points = points[np.isfinite(points).all(axis=1)]
        look = scene.normal if scene.normal is not None else scene.upright @ np.array(OBLIQUE) / np.linalg.norm(OBLIQUE)
        screen = np.stack([np.cross(scene.upright[:, 2], look), scene.upright[:, 2], look])
        screen[0] /= np.linalg.norm(screen[0])
        screen[1] = np.cross(look, screen[0])
        seen = points @ screen.T
        low, high = seen.min(axis=0), seen.max(axis=0)
        return {
            "name": plain(self.m.name),
            "size": float(scene.size),
            "span": rounded(high[:2] - low[:2] + ROOM * scene.symbol),
            "symbol": float(scene.symbol),
            "center": rounded(screen.T @ (low + high) / 2),
            "up": rounded(scene.upright[:, 2]),
            "look": rounded(look),
            "links": [{"name": plain(name), "colour": self.colours[name]} for name in self.m.link_names()],
            "pairs": [self._pair(pair, rows.get(pair.name, [])) for pair in self.m.pairs],
            "pieces": [self.piece(part) for part in self.parts],
            "labels": [self._label(label) for label in scene.labels],
            "frames": packed(self.of(frames, self.names)[0]),
        }

    def of(self, frames: Mapping[str, Array], names: list[str]) -> Array:
        """Affine maps ``(T, n, 12)`` of some frames, row by row."""
        return np.stack([np.asarray(frames[name]).reshape(-1, 12) for name in names], axis=1)

    def motion(self, frames: Mapping[str, Array], kind: str) -> dict[str, Any]:
        """How the figure moves: the frames that leave the place where it stands, over ``T``."""
        still = 1e-7 * self.scene.size

        def travel(name: str) -> float:
            every = np.concatenate([self.stands[name][:1], frames[name]])
            return float(np.nanmax(np.ptp(every, axis=0), initial=0.0))

        moving = [name for name in self.names if travel(name) > still]
        values = self.of(frames, moving) if moving else np.zeros((len(next(iter(frames.values()))), 0, 12))
        return {"frames": [self.number[name] for name in moving], "values": packed(values), "kind": kind}

    def _pair(self, pair: Pair, rows: list[list[str]]) -> dict[str, Any]:
        return {
            "name": plain(pair.name), "type": pair.type.symbol, "title": plain(pair.type.name), "a": plain(pair.a), "b": plain(pair.b),
            "frame": self.number[f"link:{pair.b}"], "at": rounded(np.asarray(pair.markers[1].point)), "rows": rows,
        }  # fmt: skip

    def piece(self, part: Part) -> dict[str, Any]:
        """A part in the frame that is handed over."""
        frame, X = self.placed(part.frame)
        shape = part.shape.moved(X[:, :3], X[:, 3])
        names = [p.name for p in self.m.pairs]
        return {
            "frame": self.number[frame], "role": part.role, "colour": self.colours.get(part.link, ""), "dashed": part.dashed,
            "pair": names.index(part.owner) if part.owner in names else -1,
            "vertices": packed(shape.vertices), "triangles": triangles(shape), "lines": segments(shape),
        }  # fmt: skip

    def _label(self, label: Any) -> dict[str, Any]:
        frame, X = self.placed(label.frame)
        names = [p.name for p in self.m.pairs]
        pair = names.index(label.owner) if label.kind == "pair" else -1
        at = X[:, :3] @ label.at + X[:, 3]
        return {
            "text": plain(label.text),
            "kind": label.kind,
            "frame": self.number[frame],
            "pair": pair,
            "at": rounded(at),
        }


def moved(shape: Shape, X: Array) -> Array:
    """Vertices of a shape in a frame ``(3, 4)``."""
    return np.asarray(shape.vertices @ X[:, :3].T + X[:, 3])


def triangles(shape: Shape) -> list[int]:
    """The polygons of a shape, all convex, as triangles."""
    return [int(i) for face in shape.faces for k in range(1, len(face) - 1) for i in (face[0], face[k], face[k + 1])]


def segments(shape: Shape) -> list[int]:
    """Its lines, and the edges of its rims, as segments."""
    rims = [(*face, face[0]) for face in shape.faces[: shape.rims]]
    return [int(i) for line in (*shape.lines, *rims) for k in range(len(line) - 1) for i in line[k : k + 2]]
