"""The summary of a solution: extremes over the positions, the record of plain data, its words for people."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Annotated, Any

import numpy as np

from mechgraph.determinacy.snapping import SnappedMechanism
from mechgraph.determinacy.uniqueness import labels_of
from mechgraph.document import LISTED, NAMED, Block, Bullets, Document, Heading, Paragraph, Table
from mechgraph.errors import counted, listed
from mechgraph.maths.se3 import Array, Index
from mechgraph.memo import dataclass
from mechgraph.model.friction import Friction, places_in, rests_on
from mechgraph.model.mechanism import Mechanism
from mechgraph.quantities import FORCE, POWER, PRESSURE, force_hint, unit_of
from mechgraph.result.contacts import LiftOff, Overlap, contacts_of, lift_offs, overlaps
from mechgraph.result.notes import friction_notes, not_solved
from mechgraph.result.trajectory import Trajectory
from mechgraph.result.values import (
    OK,
    SHOWN_AS_ZERO,
    LoadBearing,
    Mask,
    PassedCrossing,
    PositionLabels,
    bracket,
    coupling_unit,
    number,
    with_unit,
)
from mechgraph.result.views import (
    UNASKED,
    forces_of_couplings,
    losses,
    misfits_left_out,
)


class Greatest:
    """The greatest values ``best (n,)`` of some rows, and the flat places ``at (n,)`` at which they are reached first."""

    def __init__(self, count: int) -> None:
        self.best, self.at = np.full(count, -np.inf), np.zeros(count, dtype=np.intp)

    def look(self, values: Array, places: Index) -> None:
        """Take note of values ``(n, T)`` at places that follow those seen so far; NaN counts for nothing."""
        values = np.where(np.isnan(values), -np.inf, values)
        high = values.max(axis=1)
        # relative difference below which two values share the extreme; the first position is named
        room = 1e-9 * np.abs(values).max(axis=1, where=np.isfinite(values), initial=0.0)
        first = np.argmax(values >= (high - room)[:, None], axis=1)
        better = high > self.best + room
        self.best = np.where(better, high, self.best)
        self.at = np.where(better, places[first], self.at)


class RowRange:
    """Least (as greatest of what is turned round) and greatest values of some rows, and which rows are not unique somewhere."""

    def __init__(self, count: int) -> None:
        self.low, self.high, self.loose = Greatest(count), Greatest(count), np.zeros(count, dtype=bool)

    def look(self, values: Array, places: Index, loose: Mask | None = None) -> None:
        """Take note of values ``(n, T)``."""
        self.high.look(values, places)
        self.low.look(-values, places)
        if loose is not None:
            self.loose |= loose.any(axis=1)

    @property
    def size(self) -> Array:
        """Greatest size of every row."""
        return np.asarray(np.maximum(self.high.best, self.low.best))


@dataclass(frozen=True)
class Reactions:
    """Greatest ``force`` and ``moment`` of the reaction of every pair, and where they are ``loose``, not unique.

    There they are those of the components alone that are ``kept`` as unique ``(2, 6, P)``, unless values of least norm stand for all.
    ``touched (6, P)`` are the components, in the order of the pair table, that are not unique somewhere.
    """

    force: Greatest
    moment: Greatest
    loose: Mask
    kept: Mask
    touched: Mask


def multipliers(values: Trajectory) -> RowRange:
    """Ranges of the multipliers of all couplings."""
    found, loose = values.multipliers()
    out = RowRange(len(found))
    if len(found):
        out.look(found, np.arange(found.shape[1]), loose)
    return out


def acting_in_couplings(values: Trajectory) -> tuple[list[str], RowRange]:
    """Normal forces, tensions, losses and margins of the couplings along lines, names with units: their ranges."""
    facts = list(forces_of_couplings(values))
    out = RowRange(len(facts))
    if facts:
        found = np.array([np.reshape(of, -1) for _, of, _ in facts])
        solved = (values.status() == OK).reshape(-1)
        out.look(found, np.arange(found.shape[1]), np.isnan(found) & solved & (not values.least_norm))
    return [name + bracket(unit_of(values.mechanism.units, dimension)) for name, _, dimension in facts], out


def efforts(values: Trajectory) -> tuple[RowRange, RowRange]:
    """Ranges of own and of applied efforts of all freedoms."""
    own, applied = (RowRange(len(values.whole.freedom_names())) for _ in range(2))
    for places in values.blocks():
        mine, given, loose = values.efforts_at(places)
        own.look(mine, places, loose)
        applied.look(given, places)
    return own, applied


def reactions(values: Trajectory) -> Reactions:
    """The greatest reactions of all pairs."""
    P = len(values.whole.pairs)
    force, moment, loose = Greatest(P), Greatest(P), np.zeros((2, P), dtype=bool)
    for places in values.blocks():
        wrenches, open_ = values.reactions_at(places)
        moment.look(np.linalg.norm(wrenches[:3], axis=0), places)
        force.look(np.linalg.norm(wrenches[3:], axis=0), places)
        loose |= np.stack([open_[3:].any(axis=(0, 2)), open_[:3].any(axis=(0, 2))])
    kept, touched = np.zeros((2, 6, P), dtype=bool), np.zeros((6, P), dtype=bool)
    if loose.any():
        found, touched = _of_what_is_unique(values)
        if not values.least_norm:
            kept = _kept(values.whole, touched)
            for one, whole, open_ in zip(found, (force, moment), loose, strict=True):
                whole.best, whole.at = np.where(open_, one.best, whole.best), np.where(open_, one.at, whole.at)
    return Reactions(force, moment, loose, kept, touched)


def _of_what_is_unique(values: Trajectory) -> tuple[tuple[Greatest, Greatest], Mask]:
    """The greatest forces and moments of the components that are unique everywhere, and which are not.

    Where a block shows another one that is not, all is begun again without it; nearly always the first one shows them all.
    """
    P = len(values.whole.pairs)
    touched = np.zeros((6, P), dtype=bool)
    while True:
        found, kept = (Greatest(P), Greatest(P)), _kept(values.whole, touched)
        for places in values.blocks():
            components, loose = values.components_at(places)
            here = loose.any(axis=2)
            if (here & ~touched).any():
                touched |= here
                break
            for one, mine in zip(found, kept, strict=True):
                one.look(np.sqrt((np.where(mine[:, :, None], components, 0.0) ** 2).sum(axis=0)), places)
        else:
            return found, touched


def _kept(m: Mechanism, touched: Mask) -> Mask:
    """Which components are forces and which are moments, those that are ``touched`` left out."""
    kinds = _kinds(m)
    return np.stack([(kinds == kind) & ~touched for kind in (0, 1)])


def _kinds(m: Mechanism) -> Array:
    """``(6, P)``: 0 for a component that is a force, 1 for a couple, -1 where a pair has none or they mix both."""
    columns = {id(p.type): [int(c.is_couple) for c in p.type.reactions or ()] for p in m.pairs}
    out = np.full((6, len(m.pairs)), -1)
    for k, pair in enumerate(m.pairs):
        mine = columns[id(pair.type)]
        out[: len(mine), k] = mine
    return out


PositionNumber = Annotated[int, "number of the position, counted from 0 over all of them in order"]


@dataclass(frozen=True)
class At:
    """A value, and the first position at which it is reached: radians and the declared units."""

    value: float
    position: PositionNumber
    drivers: Annotated[Mapping[str, float | None], "the values of the drivers there, in radians or the unit of length"]


@dataclass(frozen=True)
class EffortRange:
    """The range of an effort over the positions; without values where it is not unique and nothing of least norm stands for it."""

    freedom: str
    unit: str
    unique: bool
    least: At | None
    greatest: At | None


@dataclass(frozen=True)
class MultiplierRange:
    """The range of the multiplier of a coupling over the positions, as that of an effort."""

    coupling: str
    unit: str
    unique: bool
    least: At | None
    greatest: At | None


@dataclass(frozen=True)
class ReactionSize:
    """The greatest force or moment of a reaction; where it is not unique as a whole that of ``parts``, or that of least norm."""

    unit: str
    unique: bool
    parts: Annotated[tuple[str, ...], "the components that the value contains, where these are not all"]
    greatest: At | None


@dataclass(frozen=True)
class ReactionData:
    """The reaction of a pair, of link ``of`` on link ``on``; the moment about the pair's own point on link ``on``."""

    pair: str
    type: str
    on: str
    of: Annotated[str, "the link that exerts it"]
    force: ReactionSize
    moment: ReactionSize
    not_unique: Annotated[tuple[str, ...], "components and efforts of the pair that are not unique somewhere"]


