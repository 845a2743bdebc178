"""All assemblies of a mechanism at given values of its drivers.

All assemblies as they are returned, and their records.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property, cmp_to_key
from math import prod
from typing import Annotated, Any

import numpy as np

from mechgraph import methods
from mechgraph.determinacy.mobility import free_motion
from mechgraph.determinacy.report import dead_point_error, undriven_error
from mechgraph.document import Document, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError, counted
from mechgraph.files import plain
from mechgraph.kinematics.assembly import closed_start, named_columns
from mechgraph.kinematics.prescribed import DriverMotion, coordinate, obtained, of_platform
from mechgraph.kinematics.state import CLOSED, Configuration, close_all, user_poses
from mechgraph.kinematics.system import System
from mechgraph.maths.linear import rank_of, singular_values
from mechgraph.maths.se3 import Index
from mechgraph.maths.tolerances import MODES, Tolerances
from mechgraph.memo import dataclass
from mechgraph.model.gears import moving_lines
from mechgraph.model.mechanism import Mechanism
from mechgraph.modes.certificate import TINY, Certificate, certificate, told_apart
from mechgraph.modes.family import NO_NUMBERS, Array, Family, Nearby, at_rest, irregular, least_value, searched
from mechgraph.modes.form import EquationForm, RodChain, Whole, WithoutRods, rods_of
from mechgraph.modes.start_sets import NOT_TESTED, Irregular, StartSet, bound, distinct, keep, kept, start_set, tested
from mechgraph.modes.targets import (
    MOST_FOLLOWED,
    Ends,
    EquationGroup,
    Found,
    Product,
    Undivided,
    continua,
    groups_of,
    is_real,
    least_imaginary,
)
from mechgraph.quantities import Count, Positive, door
from mechgraph.quantities import Index as Seed
from mechgraph.result.notes import doubted_angles


@dataclass(frozen=True)
class ModeData:
    """One real assembly; ``condition`` and ``certificate`` of regular ones."""

    start: Annotated[Mapping[str, float], "the coordinates of all freedoms"]
    kind: Annotated[str, "regular or double (assemblies meet)"]
    condition: float | None
    certificate: Certificate | None


@dataclass(frozen=True)
class ContinuumData:
    """Assemblies that can move with the drivers at rest."""

    start: Annotated[Mapping[str, float], "the coordinates of all freedoms at the one nearest to the start"]
    dimension: int
    moves: Annotated[tuple[str, ...], "freedoms that change"]


@dataclass(frozen=True)
class AssembliesData:
    """All assemblies at one position, and how sure it is that these are all."""

    mechanism: str
    at: Annotated[Mapping[str, float], "the values given"]
    completeness: Annotated[str, "proved, tested or searched"]
    evidence: Annotated[tuple[str, ...], "what that rests on"]
    total: Annotated[int | None, "assemblies of a random complex mechanism of the class, where one is known"]
    infinite: Annotated[int, "how many of these lie at infinity here"]
    on_continua: Annotated[int, "how many of these lie on continua here"]
    complex: Annotated[int, "how many are not real"]
    postures: Annotated[
        int, "how many of the modes, the first ones, differ by more than the ways of legs on universal joints"
    ]
    continua: tuple[ContinuumData, ...]
    modes: tuple[ModeData, ...]


@dataclass(frozen=True)
class ComplexModes:
    """Assemblies that are not real: ``coordinates (n, F)`` and ``poses (n, N, 4, 4)``, complex arrays, no mechanisms."""

    coordinates: Array
    poses: Array

    def __len__(self) -> int:
        return len(self.poses)


@dataclass(frozen=True)
class Continuum:
    """Assemblies that can move with the drivers at rest: those in which only the freedoms in ``moves`` differ, of one or several parts.

    Attributes
    ----------
    point : the one nearest to the start of the mechanism, as far as was seen.
    dimension : number of independent motions.
    moves : freedoms that change.
    """

    point: Mechanism
    dimension: int
    moves: tuple[str, ...]


@dataclass(frozen=True, repr=False)
class Assemblies(Shown, Sequence[Mechanism]):
    """All isolated real assembly modes at one position, each a Mechanism with ``start`` set. Returned by ``assemblies``.

    Attributes
    ----------
    mechanism, at : Mechanism, mapping
        The mechanism and the given values.
    poses : (M, N, 4, 4) array
        Poses of all links.
    coordinates : (M, F) array
        All freedoms, in the order of ``freedom_names`` [rad, length].
    kinds : tuple of str
        Per mode ``"regular"`` or ``"double"`` (double root: modes meet).
    condition : (M,) array
        Condition numbers of the closure equations; infinite if singular.
    certificates : tuple
        Of regular modes, else None.
    complex : object
        The solutions that are not real.
    completeness : {"proved", "tested", "searched"}
        The count equals a bound; a trace test passed, further monodromy loops found nothing and no path failed; or neither.
    evidence : tuple of str
        The reasons, with numbers.
    total : int or None
        Solutions of a generic member of the class; ``infinite`` of them diverged here, ``on_continua`` ended on self-motions.
    continua : tuple
        Self-motions with the drivers fixed; ``completeness`` does not cover them.
    postures : int
        Number of modes but for the two ways in which legs on universal joints stand: ``modes[:modes.postures]`` are those in which all
        such legs are as near to the start as they can be. The others differ in these legs alone, and are not drawn or shown in tables.

    Examples
    --------
    >>> import mechgraph as mg
    >>> modes = mg.assemblies(mg.load("four-bar"), {"A": 0.5})
    >>> [round(mode.start["D.Rz"], 4) for mode in modes]
    [-2.2613, -0.163]
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
    on_continua: int
    continua: tuple[Continuum, ...]
    postures: int

    def __len__(self) -> int:
        return len(self.modes)

    def __getitem__(self, i: int | slice) -> Any:
        return self.modes[i]

    def __iter__(self) -> Iterator[Mechanism]:
        return iter(self.modes)

    def document(self) -> Document:
        """A table of the assemblies, and how sure it is that these are all."""
        m = self.mechanism
        single = [
            name for pair in m.pairs for name, one in zip(pair.freedom_names, pair.type.drivable, strict=True) if one
        ]
        kinds, far = self.kinds[: self.postures], float(np.abs(self.poses[:, :, :3, 3]).max(initial=0.0))

        def cells(names: Sequence[str]) -> list[tuple[str, ...]]:
            columns = [obtained(m, name, self.poses, self.coordinates)[: len(kinds)] for name in names]
            each = (zip(names, values, strict=True) for values in np.array(columns).reshape(len(names), -1).T.tolist())
            return [tuple(f"{in_degrees(m, name, value, far):.5g}" for name, value in one) for one in each]

        # most coordinates of an assembly in its table, but where the pose of a platform tells all apart; all are in ``start`` of the mode
        shown = [name for name in of_platform(m) if name not in self.at]
        if not shown or len(set(cells(shown))) < len(kinds):
            shown = [name for name in single if name not in self.at][:4]
        names = [f"{name} [deg]" if unit_of(m, name) else name for name in shown]
        rows = [("mode", *names, "kind", "condition", "unique within")]
        for i, (kind, told) in enumerate(zip(kinds, cells(shown) if shown else [()] * len(kinds), strict=True)):
            sure = self.certificates[i]
            word = "none" if sure is None else f"{sure.radius:.2g}" if sure.proved else "not proved"
            rows.append((str(i), *told, kind, f"{self.condition[i]:.3g}", word))
        # columns for which a terminal is wide enough
        parts = [rows] if len(shown) < 5 else [[row[:4] for row in rows], [(row[0], *row[4:]) for row in rows]]
        several = self.postures < len(self)
        postures = f"{counted(self.postures, 'posture')} in " if several else ""
        title = f"{m.name}: {postures}{counted(len(self), 'mode')} at {values_text(m, self.at)}"
        moving = [
            f"Continuum of dimension {one.dimension}: {', '.join(one.moves)} move with the drivers at rest."
            for one in self.continua
        ]
        if several:
            moving.append(f"{len(self) - self.postures} more modes are the same postures with legs the other way.")
        doubts = () if len(self) else doubted_angles(m, self.at)
        words = [*moving, f"Completeness: {self.completeness}.", *self.evidence, *(f"{one}." for one in doubts)]
        return Document(title, (*(Table(part[0], part[1:]) for part in parts), Paragraph(" ".join(words))))

    def plot(self) -> Any:
        """Draw all assembly modes side by side.

        Returns
        -------
        Figure
            Of matplotlib.

        Raises
        ------
        MissingExtraError
            Without matplotlib.
        """
        drawn = [
            *zip(self[: self.postures], self.kinds, strict=False),
            *((one.point, "continuum") for one in self.continua),
        ]
        return methods.call("draw_side_by_side", self.mechanism, drawn, "there is no real assembly to draw")

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
            self.on_continua,
            len(self.complex),
            self.postures,
            tuple(ContinuumData(one.point.start, one.dimension, one.moves) for one in self.continua),
            tuple(ModeData(mode.start, kind, condition, sure) for mode, kind, condition, sure in modes),
        )

    def to_dict(self) -> dict[str, Any]:
        """The same as plain data."""
        return plain(self.data)


