"""Driver links and structural groups of a position with their names: class and order, dyads with their versions, connections.

Class (Artobolevski): the most sides of a closed contour of the group, a link with k pairs being one of k sides, 2 at least; order: the
number of pairs to links before. A dyad has two links and three pairs with one planar freedom each, and is named by these, from the link
before round to the other one: RRR, RRT, RTR, TRT, TTR (R turns, T slides).

Its versions D10 to D57 tell on which of the two links of each slide the guide is, and in which order the pairs come (first the link that
does not end at the frame): RRR one, RTR two, RRT, TRT four each, TTR eight, 19 in all. A guide is on the link named first in its pair.
The figures of the versions are not in the text of the source; the numbers agree with all that the text says of D20, D21, D50 and D54.
Source: Marghitu, Fundamentals, sections 2.5 to 2.8 and 2.14.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mechgraph.document import Block, Document, Paragraph, Shown, Table
from mechgraph.graph.linkgraph import Index
from mechgraph.numerics.tolerances import MOTIONS
from mechgraph.structure.groups import LinkSet, link_sets
from mechgraph.structure.kind import Kind
from mechgraph.structure.link_rows import LinkRows
from mechgraph.structure.mobility import Freedoms

BASES = ("RRR", "RRT", "RTR", "TRT", "RTT")
"""Dyads by type 1 to 5, in the order in which version 0 has its pairs; the last one is called TTR."""


@dataclass(frozen=True)
class Group:
    """A driver link, or a structural group.

    Attributes
    ----------
    name : R or T for a driver link, a dyad's version (``D42``), the letters of another group of one contour, else class and order
        (``III.3``).
    letters : its pairs by what they do (R turns, T slides, other symbols as declared; in parentheses where one
        between moving links is driven), of one contour in their order round it.
    driver : whether it is a driver link.
    links, pairs, couplings : names of what it adds; ``outer`` the pairs among these that lead to links ``on`` before.
    contours : independent contours, pairs (and couplings, as rows of one) beyond the links.
    freedoms : freedoms of its pairs that are neither driven nor held.
    redundancy : closure equations of its contours that depend on the others, 6 contours + couplings - freedoms.
    class_, order : as above.
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

    @property
    def family(self) -> float | None:
        """Freedoms that no link of its contours has, their mean where they differ (the apparent family); None without contours."""
        return self.redundancy / self.contours if self.contours else None


@dataclass(frozen=True, repr=False)
class Decomposition(Shown):
    """The driver links and groups of a mechanism in the order in which they can be solved.

    Attributes
    ----------
    drivers : the freedoms at rest.
    groups : driver links and groups.
    free : links that these drivers do not determine.
    numbers : number of every link, the frame 0, in that order.
    ends : names of the two links of every pair.
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


def decomposition(freedoms: Freedoms, driven: Index, kind: Kind) -> Decomposition:
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
            6 * contours + len(mine.couplings) - free,
            klass,
            order,
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
