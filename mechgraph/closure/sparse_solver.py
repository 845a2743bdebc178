"""The closure equations of a batch of positions by sparse factors, one a position, of a bordered system (see ``closure.bordering``)."""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.bordering import LoopSystem
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.dense_solver import independent
from mechgraph.closure.indexing import Index
from mechgraph.closure.loop_rows import ClosureRows
from mechgraph.numerics.sparse import Pattern, SparseFactor
from mechgraph.numerics.tolerances import PATH

PROBES = 6
"""Random self-stresses that represent all of them at every position: a component in which none has a part is unique but for chance."""
SEED = 5
POWERS = 5
"""Steps of the power iteration that estimates a spectral radius."""


class SparseFactored:
    """Factors of every position, each in its bordering."""

    complete = False

    def __init__(self, solver: SparseSolver, here: Configuration, which: Index) -> None:
        self.solver, self.here, self.which = solver, here, which
        self._forms = [solver.forms[i] for i in which.tolist()]
        self._factors = [solver.factor(here, t, number) for t, number in enumerate(which.tolist())]

    @classmethod
    def of(cls, solver: SparseSolver, here: Configuration, which: Index, factors: list[SparseFactor]) -> SparseFactored:
        """From factors that are known."""
        out = cls.__new__(cls)
        out.solver, out.here, out.which, out._factors = solver, here, which, factors
        out._forms = [solver.forms[i] for i in which.tolist()]
        return out

    @property
    def condition(self) -> Array:
        """An estimate from the smallest pivot against unit rows and columns, ``(T,)``."""
        return np.array([10.0 / max(factor.smallest_pivot, 1e-300) for factor in self._factors])

    def _each(self, solve: str, b: Array) -> Array:
        found = [
            getattr(form, solve)(factor, b[:, :, t])
            for t, (form, factor) in enumerate(zip(self._forms, self._factors, strict=True))
        ]
        rows = self.here.system.n_freedoms if solve == "solve" else self.here.system.n_rows
        return np.stack(found, axis=2) if found else np.empty((rows, b.shape[1], 0))

    def solve(self, b: Array) -> Array:
        """See ``FactoredClosure``."""
        return self._each("solve", b)

    def solve_transposed(self, b: Array) -> Array:
        """See ``FactoredClosure``."""
        return self._each("solve_transposed", b)

    def sensitivity(self) -> Array:
        """See ``FactoredClosure``."""
        fixed = self.solver.fixed
        F, T = self.here.system.n_freedoms, self.here.T
        Z = np.zeros((F, len(fixed), T))
        for i, column in enumerate(fixed):
            unit = np.zeros((F, T))
            unit[column] = 1.0
            Z[:, i] = self.solve(-self.here.closure_rates(unit)[:, None])[:, 0]
        Z[fixed, np.arange(len(fixed))] = 1.0
        return Z

    def motions(self) -> Array:
        """See ``FactoredClosure``."""
        found = [form.motions(factor) for form, factor in zip(self._forms, self._factors, strict=True)]
        return np.stack(found, axis=2) if found else np.empty((self.here.system.n_freedoms, 0, 0))

    def self_stresses(self) -> Array:
        """Random ones, of size one in the measure of every loop; none where there is no redundancy."""
        count = PROBES if any(form.redundant for form in self._forms) else 0
        out = np.zeros((self.here.system.n_rows, count, self.here.T))
        for t, (form, factor) in enumerate(zip(self._forms, self._factors, strict=True)):
            if count and form.redundant:
                rng = np.random.default_rng(SEED)
                out[:, :, t] = form.random_stress(factor, ClosureRows.at(self.here, t), rng, count)
        return out

    def least(self, R: Sequence[scipy.sparse.csr_array], r0: Array) -> Array:
        """``[R^T R  J; J^T  0] [x; z] = [-R^T r0; 0]`` in the turned rows of the loops (Golub and Van Loan, section 12.1).

        Rows that hold the motions left free stand below those of J, with unknowns that come out as zero: without them z is not unique.
        """
        out = np.zeros((self.here.system.n_rows, self.here.T))
        for t, form in enumerate(self._forms):
            turned = form.turned_rows
            part = R[t] @ turned
            H = scipy.sparse.coo_array(part.T @ part)
            J = scipy.sparse.coo_array(
                scipy.sparse.vstack([form.turned_matrix(ClosureRows.at(self.here, t)), form.holding])
            )
            rows, size = J.shape[0], sum(J.shape)
            pattern = Pattern(
                np.concatenate([H.row, J.row, rows + J.col]).astype(np.intp),
                np.concatenate([H.col, rows + J.col, J.row]).astype(np.intp),
                size,
            )
            right = np.zeros((size, 1))
            right[: H.shape[0], 0] = -(part.T @ r0[:, t])
            found = pattern.factor(np.concatenate([H.data, J.data, J.data])).solve(right)[: H.shape[0], 0]
            out[:, t] = turned @ found
        return out

    def regular_between(self, a: Configuration, b: Configuration) -> NDArray[np.bool_]:
        """Whether the changes ``1 - A^-1 A_a`` and ``1 - A^-1 A_b`` have spectral radii below ``departure``, by power iteration.

        Borders may be singular where the loops are not: those that fail are asked again with borders of the very position.
        """
        out = self._departures(a, b) <= PATH.departure
        for t in np.flatnonzero(~out):
            one = np.array([t])
            here, ends = self.here.part(one), (a.part(one), b.part(one))
            alone = SparseSolver(self.solver.fixed, self.solver.keep)
            out[t] = alone.factored(here, alone.chosen(here, np.full(1, -1)))._departures(*ends)[0] <= PATH.departure
        return np.asarray(out)

    def _departures(self, a: Configuration, b: Configuration) -> Array:
        rng = np.random.default_rng(SEED)
        out = np.zeros(self.here.T)
        for other in (a, b):
            v = rng.normal(size=(self.here.system.n_freedoms, self.here.T))
            v[self.solver.fixed] = 0.0
            for _ in range(POWERS):
                size = np.sqrt((v * v).sum(axis=0))
                v = v / np.where(size > 0, size, 1.0)
                v = self.solve((self.here.closure_rates(v) - other.closure_rates(v))[:, None])[:, 0]
            out = np.maximum(out, np.sqrt((v * v).sum(axis=0)))
        return out

    def part(self, at: Index, here: Configuration) -> SparseFactored:
        """See ``FactoredClosure``."""
        return SparseFactored.of(self.solver, here, self.which[at], [self._factors[i] for i in at.tolist()])

    def by_held(self) -> list[tuple[Index, Index]]:
        """The freedoms that hold the passive motions, at all positions."""
        return [(self.solver.keep, np.arange(self.here.T))]


