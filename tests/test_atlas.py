"""Kinematic chains: their numbers in the literature, brute force, names, inversions; system groups."""

from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest

import mechgraph as mg
from mechgraph import show


@pytest.mark.parametrize(
    ("mobility", "numbers"),
    [
        (1, {4: (1, 0), 6: (2, 0), 8: (16, 0), 10: (230, 0)}),
        (2, {5: (1, 0), 7: (3, 1), 9: (35, 5), 11: (753, 86)}),
        (3, {6: (1, 0), 8: (5, 2), 10: (74, 24)}),
        (0, {3: (1, 0), 5: (1, 0), 7: (3, 0), 9: (28, 0)}),
    ],
)
def test_numbers_of_planar_chains(mobility: int, numbers: dict[int, tuple[int, int]]) -> None:
    for links, expected in numbers.items():
        for fractionated, count in zip((False, True), expected, strict=True):
            found = list(mg.atlas(links, mobility, fractionated=fractionated))
            assert len(found) == count
            assert all(c.mobility == mobility and c.is_fractionated == fractionated for c in found[:100])


def test_twelve_links() -> None:
    assert sum(1 for _ in mg.atlas(links=12, mobility=1)) == 6856


def test_chains_are_different_and_have_no_rigid_part() -> None:
    found = list(mg.atlas(10))
    assert len({c.code for c in found}) == 230
    for c in found[::23]:
        for size in range(2, 10):
            for some in combinations(range(10), size):
                inner = sum(set(joint) <= set(some) for joint in c.joints)
                assert 3 * (size - 1) - 2 * inner >= 1


def brute(links: int, joints: int, mobility: int) -> set[nx.Graph]:
    """Chains of double joints among labeled links, by a test of all parts; one of each class by networkx."""
    kept: dict[str, list[nx.Graph]] = {}
    for edges in combinations(combinations(range(links), 2), joints):
        g = nx.Graph(edges)
        if len(g) < links or min(dict(g.degree).values()) < 2 or not nx.is_biconnected(g):
            continue
        some = (s for k in range(2, links) for s in combinations(range(links), k))
        if any(3 * (len(s) - 1) - 2 * g.subgraph(s).number_of_edges() < 1 for s in some):
            continue
        alike = kept.setdefault(str(sorted(dict(g.degree).values())), [])
        if not any(nx.is_isomorphic(g, h) for h in alike):
            alike.append(g)
    return {g for alike in kept.values() for g in alike}


@pytest.mark.daily(2)
@pytest.mark.parametrize(("links", "mobility"), [(6, 1), (5, 2), (6, 3), (5, 0)])
def test_brute_force_finds_the_same(links: int, mobility: int) -> None:
    joints = (3 * (links - 1) - mobility) // 2
    assert len(brute(links, joints, mobility)) == sum(1 for _ in mg.atlas(links, mobility))


def test_multiple_joints() -> None:
    """Six links: brute force over all sets of links at joints gives four chains, two with multiple joints."""
    found = list(mg.atlas(6, multiple=True))
    sizes = sorted(sorted(map(len, c.joints), reverse=True)[:3] for c in found)
    assert sizes == [[2, 2, 2], [2, 2, 2], [3, 2, 2], [3, 3, 2]]
    assert all(c.mobility == 1 and c.links == 6 and c.pairs == 7 for c in found)
    eight = list(mg.atlas(8, multiple=True))
    assert len({c.code for c in eight}) == len(eight) == 60


def test_pair_types() -> None:
    """With slides: RRRR, RRRP, RRPP, RPRP; loops with fewer than two turns only slide."""
    words = {"".join(sorted(c.types)) for c in mg.atlas(4, types=("R", "P"))}
    assert words == {"RRRR", "PRRR", "PPRR"}
    assert sum(1 for _ in mg.atlas(4, types=("R", "P"))) == 4
    six = list(mg.atlas(6, types=("R", "P")))
    assert len({c.code for c in six}) == len(six) == 53


def test_spatial_rings() -> None:
    """Rings with 7 freedoms, by necklaces: e.g. four pairs of R, C, S with 1 + 1 + 2 + 3 or 1 + 2 + 2 + 2."""
    found = list(mg.atlas(4, family=0, types=("R", "C", "S"), joints=4))
    assert sorted("".join(sorted(c.types)) for c in found) == ["CCCR", "CRRS", "CRRS"]
    assert all(c.mobility == 1 for c in found)


def test_couples_of_fractionated_chains_are_named() -> None:
    (chain,) = mg.atlas(7, 2, fractionated=True)
    assert max(chain.degrees) == 4
    assert mg.identify(chain.mechanism()).name == "fractionated 7-link chain 1 of 1, mobility 2"


