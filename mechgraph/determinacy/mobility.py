"""Mobility in a position: freedoms, drivers, passive freedoms, generic counts, which drivers actuate.

The pairs of a mechanism at one position: as declared, or with other types at some pairs and without some couplings.
Rank, motions and passive freedoms follow from the closure rows and the place of every pair. So a change needs no new mechanism: its
twists take the place of those declared, at the same frame.

Passive freedoms: motions that move some links as one, leave their pair elements in place and move no other link.
Candidates follow from the graph. A set of links that turns or slides as one has a border of pairs all of which allow its twist.
Either the set is one link (or links that no motion moves against each other), or its border are two pairs that lie in the same loops:
cutting them parts the graph. So the twists common to the freedoms of a border are all there is to look at, and no null space of
the mechanism is needed. Where a passive motion of several links is a sum of smaller ones, the smaller ones are named.

Pairs that hold nothing close no loop: a set of links is passive between others, so its border has two pairs at least that hold something.
A freedom in which a load acts moves by that load and is none. What is passive at a position alone is told by another one near it, which
the mechanism reaches by moving (``lasting``).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field, replace
from functools import cached_property
from itertools import combinations, pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.determinacy.finite_motion import MOVED, states_nearby
from mechgraph.graph.linkgraph import (
    LinkGraph,
    components_of_edges,
    graph_of_ends,
    labels_of_bipartite,
    members,
)
from mechgraph.kinematics.rates import PassiveMotion
from mechgraph.kinematics.solver import ClosureRank, EngineName, rank_of_rows
from mechgraph.kinematics.state import ClosureRows, Configuration
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import complement, independent_rows, rank_of, singular_values
from mechgraph.maths.se3 import Array, Index, compose, null_space, pose_exp, rotation_exp
from mechgraph.maths.tolerances import MOTIONS, PATH, RANKS
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.pairs import pair_type as evaluation
from mechgraph.pairs.pair_type import PairType


@dataclass(frozen=True)
class PlacedPair:
    """One pair where it stands: ``pitch (1, 1)``, frame 0 ``(3, 4, 1)`` about the internal origin, state numbers ``(nx, 1)``."""

    type: PairType
    pitch: Array
    frame: Array
    x: Array

    @classmethod
    def at_zero(cls, type: PairType, frame: Array) -> PlacedPair:
        """A pair of a type without pitch with its coordinates zero in ``frame (3, 4)``."""
        x = evaluation.coordinates_to_state(type, np.zeros((type.f, 1)))
        return cls(type, np.zeros((1, 1)), frame[:, :, None], x)

    @cached_property
    def twists(self) -> Array:
        """Twists ``(6, f)`` of its freedoms."""
        x = self.x[:, None]
        frames = evaluation.frames_of(self.type, self.pitch, x, self.frame[:, :, None])
        return evaluation.twists_of(self.type, self.pitch, frames, x)[:, :, 0, 0]


@dataclass(frozen=True)
class Position:
    """Closure ``rows`` and pairs at the first position of a configuration; ``changed`` pairs stand in place of those declared."""

    declared: Configuration
    rows: ClosureRows
    changed: Mapping[int, PlacedPair] = field(default_factory=dict)

    @classmethod
    def at(cls, here: Configuration) -> Position:
        """The pairs as declared."""
        return cls(here, ClosureRows.at(here))

    @property
    def m(self) -> Mechanism:
        """The mechanism as declared."""
        return self.declared.system.m

    @property
    def graph(self) -> LinkGraph:
        """Links and pairs."""
        return self.rows.graph

    @property
    def n_freedoms(self) -> int:
        """Number of freedoms."""
        return self.rows.S.shape[1]

    def type_of(self, k: int) -> PairType:
        """The type of a pair."""
        return self.changed[k].type if k in self.changed else self.m.pairs[k].type

    def columns(self, k: int) -> range:
        """The columns of the freedoms of a pair."""
        return range(int(self.rows.first_column[k]), int(self.rows.first_column[k + 1]))

    def pair(self, k: int) -> PlacedPair:
        """A pair where it stands."""
        if k in self.changed:
            return self.changed[k]
        system, here = self.declared.system, self.declared
        number, i = system.place_of(k)
        group = system.groups[number]
        frame = here.frames[number][0][:, :, i, :1]
        return PlacedPair(group.row, system.par.pitch[k : k + 1], frame, here.x[group.state_rows[:, i], :1])

    @property
    def altered(self) -> bool:
        """Whether pairs or couplings are not those declared."""
        return bool(self.changed) or self.rows.count != self.declared.system.n_rows

    @cached_property
    def holding(self) -> NDArray[np.bool_]:
        """Which pairs ``(P,)`` hold something, by reactions or by a coupling."""
        held = np.zeros(self.n_freedoms, dtype=bool)
        if self.rows.more is not None:
            held[self.rows.more.indices] = True
        every = range(len(self.graph.ends))
        return np.array([bool(self.type_of(k).reactions) or held[self.columns(k)].any() for k in every], dtype=bool)

    @cached_property
    def drivable(self) -> NDArray[np.bool_]:
        """Which freedoms ``(F,)`` take a drive."""
        return np.array([d for k in range(len(self.m.pairs)) for d in self.type_of(k).drivable], dtype=bool)

    def with_changes(self, pairs: Mapping[int, PlacedPair], dropped: Index) -> tuple[Position, Index]:
        """Other ``pairs`` and without the couplings ``dropped``; also the new column of every freedom (-1 where it is gone).

        A freedom of a changed pair is the one of the same name in the new type.
        """
        old, width = self.rows.first_column, np.diff(self.rows.first_column)
        width[list(pairs)] = [pair.type.f for pair in pairs.values()]
        first = np.concatenate([[0], np.cumsum(width)]).astype(np.intp)
        column = np.arange(self.n_freedoms) + np.repeat(first[:-1] - old[:-1], np.diff(old))
        for k, pair in pairs.items():
            place = {f.name: int(first[k]) + j for j, f in enumerate(pair.type.freedoms)}
            column[self.columns(k)] = [place.get(f.name, -1) for f in self.type_of(k).freedoms]
        S = np.empty((6, int(first[-1])))
        stays = np.flatnonzero(column >= 0)
        S[:, column[stays]] = self.rows.S[:, stays]
        for k, pair in pairs.items():
            S[:, first[k] : first[k + 1]] = pair.twists
        more = self.rows.more
        if more is not None:
            kept = more[complement(dropped, self.rows.further)].tocoo()
            shape = (kept.shape[0], S.shape[1])
            more = scipy.sparse.csr_array((kept.data, (kept.row, column[kept.col])), shape=shape) if shape[0] else None
        rows = replace(self.rows, first_column=first, S=S, more=more)
        return Position(self.declared, rows, {**self.changed, **pairs}), column


@dataclass(frozen=True)
class _Search:
    """A position and the freedoms of every pair that are not ``driven``."""

    position: Position
    driven: frozenset[int]
    common: float

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
        label = components_of_edges(graph.n_links, [graph.ends[k] for k in self.joining if k not in (one, two)])
        return tuple(np.flatnonzero(label != label[graph.frame]).tolist())

    def loaded(self) -> Index:
        """The columns of the freedoms in which loads act, and that they read."""
        position, out = self.position, []
        for k, j in (position.m.freedom(name) for load in position.m.loads for name in load.freedoms):
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


def passive_motions(position: Position, left: Array, driven: Index, common: float | None = None) -> list[PassiveMotion]:
    """Independent passive motions with the freedoms ``driven`` at rest; ``left (F, p)`` are all motions that leave free.

    Twists with a singular value up to ``common`` (else ``MOTIONS.common``) are common to the pairs of a border.
    """
    if not left.shape[1]:
        return []
    motions: list[PassiveMotion] = []
    search = _Search(position, frozenset(driven.tolist()), MOTIONS.common if common is None else common)
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
    search = _Search(position, frozenset(driven.tolist()), MOTIONS.common)
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
        # pairs of one series up to which any two are tried as a border; in longer ones neighbors only
        few = len(in_series) <= 40
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
    difference_step = 1e-4  # step of the central differences that tell whether a pair element leaves its place
    steps = np.array([difference_step, -difference_step, 0.0])
    columns = []
    for move, twist in zip(moves[position.columns(k)].T, twists.T, strict=True):
        frame = np.repeat(pair.frame, 3, axis=2)
        if carried:
            frame = compose(pose_exp(twist[:, None] * steps), frame)
        x = evaluation.advance(pair.type, np.repeat(pair.x, 3, axis=1)[:, None], move[:, None, None] * steps)
        frames = evaluation.frames_of(pair.type, pair.pitch, x, frame[:, :, None])
        W = evaluation.reactions_of(pair.type, pair.pitch, frames)[:, :, 0]
        Q, _ = np.linalg.qr(W[:, :, 2])
        change = (W[:, :, 0] - W[:, :, 1]) / (2 * difference_step)
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


@dataclass(frozen=True)
class FreeMotion:
    """A motion that is neither driven nor passive: unit rates and the names of the freedoms that move."""

    rates: Array
    names: tuple[str, ...]


@dataclass(frozen=True)
class Freedoms:
    """What can move at a closed position.

    ``closure`` the rank of the closure equations with its margin, ``driven_closure`` the same with the drivers at rest;
    ``null (F, M)`` orthonormal motions;
    ``dependent`` whether drivers cannot move independently, ``drive`` how strongly the weakest of them moves (against the freedom that
    moves most; small near a dead point); ``left (F, n)`` orthonormal motions with the drivers at rest, ``passive`` motions among them;
    ``hold`` freedoms whose rest stops the passive motions. ``passing`` motions are passive in this position only: they are free.
    """

    closure: ClosureRank
    driven_closure: ClosureRank
    null: Array
    dependent: bool
    passive: tuple[PassiveMotion, ...]
    position: Position
    left: Array
    hold: Index
    drive: float = 1.0
    passing: tuple[PassiveMotion, ...] = ()

    @cached_property
    def undriven(self) -> tuple[FreeMotion, ...]:
        """Motions with the drivers at rest that are not passive."""
        return tuple(_complement(self.position.m, self.left, self.passive))

    @cached_property
    def inputs(self) -> Array:
        """Motions ``(F, M)`` without their passive part."""
        return _beside(self.null, self.passive)

    def still(self, columns: Index) -> NDArray[np.bool_]:
        """Which of the drivers ``columns`` stand still in all motions, as at a dead point."""
        return np.asarray(np.linalg.norm(self.null[columns], axis=1) < PATH.independent)

    def leading(self, columns: Index) -> Index:
        """Places of the drivers that lead among ``columns``: as many as can move independently, taken in their order."""
        if not self.dependent:
            return np.arange(len(columns))
        rank = rank_of(singular_values(self.null[columns]), PATH.independent)
        order = columns.tolist()
        chosen = independent_rows(self.null, order, rank)
        return np.array([order.index(c) for c in sorted(chosen, key=order.index)], dtype=np.intp)

    @property
    def redundancy(self) -> int:
        """Closure equations minus rank."""
        return self.closure.count - self.closure.rank

    @property
    def mobility(self) -> int:
        """Freedoms minus rank."""
        return self.null.shape[1]


def _left_free(closure: ClosureRank, at_rest: ClosureRank, columns: Index) -> Array:
    """Orthonormal motions with the freedoms ``columns`` at rest."""
    null = closure.motions
    if not len(columns) or not null.shape[1]:
        return null
    if closure.engine == "dense":
        return at_rest.motions
    # the motions are of size one: a driver whose part in all of them is below the threshold stands still
    return np.asarray(null @ small_combinations(null[columns], MOTIONS.dependent))


def _drive(null: Array, columns: Index) -> float:
    """Smallest singular value of the drivers' part in the motions, over the part of the freedom that moves most."""
    if not len(columns):
        return 1.0
    if len(columns) > null.shape[1]:
        return 0.0
    most = float(np.sqrt((null**2).sum(axis=1).max()))
    return float(singular_values(null[columns])[-1]) / most


