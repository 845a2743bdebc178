"""Newton's method for batches: with a problem's own linear equations along tracks, and Gauss-Newton of least change for assembly.

Tracks: the polylines of path values along which solutions are followed, the nodes found on them, and what lies between nodes.

Hermite interpolation in Newton's form: values and rates at a few nodes, evaluated between them or behind the last.

Source: Stoer and Bulirsch, Introduction to Numerical Analysis, 2002, section 2.1.5 (divided differences over double nodes).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, fields, replace
from functools import cache, cached_property
from typing import Any, Protocol

import numpy as np

from mechgraph.maths.se3 import Array, Index, Mask
from mechgraph.maths.tolerances import PATH
from mechgraph.memo import dataclass

LONGEST = 0.5
"""Longest step (largest increment) that is taken at once."""


def largest(values: Array) -> Array:
    """Largest sizes ``(n,)`` of the columns of values ``(m, n)``."""
    return np.asarray(np.maximum.reduce(np.abs(values), axis=0, initial=0.0))


class Factored(Protocol):
    """The linearized equations at a batch of points, factored."""

    @property
    def condition(self) -> Array:
        """Condition numbers ``(n,)``."""

    def solve(self, b: Array) -> Array:
        """Increments ``(F, k, n)`` for right sides ``(m, k, n)``."""

    def residual_size(self, r: Array) -> Array:
        """Largest entry ``(n,)`` of residuals ``(m, n)``, each in the measure of what it belongs to."""

    def motions(self) -> Array:
        """Increments ``(F, p, n)`` that the equations leave free with the path values at rest."""

    def regular_between(self, ends: Any, a: Index, b: Index) -> Mask:
        """Whether no matrix on the parabola through those at ``ends`` ``a (n,)``, here and at ``b`` is singular or nearly so, ``(n,)``."""


class Problem(Protocol):
    """Equations along tracks: states ``x (nx, n)``, increments ``dq (F, n)``, path values ``drive (d, n)``, numbers of ``tracks (n,)``."""

    size: tuple[int, int]
    """Numbers of increments F and of path values d."""
    paced: bool
    """Whether the equations may change more slowly than the path values, see ``pace``."""
    bend: float
    """Greatest curvature of curves and surfaces in the equations; 0 where there are none."""

    def at(self, x: Array, drive: Array, tracks: Index) -> Any:
        """The equations at (a copy of) states, the path values put in."""

    def chosen(self, point: Any, which: Index) -> Index:
        """Forms (by number) of the linear equations at the points: ``which``, or others where these are ill-conditioned."""

    def factored(self, point: Any, which: Index) -> Any:
        """The linear equations at points, each in its form."""

    def sensitivity(self, point: Any, factored: Any) -> Array:
        """Rates ``Z (F, d, n)`` of the increments with the path values."""

    def advance(self, x: Array, dq: Array, tracks: Index) -> Array:
        """States after increments."""

    def difference(self, x1: Array, x0: Array) -> Array:
        """Increments from ``x0`` to ``x1``."""

    def tangent(self, dq: Array, rates: Array) -> Array:
        """Rates of increments from the rates at the states to which they lead."""

    def pace(self, x: Array, rates: Array) -> Array:
        """How fast the equations change at rates ``(F, n)``, at most one: 0 where steps may be as long as the certificate allows."""

    def corrigible(self, dq: Array, which: Index) -> Array:
        """Increments without the part that no correction can change (freedoms that are held)."""


@dataclass
class Work:
    """How much was computed.

    Attributes
    ----------
    positions : positions asked for.
    nodes : points at which the path was found in between, ``careful`` of them step by step (near a fold or a crossing).
    evaluations : states at which the equations were evaluated, in ``calls`` batches.
    factorizations : matrices factored.
    groups : structural groups in which they were solved one after the other; 0 where the matrices were factored as a whole.
    """

    positions: int = 0
    nodes: int = 0
    careful: int = 0
    evaluations: int = 0
    calls: int = 0
    factorizations: int = 0
    groups: int = 0

    def __str__(self) -> str:
        shown = [name for name in self.__dataclass_fields__ if name != "groups" or self.groups]
        return ", ".join(f"{getattr(self, name)} {name}" for name in shown)

    @property
    def counts(self) -> tuple[tuple[int, str], ...]:
        """What a summary shows: numbers, and of what."""
        return (
            (self.positions, "position"),
            (self.nodes, "node of the path"),
            (self.evaluations, "evaluation"),
            (self.factorizations, "factorization"),
            *([(self.groups, "group")] if self.groups else []),
        )


@dataclass(frozen=True)
class Closed:
    """Newton's outcome for a batch: states, sum of corrections ``(F, n)``, sensitivities, conditions, forms, which were closed.

    ``point`` is the evaluation at ``x`` where that was the last thing done for all of them.
    """

    x: Array
    total: Array
    Z: Array
    condition: Array
    which: Index
    done: Mask
    point: Any = None

    @cached_property
    def correction(self) -> Array:
        """Largest correction of a freedom ``(n,)``."""
        return largest(self.total)


@dataclass
class Newton:
    """Newton's method for a batch of points of a problem."""

    problem: Problem
    work: Work = field(default_factory=Work)

    def nodes(self, x: Array, drive: Array, tracks: Index, which: Index, goal: float) -> Closed:
        """States corrected until the last step is below ``goal``, with their sensitivities."""
        return self._closed(x, drive, tracks, which, goal, 0.0)

    def close(self, x: Array, drive: Array, tracks: Index, which: Index) -> Closed:
        """States corrected until the residual is rounding."""
        return self._closed(x, drive, tracks, which, 0.0, PATH.closed)

    def _closed(self, x: Array, drive: Array, tracks: Index, which: Index, step_goal: float, goal: float) -> Closed:
        """States corrected until the last step is below one goal, or the residual below the other, or at rounding and no longer falls.

        States that a step leads too far away are left; those ``at`` are corrected further.
        """
        problem, (F, d), n = self.problem, self.problem.size, x.shape[1]
        x, which, at = x.copy(), which.copy(), np.arange(n)
        total, Z, condition = np.zeros((F, n)), np.zeros((F, d, n)), np.full(n, np.inf)
        before, done, chosen_again = condition.copy(), np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
        for _ in range(PATH.iterations):
            point = problem.at(x[:, at], drive[:, at], tracks[at])
            self.work.evaluations += at.size
            self.work.calls += 1
            left = largest(point.residual)
            if goal > 0.0:
                near = (left <= goal) | (
                    (left > 0.5 * before[at]) & (left <= np.maximum(PATH.accepted, point.rounding))
                )
                x[:, at[near]], done[at[near]] = point.x[:, near], True
                if near.all():
                    return Closed(x, total, Z, condition, which, done, point if at.size == n else None)
                if near.any():
                    keep = np.flatnonzero(~near)
                    at, point, left = at[keep], point.part(keep), left[keep]
            f = problem.factored(point, which[at])
            self.work.factorizations += at.size
            step = f.solve(-point.residual[:, None])[:, 0]
            size = largest(step)
            finite = np.isfinite(size)
            step = np.where(finite, step, 0.0) * np.minimum(1.0, LONGEST / np.maximum(size, LONGEST))
            x[:, at] = problem.advance(point.x, step, tracks[at])
            total[:, at] += step
            # that of a small loop far from the origin is large beside the loop
            rounded = (left > 0.5 * before[at]) & (left <= point.rounding)
            before[at] = left
            small = size <= step_goal
            if step_goal <= PATH.node and small.any():
                # the rates of a node err by the last step times the condition: poor ones are closed further, down to rounding
                poor = np.maximum(f.condition, 1.0)
                small &= rounded | (size <= np.maximum(PATH.rates / poor, PATH.rounding * poor))
            # rows that were left out as dependent are not where a last step leaves their residual as large as it is: another form is tried
            # once. A residual 30 times the step is no matter of sizes: rows are of size one, with a few freedoms each
            unmet = small & (left > np.maximum(30.0 * size, 10.0 * PATH.accepted))
            if unmet.any():
                unmet &= largest(point.residual + point.closure_rates(step)) > 0.5 * left
            again = unmet & ~chosen_again[at]
            if again.any():
                which[at[again]] = problem.chosen(
                    point.part(np.flatnonzero(again)), np.full(np.count_nonzero(again), -1)
                )
                chosen_again[at[again]] = True
            small &= ~unmet
            if small.any():
                Z[:, :, at[small]] = problem.sensitivity(point, f)[:, :, small]
                condition[at[small]], done[at[small]] = f.condition[small], True
            at = at[((finite & ~small & ~unmet) | again) & (largest(total[:, at]) <= PATH.lost)]
            if not at.size:
                break
        return Closed(x, total, Z, condition, which, done)


