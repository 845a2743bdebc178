"""Branches of a mechanism over the range of one driver.

Every assembly followed over the range of one driver, all in one batch: pieces between samples, joined into branches and circuits.

At evenly spread samples of the driver all assemblies are known; from each, the engine's path follower goes to both neighbors, or out to
the rim of the range. A piece that arrives meets an assembly there; a piece that ends at a fold meets the other one that ends there; pieces
that pass the same crossing meet in it. Pieces that arrive, one after the other, are a branch; branches that meet are a circuit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from typing import Annotated, Any

import numpy as np

from mechgraph import methods
from mechgraph.document import Document, Paragraph, Shown, Table
from mechgraph.errors import DeclarationError, counted
from mechgraph.files import plain
from mechgraph.graph.linkgraph import components_of_edges, members
from mechgraph.kinematics.assembly import led
from mechgraph.kinematics.motion_path import DriverPath, Positions, Request, Status
from mechgraph.kinematics.reach import follow
from mechgraph.kinematics.solver import closure_solver, engine_for
from mechgraph.kinematics.state import CLOSED, Configuration, close
from mechgraph.maths.se3 import Index
from mechgraph.maths.singular_point import passed
from mechgraph.maths.tolerances import MODES
from mechgraph.maths.tracker import End
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.modes.assemblies import (
    Bifurcation,
    BranchData,
    BranchesData,
    Finder,
    Fold,
    Question,
    in_degrees,
    unit_of,
    values_text,
    weakest,
)
from mechgraph.modes.family import Array, Family
from mechgraph.quantities import Index as Seed
from mechgraph.quantities import at_least, door, is_numeric, wrong

Node = tuple[int, int]
"""An assembly: the number of its sample, and its own there."""


@dataclass
class BranchPiece:
    """The way of assembly ``mode`` of sample ``sample`` in one ``sense``: states ``x (nx, n)`` at driver values, and its end.

    ``arrives`` is the assembly of the next sample, or -1; ``end`` the driver value where the piece ends at a ``fold``; ``rim`` says that it
    leads out to the end of the range.
    """

    sample: int
    mode: int
    sense: int
    values: Array
    x: Array
    arrives: int = -1
    rim: bool = False
    fold: bool = False
    end: float = np.nan
    last: Array = field(default_factory=lambda: np.zeros(0))
    crossings: tuple[tuple[float, Array], ...] = ()


class Tracer:
    """Follows assemblies ``states[i] (nx, M_i)`` at ``samples (S,)`` of a driver to the neighbors, with ``points`` values between.

    ``rims`` are the ends of the range of the driver, None where it goes right round.
    """

    def __init__(
        self,
        question: Question,
        family: Family,
        samples: Array,
        states: list[Array],
        points: int,
        rims: tuple[float, float] | None,
        place: int,
    ) -> None:
        self.question, self.family, self.samples, self.states, self.place = question, family, samples, states, place
        self.points, self.rims = points, rims
        self.system = question.system
        self.prints = [self._prints(x) for x in states]

    def _prints(self, x: Array) -> Array:
        return self.family.prints(Configuration(self.system, x))

    def pieces(self) -> list[BranchPiece]:
        """All pieces."""
        step, total, requests, out = self.samples[1] - self.samples[0], 0, [], []
        part = np.linspace(0.0, 1.0, self.points + 1)[1:]
        for i, x in enumerate(self.states):
            for mode in range(x.shape[1]):
                for sense in (1, -1):
                    rim = self.rims is not None and not 0 <= i + sense < len(self.states)
                    way = self.rims[sense > 0] - self.samples[i] if rim and self.rims else sense * step
                    values = self.samples[i] + way * part
                    others = np.repeat(x[self.family.rows, mode][:, None], len(part), axis=1)
                    others[self.place] = values
                    requests.append(Request(x[:, mode], 0, others, np.arange(total, total + len(part))))
                    out.append(BranchPiece(i, mode, sense, values, np.zeros(0), rim=rim))
                    total += len(part)
        if not requests:
            return []
        q = self.question
        solver = closure_solver(engine_for(self.system.n_rows, total, "auto"), q.columns, q.freedoms.hold)
        found = follow(DriverPath(self.system, solver, self.system.cases), requests, total)
        reach = self._ends(found)
        for piece, request in zip(out, requests, strict=True):
            self._read(piece, request.places, found, reach)
        return out

    def _ends(self, found: Positions) -> dict[int, tuple[float, Array]]:
        """Driver value and state at the last node of every track."""
        nodes = found.tracks.nodes
        last = np.flatnonzero(np.append(nodes.track[1:] != nodes.track[:-1], True))
        return {int(nodes.track[k]): (float(nodes.drive[self.place, k]), nodes.x[:, k]) for k in last}

    def _read(self, piece: BranchPiece, places: Index, found: Positions, reach: dict[int, tuple[float, Array]]) -> None:
        good = found.moved[places]
        stop = int(np.argmin(good)) if not good.all() else len(good)
        piece.values, piece.x = piece.values[:stop], found.x[:, places[:stop]]
        track = int(found.track[places[0]])
        piece.crossings = tuple(
            (
                float(found.follower.paths.drive(np.array([t]), np.array([at]))[self.place, 0]),
                self._beside(found, t, at),
            )
            for t, at in found.tracks.crossings
            if t == track
        )
        if stop == len(good):
            if piece.rim:
                return
            j = (piece.sample + piece.sense) % len(self.states)
            here = self._prints(piece.x[:, -1:])
            gaps = np.abs(self.prints[j] - here).max(axis=0, initial=0.0)
            if gaps.size and gaps.min() < MODES.arrives * max(1.0, float(np.abs(here).max())):
                piece.arrives = int(np.argmin(gaps))
            return
        piece.end, state = reach[track]
        piece.last = self._prints(state[:, None])[:, 0]
        piece.values, piece.x = np.append(piece.values, piece.end), np.append(piece.x, state[:, None], axis=1)
        piece.fold = found.tracks.end[track] is End.FOLD or found.status[places[stop]] is Status.OUT_OF_REACH

    def _beside(self, found: Positions, track: int, place: float) -> Array:
        """What tells assemblies apart at a crossing on a track: interpolated on the branch that passes it, else at the nearest node."""
        crossing = passed(found.follower, found.tracks.nodes, track, place)
        if crossing is not None:
            return self._prints(crossing.states(np.array([place])))[:, 0]
        nodes = found.nodes_of(track)
        return self._prints(nodes.x[:, [int(np.argmin(np.abs(nodes.place - place)))]])[:, 0]


class Map:
    """Pieces joined: branches as chains of (sample, assembly) in the sense of the driver, folds as pairs of pieces, and what meets."""

    def __init__(self, pieces: list[BranchPiece], states: list[Array]) -> None:
        self.piece = {(p.sample, p.mode, p.sense): p for p in pieces}
        n = len(states)
        self.after: dict[Node, Node] = {}
        for p in pieces:
            if p.arrives >= 0:
                here, there = (p.sample, p.mode), ((p.sample + p.sense) % n, p.arrives)
                self.after.setdefault(*((here, there) if p.sense > 0 else (there, here)))
        before = {there: here for here, there in self.after.items()}
        nodes = [(i, mode) for i, x in enumerate(states) for mode in range(x.shape[1])]
        self.chains: list[list[Node]] = []
        taken: set[Node] = set()
        for first in [*(node for node in nodes if node not in before), *nodes]:
            chain: list[Node] = []
            node: Node | None = first
            while node is not None and node not in taken:
                taken.add(node)
                chain.append(node)
                node = self.after.get(node)
            if chain:
                self.chains.append(chain)
        self.of = {node: number for number, chain in enumerate(self.chains) for node in chain}
        self.folds = self._folds([p for p in pieces if p.fold])
        self.crossings = self._crossings([(p, *at) for p in pieces for at in p.crossings])
        self._told = {(p.sample, p.mode, p.sense) for pair in self.folds for p in pair}
        self._told |= {at for at, p in self.piece.items() if p.rim and not p.fold}
        self.open = sum(self.untold(number) for number in range(len(self.chains)))

    def cyclic(self, number: int) -> bool:
        """Whether a branch comes back to where it begins."""
        chain = self.chains[number]
        return self.after.get(chain[-1]) == chain[0]

    def untold(self, number: int) -> int:
        """How many ends of a branch are neither folds at which another one ends nor at the rim of the range."""
        if self.cyclic(number):
            return 0
        chain = self.chains[number]
        return sum((*node, sense) not in self._told for node, sense in ((chain[0], -1), (chain[-1], 1)))

    def branch(self, piece: BranchPiece) -> int:
        """The branch of a piece."""
        return self.of[piece.sample, piece.mode]

    @staticmethod
    def _folds(ended: list[BranchPiece]) -> list[tuple[BranchPiece, BranchPiece]]:
        out = []
        for i, a in enumerate(ended):
            for b in ended[i + 1 :]:
                apart = np.abs(a.last - b.last).max() / max(1.0, float(np.abs(a.last).max()))
                # difference of driver values up to which pieces end at the same fold
                if (a.sample, a.sense) == (b.sample, b.sense) and abs(a.end - b.end) < 1e-6 and apart < MODES.touches:
                    out.append((a, b))
        return out

    @staticmethod
    def _crossings(crossed: list[tuple[BranchPiece, float, Array]]) -> list[tuple[float, list[BranchPiece]]]:
        out: list[tuple[float, list[BranchPiece], Array]] = []
        for piece, value, at in crossed:
            for known, pieces, there in out:
                turns = (value - known) / (2 * np.pi)
                if abs(turns - round(turns)) < MODES.touches and np.abs(at - there).max() < MODES.touches * max(
                    1.0, float(np.abs(at).max())
                ):
                    pieces.append(piece)
                    break
            else:
                out.append((value, [piece], at))
        return [(value, pieces) for value, pieces, _ in out]

    def circuits(self) -> list[list[int]]:
        """Branches that folds and crossings join."""
        meets = [(self.branch(a), self.branch(b)) for a, b in self.folds]
        for _, pieces in self.crossings:
            meets += [(self.branch(pieces[0]), self.branch(other)) for other in pieces[1:]]
        return members(components_of_edges(len(self.chains), meets))


GOLDEN, SPREADS = 0.5 * (3.0 - 5.0**0.5), 3
"""Place of the first sample, as part of the distance of two; how many such places are tried where samples lie on double points."""


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
    prints: Array = field(repr=False)


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
        Of the assembly modes at the samples, see ``Assemblies``.
    resolution : float
        Distance of the samples; a branch that begins and ends between two of them is missed.
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

    def defects(self, positions: Iterable[Mechanism | Mapping[str, float]]) -> Defects:
        """Report branch, circuit and order defects of a sequence of positions.

        From each position, mechgraph tracks the path to the next point of the map.

        Parameters
        ----------
        positions : iterable
            Assemblies (Mechanism with ``start``), or coordinates of all freedoms, in their order.

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
        places, faults, q = [], [], Question(self.mechanism, _at(self.mechanism, self.driver, [0.0]))
        for number, position in enumerate(positions):
            start = position.start if isinstance(position, Mechanism) else position
            if not isinstance(start, Mapping) or not all(is_numeric(value, ()) for value in start.values()):
                wanted = "an assembly, or coordinates of freedoms"
                raise DeclarationError(f"defects of {self.mechanism.name!r}", [wrong(position, "position", wanted)])
            place = self._place(q, {self.mechanism.full_name(k): float(v) for k, v in start.items()})
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

    def _place(self, q: Question, start: Mapping[str, float]) -> tuple[int, float] | None:
        """The branch that leads to a position, and the driver value there; None where none does."""
        s, place, turns = q.system, q.names.index(self.driver), self.mechanism.turns(self.driver)
        given = s.state_of(s.start_coordinates(start)[:, None])[:, 0]
        x, error = close(s, given, q.columns)
        if error > CLOSED or np.abs(s.difference(x[:, None], given[:, None])).max() > MODES.touches:
            return None
        goal = x[s.single_rows[q.columns]]
        value = float(goal[place] * q.unit[place])
        for sense in (1.0, -1.0):
            ways = [sense * (b.values - value) for b in self.branches]
            ways = [np.mod(way, 2 * np.pi) if turns else np.where(way < 0, np.inf, way) for way in ways]
            for way, b in zip(ways, self.branches, strict=True):
                if not b.full_turn:
                    way[[0, -1]] = np.inf  # singular where they are folds
            ahead = min(float(way.min()) for way in ways)
            if not np.isfinite(ahead):
                continue
            goal[place] = (value + sense * ahead) / q.unit[place]
            there, came = led(s, x, q.columns, goal)
            prints = q.family.prints(Configuration(s, there[:, None]))
            for number, (b, way) in enumerate(zip(self.branches, ways, strict=True)):
                at = int(np.argmin(way))
                near = np.abs(b.prints[:, [at]] - prints).max() < MODES.arrives * max(1.0, float(np.abs(prints).max()))
                # difference of driver values (radians, or lengths) up to which points of several branches lie at the same one
                if came and near and way[at] - ahead < 1e-9:
                    return number, float(b.values[at] - sense * ahead)
        return None

    def _disordered(self, places: list[tuple[int, float]]) -> bool:
        """Whether the driver would have to turn back between positions of one branch."""
        if len({number for number, _ in places}) != 1:
            return False
        branch = self.branches[places[0][0]]
        return in_order(np.array([value for _, value in places]), _period(branch)) is None

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

    def document(self) -> Document:
        """Branches and folds as tables, turns in degrees."""
        m, driver = self.mechanism, self.driver
        unit = " [deg]" if m.turns(driver) else ""
        rows = tuple(
            (str(i), str(b.circuit), " .. ".join(f"{in_degrees(m, driver, v):.6g}" for v in b.interval), _turns(b))
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
            f"Completeness of the assemblies at the samples: {self.completeness}; samples every {step}. Branches "
            "between two samples are missed.",
            *(["At each fold two branches meet in a double root."] if folds else []),
        ]
        if self.open_ends:
            words.append(
                f"{counted(self.open_ends, 'end')} of branches unresolved: the map is incomplete. Increase samples."
            )
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


