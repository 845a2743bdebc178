"""The printed tables, and the axes they are given in."""

import csv
from pathlib import Path

import numpy as np

DATA = Path(__file__).resolve().parents[2] / "tests" / "reference" / "data"
G = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""(x, y, z) of Lee = G (x, y, z) of the library files: his x is -z, the axis A_1; his -y runs from O1 to O2."""
X = np.array([1.0, 0.0, 0.0])


def table(number: str) -> dict[str, np.ndarray]:
    """A printed table as columns by name."""
    with (DATA / f"lee_table_{number}.csv").open(encoding="utf-8") as handle:
        rows = list(csv.reader(line for line in handle if not line.startswith("#")))
    values = np.array(rows[1:], dtype=float).T
    return dict(zip(rows[0], values, strict=True))


def printed(number: str, *names: str) -> np.ndarray:
    """Columns of a printed table, ``(rows, columns)``; all but the first where no name is given."""
    columns = table(number)
    return np.column_stack([columns[n] for n in (names or tuple(columns)[1:])])


def coefficients(number: str) -> list[tuple[int, int, str]]:
    """Printed entries Q(row, column) = value of Tables XIV, XXIV, XXXII, every entry once; C(row) has column 0."""
    with (DATA / f"lee_table_{number}.csv").open(encoding="utf-8") as handle:
        rows = list(csv.reader(line for line in handle if not line.startswith("#")))
    return sorted({(int(i), int(j), value) for i, j, value in rows[1:]})


def lees(v: np.ndarray) -> np.ndarray:
    """Vectors ``(..., 3)`` of the library's global frame in Lee's axes."""
    return v @ G.T


def ours(v: np.ndarray) -> np.ndarray:
    """Vectors ``(..., 3)`` in Lee's axes in the library's global frame."""
    return v @ G


def wrench(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment about the origin in Lee's axes of wrenches ``(..., 6)``."""
    return lees(values[..., 3:]), lees(values[..., :3])


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Scalar products along the last axis."""
    return (a * b).sum(axis=-1)


def largest(differences: np.ndarray) -> float:
    """Largest absolute value, NaN left out."""
    return float(np.nanmax(np.abs(differences)))


def without_axis(force: np.ndarray, moment: np.ndarray, axis: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Lee's columns of a revolute pair: F^ without the force along the axis, M^ without its moment, and that force."""
    along = dot(force, axis)
    return np.column_stack(
        [force - along[:, None] * axis, moment - along[:, None] * np.cross(point, axis), along]
    )  # fmt: skip


def axial_sums(force: np.ndarray, moment: np.ndarray, axis: np.ndarray, point: np.ndarray) -> np.ndarray:
    """F^ . A^ = 0: force along an axis, and moment about it."""
    return np.column_stack([dot(force, axis), dot(moment, axis) + dot(force, np.cross(point, axis))])


def last_place(number: str) -> dict[str, float]:
    """Size of the last printed digit of every column of a table, 0.01 for ``-.57``."""
    with (DATA / f"lee_table_{number}.csv").open(encoding="utf-8") as handle:
        rows = list(csv.reader(line for line in handle if not line.startswith("#")))
    columns = zip(rows[0], *rows[1:], strict=True)
    return {name: 10.0 ** -max(len(cell.partition(".")[2]) for cell in cells) for name, *cells in columns}
