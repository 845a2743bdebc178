"""Positions of many variants of one mechanism, followed together: one batched evaluation a step for all of them.

Every variant has its own numbers (``Parameters`` with a batch axis) and its own driver path of the same number of positions. Steps are
those from position to position, cut where they are long; each is predicted to second order and corrected by Newton, and a variant
stays in step only where that is beyond doubt: a small correction, no singular position between two of its places, a good
condition. What falls out of step is marked, and is for ``closure.path`` to follow by itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import state_rows
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.march import CORRECTION
from mechgraph.numerics.linear import Choice, ChosenSystem, choose, singular_between

LONGEST = 0.1
"""Longest step, in driver space (radians, or lengths / L)."""
ITERATIONS = 6
"""Most Newton iterations in a step."""
LAST = 1e-8
"""Closure residual from which one more Newton step ends an iteration: its square is rounding."""
FAIR = 1e3
"""Condition number of the closure equations above which another choice of rows and columns is tried."""
POOR = 1e5
"""Condition number above which a variant falls out of step."""
PAST = 2
"""Places in the past from which the next step is predicted."""
STRAIGHT = 0.999
"""Cosine between two steps above which the path goes straight on."""
LONGER = 3.0
"""Ratio of a step to the one before up to which the past is extrapolated."""
STRIDES = (1, 8, 64)
"""Numbers of steps in which the numbers of a variant are led from those of the mechanism itself, tried one after the other."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Steps:
    """States ``(nx, V, N)`` and choices ``which (V, N)``; ``lost (V,)`` the variants that fell out of step.

    ``between (nx, V, K)`` are the states at the start and between positions, ``place_between (K,)`` and ``place (N,)`` the numbers
    of steps that led there.
    """

    x: Array
    which: Index
    choices: list[Choice]
    lost: Mask
    between: Array
    place_between: Array
    place: Array


@dataclass
class _Front:
    """Where the variants stand: states ``(nx, V)``, sensitivities ``Z (F, d, V)``, choices and chosen parts ``square (n, n, V)`` of J.

    ``past`` are the last places: sensitivities there, and the steps in driver space ``(d, V)`` that led away from them.
    """

    x: Array
    Z: Array
    which: Index
    square: Array
    lost: Mask
    past: tuple[tuple[Array, Array], ...] = ()


