"""How the assemblies of a question are found: tracks from a start set, or a search; what each is, and how sure it is that these are all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, cmp_to_key
from math import prod

import numpy as np

from mechgraph.closure.assembly import close_all
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import System
from mechgraph.errors import counted
from mechgraph.force.loads import user_poses
from mechgraph.model.mechanism import Mechanism
from mechgraph.modes.balls import TINY
from mechgraph.modes.bounds import bound
from mechgraph.modes.certificate import Certificate, certificate, told_apart
from mechgraph.modes.continua import Found, continua
from mechgraph.modes.family import Array, Family
from mechgraph.modes.form import Form, Whole
from mechgraph.modes.groups import Group, Undivided, groups_of
from mechgraph.modes.monodromy import ONE_ASSEMBLY, Irregular, StartSet, distinct, start_set
from mechgraph.modes.nearby import Nearby, irregular, least_value
from mechgraph.modes.product import MOST_FOLLOWED, REAL, Product, is_real
from mechgraph.modes.question import Question
from mechgraph.modes.result import Assemblies, ComplexModes, Continuum, weakest
from mechgraph.modes.search import searched
from mechgraph.modes.store import keep, kept
from mechgraph.modes.targets import REAL_SINGULAR, Ends

REAL_CLOSED = 1e-12
"""Closure error of what is real in the equations that are solved: some roundings."""
PUT_BACK = 1e-9
"""Closure error of what is real with its rods put back."""
UNFIT = 1e-3
"""Closure error from which on a rod that has no row does not fit; between this and that of what is closed it is open whether it does."""
GUESSES = 400
"""Random guesses where no class is known."""
GUESSED_TURNS = 1.0
"""Turns on either side of the start within which angles are guessed."""
ORDER = 1e-7
"""Difference of link poses (and coordinates) below which the next number decides the order of assemblies."""

BESIDE = "What can move with the drivers at rest is not counted, and there may be more of that kind."
"""What is said beside continua."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class _Solutions:
    """Real states ``(nx, M)`` at a position and ``others`` that are not real, with what is said of them (see ``Assemblies``).

    ``solved`` are the real ones as they stand in the equations that were solved, ``continua`` lie in those of the mechanism.
    """

    x: Array
    solved: Array
    others: Array
    word: str
    evidence: tuple[str, ...]
    total: int | None
    infinite: int = 0
    on_continua: int = 0
    continua: Sequence[Found] = ()