@dataclass(frozen=True, repr=False)
class AssembliesOver(Shown, Sequence[Assemblies]):
    """Assembly modes at several positions, ``modes[position][mode]``. Returned by ``assemblies`` for lists of values.

    Examples
    --------
    >>> import mechgraph as mg
    >>> modes = mg.assemblies(mg.load("four-bar"), {"A": [0.5, 0.6]})
    >>> [len(at) for at in modes], modes.completeness
    ([2, 2], 'proved')
    """

    positions: tuple[Assemblies, ...]

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, i: int | slice) -> Any:
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


def in_degrees(m: Mechanism, name: str, value: float, far: float = 0.0) -> float:
    """A value of a freedom or coordinate as it is shown: turns in degrees, zero where it is rounding (of lengths beside one of ``far``)."""
    turns = coordinate(m, name) is True
    # angle (radians), or part of the largest length, that tables show as zero
    if abs(value) <= 1e-12 * (1.0 if turns else far):
        return 0.0
    return float(np.rad2deg(value)) if turns else value


def unit_of(m: Mechanism, name: str) -> str:
    """What is written after it."""
    return " deg" if coordinate(m, name) is True else ""


WORDS = ("proved", "tested", "searched")
"""What completeness may be, the strongest first."""


def weakest(words: Iterable[str]) -> str:
    """The weakest of words for completeness."""
    return max(words, key=WORDS.index)


