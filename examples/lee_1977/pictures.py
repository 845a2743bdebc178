"""Figures of the three worked examples: matplotlib without a window, one style."""

from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

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


def save(drawn: Figure, target: Path) -> None:
    """Write the picture and let it go."""
    import matplotlib.pyplot as plt

    drawn.savefig(target, metadata={"Software": None})
    plt.close(drawn)
    print(f"{target.name}: {target.stat().st_size / 1000:.0f} kB")
