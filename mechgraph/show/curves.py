"""Curves over the driver: efforts."""

from __future__ import annotations

from typing import Any

import numpy as np

from mechgraph.errors import DeclarationError
from mechgraph.result.solution import Solution
from mechgraph.show.canvas import INK, MUTED, PALETTE, new_axes
from mechgraph.units import unit_of


def effort_curve(s: Solution, freedom: str | None = None, *, ax: Any = None, marked: int | None = None) -> Any:
    """Draw what a driver supplies over its position (a turn in degrees), and where loads act in its freedom what they do. Returns the axes.

    Parameters
    ----------
    freedom : a driven freedom; the first driver where it is left out.
    ax : axes of matplotlib to draw on; new ones where left out.
    marked : a position to mark on the curve, e.g. the one that a skeleton shows.

    Raises
    ------
    DeclarationError
        where the solution has no forces or no such driver; MissingExtraError without matplotlib.
    """
    m = s.mechanism
    drivers = [m.full_name(d.freedom) for d in m.drives]
    if not s.has_forces or not drivers:
        raise DeclarationError(
            f"effort curve of {m.name!r}", ["the solution has no driver effort: use solve() with a driver"]
        )
    name = drivers[0] if freedom is None else m.full_name(freedom)
    if name not in drivers:
        raise DeclarationError(f"effort curve of {m.name!r}", [f"{name!r} is no driver; drivers: {', '.join(drivers)}"])
    k, j = m.freedom(name)
    pair = m.pairs[k]
    turns, couple = pair.type.freedoms[j].turns, pair.type.efforts[j].is_couple
    result = s[pair.name]
    order = np.atleast_1d(np.rad2deg(result.position[..., j]) if turns else result.position[..., j])
    efforts = {"driver": np.atleast_1d(result.effort[..., j]), "applied": np.atleast_1d(result.applied_effort[..., j])}
    if not np.nan_to_num(efforts["applied"]).any():
        efforts.pop("applied")

    ax = new_axes() if ax is None else ax
    unit = unit_of(m.units, (2, 1, -2) if couple else (1, 1, -2))
    length = unit_of(m.units, (1, 0, 0))
    marker, rows = "o" if order.shape[-1] == 1 else "", order.reshape(-1, order.shape[-1])
    for (label, effort), colour in zip(efforts.items(), (PALETTE[0], MUTED), strict=False):
        for i, (x, y) in enumerate(zip(rows, effort.reshape(rows.shape), strict=True)):
            ax.plot(x, y, color=colour, lw=2.0, solid_capstyle="round", marker=marker, label="_" * bool(i) + label)
    if len(efforts) > 1:
        ax.legend(frameon=False)
    ax.axhline(0.0, color=MUTED, lw=0.8, zorder=0)
    ax.set_xlabel(f"{name} [deg]" if turns else f"{name} [{length}]" if length else name, color=INK)
    who = f"of the driver {name}" if len(efforts) == 1 else f"in {name}"
    ax.set_ylabel(f"{'torque' if couple else 'force'} {who}" + (f" [{unit}]" if unit else ""), color=INK)
    if turns and np.nanmax(order) - np.nanmin(order) > 90:
        step = next(d for d in (30, 45, 60, 90, 180, 360, 1e9) if (np.nanmax(order) - np.nanmin(order)) / d <= 8)
        from matplotlib.ticker import MultipleLocator

        ax.xaxis.set_major_locator(MultipleLocator(step))
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(True, color="#e4e7eb", lw=0.8)
    ax.set_axisbelow(True)
    ax.margins(x=0.01)
    if marked is not None:
        ax.plot(
            order.reshape(-1)[marked],
            efforts["driver"].reshape(-1)[marked],
            "o",
            ms=8,
            mfc="white",
            mec=PALETTE[1],
            mew=2.2,
            zorder=5,
        )
    return ax
