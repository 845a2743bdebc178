"""Kinematic chains on a page: links as lines and polygons between their joints."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import combinations
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import door
from mechgraph.closure.indexing import Index
from mechgraph.errors import DeclarationError
from mechgraph.graph.chains import Chain
from mechgraph.show.canvas import INK, MUTED, PALETTE, Axes, bare, new_axes

MOST_ON_A_PAGE = 240
"""Chains on one page."""
CELL = 1.5
"""Width and height of a chain (inches)."""


PLACES_SEED, MOVES_TRIED, REACHES = 3, 6, (2.0, 1.5, 1.01, 0.5, 0.3, 0.2, 0.1)
"""Tries to move a joint, in rounds of such reach (lengths of links): above one only while links cross, then for even lengths."""
EVEN = 0.12
"""Spread of the lengths without a crossing from which on no other start is tried."""
RUN_OVER = 0.2
"""Distance of a link from a joint of others below which it runs over it."""
MARKERS, OTHER = {"R": "o", "P": "s"}, "D"
"""Shapes of turning and sliding joints; of other types, with their symbol inside."""
MARKER_SIZE = {"o": 14, "s": 20, "D": 60}


@door
def draw_chains(chains: Iterable[Chain], *, columns: int = 6, titles: Iterable[str] | None = None) -> Any:
    """Draw chains on one page, numbered in their order; returns the figure.

    Binary links are lines, others polygons, each number of joints in a colour of its own. Turning joints are circles, multiple ones filled,
    sliding ones squares, others diamonds with the symbol of their type.
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


def _draw(chain: Chain, ax: Axes) -> None:
    from matplotlib.patches import Polygon

    joints_of = [[k for k, joint in enumerate(chain.joints) if link in joint] for link in range(chain.links)]
    at = _joint_places(len(chain.joints), joints_of)
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
    shape = np.array([MARKERS.get(kind, OTHER) for kind in chain.types])
    for marker in sorted({OTHER, *MARKERS.values()}):
        mine = shape == marker
        size, face = np.where(many, 26, MARKER_SIZE[marker])[mine], np.where(many, INK, "white")[mine].tolist()
        ax.scatter(*at[mine].T, s=size, marker=marker, facecolor=face, edgecolor=INK, lw=0.9, zorder=3)
    for kind, place in zip(chain.types, at, strict=True):
        if kind not in MARKERS:
            ax.annotate(kind, place, ha="center", va="center", fontsize=5, color=INK, zorder=4)
    bare(ax)
    ax.set_aspect("equal")
    ax.margins(0.12)


def _joint_places(count: int, joints_of: list[list[int]]) -> Array:
    """Places ``(joints, 2)``, those of a link near each other; moved one by one as long as links cross each other less."""
    from mechgraph.show.layout import places

    edges = [(a, b, link) for link, joints in enumerate(joints_of) for a, b in combinations(joints, 2)]
    found = places(map(str, range(count)), [(str(a), str(b)) for a, b, _ in edges])
    at = np.array([found[str(k)] for k in range(count)])
    first = np.array([(a, b) for a, b, _ in edges])
    apart = [(i, j) for i, j in combinations(range(len(edges)), 2) if not set(edges[i][:2]) & set(edges[j][:2])]
    other = np.array([(i, j) for i, j in apart if edges[i][2] != edges[j][2]], dtype=np.intp).reshape(-1, 2)
    beside = np.array([(e, k) for e, (a, b, _) in enumerate(edges) for k in range(count) if k not in (a, b)])
    starts = [at, *(radius * np.array([np.cos(turns), np.sin(turns)]).T for radius, turns in _rings(joints_of, count))]
    best = _untangled(starts[0], first, other, beside)
    for start in starts[1:] if best[1] > EVEN else ():
        best = min(best, _untangled(start, first, other, beside), key=lambda found: found[1])
    return best[0]


def _rings(joints_of: list[list[int]], count: int) -> Iterator[tuple[float, Array]]:
    """Radius and angles of the joints one after the other along the links: joints that are neighbours stand side by side."""
    import networkx as nx

    graph: nx.Graph[int] = nx.Graph((a, b) for joints in joints_of for a, b in combinations(joints, 2))
    for begin in range(0, count, max(1, count // 2)):
        turns = np.empty(count)
        turns[list(nx.dfs_preorder_nodes(graph, begin))] = 2 * np.pi * np.arange(count) / count
        yield count / (2 * np.pi), turns


def _untangled(at: Array, edges: Index, apart: Index, beside: Index) -> tuple[Array, float]:
    """Places after moves of one joint at a time that cost less, to places nearby and to places between its neighbours; the cost."""
    rng = np.random.default_rng(PLACES_SEED)
    near = [np.unique(edges[(edges == k).any(axis=1)]) for k in range(len(at))]
    cost = _cost(at, edges, apart, beside)
    for reach in REACHES:
        for k in range(len(at)):
            if cost < 1.0 < reach:
                break  # nothing crosses: only short moves, for even lengths
            for i, step in enumerate(reach * rng.normal(size=(MOVES_TRIED, 2))):
                trial = at.copy()
                trial[k] = (at[k] if i % 2 else at[near[k][near[k] != k]].mean(axis=0)) + step
                new = _cost(trial, edges, apart, beside)
                if new < cost:
                    at, cost = trial, new
    return at, cost


def _cost(at: Array, edges: Index, apart: Index, beside: Index) -> float:
    """How many links cross each other or run over joints of others, and by part of one how far lengths of links are from one."""
    p, q = at[edges[:, 0]], at[edges[:, 1]]

    def side(a: Array, b: Array, c: Array) -> Array:
        return np.sign((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))

    a, b, c, d = p[apart[:, 0]], q[apart[:, 0]], p[apart[:, 1]], q[apart[:, 1]]
    crossings = int(((side(a, b, c) != side(a, b, d)) & (side(c, d, a) != side(c, d, b))).sum())
    along, point = (q - p)[beside[:, 0]], at[beside[:, 1]]
    start = p[beside[:, 0]]
    u = np.clip(((point - start) * along).sum(axis=1) / np.maximum((along * along).sum(axis=1), 1e-9), 0.0, 1.0)
    over = int((np.linalg.norm(start + u[:, None] * along - point, axis=1) < RUN_OVER).sum())
    length = np.log(np.maximum(np.linalg.norm(q - p, axis=1), 1e-3))
    spread = float((length * length).mean())
    return crossings + over + spread / (1.0 + spread)
