"""Inertia tensors: closed forms, integrals over point clouds, rotation, and what a body cannot have."""

import numpy as np
import pytest
import scipy

import mechgraph as mg

EDGE, WEIGHT = np.polynomial.legendre.leggauss(4)


def integral(points, masses):
    """The definition, sum of m (|r|^2 1 - r r^T)."""
    square = np.einsum("k,ki,ki->", masses, points, points)
    return square * np.eye(3) - np.einsum("k,ki,kj->ij", masses, points, points)


def brick(mass, size):
    """Gauss points of a box: exact for polynomials of degree 7."""
    grid = np.stack(np.meshgrid(EDGE, EDGE, EDGE, indexing="ij"), -1).reshape(-1, 3)
    weight = np.einsum("i,j,k->ijk", WEIGHT, WEIGHT, WEIGHT).ravel() / 8.0
    return grid * np.asarray(size) / 2.0, mass * weight


def pin(mass, radius, length):
    """Points of a cylinder along z, exact for quadratic integrands."""
    angles = np.arange(8) * np.pi / 4
    rings = np.sqrt((EDGE + 1) / 2)  # uniform in r^2
    r, a, z = np.meshgrid(rings * radius, angles, EDGE * length / 2, indexing="ij")
    weight = np.einsum("i,j,k->ijk", WEIGHT / 2, np.full(8, 1 / 8), WEIGHT / 2).ravel()
    points = np.stack([r * np.cos(a), r * np.sin(a), z], -1).reshape(-1, 3)
    return points, mass * weight


@pytest.fixture
def turn():
    return scipy.spatial.transform.Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()


def test_rod_is_the_integral_along_it():
    start, end = np.array([1.0, -2.0, 0.5]), np.array([2.0, 1.0, 3.0])
    points = np.outer(EDGE / 2, end - start)
    np.testing.assert_allclose(mg.inertia.rod(3.0, start, end), integral(points, 3.0 * WEIGHT / 2), atol=1e-14)
    np.testing.assert_allclose(mg.inertia.rod(12.0, (0, 0, 0), (2, 0, 0)), np.diag([0.0, 4.0, 4.0]), atol=1e-15)


def test_rod_has_no_moment_about_itself_and_no_direction(turn):
    along = turn @ [0.0, 0.0, 2.0]
    tensor = mg.inertia.rod(5.0, (0, 0, 0), along)
    np.testing.assert_allclose(tensor @ along, 0.0, atol=1e-14)
    np.testing.assert_array_equal(tensor, mg.inertia.rod(5.0, along, (0, 0, 0)))


def test_box_is_the_integral_over_it(turn):
    size = (0.3, 1.2, 2.0)
    points, masses = brick(7.0, size)
    np.testing.assert_allclose(mg.inertia.box(7.0, size), integral(points, masses), atol=1e-14)
    np.testing.assert_allclose(mg.inertia.box(7.0, size, turn), integral(points @ turn.T, masses), atol=1e-14)
    np.testing.assert_allclose(mg.inertia.box(12.0, (1, 2, 3)), np.diag([13.0, 10.0, 5.0]), rtol=1e-15)


def test_box_with_axes_is_exactly_symmetric(turn):
    tensor = mg.inertia.box(7.0, (0.3, 1.2, 2.0), turn)
    np.testing.assert_array_equal(tensor, tensor.T)


def test_cylinder_is_the_integral_over_it(turn):
    points, masses = pin(2.0, 0.4, 1.5)
    np.testing.assert_allclose(mg.inertia.cylinder(2.0, 0.4, 1.5), integral(points, masses), atol=1e-14)
    turned = mg.inertia.cylinder(2.0, 0.4, 1.5, 7.0 * turn[:, 2])
    np.testing.assert_allclose(turned, integral(points @ turn.T, masses), atol=1e-14)


def test_cylinder_takes_axes_of_any_length():
    for length in (1e-200, 1e200):
        tensor = mg.inertia.cylinder(2.0, 1.0, 1.0, (length, 0, 0))
        np.testing.assert_allclose(tensor, np.diag([1.0, 2 / 3, 2 / 3]), rtol=1e-15)


def test_thin_cylinder_is_a_rod():
    thin = mg.inertia.cylinder(3.0, 1e-9, 2.0, (1, 1, 0))
    np.testing.assert_allclose(thin, mg.inertia.rod(3.0, (0, 0, 0), np.sqrt(2) * np.array([1, 1, 0])), atol=1e-15)


def test_sphere_closed_form_and_rotation(turn):
    tensor = mg.inertia.sphere(5.0, 2.0)
    np.testing.assert_allclose(tensor, 8.0 * np.eye(3), rtol=1e-15)
    np.testing.assert_allclose(turn @ tensor @ turn.T, tensor, atol=1e-14)


def test_products_of_inertia_enter_with_a_minus():
    point = np.array([1.0, 2.0, 3.0])
    tensor = mg.inertia.from_components(13.0, 10.0, 5.0, xy=2.0, xz=3.0, yz=6.0)  # of a unit mass at that point
    np.testing.assert_array_equal(tensor, integral(point[None], np.ones(1)))


