"""Diagrams of what is connected with what: the link-pair graph, the structural diagram, the pattern of the equations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, combinations, pairwise
from textwrap import wrap
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import door
from mechgraph.equations.formulation import Formulation
from mechgraph.graph.linkgraph import link_graph
from mechgraph.model.mechanism import Mechanism
from mechgraph.show.canvas import FAINT, HATCH, INK, MUTED, PALETTE, Axes, bare, colours, new_axes, said
from mechgraph.show.painting import FlatPainter, inside
from mechgraph.structure.decomposition import Decomposition

STRAND = 0.035
"""Distance of the strands of an edge that lies in several loops, and"""
BULGE = 0.22
"""of edges between the same two links, over the distance of neighbours."""
LETTER, CLEARED = (0.045, 0.11), 1.3
"""Width and height of a letter of the text on a line, over the length of a line; clearance over its size that is enough."""
LEGEND_LETTERS = 34
"""Letters of a line of the legend."""
LABELLED = 64
"""Equations and unknowns up to which each is named beside the pattern; beyond, their owners are."""


@door
def draw_graph(m: Mechanism, *, ax: Axes = None) -> Any:
    """Draw the link-pair graph: links as dots, pairs as lines between them, coloured by the loops that they lie in. Returns the axes.

    A pair in several loops has a strand for each; one in no loop is grey. The frame is a square. Dotted lines are couplings.
    """
    from mechgraph.show.layout import places

    loops = [tuple(m.pairs[k].name for k, _ in loop) for loop in m.once(link_graph).loops]
    at = places(m.link_names(), ((p.a, p.b) for p in m.pairs))
    canvas = _Canvas(ax, np.array(list(at.values())))
    curves = dict(_edges(m, at))
    texts = {pair: f"{pair} ({m.pair(pair).type.symbol})" for pair in curves}
    on = on_lines(curves, texts, np.array(list(at.values())))
    for pair, curve in curves.items():
        within = [i for i, loop in enumerate(loops) if pair in loop]
        tangents = np.gradient(curve, axis=0)
        across = np.stack([-tangents[:, 1], tangents[:, 0]], axis=1) / np.linalg.norm(tangents, axis=1, keepdims=True)
        for place, i in enumerate(within or [-1]):
            shift = STRAND * (place - 0.5 * (max(len(within), 1) - 1))
            colour = PALETTE[i % len(PALETTE)] if i >= 0 else FAINT
            canvas.line(curve + shift * across, colour, f"pair {pair}")
        canvas.keep_free(curve)
        canvas.on_line(texts[pair], on[pair])
    for c in m.couplings:
        canvas.coupling(c.name, [on[m.pairs[m.freedom(q)[0]].name] for q in c.freedoms])
    for name, (x, y) in at.items():
        frame = name == m.frame
        canvas.ax.scatter(
            x,
            y,
            marker="s" if frame else "o",
            s=150,
            facecolor=MUTED if frame else "white",
            edgecolor=INK,
            linewidth=1.4,
            zorder=4,
        )
        canvas.name(name, at[name], INK, weight="bold")
    words = ((f"loop {i + 1}: {', '.join(loop)}", PALETTE[i % len(PALETTE)]) for i, loop in enumerate(loops))
    canvas.finish(
        [(line, colour) for text, colour in words for line in wrap(text, LEGEND_LETTERS, subsequent_indent="    ")]
    )
    return canvas.ax


def _edges(m: Mechanism, at: dict[str, Array]) -> Iterator[tuple[str, Array]]:
    """Curves ``(n, 2)`` of the pairs, bulging apart between the same two links."""
    between: dict[frozenset[str], list[str]] = {}
    for pair in m.pairs:
        between.setdefault(frozenset((pair.a, pair.b)), []).append(pair.name)
    u = np.linspace(0.0, 1.0, 41)[:, None]
    for pair in m.pairs:
        same = between[frozenset((pair.a, pair.b))]
        p, q = (at[name] for name in sorted((pair.a, pair.b)))
        side = same.index(pair.name) - 0.5 * (len(same) - 1)
        across = np.array([p[1] - q[1], q[0] - p[0]])
        yield pair.name, (1 - u) * p + u * q + 4 * u * (1 - u) * BULGE * side * across


def on_lines(curves: Mapping[str, Array], texts: Mapping[str, str], dots: Array) -> dict[str, Array]:
    """Where a text lies on its own line: near its middle, as clear of other lines, of the dots and of other texts as it can."""
    placed: dict[str, tuple[Array, Array]] = {}
    for name, curve in curves.items():
        half = np.array([0.5 * LETTER[0] * (len(texts[name]) + 1), 0.5 * LETTER[1]])
        others = np.concatenate([dots, *(other[::4] for key, other in curves.items() if key != name)])
        first, last = len(curve) // 4, len(curve) - len(curve) // 4
        clear = np.abs(curve[first:last, None] - others) / half
        room = clear.max(axis=2).min(axis=1)
        for at, size in placed.values():
            room = np.minimum(room, (np.abs(curve[first:last] - at) / (half + size)).max(axis=1))
        off = np.abs(np.linspace(-1.0, 1.0, last - first))
        placed[name] = curve[first + int(np.argmax(np.minimum(room, CLEARED) - 0.2 * off))], half
    return {name: at for name, (at, _) in placed.items()}


@door
def draw_structure(m: Mechanism, *, groups: Decomposition | None = None, ax: Axes = None) -> Any:
    """Draw the structural diagram: links as lines between two pairs and as polygons between more, pairs as crossed circles.

    Returns the axes. The frame is hatched, a dotted line ties the pairs of a coupling. Nothing is to scale: it is the graph alone. With
    ``groups`` (those of ``mg.groups``) the links are numbered and have a colour for each driver link and group, which the legend names.
    """
    from mechgraph.show.layout import places

    of_link = {name: [p.name for p in m.pairs if name in (p.a, p.b)] for name in m.link_names()}
    at = places((p.name for p in m.pairs), chain.from_iterable(combinations(names, 2) for names in of_link.values()))
    canvas = _Canvas(ax, np.array(list(at.values())))
    colour, legend = colours(m), list[tuple[str, str]]()
    if groups is not None:
        legend = [(f"{g.name}: {', '.join(g.links)}", PALETTE[i % len(PALETTE)]) for i, g in enumerate(groups.groups)]
        colour |= {link: legend[i][1] for i, g in enumerate(groups.groups) for link in g.links}
        colour |= dict.fromkeys(groups.free, FAINT)
    for link, names in of_link.items():
        corners = np.array([at[name] for name in names]).reshape(-1, 2)
        if not len(corners):
            continue
        middle = _draw_link(canvas, link, corners, colour[link], link == m.frame)
        told = link if groups is None or link.isdecimal() else f"{groups.numbers[link]} {link}"
        canvas.name(told, middle, colour[link] if link != m.frame else INK)
    for c in m.couplings:
        canvas.coupling(c.name, [at[m.pairs[m.freedom(q)[0]].name] for q in c.freedoms])
    for pair in m.pairs:
        x, y = at[pair.name]
        canvas.ax.scatter(x, y, s=130, facecolor="white", edgecolor=INK, linewidth=1.5, zorder=4)
        canvas.ax.scatter(x, y, s=60, marker="x", color=INK, linewidth=1.1, zorder=5)
        canvas.name(f"{pair.name} ({pair.type.symbol})", at[pair.name], INK, weight="bold")
    canvas.finish(
        [(line, tone) for text, tone in legend for line in wrap(text, LEGEND_LETTERS, subsequent_indent="    ")]
    )
    return canvas.ax


def _draw_link(canvas: _Canvas, link: str, corners: Array, colour: str, frame: bool) -> Array:
    """A link at its pairs; where its name belongs."""
    from matplotlib.patches import Polygon

    middle = corners.mean(axis=0)
    if len(corners) == 1:
        # a link with one pair ends free, away from all others
        out = corners[0] - canvas.middle
        end = corners[0] + 0.35 * out / (float(np.linalg.norm(out)) or 1.0)
        corners = np.stack([corners[0], end])
        middle = corners.mean(axis=0)
    if len(corners) > 2:
        order = np.argsort(np.arctan2(*(corners - middle).T[::-1]), kind="stable")
        corners = corners[order]
        canvas.ax.add_patch(
            Polygon(corners, facecolor="none" if frame else colour, edgecolor=MUTED if frame else "none", alpha=1.0 if frame else 0.18,
                    hatch=HATCH if frame else None, lw=0.0, zorder=1, gid=f"link {link}")
        )  # fmt: skip
        corners = np.concatenate([corners, corners[:1]])
    for p, q in pairwise(corners):
        canvas.line(np.stack([p, q]), MUTED if frame else colour, f"link {link}", lw=3.4)
        canvas.keep_free(p + np.linspace(0, 1, 25)[:, None] * (q - p))
        if frame:
            canvas.hatch(p, q)
    return np.asarray(middle)


class _Canvas:
    """Axes without scales, on which names are arranged beside points of a plane."""

    def __init__(self, ax: Any, points: Array) -> None:
        more = float(np.clip(len(points) - 8, 0, 30))  # inches
        self.ax = new_axes((6.4 + 0.25 * more, 5.2 + 0.2 * more)) if ax is None else ax
        self.points = points
        self.middle = points.mean(axis=0)
        bare(self.ax)
        self._names: list[tuple[str, Array, str, dict[str, Any]]] = []
        self._taken: list[Array] = [points]

    def line(self, points: Array, colour: str, gid: str, lw: float = 2.4) -> None:
        self.ax.plot(*points.T, color=colour, lw=lw, solid_capstyle="round", zorder=2, gid=gid)

    def coupling(self, name: str, points: Sequence[Array]) -> None:
        """A dotted line between the pairs that a coupling ties."""
        row = np.array(points)
        self.ax.plot(*row.T, color=INK, lw=1.4, ls=(0, (1, 2)), zorder=1.5, gid=f"coupling {name}")
        self.name(name, row[:2].mean(axis=0), INK, style="italic")

    def hatch(self, p: Array, q: Array) -> None:
        """Strokes beside a line: it is fixed."""
        along = (q - p) / (float(np.linalg.norm(q - p)) or 1.0)
        across = np.array([along[1], -along[0]])
        across *= -1.0 if (0.5 * (p + q) - self.middle) @ across < 0 else 1.0
        for u in np.linspace(0.12, 0.88, 9):
            begin = p + u * (q - p)
            self.line(np.stack([begin, begin + 0.07 * (across + along)]), MUTED, "frame", lw=1.0)

    def on_line(self, text: str, at: Array) -> None:
        """A text that lies on a line, which it interrupts."""
        ground = {"boxstyle": "square,pad=0.12", "facecolor": "white", "edgecolor": "none"}
        self.ax.text(*at, said(text), color=INK, fontsize=9.0, ha="center", va="center", zorder=3, bbox=ground)
        half = np.array([0.5 * LETTER[0] * (len(text) + 1), 0.5 * LETTER[1]])
        self._taken.append(at + half * np.array([(x, y) for x in np.linspace(-1, 1, 5) for y in (-1, 0, 1)]))

    def keep_free(self, points: Array) -> None:
        self._taken.append(points)

    def name(self, text: str, at: Array, colour: str, **style: Any) -> None:
        self._names.append((text, np.append(at, 0.0), colour, {"fontsize": 9.5, **style}))

    def finish(self, legend: Sequence[tuple[str, str]]) -> None:
        """Put everything in its place."""
        from mechgraph.show.arrangement import Arrangement

        painter = FlatPainter(self.ax, np.eye(3))
        taken = np.concatenate(self._taken)
        free = np.column_stack([taken, np.zeros(len(taken))])
        arranged = Arrangement(
            self.ax,
            painter.pixels,
            lambda: painter.pixels(free),
            lambda: painter.camera,
            lambda: inside(self.ax),
            painter.fill,
        )
        for text, at, colour, style in self._names:
            arranged.name(text, at, colour, 0.07, **style)
        arranged.legend(legend)
        painter.fit(free, arranged.room)


@door
def draw_sparsity(f: Formulation, *, ax: Axes = None) -> Any:
    """Draw which unknown appears in which equation, with their names; equations of one owner have one colour. Returns the axes.

    Up to 64 equations each is named, beyond that their owners are. Lines separate the equations of links, pairs and couplings.
    """
    rows, columns, _, _ = f.pattern
    owners = list(dict.fromkeys(e.owner for e in f.equations))
    n, k = len(f.equations), len(f.unknowns)
    size = (max(4.5, 2.4 + 0.145 * min(k, LABELLED)), max(4.0, 1.6 + 0.145 * min(n, LABELLED)))
    ax = new_axes(size) if ax is None else ax
    from matplotlib.colors import ListedColormap

    image = np.full((n, k), np.nan)
    image[rows, columns] = [owners.index(f.equations[i].owner) % len(PALETTE) for i in rows]
    ax.imshow(
        image,
        cmap=ListedColormap(list(PALETTE)),
        vmin=-0.5,
        vmax=len(PALETTE) - 0.5,
        aspect="auto",
        interpolation="none",
    )
    for axis, items, put in ((ax.yaxis, f.equations, ax.axhline), (ax.xaxis, f.unknowns, ax.axvline)):
        groups = [item.owner for item in items]
        starts = [i for i in range(len(groups)) if i == 0 or groups[i] != groups[i - 1]]
        for i in starts[1:]:
            put(i - 0.5, color=FAINT, lw=0.8, zorder=0.5)
        if len(items) <= LABELLED:
            axis.set_ticks(range(len(items)), [said(item.name) for item in items])
        else:
            ends = [*starts[1:], len(items)]
            every = -(-len(starts) // LABELLED)
            middles = [0.5 * (a + b - 1) for a, b in zip(starts, ends, strict=True)]
            axis.set_ticks(middles[::every], [said(groups[a]) for a in starts[::every]])
    ax.xaxis.tick_top()
    ax.tick_params(axis="x", rotation=90, labelsize=7, length=0)
    ax.tick_params(axis="y", labelsize=7, length=0)
    ax.xaxis.set_label_position("top")
    ax.set_xlabel(f"{k} unknowns", color=INK)
    ax.set_ylabel(f"{n} equations", color=INK)
    return ax
