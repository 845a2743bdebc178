"""Inertia tensors of simple bodies about their mass center.

The tensor of a body about a point is I = integral (|r|^2 1 - r r^T) dm, r from that point: its diagonal holds
the moments of inertia, its off-diagonals are *minus* the products of inertia (integral x y dm). Units are
mass times length squared, in whatever consistent set the arguments are in. Every function takes and returns
plain arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mechgraph.errors import DeclarationError
from mechgraph.maths.se3 import Array
from mechgraph.quantities import LARGEST, door, is_numeric, real_array, shown, wrong

__all__ = ["box", "cylinder", "from_components", "physical_faults", "rod", "shifted", "sphere"]


AXES_TOLERANCE = 1e-9
"""Largest deviation from 1 of axes^T axes that `box` takes for orthonormal axes."""


def _numbers(value: ArrayLike, what: str, shape: tuple[int, ...] = (), sign: str = "") -> Array:
    """Return finite numbers of a shape, where ``sign`` says so "positive" or "not negative"; DeclarationError for all else."""
    found = real_array(value)
    if (
        found is None
        or found.shape != shape
        or not np.isfinite(found).all()
        or (sign and not ((found > 0 if sign == "positive" else found >= 0) & (found < LARGEST)).all())
    ):
        count = {(): "a finite number", (3,): "three finite numbers", (3, 3): "3 x 3 finite numbers"}[shape]
        raise DeclarationError("inertia", [wrong(value, what, f"{count}{sign and ', '}{sign}")])
    return found


def _mass(mass: float) -> float:
    """Return the mass; DeclarationError where it is negative or no number."""
    return float(_numbers(mass, "mass", sign="not negative"))


def _length(length: float, what: str) -> float:
    """Return a length; DeclarationError where it is not positive or no number."""
    return float(_numbers(length, what, sign="positive"))


def _direction(vector: Array, what: str) -> Array:
    """Return the unit vector along a vector; DeclarationError where that is zero."""
    largest = float(np.abs(vector).max())
    if largest == 0.0:
        raise DeclarationError("inertia", [f"{what}, got {vector.tolist()}"])
    scaled = vector / largest
    unit: Array = scaled / np.linalg.norm(scaled)
    return unit


@door
def rod(mass: float, start: ArrayLike, end: ArrayLike) -> Array:
    """Return the inertia of a slender uniform rod between two points, about its middle.

    I = m l^2 / 12 (1 - u u^T), l the length and u the unit vector from start to end (Goldstein, Classical
    Mechanics, chapter 5).

    Parameters
    ----------
    mass : float
        Mass, not negative.
    start, end : (3,) array_like
        End points; they must differ. Only their difference matters.

    Returns
    -------
    (3, 3) ndarray
        Mass times length squared; singular, since the rod has no thickness.

    Raises
    ------
    DeclarationError
        Negative mass, points that coincide or are no points.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.inertia.rod(12.0, (0, 0, 0), (1, 0, 0)).tolist()
    [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    mass = _mass(mass)
    along = _numbers(end, "rod: end", (3,)) - _numbers(start, "rod: start", (3,))
    unit = _direction(along, "rod: start and end must differ; their difference must not be zero")
    return np.asarray(mass * (along @ along) / 12.0 * (np.eye(3) - np.outer(unit, unit)))


@door
def box(mass: float, size: ArrayLike, axes: ArrayLike | None = None) -> Array:
    """Return the inertia of a uniform box about its center.

    I = R diag(b^2 + c^2, c^2 + a^2, a^2 + b^2) R^T m / 12 for edges a, b, c along the columns of R.

    Parameters
    ----------
    mass : float
        Mass, not negative.
    size : (3,) array_like
        Edge lengths, positive.
    axes : (3, 3) array_like, optional
        Unit vectors along the edges, as columns; the coordinate axes if left out.

    Returns
    -------
    (3, 3) ndarray
        Mass times length squared.

    Raises
    ------
    DeclarationError
        Negative mass, an edge that is not positive, axes that are not orthonormal within `AXES_TOLERANCE`.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.inertia.box(12.0, (1, 2, 3)).diagonal()
    array([13., 10.,  5.])
    """
    mass = _mass(mass)
    edges = _numbers(size, "box: size", (3,), "positive")
    squares = edges**2
    principal = mass / 12.0 * (squares.sum() - squares)
    if axes is None:
        return np.asarray(np.diag(principal))
    frame = _numbers(axes, "box: axes", (3, 3))
    if not np.allclose(frame.T @ frame, np.eye(3), rtol=0, atol=AXES_TOLERANCE):
        raise DeclarationError("inertia", [f"box: axes must be three orthonormal columns, got {frame.tolist()}"])
    return _symmetric((frame * principal) @ frame.T)


@door
def cylinder(mass: float, radius: float, length: float, axis: ArrayLike = (0.0, 0.0, 1.0)) -> Array:
    """Return the inertia of a uniform solid cylinder about its center.

    I = m r^2 / 2 u u^T + m (3 r^2 + l^2) / 12 (1 - u u^T), u the unit vector along the axis.

    Parameters
    ----------
    mass : float
        Mass, not negative.
    radius, length : float
        Positive.
    axis : (3,) array_like
        Direction of the axis, of any length but zero.

    Returns
    -------
    (3, 3) ndarray
        Mass times length squared.

    Raises
    ------
    DeclarationError
        Negative mass, a radius or length that is not positive, a zero axis.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.inertia.cylinder(12.0, radius=1.0, length=3.0).diagonal()
    array([12., 12.,  6.])
    """
    mass, radius, length = (
        _mass(mass),
        _length(radius, "cylinder: radius"),
        _length(length, "cylinder: length"),
    )
    unit = _direction(_numbers(axis, "cylinder: axis", (3,)), "cylinder: axis must not be zero")
    along = np.outer(unit, unit)
    polar = mass * radius**2 / 2.0
    transverse = mass * (3.0 * radius**2 + length**2) / 12.0
    return np.asarray(polar * along + transverse * (np.eye(3) - along))


@door
def sphere(mass: float, radius: float) -> Array:
    """Return the inertia of a uniform solid sphere about its center, I = 2/5 m r^2 1.

    Parameters
    ----------
    mass : float
        Mass, not negative.
    radius : float
        Positive.

    Returns
    -------
    (3, 3) ndarray
        Mass times length squared.

    Raises
    ------
    DeclarationError
        Negative mass, a radius that is not positive.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.inertia.sphere(5.0, radius=1.0).diagonal()
    array([2., 2., 2.])
    """
    return np.asarray(0.4 * _mass(mass) * _length(radius, "sphere: radius") ** 2 * np.eye(3))


@door
def from_components(xx: float, yy: float, zz: float, xy: float = 0.0, xz: float = 0.0, yz: float = 0.0) -> Array:
    """Return the tensor of given moments and products of inertia.

    I = [[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]].

    Parameters
    ----------
    xx, yy, zz : float
        Moments of inertia, integral (y^2 + z^2) dm and so on.
    xy, xz, yz : float
        Products of inertia, integral x y dm and so on. The off-diagonals of the tensor are minus these; a
        program that reports the off-diagonals themselves (URDF, MuJoCo) needs its signs turned.

    Returns
    -------
    (3, 3) ndarray
        In the units of the arguments. Whether a body can have it is asked of `physical_faults`.

    Raises
    ------
    DeclarationError
        A component that is not a finite number.

    Examples
    --------
    >>> import mechgraph as mg
    >>> float(mg.inertia.from_components(2.0, 3.0, 4.0, xy=0.5)[0, 1])
    -0.5
    """
    given = {"xx": xx, "yy": yy, "zz": zz, "xy": xy, "xz": xz, "yz": yz}
    xx, yy, zz, xy, xz, yz = (float(_numbers(value, f"component {name}")) for name, value in given.items())
    return np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]], dtype=np.float64)


