"""All assemblies of a mechanism at given values of its drivers: what a user calls, and what comes back."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, cmp_to_key
from typing import Any

import numpy as np

from mechgraph.closure.assembly import close_all
from mechgraph.closure.configuration import Configuration
from mechgraph.data import plain
from mechgraph.document import Document, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError, counted
from mechgraph.force.applied_loads import user_poses
from mechgraph.model.mechanism import Mechanism, check_mechanism
from mechgraph.modes.balls import TINY
from mechgraph.modes.bounds import Bound, bound
from mechgraph.modes.certificate import Certificate, certificate
from mechgraph.modes.family import Array
from mechgraph.modes.monodromy import Irregular, StartSet, distinct, start_set
from mechgraph.modes.question import Question
from mechgraph.modes.record import AssembliesData, ModeData
from mechgraph.modes.search import searched
from mechgraph.modes.store import keep, kept
from mechgraph.modes.targets import Ends, ends
from mechgraph.quantities import wrong

REAL = 1e-6
"""Imaginary part of link poses up to which an assembly counts as real."""
REAL_SINGULAR, REAL_CLOSED = 1e-3, 1e-9
"""The same at singular ends, which are known to the root of rounding only; closure error of what is real."""
SINGULAR = 1e-5
"""Smallest singular value of the closure rows, as part of the largest, below which an assembly is no regular point."""
LARGE_STATE = 10.0
"""Size of a state that is not real from which on small singular values are a matter of scale."""
AWAY = 1e-2
"""Step along a motion that the rows leave free, after which a continuum is still closed."""
GUESSES = 400
"""Random guesses where no class is known."""
GUESSED_TURNS = 1.0
"""Turns on either side of the start within which angles are guessed."""
COORDINATES = 5
"""Most coordinates of an assembly in its table; all are in ``start`` of the mode."""
ORDER = 1e-7
"""Difference of link poses (and coordinates) below which the next number decides the order of assemblies."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class ComplexModes:
    """Assemblies that are not real: ``coordinates (n, F)`` and ``poses (n, N, 4, 4)``, complex arrays, no mechanisms."""

    coordinates: Array
    poses: Array

    def __len__(self) -> int:
        return len(self.poses)


@dataclass(frozen=True, repr=False)
class Assemblies(Shown, Sequence[Mechanism]):
    """All real assemblies at one position, each a Mechanism whose ``start`` is that assembly.

    Attributes
    ----------
    mechanism, at : the mechanism, and the values given.
    poses : ``(M, N, 4, 4)`` of all links.
    coordinates : ``(M, F)`` of all freedoms, in the order of ``freedom_names``.
    kinds : of every assembly ``"regular"``, ``"double"`` (assemblies meet) or ``"continuum"`` (it can move with the drivers at rest).
    condition : condition numbers ``(M,)`` of the closure equations; infinite where singular.
    certificates : of regular ones, else None.
    complex : those that are not real.
    completeness : ``"proved"`` (the count equals a bound), ``"tested"`` (a trace test was passed, loops of random mechanisms of the class
        bring no further one, and no track was lost) or ``"searched"``.
    evidence : what that rests on, in words with numbers.
    total : assemblies of a random complex mechanism of the class; None where no class is known. ``infinite`` of them lie at infinity here.
    """

    mechanism: Mechanism
    at: Mapping[str, float]
    modes: tuple[Mechanism, ...]
    poses: Array
    coordinates: Array
    kinds: tuple[str, ...]
    condition: Array
    certificates: tuple[Certificate | None, ...]
    complex: ComplexModes
    completeness: str
    evidence: tuple[str, ...]
    total: int | None
    infinite: int

    def __len__(self) -> int:
        return len(self.modes)

    def __getitem__(self, i: Any) -> Any:
        return self.modes[i]

    def __iter__(self) -> Iterator[Mechanism]:
        return iter(self.modes)

    def document(self) -> Document:
        """A table of the assemblies, and how sure it is that these are all."""
        m = self.mechanism
        single = [
            name for pair in m.pairs for name, one in zip(pair.freedom_names, pair.type.drivable, strict=True) if one
        ]
        shown = [name for name in single if name not in self.at][:COORDINATES]
        places = [m.freedom_names().index(name) for name in shown]
        units = [180.0 / np.pi if m.turns(name) else 1.0 for name in shown]
        names = [f"{name} [deg]" if m.turns(name) else name for name in shown]
        header = ("mode", *names, "kind", "condition", "certificate")
        rows = []
        for i, kind in enumerate(self.kinds):
            sure = self.certificates[i]
            word = "none" if sure is None else f"unique within {sure.radius:.2g}" if sure.proved else "not proved"
            rows.append(
                (
                    str(i),
                    *(f"{u * self.coordinates[i, k]:.6g}" for k, u in zip(places, units, strict=True)),
                    kind,
                    f"{self.condition[i]:.3g}",
                    word,
                )
            )
        title = f"{m.name}: {counted(len(self), 'mode')} at {values_text(m, self.at)}"
        return Document(
            title,
            (Table(header, tuple(rows)), Paragraph(f"Completeness: {self.completeness}. " + " ".join(self.evidence))),
        )

    def plot(self) -> Any:
        """A picture of all assemblies side by side; the figure."""
        return importlib.import_module("mechgraph.show.modes").draw_assemblies(self)

    @property
    def data(self) -> AssembliesData:
        """Everything but arrays as a record."""
        modes = zip(self.modes, self.kinds, self.condition.tolist(), self.certificates, strict=True)
        return AssembliesData(
            self.mechanism.name,
            self.at,
            self.completeness,
            self.evidence,
            self.total,
            self.infinite,
            len(self.complex),
            tuple(ModeData(mode.start, kind, condition, sure) for mode, kind, condition, sure in modes),
        )

    def to_dict(self) -> dict[str, Any]:
        """The same as plain data."""
        return plain(self.data)


