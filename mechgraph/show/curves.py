"""Curves over the drivers, time or any freedom: efforts, reactions, the margin to a singular position.

Positions that were not solved leave gaps. What is not unique has no curve: a hatched strip says where.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import door
from mechgraph.errors import DeclarationError
from mechgraph.quantities import shown
from mechgraph.response.course import Response
from mechgraph.result.solution import Solution
from mechgraph.show.canvas import HATCH, INK, MUTED, PALETTE, Axes, new_axes, plain, said, with_unit
from mechgraph.show.margins import margins
from mechgraph.units import unit_of

TICKS = (10, 15, 30, 45, 60, 90, 180, 360)
"""Distances of ticks of angles, degrees."""
STRIP = 0.07
"""Height of a hatched strip over that of the axes."""


@dataclass(frozen=True)
class Abscissa:
    """What curves are drawn over: values ``(cases, T)``, the label of the axis, and whether they are degrees."""

    values: Array
    label: str
    degrees: bool = False


def abscissa(s: Solution, over: str | None = None) -> Abscissa:
    """Values over which a solution is drawn, one for every position.

    ``over``: a freedom, ``"t"`` for time or ``"position"`` for the number of the position; left out, time of a response, else the first
    freedom that moves as prescribed.
    """
    m, status = s.whole, np.asarray(s.status)
    rows = (-1, status.shape[-1] if status.ndim else 1)
    if over is None:
        timed = isinstance(s, Response) or (not s.prescribed and s.t is not None)
        still = s.prescribed[0] if s.prescribed and rows[1] == 1 else "position"
        over = "t" if timed else next((name for name in s.prescribed if _stroke(s, name) > 0), still)
    if over == "t":
        if s.t is None:
            raise DeclarationError(
                f"curve of {m.name!r}", ["over='t': this motion has no times; name a freedom, or 'position'"]
            )
        t = np.broadcast_to(np.asarray(s.t, dtype=float), s.batch).reshape(rows)
        return Abscissa(t, with_unit("t", unit_of(m.units, (0, 0, 1))))
    if over == "position":
        return Abscissa(np.tile(np.arange(rows[1], dtype=float), (status.size // rows[1], 1)), "position")
    values, name = _coordinates(s, over).reshape(rows), m.full_name(over)
    if m.turns(name):
        return Abscissa(np.rad2deg(values), with_unit(name, "deg"), True)
    return Abscissa(values, with_unit(name, unit_of(m.units, (1, 0, 0))))


def _coordinates(s: Solution, freedom: str) -> Array:
    k, j = s.whole.freedom(freedom)
    return np.asarray(s[s.whole.pairs[k].name].position[..., j])


def _stroke(s: Solution, freedom: str) -> float:
    values = _coordinates(s, freedom)
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if known.size else 0.0


def lay_out(ax: Any, x: Abscissa, label: str) -> None:
    """Labels, grid, and ticks of angles at round ones."""
    ax.set_xlabel(x.label, color=INK)
    ax.set_ylabel(label, color=INK)
    plain(ax)
    known = x.values[np.isfinite(x.values)]
    if known.size and np.ptp(known) > 0:
        room = 0.01 * np.ptp(known)
        ax.set_xlim(known.min() - room, known.max() + room)
    if x.degrees and known.size and np.ptp(known) > 60:
        from matplotlib.ticker import MultipleLocator

        step = next((d for d in TICKS if np.ptp(known) / d <= 8), 360)
        ax.xaxis.set_major_locator(MultipleLocator(step))


def draw_curve(ax: Any, x: Abscissa, y: Array, label: str, **style: Any) -> None:
    """One curve a case; positions between others that were not solved are dots."""
    for i, (xs, ys) in enumerate(zip(x.values, np.reshape(y, x.values.shape), strict=True)):
        there = np.isfinite(xs) & np.isfinite(ys)
        ys = np.where(there, ys, np.nan)
        beside = np.concatenate([[False], there, [False]])
        alone = there & ~beside[:-2] & ~beside[2:]
        (line,) = ax.plot(xs, ys, label="_" * bool(i) + said(label), **{"lw": 2.0, "solid_capstyle": "round", **style})
        if alone.any():
            ax.plot(xs[alone], ys[alone], "o", ms=4.5, color=line.get_color(), label="_")


def hatched_strips(ax: Any, x: Abscissa, lost: Sequence[tuple[str, Array, str]]) -> None:
    """Along the upper edge one strip for each ``(name, where (positions), colour)`` that is not unique somewhere."""
    from matplotlib.patches import Rectangle

    if not lost:
        return
    low, high = ax.get_ylim()
    ax.set_ylim(low, high + (high - low) * STRIP * len(lost) / (1 - STRIP * len(lost)))
    for i, (name, where, colour) in enumerate(lost):
        there = x.values[np.reshape(where, x.values.shape) & np.isfinite(x.values)]
        begin, end = (there.min(), there.max()) if there.size else ax.get_xlim()
        if begin == end:
            begin, end = ax.get_xlim()
        strip = Rectangle(
            (begin, 1 - STRIP * (i + 0.92)), end - begin, 0.84 * STRIP, transform=ax.get_xaxis_transform(),
            facecolor="white", edgecolor=colour, hatch=HATCH, lw=0.8, label=said(f"{name}: not unique"), gid=f"not unique {name}", zorder=3,
        )  # fmt: skip
        ax.add_patch(strip)


@door
def effort_curve(
    s: Solution,
    freedom: str | Iterable[str] | None = None,
    *,
    over: str | None = None,
    ax: Axes = None,
    marked: int | None = None,
) -> Any:
    """Draw what drivers supply, and where loads act in their freedoms what these do. Returns the axes.

    Couples are read on the left, forces on the right where there are both. What the driver supplies is drawn full, what loads do in its
    freedom dashed.

    Parameters
    ----------
    s : a solution with forces, or a response.
    freedom : a driven freedom or several; all of them where it is left out.
    over : a freedom, ``"t"`` or ``"position"``; left out, time of a response, else the first freedom that was prescribed.
    ax : axes of matplotlib to draw on; new ones where left out.
    marked : flat index of a position to mark on the curves, e.g. the one that a skeleton shows.

    Raises
    ------
    DeclarationError
        where the solution has no forces or no such driver; MissingExtraError without matplotlib.
    """
    names, m = _driver_names(s, freedom), s.whole
    x = abscissa(s, over)
    ax = new_axes() if ax is None else ax
    found = {name: _driver_effort(s, name) for name in names}
    sides: dict[bool, Any] = dict.fromkeys((effort.couple for effort in found.values()), ax)
    if len(sides) == 2:
        sides[False] = ax.twinx()
    several, entries = len(names) > 1, 0
    for i, (name, effort) in enumerate(found.items()):
        colour, side = PALETTE[i % len(PALETTE)], sides[effort.couple]
        draw_curve(side, x, effort.known, name if several else "driver", color=colour)
        if effort.loaded:
            label = f"applied in {name}" if several else "applied"
            draw_curve(side, x, effort.applied, label, color=colour if several else MUTED, ls=(0, (4, 2)))
        entries += 1 + effort.loaded
        if marked is not None:
            at = x.values.reshape(-1)[marked], effort.known.reshape(-1)[marked]
            side.plot(*at, "o", ms=8, mfc="white", mec=PALETTE[1], mew=2.2, zorder=5, label="_")
    for couple, side in sides.items():
        side.axhline(0.0, color=MUTED, lw=0.8, zorder=0)
        own = [name for name, effort in found.items() if effort.couple == couple]
        who = "of the drivers" if len(own) > 1 else f"{'of the driver' if entries == 1 else 'in'} {own[0]}"
        lay_out(side, x, with_unit(f"{'torque' if couple else 'force'} {who}", unit_of(m.units, (1 + couple, 1, -2))))
    if len(sides) == 2:
        sides[False].spines["right"].set_visible(True)
        sides[False].grid(False)
    lost = [(name, effort.unknown, PALETTE[i % len(PALETTE)]) for i, (name, effort) in enumerate(found.items())]
    lost = [strip for strip in lost if strip[1].any()]
    hatched_strips(ax, x, lost)
    _legend(ax, [side for side in sides.values() if side is not ax], entries + len(lost))
    return ax


def _driver_names(s: Solution, freedom: str | Iterable[str] | None) -> list[str]:
    """Full names of the drivers that were asked for."""
    m = s.whole
    if not s.has_forces or not s.actuated:
        raise DeclarationError(
            f"effort curve of {m.name!r}", ["the solution has no driver effort: use solve() with a driver"]
        )
    asked = s.actuated if freedom is None else [freedom] if isinstance(freedom, str) else list(freedom)
    names = [m.full_name(name) for name in asked]
    faults = [f"{name!r} is no driver; drivers: {', '.join(s.actuated)}" for name in names if name not in s.actuated]
    if faults or not names:
        raise DeclarationError(f"effort curve of {m.name!r}", faults or ["no driver is named"])
    return names


@dataclass(frozen=True)
class _DriverEffort:
    """What a driver supplies, NaN where that is not unique; where it is ``unknown`` so; what loads do in its freedom."""

    couple: bool
    known: Array
    unknown: Array
    applied: Array

    @property
    def loaded(self) -> bool:
        """Whether a load acts in the freedom."""
        return bool(np.nan_to_num(self.applied).any())


def _driver_effort(s: Solution, name: str) -> _DriverEffort:
    k, j = s.whole.freedom(name)
    pair = s.whole.pairs[k]
    result = s[pair.name]
    unique = result.unique.get("effort", result.unique.get(f"effort {pair.type.freedoms[j].name}", True))
    known = np.where(unique, result.effort[..., j], np.nan)
    unknown = (np.asarray(s.status) == "ok") & ~np.isfinite(known)
    return _DriverEffort(pair.type.efforts[j].is_couple, known, unknown, np.asarray(result.applied_effort[..., j]))


def _legend(ax: Any, others: Sequence[Any], entries: int) -> None:
    """A legend of all curves, those read on the right among them, where there is more than one."""
    if entries < 2:
        return
    found = [pair for side in (ax, *others) for pair in zip(*side.get_legend_handles_labels(), strict=True)]
    ax.legend([handle for handle, _ in found], [label for _, label in found], frameon=False)


@door
def reaction_curve(
    s: Solution, pair: str, *, moment: bool = False, over: str | None = None, ax: Axes = None, marked: int | None = None
) -> Any:
    """Draw the components of a pair's reaction in its own frame, with their ranges in the legend. Returns the axes.

    A component that is not unique has no curve but a hatched strip, also where the solution holds the one of least norm.

    Parameters
    ----------
    moment : the couples rather than the forces.
    over, ax, marked : as in ``effort_curve``.

    Raises
    ------
    DeclarationError
        where the solution has no forces, no such pair, or the pair transmits no such component.
    """
    m = s.whole
    if not s.has_forces:
        raise DeclarationError(f"reaction of {m.name!r}", ["the solution has no forces: use solve()"])
    result, row = s[pair], m.pair(pair).type
    kinds = {c.name: c.is_couple for c in row.reactions or ()} or dict.fromkeys(row.component_names, False)
    names = [name for name, couple in kinds.items() if couple == moment]
    if not names:
        raise DeclarationError(
            f"reaction of {m.name!r}",
            [
                f"pair {pair!r} ({row.symbol}) transmits no {'moment' if moment else 'force'}; its components: {', '.join(kinds) or 'none'}"
            ],
        )
    x = abscissa(s, over)
    ax = new_axes() if ax is None else ax
    solved, lost = np.asarray(s.status) == "ok", []
    values, unique = result.components, result.unique
    unit = result.units["components"][names[0]]
    for i, name in enumerate(names):
        known = np.where(np.asarray(unique.get(name, True)), values[name], np.nan)
        colour = PALETTE[i % len(PALETTE)]
        unknown = solved & ~np.isfinite(known)
        if unknown.any():
            lost.append((name, unknown, colour))
        if np.isfinite(known).any():
            span = f"{np.nanmin(known):.4g} to {np.nanmax(known):.4g}"
            draw_curve(ax, x, known, f"{name}: {span} {unit}".rstrip(), color=colour)
            if marked is not None:
                ax.plot(
                    x.values.reshape(-1)[marked], known.reshape(-1)[marked], "o", ms=7, mfc="white", mec=colour, mew=2
                )
    ax.axhline(0.0, color=MUTED, lw=0.8, zorder=0)
    owner = m.pair(pair)
    what = "moment" if moment else "force"
    lay_out(ax, x, with_unit(f"{what} of {owner.a} on {owner.b} in {pair}", unit))
    hatched_strips(ax, x, lost)
    ax.legend(frameon=False)
    return ax


@door
def margin_curve(s: Solution, *, over: str | None = None, ax: Axes = None) -> Any:
    """Draw over the positions how far they are from singular ones. Returns the axes.

    The smallest singular value of the scaled closure equations that was kept, over the largest, with the drivers free (a change point
    of the mechanism where it falls to zero) and at rest (a dead point of the drivers): of ``mg.check`` there. Below the dashed line a
    report calls a position nearly singular.
    """
    x = abscissa(s, over)
    found = margins(s)
    ax = new_axes() if ax is None else ax
    draw_curve(ax, x, found.free, "drivers free", color=PALETTE[0])
    if found.driven is not None:
        draw_curve(ax, x, found.driven, "drivers at rest", color=PALETTE[1])
    ax.axhline(found.near_below, color=MUTED, lw=1.0, ls=(0, (5, 3)), label="nearly singular below")
    ax.set_yscale("log")
    lay_out(ax, x, "margin (smallest singular value over largest)")
    ax.legend(frameon=False)
    return ax


def known_pair(s: Solution, pair: str) -> str:
    """The name of a pair, or an error that names those there are."""
    names = [p.name for p in s.mechanism.pairs]
    if pair not in names:
        raise DeclarationError(
            f"picture of {s.mechanism.name!r}", [f"there is no pair {shown(pair)}; pairs: {', '.join(names)}"]
        )
    return pair
