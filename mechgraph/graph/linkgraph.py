"""The link graph in an order fixed by the declaration, the walk along its tree, its parts, and the matching of unknowns to equations.

Along the spanning tree: poses and sums from the frame outwards, loads from the leaves inwards, for every link at once.

``Tree`` goes from link to link; ``Walk`` goes through every factor of the pairs, along the tree and once across every chord.
A tree of few levels is run through level by level. In a deep one (a chain of many loops) every link reaches its ancestors by
pointer doubling: after step ``s`` it knows the way to its ancestor ``2^s`` levels down, so that the logarithm of the depth counts.
Source: Jaja, An Introduction to Parallel Algorithms, 1992, section 2.2 (pointer jumping).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import chain, pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.errors import counted
from mechgraph.maths.linear import Place, add_at, compact, scattered_sum
from mechgraph.maths.se3 import IN_PLANE, IN_SPACE, Array, Index, compose, multiplied
from mechgraph.memo import dataclass, of_graph
from mechgraph.model.declaration import DeclaredParts

if TYPE_CHECKING:
    import networkx as nx


def components_of_edges(count: int, ends: Sequence[tuple[int, int]] | NDArray[np.intp]) -> Index:
    """For each of ``count`` nodes the number of its component, counted from the first node on."""
    a, b = np.asarray(ends, dtype=np.intp).reshape(-1, 2).T
    graph = scipy.sparse.csr_array((np.ones(len(a)), (a, b)), shape=(count, count))
    return component_numbers(scipy.sparse.csgraph.connected_components(graph, directed=False)[1])


def labels_of_bipartite(touch: scipy.sparse.csr_array | scipy.sparse.coo_array) -> Index:
    """For every row of ``touch`` the number of its component: rows that share a column belong together."""
    coo = touch.tocoo()
    rows, columns = (int(n) for n in touch.shape)
    ends = np.stack([coo.row, rows + coo.col], axis=1).astype(np.intp)
    return component_numbers(components_of_edges(rows + columns, ends)[:rows])


def component_numbers(labels: NDArray[np.signedinteger]) -> Index:
    """Labels renumbered in the order in which they appear."""
    _, first, inverse = np.unique(labels, return_index=True, return_inverse=True)
    number = np.empty(len(first), dtype=np.intp)
    number[np.argsort(first)] = np.arange(len(first))
    return number[inverse]


def members(numbers: Index) -> list[list[int]]:
    """The nodes of every component."""
    if not len(numbers):
        return []
    order = np.argsort(numbers, kind="stable")
    return [part.tolist() for part in np.split(order, np.flatnonzero(np.diff(numbers[order])) + 1)]


Loop = tuple[tuple[int, int], ...]
"""A loop as (pair index, sign) in the order in which it is run through."""


@dataclass(frozen=True, eq=False, repr=False)
class LinkGraph:
    """The graph of a mechanism: links are nodes, pairs are edges; several pairs may join the same two links.

    Attributes
    ----------
    a, b : link indices ``(P,)`` of every pair.
    frame : index of the frame link.
    steps : rows (pair, sign, parent, child) of the spanning tree, breadth first from the frame; sign +1 where the pair leads
        from parent to child.
    chords : the pairs outside the tree, one a loop.
    loop_steps : a short cycle basis; loop, pair and sign of all steps of all loops, one after the other.
    planar : whether loops close, and links are in balance, in the x-y plane alone.
    """

    n_links: int
    a: Index
    b: Index
    frame: int
    steps: Index
    chords: Index
    loop_steps: tuple[Index, Index, NDArray[np.float64]]
    planar: bool = False

    def __repr__(self) -> str:
        return f"LinkGraph({self.n_links} links, {len(self.a)} pairs, {counted(self.n_loops, 'loop')})"

    @property
    def n_loops(self) -> int:
        """Number of loops."""
        return len(self.chords)

    @property
    def span(self) -> slice:
        """The components of a twist that every loop closes, of a wrench that every link balances: all six, or Rz Tx Ty (Mz Fx Fy)."""
        return IN_PLANE if self.planar else IN_SPACE

    @property
    def width(self) -> int:
        """Number of closure rows of a loop, and of equations of a link: 6, in the plane 3."""
        return int(self.span.stop - self.span.start)

    @property
    def turns(self) -> int:
        """How many of them are turns (moments): 3, in the plane 1; they stand first."""
        return 3 - int(self.span.start)

    @property
    def loop_rows(self) -> int:
        """Number of closure rows of all loops."""
        return self.width * self.n_loops

    @cached_property
    def ends(self) -> tuple[tuple[int, int], ...]:
        """(a, b) link indices of every pair, to go through one by one."""
        return tuple(zip(self.a.tolist(), self.b.tolist(), strict=True))

    @cached_property
    def tree(self) -> tuple[tuple[int, int, int, int], ...]:
        """The rows of ``steps``, to go through one by one."""
        return tuple((k, sign, parent, child) for k, sign, parent, child in self.steps.tolist())

    @cached_property
    def loops(self) -> tuple[Loop, ...]:
        """The loops, to go through one by one."""
        loop, pair, sign = self.loop_steps
        steps = list(zip(pair.tolist(), sign.astype(int).tolist(), strict=True))
        cuts = np.searchsorted(loop, np.arange(self.n_loops + 1)).tolist()
        return tuple(tuple(steps[i:j]) for i, j in pairwise(cuts))

    @property
    def incidence(self) -> NDArray[np.float64]:
        """Incidence matrix, moving links x pairs: +1 where the pair acts on the link as its second, -1 as its first."""
        A = np.zeros((self.n_links, len(self.a)))
        every = np.arange(len(self.a))
        A[self.b, every] = 1.0
        A[self.a, every] = -1.0
        return np.delete(A, self.frame, axis=0)

    @cached_property
    def sparse_loop_matrix(self) -> scipy.sparse.csr_array:
        """The loop matrix, loops x pairs, stored sparsely."""
        loop, pair, sign = self.loop_steps
        return scipy.sparse.csr_array((sign, (loop, pair)), shape=(self.n_loops, len(self.a)))

    @cached_property
    def pairs_of_loops(self) -> scipy.sparse.csr_array:
        """Its transpose, pairs x loops."""
        return scipy.sparse.csr_array(self.sparse_loop_matrix.T)

    @cached_property
    def step_after(self) -> Index:
        """For every step of the loops, one behind the other, the next one of its loop, or the first: their pairs share a link."""
        loop = self.loop_steps[0]
        return np.where(np.append(loop[1:], -1) == loop, np.arange(len(loop)) + 1, np.searchsorted(loop, loop))

    @cached_property
    def loop_averages(self) -> scipy.sparse.csr_array:
        """Means over the pairs of every loop, loops x pairs."""
        loop, pair, _ = self.loop_steps
        share = 1.0 / np.bincount(loop, minlength=self.n_loops)[loop]
        return scipy.sparse.csr_array((share, (loop, pair)), shape=(self.n_loops, len(self.a)))

    @property
    def loop_matrix(self) -> NDArray[np.float64]:
        """Loop matrix, loops x pairs: sign with which a loop runs through a pair, 0 elsewhere. A C^T = 0."""
        loop, pair, sign = self.loop_steps
        C = np.zeros((self.n_loops, len(self.a)))
        C[loop, pair] = sign
        return C


def network(m: DeclaredParts) -> nx.MultiGraph[str]:
    """The mechanism as a networkx multigraph; edge keys are pair names, nodes and edges carry ``link`` and ``pair``."""
    import networkx as nx

    graph: nx.MultiGraph[str] = nx.MultiGraph(name=m.name)
    for link in m.links:
        graph.add_node(link.name, link=link)
    for pair in m.pairs:
        graph.add_edge(pair.a, pair.b, key=pair.name, pair=pair)
    return graph


@of_graph
def link_graph(m: DeclaredParts) -> LinkGraph:
    """Tree, chords and loops of a mechanism."""
    return _graph(len(m.links), *m.pair_ends, m.link_index[m.frame], m.planar)


def graph_of_ends(n_links: int, ends: Sequence[tuple[int, int]], frame: int) -> LinkGraph:
    """Tree, chords and loops of a connected graph given by the ends of its edges."""
    a, b = np.array(ends, dtype=np.intp).reshape(-1, 2).T
    return _graph(n_links, a, b, frame)


def _graph(n_links: int, a: Index, b: Index, frame: int, planar: bool = False) -> LinkGraph:
    edges = _Edges(n_links, a, b)
    depth = [-1] * n_links
    depth[frame] = 0
    reached: list[int] = [frame]
    through: list[int] = []
    for parent in reached:  # the list grows while it is run through
        for k in edges.at(parent):
            child = edges.both[k] - parent
            if depth[child] < 0:
                depth[child] = depth[parent] + 1
                reached.append(child)
                through.append(k)
    tree, below = np.array(through, dtype=np.intp), np.array(reached[1:], dtype=np.intp)
    steps = np.stack([tree, np.where(b[tree] == below, 1, -1), a[tree] + b[tree] - below, below], axis=1)
    chords = np.delete(np.arange(len(a)), tree)
    height = np.array(depth)
    closing = chords[np.argsort(height[a[chords]] + height[b[chords]], kind="stable")]
    return LinkGraph(n_links, a, b, frame, steps, chords, _short_loops(n_links, a, b, tree, closing), planar)


class _Edges:
    """Edges ``(a, b)`` in an order, and at every node the numbers of its edges in that order."""

    def __init__(self, n_nodes: int, a: Index, b: Index) -> None:
        ends = np.stack([a, b], axis=1).ravel()
        self.both: list[int] = (a + b).tolist()
        self.numbers: list[int] = (np.argsort(ends, kind="stable") // 2).tolist()
        self.begin: list[int] = np.concatenate([[0], np.cumsum(np.bincount(ends, minlength=n_nodes))]).tolist()

    def at(self, node: int) -> list[int]:
        """Edges at a node."""
        return self.numbers[self.begin[node] : self.begin[node + 1]]


def _short_loops(
    n_links: int, a: Index, b: Index, tree: Index, closing: Index
) -> tuple[Index, Index, NDArray[np.float64]]:
    """One loop a chord: the chord and a shortest path in the tree with the chords before it; as ``LinkGraph.loop_steps``.

    Chords come by the depth of their ends (``closing``), so that the cells of a lattice close one after the other and stay small.
    Every loop has a chord that no earlier loop has, so they are independent. A step is held as ``2 pair + forward``.
    """
    order = np.concatenate([tree, closing])
    edges = _Edges(n_links, a[order], b[order])
    tails, heads, forward = a[order].tolist(), b[order].tolist(), (2 * order + 1).tolist()
    loops = []
    for chord in range(len(tree), len(order)):
        path = _shortest_path(edges, heads[chord], tails[chord], chord)
        steps = [forward[k] if tails[k] == node else forward[k] - 1 for k, node in path]
        loops.append(_oriented([forward[chord], *steps]))
    loops.sort(key=lambda loop: (loop[0], len(loop), loop))
    run = np.fromiter(chain.from_iterable(loops), np.intp)
    loop = np.repeat(np.arange(len(loops)), np.fromiter(map(len, loops), np.intp, len(loops)))
    return loop.astype(np.intp), (run >> 1).astype(np.intp), np.where(run & 1, 1.0, -1.0)


def _shortest_path(edges: _Edges, start: int, goal: int, limit: int) -> list[tuple[int, int]]:
    """Edges, each with the node from which it is run through, of a shortest path along edges before ``limit``.

    Searched from both ends, from the one with the fewer new nodes next; ties go to the earlier edge.
    """
    both, numbers, begin = edges.both, edges.numbers, edges.begin
    mine, theirs, front, others = {start: -1}, {goal: -1}, [start], [goal]  # node -> edge that led there
    from_start = True
    while True:
        if len(front) > len(others) or (len(front) == len(others) and not from_start):
            mine, theirs, front, others, from_start = theirs, mine, others, front, not from_start
        following: list[int] = []
        for node in front:
            for k in numbers[begin[node] : begin[node + 1]]:
                if k >= limit:
                    break
                other = both[k] - node
                if other in mine:
                    continue
                mine[other] = k
                if other in theirs:
                    return _joined(both, other, *((mine, theirs) if from_start else (theirs, mine)))
                following.append(other)
        front = following


def _joined(both: list[int], meet: int, back: dict[int, int], ahead: dict[int, int]) -> list[tuple[int, int]]:
    """The path through the node where the searches from the start and from the goal met."""
    path: list[tuple[int, int]] = []
    node = meet
    while (k := back[node]) >= 0:
        node = both[k] - node
        path.append((k, node))
    path.reverse()
    node = meet
    while (k := ahead[node]) >= 0:
        path.append((k, node))
        node = both[k] - node
    return path


def _oriented(loop: list[int]) -> tuple[int, ...]:
    """The loop begun at its first declared pair, run through from that pair's a to its b."""
    first = min(loop)
    at = loop.index(first)
    if first & 1:
        return (*loop[at:], *loop[:at])
    return tuple([step ^ 1 for step in (loop[at::-1] + loop[:at:-1])])


