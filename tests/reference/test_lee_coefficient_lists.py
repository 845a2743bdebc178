"""Lee 1977, Tables XIV, XXIV and XXXII: the printed coefficient lists against the generated matrices, entry by entry."""

import pytest
from lee_1977 import coefficients

pytestmark = pytest.mark.reference


def places(entries: tuple[str, ...]) -> set[str]:
    return {entry.partition(" ")[0] for entry in entries}


@pytest.mark.parametrize(("number", "wrong", "missing", "rank"), [
    ("XIV", {"Q(1,24)", "Q(4,24)"}, {"Q(2,5)"}, 23),
    ("XXIV", {"Q(1,24)", "Q(4,24)", "Q(2,13)", "Q(22,7)", "Q(22,9)", "Q(22,16)", "Q(22,18)", "Q(23,1)", "Q(23,3)",
              "Q(24,1)", "Q(24,10)", "Q(25,33)"}, {"Q(2,5)", "Q(20,13)", "Q(26,33)"}, 39),
    ("XXXII", {"Q(18,21)", "Q(19,21)", "Q(20,21)"}, set(), 34),
])  # fmt: skip
def test_entries(number: str, wrong: set[str], missing: set[str], rank: int) -> None:
    """Wrong: the input couple in the force rows (24), a letter for another, an index for another; all others are equal."""
    found = coefficients.compared(number)
    assert places(found.wrong) == wrong
    assert set(found.missing) == missing
    assert found.equal == found.printed - len(wrong)
    assert found.rank == rank
    assert found.size == {"XIV": 24, "XXIV": 40, "XXXII": 34}[number]
