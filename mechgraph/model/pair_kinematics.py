"""One batched evaluation of every row of the pair table: displacement, twists, reaction and effort wrenches.

All functions take ``n`` pairs of one type at ``T`` positions: state numbers ``x`` are ``(nx, n, T)``, pitches
``(n, 1)``. A rotation is held as a unit quaternion (four numbers), so it has no chart singularity.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from mechgraph.algebra.screw import direction, moved_screw
from mechgraph.algebra.se3 import (
    Array,
    compose,
    cross,
    identity,
    quaternion_exp,
    quaternion_inverse,
    quaternion_log,
    quaternion_matrix,
    quaternion_product,
    skew,
)
from mechgraph.model.pair_frames import Frame

if TYPE_CHECKING:
    from mechgraph.model.pair_type import Component, Freedom, PairType


def _screw_motion(twist: Array, q: Array) -> Array:
    """Displacement ``exp(q s)`` for a unit twist ``s = (w, v)`` with ``|w|`` one or zero; ``(6, n, 1)``, ``(n, T)``.

    ``R = 1 + sin q w^ + (1 - cos q) w^2``, ``p = (q (1 + w^2) + (1 - cos q) w^ - sin q w^2) v``.
    """
    W = skew(twist[:3])
    W2 = np.einsum("ij...,jk...->ik...", W, W)
    v = twist[3:]
    Wv, W2v = (np.einsum("ij...,j...->i...", M, v) for M in (W, W2))
    out = identity(*q.shape)
    if not twist[:3].any():
        out[:, 3] = v * q
        return out
    s, c = np.sin(q), 1.0 - np.cos(q)
    out[:, :3] += s * W + c * W2
    out[:, 3] = q * (v + W2v) + c * Wv - s * W2v
    return out


def frames_of(row: PairType, pitch: Array, x: Array, base: Array | None = None) -> list[Array]:
    """Frames 0, 1, ... of the pair as poses ``(3, 4, n, T)``, in the frame of ``base`` (marker A where it is None).

    The list is indexed by the number of single freedoms before the frame; places inside a rotation hold its start.
    The last entry is the frame of marker B.
    """
    frames = [identity(*x.shape[1:]) if base is None else base]
    at = 0
    for group in row.factors:
        if len(group) == 1:
            freedom = row.freedoms[group[0]]
            twist = np.array(freedom.twist)[:, None, None] + np.array(freedom.per_pitch)[:, None, None] * pitch
            step = _screw_motion(twist, x[at])
            at += 1
        else:
            step = identity(*x.shape[1:])
            step[:, :3] = quaternion_matrix(x[at : at + 4])
            at += 4
            frames += [frames[-1]] * 2
        frames.append(compose(frames[-1], step))
    return frames


Frames = Sequence[Array] | Sequence[Frame]


def _columns(frames: Frames, k: int) -> Callable[[int], Array]:
    """Column of a frame by its index: axes 0, 1, 2 and the origin 3, ``(3, n, T)``."""
    X = frames[k]
    return X.column if isinstance(X, Frame) else lambda i: X[:, i]


def twists_of(row: PairType, pitch: Array, frames: Frames) -> Array:
    """Unit twists of the freedoms, ``(6, f, n, T)``, in the frame in which ``frames`` are given."""
    return freedoms_of(row.freedoms, row.frame_before, pitch, frames)


def freedoms_of(freedoms: tuple[Freedom, ...], before: tuple[int, ...], pitch: Array, frames: Frames) -> Array:
    """Unit twists of freedoms, each constant in the frame of its index in ``before``, ``(6, n freedoms, n, T)``."""
    if not freedoms:
        return np.empty((6, 0, *_columns(frames, 0)(3).shape[1:]))
    parts = [twist_of(freedom, k, pitch, frames) for freedom, k in zip(freedoms, before, strict=True)]
    return _stacked(parts)


def _stacked(parts: list[tuple[Array, Array]]) -> Array:
    out = np.empty((6, len(parts), *parts[0][0].shape[1:]))
    for j, (first, second) in enumerate(parts):
        out[:3, j], out[3:, j] = first, second
    return out


def twist_of(freedom: Freedom, before: int, pitch: Array, frames: Frames) -> tuple[Array, Array]:
    """Unit twist of one freedom that is constant in frame ``before``: angular and linear part, ``(3, n, T)``."""
    angular, linear = twist_parts(freedom, before, pitch, frames)
    origin = _columns(frames, before)(3)
    moment = np.zeros(origin.shape) if angular is None else cross(origin, angular)
    if linear is not None:
        moment += linear
    return np.zeros(origin.shape) if angular is None else angular, moment


def twist_parts(freedom: Freedom, before: int, pitch: Array, frames: Frames) -> tuple[Array | None, Array | None]:
    """Angular part of the unit twist of a freedom, and its linear part at the origin of its frame; None where they vanish."""
    column = _columns(frames, before)
    angular, linear = direction(column, freedom.twist[:3]), direction(column, freedom.twist[3:])
    for i, per_pitch in enumerate(freedom.per_pitch[3:]):
        if per_pitch:
            more = per_pitch * pitch * column(i)
            linear = more if linear is None else linear + more
    return angular, linear


def frame_origin(before: int, frames: Frames) -> Array:
    """Origin of a frame, ``(3, n, T)``."""
    return _columns(frames, before)(3)


def components_of(components: tuple[Component, ...], pitch: Array, frames: Frames) -> Array:
    """Wrenches of components, each constant in its frame, ``(6, n components, n, T)``."""
    if not components:
        return np.empty((6, 0, *_columns(frames, 0)(3).shape[1:]))
    return _stacked([component_of(c, pitch, frames) for c in components])


def component_of(c: Component, pitch: Array, frames: Frames) -> tuple[Array, Array]:
    """Wrench of one component: moment and force, ``(3, n, T)``."""
    axes, end = _columns(frames, c.frame), _columns(frames, len(frames) - 1)

    def column(i: int) -> Array:
        return end(3) if i == 3 and c.at_b else axes(i)

    force, moment = moved_screw(column, c.wrench[:3], c.wrench[3:])
    for i, per_pitch in enumerate(c.per_pitch[:3]):
        if per_pitch:
            moment = moment + per_pitch * pitch * axes(i)
    return moment, force


def efforts_of(row: PairType, pitch: Array, frames: Frames) -> Array:
    """Effort wrenches ``E``, one a freedom, ``(6, f, n, T)``; combined to ``E (S^T E)^-1`` where the row asks for it."""
    E = components_of(row.efforts, pitch, frames)
    if not row.computed_efforts:
        return E
    unit = np.einsum("ifnt,ignt->ntfg", twists_of(row, pitch, frames), E)
    return np.einsum("ignt,ntgf->ifnt", E, np.linalg.inv(unit))


def reactions_of(row: PairType, pitch: Array, frames: list[Array]) -> Array:
    """Reaction wrenches ``W``, ``(6, 6 - f, n, T)``: the row's components, or the null space of ``S^T``.

    Where the row has no constant components, the null space is taken about the origin of marker B, in its directions.
    """
    if row.reactions is not None:
        return components_of(row.reactions, pitch, frames)
    if not row.f:
        return np.broadcast_to(np.eye(6)[:, :, None, None], (6, 6, *frames[0].shape[2:])).copy()
    S = twists_of(row, pitch, frames)
    B = frames[-1]
    local = np.concatenate(
        [
            np.einsum("ji...,jf...->if...", B[:, :3], S[:3]),
            np.einsum(
                "ji...,jf...->if...",
                B[:, :3],
                S[3:] + np.stack([cross(S[:3, j], B[:, 3]) for j in range(row.f)], axis=1),
            ),
        ]
    )
    U = np.linalg.svd(np.moveaxis(local, (0, 1), (-2, -1)), full_matrices=True)[0][..., row.f :]
    out = np.empty((6, 6 - row.f, *frames[0].shape[2:]))
    for j in range(6 - row.f):
        f = np.moveaxis(U[..., j], -1, 0)
        force = np.einsum("ij...,j...->i...", B[:, :3], f[3:])
        out[3:, j] = force
        out[:3, j] = np.einsum("ij...,j...->i...", B[:, :3], f[:3]) + cross(B[:, 3], force)
    return out


def coordinates_to_state(row: PairType, q: Array) -> Array:
    """State numbers ``(nx, ...)`` from user coordinates ``(f, ...)`` (rotation vectors for rotations)."""
    parts = [q[g[0]][None] if len(g) == 1 else quaternion_exp(q[g[0] : g[2] + 1]) for g in row.factors]
    return np.concatenate(parts) if parts else np.empty((0, *q.shape[1:]))


def advance(row: PairType, x: Array, dq: Array) -> Array:
    """State after the increments ``dq`` ``(f, ...)``: added for single freedoms, ``exp(dq) Q`` for rotations."""
    out = np.empty(np.broadcast_shapes(x.shape, (row.nx, *dq.shape[1:])))
    at = 0
    for g in row.factors:
        if len(g) == 1:
            out[at] = x[at] + dq[g[0]]
            at += 1
        else:
            q = quaternion_product(quaternion_exp(dq[g[0] : g[2] + 1]), x[at : at + 4])
            out[at : at + 4] = q / np.sqrt((q * q).sum(axis=0))
            at += 4
    return out


def difference(row: PairType, x1: Array, x0: Array) -> Array:
    """Increments ``dq`` that lead from ``x0`` to ``x1``; the inverse of ``advance`` (rotations by the short way)."""
    out = np.empty((row.f, *np.broadcast_shapes(x1.shape[1:], x0.shape[1:])))
    at = 0
    for g in row.factors:
        if len(g) == 1:
            out[g[0]] = x1[at] - x0[at]
            at += 1
        else:
            out[g[0] : g[2] + 1] = quaternion_log(
                quaternion_product(x1[at : at + 4], quaternion_inverse(x0[at : at + 4]))
            )
            at += 4
    return out


def tangent(row: PairType, dq: Array, rates: Array) -> Array:
    """Rates of the increments ``dq`` at the state that they lead to, from the rates ``(f, ...)`` of the freedoms there.

    Unchanged for single freedoms; for a rotation ``dexp^-1(dq) w = w - dq x w / 2 + dq x (dq x w) / 12 + ...``.
    """
    out = rates.copy()
    for g in row.factors:
        if len(g) == 3:
            v, w = dq[g[0] : g[2] + 1], rates[g[0] : g[2] + 1]
            turned = cross(v, w)
            out[g[0] : g[2] + 1] = w - 0.5 * turned + cross(v, turned) / 12.0
    return out


def state_to_coordinates(row: PairType, x: Array, start: Array | None = None) -> Array:
    """User coordinates ``(f, n, ..., T)`` of n pairs from states, rotation vectors continued along the last axis.

    The rotation vector at the first position is the one nearest to ``start`` ``(f, n)`` (zero where it is None); at every
    further one that nearest to the one before: of ``v + 2 pi k v/|v|`` the nearest.
    """
    out = np.empty((row.f, *x.shape[1:]))
    at = 0
    for g in row.factors:
        if len(g) == 1:
            out[g[0]] = x[at]
            at += 1
        else:
            first = np.zeros(3) if start is None else start[g[0] : g[2] + 1]
            out[g[0] : g[2] + 1] = _continued(quaternion_log(x[at : at + 4]), first)
            at += 4
    return out


def _continued(v: Array, first: Array) -> Array:
    """Rotation vectors ``(3, n, ..., T)`` continued along the last axis: signed angles about axes that do not flip, unwrapped."""
    near = np.broadcast_to(first.reshape(*first.shape, *(1,) * (v.ndim - 1 - first.ndim)), v.shape[:-1])
    flat, starts = v.reshape(3, -1, v.shape[-1]), near.reshape(3, -1)
    if np.isfinite(flat).all():
        return _continued_paths(flat, starts).reshape(v.shape)
    out = np.full_like(flat, np.nan)
    for case in range(flat.shape[1]):
        good = np.flatnonzero(np.isfinite(flat[:, case]).all(axis=0))
        if good.size:
            out[:, case, good] = _continued_paths(flat[:, case : case + 1, good], starts[:, case : case + 1])[:, 0]
    return out.reshape(v.shape)


def _continued_paths(v: Array, first: Array) -> Array:
    """The same for ``(3, n, T)`` without gaps, ``first (3, n)``."""
    angle = np.sqrt((v * v).sum(axis=0))
    clear = angle > 1e-9
    # where the angle is nearly zero the axis of the last clear position serves, before the first one that one's
    last_clear = np.maximum.accumulate(np.where(clear, np.arange(v.shape[2]), -1), axis=1)
    last_clear = np.where(last_clear < 0, np.argmax(clear, axis=1)[:, None], last_clear)
    axis = np.take_along_axis(v / np.where(clear, angle, 1.0), last_clear[None], axis=2)
    flips = np.where((axis[..., 1:] * axis[..., :-1]).sum(axis=0) < 0, -1.0, 1.0)
    axis = axis * np.cumprod(np.concatenate([np.ones((v.shape[1], 1)), flips], axis=1), axis=1)
    signed = np.unwrap((v * axis).sum(axis=0), axis=1)
    turns = np.round(((first * axis[..., 0]).sum(axis=0) - signed[:, 0]) / (2 * np.pi))[:, None]
    moved = (signed + 2 * np.pi * turns) * axis
    turned = (clear | (np.abs(signed) > 1.0) | (turns != 0)) & clear.any(axis=1, keepdims=True)
    return np.asarray(np.where(turned, moved, v))


def random_coordinates(row: PairType, rng: np.random.Generator, n: int, T: int) -> Array:
    """Random states ``(nx, n, T)`` with coordinates of size about one."""
    return coordinates_to_state(row, rng.uniform(-1.2, 1.2, (row.f, n, T)))
