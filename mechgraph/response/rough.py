"""What rubs in a motion in time: freedoms that slip and stick together, bodies that roll on each other without sliding.

A pair rubs along sliding velocities that are linear in the rates of its freedoms: a journal in its turn, a shaft that turns and slides in
both at once, a ball in its three turns, a contact in the slides of its point. Friction acts against their direction. Where all of them are
zero it holds, up to its greatest size. Bodies that touch at a place that moves on both of them slide as their points there do: where that
is zero they roll.

Sliding rates are ``A q' = 0 (m,)`` while friction holds. With ``q' = Z v + Z_p p'`` and ``C = A Z`` these are equations of rates that no
coordinates meet, ``C v + A Z_p p' = 0`` and ``C v' + A q''_0 + A' q' = 0``, with forces ``f`` along the tangents for multipliers:

    v' = M^-1 (Q + C^T f),   f = -G^+ (C M^-1 Q + ...),   G = C M^-1 C^T.

Forces that move nothing, as across a guide, are those of least norm. Source: Neimark and Fufaev, Dynamics of Nonholonomic Systems, 1972.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mechgraph.force.friction import Grip, Rubbed
from mechgraph.kinematics.rates import Rates, Velocities
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.system import System
from mechgraph.maths.se3 import Array, Mask
from mechgraph.maths.tolerances import MOTIONS
from mechgraph.memo import dataclass
from mechgraph.model.friction import (
    Friction,
    coupling_of,
    pairs_of,
    place_of_coupling,
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

    What slides are the freedoms themselves, ``weights``: squares of the arms at which they do, lengths over L, so that the sum of weight
    times rate squared is that of the sliding speed. Or, of bodies that ``roll`` on each other, and of teeth, it is what the place says at
    which they touch (see ``force.friction.Grip``): there freedoms move on while nothing slides.
    """

    name: str
    columns: tuple[int, ...]
    weights: tuple[float, ...]
    rolls: Friction | None = None

    def touches(self, m: Mechanism) -> int:
        """The pair of bodies that may roll on each other, by its number in the kernel; of teeth -2 - their line, of others -1."""
        if self.rolls is None:
            return -1
        if self.name in m.pair_index:
            return m.pair_index[self.name]
        return -2 - sum(bool(c.steps) for c in m.couplings[: place_of_coupling(m, self.rolls)])

    def slides(self, here: Configuration, rates: Array) -> Array:
        """Sliding rates ``(d, ..., T)`` at rates ``(F, ..., T)`` of all freedoms."""
        if self.rolls is None:
            return np.asarray(rates[list(self.columns)])
        return np.asarray(np.einsum("dft,f...t->d...t", Grip.of(here, self.rolls).rows(here), rates))

    def rests(self, here: Configuration, rates: Array) -> Mask:
        """Where ``(T,)`` nothing slides at rates ``(F, T)``: of what rolls, within their rounding."""
        least = 0.0 if self.rolls is None else 100.0 * MOTIONS.rounding * np.abs(rates[list(self.columns)]).max(axis=0)
        return np.asarray(np.abs(self.slides(here, rates)).max(axis=0) <= np.maximum(least, 1e-100))

    def accelerates(self, at: Rates) -> Array:
        """Sliding accelerations ``(d, T)`` where nothing slides."""
        if self.rolls is None:
            return np.asarray(at.ddq[list(self.columns)])
        grip = Grip.of(at.here, self.rolls)
        return np.asarray((grip.rows(at.here) * at.ddq).sum(axis=1) + grip.bias(at))


