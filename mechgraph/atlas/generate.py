"""All kinematic chains of a kind, each once: contracted graphs, each with words of joints on its edges that no symmetry makes greater.

A chain of family f moves in b = 6 - f freedoms. In a contracted graph an edge e with w_e freedoms on it closes with others: every set S
of edges that hangs together in N_S loops is a part of its own with the mobility

    M_S = sum of w_e over S - b N_S - (multiple joints in S),

where a multiple joint of k links counts as a link with k turns that spins idly. No part is rigid where M_S >= 1 for all such sets; of a
rigid chain (a Baranov truss) that is asked of all but the whole. These are linear conditions on the numbers w_e.
Source of the method (contracted graphs, then binary links): Tsai, Mechanism Design, 2001, chapter 4; orderly choice among symmetric
ones: Read, Every one a winner, Annals of Discrete Mathematics 2, 1978.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations, pairwise, product

import numpy as np
from numpy.typing import NDArray

from mechgraph.atlas.canonical import Order
from mechgraph.atlas.chain import Chain
from mechgraph.atlas.contracted import Contracted, contracted_graphs
from mechgraph.model.pair_type import PairType

Rows = NDArray[np.int64]
Word = tuple[int, ...]
PLANAR = 3
"""The family of planar chains."""
CHUNK = 4_000_000
"""Numbers in the table of mobilities of parts that is made at a time."""


@dataclass(frozen=True)
class Wanted:
    """What chains are asked for; ``types`` are rows of the pair table, ``joints`` the number of pairs."""

    links: int
    joints: int
    mobility: int
    family: int
    types: tuple[PairType, ...]
    multiple: bool

    @property
    def loops(self) -> int:
        """Independent loops."""
        return self.joints - self.links + 1

    @property
    def freedoms(self) -> int:
        """Sum of the freedoms of all pairs."""
        return self.mobility + (6 - self.family) * self.loops


def chains(wanted: Wanted, fractionated: bool) -> Iterator[Chain]:
    """The chains that are asked for: not fractionated, or fractionated ones alone."""
    if wanted.loops < 1:
        return
    for graph in contracted_graphs(wanted.loops, one_block=not fractionated):
        if not (fractionated and graph.in_one_block):
            for turned in _turned_nodes(graph, wanted.multiple):
                yield from _on(graph, turned, wanted)


def _turned_nodes(graph: Contracted, multiple: bool) -> Iterator[frozenset[int]]:
    """Sets of nodes that are multiple joints, one of all those that a symmetry makes of each other."""
    yield frozenset()
    if not multiple or len(graph.edges) == 1:
        return
    images = graph.symmetries
    for count in range(1, graph.nodes + 1):
        for chosen in combinations(range(graph.nodes), count):
            if all(tuple(sorted(p[v] for v in chosen)) >= chosen for p in images):
                yield frozenset(chosen)


def _on(graph: Contracted, joint_nodes: frozenset[int], wanted: Wanted) -> Iterator[Chain]:
    """Chains with a contracted graph some of whose nodes are multiple joints."""
    images = [
        p for p in graph.symmetries if all((p[v] in joint_nodes) == (v in joint_nodes) for v in range(graph.nodes))
    ]
    length = wanted.links - graph.nodes + len(joint_nodes) + len(graph.edges)
    single = {t.f for t in wanted.types} == {1}
    shortest = [1 + (u in joint_nodes and v in joint_nodes) for u, v in graph.edges]
    total = wanted.freedoms + len(joint_nodes)
    if length < sum(shortest) or (single and length != total):
        return
    for w in _weights(graph, joint_nodes, wanted, np.array(shortest), total, images):
        if len(wanted.types) == 1:
            yield _chain(graph, joint_nodes, [(0,) * int(n) for n in w // wanted.types[0].f], wanted)
        else:
            for words in _words(graph, joint_nodes, w.tolist(), length, wanted, images):
                yield _chain(graph, joint_nodes, words, wanted)


# --- freedoms on the edges -------------------------------------------------------------------------------------------


def _weights(
    graph: Contracted, joint_nodes: frozenset[int], wanted: Wanted, least: Rows, total: int, images: Sequence[Order]
) -> Rows:
    """Freedoms on every edge ``(n, edges)``: no rigid part, and none that a symmetry makes greater."""
    rows = least + _shares(total - int(least.sum()), len(least))
    for members in graph.classes.values():
        for one, other in pairwise(members):
            rows = rows[rows[:, one] >= rows[:, other]]
    if len(wanted.types) == 1:
        rows = rows[(rows % wanted.types[0].f == 0).all(axis=1)]
    sets, loops, touched = graph.rings
    bound = (6 - wanted.family) * loops + touched[:, sorted(joint_nodes)].sum(axis=1) + 1
    bound -= (sets.all(axis=1)) & (wanted.mobility == 0)
    step = max(1, CHUNK // max(1, len(sets)))
    parts = [rows[i : i + step] for i in range(0, len(rows), step)]
    mobile = [part[(part.astype(float) @ sets.T >= bound).all(axis=1)] for part in parts]
    rows = np.concatenate(mobile) if mobile else rows
    base = (total + 1) ** np.arange(len(least), dtype=object)[::-1]
    if not len(rows):
        return rows
    value = rows.astype(object) @ base
    greatest = np.ones(len(rows), dtype=bool)
    for edges in {tuple(_moved_edges(graph, p)) for p in images}:
        greatest &= (rows[:, list(edges)].astype(object) @ base) <= value
    return rows[greatest]


@cache
def _shares(rest: int, edges: int) -> Rows:
    """All ways ``(n, edges)`` to share ``rest`` freedoms among edges."""
    if rest < 0:
        return np.zeros((0, edges), dtype=np.int64)
    chosen = list(combinations(range(rest + edges - 1), edges - 1))
    walls = np.array(chosen, dtype=np.int64).reshape(len(chosen), edges - 1)
    ends = np.full((len(walls), 1), rest + edges - 1)
    return np.diff(np.concatenate([np.full_like(ends, -1), walls, ends], axis=1), axis=1) - 1


def _moved_edges(graph: Contracted, image: Order) -> list[int]:
    """For every edge the one that a symmetry of the nodes brings it to; parallel edges keep their order."""
    out = [0] * len(graph.edges)
    for (u, v), members in graph.classes.items():
        to = graph.classes[min(image[u], image[v]), max(image[u], image[v])]
        for e, f in zip(members, to, strict=True):
            out[e] = f
    return out


# --- pair types on the edges -----------------------------------------------------------------------------------------


def _words(
    graph: Contracted, joint_nodes: frozenset[int], w: list[int], length: int, wanted: Wanted, images: Sequence[Order]
) -> Iterator[list[Word]]:
    """Words of types (numbers) on the edges with ``w`` freedoms and ``length`` pairs in all, none that a symmetry makes greater."""
    pins = [i for i, t in enumerate(wanted.types) if t.f == 1 and t.freedoms[0].turns]
    options = []
    for (u, v), freedoms in zip(graph.edges, w, strict=True):
        mine = [
            word
            for word in _words_of(freedoms, tuple(t.f for t in wanted.types))
            if (u not in joint_nodes or word[0] in pins) and (v not in joint_nodes or word[-1] in pins)
        ]
        options.append([word for word in mine if u != v or word >= word[::-1]])
    for words in product(*options):
        if (
            sum(map(len, words)) == length
            and _is_greatest(graph, words, images, w)
            and _turns_in_loops(graph, joint_nodes, words, wanted)
        ):
            yield list(words)


@cache
def _words_of(freedoms: int, of_types: tuple[int, ...]) -> tuple[Word, ...]:
    """All words of types with so many freedoms in all."""
    if not freedoms:
        return ((),)
    return tuple(
        (i, *rest) for i, f in enumerate(of_types) if f <= freedoms for rest in _words_of(freedoms - f, of_types)
    )


def _is_greatest(graph: Contracted, words: Sequence[Word], images: Sequence[Order], freedoms: Sequence[int]) -> bool:
    """Whether no symmetry (and no choice of the first link of a ring) makes words on parallel edges, sorted, greater.

    Only symmetries that keep the freedoms on the edges: by these all others were decided before.
    """
    if len(graph.edges) == 1:
        word = words[0]
        turned = [word[i:] + word[:i] for i in range(len(word))]
        return word == max(turned + [t[::-1] for t in turned])
    mine = [[(freedoms[e], words[e]) for e in members] for members in graph.classes.values()]
    for image in images:
        moved: dict[tuple[int, int], list[tuple[int, Word]]] = {}
        for (u, v), members in graph.classes.items():
            a, b = image[u], image[v]
            some = [(freedoms[e], words[e][::-1] if a > b else words[e]) for e in members]
            if a == b:
                some = [(w, max(word, word[::-1])) for w, word in some]
            moved[min(a, b), max(a, b)] = sorted(some, reverse=True)
        image_of_mine = [moved[ends] for ends in graph.classes]
        same = all(
            w == x for m, o in zip(mine, image_of_mine, strict=True) for (w, _), (x, _) in zip(m, o, strict=True)
        )
        if same and image_of_mine > mine:
            return False
    return True


def _turns_in_loops(graph: Contracted, joint_nodes: frozenset[int], words: Sequence[Word], wanted: Wanted) -> bool:
    """Whether a planar chain turns: with fewer than two turns a loop only slides, and is of family 4."""
    if wanted.family != PLANAR:
        return True
    turns = np.array([sum(any(f.turns for f in wanted.types[i].freedoms) for i in word) for word in words])
    sets, loops, touched = graph.rings
    in_loop = sets @ turns - touched[:, sorted(joint_nodes)].sum(axis=1)
    return bool((in_loop[loops == 1] >= 2).all())


# --- the chain -------------------------------------------------------------------------------------------------------


def _chain(graph: Contracted, joint_nodes: frozenset[int], words: Iterable[Word], wanted: Wanted) -> Chain:
    """The chain: links of the contracted graph first, then the binary ones along its edges."""
    number = {v: i for i, v in enumerate(v for v in range(graph.nodes) if v not in joint_nodes)}
    links = len(number)
    joints: list[tuple[int, ...]] = []
    types: list[str] = []
    at_joint: dict[int, list[int]] = {v: [] for v in sorted(joint_nodes)}
    for (u, v), word in zip(graph.edges, words, strict=True):
        inner = range(links, links + len(word) - 1)
        links += len(inner)
        path: list[int | None] = [number.get(u), *inner, number.get(v)]
        for (one, other), kind in zip(pairwise(path), word, strict=True):
            if one is not None and other is not None:
                joints.append((one, other))
                types.append(wanted.types[kind].symbol)
        for node, end in ((u, path[1]), (v, path[-2])):
            if node in at_joint and end is not None:
                at_joint[node].append(end)
    pin = next((t.symbol for t in wanted.types if t.f == 1 and t.freedoms[0].turns), "")
    joints += [tuple(members) for members in at_joint.values()]
    types += [pin] * len(at_joint)
    return Chain(links, tuple(joints), tuple(types), wanted.family)