class SparseSolver:
    """Borderings chosen where they are needed; a position whose pivots become small against those of its form gets a new one."""

    engine = "sparse"

    def __init__(self, fixed: Index, keep: Index | None = None) -> None:
        self.fixed, self.keep = fixed, np.zeros(0, dtype=np.intp) if keep is None else keep
        self.forms: list[LoopSystem] = []
        self._last: tuple[weakref.ref[Configuration], dict[tuple[int, int], SparseFactor]] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Without what is kept of the last positions: it refers to them weakly, and is computed again."""
        return vars(self) | {"_last": None}

    def factor(self, here: Configuration, t: int, number: int) -> SparseFactor:
        """A position factored in a form; what is known of the last positions is kept for who asks next."""
        known = self._known(here)
        if (t, number) not in known:
            known[t, number] = self.forms[number].factor(ClosureRows.at(here, t))
        return known[t, number]

    def _known(self, here: Configuration) -> dict[tuple[int, int], SparseFactor]:
        if self._last is None or self._last[0]() is not here:
            self._last = weakref.ref(here), {}
        return self._last[1]

    def leaves_nothing_free(self, here: Configuration) -> bool:
        """See the protocol in ``closure.solver``."""
        which = self.chosen(here, np.full(here.T, -1))
        form = self.forms[int(which[0])]
        return form.regular and not form.held and independent(here, self.factored(here, which).sensitivity())

    def begun(self, here: Configuration) -> SparseSolver:
        """See ``ClosureSolver``."""
        out = SparseSolver(self.fixed, self.keep)
        out.forms = list(self.forms)
        out._last = self._last and (weakref.ref(here), dict(self._last[1]))
        return out

    def corrigible(self, dq: Array, which: Index) -> Array:
        """See ``ClosureSolver``."""
        for i in np.unique(which):
            if self.forms[i].held:
                mine = which == i
                dq[:, mine] = self.forms[i].unheld(dq[:, mine])
        return dq

    def factored(self, here: Configuration, which: Index) -> SparseFactored:
        """See ``ClosureSolver``."""
        return SparseFactored(self, here, which)

    def chosen(self, here: Configuration, which: Index) -> Index:
        """See ``ClosureSolver``."""
        which = which.copy()
        for t in range(here.T):
            known = [which[t]] if which[t] >= 0 else range(len(self.forms) - 1, -1, -1)
            fits = [int(i) for i in known if self.factor(here, t, int(i)).smallest_pivot > self.forms[i].pivot_limit][
                :1
            ]
            if not fits:
                form = LoopSystem.at(here if here.T == 1 else here.part(np.array([t])), self.fixed)
                if which[t] < 0 or form.smallest > 5.0 * self.factor(here, t, int(which[t])).smallest_pivot:
                    self.forms.append(form)
                    fits = [len(self.forms) - 1]
                    self._known(here)[t, fits[0]] = form.first
            which[t] = fits[0] if fits else which[t]
        return which
