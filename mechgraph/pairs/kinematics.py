"""One batched evaluation of every row of the pair table: displacement, twists, reaction and effort wrenches.

All functions take ``n`` pairs of one type at ``T`` positions: state numbers ``x`` are ``(nx, n, T)``, pitches
``(n, 1)``. A rotation is held as a unit quaternion (four numbers), so it has no chart singularity. Numbers may be complex.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import accumulate, pairwise, starmap
from typing import Protocol

import numpy as np

from mechgraph.maths.se3 import (
    Array,
    batch_last,
    compose,
    cross,
    identity,
    move_constant,
    move_twist,
    quaternion_exp,
    quaternion_log,
    turned,
)
from mechgraph.pairs.factors import Component, Factor, Freedom


class EvaluatedRow(Protocol):
    """What is evaluated of a pair type (see ``PairType``)."""

    @property
    def steps(self) -> tuple[Factor, ...]:
        """Factors of the displacement, in order."""

    @property
    def f(self) -> int:
        """Number of freedoms."""

    @property
    def nx(self) -> int:
        """Number of state numbers."""

    @property
    def reactions(self) -> tuple[Component, ...] | None:
        """Components that do no work; None for the null space of ``S^T``."""

    @property
    def efforts(self) -> tuple[Component, ...]:
        """One for every freedom."""

    @property
    def computed_efforts(self) -> bool:
        """Whether the efforts are combined to be dual to the freedoms."""

    @property
    def pushed(self) -> tuple[int, ...]:
        """Freedoms whose effort is a force along the velocity of the origin of marker B, whatever its component says."""

    @property
    def computed_reactions(self) -> bool:
        """Whether the components are combined with the efforts to do no work."""


def places(row: EvaluatedRow) -> list[tuple[slice, slice]]:
    """For every factor of a row the places of its freedoms and of its state numbers."""
    columns = accumulate((len(step.freedoms) for step in row.steps), initial=0)
    numbers = accumulate((step.n_state for step in row.steps), initial=0)
    return list(zip(starmap(slice, pairwise(columns)), starmap(slice, pairwise(numbers)), strict=True))


def _placed(row: EvaluatedRow) -> Iterator[tuple[Factor, slice, slice]]:
    for step, (columns, numbers) in zip(row.steps, places(row), strict=True):
        yield step, columns, numbers


def frames_of(row: EvaluatedRow, pitch: Array, x: Array, base: Array | None = None) -> list[Array]:
    """Frames 0, 1, ... of the pair as poses ``(3, 4, n, T)``, in the frame of ``base`` (marker A where it is None).

    The list is indexed by the number of single freedoms before the frame; places inside a factor of several freedoms hold its
    start. The last entry is the frame of marker B.
    """
    frames = [identity(*x.shape[1:]) if base is None else base]
    for step, columns, numbers in _placed(row):
        frames += [frames[-1]] * (columns.stop - columns.start - 1)
        frames.append(compose(frames[-1], step.pose(x[numbers], pitch)))
    return frames


def twists_of(row: EvaluatedRow, pitch: Array, frames: Sequence[Array], x: Array | None = None) -> Array:
    """Twists of the freedoms, ``(6, f, n, T)``, in the frame in which ``frames`` are given.

    The state ``x`` may be left out where all twists are constant in their frames.
    """
    X = frames[0]
    out = np.empty((6, row.f, *X.shape[2:]), dtype=frames[-1].dtype if x is None else np.result_type(X, x))
    numbers = np.empty((row.nx, *X.shape[2:])) if x is None else x
    for step, columns, rows in _placed(row):
        local = step.twists(numbers[rows], pitch)
        before = frames[columns.start]
        for j in range(local.shape[1]):
            moved = np.broadcast_to(local[:, j], (6, *X.shape[2:]))
            out[:, columns.start + j] = move_twist(before, moved)
    return out


def freedoms_of(freedoms: tuple[Freedom, ...], pitch: Array, X: Array) -> Array:
    """Unit twists of freedoms that are constant in the frame of pose ``X``, ``(6, n freedoms, n, T)``."""
    return _moved([(f.twist[3:], f.per_pitch[3:], f.twist[:3]) for f in freedoms], pitch, [(X, X)] * len(freedoms))


def components_of(components: tuple[Component, ...], pitch: Array, frames: Sequence[Array]) -> Array:
    """Wrenches of components, each constant in its frame, ``(6, n components, n, T)``."""
    moved = _moved(
        [(c.wrench[:3], c.per_pitch[:3], c.wrench[3:]) for c in components],
        pitch,
        [(frames[c.frame], frames[-1] if c.at_b else frames[c.frame]) for c in components],
    )
    out = np.concatenate([moved[3:], moved[:3]])
    return out if components else np.empty((6, 0, *frames[0].shape[2:]))


def _moved(
    screws: list[tuple[Sequence[float], Sequence[float], Sequence[float]]],
    pitch: Array,
    poses: list[tuple[Array, Array]],
) -> Array:
    """Screws given by free part, free part per pitch, and bound part, moved to the directions of the first of two poses and
    the origin of the second, ``(6, number, n, T)``: the bound part (rotation or force) first.
    """
    if not screws:
        return np.empty((6, 0, 0, 0))
    parts = []
    for (free, per_pitch, bound), (X, at) in zip(screws, poses, strict=True):
        direction, moment = move_constant(X, np.array(free), np.array(bound), at[:, 3])
        for i, share in enumerate(per_pitch):
            if share:
                moment = moment + share * pitch * X[:, i]
        parts.append(np.concatenate([direction, moment]))
    return np.stack(parts, axis=1)


def efforts_of(row: EvaluatedRow, pitch: Array, frames: Sequence[Array], x: Array | None = None) -> Array:
    """Effort wrenches ``E``, one a freedom, ``(6, f, n, T)``; combined to ``E (S^T E)^-1`` where the row asks for it."""
    E = components_of(row.efforts, pitch, frames)
    return dual(row, E, twists_of(row, pitch, frames, x), frames[-1][:, 3]) if row.computed_efforts else E


def dual(row: EvaluatedRow, E: Array, S: Array, p: Array) -> Array:
    """The combinations ``E (S^T E)^-1`` of efforts ``(6, f, n, T)`` of a row that are dual to the twists ``S``, B at ``p (3, n, T)``."""
    if row.pushed:
        E, at = E.copy(), list(row.pushed)
        along = S[3:, at] + cross(S[:3, at], np.broadcast_to(p[:, None], S[3:, at].shape))
        E[3:, at], E[:3, at] = along, cross(np.broadcast_to(p[:, None], along.shape), along)
    unit = np.einsum("ifnt,ignt->ntfg", S, E)
    return np.asarray(np.einsum("ignt,gfnt->ifnt", E, batch_last(np.linalg.inv(unit))))


def without_work(W: Array, E: Array, S: Array) -> Array:
    """``W - E S^T W``: components ``(6, c, n, T)`` less the efforts ``E`` that they take in the freedoms ``S``, to which ``E`` is dual."""
    return np.asarray(W - np.einsum("ifnt,jfnt,jcnt->icnt", E, S, W))


def reactions_of(row: EvaluatedRow, pitch: Array, frames: Sequence[Array], x: Array | None = None) -> Array:
    """Reaction wrenches ``W``, ``(6, 6 - f, n, T)``: the row's components, or the null space of ``S^T``."""
    if row.reactions is not None:
        W = components_of(row.reactions, pitch, frames)
        if not row.computed_reactions:
            return W
        return without_work(W, efforts_of(row, pitch, frames, x), twists_of(row, pitch, frames, x))
    return reciprocal(twists_of(row, pitch, frames, x), frames[-1])


