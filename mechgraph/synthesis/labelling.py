"""Start sets of tasks in canonical order: one serves whatever the order of links, pairs, unknowns, and of the links of a pair.

Symmetries of a task are automorphisms of the declared graph that respect what is asked and what is unknown. A link may stand for another
where their pairs are of the same types, what is asked of one is asked of the other (so links of which something is asked stand for
themselves), the same numbers of both are unknown, and the others are equal. From one solution such an exchange makes another one: the same
mechanism with other names.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Hashable, Iterator, Sequence
from copy import copy
from functools import cached_property, partial
from itertools import permutations
from typing import Any

import numpy as np

from mechgraph.graph.chains import least_order, ranked
from mechgraph.graph.linkgraph import components_of_edges, members
from mechgraph.maths.newton import closest_zeros, least_norm_steps
from mechgraph.maths.se3 import Index, Mask
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.modes.family import Array, same_back
from mechgraph.modes.homotopy import polished
from mechgraph.synthesis.classes import TaskClass
from mechgraph.synthesis.legs import ClassMember
from mechgraph.synthesis.system import RowProblem
from mechgraph.variants.numbers import MARKER


class TaskLabelling:
    """Links and pairs of a class of tasks in canonical order; ``turned (P,)`` are pairs whose links change places there."""

    def __init__(self, of: TaskClass) -> None:
        self.of, self._whole, s = of, of.whole.whole, of.whole.system
        links = self._whole.link_names()
        matrix, self._labels = ranked(self._graph(links))
        order = least_order(matrix)
        self._code = [matrix[u][v] for u in order for v in order]
        place = np.argsort(order)
        P = len(self._whole.pairs)
        # the pairs of the problem, in which those of rods stand last
        own = of.problem.order
        self.pairs: Index = np.argsort(place[len(links) :][own])
        turned = [self._may_turn(k) and bool(place[s.a[k]] > place[s.b[k]]) for k in range(P)]
        self.turned = np.array(turned, dtype=bool)[own]

    @property
    def key(self) -> str:
        """What a start set serves for: topology, unknowns, what is asked where, and the groups in which loops move."""
        told = [
            self._code,
            [repr(label) for label in self._labels],
            self.of.conditions.tolist(),
            self.of.problem.rows.tolist(),
        ]
        p, constants = self.of.problem, [c.constant for c in self._whole.couplings]
        sought = {place.component for own in p.places for place in own if place.array == "couplings"}
        if sought or any(constants):
            told.append([0 if i in sought else float(f"{v:.9g}") for i, v in enumerate(p.numbers.couplings[:, 0])])
            told.append(sorted(sought))
        # the first figure is the version of the files
        return "3-" + hashlib.sha256(json.dumps(told).encode()).hexdigest()[:32]

    # --- the graph ---------------------------------------------------------------------------------------------------

    def _may_turn(self, k: int) -> bool:
        """Whether nothing tells one link of a pair from the other; rates of rotations are told from the first."""
        pair = self._whole.pairs[k]
        plain = pair.on_a is None and pair.contact is None and not self._whole.couplings
        rated = bool(self.of.problem.rates) and any(step.holds_rotation for step in pair.type.steps)
        return plain and not rated and same_back(pair.type)

    def _graph(self, links: tuple[str, ...]) -> list[list[Hashable]]:
        """What stands at nodes and between them."""
        n, s = len(links), self.of.whole.system
        out: list[list[Hashable]] = [[()] * (n + len(self._whole.pairs)) for _ in range(n + len(self._whole.pairs))]
        for i, link in enumerate(links):
            out[i][i] = ("link", link == self._whole.frame)
        for k in range(len(self._whole.pairs)):
            out[n + k][n + k] = ("pair", *self._pair(k))
            sides = ("end", "end") if self._may_turn(k) else ("a", "b")
            for side, link in zip(sides, (s.a[k], s.b[k]), strict=True):
                out[n + k][link] = out[link][n + k] = (side,)
        return out

    def _pair(self, k: int) -> tuple[Hashable, ...]:
        """What is known of a pair: its motions, what is asked of them and unknown of its place, and how that may be moved."""
        of, p, pair = self.of, self.of.whole, self._whole.pairs[k]
        place = int(np.argsort(of.problem.order)[k])
        freedoms = [(step.holds_rotation, *((f.label, *f.twist) for f in step.freedoms)) for step in pair.type.steps]
        first = p.system.first_column
        asked = [
            tuple(of.given[:, np.flatnonzero(p.asked_columns == c + order * p.system.n_freedoms)].any(axis=1).tolist())
            for c in range(first[k], first[k + 1])
            for order in range(1 + len(p.rates))
        ]
        factors = p.factor_of[p.system.pair_of_freedom[p.asked_columns % p.system.n_freedoms] == k]
        asked += [("scaled", *factors.tolist())] if (factors >= 0).any() else []
        unknown = sorted((q.array, q.side, q.component) for own in p.places for q in own if q.pair == k)
        if pair.type.takes_pitch and ("pitch", 0, 0) not in unknown:
            asked.append(("pitch", f"{p.numbers.pitch[k, 0]:.9g}"))
        B = of.algebras[place]
        # decimals that a class keeps of the motions by which markers may be moved
        moves: object = (np.round(B @ B.T, 5) + 0.0).tolist() if 0 < B.shape[1] < 6 else B.shape[1]
        lines = p.system.coupling_matrix[:, first[k] : first[k + 1], 0].tolist()
        return (
            repr(freedoms),
            tuple(asked),
            tuple(unknown),
            repr(moves),
            pair.on_a is None,
            repr(pair.contact),
            repr(lines),
            # rods have no states
            place < len(of.problem.whole.pairs),
        )

    # --- start sets --------------------------------------------------------------------------------------------------

    def _side(self, values: Array) -> Array:
        """``(2, ..., P)`` with the sides of pairs that turn exchanged."""
        return np.where(self.turned, values[::-1], values)

    @cached_property
    def _unknowns(self) -> Index:
        """For every unknown in canonical order its number."""
        place = np.argsort(self.pairs)
        told = [
            sorted(
                (int(place[q.pair]), (*MARKER, "factors", "pitch", "couplings").index(q.array), q.side, q.component)
                for q in own
            )
            for own in self.of.problem.places
        ]
        return np.array(sorted(range(len(told)), key=told.__getitem__), dtype=np.intp)

    @cached_property
    def _asked(self) -> tuple[Index, Array]:
        """For every number that is asked, in canonical order, its place and its sign."""
        s, of = self.of.problem.system, self.of
        pair, place = s.pair_of_freedom[of.columns % s.n_freedoms], np.argsort(self.pairs)
        order = np.lexsort([of.columns % s.n_freedoms, place[pair], of.columns // s.n_freedoms])
        return order, np.where(self.turned, -1.0, 1.0)[pair[order]]

    @cached_property
    def _states(self) -> tuple[Index, Array]:
        """For every number of a state in canonical order its place and its sign."""
        of, s, P = self.of, self.of.problem.system, len(self.of.problem.whole.pairs)
        sign = np.ones(of.nx)
        rows = [np.arange(s.first_row[k], s.first_row[k + 1]) for k in range(P)]
        columns = [np.arange(s.first_column[k], s.first_column[k + 1]) for k in range(P)]
        orders = range(len(of.problem.rates))
        for k in np.flatnonzero(self.turned[:P]):
            sign[[*rows[k], *(of.states + i * s.n_freedoms + c for i in orders for c in columns[k])]] = -1.0
        if s.rotations is not None:
            sign[s.rotations[1][0]] = 1.0
        pairs = self.pairs[self.pairs < P]
        own = [rows[k] for k in pairs] + [of.states + i * s.n_freedoms + columns[k] for i in orders for k in pairs]
        row = np.concatenate([*own, np.zeros(0, dtype=np.intp)]).astype(np.intp)
        norms = np.arange(of.W).reshape(2, 2, -1) if of.W else np.zeros((2, 2, 0), dtype=np.intp)
        if of.W:
            norms = np.where(self.turned, norms[:, ::-1], norms)[:, :, self.pairs]
        every = [self._unknowns, of.u + norms.ravel(), *(of.head + i * of.nx + row for i in range(of.R))]
        return np.concatenate(every), np.concatenate([np.ones(of.head), *[sign[row]] * of.R])

    def ordered(self, member: ClassMember, x: Array) -> dict[str, Array]:
        """Vectors of markers, values asked and states ``(nx, N)`` in canonical order."""
        order, sign = self._asked
        rows, signs = self._states
        out = {
            name: np.moveaxis(self._side(np.moveaxis(v, 2, -1)), -1, 2)[:, :, self.pairs]
            for name, v in zip(MARKER, member.numbers.vectors, strict=True)
        }
        return out | {"drive": sign[:, None] * member.drive[:, order], "x": signs[:, None] * x[rows]}

    def taken(self, vectors: dict[str, Array], drive: Array, x: Array) -> tuple[ClassMember, Array]:
        """A member and its states from those in canonical order."""
        order, sign = self._asked
        rows, signs = self._states
        back, own, states = np.argsort(self.pairs), np.empty_like(drive), np.empty_like(x)
        numbers = [np.moveaxis(self._side(np.moveaxis(vectors[name][:, :, back], 2, -1)), -1, 2) for name in MARKER]
        own[:, order], states[rows] = sign[:, None] * drive, signs[:, None] * x
        return ClassMember(self.of.problem.numbers.with_vectors(*numbers), own), states


@dataclass(frozen=True)
class Symmetry:
    """An exchange of pairs that makes a solution of a solution: ``places (u,)`` says which unknown each one becomes."""

    name: str
    order: int
    text: str
    places: Index


def symmetries(problem: RowProblem) -> tuple[Symmetry, ...]:
    """All exchanges but the one that leaves everything where it is."""
    m, out = problem.m, list[Symmetry]()
    places = {(p.array, p.component, p.side, p.pair): k for k, own in enumerate(problem.places) for p in own}
    for pairs in _automorphisms(problem):
        moved = {k: places.get((*key[:3], pairs.get(key[3], key[3]))) for key, k in places.items()}
        order, at = 1, dict(pairs)
        while any(k != v for k, v in at.items()):
            order, at = order + 1, {k: pairs[v] for k, v in at.items()}
        to = np.array([moved[k] for k in range(problem.u)], dtype=np.intp)
        if order > 1:
            names = [pair.name for pair in m.pairs]
            text = ", ".join(f"{names[k]} to {names[v]}" for k, v in pairs.items() if k != v)
            out.append(Symmetry("swap", order, f"Pairs may change places: {text}.", to))
    return tuple(out)


def _automorphisms(problem: RowProblem) -> Iterator[dict[int, int]]:
    """Exchanges of pairs by which links and pairs stay joined as they are."""
    whole, P = problem.whole, len(problem.m.pairs)
    labels = [_label(problem, k) for k in range(P)]
    ends = [frozenset((pair.a, pair.b)) for pair in whole.pairs]
    fixed = {whole.frame} | {link for pair in whole.pairs[P:] for link in (pair.a, pair.b)}
    degrees = {link: sorted(labels[k] for k in range(P) if link in ends[k]) for link in problem.m.link_names()}
    loose = [link for link in problem.m.link_names() if link not in fixed]
    # more links than that have no exchange looked for: their orders are too many
    for image in permutations(loose) if len(loose) <= 7 else ():
        to = dict(zip(loose, image, strict=True)) | {link: link for link in fixed}
        if any(degrees[a] != degrees[b] for a, b in to.items()):
            continue
        pairs: dict[int, int] = {}
        for k in range(P):
            goal = frozenset(to[link] for link in ends[k])
            fits = [v for v in range(P) if ends[v] == goal and labels[v] == labels[k] and v not in pairs.values()]
            if not fits:
                break
            pairs[k] = fits[0]
        else:
            yield pairs


def _label(problem: RowProblem, k: int) -> str:
    """What a pair is, beside the links that it joins: its type, what is unknown of it, and all else."""
    unknown = {(p.array, p.side, p.component) for own in problem.places for p in own if p.pair == k}
    known: list[Any] = []
    for name, vector in zip(("point", "axis", "second"), problem.numbers.vectors, strict=True):
        for side in (0, 1):
            known += [
                "?" if (name, side, i) in unknown else f"{vector[side, i, k, 0]:.9g}"
                for i in range(3)
                if name != "second"
            ]
    known.append(f"{problem.numbers.pitch[k, 0]:.9g}")
    s = problem.system
    own = slice(s.first_column[k], s.first_column[k + 1])
    pair = problem.whole.pairs[k]
    # of which something is asked, or which a coupling joins to others, is like no other
    alone = ((problem.columns >= own.start) & (problem.columns < own.stop)).any() or s.coupling_matrix[:, own].any()
    return str((pair.type.symbol, known, k if alone else -1))


def orbits(z: Array, of: tuple[Symmetry, ...], motions: Array) -> list[list[int]]:
    """Solutions ``z (u, n)`` that exchanges make of each other, or that do the same: whose ``motions (k, n)`` are the same."""
    n, ends = z.shape[1], list[tuple[int, int]]()
    for i in range(n):
        alike = same_motions(motions, i)
        for one in of:
            there = np.empty_like(z[:, [i]])
            there[one.places] = z[:, [i]]
            size = max(1.0, float(np.abs(there).max(initial=0.0)))
            alike |= np.abs(z - there).max(axis=0, initial=0.0) <= MODES.one_assembly * size
        ends += [(i, j) for j in np.flatnonzero(alike).tolist()]
    return members(components_of_edges(n, ends)) if n else []


def motions_of(of: TaskClass, member: ClassMember, x: Array) -> Array:
    """Where numbers asked can go from every row, dimensions at rest ``(n, T)``: projectors on these directions; none where all can, or
    where all rates are asked.

    They are the same for mechanisms that do the same, as Roberts' cognates.
    """
    first, rows, out = of.at(of.start, of.x[:, None]), of.at(member, x), list[Array]()
    F = of.problem.system.n_freedoms
    n = rows.residual.shape[1] // (1 + len(of.problem.rates))
    for i, given in enumerate(of.given):
        columns = of.columns[given & (of.columns < F)]
        # where rates of all of them are asked these directions are, of whatever mechanism
        if np.isin(columns + F, of.columns[given]).all():
            continue
        J = [v.by_coordinates[i][:n, :F].transpose(2, 0, 1) for v in (first, rows)]
        rank = np.linalg.matrix_rank(J[0][0], MODES.generic)
        ways = np.linalg.svd(np.concatenate(J))[2][:, rank:, columns].conj().swapaxes(1, 2)
        onto = ways @ np.linalg.pinv(ways, rcond=MODES.generic)
        # rows of which the numbers asked can go anywhere tell nothing, as a random mechanism says
        if np.abs(onto[0] - np.eye(len(columns))).max(initial=0.0) > MODES.span:
            out.append(onto[1:].reshape(x.shape[1], len(columns) ** 2).T)
    return np.concatenate(out) if out else np.zeros((0, x.shape[1]))


def same_motions(motions: Array, i: int) -> Mask:
    """Which solutions of ``motions (k, n)`` do the same as one of them."""
    n = motions.shape[1]
    return np.abs(motions - motions[:, [i]]).max(axis=0) < MODES.most_noise if len(motions) else np.arange(n) == i


class OneRow:
    """One row of a class at states ``x (nx, T)``: its residual ``(n, T)``, and the smallest steps to zero, unknowns at rest."""

    def __init__(self, of: TaskClass, task: ClassMember, x: Array) -> None:
        self.of, self.rows = of, of.at(task, x)
        self.k = of.counted(self.rows.residual.shape[1], 0)
        self.residual = self.rows.residual[0][: self.k]

    def least(self) -> Array:
        """These steps ``(n, T)``."""
        out = np.zeros((self.of.head + self.of.F, self.rows.T), dtype=complex)
        J = self.rows.by_coordinates[0][: self.k, self.of.free[0]]
        out[self.of.head + self.of.free[0]] = least_norm_steps(J, self.residual, MODES.generic)
        return out


def placed(
    of: TaskClass,
    member: ClassMember,
    z: Array,
    rng: np.random.Generator,
    near: Sequence[Array],
    imaginary: float = 0.5,
) -> tuple[Array, Mask]:
    """States ``(nx, n)`` of unknowns ``z (u, n)`` at a task that they do, from positions ``near (R, nx, n)``, then from random ones with
    such an ``imaginary`` part; which close.
    """
    s, n = of.problem.system, z.shape[1]
    head = np.concatenate([z, of.problem.numbers.with_values(of.problem.places, z).norms.reshape(-1, n)[: of.W]])
    X, open_ = np.zeros((of.R, of.nx, n), dtype=complex), np.ones((of.R, n), dtype=bool)
    # unknowns may be rounded but for real ones, of which all digits count: near the limits of reach there is little room
    enough, goal = (1e-2, 1e-2) if imaginary else (1e-6, 1e-12)
    for i in range(of.R):
        one = of.row(i)
        # the positions given, then so many random ones
        for given, tries in ((True, len(near)), (False, 16)):
            left = np.flatnonzero(open_[i])
            if not left.size or not tries:
                continue
            trial = np.zeros((of.nx, tries, left.size), dtype=complex)
            if given:
                trial[:] = np.swapaxes([states[i][:, left] for states in near], 0, 1)
            else:
                some = rng.normal(size=(s.n_freedoms, tries * left.size, 2)) @ [1.0, imaginary * 1j]
                rest = np.repeat(of.problem.at_rest[:, None].astype(complex), tries * left.size, axis=1)
                trial[: of.states] = s.advance(rest, some).reshape(of.states, tries, left.size)
            x = np.concatenate([np.tile(head[:, left], tries), trial.reshape(of.nx, -1)])
            task = ClassMember(member.numbers, member.drive[[i]])
            x, size = closest_zeros(partial(OneRow, one, task), OneRow.least, one.advance, x, goal)
            size, x = size.reshape(tries, -1), x[of.head :].reshape(of.nx, tries, -1)
            best, every = size.argmin(axis=0), np.arange(left.size)
            X[i][:, left], open_[i, left] = x[:, best, every], ~(size[best, every] < enough)
    x = np.concatenate([head, X.reshape(-1, n)])
    x, closed = polished(of.leg(member, member), x, 1.0, np.zeros(n, dtype=np.intp))
    return x, closed & ~open_.any(axis=0)


def by_motions(of: TaskClass) -> TaskClass:
    """The class with solutions that do the same as one."""
    out = copy(of)
    out.apart = MODES.noise_apart
    vars(out)["fingerprints"] = partial(motions_of, of)
    return out


def cognates(copies: list[list[int]], of: tuple[Symmetry, ...], motions: Array) -> tuple[Symmetry, ...]:
    """What is said where solutions do the same and are more than exchanges make."""
    same = max((int(same_motions(motions, mine[0]).sum()) for mine in copies), default=1) // (1 + len(of))
    text = (
        f"Of {same} mechanisms each the numbers asked move in the same directions at all positions: they do the same."
    )
    return (Symmetry("cognate", same, text, np.zeros(0, dtype=np.intp)),) if same > 1 else ()
