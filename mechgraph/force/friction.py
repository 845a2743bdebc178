"""Dry friction beside reactions: one unknown normal force a place, one factorization a position.

The motion gives the directions of sliding, so friction is linear in the normal forces, and reactions are linear in friction. With the
normal vectors ``V_t = A_t w`` of the reaction ``w`` of a pair at every place t, and friction wrenches ``D_t |V_t| + K_t V_t`` on link b,

    (1 - C) V = a + B n,   n_t = |V_t|,

a without friction. A friction wrench is an effort in the freedoms of its pair, which loads the others, and a part that its own pair takes
up. Solved by semismooth Newton from ``n = |a|``; where ``|B|`` has a spectral radius below 1 the solution is the only one. Meant is the one
connected with the frictionless one while friction grows by k from 0 to 1: n without bound at k < 1 jams, a fold has no finite force.
Sources: J. E. Shigley and J. J. Uicker, Theory of Machines and Mechanisms, 1995; L. Qi and J. Sun, A nonsmooth version of Newton's method,
Mathematical Programming 58, 1993; F. Pfeiffer and Ch. Glocker, Multibody Dynamics with Unilateral Contacts, 1996.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from enum import IntEnum
from itertools import product
from typing import Any

import numpy as np

from mechgraph.errors import DeclarationError
from mechgraph.kinematics.motion_path import Status
from mechgraph.kinematics.rates import Velocities
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.touching import ContactLines
from mechgraph.maths.se3 import Array, Index, cross, skew
from mechgraph.maths.tolerances import MOTIONS
from mechgraph.memo import dataclass
from mechgraph.model.friction import Friction, Rubs, place_of_coupling, places_in, way_of
from mechgraph.model.gear_facts import mean_sliding
from mechgraph.pairs.contact_types import pressing


class Came(IntEnum):
    """What becomes of the forces at a position: their status. Of friction that is not determined the reason: several sets of normal forces,
    reactions that are not unique, places that do not settle, feet that would pull or be pressed without bound, teeth that press on neither
    flank.
    """

    OK = 0
    JAMS = 1
    NO_FINITE_FORCE = 2
    SEVERAL = 3
    NOT_UNIQUE = 4
    UNSETTLED = 5
    FEET = 6
    FLANKS = 7
    LIFTS_OFF = 8

    @property
    def status(self) -> str:
        """The status of the position."""
        return str(Status["FRICTION_OPEN" if self.SEVERAL <= self <= self.FLANKS else self.name].value)


@dataclass(frozen=True)
class Place:
    """A place that rubs: the name ``of`` the pair or coupling, normal vector ``A (d, 6, T)`` of the wrench that it ``reads`` (the reaction
    of a pair, or behind these the force on gear b) about the internal origin, friction wrench on link b ``D (6, T)`` for a unit of its
    size and ``K (6, d, T)`` linear in it, ``preload (T,)`` (internal units), ``speed (T,)`` of sliding. The wrench would pass through the
    pairs ``way``, in these senses; between teeth it passes them by. ``follows``: whether its directions depend on the reactions.
    ``signed``: of what presses one way alone the size is the one component of its normal vector, below zero where it would pull.
    """

    of: str
    reads: int
    way: tuple[tuple[int, float], ...]
    A: Array
    D: Array
    K: Array
    preload: Array
    speed: Array
    follows: bool = False
    signed: bool = False

    def between_teeth(self, pairs: int) -> bool:
        """Whether it is one of a coupling, with so many pairs."""
        return self.reads >= pairs


def _rows(moment: Array, force: Array) -> Array:
    return np.concatenate([moment, force], axis=1)


def _couple(m: Array) -> Array:
    return np.concatenate([m, np.zeros_like(m)])


def _force_at(p: Array, f: Array) -> Array:
    return np.concatenate([cross(p, f), f])


def _unit(v: Array, least: Array | float = 0.0) -> tuple[Array, Array]:
    """Directions of vectors ``(3, T)``, zero where they are not longer than ``least``, and their lengths ``(T,)``."""
    size = np.sqrt((v * v).sum(axis=0))
    return v / np.where(size > least, size, np.inf), size


def _freedoms(here: Configuration, k: int) -> slice:
    first = here.system.first_column
    return slice(int(first[k]), int(first[k + 1]))


def _twist(here: Configuration, dq: Array, k: int) -> Array:
    """Twist ``(6, T)`` of link b of a pair relative to its link a."""
    return np.asarray(np.einsum("cft,ft->ct", here.S[:, _freedoms(here, k)], dq[_freedoms(here, k)]))


def _passed_by(here: Configuration, dq: Array, way: tuple[tuple[int, float], ...]) -> Array:
    """Twist ``(6, T)`` of the link at the end of a way of pairs, in these senses, relative to that at its beginning."""
    return np.asarray(sum(sense * _twist(here, dq, k) for k, sense in way))


def moving_rates(dq: Array, ddq: Array | float = 0.0) -> Array:
    """Rates ``(F, T)`` without those of freedoms at rest, where friction has no direction: rounding beside the largest rate of the
    position, or a reversal within rounding of the coordinate, ``q'^2 / q''``.
    """
    size = np.abs(dq)
    rests = (size <= MOTIONS.rounding * size.max(axis=0, initial=0.0)) | (size <= MOTIONS.still * np.sqrt(np.abs(ddq)))
    return np.where(rests, 0.0, dq)


def places_of(
    here: Configuration,
    dq: Array,
    normal: Array,
    loads: Sequence[Friction],
    at_rest: bool = False,
    teeth: tuple[ContactLines, Array] | None = None,
) -> list[Place]:
    """All places that rub in a motion ``dq (F, T)`` of ``moving_rates``; ``normal (6, P, T)``: reactions that tell where bodies touch,
    ``teeth``: lines of contact and signs ``(n, T)`` that tell on which flanks; the first ones where left out.
    """
    m = here.system.m
    found: list[Place] = []
    for load in loads:
        if load.of in m.pair_index:
            rubbing = _Rubbing(here, load, m.pair_index[load.of], dq, normal, at_rest)
            found += [_MAKERS[rubs.way](rubbing, rubs) for rubs in places_in(load, rubbing.row)]
        else:
            lines, flank = teeth or (ContactLines(here), np.ones((len(m.couplings), here.T)))
            found.append(_between_teeth(here, load, dq, at_rest, lines, flank))
    return found


def _or_zero(value: Any) -> Any:
    return 0.0 if value is None else value


class _Rubbing:
    """A pair that rubs in a motion: its screws ``S (6, f, T)``, ``rate (f, T)``, relative ``twist (6, T)``, the wrench ``w (6, T)`` by
    which it presses, radius ``r``, and the ``origin (3, T)`` of its places, over L.
    """

    def __init__(self, here: Configuration, load: Friction, k: int, dq: Array, normal: Array, at_rest: bool) -> None:
        s = here.system
        self.here, self.load, self.k, self.at_rest, self.L, self.T = here, load, k, at_rest, s.par.L, here.T
        self.pair, self.w = s.m.pairs[k], normal[:, k]
        self.row = self.pair.type
        self.S, self.rate, self.twist = here.S[:, _freedoms(here, k)], dq[_freedoms(here, k)], _twist(here, dq, k)
        self.r = _or_zero(load.radius) / self.L
        self.origin = here.pair_points[:, k] if load.on == "b" else self.frame(0)[:, 3]
        self.pitch = self.pair.pitch_per_radian / s.par.L

    def frame(self, number: int) -> Array:
        """A frame of the pair ``(3, 4, T)``."""
        group, i = self.here.system.place_of(self.k)
        return np.asarray(self.here.frames[group][number][:, :, i])

    def about(self, rubs: Rubs) -> tuple[Array, Array, Array]:
        """The axis ``(3, T)`` of a place, the rates ``(T,)`` at which the pair turns about it and slides along it."""
        turn, slide = rubs.turn, rubs.slide
        u = self.S[:3, turn] if turn is not None else self.S[3:, slide]
        w, v = (np.zeros(self.T) if j is None else self.rate[j] for j in (turn, slide))
        return u, w, self.pitch * w if self.row.takes_pitch else v

    def mu(self, speed: Array) -> Array:
        """The coefficient ``(T,)`` at sliding speeds."""
        return self.load.coefficient(self.L * speed, self.at_rest)

    @property
    def rolls_below(self) -> Array:
        """Sliding speeds ``(T,)`` that are rounding."""
        return np.asarray(MOTIONS.rounding * np.abs(self.twist).max(axis=0))

    def place(self, A: Array, D: Array, speed: Array, K: Array | None = None, follows: bool = False) -> Place:
        """A place of the pair."""
        K = np.zeros((6, len(A), self.T)) if K is None else K
        preload = np.broadcast_to(self.load.preload / self.L, self.T)
        return Place(self.load.of, self.k, ((self.k, 1.0),), A, D, K, preload, speed, follows)

    def forces(self) -> Array:
        """What reads all of a force ``(3, 6, T)``."""
        eye = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, self.T))
        return _rows(np.zeros((3, 3, self.T)), eye)

    @property
    def touches_in(self) -> int:
        """The frame in which it touches, by its number."""
        row = self.row
        return next(iter(row.reactions or ())).frame if row.gap is None else row.gap

    @property
    def radius_b(self) -> float:
        """Radius of what link b touches with, over L."""
        return float(_or_zero(self.pair.radius_b)) / self.L


def _touching(x: _Rubbing, rubs: Rubs) -> Place:
    """A point, or the center of pressure of a line, on the side of link b's curve to which the force points."""
    c, r = x.frame(x.touches_in)[:, 3], x.radius_b
    n, size = _unit(x.w[3:])
    parts = x.row.reactions or ()
    pushes = [part.wrench[3:] for part in parts if not part.is_couple]
    if len(pushes) == 1:  # known to all digits, and so the direction of a slow sliding too
        axis = x.frame(x.touches_in)[:, int(np.argmax(np.abs(pushes[0])))]
        n = np.sign((axis * n).sum(axis=0)) * axis
    if any(part.is_couple for part in parts):
        c = c + cross(n, x.w[:3] - cross(c, x.w[3:])) / np.where(size > 0, size, np.inf)
    u, speed = _unit(x.twist[3:] + cross(x.twist[:3], c - r * n), x.rolls_below)
    mu = x.mu(speed)
    return x.place(
        x.forces(),
        -mu * _force_at(c, u),
        speed,
        np.concatenate([-mu * r * skew(u), np.zeros((3, 3, x.T))]),
        follows=True,
    )


