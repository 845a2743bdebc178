"""Identities of twists and wrenches."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mechgraph.maths import se3

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