def reciprocal(S: Array, B: Array) -> Array:
    """Wrenches ``(6, 6 - f, n, T)`` that do no work on the twists ``S (6, f, n, T)``: the null space of ``S^T``.

    It is taken about the origin of marker B, in its directions.
    """
    f = S.shape[1]
    if not f:
        return np.broadcast_to(np.eye(6)[:, :, None, None], (6, 6, *B.shape[2:])).copy()
    turned = np.einsum("jint,jfnt->ifnt", B[:, :3], S[:3])
    moved = S[3:] + cross(S[:3], np.broadcast_to(B[:, None, 3], S[:3].shape))
    local = np.concatenate([turned, np.einsum("jint,jfnt->ifnt", B[:, :3], moved)])
    null = _null_of_transpose(np.moveaxis(local, (0, 1), (-2, -1)))
    null = np.moveaxis(null, (-2, -1), (0, 1))
    force = np.einsum("ijnt,jcnt->icnt", B[:, :3], null[3:])
    moment = np.einsum("ijnt,jcnt->icnt", B[:, :3], null[:3])
    return np.concatenate([moment + cross(np.broadcast_to(B[:, None, 3], force.shape), force), force])


def _null_of_transpose(S: Array) -> Array:
    """Bases ``(..., 6, 6 - f)`` of the null spaces of ``S^T`` for ``S (..., 6, f)``.

    Orthonormal for real ``S``. For complex ones that of the real part, corrected by its range ``U`` so that ``S^T N = 0``
    without a conjugate: ``N - U (S^T U)^-1 S^T N``.
    """
    f = S.shape[-1]
    U = np.linalg.svd(S.real, full_matrices=True)[0]
    N, U = U[..., f:], U[..., :f]
    if not np.iscomplexobj(S):
        return np.asarray(N)
    St = np.swapaxes(S, -1, -2)
    return np.asarray(N - U @ np.linalg.solve(St @ U, St @ N))