@dataclass(frozen=True, repr=False)
class AssembliesOver(Shown, Sequence[Assemblies]):
    """The assemblies at several positions, one after the other: ``modes[position][mode]``."""

    positions: tuple[Assemblies, ...]

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, i: Any) -> Any:
        return self.positions[i]

    @property
    def completeness(self) -> str:
        """The weakest of all positions."""
        return weakest(p.completeness for p in self.positions)

    def document(self) -> Document:
        """How many assemblies there are at every position."""
        rows = tuple(
            (values_text(p.mechanism, p.at), str(len(p)), str(len(p.complex)), p.completeness) for p in self.positions
        )
        return Document(
            f"{self.positions[0].mechanism.name}: assemblies",
            (Table(("at", "real", "not real", "completeness"), rows),),
        )

    def to_dict(self) -> dict[str, Any]:
        """Everything as plain data."""
        return {"positions": [p.to_dict() for p in self.positions]}


def values_text(m: Mechanism, at: Mapping[str, float]) -> str:
    """Values given, turns in degrees: ``A.Rz = 30 deg, B.Tz = 0.1``."""
    return ", ".join(f"{name} = {in_degrees(m, name, value):.6g}{unit_of(m, name)}" for name, value in at.items())


def in_degrees(m: Mechanism, name: str, value: float) -> float:
    """A value of a freedom or coordinate as it is shown: turns in degrees."""
    return float(np.rad2deg(value)) if m.turns(name) else value


def unit_of(m: Mechanism, name: str) -> str:
    """What is written after it."""
    return " deg" if m.turns(name) else ""


WORDS = ("proved", "tested", "searched")
"""What completeness may be, the strongest first."""


def weakest(words: Iterable[str]) -> str:
    """The weakest of words for completeness."""
    return max(words, key=WORDS.index)


def assemblies(
    m: Mechanism,
    values: Mapping[str, Any] | None = None,
    *,
    seed: int = 0,
    guesses: int = GUESSES,
    turns: float = GUESSED_TURNS,
    cache: bool = True,
    progress: Progress | None = None,
) -> Any:
    """All real assemblies with some freedoms, points of links or link poses given: the closure solved over the complex numbers.

    All assemblies of a random complex mechanism of the same class (topology, and the relations that make closure rows dependent) are
    found once by monodromy and kept; tracks lead from these to the mechanism at hand. Where no class is known (helical pairs, relations
    such as Bennett's), real assemblies are searched from random guesses, and the result says so.

    Parameters
    ----------
    values : as for ``solve``: freedom -> value, ``"bucket.tip"`` -> point, ``"platform"`` -> pose (4, 4). One position gives
        ``Assemblies``, a list of values ``AssembliesOver``.
    seed : of all random numbers; the assemblies and their order do not depend on it.
    guesses, turns : of a search, and the turns about the start within which angles are guessed.
    cache : whether start sets are kept in the user's folder (see ``modes.store``).
    progress : called with a line of text now and then; an exception raised in it ends the call.

    Raises
    ------
    DeclarationError, AssemblyError, IndeterminateError
    """
    check_mechanism(m, "assemblies")
    faults = []
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or seed < 0:
        faults.append(wrong(seed, "seed", "a whole number, 0 or more"))
    if isinstance(guesses, bool) or not isinstance(guesses, int | np.integer) or guesses < 1:
        faults.append(wrong(guesses, "guesses", "a whole number, 1 or more"))
    if not isinstance(turns, int | float) or not 0 < turns < np.inf:
        faults.append(wrong(turns, "turns", "a number above 0"))
    if progress is not None and not callable(progress):
        faults.append(wrong(progress, "progress", "a function of a line of text"))
    if faults:
        raise DeclarationError(f"assemblies of {m.name!r}", faults)
    question = Question(m, values)
    found = Finder(question, int(seed), cache, progress).positions(int(guesses), float(turns))
    return AssembliesOver(tuple(found)) if question.batch else found[0]


