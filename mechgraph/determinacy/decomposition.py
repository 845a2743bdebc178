"""Groups of links: which are solved together, in which order, and joints that stand on one another.

What pairs and couplings ask of the motions of links, drivers at rest: rows in the twists of the links, in a frame of few directions.
With the relative twist ``V_b - V_a`` of a pair in the span of its free freedoms ``S``, its wrenches ``C`` (``C^T S = 0``) give the rows

    C^T T (v_b - v_a) = 0,      V = T v,

where ``T (6, b)`` holds the twists of the mechanism (b = 3 for a planar or spherical one, else 6). A coupling sum c_i q_i = 0 gives one
row, with q = S^+ (V_b - V_a).

Structural groups (Assur groups): the smallest sets of links whose motion is known once that of the links before is.
With the drivers at rest nothing moves. A set of links is determined when it stands still by its own pairs and those to links that do so
already; the smallest such sets, one after the other, are the driver links and the groups in the order in which they can be solved.

Where the links have as many rows as motions, pattern alone decides: the strongly connected components of a matching of rows to links (the
fine decomposition of Dulmage and Mendelsohn, 1958), each checked by its rank. Where there are more rows (overconstrained spatial loops,
slides that only slide), or a rank is less, the ranks of smaller and smaller sets decide.

Driver links and structural groups of a position with their names: class and order, dyads with their versions, connections.
Class (Artobolevski): the most sides of a closed contour of the group, a link with k pairs being one of k sides, 2 at least; order: the
number of pairs to links before. A dyad has two links and three pairs with one planar freedom each, and is named by these, from the link
before round to the other one: RRR, RRT, RTR, TRT, TTR (R turns, T slides).

Its versions D10 to D57 tell on which of the two links of each slide the guide is, and in which order the pairs come (first the link that
does not end at the frame): RRR one, RTR two, RRT, TRT four each, TTR eight, 19 in all. A guide is on the link named first in its pair.
The figures of the versions are not in the text of the source; the numbers agree with all that the text says of D20, D21, D50 and D54.
Source: Marghitu, Fundamentals, sections 2.5 to 2.8 and 2.14.

Multiple joints: turning pairs of several links on one axis, declared as pairs of two links each.
Pairs that turn about one line and hang together by common links make a joint of k links, of order k - 1; which of these links carries the
others is a matter of the declaration, not of the motion. Source: Marghitu, Fundamentals, section 2.1 and figure 2.10.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np
import scipy

from mechgraph.determinacy.families import MotionKind
from mechgraph.determinacy.mobility import Freedoms, Position
from mechgraph.document import Block, Document, Paragraph, Shown, Table
from mechgraph.graph.atlas import MultipleJoint
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import MOTIONS, RANKS
from mechgraph.memo import dataclass


@dataclass(frozen=True, eq=False)
class Constraint:
    """Rows ``(s, b)`` by link, s independent ones, of a pair (or a coupling) by its ``number`` (couplings count on from the pairs)."""

    number: int
    rows: Mapping[int, Array]

    @property
    def count(self) -> int:
        """Number of rows."""
        return next(iter(self.rows.values())).shape[0] if self.rows else 0


def rows_of_pair(S: Array, twists: Array) -> Array:
    """Rows ``(s, b)`` of the wrenches that free twists ``S (6, f)`` of a pair leave, in the directions ``twists (6, b)``."""
    wrenches = np.linalg.svd(S)[0][:, S.shape[1] :] if S.size else np.eye(6)
    _, s, Vt = np.linalg.svd(wrenches.T @ twists, full_matrices=False)
    return np.asarray(Vt[s > RANKS.position])


class Constraints:
    """Constraints between links whose motions have ``b`` directions."""

    def __init__(self, constraints: Iterable[Constraint], b: int) -> None:
        self.constraints = [c for c in constraints if c.count]
        self.b = b

    def matrix(self, links: Iterable[int], solved: Iterable[int]) -> Array:
        """Rows of all constraints among ``links`` and links ``solved`` before, in the ``links`` alone: ``(rows, b links)``."""
        mine = list(links)
        known = set(mine) | set(solved)
        blocks = [
            np.concatenate([c.rows.get(link, np.zeros((c.count, self.b))) for link in mine], axis=1)
            for c in self.constraints
            if known.issuperset(c.rows) and not c.rows.keys().isdisjoint(mine)
        ]
        return np.concatenate(blocks) if blocks else np.zeros((0, self.b * len(mine)))

    def moving(self, links: Iterable[int], solved: Iterable[int]) -> set[int]:
        """Which of ``links`` can still move when the links ``solved`` stand still and the others are away."""
        mine = list(links)
        A = self.matrix(mine, solved)
        if not A.size:
            return set(mine)
        _, s, Vt = np.linalg.svd(A)
        rank = int((s > RANKS.position * s[0]).sum()) if s.size else 0
        motions = Vt[rank:].reshape(-1, len(mine), self.b)
        # part of a motion of size one below which a link stands still
        still = np.abs(motions).max(axis=(0, 2), initial=0.0) < 1e-7
        return {link for link, at_rest in zip(mine, still, strict=True) if not at_rest}

    def determined(self, links: Iterable[int], solved: Iterable[int]) -> set[int]:
        """The largest set of ``links`` that stands still by the constraints among itself and the links ``solved``."""
        mine = set(links)
        while mine:
            moving = self.moving(sorted(mine), solved)
            if not moving:
                break
            mine -= moving
        return mine


class LinkRows(Constraints):
    """The constraints of a position with the freedoms ``fixed`` at rest, in the directions ``twists (6, b)``."""

    def __init__(self, position: Position, fixed: Index, twists: Array) -> None:
        self.position, self.twists = position, twists
        self._free = np.ones(position.n_freedoms, dtype=bool)
        self._free[fixed] = False
        super().__init__((*self.pairs, *self.couplings), twists.shape[1])

    def freedoms(self, k: int) -> Array:
        """Free twists ``(6, f)`` of a pair."""
        columns = np.array(self.position.columns(k), dtype=np.intp)
        return np.asarray(self.position.rows.S[:, columns[self._free[columns]]])

    @cached_property
    def pairs(self) -> list[Constraint]:
        """The constraints of all pairs."""
        out = []
        for k, (a, b) in enumerate(self.position.graph.ends):
            rows = rows_of_pair(self.freedoms(k), self.twists)
            out.append(Constraint(k, {a: -rows, b: rows}))
        return out

    @cached_property
    def couplings(self) -> list[Constraint]:
        """The constraints of rows behind those of the loops."""
        more = self.position.rows.more
        out = []
        for i in range(self.position.rows.further):
            coefficients = more[[i]].toarray()[0] * self._free  # type: ignore[index]
            rows: dict[int, Array] = {}
            for k, (a, b) in enumerate(self.position.graph.ends):
                mine = coefficients[list(self.position.columns(k))]
                if mine.any():
                    S = self.position.rows.S[:, list(self.position.columns(k))]
                    row = (mine @ np.linalg.pinv(S) @ self.twists)[None]
                    rows[a], rows[b] = rows.get(a, 0.0) - row, rows.get(b, 0.0) + row
            out.append(Constraint(len(self.position.graph.ends) + i, rows))
        return out


MOST_SPLIT = 40
"""Links up to which sets are made smaller by their ranks: some seconds."""


@dataclass(frozen=True)
class LinkSet:
    """A group by numbers: its ``links``, the ``pairs`` among them and to links before, and the ``couplings`` with these."""

    links: tuple[int, ...]
    pairs: tuple[int, ...]
    couplings: tuple[int, ...] = ()


def link_sets(rows: LinkRows) -> tuple[list[LinkSet], list[int]]:
    """The groups in the order in which they can be solved, and the links that no driver determines."""
    frame = rows.position.graph.frame
    links = [i for i in range(rows.position.graph.n_links) if i != frame]
    fixed = rows.determined(links, (frame,))
    found = _by_pattern(rows, fixed) if fixed else []
    if found is None:
        found = list(_by_rank(rows, fixed))
    return _with_pairs(rows, found), sorted(set(links) - fixed)


def _with_pairs(rows: LinkRows, found: list[list[int]]) -> list[LinkSet]:
    """The sets with what constrains each."""
    solved = {rows.position.graph.frame}
    count = len(rows.position.graph.ends)
    out = []
    for mine in found:
        known = solved | set(mine)
        touching = [
            c.number
            for c in (*rows.pairs, *rows.couplings)
            if known.issuperset(c.rows) and not c.rows.keys().isdisjoint(mine)
        ]
        out.append(
            LinkSet(
                tuple(mine), tuple(k for k in touching if k < count), tuple(k - count for k in touching if k >= count)
            )
        )
        solved = known
    return out


# --- by the pattern of a square system -------------------------------------------------------------------------------------


def _by_pattern(rows: LinkRows, links: set[int]) -> list[list[int]] | None:
    """Strongly connected components, those that depend on nothing first; None where rows and motions are not as many, or a rank is less."""
    import networkx as nx

    known = links | {rows.position.graph.frame}
    constraints = [c for c in rows.constraints if known.issuperset(c.rows)]
    if sum(c.count for c in constraints) != rows.b * len(links):
        return None
    flow = _matched(constraints, rows.b, links)
    if flow is None:
        return None
    graph: nx.DiGraph[int] = nx.DiGraph()
    graph.add_nodes_from(sorted(links))
    for c, used in zip(constraints, flow, strict=True):
        graph.add_edges_from((other, link) for link in used for other in c.rows if other in links and other != link)
    whole = nx.condensation(graph)
    order = nx.lexicographical_topological_sort(whole, key=lambda n: min(whole.nodes[n]["members"]))
    found = [sorted(whole.nodes[n]["members"]) for n in order]
    solved = {rows.position.graph.frame}
    for mine in found:
        if rows.moving(mine, solved):
            return None
        solved |= set(mine)
    return found


def _matched(constraints: list[Constraint], b: int, links: set[int]) -> list[list[int]] | None:
    """For every constraint the links whose motions its rows are matched to, by maximum flow; None where not all can be."""
    place = {link: i for i, link in enumerate(sorted(links))}
    n, count = len(constraints), len(place)
    source, sink = n + count, n + count + 1
    edges = [(source, i, c.count) for i, c in enumerate(constraints)]
    edges += [(n + i, sink, b) for i in range(count)]
    edges += [(i, n + place[link], b) for i, c in enumerate(constraints) for link in c.rows if link in place]
    start, end, capacity = np.array(edges, dtype=np.int32).T
    network = scipy.sparse.csr_array((capacity, (start, end)), shape=(sink + 1, sink + 1))
    result = scipy.sparse.csgraph.maximum_flow(network, source, sink)
    if result.flow_value != b * count:
        return None
    flow = scipy.sparse.csr_array(result.flow)
    back = sorted(place, key=place.__getitem__)
    out = []
    for i in range(n):
        row = flow[[i]].tocoo()
        out.append(
            [
                back[j - n]
                for j, value in zip(row.col.tolist(), row.data.tolist(), strict=True)
                if value > 0 and n <= j < n + count
            ]
        )
    return out


# --- by ranks ------------------------------------------------------------------------------------------------------------


def _by_rank(rows: LinkRows, links: set[int]) -> Iterator[list[int]]:
    """The smallest determined sets, one after the other."""
    solved, left = {rows.position.graph.frame}, set(links)
    while left:
        mine = smallest(rows, left, solved) if len(left) <= MOST_SPLIT else left
        yield sorted(mine)
        solved |= mine
        left -= mine


def smallest(rows: Constraints, links: set[int], solved: set[int]) -> set[int]:
    """A determined set none of whose parts is: links are taken away, the last ones first, as long as something stays determined."""
    mine, kept = set(links), set[int]()
    while mine - kept:
        link = max(mine - kept)
        rest = rows.determined(mine - {link}, solved)
        if rest:
            mine = rest
        else:
            kept.add(link)
    return mine


BASES = ("RRR", "RRT", "RTR", "TRT", "RTT")
"""Dyads by type 1 to 5, in the order in which version 0 has its pairs; the last one is called TTR."""


@dataclass(frozen=True)
class Group:
    """A driver link, or a structural group: a smallest set of links that is fixed once the links before it are. Part of ``Decomposition``.

    Attributes
    ----------
    name : str
        R or T of a driver link, the version of a dyad (``D42``, Marghitu), the letters of another single-contour group, else class
        and order (``III.3``).
    letters : str
        Its pairs: R rotates, T translates, others as declared; in parentheses if driven between moving links.
    driver : bool
        Whether it is a driver link.
    links, pairs, couplings : tuple of str
        What it adds; ``outer`` are the pairs that lead to links ``on`` before it.
    contours : int
        Independent loops: pairs (and couplings) beyond the links.
    freedoms : int
        Freedoms of its pairs that are neither driven nor held fixed.
    redundancy : int
        Dependent closure equations of its loops, 6 contours (in a planar mechanism 3) + couplings - freedoms.
    class_, order : int
        Class (largest closed contour or number of pairs on a link) and number of outer pairs.
    planar : bool
        Whether it is one of a planar mechanism.

    Examples
    --------
    >>> import mechgraph as mg
    >>> dyad = mg.groups(mg.load("four-bar")).groups[1]
    >>> dyad.links, dyad.on, dyad.redundancy
    (('coupler', 'rocker'), ('crank', 'frame'), 3)
    """

    name: str
    letters: str
    driver: bool
    links: tuple[str, ...]
    pairs: tuple[str, ...]
    couplings: tuple[str, ...]
    outer: tuple[str, ...]
    on: tuple[str, ...]
    contours: int
    freedoms: int
    redundancy: int
    class_: int
    order: int
    planar: bool = False

    @property
    def family(self) -> float | None:
        """Freedoms that no link of its contours has, their mean where they differ (the apparent family); None without contours."""
        # three freedoms that no link of a planar mechanism has are no constraints there
        return self.redundancy / self.contours + 3 * self.planar if self.contours else None


@dataclass(frozen=True, repr=False)
class Decomposition(Shown):
    """Driver links and structural groups of a mechanism, in the order in which they can be solved. Returned by ``groups``.

    Attributes
    ----------
    drivers : tuple of str
        Driven freedoms.
    groups : tuple of Group
        Driver links and groups.
    free : tuple of str
        Links that these drivers do not determine.
    numbers : mapping of str to int
        Number of every link, the frame 0.
    ends : mapping
        Names of the two links of every pair.

    Examples
    --------
    >>> import mechgraph as mg
    >>> [group.name for group in mg.groups(mg.load("windows-2")).groups]
    ['R', 'D10', 'D10']
    """

    drivers: tuple[str, ...]
    groups: tuple[Group, ...]
    free: tuple[str, ...]
    numbers: Mapping[str, int]
    ends: Mapping[str, tuple[str, str]]

    @cached_property
    def symbol(self) -> str:
        """E.g. ``R - D42 - D30 - D21 - 1 + 2 - 4 + 0``; the connection of a first group 1 + 0 is left out, as in the source."""
        parts = [g.name for g in self.groups]
        groups = [g for g in self.groups if not g.driver]
        for i, g in enumerate(groups):
            at = " + ".join(str(self.numbers[link]) for link in g.on)
            if i or at != "1 + 0":
                parts.append(at)
        return " - ".join(parts)

    @property
    def words(self) -> str:
        """The same by what the pairs do, e.g. ``R-RRT-RTR``."""
        return "-".join(g.letters if g.driver or g.contours == 1 else g.name for g in self.groups)

    @property
    def legend(self) -> str:
        """How the symbol is read."""
        parts = [
            "The symbol names the driver links (R turns, T slides), then the groups in the order in which they are solved, then for each "
            "group the numbers of the links on which it hangs, 0 the frame (1 + 0 of the first group is not written)."
        ]
        if any("(" in g.name for g in self.groups):
            parts.append(
                "A letter in parentheses is a driven pair between two moving links: it drives its group from within."
            )
        if any(g.name == f"{_roman(g.class_)}.{g.order}" for g in self.groups):
            parts.append("Groups of several contours are named by class and order: III.3 is of class III and order 3.")
        return " ".join(parts)

    def __repr__(self) -> str:
        return f"Decomposition({self.symbol!r}; print it)"

    def document(self) -> Document:
        """The groups in the order in which they can be solved, and the connectivity table."""
        return Document("Structural groups", tuple(self.blocks()))

    def blocks(self) -> Iterator[Block]:
        """The parts of that document."""
        given = ", ".join(self.drivers) or "none"
        yield Paragraph(f"{self.symbol or 'No groups'}   ({self.words or 'nothing is determined'}; drivers: {given})")
        rows = [
            (
                g.name,
                g.letters,
                "driver link" if g.driver else f"class {_roman(g.class_)}, order {g.order}",
                ", ".join(f"{self.numbers[link]} {link}" for link in g.links),
                ", ".join((*g.pairs, *g.couplings)),
                ", ".join(f"{self.numbers[link]} {link}" for link in g.on),
                "-" if g.family is None else f"{g.family:.3g}",
            )
            for g in self.groups
        ]
        yield Table(("group", "pairs do", "kind", "links", "pairs", "on", "family"), tuple(rows))
        yield Paragraph(self.legend)
        if self.free:
            yield Paragraph(f"Not determined by these drivers: {', '.join(self.free)}.")
        table = tuple((str(number), link, ", ".join(at)) for number, link, at in self.connectivity)
        yield Table(("link", "name", "connected to"), table)

    @property
    def connectivity(self) -> tuple[tuple[int, str, tuple[str, ...]], ...]:
        """The connectivity table: number and name of every moving link, and where it is connected (``0 at A (R)``)."""
        out = []
        for link, number in sorted(self.numbers.items(), key=lambda item: item[1]):
            if number:
                others = [(b if a == link else a, name) for name, (a, b) in self.ends.items() if link in (a, b)]
                out.append((number, link, tuple(f"{self.numbers[other]} at {name}" for other, name in others)))
        return tuple(out)


def decomposition(freedoms: Freedoms, driven: Index, kind: MotionKind) -> Decomposition:
    """Driver links and groups with the freedoms ``driven`` and those that hold passive motions at rest."""
    position = freedoms.position
    m = position.m
    fixed = np.union1d(driven, freedoms.hold).astype(np.intp)
    rows = LinkRows(position, fixed, kind.twists if kind.name else np.eye(6))
    sets, free = link_sets(rows)
    names = m.link_names()
    make = _Maker(rows, driven)
    solved = {position.graph.frame}
    groups, numbers = [], {names[position.graph.frame]: 0}
    for mine in sorted(sets, key=lambda s: not make.is_driver(s)):
        group, ordered = make.group(mine, solved, numbers)
        groups.append(group)
        solved |= set(mine.links)
        for link in ordered:
            numbers[names[link]] = len(numbers)
    for link in free:
        numbers[names[link]] = len(numbers)
    freedom_names = m.freedom_names()
    return Decomposition(
        tuple(freedom_names[c] for c in driven),
        tuple(groups),
        tuple(names[i] for i in free),
        numbers,
        {p.name: (p.a, p.b) for p in m.pairs},
    )


class _Maker:
    """Makes groups of sets of links."""

    def __init__(self, rows: LinkRows, driven: Index) -> None:
        self.rows, self.driven = rows, set(driven.tolist())
        self.m = rows.position.m
        self.ends = rows.position.graph.ends
        self.names = self.m.link_names()

    def _locked(self, k: int) -> bool:
        """Whether a pair is driven, and stands still then."""
        return not self.driven.isdisjoint(self.rows.position.columns(k)) and self.rows.pairs[k].count == self.rows.b

    def is_driver(self, mine: LinkSet) -> bool:
        """Whether a set is a driver link: one link on one driven pair at the frame."""
        at_frame = len(mine.pairs) == 1 and self.rows.position.graph.frame in self.ends[mine.pairs[0]]
        return len(mine.links) == 1 and at_frame and self._locked(mine.pairs[0])

    def letter(self, k: int) -> str:
        """R for a pair that turns alone, T for one that slides alone (driven or not), else the symbol of its type."""
        columns = list(self.rows.position.columns(k))
        T = self.rows.twists
        moves = self.rows.position.rows.S[:, columns]
        if self.rows.b < 6:
            moves = T @ (T.T @ moves)
            other = self.rows.position.rows.S[:, columns] - moves
            moves = moves[:, np.abs(other).max(axis=0) < MOTIONS.still]
        if moves.shape[1] != 1:
            return self.m.pairs[k].type.symbol
        turn, slide = float(np.linalg.norm(moves[:3, 0])), float(np.linalg.norm(moves[3:, 0]))
        pitched = self.m.pairs[k].type.takes_pitch
        return self.m.pairs[k].type.symbol if pitched else "R" if turn > MOTIONS.still * max(1.0, slide) else "T"

    def _shown(self, k: int) -> str:
        """The letter of a pair, in parentheses for a driver within a group."""
        at_frame = self.rows.position.graph.frame in self.ends[k]
        return f"({self.letter(k)})" if self._locked(k) and not at_frame else self.letter(k)

    def group(self, mine: LinkSet, solved: set[int], numbers: dict[str, int]) -> tuple[Group, list[int]]:
        """The group, and its links in order: of a dyad first the one that does not end at the frame."""
        outer = [k for k in mine.pairs if not solved.isdisjoint(self.ends[k])]
        free = sum(self.rows.freedoms(k).shape[1] for k in mine.pairs)
        contours = len(mine.pairs) - len(mine.links)
        order, klass, driver = len(outer), self._class(mine), self.is_driver(mine)
        links, version = list(mine.links), ""
        letters = "".join(map(self._shown, self._round(mine, outer) if contours == 1 else mine.pairs))
        if not driver and self._is_dyad(mine, outer):
            links, outer = self._in_order(outer, numbers)
            (inner,) = set(mine.pairs) - set(outer)
            letters, version = self._dyad([outer[0], inner, outer[1]], links)
        elif not driver:
            outer.sort(key=lambda k: self._place(k, solved, numbers))
        ring = letters if contours == 1 and order == 2 and not mine.couplings else ""
        name = letters if driver else version or ring or f"{_roman(klass)}.{order}"
        couplings = tuple(self.m.couplings[i].name for i in mine.couplings if i < len(self.m.couplings))
        on = [self.names[next(link for link in self.ends[k] if link in solved)] for k in outer]
        return Group(
            name,
            letters,
            driver,
            tuple(self.names[i] for i in links),
            tuple(self.m.pairs[k].name for k in mine.pairs),
            couplings,
            tuple(self.m.pairs[k].name for k in outer),
            tuple(on),
            contours,
            free,
            self.rows.position.graph.width * contours + len(mine.couplings) - free,
            klass,
            order,
            self.m.planar,
        ), links

    def _round(self, mine: LinkSet, outer: Sequence[int]) -> list[int]:
        """The pairs of one contour in their order round it, from an outer pair on."""
        left, at = list(mine.pairs), next(link for link in self.ends[outer[0]] if link not in mine.links)
        out: list[int] = []
        while left:
            k = next((k for k in left if at in self.ends[k] and (out or k == outer[0])), left[0])
            left.remove(k)
            out.append(k)
            a, b = self.ends[k]
            at = a + b - at
        return out

    def _place(self, k: int, solved: Iterable[int], numbers: dict[str, int]) -> tuple[bool, int]:
        """Where the outer end of a pair is: links by number, the frame last."""
        number = numbers[self.names[next(link for link in self.ends[k] if link in solved)]]
        return number == 0, number

    def _in_order(self, outer: Sequence[int], numbers: dict[str, int]) -> tuple[list[int], list[int]]:
        """Links and outer pairs of a dyad, first those at links before the frame, then by number."""
        solved = {link for link, name in enumerate(self.names) if name in numbers}
        pairs = sorted(outer, key=lambda k: self._place(k, solved, numbers))
        return [next(link for link in self.ends[k] if link not in solved) for k in pairs], pairs

    def _is_dyad(self, mine: LinkSet, outer: Sequence[int]) -> bool:
        """Whether two links hang on one inner and an outer pair each, with one planar freedom each."""
        single = all(self.letter(k) in ("R", "T") and not self._locked(k) for k in mine.pairs)
        apart = len({link for k in outer for link in self.ends[k] if link in mine.links}) == 2
        return (
            self.rows.b == 3
            and single
            and apart
            and (len(mine.links), len(mine.pairs), len(outer)) == (2, 3, 2)
            and not mine.couplings
        )

    def _dyad(self, pairs: list[int], links: list[int]) -> tuple[str, str]:
        """Letters and version of a dyad by its pairs in order: guides on the far side of each slide count, the last one most."""
        letters = "".join(map(self.letter, pairs))
        if letters not in BASES and letters[::-1] not in BASES:
            return letters, ""
        reverse = letters not in BASES
        if reverse:
            pairs, links, letters = pairs[::-1], links[::-1], letters[::-1]
        # a guide counts where it is on the dyad's own link (outer pairs), or on the second link (inner pair)
        own = (links[0], links[1], links[1])
        bits = [self.ends[k][0] == link for k, link, letter in zip(pairs, own, letters, strict=True) if letter == "T"]
        two_ways = letters != letters[::-1]
        number = sum(1 << (i + two_ways) for i, bit in enumerate(bits) if bit) + (two_ways and reverse)
        kind = BASES.index(letters) + 1
        return ("TTR" if kind == len(BASES) else letters), f"D{kind}{number}"

    def _class(self, mine: LinkSet) -> int:
        """The class."""
        import networkx as nx

        links = set(mine.links)
        at = [link for k in mine.pairs for link in self.ends[k] if link in links]
        inner: nx.Graph[int] = nx.Graph(self.ends[k] for k in mine.pairs if links.issuperset(self.ends[k]))
        sides = [len(cycle) for cycle in nx.minimum_cycle_basis(inner)]
        return max([2, *sides, *(at.count(link) for link in links)])


def _roman(number: int) -> str:
    return ("", "I", "II", "III", "IV", "V", "VI", "VII", "VIII", "IX", "X")[number] if number <= 10 else str(number)


def joints_at(position: Position) -> tuple[MultipleJoint, ...]:
    """The multiple joints of a mechanism at a closed position; two bearings of the same two links count as one."""
    import networkx as nx

    m, graph = position.m, position.graph
    turning = [
        k for k, p in enumerate(m.pairs) if p.type.f == 1 and p.type.freedoms[0].turns and not p.type.takes_pitch
    ]
    lines = {k: position.rows.S[:, position.columns(k)[0]] for k in turning}
    near: nx.Graph[int] = nx.Graph()
    for link in range(graph.n_links):
        mine = [k for k in turning if link in graph.ends[k]]
        near.add_edges_from((i, k) for j, k in enumerate(mine) for i in mine[:j] if _same_line(lines[i], lines[k]))
    out = []
    for some in sorted(map(sorted, nx.connected_components(near))):
        ends: dict[frozenset[int], int] = {}
        for k in some:
            ends.setdefault(frozenset(graph.ends[k]), k)
        links = sorted(set().union(*ends))
        if len(links) > 2 and len(ends) == len(links) - 1:
            names = m.link_names()
            out.append(MultipleJoint(tuple(names[i] for i in links), tuple(m.pairs[k].name for k in ends.values())))
    return tuple(out)


def _same_line(a: Array, b: Array) -> bool:
    """Whether two turns (w, v), |w| = 1, are about one line, in whatever sense."""
    sense = 1.0 if a[:3] @ b[:3] > 0 else -1.0
    return bool(np.abs(a - sense * b).max() < RANKS.position)