def _opening(x: _Rubbing, rubs: Rubs) -> Place:
    """A point that may open, which presses along the freedom in which it does."""
    assert x.row.gap is not None
    n = x.S[3:, x.row.gap]
    at = x.frame(x.row.gap)[:, 3] - x.radius_b * n
    u, speed = _unit(x.twist[3:] + cross(x.twist[:3], at), x.rolls_below)
    pushes = x.place(_rows(np.zeros((1, 3, x.T)), n[None]), -x.mu(speed) * _force_at(at, u), speed)
    return replace(pushes, signed=True)


def _plane(x: _Rubbing, rubs: Rubs) -> Place:
    """A plane, at the center of pressure, where the force has no moment in it: ``p + z x M / F_z``."""
    z, w = x.frame(0)[:, 2], x.w
    turn, press = ((part * z).sum(axis=0) for part in (x.twist[:3], w[3:]))
    at = x.origin + cross(z, w[:3] - cross(x.origin, w[3:])) / np.where(press != 0, press, np.inf)
    v = x.twist[3:] + cross(x.twist[:3], at)
    v = v - z * (v * z).sum(axis=0)
    speed = np.sqrt((v * v).sum(axis=0) + (x.r * turn) ** 2)
    share = np.where(speed > x.rolls_below, speed, np.inf)
    D = -x.mu(speed) * (_force_at(at, v / share) + x.r * _couple(x.r * turn / share * z))
    return x.place(_rows(np.zeros((1, 3, x.T)), z[None]), D, speed, follows=True)