@pytest.mark.parametrize(("links", "inversions"), [(4, 1), (6, 5), (8, 71)])
def test_numbers_of_inversions(links: int, inversions: int) -> None:
    """5 of six links, 71 of eight (Tsai, 2001); each link is in one of them."""
    found = [c.inversions for c in mg.atlas(links)]
    assert sum(map(len, found)) == inversions
    assert all(sorted(link for group in one for link in group) == list(range(links)) for one in found)


def test_usual_names() -> None:
    names = {mg.identify(c.mechanism(group[0])).name for c in mg.atlas(6) for group in c.inversions}
    assert names == {"Watt I", "Watt II", "Stephenson I", "Stephenson II", "Stephenson III"}
    assert mg.identify(mg.load("four-bar")).name == "four-bar"
    assert mg.identify(mg.load("7r")).name == "ring of 7 links"
    assert mg.identify(mg.load("windows-2")).name == "Watt II"


def test_names_do_not_depend_on_numbers() -> None:
    rng = np.random.default_rng(3)
    for number, chain in enumerate(mg.atlas(8), start=1):
        p = rng.permutation(8)
        joints = tuple(tuple(int(p[i]) for i in joint) for joint in chain.joints)
        other = mg.Chain(8, tuple(joints[k] for k in rng.permutation(10)), chain.types)
        assert other.code == chain.code
        assert mg.identify(other.mechanism()).name == f"8-link chain {number} of 16, mobility 1"


def test_drivers_up_to_symmetry() -> None:
    i = mg.identify(mg.load("rssr"))
    assert i.drivers == (("A", "D"), ("B", "C"))
    assert i.inversions == (("frame",), ("crank", "rocker"), ("coupler",))
    assert i.text.splitlines()[0] == "four-bar: 4 binary; 1 loop"


def test_planarity_of_the_graph() -> None:
    """Of the chains with ten links some cannot be drawn without crossings; of those with eight all can."""
    assert all(c.is_planar_graph for c in mg.atlas(8))
    assert not all(c.is_planar_graph for c in mg.atlas(10))


def test_saved_and_read_again(tmp_path: Path) -> None:
    file = tmp_path / "chains.jsonl"
    assert mg.save_chains(mg.atlas(8, multiple=True), file) == 60
    assert list(mg.load_chains(file)) == list(mg.atlas(8, multiple=True))
    file.write_text('{"links": 4}\n')
    with pytest.raises(mg.FileError, match="line 1: expected a chain"):
        list(mg.load_chains(file))


@pytest.mark.parametrize(
    ("options", "fault"),
    [
        ({"links": 1.5}, "links = 1.5: expected a whole number from 2"),
        ({"links": 6, "types": ("Q",)}, "types = 'Q': expected symbols of the pair table"),
        ({"links": 6, "types": ("S",)}, "types 'S': has 3 freedoms; a pair of a chain of family 3 has 1 to 2"),
        ({"links": 6, "types": ()}, "types: is empty"),
        ({"links": 6, "family": 9}, "family = 9: expected a whole number from 0 to 5"),
        ({"links": 6, "family": 4, "types": ("S",)}, "types 'S': has 3 freedoms; a pair of a chain of family 4 has 1$"),
    ],
)
def test_what_cannot_be_asked(options: dict[str, object], fault: str) -> None:
    with pytest.raises(mg.DeclarationError, match=fault):
        mg.atlas(**options)  # type: ignore[arg-type]


def test_a_chain_has_no_gears() -> None:
    m = mg.Mechanism(
        "gears",
        pairs=[
            mg.Pair("A", "R", "frame", "one", point=(0, 0, 0), axis=(0, 0, 1)),
            mg.Pair("B", "R", "frame", "two", point=(3, 0, 0), axis=(0, 0, 1)),
        ],
        couplings=[mg.Coupling({"A": 1.0, "B": 2.0}, name="mesh")],
    )
    with pytest.raises(mg.DeclarationError, match=r"family = 7: expected a whole number(.|\n)*couplings mesh"):
        mg.identify(m, 7)
    with pytest.raises(mg.DeclarationError, match="couplings mesh"):
        mg.identify(m)


WS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 20, 30, 40)
TABLE_26 = {
    1: (5, 18, 22, 23, 23, 23, 23, 23, 23, 23, 23, 23, 23, 23),
    2: (5, 30, 62, 76, 82, 84, 85, 85, 85, 85, 85, 85, 85, 85),
    3: (5, 31, 100, 158, 190, 205, 214, 218, 218, 220, 220, 220, 220, 220),
}
"""Table 2.6 of Marghitu's chapter as printed."""
MISPRINTED = {(3, 8): 219}

