"""The determinacy report in words: verdict first, then facts, reasons and advice. Pure functions of a report."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from mechgraph.document import Bullets, Document, Heading, Paragraph, Table

if TYPE_CHECKING:
    from mechgraph.structure.report import DeterminacyReport

LISTED = 20
"""Items of one kind that are printed; the rest stand in the JSON."""


def plural(count: int, one: str, many: str = "") -> str:
    """``1 driver``, ``3 drivers``."""
    return f"{count} {one if count == 1 else many or one + 's'}"


def verdict(r: DeterminacyReport) -> str:
    """The verdict in one sentence."""
    book = r.ledger("lee")
    drivers = len(r.mechanism.drives)
    count = f"{plural(drivers, 'driver')}, {plural(book.unknowns, 'unknown')}, {plural(book.equations, 'equation')}"
    if r.mobility is None:
        return _topology_verdict(r, count)
    near = f" Nearly singular: margin {r.margin:.2g}." if r.near else ""
    loose = {pair: [n for n, ok in row.items() if not ok] for pair, row in r.unique.items()}
    total = sum(len(names) for names in loose.values())
    if r.undriven:
        free = f"{plural(len(r.undriven), 'freedom')} left free that {'is' if len(r.undriven) == 1 else 'are'} neither driven nor passive"
        return f"Under-driven: mobility {r.mobility}, {plural(drivers, 'driver')}, {free}.{near}"
    if not total:
        idle = f" ({plural(len(r.passive), 'passive freedom')} held)" if r.passive else ""
        state = "Determinate" if r.mobility else "Determinate structure"
        return f"{state}: {count}; every reaction is unique{idle}.{near}"
    if r.mobility:
        state = (
            f"Moves with mobility {r.finite_mobility}"
            if r.finite_mobility
            else f"Shaky: mobility {r.mobility} is only infinitesimal"
        )
    else:
        state = "Structure (mobility 0)"
    pairs = [pair for pair, names in loose.items() if names]
    shown = ", ".join(pairs[:8]) + (", ..." if len(pairs) > 8 else "")
    groups = len({s.group for s in r.self_stresses})
    tied = f"form {plural(groups, 'self-stress group')}" if groups > 1 else "form one self-stress group"
    efforts = [n for names in loose.values() for n in names if n.startswith("effort")]
    sure = (
        "" if not drivers else ("; driver efforts are unique" if not efforts else "; driver efforts are not all unique")
    )
    return (
        f"{state}, but {plural(total, 'reaction component')} of {shown} {tied} (redundancy {r.redundancy}){sure}.{near}"
    )


def _topology_verdict(r: DeterminacyReport, count: str) -> str:
    generic = r.generic
    drivers = len(r.mechanism.drives)
    if generic.excess:
        where = "; ".join(
            f"over by {n} in the {_loop_names(r, loops)} whatever the dimensions" for n, loops in generic.places
        )
        return f"{count}: {where}; mobility {generic.mobility} for general geometry."
    if generic.mobility > drivers:
        return f"{count}: mobility {generic.mobility} for general geometry, {plural(generic.mobility - drivers, 'freedom')} not driven."
    return f"{count}: determinate for general geometry (mobility {generic.mobility})."


def _loop_names(r: DeterminacyReport, loops: tuple[int, ...]) -> str:
    shown = ["-".join(name for name, _ in r.loops[i]) for i in loops[:3]]
    more = f" and {len(loops) - 3} more" if len(loops) > 3 else ""
    return ("loop " if len(loops) == 1 else "loops ") + ", ".join(shown) + more


def _facts(r: DeterminacyReport) -> list[tuple[str, str]]:
    facts = [
        ("links (with frame)", str(len(r.links))),
        ("pairs", str(len(r.pairs))),
        ("loops", str(len(r.loops))),
        ("freedoms of the pairs", str(r.freedom_count)),
        ("mobility by count", str(r.mobility_by_count)),
        ("mobility, general geometry", str(r.generic.mobility)),
    ]
    if r.geometry and r.margin is not None:
        facts += [
            ("mobility by rank, here", str(r.mobility)),
            ("mobility, finite", str(r.finite_mobility)),
            ("  input freedoms", str(r.inputs)),
            ("  passive freedoms", str(len(r.passive))),
            ("redundancy", str(r.redundancy)),
            ("margin (kept / largest)", f"{r.margin:.3g}"),
        ]
        if r.dropped:
            facts.append(("dropped / largest", f"{r.dropped:.1g}"))
    return facts


def explanation(r: DeterminacyReport) -> list[str]:
    """Why count and rank differ, in the words of the report."""
    if not r.geometry:
        return []
    out = []
    excess = r.excess
    if excess["structural"]:
        places = "; ".join(f"{n} in the {_loop_names(r, loops)}" for n, loops in r.generic.places)
        out.append(f"Structural excess {excess['structural']}: below the count whatever the dimensions ({places}).")
    if excess["dimensions"]:
        out.append(
            f"Overconstrained by its dimensions, by {excess['dimensions']}: the rank stays below that of general geometry along the motion."
        )
    if excess["here"]:
        out.append(f"Singular here, by {excess['here']}: positions near by have a higher rank.")
    if r.mobility and r.finite_mobility == 0:
        out.append("Shaky: the mobility is infinitesimal only; no motion closes over a finite stroke.")
    elif r.mobility and r.finite_mobility is not None and r.finite_mobility < r.mobility:
        out.append(f"Of mobility {r.mobility} here, {r.finite_mobility} is finite; the rest is instantaneous.")
    if r.motion and r.motion.stroke:
        out.append(
            f"The motion was followed over a stroke of {r.motion.stroke:.2g} (radians, or lengths / L) with the loops closed."
        )
    if r.near:
        gap = f", largest dropped {r.dropped:.1g}" if r.dropped else ""
        out.append(
            f"Nearly singular: smallest kept singular value {r.margin:.2g} of the largest{gap}; a small change of "
            "dimensions may change the verdict."
        )
    if not out:
        out.append("Count and rank agree.")
    return out


def _listed(items: Iterable[str]) -> Bullets:
    texts = list(items)
    more = len(texts) - LISTED
    return Bullets(tuple(texts[:LISTED] + ([f"... and {more} more (see the JSON)"] if more > 0 else [])))


def _ledger(r: DeterminacyReport) -> Table:
    lee, minimal = r.ledger("lee"), r.ledger("minimal")
    rows = [
        (
            k,
            str(row.count),
            str(row.unknowns),
            str(row.equations),
            str(minimal.by_kind[k].unknowns),
            str(minimal.by_kind[k].equations),
        )
        for k, row in lee.by_kind.items()
    ]
    rows.append(("sum", "", str(lee.unknowns), str(lee.equations), str(minimal.unknowns), str(minimal.equations)))
    header = ("kind", "count", "unknowns (Lee)", "equations (Lee)", "unknowns (minimal)", "equations (minimal)")
    return Table(header, tuple(rows), align="lrrrrr")


def _loops(r: DeterminacyReport) -> Table:
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
    if len(r.loop_facts) > LISTED:
        rows.append(("...", f"and {len(r.loop_facts) - LISTED} more (see the JSON)", "", "", ""))
    return Table(("loop", "links and pairs", "freedoms", "rank", "excess"), tuple(rows), align="rlrrr")


def _uniqueness(r: DeterminacyReport) -> Table:
    rows = []
    for pair, row in r.unique.items():
        yes = " ".join(n for n, ok in row.items() if ok)
        no = " ".join(n for n, ok in row.items() if not ok)
        rows.append((pair, r.mechanism.pair(pair).type.symbol, yes or "none", no or "none"))
    if len(rows) > LISTED:
        rows = [*rows[:LISTED], ("...", "", f"and {len(rows) - LISTED} pairs more (see the JSON)", "")]
    return Table(("pair", "type", "unique", "not unique"), tuple(rows))


def _stresses(r: DeterminacyReport) -> list[Any]:
    if not r.self_stresses or not r.reactions:
        return []
    lines = [f"group {s.group + 1}: {s.text}" for s in r.self_stresses]
    blocks: list[Any] = [
        Heading("Self-stresses (reactions without load; moments divided by L)", 2),
        _listed(lines),
    ]
    if r.reactions.combinations:
        blocks += [
            Heading("Unique only in combination", 2),
            _listed(f"group {group + 1}: {text}" for group, text in r.reactions.combinations),
        ]
    return blocks


def _structure(r: DeterminacyReport) -> list[Any]:
    parts = r.parts
    lines = []
    if parts.redundant_pairs:
        lines.append(
            f"{plural(parts.spare_unknowns, 'reaction unknown')} too many, in the pairs {_short(parts.redundant_pairs)}"
        )
    if parts.free_links:
        lines.append(f"{plural(parts.spare_equations, 'equation')} too many, in the links {_short(parts.free_links)}")
    if not lines:
        lines.append("every equation has an unknown of its own, and every unknown an equation")
    return [Heading("By count alone (matching of unknowns and equations)", 2), Bullets(tuple(lines))]


def _short(names: tuple[str, ...]) -> str:
    return ", ".join(names[:LISTED]) + (f" and {len(names) - LISTED} more" if len(names) > LISTED else "")


def _drivers(r: DeterminacyReport) -> list[Any]:
    if not r.geometry:
        return []
    lines = []
    able = [name for f in r.drivable for name in f.freedoms]
    lines.append(f"can drive: {_short(tuple(able))}" if able else "no freedom can drive")
    lines += [f"only one of {', '.join(group)} (they move in proportion)" for group in r.dependent_drives]
    lines += [f.text for f in r.not_drivable]
    if not r.mechanism.drives and r.suggested_drives:
        lines.append(f"suggested: {', '.join(r.suggested_drives)}")
    return [Heading("Drivers", 2), _listed(lines)]


def document(r: DeterminacyReport) -> Document:
    """The report as a document."""
    blocks: list[Any] = [Paragraph(r.verdict)]
    if r.note:
        blocks.append(Paragraph(r.note))
    blocks += [Table(("fact", "value"), tuple(_facts(r)), align="lr"), *(Paragraph(text) for text in explanation(r))]
    blocks += [Heading("Loops", 2), _loops(r), Heading("Ledger", 2), _ledger(r), *_structure(r)]
    for key, title in (("undriven", "Left free"), ("passive", "Passive freedoms"), ("locked", "Locked freedoms")):
        found = getattr(r, key)
        if found:
            blocks += [Heading(title, 2), _listed(f.text for f in found)]
    blocks += _drivers(r)
    if r.unique:
        blocks += [Heading("Reactions", 2), _uniqueness(r), *_stresses(r)]
    if r.advice:
        blocks += [Heading("Advice", 2), _listed(a.text for a in r.advice)]
    return Document(f"Determinacy of {r.mechanism.name}", tuple(blocks))
