"""Drives whose motion is prescribed in time: position, velocity and acceleration as functions of t."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.errors import DeclarationError
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.motion import Motion
from mechgraph.response.differentiated import Law, differentiated, samples_fault

OVER_POSITIONS = "is an array over positions, which a motion in time does not have; give a number or a function"
"""What is wrong with a load that holds such an array."""


class Sampled:
    """The quintic spline through samples of position, velocity and acceleration; refuses times outside of them."""

    def __init__(self, name: str, motion: Motion) -> None:
        assert motion.t is not None
        self.name, self.t = name, motion.t
        rows = np.stack([motion.position, motion.velocity, motion.acceleration], axis=1)
        self._spline = scipy.interpolate.BPoly.from_derivatives(motion.t, rows)
        self._rates = (self._spline, self._spline.derivative(1), self._spline.derivative(2))

    def __call__(self, t: float) -> tuple[float, float, float]:
        """Position, velocity and acceleration at a time."""
        slack = 1e-9 * float(self.t[-1] - self.t[0])
        if not self.t[0] - slack <= t <= self.t[-1] + slack:
            raise DeclarationError(
                "respond",
                [
                    f"motion of {self.name!r}: its samples end at t = {self.t[-1]:g} (they begin at {self.t[0]:g}), asked for t = {t:g}; "
                    "give samples for the whole time"
                ],
            )
        at = min(max(t, self.t[0]), self.t[-1])
        q, rate, acceleration = (float(part(at)) for part in self._rates)
        return q, rate, acceleration


class Called:
    """A callable ``t -> (position, velocity, acceleration)``."""

    def __init__(self, name: str, law: Callable[[float], Any]) -> None:
        self.name, self.law = name, law

    def __call__(self, t: float) -> tuple[float, float, float]:
        """Position, velocity and acceleration at a time."""
        try:
            values = tuple(float(v) for v in self.law(t))
        except TypeError:
            values = ()
        if len(values) != 3 or not np.isfinite(values).all():
            raise DeclarationError(
                "respond",
                [
                    f"motion of {self.name!r} at t = {t:g}: expected (position, velocity, acceleration), three finite numbers, got "
                    f"{self.law(t)!r}"
                ],
            )
        return values[0], values[1], values[2]


def law_of(name: str, motion: Any) -> Law | str:
    """A motion as a function of time, or what is wrong with it."""
    if isinstance(motion, Motion):
        if motion.t is None or motion.t.ndim != 1 or len(motion.t) < 2:
            return (
                f"motion of {name!r}: has no times; give Motion(..., t=t) with at least two samples, or a callable of t"
            )
        if not (np.diff(motion.t) > 0).all():
            return f"motion of {name!r}: its times do not rise"
        fault = samples_fault(motion.t, np.stack([motion.position, motion.velocity, motion.acceleration], axis=1))
        return f"motion of {name!r}: {fault}" if fault else Sampled(name, motion)
    if callable(motion):
        return Called(name, motion)
    return f"motion of {name!r} = {type(motion).__name__}: expected a Motion with t, or a callable t -> (position, velocity, acceleration)"


class Prescribed:
    """The prescribed freedoms of a mechanism: names, and their values ``(3, p)`` in the user's units at a time.

    ``breaks``: times at which their accelerations jump.
    """

    def __init__(self, laws: Mapping[str, Law], breaks: Sequence[float] = ()) -> None:
        self.laws, self.breaks = dict(laws), tuple(breaks)

    @property
    def names(self) -> tuple[str, ...]:
        """Full names of the prescribed freedoms."""
        return tuple(self.laws)

    def at(self, t: float) -> Array:
        """Positions, velocities and accelerations ``(3, p)``."""
        return np.array([law(t) for law in self.laws.values()], dtype=float).reshape(-1, 3).T


def read_motions(m: Mechanism, motions: Mapping[str, Any], times: Array, faults: list[str]) -> Prescribed:
    """The motions of a call over its times, and those that drives carry; adds what is wrong with them to ``faults``."""
    named: dict[str, Any] = {m.full_name(d.freedom): d.motion for d in m.drives if d.motion is not None}
    for name, motion in motions.items():
        fault = m.freedom_fault(name, single=True)
        if fault:
            faults.append(f"motion of {name!r}: {fault}")
        else:
            named[m.full_name(name)] = motion
    laws = {name: law_of(name, motion) for name, motion in named.items()}
    breaks: list[float] = []
    for name, law in laws.items():
        found = differentiated(law, float(times[0]), float(times[-1])) if isinstance(law, Called) else ()
        if isinstance(found, str):
            faults.append(f"motion of {name!r}: {found}")
        else:
            breaks += found
    faults += [law for law in laws.values() if isinstance(law, str)]
    return Prescribed({name: law for name, law in laws.items() if not isinstance(law, str)}, breaks)