class Finder:
    """Finds the assemblies of a question."""

    def __init__(self, question: Question, seed: int, cache: bool, progress: Progress | None) -> None:
        self.question, self.progress = question, progress
        self.form: Form = question.form
        self.family = self.form.family
        self.rng, self.cache = np.random.default_rng(seed), cache
        self.fault = self.family.fault

    @cached_property
    def groups(self) -> Sequence[Undivided | Group]:
        """What is solved, one after the other."""
        return groups_of(self.family)

    @cached_property
    def starts(self) -> list[StartSet]:
        """The start sets of the groups; none where no class is known."""
        if self.fault:
            return []
        try:
            return [self._start(group.family) for group in self.groups]
        except Irregular:
            if len(self.groups) > 1:
                self.groups = [Undivided(self.family)]
                return self.starts
            self.fault = "random mechanisms of its class are not closed by regular equations"
            self.form = Whole(self.question.family, self.question.drive)
            self.family = self.form.family
            return []

    def _start(self, family: Family) -> StartSet:
        known = kept(family) if self.cache else None
        if known is not None:
            return known
        made = start_set(family, self.rng, self.progress)
        if self.cache and made.whole:
            keep(family, made)
        return made

    def solutions(self, guesses: int = GUESSES, turns: float = GUESSED_TURNS) -> list[_Solutions]:
        """What is found at all positions."""
        q = self.question
        if not self.starts:
            return [self._searched(q.drive[:, i], guesses, turns) for i in range(q.drive.shape[1])]
        found = Product(self.family, self.groups, self.starts, self.form.drive).ends(self.rng, self.progress)
        return [self._tracked(one, i) for i, one in enumerate(found)]

    def singular(self, found: _Solutions, i: int) -> bool:
        """Whether a real assembly of those found at a position is, or nearly so, or can move."""
        return bool(found.continua or irregular(self.family, Configuration(self.form.at(i), found.solved)).any())

    def positions(self, guesses: int, turns: float) -> list[Assemblies]:
        """The assemblies at all positions."""
        return [self._result(found, i) for i, found in enumerate(self.solutions(guesses, turns))]

    def _distinct(self, x: Array, i: int) -> Array:
        return x[:, distinct(self.family.prints(Configuration(self.form.at(i), x)))]

    def _searched(self, drive: Array, guesses: int, turns: float) -> _Solutions:
        q = self.question
        x = searched(q.system, q.x, q.columns, drive, guesses, turns, self.rng, self.progress)
        x = np.concatenate([x, *([q.start.x] if np.allclose(q.start.x[self.family.rows, 0], drive) else [])], axis=1)
        why = (
            f"No class is known: {self.fault}. Searched from {guesses} random guesses within {turns:g} turns of the start; "
            "others may exist."
        )
        system = q.system
        # those that are singular are known to the root of rounding only
        least = np.where(irregular(self.family, Configuration(system, x)), REAL_SINGULAR, ONE_ASSEMBLY)
        x = x[:, distinct(q.family.prints(Configuration(system, x)), None, least)]
        moving = np.array([Nearby(q.family, system, x[:, [i]]).moves for i in range(x.shape[1])], dtype=bool)
        more = continua(q.family, system, x[:, moving], drive, self.progress) if moving.any() else []
        others = np.zeros((system.n_state, 0), dtype=complex)
        return _Solutions(
            x[:, ~moving], x[:, ~moving], others, "searched", (why, *([BESIDE] if more else [])), None, continua=more
        )

    def _tracked(self, found: Ends, i: int) -> _Solutions:
        system, real = self.form.at(i), np.flatnonzero(is_real(found.poses, found.error))
        solved, error = close_all(system, found.x[:, real].real, self.family.columns)
        # two that meet at a place that is not real are next to one another there
        real, solved = real[error < REAL_CLOSED], solved[:, error < REAL_CLOSED]
        solved, once = self._distinct(solved, i), solved.shape[1]
        word, evidence = _completeness(found, self.groups, self.starts)
        if solved.shape[1] < once:
            word, evidence = "searched", (*evidence, "Different ends came to one real assembly.")
        more = self._continua(found.moving, i)
        N = prod(start.x.shape[1] for start in self.starts)
        # rods that would need complex turns to be put back are not real
        x, others = self.form.lifted(solved, i), self.form.lifted(np.delete(found.x, real, axis=1), i)
        complex_ = np.abs(x.imag).max(axis=0, initial=0.0) > REAL
        system = self.question.system
        off = Configuration(system, x.real).closure
        made, unfit = ~complex_ & (off < PUT_BACK), ~complex_ & bool(self.form.spare) & (off > UNFIT)
        if self.form.spare:
            others = others[:, Configuration(system, others).closure < UNFIT]
        if (lost := int((~made & ~complex_ & ~unfit).sum())) > 0:
            word, evidence = "searched", (*evidence, f"Of {counted(lost, 'mode')} the rods could not be put back.")
        others = np.concatenate([others, x[:, complex_]], axis=1)
        evidence = (*evidence, *self.form.told, *([BESIDE] if more else []))
        return _Solutions(
            x[:, made].real, solved[:, made], others, word, evidence, N, found.infinite, found.on_continua, more
        )

    def _continua(self, moving: Array, i: int) -> list[Found]:
        """Continua of the mechanism, where tracks came to such."""
        q = self.question
        if not moving.shape[1]:
            return []
        return continua(q.family, q.system, self.form.lifted(moving, i), q.drive[:, i], self.progress)

    def _result(self, found: _Solutions, i: int) -> Assemblies:
        q, m, x = self.question, self.question.asked, found.x
        here = Configuration(q.system, x)
        poses = np.moveaxis(user_poses(here), 1, 0)
        order = _ordered(q.family.prints(here).T)
        x, poses, solved = x[:, order], poses[order], found.solved[:, order]
        coordinates = self._coordinates(x, i)
        own = [q.m.freedom_names().index(name) for name in m.freedom_names()]
        names = m.freedom_names()
        told = [self._point(self.form.at(i), solved[:, [j]]) for j in range(x.shape[1])]
        sure = told_apart(self.family, solved, [proof for _, _, proof in told])
        away = Configuration(q.system, found.others)
        return Assemblies(
            m,
            dict(zip(q.names, q.values[:, i].tolist(), strict=True)),
            tuple(self._assembly(row[own]) for row in coordinates),
            poses,
            coordinates[:, own],
            tuple(kind for kind, _, _ in told),
            np.array([condition for _, condition, _ in told]),
            tuple(sure),
            ComplexModes(q.complex_coordinates(found.others)[:, own], np.moveaxis(user_poses(away), 1, 0)),
            found.word,
            (*found.evidence, *_said_apart(sure)),
            found.total,
            found.infinite,
            found.on_continua,
            tuple(
                Continuum(
                    self._assembly(self._coordinates(one.x[:, None], i)[0, own]),
                    one.dimension,
                    tuple(name for name, k in zip(names, own, strict=True) if one.moves[k]),
                )
                for one in found.continua
            ),
        )

    def _coordinates(self, x: Array, i: int) -> Array:
        """User coordinates ``(M, F)`` of states at a position, given ones as given."""
        out = self.question.coordinates(x)
        out[:, self.question.columns] = self.question.values[:, i]
        return out

    def _assembly(self, row: Array) -> Mechanism:
        m = self.question.asked
        return m.replace(start=dict(zip(m.freedom_names(), row.tolist(), strict=True)))

    def _point(self, system: System, x: Array) -> tuple[str, float, Certificate | None]:
        """Kind, condition and certificate of a real assembly that cannot move."""
        family, here = self.family, Configuration(system, x)
        condition = float(1.0 / max(least_value(family, here)[0], TINY))
        sure = certificate(here, family.free, family.passive.shape[1], not self.fault)
        # what is proved is regular, be it ever so close to a double point; so is what is far from any other
        if (sure is not None and sure.proved) or Nearby(family, system, x).gap > ONE_ASSEMBLY:
            return "regular", condition, sure
        return "double", np.inf, None


