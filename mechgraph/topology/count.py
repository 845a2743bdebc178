"""Counting without geometry: freedoms, loops, Kutzbach mobility and the ledger of unknowns and equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from mechgraph.errors import DeclarationError
from mechgraph.model.mechanism import Mechanism
from mechgraph.topology.linkgraph import LinkGraph


@dataclass(frozen=True)
class LedgerRow:
    """One line of the ledger: ``count`` things of one kind and the unknowns and equations that they bring together."""

    count: int
    unknowns: int
    equations: int


@dataclass(frozen=True)
class Ledger:
    """Unknowns against equations, by kind: pair symbols, ``driver``, ``link`` (moving).

    ``balance = equations - unknowns = mobility by count - drivers``: zero is determinate by count, positive leaves freedoms
    undriven, negative is redundant.
    """

    bookkeeping: str
    by_kind: Mapping[str, LedgerRow]

    @property
    def unknowns(self) -> int:
        """Sum of unknowns."""
        return sum(row.unknowns for row in self.by_kind.values())

    @property
    def equations(self) -> int:
        """Sum of equations."""
        return sum(row.equations for row in self.by_kind.values())

    @property
    def balance(self) -> int:
        """Equations minus unknowns."""
        return self.equations - self.unknowns


def mobility_by_count(m: Mechanism, graph: LinkGraph) -> int:
    """Kutzbach: sum of freedoms - 6 loops. Source: Kutzbach 1929; Marghitu, equation 2.4."""
    return sum(p.type.f for p in m.pairs) - 6 * len(graph.chords)


BOOKKEEPINGS = {
    "lee": lambda row: row.unknowns_and_equations,
    "minimal": lambda row: (6 - row.f, 0),
}
"""Unknowns and equations of one pair by the name of the bookkeeping."""


def ledger(m: Mechanism, bookkeeping: str = "lee") -> Ledger:
    """The ledger of a mechanism in the named bookkeeping, counted from the pair table.

    Raises
    ------
    DeclarationError
        for an unknown bookkeeping.
    """
    if bookkeeping not in BOOKKEEPINGS:
        raise DeclarationError("ledger", [f"bookkeeping {bookkeeping!r}: expected one of {', '.join(BOOKKEEPINGS)}"])
    entry = BOOKKEEPINGS[bookkeeping]
    rows: dict[str, LedgerRow] = {}
    for pair in m.pairs:
        unknowns, equations = entry(pair.type)
        old = rows.get(pair.type.symbol, LedgerRow(0, 0, 0))
        rows[pair.type.symbol] = LedgerRow(old.count + 1, old.unknowns + unknowns, old.equations + equations)
    rows["driver"] = LedgerRow(len(m.drives), len(m.drives), 0)
    moving = len(m.links) - 1
    rows["link"] = LedgerRow(moving, 0, 6 * moving)
    return Ledger(bookkeeping, MappingProxyType(rows))
