"""Lee 1977, Tables XIV, XXIV and XXXII: the printed coefficient lists against the generated matrices, entry by entry."""

import pytest
from lee_1977 import coefficients

pytestmark = pytest.mark.reference


def block(first: int, column: int, count: int) -> set[str]:
    return {f"Q({first + i},{column})" for i in range(count)}


def row(i: int, *columns: int) -> set[str]:
    return {f"Q({i},{j})" for j in columns}


def places(entries: tuple[str, ...]) -> set[str]:
    return {entry.partition(" ")[0] for entry in entries}


@pytest.mark.parametrize(("number", "wrong", "missing", "rank"), [
    ("XIV", block(1, 24, 6), {"Q(2,5)"}, 23),
    ("XXIV", block(1, 24, 6) | {"Q(2,13)", "Q(25,33)"} | row(22, 7, 8, 9, 16, 17, 18) | row(23, 1, 2, 3) | row(24, 1, 2, 3, 10, 11, 12),
     {"Q(2,5)", "Q(20,13)", "Q(26,33)"}, 39),
    ("XXXII", block(18, 21, 3), set(), 34),
])  # fmt: skip
def test_entries(number: str, wrong: set[str], missing: set[str], rank: int) -> None:
    """Wrong: the input couple in the force rows (24), a letter for another, an index for another; all others are equal.

    Letters in general axes: in Lee's own, A1 = (1, 0, 0) through the origin and A40y = 0 make wrong ones zero, and equal.
    """
    found = coefficients.compared(number)
    assert places(found.wrong) == wrong
    assert set(found.missing) == missing
    assert found.equal == found.printed - len(wrong)
    assert found.rank == rank
    assert found.size == {"XIV": 24, "XXIV": 40, "XXXII": 34}[number]


@pytest.mark.parametrize(
    ("number", "count", "wrong"), [("XIV", 18, set()), ("XXIV", 0, set()), ("XXXII", 24, {21, 22, 23})]
)
def test_right_sides(number: str, count: int, wrong: set[int]) -> None:
    """C(21) to C(23) of Table XXXII hold A5x M_out / rho5, which is no part of the output couple; 22 and 23 with A5x for A5y, A5z."""
    found = coefficients.compared(number)
    assert found.right_sides == count
    assert places(found.wrong_right_sides) == {f"C({i})" for i in wrong}
    assert all("A5x Mout / rho5" in entry for entry in found.wrong_right_sides)
