"""Rotations and poses: compose, invert, exponential and logarithm.

A pose is the upper three rows of the homogeneous matrix, ``(3, 4, ...)``: rotation ``X[:, :3]`` and position ``X[:, 3]``.
Source: Murray, Li and Sastry, A Mathematical Introduction to Robotic Manipulation, 1994, chapter 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def cross(a: Array, b: Array, out: Array | None = None) -> Array:
    """Vector product of ``(3, ...)`` arrays along the first axis, into ``out`` where given."""
    if out is None:
        out = np.empty(a.shape if a.shape == b.shape else np.broadcast_shapes(a.shape, b.shape))
    part = np.empty(out.shape[1:])
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


def inverse(X: Array) -> Array:
    """Inverse pose, ``(R^T, -R^T p)``."""
    out = np.empty_like(X)
    out[:, :3] = np.swapaxes(X[:, :3], 0, 1)
    out[:, 3] = -rotate_back(X[:, :3], X[:, 3])
    return out


def to_matrix(X: Array) -> Array:
    """Homogeneous matrices ``(..., 4, 4)``, batch first, from poses ``(3, 4, ...)``."""
    out = np.zeros((*X.shape[2:], 4, 4))
    out[..., :3, :] = np.moveaxis(X, (0, 1), (-2, -1))
    out[..., 3, 3] = 1.0
    return out


def quaternion_product(a: Array, b: Array) -> Array:
    """Product of quaternions ``(4, ...)``, scalar part first."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3]
    out[1:] = a[0] * b[1:] + b[0] * a[1:] + cross(a[1:], b[1:])
    return out


def quaternion_exp(v: Array) -> Array:
    """Unit quaternion of a rotation vector ``(3, ...)``: ``(cos |v|/2, sin(|v|/2) v/|v|)``."""
    half = 0.5 * np.sqrt((v * v).sum(axis=0))
    zero = half == 0.0
    out = np.empty((4, *v.shape[1:]))
    out[0] = np.cos(half)
    np.multiply(v, 0.5 * (np.sin(half) + zero) / (half + zero), out=out[1:])
    return out


def quaternion_log(q: Array) -> Array:
    """Rotation vector of a unit quaternion, of length at most pi."""
    q = np.where(q[0] < 0.0, -q, q)
    sine = np.sqrt((q[1:] * q[1:]).sum(axis=0))
    angle = 2.0 * np.arctan2(sine, q[0])
    small = sine < 1e-12
    factor = np.where(small, 2.0, angle / np.where(small, 1.0, sine))
    return factor * q[1:]


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
    best = np.argmax(np.array([candidates[i, i] for i in range(4)]), axis=0)
    q = np.take_along_axis(candidates, best[None, None], axis=0)[0]
    return np.asarray(q / np.sqrt((q * q).sum(axis=0)))


def rotation_exp(v: Array) -> Array:
    """Rotation matrix of a rotation vector (Rodrigues)."""
    return quaternion_matrix(quaternion_exp(v))


def rotation_log(R: Array) -> Array:
    """Rotation vector of rotation matrices, of length at most pi.

    From the skew part, ``sin(angle) axis``, and the trace; through quaternions where an angle comes near pi.
    """
    cosine = 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)
    if not (cosine > -0.5).all():
        return quaternion_log(matrix_quaternion(R))
    s = np.empty((3, *R.shape[2:]))
    for i, j, k in ((0, 2, 1), (1, 0, 2), (2, 1, 0)):
        np.subtract(R[j, k], R[k, j], out=s[i, ...])
    s *= 0.5
    sine = np.sqrt((s * s).sum(axis=0))
    small = sine < 1e-8
    s *= np.where(small, 1.0, np.arctan2(sine, cosine) / np.where(small, 1.0, sine))
    return s


def pose_exp(s: Array) -> Array:
    """Pose of a finite twist ``s = (w, v)``, ``exp(s)``, for twists ``(6, ...)`` of any size."""
    w, v = s[:3], s[3:]
    angle2 = (w * w).sum(axis=0)
    angle = np.sqrt(angle2)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 0.5 - angle2 / 24, (1 - np.cos(safe)) / safe**2)
    b = np.where(small, 1 / 6 - angle2 / 120, (safe - np.sin(safe)) / safe**3)
    out = np.empty((3, 4, *s.shape[1:]))
    out[:, :3] = rotation_exp(w)
    wv = cross(w, v)
    out[:, 3] = v + a * wv + b * cross(w, wv)
    return out


def pose_log(X: Array) -> Array:
    """Finite twist ``(w, v)`` with ``exp(w, v) = X``: the closure error of a loop.

    ``v = p - w x p / 2 + c w x (w x p)``, ``c = (1 - (|w|/2) cot(|w|/2)) / |w|^2``.
    """
    w = rotation_log(X[:, :3])
    angle2 = (w * w).sum(axis=0)
    if (angle2 < 1e-6).all():
        c = 1 / 12 + angle2 / 720
    else:
        small = angle2 < 1e-6
        half = 0.5 * np.sqrt(np.where(small, 1.0, angle2))
        c = np.where(small, 1 / 12 + angle2 / 720, (1 - half / np.tan(half)) / (4 * half**2))
    out = np.empty((6, *X.shape[2:]))
    wp = cross(w, X[:, 3])
    out[:3] = w
    cross(w, wp, out[3:])
    out[3:] *= c
    wp *= 0.5
    out[3:] -= wp
    out[3:] += X[:, 3]
    return out