def free_motion(system: System, x: Array, columns: Index, engine: EngineName = "auto") -> Freedoms:
    """Mobility at a closed state ``x (nx,)`` and what drivers in ``columns`` leave free."""
    return freedoms_at(Position.at(Configuration(system, x[:, None])), columns, engine)


def freedoms_at(position: Position, columns: Index, engine: EngineName = "auto") -> Freedoms:
    """The same at a position, which may have changed pairs."""
    closure = rank_of_rows(position.rows, None, engine)
    null = closure.motions
    drive = _drive(null, columns)
    at_rest = rank_of_rows(position.rows, columns, engine) if len(columns) else closure
    left = _left_free(closure, at_rest, columns)
    here = passive_motions(position, left, columns)
    passive = _lasting(here, position, closure, columns) if here else here
    passing = tuple(p for p in here if all(p is not other for other in passive))
    if not len(columns) and passive and len(passive) == null.shape[1]:
        # nothing else can move: what could be driven is an input, whatever pairs that hold nothing could drive
        inputs = position.drivable & np.repeat(position.holding, np.diff(position.rows.first_column))
        passive = [p for p in passive if not (np.abs(p.rates[inputs]) > MOTIONS.still).any()]
    hold = np.zeros(0, dtype=np.intp)
    if passive:
        _, pivots = scipy.linalg.qr(np.stack([p.rates for p in passive]), mode="r", pivoting=True)
        hold = np.sort(pivots[: len(passive)]).astype(np.intp)
    return Freedoms(
        closure, at_rest, null, drive < MOTIONS.dependent, tuple(passive), position, left, hold, drive, passing
    )