def least_norm_steps(J: Array, r: Array, tolerance: float) -> Array:
    """Smallest ``dq (n, T)`` with least ``|J dq + r|`` for matrices ``(m, n, T)`` and residuals ``(m, T)``; NaN where one is not finite.

    Singular values below ``tolerance`` times the largest are dropped.
    """
    finite = np.isfinite(J).all(axis=(0, 1)) & np.isfinite(r).all(axis=0)
    inverse = np.linalg.pinv(np.moveaxis(np.where(finite, J, 0.0), -1, 0), rcond=tolerance)
    return np.where(finite, -np.einsum("tnm,mt->nt", inverse, np.where(finite, r, 0.0)), np.nan)


def closest_zeros(
    evaluate: Callable[[Array], Any],
    least: Callable[[Any], Array],
    advance: Callable[[Array, Array], Array],
    x: Array,
    tolerance: float,
) -> tuple[Array, Array]:
    """Gauss-Newton with limited steps from points ``x (nx, T)``: the zero of the residual near to each, or the best point found.

    ``evaluate(x)`` gives a point with ``residual (m, T)``, ``least(point)`` the smallest steps ``(n, T)`` that take it to zero. Steps are
    limited (largest component) and halved while the residual grows; after eight steps without gain a point is left. Converges linearly to
    double roots. Returns the points and the largest residual component at each, ``(T,)``.
    """
    x = x.copy()
    size = np.abs(evaluate(x).residual).max(axis=0, initial=0.0)
    best, best_size, stalled = x.copy(), size.copy(), np.zeros(len(size), dtype=np.intp)
    at = np.flatnonzero(size > tolerance)
    for _ in range(60):
        if not at.size:
            break
        point = evaluate(x[:, at])
        before, step = np.linalg.norm(point.residual, axis=0), least(point)
        biggest = np.abs(step).max(axis=0, initial=0.0)
        moves = np.flatnonzero(np.isfinite(biggest) & (biggest > 0))
        at, before, biggest = at[moves], before[moves], biggest[moves]
        step = step[:, moves] * np.minimum(1.0, LONGEST / biggest)
        left, begin = np.arange(at.size), x[:, at]
        for _ in range(6):
            if not left.size:
                break
            trial = advance(begin[:, left], step[:, left])
            r = evaluate(trial).residual
            x[:, at[left]], size[at[left]] = trial, np.abs(r).max(axis=0, initial=0.0)
            gains = (np.linalg.norm(r, axis=0) < before[left]) | (size[at[left]] <= tolerance)
            # short steps are taken whole: in a narrow bent valley a step gains nothing until the next one has corrected it
            worse = ~gains & (biggest[left] > 0.1 * LONGEST)
            left = left[worse]
            step[:, left] *= 0.5
        gained = at[size[at] < 0.999 * best_size[at]]
        stalled[at] += 1
        stalled[gained] = 0
        best[:, gained], best_size[gained] = x[:, gained], size[gained]
        at = at[(size[at] > tolerance) & (stalled[at] <= 8) & ~((best_size[at] < 1e-9) & (stalled[at] > 1))]
    return best, best_size


