"""Whether a mechanism can run through the positions that it meets: defects, transmission, sizes.

A position of a mechanism with one driver lies on a curve of positions, its circuit. Where the driver has to turn back the curve folds;
between folds it is a branch, on which the driver moves the mechanism. From the first position the path follower of ``solve`` goes to the
fold at either end. At a fold two branches meet: there ``x(s) = x_0 + a s + O(s^2)`` with the driver at ``s^2``, so that at the same value
of the driver the other branch is at ``2 x_0 - x``, but for terms of higher order, and from there it is followed to its own other end,
until the first position comes back. Every other position is on one of these branches, or on another circuit.

Sources: Chase and Mirth, Circuits and branches of single-degree-of-freedom planar linkages, J. Mech. Des. 115, 1993; Filemon, Useful ranges
of centerpoint curves, Mech. Mach. Theory 7, 1972.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from itertools import combinations
from typing import Annotated, Any, Literal

import numpy as np

from mechgraph.errors import DeadPointError, DeclarationError, IndeterminateError, MechgraphWarning
from mechgraph.kinematics.motion_path import DriverPath, Positions, Request
from mechgraph.kinematics.reach import follow
from mechgraph.kinematics.solver import closure_solver, engine_for
from mechgraph.kinematics.state import CLOSED, Configuration, close
from mechgraph.kinetostatics import kinematics, solve, transmission
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import MODES
from mechgraph.maths.tracker import End
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.setups import is_interval, two_ends
from mechgraph.modes.assemblies import Question
from mechgraph.modes.branches import in_order
from mechgraph.quantities import wrong
from mechgraph.variants.work import Output, named_outputs, quantity

Defect = Literal["branch", "circuit", "order", "full_turn"]
"""What may be required of a mechanism that runs through positions."""


@dataclass(frozen=True)
class Fitness:
    """What a mechanism is worth that meets positions one after the other.

    Without a driver that alone determines all positions nothing is known of defects, full turn (None) and transmission (NaN).

    Attributes
    ----------
    branch, circuit, order : bool or None
        Defects: positions on another branch than the first one, on another circuit, not in the order in which the driver passes them.
        Where the first one is a dead point the driver leads to no other: a defect of branch, of the others nothing is known.
    full_turn : bool or None
        Whether the driver turns right round on the branch of the first position.
    transmission, transmission_between : float
        Least transmission angle at the positions, and from the first to the last [rad]; NaN where the driver holds no output, at change
        points, or where it does not come to the last.
    size, ratio : float
        Largest distance of two elements of a link; longest over shortest of such distances.
    error : float
        Largest distance from what was asked, in the units of the task.
    """

    branch: bool | None
    circuit: bool | None
    order: bool | None
    full_turn: bool | None
    transmission: Annotated[float, "radians"]
    transmission_between: Annotated[float, "radians"]
    size: float
    ratio: float
    error: float = 0.0

    @property
    def good(self) -> bool:
        """Whether no defect is known; so too without a driver."""
        return not (self.branch or self.circuit or self.order)

    @property
    def words(self) -> str:
        """Defects and transmission, as under a picture."""
        defects = [name for name in ("branch", "circuit", "order") if getattr(self, name)]
        told = f"{' and '.join(defects)} defect" if defects else "good"
        return told + (f", {np.rad2deg(self.transmission):.3g} deg" if np.isfinite(self.transmission) else "")

    def lacks(self, wanted: Iterable[Defect]) -> tuple[Defect, ...]:
        """Those of what is wanted (no defect of that name; a full turn) that it falls short of."""
        return tuple(name for name in wanted if getattr(self, name) is not (name == "full_turn"))


@dataclass(frozen=True)
class _Run:
    """A branch followed one way: driver values ``(n,)`` and states ``(nx, n)`` met, how it ended, and the node there and one before."""

    values: Array
    x: Array
    end: End
    last: Array
    before: Array


class Circuit:
    """The circuit of the first of the closed states ``x (nx, n)`` of a question with one driver, and where on it the others are.

    Attributes
    ----------
    places : for every state the number of its branch and the driver value there (internal units, turns counted from the first), or None.
    turns : turns of the driver after which the branch of the first one comes back, 0 where it does not.
    """

    def __init__(self, question: Question, x: Array) -> None:
        self.q, self.s, self.x = question, question.system, x
        self.row = int(self.s.single_rows[question.columns[0]])
        self.goals = x[self.row]
        self.period = float(self.s.periods[question.columns[0]])
        self.prints = self._prints(x)
        self.places: list[tuple[int, float] | None] = [None] * x.shape[1]
        self.turns = 0
        solver = closure_solver(engine_for(self.s.n_rows, 1, "auto"), question.columns, question.freedoms.hold)
        self._path = DriverPath(self.s, solver, self.s.cases)
        self._walk()

    def _prints(self, x: Array) -> Array:
        return self.q.family.prints(Configuration(self.s, x))

    def _same(self, prints: Array, x: Array) -> Index:
        """Which of the states ``(nx, n)`` are where something with these prints is."""
        apart = np.abs(self._prints(x) - prints[:, None]).max(axis=0, initial=0.0)
        return np.flatnonzero(apart < MODES.arrives * max(1.0, float(np.abs(prints).max(initial=0.0))))

    def _walk(self) -> None:
        """Branch by branch, until all states are found or the first one comes back."""
        first = self.x[:, 0]
        ends = [self._run(first, 1.0, 0)]
        if not self.turns:
            ends.append(self._run(first, -1.0, 0))
        # branches of a circuit, at most
        branch, most = 0, 64
        for sense, end in zip((-1.0, 1.0), ends, strict=False):
            run: _Run | None = end
            while run is not None and None in self.places and branch < most:
                begin = self._behind(run)
                if begin is None:
                    break
                branch += 1
                run = self._run(begin, sense, branch, abs(float(run.last[self.row] - begin[self.row])))
                sense = -sense
                if self._same(self.prints[:, 0], run.x).size:
                    return

    def _run(self, x: Array, sense: float, branch: int, fold: float = 0.0) -> _Run:
        """The branch of a state followed to its end, and back to the ``fold`` so far behind it; states on it get their places."""
        begin, stroke = float(x[self.row]), MODES.slide_stroke
        turning = np.isfinite(self.period)
        # turns of the driver after which a branch may come back: one, or at most these
        for turns in (1, 8) if turning else (1,):
            if turning:
                reach = turns * self.period
                whole = np.arange(turns + 1) * self.period
                ahead = np.mod(sense * (self.goals - begin), self.period)
                ways = np.concatenate([(ahead[:, None] + whole[:-1]).ravel(), whole[1:]])
            else:
                reach = max(0.0, float((sense * (self.goals - begin)).max())) + stroke
                ways = sense * (self.goals - begin)
            back = sense * (self.goals - begin)
            back -= np.ceil(back / self.period) * self.period if turning else 0.0
            ways = np.append(ways[(ways >= 0) & (ways <= reach)], back[(back < 0) & (back > -fold)])
            ways = np.unique(np.append(ways, reach))
            run = self._followed(x, begin + sense * ways)
            gone = sense * (run.values[self._same(self._prints(x[:, None])[:, 0], run.x)] - begin)
            # of a turn: what comes back does so after one or several
            again = gone[gone > 0.5 * self.period]
            if run.end is not End.REACHED or again.size:
                break
        if again.size and not branch:
            self.turns = round(float(again[0]) / self.period)
        for i in range(self.x.shape[1]):
            if self.places[i] is None and (at := self._same(self.prints[:, i], run.x)).size:
                self.places[i] = branch, float(run.values[at[0]])
        return run

    def _followed(self, x: Array, values: Array) -> _Run:
        found: Positions = follow(self._path, [Request(x, 0, values[None], np.arange(len(values)))], len(values))
        nodes = found.nodes_of(int(found.track[-1]))
        order = np.argsort(nodes.place, kind="stable")
        gone = np.abs(nodes.drive[0, order[-1]] - nodes.drive[0, order])
        # driver value (radians, or lengths over L) next to a fold at which the branches that meet there are well apart, and still alike
        before = order[int(np.argmin(np.abs(np.log(np.maximum(gone, 1e-12) / 1e-4))))]
        return _Run(
            values[found.moved],
            found.x[:, found.moved],
            found.tracks.end[int(found.track[-1])],
            nodes.x[:, order[-1]],
            nodes.x[:, before],
        )

    def _behind(self, run: _Run) -> Array | None:
        """A state on the other branch that meets a run at the fold where it ended; None where there is no such fold."""
        if run.end is not End.FOLD:
            return None
        s, gone = self.s, self.s.difference(run.last[:, None], run.before[:, None])
        guess = s.advance(run.last[:, None], gone)[:, 0]
        guess[self.row] = run.before[self.row]
        x, error = close(s, guess, self.q.columns)
        apart = np.abs(s.difference(x[:, None], run.before[:, None])).max()
        return x if error <= CLOSED and apart > np.abs(gone).max() else None

    @cached_property
    def defects(self) -> tuple[bool, bool, bool]:
        """Defects of branch, circuit and order."""
        met = [place for place in self.places if place is not None]
        branch, circuit = any(number for number, _ in met), len(met) < len(self.places)
        return branch or circuit, circuit, not (branch or circuit) and self.ordered is None

    @cached_property
    def ordered(self) -> Array | None:
        """Driver values at which the states are passed one after the other; None where the driver has to turn back."""
        values = np.array([place[1] for place in self.places if place is not None and not place[0]])
        return in_order(values, self.turns * self.period if self.turns else np.inf)

    @property
    def groups(self) -> list[Index]:
        """States that lie on one branch of the circuit, together; each of another circuit alone."""
        number = [(-1 - i) if place is None else place[0] for i, place in enumerate(self.places)]
        return [np.flatnonzero(np.array(number) == k) for k in dict.fromkeys(number)]


def fitness(
    m: Mechanism, q: Array, driver: str | None = None, output: str | None = None, error: float = 0.0
) -> Fitness:
    """Fitness of a mechanism that meets positions with coordinates ``q (n, F)``; its start is the first.

    ``driver`` and ``output`` are freedoms; without a driver nothing is said of defects and transmission, without an output that freedom at
    the frame counts that is moved worst.
    """
    size, ratio = sizes(m)
    unknown = Fitness(None, None, None, None, np.nan, np.nan, size, ratio, error)
    if driver is None:
        return unknown
    driver = m.full_name(driver)
    place = m.freedom_names().index(driver)
    m = m.replace(drives=[driver], start=dict(zip(m.freedom_names(), q[0].tolist(), strict=True)))
    try:
        question = Question(m, {driver: float(q[0, place])})
        circuit = Circuit(question, question.system.state_of(q.T))
        at, between = _transmitted(m, q, driver, output, circuit, float(question.unit[0]))
    except DeadPointError:
        return replace(unknown, branch=True)
    except IndeterminateError:
        return unknown
    full_turn = bool(circuit.turns) if m.turns(driver) else False
    return Fitness(*circuit.defects, full_turn, at, between, size, ratio, error)


def _transmitted(
    m: Mechanism, q: Array, driver: str, output: str | None, circuit: Circuit, unit: float
) -> tuple[float, float]:
    """Least transmission angle at the positions and between them."""
    names, place = m.freedom_names(), m.freedom_names().index(driver)
    outputs = [m.full_name(output)] if output else frame_outputs(m, driver)

    def least(first: Array, values: Array) -> Array:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MechgraphWarning)
            s = kinematics(
                m.replace(start=dict(zip(names, first.tolist(), strict=True))), {driver: values}, on_reach="flag"
            )
            angles = [transmission(s, name).transmission_angle for name in outputs]
        return np.asarray(np.min(angles, axis=0))

    if not outputs:
        return np.nan, np.nan
    if circuit.defects[0] or circuit.ordered is None:
        at = [least(q[some[0]], _values(circuit, some, q[:, place], unit)) for some in circuit.groups]
        return float(np.concatenate(at).min()), np.nan
    way = unit * circuit.ordered
    way = way + q[0, place] - way[0]
    # so many samples; the least value lies between the neighbors of the least one
    samples = np.sort(np.concatenate([way, np.linspace(way[0], way[-1], 91)]))
    angles = least(q[0], np.concatenate([way, samples]))
    near = int(np.argmin(np.nan_to_num(angles[len(way) :], nan=-1.0)))
    low, high = samples[max(near - 1, 0)], samples[min(near + 1, len(samples) - 1)]
    between = np.append(angles, least(q[0], np.linspace(low, high, 45)))
    return float(angles[: len(way)].min()), float(between.min())


def _values(circuit: Circuit, some: Index, driven: Array, unit: float) -> Array:
    """Driver values of states on one branch, counted on from that of the first of them."""
    values = [place[1] for i in some.tolist() if (place := circuit.places[i]) is not None]
    return unit * (np.array(values) - values[0]) + driven[some[0]] if values else driven[some]


class Measure:
    """A quantity of a mechanism that meets positions: ``size``, ``ratio``, ``transmission D``, an output of ``study``, or a function.

    It is taken at the positions, or ``over`` driver values, freedom -> values.
    """

    def __init__(self, m: Mechanism, what: Output, over: Mapping[str, Any] | None = None) -> None:
        self.what, self.over = what, over
        self.of_dimensions = what in ("size", "ratio")
        self.output = what.removeprefix("transmission ") if isinstance(what, str) and "transmission " in what else None
        if self.output is not None and (fault := m.freedom_fault(self.output, single=True)):
            raise DeclarationError(f"synthesis of {m.name!r}", [f"{what!r}: {fault}"])
        if not self.of_dimensions and self.output is None:
            named_outputs(m, {str(what): what}, ())

    def __call__(self, m: Mechanism, q: Array, driver: str | None, smooth: bool = False) -> Array:
        """Its values ``(k,)`` of a mechanism at positions ``q (n, F)``, NaN where the driver does not lead to one.

        ``smooth`` asks for smooth functions of the dimensions of which it is the largest one.
        """
        if self.of_dimensions and smooth:
            lengths = distances(m)
            return lengths if self.what == "size" else np.divide.outer(lengths, lengths).ravel()
        if self.of_dimensions:
            return np.array([sizes(m)[self.what == "ratio"]])
        names = m.freedom_names()
        m = m.replace(start=dict(zip(names, q[0].tolist(), strict=True)))
        motions = self.over or ({} if driver is None else {driver: q[:, names.index(m.full_name(driver))]})
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MechgraphWarning)
            s = solve(m, motions, on_reach="flag")
            if self.output is not None:
                return transmission(s, self.output).transmission_angle.ravel()
            return np.asarray(
                self.what(s) if callable(self.what) else quantity(s, self.what, self.what), dtype=float
            ).ravel()


def limits_of(
    m: Mechanism, conditions: Any, over: Mapping[str, Any] | None, faults: list[str]
) -> list[tuple[str, Measure, float | None, float | None]]:
    """Conditions as quantities with their least and greatest values; what is wrong is put to ``faults``."""
    out = []
    items = conditions.items() if isinstance(conditions, Mapping) else ()
    if not isinstance(conditions, Mapping | None):
        faults.append(wrong(conditions, "conditions", "a mapping quantity -> (least, greatest)"))
    for what, ends in items:
        if not is_interval(two_ends(ends)):
            faults.append(wrong(ends, f"conditions[{what!r}]", "(least, greatest), None for no end"))
            continue
        least, most = (None if np.isinf(end) else end for end in two_ends(ends))
        try:
            out.append((getattr(what, "__name__", str(what)), Measure(m, what, over), least, most))
        except DeclarationError as error:
            faults += error.faults
    return out


def keeps(values: Array, least: float | None, most: float | None) -> bool:
    """Whether all values lie between limits, but for the accuracy of an optimizer; no value that is none does."""
    slip = 1e-6 * max([1.0, *(abs(end) for end in (least, most) if end is not None and np.isfinite(end))])
    return bool(
        np.isfinite(values).all()
        and (least is None or (values >= least - slip).all())
        and (most is None or (values <= most + slip).all())
    )


def frame_outputs(m: Mechanism, driver: str) -> list[str]:
    """The freedoms that a driver moves at the frame: those of pairs with one freedom beside its own."""
    at_frame = [p for p in m.pairs if m.frame in (p.a, p.b) and p.type.f == 1]
    return [name for p in at_frame if (name := p.freedom_names[0]) != driver]


def distances(m: Mechanism) -> Array:
    """Distances of two elements of a link (points of its pairs, named points), of all links; elements at one place left out."""
    at: dict[str, list[Array]] = {link.name: [np.asarray(p) for p in link.points.values()] for link in m.links}
    for pair in m.pairs:
        for link, marker in zip((pair.a, pair.b), pair.markers, strict=True):
            at[link].append(np.asarray(marker.point))
    lengths = np.array([np.linalg.norm(a - b) for points in at.values() for a, b in combinations(points, 2)])
    # elements nearer to each other, as part of the longest distance, are at one place
    return lengths[lengths > 1e-9 * lengths.max(initial=0.0)]


def sizes(m: Mechanism) -> tuple[float, float]:
    """The largest of all distances, and its ratio to the least one; NaN where there are none."""
    lengths = distances(m)
    longest = float(lengths.max(initial=0.0))
    return longest, longest / float(lengths.min(initial=np.inf)) if lengths.size else np.nan
