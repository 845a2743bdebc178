"""From a start set to the assemblies of the mechanism itself: tracks to its geometry and drivers, with an endgame for singular ends.

A track that does not close quadratically at its end is taken up again at a distance ``r`` before it and led round the end, until it is
back after ``c`` turns; the mean of the states on these is the end (Cauchy's formula; Morgan, Sommese and Wampler, Numer. Math. 63, 1992).
A run of tracks on which none was lost and no two came together is an account of all assemblies; otherwise another run on a detour by a
random member makes up for it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from mechgraph.modes.family import GENERIC, Array, Family, Member, parts
from mechgraph.modes.homotopy import Care, Equations, Leg, follow, rounding
from mechgraph.modes.monodromy import ONE_ASSEMBLY, StartSet, distinct, fingerprints
from mechgraph.numerics.linear import Index

RUNS = 4
"""Runs of all tracks, at most."""
TRACKS_TOGETHER = 600
"""Tracks followed together."""
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
ENDLESS = 6.0
"""Imaginary part of an angle at an end from which on the assembly lies at infinity."""


@dataclass
class Ends:
    """Ends of all ``tracks`` to one position: states ``(nx, n)``, each once, and what became of the tracks in the best run.

    ``partial`` where only what is real was gone on with (see ``modes.product``).
    """

    x: Array
    poses: Array
    singular: Array
    infinite: int = 0
    lost: int = 0
    runs: int = 0
    met: int = 0
    clean: bool = field(default=False)
    tracks: int = 0
    partial: bool = False


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
    nothing = np.zeros((len(start.x), 0), dtype=complex)
    every = [Ends(nothing, np.zeros((0, 0)), np.zeros(0, dtype=bool), tracks=N) for _ in range(n)]
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
    x, regular, singular, infinite = run.x.copy(), run.regular.copy(), run.singular.copy(), int(run.infinite.sum())
    doubtful = 0
    if singular.any():
        some = np.flatnonzero(singular)
        x[:, some], closed, rank = _settled(family, at, x[:, some])
        singular[some[~closed]] = False
        # a track that is bounded near its end has an assembly there: this one is not, or it was led round to another one
        doubtful = int((~closed).sum())
        infinite += doubtful
        # what was led round has come to a regular point, to which no other track comes
        singular[some[rank]], regular[some[rank]] = False, True
    poses = fingerprints(family, at, x)
    size = np.maximum(1.0, np.abs(poses).max(axis=0, initial=0.0))
    least = np.clip(rounding(size), ONE_ASSEMBLY, FAR_APART)
    # an end that is known to few digits counts where it cannot be a real assembly, which would be missed
    regular &= (least == ONE_ASSEMBLY) | (np.abs(poses.imag).max(axis=0, initial=0.0) > FAR_APART * size)
    good = np.flatnonzero(regular | singular)
    poses, least = poses[:, good], least[good]
    new = distinct(poses, known.poses if known.runs else None, least)
    own = distinct(poses[:, regular[good]], None, least[regular[good]])
    lost = len(regular) - len(good) - infinite + lost_before
    met = int(regular.sum()) - len(own)
    confirmed = known.runs > 0 and not new.size and infinite == known.infinite
    best = not known.runs or lost + met <= known.lost + known.met
    known.x = np.concatenate([known.x, x[:, good[new]]], axis=1)
    known.poses = np.concatenate([known.poses, poses[:, new]], axis=1) if known.runs else poses[:, new]
    known.singular = np.concatenate([known.singular, singular[good[new]]])
    known.runs += 1
    if best:
        known.lost, known.met, known.infinite = lost, met, infinite
    # all are accounted for on one run without a loss, on two where it is doubtful what is at infinity, or by different ends of several
    left = max(0, len(regular) + lost_before - known.x.shape[1])
    known.infinite = min(known.infinite, left)
    known.clean = (lost == 0 and met == 0 and (not doubtful or confirmed)) or not left


def _settled(family: Family, at: Member, x: Array) -> tuple[Array, Array, Array]:
    """Singular ends closed by steps of least norm; which closed, and which of these are regular points nevertheless."""
    leg = Leg(Equations(family, None), at, at)
    T = x.shape[1]
    tracks, one = np.zeros(T, dtype=np.intp), np.ones(T)
    for _ in range(25):
        here = leg.at(x, one, tracks)
        r = here.here.residual
        if np.abs(r).max(initial=0.0) < 1e-13:
            break
        dq = np.zeros((family.system.n_freedoms, T), dtype=complex)
        inverse = np.linalg.pinv(here.J.transpose(2, 0, 1), rcond=1e-11)
        dq[family.free] = -np.einsum("tij,jt->it", inverse, r)
        dq *= np.minimum(1.0, 0.1 / np.maximum(np.abs(dq).max(axis=0, initial=0.0), 1e-300))
        x = family.system.advance(here.here.x, dq)
    here = leg.at(x, one, tracks)
    closed = np.abs(here.here.residual).max(axis=0, initial=0.0) < 1e-10
    sigma = np.linalg.svd(here.J.transpose(2, 0, 1), compute_uv=False)
    return x, closed, closed & (parts(sigma)[:, : family.unknowns] > GENERIC).all(axis=1)
