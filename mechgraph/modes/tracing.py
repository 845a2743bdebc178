"""Every assembly followed over the range of one driver, all in one batch: pieces between samples, joined into branches and circuits.

At evenly spread samples of the driver all assemblies are known; from each, the engine's path follower goes to both neighbours, or out to
the rim of the range. A piece that arrives meets an assembly there; a piece that ends at a fold meets the other one that ends there; pieces
that pass the same crossing meet in it. Pieces that arrive, one after the other, are a branch; branches that meet are a circuit.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from mechgraph.closure.configuration import Configuration
from mechgraph.closure.driver_path import DriverPath, Positions, Request, Status
from mechgraph.closure.following import follow
from mechgraph.closure.indexing import Index
from mechgraph.closure.solver import closure_solver, engine_for
from mechgraph.graph.linkgraph import components_of_edges, members
from mechgraph.modes.family import Array, Family
from mechgraph.modes.question import Question
from mechgraph.numerics.continuation import End
from mechgraph.numerics.crossings import passed

Node = tuple[int, int]
"""An assembly: the number of its sample, and its own there."""
ARRIVES = 1e-6
"""Difference of link poses up to which a piece arrives at an assembly."""
MEETS = 1e-6
"""Difference of driver values up to which pieces end at the same fold."""
TOUCHES = 1e-3
"""Difference of link poses at a fold or a crossing: they grow with the root of the distance from a fold."""


@dataclass
class Piece:
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
    """Follows assemblies ``states[i] (nx, M_i)`` at ``samples (S,)`` of a driver to the neighbours, with ``points`` values between.

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

    def pieces(self) -> list[Piece]:
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
                    out.append(Piece(i, mode, sense, values, np.zeros(0), rim=rim))
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

    def _read(self, piece: Piece, places: Index, found: Positions, reach: dict[int, tuple[float, Array]]) -> None:
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
            if gaps.size and gaps.min() < ARRIVES * max(1.0, float(np.abs(here).max())):
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

    def __init__(self, pieces: list[Piece], states: list[Array]) -> None:
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

    def branch(self, piece: Piece) -> int:
        """The branch of a piece."""
        return self.of[piece.sample, piece.mode]

    @staticmethod
    def _folds(ended: list[Piece]) -> list[tuple[Piece, Piece]]:
        out = []
        for i, a in enumerate(ended):
            for b in ended[i + 1 :]:
                apart = np.abs(a.last - b.last).max() / max(1.0, float(np.abs(a.last).max()))
                if (a.sample, a.sense) == (b.sample, b.sense) and abs(a.end - b.end) < MEETS and apart < TOUCHES:
                    out.append((a, b))
        return out

    @staticmethod
    def _crossings(crossed: list[tuple[Piece, float, Array]]) -> list[tuple[float, list[Piece]]]:
        out: list[tuple[float, list[Piece], Array]] = []
        for piece, value, at in crossed:
            for known, pieces, there in out:
                turns = (value - known) / (2 * np.pi)
                if abs(turns - round(turns)) < TOUCHES and np.abs(at - there).max() < TOUCHES * max(
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
