"""Drivers: which freedoms can drive, which cannot and why, which move in proportion, and a set that completes the drivers."""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.linear import independent_rows
from mechgraph.numerics.tolerances import MOTIONS
from mechgraph.report.findings import Finding, moves_nearby
from mechgraph.structure.mobility import Freedoms, drive_order, single_freedoms

SHOWN = 8
"""Most freedoms named for one motion."""
MOST_INPUTS = 200
"""Number of input freedoms above which freedoms that move in proportion are not sought."""


def left_free(m: Mechanism, freedoms: Freedoms) -> tuple[Finding, ...]:
    """Motions that are neither driven nor passive: the freedoms that move in each, those that could be driven first."""
    single = {name for _, name in single_freedoms(m)}
    out = []
    for motion in freedoms.undriven:
        names = sorted(motion.names, key=lambda n: n not in single)
        shown = ", ".join(names[:SHOWN]) + (f" and {len(names) - SHOWN} more" if len(names) > SHOWN else "")
        verb = "moves" if len(names) == 1 else "move together"
        out.append(Finding(f"{shown} {verb}", motion.names))
    return tuple(out)


def drivable(m: Mechanism, inputs: Array) -> tuple[Finding, ...]:
    """Freedoms that can serve as a driver here: single freedoms that move in other than passive motions ``inputs (F, M)``."""
    moves = np.abs(inputs).max(axis=1, initial=0.0) > MOTIONS.still
    return tuple(Finding(f"{n} can drive", (n,)) for i, n in single_freedoms(m) if moves[i])


def not_drivable(
    m: Mechanism, freedoms: Freedoms, able: tuple[Finding, ...], null_nearby: Array | None
) -> tuple[Finding, ...]:
    """Single freedoms that cannot drive here, with the reason: a dead point, locked, or moving only passively."""
    good = {name for finding in able for name in finding.freedoms}
    still = np.abs(freedoms.null).max(axis=1, initial=0.0) < MOTIONS.still
    nearby = moves_nearby(null_nearby, len(still))
    out = []
    for i, name in single_freedoms(m):
        if name in good:
            continue
        why = "moves only in a passive motion"
        if still[i]:
            dead = nearby[i] and freedoms.mobility
            why = "dead point here (moves in nearby positions)" if dead else "stands still"
        out.append(Finding(f"{name} cannot drive: {why}", (name,)))
    return tuple(out)


def suggested(m: Mechanism, freedoms: Freedoms, able: tuple[Finding, ...]) -> tuple[str, ...]:
    """Freedoms that complete the drivers: free of passive motions and at the frame first, in order, independent of each other.

    A driver on a freedom that also moves in a passive motion would stop that motion and leave another one undriven.
    """
    if not freedoms.undriven:
        return ()
    rest, _ = np.linalg.qr(np.stack([f.rates for f in freedoms.undriven], axis=1))
    names = m.freedom_names()
    good = {name for finding in able for name in finding.freedoms}
    order = [i for i in drive_order(m, freedoms.passive) if names[i] in good]
    return tuple(names[i] for i in sorted(independent_rows(rest, order, rest.shape[1])))


def proportional(m: Mechanism, inputs: Array, able: tuple[Finding, ...]) -> tuple[tuple[str, ...], ...]:
    """Sets of freedoms of which only one can be driven, as they move in proportion."""
    column = {name: i for i, name in single_freedoms(m)}
    names = [name for finding in able for name in finding.freedoms]
    if not names or inputs.shape[1] > MOST_INPUTS:
        return ()
    rows = inputs[[column[n] for n in names]]
    size = np.linalg.norm(rows, axis=1)
    rows = rows / size[:, None]
    first: list[int] = []
    groups: list[list[str]] = []
    for i, name in enumerate(names):
        sine = np.sqrt(np.maximum(1.0 - (rows[first] @ rows[i]) ** 2, 0.0))
        alike = np.flatnonzero(sine < MOTIONS.proportional + MOTIONS.error / np.minimum(size[first], size[i]))
        if alike.size:
            groups[int(alike[0])].append(name)
        else:
            first.append(i)
            groups.append([name])
    return tuple(tuple(g) for g in groups if len(g) > 1)
