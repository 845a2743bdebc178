"""What falls away of a mechanism in its reduced form: rods, and spheres that close loops (see ``closure.reduction``)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mechgraph.algebra.se3 import Array, cross
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import System
from mechgraph.graph.linkgraph import components_of_edges
from mechgraph.pairs.factors import ConstantScrew
from mechgraph.pairs.pair_type import PairType

ON_LINE = 1e-12
"""Sine of the angle between a slide and the line of its rod up to which they are one: rounding."""


def slides_of_sphere(row: PairType) -> Array | None:
    """Directions ``(3, k)`` in marker A along which a sphere slides, where slides and a rotation are all that a pair has; else None."""
    if not row.steps or not row.steps[-1].holds_rotation:
        return None
    slides = row.steps[:-1]
    if any(not isinstance(step, ConstantScrew) or step.freedom.turns for step in slides):
        return None
    along = np.array([step.freedoms[0].twist[3:] for step in slides]).reshape(-1, 3).T
    return along if np.abs(along.T @ along - np.eye(len(slides))).max(initial=0.0) < 1e-12 else None


class Rod(NamedTuple):
    """A link, or two that slide along their line by the pair ``slide``, between the balls ``first`` (on the first link) and ``second``."""

    links: tuple[int, ...]
    first: int
    second: int
    slide: int = -1


@dataclass(frozen=True)
class Plan:
    """What falls away: ``rods``, further ``pairs``; links ``afloat`` get a floating pair."""

    rods: tuple[Rod, ...]
    pairs: tuple[int, ...]
    afloat: tuple[int, ...]


def plan_of(start: Configuration, kept: set[int]) -> Plan:
    """What falls away of a mechanism where the pairs ``kept`` stay: drivers, couplings.

    Pairs that no loop holds stay; of spheres that do not slide those that join what else would float.
    """
    system = start.system
    ends, frame = system.graph.ends, system.graph.frame
    slides = {
        k: along
        for k in sorted({*system.graph.loop_steps[1].tolist()} - kept)
        if (along := slides_of_sphere(system.m.pairs[k].type)) is not None
    }
    balls = {k for k, along in slides.items() if not along.size}
    rods = _rods(start, balls)
    away = [k for k, along in slides.items() if along.size]
    part = components_of_edges(len(system.m.links), [pair for k, pair in enumerate(ends) if k not in slides])
    for k in sorted(balls.difference(k for rod in rods for k in (rod.first, rod.second))):
        a, b = part[list(ends[k])]
        if a == b:
            away.append(k)
        part[part == b] = a
    part[[link for rod in rods for link in rod.links]] = part[frame]
    afloat = np.unique(part, return_index=True)[1]
    return Plan(tuple(rods), tuple(sorted(away)), tuple(i for i in sorted(afloat.tolist()) if part[i] != part[frame]))


def _rods(start: Configuration, balls: set[int]) -> list[Rod]:
    """Links, or two on a slide, with two of the pairs ``balls`` and no other; a rod ends on links that stay, and not twice on one."""
    system = start.system
    ends, frame = system.graph.ends, system.graph.frame
    at: list[list[int]] = [[] for _ in system.m.links]
    for k, pair in enumerate(ends):
        for link in pair:
            at[link].append(k)
    parts: list[tuple[tuple[int, ...], int]] = [((link,), -1) for link, mine in enumerate(at) if balls.issuperset(mine)]
    parts += [
        (pair, k)
        for k, pair in enumerate(ends)
        if _is_slide(system.m.pairs[k].type) and min(map(len, (at[i] for i in pair))) > 1
    ]
    rods: list[Rod] = []
    free = set(balls)
    for links, slide in parts:
        mine = [k for link in links for k in at[link] if k != slide]
        if frame not in links and len(mine) == 2 and free.issuperset(mine):
            rod = Rod(links, mine[0], mine[1], slide)
            outer = [sum(ends[k]) - link for k, link in zip(mine, (links[0], links[-1]), strict=True)]
            if outer[0] != outer[1] and not {*outer} & {*links} and (slide < 0 or _on_line(start, rod)):
                rods.append(rod)
                free.difference_update(mine)
    return rods


def _is_slide(row: PairType) -> bool:
    return len(row.steps) == 1 and isinstance(row.steps[0], ConstantScrew) and not row.steps[0].freedom.turns


def _on_line(start: Configuration, rod: Rod) -> bool:
    """Whether both links slide along the line of the balls."""
    d = start.pair_points[:, rod.second, 0] - start.pair_points[:, rod.first, 0]
    along = start.S[3:, start.system.first_column[rod.slide], 0]
    return bool(np.abs(cross(d, along)).max() < ON_LINE * np.sqrt(d @ d))


def may_have_rods(system: System) -> bool:
    """Whether a link has two pairs that are spheres, and no other pair, or one and a slide."""
    ball, slide = (
        np.array([is_one(row) for row in system.types], dtype=bool)[system.type_of]
        for is_one in (lambda row: row.f == 3 and row.steps[0].holds_rotation, _is_slide)
    )
    ends = np.concatenate([system.a, system.b])
    balls, slides = (np.bincount(ends, np.tile(some, 2)) for some in (ball, slide))
    return bool(((np.bincount(ends) == 2) & (balls >= 1) & (balls + slides == 2)).any())
