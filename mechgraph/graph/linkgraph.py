"""The link graph in an order fixed by the declaration, its parts, and the matching of unknowns to equations; no geometry."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import chain, pairwise
from typing import TYPE_CHECKING

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.errors import counted
from mechgraph.maths.se3 import IN_PLANE, IN_SPACE
from mechgraph.memo import dataclass, of_graph
from mechgraph.model.mechanism import Mechanism

if TYPE_CHECKING:
    import networkx as nx

Index = NDArray[np.intp]


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


def cut_off(count: int, ends: Sequence[tuple[int, int]], frame: int, cut: Iterable[int]) -> tuple[int, ...]:
    """Nodes that lose the ``frame`` when the edges ``cut`` are taken away."""
    gone = set(cut)
    label = components_of_edges(count, [e for k, e in enumerate(ends) if k not in gone])
    return tuple(np.flatnonzero(label != label[frame]).tolist())


def reached(follows: scipy.sparse.csr_array, starts: Index) -> Index:
    """Nodes that can be reached from any of ``starts`` along the entries (from row to column) of ``follows``."""
    n = follows.shape[0]
    extra = scipy.sparse.coo_array((np.ones(len(starts)), (np.full(len(starts), n), starts)), shape=(n + 1, n + 1))
    whole = scipy.sparse.csr_array(extra + _padded(follows))
    order = scipy.sparse.csgraph.breadth_first_order(whole, n, return_predecessors=False)
    return np.sort(order[order < n]).astype(np.intp)


def _padded(matrix: scipy.sparse.csr_array) -> scipy.sparse.coo_array:
    coo = scipy.sparse.coo_array(matrix)
    n = coo.shape[0] + 1
    return scipy.sparse.coo_array((np.ones(coo.nnz), (coo.row, coo.col)), shape=(n, n))


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


def network(m: Mechanism) -> nx.MultiGraph[str]:
    """The mechanism as a networkx multigraph; edge keys are pair names, nodes and edges carry ``link`` and ``pair``."""
    import networkx as nx

    graph: nx.MultiGraph[str] = nx.MultiGraph(name=m.name)
    for link in m.links:
        graph.add_node(link.name, link=link)
    for pair in m.pairs:
        graph.add_edge(pair.a, pair.b, key=pair.name, pair=pair)
    return graph


@of_graph
def link_graph(m: Mechanism) -> LinkGraph:
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


def parts_of(m: Mechanism, graph: LinkGraph) -> GraphParts:
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
    return reached(scipy.sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(count, count)), starts).tolist()
