"""Passive freedoms at rest: links that could spin or slide idly are kept from doing so, in space.

A passive motion moves one body (a cluster of links) and nothing else, so it can be stopped in many ways. Here the body itself is
at rest in it: its twist has no part along the passive twist ``u`` (for the coupler between two spheres, no spin about
their line: ``w . u = 0``, hence ``alpha . u = 0``). No choice of a coordinate enters, and a body that is symmetric about its
line needs no effort to be held so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mechgraph.algebra.se3 import Array, cross, rotate, rotate_back
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.driver_path import DriverPath, Positions, Status, in_blocks
from mechgraph.closure.indexing import Index
from mechgraph.numerics.continuation import Follower
from mechgraph.numerics.hermite import Interpolation
from mechgraph.numerics.tracks import Nodes

TURNING = 1e-6
"""Part of a unit motion from which on a body takes part in it."""


@dataclass(frozen=True)
class Idle:
    """A body with passive freedoms, by one of its links."""

    link: int


def rest_points(here: Configuration, idle: tuple[Idle, ...], Z: Array) -> list[Array]:
    """For every body the point ``(3, T)`` of it whose velocity counts, fixed in the body.

    On the axis where one passive turn is all it has (the foot from the origin of the link), so that only the spin counts; else
    the origin of the link.
    """
    twists = [here.link_twists(Z[:, i]) for i in range(Z.shape[1])]
    out = []
    for body in idle:
        origin = here.poses[:, 3, body.link]
        mine = [V[:, body.link] for V in twists if np.abs(V[:, body.link]).max() > TURNING]
        point = origin
        if len(mine) == 1 and (np.abs(mine[0][:3]).max(axis=0) > TURNING).all():
            w, v = mine[0][:3], mine[0][3:] + cross(mine[0][:3], origin)
            point = origin + cross(w, v) / (w * w).sum(axis=0)
        out.append(point)
    return out


def body_twists(idle: tuple[Idle, ...], points: list[Array], V: Array) -> Array:
    """Angular velocity and velocity of the rest point of every body, stacked ``(6 bodies, T)``."""
    out = []
    for body, P in zip(idle, points, strict=True):
        twist = V[:, body.link]
        out += [twist[:3], twist[3:] + cross(twist[:3], P)]
    return np.concatenate(out)


def passive_twists(here: Configuration, idle: tuple[Idle, ...], points: list[Array], Z: Array) -> Array:
    """``body_twists`` of all passive motions ``Z (F, p, T)``: ``(6 bodies, p, T)``."""
    return np.stack([body_twists(idle, points, here.link_twists(Z[:, i])) for i in range(Z.shape[1])], axis=1)


def resting_part(G: Array, b: Array) -> Array:
    """Multiples ``(p, T)`` of the passive motions that take the part along them out of ``b``: ``-(G^T G)^-1 G^T b``."""
    A = np.einsum("ipt,iqt->tpq", G, G)
    return -np.linalg.solve(A, np.einsum("ipt,it->tp", G, b)[..., None])[..., 0].T


def turning_part(idle: tuple[Idle, ...], points: list[Array], V: Array, G: Array) -> Array:
    """Change of the passive twists, which turn with their bodies, in the condition of rest: ``(w x d) . v``, ``(p, T)``."""
    out = np.zeros(G.shape[1:])
    now = body_twists(idle, points, V)
    for i in range(len(idle)):
        w, v = now[6 * i : 6 * i + 3], now[6 * i + 3 : 6 * i + 6]
        for p in range(G.shape[1]):
            out[p] += (cross(w, G[6 * i + 3 : 6 * i + 6, p]) * v).sum(axis=0)
    return out


def body_accelerations(idle: tuple[Idle, ...], points: list[Array], V: Array, A: Array) -> Array:
    """Angular acceleration and acceleration of the rest point of every body, ``(6 bodies, T)``."""
    out = []
    for body, P in zip(idle, points, strict=True):
        w, alpha = V[:3, body.link], A[:3, body.link]
        velocity = V[3:, body.link] + cross(w, P)
        out += [alpha, A[3:, body.link] + cross(alpha, P) + cross(w, velocity)]
    return np.concatenate(out)


GAUSS = 8
"""Points of Gauss and Legendre a step between nodes: what is integrated over it is exact to rounding."""
MOST_TURNS = 8
"""Most repetitions of the turn that takes the spin out."""
UNTURNED = 1e-13
"""Angle that is rounding."""


def unspun(path: DriverPath, found: Positions, bodies: tuple[Idle, ...]) -> Positions:
    """The same positions with passive bodies not spinning on the way from the start.

    Along a track some freedom of every passive body is held, so that the body turns about its axis ``u`` by an angle of no meaning. Where
    it is when it never spins (``w . u = 0``) follows from the way of the axis alone: a vector across it is carried parallel along
    ``u(s)``. Against the part ``n`` across ``u`` of a fixed vector ``e`` it turns by ``-integral n' . (u x n) ds``, taken by Gauss and
    Legendre's rule in every step between nodes, so that it does not hang on which positions were asked for. Bodies with more than one
    passive motion are left as they are. Source: Bishop, There is more than one way to frame a curve, Amer. Math. Monthly 82, 1975.
    """
    nodes, good = found.tracks.nodes, np.flatnonzero((found.status == Status.OK) & (found.near < 0))
    interpolation = Interpolation(path, nodes)
    if not len(interpolation.left) or not good.size:
        return found
    carried = _Carried(path, interpolation, found.follower, bodies)
    x = found.x.copy()
    turns = np.zeros(found.x.shape[1], dtype=np.intp) if found.turns is None else found.turns
    for at in in_blocks(good):
        x[:, at] = carried.turned(found.x[:, at], found.which[at], found.track[at], found.place[at], turns[at])
    turned = carried.turned_nodes(nodes)
    tracks = replace(found.tracks, nodes=replace(nodes, x=turned))
    crossings = [replace(c, sides=replace(c.sides, x=carried.turned_nodes(c.sides))) for c in found.crossings]
    spin = None if found.turns is None else carried.spin(tracks.nodes)
    return replace(found, x=x, here=None, tracks=tracks, crossings=crossings, spin=spin)


class _Carried:
    """Vectors across the axes of passive bodies, carried parallel along tracks."""

    def __init__(
        self, path: DriverPath, interpolation: Interpolation, follower: Follower, bodies: tuple[Idle, ...]
    ) -> None:
        self.path, self.interpolation, self.follower, self.bodies = path, interpolation, follower, bodies
        nodes, left = interpolation.nodes, interpolation.left
        self._h = nodes.place[interpolation.right] - nodes.place[left]
        self._starts = np.searchsorted(nodes.track, nodes.track[left])
        self._at_nodes = path.at(nodes.x, nodes.drive, nodes.track)
        f = path.factored(self._at_nodes, nodes.which)
        axes, _, _ = _axes(self._at_nodes, bodies, f.motions())
        points, weights = np.polynomial.legendre.leggauss(GAUSS)
        self._to_series = (
            weights[:, None] * np.polynomial.legendre.legvander(points, GAUSS - 1) * (np.arange(GAUSS) + 0.5)
        )
        here, rates = self._between(0.5 * (points + 1.0))
        w = here.link_twists(rates)[:3]
        self._bodies = [
            None if axis is None else self._carry(body.link, axis[:, self._starts], here, w[:, body.link])
            for body, axis in zip(bodies, axes, strict=True)
        ]

    def _between(self, parts: Array) -> tuple[Configuration, Array]:
        """States and rates at parts of all steps."""
        nodes, left = self.interpolation.nodes, self.interpolation.left
        step = np.repeat(np.arange(len(left)), len(parts))
        place = nodes.place[left][step] + np.tile(parts, len(left)) * self._h[step]
        track, which = nodes.track[left][step], nodes.which[left][step]
        drive = self.follower.paths.drive(track, place)
        closed = self.follower.newton.close(self.interpolation(step, place, drive), drive, track, which)
        here = self.path.at(closed.x, drive, track)
        rates = self.path.factored(here, closed.which).sensitivity() * self.interpolation.slope[:, step]
        return here, rates.sum(axis=1)

    def _carry(self, link: int, axis: Array, here: Configuration, w: Array) -> _Body:
        """The vector of one body carried along all steps; ``axis (3, steps)`` where the track of each step starts."""
        R = self._at_nodes.poses[:, :3, link]
        body_axis = rotate_back(R[:, :, self._starts], axis)
        across = _perpendicular(body_axis)
        left, right = (rotate(R[:, :, at], body_axis) for at in (self.interpolation.left, self.interpolation.right))
        e = _perpendicular(left)
        u = rotate(here.poses[:, :3, link], np.repeat(body_axis, GAUSS, axis=1))
        n, length = _across(np.repeat(e, GAUSS, axis=1), u)
        rate = -(np.repeat(e, GAUSS, axis=1) * u).sum(axis=0) * (cross(w, u) * cross(u, n)).sum(axis=0) / length
        series = -self._h[:, None] * (rate.reshape(-1, GAUSS) @ self._to_series)
        # from the reference vector of a step to that of the next, at the node between them
        end, _ = _across(e, right)
        turn = np.zeros(len(series))
        turn[1:] = _angle(e[:, 1:], end[:, :-1], left[:, 1:]) + series[:-1, 0]
        track = self.interpolation.nodes.track[self.interpolation.left]
        first = np.concatenate([[True], track[1:] != track[:-1]])
        at_start = _angle(e, rotate(R[:, :, self._starts], across), left)
        turn[first] = at_start[first]
        total = np.cumsum(turn)
        begin = (total - turn)[np.flatnonzero(first)][np.cumsum(first) - 1]
        # a track that comes back to where it starts comes back with the vector turned
        after = total - begin + series[:, 0] - _angle(end, rotate(R[:, :, self._starts], across), right)
        last = np.flatnonzero(np.append(first[1:], True))
        return _Body(body_axis, across, e, total - begin, series, after[last][np.cumsum(first) - 1])

    def turned(self, x: Array, which: Index, track: Index, place: Array, turns: Index | None = None) -> Array:
        """States with every body turned to where it stands when it does not spin, ``turns`` periods of the track later."""
        for _ in range(MOST_TURNS):
            angles, dq = self._turn(x, which, track, place, turns)
            if np.abs(angles).max(initial=0.0) < UNTURNED:
                break
            # exact where the rates of the turn are constant (ball joints, hinges); over a plane it comes nearer with every repetition
            x = self.follower.newton.close(self.path.advance(x, dq, track), x[self.path.rows], track, which).x
        return x

    def turned_nodes(self, nodes: Nodes) -> Array:
        """States of nodes on the tracks."""
        return self.turned(nodes.x, nodes.which, nodes.track, nodes.place)

    def spin(self, nodes: Nodes) -> Array:
        """Increments ``(F, nodes)`` from nodes to one period later."""
        return self._turn(nodes.x, nodes.which, nodes.track, nodes.place, np.ones(len(nodes), dtype=np.intp))[1]

    def _turn(
        self, x: Array, which: Index, track: Index, place: Array, turns: Index | None = None
    ) -> tuple[Array, Array]:
        """Angles ``(turns, n)`` that are missing, and the increments ``(F, n)`` that turn by them.

        Links that one passive motion turns share an angle: the mean, as at rest their mean spin vanishes (welded ones have the same).
        """
        nodes = self.interpolation.nodes
        tracks = nodes.track[self.interpolation.left]
        moved = np.isin(track, tracks)
        step = self.interpolation.find(np.where(moved, track, tracks[0]), place)
        here = self.path.at(x, x[self.path.rows], track)
        Z = self.path.factored(here, which).motions()
        axes, numbers, unit = _axes(here, self.bodies, Z)
        integrals = _integrals(2.0 * (place - nodes.place[self.interpolation.left[step]]) / self._h[step] - 1.0)
        shared: dict[int, list[Array]] = {}
        dq = np.zeros((Z.shape[0], x.shape[1]))
        for body, known, axis, number in zip(self.bodies, self._bodies, axes, numbers, strict=True):
            if known is None or axis is None:
                continue
            R = here.poses[:, :3, body.link]
            u = rotate(R, known.axis[:, step])
            n, _ = _across(known.e[:, step], u)
            angle = known.turn[step] + (known.series[step] * integrals).sum(axis=1)
            angle = angle - _angle(n, rotate(R, known.across[:, step]), u)
            if turns is not None:
                angle = angle + turns * known.period[step]
            angle = np.sign((axis * u).sum(axis=0)) * np.where(moved, angle, 0.0)
            shared.setdefault(number, []).append(angle)
        angles = {
            number: _wrapped(some[0] + np.mean([_wrapped(a - some[0]) for a in some], axis=0))
            for number, some in shared.items()
        }
        for number, angle in angles.items():
            dq += unit[number] * angle
        return np.array(list(angles.values())), dq


@dataclass(frozen=True)
class _Body:
    """One passive body along all steps, ``(3, steps)`` and ``(steps,)``.

    ``axis`` and a vector ``across`` it in the body's own frame; the reference ``e`` of every step, the angle ``turn`` of the carried
    vector against it where the step begins, the Legendre ``series`` of its further turning, and by how much it is turned after the whole
    track, where that is a ``period``.
    """

    axis: Array
    across: Array
    e: Array
    turn: Array
    series: Array
    period: Array


def _integrals(t: Array) -> Array:
    """Half the integrals of Legendre's polynomials from -1 to ``t (n,)``, ``(n, GAUSS)``."""
    P = np.polynomial.legendre.legvander(t, GAUSS)
    out = np.empty((len(t), GAUSS))
    out[:, 0] = 0.5 * (t + 1.0)
    k = np.arange(1, GAUSS)
    out[:, 1:] = 0.5 * (P[:, 2:] - P[:, : GAUSS - 1]) / (2 * k + 1)
    return out