@dataclass(frozen=True)
class _Solutions:
    """Real states ``(nx, M)`` at a position and ``others`` that are not real, with what is said of them (see ``Assemblies``)."""

    x: Array
    others: Array
    word: str
    evidence: tuple[str, ...]
    total: int | None
    infinite: int


class Finder:
    """Finds the assemblies of a question."""

    def __init__(self, question: Question, seed: int, cache: bool, progress: Progress | None) -> None:
        self.question, self.family, self.progress = question, question.family, progress
        self.rng, self.cache = np.random.default_rng(seed), cache
        self.fault = self.family.fault

    @cached_property
    def start(self) -> StartSet | None:
        """The start set of the class; None where there is none."""
        if self.fault:
            return None
        known = kept(self.family) if self.cache else None
        if known is not None:
            return known
        try:
            made = start_set(self.family, self.rng, self.progress)
        except Irregular:
            self.fault = "random mechanisms of its class are not closed by regular equations"
            return None
        if self.cache and made.whole:
            keep(self.family, made)
        return made

    def solutions(self, guesses: int = GUESSES, turns: float = GUESSED_TURNS) -> list[_Solutions]:
        """What is found at all positions."""
        q = self.question
        if self.start is None:
            return [self._searched(q.drive[:, i], guesses, turns) for i in range(q.drive.shape[1])]
        found = ends(self.family, self.start, q.drive, self.rng, self.progress)
        return [self._tracked(one, self.start, i) for i, one in enumerate(found)]

    def positions(self, guesses: int, turns: float) -> list[Assemblies]:
        """The assemblies at all positions."""
        return [self._result(found, i) for i, found in enumerate(self.solutions(guesses, turns))]

    def _distinct(self, x: Array) -> Array:
        return x[:, distinct(self.family.prints(Configuration(self.question.system, x)))]

    def _searched(self, drive: Array, guesses: int, turns: float) -> _Solutions:
        q = self.question
        x = searched(q.system, q.x, q.columns, drive, guesses, turns, self.rng, self.progress)
        x = np.concatenate([x, *([q.start.x] if np.allclose(q.start.x[self.family.rows, 0], drive) else [])], axis=1)
        why = (
            f"No class is known: {self.fault}. Searched from {guesses} random guesses within {turns:g} turns of the start; "
            "others may exist."
        )
        return _Solutions(
            self._distinct(x), np.zeros((q.system.n_state, 0), dtype=complex), "searched", (why,), None, 0
        )

    def _tracked(self, found: Ends, start: StartSet, i: int) -> _Solutions:
        q, N = self.question, start.x.shape[1]
        size = np.maximum(1.0, np.abs(found.poses).max(axis=0, initial=0.0))
        imaginary = np.abs(found.poses.imag).max(axis=0, initial=0.0) / size
        real = imaginary < np.where(found.singular, REAL_SINGULAR, REAL)
        x, error = close_all(q.system, found.x[:, real].real, q.columns)
        x = self._distinct(x[:, error < REAL_CLOSED])
        if (self._irregular(found.x[:, ~real & found.singular])).any():
            x = np.concatenate([x, self._of_continuum(i)], axis=1)
        word, evidence = _completeness(found, start, N, bound(self.family))
        return _Solutions(x, found.x[:, ~real], word, evidence, N, found.infinite)

    def _irregular(self, x: Array) -> Array:
        """Which assemblies that are not real are no regular points."""
        J = Configuration(self.question.system, x).J[:, self.family.free].transpose(2, 0, 1)
        sigma = np.linalg.svd(J, compute_uv=False)
        least = len(self.family.free) - self.family.passive.shape[1] - 1
        large = np.abs(x).max(axis=0, initial=0.0) > LARGE_STATE
        return np.asarray((sigma[:, least] < SINGULAR * sigma[:, 0]) & ~large)

    def _of_continuum(self, i: int) -> Array:
        """A real assembly ``(nx, 1)`` of a continuum that tracks met at complex points, the nearest to the start; or none."""
        q = self.question
        x = searched(q.system, q.x, q.columns, q.drive[:, i], GUESSES // 4, 0.5, self.rng, self.progress)
        near = np.argsort(np.abs(q.system.difference(x, q.start.x)).max(axis=0))
        found = [j for j in near.tolist() if self._point(x[:, [j]])[0] == "continuum"]
        return x[:, found[:1]]

    def _result(self, found: _Solutions, i: int) -> Assemblies:
        q, m, x = self.question, self.question.asked, found.x
        here = Configuration(q.system, x)
        poses = np.moveaxis(user_poses(here), 1, 0)
        order = _ordered(self.family.prints(here).T)
        x, poses = x[:, order], poses[order]
        coordinates = q.coordinates(x)
        coordinates[:, q.columns] = q.values[:, i]
        own = [q.m.freedom_names().index(name) for name in m.freedom_names()]
        kinds, conditions, sure = [], [], []
        for j in range(x.shape[1]):
            kind, condition, proof = self._point(x[:, [j]])
            kinds.append(kind)
            conditions.append(condition)
            sure.append(proof)
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
            found.evidence,
            found.total,
            found.infinite,
        )

    def _point(self, x: Array) -> tuple[str, float, Certificate | None]:
        """Kind, condition and certificate of a real assembly ``x (nx, 1)``."""
        family, here = self.family, Configuration(self.question.system, x)
        J = here.J[:, family.free, 0]
        _, sigma, Vt = np.linalg.svd(J)
        rank, wanted = int((sigma > SINGULAR * sigma[0]).sum()) if sigma.size else 0, family.unknowns
        condition = float(sigma[0] / max(sigma[wanted - 1], TINY)) if wanted else 1.0
        sure = certificate(here, family.free, family.passive.shape[1], not self.fault)
        # what is proved is regular, be it ever so close to a double point
        if rank >= wanted or (sure is not None and sure.proved):
            return "regular", condition, sure
        return ("continuum" if self._moves(here, Vt[rank:]) else "double"), np.inf, None

    def _moves(self, here: Configuration, left: Array) -> bool:
        """Whether the loops stay closed along a motion that the rows leave free, with the drivers at rest."""
        family, s = self.family, self.question.system
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


