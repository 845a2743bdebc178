"""The determinacy report: facts of the graph and of its geometry, gathered once, each computed when first asked for."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, get_args

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import assembled, assembled_at, named_columns
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.rank import EngineName
from mechgraph.document import Document, to_html, to_markdown, to_text
from mechgraph.equations.terms import Ledger
from mechgraph.errors import AssemblyError, DeclarationError
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.linear import independent_rows
from mechgraph.numerics.tolerances import RANKS
from mechgraph.report import drivers, facts, sections
from mechgraph.report import sentences as wording
from mechgraph.report.findings import Finding, LoopFact, input_motions, locked_findings, loop_facts, passive_finding
from mechgraph.structure.finite_motion import FiniteMotion, finite_motion
from mechgraph.structure.generic import Generic, generic
from mechgraph.structure.mobility import Freedoms, free_motion
from mechgraph.structure.pair_changes import Effect, advice
from mechgraph.structure.self_stress import SelfStress
from mechgraph.structure.uniqueness import Uniqueness, uniqueness
from mechgraph.topology.linkgraph import LinkGraph, link_graph
from mechgraph.topology.matching import Parts, parts_of


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
    What is expensive is computed when first asked for, whatever the size; ``engine`` says which one decided the rank.
    """

    mechanism: Mechanism
    graph: LinkGraph
    note: str = ""
    geometry: Geometry | None = field(default=None, repr=False)
    asked: EngineName = field(default="auto", repr=False)

    # --- the graph alone -----------------------------------------------------------------------------------------------

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
    def mobility_by_count(self) -> int:
        """Kutzbach mobility: sum of freedoms - closure equations."""
        return self.freedom_count - self.equation_count

    @property
    def equation_count(self) -> int:
        """Number of closure equations: six a loop, one a coupling."""
        return 6 * self.graph.n_loops + len(getattr(self.mechanism, "couplings", ()))

    @property
    def engine(self) -> str:
        """Which engine decided the rank here, ``"dense"`` or ``"sparse"``; empty where there is no geometry."""
        return self.geometry.freedoms.closure.engine if self.geometry else ""

    def ledger(self, bookkeeping: str = "lee") -> Ledger:
        """Unknowns against equations in a bookkeeping, ``"lee"`` or ``"minimal"``."""
        return facts.ledger(self.mechanism, bookkeeping)

    @cached_property
    def generic(self) -> Generic:
        """Rank and excess for random geometry: what the topology alone decides."""
        return generic(self.mechanism, self.graph, self.asked)

    @cached_property
    def parts(self) -> Parts:
        """Dulmage-Mendelsohn parts: which links and pairs are over-, which underdetermined by count."""
        return parts_of(self.mechanism, self.graph)

    @cached_property
    def loop_facts(self) -> tuple[LoopFact, ...]:
        """Every loop taken alone: its chain, freedoms, rank and excess."""
        g = self.geometry
        return loop_facts(self.mechanism, self.loops, g.system if g else None, g.x if g else None)

    # --- with geometry -------------------------------------------------------------------------------------------------

    @property
    def mobility(self) -> int | None:
        """Freedoms minus rank of the closure Jacobian here."""
        return self.geometry.freedoms.mobility if self.geometry else None

    @cached_property
    def motion(self) -> FiniteMotion | None:
        """What was seen when the motions were followed over finite strokes."""
        g = self.geometry
        return finite_motion(g.system, g.x, g.freedoms.closure, self.asked) if g else None

    @property
    def finite_mobility(self) -> int | None:
        """Mobility over finite strokes: the dimension of the set of closed positions."""
        return self.motion.mobility if self.motion else None

    @property
    def redundancy(self) -> int | None:
        """Closure equations minus rank: number of self-stresses with the drivers free."""
        return self.geometry.freedoms.redundancy if self.geometry else None

    @property
    def excess(self) -> dict[str, int]:
        """The redundancy by reason: ``structural`` (whatever the dimensions), ``dimensions`` (all along the motion), ``here``."""
        if not self.motion or self.redundancy is None:
            return {}
        nearby = self.equation_count - self.motion.rank_nearby
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
        """Whether a small change may change the verdict: a small singular value was kept, or one above rounding dropped."""
        if self.margin is None or self.dropped is None:
            return False
        return self.margin < self.near_below or self.dropped > RANKS.doubt or self.dead_point

    @property
    def near_below(self) -> float:
        """Margin below which a position is called nearly singular; of a regular chain of n loops it goes as 1 / (n + 1)."""
        return 2.0 * RANKS.near / (1 + max(self.graph.n_loops, 1))

    @property
    def dead_point(self) -> bool:
        """Whether a driver is near a dead point: it hardly moves when the mechanism moves."""
        return bool(self.geometry and self.geometry.freedoms.mobility and self.geometry.freedoms.drive < RANKS.near)

    @property
    def contradicting_drives(self) -> bool:
        """Whether the declared drivers cannot move independently of each other."""
        return bool(self.geometry and self.geometry.freedoms.dependent)

    @cached_property
    def reactions(self) -> Uniqueness | None:
        """Verdict on every reaction component and effort, with the self-stresses."""
        g = self.geometry
        if not g:
            return None
        return uniqueness(Configuration(g.system, g.x[:, None]), g.driven, self.asked, g.freedoms.driven_closure)

    @property
    def unique(self) -> dict[str, dict[str, bool]]:
        """For every pair: component -> whether it is unique; ``effort`` for a driven freedom."""
        return self.reactions.unique if self.reactions else {}

    @cached_property
    def self_stresses(self) -> tuple[SelfStress, ...]:
        """Reaction states without load, with the declared drivers: a canonical sparse basis.

        Those that connect loops are left out where they are more than ``structure.uniqueness.CONNECTING``.
        """
        return self.reactions.states if self.reactions else ()

    @cached_property
    def undriven(self) -> tuple[Finding, ...]:
        """Freedoms that are neither driven nor passive."""
        if not self.geometry:
            return ()
        return drivers.left_free(self.mechanism, self.geometry.freedoms)

    @cached_property
    def passive(self) -> tuple[Finding, ...]:
        """Passive freedoms by name and line."""
        g = self.geometry
        return tuple(passive_finding(g.system, p) for p in g.freedoms.passive) if g else ()

    @cached_property
    def locked(self) -> tuple[Finding, ...]:
        """Freedoms that cannot move here, with the reason."""
        g = self.geometry
        return locked_findings(g.system, g.x, g.freedoms, self._null_nearby) if g else ()

    @property
    def _null_nearby(self) -> Array | None:
        return self.motion.null_nearby if self.motion else None

    @cached_property
    def _input(self) -> Array:
        g = self.geometry
        return input_motions(g.freedoms, g.freedoms.null) if g else np.zeros((self.freedom_count, 0))

    @cached_property
    def drivable(self) -> tuple[Finding, ...]:
        """Freedoms that can serve as a driver here: single freedoms that move in other than passive motions."""
        return drivers.drivable(self.mechanism, self._input) if self.geometry else ()

    @cached_property
    def not_drivable(self) -> tuple[Finding, ...]:
        """Single freedoms that cannot drive here, with the reason."""
        g = self.geometry
        return drivers.not_drivable(self.mechanism, g.freedoms, self.drivable, self._null_nearby) if g else ()

    @property
    def inputs(self) -> int | None:
        """Input freedoms: mobility minus passive freedoms."""
        return self.geometry.freedoms.mobility - len(self.geometry.freedoms.passive) if self.geometry else None

    @cached_property
    def suggested_drives(self) -> tuple[str, ...]:
        """Freedoms that would complete the drivers (all of them where none is declared): at the frame first, independent."""
        g, m = self.geometry, self.mechanism
        if not g:
            return ()
        place = {name: i for i, name in enumerate(m.freedom_names())}
        asked = [int(c) for c in g.driven] + [place[n] for n in drivers.suggested(m, g.freedoms, self.drivable)]
        kept = set(independent_rows(g.freedoms.null, asked, len(asked)))
        names = tuple(n for n, i in place.items() if i in kept and i in asked[len(g.driven) :])
        while names:
            # a driver may stop a motion that was passive, and so leave another one undriven
            columns, _ = named_columns(m, g.system, dict.fromkeys([*(d.freedom for d in m.drives), *names], 0.0))
            after = free_motion(g.system, g.x, columns, self.asked)
            free = [f.rates for f in after.undriven]
            more = drivers.suggested(m, after, drivers.drivable(m, np.stack(free, axis=1))) if free else ()
            together = [*(d.freedom for d in m.drives), *names, *more]
            columns, _ = named_columns(m, g.system, dict.fromkeys(together, 0.0))
            if not more or free_motion(g.system, g.x, columns, self.asked).dependent:
                break
            names = (*names, *more)
        return names

    @cached_property
    def dependent_drives(self) -> tuple[tuple[str, ...], ...]:
        """For mobility above one: sets of freedoms of which only one can be driven, as they move in proportion."""
        return drivers.proportional(self.mechanism, self._input, self.drivable) if (self.inputs or 0) > 1 else ()

    @property
    def determinate(self) -> bool:
        """Whether every freedom is driven or passive, and every reaction and effort unique."""
        if not self.geometry or self.contradicting_drives:
            return False
        return not self.geometry.freedoms.undriven and bool(self.reactions and self.reactions.all_unique)

    @cached_property
    def effects(self) -> tuple[Effect, ...]:
        """Pair changes with their computed effect: they remove redundancy, or free a structure."""
        g = self.geometry
        return advice(g.freedoms, g.driven, self.finite_mobility or 0, self.asked) if g else ()

    @cached_property
    def advice(self) -> tuple[Finding, ...]:
        """What would make it determinate: drivers to add, pair changes with their computed effect."""
        out = []
        if self.suggested_drives:
            what = "drive" if not self.mechanism.drives else "drive also"
            out.append(
                Finding(
                    f"{what} {', '.join(self.suggested_drives)}: then every freedom is driven or passive",
                    self.suggested_drives,
                )
            )
        out += [Finding(e.text, tuple(pair for pair, _, _ in e.changes)) for e in self.effects]
        return tuple(out)

    # --- print -----------------------------------------------------------------------------------------------------------

    @cached_property
    def verdict(self) -> str:
        """The verdict in one sentence."""
        return wording.verdict(self)

    def document(self) -> Document:
        """The report as a document."""
        return sections.document(self)

    def to_dict(self) -> dict[str, Any]:
        """All facts as plain data."""
        return facts.to_dict(self)

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


