"""Multiple joints: found, named, split; numbers of chains with them by another way."""

from itertools import combinations

import numpy as np
import pytest
from planar import Builder, named
from test_equivalent import CASES, pin

import mechgraph as mg

Z = (0.0, 0.0, 1.0)


def watt_with_a_double_joint() -> mg.Mechanism:
    """A four-bar crank, rod, rocker and a dyad arm, lever; the arm hangs on the pin between crank and rod."""
    pairs = [
        pin("A", "frame", "crank", 0, 0), pin("B", "crank", "rod", 0.3, 1), pin("C", "rod", "rocker", 2, 1.4),
        pin("D", "frame", "rocker", 2.2, 0), pin("E", "crank", "arm", 0.3, 1), pin("F", "arm", "lever", -1, 1.7),
        pin("G", "frame", "lever", -1.6, 0.2),
    ]  # fmt: skip
    return mg.Mechanism("double joint", pairs=pairs, drives=["A"])


def test_found_and_named() -> None:
    (joint,) = mg.multiple_joints(watt_with_a_double_joint())
    assert (joint.links, joint.pairs, joint.order) == (("crank", "rod", "arm"), ("B", "E"), 2)
    assert str(joint) == "B, E: joint of order 2 of the links crank, rod, arm"


def test_what_is_none() -> None:
    """Two bearings of one shaft, parallel axes, a slide along a pin, turns about one line without a common link."""
    assert mg.multiple_joints(mg.load("four-bar")) == ()
    shaft = [pin("A", "frame", "crank", 0, 0), mg.Pair("A2", "R", "frame", "crank", point=(0, 0, 2), axis=Z)]
    rest = [pin("B", "crank", "rod", 0.3, 1), pin("C", "rod", "rocker", 2, 1.4), pin("D", "frame", "rocker", 2.2, 0)]
    assert mg.multiple_joints(mg.Mechanism("bearings", pairs=[*shaft, *rest], drives=["A"])) == ()


def test_identified_as_what_it_is() -> None:
    m = watt_with_a_double_joint()
    joints = mg.multiple_joints(m)
    whole = mg.identify(m, joints=joints)
    assert whole.pairs == ("A", "B, E", "C", "D", "F", "G")
    assert whole.chain.pairs == 7
    assert whole.name == "6-link chain 3 of 4, mobility 1, with multiple joints"
    assert {on: whole.split(joints[0], on).name for on in joints[0].links} == {
        "crank": mg.identify(m).name,
        "rod": mg.identify(mg.split_joint(m, "B", "rod")).name,
        "arm": mg.identify(mg.split_joint(m, "B", "arm")).name,
    } == {"crank": "Watt II", "rod": "Stephenson III", "arm": "Stephenson III"}  # fmt: skip


@pytest.mark.parametrize("at", [None, {"A": 0.4}])
@pytest.mark.parametrize("on", ["rod", "arm"])
def test_split_moves_as_before(on: str, at: dict[str, float] | None) -> None:
    """All links at many positions; the reactions of the joint add up to what each link gets from the others."""
    m = watt_with_a_double_joint().replace(loads=[mg.Wrench("lever", force=(1.0, -2.0, 0.0), point=(-1, 1, 0))])
    other = mg.split_joint(m, "E", on, at)
    assert {p.name: {p.a, p.b} for p in other.pairs}["B" if on == "arm" else "E"] == {"rod", "arm"}
    theta = np.linspace(0, 0.8, 9) + (0.4 if at else 0.0)
    move = {"A": mg.Motion(theta, 1.3, -0.4)}
    one, two = mg.solve(m, move), mg.solve(other, move)
    for link in m.link_names():
        for what in ("pose", "twist", "acceleration"):
            assert getattr(one.link(link), what) == pytest.approx(getattr(two.link(link), what), abs=1e-10)
    assert one["A"].effort == pytest.approx(two["A"].effort, abs=1e-10)
    assert mg.multiple_joints(other)[0].links == mg.multiple_joints(m)[0].links


