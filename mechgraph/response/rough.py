"""What rubs in a motion in time: freedoms that slip and stick together.

A pair rubs along sliding velocities that are linear in the rates of its freedoms: a journal in its turn, a shaft that turns and slides in
both at once, a ball in its three turns, a contact in the slides of its point. Friction acts against their direction. Where all of them are
zero it holds, up to its greatest size.
"""

from __future__ import annotations

import numpy as np

from mechgraph.kinematics.system import System
from mechgraph.memo import dataclass
from mechgraph.model.friction import (
    Friction,
    coupling_of,
    pairs_of,
    rubbing_loads,
    rubs_as_ball,
    rubs_as_contact,
    rubs_as_plane,
)
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.pairs.contact_types import OnSurface, takes_curves


@dataclass(frozen=True)
class Rough:
    """Freedoms that slip and stick together, by their places; the ``name`` of their pair or coupling.

    ``weights``: squares of the arms at which they slide, lengths over L: the sum of weight times rate squared is that of the sliding speed.
    """

    name: str
    columns: tuple[int, ...]
    weights: tuple[float, ...]


def _rubbing_as_one(pair: Pair, load: Friction) -> list[list[int]] | str:
    """The freedoms of a pair, by their places in it, that slip together; or why that is not followed."""
    row = pair.type
    if rubs_as_contact(row):
        if pair.radius_b is not None and any(f.turns for f in row.freedoms):
            return (
                "rolls on a radius, which is not followed in time; leave the radius of the pair, or the friction, out"
            )
        tilts = row.touching is not None and row.touching.tilting
        if tilts or len(takes_curves(row)) > 1 or any(isinstance(step, OnSurface) for step in row.steps):
            return f"touches at a place that moves on both links (type {row.symbol}), which is not followed in time; leave it out"
        return [[j for j, f in enumerate(row.freedoms) if not f.turns and j != row.gap]]
    if rubs_as_plane(row):
        return [[0, 1, 2]] if load.radius else "turns as it slides; give the radius= at which it rubs as it turns"
    if rubs_as_ball(row):
        return [[0, 1, 2]]
    axes: dict[int, list[int]] = {}
    for j, f in enumerate(row.freedoms):
        axes.setdefault(int(np.argmax(np.abs(f.twist[:3] if f.turns else f.twist[3:]))), []).append(j)
    return list(axes.values())


def friction_faults(m: Mechanism, passive: str) -> list[str]:
    """Friction that a motion in time does not carry."""
    found = []
    for load in rubbing_loads(m, m.loads):
        why = None if coupling_of(m, load) else _rubbing_as_one(m.pair(load.of), load)
        if isinstance(why, str):
            found.append(load.where + why)
        elif passive == "held":
            found.append(f"{load.where}is not followed beside passive='held'; give passive='free'")
    return found


def rough_freedoms(s: System, dry: tuple[Friction, ...]) -> tuple[Rough, ...]:
    """All freedoms with friction."""
    out = []
    for load in dry:
        firsts = [int(s.first_column[k]) for k in pairs_of(s.m, load)]
        if coupling_of(s.m, load):
            ends = (int(s.first_column[k + 1]) for k in pairs_of(s.m, load))
            columns = tuple(c for first, end in zip(firsts, ends, strict=True) for c in range(first, end))
            out.append(Rough(load.of, columns, (1.0,) * len(columns)))
            continue
        parts = _rubbing_as_one(s.m.pair(load.of), load)
        assert not isinstance(parts, str)
        for columns in (tuple(firsts[0] + j for j in part) for part in parts):
            arm = 1.0 if load.radius is None else load.radius / s.par.L
            out.append(Rough(load.of, columns, tuple(1.0 if s.is_length[c] else arm**2 for c in columns)))
    return tuple(out)
