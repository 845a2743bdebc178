"""Branches of a mechanism over the range of one driver.

At evenly spread samples of the driver all assemblies are known. The circuits through them are followed, until every assembly lies on one
(see ``modes.circuits``); between its folds a circuit is a branch, and circuits that meet are one. Assemblies that are not real are followed
from sample to sample: where they meet in a fold of none of these circuits another one begins. A fold to which none comes faces one of the
same kind, and all assemblies are looked for between both. So it goes on until nothing is left that is not accounted for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field
from itertools import pairwise
from typing import Annotated, Any, TypeAlias

import numpy as np

from mechgraph import methods
from mechgraph.determinacy.report import check, structure_error
from mechgraph.document import Document, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError, IndeterminateError, counted
from mechgraph.files import plain
from mechgraph.graph.linkgraph import components_of_edges, members
from mechgraph.kinematics.reach import BEYOND_END
from mechgraph.kinematics.state import CLOSED, Configuration, close, close_all
from mechgraph.maths.tolerances import MODES
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.modes.assemblies import (
    Finder,
    Question,
    Solutions,
    in_degrees,
    in_order_of,
    unit_of,
    values_text,
    weakest,
)
from mechgraph.modes.between_samples import Double, Gap, Station, Unreal
from mechgraph.modes.circuits import CircuitNodes, Circuits, in_order
from mechgraph.modes.family import Array
from mechgraph.modes.targets import MOST_FOLLOWED
from mechgraph.quantities import Index as Seed
from mechgraph.quantities import at_least, door, is_numeric, real_array, wrong

GOLDEN = 0.5 * (3.0 - 5.0**0.5)
"""Place of the first sample, as part of the distance of two: double points are likely at whole parts of a turn."""


@dataclass(frozen=True)
class BranchData:
    """A branch: its interval of the driver, and the range of every freedom."""

    interval: tuple[float, float]
    full_turn: Annotated[bool | None, "null where an end could not be told"]
    turns: Annotated[int, "turns of the driver that bring it back"]
    circuit: int
    ranges: Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Fold:
    """Where two branches meet and the driver has to turn back."""

    value: float
    sense: Annotated[int, "1 at an upper limit, -1 at a lower one"]
    branches: tuple[int, int]
    fastest: Annotated[str, "the freedom that moves most there, while the driver stands still"]


@dataclass(frozen=True)
class Bifurcation:
    """Where branches cross: all that meet there."""

    value: float
    branches: tuple[int, ...]


@dataclass(frozen=True)
class BranchesData:
    """All branches over a driver."""

    mechanism: str
    driver: str
    completeness: Annotated[str, "proved, tested or searched"]
    evidence: Annotated[tuple[str, ...], "what that rests on between samples"]
    resolution: Annotated[float, "distance of the samples"]
    open_ends: Annotated[int, "ends of branches that could not be told"]
    branches: tuple[BranchData, ...]
    folds: tuple[Fold, ...]
    bifurcations: tuple[Bifurcation, ...]
    circuits: Annotated[tuple[tuple[int, ...], ...], "branches of each"]


@dataclass(eq=False)
class BranchRun:
    """A branch of some circuits by its number ``run`` there, which comes back after ``turns`` of the driver; 0 where it does not.

    ``told`` counts its ends that are folds or lie at an end of the range; ``key``, by which branches are ordered, is the place of its first
    assembly, and ``begin`` the driver value there (internal units).
    """

    of: Circuits
    run: int
    turns: int
    key: tuple[float, ...]
    begin: float
    told: int = 0

    @property
    def last(self) -> int:
        """Its last step."""
        return int(np.flatnonzero(self.of.run == self.run)[-1])

    @property
    def fold(self) -> tuple[float, int]:
        """Driver value at its end, internal units, and 1 where that is an upper limit, else -1."""
        return float(self.of.b.x[self.of.row, self.last]), int(self.of.rises[self.last])

    @property
    def ends(self) -> Array:
        """Driver values at both ends, in the sense in which the circuit is followed."""
        return self.of.values(self.run)[[0, -1]]


Stretches: TypeAlias = tuple[list[BranchRun], list[tuple[BranchRun, BranchRun]], int]
"""Branches, pairs of them that meet in folds, and how many ends are open."""


@dataclass(frozen=True)
class Branch:
    """An assembly followed as far as the driver goes: driver ``values (n,)``, rising, and ``coordinates (n, F)`` of all freedoms.

    ``interval`` is that of the driver, up to the folds at its ends; ``turns`` of the driver bring it back where it is a ``full_turn``,
    which is None if an end is unresolved.
    """

    values: Array
    coordinates: Array
    interval: tuple[float, float]
    full_turn: bool | None
    turns: int
    circuit: int
    stretch: BranchRun = field(repr=False)


@dataclass(frozen=True)
class Defects:
    """Why positions cannot be met one after the other: the branch and circuit of each, and whether these, or their order, are wrong."""

    branches: tuple[int, ...]
    circuits: tuple[int, ...]
    branch: bool
    circuit: bool
    order: bool


@dataclass(frozen=True, repr=False)
class Branches(Shown):
    """All branches of a mechanism over the range of one driver. Returned by ``branches``.

    Attributes
    ----------
    mechanism, driver : Mechanism, str
        The mechanism and its driver.
    branches, folds, bifurcations : tuple
        Curves between singular positions; folds ordered by driver value.
    circuits : tuple of tuple of int
        Numbers of the branches that the mechanism can run through without disassembly.
    completeness : str
        Of the circuits: of the assembly modes at the samples, see ``Assemblies``; no stronger than "tested" where it is not told that no
        circuit lies wholly between two of them.
    evidence : tuple of str
        The reasons for what is between samples.
    resolution : float
        Distance of the samples.
    open_ends : int
        Ends of branches that are neither a fold shared with another branch nor at the end of the range; 0 if the map is whole.

    Examples
    --------
    >>> import mechgraph as mg
    >>> b = mg.branches(mg.load("four-bar"), "A", samples=6, points=60)
    >>> b.circuits, b.open_ends
    (((0,), (1,)), 0)
    """

    mechanism: Mechanism
    driver: str
    branches: tuple[Branch, ...]
    folds: tuple[Fold, ...]
    bifurcations: tuple[Bifurcation, ...]
    circuits: tuple[tuple[int, ...], ...]
    completeness: str
    evidence: tuple[str, ...]
    resolution: float
    open_ends: int

    def __len__(self) -> int:
        return len(self.branches)

    @property
    def intervals(self) -> tuple[tuple[float, float], ...]:
        """Driver interval of every branch."""
        return tuple(b.interval for b in self.branches)

    @property
    def full_turn(self) -> tuple[bool | None, ...]:
        """Whether the driver turns right round on every branch; None if an end is unresolved."""
        return tuple(b.full_turn for b in self.branches)

    @property
    def ranges(self) -> tuple[dict[str, tuple[float, float]], ...]:
        """Smallest and largest value of every freedom on every branch."""
        names = self.mechanism.freedom_names()
        return tuple(
            {name: (float(q.min()), float(q.max())) for name, q in zip(names, b.coordinates.T, strict=True)}
            for b in self.branches
        )

    def defects(self, positions: Iterable[Mechanism | Mapping[str, float] | Sequence[float]]) -> Defects:
        """Report branch, circuit and order defects of a sequence of positions.

        A position lies on a branch if mechgraph comes to it along the circuit.

        Parameters
        ----------
        positions : iterable
            Assemblies (Mechanism with ``start``), or coordinates of all freedoms, by name or in their order, one position after the other.

        Returns
        -------
        Defects

        Raises
        ------
        DeclarationError
            No branch of the map leads to a position.

        Examples
        --------
        >>> import mechgraph as mg
        >>> m = mg.load("four-bar")
        >>> b = mg.branches(m, "A", samples=6, points=60)
        >>> places = [mg.assemblies(m, {"A": 0.5})[0], mg.assemblies(m, {"A": 1.0})[1]]
        >>> b.defects(places).branches
        (0, 1)
        """
        places, faults, names = [], [], self.mechanism.freedom_names()
        for number, position in enumerate(positions):
            start = position.start if isinstance(position, Mechanism) else position
            if (listed := real_array(start)) is not None and listed.shape == (len(names),):
                start = dict(zip(names, listed.tolist(), strict=True))
            if not isinstance(start, Mapping) or not all(is_numeric(value, ()) for value in start.values()):
                wanted = "an assembly, or coordinates of freedoms"
                raise DeclarationError(f"defects of {self.mechanism.name!r}", [wrong(position, "position", wanted)])
            place = self._place({self.mechanism.full_name(k): float(v) for k, v in start.items()})
            places.append(place or (-1, 0.0))
            if place is None:
                faults.append(
                    f"position {number}: expected one to which a branch of the map leads; it is open, a double point, or missed"
                )
        if faults:
            raise DeclarationError(f"defects of {self.mechanism.name!r}", faults)
        numbers = tuple(number for number, _ in places)
        circuits = tuple(self.branches[number].circuit for number in numbers)
        return Defects(numbers, circuits, len(set(numbers)) > 1, len(set(circuits)) > 1, self._disordered(places))

    def _place(self, start: Mapping[str, float]) -> tuple[int, float] | None:
        """The branch on which a position lies, and the driver value there; None where it lies on none, or on several."""
        found, every = dict[int, float](), [b.stretch for b in self.branches]
        for of in {id(one.of): one.of for one in every}.values():
            given = of.s.state_of(of.s.start_coordinates(start)[:, None])
            x, error = close(of.s, given[:, 0], np.append(of.held, of.column))
            if error > CLOSED or np.abs(of.s.difference(x[:, None], given)).max() > MODES.touches:
                return None
            step, _, value, _ = of.placed(np.arange(of.V), np.repeat(x[:, None], of.V, axis=1))
            at = dict(zip(of.run[step].tolist(), value.tolist(), strict=True))
            found |= {i: at[one.run] for i, one in enumerate(every) if one.of is of and one.run in at}
        return next(iter(found.items())) if len(found) == 1 else None

    def _disordered(self, places: list[tuple[int, float]]) -> bool:
        """Whether the driver would have to turn back between positions of one branch."""
        if len({number for number, _ in places}) != 1:
            return False
        branch = self.branches[places[0][0]]
        return (
            in_order(np.array([value for _, value in places]), branch.stretch.of.period * (branch.turns or np.inf))
            is None
        )

    def plot(self, output: str | None = None, *, ax: Any = None, current: int | None = None) -> Any:
        """Draw a freedom over the driver on all branches, with the folds.

        Parameters
        ----------
        output : str, optional
            The freedom. Default: the first that moves.
        ax : Axes, optional
            Axes of matplotlib. Default: new ones.
        current : int, optional
            Number of a branch to highlight.

        Returns
        -------
        Axes

        Raises
        ------
        MissingExtraError
            Without matplotlib.
        """
        return methods.call("draw_branches", self, output, ax=ax, current=current)

    @property
    def _rims(self) -> list[float]:
        """Ends of branches at which nothing is singular: those of the range."""
        singular = np.array([*(f.value for f in self.folds), *(b.value for b in self.bifurcations)])
        ends = sorted({v for b in self.branches if b.full_turn is False for v in b.interval})
        # part of a step of the samples within which an end is that of a fold
        near = 1e-6 * self.resolution
        off = [np.abs(v - singular) for v in ends]
        turn = 2 * np.pi if self.mechanism.turns(self.driver) else np.inf
        return [v for v, d in zip(ends, off, strict=True) if not (np.minimum(d, np.abs(d - turn)) < near).any()]

    def document(self) -> Document:
        """Branches and folds as tables, turns in degrees."""
        m, driver = self.mechanism, self.driver
        unit = " [deg]" if m.turns(driver) else ""
        rows = tuple(
            (
                str(i),
                str(b.circuit),
                "all round" if b.full_turn else " .. ".join(f"{in_degrees(m, driver, v):.6g}" for v in b.interval),
                _turns(b),
            )
            for i, b in enumerate(self.branches)
        )
        folds = tuple(
            (
                f"{in_degrees(m, driver, f.value):.9g}",
                "upper" if f.sense > 0 else "lower",
                f"{f.branches[0]}, {f.branches[1]}",
                f.fastest,
            )
            for f in self.folds
        )
        step = f"{in_degrees(m, driver, self.resolution):.3g}{unit_of(m, driver)}"
        words = [
            f"Completeness: {self.completeness}; samples every {step}.",
            *self.evidence,
            *(["At each fold two branches meet in a double root."] if folds else []),
        ]
        if self.open_ends:
            words.append(
                f"{counted(self.open_ends, 'end')} of branches unresolved: the map is incomplete. Increase samples."
            )
        elif rims := self._rims:
            at = " and ".join(f"{in_degrees(m, driver, v):.6g}{unit_of(m, driver)}" for v in rims)
            words.append(f"At {at} the range of {driver} ends, not the branch: over= sets it.")
        words += [
            f"Branches {', '.join(map(str, b.branches))} cross at {values_text(m, {driver: b.value})}, a double point."
            for b in self.bifurcations
        ]
        title = f"{m.name}: {counted(len(self), 'branch')} over {driver}".replace("branchs", "branches")
        return Document(
            title,
            (
                Table(("branch", "circuit", f"interval of {driver}{unit}", "full turn"), rows),
                *((Table((f"fold{unit}", "limit", "branches", "moves most"), folds),) if folds else ()),
                Paragraph(" ".join(words)),
            ),
        )

    @property
    def data(self) -> BranchesData:
        """Everything but the curves as a record."""
        return BranchesData(
            self.mechanism.name,
            self.driver,
            self.completeness,
            self.evidence,
            self.resolution,
            self.open_ends,
            tuple(
                BranchData(b.interval, b.full_turn, b.turns, b.circuit, ranges)
                for b, ranges in zip(self.branches, self.ranges, strict=True)
            ),
            self.folds,
            self.bifurcations,
            self.circuits,
        )

    def to_dict(self) -> dict[str, Any]:
        """The same as plain data."""
        return plain(self.data)


def _turns(b: Branch) -> str:
    if not b.full_turn:
        return "no" if b.full_turn is False else "not told"
    return "yes" if b.turns == 1 else f"yes, back after {b.turns} turns"


@door
def branches(
    m: Mechanism,
    driver: str,
    *,
    over: tuple[float, float] | None = None,
    samples: Annotated[int, at_least(3)] = 24,
    points: Annotated[int, at_least(3)] = 720,
    seed: Seed = 0,
    cache: bool = True,
    progress: Callable[[str], None] | None = None,
) -> Branches:
    """Map every assembly mode over the range of a driver: branches, folds, bifurcations, circuits, full turns.

    ``assemblies`` finds all modes at ``samples`` values of the driver; the curves of positions through these are tracked by their length,
    through folds, at which ``solve`` stops.

    Parameters
    ----------
    m : Mechanism
        The mechanism.
    driver : str
        A freedom; other declared drives stay at their start.
    over : (2,) tuple of float, optional
        Range of the driver [rad, length]. Default: a full turn; for a translation twice the characteristic length to both sides.
    samples, points : int
        Numbers of driver values at which assembly modes are found, and in all.
    seed, cache, progress
        As in ``assemblies``.

    Returns
    -------
    Branches

    Raises
    ------
    DeclarationError, AssemblyError, IndeterminateError
        As in ``assemblies``.

    Examples
    --------
    >>> import mechgraph as mg
    >>> b = mg.branches(mg.load("four-bar"), "A", samples=6, points=60)
    >>> len(b.branches), b.full_turn, b.folds
    (2, (True, True), ())
    """
    why = m.freedom_fault(driver, single=True)
    faults = [f"driver {driver!r}: {why}"] if why else []
    if over is not None and not over[0] < over[1]:
        faults.append(wrong(over, "over", "the smallest and the largest value"))
    if faults:
        raise DeclarationError(f"branches of {m.name!r}", faults)
    return _Mapper(m, m.full_name(driver), over, samples, points).mapped(seed, cache, progress)


class _Mapper:
    """Samples of the driver, and what comes of them."""

    def __init__(self, m: Mechanism, driver: str, over: tuple[float, float] | None, samples: int, points: int) -> None:
        probe = Question(m, _at(m, driver, [0.0]))
        if not probe.freedoms.mobility:
            raise structure_error(m, [driver])
        if probe.freedoms.dependent and not probe.freedoms.undriven:
            others = ", ".join(name for name in probe.names if name != driver)
            raise IndeterminateError(
                f"mechanism {m.name!r}: {driver} cannot move while {others} rest; remove one of these drives", check(m)
            )
        self.place, L = probe.names.index(driver), probe.system.par.L
        self.unit = float(probe.unit[self.place])
        self.begin = float(probe.declared.x[probe.family.rows[self.place], 0] * self.unit)
        self.closed = over is None and m.turns(driver)
        # with couplings a turn of the driver leads elsewhere
        self.around = self.closed and not m.couplings
        around = (self.begin - MODES.slide_stroke * L, self.begin + MODES.slide_stroke * L)
        self.low, self.high = (self.begin, self.begin + 2 * np.pi) if self.closed else over or around
        self.rims = None if self.closed else (self.low / self.unit, self.high / self.unit)
        self.count, self.between = samples, max(1, round(points / samples))
        self.m, self.driver = m, driver

    def mapped(self, seed: int, cache: bool, progress: Callable[[str], None] | None) -> Branches:
        """The map."""
        step = (self.high - self.low) / self.count
        self.samples = self.low + (np.arange(self.count) + GOLDEN) * step
        self.q = q = Question(self.m, _at(self.m, self.driver, self.samples.tolist()))
        self.column = int(q.columns[self.place])
        finder = Finder(q, seed, cache, progress, MOST_FOLLOWED // self.count)
        solutions = finder.solutions()
        # legs that are put back in one way alone tell no assemblies apart
        legs = finder.form.turning if finder.ways < finder.form.ways else []
        self.family = q.family.without(np.array([link for leg in legs for link in leg.links], dtype=np.intp))
        # the position beside the start counts as that of a further sample, which may be the only one on its circuit
        self.row, self.others = int(q.system.single_rows[self.column]), np.delete(q.columns, self.place)
        self.known = [
            *zip(q.drive[self.place].tolist(), (self._in_order(found.x) for found in solutions), strict=True),
            (float(q.start.x[self.row, 0]), q.start.x),
        ]
        if progress is not None:
            progress(f"following {sum(x.shape[1] for _, x in self.known)} assemblies")
        (every, pairs, open_ends), word, evidence = self._whole(finder, solutions, seed, cache)
        every.sort(key=lambda one: one.key)
        place = {one: i for i, one in enumerate(every)}
        meets = self._meetings(every)
        both = [(place[a], place[b]) for a, b in pairs] + [(one, n) for _, (one, *more), _ in meets for n in more]
        circuits = sorted(sorted(c) for c in members(components_of_edges(len(every), both)))
        number = {branch: i for i, c in enumerate(circuits) for branch in c}
        folds = [self._fold(a, sorted((place[a], place[b]))) for a, b in pairs]
        return Branches(
            self.m,
            self.driver,
            tuple(self._branch(one, number[i]) for i, one in enumerate(every)),
            tuple(sorted(folds, key=lambda f: (f.value, f.branches))),
            tuple(Bifurcation(self._within(value), tuple(sorted(set(numbers)))) for value, numbers, _ in meets),
            tuple(tuple(c) for c in circuits),
            word,
            evidence,
            step,
            open_ends + sum(2 - one.told for one in every),
        )

    def _in_order(self, x: Array) -> Array:
        """Assemblies at a sample in an order of their own, whichever were found first."""
        return x[:, in_order_of(self.family.prints(Configuration(self.q.system, x)).T)]

    def _within(self, value: float) -> float:
        """A driver value, internal units, as one of the range."""
        value *= self.unit
        return float(self.low + np.mod(value - self.low, 2 * np.pi)) if self.closed else value

    def _whole(
        self, finder: Finder, solutions: list[Solutions], seed: int, cache: bool
    ) -> tuple[Stretches, str, tuple[str, ...]]:
        """All branches, the word for their completeness, and what it rests on."""
        every = self._stretches()
        words, bent = [found.word for found in solutions], sum(found.bent for found in solutions)
        if not finder.starts:
            return every, weakest(words), ("Circuits that lie wholly between samples were not looked for.",)
        tracks = Unreal(finder.form, self.q.drive[self.place])

        def round_to(first: list[Station]) -> list[Station]:
            """The first station a turn further on, where all comes back."""
            return [tracks.station(one.value + 2 * np.pi, one.x) for one in first if self.around]

        at = [tracks.station(value, found.unreal) for (value, _), found in zip(self.known, solutions, strict=False)]
        if not self.around:
            at = [tracks.station(self.low / self.unit), *at, tracks.station(self.high / self.unit)]
        at += [one for a, b in pairwise([*at, *round_to(at[:1])]) for one in tracks.turning(a, b)]
        at.sort(key=lambda one: one.value)
        gaps: dict[tuple[float, float], Gap] = {}
        tried: set[float] = set()
        while True:
            ends = list(pairwise([*at, *round_to(at[:1])]))
            new = [two for two in ends if (two[0].value, two[1].value) not in gaps]
            gaps |= zip([(a.value, b.value) for a, b in new], tracks.gaps(new), strict=True)
            told = [self._untold(a, b, gaps[a.value, b.value], every[1], finder.ways) for a, b in ends]
            begins = [one for of, _, _ in told for one in of if one.value not in tried]
            asked = [value for _, of, _ in told for value in of if value not in tried]
            lost = [value for _, _, of in told for value in of]
            # values that are looked at between samples, at most
            if not (begins or asked) or len(tried) > max(self.count, 24):
                break
            tried |= {*asked, *(one.value for one in begins)}
            form = tracks.at(np.array([one.value for one in begins]))
            for i, one in enumerate(begins):
                # beside the fold, along what moves there
                beside = form.lifted((one.x.real + one.x.imag)[:, None], i, finder.ways).real
                y, error = close_all(self.q.system, beside, self.others)
                self.known += [(float(y[self.row, k]), y[:, [k]]) for k in np.flatnonzero(error < CLOSED)]
            if asked:
                q = Question(self.m, _at(self.m, self.driver, (self.unit * np.array(asked)).tolist()))
                solutions = Finder(q, seed, cache, None, MOST_FOLLOWED // self.count).solutions()
                words, bent = words + [found.word for found in solutions], bent + sum(found.bent for found in solutions)
                self.known += [(value, found.x) for value, found in zip(asked, solutions, strict=True)]
                at += [tracks.station(value, found.unreal) for value, found in zip(asked, solutions, strict=True)]
                at.sort(key=lambda one: one.value)
            every = self._stretches()
        said, word = self._told(lost, bent)
        return every, weakest([*words, word]), (*said, *finder.told)

    def _told(self, lost: list[float], bent: int) -> tuple[list[str], str]:
        """What is said of circuits between samples, next to which something is ``lost`` or rods are ``bent``; the strongest word for it."""
        out = list[str]()
        if lost:
            at_one = values_text(self.m, {self.driver: self.unit * min(lost)})
            out.append(
                f"Between samples, {counted(len(lost), 'track')} of assemblies that are not real cannot be told, one next to {at_one}."
            )
        if bent:
            out.append(
                f"In {counted(bent, 'mode')} at samples rods close with complex turns alone; between samples they may be real."
            )
        if out:
            return [*out, "Circuits that lie wholly between samples may be missing."], "tested"
        return ["Between samples, assemblies that are not real become real at the folds told alone."], "proved"

    def _untold(
        self, a: Station, b: Station, gap: Gap, pairs: Sequence[tuple[BranchRun, BranchRun]], ways: int
    ) -> tuple[list[Double], list[float], list[float]]:
        """Between stations: double points that are no folds that are known, values between folds that face each other, to which none came,
        and values next to which something is left that is not accounted for. A double point is a fold in all ``ways`` of rods, of which
        the start gives one alone.
        """
        begins, left = list[Double](), list[tuple[float, int]]()
        folds = [one.fold for one, _ in pairs]
        if self.around:
            folds = [(a.value + float(np.mod(value - a.value, 2 * np.pi)), sense) for value, sense in folds]
        for sense, doubles in ((-1, gap.rising), (1, gap.falling)):
            mine = [value for value, of in folds if of == sense and a.value <= value <= b.value]
            for one in doubles:
                if not one.real:
                    left.append((one.value, -sense))
                    continue
                mine.sort(key=lambda value: abs(value - one.value))
                known = sum(abs(value - one.value) < gap.near for value in mine[:ways])
                mine, begins = mine[known:], begins + [one] * (known < ways)
            left += [(value, sense) for value in mine]
        rims = [(one.value, sense) for one, sense in ((a, 1), (b, -1)) if one.x is None]
        facing = pairwise(sorted([*left, *rims]))
        asked = [0.5 * (one + other) for (one, up), (other, down) in facing if up > 0 > down]
        return begins, asked, [*gap.lost, *(one.value for one in begins), *(value for value, _ in left)]

    def _stretches(self) -> Stretches:
        """The branches on which known assemblies lie, pairs that meet in folds, open ends of those on none."""
        s, family = self.q.system, self.family
        values, states, S = np.array([value for value, _ in self.known]), [x for _, x in self.known], len(self.known)
        prints = [family.prints(Configuration(s, x)) for x in states]
        left, rank = [np.ones(x.shape[1], dtype=bool) for x in states], s.n_freedoms - 1 - family.idle.shape[1]
        out, pairs, still, passed = list[BranchRun](), list[tuple[BranchRun, BranchRun]](), list[Array](), list[Array]()
        while any(some.any() for some in left):
            i = int(np.argmax([some.sum() for some in left]))
            start = np.flatnonzero(left[i])
            of = Circuits(family, s, self.column, rank, states[i][:, start], self.others, self.rims)
            step, k, value = of.steps_at(np.repeat(np.arange(of.V), S), np.tile(values, of.V))
            x, met = of.states(step, value)
            there = family.prints(Configuration(s, x))
            for case in range(of.V):
                if of.twin[case] or not left[i][start[case]]:
                    continue
                left[i][start[case]] = False
                still += [prints[i][:, [start[case]]]] * bool(of.dead[case])
                places: dict[int, list[tuple[int, int, float]]] = {}
                for j in np.flatnonzero(met & (k // S == case)).tolist():
                    sample = int(k[j]) % S
                    gaps = np.abs(prints[sample] - there[:, [j]]).max(axis=0, initial=0.0)
                    if gaps.min(initial=np.inf) < MODES.arrives * max(1.0, float(np.abs(there[:, j]).max())):
                        mode = int(np.argmin(gaps))
                        left[sample][mode] = False
                        at = [(sample, mode, float(value[j]))] * (sample < self.count)
                        places.setdefault(int(of.run[step[j]]), []).extend(at)
                more = self._of(of, case, places)
                out += more
                ring = of.closes[case] and not of.turns[case]
                pairs += zip(more, more[1:] + more[: int(ring)], strict=False)
            passed += [family.prints(Configuration(s, x)) for x in (of.a.x, of.b.x)]
        # folds and double points, at which nothing is followed, lie on circuits through other samples
        near = [np.abs(np.hstack(passed) - at).max(axis=0).min(initial=np.inf) < MODES.touches for at in still]
        folds = [one for pair in pairs for one in pair]
        for one in out:
            one.told = 2 if one.turns else folds.count(one) + sum(self._at_rim(end) is not None for end in one.ends)
        return out, pairs, 2 * near.count(False)

    @staticmethod
    def _of(of: Circuits, case: int, places: dict[int, list[tuple[int, int, float]]]) -> list[BranchRun]:
        """The branches of a circuit; of each the ``places`` of assemblies: number of the sample and its own there, driver value."""
        out, turns = [], int(of.turns[case])
        for run in np.unique(of.run[of.a.case == case]).tolist():
            at = places.get(run) or [(len(of.run), 0, 0.0)]
            sample, mode, begin = min(at) if turns else min(at, key=lambda one: one[2])
            out.append(BranchRun(of, run, turns, (turns > 0, sample, mode), begin))
        return out

    def _fold(self, a: BranchRun, branches: list[int]) -> Fold:
        """The fold at the end of a branch."""
        value, sense = a.fold
        value *= self.unit
        if self.closed:
            value -= 2 * np.pi * np.round((value - self.begin) / (2 * np.pi))
        fastest = self.m.freedom_names()[int(np.argmax(np.abs(a.of.b.t[:, a.last])))]
        return Fold(value, sense, (branches[0], branches[1]), fastest)

    def _meetings(self, every: list[BranchRun]) -> list[tuple[float, list[int], Array]]:
        """Where circuits meet: driver values, numbers of branches, and what tells assemblies apart."""
        out: list[tuple[float, list[int], Array]] = []
        for i, one in enumerate(every):
            mine = one.of.run == one.run
            nodes = CircuitNodes.joined(part.taken(mine & part.meets) for part in (one.of.a, one.of.b))
            prints = self.family.prints(Configuration(self.q.system, nodes.x))
            for value, at in zip(nodes.x[one.of.row].tolist(), prints.T, strict=True):
                for known, numbers, there in out:
                    gap = value - known - (2 * np.pi * np.round((value - known) / (2 * np.pi)) if self.closed else 0.0)
                    if max(abs(gap), np.abs(at - there).max() / max(1.0, float(np.abs(at).max()))) < MODES.touches:
                        numbers.append(i)
                        break
                else:
                    out.append((value, [i], at))
        return out

    def _at_rim(self, value: float) -> float | None:
        """The end of the range at which a driver value lies."""
        return next((rim for rim in self.rims or () if abs(value - rim) <= 2 * BEYOND_END), None)

    def _grid(self, one: BranchRun) -> Array:
        """Driver values on a branch, internal units: its ends, all samples and values between."""
        s, n = self.q.drive[self.place], self.between
        step = (s[1] - s[0]) / n
        if one.turns:
            return np.asarray(one.begin + step * np.arange(one.turns * self.count * n + 1))
        low, high = np.sort(one.ends)
        if self.rims is None:
            grid = s[0] + step * np.arange(np.ceil((low - s[0]) / step), np.floor((high - s[0]) / step) + 1)
        else:
            low, high = (end if (rim := self._at_rim(end)) is None else rim for end in (low, high))
            begin, end = np.linspace(self.rims[0], s[0], n + 1), np.linspace(s[-1], self.rims[1], n + 1)
            grid = np.concatenate([begin[:-1], s[0] + step * np.arange((len(s) - 1) * n), end])
        # rounding of driver values
        return np.concatenate([[low], grid[(grid > low + 1e-9) & (grid < high - 1e-9)], [high]])

    def _branch(self, one: BranchRun, circuit: int) -> Branch:
        """The states of a branch, one after the other, with the driver rising."""
        of, s, value = one.of, self.q.system, self._grid(one)
        step, there = of.along(one.run, value)
        x, met = of.states(step, there)
        if not one.turns:
            # folds, at which equations are singular
            ends = [of.a.x[:, step.min()], of.b.x[:, step.max()]]
            x[:, 0], x[:, -1] = ends[:: int(of.rises[step[0]])]
            met[[0, -1]] = True
        x, along = x[:, met], self.unit * value[met]
        # whole turns of the driver such that it begins at the first sample, or the middle of the interval is nearest to the start
        middle, near = (along[0], self.samples[0]) if one.turns else (0.5 * (along[0] + along[-1]), self.begin)
        along -= 2 * np.pi * np.round((middle - near) / (2 * np.pi)) if self.closed else 0.0
        start = s.start_coordinates(self.m.start)
        q = s.coordinates_of(x, start).T
        period = self.q.periods
        back = np.isfinite(period)
        back[self.column] = False
        q[:, back] = np.unwrap(q[:, back] * (2 * np.pi / period[back]), axis=0) * (period[back] / (2 * np.pi))
        # whole rounds such that the place nearest to the declared value of the driver is nearest to the start
        beside = (q[np.argmin(np.abs(along - self.begin))] - start)[back]
        q[:, back] -= period[back] * np.round(beside / period[back])
        q[:, self.column] = along
        full_turn = None if one.told < 2 else one.turns > 0
        return Branch(along, q, (float(along[0]), float(along[-1])), full_turn, one.turns, circuit, one)


def _at(m: Mechanism, driver: str, values: list[float]) -> dict[str, Any]:
    """Values of all drives: the driver's own, the others at their start."""
    names = [m.full_name(d.freedom) for d in m.drives]
    others = {name: m.start.get(name, 0.0) for name in names if name != driver} if driver in names else {}
    return {driver: values, **others}
