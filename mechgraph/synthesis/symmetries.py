"""Symmetries of a task: automorphisms of the declared graph that respect what is asked and what is unknown.

A link may stand for another where their pairs are of the same types, what is asked of one is asked of the other (so links of which
something is asked stand for themselves), the same numbers of both are unknown, and the others are equal. From one solution such an
exchange makes another one: the same mechanism with other names.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations
from typing import Any

import numpy as np

from mechgraph.graph.linkgraph import components_of_edges, members
from mechgraph.maths.se3 import Index
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.modes.family import Array
from mechgraph.modes.start_sets import distinct
from mechgraph.synthesis.classes import ClassMember, TaskClass
from mechgraph.synthesis.system import RowProblem


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
        for one in of:
            there = np.empty_like(z[:, i])
            there[one.places] = z[:, i]
            ends += [(i, j) for j in range(i + 1, n) if not len(distinct(there[:, None], z[:, [j]]))]
        ends += [(i, j) for j in range(i + 1, n) if does_the_same(motions, i, j)]
    return members(components_of_edges(n, ends)) if n else []


def motions_of(of: TaskClass, member: ClassMember, x: Array) -> Array:
    """Where numbers asked can go from every row, dimensions at rest ``(n, T)``: projectors on these directions; none where all can.

    They are the same for mechanisms that do the same, as Roberts' cognates.
    """
    rows, out = of.at(member, x), list[Array]()
    F = of.problem.system.n_freedoms
    for i, given in enumerate(of.given):
        columns = of.columns[given & (of.columns < F)]
        J = rows.by_coordinates[i][: rows.residual.shape[1] // (1 + len(of.problem.rates)), :F].transpose(2, 0, 1)
        sigma, V = np.linalg.svd(J)[1:]
        rank = int((sigma > MODES.generic * sigma[:, :1]).sum(axis=1).max(initial=0))
        ways = V[:, rank:, columns].conj().swapaxes(1, 2)
        onto = ways @ np.linalg.pinv(ways, rcond=MODES.generic)
        if np.abs(onto - np.eye(len(columns))).max(initial=0.0) > MODES.span:
            out.append(onto.reshape(x.shape[1], -1).T)
    return np.concatenate(out) if out else np.zeros((0, x.shape[1]))


def does_the_same(motions: Array, i: int, j: int) -> bool:
    """Whether two solutions of ``motions (k, n)`` do the same."""
    return bool(len(motions) and np.abs(motions[:, i] - motions[:, j]).max() < MODES.real_singular)


def cognates(copies: list[list[int]], of: tuple[Symmetry, ...], motions: Array) -> tuple[Symmetry, ...]:
    """What is said where solutions do the same and are more than exchanges make."""
    same = max((sum(does_the_same(motions, mine[0], i) for i in mine) for mine in copies), default=1) // (1 + len(of))
    text = (
        f"Of {same} mechanisms each the numbers asked move in the same directions at all positions: they do the same."
    )
    return (Symmetry("cognate", same, text, np.zeros(0, dtype=np.intp)),) if same > 1 else ()