def _ball(x: _Rubbing, rubs: Rubs) -> Place:
    u, spin = _unit(x.twist[:3])
    mu = x.mu(x.r * spin)
    part = mu / np.hypot(1.0, mu) if x.load.model == "circle" else mu
    return x.place(x.forces(), -part * x.r * _couple(u), x.r * spin)


def _axial(u: Array) -> Array:
    """What reads the force along an axis ``(1, 6, T)``."""
    return _rows(np.zeros((1, 3, u.shape[1])), u[None])


def _thread(x: _Rubbing, rubs: Rubs) -> Place:
    """Friction couple of a thread that turns at ``w``: more where the motion goes against the axial force Q on b's load."""
    u, w, _ = x.about(rubs)
    speed, lead = np.hypot(x.r, x.pitch) * np.abs(w), np.arctan2(np.abs(x.pitch), x.r)
    phi = np.arctan(x.mu(speed) / np.cos(np.arctan(np.tan(x.load.flank) * np.cos(lead))))
    up, down = x.r * (np.tan(lead + phi) - np.tan(lead)), x.r * (np.tan(lead) - np.tan(lead - phi))
    mean, more = 0.5 * (up + down), 0.5 * (up - down) * np.sign(x.pitch)
    return x.place(_axial(u), -mean * _couple(np.sign(w) * u), speed, -more * _couple(np.abs(np.sign(w)) * u)[:, None])


def _collar(x: _Rubbing, rubs: Rubs) -> Place:
    (u, w, _), t = x.about(rubs), _or_zero(x.load.thrust_radius) / x.L
    return x.place(_axial(u), -x.mu(t * np.abs(w)) * t * _couple(np.sign(w) * u), t * np.abs(w))


