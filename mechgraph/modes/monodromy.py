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
from mechgraph.modes.family import GENERIC, MEMBER_CLOSED, Array, Family, Member
from mechgraph.modes.homotopy import Care, Equations, Leg, follow
from mechgraph.numerics.linear import rank_of, singular_values

MISSED = 1e-6
"""Chance of an assembly having been missed at which loops of members end, where every permutation is as likely as any other."""
MOST_FOUND = 1200
"""Assemblies of one member from which on they are not looked for any further."""
BATCH = 48
"""Tracks followed together, of as many loops as it takes."""
ATTEMPTS = 8
"""Random members tried until one is regular."""
ONE_ASSEMBLY = 1e-6
"""Difference of link poses, against their size, up to which two assemblies are one."""


class Irregular(Exception):
    """Random members of a class are not closed by regular equations: its relations are not those of the mechanism."""


@dataclass(frozen=True)
class StartSet:
    """All assemblies ``x (nx, N)`` known of a member, and the mixing of its rows.

    ``loops`` is the number of loops of members that brought no further assembly, ``lost`` the tracks that did not come back.
    """

    member: Member
    x: Array
    mixing: Array | None
    loops: int
    lost: int
    followed: int
    whole: bool

    def fits(self, family: Family) -> bool:
        """Whether it is closed for a class."""
        s = family.system
        P = len(s.m.pairs)
        if self.member.markers.shape != (3, 4, 2 * P, 1) or self.x.ndim != 2 or len(self.x) != s.n_state:
            return False
        if (self.mixing is None) != family.whole or not np.isfinite(self.x).all():
            return False
        closure = Configuration(family.system_with(self.member.markers), self.x).closure
        return bool(closure.max(initial=0.0) < MEMBER_CLOSED)

    @property
    def chance(self) -> float:
        """Chance that an assembly was missed, were every permutation of the assemblies as likely as any other."""
        return float((self.x.shape[1] + 1.0) ** -self.loops)


def fingerprints(family: Family, member: Member, x: Array) -> Array:
    """What tells assemblies of a member apart ``(n, V)``, see ``Family.prints``."""
    return family.prints(Configuration(family.system_with(member.markers), x))


def distinct(poses: Array, known: Array | None = None) -> Array:
    """Places of assemblies that are new, each once: poses ``(n, V)`` that differ from those ``known (n, N)`` and before."""
    have = [] if known is None else list(known.T)
    out = []
    for i, p in enumerate(poses.T):
        if not np.isfinite(p).all():
            continue
        size = max(1.0, float(np.abs(p).max()))
        if all(np.abs(p - q).max() > ONE_ASSEMBLY * size for q in have):
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
        if rank_of(singular_values(here.J[:, :, 0]), GENERIC) == family.rank:
            return _permuted(equations, member, x, rng, progress)
    raise Irregular


def _permuted(
    equations: Equations, base: Member, x: Array, rng: np.random.Generator, progress: Callable[[str], None] | None
) -> StartSet:
    """The assemblies to which loops of members lead from one, until more loops than chance can explain bring none."""
    family, care = equations.family, Care()
    found = x[:, None]
    known = fingerprints(family, base, found)
    quiet = lost = followed = 0
    while (N := found.shape[1]) < MOST_FOUND and (N + 1.0) ** -quiet > MISSED:
        if progress is not None:
            progress(f"{N} assemblies of a random member, {quiet} loops without a further one")
        loops = max(1, BATCH // N)
        corners = [base, *(Member.joined([family.random_member(rng) for _ in range(loops)]) for _ in range(2)), base]
        there, which = np.tile(found, loops), np.repeat(np.arange(loops), N)
        for begin, end in pairwise(corners):
            tracked = follow(Leg(equations, begin, end, which), there, care)
            lost += int((~tracked.arrived).sum())
            followed += there.shape[1]
            there, which = tracked.x[:, tracked.arrived], which[tracked.arrived]
        poses = fingerprints(family, base, there)
        new = distinct(poses, known)
        quiet = 0 if new.size else quiet + loops
        found, known = np.concatenate([found, there[:, new]], axis=1), np.concatenate([known, poses[:, new]], axis=1)
    return StartSet(base, found, equations.mixing, quiet, lost, followed, N < MOST_FOUND)
