"""Which reactions are unique: states of self-stress, their components and directions.

The reaction components and driver efforts of a mechanism in one row of numbers, and their parts in self-stresses.
A component is counted pair by pair in the order of declaration: the reaction components of the pair table, then the efforts of driven
freedoms. With the basis of all components and efforts of a pair at its point, ``w = [W, E] (lambda, tau)``, one inverse a pair gives
both.

Self-stresses as a sparse basis over reaction components, the same at any size, and the groups of states that share components.
The basis depends on the space of self-stresses and on the order of declaration only: those of every single loop in reduced echelon
form, loop by loop, then those that connect loops (without any part in the former) in reduced echelon form together.

Directions in which the force or moment of a pair is unique though its components are not.
``Fx`` and ``Fy`` in an arbitrary marker frame may both be called not unique where only the force in one direction across the axis
is. So the components of one kind in one frame are taken as a vector; the directions in which no self-stress has a part are found
and named. Pairs of one type with the same components in doubt are decomposed together.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from mechgraph.force.reactions import PairFrames, at_pair_points
from mechgraph.graph.linkgraph import labels_of_bipartite
from mechgraph.kinematics.solver import PROBES, SEED, ClosureRank, EngineName, closure_rank
from mechgraph.kinematics.state import Configuration
from mechgraph.kinematics.touching import ContactLines, pretension_conditions
from mechgraph.maths.se3 import Array, Index, null_space
from mechgraph.maths.tolerances import STRESSES
from mechgraph.memo import dataclass
from mechgraph.model.belts import pretensions
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Pair
from mechgraph.pairs.factors import Component

Label = tuple[str, str]


class Components:
    """Places of the components at one position; ``first (P + 1,)`` the first of every pair, ``count`` of them all."""

    def __init__(self, configuration: Configuration, driven: Index) -> None:
        self.configuration, self.system = configuration, configuration.system
        widths = np.diff(self.system.first_column)
        self._driven = np.zeros(self.system.n_freedoms, dtype=bool)
        self._driven[driven] = True
        owner = np.repeat(np.arange(len(widths)), widths)
        efforts = np.bincount(owner[self._driven], minlength=len(widths))
        self.first = np.concatenate([[0], np.cumsum(self.system.graph.width - widths + efforts)]).astype(np.intp)
        self.count = int(self.first[-1])

    @cached_property
    def owners(self) -> Index:
        """The pair of every component."""
        return np.repeat(np.arange(len(self.first) - 1), np.diff(self.first))

    @property
    def efforts(self) -> Index:
        """Places of the driver efforts, which stand last in their pair."""
        last = self.first[1:] - self.first[:-1] - (self.system.graph.width - np.diff(self.system.first_column))
        some = np.flatnonzero(last)
        return np.concatenate(
            [np.arange(self.first[k + 1] - last[k], self.first[k + 1]) for k in some.tolist()] or [some]
        )

    @cached_property
    def labels(self) -> list[Label]:
        """(pair, component) of all components."""
        return [label for k in range(len(self.system.m.pairs)) for label in self._labels_of(k)]

    def label(self, i: int) -> Label:
        """(pair, component) of one of them."""
        k = int(np.searchsorted(self.first, i, side="right")) - 1
        return self._labels_of(k)[i - int(self.first[k])]

    def _labels_of(self, k: int) -> list[Label]:
        own = slice(*self.system.first_column[k : k + 2])
        return labels_of(self.system.m.pairs[k], np.flatnonzero(self._driven[own]))

    @cached_property
    def _rows(self) -> list[Array]:
        """For every group the inverses of ``[W, E]`` at the pair points ``(n, width, width)``."""
        return [inverse[:, 0] for inverse in PairFrames(self.configuration).dual]

    def _spread(self, g: int, pairs: Index, values: Array, out: Array, at: Index) -> None:
        """Components ``values (width, n, ...)`` of pairs of group ``g``, driven efforts last, into ``out`` from the rows ``at (n,)`` on."""
        group = self.system.groups[g]
        plain = group.row.held
        for j in range(plain):
            out[at + j] = values[j]
        place = at + plain
        columns = self.system.first_column[pairs]
        for j in range(group.row.f):
            on = self._driven[columns + j]
            out[place[on]] = values[plain + j][on]
            place = place + on

    def table(self, wrenches: Array) -> Array:
        """Parts ``(count, s)`` in total pair wrenches ``(6, P, s, 1)``."""
        local = at_pair_points(self.configuration, wrenches)[self.system.graph.span, ..., 0]
        out = np.zeros((self.count, wrenches.shape[2]))
        for g, (group, inverse) in enumerate(zip(self.system.groups, self._rows, strict=True)):
            values = np.einsum("nij,jns->ins", inverse, local[:, group.pairs])
            self._spread(g, group.pairs, values, out, self.first[group.pairs])
        return out

    def of_loops(self, closure: ClosureRank) -> list[tuple[Index, Index, Array]]:
        """Self-stresses of single loops, loops of one shape together: loops ``(n,)``, places ``(n, c)`` and parts ``(n, c, s)``."""
        some, wrenches, counts = closure.local
        if not some.size:
            return []
        loop, pair, sign = self.system.graph.loop_steps
        number = np.full(self.system.graph.n_loops, -1)
        number[some] = np.arange(some.size)
        mine = np.flatnonzero(number[loop] >= 0)
        order = np.lexsort((pair[mine], number[loop[mine]]))
        steps, loops = mine[order], number[loop[mine[order]]]
        width = np.diff(self.first)[pair[steps]]
        starts = np.concatenate([[0], np.cumsum(width)])
        values = self._along(pair[steps], sign[steps] * wrenches[:, :, loops], loop[steps], starts[:-1])
        within = np.arange(starts[-1]) - np.repeat(starts[:-1], width)
        places = np.repeat(self.first[pair[steps]], width) + within
        begin = starts[np.searchsorted(loops, np.arange(some.size + 1))]
        out = []
        shapes = np.stack([np.diff(begin), counts], axis=1)
        for c, s in np.unique(shapes, axis=0):
            mine = np.flatnonzero((shapes == (c, s)).all(axis=1))
            at = begin[mine][:, None] + np.arange(c)
            out.append((some[mine], places[at], values[at][:, :, :s]))
        return out

    def _along(self, pairs: Index, wrenches: Array, loop: Index, at: Index) -> Array:
        """Parts ``(all places, width)`` in wrenches ``(width, width states, steps)`` of pairs in loops, each from its place ``at`` on."""
        s, span = self.system, self.system.graph.span
        out = np.zeros((int(at[-1] + np.diff(self.first)[pairs[-1]]), s.graph.width))
        points = (self.configuration.pair_points[:, pairs] - self.configuration.middles[:, loop])[:, :, 0]
        whole = np.zeros((6, *wrenches.shape[1:]))
        whole[span] = wrenches
        whole[:3] -= np.cross(points[:, None], whole[3:], axis=0)
        local = whole[span]
        group = np.empty(len(s.m.pairs), dtype=np.intp)
        for g, members in enumerate(s.groups):
            group[members.pairs] = g
        group = group[pairs]
        for g, inverse in enumerate(self._rows):
            mine = np.flatnonzero(group == g)
            place = np.searchsorted(s.groups[g].pairs, pairs[mine])
            self._spread(g, pairs[mine], np.einsum("nij,jsn->ins", inverse[place], local[:, :, mine]), out, at[mine])
        return out


def labels_of(pair: Pair, driven: Index) -> list[Label]:
    """(pair, component) of the reaction components of a pair, then of the efforts of its freedoms ``driven`` (numbers)."""
    out = [(pair.name, name) for name in pair.type.component_names]
    if len(driven) == 1:
        return [*out, (pair.name, "effort")]
    return out + [(pair.name, f"effort {pair.type.freedoms[j].name}") for j in driven]


def _sum_of(terms: Mapping[str, float]) -> str:
    """A sum of named terms in one line, ``A:Fz - 0.5 B:Fz``."""
    return " ".join(
        f"{'-' if v < 0 else '+'} {'' if abs(abs(v) - 1) < 5e-4 else f'{abs(v):.3g} '}{name}"
        for name, v in terms.items()
    ).removeprefix("+ ")


@dataclass(frozen=True, repr=False)
class SelfStress:
    """A reaction state without load: coefficients by ``pair:component``, the largest 1, moments divided by L so that they compare."""

    components: Mapping[str, float]
    efforts: Mapping[str, float]
    group: int = 0

    @property
    def text(self) -> str:
        """The state in one line."""
        return _sum_of({**self.components} | {f"effort {name}": value for name, value in self.efforts.items()})

    def __repr__(self) -> str:
        return f"SelfStress({self.text!r})"


@dataclass(frozen=True)
class MisfitSum:
    """Errors of seats that must cancel, ``sum c_i misfit_i = 0``, or else lock in forces: one condition a self-stress.

    coefficients : by ``pair.component``, the largest of a force 1; of a moment, whose misfit is an angle, a length.
    force_per_unit : force in the component with coefficient 1 for a sum of one, as the stiffness of the pairs says while all other sums
        are zero; NaN where no stiffness takes part.
    """

    coefficients: Mapping[str, float]
    force_per_unit: float

    @property
    def text(self) -> str:
        """The note for a drawing."""
        known = np.isfinite(self.force_per_unit)
        return f"these errors must cancel: {_sum_of(self.coefficients)}" + (
            f"; one unit of it locks in {self.force_per_unit:.4g}" if known else ""
        )

    def __repr__(self) -> str:
        return f"MisfitSum({self.text!r})"


def misfit_sums(m: Mechanism, states: Sequence[SelfStress], L: float) -> tuple[MisfitSum, ...]:
    """The conditions of a basis of self-stresses; ``L`` the length by which their moments are divided."""
    names = list(dict.fromkeys(name for state in states for name in state.components))
    N = np.array([[state.components.get(name, 0.0) for name in names] for state in states])
    arm = np.array([L if name.rpartition(":")[2].startswith("M") else 1.0 for name in names])
    soft, loose = np.zeros(len(names)), np.zeros(len(names), dtype=bool)
    for j, name in enumerate(names):
        pair, _, component = name.rpartition(":")
        seat = m.pair(pair).stiffness
        k = np.inf if seat is None else seat.by_component.get(component, np.inf)
        soft[j], loose[j] = (0.0, True) if k == 0.0 else (arm[j] ** 2 / k, False)
    # components of stiffness 0 carry nothing: states without them, or sums of states in which they cancel
    borne = N[~N[:, loose].any(axis=1)]
    sums = scipy.linalg.null_space(N[:, loose].T).T @ N if loose.any() else borne
    if len(sums) > len(borne):
        sums /= np.abs(sums).max(axis=1, keepdims=True)
        borne = np.where(np.abs(sums) > STRESSES.shown, sums, 0.0)
    strain, force = (borne * soft) @ borne.T, np.full(len(borne), np.nan)
    if len(borne) and np.linalg.matrix_rank(strain, hermitian=True) == len(borne):
        force = np.diag(np.linalg.inv(strain))
    return tuple(
        MisfitSum(
            {name.replace(":", "."): float(c * a) for name, c, a in zip(names, row, arm, strict=True) if c}, float(f)
        )
        for row, f in zip(borne, force, strict=True)
    )


@dataclass(frozen=True)
class Basis:
    """Self-stresses ``states (components, s)``, sorted by ``group (s,)``; states that share a component belong together.

    ``groups`` is their number; ``partly`` are those not all of whose states are here.
    """

    states: scipy.sparse.csc_array
    group: Index
    groups: int
    partly: frozenset[int]

    def state(self, i: int, labels: list[Label]) -> SelfStress:
        """One state by names."""
        at = slice(int(self.states.indptr[i]), int(self.states.indptr[i + 1]))
        parts = [
            (labels[c], float(v))
            for c, v in zip(self.states.indices[at].tolist(), self.states.data[at], strict=True)
            if abs(v) > STRESSES.shown
        ]
        return SelfStress(
            {f"{pair}:{name}": v for (pair, name), v in parts if not name.startswith("effort")},
            {f"{pair}{name[6:].replace(' ', '.')}": v for (pair, name), v in parts if name.startswith("effort")},
            int(self.group[i]),
        )


def basis_of(count: int, parts: list[tuple[Index, Index, Array]], connected: list[Index]) -> Basis:
    """The basis from self-stresses ``(n, c, s)`` in places ``(n, c)``, in the order of their numbers ``(n,)``.

    Each list of places ``connected`` belongs to one group, by states that are not given.
    """
    keys = np.concatenate([np.zeros(0, dtype=np.intp), *(np.repeat(key, v.shape[2]) for key, _, v in parts)])
    column_of = np.empty(len(keys), dtype=np.intp)
    column_of[np.argsort(keys, kind="stable")] = np.arange(len(keys))
    rows, columns, data, at = [np.zeros(0, dtype=np.intp)], [np.zeros(0, dtype=np.intp)], [np.zeros(0)], 0
    for _, places, values in parts:
        n, _, s = values.shape
        made = canonical(values)
        k, i, j = np.nonzero(made)
        rows.append(places[k, i])
        columns.append(column_of[at + k * s + j])
        data.append(made[k, i, j])
        at += n * s
    row, column, value = np.concatenate(rows), np.concatenate(columns), np.concatenate(data)
    states = scipy.sparse.csc_array((value, (row, column)), shape=(count, at))
    shown = np.abs(value) > STRESSES.shown
    ties = np.repeat(np.arange(len(connected)), [len(p) for p in connected])
    touch = scipy.sparse.coo_array(
        (
            np.ones(int(shown.sum()) + len(ties)),
            (np.concatenate([column[shown], at + ties]), np.concatenate([row[shown], *connected])),
        ),
        shape=(at + len(connected), count),
    )
    group = labels_of_bipartite(touch)
    order = np.argsort(group[:at], kind="stable")
    return Basis(states[:, order], group[:at][order], int(group.max(initial=-1)) + 1, frozenset(group[at:].tolist()))


def combinations(basis: Basis, labels: list[Label], known: set[int]) -> tuple[tuple[tuple[int, str], ...], int]:
    """Per group the sums of components that are unique though their terms are not; ``known`` components are left out.

    A component that a combination found before ties to others of its pair is determined by it, so it is among ``known``.
    Also returned: the number of groups that have too many components for it.
    """
    out, unsought = [], 0
    starts = np.searchsorted(basis.group, np.arange(basis.groups + 1))
    for group in range(basis.groups):
        mine = basis.states[:, starts[group] : starts[group + 1]]
        touched = [int(i) for i in np.unique(mine.indices[np.abs(mine.data) > STRESSES.shown]) if int(i) not in known]
        # number of components of a group up to which combinations across pairs are computed
        if len(touched) > 300 or group in basis.partly:
            unsought += 1
            continue
        rows = mine.tocsr()[touched].toarray()
        for column in canonical(null_space(rows.T, 1e-9)[None])[0].T:
            terms = {
                ":".join(labels[i]): float(v) for i, v in zip(touched, column, strict=True) if abs(v) > STRESSES.shown
            }
            out.append((group, SelfStress(terms, {}).text))
    return tuple(out), unsought


def canonical(columns: Array) -> Array:
    """Sparse bases of column spaces ``(n, c, s)`` that depend on the spaces and the order of their rows only.

    Reduced echelon form taken from the first row on and from the last row on; the sparser is kept. Columns are scaled so that
    their largest entry is one.
    """
    if not columns.size:
        return columns
    forward, backward = _echelon(columns), _echelon(columns[:, ::-1])[:, ::-1]
    terms = [(np.abs(A) > STRESSES.shown).sum(axis=(1, 2)) for A in (forward, backward)]
    best = np.where((terms[0] <= terms[1])[:, None, None], forward, backward)
    best = best / np.maximum(np.abs(best).max(axis=1, keepdims=True), 1e-300)
    first = np.argmax(np.abs(best) > 1 - 1e-9, axis=1)
    best = best * np.sign(np.take_along_axis(best, first[:, None], axis=1))
    return np.where(np.abs(best) < 1e-9, 0.0, best)


def _echelon(columns: Array) -> Array:
    """Column echelon forms with unit pivots in the first rows that can have them (entries against the largest), all at once."""
    A = columns / np.maximum(np.abs(columns).max(axis=(1, 2), keepdims=True), 1e-300)
    n, _, s = A.shape
    each = np.arange(n)
    rows = np.arange(A.shape[1])
    for done in range(s):
        size = np.abs(A[:, :, done:]).max(axis=2)
        i = np.argmax(size >= STRESSES.shown, axis=1)
        A[:, :, done:] = np.where((rows[None] < i[:, None])[:, :, None], 0.0, A[:, :, done:])
        j = done + np.argmax(np.abs(A[each, i, done:]), axis=1)
        pivot = A[each, :, j]
        A[each, :, j] = A[:, :, done]
        height = pivot[each, i]
        pivot = pivot / np.where(np.abs(height) < STRESSES.shown, 1.0, height)[:, None]
        A[:, :, done] = 0.0
        A -= pivot[:, :, None] * A[each, i][:, None, :]
        A[:, :, done] = pivot
    return A


@dataclass(frozen=True)
class UniqueDirection:
    """Force or moment of ``pair`` that is unique along ``direction`` or (``across``) in every direction across it.

    ``direction`` in the axes of the marker frame in which the components stand, first entry that is not zero positive;
    ``in_space`` the same in the global frame.
    """

    pair: str
    kind: str
    direction: tuple[float, ...]
    across: bool
    in_space: tuple[float, ...]

    @property
    def text(self) -> str:
        """E.g. ``D: force along (0.6, 0.8, 0) is unique``."""
        shown = ", ".join(f"{0.0 if abs(v) < 5e-7 else v:.4g}" for v in self.direction)
        return f"{self.pair}: {self.kind} {'across' if self.across else 'along'} ({shown}) is unique"


def unique_directions(components: Components, table: Array) -> tuple[tuple[UniqueDirection, ...], set[int]]:
    """Directions unique in a pair though its components are not; and components that these make known from others.

    ``table (components, s)`` are the parts of the components in the self-stresses.
    """
    not_unique = (table**2).sum(axis=1) > STRESSES.unique**2
    named: list[tuple[tuple[int, int], UniqueDirection]] = []
    known: set[int] = set()
    for g, group in enumerate(components.system.groups):
        for order, ((frame, kind), axes, numbers) in enumerate(_vectors(group.row.reactions or ())):
            rows = components.first[group.pairs][:, None] + numbers
            for some, mine in _alike(not_unique[rows]):
                for i, unique in zip(some, _directions(table[rows[np.ix_(some, mine)]]), strict=True):
                    if unique.shape[1]:
                        pair = int(group.pairs[i])
                        R = components.configuration.frames[g][frame][:, :3, i, 0]
                        named.append(((pair, order), _named(components, pair, kind, axes[mine], unique, R)))
                        known |= set(_dependent(unique, rows[i, mine].tolist()))
    return tuple(direction for _, direction in sorted(named, key=lambda item: item[0])), known


def _vectors(reactions: tuple[Component, ...]) -> Iterator[tuple[tuple[int, str], Index, Index]]:
    """Components of one kind in one frame: (frame, kind), their axes and their numbers in the row of the pair."""
    out: dict[tuple[int, str], list[tuple[int, int]]] = {}
    for number, c in enumerate(reactions):
        axes = np.flatnonzero(c.wrench)
        if len(axes) == 1:
            kind = "moment" if axes[0] < 3 else "force"
            out.setdefault((c.frame, kind), []).append((int(axes[0]) % 3, number))
    for key, items in out.items():
        yield key, np.array([axis for axis, _ in items]), np.array([number for _, number in items])


def _alike(not_unique: Array) -> Iterator[tuple[Index, Index]]:
    """Pairs ``(n,)`` with the same two or more components that are not unique, and which these are."""
    code = not_unique @ (1 << np.arange(not_unique.shape[1]))
    for value in np.unique(code):
        mine = np.flatnonzero((value >> np.arange(not_unique.shape[1])) & 1)
        if len(mine) > 1:
            yield np.flatnonzero(code == value), mine


def _directions(rows: Array) -> list[Array]:
    """For every pair orthonormal combinations of its components ``(n, c, s)`` in which no self-stress has a part."""
    U, s, _ = np.linalg.svd(rows, full_matrices=True)
    size = np.zeros(U.shape[:2])
    size[:, : s.shape[1]] = s
    none = np.zeros((rows.shape[1], 0))
    out = [none] * len(rows)
    for i in np.flatnonzero((size <= STRESSES.unique).any(axis=1)):
        out[int(i)] = U[i][:, size[i] <= STRESSES.unique]
    return out


def _named(components: Components, pair: int, kind: str, axes: Index, unique: Array, R: Array) -> UniqueDirection:
    across = unique.shape[1] > 1
    inner = null_space(unique.T, 1e-9) if across else unique
    direction = np.zeros(3)
    direction[axes] = inner[:, 0]
    # entry of a unit direction that counts as zero for its sign
    direction = np.where(np.abs(direction) < 5e-13, 0.0, direction)
    direction = direction * np.sign(direction[np.flatnonzero(direction)[0]])
    name = components.system.m.pairs[pair].name
    return UniqueDirection(name, kind, tuple(direction.tolist()), across, tuple((R @ direction).tolist()))


def _dependent(unique: Array, rows: list[int]) -> list[int]:
    """As many components as there are unique directions: those that the others then give.

    By elimination with pivoting of the projector on these directions, which does not depend on their basis; of equal ones the last.
    """
    P, chosen = unique @ unique.T, []
    for _ in range(unique.shape[1]):
        size = np.diag(P)
        i = int(np.flatnonzero(size > (1 - 1e-6) * size.max())[-1])
        P = P - np.outer(P[:, i], P[i]) / P[i, i]
        chosen.append(rows[i])
    return chosen


CONNECTING = 200
"""Number of self-stresses that connect loops up to which they are computed; their echelon form is dense, of that width."""


@dataclass(frozen=True, repr=False)
class Uniqueness:
    """The verdict on reactions at one position; what is expensive is computed when first asked for.

    ``closure`` are the closure equations with the drivers at rest, ``table (components, probes)`` the parts of the components in
    self-stresses of size one in the measure of every loop, so that the verdict does not depend on how many loops there are: in an
    orthonormal basis of them, or in random ones where they are many; ``coupled (couplings, probes)`` the greatest effort of every
    coupling in them; ``probes`` are these self-stresses in the closure rows.
    """

    components: Components
    closure: ClosureRank
    table: Array
    coupled: Array
    probes: Array

    def __repr__(self) -> str:
        return f"Uniqueness({int(self.is_unique.sum())} of {len(self.is_unique)} components unique, {self.count} self-stresses)"

    @property
    def count(self) -> int:
        """Number of self-stresses with the drivers in place."""
        return self.closure.count - self.closure.rank

    @cached_property
    def sizes(self) -> Array:
        """Part in the self-stresses of every component, in the order of ``components.labels``, and then of every coupling."""
        return np.sqrt((np.concatenate([self.table, self.coupled]) ** 2).sum(axis=1))

    @property
    def is_unique(self) -> NDArray[np.bool_]:
        """Whether each component is unique, in the order of ``components.labels``."""
        return self.sizes[: self.components.count] <= STRESSES.unique

    @property
    def coupling_is_unique(self) -> NDArray[np.bool_]:
        """Whether the multiplier of each coupling is unique, in order of declaration."""
        return self.sizes[self.components.count :] <= STRESSES.unique

    def is_unique_on(self, twists: Array) -> bool:
        """Whether the power of every pair's total wrench on ``twists (6, n)`` about the internal origin is unique, and every multiplier."""
        states = _on_every_flank(self.components.configuration, self.probes)
        power = np.einsum("in,ips->nps", twists, np.concatenate(states, axis=2)[..., 0])
        return bool(np.abs(power).max(initial=0.0) <= STRESSES.unique and self.coupling_is_unique.all())

    @property
    def all_unique(self) -> bool:
        """Whether every reaction component, effort and multiplier is unique."""
        return bool((self.sizes <= STRESSES.unique).all())

    @property
    def margin(self) -> float:
        """Smallest part of a self-stress in what is not unique; 1 where all is."""
        return float(self.sizes[self.sizes > STRESSES.unique].min(initial=1.0))

    @property
    def dropped(self) -> float:
        """Largest part of a self-stress in what is called unique."""
        return float(self.sizes[self.sizes <= STRESSES.unique].max(initial=0.0))

    @property
    def is_near(self) -> bool:
        """Whether a small change of dimensions may change what is unique at the same rank: parts come continuously from zero."""
        return self.margin < STRESSES.near or self.dropped > STRESSES.doubt

    @property
    def most_doubtful(self) -> tuple[str, float, bool]:
        """What has the part nearest to the limit (by ratio): its name, this part, and whether it is called unique."""
        size = np.maximum(self.sizes, np.finfo(float).tiny)
        i = int(np.argmin(np.abs(np.log(size / STRESSES.unique))))
        known = self.components
        behind = i - known.count
        name = ":".join(known.label(i)) if behind < 0 else f"coupling {known.system.m.couplings[behind].name}"
        return name, float(self.sizes[i]), bool(self.sizes[i] <= STRESSES.unique)

    @cached_property
    def unique(self) -> dict[str, dict[str, bool]]:
        """Pair -> component -> whether it is unique; ``effort`` (or ``effort Tz``) for driven freedoms and for couplings."""
        out: dict[str, dict[str, bool]] = {pair.name: {} for pair in self.components.system.m.pairs}
        for (pair, name), ok in zip(self.components.labels, self.is_unique.tolist(), strict=True):
            out[pair][name] = ok
        for coupling, ok in zip(self.components.system.m.couplings, self.coupling_is_unique.tolist(), strict=True):
            out[coupling.name] = {"effort": ok}
        return out

    @cached_property
    def basis(self) -> Basis:
        """Canonical sparse self-stresses: of single loops, then (up to ``CONNECTING``) those that connect loops."""
        local = self.components.of_loops(self.closure)
        shared = self.closure.shared
        if not shared:
            return basis_of(self.components.count, local, [])
        if shared > CONNECTING:
            return basis_of(self.components.count, local, self._places_of_sets())
        states = self.components.table(
            relieved_states(self.components.configuration, self.closure.connecting(np.eye(shared)), 1.0)
        )
        touched = np.flatnonzero(np.abs(states).max(axis=1) > STRESSES.unique * np.abs(states).max())
        number = np.array([self.components.system.graph.n_loops])
        return basis_of(self.components.count, [*local, (number, touched[None], states[touched][None])], [])

    def _places_of_sets(self) -> list[Index]:
        """For every set of connected loops the components there that are not unique."""
        loop, pair, _ = self.components.system.graph.loop_steps
        home = np.full(self.components.system.graph.n_loops, -1)
        sets = [loops for _, loops in self.closure.sets if len(loops) > 1]
        for number, loops in enumerate(sets):
            home[list(loops)] = number
        loose = ~self.is_unique
        steps = [pair[home[loop] == number] for number in range(len(sets))]
        return [np.flatnonzero(loose & np.isin(self.components.owners, pairs)) for pairs in steps]

    @property
    def groups(self) -> int:
        """Number of groups of self-stresses that share components."""
        return self.basis.groups

    @property
    def listed(self) -> int:
        """Number of self-stresses that can be listed: all but those that connect loops where these are more than ``CONNECTING``."""
        return len(self.basis.group)

    def first_states(self, count: int) -> tuple[SelfStress, ...]:
        """The first few self-stresses."""
        return tuple(self.basis.state(i, self.components.labels) for i in range(min(count, self.listed)))

    @cached_property
    def states(self) -> tuple[SelfStress, ...]:
        """All self-stresses that can be listed."""
        return self.first_states(self.listed)

    @cached_property
    def _directions(self) -> tuple[tuple[UniqueDirection, ...], set[int]]:
        return unique_directions(self.components, self.table)

    @property
    def unique_directions(self) -> tuple[UniqueDirection, ...]:
        """Directions of force and moment that are unique in a pair though its components are not."""
        return self._directions[0]

    @cached_property
    def _sums(self) -> tuple[tuple[tuple[int, str], ...], int]:
        return combinations(self.basis, self.components.labels, self._directions[1])

    @property
    def combinations(self) -> tuple[tuple[int, str], ...]:
        """Per group the further sums of components that are unique although their terms are not, as text."""
        return self._sums[0]

    @property
    def unsought(self) -> int:
        """Number of groups in which such sums were not sought, as they have too many components."""
        return self._sums[1]