BENT = 1e-12
"""Distance from which on a point is off the line of the points beside it: more than rounding."""


def places_of(points: Array) -> Array:
    """Lengths ``(M,)`` along a polyline ``(d, M)`` up to each of its points."""
    return np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(points) ** 2).sum(axis=0)))])


class Paths:
    """Polylines of path values: for every track its ``points (d, M)``, the first one where it starts.

    ``stops``: for every track which points no step may pass over.
    """

    def __init__(self, points: list[Array], stops: list[Mask] | None = None) -> None:
        self.points = points
        self.stops = stops or [np.zeros(p.shape[1], dtype=bool) for p in points]
        self.length = [places_of(p) for p in points]
        self.end = np.array([length[-1] for length in self.length])
        self.count = count = np.array([len(length) for length in self.length])
        self._last = np.cumsum(count) - 1
        self._first = self._last - count + 1
        self._second = np.minimum(self._first + 1, self._last)
        # one rising key for all tracks: place on the track plus the lengths of the tracks before it
        self._offset = np.concatenate([[0.0], np.cumsum(self.end + 1.0)[:-1]])
        self._all = np.concatenate(points, axis=1)
        self._places = np.concatenate(self.length)
        self._key = self._places + np.repeat(self._offset, count)
        # of the leg that leads to every point: where it begins (a first point is a leg of its own), and what it adds
        begin = np.arange(len(self._key)) - 1
        begin[self._first] += 1
        self._begin, self._from = self._all[:, begin], self._places[begin]
        self._way, self._added = self._places - self._from, self._all - self._begin
        self._way[self._way == 0] = 1.0
        if len(self._all) == 1:  # a start alone has the direction of growing values
            self._added[:, self._first] = 1.0
        self.bent = bool((count > 2).any())
        """Whether there are points between the ends, at which paths may turn."""

    @property
    def bends(self) -> tuple[Index, Array]:
        """Tracks and places of the points at which a path turns."""
        unit, track = self._added / self._way, np.repeat(np.arange(len(self.count)), self.count)
        inner = np.flatnonzero((track[1:-1] == track[:-2]) & (track[1:-1] == track[2:])) + 1
        change = np.abs(unit[:, inner + 1] - unit[:, inner]).max(axis=0, initial=0.0)
        turns = change * np.minimum(self._way[inner], self._way[inner + 1]) > BENT
        return track[inner[turns]], self._places[inner[turns]]

    def drive(self, tracks: Index, at: Array) -> Array:
        """Path values ``(d, n)`` at places of tracks; behind the end and before the start straight on."""
        point = self._last.take(tracks)
        if self.bent:
            found = self._key.searchsorted(at + self._offset.take(tracks))
            point = np.minimum(np.maximum(found, self._second.take(tracks)), point)
        u = (at - self._from.take(point)) / self._way.take(point)
        values: Array = self._begin.take(point, axis=1) + u * self._added.take(point, axis=1)
        ends = u == 1.0
        if np.count_nonzero(ends):  # the ends themselves are met exactly
            values = np.where(ends, self._all.take(point, axis=1), values)
        return values

    def step(self, tracks: Index, at: Array, h: Array) -> Array:
        """Where a step of at most ``h`` leads: to the furthest point within it up to which the path is nearly straight."""
        out = np.minimum(at + h, self.end.take(tracks))
        if not self.bent:
            return out
        inside = self._key.searchsorted(out + self._offset.take(tracks), side="right") - 1
        for i in (self._places.take(inside) > at).nonzero()[0]:
            out[i] = self._furthest(int(tracks[i]), float(at[i]), float(out[i]))
        return out

    def _furthest(self, track: int, at: float, limit: float) -> float:
        length, points = self.length[track], self.points[track]
        ahead = np.arange(*np.searchsorted(length, (at, limit), side="right"))
        if not ahead.size:  # met by rounding of the common key only
            return limit
        here = self.drive(np.array([track]), np.array([at]))
        chord = np.sqrt(((points[:, ahead] - here) ** 2).sum(axis=0))
        ends = (chord < PATH.straight * (length[ahead] - at)) | np.append(False, self.stops[track][ahead][:-1])
        bent = np.flatnonzero(ends)
        return float(length[ahead[max(int(bent[0]) - 1, 0)] if bent.size else ahead[-1]])


