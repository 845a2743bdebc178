"""The closure equations, linear, solved and ranked: two protocols, a dense and a sparse engine behind each.

``J q = b`` with some columns fixed, for a batch of positions.

A *form* is what is decided once and serves many positions: which rows are independent and which columns are held (dense), or the
borders that make the matrix square (sparse). Positions name their form by its number.

Rank, motions and self-stresses at one position. Both engines start from the reduced rows ``K`` of all loops (``kinematics.loop_rows``), so
that a self-stress of a single loop is the same in both:

    rank J = rank K,   J q = 0  <=>  K (q / scale) = 0,   J^T x = 0  <=>  x = local self-stresses + those with K^T y = 0.

Dense: singular values of K. Sparse: the bordered system (``kinematics.sparse_system``) where its pivots prove the rank, otherwise the
elimination along the loops (``kinematics.sparse_system``).
"""

from __future__ import annotations

import weakref
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Literal, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.graph.linkgraph import labels_of_bipartite, members
from mechgraph.kinematics.sparse_system import Elimination, Factored, LoopSystem
from mechgraph.kinematics.state import ClosureRows, ClosureSolver, Configuration, ReducedRows, lengths_of
from mechgraph.maths.linear import (
    RANK_TOLERANCE,
    BlockFactor,
    Choice,
    ChosenSystem,
    Pattern,
    SparseFactors,
    choose,
    complement,
    parabola_is_regular,
    rank_of,
    scaled_norm,
    singular_ratio,
)
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import PATH, RANKS
from mechgraph.memo import dataclass


@dataclass(frozen=True)
class Form:
    """Rows turned by the orthogonal ``turn (m, m)`` so that the independent ones come first (None: all are), and a choice of those.

    Before, rows and columns are multiplied by ``scale (m,), (F,)`` (None: by one): displacements of a loop much smaller or larger than the
    mechanism are taken over its own size, and slides in it, so that the condition is that of the loop.

    The rows of a redundant loop are dependent in a way that changes as it moves; among turned rows the first ones stay independent until
    the column space has turned by a right angle, where rows picked out of them may not.
    """

    choice: Choice
    turn: Array | None
    scale: tuple[Array, Array] | None = None

    def rows(self, b: Array) -> Array:
        """``turn^T scale b`` for ``b (m, k, T)``."""
        b = b if self.scale is None else self.scale[0][:, None, None] * b
        return b if self.turn is None else (self.turn.T @ b.reshape(len(b), -1)).reshape(b.shape)

    def back(self, y: Array) -> Array:
        """``scale turn y``."""
        y = y if self.turn is None else (self.turn @ y.reshape(len(y), -1)).reshape(y.shape)
        return y if self.scale is None else self.scale[0][:, None, None] * y

    def columns(self, b: Array) -> Array:
        """Values ``b (F, k, T)`` of scaled columns: loads on them; or freedoms out of solutions for them."""
        return b if self.scale is None else self.scale[1][:, None, None] * b

    def matrix(self, J: Array) -> Array:
        """Turned rows and scaled columns of matrices ``(m, F, T)``."""
        J = self.rows(J)
        return J if self.scale is None else J * self.scale[1][:, None]

    def motions(self, system: ChosenSystem) -> Array:
        """Motions ``(F, held, T)``, each with a one in the column that is held."""
        found = self.columns(system.null_of_columns())
        return found if self.scale is None else found / self.scale[1][self.choice.held][:, None]


def form_at(J: Array, fixed: Index, keep: Index | None, scale: tuple[Array, Array] | None = None) -> Form:
    """The form chosen at one matrix ``(m, F)``: columns by pivoted QR, rows by the left singular vectors of these."""
    J = J if scale is None else scale[0][:, None] * J * scale[1]
    choice = choose(J, fixed, keep=keep)
    if len(choice.rows) == len(J):
        return Form(choice, None, scale)
    turn = np.linalg.svd(J[:, choice.cols], full_matrices=True)[0]
    return Form(replace(choice, rows=np.arange(len(choice.cols))), turn, scale)


