"""Positions along a path of driver values: continuation on coarse nodes, then one batched Newton for all positions.

The nodes are found one after the other with a second-order predictor and step control; every position between two nodes is
predicted from their values and rates (cubic Hermite, and the sensitivity to the drivers for what lies off the chord) and
corrected together with all others. Source: Allgower and Georg, Introduction to Numerical Continuation Methods, 2003,
chapters 2 and 6.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.motion.assembly import close, state_rows
from mechgraph.motion.system import Configuration, Index, System
from mechgraph.numerics.linear import Choice, ChosenSystem, Factor, choose

CONVERGED = 1e-13
"""Closure residual that Newton aims at."""
ACCEPTED = 1e-11
"""Closure residual with which a position counts as solved where rounding allows no better."""
NODE_CONVERGED = 1e-5
"""Closure residual at which a node is good enough to predict from, after one more step."""
ITERATIONS = 8
"""Most Newton iterations at a position."""
GAPS = 20
"""Most gaps behind which a path is taken up again."""
SURE_STEP = 0.01
"""Steps below this are closed fully: the end of the reach is near."""
LONGEST_STEP = 0.35
"""Longest step between nodes, in driver space (radians, or lengths / L)."""
STRAIGHT = 0.98
"""Smallest ratio of chord to path between two nodes; a path that bends or turns back gets a node there."""
SHORTEST_STEP = 1e-7
"""Step at which the continuation gives up."""
CORRECTION = 0.06
"""Largest correction that a node may need; keeps the continuation on its branch."""
AIM = 0.005
"""Correction that the step control aims at."""
SINGULAR = 1e9
"""Condition number of the closure equations above which a position counts as a dead point."""


class Status(Enum):
    """Outcome at one position; the value is the text that a table shows."""

    OK = "ok"
    DEAD_POINT = "dead point"
    OUT_OF_REACH = "out of reach"
    BEYOND_DEAD_POINT = "beyond a dead point"
    NOT_CLOSED = "loops not closed"


@dataclass
class Node:
    """A closed position on the path: state, sensitivity ``Z (F, drivers)``, path length, driver values, choice index.

    ``condition`` of the chosen square part of the closure Jacobian and the ``sign`` of its determinant.
    """

    x: Array
    Z: Array
    at: float
    drive: Array
    choice: int
    condition: float
    sign: float


@dataclass
class Track:
    """The nodes of one case and how it ended."""

    nodes: list[Node] = field(default_factory=list)
    end: Status = Status.OK


@dataclass(frozen=True)
class Positions:
    """States ``(nx, C, N)``, statuses ``(C, N)``, and per position the index of the choice that serves it.

    ``here`` is the evaluation of all positions, where one batch covered them. ``tracks`` hold, for every case that was followed in
    one go, path lengths and states ``(nx, K)`` of the nodes and the path lengths of the positions.
    """

    x: Array
    status: np.ndarray
    choices: list[Choice]
    which: Index
    reached: Array
    here: Configuration | None = None
    tracks: tuple[tuple[Array, Array, Array] | None, ...] = ()


Case = tuple[Array, Index, np.ndarray, Array, Configuration | None, tuple[Array, Array, Array] | None]


class Follower:
    """Follows driver paths on one system. ``columns`` are the driven freedoms, ``keep`` freedoms preferably held."""

    def __init__(self, system: System, columns: Index, keep: Index | None = None) -> None:
        self.system = system
        self.columns = columns
        self.rows = state_rows(system, columns)
        self.keep = keep
        self.choices: list[Choice] = []

    # --- one point -----------------------------------------------------------------------------------------------------

    def choose_at(self, here: Configuration) -> int:
        """Index of a new choice of rows and columns made at a position."""
        self.choices.append(choose(here.J[:, :, 0], self.columns, keep=self.keep))
        return len(self.choices) - 1

    def correct(self, x: Array, choice: int, goal: float = CONVERGED) -> tuple[Configuration, Array, Array]:
        """Newton on the chosen rows and columns for a batch of states, until the closure residual is below ``goal``.

        Returns the last configuration, the sum of the corrections ``(F, T)`` and which positions converged.
        """
        total = np.zeros((self.system.n_freedoms, x.shape[1]))
        here = self.system.at(x)
        left = np.abs(here.residual).max(axis=0, initial=0.0)
        if not len(self.choices[choice].cols):
            return here, total, left <= max(goal, ACCEPTED)
        for round_ in range(ITERATIONS):
            part = np.flatnonzero(left > goal)
            if not part.size:
                break
            x = here.x.copy()
            if 4 * part.size > here.T or round_ == ITERATIONS - 1:
                dq = self.newton_step(here, choice)[:, part]
                total[:, part] += dq
                x[:, part] = self.system.advance(here.x[:, part], dq)
                here = self.system.at(x)
                before, left = left, np.abs(here.residual).max(axis=0, initial=0.0)
                if (left[part] > 0.5 * before[part]).all() and (left <= ACCEPTED).all():
                    break
            else:
                few, more, _ = self.correct(here.x[:, part], choice, goal)
                total[:, part] += more
                x[:, part] = few.x
                left[part] = np.abs(few.residual).max(axis=0, initial=0.0)
                here = self.system.at(x)
                break
        return here, total, left <= max(goal, ACCEPTED)

    def closed_again(self, x: Array, which: Index) -> tuple[Array, Array]:
        """States closed from near by, each with its choice; also the largest correction ``(T,)``, infinite where it failed."""
        out, shift = x.copy(), np.zeros(x.shape[1])
        for choice in np.unique(which):
            at = np.flatnonzero(which == choice)
            here, total, done = self.correct(x[:, at], int(choice))
            out[:, at] = here.x
            shift[at] = np.where(done, np.abs(total).max(axis=0, initial=0.0), np.inf)
        return out, shift

    def newton_step(self, here: Configuration, choice: int) -> Array:
        """One limited Newton step ``(F, T)`` at every state of a configuration."""
        chosen = self.choices[choice]
        J = here.J[np.ix_(chosen.rows, chosen.cols)]
        step = Factor(J).solve(-here.residual[chosen.rows][:, None])[:, 0]
        step = np.where(np.isfinite(step), step, 0.0)
        step *= np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=0), 1e-300))
        dq = np.zeros((self.system.n_freedoms, here.T))
        dq[chosen.cols] = step
        return dq

    def node(self, here: Configuration, at: float, drive: Array, choice: int) -> Node:
        """A node near a nearly closed position, brought closer by one step with the Jacobian that is there."""
        chosen = self.choices[choice]
        solver = ChosenSystem(here.J, [chosen], np.zeros(1, dtype=np.intp))
        Z = solver.solve(-here.J[:, self.columns])[:, :, 0]
        Z[self.columns, np.arange(len(self.columns))] = 1.0
        step = solver.solve(-here.residual[:, None])[:, 0]
        x = self.system.advance(here.x, np.where(np.isfinite(step), step, 0.0))
        return Node(x[:, 0], Z, at, drive, choice, float(solver.condition[0]), float(solver.signs()[0]))

    # --- one case ------------------------------------------------------------------------------------------------------

    def track(self, x: Array, values: Array, stops: Index | None = None) -> Track:
        """Follow driver values ``(d, N)`` from the closed state ``x (nx,)``; path points are the start and all values.

        Nodes do not pass over the positions in ``stops``.
        """
        points = np.concatenate([x[self.rows][:, None], values], axis=1)
        lengths = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(points, axis=1) ** 2).sum(axis=0)))])
        here = self.system.at(x[:, None])
        track = Track([self.node(here, 0.0, points[:, 0], self.choose_at(here))])
        if track.nodes[0].condition > SINGULAR:
            track.end = Status.DEAD_POINT
        halts = lengths[1:][stops] if stops is not None else np.zeros(0)
        h = 0.05
        end = lengths[-1]
        failures: list[Status] = []
        while track.nodes[-1].at < end and track.end is Status.OK:
            last = track.nodes[-1]
            at = self._next(points, lengths, last, h, halts)
            drive = np.array([np.interp(at, lengths, row) for row in points])
            following, correction, why = self._step(track.nodes, at, drive)
            if following is None:
                failures.append(why)
                h = 0.5 * (at - last.at)
                if h < SHORTEST_STEP:
                    # beyond a change point positions exist (they lie across), beyond the end of the reach they do not
                    across = failures.count(Status.DEAD_POINT)
                    track.end = Status.DEAD_POINT if 2 * across > len(failures) else Status.OUT_OF_REACH
            else:
                failures.clear()
                track.nodes.append(following)
                h = (at - last.at) * min(2.0, max(0.5, (AIM / max(correction, 1e-9)) ** (1 / 3)))
                h = min(max(h, 10 * SHORTEST_STEP), LONGEST_STEP)
        return track

    @staticmethod
    def _next(points: Array, lengths: Array, last: Node, h: float, halts: Array) -> float:
        """The furthest path point within ``h`` to which the path is straight, or the place at ``h`` where none is within."""
        ahead = np.flatnonzero((lengths > last.at) & (lengths <= last.at + h))
        between = halts[(halts > last.at) & (halts <= last.at + h)]
        if not ahead.size:
            return float(min(last.at + h, lengths[-1]))
        distance = np.sqrt(((points[:, ahead] - last.drive[:, None]) ** 2).sum(axis=0))
        bent = np.flatnonzero(distance < STRAIGHT * (lengths[ahead] - last.at))
        furthest = ahead[max(int(bent[0]) - 1, 0)] if bent.size else ahead[-1]
        return float(min([lengths[furthest], *between]))

    def _step(self, nodes: list[Node], at: float, drive: Array) -> tuple[Node | None, float, Status]:
        last = nodes[-1]
        change = drive - last.drive
        dq = last.Z @ change
        if len(nodes) > 1 and nodes[-2].choice == last.choice:
            before = nodes[-2]
            ratio = float(np.linalg.norm(change)) / max(float(np.linalg.norm(last.drive - before.drive)), 1e-300)
            if ratio < 4 and change @ (last.drive - before.drive) > 0:
                dq = dq + 0.5 * ratio * (last.Z - before.Z) @ change
        choice = last.choice
        x = self.system.advance(last.x[:, None], dq[:, None])
        x[self.rows, 0] = drive
        here, total, done = self.correct(x, choice, NODE_CONVERGED if at - last.at > SURE_STEP else CONVERGED)
        correction = float(np.abs(total).max(initial=0.0))
        if not done[0] and correction < CORRECTION:
            closed, error = close(self.system, x[:, 0], self.columns, iterations=12)
            if error <= 1e-11:
                here, done = self.system.at(closed[:, None]), np.array([True])
                correction = float(np.abs(self.system.difference(here.x, x)).max(initial=0.0))
        if not done[0] or correction > CORRECTION:
            return None, correction, Status.OUT_OF_REACH
        following = self.node(here, at, drive, choice)
        if following.condition > 1e3:
            other = self.node(here, at, drive, self.choose_at(here))
            same_rank = len(self.choices[other.choice].cols) == len(self.choices[choice].cols)
            if same_rank and other.condition < 0.2 * following.condition:
                following = other
            else:
                self.choices.pop()
        if following.condition > SINGULAR or not self._same_side(last, following):
            return None, correction, Status.DEAD_POINT
        return following, correction, Status.OK

    def _same_side(self, a: Node, b: Node) -> bool:
        """Whether no simple singular position lies between two nodes: equal signs of the determinant for one choice."""
        if a.choice == b.choice and a.sign * b.sign > 0:
            return True
        J = self.system.at(np.stack([a.x, b.x], axis=1)).J
        for choice in dict.fromkeys((a.choice, b.choice)):
            c = self.choices[choice]
            signs = Factor(J[np.ix_(c.rows, c.cols)]).sign()
            if signs[0] * signs[1] > 0:
                return True
        middle = self.system.advance(a.x[:, None], 0.5 * self.system.difference(b.x[:, None], a.x[:, None]))
        c = choose(self.system.at(middle).J[:, :, 0], self.columns, keep=self.keep)
        if len(c.cols) != len(self.choices[a.choice].cols):
            return False
        signs = Factor(J[np.ix_(c.rows, c.cols)]).sign()
        return bool(signs[0] * signs[1] > 0)

    # --- all positions -------------------------------------------------------------------------------------------------

    def follow(self, x: Array, values: Array) -> Positions:
        """States for driver values ``(d, C, N)``: every case c from ``x (nx,)`` along its N positions."""
        d, C, N = values.shape
        out = np.full((self.system.n_state, C, N), np.nan)
        here = None
        status = np.full((C, N), Status.OK, dtype=object)
        which = np.zeros((C, N), dtype=np.intp)
        reached = np.empty((d, C))
        tracks: list[tuple[Array, Array, Array] | None] = []
        for c in range(C):
            done = self._case(x, values[:, c])
            if N > 1 and (done[2] == Status.OK).any() and (done[2] != Status.OK).any():
                done = self._behind_gaps(values[:, c], done)
            if N > 1 and (done[2] != Status.OK).all():
                done = self._both_ways(x, values[:, c], done)
            out[:, c], which[c], status[c], reached[:, c], here, followed = done
            tracks.append(followed)
        return Positions(out, status, self.choices, which, reached, here if C == 1 else None, tuple(tracks))

    def _case(self, x: Array, values: Array) -> Case:
        """States, choices, statuses, last driver values reached and evaluation of one case."""
        stops = np.zeros(0, dtype=np.intp)
        for _ in range(4):
            track = self.track(x, values, stops)
            states, choice_of, bad, here = self._between(track, values)
            if not bad.any():
                break
            stops = np.union1d(stops, np.flatnonzero(bad))
        start = track.nodes[0].drive[:, None]
        along = np.cumsum(np.sqrt((np.diff(np.concatenate([start, values], axis=1), axis=1) ** 2).sum(axis=0)))
        followed = (np.array([n.at for n in track.nodes]), np.stack([n.x for n in track.nodes], axis=1), along)
        return states, choice_of, self._statuses(track, values, states, bad), track.nodes[-1].drive, here, followed

    def _behind_gaps(self, values: Array, done: Case) -> Case:
        """Go on from the last position solved to the next one on this side of what could not be passed."""
        states, choice_of, status, reached, _, _ = done
        for _ in range(GAPS):
            last = int(np.flatnonzero(status == Status.OK)[-1])
            beyond = values[:, last + 1 :] - reached[:, None]
            blocked = beyond[:, 0] if beyond.shape[1] else np.zeros(len(values))
            back = np.flatnonzero((beyond * blocked[:, None]).sum(axis=0) < 0)
            if not back.size:
                break
            first = last + 1 + int(back[0])
            more = self._case(states[:, last], values[:, first:])
            if (more[2] != Status.OK).all():
                break
            states[:, first:], choice_of[first:], status[first:], reached = more[:4]
            if (more[2] == Status.OK).all():
                break
        return states, choice_of, status, done[3], None, None

    def _both_ways(self, x: Array, values: Array, failed: Case) -> Case:
        """A path whose first position cannot be reached, entered at its position nearest to the start and followed both ways."""
        near = int(np.argmin(((values - x[self.rows][:, None]) ** 2).sum(axis=0)))
        ahead = self._case(x, values[:, near:])
        behind = self._case(x, values[:, near::-1])
        if (ahead[2] != Status.OK).all():
            return failed
        states, choice_of, status = (
            np.concatenate([b[..., :0:-1], a], axis=-1) for a, b in zip(ahead[:3], behind[:3], strict=True)
        )
        return states, choice_of, status, failed[3], None, None

    def _statuses(self, track: Track, values: Array, states: Array, bad: Array) -> np.ndarray:
        status = np.full(values.shape[1], Status.OK, dtype=object)
        missing = np.isnan(states).any(axis=0)
        beyond = Status.BEYOND_DEAD_POINT if track.end is Status.DEAD_POINT else track.end
        status[missing] = beyond
        if missing.any() and track.end is Status.DEAD_POINT:
            first = int(np.flatnonzero(missing)[0])
            if np.abs(values[:, first] - track.nodes[-1].drive).max() < 100 * SHORTEST_STEP:
                status[first] = Status.DEAD_POINT
        status[bad] = Status.OUT_OF_REACH
        return status

    def _between(self, track: Track, values: Array) -> tuple[Array, Index, Array, Configuration | None]:
        """All positions from the nodes: predicted, corrected; also which of them did not come out as predicted."""
        nodes = track.nodes
        start = nodes[0].drive[:, None]
        at = np.cumsum(np.sqrt((np.diff(np.concatenate([start, values], axis=1), axis=1) ** 2).sum(axis=0)))
        place = np.array([n.at for n in nodes])
        states = np.full((self.system.n_state, values.shape[1]), np.nan)
        bad = np.zeros(values.shape[1], dtype=bool)
        inside = np.flatnonzero(at <= place[-1])
        right = np.clip(np.searchsorted(place, at[inside]), min(1, len(nodes) - 1), len(nodes) - 1)
        left = np.maximum(right - 1, 0)
        choice_of = np.zeros(values.shape[1], dtype=np.intp)
        choice_of[inside] = np.array([n.choice for n in nodes], dtype=np.intp)[right]
        guess = self._predicted(nodes, left, right, at[inside], values[:, inside])
        whole = None
        for choice in np.unique(choice_of[inside]):
            mine = np.flatnonzero(choice_of[inside] == choice)
            here, total, done = self.correct(guess[:, mine], int(choice))
            states[:, inside[mine]] = here.x
            whole = here if mine.size == values.shape[1] else None
            off = np.abs(total).max(axis=0, initial=0.0)
            bad[inside[mine]] = np.logical_not(done) | (off > CORRECTION)
        return states, choice_of, bad, whole

    def _predicted(self, nodes: list[Node], left: Index, right: Index, at: Array, values: Array) -> Array:
        """Hermite interpolation through two nodes and, where the path goes straight on, a third one beside them.

        What lies off the chord is added by the sensitivity to the drivers.
        """
        X = np.stack([n.x for n in nodes], axis=1)
        Z = np.stack([n.Z for n in nodes], axis=2)
        drive = np.stack([n.drive for n in nodes], axis=1)
        place = np.array([n.at for n in nodes])
        if len(nodes) == 1:
            dq = np.einsum("fdt,dt->ft", Z[:, :, left], values - drive[:, left])
        else:
            i = np.minimum(left, len(nodes) - 2)
            slope = np.diff(drive, axis=1) / np.diff(place)
            off = values - (drive[:, i] + (at - place[i]) * slope[:, i])
            u = ((at - place[i]) / (place[i + 1] - place[i]))[None]
            dq = self._hermite(X, Z, slope, place, i, at)
            dq += np.einsum("fdt,dt->ft", (1 - u) * Z[:, :, i] + u * Z[:, :, i + 1], off)
            left = i
        out = self.system.advance(X[:, left], dq)
        out[self.rows] = values
        return out

    def _hermite(self, X: Array, Z: Array, slope: Array, place: Array, interval: Index, at: Array) -> Array:
        """Increments from the left node of each interval, by divided differences over two or three double nodes."""
        n = len(place)
        first = np.arange(n - 1)
        unit = slope / np.sqrt((slope * slope).sum(axis=0))
        straight = (unit[:, 1:] * unit[:, :-1]).sum(axis=0) > 1 - 1e-9
        third = np.full(n - 1, -1)
        third[1:][straight] = first[1:][straight] - 1
        third[:-1][straight & (third[:-1] < 0)] = first[:-1][straight & (third[:-1] < 0)] + 2
        names = np.stack([first, first + 1, np.where(third < 0, first, third)])
        z = np.repeat(place[names] - place[first], 2, axis=0)
        table = np.zeros((6, X.shape[1] and Z.shape[0], n - 1))
        slopes = np.zeros_like(table)
        for k in range(3):
            dq = self.system.difference(X[:, names[k]], X[:, first])
            table[2 * k] = table[2 * k + 1] = dq
            slopes[2 * k] = self.system.tangent(dq, np.einsum("fdt,dt->ft", Z[:, :, names[k]], slope))
        coefficients = [table[0]]
        column = table
        for order in range(1, 6):
            width = z[order:] - z[:-order]
            same = width == 0
            column = np.where(
                same[:, None],
                slopes[: 6 - order] if order == 1 else 0.0,
                np.diff(column, axis=0) / np.where(same, 1.0, width)[:, None],
            )
            coefficients.append(np.where((order < 4) | (third >= 0), column[0], 0.0))
        x = at - place[interval]
        out = coefficients[5][:, interval]
        for order in range(4, -1, -1):
            out = coefficients[order][:, interval] + (x - z[order, interval]) * out
        return np.asarray(out)