def _along(x: _Rubbing, rubs: Rubs) -> Place:
    """A place along an axis ``u`` that carries radial forces, under a turn ``w`` at the radius and a slide ``v``."""
    (u, w, v), p = x.about(rubs), x.origin
    speed = np.hypot(x.r * w, v)
    share = np.where(speed > 0, speed, np.inf)
    round_, along, mu = x.r * w / share, v / share, x.mu(speed)
    size = mu / np.sqrt(1.0 + (mu * round_) ** 2) if x.load.model == "circle" else mu
    D = -size * (x.r * round_ * _couple(u) + along * _force_at(p, u))
    A, U, none = np.eye(3)[:, :, None] - u[:, None] * u[None], skew(u), np.zeros((3, 3, x.T))
    K = np.concatenate([0.5 * _or_zero(x.load.width) / x.L * size * along * U, none])
    if not rubs.side:
        return x.place(_rows(none, A), D, speed, K)
    part = rubs.side / (_or_zero(x.load.length) / x.L)
    return x.place(_rows(-part * U, 0.5 * A + part * np.einsum("ijt,jkt->ikt", U, skew(p))), D, speed, K)


def _couple_of_guide(x: _Rubbing, rubs: Rubs) -> Place:
    """The moment about the axis of a guide, by two forces at its width."""
    (u, w, v), p = x.about(rubs), x.origin
    speed, about = np.hypot(x.r * w, v), _rows(u[None], cross(p, u)[None])
    return x.place(2 / np.abs(_or_zero(x.load.width) / x.L) * about, -x.mu(speed) * np.sign(v) * _force_at(p, u), speed)


_MAKERS = {
    "opening": _opening, "contact": _touching, "plane": _plane, "ball": _ball, "thread": _thread, "axis": _along,
    "couple": _couple_of_guide, "collar": _collar,
}  # fmt: skip
"""What makes a place of a pair, by the way in which it rubs."""


def _between_teeth(
    here: Configuration, load: Friction, dq: Array, at_rest: bool, lines: ContactLines, flank: Array
) -> Place:
    """Teeth on the flanks of signs ``(n, T)``: ``mu N`` against the sliding at the pitch point, or the couple ``mu N arm`` against the
    relative turn; with an efficiency as much of it as leaves that.
    """
    s, g = here.system, place_of_coupling(here.system.m, load)
    push, P = lines.push(g, flank)
    way = way_of(here.system.m, load)
    twist = _passed_by(here, dq, way)
    rounding, arm = MOTIONS.rounding * np.abs(twist).max(axis=0), mean_sliding(s.m, s.m.couplings[g])
    if arm is None:
        u, speed = _unit(twist[3:] + cross(twist[:3], P), rounding)
        U, arm = _force_at(P, u), 1.0
    else:
        u, turn = _unit(twist[:3], rounding)
        U, arm = _couple(u), arm / s.par.L
        speed = arm * turn
    if load.efficiency is None:
        part = arm * load.coefficient(s.par.L * speed, at_rest)
    else:
        part = _part_lost(load, U, twist, push, lines.screws(g))
    across = push[3:] / (push[3:] ** 2).sum(axis=0)
    A = np.concatenate([np.zeros((3, here.T)), across])[None]
    preload = np.broadcast_to(load.preload / s.par.L, here.T)
    return Place(load.of, len(s.m.pairs) + g, way, A, -part * U, np.zeros((6, 1, here.T)), preload, speed)