def own_scale(here: Configuration, t: int) -> tuple[Array, Array] | None:
    """What takes displacements of loops over their own sizes, ``(rows,)`` and ``(F,)``, see ``Form``: powers of two.

    None where all loops are of about the length L: a position may take a loop far beyond that.
    """
    s = here.system
    graph, size = s.graph, lengths_of(s.graph, here.pair_points[:, :, t], here.middles[:, :, t])
    # factor by which a loop is smaller or larger than L from which on its rows are taken over its own size
    own_size = 2.0
    if not ((size * own_size < 1.0) | (size > own_size)).any():
        return None
    rows, columns = np.ones(s.n_rows), np.ones(s.n_freedoms)
    rows[: graph.loop_rows].reshape(-1, graph.width)[:, graph.turns :] = 2.0 ** np.round(-np.log2(size))[:, None]
    unit = np.abs(rows[:, None] * here.J[:, s.is_length, t]).max(axis=0, initial=0.0)
    columns[s.is_length] = 2.0 ** np.round(-np.log2(np.where(unit > 0.0, unit, 1.0)))
    return rows, columns


class DenseFactored:
    """Inverses of the independent rows and columns, all positions of a form together."""

    dense = complete = True
    groups = 0

    def __init__(self, forms: list[Form], fixed: Index, J: Array, which: Index) -> None:
        self.J, self.which = J, which
        self.rows, self.freedoms, self.T = J.shape
        self._forms, self._fixed = forms, fixed

    @cached_property
    def _parts(self) -> list[tuple[Form, Index, ChosenSystem]]:
        """The positions by form, and their equations."""
        forms, J, which = self._forms, self.J, self.which
        used = list(dict.fromkeys(which.tolist()))
        places = [np.arange(self.T)] if len(used) == 1 else [np.flatnonzero(which == i) for i in used]
        return [
            (forms[i], at, _chosen(forms[i].matrix(_at(J, at)), forms[i].choice))
            for i, at in zip(used, places, strict=True)
        ]

    def _joined(self, values: list[Array], shape: tuple[int, ...]) -> Array:
        """Values of the forms at all positions."""
        if len(values) == 1:
            return values[0]
        width = max((value.shape[1] for value in values if value.ndim == 3), default=0)
        out = np.zeros((shape[0], width, self.T) if len(shape) > 1 else (self.T,))
        for (_, at, _), value in zip(self._parts, values, strict=True):
            out[(..., at) if value.ndim < 3 else (slice(None), slice(0, value.shape[1]), at)] = value
        return out

    @property
    def condition(self) -> Array:
        """See the protocol in ``kinematics.state``."""
        return self._joined([system.condition for _, _, system in self._parts], (self.T,))

    def solve(self, b: Array) -> Array:
        """See the protocol in ``kinematics.state``."""
        found = [form.columns(system.solve(form.rows(_at(b, at)))) for form, at, system in self._parts]
        return self._joined(found, (self.freedoms, b.shape[1]))

    def solve_transposed(self, b: Array) -> Array:
        """See the protocol in ``kinematics.state``."""
        found = [form.back(system.solve_transposed(form.columns(_at(b, at)))) for form, at, system in self._parts]
        return self._joined(found, (self.rows, b.shape[1]))

    def residual_size(self, r: Array) -> Array:
        """See the protocol in ``kinematics.state``."""
        out = np.zeros(self.T)
        for form, at, _ in self._parts:
            out[at] = np.abs(form.rows(r[:, None, at])).max(axis=(0, 1), initial=0.0)
        return out

    def sensitivity(self) -> Array:
        """See the protocol in ``kinematics.state``."""
        Z = self.solve(-self.J.take(self._fixed, axis=1))
        Z[self._fixed, np.arange(len(self._fixed))] = 1.0
        return Z

    def motions(self) -> Array:
        """See the protocol in ``kinematics.state``."""
        return self._joined([form.motions(system) for form, _, system in self._parts], (self.freedoms, 0))

    def self_stresses(self, every: bool = False) -> Array:
        """See the protocol in ``kinematics.state``."""
        found = [form.back(system.null_of_transpose()) for form, _, system in self._parts]
        return self._joined(found, (self.rows, 0))

    def regular_between(self, ends: Configuration, a: Index, b: Index) -> NDArray[np.bool_]:
        """See the protocol in ``kinematics.state``."""
        out = np.ones(self.T, dtype=bool)
        for form, at, system in self._parts:
            matrices = [form.matrix(_at(J, at)) for J in (self.J, ends.J.take(a, -1), ends.J.take(b, -1))]
            if form.turn is not None:
                # turned rows may be singular where the loop is not: the rows independent at these very positions are asked
                matrices = _independent_rows(matrices, form.choice)
                whole = np.arange(len(form.choice.cols))
                system = _chosen(matrices[0], Choice(whole, whole, whole[:0], whole[:0]))
            before, behind = (system.change(matrix) for matrix in matrices[1:])
            # on the parabola |change| <= max of both ends; below one it is regular (Banach's lemma)
            regular = scaled_norm(np.maximum(np.abs(before), np.abs(behind))) <= PATH.departure
            rest = np.flatnonzero(~regular)
            if rest.size:
                E, G = before[..., rest], behind[..., rest]
                regular[rest] = parabola_is_regular(0.5 * (G - E), 0.5 * (E + G), 1.0 / PATH.departure - 1.0)
            out[at] = regular
        return out

    def part(self, at: Index, here: Configuration) -> DenseFactored:
        """See the protocol in ``kinematics.state``."""
        return DenseFactored(self._forms, self._fixed, self.J[:, :, at], self.which[at])

    def least(self, R: Sequence[scipy.sparse.csr_array], r0: Array) -> Array:
        """See the protocol in ``kinematics.state``."""
        null = self.self_stresses()
        out = np.zeros((null.shape[0], self.T))
        for t in range(self.T):
            mixed = R[t] @ null[:, :, t]
            out[:, t] = null[:, :, t] @ np.linalg.lstsq(mixed, -r0[:, t], rcond=None)[0]
        return out

    def by_held(self) -> list[tuple[Index, Index]]:
        """See the protocol in ``kinematics.state``."""
        same: dict[tuple[int, ...], list[Index]] = {}
        for form, at, _ in self._parts:
            same.setdefault(tuple(form.choice.held.tolist()), []).append(at)
        return [(np.array(held, dtype=np.intp), np.sort(np.concatenate(at))) for held, at in same.items()]


