"""The closure equations of a batch of positions by independent rows and columns: dense inverses, all positions of a choice together."""

from __future__ import annotations

import weakref
from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index
from mechgraph.numerics.linear import Choice, ChosenSystem, choose, parabola_is_regular, scaled_norm
from mechgraph.numerics.tolerances import PATH

TRIES = 8
"""Choices tried for a batch at most."""


def independent(here: Configuration, Z: Array) -> bool:
    """Whether the rates ``Z (F, d, T)`` for unit rates of the fixed columns meet all rows: the fixed columns move independently."""
    left = [np.abs(here.closure_rates(Z[:, i])).max(initial=0.0) for i in range(Z.shape[1])]
    return max(left, default=0.0) <= PATH.independent * max(1.0, float(np.abs(Z).max(initial=0.0)))


class DenseFactored:
    """Inverses of the independent rows and columns, all positions of a form together."""

    complete = True

    def __init__(self, solver: DenseSolver, here: Configuration, which: Index, chosen: ChosenSystem) -> None:
        self.solver, self.here, self.which, self._chosen = solver, here, which, chosen

    @property
    def condition(self) -> Array:
        """See the protocol in ``closure.solver``."""
        return self._chosen.condition

    def solve(self, b: Array) -> Array:
        """See the protocol in ``closure.solver``."""
        return self._chosen.solve(b)

    def solve_transposed(self, b: Array) -> Array:
        """See the protocol in ``closure.solver``."""
        return self._chosen.solve_transposed(b)

    def sensitivity(self) -> Array:
        """See the protocol in ``closure.solver``."""
        fixed = self.solver.fixed
        Z = self._chosen.solve(-self.here.J[:, fixed])
        Z[fixed, np.arange(len(fixed))] = 1.0
        return Z

    def motions(self) -> Array:
        """See the protocol in ``closure.solver``."""
        return self._chosen.null_of_columns()

    def self_stresses(self) -> Array:
        """See the protocol in ``closure.solver``."""
        return self._chosen.null_of_transpose()

    def regular_between(self, a: Configuration, b: Configuration) -> NDArray[np.bool_]:
        """See the protocol in ``closure.solver``."""
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
        """See the protocol in ``closure.solver``."""
        return self.solver.factored(here, self.which[at])

    def least(self, R: Sequence[scipy.sparse.csr_array], r0: Array) -> Array:
        """See the protocol in ``closure.solver``."""
        null = self.self_stresses()
        out = np.zeros((null.shape[0], self.here.T))
        for t in range(self.here.T):
            mixed = R[t] @ null[:, :, t]
            out[:, t] = null[:, :, t] @ np.linalg.lstsq(mixed, -r0[:, t], rcond=None)[0]
        return out

    def by_held(self) -> list[tuple[Index, Index]]:
        """See the protocol in ``closure.solver``."""
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
        self._last: tuple[weakref.ref[Configuration], ChosenSystem] | None = None

    def leaves_nothing_free(self, here: Configuration) -> bool:
        """See the protocol in ``closure.solver``."""
        which = self.chosen(here, np.full(here.T, -1))
        choice = self.choices[int(which[0])]
        f = self.factored(here, which)
        return not choice.held.size and bool((f.condition < PATH.doubtful).all()) and independent(here, f.sensitivity())

    def corrigible(self, dq: Array, which: Index) -> Array:
        """See the protocol in ``closure.solver``."""
        if not any(choice.held.size for choice in self.choices):
            return dq
        for i in np.unique(which):
            held = self.choices[i].held
            if held.size:
                dq[np.ix_(held, which == i)] = 0.0
        return dq

    def factored(self, here: Configuration, which: Index) -> DenseFactored:
        """See the protocol in ``closure.solver``; those of the last positions are kept for who asks next."""
        last = self._last_at(here)
        if last is None or not np.array_equal(last.which, which):
            last = ChosenSystem(here.J, self.choices, which.copy())
            self._last = weakref.ref(here), last
        return DenseFactored(self, here, last.which, last)

    def _last_at(self, here: Configuration) -> ChosenSystem | None:
        """The last factors, if they are of these positions."""
        return self._last[1] if self._last is not None and self._last[0]() is here else None

    def chosen(self, here: Configuration, which: Index) -> Index:
        """See ``ClosureSolver``; a new choice is taken where it is much better than the old one and of the same rank."""
        last = self._last_at(here)
        if last is not None and (which < 0).all():
            return last.which.copy()
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
            which = which.copy()
            which[better] = new
            if not better.size:
                break
        return which

    def alternative(self, here: Configuration, which: Index) -> Index:
        """See ``ClosureSolver``."""
        made = [choose(here.J[:, :, t], self.fixed, keep=self.keep) for t in range(here.T)]
        same = [len(new.cols) == len(self.choices[i].cols) for new, i in zip(made, which.tolist(), strict=True)]
        return np.array(
            [self._number(n) if ok else i for n, ok, i in zip(made, same, which, strict=True)], dtype=np.intp
        )

    def _number(self, choice: Choice) -> int:
        """The number of a choice, that of an equal one where there is one."""
        for i, known in enumerate(self.choices):
            if known.same(choice):
                return i
        self.choices.append(choice)
        return len(self.choices) - 1

    def _poorness(self, here: Configuration, which: Index) -> Array:
        """Condition number over what is fair, or where motions are held the largest rate over what is fair."""
        f = self.factored(here, which)
        out = f.condition / PATH.fair
        if any(self.choices[i].held.size for i in set(which.tolist())):
            motion = np.nan_to_num(np.abs(f.motions()).max(axis=(0, 1), initial=0.0), nan=np.inf)
            out = np.maximum(out, motion / PATH.held)
        return out
