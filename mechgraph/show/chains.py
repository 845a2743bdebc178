"""Kinematic chains on a page: links as lines and polygons between their joints."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import combinations
from typing import Any

import numpy as np

from mechgraph.atlas.chain import Chain
from mechgraph.errors import DeclarationError
from mechgraph.show.canvas import INK, MUTED, PALETTE, bare, new_axes

MOST_ON_A_PAGE = 240
"""Chains on one page."""
CELL = 1.5
"""Width and height of a chain (inches)."""


def draw_chains(chains: Iterable[Chain], *, columns: int = 6, titles: Iterable[str] | None = None) -> Any:
    """Draw chains on one page, numbered in their order; returns the figure.

    Binary links are lines, others polygons, each number of joints in a colour of its own; joints are circles, multiple ones filled.
    """
    some = list(chains)
    if not 0 < len(some) <= MOST_ON_A_PAGE or columns < 1:
        expected = f"expected 1 to {MOST_ON_A_PAGE} chains and columns from 1"
        raise DeclarationError("draw_chains", [f"{len(some)} chains in {columns} columns: {expected}"])
    names = list(titles) if titles is not None else [str(i) for i in range(1, len(some) + 1)]
    rows = -(-len(some) // columns)
    figure = new_axes((CELL * min(columns, len(some)), CELL * rows)).figure
    figure.clear()
    for i, chain in enumerate(some):
        ax = figure.add_subplot(rows, min(columns, len(some)), i + 1)
        _draw(chain, ax)
        ax.set_title(names[i] if i < len(names) else "", fontsize=8, color=MUTED, pad=2)
    return figure


def _draw(chain: Chain, ax: Any) -> None:
    from matplotlib.patches import Polygon

    from mechgraph.show.layout import places

    joints_of = [[k for k, joint in enumerate(chain.joints) if link in joint] for link in range(chain.links)]
    edges = [(str(a), str(b)) for joints in joints_of for a, b in combinations(joints, 2)]
    found = places(map(str, range(len(chain.joints))), edges)
    at = np.array([found[str(k)] for k in range(len(chain.joints))])
    for joints in joints_of:
        corners = at[joints]
        colour = MUTED if len(joints) < 3 else PALETTE[len(joints) - 3]
        if len(joints) > 2:
            middle = corners.mean(axis=0)
            order = np.argsort(np.arctan2(*(corners - middle).T[::-1]), kind="stable")
            ax.add_patch(Polygon(corners[order], facecolor=colour, edgecolor=colour, alpha=0.35, lw=1.5, zorder=1))
        else:
            ax.plot(*corners.T, color=colour, lw=1.8, zorder=2)
    many = np.array([len(joint) > 2 for joint in chain.joints])
    ax.scatter(
        *at.T,
        s=np.where(many, 26, 14),
        facecolor=np.where(many, INK, "white").tolist(),
        edgecolor=INK,
        lw=0.9,
        zorder=3,
    )
    bare(ax)
    ax.set_aspect("equal")
    ax.margins(0.12)
