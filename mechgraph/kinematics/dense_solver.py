"""The closure equations of a batch of positions by independent rows and columns: dense inverses, all positions of a choice together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.kinematics.state import Configuration, lengths_of
from mechgraph.maths.linear import (
    RANK_TOLERANCE,
    Choice,
    ChosenSystem,
    choose,
    complement,
    parabola_is_regular,
    scaled_norm,
)
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import PATH

TRIES = 8
"""Choices tried for a batch at most."""


def independent(here: Configuration, Z: Array) -> bool:
    """Whether the rates ``Z (F, d, T)`` for unit rates of the fixed columns meet all rows: the fixed columns move independently."""
    left = [np.abs(here.closure_rates(Z[:, i])).max(initial=0.0) for i in range(Z.shape[1])]
    return max(left, default=0.0) <= PATH.independent * max(1.0, float(np.abs(Z).max(initial=0.0)))


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
    size = lengths_of(s.graph, here.pair_points[:, :, t], here.middles[:, :, t])
    # factor by which a loop is smaller or larger than L from which on its rows are taken over its own size
    own_size = 2.0
    if not ((size * own_size < 1.0) | (size > own_size)).any():
        return None
    rows, columns = np.ones(s.n_rows), np.ones(s.n_freedoms)
    rows[: 6 * len(size)].reshape(-1, 2, 3)[:, 1] = 2.0 ** np.round(-np.log2(size))[:, None]
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
        return not free and bool((f.condition < PATH.doubtful).all()) and independent(here, f.sensitivity())

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
        for _ in range(TRIES):
            poorness = self._poorness(here, which)
            poor = np.flatnonzero(poorness > 1.0)
            if not poor.size:
                break
            worst = int(poor[np.argmax(poorness[poor])])
            self.forms.append(form_at(here.J[:, :, worst], self.fixed, None, own_scale(here, worst)))
            new = len(self.forms) - 1
            same_rank = np.array(
                [len(self.forms[i].choice.cols) == len(self.forms[new].choice.cols) for i in which[poor]]
            )
            trial = self._poorness(here.part(poor), np.full(poor.size, new))
            better = poor[same_rank & (trial < PATH.better * poorness[poor])]
            which = which.copy()
            which[better] = new
            if not better.size:
                self.forms.pop()
                break
        return which

    def _fitting(self, here: Configuration, t: int) -> int:
        """The number of a form for one position: one of the last where that fits as well, or one made there."""
        J = here.J[:, :, t]
        made = form_at(J, self.fixed, self.keep, own_scale(here, t))
        for i in range(len(self.forms) - 1, max(-1, len(self.forms) - 1 - TRIES), -1):
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
