"""Kinematic chains: links and joints without dimensions, up to symmetry; all those of a kind, each once.

A chain of family f moves in b = 6 - f freedoms. It is generated as a contracted graph, what is left of it when its binary links and their
joints are taken as one edge between other links, with words of joints on the edges that no symmetry makes greater. All connected graphs
with a number of loops whose nodes have three or more edges are needed, each once: the cubic ones grow loop by loop, the others come of
them by contracting edges; the two-connected ones have no node whose loss would part the chain.

An edge e with w_e freedoms on it closes with others: every set S of edges that hangs together in N_S loops is a part of its own with the
mobility

    M_S = sum of w_e over S - b N_S - (multiple joints in S),

where a multiple joint of k links counts as a link with k turns that spins idly. No part is rigid where M_S >= 1 for all such sets; of a
rigid chain (a Baranov truss) that is asked of all but the whole. These are linear conditions on the numbers w_e.

Canonical form: a graph is a square matrix of whole numbers, those of the nodes on the diagonal, elsewhere what leads from row to column.
Nodes are told apart by what they see of others until nothing changes; where some look alike, each of them is singled out in turn. The
least matrix of all orders found so is the canonical one, and the orders that give it differ by the symmetries of the graph.

Sources: McKay, Practical graph isomorphism, Congressus Numerantium 30, 1981 (without the pruning by symmetries found on the way: chains
are contracted to few nodes first); Tsai, Mechanism Design, 2001, chapter 4 (contracted graphs, then binary links); Read, Every one a
winner, Annals of Discrete Mathematics 2, 1978 (orderly choice among symmetric ones).
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from functools import cache, cached_property
from itertools import combinations, combinations_with_replacement, pairwise, product
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mechgraph.errors import counted
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Link, Pair
from mechgraph.pairs.pair_type import TABLE, PairType
from mechgraph.quantities import wrong

if TYPE_CHECKING:
    import networkx as nx

Order = tuple[int, ...]
Matrix = Sequence[Sequence[int]]


def ranked(labels: Sequence[Sequence[Hashable]]) -> tuple[list[list[int]], tuple[Any, ...]]:
    """Labels by their places among all different ones, and these in order."""
    different: Any = sorted(
        {label for row in labels for label in row}, key=lambda label: (len(repr(label)), repr(label))
    )
    place = {label: i for i, label in enumerate(different)}
    return [[place[label] for label in row] for row in labels], tuple(different)


def least_orders(matrix: Matrix) -> tuple[Order, list[Order]]:
    """The least matrix, row by row, of all orders of nodes that the refinement leaves, and the orders that give it."""
    n = len(matrix)
    best: Order | None = None
    orders: list[Order] = []
    waiting = [_refined(matrix, [matrix[v][v] for v in range(n)])]
    while waiting:
        colours = waiting.pop()
        if choices := _singled_out(matrix, colours):
            waiting += choices
            continue
        order = tuple(sorted(range(n), key=colours.__getitem__))
        code = tuple(matrix[u][v] for u in order for v in order)
        if best is None or code < best:
            best, orders = code, []
        if code == best:
            orders.append(order)
    return best or (), orders


def least_order(matrix: Matrix) -> Order:
    """An order of nodes that gives the least matrix, row by row, of those that the refinement leaves.

    Of nodes that look alike one is left out where a symmetry takes another one to it, as two orders that give the same matrix tell.
    """
    n = len(matrix)

    def code(order: Order) -> list[int]:
        return [matrix[u][v] for u in order for v in order]

    def any_order(colours: list[int]) -> Order:
        while choices := _singled_out(matrix, colours):
            colours = next(choices)
        return tuple(sorted(range(n), key=colours.__getitem__))

    def least(colours: list[int]) -> Order:
        known: list[list[int]] = []
        found: list[Order] = []
        for finer in _singled_out(matrix, colours) or ():
            if (seen := code(any_order(finer))) not in known:
                known.append(seen)
                found.append(least(finer))
        return min(found, key=code, default=any_order(colours))

    return least(_refined(matrix, [matrix[v][v] for v in range(n)]))


def _singled_out(matrix: Matrix, colours: list[int]) -> Iterator[list[int]] | None:
    """The colors when one of the first nodes that look alike is told from the others, each in turn; None where all are told apart."""
    shared = [c for c in set(colours) if colours.count(c) > 1]
    if not shared:
        return None
    alike = [v for v, c in enumerate(colours) if c == min(shared)]
    return (_refined(matrix, [2 * c + (u != v) for u, c in enumerate(colours)]) for v in alike)


def _refined(matrix: Matrix, colours: Iterable[int]) -> list[int]:
    """Colors 0, 1, ... of the nodes, refined until nodes of one color see the same labels on the way to the same colors."""
    mine = _numbered(list(colours))
    while True:
        seen = [
            (mine[v], tuple(sorted((mine[u], row[u]) for u in range(len(row)) if u != v)))
            for v, row in enumerate(matrix)
        ]
        finer = _numbered(seen)
        if max(finer, default=0) == max(mine, default=0):
            return mine
        mine = finer


def _numbered(values: Sequence[Any]) -> list[int]:
    place = {value: i for i, value in enumerate(sorted(set(values)))}
    return [place[value] for value in values]


def symmetries(orders: Sequence[Order]) -> list[Order]:
    """Permutations ``p`` (node v goes to p[v]) that leave a graph as it is, by the orders that give its least matrix."""
    first = orders[0]
    out = []
    for order in orders:
        image = [0] * len(first)
        for a, b in zip(first, order, strict=True):
            image[a] = b
        out.append(tuple(image))
    return out


Code = tuple[Any, ...]
Edge = tuple[int, int, Hashable]


def family_faults(family: Any) -> list[str]:
    """What is wrong with a family, one line or none."""
    return [] if type(family) is int and family in range(6) else [wrong(family, "family", "a whole number from 0 to 5")]


def data_faults(data: Any) -> list[str]:
    """What is wrong with a chain as plain data, one line each."""
    if not isinstance(data, dict) or {"links", "joints", "types", "family"} - set(data):
        return [wrong(data, "chain", "links, joints, types and family")]
    links, joints, types = data["links"], data["joints"], data["types"]
    faults = family_faults(data["family"])
    if not isinstance(joints, list) or not all(isinstance(j, list) and len(j) > 1 for j in joints):
        return [*faults, wrong(joints, "joints", "lists of the links that meet at each, two or more")]
    most = sum(len(joint) - 1 for joint in joints) + 1
    if type(links) is not int or not 1 < links <= most:
        return [*faults, wrong(links, "links", f"a whole number from 2 to {most}, which the joints can hold together")]
    places = range(links)
    if any(type(k) is not int or k not in places for joint in joints for k in joint) or any(
        len({*joint}) < len(joint) for joint in joints
    ):
        faults.append(wrong(joints, "joints", f"different links from 0 to {links - 1} at each"))
    if (
        not isinstance(types, list)
        or len(types) != len(joints)
        or not all(isinstance(t, str) and t in TABLE for t in types)
    ):
        faults.append(wrong(types, "types", f"a symbol of the pair table for each of {len(joints)} joints"))
    return faults


@dataclass(frozen=True)
class Chain:
    """A kinematic chain: links numbered from 0, and the joints between them.

    Parameters
    ----------
    links : int
        Number of links.
    joints : tuple of tuple of int
        Links that meet at each joint: two, or more at a multiple joint.
    types : tuple of str
        Symbol of the pair type of each joint.
    family : int
        Freedoms that no link has (3 for planar chains).

    Examples
    --------
    >>> import mechgraph as mg
    >>> c = mg.Chain(4, ((0, 1), (1, 2), (2, 3), (3, 0)), ("R",) * 4)
    >>> c.mobility, c.loops, c.assortment
    (1, 1, '4 binary')
    """

    links: int
    joints: tuple[tuple[int, ...], ...]
    types: tuple[str, ...]
    family: int = 3

    def __repr__(self) -> str:
        return f"Chain({self.links} links, {counted(len(self.joints), 'joint')}, mobility {self.mobility})"

    @property
    def pairs(self) -> int:
        """Number of pairs: a joint of k links counts k - 1."""
        return sum(len(joint) - 1 for joint in self.joints)

    @property
    def loops(self) -> int:
        """Independent loops N = pairs - links + 1 (the count with one link as frame, of a chain that hangs together)."""
        return self.pairs - self.links + 1

    @property
    def mobility(self) -> int:
        """Dobrovolski's count, with one link as frame: M = sum of freedoms - (6 - family) N."""
        freedoms = sum((len(j) - 1) * TABLE[t].f for j, t in zip(self.joints, self.types, strict=True))
        return freedoms - (6 - self.family) * self.loops

    @cached_property
    def degrees(self) -> tuple[int, ...]:
        """Number of joints on every link."""
        return tuple(sum(link in joint for joint in self.joints) for link in range(self.links))

    @property
    def assortment(self) -> str:
        """How many links have how many joints, e.g. ``4 binary, 2 ternary``."""
        names = {1: "unary", 2: "binary", 3: "ternary", 4: "quaternary", 5: "quinary"}
        counts = {d: self.degrees.count(d) for d in sorted(set(self.degrees))}
        return ", ".join(f"{n} {names.get(d, f'{d}-ary')}" for d, n in counts.items())

    @property
    def network(self) -> nx.Graph[Any]:
        """Links ``("link", i)`` and joints ``("joint", k)`` as nodes, joined where a link has a joint."""
        import networkx as nx

        return nx.Graph((("link", link), ("joint", k)) for k, joint in enumerate(self.joints) for link in joint)

    @property
    def is_multiple(self) -> bool:
        """Whether it has a joint of three or more links."""
        return any(len(joint) > 2 for joint in self.joints)

    @property
    def is_planar_graph(self) -> bool:
        """Whether its graph can be drawn in a plane without crossings."""
        import networkx as nx

        return bool(nx.check_planarity(self.network)[0])

    @property
    def is_fractionated(self) -> bool:
        """Whether one link, or one joint, parts it when it is taken out."""
        import networkx as nx

        return self.links > 2 and not nx.is_biconnected(self.network)

    @cached_property
    def code(self) -> Code:
        """What chains have in common that are the same up to the numbers of links and joints, and only these."""
        return self.marked_code({})

    def code_with_frame(self, frame: int) -> Code:
        """Return a code of an inversion: equal for isomorphic chains with corresponding frame links, and only for these.

        Parameters
        ----------
        frame : int
            Number of the frame link.

        Returns
        -------
        Code
        """
        return self.marked_code({frame: 1})

    def marked_code(self, links: Mapping[int, int], joints: Mapping[int, int] = MappingProxyType({})) -> Code:
        """Return a code of a chain with marks: equal for chains that are the same with their marks, and only for these.

        Parameters
        ----------
        links, joints : mapping
            Number of a link or joint -> its mark, from 1.

        Returns
        -------
        Code
        """
        nodes: list[Hashable] = [("link", links.get(i, 0)) for i in range(self.links)]
        edges: list[Edge] = []
        for k, (joint, kind) in enumerate(zip(self.joints, self.types, strict=True)):
            label = (kind, joints.get(k, 0))
            if len(joint) == 2:
                edges.append((joint[0], joint[1], label))
            else:
                edges += [(link, len(nodes), label) for link in joint]
                nodes.append(("joint", 0))
        return (self.family, self.links, self.pairs, *code_of(nodes, edges))

    @cached_property
    def inversions(self) -> tuple[tuple[int, ...], ...]:
        """Links that are alike as frame, one tuple for each inversion."""
        return _alike(range(self.links), self.code_with_frame)

    def drivers(self, frame: int) -> tuple[tuple[int, ...], ...]:
        """Return the joints that are equivalent as driver of the inversion with ``frame``, one tuple per choice.

        Parameters
        ----------
        frame : int
            Number of the frame link.

        Returns
        -------
        tuple of tuple of int
        """
        return _alike(range(len(self.joints)), lambda k: self.marked_code({frame: 1}, {k: 1}))

    def mechanism(self, frame: int = 0, name: str = "") -> Mechanism:
        """Return the chain as a mechanism without geometry: links L0, L1, ..., pairs J0, J1, ...

        Parameters
        ----------
        frame : int
            Number of the frame link.
        name : str
            Its name.

        Returns
        -------
        Mechanism
            A multiple joint becomes pairs J0a, J0b, ...

        Examples
        --------
        >>> import mechgraph as mg
        >>> next(mg.atlas(4)).mechanism().freedom_names()
        ('J0.Rz', 'J1.Rz', 'J2.Rz', 'J3.Rz')
        """
        pairs = []
        for k, (joint, kind) in enumerate(zip(self.joints, self.types, strict=True)):
            for i, link in enumerate(joint[1:]):
                mark = chr(ord("a") + i) if len(joint) > 2 else ""
                pairs.append(Pair(f"J{k}{mark}", kind, f"L{joint[0]}", f"L{link}"))
        links = [Link(f"L{i}") for i in range(self.links)]
        return Mechanism(name or f"chain of {self.links} links", links, pairs, frame=f"L{frame}")


