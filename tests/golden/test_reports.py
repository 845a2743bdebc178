"""The determinacy report as text, Markdown, JSON and HTML, against stored files; ``--update-golden`` writes them anew."""

from __future__ import annotations

import json
from collections.abc import Callable
from functools import cache
from typing import Any

import machines
import mechanisms as known
import pytest

import mechgraph as mg

pytestmark = pytest.mark.golden

MECHANISMS = {
    "four-bar": lambda: mg.load("four-bar"),
    "rssr": lambda: mg.load("rssr"),
    "pinned-bar": lambda: known.ring("RR", [(0, 0, 0), (3, 4, 0)], [known.Z] * 2, drives=[], name="pinned bar"),
    "rchch-topology": lambda: mg.chain("RCHCH"),
    "excavator": machines.excavator,
    "five-rods": machines.five_rods,
    "windows": lambda: known.windows(50),
}
Golden = Callable[[str, str], None]


@cache
def report(name: str) -> mg.DeterminacyReport:
    return mg.check(MECHANISMS[name]())


@pytest.mark.parametrize("name", MECHANISMS)
def test_text(name: str, golden: Golden) -> None:
    text = str(report(name))
    assert max(len(line) for line in text.splitlines()) <= 80
    golden(f"{name}.txt", text)


@pytest.mark.parametrize("name", MECHANISMS)
def test_full_text(name: str, golden: Golden) -> None:
    text = report(name).text(full=True)
    assert max(len(line) for line in text.splitlines()) <= 80
    golden(f"{name}-full.txt", text)


@pytest.mark.parametrize("name", MECHANISMS)
def test_markdown(name: str, golden: Golden) -> None:
    golden(f"{name}.md", report(name).to_markdown())


@pytest.mark.parametrize("name", MECHANISMS)
def test_html(name: str, golden: Golden) -> None:
    golden(f"{name}.html", report(name)._repr_html_())


def rounded(value: Any) -> Any:
    """Numbers to six digits, rounding noise to zero: the rest depends on the machine."""
    if isinstance(value, dict):
        return {k: rounded(v) for k, v in value.items()}
    if isinstance(value, list):
        return [rounded(v) for v in value]
    if isinstance(value, float):
        return 0.0 if abs(value) < 1e-9 else float(f"{value:.6g}")
    return value


@pytest.mark.parametrize("name", [n for n in MECHANISMS if n != "windows"])
def test_json(name: str, golden: Golden) -> None:
    facts = json.loads(report(name).to_json())
    golden(f"{name}.json", json.dumps(rounded(facts), indent=2) + "\n")


@pytest.mark.slow
def test_the_same_text_every_time() -> None:
    for build in MECHANISMS.values():
        assert str(mg.check(build())) == str(mg.check(build()))