TABLE_27 = """
0 00006 5, 0 00014 4, 0 00022 3, 0 00030 2, 0 00103 3, 0 00111 2, 0 00200 1, 0 01002 2, 0 01010 1, 0 10001 1,
1 00005 4, 1 00013 3, 1 00021 2, 1 00102 2, 1 00110 1, 1 01001 1, 2 00004 3, 2 00012 2, 2 00020 1, 2 00101 1,
3 00003 2, 3 00011 1, 4 00002 1
"""


@pytest.mark.reference
def test_table_26_of_the_chapter() -> None:
    for contours, row in TABLE_26.items():
        for w, printed in zip(WS, row, strict=True):
            assert sum(1 for _ in mg.system_groups(contours, w)) == MISPRINTED.get((contours, w), printed)
    assert [sum(1 for _ in mg.system_groups(n)) for n in (1, 2, 3)] == [23, 85, 220]


@pytest.mark.reference
def test_table_27_of_the_chapter() -> None:
    rows = [f"{g.family} {''.join(map(str, g.pairs))} {g.links}" for g in mg.system_groups(1)]
    assert sorted(rows) == sorted(row.strip() for row in TABLE_27.replace("\n", " ").split(","))


def test_system_groups_have_mobility_zero() -> None:
    for g in mg.system_groups(4):
        classes = range(g.family + 1, 6)
        assert (6 - g.family) * g.links == sum((j - g.family) * g.pairs[j - 1] for j in classes)
        assert sum(g.pairs) - g.links == g.contours == 4
    with pytest.raises(mg.DeclarationError, match="contours = 0"):
        mg.system_groups(0)


@pytest.mark.slow
def test_a_page_of_the_atlas() -> None:
    """Every chain on axes of its own: as many polygons as links with more than two joints, a circle for each joint."""
    chains = list(mg.atlas(8))
    page = show.draw_chains(chains)
    assert len(page.axes) == 16
    for chain, ax in zip(chains, page.axes, strict=True):
        assert len(ax.patches) == sum(degree > 2 for degree in chain.degrees)
        assert len(ax.lines) == chain.degrees.count(2)
        assert sum(len(joints.get_offsets()) for joints in ax.collections) == len(chain.joints) == 10
    with pytest.raises(mg.DeclarationError, match="0 chains in 6 columns"):
        show.draw_chains([])


def segments(ax: Any) -> list[tuple[np.ndarray, np.ndarray]]:
    """Sides of the links drawn."""
    out = [tuple(line.get_xydata()) for line in ax.lines]
    for polygon in ax.patches:
        out += list(pairwise(polygon.get_xy()))
    return out


def crossings(ax: Any) -> int:
    def side(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
        return float(np.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])))

    count = 0
    for (a, b), (c, d) in combinations(segments(ax), 2):
        if min(np.linalg.norm(x - y) for x in (a, b) for y in (c, d)) > 1e-9:
            count += side(a, b, c) != side(a, b, d) and side(c, d, a) != side(c, d, b)
    return count


@pytest.mark.slow
def test_links_do_not_cross_on_the_page() -> None:
    """Those of up to eight links can all be drawn without crossings; two of the sixteen may keep one."""
    assert [crossings(ax) for ax in show.draw_chains(mg.atlas(6, multiple=True)).axes] == [0, 0, 0, 0]
    left = [crossings(ax) for ax in show.draw_chains(mg.atlas(8)).axes]
    assert sum(left) <= 2


def test_pair_types_are_seen() -> None:
    """A square for a slide, the symbol in a diamond for other types than turns and slides."""
    (ax,) = show.draw_chains([next(c for c in mg.atlas(4, types=("R", "P")) if c.types.count("P") == 1)]).axes
    assert sorted(len(joints.get_offsets()) for joints in ax.collections) == [0, 1, 3]
    chain = next(mg.atlas(4, family=0, types=("R", "C", "S"), joints=4))
    (ax,) = show.draw_chains([chain]).axes
    assert sorted(text.get_text() for text in ax.texts) == sorted(t for t in chain.types if t != "R")


def test_the_structural_diagram_has_a_colour_for_each_group() -> None:
    m = mg.load("windows-2")
    groups = mg.groups(m)
    ax = show.draw_structure(m, groups=groups)
    of_link = {line.get_gid(): line.get_color() for line in ax.lines}
    tones = [{of_link[f"link {link}"] for link in g.links} for g in groups.groups]
    assert [len(t) for t in tones] == [1, 1, 1]
    assert len(set.union(*tones)) == 3
    ax.figure.draw_without_rendering()
    assert {"1 c0", "5 c2", "D10: r0, c1"} <= {text.get_text() for text in ax.texts}
