"""Self-stresses in readable form: a canonical sparse basis over reaction components, and groups of states that share components."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.screw import null_space
from mechgraph.algebra.se3 import Array

SHOWN = 1e-6
"""Part of a self-stress (largest part 1) below which a component is not shown."""
COMBINED = 300
"""Components of one group up to which combinations across pairs are worked out."""

Label = tuple[str, str]


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


def readable(table: Array, labels: list[Label]) -> tuple[tuple[SelfStress, ...], Array, Array]:
    """Canonical self-stresses of ``table (components, s)``; the basis in their order and the group of each."""
    basis = canonical(table)
    groups = groups_of(basis)
    order = np.argsort(groups, kind="stable")
    basis, groups = basis[:, order], groups[order]
    states = []
    for column, group in zip(basis.T, groups, strict=True):
        shown = [(labels[i], float(column[i])) for i in np.flatnonzero(np.abs(column) > SHOWN)]
        states.append(
            SelfStress(
                {f"{pair}:{name}": v for (pair, name), v in shown if not name.startswith("effort")},
                {f"{pair}{name[6:].replace(' ', '.')}": v for (pair, name), v in shown if name.startswith("effort")},
                int(group),
            )
        )
    return tuple(states), basis, groups


def combinations(
    basis: Array, groups: Array, labels: list[Label], known: set[int]
) -> tuple[tuple[tuple[int, str], ...], int]:
    """Per group the sums of components that are unique though their terms are not; ``known`` components are left out.

    A component that a combination found before ties to others of its pair brings nothing new, so it is among ``known``.
    Also returned: the number of groups that have too many components for it.
    """
    out, unsought = [], 0
    for group in sorted(set(groups.tolist())):
        mine = basis[:, groups == group]
        touched = [int(i) for i in np.flatnonzero(np.abs(mine).max(axis=1) > SHOWN) if int(i) not in known]
        if len(touched) > COMBINED:
            unsought += 1
            continue
        for column in canonical(null_space(mine[touched].T, 1e-9)).T:
            terms = {":".join(labels[i]): float(v) for i, v in zip(touched, column, strict=True) if abs(v) > SHOWN}
            out.append((group, SelfStress(terms, {}).text))
    return tuple(out), unsought


def regrouped(states: Sequence[SelfStress]) -> tuple[SelfStress, ...]:
    """The states with group numbers made anew: states that share a component belong together."""
    if len(states) < 2:
        return tuple(dataclasses.replace(s, group=0) for s in states)
    import networkx as nx

    names = [{*s.components, *(f"effort {name}" for name in s.efforts)} for s in states]
    place = {name: i for i, name in enumerate(dict.fromkeys(name for part in names for name in sorted(part)))}
    graph: nx.Graph[int] = nx.Graph()
    for i, part in enumerate(names):
        nx.add_star(graph, [~i, *(place[name] for name in part)])
    number: dict[int, int] = {}
    for component in nx.connected_components(graph):
        number |= dict.fromkeys((~i for i in component if i < 0), len(number))
    order = {group: n for n, group in enumerate(dict.fromkeys(number[i] for i in range(len(states))))}
    return tuple(dataclasses.replace(s, group=order[number[i]]) for i, s in enumerate(states))


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


def groups_of(basis: Array) -> Array:
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
