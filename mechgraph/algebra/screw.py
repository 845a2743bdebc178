"""Twists and wrenches: moved by a pose, multiplied, and their spans.

Twist ``(w, v)`` angular first, ``v`` the velocity of the body point at the origin; wrench ``(M, F)`` moment first, about
the origin. Power is the plain product ``w . M + v . F``: no swap matrix.
"""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array, cross, rotate


def move_twist(X: Array, s: Array) -> Array:
    """Twist given in the frame of pose ``X``, expressed in the outer frame: ``(R w, R v + p x R w)``."""
    w = rotate(X[:, :3], s[:3])
    return np.concatenate([w, rotate(X[:, :3], s[3:]) + cross(X[:, 3], w)])


def move_wrench(X: Array, f: Array) -> Array:
    """Wrench given in the frame of pose ``X``, expressed in the outer frame: ``(R M + p x R F, R F)``."""
    force = rotate(X[:, :3], f[3:])
    return np.concatenate([rotate(X[:, :3], f[:3]) + cross(X[:, 3], force), force])


def move_constant(X: Array, free: Array, line: Array, at: Array | None = None) -> tuple[Array, Array]:
    """Direction and moment of a constant screw ``(3,)`` turned by a pose ``X (3, 4, ...)``, its line through ``at (3, ...)``.

    A screw has a bound part ``line`` (a rotation or a force) and a free part (a translation or a couple). Returns
    ``(R line, R free + at x R line)``, the bound and the free part in the outer frame; ``at`` is the origin of ``X`` unless given.
    """
    bound, loose = (np.einsum("ij...,j->i...", X[:, :3], part) for part in (line, free))
    return bound, loose + cross(X[:, 3] if at is None else at, bound)


def cross_twist(V: Array, S: Array) -> Array:
    """Rate of a twist ``S`` that moves with a body of twist ``V``: ``ad(V) S = (w x s_w, w x s_v + v x s_w)``."""
    out = np.empty(np.broadcast_shapes(V.shape, S.shape), dtype=np.result_type(V, S))
    cross(V[:3], S[:3], out[:3])
    cross(V[:3], S[3:], out[3:])
    out[3:] += cross(V[3:], S[:3])
    return out


def shift_wrench(f: Array, point: Array) -> Array:
    """Wrench about the origin, taken about ``point``: ``(M - point x F, F)``."""
    out = np.array(f)
    out[:3] -= cross(point, f[3:])
    return out


def power(V: Array, f: Array) -> Array:
    """Power ``w . M + v . F`` of a wrench on a twist, along the first axis."""
    return np.asarray((V * f).sum(axis=0))


def null_space(A: Array, tolerance: float) -> Array:
    """Orthonormal columns ``N`` with ``A N = 0``, by singular values below ``tolerance`` times the largest."""
    if A.shape[0] == 0 or A.size == 0:
        return np.eye(A.shape[1])
    _, sigma, Vt = np.linalg.svd(A, full_matrices=True)
    rank = int((sigma > tolerance * max(sigma[0], np.finfo(float).tiny)).sum())
    return np.asarray(Vt[rank:].T)
