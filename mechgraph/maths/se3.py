"""Rotations, poses, twists and wrenches: composed, inverted, exponential and logarithm, moved by a pose, their spans.

A pose is the upper three rows of the homogeneous matrix, ``(3, 4, ...)``: rotation ``X[:, :3]`` and position ``X[:, 3]``. Twist ``(w, v)``
angular first, ``v`` the velocity of the body point at the origin; wrench ``(M, F)`` moment first, about the origin. Power is the plain
product ``w . M + v . F``: no swap matrix.
Source: Murray, Li and Sastry, A Mathematical Introduction to Robotic Manipulation, 1994, chapter 2.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
IN_SPACE, IN_PLANE = slice(0, 6), slice(2, 5)
"""Components of twists (wrenches): all six, and Rz, Tx, Ty (Mz, Fx, Fy) of the x-y plane."""


def multiplied(A: Array, B: Array, out: Array | None = None) -> Array:
    """Products ``A B`` of matrices ``(i, j, n, T)`` and ``(j, k, n, T)``; axes of the batch may have length 1 in one of them."""
    return np.asarray(np.einsum("ijnt,jknt->iknt", A, B, out=out))


def batch_last(M: Array) -> Array:
    """Matrices ``(..., n, m)`` as ``(n, m, ...)``, so that products run along the batch (up to ten times as fast in ``einsum``)."""
    return np.ascontiguousarray(np.moveaxis(M, (-2, -1), (0, 1)))


def cross(a: Array, b: Array, out: Array | None = None) -> Array:
    """Vector product of ``(3, ...)`` arrays along the first axis, into ``out`` where given."""
    # of few vectors the time is that of the calls: four that take components instead of fifteen that look at them
    if a.ndim == b.ndim and a.size + b.size < 2000:
        forth, back = (1, 2, 0), (2, 0, 1)
        return np.subtract(a.take(forth, 0) * b.take(back, 0), a.take(back, 0) * b.take(forth, 0), out=out)
    if out is None:
        out = np.empty(np.broadcast_shapes(a.shape, b.shape), dtype=np.result_type(a, b))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.subtract(a[j] * b[k], a[k] * b[j], out=out[i, ...])
    return out


def skew(a: Array) -> Array:
    """Matrix of the vector product, ``skew(a) b = a x b``; ``(3, ...)`` -> ``(3, 3, ...)``."""
    zero = np.zeros_like(a[0])
    return np.array([[zero, -a[2], a[1]], [a[2], zero, -a[0]], [-a[1], a[0], zero]])


def rotate(R: Array, v: Array) -> Array:
    """``R v`` for ``(3, 3, ...)`` and ``(3, ...)``."""
    return np.asarray(np.einsum("ij...,j...->i...", R, v))


def rotate_back(R: Array, v: Array) -> Array:
    """``R^T v`` for ``(3, 3, ...)`` and ``(3, ...)``."""
    return np.asarray(np.einsum("ji...,j...->i...", R, v))


def identity(*batch: int) -> Array:
    """Identity pose with trailing batch axes."""
    X = np.zeros((3, 4, *batch))
    for i in range(3):
        X[i, i] = 1.0
    return X


def compose(X: Array, Y: Array) -> Array:
    """Product ``X Y`` of two poses."""
    out = np.asarray(np.einsum("ij...,jk...->ik...", X[:, :3], Y))
    out[:, 3] += X[:, 3]
    return out


def homogeneous(X: Array) -> Array:
    """Poses ``(3, 4, ...)`` with their fourth row, ``(4, 4, ...)``."""
    out = np.zeros((4, *X.shape[1:]), dtype=X.dtype)
    out[:3] = X
    out[3, 3] = 1.0
    return out


def inverse(X: Array) -> Array:
    """Inverse pose, ``(R^T, -R^T p)``."""
    out = np.empty_like(X)
    out[:, :3] = np.swapaxes(X[:, :3], 0, 1)
    out[:, 3] = -rotate_back(X[:, :3], X[:, 3])
    return out


def to_matrix(X: Array) -> Array:
    """Homogeneous matrices ``(..., 4, 4)``, batch first, from poses ``(3, 4, ...)``."""
    return np.moveaxis(homogeneous(X), (0, 1), (-2, -1)).copy()


def quaternion_product(a: Array, b: Array) -> Array:
    """Product of quaternions ``(4, ...)``, scalar part first."""
    (a0, a1, a2, a3), (b0, b1, b2, b3) = a, b
    return np.array(
        [
            a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
            a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
            a0 * b2 + a2 * b0 + a3 * b1 - a1 * b3,
            a0 * b3 + a3 * b0 + a1 * b2 - a2 * b1,
        ]
    )


def quaternion_exp(v: Array) -> Array:
    """Unit quaternion of a rotation vector ``v (3, ...)``: ``(cos |v|/2, sin(|v|/2) v/|v|)``."""
    half = 0.5 * np.sqrt((v * v).sum(axis=0))
    zero = half == 0.0
    return np.concatenate([np.cos(half)[None], 0.5 * (np.sin(half) + zero) / (half + zero) * v])


def quaternion_log(q: Array) -> Array:
    """Rotation vector of a unit quaternion, of length at most pi (of its real part, where it is complex).

    ``2 atan(s / q_0) q_v / s`` with ``s = sqrt(q_v . q_v)``, near a half turn ``(pi - 2 atan(q_0 / s)) q_v / s``: both analytic.
    """
    sign = np.where(q[0].real < 0.0, -1.0, 1.0)
    w, sine = sign * q[0], np.sqrt((q[1:] * q[1:]).sum(axis=0))
    small, beyond = abs(sine) < 1e-12, abs(sine) > abs(w)
    safe = np.where(small, 1.0, sine)
    half = np.arctan(np.where(beyond, w, safe) / np.where(beyond, safe, w))
    return np.asarray(sign * np.where(small, 2.0, np.where(beyond, math.pi - 2.0 * half, 2.0 * half) / safe) * q[1:])


def turned(q: Array, v: Array) -> Array:
    """Unit quaternions ``q (4, ...)`` after rotation vectors ``v (3, ...)``: ``exp(v) q``, made unit again."""
    p = quaternion_product(quaternion_exp(v), q)
    return np.asarray(p / np.sqrt((p * p).sum(axis=0)))


def turn_between(q1: Array, q0: Array) -> Array:
    """Rotation vector from ``q0`` to ``q1`` by the short way."""
    return quaternion_log(quaternion_product(q1, np.concatenate([q0[:1], -q0[1:]])))


def turn_tangent(v: Array, w: Array) -> Array:
    """``dexp^-1(v) w = w - v x w / 2 + (1 - (a / 2) cot(a / 2)) / a^2  v x (v x w)`` with ``a = |v|``, below two turns."""
    square = (v * v).sum(axis=0)
    small = abs(square) < 1e-2
    half = 0.5 * np.sqrt(np.where(small, 1.0, square))
    series = 1 / 12 + square * (1 / 720 + square * (1 / 30240 + square / 1209600))
    vw = cross(v, w)
    return np.asarray(
        w - 0.5 * vw + np.where(small, series, (1.0 - half / np.tan(half)) / (4.0 * half * half)) * cross(v, vw)
    )


def quaternion_matrix(q: Array) -> Array:
    """Rotation matrix ``(3, 3, ...)`` of unit quaternions ``(4, ...)``."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def matrix_quaternion(R: Array) -> Array:
    """Unit quaternion of rotation matrices ``(3, 3, ...)``, by the largest of the four squared components."""
    d = np.array([R[0, 0], R[1, 1], R[2, 2]])
    trace = d.sum(axis=0)
    candidates = np.array(
        [
            [1 + trace, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]],
            [R[2, 1] - R[1, 2], 1 + 2 * d[0] - trace, R[0, 1] + R[1, 0], R[0, 2] + R[2, 0]],
            [R[0, 2] - R[2, 0], R[0, 1] + R[1, 0], 1 + 2 * d[1] - trace, R[1, 2] + R[2, 1]],
            [R[1, 0] - R[0, 1], R[0, 2] + R[2, 0], R[1, 2] + R[2, 1], 1 + 2 * d[2] - trace],
        ]
    )
    best = np.argmax(np.array([candidates[i, i].real for i in range(4)]), axis=0)
    q = np.take_along_axis(candidates, best[None, None], axis=0)[0]
    return np.asarray(q / np.sqrt((q * q).sum(axis=0)))


