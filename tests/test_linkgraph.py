"""Identities of the link graph: incidence, tree, loops, order."""

from itertools import pairwise, permutations

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mechgraph as mg
from mechgraph.graph.chains import contracted_graphs, least_orders, symmetries
from mechgraph.graph.linkgraph import graph_of_ends, link_graph, network
from mechgraph.kinematics.system import indexed

SEEDS = st.integers(0, 2**32 - 1)


def random_ends(seed):
    """A connected multigraph without edges from a node to itself, in random order and direction."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 12))
    graph = nx.random_labeled_tree(n, seed=int(rng.integers(2**31)))
    ends = [tuple(e) for e in graph.edges]
    for _ in range(int(rng.integers(0, 10))):
        a, b = rng.choice(n, 2, replace=False)
        ends.append((int(a), int(b)))
    ends = [ends[i] if rng.random() < 0.5 else ends[i][::-1] for i in rng.permutation(len(ends))]
    return n, tuple(ends), int(rng.integers(n))


def lattice(n):
    """A grid of n x n square cells: nodes (n + 1)^2."""
    at = lambda i, j: i * (n + 1) + j
    ends = [(at(i, j), at(i, j + 1)) for i in range(n + 1) for j in range(n)]
    ends += [(at(i, j), at(i + 1, j)) for i in range(n) for j in range(n + 1)]
    return (n + 1) ** 2, tuple(ends)


@given(SEEDS)
def test_incidence_times_loop_matrix_transposed_is_zero(seed):
    graph = graph_of_ends(*random_ends(seed))
    np.testing.assert_array_equal(graph.incidence @ graph.loop_matrix.T, 0)


@given(SEEDS)
def test_there_are_pairs_minus_moving_links_independent_loops(seed):
    n, ends, frame = random_ends(seed)
    graph = graph_of_ends(n, ends, frame)
    loops = len(ends) - n + 1
    assert len(graph.loops) == len(graph.chords) == loops
    assert loops == 0 or np.linalg.matrix_rank(graph.loop_matrix) == loops
    assert np.linalg.matrix_rank(graph.incidence) == n - 1


@given(SEEDS)
def test_every_loop_is_a_closed_walk_that_uses_no_pair_and_no_link_twice(seed):
    n, ends, frame = random_ends(seed)
    for loop in graph_of_ends(n, ends, frame).loops:
        walk = [ends[k] if sign > 0 else ends[k][::-1] for k, sign in loop]
        for (_, leaves), (arrives, _) in zip(walk, walk[1:] + walk[:1], strict=True):
            assert leaves == arrives
        assert len({k for k, _ in loop}) == len(loop) == len({a for a, _ in walk})


@given(SEEDS)
def test_the_tree_reaches_every_link_once_parents_first(seed):
    n, ends, frame = random_ends(seed)
    graph = graph_of_ends(n, ends, frame)
    seen = {frame}
    for k, sign, parent, child in graph.tree:
        assert ends[k] == ((parent, child) if sign > 0 else (child, parent))
        assert parent in seen
        assert child not in seen
        seen.add(child)
    assert seen == set(range(n))
    assert sorted([*graph.chords, *(k for k, *_ in graph.tree)]) == list(range(len(ends)))


@given(SEEDS)
def test_loops_span_the_cycle_space_of_networkx(seed):
    n, ends, frame = random_ends(seed)
    graph = nx.MultiGraph()
    graph.add_nodes_from(range(n))
    graph.add_edges_from((a, b, k) for k, (a, b) in enumerate(ends))
    tree = set(nx.minimum_spanning_edges(graph, keys=True, data=False))
    tree_keys = {k for _, _, k in tree}
    forest = nx.Graph([(a, b) for a, b, _ in tree])
    forest.add_nodes_from(range(n))
    rows = []
    for k, (a, b) in enumerate(ends):
        if k in tree_keys:
            continue
        row = np.zeros(len(ends))
        row[k] = 1
        path = nx.shortest_path(forest, b, a)
        for u, v in pairwise(path):
            e = next(i for i in tree_keys if set(ends[i]) == {u, v})
            row[e] = 1 if ends[e] == (u, v) else -1
        rows.append(row)
    mine = graph_of_ends(n, ends, frame).loop_matrix
    assert len(mine) == len(rows)
    if rows:
        assert np.linalg.matrix_rank(np.vstack([mine, rows])) == len(rows)


def test_two_pairs_between_the_same_links_are_one_loop_of_two():
    graph = graph_of_ends(2, ((0, 1), (0, 1)), 0)
    assert graph.loops == (((0, 1), (1, -1)),)
    graph = graph_of_ends(2, ((0, 1), (1, 0), (0, 1)), 1)
    assert [len(loop) for loop in graph.loops] == [2, 2]
    np.testing.assert_array_equal(graph.incidence @ graph.loop_matrix.T, 0)


def test_an_open_chain_has_no_loops():
    graph = graph_of_ends(4, ((0, 1), (2, 1), (1, 3)), 0)
    assert graph.loops == ()
    assert graph.loop_matrix.shape == (0, 3)
    assert len(graph.tree) == 3


@given(SEEDS)
def test_branches_belong_to_no_loop(seed):
    n, ends, frame = random_ends(seed)
    graph = nx.MultiGraph(ends)
    bridges = {tuple(sorted(e)) for e in nx.bridges(nx.Graph(graph)) if graph.number_of_edges(*e) == 1}
    C = graph_of_ends(n, ends, frame).loop_matrix
    for k, e in enumerate(ends):
        if tuple(sorted(e)) in bridges:
            assert not C[:, k].any()
        else:
            assert C[:, k].any()


@given(SEEDS)
def test_loops_do_not_depend_on_the_names_of_the_links(seed):
    n, ends, frame = random_ends(seed)
    rng = np.random.default_rng((seed, 9))
    names = [f"n{i}" for i in rng.permutation(n)]

    def declared(order):
        links = [mg.Link(names[i]) for i in order]
        pairs = [mg.Pair(f"p{k}", "R", names[a], names[b]) for k, (a, b) in enumerate(ends)]
        return link_graph(mg.Mechanism("g", links=links, pairs=pairs, frame=names[frame]))

    reference = graph_of_ends(n, ends, frame)
    assert declared(range(n)).loops == reference.loops
    assert declared(range(n)).tree == reference.tree
    assert declared(rng.permutation(n)).loops == reference.loops


@pytest.mark.parametrize("n", [2, 5, 12])
@pytest.mark.parametrize("frame", ["corner", "middle"])
def test_loops_of_a_lattice_stay_short(n, frame):
    count, ends = lattice(n)
    graph = graph_of_ends(count, ends, 0 if frame == "corner" else count // 2)
    lengths = [len(loop) for loop in graph.loops]
    assert len(lengths) == n * n
    assert max(lengths) <= 8
    assert sum(lengths) <= 5 * n * n
    assert np.linalg.matrix_rank(graph.loop_matrix) == n * n


def test_loops_of_a_lattice_stay_short_in_a_shuffled_declaration():
    count, ends = lattice(8)
    rng = np.random.default_rng(3)
    ends = tuple(ends[i] if rng.random() < 0.5 else ends[i][::-1] for i in rng.permutation(len(ends)))
    lengths = [len(loop) for loop in graph_of_ends(count, ends, 11).loops]
    assert max(lengths) <= 10


def test_report_loops_are_the_graphs_loops_by_name():
    m = mg.chain("RCSR")
    assert mg.check(m).loops == ((("O1", 1), ("O2", 1), ("O3", 1), ("O4", 1)),)


def test_network_is_a_multigraph_with_links_and_pairs_as_data():
    m = mg.Mechanism("two", pairs=[mg.Pair("A", "R", "frame", "door"), mg.Pair("B", "S", "frame", "door")])
    graph = network(m)
    assert graph.number_of_edges("frame", "door") == 2
    assert graph.edges["frame", "door", "B"]["pair"] is m.pair("B")
    assert graph.nodes["door"]["link"] is m.link("door")


def test_what_follows_from_the_graph_alone_is_made_once_for_all_numbers():
    """Start, masses and places of pairs may change; another end or type makes another graph."""
    m = mg.load("four-bar")
    before = indexed(m)
    heavier = [link.replace(mass=2.0 * link.mass) if link.mass else link for link in m.links]
    moved = [pair.replace(point=tuple(2.0 * x for x in pair.point)) if pair.point else pair for pair in m.pairs]
    for other in (
        m.replace(start=dict(m.start)),
        m.replace(links=heavier),
        m.replace(pairs=moved),
        m.replace(tol=1e-6),
    ):
        after = indexed(other)
        assert after.graph is before.graph
        assert all(
            getattr(after, name) is getattr(before, name) for name in ("walk", "batches", "entries", "rotations")
        )
    assert not np.array_equal(indexed(m.replace(pairs=moved)).par.marker_a, before.par.marker_a)
    turned = [m.pairs[0].replace(a=m.pairs[0].b, b=m.pairs[0].a), *m.pairs[1:]]
    assert indexed(m.replace(pairs=turned)).graph is not before.graph
    assert indexed(m.replace(pairs=m.pairs[::-1])).graph is not before.graph
    name = m.pairs[1].name
    assert indexed(m.with_pair_type(name, "S")).graph is not before.graph


# --- chains -------------------------------------------------------------------------------------------------------------


def test_orders_are_those_of_all_symmetries() -> None:
    cube = nx.to_numpy_array(nx.hypercube_graph(3)).astype(int).tolist()
    _, orders = least_orders(cube)
    assert len(orders) == 48
    for p in symmetries(orders):
        assert all(cube[p[u]][p[v]] == cube[u][v] for u in range(8) for v in range(8))


def test_the_least_matrix_does_not_depend_on_the_order_of_nodes() -> None:
    rng = np.random.default_rng(5)
    for seed in range(20):
        A = nx.to_numpy_array(nx.gnm_random_graph(8, 13, seed=seed)).astype(int)
        code, orders = least_orders(A.tolist())
        for _ in range(5):
            p = rng.permutation(8)
            assert least_orders(A[np.ix_(p, p)].tolist())[0] == code
        brute = sum((A[np.ix_(p, p)] == A).all() for p in permutations(range(8))) if seed < 2 else len(orders)
        assert brute == len(orders)


@pytest.mark.parametrize(("loops", "count", "cubic"), [(2, 1, 1), (3, 4, 2), (4, 17, 5), (5, 118, 16)])
def test_contracted_graphs(loops: int, count: int, cubic: int) -> None:
    """Tsai, Mechanism Design, 2001, appendix C: 1, 4 (of them 2 cubic) and 17; Woo 1967."""
    found = list(contracted_graphs(loops))
    assert (len(found), sum(g.nodes == 2 * (loops - 1) for g in found)) == (count, cubic)
    assert all(g.in_one_block for g in found)
