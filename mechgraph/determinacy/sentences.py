"""The determinacy report in sentences: the verdict and the reasons, all of it or for people on one page. Pure functions of the facts."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from mechgraph.determinacy.facts import Facts
from mechgraph.determinacy.families import MotionKind
from mechgraph.determinacy.findings import KINDS, alternatives, component_words, joined, plural, vector
from mechgraph.determinacy.uniqueness import Uniqueness
from mechgraph.document import NAMED, Block, Bullets, Document, Paragraph, to_text
from mechgraph.errors import listed
from mechgraph.maths.se3 import Index
from mechgraph.maths.tolerances import RANKS
from mechgraph.model.pair import second_direction

SETS = 3
"""Most sets of components that the verdict names."""


Pattern = tuple[str, list[str], int]
"""Components in words, the names of their pairs, the number of components."""


def verdict(r: Facts) -> str:
    """The verdict in one sentence, and a second one where a small change of the dimensions may change the verdict."""
    if r.mobility is None:
        return _of_topology(r)
    return _of_position(r) + _near(r)


def _near(r: Facts) -> str:
    if not r.near or r.margin is None or r.dropped is None or _over_driven(r):
        return ""
    if r.dead_point:
        return f" Near a dead point: {weakest_drive(r)} is almost stationary while the mechanism moves."
    # part of the margin above which a dropped singular value is reported rather than the margin
    if r.dropped > r.margin * 1e-9:
        return f" Near another verdict: a singular value of {r.dropped:.2g} (relative) was treated as zero."
    if not r.near_other_rank and r.reactions:
        return f" Near another verdict: {_doubtful_part(r.reactions)}."
    return f" Nearly singular: margin {r.margin:.2g}."


def _doubtful_part(known: Uniqueness) -> str:
    """The component whose part in the self-stresses is nearest to the limit, on either side."""
    name, size, unique = known.most_doubtful
    verb = "unique, but has" if unique else "not unique, but has only"
    return f"{name} is called {verb} a part of {size:.1g} in the self-stresses"


def _over_driven(r: Facts) -> bool:
    """Whether there are more drivers than motions; then some depend on others without a dead point."""
    return bool(r.mobility) and len(r.mechanism.drives) > (r.mobility or 0)


def weakest_drive(r: Facts) -> str:
    """The driver that moves least; drivers, where several depend on each other."""
    names = r.mechanism.freedom_names()
    weak = [names[c] for c in r.weak_drives]
    if not r.mechanism.drives:
        return "no driver"
    return f"the driver {weak[0]}" if len(weak) == 1 else "a combination of the drivers"


def _counts(r: Facts) -> str:
    book = r.ledger("lee")
    return (
        f"{plural(len(r.mechanism.drives), 'driver')}, {plural(book.unknowns, 'unknown')}, "
        f"{plural(book.equations, 'equation')}"
    )


def _of_position(r: Facts) -> str:
    drivers = len(r.mechanism.drives)
    if r.contradicting_drives and r.mobility:
        if drivers <= r.mobility:
            dead = "a dead point" if drivers == 1 else "a dead point, or dependent drivers"
            return f"Singular drive: mobility {r.mobility}, but {weakest_drive(r)} cannot move it here ({dead})."
        return f"Over-driven: mobility {r.mobility}, {plural(drivers, 'driver')} that are not independent."
    if r.undriven:
        return _left_free(r)
    if not r.mobility and drivers:
        return _driven_structure(r)
    if r.reactions is None or r.reactions.all_unique:
        idle = f": {len(r.passive)} of them {spins(r)}" if r.passive else ""
        state = "Determinate" if r.mobility else "Determinate structure"
        return f"{_bearing(r)}{state}{' (planar)' * r.mechanism.planar}: {_counts(r)}{idle}; every reaction is unique."
    return f"{_bearing(r)}{_state(r)}{_not_unique(r, r.reactions)}."


def spins(r: Facts) -> str:
    """The passive freedoms that no load moves: ``the spins of rod1, rod2``."""
    kinds = {"spin" if p.turns else "slide" for p in r.passive}
    what = kinds.pop() if len(kinds) == 1 else "passive motion"
    bodies = list(dict.fromkeys(" with ".join(p.links) for p in r.passive))
    return f"the {plural(len(r.passive), what).split(maxsplit=1)[1]} of {joined(bodies)}"


def _bearing(r: Facts) -> str:
    """What holds passive freedoms that carry load, before the rest of the verdict."""
    bearing = [f"{p.name} by {p.size}" for p in r.passive if p.load_bearing]
    if not bearing:
        return ""
    return f"Load-bearing passive freedom that nothing holds: {listed(bearing, SETS)}. If constrained: "


def _left_free(r: Facts) -> str:
    """A freedom is left free; at a change point that may be one of the position alone."""
    drivers, verb = plural(len(r.mechanism.drives), "driver"), "is" if len(r.undriven) == 1 else "are"
    free = f"{plural(len(r.undriven), 'freedom')} {verb} neither driven nor passive"
    if not r.change_point:
        shaky = " The mobility is infinitesimal only: a shaky structure." if _shaky(r) else ""
        return f"Under-driven: mobility {r.mobility}, {drivers}; {free}{here_only(r.passive_here_only)}.{shaky}"
    state = "under-driven at" if r.suggested_drives else "at"
    return f"Finite mobility {r.finite_mobility}, {drivers}, {state} a change point: mobility {r.mobility} here; {free} here."


def here_only(names: Sequence[str]) -> str:
    """What looks passive where the mechanism stands, behind the freedoms that are not; empty where nothing does."""
    if not names:
        return ""
    # longest list of names in a sentence that is not counted instead
    shown = joined(names) if len(names) <= SETS and len(joined(names)) <= 80 else f"{len(names)} motions"
    return f" ({shown}: passive in this position only)"


def _driven_structure(r: Facts) -> str:
    """A structure with drivers on it."""
    one = len(r.mechanism.drives) == 1
    who = f"{weakest_drive(r)} can only load it" if one else "its drivers can only load it"
    rest = (
        f"without {'it' if one else 'them'} every reaction is unique"
        if not r.redundancy
        else f"even without {'it' if one else 'them'} {plural(r.redundancy, 'constraint is', 'constraints are')} redundant"
    )
    return f"A structure (mobility 0), which cannot be driven: {who}; {rest}."


def _shaky(r: Facts) -> bool:
    return bool(r.mobility) and r.finite_mobility == 0


def _state(r: Facts) -> str:
    if not r.mobility:
        return "A structure (mobility 0)"
    if _shaky(r):
        return f"Shaky structure: mobility {r.mobility} is infinitesimal only"
    return f"Moves with mobility {r.finite_mobility}" + (f" ({len(r.passive)} of it {spins(r)})" if r.passive else "")


def _not_unique(r: Facts, known: Uniqueness) -> str:
    """Which components are not unique: for a planar or spherical mechanism by what it is made for, else by name."""
    sets = patterns(known, ~known.is_unique)
    loose = [c.name for c, ok in zip(r.mechanism.couplings, known.coupling_is_unique.tolist(), strict=True) if not ok]
    who = "effort of the coupling {} is" if len(loose) == 1 else "efforts of the couplings {} are"
    tied = f"the {who.format(listed(loose, NAMED))} not unique"
    if not sets:
        return f", but {tied} (redundancy {r.redundancy})"
    if r.own_forces_unique:
        efforts = " and the driver effort" if len(r.mechanism.drives) == 1 else " and driver efforts"
        words = f"{KINDS[r.kind.name].own}{efforts if r.mechanism.drives else ''}"
        return f", {r.kind.name}: all {words} are unique; not unique: {_others(r, sets)} (redundancy {r.redundancy})"
    total = sum(count for *_, count in sets)
    components = "reaction component is" if total == 1 else "reaction components are"
    more = f"; {tied}" if loose else ""
    kind = f", {r.kind.name}" if r.kind.name else ""
    return f"{kind}, but {total} {components} not unique: {_of_pairs(sets)}{more} (redundancy {r.redundancy}){_efforts(r, known)}"


def _others(r: Facts, sets: list[Pattern]) -> str:
    """What is not unique in a planar or spherical mechanism all of whose pairs are of its kind; else by name."""
    if not r.kind.by_pairs:
        return _of_pairs(sets)
    words, turning = KINDS[r.kind.name], any(f.turns for p in r.mechanism.pairs for f in p.type.freedoms)
    names = list(dict.fromkeys(name for _, pairs, _ in sets for name in pairs))
    which = f" of {listed(names, NAMED)}" if len(names) < len(r.pairs) else ""
    return (words.others if turning else words.without_pins) + which


def _of_pairs(sets: list[Pattern]) -> str:
    shown = [f"{words} of {listed(pairs, NAMED)}" for words, pairs, _ in sets[:SETS]]
    if len(sets) > SETS:
        shown.append(f"others of {plural(sum(len(pairs) for _, pairs, _ in sets[SETS:]), 'further pair')}")
    return "; ".join(shown)


def patterns(known: Uniqueness, which: NDArray[np.bool_]) -> list[Pattern]:
    """The reaction components in ``which (components,)`` in words, their pairs in order of declaration, and their number."""
    components = known.components
    pairs = components.system.m.pairs
    found: dict[str, list[tuple[Index, int]]] = {}
    for g in components.system.groups:
        row = pairs[int(g.pairs[0])].type
        names = row.component_names
        mine = which[components.first[g.pairs][:, None] + np.arange(len(names))]
        code = mine @ (1 << np.arange(len(names)))
        for value in np.unique(code[code > 0]):
            some = [n for i, n in enumerate(names) if value >> i & 1]
            every = "all components" if len(some) == len(names) > 1 else component_words(row, some)
            found.setdefault(every, []).append((g.pairs[code == value], len(some)))
    sets = [
        (words, np.sort(np.concatenate([at for at, _ in some])), sum(len(at) * n for at, n in some))
        for words, some in found.items()
    ]
    return [
        (words, [pairs[k].name for k in at.tolist()], n) for words, at, n in sorted(sets, key=lambda s: int(s[1][0]))
    ]


def _efforts(r: Facts, known: Uniqueness) -> str:
    if not r.mechanism.drives:
        return ""
    unique = bool(known.is_unique[known.components.efforts].all())
    smooth = " without friction" if unique and r.friction else ""
    if len(r.mechanism.drives) == 1:
        return f"; the driver effort is {'' if unique else 'not '}unique{smooth}"
    return f"; {'all driver efforts are unique' if unique else 'driver efforts are not all unique'}{smooth}"


def _of_topology(r: Facts) -> str:
    generic, count = r.generic, _counts(r)
    drivers = len(r.mechanism.drives)
    if generic.excess:
        places = generic.places[:SETS]
        where = "; ".join(f"{n} redundant in the {loop_names(r, loops)} whatever the dimensions" for n, loops in places)
        more = len(generic.places) - len(places)
        rest = f"; others in {plural(more, 'further set')} of loops" if more else ""
        return f"{count}: {where}{rest}; mobility {generic.mobility} for general geometry."
    if generic.mobility > drivers:
        free = plural(generic.mobility - drivers, "freedom")
        return (
            f"{count}: mobility {generic.mobility} for general geometry, {free} not driven (to be driven, or passive)."
        )
    if generic.mobility < drivers:
        return (
            f"{count}: mobility {generic.mobility} for general geometry, "
            f"{plural(drivers - generic.mobility, 'driver')} too many."
        )
    plane = "in the plane " * r.mechanism.planar
    return f"{count}: determinate {plane}for general geometry (mobility {generic.mobility})."


def loop_names(r: Facts, loops: tuple[int, ...]) -> str:
    """``loop A-B-C-D``: loops by their pairs, the first few of many, long ones by their ends."""

    def name(i: int) -> str:
        pairs = [pair for pair, _ in r.loops[i]]
        return "-".join(pairs) if len(pairs) <= 2 * NAMED else "-".join([*pairs[:4], "...", *pairs[-2:]])

    more = f" and {len(loops) - SETS} more" if len(loops) > SETS else ""
    return ("loop " if len(loops) == 1 else "loops ") + ", ".join(name(i) for i in loops[:SETS]) + more


def reasons(r: Facts) -> list[str]:
    """Why count and rank differ, in the words of the report."""
    if not r.geometry:
        return []
    return _excess(r) + _finite(r) + motion_line(r) + _margin(r) or ["Count and rank agree: no equation is redundant."]


def assumed(r: Facts) -> list[str]:
    """Second directions, where the pair type needs one, that are those taken where none is given."""
    return [
        f"{p.name} ({p.type.symbol}): its second direction is ({', '.join(f'{v:.4g}' for v in p.second)}), by default. "
        "Pass second= to change it."
        for p in r.mechanism.pairs
        if p.type.square_second and p.point is not None and p.second == second_direction(p.axis)
    ]


def _excess(r: Facts) -> list[str]:
    excess, out = r.excess, []
    if excess["structural"]:
        places = "; ".join(f"{n} in the {loop_names(r, loops)}" for n, loops in r.generic.places[:SETS])
        out.append(
            f"Structural excess {excess['structural']}: this many constraints are redundant for any dimensions ({places})."
        )
    if excess.get("dimensions") and not _shaky(r):
        out.append(
            f"Overconstrained by its dimensions, by {excess['dimensions']}: constraints are redundant throughout the "
            "motion, only for these lengths and axis directions."
        )
    elif excess.get("dimensions"):
        out.append(
            f"Its special dimensions make {excess['dimensions']} more constraints redundant than general ones would."
        )
    if excess.get("here"):
        out.append(f"Singular here, by {excess['here']}: nearby positions have a higher rank.")
    return out


def _finite(r: Facts) -> list[str]:
    """What part of the mobility is finite, where not all of it is."""
    if _shaky(r):
        return ["Shaky: the mobility is infinitesimal only; no finite motion keeps the loops closed."]
    if r.mobility and r.finite_mobility is not None and r.finite_mobility < r.mobility:
        return [
            f"Of mobility {r.mobility} here, {r.finite_mobility} is finite; the rest is instantaneous, in this position only."
        ]
    return []


def motion_line(r: Facts) -> list[str]:
    """The stroke over which a motion was followed."""
    length = f"a stroke of {r.stroke:.2g} (radians, or lengths / L)" if r.stroke else ""
    return [f"Motion verified over {length}: all loops stay closed."] if length else []


def _margin(r: Facts) -> list[str]:
    if r.dead_point and r.geometry and not _over_driven(r):
        return [
            f"Near a dead point of {weakest_drive(r)}: it moves {r.geometry.freedoms.drive:.2g} times as much as the freedom that moves "
            "most, so its effort and the reactions grow without bound."
        ]
    out = []
    if r.near_other_rank:
        gap = f", largest treated as zero {r.dropped:.1g}" if (r.dropped or 0.0) > RANKS.doubt else ""
        out.append(
            f"Near another verdict: smallest singular value kept {r.margin:.2g} of the largest{gap}. A small change of dimensions or "
            "position may change mobility and uniqueness; forces may be large."
        )
    if r.near_other_uniqueness and r.reactions:
        out.append(
            f"Near another verdict: {_doubtful_part(r.reactions)}. A small change of dimensions may change what is unique, at the "
            "same mobility and redundancy."
        )
    return out


def mobility_line(r: Facts) -> str:
    """What the mobility is made of, and how far the position is from a singular one."""
    return (
        f"Mobility {r.mobility} = {plural(r.inputs or 0, 'input freedom')} + {plural(len(r.passive), 'passive freedom')}; "
        f"finite mobility: {r.finite_mobility}. Margin to a singular position: {r.margin:.3g} (near below {r.near_below:.3g})."
    )


def kind_line(r: Facts) -> str:
    """What kind of mechanism it is, or of what kinds its loops are."""
    how = "" if r.kind.by_pairs else " in its motion, not in all of its pairs"
    if r.mechanism.planar:
        return "Planar: 3 equations a link, in the x-y plane alone; moments of parts in layers: ask m.to_spatial()."
    if r.kind.name:
        offer = "; in that plane alone: m.to_planar()" * (r.kind.name == "planar" and bool(r.redundancy))
        return f"{r.kind.name.capitalize()}{how}: {place(r.kind)}{offer}."
    names = [kind.name for kind in r.loop_kinds]
    if not any(names):
        return ""
    kinds = {(kind.name, place(kind)) for kind in r.loop_kinds}
    parts = []
    for name in dict.fromkeys(names):
        of = [i for i, other in enumerate(names) if other == name]
        places = sorted(where for other, where in kinds if other == name)
        where = f" ({'; '.join(places[:SETS])}{'; ...' if len(places) > SETS else ''})" if name else ""
        parts.append(f"{loop_names(r, tuple(of))} {'is' if len(of) == 1 else 'are'} {name or 'spatial'}{where}")
    return f"Loops of different kinds: {'; '.join(parts)}." if len(parts) > 1 or len(kinds) > 1 else f"All {parts[0]}."


def place(kind: MotionKind) -> str:
    """The plane or the center of a kind."""
    return f"{'normal of the plane' if kind.is_direction else 'center'} {vector(kind.place)}" if kind.name else ""


def doubts(r: Facts) -> list[str]:
    """What may turn out otherwise: a position near a singular one, a mobility that is infinitesimal only, directions that were taken."""
    return [*_margin(r), *_finite(r), *assumed(r)] if r.geometry else []


def count_line(r: Facts) -> str:
    """Links, pairs and loops; mobility by count and here; how many closure equations repeat others, and why."""
    many = (("link", r.links), ("pair", r.pairs), ("loop", r.loops), ("driver", r.mechanism.drives))
    line = f"{', '.join(plural(len(items), what) for what, items in many)}; mobility {r.mobility_by_count} by count"
    if r.mobility is None or r.redundancy is None:
        return f"{line}, {r.generic.mobility} for general geometry."
    line += f", {r.mobility} here" + (f" ({r.inputs} to be driven, {len(r.passive)} passive)" if r.passive else "")
    if not r.redundancy:
        return f"{line}: no constraint is redundant."
    why = {
        "structural": "for any dimensions",
        "dimensions": "for these dimensions",
        "here": "in this position only",
    }
    parts = ", ".join(f"{r.excess[key]} {words}" for key, words in why.items() if r.excess.get(key))
    verb = "is" if r.redundancy == 1 else "are"
    return f"{line}: {r.redundancy} of {r.equation_count} closure equations {verb} redundant ({parts})."


HOW_MUCH = (
    "The rest depends on fits, stiffness and temperature; a rigid-body model cannot predict preload from misalignment."
)
MORE = "Full report: report.text(full=True), mechgraph check --full."


def document(r: Facts, first: tuple[Paragraph, ...] = ()) -> Document:
    """The page, with what stands ``first`` on it; what comes last in a list is left to the whole report where there is no room."""
    parts = {title: [_sentence(line) for line in told(r)] for title, told in PARTS.items()}
    while True:
        items = [item for title, lines in parts.items() if lines for item in (title, lines)]
        blocks: list[Block] = [*first, Paragraph(verdict(r)), *_note(r), Bullets(items), Paragraph(MORE)]
        page = Document(f"Determinacy of {r.mechanism.name}", tuple(blocks))
        longest = max(parts.values(), key=len)
        # most lines of text on 80 columns
        if len(to_text(page).splitlines()) <= 25 or len(longest) < 2:
            return page
        longest.pop()


def _note(r: Facts) -> list[Paragraph]:
    return [Paragraph(r.note)] if r.note else []


def _to_do(r: Facts) -> Iterator[str]:
    """What to change, the drivers first; for a determinate mechanism nothing."""
    yield from (f"{number}: {a.text}" for number, a in enumerate(r.advice) if a.effect is None)
    if r.contradicting_drives and r.mobility and not r.suggested_drives:
        yield "the declared drivers are dependent; remove one"
    bearing = [p for p in r.passive if p.load_bearing]
    for p in bearing:
        what = "couple" if p.turns else "force"
        yield f"hold {p.name} or balance the load on it: a {what} of {p.size} moves it, and no part takes that"
    # most changes of pairs that are advised here
    yield from alternatives(r.advice)[:4]
    if r.determinate and not r.near and not bearing:
        yield "none needed: equilibrium determines every force"


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
        # most pairs named for one set of components
        some = [f"{words} of {listed(pairs, 4)}" for words, pairs, _ in patterns(known, known.is_unique)]
        some = ["every reaction"] if known.all_unique else some
        yield f"determined by equilibrium: {'; '.join(some + driven) or 'nothing'}"
        if not known.all_unique:
            yield HOW_MUCH
    yield from r.friction[:NAMED]
    yield from doubts(r)
    yield from filter(None, (kind_line(r), count_line(r)))
    yield from motion_line(r)
    if r.passive and not any(p.load_bearing for p in r.passive):
        yield f"{spins(r)} {'carries' if len(r.passive) == 1 else 'carry'} no load and move{'s' * (len(r.passive) == 1)} no other link"


def _sentence(text: str) -> str:
    return f"{text[0].upper()}{text[1:].removesuffix('.')}."


PARTS: dict[str, Callable[[Facts], Iterator[str]]] = {"Recommended changes:": _to_do, "Determinacy:": _trusted}
"""The parts of the page."""
