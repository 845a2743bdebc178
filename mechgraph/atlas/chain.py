"""A kinematic chain: links and joints without dimensions, its canonical code, its inversions and drivers up to symmetry."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from mechgraph.atlas.canonical import least_orders, ranked
from mechgraph.errors import counted
from mechgraph.model.link import Link
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.model.pair_table import TABLE
from mechgraph.quantities import wrong

if TYPE_CHECKING:
    import networkx as nx

Code = tuple[Any, ...]
Edge = tuple[int, int, Hashable]
FAMILIES = range(6)
"""Freedoms that no link may have, of the six in space."""


def family_faults(family: Any) -> list[str]:
    """What is wrong with a family, one line or none."""
    return [] if type(family) is int and family in FAMILIES else [wrong(family, "family", "a whole number from 0 to 5")]


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
    """A kinematic chain of ``links`` numbered from 0.

    ``joints`` are the links that meet at each joint, two, or more at a multiple joint (which counts as one less than there are links);
    ``types`` the symbols of their pair types; ``family`` the freedoms that no link has (3 for planar chains).
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
        return self._code({}, {})

    def code_with_frame(self, frame: int) -> Code:
        """The same of an inversion: what chains with a frame link have in common that are alike."""
        return self._code({frame: 1}, {})

    def _code(self, links: Mapping[int, int], joints: Mapping[int, int]) -> Code:
        """The code with marks on links and joints."""
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
        """Joints that are alike as driver of the inversion with ``frame``, one tuple for each choice."""
        return _alike(range(len(self.joints)), lambda k: self._code({frame: 1}, {k: 1}))

    def mechanism(self, frame: int = 0, name: str = "") -> Mechanism:
        """The chain as a mechanism without geometry: links L0, L1, ..., pairs J0, J1, ...; a multiple joint as pairs J0a, J0b, ..."""
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