def uniqueness(
    here: Configuration, driven: Index, engine: EngineName = "auto", closure: ClosureRank | None = None
) -> Uniqueness:
    """Which reaction components and efforts are unique: those in which no self-stress has a part, drivers in place.

    ``closure``, where it is known, is the rank of the closure equations with the drivers at rest. The self-stresses are the null space
    of ``[J^T, -E]``: of ``J^T`` in the columns that are not driven.
    """
    components = Components(here, driven)
    closure = closure or closure_rank(here, driven, engine)
    # number of self-stresses up to which all of them tell what is unique; more are represented by random ones
    few = closure.count - closure.rank <= 48
    probes = closure.orthonormal_stress() if few else closure.random_stress(np.random.default_rng(SEED), PROBES)
    probes = _without_pretension(here, probes)
    coefficients = np.abs(here.coupling_coefficients[:, :, 0]).max(axis=1, initial=0.0)
    multipliers = probes[here.system.graph.loop_rows :]
    states = _on_every_flank(here, probes)
    table = np.concatenate([components.table(one) for one in states], axis=1)
    return Uniqueness(components, closure, table, np.tile(coefficients[:, None] * multipliers, len(states)), probes)


def _without_pretension(here: Configuration, probes: Array) -> Array:
    """Self-stresses ``(rows, s)`` of which the given pretension of belts decides none."""
    if not here.system.m.once(pretensions):
        return probes
    _, C, _ = pretension_conditions(here)
    A = C[..., 0] @ probes[here.system.graph.loop_rows :]
    decides = np.abs(A).max(axis=1, initial=0.0) > STRESSES.unique * np.abs(C).max(axis=(1, 2))
    return np.asarray(probes @ null_space(A[decides], STRESSES.unique))


def pair_states(here: Configuration, rows: Array) -> Array:
    """Total pair wrenches ``(6, P, s, 1)`` of loop wrenches, the first of ``rows (rows, s)``: ``w = C^T x``."""
    return here.pair_wrenches(rows[: here.system.graph.loop_rows, :, None])


def _on_every_flank(here: Configuration, rows: Array) -> list[Array]:
    """``relieved_states`` on both flanks of gears: what is unique must be so on either; where there are none, these are the same."""
    return [relieved_states(here, rows, flank) for flank in ((1.0, -1.0) if ContactLines(here) else (1.0,))]


def relieved_states(here: Configuration, rows: Array, flank: float) -> Array:
    """The same less what gears transmit that touch each other on one flank (sign 1 or -1), ``(6, P, s, 1)``."""
    states, lines = pair_states(here, rows), ContactLines(here)
    multipliers = -rows[here.system.graph.loop_rows :, :, None]
    return states - lines.relief(multipliers, np.full((len(multipliers), here.T), flank)) if lines else states
