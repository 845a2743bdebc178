"""Ranges of positions in which a contact is not what it is reckoned to be: it would have to pull, or its elements cut into each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.result.numbers import number, with_unit
from mechgraph.result.places import Places, driver_value
from mechgraph.result.values import Mask, Values
from mechgraph.units import TIME, unit_of


@dataclass(frozen=True)
class ContactRange:
    """A range of positions of the contact ``pair``.

    ``first``, ``last``: flat positions; ``begins``, ``ends``: values of the drivers (and the time ``t``) at its ends, between positions
    by a straight line, at the ends of the motion those there.
    """

    pair: str
    first: int
    last: int
    begins: dict[str, float]
    ends: dict[str, float]

    text: str

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class LiftOff(ContactRange):
    """Where a contact that only pushes would have to pull.

    The ends are where the force is zero; ``force``: the greatest pull, in a groove that against its opening.
    """

    force: float


@dataclass(frozen=True)
class Overlap(ContactRange):
    """Where the elements of a contact cut into each other beside the point at which they touch.

    Their relative curvature is below zero; ``curvature``: the greatest amount by which.
    """

    curvature: float


class Stretch(NamedTuple):
    """The first and last flat position of a range, the values of the drivers at its ends, how a text says these, the greatest amount."""

    first: int
    last: int
    begins: dict[str, float]
    ends: dict[str, float]
    where: str
    amount: float


def stretches(values: Values, below: Mask, of: Array) -> Iterator[Stretch]:
    """The ranges of positions ``below`` zero of a fact ``of (...)``, which crosses zero where they begin and end."""
    low, fact = below.reshape(-1), of.reshape(-1)
    if not low.any():
        return
    row = values.batch[-1] if values.batch else 1
    ends = np.flatnonzero(np.diff(low, prepend=False, append=False))
    cuts = np.arange(row, low.size, row)  # rows of positions are motions of their own
    cuts = cuts[low[cuts - 1] & low[cuts]]
    places = Places(values)
    drivers = dict(zip(places.drivers, places.driver_values, strict=True))
    if values.t is not None:
        drivers["t"] = np.broadcast_to(np.asarray(values.t, dtype=float), values.batch).reshape(-1)

    def crossing(inside: int, outside: int) -> dict[str, float]:
        near = 0 <= outside < fact.size and outside // row == inside // row and np.isfinite(fact[outside])
        part = fact[inside] / (fact[inside] - fact[outside]) if near else 0.0
        there = outside if near else inside
        return {name: float(v[inside] + part * (v[there] - v[inside])) for name, v in drivers.items()}

    def said(name: str, value: float) -> str:
        if name == "t":
            return f"t = {with_unit(number(value), unit_of(values.mechanism.units, TIME))}"
        return driver_value(values.whole, name, value)

    for first, end in np.sort(np.concatenate([ends, cuts, cuts])).reshape(-1, 2).tolist():
        at = crossing(first, first - 1), crossing(end - 1, end)
        begins, ends_ = (", ".join(said(*item) for item in place.items()) for place in at)
        where = f"at {begins}" if begins == ends_ else f"from {begins} to {ends_}"
        yield Stretch(first, end - 1, *at, where, float(-np.nanmin(fact[first:end])))