def _completeness(found: Ends, start: StartSet, N: int, known: Bound | None) -> tuple[str, tuple[str, ...]]:
    """The word for how sure it is that no assembly is missing, and what it rests on."""
    many = counted(N, "mode")
    loops = (
        f"A random complex mechanism of the class has {many}: {counted(start.loops, 'loop')} of such mechanisms brought no further one "
        f"(chance of one missed {start.chance:.1g} where all permutations are as likely), {start.lost} of {start.followed} tracks lost."
    )
    tracks = (
        f"{counted(N, 'track')} to this position in {counted(found.runs, 'run')}: {found.x.shape[1]} different ends, "
        f"{found.infinite} at infinity, {found.lost} lost in the best run."
    )
    if not start.whole or not found.clean:
        return "searched", (loops, tracks, "Tracks that are lost, or meet, leave open whether these are all.")
    if known is not None and known.count == N:
        return "proved", (f"The class has at most {N}: {known.source}.", tracks)
    trace = start.trace
    if not trace.passed:
        return "searched", (loops, "No trace test was passed, so that others may exist.", tracks)
    words = (
        f"Trace test passed: over {trace.samples} random mechanisms of the class a sum over all assemblies is a rational function of "
        f"degree {trace.degree} (the singular values of its Loewner matrix end there: {trace.last:.1g}, {trace.beyond:.1g})."
    )
    return "tested", (words, loops, tracks)


def _ordered(numbers: Array) -> list[int]:
    """The order of rows by their numbers, of which smaller differences than rounding do not count."""

    def compare(i: int, j: int) -> int:
        apart = numbers[i] - numbers[j]
        first = int(np.argmax(np.abs(apart) > ORDER * max(1.0, float(np.abs(numbers).max()))))
        return int(np.sign(apart[first]))

    return sorted(range(len(numbers)), key=cmp_to_key(compare))
