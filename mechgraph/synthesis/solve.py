"""All solutions of a task: start sets by monodromy over tasks, the trace test, and tracks to the task at hand.

A random complex mechanism at random positions gives a task that it solves; as the task and the known dimensions go round, this solution
is led to others of the first task: finite ones only, and no others than mechanisms of its kind, as the pairs of a random mechanism do not
coincide. (Plecnik and Fearing, Finding only finite roots to large kinematic synthesis systems, J. Mech. Robotics 9, 2017.)

In the trace test what is asked of one row goes along a line: lengths, or else ``exp(i q)`` of an angle, are linear in one number, on which
the sum of a combination of the unknowns over all solutions depends rationally. A point goes along an isotropic direction ``v``, and of
unknown points such components count: of ``(p + z v - c)^2`` the square of ``z`` is gone, and of a circle in the plane only one of the two
points at infinity is met, so that the degree is a part of what it is along other lines, and fewer tasks tell it.
"""

from __future__ import annotations

import sys
import zipfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from functools import lru_cache, partial
from math import lcm, prod
from pathlib import Path
from typing import Any

import numpy as np

from mechgraph.errors import MechgraphError, counted
from mechgraph.files import cache_folder, whole_file
from mechgraph.maths.se3 import Index
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.modes.family import Array
from mechgraph.modes.homotopy import TRACKS_TOGETHER, Care, Mask, Tracked, follow, polished
from mechgraph.modes.start_sets import (
    MISSED,
    MISSED_AGAIN,
    MOST_TRACKED,
    NOT_PASSED,
    NOT_TESTED,
    Pencil,
    Trace,
    TrackGroup,
    distinct,
    tame,
    trace_test,
)
from mechgraph.modes.targets import FAR_APART, TrackRun, run_tracks
from mechgraph.synthesis.classes import TaskClass
from mechgraph.synthesis.labelling import TaskLabelling, by_motions, motions_of, placed, symmetries
from mechgraph.synthesis.legs import ClassMember, TaskLeg
from mechgraph.variants.numbers import MARKER

Progress = Callable[[str], None] | None


@dataclass(frozen=True)
class TaskStart:
    """All solutions ``x (nx, N)`` known of a task of a class, and what that they are all rests on (see ``modes.start_sets.StartSet``).

    ``source``: who published that there are so many, for sets that came with the package. Of a large set ``x`` has one of
    ``each`` solutions that do the same; ``alike (nx, N, k)`` are these, but for exchanges of pairs, as far as they are known.
    ``against``: how many fail some of what is asked, see ``doing_all``. ``estimate``: how many there are in words, where loops bring
    further ones.
    """

    member: ClassMember
    alike: Array
    loops: int
    chance: float
    lost: int
    followed: int
    trace: Trace
    source: str = ""
    each: int = 1
    against: int = 0
    estimate: str = ""

    @property
    def x(self) -> Array:
        """One of all that do the same."""
        return self.alike[:, :, 0]

    @property
    def total(self) -> int:
        """How many solutions there are."""
        return (self.x.shape[1] - self.against) * self.each

    @property
    def word(self) -> str:
        """How sure it is that none is missing."""
        if self.source:
            return "proved"
        return "tested" if self.trace.passed and self.chance <= MISSED else "searched"

    @property
    def _each(self) -> str:
        told = f" ({self.x.shape[1]} times {self.each} that do the same, of which one is followed)"
        return told if self.each > 1 else ""

    @property
    def evidence(self) -> tuple[str, ...]:
        """What that rests on."""
        against = f"{self.against} more fail some of what is asked, and are left out; " if self.against else ""
        loops = (
            f"A random complex task of the class has {counted(self.total, 'solution')}{self._each}{self.estimate}: {against}"
            f"{counted(self.loops, 'loop')} of such tasks brought no further one (chance of one missed {self.chance:.1g} where all "
            f"permutations are as likely), {self.lost} of {self.followed} tracks lost."
        )
        if self.source:
            return (f"As many as such tasks have in general: {self.total}{self._each}, {self.source}.",)
        if not self.trace.passed:
            return (loops, NOT_TESTED)
        return (
            f"Trace test passed: over {self.trace.samples} tasks on a line a sum over all solutions is a rational function of degree "
            f"{self.trace.degree} (the singular values of its Loewner matrix end there: {self.trace.last:.1g}, {self.trace.beyond:.1g}).",
            loops,
        )


