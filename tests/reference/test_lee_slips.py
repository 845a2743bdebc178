"""Lee 1977, sections 3.8 to 3.14: his equations against the generated ones, and what the printed slips do when they are solved.

Revolute and prism pairs are interchanged in 3.166, 3.183, 3.187, 3.199, 3.201, 3.203 and 3.213. No pair row is made wrong: the
generated formulation is edited to what is printed and assembled at a solved position.
"""

import numpy as np
import pytest
from lee_1977 import chains, equations

import mechgraph as mg

pytestmark = pytest.mark.reference

NAMES = tuple(chains.SECTIONS)
ALONE = tuple(slip for slip in chains.SLIPS if len(slip.pairs) == 1)
SAME = (equations.AGREES, equations.OTHER_SIDE)
LETTERS = {
    ("7r", "after 3.106"), ("rprhrrr", "after 3.126"), ("rprrhc", "3.168"), ("pphchp", "3.186"), ("pphchp", "3.188"),
    ("rcrcr", "after 3.199"),
}  # fmt: skip
LEFT_OUT = {
    ("rrrrrrh", "R56 = F56 + F^A6 A6"), ("rcrcr", "F45 . A5 = 0"), ("phchc", "R34 + R54 + FI4 + FOUT = 0"),
    ("phchc", "FIN = F^IN A1"),
}  # fmt: skip


def found(verdict: str) -> list[tuple[str, equations.Match]]:
    return [(name, x) for name in NAMES for x in equations.matched(name) if x.verdict == verdict]


def test_every_numbered_equation_is_compared() -> None:
    numbers = [number for name in NAMES for number, _ in equations.printed_equations(name) if number.startswith("3.")]
    assert numbers == [f"3.{n}" for n in range(106, 227)]


def test_other_wrenches_are_the_slips_and_no_more() -> None:
    wrong = {(name, x.number) for name, x in found(equations.WRENCH)}
    assert wrong == {(slip.name, slip.equations) for slip in ALONE}


def test_other_letters_left_out_and_printed_twice() -> None:
    assert {(name, x.number) for name, x in found(equations.LETTER)} == LETTERS
    assert {(name, x.generated) for name, x in found(equations.LEFT_OUT)} == LEFT_OUT
    assert [x.number for _, x in found(equations.TWICE)] == ["3.212"]


def test_all_others_agree() -> None:
    different = sum(x.verdict not in SAME for name in NAMES for x in equations.matched(name))
    assert different == len(ALONE) + len(LETTERS) + len(LEFT_OUT) + 1


@pytest.mark.parametrize("slip", ALONE, ids=lambda slip: f"{slip.name} {slip.equations}")
def test_the_edited_formulation_is_the_printed_one(slip: chains.Slip) -> None:
    """After the edit the comparison finds the printed wrench in that equation, and nothing else is changed."""
    m = equations.output_only(slip.name)
    edited = chains.as_printed(mg.formulate(m, bookkeeping="lee"), slip.pairs[0])
    before = {x.number: x.verdict for x in equations.matched(slip.name)}
    after = {x.number: x.verdict for x in equations.matched(slip.name, edited)}
    assert before[slip.equations] == equations.WRENCH
    assert after[slip.equations] in (*SAME, equations.LETTER)
    assert {k: v for k, v in after.items() if k != slip.equations} == {
        k: v for k, v in before.items() if k != slip.equations
    }


RANKS = {
    "3.166": 42, "3.183": 42, "3.187": 42, "3.183, 3.187": 42, "3.199": 33, "3.201": 34, "3.203": 34,
    "3.199, 3.201, 3.203": 32, "3.213": 33,
}  # fmt: skip


@pytest.mark.parametrize("position", [4, 10, 47])
@pytest.mark.parametrize("slip", chains.SLIPS, ids=lambda slip: f"{slip.name} {slip.equations}")
def test_rank_and_driver_effort_as_printed(slip: chains.Slip, position: int) -> None:
    """The generated matrix has full rank; the printed one loses rank, or gives another driver effort."""
    effect = chains.effect(slip, position)
    assert effect.rank == effect.size
    assert effect.printed_rank == RANKS[slip.equations]
    if effect.printed_rank < effect.size:
        assert np.isnan(effect.printed_effort)
    else:
        assert abs(effect.printed_effort - effect.effort) > 0.05 * abs(effect.effort)


def test_what_the_duplicate_of_the_input_does() -> None:
    """3.199 (a couple along A1) and 3.213 (a force along A1) repeat the column of the driver: only their sum is determined."""
    for slip in chains.SLIPS:
        if slip.equations in ("3.199", "3.213"):
            m = mg.load(slip.name)
            f = chains.as_printed(mg.formulate(m, bookkeeping="lee"), slip.pairs[0])
            Q = f.assemble(mg.solve(m).state(10))[0].toarray()
            driver = next(j for j, u in enumerate(f.unknowns) if u.group == "driver")
            same = [j for j in range(len(f.unknowns)) if j != driver and np.allclose(Q[:, j], Q[:, driver], atol=1e-12)]
            assert [f.unknowns[j].owner for j in same] == ["O1"]
