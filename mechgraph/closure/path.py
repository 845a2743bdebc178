"""Positions along a path of driver values: nodes on the way, interpolation between them, one Newton for what is left.

Between the nodes of the march (``closure.march``) further ones are put where many positions are asked for, until interpolation is
as good as rounding allows; what is then not closed is corrected by Newton, all positions of a block together.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mechgraph.algebra.se3 import Array
from mechgraph.closure.configuration import Configuration
from mechgraph.closure.indexing import Index, System
from mechgraph.closure.interpolation import Interpolation
from mechgraph.closure.march import CONVERGED, CORRECTION, ROUNDING, SHORTEST_STEP, Marcher, Node, Status, Track
from mechgraph.numerics.linear import Choice, ChosenSystem, singular_between

GAPS = 20
"""Most gaps behind which a path is taken up again."""
ROUNDS = 12
"""Times that a path is followed at most, with a node at every position that did not come out as predicted before."""
BLOCK = 1024
"""Positions evaluated together, so that what is computed on the way stays in the cache of a core (measured)."""
FINER = 5
"""Times that nodes are put between nodes at most."""
HALVINGS = 4
"""Halvings of a gap at a time at most."""
WORTH = 20
"""Positions for every new node from which on they are worth their time."""
EXACT = 3e-14
"""Error of interpolation that needs no correction."""
SURE = 1e-6
"""Error of interpolation from which on a position is asked whether it is on the branch of its nodes (radians, or lengths / L)."""
GAIN = 1e-3
"""Part of the error of interpolation that nodes twice as dense leave (at most)."""


Tracks = tuple[tuple[Array, Array, Array] | None, ...]
"""For every case path lengths and states ``(nx, K)`` of the nodes and path lengths of the positions, where it was followed in one go."""


@dataclass(frozen=True)
class Positions:
    """States ``(nx, C, N)``, statuses ``(C, N)``, and per position the index of the choice that serves it.

    ``here`` are the evaluations of all positions, block by block, where they are solved. ``tracks`` hold, for every case
    that was followed in one go, path lengths and states ``(nx, K)`` of the nodes and the path lengths of the positions; cases that
    share the arrays of path lengths are continued together.
    """

    x: Array
    status: np.ndarray
    choices: list[Choice]
    which: Index
    reached: Array
    here: tuple[Configuration, ...] = ()
    tracks: Tracks = ()


def fits_one_block(count: int) -> bool:
    """Whether so many positions are evaluated in one piece."""
    return count <= BLOCK


def in_blocks(places: Index) -> list[Index]:
    """Places in parts of about equal size, at most ``BLOCK`` each; at least one part."""
    return [np.asarray(part) for part in np.array_split(places, max(1, -(-len(places) // BLOCK)))]


def _filled(nodes: list[Node], gaps: Index, found: list[tuple[Node | None, float]]) -> tuple[list[Node], Index]:
    """Nodes with those ``found`` in their ``gaps``, and into how many parts every gap is to be cut next."""
    between: dict[int, list[tuple[Node | None, float]]] = {}
    for gap, item in zip(gaps.tolist(), found, strict=True):
        between.setdefault(gap, []).append(item)
    out, parts = [], []
    for i, node in enumerate(nodes):
        mine = between.get(i, [])
        error = max((e for _, e in mine), default=0.0)
        halvings = 0
        while error * GAIN > EXACT and halvings < HALVINGS:
            error *= GAIN
            halvings += 1
        kept = [new for new, _ in mine if new is not None]
        out += [node, *kept]
        parts += [2**halvings] * (len(kept) + 1)
    cut = np.array(parts[:-1], dtype=np.intp)
    for _ in range(HALVINGS):
        # neighbours at most twice as dense: interpolation reaches over both
        cut[1:] = np.maximum(cut[1:], cut[:-1] // 2)
        cut[:-1] = np.maximum(cut[:-1], cut[1:] // 2)
    return out, cut


Case = tuple[Array, Index, np.ndarray, Array, tuple[Configuration, ...], tuple[Array, Array, Array] | None]


def continued(s: System, x: Array, batch: tuple[int, ...], tracks: Tracks) -> Array:
    """User coordinates ``(F, *batch)`` of states ``(nx, positions)``, rotations continued along the path, nodes between included."""
    start = s.start_coordinates(s.m.start)
    turning = any(len(factor) > 1 for g in s.groups for factor in g.row.factors)
    if not turning or not tracks or any(track is None for track in tracks):
        q = s.coordinates_of(x.reshape(s.n_state, *(batch or (1,))), start)
        return q.reshape(s.n_freedoms, *batch)
    cases = x.reshape(s.n_state, len(tracks), x.shape[1] // len(tracks))
    out = np.empty((s.n_freedoms, *cases.shape[1:]))
    together: dict[tuple[int, int], list[int]] = {}
    for c, track in enumerate(tracks):
        together.setdefault((id(track and track[0]), id(track and track[2])), []).append(c)
    for members in together.values():
        passed = [track for c in members if (track := tracks[c]) is not None]
        at, _, along = passed[0]
        order = np.argsort(np.concatenate([at, along]), kind="stable")
        nodes = np.stack([states for _, states, _ in passed], axis=1)
        q = s.coordinates_of(np.concatenate([nodes, cases[:, members]], axis=2)[:, :, order], start)
        back = np.empty_like(order)
        back[order] = np.arange(len(order))
        out[:, members] = q[:, :, back[len(at) :]]
    return out.reshape(s.n_freedoms, *batch)


class Follower(Marcher):
    """Follows driver paths on one system; see ``Marcher``."""

    def follow(self, x: Array, values: Array) -> Positions:
        """States for driver values ``(d, C, N)``: every case c from ``x (nx,)`` along its N positions."""
        d, C, N = values.shape
        out = np.full((self.system.n_state, C, N), np.nan)
        here: tuple[Configuration, ...] = ()
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
        return Positions(out, status, self.choices, which, reached, here if C == 1 else (), tuple(tracks))

    def _case(self, x: Array, values: Array) -> Case:
        """States, choices, statuses, last driver values reached and evaluation of one case."""
        stops = np.zeros(0, dtype=np.intp)
        for _ in range(ROUNDS):
            track = self.track(x, values, stops)
            at = self._along(track, values)
            nodes = self._finer(track, values, at)
            states, choice_of, bad, here = self._between(nodes, values, at)
            if not bad.any():
                break
            stops = np.union1d(stops, np.flatnonzero(bad))
        followed = (np.array([n.at for n in track.nodes]), np.stack([n.x for n in track.nodes], axis=1), at)
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
        return states, choice_of, status, done[3], (), None

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
        return states, choice_of, status, failed[3], (), None

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

    @staticmethod
    def _along(track: Track, values: Array) -> Array:
        """Path lengths ``(N,)`` of all positions from the start of the track."""
        points = np.concatenate([track.nodes[0].drive[:, None], values], axis=1)
        return np.cumsum(np.sqrt((np.diff(points, axis=1) ** 2).sum(axis=0)))

    def _finer(self, track: Track, values: Array, at: Array) -> list[Node]:
        """The nodes of a track with further ones between them, until interpolation is exact or they are too many to be worth it.

        First one in the middle of every gap, which tells the error there; then as many as that error asks for.
        """
        nodes = list(track.nodes)
        lengths = np.concatenate([[0.0], at])
        points = np.concatenate([nodes[0].drive[:, None], values], axis=1)
        parts = np.array([2 if a.choice == b.choice else 1 for a, b in pairwise(nodes)], dtype=np.intp)
        for _ in range(FINER):
            if not (parts > 1).any() or int(parts.sum()) * WORTH > len(at):
                break
            gaps = np.repeat(np.arange(len(parts)), parts - 1)
            place = np.array([n.at for n in nodes])
            share = np.concatenate([np.arange(1, n) / n for n in parts])
            middle = place[gaps] + share * (place[gaps + 1] - place[gaps])
            drives = np.stack([np.interp(middle, lengths, row) for row in points])
            guess = Interpolation(self.system, nodes, self.rows)(middle, drives)
            found = self._closed_nodes(guess, middle, drives, [nodes[i] for i in gaps])
            nodes, parts = _filled(nodes, gaps, found)
        return nodes

    def _closed_nodes(self, x: Array, at: Array, drives: Array, before: list[Node]) -> list[tuple[Node | None, float]]:
        """Nodes from predicted states behind the nodes ``before``, each with its correction; None where it is not beyond doubt."""
        out: list[tuple[Node | None, float]] = [(None, 0.0)] * x.shape[1]
        choice_of = np.array([node.choice for node in before], dtype=np.intp)
        for choice in np.unique(choice_of):
            mine = np.flatnonzero(choice_of == choice)
            here, total, done = self.correct(self.system.at(x[:, mine]), int(choice), ROUNDING)
            solver = ChosenSystem(here.J, [self.choices[choice]], np.zeros(mine.size, dtype=np.intp))
            Z = solver.solve(-here.J[:, self.columns])
            Z[self.columns, np.arange(len(self.columns))] = 1.0
            error = np.abs(total).max(axis=0, initial=0.0)
            signs = solver.signs()
            square = here.J[np.ix_(self.choices[choice].rows, self.choices[choice].cols)]
            other = self._on_other_branch(error, here, [before[i] for i in mine])
            for t in np.flatnonzero(done & (error < CORRECTION) & ~other):
                i = int(mine[t])
                node = Node(
                    here.x[:, t],
                    Z[:, :, t],
                    float(at[i]),
                    drives[:, i],
                    int(choice),
                    float(solver.condition[t]),
                    signs[t],
                    square[:, :, t],
                )
                out[i] = node, float(error[t])
        return out

    def _on_other_branch(self, error: Array, here: Configuration, nodes: list[Node]) -> NDArray[np.bool_]:
        """Whether a singular position lies between positions that took a correction ``error (T,)`` and nodes of one choice beside them.

        Where the prediction was good nobody needs to ask.
        """
        out = np.zeros(error.size, dtype=bool)
        ask = np.flatnonzero(error > SURE)
        if ask.size:
            chosen = self.choices[nodes[0].choice]
            square = here.part(ask).J[np.ix_(chosen.rows, chosen.cols)]
            out[ask] = singular_between(np.stack([nodes[t].square for t in ask], axis=2), square)
        return out

    def _between(
        self, nodes: list[Node], values: Array, at: Array
    ) -> tuple[Array, Index, Array, tuple[Configuration, ...]]:
        """All positions from the nodes: predicted, corrected; also which of them did not come out as predicted."""
        states = np.full((self.system.n_state, values.shape[1]), np.nan)
        bad = np.zeros(values.shape[1], dtype=bool)
        inside = np.flatnonzero(at <= nodes[-1].at)
        predict = Interpolation(self.system, nodes, self.rows)
        choice_of = np.zeros(values.shape[1], dtype=np.intp)
        next_ = predict.intervals(at)[1]
        choice_of[inside] = np.array([n.choice for n in nodes], dtype=np.intp)[next_[inside]]
        blocks = []
        kinds = np.unique(choice_of[inside])
        for choice in kinds:
            mine = inside[choice_of[inside] == choice]
            for part in in_blocks(mine):
                guess = self.system.at(predict(at[part], values[:, part]))
                here, total, done = self.correct(guess, int(choice), CONVERGED)
                states[:, part] = here.x
                error = np.abs(total).max(axis=0, initial=0.0)
                other = self._on_other_branch(error, here, [nodes[i] for i in next_[part]])
                bad[part] = np.logical_not(done) | (error > CORRECTION) | other
                blocks.append(here)
        whole = len(kinds) == 1 and inside.size == values.shape[1]
        return states, choice_of, bad, tuple(blocks) if whole else ()