Level = tuple[Index, NDArray[np.bool_], Index, Index]

Step = tuple[Place, NDArray[np.bool_] | None, Place, Place]

DEEP = 200
"""Levels above which the tree is run through by pointer doubling."""


class Tree:
    """The spanning tree of a graph as arrays; level ``(pairs, forward, parents, children)``, ``forward`` from a to b."""

    def __init__(self, graph: LinkGraph) -> None:
        self.n_links, self.frame = graph.n_links, graph.frame
        self.pairs, sign, self.parents, self.children = graph.steps.T
        self.forward = sign > 0
        depth = np.zeros(self.n_links, dtype=np.intp)
        for parent, child in zip(self.parents.tolist(), self.children.tolist(), strict=True):
            depth[child] = depth[parent] + 1
        ends = np.searchsorted(depth[self.children], np.arange(1, depth.max(initial=0) + 2))
        spans = [slice(int(i), int(j)) for i, j in pairwise(ends)]
        parts = (self.pairs, self.forward, self.parents, self.children)
        self.levels: list[Level] = [tuple(part[span] for part in parts) for span in spans]
        self.deep = len(self.levels) > DEEP

    @cached_property
    def _walk(self) -> list[Step]:
        """The levels with indices that take no copy where they can; ``forward`` is None where all lead outwards."""
        return [
            (compact(pairs), None if forward.all() else forward, compact(parents), compact(children))
            for pairs, forward, parents, children in self.levels
        ]

    @property
    def _whole(self) -> Step:
        """All pairs of the tree in one step."""
        return self.pairs, self.forward, self.parents, self.children

    @cached_property
    def _jumps(self) -> list[Index]:
        """Ancestor of every link after 1, 2, 4, ... levels; the frame stands for all that lie beyond."""
        ancestor = np.full(self.n_links, self.frame, dtype=np.intp)
        ancestor[self.children] = self.parents
        return _doubled(ancestor, self.frame)

    def sums(self, relative: Array) -> Array:
        """Sums ``(6, N, T)`` of pair terms ``(6, P, T)`` from the frame to every link, with the sense of the way."""
        out = np.zeros((6, self.n_links, relative.shape[2]), dtype=relative.dtype)
        if not self.deep:
            for pairs, forward, parents, children in self._walk:
                step = relative[:, pairs]
                if forward is not None:
                    step = np.where(forward[:, None], 1.0, -1.0) * step
                out[:, children] = out[:, parents] + step
            return out
        out[:, self.children] = np.where(self.forward[:, None], 1.0, -1.0) * relative[:, self.pairs]
        for ancestor in self._jumps:
            out = out + out[:, ancestor]
        return out

    def carried(self, loads: Array) -> Array:
        """Sums ``(6, N, T)`` of the loads of every link and of all links behind it; the transpose of ``sums``."""
        out = loads.copy()
        if not self.deep:
            for _, _, parents, children in reversed(self._walk):
                if isinstance(parents, slice):
                    out[:, parents] += out[:, children]
                else:
                    add_at(out, parents, out[:, children])
            return out
        for ancestor in reversed(self._jumps):
            moving = out.copy()
            moving[:, ancestor == self.frame] = 0.0
            out = out + scattered_sum(moving, ancestor, self.n_links)
        out[:, self.frame] = loads.sum(axis=1)
        return out

    def wrenches(self, loads: Array, n_pairs: int) -> Array:
        """Pair wrenches ``(6, P, T)`` that carry the loads along the tree, chords free."""
        out = np.zeros((6, n_pairs, loads.shape[2]), dtype=loads.dtype)
        carried = self.carried(loads)
        for pairs, forward, _, children in [self._whole] if self.deep else self._walk:
            step = carried[:, children]
            out[:, pairs] = -step if forward is None else np.where(forward[:, None], -1.0, 1.0) * step
        return out