@dataclass(frozen=True)
class Unsolved:
    """A range of positions that were not solved, first to last, and why."""

    first: PositionNumber
    last: PositionNumber
    status: str


@dataclass(frozen=True)
class ChecksData:
    """The worst of every check over the positions; None where it was not made."""

    closure: float | None
    equilibrium: float | None
    power: float | None
    accuracy: Annotated[float | None, "estimated relative error of rates and forces"]


@dataclass(frozen=True)
class SolutionData:
    """What the summary of a solution tells, of all pairs."""

    mechanism: str
    units: Annotated[Mapping[str, str], "names of the units of length, mass and time, where they are declared"]
    positions: int
    solved: int
    not_solved: tuple[Unsolved, ...]
    drivers: Annotated[Mapping[str, tuple[float, float]], "least and greatest value, in radians or the unit of length"]
    least_norm: Annotated[bool, "values of least norm stand for what is not unique, an assumption"]
    efforts: Annotated[tuple[EffortRange, ...], "what the drives supply"]
    applied_efforts: Annotated[tuple[EffortRange, ...], "what springs, dampers and given efforts do"]
    multipliers: Annotated[
        tuple[MultiplierRange, ...], "what the couplings exert, a moment or force for a coefficient of 1"
    ]
    reactions: tuple[ReactionData, ...]
    warnings: Annotated[tuple[LoadBearing, ...], "passive freedoms that carry load"]
    lift_off: Annotated[tuple[LiftOff, ...], "positions at which contacts that are only pushed would have to pull"]
    overlap: Annotated[tuple[Overlap, ...], "positions at which the elements of contacts cut into each other"]
    crossings: Annotated[tuple[PassedCrossing, ...], "crossings of branches that the path was led over"]
    passive: Annotated[tuple[str, ...], "names of all passive freedoms"]
    checks: ChecksData
    engine: str
    method: Annotated[str | None, "how the forces were solved; none for a motion alone"]
    work: Annotated[Mapping[str, int], "how much was computed"]