def _independent_rows(matrices: list[Array], choice: Choice) -> list[Array]:
    """The chosen columns of matrices ``(m, F, T)`` in an orthonormal basis of those of the first, ``(n, n, T)`` each."""
    columns = [np.moveaxis(matrix[:, choice.cols], -1, 0) for matrix in matrices]
    Q = np.linalg.qr(columns[0])[0]
    return [np.moveaxis(np.swapaxes(Q, 1, 2) @ matrix, 0, -1) for matrix in columns]


def _fits(form: Form, J: Array) -> bool:
    """Whether the turned rows of a form are as independent at a matrix ``(m, F)`` as they should be."""
    return bool(_chosen(form.matrix(J[:, :, None]), form.choice).condition[0] <= PATH.fair)


def _chosen(A: Array, choice: Choice) -> ChosenSystem:
    """Matrices ``(m, n, T)`` in one choice of rows and columns."""
    return ChosenSystem(A, [choice], np.zeros(A.shape[2], dtype=np.intp))


def _at(values: Array, at: Index) -> Array:
    """Some of the positions, without a copy where these are all."""
    return values if len(at) == values.shape[-1] else values[..., at]


class DenseSolver:
    """Independent rows and columns; positions of poor condition get a form made at one of them.

    Columns in ``keep`` are held rather than others, where that is no worse.
    """

    engine = "dense"

    def __init__(self, fixed: Index, keep: Index | None = None) -> None:
        self.fixed, self.keep = fixed, keep
        self.forms: list[Form] = []

    def leaves_nothing_free(self, here: Configuration) -> bool:
        """See the protocol in ``kinematics.state``."""
        which = self.chosen(here, np.full(here.T, -1))
        f = self.factored(here, which)
        free = self.forms[int(which[0])].choice.held.size
        return not free and bool((f.condition < PATH.doubtful).all()) and here.meets_all_rows(f.sensitivity())

    def begun(self, here: Configuration) -> DenseSolver:
        """See the protocol in ``kinematics.state``."""
        out = DenseSolver(self.fixed, self.keep)
        out.forms = list(self.forms)
        return out

    def corrigible(self, dq: Array, which: Index) -> Array:
        """See the protocol in ``kinematics.state``."""
        for i in set(which.tolist()):
            held = self.forms[i].choice.held
            if held.size:
                dq[np.ix_(held, which == i)] = 0.0
        return dq

    def factored(self, here: Configuration, which: Index) -> DenseFactored:
        """See the protocol in ``kinematics.state``."""
        return DenseFactored(self.forms, self.fixed, here.J, which.copy())

    def chosen(self, here: Configuration, which: Index) -> Index:
        """See ``ClosureSolver``; a new form is taken where it is much better than the old one and of the same rank."""
        which = which.copy()
        left = np.flatnonzero(which < 0)
        while left.size:
            number = self._fitting(here, int(left[0]))
            which[left[0]], left = number, left[1:]
            if left.size:
                fits = self._serves(number, here.part(left))
                which[left[fits]], left = number, left[~fits]
        for _ in range(8):  # choices tried for a batch at most
            poorness = self._poorness(here, which)
            poor = np.flatnonzero(poorness > 1.0)
            if not poor.size:
                break
            worst = int(poor[np.argmax(poorness[poor])])
            self.forms.append(form_at(here.J[:, :, worst], self.fixed, None, own_scale(here, worst)))
            new = len(self.forms) - 1
            counts = [len(form.choice.cols) for form in self.forms]
            same_rank = np.array([counts[i] == counts[new] for i in which[poor]])
            trial = self._poorness(here.part(poor), np.full(poor.size, new))
            better = poor[same_rank & (trial < PATH.better * poorness[poor])]
            which[better] = new
            if not better.size:
                self.forms.pop()
                break
        return which

    def _fitting(self, here: Configuration, t: int) -> int:
        """The number of a form for one position: one of the last where that fits as well, or one made there."""
        made = form_at(J := here.J[:, :, t], self.fixed, self.keep, own_scale(here, t))
        for i in reversed(range(max(0, len(self.forms) - 8), len(self.forms))):
            known = self.forms[i]
            if known.choice.same(made.choice) and (known.turn is None or _fits(known, J)):
                return i
        self.forms.append(made)
        return len(self.forms) - 1

    def _serves(self, number: int, here: Configuration) -> NDArray[np.bool_]:
        """At which positions a form made at another one is fair, and of their rank."""
        fair = self._poorness(here, np.full(here.T, number)) <= 1.0
        rank, free = len(self.forms[number].choice.cols), complement(self.fixed, here.J.shape[1])
        if fair.any() and rank < min(len(here.J), free.size):
            sigma = np.linalg.svd(np.moveaxis(here.J[:, free], -1, 0), compute_uv=False)
            fair &= (sigma > RANK_TOLERANCE * sigma[:, :1]).sum(axis=1) == rank
        return np.asarray(fair)

    def _poorness(self, here: Configuration, which: Index) -> Array:
        """Condition number over what is fair, or where motions are held the largest rate over what is fair."""
        f = self.factored(here, which)
        out = f.condition / PATH.fair
        if any(self.forms[i].choice.held.size for i in np.unique(which)):
            motion = np.nan_to_num(np.abs(f.motions()).max(axis=(0, 1), initial=0.0), nan=np.inf)
            out = np.maximum(out, motion / PATH.held)
        return np.asarray(out)


