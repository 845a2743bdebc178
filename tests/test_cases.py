"""The cases, numbers that any program could be asked for: every question, with every engine."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent / "cases"))

import adapter
import judge

LATE = 25
"""Cases a test: one test for each would take longer to collect than to run."""
ALIKE = {"random", "singular", "modes"}
"""Files of many mechanisms made alike: every fourth mechanism (of two questions) is asked for daily."""


def _parts():
    for file in judge.FILES:
        cases = judge.read(file)
        for first in range(0, len(cases), LATE):
            numbered = list(enumerate(cases))[first : first + LATE]
            yield pytest.param(numbered, file.stem in ALIKE, id=f"{file.stem}-{first}")


@pytest.mark.parametrize("engine", adapter.ENGINES)
@pytest.mark.parametrize(("cases", "alike"), list(_parts()))
def test_answers(cases, alike, engine, request):
    faults = []
    n, every = len(adapter.ENGINES), request.config.getoption("--attack")
    for i, case in cases:
        # daily each case by one engine, both questions about a mechanism by different ones; with --attack by every one
        mine = (i + i // n + i // (4 * n)) % n == adapter.ENGINES.index(engine) and not (alike and i // 2 % 4)
        if not (mine or every):
            continue
        found = adapter.answer(case["mechanism"], case["ask"], engine)
        faults += [
            f"{case['name']}: {fault}" for fault in judge.differences(case["answer"], found, case["tolerance"])[:3]
        ]
    assert not faults, "\n".join(faults)


def test_every_case_says_what_it_is():
    for file in judge.FILES:
        cases = judge.read(file)
        assert len({case["name"] for case in cases}) == len(cases)
        for case in cases:
            assert set(case) == {"name", "mechanism", "ask", "answer", "tolerance", "source"}
            assert case["source"]


@pytest.mark.parametrize(
    ("found", "says"),
    [
        ({"a": [1.0, None]}, []),
        ({"a": [1.0 + 1e-8, None]}, ["a[0]"]),
        ({"a": [1.0, 2.0]}, ["a[1]"]),
        ({"a": [1.0]}, ["a"]),
        ({"a": [float("nan"), None]}, ["a[0]"]),
        ({}, ["a"]),
    ],
)
def test_the_judge_sees_what_differs(found, says):
    faults = judge.differences({"a": [1.0, None]}, found, 1e-9)
    assert [fault.split(":")[0] for fault in faults] == says
