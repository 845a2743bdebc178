"""The summary of a solution for people: what was solved, ranges of efforts, greatest reactions, checks, engine and work."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from mechgraph.document import Block, Bullets, Document, Heading, Paragraph, Table
from mechgraph.errors import counted
from mechgraph.result.contacts import contacts_of, lift_offs, overlaps
from mechgraph.result.extremes import Greatest, Range, Reactions, efforts, multipliers, reactions
from mechgraph.result.numbers import SHOWN_AS_ZERO, bracket, number, with_unit
from mechgraph.result.places import OK, Places, coupling_unit
from mechgraph.result.values import Mask, Values
from mechgraph.structure.components import labels_of
from mechgraph.structure.snapping import SnappedMechanism
from mechgraph.units import FORCE, PRESSURE, force_hint, unit_of

LISTED = 20
"""Most rows of one table."""
UNASKED = 1_000_000
"""Reactions (pairs times positions) up to which the extremes are found without being asked for."""
RATE = 1e6
"""Reactions that are looked through in a second, about."""

LEAST_NORM = (
    "Any self-stress can be added to these components; the values shown are those of least norm, an assumption: all pairs equally "
    "stiff, links rigid, nothing strained at assembly."
)
NO_VALUE = (
    "Any self-stress can be added to these components, so they have no value (NaN). The table above shows what is unique; where "
    "components are missing, those that it contains are named in brackets."
)


def summary(values: Values, asked: bool = True, more_checks: tuple[tuple[str, Any], ...] = ()) -> Document:
    """Positions solved and not solved, ranges of the drivers' efforts, greatest reactions and where, checks, and the work.

    Angles of drivers are shown in degrees. Forces and moments are those of ``s[pair].force`` and ``s[pair].moment``: of the
    reaction, the moment about the origin of marker B.

    Parameters
    ----------
    asked : whether the summary was asked for: unasked it leaves out what takes long, and says how long.
    more_checks : names of further checks, and their values over the positions.
    """
    view = _View(values)
    blocks: list[Block] = [*view.positions(), *view.driver_table()]
    if values.has_forces and view.solved.any():
        size = len(view.m.pairs) * view.status.size
        blocks += view.forces() if asked or size <= UNASKED else [Paragraph(view.left_out(size))]
        blocks += view.passive()
    blocks += view.crossings()
    if view.solved.any():
        blocks += view.checks(more_checks)
    hint = force_hint(view.m.units)
    blocks += [view.work(), *([Paragraph(hint)] if hint and values.has_forces else [])]
    return Document(f"Solution of {view.m.name}", tuple(blocks))


class _View(Places):
    """One solution with its positions laid out flat, and what is told of it."""

    def __init__(self, values: Values) -> None:
        super().__init__(values)
        self.force_unit = unit_of(self.m.units, (1, 1, -2))
        self.moment_unit = unit_of(self.m.units, (2, 1, -2))

    @cached_property
    def ranges(self) -> tuple[Range, Range]:
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
            f"The extremes of efforts and reactions ({len(self.m.pairs):,} pairs at {self.status.size:,} positions) were not looked for: "
            f"s.summary() finds them, in about {max(1, round(size / RATE))} s."
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
        title = "Applied efforts (springs, dampers, given efforts)"
        yield from self._ranges(title, "freedom", applied, loaded, heads, largest)
        if self.m.couplings:
            heads = [c.name + bracket(coupling_unit(self.m, c)) for c in self.m.couplings]
            every = list(range(len(heads)))
            yield from self._ranges("Multipliers of the couplings", "coupling", multipliers(self.values), every, heads)

    def _ranges(
        self, title: str, what: str, found: Range, columns: list[int], heads: list[str], largest: float = 0.0
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
        held = " *: rests on an effort that no part supplies, see the passive freedoms." if resting else ""
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

    def _not_unique(self, k: int) -> list[str]:
        """Names of the components and efforts of a pair that are not unique somewhere."""
        pair = self.values.whole.pairs[k]
        driven = np.flatnonzero([name in self.values.actuated for name in pair.freedom_names])
        loose = [*self.reactions.touched[: 6 - pair.type.f, k], *self._loose_efforts(k)[driven]]
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

    def crossings(self) -> Iterator[Block]:
        """The crossings of branches that the path was led over."""
        if found := self.values.crossings():
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
