"""Passive freedoms: motions that move some links as one, leave their pair elements in place and move no other link.

Candidates follow from the graph. A set of links that turns or slides as one has a border of pairs all of which allow its twist.
Either the set is one link (or links that no motion moves against each other), or its border are two pairs that lie in the same loops:
cutting them parts the graph. So the twists common to the freedoms of a border are all there is to look at, and no null space of
the mechanism is needed. Where a passive motion of several links is a sum of smaller ones, the smaller ones are named.

Pairs that hold nothing close no loop: a set of links is passive between others, so its border has two pairs at least that hold something.
A freedom in which a load acts moves by that load and is none. What is passive at a position alone is told by another one near it, which
the mechanism reaches by moving (``lasting``).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, pairwise

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array, compose, null_space, pose_exp
from mechgraph.closure.indexing import Index
from mechgraph.closure.passive_motion import PassiveMotion
from mechgraph.graph.linkgraph import (
    LinkGraph,
    components_of_edges,
    cut_off,
    graph_of_ends,
    labels_of_bipartite,
    members,
)
from mechgraph.numerics.tolerances import MOTIONS
from mechgraph.pairs import kinematics as evaluation
from mechgraph.structure.position import Position

DIFFERENCE_STEP = 1e-4
"""Step of the central differences that tell whether a pair element leaves its place."""
LONGEST_SERIES = 40
"""Pairs of one series up to which any two are tried as a border; in longer ones neighbours only."""


@dataclass(frozen=True)
class _Search:
    """A position and the freedoms of every pair that are not ``driven``."""

    position: Position
    driven: frozenset[int]
    common: float = MOTIONS.common

    @cached_property
    def holding(self) -> tuple[bool, ...]:
        """Which pairs hold something, or are driven."""
        position = self.position
        driven = [not self.driven.isdisjoint(position.columns(k)) for k in range(len(position.graph.ends))]
        return tuple((position.holding | np.array(driven, dtype=bool)).tolist())

    def border(self, links: tuple[int, ...]) -> tuple[int, ...]:
        """The pairs between some links and others."""
        inside = set(links)
        return tuple(k for k, (a, b) in enumerate(self.position.graph.ends) if (a in inside) != (b in inside))

    @cached_property
    def joining(self) -> tuple[int, ...]:
        """The pairs that hold something, and of the others as many as join what nothing else joins; these close no loop."""
        graph = self.position.graph
        kept = [k for k, holds in enumerate(self.holding) if holds]
        label = components_of_edges(graph.n_links, [graph.ends[k] for k in kept])
        for k, (a, b) in enumerate(graph.ends):
            if label[a] != label[b]:
                label[label == label[a]] = label[b]
                kept.append(k)
        return tuple(kept)

    def series(self) -> list[list[int]]:
        """See ``series``, for the pairs that hold something."""
        graph, some = self.position.graph, self.joining
        if len(some) == len(graph.ends):
            return series(graph)
        joined = graph_of_ends(graph.n_links, [graph.ends[k] for k in some], graph.frame)
        return [[some[k] for k in pairs] for pairs in series(joined)]

    def cut_off(self, one: int, two: int) -> tuple[int, ...]:
        """The links that lose the frame when two pairs are cut."""
        graph = self.position.graph
        ends = [graph.ends[k] for k in self.joining if k not in (one, two)]
        return cut_off(graph.n_links, ends, graph.frame, ())

    def loaded(self) -> Index:
        """The columns of the freedoms in which loads act."""
        position, out = self.position, []
        for k, j in (position.m.freedom(load.in_freedom) for load in position.m.loads if load.in_freedom is not None):
            name, names = position.m.pairs[k].type.freedoms[j].name, [f.name for f in position.type_of(k).freedoms]
            out += [position.columns(k)[names.index(name)]] if name in names else []
        return np.array(out, dtype=np.intp)

    def columns(self, k: int) -> list[int]:
        """The columns of a pair that are not driven."""
        return [c for c in self.position.columns(k) if c not in self.driven]

    def common_twist(self, one: int, two: int) -> bool:
        """Whether two pairs have a twist in common."""
        mine, others = self.columns(one), self.columns(two)
        if not mine or not others:
            return False
        s = np.linalg.svd(self.position.rows.S[:, mine + others], compute_uv=False)
        return len(mine) + len(others) > 6 or bool(s[-1] <= self.common * s[0])


def passive_motions(
    position: Position, left: Array, driven: Index, common: float = MOTIONS.common
) -> list[PassiveMotion]:
    """Independent passive motions with the freedoms ``driven`` at rest; ``left (F, p)`` are all motions that leave free.

    Twists with a singular value up to ``common`` are common to the pairs of a border.
    """
    if not left.shape[1]:
        return []
    motions: list[PassiveMotion] = []
    search = _Search(position, frozenset(driven.tolist()), common)
    loaded = search.loaded()
    for links in sorted(_sets(search, left), key=lambda links: (len(links), links)):
        for motion in _of_border(search, links, search.border(links)):
            if not (np.abs(motion.rates[loaded]) > MOTIONS.still).any() and _independent(motion, motions):
                motions.append(motion)
    return sorted(motions, key=lambda p: p.links)


def lasting(
    here: Sequence[PassiveMotion], there: Sequence[PassiveMotion], position: Position, driven: Index
) -> list[PassiveMotion]:
    """The passive motions at a position that are so ``there`` as well, at one near it; ``here`` are all that are so at the position.

    Links that move as one there do so here. Where they have more such motions here, the nearest to those there last.
    """
    search = _Search(position, frozenset(driven.tolist()))
    of_links: dict[tuple[int, ...], list[Array]] = {}
    for motion in there:
        of_links.setdefault(motion.links, []).append(motion.rates)
    out: list[PassiveMotion] = []
    for links, rates in of_links.items():
        mine = [motion for motion in here if motion.links == links] or _of_border(search, links, search.border(links))
        Q = np.linalg.qr(np.stack(rates, axis=1))[0]
        near = [float(np.linalg.norm(Q.T @ motion.rates) / np.linalg.norm(motion.rates)) for motion in mine]
        out += [mine[i] for i in np.sort(np.argsort(near)[::-1][: len(rates)])]
    return sorted(out, key=lambda p: p.links)


def links_at_rest_together(position: Position, rates: Array) -> list[list[int]]:
    """Links that no motion ``rates (F, p)`` moves against each other, joined through pairs that stand still in all of them."""
    moves = np.concatenate([np.abs(rates).max(axis=1, initial=0.0) >= MOTIONS.still, [False]])
    first = position.rows.first_column
    moving = np.add.reduceat(moves, first[:-1]) * (np.diff(first) > 0) > 0
    ends = [e for e, moved in zip(position.graph.ends, moving.tolist(), strict=True) if not moved]
    return members(components_of_edges(position.graph.n_links, ends))


def series(graph: LinkGraph) -> list[list[int]]:
    """Pairs that lie in the same loops with the same relative signs: cutting any two of a list parts the graph."""
    member: list[list[tuple[int, int]]] = [[] for _ in graph.ends]
    for i, loop in enumerate(graph.loops):
        for k, sign in loop:
            member[k].append((i, sign))
    by_key: dict[tuple[tuple[int, int], ...], list[int]] = {}
    for k, loops in enumerate(member):
        if loops:
            key = tuple((i, sign * loops[0][1]) for i, sign in loops)
            by_key.setdefault(key, []).append(k)
    return [pairs for pairs in by_key.values() if len(pairs) > 1]


def _sets(search: _Search, left: Array) -> Iterator[tuple[int, ...]]:
    """All sets of links that a passive motion could move."""
    graph = search.position.graph
    seen = set()
    for links in map(tuple, links_at_rest_together(search.position, left)):
        holding = [k for k in search.border(links) if search.holding[k]] if graph.frame not in links else []
        if len(holding) > 1 and all(search.common_twist(holding[0], k) for k in holding[1:]):
            seen.add(links)
            yield links
    for in_series in search.series():
        few = len(in_series) <= LONGEST_SERIES
        for one, two in combinations(in_series, 2) if few else pairwise(in_series):
            if search.common_twist(one, two):
                cut = search.cut_off(one, two)
                if cut not in seen:
                    seen.add(cut)
                    yield cut


def _of_border(search: _Search, links: tuple[int, ...], border: tuple[int, ...]) -> list[PassiveMotion]:
    """Passive motions of one set of links: twists that every border pair allows and that leave all pair elements in place."""
    position, S = search.position, search.position.rows.S
    columns = [search.columns(k) for k in border]
    sides = [1.0 if position.graph.ends[k][1] in links else -1.0 for k in border]
    if not links or any(not c for c in columns):
        return []
    every = [c for part in columns for c in part]
    first = sides[0] * S[:, columns[0]]
    rows, at = np.zeros((6 * (len(border) - 1), len(every))), len(columns[0])
    for i, (part, side) in enumerate(zip(columns[1:], sides[1:], strict=True)):
        rows[6 * i : 6 * i + 6, : len(columns[0])] = first
        rows[6 * i : 6 * i + 6, at : at + len(part)] = -side * S[:, part]
        at += len(part)
    common = null_space(rows, search.common)
    if not common.shape[1]:
        return []
    moves = np.zeros((position.n_freedoms, common.shape[1]))
    moves[every] = common
    twists = first @ common[: len(columns[0])]
    leaving = [_leaving(position, k, links, moves, twists) for k in border if position.type_of(k).reactions]
    if position.rows.more is not None:  # couplings hold as well
        leaving.append(position.rows.more @ moves)
    out = []
    for mix in _turns_and_slides(twists, small_combinations(np.concatenate(leaving), MOTIONS.in_place)).T:
        rates, twist = moves @ mix, twists @ mix
        scale = np.abs(rates).max()
        scale *= np.sign(rates[np.argmax(np.abs(rates) > (1 - 1e-9) * scale)])
        out.append(PassiveMotion(rates / scale, links, twist / scale))
    return out


def _turns_and_slides(twists: Array, mixes: Array) -> Array:
    """The same combinations of twists as pure slides, and turns without any part along these; turns first."""
    _, s, Vt = np.linalg.svd((twists @ mixes)[:3], full_matrices=True)
    turns = Vt[: int((s > MOTIONS.in_place).sum())].T
    slides = Vt[turns.shape[1] :].T
    along = twists[3:] @ mixes @ slides
    return np.asarray(
        mixes @ np.concatenate([turns - slides @ np.linalg.pinv(along) @ twists[3:] @ mixes @ turns, slides], axis=1)
    )


def small_combinations(rows: Array, tolerance: float) -> Array:
    """Orthonormal combinations of columns for which all rows vanish, against an absolute tolerance."""
    _, s, Vt = np.linalg.svd(rows, full_matrices=True)
    small = np.concatenate([s, np.zeros(Vt.shape[0] - len(s))]) < tolerance
    return np.asarray(Vt[small].T)


def _leaving(position: Position, k: int, links: tuple[int, ...], moves: Array, twists: Array) -> Array:
    """Rate at which the reaction wrenches of pair ``k`` leave their span, one column a motion."""
    pair = position.pair(k)
    carried = position.graph.ends[k][0] in links
    steps = np.array([DIFFERENCE_STEP, -DIFFERENCE_STEP, 0.0])
    columns = []
    for move, twist in zip(moves[position.columns(k)].T, twists.T, strict=True):
        frame = np.repeat(pair.frame, 3, axis=2)
        if carried:
            frame = compose(pose_exp(twist[:, None] * steps), frame)
        x = evaluation.advance(pair.type, np.repeat(pair.x, 3, axis=1)[:, None], move[:, None, None] * steps)
        frames = evaluation.frames_of(pair.type, pair.pitch, x, frame[:, :, None])
        W = evaluation.reactions_of(pair.type, pair.pitch, frames)[:, :, 0]
        Q, _ = np.linalg.qr(W[:, :, 2])
        change = (W[:, :, 0] - W[:, :, 1]) / (2 * DIFFERENCE_STEP)
        columns.append((change - Q @ (Q.T @ change)).ravel())
    return np.stack(columns, axis=1)


def _independent(motion: PassiveMotion, before: list[PassiveMotion]) -> bool:
    """Whether a motion is no combination of those before to which shared freedoms tie it."""
    rates = np.stack([*(p.rates for p in before), motion.rates])
    moving = scipy.sparse.csr_array(np.abs(rates) > MOTIONS.still)
    group = labels_of_bipartite(moving)
    near = rates[group == group[-1]]
    s = np.linalg.svd(near, compute_uv=False)
    return len(near) == 1 or bool(s[-1] > MOTIONS.tied * s[0])
