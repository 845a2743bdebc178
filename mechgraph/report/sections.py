"""The determinacy report as one list of facts: their keys in the data, and where and how they stand on paper.

Text, Markdown and HTML follow from the list through a document, JSON through plain data.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from mechgraph.document import Block, Bullets, Document, Heading, Paragraph, Table
from mechgraph.model.pair_table import TABLE
from mechgraph.numerics.tolerances import RANKS
from mechgraph.report.facts import Facts
from mechgraph.report.sentences import assumed, kind_line, loop_names, mobility_line, reasons, verdict
from mechgraph.report.words import component_words, listed, plural
from mechgraph.structure.pair_changes import LARGEST_FOR_SETS

TERMS = 4
"""Most terms of a sum that is printed."""
LISTED = 20
"""Most items of one kind that are printed; all are in the JSON."""
NOT_UNIQUE = (
    "Unique: equilibrium alone gives it. Not unique: it also depends on fits, stiffness and temperature; a rigid-body program can only "
    "assume it, and how much force a misfit locks in it cannot know."
)
MEANINGS = (
    "A self-stress is a set of reactions that balance each other without any load: any multiple of it may be built in. Components "
    "in which no self-stress has a part are proved unique. Moments are divided by L = {L:.4g} so that they compare with forces."
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
        lines.append("the declared drivers depend on each other: take one away")
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
    if known.combinations:
        lines = [f"group {group + 1}: {text}" for group, text in known.combinations if text.count(":") <= TERMS]
        more = len(known.combinations) - len(lines)
        if more:
            lines.append(f"{'and ' if lines else ''}{more} of more than {TERMS} terms (see report.to_dict())")
        yield Paragraph("These sums are unique though their terms are not:")
        yield from _listed(lines)
    if known.unsought:
        where = f"{plural(known.unsought, 'group')} of many components"
        yield Paragraph(f"Sums across pairs were not sought in {where}.")


def _advice(r: Facts) -> Iterator[Block]:
    yield from _listed(a.text for a in r.advice)
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


def _ledger(r: Facts) -> Iterator[Block]:
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
        yield Paragraph(f"Rank decided by the {r.engine} engine; largest value taken for zero: {size}.")


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
    Section("Ledger of the force equations (unknowns / equations)", ("ledger",), _ledger),
    Section("Checks", ("engine", "dropped"), _checks),
)
"""All facts in the order of the report."""
KEYS = tuple(key for section in SECTIONS for key in section.keys)
"""Their names in the data."""
