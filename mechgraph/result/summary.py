"""The summary of a solution for people: what was solved, ranges of efforts, greatest reactions, checks, engine and work."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.document import Block, Bullets, Document, Heading, Paragraph, Table
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.result.solution import Solution
from mechgraph.units import force_hint, unit_of

OK = "ok"
"""Status of a solved position."""

NOISE = 1e-11
"""Part of the largest value of its kind below which a value is rounding noise and shown as 0."""

TIE = 1e-9
"""Relative difference below which two values share the extreme; the first position is named."""


def summary(s: Solution, not_unique: Mapping[str, Mapping[str, bool]] | None = None) -> Document:
    """Positions solved and not solved, ranges of the drivers' efforts, greatest reactions and where, checks, and the work.

    Angles of drivers are shown in degrees. Forces and moments are those of ``s[pair].force`` and ``s[pair].moment``: of the
    reaction, the moment about the origin of marker B.

    Parameters
    ----------
    not_unique : ``report.unique`` of the mechanism, to name the reactions that are not unique where the solution holds those of
        least norm. Left out, they are the NaN ones.
    """
    view = _View(s)
    blocks: list[Block] = [*view.positions(), *view.driver_table()]
    if s.has_forces and view.solved.any():
        if view.loaded:
            blocks += [*view.effort_tables(), *view.reaction_table()]
        else:
            blocks.append(
                Paragraph("All efforts and reactions are zero: no link has a mass that moves and no load acts.")
            )
        blocks += [*view.redundant(not_unique), *view.passive()]
    if view.solved.any():
        blocks += view.checks()
    hint = force_hint(s.mechanism.units)
    blocks += [view.work(), *([Paragraph(hint)] if hint and s.has_forces else [])]
    return Document(f"Solution of {s.mechanism.name}", tuple(blocks))


def driver_value(m: Mechanism, name: str, value: float) -> str:
    """``A.Rz = 30 deg``: a driver's value with its unit, degrees for a turn."""
    return f"{name} = {_shown_value(m, name, value)}"


def _shown_value(m: Mechanism, name: str, value: float) -> str:
    if m.turns(name):
        return f"{_number(float(np.rad2deg(value)))} deg"
    return _with_unit(_number(value), unit_of(m.units, (1, 0, 0)))