def solution_data(values: Trajectory) -> SolutionData:
    """All that a summary tells."""
    places, checks = PositionLabels(values), values.checks()
    forces = values.has_forces and bool(places.solved.any())
    own, applied = efforts(values) if forces else (None, None)
    worst = [
        float(np.nanmax(np.abs(of))) if np.isfinite(of).any() else None
        for of in (checks.closure, checks.equilibrium, checks.power, checks.accuracy)
    ]
    names = values.whole.freedom_names()
    driven = [names.index(name) for name in values.actuated]
    loaded = [] if applied is None else np.flatnonzero(applied.size[: len(places.m.freedom_names())] > 0).tolist()
    return SolutionData(
        values.mechanism.name,
        dict(values.mechanism.units),
        places.status.size,
        int(places.solved.sum()),
        tuple(Unsolved(a, b, str(places.status[a])) for a, b in places.runs() if places.status[a] != OK),
        {
            name: (float(np.nanmin(of)), float(np.nanmax(of)))
            for name, of in zip(places.drivers, places.driver_values, strict=True)
            if np.isfinite(of).any()
        },
        values.least_norm,
        () if own is None else tuple(_effort(places, own, k, names[k]) for k in driven),
        () if applied is None else tuple(_effort(places, applied, k, names[k]) for k in loaded),
        _multipliers(places) if forces else (),
        _reactions(places) if forces else (),
        values.load_bearing(),
        lift_offs(values),
        overlaps(values),
        values.passed,
        tuple(values.passive_efforts()) if forces else (),
        ChecksData(*worst),
        values.engine,
        values.method,
        {name: number for number, name in values.work.counts},
    )  # fmt: skip


def _at(places: PositionLabels, found: Greatest, k: int, sign: float = 1.0) -> At | None:
    """An extreme with its place; none where there is no number."""
    if not np.isfinite(found.best[k]):
        return None
    at = int(found.at[k])
    there = {name: float(of[at]) for name, of in zip(places.drivers, places.driver_values, strict=True)}
    return At(sign * float(found.best[k]), at, there)


def _effort(places: PositionLabels, found: RowRange, k: int, name: str) -> EffortRange:
    m = places.values.whole
    pair, j = m.freedom(name)
    unit = unit_of(m.units, (2 if m.pairs[pair].type.efforts[j].is_couple else 1, 1, -2))
    return EffortRange(name, unit, *_ends(places, found, k))