def _doubled(ancestor: Index, root: int) -> list[Index]:
    """Ancestors after 1, 2, 4, ... steps, until all have come to the root."""
    out = []
    while (ancestor != root).any():
        out.append(ancestor)
        ancestor = ancestor[ancestor]
    return out


class Walk:
    """The way from the frame through every factor of the pairs: a tree whose nodes are frames.

    A pair of the spanning tree takes as many steps as it has factors (one where it has none), each over one factor, against its
    direction (``back``) where the tree leads from b to a. A chord is walked from its link a and ends in a node of its own: the
    frame of its link b as it is reached through the chord. Node 0 is the frame link, step ``i`` leads to node ``i + 1``; steps
    come in the order of their levels, so that a level is one run of steps and of nodes.

    Attributes
    ----------
    parents, pair, rank, back : for every step the node from which it starts, its pair, the number of its factor in that pair
        and whether the factor is run through backwards.
    link_node, end_node : node of every link; node in which every pair ends at its link b, the own node for a chord.
    first : for every pair the first of its factors in ``step_of``, which lists the steps pair by pair, factor by factor.
    """

    def __init__(self, tree: Tree, ends: tuple[Index, Index], chords: Index, counts: Index) -> None:
        pairs = np.concatenate([tree.pairs, chords])
        back = np.concatenate([~tree.forward, np.zeros(len(chords), dtype=bool)])
        origin = np.concatenate([tree.parents, ends[0][chords]])
        depth = np.zeros(tree.n_links, dtype=np.intp)
        for through, _, parents, children in tree.levels:
            depth[children] = depth[parents] + counts[through]
        n = counts[pairs]
        owner, within = _runs(n)
        level = depth[origin][owner] + within
        order = np.argsort(level, kind="stable")
        node = np.empty(len(order), dtype=np.intp)
        node[order] = np.arange(1, len(order) + 1)
        last = node[np.cumsum(n) - 1]
        self.link_node = np.zeros(tree.n_links, dtype=np.intp)
        self.link_node[tree.children] = last[: len(tree.pairs)]
        self.end_node = self.link_node[ends[1]]
        self.end_node[chords] = last[len(tree.pairs) :]
        parents = np.where(within == 0, self.link_node[origin][owner], np.roll(node, 1))
        rank = np.where(back[owner], n[owner] - 1 - within, within)
        self.parents, self.pair, self.rank, self.back = (a[order] for a in (parents, pairs[owner], rank, back[owner]))
        self.first = np.cumsum(counts) - counts
        self.step_of = np.empty(len(order), dtype=np.intp)
        self.step_of[self.first[self.pair] + self.rank] = np.arange(len(order))
        self.levels = self._levels(level[order])
        self.n_first = int((level == 0).sum())

    def _levels(self, level: Index) -> list[tuple[Place, slice, slice]]:
        """For every level the nodes from which its steps start, the steps, and the nodes to which they lead."""
        ends = np.searchsorted(level, np.arange(level.max(initial=-1) + 2))
        return [
            (compact(self.parents[i:j]), slice(int(i), int(j)), slice(int(i) + 1, int(j) + 1))
            for i, j in pairwise(ends)
        ]

    def node_before(self, pairs: Index, rank: Index | int) -> Index:
        """Nodes of the frames before the factors of given ranks of pairs."""
        step = self.step_of[self.first[pairs] + rank]
        return np.where(self.back[step], step + 1, self.parents[step])

    @cached_property
    def _jumps(self) -> list[Index]:
        return _doubled(np.concatenate([[0], self.parents]), 0)

    def poses(self, relative: Array, frame: Array) -> Array:
        """Poses ``(3, 4, nodes, T)`` from those of the steps, homogeneous ``(4, 4, steps, T)``.

        ``frame (3, 4, 1)`` is the pose of node 0; the steps from there contain it already.
        """
        n, T = relative.shape[2:]
        X = np.empty((3, 4, n + 1, T), dtype=relative.dtype)
        if len(self.levels) > DEEP:
            X[:, :, 1:] = relative[:3]
            X[:, :, 0] = np.eye(3, 4)[:, :, None]
            for ancestor in self._jumps:
                X = compose(X[:, :, ancestor], X)
            X[:, :, 0] = frame
            return X
        X[:, :, 0] = frame
        X[:, :, 1 : self.n_first + 1] = relative[:3, :, : self.n_first]
        for parents, steps, nodes in self.levels[1:]:
            before = X[:, :, parents]
            multiplied(before[:, :3], relative[:3, :, steps], out=X[:, :, nodes])
            X[:, 3, nodes] += before[:, 3]
        return X


