"""Rotations and poses: compose, invert, exponential and logarithm.

A pose is the upper three rows of the homogeneous matrix, ``(3, 4, ...)``: rotation ``X[:, :3]`` and position ``X[:, 3]``.
Source: Murray, Li and Sastry, A Mathematical Introduction to Robotic Manipulation, 1994, chapter 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


SMALL_BATCH = 32
"""Number of small matrices up to which ``matmul`` multiplies them faster than ``einsum`` (measured): the one has less to set up,
the other runs along the batch."""


def multiplied(A: Array, B: Array, out: Array | None = None) -> Array:
    """Products ``A B`` of matrices ``(i, j, n, T)`` and ``(j, k, n, T)``; axes of the batch may have length 1 in one of them."""
    if (out if out is not None else A)[0, 0].size <= SMALL_BATCH:
        into = None if out is None else out.transpose(2, 3, 0, 1)
        return np.matmul(A.transpose(2, 3, 0, 1), B.transpose(2, 3, 0, 1), out=into).transpose(2, 3, 0, 1)
    return np.asarray(np.einsum("ijnt,jknt->iknt", A, B, out=out))


def batch_last(M: Array) -> Array:
    """Matrices ``(..., n, m)`` as ``(n, m, ...)``, so that products run along the batch (up to ten times as fast in ``einsum``)."""
    return np.ascontiguousarray(np.moveaxis(M, (-2, -1), (0, 1)))


SMALL_CROSS = 2000
"""Numbers up to which a vector product is faster with its factors written out turned (fewer calls) than row by row (less memory)."""
LEFT_FACTORS, RIGHT_FACTORS = np.array([1, 2, 0, 2, 0, 1]), np.array([2, 0, 1, 1, 2, 0])
"""Components of both factors in the six products of a vector product, those that are subtracted last."""


def cross(a: Array, b: Array, out: Array | None = None) -> Array:
    """Vector product of ``(3, ...)`` arrays along the first axis, into ``out`` where given."""
    if a.size <= SMALL_CROSS and b.size <= SMALL_CROSS:
        products = a.take(LEFT_FACTORS, 0) * b.take(RIGHT_FACTORS, 0)
        return np.subtract(products[:3], products[3:], out=products[:3] if out is None else out)
    if out is None:
        shape = a.shape if a.shape == b.shape else np.broadcast_shapes(a.shape, b.shape)
        out = np.empty(shape, dtype=a.dtype if a.dtype == b.dtype else np.result_type(a, b))
    part = np.empty(out.shape[1:], dtype=out.dtype)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        row = out[i, ...]
        np.multiply(a[j], b[k], out=row)
        np.multiply(a[k], b[j], out=part)
        row -= part
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
    out = np.empty(np.broadcast_shapes(a.shape, b.shape), dtype=np.result_type(a, b))
    out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    out[1:] = a[0] * b[1:] + b[0] * a[1:] + cross(a[1:], b[1:])
    return out


def quaternion_exp(v: Array) -> Array:
    """Unit quaternion of a rotation vector ``(3, ...)``: ``(cos |v|/2, sin(|v|/2) v/|v|)``."""
    half = 0.5 * np.sqrt((v * v).sum(axis=0))
    zero = half == 0.0
    out = np.empty((4, *v.shape[1:]), dtype=half.dtype)
    out[0] = np.cos(half)
    np.multiply(v, 0.5 * (np.sin(half) + zero) / (half + zero), out=out[1:])
    return out


def quaternion_log(q: Array) -> Array:
    """Rotation vector of a unit quaternion, of length at most pi (of its real part, where it is complex).

    ``2 atan(s / q_0) q_v / s`` with ``s = sqrt(q_v . q_v)``, near a half turn ``(pi - 2 atan(q_0 / s)) q_v / s``: both analytic.
    """
    q = np.where(q[0].real < 0.0, -q, q)
    sine = np.sqrt((q[1:] * q[1:]).sum(axis=0))
    small, beyond = np.abs(sine) < 1e-12, np.abs(sine) > np.abs(q[0])
    safe = np.where(small, 1.0, sine)
    half = np.arctan(np.where(beyond, q[0], safe) / np.where(beyond, safe, q[0]))
    factor = np.where(small, 2.0, np.where(beyond, np.pi - 2.0 * half, 2.0 * half) / safe)
    return np.asarray(factor * q[1:])


def quaternion_inverse(q: Array) -> Array:
    """Inverse of unit quaternions: the conjugate."""
    return q * np.array([1.0, -1.0, -1.0, -1.0]).reshape(4, *(1,) * (q.ndim - 1))


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


HALF_TANGENT = np.zeros((4, 9))
"""From the nine entries of a rotation matrix to ``2 sin(angle) axis`` and ``trace = 1 + 2 cos(angle)``."""
HALF_TANGENT[(0, 1, 2, 3, 3, 3), (7, 2, 3, 0, 4, 8)] = 1.0
HALF_TANGENT[(0, 1, 2), (5, 6, 1)] = -1.0
NEAR = 4e-4
"""``3 - trace = 2 - 2 cos(angle)`` up to which the series of ``_arctan_parts`` are exact to rounding (0.02 radians)."""
WIDE = 3.0
"""The same at 120 degrees: beyond, a rotation vector is found through quaternions."""


def _half_tangents(R: Array) -> tuple[Array, float]:
    """``2 sin(angle) axis`` and ``trace``, ``(4, ...)``, of rotation matrices, and the largest ``|3 - trace|``."""
    parts = HALF_TANGENT.dot(R.reshape(9, -1)).reshape(4, *R.shape[2:])
    return parts, np.maximum.reduce(np.abs(parts[3] - 3.0), axis=None, initial=0.0)


def _arctan_parts(u: Array, near: bool) -> tuple[Array, Array]:
    """``g = atan(t) / t`` and ``h = (1 - g) / u`` for ``u = t^2``: analytic in ``u``, a series where ``u`` is small."""
    h = 1 / 3 + u * (u * (1 / 7) - 1 / 5)
    if near:
        return 1.0 - u * h, h
    small = np.abs(u) <= NEAR / 4
    t = np.sqrt(np.where(small, 1.0, u))
    g = np.where(small, 1.0 - u * h, np.arctan(t) / t)
    return g, np.where(small, h, (1.0 - g) / t**2)


def rotation_log(R: Array) -> Array:
    """Rotation vector of rotation matrices, of length at most pi: ``2 atan(|tau|) tau / |tau|`` with ``tau = tan(angle/2) axis``.

    Through quaternions where an angle comes near pi. Comparisons choose a formula; each of them is analytic in the entries.
    """
    parts, width = _half_tangents(R)
    if not width < WIDE:
        return quaternion_log(matrix_quaternion(R))
    tau = parts[:3] / (parts[3] + 1.0)
    return np.asarray(2.0 * _arctan_parts(np.add.reduce(tau * tau), width <= NEAR)[0] * tau)


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
    """Finite twist ``(w, v)`` with ``exp(w, v) = X``: the closure error of a loop."""
    return finite_twist(X[:, :3], X[:, 3])


def finite_twist(R: Array, p: Array) -> Array:
    """Finite twist of the pose with rotation ``R (3, 3, ...)`` and position ``p (3, ...)``.

    With ``tau = tan(angle/2) axis = 2 sin(angle) axis / (1 + trace)``, rational in the entries of ``R``,
    ``g = atan(|tau|) / |tau|`` and ``h = (1 - g) / |tau|^2``:
    ``w = 2 g tau``, ``v = g (p - tau x p) + h (tau . p) tau``.
    Near a half turn, where ``tau`` has no bound, through quaternions.
    """
    parts, width = _half_tangents(R)
    if not width < WIDE:
        return _wide_finite_twist(R, p)
    out = np.empty((2, *p.shape), dtype=parts.dtype if parts.dtype == p.dtype else np.result_type(parts, p))
    w, v = out
    np.divide(parts[:3], parts[3] + 1.0, out=w)
    v[:] = p
    u, advance = np.add.reduce(out * w, axis=1)
    g, h = _arctan_parts(u, width <= NEAR)
    along = w * (h * advance)
    v -= cross(w, v)
    out *= g
    v += along
    w += w
    return out.reshape(6, *p.shape[1:])


def _wide_finite_twist(R: Array, p: Array) -> Array:
    """``v = p - w x p / 2 + c w x (w x p)``, ``c = (1 - (|w|/2) cot(|w|/2)) / |w|^2``."""
    w = quaternion_log(matrix_quaternion(R))
    angle2 = (w * w).sum(axis=0)
    small = np.abs(angle2) < 1e-6
    half = 0.5 * np.sqrt(np.where(small, 1.0, angle2))
    c = np.where(small, 1 / 12 + angle2 / 720, (1 - half / np.tan(half)) / (4 * half**2))
    wp = cross(w, p)
    return np.concatenate([w, p - 0.5 * wp + c * cross(w, wp)])
