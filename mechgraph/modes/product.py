"""Assemblies group by group: every assembly of the groups before makes a member of the next one's class, to which tracks lead."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mechgraph.closure.configuration import Configuration
from mechgraph.modes.family import Array, Family
from mechgraph.modes.groups import Group, Undivided
from mechgraph.modes.monodromy import StartSet
from mechgraph.modes.targets import Ends, ends

REAL = 1e-6
"""Imaginary part of link poses up to which an assembly counts as real."""
REAL_SINGULAR = 1e-3
"""The same at singular ends, which are known to the root of rounding only."""
MOST_FOLLOWED = 5000
"""Tracks of a group to one position, at most: beyond that only real assemblies of the groups before are gone on with."""
FAR_MODE = 700.0
"""Size of poses of complex assemblies of a group with which the next group is not solved: it would be known to few digits."""


def is_real(poses: Array, singular: Array) -> Array:
    """Which assemblies count as real, by what tells them apart ``(n, V)``."""
    size = np.maximum(1.0, np.abs(poses).max(axis=0, initial=0.0))
    return np.asarray(np.abs(poses.imag).max(axis=0, initial=0.0) / size < np.where(singular, REAL_SINGULAR, REAL))


class Product:
    """Assemblies of a class of ``groups`` with start sets ``starts``, at driver values ``drive (d, n)``."""

    def __init__(
        self, family: Family, groups: Sequence[Undivided | Group], starts: Sequence[StartSet], drive: Array
    ) -> None:
        self.family, self.groups, self.starts, self.drive = family, groups, starts, drive
        n = drive.shape[1]
        self.x = np.repeat(family.here.x[:, :1], n, axis=1).astype(complex)
        self.x[family.rows] = drive[: len(family.rows)]
        self.at, self.singular = np.arange(n), np.zeros(n, dtype=bool)
        nothing = np.zeros((self.x.shape[0], 0), dtype=complex)
        self.out = [Ends(nothing, np.zeros((0, 0)), np.zeros(0, dtype=bool), clean=True) for _ in range(n)]

    def ends(self, rng: np.random.Generator, progress: Callable[[str], None] | None) -> list[Ends]:
        """Ends of all tracks, position by position."""
        counts = [start.x.shape[1] for start in self.starts]
        for i, (group, start) in enumerate(zip(self.groups, self.starts, strict=True)):
            self._limit(counts[i])
            goals = group.goal(self.x, self.drive[:, self.at])
            self._go_on(group, ends(group.family, start, goals, rng, progress), int(np.prod(counts[i + 1 :])))
        for i, out in enumerate(self.out):
            mine = self.at == i
            out.x, out.singular, out.poses = self.x[:, mine], self.singular[mine], self._prints(mine)
        return self.out

    def _prints(self, which: Array | slice) -> Array:
        """What tells assemblies apart, as far as they are known."""
        x = self.x[:, which]
        target = self.family.target
        return self.family.prints(Configuration(self.family.system_with(target, self.drive[:, self.at[which]]), x))

    def _limit(self, count: int) -> None:
        """Only real assemblies are gone on with where there are too many, or they lie far away."""
        many, prints = np.bincount(self.at, minlength=len(self.out)) * count > MOST_FOLLOWED, self._prints(slice(None))
        far = np.abs(prints).max(axis=0, initial=0.0) > FAR_MODE
        going = ~(many[self.at] | far) | is_real(prints, self.singular)
        for i in np.unique(self.at[~going]).tolist():
            self.out[i].partial = True
        self.x, self.at, self.singular = self.x[:, going], self.at[going], self.singular[going]

    def _go_on(self, group: Undivided | Group, found: list[Ends], rest: int) -> None:
        """The assemblies with what was found of a group for each of them; each of the group counts for ``rest`` of all."""
        x, singular = [self.x[:, :0]], [self.singular[:0]]
        for j, (one, place) in enumerate(zip(found, self.at.tolist(), strict=True)):
            out = self.out[place]
            out.infinite += one.infinite * rest
            out.lost += one.lost
            out.met += one.met
            out.tracks += one.tracks
            out.runs = max(out.runs, one.runs)
            out.clean &= one.clean
            x.append(group.put(self.x[:, j], one.x))
            singular.append(one.singular | self.singular[j])
        self.at = np.repeat(self.at, [one.x.shape[1] for one in found])
        self.x, self.singular = np.concatenate(x, axis=1), np.concatenate(singular)
