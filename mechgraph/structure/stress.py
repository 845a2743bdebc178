"""Self-stresses in readable form: a canonical sparse basis over reaction components, groups, and what stays unique in combination."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.screw import null_space
from mechgraph.algebra.se3 import Array
from mechgraph.motion.system import Configuration, Index
from mechgraph.numerics.linear import RANK_TOLERANCE
from mechgraph.structure.reaction import UNIQUE, PairFrames, Stress, orthonormal_stress

SHOWN = 1e-6
"""Part of a self-stress (largest part 1) below which a component is not shown."""


@dataclass(frozen=True)
class SelfStress:
    """A reaction state without load: coefficients by ``pair:component``, the largest 1, moments divided by L so that they compare."""

    components: Mapping[str, float]
    efforts: Mapping[str, float]
    group: int = 0

    @property
    def text(self) -> str:
        """The state in one line."""
        parts = [*self.components.items(), *((f"effort {name}", value) for name, value in self.efforts.items())]
        line = " ".join(
            f"{'-' if v < 0 else '+'} {'' if abs(abs(v) - 1) < 5e-4 else f'{abs(v):.3g} '}{name}" for name, v in parts
        )
        return line.removeprefix("+ ")


@dataclass(frozen=True)
class Uniqueness:
    """The verdict on reactions at one position.

    Attributes
    ----------
    unique : pair -> component -> bool; ``effort`` (or ``effort Tz``) for driven freedoms.
    states : canonical sparse self-stresses.
    combinations : per group the sums of components that are unique although their terms are not, as text.
    weakest, strongest : the largest part of a unit self-stress in a component called unique, the smallest in one called not unique.
    """

    unique: dict[str, dict[str, bool]]
    states: tuple[SelfStress, ...]
    combinations: tuple[tuple[int, str], ...]
    weakest: float
    strongest: float


def stress_at(here: Configuration, driven: Index) -> Stress:
    """Self-stresses at one position with the drivers in place: the null space of ``[J^T, -E]``."""
    free = np.setdiff1d(np.arange(here.system.n_freedoms), driven)
    null = null_space(here.J[:, free, 0].T, RANK_TOLERANCE)
    C = here.system.graph.loop_matrix
    states = np.einsum("lp,lis->ips", C, null.reshape(C.shape[0], 6, null.shape[1]))[..., None]
    return orthonormal_stress(here, states, driven)


def uniqueness(here: Configuration, driven: Index) -> Uniqueness:
    """Which reaction components and efforts are unique: those in which no self-stress has a part."""
    m, system = here.system.m, here.system
    stress = stress_at(here, driven)
    parts = PairFrames(here).components(stress.wrenches)
    rows: dict[int, Array] = {
        int(k): part[:, i, :, 0] for g, part in zip(system.groups, parts, strict=True) for i, k in enumerate(g.pairs)
    }
    names = m.freedom_names()
    labels: list[tuple[str, str]] = []
    values: list[Array] = []
    for k, pair in enumerate(m.pairs):
        labels += [(pair.name, name) for name in pair.type.component_names]
        values += list(rows[k])
        mine = [int(c) for c in driven if system.first_column[k] <= c < system.first_column[k + 1]]
        for c in mine:
            labels.append(
                (pair.name, "effort" if len(mine) == 1 else f"effort {names[c].removeprefix(pair.name + '.')}")
            )
            values.append(stress.efforts[c, :, 0])
    table = np.array(values).reshape(len(labels), -1)
    sizes = np.sqrt((table**2).sum(axis=1))
    verdicts = sizes <= UNIQUE
    unique: dict[str, dict[str, bool]] = {}
    for (pair_name, name), ok in zip(labels, verdicts, strict=True):
        unique.setdefault(pair_name, {})[name] = bool(ok)
    for pair in m.pairs:
        unique.setdefault(pair.name, {})
    states, combinations = _readable(table, labels)
    return Uniqueness(
        unique,
        states,
        combinations,
        float(sizes[verdicts].max(initial=0.0)),
        float(sizes[~verdicts].min(initial=np.inf)),
    )


def _readable(
    table: Array, labels: list[tuple[str, str]]
) -> tuple[tuple[SelfStress, ...], tuple[tuple[int, str], ...]]:
    basis = canonical(table)
    groups = _groups(basis)
    states = []
    for j in np.argsort(groups, kind="stable"):
        column = basis[:, j]
        shown = [(i, float(column[i])) for i in np.flatnonzero(np.abs(column) > SHOWN)]
        states.append(
            SelfStress(
                {f"{labels[i][0]}:{labels[i][1]}": v for i, v in shown if not labels[i][1].startswith("effort")},
                {labels[i][0]: v for i, v in shown if labels[i][1].startswith("effort")},
                int(groups[j]),
            )
        )
    combinations = []
    for group in sorted(set(groups)):
        mine = basis[:, groups == group]
        touched = np.flatnonzero(np.abs(mine).max(axis=1) > SHOWN)
        kept = canonical(null_space(mine[touched].T, 1e-9)) if len(touched) <= 60 else np.zeros((len(touched), 0))
        for column in kept.T:
            terms = {
                f"{labels[touched[i]][0]}:{labels[touched[i]][1]}": float(column[i])
                for i in np.flatnonzero(np.abs(column) > SHOWN)
            }
            combinations.append((int(group), SelfStress(terms, {}).text))
    return tuple(states), tuple(combinations)


def canonical(columns: Array) -> Array:
    """A sparse basis of a column space that depends on the space and the order of its rows only.

    Reduced echelon form taken from the first row on and from the last row on; the sparser is kept. Columns are scaled so that
    their largest entry is one.
    """
    if not columns.shape[1]:
        return columns
    forward, backward = _echelon(columns), _echelon(columns[::-1])[::-1]
    best = min((forward, backward), key=lambda A: int((np.abs(A) > SHOWN).sum()))
    best = best / np.abs(best).max(axis=0)
    first = np.argmax(np.abs(best) > 1 - 1e-9, axis=0)
    best = best * np.sign(best[first, np.arange(best.shape[1])])
    return np.where(np.abs(best) < 1e-9, 0.0, best)


def _echelon(columns: Array) -> Array:
    """Column echelon form with unit pivots in the first rows that can have them (entries against the largest)."""
    A = columns / np.abs(columns).max()
    done = 0
    for i in range(A.shape[0]):
        if done == A.shape[1]:
            break
        j = done + int(np.argmax(np.abs(A[i, done:])))
        if abs(A[i, j]) < 1e-6:
            A[i, done:] = 0.0
            continue
        A[:, [done, j]] = A[:, [j, done]]
        A[:, done] /= A[i, done]
        others = np.delete(np.arange(A.shape[1]), done)
        A[:, others] -= np.outer(A[:, done], A[i, others])
        done += 1
    return A


def _groups(basis: Array) -> Array:
    """Group number of every column: columns that share a component belong together."""
    shown = np.abs(basis) > SHOWN
    group = np.full(basis.shape[1], -1)
    for j in range(basis.shape[1]):
        if group[j] >= 0:
            continue
        front, number = [j], int(group.max(initial=-1)) + 1
        while front:
            i = front.pop()
            if group[i] < 0:
                group[i] = number
                front += [int(k) for k in np.flatnonzero(shown[shown[:, i]].any(axis=0)) if group[k] < 0]
    return group