def rotation_exp(v: Array) -> Array:
    """Rotation matrix of a rotation vector (Rodrigues)."""
    return quaternion_matrix(quaternion_exp(v))


def finite_twist(R: Array, to: Array, start: Array) -> Array:
    """Finite twist ``(w, v)`` of the motion that turns by ``R (3, 3, ...)`` and takes the point ``start`` to the point ``to (3, ...)``.

    With ``tau = tan(angle/2) axis = 2 sin(angle) axis / (1 + trace)``, rational in the entries of ``R``, Cayley's
    ``c = to - start - tau x (to + start)``, ``g = atan(|tau|) / |tau|`` and ``h = (1 - g) / |tau|^2``:
    ``w = 2 g tau``, ``v = g c + h (tau . c) tau``.
    Near a half turn, where ``tau`` has no bound, through quaternions. Comparisons choose a formula; each of them is analytic.
    """
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    # 3 - trace = 2 - 2 cos(angle), at 120 degrees
    if not (abs(trace - 3.0) < 3.0).all():
        return _wide_finite_twist(R, to - rotate(R, start))
    tau = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (trace + 1.0)
    c = to - start - cross(tau, to + start)
    u = (tau * tau).sum(axis=0)
    # up to 0.02 radians the series is exact to rounding
    small = abs(u) <= 1e-4
    h = 1 / 3 + u * (u * (1 / 7) - 1 / 5)
    g = 1.0 - u * h
    if not small.all():
        safe = np.where(small, 1.0, u)
        t = np.sqrt(safe)
        g = np.where(small, g, np.arctan(t) / t)
        h = np.where(small, h, (1.0 - g) / safe)
    return np.concatenate([2.0 * g * tau, g * c + h * (tau * c).sum(axis=0) * tau])