class _View:
    """One solution with its positions laid out flat."""

    def __init__(self, s: Solution) -> None:
        self.s = s
        self.m: Mechanism = s.mechanism
        self.status = np.asarray(s.status).reshape(-1)
        self.solved = self.status == OK
        self.drivers = s.prescribed
        self.driver_values = [self.of_freedom(name, "position") for name in self.drivers]
        self.force_unit = unit_of(self.m.units, (1, 1, -2))
        self.moment_unit = unit_of(self.m.units, (2, 1, -2))
        self.forces, self.moments = self._magnitudes() if s.has_forces else ([], [])
        self.efforts = {name: self.of_freedom(name, "effort") for name in s.actuated} if s.has_forces else {}
        self.applied = self._applied() if s.has_forces else {}
        self.extent = self._extent()
        every = (*self.forces, *self.moments, *self.efforts.values(), *self.applied.values())
        # what is not unique has no value, and may be anything
        self.loaded = _largest(every) > 0 or any(np.isnan(row[self.solved]).any() for row in every)

    def flat(self, values: Any) -> Array:
        """One value a position."""
        return np.asarray(values, dtype=float).reshape(self.status.size)

    def of_freedom(self, name: str, what: str) -> Array:
        """A quantity of one freedom over the positions."""
        k, j = self.s.whole.freedom(name)
        return self.flat(getattr(self.s[self.s.whole.pairs[k].name], what)[..., j])

    def _applied(self) -> dict[str, Array]:
        """What loads do in freedoms, of those in which they do something."""
        found = {name: self.of_freedom(name, "applied_effort") for name in self.m.freedom_names()}
        return {name: values for name, values in found.items() if _largest([values]) > 0}

    def _magnitudes(self) -> tuple[list[Array], list[Array]]:
        rows = [self.s[p.name] for p in self.m.pairs]
        return (
            [self.flat(np.linalg.norm(r.force, axis=-1)) for r in rows],
            [self.flat(np.linalg.norm(r.moment, axis=-1)) for r in rows],
        )

    def _extent(self) -> float:
        """A length of the mechanism: the largest distance of pair points from their middle; 1 where all coincide."""
        found = [self.s.link(p.b).point(p.markers[1].point).position.reshape(-1, 3) for p in self.m.pairs]
        points = np.stack(found)[:, self.solved][:, :1].reshape(-1, 3)
        return (
            float(np.linalg.norm(points - points.mean(axis=0), axis=1).max(initial=0.0)) or 1.0 if points.size else 1.0
        )

    def turns(self, name: str) -> bool:
        return self.s.whole.turns(name)

    def shown_value(self, name: str, value: float) -> str:
        """A driver's value with its unit: degrees for a turn."""
        return _shown_value(self.s.whole, name, value)

    def place(self, index: int) -> str:
        """The driver values of a position; its number where the driver values are not known."""
        values = [
            self.shown_value(n, v[index])
            for n, v in zip(self.drivers, self.driver_values, strict=True)
            if np.isfinite(v[index])
        ]
        if not values and self.s.t is not None:
            t, unit = np.asarray(self.s.t, dtype=float).reshape(-1)[index], unit_of(self.m.units, (0, 0, 1))
            return f"t = {_with_unit(_number(t), unit)}"
        return ", ".join(values) or f"position {index}"

    def effort_unit(self, name: str) -> str:
        k, j = self.s.whole.freedom(name)
        return self.moment_unit if self.s.whole.pairs[k].type.efforts[j].is_couple else self.force_unit

    # --- parts -------------------------------------------------------------------------------------------------------

    def positions(self) -> Iterator[Block]:
        """How many positions were solved, and the ranges of those that were not, by reason."""
        done, of = int(self.solved.sum()), self.status.size
        yield Paragraph(f"Solved {done} of {of} position{'s' if of != 1 else ''}.")
        items = []
        for first, last in _runs(self.status):
            if self.status[first] == OK:
                continue
            count = f"position {first}" if first == last else f"positions {first} to {last}"
            items.append(f"{count}: {self.status[first]}{self._beside(first, last)}")
        if items:
            yield Heading("Not solved", 2)
            yield Bullets(tuple(items))

    def _beside(self, first: int, last: int) -> str:
        """The solved positions on both sides of a range that is not solved."""
        near = [
            (word, i)
            for word, i in (("after", first - 1), ("before", last + 1))
            if 0 <= i < self.status.size and self.solved[i]
        ]
        text = ", ".join(f"{word} {' = '.join((', '.join(self.drivers), self.place(i)))}" for word, i in near)
        return f" ({text})" if text else ""

    def driver_table(self) -> Iterator[Block]:
        """Range of every driver over the solved positions."""
        if not self.solved.any():
            return
        rows = []
        for name, values in zip(self.drivers, self.driver_values, strict=True):
            rate = self.of_freedom(name, "velocity")
            low, high = np.nanmin(rate), np.nanmax(rate)
            unit = unit_of(self.m.units, (0, 0, -1) if self.turns(name) else (1, 0, -1))
            speed = _number(low) if np.isclose(low, high) else f"{_number(low)} to {_number(high)}"
            rows.append(
                (
                    name,
                    self.shown_value(name, np.nanmin(values)),
                    self.shown_value(name, np.nanmax(values)),
                    _with_unit(speed, unit),
                )
            )
        if rows:
            yield Table(("driver", "from", "to", "rate"), tuple(rows), align="lrrr")

    def effort_tables(self) -> Iterator[Block]:
        """Range of every driver's effort, and where; the same of what springs, dampers and given efforts do."""
        largest = _largest([*self.efforts.values(), *self.applied.values()])
        yield from self._ranges("Efforts of the drivers", "driver", self.efforts, largest)
        yield from self._ranges("Applied efforts (springs, dampers, given efforts)", "freedom", self.applied, largest)

    def _ranges(self, title: str, what: str, efforts: Mapping[str, Array], largest: float) -> Iterator[Block]:
        rows = []
        for name, effort in efforts.items():
            head = _with_unit(name, f"[{self.effort_unit(name)}]" if self.effort_unit(name) else "")
            if np.isnan(effort[self.solved]).any():
                rows.append((head, "not unique", "", "", ""))
                continue
            low, high = _first_extreme(-effort), _first_extreme(effort)
            rows.append(
                (head, _number(effort[low], largest), self.place(low), _number(effort[high], largest), self.place(high))
            )
        if rows:
            yield Heading(title, 2)
            yield Table((what, "least", "at", "greatest", "at"), tuple(rows), align="lrrrr")

    def reaction_table(self) -> Iterator[Block]:
        """Greatest force and moment of every pair's reaction, and where; of what is unique of it."""
        forces, moments = _largest(self.forces), _largest(self.moments)
        scales = (max(forces, moments / self.extent), max(moments, forces * self.extent))
        rows = []
        resting = {name for warning in self.s.warnings for name in warning.pairs}
        for k, pair in enumerate(self.m.pairs):
            cells = [f"{pair.name} *" if pair.name in resting else pair.name, pair.type.symbol, pair.a, pair.b]
            for couple, values, scale in ((False, self.forces[k], scales[0]), (True, self.moments[k], scales[1])):
                cells += self._greatest(pair, couple, values, scale)
            rows.append(tuple(cells))
        head = (
            "pair",
            "type",
            "from",
            "on",
            f"force{_bracket(self.force_unit)}",
            "at",
            f"moment{_bracket(self.moment_unit)}",
            "at",
        )
        yield Heading("Greatest reactions", 2)
        yield Table(head, tuple(rows), align="llllrrrr")
        of = f"; 'at' is the value of {', '.join(self.drivers)}" if self.drivers else ""
        held = " *: rests on an effort that no part supplies, see the passive freedoms." if resting else ""
        yield Paragraph(f"Moments are about the pair's own point on link 'on'{of}.{held}")

    def _greatest(self, pair: Pair, couple: bool, values: Array, scale: float) -> list[str]:
        mark = ""
        if np.isnan(values[self.solved]).any():
            parts = {c.name for c in pair.type.reactions or () if c.is_couple == couple}
            found = {name: self.flat(v) for name, v in self.s[pair.name].components.items() if name in parts}
            unique = {name: v for name, v in found.items() if not np.isnan(v[self.solved]).any()}
            if not unique:
                return ["not unique", ""]
            values = np.linalg.norm(list(unique.values()), axis=0)
            mark = f" ({' '.join(unique)})"
        i = _first_extreme(values)
        if values[i] <= NOISE * scale:
            return ["0" + mark, ""]
        return [_number(values[i]) + mark, self.place(i)]

    def redundant(self, unique: Mapping[str, Mapping[str, bool]] | None) -> Iterator[Block]:
        """Which reaction components are not unique."""
        named = self._nan_components()
        least_norm = not any(named.values()) and unique is not None
        if least_norm and unique is not None:
            named = {pair: [n for n, ok in row.items() if not ok] for pair, row in unique.items()}
        items = tuple(f"{pair}: {', '.join(names)}" for pair, names in named.items() if names)
        if not items:
            return
        yield Heading("Not unique", 2)
        yield Paragraph(
            "Any self-stress can be added to these components; the values shown are those of least norm, an assumption: all pairs "
            "equally stiff, links rigid, nothing strained at assembly."
            if least_norm
            else "Any self-stress can be added to these components, so they have no value (NaN). The table above shows "
            "what is unique; where components are missing, those that it contains are named in brackets."
        )
        yield Bullets(items)

    def _nan_components(self) -> dict[str, list[str]]:
        return {
            pair.name: [
                name
                for name, value in self.s[pair.name].components.items()
                if np.isnan(self.flat(value)[self.solved]).any()
            ]
            for pair in self.m.pairs
        }

    def passive(self) -> Iterator[Block]:
        """The passive freedoms: idle ones, and those that only an effort that no part supplies holds against the loads."""
        bearing = {warning.name: warning.text for warning in self.s.warnings}
        items = tuple(bearing.get(name, f"{name}: idle, no effort is needed") for name in self.s.passive_effort)
        if items:
            yield Heading("Passive freedoms", 2)
            yield Bullets(items)

    def checks(self) -> Iterator[Block]:
        """The worst of every check."""
        checks = self.s.checks
        rows = [("closure error (angle, length / L)", checks.closure)]
        if self.s.has_forces:
            rows += [("equilibrium, relative", checks.equilibrium), ("power balance, relative", checks.power)]
        yield Heading("Checks", 2)
        yield Table(
            ("check", "worst"), tuple((name, f"{np.nanmax(np.abs(value)):.0e}") for name, value in rows), align="lr"
        )

    def work(self) -> Paragraph:
        """Which engine and which force method ran, and how much they did, in one line."""
        shown = [
            f"{n} {name if n == 1 else name.replace(' ', 's ', 1) if ' ' in name else name + 's'}"
            for n, name in self.s.work.counts
        ]
        method = f", method {self.s.method}" if self.s.method else ""
        return Paragraph(f"Engine {self.s.engine}{method}: {', '.join(shown)}.")


def _runs(status: Any) -> list[tuple[int, int]]:
    """First and last index of every run of equal statuses."""
    cuts = np.flatnonzero(status[1:] != status[:-1])
    starts = [0, *(int(c) + 1 for c in cuts)]
    ends = [*(int(c) for c in cuts), len(status) - 1]
    return list(zip(starts, ends, strict=True)) if len(status) else []


def _largest(rows: Sequence[Array]) -> float:
    return max((float(np.nanmax(np.abs(row), initial=0.0)) for row in rows if np.isfinite(row).any()), default=0.0)


def _first_extreme(values: Array) -> int:
    """The first position whose value equals the maximum but for rounding."""
    best = float(np.nanmax(values))
    room = TIE * float(np.nanmax(np.abs(values)))
    return int(np.flatnonzero(values >= best - room)[0])


def _number(value: float, scale: float = 0.0) -> str:
    if abs(value) <= NOISE * scale or abs(value) < 1e-300:
        return "0"
    return f"{value:.5g}"


def _with_unit(text: str, unit: str) -> str:
    return f"{text} {unit}" if unit else text


def _bracket(unit: str) -> str:
    return f" [{unit}]" if unit else ""
