"""Every freedom of a closed position as a motion: followed to and fro with the loops closed, or about its own line."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import CLOSED, close
from mechgraph.closure.indexing import Index
from mechgraph.numerics.tolerances import MOTIONS
from mechgraph.report.facts import Geometry
from mechgraph.report.report import DeterminacyReport

REACH = 0.35
"""How far a freedom is followed to either side (radians, or lengths / L), in so many steps."""
STEPS_A_MODE = 12
LEAST = 3
"""Steps that must be closed for a motion to count as one."""
KEPT = 0.3
"""Part of a step that must be left once the loops are closed."""
SHAKEN = 0.12
"""How far an infinitesimal motion is drawn."""
PICTURES_A_TURN = 48
"""Positions of a full turn."""


@dataclass(frozen=True)
class Wiggle:
    """One freedom: states ``x (nx, T)`` in the order in which they are passed, a ``title`` and what it is in words.

    Of a passive turn also its ``axis`` and the ``links`` that turn.
    """

    group: str
    title: str
    text: str
    x: Array
    kind: str
    axis: tuple[tuple[float, ...], tuple[float, ...]] | None = None
    links: tuple[str, ...] = ()


def wiggles(report: DeterminacyReport) -> Iterator[Wiggle]:
    """What every driver does alone, what is neither driven nor passive, and every passive freedom."""
    g = report.geometry
    if g is None:
        return
    names = report.mechanism.freedom_names()
    for column in g.driven.tolist():
        rates = _alone(g, column)
        if rates is not None:
            others = ", ".join(names[i] for i in np.flatnonzero(np.abs(rates) > MOTIONS.still) if i != column)
            text = f"{names[column]} is driven{'; with it move ' + others if others else ', nothing else moves'}"
            rest = g.driven[g.driven != column]
            yield _followed(g, "Freedoms", f"{names[column]} driven", text, rates, rest)
    for motion, finding in zip(g.freedoms.undriven, report.undriven, strict=True):
        text = f"neither driven nor passive: {finding.text}"
        yield _followed(g, "Freedoms", f"{', '.join(motion.names[:3])} free", text, motion.rates, g.driven)
    for passive, found in zip(g.freedoms.passive, report.passive, strict=True):
        rate = float(np.linalg.norm(passive.twist[:3])) if found.turns else 0.0
        if rate:
            along = np.linspace(0, 2 * np.pi / rate, PICTURES_A_TURN + 1)
        else:
            along = REACH * np.linspace(-1, 1, 2 * STEPS_A_MODE + 1)
        x = g.system.advance(g.x[:, None], passive.rates[:, None] * along)
        yield Wiggle(
            "Passive freedoms",
            found.name,
            found.text,
            x,
            "spin" if rate else "swing",
            found.axis if rate else None,
            found.links,
        )


def _alone(g: Geometry, column: int) -> Array | None:
    """Rates with one driver at the rate one and the others at rest, least of the motions that do it; None where there are none."""
    N = g.freedoms.inputs
    wanted = (g.driven == column).astype(float)
    mix, *_ = np.linalg.lstsq(N[g.driven], wanted, rcond=MOTIONS.dependent)
    if np.abs(N[g.driven] @ mix - wanted).max(initial=0.0) > 1e-6:
        return None
    return np.asarray(N @ mix)


def _followed(g: Geometry, group: str, title: str, text: str, rates: Array, rest: Index) -> Wiggle:
    """A motion with the freedoms ``rest`` at rest, to both sides; infinitesimal, without closing, where it cannot be followed."""
    v = rates / np.abs(rates).max()
    sides = [_side(g, sign * v, rest) for sign in (-1.0, 1.0)]
    if max(map(len, sides)) < LEAST:
        x = g.system.advance(g.x[:, None], v[:, None] * SHAKEN * np.linspace(-1, 1, 2 * STEPS_A_MODE + 1))
        return Wiggle(
            group, title, f"{text}. Infinitesimal only: beyond it the loops open, as they are drawn here", x, "swing"
        )
    return Wiggle(group, title, text, np.stack([*sides[0][::-1], g.x, *sides[1]], axis=1), "swing")


def _side(g: Geometry, v: Array, rest: Index) -> list[Array]:
    """Closed states to one side: each step goes on in the direction of the one before."""
    h, x, out = REACH / STEPS_A_MODE, g.x, []
    for _ in range(STEPS_A_MODE):
        guess = g.system.advance(x[:, None], h * v[:, None])[:, 0]
        closed, error = close(g.system, guess, rest)
        moved = g.system.difference(closed[:, None], x[:, None])[:, 0]
        size = float(np.abs(moved).max())
        if error > CLOSED or size < KEPT * h or moved @ v < KEPT * h * (v @ v):
            break
        v, x = moved / size, closed
        out.append(closed)
    return out
