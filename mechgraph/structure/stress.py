"""Self-stresses at a position: which reaction components and efforts are unique, which only in some direction or combination."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import networkx as nx
import numpy as np

from mechgraph.algebra.screw import null_space
from mechgraph.algebra.se3 import Array
from mechgraph.motion.system import Configuration, Index
from mechgraph.numerics.linear import RANK_TOLERANCE
from mechgraph.structure.bordered import Bordered
from mechgraph.structure.elimination import Elimination
from mechgraph.structure.freedom import elimination, is_large
from mechgraph.structure.reaction import UNIQUE, PairFrames, Stress, orthonormal_stress, split_stress
from mechgraph.structure.readable import Label, SelfStress, combinations, readable
from mechgraph.structure.transverse import Transverse, transverse

PROBES = 6
"""Random self-stresses that stand for all of them in a large mechanism."""
LISTED = 20
"""Self-stresses of a large mechanism that are worked out as sparse vectors."""
SEED = 5


@dataclass(frozen=True)
class Uniqueness:
    """The verdict on reactions at one position.

    Attributes
    ----------
    unique : pair -> component -> bool; ``effort`` (or ``effort Tz``) for driven freedoms.
    count, groups : number of self-stresses with the drivers in place, and of groups that share components (in a large mechanism: of
        connected parts in which they lie).
    states : canonical sparse self-stresses; in a large mechanism the first few.
    transverse : directions of force and moment that are unique in a pair though its components are not.
    combinations : per group the further sums of components that are unique although their terms are not, as text.
    weakest, strongest : the largest part of a unit self-stress in a component called unique, the smallest in one called not unique.
    sampled : whether random self-stresses stood for all of them, as in large mechanisms.
    """

    unique: dict[str, dict[str, bool]]
    count: int
    groups: int
    states: tuple[SelfStress, ...]
    transverse: tuple[Transverse, ...]
    combinations: tuple[tuple[int, str], ...]
    weakest: float
    strongest: float
    sampled: bool = False


def stress_at(here: Configuration, driven: Index) -> Stress:
    """Self-stresses at one position with the drivers in place: the null space of ``[J^T, -E]``."""
    free = np.setdiff1d(np.arange(here.system.n_freedoms), driven)
    null = null_space(here.J[:, free, 0].T, RANK_TOLERANCE)
    return orthonormal_stress(here, pair_states(here, null), driven)


def pair_states(here: Configuration, loops: Array) -> Array:
    """Total pair wrenches ``(6, P, s, 1)`` of loop wrenches ``(6 loops, s)``: ``w = C^T x``."""
    return here.pair_wrenches(loops[..., None])


def uniqueness(here: Configuration, driven: Index) -> Uniqueness:
    """Which reaction components and efforts are unique: those in which no self-stress has a part."""
    return _uniqueness_of_many(here, driven) if is_large(here.system) else _uniqueness_of_few(here, driven)


def _uniqueness_of_few(here: Configuration, driven: Index) -> Uniqueness:
    labels, table = component_table(here, stress_at(here, driven), driven)
    states, basis, groups = readable(table, labels)
    directions, known = transverse(here, labels, table)
    return Uniqueness(
        count=table.shape[1],
        groups=len({s.group for s in states}),
        states=states,
        transverse=directions,
        combinations=combinations(basis, groups, labels, known),
        **_verdicts(here, labels, table),
    )


def _uniqueness_of_many(here: Configuration, driven: Index) -> Uniqueness:
    """By random self-stresses from the elimination along the loops: each has a part of every self-stress there is."""
    found = elimination(here, driven)
    rng = np.random.default_rng(SEED)
    count = 6 * len(here.system.graph.loops) - found.rank
    probes = found.random_stress(rng, min(PROBES, count))
    # of size one in the measure of every loop, not as a whole: the verdict does not depend on how many loops there are
    labels, table = component_table(here, split_stress(here, pair_states(here, probes), driven), driven)
    verdicts = _verdicts(here, labels, table)
    directions, _ = transverse(here, labels, table)
    _, first = component_table(
        here,
        orthonormal_stress(here, pair_states(here, _first_states(found, len(here.system.graph.loops))), driven),
        driven,
    )
    return Uniqueness(
        count=count,
        groups=_group_count(here, found, verdicts["unique"]),
        states=readable(first, labels)[0][:LISTED],
        transverse=directions,
        combinations=(),
        sampled=True,
        **verdicts,
    )


def _group_count(here: Configuration, found: Bordered | Elimination, unique: dict[str, dict[str, bool]]) -> int:
    """Sets of loops with self-stresses that share a pair some component of which is not unique."""
    m, loops = here.system.m, here.system.graph.loops
    home = {i: number for number, (_, members) in enumerate(found.sets) for i in members}
    graph: nx.Graph[int] = nx.Graph()
    graph.add_nodes_from(home.values())
    first: dict[int, int] = {}
    for i, number in home.items():
        for k, _ in loops[i]:
            if not all(unique[m.pairs[k].name].values()):
                graph.add_edge(number, first.setdefault(k, number))
    return int(nx.number_connected_components(graph))


def _first_states(found: Bordered | Elimination, loops: int) -> Array:
    """Loop wrenches of the first self-stresses: those of single loops, then shared ones."""
    rows = 6 * loops
    columns: list[Array] = [np.zeros((rows, 0))]
    count = 0
    for i, Y in sorted(found.local, key=lambda item: item[0]):
        if count < LISTED:
            columns.append(np.zeros((rows, Y.shape[1])))
            columns[-1][6 * i : 6 * i + 6] = Y
            count += Y.shape[1]
    left = max(0, min(LISTED - count, len(found.zero_rows)))
    return np.concatenate([*columns, found.wrenches(np.eye(len(found.zero_rows), left))], axis=1)


def component_table(here: Configuration, stress: Stress, driven: Index) -> tuple[list[Label], Array]:
    """Labels (pair, component) of all components and driver efforts, and their parts ``(components, s)`` in the self-stresses."""
    m, system = here.system.m, here.system
    parts = PairFrames(here).components(stress.wrenches)
    rows: dict[int, Array] = {
        int(k): part[:, i, :, 0] for g, part in zip(system.groups, parts, strict=True) for i, k in enumerate(g.pairs)
    }
    names = m.freedom_names()
    labels: list[Label] = []
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
    return labels, np.array(values).reshape(len(labels), -1)


def _verdicts(here: Configuration, labels: list[Label], table: Array) -> dict[str, Any]:
    sizes = np.sqrt((table**2).sum(axis=1))
    verdicts = sizes <= UNIQUE
    unique: dict[str, dict[str, bool]] = {pair.name: {} for pair in here.system.m.pairs}
    for (pair_name, name), ok in zip(labels, verdicts, strict=True):
        unique[pair_name][name] = bool(ok)
    return {
        "unique": unique,
        "weakest": float(sizes[verdicts].max(initial=0.0)),
        "strongest": float(sizes[~verdicts].min(initial=np.inf)),
    }