def check(m: Mechanism, at: Mapping[str, float] | None = None, *, engine: EngineName = "auto") -> DeterminacyReport:
    """The determinacy report of a mechanism: of its graph, and where it has geometry of its closed position at ``start``.

    Parameters
    ----------
    at : values of freedoms at which to assemble first, e.g. ``{"A": 0.3}``.
    engine : which engine decides ranks, ``"dense"`` or ``"sparse"``; ``"auto"`` takes the faster one. The report is the same.

    Raises
    ------
    AssemblyError
        where ``at`` is given and cannot be reached. Without it, loops that cannot be closed are reported in ``note``.
    """
    if engine not in get_args(EngineName):
        raise DeclarationError("check", [f"engine = {engine!r}: expected one of {', '.join(get_args(EngineName))}"])
    graph = m.once(link_graph)
    if not m.has_geometry:
        return DeterminacyReport(m, graph, "Topology only: no geometry is declared.", asked=engine)
    try:
        system, x = assembled_at(m, at) if at else assembled(m)
    except AssemblyError as error:
        if at:
            raise
        return DeterminacyReport(m, graph, f"No facts that need geometry: {error}", asked=engine)
    columns, _ = named_columns(m, system, {d.freedom: 0.0 for d in m.drives})
    return DeterminacyReport(
        m, graph, "", Geometry(system, x, columns, free_motion(system, x, columns, engine)), engine
    )