@dataclass(frozen=True)
class Nodes:
    """Points on tracks, in order: state ``x (nx, K)``, sensitivity ``Z (F, d, K)``, path values ``drive (d, K)``, ``track``, ``place``,
    form ``which``, ``condition`` and whether the step that leads here is ``sure`` ``(K,)``.

    Where the form changes a node stands twice, so that every step between two nodes has one form.
    """

    x: Array
    Z: Array
    drive: Array
    track: Index
    place: Array
    which: Index
    condition: Array
    sure: Mask

    def __len__(self) -> int:
        return len(self.place)

    @classmethod
    def closed(cls, found: Closed, drive: Array, track: Index, place: Array, sure: bool) -> Nodes:
        """Nodes from what Newton's method found at path values ``drive (d, n)``."""
        return cls(found.x, found.Z, drive, track, place, found.which, found.condition, np.full(len(place), sure))

    def take(self, at: Index | Mask) -> Nodes:
        """Some of the nodes."""
        return Nodes(*[getattr(self, name)[..., at] for name in self.__dataclass_fields__])

    def ends(self, left: Index, right: Index) -> tuple[Nodes, Index]:
        """The nodes at the ends of steps, each of them once, and the places of both ends ``(2, n)`` among them."""
        used, places = np.unique(np.concatenate([left, right]), return_inverse=True)
        return self.take(used), places.reshape(2, -1)

    def replaced(self, new: Nodes, at: Index) -> Nodes:
        """The nodes with those ``at`` replaced."""
        values = {f.name: getattr(self, f.name).copy() for f in fields(Nodes)}
        for name, column in values.items():
            column[..., at] = getattr(new, name)
        return Nodes(**values)

    def moved_by(self, tracks: int) -> Nodes:
        """The same on tracks that are numbered higher."""
        return replace(self, track=self.track + tracks)

    @staticmethod
    def join(parts: list[Nodes]) -> Nodes:
        """Nodes sorted by track and place (equal ones in the order given)."""
        joined = [np.concatenate([getattr(p, f.name) for p in parts], axis=-1) for f in fields(Nodes)]
        track, place = joined[3], joined[4]
        order = np.lexsort((place, track))
        return Nodes(*(values[..., order] for values in joined))

    @property
    def steps(self) -> tuple[Index, Index]:
        """First and last node of every step: neighbors on a track, apart."""
        left = np.flatnonzero((self.track[1:] == self.track[:-1]) & (self.place[1:] > self.place[:-1]))
        return left, left + 1


