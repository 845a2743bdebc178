"""Rods between spheres at rest in their spin, along the path of the reduced form (see ``closure.reduction``).

A rod at rest in its spin turns with its axis ``u`` alone, ``w = u x u'``. From ``R_0`` where a step begins, with the axis ``a`` there,

    R = exp(phi u) M R_0,   M the least rotation from a to u,   phi' = (a x u) . u' / (1 + a . u),

since ``M`` turns about ``u`` at the rate ``-phi'``. ``phi`` is integrated by Gauss and Legendre's rule in every step between nodes, so that
it does not hang on which positions were asked for.
Source: Bishop, There is more than one way to frame a curve, Amer. Math. Monthly 82, 1975.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import Array, cross, rotation_exp, skew
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.driver_path import BLOCK, DriverPath, in_blocks
from mechgraph.closure.indexing import Index
from mechgraph.closure.passive_rest import at_points
from mechgraph.closure.reduction import ReducedSystem
from mechgraph.numerics.continuation import Follower
from mechgraph.numerics.hermite import Interpolation
from mechgraph.numerics.legendre import Rule
from mechgraph.numerics.tolerances import PATH

NARROW = 0.2
"""Least ``1 + a . u`` of a step: an axis may turn by 140 degrees in it, far more than steps of fair size allow."""


@dataclass(frozen=True)
class _Steps:
    """Of rods in all steps: axes ``a (3, rods, n)`` and rotations ``R (3, 3, rods, n)`` where they begin, ``series (points, rods, n)`` of
    ``phi`` by a ``rule``.
    """

    rule: Rule
    a: Array
    R: Array
    series: Array

    def at(self, u: Array, step: Index, t: Array) -> Array:
        """Rotations ``(3, 3, rods, n)`` in steps at ``t`` from -1 to 1, where the axes are ``u (3, rods, n)``."""
        phi = np.einsum("grn,ng->rn", self.series[:, :, step], self.rule.integrals(t))
        return _product(_product(rotation_exp(phi * u), _least(self.a[:, :, step], u)), self.R[..., step])


class Rods:
    """The rods of a reduced form along the nodes of its tracks; ``R_0 (3, 3, rods, tracks)`` are the rotations where the tracks begin.

    ``clear``: whether the loops close all along, and all steps are so short that no axis comes near the opposite of where it was.
    """

    def __init__(
        self, path: DriverPath, follower: Follower, interpolation: Interpolation, rule: Rule, R_0: Array
    ) -> None:
        self._nodes, self._left, self._first = interpolation.nodes, interpolation.left, R_0
        nodes, left, right = interpolation.nodes, interpolation.left, interpolation.right
        self._h = nodes.place[right] - nodes.place[left]
        self._find, self._last, self._ends = interpolation.find, interpolation.last, follower.paths.end
        self.axes = axes(path.at(nodes.x, nodes.drive, nodes.track))[0]
        a, b = self.axes[:, :, left], self.axes[:, :, right]
        u, du, closed = _between(path, follower, interpolation, rule, self.axes[:, :, :0])
        many = np.repeat(a, rule.count, axis=2)
        wide = 1.0 + (many * u).sum(axis=0)
        self.clear = closed and bool(min(wide.min(initial=2.0), (1.0 + (a * b).sum(axis=0)).min(initial=2.0)) > NARROW)
        rate = (cross(many, u) * du).sum(axis=0) / wide
        series = np.einsum("rsg,gk,s->krs", rate.reshape(len(rate), len(left), rule.count), rule.to_series, self._h)
        over = _Steps(rule, a, np.broadcast_to(np.eye(3)[:, :, None, None], (3, 3, *a.shape[1:])), series)
        self._steps = _Steps(rule, a, self._begins(over.at(b, np.arange(len(left)), np.ones(len(left)))), series)

    def _begins(self, over: Array) -> Array:
        """Rotations where all steps begin, from those ``over (3, 3, rods, steps)`` each of them; backwards before the starts."""
        track, place = self._nodes.track[self._left], self._nodes.place[self._left]
        out = np.empty_like(over)
        turns = np.moveaxis(over, (0, 1), (-2, -1))
        R = np.moveaxis(self._first, (0, 1), (-2, -1))
        now = R[:, 0]
        for k in np.flatnonzero(place >= 0.0):
            if place[k] == 0.0:
                now = R[:, track[k]]
            out[:, :, :, k] = np.moveaxis(now, 0, -1)
            now = turns[:, k] @ now
        for k in np.flatnonzero(place < 0.0)[::-1]:
            if place[k + 1] == 0.0:
                now = R[:, track[k]]
            now = turns[:, k].swapaxes(-1, -2) @ now
            out[:, :, :, k] = np.moveaxis(now, 0, -1)
        return out

    def at(self, here: Configuration, track: Index, place: Array, turns: Index | int = 0) -> Array:
        """Rotations ``(3, 3, rods, n)`` at closed states of the reduced form, which lie at places of tracks, ``turns`` periods later."""
        u, moved = axes(here)[0], np.isin(track, self._nodes.track[self._left])
        out = self._first[..., track].copy()
        if moved.any():
            step = self._find(track[moved], place[moved])
            t = 2.0 * (place[moved] - self._nodes.place[self._left[step]]) / self._h[step] - 1.0
            out[..., moved] = self._steps.at(u[:, :, moved], step, t)
        if np.any(turns):
            out = _product(rotation_exp(turns * self.period[:, track] * u), out)
        return out

    @property
    def period(self) -> Array:
        """Angles ``(rods, tracks)`` by which rods are turned about their axes at the end of tracks that come back to where they start."""
        track = np.unique(self._nodes.track[self._left])
        out = np.zeros(self._first.shape[2:])
        last = self._last(track, self._ends) if len(track) else track
        u = self.axes[:, :, self._left[last] + 1]
        end, start = self._steps.at(u, last, np.ones(len(last))), self._first[..., track]
        turned = _product(end, np.swapaxes(start, 0, 1))
        sine = 0.5 * (
            np.array([turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]) * u
        ).sum(axis=0)
        out[:, track] = np.arctan2(sine, 0.5 * (np.trace(turned) - 1.0))
        return out


def _between(
    path: DriverPath, follower: Follower, interpolation: Interpolation, rule: Rule, nothing: Array
) -> tuple[Array, Array, bool]:
    """Axes and their rates ``(3, rods, steps points)`` at the points of a rule in all steps, and whether all closed there."""
    found, count, done = [(nothing, nothing)], len(interpolation.left), True
    for steps in in_blocks(np.arange(count), BLOCK // rule.count) if count else []:
        closed, track, slope = at_points(interpolation, follower, rule, steps)
        here = path.at(closed.x, closed.x[path.rows], track)
        dq = (path.factored(here, closed.which).sensitivity() * slope).sum(axis=1)
        found.append(axes(here, dq))
        done &= bool((closed.done & (closed.correction <= PATH.correction)).all())
    u, du = (np.concatenate(part, axis=2) for part in zip(*found, strict=True))
    return u, du, done


def axes(here: Configuration, dq: Array | None = None) -> tuple[Array, Array]:
    """Axes ``u (3, rods, T)`` of the rods of a reduced form, and their rates for rates ``dq (F, T)``."""
    assert isinstance(here.system, ReducedSystem)
    points = here.system.points
    k = points.numbers
    u = points.lines(here)[1][3:, : len(k.length)]
    if dq is None:
        return u, np.zeros_like(u)
    V, ends = here.link_twists(dq), []
    for links, at in ((k.a, k.at_a), (k.b, k.at_b)):
        mine = slice(len(k.length))
        X, twist = here.poses[:, :, links[mine]], V[:, links[mine]]
        p = np.einsum("ijnt,jnt->int", X[:, :3], np.broadcast_to(at[:, mine], (3, len(k.length), here.T))) + X[:, 3]
        ends.append(twist[3:] + cross(twist[:3], p))
    d = ends[1] - ends[0]
    return u, (d - (d * u).sum(axis=0) * u) / points.lengths(here)


def _least(a: Array, u: Array) -> Array:
    """The least rotations ``(3, 3, ...)`` from unit vectors to others: ``1 + W + W^2 / (1 + a . u)``, ``W = (a x u)^``."""
    W = skew(cross(a, u))
    return np.eye(3).reshape(3, 3, *(1,) * (a.ndim - 1)) + W + _product(W, W) / (1.0 + (a * u).sum(axis=0))


def _product(A: Array, B: Array) -> Array:
    """Products of matrices ``(3, 3, ...)``."""
    return np.asarray(np.einsum("ij...,jk...->ik...", A, B))
