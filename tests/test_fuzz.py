"""Odd and wrong inputs at random (``fuzz``): an answer or an error of ours, within ten seconds. ``--attack N``: N seeds more of each."""

import inspect
from pathlib import Path

import pytest
from fuzz import attack_call, attack_file, attack_mechanism
from public import every_door, functions, methods, results

import mechgraph as mg

PER_SEED = 5
"""Inputs of a seed."""
MECHANISMS = 1002
"""First mechanism of the suite: in these none of the assemblies is a long one (some of ``--attack`` take more than the ten seconds)."""


@pytest.mark.seeds(6)
def test_mutated_files(seed: int, tmp_path: Path) -> None:
    for i in range(PER_SEED):
        attack_file(seed * PER_SEED + i, tmp_path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the doors write."""
    return tmp_path_factory.mktemp("doors")


@pytest.mark.seeds(40)
def test_wrong_types_at_every_door(seed: int, folder: Path) -> None:
    for i in range(PER_SEED):
        attack_call(seed * PER_SEED + i, folder)


def test_every_public_callable_is_attacked(folder: Path) -> None:
    """Each is there under its own name."""
    public = {*functions(), *(f"{cls.__name__}.{name}" for cls in results() for name in methods(cls))}
    assert {name.split()[0] for name, *_ in every_door(folder)} == public


def test_every_public_function_looks_at_its_arguments() -> None:
    """By one check, made from its signature; classes look at their values themselves."""
    assert [
        name for name, one in functions().items() if inspect.isfunction(one) and not hasattr(one, "__wrapped__")
    ] == []


@pytest.mark.slow
def test_what_is_attacked_takes_its_arguments(folder: Path) -> None:
    """So that what is wrong is what was put in their place."""
    taken = set()
    for name, call, args, more in every_door(folder):
        try:
            call(*args, **more)
        except mg.MechgraphError:
            continue
        taken.add(name.split()[0])
    assert {name.split()[0] for name, *_ in every_door(folder)} == taken


@pytest.mark.daily(1)
@pytest.mark.seeds(2)
def test_plausible_mechanisms(seed: int) -> None:
    for i in range(PER_SEED):
        attack_mechanism(MECHANISMS + seed * PER_SEED + i)
