"""Dimensions and units: exponents of length, mass and time, their labels, and the factors between two sets of units.

A number of dimension ``(a, b, c)`` carries the unit ``length^a mass^b time^c``. Angles are radians and have no dimension.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from math import isclose, prod

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
ENERGY: Dimension = (2, 1, -2)
POWER: Dimension = (2, 1, -3)
INERTIA: Dimension = (2, 1, 0)
PRESSURE: Dimension = (-1, 1, -2)
FORCE_PER_LENGTH: Dimension = (0, 1, -2)
FORCE_PER_VELOCITY: Dimension = (0, 1, -1)
MOMENT_PER_RATE: Dimension = (2, 1, -1)

KNOWN: dict[str, dict[str, float]] = {
    "length": {
        "m": 1.0,
        "dm": 0.1,
        "cm": 0.01,
        "mm": 1e-3,
        "um": 1e-6,
        "µm": 1e-6,
        "km": 1e3,
        "ft": 0.3048,
        "in": 0.0254,
    },
    "mass": {
        "kg": 1.0,
        "g": 1e-3,
        "mg": 1e-6,
        "t": 1e3,
        "tonne": 1e3,
        "Mg": 1e3,
        "slug": 0.45359237 * 9.80665 / 0.3048,
    },
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6},
}
"""Units of a base in terms of m, kg, s, as far as they make forces that have names."""
EARTH, EARTHLY = 9.80665, 0.005
"""Acceleration of gravity on earth in m/s^2, and by what part of it it varies and is rounded."""
FORCES = {"N": 1.0, "kN": 1e3, "MN": 1e6, "mN": 1e-3, "µN": 1e-6, "nN": 1e-9, "dyn": 1e-5, "lbf": 0.45359237 * 9.80665}
"""Units of force in N."""
USUAL = ("N", "kN", "MN", "lbf")
"""Those in which people think."""


def force_unit(units: Mapping[str, str]) -> str:
    """The name of the force ``mass length / time^2`` of a set of units; empty where it has none."""
    if not all(units.get(base) in known for base, known in KNOWN.items()):
        return ""
    length, mass, time = (KNOWN[base][units[base]] for base in BASE_UNITS)
    return next((name for name, size in FORCES.items() if isclose(size, mass * length / time**2, rel_tol=1e-9)), "")


def force_hint(units: Mapping[str, str]) -> str:
    """What to say where the unit of force that belongs to a set of units is not a usual one; empty where it is, or is not known."""
    name = force_unit(units)
    if not name or name in USUAL:
        return ""
    set_, others = ", ".join(units[base] for base in BASE_UNITS), ("t", "kg", "g")
    better = next((mass for mass in others if force_unit({**units, "mass": mass}) == "N"), "")
    advice = (
        f"mass in {better} would make it N, m.to_units(mass={better!r})"
        if better
        else "m.to_units(length='m', mass='kg') makes it N"
    )
    return f"Units: {set_} belong to the force {name} ({FORCES[name]:g} N), in which loads are read and results given; {advice}."


def gravity_hint(units: Mapping[str, str], size: float) -> str:
    """What to say of an acceleration of gravity that is the earth's in other units than those declared; empty where there is nothing."""
    length, time = KNOWN["length"].get(units.get("length", "")), KNOWN["time"].get(units.get("time", ""))
    if length is None or time is None or isclose(size * length / time**2, EARTH, rel_tol=EARTHLY):
        return ""
    meant = next((name for name, known in KNOWN["length"].items() if isclose(size * known, EARTH, rel_tol=EARTHLY)), "")
    unit, right = f"{units['length']}/{units['time']}^2", EARTH * time**2 / length
    return (
        f"gravity of {size:.6g} {unit}: on earth it is {size:.6g} {meant}/s^2, which is {right:.6g} {unit}"
        if meant
        else ""
    )


def _shortest(dimension: Sequence[float], force: bool = True) -> dict[str, float]:
    """Powers by the letters L, M, T and F = M L/T^2, whichever way is shorter."""
    a, b, c = dimension
    ways = [{"M": b, "L": a, "T": c}, {"F": b, "L": a - b, "T": c + 2 * b}]
    return min(ways[: 1 + force], key=lambda way: sum(map(abs, way.values())))


def unit_of(units: Mapping[str, str], dimension: Sequence[float]) -> str:
    """The unit of ``length^a mass^b time^c`` in the declared units, ``N mm``, ``m/s^2``; empty where units are not declared or not needed.

    A pure number of three exponents is an angle, in radians, and so is what is left of a rate.
    """
    if (
        not units
        or len(dimension) != 3
        or any(p and base not in units for base, p in zip(BASE_UNITS, dimension, strict=True))
    ):
        return ""
    force = force_unit(units)
    if tuple(dimension) == POWER and (force, units["length"], units["time"]) == ("N", "m", "s"):
        return "W"
    names = {"F": force, "L": units.get("length", ""), "M": units.get("mass", ""), "T": units.get("time", "")}
    powers = {names[letter]: n for letter, n in _shortest(dimension, bool(force)).items() if n}
    angle = "rad" if not any(dimension[:2]) and dimension[2] <= 0 else ""
    return _quotient(powers, lambda n: f"^{n:g}", angle)


def symbol_of(dimension: Dimension) -> str:
    """A dimension in letters: ``F L``, ``M L²``, ``L/T²``; empty for a pure number."""
    return _quotient(_shortest(dimension), lambda n: {2: "²", 3: "³"}.get(int(n), f"^{n:g}"))


def _quotient(powers: Mapping[str, float], power: Callable[[float], str], angle: str = "") -> str:
    """``F L/T²``: what has a positive power over what has a negative one."""
    above, below = (
        " ".join(name + (power(abs(n)) if abs(n) != 1 else "") for name, n in powers.items() if n * sign > 0)
        for sign in (1, -1)
    )
    above = above or angle
    return f"{above or '1'}/{below}" if below else above


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
