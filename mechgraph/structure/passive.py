"""Passive freedoms: motions that move some links as one, leave their pair elements in place and move no other link.

Candidates follow from the graph. A set of links that turns or slides as one has a border of pairs all of which allow its twist.
Either the set is one link (or links that no motion moves against each other), or its border are two pairs that lie in the same loops:
cutting them parts the graph. So the twists common to the freedoms of a border are all there is to look at, and no null space of
the mechanism is needed. Where a passive motion of several links is a sum of smaller ones, the smaller ones are named.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
import scipy

from mechgraph.algebra.screw import null_space
from mechgraph.algebra.se3 import Array, compose, pose_exp
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.model import pair_kinematics as evaluation
from mechgraph.numerics.tolerances import MOTIONS
from mechgraph.topology.components import components_of_edges, cut_off, labels_of_bipartite, members
from mechgraph.topology.linkgraph import LinkGraph

STEP = 1e-4
"""Step of the central differences that tell whether a pair element leaves its place."""
LONGEST_SERIES = 40
"""Pairs of one series up to which any two are tried as a border; in longer ones neighbours only."""


@dataclass(frozen=True)
class PassiveMotion:
    """A passive freedom: unit rates ``(F,)``, the links that move as one, and their twist about the internal origin."""

    rates: Array
    links: tuple[int, ...]
    twist: Array


class _Search:
    """Data of the search: column spans, driven columns, group and place of every pair."""

    def __init__(self, here: Configuration, driven: Index) -> None:
        self.here, self.system = here, here.system
        first = self.system.first_column
        self.spans = [(int(i), int(j)) for i, j in pairwise(first)]
        self.driven = {int(c) for c in driven}
        self.place = {int(k): (n, i) for n, g in enumerate(self.system.groups) for i, k in enumerate(g.pairs)}
        self.columns = [[c for c in range(*span) if c not in self.driven] for span in self.spans]

    def common_twist(self, one: int, two: int) -> bool:
        """Whether two pairs have a twist in common."""
        S = self.here.S[:, self.columns[one] + self.columns[two], 0]
        if not self.columns[one] or not self.columns[two]:
            return False
        s = np.linalg.svd(S, compute_uv=False)
        return S.shape[1] > 6 or bool(s[-1] <= MOTIONS.common * s[0])


def passive_motions(here: Configuration, left: Array, driven: Index) -> list[PassiveMotion]:
    """Independent passive motions with the freedoms ``driven`` at rest; ``left (F, p)`` are all motions that leave free."""
    if not left.shape[1]:
        return []
    found: list[PassiveMotion] = []
    search = _Search(here, driven)
    for links, border in sorted(_borders(search, left), key=lambda item: (len(item[0]), item[0])):
        for motion in _of_border(search, links, border):
            if _independent(motion, found):
                found.append(motion)
    return sorted(found, key=lambda p: p.links)


def still_sets(system: System, rates: Array) -> list[list[int]]:
    """Links that no motion ``rates (F, p)`` moves against each other, joined through pairs that stand still in all of them."""
    moves = np.concatenate([np.abs(rates).max(axis=1, initial=0.0) >= MOTIONS.still, [False]])
    first = system.first_column
    moving = np.add.reduceat(moves, first[:-1]) * (np.diff(first) > 0) > 0
    ends = [e for e, moved in zip(system.graph.ends, moving.tolist(), strict=True) if not moved]
    return members(components_of_edges(system.graph.n_links, ends))


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


def _borders(search: _Search, left: Array) -> Iterator[tuple[tuple[int, ...], tuple[int, ...]]]:
    """(links, border pairs) of all sets that a passive motion could move."""
    graph = search.system.graph
    set_of: dict[int, int] = {}
    sets = still_sets(search.system, left)
    for number, links in enumerate(sets):
        set_of |= dict.fromkeys(links, number)
    border: list[list[int]] = [[] for _ in sets]
    for k, (a, b) in enumerate(graph.ends):
        if set_of[a] != set_of[b]:
            border[set_of[a]].append(k)
            border[set_of[b]].append(k)
    seen = set()
    for links, pairs in zip(sets, border, strict=True):
        if graph.frame not in links and len(pairs) > 1 and all(search.common_twist(pairs[0], k) for k in pairs[1:]):
            seen.add(tuple(links))
            yield tuple(links), tuple(pairs)
    for in_series in series(graph):
        few = len(in_series) <= LONGEST_SERIES
        for one, two in combinations(in_series, 2) if few else pairwise(in_series):
            if search.common_twist(one, two):
                cut = cut_off(graph.n_links, graph.ends, graph.frame, (one, two))
                if cut not in seen:
                    seen.add(cut)
                    yield cut, (one, two)


def _of_border(search: _Search, links: tuple[int, ...], border: tuple[int, ...]) -> list[PassiveMotion]:
    """Passive motions of one set of links: twists that every border pair allows and that leave all pair elements in place."""
    here, system = search.here, search.system
    columns = [search.columns[k] for k in border]
    sides = [1.0 if system.graph.ends[k][1] in links else -1.0 for k in border]
    if not links or any(not c for c in columns):
        return []
    every = [c for part in columns for c in part]
    first = sides[0] * here.S[:, columns[0], 0]
    rows, at = np.zeros((6 * (len(border) - 1), len(every))), len(columns[0])
    for i, (part, side) in enumerate(zip(columns[1:], sides[1:], strict=True)):
        rows[6 * i : 6 * i + 6, : len(columns[0])] = first
        rows[6 * i : 6 * i + 6, at : at + len(part)] = -side * here.S[:, part, 0]
        at += len(part)
    common = null_space(rows, MOTIONS.common)
    if not common.shape[1]:
        return []
    moves = np.zeros((system.n_freedoms, common.shape[1]))
    moves[every] = common
    twists = first @ common[: len(columns[0])]
    leaving = np.concatenate([_leaving(search, k, links, moves, twists) for k in border])
    out = []
    for mix in small_combinations(leaving, MOTIONS.in_place).T:
        rates, twist = moves @ mix, twists @ mix
        scale = np.abs(rates).max()
        scale *= np.sign(rates[np.argmax(np.abs(rates) > (1 - 1e-9) * scale)])
        out.append(PassiveMotion(rates / scale, links, twist / scale))
    return out


def small_combinations(rows: Array, tolerance: float) -> Array:
    """Orthonormal combinations of columns for which all rows vanish, against an absolute tolerance."""
    _, s, Vt = np.linalg.svd(rows, full_matrices=True)
    small = np.concatenate([s, np.zeros(Vt.shape[0] - len(s))]) < tolerance
    return np.asarray(Vt[small].T)


def _leaving(search: _Search, k: int, links: tuple[int, ...], moves: Array, twists: Array) -> Array:
    """Rate at which the reaction wrenches of pair ``k`` leave their span, one column a motion."""
    here, system = search.here, search.system
    number, i = search.place[k]
    g = system.groups[number]
    row, pitch = g.row, system.par.pitch[k : k + 1]
    base = here.frames[number][0][:, :, i, 0]
    carried = system.graph.ends[k][0] in links
    columns = []
    for move, twist in zip(moves.T, twists.T, strict=True):
        steps = np.array([STEP, -STEP, 0.0])
        bases = np.repeat(base[:, :, None], 3, axis=2)
        if carried:
            bases = compose(pose_exp(twist[:, None] * steps), bases)
        x = evaluation.advance(
            row,
            np.repeat(here.x[g.state_rows[:, i]][:, None, :1], 3, axis=2),
            (move[g.columns[:, i]][:, None, None] * steps),
        )
        W = evaluation.reactions_of(row, pitch, evaluation.frames_of(row, pitch, x, bases[:, :, None]))[:, :, 0]
        Q, _ = np.linalg.qr(W[:, :, 2])
        change = (W[:, :, 0] - W[:, :, 1]) / (2 * STEP)
        columns.append((change - Q @ (Q.T @ change)).ravel())
    return np.stack(columns, axis=1)


def _independent(motion: PassiveMotion, found: list[PassiveMotion]) -> bool:
    """Whether a motion is no combination of those found to which shared freedoms tie it."""
    rates = np.stack([*(p.rates for p in found), motion.rates])
    moving = scipy.sparse.csr_array(np.abs(rates) > MOTIONS.still)
    group = labels_of_bipartite(moving)
    near = rates[group == group[-1]]
    s = np.linalg.svd(near, compute_uv=False)
    return len(near) == 1 or bool(s[-1] > MOTIONS.tied * s[0])
