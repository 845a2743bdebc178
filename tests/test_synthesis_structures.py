"""Synthesis of chains: every choice of frame, input and output becomes a mechanism; answers are those of the mechanism alone."""

from typing import Any

import numpy as np
import pytest
from ladder import four_bar

import mechgraph as mg

FUNCTION = mg.function("A", "D", np.deg2rad([[0, 0], [72, -30], [144, -10], [216, 10], [288, 20]]))
PATH = mg.path("coupler.tip", [[0, 0], [1, 0.2], [1.5, 0.3]])


class Enough(Exception):
    """What was to be told has been told."""


def told_first(chains: Any, task: Any) -> list[str]:
    """What is told before anything is solved."""
    told: list[str] = []

    def listen(text: str) -> None:
        if any(word in text for word in ("track", "start", "random member", "first task")):
            raise Enough
        told.append(text)

    with pytest.raises(Enough):
        mg.synthesize(chains, task, minimize="size", progress=listen)
    return told


@pytest.mark.parametrize(
    ("task", "names"),
    [
        # from one link of a loop of four at the frame to another one: left out. Watt II leaves the two that are in different loops, whose
        # order does not matter; Stephenson II those in the loop of five, III one of two that are alike and the third, each way
        (FUNCTION, {"Watt II": 1, "Stephenson II": 2, "Stephenson III": 2}),
        # couplers in a loop of four with the frame are left out: Watt II has no others. Watt I: two couplers, two cranks; Stephenson I:
        # the same, which are alike two by two; II: three couplers, of which two are alike, two cranks; III: one, and cranks as above
        (PATH, {"Watt I": 4, "Stephenson I": 2, "Stephenson II": 4, "Stephenson III": 2}),
    ],
)
def test_six_bars_are_those_counted_by_hand_where_all_links_have_a_part(task: Any, names: dict[str, int]) -> None:
    told = told_first(mg.atlas(6, 1), task)
    found = [text.partition(",")[0] for text in told if ", choice" in text]
    assert {name: found.count(name) for name in found} == names
    assert told[0].startswith(f"2 chains: {sum(names.values())} mechanisms")


@pytest.mark.slow
def test_chains_of_four_links_do_what_declared_four_bars_do_and_are_ranked_together() -> None:
    s = mg.synthesize([*mg.atlas(4, 1), *mg.atlas(4, 1)], FUNCTION)
    assert "2 chains: 2 mechanisms" in s.evidence[0]
    assert (s.total, s.completeness, len(s.mechanism_of)) == (6, "tested", 6)
    transmission = [fit.transmission for fit in s.fitness if fit.good]
    assert (np.diff(transmission) < 1e-9).all()
    m = s.mechanism_of[0]
    assert [(p.name, p.a, p.b) for p in m.pairs][::3] == [("A", "frame", "L1"), ("D", "frame", "L3")]
    at = {name: m.pairs[k].point[:2] for k, name in enumerate("ABCD")}
    alone = mg.synthesize(four_bar(**at), FUNCTION, ["B.point", "C.point"])
    mine = s.taken([k for k, other in enumerate(s.mechanism_of) if other is m])
    assert np.allclose(mine.values, alone.values, atol=1e-9)
    assert mine.data.mechanism_of == (m.name,) * 3


@pytest.mark.slow
def test_six_bars_of_all_choices_do_a_function_exactly_whatever_pins_are_given() -> None:
    angles = np.linspace(0, 1.2, 4)
    asked = 0.5 * angles + 0.15 * np.sin(2 * angles)
    task = mg.function("input", "output", np.column_stack([angles, asked]))
    for seed in range(2):
        s = mg.synthesize(mg.atlas(6, 1), task, seed=seed)
        assert (s.total, s.completeness) == (204, "tested")
        for m, fitness in zip(s, s.fitness, strict=True):
            if fitness.good:
                turned = mg.kinematics(m, {"input": angles})["output"].position[:, 0]
                assert np.abs(np.exp(1j * (turned - asked)) - 1).max() < 1e-9


def test_what_chains_cannot_be_asked_is_told() -> None:
    with pytest.raises(mg.DeclarationError, match="expected turning pairs"):
        mg.synthesize(mg.atlas(4, 1, types=("R", "P")), FUNCTION)
    with pytest.raises(mg.DeclarationError, match=r"expected mg.function, mg.path or mg.poses"):
        mg.synthesize(mg.atlas(4, 1), mg.positions([{"A": 0.0}, {"A": 0.1}]))
    with pytest.raises(mg.DeclarationError, match="no sweep"):
        mg.synthesize(mg.atlas(4, 1), FUNCTION, sweep={"A.point.x": [0.0]})
    with pytest.raises(mg.DeclarationError, match="no chain"):
        mg.synthesize([], FUNCTION)
