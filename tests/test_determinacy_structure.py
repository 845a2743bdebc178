"""What the graph alone decides: generic rank, places of structural excess, matching and its parts, against brute force."""

from __future__ import annotations

from itertools import product

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mechgraph as mg

TYPES = ("R", "P", "C", "S", "E", "U", "W", "Sp", "Sg")


def random_topology(seed: int, links: int, chords: int, letters: list[str]) -> mg.Mechanism:
    rng = np.random.default_rng(seed)
    ends = [(int(rng.integers(0, i)), i) for i in range(1, links)]
    for _ in range(chords):
        a, b = rng.choice(links, 2, replace=False)
        ends.append((int(a), int(b)))
    pairs = [mg.Pair(f"O{k}", letters[k % len(letters)], f"link{a}", f"link{b}") for k, (a, b) in enumerate(ends)]
    return mg.Mechanism("random topology", [mg.Link(f"link{i}") for i in range(links)], pairs)


def bipartite(m: mg.Mechanism) -> tuple[nx.Graph, set[object], set[object]]:
    """One node an unknown, one an equation, an edge where the unknown can serve the equation."""
    graph: nx.Graph = nx.Graph()
    unknowns = {("u", p.name, i) for p in m.pairs for i in range(6 - p.type.f)}
    unknowns |= {("u", m.pairs[m.freedom(d.freedom)[0]].name, "effort") for d in m.drives}
    equations = {("e", link.name, i) for link in m.links if link.name != m.frame for i in range(6)}
    graph.add_nodes_from(unknowns)
    graph.add_nodes_from(equations)
    ends = {p.name: (p.a, p.b) for p in m.pairs}
    graph.add_edges_from((u, e) for u, e in product(unknowns, equations) if e[1] in ends[u[1]])
    return graph, unknowns, equations


def reachable(graph: nx.Graph, matching: dict[object, object], starts: set[object]) -> set[object]:
    """Nodes on alternating paths from unmatched ``starts``."""
    seen, front = set(starts), list(starts)
    while front:
        u = front.pop()
        for e in graph[u]:
            if e not in seen:
                seen.add(e)
                mate = matching.get(e)
                if mate is not None and mate not in seen:
                    seen.add(mate)
                    front.append(mate)
    return seen


@given(
    seed=st.integers(0, 10**6),
    links=st.integers(2, 5),
    chords=st.integers(0, 3),
    letters=st.lists(st.sampled_from(TYPES), min_size=1, max_size=7),
)
def test_parts_against_a_matching_of_single_unknowns(seed: int, links: int, chords: int, letters: list[str]) -> None:
    m = random_topology(seed, links, chords, letters)
    found = mg.check(m).parts
    graph, unknowns, equations = bipartite(m)
    matching = nx.bipartite.hopcroft_karp_matching(graph, top_nodes=unknowns)
    over = reachable(graph, matching, {u for u in unknowns if u not in matching})
    under = reachable(graph, matching, {e for e in equations if e not in matching})
    assert found.structural_rank == len(matching) // 2
    assert found.spare_unknowns == len(unknowns) - found.structural_rank
    assert found.spare_equations == len(equations) - found.structural_rank
    assert set(found.redundant_pairs) == {n[1] for n in over if n[0] == "u"}
    assert set(found.redundant_links) == {n[1] for n in over if n[0] == "e"}
    assert set(found.free_links) == {n[1] for n in under if n[0] == "e"}
    assert set(found.free_pairs) == {n[1] for n in under if n[0] == "u"}


@given(
    seed=st.integers(0, 10**6),
    links=st.integers(2, 6),
    chords=st.integers(1, 3),
    letters=st.lists(st.sampled_from(TYPES), min_size=1, max_size=7),
)
def test_generic_rank_against_random_placements(seed: int, links: int, chords: int, letters: list[str]) -> None:
    """The rank of random geometry declared as a mechanism; the excess is shared out over the places."""
    m = random_topology(seed, links, chords, letters)
    found = mg.check(m).generic
    rng = np.random.default_rng(seed)
    placed = [
        p.replace(
            point=rng.normal(size=3), axis=(axis := rng.normal(size=3)), second=np.cross(axis, rng.normal(size=3))
        )
        for p in m.pairs
    ]
    report = mg.check(m.replace(pairs=placed))
    assert report.mobility == found.mobility
    assert report.redundancy == found.excess
    assert sum(n for n, _ in found.places) == found.excess


@pytest.mark.parametrize(
    ("letters", "excess", "mobility"),
    [("RRRR", 2, 0), ("RRRRRRR", 0, 1), ("PPPP", 3, 1), ("PPP", 3, 0), ("RSSR", 0, 2), ("RCSR", 0, 1), ("RRS", 1, 0)],
)
def test_single_loops(letters: str, excess: int, mobility: int) -> None:
    """Prismatic pairs alone never reach the three turning equations, whatever their directions."""
    report = mg.check(mg.chain(letters))
    assert (report.generic.excess, report.generic.mobility) == (excess, mobility)
    assert report.mobility is None
    assert not report.determinate


def test_verdicts_of_topologies() -> None:
    assert "determinate for general geometry" in mg.check(mg.chain("RCSR")).verdict
    assert "2 redundant in the loop O1-O2-O3-O4 whatever the dimensions" in mg.check(mg.chain("RRRR")).verdict
    assert "1 freedom not driven" in mg.check(mg.chain("RSSR")).verdict
    assert "too many" in mg.check(mg.chain("RCSR").replace(drives=["O1", "O4"])).verdict


def test_excess_is_placed_in_its_loop() -> None:
    """A planar four-bar beside a spatial loop: the excess is in the four-bar."""
    pairs = [mg.Pair(n, "R", a, b) for n, a, b in [("A", "f", "1"), ("B", "1", "2"), ("C", "2", "3"), ("D", "3", "f")]]
    pairs += [mg.Pair("E", "S", "3", "4"), mg.Pair("F", "S", "4", "5"), mg.Pair("G", "R", "5", "f")]
    report = mg.check(mg.Mechanism("two loops", None, pairs))
    assert [(n, loops) for n, loops in report.generic.places] == [(2, (0,))]
    assert {name for name, _ in report.loops[0]} == set("ABCD")


def test_a_driven_dyad_is_free_and_a_closed_frame_is_over() -> None:
    """Dulmage-Mendelsohn parts name links and pairs: a welded triangle over, a pendulum under."""
    pairs = [
        mg.Pair("A", "W", "f", "1"),
        mg.Pair("B", "W", "1", "2"),
        mg.Pair("C", "W", "2", "f"),
        mg.Pair("D", "R", "2", "3"),
    ]
    parts = mg.check(mg.Mechanism("frame and pendulum", None, pairs)).parts
    assert set(parts.redundant_pairs) == {"A", "B", "C"}
    assert parts.spare_unknowns == 6
    assert parts.free_links == ("3",)
    assert parts.spare_equations == 1
