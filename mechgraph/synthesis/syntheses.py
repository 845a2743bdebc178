"""``mg.synthesize``: what is asked, and the ways to its answers."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from contextvars import copy_context
from dataclasses import fields, replace
from functools import cached_property, partial
from itertools import combinations, islice
from typing import Any, get_args

import numpy as np

from mechgraph.errors import DeclarationError, MechgraphWarning, counted
from mechgraph.graph.chains import Chain
from mechgraph.kinematics.state import Configuration
from mechgraph.maths.se3 import Array, Index
from mechgraph.maths.tolerances import MODES
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.setups import DefectName, FitName, SynthesisSetup, is_interval, two_ends
from mechgraph.modes.homotopy import ELSEWHERE, TRACKS_TOGETHER, Mask
from mechgraph.quantities import Count, angle_hint, door, items_of, real_array, wrong
from mechgraph.quantities import Index as Seed
from mechgraph.synthesis.answers import (
    ComplexSyntheses,
    Degenerate,
    PerMechanism,
    Syntheses,
    SynthesesOver,
)
from mechgraph.synthesis.certified import certificates
from mechgraph.synthesis.classes import NoClass, TaskClass
from mechgraph.synthesis.fitness import Fitness, Measure, fitnesses, limits_of
from mechgraph.synthesis.labelling import cognates, motions_of, orbits, symmetries
from mechgraph.synthesis.legs import ClassMember
from mechgraph.synthesis.optima import FittedSynthesis
from mechgraph.synthesis.solve import (
    Progress,
    TaskEnds,
    TaskStart,
    doing_all,
    endless,
    ends,
    finite,
    imaginary_part,
    kept,
    movable,
    real_states,
    start_of,
    unfolded,
)
from mechgraph.synthesis.structures import of_chains
from mechgraph.synthesis.system import RowNumbers, RowProblem
from mechgraph.synthesis.tasks import FunctionTask, asked_of, function, path, poses, positions
from mechgraph.synthesis.unknowns import Unknowns

NO_SCREWS = "ties an angle to a length or by an unknown ratio: the equations are not algebraic, their number of solutions has no end"
NO_ARRAY = "the equations are not algebraic in it; exact synthesis does not serve it, fits do (fit=)"
NO_LINE = "All that is asked stands beside angles that are numbers in the equations too: no trace test serves."
NO_PLACE = "at some row no real position was found, from the other rows and at random"
NO_CONTACTS = "curves and surfaces are made of pieces: solutions on one cannot be led to those on all others"


DEGENERATE = {
    "double": "{} track{} ended where solutions meet.",
    "continuum": "{} track{} ended among solutions without end: conditions depend on each other here.",
    "open": "In {} solution{} conditions are not met that follow from the others where numbers are as declared.",
    "coincident": "In {} solution{} elements of a link coincide.",
    "reversed": "In {} solution{} an axis that is sought points against the motion that is asked about it.",
}
"""What is said of solutions that are no mechanisms of their own, by kind."""


class Synthesis:
    """What ``synthesize`` asks, and its answers."""

    def __init__(
        self,
        problem: RowProblem,
        tasks: Any,
        sweep: Mapping[str, Any],
        seed: int,
        cache: bool,
        progress: Progress,
        faults: list[str],
    ) -> None:
        self.problem, self.rng, self.cache, self.progress = problem, np.random.default_rng(seed), cache, progress
        self.again = seed != 0
        self.tasks = tasks
        p, m = problem, problem.m
        faults += [f"unknown {name!r}: {NO_ARRAY}" for name in p.unknowns.others]
        faults += [
            f"function with scale='free': the output {name} turns; of angles times an unknown factor there is no finite number of "
            "solutions; give the scale, or fit (fit=)"
            for name in (p.tasks.scaled if p.tasks else ())
            if p.system.m.turns(name)
        ]
        contacts = [pair.name for pair in m.pairs if pair.contact is not None]
        faults += [f"{name}: {NO_SCREWS}; ask for the angle at all rows, or fit (fit=)" for name in p.plain_angles[0]]
        faults += [f"pairs {', '.join(contacts)}: {NO_CONTACTS}; fit (fit=)"] if contacts else []
        self.sweep = Unknowns(m, p.whole, list(sweep), faults)
        faults += [
            f"sweep {name!r}: is unknown; leave it out there" for name in self.sweep.names if name in p.unknowns.names
        ]
        faults += [f"sweep {name!r}: {NO_ARRAY}" for name in self.sweep.others]
        read = [real_array(v) for v in sweep.values()]
        columns = [np.atleast_1d(v) for v in read if v is not None and v.ndim < 2 and v.size and np.isfinite(v).all()]
        if len({len(c) for c in columns}) > 1 or len(columns) != len(self.sweep.names):
            faults.append(
                "sweep: expected single numbers by name, with one list of finite values each, all of the same length"
            )
        if faults:
            raise DeclarationError(p.name, faults)
        self.swept = np.array(columns).reshape(len(columns), -1 if columns else 1)
        try:
            self.of = TaskClass(p, self.rng)
        except NoClass:
            raise DeclarationError(
                p.name, ["no random mechanism of this kind could be closed at random positions"]
            ) from None
        self._count()
        self.symmetries = symmetries(p)

    def _count(self) -> None:
        """As many conditions as unknowns.

        Raises
        ------
        DeclarationError
        """
        p, wanted = self.problem, int(self.of.conditions.sum())
        missed = self.of.missed(self.rng)
        if over := [
            f"row {p.rows[i]} is missed by {missed[i]:.2g}" for i in np.flatnonzero(missed > MODES.real_closed)
        ]:
            raise DeclarationError(
                p.name, [f"more is asked than such mechanisms can do, whatever their numbers: {', '.join(over)}"]
            )
        names = [p.unknowns.names[k] for k in p.sought]
        if wanted == p.u:
            _, sigma, V = np.linalg.svd(self.of.matrix)
            idle = V[int((sigma > MODES.generic * sigma[0]).sum()) :] if p.u else V
            if not len(idle):
                return
            which = ", ".join(
                name for name, column in zip(names, np.abs(idle).T, strict=True) if column.max() > MODES.span
            )
            ways = f"{counted(len(idle), 'way')} to change {which} together"
            fault = f"{ways} {'changes' if len(idle) == 1 else 'change'} nothing that is asked"
            raise DeclarationError(
                p.name, [f"{fault} (frames of links, size or place of the whole): fix as many, and ask for more"]
            )
        each = ", ".join(f"{c} at row {row}" for row, c in zip(p.rows, self.of.conditions, strict=True))
        counts = f"{counted(wanted, 'condition')} ({each}) for {counted(p.u, 'unknown')} ({', '.join(names)})"
        if wanted < p.u:
            free = p.u - wanted
            fault = f"{counts}: fix {free} of these (leave out of unknown, or give values by sweep=), or ask for more"
        else:
            fault = f"{counts}: {wanted - p.u} too many; leave something unasked, let more numbers be unknown, or fit (fit=)"
        raise DeclarationError(p.name, [fault])

    @cached_property
    def goals(self) -> ClassMember:
        """The task at hand, for every value swept."""
        p, own = self.problem, self.of.problem
        numbers = own.numbers.taken(np.zeros(self.swept.shape[1], dtype=np.intp))
        if self.sweep.names:
            numbers = numbers.with_values(own.placed(self.sweep.places), p.scaled(self.sweep.places, self.swept))
        return self.of.goal(numbers)

    @cached_property
    def foretold(self) -> list[str]:
        """What is seen of the task before it is solved: rows that ask the same, and conditions that depend on each other there.

        Where the matrix of the unknowns has a lower rank at random dimensions and positions, closed or not, it has so at all solutions.
        Rows that lie close together are nearly dependent, and no less determine a mechanism.
        """
        p, of, n = self.problem, self.of, self.swept.shape[1]
        asked = np.concatenate([p.asked, *p.rates], axis=1)
        told = [
            f"Rows {one} and {other} ask the same."
            for one, other in combinations(range(len(asked)), 2)
            if np.array_equal(asked[one], asked[other], equal_nan=True)
        ]
        at = of.leg(self.goals, self.goals, np.arange(n)).at(np.tile(of.x[:, None], n), np.ones(n), np.arange(n))
        rank = int(np.linalg.matrix_rank(finite(at.matrix), rtol=MODES.real_closed).min()) if p.u else 0
        if rank < p.u:
            told.append(
                f"Here {rank} of {p.u} conditions are independent: there is no solution, or there are some without end."
            )
        return told

    def answers(self) -> list[Syntheses]:
        """For every value swept."""
        start = start_of(self.of, self.rng, self.cache, self.progress, self.again)
        does = doing_all(self.of, start.member, start.x)
        start, x = replace(start, against=int((~does).sum())), start.x[:, does]
        n, goals = self.swept.shape[1], self.goals
        found = ends(self.of, start, goals, self.rng, self.progress)
        apart = x.shape[1]
        if start.each == 1:
            apart = len(orbits(self.of.told(x), self.symmetries, motions_of(self.of, start.member, x)))
        return [
            self._answer(start, apart, goals.taken(np.array([i])) if n > 1 else goals, one, i)
            for i, one in enumerate(found)
        ]

    def _answer(self, start: TaskStart, apart: int, goal: ClassMember, found: TaskEnds, i: int) -> Syntheses:
        """The answer to the task numbered ``i``; ``apart``: how many solutions of the start set no symmetry makes of others."""
        p, of = self.problem, self.of.full
        every, missing = unfolded(self.of, start, goal, found, self.rng, self.progress)
        does = doing_all(self.of, goal, every)
        every, failing = every[:, does], int((~does).sum()) - start.against
        x, error, which = real_states(self.of, goal, every)
        # rounding of rows grows with lengths, of those of rods with their squares
        power = 1 if self.of.problem is p else 2
        closed_to = CLOSED_TO * np.maximum(1.0, np.abs(x[: self.of.u]).max(axis=0, initial=0.0)) ** power
        fits = error <= closed_to
        told = [*self.foretold, *start.evidence, self._tracks(start, found)]
        told += [f"{name}: {NO_SCREWS}." for name in p.plain_angles[1]]
        told += [NO_LINE] * (not movable(self.of).any())
        told += [f"Of {start.each} mechanisms each that do the same all real ones are listed."] * (start.each > 1)
        told += [f"{missing} of these were not found."] * (missing > 0)
        others = np.delete(every[: self.of.u], which, axis=1)
        hidden = int((imaginary_part(others) < np.sqrt(MODES.real_closed)).sum())
        told += [f"Beside these {counted(hidden, 'solution with real dimensions')}: {NO_PLACE}."] * (hidden > 0)
        condition, motions = self._conditions(goal, x[:, fits]), motions_of(self.of, goal, x[:, fits].astype(complex))
        free = endless(self.of, goal, found.singular)
        goal, x = self.of.lifted(goal, self._near_start(x[:, fits]))
        done = of.error(of.at(goal, x.astype(complex))) <= closed_to[fits]
        x, error = self._upright(goal, x)
        against, merged = done & (error > closed_to[fits]), done & self._merged(goal, x)
        left = done & ~merged & ~against
        x, error, condition, motions = x[:, left], error[left], condition[left], motions[:, left]
        values = p.outside(x[: of.u]).T
        order = np.lexsort(np.round(values, 9).T[::-1]) if len(values) else np.zeros(0, dtype=np.intp)
        x, error, values, condition = x[:, order], error[order], values[order], condition[order]
        motions = motions[:, order]
        alike = orbits(x[: of.u], self.symmetries, motions)
        copies = {k: mine for mine in alike for k in mine}
        made = [self._mechanism(goal, x[:, k], values[k], i) for k in range(len(values))]
        shape = (p.tasks.rows if p.tasks else 0, len(p.m.links), 4, 4)
        counts = {
            "double": int((~free).sum()),
            "continuum": int(free.sum()),
            # what follows from what is solved for, where known numbers are such as are declared
            "open": max(failing + int((~fits).sum() + (~done).sum()), 0),
            "coincident": int((merged & ~against).sum()),
            "reversed": int(against.sum()),
        }
        names = (*p.unknowns.names, *self.sweep.names)
        swept = np.repeat(self.swept[:, i][None], len(values), axis=0)
        out = Syntheses(
            p.first.declared,
            tuple(m for m, _, _ in made),
            names,
            np.concatenate([values, swept], axis=1),
            np.array([poses for _, _, poses in made]).reshape(-1, *shape),
            np.array([q for _, q, _ in made]).reshape(len(made), shape[0], len(p.m.freedom_names())),
            error,
            ComplexSyntheses(p.outside(others).T),
            start.total,
            tuple(
                Degenerate(kind, n, DEGENERATE[kind].format(n, "" if n == 1 else "s"))
                for kind, n in counts.items()
                if n
            ),
            found.infinite,
            # of what goes to infinity, or where solutions meet, there is no certificate
            "searched" if found.lost or missing else "tested" if found.infinite or found.singular.size else start.word,
            tuple(told),
            condition,
            PerMechanism.at_once(
                partial(self._fitness, [m for m, _, _ in made], np.array([q for _, q, _ in made])), len(made)
            ),
            apart,
            (*self.symmetries, *cognates(alike, self.symmetries, motions)),
            tuple(tuple(copies[k]) for k in range(len(values))),
            driver=driver_of(p.m, self.tasks)[0],
            asked=asked_of(p.first.declared, self.tasks, []),
            certificates=PerMechanism.at_once(partial(certificates, of, goal, x), len(values)),
        )
        # of a sweep nothing is said of fitness, which takes longer than the solutions, until it is asked for
        return out if self.sweep.names else out._sorted

    def _near_start(self, x: Array) -> Array:
        """Real states ``(nx, n)`` with angles that are asked nowhere by whole turns near to the start, and constants that go with them."""
        of, out, turns = self.of, x.copy(), self.of.problem.turns
        s, n = of.problem.system, x.shape[1]
        rows, at = out[of.head :].reshape(of.R, of.nx, n), s.single_rows[turns.columns]
        start = s.start_coordinates(s.m.start)[turns.columns, None]
        for way, by in zip(turns.ways.T[:, :, None], turns.by.T, strict=True):
            back = np.round((way * (rows[0, at] - start)).sum(axis=0) / (2 * np.pi * (way**2).sum()))
            rows[:, at] -= 2 * np.pi * way * back
            out[turns.which] -= by[:, None] * back
        return out

    def _tracks(self, start: TaskStart, found: TaskEnds) -> str:
        N = start.x.shape[1]
        return (
            f"{counted(N, 'track')} to this task in {counted(found.runs, 'run')}: {found.x.shape[1]} regular, {found.singular.shape[1]} "
            f"singular, {found.infinite} at infinity, {found.lost} failed."
        )

    def _upright(self, goal: ClassMember, x: Array) -> tuple[Array, Array]:
        """States ``x (nx, n)`` with norms of directions above zero, as those of a Mechanism, and what they leave open.

        Tracks may turn the sign of a norm. Its direction is the opposite one then: motions along it change their signs too, and where
        such a motion is asked, its states do not close.
        """
        of, s, n = self.of.full, self.problem.system, x.shape[1]
        turned = x.copy()
        if of.W:
            second, axis = np.sign(x[of.u : of.head]).reshape(2, 2, of.W // 4, n)[::-1, 0]
            twists = np.array([f.twist for pair in s.m.pairs for f in pair.type.freedoms])
            along = (twists**2).reshape(-1, 2, 3).sum(axis=1) / (twists**2).sum(axis=1, keepdims=True)
            sign = np.einsum("fi,ifn->fn", along, np.stack([second, axis * second, axis])[:, s.pair_of_freedom])
            states = x[of.head :].reshape(of.R, of.nx, n).swapaxes(0, 1).reshape(of.nx, -1)
            sign = np.tile(sign, of.R)
            closed = s.state_of(s.coordinates_of(states[: of.states]) * sign)
            rates = states[of.states :] * np.tile(sign, (len(of.problem.rates), 1))
            states = np.concatenate([closed, rates])
            turned[of.u : of.head] = np.abs(x[of.u : of.head])
            turned[of.head :] = states.reshape(of.nx, of.R, n).swapaxes(0, 1).reshape(of.R * of.nx, n)
        return turned, of.error(of.at(goal, turned.astype(complex)))

    def _merged(self, goal: ClassMember, x: Array) -> Mask:
        """Which solutions ``(n,)`` have elements of a link that fall together, where those of a random mechanism do not."""
        # how elements that are known lie to each other was declared
        changed = {q.pair for own in (*self.problem.places, *self.sweep.places) for q in own}
        of, pairs = self.of.full, [ends for ends in _neighbors(self.problem.m) if changed.intersection(ends)]
        here, there = of.at(of.start, of.x[:, None]).here, of.at(goal, x.astype(complex)).here
        s, out = here.system, np.zeros(x.shape[1], dtype=bool)
        for i, j in pairs:
            columns = np.r_[s.first_column[i] : s.first_column[i + 1], s.first_column[j] : s.first_column[j + 1]]
            wanted = np.linalg.matrix_rank(here.S[:, columns, 0], MODES.generic)
            S = there.S[:, columns, : x.shape[1]].transpose(2, 0, 1)
            out |= np.linalg.matrix_rank(S, MODES.generic) < wanted
        return out

    def _conditions(self, goal: ClassMember, x: Array) -> Array:
        """Condition numbers ``(n,)`` of the unknowns."""
        if not x.shape[1]:
            return np.zeros(0)
        here = self.of.leg(goal, goal).at(x.astype(complex), np.ones(x.shape[1]), np.arange(x.shape[1]))
        return np.asarray(np.linalg.cond(here.matrix))

    def _mechanism(self, goal: ClassMember, x: Array, values: Array, i: int) -> tuple[Mechanism, Array, Array]:
        """The mechanism of a solution, its coordinates ``(rows, F)`` and poses ``(rows, N, 4, 4)``."""
        p, of, F = self.problem, self.of.full, len(self.problem.m.freedom_names())
        m = p.unknowns.mechanism(values)
        if self.sweep.names:
            m = replace_fields(self.sweep, m, self.swept[:, i])
        states = x[of.head :].reshape(of.R, of.nx)[:, : of.states].T
        if p.rows[0]:
            states = np.concatenate([p.at_rest[:, None], states], axis=1)
        s = p.system
        q = s.coordinates_of(states).T
        start = s.start_coordinates(p.m.start)
        period = s.in_user_units(of.of_row.family.periods)
        asked = np.zeros((q.shape[0], s.n_freedoms), dtype=bool)
        asked[:, p.columns] = ~np.isnan(p.asked)
        free = np.isfinite(period) & (s.single_rows >= 0)
        free[s.coupled_freedoms] = False
        whole = np.where(free, np.round((q - start) / np.where(free, period, 1.0)), 0.0)
        q = np.where(asked, q, q - whole * np.where(free, period, 0.0))
        numbers = goal.numbers.with_values(p.places, x[: of.u, None])
        here = Configuration(p.system_with(RowNumbers(*(v.real for v in vars(numbers).values()))), states)
        begin = dict(zip(m.freedom_names(), q[0, :F].tolist(), strict=True))
        return p.first.back(m).replace(start=begin), q[:, :F], p.first.poses_of(here)

    def _fitness(self, made: list[Mechanism], q: Array) -> list[Fitness]:
        asked = self.problem.tasks
        # rates are met in one way alone
        values = asked.values if asked and not asked.rates else None
        return fitnesses(made, q, *driver_of(self.problem.m, self.tasks), asked=values)


CLOSED_TO = 1e-10
"""Error of closure and task up to which a real solution does what is asked; it is closed to rounding, unless it cannot be."""


def _neighbors(m: Mechanism) -> list[tuple[int, int]]:
    """Pairs that share a link."""
    ends = [{pair.a, pair.b} for pair in m.pairs]
    return [(i, j) for i in range(len(ends)) for j in range(i) if ends[i] & ends[j]]


def replace_fields(of: Unknowns, m: Mechanism, values: Array) -> Mechanism:
    """A mechanism with numbers of these values too."""
    other = Unknowns(m, of.whole, list(of.names), [])
    return other.mechanism(values)


def driver_of(m: Mechanism, tasks: Any) -> tuple[str | None, str | None]:
    """The freedom that drives the mechanism through the rows, and that in which its task comes out."""
    every = tasks if isinstance(tasks, list | tuple) else [tasks]
    for task in every:
        if isinstance(task, FunctionTask):
            return task.input, task.output
    timed = [name for task in every for name in getattr(task, "at", {})]
    names = timed or [drive.freedom for drive in m.drives]
    return (names[0], None) if len(names) == 1 else (None, None)


def subset_values(problem: RowProblem, tasks: Any, subsets: int, seed: int, progress: Progress = None) -> Array:
    """Values ``(n, names)`` of all real solutions of so many subsets of rows with as many conditions as unknowns.

    None where no start set of such tasks is kept or came with the package: to make one takes longer than a fit.
    """
    rng, given = np.random.default_rng(seed), ~np.isnan(problem.asked)
    alike = 1 + np.flatnonzero((given[1:] == given[1]).all(axis=1))
    try:
        if problem.unknowns.others or not problem.closed_at_start:
            raise NoClass
        each = int(TaskClass(problem.with_rows(np.array([0, alike[0]])), rng).conditions.sum())
        R = problem.u // max(each, 1)
        if not 0 < R < len(alike) or R * each != problem.u:
            raise NoClass
        of = Synthesis(problem.with_rows(np.append(0, alike[:R])), tasks, {}, seed, True, None, []).of
    except (NoClass, DeclarationError):
        return np.zeros((0, len(problem.unknowns.names)))
    if (start := kept(of)) is None:
        return np.zeros((0, len(problem.unknowns.names)))
    if not (subsets := min(subsets, TRACKS_TOGETHER // start.x.shape[1])):
        return np.zeros((0, len(problem.unknowns.names)))
    picks = np.unique([np.sort(rng.choice(alike, R, replace=False)) for _ in range(subsets)], axis=0)
    drive = np.moveaxis(problem.asked[picks], 0, -1).astype(complex)
    goals = ClassMember(of.problem.numbers.taken(np.zeros(len(picks), dtype=np.intp)), np.nan_to_num(drive))
    found = ends(of, start, goals, rng, progress)
    real = [real_states(of, goals.taken(np.array([i])), one.x)[0] for i, one in enumerate(found)]
    return problem.outside(np.concatenate(real, axis=1)[: of.u]).T


def fixed_values(
    problem: RowProblem,
    tasks: Any,
    spare: int,
    bounds: Mapping[str, Any],
    values: int,
    seed: int,
    cache: bool,
    progress: Progress,
) -> Array:
    """Values ``(n, names)`` of real solutions of a task with fewer conditions than unknowns, as many of these fixed at random values in
    ``bounds``, or at any distance from those declared: all where the class has fewer than a hundred.

    None where no such tasks are solved exactly.
    """
    rng, names, none = np.random.default_rng(seed), problem.unknowns.names, np.zeros((0, len(problem.unknowns.names)))
    if problem.unknowns.others or not problem.closed_at_start or spare < 1:
        return none
    found = list[tuple[Index, Synthesis, TaskStart | None]]()
    # choices of what is fixed that are looked at; those that come last first, as frames and pivots are named first
    for fixed in islice(combinations(range(len(names))[::-1], spare), 8):
        swept = dict[str, Array]()
        for k in fixed:
            low, high = two_ends(bounds.get(names[k], (None, None)))
            far = problem.unknowns.declared[k] + 2 * problem.L * rng.standard_cauchy(values)
            swept[names[k]] = rng.uniform(low, high, values) if np.isfinite(high - low) else np.clip(far, low, high)
        try:
            rest = RowProblem(problem.m, tasks, [name for name in names if name not in swept])
            of = Synthesis(rest, tasks, swept, seed, True, progress, [])
        except (NoClass, DeclarationError):
            continue
        found.append((np.array(fixed), of, kept(of.of) if cache else None))
        if found[-1][2] is not None:
            break
    if not found:
        return none
    # one that is kept, else the first
    held, of, known = found[-1] if found[-1][2] is not None else found[0]
    start = known or start_of(of.of, np.random.default_rng(seed), cache, progress, some=True)
    goals, out = of.goals.taken(np.arange(min(values, TRACKS_TOGETHER // start.x.shape[1]))), [none]
    for i, one in enumerate(ends(of.of, start, goals, rng, progress) if len(goals.drive.T) else ()):
        z = real_states(of.of, goals.taken(np.array([i])), one.x)[0][: of.of.u]
        out.append(np.empty((z.shape[1], len(names))))
        out[-1][:, np.delete(np.arange(len(names)), held)], out[-1][:, held] = of.problem.outside(z).T, of.swept[:, i]
    return np.concatenate(out)


@door
def synthesize(
    m: Mechanism | Iterable[Chain],
    tasks: Any = None,
    unknown: Sequence[str] | None = None,
    *,
    fit: FitName | None = None,
    bounds: Mapping[str, Any] | None = None,
    conditions: Mapping[Any, Any] | None = None,
    require: Sequence[DefectName] = (),
    minimize: Any = None,
    maximize: Any = None,
    sweep: Mapping[str, Any] | None = None,
    over: Mapping[str, Any] | None = None,
    starts: Count = 64,
    seed: Seed = 0,
    cache: bool = True,
    progress: Callable[[str], None] | None = None,
    executor: Executor | None = None,
) -> Any:
    """Find all mechanisms of a declared topology that do what is asked, or those that come nearest to it.

    As many conditions as unknowns: all solutions, by monodromy over complex tasks of the same class and a parameter homotopy to the task at
    hand. Source: Plecnik and Fearing, J. Mech. Robotics 9, 2017. More conditions: ``fit``. Fewer: ``sweep``, ``minimize`` or ``maximize``.

    Parameters
    ----------
    m : Mechanism or iterable of Chain
        Its links and pairs; declared values of unknown numbers do not matter, but that fits begin with them. Of chains, e.g.
        ``mg.atlas(6, 1)``, every choice of frame, input and output link becomes a mechanism: pairs that tasks name stand at the frame,
        links that they name are not joined to it. Answers are ranked together.
    tasks : task or list
        ``poses``, ``path``, ``function``, ``positions``; row 0 is the declared configuration. Default: all that ``m.synthesis``
        holds, but for what is given here.
    unknown : list of str
        Numbers as ``study`` names them on which positions depend (``"B.point.x"``, ``"A.pitch"``, ``"g.constant"``, ``"length[2]"``,
        in fits ``"K.curve.radius"``), or elements: ``"B.point"``, ``"B.axis"``, ``"coupler.tip"``, ``"B"``. Default,
        of chains: as many numbers of pins as there are conditions, moving pins first, the others at random; of fits all pins.
    fit : {"least_squares", "minimax"}, optional
        Make the sum of the squares of the errors of all positions least, or the largest of them. Default: all are met exactly.
    bounds : mapping, optional
        Unknown number -> (least, greatest), None for no end.
    conditions : mapping, optional
        Quantity -> (least, greatest) at the positions: ``"size"``, ``"ratio"``, ``"transmission D"`` [rad], an output of ``study``, or a
        function of a Solution. Exact solutions that do not keep them are left out, see ``Syntheses.rejected``.
    require : sequence of str
        Of ``"branch"``, ``"circuit"``, ``"order"`` (no such defect) and ``"full_turn"``; others are left out.
    minimize, maximize : quantity, optional
        On which freedom is spent where fewer conditions are given than unknowns.
    sweep : mapping, optional
        Numbers that are known, with a list of values each.
    over : mapping, optional
        Driver -> values at which conditions hold, in place of the positions.
    starts : int
        From how many dimensions a fit begins: the declared ones; all real exact solutions of so many subsets of the positions, where a
        start set of such tasks came with the package or is kept, or with numbers that are free at so many random values, for which one
        is made, of a hundred solutions at most; and for each that is left of so many twelve random ones about the declared ones or in
        ``bounds``: with 64 and no exact solutions 1 + 12 x 63 = 757, as ``evidence`` tells.
    seed : int
        Seed of all random numbers; exact results of a mechanism do not depend on it.
    cache : bool
        Keep start solutions in the user's folder.
    progress : callable, optional
        Called with a line of text now and then. Default: a terminal or notebook shows those of the first task of a kind.
    executor : concurrent.futures.Executor, optional
        Who follows the tracks of exact syntheses, in parts: one of processes, or of a cluster as Dask's. Results are the same on any.

    Returns
    -------
    Syntheses or SynthesesOver

    Raises
    ------
    DeclarationError
        Faults of tasks and unknowns; other numbers of conditions than of unknowns.

    Examples
    --------
    >>> import mechgraph as mg
    >>> links = [mg.Link("frame"), mg.Link("crank"), mg.Link("body")]
    >>> A = mg.Pair("A", "R", "frame", "crank", point=(0, 0))
    >>> B = mg.Pair("B", "R", "crank", "body", point=(1, 0))
    >>> m = mg.Mechanism("crank", links, [A, B], planar=True)
    >>> s = mg.synthesize(m, mg.poses("body", [[0, 0, 0], [1, 0.5, 0.4], [2, 0.4, 1.1]]), ["B.point"])
    >>> len(s), s.total
    (1, 1)
    """
    given = {
        "fit": fit, "bounds": bounds, "conditions": conditions, "require": require, "minimize": minimize,
        "maximize": maximize, "sweep": sweep, "over": over, "starts": starts,
    }  # fmt: skip
    if executor is not None:
        if not callable(getattr(executor, "submit", None)):
            raise DeclarationError("synthesis", [wrong(executor, "executor", "an executor, with submit()")])
        context = copy_context()
        context.run(ELSEWHERE.set, executor)
        return context.run(partial(synthesize, m, tasks, unknown, **given, seed=seed, cache=cache, progress=progress))
    if not isinstance(m, Mechanism):
        return of_chains(synthesize, m, tasks, unknown, given, int(seed), cache, progress)
    where, faults = f"synthesis of {m.name!r}", list[str]()
    if tasks is None and unknown is None and m.synthesis is not None:
        own = {name: value for name, value in given.items() if value != _USUAL[name]}
        return synthesize(m, **_stored(m.synthesis) | own, seed=seed, cache=cache, progress=progress)
    if tasks is None or unknown is None:
        raise DeclarationError(where, ["tasks and unknown: expected both, or a mechanism with synthesis="])
    unknown = [unknown] if isinstance(unknown, str) else list(unknown)
    require = items_of(require, "require", faults)
    faults += [] if unknown else ["unknown: nothing is sought; name numbers or elements"]
    limits, within, goals = limits_of(m, conditions, over, faults), dict(bounds or {}), list[tuple[Measure, float]]()
    fitting = any(one is not None for one in (fit, minimize, maximize))
    for name, what, sign in (("minimize", minimize, 1.0), ("maximize", maximize, -1.0)):
        try:
            goals += [] if what is None else [(Measure(m, what, over, name), sign)]
        except DeclarationError as error:
            faults += [f"{name}: {fault}" for fault in error.faults]
    faults += _faults_of_options(m, fit, len(goals), require, over)
    if fitting and sweep:
        faults.append("sweep: expected for exact syntheses alone; give the numbers values in the mechanism")
    faults += _faults_of_bounds(within, fitting)
    problem = RowProblem(m, tasks, unknown, faults)
    faults += _other_names(problem, within)
    for text in _foretold(problem, unknown):
        warnings.warn(f"{where}: {text}", MechgraphWarning, stacklevel=3)
    if fitting:
        # sizes are the same everywhere
        moving = not all(
            measure.of_dimensions for measure in (*(limit[1] for limit in limits), *(goal[0] for goal in goals))
        )
        ends_of = (None, None) if faults else driver_of(m, tasks)
        fits = FittedSynthesis(problem, tasks, over if moving else None, *ends_of, faults)
        spare, numbers = fits.fit.spare, (int(starts), int(seed))
        if fit is not None and spare > 0:
            told = f"{counted(spare, 'number')} of {', '.join(problem.unknowns.names)} stay open: some of solutions without end are found"
            more = "leave as many out of unknown, ask for more, or spend the freedom by minimize= or maximize="
            warnings.warn(f"{where}: fit: {told}; {more}", MechgraphWarning, stacklevel=3)
        again, exact = RowProblem(m, tasks, unknown), np.zeros((0, len(problem.unknowns.names)))
        if cache and fit is not None:
            exact = subset_values(again, tasks, *numbers, progress)
        elif fit is None:
            exact = fixed_values(again, tasks, spare, within, *numbers, cache, progress)
        answer = fits.answered(fit, within, limits, goals, *numbers, progress, exact)
        return answer._kept(require, within, limits, fits.driver)
    found = Synthesis(problem, tasks, dict(sweep or {}), int(seed), cache, progress, faults)
    for text in found.foretold:
        warnings.warn(f"{where}: {text}", MechgraphWarning, stacklevel=3)
    driver, _ = driver_of(m, tasks)
    answers = [one._kept(require, within, limits, driver) for one in found.answers()]
    if sweep:
        return SynthesesOver(dict(zip(found.sweep.names, found.swept, strict=True)), tuple(answers))
    return answers[0]


def _faults_of_options(m: Mechanism, fit: Any, goals: int, require: Sequence[Any], over: Any) -> list[str]:
    """What is wrong with names of defects and kinds of fits, and with values of drivers."""
    known = ", ".join(map(repr, get_args(DefectName)))
    out = [wrong(name, "require", known) for name in require if name not in get_args(DefectName)]
    if goals + (fit is not None) > 1:
        out.append("fit, minimize, maximize: expected one of them")
    if fit is not None and fit not in get_args(FitName):
        out.append(wrong(fit, "fit", " or ".join(map(repr, get_args(FitName)))))
    for name, values in (over or {}).items():
        given = real_array(values)
        if fault := m.freedom_fault(name, single=True):
            out.append(f"over: {fault}")
        elif given is None or not given.size or not np.isfinite(given).all():
            out.append(wrong(values, f"over[{name!r}]", "finite values, one at least"))
    return out


def _foretold(p: RowProblem, unknown: Sequence[str]) -> Iterator[str]:
    """What users should know of a task before it is solved."""
    m = p.m
    moved = {m.pairs[q.pair].name for own in p.unknowns.places for q in own if 0 <= q.pair < len(m.pairs)}
    moved |= {name.split(".")[0] for name in unknown}
    changed = {end for pair in m.pairs if pair.name in moved for end in (pair.a, pair.b)}
    heavy = [link.name for link in m.links if link.name in changed and link.mass]
    if heavy or m.loads:
        of = " and ".join([f"masses and mass centers of {', '.join(heavy)}"] * bool(heavy) + ["loads"] * bool(m.loads))
        yield f"{of} stay as declared, whatever the dimensions"
    # a whole turn more or less changes nothing, and many take long to follow
    most = np.nan_to_num(np.abs(p.asked[:, ~p.system.is_length[p.columns]])).max(initial=0.0)
    if told := angle_hint(float(most)):
        yield f"an angle of {most:.4g} is asked: {told}; for degrees write np.deg2rad(...)"


def _faults_of_bounds(bounds: Mapping[str, Any], fitting: bool) -> list[str]:
    """What is no interval, and of a fit what is none to move in."""
    out = list[str]()
    for name, given in bounds.items():
        if not is_interval(two_ends(given)):
            out.append(wrong(given, f"bounds[{name!r}]", "(least, greatest), None for no end"))
        elif fitting and np.equal(*two_ends(given)):
            out.append(f"bounds[{name!r}]: both ends are {given[0]}; declare that value, and leave it out of unknown")
    return out


_USUAL = {one.name: one.default for one in fields(SynthesisSetup)}


def _stored(setup: SynthesisSetup) -> dict[str, Any]:
    """The arguments that a mechanism carries."""
    calls: dict[str, Callable[..., Any]] = {"function": function, "path": path, "poses": poses, "positions": positions}
    out = {name: getattr(setup, name) for name in setup.formats}
    return out | {
        "tasks": [calls[task.kind](**task.arguments()) for task in setup.tasks],
        "unknown": list(setup.unknown),
    }


def _other_names(p: RowProblem, bounds: Mapping[str, Any]) -> list[str]:
    """Bounds of what is not unknown, as faults."""
    known = ", ".join(p.unknowns.names)
    return [f"bounds[{name!r}]: is not unknown; unknown are {known}" for name in bounds if name not in p.unknowns.names]