STRAIGHT_ON = 1 - 1e-9
"""Cosine between two steps above which a track goes straight on: rounding, no corner."""
CLOSEST = 1 / 4
"""Distance of two nodes, in parts of a step beside them, below which only the step's own nodes give its polynomial: divided differences
over nodes at a distance d err by the rounding of the nodes times (h / d)^3, and polynomials through nodes that crowd before a dead point
miss what lies in the wide step before these."""


def divided_differences(places: Array, values: Array, rates: Array) -> tuple[Array, Array]:
    """Coefficients ``(2w, F, n)`` and double nodes ``(2w, n)`` of the polynomials through ``w`` nodes with value and rate.

    ``places (w, n)``, ``values (w, F, n)``, ``rates (w, F, n)``; every one of the ``n`` polynomials has its own nodes.
    """
    z = places.repeat(2, axis=0)
    coefficients = [values[0]]
    between = places[1:] - places[:-1]
    # of first order: the rate at a double node, the slope of the chord between two
    first = np.empty((len(z) - 1, *values.shape[1:]), dtype=values.dtype)
    first[::2] = rates
    if len(between):
        first[1::2] = (values[1:] - values[:-1]) / between[:, None]
    column = first
    coefficients.append(column[0])
    for order in range(2, len(z)):
        column = (column[1:] - column[:-1]) / (z[order:] - z[:-order])[:, None]
        coefficients.append(column[0])
    return np.array(coefficients), z


