"""The determinacy report: what is known of a mechanism, printed as text, Markdown, HTML and plain data.

One list of facts says their keys in the data, and where and how they stand on paper; text, Markdown and HTML follow from it through a
document, JSON and its schema through plain data. Named errors for mechanisms that their drivers do not determine
where they were assembled hold it.
The structure as the textbooks tell it: chain, mobility table, families, counts, groups, other drivers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, NamedTuple

from mechgraph.determinacy import sentences
from mechgraph.determinacy.decomposition import Decomposition, joints_at
from mechgraph.determinacy.facts import Facts, Geometry
from mechgraph.determinacy.families import COLUMNS, Families
from mechgraph.determinacy.findings import LIMIT, LoopData, Rounding, component_words, plural, rounding
from mechgraph.determinacy.finite_motion import branches_text
from mechgraph.determinacy.mobility import FreeMotion, free_motion
from mechgraph.determinacy.pair_changes import LARGEST_FOR_SETS
from mechgraph.determinacy.sentences import assumed, here_only, kind_line, loop_names, mobility_line, reasons, verdict
from mechgraph.determinacy.snapping import EXACT, meant
from mechgraph.document import LISTED, Block, Bullets, Document, Heading, Paragraph, Shown, Table, to_markdown, to_text
from mechgraph.errors import (
    AssemblyError,
    Budget,
    DeadPointError,
    DeclarationError,
    IndeterminateError,
    MechgraphError,
    SearchEnded,
    listed,
)
from mechgraph.files import Json, json_text, members, plain, read_off, schema_of
from mechgraph.graph.atlas import Identity, identify
from mechgraph.graph.linkgraph import link_graph
from mechgraph.kernel import build
from mechgraph.kinematics.assembly import assembled, assembled_at, named_columns
from mechgraph.kinematics.solver import MotionEngineName
from mechgraph.maths.tolerances import RANKS, Tolerances
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.pairs.pair_type import TABLE
from mechgraph.quantities import Limit, door, wrong

NOT_UNIQUE = (
    "Unique: determined by equilibrium. Not unique: it also depends on fits, stiffness and temperature; a rigid-body model cannot "
    "determine it."
)
MEANINGS = (
    "A self-stress is a self-equilibrated set of reactions at zero load: assembly can preload any multiple of it. Components "
    "in which every self-stress vanishes are proved unique. Moments are divided by L = {L:.4g} so that they compare with forces."
)


@dataclass(frozen=True)
class Section:
    """A part of the report: its ``title`` ("" goes on in the part before), the ``keys`` of its facts, and what is printed of them."""

    title: str
    keys: tuple[str, ...]
    printed: Callable[[Facts], Iterable[Block]]


def document(r: Facts) -> Document:
    """The report as a document."""
    blocks: list[Block] = []
    for section in SECTIONS:
        printed = list(section.printed(r))
        blocks += [Heading(section.title, 2), *printed] if section.title and printed else printed
    return Document(f"Determinacy of {r.mechanism.name}", tuple(blocks))


def _listed(items: Iterable[str]) -> Iterator[Block]:
    texts = list(items)
    more = len(texts) - LISTED
    if texts:
        yield Bullets(tuple(texts[:LISTED] + ([f"... and {more} more (see report.to_dict())"] if more > 0 else [])))


def _findings(key: str) -> Callable[[Facts], Iterator[Block]]:
    return lambda r: _listed(f.text for f in getattr(r, key))


def _numbers(r: Facts) -> Iterator[Block]:
    """Numbers of links, pairs and loops; count and rank side by side."""
    yield Paragraph(
        f"{plural(len(r.links), 'link')} with the frame, {plural(len(r.pairs), 'pair')}, {plural(len(r.loops), 'loop')}, "
        f"{plural(len(r.mechanism.drives), 'driver')}."
    )
    f, rows = r.freedom_count, r.equation_count
    columns = [
        ("by count", (f, rows, rows, f - rows, 0)),
        ("general geometry", (f, rows, r.generic.rank, r.generic.mobility, r.generic.excess)),
    ]
    if r.mobility is not None and r.redundancy is not None:
        columns.append(("this geometry", (f, rows, f - r.mobility, r.mobility, r.redundancy)))
    names = ("freedoms of the pairs", "closure equations", "of these independent", "mobility", "redundancy")
    lines = tuple((name, *(str(values[i]) for _, values in columns)) for i, name in enumerate(names))
    yield Table(("", *(head for head, _ in columns)), lines, align="l" + "r" * len(columns))


def _why(r: Facts) -> Iterator[Block]:
    """What the mobility is made of, and why count and rank differ."""
    if r.mobility:
        yield Paragraph(mobility_line(r))
    if r.geometry:
        yield Bullets((*reasons(r), *assumed(r)))


def _drivers(r: Facts) -> Iterator[Block]:
    if not r.geometry:
        return
    able = [name for f in r.drivable for name in f.freedoms]
    lines = [f"can drive: {listed(able, LISTED)}" if able else "no freedom can drive"]
    if r.contradicting_drives and r.mobility and not r.suggested_drives:
        lines.append("the declared drivers are dependent; remove one")
    lines += [f"only one of {listed(group, LISTED)} (they move in proportion)" for group in r.dependent_drives]
    names_by_reason: dict[str, list[str]] = {}
    for f in r.not_drivable:
        names_by_reason.setdefault(f.text.split(": ", 1)[1], []).extend(f.freedoms)
    lines += [f"cannot drive: {listed(names, LISTED)}: {why}" for why, names in names_by_reason.items()]
    if r.suggested_drives:
        word = "drive also" if r.mechanism.drives else "suggested"
        word = f"instead of {listed(r.replaced_drives, LISTED)}" if r.replaced_drives else word
        lines.append(f"{word}: {listed(r.suggested_drives, LISTED)}")
    yield from _listed(lines)


def _ratios(r: Facts) -> Iterator[Block]:
    if not r.ratios:
        return
    drives = next(iter(r.ratios.values()))
    rows = [(name, *(f"{v:.6g}" for v in rates.values())) for name, rates in list(r.ratios.items())[:LISTED]]
    if len(r.ratios) > LISTED:
        rows.append((f"... and {len(r.ratios) - LISTED} more", *("" for _ in drives)))
    yield Table(("rate of", *(f"per {name}" for name in drives)), tuple(rows), align="l" + "r" * len(drives))
    yield Paragraph(
        "The other drivers at rest, here in this position. Without friction they are the split of loads too: against an effort of 1 in a "
        "freedom a driver holds minus its ratio."
    )


def _reactions(r: Facts) -> Iterator[Block]:
    if not r.unique:
        return
    kinds = {p.name: p.type.symbol for p in r.mechanism.pairs}
    lines = []
    for name, components in list(r.unique.items())[:LISTED]:
        sides = (" ".join(n for n, ok in components.items() if ok is side) or "none" for side in (True, False))
        lines.append((name, kinds.get(name, "coupling"), *sides))
    if len(r.unique) > LISTED:
        lines.append(("...", "", f"and {len(r.unique) - LISTED} pairs more (see report.to_dict())", ""))
    yield Table(("pair", "type", "unique", "not unique"), tuple(lines))
    if not all(ok for components in r.unique.values() for ok in components.values()):
        yield Paragraph(NOT_UNIQUE)
    yield from _listed(r.friction)
    rows = {p.type.symbol: p.type for p in r.mechanism.pairs if p.type.reactions and p.type.directed}
    if rows:
        told = (f"{symbol}: {component_words(row, row.component_names)}" for symbol, row in rows.items())
        yield Paragraph(f"In words: {'; '.join(told)}.")


def _stresses(r: Facts) -> Iterator[Block]:
    known = r.reactions
    if not known or not known.count or not r.geometry:
        return
    lines = [
        f"group {s.group + 1}: {s.text or 'in the efforts of the couplings alone'}" for s in known.first_states(LISTED)
    ]
    if known.listed > len(lines):
        lines.append(f"... and {known.listed - len(lines)} more (report.self_stresses)")
    if known.count > known.listed:
        lines.append(f"{known.count - known.listed} more that connect loops are not listed: too many")
    form = "form one self-stress group" if known.groups == 1 else f"form {known.groups} self-stress groups"
    yield Paragraph(f"{MEANINGS.format(L=r.geometry.system.par.L)} Those that share components {form}.")
    yield Bullets(tuple(lines))


def _combined(r: Facts) -> Iterator[Block]:
    """Directions and sums that are unique though components are not; sums of many terms are only in the JSON."""
    if not (known := r.reactions):
        return
    if known.unique_directions:
        yield Paragraph("Directions in the axes x, y, z of the pair's marker.")
        yield from _listed(d.text for d in known.unique_directions)
    terms = 4  # most terms of a sum that is printed
    if known.combinations:
        lines = [f"group {group + 1}: {text}" for group, text in known.combinations if text.count(":") <= terms]
        more = len(known.combinations) - len(lines)
        if more:
            lines.append(f"{'and ' if lines else ''}{more} of more than {terms} terms (see report.to_dict())")
        yield Paragraph("These sums are unique though their terms are not:")
        yield from _listed(lines)
    if known.unsought:
        where = f"{plural(known.unsought, 'group')} of many components"
        yield Paragraph(f"Sums across pairs were not sought in {where}.")


def _advice(r: Facts) -> Iterator[Block]:
    yield from _listed(f"{number}: {a.text}" for number, a in enumerate(r.advice))
    if r.sets_not_sought:
        yield Paragraph(f"Smaller sets of changes were not sought: redundancy above {LARGEST_FOR_SETS}.")
    new = sorted({kind for e in r.effects for _, _, kind in e.changes if kind in TABLE})
    if new:
        yield Paragraph(f"Pair types: {'; '.join(f'{kind} {TABLE[kind].name}' for kind in new)}.")


def _loops(r: Facts) -> Iterator[Block]:
    rows = [
        (str(i + 1), fact.chain, str(fact.freedoms), *("-" if n is None else str(n) for n in (fact.rank, fact.excess)))
        for i, fact in enumerate(r.loop_facts[:LISTED])
    ]
    if len(r.loops) > LISTED:
        rows.append(("...", f"and {len(r.loops) - LISTED} more (see report.to_dict())", "", "", ""))
    if rows:
        yield Table(("loop", "links and pairs", "freedoms", "rank", "excess"), tuple(rows), align="rlrrr")
    if rows and r.geometry:
        yield Paragraph(
            "The excess of a loop whose pairs all move is its family, where its rank is the same all along."
        )


def _count(r: Facts) -> Iterator[Block]:
    parts = r.parts
    lines = []
    if parts.redundant_pairs:
        many = plural(parts.spare_unknowns, "reaction unknown")
        lines.append(f"{many} more than equations, in the pairs {listed(parts.redundant_pairs, LISTED)}")
    if parts.free_links:
        many = plural(parts.spare_equations, "equation")
        lines.append(f"{many} more than unknowns, in the links {listed(parts.free_links, LISTED)}")
    if not lines:
        lines.append("every equation is matched to an unknown, and every unknown to an equation")
    places = r.generic.places[:LISTED]
    yield Bullets((*lines, *(f"{n} redundant whatever the dimensions, in the {loop_names(r, at)}" for n, at in places)))


def _ledger_table(r: Facts) -> Iterator[Block]:
    lee, minimal = r.ledger("lee"), r.ledger("minimal")

    def both(a: Any, b: Any) -> tuple[str, str]:
        return f"{a.unknowns} / {a.equations}", f"{b.unknowns} / {b.equations}"

    rows = [(kind, str(row.count), *both(row, minimal.by_kind[kind])) for kind, row in lee.by_kind.items()]
    rows.append(("sum", "", *both(lee, minimal)))
    yield Table(("kind", "count", "as Lee writes them", "minimal"), tuple(rows), align="lrrr")


def _checks(r: Facts) -> Iterator[Block]:
    """How the rank was decided; a dropped value that is no more than rounding differs from machine to machine."""
    if r.geometry:
        dropped = r.dropped or 0.0
        size = "rounding" if dropped < RANKS.doubt else f"{dropped:.2g} of the largest"
        yield Paragraph(f"Rank decided by the {r.engine} engine; largest value treated as zero: {size}.")


SECTIONS = (
    Section("", ("mechanism", "verdict", "determinate"), lambda r: [Paragraph(verdict(r))]),
    Section("", ("note",), lambda r: [Paragraph(r.note)] if r.note else []),
    Section("", ("links", "pairs", "mobility_by_count", "generic", "mobility", "redundancy"), _numbers),
    Section("", ("kind", "loop_kinds", "own_forces_unique"), lambda r: [Paragraph(kind_line(r))]),
    Section("", ("inputs", "finite_mobility", "stroke", "excess", "change_point", "margin", "near"), _why),
    Section("Advice", ("effects", "advice", "sets_not_sought"), _advice),
    Section("Neither driven nor passive", ("undriven", "passive_here_only"), _findings("undriven")),
    Section("Passive freedoms", ("passive",), _findings("passive")),
    Section("Locked freedoms", ("locked",), _findings("locked")),
    Section(
        "Drivers",
        ("drivable", "contradicting_drives", "dependent_drives", "not_drivable", "suggested_drives", "replaced_drives"),
        _drivers,
    ),
    Section("Ratios", ("ratios",), _ratios),
    Section("Reactions", ("unique", "near_other_uniqueness"), _reactions),
    Section("Self-stresses", ("self_stress_count", "self_stresses"), _stresses),
    Section(
        "Unique only in combination", ("unique_directions", "combinations", "groups_without_combinations"), _combined
    ),
    Section("Loops", ("loops",), _loops),
    Section("By count alone (unknowns matched to equations)", ("parts",), _count),
    Section("Count of the force equations (unknowns / equations)", ("ledger",), _ledger_table),
    Section("Checks", ("engine", "dropped"), _checks),
)
"""All facts in the order of the report."""
KEYS = tuple(key for section in SECTIONS for key in section.keys)
"""Their names in the data."""


@dataclass(frozen=True)
class LedgerData:
    """Unknowns and equations in one bookkeeping; ``by_kind``: count, unknowns and equations of pair symbols, couplings, drivers, links."""

    unknowns: int
    equations: int
    balance: int
    by_kind: Mapping[str, tuple[int, int, int]]


@dataclass(frozen=True)
class KindData:
    """``name`` "planar", "spherical" or ""; ``place``: unit normal (``is_direction``) or center; ``by_pairs``: all pairs are of it."""

    name: str
    is_direction: bool
    place: tuple[float, ...]
    by_pairs: bool


@dataclass(frozen=True)
class AdviceData:
    """What would help, in words (``brief``: those of a workshop), and the freedoms and links that are meant."""

    text: str
    freedoms: tuple[str, ...]
    links: tuple[str, ...]
    axis: tuple[tuple[float, ...], tuple[float, ...]] | None
    brief: str


@dataclass(frozen=True)
class DirectionData:
    """Force or moment (``kind``) of a pair that is unique along (or ``across``) a direction of its marker; ``in_space`` the global one."""

    text: str
    pair: str
    kind: str
    direction: tuple[float, ...]
    across: bool
    in_space: tuple[float, ...]


class _Fact(NamedTuple):
    """A fact whose plain data are not those of the attribute of its name: their type, what they are, and how they are made."""

    type: Any
    words: str
    of: Callable[[Facts], Any]


OTHER: dict[str, _Fact] = {
    "mechanism": _Fact(str, "Name of the mechanism.", lambda r: r.mechanism.name),
    "verdict": _Fact(str, "The verdict in one sentence.", verdict),
    "note": _Fact(str, "Why facts that need geometry are missing; empty where they are not.", lambda r: r.note),
    "loops": _Fact(
        tuple[LoopData, ...],
        "Independent loops.",
        lambda r: r.loop_facts,
    ),
    "ledger": _Fact(
        Mapping[str, LedgerData],
        "Unknowns against equations in both bookkeepings.",
        lambda r: {name: r.ledger(name) for name in ("lee", "minimal")},
    ),
    "kind": _Fact(KindData, "The kind of the mechanism.", lambda r: r.kind),
    "loop_kinds": _Fact(
        tuple[str, ...], "The kind of every loop by its pairs.", lambda r: [kind.name for kind in r.loop_kinds]
    ),
    "advice": _Fact(tuple[AdviceData, ...], "What would help, the best first.", lambda r: r.advice),
    "self_stress_count": _Fact(
        int | None,
        "Number of self-stresses with the drivers in place.",
        lambda r: r.reactions.count if r.reactions else None,
    ),
    "unique_directions": _Fact(
        tuple[DirectionData, ...],
        "Directions in which forces or moments are unique though their components are not.",
        lambda r: r.reactions.unique_directions if r.reactions else (),
    ),
    "combinations": _Fact(
        tuple[tuple[int, str], ...],
        "Sums of components that are unique though their terms are not, with the number of their group.",
        lambda r: r.reactions.combinations if r.reactions else [],
    ),
    "groups_without_combinations": _Fact(
        int,
        "Groups of so many components that such sums were not sought.",
        lambda r: r.reactions.unsought if r.reactions else 0,
    ),
}


def to_dict(r: Facts, keys: Iterable[str]) -> Json:
    """Facts as plain data."""
    return {k: read_off(OTHER[k].type, OTHER[k].of(r)) if k in OTHER else plain(getattr(r, k)) for k in keys}


def schemas(keys: Iterable[str], defs: Json) -> Json:
    """The JSON Schemas of facts by key; those of records go to ``defs``."""
    out = {}
    for key in keys:
        if key in OTHER:
            out[key] = {"description": OTHER[key].words, **schema_of(OTHER[key].type, defs)}
        else:
            out |= members(Facts, [key], defs)
    return out


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
    """The facts about a mechanism, computed when first requested; prints as a report. Returned by ``check``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> report = mg.check(mg.load("four-bar"))
    >>> report.unique["B"]
    {'Fx': True, 'Fy': True, 'Fz': False, 'Mx': False, 'My': False}
    >>> report.ledger("lee").unknowns, report.ledger("lee").equations
    (29, 26)
    """

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
            late = str(error) == Budget.TOOK_TOO_LONG
            return None, ENDED.format(limit=self.limit) if late else UNSOUGHT.format(error)

    @property
    def not_sought(self) -> tuple[str, ...]:
        """What was not looked for to the end, in sentences."""
        changes = CHANGES_ENDED.format(limit=self.limit) if self.effects_not_sought else ""
        return tuple(filter(None, (self._rounding[1], changes)))

    def document(self, full: bool = False) -> Document:
        """Return the report as a document: verdict, recommended changes, determinacy; or all of it.

        Parameters
        ----------
        full : bool
            The full report.

        Returns
        -------
        Document
        """
        found = (self.rounding.text,) if self.rounding else ()
        first = tuple(map(Paragraph, (*found, *self.not_sought)))
        if not full:
            return sentences.document(self, first)
        made = document(self)
        return replace(made, blocks=(*first, *made.blocks))

    def text(self, full: bool = False) -> str:
        """Return the report as text: at most 25 lines of 80 columns, or all of it.

        Parameters
        ----------
        full : bool
            The full report.

        Returns
        -------
        str

        Examples
        --------
        >>> import mechgraph as mg
        >>> report = mg.check(mg.load("four-bar"))
        >>> len(report.text().splitlines()) <= 25 < len(report.text(full=True).splitlines())
        True
        """
        return to_text(self.document(full))

    def to_markdown(self, full: bool = False) -> str:
        """Return the report as Markdown.

        Parameters
        ----------
        full : bool
            The full report.

        Returns
        -------
        str
        """
        return to_markdown(self.document(full))

    def to_dict(self) -> dict[str, Any]:
        """Return all facts as plain data.

        Returns
        -------
        dict

        Examples
        --------
        >>> import mechgraph as mg
        >>> mg.check(mg.load("four-bar")).to_dict()["redundancy"]
        3
        """
        facts = to_dict(self, KEYS)
        found = {} if self.rounding is None else {"rounding": plain(self.rounding)}
        return found | ({"not_sought": list(self.not_sought)} if self.not_sought else {}) | facts

    def to_json(self) -> str:
        """Return all facts as JSON.

        Returns
        -------
        str
        """
        return json_text(self.to_dict())

    def __repr__(self) -> str:
        known = f", mobility {self.mobility}, redundancy {self.redundancy}" if self.geometry else ""
        return f"DeterminacyReport({self.mechanism.name!r}{known}; print it)"


def _verdict_of(m: Mechanism, doubt: float | None = None) -> tuple[Any, ...]:
    """What a tolerance may change: mobility, redundancy, unique components, doubts about them; empty where the loops do not close."""
    r = check(m)
    if r.mobility is None or r.dropped is None:
        return ()
    return r.finite_mobility, r.mobility, r.redundancy, r.unique, r.dropped > (RANKS.doubt if doubt is None else doubt)


def hinted(m: Mechanism, error: MechgraphError) -> MechgraphError:
    """An error that also says what tolerance would change the verdict, or make exact what is so to rounding only, where one would."""
    try:
        # an error may wait for two seconds of work
        found = rounding(m, partial(_verdict_of, doubt=EXACT), 2.0)
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
    tolerances: Tolerances | None = None,
) -> DeterminacyReport:
    """Report mobility, redundancy and the determinacy of every reaction of a mechanism, at its closed position near ``start``.

    ``M = sum f - rank J``, ``redundancy = rows - rank J``; a reaction component is unique if every self-stress (null vector of
    ``[J^T, -E]``) vanishes in it. Without geometry the report holds the facts of the graph.

    Parameters
    ----------
    m : Mechanism
        The mechanism.
    at : mapping of str to float, optional
        Values of freedoms [rad, length] at which to assemble first, e.g. ``{"A": 0.3}``.
    engine : {"auto", "dense", "sparse"}
        Linear algebra that decides ranks; the report is the same. ``"compiled"`` is refused: the kernel decides no rank.
    tol : float, optional
        Accuracy of directions [rad] and distances (relative to L); the report is that of ``m.snapped(tol)``. Default: that of the
        mechanism, or exact.
    limit : float
        Seconds for each search (special geometry behind rounded numbers, changes that help) on one quiet core, counted by its work, so
        that the report is the same on a busy machine; the report lists unfinished searches.
    tolerances : Tolerances, optional
        Numbers by which to decide, see ``Tolerances``. Default: those of the mechanism, which are the default ones.

    Returns
    -------
    DeterminacyReport

    Raises
    ------
    DeclarationError
        ``engine`` is ``"compiled"``, or an argument is invalid.
    AssemblyError
        ``at`` cannot be reached. Without it, loops that cannot be closed are reported in ``note``.
    MechgraphError
        The geometry was not made exact to ``tol`` within ``limit``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> report = mg.check(mg.load("four-bar"))
    >>> report.mobility_by_count, report.mobility, report.redundancy
    (-2, 1, 3)
    """
    if engine == "compiled":
        raise build.not_served(f"check {m.name!r}", "the kernel follows motions and decides no rank")
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


def structure_error(m: Mechanism, drives: Sequence[str]) -> IndeterminateError:
    """Nothing moves that could be driven."""
    return IndeterminateError(
        f"mechanism {m.name!r}: {', '.join(drives)} cannot drive it: mobility is 0 at the start position. Change a pair type; "
        "mg.check(m) lists options",
        check(m),
    )


def undriven_error(m: Mechanism, free: Sequence[FreeMotion]) -> IndeterminateError:
    """Freedoms are left that are neither driven nor passive."""
    report = check(m)
    own = m.freedom_names()
    names = listed(
        dict.fromkeys(name for motion in free for name in motion.names if name in own), 8
    )  # names worth reading in a message
    many = len(free) > 1
    count, more = (f"{len(free)} freedoms are", f"{len(free)} drivers") if many else ("1 freedom is", "one driver")
    would_do = f" (such as {listed(report.suggested_drives, 4)})" if report.suggested_drives else ""
    return IndeterminateError(
        f"mechanism {m.name!r}: {count} neither driven nor passive (moving: {names}){here_only(report.passive_here_only)}; "
        f"add {more}{would_do}, or change a pair",
        report,
    )


def no_longer_passive_error(m: Mechanism, names: Sequence[str], drives: Mapping[str, float]) -> IndeterminateError:
    """Motions ``names`` were passive where the mechanism was assembled, and move other links at values of the ``drives``."""
    at = ", ".join(f"{name} = {value:.6g}" for name, value in drives.items())
    return IndeterminateError(
        f"mechanism {m.name!r}: {' or '.join(names)} is passive where it was assembled, but moves other links at {at}, so that the "
        "drivers do not determine the motion there; add a driver, or change a pair",
        check(m),
    )


def undecided_error(m: Mechanism, counts: Sequence[int]) -> IndeterminateError:
    """Two ways to decide the rank find so many passive freedoms."""
    found = " or ".join(map(str, counts))
    return IndeterminateError(
        f"mechanism {m.name!r}: where it was assembled it is so nearly singular that rounding decides whether it has {found} passive "
        "freedoms. Start at another position, or check the dimensions",
        check(m),
    )


def dead_point_error(m: Mechanism, still: Sequence[str], values: dict[str, float], solution: object) -> DeadPointError:
    """Drivers stand ``still`` at the start while the mechanism moves."""
    return DeadPointError(
        f"mechanism {m.name!r}: dead point where it was assembled: {', '.join(still)} is stationary there while the mechanism "
        "moves. Drive another freedom, or start at another position",
        values,
        solution,
    )


def change_point_error(m: Mechanism, values: dict[str, float], ways: tuple[dict[str, float], ...]) -> DeadPointError:
    """Branches cross at the start, with their rates by freedom."""
    error = DeadPointError(
        f"mechanism {m.name!r}: change point where it was assembled: {branches_text(ways, next(iter(values)))}. A path that starts there "
        "has no velocity to continue: start beside it, on the branch that is meant, or drive another freedom",
        values,
    )
    error.branches = ways
    return error


class Structure(Shown):
    """Chain, families and structural groups of a mechanism at a closed position; prints as text. Returned by ``structure``.

    Attributes
    ----------
    report : DeterminacyReport
        The report that it is taken from.
    groups, families : Decomposition, Families
        Those of the report.
    identity : Identity or None
        Its kinematic chain; None for a mechanism with couplings.
    multiple_joints : tuple of MultipleJoint
        Revolute joints of three or more links.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.structure(mg.load("windows-2")).identity.name
    'Watt II'
    """

    def __init__(self, report: DeterminacyReport, groups: Decomposition, families: Families) -> None:
        self.report, self.groups, self.families = report, groups, families
        self.identity: Identity | None = None if report.mechanism.couplings else identify(report.mechanism)
        self.multiple_joints = joints_at(report.geometry.freedoms.position) if report.geometry else ()

    def __repr__(self) -> str:
        return f"Structure({self.report.mechanism.name!r}: {self.groups.symbol}; print it)"

    def document(self) -> Document:
        """Chain, families, groups, and the groups of other drivers."""
        blocks = [*self._chain(), Heading("Families", 2), *self._families()]
        blocks += [Heading("Groups", 2), *self.groups.blocks(), *self._drivers()]
        return Document(f"Structure of {self.report.mechanism.name}", tuple(blocks))

    def _chain(self) -> Iterator[Block]:
        if self.identity:
            first, *others = self.identity.text.splitlines()
            yield Paragraph(f"{first}.")
            yield Bullets(tuple(line.strip() for line in others))
            if self.multiple_joints:
                whole = identify(self.report.mechanism, joints=self.multiple_joints)
                yield Paragraph(
                    f"With multiple joints as one joint each: {whole.name}. Split, with the pairs on another of its links:"
                )
                rows = [
                    (
                        ", ".join(joint.pairs),
                        str(joint.order),
                        on,
                        "yes" if all(on in self.groups.ends[name] for name in joint.pairs) else "",
                        identify(self.report.mechanism, joints=(joint,)).split(joint, on).name,
                    )
                    for joint in self.multiple_joints
                    for on in joint.links
                ]
                yield Table(("joint", "order", "pairs on", "declared", "chain"), tuple(rows), align="lrlll")

    def _families(self) -> Iterator[Block]:
        f = self.families
        rows = [(row.link, *("yes" if has else "no" for has in row.columns), str(row.dimension)) for row in f.table]
        yield Table(("link", *COLUMNS, "span"), tuple(rows), align="l" + "c" * 6 + "r")
        loops = [
            (str(i), " ".join(loop.pairs), str(loop.family), str(loop.rank), ", ".join(loop.locked) or "-")
            for i, loop in enumerate(f.loops, start=1)
        ]
        yield Table(("loop", "pairs", "family", "rank", "locked"), tuple(loops), align="rlrrl")
        counts = ", ".join(f"c{j} = {c}" for j, c in enumerate(f.classes, start=1) if c)
        yield Paragraph(
            f"Family {f.family}, n = {f.links} moving links, {counts}: Dobrovolski's count gives M = {f.dobrovolski}; with the apparent "
            f"family {f.apparent:.4g} of the loops M = {f.by_apparent:.4g}; by rank M = {f.mobility}."
        )
        yield Bullets(f.why)

    def _drivers(self) -> Iterator[Block]:
        rows = tuple(self.report.groups_by_driver.items())
        if len(rows) > 1:
            yield Paragraph("With another driver:")
            yield Table(("driver", "groups"), rows)


@door
def structure(m: Mechanism, drives: str | Iterable[str] | None = None, **options: Any) -> Structure:
    """Report kinematic chain, families and structural groups of a mechanism at its closed start.

    Parameters
    ----------
    m : Mechanism
        The mechanism, with geometry.
    drives : str or iterable of str, optional
        Names of freedoms. Default: the declared drivers, completed by those that the report suggests.
    **options
        Those of ``check``.

    Returns
    -------
    Structure

    Raises
    ------
    DeclarationError
        No geometry, or loops that do not close.

    Examples
    --------
    >>> import mechgraph as mg
    >>> mg.structure(mg.load("four-bar")).groups.symbol
    'R - D10'
    """
    report = check(m, **options)
    families = report.families
    if families is None:
        raise _no_position(report)
    return Structure(report, _groups(report, drives), families)


@door
def groups(m: Mechanism, drives: str | Iterable[str] | None = None, **options: Any) -> Decomposition:
    """Decompose a mechanism into driver links and structural (Assur) groups, in the order in which they can be solved.

    Parameters
    ----------
    m : Mechanism
        The mechanism, with geometry.
    drives : str or iterable of str, optional
        As in ``structure``.
    **options
        Those of ``check``.

    Returns
    -------
    Decomposition

    Raises
    ------
    DeclarationError
        No geometry, or loops that do not close.

    Examples
    --------
    >>> import mechgraph as mg
    >>> g = mg.groups(mg.load("windows-2"))
    >>> g.symbol, g.words
    ('R - D10 - D10 - 3 + 0', 'R-RRR-RRR')
    """
    return _groups(check(m, **options), drives)


def _groups(report: DeterminacyReport, drives: str | Iterable[str] | None) -> Decomposition:
    m, faults = report.mechanism, list[str]()
    names = None if drives is None else (drives,) if isinstance(drives, str) else tuple(drives)
    known = {*m.freedom_names(), *(p.name for p in m.pairs if p.type.f == 1)}
    faults += [
        wrong(name, "drives", f"names of freedoms: {listed(sorted(known))}")
        for name in names or ()
        if name not in known
    ]
    if faults:
        raise DeclarationError(f"groups of {m.name!r}", faults)
    found = report.groups if names is None else report.groups_with(names)
    if found is None:
        raise _no_position(report)
    if len(found.drivers) < len(names or ()):
        able = f"independent freedoms, here {len(found.drivers)}, e.g. {', '.join(found.drivers)}"
        raise DeclarationError(f"groups of {m.name!r}", [wrong(tuple(names or ()), "drives", able)])
    return found


def _no_position(report: DeterminacyReport) -> MechgraphError:
    what = f"structure of {report.mechanism.name!r}"
    return DeclarationError(
        what, [f"{report.note} Families and groups need a closed position; give geometry that closes"]
    )
