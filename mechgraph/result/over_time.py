"""Figures over time and over a cycle: peak, mean and RMS of efforts, powers and shaking, and the work of drivers and loads.

Figures over time and over a cycle: peak, mean and RMS of efforts, powers and shaking, and the work of drivers and loads.
A mean over time is an integral over time, ``rms^2 = int y^2 dt / T``, whatever the spacing of the positions: of the cubic spline through
the values, periodic over a whole cycle.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mechgraph.document import Block, Document, Heading, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError, MechgraphWarning
from mechgraph.fields import vector_fault
from mechgraph.files import read_off
from mechgraph.maths.se3 import Array
from mechgraph.memo import dataclass
from mechgraph.model.pair import Pair
from mechgraph.pairs.factors import WRENCHES
from mechgraph.pairs.journal import ACROSS, TURN, Journal, film_faults
from mechgraph.quantities import ENERGY, FORCE, MOMENT, POWER, TIME, door, unit_of, wrong
from mechgraph.result.film import FilmResult, Loaded
from mechgraph.result.solution import Solution
from mechgraph.result.values import OK, bracket, number, with_unit
from mechgraph.result.views import forces_of_couplings

FEWEST = 8
"""Positions of which the cycle of a film must have at least so many: its load is a spline through them."""
NOISE = 1e-10
"""Part of the largest coordinate or rate of a mechanism (lengths over its own) that counts as rounding."""
SAME_TIME = 1e-6
"""Part of the duration by which drivers may disagree about the time of a position."""


@dataclass(frozen=True)
class Cycle:
    """Times ``t (T,)`` of a row of positions; ``gap``: the time from the last to the first again where these make a cycle whose end is left
    out; ``closed``: whether it is a whole cycle; ``revolutions`` of the driver that runs round, NaN where none does.
    """

    t: Array
    gap: float
    closed: bool
    revolutions: float

    @property
    def duration(self) -> float:
        """Time from the first position to the end."""
        return float(self.t[-1] - self.t[0] + self.gap)

    def integral(self, y: Array, every: int = 1) -> Array:
        """``int y dt`` of values ``(..., T)`` over the duration, by a cubic spline through every, or every second, position; NaN for what
        has no value somewhere.
        """
        t = np.append(self.t, self.t[-1] + self.gap) if self.gap else self.t
        y = np.concatenate([y, y[..., :1]], axis=-1) if self.gap else np.array(y)
        if self.closed:
            y[..., -1] = y[..., 0]
        places = np.unique(np.append(np.arange(0, len(t), every), len(t) - 1))
        known = np.isfinite(y).all(axis=-1)
        out = np.full(y.shape[:-1], np.nan)
        if known.any():
            ends: Literal["periodic", "not-a-knot"] = "periodic" if self.closed and len(places) > 3 else "not-a-knot"
            spline = scipy.interpolate.CubicSpline(t[places], y[known][:, places], axis=-1, bc_type=ends)
            out[known] = spline.integrate(t[0], t[-1])
        return out


def cycles_of(s: Solution) -> list[Cycle]:
    """The cycle of every row of positions along the last axis of the batch.

    Raises
    ------
    DeclarationError
        where the positions have no times, and no driver whose rate tells them.
    """
    return [_cycle(s, row) for row in _CycleRows(s)]


# --- rows of positions -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Row:
    """One row: times where they are given, and of every single freedom its name, coordinates and rates ``(T,)``."""

    t: Array | None
    freedoms: dict[str, tuple[Array, Array]]


class _CycleRows:
    """The rows of a solution."""

    def __init__(self, s: Solution) -> None:
        if not s.batch or s.batch[-1] < 2:
            raise DeclarationError(
                f"over time, {s.mechanism.name!r}", ["one position has no duration: solve at several"]
            )
        self.s, self.shape = s, (-1, s.batch[-1])

    def __iter__(self) -> Iterator[_Row]:
        s, freedoms = self.s, {}
        for pair in s.whole.pairs:
            r = s[pair.name]
            for j, (name, single) in enumerate(zip(pair.freedom_names, pair.type.drivable, strict=True)):
                if single:
                    freedoms[name] = tuple(v[..., j].reshape(self.shape) for v in (r.position, r.velocity))
        t = None if s.t is None else np.broadcast_to(np.asarray(s.t, dtype=float), s.batch).reshape(self.shape)
        for i in range(len(np.empty(s.batch).reshape(self.shape))):
            yield _Row(None if t is None else t[i], {name: (q[i], v[i]) for name, (q, v) in freedoms.items()})


def _cycle(s: Solution, row: _Row) -> Cycle:
    t = _times(s, row)
    lead = next((name for name in s.prescribed if s.whole.turns(name) and _runs(*row.freedoms[name])), None)
    if lead is None:
        return Cycle(t, 0.0, False, np.nan)
    q, v = row.freedoms[lead]
    turned = abs(float(q[-1] - q[0])) / (2 * np.pi)
    left = np.ceil(turned - SAME_TIME) - turned
    step = np.abs(np.diff(q)).max() / (2 * np.pi)
    if turned < SAME_TIME or left > step * (1 + SAME_TIME):
        return Cycle(t, 0.0, False, turned)
    ended = left < SAME_TIME
    unit = {name: 1.0 if s.whole.turns(name) else s._values.radius for name in row.freedoms}
    largest = np.max(
        [[np.abs(values).max() / unit[name] for values in both] for name, both in row.freedoms.items()], axis=0
    )
    back = all(
        _returned(values, name, s, ended, noise=NOISE * unit[name] * size)
        for name, both in row.freedoms.items()
        for values, size in zip(both, largest, strict=True)
    )
    if not back:
        return Cycle(t, 0.0, False, turned)
    gap = 0.0 if ended else 2 * np.pi * left / float(abs(v[0] + v[-1]) / 2)
    return Cycle(t, gap, True, turned + (0.0 if ended else left))


def _runs(q: Array, v: Array) -> bool:
    """Whether a driver goes one way without a stop."""
    way = np.sign(q[-1] - q[0])
    return bool(way and (np.diff(q) * way > 0).all() and (v * way > 0).all())


def _returned(values: Array, name: str, s: Solution, ended: bool, noise: float) -> bool:
    """Whether the last value of a coordinate or rate leads back to the first, up to whole turns and rounds of closed curves; what is less
    than ``noise`` does.
    """
    gap = float(values[-1] - values[0])
    period = s.whole.period(name)
    if np.isfinite(period):
        gap -= period * round(gap / period)
    size = float(np.ptp(values)) + float(np.abs(values).max())
    # so many of its largest steps may part the last value of a coordinate from the first where the end of a cycle is left out
    # part of the range of a coordinate (at least 1 rad for a turn) within which it is back where it was
    returned = 1e-6
    return abs(gap) <= noise + (
        returned * size if ended else 2.0 * float(np.abs(np.diff(values)).max()) + returned * size
    )


def _times(s: Solution, row: _Row) -> Array:
    """Times ``(T,)`` of the positions: those given, else those that the rates of the drivers make of their coordinates."""
    subject = f"over time, {s.mechanism.name!r}"
    if row.t is not None:
        if not (np.diff(row.t) > 0).all():
            raise DeclarationError(subject, ["the times of the positions do not rise"])
        return row.t
    found = {
        name: _time_of(*row.freedoms[name])
        for name in s.prescribed
        if name in row.freedoms and _runs(*row.freedoms[name])
    }
    if not found:
        raise DeclarationError(
            subject,
            [
                "the positions have no times. Pass t=, or velocity= for a driver that never reverses; all positions must be solved"
            ],
        )
    for (one, t), (other, u) in pairwise(found.items()):
        if np.abs(t - u).max() > SAME_TIME * t[-1]:
            raise DeclarationError(
                subject, [f"{one} and {other} disagree about the time between positions; give motions with t="]
            )
    return next(iter(found.values()))


def _time_of(q: Array, v: Array) -> Array:
    """``t = int dq / q'`` from the first position on."""
    if np.ptp(v) == 0.0:
        return np.asarray((q - q[0]) / v[0])
    slowness = scipy.interpolate.CubicSpline(q * np.sign(q[-1] - q[0]), 1.0 / np.abs(v))
    return np.asarray(slowness.antiderivative()(slowness.x))


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
    couplings: Annotated[Mapping[str, FiguresData], "of forces, losses and margins of gears and belts"]
    work: Annotated[Mapping[str, float | None], "of drivers and loads over the duration"]
    kinetic_change: float | None
    balance: float | None