PROBES = 6
"""Random self-stresses that represent all of them at every position: a component in which none has a part is unique but for chance."""
SEED = 5


Part = tuple[LoopSystem, Index, Factored]
"""A bordering, the positions in it, and these factored."""


class SparseFactored:
    """Factors of every position in its bordering, all positions of a bordering together."""

    dense = False

    def __init__(self, solver: SparseSolver, here: Configuration, which: Index, parts: list[Part]) -> None:
        self.solver, self.here, self.which, self._parts = solver, here, which, parts
        self.complete = max((form.redundant for form, _, _ in parts), default=0) <= PROBES
        self.groups = max((form.groups.blocks for form, _, f in parts if isinstance(f, BlockFactor)), default=0)

    def _joined(self, values: list[Array], rows: int, width: int = 0) -> Array:
        """Values ``(rows, k, T)`` of the borderings at all positions, zero where one has fewer columns."""
        if len(values) == 1:
            return values[0]
        out = np.zeros((rows, max([width, *(value.shape[1] for value in values)]), self.here.T))
        for (_, at, _), value in zip(self._parts, values, strict=True):
            out[:, : value.shape[1], at] = value
        return out

    @property
    def condition(self) -> Array:
        """An estimate from the smallest pivot against unit rows and columns, ``(T,)``."""
        smallest = self._joined([factors.smallest_pivot[None, None] for _, _, factors in self._parts], 1, 1)
        return np.asarray(10.0 / np.maximum(smallest[0, 0], 1e-300))

    def solve(self, b: Array) -> Array:
        """See ``FactoredClosure``."""
        found = [form.solve(factors, b[:, :, at]) for form, at, factors in self._parts]
        return self._joined(found, self.here.system.n_freedoms, b.shape[1])

    def solve_transposed(self, b: Array) -> Array:
        """See ``FactoredClosure``."""
        found = [form.solve_transposed(factors, b[:, :, at]) for form, at, factors in self._parts]
        return self._joined(found, self.here.system.n_rows, b.shape[1])

    def residual_size(self, r: Array) -> Array:
        """See ``FactoredClosure``."""
        out = np.zeros(self.here.T)
        for form, at, _ in self._parts:
            out[at] = np.abs(form.kept_part(r[:, at])).max(axis=0, initial=0.0)
        return out

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
        found = [form.motions(factors, len(at)) for form, at, factors in self._parts]
        return self._joined(found, self.here.system.n_freedoms)

    def self_stresses(self, every: bool = False) -> Array:
        """Random ones, of size one in the measure of every loop, as many as there are where these are few or ``every`` is asked for."""
        rows, found = self.here.system.n_rows, []
        for form, at, factors in self._parts:
            count = form.redundant if every or self.complete else PROBES if form.redundant else 0
            some = ClosureRows.of(self.here, at)
            found.append(
                form.random_stress(factors, some, np.random.default_rng(SEED), count)
                if count
                else np.zeros((rows, 0, len(at)))
            )
        return self._joined(found, rows)

    def least(self, R: Sequence[scipy.sparse.csr_array], r0: Array) -> Array:
        """``[R^T R  J; J^T  0] [x; z] = [-R^T r0; 0]`` in the turned rows of the loops (Golub and Van Loan, section 12.1).

        Rows that hold the motions left free stand below those of J, with unknowns that come out as zero: without them z is not unique.
        """
        out = np.zeros((self.here.system.n_rows, self.here.T))
        for t, number in enumerate(self.which.tolist()):
            form = self.solver.forms[number]
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

    def regular_between(self, ends: Configuration, a: Index, b: Index) -> NDArray[np.bool_]:
        """Whether the changes ``1 - A^-1 A_a`` and ``1 - A^-1 A_b`` have spectral radii below ``departure``, by power iteration.

        Borders may be singular where the loops are not: those that fail are asked again with borders of the very position.
        """
        sides = ends.part(a), ends.part(b)
        out = self._departures(*sides) <= PATH.departure
        for t in np.flatnonzero(~out):
            one = np.array([t])
            here, beside = self.here.part(one), [side.part(one) for side in sides]
            alone = SparseSolver(self.solver.fixed, self.solver.keep, self.solver.forms[0])
            out[t] = alone.factored(here, alone.chosen(here, np.full(1, -1)))._departures(*beside)[0] <= PATH.departure
        return np.asarray(out)

    def _departures(self, a: Configuration, b: Configuration) -> Array:
        rng = np.random.default_rng(SEED)
        out = np.zeros(self.here.T)
        for other in (a, b):
            v = rng.normal(size=(self.here.system.n_freedoms, self.here.T))
            v[self.solver.fixed] = 0.0
            # steps of the power iteration that estimates a spectral radius
            for _ in range(5):
                size = np.sqrt((v * v).sum(axis=0))
                v = v / np.where(size > 0, size, 1.0)
                v = self.solve((self.here.closure_rates(v) - other.closure_rates(v))[:, None])[:, 0]
            out = np.maximum(out, np.sqrt((v * v).sum(axis=0)))
        return out

    def part(self, at: Index, here: Configuration) -> SparseFactored:
        """See ``FactoredClosure``."""
        place, parts = np.full(len(self.which), -1), list[Part]()
        place[at] = np.arange(len(at))
        for form, mine, factors in self._parts:
            some = np.flatnonzero(place[mine] >= 0)
            if some.size:
                parts.append((form, place[mine[some]], factors.part(some)))
        return SparseFactored(self.solver, here, self.which[at], parts)

    def by_held(self) -> list[tuple[Index, Index]]:
        """The freedoms that hold the passive motions, at all positions."""
        return [(self.solver.keep, np.arange(self.here.T))]


