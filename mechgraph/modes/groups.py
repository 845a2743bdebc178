"""Structural groups in the equations of assemblies: parts of a mechanism that can be solved one after the other.

With all that is known at rest, the smallest sets of bodies that stand still by their own pairs and rods are groups (see
``structure.groups``); once one is solved its bodies are one, and the next is looked for among what is left. A group has a class of its
own, of which the mechanism is a member for every solution of the groups before: its bodies are these, its markers stand where they carry
them. So the assemblies over C are as many as the product of those of the groups, and none is missing where none is of any group.
Sources: Assur's groups, see ``structure.groups``; Sommese and Wampler, The Numerical Solution of Systems of Polynomials, 2005, chapter 7
(parameter homotopy).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from mechgraph.algebra.se3 import compose, identity
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.point_rows import PointNumbers
from mechgraph.determinacy.decomposition import MOST_SPLIT, Constraint, Constraints, rows_of_pair, smallest
from mechgraph.graph.linkgraph import components_of_edges
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Link, Pair
from mechgraph.modes.family import SPAN, Array, Family, Member, generated
from mechgraph.modes.form import Step, behind
from mechgraph.modes.rods import RodFamily, RodSystem
from mechgraph.numerics.linear import complement
from mechgraph.numerics.tolerances import RANKS

KNOWN_MOVED = 0.3
"""Change of what is known (radians, lengths over L) at which a group must still be a member of its class."""


class Undivided:
    """The equations as they are."""

    def __init__(self, family: Family) -> None:
        self.family = family
        self.names = [pair.name for pair in family.system.m.pairs]

    def goal(self, x: Array, drive: Array) -> Member:
        """The members to be solved at states ``x (nx, n)``, as far as they are known, and values ``drive (d, n)``."""
        return Member(self.family.target, drive)

    def put(self, x: Array, found: Array) -> Array:
        """States ``(nx, n)`` of what was ``found`` for a state ``x (nx,)``."""
        return found


class Group:
    """A group of ``pairs`` and ``rods`` of a class, behind pairs that are ``known``."""

    def __init__(self, whole: Family, pairs: Index, rods: Index, known: Index) -> None:
        self.whole, self.pairs, self.rods = whole, pairs, rods
        s = whole.system
        self.names = [s.m.pairs[k].name for k in pairs.tolist()]
        self.state_rows, kept = (
            np.array([i for k in pairs for i in range(to[k], to[k + 1])], dtype=np.intp)
            for to in (s.first_row, s.first_column)
        )
        P, n = len(s.m.pairs), len(whole.bearers) - 2 * len(s.m.pairs)
        points = 2 * P + rods
        self._markers = np.concatenate([pairs, P + pairs, points, points + n // 2]).astype(np.intp)
        self._bearers = whole.bearers[self._markers]
        self._plan(known)
        own = np.isin(whole.columns, kept)
        self._drives = np.concatenate([np.flatnonzero(own), len(whole.columns) + rods]).astype(np.intp)
        columns, held = (np.searchsorted(kept, of[np.isin(of, kept)]) for of in (whole.columns, whole.held))
        self.family = self._class(columns, self._idle(kept, known), held)

    def _plan(self, known: Index) -> None:
        """Bodies: links that known pairs join, each with a first link that bears a marker; ways from there to the others."""
        s = self.whole.system
        body = components_of_edges(len(s.m.links), [s.graph.ends[k] for k in known])
        at: list[list[tuple[int, Step]]] = [[] for _ in s.m.links]
        for k in known.tolist():
            a, b = s.graph.ends[k]
            at[a].append((b, Step(k, 1)))
            at[b].append((a, Step(k, -1)))
        # the frame leads its body and stands before all others
        first: dict[int, int] = {}
        for link in sorted(self._bearers.tolist(), key=lambda link: link != s.graph.frame):
            first.setdefault(int(body[link]), link)
        self.links = list(first.values())
        self._first = np.array([first.get(b, -1) for b in body.tolist()])
        self._ways: list[tuple[int, int, Step]] = []
        reached = list(self.links)
        seen = set(reached)
        for link in reached:  # the list grows while it is run through
            for other, step in at[link]:
                if other not in seen:
                    seen.add(other)
                    reached.append(other)
                    self._ways.append((link, other, step))

    def _carried(self, x: Array) -> Array:
        """The markers ``(3, 4, markers, n)``, and points of rods, in the first links of their bodies."""
        poses = {link: identity(x.shape[1]) for link in self.links}
        for before, link, step in self._ways:
            poses[link] = compose(poses[before], behind(self.whole.system, step, x))
        out = [
            compose(poses[link], self.whole.target[:, :, k])
            for link, k in zip(self._bearers.tolist(), self._markers.tolist(), strict=True)
        ]
        markers = np.stack(out, axis=2)
        markers[:, :3, 2 * len(self.pairs) :] = np.eye(3)[:, :, None, None]
        return markers

    def goal(self, x: Array, drive: Array) -> Member:
        """See ``Undivided``."""
        return Member(self._carried(x), drive[self._drives])

    def put(self, x: Array, found: Array) -> Array:
        """See ``Undivided``."""
        out = np.repeat(x[:, None], found.shape[1], axis=1).astype(complex)
        out[self.state_rows] = found
        return out

    @property
    def within(self) -> bool:
        """Whether the group stays in its class wherever known pairs move."""
        family = self.family
        if family.whole:
            return True
        rng, s = np.random.default_rng(0), self.whole.system
        dq = rng.uniform(-KNOWN_MOVED, KNOWN_MOVED, (s.n_freedoms, 1))
        markers = self._carried(s.advance(self.whole.here.x, dq))
        return family.within(markers, np.arange(2 * len(self.pairs)))

    def _idle(self, kept: Index, known: Index) -> Array:
        """Passive motions ``(F, p)`` of the group alone."""
        s, rates = self.whole.system, self.whole.idle
        solved = [i for k in known.tolist() for i in range(s.first_column[k], s.first_column[k + 1])]
        others = complement(np.array([*kept.tolist(), *solved], dtype=np.intp), s.n_freedoms)
        if not rates.shape[1]:
            return rates[kept]
        _, sigma, Vt = np.linalg.svd(rates[others])
        own = (rates @ Vt[int((sigma > SPAN).sum()) :].T)[kept]
        U, sigma, _ = np.linalg.svd(own, full_matrices=False)
        return np.asarray(U[:, sigma > SPAN])

    def _class(self, columns: Index, idle: Array, held: Index) -> Family:
        """The class, told where the whole is."""
        here, s = self.whole.here, self.whole.system
        P, n, full, par = len(self.pairs), len(self.rods), s.m, s.par
        names = [full.links[link].name for link in self.links]
        ends = self._first[self._bearers]
        place = {link: i for i, link in enumerate(self.links)}
        pairs = [
            Pair(name, full.pairs[k].type, full.links[a].name, full.links[b].name, point=(0, 0, 0), axis=(0, 0, 1))
            for name, k, a, b in zip(self.names, self.pairs, ends[:P], ends[P : 2 * P], strict=True)
        ]
        m = Mechanism(full.name, [Link(name) for name in names], pairs, frame=names[0])
        markers = self._carried(here.x[:, :1]).real
        numbers = replace(
            par,
            marker_a=markers[:, :, :P],
            marker_b=markers[:, :, P : 2 * P],
            pitch=par.pitch[self.pairs],
            mass=par.mass[self.links],
            center=par.center[:, self.links],
            inertia=par.inertia[:, :, self.links],
            offset=par.offset[:, self.links],
            frame=here.poses[:, :, self.links[0], :1],
        )
        x = here.x[self.state_rows, :1]
        if not n:
            return Family(Configuration(System(m, None, numbers), x), columns, idle, held)
        assert isinstance(s, RodSystem)
        assert isinstance(self.whole, RodFamily)
        a, b = (np.array([place[link] for link in side]) for side in np.split(ends[2 * P :], 2))
        at_a, at_b = np.split(markers[:, 3, 2 * P :], 2, axis=1)
        points = PointNumbers(
            a, b, at_a, at_b, s.points.length[self.rods], np.zeros((3, 0, 1)), np.full(n, -1), np.zeros((n, 1))
        )
        # points of links that known pairs join may lie at one place at the start and part when these move
        same = self.whole.joints[self._markers[2 * P :] - 2 * len(full.pairs)]
        return RodFamily(Configuration(RodSystem(m, None, numbers, points), x), columns, idle, held, same)


def groups_of(family: Family) -> Sequence[Undivided | Group]:
    """The groups of a class in the order in which they can be solved; the whole where it has one, or a group no class of its own."""
    graph = family.system.graph
    if len(family.bearers) // 2 - len(graph.ends) + graph.n_loops > 1:
        found = []
        for pairs, rods, known in _sets(family):
            group = Group(family, pairs, rods, known)
            if group.family.rank or group.family.unknowns:
                found.append(group)
            if group.family.fault or not group.within:
                break
        else:
            if len(found) > 1:
                return found
    return [Undivided(family)]


def _sets(family: Family) -> Iterator[tuple[Index, Index, Index]]:
    """Pairs and rods of the groups, one after the other, with the pairs known before."""
    s, rows = family.system, _constraints(family)
    columns = [range(s.first_column[k], s.first_column[k + 1]) for k in range(len(s.m.pairs))]
    free = set(family.free.tolist())
    known = {k for k, own in enumerate(columns) if free.isdisjoint(own)}
    rods = list(zip(*family.points[:2], strict=True))
    left = set(range(len(rods)))
    while len(known) < len(columns):
        before = np.array(sorted(known), dtype=np.intp)
        body = components_of_edges(len(s.m.links), [s.graph.ends[k] for k in before])
        unknown = [k for k in range(len(columns)) if k not in known]
        mine = _smallest(rows, body, [s.graph.ends[k] for k in unknown], int(body[s.graph.frame]))
        pairs = [k for k in unknown if mine.issuperset(body[list(s.graph.ends[k])].tolist())]
        own = [i for i in sorted(left) if mine.issuperset(body[list(rods[i])].tolist())]
        yield np.array(pairs, dtype=np.intp), np.array(own, dtype=np.intp), before
        known.update(pairs)
        left.difference_update(own)


def _smallest(rows: Constraints, body: Index, unknown: list[tuple[int, int]], frame: int) -> set[int]:
    """The smallest set of bodies that determine each other, that of the frame with them if it has one; all where there is none."""
    count = int(body.max()) + 1
    every = set(range(count))
    if count > MOST_SPLIT:
        return every
    merged = _merged(rows, body)
    for root in sorted(every, key=lambda i: i != frame):
        mine = smallest(merged, merged.determined(every - {root}, {root}), {root}) | {root}
        joined = [(int(body[a]), int(body[b])) for a, b in unknown if mine.issuperset(body[[a, b]].tolist())]
        if 1 < len(mine) < count and len({components_of_edges(count, joined)[i] for i in mine}) == 1:
            return mine
    return every


def _constraints(family: Family) -> Constraints:
    """What pairs, rods and passive motions, which rest, ask of the motions of links."""
    here, s = family.here, family.system
    S = here.S[:, :, 0]
    T = generated(S)
    free = np.zeros(s.n_freedoms, dtype=bool)
    free[family.free] = True
    out = []
    for k, (a, b) in enumerate(s.graph.ends):
        own = np.arange(s.first_column[k], s.first_column[k + 1])
        row = rows_of_pair(S[:, own[free[own]]], T)
        out.append(Constraint(k, {a: -row, b: row}))
    if isinstance(s, RodSystem):
        W = s.rod_rows.lines(here)[1][:, :, 0]
        for a, b, w in zip(s.points.a.tolist(), s.points.b.tolist(), W.T, strict=True):
            out.append(Constraint(len(out), {a: -(w @ T)[None], b: (w @ T)[None]}))
    for rates in family.passive.T:
        V = here.link_twists(rates[:, None])[:, :, 0]
        moved = {i: (v @ T)[None] for i, v in enumerate(V.T) if np.abs(v).max() > SPAN}
        # against a neighbour that rests
        rests = next(b if a in moved else a for a, b in s.graph.ends if (a in moved) != (b in moved))
        moved[rests] = -np.sum(list(moved.values()), axis=0)
        out.append(Constraint(len(out), moved))
    return Constraints(out, T.shape[1])


def _merged(rows: Constraints, body: Index) -> Constraints:
    """The same between bodies ``(N,)`` of links."""
    out = []
    for c in rows.constraints:
        summed: dict[int, Array] = {}
        for link, row in c.rows.items():
            i = int(body[link])
            summed[i] = summed.get(i, 0.0) + row
        left = {i: row for i, row in summed.items() if np.abs(row).max(initial=0.0) > RANKS.position}
        out.append(Constraint(c.number, left))
    return Constraints(out, rows.b)