def test_what_cannot_be_split() -> None:
    m = watt_with_a_double_joint()
    with pytest.raises(mg.DeclarationError, match="pair 'A': is in no joint of three or more links"):
        mg.split_joint(m, "A", "crank")
    with pytest.raises(mg.DeclarationError, match="on = 'lever': expected a link of the joint: crank, rod, arm"):
        mg.split_joint(m, "B", "lever")
    loaded = m.replace(loads=[mg.Effort("E", 2.0)])
    with pytest.raises(mg.DeclarationError, match="pair E: is driven, loaded, coupled"):
        mg.split_joint(loaded, "B", "rod")
    stopped = m.replace(response=mg.ResponseSetup((0.0, 1.0), stops=[mg.Stop("E", upper=1.0)]))
    with pytest.raises(mg.DeclarationError, match=r"pair E: is .* named by the response"):
        mg.split_joint(stopped, "B", "rod")
    assert mg.split_joint(loaded, "B", "arm").pairs[1].name == "B"


def test_a_link_may_have_the_name_of_a_pair() -> None:
    """A load on a link E is none in the pair E, nor is one in a pair E.F one in the pair E."""
    m = watt_with_a_double_joint()
    pairs = [p.replace(**{s: "E" for s in "ab" if getattr(p, s) == "lever"}) for p in m.pairs]
    pairs = [p.replace(name="E.F") if p.name == "F" else p for p in pairs]
    loads = [mg.Wrench("E", force=(1.0, -2.0, 0.0), point=(-1, 1, 0)), mg.Effort("E.F", 1.0)]
    named = mg.Mechanism("named", pairs=pairs, drives=["A"], loads=loads, start={"E.F": 0.0})
    other = mg.split_joint(named, "B", "rod")
    assert {"rod", "arm"} == {other.pair("E").a, other.pair("E").b}
    assert dict(other.start) == {"E.F.Rz": 0.0}


def test_the_structure_tells_them() -> None:
    text = str(mg.structure(watt_with_a_double_joint()))
    assert "With multiple joints as one joint each: 6-link chain 3 of 4" in text
    assert "Stephenson III" in text
    b = Builder(2)
    b.driver("R")
    b.dyad("D10", ("1", "0"))
    assert "multiple" not in str(mg.structure(b.mechanism("none")))
    assert "multiple" not in str(mg.structure(CASES["gears"]))
    assert mg.multiple_joints(named("R - D20")) == ()


# --- numbers ---------------------------------------------------------------------------------------------------------


def shrunk(chain: mg.Chain, links: tuple[int, ...]) -> mg.Chain:
    """The chain with links of three or more joints, none beside another, each shrunk to a point: a multiple joint."""
    place = {link: i for i, link in enumerate(i for i in range(chain.links) if i not in links)}
    joints = [tuple(place[i] for i in joint) for joint in chain.joints if not set(joint) & set(links)]
    joints += [tuple(place[i] for joint in chain.joints if link in joint for i in joint if i != link) for link in links]
    return mg.Chain(len(place), tuple(joints), ("R",) * len(joints))


def moves(chain: mg.Chain) -> bool:
    """Whether no part of the chain is rigid, by all parts, and every joint has links of its own."""
    for size in range(2, chain.links):
        for some in combinations(range(chain.links), size):
            inside = sum(max(0, len(set(some) & set(joint)) - 1) for joint in chain.joints)
            if 3 * (size - 1) - 2 * inside < 1:
                return False
    return all(len(set(joint)) == len(joint) for joint in chain.joints)


@pytest.mark.parametrize(("links", "expected"), [(6, 4), (8, 60)])
def test_numbers_with_multiple_joints_by_shrinking_links(links: int, expected: int) -> None:
    """A multiple joint of k links is a link with k joints shrunk to a point: every chain comes from one of more links and mobility."""
    found = {chain.code for chain in mg.atlas(links)}
    for more in range(1, links):
        before = len(found)
        for fractionated in (False, True):
            for chain in mg.atlas(links + more, 1 + more, fractionated=fractionated):
                wide = [i for i, degree in enumerate(chain.degrees) if degree > 2]
                for some in combinations(wide, more):
                    if not any(set(joint) <= set(some) for joint in chain.joints):
                        made = shrunk(chain, some)
                        if not made.is_fractionated and moves(made):
                            found.add(made.code)
        if len(found) == before:
            break
    assert len(found) == expected
    assert found == {chain.code for chain in mg.atlas(links, multiple=True)}
