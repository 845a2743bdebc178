"""Self-stresses at a position: which reaction components and efforts are unique, which only in some direction or combination."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mechgraph.algebra.screw import null_space
from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index
from mechgraph.model.pair import Pair
from mechgraph.numerics.linear import RANK_TOLERANCE
from mechgraph.structure.bordered import Bordered
from mechgraph.structure.elimination import Elimination
from mechgraph.structure.mobility import elimination, is_large
from mechgraph.structure.reaction_split import UNIQUE, PairFrames, Stress, orthonormal_stress, split_stress
from mechgraph.structure.self_stress import Label, SelfStress, combinations, readable, regrouped
from mechgraph.structure.transverse import Transverse, transverse

PROBES = 6
"""Random self-stresses that stand for all of them in a large mechanism."""
LISTED = 20
"""Self-stresses of a large mechanism that are worked out at once; the others when asked for."""
SHARED = 100
"""Self-stresses across loops of a large mechanism that are worked out at most."""
SEED = 5


@dataclass(frozen=True)
class Uniqueness:
    """The verdict on reactions at one position.

    Attributes
    ----------
    unique : pair -> component -> bool; ``effort`` (or ``effort Tz``) for driven freedoms.
    count, groups : number of self-stresses with the drivers in place, and of groups that share components (in a large mechanism: of
        connected parts in which they lie).
    states : canonical sparse self-stresses; in a large mechanism the first few (``self_stresses`` gives the others).
    transverse : directions of force and moment that are unique in a pair though its components are not.
    combinations : per group the further sums of components that are unique although their terms are not, as text.
    unsought : groups in which such sums were not sought, as they have too many components; all groups of a large mechanism.
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
    unsought: int = 0
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
    sums, unsought = combinations(basis, groups, labels, known)
    return Uniqueness(
        count=table.shape[1],
        groups=len({s.group for s in states}),
        states=states,
        transverse=directions,
        combinations=sums,
        unsought=unsought,
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
    groups = _group_count(here, found, verdicts["unique"])
    return Uniqueness(
        count=count,
        groups=groups,
        states=_states_of_many(here, driven, found, LISTED),
        transverse=directions,
        combinations=(),
        unsought=groups,
        sampled=True,
        **verdicts,
    )


def self_stresses(here: Configuration, driven: Index, found: Uniqueness) -> tuple[SelfStress, ...]:
    """All self-stresses in readable form; in a large mechanism those of single loops, and of those across loops the first few."""
    if not found.sampled:
        return found.states
    return _states_of_many(here, driven, elimination(here, driven), found.count)


def _group_count(here: Configuration, found: Bordered | Elimination, unique: dict[str, dict[str, bool]]) -> int:
    """Sets of loops with self-stresses that share a pair some component of which is not unique."""
    import networkx as nx

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


def _states_of_many(
    here: Configuration, driven: Index, found: Bordered | Elimination, most: int
) -> tuple[SelfStress, ...]:
    """The first ``most`` self-stresses: those of single loops, each made readable by itself, then those across loops."""
    frames = PairFrames(here)
    states: list[SelfStress] = []
    for i, Y in sorted(found.local, key=lambda item: item[0]):
        if len(states) < most:
            states += readable(*_of_loop(here, frames, driven, i, Y))[0]
    left = max(0, min(most - len(states), len(found.zero_rows), SHARED))
    if left:
        shared = found.wrenches(np.eye(len(found.zero_rows), left))
        stress = orthonormal_stress(here, pair_states(here, shared), driven)
        labels, table = component_table(here, stress, driven)
        touched = np.flatnonzero(np.abs(table).max(axis=1) > UNIQUE)
        states += readable(table[touched], [labels[i] for i in touched])[0]
    return regrouped(states[:most])


def _of_loop(here: Configuration, frames: PairFrames, driven: Index, loop: int, Y: Array) -> tuple[Array, list[Label]]:
    """Parts ``(components, s)`` and labels of self-stresses of one loop alone, given by its wrenches ``Y (6, s)``."""
    system = here.system
    labels: list[Label] = []
    parts: list[Array] = []
    for k, sign in system.graph.loops[loop]:
        mine = driven[(driven >= system.first_column[k]) & (driven < system.first_column[k + 1])]
        efforts = here.S[:, mine, 0].T @ (sign * Y)
        reactions = sign * Y - here.E[:, mine, 0] @ efforts
        labels += labels_of(system.m.pairs[k], mine - system.first_column[k])
        parts += [frames.of_one_pair(k, reactions), efforts]
    return np.concatenate(parts), labels


def component_table(here: Configuration, stress: Stress, driven: Index) -> tuple[list[Label], Array]:
    """Labels (pair, component) of all components and driver efforts, and their parts ``(components, s)`` in the self-stresses."""
    m, system = here.system.m, here.system
    parts = PairFrames(here).components(stress.wrenches)
    rows: dict[int, Array] = {
        int(k): part[:, i, :, 0] for g, part in zip(system.groups, parts, strict=True) for i, k in enumerate(g.pairs)
    }
    labels: list[Label] = []
    values: list[Array] = []
    for k, pair in enumerate(m.pairs):
        mine = driven[(driven >= system.first_column[k]) & (driven < system.first_column[k + 1])]
        labels += labels_of(pair, mine - system.first_column[k])
        values += [rows[k], stress.efforts[mine, :, 0]]
    return labels, np.concatenate([np.zeros((0, stress.wrenches.shape[2])), *values])


def labels_of(pair: Pair, driven: Index) -> list[Label]:
    """(pair, component) of the reaction components of a pair, then of the efforts of its freedoms ``driven`` (numbers)."""
    out = [(pair.name, name) for name in pair.type.component_names]
    if len(driven) == 1:
        return [*out, (pair.name, "effort")]
    return out + [(pair.name, f"effort {pair.type.freedoms[j].name}") for j in driven]


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