def _beside(motions: Array, passive: Sequence[PassiveMotion]) -> Array:
    """Motions without their passive part."""
    if not passive:
        return motions
    P, _ = np.linalg.qr(np.stack([p.rates for p in passive], axis=1))
    return np.asarray(motions - P @ (P.T @ motions))


def _lasting(
    here: list[PassiveMotion], position: Position, closure: ClosureRank, columns: Index
) -> list[PassiveMotion]:
    """Those of the passive motions that are passive at a position nearby as well, where the mechanism can move as declared.

    A position with the others moved, as on the way of a driver; else any other one.
    """
    if position.altered:
        return here
    reached, most = None, 0.0
    for x, change in states_nearby(position.declared.system, position.declared.x[:, 0], closure):
        moved = float(np.abs(_beside(change[:, None], here)).max() / np.abs(change).max())
        if reached is None or moved > most:
            reached, most = x, moved
        if moved > MOVED or closure.motions.shape[1] == len(here):
            break
    if reached is None:
        return here
    there = Position.at(Configuration(position.declared.system, reached[:, None]))
    near, exact = (rank_of_rows(there.rows, columns, closure.engine, limit) for limit in (RANKS.nearby, None))
    # a position that closing met as far as rounding lets it is known as well as the declared one
    common = MOTIONS.still if exact.rank == near.rank else RANKS.nearby
    return lasting(here, passive_motions(there, near.motions, columns, common), position, columns)