def coordinates_to_state(row: EvaluatedRow, q: Array) -> Array:
    """State numbers ``(nx, ...)`` from user coordinates ``(f, ...)`` (rotation vectors for rotations)."""
    parts = [quaternion_exp(q[columns]) if step.holds_rotation else q[columns] for step, columns, _ in _placed(row)]
    return np.concatenate(parts) if parts else np.empty((0, *q.shape[1:]))


def advance(row: EvaluatedRow, x: Array, dq: Array) -> Array:
    """State after the increments ``dq`` ``(f, ...)``: added for single freedoms, ``exp(dq) Q`` for rotations."""
    out = np.empty(np.broadcast_shapes(x.shape, (row.nx, *dq.shape[1:])), dtype=np.result_type(x, dq))
    for step, columns, rows in _placed(row):
        if step.holds_rotation:
            out[rows] = turned(x[rows], dq[columns])
        else:
            out[rows] = x[rows] + dq[columns]
    return out


def state_to_coordinates(row: EvaluatedRow, x: Array, start: Array | None = None) -> Array:
    """User coordinates ``(f, n, ..., T)`` of n pairs from states, rotation vectors continued along the last axis.

    The rotation vector at the first position is the one nearest to ``start`` ``(f, n)`` (zero where it is None); at every
    further one that nearest to the one before: of ``v + 2 pi k v/|v|`` the nearest.
    """
    out = np.empty((row.f, *x.shape[1:]), dtype=x.dtype)
    for step, columns, rows in _placed(row):
        if step.holds_rotation:
            first = np.zeros(3) if start is None else start[columns]
            out[columns] = _continued(quaternion_log(x[rows]), first)
        else:
            out[columns] = x[rows]
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


def random_coordinates(row: EvaluatedRow, rng: np.random.Generator, n: int, T: int) -> Array:
    """Random states ``(nx, n, T)`` with coordinates of size about one."""
    return coordinates_to_state(row, rng.uniform(-1.2, 1.2, (row.f, n, T)))