def newton_form(coefficients: Array, nodes: Array, at: Array) -> Array:
    """``c_0 + (s - z_0) (c_1 + (s - z_1) (c_2 + ...))`` at ``at (n,)``, ``(F, n)``."""
    out = coefficients[-1].copy()
    for order in range(len(coefficients) - 2, -1, -1):
        out *= at - nodes[order]
        out += coefficients[order]
    return out


def cubic(values: Array, rates: Array, rates_there: Array, width: Array, at: Array) -> Array:
    """Cubics ``(F, n)`` at places ``at (n,)`` that are zero at 0 and ``values`` at ``width (n,)``, with rates given at both."""
    s = at / width
    left = 1.0 - s
    part = at * left
    out = values * (s * s * (1.0 + 2.0 * left))
    out += rates * (part * left)
    out -= rates_there * (part * s)
    return np.asarray(out)


def through(problem: Problem, nodes: Nodes, base: Nodes, direction: Array, at: Array) -> Array:
    """States ``(nx, n)`` at places ``at (n,)`` of the polynomial through nodes of one track, path values changing in a ``direction (d,)``.

    ``base``: ``n`` times the node from which increments are measured.
    """
    dq = problem.difference(nodes.x, np.repeat(base.x[:, :1], len(nodes), axis=1))
    rates = problem.tangent(dq, (nodes.Z * direction[:, None]).sum(axis=1))
    form = divided_differences((nodes.place - base.place[0])[:, None], dq.T[:, :, None], rates.T[:, :, None])
    coefficients, places = (np.repeat(values, len(at), axis=-1) for values in form)
    ahead = problem.corrigible(newton_form(coefficients, places, at - base.place), base.which)
    return problem.advance(base.x, ahead, base.track)


