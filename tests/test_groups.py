"""Driver links and structural groups: names of the chapter, composition, order of solution, agreement of pattern and ranks."""

import numpy as np
import pytest
from planar import Builder, named

import mechgraph as mg

VERSIONS = [f"D{kind}{j}" for kind, count in ((1, 1), (2, 4), (3, 2), (4, 4), (5, 8)) for j in range(count)]
SYMBOLS = [
    "R - D42", "R - D20", "T - D54",
    "R - D10 - D10 - 1 + 0", "R - D10 - D10 - 1 + 2", "R - D10 - D10 - 2 + 0", "R - D10 - D10 - 2 + 3",
    "R - D10 - D10 - 3 + 0", "R - D10 - D10 - 1 + 3",
    "R - D21 - D30 - 1 + 3", "R - D43 - D50 - 2 + 0", "R - D31 - D20 - 3 + 0", "T - D21 - D50 - 2 + 0",
    "R - D10 - D10 - D10 - 1 + 2 - 3 + 4", "R - D10 - D10 - D10 - 1 + 2 - 4 + 0",
    "R - D10 - D10 - D10 - 2 + 0 - 2 + 4", "R - D10 - D10 - D10 - 2 + 0 - 2 + 5",
    "R - D42 - D30 - D21 - 1 + 2 - 4 + 0", "T - D22 - D30 - D20 - 1 + 2 - 4 + 5",
]  # fmt: skip
"""The symbols of figures 2.22 to 2.28 (of 2.27a with the lower number first)."""


def test_nineteen_versions() -> None:
    assert len(VERSIONS) == 19
    words = {"1": "RRR", "2": "RRT", "3": "RTR", "4": "TRT", "5": "TTR"}
    for version in VERSIONS:
        g = mg.groups(named(f"R - {version}"))
        assert g.symbol == f"R - {version}"
        assert g.words == f"R-{words[version[1]]}"


@pytest.mark.parametrize("symbol", SYMBOLS)
def test_symbols_of_the_chapter(symbol: str) -> None:
    g = mg.groups(named(symbol))
    assert g.symbol == symbol
    assert [group.family for group in g.groups if not group.driver] == [3.0] * symbol.count("D")
    assert not g.free


def test_connectivity_table_of_figure_247() -> None:
    """R-RRT-RTR; B and C are multiple joints, D a slide and a turn in one place."""
    b = Builder()
    for ends in (("0", "1"), ("1", "2"), ("2", "3")):
        b.count = max(b.count, int(ends[1]) + 1)
        b.pair("R", *ends)
    b.pair("T", "0", "3")
    b.count = 6
    b.pair("R", "2", "4")
    b.pair("T", "4", "5")
    b.pair("R", "5", "0")
    g = mg.groups(b.mechanism("figure 2.47"))
    assert g.words == "R-RRT-RTR"
    assert g.connectivity[1] == (2, "2", ("1 at P1", "3 at P2", "4 at P4"))
    assert [group.links for group in g.groups] == [("1",), ("2", "3"), ("4", "5")]


def random_mechanism(seed: int) -> mg.Mechanism:
    """Dyads, and here and there a triad, on links that are there."""
    rng = np.random.default_rng(seed)
    b = Builder(seed)
    b.driver(str(rng.choice(["R", "T"])))
    for _ in range(4):
        known = [str(i) for i in range(b.count)]
        if rng.random() < 0.3:
            middle = b.link()
            for on in rng.choice(known, 3, replace=b.count < 5):
                end = b.link()
                b.pair("R", str(on), end)
                b.pair("R", end, middle)
        else:
            b.dyad(f"D1{0}" if rng.random() < 0.5 else "D20", tuple(map(str, rng.choice(known, 2, replace=False))))
    return b.mechanism(f"random {seed}")


@pytest.mark.daily(4)
@pytest.mark.parametrize("seed", range(8))
def test_groups_compose_to_the_whole(seed: int) -> None:
    """Links and pairs add up for every driver, ranks of the groups to the rank of the whole; each hangs on links before it only."""
    m = random_mechanism(seed)
    report = mg.check(m)
    for finding in report.drivable:
        (name,) = finding.freedoms
        g = report.groups_with([name])
        links = [link for group in g.groups for link in group.links]
        assert sorted([*links, *g.free]) == sorted(n for n in m.link_names() if n != m.frame)
        assert sorted(p for group in g.groups for p in group.pairs) == sorted(p.name for p in m.pairs)
        known = {m.frame}
        for group in g.groups:
            assert set(group.on) <= known
            known |= set(group.links)
            assert len(group.pairs) - len(group.links) == group.contours
            assert 3 * len(group.links) == 2 * len(group.pairs) + (len(group.pairs) - group.freedoms)
        assert sum(group.freedoms for group in g.groups) == 3 * len(report.loops)


