"""What the topology alone decides: rank of the closure Jacobian for random geometry, and which loops are over whatever the dimensions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mechgraph.algebra.screw import null_space
from mechgraph.algebra.se3 import Array, rotation_exp
from mechgraph.model import pair_evaluation as evaluation
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.linear import rank_of, singular_values
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


def random_jacobian(m: Mechanism, graph: LinkGraph, rng: np.random.Generator) -> Array:
    """Closure Jacobian ``(6 loops, F)`` with every pair at a random pose and random coordinates."""
    columns = []
    for pair in m.pairs:
        base = np.empty((3, 4, 1, 1))
        base[:, :3, 0, 0] = rotation_exp(rng.uniform(-2, 2, 3))
        base[:, 3, 0, 0] = rng.normal(size=3)
        x = evaluation.random_coordinates(pair.type, rng, 1, 1)
        pitch = rng.uniform(0.3, 0.9, (1, 1))
        columns.append(
            evaluation.twists_of(pair.type, pitch, evaluation.frames_of(pair.type, pitch, x, base))[:, :, 0, 0]
        )
    first = np.concatenate([[0], np.cumsum([c.shape[1] for c in columns])])
    J = np.zeros((6 * len(graph.loops), int(first[-1])))
    for i, loop in enumerate(graph.loops):
        for k, sign in loop:
            J[6 * i : 6 * i + 6, first[k] : first[k + 1]] += sign * columns[k]
    return J


def generic(m: Mechanism, graph: LinkGraph) -> Generic:
    """Generic rank of a topology: the largest rank over a few random geometries (fixed seed)."""
    rng = np.random.default_rng(SEED)
    best, rank = np.zeros((0, 0)), -1
    for _ in range(TRIALS):
        J = random_jacobian(m, graph, rng)
        r = rank_of(singular_values(J), GENERIC_RANK)
        if r > rank:
            best, rank = J, r
    excess = best.shape[0] - rank
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