def _completeness(
    found: Ends, groups: Sequence[Undivided | Group], starts: Sequence[StartSet]
) -> tuple[str, tuple[str, ...]]:
    """The word for how sure it is that no assembly is missing, and what it rests on."""
    told = [_of_class(group.family, start) for group, start in zip(groups, starts, strict=True)]
    N = prod(start.x.shape[1] for start in starts)
    evidence = list(told[0][1])
    if len(groups) > 1:
        counts = ", ".join(
            f"{start.x.shape[1]} ({' '.join(group.names)})" for group, start in zip(groups, starts, strict=True)
        )
        evidence = [f"{len(groups)} groups are solved one after the other, modes of each: {counts}."]
        evidence += [
            f"{group.names[0]}: {text}" for group, (_, texts) in zip(groups, told, strict=True) for text in texts
        ]
    if found.left_out:
        evidence.append(
            f"Complex modes of a group that lie far away, or lead to more than {MOST_FOLLOWED} tracks, are not gone on with, nor counted."
        )
    single, meet = int((found.count == 1).sum()), found.count[found.count > 1]
    parts = [f"{single} alone", *([f"{meet.sum()} that meet in {len(meet)}"] if meet.size else [])]
    parts += [
        f"{number} {where}"
        for number, where in ((found.on_continua, "on continua"), (found.left_out, "left out"))
        if number
    ]
    evidence.append(
        f"{counted(found.tracks, 'track')} to this position in {counted(found.runs, 'run')}: of {N} modes "
        f"{', '.join(parts)}, {found.infinite} at infinity; {found.lost} lost in the best run."
    )
    adds_up = int(found.count.sum()) + found.on_continua + found.infinite + found.left_out == N
    if not found.clean or not adds_up:
        return "searched", (*evidence, "Tracks that are lost, or meet, leave open whether these are all.")
    return weakest(word for word, _ in told), tuple(evidence)


def _of_class(family: Family, start: StartSet) -> tuple[str, tuple[str, ...]]:
    """The word for a start set, and what it rests on."""
    N, known, trace = start.x.shape[1], bound(family), start.trace
    loops = (
        f"A random complex mechanism of the class has {counted(N, 'mode')}: {counted(start.loops, 'loop')} of such mechanisms brought no "
        f"further one (chance of one missed {start.chance:.1g} where all permutations are as likely), {start.lost} of {start.followed} "
        "tracks lost."
    )
    if not start.whole:
        return "searched", (loops, f"After {counted(start.followed, 'track')} others were not looked for any further.")
    if known is not None and known.count == N:
        return "proved", (f"The class has at most {N}: {known.source}.",)
    if not trace.passed:
        return "searched", (loops, "No trace test was passed, so that others may exist.")
    words = (
        f"Trace test passed: over {trace.samples} random mechanisms of the class a sum over all assemblies is a rational function of "
        f"degree {trace.degree} (the singular values of its Loewner matrix end there: {trace.last:.1g}, {trace.beyond:.1g})."
    )
    return "tested", (words, loops)


def _said_apart(sure: Sequence[Certificate | None]) -> tuple[str, ...]:
    """What certificates say of how far apart roots are."""
    apart = [one.apart for one in sure if one is not None and one.apart is not None]
    if not apart:
        return ()
    if min(apart) > 0:
        return (
            f"Roots of {counted(len(apart), 'certificate')} are proved to be {min(apart):.1g} apart or more (radians, lengths over L).",
        )
    return ("Of some certificates it is not proved that their roots are two.",)


def _ordered(numbers: Array) -> list[int]:
    """The order of rows by their numbers, of which smaller differences than rounding do not count."""

    def compare(i: int, j: int) -> int:
        apart = numbers[i] - numbers[j]
        first = int(np.argmax(np.abs(apart) > ORDER * max(1.0, float(np.abs(numbers).max()))))
        return int(np.sign(apart[first]))

    return sorted(range(len(numbers)), key=cmp_to_key(compare))