def _complement(m: Mechanism, left: Array, passive: Sequence[PassiveMotion]) -> list[FreeMotion]:
    """Motions of ``left`` that are not passive: in each one freedom moves while those of the other motions rest.

    These freedoms are the first independent ones in the order in which drivers are wanted, so a motion is what one more driver does.
    """
    if left.shape[1] == len(passive):
        return []
    rest = left
    if passive:
        rest = _beside(left, passive)
        U, s, _ = np.linalg.svd(rest, full_matrices=False)
        rest = U[:, : left.shape[1] - len(passive)]
    Q, _ = np.linalg.qr(rest)
    order = drive_order(m, passive)
    wanted = set(order)
    order += [c for c in range(len(Q)) if c not in wanted]
    chosen = independent_rows(Q, order, Q.shape[1])
    basis = np.linalg.solve(Q[chosen].T, Q.T)
    basis /= np.abs(basis).max(axis=1, keepdims=True)
    names = m.freedom_names()
    out = []
    for rates in np.where(np.abs(basis) < MOTIONS.rounding, 0.0, basis):
        moving = tuple(names[i] for i in np.flatnonzero(np.abs(rates) > MOTIONS.still))
        out.append(FreeMotion(rates, moving))
    return out


def single_freedoms(m: Mechanism) -> list[tuple[int, str]]:
    """Freedoms that take a drive, as (column, name)."""
    single = [d for p in m.pairs for d in p.type.drivable]
    return [(i, n) for i, (n, s) in enumerate(zip(m.freedom_names(), single, strict=True)) if s]