class Question:
    """Values given at one position or at several, and a closed position of the mechanism, beside the start where that is singular.

    ``m`` is the mechanism with free pairs for points and links that are given (see ``kinematics.prescribed``), ``drive (d, n)`` are the
    values in internal units; ``batch`` is ``()`` or ``(n,)``; ``declared`` is the closed position next to the start, singular or not.

    Raises
    ------
    DeclarationError, AssemblyError, IndeterminateError, DeadPointError
    """

    start: Configuration

    def __init__(self, m: Mechanism, values: Mapping[str, Any] | None) -> None:
        given = DriverMotion(m, values, asked="assemblies of")
        if len(given.batch) > 1:
            raise DeclarationError(
                f"assemblies of {m.name!r}",
                [f"values of shape {given.batch}: expected single values or a list of them"],
            )
        if moving := m.once(moving_lines):
            what = f"the relation of the coupling {moving[0]!r} is no polynomial; leave it out (couplings=) and give its freedoms"
            raise DeclarationError(f"assemblies of {m.name!r}", [what])
        self.asked, self.m, self.batch, self.names = m, given.m, given.batch, given.names
        self.start = closed_start(self.m)
        if given.free:
            self.m = given.whole(self.start)
            self.start = closed_start(self.m)
        self.system = self.start.system
        self.columns, _ = named_columns(self.m, self.system, dict.fromkeys(self.names, 0.0))
        self.unit = np.where(self.system.is_length[self.columns], self.system.par.L, 1.0)
        self.values = given.values("position", self.batch)
        self.drive = self.values / self.unit[:, None]
        self.declared = self.start
        self._read()
        if self._loose or self.freedoms.passive:
            self._leave()

    def _read(self) -> None:
        """What can move at the start, and the class there."""
        self.x = self.start.x[:, 0]
        self.freedoms = free_motion(self.system, self.x, self.columns)
        idle = np.stack([*(p.rates for p in self.freedoms.passive), np.zeros(self.system.n_freedoms)], axis=1)[:, :-1]
        self.family = Family(self.start, self.columns, idle, self._held(idle))

    def _held(self, idle: Array) -> Index:
        """Freedoms that may rest, as one of the passive motions ``idle (F, p)`` goes on for ever with them, evenly in all freedoms.

        Other members of the class need not have such a motion; that of a rod between balls they all have.
        """
        s, out = self.system, []
        for k in np.flatnonzero((s.single_rows >= 0) & (np.abs(idle) > MODES.span).any(axis=1)).tolist():
            part = idle[k] @ idle[k]
            if (
                part > MODES.span**2
                and Configuration(s, s.advance(self.start.x, idle @ idle[[k]].T / part)).closure[0] < CLOSED
            ):
                out.append(k)
                idle = at_rest(idle, np.array([k]))
        return np.array(out, dtype=np.intp)

    @cached_property
    def form(self) -> EquationForm:
        """The equations in which assemblies are looked for: without couplings and rods, where these can be left out."""
        family, drive, rods = self._uncoupled()
        if rods:
            found = WithoutRods(family, drive, rods, rods)
            if found.family.fault:
                found = WithoutRods(family, drive, rods, found.needed)
            if not found.family.fault:
                return found
        return Whole(family, drive)

    def _uncoupled(self) -> tuple[Family, Array, list[RodChain]]:
        """The class, what is given, and rods; without couplings, where these say as much of freedoms as there are that are not given.

        With ``G_d`` and ``G`` the coefficients of what is given and of the others, ``q = q_0 - G^-1 G_d (d - d_0)``.
        """
        if not self.m.couplings:
            return self.family, self.drive, rods_of(self.system, np.concatenate([self.columns, self.family.held]))
        s, terms = self.system, self.system.coupling_matrix[:, :, 0]
        others = np.setdiff1d(s.coupled_freedoms, self.columns)
        if rank_of(singular_values(terms[:, others])) < max(len(terms), len(others)):
            return self.family, self.drive, []
        begin = self.start.x[:, :1]
        turned = np.linalg.solve(
            terms[:, others], terms[:, self.columns] @ (self.drive - begin[s.single_rows[self.columns]])
        )
        columns = np.concatenate([self.columns, others])
        bare = System(self.m.replace(couplings=[]), None, s.par)
        idle, held = self.family.idle, self.family.held
        family = Family(Configuration(bare, begin), columns, idle, np.setdiff1d(held, others))
        drive = np.concatenate([self.drive, begin[s.single_rows[others]] - turned])
        return family, drive, rods_of(bare, np.concatenate([columns, held]))

    @property
    def _loose(self) -> bool:
        """Whether what is given leaves motions free at the start."""
        return bool(self.freedoms.undriven) and (self.family.unknowns > self.family.rank or bool(self.family.fault))

    def _leave(self) -> None:
        """Read the class beside the start, where motions are left free, or are passive, at the start alone."""
        loose, passive = self._loose, len(self.freedoms.passive)
        for moved in self._beside():
            self.start = moved
            self._read()
            if not self._loose and (loose or len(self.freedoms.passive) < passive):
                return
        self.start = self.declared
        self._read()
        if loose:
            self._refuse()

    def _beside(self) -> Iterator[Configuration]:
        """Closed positions a little away from the start either way: drivers moved, those too that stand still there, or free to move."""
        x0, motions, still = self.start.x, self.freedoms.null, self.columns[self.freedoms.still(self.columns)]
        rates = motions @ np.random.default_rng(0).normal(size=motions.shape[1])
        rates *= MODES.off_dead_point / max(float(np.abs(rates).max(initial=0.0)), MODES.span)
        for held in (self.columns, NO_NUMBERS):
            for sign in (1.0, -1.0):
                dq = sign * rates[:, None]
                dq[still] = sign * MODES.off_dead_point * bool(held.size)
                x, error = close_all(self.system, self.system.advance(x0, dq), held)
                if error[0] < CLOSED:
                    yield Configuration(self.system, x)

    def _refuse(self) -> None:
        """What is given leaves motions free where the mechanism is declared, and beside it."""
        names = [name for name, rests in zip(self.names, self.freedoms.still(self.columns), strict=True) if rests]
        if names and len(self.names) <= self.freedoms.mobility:
            raise dead_point_error(self.m, names, {name: self.m.start.get(name, 0.0) for name in names}, None)
        raise undriven_error(self.m, self.freedoms.undriven)

    def coordinates(self, x: Array) -> Array:
        """User coordinates ``(M, F)`` of real states ``(nx, M)``: whole rounds nearest to the start, given ones exactly as given."""
        s = self.system
        start = s.start_coordinates(self.m.start)
        # each by itself
        q = s.coordinates_of(x[:, :, None], start)[:, :, 0].T
        period = self.periods.copy()
        period[self.columns] = np.inf
        back = np.isfinite(period)
        q[:, back] -= period[back] * np.round((q - start)[:, back] / period[back])
        return q

    @property
    def periods(self) -> Array:
        """By how much single freedoms grow until all is as it was, user units; infinite where they go on or are coupled, and for balls."""
        s, alone = self.system, self.system.single_rows >= 0
        alone[s.coupled_freedoms] = False
        return np.where(alone, s.in_user_units(self.family.periods), np.inf)

    def complex_coordinates(self, x: Array) -> Array:
        """User coordinates ``(n, F)`` of complex states ``(nx, n)``."""
        s = self.system
        q = s.difference(x, s.state_of(np.zeros((s.n_freedoms, 1))))
        q[s.is_length] *= s.par.L
        return q.T


