"""What the topology alone decides: rank of the closure Jacobian for random geometry, and which loops are over whatever the dimensions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.screw import null_space
from mechgraph.algebra.se3 import Array, rotation_exp
from mechgraph.closure.bordering import LoopSystem
from mechgraph.model import pair_kinematics as evaluation
from mechgraph.model.mechanism import Mechanism
from mechgraph.model.pair_type import PairType
from mechgraph.numerics.linear import rank_of, singular_values
from mechgraph.structure.bordered import Bordered
from mechgraph.structure.elimination import Elimination, LoopRows, loop_rows
from mechgraph.structure.mobility import LARGE
from mechgraph.topology.linkgraph import LinkGraph

GENERIC_RANK = 1e-7
"""Relative singular value that counts as zero for random geometry of size one."""
TRIALS = 2
SEED = 11


@dataclass(frozen=True)
class Generic:
    """Random geometry: ``rank``, ``mobility``, ``excess`` (structural: 6 loops - rank), and where the excess sits.

    ``places`` are (excess, loop indices): sets of loops that share self-stresses whatever the dimensions.
    """

    rank: int
    mobility: int
    excess: int
    places: tuple[tuple[int, tuple[int, ...]], ...]


def random_twists(m: Mechanism, rng: np.random.Generator) -> tuple[list[Array], Array]:
    """Twists ``(6, f)`` of every pair at a random pose and random coordinates, and the points ``(3, P)`` at which the pairs are."""
    twists, points = [], []
    by_type: dict[PairType, list[int]] = {}
    for k, pair in enumerate(m.pairs):
        by_type.setdefault(pair.type, []).append(k)
    found: dict[int, tuple[Array, Array]] = {}
    for row, pairs in by_type.items():
        n = len(pairs)
        base = np.empty((3, 4, n, 1))
        base[:, :3, :, 0] = rotation_exp(rng.uniform(-2, 2, (3, n)))
        base[:, 3, :, 0] = rng.normal(size=(3, n))
        x = evaluation.random_coordinates(row, rng, n, 1)
        pitch = rng.uniform(0.3, 0.9, (n, 1))
        S = evaluation.twists_of(row, pitch, evaluation.frames_of(row, pitch, x, base))[..., 0]
        found |= {k: (S[:, :, i], base[:, 3, i, 0]) for i, k in enumerate(pairs)}
    for k in range(len(m.pairs)):
        twists.append(found[k][0])
        points.append(found[k][1])
    return twists, np.array(points).T


def random_rows(m: Mechanism, graph: LinkGraph, rng: np.random.Generator) -> tuple[LoopRows, list[Array]]:
    """Closure Jacobian by loops for random geometry, and the points of the pairs of every loop."""
    twists, points = random_twists(m, rng)
    first = np.concatenate([[0], np.cumsum([c.shape[1] for c in twists])])
    S = np.concatenate(twists, axis=1)
    columns = []
    for loop in graph.loops:
        at = [np.arange(first[k], first[k + 1]) for k, _ in loop]
        signs = [np.full(len(c), float(sign)) for c, (_, sign) in zip(at, loop, strict=True)]
        columns.append((np.concatenate(at), np.concatenate(signs)))
    return loop_rows(S, columns), [points[:, [k for k, _ in loop]] for loop in graph.loops]


def dense(rows: LoopRows) -> Array:
    """The closure Jacobian ``(6 loops, F)`` as one matrix."""
    J = np.zeros((6 * len(rows.blocks), rows.width))
    for i, (columns, block) in enumerate(zip(rows.columns, rows.blocks, strict=True)):
        J[6 * i : 6 * i + 6, columns] = block
    return J


def generic(m: Mechanism, graph: LinkGraph) -> Generic:
    """Generic rank of a topology: the largest rank over a few random geometries (fixed seed)."""
    rng = np.random.default_rng(SEED)
    count = 6 * len(graph.loops)
    if count > LARGE:
        state = rng.bit_generator.state
        twists, points = random_twists(m, rng)
        first = np.concatenate([[0], np.cumsum([c.shape[1] for c in twists])]).astype(np.intp)
        S = np.concatenate(twists, axis=1)
        found: Bordered | Elimination
        found = Bordered(LoopSystem(graph, first, S, points, np.zeros(0, dtype=np.intp)), S)
        if not found.smallest > GENERIC_RANK:
            rng.bit_generator.state = state
            found = Elimination(*random_rows(m, graph, rng), GENERIC_RANK)
        return Generic(found.rank, S.shape[1] - found.rank, count - found.rank, found.sets)
    best, rank = np.zeros((0, 0)), -1
    for _ in range(TRIALS):
        J = dense(random_rows(m, graph, rng)[0])
        r = rank_of(singular_values(J), GENERIC_RANK)
        if r > rank:
            best, rank = J, r
    excess = count - rank
    places = _places(null_space(best.T, GENERIC_RANK), len(graph.loops)) if excess else ()
    return Generic(rank, best.shape[1] - rank, excess, places)


def _places(null: Array, loops: int) -> tuple[tuple[int, tuple[int, ...]], ...]:
    """Loops that self-stresses ``(6 loops, s)`` connect, with the number of self-stresses of each set."""
    projector = null @ null.T
    linked = np.abs(projector.reshape(loops, 6, loops, 6)).max(axis=(1, 3)) > 1e-7
    left = set(range(loops))
    out = []
    while left:
        group, front = set(), [min(left)]
        while front:
            i = front.pop()
            if i not in group:
                group.add(i)
                front += [int(j) for j in np.flatnonzero(linked[i])]
        left -= group
        rows = np.concatenate([np.arange(6 * i, 6 * i + 6) for i in sorted(group)])
        count = round(float(np.trace(projector[np.ix_(rows, rows)])))
        if count:
            out.append((count, tuple(sorted(group))))
    return tuple(out)
