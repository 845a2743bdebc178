"""``mg.identify``: which chain a mechanism is, its usual name, its inversions and drivers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from mechgraph.arguments import door, items_of
from mechgraph.atlas.atlas import atlas
from mechgraph.atlas.chain import Chain, family_faults
from mechgraph.atlas.multiple import MultipleJoint
from mechgraph.errors import DeclarationError, counted
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import wrong

Joints = tuple[tuple[int, ...], ...]

NUMBERED_LINKS = 12
"""Links up to which the number of a chain in the atlas is looked up (a second at most)."""


@dataclass(frozen=True)
class Usual:
    """A usual name: of the chain with these ``joints``, and of its inversions by one frame link each."""

    name: str
    joints: Joints
    inversions: Mapping[int, str]


USUAL = (
    Usual("four-bar", ((0, 1), (1, 2), (2, 3), (3, 0)), {}),
    Usual("five-bar", ((0, 1), (1, 2), (2, 3), (3, 4), (4, 0)), {}),
    Usual("Watt", ((0, 1), (0, 2), (2, 3), (3, 1), (0, 4), (4, 5), (5, 1)), {2: "I", 0: "II"}),
    Usual("Stephenson", ((0, 2), (2, 1), (0, 3), (3, 1), (0, 4), (4, 5), (5, 1)), {2: "I", 4: "II", 0: "III"}),
)
"""Names in use. Stephenson I stands on the binary link between the ternary ones, II on one of the two in a row, III on a ternary one.

Source: Norton, Design of Machinery, section 2.13.
"""


@dataclass(frozen=True)
class Identity:
    """Which chain a mechanism is.

    Attributes
    ----------
    chain : the chain with the pair types of the mechanism; links and joints in the order of declaration.
    frame : number of the frame link.
    links, pairs : names, in that order (those of the pairs of a multiple joint in one).
    """

    chain: Chain
    frame: int
    links: tuple[str, ...]
    pairs: tuple[str, ...]

    @cached_property
    def bare(self) -> Chain:
        """The same with a turning joint in place of every pair, as planar chains are counted and named."""
        return replace(self.chain, types=("R",) * len(self.pairs), family=3)

    @cached_property
    def number(self) -> tuple[int, int] | None:
        """Place in the atlas of its links and mobility, from 1, and the number of chains there; None for what is not in it."""
        mobility = self.bare.mobility
        if mobility < 0 or self.bare.loops < 1 or self.bare.links > NUMBERED_LINKS:
            return None
        code = self.bare.code
        mine = sorted(self.bare.degrees)
        chains = atlas(
            self.bare.links, mobility, multiple=self.bare.is_multiple, fractionated=self.bare.is_fractionated
        )
        places = [sorted(chain.degrees) == mine and chain.code == code for chain in chains]
        return (places.index(True) + 1, len(places)) if True in places else None

    @cached_property
    def usual(self) -> tuple[str, str]:
        """Usual names of the chain and of the inversion, empty where there is none."""
        for row in USUAL:
            known = Chain(max(map(max, row.joints)) + 1, row.joints, ("R",) * len(row.joints))
            if known.code == self.bare.code:
                mine = self.bare.code_with_frame(self.frame)
                found = (name for link, name in row.inversions.items() if known.code_with_frame(link) == mine)
                return row.name, next(found, "")
        return "", ""

    @property
    def name(self) -> str:
        """E.g. ``Stephenson III``, ``ring of 7 links``, or ``8-link chain 5 of 16, mobility 1``."""
        chain, inversion = self.usual
        if chain:
            return f"{chain} {inversion}".strip()
        n = self.bare.links
        if set(self.bare.degrees) == {2} and self.bare.loops == 1:
            return f"ring of {n} links"
        if self.number:
            fractionated = "fractionated " if self.bare.is_fractionated else ""
            multiple = ", with multiple joints" if self.bare.is_multiple else ""
            place, count = self.number
            return f"{fractionated}{n}-link chain {place} of {count}, mobility {self.bare.mobility}{multiple}"
        return f"{n}-link chain ({self.bare.assortment})"

    @cached_property
    def inversions(self) -> tuple[tuple[str, ...], ...]:
        """Links that are alike as frame, with the pair types; one tuple for each inversion."""
        return tuple(tuple(self.links[i] for i in group) for group in self.chain.inversions)

    @cached_property
    def drivers(self) -> tuple[tuple[str, ...], ...]:
        """Pairs that are alike as driver on this frame, with the pair types."""
        return tuple(tuple(self.pairs[k] for k in group) for group in self.chain.drivers(self.frame))

    def split(self, joint: MultipleJoint, on: str) -> Identity:
        """The same with pairs of the link ``on`` with each of the others in place of a multiple joint."""
        k = self.pairs.index(", ".join(joint.pairs))
        mine = [(self.links.index(on), self.links.index(link)) for link in joint.links if link != on]
        joints, types, names = (
            (*row[:k], *new, *row[k + 1 :])
            for row, new in (
                (self.chain.joints, mine),
                (self.chain.types, [self.chain.types[k]] * len(mine)),
                (self.pairs, joint.pairs),
            )
        )
        return replace(self, chain=replace(self.chain, joints=joints, types=types), pairs=names)

    @property
    def text(self) -> str:
        """Name, pair types round a ring, inversions and drivers."""
        groups = {"inversions (alike as frame)": self.inversions, "drivers (alike)": self.drivers}
        lines = [f"{self.name}: {self.chain.assortment}; {counted(self.bare.loops, 'loop')}"]
        lines += [f"  {what}: {'; '.join(', '.join(g) for g in of)}" for what, of in groups.items()]
        return "\n".join(lines)

    def __str__(self) -> str:
        return self.text


@door
def identify(m: Mechanism, family: int = 3, joints: Iterable[MultipleJoint] = ()) -> Identity:
    """Which chain a mechanism is: by its links and pairs alone, whatever the dimensions.

    Multiple ``joints`` (``mg.multiple_joints(m)``) count as what they are; left out, each pair is a joint of two links.

    Raises
    ------
    DeclarationError
        for a mechanism with couplings (gears), since a chain has pairs alone, and for a family that is none.
    """
    faults = family_faults(family)
    if m.couplings:
        names = ", ".join(c.name for c in m.couplings)
        faults.append(f"couplings {names}: a kinematic chain has pairs alone; put m.equivalent() in their place first")
    joints, place = tuple(joints), m.link_index
    for i, named in enumerate(joints):
        pairs, links = (
            items_of(names, f"joints[{i}]: {what}", faults)
            for what, names in (("pairs", named.pairs), ("links", named.links))
        )
        faults += [
            wrong(name, f"joints[{i}]", f"names of pairs and links of {m.name!r}")
            for name, known in (*((p, m.pair_index) for p in pairs), *((k, place) for k in links))
            if not isinstance(name, str) or name not in known
        ]
    if faults:
        raise DeclarationError(f"identify {m.name!r}", faults)
    shared = {name: one for one in joints for name in one.pairs}
    found: dict[str, tuple[tuple[int, ...], str]] = {}
    for p in m.pairs:
        joint = shared.get(p.name)
        names, links = (", ".join(joint.pairs), joint.links) if joint else (p.name, (p.a, p.b))
        found.setdefault(names, (tuple(place[link] for link in links), p.type.symbol))
    chain = Chain(len(m.links), tuple(at for at, _ in found.values()), tuple(s for _, s in found.values()), family)
    return Identity(chain, place[m.frame], m.link_names(), tuple(found))