def _perpendicular(u: Array) -> Array:
    """Unit vectors across unit vectors ``(3, n)``: of the global axis least aligned with each."""
    e = np.eye(3)[:, np.argmin(np.abs(u), axis=0)]
    return _across(e, u)[0]


def _across(e: Array, u: Array) -> tuple[Array, Array]:
    """The parts of ``e`` across unit vectors ``u``, of unit length, and their lengths."""
    r = e - (e * u).sum(axis=0) * u
    length = np.sqrt((r * r).sum(axis=0))
    return r / length, length


def _angle(a: Array, b: Array, u: Array) -> Array:
    """Angles from ``a`` to ``b`` about ``u`` (all across ``u``), ``(n,)``."""
    return np.arctan2((cross(a, b) * u).sum(axis=0), (a * b).sum(axis=0))


def _wrapped(angle: Array) -> Array:
    """Angles in [-pi, pi)."""
    return np.remainder(angle + np.pi, 2 * np.pi) - np.pi


def _axes(
    here: Configuration, bodies: tuple[Idle, ...], Z: Array
) -> tuple[list[Array | None], list[int], dict[int, Array]]:
    """For every body that has one passive turn its axis ``(3, T)``, else None, and the number of that motion.

    By number the rates ``(F, T)`` that turn by one radian.
    """
    G = passive_twists(here, bodies, rest_points(here, bodies, Z), Z)
    axes: list[Array | None] = []
    numbers: list[int] = []
    units: dict[int, Array] = {}
    for i in range(len(bodies)):
        mine = [p for p in range(Z.shape[1]) if np.abs(G[6 * i : 6 * i + 6, p]).max() > TURNING]
        u = G[6 * i : 6 * i + 3, mine[0]] if len(mine) == 1 else np.zeros((3, here.T))
        length = np.sqrt((u * u).sum(axis=0))
        turns = len(mine) == 1 and bool((length > TURNING).all())
        axes.append(u / length if turns else None)
        numbers.append(mine[0] if mine else -1)
        if turns:
            units[mine[0]] = Z[:, mine[0]] / length
    return axes, numbers, units