def drive_order(m: Mechanism, passive: Sequence[PassiveMotion]) -> list[int]:
    """Freedoms that take a drive in the order in which they are wanted: free of passive motions first, then at the frame."""
    in_passive = np.zeros(sum(p.type.f for p in m.pairs), dtype=bool)
    for p in passive:
        in_passive |= np.abs(p.rates) > MOTIONS.still
    at_frame = {n: m.frame in (p.a, p.b) for p in m.pairs for n in p.freedom_names}
    singles = single_freedoms(m)
    return [i for i, name in sorted(singles, key=lambda item: (in_passive[item[0]], not at_frame[item[1]], item[0]))]


GEOMETRY_SEED = 11


@dataclass(frozen=True)
class Generic:
    """Random geometry: ``rank``, ``mobility``, ``excess`` (structural: rows - rank), and where the excess sits.

    ``places`` are (excess, loop indices): sets of loops that share self-stresses whatever the dimensions.
    """

    rank: int
    mobility: int
    excess: int
    places: tuple[tuple[int, tuple[int, ...]], ...]


def random_twists(m: Mechanism, rng: np.random.Generator) -> tuple[Array, Array]:
    """Twists ``(6, F)`` of all pairs at random poses and coordinates, and the points ``(3, P)`` at which the pairs are."""
    by_type: dict[PairType, list[int]] = {}
    for k, pair in enumerate(m.pairs):
        by_type.setdefault(pair.type, []).append(k)
    first = np.concatenate([[0], np.cumsum([p.type.f for p in m.pairs])]).astype(np.intp)
    S, points = np.empty((6, int(first[-1]))), np.empty((3, len(m.pairs)))
    for row, pairs in by_type.items():
        n = len(pairs)
        base = np.empty((3, 4, n, 1))
        turn, place = rng.uniform(-2, 2, (3, n)), rng.normal(size=(3, n))
        base[:, :3, :, 0] = rotation_exp(turn)
        if row.normal is not None:  # about the normal of the plane, which that axis of the marker is
            turn[:2], place[2] = 0.0, 0.0
            base[:, :3, :, 0] = np.roll(rotation_exp(turn), row.normal - 2, axis=1)
        base[:, 3, :, 0] = points[:, pairs] = place
        x = evaluation.random_coordinates(row, rng, n, 1)
        pitch = rng.uniform(0.3, 0.9, (n, 1))
        twists = evaluation.twists_of(row, pitch, evaluation.frames_of(row, pitch, x, base))[..., 0]
        S[:, first[pairs] + np.arange(row.f)[:, None]] = twists
    return S, points


