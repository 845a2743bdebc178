"""Dimensions and units: exponents of length, mass and time, their labels, and the factors between two sets of units.

A number of dimension ``(a, b, c)`` carries the unit ``length^a mass^b time^c``. Angles are radians and have no dimension.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from math import prod

from mechgraph.errors import DeclarationError, MissingExtraError

BASE_UNITS = ("length", "mass", "time")
"""The base units that a mechanism may declare."""

Dimension = tuple[int, int, int]
PURE: Dimension = (0, 0, 0)
LENGTH: Dimension = (1, 0, 0)
MASS: Dimension = (0, 1, 0)
TIME: Dimension = (0, 0, 1)
ACCELERATION: Dimension = (1, 0, -2)
FORCE: Dimension = (1, 1, -2)
MOMENT: Dimension = (2, 1, -2)
INERTIA: Dimension = (2, 1, 0)
FORCE_PER_LENGTH: Dimension = (0, 1, -2)
FORCE_PER_VELOCITY: Dimension = (0, 1, -1)
MOMENT_PER_RATE: Dimension = (2, 1, -1)

COHERENT: dict[tuple[str, ...], dict[tuple[float, ...], str]] = {("m", "kg", "s"): {FORCE: "N", MOMENT: "N m"}}
"""Sets of units whose derived units have names of their own."""


def unit_of(units: Mapping[str, str], dimension: Sequence[float]) -> str:
    """The unit of ``length^a mass^b time^c`` in the declared units; empty where units are not declared or not needed.

    Angles are radians and shown without a unit of their own.
    """
    if not units or len(dimension) != 3:
        return ""
    own = COHERENT.get(tuple(units.get(name, "") for name in BASE_UNITS), {})
    if tuple(dimension) in own:
        return own[tuple(dimension)]
    parts = ["rad"] if not any(dimension[:2]) and dimension[2] <= 0 else []
    for name, power in zip(BASE_UNITS, dimension, strict=True):
        if power and name in units:
            parts.append(units[name] if power == 1 else f"{units[name]}^{power:g}")
    return " ".join(parts)


def symbol_of(dimension: Dimension) -> str:
    """A dimension in the letters L, M, T and F = M L/T², whichever way is shorter: ``F L``, ``M L²``, ``L/T²``; empty for a pure number."""
    a, b, c = dimension
    ways = [{"M": b, "L": a, "T": c}, {"F": b, "L": a - b, "T": c + 2 * b}]
    powers = min(ways, key=lambda way: sum(map(abs, way.values())))
    above = " ".join(_power(letter, n) for letter, n in powers.items() if n > 0)
    below = " ".join(_power(letter, -n) for letter, n in powers.items() if n < 0)
    return f"{above or '1'}/{below}" if below else above


def _power(letter: str, n: int) -> str:
    return letter + {1: "", 2: "²", 3: "³"}.get(n, f"^{n}")


def base_factors(old: Mapping[str, str], new: Mapping[str, str]) -> tuple[float, float, float]:
    """Numbers by which lengths, masses and times are multiplied from ``old`` to ``new`` units (``units`` extra: pint).

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
    for name in BASE_UNITS:
        if name not in new or new[name] == old.get(name):
            out.append(1.0)
        elif name not in old:
            faults.append(f"{name}: the mechanism declares no unit of {name}; give units={{{name!r}: ...}} first")
        else:
            try:
                out.append(float(registry.Quantity(1.0, old[name]).to(new[name]).magnitude))
            except Exception as error:
                faults.append(f"{name}: cannot convert {old[name]!r} to {new[name]!r} ({error})")
    unknown = [name for name in new if name not in BASE_UNITS]
    faults += [f"unknown base unit {name!r}; expected {', '.join(BASE_UNITS)}" for name in unknown]
    if faults:
        raise DeclarationError("to_units", faults)
    return out[0], out[1], out[2]


def factor_of(dimension: Dimension, base: Sequence[float]) -> float:
    """The number by which a number of this dimension is multiplied: ``prod_i base_i^dimension_i``."""
    return float(prod(f**power for f, power in zip(base, dimension, strict=True)))