def _multipliers(places: PositionLabels) -> tuple[MultiplierRange, ...]:
    found, m = multipliers(places.values), places.m
    return tuple(
        MultiplierRange(c.name, coupling_unit(m, c), *_ends(places, found, k)) for k, c in enumerate(m.couplings)
    )


def _ends(places: PositionLabels, found: RowRange, k: int) -> tuple[bool, At | None, At | None]:
    """Whether a quantity is unique, and its extremes where it has a value."""
    loose = bool(found.loose[k])
    known = not loose or places.values.least_norm
    return not loose, *((_at(places, found.low, k, -1.0), _at(places, found.high, k)) if known else (None, None))


def _reactions(places: PositionLabels) -> tuple[ReactionData, ...]:
    values, m = places.values, places.m
    found = reactions(values)
    units = [unit_of(m.units, (power, 1, -2)) for power in (1, 2)]
    out = []
    for k, pair in enumerate(m.pairs):
        sizes = []
        for i, one in enumerate((found.force, found.moment)):
            loose, names = bool(found.loose[i, k]), pair.type.component_names
            parts = tuple(names[c] for c in np.flatnonzero(found.kept[i, :, k])) if loose else ()
            known = not loose or values.least_norm or bool(parts)
            sizes.append(ReactionSize(units[i], not loose, parts, _at(places, one, k) if known else None))
        some = found.loose[:, k].any() or any(values.whole.freedom(name)[0] == k for name in values.actuated)
        unique = values.unique(k) if some else {}
        not_unique = tuple(name for name, ok in unique.items() if not places.flat(ok)[places.solved].all())
        out.append(ReactionData(pair.name, pair.type.symbol, pair.b, pair.a, sizes[0], sizes[1], not_unique))
    return tuple(out)


LEAST_NORM = "Statically indeterminate; minimum-norm values (equal pair stiffness, rigid links, no preload)."
NO_VALUE = (
    "Statically indeterminate components are NaN. The table above shows unique components; where some are missing, brackets name "
    "those that it contains."
)


def summary(values: Trajectory, asked: bool = True, more_checks: tuple[tuple[str, Any], ...] = ()) -> Document:
    """Positions solved and not solved, ranges of the drivers' efforts, greatest reactions and where, checks, and the work.

    Angles of drivers are shown in degrees. Forces and moments are those of ``s[pair].force`` and ``s[pair].moment``: of the
    reaction, the moment about the origin of marker B.

    Parameters
    ----------
    asked : whether the summary was asked for: unasked it leaves out what takes long, and says how long.
    more_checks : names of further checks, and their values over the positions.
    """
    view = _SummaryText(values)
    blocks: list[Block] = [*view.positions(), *view.driver_table()]
    if values.has_forces and view.solved.any():
        size = len(view.m.pairs) * view.status.size
        blocks += view.forces() if asked or size <= UNASKED else [Paragraph(view.left_out(size))]
        blocks += view.passive()
    blocks += view.friction_notes()
    blocks += view.crossings()
    if view.solved.any():
        blocks += view.checks(more_checks)
    hint = force_hint(view.m.units)
    blocks += [view.work(), *([Paragraph(hint)] if hint and values.has_forces else [])]
    return Document(f"Solution of {view.m.name}", tuple(blocks))


