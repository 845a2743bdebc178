"""Targets: where the tracks of a start set end, group by group, and the products of groups.

From a start set to the assemblies of the mechanism itself: tracks to its geometry and drivers, with an endgame for singular ends.

A track that does not close quadratically at its end is taken up again at a distance ``r`` before it and led round the end, until it is
back after ``c`` turns; the mean of the states on these is the end (Cauchy's formula; Morgan, Sommese and Wampler, Numer. Math. 63, 1992).
A run of tracks on which none was lost and no two came together is an account of all assemblies; otherwise another run on a detour by a
random member makes up for it.

Structural groups in the equations of assemblies: parts of a mechanism that can be solved one after the other.

With all that is known at rest, the smallest sets of bodies that stand still by their own pairs and rods are groups (see
``structure.groups``); once one is solved its bodies are one, and the next is looked for among what is left. A group has a class of its
own, of which the mechanism is a member for every solution of the groups before: its bodies are these, its markers stand where they carry
them. So the assemblies over C are as many as the product of those of the groups, and none is missing where none is of any group.
Sources: Assur's groups, see ``structure.groups``; Sommese and Wampler, The Numerical Solution of Systems of Polynomials, 2005, chapter 7
(parameter homotopy).

Continua to which tracks come, and those that guesses find, by the point of each that is nearest to the start.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from mechgraph.graph.linkgraph import components_of_edges
from mechgraph.kinematics.state import CLOSED, Configuration, close_all
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import complement
from mechgraph.maths.se3 import Index, compose, identity
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair import Link, Pair
from mechgraph.modes.family import Array, Family, Member, Nearby, irregular, least_value, searched
from mechgraph.modes.form import RodFamily, RodPoints, RodStep, RodSystem, behind, sets_of
from mechgraph.modes.homotopy import TRACKS_TOGETHER, Care, Equations, Followed, Leg, follow, rounding
from mechgraph.modes.start_sets import StartSet, distinct

ARCS = 12
"""States on a turn round the end."""
FAR_NOISE, FAR_APART = 5e-2, 0.1
"""Rounding with which tracks may end far away, at what is plainly not real; largest difference, against their size, up to which such ends
count as one."""


@dataclass
class Ends:
    """Ends of all ``tracks`` to one position: states ``(nx, n)``, each once, and what became of the tracks in the best run.

    ``count (n,)`` tracks meet at an end, ``error (n,)`` is how far it may be off; ``moving (nx, k)`` are the ends that lie on continua, and
    differ from run to run. Of several groups (see ``modes.product``), ``on_continua`` is the number of modes that these count for, and
    ``left_out`` that of those that were not gone on with.
    """

    x: Array
    poses: Array
    error: Array
    count: Array
    moving: Array
    infinite: int = 0
    lost: int = 0
    runs: int = 0
    met: int = 0
    clean: bool = False
    tracks: int = 0
    on_continua: int = 0
    left_out: int = 0

    @staticmethod
    def none(states: int, tracks: int) -> Ends:
        """No end is known."""
        nothing = np.zeros((states, 0), dtype=complex)
        return Ends(nothing, nothing, np.zeros(0), np.zeros(0, dtype=np.intp), nothing, tracks=tracks)

    def join(self, x: Array, poses: Array, error: Array, count: Array, new: Index) -> None:
        """Further ends, of which those with the places ``new`` are to be put to them."""
        self.poses = np.concatenate([self.poses, poses[:, new]], axis=1) if self.runs else poses[:, new]
        self.x = np.concatenate([self.x, x[:, new]], axis=1)
        self.error, self.count = np.append(self.error, error[new]), np.append(self.count, count[new])
        self.runs += 1


def ends(
    family: Family, start: StartSet, goals: Member, rng: np.random.Generator, progress: Callable[[str], None] | None
) -> list[Ends]:
    """Ends at members ``goals`` of the class, one after the other."""
    n, N = goals.drive.shape[1], start.x.shape[1]
    out: list[Ends] = []
    block = max(1, TRACKS_TOGETHER // N)
    for i in range(0, n, block):
        if progress is not None:
            progress(f"{N} tracks to each of positions {i + 1} to {min(i + block, n)} of {n}")
        out += _block(family, start, goals.taken(np.arange(i, min(i + block, n))), rng)
    return out


def _block(family: Family, start: StartSet, goals: Member, rng: np.random.Generator) -> list[Ends]:
    n, N = goals.drive.shape[1], start.x.shape[1]
    equations = Equations(family, start.mixing)
    every = [Ends.none(len(start.x), N) for _ in range(n)]
    left = np.arange(n)
    # runs of all tracks, at most
    for run in range(4):
        care = Care(noise=FAR_NOISE) if run < 2 else Care(noise=FAR_NOISE).finer
        begin, x = start.member, start.x
        if run:
            detour = family.random_member(rng)
            there = follow(Leg(equations, begin, detour), x, care)
            begin, x = detour, there.x[:, there.arrived]
        lost_before = N - x.shape[1]
        which = np.repeat(np.arange(len(left)), x.shape[1])
        leg = Leg(equations, begin, goals.taken(left), which)
        run_ends = run_tracks(leg, np.tile(x, len(left)), care)
        for j, place in enumerate(left.tolist()):
            mine = np.flatnonzero(which == j)
            _account(family, goals.taken(np.array([place])), every[place], run_ends.taken(mine), lost_before)
        left = left[[not every[place].clean for place in left]]
        if not left.size:
            break
    return every


@dataclass
class TrackRun:
    """Ends of tracks of a run: states, and which are regular, singular, at infinity; the others are lost."""

    x: Array
    regular: Array
    singular: Array
    infinite: Array

    def taken(self, at: Index) -> TrackRun:
        """Some of them."""
        return TrackRun(self.x[:, at], self.regular[at], self.singular[at], self.infinite[at])


def run_tracks(leg: Followed, x: Array, care: Care, radius: float = MODES.radius) -> TrackRun:
    """Tracks to the end of a leg, those too that do not close quadratically there, which are led round it."""
    tracked = follow(leg, x, care)
    out = TrackRun(
        tracked.x, tracked.arrived.copy(), np.zeros(x.shape[1], dtype=bool), np.zeros(x.shape[1], dtype=bool)
    )
    # part of the way up to which a track must have come for its end to be looked for
    doubtful = np.flatnonzero(~tracked.arrived & (tracked.s > 0.7))
    if doubtful.size:
        _endgame(leg, x[:, doubtful], doubtful, care, radius, out)
    return out


def _endgame(leg: Followed, x: Array, tracks: Index, care: Care, radius: float, out: TrackRun) -> None:
    """Tracks from their starts to a distance from the end, and round it until they are back."""
    eq = leg.equations
    near = follow(
        leg,
        x,
        care,
        lambda s: (s * (1.0 - radius), np.full(s.shape, 1.0 - radius)),
        tracks=tracks,
        polish=False,
    )
    kept = np.flatnonzero(near.arrived)
    tracks, x = tracks[kept], near.x[:, kept]
    begin, total = x.copy(), np.zeros_like(x)
    first = leg.prints(begin, np.full(len(kept), 1.0 - radius), tracks)
    alive = np.arange(len(kept))
    # turns after which a track must be back
    for turn in range(1, 7):
        for k in range(ARCS):
            if not alive.size:
                return
            total[:, alive] += x[:, alive]
            tracked = follow(leg, x[:, alive], care, _arc(k, radius), tracks=tracks[alive], polish=False)
            x[:, alive] = tracked.x
            alive = alive[tracked.arrived]
        if not alive.size:
            return
        now = leg.prints(x[:, alive], np.full(len(alive), 1.0 - radius), tracks[alive])
        gap = np.abs(now - first[:, alive]).max(axis=0) / np.maximum(1.0, np.abs(now).max(axis=0))
        # difference up to which a track is back
        back = alive[gap < 1e-5]
        if back.size:
            wound = np.abs(eq.wound(x[:, back] - begin[:, back])) > 1.0
            mean = total[:, back] / (turn * ARCS)
            # imaginary part of an angle at an end from which on the assembly lies at infinity
            endless = wound | eq.far(mean, 6.0)
            out.infinite[tracks[back[endless]]] = True
            good = back[~endless]
            out.x[:, tracks[good]] = mean[:, ~endless]
            out.singular[tracks[good]] = True
            alive = np.setdiff1d(alive, back)
    # what spreads over many turns while it grows is on its way to infinity
    out.infinite[tracks[alive[eq.far(x[:, alive], 2.0)]]] = True


def _arc(k: int, radius: float) -> Callable[[Array], tuple[Array, Array]]:
    """The part ``k`` of the circle round the end."""

    def way(s: Array) -> tuple[Array, Array]:
        turn = radius * np.exp(2j * np.pi * (k + s) / ARCS)
        return 1.0 - turn, -2j * np.pi / ARCS * turn

    return way


def _account(family: Family, at: Member, known: Ends, run: TrackRun, lost_before: int) -> None:
    """Put the ends of a run to those that are known."""
    told, infinite = _Told(family, at, run), int(run.infinite.sum())
    # a track that is bounded near its end has an assembly there: what closes nowhere is none, or was led round to another one
    infinite += told.doubtful
    own = np.flatnonzero(told.regular)
    once = own[distinct(told.poses[:, own], None, told.least[own])]
    points, N = np.concatenate([once, np.flatnonzero(told.meet)]), run.x.shape[1] + lost_before
    met, lost = len(own) - len(once), N - len(own) - int(told.meet.sum()) - int(told.moving.sum()) - infinite
    least = np.where(told.meet[points], MODES.real_singular, told.least[points])
    new = distinct(told.poses[:, points], known.poses if known.runs else None, least)
    confirmed = known.runs > 0 and not new.size and infinite == known.infinite
    if not known.runs or lost + met <= known.lost + known.met:
        known.lost, known.met, known.infinite, known.moving = lost, met, infinite, told.x[:, told.moving]
    known.join(told.x, told.poses, told.error, np.maximum(told.meet, 1), points[new])
    # all are accounted for on one run without a loss, on two where it is doubtful what is at infinity, or by different ends of several
    left = N - int(known.count.sum()) - known.moving.shape[1]
    whole = lost == 0 and met == 0 and (not told.doubtful or confirmed) and left == known.infinite
    known.clean = whole or not left
    known.infinite = min(known.infinite, max(left, 0))


class _Told:
    """What the ends of a run are: ``regular`` ones, points of continua (``moving``), and doubles, with the number of tracks that ``meet``.

    ``doubtful`` is the number of those that seemed singular and close nowhere, ``error (n,)`` how far ends may be off.
    """

    def __init__(self, family: Family, at: Member, run: TrackRun) -> None:
        self.family, self.system = family, family.system_of(at)
        self.x, self.regular = run.x.copy(), run.regular.copy()
        self.moving, self.meet = np.zeros(len(self.regular), dtype=bool), np.zeros(len(self.regular), dtype=np.intp)
        self._print()
        # an end that is known to few digits counts where it cannot be a real assembly, which would be missed
        size = np.maximum(1.0, np.abs(self.poses).max(axis=0, initial=0.0))
        unreal = np.abs(self.poses.imag).max(axis=0, initial=0.0) > FAR_APART * size
        self.regular &= (self.least == MODES.one_assembly) | unreal
        some = np.flatnonzero(run.singular)
        # the mean round an end is the end: what is far from closed there has come to infinity
        tried = some[Configuration(self.system, self.x[:, some]).closure < FAR_APART * size[some]]
        doubtful, some = len(some) - len(tried), tried
        closed, error = close_all(self.system, self.x[:, some], family.columns)
        # an assembly at the end of a track is close to it; what closes elsewhere has come to infinity, and Newton leads anywhere from there
        moved = np.abs(family.prints(Configuration(self.system, closed)) - self.poses[:, some]).max(axis=0, initial=0.0)
        near = (error < CLOSED) & (moved <= FAR_APART * size[some])
        self.doubtful, some = doubtful + int((~near).sum()), some[near]
        self.x[:, some] = closed[:, near]
        ends = np.union1d(np.flatnonzero(self.regular), some)
        weak = ends[irregular(family, Configuration(self.system, self.x[:, ends]))]
        # what was led round has come to a regular point, to which no other track comes
        self.regular[np.setdiff1d(some, weak)] = True
        about = {i: Nearby(family, self.system, self.x[:, [i]]) for i in weak.tolist()}
        self.moving[weak] = [one.moves for one in about.values()]
        self.regular[self.moving] = False
        self._print()
        left = weak[~self.moving[weak]]
        while left.size:
            apart = np.abs(self.poses[:, left] - self.poses[:, left[:1]]).max(axis=0)
            mine = left[apart <= MODES.real_singular * np.maximum(1.0, np.abs(self.poses[:, left[0]]).max())]
            self._resolve(mine, next((about[i] for i in mine.tolist() if not self.regular[i]), None))
            left = np.setdiff1d(left, mine)
        self._print()
        self.error = np.where(
            self.meet, MODES.real_singular, rounding(size) / least_value(family, Configuration(self.system, self.x))
        )

    def _print(self) -> None:
        self.poses = self.family.prints(Configuration(self.system, self.x))
        self.least = np.clip(
            rounding(np.maximum(1.0, np.abs(self.poses).max(axis=0, initial=0.0))), MODES.one_assembly, FAR_APART
        )

    def _resolve(self, mine: Index, about: Nearby | None) -> None:
        """Ends next to each other as one double, unless they are roots that can be told; ``about`` is one that is not regular yet."""
        if about is None:
            if len(distinct(self.poses[:, mine])) == len(mine):
                return
        elif about.gap > MODES.one_assembly and len(mine) <= 2:
            self.x[:, mine], self.regular[mine] = about.both()[:, : len(mine)], True
            return
        self.regular[mine], self.meet[mine[0]] = False, len(mine)


class Undivided:
    """The equations as they are."""

    def __init__(self, family: Family) -> None:
        self.family = family
        self.names = [pair.name for pair in family.system.m.pairs]

    def goal(self, x: Array, drive: Array) -> Member:
        """The members to be solved at states ``x (nx, n)``, as far as they are known, and values ``drive (d, n)``."""
        return Member(self.family.target, drive)

    def put(self, x: Array, found: Array) -> Array:
        """States ``(nx, n)`` of what was ``found`` for a state ``x (nx,)``."""
        return found


class EquationGroup:
    """A group of ``pairs`` and ``rods`` of a class, behind pairs that are ``known``."""

    def __init__(self, whole: Family, pairs: Index, rods: Index, known: Index) -> None:
        self.whole, self.pairs, self.rods = whole, pairs, rods
        s = whole.system
        self.names = [s.m.pairs[k].name for k in pairs.tolist()]
        self.state_rows, kept = (
            np.array([i for k in pairs for i in range(to[k], to[k + 1])], dtype=np.intp)
            for to in (s.first_row, s.first_column)
        )
        P, n = len(s.m.pairs), len(whole.bearers) - 2 * len(s.m.pairs)
        points = 2 * P + rods
        self._markers = np.concatenate([pairs, P + pairs, points, points + n // 2]).astype(np.intp)
        self._bearers = whole.bearers[self._markers]
        self._plan(known)
        own = np.isin(whole.columns, kept)
        self._drives = np.concatenate([np.flatnonzero(own), len(whole.columns) + rods]).astype(np.intp)
        columns, held = (np.searchsorted(kept, of[np.isin(of, kept)]) for of in (whole.columns, whole.held))
        self.family = self._class(columns, self._idle(kept, known), held)

    def _plan(self, known: Index) -> None:
        """Bodies: links that known pairs join, each with a first link that bears a marker; ways from there to the others."""
        s = self.whole.system
        body = components_of_edges(len(s.m.links), [s.graph.ends[k] for k in known])
        at: list[list[tuple[int, RodStep]]] = [[] for _ in s.m.links]
        for k in known.tolist():
            a, b = s.graph.ends[k]
            at[a].append((b, RodStep(k, 1)))
            at[b].append((a, RodStep(k, -1)))
        # the frame leads its body and stands before all others
        first: dict[int, int] = {}
        for link in sorted(self._bearers.tolist(), key=lambda link: link != s.graph.frame):
            first.setdefault(int(body[link]), link)
        self.links = list(first.values())
        self._first = np.array([first.get(b, -1) for b in body.tolist()])
        self._ways: list[tuple[int, int, RodStep]] = []
        reached = list(self.links)
        seen = set(reached)
        for link in reached:  # the list grows while it is run through
            for other, step in at[link]:
                if other not in seen:
                    seen.add(other)
                    reached.append(other)
                    self._ways.append((link, other, step))

    def _carried(self, x: Array) -> Array:
        """The markers ``(3, 4, markers, n)``, and points of rods, in the first links of their bodies."""
        poses = {link: identity(x.shape[1]) for link in self.links}
        for before, link, step in self._ways:
            poses[link] = compose(poses[before], behind(self.whole.system, step, x))
        out = [
            compose(poses[link], self.whole.target[:, :, k])
            for link, k in zip(self._bearers.tolist(), self._markers.tolist(), strict=True)
        ]
        markers = np.stack(out, axis=2)
        markers[:, :3, 2 * len(self.pairs) :] = np.eye(3)[:, :, None, None]
        return markers

    def goal(self, x: Array, drive: Array) -> Member:
        """See ``Undivided``."""
        return Member(self._carried(x), drive[self._drives])

    def put(self, x: Array, found: Array) -> Array:
        """See ``Undivided``."""
        out = np.repeat(x[:, None], found.shape[1], axis=1).astype(complex)
        out[self.state_rows] = found
        return out

    @property
    def within(self) -> bool:
        """Whether the group stays in its class wherever known pairs move."""
        family = self.family
        if family.whole:
            return True
        rng, s = np.random.default_rng(0), self.whole.system
        dq = rng.uniform(-MODES.known_moved, MODES.known_moved, (s.n_freedoms, 1))
        markers = self._carried(s.advance(self.whole.here.x, dq))
        return family.within(markers, np.arange(2 * len(self.pairs)))

    def _idle(self, kept: Index, known: Index) -> Array:
        """Passive motions ``(F, p)`` of the group alone."""
        s, rates = self.whole.system, self.whole.idle
        solved = [i for k in known.tolist() for i in range(s.first_column[k], s.first_column[k + 1])]
        others = complement(np.array([*kept.tolist(), *solved], dtype=np.intp), s.n_freedoms)
        if not rates.shape[1]:
            return rates[kept]
        _, sigma, Vt = np.linalg.svd(rates[others])
        own = (rates @ Vt[int((sigma > MODES.span).sum()) :].T)[kept]
        U, sigma, _ = np.linalg.svd(own, full_matrices=False)
        return np.asarray(U[:, sigma > MODES.span])

    def _class(self, columns: Index, idle: Array, held: Index) -> Family:
        """The class, told where the whole is."""
        here, s = self.whole.here, self.whole.system
        P, n, full, par = len(self.pairs), len(self.rods), s.m, s.par
        names = [full.links[link].name for link in self.links]
        ends = self._first[self._bearers]
        place = {link: i for i, link in enumerate(self.links)}
        # rows of pairs are those of the plane only in a planar mechanism, in which axes need not be said
        axis: dict[str, Any] = {} if full.planar else {"axis": (0, 0, 1)}
        pairs = [
            Pair(name, full.pairs[k].type, full.links[a].name, full.links[b].name, point=(0, 0, 0), **axis)
            for name, k, a, b in zip(self.names, self.pairs, ends[:P], ends[P : 2 * P], strict=True)
        ]
        m = Mechanism(full.name, [Link(name) for name in names], pairs, frame=names[0], planar=full.planar)
        markers = self._carried(here.x[:, :1]).real
        numbers = replace(
            par,
            marker_a=markers[:, :, :P],
            marker_b=markers[:, :, P : 2 * P],
            pitch=par.pitch[self.pairs],
            mass=par.mass[self.links],
            center=par.center[:, self.links],
            inertia=par.inertia[:, :, self.links],
            offset=par.offset[:, self.links],
            frame=here.poses[:, :, self.links[0], :1],
        )
        x = here.x[self.state_rows, :1]
        if not n:
            return Family(Configuration(System(m, None, numbers), x), columns, idle, held)
        assert isinstance(s, RodSystem)
        assert isinstance(self.whole, RodFamily)
        a, b = (np.array([place[link] for link in side]) for side in np.split(ends[2 * P :], 2))
        at_a, at_b = np.split(markers[:, 3, 2 * P :], 2, axis=1)
        points = RodPoints(a, b, at_a, at_b, s.points.squares[self.rods])
        # points of links that known pairs join may lie at one place at the start and part when these move
        same = self.whole.joints[self._markers[2 * P :] - 2 * len(full.pairs)]
        return RodFamily(Configuration(RodSystem(m, None, numbers, points), x), columns, idle, held, same)


def groups_of(family: Family) -> Sequence[Undivided | EquationGroup]:
    """The groups of a class in the order in which they can be solved; the whole where it has one, or a group no class of its own."""
    graph = family.system.graph
    if len(family.bearers) // 2 - len(graph.ends) + graph.n_loops > 1:
        found = []
        for pairs, rods, known in sets_of(family):
            group = EquationGroup(family, pairs, rods, known)
            if group.family.rank or group.family.unknowns:
                found.append(group)
            if group.family.fault or not group.within:
                break
        else:
            # one group alone leaves out what is known at the start
            if sum(len(group.pairs) for group in found) < len(graph.ends) or len(found) > 1:
                return found
    return [Undivided(family)]


MOST_FOLLOWED = 5000
"""Tracks of a group to one position, at most: beyond that only real assemblies of the groups before are gone on with."""


def least_imaginary() -> float:
    """Imaginary part of link poses up to which an assembly counts as real: of two that can be told from each other it is larger."""
    return 0.5 * MODES.one_assembly


def is_real(poses: Array, error: Array) -> Array:
    """Which assemblies count as real, by what tells them apart ``(n, V)``, of which they may be off by an ``error (V,)``."""
    size = np.maximum(1.0, np.abs(poses).max(axis=0, initial=0.0))
    return np.asarray(
        np.abs(poses.imag).max(axis=0, initial=0.0) / size < np.clip(error, least_imaginary(), MODES.real_singular)
    )


class Product:
    """Assemblies of a class of ``groups`` with start sets ``starts``, at driver values ``drive (d, n)``."""

    def __init__(
        self, family: Family, groups: Sequence[Undivided | EquationGroup], starts: Sequence[StartSet], drive: Array
    ) -> None:
        self.family, self.groups, self.starts, self.drive = family, groups, starts, drive
        n = drive.shape[1]
        self.x = np.repeat(family.here.x[:, :1], n, axis=1).astype(complex)
        self.x[family.rows] = drive[: len(family.rows)]
        self.at, self.count = np.arange(n), np.ones(n, dtype=np.intp)
        self.error, self.moving = np.zeros(n), np.zeros(n, dtype=bool)
        self.out = [Ends.none(self.x.shape[0], 0) for _ in range(n)]
        for out in self.out:
            out.clean = True

    def ends(self, rng: np.random.Generator, progress: Callable[[str], None] | None) -> list[Ends]:
        """Ends of all tracks, position by position."""
        counts = [start.x.shape[1] for start in self.starts]
        for i, (group, start) in enumerate(zip(self.groups, self.starts, strict=True)):
            rest = int(np.prod(counts[i + 1 :]))
            self._limit(counts[i], rest)
            goals = group.goal(self.x, self.drive[:, self.at])
            self._go_on(group, ends(group.family, start, goals, rng, progress), rest)
        for i, out in enumerate(self.out):
            mine, moving = (self.at == i) & ~self.moving, (self.at == i) & self.moving
            out.x, out.poses, out.error, out.count = (
                self.x[:, mine],
                self._prints(mine),
                self.error[mine],
                self.count[mine],
            )
            out.moving, out.on_continua = self.x[:, moving], int(self.count[moving].sum())
        return self.out

    def _prints(self, which: Array | slice) -> Array:
        """What tells assemblies apart, as far as they are known."""
        x = self.x[:, which]
        target = self.family.target
        return self.family.prints(Configuration(self.family.system_with(target, self.drive[:, self.at[which]]), x))

    def _limit(self, count: int, rest: int) -> None:
        """Only real assemblies are gone on with where there are too many, or they lie far away."""
        many, prints = np.bincount(self.at, minlength=len(self.out)) * count > MOST_FOLLOWED, self._prints(slice(None))
        # size of poses of complex assemblies of a group with which the next group is not solved: it would be known to few digits
        far = np.abs(prints).max(axis=0, initial=0.0) > 700.0
        going = ~(many[self.at] | far) | is_real(prints, self.error)
        for i, modes in zip(self.at[~going].tolist(), self.count[~going].tolist(), strict=True):
            self.out[i].left_out += modes * count * rest
        for name in ("x", "at", "count", "error", "moving"):
            setattr(self, name, getattr(self, name)[..., going])

    def _go_on(self, group: Undivided | EquationGroup, found: list[Ends], rest: int) -> None:
        """The assemblies with what was found of a group for each of them; each of the group counts for ``rest`` of all."""
        x, parts = [self.x[:, :0]], []
        for j, (one, place) in enumerate(zip(found, self.at.tolist(), strict=True)):
            out, here, k = self.out[place], int(self.count[j]), one.moving.shape[1]
            out.infinite += here * one.infinite * rest
            out.lost += one.lost
            out.met += one.met
            out.tracks += one.tracks
            out.runs = max(out.runs, one.runs)
            out.clean &= one.clean
            x.append(group.put(self.x[:, j], np.concatenate([one.x, one.moving], axis=1)))
            count, error = (
                np.append(one.count, np.ones(k, dtype=np.intp)),
                np.append(one.error, np.full(k, MODES.real_singular)),
            )
            moving = self.moving[j] | (np.arange(len(count)) >= len(one.count))
            parts.append((np.full(len(count), place), here * count, np.maximum(error, self.error[j]), moving))
        self.x = np.concatenate(x, axis=1)
        none = (self.at[:0], self.count[:0], self.error[:0], self.moving[:0])
        self.at, self.count, self.error, self.moving = (np.concatenate(of) for of in zip(none, *parts, strict=True))


MOST_STEPS_ALONG, STEP_ALONG, NEAREST_POINT = 200, 0.3, 1e-9
"""Steps along a continuum to its point nearest to the start, at most; the largest; and that at which it ends."""


class Found(NamedTuple):
    """A continuum: its real point ``x (nx,)`` nearest to the start, its ``dimension``, and freedoms ``moves (F,)`` that change in it."""

    x: Array
    dimension: int
    moves: Array


def continua(
    family: Family, system: System, ends: Array, drive: Array, progress: Callable[[str], None] | None
) -> list[Found]:
    """Continua with real points, drivers at ``drive (d,)``: those to which tracks came at ``ends (nx, n)``, and those that guesses find."""
    start = family.here.x[:, :1]
    # random guesses from which real points of continua are looked for, the same ones for any seed
    guessed = searched(system, start[:, 0], family.columns, drive, 100, 0.5, np.random.default_rng(0), progress)
    guessed = guessed[:, irregular(family, Configuration(system, guessed))]
    guessed = guessed[:, np.argsort(np.abs(_apart(system, guessed, start)).max(axis=0), kind="stable")]
    out: list[tuple[Found, Array]] = []

    def put(x: Array) -> None:
        about = Nearby(family, system, x)
        if about.moves:
            told = _described(about)
            if not any(_one(*told, *one) for one in out):
                out.append(_described(_nearest(about, start)))

    for x in guessed.T:
        put(x[:, None])
    for end in ends.T:
        real = _real(family, system, end[:, None])
        if real is not None:
            put(real)
    return [found for found, _ in out]


def _one(a: Found, at_rest: Array, b: Found, at_rest_b: Array) -> bool:
    """Whether the same freedoms move and all else is at the same place."""
    if a.dimension != b.dimension or (a.moves != b.moves).any():
        return False
    return bool(np.nanmax(np.abs(at_rest - at_rest_b), initial=0.0) < MODES.same_place)


def _along(about: Nearby) -> Array:
    """Orthonormal motions ``(F, k)`` along a continuum."""
    out = np.zeros((about.system.n_freedoms, about.motions.shape[1]), dtype=about.motions.dtype)
    out[about.family.free] = np.linalg.qr(about.motions)[0]
    return out


def _apart(system: System, x: Array, start: Array) -> Array:
    """Increments ``(F, T)`` from ``start (nx, 1)`` to states without whole rounds."""
    d = system.difference(x, np.repeat(start, x.shape[1], axis=1))
    whole = (system.single_rows >= 0) & np.isfinite(system.periods)
    period = system.periods[whole, None]
    d[whole] -= period * np.round(d[whole] / period)
    return np.asarray(d)


def _real(family: Family, system: System, x: Array) -> Array | None:
    """A real point ``(nx, 1)`` of a continuum near a complex one: along it against its imaginary part; None where there is none."""
    for _ in range(MOST_STEPS_ALONG):
        if np.abs(x.imag).max() < NEAREST_POINT:
            break
        ways = _along(Nearby(family, system, x))
        gone = 1j * system.difference(x, x.real.astype(complex))[:, 0].imag
        c = ways.conj().T @ gone
        if np.abs(c).max(initial=0.0) < NEAREST_POINT:
            return None
        x, _ = close_all(system, system.advance(x, -_limited(ways @ c)[:, None]), family.columns)
    closed, error = close_all(system, x.real, family.columns)
    return closed if error[0] < CLOSED else None


def _nearest(about: Nearby, start: Array) -> Nearby:
    """The point of a continuum to which the way towards the start leads from another one, as far as it can move there."""
    for _ in range(MOST_STEPS_ALONG):
        ways = _along(about)
        step = ways @ (ways.T @ _apart(about.system, about.here.x, start))
        if np.abs(step).max() < NEAREST_POINT:
            break
        x, _ = close_all(about.system, about.system.advance(about.here.x, -_limited(step)), about.family.columns)
        there = Nearby(about.family, about.system, x)
        if not there.moves:
            break
        about = there
    return about


def _limited(step: Array) -> Array:
    return np.asarray(step * min(1.0, STEP_ALONG / max(float(np.abs(step).max()), 1e-300)))


def _described(about: Nearby) -> tuple[Found, Array]:
    """What moves, told at points next to it, as some of it may stand still there; and what does not (``Family.prints``, else NaN)."""
    family, system, landed = about.family, about.system, about.landed
    beside = [Nearby(family, system, landed[:, [i]]) for i in range(landed.shape[1])]
    least = min(len(one.motions.T) for one in beside)
    ways = np.concatenate([_along(one) for one in beside if len(one.motions.T) == least], axis=1)
    moves = np.abs(ways).max(axis=1) > MODES.same_place
    here, there = (family.prints(Configuration(system, of)) for of in (about.here.x, landed))
    still = np.abs(there - here).max(axis=1) < MODES.same_place
    found = Found(about.here.x[:, 0], min(one.dimension for one in beside), moves)
    return found, np.where(still, here[:, 0], np.nan)
