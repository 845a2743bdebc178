"""Advice with computed effect: wider pairs in place of others and couplings left out, to remove redundancy or to free a structure.

A change of pair ``k`` to a type with more freedoms adds twists ``S``; with the self-stresses ``n_k`` that pass the pair (drivers free)
the redundancy falls by ``rank(S^T n_k)``. A coupling left out adds one freedom in the same way, with its multiplier in place of
``S^T n_k``. So all changes are ranked without a new analysis; the effect of those reported is then computed from the changed rows.
Source of the idea: Reshetov, Self-Aligning Mechanisms, 1982.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.indexing import Index
from mechgraph.closure.rank import EngineName
from mechgraph.closure.sparse_solver import PROBES
from mechgraph.numerics.tolerances import STRESSES
from mechgraph.pairs import kinematics as evaluation
from mechgraph.pairs.pair_type import TABLE, PairType
from mechgraph.structure.mobility import Freedoms, freedoms_at
from mechgraph.structure.position import PlacedPair
from mechgraph.structure.uniqueness import pair_states

CHANGES_SHOWN = 6
"""Largest number of single changes, and of sets of changes, reported."""
LARGEST_FOR_SETS = 120
"""Redundancy up to which sets of changes that remove all of it are sought; the work grows as its cube (half a second here)."""
CHANGES_SEED = 29

EFFORTS = {"C": 0, "S": 0, "Sg": 1, "U": 1}
"""How hard pair types are to build: locating and floating bearings first, then what is both, or has two pins; then the others."""
PLANE = 3
"""The same of a plane that takes the place of a hinge: advised where nothing else is left."""


COUPLING, LEFT_OUT = "coupling", "left out"
"""What a coupling is changed from and to."""
RIGID, SPLINE = "rigid", "P"
"""What a shaft is changed from and to, in which a spline is inserted."""
WHOLE = {COUPLING: "coupling {} left out", RIGID: "spline inserted in {}"}
"""Changes that are not those of a pair, in words, by what is changed."""


@dataclass(frozen=True, eq=False)
class Change:
    """One pair given another type, or one coupling left out; ``added`` the freedoms that it adds, ``power (n, s)`` of these on the
    self-stresses, ``relief`` the number of self-stresses that it removes alone.

    ``item`` counts the pairs, then the couplings; ``effort`` says how hard it is to build. ``pair`` is the new pair where it stands
    (None for a coupling), ``turn`` the angle by which its second direction x is turned about the axis, where that matters.
    """

    item: int
    pair: PlacedPair | None
    power: Array
    added: int
    relief: int
    effort: int = 0
    turn: float = 0.0


@dataclass(frozen=True)
class Effect:
    """Changes and what they do: before -> after.

    ``changes`` are (pair, old type, new type), (coupling, "coupling", "left out") or (link, "rigid", "P"); ``turns`` the angles in degrees
    by which the second direction x of the new pair is turned; ``cylinders`` the pairs (foot, slide, head) that become S-C-S together.
    """

    changes: tuple[tuple[str, str, str], ...]
    redundancy: tuple[int, int]
    mobility: tuple[int, int]
    passive: tuple[int, int]
    turns: tuple[float, ...] = ()
    cylinders: tuple[tuple[str, ...], ...] = ()

    @property
    def inputs(self) -> tuple[int, int]:
        """Mobility without the passive freedoms."""
        return self.mobility[0] - self.passive[0], self.mobility[1] - self.passive[1]

    @property
    def text(self) -> str:
        """E.g. ``R at D -> S: redundancy 3 -> 1, mobility 1 -> 1, passive 0 -> 0``."""
        what = [
            WHOLE[old].format(name) if old in WHOLE else f"{old} at {name} -> {new}" for name, old, new in self.changes
        ]
        turned = [f" (its x turned by {turn:.3g} degrees)" if turn else "" for turn in self.turns]
        values = {"redundancy": self.redundancy, "mobility": self.mobility, "passive": self.passive}
        before_after = ", ".join(f"{name} {before} -> {after}" for name, (before, after) in values.items())
        return f"{', '.join(a + b for a, b in zip(what, turned, strict=True))}: {before_after}"


def wider_types(row: PairType) -> Iterator[PairType]:
    """Pair types with more freedoms whose freedoms include those of ``row`` at the reference position, fewest first."""
    one = np.full((1, 1), 1.0)

    def span(t: PairType) -> Array:
        x = evaluation.coordinates_to_state(t, np.zeros((t.f, 1, 1)))
        return evaluation.twists_of(t, one, evaluation.frames_of(t, one, x))[:, :, 0, 0]

    mine = span(row)
    for other in sorted(TABLE.values(), key=lambda t: t.f):
        if row.f < other.f and other.bears and not other.takes_pitch:
            both = np.concatenate([span(other), mine], axis=1)
            if np.linalg.matrix_rank(both, tol=1e-9) == other.f:
                yield other


def building_effort(old: PairType, new: PairType) -> int:
    """How hard a pair is to build in place of another: ``PLANE`` where it slides in two more directions, else by the table."""
    more = sum(not f.turns for f in new.freedoms) - sum(not f.turns for f in old.freedoms)
    return PLANE if more > 1 else EFFORTS.get(new.symbol, max(EFFORTS.values()) + 1)


def stresses_of(freedoms: Freedoms) -> Array:
    """Orthonormal self-stresses (drivers free) in the closure rows: all of them where sets of changes are sought, else random ones."""
    count = freedoms.redundancy if freedoms.redundancy <= LARGEST_FOR_SETS else PROBES
    return np.linalg.qr(freedoms.closure.random_stress(np.random.default_rng(CHANGES_SEED), count))[0]


def changes_of(freedoms: Freedoms) -> list[Change]:
    """All single changes that leave drivers, couplings and loads in place, with their power on the self-stresses (drivers free).

    Random self-stresses give the same rank at one pair as all of them. Pairs between gears keep their types: gears turn about their
    axes and do nothing else.
    """
    here, rows = freedoms.position.declared, freedoms.position.rows
    system = here.system
    states = stresses_of(freedoms)
    stress = np.moveaxis(pair_states(here, states)[..., 0], 1, 0)
    tied = [d.freedom for d in system.m.drives] + [name for c in system.m.couplings for name, _ in c.terms]
    tied += [load.in_freedom for load in system.m.loads if load.in_freedom is not None and load.takes_coordinate]
    geared = {step.pair for c in system.m.couplings for step in c.steps}
    needed: dict[int, set[str]] = {}
    for k, j in map(system.m.freedom, tied):
        needed.setdefault(k, set()).add(system.m.pairs[k].type.freedoms[j].name)
    out: list[tuple[int, int, Change]] = []
    for g, group in enumerate(system.groups):
        frames = here.frames[g][-1][..., 0]
        for number, new in enumerate(wider_types(system.m.pairs[int(group.pairs[0])].type)):
            single = {f.name for f, ok in zip(new.freedoms, new.drivable, strict=True) if ok}
            keeps = [k not in geared and needed.get(k, set()) <= single for k in group.pairs.tolist()]
            some = np.flatnonzero(keeps).astype(np.intp)
            pairs = group.pairs[some]
            made = _changes_to(group.row, new, frames[:, :, some], stress[pairs], pairs)
            out += [(c.item, 2 * number + turned, c) for turned, c in made]
    for i, power in enumerate(states[rows.count - rows.further :, None]):
        relief = int(_ranks(power[None])[0])
        out.append((len(rows.graph.ends) + i, 0, Change(len(rows.graph.ends) + i, None, power, 1, relief)))
    return [c for _, _, c in sorted(out, key=lambda item: item[:2])]


def _changes_to(old: PairType, new: PairType, frames: Array, stress: Array, pairs: Index) -> list[tuple[int, Change]]:
    """Changes of pairs to one type: as they stand (0), and turned about z (1) where that relieves more; all pairs at once."""

    def change(i: int, power: Array, relief: Array, frames: Array, turn: float = 0.0) -> Change:
        return Change(
            int(pairs[i]),
            PlacedPair.at_zero(new, frames[:, :, i]),
            power[i],
            new.f - old.f,
            int(relief[i]),
            effort,
            turn,
        )

    effort = building_effort(old, new)
    power = _power(new, frames, stress)
    relief = _ranks(power)
    out = [(0, change(i, power, relief, frames)) for i in range(len(pairs))]
    if new.square_second and len(pairs):
        turns = best_turns(frames, stress)
        frames = turned(frames, turns)
        power = _power(new, frames, stress)
        better = _ranks(power)
        more = np.flatnonzero(better > relief).tolist()
        out += [(1, change(i, power, better, frames, float(turns[i]))) for i in more]
    return out


def _power(new: PairType, frames: Array, stress: Array) -> Array:
    """Power ``(n, f, s)`` of a pair type at coordinates zero in ``frames (3, 4, n)`` on self-stresses ``(n, 6, s)``."""
    n = frames.shape[2]
    pitch, x = np.zeros((n, 1)), evaluation.coordinates_to_state(new, np.zeros((new.f, n, 1)))
    twists = evaluation.twists_of(new, pitch, evaluation.frames_of(new, pitch, x, frames[..., None]))[..., 0]
    return np.asarray(np.einsum("ifn,nis->nfs", twists, stress))


def _ranks(A: Array) -> Array:
    """Ranks of matrices ``(n, f, s)`` with an absolute tolerance (self-stresses and twists are of size one)."""
    return (
        np.asarray((np.linalg.svd(A, compute_uv=False) > STRESSES.relieved).sum(axis=1))
        if A.size
        else np.zeros(len(A), int)
    )


def turned(frames: Array, angles: Array) -> Array:
    """Frames ``(3, 4, n)`` turned about their own z by angles ``(n,)``."""
    c, s = np.cos(angles), np.sin(angles)
    out = frames.copy()
    out[:, 0], out[:, 1] = c * frames[:, 0] + s * frames[:, 1], c * frames[:, 1] - s * frames[:, 0]
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


def effect(before: Freedoms, driven: Index, changes: tuple[Change, ...], engine: EngineName = "auto") -> Effect:
    """The effect of changes, computed from the changed rows at the same position."""
    position = before.position
    pairs, couplings = position.m.pairs, position.m.couplings
    dropped = np.array([c.item - len(pairs) for c in changes if c.pair is None], dtype=np.intp)
    after_changes, column = position.with_changes({c.item: c.pair for c in changes if c.pair is not None}, dropped)
    after = freedoms_at(after_changes, column[driven], engine)
    return Effect(
        tuple(
            (pairs[c.item].name, pairs[c.item].type.symbol, c.pair.type.symbol)
            if c.pair is not None
            else (couplings[c.item - len(pairs)].name, COUPLING, LEFT_OUT)
            for c in changes
        ),
        (before.redundancy, after.redundancy),
        (before.mobility, after.mobility),
        (len(before.passive), len(after.passive)),
        tuple(float(np.degrees(c.turn)) for c in changes),
    )
