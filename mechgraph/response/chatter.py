"""Dry friction in a force law: where the rate of such a law comes to rest the force would have to be found, and steps chatter about it."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.force.loads import Site
from mechgraph.model.loads import Law, Load
from mechgraph.response.chart import Stopped

TINY_STEP = 1e-5
"""Part of the time of a motion below which a step is one of those that chatter."""
IN_A_ROW = 12
"""Such steps, one after the other, after which the laws are looked at."""
NEARER_RATES = 1e-4
"""Part of the rates at which a law is asked again: what jumps does so however near to zero they are."""
JUMPS = 0.5
"""Part of the difference of the forces to both sides that is left then."""


class Followed(Protocol):
    """What is seen of a motion."""

    def site(self, t: Array) -> Site:
        """What loads see of it at times ``(T,)``."""


class Chatter:
    """Watches short steps for laws that jump with the sign of their rate."""

    def __init__(self, motion: Followed, loads: tuple[Load, ...], span: float) -> None:
        self.motion, self.span = motion, span
        self.laws = [load for load in loads if isinstance(load, Law) and load.of_time]
        self._ends: list[float] = []

    def look(self, begin: float, end: float) -> None:
        """Look at an accepted step.

        Raises
        ------
        Stopped
            where a law makes steps chatter.
        """
        if not self.laws or end - begin > TINY_STEP * self.span:
            self._ends = []
            return
        self._ends.append(end)
        if len(self._ends) < IN_A_ROW:
            return
        site, self._ends = self.motion.site(np.array(self._ends)), []
        for law in self.laws:
            x, v = law.coordinate(site)
            if (np.diff(np.sign(v)) != 0).sum() < 2:
                continue
            fast = np.abs(v).max()
            both = (np.full(len(v), rate) for rate in (fast, NEARER_RATES * fast))
            wide, near = (law.force(site, x, rate) - law.force(site, x, -rate) for rate in both)
            if np.abs(near).min() > JUMPS * np.abs(wide).max():
                raise Stopped(
                    f"{law.where}its force jumps by {abs(near[-1]):.4g} where its rate changes sign, as dry friction does; at "
                    f"t = {end:.6g}, x = {x[-1]:.6g}, it holds what it acts on, and steps chatter about a rate of zero. A force law "
                    "carries no friction that sticks; let it rise over a small rate, as np.tanh(v / v0) does"
                )
