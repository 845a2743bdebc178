"""The determinacy report: counts, ranks, passive and locked freedoms, uniqueness of every reaction, in words and numbers."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from mechgraph.algebra.screw import null_space
from mechgraph.algebra.se3 import Array
from mechgraph.document import Bullets, Document, Heading, Paragraph, Table, to_html, to_markdown, to_text
from mechgraph.errors import AssemblyError
from mechgraph.formulation.build import formulate
from mechgraph.formulation.registry import Ledger
from mechgraph.model.mechanism import Mechanism
from mechgraph.motion.assembly import assembled, assembled_at, named_columns
from mechgraph.motion.system import Index, System
from mechgraph.numerics.linear import RANK_TOLERANCE
from mechgraph.structure.freedom import STILL, Freedoms, PassiveMotion, free_motion
from mechgraph.structure.mobility import finite_mobility
from mechgraph.structure.reaction import UNIQUE, PairFrames, orthonormal_stress
from mechgraph.topology.linkgraph import LinkGraph, link_graph

SHOWN = 1e-6
"""Part of a self-stress that is shown as a component."""


@dataclass(frozen=True)
class Finding:
    """Something found, in words and by name; ``axis`` is (point, direction) in the global frame where there is one."""

    text: str
    freedoms: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    axis: tuple[tuple[float, ...], tuple[float, ...]] | None = None

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class SelfStress:
    """A reaction state without load: coefficients by ``pair:component``, moments divided by L so that they compare."""

    components: Mapping[str, float]
    efforts: Mapping[str, float]

    @property
    def text(self) -> str:
        """The state in one line."""
        parts = [f"{value:+.3g} {name}" for name, value in (self.components | self.efforts).items()]  # type: ignore[operator]
        return " ".join(parts)


@dataclass(frozen=True)
class _Geometry:
    """What geometry adds to the graph."""

    system: System
    x: Array
    freedoms: Freedoms
    unique: dict[str, dict[str, bool]]
    self_stresses: tuple[SelfStress, ...]


@dataclass(frozen=True)
class DeterminacyReport:
    """What the graph alone and the graph with its geometry say about a mechanism; prints as a report.

    Facts that need geometry are None (or empty) for a topology, and where the loops cannot be closed (see ``note``).
    """

    mechanism: Mechanism
    graph: LinkGraph
    note: str = ""
    _geometry: _Geometry | None = field(default=None, repr=False)

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
    def mobility_by_count(self) -> int:
        """Kutzbach mobility, sum of freedoms - 6 loops."""
        return sum(p.type.f for p in self.mechanism.pairs) - 6 * len(self.graph.loops)

    def ledger(self, bookkeeping: str = "lee") -> Ledger:
        """Unknowns against equations in a bookkeeping, ``"lee"`` or ``"minimal"``."""
        return formulate(self.mechanism, bookkeeping).ledger()

    # --- with geometry -------------------------------------------------------------------------------------------------

    @property
    def mobility(self) -> int | None:
        """Freedoms minus rank of the closure Jacobian."""
        return self._geometry.freedoms.mobility if self._geometry else None

    @cached_property
    def finite_mobility(self) -> int | None:
        """Dimension of the set of closed positions: what really moves."""
        return finite_mobility(self._geometry.system, self._geometry.x) if self._geometry else None

    @property
    def redundancy(self) -> int | None:
        """6 loops minus rank: number of self-stresses with the drivers free."""
        return 6 * len(self.graph.loops) - self._geometry.freedoms.rank if self._geometry else None

    @property
    def margin(self) -> float | None:
        """Smallest kept singular value over the largest: small means nearly singular."""
        return self._geometry.freedoms.margin if self._geometry else None

    @property
    def unique(self) -> dict[str, dict[str, bool]]:
        """For every pair: component -> whether it is unique; ``effort`` for a driven freedom."""
        return self._geometry.unique if self._geometry else {}

    @property
    def self_stresses(self) -> tuple[SelfStress, ...]:
        """Reaction states without load, with the declared drivers."""
        return self._geometry.self_stresses if self._geometry else ()

    @property
    def undriven(self) -> tuple[Finding, ...]:
        """Freedoms left free that are neither driven nor passive."""
        if not self._geometry:
            return ()
        return tuple(Finding(f"free: {', '.join(f.names)} move", f.names) for f in self._geometry.freedoms.undriven)

    @cached_property
    def passive(self) -> tuple[Finding, ...]:
        """Passive freedoms by name."""
        geometry = self._geometry
        return tuple(_passive_finding(geometry.system, p) for p in geometry.freedoms.passive) if geometry else ()

    @cached_property
    def locked(self) -> tuple[Finding, ...]:
        """Freedoms that cannot move here."""
        if not self._geometry:
            return ()
        still = np.abs(self._geometry.freedoms.null).max(axis=1, initial=0.0) < STILL
        return tuple(Finding(f"{name} stands still", (name,)) for name, s in zip(self.mechanism.freedom_names(), still, strict=True) if s)

    @cached_property
    def drivable(self) -> tuple[Finding, ...]:
        """Freedoms that can serve as a driver here: single freedoms that move in other than passive motions."""
        geometry = self._geometry
        if not geometry:
            return ()
        null = geometry.freedoms.null
        passive = geometry.freedoms.passive
        if passive:
            P, _ = np.linalg.qr(np.stack([p.rates for p in passive], axis=1))
            null = null - P @ (P.T @ null)
        moves = np.abs(null).max(axis=1, initial=0.0) > STILL
        single = [d for p in self.mechanism.pairs for d in p.type.drivable]
        names = self.mechanism.freedom_names()
        return tuple(Finding(f"{n} can drive", (n,)) for n, m, s in zip(names, moves, single, strict=True) if m and s)

    @property
    def determinate(self) -> bool:
        """Nothing left free that is neither driven nor passive, and every reaction and effort unique."""
        if not self._geometry:
            return False
        return not self._geometry.freedoms.undriven and all(v for row in self.unique.values() for v in row.values())

    @property
    def advice(self) -> tuple[Finding, ...]:
        """What would make it determinate."""
        out = []
        if self._geometry and self.undriven:
            names = ", ".join(f for finding in self.drivable for f in finding.freedoms)
            out.append(Finding(f"drive {len(self.undriven)} more of: {names}"))
        return tuple(out)

    # --- print -----------------------------------------------------------------------------------------------------------

    @property
    def verdict(self) -> str:
        """The verdict in one sentence."""
        return _verdict(self)

    def document(self) -> Document:
        """The report as a document."""
        return _document(self)

    def to_dict(self) -> dict[str, Any]:
        """All facts as plain data."""
        return {
            "mechanism": self.mechanism.name,
            "verdict": self.verdict,
            "note": self.note,
            "determinate": self.determinate,
            "links": list(self.links),
            "pairs": list(self.pairs),
            "loops": [[list(step) for step in loop] for loop in self.loops],
            "mobility_by_count": self.mobility_by_count,
            "mobility": self.mobility,
            "finite_mobility": self.finite_mobility,
            "redundancy": self.redundancy,
            "margin": self.margin,
            "ledger": {
                name: {"unknowns": book.unknowns, "equations": book.equations, "balance": book.balance,
                       "by_kind": {k: [r.count, r.unknowns, r.equations] for k, r in book.by_kind.items()}}
                for name, book in ((n, self.ledger(n)) for n in ("lee", "minimal"))
            },
            "unique": self.unique,
            **{key: [finding.__dict__ for finding in getattr(self, key)]
               for key in ("undriven", "passive", "locked", "drivable", "advice")},
            "self_stresses": [{"components": dict(s.components), "efforts": dict(s.efforts)} for s in self.self_stresses],
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
    return DeterminacyReport(m, graph, "", _geometry(m, system, x))


def _geometry(m: Mechanism, system: System, x: Array) -> _Geometry:
    columns, _ = named_columns(m, system, {d.freedom: 0.0 for d in m.drives})
    freedoms = free_motion(system, x, columns)
    unique, stresses = uniqueness(system, x, columns)
    return _Geometry(system, x, freedoms, unique, stresses)


def uniqueness(system: System, x: Array, driven: Index) -> tuple[dict[str, dict[str, bool]], tuple[SelfStress, ...]]:
    """Which reaction components and efforts are unique: those in which no self-stress of ``[J^T, -E]`` has a part."""
    m = system.m
    here = system.at(x[:, None])
    free = np.setdiff1d(np.arange(system.n_freedoms), driven)
    null = null_space(here.J[:, free, 0].T, RANK_TOLERANCE)
    C = system.graph.loop_matrix
    states = np.einsum("lp,lis->ips", C, null.reshape(C.shape[0], 6, null.shape[1]))[..., None]
    stress = orthonormal_stress(here, states, driven)
    parts = PairFrames(here).components(stress.wrenches)
    table: dict[int, Array] = {int(k): part[:, i, :, 0] for g, part in zip(system.groups, parts, strict=True) for i, k in enumerate(g.pairs)}
    names = m.freedom_names()
    unique: dict[str, dict[str, bool]] = {}
    for k, pair in enumerate(m.pairs):
        row = {name: bool(np.linalg.norm(v) <= UNIQUE) for name, v in zip(pair.type.component_names, table[k], strict=True)}
        mine = [int(c) for c in driven if system.first_column[k] <= c < system.first_column[k + 1]]
        for c in mine:
            label = "effort" if len(mine) == 1 else f"effort {names[c].removeprefix(pair.name + '.')}"
            row[label] = bool(np.linalg.norm(stress.efforts[c, :, 0]) <= UNIQUE)
        unique[pair.name] = row
    stresses = []
    for i in range(null.shape[1]):
        components = {
            f"{pair.name}:{name}": float(v[i])
            for k, pair in enumerate(m.pairs)
            for name, v in zip(pair.type.component_names, table[k], strict=True)
            if abs(v[i]) > SHOWN
        }
        efforts = {names[c]: float(stress.efforts[c, i, 0]) for c in driven if abs(stress.efforts[c, i, 0]) > SHOWN}
        stresses.append(SelfStress(components, efforts))
    return unique, tuple(stresses)


def screw_axis(system: System, twist: Array) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """A point and the direction of the axis of a twist (of the slide where it does not turn), in the global frame."""
    w, v = twist[:3], twist[3:]
    point: Array
    if np.linalg.norm(w) > 1e-9 * max(1.0, float(np.linalg.norm(v))):
        point = np.cross(w, v) / (w @ w)
        direction = w / np.linalg.norm(w)
    else:
        point, direction = np.zeros(3), v / np.linalg.norm(v)
    par = system.par
    return tuple((par.L * point + par.origin).tolist()), tuple(direction.tolist())


def _passive_finding(system: System, motion: PassiveMotion) -> Finding:
    m = system.m
    names = m.link_names()
    links = tuple(names[i] for i in motion.links)
    freedoms = tuple(n for n, r in zip(m.freedom_names(), motion.rates, strict=True) if abs(r) > STILL)
    pairs = tuple(dict.fromkeys(n.rpartition(".")[0] for n in freedoms))
    axis = screw_axis(system, motion.twist)
    turning = np.linalg.norm(motion.twist[:3]) > 1e-9
    direction = ", ".join(f"{c:.4g}" for c in axis[1])
    point = ", ".join(f"{c:.4g}" for c in axis[0])
    how = f"turn about the line through ({point}) along ({direction})" if turning else f"slide along ({direction})"
    verb = how if len(links) > 1 else how.replace("turn", "turns", 1).replace("slide", "slides", 1)
    text = f"{' and '.join(links)} {verb}, in the pairs {', '.join(pairs)}: passive, moves no other link"
    return Finding(text, freedoms, links, axis)


def _verdict(report: DeterminacyReport) -> str:
    book = report.ledger("lee")
    count = f"{len(report.mechanism.drives)} driver{'s' if len(report.mechanism.drives) != 1 else ''}, {book.unknowns} unknowns, {book.equations} equations"
    if report.mobility is None:
        word = "balanced" if book.balance == 0 else ("over by" if book.balance < 0 else "short by") + f" {abs(book.balance)}"
        return f"By count: {count} ({word})."
    loose = [f"{pair}:{name}" for pair, row in report.unique.items() for name, ok in row.items() if not ok]
    if report.undriven:
        return f"Under-driven: mobility {report.mobility}, {len(report.mechanism.drives)} driven, {len(report.passive)} passive, {len(report.undriven)} left free."
    if loose:
        return f"Moves with mobility {report.mobility}, but {len(loose)} reaction components are not unique (redundancy {report.redundancy})."
    return f"Determinate: {count}; every reaction is unique."


def _document(report: DeterminacyReport) -> Document:
    m = report.mechanism
    blocks: list[Any] = [Paragraph(report.verdict)]
    if report.note:
        blocks.append(Paragraph(report.note))
    facts = [
        ("links", str(len(report.links))), ("pairs", str(len(report.pairs))), ("loops", str(len(report.loops))),
        ("freedoms of the pairs", str(sum(p.type.f for p in m.pairs))), ("mobility by count", str(report.mobility_by_count)),
    ]
    if report.mobility is not None and report.margin is not None:
        facts += [
            ("mobility by rank", str(report.mobility)), ("finite mobility", str(report.finite_mobility)),
            ("redundancy", str(report.redundancy)), ("margin", f"{report.margin:.3g}"),
        ]
    blocks.append(Table(("fact", "value"), tuple(facts)))
    lee, minimal = report.ledger("lee"), report.ledger("minimal")
    rows = tuple(
        (k, str(r.count), f"{r.unknowns}", f"{r.equations}", f"{minimal.by_kind[k].unknowns}", f"{minimal.by_kind[k].equations}")
        for k, r in lee.by_kind.items()
    )
    total = ("sum", "", str(lee.unknowns), str(lee.equations), str(minimal.unknowns), str(minimal.equations))
    blocks += [Heading("Ledger", 2), Table(("kind", "count", "unknowns (Lee)", "equations", "unknowns (minimal)", "equations"), (*rows, total))]
    ends = {p.name: (p.a, p.b) for p in m.pairs}
    chains = []
    for loop in report.loops:
        text = ends[loop[0][0]][0 if loop[0][1] > 0 else 1]
        for name, sign in loop:
            text += f" -{name}- {ends[name][1 if sign > 0 else 0]}"
        chains.append(text)
    blocks += [Heading("Loops", 2), Bullets(tuple(chains))]
    for key, title in (("undriven", "Left free"), ("passive", "Passive freedoms"), ("locked", "Locked freedoms"), ("drivable", "Possible drivers")):
        found = getattr(report, key)
        if found:
            blocks += [Heading(title, 2), Bullets(tuple(f.text for f in found))]
    loose = {pair: [n for n, ok in row.items() if not ok] for pair, row in report.unique.items()}
    if any(loose.values()):
        blocks += [Heading("Not unique", 2), Bullets(tuple(f"{pair}: {', '.join(names)}" for pair, names in loose.items() if names))]
        blocks += [Heading("Self-stresses", 2), Bullets(tuple(s.text for s in report.self_stresses))]
    if report.advice:
        blocks += [Heading("Advice", 2), Bullets(tuple(a.text for a in report.advice))]
    return Document(f"Determinacy of {m.name}", tuple(blocks))
