"""Positions as people call them, by the values of the drivers."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.model.couplings import BaseCoupling
from mechgraph.model.mechanism import Mechanism
from mechgraph.result.numbers import number, with_unit
from mechgraph.result.values import Values
from mechgraph.units import unit_of

OK = "ok"
"""Status of a solved position."""


def coordinate(m: Mechanism, name: str, value: float) -> str:
    """The value of a freedom with its unit: degrees for a turn."""
    if m.turns(name):
        return f"{number(float(np.rad2deg(value)))} deg"
    return with_unit(number(value), unit_of(m.units, (1, 0, 0)))


def driver_value(m: Mechanism, name: str, value: float) -> str:
    """``A.Rz = 30 deg``: a driver's value with its unit."""
    return f"{name} = {coordinate(m, name, value)}"


def coupling_unit(m: Mechanism, coupling: BaseCoupling) -> str:
    """The unit of the multiplier: a force where all freedoms are slides, else a moment."""
    slides = not any(m.turns(name) for name in coupling.freedoms)
    return unit_of(m.units, (1 if slides else 2, 1, -2))


class Places:
    """The positions of a solution laid out flat."""

    def __init__(self, values: Values) -> None:
        self.values = values
        self.m: Mechanism = values.mechanism
        self.status = np.asarray(values.status()).reshape(-1)
        self.solved = self.status == OK
        self.drivers = values.prescribed

    @cached_property
    def driver_values(self) -> list[Array]:
        """Coordinates of the drivers."""
        return [self.coordinates(name)[0] for name in self.drivers]

    def coordinates(self, name: str) -> tuple[Array, Array]:
        """Coordinate and rate of a freedom, one value a position."""
        k, j = self.values.whole.freedom(name)
        position, velocity, _ = self.values.coordinates(k)
        return self.flat(position[..., j]), self.flat(velocity[..., j])

    def flat(self, values: Any) -> Array:
        """One value a position."""
        return np.asarray(values, dtype=float).reshape(self.status.size)

    def runs(self) -> list[tuple[int, int]]:
        """First and last index of every run of equal statuses."""
        cuts = np.flatnonzero(self.status[1:] != self.status[:-1])
        starts = [0, *(int(c) + 1 for c in cuts)]
        ends = [*(int(c) for c in cuts), self.status.size - 1]
        return list(zip(starts, ends, strict=True)) if self.status.size else []

    def coordinate(self, name: str, value: float) -> str:
        """A driver's value with its unit."""
        return coordinate(self.values.whole, name, value)

    def name(self, index: int) -> str:
        """The driver values of a position; where these are not known its time, or its number."""
        found = [
            self.coordinate(n, v[index])
            for n, v in zip(self.drivers, self.driver_values, strict=True)
            if np.isfinite(v[index])
        ]
        if not found and self.values.t is not None:
            t = np.broadcast_to(np.asarray(self.values.t, dtype=float), self.values.batch).reshape(-1)[index]
            return f"t = {with_unit(number(t), unit_of(self.m.units, (0, 0, 1)))}"
        return ", ".join(found) or f"position {index}"

    def full_name(self, index: int) -> str:
        """The same with the names of the drivers, ``A.Rz = 30 deg``."""
        values = zip(self.drivers, self.driver_values, strict=True)
        found = [driver_value(self.values.whole, n, v[index]) for n, v in values if np.isfinite(v[index])]
        return ", ".join(found) or self.name(index)