GUESSES = 400
"""Random guesses where no class is known."""
GUESSED_TURNS = 1.0
"""Turns on either side of the start within which angles are guessed."""

BESIDE = "What can move with the drivers at rest is not counted, and there may be more of that kind."
"""What is said beside continua."""

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Solutions:
    """Real states ``(nx, M)`` at a position and ``others`` that are not real, with what is said of them (see ``Assemblies``).

    ``solved`` are the real ones as they stand in the equations that were solved, ``of (2, M)`` says from which one each is and in which of
    so many ``ways`` rods are put back; ``unreal`` are those that are not, ``bent`` real there, but with rods that are not. ``continua`` lie
    in the equations of the mechanism.
    """

    x: Array
    solved: Array
    of: Index
    unreal: Array
    others: Array
    word: str
    evidence: tuple[str, ...]
    total: int | None
    infinite: int = 0
    on_continua: int = 0
    continua: Sequence[Found] = ()
    bent: int = 0
    ways: int = 1


class Finder:
    """Finds the assemblies of a question; with more than ``most`` ways of all legs, these are put back in that next to the start alone."""

    def __init__(
        self, question: Question, seed: int, cache: bool, progress: Progress | None, most: int = MOST_FOLLOWED
    ) -> None:
        self.question, self.progress, self._most = question, progress, most
        self.form: EquationForm = question.form
        self.family = self.form.family
        self.rng, self.cache, self._again = np.random.default_rng(seed), cache, seed != 0
        self.fault = self.family.fault

    @cached_property
    def groups(self) -> Sequence[Undivided | EquationGroup]:
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
            return tested(family, known, self.rng, self.progress) if self._again else known
        made = start_set(family, self.rng, self.progress)
        if self.cache and made.whole:
            keep(family, made)
        return made

    @property
    def ways(self) -> int:
        """In how many ways rods are put back."""
        every = self.form.ways
        return every if every * prod(start.x.shape[1] for start in self.starts) <= self._most else 1

    @property
    def told(self) -> tuple[str, ...]:
        """What is said of rods."""
        few = "These are too many: all but that next to the start are not listed."
        return (*self.form.told, *[few] * (self.ways < self.form.ways))

    def solutions(self, guesses: int = GUESSES, turns: float = GUESSED_TURNS) -> list[Solutions]:
        """What is found at all positions."""
        q = self.question
        if not self.starts:
            return [self._searched(q.drive[:, i], guesses, turns) for i in range(q.drive.shape[1])]
        found = Product(self.family, self.groups, self.starts, self.form.drive).ends(self.rng, self.progress)
        return [self._tracked(one, i) for i, one in enumerate(found)]

    def positions(self, guesses: int, turns: float) -> list[Assemblies]:
        """The assemblies at all positions."""
        return [self._result(found, i) for i, found in enumerate(self.solutions(guesses, turns))]

    def _searched(self, drive: Array, guesses: int, turns: float) -> Solutions:
        q = self.question
        x = searched(q.system, q.x, q.columns, drive, guesses, turns, self.rng, self.progress)
        x = np.concatenate([x, *([q.start.x] if np.allclose(q.start.x[self.family.rows, 0], drive) else [])], axis=1)
        why = (
            f"No homotopy available: {self.fault}. Searched from {guesses} random guesses within {turns:g} turns of the start; "
            "others may exist."
        )
        system = q.system
        # those that are singular are known to the root of rounding only
        least = np.where(irregular(self.family, Configuration(system, x)), MODES.real_singular, MODES.one_assembly)
        x = x[:, distinct(q.family.prints(Configuration(system, x)), None, least)]
        moving = np.array([Nearby(q.family, system, x[:, [i]]).moves for i in range(x.shape[1])], dtype=bool)
        more = continua(q.family, system, x[:, moving], drive, self.progress) if moving.any() else []
        others = np.zeros((system.n_state, 0), dtype=complex)
        x, said = x[:, ~moving], (why, *([BESIDE] if more else []))
        of = np.stack([np.arange(x.shape[1]), np.zeros(x.shape[1], dtype=np.intp)])
        return Solutions(x, x, of, others, others, "searched", said, None, continua=more)

    def _tracked(self, found: Ends, i: int) -> Solutions:
        system, real = self.form.at(i), np.flatnonzero(is_real(found.poses, found.error))
        solved, error = close_all(system, found.x[:, real].real, self.family.columns)
        # two that meet at a place that is not real are next to one another there
        real, solved = real[error < MODES.real_closed], solved[:, error < MODES.real_closed]
        solved, once = solved[:, distinct(self.family.prints(Configuration(self.form.at(i), solved)))], solved.shape[1]
        word, evidence = _completeness(found, self.groups, self.starts)
        if solved.shape[1] < once:
            word, evidence = "searched", (*evidence, "Different ends came to one real assembly.")
        more = self._continua(found.moving, i)
        every, ways = self.form.ways, self.ways
        N = every * prod(start.x.shape[1] for start in self.starts)
        # rods that would need complex turns to be put back are not real
        unreal = np.delete(found.x, real, axis=1)
        x, others = self.form.lifted(solved, i, ways), self.form.lifted(unreal, i, ways)
        complex_ = np.abs(x.imag).max(axis=0, initial=0.0) > least_imaginary()
        system = self.question.system
        off = Configuration(system, x.real).closure
        # closure error of what is real with its rods put back
        made, unfit = ~complex_ & (off < 1e-9), ~complex_ & bool(self.form.spare) & (off > MODES.unfit)
        if self.form.spare:
            others = others[:, Configuration(system, others).closure < MODES.unfit]
        if (lost := int((~made & ~complex_ & ~unfit).sum())) > 0:
            word, evidence = "searched", (*evidence, f"Of {counted(lost, 'mode')} the rods could not be put back.")
        others = np.concatenate([others, x[:, complex_]], axis=1)
        evidence = (*evidence, *self.told, *([BESIDE] if more else []))
        # both ways of a leg are one at the limit of its reach
        kept, prints = np.flatnonzero(made), self.question.family.prints(Configuration(system, x.real))
        way, root = np.divmod(kept, max(1, solved.shape[1]))
        each = [kept[root == k] for k in range(solved.shape[1])]
        kept = np.sort(np.concatenate([kept[:0], *(own[distinct(prints[:, own])] for own in each)]))
        way, root = np.divmod(kept, max(1, solved.shape[1]))
        return Solutions(
            x[:, kept].real, solved, np.stack([root, way]), unreal, others, word, evidence, N, found.infinite * every,
            found.on_continua * every, more, int(complex_.sum()), ways,
        )  # fmt: skip

    def _continua(self, moving: Array, i: int) -> list[Found]:
        """Continua of the mechanism, where tracks came to such."""
        q = self.question
        if not moving.shape[1]:
            return []
        return continua(q.family, q.system, self.form.lifted(moving, i, 1), q.drive[:, i], self.progress)

    def _result(self, found: Solutions, i: int) -> Assemblies:
        q, m, x = self.question, self.question.asked, found.x
        here = Configuration(q.system, x)
        poses = np.moveaxis(user_poses(here), 1, 0)
        nearest = np.flatnonzero(found.of[1] == 0)
        place = {
            k: i for i, k in enumerate(found.of[0, nearest[in_order_of(q.family.prints(here)[:, nearest].T)]].tolist())
        }
        order = sorted(range(x.shape[1]), key=lambda i: (found.of[1, i], place.get(found.of[0, i], 0)))
        x, poses = x[:, order], poses[order]
        roots, root, count = np.unique(found.of[0, order], return_inverse=True, return_counts=True)
        coordinates = self._coordinates(x, i)
        own = [q.m.freedom_names().index(name) for name in m.freedom_names()]
        names = m.freedom_names()
        told = [
            self._point(self.form.at(i), found.solved[:, [k]]) if ways == found.ways else DOUBLE
            for k, ways in zip(roots, count, strict=True)
        ]
        sure = told_apart(self.family, found.solved[:, roots], [proof for _, _, proof in told])
        away = Configuration(q.system, found.others)
        return Assemblies(
            m,
            dict(zip(q.names, q.values[:, i].tolist(), strict=True)),
            tuple(self._assembly(row[own]) for row in coordinates),
            poses,
            coordinates[:, own],
            tuple(told[k][0] for k in root),
            np.array([told[k][1] for k in root]),
            tuple(sure[k] for k in root),
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
            int((found.of[1] == 0).sum()),
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
        if (sure is not None and sure.proved) or Nearby(family, system, x).gap > MODES.one_assembly:
            return "regular", condition, sure
        return DOUBLE


DOUBLE: tuple[str, float, Certificate | None] = ("double", np.inf, None)
"""Kind, condition and certificate of assemblies that meet."""


def _completeness(
    found: Ends, groups: Sequence[Undivided | EquationGroup], starts: Sequence[StartSet]
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
        f"{', '.join(parts)}, {found.infinite} at infinity, {found.lost} failed (best run)."
    )
    adds_up = int(found.count.sum()) + found.on_continua + found.infinite + found.left_out == N
    if not found.clean or not adds_up:
        return "searched", (*evidence, "Some paths failed or merged, so the list may be incomplete.")
    return weakest(word for word, _ in told), tuple(evidence)


def _of_class(family: Family, start: StartSet) -> tuple[str, tuple[str, ...]]:
    """The word for a start set, and what it rests on."""
    N, known, trace = start.x.shape[1], bound(family), start.trace
    loops = (
        f"A random complex mechanism of the class has {counted(N, 'mode')}{start.estimate}: {counted(start.loops, 'loop')} of such "
        f"mechanisms brought no further one (chance of one missed {start.chance:.1g} where all permutations are as likely), "
        f"{start.lost} of {start.followed} tracks lost."
    )
    if not start.whole:
        return "searched", (loops, f"After {counted(start.followed, 'track')} others were not looked for any further.")
    if known is not None and known.count == N:
        return "proved", (f"The class has at most {N}: {known.source}.",)
    if not trace.passed:
        return "searched", (loops, NOT_TESTED)
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


def in_order_of(numbers: Array) -> list[int]:
    """The order of rows by their numbers, of which smaller differences than rounding do not count."""
    # difference of link poses (and coordinates) below which the next number decides the order of assemblies
    least = 1e-7 * float(np.abs(numbers).max(initial=1.0))

    def compare(i: int, j: int) -> int:
        apart = numbers[i] - numbers[j]
        first = int(np.argmax(np.abs(apart) > least))
        return int(np.sign(apart[first]))

    return sorted(range(len(numbers)), key=cmp_to_key(compare))


@door
def assemblies(
    m: Mechanism,
    values: Mapping[str, Any] | None = None,
    *,
    seed: Seed = 0,
    guesses: Count = GUESSES,
    turns: Positive = GUESSED_TURNS,
    cache: bool = True,
    progress: Progress | None = None,
    tolerances: Tolerances | None = None,
) -> Any:
    """Find all assembly modes for given joint values, points or link poses by homotopy continuation.

    Monodromy finds all solutions of a generic complex mechanism of the same class (topology, and relations that make closure
    equations dependent) and keeps them; parameter homotopy tracks them to your mechanism. If no homotopy is available (helical
    pairs), real assembly modes are searched from random guesses, and the result says so. Source: Sommese and Wampler, 2005.

    Parameters
    ----------
    m : Mechanism
        The mechanism.
    values : mapping, optional
        As in ``solve``: freedom -> value, ``"bucket.tip"`` -> point, ``"platform"`` -> pose ``(4, 4)``. Lists of values give
        ``AssembliesOver``. Declared drives that it does not name take their stored motion, else stay at the start.
    seed : int
        Seed of all random numbers; modes and their order do not depend on it.
    guesses : int
        Number of guesses of a search.
    turns : float
        Turns about the start within which a search guesses angles.
    cache : bool
        Keep start solutions in the user's folder (``MECHGRAPH_CACHE``, else ``~/.cache/mechgraph``).
    progress : callable, optional
        Called with a line of text now and then; an exception raised in it ends the call.
    tolerances : Tolerances, optional
        Numbers by which to decide, see ``Tolerances``. Default: those of the mechanism, which are the default ones.

    Returns
    -------
    Assemblies or AssembliesOver

    Raises
    ------
    DeclarationError, AssemblyError, IndeterminateError
        Invalid values; no position; freedoms left open.

    Examples
    --------
    >>> import mechgraph as mg
    >>> modes = mg.assemblies(mg.load("7r"), {"O1": 0.3})
    >>> len(modes), modes.total, modes.completeness
    (4, 16, 'proved')
    """
    drives = {m.full_name(drive.freedom): drive.motion for drive in m.drives}
    named = {name if m.freedom_fault(name, single=True) else m.full_name(name) for name in values or {}}
    if named <= drives.keys():
        still = {name for name, motion in drives.items() if motion is None} - named
        values = {**{name: m.start.get(name, 0.0) for name in still}, **(values or {})}
    question = Question(m, values)
    # of many positions fewer ways of legs each, as all of them are kept
    most = MOST_FOLLOWED * 16 // max(16, question.drive.shape[1])
    found = Finder(question, int(seed), cache, progress, most).positions(int(guesses), float(turns))
    return AssembliesOver(tuple(found)) if question.batch else found[0]
