"""Paths of points, and hodographs: the curves that the tips of their velocities or accelerations run through."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Literal

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import door
from mechgraph.errors import DeclarationError
from mechgraph.quantities import shown
from mechgraph.response.course import Response
from mechgraph.result.solution import Solution
from mechgraph.result.values import MaterialPoint
from mechgraph.show.canvas import INK, MUTED, PALETTE, Axes, new_axes, plain, said, with_unit
from mechgraph.show.scene import place_of
from mechgraph.show.stage import Stage
from mechgraph.units import unit_of

FINE = 400
"""Points that the path of a response has at least."""
STILL = 1e-6
"""Path of a point over the longest below which it stands still."""
RANK = {"position": 0, "velocity": 1, "acceleration": 2}


def motion_of(s: Solution, point: str) -> MaterialPoint:
    """Motion of a named point ``"bucket.tip"``, of a mass centre by its link ``"bucket"``, or of a pair's point on its link b.

    Raises
    ------
    DeclarationError
        naming what there is.
    """
    m = s.mechanism
    for link in m.links:
        for name in link.points:
            if point == f"{link.name}.{name}":
                return s.link(link.name).at(name)
    if point in m.link_index and m.link(point).center is not None:
        return s.link(point).point(m.link(point).center)
    if point in m.pair_index:
        pair = m.pair(point)
        moving = int(pair.b == m.frame)  # a pair to the frame moves on its other link
        return s.link((pair.b, pair.a)[moving]).point(pair.markers[1 - moving].point)
    there = [f"{k.name}.{name}" for k in m.links for name in k.points]
    there += [k.name for k in m.links if k.center is not None] + [p.name for p in m.pairs]
    raise DeclarationError(f"path in {m.name!r}", [f"there is no point {shown(point)}; points: {', '.join(there)}"])


@door
def point_path(s: Solution, points: str | Iterable[str] | None = None, *, ax: Axes = None) -> Any:
    """Draw the paths of points: in the plane of a plane mechanism, else in space. Returns the axes.

    Parameters
    ----------
    points : names of points (``"bucket.tip"``), of links (their mass centres) or of pairs (on link b); left out, all named points, or where
        there are none all pairs that move.
    ax : axes of matplotlib, of two or three dimensions; of a spatial mechanism on two dimensions, x and y are drawn.

    Raises
    ------
    DeclarationError
        where there is no such point; MissingExtraError without matplotlib.
    """
    s, names = finely(s), _names(s, points)
    return _draw(s, {name: motion_of(s, name).position for name in names}, 0, ax)


@door
def hodograph(
    s: Solution,
    points: str | Iterable[str] | None = None,
    *,
    of: Literal["velocity", "acceleration"] = "velocity",
    ax: Axes = None,
) -> Any:
    """Draw the hodograph of points: the curve of the tips of their velocities (or accelerations), from one origin. Returns the axes.

    Parameters as in ``point_path``.
    """
    if of not in ("velocity", "acceleration"):
        raise DeclarationError(
            f"hodograph of {s.mechanism.name!r}", [f"of = {of!r}: expected 'velocity' or 'acceleration'"]
        )
    s = finely(s)
    return _draw(s, {name: getattr(motion_of(s, name), of) for name in _names(s, points)}, RANK[of], ax)


def finely(s: Solution) -> Solution:
    """A response at times between its outputs too, so that its paths are curves."""
    if not isinstance(s, Response) or len(s.t) < 2:
        return s
    between = np.linspace(0.0, 1.0, max(2, -(-FINE // (len(s.t) - 1)) + 1))[:-1]
    return s.at(np.append((s.t[:-1, None] + np.diff(s.t)[:, None] * between).ravel(), s.t[-1]))


def _names(s: Solution, points: str | Iterable[str] | None) -> list[str]:
    if points is not None:
        return [points] if isinstance(points, str) else list(points)
    m = s.mechanism
    named = [f"{k.name}.{name}" for k in m.links for name in k.points if k.name != m.frame]
    strokes = {p.name: np.ptp(motion_of(s, p.name).position.reshape(-1, 3)[_solved(s)], axis=0).max() for p in m.pairs}
    moving = [name for name, stroke in strokes.items() if stroke > STILL * max(strokes.values())]
    return named or moving or [m.pairs[0].name]


def _solved(s: Solution) -> Array:
    return np.asarray(s.status).reshape(-1) == "ok"


def _draw(s: Solution, found: dict[str, Array], rank: int, ax: Any) -> Any:
    m = s.mechanism
    good, place = place_of(s)
    stage = Stage(m, place, len(good))
    flat = stage.normal is not None
    if ax is None:
        ax = new_axes() if flat else new_axes((6.4, 5.6), projection="3d")
    space = ax.name == "3d"
    axes = np.eye(3) if space or not flat else stage.upright.T[[0, 2]]
    axes = axes if space else axes[:2]
    for i, (name, values) in enumerate(found.items()):
        colour = PALETTE[i % len(PALETTE)]
        solved = (np.asarray(s.status) == "ok")[..., None]
        rows = np.where(solved, values, np.nan).reshape(-1, s.batch[-1] if s.batch else 1, 3)
        for k, row in enumerate(rows):
            seen = row @ axes.T
            ax.plot(
                *seen.T,
                color=colour,
                lw=1.9,
                label="_" * bool(k) + said(name),
                marker="o" if len(row) == 1 else "",
                ms=4,
            )
            there = seen[np.isfinite(seen).all(axis=1)]
            if len(there):
                ax.plot(*there[:1].T, "o", ms=6, mfc="white", mec=colour, mew=1.6, label="_")
    unit = unit_of(m.units, (1, 0, -rank))
    letters = [_letter(axis) for axis in axes]
    words = ("", "velocity ", "acceleration ")[rank]
    for setter, letter in zip(
        (ax.set_xlabel, ax.set_ylabel, *([ax.set_zlabel] if space else [])), letters, strict=False
    ):
        setter(with_unit(f"{words}{letter}", unit), color=INK)
    ax.set_aspect("equal", adjustable="datalim") if not space else ax.set_aspect("equal")
    if not space:
        plain(ax)
        if rank:
            ax.axhline(0.0, color=MUTED, lw=0.8, zorder=0)
            ax.axvline(0.0, color=MUTED, lw=0.8, zorder=0)
    ax.legend(frameon=False, **({"loc": "upper left", "bbox_to_anchor": (-0.12, 1.0)} if space else {}))
    return ax


def _letter(axis: Array) -> str:
    """``x`` for the x axis; the direction for what is none of them."""
    k = int(np.argmax(np.abs(axis)))
    return "xyz"[k] if abs(axis[k]) > 1 - 1e-9 else f"along ({', '.join(f'{c:.3g}' for c in axis)})"
