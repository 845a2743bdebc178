"""Real assemblies found by Newton's method from random guesses: where no class is known, and as a check where one is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from mechgraph.closure.assembly import CLOSED, close_all
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.ranges import BEYOND_END, beyond
from mechgraph.modes.family import Array

GUESSES_TOGETHER = 200
"""Guesses closed together."""
SLIDE_SPREAD = 1.5
"""Standard deviation of guessed slides, over L."""


def searched(
    system: System,
    x: Array,
    columns: Index,
    drive: Array,
    starts: int,
    turns: float,
    rng: np.random.Generator,
    progress: Callable[[str], None] | None = None,
) -> Array:
    """Closed states ``(nx, n)`` from ``starts`` random guesses within so many ``turns`` about ``x (nx,)``, drivers at ``drive (d,)``.

    None has a pair beyond an end of its curve or surface.
    """
    found = []
    turning = ~system.is_length
    for i in range(0, starts, GUESSES_TOGETHER):
        n = min(GUESSES_TOGETHER, starts - i)
        if progress is not None:
            progress(f"guess {i + 1} to {i + n} of {starts}")
        dq = rng.uniform(-2 * np.pi * turns, 2 * np.pi * turns, (system.n_freedoms, n))
        dq[~turning] = rng.normal(0.0, SLIDE_SPREAD, (int((~turning).sum()), n))
        guess = system.advance(np.repeat(x[:, None], n, axis=1), dq)
        guess[system.single_rows[columns]] = drive[:, None]
        closed, error = close_all(system, guess, columns)
        found.append(closed[:, (error <= CLOSED) & (beyond(system, closed) <= BEYOND_END).all(axis=0)])
    return np.concatenate(found, axis=1)
