"""Starts of fits and their way to optima, all together: by the method of Levenberg and Marquardt, under limits each by itself.

Starts go down on some of the rows, from which drivers are eliminated one by one: each acts on its own row. The best of them are followed to
the end on all rows.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
import scipy

from mechgraph.errors import DeclarationError, MechgraphWarning, counted
from mechgraph.kinematics.prescribed import DriverMotion
from mechgraph.kinetostatics import Pipeline, transmission_index, with_unit_effort
from mechgraph.maths.se3 import Array, Index
from mechgraph.memo import dataclass
from mechgraph.model.mechanism import Mechanism
from mechgraph.outcome import Options, Starts, in_kernel
from mechgraph.result.solution import Solution
from mechgraph.synthesis.answers import ComplexSyntheses, Syntheses
from mechgraph.synthesis.courses import constrained, descended
from mechgraph.synthesis.fitness import Measure, distances, fitnesses
from mechgraph.synthesis.fits import LEAST_MARGIN, Bounds, Fit, FitPoint, RowLimit
from mechgraph.synthesis.system import RowProblem
from mechgraph.variants.numbers import ItemField, varied
from mechgraph.variants.work import quantity


def settled(fit: Fit, here: FitPoint, low: Array, high: Array) -> FitPoint:
    """The rows of mechanisms at optima of sums of squares with margins, as far as they come there.

    An optimum without a margin is none: margins have weights, from the size of what is missed on, that grow until they are kept.
    """
    size, part = (fit.missed(here) ** 2).sum(axis=(0, 2)), np.full(here.z.shape[1], 10.0)
    # rounds after which an optimum is not sought any further
    for _ in range(8):
        here, new = descended(fit, here, low, high, 40, part * _typical(fit, size))
        gained = new < 0.6 * size
        if fit.open.any() and not gained.any():
            # open drivers are put anew where the path comes nearest
            there, came = fit.begun(here.z)
            again = (fit.missed(there) ** 2).sum(axis=(0, 2))
            better = came & (again < (1 - 1e-6) * new)
            here, new, gained = fit.mixed(better, there, here), np.where(better, again, new), better
        narrow = fit.margins(here, LEAST_MARGIN).min(axis=0) < LEAST_MARGIN
        # what comes to the same, stays far behind the best one, or behind four others goes no further
        kept = _different(here.z, new, 16.0 * new.min())[:4]
        here, part, size = fit.taken(here, kept), np.where(narrow, 10.0 * part, part)[kept], new[kept]
        if not (gained | narrow)[kept].any():
            break
    return here


def _typical(fit: Fit, size: Array) -> Array:
    """What is missed in the mean ``(T,)``, from the sums of the squares."""
    return np.maximum(np.sqrt(size / max(len(fit.asked[0]), 1)), 1e-9)


def _different(z: Array, size: Array, most: float, apart: float = 1e-2) -> Index:
    """Which of mechanisms ``z (u, T)`` differ, by lengths over L, and are not above a size, the best first."""
    kept = list[int]()
    for i in np.argsort(size, kind="stable").tolist():
        if size[i] <= most and all(np.abs(z[:, i] - z[:, j]).max() > apart for j in kept):
            kept.append(i)
    return np.array(kept, dtype=np.intp)


@dataclass(frozen=True)
class Fitted:
    """Optima found, the best first, and in words how they were."""

    points: tuple[FitPoint, ...]
    evidence: tuple[str, ...]


def fitted(
    fit: Fit,
    way: str | None,
    starts: int,
    bounds: Bounds,
    goal: RowLimit | None = None,
    limits: Sequence[RowLimit] = (),
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
    exact: Iterable[Array] = (),
) -> Fitted:
    """The optima to which dimensions lead: the declared ones, those that do parts of the task exactly, and twelve random ones
    for each of ``starts`` that is left.

    ``exact`` are values of all names. ``way``, ``goal`` and ``limits`` are those of ``constrained``.
    """
    low, high = fit.limits(bounds)
    rng, u = np.random.default_rng(seed), len(fit.z0)
    told = [fit.p.inside(values[:, None])[:, 0] for values in exact]
    many = max(12 * (starts - 1 - len(told)), 0)

    def box(reach: Array | float) -> tuple[Array, Array]:
        begin, end = low[:u], high[:u]
        return np.where(np.isfinite(begin), begin, fit.z0 - reach), np.where(np.isfinite(end), end, fit.z0 + reach)

    # how far from those declared, in L
    reach = 0.5 * 8.0 ** rng.uniform(size=(many, 1))
    tries = np.concatenate([np.reshape([fit.z0, *told], (-1, u)), rng.uniform(*box(reach))]).T
    tries = np.clip(tries, low[:u, None], high[:u, None])
    begun, count = _best(fit, tries, low, high, goal if way is None else None, limits, progress)
    # quadratic programs take long
    begun = begun if way == "least_squares" and not limits else begun[:4]
    evolved = None if begun else _evolved(fit, *box(0.5), seed)
    begun += [] if evolved is None else [evolved]
    ends: list[FitPoint] = []
    unsafe = lost = early = 0
    wide = RowLimit(fit.margins, LEAST_MARGIN, None)
    for i, begin in enumerate(begun, 1):
        if progress is not None:
            progress(f"best start {i} of {len(begun)} to the end")
        end: FitPoint | None = begin
        narrow = fit.margins(begin).min() < LEAST_MARGIN
        if narrow or way != "least_squares" or limits:
            end, came = constrained(fit, begin, low, high, way, goal, [*limits, wide] if narrow else limits)
            early += end is not None and not came
        if end is None or (goal is not None and not np.isfinite(goal.of(end)).all()):
            lost += 1
        elif not fit.safe(end):
            unsafe += 1
        else:
            ends.append(end)

    def value(here: FitPoint) -> float:
        if way is None:
            return 0.0 if goal is None else float(goal.of(here).max())
        errors = fit.errors(here)
        return float(errors.max() if way == "minimax" else np.sqrt((errors**2).mean()))

    ends.sort(key=value)
    kept: list[FitPoint] = []
    for here in ends:
        # difference of dimensions, over L, up to which optima are one
        if all(np.abs(here.z - other.z).max() > 1e-3 for other in kept):
            kept.append(here)
    same = sum(abs(value(here) - value(ends[0])) <= 1e-4 * abs(value(ends[0])) + 1e-12 for here in ends) if ends else 0
    several = f"; the best {len(begun)} that differ were followed to the end, {same} of them to the best one"
    followed = ("", "; the best one was followed to the end", several)[min(len(begun), 2)]
    followed = followed if evolved is None else "; the best that differential evolution finds was followed to the end"
    words = [f"{counted(count, 'start')} of {tries.shape[1]} led to all rows{followed}."]
    part = "all that is asked" if way is None else "a part of the positions"
    begins = "They are the declared dimensions" + f", {len(told)} that do {part} exactly" * bool(told)
    left = f", {many} random ones: twelve for each that is left of starts={starts}" * bool(many)
    words.append(f"{begins}{left}." if told or many else f"{begins} alone: starts={starts}.")
    if way is None and fit.spare > 0 and not told:
        words.append(
            "None was known to do all that is asked: such tasks are not solved exactly, or none of their solutions is real."
        )
    if unsafe + lost:
        words.append(
            f"Left out: {unsafe} of which the path does not lead through all rows, {lost} that came to no optimum within the limits."
        )
    if early:
        words.append(f"Stopped before the optimum: {early}; better ones may be near.")
    return Fitted(tuple(kept), tuple(words))


def _best(
    fit: Fit,
    tries: Array,
    low: Array,
    high: Array,
    goal: RowLimit | None,
    limits: Sequence[RowLimit],
    progress: Callable[[str], None] | None,
) -> tuple[list[FitPoint], int]:
    """The rows of the best mechanisms to which dimensions ``tries (u, n)`` lead, by some rows first; and how many lead to all rows.

    Under limits also those that fall short of them by the least, before what is missed is as small as can be; where nothing is missed those
    with the least ``goal``.
    """
    # rows by which starts are compared, starts that go down together, and those whose end is sought
    coarse, together, most, found, sizes = fit.of_some(20), 256, 8, [tries[:, :0]], [np.zeros(0)]
    count = 0
    for k in range(0, tries.shape[1], together):
        here, came = coarse.begun(tries[:, k : k + together])
        here, count = coarse.taken(here, np.flatnonzero(came)), count + int(came.sum())
        # the better ones go on, with open drivers put anew where the path comes nearest
        for n, part in ((3, 4), (6, 2), (10, 2), (16, 2)) if came.any() else ():
            # without margins most of them end where a row is about to leave its branch
            weight = 3.0 * _typical(coarse, (coarse.missed(here) ** 2).sum(axis=(0, 2)))
            here, size = descended(coarse, here, low, high, n, weight)
            if coarse.open.any() and n > 3:
                there, came = coarse.begun(here.z)
                again = (coarse.missed(there) ** 2).sum(axis=(0, 2))
                here, size = (
                    coarse.mixed(came & (again < size), there, here),
                    np.where(came, np.minimum(size, again), size),
                )
            # where nothing is missed all differ in the goal alone
            order = np.argsort(size, kind="stable")[: max(len(size) // part, most if goal is None else len(size))]
            here, size = coarse.taken(here, order), size[order]
            if limits and n == 6:
                found.append(here.z)
                sizes.append(size)
        found.append(here.z)
        sizes.append((coarse.missed(here) ** 2).sum(axis=(0, 2)))
        if progress is not None:
            progress(f"{min(k + together, tries.shape[1])} of {tries.shape[1]} starts")
    z, size = np.concatenate(found, axis=1), np.concatenate(sizes)
    ranked = goal is not None and bool((size < 1e-10).any())
    if goal is not None and ranked:
        there, came = fit.begun(z[:, size < 1e-10])
        there = fit.taken(there, np.flatnonzero(came))
        reached = goal.of(there).max(axis=0) if came.any() else np.zeros(0)
        z, size = there.z, np.nan_to_num(reached, nan=np.inf)
    kept = _different(z, size, np.inf, 0.2 if ranked else 1e-2)[: 3 * most if limits else most]
    here, came = fit.begun(z[:, kept]) if kept.size else (here, np.zeros(0, dtype=bool))
    if not came.any():
        return [], count
    here = fit.taken(here, np.flatnonzero(came))
    each = [fit.taken(here, np.array([i])) for i in range(here.z.shape[1])]
    ends = list[FitPoint]()
    if not ranked:
        best = settled(fit, fit.taken(here, np.arange(min(most, len(each)))), low, high)
        ends = [fit.taken(best, np.array([i])) for i in range(best.z.shape[1])]
    if not limits:
        return ends or each, count
    # that which misses least leads the way, in parts of L and of limits
    amiss = {id(one): max(limit.amiss(one) for limit in limits) for one in [*ends, *each]}
    each.sort(key=lambda one: amiss[id(one)] + float(np.sqrt((fit.residual(one) ** 2).mean())))
    every = [*ends[:2], *each]
    return [one for one in every if np.isfinite(amiss[id(one)])][:most] or every[:1], count


def _evolved(fit: Fit, low: Array, high: Array, seed: int) -> FitPoint | None:
    """The rows of the best dimensions that differential evolution finds in a box; None where it finds none that reaches all rows."""

    def costs(Z: Array) -> Any:
        here, came = fit.begun(Z)
        return np.where(came, (fit.missed(here) ** 2).sum(axis=(0, 2)), 1e6)

    found = scipy.optimize.differential_evolution(
        costs,
        scipy.optimize.Bounds(low, high),
        vectorized=True,
        updating="deferred",
        maxiter=20,
        popsize=5,
        rng=seed,
        polish=False,
    )
    here, came = fit.begun(found.x[:, None])
    return here if came[0] else None


def _large(sizes: Sequence[float], declared: Mechanism) -> Iterator[str]:
    """What is said of mechanisms much larger than the declared one."""
    here = float(distances(declared).max(initial=0.0))
    if (many := sum(size > 10.0 * here for size in sizes)) and here:
        grown = f"{many} of {len(sizes)} are more than ten times as large as the declared one ({here:.3g}), up to {max(sizes):.3g}"
        yield f'{grown}; bounds= or conditions={{"size": (None, most)}} keep links short.'


class FittedSynthesis:
    """What a fit asks, and its answers."""

    def __init__(
        self, problem: RowProblem, tasks: Any, over: Any, driver: str | None, output: str | None, faults: list[str]
    ) -> None:
        self.problem, self.over, self.driver, self.output = problem, over, driver, output
        # exact ones come back in their own frames; the error of a place is that of the origin of its frame, which is another one here
        if elsewhere := list(problem.first.poses):
            first = f"the first pose of {', '.join(map(repr, elsewhere))} is not the identity"
            faults.append(f"{first}: a fit begins there; measure its poses from the first one")
        try:
            self.fit = Fit(problem, tasks, over)
        except DeclarationError as error:
            faults += error.faults
        if (np.nan_to_num(problem.asked, nan=np.inf) == np.nan_to_num(problem.asked[:1], nan=np.inf)).all():
            faults.append("all rows ask the same: a mechanism at rest does it; ask for different places, or give at=")
        if faults:
            raise DeclarationError(problem.name, faults)

    def answered(
        self,
        fit: str | None,
        bounds: Mapping[str, Any],
        limits: Sequence[Any],
        goals: Sequence[tuple[Measure, float]],
        starts: int,
        seed: int,
        progress: Callable[[str], None] | None,
        exact: Iterable[Array],
    ) -> Syntheses:
        """What comes nearest to what is asked, or meets it and is best in something else."""
        goal = self.limit(goals[0][0], sign=goals[0][1]) if goals else None
        limited = [self.limit(measure, least, most) for _, measure, least, most in limits]
        return self.answer(fitted(self.fit, fit, starts, bounds, goal, limited, seed, progress, exact))

    def rows(self, here: FitPoint) -> tuple[Mechanism, Array]:
        """The mechanism of fitted rows, and its coordinates ``(rows, F)``."""
        p = self.problem
        q = p.system.coordinates_of(here.x[:, : self.fit.own, 0]).T[:, : len(p.m.freedom_names())]
        m = p.unknowns.mechanism(p.outside(here.z)[:, 0])
        return m.replace(start=dict(zip(m.freedom_names(), q[0].tolist(), strict=True))), q

    def limit(
        self, measure: Measure, least: float | None = None, most: float | None = None, sign: float = 1.0
    ) -> RowLimit:
        """A quantity of fitted rows, times a sign."""
        of = partial(self._measured, measure, sign, least is None and sign > 0)
        return RowLimit(of, least, most, not (measure.of_dimensions or self.over))

    def _measured(self, measure: Measure, sign: float, smooth: bool, here: FitPoint) -> Array:
        """A quantity ``(k, T)`` of mechanisms; NaN where it has no value."""
        values = self._together(measure, smooth, here)
        if values is None:
            each = (self.rows(self.fit.taken(here, np.array([i]))) for i in range(here.z.shape[1]))
            values = np.stack([measure(m, q, self.driver, smooth) for m, q in each], axis=1)
        return np.asarray(sign * values)

    @cached_property
    def _by_points(self) -> bool:
        """Whether no numbers are sought but those of points, and what has no part in dimensions."""
        return all(p.array in ("point", "factors") for own in self.problem.unknowns.places for p in own)

    @cached_property
    def _squared(self) -> tuple[Array, Array, Array, Array]:
        """Squares of all distances of elements of a link: at some unknowns ``(u,)``, there ``(k,)``, and their derivatives ``(k, u)`` and
        ``(k, u, u)``: they are polynomials of degree two.
        """
        p, u = self.problem, len(self.fit.z0)
        z, unit = np.random.default_rng(0).normal(size=u), np.eye(u)

        def squares(*ways: Array) -> Array:
            return np.asarray(distances(p.unknowns.mechanism(p.outside(sum(ways, z)[:, None])[:, 0])) ** 2)

        base, ahead = squares(), np.stack([squares(e) for e in unit])
        both = np.zeros((u, u, len(base)))
        for i, j in combinations_with_replacement(range(u), 2):
            both[i, j] = both[j, i] = squares(unit[i], unit[j]) - ahead[i] - ahead[j] + base
        return z, base, (ahead - base - 0.5 * both[range(u), range(u)]).T, both.transpose(2, 0, 1)

    def _lengths(self, what: Any, smooth: bool, z: Array) -> Array:
        """Distances of elements of a link, or their ratios ``(k, T)``; the largest alone, where that need not be ``smooth``."""
        begin, base, slope, both = self._squared
        d = z - begin[:, None]
        squares = base[:, None] + slope @ d + 0.5 * np.einsum("kij,it,jt->kt", both, d, d)
        lengths = np.sqrt(np.maximum(squares, 0.0))
        if what == "ratio":
            lengths = (lengths[:, None] / lengths).reshape(-1, z.shape[1])
        return lengths if smooth else lengths.max(axis=0, keepdims=True)

    def _together(self, measure: Measure, smooth: bool, here: FitPoint) -> Array | None:
        """A quantity of mechanisms side by side, at the states of their rows; None where it has to be taken of each alone."""
        p, u, what, T = self.problem, self.problem.unknowns, measure.output or measure.what, here.z.shape[1]
        if measure.of_dimensions:
            return self._lengths(what, smooth, here.z) if self._by_points else None
        alone = {name: f.what for name, f in u.fields.items() if isinstance(f, ItemField) and f.one_by_one}
        # the place of a named point matters to what is said of it alone
        unread = {n for n, of in alone.items() if of == "links" and not str(what).startswith(n.rpartition(".")[0])}
        drivers = [self.driver] if self.over is None else [*self.over]
        if callable(what) or alone.keys() - unread or None in drivers or len(self.fit.over) < (self.over is not None):
            return None
        rows = slice(self.fit.own, None) if len(self.fit.over) else slice(None)
        names, states = p.m.freedom_names(), np.moveaxis(here.x[:, rows], 1, 2)
        q = p.system.coordinates_of(states.reshape(len(states), -1))[: len(names)]
        own = {name: f for name, f in u.fields.items() if name not in alone}
        values, which = p.outside(here.z), np.repeat(np.arange(T), states.shape[2])
        m = u.mechanism(values[:, 0]).replace(start=dict(zip(names, q[:, 0].tolist(), strict=True)))
        m = with_unit_effort(m, what) if measure.output else m
        motions = {p.m.full_name(name): q[names.index(p.m.full_name(name))][:, None] for name in drivers if name}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MechgraphWarning)
            line = Pipeline(DriverMotion(m, motions), Options(redundant="minimum_norm" if measure.output else "nan"))
            par = line.system.par
            numbers = varied(m, own, values[[name in own for name in u.names]]).numbers
            made = numbers.with_rest(line.m).parameters(line.m, par.offset, par.origin, par.L)
            system = line.system.with_parameters(replace(made, mass=np.broadcast_to(made.mass, (len(m.links), T))))
            begin = line.system.state_of(q)
            kernel = in_kernel(line, system.cases(which), m.loads, len(which))
            if kernel is not None:
                kernel.begin(begin)
            starts = Starts(begin, lambda at: system.cases(which[at]), m.loads, 1, kernel)
            found = Solution(line.run(starts, (len(which), 1)).trajectory)
            if measure.output:
                told = np.arcsin(transmission_index(found, what, tuple(motions)))
            else:
                told = quantity(found, what, what)
        return np.asarray(told).reshape(T, -1).T

    def answer(self, found: Fitted) -> Syntheses:
        """The optima found, the best first."""
        p, points = self.problem, found.points
        made = [self.rows(here) for here in points]
        errors = [float(self.fit.errors(here).max(initial=0.0)) for here in points]
        shape = (self.fit.own, len(p.m.links), 4, 4)
        closed = [float(np.abs(here.at.residual).max(initial=0.0)) for here in points]
        told = tuple(fitnesses([m for m, _ in made], np.array([q for _, q in made]), self.driver, self.output, errors))
        return Syntheses(
            p.first.declared,
            tuple(m for m, _ in made),
            p.unknowns.names,
            np.array([p.outside(here.z)[:, 0] for here in points]).reshape(len(points), len(p.unknowns.names)),
            np.array([p.first.poses_of(here.at.here)[: self.fit.own] for here in points]).reshape(-1, *shape),
            np.array([q for _, q in made]).reshape(len(made), self.fit.own, len(p.m.freedom_names())),
            np.array(closed),
            ComplexSyntheses(np.zeros((0, len(p.unknowns.names)))),
            None,
            (),
            0,
            "searched",
            (*found.evidence, *_large([one.size for one in told], p.first.declared)),
            np.array([1.0 / self.fit.margins(here).min() for here in points]),
            told,
            driver=self.driver,
            asked=p.tasks,
        )
