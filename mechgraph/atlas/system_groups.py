"""System groups by count: how many pairs of which class a group of N independent contours can have.

A group takes up no mobility: of family f, M = (6 - f) n - sum_j (j - f) c_j = 0 with n = sum_j c_j - N moving links, so

    sum_j (6 - j) c_j = (6 - f) N.

A pair of class j leaves 6 - j freedoms; a family f has pairs of the classes f + 1 to 5 only.
Source: Marghitu, Fundamentals, equations 2.7 to 2.14, tables 2.6 and 2.7 (the condition there is c_5 >= 0, as its own table shows).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from mechgraph.arguments import door
from mechgraph.errors import DeclarationError
from mechgraph.quantities import wrong


@dataclass(frozen=True)
class SystemGroup:
    """A configuration: ``pairs`` of the classes 1 to 5 and moving ``links`` of a group of ``contours`` of a ``family``."""

    family: int
    contours: int
    pairs: tuple[int, int, int, int, int]
    links: int


@door
def system_groups(contours: int, most: int | None = None) -> Iterator[SystemGroup]:
    """All configurations with so many independent contours, family by family; with no more than ``most`` pairs of any class 1 to 4.

    Raises
    ------
    DeclarationError
        where ``contours`` is not a whole number from 1, or ``most`` not one from 0.
    """
    faults = [wrong(contours, "contours", "a whole number from 1")] * (type(contours) is not int or contours < 1)
    faults += [wrong(most, "most", "a whole number from 0, or None")] * (
        most is not None and (type(most) is not int or most < 0)
    )
    if faults:
        raise DeclarationError("system groups", faults)
    return _groups(contours, most)


def _groups(contours: int, most: int | None) -> Iterator[SystemGroup]:
    for family in range(5):
        freedoms = (6 - family) * contours
        ranges = []
        for j in range(1, 5):
            limit = freedoms // (6 - j) if j > family else 0
            ranges.append(range(1 + (limit if most is None else min(most, limit))))
        for wider in product(*ranges):
            c5 = freedoms - sum((6 - j) * c for j, c in enumerate(wider, start=1))
            links = sum(wider) + c5 - contours
            if c5 >= 0 and links > 0:
                c1, c2, c3, c4 = wider
                yield SystemGroup(family, contours, (c1, c2, c3, c4, c5), links)