@door
def shifted(inertia: ArrayLike, mass: ArrayLike, offset: ArrayLike) -> Array:
    """Return the inertia about a point away from the mass center (parallel axes, Huygens and Steiner).

    I_P = I_G + m (|d|^2 1 - d d^T), d from the mass center G to P (its sign does not matter).

    Parameters
    ----------
    inertia : (..., 3, 3) array_like
        Tensor about the mass center.
    mass : (...) array_like
        Mass, not negative.
    offset : (..., 3) array_like
        The point, from the mass center.

    Returns
    -------
    (..., 3, 3) ndarray
        Mass times length squared.

    Raises
    ------
    DeclarationError
        Wrong shapes, numbers that are not finite, negative mass.
    """
    tensor, masses, away = (real_array(value) for value in (inertia, mass, offset))
    if tensor is None or masses is None or away is None or tensor.shape[-2:] != (3, 3) or away.shape[-1:] != (3,):
        wanted = "inertia (..., 3, 3), mass (...) and offset (..., 3), all numbers"
        raise DeclarationError(
            "inertia", [f"shifted: expected {wanted}, got {', '.join(map(shown, (inertia, mass, offset)))}"]
        )
    try:
        np.broadcast_shapes(tensor.shape[:-2], masses.shape, away.shape[:-1])
    except ValueError as error:
        raise DeclarationError("inertia", [f"shifted: {error}"]) from None
    if not (np.isfinite(tensor).all() and np.isfinite(away).all()):
        raise DeclarationError("inertia", ["shifted: inertia and offset must be finite"])
    if not (np.isfinite(masses) & (masses >= 0)).all():
        raise DeclarationError("inertia", [f"shifted: mass must be finite and not negative, got {shown(mass)}"])
    square = np.einsum("...i,...i->...", away, away)[..., None, None] * np.eye(3)
    outer = away[..., :, None] * away[..., None, :]
    return np.asarray(tensor + masses[..., None, None] * (square - outer))