def random_rows(m: Mechanism, graph: LinkGraph) -> ClosureRows:
    """The closure equations with random geometry (fixed seed)."""
    twists, points = random_twists(m, np.random.default_rng(GEOMETRY_SEED))
    first = np.concatenate([[0], np.cumsum([p.type.f for p in m.pairs])]).astype(np.intp)
    more = coupling_rows(m, int(first[-1]))
    return ClosureRows(graph, first, twists, points, more)


def coupling_rows(m: Mechanism, width: int) -> scipy.sparse.csr_array | None:
    """A row with random coefficients in the freedoms of every coupling."""
    couplings = getattr(m, "couplings", ())
    if not couplings:
        return None
    out = np.zeros((len(couplings), width))
    place = {name: i for i, name in enumerate(m.freedom_names())}
    rng = np.random.default_rng(GEOMETRY_SEED)
    for row, coupling in zip(out, couplings, strict=True):
        row[[place[m.full_name(name)] for name, _ in coupling.terms]] = rng.uniform(0.5, 1.5, len(coupling.terms))
    return scipy.sparse.csr_array(out)


def generic(m: Mechanism, graph: LinkGraph, engine: EngineName = "auto") -> Generic:
    """Rank for random geometry, by the same engines as at a position; local pivots decide, as chains are ill-conditioned."""
    closure = rank_of_rows(random_rows(m, graph), None, engine, RANKS.generic, RANKS.generic)
    freedoms = closure.reduced.rows.S.shape[1]
    return Generic(closure.rank, freedoms - closure.rank, closure.count - closure.rank, closure.sets)


def stand_still(Z: Array, acting: Index) -> np.ndarray:
    """Positions ``(T,)`` at which freedoms ``acting`` can rest while the mechanism moves, so that efforts in them cannot hold it.

    ``Z (F, d, T)`` are the rates of all freedoms for unit rates of the ``d`` prescribed ones. By virtual work the efforts ``tau`` in
    ``acting`` that do what ``f`` would do in the prescribed freedoms satisfy ``Z_a^T tau = f``: singular where ``Z_a`` is.
    """
    size = np.abs(Z).max(axis=(0, 1), initial=1.0)
    weakest = np.linalg.svd(np.moveaxis(Z[acting], -1, 0), compute_uv=False)[:, -1]
    return np.asarray(weakest < MOTIONS.dependent * size)


def actuation_fault(m: Mechanism, Z: Array, acting: Index) -> str:
    """What is wrong with efforts in the freedoms ``acting``, and which would do, for ``Z (F, d)`` as above at one position."""
    names, d = m.freedom_names(), Z.shape[1]
    Q = np.linalg.qr(Z)[0]
    kept = independent_rows(Q, [int(c) for c in acting], d)
    B = np.linalg.qr(Q[kept].T)[0]
    rest = np.linalg.norm(Q - Q @ B @ B.T, axis=1)
    able = [name for c, name in single_freedoms(m) if rest[c] > MOTIONS.dependent]
    spare = [names[c] for c in acting if c not in kept]
    parts = []
    if len(acting) != d:
        motions = "independent motion is" if d == 1 else "independent motions are"
        parts.append(f"{len(acting)} freedom{'s are' if len(acting) != 1 else ' is'} named, {d} {motions} prescribed")
    if spare:
        why = f"depends on {', '.join(names[c] for c in kept)}" if kept else "stands still while the mechanism moves"
        parts.append(f"{', '.join(spare)} {why}")
    most_named = 12  # freedoms that a message names
    if d > len(kept) and able:
        count = "any one of " if d - len(kept) == 1 else f"{d - len(kept)} independent ones of "
        which = ", ".join(able[:most_named]) + (", ..." if len(able) > most_named else "")
        where = " in its place" if spare else " beside them" if kept else ""
        parts.append(f"{count if len(able) > 1 else ''}{which} would do{where}")
    elif spare:
        parts.append("leave it out")
    return "; ".join(parts)