class SparseSolver:
    """Borderings chosen where they are needed; a position whose pivots become small against those of its form gets a new one.

    All are of the rank of the first one, or of one that they are to be ``like``.
    """

    engine = "sparse"

    def __init__(self, fixed: Index, keep: Index | None = None, like: LoopSystem | None = None) -> None:
        self.fixed, self.keep = fixed, np.zeros(0, dtype=np.intp) if keep is None else keep
        self.like = like
        self.forms: list[LoopSystem] = []
        self._last: tuple[weakref.ref[Configuration], dict[int, tuple[Index, Factored]]] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Without what is kept of the last positions: it refers to them weakly, and is computed again."""
        return vars(self) | {"_last": None}

    def _factors(self, here: Configuration, number: int, at: Index) -> Factored:
        """Positions factored in a form; what is known of the last positions is kept for who asks next."""
        known = self._known(here)
        before, factors = known.get(number, (at[:0], None))
        if factors is None or not np.isin(at, before).all():
            before, factors = known[number] = at, self.forms[number].factors(here, at)
        return factors if np.array_equal(before, at) else factors.part(np.searchsorted(before, at))

    def _known(self, here: Configuration) -> dict[int, tuple[Index, Factored]]:
        if self._last is None or self._last[0]() is not here:
            self._last = weakref.ref(here), {}
        return self._last[1]

    def leaves_nothing_free(self, here: Configuration) -> bool:
        """See the protocol in ``kinematics.state``."""
        which = self.chosen(here, np.full(here.T, -1))
        form = self.forms[int(which[0])]
        return form.regular and not form.held and here.meets_all_rows(self.factored(here, which).sensitivity())

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
        parts = []
        for number in dict.fromkeys(which.tolist()):
            at = np.flatnonzero(which == number)
            parts.append((self.forms[number], at, self._factors(here, number, at)))
        return SparseFactored(self, here, which, parts)

    def chosen(self, here: Configuration, which: Index) -> Index:
        """See ``ClosureSolver``."""
        which = which.copy()
        poor = np.flatnonzero(which >= 0)
        for number in dict.fromkeys(which[poor].tolist()):
            poor = np.setdiff1d(poor, self._fitting(here, number, np.flatnonzero(which == number)))
        new = np.flatnonzero(which < 0)
        for number in range(len(self.forms) - 1, -1, -1):
            fits = self._fitting(here, number, new) if new.size else new
            which[fits], new = number, np.setdiff1d(new, fits)
        while new.size:
            self._make(here, int(new[0]))
            fits = np.union1d(new[:1], self._fitting(here, len(self.forms) - 1, new)) if new.size > 1 else new
            which[fits], new = len(self.forms) - 1, np.setdiff1d(new, fits)
        for t in poor.tolist():
            before = self.forms[which[t]].factor(ClosureRows.at(here, t)).smallest_pivot
            self._make(here, t)
            if self.forms[-1].smallest > 5.0 * before:
                which[t] = len(self.forms) - 1
            else:
                self.forms.pop()
        return which

    def _fitting(self, here: Configuration, number: int, at: Index) -> Index:
        """Those of the positions that a form fits."""
        return at[self.forms[number].fits(self._factors(here, number, at))]

    def _make(self, here: Configuration, t: int) -> None:
        """A form made at a position."""
        at = np.array([t])
        part, like = here if here.T == 1 else here.part(at), self.forms[0] if self.forms else self.like
        self.forms.append(LoopSystem.like(like, part) if like else LoopSystem.of_rank(part, self.fixed))
        self._known(here)[len(self.forms) - 1] = at, SparseFactors([self.forms[-1].first])


EngineName = Literal["auto", "dense", "sparse"]
ENGINES: tuple[EngineName, ...] = ("auto", "dense", "sparse")
MotionEngineName = Literal["auto", "compiled", "dense", "sparse"]
"""Engines of calls that follow a motion; what is at hand where ``compiled`` serves is the numpy engine that ``auto`` takes."""
SPARSE_ROWS = {1.0: 120, 20.0: 84, 50.0: 60, 400.0: 42, np.inf: 36}
"""Closure rows from which on ``auto`` takes the sparse engine, for up to so many positions.