@door
def physical_faults(inertia: Any, tol: float = 1e-9) -> list[str]:
    """Return what keeps a tensor from being the inertia of a body; an empty list where nothing does.

    A tensor is that of some distribution of mass exactly if it is symmetric and its principal moments satisfy
    a >= 0 and a + b >= c for a <= b <= c (Wittenburg, Dynamics of Multibody Systems, 2008, chapter 3). Zero
    (a point mass) and a slender rod (0, b, b) and a thin plate (a + b = c) pass.

    Parameters
    ----------
    inertia : (3, 3) array_like
        The tensor about the mass center, or about any other point.
    tol : float
        Tolerance of each comparison, relative to the largest entry of the tensor.

    Returns
    -------
    list of str
        One sentence a fault, with the values. The first fault that makes the further questions meaningless
        ends the list.
    """
    if not is_numeric(tol, ()):
        raise DeclarationError("inertia", [wrong(tol, "tol", "a finite number")])
    tensor = real_array(inertia)
    if tensor is None:
        return [f"inertia must be a 3 x 3 array of numbers, got {shown(inertia)}"]
    if tensor.shape != (3, 3):
        return [f"inertia must be 3 x 3, got shape {tensor.shape}"]
    if not np.isfinite(tensor).all():
        return [f"inertia must be finite, got {tensor.tolist()}"]
    scale = float(np.abs(tensor).max())
    if scale == 0.0:
        return []
    unsymmetric = [
        f"inertia must be symmetric, but I{a}{b} = {tensor[i, j]:.6g} and I{b}{a} = {tensor[j, i]:.6g}"
        for i, j, a, b in ((0, 1, "x", "y"), (0, 2, "x", "z"), (1, 2, "y", "z"))
        if abs(tensor[i, j] / scale - tensor[j, i] / scale) > tol
    ]
    if unsymmetric:
        return unsymmetric
    moments = np.linalg.eigvalsh(_symmetric(tensor / scale)) * scale
    least, middle, largest = (float(moment) for moment in moments)
    values = f"{least:.6g}, {middle:.6g}, {largest:.6g}"
    if least < -tol * scale:
        return [f"a principal moment of inertia must not be negative, but the principal moments are {values}"]
    if least + middle < largest - tol * scale:
        return [
            f"two principal moments of inertia must reach the third together, but {least:.6g} + "
            f"{middle:.6g} = {least + middle:.6g} < {largest:.6g}"
        ]
    return []


@door
def physical(inertia: Array, tol: float = 1e-9) -> NDArray[np.bool_]:
    """Which symmetric tensors ``(3, 3, ...)`` a body can have: ``a >= 0`` and ``a + b >= c`` for principal moments a <= b <= c."""
    inertia = _tensors(inertia)
    moments = np.linalg.eigvalsh(np.moveaxis(inertia, (0, 1), (-2, -1)))
    slack = tol * np.abs(inertia).max(axis=(0, 1))
    return np.asarray((moments[..., 0] >= -slack) & (moments[..., 0] + moments[..., 1] >= moments[..., 2] - slack))


def _tensors(inertia: Array) -> Array:
    array = real_array(inertia)
    if array is None or array.shape[:2] != (3, 3) or not np.isfinite(array).all():
        raise DeclarationError("inertia", [wrong(inertia, "tensors", "an array (3, 3, ...) of finite numbers")])
    return array


def _symmetric(tensor: Array) -> Array:
    """Return the symmetric part of a tensor, (I + I^T) / 2."""
    return (tensor + np.swapaxes(tensor, -1, -2)) / 2.0
