"""All assemblies of a random member of a class, by monodromy: paths of members that come back permute the assemblies.

Sources: Duff, Hill, Jensen, Lee, Leykin and Sommars, Solving polynomial systems via homotopy continuation and monodromy, IMA J. Numer.
Anal. 39, 2019; Sommese and Wampler, The Numerical Solution of Systems of Polynomials, 2005, section 15.4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mechgraph.closure.configuration import Configuration
from mechgraph.modes.bounds import bound
from mechgraph.modes.family import GENERIC, MEMBER_CLOSED, SPAN, Array, Family, Member
from mechgraph.modes.homotopy import TRACKS_TOGETHER, Care, Equations, Leg, Linear, follow
from mechgraph.modes.trace import NOT_PASSED, Trace, trace_test
from mechgraph.numerics.linear import rank_of, singular_values

MISSED, MISSED_AGAIN = 1e-4, 1e-6
"""Chance of an assembly having been missed at which loops of members end, where every permutation is as likely as any other: at the
first member, and at the one that is kept."""
MOST_FOUND = 1200
"""Assemblies of one member from which on they are not looked for any further."""
LOOP_ROUNDS, MOST_TRACKED = 60, 60_000
"""Rounds of loops at a member, and tracks in all, after which they are not either."""
BATCH = 48
"""Tracks followed together at least, of as many loops as it takes."""
CANDIDATES = 6
"""Members of which the best one is kept."""
ATTEMPTS = 8
"""Random members tried until one is regular."""
ONE_ASSEMBLY = 1e-6
"""Difference of link poses, against their size, up to which two assemblies are one."""


class Irregular(Exception):
    """Random members of a class are not closed by regular equations: its relations are not those of the mechanism."""


@dataclass(frozen=True)
class StartSet:
    """All assemblies ``x (nx, N)`` known of a member, and the mixing of its rows.

    ``loops`` is the number of loops of members that brought no further assembly, ``chance`` that of one having been missed by them, were
    every permutation as likely; ``lost`` of the tracks ``followed`` did not come to the end of their leg. ``trace`` is the trace test,
    which is left out where a bound is met.
    """

    member: Member
    x: Array
    mixing: Array | None
    loops: int
    chance: float
    lost: int
    followed: int
    whole: bool
    trace: Trace

    def fits(self, family: Family) -> bool:
        """Whether it is closed for a class."""
        s = family.system
        if self.member.markers.shape != family.target.shape or self.x.ndim != 2 or len(self.x) != s.n_state:
            return False
        if (self.mixing is None) != family.whole or not np.isfinite(self.x).all():
            return False
        here = Configuration(family.system_of(self.member), self.x)
        size = np.maximum(1.0, np.abs(here.poses).max(axis=(0, 1, 2)))
        return bool((here.closure < MEMBER_CLOSED * size).all())


def fingerprints(family: Family, member: Member, x: Array) -> Array:
    """What tells assemblies of a member apart ``(n, V)``, see ``Family.prints``."""
    return family.prints(Configuration(family.system_of(member), x))


def distinct(poses: Array, known: Array | None = None, least: Array | None = None) -> Array:
    """Places of assemblies that are new, each once: poses ``(n, V)`` that differ from those ``known (n, N)`` and before.

    ``least (V,)`` are differences, against their size, up to which they are one.
    """
    have = [] if known is None else list(known.T)
    out = []
    for i, p in enumerate(poses.T):
        if not np.isfinite(p).all():
            continue
        size = max(1.0, float(np.abs(p).max()))
        one = ONE_ASSEMBLY if least is None else least[i]
        if all(np.abs(p - q).max() > one * size for q in have):
            have.append(p)
            out.append(i)
    return np.array(out, dtype=np.intp)


def start_set(family: Family, rng: np.random.Generator, progress: Callable[[str], None] | None = None) -> StartSet:
    """All assemblies of a random member of a class.

    Raises
    ------
    Irregular
        where random members are not closed by regular equations.
    """
    for _ in range(ATTEMPTS):
        closed = family.random_closed(rng)
        if closed is None:
            continue
        member, x = closed
        equations = Equations(family, family.mixing(rng))
        leg = Leg(equations, member, member)
        here = leg.at(x[:, None], np.zeros(1), np.zeros(1, dtype=np.intp))
        if rank_of(singular_values(here.J[:, :, 0]), GENERIC) == family.rank and not _told_by_idle(family, here):
            return _permuted(equations, member, x, rng, progress)
    raise Irregular


def _told_by_idle(family: Family, here: Linear) -> bool:
    """Whether motions that the equations leave free move what tells assemblies apart: such members have not the passive motions."""
    s, idle = family.system, here.idle()[0].conj()
    rates = np.zeros((s.n_freedoms, len(idle)), dtype=complex)
    rates[family.free] = idle.T
    moved = [here.here.link_twists(rate[:, None])[:, family.settled_links] for rate in rates.T]
    single = np.flatnonzero(np.isin(s.single_rows, np.concatenate(family.settled_rows)))
    return bool(np.abs(np.array(moved)).max(initial=0.0) > SPAN or np.abs(rates[single]).max(initial=0.0) > SPAN)


def _permuted(
    equations: Equations, base: Member, x: Array, rng: np.random.Generator, progress: Callable[[str], None] | None
) -> StartSet:
    """The assemblies to which loops of members lead from one, until more loops than chance can explain bring none.

    They begin at one member and then at another: what is hard to reach at the first, large numbers in its poses, is not at the second.
    Where a bound is met, no loop could bring a further one.
    """
    known = bound(equations.family)
    group = _Group(equations, base, x[:, None], MOST_FOUND if known is None else known.count)
    group.grow(MISSED, rng, progress)
    group.move(*_tame(equations, group.base, group.x, rng))
    group.grow(MISSED_AGAIN, rng, progress)
    N = group.x.shape[1]
    met = known is not None and known.count == N
    whole = met or (N < MOST_FOUND and group.chance <= MISSED_AGAIN)
    test = whole and not met
    trace = trace_test(equations, group.base, group.x, rng, progress) if test else NOT_PASSED
    return StartSet(
        group.base, group.x, equations.mixing, group.quiet, group.chance, group.lost, group.followed, whole, trace
    )


class _Group:
    """Assemblies ``x (nx, N)`` known of a member ``base``, and the loops that brought no further one."""

    def __init__(self, equations: Equations, base: Member, x: Array, most: int) -> None:
        self.equations, self.most, self.lost, self.followed = equations, most, 0, 0
        self.move(base, x)

    def move(self, base: Member, x: Array) -> None:
        """Go on at another member."""
        self.base, self.x, self.known = base, x, fingerprints(self.equations.family, base, x)
        self.quiet, self.chance = 0, 1.0

    def grow(self, missed: float, rng: np.random.Generator, progress: Callable[[str], None] | None) -> None:
        """Loops until the chance of one having been missed is small."""
        family = self.equations.family
        for _ in range(LOOP_ROUNDS):
            if (N := self.x.shape[1]) >= self.most or self.chance <= missed or self.followed >= MOST_TRACKED:
                break
            if progress is not None:
                progress(f"{N} assemblies of a random member, {self.quiet} loops without a further one")
            # so many that where none brings a further one they are enough, and no fewer than are followed at the cost of one
            enough = int(np.ceil(np.log(missed / self.chance) / -np.log(N + 1.0)))
            loops = max(min(enough, TRACKS_TOGETHER // N), BATCH // N, 1)
            there = self._round(family, loops, rng)
            poses = fingerprints(family, self.base, there)
            new = distinct(poses, self.known)
            # a further one stays outside where the loop leaves it where it is, or where its track is lost
            outside = min(1.0 / (N + 1.0) + (1.0 - there.shape[1] / (N * loops)), 1.0)
            self.quiet, self.chance = (0, 1.0) if new.size else (self.quiet + loops, self.chance * outside**loops)
            self.x = np.concatenate([self.x, there[:, new]], axis=1)
            self.known = np.concatenate([self.known, poses[:, new]], axis=1)

    def _round(self, family: Family, loops: int, rng: np.random.Generator) -> Array:
        """Where all assemblies come to on several loops through two random members each."""
        corners = [Member.joined([family.random_member(rng) for _ in range(loops)]) for _ in range(2)]
        there, which = np.tile(self.x, loops), np.repeat(np.arange(loops), self.x.shape[1])
        for begin, end in pairwise([self.base, *corners, self.base]):
            tracked = follow(Leg(self.equations, begin, end, which), there, Care())
            self.lost += int((~tracked.arrived).sum())
            self.followed += there.shape[1]
            there, which = tracked.x[:, tracked.arrived], which[tracked.arrived]
        return there


def _tame(equations: Equations, base: Member, x: Array, rng: np.random.Generator) -> tuple[Member, Array]:
    """Of some random members that with the smallest numbers in its assemblies, from which tracks are the least likely to be lost.

    Assemblies ``x (nx, N)`` that come to one there are one, which large numbers had told apart by their rounding.
    """
    family, N = equations.family, x.shape[1]
    members = [family.random_member(rng) for _ in range(CANDIDATES)]
    which = np.repeat(np.arange(CANDIDATES), N)
    tracked = follow(Leg(equations, base, Member.joined(members), which), np.tile(x, CANDIDATES), Care())
    keep, found = np.arange(N), []
    for number, member in enumerate(members):
        mine = which == number
        there, poses = tracked.x[:, mine], fingerprints(family, member, tracked.x[:, mine])
        arrived = np.flatnonzero(tracked.arrived[mine])
        keep = np.setdiff1d(keep, np.delete(arrived, distinct(poses[:, arrived])))
        found.append((member, there, poses, tracked.arrived[mine]))
    best, least = (base, x[:, keep]), np.abs(fingerprints(family, base, x[:, keep])).max()
    for member, there, poses, came in found:
        size = np.abs(poses[:, keep]).max() if came[keep].all() else np.inf
        if size < least:
            best, least = (member, there[:, keep]), size
    return best
