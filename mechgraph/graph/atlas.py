"""``mg.atlas``, ``mg.identify``, ``mg.system_groups``: chains of a kind, which of them a mechanism is, groups by count.

A group takes up no mobility: of family f, M = (6 - f) n - sum_j (j - f) c_j = 0 with n = sum_j c_j - N moving links, so

    sum_j (6 - j) c_j = (6 - f) N.

A pair of class j leaves 6 - j freedoms; a family f has pairs of the classes f + 1 to 5 only.
Source: Marghitu, Fundamentals, equations 2.7 to 2.14, tables 2.6 and 2.7 (the condition there is c_5 >= 0, as its own table shows).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import product
from os import PathLike
from pathlib import Path
from typing import Annotated

from mechgraph.errors import DeclarationError, FileError, counted
from mechgraph.files import text_of, write_whole
from mechgraph.graph.chains import Chain, ChainKind, chains, data_faults, family_faults
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.pairs.pair_type import TABLE
from mechgraph.quantities import Count, Index, at_least, door, items_of, wrong


@dataclass(frozen=True)
class MultipleJoint:
    """A revolute joint of three or more links, declared as several pairs. Returned by ``multiple_joints``.

    Attributes
    ----------
    links, pairs : tuple of str
        Names.

    Examples
    --------
    >>> import mechgraph as mg
    >>> z, pins = (0, 0, 1), [("A", "frame", "a", 0), ("B", "a", "b", 1), ("C", "a", "c", 1), ("D", "b", "c", 2)]
    >>> m = mg.Mechanism("m", pairs=[mg.Pair(k, "R", a, b, point=(x, 0, 0), axis=z) for k, a, b, x in pins])
    >>> [(joint.links, joint.order) for joint in mg.multiple_joints(m)]
    [(('a', 'b', 'c'), 2)]
    """

    links: tuple[str, ...]
    pairs: tuple[str, ...]

    @property
    def order(self) -> int:
        """Number of pairs that it counts as, one less than links."""
        return len(self.links) - 1

    @property
    def text(self) -> str:
        """E.g. ``B, C: joint of order 2 of the links crank, rod, arm``."""
        return f"{', '.join(self.pairs)}: joint of order {self.order} of the links {', '.join(self.links)}"

    def __str__(self) -> str:
        return self.text


Joints = tuple[tuple[int, ...], ...]


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
    """The kinematic chain of a mechanism. Returned by ``identify``.

    Attributes
    ----------
    chain : Chain
        The chain with the pair types of the mechanism, in the order of declaration.
    frame : int
        Number of the frame link.
    links, pairs : tuple of str
        Names in that order; the pairs of a multiple joint share one.

    Examples
    --------
    >>> import mechgraph as mg
    >>> who = mg.identify(mg.load("four-bar"))
    >>> who.name, who.links
    ('four-bar', ('frame', 'crank', 'coupler', 'rocker'))
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
        # links up to which the number of a chain in the atlas is looked up (a second at most)
        if mobility < 0 or self.bare.loops < 1 or self.bare.links > 12:
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
        """Return the identity with pairs of the link ``on`` with each of the others in place of a multiple joint.

        Parameters
        ----------
        joint : MultipleJoint
            The joint.
        on : str
            Name of the link.

        Returns
        -------
        Identity
        """
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
    """Identify the kinematic chain of a mechanism by its links and pairs alone.

    Parameters
    ----------
    m : Mechanism
        The mechanism.
    family : int
        As in ``atlas``.
    joints : iterable of MultipleJoint
        Multiple joints to count as one (``mg.multiple_joints(m)``). Default: each pair is a joint of two links.

    Returns
    -------
    Identity

    Raises
    ------
    DeclarationError
        The mechanism has couplings, or the family is not 0 to 5.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.identify(mg.load("windows-2")).name
    'Watt II'
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


@dataclass(frozen=True)
class SystemGroup:
    """A configuration of a structural group of spatial mechanisms. Yielded by ``system_groups``.

    Attributes
    ----------
    family, contours : int
        Freedoms that no link has; independent loops.
    pairs : 5 int
        Numbers of pairs of the classes 1 to 5.
    links : int
        Number of moving links.

    Examples
    --------
    >>> import mechgraph as mg
    >>> group = next(mg.system_groups(1))
    >>> group.contours, sum(group.pairs), group.links
    (1, 6, 5)
    """

    family: int
    contours: int
    pairs: tuple[int, int, int, int, int]
    links: int


@door
def system_groups(contours: int, most: int | None = None) -> Iterator[SystemGroup]:
    """Generate all configurations of structural groups with a number of independent contours, family by family.

    Parameters
    ----------
    contours : int
        Independent loops, from 1.
    most : int, optional
        Largest number of pairs of any class 1 to 4.

    Yields
    ------
    SystemGroup

    Raises
    ------
    DeclarationError
        ``contours`` or ``most`` is not a whole number in range.

    Examples
    --------
    >>> import mechgraph as mg
    >>> sum(1 for _ in mg.system_groups(2))
    85
    """
    faults = [wrong(contours, "contours", "a whole number from 1")] * (type(contours) is not int or contours < 1)
    faults += [wrong(most, "most", "a whole number from 0, or None")] * (
        most is not None and (type(most) is not int or most < 0)
    )
    if faults:
        raise DeclarationError("system groups", faults)
    return _groups(contours, most)


def _groups(contours: int, most: int | None) -> Iterator[SystemGroup]:
    for family in range(5):
        freedoms = (6 - family) * contours
        ranges = []
        for j in range(1, 5):
            limit = freedoms // (6 - j) if j > family else 0
            ranges.append(range(1 + (limit if most is None else min(most, limit))))
        for wider in product(*ranges):
            c5 = freedoms - sum((6 - j) * c for j, c in enumerate(wider, start=1))
            links = sum(wider) + c5 - contours
            if c5 >= 0 and links > 0:
                c1, c2, c3, c4 = wider
                yield SystemGroup(family, contours, (c1, c2, c3, c4, c5), links)


@door
def atlas(
    links: Annotated[int, at_least(2)],
    mobility: Index = 1,
    *,
    joints: Count | None = None,
    family: int = 3,
    types: str | Sequence[str] = ("R",),
    multiple: bool = False,
    fractionated: bool = False,
) -> Iterator[Chain]:
    """Generate all kinematic chains of a kind up to isomorphism, without rigid parts, one by one.

    Parameters
    ----------
    links : int
        Number of links, frame included.
    mobility : int
        Dobrovolski's count, ``M = sum f - (6 - family) (joints - links + 1)``.
    joints : int, optional
        Number of pairs; a multiple joint of k links counts k - 1. Default: every number that fits.
    family : int
        Freedoms that no link has, 0 to 5: 3 for planar and spherical chains, 0 for spatial ones.
    types : str or sequence of str
        Symbols of the allowed pair types.
    multiple : bool
        Whether several links may share a revolute joint.
    fractionated : bool
        Instead, the chains that one link (or joint) separates.

    Yields
    ------
    Chain

    Raises
    ------
    DeclarationError
        With every fault.

    Examples
    --------
    >>> import mechgraph as mg
    >>> [sum(1 for _ in mg.atlas(links)) for links in (4, 6, 8)]
    [1, 2, 16]
    """
    faults = family_faults(family)
    symbols = (types,) if isinstance(types, str) else tuple(types)
    faults += [wrong(t, "types", f"symbols of the pair table: {', '.join(TABLE)}") for t in symbols if t not in TABLE]
    if not faults:
        most = 6 - family
        have = {1: "none", 2: "1"}.get(most, f"1 to {most - 1}")
        faults += [
            f"types {t!r}: has {counted(TABLE[t].f, 'freedom')}; a pair of a chain of family {family} has {have}"
            for t in symbols
            if not 0 < TABLE[t].f < most
        ]
    if faults or not symbols:
        raise DeclarationError("atlas", faults or ["types: is empty; allow at least one pair type, e.g. 'R'"])
    rows = tuple(TABLE[t] for t in dict.fromkeys(symbols))
    # pairs beyond which no chain is looked for: of more, no one could read the list
    counts = (joints,) if joints is not None else range(links, 60)
    kinds = (ChainKind(links, count, mobility, family, rows, multiple) for count in counts)
    fitting = (w for w in kinds if _fits(w))
    return (chain for kind in fitting for chain in chains(kind, fractionated))


def _fits(kind: ChainKind) -> bool:
    """Whether pairs of these types can have that many freedoms."""
    freedoms = [t.f for t in kind.types]
    return kind.loops > 0 and min(freedoms) * kind.joints <= kind.freedoms <= max(freedoms) * kind.joints


@door
def save_chains(chains: Iterable[Chain], path: str | PathLike[str]) -> int:
    """Write chains to a file, one JSON line each.

    Parameters
    ----------
    chains : iterable of Chain
        E.g. ``mg.atlas(8)``.
    path : str or path
        The file.

    Returns
    -------
    int
        Number of chains.

    Raises
    ------
    FileError
        The file cannot be written.

    Examples
    --------
    >>> import mechgraph as mg
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     mg.save_chains(mg.atlas(6), pathlib.Path(folder) / "six.jsonl")
    2
    """
    lines = []
    for c in chains:
        if not isinstance(c, Chain):
            raise DeclarationError("save_chains", [wrong(c, f"chains[{len(lines)}]", "a Chain")])
        lines.append(json.dumps({name: getattr(c, name) for name in ("links", "joints", "types", "family")}))
    write_whole(path, (f"{line}\n" for line in lines))
    return len(lines)


@door
def load_chains(path: str | PathLike[str]) -> Iterator[Chain]:
    """Read the chains of a saved file, one by one.

    Parameters
    ----------
    path : str or path
        A file of ``save_chains``.

    Yields
    ------
    Chain

    Raises
    ------
    FileError
        The file cannot be read.

    Examples
    --------
    >>> import mechgraph as mg
    >>> import tempfile, pathlib
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / "six.jsonl"
    ...     n = mg.save_chains(mg.atlas(6), path)
    ...     print([chain.assortment for chain in mg.load_chains(path)])
    ['4 binary, 2 ternary', '4 binary, 2 ternary']
    """
    for number, line in enumerate(text_of(Path(path), "file of chains").splitlines(), start=1):
        try:
            data = json.loads(line)
        except (ValueError, RecursionError) as error:
            raise FileError(path, f"line {number}: expected a chain as save_chains writes it ({error})") from None
        faults = data_faults(data)
        if faults:
            raise FileError(path, f"line {number}: expected a chain as save_chains writes it: {'; '.join(faults)}")
        yield Chain(data["links"], tuple(map(tuple, data["joints"])), tuple(data["types"]), data["family"])
