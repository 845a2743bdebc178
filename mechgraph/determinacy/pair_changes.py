"""Changes of pairs that make a mechanism statically determinate, and how they are recommended.

Advice with computed effect: wider pairs in place of others and couplings left out, to remove redundancy or to free a structure.
A change of pair ``k`` to a type with more freedoms adds twists ``S``; with the self-stresses ``n_k`` that pass the pair (drivers free)
the redundancy falls by ``rank(S^T n_k)``. A coupling left out adds one freedom in the same way, with its multiplier in place of
``S^T n_k``. So all changes are ranked without a new analysis; the effect of those reported is then computed from the changed rows.
Source of the idea: Reshetov, Self-Aligning Mechanisms, 1982.

Sets of changes that together remove redundancy: searched for the smallest, or put together from cylinders between balls and the rest.
With the power of every change on the self-stresses, changes remove as many of them together as the rank of
their powers one below the other.

Self-aligning variants: all choices of wider pairs that take away the whole redundancy and leave the mobility as it is.
Changes together do that when they add as many freedoms as there are self-stresses and their powers on these, one below the other, have
that rank; so the powers of any part of them are independent too, and sets grow change by change. Source: Reshetov, Self-Aligning
Mechanisms, 1982.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import islice, product

import numpy as np
from numpy.typing import NDArray

from mechgraph.determinacy.mobility import Freedoms, PlacedPair, Position, free_motion, freedoms_at
from mechgraph.determinacy.uniqueness import pair_states
from mechgraph.errors import Budget
from mechgraph.kinematics.assembly import assembled, at_position, named_columns
from mechgraph.kinematics.solver import PROBES, EngineName
from mechgraph.maths.se3 import Array, Index, null_space
from mechgraph.maths.tolerances import MOTIONS, STRESSES
from mechgraph.memo import dataclass
from mechgraph.model.couplings import motion_of
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.meshes import Mesh
from mechgraph.model.pair import Link, Marker, Pair
from mechgraph.model.plane import in_plane
from mechgraph.pairs import pair_type as evaluation
from mechgraph.pairs.pair_type import TABLE, PairType

CHANGES_SHOWN, FREEING = 6, 3
"""Largest number of single changes, and of sets of changes, reported; and of changes that let a structure move."""
LARGEST_FOR_SETS = 120
"""Redundancy up to which sets of changes that remove all of it are sought; the work grows as its cube (half a second here)."""

EFFORTS = {"C": 0, "S": 0, "Sg": 1, "U": 1}
"""How hard pair types are to build: locating and floating bearings first, then what is both, or has two pins; then the others."""
PLANE = 3
"""The same of a plane that takes the place of a hinge: advised where nothing else is left."""


COUPLING, LEFT_OUT = "coupling", "left out"
"""What a coupling is changed from and to."""
RIGID, SPLINE = "rigid", "P"
"""What a shaft is changed from and to, in which a spline is inserted."""
CENTERED = "centered"
"""What a gear is changed from that is let float."""
WHOLE = {
    COUPLING: "coupling {} left out",
    RIGID: "spline inserted in {}",
    CENTERED: "{} let float, centered by its meshes",
}
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
    of_plane = (in_plane(t) for t in TABLE.values())
    table = TABLE.values() if row.normal is None else [t for t in of_plane if t and t.normal == row.normal]
    for other in sorted(table, key=lambda t: t.f):
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
    return np.linalg.qr(freedoms.closure.random_stress(np.random.default_rng(29), count))[0]


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
    tied += [name for load in system.m.loads if load.takes_coordinate for name in load.freedoms]
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
        if not system.m.couplings[i].alone:
            continue
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
    named = tuple(
        (pairs[c.item].name, pairs[c.item].type.symbol, c.pair.type.symbol)
        if c.pair is not None
        else (couplings[c.item - len(pairs)].name, COUPLING, LEFT_OUT)
        for c in changes
    )
    turns = tuple(float(np.degrees(c.turn)) for c in changes)
    return _before_after(before, freedoms_at(after_changes, column[driven], engine), named, turns)


def _before_after(
    before: Freedoms, after: Freedoms, changes: tuple[tuple[str, str, str], ...], turns: tuple[float, ...]
) -> Effect:
    return Effect(
        changes,
        (before.redundancy, after.redundancy),
        (before.mobility, after.mobility),
        (len(before.passive), len(after.passive)),
        turns,
    )


CYLINDER = ("S", "C", "S")
"""Pair types of a cylinder that carries force along its line alone: ball joint, piston in a round bore, ball joint."""


def relieving(
    position: Position, changes: list[Change], redundancy: int, budget: Budget
) -> tuple[list[tuple[Change, ...]], list[tuple[Change, ...]]]:
    """Single changes that lower the redundancy, and smallest sets that remove it, without more freedoms than self-stresses removed.

    Ranked by how little they change: freedoms added beyond need, then number of changes, then the order of declaration. Where there are
    too many self-stresses for that the set is one change in every loop. Sets are sought as far as the ``budget`` goes.
    """
    every = sorted((c for c in changes if c.relief), key=lambda c: (c.added - c.relief, -c.relief, c.effort, c.item))
    built = [c for c in every if c.effort < PLANE]
    singles: list[tuple[Change, ...]] = [(c,) for c in spread(built or every)]
    if redundancy > LARGEST_FOR_SETS:
        return singles, [_one_in_every_loop(position, built or every)]
    largest: list[tuple[Change, ...]] = []
    for some in (built, every):
        exact = [c for c in some if c.added == c.relief]
        complete, most = _complete_sets(exact, redundancy, budget) if exact else ([], [])
        if complete:
            return singles, complete
        largest = largest or most
    return singles, [chosen for chosen in largest if len(chosen) > 1]


def _one_in_every_loop(position: Position, ranked: list[Change]) -> tuple[Change, ...]:
    """For every loop the best change of a pair that no loop before has changed, if possible of one that is in no other loop."""
    best: dict[int, Change] = {}
    for c in ranked:
        best.setdefault(c.item, c)
    loops_of = Counter(k for loop in position.graph.loops for k, _ in loop)
    chosen: dict[int, Change] = {}
    for loop in position.graph.loops:
        mine = [best[k] for k, _ in loop if k in best and k not in chosen]
        if mine:
            c = min(mine, key=lambda c: (c.added - c.relief, -c.relief, loops_of[c.item], c.effort, c.item))
            chosen[c.item] = c
    return tuple(chosen[k] for k in sorted(chosen))


@dataclass(frozen=True)
class _Set:
    """Changes (by number) that together remove ``removed`` self-stresses; for the changes from ``first`` on, all of later pairs, what
    these leave of their ``directions (n, a, s)``, and whether they can still be added: all their directions are left.
    """

    chosen: tuple[int, ...]
    removed: int
    first: int
    directions: Array
    free: NDArray[np.bool_]

    def with_change(self, i: int, items: Index, added: Index) -> _Set:
        """One more change; only what overlaps with its directions is looked at anew."""
        new = np.linalg.svd(self.directions[i - self.first], full_matrices=False)[2][: added[i]]
        later = int(np.searchsorted(items, items[i], side="right"))
        directions, free = self.directions[later - self.first :].copy(), self.free[later - self.first :].copy()
        overlap = directions @ new.T
        met = np.flatnonzero(free & (np.abs(overlap) > STRESSES.relieved).any(axis=(1, 2)))
        directions[met] -= overlap[met] @ new
        free[met] = _independent(directions[met], added[later:][met])
        return _Set((*self.chosen, i), self.removed + int(added[i]), later, directions, free)


def _independent(directions: Array, added: Index) -> NDArray[np.bool_]:
    """Whether directions ``(n, a, s)``, of which the first ``added (n,)`` count, are independent: by their Gram matrices."""
    gram = directions @ np.swapaxes(directions, 1, 2)
    return np.asarray((np.linalg.eigvalsh(gram) > STRESSES.relieved**2).sum(axis=1) == added)


def _complete_sets(
    exact: list[Change], redundancy: int, budget: Budget
) -> tuple[list[tuple[Change, ...]], list[tuple[Change, ...]]]:
    """Sets of changes that together remove all self-stresses, each as many as it adds freedoms; else those that remove most.

    A set grows by changes of later pairs, a beam of sets at a time, those first that remove most.
    """
    exact = sorted(exact, key=lambda c: c.item)
    items, added = (np.array([getattr(c, name) for c in exact], dtype=np.intp) for name in ("item", "added"))
    directions = np.zeros((len(exact), int(added.max()), exact[0].power.shape[1]))
    for mine, c in zip(directions, exact, strict=True):
        mine[: c.added] = np.linalg.svd(c.power, full_matrices=False)[2][: c.added]
    at: list[int] = items.tolist()
    beam = [_Set((), 0, 0, directions, np.ones(len(exact), dtype=bool))]
    complete: list[tuple[int, ...]] = []
    largest: list[tuple[int, ...]] = []
    most = 0
    while beam:
        budget.left -= 1e-5 * len(beam) * len(exact)  # measured
        if budget.ended:
            break
        grown = [
            (mine.removed + int(added[i]), mine, i)
            for mine in beam
            for i in (mine.first + np.flatnonzero(mine.free)).tolist()
        ]
        # changes are numbered by item, so that equal sets of items stay in the order of their types
        order = {id(mine): [at[k] for k in mine.chosen] for mine in beam}
        grown.sort(key=lambda g: (-g[0], order[id(g[1])], at[g[2]]))
        complete += [(*mine.chosen, i) for removed, mine, i in grown if removed == redundancy]
        if grown and grown[0][0] > most:
            most, largest = grown[0][0], []
        largest = [(*mine.chosen, i) for removed, mine, i in grown[:2] if removed == most] + largest
        # partial sets of changes kept while searching
        going = [(mine, i) for removed, mine, i in grown if removed < redundancy][:12]
        beam = [mine.with_change(i, items, added) for mine, i in going]
    return [tuple(exact[i] for i in s) for s in complete], [tuple(exact[i] for i in s) for s in largest]


def mixed(complete: list[tuple[Change, ...]]) -> list[tuple[Change, ...]]:
    """Up to two sets of every size, those that are easily built and whose widest change is smallest first."""
    out: list[tuple[Change, ...]] = []
    for size in sorted({len(chosen) for chosen in complete}):
        mine = [chosen for chosen in complete if len(chosen) == size]
        out += sorted(mine, key=lambda chosen: (max(c.effort for c in chosen), max(c.added for c in chosen)))[:2]
    return out


def spread(singles: list[Change]) -> list[Change]:
    """The best changes, not all at one pair: the best of every pair first."""
    first: list[Change] = []
    rest: list[Change] = []
    seen: set[int] = set()
    for c in singles:
        (rest if c.item in seen else first).append(c)
        seen.add(c.item)
    return (first + rest)[:CHANGES_SHOWN]


def cylinders(position: Position) -> list[tuple[int, int, int]]:
    """Foot, slide and head: a slide both links of which have one more pair."""
    pairs_of: dict[int, list[int]] = {}
    for k, ends in enumerate(position.graph.ends):
        for link in ends:
            pairs_of.setdefault(link, []).append(k)
    out = []
    for k, ends in enumerate(position.graph.ends):
        row = position.type_of(k)
        around = [[other for other in pairs_of[link] if other != k] for link in ends if link != position.graph.frame]
        if row.f == 1 and not row.freedoms[0].turns and [len(others) for others in around] == [1, 1]:
            out.append((around[0][0], k, around[1][0]))
    return out


def between_balls(position: Position, changes: list[Change], redundancy: int) -> list[tuple[Change, ...]]:
    """All cylinders between balls, with changes of other pairs that remove the rest, and alone.

    The halves of a cylinder between balls spin, which is passive.
    """
    found = {(c.item, c.pair.type.symbol): c for c in changes if c.pair is not None}
    sets = [[found.get(key) for key in zip(three, CYLINDER, strict=True)] for three in cylinders(position)]
    chosen = [c for three in sets if all(three) for c in three if c is not None]
    if not chosen:
        return []
    exact = sorted((c for c in changes if c.added == c.relief and c.effort < PLANE), key=lambda c: (c.effort, c.item))
    whole = _completed(chosen, exact) if redundancy <= LARGEST_FOR_SETS else chosen
    return [tuple(chosen)] if len(whole) == len(chosen) else [tuple(whole), tuple(chosen)]


def _completed(chosen: list[Change], exact: list[Change]) -> list[Change]:
    """The changes chosen and others, one after the other, each of which removes as many self-stresses as it adds freedoms."""
    left = null_space(np.concatenate([c.power for c in chosen]), STRESSES.relieved)
    out, taken = list(chosen), {c.item for c in chosen}
    for c in exact:
        power = c.power @ left
        if left.shape[1] and c.item not in taken and np.linalg.matrix_rank(power, tol=STRESSES.relieved) == c.added:
            out.append(c)
            taken.add(c.item)
            left = left @ null_space(power, STRESSES.relieved)
    return out


def with_spline(m: Mechanism, link: str) -> Mechanism:
    """The mechanism with a spline in a link of two pairs, along the line of their points.

    The second pair goes to the new half, which has no mass; mass and loads stay with the old one.
    """
    one, two = (p for p in m.pairs if link in (p.a, p.b))
    p, q = (np.asarray(pair.markers[pair.b == link].point) for pair in (one, two))
    taken = {*m.link_names(), *(pair.name for pair in m.pairs)}
    half, spline = (_free(f"{link}-{what}", taken) for what in ("half", "spline"))
    marker = Marker((p + q) / 2, q - p)
    moved = two.replace(**{"b" if two.b == link else "a": half})
    pairs = [moved if pair.name == two.name else pair for pair in m.pairs]
    return m.replace(
        links=[*m.links, Link(half)], pairs=[*pairs, Pair(spline, SPLINE, link, half, on_a=marker, on_b=marker)]
    )


def _free(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "'"
    return name


def splines(freedoms: Freedoms, driven: Index, engine: EngineName = "auto") -> Iterator[Effect]:
    """The effect of a spline in shafts between joints of two freedoms or more that a self-stress pulls along their line."""
    position = freedoms.position
    here, m = position.declared, position.m
    states = pair_states(here, stresses_of(freedoms))[3:, :, :, 0]
    points = here.pair_points[:, :, 0]
    of_link: dict[int, list[int]] = {}
    for k, ends in enumerate(position.graph.ends):
        for link in ends:
            of_link.setdefault(link, []).append(k)
    names, tried = m.link_names(), 0
    for link, pairs in of_link.items():
        if link == position.graph.frame or len(pairs) != 2 or min(position.type_of(k).f for k in pairs) < 2:
            continue
        line = points[:, pairs[1]] - points[:, pairs[0]]
        length = float(np.linalg.norm(line))
        # most shafts for which the effect is computed, each on a mechanism of its own
        if tried == 2 or length < MOTIONS.still:
            continue
        if np.abs(line @ states[:, pairs[0]]).max(initial=0.0) > STRESSES.relieved * length:
            tried += 1
            new = with_spline(at_position(m, here.system, here.x[:, 0]), names[link])
            yield _effect_of(freedoms, new, ((names[link], RIGID, SPLINE),), engine)


def _effect_of(
    before: Freedoms, new: Mechanism, changes: tuple[tuple[str, str, str], ...], engine: EngineName
) -> Effect:
    """The effect of changes, computed from a mechanism of its own."""
    system, x = assembled(new)
    columns, _ = named_columns(new, system, {d.freedom: 0.0 for d in new.drives})
    return _before_after(before, free_motion(system, x, columns, engine), changes, (0.0,) * len(changes))


def floating(freedoms: Freedoms, engine: EngineName = "auto") -> Iterator[Effect]:
    """The effect of gears that float between those with which they mesh, in place of a bearing: sun and ring of several planets."""
    m, here = freedoms.position.m, freedoms.position.declared
    mates = Counter(m.gear(name).link for c in m.couplings if isinstance(c, Mesh) for name in (c.a, c.b))
    ends = Counter(link for pair in m.pairs for link in (pair.a, pair.b))
    most = max(mates.values(), default=0)
    single = {link for link, count in mates.items() if count == most > 1 == ends[link] and link != m.frame}
    held = [pair.name for pair in m.pairs if motion_of(pair) == "turn" and single & {pair.a, pair.b}]
    rows = (in_plane(row) if m.planar else row for row in TABLE.values())
    free = next(row.symbol for row in rows if row and sorted(f.name for f in row.freedoms) == ["Rz", "Tx", "Ty"])
    for chosen in (
        (*((name,) for name in held[:2]), tuple(held[:2])) if held else ()
    ):  # a second one where one leaves some
        new = at_position(m, here.system, here.x[:, 0])
        for name in chosen:
            new = new.with_pair_type(name, free)
        yield _effect_of(freedoms, new, tuple((name, CENTERED, free) for name in chosen), engine)


def rank_key(chosen: tuple[Change, ...]) -> tuple[int, int, int]:
    """Those easiest to build first (by the hardest change, as in the advice), then fewer, then narrower ones."""
    return max(c.effort for c in chosen), len(chosen), max(c.added for c in chosen)


def self_aligning_sets(changes: Iterable[Change], redundancy: int, most: int | None) -> Iterator[tuple[Change, ...]]:
    """The sets of up to ``most`` of the changes (None: of any number) that remove the whole redundancy, the best first.

    Found one after the other, by ``rank_key`` and then by declaration, so that the first ones cost little however many there are.
    """
    if not 0 < redundancy <= LARGEST_FOR_SETS:
        return
    exact = sorted((c for c in changes if c.pair is not None and c.added == c.relief), key=lambda c: c.item)
    bases = {id(c): np.linalg.svd(c.power, full_matrices=False)[2][: c.added] for c in exact}
    sizes = range(1, min(redundancy, redundancy if most is None else most) + 1)
    widths = sorted({c.added for c in exact})
    for effort, size, widest in product(sorted({c.effort for c in exact}), sizes, widths):
        if size + widest - 1 <= redundancy <= size * widest:
            some = [c for c in exact if c.effort <= effort and c.added <= widest]
            for chosen in _sets(some, [bases[id(c)] for c in some], redundancy, size):
                if rank_key(chosen) == (effort, size, widest):
                    yield chosen


def _sets(exact: list[Change], bases: list[Array], redundancy: int, size: int) -> Iterator[tuple[Change, ...]]:
    """Sets of ``size`` changes of different pairs that remove ``redundancy`` self-stresses, in the order of the changes."""
    widest = max((c.added for c in exact), default=0)
    waiting: list[tuple[tuple[int, ...], Array]] = [((), np.zeros((0, bases[0].shape[1] if bases else 0)))]
    while waiting:
        chosen, basis = waiting.pop()
        left, further = redundancy - len(basis), size - len(chosen)
        if further == 0:
            yield tuple(exact[i] for i in chosen)
            continue
        longer = []
        for i in range(chosen[-1] + 1 if chosen else 0, len(exact)):
            added = exact[i].added
            reach = added + widest * (further - 1)
            fits = added == left if further == 1 else added <= left - (further - 1) and reach >= left
            if not fits or (chosen and exact[i].item == exact[chosen[-1]].item):
                continue
            rest = bases[i] - bases[i] @ basis.T @ basis
            _, s, Vt = np.linalg.svd(rest, full_matrices=False)
            if s[-1] > STRESSES.relieved:
                longer.append(((*chosen, i), np.concatenate([basis, Vt])))
        waiting += longer[::-1]


FEW_CHANGES, LARGEST_SET = 80, 3
"""Changes up to which the best of all sets of so many heads the advice, some hundredths of a second; of more, the best of a beam."""


def advice(
    freedoms: Freedoms, driven: Index, finite_mobility: int, engine: EngineName, budget: Budget
) -> tuple[Effect, ...]:
    """Changes worth making: those that remove redundancy without adding input freedoms; for a structure, those that free it.

    Where the ``budget`` ends those whose effect is known by then.
    """
    position, changes = freedoms.position, changes_of(freedoms)
    # seconds of an effect, and of every further change in it, measured on rings of 4 to 302 pairs
    one, change = 1e-3, 1e-4 * len(position.graph.ends)
    effects: list[Effect] = []
    if not (freedoms.mobility - len(freedoms.passive) and finite_mobility):
        wider = sorted((c for c in changes if c.added > c.relief), key=lambda c: (c.added, c.item))
        for plane in (False, True):
            some = spread([c for c in wider if (c.effort == PLANE) == plane])[:FREEING]
            freeing = (
                [effect(freedoms, driven, (c,), engine) for c in budget.of(some, one + change)] if not effects else []
            )
            effects += [e for e in freeing if e.inputs[1] > e.inputs[0]]
    if freedoms.redundancy:
        singles, complete = relieving(position, changes, freedoms.redundancy, budget)
        found: list[tuple[int, Effect]] = []
        on_balls = between_balls(position, changes, freedoms.redundancy)
        best = (
            islice(self_aligning_sets(changes, freedoms.redundancy, LARGEST_SET), 1)
            if len(changes) <= FEW_CHANGES
            else ()
        )
        for chosen in budget.of(dict.fromkeys((*on_balls, *best, *mixed(complete), *singles)), one):
            budget.left -= change * len(chosen)
            new = effect(freedoms, driven, chosen, engine)
            if any(new == other for _, other in found):
                continue
            if new.inputs[1] == new.inputs[0] and new.redundancy[1] < new.redundancy[0] and new not in effects:
                found.append((max(c.effort for c in chosen), new))
        # how hard a spline is to build (see ``pair_changes.EFFORTS``)
        found += [(1, new) for new in budget.of(splines(freedoms, driven, engine), 2.0 * (one + change))]
        afloat = budget.of(floating(freedoms, engine), 2.0 * (one + change))
        found += [
            (-1, new) for new in afloat if new.redundancy[1] < new.redundancy[0] and new.inputs[1] == new.inputs[0]
        ]
        found.sort(key=lambda item: (item[0] == PLANE, item[1].redundancy[1] > 0, item[0]))
        threes = [tuple(position.m.pairs[k].name for k in three) for three in cylinders(position)]
        effects += [replace(new, cylinders=_among(threes, new)) for _, new in found]
    return tuple(effects[: CHANGES_SHOWN + FREEING])


def _among(threes: list[tuple[str, ...]], effect: Effect) -> tuple[tuple[str, ...], ...]:
    """The cylinders all of whose pairs become those of one between balls."""
    made = {(name, new) for name, _, new in effect.changes}
    return tuple(three for three in threes if made.issuperset(zip(three, CYLINDER, strict=True)))