def rotation_log(R: Array) -> Array:
    """Rotation vector of rotation matrices, of length at most pi."""
    return pose_log(np.concatenate([R, np.zeros_like(R[:, :1])], axis=1))[:3]


def pose_exp(s: Array) -> Array:
    """Pose of a finite twist ``s = (w, v)``, ``exp(s)``, for twists ``(6, ...)`` of any size."""
    w, v = s[:3], s[3:]
    angle2 = (w * w).sum(axis=0)
    angle = np.sqrt(angle2)
    small = np.abs(angle) < 1e-4
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 0.5 - angle2 / 24, (1 - np.cos(safe)) / safe**2)
    b = np.where(small, 1 / 6 - angle2 / 120, (safe - np.sin(safe)) / safe**3)
    out = np.empty((3, 4, *s.shape[1:]), dtype=angle.dtype)
    out[:, :3] = rotation_exp(w)
    wv = cross(w, v)
    out[:, 3] = v + a * wv + b * cross(w, wv)
    return out


def pose_log(X: Array) -> Array:
    """Finite twist ``(w, v)`` with ``exp(w, v) = X``."""
    return finite_twist(X[:, :3], X[:, 3], np.zeros_like(X[:, 3]))


def _wide_finite_twist(R: Array, p: Array) -> Array:
    """``v = p - w x p / 2 + c w x (w x p)``, ``c = (1 - (|w|/2) cot(|w|/2)) / |w|^2``."""
    w = quaternion_log(matrix_quaternion(R))
    angle2 = (w * w).sum(axis=0)
    small = np.abs(angle2) < 1e-6
    half = 0.5 * np.sqrt(np.where(small, 1.0, angle2))
    c = np.where(small, 1 / 12 + angle2 / 720, (1 - half / np.tan(half)) / (4 * half**2))
    wp = cross(w, p)
    return np.concatenate([w, p - 0.5 * wp + c * cross(w, wp)])


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
