"""Odd and wrong inputs at random (``fuzz``): an answer or an error of ours, within ten seconds. ``--attack N``: N seeds more of each."""

from pathlib import Path

import pytest
from fuzz import attack_call, attack_file, attack_mechanism

PER_SEED = 10
"""Inputs of a seed."""
MECHANISMS = 1002
"""First mechanism of the suite: in these none of the assemblies is a long one (some of ``--attack`` take more than the ten seconds)."""


@pytest.mark.seeds(6)
def test_mutated_files(seed: int, tmp_path: Path) -> None:
    for i in range(PER_SEED):
        attack_file(seed * PER_SEED + i, tmp_path)


@pytest.mark.seeds(40)
def test_wrong_types_at_every_door(seed: int) -> None:
    for i in range(PER_SEED):
        attack_call(seed * PER_SEED + i)


@pytest.mark.seeds(2)
def test_plausible_mechanisms(seed: int) -> None:
    for i in range(PER_SEED):
        attack_mechanism(MECHANISMS + seed * PER_SEED + i)
