"""Compares answers with those of the cases; knows no mechanism program.

    python tests/cases/judge.py [--engine NAME] [FILE ...]

asks the adapter beside it all questions (of all files, with every engine of the adapter) and tells what differs.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
FILES = tuple(sorted(HERE.glob("*.json")))
Case = Mapping[str, Any]


def read(file: Path) -> list[Case]:
    """The cases of a file: a JSON array, one case a line."""
    cases: list[Case] = json.loads(file.read_text(encoding="utf-8"))
    return cases


def differences(expected: Mapping[str, Any], found: Mapping[str, Any], tolerance: float) -> list[str]:
    """What differs, quantity by quantity.

    Numbers may differ by the tolerance times the largest number of their quantity (1 at least); all else has to be equal.
    """
    out = [f"{name}: asked for, not answered" for name in expected.keys() - found.keys()]
    for name in expected.keys() & found.keys():
        pairs = list(_leaves(name, expected[name], found[name]))
        size = max([1.0, *(abs(a) for _, a, _ in pairs if isinstance(a, float))])
        out += [f"{where}: {a!r} expected, {b!r} found" for where, a, b in pairs if not _same(a, b, tolerance * size)]
    return out


def _leaves(where: str, a: Any, b: Any) -> Iterator[tuple[str, Any, Any]]:
    if isinstance(a, dict) and isinstance(b, Mapping) and a.keys() == b.keys():
        for key in a:
            yield from _leaves(f"{where}.{key}", a[key], b[key])
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for i, (x, y) in enumerate(zip(a, b, strict=True)):
            yield from _leaves(f"{where}[{i}]", x, y)
    else:
        yield where, a, b


def _same(a: Any, b: Any, most: float) -> bool:
    if isinstance(a, float) and isinstance(b, float | int) and not isinstance(b, bool):
        return math.isfinite(b) and abs(a - b) <= most
    return bool(a == b)


def main() -> int:
    """Ask everything; 1 where something differs."""
    import adapter

    parser = argparse.ArgumentParser(description="Ask the adapter the questions of the cases.")
    parser.add_argument("files", nargs="*", type=Path, default=FILES)
    parser.add_argument("--engine", action="append", help="an engine of the adapter; left out, every one")
    given = parser.parse_args()
    asked = wrong = 0
    for file in given.files:
        for case in read(file):
            for engine in given.engine or adapter.ENGINES:
                found = adapter.answer(case["mechanism"], case["ask"], engine)
                faults = differences(case["answer"], found, case["tolerance"])
                asked, wrong = asked + 1, wrong + bool(faults)
                for fault in faults[:3]:
                    print(f"{file.name}, {case['name']}, {engine}: {fault}")
    print(f"{asked} questions, {wrong} answered otherwise")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