@dataclass(frozen=True)
class Grip:
    """What keeps bodies from sliding on each other where they touch, though they may roll: unit wrenches ``W (6, d, T)`` about the internal
    origin on the second of the ``links``, by number, which would pass through the pairs ``way``, in these senses. The rates of what slides
    are ``rows (d, F, T)`` times those of all freedoms. The place itself moves with the pair's link a and its freedoms ``before``, at ``at
    (3, T)``; of teeth, which stand still, there is none.
    """

    load: Friction
    links: tuple[int, int]
    way: tuple[tuple[int, float], ...]
    W: Array
    at: Array
    before: slice | None

    @classmethod
    def of(cls, here: Configuration, load: Friction) -> Grip:
        """Where a pair touches, the forces along its tangents; of teeth couples, or forces at the pitch point."""
        m, T = here.system.m, here.T
        way, none = way_of(m, load), np.zeros((here.system.n_freedoms, T))
        if load.of not in m.pair_index:
            g, directions = place_of_coupling(m, load), np.broadcast_to(np.eye(3)[:, :, None], (3, 3, T))
            gears = m.couplings[g].gears(m)
            links = m.link_index[gears[0]], m.link_index[gears[1]]
            if mean_sliding(m, m.couplings[g]) is not None:
                return cls(load, links, way, _couple(directions), np.zeros((3, T)), None)
            P = ContactLines(here).push(g, np.ones((len(m.couplings), T)))[1]
            return cls(load, links, way, _force_at(P[:, None], directions), P, None)
        x = _Rubbing(here, load, way[0][0], none, np.zeros((6, len(m.pairs), T)), True)
        frame, first = x.frame(x.touches_in), _freedoms(here, x.k).start
        row = x.row
        push = row.freedoms[row.gap].twist[3:] if row.gap is not None else next(iter(row.reactions or ())).wrench[3:]
        side = 1.0 if row.opens else pressing(row)
        along = int(np.argmax(np.abs(push)))
        n = side * push[along] * frame[:, along]
        at, tangents = frame[:, 3] - x.radius_b * n, np.delete(frame[:, :3], along, axis=1)
        links = m.link_index[x.pair.a], m.link_index[x.pair.b]
        return cls(load, links, way, _force_at(at[:, None], tangents), at, slice(first, first + x.touches_in))

    def rows(self, here: Configuration) -> Array:
        """Rates ``(d, F, T)`` of what slides for unit rates of the freedoms."""
        out = np.zeros((self.W.shape[1], here.system.n_freedoms, here.T))
        for k, sense in self.way:
            mine = _freedoms(here, k)
            out[:, mine] = sense * np.einsum("cdt,cft->dft", self.W, here.S[:, mine])
        return out

    def bias(self, at: Velocities) -> Array:
        """What sliding accelerates by ``(d, T)`` at constant rates at which nothing slides."""
        here, p = at.here, self.at
        out = np.einsum("cdt,ct->dt", self.W, sum(sense * at.bias[:, k] for k, sense in self.way))
        if self.before is not None:
            place = at.V[:, self.links[0]] + (here.S[:, self.before] * at.dq[self.before]).sum(axis=1)
            turn = _passed_by(here, at.dq, self.way)[:3]
            out += np.einsum("cdt,ct->dt", self.W[3:], cross(turn, place[3:] + cross(place[:3], p)))
        return np.asarray(out)

    def on_links(self, here: Configuration, sizes: Array) -> Array:
        """Wrenches ``(6, N, ..., T)`` on the links of forces of sizes ``(d, ..., T)``."""
        wrench = np.einsum("cdt,d...t->c...t", self.W, sizes)
        out = np.zeros((6, len(here.system.m.links), *wrench.shape[1:]))
        for link, sign in zip(self.links, (-1.0, 1.0), strict=True):
            out[:, link] += sign * wrench
        return out


def _part_lost(load: Friction, U: Array, twist: Array, push: Array, screws: tuple[Array, Array]) -> Array:
    """Size ``f (T,)`` of a friction wrench ``-f N U`` on gear b that leaves an efficiency of the power.

    The teeth move at the speed v along their line, ``V_b - V_a = v (Z_b / p_b - Z_a / p_a)`` for the screws Z of both gears against their
    carrier with powers p of a unit push on them. Power goes in at a where v is positive: ``eta = (1 - f c_b) / (1 + f c_a)``.
    """
    Za, Zb = (Z / (push * Z).sum(axis=0) for Z in screws)
    Q = Zb - Za
    sense = np.sign((twist * Q).sum(axis=0))
    ca, cb = -sense * (U * Za).sum(axis=0), sense * (U * Zb).sum(axis=0)
    eta: Any = load.efficiency
    room = np.where(sense > 0, cb + eta * ca, ca + eta * cb)
    if (room * np.abs(sense) < 0).any():
        fault = f"efficiency = {np.min(eta):g}: that little is lost in no teeth of a gear in a ring; expected more than one over the ratio"
        raise DeclarationError(load.where.removesuffix(": "), [fault])
    return np.asarray(np.where(room > 0, (1.0 - eta) / np.where(room > 0, room, 1.0), 0.0))