def _runs(counts: Index) -> tuple[Index, Index]:
    """For runs of given lengths, one after the other: the number of the run of every place, and the place in it."""
    owner = np.repeat(np.arange(len(counts)), counts)
    return owner, np.arange(len(owner)) - (np.cumsum(counts) - counts)[owner]


Ranks = list[tuple[Place, Place]]


def ranked(counts: Index) -> Ranks:
    """For runs of given lengths: the runs that have a first, second, ... place, and that place."""
    first = np.cumsum(counts) - counts
    owners = [np.flatnonzero(counts > r) for r in range(int(counts.max(initial=0)))]
    return [(compact(who), compact(first[who] + r)) for r, who in enumerate(owners)]


def run_sums(terms: Array, ranks: Ranks, n: int) -> Array:
    """Sums over runs: ``(6, places, T)`` -> ``(6, n, T)``."""
    out = np.zeros((6, n, terms.shape[2]), dtype=terms.dtype)
    for r, (owners, places) in enumerate(ranks):
        if r == 0:
            out[:, owners] = terms[:, places]
        else:
            out[:, owners] += terms[:, places]
    return out


@dataclass(frozen=True)
class Entries:
    """The nonzero 6-vectors of the closure Jacobian: loop, column and sign of each, loop by loop."""

    loop: Index
    column: Index
    sign: Array
    first: Index
    width: int = 6

    @cached_property
    def loops(self) -> Place:
        """The loops; of one loop alone, one place for all."""
        return self.loop if len(self.first) > 2 else slice(0, 1)

    @cached_property
    def signs(self) -> Array:
        """The signs, ``(entries, 1)``."""
        return self.sign[:, None]

    def places(self, n_columns: int) -> Index | None:
        """Places ``(width, entries)`` of the entries in a matrix with ``width`` rows a loop; None where they fill one loop in order."""
        if len(self.first) == 2 and np.array_equal(self.column, np.arange(n_columns)):
            return None
        return (self.width * self.loop + np.arange(self.width)[:, None]) * n_columns + self.column


