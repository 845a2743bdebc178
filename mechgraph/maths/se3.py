"""Rotations, poses, twists and wrenches: composed, inverted, exponential and logarithm, moved by a pose, their spans.

A pose is the upper three rows of the homogeneous matrix, ``(3, 4, ...)``: rotation ``X[:, :3]`` and position ``X[:, 3]``. Twist ``(w, v)``
angular first, ``v`` the velocity of the body point at the origin; wrench ``(M, F)`` moment first, about the origin. Power is the plain
product ``w . M + v . F``: no swap matrix.
Source: Murray, Li and Sastry, A Mathematical Introduction to Robotic Manipulation, 1994, chapter 2.

A call of numpy for a single vector takes as long as twenty operations of Python's own numbers: a path is followed from one position to
the next, and what it costs is such calls. So a formula of vector components is written once, with the functions of a library that is
handed to it, and evaluated with arrays, or with plain numbers where there are few of them.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from itertools import chain
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
Library = Any
"""Where a formula finds ``sqrt``, ``sin``, ``cos``, ``arctan``, ``where`` and ``all``: numpy, or the same of plain numbers."""


REAL_NUMBERS, COMPLEX_NUMBERS = (
    SimpleNamespace(
        sqrt=module.sqrt,
        sin=module.sin,
        cos=module.cos,
        arctan=module.atan,
        where=lambda condition, value, other: value if condition else other,
        all=bool,
    )
    for module in (math, cmath)
)


class by_components:
    """A ``formula(library, *components)`` that gives components, as a function of vectors ``(m, ...)``."""

    def __init__(self, formula: Callable[..., tuple[Any, ...]]) -> None:
        self.formula, self.__doc__ = formula, formula.__doc__

    def __call__(self, *vectors: Array) -> Array:
        """Vectors ``(k, ...)``; the batch axes of arguments may be broadcast."""
        batch = vectors[0].shape[1:]
        count = math.prod(batch)
        # vectors up to which plain numbers are faster (measured)
        if 0 < count <= 12:
            try:
                joined = np.concatenate(vectors).reshape(-1, count)
                library = COMPLEX_NUMBERS if joined.dtype.kind == "c" else REAL_NUMBERS
                found = np.array([self.formula(library, *column) for column in joined.T.tolist()])
                return found.T.reshape(-1, *batch)
            except (ArithmeticError, ValueError):
                pass  # where plain numbers have no value arrays have NaN or infinity
        rows = self.formula(np, *chain(*vectors))
        out = np.empty((len(rows), *np.broadcast_shapes(*map(np.shape, rows))), dtype=np.result_type(*rows))
        for i, row in enumerate(rows):
            out[i] = row
        return out


Components = tuple[Any, ...]

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


@by_components
def quaternion_product(
    lib: Library, a0: Any, a1: Any, a2: Any, a3: Any, b0: Any, b1: Any, b2: Any, b3: Any
) -> Components:
    """Product of quaternions ``(4, ...)``, scalar part first."""
    return (
        a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
        a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
        a0 * b2 + a2 * b0 + a3 * b1 - a1 * b3,
        a0 * b3 + a3 * b0 + a1 * b2 - a2 * b1,
    )


@by_components
def quaternion_exp(lib: Library, x: Any, y: Any, z: Any) -> Components:
    """Unit quaternion of a rotation vector ``v (3, ...)``: ``(cos |v|/2, sin(|v|/2) v/|v|)``."""
    half = 0.5 * lib.sqrt(x * x + y * y + z * z)
    zero = half == 0.0
    part = 0.5 * (lib.sin(half) + zero) / (half + zero)
    return lib.cos(half), part * x, part * y, part * z


@by_components
def quaternion_log(lib: Library, w: Any, x: Any, y: Any, z: Any) -> Components:
    """Rotation vector of a unit quaternion, of length at most pi (of its real part, where it is complex).

    ``2 atan(s / q_0) q_v / s`` with ``s = sqrt(q_v . q_v)``, near a half turn ``(pi - 2 atan(q_0 / s)) q_v / s``: both analytic.
    """
    sign = lib.where(w.real < 0.0, -1.0, 1.0)
    w = sign * w
    sine = lib.sqrt(x * x + y * y + z * z)
    small, beyond = abs(sine) < 1e-12, abs(sine) > abs(w)
    safe = lib.where(small, 1.0, sine)
    half = lib.arctan(lib.where(beyond, w, safe) / lib.where(beyond, safe, w))
    part = sign * lib.where(small, 2.0, lib.where(beyond, math.pi - 2.0 * half, 2.0 * half) / safe)
    return part * x, part * y, part * z


@by_components
def turned(lib: Library, w: Any, x: Any, y: Any, z: Any, a: Any, b: Any, c: Any) -> Components:
    """Unit quaternions ``q (4, ...)`` after rotation vectors ``v (3, ...)``: ``exp(v) q``, made unit again."""
    w, x, y, z = quaternion_product.formula(lib, *quaternion_exp.formula(lib, a, b, c), w, x, y, z)
    size = lib.sqrt(w * w + x * x + y * y + z * z)
    return w / size, x / size, y / size, z / size


@by_components
def turn_between(lib: Library, w1: Any, x1: Any, y1: Any, z1: Any, w0: Any, x0: Any, y0: Any, z0: Any) -> Components:
    """Rotation vector from ``q0`` to ``q1`` (the first argument) by the short way."""
    return quaternion_log.formula(lib, *quaternion_product.formula(lib, w1, x1, y1, z1, w0, -x0, -y0, -z0))


@by_components
def turn_tangent(lib: Library, x: Any, y: Any, z: Any, a: Any, b: Any, c: Any) -> Components:
    """``dexp^-1(v) w = w - v x w / 2 + (1 - (a / 2) cot(a / 2)) / a^2  v x (v x w)`` with ``a = |v|``, below two turns."""
    p, q, r = y * c - z * b, z * a - x * c, x * b - y * a
    square = x * x + y * y + z * z
    small = abs(square) < 1e-2
    part = 1 / 12 + square * (1 / 720 + square * (1 / 30240 + square / 1209600))
    if not lib.all(small):
        half = 0.5 * lib.sqrt(lib.where(small, 1.0, square))
        part = lib.where(small, part, (1.0 - half * lib.cos(half) / lib.sin(half)) / (4.0 * half * half))
    return (
        a - 0.5 * p + part * (y * r - z * q),
        b - 0.5 * q + part * (z * p - x * r),
        c - 0.5 * r + part * (x * q - y * p),
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


HALF_TANGENT = np.zeros((4, 9))
"""From the nine entries of a rotation matrix to ``2 sin(angle) axis`` and ``trace = 1 + 2 cos(angle)``."""
HALF_TANGENT[(0, 1, 2, 3, 3, 3), (7, 2, 3, 0, 4, 8)] = 1.0
HALF_TANGENT[(0, 1, 2), (5, 6, 1)] = -1.0
NEAR = 1e-4
"""``tan(angle/2)^2`` up to which the series of ``_arctan_parts`` are exact to rounding (0.02 radians)."""


class WideTurn(ArithmeticError):
    """A rotation so wide that ``tan(angle/2)`` does not serve."""


def _arctan_parts(lib: Library, u: Any) -> Components:
    """``g = atan(t) / t`` and ``h = (1 - g) / u`` for ``u = t^2``: analytic in ``u``, a series where ``u`` is small."""
    h = 1 / 3 + u * (u * (1 / 7) - 1 / 5)
    g = 1.0 - u * h
    small = abs(u) <= NEAR
    if lib.all(small):
        return g, h
    safe = lib.where(small, 1.0, u)
    t = lib.sqrt(safe)
    g = lib.where(small, g, lib.arctan(t) / t)
    return g, lib.where(small, h, (1.0 - g) / safe)


@by_components
def _finite_twist(
    lib: Library, a: Any, b: Any, c: Any, trace: Any, x1: Any, y1: Any, z1: Any, x0: Any, y0: Any, z0: Any
) -> Components:
    """``finite_twist`` from ``2 sin(angle) axis``, ``trace``, ``to`` and ``start``."""
    # ``3 - trace = 2 - 2 cos(angle)`` at 120 degrees: beyond, a rotation vector is found through quaternions
    if not lib.all(abs(trace - 3.0) < 3.0):
        raise WideTurn
    more = trace + 1.0
    a, b, c = a / more, b / more, c / more
    x, y, z = x1 + x0, y1 + y0, z1 + z0
    x, y, z = x1 - x0 - (b * z - c * y), y1 - y0 - (c * x - a * z), z1 - z0 - (a * y - b * x)
    g, h = _arctan_parts(lib, a * a + b * b + c * c)
    along = h * (a * x + b * y + c * z)
    return 2.0 * g * a, 2.0 * g * b, 2.0 * g * c, g * x + along * a, g * y + along * b, g * z + along * c


def finite_twist(R: Array, to: Array, start: Array) -> Array:
    """Finite twist ``(w, v)`` of the motion that turns by ``R (3, 3, ...)`` and takes the point ``start`` to the point ``to (3, ...)``.

    With ``tau = tan(angle/2) axis = 2 sin(angle) axis / (1 + trace)``, rational in the entries of ``R``, Cayley's
    ``c = to - start - tau x (to + start)``, ``g = atan(|tau|) / |tau|`` and ``h = (1 - g) / |tau|^2``:
    ``w = 2 g tau``, ``v = g c + h (tau . c) tau``.
    Near a half turn, where ``tau`` has no bound, through quaternions. Comparisons choose a formula; each of them is analytic.
    """
    try:
        return _finite_twist(HALF_TANGENT.dot(R.reshape(9, -1)).reshape(4, *R.shape[2:]), to, start)
    except WideTurn:
        return _wide_finite_twist(R, to - rotate(R, start))


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
