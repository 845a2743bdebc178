"""One batched evaluation of every row of the pair table: displacement, twists, reaction and effort wrenches.

All functions take ``n`` pairs of one type at ``T`` positions: state numbers ``x`` are ``(nx, n, T)``, pitches
``(n, 1)``. A rotation is held as a unit quaternion (four numbers), so it has no chart singularity.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mechgraph.algebra.screw import move_constant
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

if TYPE_CHECKING:
    from mechgraph.model.pair import Component, Freedom, PairType


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


def twists_of(row: PairType, pitch: Array, frames: list[Array]) -> Array:
    """Unit twists of the freedoms, ``(6, f, n, T)``, in the frame in which ``frames`` are given."""
    return freedoms_of(row.freedoms, row.frame_before, pitch, frames)


def freedoms_of(freedoms: tuple[Freedom, ...], before: tuple[int, ...], pitch: Array, frames: list[Array]) -> Array:
    """Unit twists of freedoms, each constant in the frame of its index in ``before``, ``(6, n freedoms, n, T)``."""
    out = np.empty((6, len(freedoms), *frames[0].shape[2:]))
    for j, freedom in enumerate(freedoms):
        X = frames[before[j]]
        twist = np.array(freedom.twist)
        out[:3, j], out[3:, j] = move_constant(X, twist[3:], twist[:3])
        for i, per_pitch in enumerate(freedom.per_pitch[3:]):
            if per_pitch:
                out[3:, j] += per_pitch * pitch * X[:, i]
    return out


def components_of(components: tuple[Component, ...], pitch: Array, frames: list[Array]) -> Array:
    """Wrenches of components, each constant in its frame, ``(6, n components, n, T)``."""
    out = np.empty((6, len(components), *frames[0].shape[2:]))
    for j, c in enumerate(components):
        X = frames[c.frame]
        wrench = np.array(c.wrench)
        if c.at_b:
            X = np.concatenate([X[:, :3], frames[-1][:, 3:]], axis=1)
        out[3:, j], out[:3, j] = move_constant(X, wrench[:3], wrench[3:])
        for i, per_pitch in enumerate(c.per_pitch[:3]):
            if per_pitch:
                out[:3, j] += per_pitch * pitch * X[:, i]
    return out


def efforts_of(row: PairType, pitch: Array, frames: list[Array]) -> Array:
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
