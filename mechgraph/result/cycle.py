"""The time of positions, whether they make a whole cycle, and integrals over it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.errors import DeclarationError
from mechgraph.result.solution import Solution

SAME_TIME = 1e-6
"""Part of the duration by which drivers may disagree about the time of a position."""
RETURNED = 1e-6
"""Part of the range of a coordinate (at least 1 rad for a turn) within which it is back where it was."""
STEPS_TO_CLOSE = 2.0
"""So many of its largest steps may part the last value of a coordinate from the first where the end of a cycle is left out."""


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
    return [_cycle(s, row) for row in _Rows(s)]


# --- rows of positions -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Row:
    """One row: times where they are given, and of every single freedom its name, coordinates and rates ``(T,)``."""

    t: Array | None
    freedoms: dict[str, tuple[Array, Array]]


class _Rows:
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
    back = all(_returned(values, name, s, ended) for name, both in row.freedoms.items() for values in both)
    if not back:
        return Cycle(t, 0.0, False, turned)
    gap = 0.0 if ended else 2 * np.pi * left / float(abs(v[0] + v[-1]) / 2)
    return Cycle(t, gap, True, turned + (0.0 if ended else left))


def _runs(q: Array, v: Array) -> bool:
    """Whether a driver goes one way without a stop."""
    way = np.sign(q[-1] - q[0])
    return bool(way and (np.diff(q) * way > 0).all() and (v * way > 0).all())


def _returned(values: Array, name: str, s: Solution, ended: bool) -> bool:
    """Whether the last value of a coordinate or rate leads back to the first, up to whole turns and rounds of closed curves."""
    gap = float(values[-1] - values[0])
    period = s.whole.period(name)
    if np.isfinite(period):
        gap -= period * round(gap / period)
    size = float(np.ptp(values)) + float(np.abs(values).max())
    return abs(gap) <= (
        RETURNED * max(size, 1e-300)
        if ended
        else STEPS_TO_CLOSE * float(np.abs(np.diff(values)).max()) + RETURNED * size
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
                "the positions have no times: give the motion t=, or a driver that runs one way velocity=; all positions must be solved"
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
