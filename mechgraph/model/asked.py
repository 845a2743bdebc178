"""Functions that a user gives for a curve or a surface: asked at parameters, and what is wrong with what they return."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.errors import ShapeError

PARAMETERS = "uv"
"""What the parameters are called in messages."""
BESIDE = 0.5 * (3.0 - np.sqrt(5.0))
"""Where in an interval slopes are taken, a part of it that is no ratio of whole numbers, as places where a shape changes are."""
SLOPE_STEPS, SLOPE_ERROR = (1e-4, 1e-5, 1e-6), 1e-3
"""Parts of the range over which a slope is taken, and part of the size by which a derivative may differ from it."""


def asked(function: Callable[..., Any], at: Sequence[Array], least: int, most: int) -> Array:
    """Position and derivatives ``(most, 3, n)`` at parameters ``(n,)`` each; zeros for those that may be left out, beyond ``least``.

    Raises
    ------
    ShapeError
        where the function raises (its cause), or returns anything but ``least`` or more finite arrays ``(3, n)``.
    """
    if not at[0].size:  # as where all positions are interpolated beside a change point; what reduces nothing raises
        return np.zeros((most, 3, 0))
    found = _asked(function, at, least, most)
    if isinstance(found, np.ndarray):
        return found
    first = next((i for i in range(at[0].size) if not _fits(function, [u[i : i + 1] for u in at], least, most)), None)
    where = "; each of the values alone does" if first is None else f" at {_named([u[first] for u in at])}"
    text, cause = found
    raise ShapeError(f"position: {text}{where}") from cause


def _asked(
    function: Callable[..., Any], at: Sequence[Array], least: int, most: int
) -> Array | tuple[str, Exception | None]:
    """The arrays, or what is wrong with them and what was raised."""
    shape = (3, at[0].size)
    try:
        given = list(function(*at))[:most]
        parts = [np.asarray(part, dtype=float) for part in given]
    except Exception as error:
        return f"raised {type(error).__name__}: {error}", error
    wrong = next((part.shape for part in parts if part.shape not in (shape, (3, 1))), None)
    if wrong is not None or len(parts) < least:
        got = f"{len(parts)} arrays" if wrong is None else f"an array {wrong}"
        return f"returned {got}, expected {least} arrays (3, n), here {shape}", None
    out = np.zeros((most, *shape))
    for own, part in zip(out, parts, strict=False):
        own[:] = part
    return out if np.isfinite(out).all() else ("returned a number that is not finite", None)


def _fits(function: Callable[..., Any], at: Sequence[Array], least: int, most: int) -> bool:
    return isinstance(_asked(function, at, least, most), np.ndarray)


def _named(values: Sequence[float]) -> str:
    return ", ".join(f"{name} = {value:.6g}" for name, value in zip(PARAMETERS, values, strict=False))


def inner(ends: tuple[float, float]) -> Array:
    """A few simple parameters in a range, at which a function is asked first."""
    return np.linspace(*ends, 7)[1:-1]


def between(grid: Array) -> Array:
    """Parameters ``(n,)`` in the intervals of a grid ``(n + 1,)`` at which slopes are taken."""
    return np.asarray(grid[:-1] + BESIDE * np.diff(grid))


def slope_faults(
    ask: Callable[..., Array],
    at: Sequence[Array],
    steps: Sequence[tuple[int, int, int]],
    words: Sequence[str],
    where: str,
    room: Array | float = np.inf,
) -> list[str]:
    """Derivatives that are not the slopes of what they belong to.

    ``at``: parameters ``(n,)`` each, as from ``between``; of ``steps`` each is a derivative, what it is derived from, and the parameter by
    which: numbers of what ``ask`` returns ``(orders, 3, n)``, called as in ``words``. Slopes are taken over shorter and shorter steps,
    none longer than the ``room``: that over one of them fits a true derivative, however fast it changes.
    """
    found, known = [], ask(*at)
    for high, low, by in steps:
        extent = float(np.ptp(at[by]))
        most = SLOPE_ERROR * np.abs(known[[low, high]]).max() / min(1.0, extent)
        miss = np.full(at[by].shape, np.inf)
        for part in SLOPE_STEPS:
            h = np.minimum(part * extent, room)
            ahead, back = (ask(*(u + sign * h * (i == by) for i, u in enumerate(at)))[low] for sign in (1.0, -1.0))
            miss = np.minimum(miss, np.abs((ahead - back) / (2 * h) - known[high]).max(axis=0))
            if miss.max() <= most:
                break
        else:
            worst = int(np.argmax(miss))
            at_worst = _named([u[worst] for u in at])
            found.append(
                f"{where}position: {words[high]} differs from the slope of {words[low]} by {miss[worst]:.3g} at {at_worst}"
            )
    return found
