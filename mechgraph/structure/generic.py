"""What the topology alone decides: the rank for random geometry, and which loops are redundant whatever the dimensions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from mechgraph.algebra.se3 import Array, rotation_exp
from mechgraph.closure.loop_rows import ClosureRows
from mechgraph.closure.rank import EngineName, rank_of_rows
from mechgraph.graph.linkgraph import LinkGraph
from mechgraph.model.mechanism import Mechanism
from mechgraph.numerics.tolerances import RANKS
from mechgraph.pairs import kinematics as evaluation
from mechgraph.pairs.pair_type import PairType

GEOMETRY_SEED = 11


@dataclass(frozen=True)
class Generic:
    """Random geometry: ``rank``, ``mobility``, ``excess`` (structural: rows - rank), and where the excess sits.

    ``places`` are (excess, loop indices): sets of loops that share self-stresses whatever the dimensions.
    """

    rank: int
    mobility: int
    excess: int
    places: tuple[tuple[int, tuple[int, ...]], ...]


def random_twists(m: Mechanism, rng: np.random.Generator) -> tuple[Array, Array]:
    """Twists ``(6, F)`` of all pairs at random poses and coordinates, and the points ``(3, P)`` at which the pairs are."""
    by_type: dict[PairType, list[int]] = {}
    for k, pair in enumerate(m.pairs):
        by_type.setdefault(pair.type, []).append(k)
    first = np.concatenate([[0], np.cumsum([p.type.f for p in m.pairs])]).astype(np.intp)
    S, points = np.empty((6, int(first[-1]))), np.empty((3, len(m.pairs)))
    for row, pairs in by_type.items():
        n = len(pairs)
        base = np.empty((3, 4, n, 1))
        base[:, :3, :, 0] = rotation_exp(rng.uniform(-2, 2, (3, n)))
        base[:, 3, :, 0] = points[:, pairs] = rng.normal(size=(3, n))
        x = evaluation.random_coordinates(row, rng, n, 1)
        pitch = rng.uniform(0.3, 0.9, (n, 1))
        twists = evaluation.twists_of(row, pitch, evaluation.frames_of(row, pitch, x, base))[..., 0]
        S[:, first[pairs] + np.arange(row.f)[:, None]] = twists
    return S, points


def random_rows(m: Mechanism, graph: LinkGraph) -> ClosureRows:
    """The closure equations with random geometry (fixed seed)."""
    twists, points = random_twists(m, np.random.default_rng(GEOMETRY_SEED))
    first = np.concatenate([[0], np.cumsum([p.type.f for p in m.pairs])]).astype(np.intp)
    more = coupling_rows(m, int(first[-1]))
    return ClosureRows(graph, first, twists, points, more)


def coupling_rows(m: Mechanism, width: int) -> scipy.sparse.csr_array | None:
    """A row with random coefficients in the freedoms of every coupling."""
    couplings = getattr(m, "couplings", ())
    if not couplings:
        return None
    out = np.zeros((len(couplings), width))
    place = {name: i for i, name in enumerate(m.freedom_names())}
    rng = np.random.default_rng(GEOMETRY_SEED)
    for row, coupling in zip(out, couplings, strict=True):
        row[[place[m.full_name(name)] for name, _ in coupling.terms]] = rng.uniform(0.5, 1.5, len(coupling.terms))
    return scipy.sparse.csr_array(out)


def generic(m: Mechanism, graph: LinkGraph, engine: EngineName = "auto") -> Generic:
    """Rank for random geometry, by the same engines as at a position; local pivots decide, as chains are ill-conditioned."""
    closure = rank_of_rows(random_rows(m, graph), None, engine, RANKS.generic, RANKS.generic)
    freedoms = closure.reduced.rows.S.shape[1]
    return Generic(closure.rank, freedoms - closure.rank, closure.count - closure.rank, closure.sets)
