"""The oil film of a journal bearing over a cycle: orbit of the journal, least film, pressure, friction.

    de/dt = (c^2 / (eta R L^3)) H(e)^-1 W(t) + (w_b - w_a) / 2 x e,   e(T) = e(0)

with the load W on the journal and the eccentricity e on link a (see ``mechgraph.pairs.journal``). Cycles from the middle of the bearing
lead near the orbit that closes; collocation over the whole cycle finds it.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any, Literal, NamedTuple

import numpy as np
import scipy

from mechgraph.document import Document, Paragraph, Shown
from mechgraph.maths.se3 import Array
from mechgraph.pairs.journal import Journal
from mechgraph.quantities import FORCE, LENGTH, MOMENT, POWER, PRESSURE, PURE, unit_of
from mechgraph.result.trajectory import Trajectory
from mechgraph.result.values import PositionLabels, bracket, ranges

FILM_DIMENSIONS = {
    "orbit": PURE, "eccentricity": PURE, "film": LENGTH, "min": LENGTH, "pressure": PRESSURE, "torque": MOMENT, "power": POWER,
}  # fmt: skip
"""Numbers of a film that a study may ask for, ``"B.film.min"``, with the dimension of each."""
WALL = 1.0 - 1e-9
"""The largest eccentricity ratio at which a film is evaluated."""
ORBIT, ROUGH = 1e-7, 1e-3
"""Relative accuracy of an orbit over its span, and of the cycles that lead to it."""


class Loaded(NamedTuple):
    """What loads a film: times ``t (T,)``, the ``gap`` to the beginning of the next cycle where that is left out, whether it is a cycle,
    the load on the journal ``(T, 2)`` along x and y of the marker on link a, the ``speed (T,)`` of link b relative to it.
    """

    t: Array
    gap: float
    is_cycle: bool
    load: Array
    speed: Array


class FilmResult(Shown):
    """The film of one journal bearing over the positions ``(T,)`` of a cycle; see the properties."""

    def __init__(self, values: Trajectory, pair: str, journal: Journal, loaded: Loaded) -> None:
        self._values, self.pair, self.journal, self._loaded = values, pair, journal, loaded

    @property
    def load(self) -> Array:
        """Load ``(T, 2)`` on the journal along x and y of the marker on link a."""
        return self._loaded.load

    @cached_property
    def _orbit(self) -> tuple[Array, bool]:
        """The orbit ``(2, T)``, and whether it closes."""
        return _orbit_of(self.journal, self._loaded)

    @property
    def orbit(self) -> Array:
        """Eccentricity ratios ``(T, 2)`` along x and y of the marker on link a."""
        return self._orbit[0].T

    @property
    def closed(self) -> bool:
        """Whether the orbit is the periodic one of a whole cycle; else it starts in the middle of the bearing."""
        return self._orbit[1]

    @property
    def eccentricity(self) -> Array:
        """Sizes ``(T,)`` of the eccentricity ratios."""
        return np.asarray(np.hypot(*self._orbit[0]))

    @property
    def film(self) -> Array:
        """Least film ``(T,)`` around the bearing [length], ``c (1 - e)``."""
        return self.journal.clearance * (1.0 - self.eccentricity)

    @property
    def min(self) -> float:
        """The least film over the positions [length]."""
        return float(self.film.min())

    @property
    def at(self) -> str:
        """The position of the least film: driver values, or time."""
        return PositionLabels(self._values).name(int(np.argmin(self.film)))

    @property
    def pressure(self) -> Array:
        """Greatest pressure ``(T,)``."""
        return self.journal.pressure(self._orbit[0], self.load.T)

    @property
    def torque(self) -> Array:
        """Friction torque ``(T,)`` on link b, against a positive rotation of it relative to link a."""
        return self.journal.torque(self._orbit[0], self.load.T, self._loaded.speed)

    @property
    def power(self) -> Array:
        """Power ``(T,)`` lost in the film: shear, and pressing the oil out."""
        return self.journal.power(self._orbit[0], self.load.T, self._loaded.speed)

    def document(self) -> Document:
        """Ranges over the positions, and what the model leaves out."""
        units = self._values.mechanism.units
        rows = [
            ("load" + bracket(unit_of(units, FORCE)), np.hypot(*self.load.T)),
            ("eccentricity ratio", self.eccentricity),
            ("least film" + bracket(unit_of(units, LENGTH)), self.film),
            ("greatest pressure" + bracket(unit_of(units, PRESSURE)), self.pressure),
            ("friction torque" + bracket(unit_of(units, MOMENT)), self.torque),
            ("power lost" + bracket(unit_of(units, POWER)), self.power),
        ]
        words = (
            "Short bearing, half film"
            + ("" if self.closed else "; no closed orbit: it starts in the middle of the bearing")
            + (
                ""
                if self.journal.is_short
                else "; longer than 0.7 diameters, where a film carries less than this model says"
            )
            + ". The film does not act back on the motion; oil that is missing where the film opens again is left out."
        )
        labels = PositionLabels(self._values)
        return Document(f"Oil film of {self.pair}", (Paragraph(words), ranges(rows, labels.name)))


def _orbit_of(journal: Journal, loaded: Loaded) -> tuple[Array, bool]:
    """The orbit ``(2, T)``; of a cycle the one that closes, and whether it does."""
    collocate: Any = scipy.integrate.solve_bvp
    rates, span = _rates_of(journal, loaded), loaded.t[-1] + loaded.gap - loaded.t[0]
    e, places = np.zeros(2), (loaded.t - loaded.t[0]) / span
    # an orbit that attracts closes in some six cycles; 40 tell that it does not
    for _ in range(40) if loaded.is_cycle else ():
        led = _led(rates, e, None, ROUGH)
        if np.abs(led.y[:, -1] - e).max() < np.sqrt(ROUGH):
            found = collocate(rates, lambda first, last: first - last, led.t, led.y, tol=ORBIT, max_nodes=100_000)
            if found.success:
                return found.sol(places), True
            break
        e = led.y[:, -1]
    return np.asarray(_led(rates, np.zeros(2), places, 0.01 * ORBIT).y), False


def _rates_of(journal: Journal, loaded: Loaded) -> Callable[[Any, Array], Array]:
    """Rates per span of all positions of eccentricities ``(2,)`` or ``(2, n)`` at parts of it, under load and speed drawn through these."""
    t, values = loaded.t, np.concatenate([loaded.load.T, loaded.speed[None]])
    if loaded.gap:
        t = np.append(t, t[-1] + loaded.gap)
        values = np.concatenate([values, values[:, :1]], axis=1)
    elif loaded.is_cycle:
        values[:, -1] = values[:, 0]
    span = t[-1] - t[0]
    # of order 6: a load that turns once in 96 positions is off by 1e-10
    ends: Literal["periodic"] | None = "periodic" if loaded.is_cycle else None
    order = min(5, len(t) - 1 - len(t) % 2)
    drawn: Any = scipy.interpolate.make_interp_spline((t - t[0]) / span, values, k=order, axis=1, bc_type=ends)

    def rates(part: Any, e: Array) -> Array:
        now = drawn(part)
        # trial steps of the integrator may pass the wall, where the film lets nothing by
        return np.asarray(span * journal.rates(e / np.maximum(1.0, np.hypot(*e) / WALL), now[:2], now[2]))

    return rates


def _led(rates: Callable[[Any, Array], Array], e: Array, places: Array | None, rtol: float) -> Any:
    """Where eccentricities ``(2,)`` at the beginning are led to at parts of the span."""
    return scipy.integrate.solve_ivp(rates, (0.0, 1.0), e, method="LSODA", t_eval=places, rtol=rtol, atol=0.01 * rtol)
