"""The report for people on one page: the verdict, what to do, what may be trusted."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from mechgraph.document import Block, Bullets, Document, Paragraph, to_text
from mechgraph.report.advice import alternatives
from mechgraph.report.facts import Facts
from mechgraph.report.sentences import count_line, doubts, kind_line, motion_line, patterns, spins, verdict
from mechgraph.report.words import listed

LINES = 25
"""Most lines of text on 80 columns."""
CHANGES = 4
"""Most changes of pairs that are advised here."""
PAIRS_NAMED = 4
"""Most pairs named for one set of components."""
HOW_MUCH = "What is not unique depends on fits, stiffness and temperature; how much force a misfit locks in, a rigid model cannot know."
MORE = "All the facts: report.text(full=True), mechgraph check --full."


def document(r: Facts, first: tuple[Paragraph, ...] = ()) -> Document:
    """The page, with what stands ``first`` on it; what comes last in a list is left to the whole report where there is no room."""
    parts = {title: [_sentence(line) for line in told(r)] for title, told in PARTS.items()}
    while True:
        items = [item for title, lines in parts.items() if lines for item in (title, lines)]
        blocks: list[Block] = [*first, Paragraph(verdict(r)), *_note(r), Bullets(items), Paragraph(MORE)]
        page = Document(f"Determinacy of {r.mechanism.name}", tuple(blocks))
        longest = max(parts.values(), key=len)
        if len(to_text(page).splitlines()) <= LINES or len(longest) < 2:
            return page
        longest.pop()


def _note(r: Facts) -> list[Paragraph]:
    return [Paragraph(r.note)] if r.note else []


def _to_do(r: Facts) -> Iterator[str]:
    """What to change, the drivers first; for a determinate mechanism nothing."""
    yield from (a.text for a in r.advice if a.effect is None)
    if r.contradicting_drives and r.mobility and not r.suggested_drives:
        yield "the declared drivers depend on each other: take one away"
    bearing = [p for p in r.passive if p.load_bearing]
    for p in bearing:
        what = "couple" if p.turns else "force"
        yield f"hold {p.name} or balance the load on it: a {what} of {p.size} moves it, and no part takes that"
    yield from alternatives(r.advice)[:CHANGES]
    if r.determinate and not r.near and not bearing:
        yield "nothing: equilibrium alone gives every force"


def _trusted(r: Facts) -> Iterator[str]:
    """What is unique, what is not and why, how sure that is, what was counted."""
    known = r.reactions
    if known:
        efforts = known.is_unique[known.components.efforts]
        driven = (
            ["the driver effort" if len(efforts) == 1 else "all driver efforts"]
            if efforts.any() and efforts.all()
            else []
        )
        some = [f"{words} of {listed(pairs, PAIRS_NAMED)}" for words, pairs, _ in patterns(known, known.is_unique)]
        some = ["every reaction"] if known.all_unique else some
        yield f"unique, as equilibrium alone gives it: {'; '.join(some + driven) or 'nothing'}"
        if not known.all_unique:
            yield HOW_MUCH
    yield from doubts(r)
    yield from filter(None, (kind_line(r), count_line(r)))
    yield from motion_line(r)
    if r.passive and not any(p.load_bearing for p in r.passive):
        yield f"{spins(r)} {'carries' if len(r.passive) == 1 else 'carry'} no load and move{'s' * (len(r.passive) == 1)} no other link"


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:].removesuffix('.')}."


PARTS: dict[str, Callable[[Facts], Iterator[str]]] = {"What to do:": _to_do, "What may be trusted:": _trusted}
"""The parts of the page."""
