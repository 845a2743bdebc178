"""Identities of rotations, poses, twists and wrenches. Poses are (3, 4, ...), component axes first, positions last."""

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st

from mechgraph.maths import se3
from mechgraph.maths.newton import closest_zeros

VECTORS = st.lists(st.floats(-1, 1), min_size=3, max_size=3).map(np.array).filter(lambda v: np.linalg.norm(v) > 1e-3)
RATES = st.lists(st.floats(-2, 2), min_size=3, max_size=3).map(np.array)
ANGLES = st.one_of(
    st.floats(0, 1e-12),
    st.floats(1e-9, 1e-3),
    st.floats(0.1, 3.0),
    st.floats(0, 1e-3).map(lambda e: np.pi - e),
    st.floats(0, 1e-9).map(lambda e: np.pi - e),
)


def matrix_of_twist(s):
    out = np.zeros((4, 4))
    out[:3, :3] = se3.skew(s[:3])
    out[:3, 3] = s[3:]
    return out


@given(VECTORS, ANGLES)
def test_rotation_log_inverts_exp_also_near_zero_and_near_pi(axis, angle):
    v = angle * axis / np.linalg.norm(axis)
    back = se3.rotation_log(se3.rotation_exp(v))
    assert np.linalg.norm(back) <= np.pi + 1e-12
    other = v - 2 * np.pi * axis / np.linalg.norm(axis) if np.pi - angle < 1e-12 else v  # at pi either sign is right
    assert min(np.abs(back - v).max(), np.abs(back - other).max()) < 1e-12
    np.testing.assert_allclose(se3.rotation_exp(back), se3.rotation_exp(v), atol=1e-12)


@given(VECTORS, st.floats(0, 1e-9))
def test_small_rotation_vectors_keep_their_relative_accuracy(axis, size):
    v = size * axis / np.linalg.norm(axis)
    assert np.linalg.norm(se3.rotation_log(se3.rotation_exp(v)) - v) <= 1e-12 * np.linalg.norm(v)


@given(VECTORS, st.one_of(ANGLES, st.floats(3.0, 60.0)))
def test_rotation_exp_is_a_proper_rotation_and_the_matrix_exponential(axis, angle):
    v = angle * axis / np.linalg.norm(axis)
    R = se3.rotation_exp(v)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=1e-14)
    assert np.linalg.det(R) == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_allclose(R, scipy.linalg.expm(se3.skew(v)), atol=1e-12)


@given(VECTORS, st.one_of(ANGLES, st.floats(3.0, 20.0)), RATES)
def test_pose_exp_is_the_matrix_exponential(axis, angle, v):
    s = np.concatenate([angle * axis / np.linalg.norm(axis), v])
    np.testing.assert_allclose(se3.pose_exp(s), scipy.linalg.expm(matrix_of_twist(s))[:3], atol=1e-11)


@given(VECTORS, ANGLES, RATES)
def test_pose_log_inverts_exp(axis, angle, v):
    s = np.concatenate([angle * axis / np.linalg.norm(axis), v])
    X = se3.pose_exp(s)
    np.testing.assert_allclose(se3.pose_exp(se3.pose_log(X)), X, atol=1e-11)
    if np.pi - angle > 1e-6:
        np.testing.assert_allclose(se3.pose_log(X), s, atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 1e-13, 1e-9, 9.9e-5, 1.01e-4, 9.9e-4, 1.01e-3, 1e-2, 1.0])
def test_pose_exp_and_log_have_no_step_where_their_series_end(angle):
    s = np.concatenate([angle * np.array([0.6, 0.0, 0.8]), [0.3, -2.0, 0.7]])
    X = se3.pose_exp(s)
    np.testing.assert_allclose(X, scipy.linalg.expm(matrix_of_twist(s))[:3], atol=2e-16 * 40)
    np.testing.assert_allclose(se3.pose_log(X), s, atol=1e-14)


@given(VECTORS, ANGLES, RATES)
def test_pose_times_inverse_is_identity(axis, angle, v):
    X = se3.pose_exp(np.concatenate([angle * axis, v]))
    np.testing.assert_allclose(se3.compose(X, se3.inverse(X)), se3.identity(), atol=1e-14)
    np.testing.assert_allclose(se3.compose(se3.inverse(X), X), se3.identity(), atol=1e-14)


@given(RATES, RATES, RATES, RATES)
def test_compose_is_the_product_of_matrices(w1, v1, w2, v2):
    X, Y = (se3.pose_exp(np.concatenate(p)) for p in ((w1, v1), (w2, v2)))
    np.testing.assert_allclose(se3.to_matrix(se3.compose(X, Y)), se3.to_matrix(X) @ se3.to_matrix(Y), atol=1e-13)


@given(RATES, RATES)
def test_quaternions_multiply_as_their_matrices(a, b):
    qa, qb = se3.quaternion_exp(a), se3.quaternion_exp(b)
    product = se3.quaternion_matrix(se3.quaternion_product(qa, qb))
    np.testing.assert_allclose(product, se3.quaternion_matrix(qa) @ se3.quaternion_matrix(qb), atol=1e-14)
    np.testing.assert_allclose(
        se3.quaternion_product(qa, qa * np.array([1.0, -1.0, -1.0, -1.0])), [1, 0, 0, 0], atol=1e-15
    )


