"""Charts: independent freedoms in which the motion is followed for a while, and states closed for given values of them.

A chart is laid out at a closed state: its independent freedoms are those that a pivoted QR of the motions picks, so that all others move
at like rates there. Rotations are measured from the state at which the chart was laid out, so that no rotation has a singular place. When
the other freedoms come to move much faster, a new chart takes over.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.passive_motion import PassiveMotion
from mechgraph.closure.rank import closure_rank
from mechgraph.closure.solver import ClosureSolver, FactoredClosure, closure_solver
from mechgraph.numerics.tolerances import PATH

STEEPEST = 3.0
"""Largest rate of a freedom for unit rates of the independent ones, against that where the chart was laid out, before a new one is; and
the same of a condition that is poor."""
MOST_TURNED = 1.0
"""Angle of an independent rotation from where the chart was laid out above which a new one is."""
CLOSING_STEPS = 12
"""Most Newton steps to a closed state."""
LAST_STEP = 1e-13
"""Newton step from which on a state counts as closed; the step before it was a millionth, so that only rounding is left."""
NOISE_OF_STEP = 1e-15
"""The same of a step that is rounding, as a part of the condition."""
LOST = 1.0
"""Correction above which closing is given up: the step was too long."""
UNMOVED_BY_SPIN = 1e-9
"""Rate of a freedom in a unit passive motion below which it has no part in it."""


class Stopped(Exception):
    """The motion cannot be followed on; the message says why."""


@contextmanager
def stopping(what: str) -> Iterator[None]:
    """What a function of a user raises stops the motion, which is kept up to there."""
    try:
        yield
    except Exception as error:
        raise Stopped(f"{what} raised {type(error).__name__}: {error}") from error


@dataclass(frozen=True)
class Held:
    """Passive motions that are held at rest, and the ``places`` of the independent freedoms that stand for them in a chart."""

    motions: tuple[PassiveMotion, ...]
    places: Index


@dataclass(frozen=True)
class Closed:
    """A closed state: evaluated, factored, which positions were closed ``(T,)``, and the passive motions held."""

    here: Configuration
    f: FactoredClosure
    done: Array
    held: Held | None = None


class Chart:
    """Independent freedoms ``free`` beside the ``prescribed`` ones, from the closed state ``x0 (nx,)``.

    Those that are ``moving`` have rates of their own; the others stand for the passive motions ``held`` at that state, whose rates follow.
    """

    def __init__(
        self,
        system: System,
        x0: Array,
        prescribed: Index,
        engine: Literal["dense", "sparse"],
        held: tuple[PassiveMotion, ...] = (),
    ) -> None:
        self.system, self.x0, self.prescribed = system, x0, prescribed
        here = Configuration(system, x0[:, None])
        null = closure_rank(here, prescribed, engine).motions
        passive, moving = _apart(null, held) if held else (np.zeros(0, dtype=np.intp), _leading(null))
        self.free: Index = np.sort(np.append(passive, moving)).astype(np.intp)
        self.moving: Index = np.sort(moving)
        self.held = Held(held, np.flatnonzero(np.isin(self.free, passive))) if held else None
        self.solver: ClosureSolver = closure_solver(engine, np.concatenate([self.free, prescribed]))
        self.which = self.solver.chosen(here, np.full(1, -1))
        self.start = here
        f = self.solver.factored(here, self.which)
        self.steepness, self.condition = self.shape(f)
        self._singles = system.single_rows[self.free]
        self.turns = bool((self._singles < 0).any())
        self._rows = system.single_rows[prescribed]

    def shape(self, f: FactoredClosure) -> tuple[float, float]:
        """The largest rate of a freedom for unit rates of the independent ones, and the condition, at a state."""
        return float(np.abs(f.sensitivity()[:, : len(self.free)]).max(initial=1.0)), float(f.condition[0])

    def worn(self, steepness: float, condition: float, u: Array) -> bool:
        """Whether another chart should take over at a state with coordinates ``u (n,)``, so steep and of this condition."""
        far = self.turns and np.abs(u[self._singles < 0]).max(initial=0.0) > MOST_TURNED
        poor = not condition < max(PATH.doubtful, STEEPEST * self.condition)
        return bool(far or poor or steepness > STEEPEST * self.steepness)

    def coordinates(self, x: Array) -> Array:
        """Independent coordinates ``u (n, T)`` of states: how far they are from where the chart was laid out."""
        return self.system.difference(x, self.x0[:, None])[self.free]

    def rates_of_coordinates(self, x: Array, dq: Array) -> Array:
        """``u' (n, T)`` from the rates ``dq (F, T)`` of the freedoms."""
        if not self.turns:
            return dq[self.free]
        return self.system.tangent(self.system.difference(x, self.x0[:, None]), dq)[self.free]

    def close(self, x: Array, u: Array, p: Array, first: Configuration | None = None) -> Closed:
        """States near ``x (nx, T)`` with independent coordinates ``u (n, T)`` and prescribed positions ``p (p, T)``, all loops closed.

        Newton on the closure and on ``difference(x, x0) = u``; what the first leaves free the second settles.
        """
        s, n = self.system, len(self.free)
        x = x.copy()
        x[self._rows] = p
        single = self._singles >= 0
        x[self._singles[single]] = self.x0[self._singles[single], None] + u[single]
        total, before = np.zeros(x.shape[1]), np.full(x.shape[1], np.inf)
        for _ in range(CLOSING_STEPS):
            here = Configuration(s, x)
            f = self.solver.factored(here, np.repeat(self.which, here.T))
            step = f.solve(-here.residual[:, None])[:, 0]
            size = np.abs(step).max(axis=0, initial=0.0)
            if self.turns:
                y = s.difference(x, self.x0[:, None])
                Z = f.sensitivity()[:, :n]
                A = np.stack([s.tangent(y, Z[:, k])[self.free] for k in range(n)], axis=1)
                wanted = u - y[self.free] - s.tangent(y, step)[self.free]
                a = np.linalg.solve(np.moveaxis(A, -1, 0), wanted.T[..., None])[..., 0].T
                step = step + (Z * a).sum(axis=1)
                size = np.maximum(size, np.abs(u - y[self.free]).max(axis=0, initial=0.0))
            total = total + size
            with np.errstate(invalid="ignore"):
                # below what is asked for, or twice below what rounding allows where the condition is poor
                most = np.maximum(10 * LAST_STEP, NOISE_OF_STEP * f.condition)
                closed = (size <= LAST_STEP) | ((size <= most) & (before <= most))
            before = size
            if closed.all() or not np.isfinite(size).all() or (total > LOST).any():
                break
            x = s.advance(x, step)
        return Closed(here, f, closed & (here.closure <= PATH.accepted), self.held)


def _leading(null: Array) -> Index:
    """As many freedoms as there are motions ``null (F, n)``, by pivots: with them all others move at like rates."""
    n = null.shape[1]
    order = scipy.linalg.qr(null.T, mode="economic", pivoting=True)[2] if n else np.zeros(0)
    return np.asarray(order[:n], dtype=np.intp)


def _apart(null: Array, held: tuple[PassiveMotion, ...]) -> tuple[Index, Index]:
    """Freedoms that stand for the passive motions among ``null (F, n)``, and those for the others, which no passive motion moves."""
    passive = np.stack([motion.rates / np.linalg.norm(motion.rates) for motion in held], axis=1)
    still = np.flatnonzero(np.abs(passive).max(axis=1) < UNMOVED_BY_SPIN)
    count = null.shape[1] - len(held)
    moving = still[_leading(null[still])[:count]]
    if np.linalg.matrix_rank(null[moving]) < count:
        raise Stopped(
            "no freedoms that the passive motions leave alone tell where the mechanism stands, so that these cannot be held"
        )
    return _leading(passive), moving
