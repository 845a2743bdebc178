"""The determinacy report in sentences: the verdict and the reasons. Pure functions of the facts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mechgraph.closure.indexing import Index
from mechgraph.model.pair import second_direction
from mechgraph.numerics.tolerances import RANKS
from mechgraph.report.facts import Facts
from mechgraph.structure.uniqueness import Uniqueness

NAMED = 8
"""Most names that a sentence lists."""
DROPPED = 1e-9
"""Part of the margin above which a dropped singular value is reported rather than the margin."""
SETS = 3
"""Most sets of components that the verdict names."""


def plural(count: int, one: str, many: str = "") -> str:
    """``1 driver``, ``3 drivers``."""
    return f"{count} {one if count == 1 else many or one + 's'}"


def listed(names: Sequence[str], most: int = NAMED, count: int | None = None) -> str:
    """Names in a row, the first few of many (of ``count``, where only those are given)."""
    more = (len(names) if count is None else count) - most
    return ", ".join(names[:most]) + (f" and {more} more" if more > 0 else "")


def verdict(r: Facts) -> str:
    """The verdict in one sentence, and a second one where a small change of the dimensions may change the verdict."""
    if r.mobility is None:
        return _of_topology(r)
    return _of_position(r) + _near(r)


def _near(r: Facts) -> str:
    if not r.near or r.margin is None or r.dropped is None or _over_driven(r):
        return ""
    if r.dead_point:
        return f" Near a dead point: {weakest_drive(r)} hardly moves when the mechanism does."
    if r.dropped > r.margin * DROPPED:
        return f" Near another verdict: a singular value of {r.dropped:.2g} of the largest was taken for zero."
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
    g, drives = r.geometry, [r.mechanism.full_name(d.freedom) for d in r.mechanism.drives]
    if g is None or len(drives) == 1:
        return f"the driver {drives[0]}" if drives else "no driver"
    size = np.sqrt((g.freedoms.null[g.driven] ** 2).sum(axis=1))
    weak = [name for name, mine in zip(drives, size, strict=True) if mine < 2 * g.freedoms.drive * size.max()]
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
            return f"Badly driven: mobility {r.mobility}, but {weakest_drive(r)} cannot move it here ({dead})."
        return (
            f"Over-driven: mobility {r.mobility}, {plural(drivers, 'driver')} that cannot all be moved independently."
        )
    if r.undriven:
        return _left_free(r)
    if not r.mobility and drivers:
        return _driven_structure(r)
    if r.reactions is None or r.reactions.all_unique:
        more = plural(len(r.passive), "unknown")
        held = f" ({plural(len(r.passive), 'passive freedom')} held: {more} more)" if r.passive else ""
        state = "Determinate" if r.mobility else "Determinate structure"
        return f"{_bearing(r)}{state}: {_counts(r)}; every reaction is unique{held}."
    return f"{_bearing(r)}{_state(r)}, {_not_unique(r, r.reactions)}{_efforts(r, r.reactions)}."


def _bearing(r: Facts) -> str:
    """What holds passive freedoms that carry load, before the rest of the verdict."""
    bearing = [f"{p.name} by {p.size}" for p in r.passive if p.load_bearing]
    if not bearing:
        return ""
    return f"Load-bearing passive freedom, on which reactions rest: no part holds {listed(bearing, SETS)}. With that held: "


def _left_free(r: Facts) -> str:
    """A freedom is left free; at a change point that may be one of the position alone."""
    drivers, verb = plural(len(r.mechanism.drives), "driver"), "is" if len(r.undriven) == 1 else "are"
    free = f"{plural(len(r.undriven), 'freedom')} {verb} neither driven nor passive"
    if not r.change_point:
        shaky = " The mobility is infinitesimal only: a shaky structure." if _shaky(r) else ""
        return f"Under-driven: mobility {r.mobility}, {drivers}; {free}.{shaky}"
    state = "under-driven at" if r.suggested_drives else "at"
    return f"Finite mobility {r.finite_mobility}, {drivers}, {state} a change point: mobility {r.mobility} here; {free} here."


def _driven_structure(r: Facts) -> str:
    """A structure with drivers on it."""
    one = len(r.mechanism.drives) == 1
    who = f"{weakest_drive(r)} only strains it" if one else "its drivers only strain it"
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
        return f"Shaky structure: its mobility {r.mobility} is only infinitesimal"
    return f"Moves with mobility {r.finite_mobility}"


def _not_unique(r: Facts, known: Uniqueness) -> str:
    """Which components are not unique, and in how many groups of self-stresses."""
    m, sets = r.mechanism, _patterns(known)
    total = sum(len(names) * len(pairs) for names, pairs in sets)
    shown = [
        f"{_joined(names)} of {listed([m.pairs[k].name for k in pairs[:NAMED]], NAMED, len(pairs))}"
        for names, pairs in sets[:SETS]
    ]
    if len(sets) > SETS:
        shown.append(f"others of {plural(sum(len(p) for _, p in sets[SETS:]), 'further pair')}")
    loose = [c.name for c, ok in zip(m.couplings, known.coupling_is_unique.tolist(), strict=True) if not ok]
    who = "effort of the coupling {} is" if len(loose) == 1 else "efforts of the couplings {} are"
    tied = f"the {who.format(listed(loose, NAMED))} not unique"
    if not total:
        return f"but {tied} (redundancy {r.redundancy})"
    more = f"; {tied}" if loose else ""
    form = "form one self-stress group" if known.groups == 1 else f"form {plural(known.groups, 'self-stress group')}"
    components = "reaction component is" if total == 1 else "reaction components are"
    return f"but {total} {components} not unique: {'; '.join(shown)} {form}{more} (redundancy {r.redundancy})"


def _patterns(known: Uniqueness) -> list[tuple[list[str], Index]]:
    """Names of reaction components that are not unique, and the pairs of which they are, in order of declaration."""
    components, loose = known.components, ~known.is_unique
    pairs = components.system.m.pairs
    by_names: dict[tuple[str, ...], list[Index]] = {}
    for g in components.system.groups:
        names = pairs[int(g.pairs[0])].type.component_names
        mine = loose[components.first[g.pairs][:, None] + np.arange(len(names))]
        code = mine @ (1 << np.arange(len(names)))
        for value in np.unique(code[code > 0]):
            which = tuple(n for i, n in enumerate(names) if value >> i & 1)
            by_names.setdefault(which, []).append(g.pairs[code == value])
    out = [(list(which), np.sort(np.concatenate(some))) for which, some in by_names.items()]
    return sorted(out, key=lambda item: int(item[1][0]))


def _joined(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _efforts(r: Facts, known: Uniqueness) -> str:
    if not r.mechanism.drives:
        return ""
    unique = bool(known.is_unique[known.components.efforts].all())
    if len(r.mechanism.drives) == 1:
        return f"; the driver effort is {'' if unique else 'not '}unique"
    return f"; {'all driver efforts are unique' if unique else 'driver efforts are not all unique'}"


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
    return f"{count}: determinate for general geometry (mobility {generic.mobility})."


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
    return _excess(r) + _finite(r) + _margin(r) or ["Count and rank agree: no equation is redundant."]


def assumed(r: Facts) -> list[str]:
    """Second directions that were left out where the pair type needs one."""
    return [
        f"{p.name} ({p.type.symbol}): no second direction was given; x = ({', '.join(f'{v:.4g}' for v in p.second)}) was taken. Give "
        "second=... if the marker has another direction."
        for p in r.mechanism.pairs
        if p.type.square_second and p.point is not None and p.second == second_direction(p.axis)
    ]


def _excess(r: Facts) -> list[str]:
    excess, out = r.excess, []
    if excess["structural"]:
        places = "; ".join(f"{n} in the {loop_names(r, loops)}" for n, loops in r.generic.places[:SETS])
        out.append(
            f"Structural excess {excess['structural']}: this many constraints are redundant whatever the dimensions ({places})."
        )
    if excess.get("dimensions") and not _shaky(r):
        out.append(
            f"Overconstrained by its dimensions, by {excess['dimensions']}: special lengths or directions of axes make constraints "
            "agree all along the motion; with other dimensions they would not."
        )
    elif excess.get("dimensions"):
        out.append(
            f"Its special dimensions make {excess['dimensions']} more constraints redundant than general ones would."
        )
    if excess.get("here"):
        out.append(f"Singular here, by {excess['here']}: nearby positions have a higher rank.")
    return out


def _finite(r: Facts) -> list[str]:
    out = []
    if _shaky(r):
        out.append("Shaky: the mobility is infinitesimal only; the loops stay closed over no finite stroke.")
    elif r.mobility and r.finite_mobility is not None and r.finite_mobility < r.mobility:
        out.append(f"Of mobility {r.mobility} here, {r.finite_mobility} is finite; the rest is instantaneous.")
    if r.stroke:
        length = f"{r.stroke:.2g} (radians, or lengths / L)"
        out.append(f"Motion checked: followed over a stroke of {length} with the loops closed.")
    return out


def _margin(r: Facts) -> list[str]:
    if r.dead_point and r.geometry and not _over_driven(r):
        return [
            f"Near a dead point of {weakest_drive(r)}: it moves {r.geometry.freedoms.drive:.2g} times as much as the freedom that moves "
            "most, so its effort and the reactions grow without bound."
        ]
    out = []
    if r.near_other_rank:
        gap = f", largest taken for zero {r.dropped:.1g}" if (r.dropped or 0.0) > RANKS.doubt else ""
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
