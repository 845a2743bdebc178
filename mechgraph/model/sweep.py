"""A sweep: positions in equal steps up to an end that is excluded, as files and the command line give it."""

from __future__ import annotations

import numpy as np

from mechgraph.algebra.se3 import Array

LONGEST_SWEEP = 1_000_000
"""Longest sweep that a file or the command line may ask for."""
LATE_END = 1e-9
"""Part of a step by which the end may come late through rounding and still be excluded."""


DIGITS = 12
"""Digits in which a sweep is sought first: those that people write."""


def sweep_of(positions: Array) -> list[float] | None:
    """``[first, end, step]`` of which ``swept`` makes exactly these positions ``(n,)``, in the fewest digits; None where none does."""
    n = len(positions)
    if n < 4:  # three numbers are as short
        return None
    first, step = float(positions[0]), float(positions[-1] - positions[0]) / (n - 1)
    steps = float(f"{step:.{DIGITS}g}"), step, float(positions[1]) - first
    for found in ([first, float(f"{first + n * step:.{DIGITS}g}"), step] for step in steps):
        made = swept(*found)
        if not isinstance(made, str) and np.array_equal(made, positions):
            return found
    return None


def swept(first: float, end: float, step: float) -> Array | str:
    """Positions ``first + k step`` before ``end``, or why there are none."""
    if step == 0 or first == end:
        return "no positions: " + ("the step is 0" if step == 0 else "the end, which is excluded, is also the first")
    count = (end - first) / step
    if count < 0:
        return "no positions: the step leads away from the end; change its sign, or exchange first and end"
    if count > LONGEST_SWEEP:
        return f"{count:.3g} positions, at most {LONGEST_SWEEP} are taken; take a larger step"
    return np.asarray(first + step * np.arange(max(int(np.ceil(count - LATE_END)), 1)), dtype=float)