def _rubbing_as_one(pair: Pair, load: Friction) -> list[list[int]] | str:
    """The freedoms of a pair, by their places in it, that slip together; or why that is not followed."""
    row = pair.type
    if rubs_as_contact(row):
        if _rolls(pair):
            if row.touching is not None and len(row.touching.forces) > 1:
                return "touches its groove on the side to which the force points, and does not roll there in time; leave the radius out"
            if pair.radius_b is not None and pair.closed != "force" and not row.opens:
                return "touches on either side, so that it is not known on which it rolls; give the pair closed='force'"
            return [[j for j in range(row.f) if j != row.gap]]
        return [[j for j, f in enumerate(row.freedoms) if not f.turns and j != row.gap]]
    if rubs_as_plane(row):
        return [[0, 1, 2]] if load.radius else "turns as it slides; give the radius= at which it rubs as it turns"
    if rubs_as_ball(row):
        return [[0, 1, 2]]
    axes: dict[int, list[int]] = {}
    for j, f in enumerate(row.freedoms):
        axes.setdefault(int(np.argmax(np.abs(f.twist[:3] if f.turns else f.twist[3:]))), []).append(j)
    return list(axes.values())


def _rolls(pair: Pair) -> bool:
    """Whether a pair touches at a place that moves on both links, or whose sliding is not that of single freedoms."""
    row = pair.type
    turns = pair.radius_b is not None and any(f.turns for f in row.freedoms)
    tilts = row.touching is not None and row.touching.tilting is not None
    return turns or tilts or len(takes_curves(row)) > 1 or any(isinstance(step, OnSurface) for step in row.steps)


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
            out.append(Rough(load.of, columns, (1.0, 1.0, 1.0), load))
            continue
        pair = s.m.pair(load.of)
        parts = _rubbing_as_one(pair, load)
        assert not isinstance(parts, str)
        rolls = rubs_as_contact(pair.type) and _rolls(pair)
        for columns in (tuple(firsts[0] + j for j in part) for part in parts):
            arm = 1.0 if load.radius is None else load.radius / s.par.L
            weights = tuple(1.0 if s.is_length[c] else arm**2 for c in columns)
            out.append(Rough(load.of, columns, (1.0, 1.0) if rolls else weights, load if rolls else None))
    return tuple(out)


class Rolling:
    """Friction that holds at closed states with motions ``Z (F, n, T)``; ``moves``: accelerations ``(n, T)`` under efforts ``(F, T)``."""

    def __init__(
        self, here: Configuration, loads: Sequence[Friction], Z: Array, moves: Callable[[Array], Array]
    ) -> None:
        self.here, self.grips = here, [Grip.of(here, load) for load in loads]
        self.rows = np.concatenate([grip.rows(here) for grip in self.grips])
        self.C = np.einsum("mft,fnt->mnt", self.rows, Z)
        self.yields = np.stack([moves(row) for row in self.rows], axis=1)
        G = np.moveaxis(np.einsum("mnt,nkt->mkt", self.C, self.yields), -1, 0)
        self.inverse = np.moveaxis(np.linalg.pinv(G, rcond=MOTIONS.rounding, hermitian=True), 0, -1)
        self.ends = np.cumsum([grip.W.shape[1] for grip in self.grips])[:-1]

    def held(self, off: Array) -> tuple[Array, Array]:
        """Forces ``(m, ..., T)`` that take back what slides ``(m, ..., T)``, and what the independent rates ``(n, ..., T)`` change by."""
        forces = -np.einsum("mkt,k...t->m...t", self.inverse, off)
        return forces, np.einsum("nmt,m...t->n...t", self.yields, forces)

    def accelerations(self, at: Velocities, ddq: Array) -> Array:
        """``A q'' + A' q' (m, T)``."""
        bias = np.concatenate([grip.bias(at) for grip in self.grips])
        return np.asarray((self.rows * ddq).sum(axis=1) + bias)

    def rubbing(self, rubs: Rubbed, forces: Array) -> Rubbed:
        """Friction with that of what rolls ``(m, T)``."""
        for grip, part in zip(self.grips, np.split(forces, self.ends), strict=True):
            rubs = rubs.with_grip(self.here, grip, part)
        return rubs

    def on_links(self, forces: Array) -> Array:
        """Wrenches ``(6, N, ..., T)`` of forces ``(m, ..., T)``."""
        parts = zip(self.grips, np.split(forces, self.ends), strict=True)
        return np.asarray(sum(grip.on_links(self.here, part) for grip, part in parts))
