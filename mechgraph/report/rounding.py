"""What rounded numbers do to a verdict: the smallest tolerance at which it changes, and what is then special about the mechanism."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from decimal import Decimal
from time import monotonic
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import closed_start
from mechgraph.errors import MechgraphError
from mechgraph.model.mechanism import Mechanism
from mechgraph.structure.kind import kind_of
from mechgraph.structure.least_change import TOOK_TOO_LONG, SearchEnded
from mechgraph.structure.placed_pairs import EXACT
from mechgraph.structure.snapping import SnappedMechanism, candidates, snapped

LARGEST_TOL = 1e-2
"""Largest tolerance that is tried."""
CLOSE = 1e-3
"""Change of a pair up to which numbers of any number of digits are taken for rounded: of random mechanisms hardly one comes so near."""
LIMIT = 20.0
"""Seconds that the search for near-special geometry may take unless another limit is given."""
MOST_PAIRS = 300
"""Pairs up to which rounding is looked for without being asked."""
TOO_MANY = "of {} pairs it is not looked for (of up to {} it is)"
"""What is said of more."""
BY_CHANCE = (60, 1.5)
"""Relations within a tolerance, in all and a pair, above which they are no rounding: of many pairs some come near any relation."""
SAFE = 4.0
"""Tolerance that is advised, in largest changes of a pair: closure errors add up along a loop."""
CHANGES_NAMED = 3
"""Most pairs that are named."""


@dataclass(frozen=True)
class Rounding:
    """A tolerance at which the verdict changes.

    ``tol`` to pass on, ``angle`` (radians) and ``distance`` (unit of length) that directions and distances have to be meant to,
    ``kind`` ("planar", "spherical" or ""), ``mobility`` then (finite), ``misses`` of pairs in words, and the ``text`` of it all.
    """

    tol: float
    angle: float
    distance: float
    kind: str
    mobility: int
    misses: tuple[str, ...]
    text: str

    def __str__(self) -> str:
        return self.text


def rounding(m: Mechanism, verdict: Callable[[Mechanism], tuple[Any, ...]], limit: float = LIMIT) -> Rounding | None:
    """The smallest tolerance (of decades up to 1e-2) that changes ``verdict(m)``, its mobility first; None where there is none.

    The verdict is a tuple that begins with the finite mobility; empty where there is none. Changes of pairs beyond what ``plausible``
    says are no rounding: a mechanism may come near a special one by chance.

    Raises
    ------
    SearchEnded
        after ``limit`` seconds, and of more than ``MOST_PAIRS`` pairs.
    """
    until = monotonic() + limit
    if isinstance(m, SnappedMechanism) or not m.has_geometry:
        return None
    if len(m.pairs) > MOST_PAIRS:
        raise SearchEnded(TOO_MANY.format(len(m.pairs), MOST_PAIRS))
    own: tuple[Any, ...] | None = None
    other: tuple[SnappedMechanism, float, tuple[Any, ...]] | None = None
    try:
        sizes = candidates(m, LARGEST_TOL)
    except MechgraphError:  # the loops do not close to that either
        return None
    for tol in _decades(sizes):
        if (sizes <= tol).sum() > max(BY_CHANCE[0], BY_CHANCE[1] * len(m.pairs)):
            break
        try:
            exact = snapped(m, tol, until)
        except SearchEnded:
            raise
        except MechgraphError:
            continue
        if (not exact.changes.moved and exact.changes.closure <= EXACT) or exact.changes.largest > plausible(
            m, exact.changes.L
        ):
            continue
        own = verdict(m) if own is None else own
        if monotonic() > until:
            raise SearchEnded(TOOK_TOO_LONG)
        then = verdict(exact)
        if then and (not own or then[0] != own[0]):
            return _worded(exact, tol, then)
        other = (exact, tol, then) if other is None and then and then != own else other
    return _worded(*other) if other else None


def plausible(m: Mechanism, L: float) -> float:
    """Largest change (radians, or length / ``L``) that rounding explains: some half units of the last digit in which points and axes are
    written, at least ``CLOSE``.

    A last digit so coarse that half a unit exceeds ``LARGEST_TOL``, as in (0, 0, 1), was not rounded to: such numbers are exact.
    """
    units = []
    for pair in m.pairs:
        for place in (pair,) if pair.on_a is None or pair.on_b is None else (pair.on_a, pair.on_b):
            sizes = L, math.hypot(*place.axis), math.hypot(*place.second)
            vectors = zip((place.point, place.axis, place.second), sizes, strict=True)
            units += [0.5 * 10.0 ** -max(map(_decimals, vector)) / size for vector, size in vectors]
    return max(CLOSE, SAFE * max((unit for unit in units if unit <= LARGEST_TOL), default=0.0))


def _decimals(value: float) -> int:
    """Digits behind the point in the shortest decimal that is this number."""
    exponent = Decimal(repr(value)).normalize().as_tuple().exponent
    return max(-exponent, 0) if isinstance(exponent, int) else 0


def _decades(sizes: Array) -> Iterator[float]:
    """The powers of ten from the smallest of the sizes up."""
    if (sizes > EXACT).any():
        first = int(np.ceil(np.log10(np.clip(sizes[sizes > EXACT].min(), 1e-12, LARGEST_TOL))))
        yield from (10.0**p for p in range(first, int(np.log10(LARGEST_TOL)) + 1))


def _worded(exact: SnappedMechanism, tol: float, verdict: tuple[Any, ...]) -> Rounding:
    moved, mobility = exact.changes.moved, int(verdict[0])
    angle = max((c.angle for c in moved), default=0.0)
    distance = max((c.shift for c in moved), default=0.0)
    unit = exact.units.get("length", "")
    meant = []
    if angle > EXACT:
        meant.append(f"directions taken as meant to {np.degrees(angle):.2g} deg")
    if distance > EXACT * exact.changes.L:
        meant.append(f"distances {'' if meant else 'taken as meant '}to {distance:.2g} {unit}".rstrip())
    kind = kind_of(closed_start(exact).S[:, :, 0]).name
    moves = f"moves (mobility {mobility})" if mobility else "is a structure (mobility 0)"
    off = {"planar": "off the normal", "spherical": "off the line through the centre"}.get(kind, "off")
    misses = tuple(
        f"Axis of {c.pair}: {np.degrees(c.angle):.2g} deg {off}"
        if c.angle * exact.changes.L >= c.shift
        else f"{c.pair}: {c.shift:.2g} {unit}".rstrip() + " off"
        for c in sorted(moved, key=lambda c: -max(c.angle, c.shift / exact.changes.L))[:CHANGES_NAMED]
    )
    advised = _rounded_up(max(tol, SAFE * exact.changes.largest))
    text = f"With {' and '.join(meant) or f'loops that close to {exact.changes.closure:.2g}'} the mechanism "
    text += f"{f'is {kind} and ' if kind else ''}{moves}. {'. '.join(misses)}{'. ' if misses else ''}Pass tol={advised:g} to take it so"
    return Rounding(advised, angle, distance, kind, mobility, misses, text + ".")


def _rounded_up(value: float) -> float:
    """The next of 1, 2, 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(k * power for k in (1, 2, 5, 10) if k * power >= value * (1 - 1e-9)))
