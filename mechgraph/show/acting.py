"""Parts of a drawing that show what acts: springs and other laws, given forces, moments and efforts, reactions of the pairs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.model.force_law import Law
from mechgraph.model.load import Effort, Wrench
from mechgraph.model.pair import Pair
from mechgraph.result.solution import Solution
from mechgraph.show import shapes
from mechgraph.show.shapes import Shape, frame_along
from mechgraph.show.stage import FLAT_THICKNESS, Part, Stage

LONGEST_ARROW = 0.2
"""Length of the longest force arrow over the extent."""
SHORTEST_ARROW = 0.25
"""Length of the shortest arrow of a load over the longest: direction matters more than size there."""
NOTHING = 1e-9
"""Force over the largest below which no arrow is drawn."""

LAW_SHAPES: dict[str, tuple[Shape, Shape]] = {
    "spring": (shapes.coil(), shapes.spiral()),
    "torsion_spring": (shapes.coil(), shapes.spiral()),
    "damper": (shapes.dashpot(), shapes.turn_arrow()),
    "force_law": (shapes.ram(), shapes.spiral()),
}
"""Shapes of laws by their kind: between points or along a slide, and about a turn."""


class Acting(NamedTuple):
    """A force at a point or a moment, ``(T, 3)`` each."""

    load: int
    turns: bool
    at: Array
    vector: Array


def loads(stage: Stage, solution: Solution | None, positions: Any) -> Iterator[Part]:
    """Laws between points or in freedoms; given forces, moments and efforts as arrows, the tip of a force where it acts."""
    acting: list[Acting] = []
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
        share = np.where(share > NOTHING, np.maximum(share, SHORTEST_ARROW), np.nan)
        frame = f"load:{one.load}:{'moment' if one.turns else 'force'}"
        if one.turns:
            length = width = 2.5 * stage.symbol * share
            at = one.at
        else:
            length, width = LONGEST_ARROW * stage.size * share, np.full(stage.count, 0.42 * stage.symbol)
            at = one.at - frame_along(one.vector)[..., 2] * length[:, None]
        stage.frames[frame] = stretched(one.vector, at, length, width)
        yield Part("load", f"loads[{one.load}]", "", frame, shapes.turn_arrow() if one.turns else shapes.arrow())


def stretched(along: Array, at: Array, length: Array, width: Array) -> Array:
    """Frames ``(T, 3, 4)`` at points, z along a vector and of some length, x and y of some width."""
    scale = np.stack([width, width, length], axis=1)
    return np.concatenate([frame_along(along) * scale[:, None], at[:, :, None]], axis=2)


def _wrench(stage: Stage, i: int, load: Wrench, solution: Solution | None, positions: Any) -> Iterator[Acting]:
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
        yield Acting(i, False, at, force)
    if load.moment is not None:
        yield Acting(i, True, at, moment)


def _effort(stage: Stage, i: int, load: Effort, solution: Solution | None, positions: Any) -> Acting:
    pair, j, line, frame = stage.freedom(load.freedom)
    X, couple = stage.frames[frame], pair.type.efforts[j].is_couple
    if solution is None:
        value = np.full(stage.count, _constant(load.value, 1)[0])
    else:
        value = solution.load(i).force.reshape(-1)[positions]
    at = X[:, :, :3] @ line.point + X[:, :, 3] if line.turns else stage.points[pair.name, pair.b]
    return Acting(i, couple, at, (X[:, :, :3] @ line.direction) * value[:, None])


def _constant(value: Any, n: int = 3) -> Array:
    """A constant load; NaN where it varies, which nobody knows without a solution."""
    try:
        return np.asarray(value, dtype=float).reshape(n)
    except (TypeError, ValueError):
        return np.full(n, np.nan)


def _law(stage: Stage, i: int, load: Law) -> Part:
    """A law between two points, or in a freedom: wound about its axis, or along its slide from the end of the guide."""
    name, frame = f"loads[{i}]", f"load:{i}"
    straight, turning = LAW_SHAPES[load.kind]
    if load.in_freedom is None:
        begin, end = stage.on(load.a, load.p), stage.on(load.b, load.q)
    else:
        pair, j, line, own = stage.freedom(load.in_freedom)
        size, X = stage.symbol_size(pair), stage.frames[own]
        if line.turns:
            return Part("spring", name, "", own, turning.moved(1.7 * size * frame_along(line.direction), line.point))
        low = float(stage.place.coordinates[pair.name][j].min(initial=0.0)) - 4.5 * size
        begin, end = X[:, :, :3] @ (low * line.direction) + X[:, :, 3], stage.points[pair.name, pair.b]
    width = np.full(stage.count, 0.75 * stage.symbol)
    stage.frames[frame] = stretched(end - begin, begin, np.linalg.norm(end - begin, axis=1), width)
    return Part("spring", name, "", frame, straight)


def reactions(stage: Stage, solution: Solution, positions: Any) -> tuple[list[Part], tuple[str, ...], float]:
    """Reaction forces on links b as arrows at their markers, pairs whose force is not unique, and the length of a unit of force."""
    values = {p.name: known_force(stage, solution, p, positions, stage.normal) for p in stage.m.pairs}
    lost = tuple(name for name, force in values.items() if np.isnan(force).any())
    longest = max((float(np.nanmax(np.linalg.norm(v, axis=1), initial=0.0)) for v in values.values()), default=0.0)
    scale = LONGEST_ARROW * stage.size / longest if longest else 0.0
    out = []
    for pair in stage.m.pairs:
        force = values[pair.name]
        length = np.linalg.norm(force, axis=1) * scale
        length = np.where(length > FLAT_THICKNESS * stage.size, length, np.nan)
        at = stage.points[pair.name, pair.b]
        width = np.minimum(0.36 * stage.symbol, 0.2 * length)
        stage.frames[f"reaction:{pair.name}"] = stretched(np.nan_to_num(force), at, length, width)
        out.append(Part("reaction", pair.name, pair.b, f"reaction:{pair.name}", shapes.arrow()))
    return out, lost, scale


def known_force(stage: Stage, solution: Solution, pair: Pair, positions: Any, along: Array | None) -> Array:
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