class TaskPencil:
    """Tasks on a line through that of a member: of one row lengths, or else ``exp(i q / n)`` of an angle, grow linearly with ``z``.

    The line leads towards a task that some mechanism does; the other rows leave a curve of mechanisms, which it cuts. Where couplings turn
    freedoms by parts of each other's angles, ``n`` is such that all are whole multiples of ``q / n``.
    """

    first = 16
    anywhere = staticmethod(Pencil.anywhere)

    def __init__(self, equations: TaskClass, base: ClassMember, rng: np.random.Generator) -> None:
        self.of, self.base = equations, base
        open_, length = movable(equations), equations.is_length
        # any row of those with as many conditions, any angle, of which the way is as long as any: of short ones poles lie too far away
        most = np.where(open_.any(axis=1), equations.conditions, -1)
        row = int(rng.choice(np.flatnonzero(most == most.max())))
        other = equations.random_members(rng, 1)[0].drive[row, :, 0] - base.drive[row, :, 0]
        part = rng.normal(size=2) @ [0.7, 0.7j]
        # one angle, or lengths alone: rational functions of several angles are of much higher degrees
        given = open_[row]
        moves = given & length if (given & length).any() else np.arange(len(given)) == rng.choice(np.flatnonzero(given))
        s, F = equations.problem.system, equations.problem.system.n_freedoms
        self.parts = _parts_of_turns(equations) if np.isin(equations.columns[moves], s.coupled_freedoms).any() else 1
        turned = np.exp(1j / self.parts * np.where(length, 1.0, other)) - 1.0
        grown = np.where(length, other, turned / np.where(turned == 0, 1.0, np.abs(turned)))
        points = [(c // F, s.pair_of_freedom[c % F]) for c in equations.columns]
        for own in _together([key if at else None for key, at in zip(points, moves & length, strict=True)]):
            grown[own] = np.linalg.norm(other[own]) * _isotropic(len(own), rng)
        self.rate = np.zeros(base.drive.shape[:2], dtype=complex)
        self.rate[row] = part * grown * moves
        places = (own[0] for own in equations.problem.places)
        groups = _together([(p.side, p.pair) if p.array == "point" else (k,) for k, p in enumerate(places)])
        self.each = np.zeros((len(groups), equations.u), dtype=complex)
        for weights, own in zip(self.each, groups, strict=True):
            weights[own] = (rng.normal(size=2) @ [1.0, 1.0j]) * _isotropic(len(own), rng)

    def members(self, phi: Array) -> ClassMember:
        """Tasks at ``phi (n,)``."""
        grown = self.rate[:, :, None] * (np.exp(1j * phi) - 1.0)
        length = self.of.is_length
        drive = self.base.drive + np.where(
            length[:, None], grown, -1j * self.parts * np.log(1.0 + np.where(length[:, None], 0.0, grown))
        )
        return ClassMember(self.base.numbers.taken(np.zeros(len(phi), dtype=np.intp)), drive)

    def sums(self, x: Array, phi: Array) -> tuple[Array, Array, Array]:
        """``z``, the sum and weights at pairs of tasks ``phi (n,)`` to both of which all tracks come."""
        n, N = len(phi), x.shape[1]
        tracked = follow(self.of.leg(self.base, self.members(phi), np.repeat(np.arange(n), N)), np.tile(x, n), Care())
        told = self.of.told(tracked.x)
        # as few of the unknowns as tell the solutions apart, each with poles of its own, but for a sum that is the same everywhere
        for weights in np.cumsum(self.each, axis=0):
            g = (weights @ told).reshape(n, N)
            varies = np.abs(g.sum(axis=1) - g[0].sum()).max() > MODES.real_singular * np.abs(g).max()
            if varies and len(distinct((weights @ self.of.told(x))[None])) == N:
                break
        size = np.maximum(1.0, np.abs(told).max(axis=0, initial=1.0)).reshape(n, N).max(axis=1)
        good = tracked.arrived.reshape(n, N).all(axis=1) & np.isfinite(g).all(axis=1)
        good = np.repeat(good.reshape(-1, 2).all(axis=1), 2)
        z = np.exp(1j * phi)
        return z[good], g.sum(axis=1)[good], (np.maximum(1.0, np.abs(z)) / size)[good]


def _together(keys: Sequence[tuple[Any, ...] | None]) -> list[list[int]]:
    """Numbers of those that have a key in common, in the order of keys; None is no key."""
    return [[k for k, own in enumerate(keys) if own == key] for key in dict.fromkeys(keys) if key is not None]


def _isotropic(n: int, rng: np.random.Generator) -> Array:
    """A random direction ``v (n,)`` with ``v . v = 0``; of one number itself."""
    ends = np.linalg.qr(rng.normal(size=(n, 2)))[0]
    return np.asarray(ends @ np.array([1.0, 1.0j])[: ends.shape[1]])


def movable(of: TaskClass) -> Mask:
    """What is asked ``(R, d)`` in which the equations are linear, or rational in ``exp(i q)``."""
    _, endless, bound = of.problem.plain_angles
    return of.given & ~np.isin(of.columns, bound) & (not endless)


def _parts_of_turns(of: TaskClass) -> int:
    """The least ``n`` such that couplings make all angles whole multiples of the ``n``-th part of each."""
    rows = (row[row != 0].tolist() for row in of.problem.system.coupling_matrix[:, :, 0])
    # teeth of which ratios are made
    parts = ([Fraction(a / b).limit_denominator(1000).denominator for a in row for b in row] for row in rows)
    return prod(lcm(*row) for row in parts)


def start_set(
    of: TaskClass,
    rng: np.random.Generator,
    progress: Progress,
    published: tuple[int, str] | None = None,
    some: bool = False,
) -> TaskStart:
    """All solutions of a random task of a class; where there are as many as were ``published``, no test is needed. Where ``some`` of them
    will do, those known when they turn out to be many.
    """
    # solutions from which on they are not looked for any further, and from which on one is followed of those that do the same
    (most, source), many = published or (20_000, ""), 100
    group = TrackGroup(of, of.start, of.x[:, None], min(most, many))
    group.grow(MISSED, rng, progress)
    if group.x.shape[1] >= many:
        if source and len(motions_of(of, group.base, group.x)):
            return _of_each(of, group, most, source, rng, progress)
        group.most = most
        if not some:
            group.grow(MISSED, rng, progress)
    known = group.quiet, group.chance
    if known[1] > MISSED and (some or group.followed >= MOST_TRACKED):
        return TaskStart(
            group.base, group.x[:, :, None], *known, group.lost, group.followed, NOT_PASSED, estimate=group.estimate
        )
    group.move(*tame(of, group.base, group.x, rng))
    if source and group.x.shape[1] == most:
        return TaskStart(group.base, group.x[:, :, None], *known, group.lost, group.followed, NOT_PASSED, source)
    lines = bool(movable(of).any())
    trace = (
        trace_test(of, group.base, group.x, rng, progress, TaskPencil) if known[1] <= MISSED and lines else NOT_PASSED
    )
    if not trace.passed and lines:
        group.grow(MISSED_AGAIN, rng, progress)
        known = group.quiet, group.chance
        trace = trace_test(of, group.base, group.x, rng, progress, TaskPencil) if known[1] <= MISSED_AGAIN else trace
    return TaskStart(group.base, group.x[:, :, None], *known, group.lost, group.followed, trace)


def _of_each(
    of: TaskClass, group: TrackGroup, most: int, source: str, rng: np.random.Generator, progress: Progress
) -> TaskStart:
    """One of all solutions that do the same, by straight ways between all pairs of some tasks, which make three loops.

    They are all where they are a whole part of how ``most`` there are, and no other task has more.
    """
    followed, n = by_motions(of), 4
    tasks, told = [group.base, *of.random_members(rng, n - 1)], followed.fingerprints(group.base, group.x)
    x, prints = ([v[:, distinct(told)], *[v[:, :0]] * (n - 1)] for v in (group.x, told))
    ways = [(a, b) for a in range(n) for b in range(n) if a != b]
    # where each one leads, and all that came to where each one is
    to: dict[tuple[int, int], dict[int, int]] = {way: {} for way in ways}
    came = [[v[:, [k]] for k in range(v.shape[1])] for v in x]
    lost, tracks = group.lost, group.followed
    while (longest := max((x[a].shape[1] - len(to[a, b]), a, b) for a, b in ways))[0]:
        left, a, b = longest
        todo = np.setdiff1d(np.arange(x[a].shape[1]), list(to[a, b]))[:TRACKS_TOGETHER]
        if progress is not None:
            progress(f"{[v.shape[1] for v in x]} solutions of {n} random tasks so far, {left} tracks to the next")
        tracked = follow(of.leg(tasks[a], tasks[b]), x[a][:, todo], Care())
        there = tracked.x[:, tracked.arrived]
        found = followed.fingerprints(tasks[b], there)
        new = distinct(found, prints[b])
        x[b], prints[b] = (np.concatenate(v, axis=1) for v in ((x[b], there[:, new]), (prints[b], found[:, new])))
        came[b] += [there[:, :0]] * len(new)
        place = [int(np.abs(prints[b] - one[:, None]).max(axis=0).argmin()) for one in found.T]
        to[a, b] |= dict.fromkeys(todo.tolist(), -1) | dict(zip(todo[tracked.arrived].tolist(), place, strict=True))
        to[b, a] |= dict(zip(place, todo[tracked.arrived].tolist(), strict=True))
        for k, state in zip(place, there.T[:, :, None], strict=True):
            came[b][k] = np.concatenate([came[b][k], state], axis=1)
        lost, tracks = lost + len(todo) - len(place), tracks + len(todo)
    N = [v.shape[1] for v in x]
    chance = (1.0 / (N[0] + 1) + lost / tracks) ** 3 if len(set(N)) == 1 else 1.0
    if N[0] != max(N) or most % N[0]:
        return TaskStart(group.base, x[0][:, :, None], 3, chance, lost, tracks, NOT_PASSED)
    each = most // N[0]
    alike = _alike(of, tasks, to, came, each // (1 + len(symmetries(of.whole))), progress)
    return TaskStart(group.base, alike, 3, chance, lost, tracks, NOT_PASSED, source, each)


def _alike(
    of: TaskClass,
    tasks: list[ClassMember],
    to: dict[tuple[int, int], dict[int, int]],
    came: list[list[Array]],
    K: int,
    progress: Progress,
) -> Array:
    """States ``(nx, N, K)`` that do the same as solutions of the first of some tasks, and that no exchange makes of each other.

    Of ``came`` to a task from others, whatever way, what does the same leads to what does the same: to the first task, and where nothing
    new comes there to the others. ``to``: where every solution leads; ``K`` may be fewer where tracks are lost.
    """
    exchanges, gone = symmetries(of.whole), {way: dict[int, int]() for way in to}

    def joined(known: Array, states: Array) -> Array:
        """What is known with those among ``states (nx, n)`` that no exchange makes of it."""
        for x in states.T[:, :, None]:
            z = known[: of.u]
            z = np.concatenate([z, *(z[np.argsort(one.places)] for one in exchanges)], axis=1)
            known = np.concatenate([known, x[:, distinct(x[: of.u], z)]], axis=1)
        return known

    known = [[joined(states[:, :1], states[:, 1:]) for states in arrived] for arrived in came]

    def left(a: int, b: int) -> list[int]:
        """Solutions of which some lead from one task to another where some are missing; one alone has come or gone."""
        return [
            k
            for k, j in to[a, b].items()
            if j >= 0 and known[a][k].shape[1] > gone[a, b].get(k, 1) and known[b][j].shape[1] < K
        ]

    while any(v.shape[1] < K for v in known[0]):
        ways = ((a, b, left(a, b)) for a, b in sorted(to, key=lambda way: way[1] > 0))
        a, b, some = next((way for way in ways if way[2]), (0, 0, []))
        if not some:
            break
        some = some[: TRACKS_TOGETHER // K]
        if progress is not None:
            progress(f"{sum(v.shape[1] for v in known[0])} of {len(known[0]) * K} solutions that do the same")
        begin = [known[a][k][:, gone[a, b].get(k, 0) :] for k in some]
        tracked = follow(of.leg(tasks[a], tasks[b]), np.concatenate(begin, axis=1), Care())
        of_which = np.repeat(some, [v.shape[1] for v in begin])
        for k in some:
            gone[a, b][k] = known[a][k].shape[1]
            known[b][to[a, b][k]] = joined(known[b][to[a, b][k]], tracked.x[:, (of_which == k) & tracked.arrived])
    K = min(v.shape[1] for v in known[0])
    return np.stack([v[:, :K] for v in known[0]], axis=1)


# --- kept in a folder ----------------------------------------------------------------------------------------------------


PACKED = Path(__file__).with_name("start-sets.npz")
"""Start sets that come with the package, names are ``key/array``; made by ``tests/benchmarks/make_task_starts.py``."""


def kept(of: TaskClass) -> TaskStart | None:
    """The start set of a class that is kept by the user, or else came with the package, where there is one and it is closed."""
    labelling = TaskLabelling(of)
    key = labelling.key
    return _read(labelling, cache_folder() / f"task-{key}.npz", "") or _read(labelling, PACKED, f"{key}/")


@lru_cache(8)
def _stored(file: Path, prefix: str, written: int) -> Mapping[str, Array]:
    """The arrays of a set in a file as it was ``written`` last [ns]."""
    with file.open("rb") as handle, np.load(handle, allow_pickle=False) as f:
        return {name.removeprefix(prefix): f[name] for name in f.files if name.startswith(prefix)}


def _read(labelling: TaskLabelling, file: Path, prefix: str) -> TaskStart | None:
    try:
        f = _stored(file, prefix, file.stat().st_mtime_ns)
        loops, lost, followed, degree, samples = f["counts"].tolist()
        chance, last, beyond = f["sizes"].tolist()
        source, estimate = str(f["source"]), str(f.get("estimate", ""))
        (each, K), stored = np.append(f["each"], 1)[:2].tolist(), f["x"]
        if not np.iscomplexobj(stored):
            stored = stored.astype(float) @ [1.0, 1.0j]
            stored[:, f["exactly"]] = f["exact"]
        member, x = labelling.taken({name: f[name] for name in MARKER}, f["drive"], stored)
        alike = x.reshape(len(x), -1, K)
        # digits that were left out come back
        of, tracks = labelling.of, np.zeros(alike.shape[1], dtype=np.intp)
        alike[:, :, 0], closed = polished(of.leg(member, member), alike[:, :, 0], 1.0, tracks)
        trace = Trace(degree, samples, last, beyond)
        found = TaskStart(member, alike, loops, chance, lost, followed, trace, source, each, estimate=estimate)
        here = of.at(member, found.x)
        size = np.maximum(1.0, np.abs(here.here.poses).max())
        return found if closed.all() and of.error(here).max() < MODES.member_closed * size else None
    except (OSError, ValueError, KeyError, IndexError, EOFError, RuntimeError, zipfile.BadZipFile, TypeError):
        return None


def arrays(labelling: TaskLabelling, start: TaskStart) -> dict[str, Any]:
    """A start set as arrays by name."""
    sizes = np.array([start.chance, start.trace.last, start.trace.beyond])
    counts = np.array([start.loops, start.lost, start.followed, start.trace.degree, start.trace.samples])
    told = {
        "sizes": sizes,
        "counts": counts,
        "source": np.array(start.source),
        "estimate": np.array(start.estimate),
        "each": np.array([start.each, start.alike.shape[2]]),
    }
    return labelling.ordered(start.member, start.alike.reshape(len(start.x), -1)) | told


def _keep(of: TaskClass, start: TaskStart) -> None:
    """Keep a start set, as far as the folder allows."""
    labelling = TaskLabelling(of)
    try:
        cache_folder().mkdir(parents=True, exist_ok=True)
        with whole_file(cache_folder() / f"task-{labelling.key}.npz") as temporary, temporary.open("xb") as handle:
            np.savez_compressed(handle, **arrays(labelling, start))
    except (OSError, RuntimeError, MechgraphError):
        return


# --- the task at hand ----------------------------------------------------------------------------------------------------


@dataclass
class TaskEnds:
    """What tracks to a task came to: regular solutions ``x (nx, n)``, singular ones, and how many went to infinity or were lost."""

    x: Array
    singular: Array
    infinite: int
    lost: int
    runs: int

    def join(self, of: TaskClass, goal: ClassMember, there: Array, tracks: int) -> None:
        """Put regular ends ``(nx, n)`` of some of all ``tracks``, and their conjugates, to those that are known."""
        # a task in real numbers has with each solution the conjugate one; what is known differs from others by the noise of both
        first = MODES.one_assembly if not self.x.size else of.apart
        for states, apart in ((there, first), (there.conj(), MODES.noise_apart)):
            if self.x.shape[1] < tracks:
                least = np.full(states.shape[1], apart)
                new = distinct(of.fingerprints(goal, states), of.fingerprints(goal, self.x), least)
                self.x = np.concatenate([self.x, states[:, new]], axis=1)
        # what another run or way finds was wrongly told at infinity or singular
        left = max(tracks - self.x.shape[1], 0)
        self.singular = self.singular[:, :left]
        self.infinite = min(self.infinite, left - self.singular.shape[1])
        self.lost = left - self.singular.shape[1] - self.infinite


def ends(
    of: TaskClass, start: TaskStart, goals: ClassMember, rng: np.random.Generator, progress: Progress
) -> list[TaskEnds]:
    """Tracks of all solutions of a start set to tasks; further runs by way of random tasks make up for tracks that are lost, and one looks
    again for those that seem singular or at infinity: a track that passes by infinity before its end is easily mistaken for one.
    """
    n, N = goals.drive.shape[-1], start.x.shape[1]
    of = by_motions(of) if start.each > 1 else of
    every, left = [TaskEnds(start.x[:, :0], start.x[:, :0], 0, N, 0) for _ in range(n)], np.arange(n)
    runs = 4 if N < TRACKS_TOGETHER else 2
    for run in range(runs):
        if progress is not None:
            progress(f"{counted(N, 'track')} to {counted(len(left), 'task')}, run {run + 1}")
        care = Care() if run < 2 else Care().finer
        begin, x = start.member, start.x
        if run:
            (begin,) = of.random_members(rng, 1)
            there = follow(of.leg(start.member, begin), x, care)
            x = there.x[:, there.arrived]
        block = max(1, TRACKS_TOGETHER // max(x.shape[1], 1))
        for some in np.split(left, np.arange(block, len(left), block)):
            which = np.repeat(np.arange(len(some)), x.shape[1])
            if not which.size:
                continue
            enough, way = (
                partial(_enough, of, goals.taken(some), which, N, [0]),
                of.leg(begin, goals.taken(some), which),
            )
            here = follow(way, np.tile(x, len(some)), care, enough=enough, told=progress)
            for j, place in enumerate(some.tolist()):
                mine, trust = which == j, 2 if run == runs - 1 else min(run, 1)
                leg = of.leg(begin, goals.taken(np.array([place])))
                _account(leg, every[place], x, here.x[:, mine], here.arrived[mine], N, care, trust)
        left = left[[every[i].lost > 0 or (not run and every[i].x.shape[1] < N) for i in left]]
        if not left.size:
            break
    return every


def _account(
    leg: TaskLeg, known: TaskEnds, x: Array, there: Array, arrived: Mask, N: int, care: Care, trust: int
) -> None:
    """Put the ends ``there`` of a run of tracks from ``x`` to those that are known, and look for those that are missing.

    The few tracks that failed, as they pass by infinity or where solutions meet, or of which two came to one end, are followed again, with
    finer steps and then on ways bent through complex tasks: any solution to which these lead is one. ``trust``: see ``_tell``.
    """
    of, goal = leg.equations, leg.end
    arrived = arrived.copy()
    arrived[arrived] = _lead(of, goal, there[:, arrived])
    regular = np.flatnonzero(arrived)
    known.join(of, goal, there[:, regular], N)
    known.runs += 1
    prints = of.fingerprints(goal, there[:, regular])
    twice = np.delete(prints, distinct(prints), axis=1)
    met = [
        np.abs(prints - one[:, None]).max(axis=0) <= MODES.one_assembly * max(1.0, np.abs(one).max()) for one in twice.T
    ]
    again = np.union1d(np.flatnonzero(~arrived), regular[np.any(met, axis=0)] if met else regular[:0])
    # how far ways are bent, at most .25 of that in the middle: the least that goes round what is near changes the fewest ends
    bends = 0.0, 0.01, -0.01, 0.03, -0.03, 0.003, -0.003
    for bend in bends if len(bends) * again.size <= N else ():  # where that costs less than another run of all tracks
        if not known.lost or not again.size:
            return
        tracked = follow(leg, x[:, again], care if bend else care.finer, partial(_bent, bend), again)
        found = tracked.x[:, tracked.arrived]
        known.join(of, goal, found[:, _lead(of, goal, found)], N)
    if known.lost and not arrived.all():
        # further runs go round ends so near that other branch points stay outside
        _tell(of, goal, known, run_tracks(leg, x[:, ~arrived], care, MODES.radius / 10 ** (known.runs - 1)), N, trust)


def _enough(of: TaskClass, goals: ClassMember, which: Index, N: int, seen: list[int], here: Tracked) -> bool:
    """Whether all ``N`` solutions of each of some real tasks are among those that have arrived and the conjugate ones.

    ``seen``: how many had arrived when that was last looked at; to look takes as long as many steps, where there are hundreds.
    """
    arrived = int(here.arrived.sum())
    if 20 * arrived < 21 * seen[0]:
        return False
    seen[0] = arrived
    for j in range(goals.drive.shape[-1]):
        x = here.x[:, here.arrived & (which == j)]
        if 2 * x.shape[1] < N:
            return False
        prints = of.fingerprints(goals.taken(np.array([j])), np.concatenate([x, x.conj()], axis=1))
        # they are not polished yet: what is nearer is one, as a real one and its conjugate are
        if len(distinct(prints, least=np.full(prints.shape[1], MODES.real_singular))) < N:
            return False
    return True


def _bent(bend: float, s: Array) -> tuple[Array, Array]:
    """A way through complex ``t``, see ``modes.homotopy.Way``."""
    return s + 1j * bend * s * (1.0 - s), 1.0 + 1j * bend * (1.0 - 2.0 * s)


def _tell(of: TaskClass, goal: ClassMember, known: TaskEnds, run: TrackRun, N: int, trust: int) -> None:
    """Put the ends of tracks led round them to those that are known.

    A track that is bounded near its end has a solution there. What closes nowhere, or far away, was led round more than its end, or is on
    its way to infinity: that is said of the former from ``trust`` 1 on, of the latter from 2 on.
    """
    x = np.concatenate([run.x[:, run.regular], run.x[:, run.singular]], axis=1)
    leads, meet = (np.arange(x.shape[1]) < run.regular.sum()) & _lead(of, goal, x), np.zeros(x.shape[1], dtype=bool)
    there, closed = _nearest(of, goal, x[:, ~leads])
    meet[~leads] = closed & (_apart(of, there, x[:, ~leads]) <= FAR_APART)
    gone = int((~closed).sum()) * (trust > 0) + int((closed & ~meet[~leads]).sum()) * (trust > 1)
    x[:, ~leads] = there
    # of each the run counts in which there are most
    if meet.sum() > known.singular.shape[1]:
        known.singular = x[:, meet]
    known.infinite = max(int(run.infinite.sum()) + gone, known.infinite)
    known.join(of, goal, x[:, leads], N)


def _lead(of: TaskClass, goal: ClassMember, x: Array) -> Mask:
    """States at which the matrix of the unknowns is not singular but for rounding."""
    if not x.shape[1]:
        return np.zeros(0, dtype=bool)
    sigma = np.linalg.svd(_matrix(of, goal, x), compute_uv=False)
    return np.asarray(sigma[:, -1] > 1e-14 * sigma[:, 0])


def _matrix(of: TaskClass, goal: ClassMember, x: Array) -> Array:
    """The matrices ``(n, u, u)`` of the unknowns at states; zero where it has no finite number."""
    return finite(of.leg(goal, goal).at(x, np.ones(x.shape[1]), np.arange(x.shape[1])).matrix)


def finite(A: Array) -> Array:
    """Zero for what is no finite number."""
    return np.nan_to_num(A, nan=0.0, posinf=0.0, neginf=0.0)


def _least(A: Array, b: Array) -> Array:
    return np.linalg.pinv(finite(A), MODES.generic) @ finite(b)


def _nearest(of: TaskClass, goal: ClassMember, x: Array) -> tuple[Array, Mask]:
    """Solutions near states ``(nx, n)``, singular ones too, by steps with least unknowns; which closed."""
    if not x.shape[1]:
        return x, np.zeros(0, dtype=bool)
    here = of.leg(goal, goal).at(x, np.ones(x.shape[1]), np.arange(x.shape[1]))
    with np.errstate(all="ignore"):
        # steps by which a double root, to which each goes half of the way, is near to the root of rounding
        for _ in range(30):
            step = np.nan_to_num(here.solve(-here.rows.residual, _least))
            here = here.again(of.advance(here.x, step * np.minimum(1.0, 0.5 / np.maximum(of.size(here.x, step), 0.5))))
        return here.x, of.error(here.rows) < MODES.member_closed * np.maximum(1.0, np.abs(here.x[: of.u]).max(axis=0))


def _apart(of: TaskClass, x: Array, other: Array) -> Array:
    """How far apart unknowns are, against their size."""
    return np.asarray((np.abs(x - other)[: of.u] / (1.0 + np.abs(x[: of.u]))).max(axis=0, initial=0.0))


def endless(of: TaskClass, goal: ClassMember, x: Array) -> Mask:
    """Which singular solutions ``x (nx, n)`` others lie beside that are as singular: steps aside do not lead back."""
    if not x.shape[1]:
        return np.zeros(0, dtype=bool)
    aside = x.copy()
    V = np.linalg.svd(_matrix(of, goal, x))[2]
    # a step that is large against the root of rounding, and small against the size of the whole
    aside[: of.u] += 1e-2 * V[:, -1].conj().T * (1.0 + np.abs(x[: of.u]))
    there, closed = _nearest(of, goal, aside)
    sigma = np.linalg.svd(_matrix(of, goal, there), compute_uv=False)
    # a double root is come to but for 2^-30 of the step
    return closed & (sigma[:, -1] < MODES.generic * sigma[:, 0]) & (_apart(of, there, x) > 1e-3)


def start_of(
    of: TaskClass,
    rng: np.random.Generator,
    cache: bool,
    progress: Progress,
    again: bool = False,
    some: bool = False,
) -> TaskStart:
    """The start set of a class: a kept one, of which a test that no one passed may be tried ``again``, or else one that is made, see
    ``start_set``, and kept where it is whole.

    That takes so long that somebody who looks at a terminal or a notebook is told of it unasked.
    """
    known = kept(of) if cache else None
    if known is not None:
        if again and known.word == "searched" and known.chance <= MISSED and movable(of).any():
            known = replace(known, trace=trace_test(of, known.member, known.x, rng, progress, TaskPencil))
            if known.trace.passed:
                _keep(of, known)
        return known
    if progress is None and sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules):
        progress = partial(print, "mg.synthesize:", file=sys.stderr, flush=True)
    if progress is not None:
        progress(
            "first task of its kind: all solutions of a random one are worked out, and kept for others; seconds to minutes"
        )
    made = start_set(of, rng, progress, some=some)
    # where loops ended by their number, those of a later call would get no further
    if cache and (made.word == "tested" or made.chance <= MISSED_AGAIN or made.followed >= MOST_TRACKED):
        _keep(of, made)
    return made


def unfolded(
    of: TaskClass, start: TaskStart, goal: ClassMember, found: TaskEnds, rng: np.random.Generator, progress: Progress
) -> tuple[Array, int]:
    """Solutions ``(nx, n)`` of a task with all that do the same as the real ones, and how many of these were not found.

    What leads from one to another that does the same leads real ones to real ones, where its coefficients are real, and no others to these.
    """
    if start.each == 1:
        return found.x, 0
    real = imaginary_part(found.x[: of.u]) < MODES.real_singular
    x, exchanges = alike_at(of, start, goal, found.x[:, real], progress), symmetries(of.whole)
    swapped = [x[: of.u][np.argsort(one.places)] for one in exchanges]
    if swapped and x.size:
        begin = np.tile(x[of.head :].reshape(of.R, of.nx, -1), len(swapped))
        turned, closed = placed(of, goal, np.concatenate(swapped, axis=1), rng, [begin])
        x = np.concatenate([x, turned[:, closed]], axis=1)
    return np.concatenate([found.x[:, ~real], x], axis=1), int(real.sum()) * start.each - x.shape[1]


def imaginary_part(values: Array) -> Array:
    """Imaginary parts ``(n,)`` of numbers ``(k, n)``, the largest of each column against its size."""
    size = np.maximum(1.0, np.abs(values).max(axis=0, initial=1.0))
    return np.asarray(np.abs(values.imag).max(axis=0, initial=0.0) / size)


def alike_at(of: TaskClass, start: TaskStart, goal: ClassMember, x: Array, progress: Progress) -> Array:
    """Solutions ``x (nx, n)`` of a task, or exchanges of them, with those that do the same: these lead to the start set, and what does the
    same there leads back.
    """
    K, told = start.alike.shape[2], motions_of(of, start.member, start.x)
    if progress is not None and K > 1:
        progress(f"{counted(x.shape[1], 'solution')}, and those that do the same")
    out, left = [x[:, :0]], x
    for bend in (0.0, 0.1, -0.1, 0.3, -0.3) if K > 1 else ():
        if not left.shape[1]:
            break
        begun = follow(of.leg(goal, start.member), left, Care(), partial(_bent, bend))
        at = [int(np.abs(told - one[:, None]).max(axis=0).argmin()) for one in motions_of(of, start.member, begun.x).T]
        some = start.alike[:, at].reshape(len(x), -1)
        some, closed = polished(of.leg(start.member, start.member), some, 1.0, np.zeros(some.shape[1], dtype=np.intp))
        there = follow(of.leg(start.member, goal), some, Care(), partial(_bent, -bend))
        apart = np.abs(motions_of(of, goal, there.x) - np.repeat(motions_of(of, goal, left), K, axis=1)).max(axis=0)
        same = closed & there.arrived & (apart < MODES.noise_apart)
        good = begun.arrived & same.reshape(-1, K).all(axis=1)
        out.append(there.x[:, np.repeat(good, K)])
        left = left[:, ~good]
    return np.concatenate([*out, left], axis=1)


# --- real solutions ------------------------------------------------------------------------------------------------------


def doing_all(of: TaskClass, member: ClassMember, x: Array) -> Mask:
    """Which solutions ``x (nx, n)`` do all that is asked.

    Of conditions that depend on each other in general not all are solved for: where links are given they may be met in other positions of
    these, among which tracks may change.
    """
    member, whole = of.lifted(member, x.astype(complex))
    # places of links on rods lose digits, of long ones by the square of the length; another position misses by a length or an angle
    size = np.maximum(1.0, np.abs(x[: of.u]).max(axis=0, initial=0.0)) ** (1 if of.problem is of.whole else 2)
    return np.asarray(of.full.error(of.full.at(member, whole)) < 1e6 * MODES.member_closed * size)


def real_states(of: TaskClass, goal: ClassMember, x: Array) -> tuple[Array, Array, Array]:
    """Real ones of solutions ``x (nx, n)`` of a task, closed to rounding, their errors in all rows, and which these are ``(n,)``.

    Of a row that leaves the mechanism a choice, of a motion or of assemblies, a track may end at a complex position where there are real
    ones: these are looked for from where other rows stand, and then at random.
    """
    which = np.flatnonzero(imaginary_part(x[: of.u]) < MODES.real_singular)
    states, error, good = _closed_real(of, goal, x[:, which])
    if left := int((~good).sum()):
        rows = states[of.head :, ~good].reshape(of.R, of.nx, left)
        rest = np.concatenate([of.problem.at_rest, np.zeros(of.nx - of.states)])
        near = [np.broadcast_to(rest[:, None], rows.shape), *(np.roll(rows, k, axis=0) for k in range(1, of.R))]
        z = x[: of.u, which[~good]].real.astype(complex)
        again, came = placed(of, goal, z, np.random.default_rng(0), np.nan_to_num(near), 0.0)
        at = np.flatnonzero(~good)[came]
        states[:, at], error[at], good[at] = _closed_real(of, goal, again[:, came])
        # another mechanism, to which unknowns were led from there, is none of these
        size = np.maximum(1.0, np.abs(x[: of.u, which]).max(axis=0, initial=0.0))
        good &= np.abs(states[: of.u] - x[: of.u, which]).max(axis=0, initial=0.0) < MODES.real_singular * size
    return states[:, good], error[good], which[good]


def _closed_real(of: TaskClass, goal: ClassMember, x: Array) -> tuple[Array, Array, Mask]:
    """Real states near others ``(nx, n)`` by Newton's method, their errors in all rows, and which of them are solutions near by."""
    if not x.shape[1]:
        return x.real, np.zeros(0), np.zeros(0, dtype=bool)
    leg, t, tracks = of.leg(goal, goal), np.ones(x.shape[1]), np.arange(x.shape[1])
    with np.errstate(all="ignore"):
        here = leg.at(x.real.astype(complex), t, tracks)
        # Newton steps to rounding, in real numbers: there one that has no real solution near by does not come to rest
        for _ in range(8):
            step = here.newton(here.idle()).real
            here = here.again(of.advance(here.x, step).real.astype(complex))
            if of.size(here.x, step).max() < MODES.real_closed:
                break
        # of what went off, no number
        error = of.error(here.rows)
    size = np.maximum(1.0, np.abs(x[: of.u]).max(axis=0, initial=0.0))
    moved = np.abs(here.x[: of.u] - x[: of.u]).max(axis=0, initial=0.0)
    good = (moved < MODES.real_singular * size) & (of.size(here.x, step) < np.sqrt(MODES.real_closed))
    good &= np.isfinite(here.x).all(axis=0)
    return here.x.real, error, good
