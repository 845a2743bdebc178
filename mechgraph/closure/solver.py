"""The closure equations ``J q = b`` with some columns fixed, linear, for a batch of positions: one protocol, two engines behind it.

A *form* is what is decided once and serves many positions: which rows are independent and which columns are held (dense), or the
borders that make the matrix square (sparse). Positions name their form by its number.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index
from mechgraph.numerics.linear import Choice, ChosenSystem, choose, parabola_is_regular, scaled_norm
from mechgraph.numerics.tolerances import PATH


class FactoredClosure(Protocol):
    """The closure equations at a batch of positions, factored. ``m`` rows, ``F`` freedoms, ``T`` positions."""

    which: Index

    @property
    def condition(self) -> Array:
        """Condition numbers ``(T,)``."""

    def solve(self, b: Array) -> Array:
        """``q (F, k, T)`` with ``J q = b (m, k, T)``, zero in fixed and held columns."""

    def solve_transposed(self, b: Array) -> Array:
        """``x (m, k, T)`` with ``J^T x = b (F, k, T)`` in the columns neither fixed nor held."""

    def sensitivity(self) -> Array:
        """Rates ``Z (F, d, T)`` of all freedoms for unit rates of the fixed ones."""

    def motions(self) -> Array:
        """Motions ``(F, p, T)`` with the fixed columns at rest: one a held motion."""

    def self_stresses(self) -> Array:
        """Multipliers ``(m, s, T)`` with ``J^T x = 0`` in the columns not fixed: all of them (dense), or random ones (sparse)."""

    def regular_between(self, a: Configuration, b: Configuration) -> NDArray[np.bool_]:
        """Whether no matrix on the parabola through those at ``a``, here and at ``b`` is singular or nearly so, ``(T,)``."""

    def part(self, at: Index, here: Configuration) -> FactoredClosure:
        """Some of the positions, evaluated in ``here``."""

    def by_held(self) -> list[tuple[Index, Index]]:
        """Freedoms that are held (beside the fixed ones), and the positions at which they are."""


class ClosureSolver(Protocol):
    """The closure equations of one mechanism with the columns ``fixed``; makes and keeps forms."""

    fixed: Index
    engine: str

    def chosen(self, here: Configuration, which: Index) -> Index:
        """Forms ``(T,)`` for positions: ``which`` where these are good enough, new ones where they are not (or are -1)."""

    def factored(self, here: Configuration, which: Index) -> FactoredClosure:
        """The equations at positions, each in its form."""

    def held(self, form: int) -> Index:
        """Columns in which the motions left free are held, where they are held in columns."""


class DenseFactored:
    """Inverses of the independent rows and columns, all positions of a form together."""

    def __init__(self, solver: DenseSolver, here: Configuration, which: Index) -> None:
        self.solver, self.here, self.which = solver, here, which
        self._chosen = ChosenSystem(here.J, solver.choices, which)

    @property
    def condition(self) -> Array:
        return self._chosen.condition

    def solve(self, b: Array) -> Array:
        return self._chosen.solve(b)

    def solve_transposed(self, b: Array) -> Array:
        return self._chosen.solve_transposed(b)

    def sensitivity(self) -> Array:
        fixed = self.solver.fixed
        Z = self._chosen.solve(-self.here.J[:, fixed])
        Z[fixed, np.arange(len(fixed))] = 1.0
        return Z

    def motions(self) -> Array:
        return self._chosen.null_of_columns()

    def self_stresses(self) -> Array:
        return self._chosen.null_of_transpose()

    def regular_between(self, a: Configuration, b: Configuration) -> NDArray[np.bool_]:
        out = np.ones(self.here.T, dtype=bool)
        for (at, before), (_, behind) in zip(self._chosen.changes(a.J), self._chosen.changes(b.J), strict=True):
            # on the parabola |change| <= max of both ends; below one it is regular (Banach's lemma)
            regular = scaled_norm(np.maximum(np.abs(before), np.abs(behind))) <= PATH.departure
            rest = np.flatnonzero(~regular)
            if rest.size:
                E, G = before[..., rest], behind[..., rest]
                regular[rest] = parabola_is_regular(0.5 * (G - E), 0.5 * (E + G), 1.0 / PATH.departure - 1.0)
            out[at] = regular
        return out

    def part(self, at: Index, here: Configuration) -> DenseFactored:
        return DenseFactored(self.solver, here, self.which[at])

    def by_held(self) -> list[tuple[Index, Index]]:
        forms = np.unique(self.which)
        held = {tuple(self.solver.choices[i].held.tolist()): self.solver.choices[i].held for i in forms}
        same = {key: [i for i in forms if tuple(self.solver.choices[i].held.tolist()) == key] for key in held}
        return [(held[key], np.flatnonzero(np.isin(self.which, same[key]))) for key in held]


class DenseSolver:
    """Independent rows and columns chosen by pivoted QR; positions of poor condition get a choice made among them.

    Columns in ``keep`` are held rather than others, where that is no worse.
    """

    engine = "dense"

    def __init__(self, fixed: Index, keep: Index | None = None) -> None:
        self.fixed, self.keep = fixed, keep
        self.choices: list[Choice] = []

    def held(self, form: int) -> Index:
        return self.choices[form].held

    def factored(self, here: Configuration, which: Index) -> DenseFactored:
        return DenseFactored(self, here, which)

    def chosen(self, here: Configuration, which: Index) -> Index:
        """See ``ClosureSolver``; a new choice is taken where it is much better than the old one and of the same rank."""
        which = which.copy()
        for t in np.flatnonzero(which < 0):
            which[t] = self._number(choose(here.J[:, :, t], self.fixed, keep=self.keep))
        for _ in range(TRIES):
            poorness = self._poorness(here, which)
            poor = np.flatnonzero(poorness > 1.0)
            if not poor.size:
                break
            worst = int(poor[np.argmax(poorness[poor])])
            new = self._number(choose(here.J[:, :, worst], self.fixed))
            if new == which[worst]:
                break
            same_rank = np.array([len(self.choices[i].cols) == len(self.choices[new].cols) for i in which[poor]])
            trial = self._poorness(here.part(poor), np.full(poor.size, new))
            better = poor[same_rank & (trial < PATH.better * poorness[poor])]
            which[better] = new
            if not better.size:
                break
        return which

    def _number(self, choice: Choice) -> int:
        """The number of a choice, that of an equal one where there is one."""
        for i, known in enumerate(self.choices):
            if known.same(choice):
                return i
        self.choices.append(choice)
        return len(self.choices) - 1

    def _poorness(self, here: Configuration, which: Index) -> Array:
        """Condition number over what is fair, or where motions are held the largest rate over what is fair."""
        f = ChosenSystem(here.J, self.choices, which)
        out = f.condition / PATH.fair
        if any(self.choices[i].held.size for i in np.unique(which)):
            motion = np.nan_to_num(np.abs(f.null_of_columns()).max(axis=(0, 1), initial=0.0), nan=np.inf)
            out = np.maximum(out, motion / PATH.held)
        return out


TRIES = 8
"""Choices tried for a batch at most."""


def closure_solver(here: Configuration, fixed: Index, engine: str, keep: Index | None = None) -> ClosureSolver:
    """The solver for closed positions near ``here`` with the columns ``fixed``; freedoms ``keep`` are preferably held."""
    return DenseSolver(fixed, keep)
