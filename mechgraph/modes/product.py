"""Assemblies group by group: every assembly of the groups before makes a member of the next one's class, to which tracks lead."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mechgraph.closure.configuration import Configuration
from mechgraph.modes.family import Array, Family
from mechgraph.modes.groups import Group, Undivided
from mechgraph.modes.monodromy import ONE_ASSEMBLY, StartSet
from mechgraph.modes.targets import REAL_SINGULAR, Ends, ends

REAL = 0.5 * ONE_ASSEMBLY
"""Imaginary part of link poses up to which an assembly counts as real: of two that can be told from each other it is larger."""
MOST_FOLLOWED = 5000
"""Tracks of a group to one position, at most: beyond that only real assemblies of the groups before are gone on with."""
FAR_MODE = 700.0
"""Size of poses of complex assemblies of a group with which the next group is not solved: it would be known to few digits."""


def is_real(poses: Array, error: Array) -> Array:
    """Which assemblies count as real, by what tells them apart ``(n, V)``, of which they may be off by an ``error (V,)``."""
    size = np.maximum(1.0, np.abs(poses).max(axis=0, initial=0.0))
    return np.asarray(np.abs(poses.imag).max(axis=0, initial=0.0) / size < np.clip(error, REAL, REAL_SINGULAR))


class Product:
    """Assemblies of a class of ``groups`` with start sets ``starts``, at driver values ``drive (d, n)``."""

    def __init__(
        self, family: Family, groups: Sequence[Undivided | Group], starts: Sequence[StartSet], drive: Array
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
        far = np.abs(prints).max(axis=0, initial=0.0) > FAR_MODE
        going = ~(many[self.at] | far) | is_real(prints, self.error)
        for i, modes in zip(self.at[~going].tolist(), self.count[~going].tolist(), strict=True):
            self.out[i].left_out += modes * count * rest
        for name in ("x", "at", "count", "error", "moving"):
            setattr(self, name, getattr(self, name)[..., going])

    def _go_on(self, group: Undivided | Group, found: list[Ends], rest: int) -> None:
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
                np.append(one.error, np.full(k, REAL_SINGULAR)),
            )
            moving = self.moving[j] | (np.arange(len(count)) >= len(one.count))
            parts.append((np.full(len(count), place), here * count, np.maximum(error, self.error[j]), moving))
        self.x = np.concatenate(x, axis=1)
        none = (self.at[:0], self.count[:0], self.error[:0], self.moving[:0])
        self.at, self.count, self.error, self.moving = (np.concatenate(of) for of in zip(none, *parts, strict=True))