@dataclass(frozen=True)
class Rubbed:
    """Friction that came about: ``efforts (F, T)``, the part of the wrenches on links b that pairs on their way take up ``taken (6, P,
    T)``, the ``normals (m, T)``; ``outcome (T,)`` by its number and by how much friction would have to fall ``factor (T,)``.

    Of these, the efforts of ``teeth (F, T)``, what is ``beside (6, P, T)`` them, and their wrenches on gears b ``rubbing (6, n, T)``: they
    pass the pairs by. How the normal forces grow where the solution ends ``growth (m, T)``, ``speeds (m, T)`` of sliding and ``names``.
    Of what is not determined ``growth`` is that of the places that it concerns; ``ends (T,)`` says like ``outcome`` why it is not known
    between which efforts it rests.
    """

    efforts: Array
    taken: Array
    normals: Array
    outcome: Array
    factor: Array
    teeth: Array
    beside: Array
    rubbing: Array
    growth: Array
    speeds: Array
    names: tuple[str, ...]
    ends: Array

    def with_grip(self, here: Configuration, grip: Grip, sizes: Array) -> Rubbed:
        """With forces of sizes ``(d, T)`` that keep bodies from sliding beside it."""
        g = None if grip.load.of in here.system.m.pair_index else place_of_coupling(here.system.m, grip.load)
        wrench = np.einsum("cdt,dt->ct", grip.W, sizes)
        out = replace(self, **{name: getattr(self, name).copy() for name in _SUMS})
        out._pass(_passed_on(here, grip.way, wrench[:, None]), np.ones((1, here.T)), g is not None)
        if g is not None:
            out.rubbing[:, g] += wrench
        return out

    def _pass(self, parts: Passed, sizes: Array, teeth: bool) -> None:
        """Add wrenches of sizes ``(n, T)`` on their way."""
        for k, columns, own, held in parts:
            part = np.einsum("fnt,nt->ft", own, sizes), np.einsum("cnt,nt->ct", held, sizes)
            self.efforts[columns] += part[0]
            self.taken[:, k] += part[1]
            if teeth:
                self.teeth[columns] += part[0]
                self.beside[:, k] += part[1]


_SUMS = ("efforts", "taken", "teeth", "beside", "rubbing")
"""What is summed over all that rubs."""


def rubbed(here: Configuration, places: Sequence[Place], base: Array, unit: Mapping[int, Array]) -> Rubbed:
    """Solve for the normal forces; ``base (6, P, T)`` reactions without friction, ``unit`` those of a unit effort in freedoms, by column.

    Behind the reactions stand the forces on gears b, one a coupling, where teeth rub.
    """
    T = here.T
    starts = np.concatenate([[0], np.cumsum([len(place.A) for place in places])]).astype(np.intp)
    split = passed_on(here, places)
    preload = np.array([np.broadcast_to(place.preload, T) for place in places])
    a, B, C = (reading(places, each) for each in (base[:, :, None], *answers(split, base, unit)))
    a = a[:, 0] + np.einsum("dnt,nt->dt", B, preload)
    signed = [t for t, place in enumerate(places) if place.signed]
    C[:, starts[signed]] += B[:, signed]
    B[:, signed] = 0.0
    # what presses one way alone has passed infinity while friction grew: nothing holds it up, or it is two-valued
    over = np.linalg.det(np.eye(len(a)) - np.moveaxis(C, -1, 0)) <= 0.0 if signed else np.zeros(T, dtype=bool)
    n, V, outcome, factor, growth = _normals(a, B, np.where(over, 0.0, C), starts)
    outcome = np.where(
        over, np.where((V[starts[signed]] > 0.0).any(axis=0), Came.NO_FINITE_FORCE, Came.SEVERAL), outcome
    )
    n[signed] = V[starts[signed]]
    n, V = np.where(outcome > 0, np.nan, n) + preload, np.where(outcome > 0, np.nan, V)
    P, F = len(here.system.m.pairs), here.system.n_freedoms
    speeds, names = np.array([place.speed for place in places]), tuple(place.of for place in places)
    zeros = (np.zeros(shape) for shape in ((F, T), (6, P, T), (F, T), (6, P, T), (6, len(here.system.m.couplings), T)))
    sums = dict(zip(_SUMS, zeros, strict=True))
    out = Rubbed(
        normals=n, outcome=outcome, factor=factor, growth=growth, speeds=speeds, names=names, ends=0 * outcome, **sums
    )
    for t, place in enumerate(places):
        mine, teeth = V[starts[t] : starts[t + 1]], place.between_teeth(P)
        for parts, size in zip(split[t], (n[t : t + 1], mine), strict=True):
            out._pass(parts, size, teeth)
        if teeth:
            out.rubbing[:, place.reads - P] += place.D * n[t] + np.einsum("cdt,dt->ct", place.K, mine)
    return out


Passed = list[tuple[int, slice, Array, Array]]
"""For every pair that n wrenches pass: its place, its freedoms, efforts there ``(f, n, T)`` and what it takes up ``(6, n, T)``."""