def test_parallel_axes_is_the_integral_about_the_other_point():
    points, masses = brick(7.0, (0.3, 1.2, 2.0))
    offset = np.array([0.5, -1.0, 2.0])
    moved = mg.inertia.shifted(mg.inertia.box(7.0, (0.3, 1.2, 2.0)), 7.0, offset)
    np.testing.assert_allclose(moved, integral(points - offset, masses), rtol=1e-14)
    np.testing.assert_array_equal(moved, mg.inertia.shifted(mg.inertia.box(7.0, (0.3, 1.2, 2.0)), 7.0, -offset))


def test_shifted_takes_leading_axes():
    offsets = np.arange(12.0).reshape(4, 3)
    many = mg.inertia.shifted(mg.inertia.sphere(2.0, 1.0), [1.0, 2.0, 3.0, 4.0], offsets)
    assert many.shape == (4, 3, 3)
    np.testing.assert_array_equal(many[2], mg.inertia.shifted(mg.inertia.sphere(2.0, 1.0), 3.0, offsets[2]))


@pytest.mark.parametrize(
    "tensor",
    [
        np.zeros((3, 3)),
        mg.inertia.rod(1.0, (0, 0, 0), (1, 2, 3)),
        np.diag([1.0, 2.0, 3.0]),  # a thin plate
        1e-12 * np.diag([1.0, 1.0, 1.5]),
        mg.inertia.box(1e9, (1, 2, 3)),
        mg.inertia.shifted(mg.inertia.rod(1.0, (0, 0, 0), (1, 2, 3)), 1.0, (5.0, 6.0, 7.0)),
    ],
)
def test_bodies_have_no_faults(tensor):
    assert mg.inertia.physical_faults(tensor) == []


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e12])
def test_faults_say_the_values(scale, turn):
    negative = mg.inertia.physical_faults(scale * turn @ np.diag([-1.0, 2.0, 3.0]) @ turn.T)
    assert len(negative) == 1
    assert f"{-scale:.6g}, {2 * scale:.6g}, {3 * scale:.6g}" in negative[0]
    flat = mg.inertia.physical_faults(scale * turn @ np.diag([1.0, 2.0, 3.5]) @ turn.T)
    assert len(flat) == 1
    assert f"{scale:.6g} + {2 * scale:.6g} = {3 * scale:.6g} < {3.5 * scale:.6g}" in flat[0]


def test_faults_of_form():
    assert mg.inertia.physical_faults(np.eye(2)) == ["inertia must be 3 x 3, got shape (2, 2)"]
    assert "numbers" in mg.inertia.physical_faults("heavy")[0]
    assert "finite" in mg.inertia.physical_faults(np.full((3, 3), np.nan))[0]
    uneven = np.eye(3)
    uneven[0, 1], uneven[1, 2] = 0.1, 0.2
    assert mg.inertia.physical_faults(uneven) == [
        "inertia must be symmetric, but Ixy = 0.1 and Iyx = 0",
        "inertia must be symmetric, but Iyz = 0.2 and Izy = 0",
    ]


def test_tolerance_is_relative():
    nearly = np.diag([1.0, 2.0, 3.0 + 1e-6])
    assert mg.inertia.physical_faults(nearly, tol=1e-5) == []
    assert mg.inertia.physical_faults(nearly)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: mg.inertia.rod(-1.0, (0, 0, 0), (1, 0, 0)), "mass"),
        (lambda: mg.inertia.rod(1.0, (1, 2, 3), (1, 2, 3)), "must differ"),
        (lambda: mg.inertia.rod(1.0, (0, 0), (1, 0, 0)), "start"),
        (lambda: mg.inertia.rod(1.0, (0, 0, 0), "end"), "end"),
        (lambda: mg.inertia.box(np.nan, (1, 1, 1)), "mass"),
        (lambda: mg.inertia.box(1.0, (1, 0, 1)), "size"),
        (lambda: mg.inertia.box(1.0, (1, 1, 1), 2 * np.eye(3)), "orthonormal"),
        (lambda: mg.inertia.cylinder(1.0, 0.0, 1.0), "radius"),
        (lambda: mg.inertia.cylinder(1.0, 1.0, -1.0), "length"),
        (lambda: mg.inertia.cylinder(1.0, 1.0, 1.0, (0, 0, 0)), "axis"),
        (lambda: mg.inertia.sphere(1.0, np.inf), "radius"),
        (lambda: mg.inertia.from_components(1.0, 1.0, np.nan), "zz"),
        (lambda: mg.inertia.shifted(np.eye(3), -1.0, (0, 0, 0)), "mass"),
        (lambda: mg.inertia.shifted(np.eye(2), 1.0, (0, 0, 0)), "inertia"),
        (lambda: mg.inertia.shifted(np.eye(3), 1.0, (0, 0, np.nan)), "finite"),
    ],
)
def test_invalid_arguments_are_named(call, says):
    with pytest.raises(mg.DeclarationError, match=says):
        call()
