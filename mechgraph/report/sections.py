"""The determinacy report as a document: verdict first, then facts, reasons, findings, reactions and advice, then the record."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from mechgraph.document import Bullets, Document, Heading, Paragraph, Table
from mechgraph.model.pair_table import TABLE
from mechgraph.numerics.tolerances import RANKS
from mechgraph.report.sentences import assumed, loop_names, plural, reasons, short

if TYPE_CHECKING:
    from mechgraph.report.report import DeterminacyReport

TERMS = 4
"""Most terms of a sum that is printed."""
LISTED = 20
"""Most items of one kind that are printed; all are in the JSON."""
NOT_UNIQUE = (
    "Unique: equilibrium alone gives it. Not unique: it also depends on fits, stiffness and temperature; a rigid-body program can only "
    "assume it."
)
MEANINGS = (
    "A self-stress is a set of reactions that balance each other without any load: any multiple of it may be built in. Components "
    "in which no self-stress has a part are proved unique. Moments are divided by L = {L:.4g} so that they compare with forces."
)


def document(r: DeterminacyReport) -> Document:
    """The report as a document."""
    blocks: list[Any] = [Paragraph(r.verdict)]
    if r.note:
        blocks.append(Paragraph(r.note))
    blocks += [*_facts(r), *_cure(r)]
    for key, title in (
        ("undriven", "Neither driven nor passive"),
        ("passive", "Passive freedoms"),
        ("locked", "Locked freedoms"),
    ):
        found = getattr(r, key)
        if found:
            blocks += [Heading(title, 2), _listed(f.text for f in found)]
    blocks += _drivers(r) + _reactions(r) + _advice(r) + _loops(r) + _structure(r) + _ledger(r) + _checks(r)
    return Document(f"Determinacy of {r.mechanism.name}", tuple(blocks))


def _listed(items: Iterable[str]) -> Bullets:
    texts = list(items)
    more = len(texts) - LISTED
    return Bullets(tuple(texts[:LISTED] + ([f"... and {more} more (see report.to_dict())"] if more > 0 else [])))


def _facts(r: DeterminacyReport) -> list[Any]:
    """Numbers of links, pairs and loops; count and rank side by side, and why they differ."""
    there = (
        f"{plural(len(r.links), 'link')} with the frame, {plural(len(r.pairs), 'pair')}, {plural(len(r.loops), 'loop')}, "
        f"{plural(len(r.mechanism.drives), 'driver')}."
    )
    f, rows = r.freedom_count, r.equation_count
    columns: list[tuple[str, list[int]]] = [
        ("by count", [f, rows, rows, f - rows, 0]),
        ("general geometry", [f, rows, r.generic.rank, r.generic.mobility, r.generic.excess]),
    ]
    if r.geometry and r.mobility is not None and r.redundancy is not None:
        columns.append(("this geometry", [f, rows, f - r.mobility, r.mobility, r.redundancy]))
    names = ("freedoms of the pairs", "closure equations", "of these independent", "mobility", "redundancy")
    table = Table(
        ("", *(head for head, _ in columns)),
        tuple((name, *(str(values[i]) for _, values in columns)) for i, name in enumerate(names)),
        align="l" + "r" * len(columns),
    )
    return [Paragraph(there), table, *_mobility(r), *([Bullets((*reasons(r), *assumed(r)))] if r.geometry else [])]


def _mobility(r: DeterminacyReport) -> list[Any]:
    if not r.geometry or not r.mobility or r.margin is None:
        return []
    return [
        Paragraph(
            f"Mobility {r.mobility} = {plural(r.inputs or 0, 'input freedom')} + {plural(len(r.passive), 'passive freedom')}; "
            f"finite mobility: {r.finite_mobility}. Margin to a singular position: {r.margin:.3g} (near below {r.near_below:.3g})."
        )
    ]


def _drivers(r: DeterminacyReport) -> list[Any]:
    if not r.geometry:
        return []
    able = [name for f in r.drivable for name in f.freedoms]
    lines = [f"can drive: {short(able, LISTED)}" if able else "no freedom can drive"]
    if r.contradicting_drives and r.mobility:
        lines.append("the declared drivers depend on each other: take one away")
    lines += [f"only one of {short(group, LISTED)} (they move in proportion)" for group in r.dependent_drives]
    reasons_why: dict[str, list[str]] = {}
    for f in r.not_drivable:
        reasons_why.setdefault(f.text.split(": ", 1)[1], []).extend(f.freedoms)
    lines += [f"cannot drive: {short(names, LISTED)}: {why}" for why, names in reasons_why.items()]
    if r.suggested_drives:
        word = "drive also" if r.mechanism.drives else "suggested"
        lines.append(f"{word}: {short(r.suggested_drives, LISTED)}")
    return [Heading("Drivers", 2), _listed(lines)]


def _reactions(r: DeterminacyReport) -> list[Any]:
    if not r.unique:
        return []
    rows: list[tuple[str, str, str, str]] = []
    kinds = {p.name: p.type.symbol for p in r.mechanism.pairs}
    for pair, row in r.unique.items():
        yes = " ".join(n for n, ok in row.items() if ok)
        no = " ".join(n for n, ok in row.items() if not ok)
        kind = kinds.get(pair, "coupling") if len(rows) < LISTED else ""
        rows.append((pair, kind, yes or "none", no or "none"))
    if len(rows) > LISTED:
        rows = [*rows[:LISTED], ("...", "", f"and {len(rows) - LISTED} pairs more (see report.to_dict())", "")]
    loose = [NOT_UNIQUE] if any(not ok for row in r.unique.values() for ok in row.values()) else []
    table = Table(("pair", "type", "unique", "not unique"), tuple(rows))
    return [Heading("Reactions", 2), table, *(Paragraph(text) for text in loose), *_stresses(r)]


def _stresses(r: DeterminacyReport) -> list[Any]:
    found = r.reactions
    if not found or not found.count or not r.geometry:
        return []
    lines = [
        f"group {s.group + 1}: {s.text or 'in the efforts of the couplings alone'}" for s in found.first_states(LISTED)
    ]
    if found.listed > len(lines):
        lines.append(f"... and {found.listed - len(lines)} more (report.self_stresses)")
    if found.count > found.listed:
        lines.append(f"{found.count - found.listed} more that connect loops are not listed: too many")
    blocks: list[Any] = [
        Heading("Self-stresses", 2),
        Paragraph(MEANINGS.format(L=r.geometry.system.par.L)),
        Bullets(tuple(lines)),
    ]
    directions = [t.text for t in found.transverse]
    if directions or found.combinations or found.unsought:
        blocks.append(Heading("Unique only in combination", 2))
        if directions:
            blocks += [Paragraph("Directions in the axes x, y, z of the pair's marker."), _listed(directions)]
        if found.combinations:
            blocks += _sums(found.combinations)
        if found.unsought:
            where = f"{plural(found.unsought, 'group')} of many components"
            blocks.append(Paragraph(f"Sums across pairs were not sought in {where}."))
    return blocks


def _sums(combinations: tuple[tuple[int, str], ...]) -> list[Any]:
    """Sums across pairs that are unique; those of many terms are only in the JSON."""
    lines = [f"group {group + 1}: {text}" for group, text in combinations if text.count(":") <= TERMS]
    more = len(combinations) - len(lines)
    if more:
        lines.append(f"{'and ' if lines else ''}{more} of more than {TERMS} terms (see report.to_dict())")
    return [Paragraph("These sums are unique though their terms are not:"), _listed(lines)]


def _cure(r: DeterminacyReport) -> list[Any]:
    """The change that removes most redundancy, in one line near the top."""
    better = [e for e in r.effects if e.redundancy[1] < e.redundancy[0]]
    if not better:
        return []
    best = min(better, key=lambda e: (e.redundancy[1], len(e.changes)))
    start = "To remove all redundancy" if not best.redundancy[1] else "To lower the redundancy"
    return [Paragraph(f"{start}: {best.text} (more under Advice).")]


def _types(r: DeterminacyReport) -> list[Any]:
    """Names of the pair types that the advice proposes."""
    new = sorted({kind for e in r.effects for _, _, kind in e.changes if kind in TABLE})
    return [Paragraph(f"Pair types: {'; '.join(f'{kind} {TABLE[kind].name}' for kind in new)}.")] if new else []


def _advice(r: DeterminacyReport) -> list[Any]:
    if r.advice:
        return [Heading("Advice", 2), _listed(a.text for a in r.advice), *_types(r)]
    return []


def _loops(r: DeterminacyReport) -> list[Any]:
    if not r.loops:
        return []
    rows = [
        (
            str(i + 1),
            fact.chain,
            str(fact.freedoms),
            "-" if fact.rank is None else str(fact.rank),
            "-" if fact.excess is None else str(fact.excess),
        )
        for i, fact in enumerate(r.loop_facts[:LISTED])
    ]
    if len(r.loops) > LISTED:
        rows.append(("...", f"and {len(r.loops) - LISTED} more (see report.to_dict())", "", "", ""))
    table = Table(("loop", "links and pairs", "freedoms", "rank", "excess"), tuple(rows), align="rlrrr")
    return [Heading("Loops", 2), table]


def _structure(r: DeterminacyReport) -> list[Any]:
    parts = r.parts
    lines = []
    if parts.redundant_pairs:
        many = plural(parts.spare_unknowns, "reaction unknown")
        lines.append(f"{many} more than equations, in the pairs {short(parts.redundant_pairs, LISTED)}")
    if parts.free_links:
        many = plural(parts.spare_equations, "equation")
        lines.append(f"{many} more than unknowns, in the links {short(parts.free_links, LISTED)}")
    if not lines:
        lines.append("every equation is matched to an unknown, and every unknown to an equation")
    lines += [
        f"{n} redundant whatever the dimensions, in the {loop_names(r, loops)}"
        for n, loops in r.generic.places[:LISTED]
    ]
    return [Heading("By count alone (unknowns matched to equations)", 2), Bullets(tuple(lines))]


def _checks(r: DeterminacyReport) -> list[Any]:
    if not r.geometry:
        return []
    return [
        Heading("Checks", 2),
        Paragraph(f"Rank decided by the {r.engine} engine; largest value taken for zero: {_size(r.dropped or 0.0)}."),
    ]


def _size(value: float) -> str:
    """A dropped value; one that is no more than rounding without its size, which differs from machine to machine."""
    return "rounding" if value < RANKS.doubt else f"{value:.2g} of the largest"


def _ledger(r: DeterminacyReport) -> list[Any]:
    lee, minimal = r.ledger("lee"), r.ledger("minimal")
    rows = [
        (
            kind,
            str(row.count),
            f"{row.unknowns} / {row.equations}",
            f"{minimal.by_kind[kind].unknowns} / {minimal.by_kind[kind].equations}",
        )
        for kind, row in lee.by_kind.items()
    ]
    rows.append(("sum", "", f"{lee.unknowns} / {lee.equations}", f"{minimal.unknowns} / {minimal.equations}"))
    return [
        Heading("Ledger of the force equations (unknowns / equations)", 2),
        Table(("kind", "count", "as Lee writes them", "minimal"), tuple(rows), align="lrrr"),
    ]
