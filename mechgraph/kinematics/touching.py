"""Forces of gears and belts in a configuration: couplings that act along lines of their own, not as efforts in freedoms.

A coupling with the multiplier m exerts the effort ``c_j m`` in freedom j, as if through that pair. Gears touch each other instead: the
wrench ``F = G m`` acts on gear b, ``-F`` on gear a, and the pairs j on the way between them, passed in the sense ``s_j``, are relieved of
``s_j F`` and of the effort that they would carry:

    wrench of the pair = wrench that closes the equilibrium - (s_j G - E_j c_j) m.

``s_j G . S_j = c_j`` (see ``model.contact``), so that what is taken off does no work in any freedom: motion and efforts are those of the
linear relation, reactions are those of the contact.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from mechgraph.kinematics.rows import LineRows
from mechgraph.kinematics.state import Configuration, user_poses
from mechgraph.kinematics.system import System
from mechgraph.maths.se3 import Array, Mask, compose, cross, identity, inverse, rotate, rotate_back
from mechgraph.maths.tolerances import MOTIONS
from mechgraph.memo import dataclass
from mechgraph.model.belts import BeltDrive, pretensions
from mechgraph.model.couplings import BaseCoupling, fitting_of
from mechgraph.model.gears import LineCoupling, moving_lines
from mechgraph.pairs import pair_type as evaluation


def strayed(here: Configuration) -> str | None:
    """Which shafts of gears leave the places that their relations are about; None for none."""
    m = here.system.m
    if not m.once(moving_lines) or not here.T:
        return None
    which = np.array([g for g, c in enumerate(m.couplings) if c.name in m.once(moving_lines)])
    return LineRows(here.system, which).strayed(here, max(fitting_of(m), 1e-7))


class _OnTheWay:
    """What a configuration tells of the links and pairs on the way from gear a to gear b of a coupling, seen from gear a, the pairs at
    some coordinates: one a variant.
    """

    def __init__(self, system: System, coupling: BaseCoupling, coordinate: float) -> None:
        m, P, T = system.m, len(system.m.pairs), system.par.batch
        constants = system.numbers.constants
        self.system, self.T, self.links = system, T, [m.link_index[coupling.gears(m)[0]]]
        self.poses = identity(len(m.links), T)
        self.pair_points, self.S = np.zeros((3, P, T)), np.zeros((6, system.n_freedoms, T))
        for place, step in enumerate(coupling.steps):
            k, forward = step.pair, step.sense > 0
            row, A, B = m.pairs[k].type, constants[:, :, [1 + k]], constants[:, :, [1 + P + k]]
            x = evaluation.coordinates_to_state(row, np.full((row.f, 1, 1), coordinate * (1 + place)))
            moved = evaluation.frames_of(row, system.par.pitch[[k]], x)[-1]
            there = compose(compose(A, moved), inverse(B))
            before = self.poses[:, :, self.links[-1:]]
            behind = compose(before, there if forward else inverse(there))
            self.links.append(m.link_index[m.pairs[k].b if forward else m.pairs[k].a])
            self.poses[:, :, self.links[-1:]] = behind
            frame = compose(before if forward else behind, A)[:, :, 0]
            self.pair_points[:, k] = compose(behind if forward else before, B)[:, 3, 0]
            for column, freedom in enumerate(row.freedoms, system.first_column[k]):
                turn, slide = (
                    rotate(frame[:, :3], np.reshape(v, (3, 1))) for v in np.split(np.array(freedom.twist), 2)
                )
                self.S[:, column] = np.concatenate([turn, slide + cross(frame[:, 3], turn)])

    def seen_from(self, link: int, wrenches: Array) -> Array:
        """Wrenches ``(6, n, T)`` about the origin of a link, in its frame."""
        R, p = self.poses[:, :3, [link]], self.poses[:, 3, [link]]
        return np.concatenate([rotate_back(R, wrenches[:3] - cross(p, wrenches[3:])), rotate_back(R, wrenches[3:])])


@dataclass(frozen=True)
class OnCarrier:
    """Both lines of a coupling in the frame of the link on which they stand still, internal units.

    ``wrenches (6, 2, B)`` on gear b of a positive and of a negative unit multiplier, the ``points (3, 2, B)`` at which they act and their
    normal forces ``per (2, B)``; ``screws (6, 2, B)`` in which gears a and b turn.
    """

    link: int
    wrenches: Array
    points: Array
    per: Array
    screws: Array


def on_carrier(system: System, g: int) -> OnCarrier | None:
    """The link between gears a and b in which both lines of a coupling stand still, with the lines; None where there is no such link."""
    coupling = system.m.couplings[g]
    if coupling.name in system.m.once(moving_lines):
        return None
    ways = [_OnTheWay(system, coupling, coordinate) for coordinate in (0.0, 0.7)]
    lines = [ContactLines(way).wrenches_of([g])[0] for way in ways]
    for link in ways[0].links:
        one, other = (way.seen_from(link, G) for way, (G, _, _) in zip(ways, lines, strict=True))
        if np.abs(one - other).max() <= MOTIONS.rounding * np.abs(one).max():
            (_, P, per), R, p = lines[0], ways[0].poses[:, :3, [link]], ways[0].poses[:, 3, [link]]
            w, v = np.split(np.stack(ContactLines(ways[0]).screws(g), axis=1), 2)
            screws = np.concatenate([rotate_back(R, w), rotate_back(R, v + cross(w, p))])
            return OnCarrier(link, one, rotate_back(R, P - p), per, screws)
    return None


def pretension_conditions(here: Configuration) -> tuple[list[BeltDrive], Array, Array]:
    """Belts with a pretension T0, and what it says of the multipliers ``m (n, T)`` of the rows behind those of the loops, ``C m = c``:
    ``sum l T = T0 sum l`` over the spans of each, ``T = -m``. ``C (b, n, T)``, ``c (b, 1)``.
    """
    m, loops = here.system.m, here.system.graph.loop_rows
    asked = m.once(pretensions)
    scale = here.system.par.L**2 * np.broadcast_to(here.system.row_scale, (here.system.n_rows, here.T))[loops:]
    C = np.zeros((len(asked), len(scale), here.T))
    for i, (belt, rows) in enumerate(asked):
        poses = user_poses(here)
        lengths = belt.course_of(
            m, [np.moveaxis(poses[m.place_of_link(p.link)], 0, 2) for p in belt.pulleys(m)]
        ).spans.length
        C[i, rows] = -scale[rows] * lengths / lengths.sum(axis=0)
    belts = [belt for belt, _ in asked]
    return belts, C, np.array([[belt.pretension] for belt in belts], dtype=float)


class ContactLines:
    """Lines of all contacts at the positions of a configuration, internal units about the internal origin."""

    def __init__(self, here: Configuration | Any) -> None:
        self.here = here
        self.contacts = [(g, c) for g, c in enumerate(here.system.m.couplings) if c.steps]
        self.settled: dict[int, Mask] = {}

    def __bool__(self) -> bool:
        return bool(self.contacts)

    @cached_property
    def wrenches(self) -> list[tuple[Array, Array, Array]]:
        """For every contact the wrench on gear b for a unit multiplier ``(6, 2, T)``, of a positive and of a negative one, the points
        ``(3, 2, T)`` at which it acts, and its normal force ``(2, T)``.
        """
        return self.wrenches_of([g for g, _ in self.contacts]) if self.contacts else []

    def wrenches_of(self, contacts: Sequence[int]) -> list[tuple[Array, Array, Array]]:
        """Those of some, by their numbers among the couplings."""
        here, s, which = self.here, self.here.system, np.array(contacts, dtype=np.intp)
        rows, own = LineRows(s, which), [s.m.couplings[g] for g in contacts]
        lines = [rows.lines(here.poses, other) for other in (False, True)]
        P, n = (np.stack([getattr(at, name) for at in lines], axis=2) for name in ("point", "along"))
        G = np.concatenate([cross(P, n), n])
        if s.m.planar:  # of gears with a helix the axial force leaves the plane
            G[np.delete(np.arange(6), s.graph.span)] = 0.0
        first = [(s.first_column[c.steps[0].pair], c.steps[0].sense) for c in own]
        columns, senses = np.array(first, dtype=np.intp).T
        power = senses[:, None, None] * (G * here.S[:, columns, None]).sum(axis=0)
        forces = np.array([c.is_force for c in own])[:, None, None]
        scales = (np.broadcast_to(s.row_scale, (s.n_rows, here.T))[s.graph.loop_rows + which] * s.par.L)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            size = np.where(forces, scales, s.coupling_matrix[which, columns][:, None] / power)
        # the first line serves the multipliers that make its force push, the second the others
        turned = size[:, :1] < 0.0
        G, P, size = (np.where(turned, part[..., ::-1, :], part) for part in (G * size, P, np.abs(size)))
        return [(G[:, i], P[:, i], size[i]) for i in range(len(which))]

    def screws(self, g: int) -> tuple[Array, Array]:
        """Screws ``(6, T)`` of gears a and b in their turns (of a rack its slide) against their carrier."""
        return LineRows(self.here.system, np.array([g])).screws(self.here.poses)

    def _acting(self, g: int, flank: Array) -> Mask:
        """Where the second line of a contact acts, by signs ``(n, T)`` of multipliers."""
        return np.asarray((flank[g] < 0.0) & self.settled.get(g, np.array(g not in self.moving)))

    def multiplier_of_one(self, g: int, flank: Array) -> Array:
        """The multiplier ``(T,)`` of a normal force of one, on the flanks of signs ``(n, T)``."""
        per = self.wrenches[self._number(g)][2]
        return np.where(flank[g] < 0.0, -1.0, 1.0) / np.where(self._acting(g, flank), per[1], per[0])

    def push(self, g: int, flank: Array) -> tuple[Array, Array]:
        """The wrench ``(6, T)`` of a normal force of one on gear b, on the flanks of signs ``(n, T)``, and its point ``(3, T)``."""
        G, P, _ = self.wrenches[self._number(g)]
        line = np.where(self._acting(g, flank), G[:, 1], G[:, 0])
        return self.multiplier_of_one(g, flank) * line, np.where(flank[g] < 0.0, P[:, 1], P[:, 0])

    def _number(self, g: int) -> int:
        return [one for one, _ in self.contacts].index(g)

    @cached_property
    def moving(self) -> dict[int, Array]:
        """For every row evaluated from poses that has another flank: the row of that flank in place of its own in J, less it ``(F, T)``."""
        here, found = self.here, {}
        for g, c in enumerate(here.system.m.couplings):
            if isinstance(c, LineCoupling) and not c.linear and c.other is not None and c.other is not c.relation:
                rows = LineRows(here.system, np.array([g]))
                found[g] = (rows.jacobian(here, other=True) - rows.jacobian(here))[0]
        return found

    def flipped(self, t: int, flips: Sequence[int], multipliers: Array) -> Array | None:
        """What is added to multipliers of all rows ``(rows, k)`` at a position where some rows stand on their other flanks; None where
        the motion does not keep their centers.

        With the rows ``J'`` of these flanks the same efforts need ``J'^T y = sum_g (J'_g - J_g) m_g``, which has a solution in all columns
        where both rows hold the same motions; ``multipliers (n, k)`` of the couplings.
        """
        base = self.here.system.graph.loop_rows
        A = self.here.J[..., t].copy()
        change = np.stack([self.moving[g][:, t] for g in flips], axis=1)
        A[[base + g for g in flips]] += change.T
        y = np.linalg.lstsq(A.T, change, rcond=1e-11)[0]
        left = np.abs(A.T @ y - change).max(initial=0.0)
        # of rows of size one: rounding where the centers stand still
        return None if left > 1e-9 else np.asarray(y @ multipliers[list(flips)])

    def settle(self, flank: Array) -> dict[int, Mask]:
        """Say where the other flanks act, by signs ``(n, T)`` of multipliers that were found on them."""
        n, T = len(self.here.system.m.couplings), self.here.T
        signs, nothing = np.broadcast_to(flank, (n, T)), np.zeros((n, 1))
        self.settled = {g: np.zeros(T, dtype=bool) for g in self.moving}
        for t in range(T if self.moving else 0):
            flips = [g for g in self.moving if signs[g, t] < 0.0]
            if flips and self.flipped(t, flips, nothing) is not None:
                for g in flips:
                    self.settled[g][t] = True
        return self.settled

    def on_ways(self, wrenches: Array) -> Array:
        """Wrenches on gears b ``(6, n, ..., T)`` passed through the pairs on the way from gears a, ``s_j F``, ``(6, P, ..., T)``."""
        out = np.zeros((6, len(self.here.system.m.pairs), *wrenches.shape[2:]))
        for g, contact in self.contacts:
            for step in contact.steps:
                out[:, step.pair] += step.sense * wrenches[:, g]
        return out

    def through(self, multipliers: Array, flank: Array) -> Array:
        """What would pass through the pairs on the way between gears that do not touch each other, ``(6, P, ..., T)``."""
        return self.on_ways(self.on_gears(multipliers, flank))

    def relief(self, multipliers: Array, flank: Array) -> Array:
        """What is taken off the wrenches of all pairs ``(6, P, ..., T)`` for multipliers ``(n, ..., T)`` of all couplings."""
        here, out = self.here, self.through(multipliers, flank)
        first, coefficients = here.system.first_column, here.coupling_coefficients
        steps = [
            (g, step, column)
            for g, contact in self.contacts
            for step in contact.steps
            for column in range(first[step.pair], first[step.pair + 1])
        ]
        for g, step, column in steps:
            E = here.E[:, column] * coefficients[g, column]
            out[:, step.pair] -= E.reshape(6, *(1,) * (multipliers.ndim - 2), here.T) * multipliers[g]
        return out

    def on_gears(self, multipliers: Array, flank: Array) -> Array:
        """For every coupling the wrench on gear b ``(6, n, ..., T)`` for multipliers ``(n, ..., T)``; zero where it acts in freedoms.

        ``flank (n, T)``: the sign of the multiplier that says which line acts.
        """
        out = np.zeros((6, *multipliers.shape))
        for (g, _), (G, _, _) in zip(self.contacts, self.wrenches, strict=True):
            acting = np.where(self._acting(g, flank), G[:, 1], G[:, 0])
            out[:, g] = acting.reshape(6, *(1,) * (multipliers.ndim - 2), self.here.T) * multipliers[g]
        return out

    def unit(self, flank: Array) -> list[Array]:
        """For every coupling the wrench on gear b for a unit multiplier, ``(6, 1, T)``; none for one that acts in freedoms."""
        touching = {g for g, _ in self.contacts}
        units = self.on_gears(np.ones((len(self.here.system.m.couplings), self.here.T)), flank)
        return [units[:, [g] if g in touching else []] for g in range(units.shape[1])]
