"""Passive freedoms at rest: links that could spin or slide idly are kept from doing so, in space.

A passive motion moves one body (a cluster of links) and nothing else, so it can be stopped in many ways. Here the body itself is
at rest in it: its twist has no part along the passive twist ``u`` (for the coupler between two spheres, no spin about
their line: ``w . u = 0``, hence ``alpha . u = 0``). No choice of a coordinate enters, and a body that is symmetric about its
line needs no effort to be held so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from mechgraph.algebra.se3 import Array, cross
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.driver_path import DriverPath, Positions, Status
from mechgraph.closure.indexing import Index
from mechgraph.numerics.continuation import Follower
from mechgraph.numerics.hermite import Interpolation


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
        mine = [V[:, body.link] for V in twists if np.abs(V[:, body.link]).max() > 1e-6]
        point = origin
        if len(mine) == 1 and (np.abs(mine[0][:3]).max(axis=0) > 1e-6).all():
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
"""Points of Gauss and Legendre a step between nodes: the spin integrated over it is exact to rounding."""
TURNING = 1e-6
"""Part of a unit motion from which on a body takes part in it."""


def unspun(path: DriverPath, found: Positions, bodies: tuple[Idle, ...]) -> Positions:
    """The same positions with passive bodies not spinning on the way from the start.

    The nodes hold some freedom of every passive body, which turns it along the way by some spin. The angle by which it has to be turned
    back is the integral of that spin over the track, taken by Gauss and Legendre's rule in every step between nodes, so that it does not
    hang on which positions were asked for. Bodies with more than one passive motion are left as they are.
    """
    nodes, good = found.tracks.nodes, np.flatnonzero(found.status == Status.OK)
    interpolation = Interpolation(path, nodes)
    if not len(interpolation.left) or not good.size:
        return found
    spins = _Spins(path, interpolation, found.follower, bodies)
    x = found.x.copy()
    x[:, good] = spins.turned_back(found.x[:, good], found.which[good], found.track[good], found.place[good])
    turned = spins.turned_back(nodes.x, nodes.which, nodes.track, nodes.place)
    tracks = replace(found.tracks, nodes=replace(nodes, x=turned))
    return replace(found, x=x, here=None, tracks=tracks)


class _Spins:
    """Spin of passive bodies along tracks: rates at Gauss points, integrals up to any place."""

    def __init__(
        self, path: DriverPath, interpolation: Interpolation, follower: Follower, bodies: tuple[Idle, ...]
    ) -> None:
        self.path, self.interpolation, self.follower, self.bodies = path, interpolation, follower, bodies
        nodes, left = interpolation.nodes, interpolation.left
        points, self._weights = np.polynomial.legendre.leggauss(GAUSS)
        self._h = nodes.place[interpolation.right] - nodes.place[left]
        step = np.repeat(np.arange(len(left)), GAUSS)
        place = nodes.place[left][step] + np.tile(0.5 * (points + 1.0), len(left)) * self._h[step]
        track = nodes.track[left][step]
        drive = follower.paths.drive(track, place)
        closed = follower.newton.close(interpolation(step, place, drive), drive, track, nodes.which[left][step])
        here = path.at(closed.x, drive, track)
        f = path.factored(here, closed.which)
        self._new_track = np.concatenate([[True], np.diff(track) != 0])
        axes, _ = _axes(here, bodies, f.motions())
        rates = (f.sensitivity() * interpolation.slope[:, step]).sum(axis=1)
        w = here.link_twists(rates)[:3]
        legendre = np.polynomial.legendre.legvander(points, GAUSS - 1) * (np.arange(GAUSS) + 0.5)
        self.axis: list[Array | None] = []
        self._series: list[Array] = []
        self._before: list[Array] = []
        first = np.concatenate([[True], np.diff(nodes.track[left]) != 0])
        for body, axis in zip(bodies, axes, strict=True):
            if axis is None:
                self.axis.append(None)
                self._series.append(np.zeros((0, 0)))
                self._before.append(np.zeros(0))
                continue
            axis = axis * self._senses(axis)
            spin = -(w[:, body.link] * axis).sum(axis=0).reshape(-1, GAUSS)
            series = (spin * self._weights) @ legendre
            whole = self._h * series[:, 0]
            total = np.cumsum(whole) - whole
            begin = total[np.flatnonzero(first)][np.cumsum(first) - 1]
            self.axis.append(axis)
            self._series.append(series)
            self._before.append(total - begin)

    def _senses(self, axis: Array) -> Array:
        """Signs with which an axis does not flip along its track."""
        along = (axis[:, 1:] * axis[:, :-1]).sum(axis=0)
        flips = np.concatenate([[1.0], np.where(along < 0, -1.0, 1.0)])
        flips[self._new_track] = 1.0
        product = np.cumprod(flips)
        return product * product[np.flatnonzero(self._new_track)][np.cumsum(self._new_track) - 1]

    def turned_back(self, x: Array, which: Index, track: Index, place: Array) -> Array:
        """States with every body turned back by the integral of its spin up to their places."""
        nodes = self.interpolation.nodes
        has_step = np.isin(track, nodes.track[self.interpolation.left])
        step = self.interpolation.find(np.where(has_step, track, nodes.track[self.interpolation.left[0]]), place)
        drive = x[self.path.rows]
        here = self.path.at(x, drive, track)
        f = self.path.factored(here, which)
        Z = f.motions()
        axes, unit = _axes(here, self.bodies, Z)
        t = 2.0 * (place - nodes.place[self.interpolation.left[step]]) / self._h[step] - 1.0
        P = np.polynomial.legendre.legvander(t, GAUSS)
        integrals = np.empty((len(t), GAUSS))
        integrals[:, 0] = 0.5 * (t + 1.0)
        for k in range(1, GAUSS):
            integrals[:, k] = 0.5 * (P[:, k + 1] - P[:, k - 1]) / (2 * k + 1)
        dq = np.zeros((Z.shape[0], x.shape[1]))
        for i, axis in enumerate(axes):
            known = self.axis[i]
            if axis is None or known is None:
                continue
            angle = self._before[i][step] + self._h[step] * (self._series[i][step] * integrals).sum(axis=1)
            sense = np.sign((axis * known[:, step * GAUSS]).sum(axis=0))
            dq += unit[i] * np.where(has_step, sense * angle, 0.0)
        turned = self.path.advance(x, dq, track)
        return self.follower.newton.close(turned, drive, track, which).x


def _axes(here: Configuration, bodies: tuple[Idle, ...], Z: Array) -> tuple[list[Array | None], list[Array]]:
    """For every body that has one passive turn its axis ``(3, T)`` and the rates ``(F, T)`` that turn it by one radian; else None."""
    G = passive_twists(here, bodies, rest_points(here, bodies, Z), Z)
    axes: list[Array | None] = []
    units: list[Array] = []
    for i in range(len(bodies)):
        mine = [p for p in range(Z.shape[1]) if np.abs(G[6 * i : 6 * i + 6, p]).max() > TURNING]
        u = G[6 * i : 6 * i + 3, mine[0]] if len(mine) == 1 else np.zeros((3, here.T))
        length = np.sqrt((u * u).sum(axis=0))
        turns = len(mine) == 1 and bool((length > TURNING).all())
        axes.append(u / length if turns else None)
        units.append(Z[:, mine[0]] / length if turns else np.zeros((Z.shape[0], here.T)))
    return axes, units


def hold(here: Configuration, idle: tuple[Idle, ...], Z: Array, loads: Array, efforts: Array) -> tuple[Array, Array]:
    """What keeps passive bodies at rest: wrenches ``(6, N, T)`` on them, and their sizes ``(p, T)`` for unit passive twists.

    Along every passive motion the power of loads, given efforts and hold vanishes. The hold of a turn is a couple about its
    axis, that of a slide a force along it, so that it loads no pair of the body; it comes from outside the mechanism.
    """
    points = rest_points(here, idle, Z)
    G = passive_twists(here, idle, points, Z)
    wrenches = np.zeros_like(loads)
    sizes = np.zeros(Z.shape[1:])
    for p in range(Z.shape[1]):
        sizes[p] = -(loads * here.link_twists(Z[:, p])).sum(axis=(0, 1)) - (efforts * Z[:, p]).sum(axis=0)
    dual = np.einsum("ipt,tpq->iqt", G, np.linalg.inv(np.einsum("ipt,iqt->tpq", G, G)))
    held = np.einsum("iqt,qt->it", dual, sizes)
    for i, (body, P) in enumerate(zip(idle, points, strict=True)):
        moment, force = held[6 * i : 6 * i + 3], held[6 * i + 3 : 6 * i + 6]
        wrenches[3:, body.link] += force
        wrenches[:3, body.link] += moment + cross(P, force)
    for p in range(Z.shape[1]):
        axis, length = _leading_part(G[:, p])
        flips = np.where((axis[:, 1:] * axis[:, :-1]).sum(axis=0) < 0, -1.0, 1.0)
        sizes[p] *= np.cumprod(np.concatenate([np.ones(here.T)[:1], flips])) / length
    return wrenches, sizes


def _leading_part(twists: Array) -> tuple[Array, Array]:
    """Of the stacked twists ``(6 bodies, T)`` of one passive motion a turn, or where there is none a slide; with its length."""
    parts = twists.reshape(-1, 3, twists.shape[1])
    lengths = np.sqrt((parts * parts).sum(axis=1))
    turns = [i for i in range(0, len(parts), 2) if (lengths[i] > 1e-6).all()]
    slides = [i for i in range(1, len(parts), 2) if (lengths[i] > 1e-6).all()]
    i = (turns or slides or [0])[0]
    return parts[i], np.maximum(lengths[i], 1e-300)


def hold_names(here: Configuration, idle: tuple[Idle, ...], Z: Array) -> list[tuple[str, bool]]:
    """For every passive motion the name of its body (numbered where it has several) and whether it turns."""
    links = here.system.m.link_names()
    twists = [here.link_twists(Z[:, p]) for p in range(Z.shape[1])]
    out: list[tuple[str, bool]] = []
    for V in twists:
        moving = next((b for b in idle if np.abs(V[:, b.link]).max(initial=0.0) > 1e-6), idle[0])
        turns = bool((np.abs(V[:3, moving.link]).max(axis=0) > 1e-6).all())
        name = links[moving.link]
        count = sum(n.split(" (")[0] == name for n, _ in out)
        out.append((f"{name} ({count + 1})" if count else name, turns))
    return out
