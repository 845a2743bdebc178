"""Pictures of assemblies side by side, and of branches over the driver."""

from __future__ import annotations

from typing import Any

import numpy as np

from mechgraph.errors import DeclarationError
from mechgraph.modes.branches import Branch, Branches
from mechgraph.modes.result import Assemblies
from mechgraph.show.canvas import INK, MUTED, PALETTE, new_axes, plain, said
from mechgraph.show.skeleton import draw_skeleton

MOST_SHOWN = 16
"""Most assemblies drawn side by side."""


def draw_assemblies(modes: Assemblies) -> Any:
    """The skeletons of all assemblies side by side, numbered, then a point of every continuum; the figure.

    Raises
    ------
    DeclarationError
        where there is none.
    """
    drawn = [*zip(modes.modes, modes.kinds, strict=True), *((one.point, "continuum") for one in modes.continua)]
    if not drawn:
        raise DeclarationError(f"picture of {modes.mechanism.name!r}", ["there is no real assembly to draw"])
    shown = drawn[:MOST_SHOWN]
    columns = int(np.ceil(np.sqrt(len(shown))))
    rows = -(-len(shown) // columns)
    probe = draw_skeleton(shown[0][0])
    projection = getattr(probe, "name", "rectilinear")
    first = new_axes((3.2 * columns, 3.0 * rows), projection=projection)
    figure = first.figure
    figure.clear()
    for i, (mode, kind) in enumerate(shown):
        ax = figure.add_subplot(rows, columns, i + 1, projection=projection)
        draw_skeleton(mode, ax=ax)
        ax.set_title(f"{i} ({kind})", fontsize=9)
    return figure


def draw_branches(b: Branches, output: str | None = None, *, ax: Any = None, current: int | None = None) -> Any:
    """A freedom over the driver on all branches, folds marked; branch ``current`` highlighted, the others grey. The axes.

    ``output`` left out is the last freedom that is no rotation of a ball. Angles are shown in degrees.
    """
    m, names = b.mechanism, b.mechanism.freedom_names()
    single = [name for name in names if m.freedom_fault(name, single=True) is None and name != b.driver]
    name = m.full_name(output) if output is not None else single[-1]
    if name not in names:
        raise DeclarationError(f"branches of {m.name!r}", [f"output {output!r}: expected one of {', '.join(single)}"])
    if current is not None and not 0 <= current < len(b):
        raise DeclarationError(f"branches of {m.name!r}", [f"current = {current}: expected 0 to {len(b) - 1}"])
    ax = new_axes((7.0, 4.5)) if ax is None else ax
    column = names.index(name)
    for i, branch in enumerate(b.branches):
        colour = PALETTE[branch.circuit % len(PALETTE)] if current in (None, i) else MUTED
        x, y = _curve(b, branch, column)
        ax.plot(
            x, y, color=colour, lw=2.5 if current == i else 1.5, label=said(f"branch {i}, circuit {branch.circuit}")
        )
    for fold in b.folds:
        for i in fold.branches:
            x, y = _curve(b, b.branches[i], column)
            end = -1 if fold.sense > 0 else 0
            ax.plot(x[end], y[end], "o", color=INK, ms=5)
    plain(ax)
    for label, freedom in ((ax.set_xlabel, b.driver), (ax.set_ylabel, name)):
        label(said(f"{freedom} [deg]" if m.turns(freedom) else freedom))
    ax.legend(fontsize=8)
    return ax


def _curve(b: Branches, branch: Branch, column: int) -> tuple[Any, Any]:
    """Driver and output of a branch, angles in degrees."""
    m = b.mechanism
    scales = [180.0 / np.pi if m.turns(name) else 1.0 for name in (b.driver, m.freedom_names()[column])]
    return scales[0] * branch.values, scales[1] * branch.coordinates[:, column]
