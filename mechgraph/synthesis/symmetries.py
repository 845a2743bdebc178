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

from mechgraph.maths.se3 import Index
from mechgraph.memo import dataclass
from mechgraph.modes.family import Array
from mechgraph.modes.start_sets import distinct
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


def orbits(z: Array, of: tuple[Symmetry, ...]) -> list[list[int]]:
    """Solutions ``z (u, n)`` that exchanges make of each other."""
    out: list[list[int]] = []
    left = list(range(z.shape[1]))
    while left:
        mine = [left.pop(0)]
        for i in mine:
            for one in of:
                there = np.empty_like(z[:, i])
                there[one.places] = z[:, i]
                for j in list(left):
                    if not len(distinct(there[:, None], z[:, [j]])):
                        mine.append(j)
                        left.remove(j)
        out.append(sorted(mine))
    return out
