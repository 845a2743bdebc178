"""What a picture of a mechanism shows, as plain arrays, for any painter: bodies in moving frames, labels, arrows.

``Scene.frames`` holds affine maps ``(T, 3, 4)``, ``x -> A x + p``, one for every drawn position; every ``Part`` is a rigid set of
vertices in one of them, with polygons and polylines by index (see ``shapes.Shape``). A frame need not be rigid: a spring is a coil of
length one in a frame whose z is the line between its ends, an arrow of length one stands in a frame whose z is the force. NaN in a frame:
nothing is to be drawn at that position.

Frames are called ``"link:crank"``, ``"pair:A@0"`` (marker on link a), ``"pair:A@1"`` (after one freedom; the last is the marker on link
b), ``"load:0"``, ``"load:0:force"``, ``"load:0:moment"``, ``"reaction:A"``, and ``""`` for the global one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import assembled
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import System
from mechgraph.errors import DeclarationError
from mechgraph.force.applied_loads import user_poses
from mechgraph.model.mechanism import Mechanism
from mechgraph.result.solution import Solution
from mechgraph.show import acting, bodies
from mechgraph.show.stage import Label, Part, Place, Stage

__all__ = ["Label", "Part", "Place", "Scene", "place_of_states", "scene", "scene_at"]


@dataclass(frozen=True)
class Scene:
    """A mechanism as it is drawn at ``T`` positions.

    Attributes
    ----------
    mechanism : what is drawn.
    positions : flat indices of the drawn positions in the solution: those that were solved.
    frames : name -> affine maps ``(T, 3, 4)``.
    parts, labels : what is drawn.
    points : pair points ``points[pair, link]``, ``(T, 3)``.
    everything : these, mass centres and points of interest, ``(n, 3)``.
    size, symbol : extent of the mechanism over all positions, and half width of its largest symbols.
    normal : of a mechanism all of whose points lie in a plane, else None.
    upright : axes of what stands upright, as columns: two level ones, and up.
    gravity : the vector g, None where there is none.
    cases : number of the case to which every drawn position belongs; within one they follow each other.
    not_unique : pairs whose reaction force has no value somewhere, as it is not unique.
    reaction_scale : length of an arrow for a unit of force.
    """

    mechanism: Mechanism
    positions: Any
    frames: Mapping[str, Array]
    parts: tuple[Part, ...]
    labels: tuple[Label, ...]
    points: Mapping[tuple[str, str], Array]
    everything: Array
    size: float
    symbol: float
    normal: Array | None
    upright: Array
    gravity: Array | None
    cases: Any
    not_unique: tuple[str, ...] = ()
    reaction_scale: float = 0.0

    def vertices(self, part: Part, t: int) -> Array:
        """Vertices of a part in the global frame at a position, ``(n, 3)``."""
        X = self.frames[part.frame][t]
        return np.asarray(part.shape.vertices @ X[:, :3].T + X[:, 3])

    def all_vertices(self, t: int) -> Array:
        """Everything that is drawn at a position with all other places of points, ``(n, 3)``."""
        every = np.concatenate([*(self.vertices(part, t) for part in self.parts), self.everything])
        return np.asarray(every[np.isfinite(every).all(axis=1)])

    def place(self, label: Label, t: int) -> Array:
        """The point of a label in the global frame, ``(3,)``."""
        X = self.frames[label.frame][t]
        return np.asarray(X[:, :3] @ label.at + X[:, 3])


def scene(drawn: Solution | Mechanism, *, forces: bool = False) -> Scene:
    """The scene of a solution at its solved positions, or of a mechanism where its loops are closed.

    ``forces`` adds the reaction forces of the pairs (on link b, at its marker) as arrows, where the solution has forces.

    Raises
    ------
    DeclarationError
        where no position was solved; AssemblyError where a mechanism cannot be closed.
    """
    if isinstance(drawn, Mechanism):
        system, x = assembled(drawn)
        return scene_at(drawn, place_of_states(system, x[:, None]), np.zeros(1, dtype=np.intp))
    good, place = place_of(drawn)
    return scene_at(drawn.mechanism, place, good, drawn, forces=forces)


def place_of(s: Solution) -> tuple[Any, Place]:
    """Flat indices of the solved positions of a solution, and where its mechanism stands there."""
    m = s.mechanism
    good = np.flatnonzero(np.asarray(s.status).reshape(-1) == "ok")
    if not good.size:
        raise DeclarationError(f"picture of {m.name!r}", ["the solution has no solved position"])
    return good, Place(
        {name: s.link(name).pose.reshape(-1, 4, 4)[good] for name in m.link_names()},
        {p.name: s[p.name].position.reshape(-1, p.type.f)[good].T for p in m.pairs},
    )


def place_of_states(system: System, x: Array) -> Place:
    """Where the mechanism of a system stands at closed states ``x (nx, T)``."""
    m = system.m
    poses, q = user_poses(Configuration(system, x)), system.coordinates_of(x, system.start_coordinates(m.start))
    columns = (slice(int(i), int(i) + p.type.f) for i, p in zip(system.first_column, m.pairs, strict=False))
    return Place(
        dict(zip(m.link_names(), poses, strict=True)), {p.name: q[c] for p, c in zip(m.pairs, columns, strict=True)}
    )


def scene_at(
    m: Mechanism, place: Place, positions: Any, solution: Solution | None = None, *, forces: bool = False
) -> Scene:
    """The scene of a mechanism that stands somewhere; a ``solution`` gives values to loads that vary, and to reactions."""
    stage = Stage(m, place, len(positions))
    parts = [*bodies.links(stage), *bodies.pairs(stage), *acting.loads(stage, solution, positions)]
    cases = np.asarray(positions) // (
        solution.batch[-1] if solution is not None and solution.batch else 1 + len(positions)
    )
    lost: tuple[str, ...] = ()
    scale = 0.0
    if forces and solution is not None and solution.has_forces:
        arrows, lost, scale = acting.reactions(stage, solution, positions)
        parts += arrows
    return Scene(
        m, positions, stage.frames, tuple(parts), tuple(bodies.labels(stage)), stage.points, stage.everything, stage.size,
        stage.symbol, stage.normal, stage.upright, stage.gravity, cases, lost, scale,
    )  # fmt: skip
