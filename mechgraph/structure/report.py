"""The determinacy report: facts of the graph and of its geometry, gathered once, each computed when first asked for."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.document import Document, to_html, to_markdown, to_text
from mechgraph.errors import AssemblyError
from mechgraph.formulation.build import formulate
from mechgraph.formulation.registry import Ledger
from mechgraph.model.mechanism import Mechanism
from mechgraph.motion.assembly import assembled, assembled_at, named_columns
from mechgraph.motion.system import Index, System
from mechgraph.structure import wording
from mechgraph.structure.advice import Effect, advice, independent_rows
from mechgraph.structure.findings import Finding, LoopFact, input_motions, locked_findings, loop_facts, passive_finding
from mechgraph.structure.freedom import Freedoms, free_motion, is_large
from mechgraph.structure.generic import Generic, generic
from mechgraph.structure.mobility import FiniteMotion, finite_motion
from mechgraph.structure.passive import STILL
from mechgraph.structure.stress import SelfStress, Uniqueness, uniqueness
from mechgraph.topology.linkgraph import LinkGraph, link_graph
from mechgraph.topology.parts import Parts, parts_of

NEAR = 1e-3
"""Margin below which a position is called nearly singular."""


@dataclass(frozen=True)
class Geometry:
    """A closed position: the scaled system, its state, the driven columns and what can move."""

    system: System
    x: Array
    driven: Index
    freedoms: Freedoms


@dataclass(frozen=True)
class DeterminacyReport:
    """What the graph alone and the graph with its geometry say about a mechanism; prints as a report.

    Facts that need geometry are None (or empty) for a topology, and where the loops cannot be closed (see ``note``).
    """

    mechanism: Mechanism
    graph: LinkGraph
    note: str = ""
    geometry: Geometry | None = field(default=None, repr=False)

    # --- the graph alone -----------------------------------------------------------------------------------------------

    @property
    def links(self) -> tuple[str, ...]:
        """Names of the links."""
        return self.mechanism.link_names()

    @property
    def pairs(self) -> tuple[str, ...]:
        """Names of the pairs."""
        return tuple(p.name for p in self.mechanism.pairs)

    @property
    def loops(self) -> tuple[tuple[tuple[str, int], ...], ...]:
        """Independent loops, each a chain of (pair name, sign)."""
        return tuple(tuple((self.pairs[k], sign) for k, sign in loop) for loop in self.graph.loops)

    @property
    def freedom_count(self) -> int:
        """Sum of the freedoms of the pairs."""
        return sum(p.type.f for p in self.mechanism.pairs)

    @property
    def mobility_by_count(self) -> int:
        """Kutzbach mobility, sum of freedoms - 6 loops."""
        return self.freedom_count - 6 * len(self.graph.loops)

    def ledger(self, bookkeeping: str = "lee") -> Ledger:
        """Unknowns against equations in a bookkeeping, ``"lee"`` or ``"minimal"``."""
        return formulate(self.mechanism, bookkeeping).ledger()

    @cached_property
    def generic(self) -> Generic:
        """Rank and excess for random geometry: what the topology alone decides."""
        return generic(self.mechanism, self.graph)

    @cached_property
    def parts(self) -> Parts:
        """Dulmage-Mendelsohn parts: which links and pairs are over-, which underdetermined by count."""
        return parts_of(self.mechanism, self.graph)

    @cached_property
    def loop_facts(self) -> tuple[LoopFact, ...]:
        """Every loop by itself: its chain, freedoms, rank and excess."""
        g = self.geometry
        return loop_facts(self.mechanism, self.loops, g.system if g else None, g.x if g else None)

    # --- with geometry -------------------------------------------------------------------------------------------------

    @property
    def mobility(self) -> int | None:
        """Freedoms minus rank of the closure Jacobian here."""
        return self.geometry.freedoms.mobility if self.geometry else None

    @cached_property
    def motion(self) -> FiniteMotion | None:
        """What following the motions over finite strokes showed."""
        return finite_motion(self.geometry.system, self.geometry.x) if self.geometry else None

    @property
    def finite_mobility(self) -> int | None:
        """Dimension of the set of closed positions: what really moves."""
        return self.motion.mobility if self.motion else None

    @property
    def redundancy(self) -> int | None:
        """6 loops minus rank: number of self-stresses with the drivers free."""
        return 6 * len(self.graph.loops) - self.geometry.freedoms.rank if self.geometry else None

    @property
    def excess(self) -> dict[str, int]:
        """The redundancy by reason: ``structural`` (whatever the dimensions), ``dimensions`` (all along the motion), ``here``."""
        if not self.geometry or not self.motion or self.redundancy is None:
            return {}
        nearby = 6 * len(self.graph.loops) - self.motion.rank_nearby
        structural = min(self.generic.excess, nearby)
        return {"structural": structural, "dimensions": nearby - structural, "here": self.redundancy - nearby}

    @property
    def margin(self) -> float | None:
        """Smallest kept singular value over the largest: small means nearly singular."""
        return self.geometry.freedoms.margin if self.geometry else None

    @property
    def dropped(self) -> float | None:
        """Largest dropped singular value over the largest (0 where none is dropped)."""
        return self.geometry.freedoms.dropped if self.geometry else None

    @property
    def near(self) -> bool:
        """Whether the position is nearly singular: the verdicts on rank and uniqueness hold, but with a small margin."""
        return self.margin is not None and self.margin < NEAR

    @cached_property
    def reactions(self) -> Uniqueness | None:
        """Verdict on every reaction component and effort, with the self-stresses."""
        g = self.geometry
        return uniqueness(g.system.at(g.x[:, None]), g.driven) if g else None

    @property
    def unique(self) -> dict[str, dict[str, bool]]:
        """For every pair: component -> whether it is unique; ``effort`` for a driven freedom."""
        return self.reactions.unique if self.reactions else {}

    @property
    def self_stresses(self) -> tuple[SelfStress, ...]:
        """Reaction states without load, with the declared drivers: a canonical sparse basis."""
        return self.reactions.states if self.reactions else ()

    @cached_property
    def undriven(self) -> tuple[Finding, ...]:
        """Freedoms left free that are neither driven nor passive."""
        if not self.geometry:
            return ()
        found = self.geometry.freedoms.undriven
        return tuple(Finding(f"{', '.join(f.names)} {'move' if len(f.names) > 1 else 'moves'}", f.names) for f in found)

    @cached_property
    def passive(self) -> tuple[Finding, ...]:
        """Passive freedoms by name and line."""
        g = self.geometry
        return tuple(passive_finding(g.system, p) for p in g.freedoms.passive) if g else ()

    @cached_property
    def locked(self) -> tuple[Finding, ...]:
        """Freedoms that cannot move here, with the reason."""
        g = self.geometry
        return locked_findings(g.system, g.x, g.freedoms) if g else ()

    @cached_property
    def _input(self) -> Array:
        g = self.geometry
        return input_motions(g.freedoms, g.freedoms.null) if g else np.zeros((self.freedom_count, 0))

    @cached_property
    def drivable(self) -> tuple[Finding, ...]:
        """Freedoms that can serve as a driver here: single freedoms that move in other than passive motions."""
        if not self.geometry:
            return ()
        moves = np.abs(self._input).max(axis=1, initial=0.0) > STILL
        single = [d for p in self.mechanism.pairs for d in p.type.drivable]
        names = self.mechanism.freedom_names()
        return tuple(Finding(f"{n} can drive", (n,)) for n, m, s in zip(names, moves, single, strict=True) if m and s)

    @cached_property
    def not_drivable(self) -> tuple[Finding, ...]:
        """Single freedoms that cannot drive here, with the reason."""
        g = self.geometry
        if not g or not self.motion:
            return ()
        good = {name for finding in self.drivable for name in finding.freedoms}
        still = {name for finding in self.locked for name in finding.freedoms}
        nearby = np.abs(self.motion.null_nearby).max(axis=1, initial=0.0) > 1e3 * STILL
        out = []
        for i, (name, single) in enumerate(
            zip(self.mechanism.freedom_names(), (d for p in self.mechanism.pairs for d in p.type.drivable), strict=True)
        ):
            if single and name not in good:
                why = "moves only in a passive motion"
                if name in still:
                    why = (
                        "dead point here: it moves in positions near by"
                        if nearby[i] and g.freedoms.mobility
                        else "it stands still"
                    )
                out.append(Finding(f"{name} cannot drive: {why}", (name,)))
        return tuple(out)

    @property
    def inputs(self) -> int | None:
        """Input freedoms: mobility minus passive freedoms."""
        return self.geometry.freedoms.mobility - len(self.geometry.freedoms.passive) if self.geometry else None

    @cached_property
    def suggested_drives(self) -> tuple[str, ...]:
        """Freedoms that would complete the drivers (all of them where none is declared): at the frame first, independent."""
        g = self.geometry
        if not g or not g.freedoms.undriven:
            return ()
        rest = np.stack([f.rates for f in g.freedoms.undriven], axis=1)
        names = self.mechanism.freedom_names()
        good = {name for finding in self.drivable for name in finding.freedoms}
        at_frame = {n for p in self.mechanism.pairs if self.mechanism.frame in (p.a, p.b) for n in p.freedom_names}
        order = sorted((i for i, n in enumerate(names) if n in good), key=lambda i: (names[i] not in at_frame, i))
        return tuple(names[i] for i in sorted(independent_rows(rest, order, rest.shape[1])))

    @cached_property
    def dependent_drives(self) -> tuple[tuple[str, ...], ...]:
        """For mobility above one: sets of freedoms of which only one can be driven, as they move in proportion."""
        if not self.inputs or self.inputs < 2:
            return ()
        names = [name for finding in self.drivable for name in finding.freedoms]
        index = {n: i for i, n in enumerate(self.mechanism.freedom_names())}
        rows = {n: self._input[index[n]] / np.linalg.norm(self._input[index[n]]) for n in names}
        groups: list[list[str]] = []
        for n in names:
            home = next((g for g in groups if abs(abs(rows[g[0]] @ rows[n]) - 1) < 1e-9), None)
            if home is None:
                groups.append([n])
            else:
                home.append(n)
        return tuple(tuple(g) for g in groups if len(g) > 1)

    @property
    def determinate(self) -> bool:
        """Nothing left free that is neither driven nor passive, and every reaction and effort unique."""
        if not self.geometry:
            return False
        return not self.geometry.freedoms.undriven and all(v for row in self.unique.values() for v in row.values())

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """Pair changes with their computed effect: they remove redundancy, or free a structure."""
        g = self.geometry
        return advice(g.system, g.x, g.freedoms) if g else ()

    @cached_property
    def advice(self) -> tuple[Finding, ...]:
        """What would make it determinate: drivers to add, pair changes with their computed effect."""
        out = []
        if self.suggested_drives:
            what = "drive" if not self.mechanism.drives else "drive also"
            out.append(
                Finding(
                    f"{what} {', '.join(self.suggested_drives)}: nothing but passive freedoms is left free then",
                    self.suggested_drives,
                )
            )
        out += [Finding(e.text, tuple(pair for pair, _, _ in e.changes)) for e in self.effects]
        return tuple(out)

    # --- print -----------------------------------------------------------------------------------------------------------

    @property
    def verdict(self) -> str:
        """The verdict in one sentence."""
        return wording.verdict(self)

    def document(self) -> Document:
        """The report as a document."""
        return wording.document(self)

    def to_dict(self) -> dict[str, Any]:
        """All facts as plain data."""
        findings = ("undriven", "passive", "locked", "drivable", "not_drivable", "advice")
        books = {name: self.ledger(name) for name in ("lee", "minimal")}
        return {
            "mechanism": self.mechanism.name,
            "verdict": self.verdict,
            "note": self.note,
            "determinate": self.determinate,
            "links": list(self.links),
            "pairs": list(self.pairs),
            "loops": [
                {"steps": [list(step) for step in loop], **asdict(fact)}
                for loop, fact in zip(self.loops, self.loop_facts, strict=True)
            ],
            "mobility_by_count": self.mobility_by_count,
            "generic": asdict(self.generic),
            "parts": asdict(self.parts),
            "mobility": self.mobility,
            "finite_mobility": self.finite_mobility,
            "inputs": self.inputs,
            "stroke": self.motion.stroke if self.motion else None,
            "redundancy": self.redundancy,
            "excess": self.excess,
            "margin": self.margin,
            "dropped": self.dropped,
            "near": self.near,
            "ledger": {
                name: {
                    "unknowns": b.unknowns,
                    "equations": b.equations,
                    "balance": b.balance,
                    "by_kind": {k: [r.count, r.unknowns, r.equations] for k, r in b.by_kind.items()},
                }
                for name, b in books.items()
            },
            "unique": self.unique,
            "self_stresses": [
                {"group": s.group, "components": dict(s.components), "efforts": dict(s.efforts)}
                for s in self.self_stresses
            ],
            "combinations": [list(c) for c in self.reactions.combinations] if self.reactions else [],
            "suggested_drives": list(self.suggested_drives),
            "dependent_drives": [list(g) for g in self.dependent_drives],
            "effects": [asdict(e) for e in self.effects],
            **{key: [asdict(finding) for finding in getattr(self, key)] for key in findings},
        }

    def to_json(self) -> str:
        """All facts as JSON."""
        return json.dumps(self.to_dict(), indent=2) + "\n"

    def to_markdown(self) -> str:
        """The report as Markdown."""
        return to_markdown(self.document())

    def __str__(self) -> str:
        return to_text(self.document())

    def _repr_html_(self) -> str:
        return to_html(self.document())


def check(m: Mechanism, at: Mapping[str, float] | None = None) -> DeterminacyReport:
    """The determinacy report of a mechanism: of its graph, and where it has geometry of its closed position at ``start``.

    Parameters
    ----------
    at : values of freedoms at which to assemble first, e.g. ``{"A": 0.3}``.

    Raises
    ------
    AssemblyError
        where ``at`` is given and cannot be reached. Without it, loops that cannot be closed are said in ``note``.
    """
    graph = link_graph(m)
    if not m.has_geometry:
        return DeterminacyReport(m, graph, "Topology only: no geometry is declared.")
    try:
        system, x = assembled_at(m, at) if at else assembled(m)
    except AssemblyError as error:
        if at:
            raise
        return DeterminacyReport(m, graph, f"No facts of geometry: {error}")
    columns, _ = named_columns(m, system, {d.freedom: 0.0 for d in m.drives})
    return DeterminacyReport(m, graph, "", Geometry(system, x, columns, free_motion(system, x, columns)))