@pytest.mark.daily(2)
@pytest.mark.parametrize("seed", [0, 1, 5, 6])
def test_solving_group_by_group(seed: int) -> None:
    """Each group closed alone, between links that stand where the groups before put them, gives the poses of the whole."""
    m = random_mechanism(seed)
    theta = np.array([0.0, 0.002])
    s = mg.kinematics(m, {"P0": theta})
    g = mg.groups(m)
    poses = {m.frame: np.eye(4), **{g.groups[0].links[0]: s.link(g.groups[0].links[0]).pose[1]}}
    for group in g.groups[1:]:
        pairs = []
        for name in group.pairs:
            p = next(pair for pair in m.pairs if pair.name == name)
            sides = {}
            for side, link in (("on_a", p.a), ("on_b", p.b)):
                X = poses[link] if link in poses else np.eye(4)
                point, axis = X[:3, :3] @ np.array(p.point) + X[:3, 3], X[:3, :3] @ np.array(p.axis)
                second = X[:3, :3] @ np.array(p.second)
                sides[side] = mg.Marker(point=tuple(point), axis=tuple(axis), second=tuple(second))
            a, b = (m.frame if link in poses else link for link in (p.a, p.b))
            pairs.append(mg.Pair(name, p.type.symbol, a, b, **sides))
        start = {pair.name: float(s[pair.name].position[0].item()) for pair in pairs}
        alone = mg.kinematics(mg.Mechanism("group", pairs=pairs, frame=m.frame, start=start), {})
        for link in group.links:
            poses[link] = np.asarray(alone.link(link).pose)
            assert poses[link] == pytest.approx(s.link(link).pose[1], abs=1e-11)


def test_class_and_order() -> None:
    """A triad is of class III and order 3, four links round a four-sided contour with two outer pairs of class IV and order 2."""
    b = Builder(4)
    b.driver("R")
    middle = b.link()
    for on in ("1", "0", "0"):
        end = b.link()
        b.pair("R", on, end)
        b.pair("R", end, middle)
    g = mg.groups(b.mechanism("triad"))
    assert g.symbol == "R - III.3 - 1 + 0 + 0"
    b = Builder(5)
    b.driver("R")
    a, c, d, e = (b.link() for _ in range(4))
    b.pair("R", "1", a)
    b.pair("R", "0", d)
    for one, other in ((a, c), (c, d), (d, e), (e, a)):
        b.pair("R", one, other)
    g = mg.groups(b.mechanism("four sides"))
    assert [(group.class_, group.order) for group in g.groups if not group.driver] == [(4, 2)]


def test_other_drivers() -> None:
    """Watt II by its middle crank: two dyads on that crank; by a pair of the coupler the driver stays within the group."""
    by = mg.check(mg.load("windows-2")).groups_by_driver
    assert by["A0.Rz"] == "R - D10 - D10 - 3 + 0"
    assert by["A1.Rz"] == "R - D10 - D10 - 1 + 0"
    assert by["B0.Rz"].startswith("RR(R)R - D10") or by["B0.Rz"].startswith("R(R)RR - D10")


def test_symbols_are_explained_where_they_are_printed() -> None:
    windows = mg.load("windows-2")
    plain, within = (str(mg.groups(windows, [name])) for name in ("A0", "B0"))
    for text in (plain, within):
        assert "the numbers of the links on which it hangs, 0 the frame" in " ".join(text.split())
    assert "parentheses" not in plain
    assert "A letter in parentheses is a driven pair" in " ".join(within.split())


def test_spatial_groups() -> None:
    assert mg.groups(mg.load("rcsr-csr")).symbol == "R - CSR - CSR - 2 + 0"
    bennett = mg.groups(mg.load("bennett"))
    assert (bennett.symbol, bennett.groups[1].redundancy) == ("R - RRR", 3)
    assert mg.groups(mg.load("rssr")).symbol == "R - SSR"


def test_a_coupling_belongs_to_the_group_that_it_determines() -> None:
    m = mg.Mechanism(
        "wheels",
        pairs=[
            mg.Pair("A", "R", "frame", "one", point=(0, 0, 0), axis=(0, 0, 1)),
            mg.Pair("B", "R", "frame", "two", point=(3, 0, 0), axis=(0, 0, 1)),
        ],
        couplings=[mg.Coupling({"A": 1.0, "B": 2.0}, name="mesh")],
        drives=["A"],
    )
    g = mg.groups(m)
    assert [(group.links, group.couplings) for group in g.groups] == [(("one",), ()), (("two",), ("mesh",))]


