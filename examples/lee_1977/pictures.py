"""Figures of the three worked examples: matplotlib without a window, one style."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lee_1977.tables import table
from mechgraph.show.canvas import INK, PALETTE

COLOURS = PALETTE
PRINTED = {"ls": "", "marker": "o", "ms": 5.0, "mfc": "none", "mec": INK, "mew": 0.9, "zorder": 5}
"""How a printed table is drawn: open circles."""


def figure(width: float, height: float) -> Figure:
    """An empty figure in inches."""
    import matplotlib

    matplotlib.use("agg")
    import matplotlib.pyplot as plt

    plt.rcParams.update({"font.size": 10.0, "figure.dpi": 110.0})
    return plt.figure(figsize=(width, height), layout="constrained")


def finish(ax: Axes, x: str, y: str, title: str, legend: str = "best") -> None:
    """Labels with units, a grid, a legend outside of what matters."""
    ax.set_xlabel(x, color=INK)
    ax.set_ylabel(y, color=INK)
    ax.set_title(title, color=INK, fontsize=10.5, loc="left")
    ax.spines[["top", "right"]].set_visible(False)
    ax.grid(True, color="#e4e7eb", lw=0.8)
    ax.set_axisbelow(True)
    if legend:
        ax.legend(loc=legend, frameon=False, fontsize=9)


def reactions(ax: Axes, number: str, names: tuple[str, ...], found: np.ndarray) -> None:
    """Columns of a printed table of reactions as marks over the computed ones, ``found (rows, columns)`` in its order."""
    shown = table(number)
    columns = list(shown)[1:]
    for k, name in enumerate(names):
        ax.plot(shown["theta1"], found[:, columns.index(name)], color=COLOURS[k], lw=2.0, ls="--", label=name)
        ax.plot(shown["theta1"], shown[name], label=f"Table {number}" if k == len(names) - 1 else None, **PRINTED)


def save(drawn: Figure, target: Path) -> None:
    """Write the picture and let it go."""
    import matplotlib.pyplot as plt

    drawn.savefig(target, metadata={"Software": None})
    plt.close(drawn)
    print(f"{target.name}: {target.stat().st_size / 1000:.0f} kB")
