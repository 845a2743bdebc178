"""How the assemblies of a question are found: tracks from a start set, or a search; what each is, and how sure it is that these are all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, cmp_to_key
from math import prod

import numpy as np

from mechgraph.closure.assembly import close_all
from mechgraph.closure.configuration import Configuration
from mechgraph.errors import counted
from mechgraph.force.applied_loads import user_poses
from mechgraph.modes.balls import TINY
from mechgraph.modes.bounds import bound
from mechgraph.modes.certificate import Certificate, certificate, told_apart
from mechgraph.modes.family import Array, Family, parts
from mechgraph.modes.form import Form, Whole
from mechgraph.modes.groups import Group, Undivided, groups_of
from mechgraph.modes.monodromy import ONE_ASSEMBLY, Irregular, StartSet, distinct, start_set
from mechgraph.modes.product import MOST_FOLLOWED, REAL, REAL_SINGULAR, Product, is_real
from mechgraph.modes.question import Question
from mechgraph.modes.result import Assemblies, ComplexModes, weakest
from mechgraph.modes.search import searched
from mechgraph.modes.store import keep, kept
from mechgraph.modes.targets import Ends

REAL_CLOSED = 1e-9
"""Closure error of what is real."""
UNFIT = 1e-3
"""Closure error from which on a rod that has no row does not fit; between this and that of what is closed it is open whether it does."""
SINGULAR = 1e-5
"""Smallest singular value of the closure rows, as part of the largest, below which an assembly is no regular point."""
LARGE_STATE = 10.0
"""Size of a state from which on small singular values are a matter of scale."""
AWAY = 1e-2
"""Step along a motion that the rows leave free, after which a continuum is still closed."""
GUESSES = 400
"""Random guesses where no class is known."""
GUESSED_TURNS = 1.0
"""Turns on either side of the start within which angles are guessed."""
ORDER = 1e-7
"""Difference of link poses (and coordinates) below which the next number decides the order of assemblies."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class _Solutions:
    """Real states ``(nx, M)`` at a position and ``others`` that are not real, with what is said of them (see ``Assemblies``).

    ``solved`` are the real ones as they stand in the equations that were solved.
    """

    x: Array
    solved: Array
    others: Array
    word: str
    evidence: tuple[str, ...]
    total: int | None
    infinite: int


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
        # those that are singular are known to the root of rounding only
        least = np.where(self._irregular(x), REAL_SINGULAR, ONE_ASSEMBLY)
        x = x[:, distinct(q.family.prints(Configuration(q.system, x)), None, least)]
        return _Solutions(x, x, np.zeros((q.system.n_state, 0), dtype=complex), "searched", (why,), None, 0)

    def _tracked(self, found: Ends, i: int) -> _Solutions:
        system, real = self.form.at(i), is_real(found.poses, found.singular)
        solved, error = close_all(system, found.x[:, real].real, self.family.columns)
        solved = self._distinct(solved[:, error < REAL_CLOSED], i)
        if (self._irregular(found.x[:, ~real & found.singular])).any():
            solved = np.concatenate([solved, self._of_continuum(i)], axis=1)
        word, evidence = _completeness(found, self.groups, self.starts)
        N = prod(start.x.shape[1] for start in self.starts)
        # rods that would need complex turns to be put back are not real
        x, others = self.form.lifted(solved, i), self.form.lifted(found.x[:, ~real], i)
        complex_ = np.abs(x.imag).max(axis=0, initial=0.0) > REAL
        system = self.question.system
        off = Configuration(system, x.real).closure
        made, unfit = ~complex_ & (off < REAL_CLOSED), ~complex_ & bool(self.form.spare) & (off > UNFIT)
        if self.form.spare:
            others = others[:, Configuration(system, others).closure < UNFIT]
        if (lost := int((~made & ~complex_ & ~unfit).sum())) > 0:
            word, evidence = "searched", (*evidence, f"Of {counted(lost, 'mode')} the rods could not be put back.")
        others = np.concatenate([others, x[:, complex_]], axis=1)
        return _Solutions(
            x[:, made].real, solved[:, made], others, word, (*evidence, *self.form.told), N, found.infinite
        )

    def _irregular(self, x: Array) -> Array:
        """Which assemblies are no regular points, as far as they are not large."""
        J = Configuration(self.family.system, x).J[:, self.family.free].transpose(2, 0, 1)
        sigma = np.linalg.svd(J, compute_uv=False)
        large = np.abs(x).max(axis=0, initial=0.0) > LARGE_STATE
        return np.asarray((parts(sigma)[:, : self.family.unknowns] < SINGULAR).any(axis=1) & ~large)

    def _of_continuum(self, i: int) -> Array:
        """A real assembly ``(nx, 1)`` of a continuum that tracks met at complex points, the nearest to the start; or none."""
        family, system = self.family, self.form.at(i)
        drive = self.form.drive[: len(family.columns), i]
        rng = np.random.default_rng(0)  # the same one for any seed
        x = searched(system, family.here.x[:, 0], family.columns, drive, GUESSES // 4, 0.5, rng, self.progress)
        near = np.argsort(np.abs(system.difference(x, family.here.x)).max(axis=0))
        found = [j for j in near.tolist() if self._point(Configuration(system, x[:, [j]]))[0] == "continuum"]
        return x[:, found[:1]]

    def _result(self, found: _Solutions, i: int) -> Assemblies:
        q, m, x = self.question, self.question.asked, found.x
        here = Configuration(q.system, x)
        poses = np.moveaxis(user_poses(here), 1, 0)
        order = _ordered(q.family.prints(here).T)
        x, poses, solved = x[:, order], poses[order], found.solved[:, order]
        coordinates = q.coordinates(x)
        coordinates[:, q.columns] = q.values[:, i]
        own = [q.m.freedom_names().index(name) for name in m.freedom_names()]
        kinds, conditions, sure, system = [], [], [], self.form.at(i)
        for j in range(x.shape[1]):
            kind, condition, proof = self._point(Configuration(system, solved[:, [j]]))
            kinds.append(kind)
            conditions.append(condition)
            sure.append(proof)
        sure = told_apart(self.family, solved, sure)
        modes = tuple(
            m.replace(start=dict(zip(m.freedom_names(), row[own].tolist(), strict=True))) for row in coordinates
        )
        away = Configuration(q.system, found.others)
        return Assemblies(
            m,
            dict(zip(q.names, q.values[:, i].tolist(), strict=True)),
            modes,
            poses,
            coordinates[:, own],
            tuple(kinds),
            np.array(conditions),
            tuple(sure),
            ComplexModes(q.complex_coordinates(found.others)[:, own], np.moveaxis(user_poses(away), 1, 0)),
            found.word,
            (*found.evidence, *_said_apart(sure)),
            found.total,
            found.infinite,
        )

    def _point(self, here: Configuration) -> tuple[str, float, Certificate | None]:
        """Kind, condition and certificate of a real assembly."""
        family = self.family
        J = here.J[:, family.free, 0]
        _, sigma, Vt = np.linalg.svd(J)
        size = parts(sigma)
        rank, wanted = int((size > SINGULAR).sum()), family.unknowns
        condition = float(1.0 / max(size[wanted - 1], TINY)) if wanted else 1.0
        sure = certificate(here, family.free, family.passive.shape[1], not self.fault)
        # what is proved is regular, be it ever so close to a double point
        if rank >= wanted or (sure is not None and sure.proved):
            return "regular", condition, sure
        return ("continuum" if self._moves(here, Vt[rank:]) else "double"), np.inf, None

    def _moves(self, here: Configuration, left: Array) -> bool:
        """Whether the loops stay closed along a motion that the rows leave free, with the drivers at rest."""
        family, s = self.family, here.system
        if family.passive.shape[1]:
            held = np.linalg.qr(family.passive[family.free])[0]
            left = left - (left @ held) @ held.T
        for direction in left:
            size = np.abs(direction).max()
            if size < 1e-3:
                continue
            for sign in (1.0, -1.0):
                dq = np.zeros((s.n_freedoms, 1))
                dq[family.free, 0] = sign * AWAY * direction / size
                moved, error = close_all(s, s.advance(here.x, dq), family.columns)
                gone = np.abs(self.family.prints(Configuration(s, moved)) - self.family.prints(here)).max()
                if error[0] < 1e-11 and gone > 0.2 * AWAY:
                    return True
        return False


def _completeness(
    found: Ends, groups: Sequence[Undivided | Group], starts: Sequence[StartSet]
) -> tuple[str, tuple[str, ...]]:
    """The word for how sure it is that no assembly is missing, and what it rests on."""
    told = [_of_class(group.family, start) for group, start in zip(groups, starts, strict=True)]
    evidence = list(told[0][1])
    if len(groups) > 1:
        counts = ", ".join(
            f"{start.x.shape[1]} ({' '.join(group.names)})" for group, start in zip(groups, starts, strict=True)
        )
        evidence = [f"{len(groups)} groups are solved one after the other, modes of each: {counts}."]
        evidence += [
            f"{group.names[0]}: {text}" for group, (_, texts) in zip(groups, told, strict=True) for text in texts
        ]
    if found.partial:
        evidence.append(
            f"Complex modes of a group that lie far away, or lead to more than {MOST_FOLLOWED} tracks, are not gone on with, nor counted."
        )
    evidence.append(
        f"{counted(found.tracks, 'track')} to this position in {counted(found.runs, 'run')}: {found.x.shape[1]} different ends, "
        f"{found.infinite} at infinity, {found.lost} lost in the best run."
    )
    if not found.clean:
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