def test_what_drivers_leave_free() -> None:
    m = named("R - D10")
    g = mg.groups(m, [])
    assert (g.groups, set(g.free)) == ((), {"1", "2", "3"})


def test_wrong_drivers_are_named() -> None:
    with pytest.raises(mg.DeclarationError, match="drives = 'Q': expected names of freedoms"):
        mg.groups(mg.load("four-bar"), ["Q"])
    with pytest.raises(mg.DeclarationError, match="need a closed position"):
        mg.structure(mg.chain("RSSR"))


def test_the_structure_prints() -> None:
    text = str(mg.structure(mg.load("windows-2")))
    for part in ("Watt II", "Dobrovolski's count gives M = 1", "R - D10 - D10 - 3 + 0", "With another driver"):
        assert part in text
    assert repr(mg.structure(mg.load("four-bar"))) == "Structure('four-bar': R - D10; print it)"


@pytest.mark.slow
def test_numbers_of_assemblies_multiply() -> None:
    """Two dyads: two assemblies of the first, and for each two of the second."""
    found = mg.assemblies(mg.load("marghitu-2-7"), {"A": 0.3}, seed=0)
    first, second = mg.groups(mg.load("marghitu-2-7")).groups[1:]
    links = mg.load("marghitu-2-7").link_names()
    poses = np.asarray(found.poses)

    def different(names: tuple[str, ...]) -> int:
        rows = poses[:, [links.index(n) for n in names]].reshape(len(poses), -1)
        return len(np.unique(np.round(rows, 6), axis=0))

    assert found.completeness == "proved"
    assert len(found) == 4
    assert different(first.links) == 2
    assert different((*first.links, *second.links)) == 4


def alone(m: mg.Mechanism, group: mg.Group, before: set[str], drives: tuple[str, ...]) -> mg.Mechanism:
    """A group with the links before it as one frame, as declared."""
    pairs = []
    for p in m.pairs:
        if p.name in group.pairs:
            a, b = (m.frame if link in before else link for link in (p.a, p.b))
            pairs.append(mg.Pair(p.name, p.type.symbol, a, b, point=p.point, axis=p.axis, second=p.second))
    mine = [d for d in drives if d.split(".")[0] in group.pairs]
    return mg.Mechanism("alone", pairs=pairs, frame=m.frame, drives=mine)


def number(m: mg.Mechanism, drives: tuple[str, ...]) -> int:
    """Real and complex assemblies at the declared place of the drivers."""
    found = mg.assemblies(m, dict.fromkeys(drives, 0.0), seed=0)
    assert found.completeness in ("proved", "tested")
    return len(found) + len(found.complex)


@pytest.mark.parametrize(
    ("symbol", "seed"),
    [
        ("R - D10 - D20 - 3 + 0", 1),
        *(pytest.param(f"R - {rest}", seed, marks=pytest.mark.slow) for seed in (2, 3, 4) for rest in (
            "D10 - D10 - 1 + 2", "D10 - D20 - 3 + 0", "D20 - D10 - 2 + 3", "D10 - D10 - 2 + 3")),
    ],
)  # fmt: skip
def test_numbers_of_assemblies_multiply_whatever_the_driver(symbol: str, seed: int) -> None:
    """Random dyads with a random driver: the assemblies, real and complex, are as many as the product of those of the groups alone."""
    m = named(symbol, seed)
    drivable = [finding.freedoms[0] for finding in mg.check(m).drivable]
    m = m.replace(drives=[str(np.random.default_rng(seed).choice(drivable))])
    g = mg.groups(m)
    before, product = {m.frame}, 1
    for group in g.groups:
        if not group.driver:
            part = alone(m, group, before, g.drivers)
            product *= number(part, tuple(d.freedom for d in part.drives))
        before |= set(group.links)
    assert number(m, g.drivers) == product > 1


def test_more_drivers_than_can_move() -> None:
    """Two cranks of a four-bar were both named drivers of a dyad with two pairs; of declared ones those that lead count."""
    m = mg.load("four-bar")
    for drives in (["A", "D"], ["A", "A.Rz"], ["A", "B", "C", "D"]):
        with pytest.raises(
            mg.DeclarationError, match=r"drives = .*: expected independent freedoms, here 1, e\.g\. A\.Rz"
        ):
            mg.groups(m, drives)
    assert mg.groups(m.replace(drives=["D", "A"])).symbol == mg.groups(m, ["D"]).symbol
    rod = mg.load("rssr")  # its rod may spin: two freedoms, one that can be driven
    assert mg.groups(rod.replace(drives=["A", "D"])).symbol == mg.groups(rod, ["A"]).symbol