def entries_of(graph: LinkGraph, first_column: Index) -> Entries:
    """All (loop, column) places of the closure Jacobian of a graph whose pairs have their freedoms from ``first_column`` on."""
    loop, pair, sign = graph.loop_steps
    width = np.diff(first_column)[pair]
    step = np.repeat(np.arange(len(loop)), width)
    within = np.arange(len(step)) - np.repeat(np.cumsum(width) - width, width)
    first = np.searchsorted(loop[step], np.arange(graph.n_loops + 1))
    return Entries(loop[step], first_column[pair[step]] + within, sign[step], first.astype(np.intp), graph.width)


@dataclass(frozen=True)
class GraphParts:
    """Dulmage-Mendelsohn parts of the force equations.

    Attributes
    ----------
    structural_rank : size of the largest matching of unknowns to equations.
    redundant_links, redundant_pairs : the part with more reaction unknowns than equations (reactions not unique).
    free_links, free_pairs : the part with more equations than unknowns (something can move undriven).
    spare_unknowns, spare_equations : how many are left over in these parts.
    """

    structural_rank: int
    redundant_links: tuple[str, ...]
    redundant_pairs: tuple[str, ...]
    free_links: tuple[str, ...]
    free_pairs: tuple[str, ...]
    spare_unknowns: int
    spare_equations: int


