"""A mechanism in other units: every number multiplied by the factor of its dimension (``units`` extra: pint)."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mechgraph.errors import DeclarationError, MissingExtraError
from mechgraph.model.load import LENGTH, Load
from mechgraph.model.motion import Motion
from mechgraph.model.pair import Marker
from mechgraph.model.values import plain

if TYPE_CHECKING:
    from mechgraph.model.mechanism import Mechanism

UNIT_NAMES = ("length", "mass", "time")
"""The base units that a mechanism may declare."""


def factors(old: Mapping[str, str], new: Mapping[str, str]) -> tuple[float, float, float]:
    """Numbers by which lengths, masses and times are multiplied.

    Raises
    ------
    DeclarationError
        for a unit that is not declared, unknown or of another dimension; MissingExtraError without pint.
    """
    try:
        registry = importlib.import_module("pint").UnitRegistry()
    except ImportError:
        raise MissingExtraError("pint", "units") from None
    faults, out = [], []
    for name in UNIT_NAMES:
        if name not in new or new[name] == old.get(name):
            out.append(1.0)
        elif name not in old:
            faults.append(f"{name}: the mechanism declares no unit of {name}; give units={{{name!r}: ...}} first")
        else:
            try:
                out.append(float(registry.Quantity(1.0, old[name]).to(new[name]).magnitude))
            except Exception as error:
                faults.append(f"{name}: cannot convert {old[name]!r} to {new[name]!r} ({error})")
    faults += [
        f"unknown base unit {name!r}; expected {', '.join(UNIT_NAMES)}" for name in new if name not in UNIT_NAMES
    ]
    if faults:
        raise DeclarationError("to_units", faults)
    return out[0], out[1], out[2]


def converted(m: Mechanism, new: Mapping[str, str]) -> Mechanism:
    """The mechanism with all numbers in other units of length, mass and time."""
    base = factors(m.units, new)

    def times(value: Any, dimension: tuple[int, int, int]) -> Any:
        if value is None:
            return None
        if callable(value):
            raise DeclarationError("to_units", ["a load is a callable; convert it yourself, or sample it first"])
        factor = float(np.prod([f**p for f, p in zip(base, dimension, strict=True)]))
        return value if factor == 1.0 else plain(np.asarray(value) * factor)

    def marker(old: Marker | None) -> Marker | None:
        return None if old is None else Marker(times(old.point, LENGTH), old.axis, old.second)

    def by_freedom(name: str, turn: tuple[int, int, int], slide: tuple[int, int, int]) -> tuple[int, int, int]:
        k, j = m.freedom(name)
        return turn if m.pairs[k].type.freedoms[j].turns else slide

    def motion(name: str, old: Motion | None) -> Motion | None:
        if old is None:
            return None
        values = (old.position, old.velocity, old.acceleration)
        p, v, a = (times(value, by_freedom(name, (0, 0, -n), (1, 0, -n))) for n, value in enumerate(values))
        return Motion(p, v, a, times(old.t, (0, 0, 1)))

    links = [
        replace(k, mass=times(k.mass, (0, 1, 0)), center=times(k.center, LENGTH), inertia=times(k.inertia, (2, 1, 0)))
        for k in m.links
    ]
    pairs = [
        p.replace(
            **{name: times(getattr(p, name), LENGTH) for name in ("point", "pitch", "lead")},
            on_a=marker(p.on_a),
            on_b=marker(p.on_b),
        )
        for p in m.pairs
    ]
    loads: list[Load] = []
    load: Any
    for load in m.loads:
        dimensions = dict(load.dimensions)
        for field, (turn, slide) in load.freedom_dimensions.items():
            dimensions[field] = by_freedom(load.freedom, turn, slide)
        loads.append(replace(load, **{field: times(getattr(load, field), d) for field, d in dimensions.items()}))
    return m.replace(
        links=links,
        pairs=pairs,
        loads=loads,
        drives=[replace(d, motion=motion(d.freedom, d.motion)) for d in m.drives],
        start={name: times(value, by_freedom(name, (0, 0, 0), LENGTH)) for name, value in m.start.items()},
        units={**m.units, **new},
    )
