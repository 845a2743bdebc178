"""The facts of a determinacy report that follow from the graph alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from mechgraph.equations.build import BOOKKEEPINGS, BookkeepingName, formulate
from mechgraph.equations.terms import Ledger, LedgerRow
from mechgraph.graph.linkgraph import LinkGraph, MatchingParts, parts_of
from mechgraph.model.mechanism import Mechanism


@dataclass(frozen=True, repr=False)
class GraphFacts:
    """Names, loops and counts of a mechanism, whatever its geometry."""

    mechanism: Mechanism
    graph: LinkGraph

    @property
    def links(self) -> tuple[str, ...]:
        """Names of the links."""
        return self.mechanism.link_names()

    @cached_property
    def pairs(self) -> tuple[str, ...]:
        """Names of the pairs."""
        return tuple(p.name for p in self.mechanism.pairs)

    @cached_property
    def loops(self) -> tuple[tuple[tuple[str, int], ...], ...]:
        """Independent loops, each a chain of (pair name, sign)."""
        return tuple(tuple((self.pairs[k], sign) for k, sign in loop) for loop in self.graph.loops)

    @property
    def freedom_count(self) -> int:
        """Sum of the freedoms of the pairs."""
        return sum(p.type.f for p in self.mechanism.pairs)

    @property
    def equation_count(self) -> int:
        """Number of closure equations: six a loop, one a coupling."""
        return 6 * self.graph.n_loops + len(self.mechanism.couplings)

    @property
    def mobility_by_count(self) -> int:
        """Kutzbach mobility: sum of freedoms - closure equations."""
        return self.freedom_count - self.equation_count

    def ledger(self, bookkeeping: BookkeepingName = "lee") -> Ledger:
        """Unknowns against equations in a bookkeeping, ``"lee"`` or ``"minimal"``."""
        countable = isinstance(bookkeeping, str) and bookkeeping in BOOKKEEPINGS and not self.mechanism.couplings
        if countable:
            return counted_ledger(self.mechanism, bookkeeping)
        return formulate(self.mechanism, bookkeeping).ledger()

    @cached_property
    def parts(self) -> MatchingParts:
        """Dulmage-Mendelsohn parts: which links and pairs are over-, which underdetermined by count."""
        return parts_of(self.mechanism, self.graph)


def counted_ledger(m: Mechanism, bookkeeping: str) -> Ledger:
    """The ledger counted from the pair table: must agree with that of the formulation."""
    rows: dict[str, LedgerRow] = {}
    for pair in m.pairs:
        unknowns, equations = pair.type.unknowns_and_equations if bookkeeping == "lee" else (6 - pair.type.f, 0)
        old = rows.get(pair.type.symbol, LedgerRow(0, 0, 0))
        rows[pair.type.symbol] = LedgerRow(old.count + 1, old.unknowns + unknowns, old.equations + equations)
    rows["driver"] = LedgerRow(len(m.drives), len(m.drives), 0)
    rows["link"] = LedgerRow(len(m.links) - 1, 0, 6 * (len(m.links) - 1))
    return Ledger(bookkeeping, rows)