def _period(b: Branch) -> float:
    return 2 * np.pi * b.turns if b.full_turn else np.inf


def in_order(values: Array, period: float) -> Array | None:
    """Driver values ``(n,)`` of a branch, with whole periods such that they rise or fall; None where the driver has to turn back."""
    steps, ways = np.diff(values), []
    if not np.isfinite(period):
        return None if (steps > 0).any() and (steps < 0).any() else values
    for sense in (1.0, -1.0):
        ahead = np.mod(sense * steps, period)
        # a step back by rounding (radians) is none
        ways.append(sense * np.cumsum([0.0, *np.where(period - ahead < 1e-12, 0.0, ahead)]))
    way = min(ways, key=lambda way: abs(way[-1]))
    return values[0] + way if abs(way[-1]) < period else None


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

    ``assemblies`` finds all modes at ``samples`` values of the driver; from each, the path tracker of ``solve`` goes to both
    neighbors, so a fold is where ``solve`` stops.

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
        place, L = probe.names.index(driver), probe.system.par.L
        self.begin = float(probe.declared.x[probe.family.rows[place], 0] * probe.unit[place])
        self.closed = over is None and m.turns(driver)
        around = (self.begin - MODES.slide_stroke * L, self.begin + MODES.slide_stroke * L)
        self.low, self.high = (self.begin, self.begin + 2 * np.pi) if self.closed else over or around
        self.count = samples
        self.between = max(1, round(points / samples))
        self.m, self.driver = m, driver

    def mapped(self, seed: int, cache: bool, progress: Callable[[str], None] | None) -> Branches:
        """The map."""
        step = (self.high - self.low) / self.count
        # no sample may lie on a double point: which branch leads there is open
        for again in range(1, SPREADS + 1):
            self.samples = self.low + (np.arange(self.count) + again * GOLDEN % 1.0) * step
            q = Question(self.m, _at(self.m, self.driver, self.samples.tolist()))
            finder = Finder(q, seed, cache, progress)
            solutions = finder.solutions()
            if not any(finder.singular(found, i) for i, found in enumerate(solutions)):
                break
        states = [found.x for found in solutions]
        if progress is not None:
            progress(f"following {sum(x.shape[1] for x in states)} assemblies")
        place = q.names.index(self.driver)
        self.q, self.unit = q, float(q.unit[place])
        rims = None if self.closed else (self.low / self.unit, self.high / self.unit)
        tracer = Tracer(q, q.family, q.drive[place], states, self.between, rims, place)
        self.found, self.states, self.family = Map(tracer.pieces(), states), states, q.family
        circuits = sorted(sorted(c) for c in self.found.circuits())
        number = {branch: i for i, c in enumerate(circuits) for branch in c}
        return Branches(
            self.m,
            self.driver,
            tuple(self._branch(i, number[i]) for i in range(len(self.found.chains))),
            tuple(sorted((self._fold(a, b) for a, b in self.found.folds), key=lambda f: (f.value, f.branches))),
            tuple(self._bifurcation(value, pieces) for value, pieces in self.found.crossings),
            tuple(tuple(c) for c in circuits),
            weakest(found.word for found in solutions),
            step,
            self.found.open,
        )

    def _branch(self, i: int, circuit: int) -> Branch:
        """The states of a branch, one after the other, with the driver rising."""
        found, chain = self.found, self.found.chains[i]
        step, cyclic = self.samples[1] - self.samples[0], self.found.cyclic(i)
        first = found.piece.get((*chain[0], -1))
        values, states = [], []
        if first is not None and first.arrives < 0:
            values.append(self.unit * first.values[::-1])
            states.append(first.x[:, ::-1])
        for k, node in enumerate(chain):
            begin = self.samples[chain[0][0]] + k * step
            values.append(np.array([begin]))
            states.append(self.states[node[0]][:, [node[1]]])
            piece = found.piece.get((*node, 1))
            if piece is not None:
                ahead = self.unit * piece.values - self.samples[node[0]] + begin
                # where it arrives the next assembly stands already
                stop = len(ahead) - (piece.arrives >= 0 and (k + 1 < len(chain)))
                values.append(ahead[:stop])
                states.append(piece.x[:, :stop])
        x, along = np.concatenate(states, axis=1), np.concatenate(values)
        s = self.q.system
        q = s.coordinates_of(x, s.start_coordinates(self.m.start)).T
        period = self.q.periods
        back = np.isfinite(period)
        q[:, back] = np.unwrap(q[:, back] * (2 * np.pi / period[back]), axis=0) * (period[back] / (2 * np.pi))
        # whole rounds such that the place nearest to the declared value of the driver is nearest to the start
        back[self.q.columns[self.q.names.index(self.driver)]] = False
        near = (q[np.argmin(np.abs(along - self.begin))] - s.start_coordinates(self.m.start))[back]
        q[:, back] -= period[back] * np.round(near / period[back])
        prints = self.family.prints(Configuration(s, x))
        turns = round(len(chain) / len(self.samples)) if cyclic else 0
        if self.closed and not cyclic:
            # whole turns of the driver such that the middle of the interval is nearest to the start
            shift = 2 * np.pi * np.round((0.5 * (along[0] + along[-1]) - self.begin) / (2 * np.pi))
            along = along - shift
            q[:, self.q.columns[self.q.names.index(self.driver)]] -= shift
        full_turn = None if found.untold(i) else cyclic
        return Branch(along, q, (float(along[0]), float(along[-1])), full_turn, turns, circuit, prints)

    def _fold(self, a: Any, b: Any) -> Fold:
        s = self.q.system
        gone = (
            np.abs(s.difference(a.x[:, -1:], b.x[:, -1:]))[:, 0]
            if a.x.shape[1] and b.x.shape[1]
            else np.zeros(s.n_freedoms)
        )
        value = 0.5 * (a.end + b.end) * self.unit
        if self.closed:
            value -= 2 * np.pi * np.round((value - self.begin) / (2 * np.pi))
        fastest = self.m.freedom_names()[int(np.argmax(gone))]
        one, other = sorted((self.found.branch(a), self.found.branch(b)))
        return Fold(value, a.sense, (one, other), fastest)

    def _bifurcation(self, value: float, pieces: list[Any]) -> Bifurcation:
        return Bifurcation(value * self.unit, tuple(sorted({self.found.branch(p) for p in pieces})))


def _at(m: Mechanism, driver: str, values: list[float]) -> dict[str, Any]:
    """Values of all drives: the driver's own, the others at their start."""
    names = [m.full_name(d.freedom) for d in m.drives]
    others = {name: m.start.get(name, 0.0) for name in names if name != driver} if driver in names else {}
    return {driver: values, **others}