@dataclass(frozen=True, eq=False, repr=False)
class OverTime(Shown):
    """What a motion takes over time; arrays ``(...)`` over the cases. Returned by ``over_time``.

    Attributes
    ----------
    duration : array
        From the first position to the last, or to the first again if the cycle is closed.
    closed : array of bool
        Whether it is a whole cycle.
    revolutions : array
        Turns of the driver that makes full turns; NaN if none does.
    efforts, powers : mapping
        Figures of every driver: ``peak``, ``mean``, ``rms``.
    shaking : mapping
        Figures of force and moment on the frame, ``"Fx"`` to ``"Mz"``, ``"|F|"``, ``"|M|"``.
    couplings : mapping
        Figures of what acts in gears and belts, ``"g normal force"``, ``"belt tension p1-p2"``, ``"g loss"``.
    work : mapping
        Integral of the power of every driver and load.
    kinetic_change : array
        Kinetic energy at the end less that at the beginning.
    balance : array
        Sum of all work less ``kinetic_change``, relative to the integral of the absolute powers.

    Examples
    --------
    >>> import mechgraph as mg
    >>> c = mg.over_time(mg.solve(mg.load("four-bar")))
    >>> round(float(c.efforts["A.Rz"].rms), 3), bool(abs(c.balance) < 1e-3)
    (0.214, True)
    """

    solution: Solution
    about: tuple[float, float, float]
    duration: Array
    closed: Any
    revolutions: Array
    efforts: Mapping[str, Figures]
    powers: Mapping[str, Figures]
    shaking: Mapping[str, Figures]
    couplings: Mapping[str, Figures]
    work: Mapping[str, Array]
    kinetic_change: Array
    balance: Array

    @property
    def work_per_revolution(self) -> dict[str, Array]:
        """``work`` over the ``revolutions``."""
        return {name: work / self.revolutions for name, work in self.work.items()}

    def to_dict(self) -> dict[str, Any]:
        """Return all figures of one row of positions as plain data.

        Returns
        -------
        dict

        Raises
        ------
        DeclarationError
            Several cases.
        """
        if self.duration.shape:
            raise DeclarationError("figures as data", [f"{self.duration.size} cases: solve them one by one"])
        found: dict[str, Any] = read_off(OverTimeData, self)
        return found

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
        figures |= {f"shaking {name}": self.shaking[name] for name in ("|F|", "|M|")} | dict(self.couplings)
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
    # part of an RMS value above which its error is said
    return f"{number(value)} ± {error:.1g}" if error > 0.01 * abs(value) else number(value)


