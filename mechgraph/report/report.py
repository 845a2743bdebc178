"""The determinacy report: what is known of a mechanism, printed as text, Markdown, HTML and plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

from mechgraph.arguments import Limit, door
from mechgraph.closure.assembly import assembled, assembled_at, named_columns
from mechgraph.closure.solver import MotionEngineName
from mechgraph.data import json_text, plain
from mechgraph.document import Document, Paragraph, Shown, to_markdown, to_text
from mechgraph.errors import AssemblyError, DeclarationError, MechgraphError
from mechgraph.graph.linkgraph import link_graph
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.tolerances import RANKS
from mechgraph.report import brief, data, sections, sentences
from mechgraph.report.facts import Facts, Geometry
from mechgraph.report.rounding import LIMIT, Rounding, rounding
from mechgraph.structure.least_change import TOOK_TOO_LONG, SearchEnded
from mechgraph.structure.mobility import free_motion
from mechgraph.structure.placed_pairs import EXACT
from mechgraph.structure.snapping import meant

HINTED = 2.0
"""Seconds that an error may wait for the same."""
ENDED = (
    "Whether rounded numbers hide a special geometry was looked for during {limit:g} s and not found out; pass limit= to look longer, or "
    "tol= with the accuracy that is meant."
)
"""What is said of a search that took too long."""
UNSOUGHT = (
    "Whether rounded numbers hide a special geometry is not known: {}; pass tol= with the accuracy that is meant."
)
"""What is said of one that was not begun."""
CHANGES_ENDED = (
    "What changes of pairs would help was looked for during {limit:g} s and not to the end; pass limit= to look longer."
)
"""What is said of the advice."""


class DeterminacyReport(Facts, Shown):
    """The facts about a mechanism; prints as a report."""

    @cached_property
    def verdict(self) -> str:
        """The verdict in one sentence."""
        return sentences.verdict(self)

    @cached_property
    def rounding(self) -> Rounding | None:
        """The smallest tolerance up to 1e-2 with which directions and distances are meant to say something else, where there is one."""
        return self._rounding[0]

    @property
    def rounding_not_sought(self) -> bool:
        """Whether that was not looked for to the end: it took longer than ``limit``, or there are too many pairs."""
        return bool(self._rounding[1])

    @cached_property
    def _rounding(self) -> tuple[Rounding | None, str]:
        try:
            return rounding(self.mechanism, _verdict_of, self.limit), ""
        except SearchEnded as error:
            late = str(error) == TOOK_TOO_LONG
            return None, ENDED.format(limit=self.limit) if late else UNSOUGHT.format(error)

    @property
    def not_sought(self) -> tuple[str, ...]:
        """What was not looked for to the end, in sentences."""
        changes = CHANGES_ENDED.format(limit=self.limit) if self.effects_not_sought else ""
        return tuple(filter(None, (self._rounding[1], changes)))

    def document(self, full: bool = False) -> Document:
        """The report as a document: verdict, what to do and what may be trusted, or all of it; first what rounding does to it."""
        found = (self.rounding.text,) if self.rounding else ()
        first = tuple(map(Paragraph, (*found, *self.not_sought)))
        if not full:
            return brief.document(self, first)
        made = sections.document(self)
        return replace(made, blocks=(*first, *made.blocks))

    def text(self, full: bool = False) -> str:
        """The report as text, at most 25 lines of 80 columns, or all of it."""
        return to_text(self.document(full))

    def to_markdown(self, full: bool = False) -> str:
        """The report as Markdown."""
        return to_markdown(self.document(full))

    def to_dict(self) -> dict[str, Any]:
        """All facts as plain data."""
        facts = data.to_dict(self, sections.KEYS)
        found = {} if self.rounding is None else {"rounding": plain(self.rounding)}
        return found | ({"not_sought": list(self.not_sought)} if self.not_sought else {}) | facts

    def to_json(self) -> str:
        """All facts as JSON."""
        return json_text(self.to_dict())

    def __repr__(self) -> str:
        known = f", mobility {self.mobility}, redundancy {self.redundancy}" if self.geometry else ""
        return f"DeterminacyReport({self.mechanism.name!r}{known}; print it)"


def _verdict_of(m: Mechanism, doubt: float = RANKS.doubt) -> tuple[Any, ...]:
    """What a tolerance may change: mobility, redundancy, unique components, doubts about them; empty where the loops do not close."""
    r = check(m)
    if r.mobility is None or r.dropped is None:
        return ()
    return r.finite_mobility, r.mobility, r.redundancy, r.unique, r.dropped > doubt


def hinted(m: Mechanism, error: MechgraphError) -> MechgraphError:
    """An error that also says what tolerance would change the verdict, or make exact what is so to rounding only, where one would."""
    try:
        found = rounding(m, partial(_verdict_of, doubt=EXACT), HINTED)
    except SearchEnded:
        return error
    if found is not None:
        error.args = (f"{error.args[0]}. {found.text}", *error.args[1:])
    return error


@door
def check(
    m: Mechanism,
    at: Mapping[str, float] | None = None,
    *,
    engine: MotionEngineName = "auto",
    tol: float | None = None,
    limit: Limit = LIMIT,
) -> DeterminacyReport:
    """The determinacy report of a mechanism: of its graph, and where it has geometry of its closed position at ``start``.

    Parameters
    ----------
    at : values of freedoms at which to assemble first, e.g. ``{"A": 0.3}``.
    engine : which engine decides ranks, ``"dense"`` or ``"sparse"``; ``"auto"`` takes the faster one. The report is the same.
        The compiled kernel follows motions; it decides no rank, and ``"compiled"`` is refused.
    tol : accuracy to which directions (radians) and distances (over L) are meant; the report is that of ``m.snapped(tol)``. Left out:
        that of the mechanism, or exact.
    limit : seconds that each search may take (for special geometry hidden by rounded numbers, for changes that help, for what ``tol``
        makes exact); what was not looked for to the end is said.

    Raises
    ------
    DeclarationError
        where ``engine`` is ``"compiled"``.
    AssemblyError
        where ``at`` is given and cannot be reached. Without it, loops that cannot be closed are reported in ``note``.
    MechgraphError
        where the geometry is not made exact to ``tol`` within ``limit``.
    """
    if engine == "compiled":
        text = "engine 'compiled' does not serve: the kernel follows motions and decides no rank. Use engine='auto'"
        raise DeclarationError(f"check {m.name!r}", [text])
    graph = m.once(link_graph)
    if not m.has_geometry:
        return DeterminacyReport(m, graph, "Topology only: no geometry is declared.", asked=engine, limit=limit)
    try:
        m = meant(m, tol, "check", limit)
        graph = m.once(link_graph)
        system, x = assembled_at(m, at) if at else assembled(m)
    except AssemblyError as error:
        if at:
            raise
        return DeterminacyReport(m, graph, f"No facts that need geometry: {error}", asked=engine, limit=limit)
    columns, _ = named_columns(m, system, {d.freedom: 0.0 for d in m.drives})
    return DeterminacyReport(
        m, graph, "", Geometry(system, x, columns, free_motion(system, x, columns, engine)), engine, limit
    )
