"""Passive freedoms at rest: links that could spin or slide idly are kept from doing so, in space.

A passive motion moves one body (a cluster of links) and nothing else, so it can be stopped in many ways. Here the body itself is
at rest in it: its twist has no part along the passive twist ``u`` (for the coupler between two spheres, no spin about
their line: ``w . u = 0``, hence ``alpha . u = 0``). No choice of a coordinate enters, and a body that is symmetric about its
line needs no effort to be held so.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import Array, cross, rotation_log
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index
from mechgraph.numerics.linear import Choice, ChosenSystem, choose

LARGEST = 3.0
"""Largest rate of another freedom for a unit rate of the held one before another freedom is held."""
TRIES = 8


@dataclass(frozen=True)
class Idle:
    """A body with passive freedoms, by one of its links."""

    link: int


def held_well(
    here: Configuration, choices: list[Choice], which: Index, columns: Index
) -> tuple[list[Choice], Index, ChosenSystem]:
    """Choices such that at every position the held freedoms take a fair part in the passive motions."""
    choices, which = list(choices), which.copy()
    solver = ChosenSystem(here.J, choices, which)
    size = np.abs(solver.null_of_columns()).max(axis=(0, 1), initial=0.0)
    for _ in range(TRIES):
        bad = np.flatnonzero(~(size <= LARGEST))
        if not bad.size:
            break
        worst = int(bad[np.argmax(np.nan_to_num(size[bad], nan=np.inf))])
        choices.append(choose(here.J[:, :, worst], columns))
        trial = ChosenSystem(here.J[:, :, bad], [choices[-1]], np.zeros(bad.size, dtype=np.intp))
        better = np.abs(trial.null_of_columns()).max(axis=(0, 1), initial=0.0)
        take = better < np.nan_to_num(size[bad], nan=np.inf)
        which[bad[take]] = len(choices) - 1
        size[bad[take]] = better[take]
    return choices, which, ChosenSystem(here.J, choices, which)


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


def spin_angles(here: Configuration, idle: tuple[Idle, ...], Z: Array) -> tuple[Array, Array]:
    """Angles ``(p, T)`` by which passive turns have carried bodies along a path, and the rates that turn by one radian.

    For one passive turn of a body: the part along its axis of the rotation from each position to the next, summed.
    Bodies with other passive motions are left as they are. Returns the angles and ``Z`` per radian, ``(F, p, T)``.
    """
    G = passive_twists(here, idle, rest_points(here, idle, Z), Z)
    angles = np.zeros(Z.shape[1:])
    unit = Z.copy()
    for i, body in enumerate(idle):
        mine = [p for p in range(Z.shape[1]) if np.abs(G[6 * i : 6 * i + 6, p]).max() > 1e-6]
        u = G[6 * i : 6 * i + 3, mine[0]]
        length = np.sqrt((u * u).sum(axis=0))
        if len(mine) != 1 or not (length > 1e-6).all():
            continue
        axis = u / length
        sense = np.cumprod(np.concatenate([[1.0], np.where((axis[:, 1:] * axis[:, :-1]).sum(axis=0) < 0, -1.0, 1.0)]))
        axis = axis * sense
        R = here.poses[:, :3, body.link]
        turn = rotation_log(np.einsum("ijt,kjt->ikt", R[..., 1:], R[..., :-1]))
        spin = 0.5 * (turn * (axis[:, 1:] + axis[:, :-1])).sum(axis=0)
        angles[mine[0]] = np.concatenate([[0.0], np.cumsum(spin)])
        unit[:, mine[0]] = Z[:, mine[0]] * sense / length
    return angles, unit


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