@given(VECTORS, st.one_of(ANGLES, st.floats(3.0, 3.3)))
def test_matrix_quaternion_inverts_quaternion_matrix_up_to_sign(axis, angle):
    q = se3.quaternion_exp(angle * axis / np.linalg.norm(axis))
    back = se3.matrix_quaternion(se3.quaternion_matrix(q))
    assert np.linalg.norm(back) == pytest.approx(1.0, abs=1e-14)
    assert min(np.abs(back - q).max(), np.abs(back + q).max()) < 1e-14


@pytest.mark.parametrize("axis", np.vstack([np.eye(3), -np.eye(3), [[0.6, 0.8, 0.0]]]))
def test_half_turns_have_a_logarithm(axis):
    R = 2 * np.outer(axis, axis) - np.eye(3)
    v = se3.rotation_log(R)
    assert np.linalg.norm(v) == pytest.approx(np.pi, abs=1e-14)
    np.testing.assert_allclose(np.abs(v), np.pi * np.abs(axis), atol=1e-14)


def test_every_function_of_a_batch_is_the_function_of_each():
    rng = np.random.default_rng(1)
    s, u = rng.normal(size=(2, 6, 4, 5))
    X, Y = se3.pose_exp(s), se3.pose_exp(u)
    for i in range(4):
        for t in range(5):
            x, y = se3.pose_exp(s[:, i, t]), se3.pose_exp(u[:, i, t])
            np.testing.assert_allclose(X[..., i, t], x, atol=1e-15)
            np.testing.assert_allclose(se3.compose(X, Y)[..., i, t], se3.compose(x, y), atol=1e-14)
            np.testing.assert_allclose(se3.inverse(X)[..., i, t], se3.inverse(x), atol=1e-14)
            np.testing.assert_allclose(se3.pose_log(X)[..., i, t], se3.pose_log(x), atol=1e-13)
            np.testing.assert_allclose(se3.to_matrix(X)[i, t], se3.to_matrix(x), atol=1e-15)
            np.testing.assert_allclose(se3.cross(s[:3], u[:3])[:, i, t], np.cross(s[:3, i, t], u[:3, i, t]), atol=1e-15)
            np.testing.assert_allclose(se3.rotate(X[:, :3], s[:3])[:, i, t], x[:, :3] @ s[:3, i, t], atol=1e-14)
            np.testing.assert_allclose(se3.rotate_back(X[:, :3], s[:3])[:, i, t], x[:, :3].T @ s[:3, i, t], atol=1e-14)


@pytest.mark.parametrize(
    ("formula", "widths"),
    [
        (se3.quaternion_product, (4, 4)),
        (se3.quaternion_exp, (3,)),
        (se3.quaternion_log, (4,)),
        (se3.turned, (4, 3)),
        (se3.turn_between, (4, 4)),
        (se3.turn_tangent, (3, 3)),
    ],
)
@pytest.mark.parametrize("kind", [float, complex])
def test_a_formula_of_a_batch_is_that_of_each(formula, widths, kind):
    rng = np.random.default_rng(5)
    vectors = []
    for width in widths:
        v = rng.normal(size=(width, 40)) * 10.0 ** rng.uniform(-9, 0.3, 40) + (
            1e-3j * rng.normal(size=(width, 40)) if kind is complex else 0.0
        )
        v[:, :2] = np.eye(width, 2)
        vectors.append(v if width == 3 else v / np.sqrt((v * v).sum(axis=0)))
    together = formula(*vectors)
    assert together.dtype == kind
    apart = np.stack([formula(*(v[:, t] for v in vectors)) for t in range(40)], axis=1)
    np.testing.assert_allclose(apart, together, rtol=1e-12, atol=1e-15)


@given(RATES, RATES, VECTORS, VECTORS)
def test_the_finite_twist_of_a_motion_takes_the_one_point_to_the_other(w1, w2, to, start):
    R = se3.rotation_exp(w1)
    X = np.column_stack([R, to - R @ start])
    np.testing.assert_allclose(se3.finite_twist(R, to, start), se3.pose_log(X), atol=1e-11)


# --- twists and wrenches ------------------------------------------------------------------------------------------------


SIX = st.lists(st.floats(-3, 3), min_size=6, max_size=6).map(np.array)


def adjoint(X):
    """Ad(X) of twists (w, v): [[R, 0], [p^ R, R]]."""
    R, p = X[:, :3], X[:, 3]
    return np.block([[R, np.zeros((3, 3))], [se3.skew(p) @ R, R]])


@given(SIX, SIX)
def test_move_twist_is_the_adjoint_matrix(g, s):
    X = se3.pose_exp(g)
    np.testing.assert_allclose(se3.move_twist(X, s), adjoint(X) @ s, atol=1e-12)


