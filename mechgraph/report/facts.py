"""The facts of a determinacy report as plain data, and its ledgers."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from mechgraph.equations.build import formulate
from mechgraph.equations.terms import Ledger, LedgerRow
from mechgraph.model.mechanism import Mechanism

if TYPE_CHECKING:
    from mechgraph.report.report import DeterminacyReport

FINDINGS = ("undriven", "passive", "locked", "drivable", "not_drivable", "advice")


def ledger(m: Mechanism, bookkeeping: str) -> Ledger:
    """The ledger of a mechanism: counted from the pair table where that suffices, otherwise from its formulation."""
    countable = bookkeeping in ("lee", "minimal") and not getattr(m, "couplings", ())
    return counted_ledger(m, bookkeeping) if countable else formulate(m, bookkeeping).ledger()


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


def to_dict(r: DeterminacyReport) -> dict[str, Any]:
    """All facts of a report as plain data."""
    return {**_of_graph(r), **_of_geometry(r), **_of_reactions(r), **_findings(r)}


def _of_graph(r: DeterminacyReport) -> dict[str, Any]:
    books = {name: r.ledger(name) for name in ("lee", "minimal")}
    return {
        "mechanism": r.mechanism.name,
        "verdict": r.verdict,
        "note": r.note,
        "determinate": r.determinate,
        "engine": r.engine,
        "links": list(r.links),
        "pairs": list(r.pairs),
        "loops": [
            {"steps": [list(step) for step in loop], **asdict(fact)}
            for loop, fact in zip(r.loops, r.loop_facts, strict=True)
        ],
        "mobility_by_count": r.mobility_by_count,
        "generic": asdict(r.generic),
        "parts": asdict(r.parts),
        "ledger": {
            name: {
                "unknowns": b.unknowns,
                "equations": b.equations,
                "balance": b.balance,
                "by_kind": {k: [row.count, row.unknowns, row.equations] for k, row in b.by_kind.items()},
            }
            for name, b in books.items()
        },
    }


def _of_geometry(r: DeterminacyReport) -> dict[str, Any]:
    return {
        "mobility": r.mobility,
        "finite_mobility": r.finite_mobility,
        "inputs": r.inputs,
        "stroke": r.motion.stroke if r.motion else None,
        "redundancy": r.redundancy,
        "excess": r.excess,
        "margin": r.margin,
        "dropped": r.dropped,
        "near": r.near,
    }


def _of_reactions(r: DeterminacyReport) -> dict[str, Any]:
    found = r.reactions
    return {
        "unique": r.unique,
        "self_stress_count": found.count if found else None,
        "self_stresses": [
            {"group": s.group, "components": dict(s.components), "efforts": dict(s.efforts)} for s in r.self_stresses
        ],
        "transverse": [{"text": t.text, **asdict(t)} for t in found.transverse] if found else [],
        "combinations": [list(c) for c in found.combinations] if found else [],
        "groups_without_combinations": found.unsought if found else 0,
    }


def _findings(r: DeterminacyReport) -> dict[str, Any]:
    return {
        "suggested_drives": list(r.suggested_drives),
        "dependent_drives": [list(g) for g in r.dependent_drives],
        "contradicting_drives": r.contradicting_drives,
        "effects": [asdict(e) for e in r.effects],
        **{key: [asdict(finding) for finding in getattr(r, key)] for key in FINDINGS},
    }
