"""Advice with computed effect: pair changes that remove redundancy, changes that free a structure, drivers that complete.

A change of pair ``k`` to a type with more freedoms adds twists ``S``; with the self-stresses ``n_k`` that pass the pair (drivers free)
the redundancy falls by ``rank(S^T n_k)``, so all changes are ranked without a new analysis; the effect of those reported
is then computed on the changed mechanism.
Source of the idea: Reshetov, Self-Aligning Mechanisms, 1982.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import named_columns, scaled_system
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.rank import EngineName
from mechgraph.closure.sparse_solver import PROBES
from mechgraph.model import pair_kinematics as evaluation
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Marker, Pair
from mechgraph.model.pair_table import TABLE
from mechgraph.model.pair_type import PairType
from mechgraph.numerics.linear import singular_values
from mechgraph.numerics.tolerances import STRESSES
from mechgraph.structure.finite_motion import FiniteMotion
from mechgraph.structure.mobility import Freedoms, free_motion
from mechgraph.structure.uniqueness import pair_states

CHANGES_SHOWN = 6
"""Largest number of single changes, and of sets of changes, reported."""
FREEING = 3
"""Changes reported that let a structure move."""
LARGEST_FOR_SETS = 48
"""Redundancy up to which sets of changes that remove all of it are sought; the work grows as its cube."""
CHANGES_SEED = 29

BEAM = 12
"""Partial sets of changes kept while searching."""


@dataclass(frozen=True)
class Change:
    """One pair given another type; ``matrix (f, s)`` is its power on the self-stresses, ``added`` the freedoms added,
    ``relief`` the self-stresses that it removes alone.

    ``turn``: angle by which the second direction x is turned about the axis, for types in which it matters.
    """

    pair: int
    type: PairType
    matrix: Array
    added: int
    relief: int
    turn: float = 0.0


@dataclass(frozen=True)
class Effect:
    """Changes and what they do, computed on the changed mechanism: before -> after.

    ``changes`` are (pair, old type, new type), ``turns`` the angles in degrees by which their second direction x is turned.
    """

    changes: tuple[tuple[str, str, str], ...]
    redundancy: tuple[int, int]
    mobility: tuple[int, int]
    passive: tuple[int, int]
    turns: tuple[float, ...] = ()

    @property
    def text(self) -> str:
        """E.g. ``R at D -> S: redundancy 3 -> 1, mobility 1 -> 1, passive 0 -> 0``."""
        turns = [f" (its x turned by {turn:.3g} degrees)" if turn else "" for turn in self.turns]
        what = ", ".join(
            f"{old} at {pair} -> {new}{turn}" for (pair, old, new), turn in zip(self.changes, turns, strict=True)
        )
        effect = ", ".join(
            f"{name} {a} -> {b}"
            for name, (a, b) in (
                ("redundancy", self.redundancy),
                ("mobility", self.mobility),
                ("passive", self.passive),
            )
        )
        return f"{what}: {effect}"


def wider_types(row: PairType) -> Iterator[PairType]:
    """Pair types with more freedoms whose freedoms include those of ``row`` at the reference position, fewest first."""
    one = np.full((1, 1), 1.0)

    def span(t: PairType) -> Array:
        x = evaluation.coordinates_to_state(t, np.zeros((t.f, 1, 1)))
        return evaluation.twists_of(t, one, evaluation.frames_of(t, one, x))[:, :, 0, 0]

    mine = span(row)
    for other in sorted(TABLE.values(), key=lambda t: t.f):
        if row.f < other.f and not other.takes_pitch:
            both = np.concatenate([span(other), mine], axis=1)
            if np.linalg.matrix_rank(both, tol=1e-9) == other.f:
                yield other


def changes_of(here: Configuration, freedoms: Freedoms) -> list[Change]:
    """All single changes to wider types that leave the drivers in place, with their power on the self-stresses (drivers free).

    On all self-stresses where sets of changes are sought, else on random ones, which give the same rank in one pair.
    """
    system = here.system
    count = freedoms.redundancy if freedoms.redundancy <= LARGEST_FOR_SETS else PROBES
    rows = freedoms.closure.random_stress(np.random.default_rng(CHANGES_SEED), count)
    stress = np.moveaxis(pair_states(here, np.linalg.qr(rows)[0])[..., 0], 1, 0)
    needed: dict[int, set[str]] = {}
    for k, j in (system.m.freedom(d.freedom) for d in system.m.drives):
        needed.setdefault(k, set()).add(system.m.pairs[k].type.freedoms[j].name)
    out: list[tuple[int, int, Change]] = []
    for g, group in enumerate(system.groups):
        base = here.frames[g][-1]
        for number, row in enumerate(wider_types(system.m.pairs[int(group.pairs[0])].type)):
            single = {f.name for f, ok in zip(row.freedoms, row.drivable, strict=True) if ok}
            some = np.array(
                [i for i, k in enumerate(group.pairs.tolist()) if needed.get(k, set()) <= single], dtype=np.intp
            )
            made = _changes_to(row, base[:, :, some], stress[group.pairs[some]], group.pairs[some], row.f - group.row.f)
            out += [(c.pair, 2 * number + turned, c) for turned, c in made]
    return [c for _, _, c in sorted(out, key=lambda item: item[:2])]


def _changes_to(row: PairType, base: Array, stress: Array, pairs: Index, added: int) -> list[tuple[int, Change]]:
    """Changes of pairs to one type: as they stand (0), and turned about z (1) where that relieves more; all pairs at once."""
    plain = _power(row, base, stress)
    relief = _ranks(plain)
    out = [(0, Change(int(k), row, plain[i], added, int(relief[i]))) for i, k in enumerate(pairs)]
    if row.square_second and len(pairs):
        turns = best_turns(base[..., 0], stress)
        power = _power(row, turned(base, turns[:, None]), stress)
        better = _ranks(power)
        more = np.flatnonzero(better > relief)
        out += [(1, Change(int(pairs[i]), row, power[i], added, int(better[i]), float(turns[i]))) for i in more]
    return out


def _power(row: PairType, base: Array, stress: Array) -> Array:
    """Power ``(n, f, s)`` of a pair type at coordinates zero in frames ``base (3, 4, n, 1)`` on self-stresses ``(n, 6, s)``."""
    n = base.shape[2]
    pitch = np.zeros((n, 1))
    x = evaluation.coordinates_to_state(row, np.zeros((row.f, n, 1)))
    twists = evaluation.twists_of(row, pitch, evaluation.frames_of(row, pitch, x, base))[..., 0]
    return np.asarray(np.einsum("ifn,nis->nfs", twists, stress))


def _ranks(A: Array) -> Array:
    """Ranks of matrices ``(n, f, s)`` with an absolute tolerance (self-stresses and twists are of size one)."""
    return (
        np.asarray((np.linalg.svd(A, compute_uv=False) > STRESSES.relieved).sum(axis=1))
        if A.size
        else np.zeros(len(A), int)
    )


def turned(base: Array, angle: Array | float) -> Array:
    """Frames turned about their own z."""
    c, s = np.cos(angle), np.sin(angle)
    out = base.copy()
    out[:, 0], out[:, 1] = c * base[:, 0] + s * base[:, 1], c * base[:, 1] - s * base[:, 0]
    return out


def best_turns(frames: Array, wrenches: Array) -> Array:
    """Angles from x to the direction across z about which self-stresses ``(n, 6, s)`` bend most, in (-pi/2, pi/2]."""
    if not wrenches.shape[2]:
        return np.zeros(len(wrenches))
    moments = wrenches[:, :3] - np.cross(frames[:, 3].T[:, :, None], wrenches[:, 3:], axis=1)
    U, s, _ = np.linalg.svd(np.einsum("ijn,nis->njs", frames[:, :2], moments))
    angle = np.arctan2(U[:, 1, 0], U[:, 0, 0])
    angle -= np.pi * np.ceil(angle / np.pi - 0.5)
    angle = np.where(angle > 1e-9 - np.pi / 2, angle, np.pi / 2)
    return np.where(s[:, 0] < STRESSES.relieved, 0.0, angle)


def _relief(parts: tuple[Change, ...]) -> int:
    return rank_of_absolute(np.concatenate([c.matrix for c in parts]))


def rank_of_absolute(A: Array) -> int:
    """Rank with an absolute tolerance (self-stresses and twists are of size one)."""
    return int((singular_values(A) > STRESSES.relieved).sum()) if A.size else 0


def relieving(changes: list[Change], redundancy: int) -> tuple[list[tuple[Change, ...]], list[tuple[Change, ...]]]:
    """Single changes that lower the redundancy, and smallest sets that remove it, without more freedoms than self-stresses removed.

    Ranked by how little they change: freedoms added beyond need, then number of changes, then the order of declaration.
    """
    useful = [c for c in changes if c.relief]
    singles = sorted(useful, key=lambda c: (c.added - c.relief, -c.relief, c.pair))
    exact = [c for c in singles if c.added == c.relief]
    beam: list[tuple[tuple[Change, ...], int]] = [((), 0)]
    complete: list[tuple[Change, ...]] = []
    deepest: list[tuple[tuple[Change, ...], int]] = []
    for _ in range(redundancy if redundancy <= LARGEST_FOR_SETS else 0):
        grown: dict[frozenset[int], tuple[tuple[Change, ...], int]] = {}
        for parts, removed in beam:
            for c in exact:
                if parts and c.pair <= parts[-1].pair:
                    continue
                now = _relief((*parts, c))
                if now == removed + c.added:
                    grown[frozenset(id(p) for p in (*parts, c))] = ((*parts, c), now)
        found = sorted(grown.values(), key=lambda item: (-item[1], [c.pair for c in item[0]]))
        complete += [parts for parts, removed in found if removed == redundancy]
        deepest = [*found[:2], *deepest]
        beam = [item for item in found if item[1] < redundancy][:BEAM]
        if not beam:
            break
    if not complete and deepest:
        most = max(removed for _, removed in deepest)
        complete = [parts for parts, removed in deepest if removed == most and len(parts) > 1]
    return [(c,) for c in _spread(singles)], complete


def _mixed(complete: list[tuple[Change, ...]]) -> list[tuple[Change, ...]]:
    """Up to two sets of every size, those whose widest change is smallest first."""
    out: list[tuple[Change, ...]] = []
    for size in sorted({len(parts) for parts in complete}):
        mine = [parts for parts in complete if len(parts) == size]
        out += sorted(mine, key=lambda parts: max(c.added for c in parts))[:2]
    return out


def _spread(singles: list[Change]) -> list[Change]:
    """The best changes, not all at one pair: the best of every pair first."""
    first: list[Change] = []
    rest: list[Change] = []
    seen: set[int] = set()
    for c in singles:
        (rest if c.pair in seen else first).append(c)
        seen.add(c.pair)
    return (first + rest)[:CHANGES_SHOWN]


def effect(
    system: System, x: Array, before: Freedoms, parts: tuple[Change, ...], engine: EngineName = "auto"
) -> Effect | None:
    """The effect of changes, computed on the changed mechanism at the same position; None where it cannot be built."""
    m = system.m
    q = system.coordinates_of(x[:, None], system.start_coordinates(m.start))[:, 0]
    changed: Mechanism = m.replace(start=dict(zip(m.freedom_names(), q.tolist(), strict=True)), loads=())
    for c in parts:
        changed = changed.with_pair_type(m.pairs[c.pair].name, c.type)
        if c.turn:
            changed = with_turned_pair(changed, m.pairs[c.pair].name, c.turn)
    raw = System(changed, system.graph)
    start = raw.start_coordinates(changed.start)
    after_system = scaled_system(changed, start, raw)
    state = after_system.state_of(start[:, None])[:, 0]
    if float(after_system.at(state[:, None]).closure[0]) > 1e-8:
        return None
    columns, _ = named_columns(changed, after_system, {d.freedom: 0.0 for d in changed.drives})
    after = free_motion(after_system, state, columns, engine)
    return Effect(
        tuple((m.pairs[c.pair].name, m.pairs[c.pair].type.symbol, c.type.symbol) for c in parts),
        (before.redundancy, after.redundancy),
        (before.mobility, after.mobility),
        (len(before.passive), len(after.passive)),
        tuple(float(np.degrees(c.turn)) for c in parts),
    )


def with_turned_pair(m: Mechanism, name: str, angle: float) -> Mechanism:
    """A copy in which the second direction x of one pair is turned about its axis, on both links."""

    def marker(old: Marker) -> Marker:
        pose = turned(old.pose()[..., None], angle)[..., 0]
        return Marker(old.point, old.axis, pose[:, 0].tolist())

    def replaced(pair: Pair) -> Pair:
        if pair.on_a is not None and pair.on_b is not None:
            return pair.replace(on_a=marker(pair.on_a), on_b=marker(pair.on_b))
        return pair.replace(second=marker(pair.markers[0]).second)

    return m.replace(pairs=[replaced(p) if p.name == name else p for p in m.pairs])


def advice(
    system: System, x: Array, freedoms: Freedoms, motion: FiniteMotion, engine: EngineName = "auto"
) -> tuple[Effect, ...]:
    """Pair changes worth making: those that remove redundancy without adding input freedoms; for a structure, those that free it."""
    here = system.at(x[:, None])
    redundancy = freedoms.redundancy
    changes = changes_of(here, freedoms)
    found: list[Effect] = []
    inputs = freedoms.mobility - len(freedoms.passive)
    if redundancy:
        singles, complete = relieving(changes, redundancy)
        for parts in (*_mixed(complete), *singles):
            done = effect(system, x, freedoms, parts, engine)
            if (
                done
                and done.mobility[1] - done.passive[1] == inputs
                and done.redundancy[1] < redundancy
                and done not in found
            ):
                found.append(done)
    return tuple([*_freeing(system, x, freedoms, changes, motion, engine), *found][: CHANGES_SHOWN + 3])


def _freeing(
    system: System, x: Array, freedoms: Freedoms, changes: list[Change], motion: FiniteMotion, engine: EngineName
) -> list[Effect]:
    """For a structure the changes that let it move, those that add fewest freedoms first; nothing for what moves."""
    if freedoms.mobility - len(freedoms.passive) and motion.mobility:
        return []
    found: list[Effect] = []
    for c in _spread(sorted((c for c in changes if c.added > c.relief), key=lambda c: (c.added, c.pair)))[:FREEING]:
        done = effect(system, x, freedoms, (c,), engine)
        if done and done.mobility[1] - done.passive[1] > freedoms.mobility - len(freedoms.passive):
            found.append(done)
    return found
