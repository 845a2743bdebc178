"""Continua: assemblies that can move with the drivers at rest, told by what moves in them and by where all else is."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from mechgraph.closure.assembly import CLOSED, close_all
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import System
from mechgraph.modes.family import Array, Family
from mechgraph.modes.nearby import Nearby, irregular
from mechgraph.modes.search import searched

LOOKED_FOR = 100
"""Random guesses from which real points of continua are looked for, the same ones for any seed."""
SAME_PLACE = 1e-5
"""Difference of what does not move up to which two points are of one continuum."""
MOST_STEPS_ALONG, STEP_ALONG, NEAREST_POINT = 200, 0.3, 1e-9
"""Steps along a continuum to its point nearest to the start, at most; the largest; and that at which it ends."""


class Found(NamedTuple):
    """A continuum: its real point ``x (nx,)`` nearest to the start, its ``dimension``, and freedoms ``moves (F,)`` that change in it."""

    x: Array
    dimension: int
    moves: Array


def continua(
    family: Family, system: System, ends: Array, drive: Array, progress: Callable[[str], None] | None
) -> list[Found]:
    """Continua with real points, drivers at ``drive (d,)``: those to which tracks came at ``ends (nx, n)``, and those that guesses find."""
    start = family.here.x[:, :1]
    guessed = searched(system, start[:, 0], family.columns, drive, LOOKED_FOR, 0.5, np.random.default_rng(0), progress)
    guessed = guessed[:, irregular(family, Configuration(system, guessed))]
    guessed = guessed[:, np.argsort(np.abs(_apart(system, guessed, start)).max(axis=0), kind="stable")]
    out: list[tuple[Found, Array]] = []

    def put(x: Array) -> None:
        about = Nearby(family, system, x)
        if about.moves:
            told = _described(about)
            if not any(_one(*told, *one) for one in out):
                out.append(_described(_nearest(about, start)))

    for x in guessed.T:
        put(x[:, None])
    for end in ends.T:
        real = _real(family, system, end[:, None])
        if real is not None:
            put(real)
    return [found for found, _ in out]


def _one(a: Found, at_rest: Array, b: Found, at_rest_b: Array) -> bool:
    """Whether the same freedoms move and all else is at the same place."""
    if a.dimension != b.dimension or (a.moves != b.moves).any():
        return False
    return bool(np.nanmax(np.abs(at_rest - at_rest_b), initial=0.0) < SAME_PLACE)


def _along(about: Nearby) -> Array:
    """Orthonormal motions ``(F, k)`` along a continuum."""
    out = np.zeros((about.system.n_freedoms, about.motions.shape[1]), dtype=about.motions.dtype)
    out[about.family.free] = np.linalg.qr(about.motions)[0]
    return out


def _apart(system: System, x: Array, start: Array) -> Array:
    """Increments ``(F, T)`` from ``start (nx, 1)`` to states without whole rounds."""
    d = system.difference(x, np.repeat(start, x.shape[1], axis=1))
    whole = (system.single_rows >= 0) & np.isfinite(system.periods)
    period = system.periods[whole, None]
    d[whole] -= period * np.round(d[whole] / period)
    return np.asarray(d)


def _real(family: Family, system: System, x: Array) -> Array | None:
    """A real point ``(nx, 1)`` of a continuum near a complex one: along it against its imaginary part; None where there is none."""
    for _ in range(MOST_STEPS_ALONG):
        if np.abs(x.imag).max() < NEAREST_POINT:
            break
        ways = _along(Nearby(family, system, x))
        gone = 1j * system.difference(x, x.real.astype(complex))[:, 0].imag
        c = ways.conj().T @ gone
        if np.abs(c).max(initial=0.0) < NEAREST_POINT:
            return None
        x, _ = close_all(system, system.advance(x, -_limited(ways @ c)[:, None]), family.columns)
    closed, error = close_all(system, x.real, family.columns)
    return closed if error[0] < CLOSED else None


def _nearest(about: Nearby, start: Array) -> Nearby:
    """The point of a continuum to which the way towards the start leads from another one, as far as it can move there."""
    for _ in range(MOST_STEPS_ALONG):
        ways = _along(about)
        step = ways @ (ways.T @ _apart(about.system, about.here.x, start))
        if np.abs(step).max() < NEAREST_POINT:
            break
        x, _ = close_all(about.system, about.system.advance(about.here.x, -_limited(step)), about.family.columns)
        there = Nearby(about.family, about.system, x)
        if not there.moves:
            break
        about = there
    return about


def _limited(step: Array) -> Array:
    return np.asarray(step * min(1.0, STEP_ALONG / max(float(np.abs(step).max()), 1e-300)))


def _described(about: Nearby) -> tuple[Found, Array]:
    """What moves, told at points next to it, as some of it may stand still there; and what does not (``Family.prints``, else NaN)."""
    family, system, landed = about.family, about.system, about.landed
    beside = [Nearby(family, system, landed[:, [i]]) for i in range(landed.shape[1])]
    least = min(len(one.motions.T) for one in beside)
    ways = np.concatenate([_along(one) for one in beside if len(one.motions.T) == least], axis=1)
    moves = np.abs(ways).max(axis=1) > SAME_PLACE
    here, there = (family.prints(Configuration(system, of)) for of in (about.here.x, landed))
    still = np.abs(there - here).max(axis=1) < SAME_PLACE
    found = Found(about.here.x[:, 0], min(one.dimension for one in beside), moves)
    return found, np.where(still, here[:, 0], np.nan)
