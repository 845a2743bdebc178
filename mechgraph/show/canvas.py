"""Figures and axes of matplotlib, asked for only when something is drawn; colours, and how axes look."""

from __future__ import annotations

import functools
import importlib
import io
from collections.abc import Sequence
from typing import Annotated, Any

from mechgraph.arguments import Wanted
from mechgraph.errors import MissingExtraError, visible
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import is_numeric

MOST_DPI, MOST_INCHES, PNG_DPI = 10_000, 400, 110


def _sized(value: Any) -> bool:
    return is_numeric(value, (2,)) and min(value) >= 0.1 and max(value) <= MOST_INCHES


DRAWN = Wanted(lambda value: hasattr(value, "get_figure"), "axes of matplotlib")
Axes = Annotated[Any, Wanted(lambda value: value is None or DRAWN.fits(value), DRAWN.words)]
"""Axes to draw on, or None for new ones."""
Dpi = Annotated[
    float, Wanted(lambda value: is_numeric(value, ()) and 10 <= value <= MOST_DPI, f"a number from 10 to {MOST_DPI}")
]
Size = Annotated[tuple[float, float], Wanted(_sized, f"width and height, inches from 0.1 to {MOST_INCHES}")]

INK = "#1f2933"
MUTED = "#7b8794"
FAINT = "#c8d0d8"
GRID = "#e4e7eb"
PALETTE = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#6b3a00")
"""Colours of moving links and of curves, in order and then again; told apart by colour-blind readers too (Okabe and Ito, and a brown)."""
REACTION, LOAD = "#d55e00", "#a3006a"
"""Colours of reaction forces and of loads."""
HATCH = "/////"
"""How what is not unique is filled: it has no value."""


def new_axes(size: tuple[float, float] | None = None, **options: Any) -> Any:
    """Axes in a figure of their own (of a size in inches), which pyplot does not keep: it goes when nobody holds it.

    Raises
    ------
    MissingExtraError
        where matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "plot") from None
    ax: Any = Figure(figsize=size, layout="constrained").add_subplot(**options)
    ax._repr_png_ = functools.partial(
        _png, ax.figure
    )  # a notebook shows axes by their name, and only figures of pyplot
    return ax


def _png(figure: Any) -> bytes:
    """The picture of a figure."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=PNG_DPI)
    return file.getvalue()


def toolkit(name: str) -> Any:
    """A module of matplotlib's three-dimensional toolkit, which has no types."""
    return importlib.import_module(f"mpl_toolkits.mplot3d.{name}")


def bare(ax: Any) -> None:
    """No frame, ticks or scales: a diagram."""
    ax.set_axis_off()


def plain(ax: Any) -> None:
    """Axes of curves: two spines, a grid behind."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(True, color=GRID, lw=0.8)
    ax.set_axisbelow(True)


def said(text: str) -> str:
    """A text with names of a user as matplotlib shows it: no formula is made of it, and a legend leaves none out."""
    plain_text = visible(text).replace("$", r"\$")
    return f"\u2009{plain_text}" if plain_text.startswith("_") else plain_text


def with_unit(text: str, unit: str) -> str:
    """``force [N]``; the text alone where there is no unit."""
    return said(f"{text} [{unit}]" if unit else text)


def colours(m: Mechanism, highlight: Sequence[str] = ()) -> dict[str, str]:
    """A colour for every link; grey for the frame and, where pairs are highlighted, for links that lie at none or one of them."""
    moving = [k for k in m.link_names() if k != m.frame]
    out = {m.frame: MUTED} | {k: PALETTE[i % len(PALETTE)] for i, k in enumerate(moving)}
    if highlight:
        ends = [link for p in m.pairs if p.name in highlight for link in (p.a, p.b)]
        out |= {k: FAINT for k in moving if ends.count(k) < min(2, len(highlight))}
    return out