def _alike(items: Iterable[int], code: Any) -> tuple[tuple[int, ...], ...]:
    found: dict[Code, list[int]] = {}
    for item in items:
        found.setdefault(code(item), []).append(item)
    return tuple(map(tuple, found.values()))


def code_of(nodes: list[Hashable], edges: list[Edge]) -> Code:
    """The canonical code of a connected graph with labels, by that of its contracted graph.

    Nodes with two edges are contracted: a string of them is a word of their labels, and what leads from one of the other nodes to
    another is the sorted list of these words.
    """
    at: list[list[tuple[int, int]]] = [[] for _ in nodes]
    for k, (u, v, _) in enumerate(edges):
        at[u].append((k, v))
        at[v].append((k, u))
    ends = [v for v in range(len(nodes)) if len(at[v]) != 2]
    if ends:
        return _contracted_code(nodes, edges, at, ends)
    return min((_contracted_code(nodes, edges, at, [v]) for v in range(len(nodes))), key=repr)


def _contracted_code(
    nodes: list[Hashable], edges: list[Edge], at: list[list[tuple[int, int]]], ends: list[int]
) -> Code:
    place = {v: i for i, v in enumerate(ends)}
    words: dict[tuple[int, int], list[tuple[Hashable, ...]]] = {}
    for start in ends:
        for edge, node in at[start]:
            k, v, word = edge, node, [edges[edge][2]]
            while v not in place:
                one, other = at[v]
                before = nodes[v]
                k, v = one if one[0] != k else other
                word += [before, edges[k][2]]
            words.setdefault((place[start], place[v]), []).append(tuple(word))
    inner = range(len(ends))
    labels = [
        [(nodes[ends[u]] if u == v else (), tuple(sorted(words.get((u, v), ()), key=repr))) for v in inner]
        for u in inner
    ]
    matrix, different = ranked(labels)
    orders = least_orders(matrix)[1]
    order = orders[0]
    return different, tuple(matrix[u][v] for u in order for v in order)


