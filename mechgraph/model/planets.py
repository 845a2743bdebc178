"""Planets between a sun and a ring: where they can be put in; what is doubtful about the places of gears.

Source: G. Niemann and H. Winter, Maschinenelemente II, 2003, chapter 23 (planetary gears: conditions of assembly and of neighbors).
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from math import pi
from typing import Any

import numpy as np

from mechgraph.errors import DeclarationError
from mechgraph.maths.se3 import Array
from mechgraph.model.couplings import fitting_of
from mechgraph.model.gears import Gear, off_axis, tip_radius
from mechgraph.model.meshes import Mesh, Parallel
from mechgraph.quantities import door, shown


@door
def planet_places(sun: int, ring: int, n: int) -> Array:
    """Return the angles ``(n,)`` [rad] at which ``n`` planets between a sun and a ring can be put in, as evenly as teeth allow.

    The planets have ``(ring - sun) / 2`` teeth. Even places need ``(sun + ring) / n`` whole; others are multiples of ``2 pi / (sun +
    ring)``. Neighbors need ``(sun + planet) sin(pi / n) > planet + 2``.

    Parameters
    ----------
    sun, ring, n : int
        Teeth of the sun and of the ring; number of planets.

    Raises
    ------
    DeclarationError
        Planets that would overlap, or whose teeth are no whole number.

    Examples
    --------
    >>> import mechgraph as mg
    >>> import numpy as np
    >>> np.rad2deg(mg.planet_places(20, 54, 3)).round(4)
    array([  0.    , 121.6216, 238.3784])
    """
    faults = [
        f"{name} = {shown(value)}: expected a whole number above 0"
        for name, value in (("sun", sun), ("ring", ring), ("n", n))
        if not isinstance(value, int | np.integer) or isinstance(value, bool) or value < 1
    ]
    if not faults and (ring - sun < 2 or (ring - sun) % 2):
        faults.append(f"sun = {sun}, ring = {ring}: planets have half the difference, a whole number above 0")
    if not faults:
        planet, steps = (ring - sun) // 2, np.round(np.arange(n) * (sun + ring) / n)
        found = 2 * pi * steps / (sun + ring)
        gaps = np.diff(np.append(found, 2 * pi))
        room = float((sun + planet) * np.sin(min(gaps.min(), pi) / 2)) if n > 1 else np.inf
        if room <= planet + 2:
            faults.append(
                f"n = {n}: neighbors overlap, ({sun} + {planet}) sin(half their angle) = {room:.6g}; expected more than {planet + 2}"
            )
    if faults:
        raise DeclarationError("planet_places", faults)
    return np.asarray(found)


def gear_doubts(m: Any) -> list[str]:
    """What is doubtful about the places of gears, pulleys and planets; nothing without geometry."""
    return [*off_axis(m), *planet_faults(m)] if m.has_geometry else []


def planet_faults(m: Any) -> list[str]:
    """Planets between the same two gears that cannot be put in, or overlap, at the declared places.

    The value of a mesh with the first gear less that with the second one leaves the turn of the planet out; modulo the base pitch it is
    the same for all that fit.
    """
    meshes = [c for c in m.couplings if isinstance(c, Mesh)]
    of_gear: dict[str, list[Mesh]] = {}
    for c in meshes:
        for name in (c.a, c.b):
            of_gear.setdefault(name, []).append(c)
    groups: dict[tuple[str, str], list[tuple[str, float, Gear]]] = {}
    period = {}
    for name, own in of_gear.items():
        if len(own) != 2 or not any(getattr(g, "internal", False) for c in own for g in c.pair_of(m)):
            continue
        met = [c.seen(m) for c in own]
        if not all(isinstance(one, Parallel) for one in met):
            continue
        values, mates = [], []
        for c, one in zip(own, met, strict=True):
            value = float(one.flanks(True)[0](one.a, one.b, np.array(one.numbers)[:, None, None]).value[0, 0])
            values.append(value * np.sign(one.one.base_radius))
            mates.append(c.b if c.a == name else c.a)
        order = np.argsort(mates)
        key = mates[order[0]], mates[order[1]]
        gear = next(g for g in (met[0].one, met[0].two) if g.name == name)
        groups.setdefault(key, []).append((name, values[order[0]] - values[order[1]], gear))
        period[key] = met[0].period
    return [fault for key, planets in groups.items() for fault in _group_faults(m, key, planets, period[key])]


def _group_faults(m: Any, key: tuple[str, str], planets: list[tuple[str, float, Gear]], period: float) -> Iterator[str]:
    """See ``planet_faults``, for the planets between two gears."""
    first, tolerance = planets[0], max(1e-6, 10 * fitting_of(m))
    for name, value, _ in planets[1:]:
        off = (value - first[1]) / period
        if abs(off - round(off)) > tolerance:
            yield (
                f"planets {first[0]!r} and {name!r} between {key[0]!r} and {key[1]!r} cannot both be put in: their teeth are off by "
                f"{abs(off - round(off)):.4g} of a tooth; mg.planet_places gives places that fit"
            )
    for (one, _, gear), (two, _, other) in combinations(planets, 2):
        # planets on one carrier keep their distance
        apart = float(np.linalg.norm(np.subtract(gear.point, other.point)))
        if m.once(_as_assembled) and gear.link != other.link and apart < tip_radius(gear) + tip_radius(other):
            yield f"planets {one!r} and {two!r} overlap: {apart:.6g} apart; expected more than {tip_radius(gear) + tip_radius(other):.6g}"


def _as_assembled(m: Any) -> bool:
    """Whether all places are in one frame."""
    return all(pair.on_a is None for pair in m.pairs)
