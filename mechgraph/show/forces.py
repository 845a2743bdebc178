"""Reaction forces of pairs: how large they become, and how they turn."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import door
from mechgraph.errors import DeclarationError
from mechgraph.result.solution import Solution
from mechgraph.show.acting import known_force
from mechgraph.show.canvas import HATCH, INK, MUTED, PALETTE, REACTION, Axes, new_axes, plain, said, with_unit
from mechgraph.show.curves import known_pair
from mechgraph.show.scene import place_of
from mechgraph.show.stage import Stage
from mechgraph.units import unit_of


@door
def reaction_ranges(s: Solution, *, moment: bool = False, ax: Axes = None) -> Any:
    """Draw from what to what the reactions of all pairs range over the positions. Returns the axes.

    One bar a pair: the size of its force (of its couple about its own point with ``moment``), the dot where the mean is. Where parts are
    not unique the bar is that of the others, which the name of the pair tells, and is hatched up to the end of the axis: the whole may be
    of any size.

    Raises
    ------
    DeclarationError
        where the solution has no forces; MissingExtraError without matplotlib.
    """
    m = s.mechanism
    if not s.has_forces:
        raise DeclarationError(f"reactions of {m.name!r}", ["the solution has no forces: use solve()"])
    sizes = {p.name: found for p in m.pairs if (found := _sizes(s, p.name, moment)) is not None}
    ax = new_axes((6.4, 1.3 + 0.34 * len(sizes))) if ax is None else ax
    largest = max((float(np.nanmax(v, initial=0.0)) for v, _, _ in sizes.values()), default=0.0) or 1.0
    labels = []
    for i, (name, (values, parts, lost)) in enumerate(sizes.items()):
        low, high, mean = (
            float(f(values)) if np.isfinite(values).any() else 0.0 for f in (np.nanmin, np.nanmax, np.nanmean)
        )
        if parts:
            ax.barh(i, high - low, left=low, height=0.56, color=PALETTE[0], zorder=2)
            ax.plot(mean, i, "o", ms=6, mfc="white", mec=INK, mew=1.2, zorder=4)
            ax.plot(
                [low, low], [i - 0.28, i + 0.28], color=PALETTE[0], lw=1.6, zorder=3
            )  # a constant force has a bar without length
        if lost:
            ax.barh(
                i, 1.08 * largest - high, left=high, height=0.56, facecolor="white", edgecolor=REACTION, hatch=HATCH, lw=0.8,
                gid=f"not unique {name}",
            )  # fmt: skip
        labels.append(f"{name} ({' '.join(parts) or 'nothing'} unique)" if lost else name)
    ax.set_yticks(range(len(labels)), map(said, labels))
    ax.invert_yaxis()
    ax.set_xlim(0.0, 1.08 * largest)
    what = "moment" if moment else "force"
    ax.set_xlabel(with_unit(f"{what} of the reaction", unit_of(m.units, (2 if moment else 1, 1, -2))), color=INK)
    plain(ax)
    ax.tick_params(axis="y", length=0)
    return ax


def _sizes(s: Solution, pair: str, moment: bool) -> tuple[Array, list[str], bool] | None:
    """Sizes at the solved positions of the parts that are unique at all of them, these, and whether there are others; None of no part."""
    result, row = s[pair], s.mechanism.pair(pair).type
    good = np.asarray(s.status).reshape(-1) == "ok"
    unique = {name: bool(np.asarray(flags).reshape(-1)[good].all()) for name, flags in result.unique.items()}
    if row.reactions is None:
        whole = (result.moment if moment else result.force).reshape(-1, 3)[good]
        known = all(unique[name] for name in row.component_names)
        return (
            np.linalg.norm(whole, axis=1) if known else np.full(good.sum(), np.nan),
            ["all"] if known else [],
            not known,
        )
    names = [c.name for c in row.reactions if c.is_couple == moment]
    if not names:
        return None
    parts = [name for name in names if unique[name]]
    if len(parts) == len(names):
        whole = (result.moment if moment else result.force).reshape(-1, 3)[good]
        return np.linalg.norm(whole, axis=1), parts, False
    values = result.components
    size = np.sqrt(sum((np.square(values[name].reshape(-1)[good]) for name in parts), np.zeros(int(good.sum()))))
    return size, parts, True


@door
def polar_force(s: Solution, pair: str, *, on: Literal["a", "b"] = "a", ax: Axes = None) -> Any:
    """Draw how the force in a bearing turns: its part across the axis in polar coordinates, fixed on a link. Returns the axes.

    The force of link a on link b, the angle counted about the axis from x of the marker on the chosen link: where a housing (``on="a"``) or
    a pin (``"b"``) is loaded. The circle is the largest force.

    Parameters
    ----------
    ax : polar axes of matplotlib (``projection="polar"``); new ones where left out.

    Raises
    ------
    DeclarationError
        where the solution has no forces, no such pair, the axes are not polar, or the force across the axis is not unique.
    """
    m = s.mechanism
    p = m.pair(known_pair(s, pair))
    if not s.has_forces:
        raise DeclarationError(f"polar force of {m.name!r}", ["the solution has no forces: use solve()"])
    if on not in ("a", "b"):
        raise DeclarationError(f"polar force of {m.name!r}", [f"on = {on!r}: expected 'a' or 'b'"])
    if ax is not None and ax.name != "polar":
        raise DeclarationError(
            f"polar force of {m.name!r}", ["ax: expected polar axes, add_subplot(projection='polar')"]
        )
    good, place = place_of(s)
    stage = Stage(m, place, len(good))
    frame = stage.frames[f"pair:{pair}@{0 if on == 'a' else p.type.f}"][:, :, :3]
    force = known_force(stage, s, p, good, frame[:, :, 2])
    if not np.isfinite(force).all(axis=1).any():
        raise DeclarationError(
            f"polar force of {m.name!r}",
            [f"the force in {pair!r} across its axis is not unique; mg.check(m).unique says why"],
        )
    from matplotlib.ticker import MaxNLocator

    inside = np.einsum("tij,ti->tj", frame, force)
    ax = new_axes((5.6, 5.6), projection="polar") if ax is None else ax
    full = np.full((np.asarray(s.status).size, 2), np.nan)
    full[good] = np.column_stack([np.arctan2(inside[:, 1], inside[:, 0]), np.hypot(inside[:, 0], inside[:, 1])])
    rows = full.reshape(-1, s.batch[-1] if s.batch else 1, 2)
    for turn in rows:
        ax.plot(turn[:, 0], turn[:, 1], color=REACTION, lw=1.8, marker="o" if len(turn) == 1 else "")
    peak = int(np.nanargmax(full[:, 1]))
    ax.plot(*full[peak], "o", ms=7, mfc="white", mec=REACTION, mew=1.8)
    unit = unit_of(m.units, (1, 1, -2))
    link = p.a if on == "a" else p.b
    what = with_unit(f"force of {p.a} on {p.b} in {pair} across its axis", unit)
    greatest = f"greatest {full[peak, 1]:.4g} {unit}".rstrip()
    ax.set_title(f"{what}\nas seen on {said(link)}, {greatest}", color=INK, fontsize=10)
    ax.tick_params(colors=MUTED)
    ax.set_rlabel_position(100)
    ax.yaxis.set_major_locator(MaxNLocator(4))
    return ax