class Lockstep:
    """Variants of one mechanism in step. ``columns`` are the driven freedoms, ``keep`` freedoms preferably held."""

    def __init__(self, system: System, columns: Index, keep: Index) -> None:
        self.system, self.columns, self.keep = system, columns, keep
        self.rows = state_rows(system, columns)
        self.choices: list[Choice] = []

    def taken(self, cases: Index) -> System:
        """The system with the numbers of some variants."""
        if cases.size == self.system.par.batch:
            return self.system
        return self.system.with_parameters(self.system.par.taken(cases))

    # --- one step ----------------------------------------------------------------------------------------------------------

    def _corrected(self, front: _Front, x: Array) -> _Front:
        """Newton from states ``x (nx, V)`` for all variants still in step; where they stand then."""
        out = _Front(x.copy(), front.Z.copy(), front.which.copy(), front.square.copy(), front.lost.copy())
        total = np.zeros((self.system.n_freedoms, x.shape[1]))
        open_ = np.flatnonzero(~out.lost)
        for _ in range(ITERATIONS):
            if not open_.size:
                break
            here = self.taken(open_).at(out.x[:, open_])
            solver = self._solver(here.J, out, open_)
            left = np.abs(here.residual).max(axis=0, initial=0.0)
            step = solver.solve(-here.residual[:, None])[:, 0]
            fit = np.isfinite(step).all(axis=0) & (np.abs(step).max(axis=0, initial=0.0) < CORRECTION)
            out.lost[open_[~fit]] = True
            out.x[:, open_[fit]] = self.taken(open_[fit]).advance(out.x[:, open_[fit]], step[:, fit])
            total[:, open_[fit]] += step[:, fit]
            last = fit & (left < LAST)
            self._settle(out, solver, open_, last, here.J)
            open_ = open_[fit & ~last]
        out.lost[open_] = True
        out.lost |= np.abs(total).max(axis=0, initial=0.0) > CORRECTION
        return out

    def _solver(self, J: Array, front: _Front, at: Index) -> ChosenSystem:
        """The closure equations of some variants; where their choice of rows and columns is a poor one, another is taken."""
        solver = ChosenSystem(J, self.choices, front.which[at])
        for _ in range(2):
            worst = int(np.argmax(solver.condition))
            if solver.condition[worst] < FAIR:
                break
            self.choices.append(choose(J[:, :, worst], self.columns, keep=self.keep))
            poor = np.flatnonzero(solver.condition > FAIR)
            other = ChosenSystem(J[:, :, poor], [self.choices[-1]], np.zeros(poor.size, dtype=np.intp))
            better = poor[other.condition < 0.2 * solver.condition[poor]]
            if len(self.choices[-1].cols) != len(self.choices[0].cols) or not better.size:
                self.choices.pop()
                break
            # whether a singular position was passed is asked of the old choice, for the last time
            old = self._square(J[:, :, better], front.which[at[better]])
            front.lost[at[better[singular_between(front.square[:, :, at[better]], old)]]] = True
            front.which[at[better]] = len(self.choices) - 1
            front.square[:, :, at[better]] = self._square(J[:, :, better], front.which[at[better]])
            solver = ChosenSystem(J, self.choices, front.which[at])
        return solver

    def _square(self, J: Array, which: Index) -> Array:
        """The chosen parts ``(n, n, T)`` of matrices ``J``, each by its own choice."""
        n = len(self.choices[0].cols)
        out = np.empty((n, n, J.shape[2]))
        for i in np.unique(which):
            at = np.flatnonzero(which == i)
            out[:, :, at] = J[np.ix_(self.choices[i].rows, self.choices[i].cols, at)]
        return out

    def _settle(self, out: _Front, solver: ChosenSystem, at: Index, done: Mask, J: Array) -> None:
        """Sensitivities of variants that are where they should be; those that passed a singular position fell out."""
        Z = solver.solve(-J[:, self.columns])
        Z[self.columns, np.arange(len(self.columns))] = 1.0
        out.Z[:, :, at[done]] = Z[:, :, done]
        square = self._square(J, out.which[at])
        passed = np.zeros(at.size, dtype=bool)
        passed[done] = singular_between(out.square[:, :, at[done]], square[:, :, done])
        out.square[:, :, at[done]] = square[:, :, done]
        out.lost[at[done & (passed | (solver.condition > POOR))]] = True

    # --- the start of every variant ------------------------------------------------------------------------------------------

    def begin(self, x: Array, lead: Callable[[float], System], out: Mask) -> Array:
        """Closed states ``(nx, V)`` of all variants from that of the mechanism itself ``x (nx,)``; sets ``self.front``.

        ``lead(s)`` is the system with numbers on the way from the mechanism itself (0) to the variants (1); those ``out (V,)``
        are left out.
        """
        V = self.system.par.batch
        first = lead(0.0).at(np.repeat(x[:, None], V, axis=1))
        self.choices = [choose(first.J[:, :, 0], self.columns, keep=self.keep)]
        which = np.zeros(V, dtype=np.intp)
        square = self._square(first.J, which)
        nothing = np.zeros((self.system.n_freedoms, len(self.columns), V))
        start = _Front(np.repeat(x[:, None], V, axis=1), nothing, which, square, out)
        goal, done = start, out.copy()
        system = self.system
        for strides in STRIDES:
            front = _Front(start.x, start.Z, start.which.copy(), start.square.copy(), done.copy())
            for s in np.linspace(0.0, 1.0, strides + 1)[1:]:
                self.system = lead(float(s))
                front = self._corrected(front, front.x)
            arrived = ~front.lost & ~done
            if strides == STRIDES[0]:
                goal = front
            for name in ("x", "Z", "which", "square"):
                getattr(goal, name)[..., arrived] = getattr(front, name)[..., arrived]
            done |= arrived
            if done.all():
                break
        self.system = system
        goal.lost = ~done | out
        self.front = goal
        return goal.x

    # --- the path ----------------------------------------------------------------------------------------------------------

    def follow(self, values: Array) -> Steps:
        """All variants from where they began through driver values ``(d, V, N)``."""
        d, V, N = values.shape
        out = np.full((self.system.n_state, V, N), np.nan)
        which = np.zeros((V, N), dtype=np.intp)
        front = self.front
        between, place_between, place, steps = [front.x], [0], [], 0
        for n in range(N):
            begin = front.x[self.rows]
            change = values[:, :, n] - begin
            longest = np.sqrt((change * change).sum(axis=0))[~front.lost].max(initial=0.0)
            parts = max(1, int(np.ceil(longest / LONGEST)))
            for part in range(1, parts + 1):
                front = self._stepped(front, begin + part / parts * change)
                steps += 1
                if part < parts:
                    between.append(front.x)
                    place_between.append(steps)
            place.append(steps)
            out[:, :, n], which[:, n] = front.x, front.which
        places = (np.array(place_between, dtype=float), np.array(place, dtype=float))
        return Steps(out, which, self.choices, front.lost, np.stack(between, axis=2), *places)

    def _stepped(self, front: _Front, drive: Array) -> _Front:
        change = drive - front.x[self.rows]
        if not change[:, ~front.lost].any():
            return front
        x = self.system.advance(front.x, _ahead(front, change))
        x[self.rows] = drive
        following = self._corrected(front, x)
        changed = following.which != front.which
        past = []
        for Z, step in ((front.Z, change), *front.past[: PAST - 1]):
            Z = np.where(changed, following.Z, Z) if changed.any() else Z
            past.append((Z, step))
        following.past = tuple(past)
        return following


def _ahead(front: _Front, change: Array) -> Array:
    """Increments ``(F, V)`` for a step in driver space: the sensitivities of the last places, extrapolated and integrated.

    ``dq = h r_0 + h^2 / 2 [r_0, r_1] + (h^3 / 3 + h_1 h^2 / 2) [r_0, r_1, r_2]`` with divided differences of the rates r along the
    step; from the past only what goes straight on and is not much shorter counts.
    """
    h = np.sqrt((change * change).sum(axis=0))
    u = change / np.where(h > 0, h, 1.0)
    here = np.einsum("fdv,dv->fv", front.Z, u)
    out = h * here
    newer, slope, back, straight = here, None, np.zeros_like(h), h > 0
    for Z, step in front.past:
        length = np.sqrt((step * step).sum(axis=0))
        straight = straight & ((step * u).sum(axis=0) > STRAIGHT * length) & (h < LONGER * length)
        if not straight.any():
            break
        older = np.einsum("fdv,dv->fv", Z, u)
        first = np.where(straight, (newer - older) / np.where(length > 0, length, 1.0), 0.0)
        if slope is None:
            out += 0.5 * h**2 * first
            slope = first
        else:
            out += np.where(straight, (h**3 / 3 + 0.5 * back * h**2) / np.where(straight, back + length, 1.0), 0.0) * (
                slope - first
            )
        newer, back = older, back + length
    return np.asarray(out)
