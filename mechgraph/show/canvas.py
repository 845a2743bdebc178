"""Figures and axes of matplotlib, asked for only when something is drawn."""

from __future__ import annotations

import importlib
from typing import Any

from mechgraph.errors import MissingExtraError

INK = "#1f2933"
MUTED = "#7b8794"
FAINT = "#c8d0d8"
PALETTE = ("#0b6fa4", "#d1495b", "#2e8b57", "#e09f3e", "#6a4c93", "#00798c", "#8d5524", "#c2185b")
"""Colours of moving links, in order and then again."""


def new_axes(**options: Any) -> Any:
    """Axes in a figure of their own, which pyplot does not keep: it goes when nobody holds it.

    Raises
    ------
    MissingExtraError
        where matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "plot") from None
    return Figure(layout="constrained").add_subplot(**options)


def toolkit(name: str) -> Any:
    """A module of matplotlib's three-dimensional toolkit, which has no types."""
    return importlib.import_module(f"mpl_toolkits.mplot3d.{name}")
