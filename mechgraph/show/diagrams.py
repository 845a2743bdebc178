"""Diagrams: graphs, structures, patterns of equations, chains, studies, branches and assemblies."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, combinations, cycle, pairwise
from textwrap import wrap
from typing import Any, Literal

import numpy as np

from mechgraph.determinacy.decomposition import Decomposition
from mechgraph.equations.formulation import Formulation
from mechgraph.errors import DeclarationError
from mechgraph.graph.chains import Chain
from mechgraph.graph.linkgraph import link_graph
from mechgraph.maths.se3 import Array, Index
from mechgraph.model.mechanism import Mechanism
from mechgraph.modes.branches import Branch, Branches
from mechgraph.quantities import Count, door, unit_of, wrong
from mechgraph.show.canvas import (
    FAINT,
    HATCH,
    INK,
    MUTED,
    PALETTE,
    Axes,
    FlatPainter,
    axis_label,
    clashes,
    colours,
    inside,
    new_axes,
    places,
    plain,
    said,
)
from mechgraph.show.curves import Abscissa, lay_out
from mechgraph.show.skeleton import draw_skeleton
from mechgraph.variants.study import Study

LETTER, CLEARED = (0.045, 0.11), 1.3
"""Width and height of a letter of the text on a line, over the length of a line; clearance over its size that is enough."""
LEGEND_LETTERS = 34
"""Letters of a line of the legend."""


@door
def draw_graph(m: Mechanism, *, ax: Axes = None) -> Any:
    """Draw the link-pair graph: links as dots, pairs as lines in the colors of their loops.

    A pair in several loops has one strand per loop; a pair in none is gray. The frame is a square. Dotted lines are couplings.

    Parameters
    ----------
    m : Mechanism
        The mechanism; needs no geometry.
    ax : Axes, optional
        Axes of matplotlib. Default: new ones.

    Returns
    -------
    Axes

    Raises
    ------
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> ax = show.draw_graph(mg.load("windows-2"))
    """
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
            # distance of the strands of an edge in several loops, over that of neighbors
            shift = 0.035 * (place - 0.5 * (max(len(within), 1) - 1))
            colour = PALETTE[i % len(PALETTE)] if i >= 0 else FAINT
            canvas.line(curve + shift * across, colour, f"pair {pair}")
        canvas.keep_free(curve)
        canvas.on_line(texts[pair], on[pair])
    for c in m.couplings:
        canvas.coupling(c.name, [on[m.pairs[m.freedom(q)[0]].name] for q in c.freedoms])
    for name, (x, y) in at.items():
        frame = name == m.frame
        mark, face = ("s", MUTED) if frame else ("o", "white")
        canvas.ax.scatter(x, y, marker=mark, s=150, facecolor=face, edgecolor=INK, linewidth=1.4, zorder=4)
        canvas.name(name, at[name], INK, weight="bold")
    canvas.finish(
        [(f"loop {i}: {', '.join(loop)}", PALETTE[(i - 1) % len(PALETTE)]) for i, loop in enumerate(loops, 1)]
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
        # distance of edges between the same two links, over that of neighbors
        yield pair.name, (1 - u) * p + u * q + 4 * u * (1 - u) * 0.22 * side * across


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
    """Draw the structural diagram: links as lines and polygons, pairs as crossed circles; not to scale.

    Parameters
    ----------
    m : Mechanism
        The mechanism.
    groups : Decomposition, optional
        Of ``mg.groups``: links are numbered and colored by group, with a legend.
    ax : Axes, optional
        Axes of matplotlib. Default: new ones.

    Returns
    -------
    Axes

    Raises
    ------
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> m = mg.load("windows-2")
    >>> ax = show.draw_structure(m, groups=mg.groups(m))
    """
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
    canvas.finish(legend)
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
        corners = _round(corners)
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


def _round(corners: Array) -> Array:
    """Points ``(n, 2)`` in the order in which they stand about their middle."""
    return np.asarray(corners[np.argsort(np.arctan2(*(corners - corners.mean(axis=0)).T[::-1]), kind="stable")])


class _Canvas:
    """Axes without scales, on which names are arranged beside points of a plane."""

    def __init__(self, ax: Any, points: Array) -> None:
        more = float(np.clip(len(points) - 8, 0, 30))  # inches
        self.ax = new_axes((6.4 + 0.25 * more, 5.2 + 0.2 * more)) if ax is None else ax
        self.points = points
        self.middle = points.mean(axis=0)
        self.ax.set_axis_off()
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
        from mechgraph.show.arrangement import Arrangement  # not above: matplotlib is an extra

        painter = FlatPainter(self.ax, np.eye(3))
        taken = np.concatenate(self._taken)
        free = np.column_stack([taken, np.zeros(len(taken))])
        arranged = Arrangement(
            self.ax, painter.pixels, lambda: painter.pixels(free), lambda: painter.camera, lambda: inside(self.ax), painter.fill
        )  # fmt: skip
        for text, at, colour, style in self._names:
            arranged.name(text, at, colour, 0.07, **style)
        arranged.legend(
            [(line, colour) for text, colour in legend for line in wrap(text, LEGEND_LETTERS, subsequent_indent="    ")]
        )
        painter.fit(free, arranged.room)


@door
def draw_sparsity(f: Formulation, *, ax: Axes = None) -> Any:
    """Draw which unknown appears in which equation; equations of one owner share a color.

    Up to 64 equations each is named, beyond that their owners are. Lines separate links, pairs and couplings.

    Parameters
    ----------
    f : Formulation
        The equations.
    ax : Axes, optional
        Axes of matplotlib. Default: new ones.

    Returns
    -------
    Axes

    Raises
    ------
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> ax = show.draw_sparsity(mg.formulate(mg.load("rcsr")))
    """
    rows, columns, _, _ = f.pattern
    owners = list(dict.fromkeys(e.owner for e in f.equations))
    n, k = len(f.equations), len(f.unknowns)
    labelled = 64  # equations and unknowns up to which each is named beside the pattern; beyond, their owners are
    size = (max(4.5, 2.4 + 0.145 * min(k, labelled)), max(4.0, 1.6 + 0.145 * min(n, labelled)))
    ax = new_axes(size) if ax is None else ax
    from matplotlib.colors import ListedColormap

    image = np.full((n, k), np.nan)
    image[rows, columns] = [owners.index(f.equations[i].owner) % len(PALETTE) for i in rows]
    colour = {"cmap": ListedColormap(list(PALETTE)), "vmin": -0.5, "vmax": len(PALETTE) - 0.5}
    ax.imshow(image, aspect="auto", interpolation="none", **colour)
    for axis, items, put in ((ax.yaxis, f.equations, ax.axhline), (ax.xaxis, f.unknowns, ax.axvline)):
        groups = [item.owner for item in items]
        starts = [i for i in range(len(groups)) if i == 0 or groups[i] != groups[i - 1]]
        for i in starts[1:]:
            put(i - 0.5, color=FAINT, lw=0.8, zorder=0.5)
        if len(items) <= labelled:
            axis.set_ticks(range(len(items)), [said(item.name) for item in items])
        else:
            ends = [*starts[1:], len(items)]
            every = -(-len(starts) // labelled)
            middles = [0.5 * (a + b - 1) for a, b in zip(starts, ends, strict=True)]
            axis.set_ticks(middles[::every], [said(groups[a]) for a in starts[::every]])
    ax.xaxis.tick_top()
    ax.tick_params(axis="x", rotation=90, labelsize=7, length=0)
    ax.tick_params(axis="y", labelsize=7, length=0)
    ax.xaxis.set_label_position("top")
    ax.set_xlabel(f"{k} unknowns", color=INK)
    ax.set_ylabel(f"{n} equations", color=INK)
    return ax


MARKERS, OTHER = {"R": "o", "P": "s"}, "D"
"""Shapes of turning and sliding joints; of other types, with their symbol inside."""
MARKER_SIZE = {"o": 14, "s": 20, "D": 60}


@door
def draw_chains(chains: Iterable[Chain], *, columns: int = 6, titles: Iterable[str] | None = None) -> Any:
    """Draw chains on one page, numbered in order.

    Binary links are lines, others polygons with a color per number of joints. Revolute joints are circles (multiple ones filled),
    prismatic ones squares, others diamonds with their symbol.

    Parameters
    ----------
    chains : iterable of Chain
        E.g. ``mg.atlas(8)``.
    columns : int
        Chains per row.
    titles : iterable of str, optional
        Titles in place of the numbers.

    Returns
    -------
    Figure
        Of matplotlib.

    Raises
    ------
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> len(show.draw_chains(mg.atlas(6)).axes) >= 2
    True
    """
    some = list(chains)
    most_on_a_page = 240  # chains on one page
    if not 0 < len(some) <= most_on_a_page or columns < 1:
        expected = f"expected 1 to {most_on_a_page} chains and columns from 1"
        raise DeclarationError("draw_chains", [f"{len(some)} chains in {columns} columns: {expected}"])
    names = list(titles) if titles is not None else [str(i) for i in range(1, len(some) + 1)]
    rows = -(-len(some) // columns)
    cell = 1.5  # width and height of a chain (inches)
    figure = new_axes((cell * min(columns, len(some)), cell * rows)).figure
    figure.clear()
    for i, shown in enumerate(some):
        ax = figure.add_subplot(rows, min(columns, len(some)), i + 1)
        _draw(shown, ax)
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
            ax.add_patch(Polygon(_round(corners), facecolor=colour, edgecolor=colour, alpha=0.35, lw=1.5, zorder=1))
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
    ax.set_axis_off()
    ax.set_aspect("equal")
    ax.margins(0.12)


def _joint_places(count: int, joints_of: list[list[int]]) -> Array:
    """Places ``(joints, 2)``, those of a link near each other; moved one by one as long as links cross each other less."""
    edges = [(a, b, link) for link, joints in enumerate(joints_of) for a, b in combinations(joints, 2)]
    found = places(map(str, range(count)), [(str(a), str(b)) for a, b, _ in edges])
    at = np.array([found[str(k)] for k in range(count)])
    first = np.array([(a, b) for a, b, _ in edges])
    apart = [(i, j) for i, j in combinations(range(len(edges)), 2) if not set(edges[i][:2]) & set(edges[j][:2])]
    other = np.array([(i, j) for i, j in apart if edges[i][2] != edges[j][2]], dtype=np.intp).reshape(-1, 2)
    beside = np.array([(e, k) for e, (a, b, _) in enumerate(edges) for k in range(count) if k not in (a, b)])
    starts = [at, *(radius * np.array([np.cos(turns), np.sin(turns)]).T for radius, turns in _rings(joints_of, count))]
    best = _untangled(starts[0], first, other, beside)
    # spread of the lengths without a crossing from which on no other start is tried
    for start in starts[1:] if best[1] > 0.12 else ():
        best = min(best, _untangled(start, first, other, beside), key=lambda found: found[1])
    return best[0]


def _rings(joints_of: list[list[int]], count: int) -> Iterator[tuple[float, Array]]:
    """Radius and angles of the joints one after the other along the links: joints that are neighbors stand side by side."""
    import networkx as nx

    graph: nx.Graph[int] = nx.Graph((a, b) for joints in joints_of for a, b in combinations(joints, 2))
    for begin in range(0, count, max(1, count // 2)):
        turns = np.empty(count)
        turns[list(nx.dfs_preorder_nodes(graph, begin))] = 2 * np.pi * np.arange(count) / count
        yield count / (2 * np.pi), turns


def _untangled(at: Array, edges: Index, apart: Index, beside: Index) -> tuple[Array, float]:
    """Places after moves of one joint at a time that cost less, to places nearby and to places between its neighbors; the cost."""
    rng = np.random.default_rng(3)
    near = [np.unique(edges[(edges == k).any(axis=1)]) for k in range(len(at))]
    cost = _cost(at, edges, apart, beside)
    # rounds of tries to move a joint so far (lengths of links): above one only while links cross, then for even lengths
    for reach in (2.0, 1.5, 1.01, 0.5, 0.3, 0.2, 0.1):
        for k in range(len(at)):
            if cost < 1.0 < reach:
                break  # nothing crosses: only short moves, for even lengths
            for i, step in enumerate(reach * rng.normal(size=(6, 2))):
                trial = at.copy()
                trial[k] = (at[k] if i % 2 else at[near[k][near[k] != k]].mean(axis=0)) + step
                new = _cost(trial, edges, apart, beside)
                if new < cost:
                    at, cost = trial, new
    return at, cost


def _cost(at: Array, edges: Index, apart: Index, beside: Index) -> float:
    """How many links cross each other or run over joints of others, and by part of one how far lengths of links are from one."""
    length = np.log(np.maximum(np.linalg.norm(at[edges[:, 1]] - at[edges[:, 0]], axis=1), 1e-3))
    spread = float((length * length).mean())
    # distance of a link from a joint of others below which it runs over it
    return clashes(at, edges, apart, beside, 0.2) + spread / (1.0 + spread)


BinsName = Literal["auto", "fd", "doane", "scott", "stone", "rice", "sturges", "sqrt"]
"""Rules of ``numpy.histogram_bin_edges``."""


@door
def study_histogram(
    study: Study,
    output: str,
    *,
    position: int | None = None,
    part: int | None = None,
    bins: Count | BinsName = "auto",
    ax: Axes = None,
) -> Any:
    """Draw the distribution of an output over the variants, with the mechanism itself, the mean and the quantiles.

    Parameters
    ----------
    study : Study
        Results of ``mg.study``.
    output : str
        Name of an output.
    position : int, optional
        Position of an output over positions. Default: the value of largest magnitude of every variant.
    part : int, optional
        Entry of an output with several.
    bins : int or str
        As in ``numpy.histogram_bin_edges``.
    ax : Axes, optional
        Axes of matplotlib. Default: new ones.

    Returns
    -------
    Axes

    Raises
    ------
    DeclarationError
        No such output, position or part, or no variant was solved.
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> masses = {"crank.mass": [0.03, 0.04, 0.05]}
    >>> study = mg.study(mg.load("four-bar"), masses, "A.effort", sampling="grid", motions={"A": 0.5})
    >>> ax = show.study_histogram(study, "A.effort", bins=3)
    """
    picked = _Picked(study, output, part)
    values, itself, label = picked.one(position)
    values = values[np.isfinite(values)]
    if not values.size:
        raise DeclarationError(f"histogram of {output!r}", ["no variant was solved; study.messages says why"])
    ax = new_axes() if ax is None else ax
    ax.hist(values, bins=bins, color=PALETTE[0], alpha=0.8, edgecolor="white", lw=0.4)
    low, high = np.quantile(values, (0.00135, 0.99865))
    marks: list[tuple[str, float, Any, str]] = [
        ("mechanism itself", itself, "-", INK),
        ("mean", float(values.mean()), (0, (5, 2)), PALETTE[1]),
    ]
    marks += [("0.135 and 99.865 %", q, (0, (1, 1.5)), PALETTE[2]) for q in (float(low), float(high))]
    for i, (name, x, style, colour) in enumerate(marks):
        if np.isfinite(x):
            text = f"{name}: {x:.4g}" if i < 2 else f"{'_' * (i > 2)}{name}"
            ax.axvline(x, color=colour, lw=1.8, ls=style, label=text)
    ax.set_xlabel(label, color=INK)
    n = len(study.failed)
    ax.set_ylabel(f"number of variants (of {n}, {n - values.size} not solved)", color=INK)
    plain(ax)
    ax.legend(frameon=False)
    return ax


@door
def study_bands(study: Study, output: str, *, over: str | None = None, part: int | None = None, ax: Axes = None) -> Any:
    """Draw the quantiles of an output over the positions, as bands about the median, with the mechanism itself.

    Parameters
    ----------
    study : Study
        Results of ``mg.study``.
    output : str
        Name of an output over positions.
    over : str, optional
        A driver. Default: the first that moves, else the number of the position.
    part : int, optional
        Entry of an output with several.
    ax : Axes, optional
        Axes of matplotlib. Default: new ones.

    Returns
    -------
    Axes

    Raises
    ------
    DeclarationError
        No such output, part or driver, or one value per variant.
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> masses = {"crank.mass": [0.03, 0.04, 0.05]}
    >>> study = mg.study(mg.load("four-bar"), masses, "A.effort", sampling="grid", motions={"A": [0.0, 0.5]})
    >>> ax = show.study_bands(study, "A.effort")
    """
    picked = _Picked(study, output, part)
    if not picked.placed:
        raise DeclarationError(f"bands of {output!r}", ["it has one value a variant: use study_histogram"])
    x = _driver(study, over, picked.values.shape[1])
    ax = new_axes() if ax is None else ax
    some = np.isfinite(picked.values).any(axis=0)
    filled = np.where(some, picked.values, 0.0)
    # quantiles between which bands are drawn: three standard deviations of a normal distribution to each side, nine tenths, half
    for (low, high), alpha in zip(((0.00135, 0.99865), (0.05, 0.95), (0.25, 0.75)), (0.16, 0.26, 0.4), strict=True):
        ends = np.where(some, np.nanquantile(filled, (low, high), axis=0), np.nan)
        label = f"{100 * low:g} to {100 * high:g} %"
        ax.fill_between(x.values[0], *ends, color=PALETTE[0], alpha=alpha, lw=0, label=label)
    ax.plot(x.values[0], np.where(some, np.nanmedian(filled, axis=0), np.nan), color=PALETTE[0], lw=1.8, label="median")
    ax.plot(x.values[0], picked.itself, color=INK, lw=1.4, ls=(0, (5, 2)), label="mechanism itself")
    lay_out(ax, x, picked.label)
    ax.legend(frameon=False)
    return ax


@door
def study_tornado(
    study: Study, output: str, *, position: int | None = None, part: int | None = None, ax: Axes = None
) -> Any:
    """Draw how much each parameter alone changes an output, to first order, at its ends, the largest on top.

    A distribution without ends has them at three standard deviations.

    Parameters
    ----------
    study : Study
        Results of ``mg.study``.
    output : str
        Name of an output.
    position : int, optional
        Position of an output over positions. Default: that of the largest magnitude of the mechanism itself.
    part : int, optional
        Entry of an output with several.
    ax : Axes, optional
        Axes of matplotlib. Default: new ones.

    Returns
    -------
    Axes

    Raises
    ------
    DeclarationError
        No such output, position or part.
    MissingExtraError
        Without matplotlib.

    Examples
    --------
    >>> import mechgraph as mg
    >>> from mechgraph import show
    >>> masses = {"crank.mass": [0.03, 0.04, 0.05]}
    >>> study = mg.study(mg.load("four-bar"), masses, "A.effort", sampling="grid", motions={"A": 0.5})
    >>> ax = show.study_tornado(study, "A.effort")
    """
    picked = _Picked(study, output, part)
    itself = np.atleast_1d(picked.itself)
    if not np.isfinite(itself).any():
        raise DeclarationError(f"tornado of {output!r}", ["the mechanism itself has no value; study.messages says why"])
    at = picked.checked(position) if position is not None else int(np.nanargmax(np.abs(itself)))
    moves = {name: np.atleast_2d(picked.entry(move))[:, at] if picked.placed else picked.entry(move).reshape(2)
             for name, move in study.moves(output).items()}  # fmt: skip
    order = sorted(moves, key=lambda name: -float(np.abs(np.nan_to_num(moves[name])).max()))[:20]
    ax = new_axes((6.4, 1.5 + 0.36 * len(order))) if ax is None else ax
    for i, name in enumerate(order):
        for end, colour in zip(moves[name], (PALETTE[0], PALETTE[1]), strict=True):
            ax.barh(i, end, left=itself[at], height=0.6, color=colour, zorder=2)
    for colour, word in zip((PALETTE[0], PALETTE[1]), ("lower end", "upper end"), strict=True):
        ax.barh([0], [0], left=itself[at], color=colour, label=f"parameter at its {word}")
    ax.axvline(itself[at], color=INK, lw=1.4, zorder=3)
    ax.set_yticks(range(len(order)), map(said, order))
    ax.invert_yaxis()
    ax.set_xlabel(picked.label_at(at if picked.placed else None), color=INK)
    plain(ax)
    ax.tick_params(axis="y", length=0)
    ax.legend(frameon=False, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    return ax


class _Picked:
    """One number of an output for every variant, and for every position where it has them (``placed``)."""

    def __init__(self, study: Study, output: str, part: int | None) -> None:
        values, positions = study.outputs.get(output, np.zeros(0)), study.status.shape[1]
        self.output, self.placed = output, values.ndim > 1 and values.shape[1] == positions
        rest, fault = values.shape[1 + self.placed :], ""
        if output not in study.outputs:
            fault = f"{output!r} is not an output; outputs: {', '.join(study.outputs)}"
        elif len(rest) > 1:
            fault = f"{output!r} has entries of shape {rest}; keep a single row as an output"
        elif rest and not (isinstance(part, int) and 0 <= part < rest[0]):
            fault = wrong(part, "part", f"a number below {rest[0]}: {output!r} has {rest[0]} entries")
        if fault:
            raise DeclarationError("picture of a study", [fault])
        self._part = part if rest else None
        self.values, self.itself = self.entry(values), self.entry(study.nominal[output])
        unit = study.units[output]
        self.unit = unit[self._part or 0] if isinstance(unit, tuple) else unit
        self._name = output if self._part is None else f"{output}[{self._part}]"
        self.label = self.label_at(None)

    def label_at(self, position: int | None) -> str:
        """What is drawn, at a position, with its unit."""
        return axis_label(self._name if position is None else f"{self._name} at position {position}", self.unit)

    def entry(self, values: Array) -> Array:
        """The chosen entry of the last axis."""
        return values if self._part is None else values[..., self._part]

    def checked(self, position: int) -> int:
        """The number of a position."""
        n = self.values.shape[1] if self.placed else 1
        if not isinstance(position, int) or not 0 <= position < n:
            raise DeclarationError(f"picture of {self.output!r}", [wrong(position, "position", f"a number below {n}")])
        return position

    def one(self, position: int | None) -> tuple[Array, float, str]:
        """One value a variant, that of the mechanism itself, and what it is."""
        if not self.placed:
            return self.values.reshape(-1), float(np.reshape(self.itself, -1)[0]), self.label
        if position is not None or self.values.shape[1] == 1:
            at = 0 if position is None else self.checked(position)
            return self.values[:, at], float(self.itself[at]), self.label_at(position)
        whole = np.vstack([self.values, self.itself[None]])
        some = np.asarray(np.isfinite(whole).any(axis=1))
        peaks = np.where(some, np.nanmax(np.abs(np.where(some[:, None], whole, 0.0)), axis=1), np.nan)
        return peaks[:-1], float(peaks[-1]), axis_label(f"greatest |{self._name}|", self.unit)


def _driver(study: Study, over: str | None, count: int) -> Abscissa:
    """Positions of a driver of the first variant."""
    m = study.mechanism
    rows = {name: np.asarray(motion.position, dtype=float) for name, motion in study.motions.items()}
    rows = {name: row.reshape(-1, row.shape[-1])[0] if row.ndim else row.reshape(1) for name, row in rows.items()}
    full = m.full_name(over) if over is not None and over in m.pair_index else over
    named = [name for name in rows if name == full]
    if over is not None and not named:
        raise DeclarationError("bands of a study", [f"{over!r} is no driver of the study; drivers: {', '.join(rows)}"])
    moving = named or [name for name, row in rows.items() if len(row) == count and np.ptp(row) > 0]
    if not moving:
        return Abscissa(np.arange(count, dtype=float)[None], "position")
    name = moving[0]
    if m.turns(name):
        return Abscissa(np.rad2deg(rows[name])[None], axis_label(name, "deg"), True)
    return Abscissa(rows[name][None], axis_label(name, unit_of(m.units, (1, 0, 0))))


def draw_side_by_side(m: Mechanism, drawn: Sequence[tuple[Mechanism, str]], none: str) -> Any:
    """Skeletons of mechanisms like ``m``, numbered, and what is said of each; the figure.

    Raises
    ------
    DeclarationError
        where there are ``none``.
    """
    if not drawn:
        raise DeclarationError(f"picture of {m.name!r}", [none])
    # most drawn side by side
    shown = drawn[:16]
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


def draw_points(mechanisms: Sequence[Mechanism], names: Iterable[str], *, ax: Any = None) -> Any:
    """Places of the pairs to whose points the numbers ``names`` belong, of all mechanisms: those at the frame (center points) filled,
    the moving ones (circle points) as rings. The axes.

    Raises
    ------
    DeclarationError
        where there is no mechanism, or no such pair.
    """
    fields = {name.rpartition(".")[0] for name in names}
    pairs = [pair for m in mechanisms[:1] for pair in m.pairs if f"{pair.name}.point" in fields]
    if not pairs:
        raise DeclarationError("picture of points", ["there is no mechanism to draw, or no point is sought"])
    m = mechanisms[0]
    ax = new_axes((7.0, 5.5), projection=None if m.planar else "3d") if ax is None else ax
    for colour, pair in zip(cycle(PALETTE), pairs):
        places = np.array([one.pair(pair.name).point for one in mechanisms]).T[: 2 if m.planar else 3]
        fixed = m.frame in (pair.a, pair.b)
        name = f"{pair.name}: {'center' if fixed else 'circle'} points"
        ax.plot(*places, ls="", marker="o", ms=4, color=colour, mfc=colour if fixed else "none", label=said(name))
    plain(ax)
    ax.set_aspect("equal", adjustable="datalim")
    ax.legend(frameon=False)
    return ax


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
        label = said(f"branch {i}, circuit {branch.circuit}")
        ax.plot(*_curve(b, branch, column), color=colour, lw=2.5 if current == i else 1.5, label=label)
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
