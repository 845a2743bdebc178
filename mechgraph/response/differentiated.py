"""Whether the rates that a prescribed motion states are those of its position, and where it jumps or bends.

In a panel from ``a`` to ``b`` a motion ``q, q', q''`` of time is that of one function where

    q(b) - q(a) = int q' dt,    q'(b) - q'(a) = int q'' dt

A panel in which it is not is halved, and the worse half taken on. Rates that are wrong stay wrong in every half by the same part; what is
merely fast is resolved at some length; a jump is left over in one half alone, and stays however short that is, while a jump of ``q''``
falls with it: there steps of an integration had better end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mechgraph.algebra.se3 import Array

Law = Callable[[float], tuple[float, float, float]]
"""Position, velocity and acceleration at a time."""
PANELS = 256
"""Panels from the beginning to the end."""
AGREEING_CHANGE = 1e-5
"""Part of the change in a panel up to which it agrees with the rate: what interpolated tables of both may differ by."""
NOISE_OF_MOTION = 1e-13
"""The same of the quantity itself."""
PANEL_HALVINGS = 24
"""Most halvings of a panel."""
HALVINGS_ALIKE = 6
"""Halvings in which the part by which a rate is off stays alike, in both halves, where the rate is wrong."""
IS_JUMP = 10.0
"""Change against what the rate says from which on it is a jump."""
OF_SAMPLES = (0.1, 0.75)
"""Part of the largest rate by which changes between samples may miss it; of accelerations more, as they may jump between two samples."""
QUANTITIES = ("position", "velocity", "acceleration")
_PLACES, _WEIGHTS = np.polynomial.legendre.leggauss(6)


@dataclass(frozen=True)
class _Panel:
    """A panel, and by how much the changes ``(2,)`` of position and velocity miss the integrals of the rates.

    ``part``: the worse of both, against what is allowed; ``order`` which it is; ``said`` the integral, ``size`` the largest change by rate.
    """

    begin: float
    end: float
    part: float
    order: int
    change: float
    said: float
    size: float


def differentiated(law: Law, begin: float, end: float) -> str | tuple[float, ...]:
    """Times at which the acceleration of a motion jumps, or what is wrong with its rates between two times."""
    breaks, edges = [], np.linspace(begin, end, PANELS + 1).tolist()
    rounding = NOISE_OF_MOTION * np.abs([law(t) for t in edges]).max(axis=0)[:2]
    for a, b in pairwise(edges):
        panel = _panel(law, a, b, rounding)
        if panel.part > 1.0:
            found = _narrowed(law, panel, rounding)
            if isinstance(found, str):
                return found
            breaks += found
    return tuple(breaks)


def _panel(law: Law, a: float, b: float, rounding: Array) -> _Panel:
    h = b - a
    inside = np.array([law(float(t)) for t in a + 0.5 * h * (1.0 + _PLACES)])
    ends = np.array([law(a), law(b)])
    change, said = (ends[1] - ends[0])[:2], 0.5 * h * (_WEIGHTS @ inside)[1:]
    largest = np.abs(np.concatenate([ends, inside])).max(axis=0)
    allowed = AGREEING_CHANGE * h * largest[1:] + rounding
    part = np.abs(change - said) / np.where(allowed > 0.0, allowed, np.inf)
    k = int(np.argmax(part))
    return _Panel(a, b, float(part[k]), k, float(change[k]), float(said[k]), float(h * largest[k + 1]))


def _narrowed(law: Law, panel: _Panel, rounding: Array) -> str | list[float]:
    """What is wrong in a panel, or the time at which an acceleration jumps there, if any."""
    parts: list[float] = []
    for _ in range(PANEL_HALVINGS):
        middle = 0.5 * (panel.begin + panel.end)
        halves = [_panel(law, *ends, rounding) for ends in ((panel.begin, middle), (middle, panel.end))]
        worse = max(halves, key=lambda half: half.part)
        if worse.part <= 1.0:
            return []
        parts = [*parts, worse.part] if min(half.part for half in halves) > 1.0 else []
        panel = worse
        if len(parts) > HALVINGS_ALIKE and parts[-1] > 0.5 * parts[-1 - HALVINGS_ALIKE]:
            return (
                f"its {QUANTITIES[panel.order]} changes by {panel.change:.6g} from t = {panel.begin:.9g} to {panel.end:.9g}, where its "
                f"{QUANTITIES[panel.order + 1]} says {panel.said:.6g}; give the derivatives of the position"
            )
    if abs(panel.change - panel.said) > IS_JUMP * panel.size:
        jump = f"jumps by {panel.change - panel.said:.6g} at t = {panel.begin:.6g}"
        return f"its {QUANTITIES[panel.order]} {jump}; give a motion that goes there"
    return [_jump(law, panel.begin, panel.end)]


def _jump(law: Law, a: float, b: float) -> float:
    """The first time behind a jump of the acceleration between two times."""
    before, behind = law(a)[2], law(b)[2]
    while a < (middle := 0.5 * (a + b)) < b:
        here = law(middle)[2]
        a, b = (middle, b) if abs(here - before) < abs(here - behind) else (a, middle)
    return b


def samples_fault(t: Array, rows: Array) -> str:
    """What is wrong with the rates of samples ``rows (T, 3)`` at times ``(T,)``; empty where nothing is."""
    h, change, mean = np.diff(t), np.diff(rows, axis=0), 0.5 * (rows[1:] + rows[:-1])
    said = h * mean[:, 1] - h**2 / 12.0 * change[:, 2], h * mean[:, 2]
    for order, (integral, most) in enumerate(zip(said, OF_SAMPLES, strict=True)):
        off = np.abs(change[:, order] - integral)
        allowed = most * h * np.abs(rows[:, order + 1]).max() + NOISE_OF_MOTION * np.abs(rows[:, order]).max()
        i = int(np.argmax(off - allowed))
        if off[i] > allowed[i]:
            return (
                f"the {QUANTITIES[order]} of its samples changes by {change[i, order]:.6g} from t = {t[i]:.6g} to {t[i + 1]:.6g}, where "
                f"its {QUANTITIES[order + 1]} says {integral[i]:.6g}; give the derivatives of the position, or leave them out"
            )
    return ""