class Interpolation:
    """States between nodes of tracks: Hermite interpolation through the nodes beside a step, as far as a track goes straight on.

    What lies off the chord between two nodes is added by the sensitivity to the path values.
    """

    def __init__(self, problem: Problem, nodes: Nodes) -> None:
        self.problem, self.nodes = problem, nodes
        self.left, self.right = nodes.steps
        slope = nodes.drive[:, self.right] - nodes.drive[:, self.left]
        self.slope = slope / (nodes.place[self.right] - nodes.place[self.left])
        self._coefficients, self._z = self._polynomials()

    @property
    def begin(self) -> Index:
        """For every step the one with which its track begins, at the place zero."""
        tracks, begin = self.nodes.track[self.left], np.flatnonzero(self.nodes.place[self.left] == 0.0)
        return np.asarray(begin[np.searchsorted(tracks[begin], tracks)])

    def last(self, tracks: Index, ends: Array) -> Index:
        """The steps that lead to the ``ends`` of tracks."""
        return self.find(tracks, np.nextafter(ends[tracks], -np.inf))

    def find(self, tracks: Index, at: Array) -> Index:
        """Steps in which places of tracks lie."""
        span = float(self.nodes.place.max(initial=0.0)) + 1.0
        key = self.nodes.track[self.left] * span + self.nodes.place[self.left]
        step = np.searchsorted(key, tracks * span + at, side="right") - 1
        first = np.searchsorted(self.nodes.track[self.left], tracks, side="left")
        last = np.searchsorted(self.nodes.track[self.left], tracks, side="right") - 1
        return np.clip(step, first, last)

    def __call__(self, step: Index, at: Array, drive: Array) -> Array:
        """States ``(nx, n)`` in steps at places ``at (n,)`` with path values ``drive (d, n)`` (not put in yet)."""
        nodes, left = self.nodes, self.left[step]
        u = at - nodes.place[left]
        dq = newton_form(self._coefficients[:, :, step], self._z[:, step], u)
        off = drive - (nodes.drive[:, left] + u * self.slope[:, step])
        if np.abs(off).max(initial=0.0) > 0.0:
            right = self.right[step]
            part = u / (nodes.place[right] - nodes.place[left])
            dq += (((1 - part) * nodes.Z[:, :, left] + part * nodes.Z[:, :, right]) * off).sum(axis=1)
        return self.problem.advance(nodes.x[:, left], dq, nodes.track[left])

    def _windows(self) -> list[tuple[Index, Index]]:
        """Steps by the number of nodes through which they are interpolated, with these nodes ``(width, n)``, nearest first."""
        n = len(self.left)
        if not n:
            return []
        length = np.sqrt((self.slope * self.slope).sum(axis=0))
        unit = self.slope / np.where(length > 0, length, 1.0)
        straight = (unit[:, 1:] * unit[:, :-1]).sum(axis=0) > STRAIGHT_ON
        joined = (self.right[:-1] == self.left[1:]) & straight
        run = np.concatenate([[0], np.cumsum(~joined)])
        begin = self.left[np.searchsorted(run, run, side="left")]
        end = self.right[np.searchsorted(run, run, side="right") - 1]
        width = np.minimum(PATH.window, end - begin + 1)
        place, first = self.nodes.place, np.clip(self.left - (width - 2) // 2, begin, end - width + 1)
        for k in range(PATH.window - 1):
            a = np.minimum(first + k, end - 1)
            inside = (k < width - 1) & (a + 1 - self.left != 1)
            near = place[a + 1] - place[a] < CLOSEST * (place[self.right] - place[self.left])
            width = np.where(inside & near, 2, width)
        first = np.where(width == 2, self.left, first)
        out = []
        for w in np.unique(width):
            i = np.flatnonzero(width == w)
            names = first[i] + np.arange(w)[:, None]
            order = np.argsort(np.abs(names - self.left[i] - 0.25), axis=0, kind="stable")
            out.append((i, np.take_along_axis(names, order, axis=0)))
        return out

    def _polynomials(self) -> tuple[Array, Array]:
        """Coefficients ``(2 width, F, steps)`` and double nodes ``(2 width, steps)``, from the left node of every step."""
        nodes, windows = self.nodes, self._windows()
        width = max((len(names) for _, names in windows), default=1)
        c = np.zeros((2 * width, nodes.Z.shape[0], len(self.left)))
        z = np.zeros((2 * width, len(self.left)))
        for i, names in windows:
            left = self.left[i]
            dq = self.problem.difference(nodes.x[:, names], nodes.x[:, None, left])
            rates = (nodes.Z[:, :, names] * self.slope[:, None, i]).sum(axis=1)
            rates = self.problem.tangent(dq, rates)
            places = nodes.place[names] - nodes.place[left]
            parts = divided_differences(places, dq.swapaxes(0, 1), rates.swapaxes(0, 1))
            c[: 2 * len(names), :, i], z[: 2 * len(names), i] = parts
        return c, z


POINTS_FOR = {0.01: 3, 0.1: 4, 0.5: 6, 1.0: 8}
"""Points of a part of a step between nodes: what is integrated over it is exact to rounding, as with eight over the whole of it."""


class Rule:
    """The rule with ``count`` points in a step from -1 to 1."""

    def __init__(self, count: int) -> None:
        self.count = count
        self.points, weights = np.polynomial.legendre.leggauss(count)
        self.places = np.concatenate([[-1.0], self.points, [1.0]])
        """The points of a step and its ends."""
        self.to_series = (
            weights[:, None] * np.polynomial.legendre.legvander(self.points, count - 1) * (np.arange(count) + 0.5)
        )
        """Coefficients of Legendre's series from values at the points."""

    def integrals(self, t: Array) -> Array:
        """Half the integrals of Legendre's polynomials from -1 to ``t (n,)``, ``(n, count)``."""
        P = np.polynomial.legendre.legvander(t, self.count)
        out = np.empty((len(t), self.count))
        out[:, 0] = 0.5 * (t + 1.0)
        k = np.arange(1, self.count)
        out[:, 1:] = 0.5 * (P[:, 2:] - P[:, : self.count - 1]) / (2 * k + 1)
        return out


@cache
def _rule(count: int) -> Rule:
    return Rule(count)


def rule(part: float = 1.0) -> Rule:
    """The rule for parts of steps between nodes."""
    return _rule(next((count for most, count in POINTS_FOR.items() if part <= most), max(POINTS_FOR.values())))
