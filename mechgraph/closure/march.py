"""Marching along a path of driver values: nodes found one after the other, then all closed together.

A node is predicted from those before it (Hermite interpolation through values and sensitivities, extrapolated) and corrected by
Newton, with step control. On easy ground one evaluation a node is enough: the march checks that the correction is small, the
equations are well conditioned and the determinant keeps its sign, and closes all nodes in one batch at the end. Where that
does not come out as expected, the path is marched again with every node closed. Source: Allgower and Georg, Introduction to
Numerical Continuation Methods, 2003, chapters 2 and 6.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum

import numpy as np

from mechgraph.algebra.se3 import Array
from mechgraph.closure.assembly import close, state_rows
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.numerics.linear import Choice, ChosenSystem, Factor, choose, singular_between

CONVERGED = 1e-13
"""Closure residual that Newton aims at."""
ACCEPTED = 1e-11
"""Closure residual with which a position counts as solved where rounding allows no better."""
NODE_CONVERGED = 1e-5
"""Closure residual at which a node is good enough to predict from, after one more step."""
ITERATIONS = 8
"""Most Newton iterations at a position."""
SURE_STEP = 0.01
"""Steps below this are closed fully: the end of the reach is near."""
LONGEST_STEP = 0.35
"""Longest step between nodes, in driver space (radians, or lengths / L)."""
STRAIGHT = 0.98
"""Smallest ratio of chord to path between two nodes; a path that bends or turns back gets a node there."""
HAIR = 1e-12
"""Distance at which a place on the path is taken for the path point beside it."""
NEARER = 0.8
"""Part of the way to the end of the reach that a step takes where one across it has failed."""
SHORTEST_STEP = 1e-7
"""Step at which the continuation gives up."""
CORRECTION = 0.06
"""Largest correction that a node may need; keeps the continuation on its branch."""
LOST = 0.3
"""Correction from which on Newton is given up: it has left for elsewhere."""
AIM = 0.005
"""Correction that the step control aims at."""
QUICK = 0.02
"""Correction up to which one evaluation is enough for a node (it is closed with all others at the end)."""
SHIFT = 0.02
"""Largest shift of a node in that last closing."""
FAIR = 1e3
"""Condition number of the closure equations above which another choice of rows and columns is tried."""
ROUNDING = 1e-14
"""Closure residual that nodes are brought to, so that what is interpolated between them needs no correction."""
PAST = 2
"""Nodes from which the next one is predicted."""
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

    ``square`` is the chosen part of the closure Jacobian, with its ``condition`` and the ``sign`` of its determinant.
    """

    x: Array
    Z: Array
    at: float
    drive: Array
    choice: int
    condition: float
    sign: float
    square: Array


@dataclass
class Track:
    """The nodes of one case and how it ended."""

    nodes: list[Node] = field(default_factory=list)
    end: Status = Status.OK


