"""From a start set to the assemblies of the mechanism itself: tracks to its geometry and drivers, with an endgame for singular ends.

A track that does not close quadratically at its end is taken up again at a distance ``r`` before it and led round the end, until it is
back after ``c`` turns; the mean of the states on these is the end (Cauchy's formula; Morgan, Sommese and Wampler, Numer. Math. 63, 1992).
A run of tracks on which none was lost and no two came together is an account of all assemblies; otherwise another run on a detour by a
random member makes up for it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mechgraph.closure.assembly import CLOSED, close_all
from mechgraph.closure.configuration import Configuration
from mechgraph.modes.family import Array, Family, Member
from mechgraph.modes.homotopy import TRACKS_TOGETHER, Care, Equations, Leg, follow, rounding
from mechgraph.modes.monodromy import ONE_ASSEMBLY, StartSet, distinct
from mechgraph.modes.nearby import Nearby, irregular, least_value
from mechgraph.numerics.linear import Index

RUNS = 4
"""Runs of all tracks, at most."""
RADIUS = 0.04
"""Distance from its end at which a track is led round."""
ARCS = 12
"""States on a turn round the end."""
TURNS_ROUND = 6
"""Turns after which a track must be back."""
BACK = 1e-5
"""Difference up to which it is back."""
NEAR_END = 0.7
"""Part of the way up to which a track must have come for its end to be looked for."""
FAR_NOISE, FAR_APART = 5e-2, 0.1
"""Rounding with which tracks may end far away, at what is plainly not real; largest difference, against their size, up to which such ends
count as one."""
REAL_SINGULAR = 1e-3
"""Difference of link poses at which ends may be one, or real, where rows are singular, so that they are known to the root of rounding."""
ENDLESS = 6.0
"""Imaginary part of an angle at an end from which on the assembly lies at infinity."""


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
    for run in range(RUNS):
        care = Care(noise=FAR_NOISE) if run < 2 else Care(noise=FAR_NOISE).finer
        begin, x = start.member, start.x
        if run:
            detour = family.random_member(rng)
            there = follow(Leg(equations, begin, detour), x, care)
            begin, x = detour, there.x[:, there.arrived]
        lost_before = N - x.shape[1]
        which = np.repeat(np.arange(len(left)), x.shape[1])
        leg = Leg(equations, begin, goals.taken(left), which)
        run_ends = _run(leg, np.tile(x, len(left)), care)
        for j, place in enumerate(left.tolist()):
            mine = np.flatnonzero(which == j)
            _account(family, goals.taken(np.array([place])), every[place], run_ends.taken(mine), lost_before)
        left = left[[not every[place].clean for place in left]]
        if not left.size:
            break
    return every


@dataclass
class _Run:
    """Ends of tracks of a run: states, and which are regular, singular, at infinity; the others are lost."""

    x: Array
    regular: Array
    singular: Array
    infinite: Array

    def taken(self, at: Index) -> _Run:
        return _Run(self.x[:, at], self.regular[at], self.singular[at], self.infinite[at])


def _run(leg: Leg, x: Array, care: Care) -> _Run:
    tracked = follow(leg, x, care)
    out = _Run(tracked.x, tracked.arrived.copy(), np.zeros(x.shape[1], dtype=bool), np.zeros(x.shape[1], dtype=bool))
    doubtful = np.flatnonzero(~tracked.arrived & (tracked.s > NEAR_END))
    if doubtful.size:
        _endgame(leg, x[:, doubtful], doubtful, care, out)
    return out


def _endgame(leg: Leg, x: Array, tracks: Index, care: Care, out: _Run) -> None:
    """Tracks from their starts to a distance from the end, and round it until they are back."""
    eq = leg.equations
    near = follow(
        leg, x, care, lambda s: (s * (1.0 - RADIUS), np.full(s.shape, 1.0 - RADIUS)), tracks=tracks, polish=False
    )
    kept = np.flatnonzero(near.arrived)
    tracks, x = tracks[kept], near.x[:, kept]
    begin, total = x.copy(), np.zeros_like(x)
    first = leg.prints(begin, np.full(len(kept), 1.0 - RADIUS), tracks)
    alive = np.arange(len(kept))
    for turn in range(1, TURNS_ROUND + 1):
        for k in range(ARCS):
            if not alive.size:
                return
            total[:, alive] += x[:, alive]
            tracked = follow(leg, x[:, alive], care, _arc(k), tracks=tracks[alive], polish=False)
            x[:, alive] = tracked.x
            alive = alive[tracked.arrived]
        if not alive.size:
            return
        now = leg.prints(x[:, alive], np.full(len(alive), 1.0 - RADIUS), tracks[alive])
        gap = np.abs(now - first[:, alive]).max(axis=0) / np.maximum(1.0, np.abs(now).max(axis=0))
        back = alive[gap < BACK]
        if back.size:
            wound = np.abs(eq.wound(x[:, back] - begin[:, back])) > 1.0
            mean = total[:, back] / (turn * ARCS)
            endless = wound | eq.far(mean, ENDLESS)
            out.infinite[tracks[back[endless]]] = True
            good = back[~endless]
            out.x[:, tracks[good]] = mean[:, ~endless]
            out.singular[tracks[good]] = True
            alive = np.setdiff1d(alive, back)
    # what spreads over many turns while it grows is on its way to infinity
    out.infinite[tracks[alive[eq.far(x[:, alive], 2.0)]]] = True


def _arc(k: int) -> Callable[[Array], tuple[Array, Array]]:
    """The part ``k`` of the circle round the end."""

    def way(s: Array) -> tuple[Array, Array]:
        turn = RADIUS * np.exp(2j * np.pi * (k + s) / ARCS)
        return 1.0 - turn, -2j * np.pi / ARCS * turn

    return way


def _account(family: Family, at: Member, known: Ends, run: _Run, lost_before: int) -> None:
    """Put the ends of a run to those that are known."""
    told, infinite = _Told(family, at, run), int(run.infinite.sum())
    # a track that is bounded near its end has an assembly there: what closes nowhere is none, or was led round to another one
    infinite += told.doubtful
    own = np.flatnonzero(told.regular)
    once = own[distinct(told.poses[:, own], None, told.least[own])]
    points, N = np.concatenate([once, np.flatnonzero(told.meet)]), run.x.shape[1] + lost_before
    met, lost = len(own) - len(once), N - len(own) - int(told.meet.sum()) - int(told.moving.sum()) - infinite
    least = np.where(told.meet[points], REAL_SINGULAR, told.least[points])
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

    def __init__(self, family: Family, at: Member, run: _Run) -> None:
        self.family, self.system = family, family.system_of(at)
        self.x, self.regular = run.x.copy(), run.regular.copy()
        self.moving, self.meet = np.zeros(len(self.regular), dtype=bool), np.zeros(len(self.regular), dtype=np.intp)
        self._print()
        # an end that is known to few digits counts where it cannot be a real assembly, which would be missed
        size = np.maximum(1.0, np.abs(self.poses).max(axis=0, initial=0.0))
        unreal = np.abs(self.poses.imag).max(axis=0, initial=0.0) > FAR_APART * size
        self.regular &= (self.least == ONE_ASSEMBLY) | unreal
        some = np.flatnonzero(run.singular)
        closed, error = close_all(self.system, self.x[:, some], family.columns)
        self.doubtful, some = int((error >= CLOSED).sum()), some[error < CLOSED]
        self.x[:, some] = closed[:, error < CLOSED]
        ends = np.union1d(np.flatnonzero(self.regular), some)
        weak = ends[irregular(family, Configuration(self.system, self.x[:, ends]))]
        # what was led round has come to a regular point, to which no other track comes
        self.regular[np.setdiff1d(some, weak)] = True
        near = {i: Nearby(family, self.system, self.x[:, [i]]) for i in weak.tolist()}
        self.moving[weak] = [about.moves for about in near.values()]
        self.regular[self.moving] = False
        self._print()
        left = weak[~self.moving[weak]]
        while left.size:
            apart = np.abs(self.poses[:, left] - self.poses[:, left[:1]]).max(axis=0)
            mine = left[apart <= REAL_SINGULAR * np.maximum(1.0, np.abs(self.poses[:, left[0]]).max())]
            self._resolve(mine, next((near[i] for i in mine.tolist() if not self.regular[i]), None))
            left = np.setdiff1d(left, mine)
        self._print()
        self.error = np.where(
            self.meet, REAL_SINGULAR, rounding(size) / least_value(family, Configuration(self.system, self.x))
        )

    def _print(self) -> None:
        self.poses = self.family.prints(Configuration(self.system, self.x))
        self.least = np.clip(
            rounding(np.maximum(1.0, np.abs(self.poses).max(axis=0, initial=0.0))), ONE_ASSEMBLY, FAR_APART
        )

    def _resolve(self, mine: Index, about: Nearby | None) -> None:
        """Ends next to each other as one double, unless they are roots that can be told; ``about`` is one that is not regular yet."""
        if about is None:
            if len(distinct(self.poses[:, mine])) == len(mine):
                return
        elif about.gap > ONE_ASSEMBLY and len(mine) <= 2:
            self.x[:, mine], self.regular[mine] = about.both()[:, : len(mine)], True
            return
        self.regular[mine], self.meet[mine[0]] = False, len(mine)
