"""Figures over time and over a cycle: peak, mean and RMS of efforts, powers and shaking, and the work of drivers and loads.

A mean over time is an integral over time, ``rms^2 = int y^2 dt / T``, whatever the spacing of the positions: of the cubic spline through
the values, periodic over a whole cycle.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from mechgraph.algebra.se3 import Array
from mechgraph.arguments import door
from mechgraph.data import plain
from mechgraph.document import Block, Document, Heading, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError
from mechgraph.fields import vector_fault
from mechgraph.result.cycle import Cycle, cycles_of
from mechgraph.result.numbers import bracket, number, with_unit
from mechgraph.result.solution import Solution
from mechgraph.units import ENERGY, FORCE, MOMENT, POWER, TIME, unit_of

DOUBTFUL = 0.01
"""Part of an RMS value above which its error is said."""


@dataclass(frozen=True, eq=False, repr=False)
class Figures(Shown):
    """Figures of a quantity over time, ``(...)`` over the cases.

    ``peak``: the largest size, and ``at``, the position of it; ``least`` and ``greatest``; ``mean`` and ``rms`` over time; ``error``: how
    much the RMS value of every second position differs from it, an upper bound of what the spacing leaves uncertain.
    NaN where positions have no value.
    """

    name: str
    unit: str
    peak: Array
    at: Any
    least: Array
    greatest: Array
    mean: Array
    rms: Array
    error: Array

    def document(self) -> Document:
        """The figures as a table."""
        names = ("peak", "least", "greatest", "mean", "rms", "error")
        rows = [(name, " ".join(number(float(v)) for v in np.ravel(getattr(self, name)))) for name in names]
        return Document(self.name, (Table(("figure", f"value{bracket(self.unit)}"), rows, "lr"),))


@dataclass(frozen=True)
class FiguresData:
    """Figures of a quantity over time; none where positions have no value."""

    unit: str
    peak: float | None
    at: Annotated[int, "position of the peak, counted from 0"]
    least: float | None
    greatest: float | None
    mean: float | None
    rms: float | None
    error: Annotated[float | None, "what the spacing of the positions leaves uncertain of the RMS value"]


@dataclass(frozen=True)
class OverTimeData:
    """What a motion takes over time: figures of drivers and shaking, and work."""

    duration: float
    closed: Annotated[bool, "whether it is a whole cycle"]
    revolutions: Annotated[float | None, "turns of the driver that runs round; none where none does"]
    efforts: Annotated[Mapping[str, FiguresData], "by the freedoms of the drivers"]
    powers: Annotated[Mapping[str, FiguresData], "by the freedoms of the drivers"]
    shaking: Annotated[Mapping[str, FiguresData], "of force and moment on the frame, about the global origin"]
    work: Annotated[Mapping[str, float | None], "of drivers and loads over the duration"]
    kinetic_change: float | None
    balance: float | None


@dataclass(frozen=True, eq=False, repr=False)
class OverTime(Shown):
    """What a motion takes over time; see ``over_time``. Arrays ``(...)`` over the cases.

    Attributes
    ----------
    duration : the time from the first position to the last, or to the first again where the cycle is closed.
    closed : whether the last position leads back to the first, so that it is a whole cycle.
    revolutions : turns of the driver that runs round; NaN where none does.
    efforts, powers : figures of every driver, by its freedom.
    shaking : figures of force and moment on the frame, ``"Fx"`` ... ``"Mz"``, ``"|F|"``, ``"|M|"``, moments about ``about``.
    work : of every driver and of every load by its name, ``"loads[0] gravity"``: the integral of its power over the time.
    kinetic_change : the kinetic energy at the end less that at the beginning.
    balance : the sum of all work less ``kinetic_change``, relative to what the powers turn over (the integral of their sizes).
    """

    solution: Solution
    about: tuple[float, float, float]
    duration: Array
    closed: Any
    revolutions: Array
    efforts: Mapping[str, Figures]
    powers: Mapping[str, Figures]
    shaking: Mapping[str, Figures]
    work: Mapping[str, Array]
    kinetic_change: Array
    balance: Array

    @property
    def work_per_revolution(self) -> dict[str, Array]:
        """``work`` over the ``revolutions``."""
        return {name: work / self.revolutions for name, work in self.work.items()}

    def to_dict(self) -> dict[str, Any]:
        """All figures as plain data, of one row of positions.

        Raises
        ------
        DeclarationError
            for several cases.
        """
        if self.duration.shape:
            raise DeclarationError("figures as data", [f"{self.duration.size} cases: solve them one by one"])

        def data(figures: Mapping[str, Figures]) -> dict[str, FiguresData]:
            numbers = ("least", "greatest", "mean", "rms", "error")
            return {
                name: FiguresData(one.unit, float(one.peak), int(one.at), *(float(getattr(one, n)) for n in numbers))
                for name, one in figures.items()
            }

        made = OverTimeData(
            float(self.duration),
            bool(self.closed),
            float(self.revolutions),
            data(self.efforts),
            data(self.powers),
            data(self.shaking),
            {name: float(work) for name, work in self.work.items()},
            float(self.kinetic_change),
            float(self.balance),
        )
        return dict(plain(made))

    def document(self) -> Document:
        """Efforts and powers of the drivers, shaking, and the work, over the cycle; of several cases the number alone."""
        m, units = self.solution.mechanism, self.solution.mechanism.units
        if self.duration.shape:
            return Document(
                f"Over time: {m.name}", (Paragraph(f"{self.duration.size} cases; ask for the figures by name."),)
            )
        over = (
            f"over a whole cycle of {self.revolutions:.6g} revolution{'s' * (abs(float(self.revolutions)) != 1)}"
            if self.closed
            else "from the first position to the last"
        )
        time = with_unit(number(float(self.duration)), unit_of(units, TIME))
        balance = f"the work and the change of kinetic energy balance to {float(self.balance):.0e}"
        blocks: list[Block] = [Paragraph(f"{time}, {over}; {balance}.")]
        figures = {f"effort of {name}": one for name, one in self.efforts.items()}
        figures |= {f"power of {name}": one for name, one in self.powers.items()}
        figures |= {f"shaking {name}": self.shaking[name] for name in ("|F|", "|M|")}
        rows = [
            (
                name + bracket(one.unit),
                number(float(one.peak)),
                self._place(one),
                number(float(one.mean), float(one.peak)),
                _with_error(one),
            )
            for name, one in figures.items()
        ]
        blocks.append(Table(("", "peak", "at", "mean", "rms"), rows, "lrlrr"))
        turned = self.closed and np.isfinite(self.revolutions)
        work = self.work_per_revolution if turned else self.work
        unit = bracket(unit_of(units, ENERGY))
        scale = max((float(one.peak * self.duration) for one in self.powers.values()), default=0.0)
        blocks += [
            Heading("Work per revolution" if turned else "Work", 2),
            Table(("of", f"work{unit}"), [(name, number(float(value), scale)) for name, value in work.items()], "lr"),
        ]
        return Document(f"Over time: {m.name}", tuple(blocks))

    def _place(self, one: Figures) -> str:
        return self.solution.place(int(one.at)) if np.isfinite(one.peak) else ""

    def __repr__(self) -> str:
        return f"OverTime({self.solution.mechanism.name!r}, {', '.join(self.efforts)})"


def _with_error(one: Figures) -> str:
    """The RMS value, with its error where that is not small."""
    value, error = float(one.rms), float(one.error)
    return f"{number(value)} ± {error:.1g}" if error > DOUBTFUL * abs(value) else number(value)


@door
def over_time(s: Solution, about: ArrayLike = (0.0, 0.0, 0.0)) -> OverTime:
    """Peak, mean and RMS of driver efforts and powers and of the shaking force and moment, and the work, over time or a whole cycle.

    Positions need not be evenly spaced. Times are those of the motion, or follow from the rate of a driver that runs one way,
    ``t = int dq / q'``. A driver that runs round makes a whole cycle where the last position is the first again, or comes one step before
    it (its end left out), and all coordinates and rates return.

    Parameters
    ----------
    about : the point about which the shaking moment is taken, global.

    Raises
    ------
    DeclarationError
        where the solution has no forces, or its positions no times.
    """
    faults = [] if s.has_forces else ["the solution has no forces: use solve()"]
    faults += [fault] if (fault := vector_fault(about, "about")) else []
    if faults:
        raise DeclarationError(f"over time, {s.mechanism.name!r}", faults)
    row = _Rows(s, cycles_of(s))
    units = s.mechanism.units
    efforts, powers, work, spent = {}, {}, {}, np.zeros(s.batch[:-1])
    for name in s.actuated:
        k, j = s.whole.freedom(name)
        r = s[s.whole.pairs[k].name]
        couple = s.whole.pairs[k].type.efforts[j].is_couple
        effort, power = r.effort[..., j], r.effort[..., j] * r.velocity[..., j]
        efforts[name] = row.figures(f"effort of {name}", effort, unit_of(units, MOMENT if couple else FORCE))
        powers[name] = row.figures(f"power of {name}", power, unit_of(units, POWER))
        work[name] = row.integral(power)
        spent = spent + row.integral(np.abs(power))
    for name, power in _load_powers(s):
        work[name] = row.integral(power)
        spent = spent + row.integral(np.abs(power))
    p, shaking = np.asarray(about, dtype=float), s.shaking
    wrench = np.concatenate([shaking[..., :3] - np.cross(p, shaking[..., 3:]), shaking[..., 3:]], axis=-1)
    parts = {name: wrench[..., i] for i, name in enumerate(("Mx", "My", "Mz", "Fx", "Fy", "Fz"))}
    parts |= {
        f"|{letter}|": np.linalg.norm(wrench[..., part], axis=-1)
        for letter, part in (("M", slice(0, 3)), ("F", slice(3, 6)))
    }
    kinetic = s.kinetic_energy
    change = np.where(row.of("closed"), 0.0, kinetic[..., -1] - kinetic[..., 0])
    left = np.sum(list(work.values()), axis=0) - change
    return OverTime(
        s,
        (float(p[0]), float(p[1]), float(p[2])),
        row.of("duration"),
        row.of("closed").astype(bool),
        row.of("revolutions"),
        efforts,
        powers,
        {
            name: row.figures(f"shaking {name}", part, unit_of(units, MOMENT if "M" in name else FORCE))
            for name, part in parts.items()
        },
        work,
        change,
        np.divide(left, spent, out=np.zeros(np.shape(left)), where=spent != 0.0),
    )


def _load_powers(s: Solution) -> Iterator[tuple[str, Array]]:
    """Names and powers of all loads, and of what holds passive bodies where these are held against their loads."""
    for i, load in enumerate(s.mechanism.loads):
        yield f"loads[{i}] {load.kind}", s.load(i).power
    for link in s.mechanism.links:
        hold = s.link(link.name).hold
        if np.nan_to_num(hold).any():
            yield f"hold of {link.name}", (hold * s.link(link.name).twist).sum(axis=-1)


class _Rows:
    """Figures of quantities over the rows of a batch, each with its cycle."""

    def __init__(self, s: Solution, cycles: list[Cycle]) -> None:
        self.cycles, self.cases, self.count = cycles, s.batch[:-1], s.batch[-1]

    def of(self, name: str) -> Array:
        """A property of the cycles, ``(...)``."""
        return np.array([getattr(cycle, name) for cycle in self.cycles], dtype=float).reshape(self.cases)

    def integral(self, values: Array, every: int = 1) -> Array:
        """Integral over time, ``(..., T)`` -> ``(...)``."""
        rows = values.reshape(-1, self.count)
        found = [cycle.integral(row, every) for cycle, row in zip(self.cycles, rows, strict=True)]
        return np.array(found).reshape(self.cases)

    def figures(self, name: str, values: Array, unit: str) -> Figures:
        """Figures of a quantity."""
        size = np.abs(values)
        at = np.where(np.isnan(size), -1.0, size).argmax(axis=-1)
        known = np.isfinite(values).all(axis=-1)
        least, greatest = (np.where(known, values.min(axis=-1), np.nan), np.where(known, values.max(axis=-1), np.nan))
        duration = self.of("duration")
        rms, coarse = (np.sqrt(np.maximum(self.integral(values**2, every), 0.0) / duration) for every in (1, 2))
        peak = np.where(known, size.max(axis=-1), np.nan)
        return Figures(
            name, unit, peak, at, least, greatest, self.integral(values) / duration, rms, np.abs(rms - coarse)
        )
