"""What is shown of a mechanism: its bodies, paths, stage, and the forces that act, at every position."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import scipy

from mechgraph.document import plain
from mechgraph.errors import DeclarationError
from mechgraph.force.friction import Came
from mechgraph.kinematics.assembly import assembled
from mechgraph.kinematics.state import Configuration, user_poses
from mechgraph.kinematics.system import System
from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.model.friction import Friction
from mechgraph.model.gear_facts import without_play
from mechgraph.model.loads import Effort, Law, Wrench
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.pairs.cams import Groove
from mechgraph.pairs.contact_types import is_open, takes_curves
from mechgraph.pairs.curves import Travel, outside
from mechgraph.pairs.travelling import Beside
from mechgraph.result.solution import Solution
from mechgraph.result.values import OK
from mechgraph.result.views import BeltResult
from mechgraph.show import shapes
from mechgraph.show.shapes import FreedomLine, Shape, frame_along, lines_of, symbol
from mechgraph.show.stage import (
    FLAT_THICKNESS,
    DrawnPart,
    DrawnPlace,
    DrawnPose,
    Label,
    Role,
    distinct,
    is_groove,
    is_profile,
    slide_of,
    stretched,
)
from mechgraph.show.wheels import READABLE, DrawnBelt, belt_path

__all__ = ["Label", "DrawnPart", "DrawnPlace", "Scene", "place_of_states", "scene", "scene_at"]


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
    everything : these, mass centers and points of interest, ``(n, 3)``.
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
    parts: tuple[DrawnPart, ...]
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

    def vertices(self, part: DrawnPart, t: int) -> Array:
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


def scene(drawn: Solution | Mechanism, *, forces: bool = False, centers: bool = True) -> Scene:
    """The scene of a solution at its solved positions, or of a mechanism where its loops are closed.

    ``forces`` adds the reaction forces of the pairs (on link b, at its marker) as arrows, where the solution has forces; ``centers`` are
    the mass centers.

    Raises
    ------
    DeclarationError
        where no position was solved; AssemblyError where a mechanism cannot be closed.
    """
    if isinstance(drawn, Mechanism):
        system, x = assembled(drawn)
        found = scene_at(drawn, place_of_states(system, x[:, None]), np.zeros(1, dtype=np.intp))
    else:
        good, place = place_of(drawn, [came.status for came in Came if came is not Came.LIFTS_OFF])
        found = scene_at(drawn.mechanism, place, good, drawn, forces=forces)
    shown = found.parts if centers else tuple(part for part in found.parts if part.role not in ("center", "tie"))
    return replace(found, parts=shown)


def place_of(s: Solution, outcomes: Sequence[str] = (OK,)) -> tuple[Any, DrawnPlace]:
    """Flat indices of the positions of a solution with these outcomes, the solved ones, and where its mechanism stands there."""
    m = s.mechanism
    good = np.flatnonzero(np.isin(np.asarray(s.status).reshape(-1), outcomes))
    if not good.size:
        raise DeclarationError(f"picture of {m.name!r}", ["the solution has no solved position"])
    return good, DrawnPlace(
        {name: s.link(name).pose.reshape(-1, 4, 4)[good] for name in m.link_names()},
        {p.name: s[p.name].position.reshape(np.size(s.status), p.type.f)[good].T for p in m.pairs},
    )


def place_of_states(system: System, x: Array) -> DrawnPlace:
    """Where the mechanism of a system stands at closed states ``x (nx, T)``."""
    m = system.m
    poses, q = user_poses(Configuration(system, x)), system.coordinates_of(x, system.start_coordinates(m.start))
    columns = (slice(int(i), int(i) + p.type.f) for i, p in zip(system.first_column, m.pairs, strict=False))
    return DrawnPlace(
        dict(zip(m.link_names(), poses, strict=True)), {p.name: q[c] for p, c in zip(m.pairs, columns, strict=True)}
    )


def scene_at(
    m: Mechanism, place: DrawnPlace, positions: Any, solution: Solution | None = None, *, forces: bool = False
) -> Scene:
    """The scene of a mechanism that stands somewhere; a ``solution`` gives values to loads that vary, and to reactions."""
    stage = DrawnPose(without_play(m), place, len(positions))
    parts = [
        *gearing(stage, solution, positions),
        *cams(stage),
        *links(stage),
        *pairs(stage),
        *loads(stage, solution, positions),
    ]
    cases = np.asarray(positions) // (
        solution.batch[-1] if solution is not None and solution.batch else 1 + len(positions)
    )
    lost: tuple[str, ...] = ()
    scale = 0.0
    if forces and solution is not None and solution.has_forces:
        arrows, lost, scale = reactions(stage, solution, positions)
        parts += arrows
    return Scene(
        m, positions, stage.frames, tuple(parts), tuple(labels(stage)), stage.points, stage.everything, stage.size,
        stage.symbol, stage.normal, stage.upright, stage.gravity, cases, lost, scale,
    )  # fmt: skip


def gearing(stage: DrawnPose, solution: Solution | None, positions: Any) -> Iterator[DrawnPart]:
    """Gears with teeth where these can be seen, plain else, with pitch circles; pulleys, and belts as thick as their tension asks."""
    flat = stage.normal is not None
    for wheel in stage.wheels:
        frame, often = f"link:{wheel.link}", (0.0, np.inf)
        if wheel.teeth:
            often = (0.0, READABLE / (np.pi * wheel.module))
            yield DrawnPart("wheel", wheel.name, wheel.link, frame, wheel.toothed(flat), scales=(often[1], np.inf))
        yield DrawnPart("wheel", wheel.name, wheel.link, frame, wheel.plain(flat), scales=often)
        if wheel.teeth and not wheel.is_worm:
            yield DrawnPart("axis", wheel.name, wheel.link, frame, wheel.pitch_line(flat))
        if not wheel.is_rack:
            yield DrawnPart("wheel", wheel.name, wheel.link, frame, wheel.mark(flat))
    for belt in stage.belts:
        own = [stage.wheels[i] for i in belt.over]
        centers = np.stack([stage.on(w.link, w.at).T for w in own], axis=1)
        axis = (stage.place.poses[own[0].link][:, :3, :3] @ own[0].axes[:, 2]).T
        path, span = belt_path(centers, axis, np.array([w.radius for w in own]) * belt.senses)
        along = np.roll(path, -1, axis=1) - path
        pull = _tensions(belt, along[:, span % 1 == 0], solution, positions)
        most = float(np.max(np.nan_to_num(pull), initial=0.0)) or 1.0
        for i, k in enumerate(span):
            # half the width of a belt over a symbol: slack, and with the greatest tension
            tension = (1.0 - k % 1.0) * pull[:, int(np.floor(k))] + k % 1.0 * pull[:, int(np.ceil(k))]
            width = stage.symbol * (0.07 + 0.13 * np.where(np.isnan(tension), 0.4, tension / most))
            frame = f"belt:{belt.name}:{i}"
            stage.frames[frame] = stretched(along[:, i], path[:, i], np.linalg.norm(along[:, i], axis=1), width)
            yield DrawnPart("strand", belt.name, "", frame, shapes.prism(6, 1.0, 0.0, 1.0))


def _tensions(belt: DrawnBelt, along: Array, solution: Solution | None, positions: Any) -> Array:
    """Tensions ``(T, spans)`` of a belt whose spans run ``along (T, spans, 3)``, NaN where they are not known.

    Where the tight one of two spans bears all: the one that comes to the second pulley pulls it back, the one that leaves it draws it on.
    """
    if solution is None or not solution.has_forces:
        return np.full(along.shape[:2], np.nan)
    found = solution.coupling(belt.name)
    if isinstance(found, BeltResult):
        tension = np.stack([found.tension[name].reshape(-1)[positions] for name in belt.spans], axis=1)
        return np.maximum(tension, 0.0)
    force = found.force.reshape(-1, 3)[positions]
    ways = along / np.linalg.norm(along, axis=2, keepdims=True) * np.array([-1.0, 1.0])[:, None]
    share = (ways * force[:, None]).sum(axis=2)
    return np.asarray(np.where(share == share.max(axis=1, keepdims=True), np.linalg.norm(force, axis=1)[:, None], 0.0))


def cams(stage: DrawnPose) -> Iterator[DrawnPart]:
    """Profiles, filled where they are closed, the walls of slots, and the rollers and balls that run there and on surfaces."""
    flat = stage.normal is not None
    half = 0.0 if flat else 0.5 * stage.symbol
    for pair in stage.m.pairs:
        for step in takes_curves(pair.type):
            link, curve = pair.b if step.back else pair.a, step.curve
            wide = 0.0 if is_open(pair) else pair.radius_b or 0.0
            if curve is None or not (is_open(pair) or wide):
                continue
            curve = curve.base if isinstance(curve, Beside) else curve
            travel = curve.once(Travel)
            here = travel.at(_covered(stage, pair, link, travel))
            if wide and travel.is_plane and not curve.is_closed:
                yield DrawnPart("wheel", pair.name, link, f"link:{link}", _slot(here.x.T, here.y.T, wide))
            elif isinstance(curve, Groove):
                skin = shapes.grooved(here.x.T, here.y.T, np.asarray(curve.center, dtype=float), curve.normal, wide)
                for role, shape in zip(ON_GROOVED, skin, strict=True):
                    yield DrawnPart(role, pair.name, link, f"link:{link}", shape)
            elif wide:
                # a groove in space that holds a ball is round
                walls = (
                    [shapes.polyline((here.x + side * here.y).T) for side in (-wide, wide)] if travel.is_plane else []
                )
                yield from (DrawnPart("wheel", pair.name, link, f"link:{link}", wall) for wall in walls)
            else:
                x = (here.x - (outside(curve) * curve.roller * here.y if curve.roller else 0.0)).T
                filled = is_profile(pair, step)
                shape = shapes.slab(x[:-1], travel.guide, half) if filled else shapes.polyline(x)
                yield DrawnPart("wheel" if filled else "face", pair.name, link, f"link:{link}", shape)
        if radius := pair.radius_b:
            turning = [j for j, line in enumerate(lines_of(pair.type, pair.pitch_per_radian)) if line.turns]
            if pair.type.component_names == ("Fy",):
                shape = shapes.prism(32, radius, 0.0, radius)  # what stands out of its groove
            elif len(turning) == 1:
                axis = lines_of(pair.type, pair.pitch_per_radian)[turning[0]].direction
                shape = shapes.prism(48, radius, -0.15 * stage.symbol, 0.15 * stage.symbol).along(axis)
            else:
                shape = shapes.ball(radius)
            yield DrawnPart("roller", pair.name, "", f"pair:{pair.name}@{pair.type.f}", shape)


ON_GROOVED: tuple[Role, Role] = ("wheel", "dark")
"""The roles of a body with a groove around it, and of this."""


def _covered(stage: DrawnPose, pair: Pair, link: str, travel: Travel) -> Array:
    """Arc lengths over a curve; of an endless line over what is touched, and some more."""
    if np.isfinite(travel.begin):
        return np.linspace(travel.begin, travel.end, 181)
    X, touched = stage.place.poses[link], stage.frames[f"pair:{pair.name}@1"][:, :, 3]
    here = travel.at(np.zeros(1))
    s = (((touched - X[:, :3, 3])[:, None] @ X[:, :3, :3])[:, 0] - here.x[:, 0]) @ here.t[:, 0]
    return np.array([s.min() - 2.0 * stage.symbol, s.max() + 2.0 * stage.symbol])


def _slot(x: Array, y: Array, wide: float) -> Shape:
    """The walls of a slot along points ``x (n, 3)`` with normals ``y``, round at its ends."""
    turn = np.linspace(0.0, np.pi, 9)[1:-1, None]
    ends = [
        x[i] + wide * (s * np.cos(turn) * y[i] + np.sin(turn) * out / np.linalg.norm(out))
        for i, s, out in ((-1, 1.0, x[-1] - x[-2]), (0, -1.0, x[0] - x[1]))
    ]
    return shapes.polyline(np.concatenate([x + wide * y, ends[0], (x - wide * y)[::-1], ends[1], (x + wide * y)[:1]]))


def links(stage: DrawnPose) -> Iterator[DrawnPart]:
    """Links as what they join: a rod between two points, a plate or a body between more; mass centers and points of interest."""
    for link in stage.m.links:
        frame, moving = f"link:{link.name}", link.name != stage.m.frame
        corners = [*stage.corners(link.name), *(np.asarray(p, dtype=float) for p in link.points.values())]
        if moving:
            yield from _body(stage, link.name, corners)
        else:
            yield from _feet(stage)
        for name, p in link.points.items():
            yield DrawnPart("point", f"{link.name}.{name}", link.name, frame, Shape(np.array([p], dtype=float)))
        if link.mass > 0 and moving:
            center = np.asarray(link.center, dtype=float)
            middle = np.mean(corners, axis=0) if corners else center
            yield DrawnPart("tie", link.name, link.name, frame, shapes.polyline([middle, center]))
            yield DrawnPart("center", link.name, link.name, frame, Shape(center[None]))


def _body(stage: DrawnPose, link: str, corners: list[Array]) -> Iterator[DrawnPart]:
    frame, near = f"link:{link}", FLAT_THICKNESS * stage.size
    points = distinct(corners, near)
    if len(points) == 1 and stage.m.link(link).mass > 0:
        points = distinct([*points, np.asarray(stage.m.link(link).center, dtype=float)], near)
    if len(points) < 2:
        return
    faces, edges = hull(points)
    if faces:
        yield DrawnPart("plate", link, link, frame, Shape(points, faces))
    # radii of rods, and of the edges of plates, over the size of a symbol
    radius = (0.2 if faces else 0.3) * stage.symbol
    yield DrawnPart("link", link, link, frame, shapes.together([rod(points[i], points[j], radius) for i, j in edges]))


def _feet(stage: DrawnPose) -> Iterator[DrawnPart]:
    """A hatched foot under every pair point of the frame; in a plane hatched ground along its guides, and around its rings."""
    name = stage.m.frame
    X = stage.frames[f"link:{name}"][0]
    foot = shapes.foot().moved(1.8 * stage.symbol * X[:, :3].T @ stage.upright)
    for at in distinct(stage.corners(name), FLAT_THICKNESS * stage.size):
        yield DrawnPart("foot", name, "", f"link:{name}", foot.moved(np.eye(3), at))
    for wheel in stage.wheels if stage.normal is not None else ():
        if wheel.link == name and wheel.internal:
            turn = np.deg2rad(np.linspace(240.0, 300.0, 13))
            out = stage.upright[:, [0]] * np.cos(turn) + stage.upright[:, [2]] * np.sin(turn)
            away = out.T @ X[:, :3]
            yield DrawnPart(
                "foot",
                wheel.name,
                "",
                f"link:{name}",
                shapes.hatching(wheel.at + wheel.outer * away, away, 0.8 * stage.symbol),
            )


def rod(p: Array, q: Array, radius: float) -> Shape:
    """A thin round rod between two points, in pieces so that it can be sorted by depth; its one line is its middle line."""
    length = float(np.linalg.norm(q - p))
    solid = shapes.prism(6, radius, 0.0, length, int(np.clip(length / (12 * radius), 1, 12))).along(q - p, p)
    return shapes.together([replace(solid, lines=(), rims=0), shapes.polyline([p, q])])


def hull(points: Array) -> tuple[tuple[tuple[int, ...], ...], tuple[tuple[int, int], ...]]:
    """Faces and edges of the convex hull of points: none and a line, a flat plate, or a body."""
    middle = points - points.mean(axis=0)
    _, spread, Vt = np.linalg.svd(middle, full_matrices=False)
    if len(points) == 2 or spread[1] <= FLAT_THICKNESS * spread[0]:
        order = np.argsort(middle @ Vt[0]).tolist()
        return (), tuple(pairwise(order))
    if len(points) == 3 or spread[2] <= FLAT_THICKNESS * spread[0]:
        corners = [int(i) for i in scipy.spatial.ConvexHull(middle @ Vt[:2].T).vertices]
        return (tuple(corners),), tuple(pairwise([*corners, corners[0]]))
    solid = scipy.spatial.ConvexHull(points)
    edges: dict[tuple[int, int], list[int]] = {}
    for k, face in enumerate(solid.simplices.tolist()):
        for i, j in pairwise([*face, face[0]]):
            edges.setdefault((min(i, j), max(i, j)), []).append(k)
    normals = solid.equations[:, :3]
    sharp = tuple(edge for edge, (k, m) in edges.items() if normals[k] @ normals[m] < 1 - FLAT_THICKNESS)
    return tuple(tuple(face) for face in solid.simplices.tolist()), sharp


def pairs(stage: DrawnPose) -> Iterator[DrawnPart]:
    """Symbols of the pairs with their axes, and arrows at the driven freedoms."""
    driven = {stage.m.full_name(d.freedom) for d in stage.m.drives}
    for pair in stage.m.pairs:
        size, lines = stage.symbol_size(pair), lines_of(pair.type, pair.pitch_per_radian)
        if stage.grounded(pair):
            yield _ground(stage, pair, lines, size)
        moved = stage.piston(pair) * slide_of(pair)
        apart = 3.0 * size if sum(name in driven for name in pair.freedom_names) > 2 else 0.0
        curves = takes_curves(pair.type)
        touches = len(curves) > 1 or any(map(is_groove, curves))  # bodies, which are drawn themselves
        for e in symbol(pair.type, pair.pitch_per_radian, size, _strokes(stage, pair, lines, size)):
            if touches and e.role != "body":
                continue
            link = pair.a if e.role == "guide" else ""
            shape = e.shape.moved(np.eye(3), moved) if e.frame == pair.type.f else e.shape
            yield DrawnPart(e.role, pair.name, link, f"pair:{pair.name}@{e.frame}", shape, e.dashed)
        for name, line, single in zip(pair.freedom_names, lines, pair.type.drivable, strict=True):
            frame = f"pair:{pair.name}@{line.frame}"
            if line.turns and single:
                reach = 2.6 * size * line.direction
                yield DrawnPart("axis", pair.name, "", frame, shapes.polyline([line.point - reach, line.point + reach]))
            if name in driven:
                arrow = freedom_arrow(line, 1.75 * size, apart).moved(np.eye(3), moved / 2)
                yield DrawnPart("drive", name, "", frame, arrow)


def _ground(stage: DrawnPose, pair: Pair, lines: list[FreedomLine], size: float) -> DrawnPart:
    """Hatched ground along the lower side of a guide, the left one of an upright guide."""
    j = next(j for j, line in enumerate(lines) if not line.turns)
    X, u = stage.frames[f"pair:{pair.name}@{lines[j].frame}"][0, :, :3], lines[j].direction
    assert stage.normal is not None
    side = np.cross(X @ u, stage.normal)
    side *= -np.sign(side @ stage.upright @ np.array([1e-3, 0.0, 1.0]))
    low, high = np.array(_strokes(stage, pair, lines, size)[j]) + np.array([-1.0, 1.0]) * shapes.PAD * size
    run = np.linspace(low, high, max(int((high - low) / (0.55 * size)), 3))[:, None] * u + shapes.GUIDE * size * (
        side @ X
    )
    away = np.broadcast_to(side @ X, run.shape)
    return DrawnPart(
        "foot", stage.m.frame, "", f"pair:{pair.name}@{lines[j].frame}", shapes.hatching(run, away, 0.6 * size)
    )


def _strokes(stage: DrawnPose, pair: Pair, lines: list[FreedomLine], size: float) -> list[tuple[float, float]]:
    """Least and greatest coordinates, zero among them.

    A guide on the line of which link a is held by another pair reaches to there: the barrel of a cylinder, from its eye to the piston.
    """
    q, moved = stage.place.coordinates[pair.name], stage.piston(pair)
    out = [(float(row.min(initial=0.0)), float(row.max(initial=0.0))) for row in q]
    if moved:
        out = [(float(row.min()) + moved, float(row.max()) + moved) for row in q]
    slides = [j for j, line in enumerate(lines) if not line.turns]
    if len(slides) != 1 or pair.a == stage.m.frame:
        return out
    X = pair.markers[0].pose()
    along, (low, high) = X[:, :3] @ lines[slides[0]].direction, out[slides[0]]
    for d in (p - X[:, 3] for p in stage.corners(pair.a)):
        if np.linalg.norm(np.cross(d, along)) < FLAT_THICKNESS * stage.size:
            low, high = min(low, float(d @ along) + 2.6 * size), max(high, float(d @ along) - 2.6 * size)
    out[slides[0]] = (low, high)
    return out


def freedom_arrow(line: FreedomLine, size: float, apart: float = 0.0) -> Shape:
    """An arrow about the line of a turn, or beside that of a slide; of many each on its own line, so far ``apart`` from the middle."""
    turn = frame_along(line.direction)
    if line.turns:
        return shapes.turn_arrow().moved((0.5 if apart else 1.0) * size * turn, line.point - apart * line.direction)
    lengthwise = turn @ np.diag([0.3 * size, 0.3 * size, 2.2 * size])
    begin = 0.5 * apart * line.direction if apart else size * (turn[:, 0] - line.direction)
    return shapes.arrow().moved(lengthwise, begin)


def labels(stage: DrawnPose) -> Iterator[Label]:
    """Names of pairs with their types, of points, and of moving links."""
    for pair in stage.m.pairs:
        text = plain(f"{pair.name} ({pair.type.symbol})")
        at = stage.piston(pair) * slide_of(pair)
        yield Label("pair", text, pair.name, "", f"pair:{pair.name}@{pair.type.f}", at)
    for link in stage.m.links:
        frame, corners = f"link:{link.name}", stage.corners(link.name)
        for name, p in link.points.items():
            text = f"{link.name}.{name}"
            yield Label("point", plain(text), text, link.name, frame, np.asarray(p, dtype=float))
        if link.name != stage.m.frame and corners:
            yield Label("link", plain(link.name), link.name, link.name, frame, np.mean(corners, axis=0))


LONGEST_ARROW = 0.2
"""Length of the longest force arrow over the extent."""

LAW_SHAPES: dict[str, tuple[Shape, Shape]] = {
    "spring": (shapes.coil(), shapes.spiral()),
    "torsion_spring": (shapes.coil(), shapes.spiral()),
    "damper": (shapes.dashpot(), shapes.turn_arrow()),
    "force_law": (shapes.ram(), shapes.spiral()),
}
"""Shapes of laws by their kind: between points or along a slide, and about a turn."""


class DrawnLoad(NamedTuple):
    """A force at a point or a moment, ``(T, 3)`` each."""

    load: int
    turns: bool
    at: Array
    vector: Array


def loads(stage: DrawnPose, solution: Solution | None, positions: Any) -> Iterator[DrawnPart]:
    """Laws between points or in freedoms; given forces, moments and efforts as arrows, the tip of a force where it acts."""
    acting: list[DrawnLoad] = []
    for i, load in enumerate(stage.m.loads):
        if isinstance(load, Law):
            yield _law(stage, i, load)
        elif isinstance(load, Wrench):
            acting += _wrench(stage, i, load, solution, positions)
        elif isinstance(load, Effort):
            acting.append(_effort(stage, i, load, solution, positions))
    for one in acting:
        kind = [np.linalg.norm(other.vector, axis=1) for other in acting if other.turns == one.turns]
        longest = max(float(np.nanmax(v, initial=0.0)) for v in kind) or 1.0
        share = np.linalg.norm(one.vector, axis=1) / longest
        # length of the shortest arrow of a load over the longest: direction matters more than size there
        # force over the largest below which no arrow is drawn
        share = np.where(share > 1e-9, np.maximum(share, 0.25), np.nan)
        frame = f"load:{one.load}:{'moment' if one.turns else 'force'}"
        if one.turns:
            length = width = 2.5 * stage.symbol * share
            at = one.at
        else:
            length, width = LONGEST_ARROW * stage.size * share, np.full(stage.count, 0.42 * stage.symbol)
            at = one.at - frame_along(one.vector)[..., 2] * length[:, None]
        stage.frames[frame] = stretched(one.vector, at, length, width)
        yield DrawnPart("load", f"loads[{one.load}]", "", frame, shapes.turn_arrow() if one.turns else shapes.arrow())


def _wrench(stage: DrawnPose, i: int, load: Wrench, solution: Solution | None, positions: Any) -> Iterator[DrawnLoad]:
    center = stage.m.link(load.link).center
    point = load.point if load.point is not None else center if center is not None else np.zeros(3)
    at = stage.on(load.link, point)
    if solution is None:
        R = stage.place.poses[load.link][:, :3, :3] if load.frame == "link" else np.broadcast_to(np.eye(3), (1, 3, 3))
        force, moment = (np.zeros((stage.count, 3)) + R @ _constant(v) for v in (load.force, load.moment))
    else:
        wrench = solution.load(i).wrenches[load.link].reshape(-1, 6)[positions]
        force, moment = wrench[:, 3:], wrench[:, :3] - np.cross(at, wrench[:, 3:])
    if load.force is not None:
        yield DrawnLoad(i, False, at, force)
    if load.moment is not None:
        yield DrawnLoad(i, True, at, moment)


def _effort(stage: DrawnPose, i: int, load: Effort, solution: Solution | None, positions: Any) -> DrawnLoad:
    pair, j, line, frame = stage.freedom(load.freedom)
    X, couple = stage.frames[frame], pair.type.efforts[j].is_couple
    if solution is None:
        value = np.full(stage.count, _constant(load.value, 1)[0])
    else:
        value = solution.load(i).force.reshape(-1)[positions]
    at = X[:, :, :3] @ line.point + X[:, :, 3] if line.turns else stage.points[pair.name, pair.b]
    return DrawnLoad(i, couple, at, (X[:, :, :3] @ line.direction) * value[:, None])


def _constant(value: Any, n: int = 3) -> Array:
    """A constant load; NaN where it varies, which nobody knows without a solution."""
    try:
        return np.asarray(value, dtype=float).reshape(n)
    except (TypeError, ValueError):
        return np.full(n, np.nan)


def _law(stage: DrawnPose, i: int, load: Law) -> DrawnPart:
    """A law between two points, or in a freedom: wound about its axis, or along its slide from the end of the guide."""
    name, frame = f"loads[{i}]", f"load:{i}"
    straight, turning = LAW_SHAPES[load.kind]
    if load.in_freedom is None:
        begin, end = stage.held(load)
    else:
        pair, j, line, own = stage.freedom(load.in_freedom)
        size, X = stage.symbol_size(pair), stage.frames[own]
        if line.turns:
            return DrawnPart(
                "spring", name, "", own, turning.moved(1.7 * size * frame_along(line.direction), line.point)
            )
        low = float(stage.place.coordinates[pair.name][j].min(initial=0.0)) - 4.5 * size
        begin, end = X[:, :, :3] @ (low * line.direction) + X[:, :, 3], stage.points[pair.name, pair.b]
    width = np.full(stage.count, 0.75 * stage.symbol)
    stage.frames[frame] = stretched(end - begin, begin, np.linalg.norm(end - begin, axis=1), width)
    return DrawnPart("spring", name, "", frame, straight)


def reactions(stage: DrawnPose, solution: Solution, positions: Any) -> tuple[list[DrawnPart], tuple[str, ...], float]:
    """Reaction forces on links b as arrows at their markers, pairs whose force is not unique, and the length of a unit of force."""
    values = {p.name: known_force(stage, solution, p, positions, stage.normal) for p in stage.m.pairs}
    solved = np.asarray(solution.status).reshape(-1)[positions] == OK
    lost = tuple(name for name, force in values.items() if np.isnan(force[solved]).any())
    longest = max((float(np.nanmax(np.linalg.norm(v, axis=1), initial=0.0)) for v in values.values()), default=0.0)
    scale = LONGEST_ARROW * stage.size / longest if longest else 0.0
    out: list[DrawnPart] = []
    rubbing = {load.of for load in stage.m.loads if isinstance(load, Friction)}
    for pair in stage.m.pairs:
        force = values[pair.name]
        length = np.linalg.norm(force, axis=1) * scale
        length = np.where(length > FLAT_THICKNESS * stage.size, length, np.nan)
        at = stage.points[pair.name, pair.b]
        if pair.name in rubbing:
            off, spin = _aside(stage, solution, pair, force, positions)
            out += _friction_circle(stage, pair.name, at, off, spin, force)
            at = at + np.nan_to_num(off)
        width = np.minimum(0.36 * stage.symbol, 0.2 * length)
        stage.frames[f"reaction:{pair.name}"] = stretched(np.nan_to_num(force), at, length, width)
        out.append(DrawnPart("reaction", pair.name, pair.b, f"reaction:{pair.name}", shapes.arrow()))
    return out, lost, scale


def _aside(stage: DrawnPose, solution: Solution, pair: Pair, force: Array, positions: Any) -> tuple[Array, Array]:
    """How far ``(T, 3)`` friction in the turns of a pair moves the line of its force aside, ``F x M / F^2``, and its couple M."""
    friction = solution[pair.name].friction.reshape(-1, pair.type.f)[positions]
    M = np.zeros_like(force)
    for j in (j for j, freedom in enumerate(pair.type.freedoms) if freedom.turns):
        _, _, line, frame = stage.freedom(pair.freedom_names[j])
        M += (stage.frames[frame][:, :, :3] @ line.direction) * friction[:, j, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.cross(force, M) / (force**2).sum(axis=1, keepdims=True), M


def _friction_circle(
    stage: DrawnPose, name: str, at: Array, off: Array, spin: Array, force: Array
) -> Iterator[DrawnPart]:
    """The circle to which the force of a pair with friction is tangent, and its line of action."""
    radius = np.linalg.norm(off, axis=1)
    radius = np.where(radius > 0, radius, np.nan)
    line = LONGEST_ARROW * stage.size * np.where(radius > 0, 1.0, np.nan)
    role: Role
    for role, what, along, middle, size, shape in (
        ("reaction", "circle", spin, at, radius, shapes.polyline(shapes.ring(1.0))),
        ("axis", "line", force, at + np.nan_to_num(off), line, shapes.polyline([(0, 0, -1), (0, 0, 1)])),
    ):
        stage.frames[f"friction {what}:{name}"] = stretched(np.nan_to_num(along), middle, size, size)
        yield DrawnPart(role, f"{name} friction {what}", "", f"friction {what}:{name}", shape)


def known_force(stage: DrawnPose, solution: Solution, pair: Pair, positions: Any, along: Array | None) -> Array:
    """Reaction force ``(T, 3)``, NaN where it is not unique (also where values of least norm stand for it).

    With a direction ``along (3,)`` or ``(T, 3)`` the part across it, which may be unique alone: in the plane of a plane mechanism, across
    the axis of a bearing.
    """
    result, row = solution[pair.name], pair.type
    unique = {name: np.asarray(flags).reshape(-1)[positions] for name, flags in result.unique.items()}
    force = result.force.reshape(-1, 3)[positions]
    parts = [part for part in row.reactions or () if not part.is_couple]
    if along is None or row.reactions is None:
        names = [part.name for part in parts] if row.reactions is not None else list(row.component_names)
        known = np.all([unique[name] for name in names], axis=0) if names else np.ones(len(force), dtype=bool)
        out = np.where(known[:, None], force, np.nan)
        return out if along is None else out - (out * along).sum(axis=1, keepdims=True) * along
    out = np.zeros_like(force)
    for part in parts:
        direction = stage.frames[f"pair:{pair.name}@{part.frame}"][:, :, :3] @ np.array(part.wrench[3:])
        across = direction - (direction * along).sum(axis=1, keepdims=True) * along
        value = np.where(unique[part.name], result.components[part.name].reshape(-1)[positions], np.nan)
        bears = np.linalg.norm(across, axis=1, keepdims=True) > FLAT_THICKNESS
        out = out + np.where(bears, across * value[:, None], 0.0)
    return out
