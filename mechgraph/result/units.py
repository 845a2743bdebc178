"""Names of derived units from those that a mechanism declares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

NAMES = ("length", "mass", "time")
COHERENT: dict[tuple[str, ...], dict[tuple[float, ...], str]] = {("m", "kg", "s"): {(1, 1, -2): "N", (2, 1, -2): "N m"}}
"""Sets of units whose derived units have names of their own."""


def unit_of(units: Mapping[str, str], dimension: Sequence[float]) -> str:
    """The unit of ``length^a mass^b time^c`` in the declared units; empty where units are not declared or not needed.

    Angles are radians and shown without a unit of their own.
    """
    if not units or len(dimension) != 3:
        return ""
    own = COHERENT.get(tuple(units.get(name, "") for name in NAMES), {})
    if tuple(dimension) in own:
        return own[tuple(dimension)]
    if not any(dimension[:2]):
        parts = ["rad"] if dimension[2] <= 0 else []
    else:
        parts = []
    for name, power in zip(NAMES, dimension, strict=True):
        if power and name in units:
            parts.append(units[name] if power == 1 else f"{units[name]}^{power:g}")
    return " ".join(parts)