class Marcher:
    """Marches on one system. ``columns`` are the driven freedoms, ``keep`` freedoms preferably held."""

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

    def correct(self, here: Configuration, choice: int, goal: float = CONVERGED) -> tuple[Configuration, Array, Array]:
        """Newton on the chosen rows and columns for a batch of positions, until the closure residual is below ``goal``.

        Returns the last configuration, the sum of the corrections ``(F, T)`` and which positions converged.
        """
        total = np.zeros((self.system.n_freedoms, here.T))
        left = np.abs(here.residual).max(axis=0, initial=0.0)
        if not len(self.choices[choice].cols):
            return here, total, left <= max(goal, ACCEPTED)
        for round_ in range(ITERATIONS):
            part = np.flatnonzero((left > goal) & (np.abs(total).max(axis=0, initial=0.0) < LOST))
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
                few, more, _ = self.correct(self.system.at(here.x[:, part]), choice, goal)
                total[:, part] += more
                x[:, part] = few.x
                left[part] = np.abs(few.residual).max(axis=0, initial=0.0)
                here = self.system.at(x)
                break
        unmet = np.flatnonzero((left > 10 * goal) & (left <= ACCEPTED))
        if unmet.size and len(self.choices[choice].rows) < here.residual.shape[0]:
            here, more = self._closer(here, unmet)
            total += more
        return here, total, left <= max(goal, ACCEPTED)

    def _closer(self, here: Configuration, at: Index) -> tuple[Configuration, Array]:
        """Positions ``at`` of redundant loops with one more step on rows chosen where the residual is largest, and all steps ``(F, T)``."""
        few = self.system.at(here.x[:, at])
        left = np.abs(few.residual).max(axis=0)
        step = self._step_on(choose(few.J[:, :, int(np.argmax(left))], self.columns, keep=self.keep), few)
        closer = self.system.at(self.system.advance(few.x, step))
        better = np.abs(closer.residual).max(axis=0) < left
        x, more = here.x.copy(), np.zeros((self.system.n_freedoms, here.T))
        x[:, at[better]], more[:, at[better]] = closer.x[:, better], step[:, better]
        return self.system.at(x), more

    def closed_again(self, x: Array, which: Index) -> tuple[Array, Array]:
        """States closed from near by, each with its choice; also the largest correction ``(T,)``, infinite where it failed."""
        out, shift = x.copy(), np.zeros(x.shape[1])
        for choice in np.unique(which):
            at = np.flatnonzero(which == choice)
            here, total, done = self.correct(self.system.at(x[:, at]), int(choice))
            out[:, at] = here.x
            shift[at] = np.where(done, np.abs(total).max(axis=0, initial=0.0), np.inf)
        return out, shift

    def newton_step(self, here: Configuration, choice: int) -> Array:
        """One limited Newton step ``(F, T)`` at every state of a configuration."""
        return self._step_on(self.choices[choice], here)

    def _step_on(self, chosen: Choice, here: Configuration) -> Array:
        J = here.J[np.ix_(chosen.rows, chosen.cols)]
        step = Factor(J).solve(-here.residual[chosen.rows][:, None])[:, 0]
        step = np.where(np.isfinite(step), step, 0.0)
        step *= np.minimum(1.0, 0.5 / np.maximum(np.abs(step).max(axis=0), 1e-300))
        dq = np.zeros((self.system.n_freedoms, here.T))
        dq[chosen.cols] = step
        return dq

    def node(self, here: Configuration, at: float, drive: Array, choice: int) -> tuple[Node, float]:
        """A node near a nearly closed position, one Newton step from it; also the size of that step."""
        chosen = self.choices[choice]
        J, r = here.J[:, :, 0], here.residual[:, 0]
        square = J[chosen.rows[:, None], chosen.cols]
        Z = np.zeros((self.system.n_freedoms, len(self.columns)))
        Z[self.columns, np.arange(len(self.columns))] = 1.0
        try:
            inverse = np.linalg.inv(square)
        except np.linalg.LinAlgError:
            return Node(here.x[:, 0], Z, at, drive, choice, np.inf, 0.0, square), np.inf
        Z[chosen.cols] = -inverse @ J[chosen.rows[:, None], self.columns]
        step = np.zeros((self.system.n_freedoms, 1))
        step[chosen.cols, 0] = -inverse @ r[chosen.rows]
        size = float(np.abs(step).max(initial=0.0))
        x = self.system.advance(here.x, step) if np.isfinite(size) else here.x
        norms = [float(np.abs(M).sum(axis=1).max(initial=0.0)) for M in (square, inverse)]
        sign = float(np.linalg.slogdet(square)[0])
        condition = norms[0] * norms[1] if len(square) else 1.0
        condition = condition if condition == condition else np.inf
        return Node(x[:, 0], Z, at, drive, choice, condition, sign, square), size

    # --- one path ------------------------------------------------------------------------------------------------------

    def track(self, x: Array, values: Array, stops: Index | None = None) -> Track:
        """Follow driver values ``(d, N)`` from the closed state ``x (nx,)``; path points are the start and all values.

        Nodes do not pass over the positions in ``stops``.
        """
        track = self._marched(x, values, stops, quick=True)
        if self._settle(track):
            return track
        self.choices.clear()
        track = self._marched(x, values, stops, quick=False)
        self._settle(track)
        return track

    def _marched(self, x: Array, values: Array, stops: Index | None, quick: bool) -> Track:
        """The nodes of a path; with ``quick`` some of them not closed yet."""
        points = np.concatenate([x[self.rows][:, None], values], axis=1)
        lengths = np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(points, axis=1) ** 2).sum(axis=0)))])
        here = self.system.at(x[:, None])
        track = Track([self.node(here, 0.0, points[:, 0], self.choose_at(here))[0]])
        if track.nodes[0].condition > SINGULAR:
            track.end = Status.DEAD_POINT
        halts = lengths[1:][stops] if stops is not None else np.zeros(0)
        h = 0.05
        end = lengths[-1]
        failures: list[Status] = []
        limited = False
        while track.nodes[-1].at < end and track.end is Status.OK:
            last = track.nodes[-1]
            at = self._next(points, lengths, last, h, halts)
            drive = np.array([np.interp(at, lengths, row) for row in points])
            following, correction, order, why = self._step(track.nodes, at, drive, quick)
            if following is None:
                failures.append(why)
                limited = True
                h = max(min(0.5 * (at - last.at), NEARER * self._left(track.nodes)), (at - last.at) / 64)
                if h < SHORTEST_STEP:
                    # beyond a change point positions exist (they lie across), beyond the end of the reach they do not
                    across = failures.count(Status.DEAD_POINT)
                    track.end = Status.DEAD_POINT if 2 * across > len(failures) else Status.OUT_OF_REACH
            else:
                failures.clear()
                track.nodes.append(following)
                h = (at - last.at) * min(2.0, max(0.5, (AIM / max(correction, 1e-9)) ** (1 / order)))
                left = self._left(track.nodes) if limited else np.inf
                limited = left < np.inf
                h = min(max(min(h, NEARER * left), 10 * SHORTEST_STEP), LONGEST_STEP)
        return track

    @staticmethod
    def _left(nodes: list[Node]) -> float:
        """How far from the last node the reach ends, if it does: rates grow as ``|s* - s|^-1/2`` there; infinite where they do not grow."""
        if len(nodes) < 2:
            return np.inf
        before, last = (float(np.abs(node.Z).max()) for node in nodes[-2:])
        grown = (last / before) ** 2 - 1.0
        return (nodes[-1].at - nodes[-2].at) / grown if grown > 0 else np.inf

    @staticmethod
    def _next(points: Array, lengths: Array, last: Node, h: float, halts: Array) -> float:
        """The furthest path point within ``h`` to which the path is straight, or the place at ``h`` where none is within."""
        ahead = np.arange(*np.searchsorted(lengths, (last.at, last.at + h + HAIR), side="right"))
        between = halts[(halts > last.at) & (halts <= last.at + h + HAIR)]
        if not ahead.size:
            return float(min(last.at + h, lengths[-1]))
        distance = np.sqrt(((points[:, ahead] - last.drive[:, None]) ** 2).sum(axis=0))
        bent = np.flatnonzero(distance < STRAIGHT * (lengths[ahead] - last.at))
        furthest = ahead[max(int(bent[0]) - 1, 0)] if bent.size else ahead[-1]
        return float(min([lengths[furthest], *between]))

    def _step(self, nodes: list[Node], at: float, drive: Array, quick: bool) -> tuple[Node | None, float, int, Status]:
        """The next node, or None; the correction that it took, the order of the prediction, and why there is none."""
        last = nodes[-1]
        dq, order = self._ahead(nodes, at, drive)
        choice = last.choice
        x = self.system.advance(last.x[:, None], dq[:, None])
        x[self.rows, 0] = drive
        here = self.system.at(x)
        sure = at - last.at <= SURE_STEP
        if quick and not sure:
            following, correction = self.node(here, at, drive, choice)
            if correction <= QUICK and following.condition < FAIR and following.sign * last.sign > 0:
                return following, correction, order, Status.OK
        here, total, done = self.correct(here, choice, CONVERGED if sure else NODE_CONVERGED)
        correction = float(np.abs(total).max(initial=0.0))
        if not done[0] and correction < CORRECTION and self._met_in_part(here, choice):
            closed, error = close(self.system, x[:, 0], self.columns, iterations=12, patience=0)
            if error <= 1e-11:
                here, done = self.system.at(closed[:, None]), np.array([True])
                correction = float(np.abs(self.system.difference(here.x, x)).max(initial=0.0))
        if not done[0] or correction > CORRECTION:
            return None, correction, order, Status.OUT_OF_REACH
        following = self._best_choice(here, self.node(here, at, drive, choice)[0])
        if following.condition > FAIR and not sure:
            # nearly closed is not closed here: the place may lie in a narrow gap of the reach
            here, more, done = self.correct(here, following.choice, CONVERGED)
            correction = max(correction, float(np.abs(total + more).max(initial=0.0)))
            if not done[0] or correction > CORRECTION:
                return None, correction, order, Status.OUT_OF_REACH
            following = self.node(here, at, drive, following.choice)[0]
        if following.condition > SINGULAR or not self._same_side(last, following):
            return None, correction, order, Status.DEAD_POINT
        return following, correction, order, Status.OK

    def _met_in_part(self, here: Configuration, choice: int) -> bool:
        """Whether the chosen rows are met and only rows thought redundant are not: another choice may close the loops."""
        rows = self.choices[choice].rows
        return len(rows) < here.residual.shape[0] and bool(
            np.abs(here.residual[rows]).max(initial=0.0) <= NODE_CONVERGED
        )

    def _best_choice(self, here: Configuration, node: Node) -> Node:
        """The node with another choice of rows and columns where its own is poorly conditioned and the other much better."""
        if node.condition <= FAIR:
            return node
        other = self.node(here, node.at, node.drive, self.choose_at(here))[0]
        same_rank = len(self.choices[other.choice].cols) == len(self.choices[node.choice].cols)
        if same_rank and other.condition < 0.2 * node.condition:
            return other
        self.choices.pop()
        return node

    def _ahead(self, nodes: list[Node], at: float, drive: Array) -> tuple[Array, int]:
        """Increments ``(F,)`` from the last node to driver values, and the order of their error in the step.

        Where the path goes straight on: Hermite interpolation of values ``y_k`` and rates ``d_k`` at the last nodes ``s_k``,
        ``sum_k (1 - 2 (s - s_k) l_k'(s_k)) l_k^2 y_k + (s - s_k) l_k^2 d_k``, extrapolated; else the change of rates of one step.
        """
        last = nodes[-1]
        change = drive - last.drive
        past = self._straight_past(nodes, change, at)
        if len(past) < 2:
            dq = last.Z @ change
            if len(nodes) > 1 and nodes[-2].choice == last.choice:
                before = nodes[-2]
                ratio = float(np.linalg.norm(change)) / max(float(np.linalg.norm(last.drive - before.drive)), 1e-300)
                if ratio < 4 and change @ (last.drive - before.drive) > 0:
                    return dq + 0.5 * ratio * (last.Z - before.Z) @ change, 3
            return dq, 2
        rates = np.stack([n.Z for n in past], axis=2).transpose(0, 2, 1) @ (change / (at - last.at))
        y = self.system.difference(np.stack([n.x for n in past], axis=1), last.x[:, None])
        d = self.system.tangent(y, rates)
        places = [n.at for n in past]
        dq = np.zeros(len(y))
        for k, s in enumerate(places):
            others = [p for j, p in enumerate(places) if j != k]
            square = float(np.prod([(at - p) / (s - p) for p in others])) ** 2
            lean = sum(1.0 / (s - p) for p in others)
            dq += (1.0 - 2.0 * (at - s) * lean) * square * y[:, k] + (at - s) * square * d[:, k]
        # nothing would correct what is extrapolated into freedoms that are held
        dq[self.choices[last.choice].held] = 0.0
        return dq, 2 * len(past)

    @staticmethod
    def _straight_past(nodes: list[Node], change: Array, at: float) -> list[Node]:
        """The last nodes, newest first, from which the path comes straight on with the same choice and in steps of fair size."""
        out = [nodes[-1]]
        longest = 4.0 * (at - nodes[-1].at)
        for before in nodes[-2 : -PAST - 1 : -1]:
            after = out[-1]
            step = after.drive - before.drive
            size = float(np.linalg.norm(step)) * float(np.linalg.norm(change))
            fair = longest / 16.0 < after.at - before.at < longest
            if before.choice != after.choice or not fair or not step @ change > (1 - 1e-9) * size:
                break
            out.append(before)
        return out

    def _same_side(self, a: Node, b: Node) -> bool:
        """Whether no singular position lies between two nodes: none on the straight way between their matrices for one choice."""
        if a.choice == b.choice:
            if not singular_between(a.square[..., None], b.square[..., None])[0]:
                return True
        J = self.system.at(np.stack([a.x, b.x], axis=1)).J
        others = [self.choices[i] for i in dict.fromkeys((a.choice, b.choice))] if a.choice != b.choice else []
        middle = self.system.advance(a.x[:, None], 0.5 * self.system.difference(b.x[:, None], a.x[:, None]))
        others.append(choose(self.system.at(middle).J[:, :, 0], self.columns, keep=self.keep))
        for c in others:
            square = J[np.ix_(c.rows, c.cols)]
            if (
                len(c.cols) == len(self.choices[a.choice].cols)
                and not singular_between(square[..., :1], square[..., 1:])[0]
            ):
                return True
        return False

    def _settle(self, track: Track) -> bool:
        """Close all nodes of a track in one batch, with their sensitivities; whether they are as the march took them to be."""
        nodes = track.nodes
        fine = True
        for choice in dict.fromkeys(n.choice for n in nodes):
            mine = [i for i, n in enumerate(nodes) if n.choice == choice and n.condition < FAIR]
            if not mine:
                continue
            here, total, done = self.correct(
                self.system.at(np.stack([nodes[i].x for i in mine], axis=1)), choice, ROUNDING
            )
            solver = ChosenSystem(here.J, [self.choices[choice]], np.zeros(len(mine), dtype=np.intp))
            Z = solver.solve(-here.J[:, self.columns])
            Z[self.columns, np.arange(len(self.columns))] = 1.0
            signs = solver.signs()
            moved = np.abs(total).max(axis=0, initial=0.0)
            fine &= bool(done.all()) and bool((moved < SHIFT).all())
            fine &= bool((signs * [nodes[i].sign for i in mine] > 0).all())
            pairs = [t for t in range(1, len(mine)) if mine[t] == mine[t - 1] + 1]
            chosen = self.choices[choice]
            square = here.J[np.ix_(chosen.rows, chosen.cols)]
            fine &= not singular_between(square[:, :, [t - 1 for t in pairs]], square[:, :, pairs]).any()
            for t, i in enumerate(mine):
                if done[t] and moved[t] < SHIFT:
                    nodes[i] = replace(nodes[i], x=here.x[:, t], Z=Z[:, :, t])
        return fine