def parts_of(m: DeclaredParts, graph: LinkGraph) -> GraphParts:
    """Matching and parts from the graph and the freedoms of the pairs, by maximum flow from unknowns to equations."""
    P, N = len(m.pairs), graph.n_links
    width = graph.width
    supply = np.array([width - p.type.f for p in m.pairs], dtype=np.intp)
    np.add.at(supply, [m.freedom(drive.freedom)[0] for drive in m.drives], 1)
    pair = np.repeat(np.arange(P), 2)
    link = np.stack([graph.a, graph.b], axis=1).ravel()
    moving = link != graph.frame
    pair, link = pair[moving], link[moving]
    links = np.delete(np.arange(N), graph.frame)
    source, sink = P + N, P + N + 1
    rows = np.concatenate([np.full(P, source), pair, P + links])
    columns = np.concatenate([np.arange(P), P + link, np.full(len(links), sink)])
    capacity = np.concatenate([supply, np.full(len(pair), 2 * width), np.full(len(links), width)]).astype(np.int32)
    network = scipy.sparse.csr_array((capacity, (rows, columns)), shape=(P + N + 2, P + N + 2))
    result = scipy.sparse.csgraph.maximum_flow(network, source, sink)
    flow = scipy.sparse.csr_array(result.flow)
    used, filled = flow[[source]].toarray()[0, :P], flow[:, [sink]].toarray()[P : P + N, 0]
    serves = np.asarray(flow[pair, P + link]).ravel() > 0
    everywhere, back = (pair, P + link), (P + link[serves], pair[serves])
    over = _alternating(P + N, everywhere, back, np.flatnonzero(used < supply))
    under = _alternating(P + N, everywhere[::-1], back[::-1], P + links[filled[links] < width])
    names, pair_names = m.link_names(), [p.name for p in m.pairs]
    return GraphParts(
        structural_rank=int(result.flow_value),
        redundant_links=tuple(names[i - P] for i in over if i >= P),
        redundant_pairs=tuple(pair_names[k] for k in over if k < P),
        free_links=tuple(names[i - P] for i in under if i >= P),
        free_pairs=tuple(pair_names[k] for k in under if k < P),
        spare_unknowns=int((supply - used).sum()),
        spare_equations=int(width * len(links) - filled.sum()),
    )


def _alternating(count: int, out: tuple[Index, Index], back: tuple[Index, Index], starts: Index) -> list[int]:
    """Nodes on alternating paths from ``starts``: outwards along every edge, back along those that the matching uses."""
    rows, columns = (np.concatenate([a, b]) for a, b in zip(out, back, strict=True))
    graph = scipy.sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(count, count))
    steps = (
        scipy.sparse.csgraph.dijkstra(graph, indices=starts, unweighted=True, min_only=True) if starts.size else np.inf
    )
    return np.flatnonzero(np.broadcast_to(np.isfinite(steps), count)).tolist()