@door
def over_time(s: Solution, about: ArrayLike = (0.0, 0.0, 0.0)) -> OverTime:
    """Integrate over time: peak, mean and RMS of driver efforts, powers and shaking, and the work of drivers and loads.

    Positions need not be evenly spaced. Times are those of the motion, or follow from the rate of a driver that never reverses,
    ``t = int dq / q'``. A whole cycle is detected if the last position is the first again, or one step before it, and all rates return.

    Parameters
    ----------
    s : Solution
        A solution with forces and times (or a driver velocity).
    about : (3,) array_like
        Global point of the shaking moment [length].

    Returns
    -------
    OverTime

    Raises
    ------
    DeclarationError
        The solution has no forces, or its positions no times.

    Examples
    --------
    >>> import mechgraph as mg
    >>> c = mg.over_time(mg.solve(mg.load("four-bar")))
    >>> bool(c.closed), round(float(c.duration), 4)
    (True, 0.6283)
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
    parts = {WRENCHES[i]: wrench[..., i] for i in range(6)[s.mechanism.span]}
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
        {
            name: row.figures(name, of, unit_of(units, dimension))
            for name, of, dimension in forces_of_couplings(s._values)
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


# --- oil film ----------------------------------------------------------------------------------------------------------


def film_of(s: Solution, pair: str, journal: Journal | None) -> FilmResult:
    """The film of a pair, see ``Solution.film``."""
    about = f"film of {pair!r}"
    p = s.whole.pairs[s.whole.place_of_pair(pair)]
    journal = p.film if journal is None else journal
    if found := _film_faults(s, p, journal):
        raise DeclarationError(about, found)
    assert journal is not None
    load = -np.stack([s[p.name].components[name] for name in ACROSS], axis=-1)
    if found := [
        f"{name} of {p.name} is not unique; remove the redundancy (see mechgraph.check), or pass redundant='minimum_norm' or 'elastic'"
        for name, of in zip(ACROSS, load.T, strict=True)
        if not np.isfinite(of).all()
    ]:
        raise DeclarationError(about, found)
    (cycle,) = cycles_of(s)
    returns = cycle.closed and _returns(load, bool(cycle.gap))
    speed = s[p.name].velocity[:, [f.twist for f in p.type.freedoms].index(TURN)]
    out = FilmResult(s._values, p.name, journal, Loaded(cycle.t, cycle.gap if returns else 0.0, returns, load, speed))
    starts = "the one returned starts in the middle of the bearing"
    for doubtful, text in (
        (not journal.is_short, f"length / diameter = {journal.length / (2 * journal.radius):.3g}; from 0.7 on a film carries less than "
         "the short bearing says"),
        (cycle.closed and not returns, f"the load does not return to its value at the beginning, so that no orbit closes; {starts}"),
        (returns and not out.closed, f"no closed orbit was found; {starts}"),
    ):  # fmt: skip
        if doubtful:
            warnings.warn(f"{about}: {text}", MechgraphWarning, stacklevel=3)
    return out


def _film_faults(s: Solution, p: Pair, journal: Any) -> list[str]:
    """Why there is no film of a pair in a solution."""
    given = isinstance(journal, Journal)
    found = [] if given else [wrong(journal, "film", "mg.Journal(...), here or as the pair's film=")]
    found += [*(journal.value_faults("") if given else []), *film_faults(p, "")]
    if not s.has_forces:
        found.append("the solution has no forces; use mechgraph.solve")
    if len(s.batch) != 1 or s.batch[-1] < FEWEST:
        found.append(f"the solution has positions {s.batch}; expected one row of at least {FEWEST}")
    if not found and not (s.status == OK).all():
        found.append("some positions were not solved; solve those that are reachable")
    return found


def _returns(load: Array, open_end: bool) -> bool:
    """Whether a load ``(T, 2)`` over a cycle comes back to its beginning; with an open end to within two of its largest steps."""
    gap, size = float(np.abs(load[-1] - load[0]).max()), float(np.abs(load).max())
    # a millionth of the load is what a spline through a cycle does not see
    return gap <= 1e-6 * size + (2.0 * float(np.abs(np.diff(load, axis=0)).max()) if open_end else 0.0)