def _passed_on(here: Configuration, way: tuple[tuple[int, float], ...], W: Array) -> Passed:
    """Wrenches on link b as efforts in the freedoms of the pairs on a way, and what is left, which these take up themselves."""
    out = []
    for k, sense in way:
        mine = _freedoms(here, k)
        efforts = sense * np.einsum("cft,cnt->fnt", here.S[:, mine], W)
        out.append((k, mine, efforts, sense * W - np.einsum("cft,fnt->cnt", here.E[:, mine], efforts)))
    return out


def passed_on(here: Configuration, places: Sequence[Place]) -> list[tuple[Passed, Passed]]:
    """What frictions of unit size, and those linear in the normal vectors, load on their way, of every place."""
    return [(_passed_on(here, place.way, place.D[:, None]), _passed_on(here, place.way, place.K)) for place in places]


def answers(split: Sequence[tuple[Passed, Passed]], like: Array, unit: Mapping[int, Array]) -> tuple[Array, Array]:
    """Wrenches ``(6, P, m, T)`` for frictions of unit size, and ``(6, P, d, T)`` for unit normal vectors, where those ``like (6, P, T)``
    are for a unit effort in freedoms ``unit``, by column.
    """
    both = []
    for kind in (0, 1):
        own = []
        for parts in (each[kind] for each in split):
            out = np.zeros((*like.shape[:2], parts[0][3].shape[1], like.shape[2]))
            for k, columns, efforts, held in parts:
                out[:, k] -= held
                for effort, column in zip(efforts, range(columns.start, columns.stop), strict=True):
                    out += unit[column][:, :, None] * effort
            own.append(out)
        both.append(np.concatenate(own, axis=2))
    return both[0], both[1]


def reading(places: Sequence[Place], wrenches: Array) -> Array:
    """Normal vectors ``(d, n, T)`` of all places under wrenches ``(6, P, n, T)``."""
    return np.concatenate([np.einsum("dct,cnt->dnt", place.A, wrenches[:, place.reads]) for place in places])


def _normals(a: Array, B: Array, C: Array, starts: Index) -> tuple[Array, Array, Array, Array, Array]:
    """Sizes ``n (m, T)`` and normal vectors of all places, outcomes and factors ``(T,)``, and how sizes grow where they end."""
    a, B, C = (np.moveaxis(part, -1, 0) for part in (a, B, C))
    m = B.shape[2]
    linear = np.linalg.solve(np.eye(a.shape[1]) - C, np.concatenate([a[..., None], B], axis=2))
    free, per = linear[..., 0], linear[..., 1:]
    sized = np.sqrt(np.add.reduceat(linear**2, starts[:-1], axis=1))
    alone = np.abs(np.linalg.eigvals(sized[..., 1:])).max(axis=1, initial=0.0) < 1.0
    n, done = sized[..., 0], np.zeros(len(a), dtype=bool)
    scale = np.abs(free).max(axis=1, initial=1e-300)
    for _ in range(60):
        V = free + np.einsum("tdn,tn->td", per, n)
        size = np.sqrt(np.add.reduceat(V * V, starts[:-1], axis=1))
        off = n - size
        done = np.abs(off).max(axis=1, initial=0.0) <= 1e-14 * np.maximum(scale, size.max(axis=1, initial=0.0))
        if (done | ~alone).all():
            break
        unit = V / np.repeat(np.where(size > 0, size, np.inf), np.diff(starts), axis=1)
        slope = np.add.reduceat(unit[..., None] * per, starts[:-1], axis=1)
        slope[~alone] = 0.0  # looked at one by one, below
        n = np.where(done[:, None], n, n - np.linalg.solve(np.eye(m) - slope, off[..., None])[..., 0])
    outcome, factor, growth = np.zeros(len(a), dtype=int), np.full(len(a), np.nan), np.zeros_like(n)
    for t in np.flatnonzero(~(done & alone)):
        n[t], outcome[t], factor[t], growth[t] = _grown(a[t], B[t], C[t], starts)
    V = free + np.einsum("tdn,tn->td", per, n)
    return n.T, V.T, outcome, factor, growth.T