Edges = tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Contracted:
    """A graph on ``nodes`` by its ``edges`` (u <= v), sorted; u = v is a loop."""

    nodes: int
    edges: Edges

    @cached_property
    def counts(self) -> list[list[int]]:
        """How many edges join two nodes."""
        counts = [[0] * self.nodes for _ in range(self.nodes)]
        for u, v in self.edges:
            counts[u][v] += 1
            counts[v][u] += u != v
        return counts

    @cached_property
    def canonical(self) -> tuple[Order, list[Order]]:
        """The least matrix of counts with the orders of nodes that give it."""
        return least_orders(self.counts)

    @property
    def symmetries(self) -> list[Order]:
        """Permutations of the nodes that leave the graph as it is."""
        return symmetries(self.canonical[1])

    @cached_property
    def classes(self) -> dict[tuple[int, int], list[int]]:
        """Edges between the same two nodes."""
        out: dict[tuple[int, int], list[int]] = {}
        for e, ends in enumerate(self.edges):
            out.setdefault(ends, []).append(e)
        return out

    @property
    def in_one_block(self) -> bool:
        """Whether no node parts it when it is lost, and no edge is a loop (but for a single loop alone)."""
        import networkx as nx

        if len(self.edges) == 1:
            return True
        if any(u == v for u, v in self.edges):
            return False
        return (self.nodes == 2 and len(self.edges) > 1) or nx.is_biconnected(nx.Graph(self.edges))

    @cached_property
    def rings(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """All sets of edges that hang together, also when any edge is lost: ``(n, edges)``, their loops ``(n,)``, nodes ``(n, nodes)``.

        Labels of all sets of the first e edges give those with one edge more: it joins two labels, or closes a loop.
        """
        labels = np.arange(self.nodes, dtype=np.int8)[None]
        loops = np.zeros(1, dtype=np.int8)
        touched = np.zeros((1, self.nodes), dtype=bool)
        for u, v in self.edges:
            one, other = labels[:, u, None], labels[:, v, None]
            loops = np.concatenate([loops, loops + (one == other)[:, 0]])
            labels = np.concatenate([labels, np.where(labels == other, one, labels)])
            more = touched.copy()
            more[:, [u, v]] = True
            touched = np.concatenate([touched, more])
        E = len(self.edges)
        number = np.arange(1 << E)
        has = (number[:, None] >> np.arange(E)) & 1 == 1
        kept = (loops > 0) & (has.sum(axis=1) - touched.sum(axis=1) + 1 == loops)
        for e in range(E):
            kept &= ~has[:, e] | (loops[number ^ (1 << e)] < loops)
        return has[kept].astype(float), loops[kept].astype(float), touched[kept].astype(float)


def made(edges: list[tuple[int, int]]) -> Contracted:
    """The graph with its nodes in canonical order."""
    nodes = 1 + max(max(e) for e in edges)
    order = Contracted(nodes, tuple(sorted((min(e), max(e)) for e in edges))).canonical[1][0]
    place = {v: i for i, v in enumerate(order)}
    return Contracted(nodes, tuple(sorted((min(place[u], place[v]), max(place[u], place[v])) for u, v in edges)))


def contracted_graphs(loops: int, one_block: bool = True) -> Iterator[Contracted]:
    """All of them, those with most nodes first; of one loop the ring alone, with any of its links as node."""
    if loops == 1:
        yield Contracted(1, ((0, 0),))
        return
    level = _cubic(loops, one_block)
    while level:
        yield from level
        level = _once(_contractions(level, one_block))


def _once(graphs: Iterator[Contracted]) -> list[Contracted]:
    return sorted(set(graphs), key=lambda g: g.edges)


def _cubic(loops: int, one_block: bool) -> list[Contracted]:
    """Graphs all of whose nodes have three edges."""
    level = [made([(0, 1)] * 3)] + ([] if one_block else [made([(0, 0), (0, 1), (1, 1)])])
    for _ in range(loops - 2):
        level = _once(new for g in level for new in _with_a_loop(g, one_block))
    return level


def _with_a_loop(g: Contracted, one_block: bool) -> Iterator[Contracted]:
    """Two edges, or one twice, joined by a new one; else a loop that hangs at an edge."""
    a, b = g.nodes, g.nodes + 1
    for i, j in combinations_with_replacement(range(len(g.edges)), 2):
        rest = [e for k, e in enumerate(g.edges) if k not in (i, j)]
        (u, v), (w, x) = g.edges[i], g.edges[j]
        if i == j:
            yield made([*rest, (u, a), (a, b), (a, b), (b, v)])
            if not one_block:
                yield made([*rest, (u, a), (a, v), (a, b), (b, b)])
        else:
            yield made([*rest, (u, a), (a, v), (w, b), (b, x), (a, b)])


def _contractions(level: list[Contracted], one_block: bool) -> Iterator[Contracted]:
    """Graphs with one edge contracted. In one block only edges without a parallel one: those would become loops.

    Every graph in one block with a node of four or more edges comes so of one in one block: split that node in any way.
    """
    for g in level:
        for (u, v), members in g.classes.items():
            if u == v or (one_block and len(members) > 1):
                continue
            place = [w - (w > v) if w != v else u for w in range(g.nodes)]
            edges = list(g.edges)
            edges.remove((u, v))
            new = made([(place[a], place[b]) for a, b in edges])
            if not one_block or new.in_one_block:
                yield new


Rows = NDArray[np.int64]
Word = tuple[int, ...]


@dataclass(frozen=True)
class ChainKind:
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


def chains(kind: ChainKind, fractionated: bool) -> Iterator[Chain]:
    """The chains that are asked for: not fractionated, or fractionated ones alone."""
    if kind.loops < 1:
        return
    for graph in contracted_graphs(kind.loops, one_block=not fractionated):
        if not (fractionated and graph.in_one_block):
            for turned in _turned_nodes(graph, kind.multiple):
                yield from _on(graph, turned, kind)


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


def _on(graph: Contracted, joint_nodes: frozenset[int], kind: ChainKind) -> Iterator[Chain]:
    """Chains with a contracted graph some of whose nodes are multiple joints."""
    images = [
        p for p in graph.symmetries if all((p[v] in joint_nodes) == (v in joint_nodes) for v in range(graph.nodes))
    ]
    length = kind.links - graph.nodes + len(joint_nodes) + len(graph.edges)
    single = {t.f for t in kind.types} == {1}
    shortest = [1 + (u in joint_nodes and v in joint_nodes) for u, v in graph.edges]
    total = kind.freedoms + len(joint_nodes)
    if length < sum(shortest) or (single and length != total):
        return
    for w in _weights(graph, joint_nodes, kind, np.array(shortest), total, images):
        if len(kind.types) == 1:
            yield _chain(graph, joint_nodes, [(0,) * int(n) for n in w // kind.types[0].f], kind)
        else:
            for words in _words(graph, joint_nodes, w.tolist(), length, kind, images):
                yield _chain(graph, joint_nodes, words, kind)


# --- freedoms on the edges -------------------------------------------------------------------------------------------


def _weights(
    graph: Contracted, joint_nodes: frozenset[int], kind: ChainKind, least: Rows, total: int, images: Sequence[Order]
) -> Rows:
    """Freedoms on every edge ``(n, edges)``: no rigid part, and none that a symmetry makes greater."""
    rows = least + _shares(total - int(least.sum()), len(least))
    for members in graph.classes.values():
        for one, other in pairwise(members):
            rows = rows[rows[:, one] >= rows[:, other]]
    if len(kind.types) == 1:
        rows = rows[(rows % kind.types[0].f == 0).all(axis=1)]
    sets, loops, touched = graph.rings
    bound = (6 - kind.family) * loops + touched[:, sorted(joint_nodes)].sum(axis=1) + 1
    bound -= (sets.all(axis=1)) & (kind.mobility == 0)
    # numbers in the table of mobilities of parts that is made at a time
    step = max(1, 4_000_000 // max(1, len(sets)))
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
    graph: Contracted, joint_nodes: frozenset[int], w: list[int], length: int, kind: ChainKind, images: Sequence[Order]
) -> Iterator[list[Word]]:
    """Words of types (numbers) on the edges with ``w`` freedoms and ``length`` pairs in all, none that a symmetry makes greater."""
    pins = [i for i, t in enumerate(kind.types) if t.f == 1 and t.freedoms[0].turns]
    options = []
    for (u, v), freedoms in zip(graph.edges, w, strict=True):
        mine = [
            word
            for word in _words_of(freedoms, tuple(t.f for t in kind.types))
            if (u not in joint_nodes or word[0] in pins) and (v not in joint_nodes or word[-1] in pins)
        ]
        options.append([word for word in mine if u != v or word >= word[::-1]])
    for words in product(*options):
        if (
            sum(map(len, words)) == length
            and _is_greatest(graph, words, images, w)
            and _turns_in_loops(graph, joint_nodes, words, kind)
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


def _turns_in_loops(graph: Contracted, joint_nodes: frozenset[int], words: Sequence[Word], kind: ChainKind) -> bool:
    """Whether a planar chain turns: with fewer than two turns a loop only slides, and is of family 4."""
    if kind.family != 3:  # planar
        return True
    turns = np.array([sum(any(f.turns for f in kind.types[i].freedoms) for i in word) for word in words])
    sets, loops, touched = graph.rings
    in_loop = sets @ turns - touched[:, sorted(joint_nodes)].sum(axis=1)
    return bool((in_loop[loops == 1] >= 2).all())


# --- the chain -------------------------------------------------------------------------------------------------------


def _chain(graph: Contracted, joint_nodes: frozenset[int], words: Iterable[Word], kind: ChainKind) -> Chain:
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
        for (one, other), row in zip(pairwise(path), word, strict=True):
            if one is not None and other is not None:
                joints.append((one, other))
                types.append(kind.types[row].symbol)
        for node, end in ((u, path[1]), (v, path[-2])):
            if node in at_joint and end is not None:
                at_joint[node].append(end)
    pin = next((t.symbol for t in kind.types if t.f == 1 and t.freedoms[0].turns), "")
    joints += [tuple(members) for members in at_joint.values()]
    types += [pin] * len(at_joint)
    return Chain(links, tuple(joints), tuple(types), kind.family)