@given(SIX, SIX)
def test_move_wrench_is_the_inverse_transpose_of_the_adjoint(g, f):
    X = se3.pose_exp(g)
    np.testing.assert_allclose(se3.move_wrench(X, f), np.linalg.inv(adjoint(X)).T @ f, atol=1e-11)


@given(SIX, SIX, SIX)
def test_power_does_not_depend_on_the_frame(g, s, f):
    X = se3.pose_exp(g)
    assert se3.power(se3.move_twist(X, s), se3.move_wrench(X, f)) == pytest.approx(se3.power(s, f), abs=1e-10)


@given(SIX, SIX, SIX)
def test_moving_twice_is_moving_by_the_product(g, h, s):
    X, Y = se3.pose_exp(g), se3.pose_exp(h)
    np.testing.assert_allclose(
        se3.move_twist(X, se3.move_twist(Y, s)), se3.move_twist(se3.compose(X, Y), s), atol=1e-10
    )


@given(SIX, SIX)
def test_exp_of_a_moved_twist_is_the_conjugated_pose(g, s):
    X = se3.pose_exp(g)
    left = se3.pose_exp(se3.move_twist(X, s))
    right = se3.compose(se3.compose(X, se3.pose_exp(s)), se3.inverse(X))
    np.testing.assert_allclose(left, right, atol=1e-9)


@given(SIX, SIX)
def test_cross_twist_is_the_rate_of_a_twist_carried_along(V, S):
    h = 1e-3
    at = [se3.move_twist(se3.pose_exp(k * h * V), S) for k in (-2, -1, 1, 2)]
    rate = (at[0] - 8 * at[1] + 8 * at[2] - at[3]) / (12 * h)
    np.testing.assert_allclose(se3.cross_twist(V, S), rate, atol=1e-7)


@given(SIX, SIX, SIX)
def test_cross_twist_obeys_jacobi(a, b, c):
    x = se3.cross_twist
    np.testing.assert_allclose(x(a, x(b, c)) + x(b, x(c, a)) + x(c, x(a, b)), 0, atol=1e-10)


@given(SIX, SIX, SIX)
def test_adjoint_commutes_with_cross_twist(g, a, b):
    X = se3.pose_exp(g)
    moved = se3.cross_twist(se3.move_twist(X, a), se3.move_twist(X, b))
    np.testing.assert_allclose(moved, se3.move_twist(X, se3.cross_twist(a, b)), atol=1e-9)


@given(SIX, SIX, st.lists(st.floats(-3, 3), min_size=3, max_size=3).map(np.array))
def test_shift_wrench_keeps_power_with_the_velocity_of_the_point(f, V, point):
    at = se3.shift_wrench(f, point)
    velocity = V[3:] + np.cross(V[:3], point)
    assert at[:3] @ V[:3] + at[3:] @ velocity == pytest.approx(se3.power(V, f), abs=1e-10)


@pytest.mark.parametrize("i", range(6))
def test_move_constant_is_move_twist_and_move_wrench_of_unit_screws(i):
    rng = np.random.default_rng(i)
    X = se3.pose_exp(rng.normal(size=(6, 3, 4)))
    s = np.zeros(6)
    s[i] = 1.0
    whole = np.broadcast_to(s[:, None, None], (6, 3, 4))
    line, free = se3.move_constant(X, s[3:], s[:3])
    np.testing.assert_allclose(np.concatenate([line, free]), se3.move_twist(X, whole), atol=1e-14)
    line, free = se3.move_constant(X, s[:3], s[3:])
    np.testing.assert_allclose(np.concatenate([free, line]), se3.move_wrench(X, whole), atol=1e-14)


@given(st.integers(1, 8), st.integers(1, 8), st.integers(0, 8), st.integers(0, 2**31))
def test_null_space_is_orthonormal_and_has_the_right_dimension(m, n, rank, seed):
    rng = np.random.default_rng(seed)
    rank = min(rank, m, n)
    A = rng.normal(size=(m, rank)) @ rng.normal(size=(rank, n))
    N = se3.null_space(A, 1e-9)
    assert N.shape == (n, n - rank)
    np.testing.assert_allclose(N.T @ N, np.eye(n - rank), atol=1e-12)
    np.testing.assert_allclose(A @ N, 0, atol=1e-10)


def test_a_narrow_bent_valley_leads_to_its_zero() -> None:
    """``y = x^2, x / 10^6 = 1 / 10^6``: a whole step leaves the valley by the square of the way, a part of it gains as little."""

    class At:
        def __init__(self, x: np.ndarray) -> None:
            self.x, self.residual = x, np.stack([x[1] - x[0] ** 2, 1e-6 * (x[0] - 1.0)])

        def newton(self) -> np.ndarray:
            dx = 1.0 - self.x[0]
            return np.stack([dx, 2.0 * self.x[0] * dx - self.residual[0]])

    begin = np.array([[0.98, 1.02, 1.0], [0.98**2, 1.02**2, 1.2]])
    found, left = closest_zeros(At, At.newton, np.add, begin, 1e-13)
    assert np.abs(found - 1.0).max() < 1e-7
    assert left.max() <= 1e-13