class _SummaryText(PositionLabels):
    """One solution with its positions laid out flat, and what is told of it."""

    def __init__(self, values: Trajectory) -> None:
        super().__init__(values)
        self.force_unit = unit_of(self.m.units, (1, 1, -2))
        self.moment_unit = unit_of(self.m.units, (2, 1, -2))

    @cached_property
    def ranges(self) -> tuple[RowRange, RowRange]:
        """Ranges of own and of applied efforts of all freedoms."""
        return efforts(self.values)

    @cached_property
    def reactions(self) -> Reactions:
        """The greatest reactions."""
        return reactions(self.values)

    @cached_property
    def mark(self) -> str:
        """What stands behind a value that is not unique; nothing where it has none."""
        return " ~" if self.values.least_norm else ""

    def positions(self) -> Iterator[Block]:
        """How many positions were solved, and the ranges of those that were not, by reason."""
        done, of = int(self.solved.sum()), self.status.size
        yield Paragraph(f"Solved {done} of {of} position{'s' if of != 1 else ''}.{self._meant()}")
        items = []
        for first, last in self.runs():
            if self.status[first] == OK:
                continue
            count = f"position {first}" if first == last else f"positions {first} to {last}"
            items.append(f"{count}: {self.status[first]}{self._beside(first, last)}")
        if items:
            yield Heading("Not solved", 2)
            yield Bullets(_shortened(items))
            yield from (Paragraph(f"{note.status}: {note.why}.") for note in not_solved(self.values))

    def _meant(self) -> str:
        """With what tolerance the geometry is meant."""
        m = self.m
        if not isinstance(m, SnappedMechanism):
            return ""
        meant = f" Geometry as it is meant to {m.changes.tol:g}, changed by {m.changes.largest:.1g} at most"
        return f"{meant}; closure errors are those of the geometry as declared."

    def _beside(self, first: int, last: int) -> str:
        """The solved positions on both sides of a range that is not solved."""
        near = [
            (word, i)
            for word, i in (("after", first - 1), ("before", last + 1))
            if 0 <= i < self.status.size and self.solved[i]
        ]
        text = ", ".join(f"{word} {' = '.join((', '.join(self.drivers), self.name(i)))}" for word, i in near)
        return f" ({text})" if text else ""

    def driver_table(self) -> Iterator[Block]:
        """Range of every driver over the solved positions."""
        if not self.solved.any():
            return
        rows = []
        for name, values in zip(self.drivers, self.driver_values, strict=True):
            rate = self.coordinates(name)[1]
            low, high = np.nanmin(rate), np.nanmax(rate)
            unit = unit_of(self.m.units, (0, 0, -1) if self.values.whole.turns(name) else (1, 0, -1))
            speed = number(low) if np.isclose(low, high) else f"{number(low)} to {number(high)}"
            ends = (self.coordinate(name, np.nanmin(values)), self.coordinate(name, np.nanmax(values)))
            rows.append((name, *ends, with_unit(speed, unit)))
        if rows:
            yield Table(("driver", "from", "to", "rate"), tuple(rows), align="lrrr")

    # --- forces ------------------------------------------------------------------------------------------------------

    def left_out(self, size: int) -> str:
        """What is said in place of the extremes of ``size`` reactions."""
        return (
            f"The extremes of efforts and reactions ({len(self.m.pairs):,} pairs at {self.status.size:,} positions) were not computed; "
            f"s.summary() computes them, in about {max(1, round(size / UNASKED))} s."
        )

    def forces(self) -> Iterator[Block]:
        """Efforts and reactions, or that there are none."""
        found, (own, applied) = self.reactions, self.ranges
        largest = max(
            float(np.max(v, initial=0.0)) for v in (found.force.best, found.moment.best, own.size, applied.size)
        )
        # what is not unique has no value, and may be anything
        if largest > 0 or found.loose.any() or own.loose.any():
            yield from self.effort_tables()
            yield from self.reaction_table()
            yield from self.friction()
            yield from self.contacts()
            yield from self.redundant()
        else:
            yield Paragraph("All efforts and reactions are zero: no link has a mass that moves and no load acts.")

    def effort_tables(self) -> Iterator[Block]:
        """Range of every driver's effort, and where; the same of what springs, dampers and given efforts do."""
        own, applied = self.ranges
        names = self.values.whole.freedom_names()
        driven = [names.index(name) for name in self.values.actuated]
        loaded = np.flatnonzero(applied.size[: len(self.m.freedom_names())] > 0).tolist()
        known = [k for k in driven if self.mark or not own.loose[k]]
        largest = max([float(own.size[k]) for k in known] + [float(applied.size[k]) for k in loaded], default=0.0)
        heads = [name + bracket(self.effort_unit(name)) for name in names]
        yield from self._ranges("Efforts of the drivers", "driver", own, driven, heads, largest)
        title = "Applied efforts (springs, dampers, friction, given efforts)"
        yield from self._ranges(title, "freedom", applied, loaded, heads, largest)
        plain = [k for k, c in enumerate(self.m.couplings) if not c.steps]
        heads = [c.name + bracket(coupling_unit(self.m, c)) for c in self.m.couplings]
        yield from self._ranges("Multipliers of the couplings", "coupling", multipliers(self.values), plain, heads)
        heads, acting = acting_in_couplings(self.values)
        yield from self._ranges("Gears and belts", "", acting, list(range(len(heads))), heads)

    def _ranges(
        self, title: str, what: str, found: RowRange, columns: list[int], heads: list[str], largest: float = 0.0
    ) -> Iterator[Block]:
        rows: list[tuple[str, ...]] = []
        for k in columns[:LISTED]:
            head, mark = heads[k], self.mark if found.loose[k] else ""
            if found.loose[k] and not mark:
                rows.append((head, "not unique", "", "", ""))
                continue
            low, high = -found.low.best[k], found.high.best[k]
            ends = ((low, found.low.at[k]), (high, found.high.at[k]))
            rows.append((head, *(cell for v, at in ends for cell in (number(v, largest) + mark, self.name(at)))))
        if len(columns) > LISTED:
            rows.append((f"... and {len(columns) - LISTED} more", "", "", "", ""))
        if rows:
            yield Heading(title, 2)
            yield Table((what, "least", "at", "greatest", "at"), tuple(rows), align="lrrrr")

    def effort_unit(self, name: str) -> str:
        """The unit of the effort in a freedom."""
        k, j = self.values.whole.freedom(name)
        return self.moment_unit if self.values.whole.pairs[k].type.efforts[j].is_couple else self.force_unit

    def reaction_table(self) -> Iterator[Block]:
        """Greatest force and moment of every pair's reaction, and where; of what is unique of it."""
        found, P, L = self.reactions, len(self.m.pairs), self.values.radius
        forces, moments = (float(np.max(one.best[:P], initial=0.0)) for one in (found.force, found.moment))
        scales = (max(forces, moments / L), max(moments, forces * L))
        every = np.arange(P)
        if P > LISTED:
            size = np.maximum(found.force.best[:P] / (scales[0] or 1.0), found.moment.best[:P] / (scales[1] or 1.0))
            every = np.sort(np.argsort(-size, kind="stable")[:LISTED])
        rows, marked = [], False
        resting = {name for warning in self.values.load_bearing() for name in warning.pairs}
        for k in every.tolist():
            pair = self.m.pairs[k]
            cells = [f"{pair.name} *" if pair.name in resting else pair.name, pair.type.symbol, pair.a, pair.b]
            names = pair.type.component_names
            for one, loose, kept, scale in zip(
                (found.force, found.moment), found.loose[:, k], found.kept[:, :, k], scales, strict=True
            ):
                parts = [names[c] for c in np.flatnonzero(kept)] if loose else []
                cells += self._greatest(one, k, bool(loose), parts, scale)
                marked |= bool(loose and self.mark)
            rows.append(tuple(cells))
        units = (f"force{bracket(self.force_unit)}", "at", f"moment{bracket(self.moment_unit)}", "at")
        yield Heading("Greatest reactions", 2)
        yield Table(("pair", "type", "from", "on", *units), tuple(rows), align="llllrrrr")
        if P > LISTED:
            yield Paragraph(f"Those of the other {P - LISTED:,} pairs are smaller: s['name'].force, s.to_pandas().")
        of = f"; 'at' is the value of {', '.join(self.drivers)}" if self.drivers else ""
        held = " *: depends on an artificial holding effort, see the passive freedoms." if resting else ""
        least = " ~: some component of it is not unique, and taken to be that of least norm." if marked else ""
        yield Paragraph(f"Moments are about the pair's own point on link 'on'{of}.{held}{least}")

    def _greatest(self, found: Greatest, k: int, loose: bool, kept: list[str], scale: float) -> list[str]:
        """Cells of one reaction: its value, of the components ``kept`` where it is not unique as a whole, and the place."""
        if loose and not self.mark and not kept:
            return ["not unique", ""]
        mark = (self.mark or f" ({' '.join(kept)})") if loose else ""
        if found.best[k] <= SHOWN_AS_ZERO * scale:
            return ["0" + mark, ""]
        return [number(found.best[k]) + mark, self.name(int(found.at[k]))]

    def friction(self) -> Iterator[Block]:
        """What friction costs in every pair, how much of the drives' power it leaves, and between which efforts it holds at rest."""
        lost = {name: self.flat(power) for name, power in losses(self.values).items()}
        if not lost:
            return
        total, brought = np.sum([*lost.values()], axis=0), np.zeros(self.status.size)
        held: list[tuple[str, ...]] = []
        for k, j in map(self.values.whole.freedom, self.values.actuated):
            ends = self.values.effort_range(k)[..., j, :].reshape(-1, 2)
            brought += self.flat((self.values.efforts(k)[0] * self.values.coordinates(k, 1))[..., j])
            name = self.values.whole.pairs[k].freedom_names[j]
            held += [
                (name + bracket(self.effort_unit(name)), self.name(int(i)), *map(number, ends[i]))
                for i in np.flatnonzero(ends[:, 0] < ends[:, 1])
            ]
        if total.any():
            rows = []
            for name, power in {**lost, "all": total}.items():
                normal = self.values.at_places("normals", name)
                at = int(np.nanargmax(power))
                largest = number(np.nanmax(normal)) if np.isfinite(normal).any() else ""
                rows.append((name, largest, number(power[at]), self.name(at), number(np.nanmean(power))))
            force, power_unit = bracket(self.force_unit), bracket(unit_of(self.m.units, POWER))
            yield Heading("Friction", 2)
            heads = (f"greatest normal force{force}", f"greatest power lost{power_unit}", "at", "mean")
            yield Table(("pair", *heads), (*rows[:LISTED], *rows[LISTED:][-1:]), align="lrrrr")
            yield from self._laws_of_friction()
        if (brought > 0).any():
            left = 1.0 - total[brought > 0] / brought[brought > 0]
            parts = dict.fromkeys(map(number, (np.nanmin(left), np.nanmax(left))))
            yield Paragraph(f"Of the power that the drives bring friction leaves {' to '.join(parts)}.")
        if held:
            yield Heading("Efforts between which friction holds at rest", 2)
            yield Table(("driver", "at", "from", "to"), tuple(held[:LISTED]), align="lrrr")

    def _laws_of_friction(self) -> Iterator[Block]:
        """Which couples journals and balls have, and which components count as zero though they are not unique."""
        m, dry = self.values.whole, [load for load in self.values.loads if isinstance(load, Friction)]
        dry = [load for load in dry if load.of in m.pair_index]
        ways = {x.of: {(p.way, p.turn is None) for p in places_in(x, m.pair(x.of).type)} for x in dry}
        turning = [x for x in dry if ways[x.of] & {("ball", True), ("axis", False)}]
        laws = {"circle": "by the friction circle, to which the whole reaction is tangent", "total": "mu radius |F|"}
        for law, words in laws.items():
            if of := [x.of for x in turning if x.model == law]:
                yield Paragraph(f"Couples {words}: {listed(of, NAMED)}.")
        found = ((x.of, set(rests_on(m, x)) & set(self._not_unique(m.pair_index[x.of]))) for x in dry)
        loose = [f"{name} ({', '.join(sorted(parts))})" for name, parts in found if parts]
        if loose and not self.values.least_norm and not self.values.split_by_stiffness:
            why = "Components that are not unique, and to which loads add nothing, count as zero: no locked-in force, the least friction"
            yield Paragraph(f"{why}: {listed(loose, NAMED)}.")

    def contacts(self) -> Iterator[Block]:
        """Range of the normal force of every contact, its greatest sliding speed and pressure; where it would have to pull."""
        found = list(contacts_of(self.values).items())
        rows = []
        for name, contact in found[:LISTED]:
            force, slides = self.flat(contact.normal_force), self.flat(np.linalg.norm(contact.sliding, axis=-1))
            if not np.isfinite(force).any():
                rows.append((name, "not unique", "", "", "", number(np.nanmax(slides)), ""))
                continue
            low, high, size = int(np.nanargmin(force)), int(np.nanargmax(force)), float(np.nanmax(np.abs(force)))
            ends = (number(force[low], size), self.name(low), number(force[high], size), self.name(high))
            pressure = contact.hertz.pressure if self.m.pair(name).hertz is not None else np.array(np.nan)
            greatest = number(np.nanmax(pressure)) if np.isfinite(pressure).any() else ""
            rows.append((name, *ends, number(np.nanmax(slides)), greatest))
        if not rows:
            return
        units = [bracket(unit_of(self.m.units, of)) for of in (FORCE, (1, 0, -1), PRESSURE)]
        head = (
            "contact",
            f"least normal force{units[0]}",
            "at",
            "greatest",
            "at",
            f"sliding{units[1]}",
            f"pressure{units[2]}",
        )
        width = len(head) if any(row[-1] for row in rows) else len(head) - 1
        yield Heading("Contacts", 2)
        yield Table(head[:width], tuple(row[:width] for row in rows), align="lrrrrrr"[:width])
        if len(found) > LISTED:
            yield Paragraph(f"And {len(found) - LISTED} more: s.contacts.")
        items = [found.text for found in (*lift_offs(self.values), *overlaps(self.values))]
        if items:
            yield Bullets(_shortened(items))

    def redundant(self) -> Iterator[Block]:
        """Which reaction components and efforts are not unique."""
        loose = np.flatnonzero(self.reactions.loose[:, : len(self.m.pairs)].any(axis=0))
        columns = [self.values.whole.freedom(name)[0] for name in self.values.actuated]
        loose = np.union1d(
            loose, [k for k in columns if k < len(self.m.pairs) and self._loose_efforts(k).any()]
        ).astype(int)
        items = []
        for k in loose[:LISTED].tolist():
            parts = self._not_unique(k)
            if parts:
                items.append(f"{self.m.pairs[k].name}: {', '.join(parts)}")
        if items:
            yield Heading("Not unique", 2)
            yield Paragraph(LEAST_NORM if self.values.least_norm else NO_VALUE)
            yield Bullets(_shortened(items, len(loose)))
            yield from (Paragraph(f"Note: {warning}.") for warning in misfits_left_out(self.values))

    def _not_unique(self, k: int) -> list[str]:
        """Names of the components and efforts of a pair that are not unique somewhere."""
        pair = self.values.whole.pairs[k]
        driven = np.flatnonzero([name in self.values.actuated for name in pair.freedom_names])
        loose = [*self.reactions.touched[: pair.type.held, k], *self._loose_efforts(k)[driven]]
        return [name for (_, name), open_ in zip(labels_of(pair, driven), loose, strict=True) if open_]

    def _loose_efforts(self, k: int) -> Mask:
        """Which efforts of drives in the freedoms of a pair are not unique somewhere."""
        first = sum(p.type.f for p in self.values.whole.pairs[:k])
        return self.ranges[0].loose[first : first + self.values.whole.pairs[k].type.f]

    def passive(self) -> Iterator[Block]:
        """The passive freedoms: idle ones, and those that only an effort that no part supplies holds against the loads."""
        bearing = {warning.name: warning.text for warning in self.values.load_bearing()}
        names = list(self.values.passive_efforts())
        items = [bearing.get(name, f"{name}: idle, no effort is needed") for name in names]
        if items:
            yield Heading("Passive freedoms", 2)
            yield Bullets(_shortened(items))

    def friction_notes(self) -> Iterator[Block]:
        """What friction leaves out."""
        if notes := _shortened([str(note) for note in friction_notes(self.values)]):
            yield Heading("Remarks on friction", 2)
            yield Bullets(notes)

    def crossings(self) -> Iterator[Block]:
        """The crossings of branches that the path was led over."""
        if found := self.values.passed:
            yield Heading("Crossings passed", 2)
            yield Bullets(_shortened([*map(str, found)]))

    # --- checks and work -----------------------------------------------------------------------------------------------

    def checks(self, more: tuple[tuple[str, Any], ...]) -> Iterator[Block]:
        """The worst of every check."""
        checks = self.values.checks()
        rows = [("closure error (angle, length / L)", checks.closure)]
        if self.values.has_forces:
            rows += [("equilibrium, relative", checks.equilibrium), ("power balance, relative", checks.power)]
        if np.isfinite(checks.accuracy).any():  # of a motion in time it is not estimated
            rows.append(("accuracy of rates and forces, estimated", checks.accuracy))
        worst = tuple((name, f"{np.nanmax(np.abs(value)):.0e}") for name, value in (*rows, *more))
        yield Heading("Checks", 2)
        yield Table(("check", "worst"), worst, align="lr")

    def work(self) -> Paragraph:
        """Which engine and which force method ran, and how much they did, in one line."""
        method = f", method {self.values.method}" if self.values.method else ""
        counts = self.values.work.counts
        grouped = ", group by group" if any(of == "group" for _, of in counts) else ""
        return Paragraph(f"Engine {self.values.engine}{grouped}{method}: {', '.join(counted(*one) for one in counts)}.")


def _shortened(items: list[str], count: int | None = None) -> tuple[str, ...]:
    """The first items of a list, and how many more there are."""
    more = (len(items) if count is None else count) - LISTED
    return (*items[:LISTED], *([f"... and {more} more"] if more > 0 else []))