Measured by ``tests/benchmarks/bench_large.py --crossover`` on ladders of four-bars: both engines take the same time at 110 rows (one
position), 80 (16 positions), 62 (36), 36 (200) and 24 (1000), where the sparse one goes group by group. A platform on six legs (30 rows,
one group) takes a quarter more with the sparse one at 1000 positions, so that this many rows stay with the dense one.
"""


def engine_for(rows: int, positions: int, engine: str) -> Literal["dense", "sparse"]:
    """The engine that runs: the one asked for, or the one that is faster for the size."""
    if engine in ENGINES[1:]:
        return "dense" if engine == "dense" else "sparse"
    limit = next(limit for most, limit in SPARSE_ROWS.items() if positions <= most)
    return "sparse" if rows >= limit else "dense"


def solver_at_start(
    engine: Literal["dense", "sparse"], fixed: Index, start: Configuration
) -> tuple[ClosureSolver, bool]:
    """The solver with the columns ``fixed``, and whether it proves at a start that they leave nothing free.

    What was chosen and factored there is kept with the start, for the next call with the same columns.
    """
    key = engine, fixed.tobytes()
    found = start.solvers.get(key)
    if found is None:
        solver = closure_solver(engine, fixed)
        proved = solver.leaves_nothing_free(start)
        start.solvers.clear()  # other threads may ask for what is kept here
        found = start.solvers[key] = solver.begun(start), proved
    solver, proved = found
    return solver.begun(start), proved


def closure_solver(engine: Literal["dense", "sparse"], fixed: Index, keep: Index | None = None) -> ClosureSolver:
    """The solver with the columns ``fixed``; freedoms ``keep`` are preferably held where motions are left free."""
    return DenseSolver(fixed, keep) if engine == "dense" else SparseSolver(fixed, keep)


class RankSolution(Protocol):
    """What an engine determines about ``K``: self-stresses and motions in the kept rows and scaled free columns."""

    rank: int
    dropped: float

    def stresses(self, shares: Array) -> Array:
        """``y (height, k)`` with ``K^T y = 0`` for shares ``(height - rank, k)`` of the self-stresses."""

    def motions(self) -> Array:
        """A basis of the ``q / scale`` with ``K (q / scale) = 0``, ``(free columns, nullity)``."""


class _Dense:
    def __init__(self, K: Array, tolerance: float) -> None:
        s, self._U, self._Vt = np.zeros(0), np.eye(K.shape[0]), np.eye(K.shape[1])
        if K.size:
            self._U, s, self._Vt = np.linalg.svd(K)
        self.rank = rank_of(s, tolerance)
        rest = s[self.rank :]
        self.dropped = float(rest[0] / s[0]) if rest.size and s[0] > 0 else 0.0

    def stresses(self, shares: Array) -> Array:
        return np.asarray(self._U[:, self.rank :] @ shares)

    def motions(self) -> Array:
        return np.asarray(self._Vt[self.rank :].T)


class _Bordered:
    def __init__(self, loops: LoopSystem) -> None:
        self.loops, self.rank, self.dropped = loops, loops.rank, 0.0

    def stresses(self, shares: Array) -> Array:
        return self.loops.connecting_stress(self.loops.first, shares)

    def motions(self) -> Array:
        q = self.loops.motions(SparseFactors([self.loops.first]), 1)[:, :, 0]
        return np.asarray((q / self.loops.scale[:, None])[self.loops.free])


class ClosureRank:
    """Rank, motions and self-stresses of the closure equations at one position, the columns ``fixed`` left out.

    ``rank``; ``count`` number of rows; ``dropped`` largest value that counted as zero, as part of the largest; ``shared`` number of
    self-stresses that connect loops; ``engine`` which one ran.
    """

    def __init__(
        self, reduced: ReducedRows, solution: RankSolution, tolerance: float, engine: Literal["dense", "sparse"]
    ) -> None:
        self.reduced, self._solution, self._tolerance, self.engine = reduced, solution, tolerance, engine
        self.rank, self.count = solution.rank, reduced.rows.count
        self.shared = reduced.height - solution.rank
        self.dropped = max(solution.dropped, reduced.dropped)

    @cached_property
    def margin(self) -> float:
        """Smallest singular value of K that was kept, as part of the largest; 1 where there is none."""
        return singular_ratio(self.reduced.matrix, self.rank, lambda: self.reduced.least_norm) if self.rank else 1.0

    @cached_property
    def motions(self) -> Array:
        """Orthonormal motions ``(F, M)`` with the fixed columns at rest."""
        r = self.reduced
        y = self._solution.motions()
        out = np.zeros((len(r.free), y.shape[1]))
        out[r.free] = np.linalg.qr(y * r.scale[r.free][:, None])[0]
        return out

    # --- self-stresses -----------------------------------------------------------------------------------------------------

    @cached_property
    def local(self) -> tuple[Index, Array, Index]:
        """Loops with self-stresses of their own ``(n,)``, their wrenches ``(width, width, n)`` of which some count, and how many."""
        some, wrenches = self.reduced.local_stress()
        return some, wrenches, self.reduced.width - self.reduced.kept[some]

    def connecting(self, shares: Array) -> Array:
        """Self-stresses ``(rows, k)`` that connect loops, for shares ``(shared, k)``; none has a part in the local ones."""
        return self.reduced.multipliers(self._solution.stresses(shares))

    def random_stress(self, rng: np.random.Generator, count: int) -> Array:
        """Random self-stresses ``(rows, count)``, each with a part of every one; of size one in the measure of their loops."""
        r = self.reduced
        kept = self._solution.stresses(rng.normal(size=(self.shared, count)))
        dropped = rng.normal(size=(r.width * r.loops - int(r.kept.sum()), count))
        size = np.maximum(np.abs(kept).max(axis=0, initial=0.0), 1.0)
        return r.multipliers(kept / size, dropped / size)

    def orthonormal_stress(self) -> Array:
        """All self-stresses ``(rows, count - rank)``, orthonormal in the measure of the loops."""
        r = self.reduced
        kept = np.linalg.qr(self._solution.stresses(np.eye(self.shared)))[0]
        own = r.width * r.loops - int(r.kept.sum())
        dropped = np.concatenate([np.zeros((own, self.shared)), np.eye(own)], axis=1)
        return r.multipliers(np.concatenate([kept, np.zeros((len(kept), own))], axis=1), dropped)

    @cached_property
    def sets(self) -> tuple[tuple[int, tuple[int, ...]], ...]:
        """(number of self-stresses, loops) of every set of loops that self-stresses can connect."""
        own = self.reduced.width - self.reduced.kept
        connected = self._connected_blocks() if self.shared else []
        taken = np.zeros(len(own), dtype=bool)
        out = []
        for blocks in connected:
            loops = [i for i in blocks if i < len(own)]
            taken[loops] = True
            count = self.shared if len(connected) == 1 else self._shared_in(blocks)
            out.append((count + int(own[loops].sum()), tuple(loops)))
        out += [(int(own[i]), (int(i),)) for i in np.flatnonzero(~taken & (own > 0))]
        return tuple(sorted(out, key=lambda item: item[1]))

    def _connected_blocks(self) -> list[list[int]]:
        """Loops (and further rows) with parts of self-stresses that connect loops: those that share freedoms belong together."""
        r = self.reduced
        probe = np.abs(self._solution.stresses(np.random.default_rng(23).normal(size=(self.shared, 1))))[:, 0]
        size = np.zeros(r.loops + r.rows.further)
        np.maximum.at(size, r.owners, probe)
        # part of a random self-stress below which a row has none
        some = np.flatnonzero(size > 1e-9 * size.max())
        K = r.matrix.tocoo()
        touch = scipy.sparse.csr_array((np.ones(K.nnz), (r.owners[K.row], K.col)), shape=(len(size), K.shape[1]))
        return [some[part].tolist() for part in members(labels_of_bipartite(touch[some]))]

    def _shared_in(self, blocks: list[int]) -> int:
        """Number of self-stresses that connect only these blocks: their rows minus the rank of these."""
        rows = np.flatnonzero(np.isin(self.reduced.owners, blocks))
        found = Elimination(self.reduced.matrix[rows], self.reduced.owners[rows], self._tolerance)
        return len(rows) - found.rank


def closure_rank(here: Configuration, fixed: Index | None = None, engine: EngineName = "auto") -> ClosureRank:
    """Rank, motions and self-stresses at the first position of a configuration, with the columns ``fixed`` at rest."""
    return rank_of_rows(ClosureRows.at(here), fixed, engine)


def rank_of_rows(
    rows: ClosureRows,
    fixed: Index | None = None,
    engine: EngineName = "auto",
    tolerance: float | None = None,
    proved: float | None = None,
) -> ClosureRank:
    """The same for rows given as such; a bordered system decides that is farther than ``tolerance`` from a singular one.

    Farther than ``RANKS.distance`` too where pivots are not above ``proved``.
    """
    fixed = np.zeros(0, dtype=np.intp) if fixed is None else fixed
    tolerance = RANKS.position if tolerance is None else tolerance
    proved = RANKS.proved if proved is None else proved
    # rows from which ``auto`` takes the sparse engine: measured on verdicts of ladders and grids, where the two meet at 100 to 240 rows
    if engine == "dense" or not rows.count or (engine == "auto" and rows.count < 144):
        reduced = ReducedRows(rows, fixed)
        return ClosureRank(reduced, _Dense(reduced.matrix.toarray(), tolerance), tolerance, "dense")
    bordered = LoopSystem(rows, fixed)
    if bordered.first.distance > max(0.0 if bordered.smallest > proved else RANKS.distance, tolerance):
        return ClosureRank(bordered, _Bordered(bordered), tolerance, "sparse")
    reduced = ReducedRows(rows, fixed)
    return ClosureRank(reduced, Elimination(reduced.matrix, reduced.owners, tolerance), tolerance, "sparse")