def _newton(a: Array, B: Array, C: Array, starts: Index, k: float, n: Array) -> tuple[Array, bool]:
    """Newton's method on ``n - |V(n)|`` with friction times k, and whether it ends."""
    linear = np.asarray(np.linalg.solve(np.eye(len(a)) - k * C, np.column_stack([a, k * B])), dtype=float)
    free, per, scale = linear[:, 0], linear[:, 1:], max(float(np.abs(a).max(initial=0.0)), 1e-300)
    eye = np.eye(len(n))
    # near a solution it doubles its digits: what does not end soon is far from one
    for _ in range(20):
        V = free + per @ n
        size = np.add.reduceat(V * V, starts[:-1]) ** 0.5
        off = n - size
        if np.abs(off).max(initial=0.0) <= 1e-14 * max(scale, float(size.max(initial=0.0))):
            return size, True
        n = n - np.linalg.lstsq(eye - _slope(V, size, per, starts), off)[0]
        if not np.isfinite(n).all() or np.abs(n).max() > 1e12 * scale:
            return n, False
    return n, bool(np.abs(off).max() <= 1e-11 * max(scale, float(size.max(initial=0.0))))


def _slope(V: Array, size: Array, B: Array, starts: Index) -> Array:
    """``d|V| / dn``."""
    unit = V / np.where(size > 0, size, np.inf).repeat(np.diff(starts))
    return np.asarray(np.add.reduceat(unit[:, None] * B, starts[:-1], axis=0))


def _grown(a: Array, B: Array, C: Array, starts: Index) -> tuple[Array, int, float, Array]:
    """The solution that is connected with the frictionless one while friction grows; why there is none, at which part of it, and how sizes
    grow there.
    """
    n, _ = _newton(a, B, C, starts, 0.0, np.zeros(B.shape[1]))
    k, step, scale = 0.0, 1 / 16, max(float(np.abs(a).max(initial=0.0)), 1e-300)
    # how often a part is tried: bends that need more are not told from ends
    for _ in range(400):
        ahead = min(1.0, k + step)
        new, met = _newton(a, B, C, starts, ahead, n)
        near = np.abs(new - n).max() <= 0.5 * np.abs(new).max() or not new.any()
        if met and near and (new >= 0).all() and _rises(a, B, C, starts, ahead, new):
            k, n, step = ahead, new, min(2 * step, 1 / 16)
            if k == 1.0:
                several = _others(a, B, C, starts, n)
                return n, Came.SEVERAL if several else Came.OK, np.nan, np.full_like(n, several)
        else:
            step /= 2
        if step < 1e-9 or n.max() > 1e8 * scale:  # far below what tells friction from friction
            return _ended(a, B, C, starts, k, n)
    return n, Came.SEVERAL, np.nan, np.ones_like(n)


def _rises(a: Array, B: Array, C: Array, starts: Index, k: float, n: Array) -> bool:
    """Whether normal forces still grow with what presses: no fold, nor its other side."""
    inverse = np.linalg.inv(np.eye(len(a)) - k * C)
    V = inverse @ (a + k * B @ n)
    size = np.add.reduceat(V * V, starts[:-1]) ** 0.5
    return bool(np.linalg.det(np.eye(len(n)) - _slope(V, size, k * inverse @ B, starts)) > 0)


def _ended(a: Array, B: Array, C: Array, starts: Index, k: float, n: Array) -> tuple[Array, int, float, Array]:
    """Why the solution ends at a part ``k`` of the friction: without bound, where ``1 - k |V|'`` is singular along n, or a fold; the
    direction in which it is singular.
    """
    inverse = np.linalg.inv(np.eye(len(a)) - k * C)
    V = inverse @ (a + k * B @ n)
    size = np.add.reduceat(V * V, starts[:-1]) ** 0.5
    without_bound = float(n.max(initial=0.0)) > 1e5 * max(float(np.abs(a).max(initial=0.0)), 1e-300)
    slope = _slope(V, size, inverse @ B, starts)
    values, growth = np.linalg.eigvals(slope), np.abs(np.linalg.svd(np.eye(len(n)) - k * slope)[2][-1])
    real = values.real[(np.abs(values.imag) < 1e-6 * np.abs(values).max()) & (values.real > 0)]
    factor = 1.0 / float(real.max()) if without_bound and real.size and not C.any() else k
    return n, Came.JAMS if without_bound else Came.NO_FINITE_FORCE, factor, growth


def _others(a: Array, B: Array, C: Array, starts: Index, n: Array) -> bool:
    """Whether other solutions are there, sought over the signs of normal forces where all are numbers and few."""
    m = len(n)
    if (np.diff(starts) > 1).any() or m > 10:
        return False
    linear = np.linalg.solve(np.eye(m) - C, np.column_stack([a, B]))
    for signs in product((1.0, -1.0), repeat=m):
        s = np.array(signs)
        try:
            found = np.linalg.solve(np.diag(s) - linear[:, 1:], linear[:, 0])
        except np.linalg.LinAlgError:
            continue
        if (found >= 0).all() and np.abs(found - n).max() > 1e-9 * max(np.abs(n).max(), 1e-300):
            return True
    return False
